//! Design analyses of a motion simulator: a Stewart platform on hydraulic legs.
//!
//! | function | question | paper |
//! | --- | --- | --- |
//! | [`workspace()`] | does the docking workspace fit into what the legs and joints reach? | Fig. 30 |
//! | [`capability()`] | what tolerance, motion range and payload does the rig have? | §3.1 |
//! | [`frequency()`] | what are the natural frequencies over the docking workspace? | Fig. 31–36 |
//! | [`bode()`] | how does the running rig follow a swept sine? | Fig. 39, 40 |
//! | [`stiffness()`] | how do the closed-loop poles move with the stiffness of the payload? | (11) |
//!
//! Degrees of freedom are those of docking ([`Dof`]). A place in the docking workspace
//! ([`docktwin_model::Place`]) has six coordinates in this order, each from −1 to 1 in half-widths of
//! the docking workspace; the middle is zero.
//!
//! Every function takes the rig as its file describes it, and a [`Build`] that says which rig is built
//! of that file.

mod bode;
mod capability;
mod frequency;
mod leg_control;
mod stiffness;
mod workspace;

use core::fmt;

use docktwin_control::{response::ResponseError, rig::RigSetup};
use docktwin_model::{DockingWorkspace, HydraulicPreset, Place, Rig};
use docktwin_physics::rig::{BuiltLegs, PerturbedRig};
use serde::{Deserialize, Serialize};

pub use self::{
    bode::{
        Bode, BodeOptions, BodeSummary, FLAT_HZ, MeasuredResponse, PAPER_HZ, PAYLOAD_N_M, Payload,
        PayloadPoles, PayloadSummary, Places, Pole, Requirements, ResponsePoint, WorstAt,
        WorstResponse, bode,
    },
    capability::{Capability, DofRange, MeetsPaper, PAPER_RANGE, Tolerance, capability},
    frequency::{
        Frequency, FrequencySummary, LineModes, MiddleModes, PlaceModes, PresetFrequencies, Span,
        frequency,
    },
    leg_control::{LegControl, LegSetting, SettingError},
    stiffness::{
        Change, MORE_BULK_MODULUS, PayloadStiffness, PresetStiffness, Stiffness, StiffnessOptions,
        StiffnessSeries, StiffnessStep, StiffnessSummary, stiffness,
    },
    workspace::{
        FARTHEST_M, LegRange, PlaceReach, Section, TourFrame, Workspace, WorkspaceSummary,
        corner_tour, workspace,
    },
};

/// A degree of freedom of docking: X, Y, Z of the origin of `e4` along the axes of `e3` (m), then
/// roll, pitch and yaw of `e4` against `e3` about that origin (rad).
///
/// Serialised as `"X"`, `"Y"`, `"Z"`, `"roll"`, `"pitch"`, `"yaw"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Dof {
    /// Along the docking axis.
    X,
    /// Sideways.
    Y,
    /// Sideways.
    Z,
    /// About X.
    #[serde(rename = "roll")]
    Roll,
    /// About Y.
    #[serde(rename = "pitch")]
    Pitch,
    /// About Z.
    #[serde(rename = "yaw")]
    Yaw,
}

impl Dof {
    /// All six, in the order of every array over degrees of freedom.
    pub const ALL: [Self; 6] = [Self::X, Self::Y, Self::Z, Self::Roll, Self::Pitch, Self::Yaw];

    /// Place in an array over degrees of freedom, 0 to 5.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Its name, as serialised.
    #[must_use]
    pub const fn name(self) -> &'static str {
        ["X", "Y", "Z", "roll", "pitch", "yaw"][self.index()]
    }

    /// True for a rotation (rad, N·m), false for a displacement (m, N).
    #[must_use]
    pub const fn turns(self) -> bool {
        self.index() >= 3
    }
}

impl fmt::Display for Dof {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// An extreme value over the docking workspace, and where it occurs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Extreme {
    /// The value; its unit stands at the field that holds it.
    pub value: f64,
    /// The place, six coordinates from −1 to 1.
    pub at: Place,
}

