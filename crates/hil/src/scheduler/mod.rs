//! The loop as types: `Idle → Armed → Running → Stopped`. A step that a state does not allow does
//! not compile: only an armed loop starts, only a running one ticks, only an idle one is armed, and
//! a stopped one becomes idle by [`Loop::reset`] alone.
//!
//! | file | what |
//! | --- | --- |
//! | `setup.rs` | everything a run needs, and the builder that puts it together |
//! | `arm.rs` | the checklist, and the run before its first tick |
//! | `tick.rs` | one tick |
//! | `stop.rs` | how a run comes to its end |
//!
//! The order of a tick is that of §6: read rig, condition sensors, wrench at ports, integrate bodies,
//! compensate, platform pose command, leg commands, safety verdict, write rig, record. What runs in a
//! tick does not allocate, lock, log or format (checked by `tests/no_allocation.rs`).
//!
//! The phases of a run, all in ticks: *move* to the beginning of the run-up, *settle* and tare
//! there, *run up*, *closed* (the bodies answer the measured wrenches), *stop*. A dry run goes
//! slowly, without the run-up and without closing, to the initial condition and back to where it
//! was armed.

use docktwin_control::{
    compensation::{Demand, EnergyObserver, Gained, LoopContext, Measured, Method},
    feedforward::{PathTimes, PlateMotion},
    planner::{Move, Route, RunUp},
    safety::Supervisor,
    sensing::Conditioning,
};
use docktwin_core::{DVec3, Pose, Twist};
use docktwin_physics::{
    mounted::Ports,
    platform::Platform,
    programme::{Programme, RelativeMotion},
};
use docktwin_rigport::{
    guard::Guard,
    message::{Flags, RigCommand, RigMeasurement, RigMode},
    rig::Rig,
};

use crate::{
    clock::{Clock, ClockCounts},
    commands::{Form, still},
    histogram::{LatencyHistogram, PhaseHistograms},
};

mod arm;
mod setup;
mod stop;
mod tick;

pub use arm::{ArmError, Check};
pub use docktwin_control::compensation::Phase;
pub use setup::{
    Approach, LoopSetup, LoopSetupBuilder, MOST_ADDED, RigParameters, SetupProblems,
    believed_delays_s,
};
pub use stop::Stopped;
pub use tick::{PHASES, TickRecord};

/// Not armed: the rig rests.
#[derive(Debug)]
pub struct Idle(());

/// Checked; the first command of motion may be sent.
#[derive(Debug)]
pub struct Armed {
    /// Created here, so that nothing is allocated from now on.
    running: Running,
    checks: Vec<Check>,
}

/// In motion.
#[derive(Debug)]
pub struct Running {
    plan: Plan,
    phase: Phase,
    /// Ticks since the phase began.
    since: u64,
    closed: u64,
    bodies: Programme,
    /// Of the bodies, of the plan before closing, at `t_k`.
    motion: RelativeMotion,
    conditioning: Conditioning,
    supervisor: Supervisor,
    /// Where the loop's energy has a budget, and what it found in this tick.
    energy: Option<EnergyObserver>,
    gained: Gained,
    /// Form of the commands: legs, or pose of the plate.
    form: Form,
    guard: Guard,
    last: RigMeasurement,
    measured: Measured,
    ports: Ports,
    /// Ticks in a row without a usable measurement.
    without: u32,
    /// Measurements in a row that repeat the one before, of sensors A and B and the accelerometers.
    frozen: [u32; 3],
    /// Readings of the accelerometers, newest first, where there are any.
    accelerations: Option<[[DVec3; 2]; ACCELERATIONS]>,
    /// `X_34` commanded last.
    commanded: Pose,
    /// Plate motions commanded for the last ticks, newest first.
    in_flight: [PlateMotion; IN_FLIGHT],
    /// Demands on their way, for [`LoopSetup::added_ticks`].
    held_back: HeldBack,
    /// Earliest and latest tick at which the stop phase may end.
    stop_at: Option<[u64; 2]>,
    /// The rig does not answer.
    gone: bool,
    /// Ticks for which the legs have been at rest.
    resting: u64,
}

/// Readings of the accelerometers kept.
const ACCELERATIONS: usize = 4;
/// Commanded motions kept.
const IN_FLIGHT: usize = 32;

impl Running {
    /// What a compensator gets to know of a tick.
    fn context<'a>(
        &'a self,
        tick: u64,
        period_s: f64,
        control: &'a docktwin_physics::reduced::Inputs,
        paths: PathTimes,
    ) -> LoopContext<'a> {
        LoopContext {
            tick,
            period_s,
            phase: self.phase,
            bodies: &self.bodies,
            motion: &self.motion,
            control,
            measured: &self.measured,
            ports: &self.ports,
            in_flight: &self.in_flight,
            paths,
        }
    }
}

/// Demands of the last ticks.
#[derive(Debug)]
struct HeldBack {
    kept: Box<[Demand; MOST_ADDED + 1]>,
    /// Place of the newest.
    newest: usize,
}

impl HeldBack {
    /// After a long rest at a demand.
    fn new(rest: Demand) -> Self {
        Self { kept: Box::new([rest; MOST_ADDED + 1]), newest: 0 }
    }

    /// Takes the demand of a tick; gives the one of `ticks` ago.
    fn pass(&mut self, demand: Demand, ticks: usize) -> &Demand {
        let n = self.kept.len();
        self.newest = (self.newest + 1) % n;
        self.kept[self.newest] = demand;
        &self.kept[(self.newest + n - ticks.min(MOST_ADDED)) % n]
    }
}

