//! One hydraulic leg: servo valve, orifice, compressible oil, leakage and seal friction.
//!
//! In the linear range it is the paper's equation (10) with Table 1, with the valve in front:
//!
//! | part | law |
//! | --- | --- |
//! | valve | second order from command to spool, with spool and slew limits and a null bias |
//! | orifice | `Q = K_q x √(1 − sgn(x) p/p_s)` |
//! | oil | `V_t/(4 β_e) p' = Q − K_ce p − A v` |
//! | seal | bristle friction with break-away force (Stribeck) |
//! | rod | `F = A p − B_c v − F_friction` |
//!
//! `p` is the load pressure (difference of the two chambers), `v` the speed of extension, `F` the
//! force that the leg pushes with. The spool is a fraction of full stroke.
//!
//! The oil is a spring whose deflection is the oil let in minus the piston's way. A step therefore
//! calls [`LegState::compress`] with the piston's exact way wherever it drifts, and
//! [`LegState::flow`] for what passes the valve. With a leapfrog around it (drift, half flow, kick,
//! half flow, drift) the step is symplectic when nothing leaks, and of second order when it does.

use docktwin_core::StateHasher;
use rand_chacha::{
    ChaCha8Rng,
    rand_core::{RngCore, SeedableRng},
};

/// The servo valve from electrical command to spool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoValve {
    /// Natural frequency, Hz (80).
    pub frequency_hz: f64,
    /// Damping ratio (0.7).
    pub damping: f64,
    /// Largest speed of the spool, full strokes (centre to end) per second.
    pub slew_1_s: f64,
    /// The spool stands at this fraction of its stroke when the command is zero.
    pub null_bias: f64,
}

/// Friction of seals and guides: a bristle that slips (`LuGre`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SealFriction {
    /// Sliding friction, N.
    pub coulomb_n: f64,
    /// Break-away force, N, at least `coulomb_n`.
    pub static_n: f64,
    /// Speed over which break-away falls to sliding friction, m/s.
    pub stribeck_m_s: f64,
    /// Stiffness of the bristle, N/m: break-away happens after about `static_n` over this.
    pub bristle_n_m: f64,
    /// Damping of the bristle while it sticks, N·s/m.
    pub bristle_damping_n_s_m: f64,
}

/// All parameters of one leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegParameters {
    /// Effective area `A`, m².
    pub area_m2: f64,
    /// Compressed volume `V_t` of both chambers, m³.
    pub volume_m3: f64,
    /// Bulk modulus of the oil `β_e`, Pa.
    pub bulk_modulus_pa: f64,
    /// Viscous friction of the piston `B_c`, N·s/m.
    pub viscous_n_s_m: f64,
    /// Flow-pressure coefficient `K_ce` with the spool at its centre, m³/(s·Pa).
    pub flow_pressure_m3_s_pa: f64,
    /// Supply pressure `p_s`, Pa.
    pub supply_pa: f64,
    /// Flow through the fully open valve without load, `K_q` per full stroke, m³/s.
    pub no_load_flow_m3_s: f64,
    /// The valve.
    pub valve: ServoValve,
    /// The seals.
    pub friction: SealFriction,
}

/// The three rigs that are studied: Table 1 as printed, and two that differ in the oil volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Preset {
    /// `V_t` 0.36 m³, as printed.
    Printed,
    /// `V_t` 0.15 m³, which fits a stroke of 2.4 m.
    Consistent,
    /// `V_t` 0.036 m³ with a bypass leak of 1e-9 m³/(s·Pa).
    Stiff,
}

impl Preset {
    /// All, softest first.
    pub const ALL: [Self; 3] = [Self::Printed, Self::Consistent, Self::Stiff];

    /// Name as in rig files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Printed => "printed",
            Self::Consistent => "consistent",
            Self::Stiff => "stiff",
        }
    }
}

impl LegParameters {
    /// Table 1, with the valve, supply and seal friction chosen for it.
    #[must_use]
    pub const fn preset(preset: Preset) -> Self {
        let (volume_m3, flow_pressure_m3_s_pa) = match preset {
            Preset::Printed => (0.36, 9e-12),
            Preset::Consistent => (0.15, 9e-12),
            Preset::Stiff => (0.036, 1e-9),
        };
        Self {
            area_m2: 0.06,
            volume_m3,
            bulk_modulus_pa: 6.9e8,
            viscous_n_s_m: 20.0,
            flow_pressure_m3_s_pa,
            supply_pa: 10e6,
            no_load_flow_m3_s: 0.042,
            valve: ServoValve { frequency_hz: 80.0, damping: 0.7, slew_1_s: 50.0, null_bias: 0.0 },
            friction: SealFriction {
                coulomb_n: 500.0,
                static_n: 650.0,
                stribeck_m_s: 0.01,
                bristle_n_m: 1e7,
                bristle_damping_n_s_m: 2e4,
            },
        }
    }

