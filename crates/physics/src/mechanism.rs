//! The whole mechanism between the two spacecraft: contact, attenuation, latches, joined rings.

use arrayvec::ArrayVec;
use docktwin_core::{DMat3, DVec3, Pose, StateHasher, Twist, Wrench};
use docktwin_model::{Attenuator, DockingMechanism, LatchAxes, LatchSet, MOST_LATCHES, Spacecraft};

use crate::{
    attenuator::{self, AttenuatorForce, AttenuatorGeometry, AttenuatorState, Deflection},
    body::{MIDPOINT_ITERATIONS, MassProperties},
    contact::{ContactState, Contacts, Scene, SurfacePair},
    limits::Loads,
    stick::StickContact,
};

mod own_latches;

use own_latches::Held;

/// Index of a body in every `[_; 3]` here.
pub const CHASER: usize = 0;
/// The active ring with its petals.
pub const RING: usize = 1;
/// The target with the passive side.
pub const TARGET: usize = 2;

/// Both spacecraft and the mechanism between them: the immutable half of a twin.
#[derive(Clone, Debug)]
pub struct System {
    mechanism: DockingMechanism,
    scene: Scene,
    mass: [MassProperties; 3],
    rigid: bool,
    /// Mass centre of each body to the frame that matters on it: `e3` on the chaser, `r3` on the
    /// ring, `e4` on the target.
    x_bf: [Pose; 3],
    /// Ring's mass-centre frame in the chaser's, when the ring is rigid.
    x_c_ring: Pose,
    x_4r4: Pose,
}

/// World poses of the frames of the mechanism.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Poses {
    /// `e3`.
    pub x_w3: Pose,
    /// `r3`, the active ring.
    pub x_wr: Pose,
    /// `e4`.
    pub x_w4: Pose,
    /// `r4`, the passive ring.
    pub x_wp: Pose,
}

/// How far a latch has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum LatchPhase {
    /// Nothing near.
    #[default]
    Free = 0,
    /// The striker is near.
    Approach = 1,
    /// The striker touches the latch.
    Struck = 2,
    /// Caught.
    Latched = 3,
}

/// By what a latch catches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum LatchRule {
    /// By its own gap and zone.
    #[default]
    Own,
    /// Not at all: that of another mechanism, which it is to be like, has not caught where this one would have.
    Held,
    /// At this axial gap, m, once its striker touches it.
    Within(f64),
    /// At once.
    Caught,
}

/// One latch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LatchState {
    /// How far it has come.
    pub phase: LatchPhase,
    /// Time of each phase, s: approach, strike, latched.
    pub times_s: [Option<f64>; 3],
    /// Since when the striker has been where a latch that catches late will catch it, s.
    pub waiting_since_s: Option<f64>,
}

/// Rings joined at capture.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Joint {
    since_s: f64,
    /// Striker points at capture, in `r3`, m.
    anchor: [DVec3; 3],
    /// Force on the target at capture, in `r3`, N.
    preload: [DVec3; 3],
}

/// Energy account, J, from the start of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyLosses {
    /// Damping of the contact law.
    pub contact: f64,
    /// Friction between the surfaces.
    pub friction: f64,
    /// Brakes, dampers, stops.
    pub attenuator: f64,
    /// Damping of the joined rings.
    pub joint: f64,
    /// Stored energy that vanishes as the rings are joined.
    pub capture: f64,
}

impl EnergyLosses {
    /// Sum, J.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.contact + self.friction + self.attenuator + self.joint + self.capture
    }
}

/// Everything the mechanism remembers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MechanismState {
    contact: ContactState,
    attenuator: AttenuatorState,
    /// The first three latches.
    pub latches: [LatchState; 3],
    /// The others, of a mechanism with more.
    pub further_latches: [LatchState; MOST_LATCHES - 3],
    /// Own latches that hold their strikers, from capture on.
    held: [Option<Held>; MOST_LATCHES],
    /// When enough of the own latches had caught, s.
    held_since_s: Option<f64>,
    joint: Option<Joint>,
    /// Time of capture as the sensors of a mechanism on the rig report it.
    told_s: Option<f64>,
    /// By what each latch catches.
    rules: [LatchRule; MOST_LATCHES],
    /// Latches whose strikers have been where they would catch by themselves.
    reached_catch: [bool; MOST_LATCHES],
    /// Energy lost so far.
    pub losses: EnergyLosses,
}

impl MechanismState {
    /// Time of capture, s.
    #[must_use]
    pub fn captured_s(&self) -> Option<f64> {
        self.joint.map(|j| j.since_s).or(self.held_since_s).or(self.told_s)
    }

    /// Every latch there is room for, in the order of the file.
    pub fn all_latches(&self) -> impl Iterator<Item = &LatchState> {
        self.latches.iter().chain(&self.further_latches)
    }

    fn latch(&self, i: usize) -> &LatchState {
        if i < 3 { &self.latches[i] } else { &self.further_latches[i - 3] }
    }

    fn latch_mut(&mut self, i: usize) -> &mut LatchState {
        if i < 3 { &mut self.latches[i] } else { &mut self.further_latches[i - 3] }
    }

