//! What the command line is put together from, for those who run dockings from Rust: from a scenario
//! to bodies and control wrenches ([`setup`]), from a state to everything that is recorded of it
//! ([`signals`]), and from a recording to what the viewer shows ([`playback`]).

pub mod playback;
pub mod setup;
pub mod signals;
