//! Where the surfaces touch: against parry's convex pieces, across seams, down to 40 mm.
mod common;

use docktwin_core::{DVec3, Pose, Twist, Wrench};
use docktwin_physics::contact::{ContactState, Scene};
use parry3d_f64::{
    query::ClosestPoints,
    query::closest_points,
    shape::{Segment, Shape, Triangle},
};

const STILL: Twist = Twist { v: DVec3::ZERO, w: DVec3::ZERO };

fn wrench(scene: &Scene, x_rp: Pose) -> Wrench {
    scene
        .measure(&ContactState::default(), Pose::IDENTITY, x_rp)
        .wrench(DVec3::ZERO, STILL, STILL, 1e-4)
        .0
}

fn deepest(scene: &Scene, x_rp: Pose) -> f64 {
    scene.measure(&ContactState::default(), Pose::IDENTITY, x_rp).deepest_m()
}

/// Rings and petals of both sides as parry sees them: segments and flat convex pieces, without their
/// rounding.
fn parry_depth(scene_has_petals: bool, x_rp: Pose, pieces: u32) -> f64 {
    let side = common::side(scene_has_petals);
    let to_parry = |x: Pose| rapier_pose(x);
    let ring: Vec<Segment> = (0..8 * pieces)
        .map(|i| {
            let at = |i: u32| {
                let (s, c) =
                    (core::f64::consts::TAU * f64::from(i) / f64::from(8 * pieces)).sin_cos();
                DVec3::new(0.0, 0.6 * c, 0.6 * s)
            };
            Segment::new(at(i), at(i + 1))
        })
        .collect();
    let mut petals: Vec<Triangle> = Vec::new();
    if let Some(p) = &side.petals {
        for petal in 0..3 {
            for i in 0..pieces {
                let u = |i: u32| -1.0 + 2.0 * f64::from(i) / f64::from(pieces);
                let ([a, b], [c, d]) = (p.ruling(petal, u(i)), p.ruling(petal, u(i + 1)));
                // Strips are twisted: cut along the rulings too, or their diagonals bulge.
                for j in 0..pieces {
                    let at =
                        |p: DVec3, q: DVec3, j: u32| p.lerp(q, f64::from(j) / f64::from(pieces));
                    let (a0, a1) = (at(a, b, j), at(a, b, j + 1));
                    let (c0, c1) = (at(c, d, j), at(c, d, j + 1));
                    petals.push(Triangle::new(a0, a1, c0));
                    petals.push(Triangle::new(a1, c1, c0));
                }
            }
        }
    }
    let x12 = to_parry(x_rp);
    let near = |a: &dyn Shape, b: &dyn Shape| {
        let (a, b) = (a.compute_local_bounding_sphere(), b.compute_local_bounding_sphere());
        (a.center - x_rp.transform_point(b.center)).length() < a.radius + b.radius + 0.05
    };
    let gap = |a: &dyn Shape, b: &dyn Shape| {
        if !near(a, b) {
            1.0
        } else {
            match closest_points(&rapier_pose(Pose::IDENTITY), a, &x12, b, 1.0) {
                Ok(ClosestPoints::WithinMargin(p, q)) => (p - q).length(),
                Ok(ClosestPoints::Intersecting) => 0.0,
                _ => 1.0,
            }
        }
    };
    let mut best = f64::NEG_INFINITY;
    for a in &ring {
        for b in &ring {
            best = best.max(0.050 - gap(a, b));
        }
        for b in &petals {
            best = best.max(0.035 - gap(a, b));
        }
    }
    for a in &petals {
        for b in &ring {
            best = best.max(0.035 - gap(a, b));
        }
        for b in &petals {
            best = best.max(0.020 - gap(a, b));
        }
    }
    best
}

fn rapier_pose(x: Pose) -> parry3d_f64::math::Pose {
    parry3d_f64::math::Pose::from_parts(x.p, x.q)
}

