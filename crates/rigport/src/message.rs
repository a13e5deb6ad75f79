//! What passes between the loop and a rig: two plain structures, the same in process, in shared
//! memory and on a wire. `docs/rig-protocol.md` gives every byte.
//!
//! SI units. Lengths of the legs are from joint to joint; poses and twists are of the plate `ep` in
//! the ground `eb`; a wrench is a force and a moment about the origin of its sensor, in its axes, as
//! the sensor measures it from what it carries.
//!
//! Convention of time, everywhere: the measurement read in tick k is the state of the rig at `t_k`;
//! the command written in tick k is for `t_{k+1}` and is held until the next.
//!
//! A clear bit of [`Capabilities`] marks a value as absent; a zero does not. Numbers whose bit is
//! clear are ignored.

use core::fmt;

use bitflags::bitflags;
use docktwin_core::{DQuat, DVec3, Pose, Twist, Wrench};
use iceoryx2::prelude::ZeroCopySend;

/// Version of both structures. A peer of another version is refused.
pub const PROTOCOL_VERSION: u32 = 3;

/// Most legs of a rig that takes or measures leg values.
pub const LEGS: usize = 6;

/// Most latches whose phases a rig reports.
pub const LATCHES: usize = 8;

/// Words kept for later versions, all zero.
pub const RESERVED: usize = 8;

/// Largest number of either structure, in SI: far beyond any rig, and small enough that products of two
/// stay finite.
pub const LARGEST: f64 = 1e12;

/// How far the length of an attitude's quaternion may be from 1.
pub const ATTITUDE_TOLERANCE: f64 = 0.01;

/// Shortest and longest period of a loop, ns.
pub const PERIODS_NS: core::ops::RangeInclusive<u64> = 10_000..=1_000_000_000;

/// What a rig is asked to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum RigMode {
    /// Power off or valves closed; a rig rests where it is and ends an earlier session. Joined
    /// rings stay joined.
    #[default]
    Idle = 0,
    /// Hold the present pose; motion commands are ignored.
    Hold = 1,
    /// Follow the commands.
    Track = 2,
    /// Open the latches, draw back along the docking axis, slowly, until nothing touches, and hold
    /// there.
    Retract = 3,
    /// Come to rest at once and hold; left only through [`RigMode::Idle`].
    Stop = 4,
}

impl RigMode {
    /// From the number on the wire.
    #[must_use]
    pub const fn from_number(n: u32) -> Option<Self> {
        Some(match n {
            0 => Self::Idle,
            1 => Self::Hold,
            2 => Self::Track,
            3 => Self::Retract,
            4 => Self::Stop,
            _ => return None,
        })
    }
}

/// What a mechanism with drives of its own is asked to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum MechanismMode {
    /// Nothing: drives are off, or there are none; latches work by themselves.
    #[default]
    Passive = 0,
    /// Drives hold where they are.
    Hold = 1,
    /// Drives go to [`RigCommand::mechanism`].
    Drive = 2,
    /// Latches are opened and held open; drives hold.
    Release = 3,
}

impl MechanismMode {
    /// From the number on the wire.
    #[must_use]
    pub const fn from_number(n: u32) -> Option<Self> {
        Some(match n {
            0 => Self::Passive,
            1 => Self::Hold,
            2 => Self::Drive,
            3 => Self::Release,
            _ => return None,
        })
    }
}

/// What moves the legs, as the rig says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum DriveKind {
    /// Not stated.
    #[default]
    Unstated = 0,
    /// Valves and cylinders: the speed feed-forward is a flow.
    Hydraulic = 1,
    /// Position loops with a speed feed-forward: electric cylinders, servo drives, a robot controller.
    PositionLoop = 2,
}

impl DriveKind {
    /// From the number on the wire.
    #[must_use]
    pub const fn from_number(n: u32) -> Option<Self> {
        Some(match n {
            0 => Self::Unstated,
            1 => Self::Hydraulic,
            2 => Self::PositionLoop,
            _ => return None,
        })
    }
}

/// Bits of [`RigCommand::flags`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
pub struct Flags(u32);

bitflags! {
    impl Flags: u32 {
        /// Virtual clock: the rig takes one tick of its own time for every command and may take as long
        /// as it needs. Without it, time is that of `CLOCK_MONOTONIC`.
        const LOCKSTEP = 1;
        /// Dry run (`--dry-run`): slow motion without contact, to test the path.
        const DRY_RUN = 1 << 1;
    }
}

/// Bits of [`RigMeasurement::status`]. 7 and 9 are not in use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
pub struct Status(u32);

