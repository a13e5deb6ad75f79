//! One suite for every ideal rig: in process, also behind a wrapper for faults; in shared memory from a
//! thread, from another process, and from one that is written in Python from the protocol page; over UDP.
//! A second, smaller one for any rig at all: emulated hydraulics and a rig without legs, too.

mod common;
mod stand;
#[allow(dead_code, reason = "what stands for the command line")]
#[path = "../../rigport/examples/udp_bridge.rs"]
mod udp_bridge;

use std::{
    any::Any,
    net::UdpSocket,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
    time::Duration,
};

use common::*;
use docktwin_core::DVec3;
use docktwin_hil::faults::FaultyRig;
use docktwin_rigport::{
    clock::monotonic_ns,
    in_process::InProcess,
    ipc::{IpcError, IpcRig, RigServer, Side},
    message::{
        Capabilities, Flags, PROTOCOL_VERSION, Refusal, RigCommand, RigMeasurement, RigMode, Status,
    },
    rig::{CommandForm, Plant, Rig, RigError},
};

/// A rig, and what must live as long.
struct Bed {
    rig: Box<dyn Rig>,
    _keep: Option<Box<dyn Any>>,
}

fn in_process() -> Option<Bed> {
    Some(Bed { rig: Box::new(InProcess::new(ideal())), _keep: None })
}

/// A wrapper that could bring faults about, and has none.
fn faulty() -> Option<Bed> {
    Some(Bed { rig: Box::new(FaultyRig::new(InProcess::new(ideal()), &[])), _keep: None })
}

/// The emulated rig, led by the plate's pose.
fn emulated() -> Option<Bed> {
    let stand = stand::Stand::new(None);
    let plant = stand.emulated(stand::free_stick(), &stand.middle());
    Some(Bed { rig: Box::new(InProcess::new(plant)), _keep: None })
}

fn pose_only() -> Option<Bed> {
    Some(Bed { rig: Box::new(InProcess::new(PoseOnly(ideal()))), _keep: None })
}

fn thread() -> Option<Bed> {
    let name = unique("thread");
    let served = Served::of(&name, ideal());
    let rig = IpcRig::connect(&name, PATIENCE).expect("the rig is there");
    Some(Bed { rig: Box::new(rig), _keep: Some(Box::new(served)) })
}

fn process() -> Option<Bed> {
    let name = unique("process");
    let child = start_again("rig_process", &name);
    let rig = IpcRig::connect(&name, PATIENCE).expect("the rig comes");
    Some(Bed { rig: Box::new(rig), _keep: Some(Box::new(child)) })
}

fn python() -> Option<Bed> {
    let name = unique("python");
    let child = python_rig(&name, Sensors::Bare, &[])?;
    let rig = IpcRig::connect(&name, PATIENCE).expect("the rig comes");
    Some(Bed { rig: Box::new(rig), _keep: Some(Box::new(child)) })
}

#[test]
#[ignore = "the other process of this suite, not a test"]
fn rig_process() {
    if let Some(name) = role() {
        serve_until_orphaned(&name, PATIENCE);
    }
}

/// Both ends of the bridge in threads, on this machine; they end when dropped.
struct Bridge {
    stop: Arc<AtomicBool>,
    ends: Vec<JoinHandle<()>>,
}

impl Bridge {
    /// From the loop's name for the rig to its own.
    fn between(near: &str, far: &str) -> Self {
        let sockets = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").expect("a port"));
        let addresses = [&sockets[0], &sockets[1]].map(|s| s.local_addr().expect("bound"));
        sockets[0].connect(addresses[1]).expect("there");
        sockets[1].connect(addresses[0]).expect("there");
        let [a, b] = sockets;
        let stop = Arc::new(AtomicBool::new(false));
        let (near, far) = (near.to_owned(), far.to_owned());
        let (stop_a, stop_b) = (stop.clone(), stop.clone());
        let near = move || udp_bridge::near(&near, a, || stop_a.load(Ordering::Relaxed));
        let far = move || udp_bridge::far(&far, b, || stop_b.load(Ordering::Relaxed));
        let ends = vec![
            std::thread::spawn(|| near().expect("the near end holds")),
            std::thread::spawn(|| far().expect("the far end holds")),
        ];
        Self { stop, ends }
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for end in self.ends.drain(..) {
            let ended = end.join();
            assert!(ended.is_ok() || std::thread::panicking(), "an end has panicked");
        }
    }
}