impl Extreme {
    /// Above every number, in the middle: where a search for the least value begins.
    pub(crate) const HIGHEST: Self = Self { value: f64::INFINITY, at: MIDDLE };

    /// Takes a value that is less.
    pub(crate) fn lower(&mut self, value: f64, at: Place) {
        if value < self.value {
            *self = Self { value, at };
        }
    }
}

impl From<(f64, Place)> for Extreme {
    fn from((value, at): (f64, Place)) -> Self {
        Self { value, at }
    }
}

/// The middle of the docking workspace.
pub(crate) const MIDDLE: Place = Place([0.0; 6]);

/// The middle, then the 64 corners.
pub(crate) fn middle_and_corners() -> Vec<Place> {
    core::iter::once(MIDDLE).chain(DockingWorkspace::corners()).collect()
}

/// Which rig is built of a rig file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Build {
    /// Volume of the oil; without one, the file's default.
    pub preset: Option<HydraulicPreset>,
    /// Seed by which the rig is drawn within the spread of its file; without one it is exactly as the
    /// file says. Controllers believe the file in either case.
    pub seed: Option<u64>,
}

/// The rig that is analysed: its file, and the rig built of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Subject {
    /// As the file describes it, and as its controllers believe it to be.
    pub file: Rig,
    /// As built: the file, or drawn within its spread.
    pub rig: Rig,
    /// What moves the legs as built.
    pub legs: BuiltLegs,
    /// Volume of the oil, if oil moves the legs.
    pub preset: HydraulicPreset,
    /// Seed of the draw.
    pub seed: Option<u64>,
}

impl Subject {
    /// Builds the rig.
    #[must_use]
    pub fn new(file: &Rig, build: &Build) -> Self {
        let preset = file.preset(build.preset);
        let PerturbedRig { rig, legs } = PerturbedRig::of(file, preset, build.seed);
        Self { file: file.clone(), rig, legs, preset, seed: build.seed }
    }

    /// The same rig with another volume of the oil.
    #[must_use]
    pub fn with(&self, preset: HydraulicPreset) -> Self {
        Self::new(&self.file, &Build { preset: Some(preset), seed: self.seed })
    }

    /// The rig closed by its controllers, tuned as its preset says but for `changes`.
    #[must_use]
    pub fn setup(&self, changes: &LegControl) -> RigSetup {
        let mut setup = RigSetup::of_rig(&self.file, self.preset, self.seed);
        changes.apply(&mut setup);
        setup
    }

    /// Stiffness of the oil of one leg, (10), N/m: the mean of the six; `None` where no oil moves them.
    #[must_use]
    pub fn oil_spring_n_m(&self) -> Option<f64> {
        let legs = self.legs.hydraulic()?;
        Some(legs.iter().map(|l| l.oil.oil_spring_n_m()).sum::<f64>() / 6.0)
    }

    /// Natural frequency of the plate's mass on the oil spring of one leg, Hz.
    #[must_use]
    pub fn lumped_hz(&self) -> Option<f64> {
        Some((self.oil_spring_n_m()? / self.rig.plate.mass_kg).sqrt() / core::f64::consts::TAU)
    }

    /// What an analysis of oil cannot do with this rig.
    pub(crate) fn no_oil(&self) -> RigError {
        RigError::NoOil { rig: self.rig.name.clone() }
    }

    /// What a result says of the rig.
    #[must_use]
    pub fn summary(&self) -> SubjectSummary {
        SubjectSummary {
            rig: self.rig.name.clone(),
            preset: self.rig.oil(self.preset),
            seed: self.seed,
            oil_spring_n_m: self.oil_spring_n_m(),
            plate_mass_kg: self.rig.plate.mass_kg,
            lumped_hz: self.lumped_hz(),
        }
    }
}

