//! The inner loop around one leg, run at 2–4 kHz: `G_Controller` of (9).
//!
//! ```text
//! v = v_ff + F'_fr/K_h + k_p (l_ref − l) + γ HP(F_ref + F_fr − A p)
//! u = lead( v A / (K_q √(1 − sgn(v) p/p_s)) ) − null bias
//! ```
//!
//! Position feedback holds the leg. Pressure feedback γ damps the oil column; it acts on the
//! *difference* between expected and measured pressure force, so that commanded accelerations are
//! not damped. The high-pass HP removes steady loads, which would otherwise displace the leg.
//! Friction is a bristle model driven by the commanded speed.

use docktwin_core::StateHasher;
use docktwin_model::{HydraulicPreset, SealFriction};
use docktwin_physics::hydraulics::{LegParameters, bristle_after};

use crate::filter::Section;

/// Tuning of the inner loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegTuning {
    /// Rate of the loop, Hz (2000–4000). Lower leaves the fast modes less damped.
    pub rate_hz: f64,
    /// `k_p`, 1/s. Larger holds stiffer and brings the slow pole up; too large undamps the oil.
    pub position_gain_1_s: f64,
    /// γ, m/s per N. Larger damps more, until the lag of valve and sampling makes it unstable.
    pub pressure_gain_m_s_n: f64,
    /// Corner of the pressure feedback's high-pass, Hz. Lower lets a payload push the leg further
    /// away, higher takes damping from slow modes.
    pub high_pass_hz: f64,
    /// Frequency (Hz) and damping ratio to which the valve is brought by lead; `None` leaves it.
    pub valve_lead: Option<[f64; 2]>,
}

/// Mass to which damping ratios of γ refer, kg: the plate of Table 1.
pub const REFERRED_MASS_KG: f64 = 2500.0;

impl LegTuning {
    /// Time of one sample, s.
    #[must_use]
    pub const fn sample_s(&self) -> f64 {
        1.0 / self.rate_hz
    }

    /// From a flow demand to the flow, s: what is left of the valve's lag, one sample of computing
    /// and half a sample of holding.
    #[must_use]
    pub fn valve_delay_s(&self, model: &LegParameters) -> f64 {
        let [hz, damping] = self
            .valve_lead
            .unwrap_or([model.valve.natural_frequency_hz, model.valve.damping_ratio]);
        2.0 * damping / (core::f64::consts::TAU * hz) + 1.5 * self.sample_s()
    }

    /// γ that gives a leg with `mass_kg` the damping ratio `zeta`, valve and sampling apart.
    #[must_use]
    pub fn pressure_gain(model: &LegParameters, mass_kg: f64, zeta: f64) -> f64 {
        2.0 * zeta / (model.oil.oil_spring_n_m() * mass_kg).sqrt()
    }

    /// The tuning found for a preset on the large-dimension rig (`docs/rig-tuning.md`); `model` is
    /// the leg with this preset's oil.
    #[must_use]
    pub fn preset(preset: HydraulicPreset, model: &LegParameters) -> Self {
        let (kp, zeta, high_pass_hz) = match preset {
            HydraulicPreset::Printed => (30.0, 0.5, 4.0),
            HydraulicPreset::Consistent | HydraulicPreset::Stiff => (25.0, 0.6, 4.0),
        };
        Self {
            rate_hz: 4000.0,
            position_gain_1_s: kp,
            pressure_gain_m_s_n: Self::pressure_gain(model, REFERRED_MASS_KG, zeta),
            high_pass_hz,
            valve_lead: Some([400.0, 0.8]),
        }
    }
}

/// What a leg is to do now; every part already at its own time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LegTarget {
    /// Length from joint to joint, m.
    pub length_m: f64,
    /// Flow demand as speed, m/s: speed of the leg, what the oil takes up, and leakage, ahead by the
    /// valve's delay.
    pub flow_speed_m_s: f64,
    /// Force expected between rod and plate, N, without friction.
    pub force_n: f64,
    /// Speed of the leg, m/s, for the friction expected now.
    pub speed_m_s: f64,
    /// Speed of the leg, m/s, ahead by the valve's delay, for the friction expected then.
    pub speed_ahead_m_s: f64,
}

