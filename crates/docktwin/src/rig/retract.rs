//! `rig retract`: the rig draws back after a run.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use docktwin_control::{rig::RigSetup, safety::SafetyLimits};
use docktwin_core::Pose;
use docktwin_hil::{
    clock::{Clock, OverrunPolicy, RealtimeClock, VirtualClock},
    drive::{Drive, DriveError, DriveSetup},
    ipc::IpcRig,
    realtime::relax,
    scheduler::LegCorrections,
};
use docktwin_model::{Rig as RigModel, load_rig};
use serde_json::json;

use crate::{
    cli::ClockArg,
    failure::Failure,
    rigs::{PERIOD_NS, RealtimeArgs, RigPlace, confirm, connect, new_session, patience},
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
    /// What drives the ticks
    #[arg(long, value_enum, default_value_t = ClockArg::Virtual)]
    clock: ClockArg,
    /// Confirm beforehand that the emergency stop was tested and nobody is near the rig
    #[arg(long)]
    yes: bool,
    #[command(flatten)]
    realtime: RealtimeArgs,
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
    confirm(&args.rig, args.yes)?;
    let rig = connect(name)?;
    let stands = match args.clock {
        ClockArg::Virtual => drawn_back(&model, rig, VirtualClock::new(PERIOD_NS)),
        ClockArg::Realtime => {
            args.realtime.apply_aloud()?;
            let clock = RealtimeClock::new(PERIOD_NS, OverrunPolicy::Skip);
            let stands = drawn_back(&model, rig, clock);
            relax();
            stands
        }
    };
    let stands = stands.map_err(|e| Failure::Usage {
        what: e.to_string(),
        remedy: "nothing moves any more; mend the cause, or draw the rig back with its own \
                 controller"
            .to_owned(),
    })?;
    let p = stands.p;
    if as_json {
        println!("{}", json!({ "rig": args.rig.to_string(), "x_34_m": p.to_array() }));
    } else {
        println!("drawn back   X_34 at ({:.3}, {:.3}, {:.3}) m, at rest", p.x, p.y, p.z);
    }
    Ok(ExitCode::SUCCESS)
}

fn drawn_back<K: Clock>(model: &RigModel, rig: IpcRig, clock: K) -> Result<Pose, DriveError> {
    let preset = model.hydraulics.default_preset;
    let setup = DriveSetup {
        rig: model.clone(),
        feedforward: RigSetup::of_rig(model, preset, None).feedforward(),
        corrections: LegCorrections::default(),
        limits: SafetyLimits::of_rig(model, MAY_CHANGE_N, f64::INFINITY),
        speed: [0.0; 2],
        session: new_session(),
        patience: patience::<K>(),
    };
    let mut drive = Drive::start(setup, rig, clock)?;
    let stands = drive.retract()?;
    drive.finish()?;
    Ok(stands)
}
