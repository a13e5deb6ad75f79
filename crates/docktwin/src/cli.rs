//! What can be typed.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

/// Digital twin of spacecraft docking: rehearse a docking from a scenario file, look at its
/// contacts, replay it bit by bit.
#[derive(Debug, Parser)]
#[command(name = "docktwin", version, max_term_width = 100, after_help = EXAMPLES)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(subcommand)]
    pub(crate) command: Command,
}

const EXAMPLES: &str = "\
Examples:
  docktwin rehearse scenarios/apas_nominal.toml
  docktwin rehearse scenarios/apas_fast.toml --set initial.lateral_y_m=0.1 --out runs/wide
  docktwin replay runs/wide
  docktwin scenario explain initial.gap_m

Exit codes: 0 the run ended as its `expect` says; 1 it ended otherwise; 2 bad input or usage;
70 a defect of docktwin.";

/// Options of every command.
#[derive(Debug, Args)]
pub(crate) struct Common {
    /// Print the result as JSON on stdout, and nothing else there
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Rehearse a docking with the twin alone, as fast as possible
    #[command(after_help = REHEARSE)]
    Rehearse(RehearseArgs),
    /// Check the files of a model
    #[command(subcommand)]
    Model(ModelCommand),
    /// Check a scenario, or explain its keys
    #[command(subcommand)]
    Scenario(ScenarioCommand),
    /// Run a recording again, tick by tick, and say where it first differs
    #[command(after_help = REPLAY)]
    Replay(ReplayArgs),
    /// Write one self-contained HTML page of a run: verdict, pictures, plots, contacts in words
    #[command(after_help = REPORT)]
    Report(ReportArgs),
}

const REHEARSE: &str = "\
The run directory holds summary.json, run.mcap (every tick, crash-safe), telemetry.parquet,
events.jsonl, run.rrd (for the rerun viewer) and scenario.toml (as it ran).

Examples:
  docktwin rehearse scenarios/apas_nominal.toml
  docktwin rehearse scenarios/apas_nominal.toml --twin reduced --json
  docktwin rehearse scenarios/apas_fast.toml --set mechanism.attenuation='\"differential\"'";

/// Options of `rehearse`.
#[derive(Debug, Args)]
pub(crate) struct RehearseArgs {
    /// Scenario file
    pub(crate) scenario: PathBuf,
    /// Run directory; by default a new one under `runs`.
    #[arg(long, value_name = "DIR", help = "Run directory [default: runs/<scenario>-<utc>]")]
    pub(crate) out: Option<PathBuf>,
    /// Override a key of the scenario, repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub(crate) set: Vec<String>,
    /// Seed of all random numbers (a rehearsal draws none; it is kept with the run)
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// Which twin integrates the bodies
    #[arg(long, value_enum, default_value_t = TwinKind::Full)]
    pub(crate) twin: TwinKind,
    /// Do not write run.rrd
    #[arg(long)]
    pub(crate) no_rrd: bool,
}

/// Which twin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TwinKind {
    /// rapier integrates; 0.2 ms steps by default
    Full,
    /// Our own allocation-free integrator; 0.1 ms steps by default
    Reduced,
}

impl TwinKind {
    /// Name as on the command line.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Reduced => "reduced",
        }
    }
}

/// `model …`.
#[derive(Debug, Subcommand)]
pub(crate) enum ModelCommand {
    /// Tell everything read, refused or ignored in a URDF or its TOML, all problems at once
    #[command(
        after_help = "Examples:\n  docktwin model check models/urdf/apas_active.urdf\n  docktwin model check models/urdf/chaser_8t.toml --json"
    )]
    Check {
        /// URDF or TOML of a spacecraft or of one side of a mechanism
        file: PathBuf,
    },
}

/// `scenario …`.
#[derive(Debug, Subcommand)]
pub(crate) enum ScenarioCommand {
    /// Check a scenario and every model it names, all problems at once
    #[command(
        after_help = "Examples:\n  docktwin scenario check scenarios/apas_nominal.toml\n  docktwin scenario check my.toml --set run.duration_s=5"
    )]
    Check {
        /// Scenario file
        file: PathBuf,
        /// Override a key of the scenario, repeatable
        #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
        set: Vec<String>,
    },
    /// Explain a key of the scenario file, or all of them
    #[command(
        after_help = "Examples:\n  docktwin scenario explain\n  docktwin scenario explain initial.gap_m"
    )]
    Explain {
        /// Key, with dots
        key: Option<String>,
    },
}

const REPLAY: &str = "\
The recorded control wrenches are fed to the same twin from the same start; the state digest is
compared at every tick.

Examples:
  docktwin replay runs/apas_nominal-20261122T101500Z
  docktwin replay runs/wide --json";

/// Options of `replay`.
#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// Run directory
    pub(crate) run: PathBuf,
}

const REPORT: &str = "\
The page needs nothing but itself: no network, no script. It is also written of what is left of a run
that was killed, and then says so first. An existing page is replaced.

Examples:
  docktwin report runs/wide
  docktwin report runs/wide --out wide.html
  docktwin report runs/wide --json";

/// Options of `report`.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// Run directory
    pub(crate) run: PathBuf,
    /// Where the page goes; by default into the run directory.
    #[arg(long, value_name = "FILE", help = "Where the page goes [default: RUN/report.html]")]
    pub(crate) out: Option<PathBuf>,
}
