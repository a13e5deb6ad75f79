//! `doctor`: what this machine offers a real-time loop.

use std::process::ExitCode;

use clap::Args;
use docktwin_hil::machine::{
    Check, Measured, NoCyclictest, PERIOD_NS, Shortfall, State, cyclictest, examine, measure,
    micros,
};
use docktwin_view::VIEWER_VERSION;
use serde_json::{Value, json};

use crate::{
    failure::{Failure, OTHERWISE},
    view::Viewer,
};

pub(crate) const EXAMPLES: &str = "\
A loop of 1 kHz that does nothing is run for the given time, with the priority and the locked
memory that a real one asks for, and how late it wakes up is measured; then cyclictest for as long,
where it is installed (sudo apt install rt-tests).

Exit codes: 0 a loop can run in real time; 1 only as best effort (`--allow-best-effort`).

Examples:
  docktwin doctor
  docktwin doctor --seconds 60          the rare late wake-ups too
  sudo docktwin doctor                  what more rights would give
  docktwin doctor --json";

/// Options of `doctor`.
#[derive(Debug, Args)]
pub(crate) struct DoctorArgs {
    /// How long to measure, s
    #[arg(
        long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=3600)
    )]
    seconds: u32,
}

/// Runs the command.
pub(crate) fn run(args: &DoctorArgs, json: bool) -> Result<ExitCode, Failure> {
    if !json {
        eprintln!("measuring for {} s …", args.seconds);
    }
    let measured = measure(args.seconds).map_err(|e| Failure::Usage {
        what: e.to_string(),
        remedy: "close other programs, then measure again".to_owned(),
    })?;
    let cyclic = cyclictest(args.seconds, &measured.report);
    let mut checks = examine(&measured);
    checks.push(viewer());
    let best_effort = checks.iter().any(|c| c.state == State::Lacking);
    let code = if best_effort { OTHERWISE } else { 0 };
    if json {
        println!("{}", as_json(&checks, &measured, &cyclic, best_effort, code));
    } else {
        checks.iter().for_each(print);
        print_wakeups(&measured, &cyclic);
        println!("{}", verdict(best_effort));
    }
    Ok(ExitCode::from(code))
}

fn verdict(best_effort: bool) -> &'static str {
    if best_effort {
        "best effort only: a loop is refused what is lacking above, and runs with --allow-best-effort"
    } else {
        "a loop can run in real time on this machine"
    }
}

fn as_json(
    checks: &[Check],
    measured: &Measured,
    cyclic: &Result<u64, NoCyclictest>,
    best_effort: bool,
    code: u8,
) -> Value {
    let l = &measured.latencies;
    json!({
        "checks": checks.iter().map(check_json).collect::<Vec<_>>(),
        "period_us": micros(PERIOD_NS),
        "wakeup_us": {
            "p50": micros(l.p50_ns), "p99": micros(l.p99_ns), "p999": micros(l.p999_ns),
            "max": micros(l.max_ns), "n": l.n,
        },
        "missed": measured.counts.missed,
        "histogram_us": measured.bars.iter().map(|(to, n)| json!([micros(*to), n])).collect::<Vec<_>>(),
        "cyclictest_p99_us": cyclic.as_ref().ok().map(|ns| micros(*ns)),
        "p99_ratio": cyclic.as_ref().ok().map(|ns| measured.p99_ratio(*ns)),
        "verdict": if best_effort { "best_effort" } else { "real_time" },
        "exit_code": code,
    })
}

fn check_json(c: &Check) -> Value {
    let (cost, remedy) =
        c.shortfall.as_ref().map_or((None, None), |s| (Some(&s.cost), Some(&s.remedy)));
    json!({
        "name": c.name, "state": c.state.word(), "found": c.found,
        "cost": cost, "remedy": remedy,
    })
}

fn print(c: &Check) {
    println!("{:<9} {:<16} {}", c.state.word(), c.name, c.found);
    if let Some(Shortfall { cost, remedy }) = &c.shortfall {
        println!("          {:<16} costs: {cost}", "");
        println!("          {:<16} mend:  {remedy}", "");
    }
}

fn print_wakeups(measured: &Measured, cyclic: &Result<u64, NoCyclictest>) {
    println!("lateness of {} wake-ups at 1 kHz", measured.latencies.n);
    let most = measured.bars.iter().map(|(_, n)| *n).max().unwrap_or(1);
    for (edge, n) in &measured.bars {
        // One mark at least: the rare late ones are what matters.
        let marks = usize::try_from((n * 40).div_ceil(most)).unwrap_or(0);
        println!("  up to {:>7} µs  {n:>8}  {}", edge / 1000, "#".repeat(marks));
    }
    match cyclic {
        Ok(ns) => println!(
            "cyclictest: p99 {:.0} µs (in whole µs); ours is {:.2} times that",
            micros(*ns),
            measured.p99_ratio(*ns)
        ),
        Err(why) => println!("{why}"),
    }
}

fn viewer() -> Check {
    let name = "viewer";
    match Viewer::find(None) {
        Ok(v) => Check::good(name, format!("{} {VIEWER_VERSION}", v.program().display())),
        Err(Failure::Usage { what, remedy }) => Check::short(
            State::Doubtful,
            name,
            what,
            "no picture of a run, live or afterwards",
            remedy.lines().next().unwrap_or_default(),
        ),
        Err(e) => Check::short(State::Doubtful, name, e.to_string(), "no picture of a run", ""),
    }
}
