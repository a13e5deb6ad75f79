//! `hil`: the loop with a rig, in virtual or in real time.

use core::cell::OnceCell;
use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::Args;
use docktwin_playback::ViewerFile;
use docktwin_record::{Outcome, Summary, Verdict};
use docktwin_rigport::rig::Rig;
use docktwin_run::{
    Control as _, HilOptions, HilRun, RunDirectory, RunError, Sink,
    rig_place::{ClockKind, RigPlace, connect},
    telemetry::hil_columns_for,
};
use docktwin_scenario::{ExpectedOutcome, Scenario, load_scenario};

use crate::{
    args::{LedArgs, OnRigArgs},
    company::{LiveArgs, PilotArgs, tell_live},
    failure::{Failure, OTHERWISE, STOPPED},
    inputs::overrides,
    observers::{AtTerminal, Bar, Interrupt, PilotLine},
    rehearse::{print, tell_losses},
    results::directory,
};

pub(crate) const EXAMPLES: &str = "\
The programme of both spacecraft answers the wrenches that the rig measures, 1000 times a second,
and the rig shows the mechanisms how they would move. `emulated` runs an emulated rig in this
process; `ipc:NAME` talks to another process (`docktwin rig emulate`, or a rig of your own written
from docs/rig-protocol.md) and asks before it moves that rig. With the virtual clock loop and rig
wait for each other and a run repeats bit by bit; with the real-time clock the loop waits for
nobody.

A run: checklist and arming; a slow move to the beginning of the run-up, where sensors are tared;
the run-up along the free flight to the initial condition; then the loop is closed. What is
recorded begins there. A limit passed anywhere stops the rig (exit code 3, unless the scenario
expects it). --dry-run goes there and back, slowly, without closing the loop.

The loop believes the scenario's mechanism. The rig has it too, or, with --mechanism-draw, one drawn
within [spread] of its file (mounts included), or, with --rig-mechanism, another one; the run is
compared with the simulated system that has the rig's. Behind `ipc:` these options say what the rig
has, for the comparison alone.

The run directory is that of `rehearse`, with columns of loop, legs and sensors beside it, and
`loop`, `fidelity` (against the same docking without a rig) and `safety` in summary.json. The
verdict is that of the scenario's `expect`: how the run ends, [expect.hil] and [[expect.fidelity]].
Where it bounds neither force nor energy, a run that is far off is warned of.

Examples:
  docktwin hil scenarios/apas_nominal.toml --rig emulated
  docktwin hil scenarios/apas_fast.toml --rig emulated --compensator twin
  docktwin hil scenarios/vibro_impact.toml --rig emulated --compensator none
  docktwin hil scenarios/apas_nominal.toml --rig emulated --perturb 7 --lead-ms 1.8 --out runs/p7
  docktwin hil scenarios/apas_fast.toml --rig emulated --mechanism-draw 3 --mechanism-grade coarse
  docktwin hil scenarios/apas_fast.toml --rig emulated \\
      --rig-mechanism models/foreign/apas_backlash_active.toml
  docktwin rig identify --rig emulated --model models/urdf/stewart.toml --perturb 7 --out p7.toml
  docktwin hil scenarios/apas_nominal.toml --rig emulated --perturb 7 --identification p7.toml
  docktwin rig emulate models/urdf/stewart.toml --name lab &
  docktwin hil scenarios/apas_nominal.toml --rig ipc:lab --clock realtime --live --yes";

/// Options of `hil`.
#[derive(Debug, Args)]
pub(crate) struct HilArgs {
    /// Scenario file
    scenario: PathBuf,
    /// The rig: `emulated` in this process, or `ipc:NAME` in another
    #[arg(long, value_name = "emulated|ipc:NAME")]
    rig: RigPlace,
    #[command(flatten)]
    led: LedArgs,
    #[command(flatten)]
    on_rig: OnRigArgs,
    /// File of `rig calibrate`: zeros and delays of the sensors, and what sensor B carries
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Run directory; by default a new one under `runs`.
    #[arg(long, value_name = "DIR", help = "Run directory [default: runs/<scenario>-<utc>]")]
    out: Option<PathBuf>,
    /// Do not write run.rrd
    #[arg(long)]
    no_rrd: bool,
    /// Slowly to the initial condition and back, with an open gap
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    pilot: PilotArgs,
}

