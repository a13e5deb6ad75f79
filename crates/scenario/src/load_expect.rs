//! Reading `[expect]`: bounds that leave nothing, or that no run could meet, are refused.

use docktwin_model::toml_check::Table;

use crate::expect::{
    Bound, Compared, Expect, ExpectedOutcome, FidelityBounds, HilBounds, RunBounds, Target, Window,
};
use crate::read::maybe;

/// The bound of a lower and an upper end; an end without a key is left open.
fn between(t: &Table<'_, '_>, above: Option<&'static str>, below: Option<&'static str>) -> Bound {
    let bound = Bound {
        above: above.and_then(|k| maybe(t, k)),
        below: below.and_then(|k| maybe(t, k)),
        near: None,
    };
    if let (Some(a), Some(b), Some(key)) = (bound.above, bound.below, below)
        && a >= b
    {
        t.refuse(key, format!("leaves nothing: the lower bound is {a}"), "make it larger");
    }
    bound
}

/// At most.
fn most(t: &Table<'_, '_>, below: &'static str) -> Bound {
    between(t, None, Some(below))
}

/// A value to be met, and its tolerance.
fn near(t: &Table<'_, '_>, value: &'static str, tolerance: &'static str) -> Option<Target> {
    match (maybe(t, value), maybe(t, tolerance)) {
        (Some(value), Some(tolerance)) => Some(Target { value, tolerance }),
        (Some(_), None) => {
            t.refuse(value, format!("has no `{tolerance}`"), format!("add {tolerance} = 0.01"));
            None
        }
        (None, Some(_)) => {
            t.refuse(tolerance, format!("has no `{value}`"), format!("add `{value}`"));
            None
        }
        (None, None) => None,
    }
}

/// Times and peaks between two ends, which both kinds of run have.
fn read_run_bounds(t: &Table<'_, '_>) -> RunBounds {
    RunBounds {
        first_contact_s: between(t, Some("first_contact_after_s"), Some("first_contact_before_s")),
        capture_s: between(t, Some("capture_after_s"), Some("capture_before_s")),
        duration_s: between(t, Some("duration_after_s"), Some("duration_before_s")),
        peak_force_n: between(t, Some("peak_force_above_n"), Some("peak_force_below_n")),
        peak_moment_nm: between(t, Some("peak_moment_above_nm"), Some("peak_moment_below_nm")),
        peak_penetration_m: most(t, "peak_penetration_below_m"),
        impulse_ns: between(t, Some("impulse_above_ns"), Some("impulse_below_ns")),
    }
}

/// Refuses bounds of a capture that an outcome excludes.
fn refuse_capture(t: &Table<'_, '_>, outcome: Option<ExpectedOutcome>) {
    if may_capture(outcome) {
        return;
    }
    for key in ["capture_after_s", "capture_before_s"] {
        if t.has(key) {
            t.refuse(key, "bounds a capture that the outcome excludes", "remove it");
        }
    }
}

const fn may_capture(outcome: Option<ExpectedOutcome>) -> bool {
    use ExpectedOutcome::{Captured, LimitExceeded, Stopped};
    matches!(outcome, None | Some(Captured | LimitExceeded | Stopped))
}

pub(crate) fn read_expect(t: &Table<'_, '_>) -> Expect {
    let outcome = t.choice("outcome", &ExpectedOutcome::WORDS);
    let hil_outcome = t.optional_choice("hil_outcome", &ExpectedOutcome::WORDS);
    let mut run = read_run_bounds(t);
    run.peak_force_n.near = near(t, "peak_force_n", "peak_force_tolerance");
    run.impulse_ns.near = near(t, "impulse_ns", "impulse_tolerance");
    refuse_capture(t, outcome);
    let hil = t.optional_section("hil", |t| {
        refuse_capture(t, hil_outcome.or(outcome));
        read_hil_bounds(t)
    });
    let mut seen = Vec::new();
    let fidelity = t.sections("fidelity", |t| read_fidelity(t, outcome, &mut seen));
    Expect {
        outcome: outcome.unwrap_or(ExpectedOutcome::Captured),
        hil_outcome,
        because: t.text("because", "text: why physics gives this outcome"),
        run,
        exit_speed_m_s: Bound {
            near: near(t, "exit_speed_m_s", "exit_speed_tolerance"),
            ..Bound::default()
        },
        hil: hil.unwrap_or_default(),
        fidelity: fidelity.into_iter().flatten().collect(),
    }
}

fn read_hil_bounds(t: &Table<'_, '_>) -> HilBounds {
    HilBounds {
        run: read_run_bounds(t),
        r_e: between(t, Some("R_e_above"), Some("R_e_below")),
        r_t: between(t, Some("R_T_above"), Some("R_T_below")),
        delta_energy: between(t, Some("delta_energy_above"), Some("delta_energy_below")),
        first_contact_difference_s: most(t, "first_contact_difference_below_s"),
    }
}

/// One `[[expect.fidelity]]`; `simulated` is how the docking without a rig ends, whose latches and capture
/// the windows end with.
fn read_fidelity(
    t: &Table<'_, '_>,
    simulated: Option<ExpectedOutcome>,
    seen: &mut Vec<(Compared, Window)>,
) -> Option<FidelityBounds> {
    let of = t.choice("of", &Compared::WORDS);
    let window = t.choice("window", &Window::WORDS);
    let bounds = FidelityBounds {
        // Placeholders behind a problem that was reported.
        of: of.unwrap_or(Compared::Felt),
        window: window.unwrap_or(Window::WholeRun),
        peak_force_ratio: between(
            t,
            Some("peak_force_ratio_above"),
            Some("peak_force_ratio_below"),
        ),
        peak_moment_ratio: between(
            t,
            Some("peak_moment_ratio_above"),
            Some("peak_moment_ratio_below"),
        ),
        nrms_force: most(t, "nrms_force_below"),
        nrms_moment: most(t, "nrms_moment_below"),
        nrms_pose: most(t, "nrms_pose_below"),
        nrms_attitude: most(t, "nrms_attitude_below"),
        impulse_ratio: between(t, Some("impulse_ratio_above"), Some("impulse_ratio_below")),
        delta_energy: between(t, Some("delta_energy_above"), Some("delta_energy_below")),
        latch_difference_s: most(t, "latch_difference_below_s"),
        capture_difference_s: most(t, "capture_difference_below_s"),
    };
    if bounds.is_empty() {
        t.refuse(
            "of",
            "bounds nothing",
            "add a bound, such as nrms_force_below = 0.06, or remove the table",
        );
    }
    if !may_capture(simulated) {
        let excluded = "a capture that the outcome excludes, so it is never computed";
        if window == Some(Window::ToCapture) {
            t.refuse("window", format!("ends after {excluded}"), "take `whole_run`");
        }
        let key = "capture_difference_below_s";
        if t.has(key) {
            t.refuse(key, format!("bounds {excluded}"), "remove it");
        }
    }
    if let Some(pair) = of.zip(window) {
        if seen.contains(&pair) {
            let what = format!("bounds `{}` over `{}` a second time", pair.0.word(), pair.1.word());
            t.refuse("of", what, "put all bounds of one comparison and window into one table");
        }
        seen.push(pair);
    }
    of.zip(window).map(|_| bounds)
}
