//! The motion simulator's platform against closed forms, finite differences and conservation laws.
use core::f64::consts::{FRAC_PI_3, PI};
use std::path::Path;

use docktwin_core::{DMat3, DQuat, DVec3, Pose, Twist, Wrench};
use docktwin_model::{Rig, load_rig};
use docktwin_physics::platform::{Configuration, ForwardError, Platform};

fn rig(name: &str) -> Rig {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(name);
    load_rig(&path).unwrap_or_else(|e| panic!("{name}: {e}")).model
}

/// Repeatable numbers in [−1, 1] (splitmix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self, size: f64) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next()) * size
    }

    fn twist(&mut self, v: f64, w: f64) -> Twist {
        Twist { v: self.vector(v), w: self.vector(w) }
    }

    fn pose(&mut self, rig: &Rig) -> Pose {
        let place = core::array::from_fn(|_| self.next());
        rig.plate_from_docking(&rig.docking.pose(place))
    }
}

fn apart(a: &Pose, b: &Pose) -> (f64, f64) {
    // asin of the vector part: acos of the scalar part loses half of the digits.
    let d = a.q.conjugate() * b.q;
    ((a.p - b.p).length(), 2.0 * DVec3::new(d.x, d.y, d.z).length().min(1.0).asin())
}

/// The pose after a time under a twist and its (constant) rate.
fn along(x: &Pose, t: &Twist, a: &Twist, time: f64) -> Pose {
    // Second order in the angle is enough for the central differences here.
    let turn = t.w * time + a.w * (0.5 * time * time);
    Pose::new(
        x.p + t.v * time + a.v * (0.5 * time * time),
        (DQuat::from_scaled_axis(turn) * x.q).normalize(),
    )
}

#[test]
fn oracle_round_trip_over_the_docking_workspace() {
    let rig = rig("stewart.urdf");
    let platform = Platform::new(&rig);
    let mut random = Random(1);
    let middle = platform.middle();
    let (mut worst_m, mut worst_rad, mut most, mut most_near) = (0.0_f64, 0.0_f64, 0, 0);
    let mut last = middle;
    for _ in 0..100_000 {
        let x = random.pose(&rig);
        let lengths = platform.at(&x).length_m;
        // From the middle: far beyond what a tick can move.
        let found = platform.forward(&lengths, &middle).expect("found from the middle");
        let (m, rad) = apart(&found.x_bp, &x);
        (worst_m, worst_rad) = (worst_m.max(m), worst_rad.max(rad));
        most = most.max(found.steps);
        // From a pose one tick of 1 ms away at the greatest speeds of docking.
        let near = Platform::moved(&x, &random.twist(0.5, 0.1), 1e-3);
        most_near = most_near.max(platform.forward(&lengths, &near).expect("near").steps);
        last = x;
    }
    println!("worst {worst_m:.2e} m, {worst_rad:.2e} rad; steps {most}, from one tick {most_near}");
    assert!(worst_m <= 1e-9 && worst_rad <= 1e-9, "{worst_m:e} m, {worst_rad:e} rad");
    assert!(most <= 5, "{most} steps");
    assert!(most_near <= 3, "{most_near} steps within one tick");
    assert!(last.is_finite());
}

#[test]
fn regress_forward_kinematics_says_when_there_is_no_pose() {
    let platform = Platform::new(&rig("stewart.urdf"));
    // Five legs of 4 m and one of 40 m: no plate fits.
    let lengths = [4.0, 4.0, 40.0, 4.0, 4.0, 4.0];
    let got = platform.forward(&lengths, &platform.middle());
    assert!(matches!(got, Err(ForwardError::NotFound { .. } | ForwardError::Singular)), "{got:?}");
    let got = platform.forward(&[f64::NAN; 6], &platform.middle());
    assert!(got.is_err(), "{got:?}");
}

