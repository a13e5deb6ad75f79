//! The rig with all its bodies: loops closed, forces those of the reduced rig.
#![expect(clippy::unwrap_used, reason = "a test may fail where it stands")]

use core::f64::consts::TAU;
use std::path::Path;

use docktwin_control::{
    feedforward::PlateMotion,
    rig::{ClosedRig, RigSetup, TICK_S},
};
use docktwin_core::{DVec3, Euler, Pose, Twist, Wrench};
use docktwin_model::{HydraulicPreset, Rig, load_rig};
use docktwin_physics::{
    hydraulics::LegParameters,
    platform::Platform,
    rig::{ReducedRig, RigPlant},
};
use docktwin_twin::rig::{FULL_STEP_S, FullRig};

fn file(name: &str) -> Rig {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(name);
    load_rig(&path).unwrap().model
}

fn lossless(rig: &Rig, preset: HydraulicPreset) -> LegParameters {
    let mut leg = LegParameters::of_drive(rig.drive.hydraulic().unwrap(), preset).ideal();
    leg.oil.leakage_m3_s_pa = 0.0;
    leg.oil.viscous_n_s_m = 0.0;
    leg
}

/// Released from a load that is not there, on legs damped by viscous friction, the rig comes to rest
/// with the forces of physics.md §4.
#[test]
fn oracle_statics_in_rapier() {
    let rig = file("stewart_statics.urdf");
    let mut leg = lossless(&rig, HydraulicPreset::Printed);
    leg.oil.viscous_n_s_m = 2e5;
    let mut full = FullRig::new(&rig, &[leg; 6], FULL_STEP_S);
    let wrong = Wrench { f: DVec3::new(90.0, 50.0, -30.0), m: DVec3::new(10.0, 20.0, 5.0) };
    let mut s = full.rest(&rig.middle(), &wrong).unwrap();
    let force =
        |s: &docktwin_physics::rig::RigState| s.legs.map(|l| l.pressure_pa * leg.oil.area_m2);
    let begin = force(&s);
    assert!(begin.iter().any(|f| (f - 4787.55).abs() > 5.0), "{begin:?}");
    for _ in 0..8_000 {
        full.advance(&mut s, &[0.0; 6], |_, _| Wrench::ZERO).unwrap();
    }
    println!("{:?} N, loops open by {:.1e} m", force(&s), full.closure_error_m());
    for f in force(&s) {
        assert!((f - 4787.55).abs() < 0.1, "{f} N");
    }
}

/// Every axis of the docking workspace at once, from wall to wall, begun and ended gently.
fn motion(rig: &Rig, platform: &Platform, time_s: f64) -> PlateMotion {
    let hz = [0.11, 0.08, 0.13, 0.10, 0.14, 0.07];
    let gentle = {
        let x = (time_s / 2.0).min(1.0);
        x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
    };
    let at = |t: f64| {
        let place = core::array::from_fn(|i| gentle * (TAU * hz[i] * t).sin());
        platform.plate_from_docking(&rig.docking.pose(place))
    };
    // Derivatives by differences: good to 1e-7, and the same for both rigs.
    let h = 1e-3;
    let x: [Pose; 5] = core::array::from_fn(|i| at(time_s + h * (i as f64 - 2.0)));
    let turn = |a: &Pose, b: &Pose| (b.q * a.q.conjugate()).to_scaled_axis();
    let twist = |a: &Pose, b: &Pose, t: f64| Twist { v: (b.p - a.p) / t, w: turn(a, b) / t };
    let difference = |a: Twist, b: Twist, t: f64| Twist { v: (b.v - a.v) / t, w: (b.w - a.w) / t };
    let between: [Twist; 4] = core::array::from_fn(|i| twist(&x[i], &x[i + 1], h));
    let accelerations: [Twist; 3] =
        core::array::from_fn(|i| difference(between[i], between[i + 1], h));
    PlateMotion {
        x_bp: x[2],
        twist: twist(&x[1], &x[3], 2.0 * h),
        acceleration: accelerations[1],
        jerk: difference(accelerations[0], accelerations[2], 2.0 * h),
        external: Wrench::ZERO,
        external_rate: Wrench::ZERO,
    }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for v in values {
        sum += v * v;
        n += 1.0;
    }
    f64::sqrt(sum / n)
}

