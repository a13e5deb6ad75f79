//! Both twins tell the same story of every scenario.
//!
//! They share every law and no integrator: a difference is a mistake in one of the integrators, in
//! how it is fed, or a step that is too long.

use std::{fs, path::PathBuf, thread};

use docktwin_core::Pose;
use docktwin_physics::reduced::{DockingTwin, Inputs};
use docktwin_run::{TwinKind, setup::start};
use docktwin_scenario::{Scenario, load_scenario};
use docktwin_tests::{Story, run};
use docktwin_twin::FullTwin;

/// At first contact, mm and degrees.
const AT_CONTACT: (f64, f64) = (0.1, 0.01);
/// At capture, mm and degrees.
const AT_CAPTURE: (f64, f64) = (1.0, 0.1);

fn scenarios() -> Vec<Scenario> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../scenarios");
    let mut files: Vec<PathBuf> = fs::read_dir(&folder)
        .expect("scenarios/ is there")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    assert!(!files.is_empty(), "no scenario in {}", folder.display());
    files
        .iter()
        .map(|path| load_scenario(path, &[]).unwrap_or_else(|e| panic!("{}: {e}", path.display())))
        .collect()
}

fn full(scenario: &Scenario) -> Story {
    run(scenario, TwinKind::Full).expect("the sides are apart")
}

fn reduced(scenario: &Scenario) -> Story {
    run(scenario, TwinKind::Reduced).expect("the sides are apart")
}

/// Distance in millimetres and angle in degrees.
fn apart(a: &Pose, b: &Pose) -> (f64, f64) {
    let turned = a.q.conjugate() * b.q;
    // Twice the arcsine: the arccosine of the scalar part loses small angles.
    let half = (turned.x * turned.x + turned.y * turned.y + turned.z * turned.z).sqrt();
    ((a.p - b.p).length() * 1e3, 2.0 * half.min(1.0).asin().to_degrees())
}

/// Difference of the relative poses in the tick at which both have come to an event.
fn at(a: &Story, b: &Story, event: impl Fn(&Story) -> Option<usize>) -> Option<(f64, f64)> {
    let tick = event(a)?.max(event(b)?);
    Some(apart(a.relative.get(tick)?, b.relative.get(tick)?))
}

#[test]
fn invariant_both_twins_tell_the_same_story_of_every_scenario() {
    println!(
        "{:<24} {:<14} {:<14} {:>23} {:>23} {:>9} {:>9}",
        "scenario",
        "full",
        "reduced",
        "at contact mm, deg",
        "at capture mm, deg",
        "dt cap ms",
        "dF peak"
    );
    let mut wrong = Vec::new();
    for scenario in &scenarios() {
        let (f, r) = thread::scope(|scope| {
            let f = scope.spawn(|| full(scenario));
            let r = reduced(scenario);
            (f.join().expect("the full twin does not panic"), r)
        });
        let contact = at(&f, &r, |s| s.first_contact_tick);
        let capture = at(&f, &r, |s| s.capture_tick);
        let pair = |x: Option<(f64, f64)>| {
            x.map_or("–".to_owned(), |(mm, deg)| format!("{mm:.2e}, {deg:.2e}"))
        };
        let captured = |s: &Story| s.last.mechanism.captured_s();
        let later = captured(&f).zip(captured(&r)).map(|(a, b)| (a - b) * 1e3);
        println!(
            "{:<24} {:<14} {:<14} {:>23} {:>23} {:>9} {:>8.2}%",
            scenario.name,
            f.judgement.outcome.name(),
            r.judgement.outcome.name(),
            pair(contact),
            pair(capture),
            later.map_or("–".to_owned(), |ms| format!("{ms:.2}")),
            100.0 * (f.last.peak_force_n / r.last.peak_force_n.max(1e-9) - 1.0),
        );
        let mut check = |fine: bool, what: String| {
            if !fine {
                wrong.push(format!("{}: {what}", scenario.name));
            }
        };
        check(
            f.judgement.outcome == r.judgement.outcome,
            format!("{:?} against {:?}", f.judgement, r.judgement),
        );
        check(
            f.latch_order() == r.latch_order(),
            format!("latches caught {:?} against {:?}", f.latch_order(), r.latch_order()),
        );
        check(
            f.first_contact_tick.is_some() == r.first_contact_tick.is_some(),
            "one twin touches, the other does not".to_owned(),
        );
        for (found, (mm, deg), event) in
            [(contact, AT_CONTACT, "first contact"), (capture, AT_CAPTURE, "capture")]
        {
            if let Some((a, b)) = found {
                check(a <= mm && b <= deg, format!("{a:.3e} mm, {b:.3e} deg apart at {event}"));
            }
        }
    }
    assert!(wrong.is_empty(), "the twins differ\n  {}", wrong.join("\n  "));
}

/// What the full twin is restored from is all that its future depends on.
#[test]
fn invariant_a_restored_full_twin_goes_the_same_way() {
    let scenario = scenarios()
        .into_iter()
        .find(|s| s.name == "apas_nominal")
        .expect("the nominal scenario is there");
    let n = TwinKind::Full.steps_per_tick(&scenario);
    let (system, bodies) = start(&scenario).expect("the sides are apart");
    let mut twin = FullTwin::new(system, bodies, 1e-3 / f64::from(n));
    let go = |twin: &mut FullTwin, ticks: u32| {
        for _ in 0..ticks * n {
            twin.step(&Inputs::default());
        }
        twin.digest()
    };
    // Into the contact, where bristles, brakes and sides are remembered.
    go(&mut twin, 4000);
    assert!(twin.state().first_contact_s.is_some(), "the sides touch within 4 s");
    let kept = twin.snapshot();
    let first = go(&mut twin, 500);
    twin.restore(&kept);
    assert_ne!(first, twin.digest(), "restoring goes back");
    assert_eq!(first, go(&mut twin, 500), "the second way is the first");
}
