//! A rehearsal: the twin alone, stepped tick by tick or run as a whole.

use std::{collections::BTreeMap, time::Instant as WallInstant};

use docktwin_core::{SimTime, Tick, Wrench};
use docktwin_hil::clock::{Clock as _, OverrunPolicy, RealtimeClock};
use docktwin_physics::{
    body::BodyState, contact::SurfacePair, mechanism::System, outcome::Judgement, reduced::Inputs,
};
use docktwin_record::{Cell, ContactRow, Summary};
use docktwin_scenario::Scenario;

use crate::{
    control::{Coasting, Control, Situation, TimedThrusts},
    error::{RunError, SinkError},
    event::RunEvent,
    observer::{Asked, Observed, Observer},
    progress::Progress,
    provenance::digest_keys,
    setup::{masses, start, tick_digest},
    signals::{Instant, columns_for, contact_rows, row},
    sink::{Header, Sink, TickView},
    twin::{TickedTwin, TwinKind},
};

/// Ticks between two reports of progress.
const PROGRESS_TICKS: u64 = 100;

/// How a rehearsal is run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RehearsalOptions {
    /// Which integrator.
    pub twin: TwinKind,
    /// Seed of all random numbers, for the record.
    pub seed: u64,
}

/// A rehearsal of a scenario.
///
/// ```
/// use docktwin_run::{Rehearsal, SummaryOnly};
/// use docktwin_scenario::Scenario;
/// # let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
/// # let path = root.join("scenarios/basic_ring_ring.toml");
/// let scenario = Scenario::from_path(path)?;
/// let summary = Rehearsal::new(&scenario)?.run(&mut SummaryOnly)?;
/// println!("{}: {} ({})", summary.scenario, summary.outcome, summary.verdict);
/// # Ok::<(), docktwin_run::RunError>(())
/// ```
///
/// A caller with a loop of its own steps it:
///
/// ```
/// # use docktwin_run::{Rehearsal, SummaryOnly};
/// # use docktwin_physics::reduced::Inputs;
/// # use docktwin_scenario::Scenario;
/// # let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
/// # let scenario = Scenario::from_path(root.join("scenarios/basic_ring_ring.toml"))?;
/// let mut run = Rehearsal::new(&scenario)?.begin(SummaryOnly)?;
/// while !run.ended() {
///     let closing = run.situation().closing_m_s();
///     let brake = Inputs::default(); // from `closing`, perhaps
///     run.tick(&brake);
/// }
/// let (summary, _) = run.finish();
/// # Ok::<(), docktwin_run::RunError>(())
/// ```
pub struct Rehearsal<'a> {
    scenario: &'a Scenario,
    options: RehearsalOptions,
    /// Physics steps in a tick.
    steps: u32,
    system: System,
    bodies: [BodyState; 3],
}

impl<'a> Rehearsal<'a> {
    /// With the full twin.
    ///
    /// # Errors
    /// The sides overlap at the start.
    pub fn new(scenario: &'a Scenario) -> Result<Self, RunError> {
        Self::with(scenario, RehearsalOptions::default())
    }

    /// With options.
    ///
    /// # Errors
    /// The sides overlap at the start.
    pub fn with(scenario: &'a Scenario, options: RehearsalOptions) -> Result<Self, RunError> {
        let (system, bodies) = start(scenario)?;
        let steps = options.twin.steps_per_tick(scenario);
        Ok(Self { scenario, options, steps, system, bodies })
    }

    /// By the reduced twin, with another mechanism than the scenario's, and its bodies at the start.
    pub(crate) fn beginning(
        scenario: &'a Scenario,
        system: System,
        bodies: [BodyState; 3],
    ) -> Self {
        let options = RehearsalOptions { twin: TwinKind::Reduced, seed: 0 };
        let steps = options.twin.steps_per_tick(scenario);
        Self { scenario, options, steps, system, bodies }
    }

    /// By the twin of a recording, in its steps.
    pub(crate) fn as_recorded(
        scenario: &'a Scenario,
        twin: TwinKind,
        steps: u32,
    ) -> Result<Self, RunError> {
        let options = RehearsalOptions { twin, seed: 0 };
        Ok(Self { steps, ..Self::with(scenario, options)? })
    }

    /// Runs the scenario to its end.
    ///
    /// # Errors
    /// The sink cannot be begun. A sink that fails later leaves the run and degrades the verdict.
    pub fn run<S: Sink>(self, sink: &mut S) -> Result<Summary, RunError> {
        self.run_with(sink, Coasting, &mut ())
    }

