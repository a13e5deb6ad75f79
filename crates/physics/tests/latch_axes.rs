//! In whose axes a latch measures its gap and pulls: of the active ring, or of the passive one.

use std::path::{Path, PathBuf};

use docktwin_core::{DQuat, DVec3, Pose, Twist};
use docktwin_model::{LatchAxes, load_mechanism, load_spacecraft};
use docktwin_physics::{
    initial::{ContactConditions, initial_state},
    mechanism::{LatchPhase, MechanismState, Midpoint, System, TARGET},
};

fn model(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(name)
}

/// The shipped mechanism as bare rings, its latches in these axes.
fn system(axes: LatchAxes) -> System {
    let [chaser, target] = ["chaser_8t.urdf", "target_12t.urdf"]
        .map(|name| load_spacecraft(&model(name)).expect("as the model says").model);
    let (active, passive) = (model("apas_active.urdf"), model("apas_passive.urdf"));
    let mut m = load_mechanism(&active, &passive, None).expect("as the model says").model;
    (m.active.petals, m.passive.petals) = (None, None);
    m.latches.as_mut().expect("it has").axes = axes;
    System::new(&chaser, &target, m)
}

/// Poses of the bodies with the passive ring's centre at `p`, m, in `r3`, turned by `turn`, rad, about it.
fn bodies(system: &System, p: DVec3, turn: DVec3) -> [Pose; 3] {
    let c = ContactConditions { velocity_m_s: DVec3::NEG_X * 0.1, ..ContactConditions::default() };
    let mut out = initial_state(system, &c, 0.1).bodies.map(|b| b.pose());
    let now = system.poses(&out);
    let to = Pose::new(now.x_wr.p + p, DQuat::from_scaled_axis(turn) * now.x_wp.q);
    out[TARGET] = to * now.x_wp.inverse() * out[TARGET];
    out
}

/// Docked, the ring centres are twice the section apart.
const DOCKED_M: f64 = 0.05;

/// A gap at azimuth 0, where radial is Y and tangential Z, by the definition: the way from latch to striker
/// along the axes of the one ring or of the other.
#[test]
fn oracle_gaps_are_those_in_the_axes_named() {
    let (yaw, apart) = (0.03_f64, DVec3::new(DOCKED_M + 0.02, 0.01, -0.006));
    let (s, c) = yaw.sin_cos();
    // Striker 0 is 0.6 m out on Y of the passive ring and on its face, 0.025 m toward the chaser.
    let striker = apart + DVec3::new(-0.025 * c - 0.6 * s, -0.025 * s + 0.6 * c, 0.0);
    let way = striker - DVec3::new(0.025, 0.6, 0.0);
    let passive = [way.x * c + way.y * s, -way.x * s + way.y * c, way.z];
    for (axes, gap) in [(LatchAxes::Active, way.to_array()), (LatchAxes::Passive, passive)] {
        let system = system(axes);
        let at = bodies(&system, apart, DVec3::Z * yaw);
        let got = system.measure(&MechanismState::default(), &at).latches[0];
        for (x, y) in [got.axial_m, got.radial_m, got.tangential_m].into_iter().zip(gap) {
            assert!((x - y).abs() < 1e-9, "{axes:?}: {got:?} {gap:?}");
        }
    }
    assert!((passive[0] - way.x).abs() > 1e-4);
}

/// A caught latch stretched beyond its gap: the wrench on the target is minus the gradient of the energy held,
/// about the centre of the active ring.
#[test]
fn oracle_the_pull_is_the_gradient_of_its_energy() {
    for axes in [LatchAxes::Active, LatchAxes::Passive] {
        let system = system(axes);
        let mut state = MechanismState::default();
        state.latches[0].phase = LatchPhase::Latched;
        let (p, turn) = (DVec3::new(DOCKED_M + 0.06, 0.006, -0.004), DVec3::new(0.02, -0.03, 0.05));
        let energy = |p: DVec3, turn: DQuat| {
            let at = bodies(&system, p, turn.to_scaled_axis());
            system.stored_energy(&system.measure(&state, &at), &state)
        };
        let q = DQuat::from_scaled_axis(turn);
        let at = bodies(&system, p, turn);
        let m = system.measure(&state, &at);
        assert!(!m.touching(), "the rings are apart");
        let middle = Midpoint { com: at.map(|b| b.p), time_s: 0.0, h: 1e-4 };
        let w = system.forces(&m, &state, &[Twist::default(); 3], &middle).on_target;
        assert!(w.f.length() > 1000.0, "{w:?}");
        let d = 1e-6;
        for axis in DVec3::AXES {
            let slope = (energy(p + axis * d, q) - energy(p - axis * d, q)) / (2.0 * d);
            assert!((slope + w.f.dot(axis)).abs() < 1e-4 * w.f.length(), "{axes:?} {slope} {w:?}");
            // A turn about the active ring's centre.
            let turned = |a: f64| {
                let dq = DQuat::from_axis_angle(axis, a);
                energy(dq * p, dq * q)
            };
            let slope = (turned(d) - turned(-d)) / (2.0 * d);
            assert!((slope + w.m.dot(axis)).abs() < 1e-4 * w.m.length(), "{axes:?} {slope} {w:?}");
        }
    }
}
