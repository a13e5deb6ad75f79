//! Polynomial extrapolation (Horiuchi and others, Earthquake Eng. Struct. Dyn. 28, 1999): a polynomial through the last
//! positions, one lag apart from each other, carried on by the lag:
//!
//! ```text
//! x(t + τ) = Σ aᵢ x(t − i τ)      first order 2, −1; second 3, −3, 1; third 4, −6, 4, −1
//! ```
//!
//! The speed of the command is carried on alike. The source commands positions alone; here acceleration and jerk, of
//! which the feed-forward of the legs makes force and flow, are those of the motion carried on straight: through four
//! points they would have eight times the noise of the force.

use docktwin_core::{Pose, StateHasher, Twist};
use docktwin_physics::{mounted::Ports, platform::Platform, programme::RelativeMotion};

use super::Order;
use crate::{
    compensation::{Compensator, Demand, LoopContext, MOST_LEAD_S, history::History},
    excitation::apart,
};

/// Motions that are kept: three of the longest leads in ticks of 1 ms, and their neighbours.
const KEPT: usize = 304;

/// See the module's page.
#[derive(Clone, Debug)]
pub struct Polynomial {
    order: Order,
    lead_s: f64,
    /// Poses and twists of the last ticks.
    past: History<(Pose, Twist), KEPT>,
    tick: Option<u64>,
}

impl Polynomial {
    pub(super) fn new(order: Order, lead_s: f64) -> Self {
        let past = History::new((Pose::IDENTITY, Twist::default()));
        Self { order, lead_s: lead_s.min(MOST_LEAD_S), past, tick: None }
    }

    const fn factors(&self) -> &'static [f64] {
        match self.order {
            Order::First => &[2.0, -1.0],
            Order::Second => &[3.0, -3.0, 1.0],
            Order::Third => &[4.0, -6.0, 4.0, -1.0],
        }
    }

    /// So many ticks ago. The line between two of them is off by a T²/8, below 1 µm.
    fn ago(&self, ticks: f64) -> (Pose, Twist) {
        let ((x, v), (y, w), part) = self.past.ago(ticks);
        let at = Pose::new(x.p + (y.p - x.p) * part, x.q.slerp(y.q, part));
        (at, Twist { v: v.v + (w.v - v.v) * part, w: v.w + (w.w - v.w) * part })
    }
}

impl Compensator for Polynomial {
    fn name(&self) -> &'static str {
        self.order.name()
    }

    fn reset(&mut self) {
        self.past.rest((Pose::IDENTITY, Twist::default()));
        self.tick = None;
    }

    fn wrench(&mut self, _seen: &LoopContext<'_>) -> Option<Ports> {
        None
    }

    fn command(&mut self, seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        let since = self.tick.map_or(1, |before| seen.tick.saturating_sub(before));
        if self.tick.is_none() {
            // It has been there for ever.
            self.past.rest((next.x_34, Twist::default()));
        }
        self.tick = Some(seen.tick);
        (0..since.clamp(1, KEPT as u64)).for_each(|_| self.past.push((next.x_34, next.twist)));
        let lead_ticks = self.lead_s / seen.period_s;
        let (mut way, mut twist) = (Twist::default(), Twist::default());
        let add = |to: &mut Twist, x: &Twist, by: f64| {
            to.v += x.v * by;
            to.w += x.w * by;
        };
        for (i, factor) in (0_u32..).zip(self.factors()) {
            let (x, v) = self.ago(f64::from(i) * lead_ticks);
            add(&mut way, &apart(&next.x_34, &x), *factor);
            add(&mut twist, &v, *factor);
        }
        // Acceleration and jerk as the motion has them, straight on.
        let on = next.by_series([self.lead_s, 0.0, 0.0]);
        Demand::of(RelativeMotion { x_34: Platform::moved(&next.x_34, &way, 1.0), twist, ..on })
    }

    fn digest(&self) -> Option<u64> {
        let mut h = StateHasher::new();
        h.u64(self.tick.unwrap_or(u64::MAX));
        // The newest are those of the bodies, which a digest of a run has.
        let (x, v) = self.past.oldest();
        h.vec3(x.p);
        h.quat(x.q);
        h.vec3(v.v);
        h.vec3(v.w);
        Some(h.finish().short())
    }
}
