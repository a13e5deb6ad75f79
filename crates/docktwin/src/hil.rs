//! `hil`: the loop against a rig, in virtual or in real time.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    process::ExitCode,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::sync_channel,
    },
    time::{Duration, Instant as WallInstant},
};

use docktwin::{
    fidelity::{self, Trace},
    pilot::Stick,
    playback::{self, Playback},
    rigfile::{CalibrationFile, IdentificationFile, Origin, Read},
    ring::Ring,
    setup::{inputs_after, start, thrust_ahead},
    signals::{contact_rows, row},
    telemetry::{CONTACT_N, Watcher, hil_columns, loop_row},
};
use docktwin_control::{
    rig::RigSetup,
    safety::{SafetyLimits, Trip, half_widths},
    sensing::SensorScheme,
};
use docktwin_core::{Digest, Pose, SimTime, Tick};
use docktwin_hil::{
    calibrate::Calibration,
    clock::{Clock, OverrunPolicy, RealtimeClock, VirtualClock},
    emulated::{EmulatedRig, clear},
    identify::Identification,
    realtime::relax,
    scheduler::{
        Approach, ArmError, Check, Idle, Loop, LoopSetup, LoopTimes, Phase, RigParameters, Running,
        Stopped, TickRecord,
    },
};
use docktwin_model::{HydraulicPreset, Rig as RigModel, load_rig};
use docktwin_physics::{
    body::BodyState,
    contact::PAIRS,
    mechanism::{System, pair_name},
    programme::Programme,
    reduced::Inputs,
};
use docktwin_record::{
    Event, LatenessUs, LoopSummary, Outcome, PhaseUs, Policy, RunWriter, SafetySummary, StepUs,
    Summary, Verdict,
};
use docktwin_rigport::{in_process::InProcess, rig::Rig};
use docktwin_scenario::{
    CompensatorChoice, ExpectedOutcome, Scenario, Thrust, load_scenario, resolve_path,
};
use docktwin_view::SceneWriter;
use serde_json::json;

use crate::{
    cli::{ClockArg, HilArgs},
    commands::{new_directory, overrides},
    company::{Company, Flight, pilot_line},
    failure::{Failure, OTHERWISE, STOPPED},
    models::ModelCopies,
    rehearse::{Asked, Run, digest_keys, print, progress},
    rigs::{self, PERIOD_NS, RigPlace, best_effort, confirm, connect, new_session},
};

/// Rig when neither scenario nor command line names one.
const DEFAULT_RIG: &str = "models/urdf/stewart.urdf";
/// Folder of a run directory that holds its rig.
const RIG_FOLDER: &str = "models/rig";
/// Age at which an identification or a calibration is no longer believed, days.
const MOST_DAYS: f64 = 30.0;
/// Fastest of the first move, m/s and rad/s.
const MOVE_M_S: f64 = 0.1;
const MOVE_RAD_S: f64 = 0.05;
/// Rest before the run-up, s.
const SETTLE_S: f64 = 0.6;
/// Longest way of the run-up along the docking axis, m, and the times it may take, s.
const RUN_UP_M: f64 = 0.1;
const RUN_UP_S: [f64; 2] = [0.2, 4.0];
/// Ticks between the loop and what looks at them, in real time: two seconds.
const RING_TICKS: usize = 2048;
/// Ticks between two lines to a pilot.
const PILOT_LINE_TICKS: u64 = 100;

/// Runs the command.
pub(crate) fn run(args: &HilArgs, json: bool) -> Result<ExitCode, Failure> {
    let scenario = load_scenario(&args.scenario, &overrides(&args.set)?)?;
    if !json {
        scenario.notes.iter().for_each(|n| eprintln!("ignored {n}"));
    }
    let prepared = Prepared::new(args, &scenario)?;
    let out = args.out.clone().unwrap_or_else(|| new_directory("runs", &scenario.name));
    let summary = prepared.go(args, &out, json)?;
    if json {
        // A summary always serialises; a defect would show as an empty object.
        println!("{}", serde_json::to_value(&summary).unwrap_or_default());
    } else {
        tell(&summary, &scenario, &out);
        let (what, word) =
            if repeats(args) { ("Replay it", "replay") } else { ("Read about it", "report") };
        println!("{what} with: docktwin {word} {}", out.display());
    }
    Ok(ExitCode::from(match (summary.verdict, summary.outcome) {
        (Verdict::Pass, _) => 0,
        (_, Outcome::Stopped) => STOPPED,
        _ => OTHERWISE,
    }))
}

/// Everything that is known before a rig moves.
struct Prepared<'a> {
    scenario: &'a Scenario,
    rig_path: PathBuf,
    rig: RigModel,
    preset: HydraulicPreset,
    system: System,
    bodies: [BodyState; 3],
    setup: LoopSetup,
    known: Known,
}

/// What was found out about this rig beforehand.
struct Known {
    identification: Option<(Read<IdentificationFile>, Identification)>,
    calibration: Option<(Read<CalibrationFile>, Calibration)>,
}

impl Known {
    fn read(args: &HilArgs, rig: &RigModel) -> Result<Self, Failure> {
        let [i, c] = [&args.identification, &args.calibration].map(Option::as_deref);
        Ok(Self {
            identification: i.map(|path| rigs::identification(path, rig)).transpose()?,
            calibration: c.map(|path| rigs::calibration(path, rig)).transpose()?,
        })
    }

