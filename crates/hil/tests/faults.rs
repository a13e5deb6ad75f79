//! Faults as data: every kind does something, from its time on and no longer, and what has none is as it was
//! to the last bit.

mod common;
mod stand;

use std::time::Duration;

use common::{MS, command, ideal, plate_at, start};
use docktwin_core::DVec3;
use docktwin_hil::{
    emulated::EmulatedRig,
    faults::{Fault, FaultKind, FaultyPlant, FaultyRig, Instrument, MOST_LATE, When},
};
use docktwin_physics::platform::Platform;
use docktwin_rigport::{
    in_process::InProcess,
    message::{Refusal, RigCommand, RigMeasurement, RigMode, Status},
    rig::{Plant, Rig, RigError},
};
use stand::{Stand, free_stick};

/// What comes of a tick.
type Got = Result<Option<RigMeasurement>, RigError>;

fn exchange(rig: &mut impl Rig, c: &RigCommand) -> Got {
    rig.send(c)?;
    rig.receive(Duration::ZERO, c.loop_time_ns + c.period_ns)
}

/// Commands of the emulated rig's test: idle, then a slow swing that moves every leg.
struct Swing {
    platform: Platform,
    force_n: [f64; 6],
}

impl Swing {
    fn new(stand: &Stand) -> Self {
        let platform = Platform::new(&stand.rig);
        let mut rig = InProcess::new(emulated(stand));
        let first = exchange(&mut rig, &command(1, 0, RigMode::Idle, start()));
        let m = first.expect("it answers").expect("at once");
        Self { platform, force_n: m.leg_force_n }
    }

    fn command(&self, tick: u64) -> RigCommand {
        let mode = if tick == 0 { RigMode::Idle } else { RigMode::Track };
        let t = tick as f64 * 1e-3;
        let (s, k) = ((20.0 * t).sin(), 20.0 * (20.0 * t).cos());
        let amplitude = DVec3::new(2e-3, 3e-3, -1e-3);
        let x_bp = plate_at(amplitude * s);
        let twist = docktwin_core::Twist { v: amplitude * k, w: DVec3::ZERO };
        let legs = self.platform.at(&x_bp);
        let speed = legs.rates(&twist);
        RigCommand {
            leg_length_m: legs.length_m,
            leg_speed_m_s: speed,
            leg_flow_speed_m_s: speed,
            leg_force_n: self.force_n,
            plate_velocity_m_s: twist.v.to_array(),
            plate_rate_rad_s: [0.0; 3],
            ..command(1, tick, mode, x_bp)
        }
    }
}

fn emulated(stand: &Stand) -> EmulatedRig {
    stand.emulated(free_stick(), &stand.middle())
}

const TICKS: u64 = 120;
const AT: u64 = 40;

fn run(swing: &Swing, rig: &mut impl Rig) -> Vec<Got> {
    (0..TICKS).map(|tick| exchange(rig, &swing.command(tick))).collect()
}

/// A size that shows.
fn size(what: FaultKind) -> f64 {
    match what {
        FaultKind::LegReference(_) | FaultKind::LegReferences | FaultKind::LengthsTorn => 1e-3,
        FaultKind::ValveGain(_) | FaultKind::Gain(_) => 1.5,
        FaultKind::Late => 3.0,
        FaultKind::LagGrows => 100.0,
        FaultKind::StampOffset | FaultKind::StampDrift => -1e-3,
        FaultKind::LatchReads(_) => 2.0,
        _ => 0.05,
    }
}

#[test]
fn invariant_every_kind_shows_from_its_tick_on_and_not_before() {
    let stand = Stand::new(None);
    let swing = Swing::new(&stand);
    let good = run(&swing, &mut FaultyRig::new(InProcess::new(emulated(&stand)), &[]));
    assert_eq!(good, run(&swing, &mut InProcess::new(emulated(&stand))), "no fault, other bits");
    let kinds = FaultKind::every();
    // Legs, valves, sensors, communication, timing, clocks: as many as a campaign needs.
    assert!(kinds.len() >= 50, "{}", kinds.len());
    for what in kinds {
        let fault = Fault::from(what, When::Tick(AT)).sized(size(what));
        let mut rig = FaultyRig::new(InProcess::new(emulated(&stand)), &[fault]);
        let bad = run(&swing, &mut rig);
        let at = AT as usize;
        assert_eq!(bad[..at], good[..at], "{what:?} shows before its time");
        assert_ne!(bad[at..], good[at..], "{what:?} shows nowhere");
        // Twice the same.
        let again = FaultyRig::new(InProcess::new(emulated(&stand)), &[fault]);
        assert!(same(&bad, &run(&swing, &mut { again })), "{what:?} does not repeat");
    }
}

