//! The loop as types: `Idle → Armed → Running → Stopped`. What is not in the type cannot be done: only
//! an armed loop starts, only a running one ticks, only an idle one is armed, and a stopped one becomes
//! idle by [`Loop::reset`] alone.
//!
//! The order of a tick is that of §6: read rig, condition sensors, wrench at ports, integrate bodies,
//! compensate, platform pose command, leg commands, safety verdict, write rig, record. What runs in a
//! tick does not allocate, lock, log or format (checked by `tests/no_allocation.rs`).
//!
//! The way of a run, all in ticks: *move* to the beginning of the run-up, *settle* and tare there,
//! *run up*, *closed* (the bodies answer the measured wrenches), *stop*. A dry run goes slowly, without
//! the run-up and without closing, to the initial condition and back to where it was armed.

use core::time::Duration;

use docktwin_control::{
    compensator::{Compensation, Compensator},
    feedforward::{Feedforward, PlateMotion},
    planner::{Move, RunUp},
    safety::{Limit, SafetyLimits, Supervisor, Trip, Watched, half_widths},
    sensing::{Conditioning, Readings, SensorScheme},
};
use docktwin_core::{DVec3, Digest, Pose, StateHasher, Twist, Wrench};
use docktwin_model::Rig as RigModel;
use docktwin_physics::{
    body::BodyState,
    mounted::{Carried, Payload, Ports},
    platform::Platform,
    programme::{Programme, RelativeMotion},
    reduced::Inputs,
};

use crate::{
    clock::{Clock, ClockCounts},
    histogram::{LatencyHistogram, PhaseHistograms},
    port::{RigCommand, RigMeasurement, RigMode, flag, largest, status, wrench},
    realtime::monotonic_ns,
    rig::{Rig, RigError},
};

/// Everything a run needs, nothing of which changes in it.
#[derive(Clone, Debug)]
pub struct LoopSetup {
    /// The rig as its file says.
    pub rig: RigModel,
    /// What every leg is told, by what is believed of them.
    pub feedforward: Feedforward,
    /// What was identified of every leg and is to be undone.
    pub corrections: LegCorrections,
    /// The spacecraft at the initial condition.
    pub bodies: Programme,
    /// Against the delay of the rig.
    pub compensation: Compensation,
    /// Ticks by which every command is held back, at most [`MOST_ADDED`]: makes a rig as slow as another
    /// one, to see what that does.
    pub added_ticks: usize,
    /// Where F4, M4 come from.
    pub scheme: SensorScheme,
    /// What sensor B carries, as believed.
    pub payload: Payload,
    /// Mass of the ring, which sensor A feels where the mechanism says it is, kg; 0 where none moves.
    pub ring_mass_kg: f64,
    /// From the instant a command is for to the instant at which sensor B reads what the plate does
    /// then, s: delay of the plate and lag of the sensor. Weight and inertia of what the sensor carries
    /// are taken off with it where the plate has no accelerometers.
    pub interface_delay_s: f64,
    /// Lag of sensor B less that of the accelerometers, s.
    pub accelerometers_ahead_s: f64,
    /// What ends the run.
    pub limits: SafetyLimits,
    /// Times and speeds of the way to the initial condition.
    pub approach: Approach,
    /// Ticks of the closed loop.
    pub ticks: u64,
    /// Number of this run at the port, not 0.
    pub session: u64,
    /// How long to wait for a measurement: in lockstep the rig's time, else next to nothing.
    pub patience: Duration,
    /// Slowly to the initial condition and back, without closing the loop.
    pub dry_run: bool,
}

/// The way to the initial condition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Fastest of the first move, m/s.
    pub speed_m_s: f64,
    /// Fastest turning of it, rad/s.
    pub rate_rad_s: f64,
    /// Rest before the run-up, over whose second half sensors are tared, s.
    pub settle_s: f64,
    /// Duration of the run-up, s.
    pub run_up_s: f64,
}

/// What was identified of the legs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegCorrections {
    /// Speed at which each leg creeps with its valve at zero, m/s: null bias over flow gain.
    pub bias_m_s: [f64; 6],
    /// Flow gain of each valve over what its controller believes.
    pub flow_gain: [f64; 6],
}

impl LegCorrections {
    /// The flow to ask leg `i` for, m/s, so that it gets `flow_speed_m_s`.
    #[must_use]
    pub fn flow_speed_m_s(&self, i: usize, flow_speed_m_s: f64) -> f64 {
        (flow_speed_m_s - self.bias_m_s[i]) / self.flow_gain[i]
    }
}

impl Default for LegCorrections {
    fn default() -> Self {
        Self { bias_m_s: [0.0; 6], flow_gain: [1.0; 6] }
    }
}

/// Where a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Phase {
    /// To the beginning of the run-up.
    Move = 0,
    /// At rest there.
    Settle = 1,
    /// Along the free flight to the initial condition.
    RunUp = 2,
    /// The dynamics loop is closed.
    Closed = 3,
    /// Coming to rest.
    Stop = 4,
}

