//! The rig with every part of a leg a body of its own: six loops of ground, cross, cylinder, rod and
//! plate, closed by rapier's joints. It shares with the reduced rig the hydraulics and the kinematics
//! that tell a leg's length, not the dynamics: masses, gravity and gyroscopic moments are rapier's.
//!
//! Impulse joints alone, one solver iteration and a few internal ones: with more iterations the forces
//! of the oil would be held over sub-steps and gain energy; joints in reduced coordinates cost five
//! times more and close the loops no better.
//!
//! As in the on-orbit world rapier's positions are half a step ahead of its velocities, so that forces
//! act in the middle of a step.

use docktwin_core::{DMat3, DQuat, DVec3, Pose, Twist, Wrench};
use docktwin_model::{Leg as RigLeg, LegPart, Rig};
use docktwin_physics::{
    hydraulics::{Leg, LegParameters},
    platform::{Configuration, Platform},
    rig::{RigFault, RigPlant, RigState, at_rest, follow_lengths, middle_forces},
};
use rapier3d_f64::prelude::{
    GenericJointBuilder, JointAxesMask, MassProperties, PhysicsWorld, Pose as RapierPose,
    RigidBodyBuilder, RigidBodyHandle, Vector,
};

use crate::mass_properties;

/// Step that keeps the loops closed to 1e-7 m and the inner loop of 4 kHz in step, s.
pub const FULL_STEP_S: f64 = 2.5e-4;
/// Rounds of the joint solver in a step.
const JOINT_ROUNDS: usize = 12;
/// Steps without motion in which the joints learn the weights they carry.
const SETTLING_STEPS: usize = 200;

/// The rig in rapier.
pub struct FullRig {
    platform: Platform,
    geometry: [RigLeg; 6],
    legs: [Leg; 6],
    step_s: f64,
    world: PhysicsWorld,
    plate: RigidBodyHandle,
    /// Cross, cylinder and rod of each leg. Frames: the first two stand in the base joint, the rod in
    /// the plate joint; +X of cylinder and rod along the leg, axes of the cross those of the universal
    /// joint.
    parts: [[RigidBodyHandle; 3]; 6],
}

fn to_rapier(x: &Pose) -> RapierPose {
    RapierPose::from_parts(x.p, x.q)
}

fn of_part(part: &LegPart, direction: f64) -> MassProperties {
    let across = part.transverse_kg_m2;
    let inertia = DMat3::from_diagonal(DVec3::new(part.axial_kg_m2, across, across));
    mass_properties(part.mass_kg, DVec3::X * direction * part.com_m, inertia)
}

/// Poses and rates of a leg's parts, for a plate at `x_bp` moving with `twist`.
fn parts_of(leg: &RigLeg, x_bp: &Pose, twist: &Twist) -> [(Pose, Twist); 3] {
    let along = leg.vector(x_bp);
    let [swing, tilt] = leg.universal_angles(along);
    let cross = leg.x_b_leg.q * DQuat::from_rotation_z(swing);
    let cylinder = cross * DQuat::from_rotation_y(tilt);
    let tip = twist.v + twist.w.cross(x_bp.q * leg.plate_joint_m);
    // v = L' u + q1' a × x + q2' b × x, with b × x across both others' plane.
    let (a, b) = (leg.swing_axis(), cross * DVec3::Y);
    let about_a = a.cross(along);
    let about_b = b.cross(along);
    let q1 = about_a.dot(tip) / about_a.length_squared();
    let q2 = about_b.dot(tip - q1 * about_a) / about_b.length_squared();
    let w = q1 * a + q2 * b;
    let base = leg.base_joint_m();
    [
        (Pose::new(base, cross), Twist { v: DVec3::ZERO, w: q1 * a }),
        (Pose::new(base, cylinder), Twist { v: DVec3::ZERO, w }),
        (Pose::new(base + along, cylinder), Twist { v: tip, w }),
    ]
}

