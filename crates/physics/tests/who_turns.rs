//! Which body turns before contact: the relative motion at the plane of first contact does not depend on it,
//! and what follows is that of the mirrored docking.

use std::path::{Path, PathBuf};

use docktwin_core::{DQuat, DVec3, Euler, Pose};
use docktwin_model::{
    AttenuationChoice, DockingMechanism, Spacecraft, load_mechanism, load_spacecraft,
};
use docktwin_physics::{
    body::BodyState,
    initial::{ContactConditions, Turning, initial_state},
    mechanism::{CHASER, RING, System, TARGET},
    reduced::{DockingState, Inputs},
};

const H: f64 = 1e-4;
const TURNING: [Turning; 3] = [Turning::Target, Turning::Chaser, Turning::Both];

fn model(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(name)
}

fn craft(name: &str) -> Spacecraft {
    load_spacecraft(&model(name)).expect("as the model says").model
}

fn mechanism(name: &str, choice: Option<AttenuationChoice>) -> DockingMechanism {
    let [a, p] = ["active", "passive"].map(|side| model(&format!("{name}_{side}.urdf")));
    load_mechanism(&a, &p, choice).expect("as the model says").model
}

/// Pose and twist of `e4` seen from `e3`, the rate in `e4`.
fn seen_from_e3(system: &System, bodies: &[BodyState; 3]) -> (Pose, DVec3, DVec3) {
    let [x_13, x_24] = system.ports();
    let mass = system.mass();
    let (c, t) = (bodies[CHASER], bodies[TARGET]);
    let (x3, x4) = (c.pose() * x_13, t.pose() * x_24);
    let (tc, tt) = (c.twist(&mass[CHASER]), t.twist(&mass[TARGET]));
    let v4 = tt.v + tt.w.cross(x4.p - t.p);
    let v3 = tc.v + tc.w.cross(x4.p - c.p);
    (x3.inverse() * x4, x3.q.conjugate() * (v4 - v3), x4.q.conjugate() * (tt.w - tc.w))
}

fn conditions(turning: Turning) -> ContactConditions {
    ContactConditions {
        attitude: Euler::from_degrees(3.0, -2.0, 4.0),
        lateral_m: DVec3::new(0.0, 0.05, -0.03),
        velocity_m_s: DVec3::new(-0.1, 0.02, 0.01),
        rate_rad_s: DVec3::new(0.3, -0.2, 0.4),
        turning,
    }
}

/// Position, attitude, velocity and rate to rounding, whoever turns; the common momentum stays zero, and the
/// ring moves with its chaser.
#[test]
fn invariant_the_relative_motion_at_contact_does_not_depend_on_who_turns() {
    for choice in [None, Some(AttenuationChoice::Rigid)] {
        let system = System::new(
            &craft("chaser_8t.urdf"),
            &craft("target_12t.urdf"),
            mechanism("apas", choice),
        );
        let at = TURNING.map(|turning| initial_state(&system, &conditions(turning), 0.0).bodies);
        let (x0, v0, w0) = seen_from_e3(&system, &at[0]);
        for bodies in &at {
            let (x, v, w) = seen_from_e3(&system, bodies);
            let off = (x0.inverse() * x).p.length();
            assert!(off < 1e-12 && (v - v0).length() < 1e-13, "{off} {v} {v0}");
            assert!((w - w0).length() < 1e-13 && x0.q.angle_between(x.q) < 1e-7, "{w} {w0}");
            let moving = if system.rigid() { vec![CHASER, TARGET] } else { vec![0, 1, 2] };
            let p: DVec3 = moving.iter().map(|i| bodies[*i].v * system.mass()[*i].mass()).sum();
            assert!(p.length() < 1e-9, "{p}");
            let t = bodies[CHASER].twist(&system.mass()[CHASER]);
            let r = bodies[RING].twist(&system.mass()[RING]);
            let carried = t.v + t.w.cross(bodies[RING].p - bodies[CHASER].p);
            assert!((r.v - carried).length() < 1e-14 && (r.w - t.w).length() < 1e-14);
        }
        let rate = |bodies: &[BodyState; 3], i: usize| bodies[i].twist(&system.mass()[i]).w;
        assert_eq!(rate(&at[0], CHASER), DVec3::ZERO);
        assert!(rate(&at[1], TARGET).length() < 1e-15 && rate(&at[1], CHASER).length() > 0.5);
        assert!((rate(&at[2], TARGET) + rate(&at[2], CHASER)).length() < 1e-15);
    }
}

