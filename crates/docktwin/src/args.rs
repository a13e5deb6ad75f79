//! Arguments that several commands have, and how they are read.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use docktwin_model::HydraulicPreset;
use docktwin_physics::{
    as_built::{Grade, MechanismDraw},
    bench::Axis,
};
use docktwin_run::{
    HilOptions, RigMechanism, TwinKind,
    rig_place::{ClockKind, RealtimeOptions},
};
use docktwin_scenario::CompensatorChoice;

use crate::failure::Failure;

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
    /// File of `rig identify`: null bias and flow gain are corrected, delay and lead are its own
    #[arg(long, value_name = "FILE")]
    pub(crate) identification: Option<PathBuf>,
    /// Override a key of the scenario, repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub(crate) set: Vec<String>,
    /// Seed of the emulated rig's noise
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// Draw the emulated rig within the spread of its file; the loop still believes the file
    #[arg(long, value_name = "SEED")]
    pub(crate) perturb: Option<u64>,
    #[command(flatten)]
    pub(crate) mechanism: RigMechanismArgs,
}

impl OnRigArgs {
    /// The options of a run that they give.
    pub(crate) fn options(&self) -> Result<HilOptions, Failure> {
        Ok(self.options_with(self.mechanism.options()?))
    }

    /// The same with this mechanism on the rig.
    pub(crate) fn options_with(&self, mechanism: RigMechanism) -> HilOptions {
        HilOptions {
            compensator: self.compensator,
            lead_s: self.lead_ms.map(|ms| ms * 1e-3),
            model: self.model.clone(),
            identification: self.identification.clone(),
            seed: self.seed,
            perturb: self.perturb,
            mechanism,
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

/// How well the parts of a drawn mechanism are aligned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum GradeArg {
    /// Within `spread.position_fine_m` of its file
    Fine,
    /// Within `spread.position_coarse_m`
    Coarse,
}

/// The mechanism that the rig has; the loop believes that of the scenario.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct RigMechanismArgs {
    /// The rig has another mechanism: TOML of its active side, models/foreign has examples
    #[arg(long, value_name = "MECHANISM.toml")]
    rig_mechanism: Option<PathBuf>,
    /// Draw the rig's mechanism within the spread of its file by this number; 0 is the file itself
    #[arg(long, value_name = "N")]
    mechanism_draw: Option<u64>,
    /// How well petals, latches and mounts of a drawn mechanism are aligned [default: fine]
    #[arg(long, value_enum)]
    mechanism_grade: Option<GradeArg>,
}

impl RigMechanismArgs {
    /// How well parts are aligned.
    pub(crate) fn grade(&self) -> Grade {
        match self.mechanism_grade {
            Some(GradeArg::Coarse) => Grade::Coarse,
            Some(GradeArg::Fine) | None => Grade::Fine,
        }
    }

    /// The options of a run.
    pub(crate) fn options(&self) -> Result<RigMechanism, Failure> {
        let draw = self
            .mechanism_draw
            .filter(|number| *number > 0)
            .map(|number| MechanismDraw { number, grade: self.grade() });
        if draw.is_none() && self.mechanism_grade.is_some() {
            return Err(Failure::Usage {
                what: "--mechanism-grade says how a drawn mechanism is aligned, and none is drawn"
                    .to_owned(),
                remedy: "give --mechanism-draw N with N from 1 on, or leave the grade out"
                    .to_owned(),
            });
        }
        Ok(RigMechanism { file: self.rig_mechanism.clone(), draw })
    }

    /// The options of many draws.
    pub(crate) fn of_draws(&self) -> Result<RigMechanism, Failure> {
        if self.mechanism_draw.is_some() {
            return Err(Failure::Usage {
                what: "--draws draws mechanisms 1 to N, --mechanism-draw one".to_owned(),
                remedy: "leave one of them out".to_owned(),
            });
        }
        Ok(RigMechanism { file: self.rig_mechanism.clone(), draw: None })
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
