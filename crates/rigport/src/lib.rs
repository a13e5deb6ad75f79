//! The rig port: all that an adapter to a rig needs, and nothing of the loop.
//!
//! A rig is whatever takes a [`RigCommand`](message::RigCommand) once a tick and answers with a
//! [`RigMeasurement`](message::RigMeasurement). `docs/rig-protocol.md` gives every byte of both, so that
//! a rig can also be written without this crate.
//!
//! | module | what |
//! | --- | --- |
//! | [`message`] | both structures, their bits and numbers |
//! | [`guard`] | limits that the rig's end can enforce by itself |
//! | [`validate`] | which messages are refused; the rig's end of a port, safe state included |
//! | [`rig`] | the traits: [`Rig`](rig::Rig) as the loop sees it, [`Plant`](rig::Plant) behind the rig's end |
//! | [`in_process`], [`ipc`] | transports: a plant in the loop's own process, shared memory |
//! | [`clock`] | the clock of all time stamps |
//!
//! # A rig of one's own
//!
//! ```
//! use docktwin_rigport::{
//!     in_process::InProcess,
//!     message::{Capabilities, RigCommand, RigMeasurement, RigMode, Status},
//!     rig::{CommandForm, Plant, Rig},
//! };
//!
//! /// A plate that is where it is commanded, and measures its own pose.
//! struct Plate(RigMeasurement);
//!
//! impl Plant for Plate {
//!     fn command_form(&self) -> CommandForm {
//!         CommandForm::POSE
//!     }
//!
//!     fn answer(&mut self, command: &RigCommand) -> RigMeasurement {
//!         if command.mode == RigMode::Track as u32 {
//!             self.0.plate_position_m = command.plate_position_m;
//!             self.0.plate_attitude = command.plate_attitude;
//!         }
//!         self.0
//!     }
//!
//!     fn alone(&mut self, _period_ns: u64) -> RigMeasurement {
//!         self.0
//!     }
//! }
//!
//! let plate = Plate(RigMeasurement {
//!     status: Status::ENABLED,
//!     capabilities: Capabilities::PLATE_POSE,
//!     ..RigMeasurement::zero()
//! });
//! // Over shared memory: `ipc::RigServer::open("lab")?.serve(&mut plate, …)`.
//! let mut rig = InProcess::new(plate);
//! let idle = RigCommand {
//!     flags: docktwin_rigport::message::Flags::LOCKSTEP,
//!     session: 1,
//!     period_ns: 1_000_000,
//!     ..RigCommand::zero()
//! };
//! rig.send(&idle)?;
//! let track = RigCommand {
//!     mode: RigMode::Track as u32,
//!     tick: 1,
//!     plate_position_m: [0.1, 0.0, 3.0],
//!     ..idle
//! };
//! rig.send(&track)?;
//! let m = rig.receive(core::time::Duration::ZERO, 1_000_000)?.expect("it answers at once");
//! assert_eq!(m.plate_position_m, [0.1, 0.0, 3.0]);
//! # Ok::<(), docktwin_rigport::rig::RigError>(())
//! ```

pub mod clock;
pub mod guard;
pub mod in_process;
pub mod ipc;
pub mod message;
pub mod rig;
pub mod validate;
mod wire;
