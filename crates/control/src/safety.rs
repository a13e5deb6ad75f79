//! The supervisor's limits: what ends a run before steel bends.
//!
//! Judged once a tick, before anything is sent, on what was measured and on what is about to be
//! commanded. The first limit passed is kept; what follows from it is not told apart.

use docktwin_core::{DVec3, Euler, Pose};
use docktwin_model::Rig;

/// Everything that is limited, in this order in every array here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum Limit {
    /// Room of a leg to either end of its stroke, m; this one must stay above.
    Stroke,
    /// Speed of a leg, m/s.
    LegSpeed,
    /// Force of a leg's oil, N.
    LegForce,
    /// Force at a port, N.
    Force,
    /// Moment at a port, N·m.
    Moment,
    /// Distance of `X_34` from the middle of the docking workspace, in half-widths of its box.
    Pose,
    /// Deviation of the measured from the commanded pose, m; turns at the radius of the plate joints.
    Tracking,
    /// Ticks in a row without a good measurement.
    Watchdog,
    /// The rig left the commands of its own: safe state, emergency stop, limit switch, switched off.
    Rig,
    /// A sensor at the end of its range, or gone: what it says then is not what is.
    Saturated,
    /// Measurements in a row in which a sensor says the same to the last bit.
    Frozen,
    /// A number that is not finite.
    Finite,
}

impl Limit {
    /// How many there are.
    pub const COUNT: usize = 12;

    /// All of them.
    pub const ALL: [Self; Self::COUNT] = [
        Self::Stroke,
        Self::LegSpeed,
        Self::LegForce,
        Self::Force,
        Self::Moment,
        Self::Pose,
        Self::Tracking,
        Self::Watchdog,
        Self::Rig,
        Self::Saturated,
        Self::Frozen,
        Self::Finite,
    ];

    /// Name with unit, as in the summary.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Stroke => "stroke_margin_m",
            Self::LegSpeed => "leg_speed_m_s",
            Self::LegForce => "leg_force_n",
            Self::Force => "port_force_n",
            Self::Moment => "port_moment_nm",
            Self::Pose => "pose_half_widths",
            Self::Tracking => "tracking_error_m",
            Self::Watchdog => "ticks_without_measurement",
            Self::Rig => "rig_status",
            Self::Saturated => "sensor_saturated",
            Self::Frozen => "sensor_frozen_ticks",
            Self::Finite => "not_finite",
        }
    }
}

/// Limits of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyLimits {
    /// By [`Limit`].
    pub values: [f64; Limit::COUNT],
}

/// A sensor alive shows its noise within so many ticks; arming asks for the same.
const FROZEN_TICKS: f64 = 20.0;

impl SafetyLimits {
    /// What the rig's file allows, and loads at the ports (N, N·m).
    #[must_use]
    pub fn of_rig(rig: &Rig, force_n: f64, moment_nm: f64) -> Self {
        Self {
            values: [
                0.02,
                0.95 * rig.limits.speed_m_s,
                rig.limits.force_n,
                force_n,
                moment_nm,
                1.7,
                0.02,
                10.0,
                0.5,
                0.5,
                FROZEN_TICKS,
                0.5,
            ],
        }
    }

    /// The limit of one quantity.
    #[must_use]
    pub const fn of(&self, l: Limit) -> f64 {
        self.values[l as usize]
    }
}

/// A limit that was passed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trip {
    /// Which.
    pub limit: Limit,
    /// Reached.
    pub value: f64,
    /// Allowed.
    pub allowed: f64,
    /// Tick of the loop.
    pub tick: u64,
}

/// What is judged in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Watched {
    /// Least room of a leg, measured or commanded, m.
    pub stroke_margin_m: f64,
    /// Fastest leg, measured or commanded, m/s.
    pub leg_speed_m_s: f64,
    /// Strongest leg, N.
    pub leg_force_n: f64,
    /// Force at a port, N.
    pub force_n: f64,
    /// Moment at a port, N·m.
    pub moment_nm: f64,
    /// See [`Limit::Pose`]; of the measured or the commanded pose.
    pub pose_half_widths: f64,
    /// See [`Limit::Tracking`].
    pub tracking_m: f64,
    /// Ticks without a measurement.
    pub ticks_without: u32,
    /// The rig is not following.
    pub rig_left: bool,
    /// A sensor is at the end of its range, or gone.
    pub saturated: bool,
    /// See [`Limit::Frozen`].
    pub ticks_frozen: u32,
}

