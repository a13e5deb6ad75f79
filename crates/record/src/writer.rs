//! The recorder: a bounded ring between the run and the threads that encode and write.
//!
//! ```text
//! tick() ──slots──▶ encoder ──▶ run.mcap, events.jsonl
//!        ◀──free───    └──blocks──▶ table ──▶ telemetry.parquet
//!                                   sync  ──▶ fsync of the log and the events
//! ```

use core::fmt;
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{
    Receiver, RecvTimeoutError, SyncSender, TryRecvError, TrySendError, sync_channel,
};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use docktwin_core::{SimTime, Tick};

use crate::check::own_digest;
use crate::column::{self, Cell, Column, ContactRow};
use crate::keys::STARTED_KEY;
use crate::log::{LogDigests, McapLog};
use crate::paths::part_of;
use crate::summary::{RecordingSummary, Summary};
use crate::table::{Block, GROUP_ROWS, Table};
use crate::{Event, RecordError, files};

/// What happens to a tick when the recorder is slower than the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Policy {
    /// The run waits and nothing is lost: for a rehearsal.
    Wait,
    /// The tick is lost and counted: for a loop that must not wait.
    DropNewest,
}

impl fmt::Display for Policy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Wait => "wait",
            Self::DropNewest => "drop_newest",
        })
    }
}

impl Policy {
    /// Ticks the ring holds. Waiting, ring and open chunk together stay below 100 ticks, which is
    /// what a crash may cost. Dropping, the ring bridges a disk that stalls for about a second.
    const fn slots(self) -> usize {
        match self {
            Self::Wait => 40,
            Self::DropNewest => 1024,
        }
    }
}

/// A chunk ends after this many ticks …
pub(crate) const CHUNK_TICKS: usize = 50;
/// … or when its oldest content is this old: a quarter of what a crash may cost, because on a busy
/// machine the encoder wakes late.
const CHUNK_WALL: Duration = Duration::from_millis(25);
/// The encoder looks at the ring this often by itself …
const POLL: Duration = Duration::from_millis(5);
/// … and is woken after so many ticks, well before the ring is full.
const WAKE_TICKS: usize = 16;
/// Pause between two calls of fsync; with the call itself less than a second.
const SYNC_PERIOD: Duration = Duration::from_millis(500);
const EVENT_SLOTS: usize = 256;
/// Room kept for the summary, so that it can still be written when the disk is full.
const SUMMARY_ROOM: usize = 16 << 10;
/// Contacts of a tick that fit a slot without allocating; more contacts make the slot grow once.
const SLOT_CONTACTS: usize = 64;

/// One tick in the ring; slots go round and are never freed.
struct Slot {
    tick: Tick,
    time: SimTime,
    row: Vec<Cell>,
    contacts: Vec<ContactRow>,
    wall: Option<u64>,
}

impl Slot {
    fn new(columns: usize) -> Self {
        Self {
            tick: Tick::default(),
            time: SimTime::ZERO,
            row: Vec::with_capacity(columns),
            contacts: Vec::with_capacity(SLOT_CONTACTS),
            wall: None,
        }
    }
}

/// Where the bytes go.
struct Sinks {
    log: Box<dyn Write + Send>,
    events: Box<dyn Write + Send>,
    table: Box<dyn Write + Send>,
    /// Handles of the files that a crash of the machine must not cost.
    sync: Vec<(PathBuf, File)>,
}

/// The first failure of any thread.
type Fault = Arc<OnceLock<RecordError>>;

/// Records a run into a directory. Dropped without [`RunWriter::finish`] it still closes its files,
/// but leaves no `summary.json`.
pub struct RunWriter {
    dir: PathBuf,
    columns: usize,
    policy: Policy,
    free: Receiver<Box<Slot>>,
    filled: Option<SyncSender<Box<Slot>>>,
    events: Option<SyncSender<Event>>,
    threads: Vec<JoinHandle<()>>,
    encoder: thread::Thread,
    stop_sync: Option<SyncSender<()>>,
    fault: Fault,
    last_tick: Option<u64>,
    since_wake: usize,
    /// Wall clock at the start, ns since 1970, and the instant that goes with it.
    wall: Option<(u64, Instant)>,
    /// Ticks that the operating system has.
    written: Arc<AtomicU64>,
    /// Digests of the whole log, once it has its end mark.
    digests: Arc<OnceLock<LogDigests>>,
    dropped_ticks: u64,
    dropped_events: u64,
}

