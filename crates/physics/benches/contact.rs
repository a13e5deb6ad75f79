//! Cost of the contact wrench and of a reduced-twin step, one core.
#[path = "../tests/common/mod.rs"]
mod common;

use core::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use docktwin_core::{DVec3, Pose, Twist};
use docktwin_physics::{
    contact::ContactState,
    mechanism::System,
    reduced::{DockingState, DockingTwin, Inputs, ReducedTwin},
};

/// The default mechanism at the paper's speed, run until several places touch at once.
fn in_contact() -> (System, DockingState) {
    let system = System::new(&common::chaser(), &common::target(), common::apas());
    let mut state =
        common::start(&system, &common::conditions(0.35, 0.05, 0.0, [15.0, 7.0, 0.0]), 0.02);
    let mut best = (0, state.clone());
    for _ in 0..7_000 {
        system.step(&mut state, &Inputs::default(), 1e-4);
        let m = system.measure(&state.mechanism, &state.poses());
        let places = m.contacts().len();
        if state.mechanism.captured_s().is_none() && places > best.0 {
            best = (places, state.clone());
        }
    }
    println!("places of contact at once: {}", best.0);
    (system, best.1)
}

fn contact(c: &mut Criterion) {
    let (system, state) = in_contact();
    let poses = system.poses(&state.poses());
    // As in a run: the memory of the step before, which knows what is far apart.
    let mut memory = ContactState::default();
    let still = Twist::default();
    for _ in 0..2 {
        system.scene().measure(&memory, poses.x_wr, poses.x_wp).commit(
            &mut memory,
            poses.x_wr.p,
            still,
            still,
            1e-4,
        );
    }
    let mut group = c.benchmark_group("contact");
    group.bench_function("wrench_several_places_without_memory", |b| {
        let fresh = ContactState::default();
        b.iter(|| system.scene().measure(black_box(&fresh), poses.x_wr, poses.x_wp));
    });
    group.bench_function("wrench_several_places", |b| {
        b.iter(|| {
            let m = system.scene().measure(black_box(&memory), poses.x_wr, poses.x_wp);
            m.wrench(poses.x_wr.p, still, still, 1e-4)
        });
    });
    let away = Pose::new(poses.x_wp.p + poses.x_wp.q * DVec3::X * -0.5, poses.x_wp.q);
    group.bench_function("nothing_near", |b| {
        b.iter(|| system.scene().measure(black_box(&memory), poses.x_wr, away));
    });
    group.finish();
}

fn step(c: &mut Criterion) {
    let (system, state) = in_contact();
    let mut group = c.benchmark_group("reduced_twin");
    // One step at a time from the same state, so that it stays in multi-point contact; and one twin at a time,
    // so that it is stepped where it was stepped before, as in a run, and not out of cold memory.
    let mut twin = ReducedTwin::new(system, state.bodies, 1e-4);
    twin.restore(&state);
    group.bench_function("step_several_places", |b| {
        b.iter_batched_ref(
            || {
                let mut t = twin.clone();
                t.restore(&state);
                t
            },
            |t| t.step(&Inputs::default()),
            criterion::BatchSize::PerIteration,
        );
    });
    group.finish();
}

criterion_group!(benches, contact, step);
criterion_main!(benches);
