//! `analyze workspace`: where a rig reaches, against its docking workspace, and what it can.

use std::{path::Path, process::ExitCode};

use docktwin_core::DVec3;
use docktwin_model::Rig;
use docktwin_physics::platform::maps::Maps;
use docktwin_report::study::workspace as report;
use docktwin_study::rig::{FARTHEST_M, Subject, corner_tour, workspace};
use docktwin_view::RigWriter;

use super::rig::{RigArgs, build, load};
use crate::{failure::Failure, results::Results};

pub(super) const EXAMPLES: &str = "\
Reach is where every stroke and joint has room and no singular pose is near, found on straight
ways from the middle. The docking workspace is checked at 729 places: middle, corners, edges and
faces. Tolerance is what the length error of the file makes of the pose at the worst place;
payload is what can be added before a leg needs more than its force. A rig that does not reach
its docking workspace is refused with every leg and place (exit code 2), as by `docktwin model
check`.

The directory holds workspace.csv (every place), sections.csv, workspace.svg (Fig. 30 of the
paper), workspace.json (what --json prints), and rig.rrd for the viewer: the rig on its way through
all corners, legs coloured by what is left of their strokes, docking workspace inside the reachable
one.

Examples:
  docktwin analyze workspace models/urdf/stewart.toml
  docktwin analyze workspace mine.toml --out reach --json
  docktwin view reach                                              the rig in the viewer
  docktwin analyze workspace models/urdf/stewart.toml --seed 7     as built: another plate mass";

/// Runs the command.
pub(super) fn run(args: &RigArgs, json: bool) -> Result<ExitCode, Failure> {
    let rig = load(args, json)?;
    let mut out = Results::new(args.out.as_deref(), &format!("{}-workspace", rig.name))?;
    let found = workspace(&rig, &build(args))?;
    out.tables(report::tables(&found))?;
    out.plots(report::plots(&found))?;
    scene(&Subject::new(&rig, &build(args)).rig, &out.file("rig.rrd"))?;
    out.finish("workspace", &found.summary, &report::words(&found), json)
}

/// The rig for the viewer, on a tour through all corners of its docking workspace.
fn scene(rig: &Rig, path: &Path) -> Result<(), Failure> {
    let maps = Maps::new(rig);
    let reach = |way| maps.reach_along(way, DVec3::ZERO, FARTHEST_M);
    let mut writer = RigWriter::create(path, rig, reach)?;
    for frame in corner_tour(rig) {
        writer.frame(frame.time, &frame.plate, frame.leg_forces_n)?;
    }
    Ok(writer.finish()?)
}