/// Depth by brute force: both cores sampled densely, point against circle in closed form.
fn dense_depth(x_rp: Pose) -> f64 {
    let p = common::petals();
    let circle = |q: DVec3| (q.x * q.x + (q.y.hypot(q.z) - 0.6).powi(2)).sqrt();
    let mut best = f64::NEG_INFINITY;
    for petal in 0..3 {
        for iu in 0..=1600 {
            let [a, b] = p.ruling(petal, -1.0 + f64::from(iu) / 800.0);
            for is in 0..=400 {
                let q = a + (b - a) * (f64::from(is) / 400.0);
                best = best.max(0.035 - circle(x_rp.inverse_transform_point(q)));
                best = best.max(0.035 - circle(x_rp.transform_point(q)));
            }
        }
    }
    for i in 0..100_000 {
        let (s, c) = (core::f64::consts::TAU * f64::from(i) / 1e5).sin_cos();
        best = best
            .max(0.05 - circle(x_rp.inverse_transform_point(DVec3::new(0.0, 0.6 * c, 0.6 * s))));
    }
    best
}

/// Depth against parry's convex pieces, which approach ours as they get finer.
#[test]
fn oracle_depth_agrees_with_parrys_convex_pieces() {
    let mut m = common::apas();
    // Here the geometry itself is asked.
    m.contact.merge_depth_m = 1e-7;
    let scene = Scene::new(&m);
    let poses = [
        common::pose(0.30, 0.05, 0.0, [2.0, 2.0, 0.0]),
        common::pose(0.20, 0.10, 0.03, [5.0, -3.0, 4.0]),
        common::pose(0.12, 0.02, 0.01, [0.0, 1.0, -2.0]),
        common::pose(0.06, 0.004, -0.01, [1.0, 0.5, 0.0]),
        common::pose(0.25, -0.08, 0.12, [15.0, 7.0, -7.0]),
        common::pose(0.42, 0.0, 0.05, [40.0, 0.0, 0.0]),
    ];
    for (i, x) in poses.into_iter().enumerate() {
        // Move along the axis until there is contact of some millimetres.
        let mut x = x;
        while deepest(&scene, x) < 1.5e-3 {
            x.p.x -= 5e-4;
            assert!(x.p.x > -0.1, "pose {i} never touches");
        }
        let ours = deepest(&scene, x);
        let errors = [6u32, 12, 24].map(|n| (parry_depth(true, x, n) - ours).abs());
        println!("pose {i}: ours {:.5} mm, dense {:.5} mm", ours * 1e3, dense_depth(x) * 1e3);
        println!(
            "pose {i}: depth {:.4} mm; parry with 6², 12², 24² pieces a petal off by {:.4}, {:.4}, {:.4} mm",
            ours * 1e3,
            errors[0] * 1e3,
            errors[1] * 1e3,
            errors[2] * 1e3
        );
        // Chords of a circle are off by their sagitta, which falls with the square of their length:
        // 0.08 mm for the ring and 0.12 mm for the petal with 24 pieces.
        assert!(errors[2] < 2.0e-4, "pose {i}: {errors:?}");
        assert!(errors[2] < 0.3 * errors[0] || errors[0] < 1e-4, "pose {i}: {errors:?}");
    }
}

/// Poses in which the deepest rulings of two petals lie a few hundredths beside the end of a range of
/// the search. Depths are MuJoCo's side's, found on whole sheets by Newton from many starts.
#[test]
fn regress_peaks_beside_the_end_of_a_range_are_found() {
    let mut m = common::apas();
    m.contact.merge_depth_m = 1e-7;
    let scene = Scene::new(&m);
    let cases = [
        (
            DVec3::new(0.2624357537365315, 0.2476027159410935, 0.030481306693789283),
            [
                -0.00011389695487164061,
                -0.01963542385161052,
                0.09091618712859026,
                0.9956649456898894,
            ],
            0.2272e-3,
        ),
        (
            DVec3::new(0.21757307923593525, -0.021904836956975274, -0.1730595286581269),
            [-0.06541518180417064, -0.009640589915577306, -0.04788130038826749, 0.9966620761766425],
            3.2998e-3,
        ),
    ];
    for (p, [w, x, y, z], want) in cases {
        let ours = deepest(&scene, Pose::new(p, docktwin_core::DQuat::from_xyzw(x, y, z, w)));
        assert!((ours - want).abs() < 5e-6, "{} mm instead of {} mm", ours * 1e3, want * 1e3);
    }
}

