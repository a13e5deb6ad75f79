//! The loop: what runs in a rehearsal is what runs live, tick for tick.

pub mod calibrate;
pub mod clock;
pub mod desk;
pub mod drive;
pub mod emulated;
pub mod histogram;
pub mod ideal;
pub mod identify;
pub mod in_process;
pub mod ipc;
pub mod port;
pub mod realtime;
pub mod rig;
pub mod scheduler;
pub mod vibro;
pub mod wire;
