//! What the command line is put together from, for those who run dockings from Rust: from a scenario
//! to bodies and control wrenches ([`setup`]), and from a state to everything that is recorded of it
//! ([`signals`]).

pub mod setup;
pub mod signals;
