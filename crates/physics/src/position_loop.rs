//! Legs with position loops of their own: every leg follows its commanded length as a first or second order, and
//! the plate goes where its legs go, whatever acts on it.
//!
//! | limit | law |
//! | --- | --- |
//! | acceleration, speed | of a leg: cut where the loop asks for more |
//! | force | of a leg: what it can bear of inertia, weight and load; beyond it the leg gives way with that force |
//!
//! A step is exact for an input that is constant over it: give the commanded length of its middle. Forces are
//! those of inverse dynamics in the middle of the step.

use docktwin_core::{Pose, StateHasher, Twist, Wrench};
use docktwin_model::{LegLimits, PositionLoop};
use nalgebra::{Matrix6, Vector6};

use crate::{
    hydraulics::{LegState, SecondOrder},
    platform::{Configuration, Platform},
    rig::{RigFault, RigState},
};

/// The loop of one leg over a fixed step.
#[derive(Clone, Copy, Debug)]
enum Lag {
    /// What is left of the way after a step, and the corner, rad/s.
    First {
        left: f64,
        rate_rad_s: f64,
    },
    Second(SecondOrder),
}

/// The loop of one leg with its limits.
#[derive(Clone, Copy, Debug)]
struct LegLoop {
    lag: Lag,
    /// m/s².
    most_acceleration: f64,
}

/// A rig on legs with position loops.
#[derive(Clone, Debug)]
pub struct LoopRig {
    platform: Platform,
    loops: [LegLoop; 6],
    /// m/s, N.
    most_speed: f64,
    most_force: f64,
    step_s: f64,
}

/// What the legs remember beside their lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoopState {
    /// Speeds, m/s.
    pub speed_m_s: [f64; 6],
    /// Force of each leg on the plate in the last step, N, pushing positive.
    pub force_n: [f64; 6],
}

impl LoopState {
    /// Adds all bits to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        self.speed_m_s.iter().chain(&self.force_n).for_each(|x| h.f64(*x));
    }
}

/// The middle of a step: where the plate is, how it moves, and what acts on it.
struct Middle {
    c: Configuration,
    twist: Twist,
    push: Wrench,
}

impl LoopRig {
    /// A rig of a platform and six loops, within the limits of a leg, stepped by `step_s` seconds.
    #[must_use]
    pub fn new(
        platform: Platform,
        loops: &[PositionLoop; 6],
        limits: &LegLimits,
        step_s: f64,
    ) -> Self {
        let leg = |l: &PositionLoop| {
            let rate_rad_s = core::f64::consts::TAU * l.natural_frequency_hz;
            LegLoop {
                lag: match l.damping_ratio {
                    Some(z) => Lag::Second(SecondOrder::new(l.natural_frequency_hz, z, step_s)),
                    None => Lag::First { left: (-rate_rad_s * step_s).exp(), rate_rad_s },
                },
                most_acceleration: l.acceleration_m_s2.unwrap_or(f64::INFINITY),
            }
        };
        Self {
            platform,
            loops: loops.each_ref().map(leg),
            most_speed: limits.speed_m_s,
            most_force: limits.force_n,
            step_s,
        }
    }

    /// Kinematics and rigid dynamics.
    #[must_use]
    pub const fn platform(&self) -> &Platform {
        &self.platform
    }

    /// The step, s.
    #[must_use]
    pub const fn step_s(&self) -> f64 {
        self.step_s
    }

    /// At rest at `x_bp` under `external` (N, N·m on the plate about the origin of `ep`, in `eb`).
    ///
    /// # Errors
    /// The pose is singular.
    pub fn at_rest(
        &self,
        x_bp: &Pose,
        external: &Wrench,
    ) -> Result<(RigState, LoopState), RigFault> {
        let (c, still) = (self.platform.at(x_bp), Twist::default());
        let force_n =
            self.platform.inverse_dynamics(&c, &still, &still, external).ok_or(RigFault)?;
        let state = RigState {
            x_bp: *x_bp,
            twist: still,
            acceleration: still,
            length_m: c.length_m,
            legs: [LegState::default(); 6],
        };
        Ok((state, LoopState { speed_m_s: [0.0; 6], force_n }))
    }

