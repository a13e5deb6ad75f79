//! The delays that a method has to undo, told apart as far as the files do.

use docktwin_model::PositionLoop;
use docktwin_physics::programme::RelativeMotion;

use super::Believed;
/// Lag of the plate behind its command, and of the force sensor behind the force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Delays {
    /// Dead time of the plate, s.
    dead_s: f64,
    /// Lag of the drives: coefficients of s and s² of the inverse of their transfer function, s and s².
    lag: [f64; 2],
    /// Of the sensor that F4, M4 come from, s.
    pub(super) sensor_s: f64,
}

impl Delays {
    /// Of a rig as believed; `lead_s` is the lag of plate and sensor together, as identified or believed.
    pub(super) fn new(believed: &Believed<'_>, lead_s: f64) -> Self {
        let of_sensor = believed.sensor_lag_s();
        let sensor_s = of_sensor.clamp(0.0, lead_s);
        let plate_s = lead_s - sensor_s;
        // Legs on oil are undone by their own feed-forward: what is left is dead time.
        let [first, second] =
            believed.rig.drive.position_loop().map_or([0.0; 2], PositionLoop::inverse);
        // Drives that are quicker than the file says.
        let part = if first > plate_s { plate_s / first } else { 1.0 };
        let lag = [first * part, second * part * part];
        Self { dead_s: plate_s - lag[0], lag, sensor_s }
    }

    /// Lag of plate and sensor together, s.
    pub(super) const fn lead_s(&self) -> f64 {
        self.plate_s() + self.sensor_s
    }

    /// Lag of the plate, s.
    pub(super) const fn plate_s(&self) -> f64 {
        self.dead_s + self.lag[0]
    }

    /// Coefficients of s and s² of the inverse of the plate, s and s².
    pub(super) fn of_plate(&self) -> [f64; 2] {
        let [c1, c2, _] = self.series(0.0);
        [c1, c2]
    }

    /// The command with which the plate is at `next` in its time, the dead time by a series and the drives by their
    /// inverse, both to the acceleration; `further_s` more dead time.
    pub(super) fn undo(&self, next: &RelativeMotion, further_s: f64) -> RelativeMotion {
        let [c1, c2, _] = self.series(further_s);
        next.by_series([c1, c2, 0.0])
    }

    /// The same to the jerk.
    pub(super) fn undo_to_jerk(&self, next: &RelativeMotion, further_s: f64) -> RelativeMotion {
        next.by_series(self.series(further_s))
    }

    /// Coefficients of s, s² and s³ of e^(ds) (1 + a₁ s + a₂ s²).
    fn series(&self, further_s: f64) -> [f64; 3] {
        let d = self.dead_s + further_s;
        let [a1, a2] = self.lag;
        [d + a1, d * d / 2.0 + d * a1 + a2, d * d * d / 6.0 + d * d * a1 / 2.0 + d * a2]
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::TAU;

    use docktwin_core::{DVec3, Pose, Twist};

    use super::*;

    /// A sine behind a dead time and a second order is where it is to be: x = sin ωt, the command of the inverse lags
    /// by the phase of both, and the error is of third order in ω.
    #[test]
    fn oracle_the_command_is_undone_by_the_drive() {
        let (hz, w0, z, dead) = (1.0_f64, TAU * 12.0, 0.7, 0.004);
        let delays = Delays { dead_s: dead, lag: [2.0 * z / w0, 1.0 / (w0 * w0)], sensor_s: 0.0 };
        let w = TAU * hz;
        let at = |t: f64| RelativeMotion {
            x_34: Pose::from_translation(DVec3::X * (w * t).sin()),
            twist: Twist { v: DVec3::X * (w * (w * t).cos()), w: DVec3::ZERO },
            acceleration: Twist { v: DVec3::X * (-w * w * (w * t).sin()), w: DVec3::ZERO },
            jerk: Twist { v: DVec3::X * (-w * w * w * (w * t).cos()), w: DVec3::ZERO },
        };
        // As a complex amplitude: command over motion, times the drive, is 1 but for the dead time's cube.
        let (re, im) =
            (delays.undo(&at(0.25 / hz), 0.0).x_34.p.x, delays.undo(&at(0.0), 0.0).x_34.p.x);
        let command = num(re, im);
        let s = num(0.0, w);
        let drive = num(1.0, 0.0) / (num(1.0, 0.0) + s * (2.0 * z / w0) + s * s / (w0 * w0));
        let shown = command * drive * (-s * dead).exp();
        // Dead time by a series to the second order leaves (ωd)³/6, and beside the drive ω³ (d a₂ + d² a₁/2).
        let left = (w * dead).powi(3) / 6.0 + w.powi(3) * (dead / (w0 * w0) + dead * dead * z / w0);
        assert!((shown - num(1.0, 0.0)).norm() < 1.2 * left, "{shown} {left}");
        // To the jerk a tenth of that and less is left.
        let to_jerk = |t: f64| delays.undo_to_jerk(&at(t), 0.0).x_34.p.x;
        let shown = num(to_jerk(0.25 / hz), to_jerk(0.0)) * drive * (-s * dead).exp();
        assert!((shown - num(1.0, 0.0)).norm() < 0.2 * left, "{shown} {left}");
    }

    fn num(re: f64, im: f64) -> nalgebra::Complex<f64> {
        nalgebra::Complex::new(re, im)
    }
}
