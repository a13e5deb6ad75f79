//! The emulated rig: drives, plate, legs and their control, both mechanisms with their weight, and
//! the sensors that its file has: a model of a physical rig with the same commands.
//!
//! With a seed it is a rig as built, drawn within the spread of its file; the loop still believes the
//! file. So may be the mechanism on it, and where it is mounted ([`Article`]). Everything is a function of the seed and the commands, so two runs are the same bit by bit.

use crate::pushed::Pushed;
use docktwin_control::{
    feedforward::{self, Feedforward, LegCommand, PlateMotion},
    planner::Move,
    rig::{ClosedRig, RigMeasurement as RigReading, RigSetup, SetupError, TICK_S},
};
use docktwin_core::{DVec3, Pose, StateHasher, Twist, Wrench};
use docktwin_model::{Drive, HydraulicPreset, Rig, RigSensors, SixAxisSensor};
use docktwin_physics::{
    mechanism::{LatchPhase, RING, System},
    mounted::{Article, Carried, Mounted, Payload},
    platform::Platform,
    rig::{ReducedRig, RigPlant},
    sensor::{Noise, Pair, Sensor, SensorParameters, quantised},
};
use docktwin_rigport::{
    message::{
        Capabilities, DriveKind, LATCHES, LEGS, RigCommand, RigMeasurement, RigMode, Status,
        attitude, six, wrench,
    },
    rig::{CommandForm, Plant},
};

/// Streams of draws; the legs have 0 to 5, the rig 6; sensors A, B and the accelerometers this one and
/// the next two.
pub const SENSOR_STREAM: u64 = 16;
/// Of noise: sensors A and B, legs, accelerometers.
const NOISE_STREAM: u64 = 32;
/// Time over which speeds are read off the length sensors, s.
const SPEED_WINDOW_S: f64 = 0.004;
/// How fast a stop brakes, m/s² at the plate, and the shortest time it takes, s.
const STOP_M_S2: f64 = 2.0;
const SHORTEST_STOP_S: f64 = 0.05;
/// How far a mechanism that is no stick is drawn back from the middle, part of the axial half-width.
const DRAWN_BACK: f64 = 2.0 / 3.0;
/// How a retraction goes: speed, m/s, rate, rad/s.
const RETRACT_M_S: f64 = 0.05;
const RETRACT_RAD_S: f64 = 0.02;

/// Where nothing touches, `X_34`: a stick in the middle of its frame, any other mechanism drawn back.
#[must_use]
pub fn clear(rig: &Rig, system: &System) -> Pose {
    let x = if system.mechanism().stick.is_some() { 0.0 } else { DRAWN_BACK };
    rig.docking.pose([x, 0.0, 0.0, 0.0, 0.0, 0.0])
}

/// Why a rig cannot be emulated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum EmulationError {
    /// The file has no sensors.
    #[error(
        "the rig's file has no table [sensors]: add one, models/urdf/stewart.toml is an example"
    )]
    Sensors,
    /// The controllers cannot be built.
    #[error(transparent)]
    Setup(#[from] SetupError),
}

/// What the rig does when it does not track.
#[derive(Clone, Copy, Debug)]
enum Own {
    /// At rest at a pose.
    Hold(Pose),
    /// Comes to rest from a motion, so many seconds after its begin.
    Stop { from: PlateMotion, duration_s: f64, time_s: f64 },
    /// Draws back.
    Retract { way: Move, time_s: f64 },
}

/// Weight and inertia on the sensors.
#[derive(Clone, Copy, Debug)]
struct OnSensors {
    /// In `eb`.
    gravity_m_s2: DVec3,
    /// Weight that sensor A carries beside the ring: the rack does not move. Of the ring it carries what the
    /// balance of the rig leaves; the balance itself stands beside the rack.
    on_a: Wrench,
    /// What sensor B carries.
    on_b: Payload,
    /// Sensor B in the plate.
    x_pb: Pose,
}

