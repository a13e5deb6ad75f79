//! Motions by which a rig is asked what it is: at constant speed, and in a sine.

use core::f64::consts::TAU;

use docktwin_core::{DQuat, DVec3, Pose, Twist};
use docktwin_physics::programme::RelativeMotion;

use crate::planner::{smooth, smooth_area};

/// Unit vector of a degree of freedom, X, Y, Z, roll, pitch, yaw as 0 to 5, times `by`, in `e3`.
#[must_use]
pub fn along(dof: usize, by: f64) -> Twist {
    let axis = [DVec3::X, DVec3::Y, DVec3::Z][dof % 3] * by;
    if dof < 3 { Twist { v: axis, w: DVec3::ZERO } } else { Twist { v: DVec3::ZERO, w: axis } }
}

/// By what a pose is away from `place`: way of the origin of `e4`, m, and rotation vector, rad, both in `e3`.
#[must_use]
pub fn apart(place: &Pose, x_34: &Pose) -> Twist {
    let mut q = (x_34.q * place.q.conjugate()).normalize();
    if q.w < 0.0 {
        q = -q;
    }
    Twist { v: x_34.p - place.p, w: q.to_scaled_axis() }
}

/// The same, component by component.
#[must_use]
pub fn displacement(place: &Pose, x_34: &Pose) -> [f64; 6] {
    let Twist { v, w } = apart(place, x_34);
    [v.x, v.y, v.z, w.x, w.y, w.z]
}

/// The motion that is displaced along one degree of freedom by `x[0]`, with its derivatives.
pub(crate) fn displaced(place: &Pose, dof: usize, x: [f64; 4]) -> RelativeMotion {
    let way = along(dof, x[0]);
    RelativeMotion {
        x_34: Pose::new(place.p + way.v, (DQuat::from_scaled_axis(way.w) * place.q).normalize()),
        twist: along(dof, x[1]),
        acceleration: along(dof, x[2]),
        jerk: along(dof, x[3]),
    }
}

/// A sine of `w` rad/s under an envelope, both with three derivatives.
pub(crate) fn swinging(e: [f64; 4], w: f64, t: f64) -> [f64; 4] {
    let (s, c) = (w * t).sin_cos();
    let f = [s, w * c, -w * w * s, -w * w * w * c];
    [
        e[0] * f[0],
        e[1] * f[0] + e[0] * f[1],
        e[2] * f[0] + 2.0 * e[1] * f[1] + e[0] * f[2],
        e[3] * f[0] + 3.0 * e[2] * f[1] + 3.0 * e[1] * f[2] + e[0] * f[3],
    ]
}

/// From rest to a constant speed and to rest again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cruise {
    /// Where it begins, `X_34`.
    pub from: Pose,
    /// Degree of freedom, 0 to 5.
    pub dof: usize,
    /// Speed, m/s or rad/s; signed.
    pub speed: f64,
    /// Time to reach it, and to lose it, s.
    pub ramp_s: f64,
    /// Time at constant speed, s.
    pub steady_s: f64,
}

impl Cruise {
    /// From its begin to its end, s.
    #[must_use]
    pub const fn duration_s(&self) -> f64 {
        2.0 * self.ramp_s + self.steady_s
    }

    /// Its whole way, m or rad.
    #[must_use]
    pub const fn way(&self) -> f64 {
        self.speed * (self.ramp_s + self.steady_s)
    }

    /// The motion `time_s` after its begin.
    #[must_use]
    pub fn at(&self, time_s: f64) -> RelativeMotion {
        let (r, v) = (self.ramp_s, self.speed);
        let end = self.duration_s();
        let t = time_s.clamp(0.0, end);
        // The way out is the way in, seen from the end.
        let out = t > r + self.steady_s;
        let near = if out { end - t } else { t };
        let x = if near < r {
            let u = near / r;
            let [p, p1, p2, _] = smooth(u);
            [v * r * smooth_area(u), v * p, v * p1 / r, v * p2 / (r * r)]
        } else {
            [v * (near - 0.5 * r), v, 0.0, 0.0]
        };
        let x = if out { [self.way() - x[0], x[1], -x[2], x[3]] } else { x };
        displaced(&self.from, self.dof, x)
    }
}

/// A sine about a place that begins and ends softly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sine {
    /// The place it swings about, `X_34`.
    pub about: Pose,
    /// Degree of freedom, 0 to 5.
    pub dof: usize,
    /// Amplitude, m or rad.
    pub amplitude: f64,
    /// Frequency, Hz.
    pub hz: f64,
    /// Time in which it grows, and in which it dies away, s.
    pub ramp_s: f64,
    /// Time at full amplitude, s.
    pub steady_s: f64,
}

impl Sine {
    /// From its begin to its end, s.
    #[must_use]
    pub const fn duration_s(&self) -> f64 {
        2.0 * self.ramp_s + self.steady_s
    }

    /// The motion `time_s` after its begin.
    #[must_use]
    pub fn at(&self, time_s: f64) -> RelativeMotion {
        let (r, end) = (self.ramp_s, self.duration_s());
        let t = time_s.clamp(0.0, end);
        let out = t > r + self.steady_s;
        let e = smooth(if out { end - t } else { t } / r);
        let sign = if out { -1.0 } else { 1.0 };
        let e = [e[0], sign * e[1] / r, e[2] / (r * r), sign * e[3] / (r * r * r)];
        let x = swinging(e, TAU * self.hz, t);
        displaced(&self.about, self.dof, x.map(|x| x * self.amplitude))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every derivative is that of the one before, across all joints.
    #[test]
    fn oracle_derivatives() {
        let from = Pose::new(DVec3::new(0.6, 0.0, 0.1), DQuat::from_rotation_z(0.1));
        let cruise = Cruise { from, dof: 0, speed: -0.08, ramp_s: 0.5, steady_s: 1.0 };
        let sine =
            Sine { about: from, dof: 1, amplitude: 0.006, hz: 3.0, ramp_s: 0.4, steady_s: 1.0 };
        let motions: [&dyn Fn(f64) -> RelativeMotion; 2] = [&|t| cruise.at(t), &|t| sine.at(t)];
        for (dof, motion) in motions.into_iter().enumerate() {
            let read = |t: f64| {
                let m = motion(t);
                let pick = |v: DVec3| if dof == 0 { v.x } else { v.y };
                [m.x_34.p, m.twist.v, m.acceleration.v, m.jerk.v].map(pick)
            };
            let h = 1e-5;
            for i in 1..200 {
                let t = f64::from(i) * 0.01 - 0.0013;
                let (a, b, here) = (read(t - h), read(t + h), read(t));
                for k in 0..3 {
                    let slope = (b[k] - a[k]) / (2.0 * h);
                    let scale = [0.1, 1.0, 30.0][k];
                    assert!((slope - here[k + 1]).abs() < 1e-4 * scale, "{dof} {t} {k}");
                }
            }
        }
        assert!((cruise.at(9.0).x_34.p.x - from.p.x - cruise.way()).abs() < 1e-12);
        assert!((sine.at(9.0).x_34.p - from.p).length() < 1e-12);
    }

    #[test]
    fn oracle_displacement_is_what_was_displaced() {
        let place = Pose::new(DVec3::X, DQuat::from_rotation_y(0.2));
        for dof in 0..6 {
            let x = displaced(&place, dof, [0.01, 0.0, 0.0, 0.0]).x_34;
            for (i, d) in displacement(&place, &x).into_iter().enumerate() {
                assert!((d - if i == dof { 0.01 } else { 0.0 }).abs() < 1e-12);
            }
        }
    }
}
