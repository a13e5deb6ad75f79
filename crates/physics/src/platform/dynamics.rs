//! The reduced rig: a rigid plate on six legs with mass, no constraint solver.
//!
//! The tip of a universal–prismatic–spherical leg is free in space, so a leg alone is a system of
//! three degrees of freedom: the vector `x = L û` from base joint to plate joint. Its kinetic energy
//! is exact in `x`:
//!
//! ```text
//! T = ½ φ(L) |ẋ|² + ½ (m_r − φ(L)) L̇² + ½ J(c) q̇²,    φ = I(L)/L²
//! ```
//!
//! where `I(L) = I_0 + m_r (L − d_r)²` is the inertia across the leg about the base joint, `m_r` the
//! rod's mass, `c = a·û` with the first axis `a` of the universal joint, `q̇ = (a×x)·ẋ / |a×x|²` the
//! rate about it, and `J(c) = I_axial c² + I_cross`: seen along itself a leg on a universal joint
//! spins with `c q̇`, and the cross turns with `q̇`. Lagrange's equations of the three terms give what
//! the plate must apply to the tip; summed over the legs, with the plate's own Newton–Euler
//! equations, this is `M(X) a + h(X, t) = Jᵀ F + W` with a 6×6 mass matrix in plate coordinates.

use docktwin_core::{DMat3, DVec3, Pose, Twist, Wrench, inertia_world, skew};
use docktwin_model::Leg;
use nalgebra::Matrix6;

use super::{Configuration, Platform, six, six_of, twist_of};

/// A leg as a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct LegBody {
    pub(super) base_joint: DVec3,
    pub(super) plate_joint: DVec3,
    /// First axis of the universal joint, in `eb`.
    axis: DVec3,
    /// Inertia across the leg that does not depend on its length, about the base joint: cylinder,
    /// and the rod about its own mass centre.
    across: f64,
    /// Both parts about the leg's axis.
    along: f64,
    /// The cross about the first axis.
    cross: f64,
    rod_mass: f64,
    /// From the plate joint to the rod's mass centre.
    rod_com: f64,
    /// Mass times distance of the cylinder's mass centre from the base joint.
    cylinder_moment: f64,
}

/// What a leg's own mass asks of the plate at the plate joint, in `eb`: the force `A a + bias` moves
/// the tip with the acceleration `a`, `weight` holds the leg against gravity.
/// `A = φ 1 + (m_r − φ) û ûᵀ + J g gᵀ`.
struct LegLoad {
    /// φ, kg: in every direction.
    across: f64,
    /// m_r − φ, kg, along `unit`.
    along: f64,
    unit: DVec3,
    /// J, kg·m², about the first axis; `lever` is g, 1/m.
    spin: f64,
    lever: DVec3,
    /// Centrifugal and Coriolis part, N.
    bias: DVec3,
    /// Gradient of the potential energy, N.
    weight: DVec3,
}

impl LegLoad {
    /// The force that moves the tip with an acceleration, N.
    fn inertial(&self, a: DVec3) -> DVec3 {
        self.across * a
            + self.along * self.unit.dot(a) * self.unit
            + self.spin * self.lever.dot(a) * self.lever
    }
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

impl LegBody {
    pub(super) fn new(leg: &Leg) -> Self {
        let (c, r) = (&leg.cylinder, &leg.rod);
        Self {
            base_joint: leg.base_joint_m(),
            plate_joint: leg.plate_joint_m,
            axis: leg.swing_axis(),
            across: c.transverse_kg_m2 + c.mass_kg * c.com_m * c.com_m + r.transverse_kg_m2,
            along: c.axial_kg_m2 + r.axial_kg_m2,
            cross: leg.cross_inertia_kg_m2.z_axis.z,
            rod_mass: r.mass_kg,
            rod_com: r.com_m,
            cylinder_moment: c.mass_kg * c.com_m,
        }
    }