    /// The same leg as equation (10) describes it: no seal friction, no null bias.
    #[must_use]
    pub const fn without_friction(mut self) -> Self {
        self.friction.coulomb_n = 0.0;
        self.friction.static_n = 0.0;
        self.valve.null_bias = 0.0;
        self
    }

    /// Pressure per volume of oil let in, `4 β_e / V_t`, Pa/m³.
    #[must_use]
    pub const fn pressure_per_volume(&self) -> f64 {
        4.0 * self.bulk_modulus_pa / self.volume_m3
    }

    /// Hydraulic stiffness `K_h = 4 β_e A² / V_t`, N/m.
    #[must_use]
    pub const fn stiffness_n_m(&self) -> f64 {
        self.pressure_per_volume() * self.area_m2 * self.area_m2
    }

    /// Undamped natural frequency with a mass (kg) on the leg, Hz.
    #[must_use]
    pub fn natural_frequency_hz(&self, mass_kg: f64) -> f64 {
        (self.stiffness_n_m() / mass_kg).sqrt() / core::f64::consts::TAU
    }

    /// Speed with the valve fully open and no load, m/s.
    #[must_use]
    pub const fn no_load_speed_m_s(&self) -> f64 {
        self.no_load_flow_m3_s / self.area_m2
    }

    /// Flow through the valve (m³/s) and how much a rise of pressure takes from it (m³/(s·Pa)).
    ///
    /// Above the supply pressure oil runs back through the orifice. Close to it, where the square
    /// root is steepest, it is rounded over 1e-4 of the supply pressure.
    #[must_use]
    pub fn orifice(&self, spool: f64, pressure_pa: f64) -> (f64, f64) {
        let s = spool.signum();
        let a = 1.0 - s * pressure_pa / self.supply_pa;
        // √a as a / (a² + ε²)^¼, odd and smooth; its derivative times −1/p_s.
        let e2 = a * a + 1e-8;
        let root4 = e2.sqrt().sqrt();
        let flow = self.no_load_flow_m3_s * spool;
        let slope = (1.0 - 0.5 * a * a / e2) / root4;
        (flow * a / root4, flow * s * slope / self.supply_pa)
    }
}

/// How far the parameters of a leg may lie from what a controller believes. All are half-widths of
/// uniform draws; relative ones are fractions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegSpread {
    /// Relative, effective bulk modulus (10 %: natural frequency ± 5 %).
    pub bulk_modulus: f64,
    /// Relative, damping of the leg: `K_ce` and `B_c` (10 %).
    pub damping: f64,
    /// Relative, seal friction, sliding and break-away together (50 %).
    pub friction: f64,
    /// Relative, flow gain (5 %).
    pub flow_gain: f64,
    /// Absolute, null bias, fraction of the spool's stroke (0.003).
    pub null_bias: f64,
    /// Relative, the valve's frequency (5 %).
    pub valve_frequency: f64,
    /// Relative, the valve's damping ratio (10 %).
    pub valve_damping: f64,
    /// Relative, supply pressure (3 %).
    pub supply: f64,
    /// Relative, effective area (0.2 %).
    pub area: f64,
}

impl Default for LegSpread {
    fn default() -> Self {
        Self {
            bulk_modulus: 0.10,
            damping: 0.10,
            friction: 0.50,
            flow_gain: 0.05,
            null_bias: 0.003,
            valve_frequency: 0.05,
            valve_damping: 0.10,
            supply: 0.03,
            area: 0.002,
        }
    }
}

/// Uniform draws from −1 to 1 that depend on a seed and a stream only.
#[derive(Clone, Debug)]
pub struct Draws(ChaCha8Rng);

impl Draws {
    /// `stream` keeps the draws of one part apart from those of another.
    #[must_use]
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Self(rng)
    }

    /// The next, in [−1, 1).
    pub fn uniform(&mut self) -> f64 {
        // 53 bits fill a double's mantissa.
        #[expect(clippy::cast_precision_loss, reason = "the shift leaves 53 bits")]
        let unit = (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
        2.0 * unit - 1.0
    }
}

