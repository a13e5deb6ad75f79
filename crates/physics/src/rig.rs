//! The rig without its controllers. [`RigPlant`] says what every form of it can do; [`ReducedRig`] is
//! the plate with its six legs as rigid bodies ([`crate::platform`]), moved by six hydraulic legs
//! ([`crate::hydraulics`]), without a constraint solver. The other form, every part of a leg a body of
//! its own, stands in `docktwin-twin`.
//!
//! A step of the reduced rig is the leapfrog of [`crate::hydraulics`] in six degrees of freedom: the plate drifts for
//! half a step, the oil follows the legs' exact lengths, half of the flow passes the valves, one kick
//! with all forces, the other half of the flow, the other half of the drift.

use docktwin_core::{DVec3, Pose, StateHasher, Twist, Wrench};
use docktwin_model::{Drive, HydraulicPreset, PositionLoop, Rig};

use crate::{
    hydraulics::{Draws, Leg, LegParameters, LegSpread, LegState},
    platform::{Configuration, Platform},
};

/// Stream of the draws that belong to the whole rig; legs have 0 to 5.
const RIG_STREAM: u64 = 6;

/// A form of the rig: mechanics and hydraulics, no controller.
pub trait RigPlant {
    /// Kinematics and rigid dynamics.
    fn platform(&self) -> &Platform;

    /// The step, s.
    fn step_s(&self) -> f64;

    /// Puts the rig to rest, as [`ReducedRig::at_rest`].
    ///
    /// # Errors
    /// The pose is singular.
    fn rest(&mut self, x_bp: &Pose, external: &Wrench) -> Result<RigState, RigFault>;

    /// One step, as [`ReducedRig::step`], from the state that the step before or
    /// [`RigPlant::rest`] left in `s`.
    ///
    /// # Errors
    /// The state cannot be continued.
    fn advance(
        &mut self,
        s: &mut RigState,
        commands: &[f64; 6],
        external: impl FnMut(&Pose, &Twist) -> Wrench,
    ) -> Result<(), RigFault>;
}

impl RigPlant for ReducedRig {
    fn platform(&self) -> &Platform {
        &self.platform
    }

    fn step_s(&self) -> f64 {
        self.step_s
    }

    fn rest(&mut self, x_bp: &Pose, external: &Wrench) -> Result<RigState, RigFault> {
        self.at_rest(x_bp, external)
    }

    fn advance(
        &mut self,
        s: &mut RigState,
        commands: &[f64; 6],
        external: impl FnMut(&Pose, &Twist) -> Wrench,
    ) -> Result<(), RigFault> {
        self.step(s, commands, external)
    }
}

/// A rig of these legs at rest at `x_bp`, as [`ReducedRig::at_rest`].
///
/// # Errors
/// The pose is singular.
pub fn at_rest(
    platform: &Platform,
    legs: &[Leg; 6],
    x_bp: &Pose,
    external: &Wrench,
) -> Result<RigState, RigFault> {
    let c = platform.at(x_bp);
    let still = Twist::default();
    let forces = platform.inverse_dynamics(&c, &still, &still, external).ok_or(RigFault)?;
    let mut states = [LegState::default(); 6];
    for ((s, leg), f) in states.iter_mut().zip(legs).zip(forces) {
        s.pressure_pa = f / leg.parameters().oil.area_m2;
    }
    Ok(RigState {
        x_bp: *x_bp,
        twist: still,
        acceleration: still,
        length_m: c.length_m,
        legs: states,
    })
}

/// Brings oil and seals of all legs along while their lengths change to `length_m` within `time_s`.
pub fn follow_lengths(legs: &[Leg; 6], s: &mut RigState, length_m: [f64; 6], time_s: f64) {
    for (i, leg) in legs.iter().enumerate() {
        let way = length_m[i] - s.length_m[i];
        leg.compress(&mut s.legs[i], way);
        leg.slide(&mut s.legs[i], way / time_s, time_s);
    }
    s.length_m = length_m;
}

/// Forces of all legs in the middle of a step, N, after half of its flow, and the twist of the plate
/// there, foreseen with the acceleration of the step before: forces that depend on speed get that one.
pub fn middle_forces(
    legs: &[Leg; 6],
    s: &mut RigState,
    c: &Configuration,
    opening: &[f64; 6],
    half_s: f64,
) -> (Twist, [f64; 6]) {
    let middle = Twist {
        v: s.twist.v + s.acceleration.v * half_s,
        w: s.twist.w + s.acceleration.w * half_s,
    };
    let rates = c.rates(&middle);
    let forces = core::array::from_fn(|i| {
        legs[i].flow(&mut s.legs[i], opening[i], half_s);
        legs[i].force(&s.legs[i], rates[i])
    });
    (middle, forces)
}

