//! The rig with its controllers, tick by tick.
//!
//! Commands come once a tick and take effect after the dead time of the command path. Between
//! commands the inner loops go on along the newest one: length with its speed and acceleration, flow
//! and force with the rate between the last two commands. Legs with position loops of their own take the
//! lengths alone.

use docktwin_core::{DVec3, Digest, Pose, StateHasher, Twist, Wrench};
use docktwin_model::{HydraulicPreset, LegLimits, PositionLoop, Rig};
use docktwin_physics::{
    hydraulics::LegParameters,
    platform::Platform,
    position_loop::{LoopRig, LoopState},
    rig::{BuiltLegs, PerturbedRig, ReducedRig, RigFault, RigPlant, RigState},
};

use crate::{
    feedforward::{Feedforward, LegCommand, RigCommand},
    leg::{LegController, LegMeasurement, LegTarget, LegTuning},
};

/// Time of a tick, s.
pub const TICK_S: f64 = 1e-3;
/// Steps of the reduced rig in a tick: 0.125 ms, an eighth of the period of the fastest mode's radian.
const PLANT_STEPS: u32 = 8;
/// Commands that are on the way or in use; dead times up to this many ticks less two.
const KEPT: usize = 52;
/// Longest dead time, s.
const MOST_DEAD_TIME_S: f64 = 0.050;

/// What the rig answers after a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigMeasurement {
    /// Lengths, m.
    pub length_m: [f64; 6],
    /// Their rates, m/s.
    pub speed_m_s: [f64; 6],
    /// Force of the oil as pressure sensors know it, N (friction and rod inertia included).
    pub force_n: [f64; 6],
    /// Openings of the valves, fraction of stroke.
    pub spool: [f64; 6],
    /// True pose of the plate, `X_bp`; a physical rig does not report it.
    pub x_bp: Pose,
    /// How it really moves.
    pub twist: Twist,
    /// How it really accelerates: mean of the last step.
    pub acceleration: Twist,
}

/// What cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SetupError {
    /// Inner loop and plant do not fit into a tick.
    #[error("the inner loop runs at {rate_hz} Hz: set 1000, 2000, 4000 or 8000 Hz")]
    Rate {
        /// Asked for.
        rate_hz: f64,
    },
    /// Plant and inner loop do not fit.
    #[error(
        "the plant steps by {step_s} s, the inner loop by {period_s} s: take a step that fits into \
         it a whole number of times"
    )]
    Step {
        /// Of the plant, s.
        step_s: f64,
        /// Of the inner loop, s.
        period_s: f64,
    },
    /// A plant on oil for a rig without any.
    #[error("the rig has no oil, and this form of a rig is moved by oil: take the reduced one")]
    NoOil,
    /// Dead time out of range.
    #[error("the dead time is {dead_time_s} s: set 0 to {MOST_DEAD_TIME_S} s")]
    DeadTime {
        /// Asked for.
        dead_time_s: f64,
    },
    /// The rig cannot stand where it is to begin.
    #[error("the rig cannot begin in this pose, it is singular: begin in the docking workspace")]
    Start,
}

/// True parameters of the rig, and those that its controllers assume.
#[derive(Clone, Debug)]
pub struct RigSetup {
    /// Mass, geometry as built.
    pub platform: Platform,
    /// What moves the legs.
    pub drive: DriveSetup,
    /// From command to controller, s.
    pub dead_time_s: f64,
    /// Mass, geometry as believed.
    pub believed_platform: Platform,
}

/// What moves the legs.
#[derive(Clone, Debug)]
pub enum DriveSetup {
    /// Oil, with a controller around each leg.
    Hydraulic(Box<HydraulicSetup>),
    /// Position loops of their own.
    Loops {
        /// As built.
        loops: Box<[PositionLoop; 6]>,
        /// Of every leg.
        limits: LegLimits,
    },
}