impl Phase {
    /// Name in events.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Move => "move",
            Self::Settle => "settle",
            Self::RunUp => "run_up",
            Self::Closed => "closed",
            Self::Stop => "stop",
        }
    }
}

/// Parts of a tick whose times are kept, in this order.
pub const PHASES: [&str; 6] = ["receive", "condition", "bodies", "command", "safety", "send"];

/// One tick as it was, for the record. Plain and large; it is written once and copied once.
#[derive(Clone, Copy, Debug)]
pub struct TickRecord {
    /// Tick since the start of the loop.
    pub tick: u64,
    /// Tick of the closed loop, 0 when it is closed; `None` outside.
    pub closed_tick: Option<u64>,
    /// Where the run is.
    pub phase: Phase,
    /// How late the wake-up was, ns.
    pub lateness_ns: u64,
    /// Ticks left out before this one.
    pub missed: u64,
    /// Computing time of this tick, ns.
    pub compute_ns: u64,
    /// The measurement of `t_k`, or the last one there was.
    pub measurement: RigMeasurement,
    /// Whether it is of this tick.
    pub fresh: bool,
    /// Measured `X_34`.
    pub x_34: Pose,
    /// Conditioned wrenches at the ports.
    pub ports: Ports,
    /// The bodies at `t_k`; at the initial condition before the loop is closed.
    pub bodies: [BodyState; 2],
    /// Control wrenches held from `t_k`.
    pub control: Inputs,
    /// Motion of the bodies (of the plan before closing) at `t_{k+1}`.
    pub motion: RelativeMotion,
    /// What was sent.
    pub command: RigCommand,
    /// The limit that was passed, from its tick on.
    pub trip: Option<Trip>,
}

impl TickRecord {
    /// Digest of the bodies, of the rig as far as it tells, and of the control wrenches. Not for the
    /// loop's own path.
    #[must_use]
    pub fn digest(&self) -> Digest {
        let mut h = StateHasher::new();
        self.bodies.iter().for_each(|b| b.hash_into(&mut h));
        h.u64(self.measurement.state_digest);
        self.control.hash_into(&mut h);
        h.finish()
    }
}

/// One line of the arming checklist.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Check {
    /// What was looked at.
    pub name: &'static str,
    /// Whether the loop may be armed.
    pub passed: bool,
    /// What was found.
    pub found: String,
}

/// Why a loop cannot be armed or started.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ArmError {
    /// The rig does not answer.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// Points of the checklist failed.
    #[error("the loop is not armed: {}", failed(.0))]
    Checklist(Vec<Check>),
}

fn failed(checks: &[Check]) -> String {
    let lines: Vec<String> =
        checks.iter().filter(|c| !c.passed).map(|c| format!("{}: {}", c.name, c.found)).collect();
    lines.join("; ")
}

/// Not armed: the rig rests.
#[derive(Debug)]
pub struct Idle(());
/// Checked; the first command of motion may be sent.
#[derive(Debug)]
pub struct Armed {
    /// Made here, so that nothing asks for memory from now on.
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
    conditioning: Conditioning,
    supervisor: Supervisor,
    last: RigMeasurement,
    last_ports: Ports,
    without: u32,
    /// Measurements in a row that repeat the one before, of sensors A and B and the accelerometers.
    frozen: [u32; 3],
    /// What the accelerometers felt, newest first.
    felt: Option<[[DVec3; 2]; FELT]>,
    x_bp: Pose,
    commanded: Pose,
    /// Plate motions commanded for the last ticks, for what sensor B carries.
    past: [PlateMotion; PAST],
    /// Motions on their way, for [`LoopSetup::added_ticks`].
    held_back: [RelativeMotion; MOST_ADDED + 1],
    /// First and last tick of the end.
    stop_at: Option<[u64; 2]>,
    /// The rig does not answer.
    gone: bool,
    /// Ticks for which the legs have been at rest.
    resting: u64,
}
/// At rest after a run; how it ended.
#[derive(Debug)]
pub struct Stopped {
    /// The limit that ended it, if one did.
    pub trip: Option<Trip>,
    /// Least margins, by [`Limit`].
    pub least_margin: [f64; Limit::COUNT],
    /// Ticks of the closed loop.
    pub closed_ticks: u64,
}

/// Most ticks by which commands can be held back.
pub const MOST_ADDED: usize = 30;
/// Readings of the accelerometers kept.
const FELT: usize = 4;
/// Commanded motions kept.
const PAST: usize = 32;
/// Time over which the measured wrenches come in after closing, s.
const CLOSING_S: f64 = 0.02;
/// Time given to come to rest after the end of a run, s: at least, and at most.
const REST_S: [f64; 2] = [0.3, 3.0];
/// Leg speed that counts as rest, m/s, and for how long, s; length sensors show some of their own, and
/// oil swings back.
const REST_M_S: f64 = 0.005;
const REST_FOR_S: f64 = 0.05;

