//! Reading a TOML file key by key, collecting every problem instead of stopping at the first.
//!
//! A reader that fails puts a problem into the [`Checker`] and returns a placeholder (NaN, an empty
//! text), so that reading goes on; the caller hands the result out only if there was no problem.
//! Every key that is asked for counts as known; what remains is refused with the nearest known name.

use core::cell::{Cell, OnceCell, RefCell};
use core::fmt;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::input::{self, Lines, is_unprintable};
use crate::problem::{Problem, ReadValue};

/// An allowed range of finite numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    lo: f64,
    lo_open: bool,
    hi: f64,
}

impl Range {
    /// Any finite number.
    pub const ANY: Self = Self { lo: f64::NEG_INFINITY, lo_open: false, hi: f64::INFINITY };

    /// `0 < x ≤ hi`.
    #[must_use]
    pub const fn positive(hi: f64) -> Self {
        Self { lo: 0.0, lo_open: true, hi }
    }

    /// `lo ≤ x ≤ hi`.
    #[must_use]
    pub const fn within(lo: f64, hi: f64) -> Self {
        Self { lo, lo_open: false, hi }
    }

    /// Whether a finite number lies inside.
    #[must_use]
    pub fn contains(&self, x: f64) -> bool {
        x.is_finite() && x <= self.hi && if self.lo_open { x > self.lo } else { x >= self.lo }
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lo = if self.lo_open { ">" } else { "≥" };
        match (self.lo.is_finite(), self.hi.is_finite()) {
            (true, true) => write!(f, "{lo} {} and ≤ {}", self.lo, self.hi),
            (true, false) => write!(f, "{lo} {}", self.lo),
            (false, true) => write!(f, "≤ {}", self.hi),
            (false, false) => write!(f, "any finite number"),
        }
    }
}

/// Unit that the end of a key names; empty for a number without unit.
#[must_use]
pub fn unit_of(key: &str) -> &'static str {
    // Longest suffixes first.
    const UNITS: [(&str, &str); 35] = [
        ("_hz_1_deg", "Hz, 1, deg"),
        ("_per_s_n_nm", "N/s, N·m/s"),
        ("_m_s2_rad_s2", "m/s², rad/s²"),
        ("_n_nm", "N, N·m"),
        ("_m3_s_pa", "m³/(s·Pa)"),
        ("_m3_s", "m³/s"),
        ("_m_s2", "m/s²"),
        ("_per_s", "1/s"),
        ("_m3", "m³"),
        ("_nm_over_rad", "N·m over rad"),
        ("_n_over_m", "N over m"),
        ("_nm_s_rad", "N·m·s/rad"),
        ("_nm_rad", "N·m/rad"),
        ("_n_s_m", "N·s/m"),
        ("_n_m2", "N·m²"),
        ("_kg_m2", "kg·m²"),
        ("_rad_s", "rad/s"),
        ("_deg_s", "deg/s"),
        ("_n_m", "N/m"),
        ("_m_s", "m/s"),
        ("_s_m", "s/m"),
        ("_nm", "N·m"),
        ("_ns", "N·s"),
        ("_kg", "kg"),
        ("_deg", "deg"),
        ("_rad", "rad"),
        ("_mm", "mm"),
        ("_us", "µs"),
        ("_m2", "m²"),
        ("_pa", "Pa"),
        ("_hz", "Hz"),
        ("_j", "J"),
        ("_m", "m"),
        ("_s", "s"),
        ("_n", "N"),
    ];
    UNITS.iter().find(|(suffix, _)| key.ends_with(suffix)).map_or("", |(_, unit)| unit)
}

/// Problems that are kept before they are sorted and cut to those listed.
const TOO_MANY: usize = 10_000;
/// Longest name for which the nearest known one is looked for.
const LONGEST_NAME: usize = 100;

/// Collects what is read from one TOML text and what is wrong with it.
#[derive(Debug)]
pub struct Checker<'a> {
    path: PathBuf,
    text: &'a str,
    lines: Lines,
    problems: RefCell<Vec<Problem>>,
    values: RefCell<Vec<ReadValue>>,
    unlisted: Cell<usize>,
    /// Every key of this kind of file: its table and its name.
    places: Vec<(&'static str, &'static str)>,
    /// Those that the text has, as dotted paths; looked for once.
    given: OnceCell<BTreeSet<String>>,
}

