use core::fmt;
use std::collections::{BTreeMap, VecDeque};
use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, BufWriter, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use docktwin_core::{SimTime, Tick};
use mcap::records::{Record, op};

use crate::bounded;
use crate::column::{
    self, CONTACTS_TOPIC, Cell, Column, ColumnKind, ContactRow, EVENTS_TOPIC, TICK_TOPIC,
};
use crate::layout::{self, Topic};
use crate::log::{METADATA, METADATA_COLUMNS, METADATA_PAIRS, McapLog, RECOVERED_KEY, SCHEMA_KEY};
use crate::table::{Block, GROUP_ROWS, Table};
use crate::{Event, RECORD_SCHEMA, RecordError, SUMMARY_SCHEMA, Summary, files};

/// No chunk of ours comes near this; a larger one is taken for damage, not for memory to be asked
/// for.
const MAX_CHUNK_BYTES: usize = 1 << 26;
/// The same for the metadata before the first chunk; ours have some ten thousand bytes.
const MAX_HEAD_BYTES: u64 = 1 << 22;
/// Columns that are taken for real.
const MAX_COLUMNS: usize = 10_000;
/// Longest line of `events.jsonl`, and longest summary.
const MAX_TEXT_BYTES: u64 = 1 << 24;
const RECORD_HEADER: usize = 9;

/// One tick as it was recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct TickRecord {
    /// Its number.
    pub tick: Tick,
    /// Its time.
    pub time: SimTime,
    /// One cell per column, in the order of [`RunReader::columns`].
    pub row: Vec<Cell>,
    /// The contacts.
    pub contacts: Vec<ContactRow>,
    /// Wall clock when the tick was handed to the recorder, ns since 1970; `None` in recordings that
    /// were not given their start (`started_unix_ns` of the metadata).
    pub recorded_unix_ns: Option<u64>,
}

/// A log that ends before its end mark.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cut {
    /// Everything before this byte was read.
    pub at_byte: u64,
    /// Length of the file, bytes.
    pub file_bytes: u64,
    /// The last tick that was read.
    pub last: Option<(Tick, SimTime)>,
    /// What was found there.
    pub why: String,
}

impl fmt::Display for Cut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { at_byte, file_bytes, last, why } = self;
        write!(f, "the log stops at byte {at_byte} of {file_bytes} ({why}); ")?;
        match last {
            Some((tick, time)) => {
                write!(f, "recovered up to tick {} ({:.3} s)", tick.0, time.seconds())
            }
            None => f.write_str("no tick was recovered"),
        }
    }
}

/// What a channel of the file carries.
#[derive(Clone, Copy)]
enum Role {
    Tick,
    Contacts,
    Events,
    Columns(usize),
}

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
    topics: Vec<Topic>,
    roles: BTreeMap<u16, Role>,
    /// Where the chunks begin.
    chunks_at: u64,
    /// Header and body of the record last read.
    record: Vec<u8>,
    ready: VecDeque<TickRecord>,
    /// Events of the chunks read so far.
    logged: Vec<Event>,
    last: Option<(Tick, SimTime)>,
    ended: bool,
    cut: Option<Cut>,
}

impl fmt::Debug for RunReader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RunReader").field("dir", &self.dir).finish_non_exhaustive()
    }
}

/// Why reading stops, short of an error of the system.
enum Stop {
    Cut(String),
    Failed(io::Error),
}

impl From<io::Error> for Stop {
    fn from(e: io::Error) -> Self {
        match e.kind() {
            io::ErrorKind::UnexpectedEof => Self::Cut("the file ends within a record".into()),
            _ => Self::Failed(e),
        }
    }
}

