//! Figures of waveforms that are known in closed form.

use core::f64::consts::PI;

use docktwin_core::{DQuat, DVec3, PORT_CONTACT_N, Pose, Twist, Wrench};
use docktwin_record::Fidelity;

use super::{
    Comparison, PortState, Trace,
    latches::{LatchTimes, RigLatches},
    tick_s,
};

/// Duration of the blow, s, and its peak, N.
const BLOW_S: f64 = 0.2;
const PEAK_N: f64 = 2000.0;
/// Its rate, rad/s.
const RATE: f64 = PI / BLOW_S;

/// A half sine that begins at `t = 0`, with a moment of a tenth of it, on a port that closes at 0.1 m/s.
fn blow(t: f64) -> PortState {
    let f = if (0.0..BLOW_S).contains(&t) { PEAK_N * (RATE * t).sin() } else { 0.0 };
    PortState {
        wrench: Wrench { f: DVec3::X * f, m: DVec3::Y * 0.1 * f },
        x_34: Pose::new(DVec3::X * (0.5 - 0.1 * t), DQuat::from_rotation_x(0.05 * t)),
        twist: Twist { v: DVec3::X * -0.1, w: DVec3::ZERO },
    }
}

fn side(hardware: PortState, felt: PortState) -> Trace {
    Trace { felt, hardware: Some(hardware), speed_m_s: 0.1, kinetic_j: 100.0 }
}

/// The figures of a loop `hil` against the blow, both functions of the time in the run, s; the blow of the
/// simulated system begins at 0.1 s, its latches catch at these times.
fn compared(hil: impl Fn(f64) -> Trace, latched_s: [Option<f64>; 3], ticks: u32) -> Fidelity {
    let mut c = Comparison::default();
    for k in 0..ticks {
        let t = f64::from(k) * tick_s();
        let truth = blow(t - 0.1);
        // What has not happened yet is not known.
        let latches = LatchTimes { latched_s: latched_s.map(|l| l.filter(|l| *l <= t)) };
        c.add(&hil(t), &side(truth, truth), latches);
    }
    c.fidelity(&RigLatches::default())
}

/// Where the threshold lies in a blow, s after its beginning.
fn onset_s(peak_n: f64) -> f64 {
    (PORT_CONTACT_N / peak_n).asin() / RATE
}

/// The same later, by parts of a tick: everything is 1 and 0, and the shift is told.
#[test]
fn oracle_a_shift_is_no_error() {
    for shift in [0.0, 0.0004, 0.0137, -0.0263] {
        let f = compared(|t| side(blow(t - 0.1 - shift), blow(t - 0.1 - shift)), [None; 3], 600);
        let told = f.first_contact_difference_s.expect("contact in both");
        // A sine carried on as the line of its ticks t₁, t₂ is off by RATE² t₁ t₂ (t₁ + t₂)/6, at most
        // RATE² tick³ on either side.
        let most = 2.0 * RATE * RATE * tick_s().powi(3);
        assert!((told - shift).abs() < most, "{told} {shift}");
        assert!((f.R_T.expect("a contact of 0.2 s") - 1.0).abs() < 1e-4);
        for of in [f.felt, f.hardware] {
            let w = of.expect("always").whole_run;
            let is = |x: Option<f64>, value: f64, within: f64| {
                let x = x.expect("defined");
                assert!((x - value).abs() < within, "{x} {value} at {shift} s");
            };
            // Between ticks a line is below the sine by (RATE tick)²/8 of its height, 3e-5.
            is(w.peak_force_ratio, 1.0, 1e-4);
            is(w.nrms_force, 0.0, 1e-3);
            is(w.nrms_moment, 0.0, 1e-3);
            is(w.impulse_ratio, 1.0, 1e-3);
            is(w.delta_energy, 0.0, 1e-3);
            // Positions are not shifted back by a constant: the same motion, the same figure.
            is(w.nrms_pose, 0.0, 1e-3);
            is(w.nrms_attitude, 0.0, 1e-3);
        }
    }
}

/// A tenth more force, on a port a millimetre and a milliradian off.
#[test]
fn oracle_a_larger_blow_is_larger_by_its_part() {
    let off = |t: f64| {
        let mut s = blow(t - 0.1);
        s.wrench = Wrench { f: s.wrench.f * 1.1, m: s.wrench.m * 1.1 };
        s.x_34.p.y += 1e-3;
        s.x_34.q = DQuat::from_rotation_y(1e-3) * s.x_34.q;
        s
    };
    let f = compared(|t| side(off(t), blow(t - 0.1)), [None; 3], 600);
    let hardware = f.hardware.expect("always").whole_run;
    let is = |x: Option<f64>, value: f64| {
        let x = x.expect("defined");
        assert!((x - value).abs() < 2e-3 * value.abs(), "{x} {value}");
    };
    is(hardware.peak_force_ratio, 1.1);
    is(hardware.peak_moment_ratio, 1.1);
    is(hardware.nrms_force, 0.1);
    is(hardware.nrms_moment, 0.1);
    is(hardware.impulse_ratio, 1.1);
    // 0.1 m/s against a tenth of the impulse 2 F / rate, over 100 J.
    is(hardware.delta_energy, -0.1 * 0.1 * 2.0 * PEAK_N / RATE / 100.0);
    // RMS about the mean of a motion at constant speed over T: speed · T/√12.
    let spread = hardware.window_s.expect("whole run") / 12.0_f64.sqrt();
    is(hardware.nrms_pose, 1e-3 / (0.1 * spread));
    is(hardware.nrms_attitude, 1e-3 / (0.05 * spread));
    // What is felt is the simulated blow.
    let felt = f.felt.expect("always").whole_run;
    assert!(felt.nrms_force.expect("defined") < 1e-3);
    // The keys without a part are of the hardware.
    assert_eq!(f.nrms_force, hardware.nrms_force);
    assert_eq!(f.nrms_pose, hardware.nrms_pose);
}