/// A ridge of the depth over both petals' rulings that runs between their directions: outward petals, the
/// tip corner of one on the sheet of the other. Depth as above.
#[test]
fn regress_a_ridge_between_the_rulings_is_followed() {
    let mut m = common::apas();
    m.contact.merge_depth_m = 1e-7;
    for side in [&mut m.active, &mut m.passive] {
        side.ring.mean_radius_m = 0.8;
        if let Some(p) = &mut side.petals {
            p.base_radius_m = 0.803;
            p.tip_radius_m = 1.005;
            p.height_m = 0.2;
        }
    }
    let scene = Scene::new(&m);
    let p = DVec3::new(0.3492067641068709, 0.2114107616757717, -0.18483181292722378);
    let q = docktwin_core::DQuat::from_xyzw(
        -0.031514678731161996,
        0.10139789568699628,
        0.9943308096815803,
        -0.005615397821500995,
    );
    let ours = deepest(&scene, Pose::new(p, q));
    assert!((ours - 1.4876e-3).abs() < 5e-6, "{} mm", ours * 1e3);
}

/// A petal on a ring is as deep as the deepest of all its rulings, also where that one's deepest point
/// comes to the tip and the depth has a kink: here 4000 rulings, each against the circle by a scan and a
/// golden section. A single parabola across the rulings was off by 4 µm, and one approach in two hundred
/// was captured a third of a second later for it.
#[test]
fn oracle_a_petal_on_a_ring_is_as_deep_as_its_deepest_ruling() {
    let mut m = common::apas();
    m.contact.merge_depth_m = 1e-7;
    m.passive.petals = None;
    let petals = common::petals();
    let scene = Scene::new(&m);
    let circle = |q: DVec3| (q.x * q.x + (q.y.hypot(q.z) - 0.6).powi(2)).sqrt();
    let ruling_distance = |x: Pose, petal: u32, u: f64| {
        let [a, b] = petals.ruling(petal, u);
        let at = |s: f64| circle(x.inverse_transform_point(a + (b - a) * s));
        let nearest =
            (0..=50).map(|i| f64::from(i) / 50.0).min_by(|s, t| at(*s).total_cmp(&at(*t)));
        let s = nearest.expect("fifty points");
        let (mut lo, mut hi) = ((s - 0.02).max(0.0), (s + 0.02).min(1.0));
        for _ in 0..40 {
            let third = 0.381_966 * (hi - lo);
            if at(lo + third) < at(hi - third) { hi -= third } else { lo += third }
        }
        at(0.5 * (lo + hi))
    };
    let (mut worst, mut on_petals) = (0.0f64, 0);
    for i in 0..40 {
        let t = f64::from(i);
        let angles = [15.0 * (1.7 * t).sin(), 7.0 * (2.3 * t).sin(), 7.0 * (3.1 * t).cos()];
        let mut x = common::pose(0.45, 0.15 * (0.9 * t).cos(), 0.15 * (1.3 * t).sin(), angles);
        while deepest(&scene, x) < 1e-3 {
            x.p.x -= 5e-4;
            assert!(x.p.x > -0.1, "pose {i} never touches");
        }
        let mut best = f64::INFINITY;
        for petal in 0..3 {
            for iu in 0..=4000 {
                best = best.min(ruling_distance(x, petal, f64::from(iu) / 2000.0 - 1.0));
            }
        }
        // Some of these poses bring the rings together first.
        let rings = (0..100_000).map(|i| {
            let (s, c) = (core::f64::consts::TAU * f64::from(i) / 1e5).sin_cos();
            0.05 - circle(x.inverse_transform_point(DVec3::new(0.0, 0.6 * c, 0.6 * s)))
        });
        let rings = rings.fold(f64::NEG_INFINITY, f64::max);
        on_petals += u32::from(0.035 - best > rings);
        worst = worst.max((deepest(&scene, x) - (0.035 - best).max(rings)).abs());
    }
    assert!(on_petals >= 25, "only {on_petals} poses meet a petal first");
    println!("worst difference {:.5} µm", worst * 1e6);
    assert!(worst < 2e-7, "{worst} m");
}

