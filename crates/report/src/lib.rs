//! One self-contained HTML page of a run: verdict, summary, pictures of the key moments, plots, and
//! every contact in words. And what studies found as tables, plots and words: [`study`].
//!
//! It reads a run directory as [`docktwin_record`] writes it and works on what is left of one: no
//! summary, a cut log, missing models. The page says first what is missing, and up to when it can be
//! trusted; what is damaged, edited or of another run gives no verdict and no load. It refers to nothing outside itself and has no script.
//!
//! ```
//! # let run = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
//! # let run = run.join("../record/tests/recordings/schema-1/docking");
//! # let out = tempfile::tempdir().unwrap();
//! # let out = out.path().join("report.html");
//! let written = docktwin_report::write(&run, &out)?;
//! let page = std::fs::read_to_string(&written.path).unwrap();
//! assert!(page.starts_with("<!DOCTYPE html>") && !page.contains("<script"));
//! # Ok::<(), docktwin_report::ReportError>(())
//! ```
//!
//! Absent on purpose: physics of its own. What the page says is in the record, or is geometry of it; what is
//! said of a study is in its result.

#![cfg_attr(test, expect(clippy::unwrap_used, reason = "a test stops at the first surprise"))]

mod curves;
mod geometry;
mod load;
mod moments;
mod page;
mod picture;
mod story;
pub mod study;
mod words;

use std::fs;
use std::path::{Path, PathBuf};

use docktwin_record::RecordError;

pub use load::Run;
pub use story::{Contact, Pair, Part, Peak};

/// Why there is no report. Each text ends with the path it is about.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// Nothing in the directory can be read.
    #[error(
        "there is no run to report on: {why}; give a directory that `docktwin rehearse` wrote: {}",
        path.display()
    )]
    Nothing {
        /// What was found instead.
        why: String,
        /// The directory.
        path: PathBuf,
    },
    /// Reading failed half way.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The page could not be written.
    #[error("could not write the report: {source}; choose another place with --out: {}", path.display())]
    Write {
        /// The system's reason.
        source: std::io::Error,
        /// The file.
        path: PathBuf,
    },
}

/// A report that was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// The page.
    pub path: PathBuf,
    /// Its size, bytes.
    pub bytes: u64,
    /// Why the run is incomplete, if it is.
    pub incomplete: Option<String>,
    /// Whether log, summary and models are those that the run wrote, as far as they go.
    pub as_recorded: bool,
}

/// Reads a run and writes its page; an existing page is replaced.
///
/// # Errors
/// There is nothing to read, or the page cannot be written.
pub fn write(run: &Path, out: &Path) -> Result<Written, ReportError> {
    let run = Run::read(run)?;
    let html = page::html(&run);
    let failed = |source| ReportError::Write { source, path: out.into() };
    // First beside, so that a full disk leaves no half page.
    let half = out.with_extension("html.part");
    let done = fs::write(&half, &html).and_then(|()| fs::rename(&half, out));
    if let Err(e) = done {
        // The part may not be there; the error that matters is the first.
        let _ = fs::remove_file(&half);
        return Err(failed(e));
    }
    let bytes = html.len() as u64;
    let Run { incomplete, as_recorded, .. } = run;
    Ok(Written { path: out.into(), bytes, incomplete, as_recorded })
}
