//! `validate vibro-impact`: Table 4 of the paper, through the body programme in six degrees of freedom
//! and the whole loop.

use core::fmt::Write as _;
use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::Args;
use docktwin_control::{compensation::Compensation, sensing::SensorScheme};
use docktwin_hil::{
    clock::{Clock, OverrunPolicy, RealtimeClock, VirtualClock},
    emulated::EmulatedRig,
    realtime::relax,
    scheduler::{Loop, TickRecord, believed_delays_s},
    vibro::{Axis, Contact, Row, TABLE_4, VibroRun, VibroSettings, VibroTest},
};
use docktwin_model::{
    DockingMechanism, HydraulicPreset, Rig as RigModel, Spacecraft, load_mechanism, load_rig,
    load_spacecraft,
};
use docktwin_plot::{Axis as PlotAxis, Colour, Dash, Line, Plot, PlotError};
use docktwin_rigport::{in_process::InProcess, rig::Rig};
use docktwin_scenario::{CompensatorChoice, resolve_path};
use serde_json::{Value, json};

use crate::{
    analyze::{Results, plots::sheet},
    cli::{ClockArg, PresetArg, compensator, not_negative},
    failure::{Failure, OTHERWISE},
    rigs::{
        LedArgs, PERIOD_NS, RigPlace, best_effort, compensation, confirm, connect, new_session,
        patience,
    },
};

pub(super) const EXAMPLES: &str = "\
A spring stick between two stops strikes one side of its frame and comes back; nothing is lost in
it, so R_e (speed after over before, of the body programme) and R_T (duration of contact over
pi sqrt(m_r/K)) would both be 1. What is missing or too much is the loop's. Beside them the peak
force, the RMS errors of force and position over the contact against the simulated system, and the
energy gained: R_e alone can look right while the waveform is wrong. R_T is told twice, from the
true contact force (emulated rigs only) and from the sensors'.

The rig's own force is emulated hydraulics and sensors with noise, in process, or behind a port.
A rig behind a port moves when somebody confirms it, and has the stick it has: run the rows of its
stiffness, 35.4 kN/m in rows 1 to 3, 94.4 kN/m from row 4 on. In real time it is told how many
ticks the loop left out, how many had no measurement in time, and how late the loop was woken.
Axes joined by + move at once; the first is judged. The stick's frame leaves 10 mm to either side;
approach speeds are those that the paper's rod bears. Case 7 is the row at 5 Hz that the paper does
not have; in rotation it asks for more than the valves can.

The directory holds vibro-impact.csv, a plot of force and speed for every axis and case, and
vibro-impact.json (what --json prints).

Examples:
  docktwin validate vibro-impact
  docktwin validate vibro-impact --axis x --case 6 --compensator none --contacts 8
  docktwin validate vibro-impact --axis x+y+roll --case 3 --lead-ms 10     too much: peaks fall
  docktwin validate vibro-impact --axis x --draws 20 --json                rigs as built
  docktwin rig emulate models/urdf/stewart.toml --name lab --scenario scenarios/vibro_impact.toml &
  docktwin validate vibro-impact --axis x --case 3 --rig ipc:lab --clock realtime --yes

Exit codes: 0 every test was run to its end; 1 one was not; 2 bad input.";

