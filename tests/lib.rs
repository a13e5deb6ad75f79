//! Whole-system tests live in `tests/`; here is what they share.
//!
//! A scenario becomes bodies and control wrenches as in the command line, but without a recording:
//! what is tested here are the twins.

use docktwin::{
    setup::{inputs, thrust_ahead},
    signals::Instant,
};
use docktwin_core::Pose;
use docktwin_physics::{
    outcome::{Judgement, Monitor},
    reduced::{DockingState, DockingTwin},
};
use docktwin_scenario::Scenario;

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
        let time_s = (tick * scenario.run.tick_nanos) as f64 / 1e9;
        let state = twin.state();
        let now = Instant::new(twin.system(), &state, time_s, h);
        monitor.observe(twin.system().mechanism(), &state.mechanism, &now.observation(time_s));
        let frames = *now.measured.poses();
        if state.first_contact_s.is_some() {
            first_contact_tick.get_or_insert(relative.len());
        }
        if state.mechanism.captured_s().is_some() {
            capture_tick.get_or_insert(relative.len());
        }
        relative.push(frames.x_w3.inverse() * frames.x_w4);
        let decided = scenario.run.stop_when_decided
            && monitor.decided(time_s, thrust_ahead(&scenario.thrusts, &state, time_s));
        if tick == ticks || monitor.limit().is_some() || decided {
            let judgement = monitor.judge(time_s);
            return Story { relative, first_contact_tick, capture_tick, last: state, judgement };
        }
        let control = inputs(&scenario.thrusts, &state, time_s);
        for _ in 0..steps {
            twin.step(&control);
        }
        tick += 1;
    }
}
