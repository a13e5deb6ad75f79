//! A run that died or was damaged, made whole as far as it goes. Nothing that can be read is lost: whatever
//! is replaced stays beside.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, BufWriter};
use std::path::{Path, PathBuf};

use docktwin_core::{SimTime, Tick};

use crate::flaw::{Cut, Flaw, Hole};
use crate::keys::RECOVERED_KEY;
use crate::log::McapLog;
use crate::paths::part_of;
use crate::reader::write_table;
use crate::table_check::{TableState, inspect};
use crate::writer::{CHUNK_TICKS, sync_dir};
use crate::{Event, RecordError, RunReader, files};

/// What [`recover`] found and did.
#[derive(Clone, Debug, PartialEq)]
pub struct Recovered {
    /// Ticks of the recording.
    pub ticks: u64,
    /// The last of them.
    pub last: Option<(Tick, SimTime)>,
    /// What was first found to be wrong; `None` for a whole recording.
    pub cut: Option<Cut>,
    /// Places of the log that cannot be read, or whose rows are not those recorded.
    pub holes: Vec<Hole>,
    /// Ticks beside such places that were taken although their digest is lost.
    pub unverified: u64,
    /// Events of the recording.
    pub events: u64,
    /// Whether `run.mcap` was written anew.
    pub log_rewritten: bool,
    /// Whether `events.jsonl` was written anew.
    pub events_rewritten: bool,
    /// Whether `telemetry.parquet` was written anew.
    pub table_rewritten: bool,
    /// The files as they were found, under their new names.
    pub kept: Vec<PathBuf>,
    /// Whether `summary.json` or a file of the run is not that of the run, or no longer all of it.
    pub foreign: bool,
    /// What else was found, and what was left as it is, a sentence each.
    pub notes: Vec<String>,
}

impl Recovered {
    /// Whether anything was written.
    #[must_use]
    pub const fn changed(&self) -> bool {
        self.log_rewritten || self.events_rewritten || self.table_rewritten
    }

    /// Whether what is there now is what was recorded, as far as it goes: nothing is missing between others,
    /// nothing was edited, and the summary and the models are those of the run.
    #[must_use]
    pub fn as_recorded(&self) -> bool {
        self.holes.is_empty()
            && !self.foreign
            && self.cut.as_ref().is_none_or(|c| matches!(c.flaw, Flaw::Ends | Flaw::Damaged))
    }
}

/// Makes a run directory whole after its process or its disk died: `run.mcap` is written anew, with index
/// and end mark, from all of its chunks that can be read and fit their digests, behind damage too; events
/// are gathered from the log and `events.jsonl`, `telemetry.parquet` is made from the log. What is
/// replaced stays beside as `run.mcap.cut`, `events.jsonl.cut`, `telemetry.parquet.cut`, and nothing is
/// replaced by something shorter. A whole recording is left alone.
///
/// # Errors
/// No recording there, or a file that cannot be read or written; the original is then untouched.
pub fn recover(dir: impl AsRef<Path>) -> Result<Recovered, RecordError> {
    let dir = dir.as_ref();
    let mut r = RunReader::open(dir)?.over_holes();
    let (mut ticks, mut last) = (0, None);
    while let Some(t) = r.next_tick()? {
        ticks += 1;
        last = Some((t.tick, t.time));
    }
    let (cut, holes) = (r.cut().cloned(), r.holes().to_vec());
    let mut notes = r.changed_files();
    notes.extend(r.summary_problem());
    let mut out = Recovered {
        ticks,
        last,
        log_rewritten: cut
            .as_ref()
            .is_some_and(|c| !matches!(c.flaw, Flaw::Foreign | Flaw::Recovered))
            || !holes.is_empty(),
        cut,
        unverified: r.unverified(),
        events: 0,
        events_rewritten: false,
        table_rewritten: false,
        kept: Vec::new(),
        foreign: !notes.is_empty(),
        notes,
        holes,
    };
    let gathered = all_events(dir, r.logged_events(), !out.holes.is_empty())?;
    out.events = gathered.events.len() as u64;
    if out.log_rewritten {
        rewrite_log(dir, &mut r, &gathered.events, &why(&out))?;
        out.kept.push(replace_keeping(dir, files::LOG)?);
    }
    mend_events(dir, &gathered, &mut out)?;
    mend_table(dir, &mut out)?;
    // Room for a summary that never came.
    let _ = fs::remove_file(part_of(dir, files::SUMMARY));
    sync_dir(dir)?;
    Ok(out)
}