/// The rig as built: everything that does not change while it moves.
#[derive(Clone, Debug)]
pub struct ReducedRig {
    platform: Platform,
    legs: [Leg; 6],
    step_s: f64,
}

/// What moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigState {
    /// Plate in the ground, `X_bp`.
    pub x_bp: Pose,
    /// Velocity of the origin of `ep` and angular velocity, in `eb`.
    pub twist: Twist,
    /// Acceleration of the last step, which foresees the velocity in the middle of the next.
    pub acceleration: Twist,
    /// Lengths of the legs, m.
    pub length_m: [f64; 6],
    /// Valves, oil and seals.
    pub legs: [LegState; 6],
}

impl RigState {
    /// Adds all bits to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        h.vec3(self.x_bp.p);
        h.quat(self.x_bp.q);
        for v in [self.twist.v, self.twist.w, self.acceleration.v, self.acceleration.w] {
            h.vec3(v);
        }
        for (length, leg) in self.length_m.iter().zip(&self.legs) {
            h.f64(*length);
            leg.hash_into(h);
        }
    }
}

/// The rig left numbers behind that are not finite, or the plate reached a singular pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RigFault;

impl core::fmt::Display for RigFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(
            "the rig's state is not finite or the plate is in a singular pose: check commands, \
             tuning and external wrench",
        )
    }
}

impl core::error::Error for RigFault {}

impl ReducedRig {
    /// A rig of a platform and six legs, stepped by `step_s` seconds (0.1–0.25 ms).
    #[must_use]
    pub fn new(platform: Platform, legs: &[LegParameters; 6], step_s: f64) -> Self {
        Self { platform, legs: legs.map(|p| Leg::new(p, step_s)), step_s }
    }

    /// Kinematics and rigid dynamics.
    #[must_use]
    pub const fn platform(&self) -> &Platform {
        &self.platform
    }

    /// The legs.
    #[must_use]
    pub const fn legs(&self) -> &[Leg; 6] {
        &self.legs
    }

    /// The step, s.
    #[must_use]
    pub const fn step_s(&self) -> f64 {
        self.step_s
    }

    /// At rest at `x_bp`, valves closed, the oil carrying the weight and `external` (N, N·m on the
    /// plate about the origin of `ep`, in `eb`).
    ///
    /// # Errors
    /// The pose is singular.
    pub fn at_rest(&self, x_bp: &Pose, external: &Wrench) -> Result<RigState, RigFault> {
        at_rest(&self.platform, &self.legs, x_bp, external)
    }

    fn drift(&self, s: &mut RigState, time_s: f64) -> Configuration {
        s.x_bp = Platform::moved(&s.x_bp, &s.twist, time_s);
        let c = self.platform.at(&s.x_bp);
        follow_lengths(&self.legs, s, c.length_m, time_s);
        c
    }

    /// One step. `commands` are the valves' (fractions of stroke); `external` gives the wrench on
    /// the plate about the origin of `ep`, in `eb`, for a pose and twist of the plate: it is asked
    /// once, in the middle of the step.
    ///
    /// # Errors
    /// The state cannot be continued; it stays as it was at the fault.
    pub fn step(
        &self,
        s: &mut RigState,
        commands: &[f64; 6],
        mut external: impl FnMut(&Pose, &Twist) -> Wrench,
    ) -> Result<(), RigFault> {
        let h = self.step_s;
        let half = 0.5 * h;
        let opening: [f64; 6] =
            core::array::from_fn(|i| self.legs[i].valve(&mut s.legs[i], commands[i]));
        let c = self.drift(s, half);
        let (middle, forces) = middle_forces(&self.legs, s, &c, &opening, half);
        let push = external(&s.x_bp, &middle);
        let phase_kg = self.legs.each_ref().map(Leg::phase_mass_kg);
        let a = self
            .platform
            .forward_dynamics_with(&c, &middle, &forces, &push, &phase_kg)
            .ok_or(RigFault)?;
        if !(a.v.is_finite() && a.w.is_finite()) {
            return Err(RigFault);
        }
        s.acceleration = a;
        s.twist.v += a.v * h;
        s.twist.w += a.w * h;
        for ((leg, state), opening) in self.legs.iter().zip(&mut s.legs).zip(opening) {
            leg.flow(state, opening, half);
        }
        self.drift(s, half);
        Ok(())
    }

