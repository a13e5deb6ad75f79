//! `analyze frequency`: natural frequency per degree of freedom over the docking workspace.

use std::process::ExitCode;

use docktwin_report::study::frequency as report;
use docktwin_study::rig::frequency;

use super::rig::{RigArgs, build, load};
use crate::{failure::Failure, results::Results};

pub(super) const EXAMPLES: &str = "\
The plate on six oil springs, valves closed. Of every degree of freedom the natural frequency
with the other five held, and the six modes, at 729 places of the docking workspace: middle,
corners, edges and faces.

The directory holds frequency.csv, frequency.svg (Fig. 31 to 36 of the paper) and frequency.json
(what --json prints).

Examples:
  docktwin analyze frequency models/urdf/stewart.toml
  docktwin analyze frequency models/urdf/stewart.toml --preset stiff --out stiff --json
  docktwin analyze frequency models/urdf/stewart.toml --seed 7   a drawn rig";

/// Runs the command.
pub(super) fn run(args: &RigArgs, json: bool) -> Result<ExitCode, Failure> {
    let rig = load(args, json)?;
    let mut out = Results::new(args.out.as_deref(), &format!("{}-frequency", rig.name))?;
    let found = frequency(&rig, &build(args))?;
    out.tables(report::tables(&found))?;
    out.plots(report::plots(&found))?;
    out.finish("frequency", &found.summary, &report::words(&found), json)
}