    /// State as the sensors of a mechanism on the rig report it: its latches, and when its rings
    /// were joined. For recording, not for stepping: the forces of the joint are the rig's.
    #[must_use]
    pub fn told(all: [LatchState; MOST_LATCHES], captured_s: Option<f64>) -> Self {
        let latches = core::array::from_fn(|i| all[i]);
        let further_latches = core::array::from_fn(|i| all[i + 3]);
        Self { latches, further_latches, told_s: captured_s, ..Self::default() }
    }

    /// Sets by what each latch catches from now on.
    pub(crate) const fn rule_latches(&mut self, rules: [LatchRule; MOST_LATCHES]) {
        self.rules = rules;
    }

    /// Draws the rest of joined rings by `part` towards that of another state of the mechanism: `k` is the stiffness
    /// at each striker, N/m. Nothing where either is not joined.
    pub(crate) fn draw_joint_to(&mut self, other: &Self, part: f64, k: f64) {
        let (Some(joint), Some(other)) = (&mut self.joint, &other.joint) else { return };
        let rest = |j: &Joint, i: usize| j.anchor[i] + j.preload[i] / k;
        for i in 0..3 {
            joint.anchor[i] += (rest(other, i) - rest(joint, i)) * part;
        }
    }

    /// Which latches have, or would have, caught by themselves.
    #[must_use]
    pub const fn reached_catch(&self) -> &[bool; MOST_LATCHES] {
        &self.reached_catch
    }

    /// How far latch `i` has come that would by itself have come as far as `own`, its striker at `gap`.
    fn ruled(&mut self, i: usize, own: LatchPhase, gap: &LatchGap) -> LatchPhase {
        self.reached_catch[i] |= own == LatchPhase::Latched;
        let catches = match self.rules[i] {
            LatchRule::Own => return own,
            LatchRule::Held => false,
            LatchRule::Within(gap_m) => own >= LatchPhase::Struck && gap.axial_m <= gap_m,
            LatchRule::Caught => true,
        };
        if catches { LatchPhase::Latched } else { own.min(LatchPhase::Struck) }
    }

    /// Opens the latches and parts the rings.
    pub fn open(&mut self) {
        self.latches = Default::default();
        self.further_latches = Default::default();
        self.held = Default::default();
        self.held_since_s = None;
        self.joint = None;
    }

    /// Slip of the longitudinal brake, m.
    #[must_use]
    pub const fn brake_slip_m(&self) -> f64 {
        self.attenuator.axial_slip_m()
    }

    /// Adds all bits to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        self.contact.hash_into(h);
        self.attenuator.hash_into(h);
        for l in &self.latches {
            h.u64(l.phase as u64);
            l.times_s.iter().for_each(|t| h.f64(t.unwrap_or(-1.0)));
            // Only latches that catch late wait: the others have the digest that they always had.
            l.waiting_since_s.iter().for_each(|t| h.f64(*t));
        }
        match &self.joint {
            None => h.u64(0),
            Some(j) => {
                h.u64(1);
                h.f64(j.since_s);
                j.anchor.iter().chain(&j.preload).for_each(|v| h.vec3(*v));
            }
        }
        let further = self.further_latches.iter().enumerate();
        for (i, l) in further.filter(|(_, l)| **l != LatchState::default()) {
            h.u64(i as u64);
            h.u64(l.phase as u64);
            l.times_s.iter().for_each(|t| h.f64(t.unwrap_or(-1.0)));
        }
        if let Some(since_s) = self.held_since_s {
            h.f64(since_s);
            for (i, held) in self.held.iter().enumerate() {
                let Some(held) = held else { continue };
                h.u64(i as u64);
                held.hash_into(h);
            }
        }
        for (i, rule) in self.rules.iter().enumerate() {
            let (kind, gap_m) = match rule {
                LatchRule::Own => continue,
                LatchRule::Held => (1, 0.0),
                LatchRule::Within(gap_m) => (2, *gap_m),
                LatchRule::Caught => (3, 0.0),
            };
            h.u64(i as u64);
            h.u64(kind);
            h.f64(gap_m);
        }
        let e = &self.losses;
        [e.contact, e.friction, e.attenuator, e.joint, e.capture].iter().for_each(|x| h.f64(*x));
    }
}

/// Position of a striker against its latch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LatchGap {
    /// Along X of the latches' axes ([`docktwin_model::LatchAxes`]), m; zero when the ring faces meet.
    pub axial_m: f64,
    /// Radially, m.
    pub radial_m: f64,
    /// Tangentially, m.
    pub tangential_m: f64,
    /// Angle between X of `r3` and X of `e4`, rad; of own latches.
    pub angle_rad: f64,
    /// Striker in `r3`, m.
    striker_r: DVec3,
    /// Where a caught latch pulls, in `r3`, m: at the striker where axes are those of the active ring, at the
    /// latch where they are those of the passive one. Only so is the pull the gradient of its energy.
    pull_at_r: DVec3,
    /// X of the latches' axes, in `r3`.
    axis_r: DVec3,
}

/// Everything that depends on positions only.
#[derive(Clone, Debug)]
pub struct Measured {
    poses: Poses,
    contacts: Contacts,
    stick: Option<StickContact>,
    attenuator: AttenuatorGeometry,
    /// The gaps of all latches; own latches have their distance across X as the radial one.
    pub latches: [LatchGap; MOST_LATCHES],
}

