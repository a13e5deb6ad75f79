//! What the command line is put together from, for those who run dockings from Rust: from a scenario
//! to bodies and control wrenches ([`setup`]), from a state to everything that is recorded of it
//! ([`signals`]), from a recording to what the viewer shows ([`playback`]), the same while it happens
//! ([`live`]), and a person at the controls ([`pilot`]).

pub mod live;
pub mod pilot;
pub mod playback;
pub mod setup;
pub mod signals;