/// An emulated rig.
#[derive(Clone, Debug)]
pub struct EmulatedRig<P = ReducedRig> {
    closed: ClosedRig<P>,
    feedforward: Feedforward,
    rig: Rig,
    /// The rig with its mounting planes where they stand.
    standing: Rig,
    article: Article,
    mounted: Mounted,
    /// Control wrench on the chaser, where the rack gives way as the chaser does.
    pushed: Pushed,
    touched: bool,
    sensor_a: Sensor,
    sensor_b: Option<Sensor>,
    accelerometer: Option<Sensor>,
    carried: OnSensors,
    model: RigSensors,
    noise: Noise,
    own: Option<Own>,
    /// The last motion commanded, for a stop that begins with it.
    commanded: PlateMotion,
    /// Velocity of the plate in the middles of the last two steps.
    middle: [Twist; 2],
    time_s: f64,
}

impl EmulatedRig {
    /// The reduced rig of a file with an article between rack and plate, a mechanism as the system has it or
    /// as built, at rest at `x_34`. With `built` the rig is drawn with that seed; `seed` is that of the noise.
    ///
    /// # Errors
    /// See [`EmulationError`].
    pub fn new(
        rig: &Rig,
        preset: HydraulicPreset,
        built: Option<u64>,
        seed: u64,
        article: impl Into<Article>,
        x_34: &Pose,
    ) -> Result<Self, EmulationError> {
        let setup = RigSetup::of_rig(rig, preset, built);
        let x_bp = rig.plate_from_docking(x_34);
        let closed = ClosedRig::new(&setup, &x_bp)?;
        Self::with_rig(closed, &setup, rig, built, seed, article)
    }
}

impl<P: RigPlant> EmulatedRig<P> {
    /// Around a closed rig at rest; otherwise as [`EmulatedRig::new`].
    ///
    /// # Errors
    /// See [`EmulationError`].
    pub fn with_rig(
        closed: ClosedRig<P>,
        setup: &RigSetup,
        rig: &Rig,
        built: Option<u64>,
        seed: u64,
        article: impl Into<Article>,
    ) -> Result<Self, EmulationError> {
        let article = article.into();
        let (system, standing) = (article.system.clone(), article.on(rig));
        let model = rig.sensors.ok_or(EmulationError::Sensors)?;
        let step_s = closed.step_s();
        let x_bp = closed.state().x_bp;
        // What A carries and the ring has weight of its own.
        let mut on_rack = Payload::of(rig.active_payload, &rig.x_03);
        if !system.rigid() {
            let ring = &system.mass()[RING];
            let at = (system.ports()[0].inverse() * system.ring_at_rest()).p;
            let left = on_rack.mass_kg - ring.mass();
            if left > 0.0 {
                on_rack.com_m = (on_rack.com_m * on_rack.mass_kg - at * ring.mass()) / left;
            }
            on_rack.mass_kg = left.max(0.0);
        }
        let level = Carried {
            gravity: (rig.x_b0 * rig.x_03).q.conjugate() * rig.gravity_m_s2,
            ..Carried::default()
        };
        let carried = OnSensors {
            gravity_m_s2: rig.gravity_m_s2,
            on_a: on_rack.wrench(&level),
            on_b: Payload::of(rig.passive_payload, &rig.x_4p.inverse()),
            x_pb: rig.x_4p.inverse(),
        };
        let mounted = Mounted::new(system, &standing, step_s);
        let still = Twist::default();
        let weight = article.at_seat(0, mounted.ring_weight());
        let carries = Self::on_sensors(&carried, weight, &x_bp, &still, &still);
        let sensor = |i: usize, file: SixAxisSensor, noise: u64| {
            let as_built = built.map_or_else(
                || SensorParameters::of_file(file),
                |seed| SensorParameters::drawn(file, seed, SENSOR_STREAM + i as u64),
            );
            Sensor::new(as_built, step_s, Noise::new(seed, NOISE_STREAM + noise), carries[i])
        };
        Ok(Self {
            feedforward: setup.feedforward(),
            rig: rig.clone(),
            standing,
            article,
            touched: false,
            sensor_a: sensor(0, model.force, 0),
            sensor_b: model.plate_force.then(|| sensor(1, model.force, 1)),
            accelerometer: model.accelerometer.map(|file| sensor(2, file, 3)),
            carried,
            model,
            noise: Noise::new(seed, NOISE_STREAM + 2),
            own: Some(Own::Hold(x_bp)),
            commanded: PlateMotion::rest(x_bp),
            middle: [still; 2],
            time_s: 0.0,
            closed,
            mounted,
            pushed: Pushed::default(),
        })
    }

