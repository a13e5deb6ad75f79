//! Every key of the model files once: what may stand behind it, whether it must be there, what it means
//! and why it is needed.
//!
//! The loaders read by these tables (`keys::read`), `model explain` and `docs/models.md` show
//! them: a range, a word or a unit stands nowhere else.
//!
//! ```
//! use docktwin_model::keys::{FileKind, explained};
//! let ring = explained(Some(FileKind::MechanismActive), Some("ring.mean_radius_m"))?;
//! assert_eq!(ring[0].allowed, "number, m, > 0 and ≤ 5; required");
//! # Ok::<(), docktwin_model::keys::UnknownKey>(())
//! ```

mod drive;
mod explain;
mod mechanism;
mod page;
pub(crate) mod read;
mod rig;
mod spacecraft;

use std::path::Path;

pub use explain::{Explained, UnknownKey, explained, without_indices};
pub use mechanism::contact_ranges;
pub(crate) use mechanism::{NORMAL_LAWS, SURFACE_KINDS, SurfaceKind};
pub use page::markdown;

use crate::toml_check::{Checker, Range};

/// What a model file describes; the word of its key `kind`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// A chaser or a target.
    Spacecraft,
    /// The active side of a docking mechanism, on the chaser.
    MechanismActive,
    /// The passive side, on the target.
    MechanismPassive,
    /// A motion simulator.
    Rig,
}

impl FileKind {
    /// Words by which files name the kinds.
    pub const WORDS: [(&'static str, Self); 4] = [
        ("spacecraft", Self::Spacecraft),
        ("mechanism_active", Self::MechanismActive),
        ("mechanism_passive", Self::MechanismPassive),
        ("rig", Self::Rig),
    ];

    /// The word of this kind.
    #[must_use]
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, k)| *k == self).map_or("", |(w, _)| w)
    }

    /// The keys of its TOML, in the order in which the shipped files have them.
    #[must_use]
    pub const fn groups(self) -> &'static [Group] {
        match self {
            Self::Spacecraft => spacecraft::SPACECRAFT,
            Self::MechanismActive => mechanism::ACTIVE,
            Self::MechanismPassive => mechanism::PASSIVE,
            Self::Rig => rig::RIG,
        }
    }

    /// The entry of a key, given with or without indices of lists of tables.
    #[must_use]
    pub fn find(self, path: &str) -> Option<&'static Key> {
        let plain = without_indices(path);
        self.keys().find(|(table, k)| is_key(&plain, table, k.name)).map(|(_, k)| k)
    }

    /// The entry of a table.
    #[must_use]
    pub fn find_table(self, path: &str) -> Option<&'static Heading> {
        let plain = without_indices(path);
        self.groups().iter().flat_map(|g| g.tables).find(|h| h.path == plain)
    }

    /// Every key with the table it stands in.
    pub fn keys(self) -> impl Iterator<Item = (&'static str, &'static Key)> {
        self.groups()
            .iter()
            .flat_map(|g| g.tables.iter().flat_map(|h| g.keys.iter().map(|k| (h.path, k))))
    }
}

impl FileKind {
    /// A checker of such a file that knows where each key belongs.
    pub(crate) fn checker<'a>(self, path: &Path, text: &'a str) -> Checker<'a> {
        Checker::new(path, text).with_places(self.keys().map(|(table, k)| (table, k.name)))
    }
}

/// Whether `path` is `name` in `table`.
fn is_key(path: &str, table: &str, name: &str) -> bool {
    match path.rsplit_once('.') {
        Some((t, n)) => t == table && n == name,
        None => table.is_empty() && path == name,
    }
}

/// Dotted path of a key.
fn dotted(table: &str, name: &str) -> String {
    if table.is_empty() { name.to_owned() } else { format!("{table}.{name}") }
}

/// What may stand behind a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Version of the file format.
    Version(u32),
    /// A text, and what it says.
    Text(&'static str),
    /// One of a few words.
    Words(&'static [&'static str]),
    /// A number with a note where it comes from.
    Number(Range),
    /// A whole number, from and to, with a note.
    Count(u32, u32),
    /// So many numbers with one note.
    List(usize, Range),
    /// So many rows of so many numbers with one note; `None` for two rows or more.
    Rows(Option<usize>, usize, Range),
    /// A note alone: the number itself stands in the URDF.
    Note,
}

/// Whether a key or a table must be there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// Always.
    Required,
    /// Where the text says, and refused elsewhere.
    Where(&'static str),
    /// It may be left out; the text says what then holds.
    Optional(&'static str),
}

/// One key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// Name within its table.
    pub name: &'static str,
    /// What may stand behind it.
    pub shape: Shape,
    /// Whether it must be there.
    pub need: Need,
    /// A value that is taken, without its note.
    pub example: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// Why it is needed: what it decides, and what a larger or smaller value does.
    pub why: &'static str,
}

const fn key(
    name: &'static str,
    shape: Shape,
    example: &'static str,
    meaning: &'static str,
    why: &'static str,
) -> Key {
    Key { name, shape, need: Need::Required, example, meaning, why }
}

impl Key {
    /// The same, needed only where `condition` says.
    const fn only(self, condition: &'static str) -> Self {
        Self { need: Need::Where(condition), ..self }
    }

    /// The same, which may be left out; `otherwise` says what then holds.
    const fn optional(self, otherwise: &'static str) -> Self {
        Self { need: Need::Optional(otherwise), ..self }
    }
}

/// One table of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heading {
    /// Dotted path; empty for the file itself.
    pub path: &'static str,
    /// Whether it must be there.
    pub need: Need,
    /// How often a list of tables has it, 0 for any number; `None` for a table that is no list.
    pub times: Option<usize>,
    /// What it describes.
    pub meaning: &'static str,
}

const fn table(path: &'static str, need: Need, meaning: &'static str) -> Heading {
    Heading { path, need, times: None, meaning }
}

const fn tables(path: &'static str, times: usize, meaning: &'static str) -> Heading {
    Heading { path, need: Need::Required, times: Some(times), meaning }
}

/// A list of tables of any length, none included.
const fn any_number(path: &'static str, otherwise: &'static str, meaning: &'static str) -> Heading {
    Heading { path, need: Need::Optional(otherwise), times: Some(0), meaning }
}

/// Tables that have the same keys.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Group {
    /// The tables.
    pub tables: &'static [Heading],
    /// Their keys.
    pub keys: &'static [Key],
}

/// Names of a list of words and what they stand for.
const fn names<T: Copy, const N: usize>(words: &[(&'static str, T); N]) -> [&'static str; N] {
    let mut out = [""; N];
    let mut i = 0;
    while i < N {
        out[i] = words[i].0;
        i += 1;
    }
    out
}

const SCHEMA: Key = key(
    "schema",
    Shape::Version(1),
    "1",
    "Version of this file format.",
    "A file of another version would be misread; it is refused.",
);
