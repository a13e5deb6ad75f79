//! What a balance costs: dockings on the emulated rig with balances of other quality than the rig's own.
//!
//! The hanger is that of the rig's file; share of the weight, friction and moving mass are varied. The loop and
//! its calibration know the balance, as they know the one of the file.

use docktwin_model::{DockingMechanism, Offload, Sag, sag_refusal, static_sag};
use docktwin_record::Outcome;
use docktwin_run::{HilOptions, HilRun, RunError};
use docktwin_scenario::Scenario;
use serde::{Deserialize, Serialize};

use super::{OnRig, ended};
use crate::{Progress, parallel::in_parallel};

/// Shares of the ring's weight that are carried.
pub const SHARES: [f64; 4] = [0.90, 0.95, 0.98, 1.0];
/// Frictions, N.
pub const FRICTIONS_N: [f64; 4] = [0.0, 5.0, 10.0, 20.0];
/// Moving masses, kg.
pub const MASSES_KG: [f64; 4] = [0.0, 2.0, 10.0, 40.0];

/// The numbers of a balance that are varied.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Balance {
    /// Part of the ring's weight that it carries.
    pub share: f64,
    /// Friction of its guides, N.
    pub friction_n: f64,
    /// Mass that moves with the ring, kg.
    pub added_mass_kg: f64,
}

/// A docking on the rig with one balance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Balanced {
    /// The balance.
    pub balance: Balance,
    /// Largest part of its travel that a channel of the mechanism sags; above 1, or null without end, it does not
    /// bear the weight that is left.
    pub sag_share: Option<f64>,
    /// Largest part of a brake of the mechanism that the weight takes; null where it has none.
    pub brake_share: Option<f64>,
    /// Why the rig does not run it: the weight that is left is too much for the mechanism.
    pub refused: Option<String>,
    /// The docking; null where it is refused.
    pub on_rig: Option<OnRig>,
}

impl Balanced {
    /// Whether the mechanism bears it and the docking ends as the simulated one does.
    #[must_use]
    pub fn borne(&self, simulated: &Outcome) -> bool {
        self.on_rig.as_ref().is_some_and(|on| on.stopped.is_none() && on.outcome == *simulated)
    }
}

/// A scenario with all balances.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OffloadMap {
    /// Name of the scenario.
    pub scenario: String,
    /// How the simulated system ends.
    pub simulated: Outcome,
    /// The rig's own balance.
    pub own: Balance,
    /// By share, friction, mass.
    pub balances: Vec<Balanced>,
}

/// Runs a scenario with every share × friction × moving mass, on all cores.
///
/// # Errors
/// A rig without a balance, whose hanger is not known, or one that cannot be armed.
pub fn offload_map(
    scenario: &Scenario,
    options: &HilOptions,
    progress: &mut (impl Progress + Send),
) -> Result<OffloadMap, RunError> {
    let run = HilRun::new(scenario, options.clone())?;
    let Some(own) = run.rig().offload else {
        return Err(RunError::Usage {
            what: "the rig has no balance that could be varied".to_owned(),
            remedy: "add [offload] to the rig's TOML; models/urdf/stewart.toml is an example"
                .to_owned(),
        });
    };
    let simulated = run.simulate(docktwin_core::DVec3::ZERO)?.outcome;
    // The mechanism that stands on the rig, which may be another one than the scenario's.
    let (system, _) = run.reference();
    let all = lattice();
    let balances = in_parallel(all.len(), progress, |i| {
        let Balance { share, friction_n, added_mass_kg } = all[i];
        let offload = Offload { share, friction_n, added_mass_kg, ..own };
        balanced(scenario, options, system.mechanism(), offload)
    })?;
    let own =
        Balance { share: own.share, friction_n: own.friction_n, added_mass_kg: own.added_mass_kg };
    Ok(OffloadMap { scenario: scenario.name.clone(), simulated, own, balances })
}

fn lattice() -> Vec<Balance> {
    let mut out = Vec::new();
    for share in SHARES {
        for friction_n in FRICTIONS_N {
            for added_mass_kg in MASSES_KG {
                out.push(Balance { share, friction_n, added_mass_kg });
            }
        }
    }
    out
}

fn balanced(
    scenario: &Scenario,
    options: &HilOptions,
    mechanism: &DockingMechanism,
    offload: Offload,
) -> Result<Balanced, RunError> {
    let (mut sags, mut too_much) = (Vec::new(), false);
    let run = HilRun::with_rig(scenario, options.clone(), |rig| {
        rig.offload = Some(offload);
        sags = static_sag(rig, mechanism);
        too_much = sag_refusal(rig, mechanism).is_some();
    });
    let largest = |x: &mut dyn Iterator<Item = f64>| x.reduce(f64::max);
    let sag_share = largest(&mut sags.iter().map(Sag::travel_share));
    let brake_share = largest(&mut sags.iter().filter_map(Sag::brake_share));
    let (on_rig, refused) = match run {
        Ok(run) => (Some(ended(run, &[], scenario)?), None),
        Err(e) if too_much => (None, Some(e.to_string())),
        Err(e) => return Err(e),
    };
    let sag_share = sag_share.filter(|s| s.is_finite());
    let Offload { share, friction_n, added_mass_kg, .. } = offload;
    let balance = Balance { share, friction_n, added_mass_kg };
    Ok(Balanced { balance, sag_share, brake_share, refused, on_rig })
}
