//! `rehearse`: the twin alone, as fast as possible, or in real time under a pilot.

use std::{
    collections::BTreeMap, io::IsTerminal, path::Path, process::ExitCode,
    time::Instant as WallInstant,
};

use docktwin_core::{SimTime, StateHasher, Tick, Wrench};
use docktwin_hil::clock::{Clock as _, OverrunPolicy, RealtimeClock};
use docktwin_model::FileDigest;
use docktwin_physics::{
    body::BodyState,
    contact::PAIRS,
    mechanism::{LatchPhase, System, pair_name},
    outcome::{Judgement, Monitor, Observation, Outcome as Judged},
    reduced::{DockingState, DockingTwin, Inputs, ReducedTwin},
};
use docktwin_record::{
    ContactRow, Event, Outcome, Policy, RunWriter, SUMMARY_SCHEMA, StepUs, Summary, Verdict,
};
use docktwin_scenario::{Expect, ExpectedOutcome, Measured, Scenario, load_scenario};
use docktwin_twin::FullTwin;
use docktwin_view::SceneWriter;
use hdrhistogram::Histogram;
use serde_json::json;

use docktwin::{
    pilot::Stick,
    playback::{self, Playback},
    setup::{
        FULL_STEPS_PER_MS, REDUCED_STEPS_PER_MS, inputs, start, steps_per_tick, thrust_ahead,
        tick_digest,
    },
    signals::{Instant, columns, contact_rows, row},
};

use crate::{
    cli::{RehearseArgs, TwinKind},
    commands::{new_directory, overrides},
    company::{Company, Flight, pilot_line},
    failure::{Failure, OTHERWISE},
    models::ModelCopies,
};

/// A contact that is interrupted for less than this is one contact in the events, s.
pub(crate) const CONTACT_GAP_S: f64 = 0.02;
/// An energy account that is off by more than this share of the energy put in is a defect.
const ENERGY_TOLERANCE: f64 = 1e-3;

/// Between two lines about the approach to a pilot, ns of simulated time.
const PILOT_LINE_NS: u64 = 100_000_000;

/// Runs the command.
pub(crate) fn run(args: &RehearseArgs, json: bool) -> Result<ExitCode, Failure> {
    let scenario = load_scenario(&args.scenario, &overrides(&args.set)?)?;
    let out = args.out.clone().unwrap_or_else(|| new_directory("runs", &scenario.name));
    if !json {
        scenario.notes.iter().for_each(|n| eprintln!("ignored {n}"));
    }
    let per_ms = match args.twin {
        TwinKind::Full => FULL_STEPS_PER_MS,
        TwinKind::Reduced => REDUCED_STEPS_PER_MS,
    };
    let steps = steps_per_tick(&scenario, per_ms);
    let setup = Setup { scenario: &scenario, seed: args.seed, kind: args.twin, steps, out: &out };
    let company = Company::invite(&args.live, &args.pilot, &scenario, &columns())?;
    let summary = match args.twin {
        TwinKind::Full => setup.rehearse(FullTwin::new, !args.no_rrd, json, company)?,
        TwinKind::Reduced => setup.rehearse(ReducedTwin::new, !args.no_rrd, json, company)?,
    };
    if json {
        // A summary always serialises; a defect would show as an empty object.
        println!("{}", serde_json::to_value(&summary).unwrap_or_default());
    } else {
        print(&summary, &scenario.expect, &out);
        println!("Replay it with: docktwin replay {}", out.display());
    }
    Ok(ExitCode::from(if summary.verdict == Verdict::Pass { 0 } else { OTHERWISE }))
}

/// What a rehearsal needs.
pub(crate) struct Setup<'a> {
    pub(crate) scenario: &'a Scenario,
    pub(crate) seed: u64,
    pub(crate) kind: TwinKind,
    pub(crate) steps: u32,
    pub(crate) out: &'a Path,
}