/// How a number with its note is written.
const NOTED: &str = "{ value = …, source = \"…\" }";
/// How a note alone is written.
const NOTE: &str = "{ source = \"…\" }";

impl<'a> Checker<'a> {
    /// For the text of the file `path`.
    #[must_use]
    pub fn new(path: &Path, text: &'a str) -> Self {
        Self {
            path: path.into(),
            text,
            lines: Lines::of(text),
            problems: RefCell::default(),
            values: RefCell::default(),
            unlisted: Cell::default(),
            places: Vec::new(),
            given: OnceCell::new(),
        }
    }

    /// With every key of this kind of file, as its table and its name: one that stands in the wrong
    /// table is then sent to the right one.
    #[must_use]
    pub fn with_places(mut self, keys: impl Iterator<Item = (&'static str, &'static str)>) -> Self {
        self.places = keys.collect();
        self
    }

    /// Where a key of this name belongs; `None` when no table has it, or the file itself.
    fn place_of(&self, name: &str) -> Option<String> {
        let (table, _) = self.places.iter().find(|(t, n)| !t.is_empty() && *n == name)?;
        Some(format!("{table}.{name}"))
    }

    /// Whether the text has a key of this dotted path already, in a table that there is once.
    fn has_key(&self, path: &str) -> bool {
        let given = self.given.get_or_init(|| {
            let (root, _) = DeTable::parse_recoverable(self.text);
            let has = |(table, name): &(&str, &str)| {
                let mut parts = table.split('.');
                let table =
                    parts.try_fold(root.get_ref(), |t, part| t.get(part)?.get_ref().as_table());
                table.is_some_and(|t| t.contains_key(*name))
            };
            let there = self.places.iter().filter(|p| !p.0.is_empty() && has(p));
            there.map(|(table, name)| format!("{table}.{name}")).collect()
        });
        given.contains(path)
    }

    /// Parses, reads the whole document with `read`, and refuses every key not asked for. `None`
    /// when the text is not TOML; the syntax errors, all of them, are then among the problems.
    pub fn read<T>(&self, read: impl FnOnce(&Table<'_, '_>) -> T) -> Option<T> {
        self.read_some(|table| {
            let value = read(table);
            table.refuse_unknown();
            value
        })
    }

    /// As [`Checker::read`], but lets keys be that were not asked for.
    pub(crate) fn read_some<T>(&self, read: impl FnOnce(&Table<'_, '_>) -> T) -> Option<T> {
        let (root, errors) = DeTable::parse_recoverable(self.text);
        let mut told = BTreeSet::new();
        for error in &errors {
            let deep = error.message().contains("recurs");
            let line = match error.span() {
                Some(s) => Some(self.line(s.start)),
                // Long dotted keys are refused without their place.
                None => self.text.lines().position(|l| l.matches('.').count() > 50).map(|i| i + 1),
            };
            // One slip often makes a row of errors on its line.
            if !told.insert((line, error.message())) {
                continue;
            }
            self.push(Problem {
                line,
                key: "syntax".into(),
                what: match deep {
                    true => "nests tables, lists or names deeper than 80".into(),
                    false => input::shown(error.message()),
                },
                remedy: match deep {
                    true => "no key of docktwin is deeper than five: flatten it".into(),
                    false => "write valid TOML on this line".into(),
                },
                ..Problem::default()
            });
        }
        if !errors.is_empty() {
            return None;
        }
        Some(read(&Table::new(self, String::new(), Some(root.get_ref()), Some(1))))
    }

    /// All problems and all values read, in the order of the file.
    #[must_use]
    pub fn finish(self) -> (Vec<Problem>, Vec<ReadValue>) {
        let mut problems = self.problems.into_inner();
        let mut values = self.values.into_inner();
        problems.sort_by_key(|p| p.line);
        let problems = crate::problem::first_of(problems, self.unlisted.get());
        values.sort_by_key(|v| v.line);
        (problems, values)
    }

