//! Inverse of the drives from the state of the bodies (the reference for docking; in tests of structures the
//! state-based inverse):
//!
//! ```text
//! command = x + (d + a₁) v + (d²/2 + d a₁ + a₂) a      a = what the measured wrenches make of the bodies
//! ```
//!
//! d: dead time of plate and sensor; a₁, a₂: 2ζ/ω and 1/ω² of the drives. Nothing is differentiated, because position
//! and speed are states of the bodies and their acceleration is the measured force.

use docktwin_physics::{mounted::Ports, programme::RelativeMotion};

use super::{Delays, Demand, Does, LoopContext};

/// See the module's page.
#[derive(Clone, Copy, Debug)]
pub(super) struct StateForce {
    delays: Delays,
}

impl StateForce {
    pub(super) const fn new(delays: Delays) -> Self {
        Self { delays }
    }
}

impl Does for StateForce {
    fn reset(&mut self) {}

    fn wrench(&mut self, _seen: &LoopContext<'_>) -> Option<Ports> {
        None
    }

    fn command(&mut self, _seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        Demand::of(self.delays.undo(next, self.delays.sensor_s))
    }

    fn digest(&self) -> Option<u64> {
        None
    }
}
