//! A lead of constant time, `x + τ v`, by which the command is ahead of the motion: exact for a delay τ as
//! long as velocity is constant. It leaves |G| = 1 + θ²/2 and a phase of −θ³/3 with θ = ωτ.
//!
//! The lead is applied to the motion, not to the force: velocity, acceleration and jerk get the
//! same lead, so that the feed-forward is consistent with the pose.

use docktwin_physics::{mounted::Ports, programme::RelativeMotion};

use super::{Compensator, Demand, LoopContext};

/// Longest lead, s.
pub const MOST_LEAD_S: f64 = 0.1;

/// `x + τ v`. With τ above the delay of the rig the loop loses energy in every contact, below it
/// the loop gains energy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lead {
    lead_s: f64,
}

impl Lead {
    /// By so many seconds, 0 to [`MOST_LEAD_S`].
    #[must_use]
    pub const fn new(lead_s: f64) -> Self {
        Self { lead_s }
    }

    /// The lead, s.
    #[must_use]
    pub const fn lead_s(&self) -> f64 {
        self.lead_s
    }
}

impl Compensator for Lead {
    fn name(&self) -> &'static str {
        "lead"
    }

    fn reset(&mut self) {}

    fn wrench(&mut self, _seen: &LoopContext<'_>) -> Option<Ports> {
        None
    }

    fn command(&mut self, _seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        Demand::of(next.led(self.lead_s))
    }
}
