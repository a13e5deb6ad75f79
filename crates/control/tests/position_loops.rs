//! Legs with position loops of their own against the exact solution of their equation, and their limits.
#![expect(clippy::unwrap_used, reason = "a test may fail where it stands")]

use core::f64::consts::TAU;
use std::path::Path;

use docktwin_control::{
    feedforward::{LegCommand, RigCommand},
    response::{Bench, LinearModel},
    rig::{ClosedRig, DriveSetup, RigSetup, SetupError, TICK_S},
};
use docktwin_core::{DVec3, Twist, Wrench};
use docktwin_model::{Drive, HydraulicPreset, PositionLoop, Rig, load_rig};

/// The hexapod that is shipped, 12 Hz, ζ 0.7, 4 ms, with other loops.
fn rig(change: impl FnOnce(&mut PositionLoop)) -> Rig {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf/electric_hexapod.urdf");
    let mut rig = load_rig(&path).unwrap().model;
    let Drive::PositionLoop(l) = &mut rig.drive else { panic!("it has position loops") };
    change(l);
    rig
}

fn closed(rig: &Rig) -> ClosedRig {
    let setup = RigSetup::of_rig(rig, HydraulicPreset::Printed, None);
    ClosedRig::new(&setup, &rig.middle()).unwrap()
}

fn at_rest(closed: &ClosedRig) -> RigCommand {
    let m = closed.measure();
    let leg = |i: usize| LegCommand {
        length_m: m.length_m[i],
        force_n: m.force_n[i],
        ..LegCommand::default()
    };
    RigCommand { legs: core::array::from_fn(leg), x_bp: m.x_bp, twist: Twist::default() }
}

fn free(_: &docktwin_core::Pose, _: &Twist) -> Wrench {
    Wrench::ZERO
}

/// Part of a step that is done `t` after it arrived.
fn step_response(l: &PositionLoop, t: f64) -> f64 {
    let w = TAU * l.natural_frequency_hz;
    match l.damping_ratio {
        _ if t <= 0.0 => 0.0,
        None => 1.0 - (-w * t).exp(),
        Some(z) => {
            let d = w * (1.0 - z * z).sqrt();
            1.0 - (-z * w * t).exp() * ((d * t).cos() + z * w / d * (d * t).sin())
        }
    }
}

/// Small enough for the force of a leg that jumps.
const STEP_M: f64 = 2e-5;

#[test]
fn oracle_a_step_is_the_closed_form_behind_its_delay() {
    let second = rig(|_| {});
    // A first order begins with a jump of its speed, which limits of acceleration and force would cut.
    let first = rig(|l| {
        *l = PositionLoop {
            damping_ratio: None,
            natural_frequency_hz: 5.0,
            acceleration_m_s2: None,
            ..*l
        };
    });
    let between = rig(|l| l.delay_s = 0.0047);
    for rig in [&second, &first, &between] {
        let mut closed = closed(rig);
        let l = *rig.drive.position_loop().unwrap();
        let mut command = at_rest(&closed);
        let before = command.legs[2].length_m;
        command.legs[2].length_m += STEP_M;
        // A delay between two steps of the plant is met to half a step.
        let exact = (l.delay_s / 1.25e-4).fract() < 1e-9;
        for tick in 1..=300 {
            let m = closed.tick(&command, free).unwrap();
            let want = step_response(&l, f64::from(tick) * TICK_S - l.delay_s);
            let got = (m.length_m[2] - before) / STEP_M;
            let near = if exact { 1e-7 } else { 3e-3 };
            assert!((got - want).abs() < near, "{l:?} tick {tick}: {got} instead of {want}");
            // The others stay, and the plate is where these lengths put it.
            let back = closed.platform().at(&m.x_bp).length_m;
            assert!((0..6).all(|i| (back[i] - m.length_m[i]).abs() < 1e-10));
            assert!((m.length_m[0] - command.legs[0].length_m).abs() < 1e-12);
        }
    }
}

#[test]
fn oracle_a_sine_comes_out_with_gain_and_lag_of_the_equation() {
    for (rig, hz) in
        [(rig(|_| {}), 2.0), (rig(|_| {}), 8.0), (rig(|l| l.damping_ratio = None), 5.0)]
    {
        let mut closed = closed(&rig);
        let l = *rig.drive.position_loop().unwrap();
        let (rest, w, a) = (at_rest(&closed), TAU * hz, 5e-4);
        let (mut re, mut im, n) = (0.0, 0.0, 1000);
        for tick in 0..2 * n {
            let t = f64::from(tick) * TICK_S;
            let mut command = rest;
            for leg in &mut command.legs {
                leg.length_m += a * (w * t).sin();
                leg.speed_m_s = a * w * (w * t).cos();
            }
            let m = closed.tick(&command, free).unwrap();
            if tick >= n {
                let (y, t) = (m.length_m[4] - rest.legs[4].length_m, t + TICK_S);
                re += y * (w * t).sin() * 2.0 / (a * f64::from(n));
                im += y * (w * t).cos() * 2.0 / (a * f64::from(n));
            }
        }
        let want = l.response(hz);
        assert!((f64::hypot(re, im) / want.norm() - 1.0).abs() < 1e-4, "{hz} Hz: {re} {im}");
        assert!((f64::atan2(im, re) - want.arg()).abs() < 2e-4, "{hz} Hz: {re} {im} {want}");
    }
}