bitflags! {
    impl Status: u32 {
        /// The drives are on and the rig follows.
        const ENABLED = 1;
        /// A limit switch of a leg is closed.
        const LIMIT_SWITCH = 1 << 1;
        /// The emergency stop is pressed.
        const EMERGENCY_STOP = 1 << 2;
        /// Sensor A (rack) is at the end of its range.
        const SENSOR_A_SATURATED = 1 << 3;
        /// Sensor B (plate) is at the end of its range.
        const SENSOR_B_SATURATED = 1 << 4;
        /// The rig has left the commands and holds: no command in time, one that it refused, a limit of
        /// its guard, or a fault of its own. It follows again after an idle command of a new session.
        const SAFE_STATE = 1 << 5;
        /// The rig refused the command that this answers; `refusal` says why.
        const REFUSED = 1 << 6;
        /// Answers no command: sent by a rig in its safe state for observers. `tick` is that of the
        /// last command answered; the loop ignores it.
        const UNSOLICITED = 1 << 8;
        /// The accelerometers are at the end of their range.
        const ACCELEROMETER_SATURATED = 1 << 10;
        /// The rings are joined; holds with [`Capabilities::JOINED`].
        const JOINED = 1 << 11;
    }
}

/// Bits of [`RigMeasurement::capabilities`]: what the rig takes, and which numbers hold.
///
/// A bit that is set while the loop is armed and clear later means that a sensor is gone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
pub struct Capabilities(u32);

bitflags! {
    impl Capabilities: u32 {
        /// Takes the leg values of a command.
        const LEG_COMMAND = 1;
        /// Takes the plate's pose and twist of a command without leg values.
        const POSE_COMMAND = 1 << 1;
        /// Takes the mechanism's command.
        const MECHANISM_COMMAND = 1 << 2;
        /// Enforces the limits of the guard by itself.
        const GUARD = 1 << 3;
        /// `leg_length_m` holds.
        const LEG_LENGTH = 1 << 8;
        /// `leg_speed_m_s` holds.
        const LEG_SPEED = 1 << 9;
        /// `leg_force_n` holds.
        const LEG_FORCE = 1 << 10;
        /// `valve_spool` holds.
        const VALVE_SPOOL = 1 << 11;
        /// `sensor_a` holds.
        const SENSOR_A = 1 << 12;
        /// `sensor_b` holds.
        const SENSOR_B = 1 << 13;
        /// `plate_acceleration` holds: there are accelerometers on the plate.
        const ACCELEROMETER = 1 << 14;
        /// `plate_position_m` and `plate_attitude` hold: the rig measures the pose of its plate.
        const PLATE_POSE = 1 << 15;
        /// `plate_velocity_m_s` and `plate_rate_rad_s` hold.
        const PLATE_TWIST = 1 << 16;
        /// `latch_phase` holds, for `latch_count` latches.
        const LATCHES = 1 << 17;
        /// `ring_displacement_m` and `ring_rotation_rad` hold.
        const RING = 1 << 18;
        /// [`Status::JOINED`] holds.
        const JOINED = 1 << 19;
        /// `temperature_c` holds.
        const TEMPERATURE = 1 << 20;
        /// The `truth_` fields hold; only emulated rigs set it.
        const TRUTH = 1 << 21;
    }
}

/// Limits of the guard: which are set in a command, and which were passed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
pub struct GuardLimits(u32);

bitflags! {
    impl GuardLimits: u32 {
        /// Force and moment of sensor A beyond its reference.
        const SENSOR_A = 1;
        /// The same of sensor B; weight and inertia of what it carries count.
        const SENSOR_B = 1 << 1;
        /// Speed of a leg.
        const LEG_SPEED = 1 << 2;
        /// Speed of the plate's point, and rate of the plate.
        const PLATE_SPEED = 1 << 3;
        /// Position of the plate's point in the box, and turn from its attitude.
        const POSE = 1 << 4;
    }
}