impl LegParameters {
    /// Another leg of the same make: every parameter drawn within `spread`. The same seed and leg
    /// give the same draw; seeds and legs are independent of each other.
    #[must_use]
    pub fn perturbed(&self, spread: &LegSpread, seed: u64, leg: u64) -> Self {
        let mut draws = Draws::new(seed, leg);
        let mut factor = |half_width: f64| 1.0 + half_width * draws.uniform();
        let mut p = *self;
        p.bulk_modulus_pa *= factor(spread.bulk_modulus);
        p.flow_pressure_m3_s_pa *= factor(spread.damping);
        p.viscous_n_s_m *= factor(spread.damping);
        let friction = factor(spread.friction);
        p.friction.coulomb_n *= friction;
        p.friction.static_n *= friction;
        p.friction.bristle_n_m *= factor(spread.friction);
        p.no_load_flow_m3_s *= factor(spread.flow_gain);
        p.valve.null_bias += factor(spread.null_bias) - 1.0;
        p.valve.frequency_hz *= factor(spread.valve_frequency);
        p.valve.damping *= factor(spread.valve_damping);
        p.supply_pa *= factor(spread.supply);
        p.area_m2 *= factor(spread.area);
        p
    }
}

/// The valve over one fixed step, exactly, as long as no limit is met.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ValveStep {
    // (spool − command, rate) after a step: the homogeneous solution of the second-order valve.
    xx: f64,
    xv: f64,
    vx: f64,
    vv: f64,
}

impl ValveStep {
    fn new(valve: &ServoValve, h: f64) -> Self {
        let w = core::f64::consts::TAU * valve.frequency_hz;
        let z = valve.damping;
        let decay = (-z * w * h).exp();
        // c = cos(ω_d h), s = sin(ω_d h)/ω_d, or their hyperbolic and limiting forms.
        let d2 = w * w * (1.0 - z * z);
        let (c, s) = if d2 > 1e-9 * w * w {
            let d = d2.sqrt();
            ((d * h).cos(), (d * h).sin() / d)
        } else if d2 < -1e-9 * w * w {
            let d = (-d2).sqrt();
            ((d * h).cosh(), (d * h).sinh() / d)
        } else {
            (1.0, h)
        };
        Self {
            xx: decay * (c + z * w * s),
            xv: decay * s,
            vx: -decay * w * w * s,
            vv: decay * (c - z * w * s),
        }
    }
}

/// One leg's parameters with everything that depends on the step worked out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    parameters: LegParameters,
    valve: ValveStep,
    step_s: f64,
}

/// What a leg remembers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LegState {
    /// Spool before its bias, fraction of stroke.
    pub spool: f64,
    /// Its rate, 1/s.
    pub spool_rate_1_s: f64,
    /// Load pressure `p`, Pa.
    pub pressure_pa: f64,
    /// Deflection of the friction's bristle, m.
    pub bristle_m: f64,
}

impl LegState {
    /// Adds all bits to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        for x in [self.spool, self.spool_rate_1_s, self.pressure_pa, self.bristle_m] {
            h.f64(x);
        }
    }
}

impl Leg {
    /// A leg stepped by `step_s` seconds (0.1–0.25 ms; 50 Hz oil columns and an 80 Hz valve are
    /// then far below the step).
    #[must_use]
    pub fn new(parameters: LegParameters, step_s: f64) -> Self {
        Self { parameters, valve: ValveStep::new(&parameters.valve, step_s), step_s }
    }

    /// The parameters.
    #[must_use]
    pub const fn parameters(&self) -> &LegParameters {
        &self.parameters
    }

    /// Moves the spool over one step towards `command` (fraction of stroke, limited to ±1), and
    /// gives the mean opening of the orifice over the step.
    pub fn valve(&self, s: &mut LegState, command: f64) -> f64 {
        let p = &self.parameters.valve;
        let u = command.clamp(-1.0, 1.0);
        let (x0, v0) = (s.spool, s.spool_rate_1_s);
        let e = x0 - u;
        let m = &self.valve;
        let mut x = u + m.xx * e + m.xv * v0;
        let mut v = m.vx * e + m.vv * v0;
        let furthest = p.slew_1_s * self.step_s;
        if (x - x0).abs() > furthest || v.abs() > p.slew_1_s {
            x = x0 + (x - x0).clamp(-furthest, furthest);
            v = v.clamp(-p.slew_1_s, p.slew_1_s);
        }
        if x.abs() > 1.0 {
            x = x.clamp(-1.0, 1.0);
            v = 0.0;
        }
        s.spool = x;
        s.spool_rate_1_s = v;
        0.5 * (x0 + x) + p.null_bias
    }

    /// The piston has moved by `way_m` (extension positive).
    pub fn compress(&self, s: &mut LegState, way_m: f64) {
        s.pressure_pa -= self.parameters.pressure_per_volume() * self.parameters.area_m2 * way_m;
    }

