//! The running rig against its linear model, and against what is asked of it.
#![expect(clippy::unwrap_used, reason = "a test may fail where it stands")]

use std::path::Path;

use docktwin_control::{
    feedforward::PlateMotion,
    response::{Bench, LinearModel, Sweep},
    rig::{ClosedRig, RigSetup, SetupError},
};
use docktwin_core::{DVec3, Twist, Wrench};
use docktwin_model::{HydraulicPreset, Rig, load_rig};

const CORNER: [f64; 6] = [-1.0, 1.0, -1.0, 1.0, 1.0, -1.0];

fn file() -> Rig {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf/stewart.urdf");
    load_rig(&path).unwrap().model
}

fn bench(rig: &Rig, preset: HydraulicPreset, place: [f64; 6], payload_n_m: DVec3) -> Bench {
    Bench {
        setup: RigSetup::of_rig(rig, preset, None),
        x_34: rig.docking.pose(place),
        payload_n_m,
        lever_m: 2.0,
        foreseen: false,
    }
}

fn amplitude(dof: usize) -> f64 {
    if dof < 3 { 2e-3 } else { 1e-3 }
}

/// A sample of what `docktwin analyze bode` measures everywhere: 10 Hz and 0–5 Hz with 2 mm.
#[test]
fn oracle_the_rig_meets_its_requirements_at_a_sample_of_places() {
    let rig = file();
    for (word, preset) in HydraulicPreset::WORDS {
        let flat = if preset == HydraulicPreset::Printed { 0.10 } else { 0.05 };
        for (place, payload, dofs) in [
            ([0.0; 6], DVec3::ZERO, [0, 4]),
            (CORNER, DVec3::Y * 1e6, [1, 5]),
            (CORNER, DVec3::X * 1e6, [0, 3]),
        ] {
            let b = bench(&rig, preset, place, payload);
            for dof in dofs {
                let p = b.stepped_sine(dof, amplitude(dof), 10.0, 0.8, 0.3).unwrap();
                let (db, deg) = (p.gain_db(dof), p.phase_deg(dof));
                println!("{word} {dof}: {db:+.2} dB {deg:.1} deg");
                assert!(db.abs() <= 2.0 && deg.abs() <= 70.0, "{word} {dof}: {db} {deg}");
                for hz in [1.0, 4.0] {
                    let p = b.stepped_sine(dof, amplitude(dof), hz, 0.8, 0.5).unwrap();
                    let off = (p.response[dof].norm() - 1.0).abs();
                    // The consistent preset is judged as the printed one at the worst corners.
                    let most = if preset == HydraulicPreset::Consistent { 0.10 } else { flat };
                    assert!(off <= most, "{word} {dof} {hz} Hz: {off}");
                    assert!(p.cross_coupling(dof) <= 0.15);
                    assert!(p.coherence > 0.999, "{}", p.coherence);
                }
            }
        }
    }
}

#[test]
fn oracle_poles_are_stable_and_damped_for_every_payload() {
    let rig = file();
    for (word, preset) in HydraulicPreset::WORDS {
        for place in [[0.0; 6], CORNER, [1.0; 6], [-1.0; 6]] {
            for k in [0.0, 1e3, 1e4, 1e5, 1e6] {
                for axis in [DVec3::X, DVec3::Y] {
                    let l = bench(&rig, preset, place, axis * k).linear().unwrap();
                    let LinearModel::Oil(on_oil) = &l else { panic!("it is on oil") };
                    let damping = on_oil.least_damping(1000.0).unwrap();
                    assert!(damping >= 0.1, "{word} {place:?} {k} N/m: {damping}");
                }
            }
        }
    }
}

