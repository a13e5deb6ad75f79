//! The part of sampled signals that swings with one frequency and its multiples, by least squares:
//! samples may be missing, and a drift does not matter.

use nalgebra::{Complex, DMatrix, DVector};

/// Collects samples of `M` signals.
#[derive(Clone, Debug)]
pub struct Harmonic<const M: usize> {
    rate_rad_s: f64,
    begin_s: Option<f64>,
    squares: DMatrix<f64>,
    products: DMatrix<f64>,
    power: [f64; M],
    samples: u32,
    basis: DVector<f64>,
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found<const M: usize> {
    /// `x(t) = Σ Re(X_n e^{jnωt})` beside mean and drift: X_1, X_2, …
    pub amplitude: Vec<[Complex<f64>; M]>,
    /// Root mean square of what is left.
    pub rest: [f64; M],
}

impl<const M: usize> Harmonic<M> {
    /// For a rate ω, rad/s, and so many multiples of it, itself counted.
    #[must_use]
    pub fn new(rate_rad_s: f64, multiples: usize) -> Self {
        let n = 2 + 2 * multiples;
        Self {
            rate_rad_s,
            begin_s: None,
            squares: DMatrix::zeros(n, n),
            products: DMatrix::zeros(n, M),
            power: [0.0; M],
            samples: 0,
            basis: DVector::zeros(n),
        }
    }

    /// A sample of every signal at `time_s`.
    pub fn push(&mut self, time_s: f64, signals: &[f64; M]) {
        let begin_s = *self.begin_s.get_or_insert(time_s);
        (self.basis[0], self.basis[1]) = (1.0, time_s - begin_s);
        let mut rate = 0.0;
        for i in 1..self.basis.len() / 2 {
            rate += self.rate_rad_s;
            let (s, c) = (rate * time_s).sin_cos();
            (self.basis[2 * i], self.basis[2 * i + 1]) = (c, s);
        }
        self.squares.ger(1.0, &self.basis, &self.basis, 1.0);
        for (i, x) in signals.iter().enumerate() {
            self.products.column_mut(i).axpy(*x, &self.basis, 1.0);
            self.power[i] += x * x;
        }
        self.samples += 1;
    }

    /// What they hold; `None` with fewer than 50 samples, or with samples that tell nothing of ω.
    #[must_use]
    pub fn found(&self) -> Option<Found<M>> {
        if self.samples < 50 {
            return None;
        }
        let x = self.squares.clone().cholesky()?.solve(&self.products);
        let n = f64::from(self.samples);
        let multiples = 1..self.basis.len() / 2;
        Some(Found {
            amplitude: multiples
                .map(|k| core::array::from_fn(|i| Complex::new(x[(2 * k, i)], -x[(2 * k + 1, i)])))
                .collect(),
            rest: core::array::from_fn(|i| {
                let fitted = x.column(i).dot(&self.products.column(i));
                ((self.power[i] - fitted).max(0.0) / n).sqrt()
            }),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_amplitude_and_phase_with_gaps_and_drift() {
        let w = 7.0;
        let mut h = Harmonic::<2>::new(w, 3);
        let want = [Complex::new(0.3, -0.4), Complex::new(-2.0, 0.1)];
        for i in 0..2000 {
            let t = 5.0 + f64::from(i) * 1e-3;
            if i % 7 == 3 || (400..450).contains(&i) {
                continue;
            }
            let turn = Complex::new(0.0, w * t).exp();
            let x = want.map(|a| (a * turn).re);
            h.push(t, &[x[0] + 3.0 + 0.2 * t, x[1] - 5.0 + (3.0 * w * t).sin()]);
        }
        let found = h.found().expect("two seconds of samples");
        for (a, b) in found.amplitude[0].into_iter().zip(want) {
            assert!((a - b).norm() < 1e-9, "{a} for {b}");
        }
        assert!((found.amplitude[2][1] - Complex::new(0.0, -1.0)).norm() < 1e-9);
        assert!(found.rest.iter().all(|r| *r < 1e-6));
        assert!(Harmonic::<1>::new(w, 1).found().is_none());
    }
}