/// Options of `validate vibro-impact`.
#[derive(Debug, Args)]
pub(crate) struct VibroArgs {
    /// x, y, z, roll, pitch or yaw, or several joined by +; repeatable [default: x and y]
    #[arg(long, value_name = "AXIS", value_parser = axes)]
    axis: Vec<Axes>,
    /// A row of Table 4, 1 to 6, or 7 for 5 Hz, or `all` [default: 1 to 6]
    #[arg(long, value_name = "all|N", value_parser = case)]
    case: Option<Case>,
    /// Against the delay of the rig
    #[arg(long, value_parser = compensator, value_name = "none|lead", default_value = "lead")]
    compensator: CompensatorChoice,
    /// Lead, ms [default: the delay that the rig's file lets one believe]
    #[arg(long, value_name = "MS", value_parser = not_negative)]
    lead_ms: Option<f64>,
    /// Sensors that F4, M4 come from
    #[arg(long, value_parser = ["single", "two"], default_value = "single")]
    sensors: String,
    /// Contacts to run through in each test
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    contacts: u32,
    /// Run every test on this many rigs drawn within the spread of the file, too
    #[arg(long, value_name = "N", default_value_t = 0)]
    draws: u32,
    /// The rig: `emulated` in this process, or `ipc:NAME` in another, which must have the stick
    #[arg(long, value_name = "emulated|ipc:NAME", default_value_t = RigPlace::Emulated)]
    rig: RigPlace,
    #[command(flatten)]
    led: LedArgs,
    /// TOML of the rig
    #[arg(long, value_name = "RIG.toml", default_value = "models/urdf/stewart.toml")]
    model: PathBuf,
    /// Oil volume [default: as the file says]
    #[arg(long, value_enum)]
    preset: Option<PresetArg>,
    /// Seed of the noise; drawn rigs have the seeds after it
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Directory of the results; by default a new one under `analysis`.
    #[arg(long, value_name = "DIR", help = "Directory [default: analysis/vibro-impact-<utc>]")]
    out: Option<PathBuf>,
}

/// Axes that move at once.
#[derive(Clone, Debug)]
struct Axes {
    name: String,
    axes: Vec<Axis>,
}

fn axes(text: &str) -> Result<Axes, String> {
    let axes = text
        .split('+')
        .map(|word| Axis::ALL.iter().find(|(name, _)| *name == word).map(|(_, a)| *a))
        .collect::<Option<Vec<_>>>()
        .ok_or_else(|| "an axis is x, y, z, roll, pitch or yaw; join several by +".to_owned())?;
    Ok(Axes { name: text.to_owned(), axes })
}

/// Rows to run.
#[derive(Clone, Copy, Debug)]
enum Case {
    All,
    One(usize),
}

fn case(text: &str) -> Result<Case, String> {
    if text == "all" {
        return Ok(Case::All);
    }
    match text.parse::<usize>() {
        Ok(n) if (1..=TABLE_4.len()).contains(&n) => Ok(Case::One(n)),
        _ => Err(format!("a case is 1 to {}, or all", TABLE_4.len())),
    }
}

/// How the loop kept time in a test.
#[derive(Clone, Debug, Default)]
struct Kept {
    ticks: u64,
    /// Ticks left out.
    missed: u64,
    /// Ticks without a measurement of their own.
    without: u64,
    lateness_ns: u64,
    /// What the machine did not grant.
    lacking: Option<String>,
}

impl Kept {
    fn look(&mut self, r: &TickRecord) {
        self.ticks += 1;
        self.missed += r.missed;
        self.without += u64::from(!r.fresh);
        self.lateness_ns = self.lateness_ns.max(r.lateness_ns);
    }

    fn lateness_ms(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "far below 2^53 ns")]
        let ns = self.lateness_ns as f64;
        ns * 1e-6
    }
}

/// One test as it was run.
struct Tested {
    axis: String,
    case: usize,
    row: Row,
    /// R_e and R_T of the paper on this axis.
    paper: Option<[f64; 2]>,
    run: VibroRun,
    kept: Kept,
    /// The first contact on every drawn rig.
    draws: Vec<Option<Contact>>,
    contact_time_s: f64,
    play_m: f64,
}

struct Bench<'a> {
    args: &'a VibroArgs,
    rig: RigModel,
    preset: HydraulicPreset,
    stick: DockingMechanism,
    body: Spacecraft,
    compensation: Compensation,
}

