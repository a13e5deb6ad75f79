//! Coefficients of one coordinate from its filtered command and measurement.

#![expect(clippy::needless_range_loop, reason = "vectors and matrices by their indices")]

use docktwin_core::StateHasher;
use nalgebra::{Matrix3, Vector3};

use super::{BOUNDS, Coefficients, bounded, smooth::Smoothed};

/// Way at which there is something to learn from, m or rad: above the noise of the lengths.
const LEAST_WAY: f64 = 2e-5;
/// Acceleration at which a₂ can be learned, m/s² or rad/s²: above what the filter leaves of such noise.
const LEAST_ACCELERATION: f64 = 0.05;

/// Least squares over a window. Window, sampling and rates as in OpenFresco's examples.
#[derive(Clone, Debug)]
pub(super) struct Series {
    a: Coefficients,
    /// Samples: u, y, y', y''.
    samples: [[f64; 4]; SAMPLES],
    next: usize,
    full: bool,
    since_s: f64,
    /// What the last estimate said; the coefficients go there as fast as they may.
    found: Coefficients,
}

const SAMPLES: usize = 63;
/// Time between two samples, and two estimates, s.
const EVERY_S: f64 = 16e-3;
/// How fast the coefficients may change, 1/s, s/s, s²/s.
const RATES: Coefficients = [2.0, 0.05, 1e-3];
/// Least pivot of the scaled normal equations.
const LEAST_PIVOT: f64 = 1e-6;

impl Series {
    pub(super) const fn new(a: Coefficients) -> Self {
        Self { a, samples: [[0.0; 4]; SAMPLES], next: 0, full: false, since_s: 0.0, found: a }
    }

    pub(super) const fn coefficients(&self) -> Coefficients {
        self.a
    }

    pub(super) fn see(&mut self, s: &Smoothed, period_s: f64) {
        self.a = bounded(core::array::from_fn(|i| {
            let most = RATES[i] * period_s;
            self.a[i] + (self.found[i] - self.a[i]).clamp(-most, most)
        }));
        self.since_s += period_s;
        // Half a tick, so that rounding does not make it one more.
        if self.since_s < EVERY_S - 0.5 * period_s {
            return;
        }
        self.since_s = 0.0;
        self.samples[self.next] = [s.u, s.y[0], s.y[1], s.y[2]];
        self.next = (self.next + 1) % SAMPLES;
        self.full |= self.next == 0;
        let known = if self.full { SAMPLES } else { self.next };
        if let Some(found) = least_squares(&self.samples[..known], self.a[2]) {
            self.found = bounded(found);
        }
    }

    pub(super) fn hash_into(&self, h: &mut StateHasher) {
        let last = &self.samples[(self.next + SAMPLES - 1) % SAMPLES];
        self.a.iter().chain(&self.found).chain(last).for_each(|x| h.f64(*x));
        h.f64(self.since_s);
    }
}

/// `None` where the samples do not tell them apart; a₂ stays where nothing accelerates.
fn least_squares(samples: &[[f64; 4]], held: f64) -> Option<Coefficients> {
    let mut size = [0.0; 3];
    for s in samples {
        for i in 0..3 {
            size[i] += s[i + 1] * s[i + 1];
        }
    }
    let size = size.map(f64::sqrt);
    #[expect(clippy::cast_precision_loss, reason = "a few dozen")]
    let root = (samples.len() as f64).sqrt();
    if samples.len() < 3 || size[1] * BOUNDS[1][1] < LEAST_WAY * root {
        return None;
    }
    let accelerates = size[2] >= LEAST_ACCELERATION * root;
    let (mut m, mut v) = (Matrix3::zeros(), Vector3::zeros());
    for s in samples {
        let mut row = Vector3::from_fn(|i, _| s[i + 1] / size[i].max(f64::MIN_POSITIVE));
        let mut u = s[0];
        if !accelerates {
            (u, row[2]) = (u - held * s[3], 0.0);
        }
        m += row * row.transpose();
        v += row * u;
    }
    if !accelerates {
        (m[(2, 2)], v[2]) = (1.0, held * size[2].max(f64::MIN_POSITIVE));
    }
    let cholesky = m.cholesky()?;
    let pivots = cholesky.l_dirty().diagonal();
    if pivots.iter().any(|p| p * p < LEAST_PIVOT) {
        return None;
    }
    let x = cholesky.solve(&v);
    Some(core::array::from_fn(|i| x[i] / size[i].max(f64::MIN_POSITIVE)))
}