impl Measured {
    /// Places of contact.
    #[must_use]
    pub const fn contacts(&self) -> &Contacts {
        &self.contacts
    }

    /// The stick, where the mechanism is one.
    #[must_use]
    pub const fn stick(&self) -> Option<&StickContact> {
        self.stick.as_ref()
    }

    /// True when the sides touch.
    #[must_use]
    pub fn touching(&self) -> bool {
        self.contacts.touching() || self.stick.is_some_and(|s| s.touching())
    }

    /// The deepest contact, m.
    #[must_use]
    pub fn deepest_m(&self) -> f64 {
        self.contacts.deepest_m().max(self.stick.map_or(0.0, |s| s.depth_m))
    }

    /// Deflection of the ring.
    #[must_use]
    pub const fn deflection(&self) -> Deflection {
        self.attenuator.deflection()
    }

    /// Frames.
    #[must_use]
    pub const fn poses(&self) -> &Poses {
        &self.poses
    }
}

/// Wrenches inside the mechanism for given velocities, about the ring centre, world axes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Forces {
    /// What the active ring does to the target: contact, latches, joint.
    pub on_target: Wrench,
    /// What the attenuator does to the ring; the chaser gets the opposite.
    pub on_ring_from_attenuator: Wrench,
    /// Sum of the contact forces alone, on the target, N.
    pub contact_on_target: DVec3,
    contact_w: f64,
    friction_w: f64,
    joint_w: f64,
    attenuator: AttenuatorForce,
}

/// Middle of a step, at which its forces are evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Midpoint {
    /// Mass centres of chaser, ring and target, m, world frame.
    pub com: [DVec3; 3],
    /// Time, s.
    pub time_s: f64,
    /// Length of the step, s.
    pub h: f64,
}

/// Result of the midpoint solution of one kick.
#[derive(Clone, Copy, Debug)]
pub struct Kick {
    /// Wrench on each body about its own mass centre, world axes, external ones included.
    pub wrench: [Wrench; 3],
    /// Midpoint twists (velocity of the mass centre, angular velocity; world axes).
    pub mid: [Twist; 3],
    /// Forces inside the mechanism.
    pub forces: Forces,
}