    /// What is believed of the rig by its file and by these.
    fn parameters(&self, rig: &RigModel) -> RigParameters {
        let identification = self.identification.as_ref().map(|i| &i.1);
        RigParameters::new(rig, identification, self.calibration.as_ref().map(|c| &c.1))
    }

    /// One line for the checklist, and the digest for the record.
    fn lines(&self) -> [(&'static str, Option<(f64, String)>); 2] {
        let of = |origin: &Origin, digest: &Digest| (origin.age_days(), digest.to_string());
        let i = self.identification.as_ref().map(|i| of(&i.0.content.origin, &i.0.digest));
        let c = self.calibration.as_ref().map(|c| of(&c.0.content.origin, &c.0.digest));
        [("identification", i), ("calibration", c)]
    }
}

impl<'a> Prepared<'a> {
    fn new(args: &HilArgs, scenario: &'a Scenario) -> Result<Self, Failure> {
        let rig_path = rig_path(args, scenario)?;
        let rig = load_rig(&rig_path)?.model;
        let hil = &scenario.hil;
        let preset = hil.preset.unwrap_or(rig.hydraulics.default_preset);
        let (system, bodies) = start(scenario)?;
        #[expect(clippy::cast_precision_loss, reason = "a tick is far below 2^53 ns")]
        let tick_s = scenario.run.tick_nanos as f64 * 1e-9;
        if scenario.run.tick_nanos != PERIOD_NS {
            return Err(Failure::Usage {
                what: format!("the loop runs at 1 kHz, the scenario has ticks of {tick_s} s"),
                remedy: "leave run.tick_s at 0.001 for `hil`".to_owned(),
            });
        }
        let programme = Programme::new(&system, &bodies, tick_s);
        let believed = RigSetup::of_rig(&rig, preset, None);
        if rig.sensors.is_none() {
            return Err(Failure::Usage {
                what: format!("the rig has no table [sensors]: {}", rig_path.display()),
                remedy: "add one; models/urdf/stewart.toml is an example".to_owned(),
            });
        }
        let run_up_s = run_up_s(&system, &bodies, &programme);
        for (what, time_s) in [("initial condition", 0.0), ("run-up", -0.5 * run_up_s)] {
            within_reach(&rig, &believed, &programme.free(time_s).x_34, what)?;
        }
        let known = Known::read(args, &rig)?;
        let parameters = known.parameters(&rig);
        let asked_s = args.lead_s.or(args.lead_ms.map(|ms| ms * 1e-3)).or(hil.lead_s);
        let choice = args.compensator.or(hil.compensator).unwrap_or(CompensatorChoice::Lead);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 30")]
        let added_ticks = (hil.added_delay_s / tick_s).round() as usize;
        let setup = LoopSetup::builder(&rig, preset, &system, &bodies)
            .parameters(parameters)
            .compensation(rigs::compensation(choice, asked_s.unwrap_or(parameters.lead_s))?)
            .added_ticks(added_ticks)
            .sensors(if hil.two_sensors { SensorScheme::Two } else { SensorScheme::Single })
            .loads(hil.force_limit_n, hil.moment_limit_nm)
            .approach(Approach {
                speed_m_s: MOVE_M_S,
                rate_rad_s: MOVE_RAD_S,
                settle_s: SETTLE_S,
                run_up_s,
            })
            .ticks(scenario.run.ticks())
            .session(session(args))
            .dry_run(args.dry_run)
            .build()
            .map_err(|e| Failure::Usage {
                what: e.to_string(),
                remedy: "correct the scenario or the option that gives it".to_owned(),
            })?;
        Ok(Self { scenario, rig_path, rig, preset, system, bodies, setup, known })
    }

    fn go(self, args: &HilArgs, out: &Path, json: bool) -> Result<Summary, Failure> {
        match &args.rig {
            RigPlace::Emulated => {
                let rig = self.emulated(args)?;
                self.with_rig(rig, args, out, json)
            }
            RigPlace::Port(name) => self.with_rig(connect(name)?, args, out, json),
        }
    }

    fn with_rig<R: Rig>(
        self,
        rig: R,
        args: &HilArgs,
        out: &Path,
        json: bool,
    ) -> Result<Summary, Failure> {
        match args.led.clock {
            ClockArg::Virtual => {
                self.with_clock(rig, VirtualClock::new(PERIOD_NS), args, out, json)
            }
            ClockArg::Realtime => {
                let clock = RealtimeClock::new(PERIOD_NS, OverrunPolicy::Skip);
                self.with_clock(rig, clock, args, out, json)
            }
        }
    }

    fn emulated(&self, args: &HilArgs) -> Result<InProcess<EmulatedRig>, Failure> {
        let rest = clear(&self.rig, &self.system);
        EmulatedRig::new(
            &self.rig,
            self.preset,
            args.perturb,
            args.seed,
            self.system.clone(),
            &rest,
        )
        .map(InProcess::new)
        .map_err(|e| Failure::Usage {
            what: e.to_string(),
            remedy: format!("mend {}", self.rig_path.display()),
        })
    }

