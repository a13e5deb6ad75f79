//! `recover`: a run directory made whole after a crash.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use docktwin_record::recover;
use serde_json::json;

use crate::failure::Failure;

pub(crate) const EXAMPLES: &str = "\
run.mcap is written anew with index and end mark up to its last whole chunk, events.jsonl and
telemetry.parquet are completed from it. What is replaced stays beside it as run.mcap.cut and
events.jsonl.cut. A whole recording is left alone.

Examples:
  docktwin recover runs/apas_nominal-20261122T101500Z
  docktwin recover runs/wide --json";

/// Options of `recover`.
#[derive(Debug, Args)]
pub(crate) struct RecoverArgs {
    /// Run directory
    run: PathBuf,
}

/// Runs the command.
pub(crate) fn run(args: &RecoverArgs, json: bool) -> Result<ExitCode, Failure> {
    let done = recover(&args.run)?;
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
                "events_rewritten": done.events_rewritten,
                "table_rewritten": done.table_rewritten,
                "kept": kept,
            })
        );
        return Ok(ExitCode::SUCCESS);
    }
    let until = done.last.map_or(String::new(), |(_, t)| format!(" up to {:.3} s", t.seconds()));
    if !done.changed() {
        println!("whole: {} ticks{until}, {} events; nothing to mend", done.ticks, done.events);
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(cut) = &done.cut {
        println!("{cut}");
    }
    println!("recovered {} ticks{until}, {} events", done.ticks, done.events);
    for (changed, name) in [
        (done.cut.is_some(), "run.mcap"),
        (done.events_rewritten, "events.jsonl"),
        (done.table_rewritten, "telemetry.parquet"),
    ] {
        if changed {
            println!("  written anew   {name}");
        }
    }
    kept.iter().for_each(|k| println!("  kept           {k}"));
    Ok(ExitCode::SUCCESS)
}
