//! What passes between the loop and a rig: two plain structures, the same in process, in shared
//! memory and on a wire. `docs/rig-protocol.md` gives every byte.
//!
//! SI units. Lengths of the legs are from joint to joint; poses and twists are of the plate `ep` in
//! the ground `eb`; a wrench is a force and a moment about the origin of its sensor, in its axes, as
//! the sensor feels it from what it carries.
//!
//! Convention of time, everywhere: the measurement read in tick k is the state of the rig at `t_k`;
//! the command written in tick k is for `t_{k+1}` and is held until the next.

use core::fmt;

use docktwin_control::feedforward::{LegCommand, PlateMotion};
use docktwin_core::{DQuat, DVec3, Pose, Twist, Wrench};

use crate::{clock::Clock, scheduler::LegCorrections};

use iceoryx2::prelude::ZeroCopySend;

/// Version of both structures. A peer of another version is refused.
pub const PROTOCOL_VERSION: u32 = 2;

/// Shortest and longest period of a loop, ns.
const PERIODS_NS: core::ops::RangeInclusive<u64> = 10_000..=1_000_000_000;

/// What a rig is asked to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum RigMode {
    /// Power off or valves closed; a rig rests where it is and forgets an earlier run. What is joined
    /// stays joined.
    #[default]
    Idle = 0,
    /// Hold the present pose; commands of motion are not looked at.
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

/// Bits of [`RigCommand::flags`].
pub mod flag {
    /// Virtual clock: the rig takes one tick of its own time for every command and may take as long
    /// as it needs. Without it, time is that of `CLOCK_MONOTONIC`.
    pub const LOCKSTEP: u32 = 1;
    /// Commands come slowed down, with an open gap, to try the way out (`--dry-run`).
    pub const DRY_RUN: u32 = 2;
}

/// Bits of [`RigMeasurement::status`].
pub mod status {
    /// Hydraulics are on and the rig follows.
    pub const ENABLED: u32 = 1;
    /// A limit switch of a leg is closed.
    pub const LIMIT_SWITCH: u32 = 1 << 1;
    /// The emergency stop is pressed.
    pub const EMERGENCY_STOP: u32 = 1 << 2;
    /// Sensor A (rack) is at the end of its range.
    pub const SENSOR_A_SATURATED: u32 = 1 << 3;
    /// Sensor B (plate) is at the end of its range.
    pub const SENSOR_B_SATURATED: u32 = 1 << 4;
    /// The rig has left the commands and holds: no command in time, one that it refused, or a fault
    /// of its own. It follows again after an idle command of a new session.
    pub const SAFE_STATE: u32 = 1 << 5;
    /// The rig refused the command that this answers; `refusal` says why.
    pub const REFUSED: u32 = 1 << 6;
    /// The `truth_` fields hold; only emulated rigs set it.
    pub const TRUTH: u32 = 1 << 7;
    /// Answers no command: what a rig in its safe state goes on telling to onlookers. `tick` is that
    /// of the last command answered; the loop passes over it.
    pub const UNASKED: u32 = 1 << 8;
    /// `plate_acceleration` holds: there are accelerometers on the plate.
    pub const ACCELEROMETER: u32 = 1 << 9;
    /// They are at the end of their range.
    pub const ACCELEROMETER_SATURATED: u32 = 1 << 10;
}