#[derive(Clone, Debug)]
struct Plan {
    first: Move,
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

/// The loop in one of its states.
///
/// Only a running loop commands:
///
/// ```compile_fail,E0599
/// use docktwin_hil::{clock::Clock, rig::Rig, scheduler::{Armed, Loop}};
/// use docktwin_physics::reduced::Inputs;
/// fn early<R: Rig, K: Clock>(mut l: Loop<R, K, Armed>) {
///     l.tick(&Inputs::default());
/// }
/// ```
///
/// Only an armed one starts:
///
/// ```compile_fail,E0599
/// use docktwin_hil::{clock::Clock, rig::Rig, scheduler::{Idle, Loop}};
/// fn unchecked<R: Rig, K: Clock>(l: Loop<R, K, Idle>) {
///     l.start();
/// }
/// ```
///
/// A stopped one is armed again after [`Loop::reset`] alone:
///
/// ```compile_fail,E0599
/// use docktwin_hil::{clock::Clock, rig::Rig, scheduler::{Loop, Stopped}};
/// fn again<R: Rig, K: Clock>(l: Loop<R, K, Stopped>) {
///     let _ = l.arm(Vec::new());
/// }
/// ```
///
/// The way that compiles:
///
/// ```
/// use docktwin_hil::{clock::Clock, rig::Rig, scheduler::{ArmError, Idle, Loop}};
/// use docktwin_physics::reduced::Inputs;
/// fn run<R: Rig, K: Clock>(l: Loop<R, K, Idle>) -> Result<Loop<R, K, Idle>, ArmError> {
///     let mut running = l.arm(Vec::new())?.start();
///     while !running.finished() {
///         running.tick(&Inputs::default())?;
///     }
///     Ok(running.stop().reset(2))
/// }
/// ```
#[derive(Debug)]
pub struct Loop<R, K, S> {
    setup: LoopSetup,
    platform: Platform,
    rig: R,
    clock: K,
    times: LoopTimes,
    /// Next tick number at the port.
    tick: u64,
    state: S,
}

impl<R: Rig, K: Clock, S> Loop<R, K, S> {
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

    fn period_s(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "a period is far below 2^53 ns")]
        let s = self.clock.period_ns() as f64 * 1e-9;
        s
    }

    fn into_state<T>(self, state: impl FnOnce(S) -> T) -> Loop<R, K, T> {
        Loop {
            setup: self.setup,
            platform: self.platform,
            rig: self.rig,
            clock: self.clock,
            times: self.times,
            tick: self.tick,
            state: state(self.state),
        }
    }

    /// A command of this tick without motion.
    fn still(&self, mode: RigMode, due_ns: u64) -> RigCommand {
        let mut c = RigCommand::still(&self.clock, mode, self.setup.session, self.tick, due_ns);
        if self.setup.dry_run {
            c.flags |= flag::DRY_RUN;
        }
        c
    }
}

impl<R: Rig, K: Clock> Loop<R, K, Idle> {
    /// An idle loop; nothing is sent yet.
    pub fn new(setup: LoopSetup, rig: R, clock: K) -> Self {
        let platform = setup.feedforward.platform().clone();
        let times = LoopTimes::default();
        Self { setup, platform, rig, clock, times, tick: 0, state: Idle(()) }
    }

    /// Goes through the checklist with the rig idle. `known` are points that were looked at
    /// elsewhere: files, dates, the operator's word.
    ///
    /// # Errors
    /// The rig does not answer, or a point is not fulfilled. Every point is told, the good ones too.
    pub fn arm(mut self, known: Vec<Check>) -> Result<Loop<R, K, Armed>, ArmError> {
        self.clock.start();
        let mut samples: Vec<RigMeasurement> = Vec::new();
        let mut silent = 0;
        while samples.len() < IDLE_TICKS {
            let w = self.clock.wait();
            let got = self.rig.receive(self.setup.patience, self.clock.now_ns());
            match got {
                Ok(Some(m)) if m.session == self.setup.session => samples.push(m),
                // The last answer of an earlier run may still be there.
                Ok(Some(_)) => {}
                Ok(None) if self.tick == 0 => {}
                Ok(None) => silent += 1,
                // What was on the way from an earlier loop is refused, and that is right.
                Err(RigError::Refused(_)) if self.tick < IDLE_PATIENCE => {}
                Err(e) => return Err(e.into()),
            }
            if silent > IDLE_PATIENCE {
                return Err(RigError::Gone.into());
            }
            // Rest, then stand under power: the second half of the samples.
            let mode = if 2 * samples.len() < IDLE_TICKS { RigMode::Idle } else { RigMode::Hold };
            let c = self.still(mode, w.due_ns);
            self.rig.send(&c)?;
            self.tick += 1;
        }
        let (mut checks, from) = self.checks(&samples);
        checks.extend(known);
        match from {
            Some(from) if checks.iter().all(|c| c.passed) => {
                let running = self.at_rest(&from, &samples[IDLE_TICKS / 2..]);
                Ok(self.into_state(|_| Armed { running, checks }))
            }
            _ => Err(ArmError::Checklist(checks)),
        }
    }