/// Legs on oil and their controllers.
#[derive(Clone, Debug)]
pub struct HydraulicSetup {
    /// Legs as built.
    pub legs: [LegParameters; 6],
    /// Legs as believed.
    pub believed_legs: [LegParameters; 6],
    /// Tuning of the inner loops.
    pub tuning: LegTuning,
}

impl RigSetup {
    /// The rig of a file with its own tuning; with a seed the rig as built is drawn within the
    /// file's spread, and the controllers still believe the file.
    #[must_use]
    pub fn of_rig(rig: &Rig, preset: HydraulicPreset, seed: Option<u64>) -> Self {
        let PerturbedRig { rig: built, legs } = PerturbedRig::of(rig, preset, seed);
        let drive = match (legs, PerturbedRig::of(rig, preset, None).legs) {
            (BuiltLegs::Hydraulic(legs), BuiltLegs::Hydraulic(believed_legs)) => {
                let tuning = LegTuning::preset(preset, &believed_legs[0]);
                DriveSetup::Hydraulic(Box::new(HydraulicSetup { legs, believed_legs, tuning }))
            }
            (BuiltLegs::Loops(loops), _) | (_, BuiltLegs::Loops(loops)) => {
                DriveSetup::Loops { loops: Box::new(loops), limits: rig.limits }
            }
        };
        Self {
            platform: Platform::new(&built),
            drive,
            dead_time_s: built.drive.dead_time_s(),
            believed_platform: Platform::new(rig),
        }
    }

    /// Legs on oil, if that moves them.
    #[must_use]
    pub fn hydraulic(&self) -> Option<&HydraulicSetup> {
        match &self.drive {
            DriveSetup::Hydraulic(h) => Some(h),
            DriveSetup::Loops { .. } => None,
        }
    }

    /// The same, to be changed.
    pub fn hydraulic_mut(&mut self) -> Option<&mut HydraulicSetup> {
        match &mut self.drive {
            DriveSetup::Hydraulic(h) => Some(h),
            DriveSetup::Loops { .. } => None,
        }
    }

    /// The feed-forward that belongs to what is believed.
    #[must_use]
    pub fn feedforward(&self) -> Feedforward {
        let platform = self.believed_platform.clone();
        match &self.drive {
            DriveSetup::Hydraulic(h) => Feedforward::new(platform, h.believed_legs, &h.tuning),
            DriveSetup::Loops { .. } => Feedforward::of_lengths(platform),
        }
    }
}

/// Commands on their way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CommandPath<T> {
    kept: [T; KEPT],
    /// Commands taken so far; the command of tick `n` stands at `n % KEPT`.
    taken: u64,
    dead_time_s: f64,
}

impl<T: Copy> CommandPath<T> {
    /// A path that has carried `rest` for long.
    ///
    /// # Errors
    /// A dead time out of range.
    pub(crate) fn new(rest: T, dead_time_s: f64) -> Result<Self, SetupError> {
        if !(0.0..=MOST_DEAD_TIME_S).contains(&dead_time_s) {
            return Err(SetupError::DeadTime { dead_time_s });
        }
        Ok(Self { kept: [rest; KEPT], taken: KEPT as u64, dead_time_s })
    }

    /// Takes the command of a tick.
    pub(crate) fn take(&mut self, command: T) {
        self.kept[(self.taken % KEPT as u64) as usize] = command;
        self.taken += 1;
    }

    /// The command in force at `time_s` after the last command was taken, its predecessor, and the
    /// time since it arrived.
    pub(crate) fn at(&self, time_s: f64) -> (&T, &T, f64) {
        // Whole ticks that the newest command in force is older than the last one. Rounding must not
        // make a command that arrives now late.
        let late = ((self.dead_time_s - time_s) / TICK_S - 1e-9).ceil().max(0.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "0 to KEPT − 2"
        )]
        let back = late as u64;
        let newest = self.taken - 1;
        let place = |n: u64| &self.kept[(n % KEPT as u64) as usize];
        let n = newest.saturating_sub(back);
        (place(n), place(n.saturating_sub(1)), time_s + late * TICK_S - self.dead_time_s)
    }
}