/// A sensor that lags by τ: the wave is right, but what is felt belongs to a port that has gone on by v τ.
#[test]
fn oracle_a_lagging_sensor_is_felt_off_its_place() {
    let lag = 0.002;
    let late = |t: f64| PortState { wrench: blow(t - 0.1 - lag).wrench, ..blow(t - 0.1) };
    let f = compared(|t| side(blow(t - 0.1), late(t)), [None; 3], 600);
    let hardware = f.hardware.expect("always").whole_run;
    assert!(hardware.nrms_force.expect("defined") < 1e-3);
    assert!(hardware.nrms_pose.expect("defined") < 1e-3);
    let felt = f.felt.expect("always").whole_run;
    assert!(felt.nrms_force.expect("defined") < 1e-3);
    let spread = felt.window_s.expect("whole run") / 12.0_f64.sqrt();
    let (found, expected) = (felt.nrms_pose.expect("defined"), lag / spread);
    assert!((found - expected).abs() < 2e-3 * expected, "{found} {expected}");
}

/// Force and motion do not fit each other: a wave of another shape is told by what its difference is.
#[test]
fn oracle_another_wave_is_told_by_its_difference() {
    // A third harmonic of a tenth: RMS 0.1 of that of the fundamental.
    let bent = |t: f64| {
        let mut s = blow(t - 0.1);
        if (0.1..0.1 + BLOW_S).contains(&t) {
            s.wrench.f.y += 0.1 * PEAK_N * (3.0 * RATE * (t - 0.1)).sin();
        }
        s
    };
    let f = compared(|t| side(bent(t), bent(t)), [None; 3], 600);
    let found = f.hardware.expect("always").whole_run.nrms_force.expect("defined");
    assert!((found - 0.1).abs() < 5e-4, "{found}");
}

/// Windows end where the simulated system latches, whatever comes later.
#[test]
fn oracle_windows_end_with_the_latches() {
    let hil = |t: f64| {
        // A second blow after the first latch that the simulated system does not have.
        let mut s = blow(t - 0.1);
        if (0.4..0.45).contains(&t) {
            s.wrench.f.x += 4000.0;
        }
        side(s, s)
    };
    let f = compared(hil, [Some(0.35), Some(0.36), Some(0.38)], 2000);
    let h = f.hardware.expect("always");
    let first = h.to_first_latch;
    assert!((first.peak_force_ratio.expect("defined") - 1.0).abs() < 1e-4);
    assert!((first.window_s.expect("it latched") - (0.35 - 0.1 - onset_s(PEAK_N))).abs() < 1.1e-3);
    let capture = h.to_capture;
    assert!((capture.peak_force_ratio.expect("defined") - 2.0).abs() < 1e-3);
    assert!(
        (capture.window_s.expect("it was captured") - (1.38 - 0.1 - onset_s(PEAK_N))).abs()
            < 1.1e-3
    );
    // A run that ends before has no such window, nor has one that never latches.
    let short = compared(hil, [Some(0.35), Some(0.36), Some(0.38)], 1000);
    assert_eq!(short.hardware.expect("always").to_capture.window_s, None);
    let never = compared(hil, [None; 3], 2000).hardware.expect("always");
    assert_eq!((never.to_first_latch.nrms_force, never.to_capture.nrms_force), (None, None));
}

/// What means nothing is null: no moment to compare, a contact too short for R_T, no contact at all.
#[test]
fn invariant_what_means_nothing_is_null() {
    let mut c = Comparison::default();
    for k in 0..200 {
        let on = (50..64).contains(&k);
        let wrench = Wrench { f: if on { DVec3::X * 500.0 } else { DVec3::ZERO }, m: DVec3::ZERO };
        let s = PortState { wrench, ..PortState::default() };
        c.add(&side(s, s), &side(s, s), LatchTimes::default());
    }
    let f = c.fidelity(&RigLatches::default());
    let h = f.hardware.expect("always").whole_run;
    assert_eq!((f.R_T, h.nrms_moment, h.peak_moment_ratio, h.nrms_pose), (None, None, None, None));
    assert_eq!((h.peak_force_ratio, h.nrms_force), (Some(1.0), Some(0.0)));
    assert!(f.R_e.is_some());

    let nothing = Comparison::default().fidelity(&RigLatches::default());
    assert_eq!(nothing.felt, Some(docktwin_record::FidelityOf::default()));
    assert_eq!(nothing.nrms_force, None);
}

/// A rig that does not tell its truth is compared by what is felt.
#[test]
fn invariant_without_truth_there_is_no_hardware() {
    let hil = |t: f64| Trace { hardware: None, ..side(blow(t - 0.1), blow(t - 0.1)) };
    let f = compared(hil, [None; 3], 600);
    assert_eq!(f.hardware, Some(docktwin_record::FidelityOf::default()));
    assert!(f.felt.expect("always").whole_run.nrms_force.expect("defined") < 1e-3);
    assert_eq!(f.nrms_force, f.felt.expect("always").whole_run.nrms_force);
}