/// With hardly any feedback the poles are those of (10) for the effective masses of the pose, and the
/// valve's.
#[test]
fn oracle_open_poles_are_the_hydraulic_frequencies_of_the_effective_masses() {
    let rig = file();
    for (_, preset) in HydraulicPreset::WORDS {
        let mut b = bench(&rig, preset, CORNER, DVec3::ZERO);
        b.setup.hydraulic_mut().unwrap().tuning.position_gain_1_s = 1e-3;
        b.setup.hydraulic_mut().unwrap().tuning.pressure_gain_m_s_n = 1e-12;
        let platform = &b.setup.platform;
        let c = platform.at(&platform.plate_from_docking(&b.x_34));
        let poles = b.linear().unwrap().poles().unwrap();
        let leg = &b.setup.hydraulic().unwrap().legs[0];
        for mass in platform.effective_masses_kg(&c).unwrap() {
            let hz = leg.oil.natural_frequency_hz(mass);
            let a2 = leg.oil.area_m2 * leg.oil.area_m2;
            let kh = leg.oil.oil_spring_n_m();
            let zeta = 0.5
                * (leg.oil.leakage_m3_s_pa / a2 * (kh * mass).sqrt()
                    + leg.oil.viscous_n_s_m / (kh * mass).sqrt());
            let near = poles.iter().find(|p| {
                (p.frequency_hz / hz - 1.0).abs() < 1e-3 && (p.damping - zeta).abs() < 1e-4
            });
            assert!(near.is_some(), "{hz} Hz, damping {zeta}: {poles:?}");
        }
    }
}

/// Friction, bias and orifice apart, the running rig is its linear model, cross-couplings included.
#[test]
fn oracle_an_ideal_rig_follows_the_linear_model() {
    let rig = file();
    for (word, preset) in HydraulicPreset::WORDS {
        let mut b = bench(&rig, preset, CORNER, DVec3::Y * 1e6);
        b.foreseen = true;
        let oil = b.setup.hydraulic_mut().unwrap();
        oil.legs = oil.legs.map(|l| l.ideal());
        oil.believed_legs = oil.believed_legs.map(|l| l.ideal());
        let linear = b.linear().unwrap();
        for (dof, hz) in [(1, 2.0), (1, 5.0), (1, 10.0), (3, 10.0)] {
            let m = b.stepped_sine(dof, 0.25 * amplitude(dof), hz, 1.5, 0.5).unwrap();
            let l = b.linear_point(&linear, dof, hz).unwrap();
            let worst = (0..6).map(|i| (m.response[i] - l.response[i]).norm()).fold(0.0, f64::max);
            println!("{word} {dof} {hz} Hz: {worst:.1e}");
            assert!(worst < 0.01, "{word} {dof} {hz} Hz: {m:?} against {l:?}");
        }
    }
}

#[test]
fn oracle_swept_and_stepped_sine_agree() {
    let rig = file();
    let b = bench(&rig, HydraulicPreset::Printed, [0.0; 6], DVec3::Z * 1e6);
    let sweep =
        Sweep { dof: 2, amplitude: 2e-3, from_hz: 0.5, to_hz: 12.0, period_s: 10.0, sweeps: 1 };
    let hz = [2.0, 5.0, 10.0];
    for p in b.swept_sine(&sweep, &hz, 0.25).unwrap() {
        let s = b.stepped_sine(2, 2e-3, p.hz, 0.8, 0.5).unwrap();
        let apart = (p.response[2] - s.response[2]).norm();
        println!("{} Hz: {:?} {:?} coherence {}", p.hz, p.response[2], s.response[2], p.coherence);
        assert!(apart < 0.03, "{} Hz: {apart}", p.hz);
        assert!(p.coherence > 0.99);
    }
}

/// What each part of the feed-forward is there for: without it the same rig is worse.
#[test]
fn invariant_friction_feedforward_helps() {
    let rig = file();
    let mut b = bench(&rig, HydraulicPreset::Printed, [0.0; 6], DVec3::ZERO);
    let with = b.stepped_sine(1, 5e-4, 2.0, 1.0, 1.0).unwrap();
    let oil = b.setup.hydraulic_mut().unwrap();
    oil.believed_legs = oil.believed_legs.map(|l| l.ideal());
    let without = b.stepped_sine(1, 5e-4, 2.0, 1.0, 1.0).unwrap();
    let off = |r: nalgebra::Complex<f64>| (r - nalgebra::Complex::new(0.0, -0.0251).exp()).norm();
    println!("{} {}", off(with.response[1]), off(without.response[1]));
    assert!(off(with.response[1]) < 0.3 * off(without.response[1]));
}

