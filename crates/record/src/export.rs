//! A recording for other programs: comma-separated values, and MATLAB's level 5 files.
//!
//! The MAT writer follows "MAT-File Format" (MathWorks), level 5, uncompressed: every column is one
//! variable, a column vector. It is written here because a run of any length passes through in
//! blocks, which needs the place of every variable known beforehand.

use core::fmt::Write as _;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::PathBuf;

use crate::column::{Cell, Column, ColumnKind, ContactRow};
use crate::flaw::Cut;
use crate::{RecordError, RunReader};

/// What of a recording is exported.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Names of columns or topics, with `*`, `?` and `[…]`; empty for all.
    pub columns: Vec<String>,
    /// Every so many ticks, from the first; 0 and 1 mean all. Contacts are never left out.
    pub every: u64,
}

/// What was exported.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exported {
    /// Rows written.
    pub rows: u64,
    /// Columns beside tick and time.
    pub columns: usize,
    /// Contact points written.
    pub contacts: u64,
    /// Where the recording is cut.
    pub cut: Option<Cut>,
}

impl Selection {
    /// Indices of the columns chosen, in their order.
    fn indices(&self, r: &RunReader) -> Result<Vec<usize>, RecordError> {
        let absent = |what: String, remedy| {
            let path = r.log_path().to_owned();
            RecordError::Absent { what, remedy, path }
        };
        if self.columns.is_empty() {
            return Ok((0..r.columns().len()).collect());
        }
        let mut chosen = vec![false; r.columns().len()];
        for text in &self.columns {
            let pattern = glob::Pattern::new(text).map_err(|e| {
                let remedy = "write a name with * ? or a whole [...] in it";
                absent(format!("`{text}` is no pattern ({e}) and"), remedy)
            })?;
            let mut any = false;
            for (c, chosen) in r.columns().iter().zip(&mut chosen) {
                if pattern.matches(&c.name) || pattern.matches(&c.topic) {
                    (*chosen, any) = (true, true);
                }
            }
            if !any {
                let remedy = "name one of the columns that an export without --columns has";
                return Err(absent(format!("a column or topic like `{text}`"), remedy));
            }
        }
        Ok((0..chosen.len()).filter(|i| chosen[*i]).collect())
    }

    fn takes(&self, index: u64) -> bool {
        index.is_multiple_of(self.every.max(1))
    }
}

/// Names of the numbers of a contact, in the order of `ContactRow`'s own.
const CONTACT_NUMBERS: [&str; 11] = [
    "point_w_x_m",
    "point_w_y_m",
    "point_w_z_m",
    "normal_w_x",
    "normal_w_y",
    "normal_w_z",
    "depth_m",
    "normal_force_n",
    "friction_w_x_n",
    "friction_w_y_n",
    "friction_w_z_n",
];

/// What an export that cannot be written was doing, in [`RecordError::Io`].
pub const WRITE_EXPORT: &str = "write the export";

fn failed(path: &std::path::Path) -> impl Fn(io::Error) -> RecordError + '_ {
    move |e| RecordError::io(WRITE_EXPORT, path, &e)
}

/// Appends a cell as text: the shortest decimal that gives the same bits again, 0 or 1 for yes or
/// no.
fn push_text(line: &mut String, cell: Cell, kind: ColumnKind) {
    // Writing to a string cannot fail.
    let _ = match kind {
        ColumnKind::F64 => write!(line, "{:?}", cell.as_f64()),
        ColumnKind::U64 => write!(line, "{}", cell.as_u64()),
        ColumnKind::Bool => write!(line, "{}", u8::from(cell.as_bool())),
    };
}

