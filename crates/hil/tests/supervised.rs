//! What a loop refuses to begin with, and what ends a run: every fault that a rig's measurements or
//! the bodies' commands can bring, on the emulated rig in virtual time.

mod common;

use std::path::Path;

use common::stick::{Models, Sent, Watched, axis, emulated, models, settings};
use docktwin_control::{
    compensation::Compensation,
    safety::{Limit, SafetyLimits, Trip, half_widths},
    sensing::SensorScheme,
};
use docktwin_core::{DVec3, PERIOD_NS};
use docktwin_hil::{
    clock::VirtualClock,
    faults::{Fault, FaultKind, Instrument, When},
    scheduler::{ArmError, Check, Loop, LoopSetup, Phase, TickRecord},
};
use docktwin_physics::{platform::Platform, reduced::Inputs};
use docktwin_rigport::{
    in_process::InProcess,
    message::{Flags, Refusal, RigMode},
    rig::RigError,
};
use docktwin_study::table4::{Row, TABLE_4, VibroSettings, VibroTest};

fn test(m: &Models) -> VibroTest {
    VibroTest::new(TABLE_4[5], &[axis("x")], &m.body, &m.stick).expect("a stick")
}

fn setup(m: &Models, test: &VibroTest) -> LoopSetup {
    let settings = settings(Compensation::Lead(0.0018));
    // All sensors count.
    let settings = VibroSettings { scheme: SensorScheme::Two, ..settings };
    test.setup(&m.rig, &settings).expect("it can be run")
}

/// Lengths of the plate in the middle of its workspace, all longer by `by_m`.
fn longer(m: &Models, by_m: f64) -> [f64; 6] {
    let platform = Platform::new(&m.rig);
    platform.at(&platform.middle()).length_m.map(|l| l + by_m)
}

/// How far all lengths must slip, with the plate in the middle, so that it seems to stand outside its
/// workspace with stroke left, and so that a leg seems to be at its end.
fn slips_m(m: &Models) -> [f64; 2] {
    let platform = Platform::new(&m.rig);
    let steps = || (1..300).map(|i| f64::from(i) * -0.005);
    let least =
        |l: &[f64; 6]| platform.stroke_margins_m(l).into_iter().fold(f64::INFINITY, f64::min);
    let outside = steps().find(|by| {
        let lengths = longer(m, *by);
        let found = platform.forward(&lengths, &platform.middle());
        let far = found.map_or(0.0, |f| half_widths(&m.rig, &platform.docking_from_plate(&f.x_bp)));
        far > 1.75 && least(&lengths) > 0.1
    });
    let end = steps().find(|by| least(&longer(m, *by)) < 0.01);
    [outside.expect("outside, with stroke left"), end.expect("an end of the stroke")]
}

/// How far lengths must slip, every third one the other way, so that no pose has them, within the strokes.
fn torn_m(m: &Models) -> f64 {
    let platform = Platform::new(&m.rig);
    let torn = |by: f64| {
        let mut lengths = longer(m, 0.0);
        lengths.iter_mut().enumerate().for_each(|(i, l)| *l += if i % 3 == 2 { by } else { -by });
        lengths
    };
    let found = (1..100).map(|i| 0.02 * f64::from(i)).find(|by| {
        let lengths = torn(*by);
        platform.stroke_margins_m(&lengths).iter().all(|x| *x > 0.1)
            && platform.forward(&lengths, &platform.middle()).is_err()
    });
    found.expect("no pose has any lengths")
}

/// A fault from the first tick on.
fn always(what: FaultKind) -> Fault {
    Fault::from(what, When::Tick(0))
}

const A: Instrument = Instrument::SensorA;
const B: Instrument = Instrument::SensorB;
const PLATE: Instrument = Instrument::Accelerometer;

/// Arms on a rig with faults; what came of it and what was sent.
fn armed(
    m: &Models,
    known: Vec<Check>,
    faults: &[Fault],
) -> (Result<Vec<Check>, ArmError>, Vec<u32>) {
    let test = test(m);
    let rig = Watched::new(emulated(m, &test), faults);
    let sent: Sent = rig.sent.clone();
    let idle = Loop::new(setup(m, &test), rig, VirtualClock::new(PERIOD_NS));
    let armed = idle.arm(known).map(|l| l.checks().to_vec());
    (armed, sent.take())
}

