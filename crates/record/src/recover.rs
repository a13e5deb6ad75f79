//! Recovery of the recording of a run that was killed.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, BufWriter};
use std::path::{Path, PathBuf};

use parquet::file::reader::{FileReader as _, SerializedFileReader};

use docktwin_core::{SimTime, Tick};

use crate::log::{McapLog, RECOVERED_KEY};
use crate::reader::Cut;
use crate::writer::{CHUNK_TICKS, part_of, sync_dir};
use crate::{Event, RecordError, RunReader, files, rebuild_parquet};

/// What [`recover`] found and did.
#[derive(Clone, Debug, PartialEq)]
pub struct Recovered {
    /// Ticks of the recording.
    pub ticks: u64,
    /// The last of them.
    pub last: Option<(Tick, SimTime)>,
    /// Where the log stopped; `None` when it was whole and was left alone.
    pub cut: Option<Cut>,
    /// Events of the recording.
    pub events: u64,
    /// Whether `events.jsonl` was written anew.
    pub events_rewritten: bool,
    /// Whether `telemetry.parquet` was written anew.
    pub table_rewritten: bool,
    /// The files as they were found, under their new names.
    pub kept: Vec<PathBuf>,
}

impl Recovered {
    /// Whether anything was written.
    #[must_use]
    pub const fn changed(&self) -> bool {
        self.cut.is_some() || self.events_rewritten || self.table_rewritten
    }
}

/// Makes a run directory whole after its process or its disk died: `run.mcap` is written anew with
/// index and end mark up to its last whole chunk, events are gathered from the log and
/// `events.jsonl`, `telemetry.parquet` is made from the log. A log or events file that is replaced
/// stays beside it as `run.mcap.cut` and `events.jsonl.cut`. A whole recording is left alone.
///
/// # Errors
/// No recording there, or a file that cannot be read or written; the original is then untouched.
pub fn recover(dir: impl AsRef<Path>) -> Result<Recovered, RecordError> {
    let dir = dir.as_ref();
    let mut r = RunReader::open(dir)?;
    let (mut ticks, mut last) = (0, None);
    while let Some(t) = r.next_tick()? {
        ticks += 1;
        last = Some((t.tick, t.time));
    }
    let cut = r.cut().cloned();
    let (events, events_rewritten) = all_events(dir, r.logged_events())?;
    let mut out = Recovered {
        ticks,
        last,
        cut,
        events: events.len() as u64,
        events_rewritten,
        table_rewritten: false,
        kept: Vec::new(),
    };
    if let Some(cut) = &out.cut {
        rewrite_log(dir, &mut r, &events, &cut.to_string())?;
        out.kept.push(replace_keeping(dir, files::LOG)?);
    }
    if events_rewritten {
        let path = part_of(dir, files::EVENTS);
        let text: String = events.iter().map(Event::to_line).collect();
        fs::write(&path, text).map_err(|e| RecordError::io("write the events", &path, &e))?;
        if dir.join(files::EVENTS).exists() {
            out.kept.push(replace_keeping(dir, files::EVENTS)?);
        } else {
            let to = dir.join(files::EVENTS);
            fs::rename(&path, &to).map_err(|e| RecordError::io("write the events", &to, &e))?;
        }
    }
    if table_rows(&dir.join(files::TABLE)) != Some(ticks) {
        rebuild_parquet(dir)?;
        out.table_rewritten = true;
    }
    // Room for a summary that never came.
    let _ = fs::remove_file(part_of(dir, files::SUMMARY));
    sync_dir(dir)?;
    Ok(out)
}

/// Rows of a table; `None` when it cannot be read.
fn table_rows(path: &Path) -> Option<u64> {
    let reader = SerializedFileReader::new(File::open(path).ok()?).ok()?;
    u64::try_from(reader.metadata().file_metadata().num_rows()).ok()
}

/// Events of both files, in the order of their ticks, and whether `events.jsonl` lacks some or holds
/// a line that is none.
fn all_events(dir: &Path, logged: &[Event]) -> Result<(Vec<Event>, bool), RecordError> {
    let path = dir.join(files::EVENTS);
    let io_error = |e: io::Error| RecordError::io("read the events", &path, &e);
    let (mut events, mut mend) = (Vec::new(), false);
    match File::open(&path) {
        Ok(file) => {
            let mut file = BufReader::new(file);
            let mut line = Vec::new();
            while file.read_until(b'\n', &mut line).map_err(io_error)? > 0 {
                match serde_json::from_slice::<Event>(&line) {
                    Ok(e) if line.ends_with(b"\n") => events.push(e),
                    _ => mend = true,
                }
                line.clear();
            }
        }
        Err(e) if e.kind() == io::ErrorKind::NotFound => mend = true,
        Err(e) => return Err(io_error(e)),
    }
    // Each line stands for one event of the log.
    let mut lines: BTreeMap<String, usize> = BTreeMap::new();
    for e in &events {
        *lines.entry(e.to_line()).or_default() += 1;
    }
    for e in logged {
        match lines.get_mut(&e.to_line()) {
            Some(n) if *n > 0 => *n -= 1,
            _ => {
                events.push(e.clone());
                mend = true;
            }
        }
    }
    events.sort_by_key(|e| e.tick);
    Ok((events, mend))
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
    metadata.insert(RECOVERED_KEY.into(), why.into());
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