/// Equal to the bit; numbers that are not one included.
fn same(a: &[Got], b: &[Got]) -> bool {
    let bytes = |x: &Got| x.map(|m| m.map(|m| m.to_bytes()));
    a.iter().map(bytes).eq(b.iter().map(bytes))
}

/// Behind the rig's end of a port a fault of the rig is the same as in front of it; the link's are not the
/// rig's.
#[test]
fn invariant_a_plant_has_the_faults_of_the_rig_itself() {
    let stand = Stand::new(None);
    let swing = Swing::new(&stand);
    let good = run(&swing, &mut InProcess::new(emulated(&stand)));
    for what in FaultKind::every() {
        let fault = Fault::from(what, When::Tick(AT)).sized(size(what));
        let plant = FaultyPlant::new(emulated(&stand), &[fault]);
        let inside = run(&swing, &mut InProcess::new(plant));
        if what.is_of_the_link() {
            assert!(same(&inside, &good), "{what:?}");
        } else {
            let mut outside = FaultyRig::new(InProcess::new(emulated(&stand)), &[fault]);
            assert!(same(&inside, &run(&swing, &mut outside)), "{what:?}");
        }
    }
}

#[test]
fn invariant_a_fault_ends_when_its_time_is_over() {
    let stand = Stand::new(None);
    let swing = Swing::new(&stand);
    let good = run(&swing, &mut InProcess::new(emulated(&stand)));
    // What only spoils readings leaves nothing behind.
    for what in [
        FaultKind::Offset(Instrument::SensorA, 0),
        FaultKind::Frozen(Instrument::SensorB),
        FaultKind::LengthsSlip,
        FaultKind::NotFinite(Instrument::Accelerometer),
        FaultKind::Missing,
        FaultKind::Unreadable,
    ] {
        let fault = Fault::from(what, When::Tick(AT)).sized(0.05).lasting(7e-3);
        let bad = run(&swing, &mut FaultyRig::new(InProcess::new(emulated(&stand)), &[fault]));
        let (from, to) = (AT as usize, AT as usize + 7);
        assert_eq!((&bad[..from], &bad[to..]), (&good[..from], &good[to..]), "{what:?}");
        // What is frozen shows from the second tick on.
        for k in from + 1..to {
            assert!(!same(&bad[k..=k], &good[k..=k]), "{what:?}, tick {k}");
        }
    }
}

/// Ticks in which an ideal rig's stamps are off: those in which the fault is active.
fn active(at: When, for_s: Option<f64>) -> Vec<u64> {
    let fault = Fault { for_s, ..Fault::from(FaultKind::StampOffset, at).sized(-1e-4) };
    let mut rig = FaultyRig::new(InProcess::new(ideal()), &[fault]);
    let mut out = Vec::new();
    for tick in 0..100 {
        let mode = if tick < 10 { RigMode::Idle } else { RigMode::Track };
        // From tick 61 on it presses: the play is 10 mm.
        let x_m = if tick < 10 { 0.0 } else { 2e-4 * (tick - 10) as f64 };
        let c = command(1, tick, mode, plate_at(DVec3::new(x_m, 0.0, 0.0)));
        let m = exchange(&mut rig, &c).expect("it answers").expect("at once");
        if m.stamp_ns != c.loop_time_ns + c.period_ns {
            out.push(tick);
        }
    }
    out
}

