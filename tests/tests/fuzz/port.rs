//! Messages of the rig port with damage: the rig's end, the loop's end, and a whole loop.

use core::time::Duration;

use docktwin_hil::emulated::EmulatedRig;
use docktwin_rigport::guard::Guard;
use docktwin_rigport::in_process::InProcess;
use docktwin_rigport::message::{RigCommand, RigMeasurement, RigMode};
use docktwin_rigport::rig::{CommandForm, Plant, Rig, RigError};
use docktwin_rigport::validate::{RigEnd, Sequence};
use docktwin_run::{HilOptions, HilRun, SummaryOnly};
use docktwin_scenario::{Loader, Scenario};

use crate::damage;
use crate::dice::Dice;
use crate::models::{command, track};
use crate::world::{World, place, refused_run};

/// Numbers that are put into a message.
const NUMBERS: [f64; 24] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    1e-320,
    1e-12,
    1e-3,
    0.5,
    2.0,
    10.0,
    -10.0,
    1e3,
    -1e3,
    1e6,
    1e9,
    -1e12,
    1e100,
    1e154,
    -1e200,
    1e308,
    f64::MAX,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
];
/// Whole numbers that are put into a message.
const WHOLE: [u64; 12] = [0, 1, 2, 3, 4, 6, 7, 12, 1_000_000, u32::MAX as u64, 1 << 63, u64::MAX];

/// Damages bytes of a message in a few fields.
fn damaged(good: &[u8], dice: &mut Dice<'_>) -> Vec<u8> {
    let mut b = good.to_vec();
    for _ in 0..dice.below(4) {
        let word = dice.below(good.len() / 8) * 8;
        let word = word.min(b.len().saturating_sub(8));
        if b.len() < 8 {
            break;
        }
        match dice.below(8) {
            0..4 => b[word..word + 8].copy_from_slice(&dice.of(&NUMBERS).to_le_bytes()),
            4 => b[word..word + 8].copy_from_slice(&dice.of(&WHOLE).to_le_bytes()),
            5 => {
                let n = (*dice.of(&WHOLE) as u32).to_le_bytes();
                let at = word + 4 * dice.below(2);
                b[at..at + 4].copy_from_slice(&n);
            }
            6 => b[word + dice.below(8)] ^= 1 << dice.below(8),
            _ => damage::bytes_once(&mut b, dice),
        }
    }
    b
}

/// A plant that gets finite commands in a mode that exists, and nothing else.
struct Strict<P>(P);

impl<P: Plant> Plant for Strict<P> {
    fn command_form(&self) -> CommandForm {
        self.0.command_form()
    }

    fn answer(&mut self, c: &RigCommand) -> RigMeasurement {
        assert!(c.is_finite() && c.keeps_reserved(), "{c:?}");
        let mode = RigMode::from_number(c.mode).expect("a mode");
        if mode == RigMode::Track {
            let (x, t) = (c.plate(), c.plate_twist());
            assert!(x.is_finite() && t.v.is_finite() && t.w.is_finite(), "{x:?} {t:?} of {c:?}");
        }
        self.0.answer(c)
    }

    fn alone(&mut self, period_ns: u64) -> RigMeasurement {
        self.0.alone(period_ns)
    }
}

/// The scenario and the rig that all inputs begin with.
pub(crate) struct Start {
    scenario: Scenario,
    rig: EmulatedRig,
}

impl Start {
    pub(crate) fn new(world: &World) -> Self {
        let loader = Loader::new().set("run.duration_s", 0.1).sources(world.sources.clone());
        let scenario = loader.load(&place("scenarios/apas_fast.toml")).expect("it is shipped");
        let run = HilRun::new(&scenario, HilOptions::default()).expect("it is shipped");
        let rig = run.emulated().expect("it is shipped").plant().clone();
        Self { scenario, rig }
    }
}

pub(crate) fn judge(start: &Start, input: &[u8]) -> String {
    let mut dice = Dice::new(input);
    match dice.below(64) {
        0 => whole_loop(start, &mut dice),
        n if n % 2 == 0 => rig_end(start, &mut dice),
        _ => loop_end(start, &mut dice),
    }
}

/// Commands to an emulated rig. Whatever came, after an idle command of a new session it holds, and measures
/// finite numbers all the way.
fn rig_end(start: &Start, dice: &mut Dice<'_>) -> String {
    let (mut end, mut plant) = (RigEnd::new(), Strict(start.rig.clone()));
    let mut last = end.command(&mut plant, &command(RigMode::Idle, 0), 0);
    let mut said = Vec::new();
    for i in 1..=12 {
        let good = match dice.below(8) {
            0 => command(RigMode::Idle, i),
            1 => command(RigMode::Hold, i),
            2 => command(RigMode::Retract, i),
            3 => command(RigMode::Stop, i),
            4 | 5 => track(&last, i),
            _ => by_legs(&last, i),
        };
        let bytes = damaged(&good.to_bytes(), dice);
        let now = i * 1_000_000;
        let m = match RigCommand::from_bytes(&bytes) {
            Ok(c) => end.command(&mut plant, &c, now),
            Err(_) => end.unreadable(&mut plant, now),
        };
        assert!(m.is_finite(), "after command {i}: {m:?}");
        said.push(m.refusal);
        last = m;
    }
    let idle = RigCommand { session: 77, ..command(RigMode::Idle, 1) };
    end.command(&mut plant, &idle, 50_000_000);
    for tick in 2..30 {
        let hold = RigCommand { session: 77, ..command(RigMode::Hold, tick) };
        let m = end.command(&mut plant, &hold, (50 + tick) * 1_000_000);
        assert!(m.is_finite() && m.refusal == 0 && !end.is_safe(), "tick {tick}: {m:?}");
    }
    said.sort_unstable();
    said.dedup();
    format!("rig: refused {said:?}")
}