/// Along the gradient of the squared error, each coefficient by the size of what it multiplies.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gradient {
    a: Coefficients,
    /// Mean squares of y, y', y''.
    size: [f64; 3],
}

/// How fast the error falls, 1/s, and over which time sizes are averaged, s.
const GAIN_HZ: f64 = 2.0;
const AVERAGED_S: f64 = 0.5;

impl Gradient {
    pub(super) const fn new(a: Coefficients) -> Self {
        Self { a, size: [0.0; 3] }
    }

    pub(super) const fn coefficients(&self) -> Coefficients {
        self.a
    }

    pub(super) fn see(&mut self, s: &Smoothed, period_s: f64) {
        let part = (period_s / AVERAGED_S).min(1.0);
        for (size, y) in self.size.iter_mut().zip(s.y) {
            *size += (y * y - *size) * part;
        }
        let error = s.u - s.y.iter().zip(self.a).map(|(y, a)| y * a).sum::<f64>();
        for i in 0..3 {
            // What is as small as noise weighs nothing, and what has just begun no more than it will.
            let size = self.size[i].max(s.y[i] * s.y[i]);
            let noise = if i == 2 { LEAST_ACCELERATION } else { LEAST_WAY / BOUNDS[i][1] };
            if size > noise * noise {
                self.a[i] += GAIN_HZ * period_s * s.y[i] * error / size;
            }
        }
        self.a = bounded(self.a);
    }

    pub(super) fn hash_into(&self, h: &mut StateHasher) {
        self.a.iter().chain(&self.size).for_each(|x| h.f64(*x));
    }
}

/// Recursive least squares of a₁ and a₂ with forgetting; the lengths' scale is that of the encoders.
#[derive(Clone, Copy, Debug)]
pub(super) struct Recursive {
    a: [f64; 2],
    /// Covariance, in squares of the coefficients' units.
    p: [[f64; 2]; 2],
    first: [f64; 2],
}

/// Standard deviations at the beginning, s and s²; what of the lengths lag and second order do not explain, m: noise, and
/// legs that give way under a load; and memory, s.
const UNCERTAIN: [f64; 2] = [1e-3, 5e-6];
const NOISE_M: f64 = 5e-5;
const MEMORY_S: f64 = 1.0;

impl Recursive {
    pub(super) fn new([_, a1, a2]: Coefficients) -> Self {
        let first = UNCERTAIN.map(|u| u * u);
        Self { a: [a1, a2], p: [[first[0], 0.0], [0.0, first[1]]], first }
    }

    pub(super) const fn coefficients(&self) -> Coefficients {
        [1.0, self.a[0], self.a[1]]
    }

    pub(super) fn hash_into(&self, h: &mut StateHasher) {
        self.a.iter().chain(self.p.iter().flatten()).for_each(|x| h.f64(*x));
    }

    pub(super) fn see(&mut self, s: &Smoothed, period_s: f64) {
        let y = [s.y[1], s.y[2]];
        let error = s.u - s.y[0] - y[0] * self.a[0] - y[1] * self.a[1];
        let py = [0, 1].map(|i| self.p[i][0] * y[0] + self.p[i][1] * y[1]);
        let all = NOISE_M * NOISE_M + y[0] * py[0] + y[1] * py[1];
        let gain = py.map(|x| x / all);
        for i in 0..2 {
            self.a[i] += gain[i] * error;
            for k in 0..2 {
                self.p[i][k] -= gain[i] * py[k];
            }
        }
        // What is forgotten comes back, but never beyond what was not known at first.
        let keep = (-period_s / MEMORY_S).exp();
        for i in 0..2 {
            let most =
                (self.first[i] / self.p[i][i].max(f64::MIN_POSITIVE)).min(1.0 / keep).max(0.0);
            let root = most.sqrt();
            for k in 0..2 {
                self.p[i][k] *= root;
                self.p[k][i] *= root;
            }
        }
        let [_, a1, a2] = bounded(self.coefficients());
        self.a = [a1, a2];
    }
}

