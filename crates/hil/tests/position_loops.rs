//! A rig without oil and with one force sensor, and rigs that lack other sensors: loop, identification, calibration.

mod stand;

use docktwin_control::{feedforward::LegCorrections, safety::SafetyLimits};
use docktwin_core::{PERIOD_NS, Pose};
use docktwin_hil::{
    calibrate::{CalibrateError, CalibrateSetup, calibrate},
    clock::VirtualClock,
    drive::{Drive, DriveSetup},
    identify::{IdentifyError, IdentifySetup, identify},
    scheduler::{Loop, RigParameters, believed_delays_s},
};
use docktwin_model::{HydraulicPreset, Rig, load_rig};
use docktwin_rigport::{
    in_process::InProcess,
    message::{Capabilities, DriveKind, RigCommand, RigMeasurement},
    rig::{CommandForm, Plant},
};
use stand::{Stand, TICK_NS, free_stick, model};

const HIDDEN_LEGS: Capabilities = Capabilities::LEG_LENGTH.union(Capabilities::LEG_SPEED);

fn hexapod() -> Stand {
    let rig = load_rig(&model("electric_hexapod.urdf")).expect("as the model says").model;
    Stand { rig, preset: HydraulicPreset::Printed, drawn: None }
}

/// A rig that does not report some of what it has.
struct Without<P>(P, Capabilities);

impl<P: Plant> Without<P> {
    fn hide(&self, m: RigMeasurement) -> RigMeasurement {
        RigMeasurement { capabilities: m.capabilities.difference(self.1), ..m }
    }
}

impl<P: Plant> Plant for Without<P> {
    fn command_form(&self) -> CommandForm {
        self.0.command_form()
    }

    fn answer(&mut self, command: &RigCommand) -> RigMeasurement {
        let m = self.0.answer(command);
        self.hide(m)
    }

    fn alone(&mut self, period_ns: u64) -> RigMeasurement {
        let m = self.0.alone(period_ns);
        self.hide(m)
    }
}

fn drive_of<P: Plant>(stand: &Stand, plant: P) -> Drive<InProcess<P>, VirtualClock> {
    let setup = DriveSetup {
        rig: stand.rig.clone(),
        feedforward: stand.believed().feedforward(),
        corrections: LegCorrections::default(),
        limits: SafetyLimits::of_rig(&stand.rig, 500.0, f64::INFINITY),
        speed: [0.1, 0.1],
        session: 7,
        patience: core::time::Duration::ZERO,
    };
    Drive::start(setup, InProcess::new(plant), VirtualClock::new(TICK_NS)).expect("it starts")
}

fn setup(stand: &Stand, dofs: Vec<usize>) -> IdentifySetup {
    IdentifySetup {
        legs: stand.believed().hydraulic().map(|oil| oil.believed_legs),
        place: stand.middle(),
        room_m: 0.2,
        dofs,
        hz: vec![0.941, 5.0],
        lever_m: 0.5,
    }
}

fn delay_of_file(rig: &Rig) -> f64 {
    believed_delays_s(rig)[0]
}

#[test]
fn oracle_an_electric_rig_is_identified_without_valves() {
    let stand = hexapod();
    let plant = stand.emulated(free_stick(), &stand.middle());
    let mut drive = drive_of(&stand, plant);
    let found = identify(&mut drive, &setup(&stand, vec![1, 5])).expect("it identifies");
    // 4 ms of transport, 2·0.7/ω of the loop, less the tick that a command is ahead.
    let want = 0.004 + 1.4 / (core::f64::consts::TAU * 12.0) - 1e-3;
    assert!((delay_of_file(&stand.rig) - want).abs() < 1e-12);
    assert!((found.delay_s() - want).abs() < 1e-4, "{} s instead of {want}", found.delay_s());
    let l = stand.rig.drive.position_loop().expect("it has loops");
    for p in &found.response {
        let off = p.gain.norm() / l.response(p.hz).norm() - 1.0;
        assert!(off.abs() < 1e-3 && p.coupling < 1e-3, "{p:?}: {off}");
    }
    assert!(found.found.valves.is_none() && found.found.legs.is_some());
    assert_eq!(found.corrections(), LegCorrections::default());
    // The lead is of the frequency nearest to 2.308 Hz, and has the lag of sensor A in it.
    let a = stand.rig.sensors.expect("it has sensors").force;
    let lead = RigParameters::new(&stand.rig, Some(&found), None).lead_s;
    let sensor = 1.4 / (core::f64::consts::TAU * 320.0) + a.delay_s;
    let near = -l.response(5.0).arg() / (core::f64::consts::TAU * 5.0) - 1e-3 + sensor;
    assert!((lead - near).abs() < 1e-4, "{lead} s instead of {near}");
}

/// A hydraulic rig that reports no openings, and one that reports nothing of its legs.
#[test]
fn oracle_delay_is_found_by_what_is_measured() {
    let stand = Stand::new(None);
    let want = delay_of_file(&stand.rig);
    for (hidden, legs) in
        [(Capabilities::VALVE_SPOOL, true), (HIDDEN_LEGS | Capabilities::VALVE_SPOOL, false)]
    {
        let plant = stand.emulated(free_stick(), &stand.middle());
        if !legs {
            // Without lengths the plate's pose is needed, and the emulated rig does not measure it.
            let plant = WithPose(Without(plant, hidden));
            let mut drive = drive_of(&stand, plant);
            let found = identify(&mut drive, &setup(&stand, Vec::new())).expect("it identifies");
            assert!(found.found.legs.is_none() && found.found.valves.is_none());
            assert!((found.delay_s() - want).abs() < 1e-4, "{}", found.delay_s());
            continue;
        }
        let mut drive = drive_of(&stand, Without(plant, hidden));
        let found = identify(&mut drive, &setup(&stand, Vec::new())).expect("it identifies");
        assert!(found.found.legs.is_some() && found.found.valves.is_none());
        assert!((found.delay_s() - want).abs() < 1e-4, "{}", found.delay_s());
    }
}

