//! Play between the ring and the element of a channel: spring, damper and, in series with both, a brake.
//!
//! With x the deflection of the ring, y the element's loaded end (it has no mass) and b the width of the
//! play:
//!
//! ```text
//! |x − y| < b/2          no force; the end goes back by itself, c y' = −F(y − s)
//! x − y = ± b/2          the end goes with the ring: F(y − s) + c y', and it only pushes
//! F + c y' > F_b         the brake slips, as without play
//! ```
//!
//! F is the mean of both branches, s the slip of the brake. The account follows from what is stored: lost is
//! what the ring gives and is not stored.

use docktwin_core::{DVec3, StateHasher};
use docktwin_model::AxisChannel;

use super::{ChannelForce, ChannelState, Element, X, spring, spring_energy};

/// Loaded end of an element with play.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct End {
    /// Where it was in the middle of the last step, against rest, m.
    at_m: f64,
    /// 1 and −1: the ring pushes it that way; 0: it is free.
    pushed: f64,
}

impl End {
    /// Free at a deflection.
    pub(super) const fn at(at_m: f64) -> Self {
        Self { at_m, pushed: 0.0 }
    }

    /// Nothing while it is free at rest, so that channels without play have the digest that they always had.
    pub(super) fn hash_into(&self, h: &mut StateHasher) {
        if *self != Self::default() {
            h.f64(self.at_m);
            h.f64(self.pushed);
        }
    }
}

/// The element at a deflection of the ring, its memory as it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    /// Of its spring, m.
    pub(super) elongation: f64,
    /// Whether its end goes with the ring.
    follows: bool,
}

impl Held {
    /// A pushed end follows the ring both ways until the spring has no force; a free one stands.
    pub(super) fn at(c: &AxisChannel, state: &ChannelState, x: f64) -> Self {
        let (half, slip) = (0.5 * c.backlash, state.slip.x);
        let End { at_m, pushed } = state.play;
        if pushed != 0.0 {
            let elongation = x - pushed * half - slip;
            return if elongation * pushed > 0.0 {
                Self { elongation, follows: true }
            } else {
                Self { elongation: 0.0, follows: false }
            };
        }
        let end = at_m.clamp(x - half, x + half);
        Self { elongation: end - slip, follows: (x - at_m).abs() > half }
    }

    /// Slope of the stored energy over the deflection, N.
    pub(super) fn slope_n(&self, c: &AxisChannel) -> f64 {
        if self.follows { spring(c, X * self.elongation).0.x } else { 0.0 }
    }

    fn stored_j(&self, c: &AxisChannel) -> f64 {
        spring_energy(c, self.elongation.abs())
    }
}

/// Elongation of a free element after a step: c e' = −F(e), with the secant of F over the step.
fn gone_back(c: &AxisChannel, elongation: f64, damping: f64, h: f64) -> f64 {
    let force = spring(c, X * elongation).0.x;
    if force == 0.0 {
        return elongation;
    }
    elongation * (-(force / elongation) * h / damping).exp()
}

/// The element with the ring at deflection `x` moving at `v`, over a step of `h`.
pub(super) fn element(
    c: &AxisChannel,
    state: &ChannelState,
    x: f64,
    v: f64,
    damping: f64,
    h: f64,
) -> Element {
    let before = Held::at(c, state, x);
    let free = state.slip.x + gone_back(c, state.play.at_m - state.slip.x, damping, h);
    let apart = x - free;
    let mut next = *state;
    let mut force = 0.0;
    next.play = End::at(free);
    if apart.abs() > 0.5 * c.backlash {
        let way = apart.signum();
        let end = x - way * 0.5 * c.backlash;
        let elastic = spring(c, X * (end - state.slip.x)).0.x;
        let push = way * (elastic + damping * v);
        next.play = End { at_m: end, pushed: if push > 0.0 { way } else { 0.0 } };
        if push > 0.0 {
            force = -way * push;
            if let Some(b) = c.series_brake.as_ref().filter(|b| push > b.force) {
                let slip_rate = way * (push - b.force) / (damping + b.viscous);
                force = -(elastic + (v - slip_rate) * damping);
                next.slip.x += slip_rate * h;
            }
        }
    }
    let after = Held::at(c, &next, x);
    let lost_w = -force * v - before.slope_n(c) * v + (before.stored_j(c) - after.stored_j(c)) / h;
    let (_, branch) = spring(c, X * after.elongation);
    Element { force: ChannelForce { force: DVec3::X * force, lost_w, next }, branch }
}