/// From the loop to the rig, once a tick.
///
/// The type name is part of the protocol: peers in other languages join under it.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("DocktwinRigCommandV3")]
pub struct RigCommand {
    /// [`PROTOCOL_VERSION`].
    pub protocol_version: u32,
    /// A [`RigMode`].
    pub mode: u32,
    /// How time goes, and how the run is meant.
    pub flags: Flags,
    /// Legs whose values this command has, at most [`LEGS`]; 0 in a command by the plate's pose alone.
    pub leg_count: u32,
    /// Number of this run of the loop, never 0; a new one is a new loop, whose ticks begin again.
    pub session: u64,
    /// Number of the tick, rising by one; gaps are ticks that the loop missed.
    pub tick: u64,
    /// Loop time of the tick, ns: `t_k`.
    pub loop_time_ns: u64,
    /// When the tick was due, ns of `CLOCK_MONOTONIC`; with [`Flags::LOCKSTEP`] the loop time.
    pub wakeup_ns: u64,
    /// Period of the loop, ns: the command is for `loop_time_ns + period_ns`.
    pub period_ns: u64,
    /// Lengths, m. To be compared with the measured length on arrival.
    pub leg_length_m: [f64; LEGS],
    /// Their rates, m/s.
    pub leg_speed_m_s: [f64; LEGS],
    /// Feed-forward of flow as speed, m/s: rate of length, oil taken up, leakage, corrections of what
    /// was identified. Of a position loop: feed-forward of speed.
    pub leg_flow_speed_m_s: [f64; LEGS],
    /// Forces expected between rod and plate, N, pushing positive; expected contact included.
    pub leg_force_n: [f64; LEGS],
    /// By how much later than `leg_length_m` the instant of `leg_flow_speed_m_s` is, s: the delay of
    /// the valve as the loop believes it.
    pub flow_ahead_s: f64,
    /// By how much later than `leg_length_m` the instant of `leg_force_n` is, s.
    pub force_ahead_s: f64,
    /// Origin of `ep` in `eb`, m: the pose the lengths come from.
    pub plate_position_m: [f64; 3],
    /// Attitude of `ep` in `eb`: w, x, y, z.
    pub plate_attitude: [f64; 4],
    /// Velocity of the origin of `ep`, m/s.
    pub plate_velocity_m_s: [f64; 3],
    /// Angular velocity, rad/s.
    pub plate_rate_rad_s: [f64; 3],
    /// Acceleration of the origin of `ep`, m/s², and angular acceleration, rad/s², in `eb`: for a rig
    /// with a feed-forward of its own.
    pub plate_acceleration: [f64; 6],
    /// Wrench of the contact expected on the plate, N and N·m, about the origin of `ep`, in `eb`.
    pub plate_wrench: [f64; 6],
    /// A [`MechanismMode`].
    pub mechanism_mode: u32,
    /// Limits of the guard that are set: bits of [`GuardLimits`].
    pub guard_limits: GuardLimits,
    /// Where the drives of the mechanism are to go, m or rad, in the order of the mechanism's file; 0
    /// where there are none.
    pub mechanism: [f64; 8],
    /// Reading of sensor A with nothing touching, N and N·m: the guard looks at the difference.
    pub guard_reference_a: [f64; 6],
    /// The same of sensor B.
    pub guard_reference_b: [f64; 6],
    /// Most force of a sensor beyond its reference, N.
    pub guard_force_n: f64,
    /// Most moment of a sensor beyond its reference, N·m.
    pub guard_moment_nm: f64,
    /// Fastest leg, m/s.
    pub guard_leg_speed_m_s: f64,
    /// Fastest point of the plate that the box holds, m/s.
    pub guard_speed_m_s: f64,
    /// Fastest turning of the plate, rad/s.
    pub guard_rate_rad_s: f64,
    /// Point of the plate that must stay in the box, m, in `ep`.
    pub guard_point_m: [f64; 3],
    /// Middle of the box, m, in `eb`.
    pub guard_box_middle_m: [f64; 3],
    /// Attitude of the plate about which it may turn, and of the box's axes: of `ep` in `eb`, w, x, y, z.
    pub guard_box_attitude: [f64; 4],
    /// Half the box's widths along its axes, m.
    pub guard_box_half_m: [f64; 3],
    /// Furthest turn of the plate from that attitude, rad.
    pub guard_box_turn_rad: f64,
    /// Zero.
    pub reserved: [u64; RESERVED],
}

/// From the rig to the loop, once a tick.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("DocktwinRigMeasurementV3")]
pub struct RigMeasurement {
    /// [`PROTOCOL_VERSION`].
    pub protocol_version: u32,
    /// State of rig and sensors.
    pub status: Status,
    /// A [`Refusal`] as number, 0 for none.
    pub refusal: u32,
    /// What the rig takes, and which numbers below hold.
    pub capabilities: Capabilities,
    /// Session of the command that this answers.
    pub session: u64,
    /// Tick of the command that this answers: k for the state at `t_{k+1}`.
    pub tick: u64,
    /// The instant of the samples, ns of `CLOCK_MONOTONIC`; with [`Flags::LOCKSTEP`] loop time.
    pub stamp_ns: u64,
    /// Digest of the rig's state, 0 where there is none: emulated rigs that repeat bit by bit.
    pub state_digest: u64,
    /// A [`DriveKind`].
    pub drive: u32,
    /// Legs whose values are measured, at most [`LEGS`].
    pub leg_count: u32,
    /// Latches whose phases are reported, at most [`LATCHES`].
    pub latch_count: u32,
    /// Limits at which the guard of the rig's end has stopped the rig in this session.
    pub guard_tripped: GuardLimits,
    /// Lengths, m.
    pub leg_length_m: [f64; LEGS],
    /// Their rates, m/s.
    pub leg_speed_m_s: [f64; LEGS],
    /// Forces of the drives on the rods, N, pushing positive: from pressures, or from motor currents.
    pub leg_force_n: [f64; LEGS],
    /// Openings of the valves, parts of full stroke.
    pub valve_spool: [f64; LEGS],
    /// Sensor A, on the rack: force, N, and moment, N·m.
    pub sensor_a: [f64; 6],
    /// Sensor B, on the moving plate.
    pub sensor_b: [f64; 6],
    /// Accelerometers on the plate: specific force (m/s², acceleration less gravity) at the origin of
    /// sensor B and angular acceleration (rad/s²), in its axes.
    pub plate_acceleration: [f64; 6],
    /// Origin of `ep` in `eb`, m, as the rig itself measures it.
    pub plate_position_m: [f64; 3],
    /// Attitude of `ep` in `eb` as the rig itself measures it: w, x, y, z.
    pub plate_attitude: [f64; 4],
    /// Velocity of the origin of `ep` as the rig itself measures it, m/s.
    pub plate_velocity_m_s: [f64; 3],
    /// Angular velocity as the rig itself measures it, rad/s.
    pub plate_rate_rad_s: [f64; 3],
    /// Phases of the latches: 0 free, 1 in approach, 2 struck, 3 latched.
    pub latch_phase: [u32; LATCHES],
    /// Displacement of the ring from rest, m, in axes of `e3`.
    pub ring_displacement_m: [f64; 3],
    /// Rotation vector of the ring from rest, rad, in axes of `e3`.
    pub ring_rotation_rad: [f64; 3],
    /// Temperatures, °C: the first is that of the drives (oil, or the hottest motor), the others are 0.
    pub temperature_c: [f64; 8],
    /// True origin of `ep` in `eb`, m.
    pub truth_position_m: [f64; 3],
    /// True attitude: w, x, y, z.
    pub truth_attitude: [f64; 4],
    /// True velocity of the origin of `ep`, m/s, and angular velocity, rad/s.
    pub truth_twist: [f64; 6],
    /// True F3, M3: on the chaser at the origin of `e3`, in `e3`; N, N·m.
    pub truth_port3: [f64; 6],
    /// True F4, M4: on the target at the origin of `e4`, in `e4`; N, N·m.
    pub truth_port4: [f64; 6],
    /// Zero.
    pub reserved: [u64; RESERVED],
}

