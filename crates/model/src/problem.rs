use core::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use docktwin_core::Digest;

use crate::Sources;
use crate::input::{self, Unreadable};
use crate::text::{plain, shown, shown_path};

/// Problems listed of one file; what is beyond is counted.
pub(crate) const MAX_PROBLEMS: usize = 100;

/// One thing wrong with a file: where, what stands there, what may stand there, what to do.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Problem {
    /// The file, as the caller named it.
    pub file: PathBuf,
    /// Line, from 1; `None` when it has no line (a missing file, a value given on the command line).
    pub line: Option<usize>,
    /// Dotted path of the key, or the element of a URDF.
    pub key: String,
    /// What stands there; empty when nothing does.
    pub value: String,
    /// Unit of the value; empty when it has none.
    pub unit: String,
    /// What is wrong.
    pub what: String,
    /// What is allowed; empty when `what` says all.
    pub allowed: String,
    /// What to do about it.
    pub remedy: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", shown(&self.key))?;
        if !self.value.is_empty() {
            write!(f, " = {}", shown(&self.value))?;
            if !self.unit.is_empty() {
                write!(f, " {}", self.unit)?;
            }
        }
        write!(f, ": {}", one_line(&self.what))?;
        if !self.allowed.is_empty() {
            write!(f, "; allowed: {}", one_line(&self.allowed))?;
            if self.value.is_empty() && !self.unit.is_empty() {
                write!(f, " {}", self.unit)?;
            }
        }
        write!(f, "; {} ", one_line(&self.remedy))?;
        place(f, &self.file, self.line)
    }
}

/// `[file:line]`.
fn place(f: &mut fmt::Formatter<'_>, file: &Path, line: Option<usize>) -> fmt::Result {
    write!(f, "[{}", shown_path(file))?;
    if let Some(line) = line {
        write!(f, ":{line}")?;
    }
    write!(f, "]")
}

/// Words of ours with names from a file among them.
fn one_line(text: &str) -> String {
    plain(text).replace('\n', " ")
}

/// Something read and deliberately not used, or used although it looks wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// The file.
    pub file: PathBuf,
    /// Line, from 1.
    pub line: Option<usize>,
    /// What is ignored or looks wrong, and why.
    pub what: String,
    /// Whether it is used and looks wrong; else it is ignored.
    pub flagged: bool,
}

impl Note {
    /// What became of it: `ignored` or `flagged`.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        if self.flagged { "flagged" } else { "ignored" }
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ", one_line(&self.what))?;
        place(f, &self.file, self.line)
    }
}

/// One value that was read and is used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadValue {
    /// The file.
    pub file: PathBuf,
    /// Line, from 1.
    pub line: Option<usize>,
    /// Dotted path of the key.
    pub key: String,
    /// The value as read.
    pub value: String,
    /// Unit, or empty.
    pub unit: String,
    /// The `source` or `assumed` note, or empty.
    pub note: String,
}

impl fmt::Display for ReadValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", shown(&self.key), shown(&self.value))?;
        if !self.unit.is_empty() {
            write!(f, " {}", self.unit)?;
        }
        if !self.note.is_empty() {
            write!(f, " ({})", one_line(&self.note))?;
        }
        f.write_str(" ")?;
        place(f, &self.file, self.line)
    }
}

/// A file that was read, named by its content.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileDigest {
    /// The file, as the caller named it.
    pub path: PathBuf,
    /// Digest of its bytes.
    pub digest: Digest,
    /// Its bytes, as they were read.
    pub bytes: Arc<[u8]>,
}

impl FileDigest {
    /// A file as it was read.
    #[must_use]
    pub fn new(path: &Path, bytes: Arc<[u8]>) -> Self {
        Self { path: path.into(), digest: Digest::of_bytes(&bytes), bytes }
    }
}

/// All problems of all files of one model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}", lines(problems))]
pub struct ModelErrors {
    /// At least one.
    pub problems: Vec<Problem>,
}

fn lines(problems: &[Problem]) -> String {
    problems.iter().map(Problem::to_string).collect::<Vec<_>>().join("\n")
}

/// A checked model and what was left aside on the way.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded<T> {
    /// The model.
    pub model: T,
    /// What was read but is not used.
    pub notes: Vec<Note>,
    /// Every file the model depends on.
    pub files: Vec<FileDigest>,
}

/// What reading a model found, collected over its files.
#[derive(Clone, Debug, Default)]
pub(crate) struct Findings {
    pub(crate) problems: Vec<Problem>,
    pub(crate) notes: Vec<Note>,
    /// What is read and used although it looks wrong.
    pub(crate) flags: Vec<Note>,
    pub(crate) values: Vec<ReadValue>,
    pub(crate) files: Vec<FileDigest>,
    pub(crate) sources: Sources,
}

impl Findings {
    /// Nothing yet, of files from these sources.
    pub(crate) fn from(sources: &Sources) -> Self {
        Self { sources: sources.clone(), ..Self::default() }
    }

    /// Refuses a file for one of its keys.
    pub(crate) fn refuse(&mut self, file: &Path, key: &str, what: String, remedy: &str) {
        self.problems.push(Problem {
            file: file.into(),
            key: key.into(),
            what,
            remedy: remedy.into(),
            ..Problem::default()
        });
    }

    /// Reads a text file; a failure becomes a problem and an empty text.
    pub(crate) fn read(&mut self, path: &Path, purpose: &str) -> Option<String> {
        let bytes = self.sources.read(path, input::MAX_TEXT_BYTES);
        let text = bytes.and_then(|bytes| {
            let text = input::text_of(&*bytes);
            self.files.push(FileDigest::new(path, bytes));
            text
        });
        text.map_err(|why| self.problems.push(why.problem(path, purpose))).ok()
    }

    /// The model, if nothing was wrong.
    pub(crate) fn finish<T>(self, model: Option<T>) -> Result<Loaded<T>, ModelErrors> {
        match model {
            Some(model) if self.problems.is_empty() => {
                Ok(Loaded { model, notes: self.notes, files: self.files })
            }
            _ => Err(ModelErrors { problems: first_of(self.problems, 0) }),
        }
    }

    /// One digest for all files read so far.
    pub(crate) fn digest(&self) -> Digest {
        let mut h = docktwin_core::StateHasher::new();
        self.files.iter().for_each(|f| h.bytes(&f.digest.0));
        h.finish()
    }
}

impl Unreadable {
    /// As a problem of `file` in its role `key`.
    #[must_use]
    pub fn problem(self, file: &Path, key: &str) -> Problem {
        Problem {
            file: file.into(),
            line: self.line,
            key: key.into(),
            what: self.what,
            allowed: self.allowed,
            remedy: self.remedy,
            ..Problem::default()
        }
    }
}

/// The first of many problems of one file, and the number of the others as the last.
/// `unlisted` were left out before.
pub(crate) fn first_of(mut problems: Vec<Problem>, unlisted: usize) -> Vec<Problem> {
    if problems.len() > MAX_PROBLEMS {
        let more = problems.len() - MAX_PROBLEMS + unlisted;
        let file = problems[0].file.clone();
        problems.truncate(MAX_PROBLEMS);
        problems.push(Problem {
            file,
            key: "more".into(),
            what: format!("{more} more problems are not listed"),
            remedy: "mend those above first".into(),
            ..Problem::default()
        });
    }
    problems
}
