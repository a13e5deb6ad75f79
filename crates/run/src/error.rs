//! Why a run cannot begin or go on.

use docktwin_hil::scheduler::{ArmError, SetupProblems};
use docktwin_model::{ModelErrors, Problem};
use docktwin_record::RecordError;
use docktwin_rigport::rig::RigError;
use docktwin_scenario::ScenarioErrors;

use crate::{rigfile::RigFileError, setup::StartOverlap};

/// Why a sink failed.
pub type SinkError = Box<dyn std::error::Error + Send + Sync>;

/// Why a run cannot begin or go on. A rig that stops, a disk that fills up and an outcome that was not
/// expected are no errors: they end a run with a summary.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Problems of a scenario or a model, all of them.
    #[error("{}", problems.iter().map(Problem::to_string).collect::<Vec<_>>().join("\n"))]
    Input {
        /// At least one.
        problems: Vec<Problem>,
    },
    /// The sides overlap at the start.
    #[error(transparent)]
    Overlap(#[from] StartOverlap),
    /// A recording cannot be begun or read.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A sink cannot be opened.
    #[error(transparent)]
    Sink(SinkError),
    /// A file of `rig identify` or `rig calibrate` cannot be used.
    #[error(transparent)]
    RigFile(#[from] RigFileError),
    /// The rig was not armed.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// There is no rig, or the connection to it is broken.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// Options that do not go together, or a file that does not fit.
    #[error("{what}")]
    Usage {
        /// What is wrong.
        what: String,
        /// What to do.
        remedy: String,
    },
}

impl RunError {
    /// Bad input: what is wrong, and what to do about it.
    pub fn usage(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Usage { what: what.into(), remedy: remedy.into() }
    }

    /// What to do about it; empty where the error itself says it.
    #[must_use]
    pub fn remedy(&self) -> &str {
        match self {
            Self::Usage { remedy, .. } => remedy,
            Self::Overlap(_) => "give a smaller initial.gap_m, or less lateral speed and rate",
            Self::RigFile(RigFileError::Write { .. }) => {
                "files are never overwritten: give a new one with --out"
            }
            Self::RigFile(_) => {
                "give a file that `docktwin rig identify` or `rig calibrate` wrote for this rig"
            }
            Self::Arm(_) => "fix what failed and arm again; nothing has moved",
            _ => "",
        }
    }
}

impl From<ScenarioErrors> for RunError {
    fn from(e: ScenarioErrors) -> Self {
        Self::Input { problems: e.problems }
    }
}

impl From<SetupProblems> for RunError {
    fn from(e: SetupProblems) -> Self {
        Self::usage(e.to_string(), "correct the scenario or the option that gives it")
    }
}

impl From<ModelErrors> for RunError {
    fn from(e: ModelErrors) -> Self {
        Self::Input { problems: e.problems }
    }
}
