//! Whole-system tests live in `tests/`; here is what they share.
//!
//! A scenario runs as everywhere, without a recording: what is tested here are the twins.

use docktwin_core::Pose;
use docktwin_physics::{
    outcome::Judgement,
    reduced::{DockingState, Inputs},
};
use docktwin_run::{Rehearsal, RehearsalOptions, RunError, SummaryOnly, TwinKind};
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

/// Runs a scenario until it is decided or over.
///
/// # Errors
/// The sides overlap at the start.
pub fn run(scenario: &Scenario, twin: TwinKind) -> Result<Story, RunError> {
    let options = RehearsalOptions { twin, ..RehearsalOptions::default() };
    let mut run = Rehearsal::with(scenario, options)?.begin(SummaryOnly)?;
    let mut relative = Vec::new();
    let (mut first_contact_tick, mut capture_tick) = (None, None);
    while !run.ended() {
        let now = run.situation();
        if now.first_contact_s.is_some() {
            first_contact_tick.get_or_insert(relative.len());
        }
        if now.captured_s.is_some() {
            capture_tick.get_or_insert(relative.len());
        }
        relative.push(now.x_34);
        run.tick(&Inputs::default());
    }
    let last = run.now().state.clone();
    Ok(Story { relative, first_contact_tick, capture_tick, last, judgement: run.judgement() })
}
