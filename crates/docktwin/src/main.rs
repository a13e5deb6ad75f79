//! The command line of docktwin: the only place where twin, record and view meet.

mod cli;
mod commands;
mod diff;
mod export;
mod failure;
mod models;
mod recover;
mod rehearse;
mod replay;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    // `println!` panics when standard output is full or closed, which is no defect: said in one line.
    let tell = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        if closed_output(info.payload()).is_none() {
            tell(info);
        }
    }));
    // A panic is a defect of ours and has its own exit code; the panic hook has told where.
    match std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| commands::run(&cli))) {
        Ok(Ok(code)) => code,
        Ok(Err(failure)) => failure.report(cli.common.json),
        Err(payload) if closed_output(&*payload).is_some() => {
            // Who closes a pipe, such as `head`, has read enough and wants no complaint.
            if let Some(why) = closed_output(&*payload).filter(|w| !w.contains("Broken pipe")) {
                eprintln!(
                    "{why}; the result is in summary.json of the run directory, if there is one"
                );
            }
            ExitCode::from(failure::OTHERWISE)
        }
        Err(_) => {
            eprintln!(
                "this is a defect of docktwin; please report it with the command and its files"
            );
            ExitCode::from(failure::DEFECT)
        }
    }
}

/// The words of `println!` when standard output cannot be written to.
fn closed_output(payload: &(dyn std::any::Any + Send)) -> Option<&str> {
    payload
        .downcast_ref::<String>()
        .map(String::as_str)
        .filter(|w| w.starts_with("failed printing to"))
}
