//! The loop: what runs in a rehearsal is what runs live, tick for tick.

pub mod port;
pub mod rig;
