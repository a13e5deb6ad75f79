//! An unscented Kalman filter (Julier and Uhlmann 1997, in the form of Wan and van der Merwe 2000) of one coordinate of the
//! plate and of its drive:
//!
//! ```text
//! y'' = (u − y − τ y')/(κ τ²)      state: y, y', ln τ, ln κ; measured: y
//! ```
//!
//! A dead time τ is κ = ½ to the second order, a position loop 2ζ/ω and 1/ω². The inverse is `1 + τ s + κ τ² s²`.

use docktwin_core::StateHasher;
use nalgebra::{SMatrix, SVector};

use super::Coefficients;

const N: usize = 4;
type State = SVector<f64, N>;
type Covariance = SMatrix<f64, N, N>;

/// Shortest lag that is followed, s: below it the model is stiffer than a tick can show.
const LEAST_LAG_S: f64 = 1.5e-3;
/// Noise of a measured length, m.
const NOISE_M: f64 = 1e-5;
/// Standard deviations of ln τ and ln κ at first.
const UNCERTAIN: [f64; 2] = [0.2, 0.2];
/// Random walk of y', m/s², and of ln τ and ln κ, in the root of a second.
const WALK: [f64; 3] = [0.05, 0.02, 0.02];
/// Steps of the model in a tick.
const STEPS: u32 = 4;
/// Spread of the sigma points: n + λ of the source.
const SPREAD: f64 = 3.0;

/// See the module's page.
#[derive(Clone, Debug)]
pub(super) struct Unscented {
    x: State,
    p: Covariance,
    /// Command of the tick before.
    before: Option<f64>,
    believed: Coefficients,
    /// What is believed where the lag is too short to be followed.
    fixed: Option<Coefficients>,
}

impl Unscented {
    pub(super) fn new(believed: Coefficients) -> Self {
        let [_, a1, a2] = believed;
        let fixed = (a1 < LEAST_LAG_S || a2 <= 0.0).then_some(believed);
        let lag = a1.max(LEAST_LAG_S);
        let shape = if fixed.is_some() { 0.5 } else { a2 / (lag * lag) };
        let x = State::new(0.0, 0.0, lag.ln(), shape.ln());
        Self { x, p: Covariance::zeros(), before: None, believed, fixed }
    }

    pub(super) fn coefficients(&self) -> Coefficients {
        self.fixed.unwrap_or_else(|| {
            let (lag, shape) = (self.x[2].exp(), self.x[3].exp());
            [1.0, lag, shape * lag * lag]
        })
    }

    pub(super) fn see(&mut self, u: f64, y: f64, period_s: f64) {
        if self.fixed.is_some() {
            return;
        }
        let Some(before) = self.before.replace(u) else {
            (self.x[0], self.x[1]) = (y, 0.0);
            let sd = [NOISE_M, 0.02, UNCERTAIN[0], UNCERTAIN[1]];
            self.p = Covariance::from_diagonal(&State::from(sd.map(|s| s * s)));
            return;
        };
        let Some(root) = (self.p * SPREAD).cholesky() else {
            // Rounding has eaten the covariance: begin again with what is known.
            self.before = None;
            return;
        };
        let root = root.l();
        let weight = |i: usize| {
            if i == 0 { (SPREAD - N as f64) / SPREAD } else { 0.5 / SPREAD }
        };
        let points: [State; 2 * N + 1] = core::array::from_fn(|i| {
            let at = match i {
                0 => self.x,
                _ if i <= N => self.x + root.column(i - 1),
                _ => self.x - root.column(i - 1 - N),
            };
            moved(at, 0.5 * (before + u), period_s)
        });
        let mean = points.iter().enumerate().fold(State::zeros(), |s, (i, x)| s + x * weight(i));
        let mut p = points.iter().enumerate().fold(Covariance::zeros(), |s, (i, x)| {
            let d = x - mean;
            s + d * d.transpose() * weight(i)
        });
        for (k, walk) in (1..N).zip(WALK) {
            p[(k, k)] += walk * walk * period_s;
        }
        // Only y is measured: what is linear needs no points.
        let all = p[(0, 0)] + NOISE_M * NOISE_M;
        let gain = p.column(0) / all;
        self.x = mean + gain * (y - mean[0]);
        let p = p - gain * gain.transpose() * all;
        self.p = (p + p.transpose()) * 0.5;
        let lags = [LEAST_LAG_S.ln(), 0.06_f64.ln()];
        self.x[2] = self.x[2].clamp(lags[0], lags[1]);
        self.x[3] = self.x[3].clamp(0.1_f64.ln(), 2.0_f64.ln());
        if !self.x.iter().chain(self.p.iter()).all(|x| x.is_finite()) {
            *self = Self::new(self.believed);
        }
    }

    pub(super) fn hash_into(&self, h: &mut StateHasher) {
        self.x.iter().chain(self.p.iter()).for_each(|x| h.f64(*x));
    }
}

/// A point a tick later.
fn moved(mut x: State, u: f64, period_s: f64) -> State {
    let h = period_s / f64::from(STEPS);
    let lag = x[2].exp().clamp(0.5 * LEAST_LAG_S, 0.12);
    let stiff = 1.0 / (x[3].exp().clamp(0.05, 4.0) * lag * lag);
    for _ in 0..STEPS {
        // Implicit in both, so that no lag is too short for it.
        let speed = (x[1] + h * stiff * (u - x[0])) / (1.0 + h * stiff * (lag + h));
        x[0] += h * speed;
        x[1] = speed;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A position loop of 2 Hz more than believed: both coefficients are found.
    #[test]
    fn oracle_a_position_loop_is_found() {
        let (w, z) = (core::f64::consts::TAU * 14.0, 0.7);
        let mut filter = Unscented::new([1.0, 2.0 * 0.7 / 75.0, 1.0 / (75.0 * 75.0)]);
        let (mut y, mut v) = (0.0, 0.0);
        for i in 0..20_000 {
            let t = f64::from(i) * 1e-3;
            let u = 0.02 * (4.0 * t).sin() + 0.008 * (17.0 * t).sin();
            filter.see(u, y, 1e-3);
            for _ in 0..20 {
                v += 5e-5 * (w * w * (u - y) - 2.0 * z * w * v);
                y += 5e-5 * v;
            }
        }
        let [_, a1, a2] = filter.coefficients();
        assert!((a1 / (2.0 * z / w) - 1.0).abs() < 0.06, "{a1}");
        assert!((a2 * w * w - 1.0).abs() < 0.1, "{a2}");
    }
}
