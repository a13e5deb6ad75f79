//! The verdict of a run against a rig: how it ended, and what its scenario's bounds say of its figures.

use docktwin_physics::outcome::Judgement;
use docktwin_record::{Fidelity, FidelityOf, Outcome, Summary, Verdict};
use docktwin_scenario::{Expect, ExpectedOutcome, Measured};

use super::Ended;
use crate::observer::{expected_outcome, told};

/// NRMS of the force above which a run whose scenario does not bound it is warned of.
const MUCH_FORCE: f64 = 0.2;
/// Energy gained, over the kinetic energy at the start, above which the same holds.
const MUCH_ENERGY: f64 = 0.01;

/// Makes the verdict; how the loop itself ended goes before how the docking did.
pub(super) fn judge(
    expect: &Expect,
    summary: &mut Summary,
    judgement: &Judgement,
    ended: &Ended,
    dry_run: bool,
) {
    let stopped = ended.end.trip.is_some() || ended.broken.is_some();
    if dry_run {
        // There and back: whatever the scenario expects, nothing was to happen.
        summary.verdict = if stopped { Verdict::Fail } else { Verdict::Pass };
        summary.not_judged = expect.not_judged_by_hil();
        summary.not_judged.extend(expect.not_judged_without_rig());
    } else {
        let outcome =
            if stopped { ExpectedOutcome::Stopped } else { expected_outcome(judgement.outcome) };
        let failures = bounds_not_met(expect, summary, outcome);
        summary.verdict = if failures.is_empty() { Verdict::Pass } else { Verdict::Fail };
        summary.failure_reason = (!failures.is_empty()).then(|| told(&failures, judgement));
        summary.not_judged = expect.not_judged_by_hil();
        summary.warnings = warnings(expect, summary.fidelity.as_ref());
    }
    if stopped {
        summary.outcome = Outcome::Stopped;
        // Bounds of a docking that was not run to its end say nothing beside why.
        if dry_run || expect.outcome_of_hil() != ExpectedOutcome::Stopped {
            summary.failure_reason = ended.end.trip.map(|trip| {
                format!(
                    "the supervisor stopped the rig in tick {}: {} was {:.4}, allowed {:.4}",
                    trip.tick,
                    trip.limit.name(),
                    trip.value,
                    trip.allowed
                )
            });
        }
    }
    if let Some(broken) = &ended.broken {
        summary.failure_reason = Some(broken.clone());
    }
}

fn bounds_not_met(expect: &Expect, s: &Summary, outcome: ExpectedOutcome) -> Vec<String> {
    let run = Measured {
        outcome,
        first_contact_s: s.first_contact_s,
        capture_s: s.capture_s,
        duration_s: s.duration_s,
        peak_force_n: s.peak_force_n,
        peak_moment_nm: s.peak_moment_nm,
        peak_penetration_m: s.peak_penetration_m,
        impulse_ns: s.impulse_ns,
        exit_speed_m_s: None,
    };
    let figures = s.fidelity.map(|f| f.figures()).unwrap_or_default();
    expect.hil_failures(&run, &|key| figures.iter().find(|(k, _)| k == key).and_then(|(_, x)| *x))
}

/// What nobody asked about and a reader should know: a force that is far off, energy out of nothing.
fn warnings(expect: &Expect, fidelity: Option<&Fidelity>) -> Vec<String> {
    let Some(f) = fidelity else { return Vec::new() };
    let mut out = Vec::new();
    if !expect.bounds_nrms_force() {
        let all = [("felt", f.felt), ("hardware", f.hardware)];
        let figures = all.iter().flat_map(|(name, of)| {
            // To the first latch forces are small, and a part of little is soon much.
            let windows = of.iter().flat_map(FidelityOf::windows).skip(1);
            windows.filter_map(move |(window, x)| Some((*name, window, x.nrms_force?)))
        });
        let worst = figures.max_by(|a, b| a.2.total_cmp(&b.2)).filter(|(_, _, x)| *x > MUCH_FORCE);
        out.extend(worst.map(|(name, window, x)| {
            format!(
                "the force is {:.1} % off the simulated system's (NRMS, {name}, {window}), and no \
                 nrms_force_below of [[expect.fidelity]] says that it may be",
                100.0 * x
            )
        }));
    }
    if !expect.bounds_delta_energy() {
        out.extend(f.delta_energy.filter(|x| *x > MUCH_ENERGY).map(|x| {
            format!(
                "the loop gained {:.1} % of the kinetic energy at the start, and no delta_energy_below of \
                 [expect.hil] says that it may",
                100.0 * x
            )
        }));
    }
    out
}

#[cfg(test)]
mod tests {
    use docktwin_record::FidelityFigures;
    use docktwin_scenario::Scenario;

    use super::*;

    /// That of a shipped scenario with other bounds of a rig.
    fn expect(more: &str) -> Expect {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let path = root.join("scenarios/basic_central_impact.toml");
        let text = std::fs::read_to_string(&path).expect("shipped");
        // Tables of the rig stand last.
        let first = ["\n[expect.hil]", "\n[[expect.fidelity]]"].iter().filter_map(|t| text.find(t));
        let text = &text[..first.min().unwrap_or(text.len())];
        let text = format!("{text}\n{more}");
        let read = Scenario::from_toml(&text, root.join("scenarios"));
        read.unwrap_or_else(|e| panic!("{e}")).expect
    }

    fn off(nrms_force: f64, delta_energy: f64) -> Fidelity {
        let figures = FidelityFigures { nrms_force: Some(nrms_force), ..Default::default() };
        let of = FidelityOf { whole_run: figures, ..FidelityOf::default() };
        Fidelity { felt: Some(of), delta_energy: Some(delta_energy), ..Fidelity::default() }
    }

    #[test]
    fn invariant_what_nobody_bounds_is_warned_of() {
        let open = expect("");
        assert!(warnings(&open, Some(&off(0.19, 0.009))).is_empty());
        assert!(warnings(&open, None).is_empty());
        let both = warnings(&open, Some(&off(0.21, 0.011)));
        assert!(both.len() == 2 && both[0].contains("21.0 % off"), "{both:?}");
        assert!(both[1].contains("gained 1.1 %"), "{both:?}");
        let force =
            "[[expect.fidelity]]\nof = \"felt\"\nwindow = \"whole_run\"\nnrms_force_below = 0.5\n";
        let bounded = expect(force);
        assert_eq!(warnings(&bounded, Some(&off(0.21, 0.011))).len(), 1);
        let energy = expect("[expect.hil]\ndelta_energy_below = 0.5\n");
        assert_eq!(warnings(&energy, Some(&off(0.21, 0.011))).len(), 1);
    }
}
