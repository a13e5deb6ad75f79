//! A run in a viewer while it happens: a thread of its own shows copies of what is recorded.
//!
//! The sender never waits and, once started, never asks for memory: it writes into a ring of places
//! made beforehand. When all are taken, the tick is not shown, and counted. Nothing of this touches
//! the recording.

use std::{
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering},
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use docktwin_core::SimTime;
use docktwin_record::{Cell, Column, ContactRow};
use docktwin_scenario::Scenario;
use docktwin_view::{SceneWriter, ViewError};

use crate::{
    playback::{Playback, PlaybackError, pair_names, scene_model},
    signals::MAX_CONTACTS,
};

/// Ticks on their way to the viewer at most: two seconds of a loop of 1 kHz, about 8 MB.
const TICKS: usize = 2048;
/// Events on their way.
const EVENTS: usize = 256;
/// Between two sendings to the viewer, of the wall clock.
const PUSH_PERIOD: Duration = Duration::from_millis(50);
/// How long the viewer's thread sleeps when there is nothing to show.
const IDLE: Duration = Duration::from_millis(5);

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

/// Places between one sender and one receiver. A place belongs to the receiver from the moment `head`
/// passes it until `tail` does, to the sender otherwise: so no lock is ever contended, and the sender
/// takes a fixed number of steps whatever the receiver does. A channel would not do: a receiver that
/// is put aside in the middle of it lets the sender spin.
struct Ring {
    slots: Box<[Mutex<Slot>]>,
    /// Ticks written.
    head: AtomicU64,
    /// Ticks read.
    tail: AtomicU64,
    closed: AtomicBool,
}

impl Ring {
    fn new(places: usize, columns: usize) -> Self {
        let slot = || {
            // Written once, so that the memory is there.
            Mutex::new(Slot {
                row: vec![Cell::from_bits(1); columns],
                contacts: vec![ContactRow::default(); MAX_CONTACTS],
                ..Slot::default()
            })
        };
        Self {
            slots: (0..places).map(|_| slot()).collect(),
            head: AtomicU64::new(0),
            tail: AtomicU64::new(0),
            closed: AtomicBool::new(false),
        }
    }

    fn slot(&self, number: u64) -> &Mutex<Slot> {
        #[expect(clippy::cast_possible_truncation, reason = "below the number of places")]
        let place = (number % self.slots.len() as u64) as usize;
        &self.slots[place]
    }

    /// Writes the next place; false when there is none.
    fn write(&self, fill: impl FnOnce(&mut Slot)) -> bool {
        let head = self.head.load(Ordering::Relaxed);
        if head - self.tail.load(Ordering::Acquire) >= self.slots.len() as u64 {
            return false;
        }
        let Ok(mut slot) = self.slot(head).try_lock() else { return false };
        fill(&mut slot);
        drop(slot);
        self.head.store(head + 1, Ordering::Release);
        true
    }

    /// Reads the next place; `None` when there is nothing.
    fn read<T>(&self, look: impl FnOnce(&Slot) -> T) -> Option<T> {
        let tail = self.tail.load(Ordering::Relaxed);
        if tail == self.head.load(Ordering::Acquire) {
            return None;
        }
        let slot = self.slot(tail).try_lock().ok()?;
        let out = look(&slot);
        drop(slot);
        self.tail.store(tail + 1, Ordering::Release);
        Some(out)
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
    ring: Arc<Ring>,
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
        let view = SceneWriter::live(url, &scene_model(scenario), &pair_names())
            .map_err(PlaybackError::from)?;
        let ring = Arc::new(Ring::new(TICKS, columns.len()));
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
        let written = self.ring.write(|slot| {
            slot.time = time;
            slot.row.clear();
            slot.row.extend_from_slice(row);
            slot.contacts.clear();
            slot.contacts.extend_from_slice(contacts);
            slot.due = due;
        });
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
        self.ring.closed.store(true, Ordering::Release);
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

/// The viewer's thread.
struct Shower {
    playback: Playback,
    view: SceneWriter,
    ring: Arc<Ring>,
    told: Receiver<LiveEvent>,
}

impl Shower {
    fn run(mut self) -> Result<(), ViewError> {
        let mut pushed = Instant::now();
        loop {
            // Before the last look at the ring, or a tick written in between would be lost.
            let closed = self.ring.closed.load(Ordering::Acquire);
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

    fn write(ring: &Ring, n: u64) -> bool {
        ring.write(|s| {
            s.time = SimTime::from_nanos(n);
            s.row.clear();
            s.row.extend_from_slice(&[Cell::from_bits(n), Cell::from_bits(!n)]);
        })
    }

    fn read(ring: &Ring) -> Option<u64> {
        ring.read(|s| {
            assert_eq!(s.row, [s.time.nanos(), !s.time.nanos()].map(Cell::from_bits), "torn");
            s.time.nanos()
        })
    }

    #[test]
    fn oracle_a_full_ring_refuses_and_keeps_what_it_has() {
        let ring = Ring::new(3, 2);
        assert_eq!(read(&ring), None);
        assert_eq!([1, 2, 3, 4].map(|n| write(&ring, n)), [true, true, true, false]);
        assert_eq!(read(&ring), Some(1));
        assert!(write(&ring, 5));
        assert_eq!([2, 3, 5].map(Some), core::array::from_fn(|_| read(&ring)));
        assert_eq!(read(&ring), None);
    }

    #[test]
    fn invariant_what_arrives_is_whole_and_in_order_and_the_rest_is_counted() {
        let ring = Arc::new(Ring::new(8, 2));
        let reader = {
            let ring = Arc::clone(&ring);
            std::thread::spawn(move || {
                let (mut n, mut last) = (0_u64, 0);
                loop {
                    let closed = ring.closed.load(Ordering::Acquire);
                    match read(&ring) {
                        Some(t) => {
                            assert!(t > last, "{t} after {last}");
                            (n, last) = (n + 1, t);
                        }
                        None if closed => return n,
                        None => std::thread::yield_now(),
                    }
                }
            })
        };
        let sent: u64 = (1..=100_000).map(|n| u64::from(write(&ring, n))).sum();
        ring.closed.store(true, Ordering::Release);
        assert_eq!(reader.join().expect("no panic"), sent);
        assert!(sent >= 8);
    }
}