/// Why the log was written anew, as it says of itself from then on.
fn why(found: &Recovered) -> String {
    let Some(cut) = &found.cut else { return String::new() };
    if found.holes.is_empty() {
        return cut.to_string();
    }
    let mut holes: Vec<String> = found.holes.iter().map(ToString::to_string).collect();
    const NAMED: usize = 20;
    if holes.len() > NAMED {
        let more = format!("{} more", holes.len() - NAMED);
        holes.truncate(NAMED);
        holes.push(more);
    }
    let last = found.last.map_or("no tick was recovered".to_owned(), |(tick, time)| {
        format!("recovered up to tick {} ({:.3} s)", tick.0, time.seconds())
    });
    format!("the log had holes: {}; {last}", holes.join("; "))
}

/// Events of log and `events.jsonl`.
struct Gathered {
    events: Vec<Event>,
    /// Whole lines of `events.jsonl`, those that are no events included; `None` where it is missing.
    lines: Option<usize>,
    /// Whether `events.jsonl` is just these events.
    same: bool,
}

fn mend_events(dir: &Path, g: &Gathered, out: &mut Recovered) -> Result<(), RecordError> {
    if g.same {
        return Ok(());
    }
    if let Some(lines) = g.lines.filter(|n| *n > g.events.len()) {
        out.notes.push(format!(
            "events.jsonl has {lines} lines, of which {} are events that can be read: it is left as \
             it is",
            g.events.len()
        ));
        return Ok(());
    }
    let path = part_of(dir, files::EVENTS);
    let text: String = g.events.iter().map(Event::to_line).collect();
    fs::write(&path, text).map_err(|e| RecordError::io("write the events", &path, &e))?;
    put_in_place(dir, files::EVENTS, out)?;
    out.events_rewritten = true;
    Ok(())
}

/// Makes the table anew from the log where the log has more, or other, rows.
fn mend_table(dir: &Path, out: &mut Recovered) -> Result<(), RecordError> {
    let mut r = RunReader::open(dir)?;
    let path = dir.join(files::TABLE);
    let state = inspect(&path, &mut r)?;
    let why = match state {
        TableState::Same => return Ok(()),
        TableState::Missing => None,
        TableState::Unreadable { rows: Some(rows) } if rows > out.ticks => {
            out.notes.push(format!(
                "telemetry.parquet has {rows} rows, of which some cannot be read, the log {}: it is \
                 left as it is",
                out.ticks
            ));
            return Ok(());
        }
        TableState::Longer { rows } => {
            out.notes.push(format!(
                "telemetry.parquet has {rows} rows, the log {}: it is left as it is",
                out.ticks
            ));
            return Ok(());
        }
        TableState::Unreadable { .. } => Some("could not be read".to_owned()),
        TableState::Shorter { rows } => Some(format!("had {rows} rows of {}", out.ticks)),
        TableState::Differs { tick } => Some(format!("differed from the log in tick {tick}")),
    };
    out.notes.extend(why.map(|why| format!("telemetry.parquet {why}")));
    write_table(dir)?;
    put_in_place(dir, files::TABLE, out)?;
    out.table_rewritten = true;
    Ok(())
}