impl fmt::Debug for RunWriter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RunWriter").field("dir", &self.dir).finish_non_exhaustive()
    }
}

impl RunWriter {
    /// Begins a recording in `dir`, which is created when absent.
    ///
    /// `metadata` is kept with the recording: tool version, scenario, seed, digests. With
    /// `started_unix_ns` in it (wall clock now, ns since 1970) every message of the log carries the
    /// wall clock of its tick as MCAP's publish time.
    ///
    /// # Errors
    /// Unusable columns (all problems at once), a recording already there, a directory or file that
    /// cannot be written.
    pub fn create(
        dir: impl AsRef<Path>,
        columns: Vec<Column>,
        pair_names: Vec<String>,
        metadata: &BTreeMap<String, String>,
        policy: Policy,
    ) -> Result<Self, RecordError> {
        let dir = dir.as_ref();
        check_columns(&columns)?;
        fs::create_dir_all(dir)
            .map_err(|e| RecordError::io("create the run directory", dir, &e))?;

        let log_path = dir.join(files::LOG);
        let log = File::create_new(&log_path).map_err(|e| match e.kind() {
            io::ErrorKind::AlreadyExists => RecordError::Exists { path: log_path.clone() },
            _ => RecordError::io("create the log", &log_path, &e),
        })?;
        let create = |name| {
            let path = dir.join(name);
            let file = File::create(&path);
            file.map_err(|e| RecordError::io("create a file of the recording", &path, &e))
                .map(|f| (path, f))
        };
        let (events_path, events) = create(files::EVENTS)?;
        let (_, table) = create(files::TABLE)?;
        let clone = |path: &Path, f: &File| {
            f.try_clone().map_err(|e| RecordError::io("open the file a second time", path, &e))
        };
        let sync = vec![
            (log_path.clone(), clone(&log_path, &log)?),
            (events_path.clone(), clone(&events_path, &events)?),
        ];
        keep_room(dir)?;
        sync_dir(dir)?;
        let sinks = Sinks {
            log: Box::new(log),
            events: Box::new(events),
            table: Box::new(BufWriter::with_capacity(1 << 18, table)),
            sync,
        };
        Self::start(dir, &columns, &pair_names, metadata, policy, sinks)
    }

    fn start(
        dir: &Path,
        columns: &[Column],
        pair_names: &[String],
        metadata: &BTreeMap<String, String>,
        policy: Policy,
        sinks: Sinks,
    ) -> Result<Self, RecordError> {
        let (log_path, table_path) = (dir.join(files::LOG), dir.join(files::TABLE));
        let log = McapLog::create(sinks.log, columns, pair_names, metadata)
            .map_err(|e| RecordError::io("begin the log", &log_path, &e))?;
        let table = Table::create(sinks.table, columns, metadata)
            .map_err(|e| RecordError::parquet("begin the table", &table_path, e))?;

        let fault = Fault::default();
        let written = Arc::new(AtomicU64::new(0));
        let digests = Arc::new(OnceLock::new());
        let started = metadata.get(STARTED_KEY).and_then(|t| t.parse().ok());
        let slots = policy.slots();
        let (free_tx, free) = sync_channel(slots);
        let (filled, filled_rx) = sync_channel(slots);
        for _ in 0..slots {
            let _ = free_tx.try_send(Box::new(Slot::new(columns.len())));
        }
        let (events, events_rx) = sync_channel(EVENT_SLOTS);
        // One block is filled, one is written, one is ready.
        let (blocks, blocks_rx) = sync_channel(2);
        let (spare_tx, spare) = sync_channel(2);
        for _ in 0..2 {
            let _ = spare_tx.try_send(Block::new(columns.len()));
        }
        let (stop_sync, stop_sync_rx) = sync_channel(1);

        let encoder = Encoder {
            log,
            log_path,
            events_out: sinks.events,
            events_path: dir.join(files::EVENTS),
            filled: filled_rx,
            free: free_tx,
            events: events_rx,
            block: Block::new(columns.len()),
            blocks,
            spare,
            dirty_since: None,
            encoded: 0,
            written: Arc::clone(&written),
            digests: Arc::clone(&digests),
        };
        let spawn = |name: &str, f: Box<dyn FnOnce() -> Result<(), RecordError> + Send>| {
            let fault = Arc::clone(&fault);
            thread::Builder::new()
                .name(name.into())
                .spawn(move || {
                    if let Err(e) = f() {
                        // Only the first failure is kept: the others follow from it.
                        let _ = fault.set(e);
                    }
                })
                .map_err(|e| RecordError::io("start a recording thread", dir, &e))
        };
        let table = spawn("record-table", {
            let fault = Arc::clone(&fault);
            Box::new(move || write_table(table, &table_path, &blocks_rx, &spare_tx, &fault))
        })?;
        let sync = spawn("record-sync", Box::new(move || keep_synced(&sinks.sync, &stop_sync_rx)))?;
        let encoding = spawn("record", {
            let fault = Arc::clone(&fault);
            Box::new(move || encoder.run(&fault))
        })?;
        Ok(Self {
            dir: dir.into(),
            columns: columns.len(),
            policy,
            free,
            filled: Some(filled),
            events: Some(events),
            encoder: encoding.thread().clone(),
            threads: vec![encoding, table, sync],
            stop_sync: Some(stop_sync),
            fault,
            last_tick: None,
            since_wake: 0,
            wall: started.map(|t| (t, Instant::now())),
            written,
            digests,
            dropped_ticks: 0,
            dropped_events: 0,
        })
    }

