//! The contact law against closed forms (physics notes §3).
mod common;

use docktwin_core::DVec3;
use docktwin_model::{ContactLaw, NormalLaw};
use docktwin_physics::contact::law;

struct Bounce {
    restitution: f64,
    contact_s: f64,
    depth_m: f64,
    force_n: f64,
}

/// A mass on the law, integrated as the twins do it: force in the middle of a drift, midpoint
/// velocity.
fn bounce(n: &NormalLaw, mass: f64, v0: f64, h: f64) -> Bounce {
    let (mut x, mut v, mut t) = (0.0f64, v0, 0.0);
    let k = law::stiffness(n);
    let mut out = Bounce { restitution: 0.0, contact_s: 0.0, depth_m: 0.0, force_n: 0.0 };
    let mut last = (0.0, v0);
    while x >= 0.0 {
        last = (x, v);
        x += 0.5 * h * v;
        let elastic = law::elastic_force(n, k, x);
        let (v1, mut mid) = (v, v);
        let mut f = 0.0;
        for _ in 0..6 {
            f = if x > 0.0 { law::normal_force(n, elastic, mid).total_n } else { 0.0 };
            mid = v1 - 0.5 * h * f / mass;
        }
        v -= h * f / mass;
        out.force_n = out.force_n.max(f);
        out.depth_m = out.depth_m.max(x);
        x += 0.5 * h * v;
        t += h;
        assert!(t < 10.0, "never came out");
    }
    out.contact_s = t - h + h * last.0 / (last.0 - x);
    out.restitution = -v / v0;
    out
}

fn hc(stiffness: f64, exponent: f64, damping_s_m: f64) -> NormalLaw {
    NormalLaw::HuntCrossley { stiffness, exponent, damping_s_m }
}

#[test]
fn oracle_hunt_crossley_restitution_for_any_exponent() {
    // ln((1+d)/(1−e d)) = d(1+e), d = a v.
    for (d, e) in
        [(0.05, 0.967_74), (0.1, 0.937_48), (0.2, 0.882_19), (0.5, 0.748_43), (1.0, 0.593_62)]
    {
        for n in [1.0, 1.5] {
            let v = 0.1;
            let k = if n > 1.2 { 1e9 } else { 1e6 };
            let got = bounce(&hc(k, n, d / v), 4800.0, v, 2e-6).restitution;
            let residual = ((1.0 + d) / (1.0 - got * d)).ln() - d * (1.0 + got);
            assert!(residual.abs() < 2e-6, "n {n} d {d}: {got} residual {residual}");
            assert!((got - e).abs() < 1e-5, "n {n} d {d}: {got} {e}");
        }
    }
}

#[test]
fn oracle_kelvin_voigt_without_pulling() {
    let (m, k) = (4800.0, 1e6f64);
    let w = (k / m).sqrt();
    for (zeta, print) in [(0.05f64, 0.8588), (0.2, 0.5717)] {
        let c = 2.0 * zeta * w * m;
        let b = bounce(&NormalLaw::KelvinVoigt { stiffness: k, damping_n_s_m: c }, m, 0.35, 2e-6);
        let root = (1.0 - zeta * zeta).sqrt();
        let phi = (2.0 * zeta * root).atan2(2.0 * zeta * zeta - 1.0);
        let e = (-zeta * phi / root).exp();
        assert!((b.restitution - e).abs() < 2e-6, "{} {e}", b.restitution);
        assert!((e - print).abs() < 1e-4);
    }
    let c = bounce(&NormalLaw::KelvinVoigt { stiffness: k, damping_n_s_m: 4000.0 }, m, 0.35, 2e-6);
    assert!((c.restitution - 0.9148).abs() < 5e-5, "{}", c.restitution);
}

#[test]
fn oracle_eight_against_twelve_tonnes() {
    let b = bounce(&hc(1e6, 1.0, 0.0), 4800.0, 0.35, 2e-6);
    let w = (1e6f64 / 4800.0).sqrt();
    assert!((b.contact_s / (core::f64::consts::PI / w) - 1.0).abs() < 1e-6, "{}", b.contact_s);
    assert!((b.depth_m / (0.35 / w) - 1.0).abs() < 1e-6, "{}", b.depth_m);
    assert!((b.force_n / 24_248.7 - 1.0).abs() < 1e-5, "{}", b.force_n);
    assert!((b.restitution - 1.0).abs() < 1e-6);
}

