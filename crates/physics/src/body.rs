//! Free rigid bodies: the programme that runs on the real-time computer.
//!
//! The state keeps angular momentum instead of angular velocity, so that free motion conserves it
//! to the last bit, whatever the step. A step is composed of *drifts* (free motion) and *kicks*
//! (momentum exchanged at a frozen position); equal and opposite kicks at one point conserve the
//! linear and angular momentum of the pair exactly.

use docktwin_core::{DMat3, DQuat, DVec3, Pose, StateHasher, Twist, Wrench};

/// Constant mass properties of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    mass: f64,
    inertia: DMat3,
    inertia_inv: DMat3,
}

impl MassProperties {
    /// `mass` in kg, `inertia_b` about the mass centre in body axes, kg·m².
    ///
    /// # Panics
    /// When the mass or the inertia is not positive: models are checked before they come here.
    #[must_use]
    #[inline]
    pub fn new(mass: f64, inertia_b: DMat3) -> Self {
        assert!(mass > 0.0 && inertia_b.determinant() > 0.0, "unchecked mass properties");
        Self { mass, inertia: inertia_b, inertia_inv: inertia_b.inverse() }
    }

    /// Mass, kg.
    #[must_use]
    #[inline]
    pub const fn mass(&self) -> f64 {
        self.mass
    }

    /// Inertia about the mass centre, body axes, kg·m².
    #[must_use]
    #[inline]
    pub const fn inertia(&self) -> DMat3 {
        self.inertia
    }

    /// Two bodies in one, the second at `x_12` (pose of body 2's mass-centre frame in body 1's).
    /// Returns the joint mass properties about the joint mass centre, in axes of body 1, and the
    /// joint mass centre in body 1, m.
    #[must_use]
    pub fn joined(&self, other: &Self, x_12: Pose) -> (Self, DVec3) {
        let mass = self.mass + other.mass;
        let com = x_12.p * (other.mass / mass);
        let steiner =
            |m: f64, d: DVec3| m * (DMat3::from_diagonal(DVec3::splat(d.dot(d))) - outer(d, d));
        let inertia = self.inertia
            + steiner(self.mass, com)
            + docktwin_core::inertia_world(x_12.q, other.inertia)
            + steiner(other.mass, x_12.p - com);
        (Self::new(mass, inertia), com)
    }
}

#[inline]
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// State of a free rigid body in the world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyState {
    /// Mass centre, m.
    pub p: DVec3,
    /// Attitude `R_WB`.
    pub q: DQuat,
    /// Velocity of the mass centre, m/s.
    pub v: DVec3,
    /// Angular momentum about the mass centre, world axes, kg·m²/s.
    pub l: DVec3,
}

impl BodyState {
    /// At `pose`, moving with velocity `v` (m/s, world) and body rate `w_b` (rad/s, body axes).
    #[must_use]
    #[inline]
    pub fn new(mp: &MassProperties, pose: Pose, v: DVec3, w_b: DVec3) -> Self {
        Self { p: pose.p, q: pose.q, v, l: pose.q * (mp.inertia * w_b) }
    }

    /// Pose of the body frame (at the mass centre).
    #[must_use]
    #[inline]
    pub const fn pose(&self) -> Pose {
        Pose { p: self.p, q: self.q }
    }

    /// Body rate in body axes, rad/s.
    #[must_use]
    #[inline]
    pub fn rate_body(&self, mp: &MassProperties) -> DVec3 {
        mp.inertia_inv * (self.q.conjugate() * self.l)
    }

    /// Angular velocity in world axes, rad/s.
    #[must_use]
    #[inline]
    pub fn rate_world(&self, mp: &MassProperties) -> DVec3 {
        self.q * self.rate_body(mp)
    }

    /// Velocity of the mass centre and angular velocity, world axes.
    #[must_use]
    #[inline]
    pub fn twist(&self, mp: &MassProperties) -> Twist {
        Twist { v: self.v, w: self.rate_world(mp) }
    }

    /// Kinetic energy in the world frame, J.
    #[must_use]
    #[inline]
    pub fn kinetic_energy(&self, mp: &MassProperties) -> f64 {
        0.5 * mp.mass * self.v.length_squared() + 0.5 * self.l.dot(self.rate_world(mp))
    }