    /// Records a tick; `row` has one cell per column, in the order of [`RunWriter::create`].
    ///
    /// Copies into a slot that is used again and again: it allocates only when a tick has more
    /// contacts than any before it in that slot (64 are reserved).
    ///
    /// # Errors
    /// Another number of cells than columns, a tick that does not increase, or the failure of a
    /// recording thread (a full disk), which every later call repeats.
    pub fn tick(
        &mut self,
        tick: Tick,
        time: SimTime,
        row: &[Cell],
        contacts: &[ContactRow],
    ) -> Result<(), RecordError> {
        if row.len() != self.columns {
            let (found, expected) = (row.len(), self.columns);
            return Err(RecordError::RowLength { tick: tick.0, found, expected });
        }
        if let Some(last) = self.last_tick.filter(|last| tick.0 <= *last) {
            return Err(RecordError::TickOrder { tick: tick.0, last });
        }
        self.check_fault()?;
        self.last_tick = Some(tick.0);

        let mut slot = match (self.free.try_recv(), self.policy) {
            (Ok(slot), _) => slot,
            (Err(TryRecvError::Empty), Policy::Wait) => {
                self.encoder.unpark();
                self.free.recv().map_err(|_| self.lost_thread())?
            }
            (Err(TryRecvError::Empty), Policy::DropNewest) => {
                self.encoder.unpark();
                self.dropped_ticks += 1;
                return Ok(());
            }
            (Err(TryRecvError::Disconnected), _) => return Err(self.lost_thread()),
        };
        slot.tick = tick;
        slot.time = time;
        slot.row.clear();
        slot.row.extend_from_slice(row);
        slot.contacts.clear();
        slot.contacts.extend_from_slice(contacts);
        slot.wall = self.wall.map(|(start, since)| {
            start.saturating_add(u64::try_from(since.elapsed().as_nanos()).unwrap_or(u64::MAX))
        });
        // Never waits: the ring has room for every slot there is.
        let sent = self.filled.as_ref().is_some_and(|f| f.send(slot).is_ok());
        if !sent {
            return Err(self.lost_thread());
        }
        self.since_wake += 1;
        if self.since_wake >= WAKE_TICKS {
            self.since_wake = 0;
            self.encoder.unpark();
        }
        Ok(())
    }

