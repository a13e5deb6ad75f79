//! The first contact of one side: its edges, interpolated between ticks, and the speeds around it.

use std::collections::VecDeque;

use docktwin_core::PORT_CONTACT_N;

use super::{GAP_TICKS, Trace};

/// Ticks before first contact, and after its end, at which speeds are compared.
const SPEED_BEFORE: usize = 5;
const SPEED_AFTER: usize = 15;
/// Speeds remembered: from [`SPEED_AFTER`] ticks after a contact until its end is certain.
const SPEEDS: usize = 32;

/// First contact of one side. Times are in ticks from the first one on, with parts of a tick.
#[derive(Clone, Debug, Default)]
pub(super) struct FirstContact {
    ticks: usize,
    /// The newest last.
    speeds: VecDeque<f64>,
    before_n: f64,
    begin: Option<f64>,
    last_on: usize,
    /// When the force last fell below the threshold.
    fell: f64,
    entry_speed_m_s: f64,
    /// End, once it is certain, and the speed [`SPEED_AFTER`] ticks later.
    end: Option<(f64, f64)>,
}

/// Where a force between two ticks passes the threshold, as a part of the tick.
fn crossing(from_n: f64, to_n: f64) -> f64 {
    (PORT_CONTACT_N - from_n) / (to_n - from_n)
}

#[expect(clippy::cast_precision_loss, reason = "ticks")]
impl FirstContact {
    pub(super) fn add(&mut self, t: &Trace) {
        let force = t.truest().wrench.f.length();
        if self.speeds.len() == SPEEDS {
            self.speeds.pop_front();
        }
        self.speeds.push_back(t.speed_m_s);
        let on = force > PORT_CONTACT_N;
        let was_on = self.before_n > PORT_CONTACT_N;
        if on && self.begin.is_none() {
            let back = if self.ticks > 0 { 1.0 - crossing(self.before_n, force) } else { 0.0 };
            self.begin = Some(self.ticks as f64 - back);
            let back = SPEED_BEFORE.min(self.ticks);
            self.entry_speed_m_s = self.speeds[self.speeds.len() - 1 - back];
        }
        if self.end.is_none() {
            if was_on && !on {
                self.fell = (self.ticks - 1) as f64 + crossing(self.before_n, force);
            }
            if on {
                self.last_on = self.ticks;
            } else if self.begin.is_some() && self.ticks - self.last_on > GAP_TICKS {
                let back = self.ticks - self.last_on - SPEED_AFTER;
                self.end = Some((self.fell, self.speeds[self.speeds.len() - 1 - back]));
            }
        }
        self.before_n = force;
        self.ticks += 1;
    }

    /// Ticks so far.
    pub(super) const fn ticks(&self) -> usize {
        self.ticks
    }

    /// Beginning, ticks.
    pub(super) const fn begin(&self) -> Option<f64> {
        self.begin
    }

    /// Duration in ticks, and exit over entry speed.
    pub(super) fn over(&self) -> Option<(f64, f64)> {
        let (begin, (end, exit)) = (self.begin?, self.end?);
        Some((end - begin, exit / self.entry_speed_m_s))
    }
}