    /// Runs it with a source of control wrenches beside the scenario's thrusts. With a person at the
    /// controls ([`Control::in_person`]) it keeps to the clock on the wall.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn run_with<S: Sink, C: Control, P: Progress>(
        self,
        sink: &mut S,
        mut control: C,
        progress: &mut P,
    ) -> Result<Summary, RunError> {
        let ticks = self.scenario.run.ticks();
        // No tick is left out: simulated time would stand still meanwhile.
        let mut clock = control.in_person().then(|| {
            let mut clock =
                RealtimeClock::new(self.scenario.run.tick_nanos, OverrunPolicy::CatchUp);
            clock.start();
            clock
        });
        let mut run = self.begin(sink)?;
        while !run.ended() {
            if let Some(clock) = &mut clock {
                clock.wait();
            }
            let now = run.situation();
            run.decide(control.ahead(&now));
            if control.ended() {
                run.end();
            }
            if let Some(by) = control.stopped() {
                run.stop(&format!("stopped by {by}"));
            }
            let wrenches = if run.last { Inputs::default() } else { control.wrenches(&now) };
            run.tick(&wrenches);
            if run.tick.is_multiple_of(PROGRESS_TICKS) {
                progress.at(run.tick, ticks);
            }
        }
        progress.done();
        Ok(run.finish().0)
    }

    /// Opens the sink, for a caller that steps.
    ///
    /// # Errors
    /// The sink cannot be begun.
    pub fn begin<S: Sink>(self, mut sink: S) -> Result<RunningRehearsal<'a, S>, RunError> {
        let Self { scenario, options, steps, system, bodies } = self;
        let (columns, pair_names) = (columns_for(&scenario.mechanism), pair_names(scenario));
        let metadata = metadata(scenario, options, steps);
        let tick_nanos = scenario.run.tick_nanos;
        let header = Header {
            scenario,
            columns: &columns,
            pair_names: &pair_names,
            metadata: &metadata,
            rig: None,
            kept: &[],
            real_time: false,
        };
        sink.begin(&header).map_err(RunError::Sink)?;
        let twin = TickedTwin::new(options.twin, system, bodies, tick_nanos, steps);
        Ok(RunningRehearsal {
            scenario,
            seed: options.seed,
            wall: WallInstant::now(),
            thrusts: TimedThrusts::of(scenario),
            observer: Observer::default(),
            events: Vec::new(),
            recorder: RowRecorder::new(pair_names),
            now: Box::new(twin.instant(0.0)),
            twin,
            sink,
            tick: 0,
            last: false,
            ended: false,
            stopped: None,
            lost: None,
        })
    }
}

/// A body whose control wrench is not finite. An engine may pass over one, and its state stays finite.
fn not_finite_control(control: &Inputs) -> Option<&'static str> {
    let finite = |w: &Wrench| w.f.is_finite() && w.m.is_finite();
    let bodies = [("chaser", &control.chaser), ("target", &control.target)];
    bodies.into_iter().find(|(_, w)| !finite(w)).map(|(name, _)| name)
}

/// A body whose state is not finite.
fn not_finite(now: &Instant) -> Option<&'static str> {
    let bodies = ["chaser", "docking ring", "target"].into_iter().zip(&now.state.bodies);
    bodies.into_iter().find(|(_, b)| !b.is_finite()).map(|(name, _)| name)
}

fn metadata(
    scenario: &Scenario,
    options: RehearsalOptions,
    steps: u32,
) -> BTreeMap<String, String> {
    let mut m: BTreeMap<String, String> = [
        ("tool", "docktwin".to_owned()),
        ("tool_version", env!("CARGO_PKG_VERSION").to_owned()),
        ("command", "rehearse".to_owned()),
        ("scenario", scenario.name.clone()),
        ("seed", options.seed.to_string()),
        ("twin", options.twin.name().to_owned()),
        ("steps_per_tick", steps.to_string()),
        ("tick_nanos", scenario.run.tick_nanos.to_string()),
        ("started_unix_ns", jiff::Timestamp::now().as_nanosecond().to_string()),
    ]
    .into_iter()
    .map(|(k, v)| (k.to_owned(), v))
    .collect();
    m.extend(digest_keys(&scenario.files).map(|(key, f)| (key, f.digest.to_string())));
    m
}

/// Names of the pairs of surfaces of a scenario, by index.
#[must_use]
pub fn pair_names(scenario: &Scenario) -> Vec<String> {
    docktwin_physics::mechanism::pair_names(&scenario.mechanism)
}

