//! The mechanism that a rig has: that of the scenario, one drawn within the spread of its files, or another.
//!
//! The loop believes the scenario's. What the rig has is what it is compared with: the simulated system
//! with the same mechanism.

use std::path::{Path, PathBuf};

use docktwin_core::{Digest, Twist};
use docktwin_model::load_other_active_from;
use docktwin_physics::{
    as_built::{AsBuilt, Drawn, MechanismDraw, draw},
    body::BodyState,
    mechanism::{CHASER, RING, System},
    mounted::Article,
};
use docktwin_scenario::Scenario;

use crate::error::RunError;

/// Which mechanism an emulated rig has.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RigMechanism {
    /// TOML or URDF of another active side, for the scenario's passive one; else that of the scenario.
    pub file: Option<PathBuf>,
    /// Draws it within the spread of its files.
    pub draw: Option<MechanismDraw>,
}

/// The mechanism that a rig has, put together.
#[derive(Clone, Debug)]
pub struct RigArticle {
    /// What stands on the rig.
    pub article: Article,
    /// Everything that was drawn.
    pub drawn: Vec<Drawn>,
    /// Digest of the files of another mechanism.
    pub digest: Option<Digest>,
}

impl RigMechanism {
    /// URDF of another active side.
    #[must_use]
    pub fn urdf(&self) -> Option<PathBuf> {
        self.file.as_ref().map(|path| path.with_extension("urdf"))
    }

    /// Puts it together; `believed` is the system of the scenario.
    ///
    /// # Errors
    /// Problems of its files, or nothing to draw it by.
    pub fn article(&self, scenario: &Scenario, believed: &System) -> Result<RigArticle, RunError> {
        let mut out =
            RigArticle { article: believed.clone().into(), drawn: Vec::new(), digest: None };
        let mut mechanism = scenario.mechanism.clone();
        if let Some(urdf) = self.urdf() {
            mechanism = load_other_active_from(&scenario.sources, &urdf, &mechanism)?.model;
            out.digest = Some(mechanism.digest);
        }
        if let Some(asked) = self.draw {
            let AsBuilt { mechanism: built, mounts, drawn } =
                draw(&mechanism, asked).ok_or_else(|| self.no_spread())?;
            (mechanism, out.article.mounts, out.drawn) = (built, Some(mounts), drawn);
        }
        if *self != Self::default() {
            out.article.system = System::new(&scenario.chaser, &scenario.target, mechanism);
        }
        Ok(out)
    }

    fn no_spread(&self) -> RunError {
        let file = self.file.as_deref().map(Path::display);
        let whose = file.map_or_else(|| "the scenario's mechanism".to_owned(), |p| p.to_string());
        RunError::usage(
            format!("{whose} cannot be drawn: the file of its active side has no table [spread]"),
            "add one, models/urdf/apas_active.toml is an example; or leave --mechanism-draw out",
        )
    }
}

/// The bodies of `believed` in a system with another mechanism: the same spacecraft where they are, the ring at
/// rest in its attenuator.
#[must_use]
pub fn bodies_with(believed: &System, system: &System, bodies: &[BodyState; 3]) -> [BodyState; 3] {
    let mut out = *bodies;
    let chaser = &bodies[CHASER];
    let twist = chaser.twist(&believed.mass()[CHASER]);
    let at = |p| Twist { v: twist.v + twist.w.cross(p - chaser.p), w: twist.w };
    let placed = |i: usize, pose: docktwin_core::Pose| {
        let t = at(pose.p);
        BodyState::new(&system.mass()[i], pose, t.v, pose.q.conjugate() * t.w)
    };
    // A ring that is a part of the chaser moves its mass centre.
    if system.rigid() || believed.rigid() {
        let port = chaser.pose() * believed.ports()[0];
        out[CHASER] = placed(CHASER, port * system.ports()[0].inverse());
    }
    out[RING] = placed(RING, out[CHASER].pose() * system.ring_at_rest());
    out
}
