//! The mechanism as it stands on the rig: the active side on the rack, the passive one on the plate,
//! both with weight; a balance ([`crate::hanger`]) may carry
//! the ring's. The same surfaces, attenuator and latches as in orbit ([`crate::mechanism`]); the
//! two spacecraft are gone, the ring is still free.
//!
//! One step is the leapfrog of [`crate::reduced`], the plate's pose and twist in its middle given.

use docktwin_core::{DMat3, DVec3, Pose, StateHasher, Twist, Wrench, inertia_world};
use docktwin_model::{MOST_LATCHES, Rig, RigidMass};

use crate::{
    body::BodyState,
    hanger::Hanger,
    mechanism::{
        CHASER, EnergyLosses, Forces, LatchRule, Measured, MechanismState, Midpoint, RING, System,
        TARGET,
    },
};

/// Wrenches on both sides, each at its mounting plane and in its axes, N and N·m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ports {
    /// F3, M3: on the rack at the origin of `e3`, in `e3`.
    pub port3: Wrench,
    /// F4, M4: on the plate at the origin of `e4`, in `e4`.
    pub port4: Wrench,
}

impl core::ops::Add for Ports {
    type Output = Self;
    fn add(self, rhs: Self) -> Self {
        Self { port3: self.port3 + rhs.port3, port4: self.port4 + rhs.port4 }
    }
}

impl core::ops::Sub for Ports {
    type Output = Self;
    fn sub(self, rhs: Self) -> Self {
        Self { port3: self.port3 - rhs.port3, port4: self.port4 - rhs.port4 }
    }
}

impl core::ops::Mul<f64> for Ports {
    type Output = Self;
    fn mul(self, rhs: f64) -> Self {
        Self { port3: self.port3 * rhs, port4: self.port4 * rhs }
    }
}

impl Ports {
    /// True when every component is a finite number.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.port3.is_finite() && self.port4.is_finite()
    }
}

/// Motion of a sensor and gravity at the instant of a reading, in its axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Carried {
    /// Gravity, m/s².
    pub gravity: DVec3,
    /// Angular velocity, rad/s.
    pub rate: DVec3,
    /// Acceleration of its origin (m/s²) and angular acceleration (rad/s²).
    pub acceleration: Twist,
}

impl Carried {
    /// A sensor on the plate at `x_ps`; gravity, and twist and acceleration of the origin of `ep`, in
    /// `eb`.
    #[must_use]
    pub fn on_plate(
        x_bp: &Pose,
        x_ps: &Pose,
        gravity: DVec3,
        twist: &Twist,
        acceleration: &Twist,
    ) -> Self {
        let q = (x_bp.q * x_ps.q).conjugate();
        let (arm, w, alpha) = (x_bp.q * x_ps.p, twist.w, acceleration.w);
        let a = acceleration.v + alpha.cross(arm) + w.cross(w.cross(arm));
        Self { gravity: q * gravity, rate: q * w, acceleration: Twist { v: q * a, w: q * alpha } }
    }

    /// From accelerometers: they measure acceleration less gravity, the same quantity that loads
    /// the sensor.
    #[must_use]
    pub fn felt(specific_force: DVec3, angular_acceleration: DVec3, rate: DVec3) -> Self {
        let acceleration = Twist { v: specific_force, w: angular_acceleration };
        Self { gravity: DVec3::ZERO, rate, acceleration }
    }

    /// What accelerometers measure there: specific force (m/s²) and angular acceleration (rad/s²).
    #[must_use]
    pub fn feels(&self) -> [DVec3; 2] {
        [self.acceleration.v - self.gravity, self.acceleration.w]
    }
}

/// Weight and inertia of what a sensor carries, seen from the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Payload {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Mass centre, m.
    pub com_m: DVec3,
    /// Inertia about the mass centre, kg·m².
    pub inertia_kg_m2: DMat3,
}

impl Payload {
    /// Nothing.
    pub const NONE: Self = Self { mass_kg: 0.0, com_m: DVec3::ZERO, inertia_kg_m2: DMat3::ZERO };

    /// A body seen from a frame in which the sensor stands at `x_fs`.
    #[must_use]
    pub fn of(body: Option<RigidMass>, x_fs: &Pose) -> Self {
        body.map_or(Self::NONE, |b| Self {
            mass_kg: b.mass_kg,
            com_m: x_fs.inverse_transform_point(b.com_m),
            inertia_kg_m2: inertia_world(x_fs.q.conjugate(), b.inertia_kg_m2),
        })
    }

