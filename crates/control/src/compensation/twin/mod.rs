//! Two twins on the path of the loop: what the rig adds is taken out, what the hardware does comes through.
//!
//! ```text
//! felt = measured + share · (orbit − ground)        at ports 3 and 4
//! ```
//!
//! *Orbit* ([`orbit`]) is the mechanism between chaser and target as the programme moves them, without weight,
//! its ring on a chaser that accelerates. *Ground* ([`ground`]) is the mechanism on the rig where the plate was
//! measured, with weight, balance, sensor and the loop's own conditioning. What both have in common, and with it
//! most of what the model has wrong, drops out of the difference. What the model does not know at all stays in
//! the residual, measured − ground, which is not touched.
//!
//! The *share* ([`trust`]) is near 1 as long as the residual is within what a model of this kind may be wrong by; of
//! the fast part of the difference a share of its own is left ([`bands`]). Beyond a bound the method falls back: the
//! correction and the contact expected end, and the command goes on as before.
//!
//! The twins are made of what is believed ([`Believed`]), never of the true parameters of a rig.

mod bands;
mod ground;
mod latches;
mod orbit;
mod plate;
mod trust;

use docktwin_core::{StateHasher, Twist};
use docktwin_physics::{mounted::Ports, platform::Platform, programme::RelativeMotion};

use self::{bands::Bands, ground::Ground, latches::Latches, trust::Trust};
pub(super) use self::{orbit::Orbit, plate::Plate};
use super::{
    Believed, Compensator, Demand, ExpectedContact, LATCHES, LoopContext, Phase, Report, Target,
    delays::Delays,
};

/// Steps of either twin in a tick.
const STEPS: u32 = 4;
/// Largest part of the weight that a balance may leave for the rings to join in orbit where they do on the rig: with
/// more they sag there.
const MOST_UNCARRIED: f64 = 0.1;

/// What becomes of the residual, measured − ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Residual {
    /// The bodies feel it.
    Felt,
    /// It is left out: the bodies feel the orbit twin alone and the hardware has no say. A control for
    /// validations: where the mechanism is not the twin's it must be clearly worse.
    LeftOut,
}

/// The twin compensator; see the module's page.
#[derive(Clone, Debug)]
pub struct Twin {
    delays: Delays,
    residual: Residual,
    platform: Platform,
    ground: Ground,
    orbit: Orbit,
    latches: Latches,
    /// Whether a balance carries the ring.
    carried: bool,
    trust: Trust,
    bands: Bands,
    tick: Option<u64>,
    report: Report,
    /// F4, M4 on the article at `t_k` as expected, and its rate.
    contact: ExpectedContact,
}

impl Twin {
    /// Twins of what is believed, settled under their weight, and a lead of `lead_s` seconds for the command.
    #[must_use]
    pub fn new(believed: &Believed<'_>, lead_s: f64, residual: Residual) -> Self {
        Self {
            delays: Delays::new(believed, lead_s),
            residual,
            platform: Platform::new(believed.rig),
            ground: Ground::new(believed),
            orbit: Orbit::new(believed),
            latches: Latches::default(),
            carried: believed.rig.uncarried().abs() <= MOST_UNCARRIED,
            trust: Trust::default(),
            bands: Bands::default(),
            tick: None,
            report: Report::default(),
            contact: ExpectedContact::default(),
        }
    }

    /// Both twins to `t_k`.
    fn advance(&mut self, seen: &LoopContext<'_>) {
        let ticks = self.tick.map_or(1, |before| seen.tick.saturating_sub(before).max(1));
        self.tick = Some(seen.tick);
        let bodies = Plate::of_bodies(&self.platform, seen.motion);
        let ground = self.ground.mounted();
        let reached = ground.state().reached_catch();
        let rules = self.latches.rules(&seen.measured.latches, ground.latch_gaps_m(), reached);
        self.ground.advance(seen, &bodies.twist, ticks, rules.ground);
        let closed = seen.phase == Phase::Closed;
        let chaser = if closed { seen.bodies.chaser_acceleration() } else { Twist::default() };
        let before = self.orbit.ports().port4;
        self.orbit.advance(&bodies, &chaser, rules.orbit);
        if self.carried {
            self.orbit.draw_joint_to(self.ground.mounted());
        }
        // What the article bears now, free of the sensor's lag; its rate by the orbit twin, which has no noise.
        let residual = seen.ports.port4 - self.ground.expected().port4;
        let rate = self.orbit.ports().port4 - before;
        self.contact = ExpectedContact {
            port4: self.ground.on_article() + residual,
            rate: rate * (1.0 / seen.period_s),
        };
    }
}

impl Compensator for Twin {
    fn name(&self) -> &'static str {
        match self.residual {
            Residual::Felt => "twin",
            Residual::LeftOut => "twin-model-only",
        }
    }

    fn reset(&mut self) {
        self.ground.reset();
        self.orbit.reset();
        self.latches = Latches::default();
        self.trust = Trust::default();
        self.bands = Bands::default();
        self.tick = None;
        self.report = Report::default();
        self.contact = ExpectedContact::default();
    }

    fn wrench(&mut self, seen: &LoopContext<'_>) -> Option<Ports> {
        // On the way to the run-up nothing is near, and the twins rest.
        if !matches!(seen.phase, Phase::RunUp | Phase::Closed) {
            return None;
        }
        self.advance(seen);
        let (orbit, ground) = (*self.orbit.ports(), *self.ground.expected());
        if !(orbit.is_finite() && ground.is_finite()) {
            self.trust.give_up_at_once();
            self.report =
                Report { trust: 0.0, trust_fast: 0.0, fallen_back: true, ..Report::default() };
            return None;
        }
        self.report.residual = *seen.ports - ground;
        match self.residual {
            Residual::LeftOut => Some(orbit - *seen.ports),
            Residual::Felt => {
                if seen.phase == Phase::Closed && seen.measured.fresh {
                    self.trust.see(&seen.ports.port4, &ground.port4, seen.period_s);
                    self.bands.see(&seen.ports.port4, &ground.port4, seen.period_s);
                }
                let weighed = self.bands.weigh(&(orbit - ground), seen.period_s);
                self.report.trust = self.trust.share();
                self.report.trust_fast = self.bands.fast_share();
                self.report.fallen_back = self.trust.gave_up();
                Some(weighed * self.trust.share())
            }
        }
    }

    fn command(&mut self, seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        // The contact is of t_k, and the pose arrives the lead after t_{k+1}.
        let ahead_s = seen.period_s + self.delays.lead_s();
        let ExpectedContact { port4, rate } = self.contact;
        let port4 = port4 + rate * ahead_s;
        let expected = seen.phase == Phase::Closed && !self.trust.gave_up();
        let contact = expected.then_some(ExpectedContact { port4, rate });
        let motion = self.delays.undo_to_jerk(next, self.delays.sensor_s);
        let pose = Target { motion, contact };
        Demand { pose, flow: None, force: None }
    }

    fn digest(&self) -> Option<u64> {
        let mut h = StateHasher::new();
        self.ground.hash_into(&mut h);
        self.orbit.hash_into(&mut h);
        self.latches.hash_into(&mut h);
        self.trust.hash_into(&mut h);
        self.bands.hash_into(&mut h);
        for w in [&self.contact.port4, &self.contact.rate] {
            h.vec3(w.f);
            h.vec3(w.m);
        }
        Some(h.finish().short())
    }

    fn report(&self) -> Option<Report> {
        Some(self.report)
    }
}