/// Samples of an inner loop of `rate_hz` in a tick.
pub(crate) fn samples_per_tick(rate_hz: f64) -> Result<u32, SetupError> {
    [1, 2, 4, 8]
        .into_iter()
        .find(|n| (rate_hz * TICK_S - f64::from(*n)).abs() < 1e-9)
        .ok_or(SetupError::Rate { rate_hz })
}

impl LegCommand {
    /// What the leg is to do `since_s` after this command arrived, `before` being the one before it:
    /// length along its speed and acceleration, flow and force with the rate between both.
    pub(crate) fn target(&self, before: &Self, since_s: f64, valve_delay_s: f64) -> LegTarget {
        let rate = |x: f64, x0: f64| (x - x0) / TICK_S;
        let acceleration = rate(self.speed_m_s, before.speed_m_s);
        LegTarget {
            length_m: self.length_m + since_s * (self.speed_m_s + 0.5 * since_s * acceleration),
            flow_speed_m_s: self.flow_speed_m_s
                + since_s * rate(self.flow_speed_m_s, before.flow_speed_m_s),
            force_n: self.force_n + since_s * rate(self.force_n, before.force_n),
            speed_m_s: self.speed_m_s + since_s * acceleration,
            speed_ahead_m_s: self.speed_m_s + (since_s + valve_delay_s) * acceleration,
        }
    }
}

impl RigCommand {
    /// Pose, twist and acceleration of the plate `since_s` after this command arrived, `before` being the one before
    /// it: along twist and acceleration, as [`LegCommand::target`].
    fn motion(&self, before: &Self, since_s: f64) -> (Pose, Twist, Twist) {
        let rate = |x: DVec3, x0: DVec3| (x - x0) / TICK_S;
        let acceleration =
            Twist { v: rate(self.twist.v, before.twist.v), w: rate(self.twist.w, before.twist.w) };
        let (t, half) = (since_s, 0.5 * since_s);
        let mean = Twist {
            v: self.twist.v + acceleration.v * half,
            w: self.twist.w + acceleration.w * half,
        };
        let end =
            Twist { v: self.twist.v + acceleration.v * t, w: self.twist.w + acceleration.w * t };
        (Platform::moved(&self.x_bp, &mean, t), end, acceleration)
    }
}

/// A rig that runs: plant, controllers and command path.
#[derive(Clone, Debug)]
pub struct ClosedRig<P = ReducedRig> {
    driven: Driven<P>,
    state: RigState,
    path: CommandPath<RigCommand>,
    /// The plate goes where it is commanded, without oil, valves, seals and loops.
    exact: bool,
}

/// What moves the plate.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "a rig has one of them, for as long as it lives")]
enum Driven<P> {
    Hydraulic(OilRig<P>),
    Loops(LoopRig, LoopState),
}

/// A plant on oil and the controllers of its legs.
#[derive(Clone, Debug)]
struct OilRig<P> {
    plant: P,
    controllers: [LegController; 6],
    valve_delay_s: f64,
    samples: u32,
    /// Of the plant, a sample.
    steps: u32,
    valves: [f64; 6],
}

impl ClosedRig {
    /// The reduced rig of a setup, as [`ClosedRig::with_plant`], or its legs with position loops.
    ///
    /// # Errors
    /// See [`SetupError`].
    pub fn new(setup: &RigSetup, x_bp: &Pose) -> Result<Self, SetupError> {
        let step_s = TICK_S / f64::from(PLANT_STEPS);
        let platform = setup.platform.clone();
        match &setup.drive {
            DriveSetup::Hydraulic(h) => {
                Self::with_plant(ReducedRig::new(platform, &h.legs, step_s), setup, x_bp)
            }
            DriveSetup::Loops { loops, limits } => {
                let rig = LoopRig::new(platform, loops, limits, step_s);
                let (state, own) =
                    rig.at_rest(x_bp, &Wrench::ZERO).map_err(|_| SetupError::Start)?;
                let path = resting(&state, &own.force_n, setup.dead_time_s)?;
                Ok(Self { driven: Driven::Loops(rig, own), state, path, exact: false })
            }
        }
    }
}

