//! Coefficients of one coordinate from its filtered command and measurement.

#![expect(clippy::needless_range_loop, reason = "vectors and matrices by their indices")]

use nalgebra::{Matrix3, Vector3};

use super::{BOUNDS, Coefficients, bounded, smooth::Smoothed};

/// Way at which there is something to learn from, m or rad: above the noise of the lengths.
const LEAST_WAY: f64 = 2e-5;

/// Least squares over a window. Window, sampling and rates as in OpenFresco's examples.
#[derive(Clone, Debug)]
pub(super) struct Series {
    a: Coefficients,
    /// Samples: u, y, y', y''.
    samples: [[f64; 4]; SAMPLES],
    next: usize,
    full: bool,
    ticks: u32,
}

const SAMPLES: usize = 63;
/// Ticks between two samples, and two estimates.
const EVERY: u32 = 16;
/// How fast the coefficients may change, 1/s, s/s, s²/s.
const RATES: Coefficients = [2.0, 0.05, 1e-3];
/// Least pivot of the scaled normal equations.
const LEAST_PIVOT: f64 = 1e-6;

impl Series {
    pub(super) const fn new(a: Coefficients) -> Self {
        Self { a, samples: [[0.0; 4]; SAMPLES], next: 0, full: false, ticks: 0 }
    }

    pub(super) const fn coefficients(&self) -> Coefficients {
        self.a
    }

    pub(super) fn see(&mut self, s: &Smoothed, period_s: f64) {
        self.ticks += 1;
        if self.ticks < EVERY {
            return;
        }
        self.ticks = 0;
        self.samples[self.next] = [s.u, s.y[0], s.y[1], s.y[2]];
        self.next = (self.next + 1) % SAMPLES;
        self.full |= self.next == 0;
        let known = if self.full { SAMPLES } else { self.next };
        if let Some(found) = least_squares(&self.samples[..known]) {
            let most = RATES.map(|r| r * f64::from(EVERY) * period_s);
            self.a = bounded(core::array::from_fn(|i| {
                self.a[i] + (found[i] - self.a[i]).clamp(-most[i], most[i])
            }));
        }
    }
}

/// `None` where the samples do not tell all three apart.
fn least_squares(samples: &[[f64; 4]]) -> Option<Coefficients> {
    let mut size = [0.0; 3];
    for s in samples {
        for i in 0..3 {
            size[i] += s[i + 1] * s[i + 1];
        }
    }
    let size = size.map(f64::sqrt);
    #[expect(clippy::cast_precision_loss, reason = "a few dozen")]
    let root = (samples.len() as f64).sqrt();
    if samples.len() < 3 || size[1] * BOUNDS[1][1] < LEAST_WAY * root || size[2] <= 0.0 {
        return None;
    }
    let (mut m, mut v) = (Matrix3::zeros(), Vector3::zeros());
    for s in samples {
        let row = Vector3::from_fn(|i, _| s[i + 1] / size[i].max(f64::MIN_POSITIVE));
        m += row * row.transpose();
        v += row * s[0];
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
            // What is as small as noise weighs nothing.
            let noise = LEAST_WAY / BOUNDS[i][1];
            self.a[i] += GAIN_HZ * period_s * s.y[i] * error / (self.size[i] + noise * noise);
        }
        self.a = bounded(self.a);
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