    /// Wrench on the sensor by weight and inertia, about its origin, in its axes.
    #[must_use]
    pub fn wrench(&self, carried: &Carried) -> Wrench {
        let Carried { gravity, rate, acceleration } = *carried;
        let c = self.com_m;
        let alpha = acceleration.w;
        let a = acceleration.v + alpha.cross(c) + rate.cross(rate.cross(c));
        let mut w = Wrench::at(c, (gravity - a) * self.mass_kg);
        let i = self.inertia_kg_m2;
        w.m -= i * alpha + rate.cross(i * rate);
        w
    }
}

/// What stands on a rig: a mechanism, and how it is mounted.
#[derive(Clone, Debug)]
pub struct Article {
    /// Both spacecraft and the mechanism between them.
    pub system: System,
    /// Mounting planes `e3` and `e4` as they stand, seen from where the rig's file has them; `None` where they
    /// stand there.
    pub mounts: Option<[Pose; 2]>,
}

impl From<System> for Article {
    fn from(system: System) -> Self {
        Self { system, mounts: None }
    }
}

impl Article {
    /// The rig with its mounting planes where they stand.
    #[must_use]
    pub fn on(&self, rig: &Rig) -> Rig {
        self.mounts.as_ref().map_or_else(|| rig.clone(), |mounts| rig.mounted(mounts))
    }

    /// A wrench at a mounting plane, 0 for `e3` and 1 for `e4`, in its axes, about the plane where the rig's
    /// file has it and in the axes there: what a sensor feels that is mounted as its file says.
    #[must_use]
    pub fn at_seat(&self, i: usize, w: Wrench) -> Wrench {
        self.mounts.as_ref().map_or(w, |m| w.rotated(m[i].q).shifted(-m[i].p))
    }
}

/// How the rack moves that carries the ring. Accelerations are of the chaser's mass centre (m/s²) and angular
/// (rad/s²), in `eb`.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Rack {
    /// It stands still.
    Still,
    /// The ring moves as on a chaser that the mechanism accelerates; its acceleration in the last step.
    Yields(Twist),
    /// The ring moves as on a chaser with this acceleration.
    Accelerates(Twist),
}

/// The mechanism between rack and plate.
#[derive(Clone, Debug)]
pub struct Mounted {
    system: System,
    gravity_m_s2: DVec3,
    /// Weight of the ring that no balance carries, N, in `eb`.
    uncarried_n: DVec3,
    /// The balance; `None` where there is none or no ring moves.
    hanger: Option<Hanger>,
    /// Chaser's mass-centre frame that has `e3` on the rack, in `eb`.
    x_wc: Pose,
    /// Target's mass-centre frame in the plate.
    x_pt: Pose,
    state: MechanismState,
    ring: BodyState,
    step_s: f64,
    steps: u64,
    /// Latches are held open.
    open: bool,
    /// Control wrench on the chaser about its mass centre, in its axes, N and N·m.
    pushed: Wrench,
    rack: Rack,
    latch_gaps_m: [f64; MOST_LATCHES],
    /// Ring, mechanism and balance where weight and springs hold each other.
    rest: Option<(MechanismState, BodyState, Option<Hanger>)>,
    room: Measured,
}

impl Mounted {
    /// The mechanism of a system on a rig, stepped by `step_s`; its ring at rest.
    #[must_use]
    pub fn new(system: System, rig: &Rig, step_s: f64) -> Self {
        let [x_c3, x_t4] = system.ports();
        let x_wc = rig.x_b0 * rig.x_03 * x_c3.inverse();
        let x_p4 = rig.x_4p.inverse();
        let ring = x_wc * system.ring_at_rest();
        let room = system.room();
        let mut out = Self {
            uncarried_n: rig.gravity_m_s2 * (system.ring_mass_kg() * rig.uncarried()),
            hanger: hanger(&system, rig),
            ring: BodyState::new(&system.mass()[RING], ring, DVec3::ZERO, DVec3::ZERO),
            system,
            gravity_m_s2: rig.gravity_m_s2,
            x_wc,
            x_pt: x_p4 * x_t4.inverse(),
            state: MechanismState::default(),
            step_s,
            steps: 0,
            open: false,
            pushed: Wrench::ZERO,
            rack: Rack::Still,
            latch_gaps_m: [0.0; MOST_LATCHES],
            rest: None,
            room,
        };
        out.reset();
        out.rest = Some((out.state.clone(), out.ring, out.hanger));
        out.reset();
        out
    }

