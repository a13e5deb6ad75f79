//! From a commanded motion of the plate to the commands of the legs: `G_prefilter` of (9).
//!
//! Inverse dynamics with the mass matrix of the current pose gives the force of every leg; its rate
//! of change over `K_h` is the speed of compression of the oil, the force times `K_ce/A²` the
//! leakage (both as speeds of the leg).
//!
//! Every path of a command has its own time. Length and force are compared with the measurement of
//! the same sample, so they belong to the moment of arrival; flow passes the valve late, so it is
//! commanded ahead by [`LegTuning::valve_delay_s`] ([`PathTimes`]).

use docktwin_core::{Pose, Twist, Wrench};
use docktwin_physics::{
    hydraulics::LegParameters,
    platform::{Configuration, Platform},
};

use crate::leg::LegTuning;

/// Half of the span over which the rate of leg forces is taken, s.
const FORCE_RATE_SPAN: f64 = 5e-4;

/// A motion of the plate at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlateMotion {
    /// Plate in the ground, `X_bp`.
    pub x_bp: Pose,
    /// Velocity of the origin of `ep`, and angular velocity, in `eb`.
    pub twist: Twist,
    /// Time derivative of the twist.
    pub acceleration: Twist,
    /// Time derivative of the acceleration. Zero costs phase near the oil's natural frequency.
    pub jerk: Twist,
    /// Wrench expected on the plate from outside, about the origin of `ep`, in `eb`: contact, as twin
    /// or sensor know it.
    pub external: Wrench,
    /// Its rate, N/s and N·m/s.
    pub external_rate: Wrench,
}

fn combine(terms: &[(Twist, f64)]) -> Twist {
    terms
        .iter()
        .fold(Twist::default(), |sum, (t, by)| Twist { v: sum.v + t.v * *by, w: sum.w + t.w * *by })
}

impl PlateMotion {
    /// At rest.
    #[must_use]
    pub fn rest(x_bp: Pose) -> Self {
        Self { x_bp, ..Self::default() }
    }

    /// The motion of the plate with which the mechanisms have a relative motion: pose `X_34`,
    /// twist, its rate and the rate of that, of `e4` against `e3` in axes of `e3`.
    ///
    /// Products of angular velocities in the jerk are left out: 0.1 rad/s and 1 rad/s² make 0.1 m/s³.
    #[must_use]
    pub fn of_docking(platform: &Platform, x_34: &Pose, rates_34: &[Twist; 3]) -> Self {
        let [twist, rate, jerk] = rates_34;
        Self {
            x_bp: platform.plate_from_docking(x_34),
            twist: platform.plate_twist(x_34, twist),
            acceleration: platform.plate_acceleration(x_34, twist, rate),
            jerk: platform.plate_twist(x_34, jerk),
            ..Self::default()
        }
    }

    /// The motion `time_s` later, with constant jerk; good for a few milliseconds.
    #[must_use]
    pub fn ahead(&self, time_s: f64) -> Self {
        let t = time_s;
        let way = combine(&[
            (self.twist, t),
            (self.acceleration, t * t / 2.0),
            (self.jerk, t * t * t / 6.0),
        ]);
        Self {
            x_bp: Platform::moved(&self.x_bp, &way, 1.0),
            twist: combine(&[(self.twist, 1.0), (self.acceleration, t), (self.jerk, t * t / 2.0)]),
            acceleration: combine(&[(self.acceleration, 1.0), (self.jerk, t)]),
            jerk: self.jerk,
            external: Wrench {
                f: self.external.f + self.external_rate.f * t,
                m: self.external.m + self.external_rate.m * t,
            },
            external_rate: self.external_rate,
        }
    }
}

/// What one leg is commanded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LegCommand {
    /// Length from joint to joint, m.
    pub length_m: f64,
    /// Its rate, m/s.
    pub speed_m_s: f64,
    /// Flow as speed, m/s, ahead by the valve's delay: rate of length, oil taken up, leakage.
    pub flow_speed_m_s: f64,
    /// Force between rod and plate, N, pushing positive.
    pub force_n: f64,
}

/// What the rig is commanded in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigCommand {
    /// The legs.
    pub legs: [LegCommand; 6],
    /// The pose they come from, `X_bp`.
    pub x_bp: Pose,
    /// Its twist.
    pub twist: Twist,
}

/// By how much later than the moment of arrival the instants of the other paths are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathTimes {
    /// Of the flow, s: the delay of the valves.
    pub flow_ahead_s: f64,
    /// Of the force, s.
    pub force_ahead_s: f64,
}

/// What was identified of the legs, to be undone by their commands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegCorrections {
    /// Speed at which each leg creeps with its valve at zero, m/s: null bias over flow gain.
    pub bias_m_s: [f64; 6],
    /// Flow gain of each valve over what its controller believes.
    pub flow_gain: [f64; 6],
}

impl LegCorrections {
    /// The flow to command leg `i`, m/s, so that it gets `flow_speed_m_s`.
    #[must_use]
    pub fn flow_speed_m_s(&self, i: usize, flow_speed_m_s: f64) -> f64 {
        (flow_speed_m_s - self.bias_m_s[i]) / self.flow_gain[i]
    }
}

impl Default for LegCorrections {
    fn default() -> Self {
        Self { bias_m_s: [0.0; 6], flow_gain: [1.0; 6] }
    }
}

/// Why a motion cannot be commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MotionError {
    /// Singular pose.
    #[error("the plate cannot be held in this pose: it is singular; keep to the workspace")]
    Singular,
    /// A number is not finite.
    #[error("the motion holds a number that is not finite: stop the trajectory at its source")]
    NotFinite,
}