/// Runs the command.
pub(super) fn run(args: &VibroArgs, json: bool) -> Result<ExitCode, Failure> {
    let bench = Bench::new(args)?;
    confirm(&args.rig, args.led.yes)?;
    let mut results = Results::new(args.out.as_deref(), "vibro-impact")?;
    let axes = if args.axis.is_empty() {
        vec![axes("x"), axes("y")].into_iter().flatten().collect()
    } else {
        args.axis.clone()
    };
    let cases: Vec<usize> = match args.case {
        None => (1..=6).collect(),
        Some(Case::All) => (1..=TABLE_4.len()).collect(),
        Some(Case::One(n)) => vec![n],
    };
    let mut tested = Vec::new();
    for a in &axes {
        for &c in &cases {
            tested.push(bench.test(a, c)?);
            if !json {
                eprint!(".");
            }
        }
    }
    if !json {
        eprintln!();
    }
    results.save("vibro-impact.csv".to_owned(), &csv(&tested))?;
    let lead = in_words(&bench.compensation);
    results.plots(tested.iter().map(|t| plot(t, &lead)).collect())?;
    let whole = tested.iter().all(|t| t.run.trip.is_none() && !t.run.contacts.is_empty());
    let answer = answer(&bench, &tested);
    results.finish("vibro-impact", &answer, &words(&bench, &tested), json)?;
    Ok(ExitCode::from(if whole { 0 } else { OTHERWISE }))
}

fn refused(what: impl core::fmt::Display) -> Failure {
    Failure::Usage {
        what: what.to_string(),
        remedy: "see docs/bring-up-a-rig.md for what a rig needs before a test".to_owned(),
    }
}

impl<'a> Bench<'a> {
    fn new(args: &'a VibroArgs) -> Result<Self, Failure> {
        let rig = load_rig(&args.model.with_extension("urdf"))?.model;
        // A rig of one's own need not stand among the models of docktwin.
        let model = |name: &str| {
            resolve_path(&args.model, Path::new(name))
                .or_else(|| resolve_path(&args.model, &Path::new("models/urdf").join(name)))
                .unwrap_or_else(|| args.model.with_file_name(name))
        };
        let stick =
            load_mechanism(&model("stick_active.urdf"), &model("stick_passive.urdf"), None)?;
        let body = load_spacecraft(&model("test_2026kg.urdf"))?;
        let lead_s =
            args.lead_ms.map_or_else(|| believed_delays_s(&rig).iter().sum(), |ms| ms * 1e-3);
        let compensation = compensation(args.compensator, lead_s)?;
        if args.draws > 0 && args.rig != RigPlace::Emulated {
            return Err(Failure::Usage {
                what: "a rig in another process is what it is; it cannot be drawn".to_owned(),
                remedy: "leave --draws away, or take --rig emulated".to_owned(),
            });
        }
        let preset = args.preset.map_or(rig.hydraulics.default_preset, PresetArg::preset);
        Ok(Self { args, rig, preset, stick: stick.model, body: body.model, compensation })
    }

    fn test(&self, axes: &Axes, case: usize) -> Result<Tested, Failure> {
        let row = TABLE_4[case - 1];
        let test = VibroTest::new(row, &axes.axes, &self.body, &self.stick)
            .ok_or_else(|| refused("the mechanism stick_active has no table [stick]"))?;
        let (run, kept) = self.run(&test, None)?;
        let draws = (1..=u64::from(self.args.draws))
            .map(|i| Ok(self.run(&test, Some(self.args.seed + i))?.0.contacts.first().copied()))
            .collect::<Result<_, Failure>>()?;
        // The paper has X and Y alone.
        let column = match axes.name.as_str() {
            "x" => Some(0),
            "y" => Some(1),
            _ => None,
        };
        Ok(Tested {
            axis: axes.name.clone(),
            case,
            row,
            paper: row.paper.zip(column).map(|(p, i)| p[i]),
            run,
            kept,
            draws,
            contact_time_s: test.contact_time_s(),
            play_m: self.stick.stick.map_or(0.0, |s| s.play_m()),
        })
    }

    /// The test on the rig, or on one drawn with the seed `built`.
    fn run(&self, test: &VibroTest, built: Option<u64>) -> Result<(VibroRun, Kept), Failure> {
        match &self.args.rig {
            RigPlace::Emulated => {
                let rest = self.rig.docking.pose([0.0; 6]);
                let seed = self.args.seed;
                let system = test.system.clone();
                let rig = EmulatedRig::new(&self.rig, self.preset, built, seed, system, &rest)
                    .map_err(refused)?;
                self.with_rig(test, InProcess::new(rig), 1)
            }
            RigPlace::Port(name) => self.with_rig(test, connect(name)?, new_session()),
        }
    }

