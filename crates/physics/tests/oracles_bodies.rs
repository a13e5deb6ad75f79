//! Free rigid bodies against published numbers and invariants (physics notes §2).
mod common;

use docktwin_core::{DMat3, DVec3, Pose, Twist, Wrench};
use docktwin_physics::body::{BodyPair, BodyState, Composition, MassProperties};

fn spin(inertia: DVec3, w: DVec3) -> (MassProperties, BodyState) {
    let m = MassProperties::new(1.0, DMat3::from_diagonal(inertia));
    (m, BodyState::new(&m, Pose::IDENTITY, DVec3::ZERO, w))
}

#[test]
fn oracle_nesc_check_case_2() {
    let inertia = DVec3::new(0.001_894_220, 0.006_211_019, 0.007_194_665);
    let deg = core::f64::consts::PI / 180.0;
    let (m, mut b) = spin(inertia, DVec3::new(10.0, 20.0, 30.0) * deg);
    for _ in 0..30_000 {
        b.drift(&m, 1e-3);
    }
    let w = b.rate_body(&m) / deg;
    let want = DVec3::new(12.618_390_775_91, -17.397_474_761_61, 31.119_588_886_94);
    assert!((w - want).length() < 1e-6, "{w} against {want}");
}

#[test]
fn oracle_dzhanibekov_period() {
    let (m, mut b) = spin(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.01, 2.0, 0.01));
    // Two flips make a full period; find when ω_y comes back through its start from below.
    let h = 1e-3;
    let mut crossings = Vec::new();
    let mut last = b.rate_body(&m);
    for i in 0..30_000 {
        b.drift(&m, h);
        let w = b.rate_body(&m);
        if last.y < 0.0 && w.y >= 0.0 || last.y > 0.0 && w.y <= 0.0 {
            crossings.push((f64::from(i) + last.y / (last.y - w.y)) * h);
        }
        last = w;
    }
    let period = crossings[2] - crossings[0];
    assert!((period - 21.955_146).abs() < 2e-5, "{period}");
}

#[test]
fn oracle_order_four_in_smooth_motion() {
    // Two bodies on a damped spring off their mass centres, and a torque: nothing is symmetric.
    let mass = [
        MassProperties::new(8.0, DMat3::from_diagonal(DVec3::new(3.0, 5.0, 6.0))),
        MassProperties::new(12.0, DMat3::from_diagonal(DVec3::new(4.0, 9.0, 10.0))),
    ];
    let run = |composition, n: u32| {
        let state = [
            BodyState::new(
                &mass[0],
                Pose::IDENTITY,
                DVec3::new(0.1, 0.0, 0.0),
                DVec3::new(0.3, 0.2, -0.1),
            ),
            BodyState::new(
                &mass[1],
                common::pose(1.0, 0.1, 0.0, [10.0, 5.0, 3.0]),
                DVec3::new(-0.1, 0.05, 0.0),
                DVec3::new(-0.2, 0.1, 0.3),
            ),
        ];
        let mut pair = BodyPair { mass, state, composition };
        let h = 2.0 / f64::from(n);
        for _ in 0..n {
            pair.step(h, |_, s, t| {
                let arm = [s[0].q * DVec3::new(0.4, 0.1, 0.0), s[1].q * DVec3::new(-0.4, 0.0, 0.1)];
                let gap = s[1].p + arm[1] - s[0].p - arm[0];
                let at = |i: usize| t[i].v + t[i].w.cross(arm[i]);
                let f = gap * 40.0 + (at(1) - at(0)) * 0.5;
                [Wrench::at(arm[0], f), Wrench::at(arm[1], -f)]
            });
        }
        pair.state
    };
    let error = |a: &[BodyState; 2], b: &[BodyState; 2]| {
        (a[0].p - b[0].p).length() + (a[1].l - b[1].l).length()
    };
    let truth = run(Composition::Suzuki4, 6400);
    let e = [100, 200].map(|n| error(&run(Composition::Suzuki4, n), &truth));
    let order = (e[0] / e[1]).log2();
    assert!(order > 3.7, "errors {e:?}, order {order}");
    let e2 = [100, 200].map(|n| error(&run(Composition::Leapfrog, n), &truth));
    let order = (e2[0] / e2[1]).log2();
    assert!((order - 2.0).abs() < 0.2, "errors {e2:?}, order {order}");
}

#[test]
fn invariant_momentum_of_a_pair_under_equal_and_opposite_forces() {
    let mass = [
        MassProperties::new(8000.0, common::cylinder(8000.0, 1.35, 7.0)),
        MassProperties::new(12000.0, common::cylinder(12000.0, 1.5, 9.0)),
    ];
    let state = [
        BodyState::new(
            &mass[0],
            Pose::IDENTITY,
            DVec3::new(0.05, 0.01, 0.0),
            DVec3::new(0.0, 0.001, 0.002),
        ),
        BodyState::new(
            &mass[1],
            Pose::from_translation(DVec3::X * 8.0),
            DVec3::new(-0.03, 0.0, 0.0),
            DVec3::new(0.002, 0.0, -0.001),
        ),
    ];
    let mut pair = BodyPair { mass, state, composition: Composition::Suzuki4 };
    let total = |p: &BodyPair| {
        let mut w = Wrench::ZERO;
        for (s, m) in p.state.iter().zip(&p.mass) {
            w.push(s.p, s.v * m.mass());
            w.m += s.l;
        }
        w
    };
    let before = total(&pair);
    let scale = (pair.state[0].v * 8000.0).length();
    for _ in 0..1000 {
        pair.step(1e-3, |t, s, _: &[Twist; 2]| {
            // One second of a wandering force at a common point.
            let point = (s[0].p + s[1].p) * 0.5 + DVec3::new(0.0, 0.6 * t.sin(), 0.2);
            let f = DVec3::new(3000.0, 200.0 * (9.0 * s[0].p.x).cos(), -150.0);
            [Wrench::at(point - s[0].p, -f), Wrench::at(point - s[1].p, f)]
        });
    }
    let after = total(&pair);
    assert!(
        (after.f - before.f).length() < 1e-12 * scale,
        "{}",
        (after.f - before.f).length() / scale
    );
    assert!(
        (after.m - before.m).length() < 1e-12 * scale * 8.0,
        "{}",
        (after.m - before.m).length() / scale
    );
}