/// The start is the state at the plane of contact taken back in free flight, chaser and ring as one body.
#[test]
fn invariant_the_start_leads_to_the_plane_of_contact() {
    let (c, t) = (craft("chaser_8t.urdf"), craft("target_12t.urdf"));
    let system = System::new(&c, &t, mechanism("apas", Some(AttenuationChoice::Rigid)));
    let want =
        seen_from_e3(&system, &initial_state(&system, &conditions(Turning::Both), 0.0).bodies);
    let start = initial_state(&system, &conditions(Turning::Both), 0.05);
    let mut bodies = start.bodies;
    for _ in 0..100 {
        for i in [CHASER, TARGET] {
            bodies[i].drift(&system.mass()[i], start.time_to_contact_s / 100.0);
        }
    }
    let got = seen_from_e3(&system, &bodies);
    let plane = start.contact_plane_m
        - initial_state(&system, &conditions(Turning::Both), 0.0).contact_plane_m;
    let off = got.0.p - want.0.p - DVec3::X * plane;
    assert!(off.length() < 1e-9 && (got.2 - want.2).length() < 1e-9, "{off} {} {}", got.2, want.2);
}

/// What a docking comes to: first contact later than foreseen, peak force, impulse, rates of chaser and target.
fn run(system: &System, c: &ContactConditions) -> (f64, f64, f64, [f64; 2]) {
    let start = initial_state(system, c, 0.01);
    let mut state = DockingState::new(start.bodies);
    for _ in 0..6000 {
        system.step(&mut state, &Inputs::default(), H);
    }
    let rate = |i: usize| state.bodies[i].twist(&system.mass()[i]).w.length();
    let first = state.first_contact_s.expect("they meet") - start.time_to_contact_s;
    (first, state.peak_force_n, state.impulse_ns, [rate(CHASER), rate(TARGET)])
}

/// Two equal spacecraft with equal bare rings: to let the chaser turn is to look at the docking from the other
/// side. Half a turn about Z brings each to the place of the other.
#[test]
fn oracle_a_turning_chaser_is_a_turning_target_seen_from_the_other_side() {
    let chaser = craft("chaser_8t.urdf");
    let half = DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0);
    let mut target = chaser.clone();
    let port = chaser.x_body_port;
    target.x_body_port = Pose::new(half * port.p, half * port.q * half.conjugate());
    let mut m = mechanism("ring", Some(AttenuationChoice::Rigid));
    (m.active.petals, m.passive.petals) = (None, None);
    m.passive.ring = m.active.ring;
    m.passive_ring_offset_m = m.ring_rest_offset_m;
    // The rigid ring belongs to the chaser and would make it the heavier one.
    m.ring_body.mass_kg *= 1e-9;
    m.ring_body.inertia_kg_m2 *= 1e-9;
    let system = System::new(&chaser, &target, m);
    let rate = DVec3::new(0.1, 0.04, -0.06);
    let here = ContactConditions {
        lateral_m: DVec3::new(0.0, 0.08, 0.03),
        velocity_m_s: DVec3::new(-0.1, 0.01, -0.02),
        rate_rad_s: rate,
        ..ContactConditions::default()
    };
    let plane = initial_state(&system, &here, 0.0).contact_plane_m;
    let across = here.lateral_m + DVec3::X * plane;
    // Both ports are parallel at contact: from the other side e4 is e3 and turns.
    let there = ContactConditions {
        lateral_m: half * -here.lateral_m,
        velocity_m_s: half * (rate.cross(across) - here.velocity_m_s),
        rate_rad_s: half * -rate,
        turning: Turning::Chaser,
        ..ContactConditions::default()
    };
    let (a, b) = (run(&system, &here), run(&system, &there));
    let near = |x: f64, y: f64, tol: f64| (x - y).abs() < tol * x.abs();
    assert!(a.1 > 100.0, "{a:?}");
    // Contact falls between two steps of 0.1 ms, here and there at another part of one.
    assert!(a.0.abs() < 1e-3 && b.0.abs() < 1e-3, "{a:?} {b:?}");
    assert!(near(a.1, b.1, 5e-4) && near(a.2, b.2, 1e-4), "{a:?} {b:?}");
    assert!(near(a.3[0], b.3[1], 3e-4) && near(a.3[1], b.3[0], 3e-4), "{a:?} {b:?}");
    // The same relative motion with the other body turning is another docking.
    let other = run(&system, &ContactConditions { turning: Turning::Target, ..there });
    assert!(!near(other.1, a.1, 1e-3) || !near(other.3[0], a.3[1], 1e-2), "{a:?} {other:?}");
}