/// Attitude without a turn: w, x, y, z.
const LEVEL: [f64; 4] = [1.0, 0.0, 0.0, 0.0];

/// A pose from its numbers on the wire; the attitude is made a unit quaternion.
#[must_use]
pub fn pose(position_m: &[f64; 3], attitude: &[f64; 4]) -> Pose {
    let [w, x, y, z] = *attitude;
    Pose::new(DVec3::from_array(*position_m), DQuat::from_xyzw(x, y, z, w).normalize())
}

/// An attitude as the wire has it: w, x, y, z.
#[must_use]
pub const fn attitude(q: DQuat) -> [f64; 4] {
    [q.w, q.x, q.y, q.z]
}

/// A wrench of six numbers.
#[must_use]
pub fn wrench(x: &[f64; 6]) -> Wrench {
    Wrench { f: DVec3::new(x[0], x[1], x[2]), m: DVec3::new(x[3], x[4], x[5]) }
}

/// Six numbers of a wrench, or of a twist.
#[must_use]
pub fn six(first: DVec3, second: DVec3) -> [f64; 6] {
    [first.x, first.y, first.z, second.x, second.y, second.z]
}

/// Whether four numbers are an attitude: a unit quaternion.
fn is_attitude(x: &[f64; 4]) -> bool {
    let length = x.iter().map(|x| x * x).sum::<f64>().sqrt();
    (length - 1.0).abs() <= ATTITUDE_TOLERANCE
}

fn in_size(x: f64) -> bool {
    x.abs() <= LARGEST
}

impl RigCommand {
    /// Of the present version, everything else zero.
    #[must_use]
    pub const fn zero() -> Self {
        Self {
            protocol_version: PROTOCOL_VERSION,
            mode: 0,
            flags: Flags::empty(),
            leg_count: 0,
            session: 0,
            tick: 0,
            loop_time_ns: 0,
            wakeup_ns: 0,
            period_ns: 0,
            leg_length_m: [0.0; LEGS],
            leg_speed_m_s: [0.0; LEGS],
            leg_flow_speed_m_s: [0.0; LEGS],
            leg_force_n: [0.0; LEGS],
            flow_ahead_s: 0.0,
            force_ahead_s: 0.0,
            plate_position_m: [0.0; 3],
            plate_attitude: LEVEL,
            plate_velocity_m_s: [0.0; 3],
            plate_rate_rad_s: [0.0; 3],
            plate_acceleration: [0.0; 6],
            plate_wrench: [0.0; 6],
            mechanism_mode: 0,
            guard_limits: GuardLimits::empty(),
            mechanism: [0.0; 8],
            guard_reference_a: [0.0; 6],
            guard_reference_b: [0.0; 6],
            guard_force_n: 0.0,
            guard_moment_nm: 0.0,
            guard_leg_speed_m_s: 0.0,
            guard_speed_m_s: 0.0,
            guard_rate_rad_s: 0.0,
            guard_point_m: [0.0; 3],
            guard_box_middle_m: [0.0; 3],
            guard_box_attitude: LEVEL,
            guard_box_half_m: [0.0; 3],
            guard_box_turn_rad: 0.0,
            reserved: [0; RESERVED],
        }
    }