/// Follows the lengths where they are, a little further on.
fn by_legs(from: &RigMeasurement, tick: u64) -> RigCommand {
    let mut c = track(from, tick);
    c.leg_count = 6;
    c.leg_length_m = from.leg_length_m.map(|l| l + 1e-5);
    c.leg_force_n = from.leg_force_n;
    c
}

/// Measurements to a loop: what is accepted is finite, and a guard judges it.
fn loop_end(start: &Start, dice: &mut Dice<'_>) -> String {
    let (mut end, mut plant) = (RigEnd::new(), start.rig.clone());
    let mut sequence = Sequence { session: 1, tick: None };
    let mut said = Vec::new();
    for i in 0..6 {
        let c = command(if i == 0 { RigMode::Idle } else { RigMode::Hold }, i);
        let good = end.command(&mut plant, &c, 0);
        let bytes = damaged(&good.to_bytes(), dice);
        let Ok(mut m) = RigMeasurement::from_bytes(&bytes) else { continue };
        let found = sequence.measurement(&mut m, (i + 1) * 1_000_000);
        said.push(found.err().map_or(0, |e| e as u32));
        if found.is_err() {
            continue;
        }
        let finite = |x: Option<[docktwin_core::DVec3; 2]>| {
            x.is_none_or(|x| x.iter().all(|x| x.is_finite()))
        };
        assert!(m.plate().is_none_or(|x| x.is_finite()), "{m:?}");
        assert!(m.plate_twist().is_none_or(|t| t.v.is_finite() && t.w.is_finite()), "{m:?}");
        assert!(finite(m.ring()) && finite(m.accelerometer()), "{m:?}");
        assert!(m.latch_phases().len() <= 8);
        let passed = Guard::of(&c).passed(&c, &m);
        assert!(passed.is_empty(), "no limit was set: {passed:?}");
    }
    said.sort_unstable();
    said.dedup();
    format!("loop: refused {said:?}")
}

/// A rig whose measurements are damaged for some ticks on the way.
struct Faulty<'a> {
    rig: InProcess<EmulatedRig>,
    sequence: Sequence,
    from: u64,
    ticks: u64,
    seen: u64,
    damage: &'a [u8],
}

impl Rig for Faulty<'_> {
    fn send(&mut self, command: &RigCommand) -> Result<(), RigError> {
        if command.session != self.sequence.session {
            self.sequence = Sequence { session: command.session, tick: None };
        }
        self.rig.send(command)
    }

    fn receive(
        &mut self,
        patience: Duration,
        now_ns: u64,
    ) -> Result<Option<RigMeasurement>, RigError> {
        let Some(good) = self.rig.receive(patience, now_ns)? else { return Ok(None) };
        self.seen += 1;
        if self.seen < self.from || self.seen >= self.from + self.ticks {
            return Ok(Some(good));
        }
        let bytes = damaged(&good.to_bytes(), &mut Dice::new(self.damage));
        let mut m = RigMeasurement::from_bytes(&bytes).map_err(RigError::Refused)?;
        // A tick of the damaged message may be any; those that follow are good.
        let mut sequence = Sequence { tick: good.tick.checked_sub(1), ..self.sequence };
        sequence.measurement(&mut m, now_ns).map_err(RigError::Refused)?;
        Ok(Some(m))
    }
}

/// A run of the loop ends with a summary or is refused, whatever its rig measures.
fn whole_loop(start: &Start, dice: &mut Dice<'_>) -> String {
    let (from, ticks) = (dice.below(4000) as u64, dice.below(200) as u64);
    let damage: Vec<u8> = (0..16).map(|_| dice.byte()).collect();
    let rig = InProcess::new(start.rig.clone());
    let rig = Faulty { rig, sequence: Sequence::default(), from, ticks, seen: 0, damage: &damage };
    let run = HilRun::new(&start.scenario, HilOptions::default()).expect("it is shipped");
    match run.run(rig, &mut SummaryOnly) {
        Ok(summary) => {
            let text = serde_json::to_string(&summary).expect("a summary");
            assert!(!text.contains("NaN"), "{text}");
            format!("whole loop: {}", summary.outcome)
        }
        Err(e) => refused_run(&e),
    }
}
