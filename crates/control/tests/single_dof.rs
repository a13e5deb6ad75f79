//! The single-DOF loop against closed forms, the linear model and the simulated system.
#![expect(clippy::unwrap_used, reason = "a test may fail where it stands")]

use std::{
    f64::consts::{PI, TAU},
    path::{Path, PathBuf},
};

use docktwin_control::{
    rig::SetupError,
    single_dof::{
        At, Compensation, Docking, Interface, Likeness, Mechanism, Memory, Rebound, Sample,
        SingleDofSetup, measure,
        transfer::{LinearSimulator, body_dynamics, closed, mechanism, s_of},
    },
};
use docktwin_core::{DQuat, DVec3, Pose, Twist};
use docktwin_model::{
    AttenuationChoice, Attenuator, AxisChannel, HydraulicPreset, Rig, load_mechanism, load_rig,
};
use docktwin_physics::attenuator::{self, AttenuatorGeometry, AttenuatorState};

const K: f64 = 1e6;
const EXACT: Interface<'_> = Interface::Ideal { delay_s: 0.0 };

fn models(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(name)
}

fn rig() -> Rig {
    load_rig(&models("stewart.urdf")).unwrap().model
}

fn attenuator() -> Attenuator {
    let [active, passive] = ["apas_active.urdf", "apas_passive.urdf"].map(models);
    let choice = Some(AttenuationChoice::Characteristic);
    load_mechanism(&active, &passive, choice).unwrap().model.attenuator
}

fn axial() -> AxisChannel {
    let Attenuator::Characteristic(c) = attenuator() else { panic!("asked for it") };
    c.axial
}

fn joined(damping_n_s_m: f64) -> Mechanism {
    Mechanism::Linear { stiffness_n_m: K, damping_n_s_m }
}

/// Table 2 and 3: 2.297 Hz.
fn natural_rad_s() -> f64 {
    (K / 4800.0f64).sqrt()
}

/// x(t) of a damped oscillator from rest length, and half a period of it.
#[test]
fn oracle_the_simulated_system_is_the_damped_oscillator() {
    for damping in [0.0, 4000.0] {
        let mut d = Docking::of_table_2(joined(damping), 0.35);
        d.gap_m = 0.0;
        let decay = damping / (2.0 * d.reduced_mass_kg());
        let w = (natural_rad_s().powi(2) - decay * decay).sqrt();
        for s in d.simulated(3000) {
            let want = 0.35 / w * (-decay * s.time_s).exp() * (w * s.time_s).sin();
            assert!((s.body_m - want).abs() < 1e-10, "{}: {} {want}", s.time_s, s.body_m);
        }
    }
    // The paper's row: 8 t against 12 t, 1e6 N/m, 0.35 m/s.
    let d = Docking::of_table_2(Mechanism::Contact { stiffness_n_m: K }, 0.35);
    let run = d.simulated(600);
    let Rebound { restitution: e, time_s: time } = Rebound::of(&d, &run).unwrap();
    let peak = run.iter().map(|s| s.force_n).fold(0.0, f64::max);
    assert!((e - 1.0).abs() < 1e-6 && (time - 0.21766).abs() < 1e-5, "{e} {time}");
    assert!((peak - 24249.0).abs() < 3.0, "{peak}");
}

/// (6) and (7) are the closed form ω0²/(ω0² − ω²), and the same with `G_I` = 1.
#[test]
fn oracle_6_and_7_with_an_interface_of_one() {
    for hz in [0.1, 1.0, 2.0, 3.0, 10.0] {
        let s = s_of(hz);
        let open = body_dynamics(4800.0, s) * mechanism(K, 0.0, s);
        let w0 = natural_rad_s();
        let want = w0 * w0 / (w0 * w0 - (TAU * hz).powi(2));
        assert!((closed(open) - want).norm() < 1e-12 * want.abs(), "{hz}");
    }
}

/// An ideal rig behind a delay, a spring touched and left: the exact solution by steps of the delay.
#[test]
fn oracle_a_delay_gives_energy_to_a_contact() {
    let delay_s = 0.01;
    for (theta, e, slower) in [
        (0.01, 1.01583, 1.00004),
        (0.1, 1.1696, 1.0037),
        (0.3, 1.5841, 1.0311),
        (0.5, 2.0943, 1.0790),
    ] {
        let w: f64 = theta / delay_s;
        let mut d = Docking::of_table_2(Mechanism::Contact { stiffness_n_m: 4800.0 * w * w }, 0.1);
        // Travel stays within a metre.
        d.closing_speed_m_s = 0.1 * w.min(1.0);
        let ticks = (1.6 * PI / w / 1e-3) + d.gap_m / d.closing_speed_m_s / 1e-3;
        let run = d.hil(&Interface::Ideal { delay_s }, ticks as u32).unwrap();
        let Rebound { restitution: got, time_s: time } = Rebound::of(&d, &run).unwrap();
        let slow = time * w / PI;
        println!("theta {theta}: e {got:.5} ({e}), time {slow:.5} ({slower})");
        assert!((got / e - 1.0).abs() < 4e-4, "{theta}: {got} {e}");
        assert!((slow / slower - 1.0).abs() < 4e-4, "{theta}: {slow} {slower}");
    }
}