impl Setup<'_> {
    /// Physics step, s.
    pub(crate) fn step_s(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "a tick is far below 2^53 ns")]
        let tick = self.scenario.run.tick_nanos as f64 / 1e9;
        tick / f64::from(self.steps)
    }

    fn metadata(&self) -> BTreeMap<String, String> {
        let mut m: BTreeMap<String, String> = [
            ("tool", "docktwin".to_owned()),
            ("tool_version", env!("CARGO_PKG_VERSION").to_owned()),
            ("command", "rehearse".to_owned()),
            ("scenario", self.scenario.name.clone()),
            ("seed", self.seed.to_string()),
            ("twin", self.kind.name().to_owned()),
            ("steps_per_tick", self.steps.to_string()),
            ("tick_nanos", self.scenario.run.tick_nanos.to_string()),
            ("started_unix_ns", jiff::Timestamp::now().as_nanosecond().to_string()),
        ]
        .into_iter()
        .map(|(k, v)| (k.to_owned(), v))
        .collect();
        for (key, f) in digest_keys(&self.scenario.files) {
            m.insert(key, f.digest.to_string());
        }
        m
    }

    pub(crate) fn rehearse<T: DockingTwin>(
        &self,
        new: impl FnOnce(System, [BodyState; 3], f64) -> T,
        rrd: bool,
        json: bool,
        mut company: Company,
    ) -> Result<Summary, Failure> {
        let scenario = self.scenario;
        let (system, bodies) = start(scenario)?;
        let pair_names: Vec<String> =
            (0..PAIRS).map(|i| pair_name(&scenario.mechanism, i)).collect();
        let models = ModelCopies::read(scenario)?;
        let mut writer =
            RunWriter::create(self.out, columns(), pair_names, &self.metadata(), Policy::Wait)?;
        models.write(&writer)?;
        writer.scenario_toml(&models.refer(&scenario.as_run_toml()))?;
        let mut view = if rrd {
            let (model, names) = (playback::scene_model(scenario), playback::pair_names(scenario));
            let writer = SceneWriter::create(&self.out.join("run.rrd"), &model, &names)?;
            Some((writer, Playback::new(scenario, &columns())?))
        } else {
            None
        };

        let wall = WallInstant::now();
        let h = self.step_s();
        let mut twin = new(system, bodies, h);
        let mut run = Run::new();
        // Once the recording is lost, the rehearsal goes on: its result is worth having.
        let mut lost: Option<Failure> = None;
        let ticks = scenario.run.ticks();
        let stick = company.stick();
        let bar = progress(ticks, json || stick.is_some());
        // No tick is left out: simulated time would stand still meanwhile.
        let mut clock = stick
            .is_some()
            .then(|| RealtimeClock::new(scenario.run.tick_nanos, OverrunPolicy::CatchUp));
        if let Some(c) = &mut clock {
            c.start();
        }
        let mut tick = 0;
        loop {
            if let Some(c) = &mut clock {
                c.wait();
            }
            let time = SimTime::of_tick(Tick(tick), scenario.run.tick_nanos);
            let state = twin.state();
            let now = Instant::new(twin.system(), &state, time.seconds(), h);
            let last = tick == ticks
                || stick.as_ref().is_some_and(Stick::ended)
                || run.monitor.limit().is_some()
                || (scenario.run.stop_when_decided
                    && run.monitor.decided(
                        time.seconds(),
                        // A pilot may come back.
                        stick.is_some() || thrust_ahead(&scenario.thrusts, &state, time.seconds()),
                    ));
            let mut control = if last {
                Inputs::default()
            } else {
                inputs(&scenario.thrusts, &state, time.seconds())
            };
            if let (Some(stick), false) = (&stick, last) {
                control.chaser += stick.wrench();
                if !json && time.nanos().is_multiple_of(PILOT_LINE_NS) {
                    let x_34 = now.measured.poses().x_w3.inverse() * now.measured.poses().x_w4;
                    let flight = Flight {
                        x_34: &x_34,
                        closing_m_s: -now.relative.v.x,
                        contact_n: now.port4.f.length(),
                        control: &control.chaser,
                    };
                    pilot_line(format_args!("t {:7.2} s", time.seconds()), &flight);
                }
            }
            run.observe(twin.system(), &now, &control, Tick(tick), time)?;
            for e in run.events.drain(..) {
                if lost.is_none() {
                    lost = writer.event(&e).err().map(Failure::from);
                }
                if let Some((v, _)) = &mut view {
                    v.event(time, &e.kind, &e.text)?;
                }
                if let Some(l) = company.live() {
                    l.events().event(time, &e.kind, &e.text);
                }
                run.frame_due = true;
            }
            let digest = tick_digest(twin.digest(), &control);
            run.chain(digest);
            row(&now, twin.system(), &control, digest.short(), &mut run.row);
            contact_rows(&now, &mut run.contacts);
            if lost.is_none() {
                lost =
                    writer.tick(Tick(tick), time, &run.row, &run.contacts).err().map(Failure::from);
            }
            let due = core::mem::take(&mut run.frame_due) || last;
            if let Some((v, playback)) = &mut view {
                playback.show(v, time, &run.row, &run.contacts, due)?;
            }
            if let Some(l) = company.live() {
                l.tick(time, &run.row, &run.contacts, due);
            }
            if last {
                break;
            }
            let begin = WallInstant::now();
            for _ in 0..self.steps {
                twin.step(&control);
            }
            run.timing(begin.elapsed().as_nanos(), self.steps);
            tick += 1;
            if tick.is_multiple_of(100) {
                bar.set_position(tick);
            }
        }
        bar.finish_and_clear();
        company.land();
        let state = twin.state();
        let time = SimTime::of_tick(Tick(tick), scenario.run.tick_nanos);
        let judgement = run.monitor.judge(time.seconds());
        let outcome_event = Event::new(
            Tick(tick),
            time,
            "outcome",
            format!("{}: {}", judgement.outcome.name(), judgement.reason),
            json!({ "outcome": judgement.outcome.name(), "decided_s": judgement.time_s }),
        );
        if lost.is_none() {
            lost = writer.event(&outcome_event).err().map(Failure::from);
        }
        let mut summary = run.summary(
            &Asked { scenario, expect: &scenario.expect, seed: self.seed },
            &state,
            &judgement,
            tick,
            time,
        );
        if let Some((mut v, _)) = view {
            v.event(time, &outcome_event.kind, &outcome_event.text)?;
            if let Err(e) = v.finish() {
                // After a lost log this is the same disk once more.
                if lost.is_none() {
                    summary.degrade(&e.to_string());
                    lost = Some(e.into());
                }
            }
        }
        let wall_s = wall.elapsed().as_secs_f64();
        summary.wall_s = wall_s;
        summary.realtime_factor = time.seconds() / wall_s.max(1e-9);
        if let Some(l) = company.live() {
            l.events().event(time, &outcome_event.kind, &outcome_event.text);
        }
        company.part(json);
        match writer.finish(&summary) {
            Ok(recording) => summary.recording = Some(recording),
            Err(e) => {
                summary.degrade(&e.to_string());
                // The first failure is told; the others follow from it.
                lost.get_or_insert(e.into());
            }
        }
        if let (Some(e), false) = (lost, json) {
            eprintln!("the recording is not complete: {e}");
        }
        Ok(summary)
    }
}