    fn with_rig<R: Rig>(
        &self,
        test: &VibroTest,
        rig: R,
        session: u64,
    ) -> Result<(VibroRun, Kept), Failure> {
        match self.args.led.clock {
            ClockArg::Virtual => self.with_clock(test, rig, VirtualClock::new(PERIOD_NS), session),
            ClockArg::Realtime => {
                let lacking = best_effort(&self.args.led.realtime.apply()?);
                let clock = RealtimeClock::new(PERIOD_NS, OverrunPolicy::Skip);
                let out = self.with_clock(test, rig, clock, session);
                relax();
                out.map(|(run, kept)| (run, Kept { lacking, ..kept }))
            }
        }
    }

    fn with_clock<R: Rig, K: Clock>(
        &self,
        test: &VibroTest,
        rig: R,
        clock: K,
        session: u64,
    ) -> Result<(VibroRun, Kept), Failure> {
        let settings = VibroSettings {
            preset: self.preset,
            compensation: self.compensation,
            scheme: if self.args.sensors == "two" {
                SensorScheme::Two
            } else {
                SensorScheme::Single
            },
            contacts: self.args.contacts,
            session,
            patience: patience::<K>(),
        };
        let mut kept = Kept::default();
        let setup = test.setup(&self.rig, &settings).map_err(|e| Failure::Usage {
            what: e.to_string(),
            remedy: "correct the option that gives it".to_owned(),
        })?;
        let idle = Loop::new(setup, rig, clock);
        let run = test.run(idle, |r| kept.look(r)).map_err(refused)?;
        Ok((run, kept))
    }
}

const COLUMNS: [&str; 13] = [
    "axis",
    "case",
    "frequency_hz",
    "rig",
    "contact",
    "r_e",
    "r_t",
    "r_t_sensed",
    "peak_ratio",
    "nrms_force",
    "nrms_position",
    "delta_energy",
    "v0_m_s",
];

fn csv(tested: &[Tested]) -> String {
    let mut out = COLUMNS.join(",");
    out.push('\n');
    let mut line = |t: &Tested, rig: &str, n: usize, c: &Contact| {
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "{},{},{},{rig},{n},{},{},{},{},{},{},{},{}",
            t.axis,
            t.case,
            t.row.frequency_hz,
            c.r_e,
            c.r_t,
            c.r_t_sensed,
            c.peak_ratio,
            c.nrms_force,
            c.nrms_position,
            c.delta_energy,
            c.v0_m_s
        );
    };
    for t in tested {
        t.run.contacts.iter().enumerate().for_each(|(i, c)| line(t, "file", i + 1, c));
        for (i, c) in t.draws.iter().enumerate() {
            if let Some(c) = c {
                line(t, &format!("draw_{}", i + 1), 1, c);
            }
        }
    }
    out
}

fn contact_json(c: &Contact) -> Value {
    json!({
        "R_e": c.r_e, "R_T": c.r_t, "R_T_sensed": c.r_t_sensed, "peak_force_ratio": c.peak_ratio,
        "nrms_force": c.nrms_force, "nrms_position": c.nrms_position,
        "delta_energy": c.delta_energy, "begin_s": c.begin_s, "v0_m_s": c.v0_m_s, "v1_m_s": c.v1_m_s,
    })
}