    /// Wrenches of weight and inertia on sensors A and B, and what accelerometers beside B measure;
    /// acceleration of the origin of `ep`, in `eb`. `ring` is the weight of the ring on A.
    fn on_sensors(
        carried: &OnSensors,
        ring: Wrench,
        x_bp: &Pose,
        twist: &Twist,
        acceleration: &Twist,
    ) -> [Pair; 3] {
        let at_b =
            Carried::on_plate(x_bp, &carried.x_pb, carried.gravity_m_s2, twist, acceleration);
        let pair = |w: Wrench| [w.f, w.m];
        let on_a = carried.on_a + ring;
        [pair(on_a), pair(carried.on_b.wrench(&at_b)), at_b.feels()]
    }

    /// The same rig with legs that do exactly what they are commanded ([`ClosedRig::exact`]).
    #[must_use]
    pub fn with_exact_legs(mut self) -> Self {
        self.closed = self.closed.exact();
        self
    }

    /// The same rig with a ring that feels its chaser give way to the mechanism and to the control wrench `pushed`
    /// ([`Mounted::carry_along`]).
    #[must_use]
    pub fn with_yielding_rack(mut self, pushed: Pushed) -> Self {
        self.mounted.carry_along();
        self.pushed = pushed;
        self
    }

    /// The mechanism.
    #[must_use]
    pub const fn mounted(&self) -> &Mounted {
        &self.mounted
    }

    /// The closed rig.
    #[must_use]
    pub const fn closed(&self) -> &ClosedRig<P> {
        &self.closed
    }

    /// `X_34` as it really is.
    #[must_use]
    pub fn x_34(&self) -> Pose {
        self.standing.docking_from_plate(&self.closed.state().x_bp)
    }

    /// Command of a motion of its own, known to the moment.
    fn own_command(&mut self) -> Option<feedforward::RigCommand> {
        let motion = match self.own.as_mut()? {
            Own::Hold(x_bp) => PlateMotion::rest(*x_bp),
            Own::Stop { from, duration_s, time_s } => {
                *time_s += TICK_S;
                let (d, t) = (*duration_s, time_s.min(*duration_s));
                let scaled = |x: f64| Twist { v: from.twist.v * x, w: from.twist.w * x };
                let way = t - 0.5 * t * t / d;
                let left = if *time_s < d { 1.0 } else { 0.0 };
                PlateMotion {
                    x_bp: Platform::moved(&from.x_bp, &from.twist, way),
                    twist: scaled(1.0 - t / d),
                    acceleration: scaled(-left / d),
                    ..PlateMotion::default()
                }
            }
            Own::Retract { way, time_s } => {
                *time_s += TICK_S;
                let m = way.at(*time_s);
                PlateMotion::of_docking(
                    self.feedforward.platform(),
                    &m.x_34,
                    &[m.twist, m.acceleration, m.jerk],
                )
            }
        };
        self.commanded = motion;
        // A pose that cannot be held is not left by force: the legs keep their last command.
        self.feedforward.command(&motion).ok()
    }