/// Makes rows and events of what was seen, and hands them to a sink.
#[derive(Debug)]
pub(crate) struct RowRecorder {
    pair_names: Vec<String>,
    pub(crate) row: Vec<Cell>,
    pub(crate) contacts: Vec<ContactRow>,
}

impl RowRecorder {
    pub(crate) const fn new(pair_names: Vec<String>) -> Self {
        Self { pair_names, row: Vec::new(), contacts: Vec::new() }
    }

    /// Hands events over; the first failure is given.
    pub(crate) fn events<S: Sink>(
        &self,
        sink: &mut S,
        events: &mut Vec<RunEvent>,
        tick: Tick,
        time: SimTime,
    ) -> Result<(), SinkError> {
        let name = |pair: SurfacePair| self.pair_names[pair.index()].clone();
        let mut first = Ok(());
        for e in events.drain(..) {
            // Each is offered, whatever became of the one before.
            let kept = sink.event(&e.record(tick, time, name));
            first = first.and(kept);
        }
        first
    }
}

/// A rehearsal between two ticks.
pub struct RunningRehearsal<'a, S> {
    scenario: &'a Scenario,
    seed: u64,
    wall: WallInstant,
    thrusts: TimedThrusts,
    observer: Observer,
    events: Vec<RunEvent>,
    recorder: RowRecorder,
    /// At the beginning of the tick to come.
    now: Box<Instant>,
    twin: TickedTwin,
    sink: S,
    tick: u64,
    last: bool,
    ended: bool,
    /// Why it was stopped before its end.
    stopped: Option<String>,
    lost: Option<SinkError>,
}