/// Names of the points that failed.
fn failed(checks: &[Check]) -> Vec<&str> {
    checks.iter().filter(|c| !c.passed).map(|c| c.name).collect()
}

fn assert_no_motion(sent: &[u32]) {
    let still = [RigMode::Idle as u32, RigMode::Hold as u32];
    assert!(!sent.is_empty() && sent.iter().all(|m| still.contains(m)), "{sent:?}");
}

#[test]
fn invariant_a_good_rig_is_armed_and_nothing_moves_before_the_start() {
    let (checks, sent) = armed(&models(), Vec::new(), &[]);
    let checks = checks.expect("armed");
    assert!(failed(&checks).is_empty() && checks.len() >= 8, "{checks:?}");
    assert_no_motion(&sent);
}

#[test]
fn invariant_every_shortfall_is_refused_with_a_line_of_its_own() {
    use FaultKind as K;
    let m = models();
    let [outside_m, end_m] = slips_m(&m);
    let torn = always(K::LengthsTorn).sized(torn_m(&m));
    let cases = [
        ("rig", "switch its drives on", always(K::SupplyLost)),
        ("rig", "clear its fault", always(K::SafeState)),
        ("emergency stop", "release it", always(K::EmergencyStop)),
        ("limit switches", "drive it off", always(K::LimitSwitch)),
        ("sensor A", "charge amplifier", always(K::Saturated(A))),
        ("sensor B", "charge amplifier", always(K::Saturated(B))),
        ("sensor A", "not alive", always(K::Frozen(A))),
        ("sensor B", "not alive", always(K::Frozen(B))),
        ("sensor A", "the loop needs it", always(K::Absent(A))),
        ("sensor B", "the loop needs it", always(K::Absent(B))),
        ("accelerometers", "strikes the plate", always(K::Saturated(PLATE))),
        ("accelerometers", "not alive", always(K::Frozen(PLATE))),
        ("accelerometers", "does not report", always(K::Absent(PLATE))),
        ("mechanisms", "rig retract", always(K::LatchReads(1)).sized(3.0)),
        ("mechanisms", "rig retract", always(K::JoinedReads)),
        ("accelerometers", "see their axes", always(K::AxisSign(PLATE, 0))),
        ("position", "length sensors", always(K::LengthReads(2)).sized(0.0)),
        ("position", "length sensors", torn),
        ("position", "half-widths", always(K::LengthsSlip).sized(outside_m)),
        ("position", "of stroke left", always(K::LengthsSlip).sized(end_m)),
    ];
    for (name, remedy, fault) in cases {
        let (refused, sent) = armed(&m, Vec::new(), &[fault]);
        let Err(ArmError::Checklist(checks)) = refused else { panic!("{name}: {refused:?}") };
        assert_eq!(failed(&checks), [name], "{checks:?}");
        let text = ArmError::Checklist(checks).to_string();
        assert!(text.contains(remedy), "{text}");
        assert_no_motion(&sent);
    }
}

/// With one sensor nothing is taken off that accelerometers measure or sensor B reads: theirs is no reason
/// not to run.
#[test]
fn invariant_sensors_that_are_not_used_are_no_shortfall() {
    let m = models();
    let test = test(&m);
    for what in [
        FaultKind::Frozen(PLATE),
        FaultKind::Absent(PLATE),
        FaultKind::Saturated(PLATE),
        FaultKind::Absent(B),
    ] {
        let rig = Watched::new(emulated(&m, &test), &[always(what)]);
        let single = LoopSetup { scheme: SensorScheme::Single, ..setup(&m, &test) };
        let idle = Loop::new(single, rig, VirtualClock::new(PERIOD_NS));
        let mut running = idle.arm(Vec::new()).expect("nothing is lacking").start();
        for _ in 0..100 {
            let r = running.tick(&Inputs::default()).expect("the rig answers");
            assert!(r.trip.is_none(), "{what:?}: {:?}", r.trip);
        }
    }
}

