//! Inverse of the drives from the state of the bodies (the reference for docking; in tests of structures the
//! state-based inverse):
//!
//! ```text
//! command = x + (d + a₁) v + (d²/2 + d a₁ + a₂) a      a = what the measured wrenches make of the bodies
//! ```
//!
//! d: dead time of plate and sensor; a₁, a₂: 2ζ/ω and 1/ω² of the drives. Position and speed are states of the bodies and
//! their acceleration is the measured force, so the position of the command needs no derivative of what is measured;
//! its speed and acceleration take the jerk in, the difference of accelerations over a tick.

use docktwin_physics::{mounted::Ports, programme::RelativeMotion};

use crate::compensation::{Compensator, Demand, LoopContext, delays::Delays};

/// Name as on the command line.
pub(super) const NAME: &str = "state-force-inverse";

/// See the module's page.
#[derive(Clone, Copy, Debug)]
pub struct StateForce {
    delays: Delays,
}

impl StateForce {
    pub(super) const fn new(delays: Delays) -> Self {
        Self { delays }
    }
}

impl Compensator for StateForce {
    fn name(&self) -> &'static str {
        NAME
    }

    fn reset(&mut self) {}

    fn wrench(&mut self, _seen: &LoopContext<'_>) -> Option<Ports> {
        None
    }

    fn command(&mut self, _seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        Demand::of(self.delays.undo(next, self.delays.sensor_s))
    }
}
