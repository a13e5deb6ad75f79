//! The supervisor: stops a run before the rig is damaged.
//!
//! Once a tick, before anything is sent, it checks the measurement and the command to be sent. The
//! first limit exceeded is kept; later ones are not reported.
//!
//! | file | what |
//! | --- | --- |
//! | here | which limits there are, and the supervisor that applies the rules |
//! | `limits` | their values, by name, with unit and source |
//! | `rules` | one function for each rule: which quantity is compared with which limit |
//!
//! A new limit is a variant of [`Limit`] with its name, a field of [`SafetyLimits`], a rule, its
//! quantity in [`Watched`], and a row in `docs/bring-up-a-rig.md`.

use docktwin_core::{DVec3, Euler, Pose};
use docktwin_model::Rig;

mod limits;
mod rules;

pub use limits::SafetyLimits;
use rules::RULES;

/// Everything that is limited.
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
    /// The rig stopped following by itself: safe state, emergency stop, limit switch, switched off.
    Rig,
    /// A sensor is saturated or missing: its reading is not valid.
    Saturated,
    /// Consecutive measurements in which the reading of a sensor is bit-identical.
    Frozen,
    /// Energy that the loop adds, over the kinetic energy of the relative motion; judged where a budget is given.
    Energy,
    /// A number that is not finite.
    Finite,
}

impl Limit {
    /// How many there are.
    pub const COUNT: usize = 13;

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
        Self::Energy,
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
            Self::Energy => "energy_gained",
            Self::Finite => "not_finite",
        }
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
    /// Strongest leg, N; `None` where the rig does not measure leg forces.
    pub leg_force_n: Option<f64>,
    /// Force at a port, N.
    pub port_force_n: f64,
    /// Moment at a port, N·m.
    pub port_moment_nm: f64,
    /// See [`Limit::Pose`]; of the measured or the commanded pose.
    pub pose_half_widths: f64,
    /// See [`Limit::Tracking`].
    pub tracking_error_m: f64,
    /// Ticks without a measurement.
    pub ticks_without: u32,
    /// The rig is not following.
    pub rig_left: bool,
    /// A sensor is at the end of its range, or gone.
    pub saturated: bool,
    /// See [`Limit::Frozen`].
    pub ticks_frozen: u32,
    /// See [`Limit::Energy`]; `None` without a budget.
    pub energy_gained: Option<f64>,
}

impl Watched {
    /// True when every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let numbers = [
            self.stroke_margin_m,
            self.leg_speed_m_s,
            self.leg_force_n.unwrap_or_default(),
            self.port_force_n,
            self.port_moment_nm,
            self.pose_half_widths,
            self.tracking_error_m,
            self.energy_gained.unwrap_or_default(),
        ];
        numbers.iter().all(|x| x.is_finite())
    }
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

/// Least margins of a run, by limit: 1 with nothing used up, 0 at the limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins([Option<f64>; Limit::COUNT]);

impl Margins {
    /// The margin of one limit; `None` as long as its quantity was never judged.
    #[must_use]
    pub const fn of(&self, limit: Limit) -> Option<f64> {
        self.0[limit as usize]
    }

    /// Limits that were judged, and their margins.
    pub fn iter(&self) -> impl Iterator<Item = (Limit, f64)> {
        Limit::ALL.into_iter().filter_map(|limit| Some((limit, self.of(limit)?)))
    }

    fn note(&mut self, limit: Limit, margin: f64) {
        let least = &mut self.0[limit as usize];
        *least = Some(least.unwrap_or(1.0).min(margin));
    }
}

/// The supervisor.
#[derive(Clone, Copy, Debug)]
pub struct Supervisor {
    limits: SafetyLimits,
    trip: Option<Trip>,
    margins: Margins,
}

impl Supervisor {
    /// Nothing passed yet.
    #[must_use]
    pub const fn new(limits: SafetyLimits) -> Self {
        Self { limits, trip: None, margins: Margins([None; Limit::COUNT]) }
    }