#[test]
fn invariant_mounting_goes_both_ways() {
    for name in ["stewart.urdf", "stewart_statics.urdf"] {
        let rig = rig(name);
        let platform = Platform::new(&rig);
        let mut random = Random(2);
        for _ in 0..1000 {
            let place = core::array::from_fn(|_| random.next());
            let x_34 = rig.docking.pose(place);
            let x_bp = platform.plate_from_docking(&x_34);
            // X_0p = X_03 X_34 X_4p.
            let x_0p = rig.x_b0.inverse() * x_bp;
            let (m, rad) = apart(&x_0p, &(rig.x_03 * x_34 * rig.x_4p));
            assert!(m < 1e-12 && rad < 1e-12, "{name}: {m:e} {rad:e}");
            let (m, rad) = apart(&platform.docking_from_plate(&x_bp), &x_34);
            assert!(m < 1e-12 && rad < 1e-12, "{name}: {m:e} {rad:e}");

            // Twists and accelerations against central differences of the poses.
            let (t, a) = (random.twist(0.5, 0.5), random.twist(2.0, 2.0));
            let h = 1e-4;
            let at = |s: f64| platform.plate_from_docking(&along(&x_34, &t, &a, s));
            let got = platform.plate_twist(&x_34, &t);
            let v = (at(h).p - at(-h).p) / (2.0 * h);
            assert!((v - got.v).length() < 1e-6, "{name}: {v} {}", got.v);
            let back = platform.docking_twist(&x_bp, &got);
            assert!((back.v - t.v).length() < 1e-12 && (back.w - t.w).length() < 1e-12);
            let acceleration = platform.plate_acceleration(&x_34, &t, &a);
            let num = (at(h).p - 2.0 * at(0.0).p + at(-h).p) / (h * h);
            assert!((num - acceleration.v).length() < 1e-5, "{name}: {num} {}", acceleration.v);

            // A wrench at the port does the same work, seen from either side.
            let port = Wrench { f: random.vector(1e3), m: random.vector(1e3) };
            let w = platform.wrench_from_port(&x_bp, &port);
            let in_e4 = Twist { v: x_34.q.conjugate() * t.v, w: x_34.q.conjugate() * t.w };
            let power_port = port.f.dot(in_e4.v) + port.m.dot(in_e4.w);
            let power = w.f.dot(got.v) + w.m.dot(got.w);
            assert!((power - power_port).abs() < 1e-9, "{name}: {power} {power_port}");
        }
    }
}

/// The rig of the closed forms, its legs without mass.
fn massless(mut rig: Rig) -> Rig {
    for leg in &mut rig.legs {
        for part in [&mut leg.cylinder, &mut leg.rod] {
            (part.mass_kg, part.axial_kg_m2, part.transverse_kg_m2) = (0.0, 0.0, 0.0);
        }
        leg.cross_inertia_kg_m2 = DMat3::ZERO;
    }
    rig
}

fn standing_still(rig: &Rig) -> [f64; 6] {
    let platform = Platform::new(rig);
    let c = platform.at(&rig.middle());
    platform
        .inverse_dynamics(&c, &Twist::default(), &Twist::default(), &Wrench::ZERO)
        .expect("not singular")
}

#[test]
fn oracle_statics() {
    let with_legs = rig("stewart_statics.urdf");
    let check = |rig: &Rig, want: f64| {
        let forces = standing_still(rig);
        println!("{forces:?}");
        for f in forces {
            assert!((f - want).abs() < 0.01, "{f} against {want}");
        }
    };
    check(&with_legs, 4787.55);
    let mut rig = massless(with_legs);
    check(&rig, 4568.27);
    // Not turned by 60°: the lines of all legs meet in one point, so the pose is singular, and equal
    // forces are one answer of many. That they carry the plate is what the figure says.
    for (i, leg) in rig.legs.iter_mut().enumerate() {
        let side = if i % 2 == 0 { -1.0 } else { 1.0 };
        let azimuth = (i / 2) as f64 * 2.0 * FRAC_PI_3 + side * 12.0 * PI / 180.0;
        leg.plate_joint_m = DVec3::new(0.0, azimuth.cos(), azimuth.sin()) * 1.2;
    }
    let platform = Platform::new(&rig);
    let c = platform.at(&rig.middle());
    assert!(platform.singularity(&c) < 1e-7, "{}", platform.singularity(&c));
    let w = c.wrench(&[4291.68; 6]);
    assert!((w.f - DVec3::X * 2500.0 * 9.81).length() < 0.01 && w.m.length() < 1e-9, "{w:?}");
}