/// Distance of a relative pose from the middle of the docking workspace in half-widths of its box.
#[must_use]
pub fn half_widths(rig: &Rig, x_34: &Pose) -> f64 {
    let d = &rig.docking;
    let p = (x_34.p - d.middle_m) / DVec3::new(d.axial_m, d.lateral_m, d.lateral_m);
    let e = Euler::from_quat(x_34.q);
    let turn = (e.roll / d.roll_rad)
        .abs()
        .max((e.pitch / d.pitch_yaw_rad).abs())
        .max((e.yaw / d.pitch_yaw_rad).abs());
    p.abs().max_element().max(turn)
}

/// The supervisor.
#[derive(Clone, Copy, Debug)]
pub struct Supervisor {
    limits: SafetyLimits,
    trip: Option<Trip>,
    /// By [`Limit`]: 1 with nothing used up, 0 at the limit.
    least_margin: [f64; Limit::COUNT],
}

impl Supervisor {
    /// Nothing passed yet.
    #[must_use]
    pub const fn new(limits: SafetyLimits) -> Self {
        Self { limits, trip: None, least_margin: [1.0; Limit::COUNT] }
    }

    /// Judges a tick; the first limit passed stays.
    pub fn judge(&mut self, w: &Watched, tick: u64) -> Option<Trip> {
        let said = |b: bool| f64::from(u8::from(b));
        let values = [
            w.stroke_margin_m,
            w.leg_speed_m_s,
            w.leg_force_n,
            w.force_n,
            w.moment_nm,
            w.pose_half_widths,
            w.tracking_m,
            f64::from(w.ticks_without),
            said(w.rig_left),
            said(w.saturated),
            f64::from(w.ticks_frozen),
        ];
        let finite = values.iter().all(|x| x.is_finite());
        for (limit, value) in Limit::ALL.into_iter().zip(values.into_iter().chain([said(!finite)]))
        {
            let allowed = self.limits.of(limit);
            let (passed, margin) = if limit == Limit::Stroke {
                (value < allowed, ((value - allowed) / STROKE_SCALE_M).min(1.0))
            } else {
                (value > allowed, 1.0 - value / allowed)
            };
            let least = &mut self.least_margin[limit as usize];
            *least = least.min(margin);
            if (passed || value.is_nan()) && self.trip.is_none() {
                let limit = if value.is_nan() { Limit::Finite } else { limit };
                self.trip = Some(Trip { limit, value, allowed, tick });
            }
        }
        self.trip
    }

    /// The limit that was passed.
    #[must_use]
    pub const fn trip(&self) -> Option<Trip> {
        self.trip
    }

    /// Least margins so far, by [`Limit`]: 1 untouched, 0 at the limit.
    #[must_use]
    pub const fn least_margins(&self) -> &[f64; Limit::COUNT] {
        &self.least_margin
    }
}

/// Room of a leg that counts as untouched, m.
const STROKE_SCALE_M: f64 = 0.3;

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: SafetyLimits = SafetyLimits {
        values: [0.02, 0.6, 6e4, 5e3, 3e3, 1.3, 0.02, 10.0, 0.5, 0.5, FROZEN_TICKS, 0.5],
    };

    #[test]
    fn invariant_every_limit_trips_alone_and_the_first_stays() {
        let good = Watched { stroke_margin_m: 0.3, ..Watched::default() };
        type Case = (Limit, fn(&mut Watched));
        let cases: [Case; Limit::COUNT] = [
            (Limit::Stroke, |w| w.stroke_margin_m = 0.01),
            (Limit::LegSpeed, |w| w.leg_speed_m_s = 0.61),
            (Limit::LegForce, |w| w.leg_force_n = 7e4),
            (Limit::Force, |w| w.force_n = 5.1e3),
            (Limit::Moment, |w| w.moment_nm = 3.1e3),
            (Limit::Pose, |w| w.pose_half_widths = 1.31),
            (Limit::Tracking, |w| w.tracking_m = 0.021),
            (Limit::Watchdog, |w| w.ticks_without = 11),
            (Limit::Rig, |w| w.rig_left = true),
            (Limit::Saturated, |w| w.saturated = true),
            (Limit::Frozen, |w| w.ticks_frozen = 21),
            (Limit::Finite, |w| w.force_n = f64::NAN),
        ];
        for (limit, spoil) in cases {
            let mut s = Supervisor::new(LIMITS);
            assert_eq!(s.judge(&good, 1), None);
            let mut bad = good;
            spoil(&mut bad);
            assert_eq!(s.judge(&bad, 2).map(|t| (t.limit, t.tick)), Some((limit, 2)));
            let later = s.judge(&Watched { leg_speed_m_s: 9.0, ..good }, 3);
            assert_eq!(later.map(|t| t.tick), Some(2));
        }
    }
}
