use core::ops::Mul;

use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// Euler angles of the paper, radians: roll φ about X, pitch θ about Y, yaw ψ about Z, composed as
/// (1): `A = Ry(θ) · Rz(ψ) · Rx(φ)`. For input and output only; integrate quaternions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Euler {
    /// φ about X, rad.
    pub roll: f64,
    /// θ about Y, rad.
    pub pitch: f64,
    /// ψ about Z, rad; singular at ±π/2.
    pub yaw: f64,
}

/// Time derivatives of [`Euler`], rad/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EulerRates {
    /// φ', rad/s.
    pub roll: f64,
    /// θ', rad/s.
    pub pitch: f64,
    /// ψ', rad/s.
    pub yaw: f64,
}

impl Euler {
    /// From degrees, as files give them.
    #[must_use]
    pub fn from_degrees(roll: f64, pitch: f64, yaw: f64) -> Self {
        Self { roll: roll.to_radians(), pitch: pitch.to_radians(), yaw: yaw.to_radians() }
    }

    /// The matrix (1).
    #[must_use]
    pub fn to_matrix(self) -> DMat3 {
        DMat3::from_rotation_y(self.pitch)
            .mul(DMat3::from_rotation_z(self.yaw))
            .mul(DMat3::from_rotation_x(self.roll))
    }

    /// (1) as a quaternion.
    #[must_use]
    pub fn to_quat(self) -> DQuat {
        DQuat::from_rotation_y(self.pitch)
            * DQuat::from_rotation_z(self.yaw)
            * DQuat::from_rotation_x(self.roll)
    }

    /// Inverse of (1), yaw in [−π/2, π/2]. At |ψ| = π/2 roll and pitch are not separable; roll is
    /// then returned as found by the two-argument arctangents.
    #[must_use]
    pub fn from_quat(q: DQuat) -> Self {
        let a = DMat3::from_quat(q);
        // Elements of (1): a21 = sψ, a11 = cθcψ, a31 = −sθcψ, a22 = cφcψ, a23 = −sφcψ.
        let (a11, a21, a31) = (a.x_axis.x, a.x_axis.y, a.x_axis.z);
        let (a22, a23) = (a.y_axis.y, a.z_axis.y);
        Self { roll: (-a23).atan2(a22), pitch: (-a31).atan2(a11), yaw: a21.clamp(-1.0, 1.0).asin() }
    }

    /// Kinematic equation (2) with the erratum corrected; `w_b` is the body rate in rad/s.
    #[must_use]
    pub fn rates(self, w_b: DVec3) -> EulerRates {
        let (s, c) = self.roll.sin_cos();
        let across = w_b.y * c - w_b.z * s;
        EulerRates {
            yaw: w_b.y * s + w_b.z * c,
            pitch: across / self.yaw.cos(),
            roll: w_b.x - self.yaw.tan() * across,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The printed matrix (1), symbol by symbol.
    fn printed_matrix(e: Euler) -> [[f64; 3]; 3] {
        let (sf, cf) = e.roll.sin_cos();
        let (st, ct) = e.pitch.sin_cos();
        let (sp, cp) = e.yaw.sin_cos();
        [
            [ct * cp, sf * st - cf * ct * sp, cf * st + sf * ct * sp],
            [sp, cf * cp, -sf * cp],
            [-st * cp, sf * ct + cf * st * sp, cf * ct - sf * st * sp],
        ]
    }

    /// (2) exactly as printed: θ and ψ interchanged against (1).
    fn printed_rates(e: Euler, w: DVec3) -> EulerRates {
        let (sf, cf) = e.roll.sin_cos();
        EulerRates {
            yaw: (w.y * cf - w.z * sf) / e.pitch.cos(),
            pitch: w.y * sf + w.z * cf,
            roll: w.x - e.pitch.tan() * (w.y * cf - w.z * sf),
        }
    }

    /// Rates by differentiating (1) along the motion R' = R [ω]×.
    fn numeric_rates(e: Euler, w: DVec3) -> EulerRates {
        let h = 1e-5;
        let at = |t: f64| Euler::from_quat(e.to_quat() * DQuat::from_scaled_axis(w * t));
        let (a, b) = (at(-h), at(h));
        let d = |x: f64, y: f64| (y - x) / (2.0 * h);
        EulerRates { roll: d(a.roll, b.roll), pitch: d(a.pitch, b.pitch), yaw: d(a.yaw, b.yaw) }
    }

    fn angles() -> impl Strategy<Value = Euler> {
        (-3.0..3.0f64, -3.0..3.0f64, -1.3..1.3f64).prop_map(|(roll, pitch, yaw)| Euler {
            roll,
            pitch,
            yaw,
        })
    }

    fn rates() -> impl Strategy<Value = DVec3> {
        (-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    proptest! {
        #[test]
        fn oracle_equation_1_is_the_printed_matrix(e in angles()) {
            let m = e.to_matrix();
            let p = printed_matrix(e);
            for (i, row) in p.iter().enumerate() {
                for (j, want) in row.iter().enumerate() {
                    prop_assert!((m.col(j)[i] - want).abs() < 1e-14);
                }
            }
            let q = DMat3::from_quat(e.to_quat());
            prop_assert!((q - m).abs_diff_eq(DMat3::ZERO, 1e-14));
        }

        #[test]
        fn invariant_euler_round_trip(e in angles()) {
            let back = Euler::from_quat(e.to_quat());
            prop_assert!(back.to_quat().dot(e.to_quat()).abs() > 1.0 - 1e-14);
            prop_assert!((back.yaw - e.yaw).abs() < 1e-9);
        }

        #[test]
        fn oracle_mended_equation_2_is_the_derivative_of_1(e in angles(), w in rates()) {
            let (got, want) = (e.rates(w), numeric_rates(e, w));
            // Rates grow like 1/cos ψ; the numeric derivative loses digits with them.
            let tol = 1e-7 / e.yaw.cos().powi(3);
            // Roll and pitch of the numeric branch may wrap at ±π.
            if e.roll.abs() < 3.0 - 1e-3 && e.pitch.abs() < 3.0 - 1e-3 {
                prop_assert!((got.yaw - want.yaw).abs() < tol);
                prop_assert!((got.pitch - want.pitch).abs() < tol);
                prop_assert!((got.roll - want.roll).abs() < tol);
            }
        }
    }

    #[test]
    fn regress_printed_equation_2_contradicts_1() {
        let e = Euler::from_degrees(15.0, 7.0, -5.0);
        let w = DVec3::new(0.01, 0.02, -0.015);
        let (printed, want) = (printed_rates(e, w), numeric_rates(e, w));
        assert!((printed.yaw - want.yaw).abs() > 1e-3, "the print would have been right");
        assert!((e.rates(w).yaw - want.yaw).abs() < 1e-9);
    }
}
