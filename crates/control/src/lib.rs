//! Control of the motion simulator.
//!
//! A controller with two degrees of freedom, as in (9): [`feedforward`] is `G_prefilter`, which
//! turns a commanded motion of the plate into commands of the legs, and [`leg`] is `G_Controller`,
//! the fast loop around each leg. [`rig`] closes the loop around the six-leg rig, [`response`]
//! measures it while it runs, and
//! [`linear`] is the linear model to compare with.
//!
//! No clock, no file, no physics engine; what runs in the loop does not allocate.

pub mod compensation;
pub mod excitation;
pub mod feedforward;
pub mod filter;
pub mod harmonic;
pub mod leg;
pub mod linear;
pub mod one_sided;
pub mod planner;
pub mod response;
pub mod rig;
pub mod safety;
pub mod sensing;
pub mod single_dof;