/// Sliding a petal along the opposing ring at constant depth, across every seam: between
/// neighbouring 0.1 mm steps force and moment change by no more than 5 %.
#[test]
fn invariant_wrench_is_continuous_while_a_petal_slides_along_the_ring() {
    let scene = Scene::new(&common::apas());
    for (offset, height) in [(0.05, 0.12), (0.02, 0.08), (0.09, 0.10)] {
        let mut last: Option<Wrench> = None;
        let mut worst = (0.0f64, 0.0f64);
        // The passive side's offset goes a third around, from petal to petal: the ring slides over
        // every seam and edge there is.
        let steps = (core::f64::consts::TAU / 3.0 * 0.6 / 1e-4) as u32;
        let mut lateral = offset;
        // With memory, as in a run; it changes no value.
        let mut state = ContactState::default();
        for i in 0..steps {
            let a = core::f64::consts::TAU / 3.0 * f64::from(i) / f64::from(steps);
            let at = |r: f64| {
                let (s, c) = a.sin_cos();
                common::pose(height, r * c, r * s, [0.0, 0.0, 0.0])
            };
            // Constant depth of 2 mm.
            let mut x = at(lateral);
            for _ in 0..60 {
                let c = scene.measure(&state, Pose::IDENTITY, x);
                c.commit(&mut state, DVec3::ZERO, STILL, STILL, 1e-4);
                let d = c.deepest_m();
                if (d - 2e-3).abs() < 1e-9 {
                    break;
                }
                lateral += (2e-3 - d).clamp(-2e-3, 2e-3) * 1.2;
                x = at(lateral);
            }
            let c = scene.measure(&state, Pose::IDENTITY, x);
            let w = c.wrench(DVec3::ZERO, STILL, STILL, 1e-4).0;
            if let Some(l) = last {
                let df = (w.f - l.f).length() / l.f.length();
                // The arm is of the order of the ring's radius.
                let dm = (w.m - l.m).length() / l.m.length().max(0.3 * l.f.length());
                worst = (worst.0.max(df), worst.1.max(dm));
            }
            last = Some(w);
        }
        println!(
            "height {height}: worst change of force {:.3} %, of moment {:.3} %",
            worst.0 * 100.0,
            worst.1 * 100.0
        );
        assert!(worst.0 < 0.05 && worst.1 < 0.05, "{worst:?}");
    }
}

/// Normals stay right to 40 mm: the force keeps its direction as depth grows through the depth at
/// which the cores of petal and ring meet (35 mm).
#[test]
fn invariant_normals_stay_right_to_40_mm() {
    let scene = Scene::new(&common::apas());
    let at = |y: f64| common::pose(0.10, y, 0.0, [0.0; 3]);
    let mut state = ContactState::default();
    let mut y = 0.0;
    let mut first: Option<DVec3> = None;
    let mut depth = 0.0;
    let mut last_force = 0.0;
    while depth < 0.0405 {
        y += 1e-4;
        let c = scene.measure(&state, Pose::IDENTITY, at(y));
        c.commit(&mut state, DVec3::ZERO, STILL, STILL, 1e-4);
        let f = c.wrench(DVec3::ZERO, STILL, STILL, 1e-4).0.f;
        depth = c.deepest_m();
        if depth > 1e-3 {
            let n = f.normalize();
            let n0 = *first.get_or_insert(n);
            assert!(n.dot(n0) > 0.8, "depth {depth}: {n} against {n0}");
            assert!(f.length() > last_force * 0.98, "depth {depth}: force fell");
        }
        last_force = f.length();
        assert!(y < 0.3, "depth stays at {depth}");
    }
}

/// Three petals of each side interleave when docked and nothing touches.
#[test]
fn oracle_docked_rings_meet_without_petals_touching() {
    let scene = Scene::new(&common::apas());
    assert!(deepest(&scene, common::pose(0.0505, 0.0, 0.0, [0.0; 3])) < 1e-12);
    assert!(deepest(&scene, common::pose(0.0495, 0.0, 0.0, [0.0; 3])) > 3e-4);
}

