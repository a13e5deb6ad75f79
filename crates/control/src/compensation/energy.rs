//! The energy that the loop adds, watched and bounded: a contact gives to the bodies what the hardware did not give
//! where the plate is not where its sensor felt the force.
//!
//! ```text
//! E += felt·Δx(bodies) − measured·Δx(plate, τ_F ago)      share = E / largest kinetic energy of the relative motion so far
//! ```
//!
//! F4 as the bodies feel it (what a compensator adds included) and as it is measured, τ_F the lag of its sensor. In the first half
//! of a contact E is below zero where the plate is late. With a budget the loop damps from half
//! of it on, and is stopped beyond it. It is a watchman, never a compensator: what is damped leaves where the bodies turn,
//! and the contact lasts longer.

use docktwin_core::{Pose, Twist, Wrench};
use docktwin_physics::{body::MassProperties, mechanism::System, mounted::Ports};

use super::{LoopContext, Phase, history::History};
use crate::{excitation::apart, sensing::opposite};

/// Poses of the plate that are kept.
const KEPT: usize = 64;
/// Most damping, 1/s.
const MOST_BETA_HZ: f64 = 50.0;
/// Speed below which no motion counts as kinetic energy, m/s.
const LEAST_M_S: f64 = 5e-3;
/// Share of the budget at which damping begins, and at which it is said.
const DAMPED_FROM: f64 = 0.5;
const TOLD_FROM: f64 = 0.1;

/// What is known of the loop's energy in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gained {
    /// Energy that the loop has added, J.
    pub energy_j: f64,
    /// The same over the largest kinetic energy of the relative motion so far.
    pub share: f64,
    /// Above a tenth of the budget.
    pub told: bool,
    /// Above half of the budget: damped in this tick.
    pub damped: bool,
}

/// See the module's page.
#[derive(Clone, Debug)]
pub struct EnergyObserver {
    /// Reduced mass, kg, and reduced inertia, kg·m².
    reduced: [f64; 2],
    sensor_s: f64,
    past: History<Pose, KEPT>,
    /// Bodies and plate (as the sensor felt them) a tick ago.
    before: Option<[Pose; 2]>,
    energy_j: f64,
    kinetic_j: f64,
    begun: bool,
}

impl EnergyObserver {
    /// Of two spacecraft, with the lag of the sensor that F4 comes from, s.
    #[must_use]
    pub fn new(system: &System, sensor_s: f64) -> Self {
        let [chaser, _, target] = system.mass();
        let reduced = |a: f64, b: f64| a * b / (a + b);
        let mean = |m: &MassProperties| {
            let i = m.inertia();
            (i.x_axis.x + i.y_axis.y + i.z_axis.z) / 3.0
        };
        let mut out = Self {
            reduced: [reduced(chaser.mass(), target.mass()), reduced(mean(chaser), mean(target))],
            sensor_s,
            past: History::new(Pose::IDENTITY),
            before: None,
            energy_j: 0.0,
            kinetic_j: 0.0,
            begun: false,
        };
        out.reset();
        out
    }

    /// Forgets.
    pub fn reset(&mut self) {
        // Of a motion at rest any noise would be a large share.
        let least_j = 0.5 * self.reduced[0] * LEAST_M_S * LEAST_M_S;
        (self.before, self.energy_j, self.kinetic_j) = (None, 0.0, least_j);
        self.begun = false;
    }

    /// Energy that the loop has added, J.
    #[must_use]
    pub const fn energy_j(&self) -> f64 {
        self.energy_j
    }

    /// Takes a tick in, before the bodies are moved on; `added` is what a compensator adds to the measured wrenches.
    pub fn see(&mut self, seen: &LoopContext<'_>, added: &Ports) {
        let plate = seen.measured.x_34;
        if !core::mem::replace(&mut self.begun, true) {
            self.past.rest(plate);
        }
        self.past.push(plate);
        if seen.phase != Phase::Closed {
            self.before = None;
            return;
        }
        let (new, old, part) = self.past.ago(self.sensor_s / seen.period_s);
        let felt_at = Pose::new(new.p + (old.p - new.p) * part, new.q.slerp(old.q, part));
        let now = [seen.motion.x_34, felt_at];
        let before = self.before.replace(now).unwrap_or(now);
        let [of_bodies, of_plate] = [0, 1].map(|i| apart(&before[i], &now[i]));
        let measured = seen.ports.port4.rotated(seen.motion.x_34.q);
        let felt = measured + added.port4.rotated(seen.motion.x_34.q);
        self.energy_j += work(&felt, &of_bodies) - work(&measured, &of_plate);
        self.kinetic_j = self.kinetic_j.max(0.5 * self.twice_kinetic_j(&seen.motion.twist));
    }

    /// What a budget, a share of the kinetic energy, makes of it; with it what the bodies are to feel beside.
    pub fn within(&mut self, budget: f64, seen: &LoopContext<'_>) -> (Gained, Option<Ports>) {
        let share = if self.kinetic_j > 0.0 { self.energy_j / self.kinetic_j } else { 0.0 };
        let over_j = self.energy_j - DAMPED_FROM * budget * self.kinetic_j;
        let damped = seen.phase == Phase::Closed && over_j > 0.0;
        let gained =
            Gained { energy_j: self.energy_j, share, told: share > TOLD_FROM * budget, damped };
        (gained, damped.then(|| self.damping(over_j, seen)))
    }

    /// Damping of the relative motion that takes an energy within a tick, or as much as it may.
    pub(super) fn damping(&mut self, energy_j: f64, seen: &LoopContext<'_>) -> Ports {
        let twist = seen.motion.twist;
        let twice_kinetic_j = self.twice_kinetic_j(&twist);
        if energy_j <= 0.0 || twice_kinetic_j <= 0.0 {
            return Ports::default();
        }
        let beta = (energy_j / (twice_kinetic_j * seen.period_s)).min(MOST_BETA_HZ);
        self.energy_j -= beta * twice_kinetic_j * seen.period_s;
        let [mass, inertia] = self.reduced;
        let damping = Wrench { f: twist.v * (-beta * mass), m: twist.w * (-beta * inertia) };
        let x_34 = &seen.motion.x_34;
        let port4 = damping.rotated(x_34.q.conjugate());
        // And the same against it at the other port.
        Ports { port3: opposite(&port4, &x_34.inverse()), port4 }
    }

    fn twice_kinetic_j(&self, twist: &Twist) -> f64 {
        let [mass, inertia] = self.reduced;
        mass * twist.v.length_squared() + inertia * twist.w.length_squared()
    }
}

fn work(w: &Wrench, way: &Twist) -> f64 {
    w.f.dot(way.v) + w.m.dot(way.w)
}