    /// Copies the rig's files into the run directory; gives the name of the URDF there.
    fn keep_rig(&self, writer: &RunWriter) -> Result<String, Failure> {
        let stem = self.rig_path.file_stem().unwrap_or_default();
        let mut name = Path::new(RIG_FOLDER).join(stem);
        for kind in ["toml", "urdf"] {
            let from = self.rig_path.with_extension(kind);
            let bytes = std::fs::read(&from).map_err(|e| Failure::Usage {
                what: format!("the rig cannot be kept with the run: {e}: {}", from.display()),
                remedy: "run it again when nothing else writes the file".to_owned(),
            })?;
            name.set_extension(kind);
            writer.keep_file(&name, &bytes)?;
        }
        let files = [
            ("identification", self.known.identification.as_ref().map(|i| &i.0.path)),
            ("calibration", self.known.calibration.as_ref().map(|c| &c.0.path)),
        ];
        for (what, path) in files {
            let Some(path) = path else { continue };
            let bytes = std::fs::read(path).map_err(|e| Failure::Usage {
                what: format!("the {what} cannot be kept with the run: {e}: {}", path.display()),
                remedy: "run it again when nothing else writes the file".to_owned(),
            })?;
            writer.keep_file(&kept_name(what), &bytes)?;
        }
        Ok(name.to_string_lossy().replace('\\', "/"))
    }

    fn checks(&self, args: &HilArgs) -> Result<Vec<Check>, Failure> {
        let mut out = vec![Check {
            name: "limits",
            passed: true,
            found: format!(
                "loaded from {}: {:.0} N, {:.0} N·m at the ports",
                self.rig_path.display(),
                self.setup.limits.port_force_n,
                self.setup.limits.port_moment_nm
            ),
        }];
        for (name, known) in self.known.lines() {
            out.push(match known {
                None => Check {
                    name,
                    passed: true,
                    found: "none: the rig's file is believed".to_owned(),
                },
                Some((days, digest)) => Check {
                    name,
                    passed: days < MOST_DAYS,
                    found: if days < MOST_DAYS {
                        format!("{days:.1} days old, {}", &digest[..12])
                    } else {
                        format!(
                            "{days:.0} days old: make it again, at most {MOST_DAYS:.0} days count"
                        )
                    },
                },
            });
        }
        confirm(&args.rig, args.led.yes)?;
        out.push(Check {
            name: "operator",
            passed: true,
            found: if args.rig == RigPlace::Emulated {
                "not asked: nothing but an emulation moves".to_owned()
            } else {
                "confirmed: emergency stop tested, nobody near the rig".to_owned()
            },
        });
        Ok(out)
    }

    fn metadata(&self, args: &HilArgs) -> BTreeMap<String, String> {
        let compensation = &self.setup.compensation;
        let mut m: BTreeMap<String, String> = [
            ("tool", "docktwin".to_owned()),
            ("tool_version", env!("CARGO_PKG_VERSION").to_owned()),
            ("command", "hil".to_owned()),
            ("scenario", self.scenario.name.clone()),
            ("seed", args.seed.to_string()),
            ("rig", args.rig.to_string()),
            ("clock", args.led.clock.name().to_owned()),
            ("compensator", compensation.name().to_owned()),
            ("lead_s", compensation.lead_s().to_string()),
            ("preset", self.preset.word().to_owned()),
            ("perturb", args.perturb.map_or("none".to_owned(), |s| s.to_string())),
            ("tick_nanos", self.scenario.run.tick_nanos.to_string()),
            ("digest:rig", self.rig.digest.to_string()),
            ("started_unix_ns", jiff::Timestamp::now().as_nanosecond().to_string()),
        ]
        .into_iter()
        .map(|(k, v)| (k.to_owned(), v))
        .collect();
        for (name, known) in self.known.lines() {
            if let Some((_, digest)) = known {
                m.insert(format!("digest:{name}"), digest);
            }
        }
        for (key, f) in digest_keys(&self.scenario.files) {
            m.insert(key, f.digest.to_string());
        }
        m
    }

