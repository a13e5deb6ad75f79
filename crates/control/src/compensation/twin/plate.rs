//! Where the plate is and how it moves, between two ticks.

use docktwin_core::{DVec3, Pose, Twist};
use docktwin_model::Rig;
use docktwin_physics::programme::RelativeMotion;

/// Pose and motion of the plate at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Plate {
    /// `X_bp`.
    pub(super) x_bp: Pose,
    /// Velocity of the origin of `ep` and angular velocity, in `eb`.
    pub(super) twist: Twist,
}

impl Plate {
    /// The plate that shows a relative motion exactly.
    pub(super) fn of_bodies(rig: &Rig, motion: &RelativeMotion) -> Self {
        let x_b3 = rig.x_b0 * rig.x_03;
        let Twist { v, w } = motion.twist;
        let arm = motion.x_34.q * rig.x_4p.p;
        Self {
            x_bp: rig.plate_from_docking(&motion.x_34),
            twist: Twist { v: x_b3.q * (v + w.cross(arm)), w: x_b3.q * w },
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