fn udp() -> Option<Bed> {
    let (near, far) = (unique("near"), unique("far"));
    let served = Served::of(&far, ideal());
    let bridge = Bridge::between(&near, &far);
    let rig = IpcRig::connect(&near, PATIENCE).expect("the near end comes");
    Some(Bed { rig: Box::new(rig), _keep: Some(Box::new((bridge, served))) })
}

/// Every test of the suite, for one kind of rig.
macro_rules! conforms {
    ($kind:ident: $($test:ident),+ $(,)?) => {
        mod $kind {
            $(#[test]
            fn $test() {
                if let Some(mut bed) = super::$kind() {
                    super::suite::$test(&mut *bed.rig);
                }
            })+
        }
    };
    ($($kind:ident),+) => { $(conforms!($kind:
        invariant_answers_carry_session_and_tick,
        oracle_an_ideal_rig_is_where_it_is_sent_and_feels_its_spring,
        invariant_lockstep_repeats_bit_by_bit,
        invariant_a_refused_command_says_why_and_never_arrives,
        invariant_a_command_from_the_future_is_refused,
        invariant_a_session_begins_with_idle,
        invariant_idle_forgets_the_run_before,
        invariant_a_stop_is_left_through_idle_alone,
        invariant_missed_ticks_are_lived_through_in_real_time,
        invariant_a_retraction_comes_to_rest,
        invariant_silence_ends_in_the_safe_state,
    );)+ };
}

conforms!(in_process, faulty, thread, process, python, udp);

/// Every test that any rig passes, whatever it does with its time and its legs.
macro_rules! is_a_rig {
    ($kind:ident: $($test:ident),+ $(,)?) => {
        mod $kind {
            $(#[test]
            fn $test() {
                if let Some(mut bed) = super::super::$kind() {
                    super::super::any::$test(&mut *bed.rig);
                }
            })+
        }
    };
    ($($kind:ident),+) => { $(is_a_rig!($kind:
        invariant_measurements_say_what_the_rig_is,
        invariant_leg_values_are_refused_where_they_do_not_fit,
        invariant_the_safe_state_is_left_by_a_new_session_alone,
        invariant_silence_ends_in_the_safe_state,
        invariant_a_stop_holds,
    );)+ };
}

mod any_rig {
    is_a_rig!(in_process, faulty, emulated, pose_only, thread, python);
}

mod any {
    use super::*;

    fn by_pose(session: u64, tick: u64, mode: RigMode) -> RigCommand {
        let c = command(session, tick, mode, start());
        RigCommand {
            leg_count: 0,
            leg_length_m: [0.0; 6],
            leg_speed_m_s: [0.0; 6],
            leg_flow_speed_m_s: [0.0; 6],
            leg_force_n: [0.0; 6],
            plate_velocity_m_s: [0.0; 3],
            plate_rate_rad_s: [0.0; 3],
            ..c
        }
    }

    /// A session in which the rig is led.
    fn led(rig: &mut dyn Rig) -> u64 {
        let session = new_session();
        exchange(rig, &by_pose(session, 0, RigMode::Idle));
        let m = exchange(rig, &by_pose(session, 1, RigMode::Track));
        assert!(!m.is(Status::SAFE_STATE) && m.is(Status::ENABLED), "{m:?}");
        session
    }

    fn in_place(m: &RigMeasurement) {
        let off = DVec3::from_array(m.truth_position_m).distance(start().p);
        assert!(off < 2e-3, "{off} m from where it was sent");
    }

    pub(super) fn invariant_measurements_say_what_the_rig_is(rig: &mut dyn Rig) {
        let session = led(rig);
        for tick in 2..20 {
            let m = exchange(rig, &by_pose(session, tick, RigMode::Track));
            assert!(m.keeps_reserved() && m.is_finite(), "{m:?}");
            assert!(m.has(Capabilities::POSE_COMMAND | Capabilities::SENSOR_A));
            let legs = m.has(Capabilities::LEG_COMMAND);
            assert_eq!(m.leg_count, if legs { 6 } else { 0 });
            assert!(m.has(Capabilities::LEG_LENGTH) || m.plate().is_some());
            in_place(&m);
        }
    }

