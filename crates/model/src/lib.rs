//! URDF + TOML + parametric geometry, checked, into one immutable model.
//!
//! Nothing read from a file is silently ignored: what is not understood is refused, and all
//! problems of a file are reported at once. Every number of a model has a note where it comes from.
//!
//! Masses and placements of a spacecraft are only in the URDF; the TOML beside it has the notes on
//! them. The shapes of a mechanism are parameters of the TOML, from which collision
//! shapes and meshes are generated; where its URDF repeats one of them the two must agree.
//!
//! ```
//! use docktwin_model::{load_mechanism, load_spacecraft, model_check};
//! # let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf");
//! let chaser = load_spacecraft(&root.join("chaser_8t.urdf"))?.model;
//! let mechanism = load_mechanism(
//!     &root.join("apas_active.urdf"),
//!     &root.join("apas_passive.urdf"),
//!     None,
//! )?
//! .model;
//! // The ring is a body of its own: 8000 kg come together.
//! assert!((chaser.mass_kg + mechanism.ring_body.mass_kg - 8000.0).abs() < 1e-9);
//!
//! // Everything that is read, ignored, flagged or refused, line by line.
//! let report = model_check(&root.join("stewart.toml"));
//! assert!(report.refused.is_empty() && !report.flagged.is_empty());
//! # Ok::<(), docktwin_model::ModelErrors>(())
//! ```
//!
//! What a key means, and what may stand behind it: [`keys`].

mod check;
mod drive;
pub mod input;
pub mod keys;
mod load_drive;
mod load_mechanism;
mod load_rig;
mod load_spacecraft;
mod load_surfaces;
mod mechanism;
pub mod mesh;
mod problem;
mod rig;
mod rig_check;
mod sag;
pub mod sources;
mod spacecraft;
mod spacecraft_check;
mod surface;
mod surface_form;
mod surface_pairs;
mod text;
pub mod toml_check;
mod urdf;

pub use check::{Report, model_check, model_check_with};
pub use drive::{
    Drive, HydraulicDrive, HydraulicPreset, Hydraulics, LegHydraulics, MeasuredDrive,
    MeasuredPoint, OilVolume, PositionLoop, SealFriction, ServoValve,
};
pub use keys::contact_ranges;
pub use load_mechanism::{
    ChannelKeys, MatedFit, load_mechanism, load_mechanism_from, load_other_active_from, mated_fit,
};
pub use load_rig::{load_rig, load_rig_from};
pub use load_spacecraft::{load_spacecraft, load_spacecraft_from};
pub use mechanism::{
    AttenuationChoice, Attenuator, AxisChannel, CharacteristicAttenuator, ContactLaw,
    DampingPhases, DifferentialAttenuator, DockingMechanism, LatchAxes, LatchSet, MechanismLimits,
    MechanismSpread, NormalLaw, OutcomeRules, PartOffsets, PetalGeometry, PiecewiseCurve, RingBody,
    RingGeometry, SeriesBrake, SideGeometry, Stick,
};
pub use problem::{FileDigest, Loaded, ModelErrors, Note, Problem, ReadValue};
pub use rig::{
    DeadZoneLaw, DockingWorkspace, Leg, LegLimits, LegPart, Offload, Place, Rig, RigSensors,
    RigidMass, SixAxisSensor, Spread,
};
pub use sag::{SAG_REMEDY, Sag, sag_refusal, static_sag};
pub use sources::Sources;
pub use spacecraft::{Spacecraft, SpacecraftHull};
pub use surface::{
    CapturedWhen, Latch, MOST_LATCHES, MOST_PAIRS, RING_AND_PETAL_PAIRS, Surface, SurfaceCore,
};
pub use surface_form::SurfaceGrid;
pub use surface_pairs::SurfacePairing;
pub use urdf::{named_meshes, principal_moments};

#[cfg(test)]
mod tests;
