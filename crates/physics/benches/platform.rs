//! Cost of the platform's kinematics and of the reduced rig's dynamics, one core.
use core::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use docktwin_core::{DVec3, Twist, Wrench};
use docktwin_model::load_rig;
use docktwin_physics::platform::Platform;

fn platform(c: &mut Criterion) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf/stewart.urdf");
    let rig = load_rig(&path).unwrap_or_else(|e| panic!("{e}")).model;
    let platform = Platform::new(&rig);
    let x = rig.plate_from_docking(&rig.docking.pose([0.5, -0.7, 0.4, 0.6, -0.5, 0.8]));
    let lengths = platform.at(&x).length_m;
    let twist = Twist { v: DVec3::new(0.35, 0.1, 0.05), w: DVec3::new(0.02, 0.01, -0.02) };
    let near = Platform::moved(&x, &twist, -1e-3);
    let middle = platform.middle();
    let configuration = platform.at(&x);
    let forces = platform
        .inverse_dynamics(&configuration, &twist, &twist, &Wrench::ZERO)
        .expect("not singular");

    c.bench_function("inverse kinematics", |b| b.iter(|| platform.at(black_box(&x))));
    c.bench_function("forward kinematics, one tick away", |b| {
        b.iter(|| platform.forward(black_box(&lengths), black_box(&near)))
    });
    c.bench_function("forward kinematics, from the middle to a far pose", |b| {
        b.iter(|| platform.forward(black_box(&lengths), black_box(&middle)))
    });
    c.bench_function("inverse dynamics", |b| {
        b.iter(|| {
            let configuration = platform.at(black_box(&x));
            platform.inverse_dynamics(&configuration, &twist, &twist, &Wrench::ZERO)
        })
    });
    c.bench_function("forward dynamics", |b| {
        b.iter(|| {
            let configuration = platform.at(black_box(&x));
            platform.forward_dynamics(&configuration, &twist, black_box(&forces), &Wrench::ZERO)
        })
    });
}

criterion_group!(benches, platform);
criterion_main!(benches);
