//! Passivity controller (Hannaford and Ryu, IEEE Trans. Robot. Autom. 18, 2002; for spacecraft on robots De Stefano,
//! Balachandran and Secchi, IEEE Trans. Robot. 36, 2020): energy that the contact gives to the bodies and that the hardware
//! did not give is taken from them again by damping:
//!
//! ```text
//! E += F·Δx(bodies) − F·Δx(plate)      felt = measured − β (m_r v, I_r ω), β = E/(2 T Δt) from 0 to 50 1/s
//! ```
//!
//! T is the kinetic energy of the relative motion. It knows nothing of delays, and the command is the motion itself. What it
//! takes it takes where it is found, late in the contact and at its turning point: R_e comes near one, and the contact
//! lasts longer than it should.

use docktwin_core::StateHasher;
use docktwin_physics::{mounted::Ports, programme::RelativeMotion};

use crate::compensation::{Believed, Compensator, Demand, EnergyObserver, LoopContext, Phase};

/// Name as on the command line.
pub(super) const NAME: &str = "passivity";

/// See the module's page.
#[derive(Clone, Debug)]
pub struct Passivity {
    observer: EnergyObserver,
}

impl Passivity {
    pub(super) fn new(believed: &Believed<'_>) -> Self {
        Self { observer: EnergyObserver::new(believed.system, 0.0) }
    }
}

impl Compensator for Passivity {
    fn name(&self) -> &'static str {
        NAME
    }

    fn reset(&mut self) {
        self.observer.reset();
    }

    fn wrench(&mut self, seen: &LoopContext<'_>) -> Option<Ports> {
        self.observer.see(seen, &Ports::default());
        let energy_j = self.observer.energy_j();
        (seen.phase == Phase::Closed).then(|| self.observer.damping(energy_j, seen))
    }

    fn command(&mut self, _seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        Demand::of(*next)
    }

    fn digest(&self) -> Option<u64> {
        let mut h = StateHasher::new();
        h.f64(self.observer.energy_j());
        Some(h.finish().short())
    }
}
