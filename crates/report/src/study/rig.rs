//! What studies of a rig have in common.

use docktwin_model::{DockingWorkspace, HydraulicPreset, Place};
use docktwin_study::rig::{Dof, SubjectSummary};

/// Name, preset and draw in words.
pub(super) fn title(subject: &SubjectSummary) -> String {
    let drawn = subject.seed.map_or(String::new(), |s| format!(", drawn with seed {s}"));
    let oil = subject.preset.map_or("no oil", HydraulicPreset::word);
    format!("{}, {oil}{drawn}", subject.rig)
}

/// Header of [`place_csv`].
pub(super) const PLACE_COLUMNS: &str = "x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg";

/// Columns of a place for a table: m and degrees from the middle.
pub(super) fn place_csv(d: &DockingWorkspace, place: Place) -> String {
    let [x, y, z, roll, pitch, yaw] = place.0;
    format!(
        "{},{},{},{},{},{}",
        x * d.axial_m,
        y * d.lateral_m,
        z * d.lateral_m,
        roll * d.roll_rad.to_degrees(),
        pitch * d.pitch_yaw_rad.to_degrees(),
        yaw * d.pitch_yaw_rad.to_degrees()
    )
}

/// Half-width of the docking workspace in a degree of freedom, m or rad.
pub(super) fn half_width(d: &DockingWorkspace, dof: Dof) -> f64 {
    match dof {
        Dof::X => d.axial_m,
        Dof::Y | Dof::Z => d.lateral_m,
        Dof::Roll => d.roll_rad,
        Dof::Pitch | Dof::Yaw => d.pitch_yaw_rad,
    }
}