    fn with_clock<R: Rig, K: Clock>(
        mut self,
        rig: R,
        clock: K,
        args: &HilArgs,
        out: &Path,
        json: bool,
    ) -> Result<Summary, Failure> {
        let checks = self.checks(args)?;
        self.setup.patience = rigs::patience::<K>();
        let company = Company::invite(&args.live, &args.pilot, self.scenario, &hil_columns())?;
        let hand = Hand::new(self.scenario, company.stick());
        let bar = progress(self.setup.ticks, json || hand.stick.is_some());
        let mut recorder = Recorder::new(&self, args, out, company, !K::LOCKSTEP, !json)?;
        let wall = WallInstant::now();
        let idle = Loop::new(self.setup, rig, clock);
        let (ended, lacking) = if K::LOCKSTEP {
            (in_virtual_time(idle, checks, hand, &mut recorder, &bar)?, None)
        } else {
            in_real_time(idle, checks, hand, &mut recorder, args)?
        };
        bar.finish_and_clear();
        recorder.company.land();
        recorder.finish(args, &ended, lacking, wall.elapsed(), json)
    }
}

/// Where a run directory keeps the file of `rig identify` or `rig calibrate`.
fn kept_name(what: &str) -> PathBuf {
    Path::new(RIG_FOLDER).join(format!("{what}.toml"))
}

/// The scenario with its rig named.
fn with_rig(scenario: &str, rig: &str) -> String {
    let Ok(mut text) = scenario.parse::<toml_edit::DocumentMut>() else {
        return scenario.to_owned();
    };
    let table = text.entry("loop").or_insert(toml_edit::table());
    table["rig"] = toml_edit::value(rig);
    text.to_string()
}

fn rig_path(args: &HilArgs, scenario: &Scenario) -> Result<PathBuf, Failure> {
    if let Some(path) = &args.model {
        return Ok(path.with_extension("urdf"));
    }
    let named = scenario.hil.rig.as_deref().unwrap_or(DEFAULT_RIG);
    let from = scenario.files.first().map_or(Path::new("."), |f| &f.path);
    resolve_path(from, Path::new(named)).ok_or_else(|| Failure::Usage {
        what: format!(
            "the rig is found neither beside the scenario nor in any folder above it: {named}"
        ),
        remedy: "name it with --model RIG.toml, or as loop.rig in the scenario".to_owned(),
    })
}

/// In real time, and against a rig in another process, no run repeats bit by bit.
fn repeats(args: &HilArgs) -> bool {
    (args.led.clock, &args.rig) == (ClockArg::Virtual, &RigPlace::Emulated)
}

/// A number for this run: the same one where it is to repeat.
fn session(args: &HilArgs) -> u64 {
    if repeats(args) { 1 } else { new_session() }
}

/// The longest run-up that stays clear of the other side.
fn run_up_s(system: &System, bodies: &[BodyState; 3], programme: &Programme) -> f64 {
    let speed = programme.free(0.0).twist.v.length().max(1e-3);
    let [shortest, longest] = RUN_UP_S;
    let mut time = (2.0 * RUN_UP_M / speed).clamp(shortest, longest);
    let free = |time: f64| {
        (0..=50).all(|i| {
            let mut back = *bodies;
            for (b, m) in back.iter_mut().zip(system.mass()) {
                b.drift(m, -0.5 * time * f64::from(i) / 50.0);
            }
            system.follow(&mut back);
            !system.touches(&system.poses(&back.map(|b| b.pose())))
        })
    };
    while time > shortest && !free(time) {
        time *= 0.8;
    }
    time.max(shortest)
}

/// The rig can show this pose with room to spare.
fn within_reach(
    rig: &RigModel,
    believed: &RigSetup,
    x_34: &Pose,
    what: &str,
) -> Result<(), Failure> {
    let c = believed.believed_platform.at(&rig.plate_from_docking(x_34));
    let margins = believed.believed_platform.stroke_margins_m(&c.length_m);
    let least = margins.iter().copied().fold(f64::INFINITY, f64::min);
    let limits = SafetyLimits::of_rig(rig, 0.0, 0.0);
    let (far, most) = (half_widths(rig, x_34), limits.pose_half_widths);
    if least > limits.stroke_margin_m && far < most {
        return Ok(());
    }
    let p = x_34.p;
    Err(Failure::Usage {
        what: format!(
            "the rig cannot show the {what}, X_34 at ({:.2}, {:.2}, {:.2}) m: {far:.2} half-widths of \
             the docking workspace from its middle (most {most}), {least:.2} m of stroke left",
            p.x, p.y, p.z
        ),
        remedy: "give a smaller initial.gap_m or other initial conditions; \
                 `docktwin analyze workspace RIG.toml` tells what the rig reaches"
            .to_owned(),
    })
}

/// What moves the spacecraft besides the mechanism: the scenario's thrusts and a pilot's.
struct Hand {
    thrusts: Vec<Thrust>,
    stick: Option<Stick>,
    first_contact_s: Option<f64>,
    captured_s: Option<f64>,
}

impl Hand {
    fn new(scenario: &Scenario, stick: Option<Stick>) -> Self {
        let thrusts = scenario.thrusts.clone();
        Self { thrusts, stick, first_contact_s: None, captured_s: None }
    }

    /// Control wrenches of the tick `k` of the closed loop.
    fn inputs(&self, time_s: f64) -> Inputs {
        let mut out = inputs_after(&self.thrusts, self.first_contact_s, self.captured_s, time_s);
        if let Some(stick) = &self.stick {
            out.chaser += stick.wrench();
        }
        out
    }

    fn look(&mut self, r: &TickRecord) {
        let Some(k) = r.closed_tick else { return };
        let time_s = seconds(k);
        if r.ports.port4.f.length() > CONTACT_N {
            self.first_contact_s.get_or_insert(time_s);
        }
        if r.measurement.is_joined() == Some(true) {
            self.captured_s.get_or_insert(time_s);
        }
    }