#[test]
fn invariant_all_shortfalls_are_reported_at_once() {
    use FaultKind as K;
    let known = vec![Check { name: "operator", passed: false, found: "not confirmed".to_owned() }];
    let m = models();
    let (refused, sent) = armed(
        &m,
        known,
        &[
            always(K::SupplyLost),
            always(K::EmergencyStop),
            always(K::LimitSwitch),
            always(K::Saturated(A)),
            always(K::Frozen(B)),
            always(K::Absent(PLATE)),
            always(K::LengthsTorn).sized(torn_m(&m)),
        ],
    );
    let Err(ArmError::Checklist(checks)) = refused else { panic!("{refused:?}") };
    let expected = [
        "rig",
        "emergency stop",
        "limit switches",
        "sensor A",
        "sensor B",
        "accelerometers",
        "position",
        "operator",
    ];
    assert_eq!(failed(&checks), expected);
    let text = ArmError::Checklist(checks).to_string();
    assert!(expected.iter().all(|name| text.contains(&format!("{name}: "))), "{text}");
    assert_no_motion(&sent);
}

#[test]
fn invariant_a_rig_that_measures_nothing_usable_is_not_armed() {
    use FaultKind as K;
    let m = models();
    let cases = [
        (RigError::Gone, always(K::Missing)),
        (RigError::Gone, always(K::Gone)),
        (RigError::Refused(Refusal::NotFinite), always(K::NotFinite(A))),
        (RigError::Refused(Refusal::Version), always(K::OtherVersion)),
        (RigError::Refused(Refusal::Future), always(K::StampOffset).sized(2e-3)),
        (RigError::Refused(Refusal::Session), always(K::OtherSession)),
        (RigError::Refused(Refusal::Size), always(K::Unreadable)),
    ];
    for (why, fault) in cases {
        let (refused, sent) = armed(&m, Vec::new(), &[fault]);
        assert_eq!(refused.expect_err("not armed"), ArmError::Rig(why));
        assert!(fault.what == K::Gone || !sent.is_empty());
        assert!(sent.iter().all(|m| [RigMode::Idle as u32, RigMode::Hold as u32].contains(m)));
    }
}

/// A run with its records.
struct Run {
    records: Vec<TickRecord>,
    trip: Option<Trip>,
    refused: u64,
    without: u64,
}

/// A whole run on a rig with faults, with control wrenches.
fn fly(m: &Models, control: impl Fn(Option<u64>) -> Inputs, faults: &[Fault]) -> Run {
    let test = test(m);
    let rig = Watched::new(emulated(m, &test), faults);
    let idle = Loop::new(setup(m, &test), rig, VirtualClock::new(PERIOD_NS));
    let mut running = idle.arm(Vec::new()).expect("armed").start();
    let mut records: Vec<TickRecord> = Vec::new();
    while !running.finished() {
        let closed = records.last().and_then(|r| r.closed_tick).map(|k| k + 1);
        records.push(running.tick(&control(closed)).expect("a connection"));
    }
    let (refused, without) = (running.times().refused, running.times().without);
    Run { records, trip: running.stop().end().trip, refused, without }
}

fn with_faults(m: &Models, faults: &[Fault]) -> Run {
    fly(m, |_| Inputs::default(), faults)
}

impl Run {
    /// Tick at the port of the measurement that a tick of the closed loop reads.
    fn read_in(&self, closed: u64) -> u64 {
        let r = self.records.iter().find(|r| r.closed_tick == Some(closed));
        r.expect("the loop is closed").measurement.tick
    }

    /// The first tick with the rod at its stop.
    fn contact(&self) -> u64 {
        let r = self.records.iter().find(|r| r.measurement.truth_port4[0].abs() > 50.0);
        r.and_then(|r| r.closed_tick).expect("a contact in the closed loop")
    }

    fn same_bodies_and_commands(&self, other: &Self) -> bool {
        self.records.len() == other.records.len()
            && self
                .records
                .iter()
                .zip(&other.records)
                .all(|(a, b)| a.bodies == b.bodies && a.command == b.command)
    }