    pub(super) fn invariant_leg_values_are_refused_where_they_do_not_fit(rig: &mut dyn Rig) {
        let session = led(rig);
        let five = RigCommand { leg_count: 5, ..by_pose(session, 2, RigMode::Track) };
        let m = exchange_by(rig, &five, five.loop_time_ns + five.period_ns);
        let expected = m.has(Capabilities::LEG_COMMAND).then_some(Refusal::Legs);
        assert_eq!(Refusal::from_number(m.refusal), expected, "{m:?}");
        in_place(&m);
    }

    pub(super) fn invariant_the_safe_state_is_left_by_a_new_session_alone(rig: &mut dyn Rig) {
        let session = led(rig);
        let bad = RigCommand { session, mode: 9, ..by_pose(session, 2, RigMode::Track) };
        let m = exchange_by(rig, &bad, bad.loop_time_ns + bad.period_ns);
        assert!(m.is(Status::REFUSED | Status::SAFE_STATE), "{m:?}");
        for (tick, mode) in [(3, RigMode::Track), (4, RigMode::Idle), (5, RigMode::Track)] {
            let m = exchange(rig, &by_pose(session, tick, mode));
            assert!(m.is(Status::SAFE_STATE), "{m:?}");
            in_place(&m);
        }
        led(rig);
    }

    pub(super) fn invariant_silence_ends_in_the_safe_state(rig: &mut dyn Rig) {
        let session = led(rig);
        exchange(rig, &now(by_pose(session, 2, RigMode::Hold)));
        std::thread::sleep(Duration::from_millis(100));
        let m = exchange(rig, &now(by_pose(session, 3, RigMode::Track)));
        assert!(m.is(Status::SAFE_STATE) && !m.is(Status::UNSOLICITED), "{m:?}");
        in_place(&m);
    }

    pub(super) fn invariant_a_stop_holds(rig: &mut dyn Rig) {
        let session = led(rig);
        exchange(rig, &by_pose(session, 2, RigMode::Stop));
        for tick in 3..100 {
            let away = plate_at(DVec3::new(0.0, 1e-4 * tick as f64, 0.0));
            let mut c = by_pose(session, tick, RigMode::Track);
            c.plate_position_m = away.p.to_array();
            let m = exchange(rig, &c);
            assert!(!m.is(Status::SAFE_STATE), "a stop is an order, not a fault");
            in_place(&m);
        }
    }
}

mod suite {
    use super::*;

    /// A way with contact at both stops.
    fn way(tick: u64) -> docktwin_core::Pose {
        let s = (tick as f64 * 0.05).sin();
        plate_at(DVec3::new(0.013 * s, 0.002 * s, -0.001))
    }

    fn position(m: &RigMeasurement) -> DVec3 {
        DVec3::from_array(m.truth_position_m)
    }

    pub(super) fn invariant_answers_carry_session_and_tick(rig: &mut dyn Rig) {
        let session = new_session();
        for tick in [0, 1, 2, 3, 7, 1000] {
            let mode = if tick == 0 { RigMode::Idle } else { RigMode::Track };
            let c = command(session, tick, mode, way(tick));
            let m = exchange(rig, &c);
            assert_eq!((m.protocol_version, m.session, m.tick), (PROTOCOL_VERSION, session, tick));
            assert_eq!(m.stamp_ns, c.loop_time_ns + c.period_ns, "the state at the tick's end");
            assert!(m.refusal == 0 && m.keeps_reserved());
            assert!(!m.is(Status::REFUSED) && !m.is(Status::SAFE_STATE), "{m:?}");
        }
        // Nothing more comes of itself.
        let nothing = rig.receive(Duration::ZERO, u64::MAX);
        assert!(matches!(nothing, Ok(None)), "{nothing:?}");
    }

    pub(super) fn oracle_an_ideal_rig_is_where_it_is_sent_and_feels_its_spring(rig: &mut dyn Rig) {
        let session = new_session();
        begin(rig, session, start());
        for (tick, x_m, force_n) in [(2, 0.005, 0.0), (3, 0.012, -70.8), (4, -0.016, 212.4)] {
            let x_bp = plate_at(DVec3::new(x_m, 0.0, 0.0));
            let c = command(session, tick, RigMode::Track, x_bp);
            let m = exchange(rig, &c);
            assert!(m.has(Capabilities::TRUTH) && m.is(Status::ENABLED));
            let (position, attitude) = (m.truth_position_m, m.truth_attitude);
            assert_eq!((position, attitude), (c.plate_position_m, c.plate_attitude));
            assert_eq!(m.leg_force_n.map(f64::to_bits), c.leg_force_n.map(f64::to_bits));
            let off = |felt: [f64; 6], n: f64| {
                felt.iter().zip([n, 0.0, 0.0, 0.0, 0.0, 0.0]).all(|(f, e)| (f - e).abs() < 1e-6)
            };
            assert!(off(m.sensor_b, force_n) && off(m.sensor_a, -force_n), "{m:?}");
            assert!(off(m.truth_port4, force_n) && off(m.truth_port3, -force_n), "{m:?}");
        }
    }