    /// Records an event, in `run.mcap` and as a line of `events.jsonl`. Events are rare: this
    /// allocates.
    ///
    /// # Errors
    /// The failure of a recording thread, which every later call repeats.
    pub fn event(&mut self, e: &Event) -> Result<(), RecordError> {
        self.check_fault()?;
        let Some(events) = &self.events else { return Err(self.lost_thread()) };
        match (events.try_send(e.clone()), self.policy) {
            (Ok(()), _) => {}
            (Err(TrySendError::Full(e)), Policy::Wait) => {
                self.encoder.unpark();
                events.send(e).map_err(|_| self.lost_thread())?;
            }
            (Err(TrySendError::Full(_)), Policy::DropNewest) => self.dropped_events += 1,
            (Err(TrySendError::Disconnected(_)), _) => return Err(self.lost_thread()),
        }
        self.encoder.unpark();
        Ok(())
    }

    /// Writes `scenario.toml`: the scenario as it runs, overrides applied.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn scenario_toml(&self, text: &str) -> Result<(), RecordError> {
        replace_file(&self.dir, files::SCENARIO, text)
    }

    /// Writes a file that belongs to the run, such as a model it was made from, at a path relative to
    /// the run directory.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn keep_file(&self, relative: &Path, bytes: &[u8]) -> Result<(), RecordError> {
        let path = self.dir.join(relative);
        let write = || {
            fs::create_dir_all(path.parent().unwrap_or(&self.dir))?;
            let mut f = File::create(&path)?;
            f.write_all(bytes)?;
            f.sync_data()
        };
        write().map_err(|e| RecordError::io("keep a file of the run", &path, &e))
    }

    /// Ticks lost so far because the ring was full; always 0 with [`Policy::Wait`].
    #[must_use]
    pub const fn dropped_ticks(&self) -> u64 {
        self.dropped_ticks
    }

    /// The run directory.
    #[must_use]
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Closes every file, syncs them, and writes `summary.json` with its `recording` filled in. Where
    /// the recording failed on the way, the summary is written too and says so
    /// ([`Summary::degrade`]); room for it was kept from the start.
    ///
    /// # Errors
    /// Anything that could not be written, the summary included.
    pub fn finish(mut self, summary: &Summary) -> Result<RecordingSummary, RecordError> {
        self.close();
        let size = |name| fs::metadata(self.dir.join(name)).map_or(0, |m| m.len());
        let digests = self.digests.get();
        let recording = RecordingSummary {
            policy: self.policy.to_string(),
            ticks: self.written.load(Ordering::Acquire),
            dropped_ticks: self.dropped_ticks,
            dropped_events: self.dropped_events,
            log_bytes: size(files::LOG),
            table_bytes: size(files::TABLE),
            events_digest: digests.map(|d| d.events.to_string()),
            error: self.fault.get().map(ToString::to_string),
        };
        let mut summary = Summary {
            recording: Some(recording.clone()),
            record_digest: digests.map(|d| d.rows.to_string()),
            summary_digest: None,
            ..summary.clone()
        };
        if let Some(why) = &recording.error {
            summary.degrade(why);
        }
        let path = self.dir.join(files::SUMMARY);
        let failed = |e: serde_json::Error| RecordError::io("write the summary", &path, &e.into());
        let plain = serde_json::to_value(&summary).map_err(failed)?;
        summary.summary_digest = Some(own_digest(&plain).to_string());
        let text = serde_json::to_string_pretty(&summary).map_err(failed)?;
        // The result is worth trying for even where the recording failed.
        let written = replace_file(&self.dir, files::SUMMARY, &(text + "\n"));
        self.check_fault()?;
        written.map(|()| recording)
    }

    fn check_fault(&self) -> Result<(), RecordError> {
        self.fault.get().map_or(Ok(()), |e| Err(e.clone()))
    }

    fn lost_thread(&self) -> RecordError {
        self.fault.get().cloned().unwrap_or(RecordError::Defect)
    }

    /// Lets the threads write what they have and waits for them.
    fn close(&mut self) {
        self.filled = None;
        self.events = None;
        self.encoder.unpark();
        let mut ended_well = true;
        // The encoder and the table first; then the last fsync, which covers all they wrote.
        for t in self.threads.drain(..) {
            if t.thread().name() == Some("record-sync") {
                self.stop_sync = None;
            }
            ended_well &= t.join().is_ok();
        }
        if !ended_well {
            let _ = self.fault.set(RecordError::Defect);
        }
    }
}

impl Drop for RunWriter {
    fn drop(&mut self) {
        self.close();
        // Room that no summary took.
        let _ = fs::remove_file(part_of(&self.dir, files::SUMMARY));
    }
}

