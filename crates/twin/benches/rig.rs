//! Cost of one tick of 1 ms of a drawn rig with its controllers, reduced and full, one core: against a
//! payload's spring, and with two mechanisms touching between rack and plate, their contact measured in
//! every step of the plant.
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
use docktwin_core::{DVec3, Euler, Pose, Twist, Wrench};
use docktwin_model::{HydraulicPreset, Rig, load_mechanism, load_rig, load_spacecraft};
use docktwin_physics::{
    contact::{ContactState, Scene},
    mechanism::System,
    rig::{PerturbedRig, PortSpring, RigPlant},
};
use docktwin_twin::rig::{FULL_STEP_S, FullRig};

const PRESET: HydraulicPreset = HydraulicPreset::Printed;
const SEED: u64 = 1;

/// 0.1 mm in Y and 0.1 mrad in yaw at 1.6 Hz: stays in contact.
fn motion(middle: &Pose, time_s: f64) -> PlateMotion {
    let w = 10.0;
    let (s, c) = f64::sin_cos(w * time_s);
    let along = |x: f64| Twist { v: DVec3::Y * x * 1e-4, w: DVec3::Z * x * 1e-4 };
    let mut m = PlateMotion::rest(*middle);
    m.x_bp.p += DVec3::Y * s * 1e-4;
    (m.twist, m.acceleration, m.jerk) = (along(w * c), along(-w * w * s), along(-w * w * w * c));
    m
}

fn ticks<P: RigPlant>(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    mut rig: ClosedRig<P>,
    forward: &Feedforward,
    mut external: impl FnMut(&Pose, &Twist) -> Wrench,
) {
    let x_bp = rig.state().x_bp;
    let mut time_s = 0.0;
    group.bench_function(name, |b| {
        b.iter(|| {
            time_s += TICK_S;
            let command = forward.command(&motion(&x_bp, time_s)).unwrap();
            black_box(rig.tick(&command, &mut external).unwrap())
        });
    });
}

/// Two mechanisms whose rings do not yield, one on the rack, one on the plate.
struct Touching {
    scene: Scene,
    state: ContactState,
    x_b3: Pose,
    x_3r: Pose,
    /// `X_pr4`.
    x_p4r: Pose,
}

impl Touching {
    fn new(rig: &Rig) -> Self {
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf");
        let load = |file: &str| models.join(file);
        let chaser = load_spacecraft(&load("chaser_8t.urdf")).unwrap().model;
        let target = load_spacecraft(&load("target_12t.urdf")).unwrap().model;
        let mechanism =
            load_mechanism(&load("apas_active.urdf"), &load("apas_passive.urdf"), None).unwrap();
        let system = System::new(&chaser, &target, mechanism.model);
        let x_p4 = rig.x_4p.inverse();
        Self {
            scene: system.scene().clone(),
            state: ContactState::default(),
            x_b3: rig.x_b0 * rig.x_03,
            x_3r: system.ports()[0].inverse() * system.ring_at_rest(),
            x_p4r: x_p4 * system.passive_ring(),
        }
    }

    fn wrench(&mut self, x_bp: &Pose, twist: &Twist, step_s: f64) -> Wrench {
        let (x_wr, x_wp) = (self.x_b3 * self.x_3r, *x_bp * self.x_p4r);
        let still = Twist::default();
        let c = self.scene.measure(&self.state, x_wr, x_wp);
        // About the origin of ep, where the plate's twist is told too.
        let (w, _) = c.wrench(x_bp.p, still, *twist, step_s);
        c.commit(&mut self.state, x_bp.p, still, *twist, step_s);
        w
    }

    /// Where the rings lie 0.3 mm deep in each other's guides, 5 cm and 15° off.
    fn place(&self, rig: &Rig) -> Pose {
        let attitude = Euler::from_degrees(15.0, 7.0, 0.0).to_quat();
        let mut x_34 = Pose::new(DVec3::new(0.9, 0.05, 0.0), attitude);
        loop {
            let x_bp = rig.plate_from_docking(&x_34);
            let (x_wr, x_wp) = (self.x_b3 * self.x_3r, x_bp * self.x_p4r);
            let c = self.scene.measure(&ContactState::default(), x_wr, x_wp);
            if c.deepest_m() > 3e-4 {
                println!("places of contact at once: {}", c.len());
                return x_bp;
            }
            x_34.p.x -= 1e-4;
        }
    }
}

fn rigs(c: &mut Criterion) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf/stewart.urdf");
    let rig = load_rig(&path).unwrap().model;
    let setup = RigSetup::of_rig(&rig, PRESET, Some(SEED));
    let forward = setup.feedforward();
    let built = PerturbedRig::draw(&rig, PRESET, SEED);
    let full = || FullRig::new(&built.rig, built.legs.hydraulic().unwrap(), FULL_STEP_S);
    let mut group = c.benchmark_group("rig");

    let middle = rig.middle();
    let port_m = rig.x_4p.inverse().p;
    let spring = PortSpring {
        port_m,
        rest_m: middle.transform_point(port_m),
        stiffness_n_m: DVec3::splat(1e6),
    };
    let reduced = ClosedRig::new(&setup, &middle).unwrap();
    ticks(&mut group, "tick_reduced_with_payload", reduced, &forward, |x, _| spring.wrench(x));
    let closed = ClosedRig::with_plant(full(), &setup, &middle).unwrap();
    ticks(&mut group, "tick_full_with_payload", closed, &forward, |x, _| spring.wrench(x));

    let mut touching = Touching::new(&rig);
    let x_bp = touching.place(&rig);
    let reduced = ClosedRig::new(&setup, &x_bp).unwrap();
    let step_s = reduced.step_s();
    let contact = |x: &Pose, t: &Twist| touching.wrench(x, t, step_s);
    ticks(&mut group, "tick_reduced_with_contact", reduced, &forward, contact);
    let mut touching = Touching::new(&rig);
    let closed = ClosedRig::with_plant(full(), &setup, &x_bp).unwrap();
    let contact = |x: &Pose, t: &Twist| touching.wrench(x, t, FULL_STEP_S);
    ticks(&mut group, "tick_full_with_contact", closed, &forward, contact);

    group.bench_function("feedforward", |b| {
        b.iter(|| black_box(forward.command(&motion(&middle, 0.1)).unwrap()));
    });
    group.finish();
}

criterion_group!(benches, rigs);
criterion_main!(benches);
