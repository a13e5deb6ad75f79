//! The reduced twin: chaser, ring and target integrated by our own allocation-free programme.
//!
//! A step is drift–kick–drift about one measurement of the geometry at the middle (second order,
//! symplectic for the conservative part); the body programme alone is of fourth order (see
//! [`crate::body`]). Kicks are equal and opposite at one point, so momentum is kept to rounding.

use docktwin_core::{DVec3, Digest, Pose, StateHasher, Twist, Wrench};

use crate::{
    body::BodyState,
    limits::LimitPassed,
    mechanism::{CHASER, Kick, Measured, MechanismState, Midpoint, RING, System, TARGET},
};

/// Control wrenches of a tick, about the mass centres, in body axes: F1, M1 and F2, M2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inputs {
    /// On the chaser, in `e1`.
    pub chaser: Wrench,
    /// On the target, in `e2`.
    pub target: Wrench,
}

impl Inputs {
    /// Adds all bits to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        for w in [self.chaser, self.target] {
            h.vec3(w.f);
            h.vec3(w.m);
        }
    }
}

/// State of a docking: small, plain, cloneable and hashable.
#[derive(Clone, Debug, PartialEq)]
pub struct DockingState {
    /// Chaser, ring, target. With a rigid ring the second follows the first.
    pub bodies: [BodyState; 3],
    /// Memory of the mechanism.
    pub mechanism: MechanismState,
    /// Steps since the start.
    pub step: u64,
    /// Work done by the control wrenches, J.
    pub work_in_j: f64,
    /// Linear impulse of the control wrenches (N·s) and their angular impulse about the world's
    /// origin (N·m·s).
    pub impulse_in: Wrench,
    /// Largest force between the sides in any step, N.
    pub peak_force_n: f64,
    /// Largest moment on the target about the passive ring's centre in any step, N·m.
    pub peak_moment_nm: f64,
    /// Deepest contact in any step, m.
    pub peak_depth_m: f64,
    /// Time integral of the size of the force between the sides until capture, N·s.
    pub impulse_ns: f64,
    /// Time integral of the force on the target, world axes, N·s.
    pub net_impulse: DVec3,
    /// The first limit passed in any step.
    pub limit: Option<LimitPassed>,
    /// Middle of the first step in which surfaces touched, s.
    pub first_contact_s: Option<f64>,
}

impl DockingState {
    /// At the start, with these bodies.
    #[must_use]
    pub fn new(bodies: [BodyState; 3]) -> Self {
        Self {
            bodies,
            mechanism: MechanismState::default(),
            step: 0,
            work_in_j: 0.0,
            impulse_in: Wrench::ZERO,
            peak_force_n: 0.0,
            peak_moment_nm: 0.0,
            peak_depth_m: 0.0,
            impulse_ns: 0.0,
            net_impulse: DVec3::ZERO,
            limit: None,
            first_contact_s: None,
        }
    }

    /// Poses of the mass-centre frames.
    #[must_use]
    pub fn poses(&self) -> [Pose; 3] {
        self.bodies.map(|b| b.pose())
    }

    /// Adds all bits to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        self.bodies.iter().for_each(|b| b.hash_into(h));
        self.mechanism.hash_into(h);
        h.u64(self.step);
        h.f64(self.work_in_j);
    }

    /// Digest of all bits.
    #[must_use]
    pub fn digest(&self) -> Digest {
        let mut h = StateHasher::new();
        self.hash_into(&mut h);
        h.finish()
    }

    /// Keeps the account of the control wrenches `external` (about the mass centres, world axes), the
    /// running maxima, the impulse and the first limit passed, of one kick.
    pub fn note(
        &mut self,
        system: &System,
        measured: &Measured,
        external: &[Wrench; 3],
        kick: &Kick,
        middle: &Midpoint,
    ) {
        let Midpoint { com, time_s, h } = *middle;
        for i in [CHASER, TARGET] {
            let (w, mid) = (&external[i], &kick.mid[i]);
            self.work_in_j += h * (w.f.dot(mid.v) + w.m.dot(mid.w));
            self.impulse_in.push(com[i], w.f * h);
            self.impulse_in.m += w.m * h;
        }
        let loads = system.loads(measured, &kick.forces);
        let force = loads.interface.f.length();
        self.peak_force_n = self.peak_force_n.max(force);
        self.peak_moment_nm = self.peak_moment_nm.max(loads.interface.m.length());
        self.peak_depth_m = self.peak_depth_m.max(loads.depth_m);
        self.net_impulse += kick.forces.on_target.f * h;
        if self.limit.is_none() {
            self.limit = LimitPassed::first(system.mechanism(), &loads, time_s);
        }
        if self.mechanism.captured_s().is_none() {
            self.impulse_ns += force * h;
        }
        if measured.touching() {
            self.first_contact_s.get_or_insert(time_s);
        }
    }
}

/// Energy account of an instant, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Kinetic, in the frame of the common mass centre at the start.
    pub kinetic: f64,
    /// Stored in contacts, attenuator, latches, joint.
    pub stored: f64,
    /// Lost so far.
    pub lost: f64,
    /// Put in by control wrenches so far.
    pub work_in: f64,
}

