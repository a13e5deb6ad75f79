//! URDF + TOML + parametric geometry, checked, into one immutable model.
//!
//! Nothing read from a file is silently ignored: what is not understood is refused, and all
//! problems of a file are reported at once.

mod mechanism;
mod spacecraft;

pub use mechanism::{
    Attenuator, AxisChannel, CharacteristicAttenuator, ContactLaw, DampingPhases,
    DifferentialAttenuator, DockingMechanism, LatchSet, MechanismLimits, NormalLaw, OutcomeRules,
    PetalGeometry, PiecewiseCurve, RingBody, RingGeometry, SeriesBrake, SideGeometry,
};
pub use spacecraft::Spacecraft;
