use std::io;
use std::path::{Path, PathBuf};

use crate::ColumnProblem;

/// Why a run could not be recorded or read. Each text ends with the path it is about.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// Columns that no recording can have; all problems at once.
    #[error("the columns cannot be recorded:{}", lines(.0))]
    Columns(Vec<ColumnProblem>),

    /// The directory already holds a recording, which is never overwritten.
    #[error("a recording is already there; choose another --out or remove it first: {}", .path.display())]
    Exists {
        /// The recording found.
        path: PathBuf,
    },

    /// A file could not be written or read.
    #[error("could not {action}: {reason}; {remedy}: {}", .path.display())]
    Io {
        /// What was tried, as an infinitive.
        action: &'static str,
        /// Class of the failure.
        kind: io::ErrorKind,
        /// The system's words.
        reason: String,
        /// What to do about it.
        remedy: &'static str,
        /// The file or directory.
        path: PathBuf,
    },

    /// A row with another number of cells than there are columns.
    #[error(
        "tick {tick} brings {found} cells for {expected} columns; give one cell per column, in the \
         order of RunWriter::create"
    )]
    RowLength {
        /// The tick refused.
        tick: u64,
        /// Cells given.
        found: usize,
        /// Columns declared.
        expected: usize,
    },

    /// A tick that does not follow the one before.
    #[error("tick {tick} comes after tick {last}; ticks must increase")]
    TickOrder {
        /// The tick refused.
        tick: u64,
        /// The last tick recorded.
        last: u64,
    },

    /// Written by a newer docktwin.
    #[error(
        "this recording has schema {found} and this docktwin reads schemas up to {supported}; read \
         it with the docktwin that wrote it, or a newer one: {}", .path.display()
    )]
    Newer {
        /// Schema of the file.
        found: u32,
        /// Newest schema this build knows.
        supported: u32,
        /// The file.
        path: PathBuf,
    },

    /// Not a recording of ours, or one that died before its first byte of content.
    #[error(
        "not a docktwin recording: {why}; give a run directory that docktwin made, or another copy: {}",
        .path.display()
    )]
    NotARecording {
        /// What is missing.
        why: String,
        /// The file.
        path: PathBuf,
    },

    /// Two recordings without the same columns cannot be compared.
    #[error("the recordings have different columns, so their ticks cannot be compared:{}", lines(.0))]
    ColumnsDiffer(Vec<String>),

    /// A tick or column asked for that the recording has not.
    #[error("{what} is not in the recording; {remedy}: {}", .path.display())]
    Absent {
        /// What was asked for.
        what: String,
        /// What to do about it.
        remedy: &'static str,
        /// The file.
        path: PathBuf,
    },

    /// A form of export that cannot hold the recording.
    #[error("the recording cannot be exported: {why}: {}", .path.display())]
    Export {
        /// Why, and what to do.
        why: String,
        /// The file to be written.
        path: PathBuf,
    },

    /// A recording thread ended without a reason.
    #[error(
        "the recording thread ended without a reason; this is a defect of docktwin, please report it"
    )]
    Defect,
}

fn lines<T: core::fmt::Display>(items: &[T]) -> String {
    items.iter().map(|i| format!("\n  - {i}")).collect()
}

impl RecordError {
    /// A file beside a recording that could not be written or read; `action` is an infinitive.
    #[must_use]
    pub fn of_file(action: &'static str, path: &Path, e: &io::Error) -> Self {
        Self::io(action, path, e)
    }

    pub(crate) fn io(action: &'static str, path: &Path, e: &io::Error) -> Self {
        let remedy = match e.kind() {
            io::ErrorKind::StorageFull
            | io::ErrorKind::QuotaExceeded
            | io::ErrorKind::FileTooLarge => "free some space or choose another disk with --out",
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                "choose a directory you may write to with --out"
            }
            io::ErrorKind::NotFound => "check the path",
            _ => "check the disk and the path",
        };
        Self::Io { action, kind: e.kind(), reason: e.to_string(), remedy, path: path.into() }
    }

    pub(crate) fn parquet(
        action: &'static str,
        path: &Path,
        e: parquet::errors::ParquetError,
    ) -> Self {
        use parquet::errors::ParquetError;
        // Parquet wraps the system's error; its kind decides the remedy.
        match e {
            ParquetError::External(inner) => match inner.downcast::<io::Error>() {
                Ok(e) => Self::io(action, path, &e),
                Err(other) => Self::io(action, path, &io::Error::other(other)),
            },
            other => Self::io(action, path, &io::Error::other(other)),
        }
    }
}