#[test]
fn oracle_weight_hangs_on_the_default_rig() {
    let rig = rig("stewart.urdf");
    let forces = standing_still(&massless(rig.clone()));
    // The plate hangs: every leg pulls with m g / 6 over the cosine of its inclination.
    let want = -rig.plate.mass_kg * 9.81 / 6.0 * rig.legs[0].middle_length_m / 3.0;
    for f in forces {
        assert!((f - want).abs() < 0.01, "{f} against {want}");
    }
}

#[test]
fn oracle_jacobian_and_accelerations_by_finite_differences() {
    let rig = rig("stewart.urdf");
    let platform = Platform::new(&rig);
    let mut random = Random(3);
    for _ in 0..1000 {
        let x = random.pose(&rig);
        let c = platform.at(&x);
        let (t, a) = (random.twist(0.5, 0.3), random.twist(5.0, 5.0));
        let (rates, accelerations) = (c.rates(&t), c.accelerations(&t, &a));
        let h = 1e-4;
        let at = |s: f64| platform.at(&along(&x, &t, &a, s)).length_m;
        let (before, here, after) = (at(-h), c.length_m, at(h));
        for i in 0..6 {
            let rate = (after[i] - before[i]) / (2.0 * h);
            assert!((rate - rates[i]).abs() < 1e-7, "{rate} {}", rates[i]);
            let second = (after[i] - 2.0 * here[i] + before[i]) / (h * h);
            assert!((second - accelerations[i]).abs() < 1e-5, "{second} {}", accelerations[i]);
        }
        let six = nalgebra::Vector6::new(t.v.x, t.v.y, t.v.z, t.w.x, t.w.y, t.w.z);
        let by_matrix = c.jacobian() * six;
        for i in 0..6 {
            assert!((by_matrix[i] - rates[i]).abs() < 1e-12);
        }
        let back = c.twist(&rates).expect("not singular");
        assert!((back.v - t.v).length() < 1e-12 && (back.w - t.w).length() < 1e-12);
    }
}

#[test]
fn oracle_virtual_work() {
    let rig = rig("stewart.urdf");
    let platform = Platform::new(&rig);
    let mut random = Random(4);
    for _ in 0..1000 {
        let c = platform.at(&random.pose(&rig));
        let t = random.twist(0.5, 0.3);
        let forces: [f64; 6] = core::array::from_fn(|_| 1e4 * random.next());
        let w = c.wrench(&forces);
        let legs: f64 = forces.iter().zip(c.rates(&t)).map(|(f, r)| f * r).sum();
        let plate = w.f.dot(t.v) + w.m.dot(t.w);
        assert!((legs - plate).abs() < 1e-9 * 1e4, "{legs} {plate}");
        let back = c.leg_forces(&w).expect("not singular");
        for i in 0..6 {
            assert!((back[i] - forces[i]).abs() < 1e-7, "{} {}", back[i], forces[i]);
        }
    }
}