fn check_columns(columns: &[Column]) -> Result<(), RecordError> {
    let problems = column::problems(columns);
    if problems.is_empty() { Ok(()) } else { Err(RecordError::Columns(problems)) }
}

struct Encoder {
    log: McapLog<Box<dyn Write + Send>>,
    log_path: PathBuf,
    events_out: Box<dyn Write + Send>,
    events_path: PathBuf,
    filled: Receiver<Box<Slot>>,
    free: SyncSender<Box<Slot>>,
    events: Receiver<Event>,
    block: Block,
    blocks: SyncSender<Block>,
    spare: Receiver<Block>,
    /// When the open chunk got its first content.
    dirty_since: Option<Instant>,
    /// Ticks handed to the log, and how many of them it has written.
    encoded: u64,
    written: Arc<AtomicU64>,
    digests: Arc<OnceLock<LogDigests>>,
}

impl Encoder {
    fn run(mut self, fault: &Fault) -> Result<(), RecordError> {
        let ended = self.work();
        // Said before the ring closes, so that who finds it closed also finds the reason.
        if let Err(e) = &ended {
            let _ = fault.set(e.clone());
        }
        ended?;
        // A last partial row group, then the end of the log.
        let _ = self.blocks.send(self.block);
        let digests =
            self.log.finish().map_err(|e| RecordError::io("end the log", &self.log_path, &e))?;
        // Set once, here.
        let _ = self.digests.set(digests);
        Ok(())
    }

    fn work(&mut self) -> Result<(), RecordError> {
        loop {
            let mut worked = false;
            let events_open = loop {
                match self.events.try_recv() {
                    Ok(e) => {
                        self.event(&e)?;
                        worked = true;
                    }
                    Err(TryRecvError::Empty) => break true,
                    Err(TryRecvError::Disconnected) => break false,
                }
            };
            let ticks_open = match self.filled.try_recv() {
                Ok(slot) => {
                    self.tick(&slot)?;
                    let _ = self.free.try_send(slot);
                    worked = true;
                    true
                }
                Err(TryRecvError::Empty) => true,
                Err(TryRecvError::Disconnected) => false,
            };
            let old = self.dirty_since.is_some_and(|t| t.elapsed() >= CHUNK_WALL);
            if old || self.log.open_ticks() >= CHUNK_TICKS {
                self.flush()?;
            }
            if !events_open && !ticks_open {
                return self.flush();
            }
            if !worked {
                thread::park_timeout(POLL);
            }
        }
    }

    fn tick(&mut self, slot: &Slot) -> Result<(), RecordError> {
        self.dirty_since.get_or_insert_with(Instant::now);
        self.log.tick(slot.tick, slot.time, &slot.row, &slot.contacts, slot.wall);
        self.encoded += 1;
        self.block.push(slot.tick, slot.time, &slot.row);
        if self.block.rows() < GROUP_ROWS {
            return Ok(());
        }
        let next = match self.spare.try_recv() {
            Ok(block) => block,
            Err(_) => {
                // The table is behind: what is in hand goes to the log before the wait.
                self.flush()?;
                self.spare.recv().map_err(|_| RecordError::Defect)?
            }
        };
        let full = core::mem::replace(&mut self.block, next);
        self.blocks.send(full).map_err(|_| RecordError::Defect)
    }

    fn event(&mut self, e: &Event) -> Result<(), RecordError> {
        self.dirty_since.get_or_insert_with(Instant::now);
        self.events_out
            .write_all(e.to_line().as_bytes())
            .and_then(|()| self.events_out.flush())
            .map_err(|e| RecordError::io("write the events", &self.events_path, &e))?;
        self.log.event(e);
        Ok(())
    }

    fn flush(&mut self) -> Result<(), RecordError> {
        self.dirty_since = None;
        self.log.flush().map_err(|e| RecordError::io("write the log", &self.log_path, &e))?;
        self.written.store(self.encoded, Ordering::Release);
        Ok(())
    }
}