fn answer(bench: &Bench<'_>, tested: &[Tested]) -> Value {
    let tests: Vec<Value> = tested
        .iter()
        .map(|t| {
            let contacts: Vec<Value> = t.run.contacts.iter().map(contact_json).collect();
            let draws: Vec<Value> =
                t.draws.iter().map(|c| c.as_ref().map_or(Value::Null, contact_json)).collect();
            json!({
                "axis": t.axis, "case": t.case, "frequency_hz": t.row.frequency_hz,
                "length_m": t.row.length_m, "stiffness_n_m": t.row.stiffness_n_m,
                "mass_kg": t.row.mass_kg, "speed_m_s": t.row.speed_m_s,
                "paper": t.paper.map(|p| json!({ "R_e": p[0], "R_T": p[1] })),
                "contacts": contacts, "draws": draws,
                "stopped_by": t.run.trip.map(|t| t.limit.name()),
                "loop": {
                    "ticks": t.kept.ticks, "missed_ticks": t.kept.missed,
                    "ticks_without_measurement": t.kept.without,
                    "lateness_max_ms": t.kept.lateness_ms(), "best_effort": t.kept.lacking,
                },
            })
        })
        .collect();
    let lead_s = bench.compensation.lead_s();
    json!({
        "rig": bench.args.rig.to_string(), "model": bench.args.model.to_string_lossy(),
        "preset": bench.preset.word(), "clock": bench.args.led.clock.name(),
        "compensator": bench.compensation.name(), "lead_s": lead_s,
        "sensors": bench.args.sensors, "tests": tests,
    })
}

/// Off one, in percent with its sign.
fn off(x: f64) -> String {
    format!("{:+.2}", (x - 1.0) * 100.0)
}

fn in_words(c: &Compensation) -> String {
    match c {
        Compensation::None => "without compensation".to_owned(),
        Compensation::Lead(s) => format!("with a lead of {:.2} ms", s * 1e3),
    }
}

fn words(bench: &Bench<'_>, tested: &[Tested]) -> String {
    let lead = in_words(&bench.compensation);
    let place = match bench.args.rig {
        RigPlace::Emulated => "emulated rig",
        RigPlace::Port(_) => "rig behind a port",
    };
    let mut out = format!("Table 4 on the {place} ({}), {lead}; % off one\n", bench.preset.word());
    out.push_str(
        "axis        case   Hz     R_e-1   R_T-1  sensed   peak-1  NRMS F  NRMS x   dE/E0   paper R_e-1 R_T-1\n",
    );
    for t in tested {
        let paper = t.paper.map_or_else(
            || "     –     –".to_owned(),
            |p| format!("{:>6} {:>6}", off(p[0]), off(p[1])),
        );
        for (i, c) in t.run.contacts.iter().enumerate() {
            // Writing to a String cannot fail.
            let _ = writeln!(
                out,
                "{:11} {:4} {:6.3} {:>7} {:>7} {:>7}  {:>7} {:7.2} {:7.2} {:+8.2}   {}",
                if i == 0 { t.axis.as_str() } else { "" },
                t.case,
                t.row.frequency_hz,
                off(c.r_e),
                off(c.r_t),
                off(c.r_t_sensed),
                off(c.peak_ratio),
                c.nrms_force * 100.0,
                c.nrms_position * 100.0,
                c.delta_energy * 100.0,
                if i == 0 { paper.as_str() } else { "" },
            );
        }
        if let Some(trip) = t.run.trip {
            let _ = writeln!(
                out,
                "{:11} {:4} stopped by the supervisor: {} {:.3}, allowed {:.3}",
                t.axis,
                t.case,
                trip.limit.name(),
                trip.value,
                trip.allowed
            );
        } else if t.run.contacts.is_empty() {
            let _ = writeln!(out, "{:11} {:4} no whole contact", t.axis, t.case);
        }
        if bench.args.led.clock == ClockArg::Realtime {
            let k = &t.kept;
            let _ = writeln!(
                out,
                "{:11} {:4} of {} ticks {} left out, {} without a measurement; woken at most {:.3} ms late{}{}",
                "",
                "",
                k.ticks + k.missed,
                k.missed,
                k.without,
                k.lateness_ms(),
                if k.lacking.is_some() { "; " } else { "" },
                k.lacking.as_deref().unwrap_or_default(),
            );
        }
        let drawn: Vec<&Contact> = t.draws.iter().flatten().collect();
        if !drawn.is_empty() {
            #[expect(clippy::cast_precision_loss, reason = "a count of rigs")]
            let n = drawn.len() as f64;
            let of = |x: fn(&Contact) -> f64| {
                let sizes: Vec<f64> = drawn.iter().map(|c| (x(c) - 1.0).abs() * 100.0).collect();
                (sizes.iter().sum::<f64>() / n, sizes.iter().fold(0.0, |a: f64, b| a.max(*b)))
            };
            let ((em, ew), (tm, tw)) = (of(|c| c.r_e), of(|c| c.r_t));
            let _ = writeln!(
                out,
                "{:11} {:4} {} of {} drawn rigs: |R_e-1| mean {em:.2} worst {ew:.2}, |R_T-1| mean {tm:.2} worst {tw:.2}",
                "",
                "",
                drawn.len(),
                t.draws.len()
            );
        }
    }
    out
}