    /// Ended by `limit`; from the tick of the trip on nothing but stops was sent, and the rig rests.
    fn assert_safe_end(&self, limit: Limit) {
        let trip = self.trip.expect("a limit was passed");
        assert_eq!(trip.limit, limit, "{trip:?}");
        let told = self.records.iter().position(|r| r.trip.is_some()).expect("the record says it");
        assert!(self.records[told].trip.is_some_and(|t| (t.limit, t.tick) == (limit, trip.tick)));
        assert_eq!(self.records[told].command.tick, trip.tick);
        for r in &self.records[told..] {
            assert_eq!(r.command.mode, RigMode::Stop as u32, "tick {}", r.tick);
        }
        for r in &self.records[..told] {
            assert_eq!(r.command.mode, RigMode::Track as u32, "tick {}", r.tick);
            assert!(r.command.is_finite());
        }
        let last = self.records.last().expect("records");
        let fastest = last.measurement.truth_twist.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
        assert!(fastest < 5e-3, "{limit:?}: the rig still moves, {fastest}");
    }
}

/// A measurement that is refused leaves what a missing one leaves.
#[test]
fn invariant_a_refused_measurement_is_as_good_as_none() {
    use FaultKind as K;
    let m = models();
    let good = with_faults(&m, &[]);
    assert_eq!((good.trip, good.refused, good.without), (None, 0, 0));
    // In the middle of the contact, where every newton counts.
    let at = good.read_in(good.contact() + 20);
    let once = |what| Fault::from(what, When::Tick(at)).lasting(1e-3);
    let missing = with_faults(&m, &[once(K::Missing)]);
    assert_eq!((missing.trip, missing.refused, missing.without), (None, 0, 1));
    assert!(!missing.same_bodies_and_commands(&good), "the measurement makes no difference");
    let push = once(K::Offset(A, 0)).sized(1e3);
    for fault in [
        once(K::NotFinite(A)),
        once(K::LengthReads(3)).sized(f64::INFINITY),
        once(K::TickBack),
        once(K::StampOffset).sized(1e-9),
        once(K::OtherVersion),
        once(K::OtherSession),
        once(K::Unreadable),
    ] {
        let run = with_faults(&m, &[push, fault]);
        assert_eq!((run.trip, run.refused, run.without), (None, 1, 1), "{:?}", fault.what);
        assert!(run.same_bodies_and_commands(&missing), "{:?} reached the bodies", fault.what);
    }
    // Lengths that belong to no pose are not refused by the port, and not used either.
    let run = with_faults(&m, &[push, once(K::LengthsTorn).sized(torn_m(&m))]);
    assert!(run.same_bodies_and_commands(&missing), "torn lengths reached the bodies");
    assert_eq!((run.trip, run.without), (None, 1));
}

#[test]
fn invariant_missing_measurements_are_bridged_up_to_the_watchdog() {
    let m = models();
    let good = with_faults(&m, &[]);
    for at in [good.read_in(0), good.read_in(5), good.read_in(good.contact() + 20)] {
        for (ticks, what) in [
            (1, FaultKind::Missing),
            (5, FaultKind::Missing),
            (10, FaultKind::Missing),
            (11, FaultKind::Missing),
            (30, FaultKind::Missing),
            (30, FaultKind::Unreadable),
        ] {
            let fault = Fault::from(what, When::Tick(at)).lasting(1e-3 * ticks as f64);
            let run = with_faults(&m, &[fault]);
            if ticks <= 10 {
                assert_eq!((run.trip, run.without), (None, ticks), "{ticks} from {at}");
            } else {
                run.assert_safe_end(Limit::Watchdog);
                assert_eq!(run.trip.map(|t| t.tick), Some(at + 11));
            }
        }
    }
}

/// In lockstep a rig that is gone is not waited for, tick after tick.
#[test]
fn invariant_a_rig_that_is_gone_ends_the_run() {
    let m = models();
    let good = with_faults(&m, &[]);
    let at = good.read_in(good.contact() + 20);
    let run = with_faults(&m, &[Fault::from(FaultKind::Gone, When::Tick(at))]);
    let trip = run.trip.expect("a limit was passed");
    assert_eq!((trip.limit, trip.tick), (Limit::Watchdog, at + 11));
    let last = run.records.last().expect("records").command;
    assert_eq!((last.tick, last.mode), (trip.tick, RigMode::Stop as u32));
}