#[test]
fn oracle_a_null_bias_stands_off_by_its_flow_over_the_position_gain() {
    let rig = file();
    let mut setup = RigSetup::of_rig(&rig, HydraulicPreset::Stiff, None);
    let oil = setup.hydraulic_mut().unwrap();
    oil.legs = oil.legs.map(|l| l.ideal());
    oil.legs[2].valve.null_bias = 0.003;
    oil.believed_legs = oil.believed_legs.map(|l| l.ideal());
    let position_gain_1_s = oil.tuning.position_gain_1_s;
    let middle = rig.middle();
    let mut closed = ClosedRig::new(&setup, &middle).unwrap();
    let command = setup.feedforward().command(&PlateMotion::rest(middle)).unwrap();
    let mut last = closed.measure();
    for _ in 0..4000 {
        last = closed.tick(&command, |_, _| Wrench::ZERO).unwrap();
    }
    let off = last.length_m[2] - command.legs[2].length_m;
    let exact = 0.003 * 0.7 / position_gain_1_s;
    assert!((off / exact - 1.0).abs() < 0.02, "{off} against {exact}");
    let other = last.length_m[5] - command.legs[5].length_m;
    assert!(other.abs() < 0.02 * exact, "{other}");
}

#[test]
fn invariant_the_same_seed_is_the_same_rig() {
    let rig = file();
    let run = |seed| {
        let setup = RigSetup::of_rig(&rig, HydraulicPreset::Printed, Some(seed));
        let middle = rig.middle();
        let mut closed = ClosedRig::new(&setup, &middle).unwrap();
        let command = setup.feedforward().command(&PlateMotion::rest(middle)).unwrap();
        for _ in 0..200 {
            closed.tick(&command, |_, _| Wrench::ZERO).unwrap();
        }
        closed.digest()
    };
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
}

#[test]
fn invariant_impossible_settings_are_refused() {
    let rig = file();
    let mut setup = RigSetup::of_rig(&rig, HydraulicPreset::Printed, None);
    setup.hydraulic_mut().unwrap().tuning.rate_hz = 3000.0;
    let refused = ClosedRig::new(&setup, &rig.middle()).map(|_| ());
    assert!(matches!(refused, Err(SetupError::Rate { .. })), "{refused:?}");
    setup.hydraulic_mut().unwrap().tuning.rate_hz = 2000.0;
    setup.dead_time_s = f64::NAN;
    let refused = ClosedRig::new(&setup, &rig.middle()).map(|_| ());
    assert!(matches!(refused, Err(SetupError::DeadTime { .. })), "{refused:?}");
}

/// Legs without dynamics: the plate stands where the command of two ticks ago wanted it, whatever pushes.
#[test]
fn oracle_exact_legs_go_where_they_are_commanded() {
    let rig = file();
    let setup = RigSetup::of_rig(&rig, HydraulicPreset::Printed, None);
    let feedforward = setup.feedforward();
    let start = rig.docking.pose([0.0; 6]);
    let x_bp = rig.plate_from_docking(&start);
    let mut exact = ClosedRig::new(&setup, &x_bp).unwrap().exact();
    let push = |_: &docktwin_core::Pose, _: &Twist| Wrench { f: DVec3::splat(2e4), m: DVec3::ZERO };
    // 0.2 m/s² along Z from rest; a command says where the plate is to be at its arrival, 2 ms on.
    let at = |t: f64| 0.1 * t * t;
    for k in 0..400 {
        let t = f64::from(k) * 1e-3 + 2e-3;
        let mut motion = PlateMotion::rest(x_bp);
        motion.x_bp.p.z += at(t);
        motion.twist.v.z = 0.2 * t;
        motion.acceleration.v.z = 0.2;
        let m = exact.tick(&feedforward.command(&motion).unwrap(), push).unwrap();
        let off = m.x_bp.p - x_bp.p - DVec3::Z * at(f64::from(k + 1) * 1e-3);
        // The first commands are not yet there.
        assert!(k < 4 || off.length() < 1e-9, "{k}: {off}");
    }
}
