//! What is gathered along a run, tick by tick, whoever runs it: events, the account of energy and
//! momentum, the digest of all states, step times; and the summary and verdict made of them.

use docktwin_core::{ContactChange, ContactSpan, Digest, SimTime, StateHasher, Wrench};
use docktwin_model::{DockingMechanism, MOST_LATCHES};
use docktwin_physics::{
    contact::{PAIRS, SurfacePair},
    mechanism::{LatchPhase, System},
    outcome::{Judgement, Monitor, Observation, Outcome as Judged},
    reduced::{DockingState, Inputs},
};
use docktwin_record::{Masses, Outcome, StepUs, Summary, Verdict};
use docktwin_scenario::{Body, Expect, ExpectedOutcome, Measured};
use hdrhistogram::Histogram;

use crate::{event::RunEvent, signals::Instant};

/// An energy account that is off by more than this share of the energy put in is a defect.
const ENERGY_TOLERANCE: f64 = 1e-3;

/// What one tick adds.
#[derive(Clone, Copy, Debug)]
pub struct Observed<'a> {
    /// The spacecraft and the mechanism.
    pub system: &'a System,
    /// The instant.
    pub now: &'a Instant,
    /// What the outcome is judged by.
    pub seen: &'a Observation,
    /// Control wrenches held from this instant.
    pub control: &'a Inputs,
    /// Instant of the tick.
    pub time: SimTime,
}

/// What a summary needs beside what was observed.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// Name of the scenario.
    pub scenario: &'a str,
    /// What makes the verdict.
    pub expect: &'a Expect,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Masses of what moves.
    pub mass_kg: Masses,
}

/// Gathers.
#[derive(Clone)]
pub struct Observer {
    monitor: Monitor,
    contacts: [PairHistory; PAIRS],
    latches: [LatchPhase; MOST_LATCHES],
    captured: bool,
    /// Latches with places of their own.
    own_latches: usize,
    thrust: [bool; 2],
    limit_reported: bool,
    digests: StateHasher,
    energy: EnergyAccount,
    momentum: MomentumAccount,
    exit_speed_m_s: Option<f64>,
    steps: StepTimes,
}

impl Default for Observer {
    fn default() -> Self {
        Self {
            monitor: Monitor::default(),
            contacts: [PairHistory::default(); PAIRS],
            latches: [LatchPhase::Free; MOST_LATCHES],
            captured: false,
            own_latches: 0,
            thrust: [false; 2],
            limit_reported: false,
            digests: StateHasher::new(),
            energy: EnergyAccount::default(),
            momentum: MomentumAccount::default(),
            exit_speed_m_s: None,
            steps: StepTimes::default(),
        }
    }
}

impl Observer {
    /// What judges the outcome.
    #[must_use]
    pub const fn monitor(&self) -> &Monitor {
        &self.monitor
    }

    /// Takes the digest of a tick into that of the run.
    pub fn digest(&mut self, digest: Digest) {
        self.digests.bytes(&digest.0);
    }

    /// Takes the computing time of the steps of a tick.
    pub fn time_steps(&mut self, nanos: u128, steps: u32) {
        self.steps.add(nanos, steps);
    }

    /// Takes a tick in; what happened is appended to `events`.
    pub fn observe(&mut self, o: &Observed<'_>, events: &mut Vec<RunEvent>) {
        let mechanism = o.system.mechanism();
        self.own_latches = mechanism.own_latches.len();
        self.monitor.observe(mechanism, &o.now.state.mechanism, o.seen);
        self.energy.add(o.now);
        self.momentum.add(o.system, o.now);
        self.exit_speed_m_s = (!o.now.measured.touching() && o.now.state.first_contact_s.is_some())
            .then(|| o.now.relative.v.length());
        self.watch_contacts(o, events);
        self.watch_mechanism(o, events);
        self.watch_inputs(o.control, events);
        if let (false, Some(l)) = (self.limit_reported, self.monitor.limit()) {
            self.limit_reported = true;
            events.push(RunEvent::Limit(*l));
        }
    }

    fn watch_contacts(&mut self, o: &Observed<'_>, events: &mut Vec<RunEvent>) {
        let mut force = [None; PAIRS];
        for c in o.now.contacts() {
            let f: &mut Option<f64> = &mut force[c.pair];
            *f = Some(f.unwrap_or(0.0) + c.normal_w_n.length());
        }
        for (i, history) in self.contacts.iter_mut().enumerate() {
            let pair = SurfacePair::from_index(i);
            let change = history.span.observe(o.time, force[i].is_some());
            if let Some(ContactChange::Ended { begin, end }) = change {
                let [since_s, until_s] = [begin.seconds(), end.seconds()];
                let peak_n = core::mem::take(&mut history.peak_n);
                events.push(RunEvent::ContactEnd { pair, since_s, until_s, peak_n });
            }
            let Some(force_n) = force[i] else { continue };
            history.peak_n = history.peak_n.max(force_n);
            if change == Some(ContactChange::Began) {
                events.push(RunEvent::ContactBegin { pair, force_n });
            }
        }
    }

