//! The command line of docktwin: the only place where twin, record and view meet.

mod cli;
mod commands;
mod failure;
mod rehearse;
mod replay;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    match commands::run(&cli) {
        Ok(code) => code,
        Err(failure) => failure.report(cli.common.json),
    }
}