    /// The system it is made of.
    #[must_use]
    pub const fn system(&self) -> &System {
        &self.system
    }

    /// Latches, attenuator, contact.
    #[must_use]
    pub const fn state(&self) -> &MechanismState {
        &self.state
    }

    /// Holds the latches open, whatever strikes them, or lets them work.
    pub const fn hold_open(&mut self, open: bool) {
        self.open = open;
    }

    /// Lets the ring feel what it would feel on the chaser, which in orbit gives way: `−m (a + α × r)` and `−I α` with
    /// the acceleration that the wrench at port 3 gives the chaser. A rack that stands still leaves it out, which
    /// is a cause of difference of its own (0.5 % of F3 with a ring of 39 kg on 8 t); no rig can do this, it is
    /// there to find the share of that cause. Terms of the chaser's rate are left out, 0.2 N in a docking.
    pub const fn carry_along(&mut self) {
        self.rack = Rack::Yields(Twist { v: DVec3::ZERO, w: DVec3::ZERO });
    }

    /// Lets the ring feel what it would feel on a chaser with this acceleration of its mass centre (m/s²) and this
    /// angular acceleration (rad/s²), in axes of `e1`, from the next step on: `−m (a + α × r)` and `−I α`. For a
    /// mechanism in orbit, whose chaser a programme moves; thrust is in it then. Terms of the chaser's rate are
    /// left out, 0.2 N in a docking.
    pub fn accelerate_rack(&mut self, chaser: &Twist) {
        let q = self.x_wc.q;
        self.rack = Rack::Accelerates(Twist { v: q * chaser.v, w: q * chaser.w });
    }

    /// By what each latch catches from the next step on; [`Mounted::reset`] leaves them to themselves.
    pub const fn rule_latches(&mut self, rules: [LatchRule; MOST_LATCHES]) {
        self.state.rule_latches(rules);
    }

    /// Draws the rings, where they are joined, by `part` of what is left towards the place in which those of the same
    /// mechanism on another stand are joined: latches hold where they hold, however they came there. Latches with
    /// places of their own are left as they are.
    pub fn draw_joint_to(&mut self, other: &Self, part: f64) {
        let Some(l) = &self.system.mechanism().latches else { return };
        self.state.draw_joint_to(&other.state, part, l.joined_stiffness_n_m / 3.0);
    }

    /// Axial gap of every latch in the middle of the last step, m; 0 before the first.
    #[must_use]
    pub const fn latch_gaps_m(&self) -> &[f64; MOST_LATCHES] {
        &self.latch_gaps_m
    }

    /// The control wrench on the chaser from now on, about its mass centre, in its axes, N and N·m: it
    /// accelerates a chaser that carries its ring along ([`Self::carry_along`]), and nothing else here.
    pub const fn push(&mut self, wrench: Wrench) {
        self.pushed = wrench;
    }

    /// What the ring feels of its chaser's acceleration, about its mass centre.
    fn left_behind(&self) -> Wrench {
        let (Rack::Yields(chaser) | Rack::Accelerates(chaser)) = self.rack else {
            return Wrench::ZERO;
        };
        let mass = &self.system.mass()[RING];
        let arm = self.ring.p - self.x_wc.p;
        Wrench {
            f: (chaser.v + chaser.w.cross(arm)) * -mass.mass(),
            m: -(inertia_world(self.ring.q, mass.inertia()) * chaser.w),
        }
    }

    /// True when nothing touches or holds the plate's side.
    #[must_use]
    pub fn apart(&self, x_bp: &Pose) -> bool {
        let free = self.now(x_bp, &Twist::default()).port4 == Wrench::ZERO;
        free && self.state.captured_s().is_none()
    }

