//! Design analyses and validations as functions with typed results: no text output.
//!
//! | question | function |
//! | --- | --- |
//! | what does a motion simulator reach, carry and follow? | [`rig`] |
//! | how does a docking mechanism answer on the test bench? | [`mechanism::mechanism`] |
//! | does the single-DOF HIL simulation reproduce the simulated system? | [`single_dof::single_dof`] |
//! | what does the whole loop do to a spring stick, Table 4? | [`vibro_impact::vibro_impact`] |
//! | which contacts can be tested with which method against the delay? | [`stability::stability`] |
//! | what makes a docking on the rig differ from the one in orbit, and by how much? | [`fidelity::budget`] |
//! | and with mechanisms drawn within their spread? | [`fidelity::draws::draws`] |
//! | does a second engine come to the same docking? | [`crosscheck::compare`] |
//!
//! A function takes a checked model and a struct of options, and gives a struct of documented figures
//! (`summary`, what the command line prints as JSON) and the data behind them. Every result can be
//! written by `serde` and read back. Nothing is printed or drawn here.
//!
//! ```
//! use std::path::Path;
//!
//! use docktwin_model::load_rig;
//! use docktwin_study::rig::{Build, workspace};
//!
//! let rig = load_rig(Path::new("../../models/urdf/stewart.toml"))?.model;
//! let found = workspace(&rig, &Build::default())?;
//! let summary = &found.summary;
//! assert!(summary.fits && summary.capability.meets_the_paper.payload_at_rest);
//! // Where a leg is nearest to an end of its stroke, and by how much.
//! let tightest = summary.stroke_margin_m;
//! assert!(tightest.value > 0.1 && tightest.at != docktwin_model::Place([0.0; 6]));
//!
//! let text = serde_json::to_string(summary)?;
//! assert!(text.contains(r#""fits":true"#));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod crosscheck;
pub mod fidelity;
pub mod mechanism;
mod number;
mod parallel;
pub mod rig;
pub mod single_dof;
pub mod stability;
pub mod table4;
pub mod vibro_impact;

pub use docktwin_run::progress::Progress;
pub use number::Complex;
