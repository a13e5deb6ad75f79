//! A run in a viewer while it happens: a thread of its own shows copies of what is recorded.
//!
//! The sender never waits and, once started, never asks for memory: it writes into a ring of places
//! made beforehand. When all are taken, the tick is not shown, and counted. Nothing of this touches
//! the recording.

use std::{
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use docktwin_core::{SimTime, Tick};
use docktwin_record::{Cell, Column, ContactRow, Event, Summary};
use docktwin_run::{
    Sink, SinkError,
    ring::Ring,
    signals::MAX_CONTACTS,
    sink::{Header, TickView},
};
use docktwin_scenario::Scenario;
use docktwin_view::{SceneWriter, ViewError};

use crate::{
    error::PlaybackError,
    playback::{Playback, pair_names, scene_model},
};

/// Ticks on their way to the viewer at most: two seconds of a loop of 1 kHz, about 8 MB.
const TICKS: usize = 2048;
/// Events on their way.
const EVENTS: usize = 256;
/// Between two sendings to the viewer, of the wall clock.
const PUSH_PERIOD: Duration = Duration::from_millis(50);
/// How long the viewer's thread sleeps when there is nothing to show.
const IDLE: Duration = Duration::from_millis(5);
/// How long a viewer may take over what is left when the run has ended.
const PATIENCE: Duration = Duration::from_secs(10);

/// Why a run cannot be shown live.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// No viewer, or it does not take the scene.
    #[error(transparent)]
    Playback(#[from] PlaybackError),
    /// The thread cannot be started.
    #[error("cannot start the viewer's thread: {0}; close other programs, or run without --live")]
    Thread(#[source] std::io::Error),
}

/// What became of a live stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LiveReport {
    /// Ticks handed to the viewer's thread.
    pub sent: u64,
    /// Ticks that found no free place.
    pub dropped: u64,
    /// Events that found no room.
    pub events_dropped: u64,
    /// False when the viewer went away, or took nothing any more.
    pub complete: bool,
}

/// A tick on its way.
#[derive(Default)]
struct Slot {
    time: SimTime,
    row: Vec<Cell>,
    contacts: Vec<ContactRow>,
    due: bool,
}

impl Slot {
    fn put(&mut self, time: SimTime, row: &[Cell], contacts: &[ContactRow], due: bool) {
        (self.time, self.due) = (time, due);
        self.row.clear();
        self.row.extend_from_slice(row);
        self.contacts.clear();
        self.contacts.extend_from_slice(contacts);
    }

    /// With room for a row of so many columns, written once so that the memory is there.
    fn new(columns: usize) -> Self {
        Self {
            row: vec![Cell::from_bits(1); columns],
            contacts: vec![ContactRow::default(); MAX_CONTACTS],
            ..Self::default()
        }
    }
}

/// An event on its way.
struct LiveEvent {
    time: SimTime,
    kind: String,
    text: String,
}

/// Sends events to the viewer, from any thread but that of a loop which keeps time: texts are copied.
#[derive(Clone)]
pub struct LiveEvents {
    events: SyncSender<LiveEvent>,
    dropped: Arc<AtomicU64>,
}

impl LiveEvents {
    /// Hands an event over; never waits for the viewer.
    pub fn event(&self, time: SimTime, kind: &str, text: &str) {
        let event = LiveEvent { time, kind: kind.to_owned(), text: text.to_owned() };
        if self.events.try_send(event).is_err() {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// The sending end of a live stream.
pub struct Live {
    ring: Arc<Ring<Slot>>,
    events: LiveEvents,
    thread: JoinHandle<Result<(), ViewError>>,
    sent: u64,
    dropped: u64,
}

impl Live {
    /// Connects to the viewer at `url` (see [`docktwin_view::LIVE_URL`]) and starts its thread, for
    /// rows of these columns. Waits up to two seconds for the viewer. Call it before the loop takes
    /// its core, which the thread would share.
    ///
    /// # Errors
    /// No viewer answers, the columns lack what a scene is made of, or no thread can be started.
    pub fn start(url: &str, scenario: &Scenario, columns: &[Column]) -> Result<Self, LiveError> {
        let playback = Playback::new(scenario, columns)?;
        let model = scene_model(scenario, columns);
        let view =
            SceneWriter::live(url, &model, &pair_names(scenario)).map_err(PlaybackError::from)?;
        let ring = Arc::new(Ring::new(TICKS, || Slot::new(columns.len())));
        let (events, told) = sync_channel(EVENTS);
        let shower = Shower { playback, view, ring: Arc::clone(&ring), told };
        let thread = std::thread::Builder::new()
            .name("live viewer".to_owned())
            .spawn(move || shower.run())
            .map_err(LiveError::Thread)?;
        let events = LiveEvents { events, dropped: Arc::default() };
        Ok(Self { ring, events, thread, sent: 0, dropped: 0 })
    }

    /// Hands one tick over, as [`Playback::show`] would take it. Neither waits nor allocates, as long
    /// as the row has the columns that were announced.
    pub fn tick(&mut self, time: SimTime, row: &[Cell], contacts: &[ContactRow], due: bool) {
        let written = self.ring.write(|slot| slot.put(time, row, contacts, due));
        self.sent += u64::from(written);
        self.dropped += u64::from(!written);
    }

    /// What takes events.
    #[must_use]
    pub const fn events(&self) -> &LiveEvents {
        &self.events
    }

    /// Ends the stream: waits up to `patience` until the viewer has everything, and says what became
    /// of it. A viewer that does not take it is left alone.
    #[must_use]
    pub fn finish(self, patience: Duration) -> LiveReport {
        self.ring.close();
        let begin = Instant::now();
        while !self.thread.is_finished() && begin.elapsed() < patience {
            std::thread::sleep(IDLE);
        }
        LiveReport {
            sent: self.sent,
            dropped: self.dropped,
            events_dropped: self.events.dropped.load(Ordering::Relaxed),
            complete: self.thread.is_finished() && matches!(self.thread.join(), Ok(Ok(()))),
        }
    }
}

/// A live viewer as a sink of a run.
pub struct LiveViewer {
    live: Option<Live>,
    report: Option<LiveReport>,
    tick_nanos: u64,
}

impl LiveViewer {
    /// Finds the viewer at `url`; see [`Live::start`].
    ///
    /// # Errors
    /// Those of [`Live::start`].
    pub fn start(url: &str, scenario: &Scenario, columns: &[Column]) -> Result<Self, LiveError> {
        let live = Live::start(url, scenario, columns)?;
        Ok(Self { live: Some(live), report: None, tick_nanos: 0 })
    }

    /// What became of the stream, once the run has ended.
    #[must_use]
    pub const fn report(&self) -> Option<LiveReport> {
        self.report
    }
}

impl Sink for LiveViewer {
    fn begin(&mut self, h: &Header<'_>) -> Result<(), SinkError> {
        self.tick_nanos = h.scenario.run.tick_nanos;
        Ok(())
    }

    fn event(&mut self, e: &Event) -> Result<(), SinkError> {
        if let Some(live) = &self.live {
            let time = SimTime::of_tick(Tick(e.tick), self.tick_nanos);
            live.events().event(time, &e.kind, &e.text);
        }
        Ok(())
    }

    fn tick(&mut self, t: &TickView<'_>) -> Result<(), SinkError> {
        if let Some(live) = &mut self.live {
            live.tick(t.time, t.row, t.contacts, t.due);
        }
        Ok(())
    }

    fn finish(&mut self, _summary: &mut Summary) -> Result<(), SinkError> {
        self.report = self.live.take().map(|live| live.finish(PATIENCE));
        Ok(())
    }
}

/// The viewer's thread.
struct Shower {
    playback: Playback,
    view: SceneWriter,
    ring: Arc<Ring<Slot>>,
    told: Receiver<LiveEvent>,
}

impl Shower {
    fn run(mut self) -> Result<(), ViewError> {
        let mut pushed = Instant::now();
        loop {
            // Before the last look at the ring, or a tick written in between would be lost.
            let closed = self.ring.is_closed()
                // The sender was dropped.
                || Arc::strong_count(&self.ring) == 1;
            while let Ok(e) = self.told.try_recv() {
                self.view.event(e.time, &e.kind, &e.text)?;
            }
            let (playback, view) = (&mut self.playback, &mut self.view);
            let shown = self
                .ring
                .read(|t| playback.show(view, t.time, &t.row, &t.contacts, t.due))
                .transpose()?;
            if shown.is_none() && closed {
                return self.view.finish();
            }
            if pushed.elapsed() >= PUSH_PERIOD {
                self.view.push()?;
                pushed = Instant::now();
            }
            if shown.is_none() {
                std::thread::sleep(IDLE);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_places_are_used_again_and_never_grow() {
        let ring = Ring::new(2, || Slot::new(40));
        let (row, contacts) = ([Cell::default(); 40], [ContactRow::default(); MAX_CONTACTS]);
        let mut places = Vec::new();
        for _ in 0..10 {
            assert!(ring.write(|s| s.put(SimTime::ZERO, &row, &contacts, true)));
            let place = |s: &Slot| {
                assert_eq!((s.row.len(), s.contacts.len()), (40, MAX_CONTACTS));
                (s.row.as_ptr(), s.row.capacity(), s.contacts.as_ptr(), s.contacts.capacity())
            };
            places.push(ring.read(place).expect("just written"));
        }
        assert!(places.chunks(2).all(|p| p == &places[..2]), "{places:?}");
    }
}