/// Kinetic energy of one leg from its three bodies: velocities of their mass centres and angular
/// velocities by central differences of the joint angles and the stroke, nothing of the reduced
/// rig's algebra.
fn leg_energy(rig: &Rig, i: usize, before: &Pose, here: &Pose, after: &Pose, h: f64) -> f64 {
    let leg = &rig.legs[i];
    let joints = |x: &Pose| {
        let v = leg.vector(x);
        let [q1, q2] = leg.universal_angles(v);
        (q1, q2, v.length())
    };
    let frame = |(q1, q2, _): (f64, f64, f64)| {
        DMat3::from_quat(leg.x_b_leg.q) * DMat3::from_rotation_z(q1) * DMat3::from_rotation_y(q2)
    };
    let (b, c, a) = (joints(before), joints(here), joints(after));
    let rate = |x: f64, y: f64| (y - x) / (2.0 * h);
    let (q1, q2) = (rate(b.0, a.0), rate(b.1, a.1));
    let r = frame(c);
    // ω = q̇1 a1 + q̇2 a2, a2 the leg's Y.
    let w = leg.swing_axis() * q1 + r.y_axis * q2;
    let w_leg = r.transpose() * w;
    let turning = |axial: f64, across: f64| {
        0.5 * (axial * w_leg.x.powi(2) + across * (w_leg.y.powi(2) + w_leg.z.powi(2)))
    };
    let moving = |at: &dyn Fn((f64, f64, f64)) -> DVec3, mass: f64| {
        let v = (at(a) - at(b)) / (2.0 * h);
        0.5 * mass * v.length_squared()
    };
    let (cyl, rod) = (&leg.cylinder, &leg.rod);
    moving(&|j| frame(j).x_axis * cyl.com_m, cyl.mass_kg)
        + turning(cyl.axial_kg_m2, cyl.transverse_kg_m2)
        + moving(&|j| frame(j).x_axis * (j.2 - rod.com_m), rod.mass_kg)
        + turning(rod.axial_kg_m2, rod.transverse_kg_m2)
        + 0.5 * leg.cross_inertia_kg_m2.z_axis.z * q1 * q1
}

#[test]
fn oracle_kinetic_energy_is_that_of_the_bodies() {
    let mut rig = rig("stewart.urdf");
    // Heavy crosses and fat legs, so that their share can be seen.
    for leg in &mut rig.legs {
        leg.cross_inertia_kg_m2 = DMat3::from_diagonal(DVec3::splat(300.0));
        leg.cylinder.axial_kg_m2 = 500.0;
        leg.rod.axial_kg_m2 = 200.0;
    }
    let platform = Platform::new(&rig);
    let mut random = Random(5);
    for _ in 0..200 {
        // Far from the middle, so that legs lean over both axes.
        let mut x = random.pose(&rig);
        x.p += random.vector(0.8);
        let t = random.twist(1.0, 0.5);
        let h = 1e-5;
        let (before, after) = (Platform::moved(&x, &t, -h), Platform::moved(&x, &t, h));
        let com = (after.transform_point(rig.plate.com_m)
            - before.transform_point(rig.plate.com_m))
            / (2.0 * h);
        let w = x.q.conjugate() * t.w;
        let plate = 0.5 * rig.plate.mass_kg * com.length_squared()
            + 0.5 * w.dot(rig.plate.inertia_kg_m2 * w);
        let legs: f64 = (0..6).map(|i| leg_energy(&rig, i, &before, &x, &after, h)).sum();
        let got = platform.kinetic_energy_j(&platform.at(&x), &t);
        assert!((got - plate - legs).abs() < 1e-7 * got, "{got} against {plate} + {legs}");
        assert!(legs > 0.05 * got, "the legs' share must be seen: {legs} of {got}");
    }
}

/// A free motion of the reduced rig on lossless springs, in small steps of Runge–Kutta.
struct Swing {
    platform: Platform,
    spring_n_m: f64,
    rest_m: [f64; 6],
    x: Pose,
    t: Twist,
}

impl Swing {
    fn forces(&self, c: &Configuration) -> [f64; 6] {
        core::array::from_fn(|i| -self.spring_n_m * (c.length_m[i] - self.rest_m[i]))
    }

    fn acceleration(&self, x: &Pose, t: &Twist) -> Twist {
        let c = self.platform.at(x);
        self.platform
            .forward_dynamics(&c, t, &self.forces(&c), &Wrench::ZERO)
            .expect("a mass matrix is positive definite")
    }

