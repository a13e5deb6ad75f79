//! When latches caught: of the simulated system to the step, of a rig as it tells it and, where it also
//! tells where the ring is, interpolated between the ticks by the gap of the latch.

use docktwin_core::Pose;
use docktwin_hil::scheduler::TickRecord;
use docktwin_physics::mechanism::{LatchPhase, System};

use super::{AFTER_CAPTURE_S, tick_s};

/// Times at which the latches caught, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct LatchTimes {
    pub(super) latched_s: [Option<f64>; 3],
}

impl LatchTimes {
    /// When the first one caught, s.
    fn first_s(&self) -> Option<f64> {
        self.latched_s.iter().flatten().copied().reduce(f64::min)
    }

    /// When the last one of all caught, s.
    pub(super) fn capture_s(&self) -> Option<f64> {
        let [a, b, c] = self.latched_s;
        Some(a?.max(b?).max(c?))
    }

    /// Ends of the windows `to_first_latch` and `to_capture`, s from a first contact at `from_s`.
    pub(super) fn windows_s(&self, from_s: f64) -> [Option<f64>; 2] {
        [self.first_s(), self.capture_s().map(|t| t + AFTER_CAPTURE_S)]
            .map(|end| end.map(|t| t - from_s))
    }

    /// How much later than `other`, s: each latch, and the last one.
    pub(super) fn later_than(&self, other: &Self) -> ([Option<f64>; 3], Option<f64>) {
        let each = core::array::from_fn(|i| Some(self.latched_s[i]? - other.latched_s[i]?));
        (each, self.capture_s().zip(other.capture_s()).map(|(a, b)| a - b))
    }
}

/// Latches of a rig.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RigLatches {
    told: LatchTimes,
    interpolated: LatchTimes,
    /// Axial gaps of the tick before, m.
    gaps_m: Option<[f64; 3]>,
}

impl RigLatches {
    /// Takes a tick in, at which the halves stood at `x_34`.
    pub(super) fn add(&mut self, system: &System, r: &TickRecord, x_34: &Pose, time_s: f64) {
        let m = &r.measurement;
        let gaps_m = m
            .ring()
            .and_then(|ring| system.latch_gaps_at(x_34, ring))
            .map(|gaps| gaps.map(|g| g.axial_m));
        let catch_m = system.mechanism().latches.as_ref().map_or(0.0, |l| l.catch_gap_m);
        for (i, phase) in m.latch_phases().iter().enumerate().take(3) {
            if *phase < LatchPhase::Latched as u32 || self.told.latched_s[i].is_some() {
                continue;
            }
            self.told.latched_s[i] = Some(time_s);
            // It caught since the tick before: where its gap fell to the catch gap or, where it slid
            // sideways into its zone, in the middle.
            let back = self.gaps_m.zip(gaps_m).map(|(old, new)| {
                let (from, to) = (old[i], new[i]);
                let part =
                    if from > catch_m && to < catch_m { (catch_m - to) / (from - to) } else { 0.5 };
                part * tick_s()
            });
            self.interpolated.latched_s[i] = back.map(|back| time_s - back);
        }
        self.gaps_m = gaps_m;
    }

    /// As the loop learns of them, at ticks.
    pub(super) const fn told(&self) -> &LatchTimes {
        &self.told
    }

    /// As they happened.
    pub(super) const fn interpolated(&self) -> &LatchTimes {
        &self.interpolated
    }
}
