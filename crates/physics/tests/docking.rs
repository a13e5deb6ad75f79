//! Whole dockings with the default mechanism: what nature conserves, the twin conserves.
mod common;

use docktwin_physics::{
    mechanism::{CHASER, System},
    reduced::Inputs,
};

#[test]
fn invariant_momentum_and_energy_through_capture() {
    // Speed m/s, lateral offset m, roll, pitch, yaw in degrees.
    for (v, dy, euler) in [
        (0.05, 0.05, [2.0, 2.0, 0.0]),
        (0.10, 0.05, [2.0, 2.0, 0.0]),
        (0.35, 0.05, [15.0, 7.0, 0.0]),
        (0.10, 0.10, [4.0, 4.0, 0.0]),
    ] {
        let system = System::new(&common::chaser(), &common::target(), common::apas());
        let mut s = common::start(&system, &common::conditions(v, dy, 0.0, euler), 0.02);
        let (p0, body) = (system.momentum(&s), s.bodies[CHASER]);
        let p = body.v * system.mass()[CHASER].mass();
        let scale = (p.length(), (body.p.cross(p) + body.l).length());
        let look = |s: &_| system.energy(s, &system.measure(&s.mechanism, &s.poses()));
        let e0 = look(&s);
        let (mut energy, mut linear, mut angular) = (0.0f64, 0.0f64, 0.0f64);
        let (seconds, h) = (10, 1e-4);
        for i in 0..seconds * 10_000 {
            system.step(&mut s, &Inputs::default(), h);
            if i % 10 == 0 {
                let e = look(&s);
                energy = energy.max(((e.kinetic + e.stored + e.lost) / e0.kinetic - 1.0).abs());
                let now = system.momentum(&s);
                linear = linear.max((now.f - p0.f).length() / scale.0);
                angular = angular.max((now.m - p0.m).length() / scale.1);
            }
        }
        println!(
            "{v} m/s: energy {energy:.1e}, momentum {:.1e} and {:.1e} a second, captured {:?}",
            linear / f64::from(seconds),
            angular / f64::from(seconds),
            s.mechanism.captured_s()
        );
        assert!(s.mechanism.captured_s().is_some(), "{v} m/s: not captured");
        assert!(energy < 1e-3, "{v} m/s: the energy account is off by {energy:e}");
        assert!(linear < 1e-12 * f64::from(seconds), "{v} m/s: linear momentum {linear:e}");
        assert!(angular < 1e-12 * f64::from(seconds), "{v} m/s: angular momentum {angular:e}");
    }
}

/// First touches from all over the capture box: nothing jumps in the steps after them.
#[test]
fn invariant_no_touch_begins_with_a_false_depth() {
    let system = System::new(&common::chaser(), &common::target(), common::apas());
    // A small linear congruential generator: the draws are the same on every machine.
    let mut seed = 20_261_122u64;
    let mut draw = |half: f64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let bits = u32::try_from(seed >> 33).expect("31 bits");
        half * (2.0 * f64::from(bits) / f64::from(1u32 << 31) - 1.0)
    };
    let mut cases: Vec<([f64; 2], [f64; 3])> = vec![
        // Found in review: the far side of a pair of petals was taken for crossed cores.
        ([-0.083_419_364_5, 0.090_912_433_1], [-14.239_658_555, 3.211_929_104, -6.703_971_824]),
        ([-0.0837, 0.1838], [-10.756, -1.751, -0.221]),
    ];
    for _ in 0..300 {
        cases.push(([draw(0.15), draw(0.15)], [draw(15.0), draw(7.0), draw(7.0)]));
    }
    let mut touched = 0;
    for ([y, z], euler) in cases {
        let mut s = common::start(&system, &common::conditions(0.35, y, z, euler), 2e-3);
        for _ in 0..300 {
            system.step(&mut s, &Inputs::default(), 1e-4);
        }
        touched += u32::from(s.first_contact_s.is_some());
        assert!(
            s.peak_depth_m < 8e-3 && s.peak_force_n < 8e3,
            "y {y} z {z} {euler:?}: depth {} m, force {} N",
            s.peak_depth_m,
            s.peak_force_n
        );
    }
    assert!(touched > 250, "only {touched} approaches touched");
}
