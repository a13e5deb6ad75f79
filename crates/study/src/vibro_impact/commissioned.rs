//! A rig that is identified and calibrated before its tests, as a laboratory does it: through the rig port, without a
//! look at what was drawn.

use std::path::Path;

use docktwin_model::Rig;
use docktwin_run::{
    RunError,
    commission::{
        CalibrateOptions, DriveOptions, IdentifyOptions, Stand, StandOptions, calibrate, identify,
    },
};
use docktwin_scenario::resolve_path;

use super::{RigDraw, VibroOptions};
use crate::{Progress, parallel::in_parallel};

/// Scenario whose stick stands on the rig.
const SCENARIO: &str = "scenarios/vibro_impact.toml";
/// Free way for the slow moves, m.
const ROOM_M: f64 = 0.3;
/// How far the stick is swung against its frame to see how late sensor A is, m.
const TOUCH_M: f64 = 0.0135;

impl VibroOptions {
    /// What is known of an emulated rig after `rig identify` (in the translations that the tests ask for) and `rig
    /// calibrate` with a touch: the options with both, and with the lead that follows.
    ///
    /// # Errors
    /// There is no scenario of the stick from the folder of the rig up, or the rig stopped.
    pub fn commissioned(
        &self,
        rig_path: &Path,
        rig: &Rig,
        draw: RigDraw,
    ) -> Result<Self, RunError> {
        let scenario = resolve_path(rig_path, Path::new(SCENARIO)).ok_or_else(|| {
            RunError::usage(
                format!("no {SCENARIO} from the folder of the rig up"),
                "put the rig's file beside the models of docktwin",
            )
        })?;
        let stand = StandOptions {
            model: rig_path.to_owned(),
            scenario: Some(scenario),
            seed: self.seed,
            perturb: match draw {
                RigDraw::File => None,
                RigDraw::Seed(seed) => Some(seed),
            },
            preset: self.preset,
            ..StandOptions::default()
        };
        let mut stand = Stand::load(&stand)?;
        // With the dead zone that its sensors have.
        stand.rig = self.unknown.rig(&stand.rig, draw);
        let drive = DriveOptions::default();
        let mut dofs: Vec<usize> =
            self.axes.iter().flat_map(|a| a.axes()).map(|a| a.index()).filter(|i| *i < 3).collect();
        dofs.sort_unstable();
        dofs.dedup();
        if dofs.is_empty() {
            dofs.push(0);
        }
        let asked = IdentifyOptions { at_x_m: None, dofs, room_m: ROOM_M };
        let (found, _) = identify(stand.clone(), &drive, &asked, &mut ())?;
        let asked = CalibrateOptions {
            touch_m: Some(TOUCH_M),
            corrections: Some(found.corrections()),
            ..CalibrateOptions::default()
        };
        let (calibration, _) = calibrate(stand, &drive, &asked, &mut ())?;
        let mut out = self.clone();
        (out.identification, out.calibration) = (Some(found), Some(calibration));
        out.compensation = self.compensation.with_lead_s(out.parameters(rig).lead_s);
        Ok(out)
    }
}

/// Every drawn rig of the options, commissioned on all cores.
///
/// # Errors
/// As [`VibroOptions::commissioned`].
pub fn commissioned(
    rig_path: &Path,
    rig: &Rig,
    options: &VibroOptions,
    progress: &mut (dyn Progress + Send),
) -> Result<Vec<(RigDraw, VibroOptions)>, RunError> {
    in_parallel(options.draws as usize, progress, |i| {
        let draw = options.draw(i);
        Ok((draw, options.commissioned(rig_path, rig, draw)?))
    })
}
