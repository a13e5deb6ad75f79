//! `report`: one page of a run.

use std::process::ExitCode;

use docktwin_report::write;

use crate::{
    cli::ReportArgs,
    failure::{Failure, OTHERWISE},
};

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