    /// The run before its first tick, with the plate at rest at `from`, where `samples` were taken.
    fn at_rest(&self, from: &Pose, samples: &[RigMeasurement]) -> Running {
        let s = &self.setup;
        let a = &s.approach;
        let run_up = RunUp::new(&s.bodies, a.run_up_s);
        let begin = run_up.at(0.0).x_34;
        let slow = if s.dry_run { DRY_RUN_SPEED } else { 1.0 };
        let (speed, rate) = (a.speed_m_s * slow, a.rate_rad_s * slow);
        let plan = Plan {
            first: Move::new(from, &begin, speed, rate),
            there: Move::new(&begin, &s.bodies.x_34(), speed, rate),
            run_up,
        };
        let x_bp = self.platform.plate_from_docking(from);
        // Good enough to watch the loads on the way to the tare.
        let q3 = (s.rig.x_b0 * s.rig.x_03).q.conjugate();
        let ring_weight = q3 * s.rig.gravity_m_s2 * s.ring_mass_kg;
        let mut conditioning = Conditioning::new(s.scheme, s.payload, ring_weight);
        let q4 = (x_bp * s.rig.x_4p.inverse()).q.conjugate();
        let still = Carried { gravity: q4 * s.rig.gravity_m_s2, ..Carried::default() };
        for m in samples {
            let carried = m.felt().map_or(still, |[v, w]| Carried::felt(v, w, DVec3::ZERO));
            conditioning.tare_sample(&readings(m), &carried);
        }
        conditioning.tare();
        Running {
            plan,
            phase: Phase::Move,
            since: 0,
            closed: 0,
            bodies: s.bodies.clone(),
            conditioning,
            supervisor: Supervisor::new(s.limits),
            last: RigMeasurement::zero(),
            last_ports: Ports::default(),
            without: 0,
            frozen: [0; 3],
            felt: samples.last().and_then(RigMeasurement::felt).map(|x| [x; FELT]),
            x_bp,
            commanded: x_bp,
            past: [PlateMotion::rest(x_bp); PAST],
            held_back: [RelativeMotion { x_34: *from, ..RelativeMotion::default() };
                MOST_ADDED + 1],
            stop_at: None,
            gone: false,
            resting: 0,
        }
    }

