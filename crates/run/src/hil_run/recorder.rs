//! Looks at every tick of the loop: events, signals, and what is compared with the simulated system.

use std::time::Duration;

use docktwin_control::safety::Trip;
use docktwin_core::{SimTime, Tick};
use docktwin_hil::scheduler::{Phase, TickRecord};
use docktwin_physics::{mechanism::System, outcome::Judgement};
use docktwin_record::Summary;
use docktwin_scenario::Scenario;

use super::{
    Ended, HilRun, PERIOD_NS, PERIOD_S,
    compensated::{Compensated, EnergyTold},
    prepare::see,
    summary::{loop_summary, milliseconds, safety_summary, step_summary},
    verdict,
};
use crate::{
    control::{Control as _, Situation, TimedThrusts},
    error::{RunError, SinkError},
    event::RunEvent,
    fidelity::FidelityMeter,
    observer::{Asked, Observed, Observer},
    rehearsal::{RowRecorder, pair_names},
    setup::masses,
    signals::{Instant, contact_rows, row},
    sink::{Header, Sink, TickView},
    telemetry::{Watcher, hil_columns_for, loop_row},
};

/// Takes the ticks of a loop in, and makes the record and the summary of them.
pub(crate) struct HilRecorder<'a, S> {
    scenario: &'a Scenario,
    system: System,
    seed: u64,
    dry_run: bool,
    /// Whether times of the wall are recorded: under a virtual clock they would make two runs differ.
    timed: bool,
    sink: S,
    recorder: RowRecorder,
    observer: Observer,
    watcher: Watcher,
    meter: FidelityMeter,
    compensated: Compensated,
    energy: EnergyTold,
    thrusts: TimedThrusts,
    situation: Situation,
    events: Vec<RunEvent>,
    /// Recorded so far.
    ticks: u64,
    trip: Option<Trip>,
    phase: Option<Phase>,
    lost: Option<SinkError>,
}

impl<'a, S: Sink> HilRecorder<'a, S> {
    pub(crate) fn begin(run: &HilRun<'a>, mut sink: S, timed: bool) -> Result<Self, RunError> {
        let scenario = run.scenario;
        let (columns, pair_names) = (hil_columns_for(&scenario.mechanism), pair_names(scenario));
        let metadata = run.metadata();
        let (rig, kept) = run.kept()?;
        let (reference, bodies) = run.reference();
        sink.begin(&Header {
            scenario,
            columns: &columns,
            pair_names: &pair_names,
            metadata: &metadata,
            rig: Some(&rig),
            kept: &kept,
            real_time: timed,
        })
        .map_err(RunError::Sink)?;
        Ok(Self {
            scenario,
            system: run.system.clone(),
            seed: run.options.seed,
            dry_run: run.options.dry_run,
            timed,
            sink,
            recorder: RowRecorder::new(pair_names),
            observer: Observer::default(),
            watcher: Watcher::new(run.bodies),
            meter: FidelityMeter::new(
                reference,
                run.article.article.on(&run.rig),
                bodies,
                PERIOD_NS,
            ),
            compensated: Compensated::new(run.setup.compensation),
            energy: EnergyTold::default(),
            thrusts: TimedThrusts::of(scenario),
            situation: run.commands(crate::control::Coasting).now,
            events: Vec::new(),
            ticks: 0,
            trip: None,
            phase: None,
            lost: None,
        })
    }

    /// Where the run goes.
    pub(crate) const fn sink_mut(&mut self) -> &mut S {
        &mut self.sink
    }

    fn time(&self, tick: u64) -> SimTime {
        SimTime::of_tick(Tick(tick), self.scenario.run.tick_nanos)
    }

    fn keep(&mut self, done: Result<(), SinkError>) {
        if let Err(e) = done {
            self.lost.get_or_insert(e);
        }
    }

    /// Takes a tick in; true when the run is to end.
    pub(crate) fn take(&mut self, r: &TickRecord) -> bool {
        let time = self.time(self.ticks);
        see(&mut self.situation, r);
        self.watch_loop(r);
        // The way to the initial condition is not recorded, the way to rest is.
        if r.closed_tick.is_none() && !(r.phase == Phase::Stop && self.ticks > 0) {
            self.sink.approach(r.phase.name(), &self.situation);
            self.report_events(time);
            return false;
        }
        let t = time.seconds();
        let shown = self.watcher.take(&self.system, r, t, PERIOD_S);
        let now = self.watcher.instant(&self.system, shown, r, t, PERIOD_S);
        if r.closed_tick.is_some() {
            self.observe(&now, r, time);
        }
        self.record(&now, r, time);
        self.ticks += 1;
        r.closed_tick.is_some() && self.decided(t)
    }

    /// What the loop itself did.
    fn watch_loop(&mut self, r: &TickRecord) {
        if self.phase != Some(r.phase) {
            self.phase = Some(r.phase);
            self.events.push(RunEvent::Phase(r.phase));
        }
        if let (None, Some(trip)) = (self.trip, r.trip) {
            self.trip = Some(trip);
            self.events.push(RunEvent::SafetyStop(trip));
        }
        if r.missed > 0 {
            let lateness_ms = milliseconds(r.lateness_ns);
            self.events.push(RunEvent::MissedTicks { missed: r.missed, lateness_ms });
        }
    }

