//! A pair of surfaces at hand, in its frame.

use docktwin_core::{DMat3, DVec3, Pose};

use super::memory::ContactState;

/// A pose with its rotation as a matrix: for many points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) r: DMat3,
    pub(crate) p: DVec3,
}

impl Frame {
    pub(crate) const IDENTITY: Self = Self { r: DMat3::IDENTITY, p: DVec3::ZERO };

    pub(crate) fn of(x: Pose) -> Self {
        Self { r: DMat3::from_quat(x.q), p: x.p }
    }

    /// About the X axis.
    pub(crate) fn turned(angle: f64) -> Self {
        Self { r: DMat3::from_rotation_x(angle), p: DVec3::ZERO }
    }

    pub(crate) fn inverse(&self) -> Self {
        let r = self.r.transpose();
        Self { r, p: -(r * self.p) }
    }

    pub(crate) fn point(&self, x: DVec3) -> DVec3 {
        self.r * x + self.p
    }
}

impl core::ops::Mul for Frame {
    type Output = Self;

    fn mul(self, rhs: Self) -> Self {
        Self { r: self.r * rhs.r, p: self.r * rhs.p + self.p }
    }
}

/// The pair at hand, and what is remembered of it.
pub(crate) struct Look<'a> {
    pub(crate) state: &'a ContactState,
    pub(crate) pair: usize,
    /// Frame of the pair's first surface in the active ring's.
    pub(crate) first: Frame,
    /// −1 where the first surface is the passive one.
    pub(crate) sign: f64,
}

impl Look<'_> {
    /// The deepest cell of the step before, with the normal in the first surface's frame and the depth, where
    /// the cores are about to meet or have met.
    pub(crate) fn meeting(&self, sum: f64) -> Option<(usize, DVec3, f64)> {
        let t = self.state.of_pair(self.pair).max_by(|a, b| a.depth.total_cmp(&b.depth))?;
        (t.depth > sum - ABOUT_TO_MEET_M).then(|| {
            (usize::from(t.cell), self.first.r.transpose() * t.normal * self.sign, t.depth)
        })
    }
}

/// Cores this near are followed by the side on which they were, m.
pub(crate) const MEETING_M: f64 = 1e-3;
/// A place this near to meeting is looked at with its side first, m.
const ABOUT_TO_MEET_M: f64 = 5e-3;