    /// What the legs are to do for a command of the plate's motion; `before` is the acceleration of the
    /// command before.
    fn by_pose(&mut self, c: &RigCommand, before: Twist) -> Option<feedforward::RigCommand> {
        let [x, y, z, a, b, g] = c.plate_acceleration;
        let acceleration = Twist { v: DVec3::new(x, y, z), w: DVec3::new(a, b, g) };
        let jerk = Twist {
            v: (acceleration.v - before.v) / TICK_S,
            w: (acceleration.w - before.w) / TICK_S,
        };
        self.commanded.acceleration = acceleration;
        let external = wrench(&c.plate_wrench);
        let motion = PlateMotion { acceleration, jerk, external, ..self.commanded };
        self.feedforward.command(&motion).ok()
    }

    fn stop(&mut self) {
        if matches!(self.own, Some(Own::Stop { .. } | Own::Hold(_))) {
            return;
        }
        let from = self.commanded;
        let speed = from
            .twist
            .v
            .length()
            .max(from.twist.w.length() * self.feedforward.platform().plate_radius_m());
        let duration_s = (speed / STOP_M_S2).max(SHORTEST_STOP_S);
        self.own = Some(Own::Stop { from, duration_s, time_s: 0.0 });
    }

    fn enter(&mut self, mode: RigMode) {
        self.mounted.hold_open(mode == RigMode::Retract);
        match mode {
            RigMode::Track => self.own = None,
            RigMode::Idle => {
                if matches!(self.own, None | Some(Own::Retract { .. })) {
                    self.stop();
                }
                // Rings that are joined, or lie on each other, are not parted by switching off.
                if self.touched && self.mounted.apart(&self.closed.state().x_bp) {
                    self.mounted.reset();
                    self.touched = false;
                }
            }
            RigMode::Hold | RigMode::Stop => self.stop(),
            RigMode::Retract => {
                if !matches!(self.own, Some(Own::Retract { .. })) {
                    let from = self.rig.docking_from_plate(&self.commanded.x_bp);
                    let mut to = clear(&self.rig, self.mounted.system());
                    if self.mounted.system().mechanism().stick.is_none() {
                        // Along the axis alone: petals lie between petals.
                        to = Pose { p: DVec3 { x: to.p.x.max(from.p.x), ..from.p }, ..from };
                    }
                    let way = Move::new(&from, &to, RETRACT_M_S, RETRACT_RAD_S);
                    self.own = Some(Own::Retract { way, time_s: 0.0 });
                }
            }
        }
    }

    fn tick(&mut self, command: Option<&feedforward::RigCommand>) -> RigMeasurement {
        let held;
        let command = match command {
            Some(c) => c,
            None => {
                held = self.held();
                &held
            }
        };
        self.mounted.push(self.pushed.get());
        let Self { closed, article, mounted, carried, middle, .. } = self;
        let (sensor_a, sensor_b) = (&mut self.sensor_a, &mut self.sensor_b);
        let accelerometer = &mut self.accelerometer;
        let step_s = closed.step_s();
        let done = closed.tick(command, |x_bp, twist| {
            let (on_plate, ports) = mounted.advance(x_bp, twist);
            // Slope between the last two middles, carried on by half of its change.
            let slope =
                |a: &Twist, b: &Twist| Twist { v: (a.v - b.v) / step_s, w: (a.w - b.w) / step_s };
            let (new, old) = (slope(twist, &middle[0]), slope(&middle[0], &middle[1]));
            let acceleration = Twist { v: new.v * 1.5 - old.v * 0.5, w: new.w * 1.5 - old.w * 0.5 };
            *middle = [*twist, middle[0]];
            let weight = article.at_seat(0, mounted.ring_weight());
            let [a, b, accelerations] =
                Self::on_sensors(carried, weight, x_bp, twist, &acceleration);
            let at_3 = article.at_seat(0, ports.port3);
            let at_4 = article.at_seat(1, ports.port4);
            sensor_a.step([at_3.f + a[0], at_3.m + a[1]]);
            if let Some(s) = sensor_b {
                s.step([at_4.f + b[0], at_4.m + b[1]]);
            }
            if let Some(s) = accelerometer {
                s.step(accelerations);
            }
            on_plate
        });
        self.time_s += TICK_S;
        let mut m = self.measure();
        if done.is_ok() {
            m.status |= Status::ENABLED;
        }
        m
    }

