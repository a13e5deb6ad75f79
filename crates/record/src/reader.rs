use core::fmt;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, BufWriter, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use docktwin_core::{SimTime, Tick};
use mcap::records::{Record, op};

use crate::assembly::{Assembly, Reading};
use crate::chain::RowChain;
use crate::check::{self, KEPT_KEY, MAX_TEXT_BYTES};
use crate::column::{self, Cell, Column, ColumnKind};
use crate::flaw::{Cut, Flaw, Hole, Stop};
use crate::keys::{
    DIGEST_KEY, METADATA, METADATA_COLUMNS, METADATA_PAIRS, RECOVERED_KEY, SCHEMA_KEY,
};
use crate::log::McapLog;
use crate::paths::{open_file, part_of};
use crate::table::{Block, GROUP_ROWS, Table};
use crate::tick::TickRecord;
use crate::{Event, RECORD_SCHEMA, RecordError, Summary, bounded, files, scan};

/// No chunk of ours comes near this; a larger one is taken for damage, not for memory to be asked
/// for.
const MAX_CHUNK_BYTES: usize = 1 << 28;
/// The same for the metadata before the first chunk; ours have some ten thousand bytes.
const MAX_HEAD_BYTES: u64 = 1 << 22;
/// Columns that are taken for real.
const MAX_COLUMNS: usize = 10_000;
const RECORD_HEADER: usize = 9;

/// Reads a run directory.
pub struct RunReader {
    dir: PathBuf,
    path: PathBuf,
    file: BufReader<File>,
    /// Offset of the next record.
    at: u64,
    columns: Vec<Column>,
    pair_names: Vec<String>,
    metadata: BTreeMap<String, String>,
    assembly: Assembly,
    /// Where records other than the head begin.
    chunks_at: u64,
    /// End of the last chunk that is what its checksum says: behind it a damaged length may have led past
    /// whole chunks before it was noticed.
    sound: u64,
    /// Header and body of the record last read.
    record: Vec<u8>,
    last: Option<(Tick, SimTime)>,
    /// Ticks given.
    given: u64,
    ended: bool,
    /// Whether the end of the data was reached.
    data_ended: bool,
    /// Whether all rows up to there were read and fit their digests.
    rows_whole: bool,
    cut: Option<Cut>,
    holes: Vec<Hole>,
    /// Holes behind which a tick was given.
    closed_holes: usize,
    /// Misfits of the assembly that are holes already.
    misfits: usize,
    /// Whether channels that were not declared were looked for in the index.
    looked: bool,
}

impl fmt::Debug for RunReader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RunReader").field("dir", &self.dir).finish_non_exhaustive()
    }
}

impl RunReader {
    /// Opens the recording in `dir` and reads its columns and metadata.
    ///
    /// # Errors
    /// No recording there, a newer schema, or a file that died before its columns were written.
    pub fn open(dir: impl AsRef<Path>) -> Result<Self, RecordError> {
        let dir = dir.as_ref().to_path_buf();
        let path = dir.join(files::LOG);
        if dir.is_file() {
            let why = "this is a file; give the run directory, which holds run.mcap".into();
            return Err(RecordError::NotARecording { why, path: dir });
        }
        let file = open_file(&path, "open the log")?;
        let mut r = Self {
            dir,
            path,
            file: BufReader::with_capacity(1 << 16, file),
            at: 0,
            columns: Vec::new(),
            pair_names: Vec::new(),
            metadata: BTreeMap::new(),
            assembly: Assembly::new(&[], RowChain::begin(&[], &[], &BTreeMap::new()), false),
            chunks_at: 0,
            sound: 0,
            record: Vec::new(),
            last: None,
            given: 0,
            ended: false,
            data_ended: false,
            rows_whole: false,
            cut: None,
            holes: Vec::new(),
            closed_holes: 0,
            misfits: 0,
            looked: false,
        };
        r.read_head()?;
        Ok(r)
    }

    /// The log, `run.mcap` of the run directory.
    #[must_use]
    pub fn log_path(&self) -> &Path {
        &self.path
    }