/// From the loop to the rig, once a tick.
///
/// The type name is part of the protocol: peers in other languages join under it.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("DocktwinRigCommandV2")]
pub struct RigCommand {
    /// [`PROTOCOL_VERSION`].
    pub protocol_version: u32,
    /// A [`RigMode`].
    pub mode: u32,
    /// Bits of [`flag`].
    pub flags: u32,
    /// Zero.
    pub reserved: u32,
    /// Number of this run of the loop, never 0; a new one is a new loop, whose ticks begin again.
    pub session: u64,
    /// Number of the tick, rising by one; gaps are ticks that the loop missed.
    pub tick: u64,
    /// Loop time of the tick, ns: `t_k`.
    pub loop_time_ns: u64,
    /// When the tick was due, ns of `CLOCK_MONOTONIC`; with [`flag::LOCKSTEP`] the loop time.
    pub wakeup_ns: u64,
    /// Period of the loop, ns: the command is for `loop_time_ns + period_ns`.
    pub period_ns: u64,
    /// Lengths, m. To be compared with the measured length on arrival.
    pub leg_length_m: [f64; 6],
    /// Their rates, m/s.
    pub leg_speed_m_s: [f64; 6],
    /// Feed-forward of flow as speed, m/s: rate of length, oil taken up, leakage, corrections of what
    /// was identified; ahead by the valve's delay.
    pub leg_flow_speed_m_s: [f64; 6],
    /// Forces expected between rod and plate, N, pushing positive; expected contact included.
    pub leg_force_n: [f64; 6],
    /// Origin of `ep` in `eb`, m: the pose the lengths come from.
    pub plate_position_m: [f64; 3],
    /// Attitude of `ep` in `eb`: w, x, y, z.
    pub plate_attitude: [f64; 4],
    /// Velocity of the origin of `ep`, m/s.
    pub plate_velocity_m_s: [f64; 3],
    /// Angular velocity, rad/s.
    pub plate_rate_rad_s: [f64; 3],
    /// For mechanisms with drives of their own; zero where there are none.
    pub mechanism: [f64; 8],
}

/// From the rig to the loop, once a tick.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("DocktwinRigMeasurementV2")]
pub struct RigMeasurement {
    /// [`PROTOCOL_VERSION`].
    pub protocol_version: u32,
    /// Bits of [`status`].
    pub status: u32,
    /// A [`Refusal`] as number, 0 for none.
    pub refusal: u32,
    /// Zero.
    pub reserved: u32,
    /// Session of the command that this answers.
    pub session: u64,
    /// Tick of the command that this answers: k for the state at `t_{k+1}`.
    pub tick: u64,
    /// The instant of the samples, ns of `CLOCK_MONOTONIC`; with [`flag::LOCKSTEP`] loop time.
    pub stamp_ns: u64,
    /// Digest of the rig's state, 0 where there is none: emulated rigs that repeat bit by bit.
    pub state_digest: u64,
    /// Lengths, m.
    pub leg_length_m: [f64; 6],
    /// Their rates, m/s.
    pub leg_speed_m_s: [f64; 6],
    /// Forces of the oil on the rods, N, pushing positive, from pressure sensors.
    pub leg_force_n: [f64; 6],
    /// Openings of the valves, parts of full stroke.
    pub valve_spool: [f64; 6],
    /// Sensor A, on the rack: force, N, and moment, N·m.
    pub sensor_a: [f64; 6],
    /// Sensor B, on the moving plate.
    pub sensor_b: [f64; 6],
    /// Accelerometers on the plate: specific force (m/s², acceleration less gravity) at the origin of
    /// sensor B and angular acceleration (rad/s²), in its axes.
    pub plate_acceleration: [f64; 6],
    /// What the mechanism's own sensors say: phases of the three latches (0 free, 1 approach, 2
    /// struck, 3 latched), displacement of the ring from rest (m, axes of `e3`), its rotation vector
    /// (rad), and 1 when the rings are joined. Zero where there are no such sensors.
    pub mechanism: [f64; 10],
    /// Temperatures, °C; reserved, zero.
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
}

impl RigCommand {
    /// Of the present version, everything else zero.
    #[must_use]
    pub const fn zero() -> Self {
        Self {
            protocol_version: PROTOCOL_VERSION,
            mode: 0,
            flags: 0,
            reserved: 0,
            session: 0,
            tick: 0,
            loop_time_ns: 0,
            wakeup_ns: 0,
            period_ns: 0,
            leg_length_m: [0.0; 6],
            leg_speed_m_s: [0.0; 6],
            leg_flow_speed_m_s: [0.0; 6],
            leg_force_n: [0.0; 6],
            plate_position_m: [0.0; 3],
            plate_attitude: [1.0, 0.0, 0.0, 0.0],
            plate_velocity_m_s: [0.0; 3],
            plate_rate_rad_s: [0.0; 3],
            mechanism: [0.0; 8],
        }
    }

    /// Without motion, for a tick that is due at `due_ns`.
    pub(crate) fn still<K: Clock>(
        clock: &K,
        mode: RigMode,
        session: u64,
        tick: u64,
        due_ns: u64,
    ) -> Self {
        Self {
            mode: mode as u32,
            flags: if K::LOCKSTEP { flag::LOCKSTEP } else { 0 },
            session,
            tick,
            loop_time_ns: due_ns,
            wakeup_ns: due_ns,
            period_ns: clock.period_ns(),
            ..Self::zero()
        }
    }

