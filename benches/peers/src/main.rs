//! docktwin's half of the comparison with other engines: a docking, or the motion simulator's platform,
//! with one twin and one step, nothing recorded; prints as one line of JSON what it cost and what came
//! out.
//!
//! Cost is processor time of the one thread that steps, from the operating system, so that a busy
//! machine disturbs less than with a clock on the wall. Phases of a docking: `free` until first
//! contact, `contact` until the first latch (or the end), `whole`.

mod platform;

use std::{path::PathBuf, process::ExitCode};

use clap::{Parser, ValueEnum};
use cpu_time::ThreadTime;
use docktwin_physics::{mechanism::System, reduced::DockingState};
use docktwin_run::{
    TickedTwin, TwinKind,
    setup::{inputs, start},
};
use docktwin_scenario::{Scenario, load_scenario};
use serde_json::{Value, json};

/// Computes without recording and tells cost and result
#[derive(Debug, Parser)]
enum Command {
    /// Runs a scenario
    Docking(Args),
    /// Moves the motion simulator's platform
    #[command(subcommand)]
    Platform(platform::Command),
}

#[derive(Debug, clap::Args)]
struct Args {
    /// Scenario file
    scenario: PathBuf,
    /// Which twin
    #[arg(long, value_enum, default_value_t = Kind::Reduced)]
    twin: Kind,
    /// Physics step, ms; whole steps must fit into a tick
    #[arg(long, default_value_t = 0.2)]
    step_ms: f64,
    /// Simulated time to run, s; the scenario's by default
    #[arg(long)]
    until_s: Option<f64>,
    /// Time between two poses in the result, s
    #[arg(long, default_value_t = 0.01)]
    sample_s: f64,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    Full,
    Reduced,
}

fn main() -> ExitCode {
    let out = match Command::parse() {
        Command::Docking(args) => docking(&args),
        Command::Platform(command) => platform::run(&command),
    };
    match out {
        Ok(out) => {
            println!("{out}");
            ExitCode::SUCCESS
        }
        Err(why) => {
            eprintln!("{why}");
            ExitCode::from(2)
        }
    }
}

fn docking(args: &Args) -> Result<Value, String> {
    let scenario = load_scenario(&args.scenario, &[]).map_err(|e| e.to_string())?;
    #[expect(clippy::cast_precision_loss, reason = "a tick is far below 2^53 ns")]
    let tick_s = scenario.run.tick_nanos as f64 / 1e9;
    let per_tick = (tick_s * 1e3 / args.step_ms).round().max(1.0);
    if (per_tick * args.step_ms / (tick_s * 1e3) - 1.0).abs() > 1e-9 {
        return Err(format!(
            "a step of {} ms does not divide the tick of {} ms; give a whole part of it",
            args.step_ms,
            tick_s * 1e3
        ));
    }
    let (system, bodies) = start(&scenario).map_err(|e| e.to_string())?;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small, ≥ 1")]
    let per_tick = per_tick as u32;
    let kind = match args.twin {
        Kind::Full => TwinKind::Full,
        Kind::Reduced => TwinKind::Reduced,
    };
    let twin = TickedTwin::new(kind, system, bodies, scenario.run.tick_nanos, per_tick);
    Ok(run(twin, &scenario, args, tick_s))
}

/// Steps alone are timed: a rehearsal would look at every tick as well.
fn run(mut ticked: TickedTwin, scenario: &Scenario, args: &Args, tick_s: f64) -> Value {
    let until = args.until_s.unwrap_or(scenario.run.ticks() as f64 * tick_s);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "times of a run")]
    let (ticks, every) =
        ((until / tick_s).round() as u64, (args.sample_s / tick_s).round().max(1.0) as u64);
    let clock = ThreadTime::now();
    let now = || clock.elapsed().as_secs_f64();
    let (mut first, mut latch) = (None, None);
    let mut spent = 0.0;
    let mut poses = Vec::new();
    let mut begin = now();
    for tick in 0..ticks {
        if tick % every == 0 {
            // Looking at the result is not part of the cost.
            spent += now() - begin;
            let twin = ticked.twin();
            let state = twin.state();
            poses.push(relative(twin.system(), &state));
            if first.is_none() && state.first_contact_s.is_some() {
                first = Some((tick, spent));
            }
            if latch.is_none() && state.mechanism.latches.iter().any(|l| l.times_s[2].is_some()) {
                latch = Some((tick, spent));
            }
            begin = now();
        }
        #[expect(clippy::cast_precision_loss, reason = "far below 2^53")]
        let time_s = tick as f64 * tick_s;
        let control = if scenario.thrusts.is_empty() {
            docktwin_physics::reduced::Inputs::default()
        } else {
            inputs(&scenario.thrusts, &ticked.twin().state(), time_s)
        };
        ticked.tick(&control);
    }
    spent += now() - begin;
    let state = ticked.twin().state();
    let end = (ticks, spent);
    let phase = |from: (u64, f64), to: (u64, f64)| {
        #[expect(clippy::cast_precision_loss, reason = "far below 2^53")]
        let sim_s = (to.0 - from.0) as f64 * tick_s;
        json!({ "sim_s": sim_s, "cpu_s": to.1 - from.1 })
    };
    let first = first.unwrap_or(end);
    let latch = latch.unwrap_or(end);
    json!({
        "engine": "docktwin",
        "twin": match args.twin { Kind::Full => "full", Kind::Reduced => "reduced" },
        "step_s": ticked.step_s(),
        "phases": {
            "free": phase((0, 0.0), first),
            "contact": phase(first, latch),
            "whole": phase((0, 0.0), end),
        },
        "first_contact_s": state.first_contact_s,
        "latches_s": state.mechanism.latches.map(|l| l.times_s[2]),
        "capture_s": state.mechanism.captured_s(),
        "peak_force_n": state.peak_force_n,
        "impulse_ns": state.impulse_ns,
        "sample_s": args.sample_s,
        "poses": poses,
    })
}

/// Pose of `e4` in `e3`: x, y, z (m), then the quaternion x, y, z, w.
fn relative(system: &System, state: &DockingState) -> [f64; 7] {
    let p = system.poses(&state.poses());
    let x = p.x_w3.inverse() * p.x_w4;
    let [i, j, k, w] = x.q.to_array();
    [x.p.x, x.p.y, x.p.z, i, j, k, w]
}
