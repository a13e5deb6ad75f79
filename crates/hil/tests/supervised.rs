//! What a loop refuses to begin with, and what ends a run: every fault that a rig's measurements or
//! the bodies' commands can bring, on the emulated rig in virtual time.

mod common;

use std::path::Path;

use common::stick::{Fate, Models, Sent, Spoilt, axis, emulated, models, settings};
use docktwin_control::{
    compensator::Compensation,
    safety::{Limit, SafetyLimits, Trip},
    sensing::SensorScheme,
};
use docktwin_core::{DVec3, Pose};
use docktwin_hil::{
    clock::VirtualClock,
    in_process::InProcess,
    port::{Refusal, RigMeasurement, RigMode, status},
    rig::RigError,
    scheduler::{ArmError, Check, Loop, LoopSetup, Phase, TickRecord},
    vibro::{PERIOD_NS, Row, TABLE_4, VibroSettings, VibroTest},
};
use docktwin_physics::{platform::Platform, reduced::Inputs};

fn test(m: &Models) -> VibroTest {
    VibroTest::new(TABLE_4[5], &[axis("x")], &m.body, &m.stick).expect("a stick")
}

fn setup(m: &Models, test: &VibroTest) -> LoopSetup {
    let settings = settings(Compensation::Lead(0.0018));
    // All sensors count.
    test.setup(&m.rig, &VibroSettings { scheme: SensorScheme::Two, ..settings })
}

/// Leg lengths within their strokes that belong to no pose.
fn torn(m: &Models) -> [f64; 6] {
    let platform = Platform::new(&m.rig);
    let legs = |mask: u32| core::array::from_fn(|i| if mask >> i & 1 == 0 { 3.3 } else { 5.2 });
    let found = (0..64).map(legs).find(|l| platform.forward(l, &platform.middle()).is_err());
    let found = found.expect("no pose has any lengths");
    assert!(platform.stroke_margins_m(&found).iter().all(|x| *x > 0.02), "{found:?}");
    found
}

/// Leg lengths with the plate drawn down from the middle of its workspace by `down_m`.
fn drawn_down(m: &Models, down_m: f64) -> [f64; 6] {
    let platform = Platform::new(&m.rig);
    platform.at(&(platform.middle() * Pose::from_translation(DVec3::X * -down_m))).length_m
}

/// Arms on a rig whose measurements go through `spoil`; what came of it and what was sent.
fn armed(
    m: &Models,
    known: Vec<Check>,
    spoil: impl FnMut(RigMeasurement) -> Fate,
) -> (Result<Vec<Check>, ArmError>, Vec<u32>) {
    let test = test(m);
    let rig = Spoilt::new(emulated(m, &test), spoil);
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
    let (checks, sent) = armed(&models(), Vec::new(), |m| Ok(Some(m)));
    let checks = checks.expect("armed");
    assert!(failed(&checks).is_empty() && checks.len() >= 7, "{checks:?}");
    assert_no_motion(&sent);
}