    fn checks(&self, samples: &[RigMeasurement]) -> (Vec<Check>, Option<Pose>) {
        let last = samples[samples.len() - 1];
        let mut out = Vec::new();
        let mut check = |name, passed, found: String| out.push(Check { name, passed, found });
        check("version", true, format!("protocol {}", last.protocol_version));
        check(
            "rig",
            last.has(status::ENABLED) && !last.has(status::SAFE_STATE),
            if last.has(status::SAFE_STATE) {
                "in its safe state: clear its fault and reset it".to_owned()
            } else if last.has(status::ENABLED) {
                "enabled".to_owned()
            } else {
                "not enabled: switch the hydraulics on".to_owned()
            },
        );
        check(
            "emergency stop",
            !last.has(status::EMERGENCY_STOP),
            if last.has(status::EMERGENCY_STOP) {
                "pressed: release it".to_owned()
            } else {
                "released".to_owned()
            },
        );
        check(
            "limit switches",
            !last.has(status::LIMIT_SWITCH),
            if last.has(status::LIMIT_SWITCH) {
                "a leg stands on its limit switch: drive it off by hand".to_owned()
            } else {
                "open".to_owned()
            },
        );
        for (name, bit, read) in [
            ("sensor A", status::SENSOR_A_SATURATED, (|m| m.sensor_a) as fn(&RigMeasurement) -> _),
            ("sensor B", status::SENSOR_B_SATURATED, |m| m.sensor_b),
        ] {
            let axes: [f64; 6] = read(&last);
            let moved = samples.iter().any(|m| !same_bits(&read(m), &axes));
            let (passed, found) = if last.has(bit) {
                (false, "saturated: reset its charge amplifier".to_owned())
            } else if !moved {
                (false, "the same to the last bit in every sample: it is not alive".to_owned())
            } else {
                (true, format!("alive, {:.1} N", norm3(&axes)))
            };
            check(name, passed, found);
        }
        let joined = last.joined();
        check(
            "mechanisms",
            !joined,
            if joined {
                "joined, or held by a latch, since the run before: draw back with `docktwin rig \
                 retract`"
                    .to_owned()
            } else {
                "not joined".to_owned()
            },
        );
        let found = self.platform.forward(&last.leg_length_m, &self.platform.middle());
        let x_bp = found.ok().map(|f| f.x_bp);
        let needed = self.setup.scheme == SensorScheme::Two;
        let fitted = self.setup.rig.sensors.is_some_and(|s| s.accelerometer.is_some());
        if let Some([felt, _]) = last.felt() {
            let rig = &self.setup.rig;
            let weight = |x: Pose| (x * rig.x_4p.inverse()).q.conjugate() * rig.gravity_m_s2;
            // Without a pose nobody knows where down is; that is told by itself.
            let off = x_bp.map_or(0.0, |x| (felt + weight(x)).length());
            let alive = samples.iter().any(|m| m.felt() != last.felt());
            let (good, found) = if !fitted {
                (false, "not in the rig's file: add [sensors.accelerometer] to it".to_owned())
            } else if last.has(status::ACCELEROMETER_SATURATED) {
                (false, "saturated: see that nothing strikes the plate".to_owned())
            } else if !alive {
                (false, "the same to the last bit in every sample: not alive".to_owned())
            } else if off > WEIGHTLESS_M_S2 {
                (false, format!("off the weight at rest by {off:.2} m/s2: see their axes"))
            } else {
                (true, format!("alive, off the weight at rest by {off:.3} m/s2"))
            };
            let found = if good || needed { found } else { format!("not used; {found}") };
            check("accelerometers", good || !needed, found);
        } else if fitted {
            let found = "in the rig's file, but the rig does not tell what they feel";
            check("accelerometers", !needed, found.to_owned());
        } else if needed {
            let found =
                "none: inertia goes by the commanded motion; with light bodies that diverges";
            check("accelerometers", true, found.to_owned());
        }
        let from = x_bp.map(|x| self.platform.docking_from_plate(&x));
        let margin = least(&self.platform.stroke_margins_m(&last.leg_length_m));
        let (passed, found) = match &from {
            None => {
                (false, "the leg lengths belong to no pose: check the length sensors".to_owned())
            }
            Some(_) if margin < self.setup.limits.of(Limit::Stroke) => {
                (false, format!("a leg has {margin:.3} m of stroke left: drive the plate inward"))
            }
            Some(x) if half_widths(&self.setup.rig, x) > self.setup.limits.of(Limit::Pose) => {
                let n = half_widths(&self.setup.rig, x);
                (false, format!("{n:.2} half-widths from the middle: drive the plate inward"))
            }
            Some(x) => {
                let p = x.p;
                (
                    true,
                    format!(
                        "X_34 at ({:.3}, {:.3}, {:.3}) m, {margin:.3} m of stroke",
                        p.x, p.y, p.z
                    ),
                )
            }
        };
        check("position", passed, found);
        (out, from)
    }
}

/// Ticks looked at before arming, idle and holding.
const IDLE_TICKS: usize = 20;
/// Most that accelerometers at rest may be off what they should feel, m/s²: far above their zero, far
/// below a wrong axis.
const WEIGHTLESS_M_S2: f64 = 0.5;
/// Ticks without an answer before a rig counts as gone.
const IDLE_PATIENCE: u64 = 200;

fn readings(m: &RigMeasurement) -> Readings {
    let (a, b) = (wrench(&m.sensor_a), wrench(&m.sensor_b));
    Readings { a, b, ring: DVec3::from_slice(&m.mechanism[3..6]) }
}

fn norm3(x: &[f64; 6]) -> f64 {
    (x[0] * x[0] + x[1] * x[1] + x[2] * x[2]).sqrt()
}

fn least(x: &[f64; 6]) -> f64 {
    // A NaN must come through.
    x.iter().fold(f64::INFINITY, |a, b| if *b < a || b.is_nan() { *b } else { a })
}

fn same_bits(a: &[f64; 6], b: &[f64; 6]) -> bool {
    a.map(f64::to_bits) == b.map(f64::to_bits)
}

impl<R: Rig, K: Clock> Loop<R, K, Armed> {
    /// The checklist as it was passed.
    pub fn checks(&self) -> &[Check] {
        &self.state.checks
    }

    /// Begins to move.
    pub fn start(self) -> Loop<R, K, Running> {
        self.into_state(|s| s.running)
    }
}

/// Part of the usual speed in a dry run.
const DRY_RUN_SPEED: f64 = 0.25;

impl<R: Rig, K: Clock> Loop<R, K, Running> {
    /// Where the run is.
    pub const fn phase(&self) -> Phase {
        self.state.phase
    }

    /// True when the rig is at rest after the run, or cannot be waited for any longer.
    pub fn finished(&self) -> bool {
        let s = &self.state;
        let Some([first, last]) = s.stop_at else { return false };
        let rests = s.resting >= self.ticks(REST_FOR_S);
        // In lockstep every further tick would wait for a rig that is not there.
        let alone = K::LOCKSTEP && s.gone;
        alone || self.tick >= last || (self.tick >= first && rests)
    }

    /// Ends the run: the rig comes to rest from the next tick on.
    pub fn end(&mut self) {
        self.enter_stop();
    }