#[test]
fn oracle_hertz() {
    let b = bounce(&hc(1e9, 1.5, 0.0), 4800.0, 0.1, 1e-6);
    assert!((b.depth_m / 1.291_99e-3 - 1.0).abs() < 4e-6, "{}", b.depth_m);
    assert!((b.contact_s / 38.027e-3 - 1.0).abs() < 2e-5, "{}", b.contact_s);
    assert!((b.force_n / 46.4397e3 - 1.0).abs() < 1e-5, "{}", b.force_n);
    // The closed form itself: δ = (5 m v²/(4K))^(2/5).
    let closed = (5.0 * 4800.0 * 0.01 / (4.0 * 1e9f64)).powf(0.4);
    assert!((b.depth_m / closed - 1.0).abs() < 1e-6);
}

fn friction_law(breakaway: f64) -> ContactLaw {
    ContactLaw {
        friction_kinetic: 0.2,
        friction_static: 0.2,
        bristle_breakaway_m: breakaway,
        ..common::law()
    }
}

/// Distance and time until a block that slides at 2 m/s rests (first zero of velocity).
fn sliding_block(breakaway: f64) -> (f64, f64) {
    let law = friction_law(breakaway);
    let (g, h, mass) = (9.81, 2e-5, 3.0);
    let (mut x, mut v, mut t, mut y) = (0.0, 2.0f64, 0.0, DVec3::ZERO);
    while v > 0.0 {
        let mut mid = v;
        let mut out = (DVec3::ZERO, y);
        for _ in 0..4 {
            out = law::friction(&law, mass * g, y, DVec3::X * mid, h);
            mid = v + 0.5 * h * out.0.x / mass;
        }
        y = out.1;
        v += h * out.0.x / mass;
        x += h * mid;
        t += h;
    }
    (x, t)
}

#[test]
fn oracle_sliding_block_stops_where_coulomb_says_as_the_bristle_shrinks() {
    let errors: Vec<f64> = [4e-4, 2e-4, 1e-4]
        .into_iter()
        .map(|b| {
            let (x, t) = sliding_block(b);
            (x / 1.019_37 - 1.0).abs().max((t / 1.019_37 - 1.0).abs())
        })
        .collect();
    assert!(errors[2] < 1e-3, "{errors:?}");
    assert!(errors[1] < 0.8 * errors[0] && errors[2] < 0.8 * errors[1], "{errors:?}");
}

#[test]
fn oracle_ball_slips_then_rolls_at_five_sevenths() {
    let (g, h, mass, r) = (9.81, 2e-5, 2.0, 0.1);
    let inertia = 0.4 * mass * r * r;
    let errors: Vec<f64> = [4e-4, 2e-4, 1e-4]
        .into_iter()
        .map(|b| {
            let law = friction_law(b);
            let (mut v, mut w, mut y) = (2.0f64, 0.0f64, DVec3::ZERO);
            for _ in 0..100_000 {
                let (mut vm, mut wm) = (v, w);
                let mut out = (DVec3::ZERO, y);
                for _ in 0..4 {
                    out = law::friction(&law, mass * g, y, DVec3::X * (vm - wm * r), h);
                    vm = v + 0.5 * h * out.0.x / mass;
                    wm = w - 0.5 * h * out.0.x * r / inertia;
                }
                y = out.1;
                v += h * out.0.x / mass;
                w -= h * out.0.x * r / inertia;
            }
            (v / (2.0 * 5.0 / 7.0) - 1.0).abs()
        })
        .collect();
    assert!(errors.iter().all(|e| *e < 1e-3), "{errors:?}");
}

#[test]
fn invariant_a_stuck_contact_holds_below_break_away() {
    // 0.9 μN along the surface for a second: creeps to the bristle's balance and stays.
    let law = friction_law(3e-4);
    let (mass, n, h) = (10.0, 1000.0, 1e-4);
    let push = 0.9 * 0.2 * n;
    let (mut x, mut v, mut y) = (0.0, 0.0f64, DVec3::ZERO);
    let mut at_half = 0.0;
    for i in 0..20_000 {
        let mut mid = v;
        let mut out = (DVec3::ZERO, y);
        for _ in 0..4 {
            out = law::friction(&law, n, y, DVec3::X * mid, h);
            mid = v + 0.5 * h * (out.0.x + push) / mass;
        }
        y = out.1;
        v += h * (out.0.x + push) / mass;
        x += h * mid;
        if i == 10_000 {
            at_half = x;
        }
    }
    assert!(x < 20.0 * 3e-4, "slid {x} m");
    assert!((x - at_half).abs() < 1e-6, "creeps {}", x - at_half);
}
