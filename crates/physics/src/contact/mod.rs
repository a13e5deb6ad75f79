//! Contact between the two sides of a docking mechanism: geometry, merging, law.
//!
//! [`Scene::measure`] finds where the sides touch (positions only, the expensive part);
//! [`Contacts::wrench`] applies the law for given velocities (cheap, called several times a step).

pub mod law;
mod merge;
mod scene;
mod shape;

pub use scene::{
    ContactEnergy, ContactSample, ContactState, Contacts, PAIRS, PetalGaps, Scene, SurfacePair,
};