    /// Torque-free motion over `h` seconds (may be negative): position exactly, attitude by the
    /// classical Runge–Kutta method on q' = ½ q ω(q) with the angular momentum held.
    #[inline]
    pub fn drift(&mut self, mp: &MassProperties, h: f64) {
        self.p += self.v * h;
        if self.l == DVec3::ZERO {
            return;
        }
        let dq = |q: DQuat| {
            let w = mp.inertia_inv * (q.conjugate() * self.l);
            // Keeps |q|' = 0 for any |q|: q̇ = ½ q ω.
            (q * DQuat::from_xyzw(w.x, w.y, w.z, 0.0)) * 0.5
        };
        let q0 = self.q;
        let k1 = dq(q0);
        let k2 = dq(q0 + k1 * (0.5 * h));
        let k3 = dq(q0 + k2 * (0.5 * h));
        let k4 = dq(q0 + k3 * h);
        self.q = (q0 + (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0)).normalize();
    }

    /// Impulse of a wrench about the mass centre (world axes) over `h` seconds.
    #[inline]
    pub fn kick(&mut self, mp: &MassProperties, wrench: Wrench, h: f64) {
        self.v += wrench.f * (h / mp.mass);
        self.l += wrench.m * h;
    }

    /// Velocity change that `wrench` would give over `h`, attitude held.
    #[must_use]
    #[inline]
    pub fn kick_response(&self, mp: &MassProperties, wrench: Wrench, h: f64) -> Twist {
        let dw = self.q * (mp.inertia_inv * (self.q.conjugate() * wrench.m));
        Twist { v: wrench.f * (h / mp.mass), w: dw * h }
    }

    /// Adds all bits to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        h.vec3(self.p);
        h.quat(self.q);
        h.vec3(self.v);
        h.vec3(self.l);
    }

    /// True when every component is finite.
    #[must_use]
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.p.is_finite() && self.q.is_finite() && self.v.is_finite() && self.l.is_finite()
    }
}

/// How a step is composed of drift–kick–drift pieces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Composition {
    /// One piece: second order, one evaluation of the forces.
    Leapfrog,
    /// Five pieces after Suzuki (1990): fourth order in smooth motion, five evaluations.
    #[default]
    Suzuki4,
}

impl Composition {
    /// Lengths of the pieces as fractions of the step; they add up to 1.
    #[must_use]
    #[inline]
    pub fn pieces(self) -> &'static [f64] {
        // 1 / (4 − 4^(1/3)), Suzuki, Phys. Lett. A 146 (1990) 319.
        const P: f64 = 0.414_490_771_794_375_7;
        match self {
            Self::Leapfrog => &[1.0],
            Self::Suzuki4 => &[P, P, 1.0 - 4.0 * P, P, P],
        }
    }
}

/// The two spacecraft as the real-time programme integrates them (§2, Fig. 5): driven by the
/// mechanism's wrench at each port and by a control wrench at each mass centre.
#[derive(Clone, Copy, Debug)]
pub struct BodyPair {
    /// Chaser and target.
    pub mass: [MassProperties; 2],
    /// Their states in the world frame.
    pub state: [BodyState; 2],
    /// How a step is composed.
    pub composition: Composition,
}

impl BodyPair {
    /// Advances by `h` seconds. `wrenches` is called at each evaluation with the time into the step
    /// (s), the states and the twists to be used for velocity-dependent forces, and returns the
    /// wrench on each body about its own mass centre, world axes. Allocates nothing.
    #[inline]
    pub fn step<F>(&mut self, h: f64, mut wrenches: F)
    where
        F: FnMut(f64, &[BodyState; 2], &[Twist; 2]) -> [Wrench; 2],
    {
        let mut t = 0.0;
        for fraction in self.composition.pieces() {
            let d = fraction * h;
            for (s, m) in self.state.iter_mut().zip(&self.mass) {
                s.drift(m, 0.5 * d);
            }
            t += 0.5 * d;
            let twist0 = [self.state[0].twist(&self.mass[0]), self.state[1].twist(&self.mass[1])];
            let mut mid = twist0;
            let mut w = [Wrench::ZERO; 2];
            // Implicit midpoint in velocity: the work of every force is then exactly the change of
            // kinetic energy. Contraction is fast: damping × step / mass ≪ 1.
            for _ in 0..MIDPOINT_ITERATIONS {
                w = wrenches(t, &self.state, &mid);
                for i in 0..2 {
                    let dv = self.state[i].kick_response(&self.mass[i], w[i], d);
                    mid[i] = Twist { v: twist0[i].v + dv.v * 0.5, w: twist0[i].w + dv.w * 0.5 };
                }
            }
            for ((s, m), w) in self.state.iter_mut().zip(&self.mass).zip(w) {
                s.kick(m, w, d);
                s.drift(m, 0.5 * d);
            }
            t += 0.5 * d;
        }
    }
}

/// Fixed-point iterations of the midpoint velocity.
pub(crate) const MIDPOINT_ITERATIONS: usize = 3;
