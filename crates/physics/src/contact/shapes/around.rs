//! Extremes around a circle, certified. Where a distance from a circle or wall of a core turned about X is
//! stationary, `A(t) + b ρ'(t) = 0` with A of first degree in cos t and sin t; with ρ² = q that is among the roots of
//! `4 A² q − b² q'²`, of fourth degree. Those are isolated by bounds of the polynomial and its derivatives.

use core::f64::consts::TAU;

use arrayvec::ArrayVec;

use super::extremes::{Extreme, root};

/// Degrees of a polynomial in cos t and sin t.
const DEGREE: usize = 4;
/// Most points between which a slope keeps its sign: five polynomials with up to eight roots.
const MOST_POINTS: usize = 48;
/// Half of the shortest piece that is looked at: about a double root such pieces follow each other, and are one point.
/// Two extremes within one are less than a nanometre apart in depth.
const FINEST: f64 = 1e-6;

/// `Σ c_k cos kt + s_k sin kt`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wave {
    c: [f64; DEGREE + 1],
    s: [f64; DEGREE + 1],
}

impl Wave {
    /// `constant + cos_part cos t + sin_part sin t`.
    pub(super) fn first(constant: f64, cos_part: f64, sin_part: f64) -> Self {
        let mut out = Self::default();
        (out.c[0], out.c[1], out.s[1]) = (constant, cos_part, sin_part);
        out
    }

    pub(super) fn plus(mut self, other: Self, scale: f64) -> Self {
        for k in 0..=DEGREE {
            self.c[k] += scale * other.c[k];
            self.s[k] += scale * other.s[k];
        }
        self
    }

    /// The product; what is beyond the fourth degree is none.
    pub(super) fn times(self, other: Self) -> Self {
        let mut out = Self::default();
        for i in 0..=DEGREE {
            for j in 0..=DEGREE {
                let (a, b) = (i.abs_diff(j), i + j);
                let sign = if i >= j { 1.0 } else { -1.0 };
                let half = |x: f64, y: f64| 0.5 * x * y;
                let (cc, ss) = (half(self.c[i], other.c[j]), half(self.s[i], other.s[j]));
                let (cs, sc) = (half(self.c[i], other.s[j]), half(self.s[i], other.c[j]));
                out.c[a] += cc + ss;
                out.s[a] += sign * (sc - cs);
                if b <= DEGREE {
                    out.c[b] += cc - ss;
                    out.s[b] += sc + cs;
                }
            }
        }
        out.s[0] = 0.0;
        out
    }

    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    pub(super) fn derivative(self) -> Self {
        let mut out = Self::default();
        for k in 1..=DEGREE {
            (out.c[k], out.s[k]) = (k as f64 * self.s[k], -(k as f64) * self.c[k]);
        }
        out
    }

    fn at(&self, t: f64) -> f64 {
        let (s1, c1) = t.sin_cos();
        let (mut s, mut c, mut sum) = (0.0, 1.0, 0.0);
        for k in 0..=DEGREE {
            sum += self.c[k] * c + self.s[k] * s;
            (s, c) = (s * c1 + c * s1, c * c1 - s * s1);
        }
        sum
    }

    /// It is nowhere larger.
    fn bound(&self) -> f64 {
        (0..=DEGREE).map(|k| self.c[k].hypot(self.s[k])).sum()
    }
}

/// Points around a circle.
#[derive(Debug, Default)]
pub(super) struct Points {
    sorted: ArrayVec<f64, MOST_POINTS>,
    /// Shortest pieces that follow each other, so far.
    cluster: Option<[f64; 2]>,
}

impl Points {
    /// Adds every root of a polynomial.
    pub(super) fn add_roots(&mut self, p: &Wave) {
        const PARTS: u32 = 16;
        let slope = p.derivative();
        let bounds = [slope.bound(), slope.derivative().bound()];
        // A polynomial that is zero has no roots that matter: nothing changes around the circle.
        if p.bound() < 1e-20 {
            return;
        }
        for i in 0..PARTS {
            let at = |i: u32| f64::from(i) / f64::from(PARTS) * TAU;
            self.within(p, &slope, bounds, [at(i), at(i + 1)]);
        }
        self.close();
    }

    fn close(&mut self) {
        if let Some([lo, hi]) = self.cluster.take() {
            self.add(0.5 * (lo + hi));
        }
    }

    fn within(&mut self, p: &Wave, slope: &Wave, bounds: [f64; 2], [lo, hi]: [f64; 2]) {
        let (middle, half) = (0.5 * (lo + hi), 0.5 * (hi - lo));
        if p.at(middle).abs() > bounds[0] * half {
            return;
        }
        if slope.at(middle).abs() > bounds[1] * half {
            let (a, b) = (p.at(lo), p.at(hi));
            if (a < 0.0) != (b < 0.0) {
                self.add(root(lo, hi, a < 0.0, |t| p.at(t)));
            }
            return;
        }
        if half < FINEST {
            match &mut self.cluster {
                Some([_, end]) if lo - *end < FINEST => *end = hi,
                _ => {
                    self.close();
                    self.cluster = Some([lo, hi]);
                }
            }
            return;
        }
        self.within(p, slope, bounds, [lo, middle]);
        self.within(p, slope, bounds, [middle, hi]);
    }

    fn add(&mut self, t: f64) {
        let place = self.sorted.partition_point(|x| *x < t);
        if !self.sorted.is_full() {
            self.sorted.insert(place, t);
        }
    }

    /// All extremes around the circle, minima and maxima in turn beginning with a minimum; the point 0 alone
    /// where nothing changes.
    pub(super) fn extremes(&self, slope: impl Fn(f64) -> f64) -> ArrayVec<Extreme, MOST_POINTS> {
        let n = self.sorted.len();
        let mut out: ArrayVec<Extreme, MOST_POINTS> = ArrayVec::new();
        // Between two points the slope keeps its sign.
        let middle = |i: usize| {
            let next = if i + 1 < n { self.sorted[i + 1] } else { self.sorted[0] + TAU };
            0.5 * (self.sorted[i] + next)
        };
        for i in 0..n {
            let last = if i == 0 { middle(n - 1) - TAU } else { middle(i - 1) };
            let (before, after) = (slope(last) < 0.0, slope(middle(i)) < 0.0);
            if before != after {
                let at = root(last, middle(i), before, &slope);
                let _ = out.try_push(Extreme { at, least: before });
            }
        }
        if out.first().is_some_and(|e| !e.least) {
            out.rotate_left(1);
        }
        if out.is_empty() {
            out.push(Extreme { at: 0.0, least: true });
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_products_and_roots_of_waves() {
        let (a, b) = (Wave::first(0.3, -1.0, 0.7), Wave::first(-0.2, 0.4, 1.1));
        let p = a.times(b).times(a.plus(b, -2.0));
        for i in 0..40 {
            let t = f64::from(i) * 0.17;
            let want = a.at(t) * b.at(t) * (a.at(t) - 2.0 * b.at(t));
            assert!((p.at(t) - want).abs() < 1e-14, "{t}");
            let slope = (p.at(t + 1e-6) - p.at(t - 1e-6)) / 2e-6;
            assert!((p.derivative().at(t) - slope).abs() < 1e-8, "{t}");
        }
        let mut points = Points::default();
        points.add_roots(&p);
        assert_eq!(points.sorted.len(), 6, "{points:?}");
        assert!(points.sorted.iter().all(|t| p.at(*t).abs() < 1e-12));
    }
}