impl System {
    /// Puts checked models together.
    #[must_use]
    pub fn new(chaser: &Spacecraft, target: &Spacecraft, mechanism: DockingMechanism) -> Self {
        let ring =
            MassProperties::new(mechanism.ring_body.mass_kg, mechanism.ring_body.inertia_kg_m2);
        let mut c = MassProperties::new(chaser.mass_kg, chaser.inertia_kg_m2);
        let t = MassProperties::new(target.mass_kg, target.inertia_kg_m2);
        let ring_com = mechanism.ring_body.com_m;
        let mut x_13 = chaser.x_body_port;
        let rest = Pose::from_translation(DVec3::X * mechanism.ring_rest_offset_m);
        let mut x_c_ring = x_13 * rest * Pose::from_translation(ring_com);
        let rigid = mechanism.attenuator == Attenuator::Rigid;
        if rigid {
            // One body of chaser and ring, its frame moved to the joint mass centre.
            let (joined, com) = c.joined(&ring, x_c_ring);
            c = joined;
            x_13.p -= com;
            x_c_ring.p -= com;
        }
        let turn = docktwin_core::DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0);
        Self {
            scene: Scene::new(&mechanism),
            mass: [c, ring, t],
            rigid,
            x_bf: [x_13, Pose::from_translation(-ring_com), target.x_body_port],
            x_c_ring,
            x_4r4: Pose::new(DVec3::X * -mechanism.passive_ring_offset_m, turn),
            mechanism,
        }
    }

    /// The mechanism's model.
    #[must_use]
    pub const fn mechanism(&self) -> &DockingMechanism {
        &self.mechanism
    }

    /// The contact surfaces.
    #[must_use]
    pub const fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Mass properties. With a rigid ring the chaser's include it and the ring's are not used.
    #[must_use]
    pub const fn mass(&self) -> &[MassProperties; 3] {
        &self.mass
    }

    /// Whether the ring is part of the chaser.
    #[must_use]
    pub const fn rigid(&self) -> bool {
        self.rigid
    }

    /// Mass of the moving ring, kg; 0 where it is part of the chaser.
    #[must_use]
    pub fn ring_mass_kg(&self) -> f64 {
        if self.rigid { 0.0 } else { self.mass()[RING].mass() }
    }

    /// Pose of the ring's mass-centre frame for a rigid ring.
    #[must_use]
    pub fn rigid_ring_pose(&self, x_wc: Pose) -> Pose {
        x_wc * self.x_c_ring
    }

    /// Pose of the ring's mass-centre frame in the chaser's at rest.
    #[must_use]
    pub const fn ring_at_rest(&self) -> Pose {
        self.x_c_ring
    }

    /// Pose of `e3` in the chaser's and of `e4` in the target's mass-centre frame.
    #[must_use]
    pub const fn ports(&self) -> [Pose; 2] {
        [self.x_bf[CHASER], self.x_bf[TARGET]]
    }

    /// Pose of the passive ring frame `r4` in `e4`.
    #[must_use]
    pub const fn passive_ring(&self) -> Pose {
        self.x_4r4
    }

    /// Frames of the mechanism from the poses of the mass-centre frames.
    #[must_use]
    pub fn poses(&self, bodies: &[Pose; 3]) -> Poses {
        let x_w4 = bodies[TARGET] * self.x_bf[TARGET];
        Poses {
            x_w3: bodies[CHASER] * self.x_bf[CHASER],
            x_wr: bodies[RING] * self.x_bf[RING],
            x_w4,
            x_wp: x_w4 * self.x_4r4,
        }
    }

    fn stick(&self, poses: &Poses) -> Option<StickContact> {
        let stick = self.mechanism.stick.as_ref()?;
        let x_34 = poses.x_w3.inverse() * poses.x_w4;
        Some(StickContact::measure(stick, self.mechanism.docked_length_m(), &x_34))
    }

    /// True when the sides touch, without a memory of earlier contact.
    #[must_use]
    pub fn touches(&self, poses: &Poses) -> bool {
        self.stick(poses).map_or_else(
            || self.scene.touches(poses.x_wr.inverse() * poses.x_wp),
            |stick| stick.touching(),
        )
    }

    /// True when the sides touch with `e4` at `x_34` in `e3` and the ring at its rest.
    #[must_use]
    pub fn touches_at(&self, x_34: &Pose) -> bool {
        let target = self.x_bf[CHASER] * *x_34 * self.x_bf[TARGET].inverse();
        self.touches(&self.poses(&[Pose::IDENTITY, self.x_c_ring, target]))
    }

    /// Measures contacts, deflection and latch gaps.
    #[must_use]
    pub fn measure(&self, state: &MechanismState, bodies: &[Pose; 3]) -> Measured {
        let mut out = self.room();
        self.measure_into(state, bodies, &mut out);
        out
    }

    /// Room for [`Self::measure_into`]; what it holds says nothing yet.
    #[must_use]
    pub fn room(&self) -> Measured {
        let poses = self.poses(&[Pose::IDENTITY; 3]);
        Measured {
            contacts: Contacts::new(self.scene.law(), poses.x_wr, Pose::IDENTITY),
            stick: None,
            attenuator: AttenuatorGeometry::new(Pose::IDENTITY, self.mechanism.ring_rest_offset_m),
            latches: [LatchGap::default(); MOST_LATCHES],
            poses,
        }
    }

    /// As [`Self::measure`], into `out`, whatever it held: some ten kilobytes that a step need not move.
    pub fn measure_into(&self, state: &MechanismState, bodies: &[Pose; 3], out: &mut Measured) {
        let poses = self.poses(bodies);
        let x_rp = poses.x_wr.inverse() * poses.x_wp;
        out.stick = self.stick(&poses);
        out.latches = self.all_latch_gaps(x_rp);
        out.contacts.begin(self.scene.law(), poses.x_wr, x_rp);
        out.attenuator = AttenuatorGeometry::new(
            poses.x_w3.inverse() * poses.x_wr,
            self.mechanism.ring_rest_offset_m,
        );
        out.poses = poses;
        // With a joint that carries the rings, or a stick that carries everything, nothing else does.
        if state.joint.is_none() && out.stick.is_none() {
            self.scene.measure_into(&state.contact, &mut out.contacts);
        }
    }

    fn all_latch_gaps(&self, x_rp: Pose) -> [LatchGap; MOST_LATCHES] {
        let mut out = [LatchGap::default(); MOST_LATCHES];
        if let Some(l) = &self.mechanism.latches {
            out[..3].copy_from_slice(&self.latch_gaps(l, x_rp));
        }
        for (gap, latch) in out.iter_mut().zip(&self.mechanism.own_latches) {
            *gap = own_latches::gap(latch, x_rp);
        }
        out
    }

    /// Gaps of the latches of a mechanism whose ring stands at its rest moved by `ring`: displacement (m)
    /// and rotation vector (rad) of its mass-centre frame, in `e3`. `None` without latches.
    #[must_use]
    pub fn latch_gaps_at(&self, x_34: &Pose, ring: [DVec3; 2]) -> Option<[LatchGap; 3]> {
        let moved = Pose::new(ring[0], docktwin_core::DQuat::from_scaled_axis(ring[1]));
        let target = self.x_bf[CHASER] * *x_34 * self.x_bf[TARGET].inverse();
        let poses = self.poses(&[Pose::IDENTITY, self.x_c_ring * moved, target]);
        let x_rp = poses.x_wr.inverse() * poses.x_wp;
        self.mechanism.latches.as_ref().map(|l| self.latch_gaps(l, x_rp))
    }

    fn latch_gaps(&self, l: &LatchSet, x_rp: Pose) -> [LatchGap; 3] {
        let (a, p) = (&self.mechanism.active.ring, &self.mechanism.passive.ring);
        core::array::from_fn(|i| {
            let (s, c) = l.azimuths_rad[i].sin_cos();
            let (radial, tangential) = (DVec3::new(0.0, c, s), DVec3::new(0.0, -s, c));
            let latch = DVec3::X * a.section_radius_m + radial * a.mean_radius_m;
            // The same point in r4 when docked: r4 is r3 turned by 180° about Z.
            let striker_p = DVec3::new(p.section_radius_m, -latch.y, latch.z);
            let striker_r = x_rp.transform_point(striker_p);
            let off = self.mechanism.offsets.latches_m[i];
            let off = DVec3::X * off.x + radial * off.y + tangential * off.z;
            let apart = striker_r - latch - off;
            let (g, pull_at_r, axis_r) = match l.axes {
                LatchAxes::Active => (apart, striker_r, DVec3::X),
                LatchAxes::Passive => {
                    // From r4 to the axes that it has in r3 when docked.
                    let turned = |v: DVec3| DVec3::new(-v.x, -v.y, v.z);
                    (turned(x_rp.q.conjugate() * apart), latch, x_rp.q * DVec3::NEG_X)
                }
            };
            LatchGap {
                axial_m: g.x,
                radial_m: g.dot(radial),
                tangential_m: g.dot(tangential),
                angle_rad: 0.0,
                striker_r,
                pull_at_r,
                axis_r,
            }
        })
    }

    /// Forces for given twists of the three bodies (mass-centre velocity, angular velocity).
    #[must_use]
    pub fn forces(
        &self,
        m: &Measured,
        state: &MechanismState,
        twist: &[Twist; 3],
        middle: &Midpoint,
    ) -> Forces {
        let Midpoint { com, time_s, h } = *middle;
        let about = m.poses.x_wr.p;
        let at =
            |i: usize| Twist { v: twist[i].v + twist[i].w.cross(about - com[i]), w: twist[i].w };
        let (c, r, t) = (at(CHASER), at(RING), at(TARGET));
        let mut out = Forces::default();
        match &state.joint {
            Some(j) => self.joint(j, m, r, t, &mut out),
            None => {
                let (w, e) = m.contacts.wrench(about, r, t, h);
                out.on_target = w;
                out.contact_on_target = w.f;
                out.contact_w = e.damping_w;
                out.friction_w = e.friction_w;
                if let Some(stick) = &m.stick {
                    let force = m.poses.x_w3.q * stick.force_n;
                    out.on_target.push(m.poses.x_w4.p - about, force);
                    out.on_target.m += m.poses.x_w3.q * stick.couple_nm;
                    out.contact_on_target += force;
                }
                if let Some(l) = &self.mechanism.latches {
                    for (gap, latch) in m.latches.iter().zip(&state.latches) {
                        if latch.phase == LatchPhase::Latched {
                            let axis = m.poses.x_wr.q * gap.axis_r;
                            let arm = m.poses.x_wr.q * gap.pull_at_r;
                            out.on_target.push(arm, axis * hold_n(l, gap));
                        }
                    }
                }
                self.own_latch_forces(m, state, [r, t], &mut out);
            }
        }
        if !self.rigid {
            let q = m.poses.x_w3.q;
            let back = q.conjugate();
            let rel = Twist { v: back * (r.v - c.v), w: back * (r.w - c.w) };
            let phase = self.damping_phase(state, time_s);
            out.attenuator = attenuator::force(
                &self.mechanism.attenuator,
                &m.attenuator,
                &state.attenuator,
                rel,
                phase,
                h,
            );
            out.on_ring_from_attenuator = out.attenuator.on_ring.rotated(q);
        }
        out
    }

    fn damping_phase(&self, state: &MechanismState, time_s: f64) -> f64 {
        let ramp = match &self.mechanism.attenuator {
            Attenuator::Rigid => return 0.0,
            Attenuator::Characteristic(a) => a.damping_ramp_s,
            Attenuator::Differential(a) => a.damping_ramp_s,
        };
        let since_s = state.joint.map(|j| j.since_s).or(state.held_since_s);
        since_s.map_or(0.0, |since_s| ((time_s - since_s) / ramp.max(1e-9)).clamp(0.0, 1.0))
    }

    fn joint(&self, j: &Joint, m: &Measured, r: Twist, t: Twist, out: &mut Forces) {
        let Some(l) = &self.mechanism.latches else { return };
        let q = m.poses.x_wr.q;
        for i in 0..3 {
            let arm = q * m.latches[i].striker_r;
            let rate = striker_rate(m, m.latches[i].striker_r, r, t);
            out.on_target.push(arm, joined_force(l, j, m, i, rate));
            out.joint_w += l.joined_damping_n_s_m * rate.length_squared();
        }
    }

    /// Force that each latch puts on the target, in `r3`, N: a caught latch pulls along
    /// −X of its axes, joined rings also push and hold sideways; zero for a free one. Arguments as for
    /// [`System::forces`], of whose `on_target` this is a part.
    #[must_use]
    pub fn latch_forces(
        &self,
        m: &Measured,
        state: &MechanismState,
        com: &[DVec3; 3],
        twist: &[Twist; 3],
    ) -> ArrayVec<DVec3, MOST_LATCHES> {
        let about = m.poses.x_wr.p;
        let at =
            |i: usize| Twist { v: twist[i].v + twist[i].w.cross(about - com[i]), w: twist[i].w };
        let Some(l) = &self.mechanism.latches else {
            return self.own_latch_forces_r(m, state, at(RING), at(TARGET));
        };
        let of = |i: usize| match &state.joint {
            Some(j) => {
                let rate = striker_rate(m, m.latches[i].striker_r, at(RING), at(TARGET));
                m.poses.x_wr.q.conjugate() * joined_force(l, j, m, i, rate)
            }
            None if state.latches[i].phase == LatchPhase::Latched => {
                m.latches[i].axis_r * hold_n(l, &m.latches[i])
            }
            None => DVec3::ZERO,
        };
        (0..3).map(of).collect()
    }

    /// Stored energy at the measured positions, J.
    #[must_use]
    pub fn stored_energy(&self, m: &Measured, state: &MechanismState) -> f64 {
        self.interface_energy(m, state)
            + attenuator::stored_energy(
                &self.mechanism.attenuator,
                &m.attenuator,
                &state.attenuator,
            )
    }

    fn interface_energy(&self, m: &Measured, state: &MechanismState) -> f64 {
        let touching = m.contacts.stored_j() + m.stick.map_or(0.0, |s| s.stored_j);
        let Some(l) = &self.mechanism.latches else {
            return touching + self.own_latch_energy(m, state);
        };
        if let Some(j) = &state.joint {
            let k = l.joined_stiffness_n_m / 3.0;
            return (0..3)
                .map(|i| {
                    let e = m.latches[i].striker_r - j.anchor[i] - j.preload[i] / k;
                    0.5 * k * e.length_squared()
                })
                .sum();
        }
        let latches: f64 = m
            .latches
            .iter()
            .zip(&state.latches)
            .filter(|(_, s)| s.phase == LatchPhase::Latched)
            .map(|(g, _)| {
                let over = (g.axial_m - l.catch_gap_m).max(0.0);
                0.5 * l.hold_stiffness_n_m * over * over
            })
            .sum();
        touching + latches
    }

    /// Solves the implicit midpoint of one kick at frozen positions. `start` are the twists before it,
    /// `external` wrenches about each mass centre; `response(i, w)` is the twist that wrench `w` gives
    /// body `i` over the step. With a rigid ring its twist follows the chaser's and its wrench is added
    /// there.
    #[expect(clippy::too_many_arguments, reason = "one call per engine")]
    pub fn solve_kick(
        &self,
        m: &Measured,
        state: &MechanismState,
        start: &[Twist; 3],
        external: &[Wrench; 3],
        middle: &Midpoint,
        response: impl Fn(usize, Wrench) -> Twist,
    ) -> Kick {
        let com = &middle.com;
        let mut mid = *start;
        let mut wrench = [Wrench::ZERO; 3];
        let mut forces = Forces::default();
        for _ in 0..MIDPOINT_ITERATIONS {
            if self.rigid {
                mid[RING] = Twist {
                    v: mid[CHASER].v + mid[CHASER].w.cross(com[RING] - com[CHASER]),
                    w: mid[CHASER].w,
                };
            }
            forces = self.forces(m, state, &mid, middle);
            let about = m.poses.x_wr.p;
            let to = |i: usize, w: Wrench| w.shifted(com[i] - about);
            let ring = forces.on_ring_from_attenuator + -forces.on_target;
            wrench = *external;
            wrench[TARGET] += to(TARGET, forces.on_target);
            if self.rigid {
                wrench[CHASER] += to(CHASER, ring);
            } else {
                wrench[RING] += to(RING, ring);
                wrench[CHASER] += to(CHASER, -forces.on_ring_from_attenuator);
            }
            for (i, mid) in mid.iter_mut().enumerate() {
                if self.rigid && i == RING {
                    continue;
                }
                let d = response(i, wrench[i]);
                *mid = Twist { v: start[i].v + d.v * 0.5, w: start[i].w + d.w * 0.5 };
            }
        }
        Kick { wrench, mid, forces }
    }

    /// Carries the memory over the kick: bristles, brakes, latches, capture, losses.
    pub fn commit(&self, state: &mut MechanismState, m: &Measured, kick: &Kick, middle: &Midpoint) {
        let Midpoint { com, time_s, h } = *middle;
        let f = &kick.forces;
        state.losses.contact += f.contact_w * h;
        state.losses.friction += f.friction_w * h;
        state.losses.joint += f.joint_w * h;
        state.losses.attenuator += f.attenuator.lost_w * h;
        state.attenuator = f.attenuator.next;
        if state.joint.is_some() {
            return;
        }
        let about = m.poses.x_wr.p;
        let at = |i: usize| Twist {
            v: kick.mid[i].v + kick.mid[i].w.cross(about - com[i]),
            w: kick.mid[i].w,
        };
        m.contacts.commit(&mut state.contact, about, at(RING), at(TARGET), h);
        let Some(l) = &self.mechanism.latches else {
            self.advance_own_latches(state, m, [at(RING), at(TARGET)], middle);
            return;
        };
        for (i, gap) in m.latches.iter().enumerate().take(state.latches.len()) {
            let reached = latch_reached(l, gap, &mut state.latches[i], time_s);
            let reached = state.ruled(i, reached, gap);
            reach(&mut state.latches[i], reached, time_s);
        }
        if state.latches.iter().all(|l| l.phase == LatchPhase::Latched) {
            let before = self.interface_energy(m, state);
            let (r, t) = (at(RING), at(TARGET));
            let joint = join(m, l, f.on_target, r, t, time_s);
            // The kick of this step still carries the old forces into its second half, over which
            // the stored energy is already the joint's.
            let w = f.on_target;
            let old_w = w.f.dot(t.v - r.v) + w.m.dot(t.w - r.w) + f.contact_w + f.friction_w;
            let back = m.poses.x_wr.q.conjugate();
            let new_w: f64 = joint
                .anchor
                .iter()
                .zip(&joint.preload)
                .map(|(s, p)| p.dot(back * striker_rate(m, *s, r, t)))
                .sum();
            state.joint = Some(joint);
            state.losses.capture +=
                before - self.interface_energy(m, state) + (new_w - old_w) * 0.5 * h;
            state.contact = ContactState::default();
        }
    }
}

