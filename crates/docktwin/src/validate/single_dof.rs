//! `validate single-dof`: the HIL simulation with one degree of freedom (§6.4 of the paper) against
//! the simulated system, in frequency (Fig. 23, 24) and in time (Fig. 25, 26).

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use docktwin_model::{AttenuationChoice, load_mechanism, load_rig};
use docktwin_report::study::single_dof as report;
use docktwin_study::single_dof::{SingleDofOptions, single_dof};

use crate::{
    args::PresetArg,
    failure::{Failure, OTHERWISE},
    inputs::sides,
    results::Results,
};

pub(super) const EXAMPLES: &str = "\
Two spacecraft of 8 t and 12 t (Table 2) on one axis. The simulated system, bodies and mechanism
alone, is integrated finely; the HIL simulation runs at 1 kHz with an interface: one that is
exactly one (G_I = 1); the hydraulic leg of Table 1 with its control, friction, dead time and a
force sensor of 350 Hz; and the same with the motion asked for ahead and the contact force expected
(compensated). Required: with G_I = 1 displacement and force of the docking, in RMS and peak, are
those of the simulated system within 0.1 %, at the worst of eight moments of first touch within a
tick. Where a mechanism's force begins with a large step or it meets its end stop, 1 kHz can be too
slow for that: exit code 1 says so.

The directory holds fig23_interface.svg (Bode of G_I, linear and measured by sines on the running
leg), fig24_loop.svg (Bode of (7) over (6), spring of Table 3), fig25_displacement.svg and
fig26_force.svg (docking with the axial characteristic of the mechanism's file), spring.svg (the
spring of Table 3, joined, at a fifth of the speed), interface.csv, loop.csv, docking.csv,
spring.csv and single-dof.json (what --json prints).

Examples:
  docktwin validate single-dof
  docktwin validate single-dof --preset stiff --out stiff --json
  docktwin validate single-dof --rig mine.toml --mechanism my_active.urdf --speed-m-s 0.2

Exit codes: 0 within the requirement; 1 not; 2 bad input.";

/// Options of `validate single-dof`.
#[derive(Debug, Args)]
pub(crate) struct SingleDofArgs {
    /// TOML or URDF of the rig that has oil, valve and friction of the leg
    #[arg(long, value_name = "FILE", default_value = "models/urdf/stewart.toml")]
    rig: PathBuf,
    /// Oil volume [default: as the file says]
    #[arg(long, value_enum)]
    preset: Option<PresetArg>,
    /// Active side of the mechanism, the passive one beside it
    #[arg(long, value_name = "FILE", default_value = "models/urdf/apas_active.urdf")]
    mechanism: PathBuf,
    /// Closing speed, m/s
    #[arg(long, value_name = "M/S", default_value_t = 0.35, value_parser = speed)]
    speed_m_s: f64,
    /// Directory of the results; by default a new one under `analysis`.
    #[arg(long, value_name = "DIR", help = "Directory [default: analysis/single-dof-<utc>]")]
    out: Option<PathBuf>,
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (0.01..=0.5).contains(&x) => Ok(x),
        _ => Err("a closing speed is 0.01 to 0.5 m/s".to_owned()),
    }
}

/// Runs the command.
pub(super) fn run(args: &SingleDofArgs, json: bool) -> Result<ExitCode, Failure> {
    let rig = load_rig(&args.rig)?;
    if !json {
        rig.notes.iter().for_each(|n| eprintln!("note: {n}"));
    }
    let (active, passive) = sides(&args.mechanism, None)?;
    let mechanism = load_mechanism(&active, &passive, Some(AttenuationChoice::Characteristic))?;
    if !json {
        mechanism.notes.iter().for_each(|n| eprintln!("{} {n}", n.word()));
    }
    let options = SingleDofOptions {
        preset: args.preset.map(PresetArg::preset),
        closing_speed_m_s: args.speed_m_s,
    };
    let mut out = Results::new(args.out.as_deref(), "single-dof")?;
    let found = single_dof(&rig.model, &mechanism.model, &options)?;
    out.tables(report::tables(&found))?;
    out.plots(report::plots(&found))?;
    out.finish("single-dof", &found.summary, &report::words(&found), json)?;
    Ok(if found.summary.holds { ExitCode::SUCCESS } else { ExitCode::from(OTHERWISE) })
}
