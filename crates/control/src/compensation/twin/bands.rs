//! How far the fast part of the twins' difference is to be trusted.
//!
//! A light ring chatters on its contacts at tens of hertz. Where the rig's ring does so otherwise than the ground
//! twin's, the difference of the twins is right in its slow part and noise in its fast one. Above 8 Hz, with r, m and
//! g the residual, what was measured and what the ground twin expected, and ⟨·⟩ the mean over 30 ms:
//!
//! ```text
//! share = 1 − ⟨r²⟩ / (⟨m²⟩ + ⟨g²⟩ + 2 · 10² N²), not below 0
//! ```
//!
//! That is twice the covariance of m and g over their power: 1 where they agree, 0 where they have nothing to do
//! with each other.

use core::f64::consts::TAU;

use docktwin_core::{StateHasher, Wrench};
use docktwin_physics::mounted::Ports;

use super::trust::size_n;

/// Corner between slow and fast, Hz.
const CORNER_HZ: f64 = 8.0;
/// Time over which powers are taken, s.
const MEMORY_S: f64 = 0.03;
/// Force that counts as noise, N.
const NOISE_N: f64 = 10.0;

/// Slow parts and fast powers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Bands {
    /// Slow part of the difference of the twins.
    difference: Ports,
    /// Slow parts of F4, M4 as measured and as expected.
    slow: [Wrench; 2],
    /// Mean squares of the fast parts, N²: of the residual; of measured and expected together.
    residual_n2: f64,
    both_n2: f64,
}

/// The part by which a first-order lag follows in a tick.
fn corner(period_s: f64) -> f64 {
    1.0 - (-TAU * CORNER_HZ * period_s).exp()
}

fn follow(slow: &mut Wrench, x: &Wrench, part: f64) -> Wrench {
    slow.f += (x.f - slow.f) * part;
    slow.m += (x.m - slow.m) * part;
    *x - *slow
}

impl Bands {
    /// Takes a tick in: F4, M4 as measured, and as the ground twin expected.
    pub(super) fn see(&mut self, measured: &Wrench, expected: &Wrench, period_s: f64) {
        let part = corner(period_s);
        let [m, g] = [measured, expected];
        let fast = [follow(&mut self.slow[0], m, part), follow(&mut self.slow[1], g, part)];
        let n2 = |w: &Wrench| size_n(w).powi(2);
        let memory = (period_s / MEMORY_S).min(1.0);
        let residual = fast[0] - fast[1];
        self.residual_n2 += (n2(&residual) - self.residual_n2) * memory;
        self.both_n2 += (n2(&fast[0]) + n2(&fast[1]) - self.both_n2) * memory;
    }

    /// Share of the fast part, 0 to 1.
    pub(super) fn fast_share(&self) -> f64 {
        let both_n2 = self.both_n2 + 2.0 * NOISE_N * NOISE_N;
        (1.0 - self.residual_n2 / both_n2).max(0.0)
    }

    /// The difference of the twins of a tick with its fast part weighed.
    pub(super) fn weigh(&mut self, difference: &Ports, period_s: f64) -> Ports {
        let (part, share) = (corner(period_s), self.fast_share());
        let slow = &mut self.difference;
        let port3 = follow(&mut slow.port3, &difference.port3, part);
        let port4 = follow(&mut slow.port4, &difference.port4, part);
        *slow + Ports { port3, port4 } * share
    }

    pub(super) fn hash_into(&self, h: &mut StateHasher) {
        let Self { difference, slow: [a, b], residual_n2, both_n2 } = self;
        for w in [&difference.port3, &difference.port4, a, b] {
            h.vec3(w.f);
            h.vec3(w.m);
        }
        h.f64(*residual_n2);
        h.f64(*both_n2);
    }
}

#[cfg(test)]
mod tests {
    use docktwin_core::DVec3;

    use super::*;

    /// Of sines far above the corner: all where they are the same, 2 a/(1 + a²) where one is a of the other, nothing a
    /// quarter of a period apart or with the other sign.
    #[test]
    fn oracle_the_share_is_that_of_the_covariance() {
        for (size, phase, expected) in [
            (1.0, 0.0, 1.0),
            (0.5, 0.0, 0.8),
            (1.0, 0.25, 0.0),
            (1.0, 1.0 / 6.0, 0.5),
            (1.0, 0.5, 0.0),
        ] {
            let mut bands = Bands::default();
            let wave = |t: f64| Wrench { f: DVec3::X * (1000.0 * t.sin()), m: DVec3::ZERO };
            let (mut sum, mut n) = (0.0, 0.0);
            for tick in 0..4000 {
                let t = TAU * 100.0 * f64::from(tick) * 1e-3;
                let g = wave(t + TAU * phase);
                let g = Wrench { f: g.f * size, m: g.m };
                bands.see(&wave(t), &g, 1e-3);
                if tick >= 2000 {
                    sum += bands.fast_share();
                    n += 1.0;
                }
            }
            assert!((sum / n - expected).abs() < 0.02, "{size} {phase}: {} {expected}", sum / n);
        }
    }

    /// Where nothing is fast the difference passes whole, fast or not.
    #[test]
    fn oracle_a_difference_passes_where_the_twins_agree() {
        let mut bands = Bands::default();
        for tick in 0..500 {
            let f = DVec3::X * (100.0 * f64::from(tick % 7));
            let port4 = Wrench { f, m: DVec3::ZERO };
            bands.see(&port4, &port4, 1e-3);
            let difference = Ports { port4, ..Ports::default() };
            let out = bands.weigh(&difference, 1e-3);
            assert!((out.port4.f - f).length() < 1e-9, "{out:?}");
        }
    }
}