    fn ended(&self) -> bool {
        self.stick.as_ref().is_some_and(Stick::ended)
    }
}

/// What of a recorded tick a replay needs.
#[derive(Clone, Copy)]
pub(crate) struct RecordedTick {
    /// Control wrenches.
    pub(crate) control: Inputs,
    /// [`Phase`] as a number.
    pub(crate) phase: u64,
    /// Of the tick.
    pub(crate) digest: u64,
}

/// Runs a recorded loop again: the recorded control wrenches, the same emulated rig, a virtual clock.
/// `recorded` gives the recorded ticks in their order; the first that differs is told as its number
/// and both digests.
///
/// # Errors
/// A run that does not repeat: in real time, or against a rig in another process.
pub(crate) fn replay(
    run: &Path,
    metadata: &BTreeMap<String, String>,
    mut recorded: impl FnMut() -> Result<Option<RecordedTick>, Failure>,
) -> Result<Option<(u64, u64, u64)>, Failure> {
    let of = |key: &str| metadata.get(key).map_or("", String::as_str);
    if !docktwin_record::repeats(metadata) {
        return Err(Failure::Usage {
            what: format!(
                "a run against `{}` with the {} clock does not repeat bit by bit: {}",
                of("rig"),
                of("clock"),
                run.display()
            ),
            remedy: "replay runs with --rig emulated and the virtual clock; `diff` compares others"
                .to_owned(),
        });
    }
    let damaged = |what: String| Failure::Usage {
        what: format!("{what}: {}", run.display()),
        remedy: "run.mcap and the models are not of one run, or damaged; use another copy"
            .to_owned(),
    };
    let words = CompensatorChoice::WORDS;
    let kept = |name: &str| {
        metadata.contains_key(&format!("digest:{name}")).then(|| run.join(kept_name(name)))
    };
    let args = HilArgs {
        compensator: words.into_iter().find(|(w, _)| *w == of("compensator")).map(|(_, c)| c),
        lead_s: of("lead_s").parse().ok(),
        seed: of("seed").parse().map_err(|_| damaged("no seed".to_owned()))?,
        perturb: of("perturb").parse().ok(),
        identification: kept("identification"),
        calibration: kept("calibration"),
        ..HilArgs::again(run.join("scenario.toml"))
    };
    let scenario = load_scenario(&args.scenario, &[])?;
    let prepared = Prepared::new(&args, &scenario)?;
    if of("digest:rig") != prepared.rig.digest.to_string() || of("preset") != prepared.preset.word()
    {
        return Err(damaged("the rig is not the one of the recording".to_owned()));
    }
    let rig = prepared.emulated(&args)?;
    let checks = prepared.checks(&args)?;
    let mut running = Loop::new(prepared.setup.clone(), rig, VirtualClock::new(PERIOD_NS))
        .arm(checks)
        .map_err(|e| damaged(e.to_string()))?
        .start();
    let mut next = recorded()?;
    let mut tick = 0;
    while let Some(then) = next {
        if then.phase == Phase::Stop as u64 && running.phase() == Phase::Closed {
            running.end();
        }
        let r = running.tick(&then.control).map_err(|e| damaged(e.to_string()))?;
        // The way to the initial condition is not recorded.
        if r.closed_tick.is_none() && tick == 0 {
            continue;
        }
        let now = r.digest().short();
        if now != then.digest {
            return Ok(Some((tick, then.digest, now)));
        }
        tick += 1;
        next = recorded()?;
    }
    Ok(None)
}

/// Time of a tick of the closed loop, s.
fn seconds(closed_tick: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "exact below 2^53 ticks")]
    let s = closed_tick as f64 * 1e-3;
    s
}

/// What is left of a loop.
struct Ended {
    end: Stopped,
    times: LoopTimes,
    late: u64,
    missed: u64,
    broken: Option<String>,
    dropped: u64,
}

/// Tick after tick until the rig is at rest. `take` gets every tick and says whether the run is to end.
fn keep_time<R: Rig, K: Clock>(
    mut running: Loop<R, K, Running>,
    mut hand: Hand,
    mut pace: Option<RealtimeClock>,
    mut take: impl FnMut(TickRecord) -> bool,
) -> Ended {
    let mut broken = None;
    let mut closed = 0;
    while !running.finished() {
        let control = if running.phase() == Phase::Closed {
            hand.inputs(seconds(closed))
        } else {
            Inputs::default()
        };
        if let Some(pace) = &mut pace {
            pace.wait();
        }
        match running.tick(&control) {
            Ok(r) => {
                hand.look(&r);
                closed = r.closed_tick.map_or(closed, |k| k + 1);
                if take(r) || hand.ended() {
                    running.end();
                }
            }
            Err(e) => {
                broken = Some(e.to_string());
                break;
            }
        }
    }
    let counts = running.clock_counts();
    let times = running.times().clone();
    let end = running.stop().into_end();
    Ended { end, times, late: counts.overruns, missed: counts.missed, broken, dropped: 0 }
}

/// Loop, recording and rig take turns.
fn in_virtual_time<R: Rig, K: Clock>(
    idle: Loop<R, K, Idle>,
    checks: Vec<Check>,
    hand: Hand,
    recorder: &mut Recorder<'_>,
    bar: &indicatif::ProgressBar,
) -> Result<Ended, Failure> {
    let armed = idle.arm(checks).map_err(not_armed)?;
    if recorder.told {
        tell_checks(armed.checks());
    }
    // A pilot wants to see what happens as it does; the ticks are those of the virtual clock.
    let mut pace =
        hand.stick.is_some().then(|| RealtimeClock::new(PERIOD_NS, OverrunPolicy::CatchUp));
    if let Some(pace) = &mut pace {
        pace.start();
    }
    Ok(keep_time(armed.start(), hand, pace, |r| {
        if let Some(k) = r.closed_tick.filter(|k| k.is_multiple_of(100)) {
            bar.set_position(k);
        }
        recorder.take(&r)
    }))
}

