//! Filters of the leg control: analogue prototypes brought to the sampled world by the bilinear
//! transform, run by `biquad`.

use biquad::{Biquad as _, Coefficients, DirectForm2Transposed};
use core::f64::consts::TAU;
use nalgebra::Complex;

/// A second-order section with real coefficients.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    coefficients: Coefficients<f64>,
    memory: DirectForm2Transposed<f64>,
}

impl Section {
    /// The bilinear transform `s = 2/T (z − 1)/(z + 1)` of
    /// `(n₂s² + n₁s + n₀)/(d₂s² + d₁s + d₀)`, coefficients in this order.
    #[must_use]
    pub fn bilinear(numerator: [f64; 3], denominator: [f64; 3], sample_s: f64) -> Self {
        let c = 2.0 / sample_s;
        // (z + 1)² P(s) as a polynomial in z, highest power first.
        let z = |[p2, p1, p0]: [f64; 3]| {
            let (q2, q1) = (p2 * c * c, p1 * c);
            [q2 + q1 + p0, 2.0 * (p0 - q2), q2 - q1 + p0]
        };
        Self::of_polynomials(z(numerator), z(denominator))
    }

    /// From polynomials in z, highest power first.
    fn of_polynomials(b: [f64; 3], a: [f64; 3]) -> Self {
        let coefficients = Coefficients {
            a1: a[1] / a[0],
            a2: a[2] / a[0],
            b0: b[0] / a[0],
            b1: b[1] / a[0],
            b2: b[2] / a[0],
        };
        Self { coefficients, memory: DirectForm2Transposed::new(coefficients) }
    }

    /// First-order high-pass with corner `corner_hz`: takes out what is steady.
    #[must_use]
    pub fn high_pass(corner_hz: f64, sample_s: f64) -> Self {
        // Of first order in z too: the common factor z + 1 of a second-order form would be a hidden
        // pole on the unit circle.
        let (c, w) = (2.0 / sample_s, TAU * corner_hz);
        Self::of_polynomials([c, -c, 0.0], [c + w, w - c, 0.0])
    }

    /// Takes a second-order lag away and puts a faster one in its place.
    #[must_use]
    pub fn lead(from: [f64; 2], to: [f64; 2], sample_s: f64) -> Self {
        let lag = |[hz, damping]: [f64; 2]| {
            let w = TAU * hz;
            [1.0 / (w * w), 2.0 * damping / w, 1.0]
        };
        Self::bilinear(lag(from), lag(to), sample_s)
    }

    /// Passes everything unchanged.
    #[must_use]
    pub fn identity() -> Self {
        Self::bilinear([0.0, 0.0, 1.0], [0.0, 0.0, 1.0], 1.0)
    }

    /// The next sample.
    pub fn run(&mut self, x: f64) -> f64 {
        self.memory.run(x)
    }

    /// Both memories of the section.
    #[must_use]
    pub const fn state(&self) -> [f64; 2] {
        [self.memory.s1, self.memory.s2]
    }

    /// State space `x' = A x + B u`, `y = C x + D u` from sample to sample, in the order A, B, C, D.
    #[must_use]
    pub fn state_space(&self) -> ([[f64; 2]; 2], [f64; 2], [f64; 2], f64) {
        let Coefficients { a1, a2, b0, b1, b2 } = self.coefficients;
        ([[-a1, 1.0], [-a2, 0.0]], [b1 - a1 * b0, b2 - a2 * b0], [1.0, 0.0], b0)
    }

    /// Response at `hz` when run every `sample_s`.
    #[must_use]
    pub fn response(&self, hz: f64, sample_s: f64) -> Complex<f64> {
        let Coefficients { a1, a2, b0, b1, b2 } = self.coefficients;
        let d = Complex::new(0.0, -TAU * hz * sample_s).exp();
        (d * (d * b2 + b1) + b0) / (d * (d * a2 + a1) + 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const T: f64 = 2.5e-4;

    /// The bilinear transform is the analogue response at the warped frequency, exactly.
    #[test]
    fn oracle_sections_are_their_analogue_prototypes() {
        for hz in [0.1, 1.0, 2.0, 10.0, 50.0, 250.0, 1000.0] {
            let s = Complex::new(0.0, 2.0 / T * (0.5 * TAU * hz * T).tan());
            let exact = s / (s + TAU * 2.0);
            let error = (Section::high_pass(2.0, T).response(hz, T) - exact).norm();
            assert!(error < 1e-9, "high-pass at {hz}: {error}");
            let lag = |f: f64, z: f64| {
                let x = s / (TAU * f);
                x * x + x * (2.0 * z) + 1.0
            };
            let exact = lag(80.0, 0.7) / lag(250.0, 0.9);
            let lead = Section::lead([80.0, 0.7], [250.0, 0.9], T).response(hz, T);
            assert!((lead / exact - 1.0).norm() < 1e-9, "lead at {hz}");
        }
    }

    /// What runs has the response that is computed, and the state space is the same filter.
    #[test]
    fn oracle_a_running_section_has_its_response() {
        let f = Section::lead([80.0, 0.7], [250.0, 0.9], T);
        let (a, b, c, d) = f.state_space();
        for hz in [5.0, 40.0, 160.0] {
            let (mut run, mut x) = (f, [0.0; 2]);
            let mut sum = Complex::new(0.0, 0.0);
            for i in 0..8000 {
                let phase = TAU * hz * T * f64::from(i);
                let u = phase.sin();
                let y = run.run(u);
                let same = c[0] * x[0] + c[1] * x[1] + d * u;
                assert!((y - same).abs() < 1e-9 * (1.0 + y.abs()));
                x = [
                    a[0][0] * x[0] + a[0][1] * x[1] + b[0] * u,
                    a[1][0] * x[0] + a[1][1] * x[1] + b[1] * u,
                ];
                if i >= 4000 {
                    sum += Complex::new(0.0, -phase).exp() * y * (2.0 / 4000.0);
                }
            }
            let measured = sum * Complex::new(0.0, 1.0);
            assert!((measured / f.response(hz, T) - 1.0).norm() < 1e-6, "{hz}");
        }
    }
}
