//! The hydraulic leg against equation (10), and what is not in (10) against closed forms.

use core::f64::consts::TAU;

use docktwin_model::{HydraulicPreset as Preset, LegHydraulics, SealFriction, ServoValve, Spread};
use docktwin_physics::hydraulics::{
    Leg, LegParameters, LegSpread, LegState, SingleLeg, SingleLegState, friction_n,
};
use nalgebra::{Complex, SMatrix, SVector};

const MASS: f64 = 2500.0;
/// The step of the rig, 8 to a millisecond.
const STEP: f64 = 1.25e-4;

type C = Complex<f64>;

const PRESETS: [Preset; 3] = [Preset::Printed, Preset::Consistent, Preset::Stiff];

/// Table 1, written out, so that these tests do not depend on a rig file.
fn table_1(preset: Preset) -> LegParameters {
    let (total_volume_m3, leakage_m3_s_pa) = match preset {
        Preset::Printed => (0.36, 9e-12),
        Preset::Consistent => (0.15, 9e-12),
        Preset::Stiff => (0.036, 1e-9),
    };
    LegParameters {
        oil: LegHydraulics {
            area_m2: 0.06,
            total_volume_m3,
            bulk_modulus_pa: 6.9e8,
            leakage_m3_s_pa,
            viscous_n_s_m: 20.0,
        },
        valve: ServoValve {
            natural_frequency_hz: 80.0,
            damping_ratio: 0.7,
            no_load_flow_m3_s: 0.042,
            slew_per_s: 10.0,
            null_bias: 0.0,
            supply_pressure_pa: 10e6,
            dead_time_s: 0.002,
        },
        friction: SealFriction {
            coulomb_n: 500.0,
            static_n: 650.0,
            stribeck_velocity_m_s: 0.005,
            bristle_n_m: 1e7,
            bristle_damping_n_s_m: 3e4,
        },
    }
}

const SPREAD: Spread = Spread {
    flow_gain: 0.05,
    null_bias: 0.003,
    friction: 0.5,
    bulk_modulus: 0.1,
    plate_mass: 0.03,
    loop_frequency: 0.0,
    loop_damping: 0.0,
    valve_frequency: 0.05,
    dead_time_s: 0.0005,
};

/// Denominator of (10), highest power first, and `K_q/A` above it.
fn equation_10(p: &LegParameters, k: f64) -> ([f64; 4], f64) {
    let (a2, vt, be) =
        (p.oil.area_m2 * p.oil.area_m2, p.oil.total_volume_m3, p.oil.bulk_modulus_pa);
    let (kce, bc) = (p.oil.leakage_m3_s_pa, p.oil.viscous_n_s_m);
    (
        [
            vt * MASS / (4.0 * be * a2),
            MASS * kce / a2 + bc * vt / (4.0 * be * a2),
            k * vt / (4.0 * be * a2) + bc * kce / a2 + 1.0,
            k * kce / a2,
        ],
        p.valve.no_load_flow_m3_s / p.oil.area_m2,
    )
}

fn valve(p: &LegParameters, s: C) -> C {
    let w = TAU * p.valve.natural_frequency_hz;
    let x = s / w;
    (x * x + x * (2.0 * p.valve.damping_ratio) + 1.0).inv()
}

fn linear(preset: Preset, k: f64) -> SingleLeg {
    let p = table_1(preset).ideal();
    SingleLeg { leg: Leg::new(p, STEP), mass_kg: MASS, payload_n_m: k }
}

#[test]
fn oracle_natural_frequencies_of_the_presets() {
    for (preset, hz) in PRESETS.into_iter().zip([16.7, 25.9, 52.9]) {
        let f = table_1(preset).oil.natural_frequency_hz(MASS);
        assert!((f - hz).abs() < 0.06, "{preset:?}: {f}");
    }
}

