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

use docktwin_core::{DQuat, Pose, StateHasher, Twist};
use docktwin_physics::{mounted::Ports, programme::RelativeMotion};

use super::{Demand, Does, LoopContext, Order};
use crate::compensation::MOST_LEAD_S;

/// Motions that are kept: three of the longest leads in ticks of 1 ms, and their neighbours.
const KEPT: usize = 304;

/// See the module's page.
#[derive(Clone, Debug)]
pub(super) struct Polynomial {
    order: Order,
    lead_s: f64,
    /// Motions of the last ticks, newest at `newest`; empty before the first.
    past: Box<[RelativeMotion; KEPT]>,
    newest: usize,
    tick: Option<u64>,
}

impl Polynomial {
    pub(super) fn new(order: Order, lead_s: f64) -> Self {
        let past = Box::new([RelativeMotion::default(); KEPT]);
        Self { order, lead_s: lead_s.min(MOST_LEAD_S), past, newest: 0, tick: None }
    }

    const fn factors(&self) -> &'static [f64] {
        match self.order {
            Order::First => &[2.0, -1.0],
            Order::Second => &[3.0, -3.0, 1.0],
            Order::Third => &[4.0, -6.0, 4.0, -1.0],
        }
    }

    fn push(&mut self, now: &RelativeMotion) {
        self.newest = (self.newest + 1) % KEPT;
        self.past[self.newest] = *now;
    }

    /// So many ticks ago, between two of them.
    fn ago(&self, ticks: f64) -> RelativeMotion {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 302")]
        let whole = (ticks.max(0.0) as usize).min(KEPT - 2);
        #[expect(clippy::cast_precision_loss, reason = "0 to 302")]
        let part = (ticks - whole as f64).clamp(0.0, 1.0);
        let at = |i: usize| &self.past[(self.newest + KEPT - i) % KEPT];
        let (a, b) = (at(whole), at(whole + 1));
        let mix = |x: &Twist, y: &Twist| Twist {
            v: x.v + (y.v - x.v) * part,
            w: x.w + (y.w - x.w) * part,
        };
        // The line between two ticks is off by a T²/8, below 1 µm.
        RelativeMotion {
            x_34: Pose::new(
                a.x_34.p + (b.x_34.p - a.x_34.p) * part,
                a.x_34.q.slerp(b.x_34.q, part),
            ),
            twist: mix(&a.twist, &b.twist),
            ..RelativeMotion::default()
        }
    }
}

impl Does for Polynomial {
    fn reset(&mut self) {
        (self.tick, self.newest) = (None, 0);
    }

    fn wrench(&mut self, _seen: &LoopContext<'_>) -> Option<Ports> {
        None
    }

    fn command(&mut self, seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        let missed = match self.tick {
            None => {
                // It has been there for ever.
                let rests = RelativeMotion { x_34: next.x_34, ..RelativeMotion::default() };
                self.past.fill(rests);
                1
            }
            Some(before) => seen.tick.saturating_sub(before).clamp(1, KEPT as u64),
        };
        self.tick = Some(seen.tick);
        (0..missed).for_each(|_| self.push(next));
        let apart = self.lead_s / seen.period_s;
        let (mut way, mut out) = (Twist::default(), RelativeMotion::default());
        let add = |to: &mut Twist, x: &Twist, by: f64| {
            to.v += x.v * by;
            to.w += x.w * by;
        };
        for (i, factor) in (0_u32..).zip(self.factors()) {
            let x = if i == 0 { *next } else { self.ago(f64::from(i) * apart) };
            way.v += (x.x_34.p - next.x_34.p) * *factor;
            let mut turn = (x.x_34.q * next.x_34.q.conjugate()).normalize();
            if turn.w < 0.0 {
                turn = -turn;
            }
            way.w += turn.to_scaled_axis() * *factor;
            add(&mut out.twist, &x.twist, *factor);
        }
        (out.acceleration, out.jerk) = (next.acceleration, next.jerk);
        add(&mut out.acceleration, &next.jerk, self.lead_s);
        let turned = (DQuat::from_scaled_axis(way.w) * next.x_34.q).normalize();
        out.x_34 = Pose::new(next.x_34.p + way.v, turned);
        Demand::of(out)
    }

    fn digest(&self) -> Option<u64> {
        let mut h = StateHasher::new();
        h.u64(self.tick.unwrap_or(u64::MAX));
        // The newest are those of the bodies, which a digest of a run has; how far back it remembers is in the oldest.
        let oldest = &self.past[(self.newest + 1) % KEPT];
        h.vec3(oldest.x_34.p);
        h.quat(oldest.x_34.q);
        Some(h.finish().short())
    }
}
