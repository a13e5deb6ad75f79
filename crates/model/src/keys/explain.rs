//! The tables of keys in words.

use super::{FileKind, Group, Heading, Key, Need, Shape, dotted};
use crate::input::shown;
use crate::toml_check::{Range, nearest, unit_of};

/// One key as `model explain` and scripts see it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Explained {
    /// Kinds of file that have it.
    pub files: Vec<&'static str>,
    /// Dotted path; of a list of tables without the index.
    pub key: String,
    /// What it means.
    pub meaning: &'static str,
    /// Why it is needed.
    pub why: &'static str,
    /// Unit; empty for none.
    pub unit: &'static str,
    /// Kind of value, unit, range, and whether it is required, in words.
    pub allowed: String,
    /// A line of a file that gives it.
    pub example: String,
}

/// A key that no file has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{key}` is no key of a {of}{}", question(nearest))]
pub struct UnknownKey {
    /// What has no such key.
    pub of: &'static str,
    /// What was asked for, printable and cut when long.
    pub key: String,
    /// The key most like it; empty when none is.
    pub nearest: String,
}

fn question(nearest: &str) -> String {
    if nearest.is_empty() { String::new() } else { format!("; did you mean `{nearest}`?") }
}

impl UnknownKey {
    /// `asked` among the dotted keys `known`.
    pub fn among<'a>(
        of: &'static str,
        asked: &str,
        known: impl Iterator<Item = &'a str> + Clone,
    ) -> Self {
        // The last word alone may be meant, without its table.
        let of_a_table = known.clone().find(|k| k.rsplit('.').next() == Some(asked));
        let nearest = of_a_table.or_else(|| nearest(asked, known)).unwrap_or_default().to_owned();
        Self { of, key: shown(asked), nearest }
    }
}

/// A dotted path without the indices of lists of tables: `thrust.0.on` as `thrust.on`.
#[must_use]
pub fn without_indices(path: &str) -> String {
    let names = path.split('.').filter(|p| p.parse::<usize>().is_err());
    names.collect::<Vec<_>>().join(".")
}

/// One key, all keys of one table, or every key; of one kind of file, or of all.
///
/// # Errors
/// No key and no table has this name.
pub fn explained(kind: Option<FileKind>, key: Option<&str>) -> Result<Vec<Explained>, UnknownKey> {
    let plain = key.map(without_indices);
    let wanted = |k: &str| {
        plain.as_ref().is_none_or(|p| {
            k == p || k.strip_prefix(p.as_str()).is_some_and(|rest| rest.starts_with('.'))
        })
    };
    let kinds = FileKind::WORDS.into_iter().filter(|(_, k)| kind.is_none_or(|want| want == *k));
    let mut out: Vec<Explained> = Vec::new();
    let mut all = Vec::new();
    for (word, kind) in kinds {
        for (table, k) in kind.keys() {
            let path = dotted(table, k.name);
            if wanted(&path) {
                add(&mut out, word, &path, k);
            }
            all.push(path);
        }
    }
    if out.is_empty() {
        let asked = plain.unwrap_or_default();
        return Err(UnknownKey::among("model", &asked, all.iter().map(String::as_str)));
    }
    Ok(out)
}

/// Adds a key, or its kind of file to the entry that says the same of another kind.
fn add(out: &mut Vec<Explained>, word: &'static str, path: &str, k: &Key) {
    let entry = Explained {
        files: vec![word],
        key: path.to_owned(),
        meaning: k.meaning,
        why: k.why,
        unit: unit_of(k.name),
        allowed: allowed(k),
        example: example(k),
    };
    let same =
        |e: &&mut Explained| Explained { files: entry.files.clone(), ..(**e).clone() } == entry;
    match out.iter_mut().find(same) {
        Some(known) => known.files.push(word),
        None => out.push(entry),
    }
}

/// A line of a file that gives the key.
pub(super) fn example(k: &Key) -> String {
    match k.shape {
        Shape::Version(_) | Shape::Text(_) | Shape::Words(_) | Shape::Note => {
            format!("{} = {}", k.name, k.example)
        }
        _ => format!("{} = {{ value = {}, source = \"…\" }}", k.name, k.example),
    }
}

/// Kind of value, unit and range, on one line.
pub(super) fn value(k: &Key) -> String {
    let unit = match unit_of(k.name) {
        "" => "no unit",
        unit => unit,
    };
    match k.shape {
        Shape::Version(v) => v.to_string(),
        Shape::Text(what) => what.to_owned(),
        Shape::Words(words) => words.join(" | "),
        Shape::Number(r) => format!("number, {unit}, {}", range(r)),
        Shape::Count(lo, hi) => format!("whole number, {lo} to {hi}"),
        Shape::List(n, r) => format!("{n} numbers, {unit}, each {}", range(r)),
        Shape::Rows(Some(rows), n, r) => {
            format!("{rows} rows of {n} numbers, {unit}, each {}", range(r))
        }
        Shape::Rows(None, n, r) => {
            format!("two or more rows of {n} numbers, {unit}, each {}", range(r))
        }
        Shape::Note => "note alone".to_owned(),
    }
}

/// Kind of value, unit, range, and whether it is required, on one line.
fn allowed(k: &Key) -> String {
    format!("{}; {}", value(k), needed(k.need))
}

/// Whether it must be there.
pub(super) fn needed(need: Need) -> String {
    match need {
        Need::Required => "required".to_owned(),
        Need::Where(condition) => format!("required where {condition}"),
        Need::Optional(otherwise) => format!("optional; {otherwise}"),
    }
}

/// A range with large and small numbers as powers of ten.
fn range(r: Range) -> String {
    let words: Vec<String> = r.to_string().split(' ').map(short).collect();
    words.join(" ")
}

fn short(word: &str) -> String {
    match word.parse::<f64>() {
        Ok(x) if x != 0.0 && !(1e-3..1e5).contains(&x.abs()) => format!("{x:e}"),
        _ => word.to_owned(),
    }
}

/// How a table stands in a file.
pub(super) fn bracketed(h: &Heading) -> String {
    match h.times {
        Some(_) => format!("[[{}]]", h.path),
        None => format!("[{}]", h.path),
    }
}

impl Group {
    /// Whether the keys of both are one list.
    pub(super) fn has_keys_of(&self, other: &Self) -> bool {
        !self.keys.is_empty() && core::ptr::eq(self.keys, other.keys)
    }
}
