//! `rig retract`: the rig draws back after a run.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use docktwin_run::{
    commission::{DriveOptions, retract},
    rig_place::RigPlace,
};
use serde_json::json;

use crate::{args::LedArgs, failure::Failure, observers::AtTerminal};

/// Options of `rig retract`.
#[derive(Debug, Args)]
pub(crate) struct RetractArgs {
    /// The rig: `ipc:NAME`
    #[arg(long, value_name = "ipc:NAME")]
    rig: RigPlace,
    /// TOML or URDF of the rig, the other beside it
    #[arg(long, value_name = "RIG.toml")]
    model: PathBuf,
    #[command(flatten)]
    led: LedArgs,
}

/// Runs the command.
pub(super) fn run(args: &RetractArgs, as_json: bool) -> Result<ExitCode, Failure> {
    let options = DriveOptions {
        place: args.rig.clone(),
        clock: args.led.clock.kind(),
        realtime: args.led.realtime.options(),
    };
    let mut operator = AtTerminal { yes: args.led.yes, quiet: as_json };
    let p = retract(&args.model, &options, &mut operator)?.p;
    if as_json {
        println!("{}", json!({ "rig": args.rig.to_string(), "x_34_m": p.to_array() }));
    } else {
        println!("drawn back   X_34 at ({:.3}, {:.3}, {:.3}) m, at rest", p.x, p.y, p.z);
    }
    Ok(ExitCode::SUCCESS)
}