/// From one tick of the contact on.
#[test]
fn invariant_every_fault_of_the_rig_ends_the_run() {
    use FaultKind as K;
    let m = models();
    let good = with_faults(&m, &[]);
    let at = good.read_in(good.contact() + 20);
    let from = |what| Fault::from(what, When::Tick(at));
    let [outside_m, _] = slips_m(&m);
    let cases = [
        (Limit::Rig, from(K::SafeState)),
        (Limit::Rig, from(K::EmergencyStop)),
        (Limit::Rig, from(K::LimitSwitch)),
        (Limit::Rig, from(K::SupplyLost)),
        (Limit::Force, from(K::Offset(A, 1)).sized(2500.0)),
        (Limit::Moment, from(K::Offset(A, 5)).sized(2500.0)),
        (Limit::LegForce, from(K::ForceReads(2)).sized(-7e4)),
        (Limit::LegSpeed, from(K::SpeedReads(4)).sized(-0.9)),
        (Limit::Stroke, from(K::LengthReads(1)).sized(2.9)),
        (Limit::Saturated, from(K::Saturated(A))),
        (Limit::Saturated, from(K::Saturated(B))),
        (Limit::Saturated, from(K::Absent(A))),
        (Limit::Saturated, from(K::Absent(B))),
        (Limit::Saturated, from(K::Absent(PLATE))),
        (Limit::Saturated, from(K::Saturated(PLATE))),
        (Limit::Frozen, from(K::Frozen(A))),
        (Limit::Frozen, from(K::Frozen(B))),
        (Limit::Frozen, from(K::Frozen(PLATE))),
        (Limit::Tracking, from(K::LengthsSlip).sized(0.05)),
        (Limit::Watchdog, from(K::LengthsTorn).sized(torn_m(&m))),
        (Limit::Watchdog, from(K::Repeated).lasting(0.03)),
        (Limit::Pose, from(K::LengthsSlip).sized(outside_m)),
    ];
    for (limit, fault) in cases {
        let run = with_faults(&m, &[fault]);
        println!("{:?}: {:?}, fault at {at}", fault.what, run.trip);
        run.assert_safe_end(limit);
        let late = run.trip.expect("tripped").tick - at;
        let allowed = match limit {
            Limit::Frozen => 22,
            Limit::Watchdog => 12,
            _ => 2,
        };
        assert!(late <= allowed, "{:?}: {late} ticks", fault.what);
    }
}

/// Loads are watched on the way to the initial condition too.
#[test]
fn invariant_a_collision_on_the_way_ends_the_run() {
    let m = models();
    let good = with_faults(&m, &[]);
    for phase in [Phase::Move, Phase::Settle, Phase::RunUp] {
        let first = good.records.iter().position(|r| r.phase == phase).expect("a phase");
        let at = good.records[first + 10].measurement.tick;
        let push = Fault::from(FaultKind::Offset(A, 0), When::Tick(at)).sized(2500.0);
        with_faults(&m, &[push]).assert_safe_end(Limit::Force);
    }
}

/// Bodies that are driven away take the rig nowhere it must not go: what passes a limit is not sent.
#[test]
fn invariant_a_runaway_of_the_bodies_is_not_followed() {
    let m = models();
    let platform = Platform::new(&m.rig);
    let speed = 0.95 * m.rig.limits.speed_m_s;
    // From a push that takes a while to one that is off within a tick.
    for (force_n, limits) in [
        (5e3, [Limit::Force].as_slice()),
        (1e6, &[Limit::LegSpeed, Limit::Pose]),
        (1e12, &[Limit::Stroke, Limit::LegSpeed, Limit::Pose]),
        (f64::INFINITY, &[Limit::Finite]),
        (f64::NAN, &[Limit::Finite]),
    ] {
        let push = move |closed: Option<u64>| {
            let mut inputs = Inputs::default();
            if closed.is_some_and(|k| k >= 100) {
                inputs.target.f = DVec3::new(0.0, force_n, 0.0);
            }
            inputs
        };
        let run = fly(&m, push, &[]);
        let trip = run.trip.expect("a limit was passed");
        println!("{force_n:e} N: {trip:?}");
        assert!(limits.contains(&trip.limit), "{force_n:e} N: {trip:?}");
        run.assert_safe_end(trip.limit);
        for r in run.records.iter().filter(|r| r.command.mode == RigMode::Track as u32) {
            let c = &r.command;
            assert!(c.leg_speed_m_s.iter().all(|v| v.abs() <= speed), "{c:?}");
            assert!(platform.stroke_margins_m(&c.leg_length_m).iter().all(|x| *x >= 0.02), "{c:?}");
        }
        let strongest = run.records.iter().map(|r| r.measurement.truth_twist[1].abs());
        assert!(strongest.fold(0.0, f64::max) < 1.0);
    }
}

