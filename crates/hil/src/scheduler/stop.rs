//! How a run comes to its end: the rig brakes by itself, and the loop stays with it until it rests.

use docktwin_control::{
    compensation::Compensator,
    safety::{Margins, Trip},
};
use docktwin_rigport::rig::Rig;

use super::{Idle, Loop, LoopTimes, Phase, Running};
use crate::clock::Clock;

/// At rest after a run; how it ended.
#[derive(Debug)]
pub struct Stopped {
    /// The limit that ended it, if one did.
    pub trip: Option<Trip>,
    /// Least margins of the limits.
    pub margins: Margins,
    /// Ticks of the closed loop.
    pub closed_ticks: u64,
}

/// Time given to come to rest after the end of a run, s: at least, and at most.
const REST_S: [f64; 2] = [0.3, 3.0];
/// For how long the legs must be at rest, s: the oil spring makes them oscillate.
const REST_FOR_S: f64 = 0.05;

impl<R: Rig, K: Clock, C: Compensator> Loop<R, K, Running, C> {
    /// True when the rig is at rest after the run, or cannot be waited for any longer.
    pub fn finished(&self) -> bool {
        let s = &self.state;
        let Some([first, last]) = s.stop_at else { return false };
        let rests = s.resting >= self.ticks(REST_FOR_S);
        // In lockstep every further tick would wait for a rig that is not there.
        let alone = K::LOCKSTEP && s.gone;
        alone || self.tick >= last || (self.tick >= first && rests)
    }

    /// Ends the run: the rig comes to rest from the next tick on.
    pub fn end(&mut self) {
        self.enter_stop();
    }

    pub(super) fn enter_stop(&mut self) {
        if self.state.phase != Phase::Stop {
            self.state.phase = Phase::Stop;
            self.state.since = 0;
            self.state.stop_at = Some(REST_S.map(|s| self.tick + self.ticks(s)));
        }
    }

    /// Ends a run that has come to rest, or leaves one where it is.
    pub fn stop(self) -> Loop<R, K, Stopped, C> {
        self.into_state(|s| Stopped {
            trip: s.supervisor.trip(),
            margins: *s.supervisor.margins(),
            closed_ticks: s.closed,
        })
    }
}

impl<R: Rig, K: Clock, C> Loop<R, K, Stopped, C> {
    /// How it ended.
    pub const fn end(&self) -> &Stopped {
        &self.state
    }

    /// How it ended; drops the loop and the rig.
    pub fn into_end(self) -> Stopped {
        self.state
    }

    /// Makes the loop idle again, for another run with a session of its own.
    #[must_use]
    pub fn reset(mut self, session: u64) -> Loop<R, K, Idle, C> {
        self.setup.session = session;
        self.tick = 0;
        self.times = LoopTimes::default();
        self.into_state(|_| Idle(()))
    }
}
