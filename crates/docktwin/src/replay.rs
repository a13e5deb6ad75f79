//! `replay`: the recorded inputs through the same twin, compared tick by tick.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use docktwin_run::{Replay, Replayed};
use serde_json::json;

use crate::failure::{Failure, OTHERWISE};

pub(crate) const EXAMPLES: &str = "\
The recorded control wrenches are fed to the same twin from the same start; every recorded signal is
compared at every tick, bit by bit.

Examples:
  docktwin replay runs/apas_nominal-20261122T101500Z
  docktwin replay runs/wide --json";

/// Options of `replay`.
#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// Run directory
    run: PathBuf,
}

/// Runs the command.
pub(crate) fn run(args: &ReplayArgs, as_json: bool) -> Result<ExitCode, Failure> {
    let found = Replay::open(&args.run)?.run()?;
    let same = found.identical();
    let Replayed {
        ticks,
        signals,
        unknown,
        cut,
        first_difference,
        summary_difference,
        figures,
        not_as_recorded,
    } = found;
    if as_json {
        let difference = first_difference.map(|d| {
            json!({
                "tick": d.tick, "time_s": d.time_s, "signal": d.signal,
                "recorded": d.recorded, "replayed": d.replayed,
            })
        });
        let summary = summary_difference
            .map(|d| json!({ "key": d.key, "recorded": d.recorded, "replayed": d.replayed }));
        println!(
            "{}",
            json!({
                "identical": same, "ticks": ticks, "signals": signals,
                "first_difference": difference, "not_compared": unknown, "cut": cut,
                "not_as_recorded": not_as_recorded,
                "summary_difference": summary, "summary_figures": figures,
            })
        );
        return Ok(ExitCode::from(if same { 0 } else { OTHERWISE }));
    }
    if let Some(cut) = &cut {
        eprintln!("the recording is cut or damaged: {cut}");
    }
    if !unknown.is_empty() {
        eprintln!("not compared, this version does not know them: {}", unknown.join(", "));
    }
    match (first_difference, summary_difference) {
        (Some(d), _) => println!(
            "differs first at tick {} (t = {:.3} s), {}: recorded {}, replayed {}",
            d.tick, d.time_s, d.signal, d.recorded, d.replayed
        ),
        (None, Some(d)) => println!(
            "every bit of {signals} signals is the same in {ticks} ticks, but summary.json differs: \
             {} is {}, replayed {}",
            d.key, d.recorded, d.replayed
        ),
        (None, None) if not_as_recorded => println!(
            "not what was recorded, although {ticks} ticks of {signals} signals come out the same"
        ),
        (None, None) => {
            println!("identical: {ticks} ticks, every bit of {signals} signals the same");
            if figures > 0 {
                println!("{figures} figures of summary.json follow from them");
            }
        }
    }
    Ok(ExitCode::from(if same { 0 } else { OTHERWISE }))
}