    fn watch_mechanism(&mut self, o: &Observed<'_>, events: &mut Vec<RunEvent>) {
        let now = &o.now.state.mechanism;
        for (latch, (known, l)) in self.latches.iter_mut().zip(now.all_latches()).enumerate() {
            if l.phase != *known {
                *known = l.phase;
                let gap_m = o.now.measured.latches[latch].axial_m;
                events.push(RunEvent::Latch { latch, phase: l.phase, gap_m });
            }
        }
        if let (false, Some(capture_s)) = (self.captured, now.captured_s()) {
            self.captured = true;
            events.push(RunEvent::Captured { capture_s, own_latches: self.own_latches > 0 });
        }
    }

    fn watch_inputs(&mut self, control: &Inputs, events: &mut Vec<RunEvent>) {
        let bodies = [(Body::Chaser, control.chaser), (Body::Target, control.target)];
        for ((on, wrench), known) in bodies.into_iter().zip(&mut self.thrust) {
            let active = wrench != Wrench::ZERO;
            if active != *known {
                *known = active;
                events.push(RunEvent::Thrust { on, active });
            }
        }
    }

    /// The summary, with the verdict; wall times are left at zero.
    #[must_use]
    pub fn summary(
        &self,
        asked: &Asked<'_>,
        state: &DockingState,
        judgement: &Judgement,
        ticks: u64,
        time: SimTime,
    ) -> Summary {
        let failures = self.failures(asked.expect, state, judgement, time);
        let verdict = if failures.is_empty() { Verdict::Pass } else { Verdict::Fail };
        Summary {
            failure_reason: (!failures.is_empty()).then(|| told(&failures, judgement)),
            not_judged: asked.expect.not_judged_without_rig(),
            ..self.figures(
                asked,
                state,
                (recorded_outcome(judgement.outcome), verdict),
                ticks,
                time,
            )
        }
    }

    /// The summary without its reasons.
    fn figures(
        &self,
        asked: &Asked<'_>,
        state: &DockingState,
        (outcome, verdict): (Outcome, Verdict),
        ticks: u64,
        time: SimTime,
    ) -> Summary {
        Summary {
            seed: asked.seed,
            state_digest: self.digests.finish().to_string(),
            first_contact_s: state.first_contact_s,
            capture_s: state.mechanism.captured_s(),
            latches_s: state
                .mechanism
                .all_latches()
                .take(if self.own_latches > 0 { self.own_latches } else { 3 })
                .map(|l| l.times_s[2])
                .collect(),
            peak_force_n: state.peak_force_n,
            peak_moment_nm: state.peak_moment_nm,
            impulse_ns: state.impulse_ns,
            net_impulse_ns: Some(state.net_impulse.length()),
            peak_penetration_m: state.peak_depth_m,
            mass_kg: Some(asked.mass_kg),
            energy_in_j: self.energy.in_j,
            energy_dissipated_j: state.mechanism.losses.total(),
            energy_balance_error: self.energy.error,
            momentum_error: self.momentum.error,
            duration_s: time.seconds(),
            ticks,
            step_us: self.steps.summary(),
            ..Summary::new(asked.scenario, outcome, verdict)
        }
    }

    /// The summary of a run against a rig, of which the verdict is still to be made: figures alone.
    #[must_use]
    pub fn summary_with_rig(
        &self,
        asked: &Asked<'_>,
        state: &DockingState,
        judgement: &Judgement,
        ticks: u64,
        time: SimTime,
    ) -> Summary {
        let outcome = (recorded_outcome(judgement.outcome), Verdict::Fail);
        Summary {
            // Nothing tells where energy went on a rig: what is missing is what the mechanism took.
            energy_balance_error: f64::NAN,
            ..self.figures(asked, state, outcome, ticks, time)
        }
    }

    /// What was not as expected, one line each.
    fn failures(
        &self,
        expect: &Expect,
        state: &DockingState,
        judgement: &Judgement,
        time: SimTime,
    ) -> Vec<String> {
        let capture_s = state.mechanism.captured_s();
        let mut failures = expect.failures(&Measured {
            outcome: expected_outcome(judgement.outcome),
            first_contact_s: state.first_contact_s,
            capture_s,
            duration_s: time.seconds(),
            peak_force_n: state.peak_force_n,
            peak_moment_nm: state.peak_moment_nm,
            peak_penetration_m: state.peak_depth_m,
            impulse_ns: state.impulse_ns,
            exit_speed_m_s: if capture_s.is_some() { None } else { self.exit_speed_m_s },
        });
        if self.energy.error > ENERGY_TOLERANCE {
            failures.push(format!(
                "the energy account does not close: off by {:.3} % of the energy put in",
                self.energy.error * 100.0
            ));
        }
        failures
    }
}

