//! `rig retract`: the rig draws back after a run.

use std::{path::PathBuf, process::ExitCode, time::Duration};

use clap::Args;
use docktwin_control::{feedforward::LegCorrections, rig::RigSetup, safety::SafetyLimits};
use docktwin_core::Pose;
use docktwin_hil::{
    clock::Clock,
    drive::{Drive, DriveSetup},
};
use docktwin_model::load_rig;
use docktwin_rigport::rig::Rig;
use serde_json::json;

use super::measure::{Work, lead};
use crate::{
    failure::Failure,
    rigs::{LedArgs, RigPlace, confirm, connect, new_session},
};

/// By how much sensor A may change from the load it begins with, N: what a mechanism bears in tension. More
/// is a latch that stays shut.
const MAY_CHANGE_N: f64 = 4000.0;

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
    let RigPlace::Port(name) = &args.rig else {
        return Err(Failure::Usage {
            what: "an emulated rig of this process begins drawn back".to_owned(),
            remedy: "name one that runs: --rig ipc:NAME".to_owned(),
        });
    };
    let model = load_rig(&args.model)?.model;
    confirm(&args.rig, args.led.yes)?;
    let setup = DriveSetup {
        feedforward: RigSetup::of_rig(&model, model.hydraulics.default_preset, None).feedforward(),
        corrections: LegCorrections::default(),
        limits: SafetyLimits::of_rig(&model, MAY_CHANGE_N, f64::INFINITY),
        speed: [0.0; 2],
        session: new_session(),
        patience: Duration::ZERO,
        rig: model,
    };
    let stands = lead(connect(name)?, &args.led, setup, &DrawBack)?;
    let p = stands.p;
    if as_json {
        println!("{}", json!({ "rig": args.rig.to_string(), "x_34_m": p.to_array() }));
    } else {
        println!("drawn back   X_34 at ({:.3}, {:.3}, {:.3}) m, at rest", p.x, p.y, p.z);
    }
    Ok(ExitCode::SUCCESS)
}

struct DrawBack;

impl Work for DrawBack {
    type Found = Pose;

    fn work<R: Rig, K: Clock>(&self, drive: &mut Drive<R, K>) -> Result<Pose, Failure> {
        drive.retract().map_err(|e| Failure::Usage {
            what: e.to_string(),
            remedy: "the rig was stopped; mend the cause, or draw it back with its own controller"
                .to_owned(),
        })
    }
}
