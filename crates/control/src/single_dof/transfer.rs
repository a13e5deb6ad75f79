//! (4)–(9) as transfer functions: what a single-DOF HIL simulation does to a sine, linear.

use core::f64::consts::TAU;

pub use nalgebra::Complex;
use nalgebra::{DMatrix, Matrix6};

use super::{Compensation, ForceSensor, SingleDofSetup};
use crate::linear::{LinearInputs, LinearRig};

type C = Complex<f64>;

/// `s` on the imaginary axis, rad/s.
#[must_use]
pub fn s_of(hz: f64) -> C {
    C::new(0.0, TAU * hz)
}

/// (4): relative displacement per force on the bodies, m/N.
#[must_use]
pub fn body_dynamics(reduced_mass_kg: f64, s: C) -> C {
    (s * s * reduced_mass_kg).inv()
}

/// (5): force of the mechanism per displacement, `C s + K`, N/m.
#[must_use]
pub fn mechanism(stiffness_n_m: f64, damping_n_s_m: f64, s: C) -> C {
    s * damping_n_s_m + stiffness_n_m
}

/// (6) and (7): force of the mechanism per outer force on the bodies, from the open loop
/// `G_DDyn G_DMech`, times `G_I` of (8) for a HIL simulation. (The print calls the output `X_mech`;
/// both are pure numbers.)
#[must_use]
pub fn closed(open_loop: C) -> C {
    open_loop / (open_loop + 1.0)
}

impl ForceSensor {
    /// `G_FSensor`.
    #[must_use]
    pub fn response(&self, s: C) -> C {
        let w = TAU * self.natural_frequency_hz;
        let r = s / w;
        (r * r + r * (2.0 * self.damping_ratio) + 1.0).inv()
    }
}

/// The motion simulator of [`SingleDofSetup`] against a spring, linear and sampled: one leg with its
/// controller, feed-forward and dead time. Friction, orifice and limits are left out.
#[derive(Clone, Debug)]
pub struct LinearSimulator {
    setup: SingleDofSetup,
    payload_n_m: f64,
    rig: LinearRig,
}

impl LinearSimulator {
    /// Linearises; `payload_n_m` is the mechanism's stiffness that the leg works against. `None` with a
    /// mass of zero.
    #[must_use]
    pub fn new(setup: &SingleDofSetup, payload_n_m: f64) -> Option<Self> {
        // Six legs that do not know of each other.
        let one = Matrix6::<f64>::identity();
        let rig = LinearRig::new(LinearInputs {
            jacobian: one,
            mass: one * setup.mass_kg,
            believed_mass: one * setup.mass_kg,
            payload: one * payload_n_m,
            leg: setup.leg,
            believed_leg: setup.believed_leg,
            tuning: setup.tuning,
            dead_time_s: setup.dead_time_s,
        })?;
        Some(Self { setup: setup.clone(), payload_n_m, rig })
    }

    /// The sampled closed loop.
    #[must_use]
    pub const fn rig(&self) -> &LinearRig {
        &self.rig
    }

    /// `G_MSim` of (9): from the commanded displacement to that of the leg. `None` on a pole.
    #[must_use]
    pub fn response(&self, hz: f64) -> Option<C> {
        let setup = &self.setup;
        let (s, leg) = (s_of(hz), &setup.believed_leg);
        let oil = &leg.oil;
        let (lead, valve) = (setup.lead_s(), setup.tuning.valve_delay_s(leg));
        let leak = oil.leakage_m3_s_pa / (oil.area_m2 * oil.area_m2);
        // Displacement, speed, acceleration carried `t` ahead with constant jerk, as the loop does.
        let carried = |t: f64| {
            let (x, a) = (s * t, s * s * (C::ONE + s * t));
            (
                C::ONE + x * (C::ONE + x / 2.0 * (C::ONE + x / 3.0)),
                s * (C::ONE + x * (C::ONE + x / 2.0)),
                a,
            )
        };
        let force = |(_, v, a): (C, C, C)| a * setup.mass_kg + v * oil.viscous_n_s_m;
        let (now, later) = (carried(lead), carried(lead + valve));
        let rate = s * s * s * setup.mass_kg + later.2 * oil.viscous_n_s_m;
        let flow = later.1 + rate / oil.oil_spring_n_m() + force(later) * leak;
        // Targets of a unit of displacement, and of a unit of contact force that is expected.
        let expected = s / oil.oil_spring_n_m() + (C::ONE + s * valve) * leak;
        let mut targets = DMatrix::<C>::zeros(18, 6);
        for (column, t) in
            [[now.0, flow, force(now)], [C::ZERO, expected, C::ONE]].iter().enumerate()
        {
            for (kind, t) in t.iter().enumerate() {
                targets[(6 * kind, column)] = *t;
            }
        }
        let y = self.rig.lengths(hz, targets)?;
        let late = (-s * setup.dead_time_s).exp();
        let moved = y[(0, 0)] * late;
        Some(match setup.compensation {
            Compensation::None => moved,
            // The measured force is extrapolated over the delay of the sensor and the lead.
            Compensation::Ahead => {
                let felt = setup.sensor.response(s) * self.payload_n_m;
                let known = felt * (C::ONE + s * (setup.sensor.delay_s() + lead)) * late;
                moved / (C::ONE - y[(0, 1)] * known)
            }
        })
    }

    /// `G_I` of (8): with the force sensor.
    #[must_use]
    pub fn interface(&self, hz: f64) -> Option<C> {
        Some(self.response(hz)? * self.setup.sensor.response(s_of(hz)))
    }
}
