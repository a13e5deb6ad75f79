//! Reading a TOML file by the table of its keys.

use crate::keys::{FileKind, Need, Shape};
use crate::toml_check::{Checker, Table};

/// A table of a model file, read as the table of keys says. A key that the table of keys does not have
/// in the shape asked for is a defect of ours, and refused as such.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Section<'t, 'c, 'a> {
    table: &'t Table<'c, 'a>,
    kind: FileKind,
}

/// Reads a file of this kind, and refuses every key not asked for. `None` when the text is not TOML.
pub(crate) fn read<T>(
    checker: &Checker<'_>,
    kind: FileKind,
    read: impl FnOnce(Section<'_, '_, '_>) -> T,
) -> Option<T> {
    checker.read(|table| {
        let t = Section { table, kind };
        t.header();
        read(t)
    })
}

impl Section<'_, '_, '_> {
    /// Version and kind of the file.
    fn header(self) {
        if let Some(Shape::Version(v)) = self.shape("schema")
            && self.table.optional_count("schema", v, v).is_none()
        {
            self.table.refuse("schema", "is missing", format!("add `schema = {v}`"));
        }
        if let Some(Shape::Words(words)) = self.shape("kind") {
            let words: Vec<_> = words.iter().map(|w| (*w, ())).collect();
            self.table.choice("kind", &words);
        }
    }

    fn shape(self, key: &'static str) -> Option<Shape> {
        self.kind.find(&self.table.key(key)).map(|k| k.shape)
    }

    /// Reports a key that stands in the table of keys otherwise, or not at all.
    fn defect(self, key: &'static str) {
        let what = "is read otherwise than docktwin's own table of keys says";
        self.table.refuse(key, what, "this is a defect of docktwin: report it");
    }

    /// Whether the key stands in the table.
    pub(crate) fn has(self, key: &'static str) -> bool {
        self.table.has(key)
    }

    /// Whether the table of keys has a table of this name here.
    pub(crate) fn knows(self, table: &'static str) -> bool {
        self.need(table).is_some()
    }

    /// Reports that a value is wrong for a reason that its shape does not say.
    pub(crate) fn refuse(
        self,
        key: &'static str,
        what: impl Into<String>,
        remedy: impl Into<String>,
    ) {
        self.table.refuse(key, what, remedy);
    }

    /// A number with its note; NaN when it is absent or wrong.
    pub(crate) fn number(self, key: &'static str) -> f64 {
        match self.shape(key) {
            Some(Shape::Number(range)) => self.table.noted(key, range),
            _ => {
                self.defect(key);
                f64::NAN
            }
        }
    }

    /// A number that may be absent.
    pub(crate) fn optional_number(self, key: &'static str) -> Option<f64> {
        let need = self.kind.find(&self.table.key(key)).map(|k| k.need);
        if !matches!(need, Some(Need::Optional(_))) {
            self.defect(key);
        }
        self.has(key).then(|| self.number(key))
    }

    /// A whole number with its note.
    pub(crate) fn count(self, key: &'static str) -> u32 {
        match self.shape(key) {
            Some(Shape::Count(lo, hi)) => self.table.noted_count(key, lo, hi),
            _ => {
                self.defect(key);
                0
            }
        }
    }

    /// `N` numbers with one note.
    pub(crate) fn list<const N: usize>(self, key: &'static str) -> [f64; N] {
        match self.shape(key) {
            Some(Shape::List(n, range)) if n == N => self.table.noted_list(key, range),
            _ => {
                self.defect(key);
                [f64::NAN; N]
            }
        }
    }

    /// Rows of `N` numbers with one note.
    pub(crate) fn rows<const N: usize>(self, key: &'static str) -> Vec<[f64; N]> {
        match self.shape(key) {
            Some(Shape::Rows(rows, n, range)) if n == N => self.table.noted_rows(key, range, rows),
            _ => {
                self.defect(key);
                Vec::new()
            }
        }
    }

    /// Every note of this table on a number of the URDF.
    pub(crate) fn notes(self) {
        let here = self.table.path();
        for (_, k) in self.kind.keys().filter(|(t, k)| *t == here && k.shape == Shape::Note) {
            self.table.note_only(k.name);
        }
    }

    /// A text.
    pub(crate) fn text(self, key: &'static str) -> String {
        match self.shape(key) {
            Some(Shape::Text(what)) => self.table.text(key, what),
            _ => {
                self.defect(key);
                String::new()
            }
        }
    }

    /// One of the words that `words` gives a meaning; they are those of the table of keys.
    pub(crate) fn choice<T: Copy>(self, key: &'static str, words: &[(&str, T)]) -> Option<T> {
        match self.shape(key) {
            Some(Shape::Words(known)) if known.iter().eq(words.iter().map(|(w, _)| w)) => {
                self.table.choice(key, words)
            }
            _ => {
                self.defect(key);
                None
            }
        }
    }

    /// As [`Self::choice`], of a key that may be absent.
    pub(crate) fn optional_choice<T: Copy>(
        self,
        key: &'static str,
        words: &[(&str, T)],
    ) -> Option<T> {
        self.has(key).then(|| self.choice(key, words)).flatten()
    }

    /// What the table of keys says of a table.
    fn need(self, key: &'static str) -> Option<(Need, Option<usize>)> {
        self.kind.find_table(&self.table.key(key)).map(|h| (h.need, h.times))
    }

    /// A table that must be there, here at least.
    pub(crate) fn section<T>(
        self,
        key: &'static str,
        read: impl FnOnce(Section<'_, '_, '_>) -> T,
    ) -> T {
        if !matches!(self.need(key), Some((Need::Required | Need::Where(_), None))) {
            self.defect(key);
        }
        self.table.section(key, |table| read(Section { table, kind: self.kind }))
    }

    /// A table that may be absent.
    pub(crate) fn optional_section<T>(
        self,
        key: &'static str,
        read: impl FnOnce(Section<'_, '_, '_>) -> T,
    ) -> Option<T> {
        if !matches!(self.need(key), Some((Need::Optional(_), None))) {
            self.defect(key);
        }
        self.table.optional_section(key, |table| read(Section { table, kind: self.kind }))
    }

    /// A list of tables, empty when the key is absent; the caller compares their number.
    pub(crate) fn sections<T>(
        self,
        key: &'static str,
        mut read: impl FnMut(Section<'_, '_, '_>) -> T,
    ) -> Vec<T> {
        if !matches!(self.need(key), Some((_, Some(_)))) {
            self.defect(key);
        }
        self.table.sections(key, |table| read(Section { table, kind: self.kind }))
    }
}