impl From<mcap::McapError> for Stop {
    fn from(e: mcap::McapError) -> Self {
        match e {
            mcap::McapError::Io(e) => Self::Cut(e.to_string()),
            other => Self::Cut(other.to_string()),
        }
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
            topics: Vec::new(),
            roles: BTreeMap::new(),
            chunks_at: 0,
            record: Vec::new(),
            ready: VecDeque::new(),
            logged: Vec::new(),
            last: None,
            ended: false,
            cut: None,
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

    /// The next tick, or `None` after the last.
    ///
    /// # Errors
    /// The file cannot be read. A cut or damaged file is no error: see [`RunReader::cut`].
    pub fn next_tick(&mut self) -> Result<Option<TickRecord>, RecordError> {
        while self.ready.is_empty() && !self.ended {
            match self.read_step() {
                Ok(()) => {}
                Err(Stop::Failed(e)) => {
                    return Err(RecordError::io("read the log", &self.path, &e));
                }
                Err(Stop::Cut(why)) => {
                    self.ended = true;
                    let file_bytes = self.file.get_ref().metadata().map_or(self.at, |m| m.len());
                    self.cut = Some(Cut { at_byte: self.at, file_bytes, last: self.last, why });
                }
            }
        }
        Ok(self.ready.pop_front())
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
        self.ready.clear();
        self.logged.clear();
        self.last = None;
        self.ended = false;
        self.cut = None;
        Ok(())
    }

    /// The events that stand in the log, as far as its ticks were read; those of `events.jsonl` reach
    /// further where a run died.
    #[must_use]
    pub fn logged_events(&self) -> &[Event] {
        &self.logged
    }

    /// Why this log was written anew by [`crate::recover`], in words; `None` for one that was not.
    #[must_use]
    pub fn recovered(&self) -> Option<&str> {
        self.metadata.get(RECOVERED_KEY).map(String::as_str)
    }

    /// Once all ticks are read: where and why the log stops before its end mark, or `None` for a
    /// whole one.
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
        let path = self.dir.join(files::SUMMARY);
        let mut text = String::new();
        let read = match open_file(&path, "read the summary") {
            Ok(file) => file.take(MAX_TEXT_BYTES).read_to_string(&mut text),
            Err(RecordError::Io { kind: io::ErrorKind::NotFound, .. }) => return Ok(None),
            Err(e) => return Err(e),
        };
        read.map_err(|e| RecordError::io("read the summary", &path, &e))?;
        let bad = |e: serde_json::Error| RecordError::NotARecording {
            why: format!("this is no summary ({e})"),
            path: path.clone(),
        };
        let value: serde_json::Value = serde_json::from_str(&text).map_err(bad)?;
        let found = value["schema_version"].as_u64().unwrap_or(0);
        if found > u64::from(SUMMARY_SCHEMA) {
            let found = u32::try_from(found).unwrap_or(u32::MAX);
            return Err(RecordError::Newer { found, supported: SUMMARY_SCHEMA, path });
        }
        serde_json::from_value(value).map(Some).map_err(bad)
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
        let mut tables: BTreeMap<String, BTreeMap<String, String>> = BTreeMap::new();
        while !tables.contains_key(METADATA_PAIRS) {
            if self.at > MAX_HEAD_BYTES {
                return Err(self.not_ours("its metadata are larger than any of docktwin"));
            }
            let record = self.next_record().and_then(|()| {
                let (op, body) = (self.record[0], &self.record[RECORD_HEADER..]);
                match op {
                    op::HEADER => Ok(None),
                    op::METADATA => Ok(Some(bounded::parse(op, body)?)),
                    _ => Err(Stop::Cut("the metadata of docktwin is not there".into())),
                }
            });
            match record {
                Ok(Some(Record::Metadata(m))) => {
                    if m.name == METADATA {
                        self.check_schema(&m.metadata)?;
                    }
                    tables.insert(m.name, m.metadata);
                }
                Ok(_) => {}
                Err(Stop::Cut(why)) => {
                    return Err(self.not_ours(format!("{why}, so nothing was recorded")));
                }
                Err(Stop::Failed(e)) => {
                    return Err(RecordError::io("read the log", &self.path, &e));
                }
            }
        }
        self.chunks_at = self.at;
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
        self.topics = layout::topics(&self.columns);
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

    /// Reads a whole record into `self.record`.
    fn next_record(&mut self) -> Result<(), Stop> {
        let mut header = [0; RECORD_HEADER];
        self.file.read_exact(&mut header)?;
        let [op, len @ ..] = header;
        let len = u64::from_le_bytes(len);
        if op == 0 {
            return Err(Stop::Cut("there is no record".into()));
        }
        // Asked anew each time: the file may still be growing.
        let left = self.file.get_ref().metadata()?.len().saturating_sub(self.at);
        if len.saturating_add(RECORD_HEADER as u64) > left {
            return Err(Stop::Cut("the file ends within a record".into()));
        }
        let most = if self.chunks_at == 0 { MAX_HEAD_BYTES } else { MAX_CHUNK_BYTES as u64 };
        let len = usize::try_from(len)
            .ok()
            .filter(|n| *n as u64 <= most)
            .ok_or_else(|| Stop::Cut(format!("a record of {len} bytes")))?;
        self.record.clear();
        self.record.extend_from_slice(&header);
        self.record.resize(RECORD_HEADER + len, 0);
        self.file.read_exact(&mut self.record[RECORD_HEADER..])?;
        self.at += self.record.len() as u64;
        Ok(())
    }

    /// Reads one record behind the head.
    fn read_step(&mut self) -> Result<(), Stop> {
        let before = self.at;
        self.next_record()?;
        match self.record[0] {
            op::CHUNK => {
                let ticks = self.read_chunk().inspect_err(|_| self.at = before)?;
                self.last = ticks.last().map(|t| (t.tick, t.time)).or(self.last);
                self.ready.extend(ticks);
            }
            op::FOOTER => {
                let mut magic = [0; mcap::MAGIC.len()];
                self.file.read_exact(&mut magic)?;
                if magic != *mcap::MAGIC {
                    return Err(Stop::Cut("the end mark is wrong".into()));
                }
                self.ended = true;
            }
            // What is not needed must at least be what it says: a chunk whose opcode was damaged
            // would be passed over in silence. Private records (0x80 and above) are let be.
            op @ 1..0x80 => {
                bounded::parse(op, &self.record[RECORD_HEADER..])
                    .inspect_err(|_| self.at = before)?;
            }
            _ => {}
        }
        Ok(())
    }

    /// All ticks of the chunk in `self.record`, or none.
    fn read_chunk(&mut self) -> Result<Vec<TickRecord>, Stop> {
        let records = bounded::records_of(&self.record[RECORD_HEADER..], MAX_CHUNK_BYTES)?;
        let mut chunk = ChunkTicks {
            columns: self.columns.len(),
            topics: &self.topics,
            roles: &mut self.roles,
            ticks: Vec::new(),
            events: Vec::new(),
            messages: 0,
        };
        let mut rest = &records[..];
        while !rest.is_empty() {
            let (op, body, after) = bounded::first_record(rest)
                .ok_or_else(|| Stop::Cut("a chunk that ends within a record".into()))?;
            chunk.record(bounded::parse(op, body)?)?;
            rest = after;
        }
        chunk.end_tick()?;
        let ChunkTicks { ticks, events, .. } = chunk;
        self.logged.extend(events);
        Ok(ticks)
    }
}

/// Puts the messages of a chunk together into ticks.
struct ChunkTicks<'a> {
    columns: usize,
    topics: &'a [Topic],
    roles: &'a mut BTreeMap<u16, Role>,
    ticks: Vec<TickRecord>,
    events: Vec<Event>,
    /// Column messages of the last tick.
    messages: usize,
}

