//! What a test has that the loop does not believe: a stick of other stiffness and play, a dead zone of the
//! sensors, a place at the edge of the workspace.

use docktwin_model::{DeadZoneLaw, DockingWorkspace, Rig};
use docktwin_physics::hydraulics::Draws;

use super::RigDraw;
use crate::table4::VibroTest;

/// Streams of the quantities drawn here; rigs have those below 1024, mechanisms 64 for each of theirs.
const STREAM: u64 = 1 << 20;

/// What the emulated rig has and the loop does not know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unknown {
    /// Stiffness of the stick of drawn rigs: part of what is believed, to either side.
    pub stiffness: f64,
    /// Play of the stick of drawn rigs, m to either side.
    pub play_m: f64,
    /// Dead zone of the force sensors, N; drawn rigs have a part of it, drawn uniformly.
    pub dead_zone_n: Option<f64>,
    /// What the dead zone does to larger forces.
    pub law: DeadZoneLaw,
    /// The dead zone was calibrated: the loop knows it.
    pub calibrated: bool,
}

impl Unknown {
    /// Nothing: the stick as believed, the sensors as the rig's file has them.
    pub const NOTHING: Self = Self {
        stiffness: 0.0,
        play_m: 0.0,
        dead_zone_n: None,
        law: DeadZoneLaw::Zeroing,
        calibrated: false,
    };

    /// What is wrong with the figures.
    pub(super) fn problems(&self) -> Vec<String> {
        let mut out = Vec::new();
        if !(0.0..=0.9).contains(&self.stiffness) {
            out.push(format!("a spread of stiffness of {}: give 0 to 0.9", self.stiffness));
        }
        if !(0.0..=0.005).contains(&self.play_m) {
            out.push(format!("a spread of play of {} m: give 0 to 0.005 m", self.play_m));
        }
        if self.dead_zone_n.is_some_and(|n| !(0.0..=100.0).contains(&n)) {
            out.push("a dead zone is 0 to 100 N".to_owned());
        }
        out
    }

    /// The test with the stick that a rig has.
    pub(super) fn test(&self, test: &VibroTest, draw: RigDraw) -> VibroTest {
        let RigDraw::Seed(seed) = draw else { return test.clone() };
        let uniform = |which| Draws::new(seed, STREAM + which).uniform();
        test.with_stick(1.0 + self.stiffness * uniform(0), self.play_m * uniform(1))
    }

    /// The rig as the loop believes it.
    pub(super) fn believed(&self, filed: &Rig, draw: RigDraw) -> Rig {
        if self.calibrated { self.rig(filed, draw) } else { filed.clone() }
    }

    /// The rig as it is.
    pub(super) fn rig(&self, believed: &Rig, draw: RigDraw) -> Rig {
        let mut rig = believed.clone();
        if let (Some(sensors), Some(largest_n)) = (&mut rig.sensors, self.dead_zone_n) {
            let part = match draw {
                RigDraw::File => 1.0,
                RigDraw::Seed(seed) => 0.5 + 0.5 * Draws::new(seed, STREAM + 2).uniform(),
            };
            let [force_n, moment_nm] = sensors.force.dead_zone;
            // Moments in the proportion that the file has; without one, at an arm of a metre.
            let arm_m = if force_n > 0.0 { moment_nm / force_n } else { 1.0 };
            sensors.force.dead_zone = [part * largest_n, part * largest_n * arm_m];
            sensors.force.dead_zone_law = self.law;
        }
        rig
    }
}

/// The rig with its rack set so that the middle of a stick's frame, `x_34`, is where the docking workspace has a
/// corner, 0 to 63: bits say which end of X, Y, Z, roll, pitch and yaw. `None` for another number.
#[must_use]
pub fn in_corner(rig: &Rig, corner: usize) -> Option<Rig> {
    let place = DockingWorkspace::corners().nth(corner)?;
    let (middle, there) = (rig.docking.pose([0.0; 6]), rig.docking.pose(place.0));
    let mut out = rig.clone();
    let mount = rig.x_b0 * rig.x_03 * there * middle.inverse();
    out.x_b0 = mount * rig.x_03.inverse();
    Some(out)
}
