//! Where the plate is and how it moves, between two ticks.

use docktwin_core::{DVec3, Pose, Twist};
use docktwin_physics::{platform::Platform, programme::RelativeMotion};

/// Pose and motion of the plate at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::compensation) struct Plate {
    /// `X_bp`.
    pub(in crate::compensation) x_bp: Pose,
    /// Velocity of the origin of `ep` and angular velocity, in `eb`.
    pub(in crate::compensation) twist: Twist,
}

impl Plate {
    /// The plate that shows a relative motion exactly.
    pub(in crate::compensation) fn of_bodies(platform: &Platform, motion: &RelativeMotion) -> Self {
        Self {
            x_bp: platform.plate_from_docking(&motion.x_34),
            twist: platform.plate_twist(&motion.x_34, &motion.twist),
        }
    }

    /// A part of the way from `a` to `b`. Over a tick the bend of the way is below 1 µm.
    pub(super) fn between(a: &Self, b: &Self, part: f64) -> Self {
        let mix = |x: DVec3, y: DVec3| x + (y - x) * part;
        Self {
            x_bp: Pose::new(mix(a.x_bp.p, b.x_bp.p), a.x_bp.q.slerp(b.x_bp.q, part)),
            twist: Twist { v: mix(a.twist.v, b.twist.v), w: mix(a.twist.w, b.twist.w) },
        }
    }
}