impl<S: Sink> RunningRehearsal<'_, S> {
    /// What is known at the beginning of the tick to come.
    #[must_use]
    pub fn situation(&self) -> Situation {
        self.now.situation(self.time().seconds())
    }

    /// Everything at the beginning of the tick to come.
    #[must_use]
    pub const fn now(&self) -> &Instant {
        &self.now
    }

    /// The spacecraft and the mechanism.
    #[must_use]
    pub fn system(&self) -> &System {
        self.twin.twin().system()
    }

    /// Number of the tick to come, which is also the number of ticks stepped over.
    #[must_use]
    pub const fn tick_number(&self) -> u64 {
        self.tick
    }

    /// Whether the run is over: there is no tick to come.
    #[must_use]
    pub const fn ended(&self) -> bool {
        self.ended
    }

    /// Lets the tick to come be the last: it is recorded, and nothing moves any more.
    pub const fn end(&mut self) {
        self.last = true;
    }

    /// Stops the run: the tick to come is the last, and its outcome is `stopped` for this reason.
    pub fn stop(&mut self, why: &str) {
        self.last = true;
        self.stopped.get_or_insert_with(|| why.to_owned());
    }

    /// Where the sink failed first.
    #[must_use]
    pub const fn lost(&self) -> Option<&SinkError> {
        self.lost.as_ref()
    }

    /// What has become of the docking so far, and why.
    #[must_use]
    pub fn judgement(&self) -> Judgement {
        self.observer.monitor().judge(self.time().seconds())
    }

    fn time(&self) -> SimTime {
        SimTime::of_tick(Tick(self.tick), self.scenario.run.tick_nanos)
    }

    /// Whether the tick to come is the last one; `ahead` says that wrenches may still come.
    fn decide(&mut self, ahead: bool) {
        let monitor = self.observer.monitor();
        let decided = || {
            let now = self.situation();
            monitor.decided(now.time_s, ahead || self.thrusts.ahead(&now))
        };
        self.last |= self.tick >= self.scenario.run.ticks()
            || monitor.limit().is_some()
            || self.scenario.run.stop_when_decided && decided();
    }

    /// One tick: records the state at its beginning and the control wrenches held over it (the
    /// scenario's thrusts and `control`), and steps to its end. After the last one it does nothing.
    pub fn tick(&mut self, control: &Inputs) {
        if self.ended {
            return;
        }
        self.decide(false);
        let situation = self.situation();
        let mut wrenches = Inputs::default();
        if !self.last {
            wrenches = self.thrusts.wrenches(&situation);
            wrenches.chaser += control.chaser;
            wrenches.target += control.target;
            if let Some(body) = not_finite_control(&wrenches) {
                self.stop(&format!(
                    "the control wrench of the {body} is not finite in tick {}: look at what controls it",
                    self.tick
                ));
                wrenches = Inputs::default();
            }
        }
        self.record(&situation, &wrenches);
        if self.last {
            self.ended = true;
            return;
        }
        let begin = WallInstant::now();
        self.twin.tick(&wrenches);
        self.observer.time_steps(begin.elapsed().as_nanos(), self.twin.steps());
        let before = self.tick;
        self.tick += 1;
        *self.now = self.twin.instant(self.time().seconds());
        if let Some(body) = not_finite(&self.now) {
            // Nothing of it is recorded.
            self.stop(&format!(
                "the state of the {body} is not finite after tick {before}: look at masses, inertias and \
                 stiffness, or take more steps in a tick (run.steps_per_tick)"
            ));
            self.ended = true;
        }
    }

    /// The tick to come as it was recorded: `control` is all that acts, the scenario's thrusts included.
    pub(crate) fn record_as_recorded(&mut self, control: &Inputs) {
        let situation = self.situation();
        self.record(&situation, control);
    }

    /// On to the next tick under the control wrenches of this one.
    pub(crate) fn step_as_recorded(&mut self, control: &Inputs) {
        self.twin.tick(control);
        self.tick += 1;
        *self.now = self.twin.instant(self.time().seconds());
    }

    /// Where the run goes.
    pub(crate) const fn sink_mut(&mut self) -> &mut S {
        &mut self.sink
    }

    /// Observes the present instant and hands it to the sink.
    fn record(&mut self, situation: &Situation, control: &Inputs) {
        let (tick, time) = (Tick(self.tick), self.time());
        let system = self.twin.twin().system();
        let seen = self.now.observation(time.seconds());
        let observed = Observed { system, now: &self.now, seen: &seen, control, time };
        self.observer.observe(&observed, &mut self.events);
        let due = !self.events.is_empty() || self.last;
        let told = self.recorder.events(&mut self.sink, &mut self.events, tick, time);
        let digest = tick_digest(self.twin.twin().digest(), control);
        self.observer.digest(digest);
        let mut kept = Ok(());
        if self.sink.wants_rows() {
            let out = &mut self.recorder;
            row(&self.now, system, control, digest.short(), &mut out.row);
            contact_rows(&self.now, &mut out.contacts);
            kept = self.sink.tick(&TickView {
                tick,
                time,
                row: &out.row,
                contacts: &out.contacts,
                due,
                situation,
                control,
            });
        }
        if let Err(e) = told.and(kept) {
            self.lost.get_or_insert(e);
        }
    }

    /// Judges the run and closes the sink; gives the summary and the sink.
    pub fn finish(mut self) -> (Summary, S) {
        let (tick, time) = (Tick(self.tick), self.time());
        let judgement = self.judgement();
        let asked = Asked {
            scenario: &self.scenario.name,
            expect: &self.scenario.expect,
            seed: self.seed,
            mass_kg: masses(self.scenario),
        };
        let mut summary =
            self.observer.summary(&asked, &self.now.state, &judgement, self.tick, time);
        let mut reason = judgement.reason;
        if let Some(why) = self.stopped.take() {
            summary.stop(&why);
            reason = why;
        }
        self.events.push(RunEvent::Outcome {
            outcome: summary.outcome,
            reason,
            decided_s: judgement.time_s,
        });
        if let Err(e) = self.recorder.events(&mut self.sink, &mut self.events, tick, time) {
            self.lost.get_or_insert(e);
        }
        summary.wall_s = self.wall.elapsed().as_secs_f64();
        summary.realtime_factor = time.seconds() / summary.wall_s.max(1e-9);
        if let Some(e) = &self.lost {
            summary.degrade(&e.to_string());
        }
        if let Err(e) = self.sink.finish(&mut summary) {
            summary.degrade(&e.to_string());
        }
        (summary, self.sink)
    }
}

#[cfg(test)]
mod tests {
    use docktwin_core::DVec3;
    use docktwin_scenario::Loader;

    use super::*;

    #[test]
    fn regress_a_body_that_is_not_finite_is_named() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
        let scenario = Loader::new().load(&path.join("apas_nominal.toml")).expect("a scenario");
        let (system, bodies) = start(&scenario).expect("the sides are apart");
        let twin = TickedTwin::new(TwinKind::Reduced, system, bodies, 1_000_000, 10);
        let mut now = twin.instant(0.0);
        assert_eq!(not_finite(&now), None);
        for (i, name) in ["chaser", "docking ring", "target"].into_iter().enumerate().rev() {
            now.state.bodies[i].v = DVec3::NAN;
            assert_eq!(not_finite(&now), Some(name));
        }
    }
}
