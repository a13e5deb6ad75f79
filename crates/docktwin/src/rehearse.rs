//! `rehearse`: the twin alone, as fast as possible, or in real time under a pilot.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::Args;
use docktwin_playback::ViewerFile;
use docktwin_record::{Summary, Verdict};
use docktwin_run::{
    Rehearsal, RehearsalOptions, RunDirectory, inspection::on_its_rig, signals::columns_for,
};
use docktwin_scenario::{ExpectedOutcome, load_scenario};

use crate::{
    args::TwinArg,
    check::sag_flag,
    company::{LiveArgs, PilotArgs, tell_live},
    failure::{Failure, OTHERWISE},
    inputs::overrides,
    observers::{Bar, Interrupt, PilotLine},
    results::directory,
};

pub(crate) const EXAMPLES: &str = "\
The run directory holds summary.json, run.mcap (every tick, crash-safe), telemetry.parquet,
events.jsonl, run.rrd (for the rerun viewer) and scenario.toml (as it ran).

--live streams to a viewer at rerun+http://127.0.0.1:9876/proxy, or at --live=URL, beside writing
the files; start one with `rerun --bind 127.0.0.1`. What it does not take in time it does not
show; the run neither waits nor differs.

--pilot adds the pilot's force and moment to the scenario's thrusts, in real time, 1 ×. The keys
are told at the start: w/s a/d r/f push along X Y Z of e1, o/u i/k j/l turn about them, space lets
go, q ends. The run is recorded like any other and can be replayed bit by bit.

Examples:
  docktwin rehearse scenarios/apas_nominal.toml
  docktwin rehearse scenarios/apas_nominal.toml --twin reduced --json
  docktwin rehearse scenarios/apas_nominal.toml --live --pilot --set run.duration_s=60
  docktwin rehearse scenarios/apas_fast.toml --set mechanism.attenuation='\"differential\"'";

/// Options of `rehearse`.
#[derive(Debug, Args)]
pub(crate) struct RehearseArgs {
    /// Scenario file
    scenario: PathBuf,
    /// Run directory; by default a new one under `runs`.
    #[arg(long, value_name = "DIR", help = "Run directory [default: runs/<scenario>-<utc>]")]
    out: Option<PathBuf>,
    /// Override a key of the scenario, repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    set: Vec<String>,
    /// Seed of all random numbers (a rehearsal draws none; it is kept with the run)
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Which twin integrates the bodies
    #[arg(long, value_enum, default_value_t = TwinArg::Full)]
    twin: TwinArg,
    /// Do not write run.rrd
    #[arg(long)]
    no_rrd: bool,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    pilot: PilotArgs,
}

/// Runs the command.
pub(crate) fn run(args: &RehearseArgs, json: bool) -> Result<ExitCode, Failure> {
    let scenario = load_scenario(&args.scenario, &overrides(&args.set)?)?;
    if !json {
        scenario.notes.iter().for_each(|n| eprintln!("{} {n}", n.word()));
        // Nothing has weight here; whoever names a rig means to go there next.
        let on_rig = scenario.hil.rig.is_some().then(|| on_its_rig(&scenario).ok()).flatten();
        on_rig.as_ref().and_then(sag_flag).iter().for_each(|l| eprintln!("{l}"));
    }
    let options = RehearsalOptions { twin: args.twin.kind(), seed: args.seed };
    let rehearsal = Rehearsal::with(&scenario, options)?;
    let mut live = args.live.start(&scenario, &columns_for(&scenario.mechanism))?;
    let out = directory(args.out.as_deref(), "runs", &scenario.name)?;
    // Last: from here on the terminal is the pilot's.
    let pilot = args.pilot.start(&scenario)?;
    let stick = pilot.as_ref().and_then(|p| p.stick());
    let viewer = (!args.no_rrd).then(|| ViewerFile::new(out.join("run.rrd")));
    let line = stick.as_ref().filter(|_| !json).map(|_| PilotLine::default());
    let mut sink = (RunDirectory::new(&out), (viewer, (&mut live, line)));
    let mut bar = Bar::new(json || stick.is_some());
    let summary = rehearsal.run_with(&mut sink, (stick, Interrupt::catch()), &mut bar)?;
    drop(pilot);
    tell_losses(&summary, json);
    if json {
        // A summary always serialises; a defect would show as an empty object.
        println!("{}", serde_json::to_value(&summary).unwrap_or_default());
    } else {
        live.iter().for_each(tell_live);
        print(&summary, scenario.expect.outcome, &out);
        println!("Replay it with: docktwin replay {}", out.display());
    }
    Ok(ExitCode::from(if summary.verdict == Verdict::Pass { 0 } else { OTHERWISE }))
}

/// Says on stderr what a recording lacks.
pub(crate) fn tell_losses(summary: &Summary, json: bool) {
    let lost = summary.recording.as_ref().is_none_or(|r| r.error.is_some());
    if lost && !json {
        let why = summary.failure_reason.as_deref().unwrap_or("it could not be closed");
        eprintln!("the recording is not complete: {why}");
    }
}

pub(crate) fn print(s: &Summary, expected: ExpectedOutcome, out: &Path) {
    let seconds = |t: Option<f64>| t.map_or("–".to_owned(), |t| format!("{t:.3} s"));
    println!("{}: {} ({})", s.scenario, s.outcome, s.verdict);
    if let Some(reason) = &s.failure_reason {
        println!("  because        {reason}");
    }
    println!("  expected       {expected}");
    s.warnings.iter().for_each(|w| println!("  warning        {w}"));
    if !s.not_judged.is_empty() {
        println!("  not judged     {}", s.not_judged.join(", "));
    }
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
    let net = s.net_impulse_ns.map_or(String::new(), |n| format!(", net {n:.2} N·s"));
    println!("  impulse        {:.2} N·s{net}", s.impulse_ns);
    let account = s.energy_balance_error;
    let account =
        if account.is_nan() { String::new() } else { format!(", account off by {account:.1e}") };
    println!(
        "  energy         {:.3} J in, {:.3} J dissipated{account}",
        s.energy_in_j, s.energy_dissipated_j
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