/// A path that has long carried the command to stay, the legs pushing with these forces, N.
fn resting(
    state: &RigState,
    force_n: &[f64; 6],
    dead_time_s: f64,
) -> Result<CommandPath<RigCommand>, SetupError> {
    let mut legs = [LegCommand::default(); 6];
    for (i, leg) in legs.iter_mut().enumerate() {
        leg.length_m = state.length_m[i];
        leg.force_n = force_n[i];
    }
    CommandPath::new(RigCommand { legs, x_bp: state.x_bp, twist: Twist::default() }, dead_time_s)
}

impl<P: RigPlant> ClosedRig<P> {
    /// A rig at rest at `x_bp`, as it is after holding there for long: the oil carries the weight and
    /// controllers are quiet. The plant has the legs of the setup; its step fits into the period of
    /// the inner loop a whole number of times.
    ///
    /// # Errors
    /// See [`SetupError`].
    pub fn with_plant(mut plant: P, setup: &RigSetup, x_bp: &Pose) -> Result<Self, SetupError> {
        let oil = setup.hydraulic().ok_or(SetupError::NoOil)?;
        let samples = samples_per_tick(oil.tuning.rate_hz)?;
        let step_s = plant.step_s();
        let steps = (TICK_S / f64::from(samples) / step_s).round();
        if steps < 1.0 || (steps * step_s * f64::from(samples) / TICK_S - 1.0).abs() > 1e-9 {
            return Err(SetupError::Step { step_s, period_s: TICK_S / f64::from(samples) });
        }
        let state = plant.rest(x_bp, &Wrench::ZERO).map_err(|_| SetupError::Start)?;
        let force_n = core::array::from_fn(|i| state.legs[i].pressure_pa * oil.legs[i].oil.area_m2);
        let path = resting(&state, &force_n, setup.dead_time_s)?;
        let driven = OilRig {
            plant,
            controllers: oil.believed_legs.map(|leg| LegController::new(oil.tuning, leg)),
            valve_delay_s: setup.feedforward().valve_delay_s(),
            samples,
            steps: steps as u32,
            valves: [0.0; 6],
        };
        Ok(Self { driven: Driven::Hydraulic(driven), state, path, exact: false })
    }

    /// With legs that do exactly what they are commanded, after the dead time: neither oil nor valves nor seals nor
    /// loops, and no load that moves them. What a rig differs by because of its legs is found by comparing with this.
    #[must_use]
    pub const fn exact(mut self) -> Self {
        self.exact = true;
        self
    }

    /// The plant on oil, if oil moves it.
    #[must_use]
    pub const fn plant(&self) -> Option<&P> {
        match &self.driven {
            Driven::Hydraulic(oil) => Some(&oil.plant),
            Driven::Loops(..) => None,
        }
    }

    /// Kinematics and rigid dynamics as built.
    #[must_use]
    pub fn platform(&self) -> &Platform {
        match &self.driven {
            Driven::Hydraulic(oil) => oil.plant.platform(),
            Driven::Loops(rig, _) => rig.platform(),
        }
    }

    /// The step, s.
    #[must_use]
    pub fn step_s(&self) -> f64 {
        match &self.driven {
            Driven::Hydraulic(oil) => oil.plant.step_s(),
            Driven::Loops(rig, _) => rig.step_s(),
        }
    }

    /// The state of the plant.
    #[must_use]
    pub const fn state(&self) -> &RigState {
        &self.state
    }