    fn enter_stop(&mut self) {
        if self.state.phase != Phase::Stop {
            self.state.phase = Phase::Stop;
            self.state.since = 0;
            self.state.stop_at = Some(REST_S.map(|s| self.tick + self.ticks(s)));
        }
    }

    /// Ticks of a time.
    fn ticks(&self, time_s: f64) -> u64 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "ticks")]
        let n = (time_s / self.period_s()).ceil() as u64;
        n.max(1)
    }

    /// One tick: waits for it, and goes through everything. `control` are the control wrenches of the
    /// tick; they count once the loop is closed.
    ///
    /// # Errors
    /// The connection to the rig is broken. The loop stops by itself when measurements stay away.
    pub fn tick(&mut self, control: &Inputs) -> Result<TickRecord, RigError> {
        let w = self.clock.wait();
        // Ticks left out are ticks of the rig.
        self.tick += w.missed;
        let mut mark = monotonic_ns();
        let begin = mark;
        let mut lap = [0; PHASES.len()];
        let mut timed = |i: usize| {
            let now = monotonic_ns();
            lap[i] = now - mark;
            mark = now;
        };

        let fresh = self.receive()?;
        timed(0);

        let x_34 = self.platform.docking_from_plate(&self.state.x_bp);
        let ports = self.condition(fresh, &x_34);
        timed(1);

        let bodies = self.state.bodies.bodies();
        let closed_tick = (self.state.phase == Phase::Closed).then_some(self.state.closed);
        let phase = self.state.phase;
        let motion = self.advance(&ports, control);
        timed(2);

        let mut command = self.command(&motion, w.due_ns);
        timed(3);

        let trip = self.judge(&ports, &x_34, &command);
        if trip.is_some() {
            self.enter_stop();
        }
        if self.state.phase == Phase::Stop {
            command = self.still(RigMode::Stop, w.due_ns);
        }
        timed(4);

        self.rig.send(&command)?;
        self.tick += 1;
        timed(5);
        let compute_ns = mark - begin;
        self.times.lateness.record_ns(w.lateness_ns);
        self.times.compute.record_ns(compute_ns);
        for (i, ns) in lap.into_iter().enumerate() {
            self.times.phases.record_ns(i, ns);
        }
        Ok(TickRecord {
            tick: w.tick,
            closed_tick,
            phase,
            lateness_ns: w.lateness_ns,
            missed: w.missed,
            compute_ns,
            measurement: self.state.last,
            fresh,
            x_34,
            ports,
            bodies,
            control: *control,
            motion,
            command,
            trip,
        })
    }

    /// Takes what the rig has measured; true when it is of this tick and can be used.
    fn receive(&mut self) -> Result<bool, RigError> {
        let received = self.rig.receive(self.setup.patience, self.clock.now_ns());
        self.state.gone = received == Err(RigError::Gone);
        let fresh = match received {
            Ok(Some(m)) => self.take(&m),
            Ok(None) | Err(RigError::Gone) => false,
            Err(RigError::Refused(_)) => {
                self.times.refused += 1;
                false
            }
            Err(e) => return Err(e),
        };
        let rests = fresh && largest(&self.state.last.leg_speed_m_s) < REST_M_S;
        self.state.resting = if rests { self.state.resting + 1 } else { 0 };
        if fresh {
            self.state.without = 0;
        } else {
            self.state.without += 1;
            self.times.without += 1;
        }
        Ok(fresh)
    }

    /// Keeps a measurement and finds the plate in it. False when its lengths belong to no pose: then
    /// it is judged, and the bodies do without it.
    fn take(&mut self, m: &RigMeasurement) -> bool {
        let two = self.setup.scheme == SensorScheme::Two;
        let s = &mut self.state;
        if let (Some(past), Some(new)) = (&mut s.felt, m.felt()) {
            past.rotate_right(1);
            past[0] = new;
        }
        let same = [
            same_bits(&m.sensor_a, &s.last.sensor_a),
            same_bits(&m.sensor_b, &s.last.sensor_b),
            two && s.felt.is_some() && same_bits(&m.plate_acceleration, &s.last.plate_acceleration),
        ];
        for (ticks, same) in s.frozen.iter_mut().zip(same) {
            *ticks = if same { *ticks + 1 } else { 0 };
        }
        s.last = *m;
        let found = self.platform.forward(&m.leg_length_m, &s.x_bp);
        found.map(|f| s.x_bp = f.x_bp).is_ok()
    }

    /// What sensor B did at the instant that its reading is of: as the accelerometers felt it, and as
    /// commanded where there are none.
    fn carried(&self) -> Carried {
        let asked = self.asked();
        let Some(felt) = &self.state.felt else { return asked };
        // A reading later than that of B is carried on.
        let back =
            (self.setup.accelerometers_ahead_s / self.period_s()).clamp(-1.0, (FELT - 1) as f64);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 2")]
        let whole = (back.max(0.0) as usize).min(FELT - 2);
        let part = back - whole as f64;
        let at = |i: usize| felt[whole][i] * (1.0 - part) + felt[whole + 1][i] * part;
        Carried::felt(at(0), at(1), asked.rate)
    }

    /// The plate as commanded, when it should be where it is measured now.
    fn asked(&self) -> Carried {
        // The newest command is of the present instant; the plate is where it was asked to be this
        // much earlier.
        let s = &self.state;
        let t = self.period_s();
        let back = (self.setup.interface_delay_s / t).clamp(0.0, (PAST - 2) as f64);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 30")]
        let whole = back as usize;
        let part = back - back.floor();
        let (new, old) = (&s.past[whole], &s.past[whole + 1]);
        let mix = |a: DVec3, b: DVec3| a * (1.0 - part) + b * part;
        let acceleration = Twist {
            v: mix(new.acceleration.v, old.acceleration.v),
            w: mix(new.acceleration.w, old.acceleration.w),
        };
        let rig = &self.setup.rig;
        let twist = Twist { v: new.twist.v, w: mix(new.twist.w, old.twist.w) };
        Carried::on_plate(&s.x_bp, &rig.x_4p.inverse(), rig.gravity_m_s2, &twist, &acceleration)
    }

    fn condition(&mut self, fresh: bool, x_34: &Pose) -> Ports {
        if fresh {
            let carried = self.carried();
            let read = readings(&self.state.last);
            let half = self.ticks(0.5 * self.setup.approach.settle_s);
            if self.state.phase == Phase::Settle && self.state.since >= half {
                self.state.conditioning.tare_sample(&read, &carried);
            }
            self.state.last_ports = self.state.conditioning.ports(&read, x_34, &carried);
        }
        self.state.last_ports
    }

    /// Motion at `t_{k+1}`, and the phase of the next tick.
    fn advance(&mut self, ports: &Ports, control: &Inputs) -> RelativeMotion {
        let t = self.period_s();
        let (settle, dry) = (self.ticks(self.setup.approach.settle_s), self.setup.dry_run);
        let s = &self.state;
        let first = self.ticks(s.plan.first.duration_s);
        let run_up = self.ticks(s.plan.run_up.duration_s);
        let there_and_back = self.ticks(2.0 * s.plan.there.duration_s + s.plan.first.duration_s);
        let s = &mut self.state;
        s.since += 1;
        #[expect(clippy::cast_precision_loss, reason = "ticks far below 2^53")]
        let time_s = s.since as f64 * t;
        let since = s.since;
        let mut next = None;
        let motion = match s.phase {
            Phase::Move => {
                next = (since >= first).then_some(Phase::Settle);
                s.plan.first.at(time_s)
            }
            Phase::Settle => {
                if since >= settle {
                    s.conditioning.tare();
                    next = Some(Phase::RunUp);
                }
                s.plan.first.at(s.plan.first.duration_s)
            }
            Phase::RunUp if dry => {
                next = (since >= there_and_back).then_some(Phase::Stop);
                s.plan.there_and_back(time_s)
            }
            Phase::RunUp => {
                // Ends on a tick: the plan is stretched by less than one.
                #[expect(clippy::cast_precision_loss, reason = "ticks far below 2^53")]
                let left_s = (run_up - since) as f64 * t;
                next = (since >= run_up).then_some(Phase::Closed);
                s.plan.run_up.at(s.plan.run_up.duration_s - left_s)
            }
            Phase::Closed => {
                // The loop is closed in free flight: what is measured then is noise and what the tare
                // left, and comes in gradually.
                #[expect(clippy::cast_precision_loss, reason = "ticks far below 2^53")]
                let share = (s.closed as f64 * t / CLOSING_S).min(1.0);
                let part = |w: &Wrench| Wrench { f: w.f * share, m: w.m * share };
                s.closed += 1;
                next = (s.closed >= self.setup.ticks).then_some(Phase::Stop);
                s.bodies.tick(&part(&ports.port3), &part(&ports.port4), control)
            }
            // The rig brakes by itself.
            Phase::Stop => RelativeMotion {
                x_34: self.platform.docking_from_plate(&s.x_bp),
                ..RelativeMotion::default()
            },
        };
        match next {
            Some(Phase::Stop) => self.enter_stop(),
            Some(phase) => (s.phase, s.since) = (phase, 0),
            None => {}
        }
        motion
    }

    fn command(&mut self, motion: &RelativeMotion, due_ns: u64) -> RigCommand {
        let mut out = self.still(RigMode::Track, due_ns);
        if self.state.phase == Phase::Stop {
            return out;
        }
        self.state.held_back.rotate_right(1);
        self.state.held_back[0] = self.setup.compensation.compensate(motion);
        let m = self.state.held_back[self.setup.added_ticks.min(MOST_ADDED)];
        let plate =
            PlateMotion::of_docking(&self.platform, &m.x_34, &[m.twist, m.acceleration, m.jerk]);
        self.state.past.rotate_right(1);
        self.state.past[0] = plate;
        self.state.commanded = plate.x_bp;
        let Ok(c) = self.setup.feedforward.command(&plate) else {
            // Told by the supervisor as a number that is not finite.
            out.leg_length_m = [f64::NAN; 6];
            return out;
        };
        out.ask(&plate, &c.legs, &self.setup.corrections);
        out
    }

    /// True when sensor B closes the loop and the accelerometers that were there at arming are gone:
    /// what it carries cannot be taken off any more.
    fn senseless(&self) -> bool {
        let s = &self.state;
        self.setup.scheme == SensorScheme::Two
            && s.felt.is_some()
            && !s.last.has(status::ACCELEROMETER)
    }

    /// Bits of sensors that are at the end of their range.
    const fn saturated(&self) -> u32 {
        let force = status::SENSOR_A_SATURATED | status::SENSOR_B_SATURATED;
        match self.setup.scheme {
            SensorScheme::Single => force,
            SensorScheme::Two => force | status::ACCELEROMETER_SATURATED,
        }
    }

    fn judge(&mut self, ports: &Ports, x_34: &Pose, command: &RigCommand) -> Option<Trip> {
        let s = &self.state;
        let m = &s.last;
        let rig = &self.setup.rig;
        // Before the first measurement there is nothing to be judged but that it stays away.
        if s.without > 0 && m.session == 0 {
            let w = Watched {
                stroke_margin_m: f64::MAX,
                ticks_without: s.without,
                ..Watched::default()
            };
            return self.state.supervisor.judge(&w, self.tick);
        }
        // The command before last is of the present instant.
        let plan = s.past[1].x_bp;
        let apart = plan.inverse() * s.x_bp;
        let turned = apart.q.to_scaled_axis().length() * self.platform.plate_radius_m();
        let open = s.phase == Phase::Stop;
        // What is told here must not pass a limit either, or the rig would have it for a tick.
        let mut ahead = Watched { stroke_margin_m: f64::INFINITY, ..Watched::default() };
        if !open {
            ahead = Watched {
                stroke_margin_m: least(&self.platform.stroke_margins_m(&command.leg_length_m)),
                leg_speed_m_s: largest(&command.leg_speed_m_s),
                pose_half_widths: half_widths(rig, &self.platform.docking_from_plate(&s.commanded)),
                tracking_m: if command.is_finite() { 0.0 } else { f64::NAN },
                ..ahead
            };
        }
        let margins =
            [least(&self.platform.stroke_margins_m(&m.leg_length_m)), ahead.stroke_margin_m];
        let larger = |a: DVec3, b: DVec3| {
            let (a, b) = (a.length(), b.length());
            if a > b || a.is_nan() { a } else { b }
        };
        let watched = Watched {
            stroke_margin_m: margins[0].min(margins[1]),
            leg_speed_m_s: largest(&m.leg_speed_m_s).max(ahead.leg_speed_m_s),
            leg_force_n: largest(&m.leg_force_n),
            force_n: larger(ports.port3.f, ports.port4.f),
            moment_nm: larger(ports.port3.m, ports.port4.m),
            pose_half_widths: half_widths(rig, x_34).max(ahead.pose_half_widths),
            tracking_m: if open { 0.0 } else { apart.p.length().max(turned) } + ahead.tracking_m,
            ticks_without: s.without,
            rig_left: !open
                && (m.has(status::SAFE_STATE)
                    || m.has(status::EMERGENCY_STOP)
                    || m.has(status::LIMIT_SWITCH)
                    || !m.has(status::ENABLED)),
            saturated: m.status & self.saturated() != 0 || self.senseless(),
            ticks_frozen: s.frozen.into_iter().fold(0, u32::max),
        };
        self.state.supervisor.judge(&watched, self.tick)
    }

    /// Ends a run that has come to rest, or leaves one where it is.
    pub fn stop(self) -> Loop<R, K, Stopped> {
        self.into_state(|s| Stopped {
            trip: s.supervisor.trip(),
            least_margin: *s.supervisor.least_margins(),
            closed_ticks: s.closed,
        })
    }
}

/// The same motion with time running back.
fn backwards(m: RelativeMotion) -> RelativeMotion {
    let turned = |t: Twist| Twist { v: -t.v, w: -t.w };
    RelativeMotion { twist: turned(m.twist), jerk: turned(m.jerk), ..m }
}

impl<R: Rig, K: Clock> Loop<R, K, Stopped> {
    /// How it ended.
    pub const fn end(&self) -> &Stopped {
        &self.state
    }

    /// How it ended, alone; the rig is let go.
    pub fn into_end(self) -> Stopped {
        self.state
    }

    /// Makes the loop idle again, for another run with a session of its own.
    #[must_use]
    pub fn reset(mut self, session: u64) -> Loop<R, K, Idle> {
        self.setup.session = session;
        self.tick = 0;
        self.times = LoopTimes::default();
        self.into_state(|_| Idle(()))
    }
}