fn not_armed(e: ArmError) -> Failure {
    Failure::Usage {
        what: e.to_string(),
        remedy: "mend what failed and arm again; nothing has moved".to_owned(),
    }
}

fn tell_checks(checks: &[Check]) {
    for c in checks {
        eprintln!("{} {:14} {}", if c.passed { "ok  " } else { "FAIL" }, c.name, c.found);
    }
}

/// The loop in this thread, with what the machine grants, from arming on; another one looks at the
/// ticks. Between arming and the first tick nothing is done that could take long: the rig waits.
fn in_real_time<R: Rig, K: Clock>(
    idle: Loop<R, K, Idle>,
    checks: Vec<Check>,
    hand: Hand,
    recorder: &mut Recorder<'_>,
    args: &HilArgs,
) -> Result<(Ended, Option<String>), Failure> {
    let ring: Arc<Ring<Option<TickRecord>>> = Arc::new(Ring::new(RING_TICKS, || None));
    let stop = Arc::new(AtomicBool::new(false));
    let (passed, to_tell) = sync_channel::<Vec<Check>>(1);
    let looker = {
        let (ring, stop) = (Arc::clone(&ring), Arc::clone(&stop));
        move |recorder: &mut Recorder<'_>| {
            if let (Ok(checks), true) = (to_tell.recv(), recorder.told) {
                tell_checks(&checks);
            }
            loop {
                let closed = ring.is_closed();
                match ring.read(|r| *r) {
                    Some(Some(r)) => {
                        if recorder.take(&r) {
                            stop.store(true, Ordering::Relaxed);
                        }
                    }
                    Some(None) => {}
                    None if closed => return,
                    None => std::thread::sleep(Duration::from_millis(2)),
                }
            }
        }
    };
    std::thread::scope(|scope| {
        // Before the priority is taken: threads started later would share the core.
        let looking = scope.spawn(move || looker(recorder));
        let out = args.led.realtime.apply().and_then(|granted| {
            let armed = idle.arm(checks).map_err(not_armed)?;
            let checks = armed.checks().to_vec();
            let running = armed.start();
            // Never full: it is sent once.
            let _ = passed.try_send(checks);
            let mut dropped = 0;
            let ended = keep_time(running, hand, None, |r| {
                dropped += u64::from(!ring.write(|slot| *slot = Some(r)));
                stop.load(Ordering::Relaxed)
            });
            Ok((Ended { dropped, ..ended }, best_effort(&granted)))
        });
        relax();
        drop(passed);
        ring.close();
        let _ = looking.join();
        out
    })
}

/// Looks at every tick of the closed loop: events, log, viewer, and what is compared afterwards.
struct Recorder<'a> {
    scenario: &'a Scenario,
    system: System,
    bodies: [BodyState; 3],
    timed: bool,
    writer: Option<RunWriter>,
    view: Option<(SceneWriter, Playback)>,
    company: Company,
    /// Whether anything is told beside the result.
    told: bool,
    /// Tick at which the pilot gets the next line, if there is a pilot who is told anything.
    line_due: Option<u64>,
    run: Run,
    watcher: Watcher,
    traces: Vec<Trace>,
    controls: Vec<Inputs>,
    ticks: u64,
    trip: Option<Trip>,
    phase: Option<Phase>,
    missed_told: u64,
    lost: Option<Failure>,
}

impl<'a> Recorder<'a> {
    fn new(
        prepared: &Prepared<'a>,
        args: &HilArgs,
        out: &Path,
        company: Company,
        timed: bool,
        told: bool,
    ) -> Result<Self, Failure> {
        let scenario = prepared.scenario;
        let names: Vec<String> = (0..PAIRS).map(|i| pair_name(&scenario.mechanism, i)).collect();
        let models = ModelCopies::read(scenario)?;
        let policy = if timed { Policy::DropNewest } else { Policy::Wait };
        let writer =
            RunWriter::create(out, hil_columns(), names, &prepared.metadata(args), policy)?;
        models.write(&writer)?;
        let rig = prepared.keep_rig(&writer)?;
        writer.scenario_toml(&with_rig(&models.refer(&scenario.as_run_toml()), &rig))?;
        let view = if args.no_rrd {
            None
        } else {
            let names = playback::pair_names(scenario);
            let model = playback::scene_model(scenario);
            let writer = SceneWriter::create(&out.join("run.rrd"), &model, &names)?;
            Some((writer, Playback::new(scenario, &hil_columns())?))
        };
        Ok(Self {
            scenario,
            system: prepared.system.clone(),
            bodies: prepared.bodies,
            timed,
            writer: Some(writer),
            view,
            line_due: company.stick().filter(|_| told).map(|_| 0),
            company,
            told,
            run: Run::new(),
            watcher: Watcher::new(prepared.bodies),
            traces: Vec::new(),
            controls: Vec::new(),
            ticks: 0,
            trip: None,
            phase: None,
            missed_told: 0,
            lost: None,
        })
    }

