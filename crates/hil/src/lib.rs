//! The loop: what runs in a rehearsal is what runs live, tick for tick.

pub mod clock;
pub mod histogram;
pub mod desk;
pub mod ideal;
pub mod in_process;
pub mod ipc;
pub mod port;
pub mod realtime;
pub mod rig;
