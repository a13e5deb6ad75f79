//! Cost of a full-twin step of 0.2 ms in multi-point contact, and of snapshot and restore, one core.

use std::path::{Path, PathBuf};

use core::hint::black_box;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use docktwin_core::{DVec3, Euler};
use docktwin_model::{load_mechanism, load_spacecraft};
use docktwin_physics::{
    initial::{ContactConditions, initial_state},
    mechanism::System,
    reduced::{DockingTwin, Inputs},
};
use docktwin_twin::FullTwin;

fn models(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(file)
}

/// The default mechanism at the paper's speed, kept where most places touch at once.
fn in_contact() -> FullTwin {
    let chaser = load_spacecraft(&models("chaser_8t.urdf")).expect("chaser").model;
    let target = load_spacecraft(&models("target_12t.urdf")).expect("target").model;
    let mechanism = load_mechanism(&models("apas_active.urdf"), &models("apas_passive.urdf"), None)
        .expect("mechanism")
        .model;
    let system = System::new(&chaser, &target, mechanism);
    let conditions = ContactConditions {
        attitude: Euler::from_degrees(15.0, 7.0, 0.0),
        lateral_m: DVec3::new(0.0, 0.05, 0.0),
        velocity_m_s: DVec3::X * -0.35,
        rate_rad_s: DVec3::ZERO,
        ..ContactConditions::default()
    };
    let bodies = initial_state(&system, &conditions, 0.02).bodies;
    let mut twin = FullTwin::new(system, bodies, 2e-4);
    let mut best = (0, twin.snapshot());
    for _ in 0..3500 {
        twin.step(&Inputs::default());
        let s = twin.state();
        let places = twin.system().measure(&s.mechanism, &s.poses()).contacts().len();
        if s.mechanism.captured_s().is_none() && places > best.0 {
            best = (places, twin.snapshot());
        }
    }
    println!("places of contact at once: {}", best.0);
    twin.restore(&best.1);
    twin
}

fn full(c: &mut Criterion) {
    let mut twin = in_contact();
    let there = twin.snapshot();
    let mut group = c.benchmark_group("full_twin");
    // The restore stays out of the measurement, the step does not leave multi-point contact.
    group.bench_function("step_several_places", |b| {
        b.iter_custom(|n| {
            let mut total = core::time::Duration::ZERO;
            for _ in 0..n {
                twin.restore(&there);
                let begin = std::time::Instant::now();
                twin.step(black_box(&Inputs::default()));
                total += begin.elapsed();
            }
            total
        });
    });
    group.bench_function("snapshot", |b| {
        b.iter_batched(|| (), |()| twin.snapshot(), BatchSize::SmallInput);
    });
    group.finish();
}

criterion_group!(benches, full);
criterion_main!(benches);
