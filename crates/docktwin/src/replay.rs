//! `replay`: the recorded inputs through the same twin, compared tick by tick.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use docktwin_run::{Replay, Replayed};
use serde_json::json;

use crate::failure::{Failure, OTHERWISE};

pub(crate) const EXAMPLES: &str = "\
The recorded control wrenches are fed to the same twin from the same start; the state digest is
compared at every tick.

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
    let Replayed { ticks, cut, first_difference } = Replay::open(&args.run)?.run()?;
    let same = first_difference.is_none();
    if as_json {
        let difference = first_difference.map(|d| {
            json!({
                "tick": d.tick, "time_s": d.time_s,
                "recorded": format!("{:016x}", d.recorded),
                "replayed": format!("{:016x}", d.replayed),
            })
        });
        println!(
            "{}",
            json!({ "identical": same, "ticks": ticks, "first_difference": difference, "cut": cut })
        );
    } else {
        if let Some(cut) = &cut {
            eprintln!("the recording is cut: {cut}");
        }
        match first_difference {
            None => println!("identical: {ticks} ticks, every state digest the same"),
            Some(d) => println!(
                "differs first at tick {} (t = {:.3} s): recorded {:016x}, replayed {:016x}",
                d.tick, d.time_s, d.recorded, d.replayed
            ),
        }
    }
    Ok(ExitCode::from(if same { 0 } else { OTHERWISE }))
}