    /// The pose commanded, `X_bp`.
    #[must_use]
    pub fn plate(&self) -> Pose {
        pose(&self.plate_position_m, &self.plate_attitude)
    }

    /// The twist commanded: velocity of the origin of `ep` and angular velocity, in `eb`.
    #[must_use]
    pub fn plate_twist(&self) -> Twist {
        Twist {
            v: DVec3::from_array(self.plate_velocity_m_s),
            w: DVec3::from_array(self.plate_rate_rad_s),
        }
    }

    /// True when no number is infinite or not a number.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.each(f64::is_finite)
    }

    /// True when no number is beyond [`LARGEST`], and what is followed as an attitude is one.
    #[must_use]
    pub fn is_in_range(&self) -> bool {
        let tracks = self.mode == RigMode::Track as u32;
        let holds = self.guard_limits.contains(GuardLimits::POSE);
        self.each(in_size)
            && (!tracks || is_attitude(&self.plate_attitude))
            && (!holds || is_attitude(&self.guard_box_attitude))
    }

    /// Whether every number is as asked.
    fn each(&self, is: fn(f64) -> bool) -> bool {
        let legs =
            [&self.leg_length_m, &self.leg_speed_m_s, &self.leg_flow_speed_m_s, &self.leg_force_n];
        let sixes = [
            &self.plate_acceleration,
            &self.plate_wrench,
            &self.guard_reference_a,
            &self.guard_reference_b,
        ];
        let threes = [
            &self.plate_position_m,
            &self.plate_velocity_m_s,
            &self.plate_rate_rad_s,
            &self.guard_point_m,
            &self.guard_box_middle_m,
            &self.guard_box_half_m,
        ];
        let single = [
            self.flow_ahead_s,
            self.force_ahead_s,
            self.guard_force_n,
            self.guard_moment_nm,
            self.guard_leg_speed_m_s,
            self.guard_speed_m_s,
            self.guard_rate_rad_s,
            self.guard_box_turn_rad,
        ];
        let all = |x: &[f64]| x.iter().all(|x| is(*x));
        legs.into_iter().all(|x| all(x))
            && sixes.into_iter().all(|x| all(x))
            && threes.into_iter().all(|x| all(x))
            && all(&self.plate_attitude)
            && all(&self.guard_box_attitude)
            && all(&self.mechanism)
            && all(&single)
    }

    /// True when nothing stands where a later version may have something.
    #[must_use]
    pub fn keeps_reserved(&self) -> bool {
        let unknown = (self.flags.bits() & !Flags::all().bits())
            | (self.guard_limits.bits() & !GuardLimits::all().bits());
        unknown == 0
            && self.leg_count as usize <= LEGS
            && MechanismMode::from_number(self.mechanism_mode).is_some()
            && self.reserved == [0; RESERVED]
    }
}

impl RigMeasurement {
    /// Of the present version, everything else zero.
    #[must_use]
    pub const fn zero() -> Self {
        Self {
            protocol_version: PROTOCOL_VERSION,
            status: Status::empty(),
            refusal: 0,
            capabilities: Capabilities::empty(),
            session: 0,
            tick: 0,
            stamp_ns: 0,
            state_digest: 0,
            drive: 0,
            leg_count: 0,
            latch_count: 0,
            guard_tripped: GuardLimits::empty(),
            leg_length_m: [0.0; LEGS],
            leg_speed_m_s: [0.0; LEGS],
            leg_force_n: [0.0; LEGS],
            valve_spool: [0.0; LEGS],
            sensor_a: [0.0; 6],
            sensor_b: [0.0; 6],
            plate_acceleration: [0.0; 6],
            plate_position_m: [0.0; 3],
            plate_attitude: LEVEL,
            plate_velocity_m_s: [0.0; 3],
            plate_rate_rad_s: [0.0; 3],
            latch_phase: [0; LATCHES],
            ring_displacement_m: [0.0; 3],
            ring_rotation_rad: [0.0; 3],
            temperature_c: [0.0; 8],
            truth_position_m: [0.0; 3],
            truth_attitude: LEVEL,
            truth_twist: [0.0; 6],
            truth_port3: [0.0; 6],
            truth_port4: [0.0; 6],
            reserved: [0; RESERVED],
        }
    }

    /// True when the rig is in all states of `bits`.
    #[must_use]
    pub const fn is(&self, bits: Status) -> bool {
        self.status.contains(bits)
    }

    /// True when the rig has all of `bits`.
    #[must_use]
    pub const fn has(&self, bits: Capabilities) -> bool {
        self.capabilities.contains(bits)
    }

    /// True when the mechanism's sensors report that the rings are joined, or that a latch holds.
    #[must_use]
    pub fn is_held(&self) -> bool {
        const LATCHED: u32 = 3;
        self.is_joined() == Some(true) || self.latch_phases().iter().any(|p| *p >= LATCHED)
    }

