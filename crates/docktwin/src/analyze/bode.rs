//! `analyze bode`: frequency response of the running rig, its linear model laid over it, and whether
//! the requirements hold.

use std::process::ExitCode;

use clap::{Args, ValueEnum};
use docktwin_report::study::bode as report;
use docktwin_study::rig::{BodeOptions, Dof, LegControl, Payload, Places, bode};

use super::rig::{RigArgs, build, load_and_change};
use crate::{
    args::AxisArg,
    failure::Failure,
    results::{Bars, Results},
};

pub(super) const EXAMPLES: &str = "\
One degree of freedom of the port is driven by a repeated swept sine on the running, nonlinear
rig, its control, friction and dead time included, and all six are measured. Required: at 10 Hz
at most 2 dB and 70 degrees; from 0.5 to 5 Hz |G| within 10 % (stiff: 5 %) and at most 0.15 in
other degrees of freedom; modal damping of at least 0.1. Rotations count at the radius of the
plate joints.

What is measured is where --places says; the linear model covers the middle and all 64 corners,
and takes the legs of a drawn rig to be as the first one. On two cores `middle` takes 20
seconds, `sample` (and five corners) two minutes, `all` (and 64 corners) 20 minutes; one payload
takes a third of it.

Keys of --set: position_gain_1_s, damping_ratio (of pressure feedback at 2500 kg), high_pass_hz,
valve_lead_hz (0: none), rate_hz, dead_time_s.

The directory holds bode.csv, poles.csv, bode_DOF.svg (Fig. 39 and 40 of the paper) and
bode.json (what --json prints).

Examples:
  docktwin analyze bode models/urdf/stewart.toml --dof x --dof y
  docktwin analyze bode models/urdf/stewart.toml --preset stiff --places sample --payload none
  docktwin analyze bode models/urdf/stewart.toml --seed 7 --set position_gain_1_s=20 --json";

/// Options of `analyze bode`.
#[derive(Debug, Args)]
pub(crate) struct BodeArgs {
    #[command(flatten)]
    rig: RigArgs,
    /// Where in the docking workspace to measure
    #[arg(long, value_enum, default_value_t = PlacesArg::Middle)]
    places: PlacesArg,
    /// Spring of 1e6 N/m at the port
    #[arg(long, value_enum, default_value_t = PayloadArg::All)]
    payload: PayloadArg,
    /// Degree of freedom to drive, repeatable [default: all]
    #[arg(long, value_enum)]
    dof: Vec<AxisArg>,
    /// Amplitude, mm; of a rotation at the radius of the plate joints
    #[arg(long, value_name = "MM", default_value_t = 2.0, value_parser = amplitude_mm)]
    amplitude_mm: f64,
    /// Override a setting of the leg control, repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Give the wanted motion ahead by the valve's delay, as a predictor knows it
    #[arg(long)]
    foreseen: bool,
    /// Leave out friction, null bias and orifice: the linear range
    #[arg(long)]
    ideal: bool,
}

fn amplitude_mm(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x <= 50.0 => Ok(x),
        _ => Err("an amplitude is a number of millimetres above 0, at most 50".to_owned()),
    }
}

/// Where in the docking workspace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PlacesArg {
    /// Its middle
    Middle,
    /// Its middle and five corners
    Sample,
    /// Its middle and all 64 corners
    All,
}

/// What the plate touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PayloadArg {
    /// Nothing
    None,
    /// A spring along X
    Axial,
    /// A spring along Y
    Lateral,
    /// One after the other
    All,
}

/// What the arguments ask for.
fn options(args: &BodeArgs, leg_control: LegControl) -> BodeOptions {
    let dofs: Vec<Dof> = args.dof.iter().map(|d| Dof::ALL[d.axis().index()]).collect();
    BodeOptions {
        build: build(&args.rig),
        places: match args.places {
            PlacesArg::Middle => Places::Middle,
            PlacesArg::Sample => Places::Sample,
            PlacesArg::All => Places::All,
        },
        payloads: match args.payload {
            PayloadArg::None => vec![Payload::None],
            PayloadArg::Axial => vec![Payload::Axial],
            PayloadArg::Lateral => vec![Payload::Lateral],
            PayloadArg::All => Payload::ALL.to_vec(),
        },
        dofs: if dofs.is_empty() { Dof::ALL.to_vec() } else { dofs },
        amplitude_m: args.amplitude_mm * 1e-3,
        leg_control,
        foreseen: args.foreseen,
        linear_range: args.ideal,
    }
}

/// Runs the command.
pub(super) fn run(args: &BodeArgs, json: bool) -> Result<ExitCode, Failure> {
    let (rig, changes) = load_and_change(&args.rig, &args.set, json)?;
    let mut out = Results::new(args.rig.out.as_deref(), &format!("{}-bode", rig.name))?;
    let found = bode(&rig, &options(args, changes), &mut Bars::new(json))?;
    out.tables(report::tables(&found, &rig.docking))?;
    out.plots(report::plots(&found))?;
    out.finish("bode", &found.summary, &report::words(&found), json)
}