    /// Whether anything was wrong so far.
    #[must_use]
    pub fn is_clean(&self) -> bool {
        self.problems.borrow().is_empty()
    }

    fn push(&self, problem: Problem) {
        let mut problems = self.problems.borrow_mut();
        // Rubbish has more problems than anybody reads; memory is bounded too.
        if problems.len() < TOO_MANY {
            problems.push(Problem { file: self.path.clone(), ..problem });
        } else {
            self.unlisted.set(self.unlisted.get() + 1);
        }
    }

    fn line(&self, offset: usize) -> usize {
        self.lines.at(offset)
    }
}

/// A table of the document while it is read. A table that ought to be there and is not is reported
/// once; its keys then read as placeholders.
#[derive(Debug)]
pub struct Table<'c, 'a> {
    cx: &'c Checker<'a>,
    path: String,
    table: Option<&'c DeTable<'a>>,
    line: Option<usize>,
    known: RefCell<BTreeSet<&'static str>>,
}

/// A number, list or text with the line it stands on.
struct Entry<'c, 'a> {
    value: &'c DeValue<'a>,
    line: usize,
}

impl<'c, 'a> Table<'c, 'a> {
    fn new(
        cx: &'c Checker<'a>,
        path: String,
        table: Option<&'c DeTable<'a>>,
        line: Option<usize>,
    ) -> Self {
        Self { cx, path, table, line, known: RefCell::default() }
    }

    /// Whether the key stands in the table.
    #[must_use]
    pub fn has(&self, key: &'static str) -> bool {
        self.entry(key).is_some()
    }

    /// Dotted path of this table; empty for the file itself.
    #[must_use]
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Dotted path of a key of this table.
    #[must_use]
    pub fn key(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }

    /// Reports that the value of `key` is wrong for a reason that its range does not say, in
    /// general because of another value.
    pub fn refuse(&self, key: &'static str, what: impl Into<String>, remedy: impl Into<String>) {
        let entry = self.entry(key);
        self.cx.push(Problem {
            line: entry.as_ref().map(|e| e.line).or(self.line),
            key: self.key(key),
            value: entry.map_or_else(String::new, |e| shown(e.value)),
            unit: unit_of(key).into(),
            what: what.into(),
            remedy: remedy.into(),
            ..Problem::default()
        });
    }

    /// A number without note.
    pub fn number(&self, key: &'static str, range: Range) -> f64 {
        match self.entry(key) {
            Some(e) => self.checked(key, &e, range, ""),
            None => self.missing(key, &format!("{range}"), &missing_remedy(key), f64::NAN),
        }
    }

    /// A number without note, or `None` when the key is absent.
    pub fn optional_number(&self, key: &'static str, range: Range) -> Option<f64> {
        self.entry(key).map(|e| self.checked(key, &e, range, ""))
    }

    /// A whole number without note, or `None` when the key is absent.
    pub fn optional_count(&self, key: &'static str, lo: u32, hi: u32) -> Option<u32> {
        self.entry(key).map(|e| self.whole(key, &e, lo, hi, ""))
    }

    /// A number with its note: `{ value = 1.0, source = "…" }` or `{ value = 1.0, assumed = "…" }`.
    pub fn noted(&self, key: &'static str, range: Range) -> f64 {
        self.with_note(key, &format!("{range}"), f64::NAN, |e, note| {
            self.checked(key, e, range, note)
        })
    }

    /// A whole number with its note.
    pub fn noted_count(&self, key: &'static str, lo: u32, hi: u32) -> u32 {
        self.with_note(key, &format!("whole number from {lo} to {hi}"), lo, |e, note| {
            self.whole(key, e, lo, hi, note)
        })
    }

    /// `N` numbers with one note.
    pub fn noted_list<const N: usize>(&self, key: &'static str, range: Range) -> [f64; N] {
        let allowed = format!("list of {N} numbers, each {range}");
        self.with_note(key, &allowed, [f64::NAN; N], |e, note| {
            let numbers = self.list(key, e, range, &allowed);
            let Ok(out) = <[f64; N]>::try_from(numbers.as_slice()) else {
                self.wrong(key, e, &format!("has {} numbers", numbers.len()), &allowed);
                return [f64::NAN; N];
            };
            self.record(key, e, note);
            out
        })
    }