/// Rings: coaxial contact is one place with stiffness k acting along the axis; crossed rings are two
/// places.
#[test]
fn oracle_rings_face_to_face_and_crossed() {
    let mut m = common::bare_rings();
    m.contact.friction_kinetic = 0.0;
    m.contact.friction_static = 0.0;
    let scene = Scene::new(&m);
    let w = wrench(&scene, common::pose(0.049, 0.0, 0.0, [0.0; 3]));
    // Equal depths all around are one place, neither deeper nor stiffer.
    let deeper = wrench(&scene, common::pose(0.048, 0.0, 0.0, [0.0; 3]));
    assert!(((deeper.f.x - w.f.x) / 1e3 - 1.0).abs() < 1e-9, "k = {}", (deeper.f.x - w.f.x) / 1e-3);
    assert!(w.m.length() < 1e-9 * w.f.x && w.f.y.hypot(w.f.z) < 1e-9 * w.f.x);
    let a = wrench(&scene, common::pose(0.048, 0.1, 0.0, [0.0; 3]));
    let b = wrench(&scene, common::pose(0.047, 0.1, 0.0, [0.0; 3]));
    let k = (b.f.x - a.f.x) / 1e-3;
    assert!((k / 2e6 - 1.0).abs() < 0.05, "two places: {k}");
}

/// The stored energy is a potential: forces are its gradient, at poses with several places at once.
#[test]
fn invariant_forces_derive_from_the_stored_energy() {
    let mut m = common::apas();
    m.contact.friction_kinetic = 0.0;
    m.contact.friction_static = 0.0;
    let scene = Scene::new(&m);
    let poses = [
        common::pose(0.20, 0.10, 0.03, [5.0, -3.0, 4.0]),
        common::pose(0.12, 0.02, 0.01, [0.0, 1.0, -2.0]),
        common::pose(0.048, 0.004, -0.01, [1.0, 0.2, 0.0]),
        common::pose(0.25, -0.08, 0.12, [15.0, 7.0, -7.0]),
        common::pose(0.42, 0.0, 0.05, [40.0, 0.0, 0.0]),
        common::pose(0.0485, 0.0108, 0.0, [0.0, 0.0, 0.0]),
    ];
    for (i, x) in poses.into_iter().enumerate() {
        let mut x = x;
        while deepest(&scene, x) < 2e-3 {
            x.p.x -= 2e-4;
        }
        let energy =
            |x: Pose| scene.measure(&ContactState::default(), Pose::IDENTITY, x).stored_j();
        let w = wrench(&scene, x);
        let h = 1e-7;
        let gradient =
            |move_by: &dyn Fn(f64) -> Pose| -(energy(move_by(h)) - energy(move_by(-h))) / (2.0 * h);
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let f = axes.map(|e| gradient(&|s| Pose::new(x.p + e * s, x.q)));
        let m = axes.map(|e| {
            gradient(&|s| {
                let q = docktwin_core::DQuat::from_scaled_axis(e * s);
                Pose::new(q * x.p, q * x.q)
            })
        });
        let (f, m) = (DVec3::from_array(f), DVec3::from_array(m));
        let ef = (f - w.f).length() / w.f.length();
        let em = (m - w.m).length() / w.m.length().max(0.3 * w.f.length());
        println!(
            "pose {i}: force {:.0} N, off by {:.2e}; moment off by {:.2e}",
            w.f.length(),
            ef,
            em
        );
        assert!(ef < 1e-6 && em < 1e-6, "pose {i}: {f} {} / {m} {}", w.f, w.m);
    }
}

/// The force grows from zero: at the very first touch no pair jumps in with a part of it.
#[test]
fn invariant_the_force_begins_at_zero() {
    for with_petals in [false, true] {
        let mut m = if with_petals { common::apas() } else { common::bare_rings() };
        // Smooth extremes that reach far make the jump, if there is one, easy to see.
        m.contact.merge_depth_m = 5e-4;
        let scene = Scene::new(&m);
        for (y, euler) in [(0.0, [0.0; 3]), (0.05, [2.0, 2.0, 0.0]), (0.02, [40.0, 3.0, 0.0])] {
            let mut x = common::pose(0.45, y, 0.0, euler);
            let mut state = ContactState::default();
            while {
                let c = scene.measure(&state, Pose::IDENTITY, x);
                c.commit(&mut state, DVec3::ZERO, STILL, STILL, 1e-4);
                !c.touching()
            } {
                x.p.x -= 1e-6;
                assert!(x.p.x > 0.0, "never touches");
            }
            let f = wrench(&scene, x).f.length();
            assert!(f < 3.0, "petals {with_petals}, offset {y}: the force begins with {f} N");
        }
    }
}
