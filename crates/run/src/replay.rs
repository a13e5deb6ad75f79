//! A replay: the recorded control wrenches through the same twin, every recorded signal compared tick by
//! tick, bit by bit.

mod comparison;
mod figures;
mod with_rig;

use std::path::{Path, PathBuf};

use docktwin_core::{DVec3, Wrench};
use docktwin_physics::reduced::Inputs;
use docktwin_record::{Cell, Flaw, RunReader, Summary, TickRecord};
use docktwin_scenario::{Scenario, load_scenario};

use self::comparison::{Comparison, DIGEST};
use crate::{
    error::RunError, provenance::same_files, rehearsal::Rehearsal, signals::input_columns,
    twin::TwinKind,
};

/// Steps in one tick, as a scenario may ask for.
const MOST_STEPS: u32 = 10_000;

/// Where a replay first differs.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Tick.
    pub tick: u64,
    /// Its time, s.
    pub time_s: f64,
    /// Column that differs, or `tick`, `time`, `contacts`, `contacts[2].depth_m`; `state_digest` where the
    /// state itself does.
    pub signal: String,
    /// As recorded; a digest in hexadecimal.
    pub recorded: String,
    /// As it comes out now.
    pub replayed: String,
}

/// What a replay found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Replayed {
    /// Ticks that were compared.
    pub ticks: u64,
    /// Signals compared in each of them.
    pub signals: usize,
    /// Recorded columns that this version does not know, and could not compare.
    pub unknown: Vec<String>,
    /// Why the recording ends before the run did.
    pub cut: Option<String>,
    /// Whether the rows, the summary or a file are not those of the run by their digests, or the log is
    /// damaged between others: `cut` says which.
    pub not_as_recorded: bool,
    /// The first tick that differs.
    pub first_difference: Option<Difference>,
    /// The first figure of `summary.json` that does not follow from the ticks; only where every tick of the
    /// run was compared.
    pub summary_difference: Option<FigureDifference>,
    /// Figures of `summary.json` that were compared.
    pub figures: usize,
}

impl Replayed {
    /// Whether every bit came out as it was recorded, as far as the recording goes.
    #[must_use]
    pub const fn identical(&self) -> bool {
        self.first_difference.is_none()
            && self.summary_difference.is_none()
            && !self.not_as_recorded
    }
}

/// A figure of the summary that the replay does not give.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FigureDifference {
    /// Key of `summary.json`.
    pub key: String,
    /// As it stands there.
    pub recorded: String,
    /// As it comes out now.
    pub replayed: String,
}

/// A recorded tick as far as a replay needs it.
#[derive(Clone, Debug)]
struct RecordedTick {
    /// Control wrenches.
    control: Inputs,
    /// `loop_phase`; 0 where there is none.
    phase: u64,
    /// All of it.
    whole: TickRecord,
}

/// A recording, opened for a replay.
pub struct Replay {
    run: PathBuf,
    reader: RunReader,
    columns: Columns,
}

impl Replay {
    /// Opens a run directory.
    ///
    /// # Errors
    /// It cannot be read, or lacks what a replay needs.
    pub fn open(run: &Path) -> Result<Self, RunError> {
        // Every row is compared anyway: one that does not fit its digest is named by its signal.
        let reader = RunReader::open(run)?.unchecked();
        let columns = Columns::find(&reader, run)?;
        Ok(Self { run: run.to_owned(), reader, columns })
    }

    /// Replays it to its end, or to the first tick that differs.
    ///
    /// # Errors
    /// The recording does not repeat (it kept real time, or the rig was in another process), its files
    /// do not belong together, or nothing of it can be read.
    pub fn run(mut self) -> Result<Replayed, RunError> {
        let mut found = Replayed::default();
        if self.of("command")? == "hil" {
            with_rig::replay(&mut self, &mut found)?;
        } else {
            self.rehearsal(&mut found)?;
        }
        let cut = self.reader.cut();
        found.cut = cut.map(ToString::to_string);
        found.not_as_recorded = cut.is_some_and(|c| !c.merely_ends());
        if found.ticks == 0 {
            let why = found.cut.unwrap_or_else(|| "it ends before the first".to_owned());
            return Err(RunError::usage(
                format!("no tick can be read from the recording: {why}: {}", self.run.display()),
                "use another copy, or rehearse again",
            ));
        }
        Ok(found)
    }

    /// The run directory.
    fn path(&self) -> &Path {
        &self.run
    }

    /// Whether it has the phase of a loop.
    const fn has_phase(&self) -> bool {
        self.columns.phase.is_some()
    }

    /// What the recording says of itself.
    fn metadata(&self) -> &std::collections::BTreeMap<String, String> {
        self.reader.metadata()
    }

    /// One word of it.
    fn of(&self, key: &str) -> Result<String, RunError> {
        self.metadata().get(key).cloned().ok_or_else(|| {
            RunError::usage(
                format!("{} names no `{key}`", self.run.display()),
                "this recording was not made by `docktwin rehearse`",
            )
        })
    }

