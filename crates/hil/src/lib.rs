//! The loop with a rig: the same code for emulated and physical rigs.
//!
//! What passes between loop and rig is `docktwin-rigport`; here are the loop ([`scheduler`]), its clocks,
//! emulated rigs with their faults, what is found out about a rig by driving it, and what a machine offers a
//! loop ([`machine`]).
//!
//! # A docking on an emulated rig, stepped by hand
//!
//! ```
//! use std::path::Path;
//!
//! use docktwin_control::compensation::Compensation;
//! use docktwin_core::{DVec3, PERIOD_NS};
//! use docktwin_hil::{
//!     clock::VirtualClock,
//!     emulated::{EmulatedRig, clear},
//!     faults::{Fault, FaultKind, FaultyRig, When},
//!     scheduler::{Loop, LoopSetup, RigParameters},
//! };
//! use docktwin_model::{load_mechanism, load_rig, load_spacecraft};
//! use docktwin_physics::{
//!     initial::{ContactConditions, initial_state},
//!     mechanism::System,
//!     reduced::Inputs,
//! };
//! use docktwin_rigport::in_process::InProcess;
//!
//! let file = |name: &str| Path::new("../../models/urdf").join(name);
//! let rig = load_rig(&file("stewart.urdf"))?.model;
//! let preset = rig.preset(None);
//! let mechanism = load_mechanism(&file("apas_active.urdf"), &file("apas_passive.urdf"), None)?.model;
//! let chaser = load_spacecraft(&file("chaser_8t.urdf"))?.model;
//! let target = load_spacecraft(&file("target_12t.urdf"))?.model;
//! let system = System::new(&chaser, &target, mechanism);
//! let straight_on =
//!     ContactConditions { velocity_m_s: DVec3::X * -0.1, ..ContactConditions::default() };
//! let bodies = initial_state(&system, &straight_on, 0.02).bodies;
//!
//! // The rig, at rest where nothing touches; half a second into its motion a leg runs away.
//! let at = clear(&rig, &system);
//! let emulated = EmulatedRig::new(&rig, preset, None, 1, system.clone(), &at)?;
//! let runaway = Fault::from(FaultKind::LegRunaway(2), When::Tracking(0.5)).sized(0.2);
//! let emulated = FaultyRig::new(InProcess::new(emulated), &[runaway]);
//!
//! let lead_s = RigParameters::new(&rig, None, None).lead_s;
//! let setup = LoopSetup::builder(&rig, preset, &system, &bodies)
//!     .compensation(Compensation::Lead(lead_s))
//!     .run_up_s(0.4)
//!     .ticks(1000)
//!     .build()?;
//! let mut running = Loop::new(setup, emulated, VirtualClock::new(PERIOD_NS)).arm(Vec::new())?.start();
//! while !running.finished() {
//!     let tick = running.tick(&Inputs::default())?;
//!     assert!(tick.fresh);
//! }
//! let end = running.stop().into_end();
//! assert_eq!(end.trip.expect("the supervisor stops it").limit.name(), "tracking_error_m");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod calibrate;
pub mod clock;
mod commands;
pub mod drive;
pub mod emulated;
pub mod faults;
pub mod histogram;
pub mod ideal;
pub mod identify;
pub mod machine;
pub mod pushed;
pub mod realtime;
pub mod scheduler;
