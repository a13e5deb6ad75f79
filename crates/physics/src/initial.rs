//! From the relative state at the plane of first contact back to the start of a scenario (§1).

use docktwin_core::{DQuat, DVec3, Euler, Pose, Twist};

use crate::{
    body::{BodyState, MassProperties},
    mechanism::{CHASER, RING, System, TARGET},
};

/// Relative state at the plane of first contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactConditions {
    /// Euler angles of `R_34`.
    pub attitude: Euler,
    /// Offset of the target's ring centre from the chaser's across the docking axis, in `e3`, m;
    /// x is not used.
    pub lateral_m: DVec3,
    /// Velocity of the target's ring centre against the chaser's, in `e3`, m/s; closing is x < 0.
    pub velocity_m_s: DVec3,
    /// Rate of the target against the chaser, in `e4`, rad/s.
    pub rate_rad_s: DVec3,
    /// Which of both turns at it.
    pub turning: Turning,
}

/// Which body has the relative rate before contact. At the plane of first contact the motion of `e4` seen
/// from `e3` is the same; free flight to it, and what follows, are not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Turning {
    /// All of it is the target's; the chaser does not turn, and its ring rests in its attenuator.
    #[default]
    Target,
    /// All of it is the chaser's and its ring's, opposite; the target does not turn.
    Chaser,
    /// Half of it is the target's, the other half, opposite, the chaser's and its ring's.
    Both,
}

impl Turning {
    /// Rates of chaser and target for that of the target against the chaser, in the same axes.
    #[must_use]
    pub fn rates(self, relative: DVec3) -> [DVec3; 2] {
        match self {
            Self::Target => [DVec3::ZERO, relative],
            Self::Chaser => [-relative, DVec3::ZERO],
            Self::Both => [relative * -0.5, relative * 0.5],
        }
    }
}

/// States of chaser, ring and target at the start, in a frame at the common mass centre, at rest
/// with it, its axes parallel to `e3` at first contact.
#[derive(Clone, Copy, Debug)]
pub struct InitialState {
    /// Chaser, ring, target.
    pub bodies: [BodyState; 3],
    /// Free flight until first contact, s.
    pub time_to_contact_s: f64,
    /// Distance of the ring centres along X3 at the plane of first contact, m.
    pub contact_plane_m: f64,
    /// Whether the sides touch at all on this approach; if not, the plane is where the tips of one
    /// side reach the ring plane of the other.
    pub touches: bool,
}

/// Computes the state before first contact, in free flight back by `gap_m` along the closing
/// motion.
///
/// Unless the conditions say otherwise the chaser does not rotate before contact: all the relative rate is
/// the target's, so that the ring rests in its attenuator. A chaser that turns starts with its ring at its
/// rest, moving with it, and then carries it by the attenuator.
///
/// Where the lateral motion leads away from the first touch, so that the way back would lead through the
/// surfaces, the plane of first contact is moved out until the way is free; the touch then follows a little
/// later.
#[must_use]
pub fn initial_state(system: &System, c: &ContactConditions, gap_m: f64) -> InitialState {
    let (first, touches) = contact_plane(system, c.attitude.to_quat(), c.lateral_m);
    let time = if c.velocity_m_s.x < 0.0 { gap_m / -c.velocity_m_s.x } else { 0.0 };
    let mut plane = first;
    loop {
        let last = !touches || plane > first + PLANE_SEARCH;
        let (bodies, free) = taken_back(system, c, plane, time, last);
        if free || last {
            return InitialState {
                bodies,
                time_to_contact_s: time,
                contact_plane_m: plane,
                touches,
            };
        }
        plane += 1e-3;
    }
}

/// How far the plane of first contact may be moved out, m.
const PLANE_SEARCH: f64 = 0.3;

/// States at the start for a plane of first contact, and whether the sides are apart all the way
/// back from it. Without `whole` the way ends where they are not: depths of sides that lie far within each
/// other take long to find.
fn taken_back(
    system: &System,
    c: &ContactConditions,
    plane: f64,
    time: f64,
    whole: bool,
) -> ([BodyState; 3], bool) {
    let q_34 = c.attitude.to_quat();
    // e3 is at the origin with the axes of the world for the moment.
    let mech = system.mechanism();
    let rest = DVec3::X * mech.ring_rest_offset_m;
    let ring_centre_t = rest + DVec3::new(plane, c.lateral_m.y, c.lateral_m.z);
    let x_w4 = Pose::new(ring_centre_t, q_34) * system.passive_ring_inverse();
    let [x_c3, x_t4] = system.ports();
    let x_wc = x_c3.inverse();
    let x_wt = x_w4 * x_t4.inverse();
    let x_wr = x_wc * system.ring_at_rest();

    let mass = system.mass();
    let (mc, mr, mt) = (
        mass[CHASER].mass(),
        if system.rigid() { 0.0 } else { mass[RING].mass() },
        mass[TARGET].mass(),
    );
    let [w_c, w_t] = c.turning.rates(q_34 * c.rate_rad_s);
    let mut apart = c.velocity_m_s - w_t.cross(ring_centre_t - x_wt.p);
    let still = c.turning == Turning::Target;
    if !still {
        // The velocity is that seen from e3, which turns.
        apart += w_c.cross(ring_centre_t - x_wc.p);
    }
    // The common mass centre is at rest in the world.
    let mut v_c = apart * (-mt / (mc + mr + mt));
    let arm = x_wr.p - x_wc.p;
    if !still {
        v_c -= w_c.cross(arm) * (mr / (mc + mr + mt));
    }
    let v_t = apart + v_c;
    let com = (x_wc.p * mc + x_wr.p * mr + x_wt.p * mt) / (mc + mr + mt);

    let body = |i: usize, pose: Pose, twist: Twist| {
        let moved = Pose::new(pose.p - com, pose.q);
        BodyState::new(&mass[i], moved, twist.v, pose.q.conjugate() * twist.w)
    };
    let v_r = if still { v_c } else { v_c + w_c.cross(arm) };
    let bodies = [
        body(CHASER, x_wc, Twist { v: v_c, w: w_c }),
        body(RING, x_wr, Twist { v: v_r, w: w_c }),
        body(TARGET, x_wt, Twist { v: v_t, w: w_t }),
    ];
    flown_back(system, bodies, time, Way { apart: still, whole })
}