    /// Rows of `N` numbers with one note; `rows` is how many there must be, if that is fixed.
    pub fn noted_rows<const N: usize>(
        &self,
        key: &'static str,
        range: Range,
        rows: Option<usize>,
    ) -> Vec<[f64; N]> {
        let count = rows.map_or_else(|| "two or more".to_owned(), |r| r.to_string());
        let allowed = format!("list of {count} lists of {N} numbers, each {range}");
        self.with_note(key, &allowed, Vec::new(), |e, note| {
            let Some(array) = e.value.as_array() else {
                self.wrong(key, e, &is_a(e.value), &allowed);
                return Vec::new();
            };
            if rows.map_or(array.len() < 2, |r| array.len() != r) {
                self.wrong(key, e, &format!("has {} rows", array.len()), &allowed);
            }
            let mut out = Vec::new();
            for item in array {
                let row = Entry { value: item.get_ref(), line: self.cx.line(item.span().start) };
                let numbers = self.list(key, &row, range, &allowed);
                match <[f64; N]>::try_from(numbers.as_slice()) {
                    Ok(r) => out.push(r),
                    Err(_) => {
                        self.wrong(key, &row, &format!("has {} numbers", numbers.len()), &allowed);
                    }
                }
            }
            self.record(key, e, note);
            out
        })
    }

    /// A note on a number that stands elsewhere: `{ source = "…" }` or `{ assumed = "…" }`.
    pub fn note_only(&self, key: &'static str) -> String {
        let Some(e) = self.entry(key) else {
            let allowed = "{ source = \"…\" } or { assumed = \"…\" }";
            return self.missing(key, allowed, &format!("add {key} = {NOTE}"), String::new());
        };
        let Some(note) = self.note_of(key, &e, NOTE) else { return String::new() };
        self.cx.values.borrow_mut().push(ReadValue {
            file: self.cx.path.clone(),
            line: Some(e.line),
            key: self.key(key),
            value: "(in the URDF)".into(),
            unit: String::new(),
            note: note.clone(),
        });
        if let Some(table) = e.value.as_table() {
            for (k, v) in table {
                if !matches!(k.get_ref().as_ref(), "source" | "assumed") {
                    self.cx.push(Problem {
                        line: Some(self.cx.line(k.span().start)),
                        key: format!("{}.{}", self.key(key), k.get_ref()),
                        value: shown(v.get_ref()),
                        what: "only a note is expected here".into(),
                        remedy: "remove it: the number itself stands in the URDF".into(),
                        ..Problem::default()
                    });
                }
            }
        }
        note
    }

    /// A text; `allowed` is what the message says when it is missing.
    pub fn text(&self, key: &'static str, allowed: &str) -> String {
        self.optional_text(key, allowed)
            .unwrap_or_else(|| self.missing(key, allowed, &missing_remedy(key), String::new()))
    }

    /// A text that is not empty, or `None` when the key is absent.
    pub fn optional_text(&self, key: &'static str, allowed: &str) -> Option<String> {
        let e = self.entry(key)?;
        match e.value.as_str() {
            Some(text) if text.chars().any(is_unprintable_in_text) => {
                let what = "holds a character that cannot be printed";
                self.wrong(key, &e, what, "printable text");
                Some(String::new())
            }
            Some(text) if !text.trim().is_empty() => {
                self.record(key, &e, "");
                Some(text.to_owned())
            }
            Some(_) => {
                self.wrong(key, &e, "is empty", allowed);
                Some(String::new())
            }
            None => {
                self.wrong(key, &e, &is_a(e.value), allowed);
                Some(String::new())
            }
        }
    }

    /// One of a few words; `None` when the key is absent or its word is not one of them.
    pub fn optional_choice<T: Copy>(&self, key: &'static str, words: &[(&str, T)]) -> Option<T> {
        let allowed = words.iter().map(|(w, _)| *w).collect::<Vec<_>>().join(" | ");
        let text = self.optional_text(key, &allowed)?;
        let found = words.iter().find(|(w, _)| *w == text).map(|(_, t)| *t);
        if found.is_none() && !text.is_empty() {
            let e = self.entry(key)?;
            self.wrong(key, &e, "is not a known word", &allowed);
        }
        found
    }