    pub(super) fn invariant_lockstep_repeats_bit_by_bit(rig: &mut dyn Rig) {
        let mut run = || {
            let session = new_session();
            let mut answers = Vec::new();
            for tick in 0..300 {
                let mode = if tick == 0 { RigMode::Idle } else { RigMode::Track };
                let m = exchange(rig, &command(session, tick, mode, way(tick)));
                answers.push(RigMeasurement { session: 0, ..m });
            }
            answers
        };
        let (first, second) = (run(), run());
        assert_eq!(first, second);
        assert!(first.iter().any(|m| m.sensor_a[0] > 50.0), "no contact");
        // A negative control: another way gives other answers.
        assert_ne!(first[100].state_digest, first[101].state_digest);
    }

    /// Spoils a command.
    type Spoil = fn(&mut RigCommand);

    /// With the reason expected.
    fn spoiled() -> [(Refusal, Spoil); 16] {
        [
            (Refusal::Version, |c| c.protocol_version += 1),
            (Refusal::TickBack, |c| c.tick -= 1),
            (Refusal::TickBack, |c| c.tick = 0),
            (Refusal::NotFinite, |c| c.plate_position_m[1] = f64::NAN),
            (Refusal::NotFinite, |c| c.leg_flow_speed_m_s[5] = f64::INFINITY),
            (Refusal::NotFinite, |c| c.mechanism[7] = f64::NEG_INFINITY),
            (Refusal::Mode, |c| c.mode = 5),
            (Refusal::Reserved, |c| c.reserved[3] = 1),
            (Refusal::Reserved, |c| c.mechanism_mode = 4),
            (Refusal::Reserved, |c| c.flags |= Flags::from_bits_retain(1 << 5)),
            (Refusal::Reserved, |c| c.leg_count = 7),
            (Refusal::Legs, |c| c.leg_count = 5),
            (Refusal::Period, |c| c.period_ns = 0),
            (Refusal::Period, |c| c.period_ns = u64::MAX),
            (Refusal::Range, |c| c.leg_force_n[2] = -1e200),
            (Refusal::Range, |c| c.plate_attitude = [0.0; 4]),
        ]
    }

    pub(super) fn invariant_a_refused_command_says_why_and_never_arrives(rig: &mut dyn Rig) {
        let elsewhere = plate_at(DVec3::new(0.5, 0.5, 0.5));
        for (refusal, spoil) in spoiled() {
            let session = new_session();
            let before = begin(rig, session, way(10));
            let mut bad = command(session, 2, RigMode::Track, elsewhere);
            let later_ns = bad.loop_time_ns + bad.period_ns;
            spoil(&mut bad);
            let m = exchange_by(rig, &bad, later_ns);
            assert!(m.is(Status::REFUSED | Status::SAFE_STATE), "{refusal:?}: {m:?}");
            assert_eq!(Refusal::from_number(m.refusal), Some(refusal));
            assert_eq!((m.session, m.tick), (session, bad.tick));
            assert_eq!(position(&m), position(&before), "{refusal:?} has arrived");
            // What follows is good, and held nevertheless: until an idle command of a new session.
            for (tick, mode) in [(3, RigMode::Track), (4, RigMode::Idle), (5, RigMode::Track)] {
                let m = exchange(rig, &command(session, tick, mode, elsewhere));
                assert!(m.is(Status::SAFE_STATE) && !m.is(Status::REFUSED), "{m:?}");
                assert_eq!((m.refusal, m.tick), (0, tick));
                assert_eq!(position(&m), position(&before), "{refusal:?}: has left its safe state");
            }
        }
        let m = begin(rig, new_session(), elsewhere);
        assert_eq!(position(&m), elsewhere.p);
    }