fn write_table(
    mut table: Table<Box<dyn Write + Send>>,
    path: &Path,
    blocks: &Receiver<Block>,
    spare: &SyncSender<Block>,
    fault: &Fault,
) -> Result<(), RecordError> {
    let mut work = || {
        while let Ok(mut block) = blocks.recv() {
            table.write(&block)?;
            block.clear();
            let _ = spare.try_send(block);
        }
        Ok(())
    };
    let ended = work().map_err(|e| RecordError::parquet("write the table", path, e));
    // Said before the channel closes, as in the encoder.
    if let Err(e) = &ended {
        let _ = fault.set(e.clone());
    }
    ended?;
    table.finish().map_err(|e| RecordError::parquet("end the table", path, e))
}

/// Syncs until told to end, and once more then.
fn keep_synced(files: &[(PathBuf, File)], stop: &Receiver<()>) -> Result<(), RecordError> {
    loop {
        let ended = !matches!(stop.recv_timeout(SYNC_PERIOD), Err(RecvTimeoutError::Timeout));
        for (path, file) in files {
            file.sync_data()
                .map_err(|e| RecordError::io("sync the recording to disk", path, &e))?;
        }
        if ended {
            return Ok(());
        }
    }
}

/// Writes a whole file under another name and moves it into place, so that no reader and no crash
/// meets half of it.
fn replace_file(dir: &Path, name: &str, text: &str) -> Result<(), RecordError> {
    let (path, half) = (dir.join(name), part_of(dir, name));
    let write = || {
        // What is there is written over, not cut off: it may be room kept on a full disk.
        let mut f = OpenOptions::new().write(true).create(true).truncate(false).open(&half)?;
        f.write_all(text.as_bytes())?;
        f.set_len(text.len() as u64)?;
        f.sync_data()?;
        fs::rename(&half, &path)
    };
    write().map_err(|e| RecordError::io("write a file of the recording", &path, &e))?;
    sync_dir(dir)
}

/// Keeps room on the disk for the summary.
fn keep_room(dir: &Path) -> Result<(), RecordError> {
    let path = part_of(dir, files::SUMMARY);
    fs::write(&path, vec![b' '; SUMMARY_ROOM])
        .map_err(|e| RecordError::io("keep room for the summary", &path, &e))
}

/// Makes new names in the directory last.
#[cfg(unix)]
pub(crate) fn sync_dir(dir: &Path) -> Result<(), RecordError> {
    File::open(dir)
        .and_then(|d| d.sync_all())
        .map_err(|e| RecordError::io("sync the run directory", dir, &e))
}

