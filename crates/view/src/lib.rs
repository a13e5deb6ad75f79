//! The recording of a run for the rerun viewer: a 3-D scene, plots, events and the layout
//! (*blueprint*) that arranges them.
//!
//! One timeline, `sim_time`, in simulated time since the start of the run. The scene is drawn in
//! the frame `e3`, the chaser's mounting plane: everything under the entity `scene` is relative to
//! it, so that the mechanism stays in the middle of a camera that does not move while both vehicles
//! drift through space.
//!
//! | entity | what |
//! | --- | --- |
//! | `scene/active_ring` | frame `r3`: ring and petals of the active side (orange), latches coloured by state (grey free, yellow approach, orange struck, green latched) |
//! | `scene/target`, `…/passive_ring` | frames `e4` and `r4`: ring, petals and strikers of the passive side (blue) |
//! | `scene/contacts/<class>/{point,normal,friction}` | present contacts, coloured by what touches: ring on ring yellow, petal on ring pink, petal on petal green, latch and joined rings cyan (along the axis, and thin across it); 0.5 m of arrow are 1 kN |
//! | `scene/active_ring/peaks` | of every pair that touched before and does not now, its strongest contact, dimmed |
//! | `scene/labels` | force and name of every pair that touches or touched, beside the mechanism as the camera first sees it |
//! | `scene/face/labels` | force and name of what touches now, around the mechanism as seen along the docking axis |
//! | `scene/ghost` | the other run of a comparison, in grey; its curves and table stand beside the first one's |
//! | `scene/active_ring/trace` | where the active side was ever touched |
//! | `port`, `relative`, `ring`, `energy`, `latch`, `petal_gap` | curves |
//! | `contact_table` | now and peak force of every pair of surfaces |
//! | `events` | what the run reported |
//!
//! Forces are those on the active side. Rings and petals are drawn transparent with edges, so that
//! contacts between them are visible. The viewer opens at the end of the run, where peaks and
//! trace sum it up; every plot shares one time axis.
//!
//! [`RigWriter`] records a motion simulator instead, in its ground frame `eb`: legs coloured by the room
//! their strokes have left, and the docking workspace inside the reachable one.
//!
//! Hulls are symbols, not models: a cylinder of the vehicle's own mass and inertia behind the port.
//! So are the legs of an attenuator that is given as tables.
//!
//! This crate sees no physics engine and reads no clock.

mod blueprint;
mod columns;
mod error;
mod eye;
mod mesh;
mod paths;
mod rig;
mod scene;
mod stream;
mod style;
mod whole;
mod writer;

#[doc(hidden)]
pub use whole::content;
pub use whole::is_whole;

/// Version of the viewer that recordings are written for.
pub const VIEWER_VERSION: &str = "0.36.3";

/// Where a viewer of this machine listens unless told otherwise.
pub const LIVE_URL: &str = "rerun+http://127.0.0.1:9876/proxy";

pub use error::ViewError;
pub use rig::RigWriter;
pub use writer::{ContactArrow, Energies, Frame, Scalars, SceneModel, SceneWriter};