    pub(super) fn invariant_a_command_from_the_future_is_refused(rig: &mut dyn Rig) {
        let session = new_session();
        let before = begin(rig, session, start());
        let mut early = now(command(session, 2, RigMode::Track, way(10)));
        early.wakeup_ns += 3_000_000 * MS;
        let m = exchange(rig, &early);
        assert_eq!(Refusal::from_number(m.refusal), Some(Refusal::Future), "{m:?}");
        assert_eq!(position(&m), position(&before));
        assert!(m.stamp_ns <= monotonic_ns(), "its time was believed");
    }

    pub(super) fn invariant_a_session_begins_with_idle(rig: &mut dyn Rig) {
        let before = begin(rig, new_session(), way(10));
        for mode in [RigMode::Track, RigMode::Hold, RigMode::Retract] {
            let session = new_session();
            let m = exchange(rig, &command(session, 0, mode, way(20)));
            assert!(m.is(Status::SAFE_STATE) && !m.is(Status::REFUSED), "{m:?}");
            assert_eq!(position(&m), position(&before));
            let m = exchange(rig, &command(session, 1, RigMode::Idle, way(20)));
            assert!(m.is(Status::SAFE_STATE), "the session is spoiled");
        }
        begin(rig, new_session(), way(20));
    }

    pub(super) fn invariant_idle_forgets_the_run_before(rig: &mut dyn Rig) {
        let session = new_session();
        begin(rig, session, way(10));
        let m = exchange(rig, &command(session, 2, RigMode::Idle, way(20)));
        assert_eq!(position(&m), start().p, "idle of the same session");
        assert!(!m.is(Status::ENABLED));
        begin(rig, new_session(), way(10));
        let m = exchange(rig, &command(new_session(), 0, RigMode::Idle, way(20)));
        assert_eq!(position(&m), start().p, "idle of a new session");
    }

    pub(super) fn invariant_a_stop_is_left_through_idle_alone(rig: &mut dyn Rig) {
        let session = new_session();
        let before = begin(rig, session, way(10));
        for (tick, mode) in [(2, RigMode::Stop), (3, RigMode::Track), (4, RigMode::Retract)] {
            let m = exchange(rig, &command(session, tick, mode, way(20)));
            assert_eq!(position(&m), position(&before));
            assert!(!m.is(Status::SAFE_STATE), "a stop is an order, not a fault");
        }
        exchange(rig, &command(session, 5, RigMode::Idle, way(20)));
        let m = exchange(rig, &command(session, 6, RigMode::Track, way(20)));
        assert_eq!(position(&m), way(20).p);
    }

    /// A rig that draws back goes by its period for every tick, those of missed commands included;
    /// in lockstep for those commanded alone.
    pub(super) fn invariant_missed_ticks_are_lived_through_in_real_time(rig: &mut dyn Rig) {
        for (lockstep, ticks) in [(true, 2.0), (false, 5.0)] {
            let session = new_session();
            let before = begin(rig, session, start());
            let clock = |mut c: RigCommand| {
                if !lockstep {
                    // Due in the past, so that a slow machine is no silence.
                    c.flags -= Flags::LOCKSTEP;
                    c.wakeup_ns = 0;
                    c.period_ns = 100 * MS;
                }
                c
            };
            exchange(rig, &clock(command(session, 2, RigMode::Retract, start())));
            let c = clock(command(session, 6, RigMode::Retract, start()));
            let m = exchange(rig, &c);
            let gone_m = position(&m).distance(position(&before));
            let expected_m = 0.01 * ticks * c.period_ns as f64 * 1e-9;
            assert!((gone_m - expected_m).abs() < 1e-12, "{gone_m} m, not {expected_m} m: {m:?}");
        }
    }

    /// It goes on by itself, and then rests.
    pub(super) fn invariant_a_retraction_comes_to_rest(rig: &mut dyn Rig) {
        let session = new_session();
        let before = begin(rig, session, start());
        let mut was = before;
        let mut way_m = 0.0;
        for tick in 2..60 {
            let mut c = command(session, tick, RigMode::Retract, start());
            c.period_ns = 100 * MS;
            let m = exchange(rig, &c);
            way_m = position(&m).distance(position(&was));
            was = m;
        }
        let gone_m = position(&was).distance(position(&before));
        assert!(way_m == 0.0 && gone_m > 1e-3, "{gone_m} m, and {way_m} m in the last tick");
        assert!(was.is(Status::ENABLED) && !was.is_held());
    }

