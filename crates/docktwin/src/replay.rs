//! `replay`: the recorded inputs through the same twin, compared tick by tick.

use std::process::ExitCode;

use docktwin_run::{Replay, Replayed};
use serde_json::json;

use crate::{
    cli::ReplayArgs,
    failure::{Failure, OTHERWISE},
};

/// Runs the command.
pub(crate) fn run(args: &ReplayArgs, as_json: bool) -> Result<ExitCode, Failure> {
    let found = Replay::open(&args.run)?.run()?;
    let Replayed { ticks, signals, unknown, cut, first_difference } = found;
    let same = first_difference.is_none();
    if as_json {
        let difference = first_difference.map(|d| {
            json!({
                "tick": d.tick, "time_s": d.time_s, "signal": d.signal,
                "recorded": d.recorded, "replayed": d.replayed,
            })
        });
        println!(
            "{}",
            json!({
                "identical": same, "ticks": ticks, "signals": signals,
                "first_difference": difference, "not_compared": unknown, "cut": cut,
            })
        );
    } else {
        if let Some(cut) = &cut {
            eprintln!("the recording is cut: {cut}");
        }
        if !unknown.is_empty() {
            eprintln!("not compared, this version does not know them: {}", unknown.join(", "));
        }
        match first_difference {
            None => println!("identical: {ticks} ticks, every bit of {signals} signals the same"),
            Some(d) => println!(
                "differs first at tick {} (t = {:.3} s), {}: recorded {}, replayed {}",
                d.tick, d.time_s, d.signal, d.recorded, d.replayed
            ),
        }
    }
    Ok(ExitCode::from(if same { 0 } else { OTHERWISE }))
}
