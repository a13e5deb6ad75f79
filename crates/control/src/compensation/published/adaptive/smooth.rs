//! Command and measurement without what is above the band of a docking, with the derivatives of the measurement: both
//! through the same filter, so that its own lag drops out.

use docktwin_core::StateHasher;

/// Corner of each of its three sections, Hz.
const CORNER_HZ: f64 = 20.0;

/// What was commanded, and where the plate was with its first two derivatives, filtered.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Smoothed {
    pub(super) u: f64,
    pub(super) y: [f64; 3],
}

/// Three equal sections of first order one after another.
#[derive(Clone, Copy, Debug, Default)]
struct Cascade {
    /// Input of each section, and the last one's output.
    at: [f64; 4],
}

impl Cascade {
    /// After a long time at `x`.
    const fn rest(x: f64) -> Self {
        Self { at: [x; 4] }
    }

    /// By the trapezoidal rule, of which derivatives are exact differences.
    fn push(&mut self, x: f64, time_s: f64, period_s: f64) {
        let c = period_s / (2.0 * time_s);
        let mut input = x;
        let mut before = self.at[0];
        self.at[0] = x;
        for i in 1..4 {
            let old = self.at[i];
            self.at[i] = (old * (1.0 - c) + c * (input + before)) / (1.0 + c);
            (input, before) = (self.at[i], old);
        }
    }

    fn derivatives(&self, time_s: f64) -> [f64; 3] {
        let [_, first, second, third] = self.at;
        let speed = [(first - second) / time_s, (second - third) / time_s];
        [third, speed[1], (speed[0] - speed[1]) / time_s]
    }
}

/// See the module's page.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Smooth {
    filters: Option<[Cascade; 2]>,
}

impl Smooth {
    pub(super) const fn new() -> Self {
        Self { filters: None }
    }

    pub(super) fn hash_into(&self, h: &mut StateHasher) {
        for cascade in self.filters.iter().flatten() {
            cascade.at.iter().for_each(|x| h.f64(*x));
        }
    }

    /// The next pair.
    pub(super) fn of(&mut self, u: f64, y: f64, period_s: f64) -> Smoothed {
        let time_s = 1.0 / (core::f64::consts::TAU * CORNER_HZ);
        let [of_u, of_y] = self.filters.get_or_insert([Cascade::rest(u), Cascade::rest(y)]);
        of_u.push(u, time_s, period_s);
        of_y.push(y, time_s, period_s);
        Smoothed { u: of_u.at[3], y: of_y.derivatives(time_s) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sine through the filter: derivatives are those of what comes out, to the second order of the step.
    #[test]
    fn oracle_derivatives_of_a_sine() {
        let w = 10.0;
        let mut s = Smooth::new();
        let mut outs = Vec::new();
        for i in 0..2000 {
            let y = (w * f64::from(i) * 1e-3).sin();
            outs.push(s.of(y, y, 1e-3));
        }
        for k in [1200, 1500, 1801] {
            let (a, b, c) = (outs[k - 1], outs[k], outs[k + 1]);
            assert!((b.u - b.y[0]).abs() < 1e-15);
            assert!(((c.u - a.u) / 2e-3 - b.y[1]).abs() < 1e-4 * w, "{k}");
            assert!(((c.u - 2.0 * b.u + a.u) / 1e-6 - b.y[2]).abs() < 1e-3 * w * w, "{k}");
        }
    }
}
