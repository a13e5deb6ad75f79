//! What can go wrong on the way from a recording to a picture.

use std::path::PathBuf;

use docktwin_record::RecordError;
use docktwin_scenario::ScenarioErrors;
use docktwin_view::ViewError;

/// Why a recording cannot be shown.
#[derive(Debug, thiserror::Error)]
pub enum PlaybackError {
    /// The recording lacks what a scene is made of.
    #[error("the recording has no columns {}: it was made by another version", missing.join(", "))]
    Columns {
        /// Their names.
        missing: Vec<String>,
    },
    /// The recording cannot be read.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The scenario beside the recording cannot be read.
    #[error(transparent)]
    Scenario(#[from] ScenarioErrors),
    /// The runs are to be laid over each other at their first contacts, and one has none.
    #[error("nothing touches in {}", run.display())]
    NothingTouches {
        /// Its directory.
        run: PathBuf,
    },
    /// The runs dock with other shapes.
    #[error(
        "{} and {} dock with different mechanisms, which cannot be laid over each other:\n{}",
        a.display(),
        b.display(),
        differences.join("\n")
    )]
    Mechanisms {
        /// Directory of run A.
        a: PathBuf,
        /// Directory of run B.
        b: PathBuf,
        /// What differs, one line each.
        differences: Vec<String>,
    },
    /// The scene cannot be written.
    #[error(transparent)]
    View(#[from] ViewError),
}