/// Failures and how the docking itself was judged, in one line.
pub(crate) fn told(failures: &[String], judgement: &Judgement) -> String {
    format!("{} [{}: {}]", failures.join("; "), judgement.outcome.name(), judgement.reason)
}

/// The outcome as a record names it.
#[must_use]
pub const fn recorded_outcome(outcome: Judged) -> Outcome {
    match outcome {
        Judged::Captured => Outcome::Captured,
        Judged::Rebounded => Outcome::Rebounded,
        Judged::Missed => Outcome::Missed,
        Judged::Jammed => Outcome::Jammed,
        Judged::LimitExceeded => Outcome::LimitExceeded,
    }
}

/// The outcome as a scenario names it.
#[must_use]
pub const fn expected_outcome(outcome: Judged) -> ExpectedOutcome {
    match outcome {
        Judged::Captured => ExpectedOutcome::Captured,
        Judged::Rebounded => ExpectedOutcome::Rebounded,
        Judged::Missed => ExpectedOutcome::Missed,
        Judged::Jammed => ExpectedOutcome::Jammed,
        Judged::LimitExceeded => ExpectedOutcome::LimitExceeded,
    }
}

/// A pair of surfaces so far.
#[derive(Clone, Copy, Debug, Default)]
struct PairHistory {
    span: ContactSpan,
    peak_n: f64,
}

/// The larger error; one that is not a number is the worst of all.
fn worst(so_far: f64, now: f64) -> f64 {
    if now.is_nan() { f64::INFINITY } else { so_far.max(now) }
}

/// Energy put in against energy there and lost.
#[derive(Clone, Copy, Debug, Default)]
struct EnergyAccount {
    start_j: Option<f64>,
    in_j: f64,
    /// Largest so far, relative to `in_j`.
    error: f64,
}

impl EnergyAccount {
    fn add(&mut self, now: &Instant) {
        let e = &now.energy;
        let start = *self.start_j.get_or_insert(e.kinetic + e.stored);
        self.in_j = start + e.work_in.max(0.0);
        let balance = start + e.work_in - e.kinetic - e.stored - e.lost;
        self.error = worst(self.error, (balance / self.in_j).abs());
    }
}

/// Momentum at the start and that of the control wrenches against momentum there.
#[derive(Clone, Copy, Debug, Default)]
struct MomentumAccount {
    start: Option<Wrench>,
    /// kg·m/s and kg·m²/s.
    scale: (f64, f64),
    /// Largest so far, relative.
    error: f64,
}

impl MomentumAccount {
    fn add(&mut self, system: &System, now: &Instant) {
        let scale = &mut self.scale;
        let p0 = *self.start.get_or_insert_with(|| {
            // Scale: linear and angular momentum of the chaser about the common mass centre, which
            // rests at the origin; at least one metre of lever where it comes straight on.
            let (c, m) = (&now.state.bodies[0], &system.mass()[0]);
            let p = c.v * m.mass();
            let l = (c.p.cross(p) + c.l).length();
            *scale = (p.length(), l.max(p.length()));
            now.momentum
        });
        let (dp, dl) = (
            now.momentum.f - p0.f - now.state.impulse_in.f,
            now.momentum.m - p0.m - now.state.impulse_in.m,
        );
        let (sp, sl) = self.scale;
        self.error = worst(self.error, (dp.length() / sp).max(dl.length() / sl));
    }
}

/// Computing times of steps.
#[derive(Clone, Debug)]
struct StepTimes {
    histogram: Histogram<u64>,
    steps: u64,
}

impl Default for StepTimes {
    fn default() -> Self {
        let histogram = Histogram::new_with_bounds(1, 100_000_000_000, 3)
            .expect("1 ns to 100 s at three digits is a valid histogram");
        Self { histogram, steps: 0 }
    }
}

impl StepTimes {
    fn add(&mut self, nanos: u128, steps: u32) {
        let per_step = nanos / u128::from(steps.max(1));
        self.histogram.saturating_record(u64::try_from(per_step).unwrap_or(u64::MAX).max(1));
        self.steps += u64::from(steps);
    }

    fn summary(&self) -> StepUs {
        #[expect(clippy::cast_precision_loss, reason = "times far below 2^53 ns")]
        let us = |ns: u64| ns as f64 * 1e-3;
        let at = |q: f64| us(self.histogram.value_at_quantile(q));
        StepUs {
            p50: at(0.5),
            p99: at(0.99),
            p999: at(0.999),
            max: us(self.histogram.max()),
            n: self.steps,
        }
    }
}

/// Name of a pair of surfaces of a mechanism, as it is recorded.
#[must_use]
pub fn pair_name(mechanism: &DockingMechanism, pair: SurfacePair) -> String {
    docktwin_physics::mechanism::pair_name(mechanism, pair.index())
}
