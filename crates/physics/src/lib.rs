//! Laws as pure functions, and the reduced twin put together from them.
//!
//! No clock, no file, no thread, no physics engine. Everything here is a function of
//! (model, state, inputs); after construction nothing that a step calls allocates.

pub mod as_built;
pub mod attenuator;
pub mod bench;
pub mod body;
pub mod contact;
pub mod hanger;
pub mod hydraulics;
pub mod initial;
pub mod limits;
pub mod mechanism;
pub mod mounted;
pub mod outcome;
pub mod platform;
pub mod position_loop;
pub mod programme;
pub mod reduced;
pub mod rig;
pub mod sensor;
pub mod stick;
