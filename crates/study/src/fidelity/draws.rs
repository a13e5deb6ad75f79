//! Many mechanisms drawn within the spread of their files, each on the rig and in the simulated system.
//!
//! A draw is compared with the simulated system that has the drawn mechanism. Some draws stand at a parting of
//! the ways: a shift of a few hundredths of a millimetre turns the outcome of the simulated system itself. They
//! are named and left out of rates and distributions: no rig could be held to them.

use docktwin_core::DVec3;
use docktwin_physics::as_built::{Drawn, Grade, MechanismDraw};
use docktwin_record::Outcome;
use docktwin_run::{HilOptions, HilRun, RunError};
use docktwin_scenario::Scenario;
use serde::{Deserialize, Serialize};

use super::{Figure, OnRig, ended};
use crate::{Progress, parallel::in_parallel};

/// By how much the initial position is shifted to either side along Y and Z, m.
pub const SHIFT_M: f64 = 50e-6;

/// What is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrawOptions {
    /// Draws 1 to so many.
    pub draws: u32,
    /// How well parts are aligned.
    pub grade: Grade,
}

/// One drawn mechanism.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Draw {
    /// Number of the draw, by which it can be run alone.
    pub number: u64,
    /// What was drawn.
    pub drawn: Vec<Drawn>,
    /// On the rig, against the simulated system with the drawn mechanism.
    pub on_rig: OnRig,
    /// How that simulated system ended.
    pub simulated: Outcome,
    /// How else it ends with its initial position shifted; empty where every shift leaves the outcome.
    pub turns: Vec<Turn>,
}

impl Draw {
    /// Whether it ended on the rig as in the simulated system.
    #[must_use]
    pub fn same(&self) -> bool {
        self.on_rig.outcome == self.simulated
    }
}

/// A shift that turns an outcome.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Turn {
    /// Of the target in `e3`, Y and Z, m.
    pub shift_m: [f64; 2],
    /// What becomes of the simulated system then.
    pub outcome: Outcome,
}

/// Draws of a scenario.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Draws {
    /// Name of the scenario.
    pub scenario: String,
    /// How well parts were aligned.
    pub grade: Grade,
    /// By number.
    pub draws: Vec<Draw>,
}

/// Distribution of a figure over draws.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Distribution {
    /// Draws that have the figure.
    pub n: usize,
    /// Half of the draws lie below.
    pub median: f64,
    /// One in twenty lies below.
    pub p5: f64,
    /// One in twenty lies above.
    pub p95: f64,
    /// Farthest from what it would be without any deviation.
    pub worst: f64,
    /// Number of the draw that has it.
    pub worst_draw: u64,
}

/// A figure over draws: where it stands, and what it is without any deviation (1 of a ratio).
#[derive(Clone, Copy)]
pub struct DrawFigure {
    /// Its name.
    pub name: &'static str,
    /// Where it stands.
    pub figure: Figure,
    /// Without deviation.
    pub ideal: f64,
}

const fn ratio(name: &'static str, figure: Figure) -> DrawFigure {
    DrawFigure { name, figure, ideal: 1.0 }
}

const fn difference(name: &'static str, figure: Figure) -> DrawFigure {
    DrawFigure { name, figure, ideal: 0.0 }
}

fn latch_s(r: &OnRig, of: fn(&OnRig) -> Option<docktwin_record::FidelityOf>) -> Option<f64> {
    let all = of(r)?.latch_difference_s;
    all.into_iter().flatten().reduce(|a, b| if b.abs() > a.abs() { b } else { a })
}

/// Every figure of which the distribution is taken.
pub const FIGURES: [DrawFigure; 20] = [
    // Both comparisons are laid over each other at first contact: where mounts move it, waveforms are shifted.
    difference("first_contact_difference_s", |r, _| r.fidelity.first_contact_difference_s),
    ratio("felt_peak_force_ratio", |r, w| r.felt(w).peak_force_ratio),
    ratio("felt_peak_moment_ratio", |r, w| r.felt(w).peak_moment_ratio),
    difference("felt_nrms_force", |r, w| r.felt(w).nrms_force),
    difference("felt_nrms_moment", |r, w| r.felt(w).nrms_moment),
    difference("felt_nrms_pose", |r, w| r.felt(w).nrms_pose),
    difference("felt_nrms_attitude", |r, w| r.felt(w).nrms_attitude),
    ratio("felt_impulse_ratio", |r, w| r.felt(w).impulse_ratio),
    difference("felt_delta_energy", |r, w| r.felt(w).delta_energy),
    difference("felt_capture_difference_s", |r, _| r.fidelity.felt?.capture_difference_s),
    ratio("hardware_peak_force_ratio", |r, w| r.hardware(w).peak_force_ratio),
    ratio("hardware_peak_moment_ratio", |r, w| r.hardware(w).peak_moment_ratio),
    difference("hardware_nrms_force", |r, w| r.hardware(w).nrms_force),
    difference("hardware_nrms_moment", |r, w| r.hardware(w).nrms_moment),
    difference("hardware_nrms_pose", |r, w| r.hardware(w).nrms_pose),
    difference("hardware_nrms_attitude", |r, w| r.hardware(w).nrms_attitude),
    ratio("hardware_impulse_ratio", |r, w| r.hardware(w).impulse_ratio),
    difference("hardware_delta_energy", |r, w| r.hardware(w).delta_energy),
    // Of the three latches the one that is farthest off.
    difference("hardware_latch_difference_s", |r, _| latch_s(r, |r| r.fidelity.hardware)),
    difference("hardware_capture_difference_s", |r, _| r.fidelity.hardware?.capture_difference_s),
];

