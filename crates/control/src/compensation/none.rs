//! No compensation: the motion is commanded as it is. What the delay then does is the reference
//! for every method ([`crate::one_sided`]).

use docktwin_physics::{mounted::Ports, programme::RelativeMotion};

use super::{Compensator, Demand, LoopContext};

/// The motion of the bodies, unchanged, and the wrenches as measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Uncompensated;

impl Compensator for Uncompensated {
    fn name(&self) -> &'static str {
        "none"
    }

    fn reset(&mut self) {}

    fn wrench(&mut self, _seen: &LoopContext<'_>) -> Option<Ports> {
        None
    }

    fn command(&mut self, _seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        Demand::of(*next)
    }
}