/// The feed-forward of one rig, as the loop believes it to be.
#[derive(Clone, Debug)]
pub struct Feedforward {
    platform: Platform,
    oil: Option<Oil>,
}

/// Legs on oil, and the delays of their valves.
#[derive(Clone, Debug)]
struct Oil {
    legs: [LegParameters; 6],
    valve_delay_s: [f64; 6],
}

impl Feedforward {
    /// For a platform and legs as they are believed to be, and the tuning of the inner loops.
    #[must_use]
    pub fn new(platform: Platform, legs: [LegParameters; 6], tuning: &LegTuning) -> Self {
        let valve_delay_s = legs.map(|l| tuning.valve_delay_s(&l));
        Self { platform, oil: Some(Oil { legs, valve_delay_s }) }
    }

    /// For legs that follow their commanded lengths by themselves: lengths, speeds and the forces that the
    /// motion asks for, and no oil.
    #[must_use]
    pub const fn of_lengths(platform: Platform) -> Self {
        Self { platform, oil: None }
    }

    /// The platform that it assumes.
    #[must_use]
    pub const fn platform(&self) -> &Platform {
        &self.platform
    }

    /// By how much the flow is commanded ahead of length and force, s: mean of the legs; 0 without oil.
    #[must_use]
    pub fn valve_delay_s(&self) -> f64 {
        self.oil.as_ref().map_or(0.0, |oil| oil.valve_delay_s.iter().sum::<f64>() / 6.0)
    }

    /// Times of the paths: the flow is ahead by the valves' delay, the force is of the moment of arrival.
    #[must_use]
    pub fn path_times(&self) -> PathTimes {
        PathTimes { flow_ahead_s: self.valve_delay_s(), force_ahead_s: 0.0 }
    }

    /// Force that every leg must push with, N, friction apart.
    fn forces(&self, c: &Configuration, m: &PlateMotion) -> Result<[f64; 6], MotionError> {
        let mut f = self
            .platform
            .inverse_dynamics(c, &m.twist, &m.acceleration, &m.external)
            .ok_or(MotionError::Singular)?;
        let legs = self.oil.iter().flat_map(|oil| &oil.legs);
        for ((f, rate), leg) in f.iter_mut().zip(c.rates(&m.twist)).zip(legs) {
            *f += leg.oil.viscous_n_s_m * rate;
        }
        Ok(f)
    }

    /// Commands for a motion known at the moment of arrival; the valve's time is reached by
    /// [`PlateMotion::ahead`].
    ///
    /// # Errors
    /// See [`MotionError`].
    pub fn command(&self, motion: &PlateMotion) -> Result<RigCommand, MotionError> {
        self.command_paths(motion, None, None)
    }

    /// Commands for a motion known at the moment of arrival, and, where a predictor gives them, at the
    /// times of the flow and of the force ([`Feedforward::path_times`]). Without, the flow is carried on
    /// from the arrival with constant jerk, and the force is that of the arrival.
    ///
    /// # Errors
    /// See [`MotionError`].
    pub fn command_paths(
        &self,
        arrival: &PlateMotion,
        flow: Option<&PlateMotion>,
        force: Option<&PlateMotion>,
    ) -> Result<RigCommand, MotionError> {
        let carried_on;
        let valve = match flow {
            Some(flow) => flow,
            None => {
                carried_on = arrival.ahead(self.valve_delay_s());
                &carried_on
            }
        };
        let at = self.platform.at(&arrival.x_bp);
        let force = match force {
            Some(motion) => self.forces(&self.platform.at(&motion.x_bp), motion)?,
            None => self.forces(&at, arrival)?,
        };
        let rates = at.rates(&arrival.twist);
        let mut out =
            RigCommand { legs: Default::default(), x_bp: arrival.x_bp, twist: arrival.twist };
        for (i, leg) in out.legs.iter_mut().enumerate() {
            *leg = LegCommand {
                length_m: at.length_m[i],
                speed_m_s: rates[i],
                flow_speed_m_s: rates[i],
                force_n: force[i],
            };
        }
        if let Some(oil) = &self.oil {
            self.flows(oil, valve, &mut out)?;
        }
        let finite = out.legs.iter().all(|l| {
            l.length_m.is_finite() && l.flow_speed_m_s.is_finite() && l.force_n.is_finite()
        });
        if finite { Ok(out) } else { Err(MotionError::NotFinite) }
    }

    /// Flows for a motion at the time of the valves: rate of length, oil taken up, leakage.
    fn flows(
        &self,
        oil: &Oil,
        valve: &PlateMotion,
        out: &mut RigCommand,
    ) -> Result<(), MotionError> {
        let (before, after) = (valve.ahead(-FORCE_RATE_SPAN), valve.ahead(FORCE_RATE_SPAN));
        let f0 = self.forces(&self.platform.at(&before.x_bp), &before)?;
        let f1 = self.forces(&self.platform.at(&after.x_bp), &after)?;
        let flow = self.platform.at(&valve.x_bp).rates(&valve.twist);
        for (i, leg) in oil.legs.iter().enumerate() {
            let area2 = leg.oil.area_m2 * leg.oil.area_m2;
            let taken_up = (f1[i] - f0[i]) / (2.0 * FORCE_RATE_SPAN * leg.oil.oil_spring_n_m());
            let leaked = 0.5 * (f0[i] + f1[i]) * leg.oil.leakage_m3_s_pa / area2;
            out.legs[i].flow_speed_m_s = flow[i] + taken_up + leaked;
        }
        Ok(())
    }
}
