//! The first contact of one side: its edges, interpolated between ticks, and the speeds around it.
//!
//! A contact force rises from zero with a kink somewhere between two ticks, so a line from the last tick
//! without force would put the edge too early. The line of the two ticks *in* contact that are nearest to the
//! edge is carried on to the threshold instead.

use std::collections::VecDeque;

use docktwin_core::PORT_CONTACT_N;

use super::{GAP_TICKS, PortState};

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
    /// Forces of the last two ticks, the newest first, N.
    before_n: [f64; 2],
    /// First tick with force.
    touched: Option<usize>,
    begin: Option<f64>,
    last_on: usize,
    /// When the force last fell below the threshold.
    fell: f64,
    entry_speed_m_s: f64,
    /// End, once it is certain, and the speed [`SPEED_AFTER`] ticks later.
    end: Option<(f64, f64)>,
}

/// How far beyond a tick with the force `near_n` the threshold lies, in ticks from 0 to 1, `far_n` being that of
/// the tick on its other side. In the middle where the force does not fall towards it.
fn beyond(near_n: f64, far_n: f64) -> f64 {
    if far_n > near_n { ((near_n - PORT_CONTACT_N) / (far_n - near_n)).min(1.0) } else { 0.5 }
}

#[expect(clippy::cast_precision_loss, reason = "ticks")]
impl FirstContact {
    /// Takes a tick in; `speed_m_s` is the relative speed of the ports.
    pub(super) fn add(&mut self, port: &PortState, speed_m_s: f64) {
        let force = port.wrench.f.length();
        if self.speeds.len() == SPEEDS {
            self.speeds.pop_front();
        }
        self.speeds.push_back(speed_m_s);
        let on = force > PORT_CONTACT_N;
        let was_on = self.before_n[0] > PORT_CONTACT_N;
        if let (Some(first), None) = (self.touched, self.begin) {
            let back = if first > 0 { beyond(self.before_n[0], force) } else { 0.0 };
            self.begin = Some(first as f64 - back);
        }
        if on && self.touched.is_none() {
            self.touched = Some(self.ticks);
            let back = SPEED_BEFORE.min(self.ticks);
            self.entry_speed_m_s = self.speeds[self.speeds.len() - 1 - back];
        }
        if self.end.is_none() {
            if was_on && !on {
                let [near, far] = self.before_n;
                self.fell = (self.ticks - 1) as f64 + beyond(near, far);
            }
            if on {
                self.last_on = self.ticks;
            } else if self.touched.is_some() && self.ticks - self.last_on > GAP_TICKS {
                let back = self.ticks - self.last_on - SPEED_AFTER;
                self.end = Some((self.fell, self.speeds[self.speeds.len() - 1 - back]));
            }
        }
        self.before_n = [force, self.before_n[0]];
        self.ticks += 1;
    }

    /// Ticks so far.
    pub(super) const fn ticks(&self) -> usize {
        self.ticks
    }

    /// Whether there has been any contact.
    pub(super) const fn touched(&self) -> bool {
        self.touched.is_some()
    }

    /// Beginning, ticks; known one tick after the first one with force.
    pub(super) const fn begin(&self) -> Option<f64> {
        self.begin
    }

    /// Duration in ticks, and exit over entry speed.
    pub(super) fn over(&self) -> Option<(f64, f64)> {
        let (begin, (end, exit)) = (self.begin?, self.end?);
        Some((end - begin, exit / self.entry_speed_m_s))
    }
}
