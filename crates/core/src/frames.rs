use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// A rigid pose `X_AB`: where frame B is, seen from frame A.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// `p_AB_A`, metres.
    pub p: DVec3,
    /// `R_AB` as a unit quaternion.
    pub q: DQuat,
}

impl Default for Pose {
    #[inline]
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Pose {
    /// B coincides with A.
    pub const IDENTITY: Self = Self { p: DVec3::ZERO, q: DQuat::IDENTITY };

    /// From position (m) and attitude.
    #[must_use]
    #[inline]
    pub const fn new(p: DVec3, q: DQuat) -> Self {
        Self { p, q }
    }

    /// Pure translation, metres.
    #[must_use]
    #[inline]
    pub const fn from_translation(p: DVec3) -> Self {
        Self { p, q: DQuat::IDENTITY }
    }

    /// `X_BA`.
    #[must_use]
    #[inline]
    pub fn inverse(&self) -> Self {
        let q = self.q.conjugate();
        Self { p: -(q * self.p), q }
    }

    /// Takes a point given in B to A.
    #[must_use]
    #[inline]
    pub fn transform_point(&self, p_b: DVec3) -> DVec3 {
        self.p + self.q * p_b
    }

    /// Takes a point given in A to B.
    #[must_use]
    #[inline]
    pub fn inverse_transform_point(&self, p_a: DVec3) -> DVec3 {
        self.q.conjugate() * (p_a - self.p)
    }

    /// True when every component is a finite number.
    #[must_use]
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.p.is_finite() && self.q.is_finite()
    }
}

impl core::ops::Mul for Pose {
    type Output = Self;
    /// `X_AC = X_AB * X_BC`.
    #[inline]
    fn mul(self, rhs: Self) -> Self {
        Self { p: self.p + self.q * rhs.p, q: (self.q * rhs.q).normalize() }
    }
}

/// Velocity of a body at a point: linear (m/s) and angular (rad/s), one frame for both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Linear velocity, m/s.
    pub v: DVec3,
    /// Angular velocity, rad/s.
    pub w: DVec3,
}

/// Force (N) and moment (N·m) about a stated point, one frame for both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Wrench {
    /// Force, N.
    pub f: DVec3,
    /// Moment, N·m.
    pub m: DVec3,
}

impl Wrench {
    /// No force and no moment.
    pub const ZERO: Self = Self { f: DVec3::ZERO, m: DVec3::ZERO };

    /// A force `f` applied at `arm` from the reference point.
    #[must_use]
    #[inline]
    pub fn at(arm: DVec3, f: DVec3) -> Self {
        Self { f, m: arm.cross(f) }
    }

    /// Adds a force `f` applied at `arm` from the reference point.
    #[inline]
    pub fn push(&mut self, arm: DVec3, f: DVec3) {
        self.f += f;
        self.m += arm.cross(f);
    }

    /// The same wrench about a point displaced by `d` from the present reference point.
    #[must_use]
    #[inline]
    pub fn shifted(&self, d: DVec3) -> Self {
        Self { f: self.f, m: self.m - d.cross(self.f) }
    }

    /// Both parts turned by `q`.
    #[must_use]
    #[inline]
    pub fn rotated(&self, q: DQuat) -> Self {
        Self { f: q * self.f, m: q * self.m }
    }

    /// True when every component is a finite number.
    #[must_use]
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.f.is_finite() && self.m.is_finite()
    }
}

impl core::ops::Add for Wrench {
    type Output = Self;
    #[inline]
    fn add(self, rhs: Self) -> Self {
        Self { f: self.f + rhs.f, m: self.m + rhs.m }
    }
}

impl core::ops::AddAssign for Wrench {
    #[inline]
    fn add_assign(&mut self, rhs: Self) {
        *self = *self + rhs;
    }
}

impl core::ops::Sub for Wrench {
    type Output = Self;
    #[inline]
    fn sub(self, rhs: Self) -> Self {
        Self { f: self.f - rhs.f, m: self.m - rhs.m }
    }
}

impl core::ops::Mul<f64> for Wrench {
    type Output = Self;
    #[inline]
    fn mul(self, rhs: f64) -> Self {
        Self { f: self.f * rhs, m: self.m * rhs }
    }
}

impl core::ops::Neg for Wrench {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { f: -self.f, m: -self.m }
    }
}

/// The cross-product matrix: `skew(a) * b = a × b`.
#[must_use]
#[inline]
pub fn skew(a: DVec3) -> DMat3 {
    DMat3::from_cols(
        DVec3::new(0.0, a.z, -a.y),
        DVec3::new(-a.z, 0.0, a.x),
        DVec3::new(a.y, -a.x, 0.0),
    )
}

/// `I_W = R_WB I_B R_BW`, kg·m².
#[must_use]
#[inline]
pub fn inertia_world(q_wb: DQuat, inertia_b: DMat3) -> DMat3 {
    let r = DMat3::from_quat(q_wb);
    r * inertia_b * r.transpose()
}
