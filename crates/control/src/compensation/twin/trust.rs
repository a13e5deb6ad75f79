//! How far the twins' difference is to be trusted, by how well the ground twin meets what is measured.
//!
//! Over the last 50 ms the mean square of the residual stands over that of the uncertainty that a model of this
//! kind has: a floor, and a share of the force. `x` is the root of that ratio. Sides that touch in one and not in
//! the other for a part `d` of that time count beside it:
//!
//! ```text
//! share = (1 − d) / (1 + (x/4)⁴)
//! ```
//!
//! A residual as large as the uncertainty leaves 99.6 %, one as large as the force itself a half. Below a tenth
//! the method gives up for the rest of the run, and the correction fades.

use docktwin_core::{PORT_CONTACT_N, StateHasher, Wrench};

/// Time over which the residual is judged, s.
const MEMORY_S: f64 = 0.05;
/// Uncertainty of the model that no force has a part in, N: 20 µm of mounts and pose at 1e6 N/m, and the sensor.
const FLOOR_N: f64 = 25.0;
/// The part of the force that a model of a mechanism may be wrong by.
const RELATIVE: f64 = 0.25;
/// Moments count as forces at this arm, m: the radius of the ring.
const ARM_M: f64 = 0.6;
/// Uncertainties of residual that leave a half.
const HALF: f64 = 4.0;
/// Share below which the method gives up.
const LEAST_SHARE: f64 = 0.1;
/// Time in which a correction that was given up fades, s.
const FADING_S: f64 = 0.02;

/// The judgement so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Trust {
    /// Mean squares over the memory, N²: residual, and force.
    residual_n2: f64,
    force_n2: f64,
    /// Part of the memory in which one side touched alone.
    apart: f64,
    /// What is left after giving up; `None` before.
    fading: Option<f64>,
}

/// Size of a wrench, N.
pub(super) fn size_n(w: &Wrench) -> f64 {
    w.f.length().hypot(w.m.length() / ARM_M)
}

impl Trust {
    /// Takes a tick in: F4, M4 as measured, and as the ground twin expected.
    pub(super) fn see(&mut self, measured: &Wrench, expected: &Wrench, period_s: f64) {
        let (a, b) = (size_n(measured), size_n(expected));
        let residual_n = size_n(&(*measured - *expected));
        let (less, more) = (a.min(b), a.max(b));
        let alone = less < PORT_CONTACT_N && more > 2.0 * FLOOR_N;
        let part = (period_s / MEMORY_S).min(1.0);
        let mix = |mean: &mut f64, x: f64| *mean += (x - *mean) * part;
        mix(&mut self.residual_n2, residual_n * residual_n);
        mix(&mut self.force_n2, more * more);
        mix(&mut self.apart, if alone { 1.0 } else { 0.0 });
        if let Some(left) = &mut self.fading {
            *left *= 1.0 - (period_s / FADING_S).min(1.0);
        } else if self.judged() < LEAST_SHARE {
            self.give_up();
        }
    }

    fn judged(&self) -> f64 {
        let uncertainty_n2 = FLOOR_N * FLOOR_N + RELATIVE * RELATIVE * self.force_n2;
        let x2 = self.residual_n2 / (uncertainty_n2 * HALF * HALF);
        (1.0 - self.apart) / (1.0 + x2 * x2)
    }

    /// The share of the correction that is applied.
    pub(super) fn share(&self) -> f64 {
        self.fading.unwrap_or_else(|| self.judged())
    }

    /// Goes on without.
    pub(super) fn give_up(&mut self) {
        self.fading = Some(self.share());
    }

    /// Goes on without, from now on: there is nothing that could fade.
    pub(super) const fn give_up_at_once(&mut self) {
        self.fading = Some(0.0);
    }

    /// Whether it has given up.
    pub(super) const fn gave_up(&self) -> bool {
        self.fading.is_some()
    }

    pub(super) fn hash_into(&self, h: &mut StateHasher) {
        let all = [self.residual_n2, self.force_n2, self.apart, self.fading.unwrap_or(-1.0)];
        all.iter().for_each(|x| h.f64(*x));
    }
}

#[cfg(test)]
mod tests {
    use docktwin_core::DVec3;

    use super::*;

    fn force(x: f64) -> Wrench {
        Wrench { f: DVec3::X * x, m: DVec3::ZERO }
    }

    /// After a long time at constant forces the share is the formula's.
    #[test]
    fn oracle_the_share_of_a_constant_residual() {
        for (measured, expected) in
            [(1000.0, 1000.0), (1000.0, 750.0), (1000.0, 100.0), (20.0, 10.0)]
        {
            let mut trust = Trust::default();
            (0..1000).for_each(|_| trust.see(&force(measured), &force(expected), 1e-3));
            let u2 = 25.0_f64.powi(2) + (0.25 * f64::max(measured, expected)).powi(2);
            let x = (measured - expected) / u2.sqrt();
            let want = 1.0 / (1.0 + (x / 4.0).powi(4));
            assert!((trust.share() - want).abs() < 1e-6, "{measured} {expected}: {want}");
            assert!(!trust.gave_up());
        }
    }

    /// A contact that the hardware does not have, or that the twin does not expect, ends it; at 50 ms of memory
    /// that takes 50 ms · ln(1/(2 · 0.1)) = 80 ms, as a residual of the whole force leaves a half.
    #[test]
    fn oracle_a_contact_of_one_side_alone_is_given_up() {
        for (measured, expected) in [(0.0, 2000.0), (2000.0, 0.0)] {
            let mut trust = Trust::default();
            let ticks = (0..1000).take_while(|_| {
                trust.see(&force(measured), &force(expected), 1e-3);
                !trust.gave_up()
            });
            let ticks = ticks.count();
            assert!((70..90).contains(&ticks), "{ticks} ticks");
            // It fades, and does not come back.
            (0..200).for_each(|_| trust.see(&force(500.0), &force(500.0), 1e-3));
            assert!(trust.share() < 1e-3 && trust.gave_up());
        }
    }

    #[test]
    fn invariant_a_short_difference_at_a_contact_edge_costs_little() {
        let mut trust = Trust::default();
        (0..10).for_each(|_| trust.see(&force(300.0), &force(0.0), 1e-3));
        (0..200).for_each(|_| trust.see(&force(2000.0), &force(1800.0), 1e-3));
        assert!(trust.share() > 0.95 && !trust.gave_up(), "{}", trust.share());
    }
}