/// Runs the command.
pub(crate) fn run(args: &HilArgs, json: bool) -> Result<ExitCode, Failure> {
    let scenario = load_scenario(&args.scenario, &overrides(&args.on_rig.set)?)?;
    if !json {
        scenario.notes.iter().for_each(|n| eprintln!("{} {n}", n.word()));
    }
    let options = args.options()?;
    let (word, what) =
        if options.repeats() { ("replay", "Replay it") } else { ("report", "Read about it") };
    let prepared = HilRun::new(&scenario, options)?;
    let out = directory(args.out.as_deref(), "runs", &scenario.name)?;
    let at = At { args, json, interrupt: OnceCell::new() };
    let summary = go(prepared, &scenario, &at, &out)?;
    tell_losses(&summary, json);
    if json {
        // A summary always serialises; a defect would show as an empty object.
        println!("{}", serde_json::to_value(&summary).unwrap_or_default());
    } else {
        tell(&summary, &scenario, &out);
        println!("{what} with: docktwin {word} {}", out.display());
    }
    let tripped = summary.safety.as_ref().is_some_and(|s| !s.trips.is_empty());
    let expected = scenario.expect.outcome_of_hil() == ExpectedOutcome::Stopped && !args.dry_run;
    let interrupted = at.interrupt.get().is_some_and(|i| i.stopped().is_some()) && !tripped;
    Ok(ExitCode::from(match (summary.verdict, summary.outcome) {
        (Verdict::Pass, _) => 0,
        // A signal is no stop of the supervisor, and an expected stop may still break a bound.
        (_, Outcome::Stopped) if !interrupted && !expected => STOPPED,
        _ => OTHERWISE,
    }))
}

fn go(run: HilRun<'_>, scenario: &Scenario, at: &At<'_>, out: &Path) -> Result<Summary, Failure> {
    let (args, json) = (at.args, at.json);
    let mut live = args.live.start(scenario, &hil_columns_for(&scenario.mechanism))?;
    let viewer = (!args.no_rrd).then(|| ViewerFile::new(out.join("run.rrd")));
    let sink = (RunDirectory::new(out), (viewer, &mut live));
    let summary = match &args.rig {
        RigPlace::Emulated => {
            let rig = run.emulated()?;
            at.run(run, rig, scenario, sink)
        }
        RigPlace::Port(name) => {
            let rig = connect(name)?;
            at.run(run, rig, scenario, sink)
        }
    }?;
    if !json {
        live.iter().for_each(tell_live);
    }
    Ok(summary)
}

/// How the loop is run from here.
struct At<'a> {
    args: &'a HilArgs,
    json: bool,
    /// Once the operator has agreed: before, a signal ends the process as ever.
    interrupt: OnceCell<Interrupt>,
}

impl At<'_> {
    fn run<R: Rig, S: Sink + Send>(
        &self,
        run: HilRun<'_>,
        rig: R,
        scenario: &Scenario,
        sink: S,
    ) -> Result<Summary, Failure> {
        let mut operator = AtTerminal { yes: self.args.led.yes, quiet: self.json };
        // Asked while the terminal is still the operator's.
        docktwin_run::rig_place::confirm(&mut operator, &self.args.rig)?;
        operator.yes = true;
        let interrupt = *self.interrupt.get_or_init(Interrupt::catch);
        // Last: from here on the terminal is the pilot's.
        let pilot = self.args.pilot.start(scenario)?;
        let stick = pilot.as_ref().and_then(|p| p.stick());
        let line = stick.as_ref().filter(|_| !self.json).map(|_| PilotLine::default());
        let mut bar = Bar::new(self.json || stick.is_some());
        let mut sink = (sink, line);
        let control = (stick, interrupt);
        let summary: Result<Summary, RunError> = match self.args.led.clock.kind() {
            ClockKind::Virtual => run.run_with(rig, &mut sink, control, &mut bar, &mut operator),
            ClockKind::Realtime => {
                let realtime = self.args.led.realtime.options();
                run.run_realtime(rig, &mut sink, control, &realtime, &mut operator)
            }
        };
        drop(pilot);
        Ok(summary?)
    }
}

impl HilArgs {
    fn options(&self) -> Result<HilOptions, Failure> {
        Ok(HilOptions {
            place: self.rig.clone(),
            clock: self.led.clock.kind(),
            calibration: self.calibration.clone(),
            dry_run: self.dry_run,
            ..self.on_rig.options()?
        })
    }
}

fn tell(s: &Summary, scenario: &Scenario, out: &Path) {
    print(s, scenario.expect.outcome_of_hil(), out);
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
        for (name, of) in [("felt", f.felt), ("hardware", f.hardware)] {
            if let Some(of) = &of {
                for (window, x) in of.windows() {
                    let Some(window_s) = x.window_s else { continue };
                    let small = of.small_forces(&x).map_or("", |_| " (of small forces)");
                    println!(
                        "  {name:<14} {window}, {window_s:.3} s: peak {}, NRMS force {}, moment {}, pose {}, \
                         impulse {}{small}",
                        word(x.peak_force_ratio),
                        word(x.nrms_force),
                        word(x.nrms_moment),
                        word(x.nrms_pose),
                        word(x.impulse_ratio)
                    );
                }
            }
        }
        if let Some(late_s) = f.hardware.and_then(|of| of.capture_difference_s) {
            println!("  capture        {:+.2} ms against the simulated system", late_s * 1e3);
        }
    }
    if let Some(l) = &s.loop_ {
        if let (Some(lead), Some(believed)) = (l.lead_ms, l.believed_lead_ms) {
            println!(
                "  lead           {lead:.3} ms; believed to undo the rig and sensor A {believed:.3} ms"
            );
        }
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