/// What is measured on a leg.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LegMeasurement {
    /// Length, m.
    pub length_m: f64,
    /// Load pressure, Pa.
    pub pressure_pa: f64,
}

/// Friction expected from a speed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct ExpectedFriction {
    bristle_m: f64,
}

impl ExpectedFriction {
    /// Force and its rate at speed `v`.
    fn step(&mut self, f: &SealFriction, v: f64, time_s: f64) -> (f64, f64) {
        let before = f.bristle_n_m * self.bristle_m;
        self.bristle_m = bristle_after(f, self.bristle_m, v, time_s);
        let after = f.bristle_n_m * self.bristle_m;
        (after, (after - before) / time_s)
    }
}

/// The inner loop of one leg.
#[derive(Clone, Copy, Debug)]
pub struct LegController {
    tuning: LegTuning,
    model: LegParameters,
    high_pass: Section,
    lead: Section,
    friction_now: ExpectedFriction,
    friction_ahead: ExpectedFriction,
    /// Command worked out one sample ago.
    waiting: f64,
}

impl LegController {
    /// A controller that assumes that the leg is `model`: its flow gain, oil, friction, valve and
    /// null bias. Set the seal friction to zero to do without friction feed-forward.
    #[must_use]
    pub fn new(tuning: LegTuning, model: LegParameters) -> Self {
        let t = tuning.sample_s();
        let lead = tuning.valve_lead.map_or_else(Section::identity, |to| {
            Section::lead([model.valve.natural_frequency_hz, model.valve.damping_ratio], to, t)
        });
        Self {
            tuning,
            model,
            high_pass: Section::high_pass(tuning.high_pass_hz, t),
            lead,
            friction_now: ExpectedFriction::default(),
            friction_ahead: ExpectedFriction::default(),
            waiting: 0.0,
        }
    }

    /// Its tuning.
    #[must_use]
    pub const fn tuning(&self) -> &LegTuning {
        &self.tuning
    }

    /// The model of the leg that it assumes.
    #[must_use]
    pub const fn model(&self) -> &LegParameters {
        &self.model
    }

    /// High-pass and lead, as they are.
    #[must_use]
    pub const fn sections(&self) -> (&Section, &Section) {
        (&self.high_pass, &self.lead)
    }

    /// One sample: the valve command (fraction of stroke, within ±1) to hold from now to the next
    /// sample. It is the one of the sample before: computing takes that long.
    pub fn step(&mut self, target: &LegTarget, measured: &LegMeasurement) -> f64 {
        let (m, t) = (&self.model, self.tuning.sample_s());
        let (friction, _) = self.friction_now.step(&m.friction, target.speed_m_s, t);
        let (_, friction_rate) = self.friction_ahead.step(&m.friction, target.speed_ahead_m_s, t);
        let excess = target.force_n + friction - m.oil.area_m2 * measured.pressure_pa;
        let speed = target.flow_speed_m_s
            + friction_rate / m.oil.oil_spring_n_m()
            + self.tuning.position_gain_1_s * (target.length_m - measured.length_m)
            + self.tuning.pressure_gain_m_s_n * self.high_pass.run(excess);
        // Opening for this flow at the present pressure; the pressure factor is at least a tenth,
        // so that a failed sensor does not open the valve without bound.
        let head = 1.0 - speed.signum() * measured.pressure_pa / m.valve.supply_pressure_pa;
        let opening = speed / (m.no_load_speed_m_s() * head.max(0.1).sqrt());
        let command = (self.lead.run(opening) - m.valve.null_bias).clamp(-1.0, 1.0);
        core::mem::replace(&mut self.waiting, command)
    }

    /// Adds all bits of its state to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        for x in self.high_pass.state().into_iter().chain(self.lead.state()) {
            h.f64(x);
        }
        h.f64(self.friction_now.bristle_m);
        h.f64(self.friction_ahead.bristle_m);
        h.f64(self.waiting);
    }
}
