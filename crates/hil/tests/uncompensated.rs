//! Table 4 without compensation, whole loop against a linear simulation that knows nothing of it but
//! the interface that `rig identify` measured.

mod stand;

use core::f64::consts::TAU;

use docktwin_control::one_sided::{Interface, narrow_band, one_sided};
use docktwin_hil::{
    emulated::SENSOR_STREAM,
    identify::{FREQUENCIES_HZ, Identification},
    scheduler::Phase,
};
use docktwin_physics::sensor::SensorParameters;
use docktwin_study::table4::{Axis, Contact, TABLE_4, VibroTest};
use stand::{Stand, body, stick};

fn contact(stand: &Stand, test: &VibroTest, found: &Identification) -> Contact {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "ticks")]
    let ticks = (test.duration_s(1) * 1e3) as u64;
    let mut setup = stand.loop_setup(&test.system, &test.bodies, test.run_up_s(), ticks);
    setup.parameters.corrections = found.corrections();
    setup.parameters.interface_delay_s = found.delay_s();
    let records = stand.run(setup, test.system.clone(), &stand.middle());
    let samples: Vec<_> = records
        .iter()
        .filter(|r| r.phase == Phase::Closed)
        .map(|r| test.sample(r, r.closed_tick.expect("as the model says") as f64 * 1e-3))
        .collect();
    test.judge(&samples)[0]
}

fn hold_against_the_interface(stand: &Stand, seed: u64, rows: core::ops::Range<usize>) {
    let found = stand.identified(vec![0, 1], FREQUENCIES_HZ.to_vec());
    // The sensor that closes the loop, its delay as drawn: calibration has a test of its own.
    let sensor = SensorParameters::drawn(
        stand.rig.sensors.expect("as the model says").force,
        seed,
        SENSOR_STREAM,
    );
    for dof in [0, 1] {
        let (name, axis) = Axis::ALL[dof];
        let points = found.interface(dof, &sensor.model);
        let (g, distance) = Interface::fitted(&points).expect("as the model says");
        println!("{name}: {g:?} within {distance:.4}");
        assert!(distance < 0.02);
        for i in rows.clone() {
            let test =
                VibroTest::new(TABLE_4[i], &[axis], &body(), &stick()).expect("as the model says");
            let got = contact(stand, &test, &found);
            let w = test.rate_rad_s();
            let want = one_sided(&g, w).expect("as the model says");
            let form = narrow_band(g.at(w / TAU));
            println!(
                "  row {}: R_e {:.4} for {:.4} ({:.4}), R_T {:.4} for {:.4} ({:.4})",
                i + 1,
                got.r_e,
                want.r_e,
                form[0],
                got.r_t,
                want.r_t,
                form[1]
            );
            assert!((got.r_e / want.r_e - 1.0).abs() < 0.02);
            assert!((got.r_t / want.r_t - 1.0).abs() < 0.02);
            if i < 4 {
                assert!((got.r_e / form[0] - 1.0).abs() < 0.02);
                assert!((got.r_t / form[1] - 1.0).abs() < 0.02);
            }
        }
    }
}

#[test]
fn oracle_uncompensated_table_4_is_that_of_the_measured_interface() {
    hold_against_the_interface(&Stand::new(Some(1)), 1, 0..6);
}

/// A rig whose commands take 9 ms: R_e is then so far from 1 that nothing but the right interface
/// comes within 2 %.
#[test]
fn oracle_the_same_on_a_slow_rig() {
    let mut stand = Stand::new(Some(2));
    stand.rig.drive.set_dead_time_s(0.009);
    hold_against_the_interface(&stand, 2, 2..6);
}
