//! `rig emulate`: the emulated rig on the other end of `ipc:NAME`.

use std::process::ExitCode;

use docktwin_hil::realtime::{catch_termination, relax};
use docktwin_model::Drive;
use docktwin_rigport::ipc::{RigEvent, RigServer, ServeOptions};
use docktwin_run::commission::Stand;
use serde_json::json;

use super::EmulateArgs;
use crate::failure::Failure;

/// Runs the command.
pub(super) fn run(args: &EmulateArgs, as_json: bool) -> Result<ExitCode, Failure> {
    let stand = Stand::load(&args.built.options(&args.rig)?)?;
    let mut plant = stand.emulated(&stand.clear())?;
    let usage = |e: &dyn core::fmt::Display, remedy: &str| Failure::Usage {
        what: e.to_string(),
        remedy: remedy.to_owned(),
    };
    let mut server = RigServer::open(&args.name)
        .map_err(|e| usage(&e, "a rig that still runs under this name is ended with Ctrl-C"))?;
    let report = args.realtime.options().apply()?;
    let stop = catch_termination();
    if as_json {
        println!(
            "{}",
            json!({ "ready": format!("ipc:{}", args.name), "rig": stand.rig.name,
                "mechanism": stand.scenario_name(), "best_effort": report.is_best_effort() })
        );
    } else {
        println!(
            "ready: ipc:{}, {}, {}, mechanism of {}{}",
            args.name,
            stand.rig.name,
            drive_word(&stand),
            stand.scenario_name(),
            if report.is_best_effort() { ", best effort" } else { "" }
        );
    }
    let served = server.serve(
        &mut plant,
        ServeOptions::default(),
        || stop.signal().is_some(),
        |event| match event {
            RigEvent::Session(n) => eprintln!("a loop begins session {n}"),
            RigEvent::Refused { refusal, tick } => {
                eprintln!("tick {tick}: refused, {refusal}; holding");
            }
            RigEvent::SafeState { tick } => {
                eprintln!("left the commands after tick {tick}; holding")
            }
        },
    );
    relax();
    let counts =
        served.map_err(|e| usage(&e, "start the rig again; see the rights on /dev/shm"))?;
    if as_json {
        println!(
            "{}",
            json!({ "commands": counts.commands, "refused": counts.refused_in_all(),
                "missed": counts.missed, "late": counts.late, "safe_states": counts.safe_states })
        );
    } else {
        println!(
            "ended: {} commands, {} refused, {} missed, {} late, {} times in the safe state",
            counts.commands,
            counts.refused_in_all(),
            counts.missed,
            counts.late,
            counts.safe_states
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// The oil volume, or what moves the legs without oil.
fn drive_word(stand: &Stand) -> &'static str {
    match &stand.rig.drive {
        Drive::Hydraulic(_) => stand.preset.word(),
        Drive::PositionLoop(_) => "position loops",
        Drive::Measured(_) => "measured drives",
    }
}
