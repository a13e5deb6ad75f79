//! Options of every command that meets a rig.

use clap::Args;
use docktwin_run::rig_place::RealtimeOptions;

use crate::cli::ClockArg;

pub(crate) use docktwin_run::{
    PERIOD_NS,
    rig_place::{RigPlace, best_effort, compensation, connect, new_session, patience},
};

/// How a rig is driven, and with whose leave.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct LedArgs {
    /// What drives the ticks
    #[arg(long, value_enum, default_value_t)]
    pub(crate) clock: ClockArg,
    /// Confirm beforehand that the emergency stop was tested and nobody is near the rig
    #[arg(long)]
    pub(crate) yes: bool,
    #[command(flatten)]
    pub(crate) realtime: RealtimeArgs,
}

/// What a loop asks of the machine, in real time.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct RealtimeArgs {
    /// Run in real time on what the machine grants, and say so; a verdict is then `degraded`
    #[arg(long)]
    pub(crate) allow_best_effort: bool,
    /// Core to keep to, in real time; whatever else this process does goes elsewhere
    #[arg(long, value_name = "N")]
    pub(crate) core: Option<usize>,
}

impl RealtimeArgs {
    pub(crate) const fn options(&self) -> RealtimeOptions {
        RealtimeOptions { best_effort: self.allow_best_effort, core: self.core }
    }
}
