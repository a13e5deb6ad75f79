//! `analyze mechanism`: the docking mechanism on a test bench.

use std::{path::PathBuf, process::ExitCode};

use clap::{Args, ValueEnum};
use docktwin_model::{AttenuationChoice, load_mechanism};
use docktwin_report::study::mechanism as report;
use docktwin_study::mechanism::{MechanismOptions, attenuation, mechanism};

use crate::{args::AxisArg, failure::Failure, inputs::sides, results::Results};

pub(super) const EXAMPLES: &str = "\
The ring is moved along one axis at a time, to and fro: in its soft travel, over its travel,
into the end stops, and at the speed of a docking before and after capture. X is moved with the
other axes held, the others with the ring free in the remaining ones, and held for comparison.

The directory holds loop_AXIS.csv and .svg (Fig. 6 to 9 of the paper), matrices.csv (stiffness
and damping about several poses), coupling.svg, contact.csv and .svg, and mechanism.json (what
--json prints).

Examples:
  docktwin analyze mechanism models/urdf/apas_active.urdf
  docktwin analyze mechanism models/urdf/apas_active.toml --attenuation differential --out bench
  docktwin analyze mechanism mine.urdf --passive theirs.urdf --axis x --axis roll --json";

/// Options of `analyze mechanism`.
#[derive(Debug, Args)]
pub(crate) struct MechanismArgs {
    /// URDF or TOML of a side of the mechanism, the other side beside it
    mechanism: PathBuf,
    /// URDF or TOML of the passive side [default: beside the active one, of the same name]
    #[arg(long, value_name = "FILE")]
    passive: Option<PathBuf>,
    /// What carries the ring [default: as the file says]
    #[arg(long, value_enum)]
    attenuation: Option<AttenuationArg>,
    /// Axis to test, repeatable [default: all]
    #[arg(long, value_enum)]
    axis: Vec<AxisArg>,
    /// Directory of the results; by default a new one under `analysis`.
    #[arg(long, value_name = "DIR", help = "Directory [default: analysis/<mechanism>-<utc>]")]
    out: Option<PathBuf>,
}

/// What carries the ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum AttenuationArg {
    /// A table for every axis
    Characteristic,
    /// Six screw legs, coupled by differentials
    Differential,
}

/// Runs the command.
pub(super) fn run(args: &MechanismArgs, json: bool) -> Result<ExitCode, Failure> {
    let (active, passive) = sides(&args.mechanism, args.passive.as_deref())?;
    let choice = args.attenuation.map(|a| match a {
        AttenuationArg::Characteristic => AttenuationChoice::Characteristic,
        AttenuationArg::Differential => AttenuationChoice::Differential,
    });
    let loaded = load_mechanism(&active, &passive, choice)?;
    if !json {
        loaded.notes.iter().for_each(|n| eprintln!("{} {n}", n.word()));
    }
    let mut options = MechanismOptions::default();
    if !args.axis.is_empty() {
        options.axes = args.axis.iter().map(|a| a.axis()).collect();
    }
    // Before a directory is made: there may be nothing to test.
    attenuation(&loaded.model)?;
    let mut out = Results::new(args.out.as_deref(), &loaded.model.name)?;
    let found = mechanism(&loaded.model, &options)?;
    out.tables(report::tables(&found))?;
    out.plots(report::plots(&found))?;
    out.finish("mechanism", &found.summary, &report::words(&found), json)
}
