//! The command line of docktwin: the only place where twin, record and view meet.

mod cli;
mod commands;
mod failure;
mod rehearse;
mod replay;
mod report;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    // A panic is a defect of ours and has its own exit code; the panic hook has told where.
    match std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| commands::run(&cli))) {
        Ok(Ok(code)) => code,
        Ok(Err(failure)) => failure.report(cli.common.json),
        Err(_) => {
            eprintln!(
                "this is a defect of docktwin; please report it with the command and its files"
            );
            ExitCode::from(failure::DEFECT)
        }
    }
}