    /// One of a few words; a problem when the key is absent.
    pub fn choice<T: Copy>(&self, key: &'static str, words: &[(&str, T)]) -> Option<T> {
        if !self.has(key) {
            let allowed = words.iter().map(|(w, _)| *w).collect::<Vec<_>>().join(" | ");
            return self.missing(key, &allowed, &missing_remedy(key), None);
        }
        self.optional_choice(key, words)
    }

    /// `true` or `false`; `default` when the key is absent.
    pub fn flag(&self, key: &'static str, default: bool) -> bool {
        let Some(e) = self.entry(key) else { return default };
        match e.value.as_bool() {
            Some(b) => {
                self.record(key, &e, "");
                b
            }
            None => {
                self.wrong(key, &e, &is_a(e.value), "true | false");
                default
            }
        }
    }

    /// A table that must be there.
    pub fn section<T>(&self, key: &'static str, read: impl FnOnce(&Table<'_, '_>) -> T) -> T {
        let found = self.sub_table(key);
        if found.is_none() && self.table.is_some() && !self.has(key) {
            self.cx.push(Problem {
                line: self.line,
                key: self.key(key),
                what: "this table is missing".into(),
                remedy: format!("add [{}] with its keys", self.key(key)),
                ..Problem::default()
            });
        }
        let (table, line) = found.map_or((None, None), |(t, l)| (Some(t), Some(l)));
        let sub = Table::new(self.cx, self.key(key), table, line);
        let value = read(&sub);
        sub.refuse_unknown();
        value
    }

    /// A table that may be absent.
    pub fn optional_section<T>(
        &self,
        key: &'static str,
        read: impl FnOnce(&Table<'_, '_>) -> T,
    ) -> Option<T> {
        self.has(key).then(|| self.section(key, read))
    }

    /// An array of tables, empty when the key is absent.
    pub fn sections<T>(
        &self,
        key: &'static str,
        mut read: impl FnMut(&Table<'_, '_>) -> T,
    ) -> Vec<T> {
        let Some(e) = self.entry(key) else { return Vec::new() };
        let Some(array) = e.value.as_array() else {
            self.wrong(key, &e, &is_a(e.value), "array of tables");
            return Vec::new();
        };
        let mut out = Vec::new();
        for (i, item) in array.iter().enumerate() {
            let line = self.cx.line(item.span().start);
            let Some(table) = item.get_ref().as_table() else {
                let row = Entry { value: item.get_ref(), line };
                self.wrong(key, &row, "is not a table", "array of tables");
                continue;
            };
            let sub =
                Table::new(self.cx, format!("{}.{i}", self.key(key)), Some(table), Some(line));
            out.push(read(&sub));
            sub.refuse_unknown();
        }
        out
    }

    fn entry(&self, key: &'static str) -> Option<Entry<'c, 'a>> {
        self.known.borrow_mut().insert(key);
        let (k, v) = self.table?.get_key_value(key)?;
        Some(Entry { value: v.get_ref(), line: self.cx.line(k.span().start) })
    }

    fn sub_table(&self, key: &'static str) -> Option<(&'c DeTable<'a>, usize)> {
        let e = self.entry(key)?;
        let table = e.value.as_table();
        if table.is_none() {
            self.wrong(key, &e, &is_a(e.value), "table");
        }
        table.map(|t| (t, e.line))
    }

    fn missing<T>(&self, key: &'static str, allowed: &str, remedy: &str, placeholder: T) -> T {
        if self.table.is_some() {
            self.cx.push(Problem {
                line: self.line,
                key: self.key(key),
                unit: unit_of(key).into(),
                what: "is missing".into(),
                allowed: allowed.into(),
                remedy: remedy.into(),
                ..Problem::default()
            });
        }
        placeholder
    }

    fn wrong(&self, key: &str, e: &Entry<'_, '_>, what: &str, allowed: &str) {
        self.cx.push(Problem {
            line: Some(e.line),
            key: self.key(key),
            value: shown(e.value),
            unit: unit_of(key).into(),
            what: what.into(),
            allowed: allowed.into(),
            remedy: "change the value".into(),
            ..Problem::default()
        });
    }

