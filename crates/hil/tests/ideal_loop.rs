//! The whole loop on a rig without mass, delay or error: what remains is the loop's own error.

mod common;

use common::stick::{Models, axis, models, settings};
use docktwin_control::compensation::Compensation;
use docktwin_core::PERIOD_NS;
use docktwin_hil::{clock::VirtualClock, ideal::IdealRig, scheduler::Loop};
use docktwin_rigport::in_process::InProcess;
use docktwin_study::table4::{Contact, Row, TABLE_4, VibroTest};

/// The first contact of a row along or about an axis.
fn contact(m: &Models, name: &str, row: Row, compensation: Compensation) -> Contact {
    let test = VibroTest::new(row, &[axis(name)], &m.body, &m.stick).expect("a stick");
    let stick = test.system.mechanism().stick.expect("a stick");
    let docked_m = m.stick.docked_length_m();
    let start = m.rig.plate_from_docking(&m.rig.docking.pose([0.0; 6]));
    let rig = InProcess::new(IdealRig::new(&m.rig, stick, docked_m, start));
    let setup = test.setup(&m.rig, &settings(compensation)).expect("it can be run");
    let idle = Loop::new(setup, rig, VirtualClock::new(PERIOD_NS));
    let run = test.run(idle, |_| ()).expect("armed, and answered to the end");
    assert_eq!(run.trip, None, "{name} {}", row.frequency_hz);
    *run.contacts.first().expect("a contact")
}

/// With G_I = 1 nothing is to be compensated, and every row comes out as the simulated system.
#[test]
fn oracle_table_4_with_an_ideal_rig() {
    let m = models();
    for name in ["x", "y", "z", "roll", "pitch", "yaw"] {
        for row in &TABLE_4[..6] {
            let c = contact(&m, name, *row, Compensation::None);
            let off = [c.r_e - 1.0, c.r_t - 1.0, c.peak_ratio - 1.0, c.nrms_force, c.nrms_position];
            assert!(off.iter().all(|x| x.abs() <= 1e-4), "{name} {}: {c:?}", row.frequency_hz);
        }
    }
}

/// What is not there must not be compensated: a lead of one tick takes π/2·ω·T of the speed.
#[test]
fn oracle_a_lead_without_a_delay_takes_energy() {
    let m = models();
    let row = TABLE_4[5];
    let c = contact(&m, "x", row, Compensation::Lead(1e-3));
    let rate = (2.0 * row.stiffness_n_m / row.mass_kg).sqrt();
    let expected = -core::f64::consts::FRAC_PI_2 * rate * 1e-3;
    assert!((c.r_e - 1.0 - expected).abs() < 0.1 * expected.abs(), "{} {expected}", c.r_e - 1.0);
}