/// Name of a pair of surfaces of a mechanism, see [`SurfacePair::from_index`].
#[must_use]
pub fn pair_name(mechanism: &DockingMechanism, pair: usize) -> String {
    if mechanism.stick.is_some() && pair == 0 {
        return "stick · frame".to_owned();
    }
    match SurfacePair::from_index(pair) {
        SurfacePair::Listed(i) => {
            let pairs = mechanism.surface_pairs();
            pairs.get(i).map_or_else(String::new, DockingMechanism::surface_pair_name)
        }
        pair => pair.to_string(),
    }
}

/// Names of all pairs of surfaces that a mechanism has numbers for, by their index.
#[must_use]
pub fn pair_names(mechanism: &DockingMechanism) -> Vec<String> {
    let listed = mechanism.surface_pairs();
    let own = (0..crate::contact::RING_AND_PETAL_PAIRS).map(|i| pair_name(mechanism, i));
    own.chain(listed.iter().map(DockingMechanism::surface_pair_name)).collect()
}

/// How many pairs of surfaces a mechanism has numbers for.
#[must_use]
pub fn pair_count(mechanism: &DockingMechanism) -> usize {
    crate::contact::RING_AND_PETAL_PAIRS + mechanism.surface_pairs().len()
}

/// How far a latch has come by its gap.
fn latch_reached(l: &LatchSet, gap: &LatchGap, latch: &mut LatchState, time_s: f64) -> LatchPhase {
    let near = |axial: f64, widen: f64| {
        gap.axial_m <= axial
            && gap.radial_m.abs() <= l.radial_zone_m * widen
            && gap.tangential_m.abs() <= l.tangential_zone_m * widen
    };
    let there = near(l.catch_gap_m, 1.0);
    if !there {
        latch.waiting_since_s = None;
    }
    let catches = there && waited(l, latch, time_s);
    phase_by_gaps(catches, [l.strike_gap_m, l.approach_gap_m], near)
}

