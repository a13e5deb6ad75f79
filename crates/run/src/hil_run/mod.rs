//! A loop with a rig: stepped tick by tick, or run as a whole in virtual or in real time.

mod compensated;
mod prepare;
mod realtime;
mod recorder;
mod summary;
mod verdict;

use std::time::Instant as WallInstant;

use docktwin_hil::{
    clock::{Clock, OverrunPolicy, RealtimeClock, VirtualClock},
    scheduler::{Check, Loop, LoopTimes, Phase, Running, Stopped, TickRecord},
};
use docktwin_physics::reduced::Inputs;
use docktwin_record::Summary;
use docktwin_rigport::rig::Rig;

pub use self::prepare::{HilOptions, HilRun};
pub(crate) use self::{
    prepare::{MECHANISM_DIGEST, kept_mechanism, kept_name, preset, refuse_sag, rig_path},
    recorder::HilRecorder,
};
use crate::{
    control::{Control, Situation},
    error::RunError,
    progress::Progress,
    rig_place::{Operator, RealtimeOptions},
    sink::Sink,
};

/// Period of the loop, ns: 1 kHz.
pub const PERIOD_NS: u64 = docktwin_core::PERIOD_NS;
/// The same, s.
const PERIOD_S: f64 = 1e-3;
/// Ticks between two reports of progress.
const PROGRESS_TICKS: u64 = 100;

/// Time of a tick of the closed loop, s.
fn seconds(closed_tick: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "exact below 2^53 ticks")]
    let s = closed_tick as f64 * PERIOD_S;
    s
}

/// What is left of a loop.
struct Ended {
    /// The lead of the compensator, and the one that is believed to undo the rig, s.
    leads_s: [f64; 2],
    end: Stopped,
    times: LoopTimes,
    late: u64,
    missed: u64,
    /// Why the connection to the rig broke.
    broken: Option<String>,
    /// Ticks that nobody could look at.
    dropped: u64,
    /// What the machine did not grant.
    lacking: Option<String>,
    /// What ordered a stop from outside.
    stopped: Option<&'static str>,
}

/// What moves the spacecraft besides the mechanism, on the path of the loop: the scenario's thrusts and
/// whoever else commands; and what they know.
struct Commands<C> {
    control: C,
    now: Situation,
}

impl<C: Control> Commands<C> {
    /// Control wrenches of the next tick: none before the loop is closed.
    fn next(&mut self, phase: Phase) -> Inputs {
        if phase == Phase::Closed { self.control.wrenches(&self.now) } else { Inputs::default() }
    }

    /// Takes in what a tick showed.
    fn see(&mut self, r: &TickRecord) {
        prepare::see(&mut self.now, r);
    }
}

/// Tick after tick until the rig is at rest. `take` gets every tick and says whether the run is to end.
fn keep_time<R: Rig, K: Clock, C: Control>(
    mut running: Loop<R, K, Running>,
    mut commands: Commands<C>,
    mut pace: Option<RealtimeClock>,
    mut take: impl FnMut(TickRecord) -> bool,
) -> Ended {
    let (mut broken, mut stopped) = (None, None);
    while !running.finished() {
        let control = commands.next(running.phase());
        if let Some(pace) = &mut pace {
            pace.wait();
        }
        match running.tick(&control) {
            Ok(r) => {
                commands.see(&r);
                stopped = stopped.or_else(|| commands.control.stopped());
                if take(r) || stopped.is_some() || commands.control.ended() {
                    running.end();
                }
            }
            Err(e) => {
                broken = Some(e.to_string());
                break;
            }
        }
    }
    Ended { stopped, ..ended(running, broken) }
}

fn ended<R: Rig, K: Clock>(running: Loop<R, K, Running>, broken: Option<String>) -> Ended {
    let counts = running.clock_counts();
    let setup = running.setup();
    let leads_s = [setup.compensation.lead_s(), setup.parameters.lead_s];
    let times = running.times().clone();
    let end = running.stop().into_end();
    let (late, missed) = (counts.overruns, counts.missed);
    Ended { end, times, late, missed, broken, leads_s, dropped: 0, lacking: None, stopped: None }
}

impl<'a> HilRun<'a> {
    /// Runs the loop in virtual time to its end, loop, rig and sink in turn.
    ///
    /// # Errors
    /// The rig is not armed, or the sink cannot be begun. A rig that stops ends the run with a summary.
    pub fn run<R: Rig, S: Sink>(self, rig: R, sink: &mut S) -> Result<Summary, RunError> {
        self.run_with(rig, sink, crate::control::Coasting, &mut (), &mut ())
    }

