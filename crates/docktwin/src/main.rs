//! The command line of docktwin: arguments become options, options a call of a library, its result files
//! and words.

// First: its macros are for all below.
#[macro_use]
mod terminal;

mod analyze;
mod args;
mod check;
mod cli;
mod company;
mod diff;
mod doctor;
mod export;
mod failure;
mod hil;
mod inputs;
mod observers;
mod recover;
mod rehearse;
mod replay;
mod report;
mod results;
mod rig;
mod validate;
mod view;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    // Paths and keys stay whole, so that they can be searched for and copied. Only a second hook
    // would be refused.
    let _ = miette::set_hook(Box::new(|_| {
        Box::new(miette::MietteHandlerOpts::new().wrap_lines(false).break_words(false).build())
    }));
    // A panic is a defect of ours and has its own exit code; the panic hook has told where.
    match std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| cli.run())) {
        // A result that nobody can read is none.
        Ok(Ok(code)) if code == ExitCode::SUCCESS && terminal::lost() => {
            ExitCode::from(failure::OTHERWISE)
        }
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