/// The phase of a latch that `catches` or not, with the axial gaps below which it is struck and approached, m;
/// `near(axial, widen)` is whether it is within a gap, and within its zone so many times as wide.
fn phase_by_gaps(
    catches: bool,
    [strike_m, approach_m]: [f64; 2],
    near: impl Fn(f64, f64) -> bool,
) -> LatchPhase {
    if catches {
        LatchPhase::Latched
    } else if near(strike_m, 1.0) {
        LatchPhase::Struck
    } else if near(approach_m, 4.0) {
        LatchPhase::Approach
    } else {
        LatchPhase::Free
    }
}

/// A latch comes as far as `reached`.
fn reach(latch: &mut LatchState, reached: LatchPhase, time_s: f64) {
    for (i, phase) in
        [LatchPhase::Approach, LatchPhase::Struck, LatchPhase::Latched].into_iter().enumerate()
    {
        if reached >= phase && latch.times_s[i].is_none() {
            latch.times_s[i] = Some(time_s);
        }
    }
    // A caught latch holds; the others follow the striker.
    if latch.phase != LatchPhase::Latched {
        latch.phase = reached;
    }
}

/// Whether a latch whose striker is where it catches has waited for its delay.
fn waited(l: &LatchSet, latch: &mut LatchState, time_s: f64) -> bool {
    l.catch_delay_s <= 0.0
        || time_s - *latch.waiting_since_s.get_or_insert(time_s) >= l.catch_delay_s
}