#[test]
fn oracle_the_linear_model_is_what_the_running_rig_does() {
    let rig = rig(|_| {});
    let bench = Bench {
        setup: RigSetup::of_rig(&rig, HydraulicPreset::Printed, None),
        x_34: rig.docking.pose([-1.0, 1.0, -1.0, 1.0, 1.0, -1.0]),
        payload_n_m: DVec3::Y * 1e6,
        lever_m: 1.1,
        foreseen: false,
    };
    let linear = bench.linear().unwrap();
    assert!(matches!(linear, LinearModel::Loop(_)));
    for (dof, hz) in [(0, 3.0), (4, 8.0)] {
        let amplitude = if dof < 3 { 1e-3 } else { 1e-3 / 1.1 };
        let m = bench.stepped_sine(dof, amplitude, hz, 1.5, 0.5).unwrap();
        let l = bench.linear_point(&linear, dof, hz).unwrap();
        let worst = (0..6).map(|i| (m.response[i] - l.response[i]).norm()).fold(0.0, f64::max);
        assert!(worst < 2e-3, "{dof} {hz} Hz: {m:?} against {l:?}");
    }
    let poles = linear.poles().unwrap();
    assert_eq!(poles.len(), 2);
    assert!((poles[0].frequency_hz - 12.0).abs() < 1e-9 && (poles[0].damping - 0.7).abs() < 1e-12);
}

#[test]
fn invariant_speed_and_acceleration_stay_within_their_limits() {
    let rig = rig(|_| {});
    let mut closed = closed(&rig);
    let mut command = at_rest(&closed);
    command.legs.iter_mut().for_each(|l| l.length_m += 0.3);
    let (mut before, mut fastest, mut hardest) = (0.0, 0.0_f64, 0.0_f64);
    for _ in 0..2000 {
        let m = closed.tick(&command, free).unwrap();
        let v = m.speed_m_s[1];
        (fastest, hardest) = (fastest.max(v.abs()), hardest.max((v - before).abs() / TICK_S));
        before = v;
    }
    assert!((fastest - 0.7).abs() < 1e-6, "{fastest} m/s");
    assert!((hardest - 15.0).abs() < 1e-3, "{hardest} m/s²");
    let left = closed.measure().length_m[1] - command.legs[1].length_m;
    assert!(left.abs() < 1e-6, "{left} m from where it was sent");
}

/// A load below the legs' force does not move the plate; one above it does, and the plate accelerates as its mass
/// says under the load and legs that push with all they have.
#[test]
fn oracle_legs_give_way_beyond_their_force() {
    let rig = rig(|_| {});
    let push = |n: f64| Wrench { f: DVec3::X * n, m: DVec3::Y * 500.0 };
    for (load_n, gives_way) in [(-2e4, false), (-1e5, true)] {
        let mut closed = closed(&rig);
        let (command, begin) = (at_rest(&closed), closed.state().x_bp);
        let mut m = closed.measure();
        for _ in 0..10 {
            m = closed.tick(&command, |_, _| push(load_n)).unwrap();
        }
        let moved = (m.x_bp.p - begin.p).length();
        let most = m.force_n.iter().fold(0.0_f64, |a, f| a.max(f.abs()));
        assert_eq!(moved > 1e-6, gives_way, "{load_n} N: {moved} m, {:?}", m.force_n);
        assert!(most <= 15e3, "{most} N");
        assert_eq!(most > 14_999.0, gives_way, "{most} N");
        let platform = closed.platform();
        let (c, s) = (platform.at(&m.x_bp), closed.state());
        let a = platform.forward_dynamics(&c, &m.twist, &m.force_n, &push(load_n)).unwrap();
        let off = (a.v - s.acceleration.v).length() / (1.0 + a.v.length());
        assert!(off < 2e-2, "{load_n} N: {a:?} instead of {:?}", s.acceleration);
    }
}

#[test]
fn regress_a_plant_on_oil_is_no_form_of_a_rig_without() {
    let rig = rig(|_| {});
    let setup = RigSetup::of_rig(&rig, HydraulicPreset::Printed, None);
    assert!(matches!(setup.drive, DriveSetup::Loops { .. }) && setup.hydraulic().is_none());
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf/stewart.urdf");
    let on_oil = load_rig(&path).unwrap().model;
    let legs = RigSetup::of_rig(&on_oil, HydraulicPreset::Printed, None);
    let plant = docktwin_physics::rig::ReducedRig::new(
        setup.platform.clone(),
        &legs.hydraulic().unwrap().legs,
        1.25e-4,
    );
    let refused = ClosedRig::with_plant(plant, &setup, &rig.middle()).map(|_| ());
    assert_eq!(refused, Err(SetupError::NoOil));
}

#[test]
fn invariant_a_drawn_rig_has_other_loops_and_repeats() {
    let rig = rig(|_| {});
    let loops = |seed| {
        let setup = RigSetup::of_rig(&rig, HydraulicPreset::Printed, Some(seed));
        let DriveSetup::Loops { loops, .. } = setup.drive else { panic!("loops") };
        (loops, setup.dead_time_s)
    };
    assert_eq!(loops(3), loops(3));
    let ((three, late), (four, _)) = (loops(3), loops(4));
    assert!(three != four && three[0] != three[1] && (late - 0.004).abs() <= 0.001);
    assert!(three.iter().all(|l| (l.natural_frequency_hz / 12.0 - 1.0).abs() <= 0.1));
    let damping = three.each_ref().map(|l| l.damping_ratio.expect("second order"));
    assert!(
        damping.iter().all(|z| (z / 0.7 - 1.0).abs() <= 0.2)
            && (damping[0] - damping[1]).abs() > 1e-6
    );
}
