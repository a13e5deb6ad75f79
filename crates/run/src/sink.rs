//! Where a run goes: a directory, memory, or nowhere but into its summary.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use docktwin_core::{Digest, SimTime, Tick};
use docktwin_physics::reduced::Inputs;
use docktwin_record::{
    Cell, Column, ContactRow, Event, KEPT_KEY, Policy, RecordError, RunWriter, Summary, files,
};
use docktwin_scenario::Scenario;

use crate::{
    control::Situation,
    error::SinkError,
    provenance::{KeptFile, ModelCopies, slashes},
};

mod memory;

pub use memory::{Memory, Signals};

/// What is about to run.
#[derive(Clone, Copy, Debug)]
pub struct Header<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// Columns of every row.
    pub columns: &'a [Column],
    /// Names of the pairs of surfaces, by [`docktwin_physics::contact::SurfacePair::index`].
    pub pair_names: &'a [String],
    /// What the recording says of itself.
    pub metadata: &'a BTreeMap<String, String>,
    /// Path of the rig among the kept files, where there is a rig: the scenario that is kept names it.
    pub rig: Option<&'a Path>,
    /// Files kept beside the models.
    pub kept: &'a [KeptFile],
    /// Whether the run keeps real time and must not wait for a sink.
    pub real_time: bool,
}

/// One tick.
#[derive(Clone, Copy, Debug)]
pub struct TickView<'a> {
    /// Its number.
    pub tick: Tick,
    /// Its time.
    pub time: SimTime,
    /// The signals, by [`Header::columns`].
    pub row: &'a [Cell],
    /// Places of contact.
    pub contacts: &'a [ContactRow],
    /// Whether something happened, or the run ends: worth a picture.
    pub due: bool,
    /// The motion, and what moved it.
    pub situation: &'a Situation,
    /// Control wrenches held from this tick.
    pub control: &'a Inputs,
}

/// Takes what a run gives. A sink that fails says so once, and takes nothing any more; the run goes on to
/// its summary, which is worth having, and the verdict is at best `degraded`.
///
/// Two sinks in a pair, and a list of boxed ones, are a sink: begun in their order, closed in the reverse
/// order, so that a run directory, begun first, gets what the others put into the summary. `()` keeps
/// nothing.
pub trait Sink {
    /// Whether rows are looked at; without any such sink they are not made.
    fn wants_rows(&self) -> bool {
        true
    }

    /// Before the first tick.
    ///
    /// # Errors
    /// It cannot be begun: the run then does not begin either.
    fn begin(&mut self, _header: &Header<'_>) -> Result<(), SinkError> {
        Ok(())
    }

    /// Something that happened in the tick to come.
    ///
    /// # Errors
    /// It cannot be kept.
    fn event(&mut self, _event: &Event) -> Result<(), SinkError> {
        Ok(())
    }

    /// The signals of a tick.
    ///
    /// # Errors
    /// They cannot be kept.
    fn tick(&mut self, _tick: &TickView<'_>) -> Result<(), SinkError> {
        Ok(())
    }

    /// A loop outside its closed phase: nothing is recorded, but something may be shown.
    fn approach(&mut self, _phase: &'static str, _situation: &Situation) {}

    /// The end; the summary is complete but for what sinks put in: `recording`, and a verdict that is
    /// degraded when something was lost.
    ///
    /// # Errors
    /// It cannot be closed.
    fn finish(&mut self, _summary: &mut Summary) -> Result<(), SinkError> {
        Ok(())
    }
}

/// Keeps nothing: what is left of the run is its summary.
#[derive(Clone, Copy, Debug, Default)]
pub struct SummaryOnly;

impl Sink for SummaryOnly {
    fn wants_rows(&self) -> bool {
        false
    }
}

impl Sink for () {
    fn wants_rows(&self) -> bool {
        false
    }
}

impl<S: Sink + ?Sized> Sink for &mut S {
    fn wants_rows(&self) -> bool {
        (**self).wants_rows()
    }

    fn begin(&mut self, header: &Header<'_>) -> Result<(), SinkError> {
        (**self).begin(header)
    }

    fn event(&mut self, event: &Event) -> Result<(), SinkError> {
        (**self).event(event)
    }

    fn tick(&mut self, tick: &TickView<'_>) -> Result<(), SinkError> {
        (**self).tick(tick)
    }

    fn approach(&mut self, phase: &'static str, situation: &Situation) {
        (**self).approach(phase, situation);
    }

    fn finish(&mut self, summary: &mut Summary) -> Result<(), SinkError> {
        (**self).finish(summary)
    }
}

impl<S: Sink> Sink for Option<S> {
    fn wants_rows(&self) -> bool {
        self.as_ref().is_some_and(Sink::wants_rows)
    }

    fn begin(&mut self, header: &Header<'_>) -> Result<(), SinkError> {
        self.as_mut().map_or(Ok(()), |s| s.begin(header))
    }

    fn event(&mut self, event: &Event) -> Result<(), SinkError> {
        self.as_mut().map_or(Ok(()), |s| s.event(event))
    }

    fn tick(&mut self, tick: &TickView<'_>) -> Result<(), SinkError> {
        self.as_mut().map_or(Ok(()), |s| s.tick(tick))
    }

    fn approach(&mut self, phase: &'static str, situation: &Situation) {
        if let Some(s) = self {
            s.approach(phase, situation);
        }
    }

    fn finish(&mut self, summary: &mut Summary) -> Result<(), SinkError> {
        self.as_mut().map_or(Ok(()), |s| s.finish(summary))
    }
}

impl<S: Sink + ?Sized> Sink for Vec<Box<S>> {
    fn wants_rows(&self) -> bool {
        self.iter().any(|s| s.wants_rows())
    }