    fn load(&self, unit: DVec3, length: f64, v: DVec3, gravity: DVec3) -> LegLoad {
        let reach = length - self.rod_com;
        let (u, m_r) = (unit, self.rod_mass);
        // φ and φ'; I'(L) = 2 m_r (L − d_r).
        let inertia = self.across + m_r * reach * reach;
        let phi = inertia / (length * length);
        let slope = 2.0 * (m_r * reach / length - phi) / length;
        let along = u.dot(v);
        let across2 = v.length_squared() - along * along;

        // Rate about the first axis: q̇ = g·ẋ, g = y/|y|², y = a × x.
        let y = self.axis.cross(u) * length;
        let y2 = y.length_squared();
        let g = y / y2;
        let c = self.axis.dot(u);
        let c_slope = (self.axis - c * u) / length;
        let j = self.along * c * c + self.cross;
        let q = g.dot(v);
        let c_rate = c_slope.dot(v);
        // ġ·ẋ; the part with ẏ·ẋ is 0, for ẏ = a × ẋ.
        let g_rate = -2.0 * q * y.dot(self.axis.cross(v)) / y2;

        // Lagrange's equations, acceleration apart.
        let turning = slope * along * v - 0.5 * slope * v.length_squared() * u;
        let sliding = ((m_r - phi) * across2 / length - 0.5 * slope * along * along) * u;
        let spinning =
            (j * g_rate + 2.0 * self.along * c * c_rate * q) * g - self.along * c * q * q * c_slope;

        let down = gravity.dot(u);
        let moment = self.cylinder_moment + m_r * reach;
        LegLoad {
            across: phi,
            along: m_r - phi,
            unit: u,
            spin: j,
            lever: g,
            bias: turning + sliding + spinning,
            weight: -m_r * down * u - moment / length * (gravity - down * u),
        }
    }

    fn potential(&self, unit: DVec3, length: f64, gravity: DVec3) -> f64 {
        let moment = self.cylinder_moment + self.rod_mass * (length - self.rod_com);
        -moment * gravity.dot(unit)
    }
}

impl Platform {
    /// Mass matrix of plate and legs, about the origin of `ep` in the axes of `eb`; symmetric,
    /// positive definite. Kinetic energy is `½ tᵀ M t` with the twist `t`.
    #[must_use]
    pub fn mass_matrix(&self, c: &Configuration) -> Matrix6<f64> {
        self.mass_and_bias(c, &Twist::default()).0
    }

    /// `M` and `h` of `M a + h = Jᵀ F + W`; `h` holds Coriolis and centrifugal terms and weight.
    #[must_use]
    pub fn mass_and_bias(&self, c: &Configuration, twist: &Twist) -> (Matrix6<f64>, Wrench) {
        let (mass, motion, weight) = self.terms(c, twist);
        (mass.matrix(), motion + weight)
    }

    /// Mass matrix, Coriolis and centrifugal wrench, and the wrench that holds the weight.
    fn terms(&self, c: &Configuration, twist: &Twist) -> (Blocks, Wrench, Wrench) {
        let w = twist.w;
        let com = c.x_bp.q * self.plate.com_m;
        let inertia = inertia_world(c.x_bp.q, self.plate.inertia_kg_m2);
        let mut mass = Blocks::ZERO;
        mass.add(self.plate.mass_kg, com);
        mass.rotation += inertia;
        let mut motion = Wrench::at(com, self.plate.mass_kg * w.cross(w.cross(com)));
        motion.m += w.cross(inertia * w);
        let mut weight = Wrench::at(com, -self.plate.mass_kg * self.gravity);
        for i in 0..6 {
            let arm = c.arm[i];
            let v = c.joint_velocity(i, twist);
            let load = self.legs[i].load(c.unit[i], c.length_m[i], v, self.gravity);
            mass.add(load.across, arm);
            mass.add_along(load.along, load.unit, arm);
            mass.add_along(load.spin, load.lever, arm);
            motion.push(arm, load.inertial(w.cross(w.cross(arm))) + load.bias);
            weight.push(arm, load.weight);
        }
        (mass, motion, weight)
    }

    /// Coriolis and centrifugal wrench alone; its power is `½ tᵀ Ṁ t`.
    #[must_use]
    pub fn coriolis(&self, c: &Configuration, twist: &Twist) -> Wrench {
        self.terms(c, twist).1
    }

    /// Leg forces that move the plate with an acceleration while `external` acts on it; legs with
    /// mass, gravity. `None` in a singular pose.
    #[must_use]
    pub fn inverse_dynamics(
        &self,
        c: &Configuration,
        twist: &Twist,
        acceleration: &Twist,
        external: &Wrench,
    ) -> Option<[f64; 6]> {
        let (mass, bias) = self.mass_and_bias(c, twist);
        let inertial = twist_of(&(mass * six(acceleration)));
        let asked = Wrench { f: inertial.v, m: inertial.w } + bias + -*external;
        c.leg_forces(&asked)
    }

    /// Acceleration of the plate under leg forces and `external`: the forward dynamics of the reduced
    /// rig. `None` only for numbers that are not finite.
    #[must_use]
    pub fn forward_dynamics(
        &self,
        c: &Configuration,
        twist: &Twist,
        forces_n: &[f64; 6],
        external: &Wrench,
    ) -> Option<Twist> {
        let (mass, motion, weight) = self.terms(c, twist);
        mass.accelerated(&(c.wrench(forces_n) + *external + -(motion + weight)))
    }