/// A free flight as fast as dockings are approached, without anything to touch.
#[test]
fn invariant_the_fastest_approach_passes_no_limit() {
    let mut m = models();
    m.stick.stick.as_mut().expect("a stick").frame_opening_m = 10.0;
    let nothing = Row { stiffness_n_m: 1e-3, speed_m_s: 0.35, ..TABLE_4[2] };
    for compensation in [Compensation::None, Compensation::Lead(0.002)] {
        let test = VibroTest::new(nothing, &[axis("x")], &m.body, &m.stick).expect("a stick");
        let mut setup = test.setup(&m.rig, &settings(compensation)).expect("it can be run");
        setup.approach.run_up_s = 1.0;
        setup.ticks = 400;
        let rig = InProcess::new(emulated(&m, &test));
        let idle = Loop::new(setup, rig, VirtualClock::new(PERIOD_NS));
        let mut running = idle.arm(Vec::new()).expect("armed").start();
        let mut fastest = 0.0_f64;
        while !running.finished() {
            let r = running.tick(&Inputs::default()).expect("a connection");
            fastest = fastest.max(r.measurement.truth_twist[0].abs());
        }
        assert!(fastest > 0.3, "not that fast: {fastest} m/s");
        let ended = running.stop().into_end();
        assert_eq!(ended.trip, None);
        println!("{compensation:?}: margins {:?}", ended.margins);
        let tracking = ended.margins.of(Limit::Tracking);
        assert!(tracking.is_some_and(|x| x > 0.5), "{:?}", ended.margins);
    }
}

#[test]
fn invariant_a_dry_run_goes_there_and_back_slowly_and_never_closes() {
    let m = models();
    let test = test(&m);
    let mut s = setup(&m, &test);
    s.dry_run = true;
    let (speed, aim) = (s.approach.speed_m_s, test_aim(&s));
    let idle = Loop::new(s, InProcess::new(emulated(&m, &test)), VirtualClock::new(PERIOD_NS));
    let mut running = idle.arm(Vec::new()).expect("armed").start();
    let mut records: Vec<TickRecord> = Vec::new();
    while !running.finished() {
        records.push(running.tick(&Inputs::default()).expect("a connection"));
    }
    assert_eq!(running.stop().end().trip, None);
    let first = records.first().expect("records");
    let last = records.last().expect("records");
    assert!(records.iter().all(|r| r.phase != Phase::Closed && r.closed_tick.is_none()));
    assert!(records.iter().all(|r| r.bodies == first.bodies), "the bodies moved");
    assert!(records.iter().all(|r| r.command.flags.contains(Flags::DRY_RUN)));
    let fastest = records.iter().map(|r| DVec3::from_array(r.command.plate_velocity_m_s).length());
    let fastest = fastest.fold(0.0, f64::max);
    assert!(fastest <= 0.26 * speed && fastest > 0.1 * speed, "{fastest} m/s");
    let nearest = records.iter().map(|r| (r.x_34.p - aim).length()).fold(f64::INFINITY, f64::min);
    assert!(nearest < 1e-3, "it stays {nearest} m away from the initial condition");
    assert!((last.x_34.p - first.x_34.p).length() < 1e-3, "{} {}", first.x_34.p, last.x_34.p);
    assert!(last.measurement.truth_twist.iter().all(|x| x.abs() < 1e-3));
    // Without a step in position on the way.
    let moving: Vec<_> =
        records.iter().filter(|r| r.command.mode == RigMode::Track as u32).collect();
    for pair in moving.windows(2) {
        let [a, b] = [pair[0], pair[1]].map(|r| DVec3::from_array(r.command.plate_position_m));
        assert!(
            (b - a).length() <= 1.1 * 0.25 * speed * 1e-3 + 1e-9,
            "a jump in tick {}",
            pair[1].tick
        );
    }
}