impl FullRig {
    /// A rig of a file with these legs, stepped by `step_s` seconds (0.1–0.25 ms), at rest in the
    /// middle of the docking workspace.
    #[must_use]
    pub fn new(rig: &Rig, legs: &[LegParameters; 6], step_s: f64) -> Self {
        let gravity: Vector = rig.gravity_m_s2;
        let mut world = PhysicsWorld { gravity, ..PhysicsWorld::default() };
        let p = &mut world.integration_parameters;
        p.dt = step_s;
        p.num_solver_iterations = 1;
        p.num_internal_pgs_iterations = JOINT_ROUNDS;
        let platform = Platform::new(rig);
        let middle = platform.middle();
        let mut body = |x: &Pose, mass: MassProperties| {
            world.bodies.insert(
                RigidBodyBuilder::dynamic()
                    .pose(to_rapier(x))
                    .additional_mass_properties(mass)
                    .can_sleep(false)
                    .linear_damping(0.0)
                    .angular_damping(0.0),
            )
        };
        let m = &rig.plate;
        let plate = body(&middle, mass_properties(m.mass_kg, m.com_m, m.inertia_kg_m2));
        let parts: [[RigidBodyHandle; 3]; 6] = core::array::from_fn(|i| {
            let leg = &rig.legs[i];
            let [cross, cylinder, rod] = parts_of(leg, &middle, &Twist::default()).map(|(x, _)| x);
            [
                body(&cross, {
                    mass_properties(leg.cross_mass_kg, DVec3::ZERO, leg.cross_inertia_kg_m2)
                }),
                body(&cylinder, of_part(&leg.cylinder, 1.0)),
                body(&rod, of_part(&leg.rod, -1.0)),
            ]
        });
        let ground = world.bodies.insert(RigidBodyBuilder::fixed());
        for (leg, [cross, cylinder, rod]) in rig.legs.iter().zip(parts) {
            let joint = GenericJointBuilder::new;
            let all_but = |axis: JointAxesMask| joint(JointAxesMask::all() - axis);
            let base = to_rapier(&leg.x_b_leg);
            let joints = [
                // About Z of the leg frame.
                (ground, cross, all_but(JointAxesMask::ANG_Z).local_frame1(base)),
                // About Y of the cross. The ground holds the cylinder itself: through the cross, which
                // is light, the solver would need fifty rounds to carry the load.
                (cross, cylinder, joint(JointAxesMask::ANG_X | JointAxesMask::ANG_Z)),
                (
                    ground,
                    cylinder,
                    joint(JointAxesMask::LIN_AXES).local_anchor1(leg.base_joint_m()),
                ),
                (cylinder, rod, all_but(JointAxesMask::LIN_X)),
                (rod, plate, joint(JointAxesMask::LIN_AXES).local_anchor2(leg.plate_joint_m)),
            ];
            for (one, other, joint) in joints {
                world.impulse_joints.insert(one, other, joint.contacts_enabled(false), true);
            }
        }
        let legs = legs.map(|p| Leg::new(p, step_s));
        Self { platform, geometry: rig.legs, legs, step_s, world, plate, parts }
    }

    /// The legs' oil and seals.
    #[must_use]
    pub const fn legs(&self) -> &[Leg; 6] {
        &self.legs
    }

    /// Places all bodies for a plate at `x_bp` moving with `twist`.
    fn place(&mut self, x_bp: &Pose, twist: &Twist) {
        let plate = (self.plate, (*x_bp, *twist));
        let legs = self
            .geometry
            .iter()
            .zip(self.parts)
            .flat_map(|(leg, handles)| handles.into_iter().zip(parts_of(leg, x_bp, twist)));
        for (handle, (x, t)) in legs.chain([plate]) {
            let b = &mut self.world.bodies[handle];
            b.set_position(to_rapier(&x), true);
            let arm = b.center_of_mass() - x.p;
            b.set_linvel(t.v + t.w.cross(arm), true);
            b.set_angvel(t.w, true);
        }
    }

    /// Plate and its twist as rapier has them: the pose half a step ahead.
    fn plate(&self) -> (Pose, Twist) {
        let b = &self.world.bodies[self.plate];
        let x = b.position();
        let x = Pose::new(x.translation, x.rotation);
        let w = b.angvel();
        (x, Twist { v: b.linvel() - w.cross(b.center_of_mass() - x.p), w })
    }

