//! A circle about the X axis of its frame.

use docktwin_core::DVec3;

/// Centre circle of a ring in the plane x = 0 of its ring frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Circle {
    /// Radius of the circle, m.
    pub(crate) radius: f64,
    /// Radius of the ball that sweeps it, m.
    pub(crate) ball: f64,
}

impl Circle {
    /// Point at azimuth `a` (from +Y toward +Z).
    pub(crate) fn at(&self, a: f64) -> DVec3 {
        let (s, c) = a.sin_cos();
        DVec3::new(0.0, self.radius * c, self.radius * s)
    }
}