/// A text as RFC 4180 wants it.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// Writes comma-separated values: a header of names with units, `tick` and `time_s` first, then a
/// line a tick; contacts, a line a point, to a second place. Every number comes back with its bits
/// (of NaN only that it is one). `path` is named in errors.
///
/// # Errors
/// A pattern that fits nothing, a log that cannot be read, a place that cannot be written to.
pub fn export_csv(
    r: &mut RunReader,
    selection: &Selection,
    out: impl Write,
    contacts_out: Option<&mut dyn Write>,
    path: &std::path::Path,
) -> Result<Exported, RecordError> {
    let indices = selection.indices(r)?;
    let kinds: Vec<ColumnKind> = indices.iter().map(|i| r.columns()[*i].kind).collect();
    let pairs: Vec<String> = r.pair_names().iter().map(|n| quoted(n)).collect();
    let error = failed(path);
    let mut table = BufWriter::new(out);
    let mut points = contacts_out.map(BufWriter::new);
    let names = indices.iter().map(|i| r.columns()[*i].name.as_str());
    let header: Vec<&str> = ["tick", "time_s"].into_iter().chain(names).collect();
    writeln!(table, "{}", header.join(",")).map_err(&error)?;
    if let Some(points) = &mut points {
        let own = "tick,time_s,pair,pair_name";
        writeln!(points, "{own},{}", CONTACT_NUMBERS.join(",")).map_err(&error)?;
    }
    let mut done = Exported { rows: 0, columns: indices.len(), contacts: 0, cut: None };
    let (mut seen, mut line) = (0, String::new());
    r.rewind()?;
    while let Some(t) = r.next_tick()? {
        let at = format!("{},{:?}", t.tick.0, t.time.seconds());
        if selection.takes(seen) {
            done.rows += 1;
            line.clone_from(&at);
            for (i, kind) in indices.iter().zip(&kinds) {
                line.push(',');
                push_text(&mut line, t.row[*i], *kind);
            }
            writeln!(table, "{line}").map_err(&error)?;
        }
        seen += 1;
        if let Some(points) = &mut points {
            for c in &t.contacts {
                done.contacts += 1;
                let name = pairs.get(usize::from(c.pair)).map_or("", String::as_str);
                let numbers = c.numbers().map(|x| format!("{x:?}"));
                writeln!(points, "{at},{},{name},{}", c.pair, numbers.join(",")).map_err(&error)?;
            }
        }
    }
    table.flush().map_err(&error)?;
    if let Some(points) = &mut points {
        points.flush().map_err(&error)?;
    }
    done.cut = r.cut().cloned();
    Ok(done)
}

// MAT, level 5 ---------------------------------------------------------------------------------

/// What a variable holds: its class, the type of its data, bytes of an element, flags.
#[derive(Clone, Copy)]
enum Class {
    Double,
    Uint64,
    Uint16,
    Logical,
}

impl Class {
    const fn of(kind: ColumnKind) -> Self {
        match kind {
            ColumnKind::F64 => Self::Double,
            ColumnKind::U64 => Self::Uint64,
            ColumnKind::Bool => Self::Logical,
        }
    }

    /// mxDOUBLE_CLASS 6, mxUINT8_CLASS 9 with the logical flag, mxUINT16_CLASS 11,
    /// mxUINT64_CLASS 15.
    const fn flags(self) -> u32 {
        match self {
            Self::Double => 6,
            Self::Uint64 => 15,
            Self::Uint16 => 11,
            Self::Logical => 9 | 0x0200,
        }
    }

    /// miDOUBLE 9, miUINT64 13, miUINT16 4, miUINT8 2.
    const fn data(self) -> u32 {
        match self {
            Self::Double => 9,
            Self::Uint64 => 13,
            Self::Uint16 => 4,
            Self::Logical => 2,
        }
    }

    const fn size(self) -> u64 {
        match self {
            Self::Double | Self::Uint64 => 8,
            Self::Uint16 => 2,
            Self::Logical => 1,
        }
    }
}

const MI_MATRIX: u32 = 14;
const MI_INT8: u32 = 1;
const MI_INT32: u32 = 5;
const MI_UTF16: u32 = 17;
const MI_UINT32: u32 = 6;
/// MATLAB's longest name.
const NAME_MAX: usize = 63;
/// Bytes of one variable gathered before they are written.
const GATHER: usize = 1 << 15;

/// Appends an element with its tag, padded to 8 bytes.
fn element(out: &mut Vec<u8>, kind: u32, body: &[u8]) {
    tag(out, kind, body.len() as u64);
    out.extend_from_slice(body);
    out.resize(out.len().next_multiple_of(8), 0);
}

fn tag(out: &mut Vec<u8>, kind: u32, bytes: u64) {
    out.extend_from_slice(&kind.to_le_bytes());
    // Larger variables are refused before anything is written.
    out.extend_from_slice(&u32::try_from(bytes).unwrap_or(u32::MAX).to_le_bytes());
}

/// Flags, dimensions and name of an array.
fn array_head(flags: u32, rows: u64, columns: u64, name: &str) -> Vec<u8> {
    let mut b = Vec::new();
    let int = |n: u64| i32::try_from(n).unwrap_or(i32::MAX).to_le_bytes();
    element(&mut b, MI_UINT32, &[flags.to_le_bytes(), [0; 4]].concat());
    element(&mut b, MI_INT32, &[int(rows), int(columns)].concat());
    element(&mut b, MI_INT8, name.as_bytes());
    b
}