    /// The same with a source of control wrenches beside the scenario's thrusts. With a person at the
    /// controls it keeps to the clock on the wall; the ticks are those of the virtual clock.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn run_with<R: Rig, S: Sink, C: Control, P: Progress, O: Operator>(
        mut self,
        rig: R,
        sink: &mut S,
        control: C,
        progress: &mut P,
        operator: &mut O,
    ) -> Result<Summary, RunError> {
        let checks = self.checks(operator)?;
        let ticks = self.setup.ticks;
        let mut pace =
            control.in_person().then(|| RealtimeClock::new(PERIOD_NS, OverrunPolicy::CatchUp));
        self.setup.patience = crate::rig_place::patience::<VirtualClock>();
        let mut recorder = HilRecorder::begin(&self, sink, false)?;
        let wall = WallInstant::now();
        let commands = self.commands(control);
        let armed = Loop::new(self.setup, rig, VirtualClock::new(PERIOD_NS)).arm(checks)?;
        operator.checklist(armed.checks());
        if let Some(pace) = &mut pace {
            pace.start();
        }
        let ended = keep_time(armed.start(), commands, pace, |r| {
            if let Some(k) = r.closed_tick.filter(|k| k.is_multiple_of(PROGRESS_TICKS)) {
                progress.at(k, ticks);
            }
            recorder.take(&r)
        });
        progress.done();
        Ok(recorder.finish(&ended, wall.elapsed()).0)
    }

    /// Runs the loop in real time, in this thread with what the machine grants; another thread looks at
    /// the ticks and serves the sink.
    ///
    /// # Errors
    /// As [`Self::run`], and when the machine does not grant what is asked.
    pub fn run_realtime<R: Rig, S: Sink + Send, C: Control, O: Operator + Send>(
        mut self,
        rig: R,
        sink: &mut S,
        control: C,
        realtime: &RealtimeOptions,
        operator: &mut O,
    ) -> Result<Summary, RunError> {
        let checks = self.checks(operator)?;
        self.setup.patience = crate::rig_place::patience::<RealtimeClock>();
        let mut recorder = HilRecorder::begin(&self, sink, true)?;
        let wall = WallInstant::now();
        let commands = self.commands(control);
        let clock = RealtimeClock::new(PERIOD_NS, OverrunPolicy::Skip);
        let idle = Loop::new(self.setup, rig, clock);
        let loop_thread = realtime::LoopThread { idle, checks, commands, realtime };
        let ended = loop_thread.run(&mut recorder, operator)?;
        Ok(recorder.finish(&ended, wall.elapsed()).0)
    }

    /// Arms the rig and opens the sink, in virtual time, for a caller that steps.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn begin<R: Rig, S: Sink, O: Operator>(
        mut self,
        rig: R,
        sink: S,
        operator: &mut O,
    ) -> Result<RunningHil<'a, R, S>, RunError> {
        let checks = self.checks(operator)?;
        self.setup.patience = crate::rig_place::patience::<VirtualClock>();
        let recorder = HilRecorder::begin(&self, sink, false)?;
        let commands = self.commands(crate::control::Coasting);
        let armed = Loop::new(self.setup, rig, VirtualClock::new(PERIOD_NS)).arm(checks)?;
        operator.checklist(armed.checks());
        Ok(RunningHil {
            running: armed.start(),
            recorder,
            commands,
            wall: WallInstant::now(),
            broken: None,
        })
    }
}

/// A loop with a rig between two ticks of virtual time.
pub struct RunningHil<'a, R, S> {
    running: Loop<R, VirtualClock, Running>,
    recorder: HilRecorder<'a, S>,
    commands: Commands<(crate::control::TimedThrusts, crate::control::Coasting)>,
    wall: WallInstant,
    broken: Option<String>,
}

impl<R: Rig, S: Sink> RunningHil<'_, R, S> {
    /// Whether the rig rests after the run.
    #[must_use]
    pub fn ended(&self) -> bool {
        self.broken.is_some() || self.running.finished()
    }

    /// Where the run is: only in [`Phase::Closed`] the bodies answer to control wrenches.
    #[must_use]
    pub const fn phase(&self) -> Phase {
        self.running.phase()
    }

    /// What is known at the beginning of the tick to come.
    #[must_use]
    pub const fn situation(&self) -> &Situation {
        &self.commands.now
    }

    /// Lets the rig come to rest from the next tick on.
    pub fn end(&mut self) {
        self.running.end();
    }

    /// One tick, with control wrenches beside the scenario's thrusts; they count once the loop is closed.
    /// Gives what the loop did; `None` once the connection to the rig is broken.
    pub fn tick(&mut self, control: &Inputs) -> Option<TickRecord> {
        if self.ended() {
            return None;
        }
        let mut wrenches = self.commands.next(self.running.phase());
        if self.running.phase() == Phase::Closed {
            wrenches.chaser += control.chaser;
            wrenches.target += control.target;
        }
        match self.running.tick(&wrenches) {
            Ok(r) => {
                self.commands.see(&r);
                if self.recorder.take(&r) {
                    self.running.end();
                }
                Some(r)
            }
            Err(e) => {
                self.broken = Some(e.to_string());
                None
            }
        }
    }

    /// Judges the run and closes the sink; gives the summary and the sink.
    pub fn finish(self) -> (Summary, S) {
        let ended = ended(self.running, self.broken);
        self.recorder.finish(&ended, self.wall.elapsed())
    }
}

/// The checklist that a run adds to that of the loop.
pub(crate) fn check(name: &'static str, passed: bool, found: impl Into<String>) -> Check {
    Check { name, passed, found: found.into() }
}