/// A rig that measures the pose of its plate: the truth.
struct WithPose<P>(P);

impl<P: Plant> Plant for WithPose<P> {
    fn command_form(&self) -> CommandForm {
        self.0.command_form()
    }

    fn answer(&mut self, command: &RigCommand) -> RigMeasurement {
        posed(self.0.answer(command))
    }

    fn alone(&mut self, period_ns: u64) -> RigMeasurement {
        posed(self.0.alone(period_ns))
    }
}

fn posed(m: RigMeasurement) -> RigMeasurement {
    RigMeasurement {
        capabilities: m.capabilities | Capabilities::PLATE_POSE,
        plate_position_m: m.truth_position_m,
        plate_attitude: m.truth_attitude,
        ..m
    }
}

/// A rig that says that it reports openings, and reports none.
struct Mute<P>(P);

impl<P: Plant> Plant for Mute<P> {
    fn command_form(&self) -> CommandForm {
        self.0.command_form()
    }

    fn answer(&mut self, command: &RigCommand) -> RigMeasurement {
        RigMeasurement { valve_spool: [0.0; 6], ..self.0.answer(command) }
    }

    fn alone(&mut self, period_ns: u64) -> RigMeasurement {
        RigMeasurement { valve_spool: [0.0; 6], ..self.0.alone(period_ns) }
    }
}

#[test]
fn regress_openings_that_are_promised_and_not_there_are_refused() {
    let stand = Stand::new(None);
    let mut drive = drive_of(&stand, Mute(stand.emulated(free_stick(), &stand.middle())));
    let refused = identify(&mut drive, &setup(&stand, Vec::new())).expect_err("they are all 0");
    assert_eq!(refused, IdentifyError::NoSpool);
}

#[test]
fn invariant_it_reports_what_its_file_has() {
    let stand = hexapod();
    // A place where no leg is as long as another.
    let aside = stand.rig.docking.pose([0.3, 0.5, -0.4, 0.2, -0.3, 0.1]);
    let mut plant = stand.emulated(free_stick(), &aside);
    let m = plant.alone(PERIOD_NS);
    assert_eq!(DriveKind::from_number(m.drive), Some(DriveKind::PositionLoop));
    let lacks = Capabilities::SENSOR_B
        | Capabilities::ACCELEROMETER
        | Capabilities::VALVE_SPOOL
        | Capabilities::LEG_FORCE;
    assert!(!m.capabilities.intersects(lacks), "{:?}", m.capabilities);
    assert!(m.has(Capabilities::SENSOR_A) && m.has(Capabilities::LEG_LENGTH));
    let whole = |step_m: f64| {
        let counts = m.leg_length_m.map(|l| l / step_m);
        counts.iter().all(|c| (c - c.round()).abs() < 1e-6)
    };
    assert!(whole(1e-5) && !whole(2e-5), "{:?} m in counts of 0.01 mm", m.leg_length_m);
    let mut drive = drive_of(&stand, plant);
    let sensors = stand.rig.sensors.expect("it has sensors");
    let refused = calibrate(&mut drive, &CalibrateSetup::at(stand.middle(), sensors));
    assert_eq!(refused.expect_err("it has no sensor B"), CalibrateError::NothingToFind);
}

/// The checklist passes with sensor A alone, also on a hydraulic rig, and asks for B where two are wanted.
#[test]
fn invariant_the_checklist_asks_for_what_the_loop_needs() {
    let mut on_oil = Stand::new(None);
    on_oil.rig.sensors.as_mut().expect("it has sensors").plate_force = false;
    for stand in [hexapod(), on_oil] {
        for two in [false, true] {
            let system = free_stick();
            let bodies = still(&system);
            let mut set = stand.loop_setup(&system, &bodies, 1.0, 100);
            if two {
                set.scheme = docktwin_control::sensing::SensorScheme::Two;
            }
            let plant = stand.emulated(system, &stand.middle());
            let idle = Loop::new(set, InProcess::new(plant), VirtualClock::new(TICK_NS));
            let armed = idle.arm(Vec::new()).map(|a| a.checks().to_vec());
            match armed {
                Ok(checks) => {
                    assert!(!two, "it has no sensor B");
                    let b = checks.iter().find(|c| c.name == "sensor B").expect("a line of it");
                    assert!(b.passed && b.found.contains("none is needed"), "{b:?}");
                }
                Err(e) => {
                    assert!(two, "{e}");
                    assert!(e.to_string().contains("sensor B"), "{e}");
                }
            }
        }
    }
}

fn still(system: &docktwin_physics::mechanism::System) -> [docktwin_physics::body::BodyState; 3] {
    use docktwin_core::DVec3;
    use docktwin_physics::{body::BodyState, mechanism::TARGET};
    let docked = system.mechanism().docked_length_m();
    let at = |i: usize| {
        let mut pose = Pose::IDENTITY;
        if i == TARGET {
            let [x_13, x_24] = system.ports();
            pose = x_13 * Pose::from_translation(DVec3::X * docked) * x_24.inverse();
        }
        let drift = if i == TARGET { DVec3::X * -1e-4 } else { DVec3::ZERO };
        BodyState::new(&system.mass()[i], pose, drift, DVec3::ZERO)
    };
    let mut bodies = [at(0), at(1), at(2)];
    system.follow(&mut bodies);
    bodies
}