    /// The columns, in the order in which they were declared.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Index of a column by its name.
    #[must_use]
    pub fn column_index(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|c| c.name == name)
    }

    /// Names of the contact pairs.
    #[must_use]
    pub fn pair_names(&self) -> &[String] {
        &self.pair_names
    }

    /// What [`crate::RunWriter::create`] was given, and `docktwin_record_schema`.
    #[must_use]
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.metadata
    }

    /// Goes on behind damage and behind rows that do not fit their digest, which are left out:
    /// [`RunReader::holes`] says where. Otherwise reading stops there.
    #[must_use]
    pub fn over_holes(mut self) -> Self {
        self.assembly.reading = Reading::GoesOn;
        self
    }

    /// Gives rows that do not fit their digest as they are, for who compares each of them anyway; what is
    /// wrong is told afterwards by [`RunReader::cut`].
    #[must_use]
    pub fn unchecked(mut self) -> Self {
        self.assembly.reading = Reading::TakesAll;
        self
    }

    /// The next tick, or `None` after the last.
    ///
    /// # Errors
    /// The file cannot be read. A cut, damaged or edited file is no error: see [`RunReader::cut`].
    pub fn next_tick(&mut self) -> Result<Option<TickRecord>, RecordError> {
        while self.assembly.ready.is_empty() && !self.ended {
            match self.read_step() {
                Ok(()) => {}
                Err(Stop::Failed(e)) => {
                    return Err(RecordError::io("read the log", &self.path, &e));
                }
                Err(Stop::Cut(flaw, why)) => self.broken(flaw, &why)?,
            }
            self.gather_misfits();
        }
        let next = self.assembly.ready.pop_front();
        if let Some(t) = &next {
            self.last = Some((t.tick, t.time));
            self.given += 1;
            // Holes are noted while ticks before them still wait to be given.
            while let Some(h) = self.holes.get_mut(self.closed_holes) {
                if h.before.is_none() && h.after.is_some_and(|a| t.tick.0 <= a) {
                    break;
                }
                h.before.get_or_insert(t.tick.0);
                self.closed_holes += 1;
            }
        }
        Ok(next)
    }

    /// What the assembly left out, or noted, is a hole too.
    fn gather_misfits(&mut self) {
        for m in self.assembly.misfits.iter().skip(self.misfits).cloned().collect::<Vec<_>>() {
            self.misfits += 1;
            self.note_cut(Flaw::Edited, &m.why);
            self.holes.push(Hole { after: m.after, before: m.before, why: m.why });
        }
    }

    /// The first that is wrong is what is told.
    fn note_cut(&mut self, flaw: Flaw, why: &str) {
        if self.cut.is_none() {
            let file_bytes = self.file.get_ref().metadata().map_or(self.at, |m| m.len());
            let last = self.assembly.last.or(self.last);
            self.cut = Some(Cut { at_byte: self.at, file_bytes, last, why: why.into(), flaw });
        }
    }

    /// Ends reading at a damaged place, or goes on behind it.
    fn broken(&mut self, flaw: Flaw, why: &str) -> Result<(), RecordError> {
        let failed = |path: &Path, e: io::Error| RecordError::io("read the log", path, &e);
        let next = scan::next_chunk(self.file.get_ref(), self.sound, MAX_CHUNK_BYTES)
            .map_err(|e| failed(&self.path, e))?;
        let ends = next.is_none() && !self.has_end_mark().map_err(|e| failed(&self.path, e))?;
        let flaw = match flaw {
            // Behind the data only the index is damaged.
            _ if self.data_ended && self.rows_whole => Flaw::Ends,
            Flaw::Ends | Flaw::Damaged if ends => Flaw::Ends,
            Flaw::Ends | Flaw::Damaged => Flaw::Damaged,
            other => other,
        };
        self.assembly.hole(flaw);
        self.gather_misfits();
        self.note_cut(flaw, why);
        let after = self.assembly.last.map(|l| l.0.0);
        match next.filter(|_| self.assembly.reading == Reading::GoesOn) {
            Some(next) => {
                self.holes.push(Hole { after, before: None, why: why.into() });
                if !self.assembly.knows_channels() {
                    self.find_channels();
                }
                self.seek(next)?;
            }
            None => {
                if flaw != Flaw::Ends {
                    self.holes.push(Hole { after, before: None, why: why.into() });
                }
                self.ended = true;
            }
        }
        Ok(())
    }

    /// Whether the last bytes are those of a finished log. The place in the file is lost.
    fn has_end_mark(&mut self) -> io::Result<bool> {
        let mut magic = [0; mcap::MAGIC.len()];
        let file = self.file.get_mut();
        if file.metadata()?.len() < magic.len() as u64 {
            return Ok(false);
        }
        file.seek(SeekFrom::End(-(mcap::MAGIC.len() as i64)))?;
        file.read_exact(&mut magic)?;
        Ok(magic == *mcap::MAGIC)
    }

    /// The channels when those of the first chunk are lost: as the recorder numbers them, or as the index
    /// at the end of the file has them. The place in the file is lost.
    fn find_channels(&mut self) {
        self.assembly.own_channels();
        // A file without an index has only the recorder's own numbers.
        for (id, topic) in self.indexed_channels().unwrap_or_default() {
            self.assembly.channel(id, &topic);
        }
    }

    /// Looks for channels that were not declared, because the first chunk is not there, or not all of it; once.
    /// False where there is nothing to look for any more. The place in the file is lost.
    fn look_for_channels(&mut self) -> bool {
        if !self.assembly.knows_channels() {
            self.find_channels();
        } else if core::mem::replace(&mut self.looked, true) {
            return false;
        } else {
            // Other writers number them otherwise: only the index tells, and only what is not known.
            for (id, topic) in self.indexed_channels().unwrap_or_default() {
                self.assembly.channel_if_new(id, &topic);
            }
        }
        true
    }

    fn indexed_channels(&self) -> Option<Vec<(u16, String)>> {
        const FOOTER: u64 = 9 + 20 + 8;
        let mut file = self.file.get_ref().try_clone().ok()?;
        let end = file.metadata().ok()?.len();
        let footer_at = end.checked_sub(FOOTER)?;
        file.seek(SeekFrom::Start(footer_at + 9)).ok()?;
        let mut start = [0; 8];
        file.read_exact(&mut start).ok()?;
        let start = u64::from_le_bytes(start);
        let n = footer_at.checked_sub(start).filter(|n| *n <= MAX_CHUNK_BYTES as u64)?;
        let mut index = Vec::new();
        file.seek(SeekFrom::Start(start)).ok()?;
        file.take(n).read_to_end(&mut index).ok()?;
        let (mut rest, mut out) = (&index[..], Vec::new());
        while let Some((op, body, after)) = bounded::first_record(rest) {
            if op == op::CHANNEL
                && let Ok(Record::Channel(c)) = bounded::parse(op, body)
            {
                out.push((c.id, c.topic));
            }
            rest = after;
        }
        Some(out)
    }

    /// The last tick of what was read so far, and its time.
    #[must_use]
    pub const fn last_tick(&self) -> Option<(Tick, SimTime)> {
        self.last
    }

    /// The remaining ticks.
    pub fn ticks(&mut self) -> Ticks<'_> {
        Ticks(self)
    }

    /// Goes back to the first tick.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn rewind(&mut self) -> Result<(), RecordError> {
        self.seek(self.chunks_at)?;
        self.sound = self.chunks_at;
        self.assembly.rewind();
        self.last = None;
        self.given = 0;
        self.ended = false;
        self.data_ended = false;
        self.rows_whole = false;
        self.cut = None;
        self.holes.clear();
        self.closed_holes = 0;
        self.misfits = 0;
        Ok(())
    }

    /// The events that stand in the log, as far as its ticks were read; those of `events.jsonl` reach
    /// further where a run died.
    #[must_use]
    pub fn logged_events(&self) -> &[Event] {
        &self.assembly.logged
    }

    /// Once all ticks are read: the places that were passed over, in the order of the file.
    #[must_use]
    pub fn holes(&self) -> &[Hole] {
        &self.holes
    }

    /// Ticks that were given although their digest was lost in a hole beside them.
    #[must_use]
    pub const fn unverified(&self) -> u64 {
        self.assembly.unverified
    }

    /// Files of the run directory that are not those of the run, by the digests that the log has of them,
    /// a sentence each; nothing is known of those of recordings before 0.2.
    #[must_use]
    pub fn changed_files(&self) -> Vec<String> {
        let kept = self.metadata.iter().filter_map(|(k, v)| Some((k.strip_prefix(KEPT_KEY)?, v)));
        kept.filter_map(|(path, digest)| check::file_problem(&self.dir, path, digest)).collect()
    }

    /// Why `summary.json` cannot be that of this log, as far as the log was read.
    ///
    /// It is checked at the end of a whole log by itself: see [`RunReader::cut`].
    #[must_use]
    pub fn summary_problem(&self) -> Option<String> {
        let file = match check::read_summary(&self.dir) {
            Ok(None) => return None,
            Ok(Some(file)) => file,
            Err(e) => return Some(format!("summary.json cannot be used: {e}")),
        };
        if file.damage.is_some() {
            return file.damage;
        }
        let s = &file.summary;
        let differs = |what: &str, here: String, log: &str| {
            format!(
                "summary.json is that of another run: its {what} is {here}, that of the log {log}"
            )
        };
        let of = |key: &str| self.metadata.get(key);
        if let Some(scenario) = of("scenario").filter(|n| **n != s.scenario) {
            return Some(differs("scenario", s.scenario.clone(), scenario));
        }
        if let Some(seed) = of("seed").filter(|n| **n != s.seed.to_string()) {
            return Some(differs("seed", s.seed.to_string(), seed));
        }
        let recorded = s.recording.as_ref();
        if !self.rows_whole || recorded.is_some_and(|r| r.error.is_some()) {
            return None;
        }
        let (rows, events) = self.assembly.digests();
        let rows = rows.to_string();
        match &s.record_digest {
            Some(digest) if *digest != rows => {
                return Some(format!(
                    "summary.json and run.mcap are not of one run, or edited: the digest of the rows \
                     is {digest} in one and {rows} in the other"
                ));
            }
            None if self.assembly.has_digests() => {
                return Some(
                    "summary.json has no `record_digest`, the log has: not of one run".into(),
                );
            }
            _ => {}
        }
        let recorded = recorded?;
        if recorded.ticks != self.given {
            let ticks = format!("number of ticks {}", recorded.ticks);
            return Some(differs("recording", ticks, &self.given.to_string()));
        }
        let events = events.to_string();
        recorded.events_digest.as_ref().filter(|d| **d != events).map(|digest| {
            format!(
                "summary.json and run.mcap are not of one run, or edited: the digest of the events is                  {digest} in one and {events} in the other"
            )
        })
    }

    /// Why this log was written anew by [`crate::recover`], in words; `None` for one that was not.
    #[must_use]
    pub fn recovered(&self) -> Option<&str> {
        self.metadata.get(RECOVERED_KEY).map(String::as_str)
    }

    /// Once all ticks are read: what is wrong with the log (it stops before its end mark, is damaged, was
    /// edited, lies beside the summary of another run), or `None` for a whole one.
    #[must_use]
    pub const fn cut(&self) -> Option<&Cut> {
        self.cut.as_ref()
    }

    /// The events, from `events.jsonl`; a last line without its line feed is left out.
    ///
    /// # Errors
    /// The file cannot be read or a whole line is no event.
    pub fn events(&self) -> Result<Vec<Event>, RecordError> {
        let path = self.dir.join(files::EVENTS);
        let io_error = |e: io::Error| RecordError::io("read the events", &path, &e);
        let mut file = BufReader::new(open_file(&path, "read the events")?);
        let (mut out, mut line) = (Vec::new(), String::new());
        loop {
            line.clear();
            (&mut file).take(MAX_TEXT_BYTES).read_line(&mut line).map_err(io_error)?;
            if !line.ends_with('\n') {
                return Ok(out);
            }
            out.push(serde_json::from_str(&line).map_err(|e| RecordError::NotARecording {
                why: format!("line {} is no event ({e})", out.len() + 1),
                path: path.clone(),
            })?);
        }
    }

    /// The summary, or `None` where the run did not come to its end.
    ///
    /// # Errors
    /// The file cannot be read, is no summary, or is of a newer schema.
    pub fn summary(&self) -> Result<Option<Summary>, RecordError> {
        Ok(check::read_summary(&self.dir)?.map(|f| f.summary))
    }

    /// The scenario as it ran.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn scenario_toml(&self) -> Result<String, RecordError> {
        let path = self.dir.join(files::SCENARIO);
        let mut text = String::new();
        open_file(&path, "read the scenario")?
            .take(MAX_TEXT_BYTES)
            .read_to_string(&mut text)
            .map_err(|e| RecordError::io("read the scenario", &path, &e))?;
        Ok(text)
    }

    /// The end of the data was reached: do log and summary belong together?
    fn end_data(&mut self) -> Result<(), Stop> {
        if core::mem::replace(&mut self.data_ended, true) {
            return Ok(());
        }
        self.assembly.end()?;
        self.gather_misfits();
        if self.cut.is_some() {
            return Ok(());
        }
        self.rows_whole = true;
        // What is ready counts as given.
        let ready = self.assembly.ready.len() as u64;
        self.given += ready;
        let problem = self.summary_problem();
        self.given -= ready;
        let Some(problem) = problem else { return Ok(()) };
        match self.recovered().map(str::to_owned) {
            Some(why) => self.note_cut(
                Flaw::Recovered,
                &format!("the log was recovered and is not all of the run ({why}); {problem}"),
            ),
            None => self.note_cut(Flaw::Foreign, &problem),
        }
        Ok(())
    }

    /// Counts all ticks; `None` where they cannot be read. Reading begins anew behind it.
    pub(crate) fn count_all(&mut self) -> Option<u64> {
        self.rewind().ok()?;
        let mut n = 0;
        while self.next_tick().ok()?.is_some() {
            n += 1;
        }
        self.rewind().ok().map(|()| n)
    }

    fn seek(&mut self, to: u64) -> Result<(), RecordError> {
        self.at = to;
        self.file
            .seek(SeekFrom::Start(to))
            .map(|_| ())
            .map_err(|e| RecordError::io("read the log", &self.path, &e))
    }

    fn not_ours(&self, why: impl Into<String>) -> RecordError {
        RecordError::NotARecording { why: why.into(), path: self.path.clone() }
    }

    /// Reads up to the first chunk.
    fn read_head(&mut self) -> Result<(), RecordError> {
        let mut magic = [0; mcap::MAGIC.len()];
        match self.file.read_exact(&mut magic) {
            Ok(()) if magic == *mcap::MAGIC => self.at = magic.len() as u64,
            Ok(()) => return Err(self.not_ours("it does not begin as an MCAP file")),
            Err(_) => return Err(self.not_ours("it ends within its first bytes")),
        }
        let tables = self.read_tables()?;
        self.seek(self.chunks_at)?;
        self.sound = self.chunks_at;
        self.take_tables(tables)
    }

    /// The tables of the metadata, which another writer may have put behind its chunks.
    fn read_tables(&mut self) -> Result<Tables, RecordError> {
        let mut tables = Tables::new();
        let mut data_at = None;
        while !tables.contains_key(METADATA_PAIRS) {
            if self.at > MAX_HEAD_BYTES && data_at.is_none() {
                return Err(self.not_ours("its metadata are larger than any of docktwin"));
            }
            let before = self.at;
            match self.head_record(data_at.is_some()) {
                Ok(Some(Record::Metadata(m))) => {
                    if m.name == METADATA {
                        self.check_schema(&m.metadata)?;
                    }
                    tables.insert(m.name, m.metadata);
                }
                Ok(Some(_)) => {}
                Ok(None) => {
                    data_at.get_or_insert(before);
                }
                Err(Stop::Cut(_, why)) => {
                    let why = match data_at {
                        Some(_) => "the metadata of docktwin is not there".into(),
                        None => why,
                    };
                    return Err(self.not_ours(format!("{why}, so nothing was recorded")));
                }
                Err(Stop::Failed(e)) => {
                    return Err(RecordError::io("read the log", &self.path, &e));
                }
            }
        }
        self.chunks_at = data_at.unwrap_or(self.at);
        Ok(tables)
    }

    /// A record of the head; what does not belong there is passed over.
    fn head_record(&mut self, beyond: bool) -> Result<Option<Record<'static>>, Stop> {
        let (op, len) = self.next_header()?;
        match op {
            op::FOOTER => Err(Stop::Cut(Flaw::Ends, "the file has no metadata".into())),
            op::HEADER | op::METADATA if !beyond || op == op::METADATA => {
                self.next_body(op, len, MAX_HEAD_BYTES)?;
                Ok(Some(bounded::parse(op, &self.record[RECORD_HEADER..])?.into_owned()))
            }
            _ => {
                self.at += RECORD_HEADER as u64 + len;
                self.file.seek_relative(i64::try_from(len).unwrap_or(i64::MAX))?;
                Ok(None)
            }
        }
    }

    fn take_tables(&mut self, mut tables: Tables) -> Result<(), RecordError> {
        self.metadata = tables.remove(METADATA).unwrap_or_default();
        self.check_schema(&self.metadata)?;
        self.pair_names = tables.remove(METADATA_PAIRS).unwrap_or_default().into_values().collect();
        self.columns = tables
            .remove(METADATA_COLUMNS)
            .unwrap_or_default()
            .into_values()
            .map(|text| column_of(&text).ok_or_else(|| self.not_ours(format!("column `{text}`"))))
            .collect::<Result<_, _>>()?;
        if self.columns.len() > MAX_COLUMNS {
            return Err(self.not_ours(format!("it has {} columns", self.columns.len())));
        }
        let problems = column::problems(&self.columns);
        if !problems.is_empty() {
            return Err(self.not_ours(format!(
                "{} columns are wrong, first {}",
                problems.len(),
                problems[0]
            )));
        }
        let rows = RowChain::begin(&self.columns, &self.pair_names, &self.metadata);
        let digests = self.metadata.contains_key(DIGEST_KEY);
        self.assembly = Assembly::new(&self.columns, rows, digests);
        Ok(())
    }

    fn check_schema(&self, metadata: &BTreeMap<String, String>) -> Result<(), RecordError> {
        let found: u32 = metadata
            .get(SCHEMA_KEY)
            .and_then(|v| v.parse().ok())
            .ok_or_else(|| self.not_ours(format!("its metadata has no number {SCHEMA_KEY}")))?;
        if found > RECORD_SCHEMA {
            let path = self.path.clone();
            return Err(RecordError::Newer { found, supported: RECORD_SCHEMA, path });
        }
        Ok(())
    }

    /// Opcode and length of the next record, which is in the file to its end.
    fn next_header(&mut self) -> Result<(u8, u64), Stop> {
        let mut header = [0; RECORD_HEADER];
        self.file.read_exact(&mut header)?;
        let [op, len @ ..] = header;
        let len = u64::from_le_bytes(len);
        if op == 0 {
            return Err(Stop::Cut(Flaw::Ends, "there is no record".into()));
        }
        // Asked anew each time: the file may still be growing.
        let left = self.file.get_ref().metadata()?.len().saturating_sub(self.at);
        if len.saturating_add(RECORD_HEADER as u64) > left {
            return Err(Stop::Cut(Flaw::Ends, "the file ends within a record".into()));
        }
        Ok((op, len))
    }

    /// Reads the body of a record into `self.record`, behind room for its header.
    fn next_body(&mut self, op: u8, len: u64, most: u64) -> Result<(), Stop> {
        let len = usize::try_from(len)
            .ok()
            .filter(|n| *n as u64 <= most)
            .ok_or_else(|| Stop::Cut(Flaw::Damaged, format!("a record of {len} bytes")))?;
        self.record.clear();
        self.record.resize(RECORD_HEADER + len, 0);
        self.record[0] = op;
        self.file.read_exact(&mut self.record[RECORD_HEADER..])?;
        self.at += self.record.len() as u64;
        Ok(())
    }

    /// Reads one record behind the head.
    fn read_step(&mut self) -> Result<(), Stop> {
        let before = self.at;
        let (op, len) = self.next_header()?;
        self.next_body(op, len, MAX_CHUNK_BYTES as u64)?;
        match op {
            op::CHUNK => self.read_chunk(before),
            op::DATA_END => {
                bounded::parse(op, &self.record[RECORD_HEADER..])?;
                self.end_data()
            }
            op::FOOTER => {
                let mut magic = [0; mcap::MAGIC.len()];
                self.file.read_exact(&mut magic)?;
                if magic != *mcap::MAGIC {
                    return Err(Stop::Cut(Flaw::Damaged, "the end mark is wrong".into()));
                }
                self.end_data()?;
                self.ended = true;
                Ok(())
            }
            // A log without chunks.
            op::MESSAGE | op::CHANNEL => {
                let body = &self.record[RECORD_HEADER..];
                let taken = take(&mut self.assembly, op, body);
                let stray = || Stop::Cut(Flaw::Damaged, "a message of no known channel".into());
                let taken = taken.and_then(|t| t.then_some(()).ok_or_else(stray));
                taken.inspect_err(|_| self.at = before)
            }
            // What is not needed must at least be what it says: a chunk whose opcode was damaged
            // would be passed over in silence. Private records (0x80 and above) are let be.
            1..0x80 => {
                let parsed = bounded::parse(op, &self.record[RECORD_HEADER..]).map(|_| ());
                Ok(parsed.inspect_err(|_| self.at = before)?)
            }
            _ => Ok(()),
        }
    }

    /// All messages of the chunk in `self.record`, which begins at `before`.
    fn read_chunk(&mut self, before: u64) -> Result<(), Stop> {
        let record = core::mem::take(&mut self.record);
        let read = match bounded::records_of(&record[RECORD_HEADER..], MAX_CHUNK_BYTES) {
            Ok(records) => {
                self.sound = self.at;
                self.read_records(&records)
            }
            Err(e) => {
                self.at = before;
                Err(e.into())
            }
        };
        self.record = record;
        read
    }

    /// A chunk is what its checksum says: a record in it that is none was put there.
    fn read_records(&mut self, rest: &[u8]) -> Result<(), Stop> {
        self.take_records(rest).map_err(|stop| match stop {
            Stop::Cut(Flaw::Damaged, why) => Stop::Cut(Flaw::Edited, why),
            other => other,
        })
    }

    fn take_records(&mut self, mut rest: &[u8]) -> Result<(), Stop> {
        while !rest.is_empty() {
            let (op, body, after) = bounded::first_record(rest).ok_or_else(|| {
                Stop::Cut(Flaw::Edited, "a chunk ends within one of its records".into())
            })?;
            if !take(&mut self.assembly, op, body)? && self.look_for_channels() {
                self.file.seek(SeekFrom::Start(self.at))?;
                take(&mut self.assembly, op, body)?;
            }
            rest = after;
        }
        Ok(())
    }
}