    fn record(&self, key: &str, e: &Entry<'_, '_>, note: &str) {
        self.cx.values.borrow_mut().push(ReadValue {
            file: self.cx.path.clone(),
            line: Some(e.line),
            key: self.key(key),
            value: shown(e.value),
            unit: unit_of(key).into(),
            note: note.into(),
        });
    }

    fn checked(&self, key: &'static str, e: &Entry<'_, '_>, range: Range, note: &str) -> f64 {
        let Some(x) = number_of(e.value) else {
            self.wrong(key, e, &is_a(e.value), &format!("number, {range}"));
            return f64::NAN;
        };
        if !range.contains(x) {
            let what = if x.is_finite() { "is out of range" } else { "is not a finite number" };
            self.wrong(key, e, what, format!("{range} {}", unit_of(key)).trim_end());
            return f64::NAN;
        }
        self.record(key, e, note);
        x
    }

    fn whole(&self, key: &'static str, e: &Entry<'_, '_>, lo: u32, hi: u32, note: &str) -> u32 {
        let n = match e.value {
            DeValue::Integer(i) => u32::from_str_radix(i.as_str(), i.radix()).ok(),
            _ => None,
        };
        match n {
            Some(n) if (lo..=hi).contains(&n) => {
                self.record(key, e, note);
                n
            }
            _ => {
                let allowed = format!("whole number from {lo} to {hi}");
                self.wrong(key, e, "is not one of the allowed whole numbers", &allowed);
                lo
            }
        }
    }

    /// The numbers of a list; those out of range are reported and left in as NaN.
    fn list(&self, key: &'static str, e: &Entry<'_, '_>, range: Range, allowed: &str) -> Vec<f64> {
        let Some(array) = e.value.as_array() else {
            self.wrong(key, e, &is_a(e.value), allowed);
            return Vec::new();
        };
        let one = |item: &Spanned<DeValue<'_>>| {
            let x = number_of(item.get_ref()).unwrap_or(f64::NAN);
            if range.contains(x) {
                return x;
            }
            let row = Entry { value: item.get_ref(), line: self.cx.line(item.span().start) };
            self.wrong(key, &row, "is not an allowed number", allowed);
            f64::NAN
        };
        array.iter().map(one).collect()
    }

    fn with_note<T>(
        &self,
        key: &'static str,
        allowed: &str,
        placeholder: T,
        read: impl FnOnce(&Entry<'_, '_>, &str) -> T,
    ) -> T {
        let Some(e) = self.entry(key) else {
            return self.missing(key, allowed, &format!("add {key} = {NOTED}"), placeholder);
        };
        let Some(note) = self.note_of(key, &e, NOTED) else { return placeholder };
        let Some(table) = e.value.as_table() else { return placeholder };
        for (k, v) in table {
            if !matches!(k.get_ref().as_ref(), "value" | "source" | "assumed") {
                self.cx.push(Problem {
                    line: Some(self.cx.line(k.span().start)),
                    key: format!("{}.{}", self.key(key), k.get_ref()),
                    value: shown(v.get_ref()),
                    what: "is not a known key".into(),
                    allowed: "value, and source or assumed".into(),
                    remedy: "remove it".into(),
                    ..Problem::default()
                });
            }
        }
        match table.get("value") {
            Some(v) => {
                let inner = Entry { value: v.get_ref(), line: self.cx.line(v.span().start) };
                read(&inner, &note)
            }
            None => {
                self.wrong(key, &e, "has a note but no value", NOTED);
                placeholder
            }
        }
    }

    /// The note of an entry, which is written in this form: exactly one of `source` and `assumed`, not empty.
    fn note_of(&self, key: &'static str, e: &Entry<'_, '_>, form: &str) -> Option<String> {
        let table = e.value.as_table();
        let notes = ["source", "assumed"].map(|k| table?.get(k)?.get_ref().as_str());
        if notes.into_iter().flatten().any(|n| n.chars().any(is_unprintable_in_text)) {
            self.wrong(key, e, "has a note that cannot be printed", "a note of printable text");
            return None;
        }
        let text = |k: &str| {
            let t = table?.get(k)?.get_ref().as_str()?.trim();
            (!t.is_empty()).then(|| format!("{k}: {t}"))
        };
        match (text("source"), text("assumed")) {
            (Some(n), None) | (None, Some(n)) => Some(n),
            (both, _) => {
                let what = if both.is_some() {
                    "has both a source and an assumed note"
                } else {
                    "has no note where it comes from"
                };
                self.cx.push(Problem {
                    line: Some(e.line),
                    key: self.key(key),
                    value: shown(e.value),
                    unit: unit_of(key).into(),
                    what: what.into(),
                    allowed: "one of source = \"…\" (published or measured) and assumed = \"…\""
                        .into(),
                    remedy: format!("write {key} = {form}"),
                    ..Problem::default()
                });
                None
            }
        }
    }

    /// Refuses what nobody asked for.
    fn refuse_unknown(&self) {
        let known = self.known.borrow();
        for (k, v) in self.table.into_iter().flatten() {
            let name = k.get_ref().as_ref();
            if known.contains(name) {
                continue;
            }
            let near = nearest(name, known.iter().copied())
                .filter(|n| n.starts_with(name) || distance(name, n) <= 1 + name.len() / 3);
            // A key that is given already cannot be meant.
            let remedy = match (self.cx.place_of(name), near) {
                (Some(m), _) if self.cx.has_key(&m) => {
                    format!("remove it: `{m}` is given already")
                }
                (Some(m), _) => format!("did you mean `{m}`?"),
                (None, Some(m)) if !self.table.is_some_and(|t| t.contains_key(m)) => {
                    format!("did you mean `{m}`?")
                }
                (None, _) => "remove it".into(),
            };
            self.cx.push(Problem {
                line: Some(self.cx.line(k.span().start)),
                key: self.key(name),
                value: shown(v.get_ref()),
                what: "is not a known key".into(),
                allowed: known.iter().copied().collect::<Vec<_>>().join(", "),
                remedy,
                ..Problem::default()
            });
        }
    }
}