    /// The legs where they are.
    fn held(&self) -> feedforward::RigCommand {
        let s = self.closed.measure();
        let legs = core::array::from_fn(|i| LegCommand {
            length_m: s.length_m[i],
            force_n: s.force_n[i],
            ..LegCommand::default()
        });
        feedforward::RigCommand { legs, x_bp: s.x_bp, twist: Twist::default() }
    }

    fn measure(&mut self) -> RigMeasurement {
        let mut m = RigMeasurement {
            capabilities: HOLDS,
            drive: self.drive_kind() as u32,
            leg_count: LEGS as u32,
            ..RigMeasurement::zero()
        };
        let s = self.closed.measure();
        self.read_legs(&s, &mut m);
        self.read_sensors(&mut m);
        let margins = self.feedforward.platform().stroke_margins_m(&s.length_m);
        if margins.iter().any(|x| *x < 0.0) {
            m.status |= Status::LIMIT_SWITCH;
        }
        self.read_mechanism(&mut m);
        let ports = self.mounted.now(&s.x_bp, &s.twist);
        m.truth_position_m = s.x_bp.p.to_array();
        m.truth_attitude = attitude(s.x_bp.q);
        m.truth_twist = six(s.twist.v, s.twist.w);
        m.truth_port3 = six(ports.port3.f, ports.port3.m);
        m.truth_port4 = six(ports.port4.f, ports.port4.m);
        let mut h = StateHasher::chained(self.closed.digest());
        self.mounted.hash_into(&mut h);
        let sensors = [Some(&self.sensor_a), self.sensor_b.as_ref(), self.accelerometer.as_ref()];
        sensors.into_iter().flatten().for_each(|s| s.hash_into(&mut h));
        m.state_digest = h.finish().short();
        m
    }

    const fn drive_kind(&self) -> DriveKind {
        match &self.rig.drive {
            Drive::Hydraulic(_) => DriveKind::Hydraulic,
            Drive::PositionLoop(_) | Drive::Measured(_) => DriveKind::PositionLoop,
        }
    }

    /// What the encoders of legs with position loops read; their speeds are differences over the window.
    fn read_encoders(&mut self, s: &RigReading, m: &mut RigMeasurement) {
        let (model, noise) = (&self.model, &mut self.noise);
        let mut read = |x: f64, part: f64| {
            quantised(
                x + model.length_noise_m * part * noise.normal(),
                model.length_quantum_m * part,
            )
        };
        for i in 0..LEGS {
            m.leg_length_m[i] = read(s.length_m[i], 1.0);
            m.leg_speed_m_s[i] = read(s.speed_m_s[i], 1.0 / SPEED_WINDOW_S);
        }
    }

    fn read_legs(&mut self, s: &RigReading, m: &mut RigMeasurement) {
        if self.rig.drive.hydraulic().is_none() {
            self.read_encoders(s, m);
            return;
        }
        m.capabilities |= Capabilities::LEG_FORCE | Capabilities::VALVE_SPOOL;
        let (model, noise) = (&self.model, &mut self.noise);
        for i in 0..LEGS {
            m.leg_length_m[i] = quantised(
                s.length_m[i] + model.length_noise_m * noise.normal(),
                model.length_quantum_m,
            );
            let speed_noise = model.length_noise_m / SPEED_WINDOW_S;
            m.leg_speed_m_s[i] = s.speed_m_s[i] + speed_noise * noise.normal();
            m.leg_force_n[i] = s.force_n[i] + model.pressure_noise_n * noise.normal();
            m.valve_spool[i] = s.spool[i];
        }
    }

