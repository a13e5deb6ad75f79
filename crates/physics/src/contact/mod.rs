//! Contact between the two sides of a docking mechanism: geometry, search, energy, law.
//!
//! [`Scene::measure`] finds where the sides touch (positions only, the expensive part);
//! [`Contacts::wrench`] applies the law for given velocities (cheap, called several times a step).

mod cells;
mod contacts;
mod geometry;
pub mod law;
mod look;
mod memory;
mod pair;
mod scene;
mod search;
mod shapes;

pub use contacts::{ContactEnergy, ContactSample, Contacts};
pub use memory::ContactState;
pub use pair::{PAIRS, RING_AND_PETAL_PAIRS, SurfacePair};
pub use scene::{PetalGaps, Scene};