    /// One step towards the commanded lengths `targets_m` of its middle. `external` gives the wrench on the
    /// plate about the origin of `ep`, in `eb`, and is asked once, in the middle.
    ///
    /// # Errors
    /// No pose has these lengths, or a number is not finite; the state stays as it was.
    pub fn step(
        &self,
        s: &mut RigState,
        l: &mut LoopState,
        targets_m: &[f64; 6],
        mut external: impl FnMut(&Pose, &Twist) -> Wrench,
    ) -> Result<(), RigFault> {
        let h = self.step_s;
        let (mut length, mut speed) = ([0.0; 6], [0.0; 6]);
        for i in 0..6 {
            (length[i], speed[i]) =
                self.wanted(&self.loops[i], [s.length_m[i], l.speed_m_s[i]], targets_m[i]);
        }
        // Hermite: the cubic through both ends with their slopes.
        let half_way = core::array::from_fn(|i| {
            0.5 * (s.length_m[i] + length[i]) + 0.125 * h * (l.speed_m_s[i] - speed[i])
        });
        let near = Platform::moved(&s.x_bp, &s.twist, 0.5 * h);
        let middle = self.platform.forward(&half_way, &near).map_err(|_| RigFault)?.x_bp;
        let c = self.platform.at(&middle);
        let mean = core::array::from_fn(|i| 0.5 * (l.speed_m_s[i] + speed[i]));
        let twist = c.twist(&mean).ok_or(RigFault)?;
        let push = external(&middle, &twist);
        let m = Middle { c, twist, push };

        // What turning of the legs alone does to their lengths, and the rest.
        let bias = m.c.accelerations(&m.twist, &Twist::default());
        let mut asked = core::array::from_fn(|i| (speed[i] - l.speed_m_s[i]) / h - bias[i]);
        let force_n = self.forces(&m, &mut asked)?;
        for i in 0..6 {
            // To the bit where nothing gives way.
            if force_n[i].abs() >= self.most_force {
                speed[i] = l.speed_m_s[i] + h * (asked[i] + bias[i]);
                length[i] = s.length_m[i] + 0.5 * h * (l.speed_m_s[i] + speed[i]);
            }
        }
        let acceleration = m.c.twist(&asked).ok_or(RigFault)?;
        let near = Platform::moved(&middle, &m.twist, 0.5 * h);
        let x_bp = self.platform.forward(&length, &near).map_err(|_| RigFault)?.x_bp;
        let end = self.platform.at(&x_bp).twist(&speed).ok_or(RigFault)?;
        *l = LoopState { speed_m_s: speed, force_n };
        (s.x_bp, s.twist, s.acceleration, s.length_m) = (x_bp, end, acceleration, length);
        Ok(())
    }

    /// Length and speed of a leg after a step, whatever its force.
    fn wanted(&self, leg: &LegLoop, [x, v]: [f64; 2], target_m: f64) -> (f64, f64) {
        let h = self.step_s;
        let (x1, v1) = match leg.lag {
            Lag::Second(lag) => lag.step(x, v, target_m),
            Lag::First { left, rate_rad_s } => {
                let x1 = target_m + (x - target_m) * left;
                (x1, rate_rad_s * (target_m - x1))
            }
        };
        let most = leg.most_acceleration * h;
        let limited = (v + (v1 - v).clamp(-most, most)).clamp(-self.most_speed, self.most_speed);
        if (limited - v1).abs() > 1e-12 { (x + 0.5 * h * (v + limited), limited) } else { (x1, v1) }
    }

    /// Forces of the legs that move the plate as `asked` (accelerations of the legs, turning apart, m/s²). A leg
    /// that cannot bear its force gives way, and `asked` becomes what it then does.
    fn forces(&self, m: &Middle, asked: &mut [f64; 6]) -> Result<[f64; 6], RigFault> {
        let acceleration = m.c.twist(asked).ok_or(RigFault)?;
        let forces = self
            .platform
            .inverse_dynamics(&m.c, &m.twist, &acceleration, &m.push)
            .ok_or(RigFault)?;
        if forces.iter().any(|f| !f.is_finite()) {
            return Err(RigFault);
        }
        if forces.iter().all(|f| f.abs() < self.most_force) {
            return Ok(forces);
        }
        let mass = self.platform.leg_mass_matrix(&m.c).ok_or(RigFault)?;
        let (mut a, mut f) = (Vector6::from(*asked), Vector6::from(forces));
        let (wanted, rest) = (a, f - mass * a);
        let mut given: [Option<f64>; 6] = [None; 6];
        // Every round one leg more gives way at least.
        for _ in 0..6 {
            let mut more = false;
            for (g, f) in given.iter_mut().zip(&f) {
                if g.is_none() && f.abs() > self.most_force {
                    *g = Some(self.most_force.copysign(*f));
                    more = true;
                }
            }
            if !more {
                break;
            }
            let mut rows = Matrix6::identity();
            let mut right = wanted;
            for (i, g) in given.iter().enumerate() {
                if let Some(force) = g {
                    rows.set_row(i, &mass.row(i));
                    right[i] = force - rest[i];
                }
            }
            a = rows.lu().solve(&right).ok_or(RigFault)?;
            f = mass * a + rest;
        }
        *asked = a.into();
        let mut out: [f64; 6] = f.into();
        for (out, g) in out.iter_mut().zip(given) {
            *out = g.unwrap_or(*out);
        }
        Ok(out)
    }
}