#[test]
fn invariant_every_shortfall_is_refused_with_a_line_of_its_own() {
    let m = models();
    let (torn, outside) = (torn(&m), drawn_down(&m, 0.55));
    // So far that a leg is at its end.
    let platform = Platform::new(&m.rig);
    let end = (0..500)
        .map(|i| drawn_down(&m, f64::from(i) * 0.005))
        .find(|l| platform.stroke_margins_m(l).iter().any(|x| *x < 0.01))
        .expect("an end of the stroke");
    type Case<'a> = (&'a str, &'a str, Box<dyn Fn(&mut RigMeasurement) + 'a>);
    let cases: [Case<'_>; 17] = [
        ("rig", "switch the hydraulics on", Box::new(|m| m.status &= !status::ENABLED)),
        ("rig", "clear its fault", Box::new(|m| m.status |= status::SAFE_STATE)),
        ("emergency stop", "release it", Box::new(|m| m.status |= status::EMERGENCY_STOP)),
        ("limit switches", "drive it off", Box::new(|m| m.status |= status::LIMIT_SWITCH)),
        ("sensor A", "charge amplifier", Box::new(|m| m.status |= status::SENSOR_A_SATURATED)),
        ("sensor B", "charge amplifier", Box::new(|m| m.status |= status::SENSOR_B_SATURATED)),
        ("sensor A", "not alive", Box::new(|m| m.sensor_a = [1.0; 6])),
        ("sensor B", "not alive", Box::new(|m| m.sensor_b = [0.0; 6])),
        (
            "accelerometers",
            "strikes the plate",
            Box::new(|m| m.status |= status::ACCELEROMETER_SATURATED),
        ),
        (
            "accelerometers",
            "not alive",
            Box::new(|m| m.plate_acceleration = [9.81, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ),
        ("accelerometers", "does not tell", Box::new(|m| m.status &= !status::ACCELEROMETER)),
        ("mechanisms", "rig retract", Box::new(|m| m.mechanism[1] = 3.0)),
        ("accelerometers", "see their axes", Box::new(|m| m.plate_acceleration[0] *= -1.0)),
        ("position", "length sensors", Box::new(|m| m.leg_length_m = [0.0; 6])),
        ("position", "length sensors", Box::new(|m| m.leg_length_m = torn)),
        ("position", "half-widths", Box::new(|m| m.leg_length_m = outside)),
        ("position", "of stroke left", Box::new(|m| m.leg_length_m = end)),
    ];
    for (name, remedy, spoil) in &cases {
        let (refused, sent) = armed(&m, Vec::new(), |mut m| {
            spoil(&mut m);
            Ok(Some(m))
        });
        let Err(ArmError::Checklist(checks)) = refused else { panic!("{name}: {refused:?}") };
        assert_eq!(failed(&checks), [*name]);
        let text = ArmError::Checklist(checks).to_string();
        assert!(text.contains(remedy), "{text}");
        assert_no_motion(&sent);
    }
}

/// With one sensor nothing is taken off that accelerometers feel: theirs is no reason not to run.
#[test]
fn invariant_accelerometers_that_are_not_used_are_no_shortfall() {
    let m = models();
    let test = test(&m);
    for spoil in [
        |m: &mut RigMeasurement| m.plate_acceleration = [0.0; 6],
        |m: &mut RigMeasurement| m.status &= !status::ACCELEROMETER,
        |m: &mut RigMeasurement| m.status |= status::ACCELEROMETER_SATURATED,
    ] {
        let rig = Spoilt::new(emulated(&m, &test), move |mut x| {
            spoil(&mut x);
            Ok(Some(x))
        });
        let single = LoopSetup { scheme: SensorScheme::Single, ..setup(&m, &test) };
        let idle = Loop::new(single, rig, VirtualClock::new(PERIOD_NS));
        let mut running = idle.arm(Vec::new()).expect("nothing is lacking").start();
        for _ in 0..100 {
            let r = running.tick(&Inputs::default()).expect("the rig answers");
            assert!(r.trip.is_none(), "{:?}", r.trip);
        }
    }
}

#[test]
fn invariant_all_shortfalls_are_told_at_once() {
    let known = vec![Check { name: "operator", passed: false, found: "not confirmed".to_owned() }];
    let m = models();
    let torn = torn(&m);
    let (refused, sent) = armed(&m, known, |mut m| {
        m.status = status::EMERGENCY_STOP | status::LIMIT_SWITCH | status::SENSOR_A_SATURATED;
        m.sensor_b = [0.0; 6];
        m.leg_length_m = torn;
        Ok(Some(m))
    });
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
fn invariant_a_rig_that_tells_nothing_usable_is_not_armed() {
    let m = models();
    type Spoil = fn(RigMeasurement) -> Fate;
    let version = RigError::Refused(Refusal::Version);
    let cases: [(RigError, Spoil); 4] = [
        (RigError::Gone, |_| Ok(None)),
        (RigError::Refused(Refusal::NotFinite), |mut m| {
            m.sensor_a[2] = f64::NAN;
            Ok(Some(m))
        }),
        (version, |mut m| {
            m.protocol_version += 1;
            Ok(Some(m))
        }),
        (RigError::Refused(Refusal::Future), |mut m| {
            m.stamp_ns += 2 * PERIOD_NS;
            Ok(Some(m))
        }),
    ];
    for (why, spoil) in cases {
        let (refused, sent) = armed(&m, Vec::new(), spoil);
        assert_eq!(refused.expect_err("not armed"), ArmError::Rig(why));
        assert_no_motion(&sent);
    }
}

/// A run with its records.
struct Run {
    records: Vec<TickRecord>,
    trip: Option<Trip>,
    refused: u64,
    without: u64,
}

/// A whole run on a rig whose measurements go through `spoil`, with control wrenches.
fn fly(
    m: &Models,
    control: impl Fn(Option<u64>) -> Inputs,
    spoil: impl FnMut(RigMeasurement) -> Fate,
) -> Run {
    let test = test(m);
    let rig = Spoilt::new(emulated(m, &test), spoil);
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

fn spoilt(m: &Models, spoil: impl FnMut(RigMeasurement) -> Fate) -> Run {
    fly(m, |_| Inputs::default(), spoil)
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
    let m = models();
    let good = spoilt(&m, |m| Ok(Some(m)));
    assert_eq!((good.trip, good.refused, good.without), (None, 0, 0));
    // In the middle of the contact, where every newton counts.
    let at = good.read_in(good.contact() + 20);
    let once = |change: &dyn Fn(RigMeasurement) -> Fate| {
        spoilt(&m, |m| if m.tick == at { change(m) } else { Ok(Some(m)) })
    };
    let missing = once(&|_| Ok(None));
    assert_eq!((missing.trip, missing.refused, missing.without), (None, 0, 1));
    assert!(!missing.same_bodies_and_commands(&good), "the measurement makes no difference");
    type Change = fn(RigMeasurement) -> Fate;
    let changes: [Change; 6] = [
        |mut m| {
            m.sensor_a[0] = f64::NAN;
            Ok(Some(m))
        },
        |mut m| {
            m.leg_length_m[3] = f64::INFINITY;
            m.sensor_a[0] += 1e3;
            Ok(Some(m))
        },
        |mut m| {
            m.tick -= 1;
            m.sensor_a[0] += 1e3;
            Ok(Some(m))
        },
        |mut m| {
            m.stamp_ns += 1;
            m.sensor_a[0] += 1e3;
            Ok(Some(m))
        },
        |mut m| {
            m.protocol_version += 1;
            m.sensor_a[0] += 1e3;
            Ok(Some(m))
        },
        |_| Err(RigError::Refused(Refusal::Size)),
    ];
    for (i, change) in changes.into_iter().enumerate() {
        let run = once(&change);
        assert_eq!((run.trip, run.refused, run.without), (None, 1, 1), "change {i}");
        assert!(run.same_bodies_and_commands(&missing), "change {i} reached the bodies");
    }
    // Lengths that belong to no pose are not refused by the port, and not used either.
    let torn = torn(&m);
    let run = once(&|mut m| {
        m.leg_length_m = torn;
        m.sensor_a[0] += 1e3;
        Ok(Some(m))
    });
    assert!(run.same_bodies_and_commands(&missing), "torn lengths reached the bodies");
    assert_eq!((run.trip, run.without), (None, 1));
}

#[test]
fn invariant_missing_measurements_are_bridged_up_to_the_watchdog() {
    let m = models();
    let good = spoilt(&m, |m| Ok(Some(m)));
    for at in [good.read_in(0), good.read_in(5), good.read_in(good.contact() + 20)] {
        for (ticks, error) in [
            (1, None),
            (5, None),
            (10, None),
            (11, None),
            (30, None),
            (30, Some(RigError::Refused(Refusal::Size))),
        ] {
            let run = spoilt(&m, |m| {
                if (at..at + ticks).contains(&m.tick) {
                    error.map_or(Ok(None), Err)
                } else {
                    Ok(Some(m))
                }
            });
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
    let good = spoilt(&m, |m| Ok(Some(m)));
    let at = good.read_in(good.contact() + 20);
    let run = spoilt(&m, |m| if m.tick < at { Ok(Some(m)) } else { Err(RigError::Gone) });
    let trip = run.trip.expect("a limit was passed");
    assert_eq!((trip.limit, trip.tick), (Limit::Watchdog, at + 11));
    let last = run.records.last().expect("records").command;
    assert_eq!((last.tick, last.mode), (trip.tick, RigMode::Stop as u32));
}

/// From one tick of the contact on.
#[test]
fn invariant_every_fault_of_the_rig_ends_the_run() {
    let m = models();
    let good = spoilt(&m, |m| Ok(Some(m)));
    let at = good.read_in(good.contact() + 20);
    let (torn, outside) = (torn(&m), drawn_down(&m, 0.55));
    let held = good.records.iter().find(|r| r.measurement.tick == at).expect("there").measurement;
    type Case<'a> = (Limit, &'a str, Box<dyn Fn(&mut RigMeasurement) + 'a>);
    let cases: [Case<'_>; 18] = [
        (Limit::Rig, "safe state", Box::new(|m| m.status |= status::SAFE_STATE)),
        (Limit::Rig, "emergency stop", Box::new(|m| m.status |= status::EMERGENCY_STOP)),
        (Limit::Rig, "limit switch", Box::new(|m| m.status |= status::LIMIT_SWITCH)),
        (Limit::Rig, "switched off", Box::new(|m| m.status &= !status::ENABLED)),
        (Limit::Force, "force", Box::new(|m| m.sensor_a[1] += 2500.0)),
        (Limit::Moment, "moment", Box::new(|m| m.sensor_a[5] += 2500.0)),
        (Limit::LegForce, "leg force", Box::new(|m| m.leg_force_n[2] = -7e4)),
        (Limit::LegSpeed, "leg speed", Box::new(|m| m.leg_speed_m_s[4] = -0.9)),
        (Limit::Stroke, "stroke", Box::new(|m| m.leg_length_m[1] = 2.9)),
        (Limit::Saturated, "sensor A", Box::new(|m| m.status |= status::SENSOR_A_SATURATED)),
        (Limit::Saturated, "sensor B", Box::new(|m| m.status |= status::SENSOR_B_SATURATED)),
        (Limit::Frozen, "sensor A frozen", Box::new(|m| m.sensor_a = held.sensor_a)),
        (Limit::Frozen, "sensor B frozen", Box::new(|m| m.sensor_b = held.sensor_b)),
        (
            Limit::Frozen,
            "accelerometers frozen",
            Box::new(|m| m.plate_acceleration = held.plate_acceleration),
        ),
        (Limit::Saturated, "accelerometers gone", Box::new(|m| m.status &= !status::ACCELEROMETER)),
        (
            Limit::Tracking,
            "length sensors slip",
            Box::new(|m| {
                m.leg_length_m.iter_mut().for_each(|l| *l += 0.05);
            }),
        ),
        (Limit::Watchdog, "torn lengths", Box::new(|m| m.leg_length_m = torn)),
        (Limit::Pose, "lengths of another pose", Box::new(|m| m.leg_length_m = outside)),
    ];
    for (limit, what, spoil) in &cases {
        let run = spoilt(&m, |mut m| {
            if m.tick >= at {
                spoil(&mut m);
            }
            Ok(Some(m))
        });
        println!("{what}: {:?}, fault at {at}", run.trip);
        run.assert_safe_end(*limit);
        let late = run.trip.expect("tripped").tick - at;
        let allowed = match limit {
            Limit::Frozen => 22,
            Limit::Watchdog => 12,
            _ => 2,
        };
        assert!(late <= allowed, "{what}: {late} ticks");
    }
}

/// Loads are watched on the way to the initial condition too.
#[test]
fn invariant_a_collision_on_the_way_ends_the_run() {
    let m = models();
    let good = spoilt(&m, |m| Ok(Some(m)));
    for phase in [Phase::Move, Phase::Settle, Phase::RunUp] {
        let first = good.records.iter().position(|r| r.phase == phase).expect("a phase");
        let at = good.records[first + 10].measurement.tick;
        let run = spoilt(&m, |mut m| {
            if m.tick >= at {
                m.sensor_a[0] += 2500.0;
            }
            Ok(Some(m))
        });
        run.assert_safe_end(Limit::Force);
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
        let run = fly(&m, push, |m| Ok(Some(m)));
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
    let m = models();
    let nothing = Row { stiffness_n_m: 1e-3, speed_m_s: 0.35, ..TABLE_4[2] };
    for compensation in [Compensation::None, Compensation::Lead(0.002)] {
        let test = VibroTest::new(nothing, &[axis("x")], &m.body, &m.stick).expect("a stick");
        let mut setup = test.setup(&m.rig, &settings(compensation));
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
        println!("{compensation:?}: margins {:?}", ended.least_margin);
        assert!(ended.least_margin[Limit::Tracking as usize] > 0.5, "{:?}", ended.least_margin);
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
    let dry = docktwin_hil::port::flag::DRY_RUN;
    assert!(records.iter().all(|r| r.command.flags & dry != 0));
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
    s.limits.values[Limit::Force as usize] = 20.0;
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
    let (checks, _) = armed(&m, Vec::new(), |m| Ok(Some(m)));
    for check in checks.expect("armed") {
        assert!(
            page.lines().any(|l| l.starts_with("| ") && l.contains(check.name)),
            "no row for {}",
            check.name
        );
    }
}
