//! What went wrong, for a person and for a script.

use std::{io::Write as _, process::ExitCode};

use docktwin_control::response::ResponseError;
use docktwin_model::{
    ModelErrors, Problem,
    input::{plain, shown, shown_path},
};
use docktwin_physics::bench::BenchError;
use docktwin_pilot::PilotError;
use docktwin_playback::{LiveError, PlaybackError};
use docktwin_record::RecordError;
use docktwin_report::ReportError;
use docktwin_run::{RunError, SinkError};
use docktwin_scenario::ScenarioErrors;
use docktwin_study::{
    crosscheck::EngineError, mechanism::MechanismError, rig::RigError, single_dof::SingleDofError,
};
use docktwin_view::ViewError;
use miette::Diagnostic;

/// Exit code of a run that ended otherwise than expected.
pub(crate) const OTHERWISE: u8 = 1;
/// Exit code of a run that the safety supervisor stopped, when that was not expected.
pub(crate) const STOPPED: u8 = 3;
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
    /// Nobody can look on.
    #[error(transparent)]
    Live(#[from] LiveError),
    /// Nobody can fly.
    #[error(transparent)]
    Pilot(#[from] PilotError),
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

impl From<PlaybackError> for Failure {
    fn from(e: PlaybackError) -> Self {
        let remedy = match &e {
            PlaybackError::Columns { .. } => {
                "show it with the version that made it, or rehearse again"
            }
            PlaybackError::NothingTouches { .. } => "align the runs at their start: --align start",
            PlaybackError::Mechanisms { .. } => {
                "view each by itself; `docktwin diff` compares their numbers"
            }
            PlaybackError::Record(_) | PlaybackError::Scenario(_) | PlaybackError::View(_) => "",
        };
        match e {
            PlaybackError::Record(e) => Self::Record(e),
            PlaybackError::Scenario(e) => e.into(),
            PlaybackError::View(e) => Self::View(e),
            other => Self::Usage { what: other.to_string(), remedy: remedy.to_owned() },
        }
    }
}

impl From<RunError> for Failure {
    fn from(e: RunError) -> Self {
        match e {
            RunError::Input { problems } => Self::Input { problems },
            RunError::Record(e) => Self::Record(e),
            RunError::Sink(e) => Self::from(e),
            other => Self::Usage { what: other.to_string(), remedy: other.remedy().to_owned() },
        }
    }
}

/// A sink says what it could not begin as whatever error it has.
impl From<SinkError> for Failure {
    fn from(e: SinkError) -> Self {
        let known = e
            .downcast::<RecordError>()
            .map(|e| Self::Record(*e))
            .or_else(|e| e.downcast::<ViewError>().map(|e| Self::View(*e)))
            .or_else(|e| e.downcast::<PlaybackError>().map(|e| Self::from(*e)))
            .or_else(|e| e.downcast::<RunError>().map(|e| Self::from(*e)));
        known.unwrap_or_else(|e| Self::Usage {
            what: e.to_string(),
            remedy: "give another directory with --out".to_owned(),
        })
    }
}

impl From<ModelErrors> for Failure {
    fn from(e: ModelErrors) -> Self {
        Self::Input { problems: e.problems }
    }
}

impl From<RigError> for Failure {
    fn from(e: RigError) -> Self {
        let remedy = match &e {
            RigError::Singular => {
                "`docktwin model check FILE` says where; make the workspace smaller or the \
                 platform larger"
            }
            RigError::Response { source: ResponseError::Rig(_), .. } => {
                "the loop is unstable there: `docktwin analyze stiffness` tells its poles; lower \
                 the gains with --set, or give a smaller --amplitude-mm"
            }
            RigError::Response { .. } => "mend the rig file, or the settings given with --set",
            RigError::NoOil { .. } | RigError::Options { .. } => e.remedy(),
        };
        Self::Usage { what: e.to_string(), remedy: remedy.to_owned() }
    }
}

impl From<MechanismError> for Failure {
    fn from(e: MechanismError) -> Self {
        let remedy = match e {
            MechanismError::Bench(BenchError::Rigid) => {
                "give a mechanism whose ring moves; where the file describes more than its default, \
                 choose with --attenuation characteristic or --attenuation differential"
            }
            _ => e.remedy(),
        };
        Self::Usage { what: e.to_string(), remedy: remedy.to_owned() }
    }
}

impl From<SingleDofError> for Failure {
    fn from(e: SingleDofError) -> Self {
        Self::Usage { what: e.to_string(), remedy: e.remedy().to_owned() }
    }
}

impl From<EngineError> for Failure {
    fn from(e: EngineError) -> Self {
        let remedy = match &e {
            EngineError::NoValidation => "name it: --validation DIR".to_owned(),
            EngineError::NoPython { .. } | EngineError::Incomplete { .. } => {
                format!("{}: --python PATH, or DOCKTWIN_PYTHON in the environment", e.remedy())
            }
            _ => e.remedy(),
        };
        Self::Usage { what: e.to_string(), remedy }
    }
}

/// A failure as it is printed: colours are ours, everything else is printable.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{text}")]
struct Said {
    text: String,
    #[help]
    help: Option<String>,
}

/// A problem as scripts get it.
pub(crate) fn problem_json(p: &Problem) -> serde_json::Value {
    serde_json::json!({
        "file": shown_path(&p.file),
        "line": p.line,
        "key": shown(&p.key),
        "value": shown(&p.value),
        "unit": p.unit,
        "what": plain(&p.what),
        "allowed": plain(&p.allowed),
        "remedy": plain(&p.remedy),
    })
}

impl Failure {
    /// 70 for what only a defect of ours can cause, 2 otherwise.
    pub(crate) const fn exit_code(&self) -> u8 {
        match self {
            Self::Record(
                RecordError::Defect | RecordError::RowLength { .. } | RecordError::TickOrder { .. },
            )
            | Self::View(ViewError::Encode { .. }) => DEFECT,
            _ => BAD_INPUT,
        }
    }

    /// The problem in fields; a failure without a file has a `what` and a `remedy`.
    fn problems(&self) -> Vec<Problem> {
        match self {
            Self::Input { problems } => problems.clone(),
            Self::Record(e) => vec![Problem {
                file: match e {
                    RecordError::Exists { path }
                    | RecordError::Io { path, .. }
                    | RecordError::Newer { path, .. }
                    | RecordError::NotARecording { path, .. }
                    | RecordError::Absent { path, .. } => path.clone(),
                    _ => Default::default(),
                },
                key: "recording".to_owned(),
                what: e.to_string(),
                ..Problem::default()
            }],
            other => vec![Problem {
                key: "usage".to_owned(),
                what: other.to_string(),
                remedy: other.help().map(|h| h.to_string()).unwrap_or_default(),
                ..Problem::default()
            }],
        }
    }

    /// Says it on stderr, or as JSON on stdout, and gives the exit code.
    pub(crate) fn report(self, json: bool) -> ExitCode {
        let code = self.exit_code();
        if json {
            let texts: Vec<String> = match &self {
                Self::Input { problems } => problems.iter().map(|p| p.to_string()).collect(),
                other => vec![other.to_string()],
            };
            let problems: Vec<_> = self.problems().iter().map(problem_json).collect();
            println!(
                "{}",
                serde_json::json!({ "error": texts, "problems": problems, "exit_code": code })
            );
        } else {
            let help = self.help().map(|h| plain(&h.to_string()));
            let said = Said { text: plain(&self.to_string()), help };
            let report = miette::Report::new(said);
            // Past `eprintln`, which would take the colours for terminal commands of a stranger.
            let _ = writeln!(std::io::stderr(), "{report:?}");
        }
        ExitCode::from(code)
    }
}
