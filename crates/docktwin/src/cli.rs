//! What can be typed, and which module answers.

use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};

use crate::{
    analyze, check, diff, doctor, export, failure::Failure, hil, recover, rehearse, replay, report,
    rig, validate, view,
};

/// Digital twin of spacecraft docking: rehearse a docking from a scenario file, look at its
/// contacts, replay it bit by bit.
#[derive(Debug, Parser)]
#[command(name = "docktwin", version, max_term_width = 100, after_help = EXAMPLES)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(subcommand)]
    pub(crate) command: Command,
}

const EXAMPLES: &str = "\
Examples:
  docktwin rehearse scenarios/apas_nominal.toml
  docktwin rehearse scenarios/apas_fast.toml --set initial.lateral_y_m=0.1 --out runs/wide
  docktwin replay runs/wide
  docktwin scenario explain initial.gap_m

Exit codes: 0 the run ended as its `expect` says; 1 it ended otherwise; 2 bad input or usage;
3 the supervisor stopped the rig, and that was not expected; 70 a defect of docktwin.";

/// Options of every command.
#[derive(Debug, Args)]
pub(crate) struct Common {
    /// Print the result as JSON on stdout, and nothing else there
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Rehearse a docking with the twin alone, as fast as possible
    #[command(after_help = rehearse::EXAMPLES)]
    Rehearse(rehearse::RehearseArgs),
    /// Close the loop around a rig, emulated or real, in virtual or in real time
    #[command(after_help = hil::EXAMPLES)]
    Hil(hil::HilArgs),
    /// Check the files of a model, or explain their keys
    #[command(subcommand)]
    Model(check::ModelCommand),
    /// Check a scenario, or explain its keys
    #[command(subcommand)]
    Scenario(check::ScenarioCommand),
    /// Compare two recordings: bit by bit, or within tolerances
    #[command(after_help = diff::EXAMPLES)]
    Diff(diff::DiffArgs),
    /// Write a recording as CSV or as a MATLAB file
    #[command(after_help = export::EXAMPLES)]
    Export(export::ExportArgs),
    /// Make the files of a run whole after its process or its disk died
    #[command(after_help = recover::EXAMPLES)]
    Recover(recover::RecoverArgs),
    /// Run a recording again, tick by tick, and say where it first differs
    #[command(after_help = replay::EXAMPLES)]
    Replay(replay::ReplayArgs),
    /// Open a run, or two laid over each other, in the rerun viewer
    #[command(after_help = view::EXAMPLES)]
    View(view::ViewArgs),
    /// Analyse a design, without a docking
    #[command(subcommand)]
    Analyze(analyze::AnalyzeCommand),
    /// Write one self-contained HTML page of a run: verdict, pictures, plots, contacts in words
    #[command(after_help = report::EXAMPLES)]
    Report(report::ReportArgs),
    /// What this machine offers a real-time loop, each shortfall with what mends it
    #[command(after_help = doctor::EXAMPLES)]
    Doctor(doctor::DoctorArgs),
    /// Emulate a rig, calibrate it, identify it
    #[command(subcommand)]
    Rig(rig::RigCommand),
    /// Hold docktwin against something else
    #[command(subcommand)]
    Validate(validate::ValidateCommand),
}

impl Cli {
    /// Runs the command.
    pub(crate) fn run(&self) -> Result<ExitCode, Failure> {
        let json = self.common.json;
        match &self.command {
            Command::Rehearse(args) => rehearse::run(args, json),
            Command::Hil(args) => hil::run(args, json),
            Command::Model(command) => check::model(command, json),
            Command::Scenario(command) => check::scenario(command, json),
            Command::Diff(args) => diff::run(args, json),
            Command::Export(args) => export::run(args, json),
            Command::Recover(args) => recover::run(args, json),
            Command::Replay(args) => replay::run(args, json),
            Command::View(args) => view::run(args, json),
            Command::Analyze(command) => analyze::run(command, json),
            Command::Report(args) => report::run(args, json),
            Command::Doctor(args) => doctor::run(args, json),
            Command::Rig(command) => rig::run(command, json),
            Command::Validate(command) => validate::run(command, json),
        }
    }
}