    /// Asks for a motion of the plate: what its legs are to do, less what was identified of them.
    pub(crate) fn ask(
        &mut self,
        plate: &PlateMotion,
        legs: &[LegCommand; 6],
        corrections: &LegCorrections,
    ) {
        for (i, leg) in legs.iter().enumerate() {
            self.leg_length_m[i] = leg.length_m;
            self.leg_speed_m_s[i] = leg.speed_m_s;
            self.leg_flow_speed_m_s[i] = corrections.flow_speed_m_s(i, leg.flow_speed_m_s);
            self.leg_force_n[i] = leg.force_n;
        }
        let q = plate.x_bp.q;
        self.plate_position_m = plate.x_bp.p.to_array();
        self.plate_attitude = [q.w, q.x, q.y, q.z];
        self.plate_velocity_m_s = plate.twist.v.to_array();
        self.plate_rate_rad_s = plate.twist.w.to_array();
    }

    /// The pose asked for, `X_bp`.
    #[must_use]
    pub fn plate(&self) -> Pose {
        let [w, x, y, z] = self.plate_attitude;
        Pose::new(
            DVec3::from_array(self.plate_position_m),
            DQuat::from_xyzw(x, y, z, w).normalize(),
        )
    }

    /// The twist asked for: velocity of the origin of `ep` and angular velocity, in `eb`.
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
        let legs =
            [&self.leg_length_m, &self.leg_speed_m_s, &self.leg_flow_speed_m_s, &self.leg_force_n];
        legs.into_iter()
            .flatten()
            .chain(&self.plate_position_m)
            .chain(&self.plate_attitude)
            .chain(&self.plate_velocity_m_s)
            .chain(&self.plate_rate_rad_s)
            .chain(&self.mechanism)
            .all(|x| x.is_finite())
    }
}

impl RigMeasurement {
    /// Of the present version, everything else zero.
    #[must_use]
    pub const fn zero() -> Self {
        Self {
            protocol_version: PROTOCOL_VERSION,
            status: 0,
            refusal: 0,
            reserved: 0,
            session: 0,
            tick: 0,
            stamp_ns: 0,
            state_digest: 0,
            leg_length_m: [0.0; 6],
            leg_speed_m_s: [0.0; 6],
            leg_force_n: [0.0; 6],
            valve_spool: [0.0; 6],
            sensor_a: [0.0; 6],
            sensor_b: [0.0; 6],
            plate_acceleration: [0.0; 6],
            mechanism: [0.0; 10],
            temperature_c: [0.0; 8],
            truth_position_m: [0.0; 3],
            truth_attitude: [1.0, 0.0, 0.0, 0.0],
            truth_twist: [0.0; 6],
            truth_port3: [0.0; 6],
            truth_port4: [0.0; 6],
        }
    }

    /// True when all bits of `mask` are set.
    #[must_use]
    pub const fn has(&self, mask: u32) -> bool {
        self.status & mask == mask
    }

    /// True when the mechanism's sensors say that the rings are joined, or that a latch holds.
    #[must_use]
    pub fn joined(&self) -> bool {
        const LATCHED: f64 = 3.0;
        self.mechanism[9] > 0.5 || self.mechanism[..3].iter().any(|p| *p > LATCHED - 0.5)
    }

    /// What the accelerometers feel: specific force (m/s²) and angular acceleration (rad/s²).
    #[must_use]
    pub fn felt(&self) -> Option<[DVec3; 2]> {
        let [x, y, z, a, b, c] = self.plate_acceleration;
        self.has(status::ACCELEROMETER).then(|| [DVec3::new(x, y, z), DVec3::new(a, b, c)])
    }

    /// True when no number is infinite or not a number; truths count where they hold.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let measured = [
            &self.leg_length_m,
            &self.leg_speed_m_s,
            &self.leg_force_n,
            &self.valve_spool,
            &self.sensor_a,
            &self.sensor_b,
            &self.plate_acceleration,
        ];
        let measured =
            measured.into_iter().flatten().chain(&self.mechanism).chain(&self.temperature_c);
        let truth = [&self.truth_twist, &self.truth_port3, &self.truth_port4];
        let truth =
            truth.into_iter().flatten().chain(&self.truth_position_m).chain(&self.truth_attitude);
        measured.into_iter().all(|x| x.is_finite())
            && (!self.has(status::TRUTH) || truth.into_iter().all(|x| x.is_finite()))
    }
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