/// Tables of the metadata by their names.
type Tables = BTreeMap<String, BTreeMap<String, String>>;

/// Takes a record in; false for a message of a channel that is not ours.
fn take(assembly: &mut Assembly, op: u8, body: &[u8]) -> Result<bool, Stop> {
    match bounded::parse(op, body)? {
        Record::Channel(c) => assembly.declared(&c),
        Record::Message { header, data } => return assembly.message(&header, &data),
        _ => {}
    }
    Ok(true)
}

/// Reads `float64 /chaser/truth chaser_position_x_m`.
fn column_of(text: &str) -> Option<Column> {
    let mut words = text.split(' ');
    let (kind, topic, name) = (words.next()?, words.next()?, words.next()?);
    words.next().is_none().then_some(())?;
    Some(Column::new(ColumnKind::from_name(kind)?, topic, name))
}

/// The ticks of a recording; see [`RunReader::ticks`].
#[derive(Debug)]
pub struct Ticks<'a>(&'a mut RunReader);

impl Iterator for Ticks<'_> {
    type Item = Result<TickRecord, RecordError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.next_tick().transpose()
    }
}

/// Writes `telemetry.parquet` anew from `run.mcap`, for a run that died and left none that can be
/// read; the one that is there is replaced. Returns the rows written.
///
/// # Errors
/// The log cannot be read or the table cannot be written.
pub fn rebuild_parquet(dir: impl AsRef<Path>) -> Result<u64, RecordError> {
    let dir = dir.as_ref();
    let rows = write_table(dir)?;
    let path = dir.join(files::TABLE);
    fs::rename(part_of(dir, files::TABLE), &path)
        .map_err(|e| RecordError::io("write the table", &path, &e))?;
    Ok(rows)
}

