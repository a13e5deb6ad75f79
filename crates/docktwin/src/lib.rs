//! What the command line is put together from, for those who run dockings from Rust: from a scenario
//! to bodies and control wrenches ([`setup`]), from a state to everything that is recorded of it
//! ([`signals`]), from a recording to what the viewer shows ([`playback`]), the same while it happens
//! ([`live`]), a person at the controls ([`pilot`]), a run against a rig ([`telemetry`], [`fidelity`]).

pub mod fidelity;
pub mod live;
pub mod pilot;
pub mod playback;
pub mod rigfile;
pub mod ring;
pub mod setup;
pub mod signals;
pub mod telemetry;
