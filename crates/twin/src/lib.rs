//! The full twins: the on-orbit world in rapier, and the motion simulator with its loops ([`rig`]).
//!
//! rapier integrates positions and velocities of the three bodies, `docktwin-physics` measures the geometry and pushes with its
//! law: rapier's own contact solver has no stiffness in N/m (see ARCHITECTURE.md). Nothing in the
//! on-orbit scene is a rigid constraint, so no rapier joint is needed there; a rigid ring is one
//! body with its chaser.
//!
//! rapier steps velocities first and positions with the new velocities. Its positions are therefore
//! kept half a step ahead of its velocities: forces are then evaluated in the middle of the step and
//! the scheme is of second order, like the reduced twin's. [`FullTwin::state`] brings both to one
//! instant. Attitudes are set by our own step of free rotation, which is of fourth order; rapier's
//! is of first.

pub mod rig;

use docktwin_core::{DMat3, DQuat, DVec3, Digest, Pose, StateHasher, Twist, Wrench};
use docktwin_physics::{
    body::BodyState,
    mechanism::{CHASER, Kick, Measured, Midpoint, RING, System, TARGET},
    reduced::{DockingState, DockingTwin, Inputs},
};
use rapier3d_f64::prelude::{
    MassProperties, PhysicsWorld, Pose as RapierPose, RigidBodyBuilder, RigidBodyHandle, Vector,
};

/// The on-orbit world.
pub struct FullTwin {
    system: System,
    world: PhysicsWorld,
    handles: [RigidBodyHandle; 3],
    /// Memory of the mechanism and the running sums; its bodies are those of the last step's middle.
    memory: DockingState,
    step_s: f64,
    room: Measured,
}

/// A state of the full twin: rapier's positions and velocities and the memory of the mechanism.
#[derive(Clone, Debug, PartialEq)]
pub struct FullSnapshot {
    bodies: [(Pose, Twist); 3],
    memory: DockingState,
}

/// Mass properties for rapier, inertia about the mass centre in the axes of the body.
///
/// Not `MassProperties::with_inertia_matrix`: its closed-form eigenvectors are wrong where two
/// principal moments are equal, as in every body of revolution (parry 0.31.1: diag(12.7, 6.4, 6.4)
/// comes back with the large moment about another axis).
pub(crate) fn mass_properties(mass: f64, com: DVec3, inertia: DMat3) -> MassProperties {
    let m = nalgebra::Matrix3::from_column_slice(&inertia.to_cols_array());
    let eigen = m.symmetric_eigen();
    let axis = |i: usize| {
        let c = eigen.eigenvectors.column(i);
        DVec3::new(c[0], c[1], c[2])
    };
    // A right-handed frame; only the sign of an axis is free.
    let (x, y) = (axis(0), axis(1));
    let frame = DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))).normalize();
    let principal = Vector::new(eigen.eigenvalues[0], eigen.eigenvalues[1], eigen.eigenvalues[2]);
    MassProperties::with_principal_inertia_frame(com, mass, principal, frame)
}

impl FullTwin {
    /// Sets what rapier made of the rotations: its step of first order loses 2e-5 of attitude in 25 s at 20 °/s.
    /// Ours keeps the angular momentum of free rotation to rounding. `bodies` are those before the step.
    fn set_rotations(&mut self, bodies: &[BodyState; 3], kick: &Kick, h: f64) {
        let mass = self.system.mass();
        for i in [CHASER, RING, TARGET] {
            if self.system.rigid() && i == RING {
                continue;
            }
            let mut turned = bodies[i];
            turned.kick(&mass[i], kick.wrench[i], h);
            turned.drift(&mass[i], h);
            let b = &mut self.world.bodies[self.handles[i]];
            b.set_rotation(turned.q, true);
            b.set_angvel(turned.rate_world(&mass[i]), true);
        }
    }

    /// From the bodies at the start, with steps of `step_s` seconds.
    #[must_use]
    pub fn new(system: System, mut bodies: [BodyState; 3], step_s: f64) -> Self {
        system.follow(&mut bodies);
        let mut world = PhysicsWorld { gravity: Vector::ZERO, ..PhysicsWorld::default() };
        let p = &mut world.integration_parameters;
        p.dt = step_s;
        // One sub-step: with more, a spring given as an external force would be held and gain
        // energy.
        p.num_solver_iterations = 1;
        p.num_internal_pgs_iterations = 4;
        let handles = core::array::from_fn(|i| {
            let m = &system.mass()[i];
            let mut ahead = bodies[i];
            ahead.drift(m, 0.5 * step_s);
            let builder = if system.rigid() && i == RING {
                RigidBodyBuilder::kinematic_position_based()
            } else {
                RigidBodyBuilder::dynamic().additional_mass_properties(mass_properties(
                    m.mass(),
                    DVec3::ZERO,
                    m.inertia(),
                ))
            };
            world.bodies.insert(
                builder
                    .pose(RapierPose::from_parts(ahead.p, ahead.q))
                    .linvel(ahead.v)
                    .angvel(ahead.rate_world(m))
                    .can_sleep(false)
                    .linear_damping(0.0)
                    .angular_damping(0.0),
            )
        });
        let memory = DockingState::new(bodies);
        let room = system.room();
        let mut twin = Self { system, world, handles, memory, step_s, room };
        // One rebuild makes rapier's derived quantities those of a restored world.
        let snapshot = twin.snapshot();
        twin.restore(&snapshot);
        twin
    }

