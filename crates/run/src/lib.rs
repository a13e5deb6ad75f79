//! Runs: a rehearsal of a scenario ([`Rehearsal`]), a loop with a rig ([`HilRun`]), a replay of a
//! recording ([`Replay`]). A caller can step the first two tick by tick or run each of them to its
//! end. The ticks go to a [`Sink`]: a run directory, memory, or only the summary.
//!
//! ```
//! use docktwin_run::{Rehearsal, SummaryOnly};
//! use docktwin_scenario::Scenario;
//! # let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
//! # let path = root.join("scenarios/basic_central_impact.toml");
//! let scenario = Scenario::from_path(path)?;                       // or from a text, or built
//! let summary = Rehearsal::new(&scenario)?.run(&mut SummaryOnly)?; // or RunDirectory, Memory, …
//! assert!(summary.peak_force_n > 24e3);
//! # Ok::<(), docktwin_run::RunError>(())
//! ```
//!
//! From a scenario to bodies and control wrenches: [`setup`]; every signal that is recorded, with unit,
//! frame and meaning: [`columns`]; their values, of a state: [`signals`], with a rig [`telemetry`];
//! accounts, events and verdict of a run: [`observer`]; comparison of a run against a rig with the
//! simulated system: [`fidelity`].
//!
//! Absent on purpose: the command line, printing, terminals, the viewer.

#![cfg_attr(test, expect(clippy::unwrap_used, reason = "a test stops at the first surprise"))]

pub mod article;
pub mod columns;
pub mod commission;
pub mod control;
mod error;
pub mod event;
pub mod fidelity;
mod hil_run;
pub mod inspection;
pub mod observer;
pub mod progress;
pub mod provenance;
mod rehearsal;
mod replay;
pub mod rig_place;
pub mod rigfile;
pub mod ring;
pub mod setup;
pub mod signals;
pub mod sink;
pub mod telemetry;
mod twin;

pub use article::RigMechanism;
pub use control::{Coasting, Control, Situation, TimedThrusts};
pub use error::{RunError, SinkError};
pub use hil_run::{HilOptions, HilRun, PERIOD_NS, RunningHil};
pub use rehearsal::{Rehearsal, RehearsalOptions, RunningRehearsal, pair_names};
pub use replay::{Difference, FigureDifference, Replay, Replayed};
pub use sink::{Memory, RunDirectory, Signals, Sink, SummaryOnly};
pub use twin::{AnyTwin, TickedTwin, TwinKind};
