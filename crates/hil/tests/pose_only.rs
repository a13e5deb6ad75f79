//! The whole loop on rigs that take the plate's pose and no leg values, and measure the plate instead of legs.

mod common;

use common::{
    PoseOnly,
    stick::{axis, emulated, models, settings},
};
use docktwin_control::{compensation::Compensation, safety::Limit};
use docktwin_core::PERIOD_NS;
use docktwin_hil::{
    clock::VirtualClock,
    ideal::IdealRig,
    scheduler::{Loop, TickRecord},
};
use docktwin_physics::reduced::Inputs;
use docktwin_rigport::{in_process::InProcess, rig::Plant};
use docktwin_study::table4::{Contact, TABLE_4, VibroTest};

/// The first contact of row 6 along an axis, and what was sent and measured.
fn contact(name: &str, compensation: Compensation, pose_only: bool, ideal: bool) -> Contact {
    let m = models();
    let test = VibroTest::new(TABLE_4[5], &[axis(name)], &m.body, &m.stick).expect("a stick");
    let stick = test.system.mechanism().stick.expect("a stick");
    let start = m.rig.plate_from_docking(&m.rig.docking.pose([0.0; 6]));
    let plant = IdealRig::new(&m.rig, stick, m.stick.docked_length_m(), start);
    match (ideal, pose_only) {
        (true, true) => run(&m, &test, compensation, PoseOnly(plant), true),
        (true, false) => run(&m, &test, compensation, plant, false),
        (false, true) => run(&m, &test, compensation, PoseOnly(emulated(&m, &test)), true),
        (false, false) => run(&m, &test, compensation, emulated(&m, &test), false),
    }
}

fn run<P: Plant>(
    m: &common::stick::Models,
    test: &VibroTest,
    compensation: Compensation,
    plant: P,
    pose_only: bool,
) -> Contact {
    let setup = test.setup(&m.rig, &settings(compensation)).expect("it can be run");
    let idle = Loop::new(setup, InProcess::new(plant), VirtualClock::new(PERIOD_NS));
    let mut running = idle.arm(Vec::new()).expect("armed").start();
    let (mut samples, mut records): (Vec<_>, Vec<TickRecord>) = (Vec::new(), Vec::new());
    while !running.finished() {
        let r = running.tick(&Inputs::default()).expect("it answers");
        samples.extend(r.closed_tick.map(|k| test.sample(&r, k as f64 * 1e-3)));
        records.push(r);
    }
    let end = running.stop().into_end();
    assert_eq!(end.trip, None);
    for r in &records {
        assert!(r.fresh && r.command.is_finite());
        let legs = r.command.leg_length_m.iter().any(|l| *l != 0.0);
        let tracks = r.command.mode == docktwin_rigport::message::RigMode::Track as u32;
        assert_eq!(legs, tracks && !pose_only);
        assert_eq!(r.command.leg_count, if tracks && !pose_only { 6 } else { 0 });
    }
    // What is not measured has no margin; strokes are those of the file's legs all the same.
    assert_eq!(end.margins.of(Limit::LegForce).is_none(), pose_only);
    assert!(end.margins.of(Limit::Stroke).is_some_and(|x| x > 0.5));
    assert!(end.margins.of(Limit::LegSpeed).is_some_and(|x| (0.0..1.0).contains(&x)));
    *test.judge(&samples).first().expect("a contact")
}

/// With an ideal rig nothing is to be compensated, by whatever it is led.
#[test]
fn oracle_an_ideal_rig_led_by_its_pose_is_as_in_nature() {
    for name in ["x", "y", "pitch"] {
        let c = contact(name, Compensation::None, true, true);
        let off = [c.r_e - 1.0, c.r_t - 1.0, c.peak_ratio - 1.0, c.nrms_force, c.nrms_position];
        assert!(off.iter().all(|x| x.abs() <= 1e-4), "{name}: {c:?}");
    }
}

/// The emulated rig, led by its pose, does its own inverse dynamics: the same rig, led nearly as well.
#[test]
fn oracle_an_emulated_rig_led_by_its_pose_comes_near_the_one_led_by_its_legs() {
    for name in ["x", "y"] {
        let lead = Compensation::Lead(0.0018);
        let [legs, pose] = [false, true].map(|p| contact(name, lead, p, false));
        println!(
            "{name}: R_e {:.5} {:.5}, R_T {:.5} {:.5}",
            legs.r_e, pose.r_e, legs.r_t, pose.r_t
        );
        assert!((pose.r_e - legs.r_e).abs() < 5e-3 && (pose.r_t - legs.r_t).abs() < 5e-3);
        assert!((pose.peak_ratio - legs.peak_ratio).abs() < 1e-2);
    }
}