/// Keys under which the digests of a run's model files are kept. Numbered, because two files may have
/// one name; the scenario itself, first of all, is kept whole.
pub(crate) fn digest_keys(files: &[FileDigest]) -> impl Iterator<Item = (String, &FileDigest)> {
    files.iter().enumerate().skip(1).map(|(i, f)| (format!("digest:{i}:{}", file_name(&f.path)), f))
}

fn file_name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

pub(crate) fn progress(ticks: u64, json: bool) -> indicatif::ProgressBar {
    if json || !std::io::stderr().is_terminal() {
        return indicatif::ProgressBar::hidden();
    }
    let style = indicatif::ProgressStyle::with_template("{bar:40} {percent}% {eta} left")
        .unwrap_or_else(|_| indicatif::ProgressStyle::default_bar());
    indicatif::ProgressBar::new(ticks).with_style(style)
}

/// A pair of surfaces as the events tell it.
#[derive(Clone, Copy, Default)]
struct PairStory {
    since_s: Option<f64>,
    last_s: f64,
    peak_n: f64,
}

/// The larger error; one that is not a number is the worst of all.
fn worst(so_far: f64, now: f64) -> f64 {
    if now.is_nan() { f64::INFINITY } else { so_far.max(now) }
}

/// What was asked of a run.
pub(crate) struct Asked<'a> {
    pub(crate) scenario: &'a Scenario,
    /// What makes the verdict.
    pub(crate) expect: &'a Expect,
    pub(crate) seed: u64,
}