    pub(super) fn invariant_silence_ends_in_the_safe_state(rig: &mut dyn Rig) {
        let session = new_session();
        let before = begin(rig, session, way(10));
        let mut c = now(command(session, 2, RigMode::Hold, way(10)));
        exchange(rig, &c);
        std::thread::sleep(Duration::from_millis(100));
        c = now(command(session, 3, RigMode::Track, way(20)));
        let m = exchange(rig, &c);
        assert!(m.is(Status::SAFE_STATE) && !m.is(Status::UNSOLICITED), "{m:?}");
        assert_eq!((m.tick, m.refusal), (3, 0));
        assert_eq!(position(&m), position(&before));
        // Idle has no silence: nobody leads.
        let session = new_session();
        exchange(rig, &now(command(session, 0, RigMode::Idle, way(20))));
        std::thread::sleep(Duration::from_millis(100));
        let m = exchange(rig, &now(command(session, 1, RigMode::Track, way(20))));
        assert!(!m.is(Status::SAFE_STATE), "{m:?}");
    }
}

/// A rig that gives, tick by tick, measurements that are not to be used.
struct Liar;

impl Plant for Liar {
    fn command_form(&self) -> CommandForm {
        CommandForm::LEGS
    }

    fn answer(&mut self, command: &RigCommand) -> RigMeasurement {
        let capabilities = Capabilities::SENSOR_B;
        let mut m = RigMeasurement { capabilities, ..RigMeasurement::zero() };
        match command.tick {
            1 => m.sensor_b[2] = f64::NAN,
            2 => {
                m.capabilities |= Capabilities::TRUTH;
                m.truth_port4[0] = f64::INFINITY;
            }
            // Without the bit nobody is to look at it.
            3 => m.truth_port4[0] = f64::INFINITY,
            _ => (),
        }
        m
    }

    fn alone(&mut self, _period_ns: u64) -> RigMeasurement {
        RigMeasurement::zero()
    }
}

fn refuses_measurements(rig: &mut dyn Rig) {
    let session = new_session();
    for tick in 0..5 {
        let c = command(session, tick, RigMode::Idle, start());
        rig.send(&c).expect("sent");
        let got = rig.receive(PATIENCE, c.loop_time_ns + c.period_ns);
        if [1, 2].contains(&tick) {
            assert_eq!(got, Err(RigError::Refused(Refusal::NotFinite)), "tick {tick}");
        } else {
            assert!(matches!(got, Ok(Some(m)) if m.tick == tick), "tick {tick}: {got:?}");
        }
    }
    // Read before its time.
    let c = command(session, 5, RigMode::Idle, start());
    rig.send(&c).expect("sent");
    let got = rig.receive(PATIENCE, c.loop_time_ns);
    assert_eq!(got, Err(RigError::Refused(Refusal::Future)));
}

#[test]
fn invariant_a_measurement_that_is_not_finite_or_not_yet_is_refused_in_process() {
    refuses_measurements(&mut InProcess::new(Liar));
}

#[test]
fn invariant_a_measurement_that_is_not_finite_or_not_yet_is_refused_over_ipc() {
    let name = unique("liar");
    let _served = Served::of(&name, Liar);
    refuses_measurements(&mut IpcRig::connect(&name, PATIENCE).expect("the rig is there"));
}

#[test]
fn invariant_a_name_has_one_rig_and_one_loop() {
    let name = unique("second");
    let served = Served::of(&name, ideal());
    let second = RigServer::open(&name).expect_err("there is one");
    assert!(matches!(second, IpcError::Second { side: Side::Rig, .. }), "{second:?}");
    assert_eq!(second.refusal(), Some(Refusal::Second));
    let mine = format!("process {}", std::process::id());
    for word in [&name, &mine, "stop it"] {
        assert!(second.to_string().contains(word), "{second}");
    }
    let mut rig = IpcRig::connect(&name, PATIENCE).expect("the rig is there");
    let second = IpcRig::connect(&name, PATIENCE).expect_err("there is one");
    assert!(matches!(second, IpcError::Second { side: Side::Loop, .. }), "{second:?}");
    // Those that were there have noticed nothing.
    begin(&mut rig, new_session(), start());
    // Another name is another rig, and a name is free again when its holder has gone.
    drop(RigServer::open(&unique("other")).expect("another name"));
    drop(rig);
    drop(served);
    let again = RigServer::open(&name).expect("the name is free");
    drop(again);
}