impl System {
    /// Kinetic and stored energy, and the account so far.
    #[must_use]
    pub fn energy(&self, state: &DockingState, measured: &Measured) -> Energy {
        let kinetic = |i: usize| state.bodies[i].kinetic_energy(&self.mass()[i]);
        Energy {
            kinetic: kinetic(CHASER)
                + kinetic(TARGET)
                + if self.rigid() { 0.0 } else { kinetic(RING) },
            stored: self.stored_energy(measured, &state.mechanism),
            lost: state.mechanism.losses.total(),
            work_in: state.work_in_j,
        }
    }

    /// Linear momentum (kg·m/s) and angular momentum about the world's origin (kg·m²/s).
    #[must_use]
    pub fn momentum(&self, state: &DockingState) -> Wrench {
        let mut out = Wrench::ZERO;
        for (i, (b, m)) in state.bodies.iter().zip(self.mass()).enumerate() {
            if self.rigid() && i == RING {
                continue;
            }
            out.push(b.p, b.v * m.mass());
            out.m += b.l;
        }
        out
    }

    /// Sets a rigid ring where the chaser holds it.
    pub fn follow(&self, bodies: &mut [BodyState; 3]) {
        if !self.rigid() {
            return;
        }
        let c = bodies[CHASER];
        let pose = self.rigid_ring_pose(c.pose());
        let t = c.twist(&self.mass()[CHASER]);
        bodies[RING] = BodyState::new(
            &self.mass()[RING],
            pose,
            t.v + t.w.cross(pose.p - c.p),
            pose.q.conjugate() * t.w,
        );
    }

    /// One step of `h` seconds with the control wrenches held. Allocates nothing.
    pub fn step(&self, state: &mut DockingState, inputs: &Inputs, h: f64) {
        self.step_in(&mut self.room(), state, inputs, h);
    }

    /// As [`Self::step`], with room for its measurement ([`Self::room`]) that the next step can use again.
    pub fn step_in(
        &self,
        measured: &mut Measured,
        state: &mut DockingState,
        inputs: &Inputs,
        h: f64,
    ) {
        let mass = self.mass();
        for (b, m) in state.bodies.iter_mut().zip(mass) {
            b.drift(m, 0.5 * h);
        }
        self.follow(&mut state.bodies);
        #[expect(clippy::cast_precision_loss, reason = "exact below 2^53 steps")]
        let time_s = (state.step as f64 + 0.5) * h;
        let poses = state.poses();
        self.measure_into(&state.mechanism, &poses, measured);
        let com = poses.map(|x| x.p);
        let start: [Twist; 3] = core::array::from_fn(|i| state.bodies[i].twist(&mass[i]));
        let mut external = [Wrench::ZERO; 3];
        external[CHASER] = inputs.chaser.rotated(poses[CHASER].q);
        external[TARGET] = inputs.target.rotated(poses[TARGET].q);
        let middle = Midpoint { com, time_s, h };
        let kick =
            self.solve_kick(measured, &state.mechanism, &start, &external, &middle, |i, w| {
                state.bodies[i].kick_response(&mass[i], w, h)
            });
        self.commit(&mut state.mechanism, measured, &kick, &middle);
        state.note(self, measured, &external, &kick, &middle);
        for (i, (b, m)) in state.bodies.iter_mut().zip(mass).enumerate() {
            if self.rigid() && i == RING {
                continue;
            }
            b.kick(m, kick.wrench[i], h);
            b.drift(m, 0.5 * h);
        }
        self.follow(&mut state.bodies);
        state.step += 1;
    }
}

/// What both twins offer: advance a docking, show its state, go back to an earlier one.
pub trait DockingTwin {
    /// A state to come back to.
    type Snapshot: Clone;

    /// The immutable half.
    fn system(&self) -> &System;

    /// Advances by one physics step with the control wrenches held.
    fn step(&mut self, inputs: &Inputs);

    /// State of the present instant, all of it at one time.
    fn state(&self) -> DockingState;

    /// Digest of everything the next step depends on.
    fn digest(&self) -> Digest;

    /// Keeps the state.
    fn snapshot(&self) -> Self::Snapshot;

    /// Goes back to it.
    fn restore(&mut self, snapshot: &Self::Snapshot);
}

/// The reduced twin: [`System::step`] on a [`DockingState`].
#[derive(Clone, Debug)]
pub struct ReducedTwin {
    system: System,
    state: DockingState,
    step_s: f64,
    room: Measured,
}

impl ReducedTwin {
    /// From the bodies at the start, with steps of `step_s` seconds.
    #[must_use]
    pub fn new(system: System, mut bodies: [BodyState; 3], step_s: f64) -> Self {
        system.follow(&mut bodies);
        let room = system.room();
        Self { system, state: DockingState::new(bodies), step_s, room }
    }
}

impl DockingTwin for ReducedTwin {
    type Snapshot = DockingState;

    fn system(&self) -> &System {
        &self.system
    }

    fn step(&mut self, inputs: &Inputs) {
        self.system.step_in(&mut self.room, &mut self.state, inputs, self.step_s);
    }

    fn state(&self) -> DockingState {
        self.state.clone()
    }

    fn digest(&self) -> Digest {
        self.state.digest()
    }

    fn snapshot(&self) -> DockingState {
        self.state.clone()
    }

    fn restore(&mut self, snapshot: &DockingState) {
        self.state.clone_from(snapshot);
    }
}
