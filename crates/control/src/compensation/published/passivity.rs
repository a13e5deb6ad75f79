//! Passivity controller (Hannaford and Ryu, IEEE Trans. Robot. Autom. 18, 2002; for spacecraft on robots De Stefano,
//! Balachandran and Secchi, IEEE Trans. Robot. 36, 2020): energy that the contact gives to the bodies and that the hardware
//! did not give is taken from them again by damping:
//!
//! ```text
//! E += F·Δx(bodies) − F·Δx(plate)      felt = measured − β (m_r v, I_r ω), β = E/(2 T Δt) from 0 to 50 1/s
//! ```
//!
//! T is the kinetic energy of the relative motion. It knows nothing of delays, and the command is the motion itself. What it
//! takes it takes where it is found, late in the contact and at its turning point: R_e comes near one, and the contact
//! lasts longer than it should.

use docktwin_core::{Pose, StateHasher, Twist, Wrench};
use docktwin_physics::{mounted::Ports, programme::RelativeMotion};

use crate::{
    compensation::{Believed, Compensator, Demand, LoopContext, Phase},
    excitation::apart,
    sensing::opposite,
};

/// Name as on the command line.
pub(super) const NAME: &str = "passivity";

/// Most damping, 1/s.
const MOST_BETA_HZ: f64 = 50.0;

/// See the module's page.
#[derive(Clone, Copy, Debug)]
pub struct Passivity {
    /// Reduced mass, kg, and reduced inertia, kg·m².
    reduced: [f64; 2],
    /// Energy that came from nowhere, J; below zero in the first half of a contact, in which late hardware takes less
    /// than the bodies give.
    energy_j: f64,
    /// Bodies and plate a tick ago.
    before: Option<[Pose; 2]>,
}

impl Passivity {
    pub(super) fn new(believed: &Believed<'_>) -> Self {
        let [chaser, _, target] = believed.system.mass();
        let reduced = |a: f64, b: f64| a * b / (a + b);
        let mean = |m: &docktwin_physics::body::MassProperties| {
            let i = m.inertia();
            (i.x_axis.x + i.y_axis.y + i.z_axis.z) / 3.0
        };
        Self {
            reduced: [reduced(chaser.mass(), target.mass()), reduced(mean(chaser), mean(target))],
            energy_j: 0.0,
            before: None,
        }
    }
}

fn work(w: &Wrench, way: &Twist) -> f64 {
    w.f.dot(way.v) + w.m.dot(way.w)
}

impl Compensator for Passivity {
    fn name(&self) -> &'static str {
        NAME
    }

    fn reset(&mut self) {
        (self.energy_j, self.before) = (0.0, None);
    }

    fn wrench(&mut self, seen: &LoopContext<'_>) -> Option<Ports> {
        if seen.phase != Phase::Closed {
            self.reset();
            return None;
        }
        let now = [seen.motion.x_34, seen.measured.x_34];
        let before = self.before.replace(now).unwrap_or(now);
        let [of_bodies, of_plate] = [0, 1].map(|i| apart(&before[i], &now[i]));
        let x_34 = &seen.motion.x_34;
        let contact = seen.ports.port4.rotated(x_34.q);
        self.energy_j += work(&contact, &of_bodies) - work(&contact, &of_plate);
        let [mass, inertia] = self.reduced;
        let Twist { v, w } = seen.motion.twist;
        let twice_kinetic_j = mass * v.length_squared() + inertia * w.length_squared();
        if self.energy_j <= 0.0 || twice_kinetic_j <= 0.0 {
            return Some(Ports::default());
        }
        let beta = (self.energy_j / (twice_kinetic_j * seen.period_s)).min(MOST_BETA_HZ);
        self.energy_j -= beta * twice_kinetic_j * seen.period_s;
        let damping = Wrench { f: v * (-beta * mass), m: w * (-beta * inertia) };
        let port4 = damping.rotated(x_34.q.conjugate());
        // And the same against it at the other port.
        let port3 = opposite(&port4, &x_34.inverse());
        Some(Ports { port3, port4 })
    }

    fn command(&mut self, _seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        Demand::of(*next)
    }

    fn digest(&self) -> Option<u64> {
        let mut h = StateHasher::new();
        h.f64(self.energy_j);
        Some(h.finish().short())
    }
}