#[test]
fn invariant_a_loop_without_a_rig_is_told_so() {
    let name = unique("nobody");
    let none = IpcRig::connect(&name, Duration::from_millis(50)).expect_err("nobody is there");
    assert_eq!(none, IpcError::NoRig(name));
}

#[test]
fn invariant_names_are_checked() {
    let long = "x".repeat(65);
    for name in ["", "a/b", "../x", "ä", "a b", "a\0", &long] {
        let refused = RigServer::open(name).expect_err(name);
        assert_eq!(refused, IpcError::Name(name.to_owned()));
        assert!(refused.to_string().contains("1 to 64"));
        let refused = IpcRig::connect(name, Duration::ZERO).expect_err(name);
        assert_eq!(refused, IpcError::Name(name.to_owned()));
    }
}

mod other_types {
    use super::*;
    use iceoryx2::prelude::*;

    /// Right name, one number short.
    #[derive(Clone, Copy, Debug, ZeroCopySend)]
    #[repr(C)]
    #[type_name("DocktwinRigCommandV3")]
    struct Truncated([u64; 38]);

    /// Right size, another name.
    #[derive(Clone, Copy, Debug, ZeroCopySend)]
    #[repr(C)]
    #[type_name("SomethingElse")]
    struct OtherName([u64; size_of::<RigCommand>() / 8]);

    /// As version 2 had it.
    #[derive(Clone, Copy, Debug, ZeroCopySend)]
    #[repr(C)]
    #[type_name("DocktwinRigCommandV2")]
    struct Second([u64; 52]);

    /// What either side says when the service carries a `T`.
    fn refused<T: core::fmt::Debug + ZeroCopySend + 'static>(what: &str) -> [IpcError; 2] {
        let name = unique(what);
        let node = NodeBuilder::new().create::<ipc::Service>().expect("a node");
        let service_name = format!("docktwin/{name}/command");
        let service_name = service_name.as_str().try_into().expect("a name");
        let _other =
            node.service_builder(&service_name).publish_subscribe::<T>().create().expect("new");
        [
            RigServer::open(&name).expect_err("another type"),
            IpcRig::connect(&name, PATIENCE).expect_err("another type"),
        ]
    }

    fn occupied<T: core::fmt::Debug + ZeroCopySend + 'static>(what: &str) {
        for refused in refused::<T>(what) {
            assert!(matches!(refused, IpcError::Payload(_)), "{refused:?}");
            assert_eq!(refused.refusal(), Some(Refusal::Size));
            assert!(refused.to_string().contains("protocol page"), "{refused}");
        }
    }

    /// One line says which version is there and what to change.
    #[test]
    fn invariant_a_rig_of_version_2_is_refused_with_what_to_change() {
        for refused in refused::<Second>("version") {
            assert!(matches!(refused, IpcError::Version { theirs: 2, .. }), "{refused:?}");
            assert_eq!(refused.refusal(), Some(Refusal::Version));
            let text = refused.to_string();
            for word in ["version 2", "version 3", "From version 2 to version 3"] {
                assert!(text.contains(word) && !text.contains('\n'), "{text}");
            }
        }
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/rig-protocol.md");
        let page = std::fs::read_to_string(page).expect("the page");
        assert!(page.contains("## From version 2 to version 3"));
        assert!(Refusal::Version.to_string().contains("From version 2 to version 3"));
    }

    #[test]
    fn invariant_a_truncated_payload_cannot_join() {
        occupied::<Truncated>("truncated");
    }

    #[test]
    fn invariant_another_type_cannot_join() {
        occupied::<OtherName>("type");
    }

    #[test]
    fn invariant_other_settings_cannot_join() {
        let name = unique("settings");
        let node = NodeBuilder::new().create::<ipc::Service>().expect("a node");
        let service_name = format!("docktwin/{name}/command");
        let service_name = service_name.as_str().try_into().expect("a name");
        let _other = node
            .service_builder(&service_name)
            .publish_subscribe::<RigCommand>()
            .create()
            .expect("new");
        let refused = RigServer::open(&name).expect_err("no history");
        assert!(matches!(refused, IpcError::Settings { .. }), "{refused:?}");
    }
}