impl ChunkTicks<'_> {
    fn record(&mut self, record: Record<'_>) -> Result<(), Stop> {
        let damaged = || Stop::Cut("a message that is not as its columns say".into());
        match record {
            Record::Channel(c) => {
                let column_topic = || self.topics.iter().position(|t| t.topic == c.topic);
                let role = match c.topic.as_str() {
                    TICK_TOPIC => Some(Role::Tick),
                    CONTACTS_TOPIC => Some(Role::Contacts),
                    EVENTS_TOPIC => Some(Role::Events),
                    _ => column_topic().map(Role::Columns),
                };
                if let Some(role) = role {
                    self.roles.insert(c.id, role);
                }
            }
            Record::Message { header, data } => match self.roles.get(&header.channel_id) {
                Some(Role::Tick) => {
                    self.end_tick()?;
                    self.ticks.push(TickRecord {
                        tick: Tick(layout::decode_tick(&data).ok_or_else(damaged)?),
                        time: SimTime::from_nanos(header.log_time),
                        row: vec![Cell::default(); self.columns],
                        contacts: Vec::new(),
                        recorded_unix_ns: (header.publish_time != header.log_time)
                            .then_some(header.publish_time),
                    });
                }
                Some(Role::Columns(i)) => {
                    let tick = self.ticks.last_mut().ok_or_else(damaged)?;
                    self.topics[*i].decode(&data, &mut tick.row).ok_or_else(damaged)?;
                    self.messages += 1;
                }
                Some(Role::Contacts) => {
                    let tick = self.ticks.last_mut().ok_or_else(damaged)?;
                    let (number, contacts) = layout::decode_contacts(&data).ok_or_else(damaged)?;
                    if number != tick.tick.0 {
                        return Err(damaged());
                    }
                    tick.contacts = contacts;
                }
                Some(Role::Events) => {
                    self.events.push(layout::decode_event(&data).ok_or_else(damaged)?);
                }
                None => {}
            },
            _ => {}
        }
        Ok(())
    }

    /// Every topic must have come once.
    fn end_tick(&mut self) -> Result<(), Stop> {
        let whole = self.ticks.is_empty() || self.messages == self.topics.len();
        self.messages = 0;
        whole.then_some(()).ok_or_else(|| Stop::Cut("a tick without all its columns".into()))
    }
}

/// Opens a regular file: a pipe or a device would wait or never end.
fn open_file(path: &Path, action: &'static str) -> Result<File, RecordError> {
    let meta = fs::metadata(path).map_err(|e| RecordError::io(action, path, &e))?;
    if !meta.is_file() {
        let e = io::Error::new(io::ErrorKind::InvalidInput, "this is not a regular file");
        return Err(RecordError::io(action, path, &e));
    }
    File::open(path).map_err(|e| RecordError::io(action, path, &e))
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
/// read. Returns the rows written.
///
/// # Errors
/// The log cannot be read or the table cannot be written.
pub fn rebuild_parquet(dir: impl AsRef<Path>) -> Result<u64, RecordError> {
    let dir = dir.as_ref();
    let (path, half) = (dir.join(files::TABLE), dir.join(".telemetry.parquet.part"));
    let mut r = RunReader::open(dir)?;
    let error = |e| RecordError::parquet("write the table", &path, e);
    let out = File::create(&half).map_err(|e| RecordError::io("create the table", &half, &e))?;
    let mut metadata = r.metadata.clone();
    metadata.remove(SCHEMA_KEY);
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
    fs::rename(&half, &path).map_err(|e| RecordError::io("write the table", &path, &e))?;
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
    let absent = |what: String| RecordError::Absent { what, path: dir.join(files::LOG) };
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