    fn observe(&mut self, now: &Instant, r: &TickRecord, time: SimTime) {
        self.meter.add(r);
        self.events.extend(self.compensated.take(r, time.seconds()));
        self.events.extend(self.energy.take(r));
        let seen = now.observation(time.seconds());
        let observed =
            Observed { system: &self.system, now, seen: &seen, control: &r.control, time };
        self.observer.observe(&observed, &mut self.events);
        self.observer.digest(r.digest());
    }

    fn record(&mut self, now: &Instant, r: &TickRecord, time: SimTime) {
        let due = !self.events.is_empty();
        self.report_events(time);
        if !self.sink.wants_rows() {
            return;
        }
        let out = &mut self.recorder;
        row(now, &self.system, &r.control, r.digest().short(), &mut out.row);
        let [x_13, x_24] = self.system.ports();
        let x_34 = (r.bodies[0].pose() * x_13).inverse() * r.bodies[1].pose() * x_24;
        loop_row(r, &x_34, self.timed, &mut out.row);
        contact_rows(now, &mut out.contacts);
        let kept = self.sink.tick(&TickView {
            tick: Tick(self.ticks),
            time,
            row: &out.row,
            contacts: &out.contacts,
            due,
            situation: &self.situation,
            control: &r.control,
        });
        self.keep(kept);
    }

    fn report_events(&mut self, time: SimTime) {
        let tick = Tick(self.ticks);
        let kept = self.recorder.events(&mut self.sink, &mut self.events, tick, time);
        self.keep(kept);
    }

    fn decided(&self, time_s: f64) -> bool {
        let state = self.watcher.state();
        let now = Situation {
            time_s,
            first_contact_s: state.first_contact_s,
            captured_s: state.mechanism.captured_s(),
            ..self.situation
        };
        // Parted spacecraft leave the rig's workspace: there is nothing more to be learnt.
        let parted = now.captured_s.is_none();
        let monitor = self.observer.monitor();
        monitor.limit().is_some()
            || ((self.scenario.run.stop_when_decided || parted)
                && monitor.decided(time_s, self.thrusts.ahead(&now)))
    }

    /// What follows from the ticks alone, whatever ended them.
    pub(crate) fn judged(&self) -> (Summary, Judgement) {
        let last = self.ticks.saturating_sub(1);
        let time = self.time(last);
        let judgement = self.observer.monitor().judge(time.seconds());
        let asked = Asked {
            scenario: &self.scenario.name,
            expect: &self.scenario.expect,
            seed: self.seed,
            mass_kg: masses(self.scenario),
        };
        let state = self.watcher.state();
        let mut summary = self.observer.summary_with_rig(&asked, state, &judgement, last, time);
        summary.fidelity = Some(self.meter.fidelity());
        summary.compensator = Some(self.compensated.summary());
        (summary, judgement)
    }

    /// Judges the run and closes the sink.
    pub(super) fn finish(mut self, ended: &Ended, wall: Duration) -> (Summary, S) {
        let last = self.ticks.saturating_sub(1);
        let time = self.time(last);
        let (mut summary, judgement) = self.judged();
        verdict::judge(&self.scenario.expect, &mut summary, &judgement, ended, self.dry_run);
        summary.warnings.extend(self.compensated.warning());
        self.tell_figures(&summary);
        summary.loop_ = Some(loop_summary(ended));
        summary.step_us = step_summary(ended);
        summary.safety = Some(safety_summary(ended));
        let mut reason = judgement.reason;
        if let (Some(by), None) = (ended.stopped, ended.end.trip) {
            reason = format!("stopped by {by}");
            summary.stop(&reason);
        }
        if let Some(why) = &ended.lacking {
            summary.degrade(why);
        }
        if ended.dropped > 0 {
            summary.degrade(&format!("{} ticks were not recorded", ended.dropped));
        }
        self.events.push(RunEvent::Outcome {
            outcome: summary.outcome,
            reason,
            decided_s: judgement.time_s,
        });
        let kept = self.recorder.events(&mut self.sink, &mut self.events, Tick(last), time);
        self.keep(kept);
        summary.wall_s = wall.as_secs_f64();
        summary.realtime_factor = time.seconds() / summary.wall_s.max(1e-9);
        if let Some(e) = &self.lost {
            summary.degrade(&e.to_string());
        }
        if let Err(e) = self.sink.finish(&mut summary) {
            summary.degrade(&e.to_string());
        }
        (summary, self.sink)
    }

    /// Figures and warnings as events, so that they stand in the log and are seen in a viewer.
    fn tell_figures(&mut self, summary: &Summary) {
        let compared = summary.fidelity.filter(|f| f.peak_force_ratio.is_some());
        self.events.extend(compared.map(|f| RunEvent::Fidelity(Box::new(f))));
        self.events.extend(summary.warnings.iter().cloned().map(RunEvent::Warning));
    }
}
