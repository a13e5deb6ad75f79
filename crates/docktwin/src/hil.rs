//! `hil`: the loop with a rig, in virtual or in real time.

use std::{path::Path, process::ExitCode};

use docktwin::viewer_file::ViewerFile;
use docktwin_record::{Outcome, Summary, Verdict};
use docktwin_rigport::rig::Rig;
use docktwin_run::{
    HilOptions, HilRun, RunDirectory, RunError, Sink,
    rig_place::{ClockKind, RigPlace, connect},
    telemetry::hil_columns,
};
use docktwin_scenario::{Scenario, load_scenario};

use crate::{
    cli::HilArgs,
    commands::{new_directory, overrides},
    company::LiveViewer,
    failure::{Failure, OTHERWISE, STOPPED},
    observers::{AtTerminal, Bar, PilotLine},
    rehearse::{print, tell_losses},
};

/// Runs the command.
pub(crate) fn run(args: &HilArgs, json: bool) -> Result<ExitCode, Failure> {
    let scenario = load_scenario(&args.scenario, &overrides(&args.set)?)?;
    if !json {
        scenario.notes.iter().for_each(|n| eprintln!("ignored {n}"));
    }
    let options = args.options();
    let (word, what) =
        if options.repeats() { ("replay", "Replay it") } else { ("report", "Read about it") };
    let prepared = HilRun::new(&scenario, options)?;
    let out = args.out.clone().unwrap_or_else(|| new_directory("runs", &scenario.name));
    let summary = go(prepared, &scenario, args, &out, json)?;
    tell_losses(&summary, json);
    if json {
        // A summary always serialises; a defect would show as an empty object.
        println!("{}", serde_json::to_value(&summary).unwrap_or_default());
    } else {
        tell(&summary, &scenario, &out);
        println!("{what} with: docktwin {word} {}", out.display());
    }
    Ok(ExitCode::from(match (summary.verdict, summary.outcome) {
        (Verdict::Pass, _) => 0,
        (_, Outcome::Stopped) => STOPPED,
        _ => OTHERWISE,
    }))
}

fn go(
    run: HilRun<'_>,
    scenario: &Scenario,
    args: &HilArgs,
    out: &Path,
    json: bool,
) -> Result<Summary, Failure> {
    let at = At { args, json };
    let mut live = args.live.start(scenario, &hil_columns())?;
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
        live.iter().for_each(LiveViewer::report);
    }
    Ok(summary)
}

/// How the loop is run from here.
struct At<'a> {
    args: &'a HilArgs,
    json: bool,
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
        // Last: from here on the terminal is the pilot's.
        let pilot = self.args.pilot.start(scenario)?;
        let stick = pilot.as_ref().and_then(|p| p.stick());
        let line = stick.as_ref().filter(|_| !self.json).map(|_| PilotLine::default());
        let mut bar = Bar::new(self.json || stick.is_some());
        let mut sink = (sink, line);
        let summary: Result<Summary, RunError> = match self.args.led.clock.kind() {
            ClockKind::Virtual => run.run_with(rig, &mut sink, stick, &mut bar, &mut operator),
            ClockKind::Realtime => {
                let realtime = self.args.led.realtime.options();
                run.run_realtime(rig, &mut sink, stick, &realtime, &mut operator)
            }
        };
        drop(pilot);
        Ok(summary?)
    }
}

impl HilArgs {
    fn options(&self) -> HilOptions {
        HilOptions {
            place: self.rig.clone(),
            clock: self.led.clock.kind(),
            compensator: self.compensator,
            lead_s: self.lead_ms.map(|ms| ms * 1e-3),
            model: self.model.clone(),
            identification: self.identification.clone(),
            calibration: self.calibration.clone(),
            seed: self.seed,
            perturb: self.perturb,
            dry_run: self.dry_run,
        }
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