    fn step(&mut self, h: f64) {
        // The attitude as a quaternion with q' = ½ ω q, without renormalisation inside the step.
        type Rate = (DVec3, DQuat, Twist);
        let rate = |x: &Pose, t: &Twist| -> Rate {
            let w = DQuat::from_xyzw(t.w.x, t.w.y, t.w.z, 0.0);
            (t.v, w * x.q * 0.5, self.acceleration(x, t))
        };
        let go = |r: &Rate, h: f64| {
            let x = Pose::new(self.x.p + r.0 * h, self.x.q + r.1 * h);
            let t = Twist { v: self.t.v + r.2.v * h, w: self.t.w + r.2.w * h };
            (Pose::new(x.p, x.q.normalize()), t)
        };
        let k1 = rate(&self.x, &self.t);
        let (x, t) = go(&k1, 0.5 * h);
        let k2 = rate(&x, &t);
        let (x, t) = go(&k2, 0.5 * h);
        let k3 = rate(&x, &t);
        let (x, t) = go(&k3, h);
        let k4 = rate(&x, &t);
        let mean = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (a + 2.0 * b + 2.0 * c + d) / 6.0;
        let all = (
            mean(k1.0, k2.0, k3.0, k4.0),
            (k1.1 + k2.1 * 2.0 + k3.1 * 2.0 + k4.1) * (1.0 / 6.0),
            Twist {
                v: mean(k1.2.v, k2.2.v, k3.2.v, k4.2.v),
                w: mean(k1.2.w, k2.2.w, k3.2.w, k4.2.w),
            },
        );
        (self.x, self.t) = go(&all, h);
    }

    fn energy(&self) -> f64 {
        let c = self.platform.at(&self.x);
        let spring: f64 =
            (0..6).map(|i| 0.5 * self.spring_n_m * (c.length_m[i] - self.rest_m[i]).powi(2)).sum();
        spring + self.platform.kinetic_energy_j(&c, &self.t) + self.platform.potential_energy_j(&c)
    }
}

#[test]
fn invariant_free_motion_keeps_its_energy() {
    let rig = rig("stewart.urdf");
    // Soft springs swing through most of the docking workspace, where every centrifugal term counts;
    // the oil springs of the printed preset are the acceptance of the whole.
    for (spring_n_m, h, w) in [(1e5, 1e-3, 0.3), (2.76e7, 2e-4, 0.1)] {
        let platform = Platform::new(&rig);
        let middle = platform.middle();
        let mut swing = Swing {
            rest_m: platform.at(&middle).length_m,
            platform,
            spring_n_m,
            x: middle,
            t: Twist { v: DVec3::new(0.3, 0.5, -0.4), w: DVec3::new(w, -0.2, 0.25) },
        };
        let start = swing.energy();
        let kinetic = swing.platform.kinetic_energy_j(&swing.platform.at(&swing.x), &swing.t);
        let (mut worst, mut farthest) = (0.0_f64, 0.0_f64);
        let steps = (10.0 / h) as u32;
        for n in 0..steps {
            swing.step(h);
            if n % 10 == 0 {
                worst = worst.max((swing.energy() - start).abs());
                farthest = farthest.max((swing.x.p - middle.p).length());
            }
        }
        println!(
            "{spring_n_m:e} N/m: {:.2e} of the kinetic energy {kinetic:.1} J, {farthest:.3} m",
            worst / kinetic
        );
        assert!(worst < 1e-5 * kinetic, "{worst} J of {kinetic} J");
        assert!(spring_n_m > 1e6 || farthest > 0.15, "it must move: {farthest} m");
    }
}

#[test]
fn invariant_passivity() {
    let rig = rig("stewart.urdf");
    let platform = Platform::new(&rig);
    let mut random = Random(6);
    for _ in 0..500 {
        let x = random.pose(&rig);
        let c = platform.at(&x);
        let m = platform.mass_matrix(&c);
        assert!((m - m.transpose()).amax() < 1e-9 * m.amax());
        assert!(m.symmetric_eigenvalues().min() > 0.0);
        // ½ tᵀ Ṁ t is the power of the Coriolis and centrifugal wrench.
        let t = random.twist(0.5, 0.5);
        let h = 1e-5;
        let energy =
            |s: f64| platform.kinetic_energy_j(&platform.at(&Platform::moved(&x, &t, s)), &t);
        let half_change = (energy(h) - energy(-h)) / (2.0 * h);
        let w = platform.coriolis(&c, &t);
        let power = w.f.dot(t.v) + w.m.dot(t.w);
        assert!((power - half_change).abs() < 1e-5 * (1.0 + power.abs()), "{power} {half_change}");
    }
}