    fn number(&self, key: &str) -> Result<u64, RunError> {
        self.of(key)?.parse::<u64>().map_err(|e| {
            RunError::usage(
                format!("`{key}` of {}: {e}", self.run.display()),
                "the recording is damaged; use another copy",
            )
        })
    }

    fn damaged(&self, what: String) -> RunError {
        RunError::usage(
            format!("{what}: {}", self.run.display()),
            "run.mcap and scenario.toml are not of one run, or damaged; use another copy",
        )
    }

    /// Whether scenario and models are those that were kept with the run.
    fn check_files(&self) -> Result<(), RunError> {
        let changed = self.reader.changed_files();
        if changed.is_empty() { Ok(()) } else { Err(self.damaged(changed.join("\n"))) }
    }

    /// The next recorded tick.
    fn next(&mut self) -> Result<Option<RecordedTick>, RunError> {
        let columns = &self.columns;
        Ok(self.reader.next_tick()?.map(|t| RecordedTick {
            control: columns.control(&t.row),
            phase: columns.phase.map_or(0, |i| t.row[i].bits()),
            whole: t,
        }))
    }

    fn rehearsal(&mut self, found: &mut Replayed) -> Result<(), RunError> {
        let scenario = load_scenario(&self.run.join("scenario.toml"), &[])?;
        same_files(&scenario.files, self.metadata(), &self.run)?;
        let twin = self.twin(&scenario)?;
        self.check_files()?;
        let mut run = twin.begin(Comparison::with(&self.reader))?;
        let mut held: Option<Inputs> = None;
        while let Some(t) = self.next()? {
            if let Some(control) = held.replace(t.control) {
                run.step_as_recorded(&control);
            }
            run.sink_mut().expect(t.whole);
            run.record_as_recorded(&t.control);
            if run.sink_mut().differs() {
                break;
            }
        }
        run.sink_mut().give(found);
        if self.all_compared(found) {
            let (replayed, _) = run.finish();
            self.compare_summary(&replayed, found);
        }
        Ok(())
    }

    /// Whether every tick of the run was compared and is the same.
    fn all_compared(&self, found: &Replayed) -> bool {
        let whole = self.reader.cut().is_none_or(|c| c.flaw == Flaw::Foreign);
        whole && found.ticks > 0 && found.first_difference.is_none()
    }

    /// Holds the figures of `summary.json` that follow from the ticks against those of the replay.
    fn compare_summary(&self, replayed: &Summary, found: &mut Replayed) {
        // One that cannot be read is told by the reader.
        let Ok(Some(recorded)) = self.reader.summary() else { return };
        if recorded.recording.as_ref().is_some_and(|r| r.dropped_ticks > 0) {
            return;
        }
        let (figures, difference) = figures::compare(&recorded, replayed);
        found.figures = figures;
        found.summary_difference = difference;
    }

    /// The twin that made the recording, at its start.
    fn twin<'a>(&self, scenario: &'a Scenario) -> Result<Rehearsal<'a>, RunError> {
        let (tick_nanos, steps) = (self.number("tick_nanos")?, self.number("steps_per_tick")?);
        if tick_nanos != scenario.run.tick_nanos {
            return Err(self.damaged(format!(
                "the recording has ticks of {tick_nanos} ns, its scenario.toml of {} ns",
                scenario.run.tick_nanos
            )));
        }
        let in_tick = u32::try_from(steps).ok().filter(|n| (1..=MOST_STEPS).contains(n));
        let in_tick = in_tick.ok_or_else(|| {
            self.damaged(format!(
                "the recording has {steps} steps in a tick; allowed: 1 to {MOST_STEPS}"
            ))
        })?;
        let word = self.of("twin")?;
        let kind = TwinKind::WORDS.into_iter().find(|(w, _)| *w == word).map(|(_, kind)| kind);
        let kind = kind.ok_or_else(|| {
            RunError::usage(
                format!("the recording was made by a twin called `{word}`: {}", self.run.display()),
                "this version knows `full` and `reduced`",
            )
        })?;
        Rehearsal::as_recorded(scenario, kind, in_tick)
    }
}

/// Where control wrenches and phase stand in a row.
struct Columns {
    inputs: Vec<usize>,
    phase: Option<usize>,
}

impl Columns {
    fn find(reader: &RunReader, run: &Path) -> Result<Self, RunError> {
        let index = |name: &str| {
            reader.column_index(name).ok_or_else(|| {
                RunError::usage(
                    format!("{} has no column `{name}`", run.display()),
                    "the recording was made by another version; replay it with that one",
                )
            })
        };
        index(DIGEST)?;
        Ok(Self {
            inputs: input_columns().iter().map(|n| index(n)).collect::<Result<_, _>>()?,
            phase: reader.column_index("loop_phase"),
        })
    }

    fn control(&self, row: &[Cell]) -> Inputs {
        let number = |i: usize| row[self.inputs[i]].as_f64();
        let vector = |i: usize| DVec3::new(number(i), number(i + 1), number(i + 2));
        Inputs {
            chaser: Wrench { f: vector(0), m: vector(3) },
            target: Wrench { f: vector(6), m: vector(9) },
        }
    }
}
