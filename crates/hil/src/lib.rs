//! The loop: what runs in a rehearsal is what runs live, tick for tick.
//!
//! What passes between loop and rig is `docktwin-rigport`; here are the loop ([`scheduler`]), its clocks,
//! emulated rigs with their faults, and what is found out about a rig by driving it.

pub mod calibrate;
pub mod clock;
mod commands;
pub mod drive;
pub mod emulated;
pub mod faults;
pub mod histogram;
pub mod ideal;
pub mod identify;
pub mod realtime;
pub mod scheduler;
pub mod vibro;
