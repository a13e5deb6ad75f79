use docktwin_core::DVec3;
use docktwin_model::{DockingMechanism, SideGeometry};

/// Tangent of half the viewer's vertical field of view (55°).
pub(crate) const HALF_HEIGHT: f64 = 0.5206;

/// The eye of the 3-D view, in `e3`.
#[derive(Clone, Copy)]
pub(crate) struct Eye {
    /// m.
    pub(crate) position: DVec3,
    /// What it looks at, m.
    pub(crate) target: DVec3,
    right: DVec3,
    down: DVec3,
}

/// Largest radius of the guiding surfaces, m.
pub(crate) fn reach(m: &DockingMechanism) -> f64 {
    [&m.active, &m.passive].iter().fold(0.1, |r, side: &&SideGeometry| {
        let ring = side.ring.mean_radius_m + side.ring.section_radius_m;
        let petals = side.petals.map_or(0.0, |p| p.base_radius_m.max(p.tip_radius_m));
        r.max(ring).max(petals)
    })
}

impl Eye {
    /// From the side, and somewhat from the front and above, at the place where the rings meet.
    pub(crate) fn new(m: &DockingMechanism) -> Self {
        let target = DVec3::X * m.ring_rest_offset_m;
        let position = target + DVec3::new(1.15, -2.1, 1.12) * reach(m);
        let ahead = target - position;
        let right = ahead.cross(DVec3::Z).normalize_or(DVec3::X);
        let down = ahead.cross(right).normalize_or(DVec3::NEG_Z);
        Self { position, target, right, down }
    }

    /// From the chaser along the docking axis: +Y is to the left, +Z up.
    pub(crate) fn face_on(m: &DockingMechanism) -> Self {
        let target = DVec3::X * m.ring_rest_offset_m;
        let position = target - DVec3::X * (2.75 * reach(m));
        Self { position, target, right: DVec3::NEG_Y, down: DVec3::NEG_Z }
    }

    /// The point seen at `x` to the right of the middle and `y` below it, in half heights of the
    /// view, at `depth` of the way to the target.
    pub(crate) fn point(&self, [x, y]: [f64; 2], depth: f64) -> DVec3 {
        let ahead = self.target - self.position;
        let scale = HALF_HEIGHT * ahead.length();
        self.position + (ahead + (self.right * x + self.down * y) * scale) * depth
    }

    /// Toward the right of the view.
    pub(crate) fn right(&self) -> DVec3 {
        self.right
    }

    /// Where a point in front of the eye is seen; inverse of [`Eye::point`].
    pub(crate) fn seen_at(&self, p: DVec3) -> [f64; 2] {
        let ahead = (self.target - self.position).normalize_or(DVec3::X);
        let from = p - self.position;
        let scale = HALF_HEIGHT * from.dot(ahead).max(1e-3);
        [from.dot(self.right) / scale, from.dot(self.down) / scale]
    }
}