    /// Whether the rings are joined, where the mechanism has a sensor for it.
    #[must_use]
    pub fn is_joined(&self) -> Option<bool> {
        self.has(Capabilities::JOINED).then(|| self.is(Status::JOINED))
    }

    /// Phases of the latches: 0 free, 1 in approach, 2 struck, 3 latched; empty where none report.
    #[must_use]
    pub fn latch_phases(&self) -> &[u32] {
        let count = if self.has(Capabilities::LATCHES) { self.latch_count as usize } else { 0 };
        &self.latch_phase[..count.min(LATCHES)]
    }

    /// Displacement (m) and rotation vector (rad) of the ring from rest, in axes of `e3`, where the
    /// mechanism has sensors for it.
    #[must_use]
    pub fn ring(&self) -> Option<[DVec3; 2]> {
        let ring = [self.ring_displacement_m, self.ring_rotation_rad].map(DVec3::from_array);
        self.has(Capabilities::RING).then_some(ring)
    }

    /// What the accelerometers measure: specific force (m/s²) and angular acceleration (rad/s²).
    #[must_use]
    pub fn accelerometer(&self) -> Option<[DVec3; 2]> {
        let [x, y, z, a, b, c] = self.plate_acceleration;
        let read = [DVec3::new(x, y, z), DVec3::new(a, b, c)];
        self.has(Capabilities::ACCELEROMETER).then_some(read)
    }

    /// The pose of the plate as the rig itself measures it, `X_bp`.
    #[must_use]
    pub fn plate(&self) -> Option<Pose> {
        let measured = self.has(Capabilities::PLATE_POSE);
        measured.then(|| pose(&self.plate_position_m, &self.plate_attitude))
    }

    /// Its twist as the rig itself measures it: velocity of the origin of `ep`, and angular velocity.
    #[must_use]
    pub fn plate_twist(&self) -> Option<Twist> {
        let v = DVec3::from_array(self.plate_velocity_m_s);
        let w = DVec3::from_array(self.plate_rate_rad_s);
        self.has(Capabilities::PLATE_TWIST).then_some(Twist { v, w })
    }

    /// True when no number that holds is infinite or not a number.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.each(f64::is_finite)
    }

    /// True when no number that holds is beyond [`LARGEST`], and what holds as an attitude is one.
    #[must_use]
    pub fn is_in_range(&self) -> bool {
        let absent = |bit| !self.has(bit);
        self.each(in_size)
            && (absent(Capabilities::PLATE_POSE) || is_attitude(&self.plate_attitude))
            && (absent(Capabilities::TRUTH) || is_attitude(&self.truth_attitude))
    }

    /// Whether every number that holds is as asked.
    fn each(&self, is: fn(f64) -> bool) -> bool {
        use Capabilities as C;
        let absent = |bit| !self.has(bit);
        let six: [(C, &[f64; 6]); 7] = [
            (C::LEG_LENGTH, &self.leg_length_m),
            (C::LEG_SPEED, &self.leg_speed_m_s),
            (C::LEG_FORCE, &self.leg_force_n),
            (C::VALVE_SPOOL, &self.valve_spool),
            (C::SENSOR_A, &self.sensor_a),
            (C::SENSOR_B, &self.sensor_b),
            (C::ACCELEROMETER, &self.plate_acceleration),
        ];
        let three: [(C, &[f64; 3]); 6] = [
            (C::PLATE_POSE, &self.plate_position_m),
            (C::PLATE_TWIST, &self.plate_velocity_m_s),
            (C::PLATE_TWIST, &self.plate_rate_rad_s),
            (C::RING, &self.ring_displacement_m),
            (C::RING, &self.ring_rotation_rad),
            (C::TRUTH, &self.truth_position_m),
        ];
        let truth = [&self.truth_twist, &self.truth_port3, &self.truth_port4];
        let all = |x: &[f64]| x.iter().all(|x| is(*x));
        six.into_iter().all(|(bit, x)| absent(bit) || all(x))
            && three.into_iter().all(|(bit, x)| absent(bit) || all(x))
            && (absent(C::PLATE_POSE) || all(&self.plate_attitude))
            && (absent(C::TEMPERATURE) || all(&self.temperature_c))
            && (absent(C::TRUTH)
                || (all(&self.truth_attitude) && truth.into_iter().all(|x| all(x))))
    }

    /// True when nothing stands where a later version may have something.
    #[must_use]
    pub fn keeps_reserved(&self) -> bool {
        let unknown = (self.status.bits() & !Status::all().bits())
            | (self.capabilities.bits() & !Capabilities::all().bits())
            | (self.guard_tripped.bits() & !GuardLimits::all().bits());
        unknown == 0
            && self.leg_count as usize <= LEGS
            && self.latch_count as usize <= LATCHES
            && DriveKind::from_number(self.drive).is_some()
            && self.reserved == [0; RESERVED]
    }

    /// Puts zero into every number that does not hold, so that nobody takes it for one that does.
    pub fn clear_absent(&mut self) {
        use Capabilities as C;
        let absent = |bit| !self.capabilities.contains(bit);
        let zero = Self::zero();
        macro_rules! clear {
            ($($bit:ident: $($field:ident),+;)+) => { $(
                if absent(C::$bit) {
                    $(self.$field = zero.$field;)+
                }
            )+ };
        }
        clear! {
            LEG_LENGTH: leg_length_m;
            LEG_SPEED: leg_speed_m_s;
            LEG_FORCE: leg_force_n;
            VALVE_SPOOL: valve_spool;
            SENSOR_A: sensor_a;
            SENSOR_B: sensor_b;
            ACCELEROMETER: plate_acceleration;
            PLATE_POSE: plate_position_m, plate_attitude;
            PLATE_TWIST: plate_velocity_m_s, plate_rate_rad_s;
            LATCHES: latch_count, latch_phase;
            RING: ring_displacement_m, ring_rotation_rad;
            TEMPERATURE: temperature_c;
            TRUTH: truth_position_m, truth_attitude, truth_twist, truth_port3, truth_port4;
        }
    }
}