#[derive(Clone, Debug)]
struct Plan {
    first: Route,
    run_up: RunUp,
    /// Of a dry run, from the beginning of the run-up to the initial condition.
    there: Move,
}

impl Plan {
    /// What a dry run does instead of the run-up, `time_s` after its begin: to the initial condition,
    /// back, and back to where it was armed.
    fn there_and_back(&self, time_s: f64) -> RelativeMotion {
        let t = self.there.duration_s;
        if time_s < t {
            self.there.at(time_s)
        } else if time_s < 2.0 * t {
            backwards(self.there.at(2.0 * t - time_s))
        } else {
            backwards(self.first.at((2.0 * t + self.first.duration_s - time_s).max(0.0)))
        }
    }
}

/// The same motion with time running back.
fn backwards(m: RelativeMotion) -> RelativeMotion {
    let turned = |t: Twist| Twist { v: -t.v, w: -t.w };
    RelativeMotion { twist: turned(m.twist), jerk: turned(m.jerk), ..m }
}

/// What has been measured of the loop itself.
#[derive(Clone, Debug)]
pub struct LoopTimes {
    /// Lateness of wake-ups.
    pub lateness: LatencyHistogram,
    /// Computing time of whole ticks.
    pub compute: LatencyHistogram,
    /// By [`PHASES`].
    pub phases: PhaseHistograms,
    /// Ticks without a measurement of their own.
    pub without: u64,
    /// Measurements that were refused.
    pub refused: u64,
}

impl Default for LoopTimes {
    fn default() -> Self {
        Self {
            lateness: LatencyHistogram::new(),
            compute: LatencyHistogram::new(),
            phases: PhaseHistograms::new(&PHASES),
            without: 0,
            refused: 0,
        }
    }
}

/// The loop in one of its states, with a compensator of the delay of the rig.
///
/// Only a running loop commands:
///
/// ```compile_fail,E0599
/// use docktwin_hil::{clock::Clock, scheduler::{Armed, Loop}};
/// use docktwin_physics::reduced::Inputs;
/// use docktwin_rigport::rig::Rig;
/// fn early<R: Rig, K: Clock>(mut l: Loop<R, K, Armed>) {
///     l.tick(&Inputs::default());
/// }
/// ```
///
/// Only an armed one starts:
///
/// ```compile_fail,E0599
/// use docktwin_hil::{clock::Clock, scheduler::{Idle, Loop}};
/// use docktwin_rigport::rig::Rig;
/// fn unchecked<R: Rig, K: Clock>(l: Loop<R, K, Idle>) {
///     l.start();
/// }
/// ```
///
/// A stopped one is armed again after [`Loop::reset`] alone:
///
/// ```compile_fail,E0599
/// use docktwin_hil::{clock::Clock, scheduler::{Loop, Stopped}};
/// use docktwin_rigport::rig::Rig;
/// fn again<R: Rig, K: Clock>(l: Loop<R, K, Stopped>) {
///     let _ = l.arm(Vec::new());
/// }
/// ```
///
/// The way that compiles:
///
/// ```
/// use docktwin_hil::{clock::Clock, scheduler::{ArmError, Idle, Loop}};
/// use docktwin_physics::reduced::Inputs;
/// use docktwin_rigport::rig::Rig;
/// fn run<R: Rig, K: Clock>(l: Loop<R, K, Idle>) -> Result<Loop<R, K, Idle>, ArmError> {
///     let mut running = l.arm(Vec::new())?.start();
///     while !running.finished() {
///         running.tick(&Inputs::default())?;
///     }
///     Ok(running.stop().reset(2))
/// }
/// ```
#[derive(Debug)]
pub struct Loop<R, K, S, C = Method> {
    setup: LoopSetup,
    platform: Platform,
    compensator: C,
    rig: R,
    clock: K,
    times: LoopTimes,
    /// Next tick number at the port.
    tick: u64,
    state: S,
}

impl<R: Rig, K: Clock, S, C> Loop<R, K, S, C> {
    /// The set-up.
    pub const fn setup(&self) -> &LoopSetup {
        &self.setup
    }

    /// What has been measured of the loop so far.
    pub const fn times(&self) -> &LoopTimes {
        &self.times
    }

    /// What the clock counted.
    pub fn clock_counts(&self) -> ClockCounts {
        self.clock.counts()
    }

    /// The rig.
    pub const fn rig(&self) -> &R {
        &self.rig
    }

    /// The method against the delay of the rig.
    pub const fn compensator(&self) -> &C {
        &self.compensator
    }

    fn period_s(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "a period is far below 2^53 ns")]
        let s = self.clock.period_ns() as f64 * 1e-9;
        s
    }

    /// Ticks of a time, at least one.
    fn ticks(&self, time_s: f64) -> u64 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "ticks")]
        let n = (time_s / self.period_s()).ceil() as u64;
        n.max(1)
    }

    fn into_state<T>(self, state: impl FnOnce(S) -> T) -> Loop<R, K, T, C> {
        Loop {
            setup: self.setup,
            platform: self.platform,
            compensator: self.compensator,
            rig: self.rig,
            clock: self.clock,
            times: self.times,
            tick: self.tick,
            state: state(self.state),
        }
    }

    /// A command of this tick without motion.
    fn still(&self, mode: RigMode, due_ns: u64) -> RigCommand {
        let mut c = still(&self.clock, mode, self.setup.session, self.tick, due_ns);
        c.flags.set(Flags::DRY_RUN, self.setup.dry_run);
        c
    }
}
