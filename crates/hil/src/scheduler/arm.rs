//! The arming checklist, and the run before its first tick.

use docktwin_control::{
    compensation::{Compensator, Demand, EnergyObserver, Gained, Measured, Method},
    feedforward::PlateMotion,
    planner::{Move, Route, RunUp},
    safety::{Supervisor, half_widths},
    sensing::{Conditioning, SensorScheme, taken_off},
};
use docktwin_core::{DVec3, Pose};
use docktwin_model::Rig as RigModel;
use docktwin_physics::{
    mounted::{Carried, Ports},
    programme::RelativeMotion,
};
use docktwin_rigport::{
    message::{Capabilities, DriveKind, RigMeasurement, RigMode, Status},
    rig::{Rig, RigError},
};

use super::{
    ACCELERATIONS, Armed, HeldBack, IN_FLIGHT, Idle, Loop, LoopSetup, LoopTimes, Phase, Plan,
    Running, tick::readings,
};
use crate::{
    clock::Clock,
    commands::{Form, guard, least},
};

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

impl Check {
    fn new(name: &'static str, passed: bool, found: impl Into<String>) -> Self {
        Self { name, passed, found: found.into() }
    }

    /// Passes unless `bad`; what was found in either case.
    fn unless(name: &'static str, bad: bool, remedy: &str, good: &str) -> Self {
        Self::new(name, !bad, if bad { remedy } else { good })
    }
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

/// Ticks checked before arming, idle and holding.
const IDLE_TICKS: usize = 20;
/// Largest error of accelerometers at rest, m/s²: far above their zero offset, far below the effect
/// of a wrong axis.
const WEIGHTLESS_M_S2: f64 = 0.5;
/// Ticks without an answer before a rig counts as gone.
const IDLE_PATIENCE: u64 = 200;
/// Part of the usual speed in a dry run.
const DRY_RUN_SPEED: f64 = 0.25;

impl<R: Rig, K: Clock> Loop<R, K, Idle> {
    /// An idle loop with the method that its set-up names; nothing is sent yet.
    pub fn new(setup: LoopSetup, rig: R, clock: K) -> Self {
        let method: Method = setup.method();
        Self::with_compensator(setup, rig, clock, method)
    }
}

impl<R: Rig, K: Clock, C: Compensator> Loop<R, K, Idle, C> {
    /// An idle loop with a method of one's own; nothing is sent yet.
    pub fn with_compensator(setup: LoopSetup, rig: R, clock: K, compensator: C) -> Self {
        let platform = setup.feedforward.platform().clone();
        let times = LoopTimes::default();
        Self { setup, platform, compensator, rig, clock, times, tick: 0, state: Idle(()) }
    }