/// Axes of both panels begin in line.
const LEFT: f64 = 68.0;

/// Force and speed against time, the simulated system laid over.
fn plot(t: &Tested, compensation: &str) -> Result<(String, String), PlotError> {
    let sign = t.run.contacts.first().map_or(1.0, |c| c.v0_m_s.signum());
    let onset = t.run.contacts.first().map(|c| c.begin_s);
    let samples = &t.run.samples;
    let w = core::f64::consts::PI / t.contact_time_s;
    let v = t.run.contacts.first().map_or(t.row.speed_m_s, |c| c.v0_m_s.abs());
    let period = t.contact_time_s + 2.0 * t.play_m / v;
    // Lossless: half a sine, then flight to the other side, and so on.
    let ideal = |time_s: f64| -> [f64; 2] {
        let Some(onset) = onset else { return [0.0, v * sign] };
        let since = time_s - onset;
        if since < 0.0 {
            return [0.0, v * sign];
        }
        let n = (since / period).floor();
        let side = if (n / 2.0).fract() > 0.25 { -sign } else { sign };
        let into = since - n * period;
        if into < t.contact_time_s {
            let peak = v * t.row.stiffness_n_m / w;
            [-peak * (w * into).sin() * side, v * (w * into).cos() * side]
        } else {
            [0.0, -v * side]
        }
    };
    let curve = |f: &dyn Fn(&docktwin_hil::vibro::Sample) -> f64| -> Vec<[f64; 2]> {
        samples.iter().map(|s| [s.time_s, f(s)]).collect()
    };
    let force = [
        curve(&|s| ideal(s.time_s)[0]),
        curve(&|s| s.true_force_n.unwrap_or(s.sensed_force_n)),
        curve(&|s| s.sensed_force_n),
    ];
    let speed = [curve(&|s| ideal(s.time_s)[1] * 1e3), curve(&|s| s.speed_m_s * 1e3)];
    let title = format!(
        "{} · {} Hz, m = {} kg · {compensation}",
        t.axis, t.row.frequency_hz, t.row.mass_kg
    );
    let panel = |title: &str, y: PlotAxis| {
        Plot::new(title)
            .x_axis(PlotAxis::new("time since closing", "s"))
            .y_axis(y)
            .size(760.0, 240.0)
            .margin_left(LEFT)
    };
    let panels = [
        panel(&title, PlotAxis::new("force on the target", "N"))
            .line(Line::new("simulated system", &force[0]).colour(Colour::Grey).width(3.0))
            .line(Line::new("true", &force[1]).colour(Colour::Vermilion).width(1.6))
            .line(
                Line::new("sensed", &force[2]).colour(Colour::Blue).dash(Dash::Dashed).width(1.2),
            ),
        panel("", PlotAxis::new("relative speed", "mm/s"))
            .line(Line::new("", &speed[0]).colour(Colour::Grey).width(3.0))
            .line(Line::new("", &speed[1]).colour(Colour::Vermilion).width(1.6)),
    ];
    let [force_panel, speed_panel] = panels;
    let svg = sheet(&[&[force_panel], &[speed_panel]])?;
    Ok((format!("{}_case{}.svg", t.axis.replace('+', "_"), t.case), svg))
}