impl Draws {
    /// Draws whose outcome no shift turns, and that were not stopped.
    pub fn counted(&self) -> impl Iterator<Item = &Draw> {
        self.draws.iter().filter(|d| d.turns.is_empty() && d.on_rig.stopped.is_none())
    }

    /// Draws that a shift turns.
    pub fn turning(&self) -> impl Iterator<Item = &Draw> {
        self.draws.iter().filter(|d| !d.turns.is_empty())
    }

    /// Draws that the supervisor stopped.
    pub fn stopped(&self) -> impl Iterator<Item = &Draw> {
        self.draws.iter().filter(|d| d.on_rig.stopped.is_some())
    }

    /// Of the counted draws, those that ended on the rig as in the simulated system.
    #[must_use]
    pub fn same(&self) -> usize {
        self.counted().filter(|d| d.same()).count()
    }

    /// Distribution of a figure over the counted draws, each over its own window; `None` where none has it.
    #[must_use]
    pub fn distribution(&self, of: &DrawFigure) -> Option<Distribution> {
        let value = |d: &Draw| (of.figure)(&d.on_rig, d.on_rig.window()).map(|x| (x, d.number));
        let values: Vec<(f64, u64)> = self.counted().filter_map(value).collect();
        distribution(&values, of.ideal)
    }
}

/// Quantiles between the sorted values, linearly (Hyndman and Fan 1996, type 7).
fn distribution(values: &[(f64, u64)], ideal: f64) -> Option<Distribution> {
    let off = |x: f64| (x - ideal).abs();
    let worst = *values.iter().max_by(|a, b| off(a.0).total_cmp(&off(b.0)))?;
    let mut sorted: Vec<f64> = values.iter().map(|v| v.0).collect();
    sorted.sort_by(f64::total_cmp);
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "far below 2^53, not negative"
    )]
    let at = |p: f64| {
        let place = p * (sorted.len() - 1) as f64;
        let (i, part) = (place as usize, place.fract());
        let next = sorted[(i + 1).min(sorted.len() - 1)];
        sorted[i] + part * (next - sorted[i])
    };
    Some(Distribution {
        n: sorted.len(),
        median: at(0.5),
        p5: at(0.05),
        p95: at(0.95),
        worst: worst.0,
        worst_draw: worst.1,
    })
}

/// Runs one draw.
///
/// # Errors
/// Problems of the rig's or the mechanism's files, or a rig that cannot be armed.
pub fn one(
    scenario: &Scenario,
    options: &HilOptions,
    draw: MechanismDraw,
) -> Result<Draw, RunError> {
    let mut options = options.clone();
    options.mechanism.draw = Some(draw);
    let run = HilRun::new(scenario, options)?;
    let outcome = |y: f64, z: f64| Ok::<_, RunError>(run.simulate(DVec3::new(0.0, y, z))?.outcome);
    let simulated = outcome(0.0, 0.0)?;
    let mut turns = Vec::new();
    for [y, z] in [[SHIFT_M, 0.0], [-SHIFT_M, 0.0], [0.0, SHIFT_M], [0.0, -SHIFT_M]] {
        let shifted = outcome(y, z)?;
        if shifted != simulated {
            turns.push(Turn { shift_m: [y, z], outcome: shifted });
        }
    }
    let drawn = run.drawn().to_vec();
    Ok(Draw { number: draw.number, drawn, on_rig: ended(run, &[], scenario)?, simulated, turns })
}

/// Runs draws 1 to so many of a scenario, on all cores; what comes out does not depend on how many.
///
/// # Errors
/// As [`one`].
pub fn draws(
    scenario: &Scenario,
    options: &HilOptions,
    asked: DrawOptions,
    progress: &mut (impl Progress + Send),
) -> Result<Draws, RunError> {
    let found = in_parallel(asked.draws as usize, progress, |i| {
        one(scenario, options, MechanismDraw { number: i as u64 + 1, grade: asked.grade })
    })?;
    Ok(Draws { scenario: scenario.name.clone(), grade: asked.grade, draws: found })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_quantiles_lie_between_the_sorted_values() {
        // Type 7 of 0, 1, …, 20: the p-quantile is 20 p.
        let values: Vec<(f64, u64)> = (0..=20).rev().map(|i| (f64::from(i), i as u64)).collect();
        let d = distribution(&values, 1.0).expect("values");
        assert_eq!((d.n, d.median, d.p5, d.p95), (21, 10.0, 1.0, 19.0));
        assert_eq!((d.worst, d.worst_draw), (20.0, 20));
        // Between values, and the farthest below.
        let d = distribution(&[(0.1, 7), (1.2, 8)], 1.0).expect("values");
        assert!((d.median - 0.65).abs() < 1e-12 && (d.p5 - 0.155).abs() < 1e-12);
        assert_eq!((d.worst, d.worst_draw), (0.1, 7));
        assert_eq!(distribution(&[], 1.0), None);
    }
}
