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
//! calls [`Leg::compress`] with the piston's exact way wherever it drifts, and
//! [`Leg::flow`] for what passes the valve. With a leapfrog around it (drift, half flow, kick,
//! half flow, drift) the step is symplectic when nothing leaks, and of second order when it does.

use docktwin_core::StateHasher;
use docktwin_model::{
    HydraulicDrive, HydraulicPreset, LegHydraulics, SealFriction, ServoValve, Spread,
};
use rand_chacha::{
    ChaCha8Rng,
    rand_core::{RngCore, SeedableRng},
};

/// All parameters of one leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegParameters {
    /// Cylinder and oil.
    pub oil: LegHydraulics,
    /// Servo valve and supply.
    pub valve: ServoValve,
    /// The seals; no friction at all with a static friction of zero.
    pub friction: SealFriction,
}

impl LegParameters {
    /// The leg of a rig file, with the oil of a preset.
    #[must_use]
    pub const fn of_drive(drive: &HydraulicDrive, preset: HydraulicPreset) -> Self {
        Self { oil: drive.leg(preset), valve: drive.valve, friction: drive.friction }
    }

    /// The same leg as equation (10) describes it: no seal friction, no null bias.
    #[must_use]
    pub const fn ideal(mut self) -> Self {
        self.friction.coulomb_n = 0.0;
        self.friction.static_n = 0.0;
        self.valve.null_bias = 0.0;
        self
    }

    /// Pressure per volume of oil let in, `4 β_e / V_t`, Pa/m³.
    #[must_use]
    pub const fn pressure_per_volume(&self) -> f64 {
        4.0 * self.oil.bulk_modulus_pa / self.oil.total_volume_m3
    }

    /// Speed with the valve fully open and no load, m/s.
    #[must_use]
    pub const fn no_load_speed_m_s(&self) -> f64 {
        self.valve.no_load_flow_m3_s / self.oil.area_m2
    }