/// Pull of a caught latch along X of its axes, N, ≤ 0.
fn hold_n(l: &LatchSet, gap: &LatchGap) -> f64 {
    let over = (gap.axial_m - l.catch_gap_m).max(0.0);
    -l.hold_stiffness_n_m * over
}

/// Force of latch `i` of joined rings on the target, world axes, N; `rate` is that of its striker.
fn joined_force(l: &LatchSet, j: &Joint, m: &Measured, i: usize, rate: DVec3) -> DVec3 {
    let k = l.joined_stiffness_n_m / 3.0;
    let stretch = m.latches[i].striker_r - j.anchor[i];
    m.poses.x_wr.q * (j.preload[i] - stretch * k) - rate * l.joined_damping_n_s_m
}

/// Velocity of the target's material at a striker (m, `r3`) against the ring's, world axes, m/s; `r`
/// and `t` are their motions at the ring centre.
fn striker_rate(m: &Measured, striker_r: DVec3, r: Twist, t: Twist) -> DVec3 {
    let arm = m.poses.x_wr.q * striker_r;
    t.v + t.w.cross(arm) - r.v - r.w.cross(arm)
}

/// Three point springs that start at the wrench of the instant: the smallest forces at the strikers
/// that add up to it.
fn join(m: &Measured, l: &LatchSet, on_target: Wrench, r: Twist, t: Twist, time_s: f64) -> Joint {
    let back = m.poses.x_wr.q.conjugate();
    let w = on_target.rotated(back);
    let anchor: [DVec3; 3] = core::array::from_fn(|i| m.latches[i].striker_r);
    let centre = (anchor[0] + anchor[1] + anchor[2]) / 3.0;
    let about_centre = w.shifted(centre);
    let arms = anchor.map(|a| a - centre);
    // fᵢ = F/3 + λ × rᵢ, with Σ rᵢ × (λ × rᵢ) = M.
    let mut a = DMat3::ZERO;
    for r in arms {
        let s = docktwin_core::skew(r);
        a -= s * s;
    }
    let lambda = a.inverse() * about_centre.m;
    // The dampers of the joint act from the start: their share is taken off beforehand.
    let damper = |s: DVec3| back * striker_rate(m, s, r, t) * l.joined_damping_n_s_m;
    let preload = core::array::from_fn(|i| w.f / 3.0 + lambda.cross(arms[i]) + damper(anchor[i]));
    Joint { since_s: time_s, anchor, preload }
}

