//! Your own rig: here the emulated one, through an adapter that counts commands; an adapter to
//! hardware looks the same. `docktwin_run` sees nothing but the trait [`Rig`].
//!
//! `cargo run --release -p docktwin-run --example 05_own_rig`

use std::time::Duration;

use docktwin_rigport::{
    message::{RigCommand, RigMeasurement, RigMode},
    rig::{Rig, RigError},
};
use docktwin_run::{HilOptions, HilRun, RunError, SummaryOnly};
use docktwin_scenario::Loader;

/// Passes everything on, and counts the ticks in which the rig had to follow.
struct Counting<R> {
    rig: R,
    tracked: u64,
}

impl<R: Rig> Rig for Counting<R> {
    fn receive(
        &mut self,
        patience: Duration,
        now_ns: u64,
    ) -> Result<Option<RigMeasurement>, RigError> {
        self.rig.receive(patience, now_ns)
    }

    fn send(&mut self, command: &RigCommand) -> Result<(), RigError> {
        self.tracked += u64::from(command.mode == RigMode::Track as u32);
        self.rig.send(command)
    }
}

fn main() -> Result<(), RunError> {
    let scenario =
        Loader::new().set("run.duration_s", 3.0).load("scenarios/apas_nominal.toml".as_ref())?;
    let run = HilRun::new(&scenario, HilOptions::default())?;
    let mut rig = Counting { rig: run.emulated()?, tracked: 0 };
    let summary = run.run(&mut rig, &mut SummaryOnly)?;
    let fidelity = summary.fidelity.unwrap_or_default();
    println!("{}, {} commands to follow", summary.outcome, rig.tracked);
    println!("peak force over that of the simulated system: {:?}", fidelity.peak_force_ratio);
    Ok(())
}
