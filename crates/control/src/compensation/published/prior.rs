//! Force corrected by a simple model of the specimen that is known beforehand (JSCE 81(13) 24-13538, 2025, for tests of
//! structures: "a simplified nonlinear specimen model as prior"):
//!
//! ```text
//! felt = measured(t) + F_m(bodies at t) − F_m(plate at t − τ_F)
//! command = inverse of dead time and drives to the second order
//! ```
//!
//! F_m is the mechanism as its files say, without weight, without a chaser that accelerates, and without what sensor,
//! balance and (12) do: what the twins of `twin` have beyond it is what that is worth. Latches of both catch by
//! themselves. Nothing watches whether the model is right.

use docktwin_core::{Pose, StateHasher, Twist};
use docktwin_model::MOST_LATCHES;
use docktwin_physics::{
    mechanism::LatchRule, mounted::Ports, platform::Platform, programme::RelativeMotion,
};

use crate::compensation::{
    Believed, Compensator, Demand, LoopContext, Phase,
    delays::Delays,
    history::History,
    twin::{Orbit, Plate},
};

/// Name as on the command line.
pub(super) const NAME: &str = "prior-force";

/// Ticks of the sensor's lag that are kept.
const KEPT: usize = 64;

/// See the module's page.
#[derive(Clone, Debug)]
pub struct Prior {
    delays: Delays,
    platform: Platform,
    /// At the bodies, and at the plate.
    models: [Orbit; 2],
    /// Wrenches of that at the plate.
    past: History<Ports, KEPT>,
    plate: Option<Pose>,
}

impl Prior {
    pub(super) fn new(believed: &Believed<'_>, delays: Delays) -> Self {
        let model = Orbit::new(believed);
        Self {
            delays,
            platform: Platform::new(believed.rig),
            models: [model.clone(), model],
            past: History::new(Ports::default()),
            plate: None,
        }
    }
}

impl Compensator for Prior {
    fn name(&self) -> &'static str {
        NAME
    }

    fn reset(&mut self) {
        self.models.iter_mut().for_each(Orbit::reset);
        self.past.rest(Ports::default());
        self.plate = None;
    }

    fn wrench(&mut self, seen: &LoopContext<'_>) -> Option<Ports> {
        if !matches!(seen.phase, Phase::RunUp | Phase::Closed) {
            return None;
        }
        let bodies = Plate::of_bodies(&self.platform, seen.motion);
        let own = [LatchRule::Own; MOST_LATCHES];
        let [at_bodies, at_plate] = &mut self.models;
        at_bodies.advance(&bodies, &Twist::default(), own);
        // Without a measurement the plate goes on with the bodies.
        let x_bp = if seen.measured.fresh {
            seen.measured.x_bp
        } else {
            Platform::moved(&self.plate.unwrap_or(seen.measured.x_bp), &bodies.twist, seen.period_s)
        };
        self.plate = Some(x_bp);
        at_plate.advance(&Plate { x_bp, twist: bodies.twist }, &Twist::default(), own);
        self.past.push(*at_plate.ports());
        let (a, b, part) = self.past.ago(self.delays.sensor_s / seen.period_s);
        let late = *a + (*b - *a) * part;
        let correction = *self.models[0].ports() - late;
        Some(if correction.is_finite() { correction } else { Ports::default() })
    }

    fn command(&mut self, _seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        Demand::of(self.delays.undo(next, 0.0))
    }

    fn digest(&self) -> Option<u64> {
        let mut h = StateHasher::new();
        self.models.iter().for_each(|m| m.hash_into(&mut h));
        let oldest = self.past.oldest();
        for w in [oldest.port3, oldest.port4] {
            h.vec3(w.f);
            h.vec3(w.m);
        }
        Some(h.finish().short())
    }
}
