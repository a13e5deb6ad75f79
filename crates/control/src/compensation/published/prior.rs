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

use super::{Believed, Delays, Demand, Does, LoopContext};
use crate::compensation::{
    Phase,
    twin::{Orbit, Plate},
};

/// Ticks of the sensor's lag that are kept.
const KEPT: usize = 64;

/// See the module's page.
#[derive(Clone, Debug)]
pub(super) struct Prior {
    delays: Delays,
    platform: Platform,
    /// At the bodies, and at the plate.
    models: [Orbit; 2],
    /// Wrenches of that at the plate, newest first.
    past: [Ports; KEPT],
    plate: Option<Pose>,
    correction: Ports,
}

impl Prior {
    pub(super) fn new(believed: &Believed<'_>, delays: Delays) -> Self {
        let model = Orbit::new(believed);
        Self {
            delays,
            platform: Platform::new(believed.rig),
            models: [model.clone(), model],
            past: [Ports::default(); KEPT],
            plate: None,
            correction: Ports::default(),
        }
    }

    fn ago(&self, ticks: f64) -> Ports {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 62")]
        let whole = (ticks.max(0.0) as usize).min(KEPT - 2);
        #[expect(clippy::cast_precision_loss, reason = "0 to 62")]
        let part = (ticks - whole as f64).clamp(0.0, 1.0);
        let (a, b) = (self.past[whole], self.past[whole + 1]);
        a + (b - a) * part
    }
}

impl Does for Prior {
    fn reset(&mut self) {
        self.models.iter_mut().for_each(Orbit::reset);
        (self.past, self.plate) = ([Ports::default(); KEPT], None);
        self.correction = Ports::default();
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
        self.past.rotate_right(1);
        self.past[0] = *at_plate.ports();
        let late = self.ago(self.delays.sensor_s / seen.period_s);
        let correction = *self.models[0].ports() - late;
        let finite = correction.port3.is_finite() && correction.port4.is_finite();
        self.correction = if finite { correction } else { Ports::default() };
        Some(self.correction)
    }

    fn command(&mut self, _seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        Demand::of(self.delays.undo(next, 0.0))
    }

    fn digest(&self) -> Option<u64> {
        let mut h = StateHasher::new();
        self.models.iter().for_each(|m| m.hash_into(&mut h));
        for p in &self.past {
            for w in [p.port3, p.port4] {
                h.vec3(w.f);
                h.vec3(w.m);
            }
        }
        Some(h.finish().short())
    }
}
