//! `report`: one page of a run.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use docktwin_report::write;

use crate::failure::{Failure, OTHERWISE};

pub(crate) const EXAMPLES: &str = "\
The page needs nothing but itself: no network, no script. It is also written of what is left of a run
that was killed, and then says so first. An existing page is replaced.

Examples:
  docktwin report runs/wide
  docktwin report runs/wide --out wide.html
  docktwin report runs/wide --json";

/// Options of `report`.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// Run directory
    run: PathBuf,
    /// Where the page goes; by default into the run directory.
    #[arg(long, value_name = "FILE", help = "Where the page goes [default: RUN/report.html]")]
    out: Option<PathBuf>,
}

/// Runs `report`.
pub(crate) fn run(args: &ReportArgs, json: bool) -> Result<ExitCode, Failure> {
    let out = args.out.clone().unwrap_or_else(|| args.run.join("report.html"));
    let written = write(&args.run, &out)?;
    if json {
        println!(
            "{}",
            serde_json::json!({
                "path": written.path.display().to_string(),
                "bytes": written.bytes,
                "incomplete": written.incomplete,
                "as_recorded": written.as_recorded,
            })
        );
    } else {
        if let Some(why) = &written.incomplete {
            println!("incomplete run: {why}");
        }
        if !written.as_recorded {
            println!("this is not what was recorded; the page says first what differs");
        }
        println!("{} ({} kB)", written.path.display(), written.bytes.div_ceil(1000));
    }
    Ok(ExitCode::from(if written.as_recorded { 0 } else { OTHERWISE }))
}
