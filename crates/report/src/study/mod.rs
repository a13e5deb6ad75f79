//! What studies found, for a reader: tables as CSV, plots as SVG, words for a terminal. A module for
//! every study of [`docktwin_study`], each with `tables`, `plots` and `words` of its result.
//!
//! ```
//! # let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
//! use docktwin_model::load_rig;
//! use docktwin_report::study;
//! use docktwin_study::rig::{Build, workspace};
//!
//! let rig = load_rig(&root.join("models/urdf/stewart.toml"))?.model;
//! let found = workspace(&rig, &Build::default())?;
//! assert!(study::workspace::words(&found).contains("fits           yes"));
//! for (name, text) in study::workspace::tables(&found) {
//!     assert!(name.ends_with(".csv") && text.lines().count() > 1);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod bode;
pub mod crosscheck;
pub mod fidelity;
pub mod frequency;
pub mod mechanism;
mod rig;
mod say;
mod sheet;
pub mod single_dof;
pub mod stability;
pub mod stiffness;
pub mod vibro_impact;
pub mod workspace;

pub use docktwin_plot::PlotError;

/// A file's name and its text.
pub type NamedText = (String, String);