/// Where a run is to begin, in `e3`.
fn test_aim(s: &LoopSetup) -> DVec3 {
    s.bodies.x_34().p
}

/// A second run on the same rig and loop, with a session of its own, ends as the first one; and what
/// a loop counts begins anew.
#[test]
fn invariant_a_loop_that_is_reset_runs_again() {
    let m = models();
    let test = test(&m);
    let rig = InProcess::new(emulated(&m, &test));
    let mut idle = Loop::new(setup(&m, &test), rig, VirtualClock::new(PERIOD_NS));
    let mut ends = Vec::new();
    for session in [1, 2, 3] {
        let mut running = idle.arm(Vec::new()).expect("armed").start();
        let mut samples = Vec::new();
        let mut ticks = 0;
        while !running.finished() {
            let r = running.tick(&Inputs::default()).expect("a connection");
            assert!(r.fresh && r.measurement.session == session && r.command.session == session);
            if let Some(k) = r.closed_tick {
                samples.push(test.sample(&r, k as f64 * 1e-3));
            }
            ticks += 1;
        }
        assert_eq!(running.times().compute.latencies().n, ticks);
        let stopped = running.stop();
        assert_eq!(stopped.end().trip, None);
        ends.push(test.judge(&samples).first().expect("a contact").r_e);
        idle = stopped.reset(session + 1);
    }
    println!("{ends:?}");
    assert!(ends.iter().all(|r| (r - 1.0).abs() < 0.01), "{ends:?}");
}

/// After a stop the rig follows again once it is told to idle in a new session, and not before.
#[test]
fn invariant_a_run_after_a_trip_begins_with_arming() {
    let m = models();
    let test = test(&m);
    let mut s = setup(&m, &test);
    s.limits.port_force_n = 20.0;
    let rig = InProcess::new(emulated(&m, &test));
    let mut running =
        Loop::new(s, rig, VirtualClock::new(PERIOD_NS)).arm(Vec::new()).expect("armed").start();
    while !running.finished() {
        running.tick(&Inputs::default()).expect("a connection");
    }
    let stopped = running.stop();
    assert_eq!(stopped.end().trip.expect("the rod presses").limit, Limit::Force);
    let again = stopped.reset(2).arm(Vec::new()).expect("armed again");
    let mut running = again.start();
    let r = running.tick(&Inputs::default()).expect("a connection");
    assert_eq!((r.trip, r.phase), (None, Phase::Move));
    running.end();
    assert!(!running.finished());
}

/// The page for laboratories tells every limit and every line of the checklist, with its default.
#[test]
fn invariant_the_page_tells_every_limit() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/bring-up-a-rig.md");
    let page = std::fs::read_to_string(page).expect("the page");
    let m = models();
    let limits = SafetyLimits::of_rig(&m.rig, 1.0, 1.0);
    for limit in Limit::ALL {
        let name = format!("| `{}` |", limit.name());
        let row = page.lines().find(|l| l.starts_with(&name));
        let row = row.unwrap_or_else(|| panic!("no row for {name}"));
        let fixed = [Limit::Stroke, Limit::Pose, Limit::Tracking, Limit::Watchdog, Limit::Frozen];
        if fixed.contains(&limit) {
            let value = limits.of(limit).to_string();
            assert!(row.split(' ').any(|word| word == value), "{value} is not in: {row}");
        }
    }
    let (checks, _) = armed(&m, Vec::new(), &[]);
    for check in checks.expect("armed") {
        assert!(
            page.lines().any(|l| l.starts_with("| ") && l.contains(check.name)),
            "no row for {}",
            check.name
        );
    }
}