/// What a result says of the rig it is about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SubjectSummary {
    /// Robot name of the URDF.
    pub rig: String,
    /// Volume of the oil; `None` where no oil moves the legs.
    pub preset: Option<HydraulicPreset>,
    /// Seed of the draw; `None` for the rig exactly as its file says.
    pub seed: Option<u64>,
    /// Stiffness of the oil of one leg, (10), N/m, above 0: the mean of the six; `None` without oil.
    pub oil_spring_n_m: Option<f64>,
    /// Mass of the plate and all it carries, kg, above 0.
    pub plate_mass_kg: f64,
    /// Natural frequency of that mass on the oil spring of one leg, Hz.
    pub lumped_hz: Option<f64>,
}

/// An option outside of what is allowed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{option}` = {value}; allowed: {allowed}")]
pub struct OptionProblem {
    /// Field of the options.
    pub option: &'static str,
    /// Its value, as text.
    pub value: String,
    /// What is allowed.
    pub allowed: &'static str,
}

/// Why an analysis of a rig has no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RigError {
    /// A pose has no inverse of its Jacobian or mass matrix. A rig file with such a pose is refused
    /// when it is loaded, so only a drawn rig or one made in memory comes here.
    #[error("a pose of the docking workspace is singular")]
    Singular,
    /// No oil moves the legs, and the analysis is about oil, or about controllers that such legs do not have.
    #[error(
        "no oil moves the legs of {rig}: they follow their commanded lengths by loops of their own"
    )]
    NoOil {
        /// Name of the rig.
        rig: String,
    },
    /// The running rig could not be measured.
    #[error("{dof} at {place} against {payload} cannot be measured: {source}")]
    Response {
        /// Degree of freedom that was driven.
        dof: Dof,
        /// Place in the docking workspace.
        place: Place,
        /// What the plate worked against.
        payload: Payload,
        /// Why.
        source: ResponseError,
    },
    /// Options outside of what is allowed: all of them.
    #[error("{}", problems.iter().map(OptionProblem::to_string).collect::<Vec<_>>().join("; "))]
    Options {
        /// At least one.
        problems: Vec<OptionProblem>,
    },
}

impl RigError {
    /// What to do about it.
    #[must_use]
    pub const fn remedy(&self) -> &'static str {
        match self {
            Self::Singular => "make the docking workspace smaller or the platform larger",
            Self::NoOil { .. } => {
                "take `analyze bode` without --preset and --set, which measures their response, or a hydraulic rig"
            }
            Self::Response { source: ResponseError::Rig(_), .. } => {
                "the loop is unstable there: lower the gains of the leg control, or the amplitude"
            }
            Self::Response { .. } => "correct the rig file, or the changes to the leg control",
            Self::Options { .. } => "correct these options",
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::path::Path;

    use docktwin_model::load_rig;

    use super::*;

    /// The rig that is shipped.
    pub(crate) fn shipped() -> Rig {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf/stewart.toml");
        load_rig(&file).expect("the shipped rig is right").model
    }

    #[test]
    fn oracle_degrees_of_freedom_are_named_in_their_order() {
        for (i, dof) in Dof::ALL.into_iter().enumerate() {
            assert_eq!((dof.index(), dof.turns()), (i, i >= 3));
            let text = serde_json::to_string(&dof).expect("JSON");
            assert_eq!(text, format!("\"{dof}\""));
            assert_eq!(serde_json::from_str::<Dof>(&text).expect("JSON"), dof);
        }
    }

    #[test]
    fn oracle_the_subject_is_the_file_or_drawn_from_it() {
        let file = shipped();
        let as_file = Subject::new(&file, &Build::default());
        assert_eq!(as_file.rig, file);
        // Table 1 with 2500 kg on one leg: 16.7 Hz (spec of (10): 2.76e7 N/m).
        let (spring, hz) = as_file.oil_spring_n_m().zip(as_file.lumped_hz()).expect("on oil");
        assert!((spring / 2.76e7 - 1.0).abs() < 1e-12);
        assert!((hz - 16.72).abs() < 5e-3, "{hz}");
        let drawn = |seed| Subject::new(&file, &Build { seed: Some(seed), ..Build::default() });
        assert_eq!(drawn(3), drawn(3));
        assert_ne!(drawn(3).summary(), drawn(4).summary());
        assert_eq!(drawn(3).file, file);
    }
}
