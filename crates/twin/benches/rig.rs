//! Cost of one tick of 1 ms of a drawn rig with its controllers and a payload's spring, reduced and
//! full, one core.
#![expect(clippy::unwrap_used, reason = "a benchmark stops where something is wrong")]

use core::hint::black_box;
use std::path::Path;

use criterion::{
    BenchmarkGroup, Criterion, criterion_group, criterion_main, measurement::WallTime,
};
use docktwin_control::{
    feedforward::{Feedforward, PlateMotion},
    rig::{ClosedRig, RigSetup, TICK_S},
};
use docktwin_core::{DVec3, Pose, Twist};
use docktwin_model::{HydraulicPreset, load_rig};
use docktwin_physics::rig::{PerturbedRig, PortSpring, RigPlant};
use docktwin_twin::rig::{FULL_STEP_S, FullRig};

const PRESET: HydraulicPreset = HydraulicPreset::Printed;
const SEED: u64 = 1;

/// 10 mm in Y and 10 mrad in yaw at 1.6 Hz.
fn motion(middle: &Pose, time_s: f64) -> PlateMotion {
    let w = 10.0;
    let (s, c) = f64::sin_cos(w * time_s);
    let along = |x: f64| Twist { v: DVec3::Y * x * 0.01, w: DVec3::Z * x * 0.01 };
    let mut m = PlateMotion::rest(*middle);
    m.x_bp.p += DVec3::Y * s * 0.01;
    (m.twist, m.acceleration, m.jerk) = (along(w * c), along(-w * w * s), along(-w * w * w * c));
    m
}

fn ticks<P: RigPlant>(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    mut rig: ClosedRig<P>,
    forward: &Feedforward,
    spring: &PortSpring,
) {
    let middle = rig.plant().platform().middle();
    let mut time_s = 0.0;
    group.bench_function(name, |b| {
        b.iter(|| {
            time_s += TICK_S;
            let command = forward.command(&motion(&middle, time_s)).unwrap();
            black_box(rig.tick(&command, |x, _| spring.wrench(x)).unwrap())
        });
    });
}

fn rigs(c: &mut Criterion) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf/stewart.urdf");
    let rig = load_rig(&path).unwrap().model;
    let setup = RigSetup::of_rig(&rig, PRESET, Some(SEED));
    let forward = setup.feedforward();
    let middle = rig.middle();
    let port_m = rig.x_4p.inverse().p;
    let spring = PortSpring {
        port_m,
        rest_m: middle.transform_point(port_m),
        stiffness_n_m: DVec3::splat(1e6),
    };
    let mut group = c.benchmark_group("rig");
    let reduced = ClosedRig::new(&setup, &middle).unwrap();
    ticks(&mut group, "tick_reduced_with_payload", reduced, &forward, &spring);
    let built = PerturbedRig::draw(&rig, PRESET, SEED);
    let full = FullRig::new(&built.rig, &built.legs, FULL_STEP_S);
    let full = ClosedRig::with_plant(full, &setup, &middle).unwrap();
    ticks(&mut group, "tick_full_with_payload", full, &forward, &spring);
    group.bench_function("feedforward", |b| {
        b.iter(|| black_box(forward.command(&motion(&middle, 0.1)).unwrap()));
    });
    group.finish();
}

criterion_group!(benches, rigs);
criterion_main!(benches);