/// Speeds and pressures of a step of the valve against (10) in companion form, solved exactly.
#[test]
fn oracle_a_step_follows_equation_10() {
    let mut worst: f64 = 0.0;
    for preset in PRESETS {
        for k in [0.0, 1e6] {
            let rig = linear(preset, k);
            let p = *rig.leg.parameters();
            let (d, gain) = equation_10(&p, k);
            // States: spool, its rate, y, y', y''.
            let w = TAU * p.valve.natural_frequency_hz;
            let u = 1e-3;
            let mut a = SMatrix::<f64, 6, 6>::zeros();
            a[(0, 1)] = 1.0;
            a[(1, 0)] = -w * w;
            a[(1, 1)] = -2.0 * p.valve.damping_ratio * w;
            a[(1, 5)] = w * w * u;
            a[(2, 3)] = 1.0;
            a[(3, 4)] = 1.0;
            a[(4, 0)] = gain / d[0];
            for (i, c) in [(2, d[3]), (3, d[2]), (4, d[1])] {
                a[(4, i)] = -c / d[0];
            }
            let step = (a * STEP).exp();
            let mut exact = SVector::<f64, 6>::from([0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
            let mut s = SingleLegState::default();
            let (mut y2, mut ey2, mut v2, mut ev2) = (0.0, 0.0, 0.0, 0.0);
            for _ in 0..4000 {
                rig.step(&mut s, u, 0.0);
                exact = step * exact;
                y2 += exact[2] * exact[2];
                ey2 += (s.y_m - exact[2]).powi(2);
                v2 += exact[3] * exact[3];
                ev2 += (s.v_m_s - exact[3]).powi(2);
            }
            let (ey, ev) = ((ey2 / y2).sqrt(), (ev2 / v2).sqrt());
            println!("{} K {k:e}: y {ey:.2e}, v {ev:.2e} RMS over 0.5 s", preset.word());
            worst = worst.max(ey).max(ev);
        }
    }
    assert!(worst < 0.01, "{worst}");
}

/// A swept sine from 0.5 Hz through the resonance to 100 Hz, frequency by frequency, begun in the
/// steady state that (10) gives, as the lightly damped leg would ring for a minute otherwise.
#[test]
fn oracle_a_swept_sine_follows_equation_10() {
    let mut worst: f64 = 0.0;
    for preset in PRESETS {
        for k in [0.0, 1e6] {
            let rig = linear(preset, k);
            let p = *rig.leg.parameters();
            let (d, gain) = equation_10(&p, k);
            let fh = p.oil.natural_frequency_hz(MASS);
            for f in [0.5, 1.0, 2.0, 5.0, 10.0, 0.8 * fh, 0.95 * fh, 1.05 * fh, 1.3 * fh, 100.0] {
                let s = C::new(0.0, TAU * f);
                let amp = 1e-3;
                let v = valve(&p, s);
                let g = v * gain / (s * (s * (s * d[0] + d[1]) + d[2]) + d[3]);
                // u = amp sin(ωt) = Im(amp e^{jωt}); at t = 0 every state is Im of its phasor.
                let force = g * (s * s * MASS + s * p.oil.viscous_n_s_m + k);
                let mut state = SingleLegState {
                    y_m: amp * g.im,
                    v_m_s: amp * (g * s).im,
                    leg: LegState {
                        spool: amp * v.im,
                        spool_rate_1_s: amp * (v * s).im,
                        pressure_pa: amp * force.im / p.oil.area_m2,
                        bristle_m: 0.0,
                    },
                };
                let n = (3.0 / (f * STEP)).round();
                let (mut sum, mut t) = (C::new(0.0, 0.0), 0.0);
                let omega = TAU * 3.0 / (n * STEP);
                while t < (n - 0.5) * STEP {
                    rig.step(&mut state, amp * (omega * (t + 0.5 * STEP)).sin(), 0.0);
                    t += STEP;
                    sum += C::new(0.0, -omega * t).exp() * (state.v_m_s * 2.0 / n);
                }
                // Of the speed: the integral of a sine has a constant that depends on the start.
                let measured = sum * C::new(0.0, 1.0) / (amp * s);
                let error = ((measured - g) / g).norm();
                println!("{} K {k:e} {f:6.2} Hz: {error:.2e}", preset.word());
                worst = worst.max(error);
            }
        }
    }
    assert!(worst < 0.01, "{worst}");
}

/// The load `F` of (10): its numerator `−K_ce/A² (V_t s/(4 β_e K_ce) + 1)`.
#[test]
fn oracle_a_load_compresses_the_oil_and_creeps() {
    let rig = linear(Preset::Stiff, 0.0);
    let p = *rig.leg.parameters();
    let (load, n) = (1e4, 40_000);
    let mut s = SingleLegState::default();
    for _ in 0..n {
        rig.step(&mut s, 0.0, load);
    }
    let creep = -load * p.oil.leakage_m3_s_pa / (p.oil.area_m2 * p.oil.area_m2);
    assert!((s.v_m_s / creep - 1.0).abs() < 1e-3, "{} against {creep}", s.v_m_s);
    // Way: oil compressed at once, then creep; minus what the mass lags on the way to the creep.
    let (d, _) = equation_10(&p, 0.0);
    let lag = creep * d[1];
    let t = f64::from(n) * STEP;
    let way = -load / p.oil.oil_spring_n_m() + creep * t - lag;
    assert!((s.y_m / way - 1.0).abs() < 1e-3, "{} against {way}", s.y_m);
}

#[test]
fn oracle_full_spool_gives_the_no_load_speed() {
    let rig = linear(Preset::Printed, 0.0);
    let mut s = SingleLegState::default();
    let mut mean = 0.0;
    // A command far beyond the stop: the spool stands at its end.
    for i in 0..80_000 {
        rig.step(&mut s, 5.0, 0.0);
        if i >= 40_000 {
            mean += s.v_m_s / 40_000.0;
        }
    }
    assert!((s.leg.spool - 1.0).abs() < 1e-12);
    assert!((mean - 0.70).abs() < 0.002, "{mean}");
}

/// Steady speed under load is `K_q x √(1 − p/p_s)/A`, less leakage.
#[test]
fn oracle_flow_gain_falls_with_the_load() {
    for load in [0.0, 6e4, 3e5, -3e5] {
        for x in [0.05_f64, 0.3, -0.3] {
            let rig = linear(Preset::Printed, 0.0);
            let p = *rig.leg.parameters();
            let press = load / p.oil.area_m2;
            let mut s = SingleLegState::default();
            s.leg.pressure_pa = press;
            let want = (p.valve.no_load_flow_m3_s
                * x
                * (1.0 - x.signum() * press / p.valve.supply_pressure_pa).sqrt()
                - p.oil.leakage_m3_s_pa * press)
                / p.oil.area_m2;
            s.v_m_s = want;
            s.leg.spool = x;
            for _ in 0..8000 {
                rig.step(&mut s, x, load);
            }
            // Viscous friction needs 20 N per m/s more.
            assert!((s.v_m_s / want - 1.0).abs() < 1e-4, "{load} {x}: {} {want}", s.v_m_s);
        }
    }
}

#[test]
fn oracle_the_valve_is_an_80_hz_second_order_filter_with_limits() {
    let p = table_1(Preset::Printed);
    let leg = Leg::new(p, STEP);
    let mut s = LegState::default();
    // Small step: peak of a second-order response with ζ 0.7 at t = π/ω_d.
    let w = TAU * 80.0;
    let wd = w * (1.0f64 - 0.49).sqrt();
    let mut peak = (0.0, 0.0);
    for i in 1..400 {
        leg.valve(&mut s, 0.01);
        let t = f64::from(i) * STEP;
        let exact =
            0.01 * (1.0 - (-0.7 * w * t).exp() * ((wd * t).cos() + 0.7 * w / wd * (wd * t).sin()));
        assert!((s.spool - exact).abs() < 1e-14);
        if s.spool > peak.0 {
            peak = (s.spool, t);
        }
    }
    assert!((peak.1 - core::f64::consts::PI / wd).abs() < STEP);
    // Full step: never faster than its slew, never beyond its stop.
    let mut s = LegState::default();
    let mut last = 0.0;
    for i in 1..2000 {
        leg.valve(&mut s, 3.0);
        assert!(s.spool - last <= p.valve.slew_per_s * STEP * (1.0 + 1e-12) && s.spool <= 1.0);
        if i == 400 {
            assert!(
                s.spool > 0.9 * p.valve.slew_per_s * 0.05,
                "nothing slower than the slew limits"
            );
        }
        last = s.spool;
    }
    assert!((last - 1.0).abs() < 1e-9);
}

/// Ten seconds on the oil spring, nothing dissipates: cycle-averaged energy.
#[test]
fn invariant_the_oil_spring_keeps_its_energy() {
    for preset in PRESETS {
        for mass in [450.0, 2500.0] {
            let mut rig = linear(preset, 1e6);
            let mut p = *rig.leg.parameters();
            p.oil.leakage_m3_s_pa = 0.0;
            p.oil.viscous_n_s_m = 0.0;
            rig.leg = Leg::new(p, STEP);
            rig.mass_kg = mass;
            let mut s = SingleLegState { v_m_s: 0.1, ..Default::default() };
            let mean = |s: &mut SingleLegState| {
                let cycle = (1.0 / (p.oil.natural_frequency_hz(mass) * STEP)).round();
                let mut sum = 0.0;
                let mut i = 0.0;
                while i < 4.0 * cycle {
                    rig.step(s, 0.0, 0.0);
                    sum += rig.energy_j(s) / (4.0 * cycle);
                    i += 1.0;
                }
                sum
            };
            let before = mean(&mut s);
            for _ in 0..80_000 {
                rig.step(&mut s, 0.0, 0.0);
            }
            let drift = (mean(&mut s) / before - 1.0).abs();
            println!("{} {mass} kg: drift {drift:.1e} in 10 s", preset.word());
            assert!(drift < 1e-3, "{preset:?} {mass}: {drift}");
        }
    }
}

/// Below the break-away force the rod creeps no further than its bristle, above it slides with
/// Coulomb friction.
#[test]
fn oracle_seals_stick_and_break_away() {
    let p = table_1(Preset::Printed);
    let leg = Leg::new(p, STEP);
    let f = p.friction;
    // A mass pushed by a force, without oil.
    let run = |push: f64, time: f64| {
        let (mut s, mut x, mut v) = (LegState::default(), 0.0, 0.0);
        let mut t = 0.0;
        while t < time {
            // The push grows slowly, so that nothing rings.
            let now = push * (t / (0.5 * time)).min(1.0);
            leg.slide(&mut s, v, 0.5 * STEP);
            v += STEP * (now - friction_n(&f, s.bristle_m, v)) / 1000.0;
            leg.slide(&mut s, v, 0.5 * STEP);
            x += STEP * v;
            t += STEP;
        }
        (x, v, s)
    };
    // Before break-away z' = v (1 − σz/F_s), so the way under a push F is (F_s/σ) ln(F_s/(F_s − F)).
    let (x, v, _) = run(400.0, 4.0);
    let way = f.static_n / f.bristle_n_m * (f.static_n / (f.static_n - 400.0)).ln();
    assert!((x / way - 1.0).abs() < 0.05, "{x} m against {way} m");
    assert!(v.abs() < 1e-6, "sticks: {v} m/s");
    let (_, v, _) = run(600.0, 4.0);
    assert!(v.abs() < 1e-6, "sticks: {v} m/s");
    let (_, v, s) = run(700.0, 4.0);
    assert!(v > 0.05, "slides: {v}");
    assert!((friction_n(&f, s.bristle_m, v) - f.coulomb_n).abs() < 1.0);
    // Break-away: the greatest friction met on the way is the static one.
    let (mut s, mut most) = (LegState::default(), 0.0f64);
    for _ in 0..80_000 {
        leg.slide(&mut s, 1e-4, STEP);
        most = most.max(friction_n(&f, s.bristle_m, 1e-4));
    }
    assert!((most - f.static_n).abs() < 1.0, "{most}");
}

#[test]
fn invariant_friction_only_takes_energy() {
    let p = table_1(Preset::Printed);
    let leg = Leg::new(p, STEP);
    let mut s = LegState::default();
    let (mut work, mut least) = (0.0, 0.0f64);
    for i in 0..400_000 {
        let t = f64::from(i) * STEP;
        let v = 0.02 * (TAU * 1.3 * t).sin() + 0.01 * (TAU * 7.7 * t).sin();
        leg.slide(&mut s, v, STEP);
        work += friction_n(&p.friction, s.bristle_m, v) * v * STEP;
        let stored = 0.5 * p.friction.bristle_n_m * s.bristle_m * s.bristle_m;
        least = least.min(work - stored);
    }
    assert!(work > 100.0 && least > -1e-3, "{work} {least}");
}

#[test]
fn invariant_draws_repeat_and_stay_within_their_spread() {
    let p = table_1(Preset::Consistent);
    let spread = LegSpread::of_rig(&SPREAD);
    assert_eq!(p.perturbed(&spread, 7, 2), p.perturbed(&spread, 7, 2));
    assert_ne!(p.perturbed(&spread, 7, 2), p.perturbed(&spread, 7, 3));
    assert_ne!(p.perturbed(&spread, 7, 2), p.perturbed(&spread, 8, 2));
    let (mut low, mut high, mut mean) = (f64::MAX, f64::MIN, 0.0);
    for seed in 0..2000 {
        let q = p.perturbed(&spread, seed, 0);
        let r = q.valve.no_load_flow_m3_s / p.valve.no_load_flow_m3_s - 1.0;
        assert!(q.valve.null_bias.abs() <= spread.null_bias);
        assert!(
            (q.oil.bulk_modulus_pa / p.oil.bulk_modulus_pa - 1.0).abs()
                <= spread.bulk_modulus + 1e-12
        );
        // Break-away stays above sliding.
        assert!(q.friction.static_n > q.friction.coulomb_n);
        low = r.min(low);
        high = r.max(high);
        mean += r / 2000.0;
    }
    assert!(low < -0.049 && high > 0.049 && mean.abs() < 0.003, "{low} {high} {mean}");
}