/// A text as a row of UTF-16 characters.
fn char_array(name: &str, text: &str) -> Vec<u8> {
    const MX_CHAR: u32 = 4;
    let units: Vec<u16> = text.encode_utf16().collect();
    let mut body = array_head(MX_CHAR, u64::from(!units.is_empty()), units.len() as u64, name);
    let bytes: Vec<u8> = units.iter().flat_map(|u| u.to_le_bytes()).collect();
    element(&mut body, MI_UTF16, &bytes);
    let mut out = Vec::new();
    element(&mut out, MI_MATRIX, &body);
    out
}

/// Texts as a column of cells.
fn cell_array(name: &str, texts: &[String]) -> Vec<u8> {
    const MX_CELL: u32 = 1;
    let mut body = array_head(MX_CELL, texts.len() as u64, 1, name);
    texts.iter().for_each(|t| body.extend(char_array("", t)));
    let mut out = Vec::new();
    element(&mut out, MI_MATRIX, &body);
    out
}

/// A variable on its way into the file.
struct Variable {
    class: Class,
    /// Where its next byte goes.
    at: u64,
    gathered: Vec<u8>,
}

struct MatFile<W> {
    out: W,
    end: u64,
    variables: Vec<Variable>,
}

impl<W: Write + Seek> MatFile<W> {
    fn new(mut out: W) -> io::Result<Self> {
        let mut head = vec![b' '; 116];
        let text = concat!("MATLAB 5.0 MAT-file, written by docktwin ", env!("CARGO_PKG_VERSION"));
        head[..text.len()].copy_from_slice(text.as_bytes());
        // No subsystem data, version 1.0, little-endian.
        head.extend_from_slice(&[0; 8]);
        head.extend_from_slice(&[0x00, 0x01, b'I', b'M']);
        out.write_all(&head)?;
        Ok(Self { out, end: head.len() as u64, variables: Vec::new() })
    }

    fn whole(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.end += bytes.len() as u64;
        self.out.write_all(bytes)
    }

    /// Makes room for a column vector of `rows` elements.
    fn vector(&mut self, name: &str, class: Class, rows: u64) -> io::Result<()> {
        let body = array_head(class.flags(), rows, 1, name);
        let bytes = rows * class.size();
        let padded = bytes.next_multiple_of(8);
        let mut head = Vec::new();
        tag(&mut head, MI_MATRIX, body.len() as u64 + 8 + padded);
        head.extend_from_slice(&body);
        tag(&mut head, class.data(), bytes);
        self.whole(&head)?;
        self.variables.push(Variable { class, at: self.end, gathered: Vec::new() });
        self.end += padded;
        self.out.seek(SeekFrom::Start(self.end)).map(|_| ())
    }

    fn push(&mut self, variable: usize, cell: Cell) -> io::Result<()> {
        let v = &mut self.variables[variable];
        let bytes = cell.bits().to_le_bytes();
        let size = match v.class {
            Class::Double | Class::Uint64 => 8,
            Class::Uint16 => 2,
            Class::Logical => 1,
        };
        v.gathered.extend_from_slice(&bytes[..size]);
        if v.gathered.len() >= GATHER { self.write(variable) } else { Ok(()) }
    }

    fn write(&mut self, variable: usize) -> io::Result<()> {
        let v = &mut self.variables[variable];
        self.out.seek(SeekFrom::Start(v.at))?;
        self.out.write_all(&v.gathered)?;
        v.at += v.gathered.len() as u64;
        v.gathered.clear();
        Ok(())
    }

    fn finish(mut self) -> io::Result<()> {
        (0..self.variables.len()).try_for_each(|i| self.write(i))?;
        // The padding of the last variable may not have been reached.
        self.out.seek(SeekFrom::End(0)).and_then(|end| {
            let missing = usize::try_from(self.end.saturating_sub(end)).unwrap_or(0);
            self.out.write_all(&vec![0; missing])
        })?;
        self.out.flush()
    }
}

