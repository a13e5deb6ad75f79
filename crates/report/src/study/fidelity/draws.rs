//! Drawn mechanisms on the rig: tables and words.

use core::fmt::Write as _;

use docktwin_study::fidelity::draws::{Distribution, Draw, Draws, FIGURES};
use serde_json::json;

use crate::study::NamedText;

/// What is told of a scenario: figures of the acceptance, the rest stands in the tables.
const TOLD: [&str; 9] = [
    "first_contact_difference_s",
    "felt_peak_force_ratio",
    "felt_nrms_force",
    "felt_nrms_pose",
    "hardware_peak_force_ratio",
    "hardware_nrms_force",
    "hardware_nrms_pose",
    "hardware_latch_difference_s",
    "hardware_capture_difference_s",
];

/// Outcomes, draws that are left out and why, and the distribution of the main figures.
#[must_use]
pub fn draw_words(d: &Draws) -> String {
    let mut out = String::new();
    let counted = d.counted().count();
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "{}: {} draws, {} alignment; outcome of the simulated system in {} of {} counted",
        d.scenario,
        d.draws.len(),
        d.grade.name(),
        d.same(),
        counted
    );
    for other in d.counted().filter(|x| !x.same()) {
        let (got, want) = (&other.on_rig.outcome, &other.simulated);
        let _ = writeln!(out, "  draw {:<6} {got} on the rig, {want} simulated", other.number);
    }
    for turning in d.turning() {
        let _ = writeln!(out, "  draw {:<6} left out, {}", turning.number, turns(turning));
    }
    for stopped in d.stopped() {
        let why = stopped.on_rig.stopped.as_deref().unwrap_or_default();
        let _ = writeln!(out, "  draw {:<6} left out, stopped: {why}", stopped.number);
    }
    let _ = writeln!(
        out,
        "  {:<32}{:>6}{:>11}{:>11}{:>11}{:>11}",
        "", "n", "5 %", "median", "95 %", "worst"
    );
    for figure in FIGURES.iter().filter(|f| TOLD.contains(&f.name)) {
        let Some(x) = d.distribution(figure) else {
            let _ = writeln!(out, "  {:<32}{:>6}", figure.name, 0);
            continue;
        };
        let Distribution { n, median, p5, p95, worst, worst_draw } = x;
        let _ = writeln!(
            out,
            "  {:<32}{n:>6}{p5:>11.4}{median:>11.4}{p95:>11.4}{worst:>11.4}  draw {worst_draw}",
            figure.name
        );
    }
    out
}

/// The shifts that turn a draw, in words.
fn turns(d: &Draw) -> String {
    let shifts: Vec<String> = d
        .turns
        .iter()
        .map(|t| {
            let [y, z] = t.shift_m.map(|m| m * 1e6);
            format!("({y:+.0}, {z:+.0}) um {}", t.outcome)
        })
        .collect();
    format!("{} simulated, shifted by {}", d.simulated, shifts.join(", "))
}

/// What `--json` prints.
#[must_use]
pub fn draws_json(all: &[Draws]) -> serde_json::Value {
    let of = |d: &Draws| {
        let distributions: serde_json::Map<String, serde_json::Value> =
            FIGURES.iter().map(|f| (f.name.to_owned(), json!(d.distribution(f)))).collect();
        let numbers =
            |all: &mut dyn Iterator<Item = &Draw>| all.map(|x| x.number).collect::<Vec<_>>();
        json!({
            "scenario": d.scenario,
            "grade": d.grade,
            "drawn": d.draws.len(),
            "counted": d.counted().count(),
            "same_outcome": d.same(),
            "other_outcome": numbers(&mut d.counted().filter(|x| !x.same())),
            "turning": numbers(&mut d.turning()),
            "stopped": numbers(&mut d.stopped()),
            "distributions": distributions,
            "draws": d.draws,
        })
    };
    json!({ "scenarios": all.iter().map(of).collect::<Vec<_>>() })
}

/// `fidelity-draws.csv`: one row a draw; `fidelity-distribution.csv`: one row a scenario and figure.
#[must_use]
pub fn draw_tables(all: &[Draws]) -> Vec<NamedText> {
    let cell = |x: Option<f64>| x.map_or(String::new(), |x| x.to_string());
    let mut rows =
        "scenario,grade,draw,counted,outcome,simulated_outcome,turned_by_shift,stopped".to_owned();
    for f in &FIGURES {
        let _ = write!(rows, ",{}", f.name);
    }
    rows.push('\n');
    let mut figures = "scenario,grade,figure,n,p5,median,p95,worst,worst_draw\n".to_owned();
    for d in all {
        for x in &d.draws {
            let (turned, stopped) = (!x.turns.is_empty(), x.on_rig.stopped.is_some());
            let _ = write!(
                rows,
                "{},{},{},{},{},{},{turned},{stopped}",
                d.scenario,
                d.grade.name(),
                x.number,
                !turned && !stopped,
                x.on_rig.outcome,
                x.simulated
            );
            for f in &FIGURES {
                let _ = write!(rows, ",{}", cell((f.figure)(&x.on_rig, x.on_rig.window())));
            }
            rows.push('\n');
        }
        for f in &FIGURES {
            let Some(x) = d.distribution(f) else { continue };
            let _ = writeln!(
                figures,
                "{},{},{},{},{},{},{},{},{}",
                d.scenario,
                d.grade.name(),
                f.name,
                x.n,
                x.p5,
                x.median,
                x.p95,
                x.worst,
                x.worst_draw
            );
        }
    }
    vec![("fidelity-draws.csv".to_owned(), rows), ("fidelity-distribution.csv".to_owned(), figures)]
}
