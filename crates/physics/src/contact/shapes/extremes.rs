//! Local extremes along a line, certified: the slope keeps its sign or is monotone between given points.

use arrayvec::ArrayVec;

/// Points between which a slope is monotone, with both ends.
pub(crate) const MOST_POINTS: usize = 16;
/// Most extremes, ends included.
const MOST_EXTREMES: usize = 16;

/// One local extreme of a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extreme {
    pub(crate) at: f64,
    /// A minimum, or a maximum between two of them.
    pub(crate) least: bool,
}

/// Breaks of the interval 0 … 1, kept sorted.
#[derive(Debug, Default)]
pub(crate) struct Breaks(ArrayVec<f64, MOST_POINTS>);

impl Breaks {
    pub(crate) fn new() -> Self {
        let mut out = ArrayVec::new();
        out.push(0.0);
        out.push(1.0);
        Self(out)
    }

    /// Adds a point; one outside of the interval is none.
    pub(crate) fn add(&mut self, s: f64) {
        if s > 0.0 && s < 1.0 && !self.0.is_full() {
            let place = self.0.partition_point(|x| *x < s);
            self.0.insert(place, s);
        }
    }

    /// Adds the roots of `a s² + b s + c`.
    pub(crate) fn add_roots(&mut self, [a, b, c]: [f64; 3]) {
        let d = b * b - 4.0 * a * c;
        if d < 0.0 {
            return;
        }
        // Without cancellation (Press et al., Numerical Recipes, 5.6).
        let q = -0.5 * (b + d.sqrt().copysign(b));
        if a != 0.0 {
            self.add(q / a);
        }
        if q != 0.0 {
            self.add(c / q);
        }
    }
}

/// Local minima of a function on 0 … 1, ends included, and the maxima between them, in their order. `slope` is of the
/// sign of the function's derivative and monotone between neighbouring breaks.
pub(crate) fn extremes(
    breaks: &Breaks,
    slope: impl Fn(f64) -> f64,
) -> ArrayVec<Extreme, MOST_EXTREMES> {
    let mut out = ArrayVec::new();
    let mut push = |at: f64, least: bool| {
        let _ = out.try_push(Extreme { at, least });
    };
    let mut before = slope(0.0);
    if before >= 0.0 {
        push(0.0, true);
    }
    for ends in breaks.0.windows(2) {
        let after = slope(ends[1]);
        if (before < 0.0) != (after < 0.0) {
            push(root(ends[0], ends[1], before < 0.0, &slope), before < 0.0);
        }
        before = after;
    }
    if before < 0.0 {
        push(1.0, true);
    }
    out
}

/// Where a slope that is below zero at one end alone passes zero.
pub(super) fn root(mut lo: f64, mut hi: f64, rising: bool, slope: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (lo + hi);
        if middle <= lo || middle >= hi {
            break;
        }
        if (slope(middle) < 0.0) == rising {
            lo = middle;
        } else {
            hi = middle;
        }
    }
    0.5 * (lo + hi)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_two_minima_and_the_maximum_between() {
        // (s − 0.2)² (s − 0.9)², whose slope turns at the roots of its second derivative.
        let slope = |s: f64| 2.0 * (s - 0.2) * (s - 0.9) * (2.0 * s - 1.1);
        let mut breaks = Breaks::new();
        // Second derivative: 2 [(2s − 1.1)² + 2 (s − 0.2)(s − 0.9)].
        breaks.add_roots([6.0, -6.6, 1.21 + 0.36]);
        let found = extremes(&breaks, slope);
        let want = [(0.2, true), (0.55, false), (0.9, true)];
        assert_eq!(found.len(), want.len(), "{found:?}");
        for (f, (at, least)) in found.iter().zip(want) {
            assert!((f.at - at).abs() < 1e-14 && f.least == least, "{f:?}");
        }
    }

    #[test]
    fn invariant_ends_count_where_the_function_falls_toward_them() {
        let found = extremes(&Breaks::new(), |s| 0.3 - s);
        let ends: Vec<_> = found.iter().map(|e| (e.at, e.least)).collect();
        assert_eq!(ends.len(), 3);
        assert!(ends[0] == (0.0, true) && !ends[1].1 && ends[2] == (1.0, true));
    }
}