/// What is gathered along a run.
pub(crate) struct Run {
    pub(crate) monitor: Monitor,
    pub(crate) events: Vec<Event>,
    pub(crate) row: Vec<docktwin_record::Cell>,
    pub(crate) contacts: Vec<ContactRow>,
    pairs: [PairStory; PAIRS],
    latches: [LatchPhase; 3],
    captured: bool,
    thrust: [bool; 2],
    pub(crate) frame_due: bool,
    limit_told: bool,
    chain: StateHasher,
    histogram: Histogram<u64>,
    steps: u64,
    energy_start: Option<f64>,
    energy_in: f64,
    energy_error: f64,
    momentum_start: Option<Wrench>,
    momentum_scale: (f64, f64),
    momentum_error: f64,
    exit_speed: Option<f64>,
    gap_s: f64,
}

impl Run {
    pub(crate) fn new() -> Self {
        let histogram = Histogram::new_with_bounds(1, 100_000_000_000, 3)
            .expect("1 ns to 100 s at three digits is a valid histogram");
        Self {
            monitor: Monitor::default(),
            events: Vec::new(),
            row: Vec::new(),
            contacts: Vec::new(),
            pairs: [PairStory::default(); PAIRS],
            latches: [LatchPhase::Free; 3],
            captured: false,
            thrust: [false; 2],
            frame_due: false,
            limit_told: false,
            chain: StateHasher::new(),
            histogram,
            steps: 0,
            energy_start: None,
            energy_in: 0.0,
            energy_error: 0.0,
            momentum_start: None,
            momentum_scale: (0.0, 0.0),
            momentum_error: 0.0,
            exit_speed: None,
            gap_s: CONTACT_GAP_S,
        }
    }

    pub(crate) fn chain(&mut self, digest: docktwin_core::Digest) {
        self.chain.bytes(&digest.0);
    }

    pub(crate) fn timing(&mut self, nanos: u128, steps: u32) {
        let per_step = nanos / u128::from(steps.max(1));
        self.histogram.saturating_record(u64::try_from(per_step).unwrap_or(u64::MAX).max(1));
        self.steps += u64::from(steps);
    }

    pub(crate) fn observe(
        &mut self,
        system: &System,
        now: &Instant<'_>,
        control: &Inputs,
        tick: Tick,
        time: SimTime,
    ) -> Result<(), Failure> {
        let seen = now.observation(time.seconds());
        self.observe_told(system, now, &seen, control, tick, time)
    }

