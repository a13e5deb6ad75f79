//! Scenario schema, checking and explanation.
//!
//! A scenario names two spacecraft, a mechanism, the relative state at first contact, and the
//! outcome that physics is expected to give. Files hold degrees and units in every key; the
//! [`Scenario`] holds radians. All problems of a scenario and of its models are reported at once.
//!
//! ```
//! use docktwin_scenario::{ExpectedOutcome, Loader, Scenario, explained};
//! # let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
//! # let path = root.join("scenarios/apas_fast.toml");
//! let fast = Scenario::from_path(&path)?;
//! assert_eq!(fast.expect.outcome, ExpectedOutcome::Captured);
//!
//! // With a value patched; a wrong one is refused with unit, range and what to do.
//! let wide = Loader::new().set("initial.lateral_y_m", 0.1).load(&path)?;
//! assert_eq!(wide.initial.lateral_m, [0.1, 0.0]);
//! let wrong = Loader::new().set("initial.axial_speed_m_s", -0.1).load(&path).unwrap_err();
//! assert!(wrong.to_string().contains("allowed: > 0 and ≤ 2 m/s"));
//!
//! assert_eq!(explained(Some("initial.gap_m")).unwrap()[0].unit, "m");
//! # Ok::<(), docktwin_scenario::ScenarioErrors>(())
//! ```

mod builder;
mod expect;
mod keys;
mod load;
mod load_expect;
mod loader;
mod overrides;
mod read;
mod scenario;
mod stiff;

pub use builder::ScenarioBuilder;
pub use docktwin_model::keys::UnknownKey;
pub use expect::{
    Bound, Compared, Expect, ExpectedOutcome, FidelityBounds, HilBounds, Measured, RunBounds,
    Target, Window,
};
pub use keys::{Explained, explain, explained};
pub use load::{resolve_path, resolve_path_from};
pub use loader::{Loader, load_scenario};
pub use scenario::{
    Body, CompensatorChoice, HilSettings, InitialConditions, RunSettings, Scenario, ScenarioErrors,
    Thrust, Trigger, TurningBody,
};
pub use stiff::{Moving, Place, TooStiff, too_stiff};

#[cfg(test)]
mod tests;