/// Events of both files, in the order of their ticks. The recorder writes each into both in one order,
/// into `events.jsonl` first: where the log has no holes, only lines behind its last event can be more.
fn all_events(dir: &Path, logged: &[Event], holes: bool) -> Result<Gathered, RecordError> {
    let path = dir.join(files::EVENTS);
    let io_error = |e: io::Error| RecordError::io("read the events", &path, &e);
    let mut lines: Vec<(Vec<u8>, Option<Event>)> = Vec::new();
    let mut torn = false;
    let found = match File::open(&path) {
        Ok(file) => {
            let mut file = BufReader::new(file);
            let mut line = Vec::new();
            while file.read_until(b'\n', &mut line).map_err(io_error)? > 0 {
                if line.ends_with(b"\n") {
                    let event = serde_json::from_slice(&line).ok();
                    lines.push((core::mem::take(&mut line), event));
                } else {
                    torn = true;
                }
            }
            true
        }
        Err(e) if e.kind() == io::ErrorKind::NotFound => false,
        Err(e) => return Err(io_error(e)),
    };
    let mut left: BTreeMap<String, usize> = BTreeMap::new();
    for e in logged {
        *left.entry(e.to_line()).or_default() += 1;
    }
    let mut extras: Vec<Event> = Vec::new();
    for (_, event) in &lines {
        let Some(e) = event else { continue };
        match left.get_mut(&e.to_line()) {
            Some(n) if *n > 0 => {
                *n -= 1;
                if !holes {
                    // Before an event of the log there is nothing that the log lacks.
                    extras.clear();
                }
            }
            _ => extras.push(e.clone()),
        }
    }
    let mut events = logged.to_vec();
    events.append(&mut extras);
    if holes {
        events.sort_by_key(|e| e.tick);
    }
    let text: String = events.iter().map(Event::to_line).collect();
    let same = found
        && !torn
        && text.as_bytes() == lines.iter().map(|l| &l.0[..]).collect::<Vec<_>>().concat();
    Ok(Gathered { events, lines: found.then_some(lines.len()), same })
}

fn rewrite_log(
    dir: &Path,
    r: &mut RunReader,
    events: &[Event],
    why: &str,
) -> Result<(), RecordError> {
    let half = part_of(dir, files::LOG);
    let error = |e: io::Error| RecordError::io("write the log", &half, &e);
    let file = File::create(&half).map_err(error)?;
    let sync = file.try_clone().map_err(error)?;
    let mut metadata = r.metadata().clone();
    let before = metadata.get(RECOVERED_KEY).map(|w| format!("{w}; then ")).unwrap_or_default();
    metadata.insert(RECOVERED_KEY.into(), before + why);
    let columns = r.columns().to_vec();
    let mut log = McapLog::create(BufWriter::new(file), &columns, r.pair_names(), &metadata)
        .map_err(error)?;
    let mut events = events.iter().peekable();
    r.rewind()?;
    while let Some(t) = r.next_tick()? {
        while let Some(e) = events.next_if(|e| e.tick <= t.tick.0) {
            log.event(e);
        }
        log.tick(t.tick, t.time, &t.row, &t.contacts, t.recorded_unix_ns);
        if log.open_ticks() == CHUNK_TICKS {
            log.flush().map_err(error)?;
        }
    }
    // What events.jsonl has from after the last whole chunk.
    events.for_each(|e| log.event(e));
    log.finish().map_err(error)?;
    sync.sync_data().map_err(error)
}

/// Puts a new file into place, the old one, where there is one, beside it.
fn put_in_place(dir: &Path, name: &str, out: &mut Recovered) -> Result<(), RecordError> {
    if dir.join(name).exists() {
        out.kept.push(replace_keeping(dir, name)?);
        return Ok(());
    }
    let to = dir.join(name);
    fs::rename(part_of(dir, name), &to)
        .map_err(|e| RecordError::io("write a file of the recording", &to, &e))
}

/// Puts the new file into place and keeps the old one as `NAME.cut`, or `NAME.cut-2` …
fn replace_keeping(dir: &Path, name: &str) -> Result<PathBuf, RecordError> {
    let path = dir.join(name);
    let kept = (1..)
        .map(|n| if n == 1 { format!("{name}.cut") } else { format!("{name}.cut-{n}") })
        .map(|n| dir.join(n))
        .find(|p| !p.exists())
        .unwrap_or_else(|| dir.join(format!("{name}.cut")));
    let error = |e: io::Error| RecordError::io("replace a file of the recording", &path, &e);
    // A second name first: there is never a moment without a file of this name. Where the file
    // system has no second names, the moment is as short as it can be.
    if fs::hard_link(&path, &kept).is_err() {
        fs::rename(&path, &kept).map_err(error)?;
    }
    fs::rename(part_of(dir, name), &path).map_err(error)?;
    Ok(kept)
}
