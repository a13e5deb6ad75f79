//! What went wrong, for a person and for a script.

use std::process::ExitCode;

use docktwin::setup::StartOverlap;
use docktwin_model::{ModelErrors, Problem};
use docktwin_record::RecordError;
use docktwin_report::ReportError;
use docktwin_scenario::ScenarioErrors;
use docktwin_view::ViewError;
use miette::Diagnostic;

/// Exit code of a run that ended otherwise than expected.
pub(crate) const OTHERWISE: u8 = 1;
/// Exit code of a defect of ours.
pub(crate) const DEFECT: u8 = 70;
/// Exit code of bad input.
pub(crate) const BAD_INPUT: u8 = 2;

/// Anything that ends a command early.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub(crate) enum Failure {
    /// Problems in files, all of them.
    #[error("{}", list(problems))]
    #[diagnostic(help("`docktwin scenario explain` and `docktwin model check FILE` tell more"))]
    Input {
        /// At least one.
        problems: Vec<Problem>,
    },
    /// A recording could not be written or read.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The viewer's file could not be written.
    #[error(transparent)]
    View(#[from] ViewError),
    /// There is nothing to report on, or no place for the report.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// Bad usage that the parser cannot see.
    #[error("{what}")]
    Usage {
        /// What is wrong.
        what: String,
        /// What to do.
        #[help]
        remedy: String,
    },
}

fn list(problems: &[Problem]) -> String {
    let lines: Vec<String> = problems.iter().map(|p| p.to_string()).collect();
    let many = if problems.len() == 1 {
        "1 problem".to_owned()
    } else {
        format!("{} problems", problems.len())
    };
    format!("{many}\n{}", lines.join("\n"))
}

impl From<ScenarioErrors> for Failure {
    fn from(e: ScenarioErrors) -> Self {
        Self::Input { problems: e.problems }
    }
}

impl From<StartOverlap> for Failure {
    fn from(e: StartOverlap) -> Self {
        Self::Usage {
            what: e.to_string(),
            remedy:
                "give a smaller initial.gap_m (0.01 m suffices), or less lateral speed and rate"
                    .to_owned(),
        }
    }
}

impl From<ModelErrors> for Failure {
    fn from(e: ModelErrors) -> Self {
        Self::Input { problems: e.problems }
    }
}

impl Failure {
    /// Says it on stderr, or as JSON on stdout, and gives the exit code.
    pub(crate) fn report(self, json: bool) -> ExitCode {
        let code = BAD_INPUT;
        if json {
            let problems: Vec<String> = match &self {
                Self::Input { problems } => problems.iter().map(|p| p.to_string()).collect(),
                other => vec![other.to_string()],
            };
            println!("{}", serde_json::json!({ "error": problems, "exit_code": code }));
        } else {
            eprintln!("{:?}", miette::Report::new(self));
        }
        ExitCode::from(code)
    }
}