    /// Takes a tick in; true when the run is to end.
    fn take(&mut self, r: &TickRecord) -> bool {
        if self.line_due.is_some_and(|due| r.tick >= due) {
            self.line_due = Some(r.tick + PILOT_LINE_TICKS);
            let flight = Flight {
                x_34: &r.motion.x_34,
                closing_m_s: -r.motion.twist.v.x,
                contact_n: r.ports.port4.f.length(),
                control: &r.control.chaser,
            };
            pilot_line(format_args!("{:8}", r.phase.name()), &flight);
        }
        let time = SimTime::of_tick(Tick(self.ticks), self.scenario.run.tick_nanos);
        let t = time.seconds();
        let mut told = Vec::new();
        if self.phase != Some(r.phase) {
            self.phase = Some(r.phase);
            told.push(Event::new(
                Tick(self.ticks),
                time,
                "phase",
                format!("t = {t:.3} s {}", r.phase.name()),
                json!({ "phase": r.phase.name() }),
            ));
        }
        if let (None, Some(trip)) = (self.trip, r.trip) {
            self.trip = Some(trip);
            told.push(Event::new(
                Tick(self.ticks),
                time,
                "safety_stop",
                format!(
                    "t = {t:.3} s the supervisor stops the rig: {} {:.4}, allowed {:.4}",
                    trip.limit.name(),
                    trip.value,
                    trip.allowed
                ),
                json!({ "limit": trip.limit.name(), "value": trip.value, "allowed": trip.allowed }),
            ));
        }
        if r.missed > 0 {
            self.missed_told += r.missed;
            told.push(Event::new(
                Tick(self.ticks),
                time,
                "missed_ticks",
                format!(
                    "t = {t:.3} s {} ticks left out: woken {:.3} ms late",
                    r.missed,
                    to_ms(r.lateness_ns)
                ),
                json!({ "missed": r.missed, "lateness_ms": to_ms(r.lateness_ns) }),
            ));
        }
        if r.closed_tick.is_none() && !(r.phase == Phase::Stop && self.ticks > 0) {
            self.tell(told, time);
            return false;
        }
        let tick_s = 1e-3;
        let shown = self.watcher.take(&self.system, r, t, tick_s);
        let now = self.watcher.instant(&self.system, &shown, r, t, tick_s);
        if r.closed_tick.is_some() {
            self.traces.push(fidelity::trace(&self.system, r));
            self.controls.push(r.control);
            let mut seen = now.observation(t);
            seen.interface = r.ports.port4.shifted(self.system.passive_ring().p);
            let told = self.run.observe_told(
                &self.system,
                &now,
                &seen,
                &r.control,
                Tick(self.ticks),
                time,
            );
            if let Err(e) = told {
                self.lost.get_or_insert(e);
            }
        }
        let digest = r.digest();
        if r.closed_tick.is_some() {
            self.run.chain(digest);
        }
        row(&now, &self.system, &r.control, digest.short(), &mut self.run.row);
        let [x_13, x_24] = self.system.ports();
        let x_34 = (r.bodies[0].pose() * x_13).inverse() * r.bodies[1].pose() * x_24;
        loop_row(r, &x_34, self.timed, &mut self.run.row);
        contact_rows(&now, &mut self.run.contacts);
        told.append(&mut self.run.events);
        let due = !told.is_empty() || core::mem::take(&mut self.run.frame_due);
        self.tell(told, time);
        if let (Some(w), None) = (&mut self.writer, &self.lost) {
            let written = w.tick(Tick(self.ticks), time, &self.run.row, &self.run.contacts);
            self.lost = written.err().map(Failure::from);
        }
        if let Some((v, playback)) = &mut self.view
            && let Err(e) = playback.show(v, time, &self.run.row, &self.run.contacts, due)
        {
            self.lost.get_or_insert(e.into());
            self.view = None;
        }
        if let Some(l) = self.company.live() {
            l.tick(time, &self.run.row, &self.run.contacts, due);
        }
        self.ticks += 1;
        if r.closed_tick.is_none() {
            return false;
        }
        // Parted spacecraft leave the rig's workspace: there is nothing more to be learnt.
        let state = self.watcher.state();
        let parted = state.mechanism.captured_s().is_none();
        let ahead = thrust_ahead(&self.scenario.thrusts, state, t);
        self.run.monitor.limit().is_some()
            || ((self.scenario.run.stop_when_decided || parted)
                && self.run.monitor.decided(t, ahead))
    }

    fn tell(&mut self, events: Vec<Event>, time: SimTime) {
        for e in events {
            if let (Some(w), None) = (&mut self.writer, &self.lost) {
                self.lost = w.event(&e).err().map(Failure::from);
            }
            if let Some((v, _)) = &mut self.view
                && let Err(e) = v.event(time, &e.kind, &e.text)
            {
                self.lost.get_or_insert(e.into());
            }
            if let Some(l) = self.company.live() {
                l.events().event(time, &e.kind, &e.text);
            }
        }
    }

