//! Halving the step changes capture time, peak force and impulse by no more than 1 %.

use std::path::Path;

use docktwin::setup::start;
use docktwin_physics::reduced::{DockingState, ReducedTwin};
use docktwin_scenario::load_scenario;
use docktwin_tests::tell;
use docktwin_twin::FullTwin;

fn run(name: &str, steps: u32, full: bool) -> DockingState {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios").join(name);
    // Capture is over long before; the rest of the attenuation has its own tests.
    let short = [("run.duration_s".to_owned(), "4.0".to_owned())];
    let scenario = load_scenario(&path, &short).expect("a good scenario");
    let h = 1e-3 / f64::from(steps);
    let (system, bodies) = start(&scenario).expect("the sides are apart");
    if full {
        tell(&scenario, FullTwin::new(system, bodies, h), steps, h).last
    } else {
        tell(&scenario, ReducedTwin::new(system, bodies, h), steps, h).last
    }
}

#[test]
fn invariant_halving_the_step_changes_little() {
    for name in ["apas_nominal.toml", "apas_fast.toml"] {
        for (twin, full, steps) in [("full", true, 5), ("reduced", false, 10)] {
            let (a, b) = (run(name, steps, full), run(name, 2 * steps, full));
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
