//! Who turns before contact and in whose axes latches measure are keys: a docking with either choice keeps its
//! account, and the choice reaches the run.

use std::path::Path;

use docktwin_model::LatchAxes;
use docktwin_record::{Outcome, Summary};
use docktwin_run::{Rehearsal, RehearsalOptions, SummaryOnly, TwinKind};
use docktwin_scenario::{Loader, Scenario};

fn scenario(loader: Loader) -> Scenario {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let loader = loader.set("run.duration_s", 2.0).set("initial.pitch_rate_deg_s", 1.0);
    loader.load(&root.join("scenarios/apas_fast.toml")).expect("shipped")
}

fn run(scenario: &Scenario, twin: TwinKind) -> Summary {
    let options = RehearsalOptions { twin, seed: 0 };
    let summary = Rehearsal::with(scenario, options).expect("apart").run(&mut SummaryOnly);
    let s = summary.expect("nothing is written");
    assert_eq!(s.outcome, Outcome::Captured, "{s:?}");
    assert!(s.energy_balance_error < 1e-3 && s.momentum_error < 1e-6, "{s:?}");
    s
}

#[test]
fn invariant_either_body_may_turn() {
    let of = |who: &str| scenario(Loader::new().set("initial.turning", who));
    let default = run(&scenario(Loader::new()), TwinKind::Reduced);
    let target = run(&of("target"), TwinKind::Reduced);
    assert_eq!(default.state_digest, target.state_digest);
    for who in ["chaser", "both"] {
        let s = of(who);
        let [reduced, full] = [TwinKind::Reduced, TwinKind::Full].map(|twin| run(&s, twin));
        let near = |a: f64, b: f64, share: f64| (a - b).abs() < share * a;
        assert_ne!(reduced.state_digest, target.state_digest);
        assert!(near(reduced.peak_force_n, full.peak_force_n, 0.02), "{reduced:?} {full:?}");
        // The same relative motion at first contact, 0.05 m earlier.
        let first = [&reduced, &target].map(|s| s.first_contact_s.expect("they meet"));
        assert!((first[0] - first[1]).abs() < 0.01, "{first:?}");
    }
}

#[test]
fn invariant_latches_measure_in_either_ring() {
    let active = scenario(Loader::new());
    let mut passive = active.clone();
    passive.mechanism.latches.as_mut().expect("it has").axes = LatchAxes::Passive;
    let [a, p] = [&active, &passive].map(|s| run(s, TwinKind::Reduced));
    assert_ne!(a.state_digest, p.state_digest);
    let [a, p] = [a, p].map(|s| s.capture_s.expect("captured"));
    assert!((a - p).abs() < 0.05, "{a} {p}");
}