/// Why a command or a measurement was not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Refusal {
    /// Another protocol version.
    Version = 1,
    /// Not the size of the structure.
    Size = 2,
    /// The tick is not above the last one of this session.
    TickBack = 3,
    /// A number is not finite.
    NotFinite = 4,
    /// A time stamp lies in the future.
    Future = 5,
    /// No such mode.
    Mode = 6,
    /// Of another session than the running one.
    Session = 7,
    /// Older than allowed.
    Stale = 8,
    /// A second rig, or a second loop, of the same name.
    Second = 9,
    /// A period below 10 µs or above 1 s.
    Period = 10,
    /// Something stands where this version has nothing.
    Reserved = 11,
    /// A tracking command with the values of legs that the rig does not have, or without those it needs.
    Legs = 12,
    /// A number beyond any rig, or an attitude that is no unit quaternion.
    Range = 13,
}

impl Refusal {
    /// All of them, by number from 1.
    pub const ALL: [Self; 13] = [
        Self::Version,
        Self::Size,
        Self::TickBack,
        Self::NotFinite,
        Self::Future,
        Self::Mode,
        Self::Session,
        Self::Stale,
        Self::Second,
        Self::Period,
        Self::Reserved,
        Self::Legs,
        Self::Range,
    ];

    /// From the number on the wire.
    #[must_use]
    pub fn from_number(n: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|r| *r as u32 == n)
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Version => {
                "another protocol version: bring both sides to version 3 as the section `From version \
                 2 to version 3` of docs/rig-protocol.md says"
            }
            Self::Size => "a payload of another size: build both sides from the same protocol page",
            Self::TickBack => "a tick that does not rise: start a new session to begin again",
            Self::NotFinite => "a number that is not finite: correct it at its source",
            Self::Future => "a time stamp from the future: use CLOCK_MONOTONIC of this machine",
            Self::Mode => "a mode that does not exist: use 0 to 4",
            Self::Session => "a message of another session: answer the session of the command",
            Self::Stale => "a message that is too old: the sender is late",
            Self::Second => "a second one of this name: stop one of them, or take another name",
            Self::Period => "a period out of range: use 10 000 to 1 000 000 000 ns",
            Self::Reserved => {
                "a bit, a count or a reserved word that this version does not have: set to zero what \
                 the protocol page does not name"
            }
            Self::Legs => {
                "values of another number of legs than the rig follows: send as many as its \
                 measurements say, or none to a rig that takes the plate's pose"
            }
            Self::Range => {
                "a number beyond 1e12, or an attitude that is no unit quaternion: give SI units, and w, x, \
                 y, z of length 1"
            }
        })
    }
}

