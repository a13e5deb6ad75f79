//! The viewer's file as a sink of a run.

use std::path::PathBuf;

use docktwin_core::{SimTime, Tick};
use docktwin_record::{Event, Summary};
use docktwin_run::{
    Sink, SinkError,
    sink::{Header, TickView},
};
use docktwin_view::{SceneWriter, ViewError};

use crate::playback::{Playback, pair_names, scene_model};

/// `run.rrd`, for the viewer.
pub struct ViewerFile {
    path: PathBuf,
    open: Option<(SceneWriter, Playback)>,
    tick_nanos: u64,
}

impl ViewerFile {
    /// At a path; it is made when the run begins.
    #[must_use]
    pub const fn new(path: PathBuf) -> Self {
        Self { path, open: None, tick_nanos: 0 }
    }

    fn keep(
        &mut self,
        work: impl FnOnce(&mut SceneWriter, &mut Playback) -> Result<(), ViewError>,
    ) -> Result<(), SinkError> {
        let Some((writer, playback)) = &mut self.open else { return Ok(()) };
        work(writer, playback).map_err(|e| {
            self.open = None;
            e.into()
        })
    }
}

impl Sink for ViewerFile {
    fn begin(&mut self, h: &Header<'_>) -> Result<(), SinkError> {
        let (model, names) = (scene_model(h.scenario, h.columns), pair_names(h.scenario));
        let writer = SceneWriter::create(&self.path, &model, &names)?;
        self.open = Some((writer, Playback::new(h.scenario, h.columns)?));
        self.tick_nanos = h.scenario.run.tick_nanos;
        Ok(())
    }

    fn event(&mut self, e: &Event) -> Result<(), SinkError> {
        let time = SimTime::of_tick(Tick(e.tick), self.tick_nanos);
        self.keep(|view, _| view.event(time, &e.kind, &e.text))
    }

    fn tick(&mut self, t: &TickView<'_>) -> Result<(), SinkError> {
        self.keep(|view, playback| playback.show(view, t.time, t.row, t.contacts, t.due))
    }

    fn finish(&mut self, _summary: &mut Summary) -> Result<(), SinkError> {
        self.open.take().map_or(Ok(()), |(view, _)| Ok(view.finish()?))
    }
}