#[cfg(not(unix))]
pub(crate) fn sync_dir(_: &Path) -> Result<(), RecordError> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicBool, Ordering};

    /// A disk with so many bytes free.
    struct Full(usize);

    impl Write for Full {
        fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
            if self.0 == 0 {
                return Err(io::ErrorKind::StorageFull.into());
            }
            let n = buf.len().min(self.0);
            self.0 -= n;
            Ok(n)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// A disk that stalls until it is let go.
    struct Stalled(Arc<AtomicBool>, Arc<Mutex<Vec<u8>>>);

    impl Write for Stalled {
        fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
            while self.0.load(Ordering::Acquire) {
                thread::sleep(Duration::from_millis(1));
            }
            self.1.lock().unwrap().extend_from_slice(buf);
            Ok(buf.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn columns() -> Vec<Column> {
        (0..20).map(|i| Column::f64("/noise", format!("x{i}_m"))).collect()
    }

    /// Bits that do not shrink.
    fn row(tick: u64) -> Vec<Cell> {
        (0..20u64)
            .map(|i| Cell::from_bits((tick * 20 + i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15)))
            .collect()
    }

    fn sinks(log: impl Write + Send + 'static, table: impl Write + Send + 'static) -> Sinks {
        Sinks {
            log: Box::new(log),
            events: Box::new(io::sink()),
            table: Box::new(table),
            sync: Vec::new(),
        }
    }

    fn start(dir: &Path, policy: Policy, sinks: Sinks) -> RunWriter {
        RunWriter::start(dir, &columns(), &[], &BTreeMap::new(), policy, sinks).unwrap()
    }

    fn run_into_full_disk(mut w: RunWriter) -> String {
        let failed = (0..50_000_000u64).find_map(|i| {
            if w.dropped_ticks() > 0 {
                // A run that never waits leaves the recorder no time otherwise.
                thread::yield_now();
            }
            w.tick(Tick(i), SimTime::from_nanos(i * 1_000_000), &row(i), &[]).err()
        });
        let e = failed.expect("the disk is full and nobody said so");
        assert!(matches!(&e, RecordError::Io { kind: io::ErrorKind::StorageFull, .. }), "{e:?}");
        // It is said again at every call, and the ring never blocks a run that goes on.
        let again = w.tick(Tick(u64::MAX), SimTime::ZERO, &row(0), &[]).unwrap_err();
        assert_eq!(again.to_string(), e.to_string());
        e.to_string()
    }

    #[test]
    fn invariant_a_full_disk_is_one_clear_error_at_the_next_call() {
        let dir = tempfile::tempdir().unwrap();
        for policy in [Policy::Wait, Policy::DropNewest] {
            let text =
                run_into_full_disk(start(dir.path(), policy, sinks(Full(200_000), io::sink())));
            assert!(text.starts_with("could not write the log: "), "{text}");
            assert!(text.contains("free some space") && text.ends_with("run.mcap"), "{text}");

            let text =
                run_into_full_disk(start(dir.path(), policy, sinks(io::sink(), Full(10_000))));
            assert!(text.starts_with("could not write the table: "), "{text}");
            assert!(text.ends_with("telemetry.parquet"), "{text}");
        }
    }

    #[test]
    fn invariant_a_disk_that_stalls_never_holds_up_a_live_run() {
        let dir = tempfile::tempdir().unwrap();
        let (stall, bytes) = (Arc::new(AtomicBool::new(false)), Arc::default());
        let log = Stalled(Arc::clone(&stall), Arc::clone(&bytes));
        let mut w = start(dir.path(), Policy::DropNewest, sinks(log, io::sink()));
        stall.store(true, Ordering::Release);
        // No clock: if the run waited for the disk, this loop would never end.
        let n = 5_000;
        for i in 0..n {
            w.tick(Tick(i), SimTime::from_nanos(i), &row(i), &[]).unwrap();
        }
        let dropped = w.dropped_ticks();
        assert!(dropped >= n - 1024 - CHUNK_TICKS as u64 && dropped < n, "{dropped} dropped");
        stall.store(false, Ordering::Release);
        drop(w);

        // What was not dropped is there, and whole.
        std::fs::write(dir.path().join(files::LOG), &*bytes.lock().unwrap()).unwrap();
        let mut r = crate::RunReader::open(dir.path()).unwrap();
        let ticks: Vec<_> = r.ticks().map(|t| t.unwrap()).collect();
        assert_eq!(ticks.len() as u64, n - dropped);
        assert!(ticks.iter().all(|t| t.row == row(t.tick.0)));
        assert!(r.cut().is_none());
    }

    #[test]
    fn invariant_a_run_that_waits_loses_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let mut w =
            RunWriter::create(dir.path(), columns(), vec![], &BTreeMap::new(), Policy::Wait)
                .unwrap();
        let n = 2 * GROUP_ROWS as u64 + 10;
        for i in 0..n {
            w.tick(Tick(i), SimTime::from_nanos(i), &row(i), &[]).unwrap();
        }
        assert_eq!(w.dropped_ticks(), 0);
        drop(w);
        let mut r = crate::RunReader::open(dir.path()).unwrap();
        let ticks: Vec<_> = r.ticks().map(|t| t.unwrap().tick.0).collect();
        assert_eq!(ticks, (0..n).collect::<Vec<_>>());
    }

    #[test]
    fn invariant_wrong_rows_and_ticks_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let mut w = start(dir.path(), Policy::Wait, sinks(io::sink(), io::sink()));
        w.tick(Tick(5), SimTime::ZERO, &row(5), &[]).unwrap();
        let e = w.tick(Tick(6), SimTime::ZERO, &row(6)[1..], &[]).unwrap_err();
        assert!(matches!(e, RecordError::RowLength { tick: 6, found: 19, expected: 20 }));
        let e = w.tick(Tick(5), SimTime::ZERO, &row(5), &[]).unwrap_err();
        assert!(matches!(e, RecordError::TickOrder { tick: 5, last: 5 }));
    }
}
