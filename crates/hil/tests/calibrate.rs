//! `rig calibrate` against the truth of drawn rigs, through the port.

mod stand;

use docktwin_control::feedforward::LegCorrections;
use docktwin_hil::{
    calibrate::{CalibrateError, CalibrateSetup, Calibration, Touch, calibrate},
    emulated::SENSOR_STREAM,
    faults::{Fault, FaultKind, FaultyRig, Instrument, When},
};
use docktwin_physics::{mechanism::System, sensor::SensorParameters};
use docktwin_rigport::in_process::InProcess;
use stand::{Stand, body, free_stick, stick};

/// A, B and the accelerometers.
fn sensors(stand: &Stand, seed: u64) -> [SensorParameters; 3] {
    let file = stand.rig.sensors.expect("as the model says");
    let felt = file.accelerometer.expect("as the model says");
    [(file.force, 0), (file.force, 1), (felt, 2)]
        .map(|(file, i)| SensorParameters::drawn(file, seed, SENSOR_STREAM + i))
}

fn calibrated(stand: &Stand, touch: bool) -> Calibration {
    let file = stand.rig.sensors.expect("as the model says");
    let mut setup = CalibrateSetup::at(stand.middle(), file);
    let mut system = free_stick();
    if touch {
        setup.touch = Some(Touch {
            dof: 1,
            amplitude_m: 0.0135,
            hz: 2.0,
            play_m: stick().stick.expect("a stick").play_m(),
        });
        setup.tilt_rad = 0.015;
        system = System::new(&body(), &body(), stick());
    }
    let mut drive = stand.drive(system, &setup.place, LegCorrections::default());
    let found = calibrate(&mut drive, &setup).expect("as the model says");
    drive.finish().expect("as the model says");
    found
}

fn judge(stand: &Stand, found: &Calibration, seed: u64) {
    let [a, b, felt] = sensors(stand, seed);
    let truth = stand.payload();
    let of_b = found.of_b.expect("a sensor B");
    let (p, t) = (&of_b.payload, &truth);
    println!(
        "{seed}: mass {:.3} for {:.3} kg, centre {} for {} m, late {:+.1} us ({:+.1} us off), rest {:?}",
        p.mass_kg,
        t.mass_kg,
        p.com_m,
        t.com_m,
        (of_b.delay_s - stand.rig.sensors.expect("as the model says").force.delay_s) * 1e6,
        (of_b.delay_s - b.model.delay_s) * 1e6,
        of_b.rest,
    );
    println!("   inertia {} for {}", p.inertia_kg_m2, t.inertia_kg_m2);
    println!("   zero {:?} off {}", b.zero, (of_b.zero.f - b.zero[0]));
    assert!((of_b.delay_s - b.model.delay_s).abs() < 5e-5);
    let late = found.accelerometer_delay_s.expect("as the model says") - felt.model.delay_s;
    println!("   accelerometers {:+.1} us off", late * 1e6);
    assert!(late.abs() < 5e-5);
    if let Some(late) = found.delay_a_s {
        println!("   A is {:+.1} us off", (late - a.model.delay_s) * 1e6);
        assert!((late - a.model.delay_s).abs() < 5e-5);
    }
    assert!((p.mass_kg / t.mass_kg - 1.0).abs() < 3e-3);
    assert!((p.com_m - t.com_m).length() < 2e-3);
    for (x, y) in p.inertia_kg_m2.to_cols_array().iter().zip(t.inertia_kg_m2.to_cols_array()) {
        assert!((x - y).abs() < 0.6);
    }
    assert!((of_b.zero.f - b.zero[0]).length() < 5.0);
}

/// Acceptance: skew of force against position ±50 µs; payload as it is.
#[test]
fn oracle_payload_and_skew_are_those_of_the_draw() {
    for seed in [1, 2, 3, 4] {
        let stand = Stand::new(Some(seed));
        judge(&stand, &calibrated(&stand, false), seed);
    }
}

/// With a stick in its frame the lateness of sensor A is found too; tilts are then small.
#[test]
fn oracle_a_touch_finds_the_skew_of_the_sensor_on_the_rack() {
    for seed in [5, 6, 7] {
        let stand = Stand::new(Some(seed));
        let found = calibrated(&stand, true);
        assert!(found.delay_a_s.is_some());
        judge(&stand, &found, seed);
    }
}

/// Without a sensor on the plate it is counted from the deflection of the stick, and without a touch there is nothing to
/// be found.
#[test]
fn oracle_a_touch_finds_the_skew_of_a_sensor_that_is_alone() {
    for seed in [5, 6, 7] {
        let mut stand = Stand::new(Some(seed));
        stand.rig.sensors.as_mut().expect("as the model says").plate_force = false;
        let found = calibrated(&stand, true);
        assert_eq!(found.of_b, None);
        let [a, ..] = sensors(&stand, seed);
        let off_s = found.delay_a_s.expect("a touch") - a.model.delay_s;
        println!("{seed}: A is {:+.1} us off", off_s * 1e6);
        assert!(off_s.abs() < 5e-5);
    }
}

/// Gravity lies along X: that Y and Z are interchanged, or an axis about which nothing turns at rest is
/// wired the wrong way round, shows in motion alone.
#[test]
fn invariant_a_wrong_axis_of_the_accelerometers_is_found() {
    let stand = Stand::new(None);
    let place = stand.middle();
    let setup = CalibrateSetup::at(place, stand.rig.sensors.expect("as the model says"));
    let accelerometer = Instrument::Accelerometer;
    for (what, axis) in [
        (FaultKind::AxesSwapped(accelerometer), 1),
        (FaultKind::AxisSign(accelerometer, 2), 2),
        (FaultKind::AxisSign(accelerometer, 4), 4),
    ] {
        let rig = InProcess::new(stand.emulated(free_stick(), &place));
        let rig = FaultyRig::new(rig, &[Fault::from(what, When::Tick(0))]);
        let mut drive = stand.lead(rig, LegCorrections::default());
        let found = calibrate(&mut drive, &setup).expect_err("an axis is wrong");
        let CalibrateError::Accelerometer { axis: told, .. } = found else { panic!("{found}") };
        assert_eq!(told, axis);
    }
}
