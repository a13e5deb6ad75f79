//! `analyze stiffness`: how the closed loop moves with the stiffness of its payload, (11).

use std::process::ExitCode;

use clap::Args;
use docktwin_report::study::stiffness as report;
use docktwin_study::rig::{StiffnessOptions, stiffness};

use super::rig::{RigArgs, build, load_and_change};
use crate::{
    failure::Failure,
    results::{Bars, Results},
};

pub(super) const EXAMPLES: &str = "\
Poles and 10 Hz response of the linear model, controllers, sampling and dead time included,
against a spring of 0 to 1e6 N/m at the port, along X (axial) and along Y (lateral): in the
middle at many stiffnesses, at the 64 corners at both ends. Beside it the same with the bulk
modulus half as large again, as the paper's oil without air. Takes a few seconds.

Keys of --set: as of `docktwin analyze bode`.

The directory holds poles.csv, response.csv, poles.svg and stiffness.json (what --json prints).

Examples:
  docktwin analyze stiffness models/urdf/stewart.toml
  docktwin analyze stiffness models/urdf/stewart.toml --preset printed --out poles --json
  docktwin analyze stiffness models/urdf/stewart.toml --set damping_ratio=0.3 --set high_pass_hz=2";

/// Options of `analyze stiffness`.
#[derive(Debug, Args)]
pub(crate) struct StiffnessArgs {
    #[command(flatten)]
    rig: RigArgs,
    /// Override a setting of the leg control, repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// Runs the command.
pub(super) fn run(args: &StiffnessArgs, json: bool) -> Result<ExitCode, Failure> {
    let (rig, leg_control) = load_and_change(&args.rig, &args.set, json)?;
    let mut out = Results::new(args.rig.out.as_deref(), &format!("{}-stiffness", rig.name))?;
    let options = StiffnessOptions { build: build(&args.rig), leg_control };
    let found = stiffness(&rig, &options, &mut Bars::new(json))?;
    out.tables(report::tables(&found))?;
    out.plots(report::plots(&found))?;
    out.finish("stiffness", &found.summary, &report::words(&found), json)
}