    /// Goes through the checklist with the rig idle. `known` are lines that were checked
    /// elsewhere: files, dates, confirmation by the operator.
    ///
    /// # Errors
    /// The rig does not answer, or a point is not fulfilled. Every point is reported, the good ones too.
    pub fn arm(mut self, known: Vec<Check>) -> Result<Loop<R, K, Armed, C>, ArmError> {
        self.clock.start();
        let mut samples: Vec<RigMeasurement> = Vec::new();
        let mut silent = 0;
        let mut plan = None;
        while samples.len() < IDLE_TICKS {
            let w = self.clock.wait();
            let got = self.rig.receive(self.setup.patience, self.clock.now_ns());
            match got {
                Ok(Some(m)) if m.session == self.setup.session => samples.push(m),
                // The last answer of an earlier run may still be there.
                Ok(Some(_)) => {}
                Ok(None) if self.tick == 0 => {}
                Ok(None) => silent += 1,
                // A message of an earlier loop is refused, as it should be.
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
            if 2 * (samples.len() + 1) == IDLE_TICKS && plan.is_none() {
                // It takes longer than a rig under power may wait.
                plan = Some(self.stands(&samples).and_then(|from| self.plan(&from)));
                self.clock.resume();
            }
        }
        let last = samples[IDLE_TICKS - 1];
        let (mut checks, from) = self.checks(&samples);
        let plan = plan.flatten();
        // Where the plate stands wrong, the way from there says nothing.
        if checks.iter().all(|c| c.name != "position" || c.passed) {
            checks.push(approach(plan.is_some()));
        }
        checks.extend(known);
        match (from.zip(plan), Form::of(&last)) {
            (Some((from, plan)), Some(form)) if checks.iter().all(|c| c.passed) => {
                self.compensator.reset();
                let plan = Plan { first: plan.first.begun_at(&from, self.speeds()), ..plan };
                let running = self.at_rest(&from, plan, form, &samples[IDLE_TICKS / 2..]);
                Ok(self.into_state(|_| Armed { running, checks }))
            }
            _ => Err(ArmError::Checklist(checks)),
        }
    }

    /// The run before its first tick, with the plate at rest at `from`, where `samples` were taken.
    fn at_rest(&self, from: &Pose, plan: Plan, form: Form, samples: &[RigMeasurement]) -> Running {
        let s = &self.setup;
        let x_bp = self.platform.plate_from_docking(from);
        let conditioning = self.tared(&x_bp, samples);
        let last = samples[samples.len() - 1];
        let reference_a = Some(conditioning.reference().a);
        let motion = RelativeMotion { x_34: *from, ..RelativeMotion::default() };
        Running {
            plan,
            phase: Phase::Move,
            since: 0,
            closed: 0,
            bodies: s.bodies.clone(),
            motion,
            conditioning,
            supervisor: Supervisor::new(s.limits),
            energy: s
                .limits
                .energy_gained
                .map(|_| EnergyObserver::new(&s.system, s.believed().sensor_lag_s())),
            gained: Gained::default(),
            form,
            guard: guard(&s.rig, &s.limits, last.capabilities, reference_a),
            last: RigMeasurement::zero(),
            measured: Measured::none(x_bp, *from),
            ports: Ports::default(),
            without: 0,
            frozen: [0; 3],
            accelerations: last.accelerometer().map(|x| [x; ACCELERATIONS]),
            commanded: *from,
            in_flight: [PlateMotion::rest(x_bp); IN_FLIGHT],
            held_back: HeldBack::new(Demand::of(motion)),
            stop_at: None,
            gone: false,
            resting: 0,
        }
    }

    /// The way to the initial condition from `from`; `None` where the mechanisms would touch on it.
    fn plan(&self, from: &Pose) -> Option<Plan> {
        let s = &self.setup;
        let run_up = RunUp::new(&s.bodies, s.approach.run_up_s);
        let begin = run_up.at(0.0).x_34;
        let [speed, rate] = self.speeds();
        let there = Move::new(&begin, &s.bodies.x_34(), speed, rate);
        let touches = |x: &Pose| s.system.touches_at(x);
        // A stick may lean on its frame after a stop, and is out of it on the way.
        let stick = s.system.mechanism().stick.is_some();
        let first = Route::clear([from, &begin], [speed, rate], |x| !stick && touches(x))?;
        let clear = if s.dry_run { there.is_clear(touches) } else { run_up.is_clear(0.0, touches) };
        clear.then_some(Plan { first, there, run_up })
    }

    /// Fastest of the approach, m/s and rad/s.
    fn speeds(&self) -> [f64; 2] {
        let s = &self.setup;
        let slow = if s.dry_run { DRY_RUN_SPEED } else { 1.0 };
        [s.approach.speed_m_s * slow, s.approach.rate_rad_s * slow]
    }

    /// Where the mechanisms stand, `X_34`, by the last sample.
    fn stands(&self, samples: &[RigMeasurement]) -> Option<Pose> {
        self.plate(samples.last()?).map(|x_bp| self.platform.docking_from_plate(&x_bp))
    }

    /// Where the plate is measured, `X_bp`; `None` where the lengths belong to no pose, or nothing tells it.
    fn plate(&self, m: &RigMeasurement) -> Option<Pose> {
        if m.has(Capabilities::LEG_LENGTH) {
            let found = self.platform.forward(&m.leg_length_m, &self.platform.middle());
            found.ok().map(|f| f.x_bp)
        } else {
            m.plate()
        }
    }

    /// Conditioning tared at rest: good enough to watch the loads on the way to the tare.
    fn tared(&self, x_bp: &Pose, samples: &[RigMeasurement]) -> Conditioning {
        let s = &self.setup;
        let ring_weight = s.rig.gravity_in_e3_m_s2() * (s.ring_mass_kg * s.rig.uncarried());
        let thresholds =
            s.parameters.sensors.map_or([[0.0; 2]; 2], |both| both.map(|x| taken_off(&x)));
        let mut out = Conditioning::new(s.scheme, s.parameters.payload, ring_weight)
            .with_dead_zones(thresholds);
        let q4 = (*x_bp * s.rig.x_4p.inverse()).q.conjugate();
        let still = Carried { gravity: q4 * s.rig.gravity_m_s2, ..Carried::default() };
        for m in samples {
            let carried =
                m.accelerometer().map_or(still, |[v, w]| Carried::felt(v, w, DVec3::ZERO));
            out.tare_sample(&readings(m), &carried);
        }
        out.tare();
        out
    }

    /// The checklist, and where the mechanisms stand.
    fn checks(&self, samples: &[RigMeasurement]) -> (Vec<Check>, Option<Pose>) {
        let last = &samples[samples.len() - 1];
        let needs_b = self.setup.scheme == SensorScheme::Two;
        let x_bp = self.plate(last);
        let mut out = vec![
            Check::new("version", true, format!("protocol {}", last.protocol_version)),
            interface(last),
            rig(last),
            emergency_stop(last),
            limit_switches(last),
            force_sensor(&SENSOR_A, samples, true),
            force_sensor(&SENSOR_B, samples, needs_b),
            mechanisms(last),
        ];
        out.extend(accelerometers(&self.setup.rig, samples, x_bp, needs_b));
        let from = x_bp.map(|x| self.platform.docking_from_plate(&x));
        out.push(self.position(last, x_bp, from.as_ref()));
        (out, from)
    }

    fn position(&self, last: &RigMeasurement, x_bp: Option<Pose>, from: Option<&Pose>) -> Check {
        let (Some(x_bp), Some(x)) = (x_bp, from) else {
            let found = if last.has(Capabilities::LEG_LENGTH) {
                "the leg lengths belong to no pose: check the length sensors"
            } else {
                "neither leg lengths nor the plate's pose are measured: the loop needs one of them"
            };
            return Check::new("position", false, found);
        };
        // Without length sensors the lengths follow from the pose and the geometry of the file.
        let lengths = if last.has(Capabilities::LEG_LENGTH) {
            last.leg_length_m
        } else {
            self.platform.at(&x_bp).length_m
        };
        let margin = least(&self.platform.stroke_margins_m(&lengths));
        let far = half_widths(&self.setup.rig, x);
        let limits = &self.setup.limits;
        if margin < limits.stroke_margin_m {
            let found = format!("a leg has {margin:.3} m of stroke left: drive the plate inward");
            Check::new("position", false, found)
        } else if far > limits.pose_half_widths {
            let found = format!("{far:.2} half-widths from the middle: drive the plate inward");
            Check::new("position", false, found)
        } else {
            let p = x.p;
            let found =
                format!("X_34 at ({:.3}, {:.3}, {:.3}) m, {margin:.3} m of stroke", p.x, p.y, p.z);
            Check::new("position", true, found)
        }
    }
}

/// What the rig takes and measures is enough for the loop.
fn interface(last: &RigMeasurement) -> Check {
    let drive = match DriveKind::from_number(last.drive) {
        Some(DriveKind::Hydraulic) => "hydraulic drives",
        Some(DriveKind::PositionLoop) => "position loops",
        Some(DriveKind::Unstated) | None => "drives not stated",
    };
    match Form::of(last) {
        Some(Form::Legs) => Check::new("interface", true, format!("{drive}, six legs commanded")),
        Some(Form::Pose) => {
            Check::new("interface", true, format!("{drive}, the plate's pose commanded"))
        }
        None => Check::new(
            "interface",
            false,
            format!(
                "it takes neither the values of six legs (it has {}) nor the plate's pose: set \
                 capability bit 0 with leg_count 6, or bit 1",
                last.leg_count
            ),
        ),
    }
}

/// The way to the initial condition.
fn approach(clear: bool) -> Check {
    let found = if clear {
        "touches nothing"
    } else {
        "the mechanisms would touch before the initial condition: draw the plate back, or raise initial.gap_m"
    };
    Check::new("approach", clear, found)
}

fn rig(last: &RigMeasurement) -> Check {
    let (enabled, safe) = (last.is(Status::ENABLED), last.is(Status::SAFE_STATE));
    let found = if safe {
        "in its safe state: clear its fault and reset it"
    } else if enabled {
        "enabled"
    } else {
        "not enabled: switch its drives on"
    };
    Check::new("rig", enabled && !safe, found)
}

fn emergency_stop(last: &RigMeasurement) -> Check {
    let pressed = last.is(Status::EMERGENCY_STOP);
    Check::unless("emergency stop", pressed, "pressed: release it", "released")
}

fn limit_switches(last: &RigMeasurement) -> Check {
    let remedy = "a leg stands on its limit switch: drive it off by hand";
    Check::unless("limit switches", last.is(Status::LIMIT_SWITCH), remedy, "open")
}

/// One of the force sensors.
struct ForceSensor {
    name: &'static str,
    capability: Capabilities,
    saturated: Status,
    read: fn(&RigMeasurement) -> [f64; 6],
}

const SENSOR_A: ForceSensor = ForceSensor {
    name: "sensor A",
    capability: Capabilities::SENSOR_A,
    saturated: Status::SENSOR_A_SATURATED,
    read: |m| m.sensor_a,
};

const SENSOR_B: ForceSensor = ForceSensor {
    name: "sensor B",
    capability: Capabilities::SENSOR_B,
    saturated: Status::SENSOR_B_SATURATED,
    read: |m| m.sensor_b,
};

fn force_sensor(sensor: &ForceSensor, samples: &[RigMeasurement], needed: bool) -> Check {
    let last = &samples[samples.len() - 1];
    if !last.has(sensor.capability) {
        let found = if needed {
            "the rig has none, and the loop needs it"
        } else {
            "none, and with one sensor none is needed"
        };
        return Check::new(sensor.name, !needed, found);
    }
    let axes = (sensor.read)(last);
    let alive =
        samples.iter().any(|m| (sensor.read)(m).map(f64::to_bits) != axes.map(f64::to_bits));
    let (passed, found) = if last.is(sensor.saturated) {
        (false, "saturated: reset its charge amplifier".to_owned())
    } else if !alive {
        (false, "the same to the last bit in every sample: it is not alive".to_owned())
    } else {
        let [x, y, z, ..] = axes;
        (true, format!("alive, {:.1} N", (x * x + y * y + z * z).sqrt()))
    };
    Check::new(sensor.name, passed, found)
}

fn mechanisms(last: &RigMeasurement) -> Check {
    let remedy = "joined, or held by a latch, since the run before: draw back with `docktwin rig \
                  retract`";
    Check::unless("mechanisms", last.is_held(), remedy, "not joined")
}

/// The accelerometers, where there are any or should be.
fn accelerometers(
    rig: &RigModel,
    samples: &[RigMeasurement],
    x_bp: Option<Pose>,
    needed: bool,
) -> Option<Check> {
    const NAME: &str = "accelerometers";
    let last = &samples[samples.len() - 1];
    let fitted = rig.sensors.is_some_and(|s| s.accelerometer.is_some());
    let Some([force, _]) = last.accelerometer() else {
        return if fitted {
            let found = "in the rig's file, but the rig does not report their readings";
            Some(Check::new(NAME, !needed, found))
        } else {
            let found =
                "none: inertia goes by the commanded motion; with light bodies that diverges";
            needed.then(|| Check::new(NAME, true, found))
        };
    };
    let weight = |x: Pose| (x * rig.x_4p.inverse()).q.conjugate() * rig.gravity_m_s2;
    // Without a pose nobody knows where down is; that is a line of its own.
    let off = x_bp.map_or(0.0, |x| (force + weight(x)).length());
    let alive = samples.iter().any(|m| m.accelerometer() != last.accelerometer());
    let (good, found) = if !fitted {
        (false, "not in the rig's file: add [sensors.accelerometer] to it".to_owned())
    } else if last.is(Status::ACCELEROMETER_SATURATED) {
        (false, "saturated: see that nothing strikes the plate".to_owned())
    } else if !alive {
        (false, "the same to the last bit in every sample: not alive".to_owned())
    } else if off > WEIGHTLESS_M_S2 {
        (false, format!("off the weight at rest by {off:.2} m/s2: see their axes"))
    } else {
        (true, format!("alive, off the weight at rest by {off:.3} m/s2"))
    };
    let found = if good || needed { found } else { format!("not used; {found}") };
    Some(Check::new(NAME, good || !needed, found))
}

impl<R: Rig, K: Clock, C: Compensator> Loop<R, K, Armed, C> {
    /// The checklist as it was passed.
    pub fn checks(&self) -> &[Check] {
        &self.state.checks
    }

    /// Begins to move.
    pub fn start(self) -> Loop<R, K, Running, C> {
        self.into_state(|s| s.running)
    }
}
