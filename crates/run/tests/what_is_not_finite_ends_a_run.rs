//! Case C5 and its kind: what is not finite ends the run, which says which body and when, with one outcome
//! whatever twin runs and whatever is recorded.

use std::path::Path;

use docktwin_core::DVec3;
use docktwin_physics::reduced::Inputs;
use docktwin_record::{Outcome, RunReader, Summary, Verdict};
use docktwin_run::{
    Rehearsal, RehearsalOptions, RunDirectory, Sink, Situation, SummaryOnly, TwinKind,
};
use docktwin_scenario::Scenario;

fn run(twin: TwinKind, sink: &mut impl Sink) -> Summary {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let scenario =
        Scenario::from_path(root.join("scenarios/apas_nominal.toml")).expect("a scenario");
    let options = RehearsalOptions { twin, ..RehearsalOptions::default() };
    // A control law that divides by zero after 50 ms.
    let broken = |now: &Situation| {
        let mut out = Inputs::default();
        if now.time_s > 0.0495 {
            out.target.f = DVec3::Y / (now.x_34.p.x * 0.0);
        }
        out
    };
    let rehearsal = Rehearsal::with(&scenario, options).expect("the sides are apart");
    rehearsal.run_with(sink, broken, &mut ()).expect("a summary")
}

#[test]
fn regress_a_control_wrench_that_is_not_finite_ends_the_run() {
    let at = tempfile::tempdir().expect("a folder");
    for twin in [TwinKind::Reduced, TwinKind::Full] {
        let dir = at.path().join(twin.name());
        let summaries = [run(twin, &mut SummaryOnly), run(twin, &mut RunDirectory::new(&dir))];
        for s in &summaries {
            assert_eq!((s.outcome, s.verdict), (Outcome::Stopped, Verdict::Fail), "{twin:?} {s:?}");
            let why = s.failure_reason.as_deref().expect("a reason");
            assert!(
                why.contains("the control wrench of the target is not finite in tick 50"),
                "{why}"
            );
        }
        let mut log = RunReader::open(&dir).expect("a log");
        let column = log.column_index("target_position_y_m").expect("a column");
        let rows: Vec<f64> = log.ticks().map(|t| t.expect("a tick").row[column].as_f64()).collect();
        assert_eq!(rows.len(), 51, "the tick that broke is the last that is recorded");
        assert!(rows.iter().all(|x| x.is_finite()));
    }
}
