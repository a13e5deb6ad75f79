//! Scenario schema, checking and explanation.
//!
//! A scenario names two spacecraft, a mechanism, the relative state at first contact, and the
//! outcome that physics is expected to give. Files hold degrees and units in every key; the
//! [`Scenario`] holds radians. All problems of a scenario and of its models are reported at once.

mod builder;
mod expect;
mod keys;
mod load;
mod loader;
mod overrides;

pub use builder::ScenarioBuilder;
pub use docktwin_model::keys::UnknownKey;
pub use expect::{Bound, Expect, ExpectedOutcome, Measured, Target};
pub use keys::{Explained, explain, explained};
pub use load::{
    Body, CompensatorChoice, HilSettings, InitialConditions, RunSettings, Scenario, ScenarioErrors,
    Thrust, Trigger, load_scenario, resolve_path, resolve_path_from,
};
pub use loader::Loader;

#[cfg(test)]
mod tests;
