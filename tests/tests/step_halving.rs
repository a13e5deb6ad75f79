//! Halving the step changes capture time, peak force and impulse by no more than 1 %.

use std::path::Path;

use docktwin_physics::reduced::DockingState;
use docktwin_run::TwinKind;
use docktwin_scenario::Loader;
use docktwin_tests::run;

fn last(name: &str, steps: u32, twin: TwinKind) -> DockingState {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios").join(name);
    // Capture is over long before; the rest of the attenuation has its own tests.
    let short = Loader::new().set("run.duration_s", 4.0).set("run.tick_s", 1e-3);
    let scenario =
        short.set("run.steps_per_tick", i64::from(steps)).load(&path).expect("a good scenario");
    run(&scenario, twin).expect("the sides are apart").last
}

#[test]
fn invariant_halving_the_step_changes_little() {
    for name in ["apas_nominal.toml", "apas_fast.toml"] {
        for (kind, steps) in [(TwinKind::Full, 5), (TwinKind::Reduced, 10)] {
            let twin = kind.name();
            let (a, b) = (last(name, steps, kind), last(name, 2 * steps, kind));
            let capture = |s: &DockingState| s.mechanism.captured_s().expect("captured");
            let change = |x: f64, y: f64| (x / y - 1.0).abs();
            let c = [
                change(capture(&a), capture(&b)),
                change(a.peak_force_n, b.peak_force_n),
                change(a.impulse_ns, b.impulse_ns),
            ];
            println!(
                "{name} {twin}: capture {:.4} %, peak force {:.4} %, impulse {:.4} %",
                c[0] * 100.0,
                c[1] * 100.0,
                c[2] * 100.0
            );
            assert!(c.iter().all(|x| *x <= 0.01), "{name} {twin}: {c:?}");
        }
    }
}