    fn body(&self, i: usize) -> (Pose, Twist) {
        let b = &self.world.bodies[self.handles[i]];
        let x = b.position();
        (Pose::new(x.translation, x.rotation), Twist { v: b.linvel(), w: b.angvel() })
    }

    /// Whether rapier found a state that is not finite and set it aside.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        (0..3).all(|i| {
            let (x, t) = self.body(i);
            x.is_finite() && t.v.is_finite() && t.w.is_finite()
        })
    }
}

impl DockingTwin for FullTwin {
    type Snapshot = FullSnapshot;

    fn system(&self) -> &System {
        &self.system
    }

    fn step(&mut self, inputs: &Inputs) {
        let h = self.step_s;
        let mass = self.system.mass();
        let mut bodies: [BodyState; 3] = core::array::from_fn(|i| {
            let (x, t) = self.body(i);
            BodyState::new(&mass[i], x, t.v, x.q.conjugate() * t.w)
        });
        self.system.follow(&mut bodies);
        let poses = bodies.map(|b| b.pose());
        #[expect(clippy::cast_precision_loss, reason = "exact below 2^53 steps")]
        let time_s = (self.memory.step as f64 + 0.5) * h;
        self.system.measure_into(&self.memory.mechanism, &poses, &mut self.room);
        let measured = &self.room;
        let com = poses.map(|x| x.p);
        let start: [Twist; 3] = core::array::from_fn(|i| bodies[i].twist(&mass[i]));
        let mut external = [Wrench::ZERO; 3];
        external[CHASER] = inputs.chaser.rotated(poses[CHASER].q);
        external[TARGET] = inputs.target.rotated(poses[TARGET].q);
        let middle = Midpoint { com, time_s, h };
        let memory = &self.memory.mechanism;
        let kick = self.system.solve_kick(measured, memory, &start, &external, &middle, |i, w| {
            bodies[i].kick_response(&mass[i], w, h)
        });
        self.system.commit(&mut self.memory.mechanism, measured, &kick, &middle);
        self.memory.note(&self.system, measured, &external, &kick, &middle);
        self.memory.step += 1;
        for i in [CHASER, RING, TARGET] {
            if self.system.rigid() && i == RING {
                continue;
            }
            let b = &mut self.world.bodies[self.handles[i]];
            b.reset_forces(true);
            b.reset_torques(true);
            b.add_force(kick.wrench[i].f, true);
            b.add_torque(kick.wrench[i].m, true);
        }
        self.world.step();
        self.set_rotations(&bodies, &kick, h);
    }

    fn state(&self) -> DockingState {
        let mass = self.system.mass();
        let mut state = self.memory.clone();
        state.bodies = core::array::from_fn(|i| {
            let (x, t) = self.body(i);
            let mut b = BodyState::new(&mass[i], x, t.v, x.q.conjugate() * t.w);
            b.drift(&mass[i], -0.5 * self.step_s);
            b
        });
        self.system.follow(&mut state.bodies);
        state
    }

    fn digest(&self) -> Digest {
        let mut h = StateHasher::new();
        for i in [CHASER, RING, TARGET] {
            if self.system.rigid() && i == RING {
                continue;
            }
            let (x, t) = self.body(i);
            h.vec3(x.p);
            h.quat(x.q);
            h.vec3(t.v);
            h.vec3(t.w);
        }
        self.memory.mechanism.hash_into(&mut h);
        h.u64(self.memory.step);
        h.f64(self.memory.work_in_j);
        h.finish()
    }

    fn snapshot(&self) -> FullSnapshot {
        FullSnapshot { bodies: core::array::from_fn(|i| self.body(i)), memory: self.memory.clone() }
    }

    fn restore(&mut self, snapshot: &FullSnapshot) {
        self.memory.clone_from(&snapshot.memory);
        for (i, (x, t)) in snapshot.bodies.iter().enumerate() {
            let b = &mut self.world.bodies[self.handles[i]];
            b.set_position(RapierPose::from_parts(x.p, x.q), true);
            b.set_linvel(t.v, true);
            b.set_angvel(t.w, true);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_inertia_survives_the_way_into_rapier() {
        for inertia in [
            DMat3::from_diagonal(DVec3::new(12.7, 6.4, 6.4)),
            DMat3::from_diagonal(DVec3::new(6.4, 6.4, 12.7)),
            DMat3::from_diagonal(DVec3::splat(3.0)),
            DMat3::from_cols(
                DVec3::new(5.0, 0.4, -0.2),
                DVec3::new(0.4, 6.0, 0.3),
                DVec3::new(-0.2, 0.3, 7.0),
            ),
        ] {
            let back = mass_properties(2.0, DVec3::ZERO, inertia).reconstruct_inertia_matrix();
            assert!(
                (back - inertia).abs_diff_eq(DMat3::ZERO, 1e-12),
                "{inertia} came back as {back}"
            );
        }
    }
}
