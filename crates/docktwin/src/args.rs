//! Arguments that several commands have, and how they are read.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use docktwin_model::HydraulicPreset;
use docktwin_physics::bench::Axis;
use docktwin_run::{
    HilOptions, TwinKind,
    rig_place::{ClockKind, RealtimeOptions},
};
use docktwin_scenario::CompensatorChoice;

pub(crate) fn compensator(text: &str) -> Result<CompensatorChoice, String> {
    let words = CompensatorChoice::WORDS;
    words
        .into_iter()
        .find(|(w, _)| *w == text)
        .map(|(_, c)| c)
        .ok_or_else(|| format!("a compensator is one of {}", words.map(|(w, _)| w).join(", ")))
}

pub(crate) fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (0.0..=1e9).contains(&x) => Ok(x),
        _ => Err("a number, not negative, is wanted".to_owned()),
    }
}

/// How a scenario meets a rig: what `hil` and `validate fidelity` share.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct OnRigArgs {
    /// Against the delay of the rig [default: as the scenario says, or lead]
    #[arg(long, value_parser = compensator, value_name = CompensatorChoice::NAMES)]
    pub(crate) compensator: Option<CompensatorChoice>,
    /// Lead, ms [default: as the scenario says, or the delay that is believed]
    #[arg(long, value_name = "MS", value_parser = not_negative)]
    pub(crate) lead_ms: Option<f64>,
    /// TOML of the rig [default: as the scenario says, or models/urdf/stewart.toml]
    #[arg(long, value_name = "RIG.toml")]
    pub(crate) model: Option<PathBuf>,
    /// Override a key of the scenario, repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub(crate) set: Vec<String>,
    /// Seed of the emulated rig's noise
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// Draw the emulated rig within the spread of its file; the loop still believes the file
    #[arg(long, value_name = "SEED")]
    pub(crate) perturb: Option<u64>,
}

impl OnRigArgs {
    /// The options of a run that they give.
    pub(crate) fn options(&self) -> HilOptions {
        HilOptions {
            compensator: self.compensator,
            lead_s: self.lead_ms.map(|ms| ms * 1e-3),
            model: self.model.clone(),
            seed: self.seed,
            perturb: self.perturb,
            ..HilOptions::default()
        }
    }
}

/// What drives the ticks of a loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum ClockArg {
    /// As fast as it goes; a run repeats bit by bit
    #[default]
    Virtual,
    /// 1 kHz of the machine's clock
    Realtime,
}

impl ClockArg {
    pub(crate) const fn kind(self) -> ClockKind {
        match self {
            Self::Virtual => ClockKind::Virtual,
            Self::Realtime => ClockKind::Realtime,
        }
    }
}

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

/// Which twin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TwinArg {
    /// rapier integrates; 0.2 ms steps by default
    Full,
    /// Our own allocation-free integrator; 0.1 ms steps by default
    Reduced,
}

impl TwinArg {
    pub(crate) const fn kind(self) -> TwinKind {
        match self {
            Self::Full => TwinKind::Full,
            Self::Reduced => TwinKind::Reduced,
        }
    }
}

/// Oil volume of the legs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PresetArg {
    /// The paper's Table 1 as printed
    Printed,
    /// What belongs to the stroke
    Consistent,
    /// A tenth of the printed one, with a bypass leak
    Stiff,
}

impl PresetArg {
    /// The preset of the rig.
    pub(crate) const fn preset(self) -> HydraulicPreset {
        match self {
            Self::Printed => HydraulicPreset::Printed,
            Self::Consistent => HydraulicPreset::Consistent,
            Self::Stiff => HydraulicPreset::Stiff,
        }
    }
}

/// An axis of the ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum AxisArg {
    /// Along the docking axis
    X,
    /// Sideways
    Y,
    /// Sideways
    Z,
    /// About X
    Roll,
    /// About Y
    Pitch,
    /// About Z
    Yaw,
}

impl AxisArg {
    /// The axis of the bench.
    pub(crate) const fn axis(self) -> Axis {
        match self {
            Self::X => Axis::X,
            Self::Y => Axis::Y,
            Self::Z => Axis::Z,
            Self::Roll => Axis::Roll,
            Self::Pitch => Axis::Pitch,
            Self::Yaw => Axis::Yaw,
        }
    }
}
