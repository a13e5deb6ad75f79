//! The vocabulary of docktwin: frames, poses, twists, wrenches, Euler angles, time, digests.
//!
//! SI units and radians throughout. `R_AB` takes components in B to components in A; `p_AB_E` is
//! the position of B from A, expressed in E. The frames are those of the paper (Fig. 2, 27, 28):
//!
//! | frame | place |
//! | --- | --- |
//! | `e` (world) | inertial |
//! | `e1`, `e2` | chaser and target, at their mass centres |
//! | `e3`, `e4` | mounting planes of the active and the passive docking mechanism; +X is the docking axis, from chaser to target |
//!
//! This crate sees no file, no clock and no physics engine.

mod contact;
mod digest;
mod euler;
mod frames;
mod time;

pub use contact::{CONTACT_GAP_NS, ContactChange, ContactSpan, PORT_CONTACT_N};
pub use digest::{Digest, StateHasher};
pub use euler::{Euler, EulerRates};
pub use frames::{Pose, Twist, Wrench, inertia_world, skew};
pub use glam::{DMat3, DQuat, DVec3};
pub use time::{PERIOD_NS, SimTime, Tick};