#[test]
fn invariant_forward_and_inverse_dynamics_undo_each_other() {
    let rig = rig("stewart.urdf");
    let platform = Platform::new(&rig);
    let mut random = Random(7);
    for _ in 0..500 {
        let c = platform.at(&random.pose(&rig));
        let (t, a) = (random.twist(0.5, 0.5), random.twist(8.0, 8.0));
        let external = Wrench { f: random.vector(2e4), m: random.vector(5e3) };
        let forces = platform.inverse_dynamics(&c, &t, &a, &external).expect("not singular");
        let back = platform.forward_dynamics(&c, &t, &forces, &external).expect("definite");
        assert!((back.v - a.v).length() < 1e-9 && (back.w - a.w).length() < 1e-9);
    }
}

#[test]
fn oracle_inverse_dynamics_is_lagranges_equations() {
    // By finite differences of T − V in six coordinates, position and rotation vector: energy alone
    // does not see gyroscopic terms.
    let mut rig = rig("stewart.urdf");
    for leg in &mut rig.legs {
        leg.cross_inertia_kg_m2 = DMat3::from_diagonal(DVec3::splat(50.0));
        leg.cylinder.axial_kg_m2 = 100.0;
    }
    rig.plate.inertia_kg_m2 = DMat3::from_diagonal(DVec3::new(2800.0, 1600.0, 1900.0));
    let platform = Platform::new(&rig);
    let mut random = Random(8);
    for _ in 0..200 {
        let mut x = random.pose(&rig);
        x.p += random.vector(0.5);
        let (t, a) = (random.twist(0.8, 0.8), random.twist(5.0, 5.0));
        let lagrangian = |q: &Twist, rate: &Twist| {
            let pose = Pose::new(x.p + q.v, (DQuat::from_scaled_axis(q.w) * x.q).normalize());
            // ω = (1 + ½ θ× + ⅙ θ×² + …) θ'.
            let once = q.w.cross(rate.w);
            let w = rate.w + 0.5 * once + q.w.cross(once) / 6.0;
            let c = platform.at(&pose);
            platform.kinetic_energy_j(&c, &Twist { v: rate.v, w }) - platform.potential_energy_j(&c)
        };
        let unit = |i: usize, size: f64| {
            let e = |from: usize| {
                DVec3::from_array(core::array::from_fn(|k| if k + from == i { size } else { 0.0 }))
            };
            Twist { v: e(0), w: e(3) }
        };
        let plus = |a: &Twist, b: &Twist| Twist { v: a.v + b.v, w: a.w + b.w };
        let scaled = |a: &Twist, k: f64| Twist { v: a.v * k, w: a.w * k };
        let h = 1e-4;
        let want: [f64; 6] = core::array::from_fn(|i| {
            // The energy is quadratic in the rates: a wide difference is exact.
            let momentum = |s: f64| {
                let q = plus(&scaled(&t, s), &scaled(&a, 0.5 * s * s));
                let rate = plus(&t, &scaled(&a, s));
                let side = |d: f64| lagrangian(&q, &plus(&rate, &unit(i, d)));
                0.5 * (side(1.0) - side(-1.0))
            };
            let side = |d: f64| lagrangian(&unit(i, d), &t);
            (momentum(h) - momentum(-h)) / (2.0 * h) - (side(h) - side(-h)) / (2.0 * h)
        });
        let c = platform.at(&x);
        let forces = platform.inverse_dynamics(&c, &t, &a, &Wrench::ZERO).expect("not singular");
        let w = c.wrench(&forces);
        for (got, want) in w.f.to_array().into_iter().chain(w.m.to_array()).zip(want) {
            assert!((got - want).abs() < 1e-2, "{got} against {want}");
        }
    }
}