/// Makes a table from the log, under the name of a file on its way.
pub(crate) fn write_table(dir: &Path) -> Result<u64, RecordError> {
    let half = part_of(dir, files::TABLE);
    let mut r = RunReader::open(dir)?;
    let error = |e| RecordError::parquet("write the table", &half, e);
    let out = File::create(&half).map_err(|e| RecordError::io("create the table", &half, &e))?;
    let mut metadata = r.metadata.clone();
    metadata.remove(SCHEMA_KEY);
    metadata.remove(DIGEST_KEY);
    let mut table = Table::create(BufWriter::new(out), &r.columns, &metadata).map_err(error)?;
    let (mut block, mut rows) = (Block::new(r.columns.len()), 0);
    while let Some(t) = r.next_tick()? {
        block.push(t.tick, t.time, &t.row);
        rows += 1;
        if block.rows() == GROUP_ROWS {
            table.write(&block).map_err(error)?;
            block.clear();
        }
    }
    table.write(&block).and_then(|()| table.finish()).map_err(error)?;
    Ok(rows)
}

/// Writes `run.mcap` anew with one bit of one column at one tick flipped: the negative control of
/// replay and diff.
///
/// # Errors
/// No such tick or column, a cut log, or a file that cannot be read or written.
#[doc(hidden)]
pub fn flip_bit(
    dir: impl AsRef<Path>,
    tick: Tick,
    column: &str,
    bit: u32,
) -> Result<(), RecordError> {
    let dir = dir.as_ref();
    let mut r = RunReader::open(dir)?;
    let absent = |what: String| {
        let remedy = "name one that it has";
        RecordError::Absent { what, remedy, path: dir.join(files::LOG) }
    };
    let index = r.column_index(column).ok_or_else(|| absent(format!("the column `{column}`")))?;
    let half = dir.join(".run.mcap.part");
    let error = |e| RecordError::io("write the log", &half, &e);
    let out = File::create(&half).map_err(|e| RecordError::io("create the log", &half, &e))?;
    let mut log = McapLog::create(out, &r.columns, &r.pair_names, &r.metadata).map_err(error)?;
    let mut found = false;
    while let Some(mut t) = r.next_tick()? {
        if t.tick == tick {
            found = true;
            t.row[index] = Cell::from_bits(t.row[index].bits() ^ (1 << (bit % 64)));
        }
        log.tick(t.tick, t.time, &t.row, &t.contacts, t.recorded_unix_ns);
        if log.open_ticks() == 50 {
            log.flush().map_err(error)?;
        }
    }
    if !found {
        return Err(absent(format!("tick {}", tick.0)));
    }
    for e in r.events()? {
        log.event(&e);
    }
    log.finish().map_err(error)?;
    fs::rename(&half, &r.path).map_err(|e| RecordError::io("write the log", &r.path, &e))
}
