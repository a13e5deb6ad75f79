//! `recover`: a run directory made whole after a crash.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use docktwin_record::recover;
use serde_json::json;

use crate::failure::{Failure, OTHERWISE};

pub(crate) const EXAMPLES: &str = "\
run.mcap is written anew with index and end mark from all chunks that can be read, those behind
damage too; events.jsonl and telemetry.parquet are completed from it, and never replaced by shorter
ones. What is replaced stays beside it as run.mcap.cut, events.jsonl.cut and telemetry.parquet.cut.
Rows that do not fit their digest are left out. A whole recording is left alone.

Examples:
  docktwin recover runs/apas_nominal-20261122T101500Z
  docktwin recover runs/wide --json

Exit codes: 0 whole, or readable up to where it was cut; 1 ticks are missing between others, or
summary.json or a model is not that of the run; 2 bad input or usage.";

/// Options of `recover`.
#[derive(Debug, Args)]
pub(crate) struct RecoverArgs {
    /// Run directory
    run: PathBuf,
}

/// Runs the command.
pub(crate) fn run(args: &RecoverArgs, json: bool) -> Result<ExitCode, Failure> {
    let done = recover(&args.run)?;
    let exit = ExitCode::from(if done.as_recorded() { 0 } else { OTHERWISE });
    let kept: Vec<String> = done.kept.iter().map(|p| p.display().to_string()).collect();
    if json {
        println!(
            "{}",
            json!({
                "changed": done.changed(),
                "ticks": done.ticks,
                "last_s": done.last.map(|(_, t)| t.seconds()),
                "events": done.events,
                "cut": done.cut.as_ref().map(ToString::to_string),
                "holes": done.holes.iter().map(|h| {
                    json!({ "after_tick": h.after, "before_tick": h.before, "why": h.why })
                }).collect::<Vec<_>>(),
                "unverified_ticks": done.unverified,
                "log_rewritten": done.log_rewritten,
                "notes": done.notes,
                "events_rewritten": done.events_rewritten,
                "table_rewritten": done.table_rewritten,
                "kept": kept,
            })
        );
        return Ok(exit);
    }
    let until = done.last.map_or(String::new(), |(_, t)| format!(" up to {:.3} s", t.seconds()));
    if let Some(cut) = &done.cut {
        println!("{cut}");
    }
    done.holes.iter().for_each(|h| println!("  hole           {h}"));
    if done.unverified > 0 {
        println!("  unverified     {} ticks beside holes have lost their digest", done.unverified);
    }
    done.notes.iter().for_each(|n| println!("  note           {n}"));
    if !done.changed() {
        let whole = if done.as_recorded() { "whole: " } else { "" };
        println!("{whole}{} ticks{until}, {} events; nothing to mend", done.ticks, done.events);
        return Ok(exit);
    }
    println!("recovered {} ticks{until}, {} events", done.ticks, done.events);
    for (changed, name) in [
        (done.log_rewritten, "run.mcap"),
        (done.events_rewritten, "events.jsonl"),
        (done.table_rewritten, "telemetry.parquet"),
    ] {
        if changed {
            println!("  written anew   {name}");
        }
    }
    kept.iter().for_each(|k| println!("  kept           {k}"));
    Ok(exit)
}
