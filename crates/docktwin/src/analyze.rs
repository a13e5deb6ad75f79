//! `analyze`: what a design does, without a docking: the mechanism on a test bench, and the maps and
//! responses of a rig.

mod bode;
mod frequency;
pub(crate) mod mechanism;
pub(crate) mod plots;
mod rig;
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
        AnalyzeCommand::Stiffness(args) => stiffness::run(args, json),
    }
}

/// A number with three digits and its unit, in the unit's usual multiple.
fn say(x: f64, unit: &str) -> String {
    let digits = |v: f64| match v.abs() {
        a if a >= 99.95 => format!("{v:.0}"),
        a if a >= 9.995 => format!("{v:.1}"),
        a if a >= 0.9995 => format!("{v:.2}"),
        _ => format!("{v:.3}"),
    };
    match unit {
        "m" => format!("{} mm", digits(x * 1e3)),
        "rad" => format!("{} deg", digits(x.to_degrees())),
        _ if x.abs() >= 1e4 => format!("{x:.2e} {unit}"),
        _ if x.abs() < 5e-4 => format!("0 {unit}"),
        _ => format!("{} {unit}", digits(x)),
    }
}

#[cfg(test)]
mod tests {
    use super::say;

    #[test]
    fn oracle_numbers_are_told_with_three_digits() {
        assert_eq!(say(0.1234, "m"), "123 mm");
        assert_eq!(say(-0.000_95, "m"), "-0.950 mm");
        assert_eq!(say(0.174_532_9, "rad"), "10.0 deg");
        assert_eq!(say(3e5, "N/m"), "3.00e5 N/m");
        assert_eq!(say(1e-7, "N"), "0 N");
        assert_eq!(say(800.04, "N/m"), "800 N/m");
    }
}