impl System {
    /// `e4` in a frame at the passive ring's centre with the axes of `e4`.
    pub(crate) fn passive_ring_inverse(&self) -> Pose {
        Pose::from_translation(-self.x_4r4.p)
    }
}

impl System {
    /// What limits are judged by, of forces evaluated at `m`.
    #[must_use]
    pub fn loads(&self, m: &Measured, forces: &Forces) -> Loads {
        let x = m.poses();
        let about = x.x_wp.p - x.x_wr.p;
        Loads {
            interface: forces.on_target.shifted(about).rotated(x.x_w4.q.conjugate()),
            depth_m: m.deepest_m(),
            overtravel_m: self.overtravel_m(m),
        }
    }

    /// How far the attenuator is pushed beyond its travel, m; rotations count at the ring radius.
    #[must_use]
    pub fn overtravel_m(&self, m: &Measured) -> f64 {
        attenuator::overtravel(
            &self.mechanism.attenuator,
            &m.attenuator,
            self.mechanism.active.ring.mean_radius_m,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(catch_delay_s: f64) -> LatchSet {
        LatchSet {
            axes: LatchAxes::Active,
            azimuths_rad: [0.0, 2.0, 4.0],
            approach_gap_m: 0.05,
            strike_gap_m: 0.006,
            catch_gap_m: 0.003,
            catch_delay_s,
            radial_zone_m: 0.01,
            tangential_zone_m: 0.06,
            hold_stiffness_n_m: 1e6,
            joined_stiffness_n_m: 1e6,
            joined_damping_n_s_m: 1500.0,
        }
    }

    /// Phases of a latch whose striker is at `axial_m(t)`, a step of 0.1 ms each.
    fn followed(l: &LatchSet, axial_m: impl Fn(f64) -> f64, steps: u32) -> LatchState {
        let mut latch = LatchState::default();
        for i in 0..steps {
            let t = f64::from(i) * 1e-4;
            let gap = LatchGap { axial_m: axial_m(t), ..LatchGap::default() };
            let reached = latch_reached(l, &gap, &mut latch, t);
            reach(&mut latch, reached, t);
        }
        latch
    }

    /// A striker that comes at v is within the gap from t = (x₀ − gap)/v on, and is caught the delay later.
    #[test]
    fn oracle_a_late_latch_catches_its_delay_later() {
        let comes = |t: f64| (0.02 - 0.1 * t).max(0.0);
        for delay in [0.0, 0.02, 0.05] {
            let latch = followed(&set(delay), comes, 4000);
            let caught = latch.times_s[2].expect("it stays");
            let expected = (0.02 - 0.003) / 0.1 + delay;
            assert!((-1e-9..1.1e-4).contains(&(caught - expected)), "{delay}: {caught} {expected}");
            // It is struck without delay.
            assert!((latch.times_s[1].expect("struck") - 0.14).abs() < 2e-4);
        }
    }

    /// One that leaves before is not caught, and the next time begins anew.
    #[test]
    fn oracle_a_late_latch_lets_a_short_visit_pass() {
        // Within the gap from 0.1 to 0.115 s and again from 0.2 s on.
        let visits = |t: f64| if (0.1..0.115).contains(&t) || t >= 0.2 { 0.001 } else { 0.01 };
        let latch = followed(&set(0.02), visits, 2100);
        assert_eq!(latch.times_s[2], None);
        assert_ne!(latch.phase, LatchPhase::Latched);
        let caught = followed(&set(0.02), visits, 3000).times_s[2].expect("the second time");
        assert!((caught - 0.22).abs() < 1.1e-4, "{caught}");
        // At once it would have been caught at the first.
        let at_once = followed(&set(0.0), visits, 3000).times_s[2].expect("at once");
        assert!((at_once - 0.1).abs() < 1.1e-4, "{at_once}");
    }
}