/// Writes a MATLAB level 5 file, a variable a column, `tick` and `time_s` first, and the texts
/// `scenario`, `tool_version` and, where the recording is cut, `recording_cut`. With `contacts` the
/// variables `contacts_…` too, a row a point, and the cells `pair_names`;
/// `pair_names{contacts_pair_number(k)}` is the pair of point k. `out` must be empty; `path` is named
/// in errors.
///
/// # Errors
/// A pattern that fits nothing, a log that cannot be read, a place that cannot be written to, more
/// rows than a level 5 file can hold (2 GiB a variable).
pub fn export_mat(
    r: &mut RunReader,
    selection: &Selection,
    out: impl Write + Seek,
    contacts: bool,
    path: &std::path::Path,
) -> Result<Exported, RecordError> {
    let indices = selection.indices(r)?;
    let mut done = Exported { rows: 0, columns: indices.len(), contacts: 0, cut: None };
    // How much there is comes first: a cut recording does not know it.
    let mut seen = 0;
    r.rewind()?;
    while let Some(t) = r.next_tick()? {
        done.rows += u64::from(selection.takes(seen));
        seen += 1;
        if contacts {
            done.contacts += t.contacts.len() as u64;
        }
    }
    done.cut = r.cut().cloned();
    refuse_what_cannot_be_held(r.columns(), &indices, &done, path)?;

    let error = failed(path);
    let mut mat = MatFile::new(out).map_err(&error)?;
    let metadata = |key: &str| r.metadata().get(key).cloned().unwrap_or_default();
    for key in ["scenario", "tool_version"] {
        mat.whole(&char_array(key, &metadata(key))).map_err(&error)?;
    }
    if let Some(cut) = &done.cut {
        mat.whole(&char_array("recording_cut", &cut.to_string())).map_err(&error)?;
    }
    let own = [("tick", Class::Uint64), ("time_s", Class::Double)];
    let chosen = indices.iter().map(|i| {
        let c = &r.columns()[*i];
        (c.name.as_str(), Class::of(c.kind))
    });
    for (name, class) in own.into_iter().chain(chosen) {
        mat.vector(name, class, done.rows).map_err(&error)?;
    }
    let first_contact = mat.variables.len();
    if contacts {
        mat.whole(&cell_array("pair_names", r.pair_names())).map_err(&error)?;
        let own = [
            ("contacts_tick", Class::Uint64),
            ("contacts_time_s", Class::Double),
            ("contacts_pair_number", Class::Uint16),
        ];
        for (name, class) in own {
            mat.vector(name, class, done.contacts).map_err(&error)?;
        }
        for name in CONTACT_NUMBERS {
            let name = format!("contacts_{name}");
            mat.vector(&name, Class::Double, done.contacts).map_err(&error)?;
        }
    }
    let mut seen = 0;
    r.rewind()?;
    while let Some(t) = r.next_tick()? {
        let at = [Cell::from(t.tick.0), Cell::from(t.time.seconds())];
        if selection.takes(seen) {
            let cells = at.into_iter().chain(indices.iter().map(|i| t.row[*i]));
            cells.enumerate().try_for_each(|(v, c)| mat.push(v, c)).map_err(&error)?;
        }
        seen += 1;
        if contacts {
            for c in &t.contacts {
                let cells = contact_cells(at, c);
                let cells = cells.into_iter().enumerate();
                cells
                    .into_iter()
                    .try_for_each(|(v, c)| mat.push(first_contact + v, c))
                    .map_err(&error)?;
            }
        }
    }
    mat.finish().map_err(&error)?;
    Ok(done)
}

fn contact_cells(at: [Cell; 2], c: &ContactRow) -> Vec<Cell> {
    // MATLAB counts from one.
    let pair = Cell::from(u64::from(c.pair) + 1);
    at.into_iter().chain([pair]).chain(c.numbers().map(Cell::from)).collect()
}

fn refuse_what_cannot_be_held(
    columns: &[Column],
    indices: &[usize],
    done: &Exported,
    path: &std::path::Path,
) -> Result<(), RecordError> {
    let refuse = |why: String| RecordError::Export { why, path: PathBuf::from(path) };
    // The matrix, its head included, is counted in 31 bits.
    let rows = done.rows.max(done.contacts);
    if rows > ((1 << 31) - 1024) / 8 {
        return Err(refuse(format!(
            "{rows} rows are more than a MATLAB level 5 file can hold; export with --every, or as \
             csv"
        )));
    }
    match indices.iter().map(|i| &columns[*i].name).find(|n| n.len() > NAME_MAX) {
        Some(name) => Err(refuse(format!(
            "`{name}` is longer than the {NAME_MAX} characters of a MATLAB name; leave it out with \
             --columns, or export as csv"
        ))),
        None => Ok(()),
    }
}
