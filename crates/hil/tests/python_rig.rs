//! Table 4, row 3, through the whole loop on a rig of another language and another process: it follows
//! exactly, so the test must come out as in nature without any compensation.

mod common;

use std::time::Duration;

use common::{
    PATIENCE, Sensors, python_rig,
    stick::{axis, models, settings},
    unique,
};
use docktwin_control::compensation::Compensation;
use docktwin_core::PERIOD_NS;
use docktwin_hil::{clock::VirtualClock, scheduler::Loop};
use docktwin_rigport::ipc::IpcRig;
use docktwin_study::table4::{TABLE_4, VibroSettings, VibroTest};

#[test]
fn oracle_table_4_row_3_on_a_rig_without_delay_is_as_in_nature() {
    let m = models();
    let settings = VibroSettings { patience: PATIENCE, ..settings(Compensation::None) };
    for along in ["x", "y"] {
        let name = unique("vibro");
        let options = ["--axis", along];
        let Some(_child) = python_rig(&name, Sensors::AsOfSteel, &options) else { return };
        let rig = IpcRig::connect(&name, Duration::from_secs(60)).expect("the rig comes");
        let test = VibroTest::new(TABLE_4[2], &[axis(along)], &m.body, &m.stick).expect("a test");
        let setup = test.setup(&m.rig, &settings).expect("it can be run");
        let idle = Loop::new(setup, rig, VirtualClock::new(PERIOD_NS));
        let run = test.run(idle, |_| ()).expect("armed, and answered to the end");
        assert_eq!(run.trip, None, "{along}");
        assert!(!run.contacts.is_empty());
        for c in run.contacts {
            assert!((c.r_e - 1.0).abs() < 1e-3, "{along}: R_e {}", c.r_e);
            assert!((c.r_t - 1.0).abs() < 1e-3, "{along}: R_T {}", c.r_t);
            assert!((c.peak_ratio - 1.0).abs() < 2e-3, "{along}: peak {}", c.peak_ratio);
            assert!(c.nrms_force < 2e-3, "{along}: NRMS {}", c.nrms_force);
        }
    }
}
