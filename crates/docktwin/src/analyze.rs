//! `analyze`: what a design does, without a docking: the mechanism on a test bench, and the maps and
//! responses of a rig.

mod bode;
mod frequency;
mod mechanism;
mod rig;
mod stability;
mod stiffness;
mod workspace;

use std::process::ExitCode;

use clap::Subcommand;

use crate::failure::Failure;

/// `analyze …`.
#[derive(Debug, Subcommand)]
pub(crate) enum AnalyzeCommand {
    /// Put the mechanism on a test bench: force over displacement on every axis, coupling, contact
    #[command(after_help = mechanism::EXAMPLES)]
    Mechanism(mechanism::MechanismArgs),
    /// Where a rig reaches: does the docking workspace fit, tolerance, range and payload
    #[command(after_help = workspace::EXAMPLES)]
    Workspace(rig::RigArgs),
    /// Natural frequency of a rig per degree of freedom over its docking workspace
    #[command(after_help = frequency::EXAMPLES)]
    Frequency(rig::RigArgs),
    /// Frequency response of the running rig by swept sine, its linear model laid over it
    #[command(after_help = bode::EXAMPLES)]
    Bode(bode::BodeArgs),
    /// Which contacts can be tested on a rig, with each method against the delay
    #[command(after_help = stability::EXAMPLES)]
    Stability(stability::StabilityArgs),
    /// How the closed loop of a rig moves with the stiffness of its payload, 0 to 1e6 N/m
    #[command(after_help = stiffness::EXAMPLES)]
    Stiffness(stiffness::StiffnessArgs),
}

/// Runs the command.
pub(crate) fn run(command: &AnalyzeCommand, json: bool) -> Result<ExitCode, Failure> {
    match command {
        AnalyzeCommand::Mechanism(args) => mechanism::run(args, json),
        AnalyzeCommand::Workspace(args) => workspace::run(args, json),
        AnalyzeCommand::Frequency(args) => frequency::run(args, json),
        AnalyzeCommand::Bode(args) => bode::run(args, json),
        AnalyzeCommand::Stability(args) => stability::run(args, json),
        AnalyzeCommand::Stiffness(args) => stiffness::run(args, json),
    }
}