/// Leg forces of the full rig are what inverse dynamics of the reduced one asks for the very motion
/// that the full one made, and its loops stay closed.
#[test]
fn oracle_leg_forces_in_full_amplitude_motion() {
    let rig = file("stewart.urdf");
    let mut setup = RigSetup::of_rig(&rig, HydraulicPreset::Printed, None);
    // Forces of the oil are to be those on the rods.
    let legs = [lossless(&rig, HydraulicPreset::Printed); 6];
    let oil = setup.hydraulic_mut().unwrap();
    (oil.legs, oil.believed_legs) = (legs, legs);
    setup.dead_time_s = 0.0;
    let platform = setup.platform.clone();
    let full = FullRig::new(&rig, &legs, FULL_STEP_S);
    let mut closed = ClosedRig::with_plant(full, &setup, &rig.middle()).unwrap();
    let forward = setup.feedforward();
    let (mut off, mut forces, mut open, mut strayed) = (vec![], vec![], 0.0_f64, 0.0_f64);
    for tick in 0..12_000 {
        let time_s = f64::from(tick) * TICK_S;
        let wanted = motion(&rig, &platform, time_s);
        let m = closed.tick(&forward.command(&wanted).unwrap(), |_, _| Wrench::ZERO).unwrap();
        open = open.max(closed.plant().unwrap().closure_error_m());
        strayed =
            strayed.max((m.x_bp.p - motion(&rig, &platform, time_s + TICK_S).x_bp.p).length());
        let c = platform.at(&m.x_bp);
        let want = platform.inverse_dynamics(&c, &m.twist, &m.acceleration, &Wrench::ZERO).unwrap();
        for (is, want) in m.force_n.into_iter().zip(want) {
            off.push(is - want);
            forces.push(want);
        }
    }
    let (off, forces) = (rms(off.into_iter()), rms(forces.into_iter()));
    println!(
        "leg forces {forces:.0} N RMS, off by {:.4} %; loops open by {open:.1e} m; {:.2} mm from \
         the motion asked for",
        100.0 * off / forces,
        1e3 * strayed
    );
    assert!(off < 0.005 * forces, "{off} N of {forces} N");
    assert!(open < 1e-7, "{open} m");
    assert!(strayed < 0.02, "the rig did not make the motion: {strayed} m");
}

/// Ten seconds on six oil springs. The mechanics is of first order at the joints, so the energy is
/// kept less well than by the reduced rig.
#[test]
fn invariant_the_full_rig_on_its_oil_springs_keeps_its_energy() {
    let rig = file("stewart.urdf");
    for (word, preset) in HydraulicPreset::WORDS {
        let leg = lossless(&rig, preset);
        let account = ReducedRig::new(Platform::new(&rig), &[leg; 6], FULL_STEP_S);
        let mut full = FullRig::new(&rig, &[leg; 6], FULL_STEP_S);
        let x_bp = rig.middle();
        let mut s = full.rest(&x_bp, &Wrench::ZERO).unwrap();
        let rest = account.energy_j(&s);
        let mut push = Wrench { f: DVec3::new(3e4, 5e4, -4e4), m: DVec3::new(2e4, -3e4, 2e4) };
        let mut mean = |steps: u32, push: Wrench| {
            let mut sum = 0.0;
            for _ in 0..steps {
                full.advance(&mut s, &[0.0; 6], |_, _| push).unwrap();
                sum += (account.energy_j(&s) - rest) / f64::from(steps);
            }
            sum
        };
        mean(20, push);
        push = Wrench::ZERO;
        let before = mean(2000, push);
        mean(38_000, push);
        let drift = mean(2000, push) / before - 1.0;
        println!("{word}: {before:.2} J, drift {drift:.1e} in 10 s");
        assert!(drift.abs() < 0.05, "{word}: {drift}");
    }
}

/// The same commands move both rigs alike.
#[test]
fn oracle_the_full_rig_moves_as_the_reduced_one() {
    let rig = file("stewart.urdf");
    let setup = RigSetup::of_rig(&rig, HydraulicPreset::Stiff, None);
    let x_bp = rig.middle();
    let mut reduced = ClosedRig::new(&setup, &x_bp).unwrap();
    let full = FullRig::new(&rig, &setup.hydraulic().unwrap().legs, FULL_STEP_S);
    let mut full = ClosedRig::with_plant(full, &setup, &x_bp).unwrap();
    let forward = setup.feedforward();
    let (mut apart, mut turned) = (0.0_f64, 0.0_f64);
    for tick in 0..2000 {
        let s = (TAU * 4.0 * f64::from(tick) * TICK_S).sin() * f64::from(tick.min(250)) / 250.0;
        let mut wanted = PlateMotion::rest(x_bp);
        wanted.x_bp.p += DVec3::new(0.002, 0.004, -0.003) * s;
        wanted.x_bp.q = Euler { roll: 2e-3 * s, pitch: 0.0, yaw: -1e-3 * s }.to_quat() * x_bp.q;
        let command = forward.command(&wanted).unwrap();
        let a = reduced.tick(&command, |_, _| Wrench::ZERO).unwrap();
        let b = full.tick(&command, |_, _| Wrench::ZERO).unwrap();
        apart = apart.max((a.x_bp.p - b.x_bp.p).length());
        turned = turned.max(a.x_bp.q.angle_between(b.x_bp.q));
    }
    println!("apart by {apart:.1e} m, {turned:.1e} rad");
    assert!(apart < 2e-5 && turned < 1e-5, "{apart} m, {turned} rad");
}
