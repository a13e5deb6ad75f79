//! Table 4, row 3, through the whole loop on a rig of another language and another process: it follows
//! exactly, so the test must come out as in nature without any compensation.

mod common;

use std::{path::Path, time::Duration};

use common::{PATIENCE, Sensors, python_rig, unique};
use docktwin_control::{
    compensator::Compensation, rig::RigSetup, safety::SafetyLimits, sensing::SensorScheme,
};
use docktwin_hil::{
    clock::VirtualClock,
    ipc::IpcRig,
    scheduler::{Approach, LegCorrections, Loop, LoopSetup, Phase, TickRecord},
    vibro::{Axis, Contact, TABLE_4, VibroTest},
};
use docktwin_model::{
    DockingMechanism, HydraulicPreset, Rig, Spacecraft, load_mechanism, load_rig, load_spacecraft,
};
use docktwin_physics::{mounted::Payload, programme::Programme, reduced::Inputs};

const TICK_NS: u64 = 1_000_000;

struct Models {
    rig: Rig,
    stick: DockingMechanism,
    body: Spacecraft,
}

fn models() -> Models {
    let at = |f: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(f);
    let stick = load_mechanism(&at("stick_active.urdf"), &at("stick_passive.urdf"), None);
    Models {
        rig: load_rig(&at("stewart.urdf")).expect("the default rig").model,
        stick: stick.expect("the stick").model,
        body: load_spacecraft(&at("test_2026kg.urdf")).expect("the body").model,
    }
}

/// A loop that compensates nothing and believes in no delay.
fn setup(m: &Models, test: &VibroTest) -> LoopSetup {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few seconds")]
    let ticks = (test.duration_s(1) * 1e3) as u64;
    LoopSetup {
        feedforward: RigSetup::of_rig(&m.rig, HydraulicPreset::Printed, None).feedforward(),
        corrections: LegCorrections::default(),
        bodies: Programme::new(&test.system, &test.bodies, 1e-3),
        compensation: Compensation::None,
        added_ticks: 0,
        scheme: SensorScheme::Single,
        payload: Payload::of(m.rig.passive_payload, &m.rig.x_4p.inverse()),
        interface_delay_s: 0.0,
        limits: SafetyLimits::of_rig(&m.rig, 5e3, 5e3),
        approach: Approach {
            speed_m_s: 0.05,
            rate_rad_s: 0.05,
            settle_s: 0.5,
            run_up_s: test.run_up_s(),
        },
        ticks,
        session: 1,
        patience: PATIENCE,
        dry_run: false,
        rig: m.rig.clone(),
    }
}

fn run(m: &Models, test: &VibroTest, rig: IpcRig) -> Vec<Contact> {
    let idle = Loop::new(setup(m, test), rig, VirtualClock::new(TICK_NS));
    let mut running = idle.arm(Vec::new()).expect("the rig is ready").start();
    let mut records: Vec<TickRecord> = Vec::new();
    while !running.finished() {
        records.push(running.tick(&Inputs::default()).expect("the rig answers"));
    }
    assert_eq!(running.stop().end().trip, None);
    let closed = records.iter().filter(|r| r.phase == Phase::Closed);
    #[expect(clippy::cast_precision_loss, reason = "a few seconds")]
    let time_s = |r: &TickRecord| r.closed_tick.expect("closed") as f64 * 1e-3;
    test.judge(&closed.map(|r| test.sample(r, time_s(r))).collect::<Vec<_>>())
}

#[test]
fn oracle_table_4_row_3_on_a_rig_without_delay_is_as_in_nature() {
    let m = models();
    for axis in ["x", "y"] {
        let name = unique("vibro");
        let options = ["--axis", axis];
        let Some(_child) = python_rig(&name, Sensors::AsOfSteel, &options) else { return };
        let rig = IpcRig::connect(&name, Duration::from_secs(60)).expect("the rig comes");
        let along = Axis::ALL.iter().find(|a| a.0 == axis).expect("an axis").1;
        let test = VibroTest::new(TABLE_4[2], &[along], &m.body, &m.stick).expect("a test");
        let contacts = run(&m, &test, rig);
        assert!(!contacts.is_empty());
        for c in contacts {
            assert!((c.r_e - 1.0).abs() < 1e-3, "{axis}: R_e {}", c.r_e);
            assert!((c.r_t - 1.0).abs() < 1e-3, "{axis}: R_T {}", c.r_t);
            assert!((c.peak_ratio - 1.0).abs() < 2e-3, "{axis}: peak {}", c.peak_ratio);
            assert!(c.nrms_force < 2e-3, "{axis}: NRMS {}", c.nrms_force);
        }
    }
}
