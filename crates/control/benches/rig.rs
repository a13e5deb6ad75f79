//! Cost of one tick of 1 ms of the rig with its controllers, one core.
#![expect(clippy::unwrap_used, reason = "a benchmark stops where something is wrong")]

use core::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use docktwin_control::{
    feedforward::PlateMotion,
    rig::{ClosedRig, RigSetup},
};
use docktwin_core::{DVec3, Twist};
use docktwin_model::{HydraulicPreset, load_rig};
use docktwin_physics::rig::PortSpring;

fn tick(c: &mut Criterion) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf/stewart.urdf");
    let rig = load_rig(&path).unwrap().model;
    let setup = RigSetup::of_rig(&rig, HydraulicPreset::Printed, Some(1));
    let forward = setup.feedforward();
    let middle = rig.middle();
    let port_m = rig.x_4p.inverse().p;
    let spring = PortSpring {
        port_m,
        rest_m: middle.transform_point(port_m),
        stiffness_n_m: DVec3::splat(1e6),
    };
    let mut closed = ClosedRig::new(&setup, &middle).unwrap();
    let mut time = 0.0;
    let mut motion = || {
        time += 1e-3;
        let w = 10.0;
        let (s, c) = f64::sin_cos(w * time);
        let along = |x: f64| Twist { v: DVec3::Y * x * 0.01, w: DVec3::Z * x * 0.01 };
        let mut m = PlateMotion::rest(middle);
        m.x_bp.p += DVec3::Y * s * 0.01;
        (m.twist, m.acceleration, m.jerk) =
            (along(w * c), along(-w * w * s), along(-w * w * w * c));
        m
    };
    let mut group = c.benchmark_group("rig");
    group.bench_function("tick_reduced_with_payload", |b| {
        b.iter(|| {
            let command = forward.command(&motion()).unwrap();
            black_box(closed.tick(&command, |x, _| spring.wrench(x)).unwrap())
        });
    });
    group.bench_function("feedforward", |b| {
        b.iter(|| black_box(forward.command(&motion()).unwrap()));
    });
    group.finish();
}

criterion_group!(benches, tick);
criterion_main!(benches);