    /// What passes orifice and leaks during `time_s`, implicit midpoint in the pressure.
    pub fn flow(&self, s: &mut LegState, opening: f64, time_s: f64) {
        let p = &self.parameters;
        let (q, kc) = p.orifice(opening, s.pressure_pa);
        let kce = p.flow_pressure_m3_s_pa;
        let c = p.pressure_per_volume() * time_s;
        s.pressure_pa += c * (q - kce * s.pressure_pa) / (1.0 + 0.5 * c * (kce + kc));
    }

    /// The bristle follows the rod at speed `v` (m/s) for `time_s`.
    pub fn slide(&self, s: &mut LegState, v: f64, time_s: f64) {
        let f = &self.parameters.friction;
        if f.static_n > 0.0 {
            // z' = v − σ|v|/g(v) z, implicit in z: bounded for any step.
            let rate = f.bristle_n_m * v.abs() / f.level(v);
            s.bristle_m = (s.bristle_m + time_s * v) / (1.0 + time_s * rate);
        }
    }

    /// Force of the rod on what it carries, N, at speed `v` (m/s).
    #[must_use]
    pub fn force(&self, s: &LegState, v: f64) -> f64 {
        let p = &self.parameters;
        p.area_m2 * s.pressure_pa - p.viscous_n_s_m * v - p.friction.force(s.bristle_m, v)
    }

    /// Energy stored in the oil and in the bristle, J.
    #[must_use]
    pub fn stored_j(&self, s: &LegState) -> f64 {
        let p = &self.parameters;
        0.5 * s.pressure_pa * s.pressure_pa / p.pressure_per_volume()
            + if p.friction.static_n > 0.0 {
                0.5 * p.friction.bristle_n_m * s.bristle_m * s.bristle_m
            } else {
                0.0
            }
    }
}

impl SealFriction {
    /// Sliding friction at speed `v` (m/s) with the Stribeck effect, N.
    #[must_use]
    pub fn level(&self, v: f64) -> f64 {
        let r = v / self.stribeck_m_s;
        self.coulomb_n + (self.static_n - self.coulomb_n) * (-r * r).exp()
    }

    /// Friction, N, against a motion at `v` (m/s) with the bristle at `bristle_m`.
    #[must_use]
    pub fn force(&self, bristle_m: f64, v: f64) -> f64 {
        if self.static_n <= 0.0 {
            return 0.0;
        }
        let rate = v - self.bristle_n_m * v.abs() / self.level(v) * bristle_m;
        self.bristle_n_m * bristle_m + self.bristle_damping_n_s_m * rate
    }
}

/// A leg that pushes one mass against a spring: the rig of the paper's single-DOF studies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SingleLeg {
    /// The leg.
    pub leg: Leg,
    /// Moved mass, kg.
    pub mass_kg: f64,
    /// Stiffness of the payload, N/m, at rest at `y_m` = 0.
    pub payload_n_m: f64,
}

/// State of [`SingleLeg`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SingleLegState {
    /// Extension, m.
    pub y_m: f64,
    /// Its speed, m/s.
    pub v_m_s: f64,
    /// Valve, oil and seal.
    pub leg: LegState,
}

impl SingleLeg {
    /// One step: half a drift, half the flow, one kick, half the flow, half a drift.
    ///
    /// `command` is the valve's, a fraction of stroke; `load_n` is the external force `F` of (10):
    /// positive against extension.
    pub fn step(&self, s: &mut SingleLegState, command: f64, load_n: f64) {
        let leg = &self.leg;
        let h = leg.step_s;
        let opening = leg.valve(&mut s.leg, command);
        let half = 0.5 * h;
        let drift = |s: &mut SingleLegState| {
            let way = half * s.v_m_s;
            s.y_m += way;
            leg.compress(&mut s.leg, way);
            leg.slide(&mut s.leg, s.v_m_s, half);
        };
        drift(s);
        leg.flow(&mut s.leg, opening, half);
        let push = leg.force(&s.leg, s.v_m_s) - self.payload_n_m * s.y_m - load_n;
        s.v_m_s += h * push / self.mass_kg;
        leg.flow(&mut s.leg, opening, half);
        drift(s);
    }

    /// Kinetic and stored energy, J.
    #[must_use]
    pub fn energy_j(&self, s: &SingleLegState) -> f64 {
        0.5 * self.mass_kg * s.v_m_s * s.v_m_s
            + 0.5 * self.payload_n_m * s.y_m * s.y_m
            + self.leg.stored_j(&s.leg)
    }
}