    fn read_sensors(&mut self, m: &mut RigMeasurement) {
        let a = self.sensor_a.read(self.time_s);
        m.sensor_a = six(a.value[0], a.value[1]);
        m.status.set(Status::SENSOR_A_SATURATED, a.saturated);
        if let Some(s) = &mut self.sensor_b {
            let b = s.read(self.time_s);
            m.sensor_b = six(b.value[0], b.value[1]);
            m.capabilities |= Capabilities::SENSOR_B;
            m.status.set(Status::SENSOR_B_SATURATED, b.saturated);
        }
        if let Some(s) = &mut self.accelerometer {
            let read = s.read(self.time_s);
            m.plate_acceleration = six(read.value[0], read.value[1]);
            m.capabilities |= Capabilities::ACCELEROMETER;
            m.status.set(Status::ACCELEROMETER_SATURATED, read.saturated);
        }
    }

    /// What the mechanism's own sensors read; a stick has none.
    fn read_mechanism(&mut self, m: &mut RigMeasurement) {
        let state = self.mounted.state();
        let reached = state.all_latches().any(|l| l.phase != LatchPhase::Free);
        self.touched |= reached || state.losses.total() > 0.0;
        if self.mounted.system().mechanism().stick.is_some() {
            return;
        }
        m.capabilities |= Capabilities::LATCHES | Capabilities::RING | Capabilities::JOINED;
        // Three of a mechanism without any, as ever.
        let latches = match self.mounted.system().mechanism().latch_count() {
            0 => 3,
            n => n.min(LATCHES),
        };
        m.latch_count = latches as u32;
        for (out, latch) in m.latch_phase.iter_mut().zip(state.all_latches().take(latches)) {
            *out = latch.phase as u32;
        }
        m.status.set(Status::JOINED, state.captured_s().is_some());
        let (d, psi) = self.mounted.ring_deflection();
        m.ring_displacement_m = d.to_array();
        m.ring_rotation_rad = psi.to_array();
    }
}

/// What of its measurements always holds.
const HOLDS: Capabilities = Capabilities::LEG_LENGTH
    .union(Capabilities::LEG_SPEED)
    .union(Capabilities::SENSOR_A)
    .union(Capabilities::TRUTH);

impl<P: RigPlant> Plant for EmulatedRig<P> {
    /// Without leg values it does what a controller with a feed-forward of its own does: inverse
    /// kinematics and dynamics of the commanded motion of the plate.
    fn command_form(&self) -> CommandForm {
        CommandForm::EITHER
    }

    fn answer(&mut self, command: &RigCommand) -> RigMeasurement {
        // Validated by the port.
        let mode = RigMode::from_number(command.mode).unwrap_or(RigMode::Stop);
        self.enter(mode);
        if self.own.is_some() {
            let c = self.own_command();
            return self.tick(c.as_ref());
        }
        let (x_bp, twist) = (command.plate(), command.plate_twist());
        let before = self.commanded.acceleration;
        self.commanded = PlateMotion { x_bp, twist, ..PlateMotion::default() };
        if command.leg_count == 0 {
            let c = self.by_pose(command, before);
            return self.tick(c.as_ref());
        }
        let legs = core::array::from_fn(|i| LegCommand {
            length_m: command.leg_length_m[i],
            speed_m_s: command.leg_speed_m_s[i],
            flow_speed_m_s: command.leg_flow_speed_m_s[i],
            force_n: command.leg_force_n[i],
        });
        let c = feedforward::RigCommand { legs, x_bp, twist };
        self.tick(Some(&c))
    }

    fn alone(&mut self, _period_ns: u64) -> RigMeasurement {
        self.enter(RigMode::Stop);
        let c = self.own_command();
        self.tick(c.as_ref())
    }
}