    /// As [`Run::observe`], with what is judged given.
    pub(crate) fn observe_told(
        &mut self,
        system: &System,
        now: &Instant<'_>,
        seen: &Observation,
        control: &Inputs,
        tick: Tick,
        time: SimTime,
    ) -> Result<(), Failure> {
        let t = time.seconds();
        self.monitor.observe(system.mechanism(), &now.state.mechanism, seen);
        self.account(system, now);
        let mut tell = |kind: &str, text: String, body: serde_json::Value| {
            self.events.push(Event::new(tick, time, kind, text, body));
        };
        // Contacts, pair by pair.
        let mut force = [None; PAIRS];
        for c in now.contacts() {
            let f: &mut Option<f64> = &mut force[c.pair];
            *f = Some(f.unwrap_or(0.0) + c.normal_w_n.length());
        }
        for (i, story) in self.pairs.iter_mut().enumerate() {
            match (force[i], story.since_s) {
                (Some(f), None) => {
                    *story = PairStory { since_s: Some(t), last_s: t, peak_n: f };
                    let pair = pair_name(system.mechanism(), i);
                    tell(
                        "contact_begin",
                        format!("t = {t:.3} s {pair} touch"),
                        json!({ "pair": pair, "force_n": f }),
                    );
                }
                (Some(f), Some(_)) => {
                    story.last_s = t;
                    story.peak_n = story.peak_n.max(f);
                }
                (None, Some(since)) if t - story.last_s > self.gap_s => {
                    let (last, peak) = (story.last_s, story.peak_n);
                    *story = PairStory::default();
                    let pair = pair_name(system.mechanism(), i);
                    tell(
                        "contact_end",
                        format!(
                            "t = {last:.3} s {pair} part after {:.3} s, peak {:.2} kN",
                            last - since,
                            peak * 1e-3
                        ),
                        json!({ "pair": pair, "since_s": since, "until_s": last, "peak_n": peak }),
                    );
                }
                _ => {}
            }
        }
        for (i, (seen, l)) in self.latches.iter_mut().zip(&now.state.mechanism.latches).enumerate()
        {
            if l.phase == *seen {
                continue;
            }
            let (kind, word) = match l.phase {
                LatchPhase::Free => ("latch_free", "is free again"),
                LatchPhase::Approach => ("latch_approach", "approaches its striker"),
                LatchPhase::Struck => ("latch_strike", "is struck"),
                LatchPhase::Latched => ("latched", "has caught"),
            };
            *seen = l.phase;
            tell(
                kind,
                format!("t = {t:.3} s latch {} {word}", i + 1),
                json!({ "latch": i + 1, "gap_m": now.measured.latches[i].axial_m }),
            );
        }
        if let (false, Some(at)) = (self.captured, now.state.mechanism.captured_s()) {
            self.captured = true;
            tell(
                "captured",
                format!("t = {at:.3} s all three latches hold: the rings are joined"),
                json!({ "capture_s": at }),
            );
        }
        let thrusting = [control.chaser, control.target].map(|w| w != Wrench::ZERO);
        for (i, name) in ["chaser", "target"].into_iter().enumerate() {
            if thrusting[i] != self.thrust[i] {
                self.thrust[i] = thrusting[i];
                let (kind, word) =
                    if thrusting[i] { ("thrust_on", "on") } else { ("thrust_off", "off") };
                tell(
                    kind,
                    format!("t = {t:.3} s thrust of the {name} {word}"),
                    json!({ "on": name }),
                );
            }
        }
        if let (false, Some(l)) = (self.limit_told, self.monitor.limit()) {
            self.limit_told = true;
            let t = l.time_s;
            tell(
                "limit",
                format!(
                    "t = {t:.3} s {} passed its limit of {:.4}: {:.4}",
                    l.name, l.limit, l.reached
                ),
                json!({ "limit": l.name, "value": l.limit, "reached": l.reached }),
            );
        }
        Ok(())
    }

    fn account(&mut self, system: &System, now: &Instant<'_>) {
        let e = &now.energy;
        let start = *self.energy_start.get_or_insert(e.kinetic + e.stored);
        self.energy_in = start + e.work_in.max(0.0);
        let balance = start + e.work_in - e.kinetic - e.stored - e.lost;
        self.energy_error = worst(self.energy_error, (balance / self.energy_in).abs());

        let p0 = *self.momentum_start.get_or_insert_with(|| {
            // Scale: linear and angular momentum of the chaser about the common mass centre, which
            // rests at the origin; at least one metre of lever where it comes straight on.
            let (c, m) = (&now.state.bodies[0], &system.mass()[0]);
            let p = c.v * m.mass();
            let l = (c.p.cross(p) + c.l).length();
            self.momentum_scale = (p.length(), l.max(p.length()));
            now.momentum
        });
        let (dp, dl) = (
            now.momentum.f - p0.f - now.state.impulse_in.f,
            now.momentum.m - p0.m - now.state.impulse_in.m,
        );
        let (sp, sl) = self.momentum_scale;
        self.momentum_error = worst(self.momentum_error, (dp.length() / sp).max(dl.length() / sl));
        if !now.measured.touching() && now.state.first_contact_s.is_some() {
            self.exit_speed = Some(now.relative.v.length());
        } else {
            self.exit_speed = None;
        }
    }