/// What to do about a key that is missing.
fn missing_remedy(key: &str) -> String {
    format!("add the key `{key}`")
}

/// Texts of several lines are texts.
fn is_unprintable_in_text(c: char) -> bool {
    is_unprintable(c) && !matches!(c, '\n' | '\r' | '\t')
}

/// "is a string", "is an array".
fn is_a(value: &DeValue<'_>) -> String {
    let kind = value.type_str();
    let article = if kind.starts_with(['a', 'i']) { "an" } else { "a" };
    format!("is {article} {kind}")
}

fn number_of(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(x) => x.as_str().parse().ok(),
        DeValue::Integer(i) if i.radix() == 10 => i.as_str().parse().ok(),
        _ => None,
    }
}

/// A value on one line, cut when long.
fn shown(value: &DeValue<'_>) -> String {
    let text = match value {
        DeValue::String(s) => format!("\"{s}\""),
        DeValue::Integer(i) => i.to_string(),
        DeValue::Float(x) => x.as_str().to_owned(),
        DeValue::Boolean(b) => b.to_string(),
        DeValue::Datetime(d) => d.to_string(),
        DeValue::Array(a) => {
            let items: Vec<_> = a.iter().map(|v| shown(v.get_ref())).collect();
            format!("[{}]", items.join(", "))
        }
        DeValue::Table(t) => {
            let items: Vec<_> = t
                .iter()
                .map(|(k, v)| format!("{} = {}", k.get_ref(), shown(v.get_ref())))
                .collect();
            format!("{{ {} }}", items.join(", "))
        }
    };
    if text.chars().count() <= 100 {
        return text;
    }
    let mut cut: String = text.chars().take(99).collect();
    cut.push('…');
    cut
}

/// The name most like a given one: one that it begins, else that with the fewest edits between.
/// `None` for a name far longer than any that is known.
pub fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    if name.len() > LONGEST_NAME {
        return None;
    }
    known.map(|n| (!n.starts_with(name), distance(name, n), n)).min().map(|(_, _, n)| n)
}

/// Edits that lead from one word to the other.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut before = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let change = before + usize::from(ca != *cb);
            before = row[j + 1];
            row[j + 1] = change.min(before + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}