    fn finish(
        mut self,
        args: &HilArgs,
        ended: &Ended,
        lacking: Option<String>,
        wall: Duration,
        json: bool,
    ) -> Result<Summary, Failure> {
        let scenario = self.scenario;
        let last = self.ticks.saturating_sub(1);
        let time = SimTime::of_tick(Tick(last), scenario.run.tick_nanos);
        let judgement = self.run.monitor.judge(time.seconds());
        let expect = scenario.expect.of_hil();
        let state = self.watcher.state().clone();
        let mut summary = self.run.summary(
            &Asked { scenario, expect: &expect, seed: args.seed },
            &state,
            &judgement,
            last,
            time,
        );
        let stopped = ended.end.trip.is_some() || ended.broken.is_some();
        if args.dry_run {
            // There and back: whatever the scenario expects, nothing was to happen.
            summary.verdict = if stopped { Verdict::Fail } else { Verdict::Pass };
            summary.failure_reason = None;
        } else if stopped {
            summary.outcome = Outcome::Stopped;
            let expected = expect.outcome == ExpectedOutcome::Stopped;
            summary.verdict = if expected { Verdict::Pass } else { Verdict::Fail };
            summary.failure_reason = None;
        }
        if let Some(trip) = ended.end.trip.filter(|_| summary.verdict == Verdict::Fail) {
            summary.failure_reason = Some(format!(
                "the supervisor stopped the rig in tick {}: {} was {:.4}, allowed {:.4}",
                trip.tick,
                trip.limit.name(),
                trip.value,
                trip.allowed
            ));
        }
        if let Some(broken) = &ended.broken {
            summary.failure_reason = Some(broken.clone());
        }
        summary.loop_ = Some(loop_summary(ended));
        let compute = ended.times.compute.latencies();
        summary.step_us = StepUs {
            p50: us(compute.p50_ns),
            p99: us(compute.p99_ns),
            p999: us(compute.p999_ns),
            max: us(compute.max_ns),
            n: compute.n,
        };
        let sim = fidelity::simulated(self.system.clone(), self.bodies, &self.controls, 1e-3);
        summary.fidelity = Some(fidelity::fidelity(&self.traces, &sim));
        summary.safety = Some(safety_summary(ended));
        if let Some(why) = lacking {
            summary.degrade(&why);
        }
        if ended.dropped > 0 {
            summary.degrade(&format!("{} ticks were not recorded", ended.dropped));
        }
        let event = Event::new(
            Tick(last),
            time,
            "outcome",
            format!("{}: {}", summary.outcome, judgement.reason),
            json!({ "outcome": summary.outcome.to_string(), "decided_s": judgement.time_s }),
        );
        self.tell(vec![event], time);
        if let Some((v, _)) = self.view.take()
            && let Err(e) = v.finish()
        {
            summary.degrade(&e.to_string());
        }
        summary.wall_s = wall.as_secs_f64();
        summary.realtime_factor = time.seconds() / summary.wall_s.max(1e-9);
        if let Some(writer) = self.writer.take() {
            match writer.finish(&summary) {
                Ok(recording) => summary.recording = Some(recording),
                Err(e) => {
                    summary.degrade(&e.to_string());
                    self.lost.get_or_insert(e.into());
                }
            }
        }
        self.company.part(json);
        if let (Some(e), false) = (&self.lost, json) {
            eprintln!("the recording is not complete: {e}");
        }
        Ok(summary)
    }
}

#[expect(clippy::cast_precision_loss, reason = "times far below 2^53 ns")]
fn us(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

fn to_ms(ns: u64) -> f64 {
    us(ns) * 1e-3
}

fn loop_summary(ended: &Ended) -> LoopSummary {
    let l = ended.times.lateness.latencies();
    LoopSummary {
        period_us: 1000.0,
        late: ended.late,
        missed: ended.missed,
        lateness_us: LatenessUs {
            p50: us(l.p50_ns),
            p99: us(l.p99_ns),
            p999: us(l.p999_ns),
            max: us(l.max_ns),
        },
        phases: ended
            .times
            .phases
            .iter()
            .map(|(name, l)| {
                let phase = PhaseUs { p50: us(l.p50_ns), p99: us(l.p99_ns), max: us(l.max_ns) };
                (name.to_owned(), phase)
            })
            .collect(),
    }
}

fn safety_summary(ended: &Ended) -> SafetySummary {
    let trips = ended.end.trip.map(|t| {
        format!("tick {}: {} {:.4}, allowed {:.4}", t.tick, t.limit.name(), t.value, t.allowed)
    });
    SafetySummary {
        state: if ended.end.trip.is_some() { "stopped" } else { "normal" }.to_owned(),
        trips: trips.into_iter().collect(),
        min_margin: ended
            .end
            .margins
            .iter()
            .map(|(limit, margin)| (limit.name().to_owned(), margin))
            .collect(),
    }
}

fn tell(s: &Summary, scenario: &Scenario, out: &Path) {
    print(s, &scenario.expect.of_hil(), out);
    if let Some(f) = &s.fidelity {
        let word = |x: Option<f64>| x.map_or("–".to_owned(), |x| format!("{x:.4}"));
        println!(
            "  fidelity       R_e {}, R_T {}, peak {}, NRMS force {}, pose {}, ΔE {}",
            word(f.R_e),
            word(f.R_T),
            word(f.peak_force_ratio),
            word(f.nrms_force),
            word(f.nrms_pose),
            word(f.delta_energy)
        );
    }
    if let Some(l) = &s.loop_ {
        println!(
            "  loop           late {}, missed {}; wake-up p50 {:.1} µs, p99 {:.1} µs, max {:.1} µs",
            l.late, l.missed, l.lateness_us.p50, l.lateness_us.p99, l.lateness_us.max
        );
    }
    if let Some(safety) = &s.safety {
        let least = safety.min_margin.iter().min_by(|a, b| a.1.total_cmp(b.1));
        if let Some((name, margin)) = least {
            println!("  safety         {}, least margin {:.2} of {name}", safety.state, margin);
        }
    }
}