    /// Pushes plate and legs: `forces_n` lengthen the legs, `external` acts on the plate about the
    /// origin of `ep`, in `eb`; then one step of rapier.
    fn push(&mut self, c: &Configuration, x_bp: &Pose, forces_n: &[f64; 6], external: &Wrench) {
        for (i, [_, cylinder, rod]) in self.parts.into_iter().enumerate() {
            for (handle, force) in [(cylinder, -forces_n[i]), (rod, forces_n[i])] {
                let b = &mut self.world.bodies[handle];
                b.reset_forces(true);
                // Mass centres lie on the leg's axis.
                b.add_force(c.unit[i] * force, true);
            }
        }
        let b = &mut self.world.bodies[self.plate];
        b.reset_forces(true);
        b.reset_torques(true);
        let arm = b.center_of_mass() - x_bp.p;
        b.add_force(external.f, true);
        b.add_torque(external.m - arm.cross(external.f), true);
        self.world.step();
    }

    /// How far the loops are open, m: the largest distance at any of the joints between points that
    /// should be one, the rods' distance from their cylinders' axes included.
    #[must_use]
    pub fn closure_error_m(&self) -> f64 {
        let pose = |h: RigidBodyHandle| {
            let x = self.world.bodies[h].position();
            Pose::new(x.translation, x.rotation)
        };
        let plate = pose(self.plate);
        let mut worst = 0.0_f64;
        for (leg, handles) in self.geometry.iter().zip(self.parts) {
            let [cross, cylinder, rod] = handles.map(pose);
            let slid = cylinder.inverse_transform_point(rod.p);
            for gap in [
                cross.p - leg.base_joint_m(),
                cylinder.p - cross.p,
                DVec3::new(0.0, slid.y, slid.z),
                rod.p - plate.transform_point(leg.plate_joint_m),
            ] {
                worst = worst.max(gap.length());
            }
        }
        worst
    }
}

impl RigPlant for FullRig {
    fn platform(&self) -> &Platform {
        &self.platform
    }

    fn step_s(&self) -> f64 {
        self.step_s
    }

    fn rest(&mut self, x_bp: &Pose, external: &Wrench) -> Result<RigState, RigFault> {
        let s = at_rest(&self.platform, &self.legs, x_bp, external)?;
        let (c, still) = (self.platform.at(x_bp), s.twist);
        let forces = core::array::from_fn(|i| self.legs[i].force(&s.legs[i], 0.0));
        for _ in 0..SETTLING_STEPS {
            self.place(x_bp, &still);
            self.push(&c, x_bp, &forces, external);
        }
        self.place(x_bp, &still);
        Ok(s)
    }

    fn advance(
        &mut self,
        s: &mut RigState,
        commands: &[f64; 6],
        mut external: impl FnMut(&Pose, &Twist) -> Wrench,
    ) -> Result<(), RigFault> {
        let h = self.step_s;
        let half = 0.5 * h;
        let opening: [f64; 6] =
            core::array::from_fn(|i| self.legs[i].valve(&mut s.legs[i], commands[i]));
        let (middle, _) = self.plate();
        let c = self.platform.at(&middle);
        follow_lengths(&self.legs, s, c.length_m, half);
        let (moving, forces) = middle_forces(&self.legs, s, &c, &opening, half);
        let wrench = external(&middle, &moving);
        self.push(&c, &middle, &forces, &wrench);
        let (ahead, twist) = self.plate();
        if !(ahead.is_finite() && twist.v.is_finite() && twist.w.is_finite()) {
            return Err(RigFault);
        }
        s.acceleration = Twist { v: (twist.v - s.twist.v) / h, w: (twist.w - s.twist.w) / h };
        s.twist = twist;
        s.x_bp = Platform::moved(&ahead, &twist, -half);
        for ((leg, state), opening) in self.legs.iter().zip(&mut s.legs).zip(opening) {
            leg.flow(state, opening, half);
        }
        follow_lengths(&self.legs, s, self.platform.at(&s.x_bp).length_m, half);
        Ok(())
    }
}