    /// Opens the latches and puts the ring to rest, where weight and springs hold each other.
    pub fn reset(&mut self) {
        self.latch_gaps_m = [0.0; MOST_LATCHES];
        if let Some((state, ring, hanger)) = &self.rest {
            (self.state, self.ring, self.hanger) = (state.clone(), *ring, *hanger);
            self.steps = 0;
            return;
        }
        self.state = MechanismState::default();
        self.steps = 0;
        let x = self.x_wc * self.system.ring_at_rest();
        self.ring = BodyState::new(&self.system.mass()[RING], x, DVec3::ZERO, DVec3::ZERO);
        if self.system.rigid() {
            return;
        }
        // Without weight it stands where it would rest.
        if self.gravity_m_s2 == DVec3::ZERO && self.hanger.is_none() {
            return;
        }
        // Nothing touches far away. Velocity is taken out wherever it has grown: two seconds are
        // longer than any spring of the attenuator needs.
        let far = Pose::from_translation(self.x_wc.p + DVec3::X * 1e3);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "steps")]
        let steps = (SETTLING_S / self.step_s) as u32;
        for _ in 0..steps {
            self.advance(&far, &Twist::default());
            self.ring.v *= 1.0 - SETTLING_DAMPING;
            self.ring.l *= 1.0 - SETTLING_DAMPING;
            if let Some(hanger) = &mut self.hanger {
                hanger.calm(SETTLING_DAMPING);
            }
        }
        self.ring.v = DVec3::ZERO;
        self.ring.l = DVec3::ZERO;
        if let Some(hanger) = &mut self.hanger {
            hanger.calm(1.0);
        }
        self.state.losses = EnergyLosses::default();
        self.steps = 0;
    }

    /// Displacement of the ring from where it would be at rest without weight (m) and its rotation
    /// vector (rad), in `e3`.
    #[must_use]
    pub fn ring_deflection(&self) -> (DVec3, DVec3) {
        let x = (self.x_wc * self.system.ring_at_rest()).inverse() * self.ring_pose();
        (x.p, x.q.to_scaled_axis())
    }

    fn ring_pose(&self) -> Pose {
        if self.system.rigid() { self.x_wc * self.system.ring_at_rest() } else { self.ring.pose() }
    }

    fn bodies(&self, x_bp: &Pose) -> [Pose; 3] {
        [self.x_wc, self.ring_pose(), *x_bp * self.x_pt]
    }

    fn twists(&self, x_bp: &Pose, twist: &Twist, target: DVec3) -> [Twist; 3] {
        let ring = if self.system.rigid() {
            Twist::default()
        } else {
            self.ring.twist(&self.system.mass()[RING])
        };
        let t = Twist { v: twist.v + twist.w.cross(target - x_bp.p), w: twist.w };
        [Twist::default(), ring, t]
    }

    #[expect(clippy::cast_precision_loss, reason = "exact below 2^53 steps")]
    fn time_s(&self) -> f64 {
        self.steps as f64 * self.step_s
    }

    /// One step, the plate being at `x_bp` in its middle with velocity `twist` (of the origin of
    /// `ep`, in `eb`). Returns the wrench on the plate about the origin of `ep`, in `eb`, and both
    /// ports' wrenches in the middle of the step, the ring's weight at rest taken off.
    pub fn advance(&mut self, x_bp: &Pose, twist: &Twist) -> (Wrench, Ports) {
        let (h, rigid) = (self.step_s, self.system.rigid());
        let mass = *self.system.mass();
        if !rigid {
            self.ring.drift(&mass[RING], 0.5 * h);
        }
        let poses = self.bodies(x_bp);
        let com = poses.map(|x| x.p);
        self.system.measure_into(&self.state, &poses, &mut self.room);
        self.latch_gaps_m = self.room.latches.map(|gap| gap.axial_m);
        let start = self.twists(x_bp, twist, com[TARGET]);
        let mut external = [Wrench::ZERO; 3];
        external[RING] = self.left_behind();
        external[RING].f += self.gravity_m_s2 * mass[RING].mass();
        if let Some(hanger) = &mut self.hanger {
            hanger.drift(0.5 * h);
            let moved = self.ring.p - (self.x_wc * self.system.ring_at_rest()).p;
            external[RING].f += hanger.kick(moved, self.ring.v, h);
            hanger.drift(0.5 * h);
        }
        let time_s = self.time_s() + 0.5 * h;
        let ring = self.ring;
        let middle = Midpoint { com, time_s, h };
        let kick =
            self.system.solve_kick(&self.room, &self.state, &start, &external, &middle, |i, w| {
                match i {
                    RING if !rigid => ring.kick_response(&mass[RING], w, h),
                    _ => Twist::default(),
                }
            });
        self.system.commit(&mut self.state, &self.room, &kick, &middle);
        if self.open {
            self.state.open();
        }
        if !rigid {
            self.ring.kick(&mass[RING], kick.wrench[RING], h);
            self.ring.drift(&mass[RING], 0.5 * h);
        }
        if let Rack::Yields(chaser) = &mut self.rack {
            let q = self.x_wc.q;
            let w = kick.wrench[CHASER] + self.pushed.rotated(q);
            let turning = q * (mass[CHASER].inertia().inverse() * (q.conjugate() * w.m));
            *chaser = Twist { v: w.f / mass[CHASER].mass(), w: turning };
        }
        self.steps += 1;
        let on_plate = kick.wrench[TARGET].shifted(x_bp.p - com[TARGET]);
        (on_plate, self.ports(&self.room, &kick.forces))
    }

    /// Both ports' wrenches at the present instant, the plate being at `x_bp` with `twist`.
    #[must_use]
    pub fn now(&self, x_bp: &Pose, twist: &Twist) -> Ports {
        let poses = self.bodies(x_bp);
        let com = poses.map(|x| x.p);
        let measured = self.system.measure(&self.state, &poses);
        let twists = self.twists(x_bp, twist, com[TARGET]);
        let middle = Midpoint { com, time_s: self.time_s(), h: self.step_s };
        let forces = self.system.forces(&measured, &self.state, &twists, &middle);
        self.ports(&measured, &forces)
    }

    fn ports(&self, measured: &Measured, forces: &Forces) -> Ports {
        let frames = measured.poses();
        let about = frames.x_wr.p;
        let on_rack = if self.system.rigid() {
            -forces.on_target
        } else {
            // What no balance carries of the ring's weight reaches the rack through the attenuator; in
            // orbit it is not there.
            let at = self.bodies(&Pose::IDENTITY)[RING].p - about;
            -forces.on_ring_from_attenuator + -Wrench::at(at, self.uncarried_n)
        };
        Ports {
            port3: on_rack.shifted(frames.x_w3.p - about).rotated(frames.x_w3.q.conjugate()),
            port4: forces
                .on_target
                .shifted(frames.x_w4.p - about)
                .rotated(frames.x_w4.q.conjugate()),
        }
    }

    /// Weight of the ring where it is that no balance carries, on the rack at the origin of `e3`, in `e3`.
    #[must_use]
    pub fn ring_weight(&self) -> Wrench {
        if self.system.rigid() {
            return Wrench::ZERO;
        }
        let x_w3 = self.x_wc * self.system.ports()[0];
        Wrench::at(self.ring.p - x_w3.p, self.uncarried_n).rotated(x_w3.q.conjugate())
    }

    /// Adds all bits to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        self.ring.hash_into(h);
        self.state.hash_into(h);
        h.u64(self.steps);
        h.u64(u64::from(self.open));
        let (kind, chaser) = match &self.rack {
            Rack::Still => (0, None),
            Rack::Yields(chaser) => (1, Some(chaser)),
            Rack::Accelerates(chaser) => (2, Some(chaser)),
        };
        if let Some(chaser) = chaser {
            h.u64(kind);
            for v in [self.pushed.f, self.pushed.m] {
                h.vec3(v);
            }
            h.vec3(chaser.v);
            h.vec3(chaser.w);
        }
        if let Some(hanger) = &self.hanger {
            hanger.hash_into(h);
        }
    }

    /// The chaser's mass-centre frame that has `e3` on the rack, in `eb`.
    #[must_use]
    pub const fn chaser(&self) -> Pose {
        self.x_wc
    }
}

