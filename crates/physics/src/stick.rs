//! The spring stick of the validation model (§7.4 of the paper): (15) in six degrees of freedom.
//!
//! A cantilever of steel stands with play in a frame. Every component of the pose of `e4` in `e3`,
//! counted from docked, has free play and then a spring on either side; the rotation vector counts
//! with a lever, `K r²` and play over `r`, so that natural frequencies stay for `I = m r²`. All of it
//! derives from one potential, so nothing is lost and nothing gained.

use docktwin_core::{DVec3, Pose};
use docktwin_model::Stick;

use crate::attenuator::left_jacobian_inverse;

/// The stick at one relative pose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StickContact {
    /// Bend beyond the play, axes of `e3`, m.
    pub bend_m: DVec3,
    /// Turn beyond the play (rotation vector), rad.
    pub turn_rad: DVec3,
    /// Force on the target at the origin of `e4`, axes of `e3`, N.
    pub force_n: DVec3,
    /// Couple on the target, axes of `e3`, N·m.
    pub couple_nm: DVec3,
    /// Stored energy, J.
    pub stored_j: f64,
    /// The largest bend, turns at the lever, m.
    pub depth_m: f64,
}

/// What is left of `x` beyond a play to both sides.
fn beyond(x: DVec3, play: f64) -> DVec3 {
    x - x.clamp(DVec3::splat(-play), DVec3::splat(play))
}

impl StickContact {
    /// Measures the stick at `x_34`, `docked_m` being the distance of the mounting planes at which it
    /// stands in the middle.
    #[must_use]
    pub fn measure(stick: &Stick, docked_m: f64, x_34: &Pose) -> Self {
        let (k, r) = (stick.stiffness_n_m, stick.lever_m);
        let bend_m = beyond(x_34.p - DVec3::X * docked_m, stick.play_m());
        let turn = x_34.q.to_scaled_axis();
        let turn_rad = beyond(turn, stick.play_m() / r);
        let k_turn = k * r * r;
        // Power of the couple is −∂V/∂ψ · ψ', and ψ' = J_l⁻¹(ψ) ω.
        let couple_nm = left_jacobian_inverse(turn).transpose() * (turn_rad * -k_turn);
        Self {
            bend_m,
            turn_rad,
            force_n: bend_m * -k,
            couple_nm,
            stored_j: 0.5 * (k * bend_m.length_squared() + k_turn * turn_rad.length_squared()),
            depth_m: bend_m.abs().max_element().max(turn_rad.abs().max_element() * r),
        }
    }

    /// True when the stick touches its frame.
    #[must_use]
    pub fn touching(&self) -> bool {
        self.depth_m > 0.0
    }
}

#[cfg(test)]
mod tests {
    use docktwin_core::DQuat;

    use super::*;

    const STICK: Stick =
        Stick { stiffness_n_m: 35.4e3, diameter_m: 0.0075, frame_opening_m: 0.0275, lever_m: 0.5 };

    #[test]
    fn oracle_force_is_that_of_15() {
        let at = |x: f64| {
            StickContact::measure(
                &STICK,
                0.6,
                &Pose::from_translation(DVec3::new(0.6 + x, 0.0, 0.0)),
            )
        };
        let (k, half) = (STICK.stiffness_n_m, 0.5 * (0.0275 - 0.0075));
        for x in [-0.016, -0.01, -0.004, 0.0, 0.0099, 0.0101, 0.013] {
            let want = if x > half {
                -k * (x - half)
            } else if x < -half {
                -k * (x + half)
            } else {
                0.0
            };
            assert!((at(x).force_n.x - want).abs() < 1e-9, "{x}");
            assert!(at(x).force_n.y.abs() + at(x).couple_nm.length() < 1e-12);
        }
        assert!(!at(0.0099).touching() && at(0.0101).touching());
    }

    #[test]
    fn invariant_wrench_is_the_gradient_of_the_energy() {
        let x = Pose::new(
            DVec3::new(0.613, -0.0125, 0.0111),
            DQuat::from_scaled_axis(DVec3::new(0.031, -0.027, 0.024)),
        );
        let s = StickContact::measure(&STICK, 0.6, &x);
        let energy = |x: &Pose| StickContact::measure(&STICK, 0.6, x).stored_j;
        let h = 1e-6;
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let moved = |s: f64| energy(&Pose::new(x.p + axis * s, x.q));
            let slope = (moved(h) - moved(-h)) / (2.0 * h);
            assert!((slope + s.force_n.dot(axis)).abs() < 1e-4);
            let turned = |s: f64| energy(&Pose::new(x.p, DQuat::from_scaled_axis(axis * s) * x.q));
            let slope = (turned(h) - turned(-h)) / (2.0 * h);
            assert!((slope + s.couple_nm.dot(axis)).abs() < 1e-4);
        }
    }
}