    fn begin(&mut self, header: &Header<'_>) -> Result<(), SinkError> {
        self.iter_mut().try_for_each(|s| s.begin(header))
    }

    fn event(&mut self, event: &Event) -> Result<(), SinkError> {
        first_error(self.iter_mut().map(|s| s.event(event)))
    }

    fn tick(&mut self, tick: &TickView<'_>) -> Result<(), SinkError> {
        first_error(self.iter_mut().map(|s| s.tick(tick)))
    }

    fn approach(&mut self, phase: &'static str, situation: &Situation) {
        self.iter_mut().for_each(|s| s.approach(phase, situation));
    }

    fn finish(&mut self, summary: &mut Summary) -> Result<(), SinkError> {
        first_error(self.iter_mut().rev().map(|s| s.finish(summary)))
    }
}

/// Every sink is asked; the first failure is given.
fn first_error(all: impl Iterator<Item = Result<(), SinkError>>) -> Result<(), SinkError> {
    let mut first = Ok(());
    for one in all {
        first = first.and(one);
    }
    first
}

impl<A: Sink, B: Sink> Sink for (A, B) {
    fn wants_rows(&self) -> bool {
        self.0.wants_rows() || self.1.wants_rows()
    }

    fn begin(&mut self, header: &Header<'_>) -> Result<(), SinkError> {
        self.0.begin(header)?;
        self.1.begin(header)
    }

    fn event(&mut self, event: &Event) -> Result<(), SinkError> {
        let first = self.0.event(event);
        first.and(self.1.event(event))
    }

    fn tick(&mut self, tick: &TickView<'_>) -> Result<(), SinkError> {
        let first = self.0.tick(tick);
        first.and(self.1.tick(tick))
    }

    fn approach(&mut self, phase: &'static str, situation: &Situation) {
        self.0.approach(phase, situation);
        self.1.approach(phase, situation);
    }

    fn finish(&mut self, summary: &mut Summary) -> Result<(), SinkError> {
        let last = self.1.finish(summary);
        last.and(self.0.finish(summary))
    }
}

/// A run directory: crash-safe log, table, events, summary, scenario and models.
#[derive(Debug)]
pub struct RunDirectory {
    path: PathBuf,
    writer: Option<RunWriter>,
    lost: bool,
}

impl RunDirectory {
    /// At a path, where nothing was recorded yet; it is made when the run begins.
    #[must_use]
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), writer: None, lost: false }
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn keep(
        &mut self,
        work: impl FnOnce(&mut RunWriter) -> Result<(), RecordError>,
    ) -> Result<(), SinkError> {
        let Some(writer) = self.writer.as_mut().filter(|_| !self.lost) else { return Ok(()) };
        work(writer).map_err(|e| {
            self.lost = true;
            e.into()
        })
    }
}

impl Sink for RunDirectory {
    fn begin(&mut self, h: &Header<'_>) -> Result<(), SinkError> {
        let models = ModelCopies::of(h.scenario)?;
        let policy = if h.real_time { Policy::DropNewest } else { Policy::Wait };
        let columns = h.columns.to_vec();
        let mut scenario = models.refer(&h.scenario.as_run_toml());
        if let Some(rig) = h.rig {
            scenario = with_rig(&scenario, rig);
        }
        let metadata = with_files(h, &models, &scenario);
        let writer =
            RunWriter::create(&self.path, columns, h.pair_names.to_vec(), &metadata, policy)?;
        models.write(&writer)?;
        h.kept.iter().try_for_each(|(path, bytes)| writer.keep_file(path, bytes))?;
        writer.scenario_toml(&scenario)?;
        self.writer = Some(writer);
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), SinkError> {
        self.keep(|w| w.event(event))
    }

    fn tick(&mut self, t: &TickView<'_>) -> Result<(), SinkError> {
        self.keep(|w| w.tick(t.tick, t.time, t.row, t.contacts))
    }

    fn finish(&mut self, summary: &mut Summary) -> Result<(), SinkError> {
        let Some(writer) = self.writer.take() else { return Ok(()) };
        match writer.finish(summary) {
            Ok(recording) => {
                summary.recording = Some(recording);
                Ok(())
            }
            Err(e) => {
                summary.degrade(&e.to_string());
                Err(e.into())
            }
        }
    }
}

/// The metadata with the digest of every file that is kept with the run, so that another one shows.
fn with_files(h: &Header<'_>, models: &ModelCopies, scenario: &str) -> BTreeMap<String, String> {
    let kept = h.kept.iter().filter(|(path, _)| path.to_str().is_some());
    let kept = kept.map(|(path, bytes)| (slashes(path), Digest::of_bytes(bytes)));
    let scenario = (files::SCENARIO.to_owned(), Digest::of_bytes(scenario.as_bytes()));
    let all = models.digests().chain(kept).chain([scenario]);
    let mut metadata = h.metadata.clone();
    metadata.extend(all.map(|(path, digest)| (format!("{KEPT_KEY}{path}"), digest.to_string())));
    metadata
}

/// The scenario with its rig named.
fn with_rig(scenario: &str, rig: &Path) -> String {
    let Ok(mut text) = scenario.parse::<toml_edit::DocumentMut>() else {
        return scenario.to_owned();
    };
    let table = text.entry("loop").or_insert(toml_edit::table());
    // With `/` between names, as TOML files have it on every system.
    table["rig"] = toml_edit::value(rig.to_string_lossy().replace('\\', "/"));
    text.to_string()
}