/// With an interface of one the sampled programme neither gains nor loses energy: the hundredth
/// swing of a spring is as high as the first.
#[test]
fn invariant_the_programme_keeps_the_energy() {
    let d = Docking::of_table_2(joined(0.0), 0.35);
    let run = d.hil(&EXACT, 45_000).unwrap();
    let swing = |s: &[Sample]| s.iter().map(|s| s.body_m.abs()).fold(0.0, f64::max);
    let (first, last) = (swing(&run[..5000]), swing(&run[40_000..]));
    assert!((last / first - 1.0).abs() < 1e-6, "{first} {last}");
}

/// The line of acceptance: `G_I` = 1 against the simulated system, displacement and force.
#[test]
fn oracle_an_interface_of_one_gives_the_simulated_system() {
    for (mechanism, most) in [
        (Mechanism::Characteristic(axial()), 1e-3),
        (joined(0.0), 2e-4),
        (Mechanism::Contact { stiffness_n_m: K }, 5e-5),
    ] {
        // Whenever within a tick the touch falls.
        for i in 0..8 {
            let part = (f64::from(i) + 0.5) / 8.0;
            let d = Docking::of_table_2(mechanism.clone(), 0.35).touching(part);
            let l = Likeness::of(&d.hil(&EXACT, 2000).unwrap(), &d.simulated(2000));
            println!("{part}: {l:?}");
            assert!(l.worst() <= most, "{part}: {l:?}");
        }
    }
}

/// A viscous force begins with a step, at a moment that the programme knows to half a tick: that is
/// all of the difference. The bodies have lost more or less than half a tick of the first force.
#[test]
fn oracle_the_moment_of_touch_costs_up_to_half_a_tick_of_the_first_force() {
    let axial = axial();
    let lost = |part: f64| (0.5 - part) * 1e-3 * axial.damping.before_capture / 4800.0;
    for part in [0.0625, 0.25, 0.5, 0.75, 0.9375] {
        let m = Mechanism::Characteristic(axial.clone());
        let d = Docking::of_table_2(m, 0.35).touching(part);
        let l = Likeness::of(&d.hil(&EXACT, 2000).unwrap(), &d.simulated(2000));
        // Way goes with the square of the speed, and the brake makes a force that hardly changes.
        let want = 2.0 * lost(part);
        println!("{part}: {:.6} {want:.6}", l.displacement_peak);
        assert!((l.displacement_peak - want).abs() < 1e-4, "{part}: {l:?}");
    }
}

/// A wrong clock must show: one tick of delay is not within the line.
#[test]
fn invariant_one_tick_late_is_seen() {
    let d = Docking::of_table_2(Mechanism::Contact { stiffness_n_m: K }, 0.35);
    let late = Interface::Ideal { delay_s: 1e-3 };
    let l = Likeness::of(&d.hil(&late, 2000).unwrap(), &d.simulated(2000));
    assert!(l.worst() > 0.01, "{l:?}");
}

/// The running leg without friction is the linear one, all presets, with and without compensation.
#[test]
fn oracle_the_running_leg_is_its_linear_model() {
    for (word, preset) in HydraulicPreset::WORDS {
        for compensation in [Compensation::None, Compensation::Ahead] {
            let mut s = SingleDofSetup::of_drive(rig().drive.hydraulic().unwrap(), preset)
                .with(compensation);
            (s.leg, s.believed_leg) = (s.leg.ideal(), s.believed_leg.ideal());
            for payload in [0.0, K] {
                let linear = LinearSimulator::new(&s, payload).unwrap();
                for hz in [1.0, 3.0, 5.0, 10.0] {
                    let (g, m) =
                        (linear.response(hz).unwrap(), measure(&s, payload, 1e-3, hz).unwrap());
                    let off = (m / g - 1.0).norm();
                    println!("{word} {compensation:?} {payload} N/m {hz} Hz: {off:.5}");
                    let most = if hz < 6.0 { 8e-3 } else { 4e-2 };
                    assert!(off < most, "{word} {compensation:?} {payload} {hz}: {g} {m}");
                }
            }
        }
    }
}

