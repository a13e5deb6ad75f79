//! Phase lead of the force and second-order lead of the position (Qi, Gao, Zhao, Li and others, J. Intell. Robot.
//! Syst. 2016, "Low-order model based divergence compensation"):
//!
//! ```text
//! felt = (1 + τ_F s) / (1 + α τ_F s) · measured        τ_F lag of the sensor, α = 0.1
//! command = x + c₁ v + c₂ a                            inverse of dead time and drives to the second order
//! ```
//!
//! The source has a platform of third order; here its third coefficient is left to the dead time. Higher derivatives of
//! the position are avoided there for their noise, as here; speed and acceleration of the command, which the source does
//! not have, take the jerk in.

use docktwin_core::StateHasher;
use docktwin_physics::{mounted::Ports, programme::RelativeMotion};

use crate::compensation::{Compensator, Demand, LoopContext, Phase, delays::Delays};

/// Name as on the command line.
pub(super) const NAME: &str = "force-lead";

/// Lag of the lead's own filter over the lead.
const ALPHA: f64 = 0.1;

/// See the module's page.
#[derive(Clone, Copy, Debug)]
pub struct ForceLead {
    delays: Delays,
    /// Tick of the last measurement, and its wrenches.
    before: Option<(u64, Ports)>,
    /// Their rates, N/s and N·m/s.
    rate: Ports,
}

impl ForceLead {
    pub(super) fn new(delays: Delays) -> Self {
        Self { delays, before: None, rate: Ports::default() }
    }
}

impl Compensator for ForceLead {
    fn name(&self) -> &'static str {
        NAME
    }

    fn reset(&mut self) {
        *self = Self::new(self.delays);
    }

    fn wrench(&mut self, seen: &LoopContext<'_>) -> Option<Ports> {
        if seen.phase != Phase::Closed {
            self.before = None;
            return None;
        }
        if seen.measured.fresh {
            let (tick, before) =
                self.before.replace((seen.tick, *seen.ports)).unwrap_or((seen.tick, *seen.ports));
            // Over the ticks since the last measurement there was.
            #[expect(clippy::cast_precision_loss, reason = "a few ticks")]
            let since_s = seen.tick.saturating_sub(tick).max(1) as f64 * seen.period_s;
            let now = (*seen.ports - before) * (1.0 / since_s);
            let own_s = ALPHA * self.delays.sensor_s;
            let part = if own_s > 0.0 { 1.0 - (-since_s / own_s).exp() } else { 1.0 };
            self.rate = self.rate + (now - self.rate) * part;
        }
        Some(self.rate * self.delays.sensor_s)
    }

    fn command(&mut self, _seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        Demand::of(self.delays.undo(next, 0.0))
    }

    fn digest(&self) -> Option<u64> {
        let mut h = StateHasher::new();
        let (tick, before) = self.before.unwrap_or_default();
        h.u64(tick);
        for w in [before.port3, before.port4, self.rate.port3, self.rate.port4] {
            h.vec3(w.f);
            h.vec3(w.m);
        }
        Some(h.finish().short())
    }
}