#[test]
fn oracle_a_fault_begins_when_it_is_to_begin() {
    assert_eq!(active(When::Tick(17), None), (17..100).collect::<Vec<_>>());
    assert_eq!(active(When::Tick(17), Some(2e-3)), [17, 18]);
    assert_eq!(active(When::Time(0.004), Some(3e-3)), [4, 5, 6]);
    assert_eq!(active(When::Tracking(0.005), Some(1e-3)), [15]);
    // 35.4 N/mm from 10 mm on: above 5 N in the answer to command 61, and known with the next one.
    assert_eq!(active(When::Contact(0.0), Some(2e-3)), [62, 63]);
    assert_eq!(active(When::Contact(0.01), Some(1e-3)), [71]);
}

#[test]
fn oracle_late_measurements_come_in_order_and_at_most_so_late() {
    let mut got = Vec::new();
    let fault = Fault::from(FaultKind::Late, When::Tick(10)).sized(3.0);
    let mut rig = FaultyRig::new(InProcess::new(ideal()), &[fault]);
    for tick in 0..20 {
        let mode = if tick == 0 { RigMode::Idle } else { RigMode::Track };
        let m = exchange(&mut rig, &command(1, tick, mode, start())).expect("it answers");
        got.push(m.map(|m| m.tick));
    }
    let expected: Vec<Option<u64>> = (0..20)
        .map(|tick| match tick {
            0..10 => Some(tick),
            // What is on its way then has come already.
            10..13 => None,
            _ => Some(tick - 3),
        })
        .collect();
    assert_eq!(got, expected);
    let fault = Fault::from(FaultKind::Late, When::Tick(0)).sized(1e9);
    let mut rig = FaultyRig::new(InProcess::new(ideal()), &[fault]);
    let late = (0..200).position(|tick| {
        let mode = if tick == 0 { RigMode::Idle } else { RigMode::Track };
        exchange(&mut rig, &command(1, tick, mode, start())).expect("it answers").is_some()
    });
    assert_eq!(late, Some(MOST_LATE));
}

/// A new session begins without the faults of the last, which come again at their time.
#[test]
fn invariant_faults_are_those_of_a_session() {
    let fault = Fault::from(FaultKind::OtherVersion, When::Time(0.003));
    let mut rig = FaultyRig::new(InProcess::new(ideal()), &[fault]);
    for session in [1, 2] {
        for tick in 0..6 {
            let mode = if tick == 0 { RigMode::Idle } else { RigMode::Track };
            let mut c = command(session, tick, mode, start());
            c.loop_time_ns += 1000 * session * MS;
            c.wakeup_ns = c.loop_time_ns;
            let got = exchange(&mut rig, &c);
            let refused = got == Err(RigError::Refused(Refusal::Version));
            assert_eq!(refused, tick >= 3, "session {session}, tick {tick}: {got:?}");
        }
    }
}

/// A leg whose reference is off reads what is commanded and stands elsewhere: the reason why lengths alone
/// are not to be believed.
#[test]
fn oracle_a_wrong_reference_moves_the_plate_and_not_the_readings() {
    let stand = Stand::new(None);
    let by_m = 5e-3;
    let settle = |faults: &[Fault]| {
        let mut plant = FaultyPlant::new(emulated(&stand), faults);
        let swing = Swing::new(&stand);
        let mut last = RigMeasurement::zero();
        for tick in 0..3000 {
            let mut c = swing.command(0);
            c.mode = if tick == 0 { RigMode::Idle } else { RigMode::Track } as u32;
            (c.tick, c.loop_time_ns) = (tick, tick * MS);
            (c.leg_speed_m_s, c.leg_flow_speed_m_s) = ([0.0; 6], [0.0; 6]);
            last = plant.answer(&c);
        }
        assert!(last.is(Status::ENABLED));
        last
    };
    let good = settle(&[]);
    let off = settle(&[Fault::from(FaultKind::LegReferences, When::Time(0.0)).sized(by_m)]);
    for i in 0..6 {
        let read = (off.leg_length_m[i] - good.leg_length_m[i]).abs();
        assert!(read < 3e-4, "leg {i} reads {read} m more");
    }
    // All legs shorter alike: the plate comes down along their axis, by more than the legs.
    let down = DVec3::from_array(good.truth_position_m) - DVec3::from_array(off.truth_position_m);
    assert!(down.length() > by_m, "{down:?}");
}