/// How a way back is flown.
#[derive(Clone, Copy)]
struct Way {
    /// Chaser and ring fly side by side, as they may where they do not turn; else as one body.
    apart: bool,
    /// To its end, whatever touches on it.
    whole: bool,
}

/// Free flight back over `time`, and whether the sides are apart all the way.
fn flown_back(
    system: &System,
    mut bodies: [BodyState; 3],
    time: f64,
    Way { apart, whole }: Way,
) -> ([BodyState; 3], bool) {
    let mass = system.mass();
    let one = Carried::new(system);
    let mut carrier = one.state(&bodies[CHASER], &mass[CHASER]);
    // Back in steps short enough for the attitude to be exact to rounding.
    let steps = (time / 0.01).ceil().max(1.0);
    let mut left = steps;
    let mut free = true;
    while left > 0.5 {
        if apart {
            for (b, m) in bodies.iter_mut().zip(mass) {
                b.drift(m, -time / steps);
            }
        } else {
            carrier.drift(&one.mass, -time / steps);
            bodies[TARGET].drift(&mass[TARGET], -time / steps);
            one.part(&carrier, mass, &mut bodies);
        }
        free = free && !system.touches(&system.poses(&bodies.map(|b| b.pose())));
        if !free && !whole {
            break;
        }
        left -= 1.0;
    }
    (bodies, free)
}

/// Chaser and ring, the ring at its rest, as one rigid body in the axes of the chaser.
struct Carried {
    mass: MassProperties,
    /// Pose of the ring's mass-centre frame in the chaser's.
    x_cr: Pose,
    /// Mass centre of both in the chaser's frame, m.
    com: DVec3,
}

impl Carried {
    fn new(system: &System) -> Self {
        let (mass, x_cr) = (system.mass(), system.ring_at_rest());
        if system.rigid() {
            // The chaser's are those of both already.
            return Self { mass: mass[CHASER], x_cr, com: DVec3::ZERO };
        }
        let (both, com) = mass[CHASER].joined(&mass[RING], x_cr);
        Self { mass: both, x_cr, com }
    }

    fn state(&self, chaser: &BodyState, mass: &MassProperties) -> BodyState {
        let (t, arm) = (chaser.twist(mass), chaser.q * self.com);
        let pose = Pose::new(chaser.p + arm, chaser.q);
        BodyState::new(&self.mass, pose, t.v + t.w.cross(arm), chaser.q.conjugate() * t.w)
    }

    fn part(&self, both: &BodyState, mass: &[MassProperties; 3], bodies: &mut [BodyState; 3]) {
        let t = both.twist(&self.mass);
        let w_b = both.q.conjugate() * t.w;
        let at = |p_b: DVec3| both.p + both.q * (p_b - self.com);
        let v = |p: DVec3| t.v + t.w.cross(p - both.p);
        let (c, r) = (at(DVec3::ZERO), at(self.x_cr.p));
        bodies[CHASER] = BodyState::new(&mass[CHASER], Pose::new(c, both.q), v(c), w_b);
        let q_r = both.q * self.x_cr.q;
        let w_r = self.x_cr.q.conjugate() * w_b;
        bodies[RING] = BodyState::new(&mass[RING], Pose::new(r, q_r), v(r), w_r);
    }
}

/// Distance of the ring centres along X3 at which the sides first touch, coming from afar.
fn contact_plane(system: &System, q_34: DQuat, lateral: DVec3) -> (f64, bool) {
    let m = system.mechanism();
    if let Some(stick) = &m.stick {
        let rings = m.active.ring.section_radius_m + m.passive.ring.section_radius_m;
        return (rings - stick.play_m(), true);
    }
    let height = |s: &docktwin_model::SideGeometry| {
        let guides = s.petals.map_or(s.ring.section_radius_m, |p| p.height_m + 0.5 * p.thickness_m);
        guides.max(s.surfaces_top_m().unwrap_or(0.0))
    };
    let reach = |s: &docktwin_model::SideGeometry| {
        s.petals
            .map_or(s.ring.mean_radius_m, |p| {
                p.tip_radius_m.max(p.base_radius_m).max(s.ring.mean_radius_m)
            })
            .max(s.surfaces_reach_m())
    };
    let (ha, hp) = (height(&m.active), height(&m.passive));
    // Tilt lifts the rim by at most the radius times its sine.
    let tilt = (q_34 * DVec3::X).x.clamp(-1.0, 1.0).acos().sin() * reach(&m.passive);
    let far = ha + hp + tilt + 0.05;
    let touch = |x: f64| {
        let x_3r4 = Pose::new(DVec3::new(x, lateral.y, lateral.z), q_34)
            * Pose::new(DVec3::ZERO, DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0));
        system.scene().touches(x_3r4)
    };
    let step = 1e-3;
    let mut x = far;
    while x > -tilt {
        if touch(x) {
            let (mut lo, mut hi) = (x, x + step);
            for _ in 0..50 {
                let mid = 0.5 * (lo + hi);
                if touch(mid) { lo = mid } else { hi = mid }
            }
            return (lo, true);
        }
        x -= step;
    }
    (ha.max(hp), false)
}
