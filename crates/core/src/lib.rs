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
//! ```
//! use docktwin_core::{DVec3, Euler, Pose, Wrench};
//!
//! // The target's port 2 m ahead of the chaser's along the docking axis, rolled by 15 degrees.
//! let x_34 = Pose::new(DVec3::X * 2.0, Euler::from_degrees(15.0, 0.0, 0.0).to_quat());
//! assert!((x_34 * x_34.inverse()).p.length() < 1e-15);
//!
//! // 100 N along +X4, 0.6 m off the axis along Y4: F4, M4 about the origin of e4, in e4 ...
//! let port4 = Wrench::at(DVec3::Y * 0.6, DVec3::X * 100.0);
//! assert!((port4.m - DVec3::Z * -60.0).length() < 1e-12);
//! // ... and the same about the origin of e3, in the axes of e3.
//! let at_3 = port4.rotated(x_34.q).shifted(-x_34.p);
//! assert!((at_3.m.length() - 60.0).abs() < 1e-12);
//! ```
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
pub use time::{FULL_STEPS_PER_MS, PERIOD_NS, REDUCED_STEPS_PER_MS, SimTime, Tick};
