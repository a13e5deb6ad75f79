//! Both sensor schemes, calibrated, against the true wrench at the ports: on a plate that moves and
//! carries weight, in contact, on drawn rigs.

mod common;

use common::{Stand, TICK_S, body, free_stick, model, stick};
use docktwin_control::sensing::SensorScheme;
use docktwin_core::{DVec3, Euler, Wrench};
use docktwin_hil::{
    calibrate::{CalibrateSetup, Calibration, Touch, calibrate},
    drive::wrench,
    identify::Identification,
    scheduler::{LegCorrections, LoopSetup, Phase, TickRecord},
    vibro::{Axis, TABLE_4, VibroTest},
};
use docktwin_model::{load_mechanism, load_spacecraft};
use docktwin_physics::{
    initial::{ContactConditions, initial_state},
    mechanism::System,
};

struct Known {
    stand: Stand,
    found: Identification,
    sensors: Calibration,
}

fn known(seed: u64) -> Known {
    let stand = Stand::new(Some(seed));
    let file = stand.rig.sensors.unwrap().force;
    let found = stand.identified(Vec::new(), Vec::new());
    let place = stand.middle();
    // With the stick in its frame for A's lateness, without it for everything else.
    let run = |system: System, setup: &CalibrateSetup| {
        let mut drive = stand.drive(system, &place, LegCorrections::default());
        let out = calibrate(&mut drive, setup).unwrap();
        drive.finish().unwrap();
        out
    };
    let mut setup = CalibrateSetup::at(place, file);
    let mut sensors = run(free_stick(), &setup);
    setup.tilt_rad = 0.015;
    setup.touch = Some(Touch { dof: 1, amplitude_m: 0.0135, hz: 2.0 });
    let touched = run(System::new(&body(), &body(), stick()), &setup);
    sensors.delay_s[0] = touched.delay_s[0];
    Known { stand, found, sensors }
}

impl Known {
    fn apply(&self, setup: &mut LoopSetup, scheme: SensorScheme) {
        let file = &self.stand.rig.sensors.unwrap().force;
        setup.scheme = scheme;
        setup.corrections = self.found.corrections();
        setup.payload = self.sensors.payload;
        // What B carries is felt when the plate is there, and read later still.
        setup.interface_delay_s = self.found.delay_s() + self.sensors.lag_s(1, file);
    }

    /// Largest force error at port 4 in the closed loop, N, and the largest true force. The truth is
    /// taken at the instant the reading is of: earlier by the sensor's lag as calibrated.
    fn errors(&self, records: &[TickRecord], scheme: SensorScheme) -> [f64; 3] {
        let file = &self.stand.rig.sensors.unwrap().force;
        let which = usize::from(scheme == SensorScheme::Two);
        let lag = self.sensors.lag_s(which, file) / TICK_S;
        let back = lag.floor();
        let closed: Vec<_> = records.iter().filter(|r| r.phase == Phase::Closed).collect();
        let (mut worst, mut top, mut square, mut n) = (0.0_f64, 0.0_f64, 0.0, 0.0);
        for k in 3..closed.len() {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 2")]
            let at = |i: usize| wrench(&closed[k - back as usize - i].measurement.truth_port4);
            let part = lag - back;
            let truth: Wrench =
                Wrench { f: at(0).f * (1.0 - part) + at(1).f * part, m: DVec3::ZERO };
            let error = (closed[k].ports.port4.f - truth.f).length();
            worst = worst.max(error);
            top = top.max(truth.f.length());
            square += error * error;
            n += 1.0;
        }
        [worst, top, f64::sqrt(square / n)]
    }
}

#[test]
fn oracle_both_schemes_with_the_stick_in_row_3() {
    for seed in [1, 2] {
        let k = known(seed);
        for dof in [0, 1] {
            let test = VibroTest::new(TABLE_4[2], &[Axis::ALL[dof].1], &body(), &stick()).unwrap();
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "ticks")]
            let ticks = (test.duration_s(2) * 1e3) as u64;
            for scheme in [SensorScheme::Single, SensorScheme::Two] {
                let mut setup =
                    k.stand.loop_setup(&test.system, &test.bodies, test.run_up_s(), ticks);
                k.apply(&mut setup, scheme);
                let records = k.stand.run(setup, test.system.clone(), &k.stand.middle());
                let [worst, top, rms] = k.errors(&records, scheme);
                println!(
                    "{seed} {dof} {scheme:?}: worst {worst:.2} N, rms {rms:.2} N of {top:.1} N"
                );
                assert!(worst < f64::max(5.0, 0.01 * top));
            }
        }
    }
}

#[test]
fn oracle_both_schemes_with_the_docking_mechanism() {
    let mechanism = load_mechanism(&model("apas_active.urdf"), &model("apas_passive.urdf"), None)
        .unwrap()
        .model;
    let chaser = load_spacecraft(&model("chaser_8t.urdf")).unwrap().model;
    let target = load_spacecraft(&model("target_12t.urdf")).unwrap().model;
    let system = System::new(&chaser, &target, mechanism);
    let conditions = ContactConditions {
        attitude: Euler { roll: 0.03, pitch: 0.01, yaw: -0.015 },
        lateral_m: DVec3::new(0.0, 0.02, -0.01),
        velocity_m_s: DVec3::new(-0.08, 0.0, 0.005),
        rate_rad_s: DVec3::ZERO,
    };
    let bodies = initial_state(&system, &conditions, 0.02).bodies;
    let k = known(1);
    let mut rest = k.stand.middle();
    rest.p.x += 0.25;
    for scheme in [SensorScheme::Single, SensorScheme::Two] {
        let mut setup = k.stand.loop_setup(&system, &bodies, 0.4, 3000);
        k.apply(&mut setup, scheme);
        let records = k.stand.run(setup, system.clone(), &rest);
        let [worst, top, rms] = k.errors(&records, scheme);
        println!("apas {scheme:?}: worst {worst:.2} N, rms {rms:.2} N of {top:.1} N");
        assert!(top > 100.0);
    }
}