/// The largest in size; a NaN comes through.
pub(crate) fn largest(x: &[f64; 6]) -> f64 {
    x.iter().fold(0.0, |a: f64, b| if b.abs() > a || b.is_nan() { b.abs() } else { a })
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
}

impl Refusal {
    /// From the number on the wire.
    #[must_use]
    pub const fn from_number(n: u32) -> Option<Self> {
        Some(match n {
            1 => Self::Version,
            2 => Self::Size,
            3 => Self::TickBack,
            4 => Self::NotFinite,
            5 => Self::Future,
            6 => Self::Mode,
            7 => Self::Session,
            8 => Self::Stale,
            9 => Self::Second,
            10 => Self::Period,
            _ => return None,
        })
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Version => "another protocol version: bring both sides to the same version",
            Self::Size => "a payload of another size: build both sides from the same protocol page",
            Self::TickBack => "a tick that does not rise: start a new session to begin again",
            Self::NotFinite => "a number that is not finite: mend it at its source",
            Self::Future => "a time stamp from the future: use CLOCK_MONOTONIC of this machine",
            Self::Mode => "a mode that does not exist: use 0 to 4",
            Self::Session => "a message of another session: answer the session of the command",
            Self::Stale => "a message that is too old: the sender is late",
            Self::Second => "a second one of this name: stop one of them, or take another name",
            Self::Period => "a period out of range: use 10 000 to 1 000 000 000 ns",
        })
    }
}

impl core::error::Error for Refusal {}

/// What a side remembers of the other to judge its next message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sequence {
    /// Session in force, 0 before the first.
    pub session: u64,
    /// Last tick accepted in it.
    pub tick: Option<u64>,
}

impl Sequence {
    /// Judges a command at the rig; an accepted one becomes the last. `now_ns` is the clock of the
    /// time stamps, `None` in lockstep, where the rig has no clock of its own.
    ///
    /// # Errors
    /// Why the command is not to be used.
    pub fn command(&mut self, c: &RigCommand, now_ns: Option<u64>) -> Result<RigMode, Refusal> {
        if c.protocol_version != PROTOCOL_VERSION {
            return Err(Refusal::Version);
        }
        let mode = RigMode::from_number(c.mode).ok_or(Refusal::Mode)?;
        if !PERIODS_NS.contains(&c.period_ns) {
            return Err(Refusal::Period);
        }
        if c.session == 0 {
            return Err(Refusal::Session);
        }
        if c.session == self.session && self.tick.is_some_and(|last| c.tick <= last) {
            return Err(Refusal::TickBack);
        }
        if !c.is_finite() {
            return Err(Refusal::NotFinite);
        }
        if now_ns.is_some_and(|now| c.wakeup_ns > now) {
            return Err(Refusal::Future);
        }
        *self = Self { session: c.session, tick: Some(c.tick) };
        Ok(mode)
    }

    /// Judges a measurement at the loop, whose session is `self.session`; an accepted one becomes the
    /// last. `now_ns` is the clock of the time stamps: loop time in lockstep.
    ///
    /// A measurement with [`status::REFUSED`] names the tick of a command that was not used, so that
    /// number is not judged and does not count.
    ///
    /// # Errors
    /// Why the measurement is not to be used.
    pub fn measurement(&mut self, m: &RigMeasurement, now_ns: u64) -> Result<(), Refusal> {
        if m.protocol_version != PROTOCOL_VERSION {
            return Err(Refusal::Version);
        }
        if m.session != self.session {
            return Err(Refusal::Session);
        }
        let refused = m.has(status::REFUSED);
        if !refused && self.tick.is_some_and(|last| m.tick <= last) {
            return Err(Refusal::TickBack);
        }
        if !m.is_finite() {
            return Err(Refusal::NotFinite);
        }
        if m.stamp_ns > now_ns {
            return Err(Refusal::Future);
        }
        if !refused {
            self.tick = Some(m.tick);
        }
        Ok(())
    }
}
