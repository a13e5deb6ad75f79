//! Whole-system tests live in `tests/`; here is what they share.
//!
//! A scenario becomes bodies and control wrenches as in the command line, but without a recording:
//! what is tested here are the twins.

use docktwin_core::{DVec3, Pose, Twist, Wrench};
use docktwin_physics::{
    body::BodyState,
    initial::{ContactConditions, initial_state},
    mechanism::{CHASER, System, TARGET},
    outcome::{Judgement, Monitor, Observation},
    reduced::{DockingState, DockingTwin, Inputs},
};
use docktwin_scenario::{Body, Scenario, Trigger};

/// Bodies at the start of a scenario.
#[must_use]
pub fn start(scenario: &Scenario) -> (System, [BodyState; 3]) {
    let system = System::new(&scenario.chaser, &scenario.target, scenario.mechanism.clone());
    let i = &scenario.initial;
    let [y, z] = i.lateral_m;
    let [vy, vz] = i.lateral_speed_m_s;
    let conditions = ContactConditions {
        attitude: i.attitude,
        lateral_m: DVec3::new(0.0, y, z),
        velocity_m_s: DVec3::new(-i.axial_speed_m_s, vy, vz),
        rate_rad_s: i.rates_rad_s,
    };
    let bodies = initial_state(&system, &conditions, i.gap_m).bodies;
    (system, bodies)
}

/// Control wrenches of the tick that starts at `time_s`.
#[must_use]
pub fn inputs(scenario: &Scenario, state: &DockingState, time_s: f64) -> Inputs {
    let captured_s = state.mechanism.captured_s();
    let mut out = Inputs::default();
    for t in &scenario.thrusts {
        let from = match t.after {
            Trigger::Start => Some(0.0),
            Trigger::FirstContact => state.first_contact_s,
            Trigger::Capture => captured_s,
        };
        let on = from.is_some_and(|from| {
            let since = time_s - from - t.delay_s;
            (0.0..t.duration_s).contains(&since) && !(t.until_capture && captured_s.is_some())
        });
        if on {
            let w = Wrench { f: t.force_n, m: t.moment_nm };
            match t.on {
                Body::Chaser => out.chaser += w,
                Body::Target => out.target += w,
            }
        }
    }
    out
}

/// What a twin made of a scenario.
#[derive(Clone, Debug)]
pub struct Story {
    /// Pose of `e4` in `e3` at the start of every tick.
    pub relative: Vec<Pose>,
    /// Tick at whose start surfaces had touched.
    pub first_contact_tick: Option<usize>,
    /// Tick at whose start all latches had caught.
    pub capture_tick: Option<usize>,
    /// State at the end.
    pub last: DockingState,
    /// What became of it.
    pub judgement: Judgement,
}

impl Story {
    /// Latches in the order in which they caught.
    #[must_use]
    pub fn latch_order(&self) -> Vec<usize> {
        let mut caught: Vec<(f64, usize)> = (0..3)
            .filter_map(|i| self.last.mechanism.latches[i].times_s[2].map(|t| (t, i + 1)))
            .collect();
        caught.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        caught.into_iter().map(|(_, i)| i).collect()
    }
}

/// Runs a scenario with `steps` physics steps of `h` seconds in a tick, until it is decided or over.
#[must_use]
pub fn tell<T: DockingTwin>(scenario: &Scenario, mut twin: T, steps: u32, h: f64) -> Story {
    let ticks = scenario.run.ticks();
    let mut monitor = Monitor::default();
    let mut relative = Vec::new();
    let (mut first_contact_tick, mut capture_tick) = (None, None);
    let mut tick = 0;
    loop {
        #[expect(clippy::cast_precision_loss, reason = "far below 2^53")]
        let time_s = (tick * scenario.run.tick_nanos) as f64 * 1e-9;
        let state = twin.state();
        let (observation, x_34) = observe(twin.system(), &state, time_s, h);
        monitor.observe(twin.system().mechanism(), &state.mechanism, &observation);
        if state.first_contact_s.is_some() {
            first_contact_tick.get_or_insert(relative.len());
        }
        if state.mechanism.captured_s().is_some() {
            capture_tick.get_or_insert(relative.len());
        }
        relative.push(x_34);
        let decided = scenario.run.stop_when_decided && monitor.decided(time_s);
        if tick == ticks || monitor.limit().is_some() || decided {
            let judgement = monitor.judge(time_s);
            return Story { relative, first_contact_tick, capture_tick, last: state, judgement };
        }
        let control = inputs(scenario, &state, time_s);
        for _ in 0..steps {
            twin.step(&control);
        }
        tick += 1;
    }
}

/// What the monitor looks at, and the pose of `e4` in `e3`.
fn observe(system: &System, state: &DockingState, time_s: f64, h: f64) -> (Observation, Pose) {
    let poses = state.poses();
    let com = poses.map(|x| x.p);
    let measured = system.measure(&state.mechanism, &poses);
    let twist: [Twist; 3] = core::array::from_fn(|i| state.bodies[i].twist(&system.mass()[i]));
    let forces = system.forces(&measured, &state.mechanism, &com, &twist, time_s, h);
    let frames = *measured.poses();
    let p = frames.x_wp.p;
    let velocity = |i: usize| twist[i].v + twist[i].w.cross(p - com[i]);
    let back = frames.x_w3.q.conjugate();
    let observation = Observation {
        time_s,
        x_ring: frames.x_wr.inverse() * Pose::new(p, frames.x_w4.q),
        relative: Twist {
            v: back * (velocity(TARGET) - velocity(CHASER)),
            w: back * (twist[TARGET].w - twist[CHASER].w),
        },
        touching: measured.contacts().touching(),
        interface: forces.on_target.shifted(p - frames.x_wr.p).rotated(frames.x_w4.q.conjugate()),
        depth_m: state.peak_depth_m,
        overtravel_m: system.overtravel_m(&measured),
    };
    (observation, frames.x_w3.inverse() * frames.x_w4)
}