    pub(crate) fn summary(
        &self,
        asked: &Asked<'_>,
        state: &DockingState,
        judgement: &Judgement,
        ticks: u64,
        time: SimTime,
    ) -> Summary {
        let capture_s = state.mechanism.captured_s();
        let measured = Measured {
            outcome: match judgement.outcome {
                Judged::Captured => ExpectedOutcome::Captured,
                Judged::Rebounded => ExpectedOutcome::Rebounded,
                Judged::Missed => ExpectedOutcome::Missed,
                Judged::Jammed => ExpectedOutcome::Jammed,
                Judged::LimitExceeded => ExpectedOutcome::LimitExceeded,
            },
            first_contact_s: state.first_contact_s,
            capture_s,
            peak_force_n: state.peak_force_n,
            peak_moment_nm: state.peak_moment_nm,
            peak_penetration_m: state.peak_depth_m,
            impulse_ns: state.impulse_ns,
            exit_speed_m_s: if capture_s.is_some() { None } else { self.exit_speed },
        };
        let mut failures = asked.expect.failures(&measured);
        if self.energy_error > ENERGY_TOLERANCE {
            failures.push(format!(
                "the energy account does not close: off by {:.3} % of the energy put in",
                self.energy_error * 100.0
            ));
        }
        #[expect(clippy::cast_precision_loss, reason = "times far below 2^53 ns")]
        let us = |q: f64| self.histogram.value_at_quantile(q) as f64 * 1e-3;
        #[expect(clippy::cast_precision_loss, reason = "times far below 2^53 ns")]
        let max_us = self.histogram.max() as f64 * 1e-3;
        Summary {
            schema_version: SUMMARY_SCHEMA,
            tool_version: env!("CARGO_PKG_VERSION").to_owned(),
            scenario: asked.scenario.name.clone(),
            seed: asked.seed,
            state_digest: self.chain.finish().to_string(),
            outcome: match judgement.outcome {
                Judged::Captured => Outcome::Captured,
                Judged::Rebounded => Outcome::Rebounded,
                Judged::Missed => Outcome::Missed,
                Judged::Jammed => Outcome::Jammed,
                Judged::LimitExceeded => Outcome::LimitExceeded,
            },
            verdict: if failures.is_empty() { Verdict::Pass } else { Verdict::Fail },
            failure_reason: (!failures.is_empty()).then(|| {
                format!(
                    "{} [{}: {}]",
                    failures.join("; "),
                    judgement.outcome.name(),
                    judgement.reason
                )
            }),
            first_contact_s: state.first_contact_s,
            capture_s,
            latches_s: state.mechanism.latches.map(|l| l.times_s[2]).to_vec(),
            peak_force_n: state.peak_force_n,
            peak_moment_nm: state.peak_moment_nm,
            impulse_ns: state.impulse_ns,
            peak_penetration_m: state.peak_depth_m,
            energy_in_j: self.energy_in,
            energy_dissipated_j: state.mechanism.losses.total(),
            energy_balance_error: self.energy_error,
            momentum_error: self.momentum_error,
            duration_s: time.seconds(),
            ticks,
            wall_s: 0.0,
            realtime_factor: 0.0,
            step_us: StepUs {
                p50: us(0.5),
                p99: us(0.99),
                p999: us(0.999),
                max: max_us,
                n: self.steps,
            },
            loop_: None,
            fidelity: None,
            safety: None,
            recording: None,
        }
    }
}

pub(crate) fn print(s: &Summary, expect: &Expect, out: &Path) {
    let seconds = |t: Option<f64>| t.map_or("–".to_owned(), |t| format!("{t:.3} s"));
    println!("{}: {} ({})", s.scenario, s.outcome, s.verdict);
    if let Some(reason) = &s.failure_reason {
        println!("  because        {reason}");
    }
    println!("  expected       {}", expect.outcome);
    println!("  first contact  {}", seconds(s.first_contact_s));
    println!("  capture        {}", seconds(s.capture_s));
    let latches: Vec<String> = s.latches_s.iter().map(|t| seconds(*t)).collect();
    println!("  latches        {}", latches.join(", "));
    println!(
        "  peak force     {:.1} N, moment {:.1} N·m, depth {:.3} mm",
        s.peak_force_n,
        s.peak_moment_nm,
        s.peak_penetration_m * 1e3
    );
    println!("  impulse        {:.2} N·s", s.impulse_ns);
    println!(
        "  energy         {:.3} J in, {:.3} J dissipated, account off by {:.1e}",
        s.energy_in_j, s.energy_dissipated_j, s.energy_balance_error
    );
    println!("  momentum       off by {:.1e}", s.momentum_error);
    println!(
        "  time           {:.1} s simulated in {:.2} s: {:.0} × real time",
        s.duration_s, s.wall_s, s.realtime_factor
    );
    println!(
        "  step           p50 {:.1} µs, p99 {:.1} µs, p99.9 {:.1} µs, max {:.1} µs, n {}",
        s.step_us.p50, s.step_us.p99, s.step_us.p999, s.step_us.max, s.step_us.n
    );
    println!("  state digest   {}", s.state_digest);
    println!("  written to     {}", out.display());
}