impl core::error::Error for Refusal {}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every number of both structures is looked at, where it holds.
    #[test]
    fn invariant_a_number_that_is_not_finite_is_seen_wherever_it_stands() {
        let bad = f64::NAN.to_le_bytes();
        let words = |bytes: usize| (0..bytes / 8).map(|i| 8 * i);
        let command = RigCommand::zero().to_bytes();
        let seen = words(command.len()).filter(|at| {
            let mut bytes = command;
            bytes[*at..at + 8].copy_from_slice(&bad);
            !RigCommand::from_bytes(&bytes).expect("its size").is_finite()
        });
        // Seven words of integers in front, the mechanism's mode with the guard's bits, and the end.
        assert_eq!(seen.count(), command.len() / 8 - 7 - 1 - RESERVED);

        let all = RigMeasurement { capabilities: Capabilities::all(), ..RigMeasurement::zero() };
        let none = RigMeasurement::zero();
        let count = |of: &RigMeasurement| {
            let measurement = of.to_bytes();
            words(measurement.len())
                .filter(|at| {
                    let mut bytes = measurement;
                    bytes[*at..at + 8].copy_from_slice(&bad);
                    let mut m = RigMeasurement::from_bytes(&bytes).expect("its size");
                    m.capabilities = of.capabilities;
                    !m.is_finite()
                })
                .count()
        };
        // Eight words of integers in front, the phases of the latches, and the end.
        assert_eq!(count(&all), RigMeasurement::WIRE_BYTES / 8 - 8 - LATCHES / 2 - RESERVED);
        assert_eq!(count(&none), 0);
    }

    /// Found by fuzzing: finite numbers of which products are not, and attitudes without a direction.
    #[test]
    fn regress_numbers_beyond_any_rig_and_attitudes_that_are_none_are_seen() {
        let track = RigCommand { mode: RigMode::Track as u32, ..RigCommand::zero() };
        let all = RigMeasurement { capabilities: Capabilities::all(), ..RigMeasurement::zero() };
        assert!(track.is_in_range() && all.is_in_range() && RigMeasurement::zero().is_in_range());
        let guarded = RigCommand { guard_limits: GuardLimits::POSE, ..RigCommand::zero() };
        for none in [[0.0; 4], [2.0, 0.0, 0.0, 0.0], [1e200; 4], [f64::NAN, 0.0, 0.0, 1.0]] {
            assert!(!RigCommand { plate_attitude: none, ..track }.is_in_range(), "{none:?}");
            assert!(!RigCommand { guard_box_attitude: none, ..guarded }.is_in_range(), "{none:?}");
            assert!(!RigMeasurement { plate_attitude: none, ..all }.is_in_range(), "{none:?}");
            assert!(!RigMeasurement { truth_attitude: none, ..all }.is_in_range(), "{none:?}");
        }
        // What nobody follows may be left empty.
        assert!(RigCommand { plate_attitude: [0.0; 4], ..RigCommand::zero() }.is_in_range());
        assert!(
            RigMeasurement { plate_attitude: [0.0; 4], ..RigMeasurement::zero() }.is_in_range()
        );
        for x in [1e13, -1e300, f64::INFINITY] {
            assert!(!RigCommand { guard_force_n: x, ..track }.is_in_range());
            assert!(
                !RigMeasurement { sensor_a: [0.0, 0.0, x, 0.0, 0.0, 0.0], ..all }.is_in_range()
            );
        }
    }

    #[test]
    fn invariant_what_does_not_hold_is_cleared_and_the_rest_kept() {
        let mut full =
            RigMeasurement::from_bytes(&[1; RigMeasurement::WIRE_BYTES]).expect("its size");
        full.capabilities = Capabilities::all();
        (full.leg_count, full.latch_count) = (6, 3);
        let mut kept = full;
        kept.clear_absent();
        assert_eq!(kept, full);
        for bit in Capabilities::all().iter().filter(|b| b.bits() >= 1 << 8) {
            let mut m = full;
            m.capabilities.remove(bit);
            m.clear_absent();
            // A state of the mechanism is no number.
            assert_eq!(
                m.to_bytes() == {
                    full.capabilities.remove(bit);
                    full.to_bytes()
                },
                bit == Capabilities::JOINED,
                "{bit:?}"
            );
            full.capabilities.insert(bit);
        }
        let mut none = full;
        none.capabilities = Capabilities::empty();
        none.clear_absent();
        let zero = RigMeasurement::zero();
        assert_eq!((none.sensor_b, none.truth_port4), (zero.sensor_b, zero.truth_port4));
        assert_eq!(none.plate(), None);
    }

    #[test]
    fn invariant_every_reserved_bit_and_word_counts() {
        let good = RigCommand { leg_count: 6, ..RigCommand::zero() };
        assert!(good.keeps_reserved());
        let spoiled: [fn(&mut RigCommand); 5] = [
            |c| c.flags = Flags::from_bits_retain(1 << 2),
            |c| c.leg_count = 7,
            |c| c.mechanism_mode = 4,
            |c| c.guard_limits = GuardLimits::from_bits_retain(1 << 31),
            |c| c.reserved[7] = 1,
        ];
        for spoil in spoiled {
            let mut c = good;
            spoil(&mut c);
            assert!(!c.keeps_reserved(), "{c:?}");
        }
        let good = RigMeasurement { leg_count: 6, latch_count: 8, ..RigMeasurement::zero() };
        assert!(good.keeps_reserved());
        let spoiled: [fn(&mut RigMeasurement); 7] = [
            |m| m.status = Status::from_bits_retain(1 << 7),
            |m| m.capabilities = Capabilities::from_bits_retain(1 << 4),
            |m| m.leg_count = 7,
            |m| m.latch_count = 9,
            |m| m.drive = 3,
            |m| m.guard_tripped = GuardLimits::from_bits_retain(1 << 31),
            |m| m.reserved[0] = 1,
        ];
        for spoil in spoiled {
            let mut m = good;
            spoil(&mut m);
            assert!(!m.keeps_reserved(), "{m:?}");
        }
    }
}