    /// Flow through the valve (m³/s) and how much a rise of pressure takes from it (m³/(s·Pa)).
    ///
    /// Above the supply pressure oil runs back through the orifice. Close to it, where the square
    /// root is steepest, it is rounded over 1e-4 of the supply pressure.
    #[must_use]
    pub fn orifice(&self, spool: f64, pressure_pa: f64) -> (f64, f64) {
        let s = spool.signum();
        let a = 1.0 - s * pressure_pa / self.valve.supply_pressure_pa;
        // √a as a / (a² + ε²)^¼, odd and smooth; its derivative times −1/p_s.
        let e2 = a * a + 1e-8;
        let root4 = e2.sqrt().sqrt();
        let flow = self.valve.no_load_flow_m3_s * spool;
        let slope = (1.0 - 0.5 * a * a / e2) / root4;
        (flow * a / root4, flow * s * slope / self.valve.supply_pressure_pa)
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

impl LegSpread {
    /// What the rig file says, and for what it does not name: damping of leg and valve ± 10 %,
    /// supply ± 3 %, area ± 0.2 %.
    #[must_use]
    pub const fn of_rig(spread: &Spread) -> Self {
        Self {
            bulk_modulus: spread.bulk_modulus,
            damping: 0.10,
            friction: spread.friction,
            flow_gain: spread.flow_gain,
            null_bias: spread.null_bias,
            valve_frequency: spread.valve_frequency,
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
        p.oil.bulk_modulus_pa *= factor(spread.bulk_modulus);
        p.oil.leakage_m3_s_pa *= factor(spread.damping);
        p.oil.viscous_n_s_m *= factor(spread.damping);
        let friction = factor(spread.friction);
        p.friction.coulomb_n *= friction;
        p.friction.static_n *= friction;
        p.friction.bristle_n_m *= factor(spread.friction);
        p.valve.no_load_flow_m3_s *= factor(spread.flow_gain);
        p.valve.null_bias += factor(spread.null_bias) - 1.0;
        p.valve.natural_frequency_hz *= factor(spread.valve_frequency);
        p.valve.damping_ratio *= factor(spread.valve_damping);
        p.valve.supply_pressure_pa *= factor(spread.supply);
        p.oil.area_m2 *= factor(spread.area);
        p
    }
}

/// A second-order lag over one fixed step, exactly, its input held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SecondOrder {
    // (output − input, rate) after a step: the homogeneous solution.
    xx: f64,
    xv: f64,
    vx: f64,
    vv: f64,
}

impl SecondOrder {
    /// Natural frequency, damping ratio, step.
    #[must_use]
    pub fn new(natural_frequency_hz: f64, damping_ratio: f64, step_s: f64) -> Self {
        let (w, z, h) = (core::f64::consts::TAU * natural_frequency_hz, damping_ratio, step_s);
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

    /// Output and rate after a step under `input`.
    #[must_use]
    pub fn step<T>(&self, output: T, rate: T, input: T) -> (T, T)
    where
        T: Copy + core::ops::Add<Output = T> + core::ops::Sub<Output = T>,
        T: core::ops::Mul<f64, Output = T>,
    {
        let e = output - input;
        (input + e * self.xx + rate * self.xv, e * self.vx + rate * self.vv)
    }
}

/// One leg's parameters with everything that depends on the step worked out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    parameters: LegParameters,
    valve: SecondOrder,
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
        let v = &parameters.valve;
        Self {
            valve: SecondOrder::new(v.natural_frequency_hz, v.damping_ratio, step_s),
            parameters,
            step_s,
        }
    }

    /// The parameters.
    #[must_use]
    pub const fn parameters(&self) -> &LegParameters {
        &self.parameters
    }

    /// Mass that the step wants along the leg beside what moves there, kg. Leapfrog moves a mass on a
    /// spring faster by (ωh)²/24; k h²/12 more mass takes that back, so that motion on the oil is of
    /// fourth order.
    #[must_use]
    pub fn phase_mass_kg(&self) -> f64 {
        self.parameters.oil.oil_spring_n_m() * self.step_s * self.step_s / 12.0
    }

    /// Moves the spool over one step towards `command` (fraction of stroke, limited to ±1), and
    /// gives the mean opening of the orifice over the step.
    pub fn valve(&self, s: &mut LegState, command: f64) -> f64 {
        let p = &self.parameters.valve;
        let u = command.clamp(-1.0, 1.0);
        let (x0, v0) = (s.spool, s.spool_rate_1_s);
        let (mut x, mut v) = self.valve.step(x0, v0, u);
        let furthest = p.slew_per_s * self.step_s;
        if (x - x0).abs() > furthest || v.abs() > p.slew_per_s {
            x = x0 + (x - x0).clamp(-furthest, furthest);
            v = v.clamp(-p.slew_per_s, p.slew_per_s);
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
        s.pressure_pa -=
            self.parameters.pressure_per_volume() * self.parameters.oil.area_m2 * way_m;
    }

    /// What passes orifice and leaks during `time_s`, implicit midpoint in the pressure.
    pub fn flow(&self, s: &mut LegState, opening: f64, time_s: f64) {
        let p = &self.parameters;
        let (q, kc) = p.orifice(opening, s.pressure_pa);
        let kce = p.oil.leakage_m3_s_pa;
        let c = p.pressure_per_volume() * time_s;
        s.pressure_pa += c * (q - kce * s.pressure_pa) / (1.0 + 0.5 * c * (kce + kc));
    }

    /// The bristle follows the rod at speed `v` (m/s) for `time_s`.
    pub fn slide(&self, s: &mut LegState, v: f64, time_s: f64) {
        s.bristle_m = bristle_after(&self.parameters.friction, s.bristle_m, v, time_s);
    }

    /// Force of the rod on what it carries, N, at speed `v` (m/s).
    #[must_use]
    pub fn force(&self, s: &LegState, v: f64) -> f64 {
        let p = &self.parameters;
        p.oil.area_m2 * s.pressure_pa
            - p.oil.viscous_n_s_m * v
            - friction_n(&p.friction, s.bristle_m, v)
    }

    /// Energy stored in the oil and in the bristle, J.
    #[must_use]
    pub fn stored_j(&self, s: &LegState) -> f64 {
        let p = &self.parameters;
        0.5 * s.pressure_pa * s.pressure_pa / p.pressure_per_volume()
            + 0.5 * p.friction.bristle_n_m * s.bristle_m * s.bristle_m
    }
}

/// Sliding friction at speed `v` (m/s) with the Stribeck effect, N.
#[must_use]
pub fn friction_level_n(f: &SealFriction, v: f64) -> f64 {
    let r = v / f.stribeck_velocity_m_s;
    f.coulomb_n + (f.static_n - f.coulomb_n) * (-r * r).exp()
}

/// Deflection of the bristle (m) after `time_s` at speed `v` (m/s): `z' = v − σ|v|/g(v) z`, implicit
/// in `z`, so that it is bounded for any step.
#[must_use]
pub fn bristle_after(f: &SealFriction, bristle_m: f64, v: f64, time_s: f64) -> f64 {
    if f.static_n <= 0.0 {
        return 0.0;
    }
    let rate = f.bristle_n_m * v.abs() / friction_level_n(f, v);
    (bristle_m + time_s * v) / (1.0 + time_s * rate)
}

/// Friction, N, against a motion at `v` (m/s) with the bristle at `bristle_m`.
#[must_use]
pub fn friction_n(f: &SealFriction, bristle_m: f64, v: f64) -> f64 {
    if f.static_n <= 0.0 {
        return 0.0;
    }
    let rate = v - f.bristle_n_m * v.abs() / friction_level_n(f, v) * bristle_m;
    f.bristle_n_m * bristle_m + f.bristle_damping_n_s_m * rate
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
        s.v_m_s += h * push / (self.mass_kg + leg.phase_mass_kg());
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