/// The balance of a rig under the ring of a system; `None` where either is missing.
fn hanger(system: &System, rig: &Rig) -> Option<Hanger> {
    let ring_kg = system.ring_mass_kg();
    rig.offload.filter(|_| ring_kg > 0.0).and_then(|o| Hanger::new(o, rig.gravity_m_s2, ring_kg))
}

/// Time that the ring is given to find its rest, s.
const SETTLING_S: f64 = 2.0;
/// Part of the ring's momentum taken out in every step meanwhile.
const SETTLING_DAMPING: f64 = 0.02;

#[cfg(test)]
mod tests {
    use core::f64::consts::TAU;
    use std::path::Path;

    use docktwin_model::{Attenuator, Offload, load_mechanism, load_rig, load_spacecraft};

    use super::*;

    const STEP_S: f64 = 1.25e-4;

    /// The mechanism on the default rig with this balance, its axial channel a spring alone, the plate far.
    fn on_springs(offload: Option<Offload>, chaser: &str) -> (Mounted, Pose) {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf");
        let file = |name: &str| folder.join(name);
        let [chaser, target] = [chaser, "target_12t.urdf"]
            .map(|name| load_spacecraft(&file(name)).expect("shipped").model);
        let sides = (file("apas_active.urdf"), file("apas_passive.urdf"));
        let mut mechanism = load_mechanism(&sides.0, &sides.1, None).expect("shipped").model;
        let Attenuator::Characteristic(a) = &mut mechanism.attenuator else { panic!("by tables") };
        a.axial.dry_friction = 0.0;
        a.axial.damping.before_capture = 0.0;
        let mut rig = load_rig(&file("stewart.urdf")).expect("shipped").model;
        rig.offload = offload;
        let far = rig.plate_from_docking(&rig.docking.pose([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
        (Mounted::new(System::new(&chaser, &target, mechanism), &rig, STEP_S), far)
    }

    /// The moving mass of the balance swings with the ring along the docking axis: √(k/(m + m_a)) on a
    /// stiff hanger, on any the lower root of (k + k_h − m w)(k_h − m_a w) = k_h², w = ω².
    #[test]
    fn oracle_the_added_mass_swings_with_the_ring() {
        let (k, m, kh) = (3e5, 39.1, 2e6);
        for added in [0.0, 10.0, 40.0] {
            let (mut mounted, plate) = on_springs(
                Some(Offload {
                    share: 0.5,
                    friction_n: 0.0,
                    added_mass_kg: added,
                    stiffness_n_m: kh,
                    damping_ratio: 0.0,
                }),
                "chaser_8t.urdf",
            );
            let rest = mounted.ring_deflection().0.x;
            let w = if added == 0.0 {
                k / m
            } else {
                let (a, b) = (m * added, added * (k + kh) + m * kh);
                (b - (b * b - 4.0 * a * k * kh).sqrt()) / (2.0 * a)
            };
            // Both in the slow mode alone.
            mounted.ring.v.x = 0.02;
            if let Some(hanger) = &mut mounted.hanger {
                hanger.shove(0.02 * kh / (kh - added * w));
            }
            let x: Vec<f64> = (0..80_000)
                .map(|_| {
                    mounted.advance(&plate, &Twist::default());
                    mounted.ring_deflection().0.x - rest
                })
                .collect();
            let ups: Vec<f64> = x
                .windows(2)
                .enumerate()
                .filter(|(_, w)| w[0] < 0.0 && w[1] >= 0.0)
                .map(|(i, w)| (i as f64 - w[0] / (w[1] - w[0])) * STEP_S)
                .collect();
            let found = (ups.len() - 1) as f64 / (ups[ups.len() - 1] - ups[0]);
            let expected = w.sqrt() / TAU;
            // The leapfrog is faster by (ω h)²/24, below 1e-5.
            assert!((found - expected).abs() < 1e-4 * expected, "{added} kg: {found} {expected}");
        }
    }

    /// On a chaser that gives way the ring swings with the reduced mass: ω² = k (1/m + 1/M), on a rack that stands
    /// still with k/m. With 575 kg that is 3.3 % of the frequency.
    #[test]
    fn oracle_a_rack_that_gives_way_leaves_the_reduced_mass() {
        let (k, m) = (3e5, 39.1);
        for yields in [false, true] {
            let (mut mounted, plate) = on_springs(None, "light_575kg.urdf");
            let chaser = mounted.system().mass()[CHASER].mass();
            if yields {
                mounted.carry_along();
            }
            let rest = mounted.ring_deflection().0.x;
            mounted.ring.v.x = 0.02;
            let x: Vec<f64> = (0..40_000)
                .map(|_| {
                    mounted.advance(&plate, &Twist::default());
                    mounted.ring_deflection().0.x - rest
                })
                .collect();
            let ups: Vec<f64> = x
                .windows(2)
                .enumerate()
                .filter(|(_, w)| w[0] < 0.0 && w[1] >= 0.0)
                .map(|(i, w)| (i as f64 - w[0] / (w[1] - w[0])) * STEP_S)
                .collect();
            let found = (ups.len() - 1) as f64 / (ups[ups.len() - 1] - ups[0]);
            let expected = (k * (1.0 / m + if yields { 1.0 / chaser } else { 0.0 })).sqrt() / TAU;
            // The acceleration is that of the step before; the leapfrog is faster by (ω h)²/24.
            assert!((found / expected - 1.0).abs() < 3e-4, "{yields}: {found} {expected} Hz");
        }
    }
}
