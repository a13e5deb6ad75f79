//! Sums over pairs of instants, and the figures of a window that follow from them.

use docktwin_core::{DVec3, PORT_CONTACT_N};
use docktwin_record::{FidelityFigures, FidelityOf};

use super::{PortState, latches::LatchTimes, tick_s};

/// Moment below which there is none to compare, N·m: that of [`PORT_CONTACT_N`] on a lever of 1 m.
const LEAST_MOMENT_NM: f64 = PORT_CONTACT_N;
/// Motion below which there is none to compare: RMS about the mean, m and rad.
const LEAST_MOTION: f64 = 1e-6;

/// Mean and sum of squares about it (Welford).
#[derive(Clone, Copy, Debug, Default)]
struct Spread {
    mean: DVec3,
    squares: f64,
}

impl Spread {
    fn add(&mut self, x: DVec3, n: f64) {
        let off = x - self.mean;
        self.mean += off / n;
        self.squares += off.dot(x - self.mean);
    }
}

/// Everything summed from first contact on.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    pairs: f64,
    peak: [[f64; 2]; 2],
    error: [f64; 2],
    square: [f64; 2],
    apart: [f64; 2],
    motion: [Spread; 2],
    impulse: [DVec3; 2],
    work_j: [f64; 2],
}

impl Sums {
    /// `near` are the loop's ticks about the instant, between which `at` lies.
    fn add(&mut self, near: &[PortState; 2], at: &PortState, sim: &PortState) {
        self.pairs += 1.0;
        let pair = |s: &PortState| [s.wrench.f, s.wrench.m];
        for i in 0..2 {
            let (h, s) = (pair(at)[i], pair(sim)[i]);
            // A peak lies at a tick; between ticks it would be cut.
            let top = pair(&near[0])[i].length().max(pair(&near[1])[i].length());
            self.peak[i][0] = self.peak[i][0].max(top);
            self.peak[i][1] = self.peak[i][1].max(s.length());
            self.error[i] += (h - s).length_squared();
            self.square[i] += s.length_squared();
        }
        let turn = |s: &PortState| {
            let q = s.x_34.q;
            (if q.w < 0.0 { -q } else { q }).to_scaled_axis()
        };
        self.apart[0] += (at.x_34.p - sim.x_34.p).length_squared();
        let q = sim.x_34.q.conjugate() * at.x_34.q;
        self.apart[1] += (if q.w < 0.0 { -q } else { q }).to_scaled_axis().length_squared();
        self.motion[0].add(sim.x_34.p, self.pairs);
        self.motion[1].add(turn(sim), self.pairs);
        for (i, side) in [at, sim].into_iter().enumerate() {
            // In the axes of e3, which hardly turn in a docking.
            self.impulse[i] += side.x_34.q * side.wrench.f * tick_s();
            self.work_j[i] += side.power_w() * tick_s();
        }
    }

    fn figures(&self, window_s: f64, start_j: f64) -> FidelityFigures {
        let floor = [PORT_CONTACT_N, LEAST_MOMENT_NM];
        let loaded = |i: usize| self.peak[i][1] > floor[i];
        let ratio = |i: usize| loaded(i).then(|| self.peak[i][0] / self.peak[i][1]);
        let nrms = |i: usize| loaded(i).then(|| (self.error[i] / self.square[i]).sqrt());
        let moved = |i: usize| {
            let motion = self.motion[i].squares;
            let enough = (motion / self.pairs).sqrt() > LEAST_MOTION;
            enough.then(|| (self.apart[i] / motion).sqrt())
        };
        let [h, s] = self.impulse;
        let pushed = s.length() > PORT_CONTACT_N * window_s.max(tick_s());
        FidelityFigures {
            window_s: Some(window_s),
            simulated_peak_force_n: Some(self.peak[0][1]),
            peak_force_ratio: ratio(0),
            peak_moment_ratio: ratio(1),
            nrms_force: nrms(0),
            nrms_moment: nrms(1),
            nrms_pose: moved(0),
            nrms_attitude: moved(1),
            impulse_ratio: pushed.then(|| h.dot(s) / s.length_squared()),
            delta_energy: (start_j > 0.0).then(|| (self.work_j[0] - self.work_j[1]) / start_j),
        }
    }
}

/// Where a pair of instants lies.
#[derive(Clone, Copy, Debug)]
pub(super) struct When {
    /// Part of a tick.
    pub(super) part: f64,
    /// Since first contact, s.
    pub(super) since_s: f64,
    /// Ends of the first two windows, s from first contact, as far as they are known.
    pub(super) ends: [Option<f64>; 2],
    /// Kinetic energy at the start, J.
    pub(super) start_j: f64,
}

/// The three windows of one comparison.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Windows {
    sums: Sums,
    last_s: f64,
    start_j: f64,
    closed: [Option<FidelityFigures>; 2],
}

impl Windows {
    /// A pair of instants: the loop `when.part` of a tick behind the first of `near`.
    pub(super) fn add(&mut self, near: &[PortState; 2], sim: &PortState, when: &When) {
        let When { part, since_s, ends, start_j } = *when;
        self.start_j = start_j;
        for (closed, end) in self.closed.iter_mut().zip(ends) {
            if closed.is_none() && self.sums.pairs > 0.0 && end.is_some_and(|end| since_s > end) {
                *closed = Some(self.sums.figures(self.last_s, start_j));
            }
        }
        let at = PortState::between(&near[0], &near[1], part);
        self.sums.add(near, &at, sim);
        self.last_s = since_s;
    }

    /// The figures with the latches' times; `None` without a pair.
    pub(super) fn of_pairs(&self, times: &LatchTimes, sim: &LatchTimes) -> Option<FidelityOf> {
        let [first, capture] = self.closed;
        (self.sums.pairs > 0.0).then(|| {
            let (latch_difference_s, capture_difference_s) = times.later_than(sim);
            FidelityOf {
                to_first_latch: first.unwrap_or_default(),
                to_capture: capture.unwrap_or_default(),
                whole_run: self.sums.figures(self.last_s, self.start_j),
                latch_difference_s,
                capture_difference_s,
            }
        })
    }
}