    /// Kinetic energy, weight, oil and bristles, J.
    #[must_use]
    pub fn energy_j(&self, s: &RigState) -> f64 {
        let c = self.platform.at(&s.x_bp);
        let stored: f64 = self.legs.iter().zip(&s.legs).map(|(leg, s)| leg.stored_j(s)).sum();
        self.platform.kinetic_energy_j(&c, &s.twist) + self.platform.potential_energy_j(&c) + stored
    }
}

/// A rig drawn within the spread of its file: the same seed gives the same rig.
#[derive(Clone, Debug)]
pub struct PerturbedRig {
    /// The file with mass, inertia and dead time drawn; legs are in `legs`.
    pub rig: Rig,
    /// The legs, each with its own draw.
    pub legs: BuiltLegs,
}

/// Legs as built.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a rig has one of them, and it is copied as a whole")]
pub enum BuiltLegs {
    /// On oil.
    Hydraulic([LegParameters; 6]),
    /// With position loops of their own.
    Loops([PositionLoop; 6]),
}

impl BuiltLegs {
    /// The legs on oil, if that moves them.
    #[must_use]
    pub const fn hydraulic(&self) -> Option<&[LegParameters; 6]> {
        match self {
            Self::Hydraulic(legs) => Some(legs),
            Self::Loops(_) => None,
        }
    }
}

impl PerturbedRig {
    /// The rig of a file itself, or drawn with a seed.
    #[must_use]
    pub fn of(rig: &Rig, preset: HydraulicPreset, seed: Option<u64>) -> Self {
        match seed {
            Some(seed) => Self::draw(rig, preset, seed),
            None => Self { rig: rig.clone(), legs: as_filed(rig, preset) },
        }
    }

    /// Draws everything within `rig.spread`.
    #[must_use]
    pub fn draw(rig: &Rig, preset: HydraulicPreset, seed: u64) -> Self {
        let mut out = rig.clone();
        let mut draws = Draws::new(seed, RIG_STREAM);
        let factor = 1.0 + rig.spread.plate_mass * draws.uniform();
        out.plate.mass_kg *= factor;
        out.plate.inertia_kg_m2 *= factor;
        let late = rig.spread.dead_time_s * draws.uniform();
        out.drive.set_dead_time_s((rig.drive.dead_time_s() + late).max(0.0));
        let legs = match as_filed(&out, preset) {
            BuiltLegs::Hydraulic([leg, ..]) => {
                let spread = LegSpread::of_rig(&rig.spread);
                let drawn = |i| leg.perturbed(&spread, seed, i);
                BuiltLegs::Hydraulic([0, 1, 2, 3, 4, 5].map(drawn))
            }
            BuiltLegs::Loops([leg, ..]) => {
                let drawn = |i| {
                    let mut draws = Draws::new(seed, i);
                    let mut factor = |spread: f64| 1.0 + spread * draws.uniform();
                    PositionLoop {
                        natural_frequency_hz: leg.natural_frequency_hz
                            * factor(rig.spread.loop_frequency),
                        damping_ratio: leg
                            .damping_ratio
                            .map(|z| z * factor(rig.spread.loop_damping)),
                        ..leg
                    }
                };
                BuiltLegs::Loops([0, 1, 2, 3, 4, 5].map(drawn))
            }
        };
        Self { rig: out, legs }
    }
}

/// Six equal legs as the file says.
fn as_filed(rig: &Rig, preset: HydraulicPreset) -> BuiltLegs {
    match &rig.drive {
        Drive::Hydraulic(h) => BuiltLegs::Hydraulic([LegParameters::of_drive(h, preset); 6]),
        Drive::PositionLoop(l) => BuiltLegs::Loops([*l; 6]),
        Drive::Measured(m) => BuiltLegs::Loops([m.fitted; 6]),
    }
}

/// A spring between the port of the plate and the ground: what a docked mechanism is to the rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PortSpring {
    /// The port in `ep`, m.
    pub port_m: DVec3,
    /// Where the spring has no force, in `eb`, m.
    pub rest_m: DVec3,
    /// Stiffness along the axes of `eb`, N/m.
    pub stiffness_n_m: DVec3,
}

impl PortSpring {
    /// Wrench on the plate about the origin of `ep`, in `eb`.
    #[must_use]
    pub fn wrench(&self, x_bp: &Pose) -> Wrench {
        let arm = x_bp.q * self.port_m;
        Wrench::at(arm, -(x_bp.p + arm - self.rest_m) * self.stiffness_n_m)
    }
}