#[cfg(test)]
mod tests {
    use super::{super::smooth::Smooth, *};

    /// A plate 6 ms behind a drive of second order, moved by two sines: whoever learns finds both coefficients.
    fn learned(mut see: impl FnMut(&Smoothed)) {
        let mut smooth = Smooth::new();
        for i in 0..8000 {
            let t = f64::from(i) * 1e-3;
            // y is given, u what makes it.
            let y = |k: u32| -> f64 {
                [(0.02, 4.0), (0.008, 17.0)]
                    .iter()
                    .map(|(x, w): &(f64, f64)| {
                        x * w.powi(k.cast_signed())
                            * (w * t + f64::from(k) * core::f64::consts::FRAC_PI_2).sin()
                    })
                    .sum()
            };
            let u = y(0) + 6e-3 * y(1) + 3e-5 * y(2);
            see(&smooth.of(u, y(0), 1e-3));
        }
    }

    fn found(a: Coefficients) {
        assert!((a[0] - 1.0).abs() < 2e-3 && (a[1] - 6e-3).abs() < 1e-4, "{a:?}");
        assert!((a[2] - 3e-5).abs() < 6e-6, "{a:?}");
    }

    #[test]
    fn oracle_what_was_put_in_is_found() {
        let begin = [1.0, 5e-3, 2e-5];
        let (mut series, mut gradient, mut recursive) =
            (Series::new(begin), Gradient::new(begin), Recursive::new(begin));
        learned(|s| {
            series.see(s, 1e-3);
            gradient.see(s, 1e-3);
            recursive.see(s, 1e-3);
        });
        found(series.coefficients());
        found(gradient.coefficients());
        found(recursive.coefficients());
    }

    /// In free flight the lag is found, and noise of the lengths teaches nothing of the second order.
    #[test]
    fn oracle_noise_in_free_flight_leaves_the_second_order() {
        let begin = [1.0, 5e-3, 2e-4];
        let mut smooth = Smooth::new();
        let (mut series, mut gradient, mut recursive) =
            (Series::new(begin), Gradient::new(begin), Recursive::new(begin));
        let mut noise = 1_u64;
        for i in 0..4000 {
            noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let read = ((noise >> 33) as f64 / f64::from(u32::MAX >> 1) - 0.5) * 2e-5;
            let y = 0.1 * f64::from(i) * 1e-3;
            let s = smooth.of(y + 6e-3 * 0.1, y + read, 1e-3);
            // The filter has forgotten that it began.
            if i > 300 {
                series.see(&s, 1e-3);
                gradient.see(&s, 1e-3);
                recursive.see(&s, 1e-3);
            }
        }
        for (name, a) in [
            ("series", series.coefficients()),
            ("gradient", gradient.coefficients()),
            ("recursive", recursive.coefficients()),
        ] {
            // At 0.4 m and 0.1 m/s: what goes with the way may stand for the lag.
            let off = (a[0] - 1.0) * 0.4 + (a[1] - 6e-3) * 0.1;
            assert!(off.abs() < 5e-5 && (a[2] / 2e-4 - 1.0).abs() < 0.1, "{name}: {off} {a:?}");
        }
    }

    /// At rest nothing is learned.
    #[test]
    fn invariant_rest_teaches_nothing() {
        let begin = [1.0, 5e-3, 2e-5];
        let (mut series, mut gradient, mut recursive) =
            (Series::new(begin), Gradient::new(begin), Recursive::new(begin));
        let still = Smoothed { u: 0.0, y: [0.0; 3] };
        for _ in 0..5000 {
            series.see(&still, 1e-3);
            gradient.see(&still, 1e-3);
            recursive.see(&still, 1e-3);
        }
        for a in [series.coefficients(), gradient.coefficients(), recursive.coefficients()] {
            assert!(a.iter().zip(begin).all(|(x, y)| (x - y).abs() < 1e-12), "{a:?}");
        }
    }
}