/// Below 5 Hz the compensated interface, friction and sensor included, is one within 2 %.
#[test]
fn oracle_compensation_brings_the_interface_near_one() {
    for (word, preset) in HydraulicPreset::WORDS {
        let s = SingleDofSetup::of_drive(rig().drive.hydraulic().unwrap(), preset)
            .with(Compensation::Ahead);
        for payload in [0.0, K] {
            for hz in [0.5, 2.0, 5.0] {
                let g = measure(&s, payload, 2e-3, hz).unwrap() * s.sensor.response(s_of(hz));
                assert!((g - 1.0).norm() < 0.02, "{word} {payload} {hz}: {g}");
            }
        }
    }
}

/// Not compensated, a joined spring swings up as fast as the pole of (7) says, and compensation
/// takes nearly all of it away.
#[test]
fn oracle_the_loop_diverges_as_7_says() {
    for (word, preset) in HydraulicPreset::WORDS {
        let mut s = SingleDofSetup::of_drive(rig().drive.hydraulic().unwrap(), preset);
        (s.leg, s.believed_leg) = (s.leg.ideal(), s.believed_leg.ideal());
        let linear = LinearSimulator::new(&s, K).unwrap();
        // Newton for m_r p² + K G_I(p) = 0 from the undamped frequency, G_I continued off the axis by
        // its slope along it.
        let mut p = s_of(natural_rad_s() / TAU);
        for _ in 0..20 {
            let (hz, step) = (p.im / TAU, 1e-3);
            let at = |hz: f64| linear.interface(hz).unwrap();
            let slope = (at(hz + step) - at(hz - step)) / s_of(2.0 * step);
            let g = at(hz) + slope * p.re;
            p -= (p * p * 4800.0 + g * K) / (p * 9600.0 + slope * K);
        }
        let d = Docking::of_table_2(joined(0.0), 0.02);
        let swing = |run: &[Sample], from: usize| {
            run[from..from + 500].iter().map(|s| s.body_m.abs()).fold(0.0, f64::max)
        };
        let run = d.hil(&Interface::Leg(&s), 5000).unwrap();
        let growth = (swing(&run, 3500) / swing(&run, 1500)).ln() / 2.0;
        println!("{word}: {growth:.3} 1/s, pole {p}");
        assert!((growth / p.re - 1.0).abs() < 0.1, "{word}: {growth} {p}");
        let run = d.hil(&Interface::Leg(&s.with(Compensation::Ahead)), 5000).unwrap();
        let left = (swing(&run, 3500) / swing(&run, 1500)).ln() / 2.0;
        assert!(left.abs() < 0.06 * growth, "{word}: {left} of {growth}");
    }
}

/// The law along one axis is that of the twin's attenuator, brake, dry friction and stops included.
#[test]
fn oracle_the_characteristic_is_the_twins() {
    let (model, law) = (attenuator(), Mechanism::Characteristic(axial()));
    let (step, w) = (1e-5, TAU * 0.7);
    let (mut twin, mut memory) = (AttenuatorState::default(), Memory::default());
    let path = |t: f64| At { x_m: 0.153 * (w * t).sin(), v_m_s: 0.153 * w * (w * t).cos() };
    let mut most: f64 = 0.0;
    for i in 0..300_000 {
        let t = f64::from(i) * step;
        let (from, mid, to) = (path(t), path(t + 0.5 * step), path(t + step));
        let x_3r = Pose::new(DVec3::new(-mid.x_m, 0.0, 0.0), DQuat::IDENTITY);
        let rel = Twist { v: DVec3::new(-mid.v_m_s, 0.0, 0.0), w: DVec3::ZERO };
        let g = AttenuatorGeometry::new(x_3r, 0.0);
        let f = attenuator::force(&model, &g, &twin, rel, 0.0, step);
        twin = f.next;
        law.advance(&mut memory, from, mid, 0.5 * step);
        // Pushed apart is against the ring's deflection away from the chaser.
        most = most.max((law.force_n(&memory, mid) - f.on_ring.f.x).abs());
        law.advance(&mut memory, mid, to, 0.5 * step);
    }
    println!("{most} N apart");
    assert!(most < 2.0, "{most}");
    assert!(memory.slip_m.abs() > 1e-3);
}

#[test]
fn regress_an_interface_that_cannot_be_is_refused() {
    let d = Docking::of_table_2(joined(0.0), 0.35);
    for delay_s in [-1e-3, 0.06, f64::NAN] {
        let e = d.hil(&Interface::Ideal { delay_s }, 10).unwrap_err();
        assert!(matches!(e, SetupError::DeadTime { .. }), "{e}");
    }
    let mut s =
        SingleDofSetup::of_drive(rig().drive.hydraulic().unwrap(), HydraulicPreset::Printed);
    s.tuning.rate_hz = 3000.0;
    assert!(matches!(measure(&s, 0.0, 1e-3, 1.0), Err(SetupError::Rate { .. })));
}