    /// One tick of 1 ms with the command of its beginning. `external` gives the wrench on the plate
    /// about the origin of `ep`, in `eb`, and is asked in the middle of every step of the plant.
    ///
    /// # Errors
    /// The plant cannot be continued.
    pub fn tick(
        &mut self,
        command: &RigCommand,
        mut external: impl FnMut(&Pose, &Twist) -> Wrench,
    ) -> Result<RigMeasurement, RigFault> {
        self.path.take(*command);
        if self.exact {
            self.follow(external);
            return Ok(self.measure());
        }
        match &mut self.driven {
            Driven::Hydraulic(oil) => oil.tick(&self.path, &mut self.state, &mut external)?,
            Driven::Loops(rig, own) => {
                for k in 0..steps_of(rig.step_s()) {
                    let (now, before, since) = self.path.at((f64::from(k) + 0.5) * rig.step_s());
                    let targets = core::array::from_fn(|i| {
                        now.legs[i].target(&before.legs[i], since, 0.0).length_m
                    });
                    rig.step(&mut self.state, own, &targets, &mut external)?;
                }
            }
        }
        Ok(self.measure())
    }

    /// A tick of legs without dynamics.
    fn follow(&mut self, mut external: impl FnMut(&Pose, &Twist) -> Wrench) {
        let step_s = self.step_s();
        for k in 0..steps_of(step_s) {
            let at = |part: f64| {
                let (now, before, since) = self.path.at((f64::from(k) + part) * step_s);
                now.motion(before, since)
            };
            let ((middle, twist, _), (x_bp, end, acceleration)) = (at(0.5), at(1.0));
            let _ = external(&middle, &twist);
            let s = &mut self.state;
            (s.x_bp, s.twist, s.acceleration) = (x_bp, end, acceleration);
        }
        self.state.length_m = self.platform().at(&self.state.x_bp).length_m;
    }

    /// What sensors and truth say now.
    #[must_use]
    pub fn measure(&self) -> RigMeasurement {
        let s = &self.state;
        let c = self.platform().at(&s.x_bp);
        let (force_n, spool) = match &self.driven {
            Driven::Hydraulic(oil) => {
                let area = |i: usize| oil.controllers[i].model().oil.area_m2;
                let force_n = core::array::from_fn(|i| s.legs[i].pressure_pa * area(i));
                (force_n, s.legs.map(|leg| leg.spool))
            }
            Driven::Loops(_, own) => (own.force_n, [0.0; 6]),
        };
        RigMeasurement {
            length_m: s.length_m,
            speed_m_s: c.rates(&s.twist),
            force_n,
            spool,
            x_bp: s.x_bp,
            twist: s.twist,
            acceleration: s.acceleration,
        }
    }

    /// Digest of plant and controllers; commands on their way are inputs and have their own.
    #[must_use]
    pub fn digest(&self) -> Digest {
        let mut h = StateHasher::new();
        self.state.hash_into(&mut h);
        match &self.driven {
            Driven::Hydraulic(oil) => {
                for (c, v) in oil.controllers.iter().zip(oil.valves) {
                    c.hash_into(&mut h);
                    h.f64(v);
                }
            }
            Driven::Loops(_, own) => own.hash_into(&mut h),
        }
        h.finish()
    }
}

/// Steps of a plant in a tick; its step fits into it a whole number of times.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a handful")]
fn steps_of(step_s: f64) -> u32 {
    (TICK_S / step_s).round() as u32
}

impl<P: RigPlant> OilRig<P> {
    fn tick(
        &mut self,
        path: &CommandPath<RigCommand>,
        state: &mut RigState,
        external: &mut impl FnMut(&Pose, &Twist) -> Wrench,
    ) -> Result<(), RigFault> {
        let sample_s = TICK_S / f64::from(self.samples);
        for k in 0..self.samples {
            let (now, before, since) = path.at(f64::from(k) * sample_s);
            for (i, (controller, valve)) in
                self.controllers.iter_mut().zip(&mut self.valves).enumerate()
            {
                let target = now.legs[i].target(&before.legs[i], since, self.valve_delay_s);
                let measured = LegMeasurement {
                    length_m: state.length_m[i],
                    pressure_pa: state.legs[i].pressure_pa,
                };
                *valve = controller.step(&target, &measured);
            }
            for _ in 0..self.steps {
                self.plant.advance(state, &self.valves, &mut *external)?;
            }
        }
        Ok(())
    }
}