    /// As [`Platform::forward_dynamics`], every leg with a further mass (kg) that resists along it only.
    #[must_use]
    pub fn forward_dynamics_with(
        &self,
        c: &Configuration,
        twist: &Twist,
        forces_n: &[f64; 6],
        external: &Wrench,
        along_kg: &[f64; 6],
    ) -> Option<Twist> {
        let (mut mass, motion, weight) = self.terms(c, twist);
        for (i, m) in along_kg.iter().enumerate() {
            mass.add_along(*m, c.unit[i], c.arm[i]);
        }
        mass.accelerated(&(c.wrench(forces_n) + *external + -(motion + weight)))
    }

    /// Kinetic energy of plate and legs, J.
    #[must_use]
    pub fn kinetic_energy_j(&self, c: &Configuration, twist: &Twist) -> f64 {
        let t = six(twist);
        0.5 * t.dot(&(self.mass_matrix(c) * t))
    }

    /// Potential energy of plate and legs in gravity, J, zero with every mass centre at the origin
    /// of `eb` (legs: at their base joint).
    #[must_use]
    pub fn potential_energy_j(&self, c: &Configuration) -> f64 {
        let com = c.x_bp.transform_point(self.plate.com_m);
        let legs: f64 = self
            .legs
            .iter()
            .enumerate()
            .map(|(i, leg)| leg.potential(c.unit[i], c.length_m[i], self.gravity))
            .sum();
        legs - self.plate.mass_kg * self.gravity.dot(com)
    }

    /// Mass matrix seen by the legs, `J⁻ᵀ M J⁻¹`, kg; `None` in a singular pose.
    #[must_use]
    pub fn leg_mass_matrix(&self, c: &Configuration) -> Option<Matrix6<f64>> {
        let inverse = c.jacobian().try_inverse()?;
        Some(inverse.transpose() * self.mass_matrix(c) * inverse)
    }

    /// Effective masses, the eigenvalues of `(J M⁻¹ Jᵀ)⁻¹`, rising, kg: the masses that act on six
    /// equal legs in the six modes of the platform.
    #[must_use]
    pub fn effective_masses_kg(&self, c: &Configuration) -> Option<[f64; 6]> {
        let mut masses: [f64; 6] = self.leg_mass_matrix(c)?.symmetric_eigenvalues().into();
        masses.sort_by(f64::total_cmp);
        Some(masses)
    }

    /// Moves a pose along a constant twist for a time, s; the origin of `ep` on a straight line.
    #[must_use]
    pub fn moved(x_bp: &Pose, twist: &Twist, time_s: f64) -> Pose {
        let turn = docktwin_core::DQuat::from_scaled_axis(twist.w * time_s);
        Pose::new(x_bp.p + twist.v * time_s, (turn * x_bp.q).normalize())
    }
}

/// A 6×6 mass matrix in 3×3 blocks.
struct Blocks {
    translation: DMat3,
    /// Upper right: force from angular acceleration.
    coupling: DMat3,
    rotation: DMat3,
}

impl Blocks {
    // Not `Default`: that of a matrix is the identity.
    const ZERO: Self =
        Self { translation: DMat3::ZERO, coupling: DMat3::ZERO, rotation: DMat3::ZERO };

    /// Adds a point mass at an arm: its acceleration is `a + α × arm`.
    fn add(&mut self, mass: f64, arm: DVec3) {
        self.translation += DMat3::from_diagonal(DVec3::splat(mass));
        self.coupling -= skew(arm) * mass;
        self.rotation += DMat3::from_diagonal(DVec3::splat(mass * arm.length_squared()))
            - outer(arm, arm * mass);
    }

    /// Adds a mass at an arm that resists along a direction only, by its square: `m d dᵀ`.
    fn add_along(&mut self, mass: f64, direction: DVec3, arm: DVec3) {
        let turning = arm.cross(direction);
        self.translation += outer(direction, direction * mass);
        self.coupling += outer(direction, turning * mass);
        self.rotation += outer(turning, turning * mass);
    }

    /// Acceleration under a wrench about the arms' origin; `None` for numbers that are not finite.
    fn accelerated(&self, push: &Wrench) -> Option<Twist> {
        Some(twist_of(&self.matrix().cholesky()?.solve(&six_of(push))))
    }

    fn matrix(&self) -> Matrix6<f64> {
        let at = |m: &DMat3, i: usize, j: usize| m.col(j)[i];
        Matrix6::from_fn(|i, j| match (i < 3, j < 3) {
            (true, true) => at(&self.translation, i, j),
            (true, false) => at(&self.coupling, i, j - 3),
            (false, true) => at(&self.coupling, j, i - 3),
            // Made symmetric to the last bit, as it is by construction but for rounding.
            (false, false) => {
                0.5 * (at(&self.rotation, i - 3, j - 3) + at(&self.rotation, j - 3, i - 3))
            }
        })
    }
}