    /// Judges a tick; the first limit passed stays.
    pub fn judge(&mut self, watched: &Watched, tick: u64) -> Option<Trip> {
        for (limit, rule) in RULES {
            let Some(r) = rule(watched, &self.limits) else { continue };
            self.margins.note(limit, r.margin);
            if (r.passed || r.value.is_nan()) && self.trip.is_none() {
                let limit = if r.value.is_nan() { Limit::Finite } else { limit };
                self.trip = Some(Trip { limit, value: r.value, allowed: r.allowed, tick });
            }
        }
        self.trip
    }

    /// The limit that was passed.
    #[must_use]
    pub const fn trip(&self) -> Option<Trip> {
        self.trip
    }

    /// Least margins so far.
    #[must_use]
    pub const fn margins(&self) -> &Margins {
        &self.margins
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: SafetyLimits = SafetyLimits {
        stroke_margin_m: 0.02,
        leg_speed_m_s: 0.6,
        leg_force_n: 6e4,
        port_force_n: 5e3,
        port_moment_nm: 3e3,
        pose_half_widths: 1.3,
        tracking_error_m: 0.02,
        ticks_without_measurement: 10,
        sensor_frozen_ticks: 20,
        energy_gained: Some(0.1),
    };

    #[test]
    fn invariant_every_limit_trips_alone_and_the_first_stays() {
        let good = Watched { stroke_margin_m: 0.3, ..Watched::default() };
        type Case = (Limit, fn(&mut Watched));
        let cases: [Case; Limit::COUNT] = [
            (Limit::Stroke, |w| w.stroke_margin_m = 0.01),
            (Limit::LegSpeed, |w| w.leg_speed_m_s = 0.61),
            (Limit::LegForce, |w| w.leg_force_n = Some(7e4)),
            (Limit::Force, |w| w.port_force_n = 5.1e3),
            (Limit::Moment, |w| w.port_moment_nm = 3.1e3),
            (Limit::Pose, |w| w.pose_half_widths = 1.31),
            (Limit::Tracking, |w| w.tracking_error_m = 0.021),
            (Limit::Watchdog, |w| w.ticks_without = 11),
            (Limit::Rig, |w| w.rig_left = true),
            (Limit::Saturated, |w| w.saturated = true),
            (Limit::Frozen, |w| w.ticks_frozen = 21),
            (Limit::Energy, |w| w.energy_gained = Some(0.11)),
            (Limit::Finite, |w| w.port_force_n = f64::NAN),
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

    /// Rules stand in the order of the limits, so that arrays and summaries agree.
    #[test]
    fn invariant_every_limit_has_its_rule() {
        assert_eq!(RULES.map(|(limit, _)| limit), Limit::ALL);
        for (i, limit) in Limit::ALL.into_iter().enumerate() {
            assert_eq!(limit as usize, i);
        }
    }

    #[test]
    fn oracle_margins_are_the_least_and_what_is_not_measured_has_none() {
        let mut s = Supervisor::new(LIMITS);
        let good = Watched { stroke_margin_m: 0.17, leg_speed_m_s: 0.3, ..Watched::default() };
        s.judge(&good, 1);
        s.judge(&Watched { leg_speed_m_s: 0.15, ..good }, 2);
        let m = *s.margins();
        let near = |limit, margin: f64| m.of(limit).is_some_and(|x| (x - margin).abs() < 1e-12);
        assert!(near(Limit::Stroke, 0.5) && near(Limit::LegSpeed, 0.5), "{m:?}");
        assert!(near(Limit::Force, 1.0) && near(Limit::Rig, 1.0), "{m:?}");
        assert_eq!(m.of(Limit::LegForce), None);
        // Leg forces and the loop's energy.
        assert_eq!(m.iter().count(), Limit::COUNT - 2);
        s.judge(&Watched { leg_force_n: Some(4.5e4), ..good }, 3);
        assert!(s.margins().of(Limit::LegForce).is_some_and(|x| (x - 0.25).abs() < 1e-12));
    }
}
