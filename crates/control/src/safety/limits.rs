//! The limits of a run, by name.

use docktwin_model::Rig;

use super::Limit;

/// What ends a run. Every limit has the name of its line in `safety.min_margin`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyLimits {
    /// Least room of a leg to either end of its stroke, measured or commanded, m. Default 0.02,
    /// chosen: a stop from a slow approach ends in it, one from 0.35 m/s needs 0.031 m. A larger one stops
    /// earlier.
    pub stroke_margin_m: f64,
    /// Fastest leg, measured or commanded, m/s. Default 0.95 of `leg_speed_m_s` of the rig's file: beyond
    /// that a leg does not follow.
    pub leg_speed_m_s: f64,
    /// Strongest leg, N. Default `leg_force_n` of the rig's file.
    pub leg_force_n: f64,
    /// Largest force at a port, tared, N. Default 1.2 times the largest that the mechanism's file
    /// allows; `loop.force_limit_n` of a scenario.
    pub port_force_n: f64,
    /// Largest moment at a port, tared, N·m. Default as for the force; `loop.moment_limit_nm`.
    pub port_moment_nm: f64,
    /// Furthest relative pose from the middle of the docking workspace, measured or commanded, in
    /// half-widths of its box. Default 1.7, chosen: the box is where dockings take place, and the rig
    /// reaches beyond it as far as `analyze workspace` says.
    pub pose_half_widths: f64,
    /// Largest deviation of the measured from the commanded pose, m; turns at the radius of the plate
    /// joints. Default 0.02: more than twice what the emulated rig needs at the fastest approach.
    pub tracking_error_m: f64,
    /// Most ticks in a row without a usable measurement. Default 10: after as many periods without
    /// a command a rig goes to its safe state.
    pub ticks_without_measurement: u32,
    /// Most measurements in a row in which a sensor repeats the one before to the last bit. Default 20: a
    /// sensor that is alive shows its noise; arming asks for the same.
    pub sensor_frozen_ticks: u32,
    /// Most energy that the loop may add, over the kinetic energy of the relative motion: from half of it on the motion
    /// is damped. Default none: a docking is then judged by its bounds afterwards; `loop.energy_limit`.
    pub energy_gained: Option<f64>,
}

/// Threshold between 0 (no) and 1 (yes), for rules that are only true or false.
const YES_OR_NO: f64 = 0.5;

impl SafetyLimits {
    /// What the rig's file allows, and loads at the ports (N, N·m).
    #[must_use]
    pub fn of_rig(rig: &Rig, force_n: f64, moment_nm: f64) -> Self {
        Self {
            stroke_margin_m: 0.02,
            leg_speed_m_s: 0.95 * rig.limits.speed_m_s,
            leg_force_n: rig.limits.force_n,
            port_force_n: force_n,
            port_moment_nm: moment_nm,
            pose_half_widths: 1.7,
            tracking_error_m: 0.02,
            ticks_without_measurement: 10,
            sensor_frozen_ticks: 20,
            energy_gained: None,
        }
    }

    /// The limit of one rule, as its trips and margins state it.
    #[must_use]
    pub fn of(&self, limit: Limit) -> f64 {
        match limit {
            Limit::Stroke => self.stroke_margin_m,
            Limit::LegSpeed => self.leg_speed_m_s,
            Limit::LegForce => self.leg_force_n,
            Limit::Force => self.port_force_n,
            Limit::Moment => self.port_moment_nm,
            Limit::Pose => self.pose_half_widths,
            Limit::Tracking => self.tracking_error_m,
            Limit::Watchdog => f64::from(self.ticks_without_measurement),
            Limit::Frozen => f64::from(self.sensor_frozen_ticks),
            Limit::Energy => self.energy_gained.unwrap_or(f64::INFINITY),
            Limit::Rig | Limit::Saturated | Limit::Finite => YES_OR_NO,
        }
    }
}
