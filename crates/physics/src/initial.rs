//! From the relative state at the plane of first contact back to the start of a scenario (§1).

use docktwin_core::{DQuat, DVec3, Euler, Pose, Twist};

use crate::{
    body::BodyState,
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
/// The chaser does not rotate before contact: all the relative rate is the target's, so that the
/// ring rests in its attenuator. Where the lateral motion leads away from the first touch, so that
/// the way back would lead through the surfaces, the plane of first contact is moved out until the
/// way is free; the touch then follows a little later.
#[must_use]
pub fn initial_state(system: &System, c: &ContactConditions, gap_m: f64) -> InitialState {
    let (first, touches) = contact_plane(system, c.attitude.to_quat(), c.lateral_m);
    let time = if c.velocity_m_s.x < 0.0 { gap_m / -c.velocity_m_s.x } else { 0.0 };
    let mut plane = first;
    loop {
        let (bodies, free) = taken_back(system, c, plane, time);
        if free || !touches || plane > first + PLANE_SEARCH {
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
/// back from it.
fn taken_back(
    system: &System,
    c: &ContactConditions,
    plane: f64,
    time: f64,
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
    let w_t = q_34 * c.rate_rad_s;
    let v_t = c.velocity_m_s - w_t.cross(ring_centre_t - x_wt.p);
    // The common mass centre is at rest in the world.
    let v_c = v_t * (-mt / (mc + mr + mt));
    let v_t = v_t + v_c;
    let com = (x_wc.p * mc + x_wr.p * mr + x_wt.p * mt) / (mc + mr + mt);

    let body = |i: usize, pose: Pose, twist: Twist| {
        let moved = Pose::new(pose.p - com, pose.q);
        BodyState::new(&mass[i], moved, twist.v, pose.q.conjugate() * twist.w)
    };
    let still = Twist { v: v_c, w: DVec3::ZERO };
    let mut bodies = [
        body(CHASER, x_wc, still),
        body(RING, x_wr, still),
        body(TARGET, x_wt, Twist { v: v_t, w: w_t }),
    ];
    // Back in steps short enough for the attitude to be exact to rounding.
    let steps = (time / 0.01).ceil().max(1.0);
    let mut left = steps;
    let mut free = true;
    while left > 0.5 {
        for (b, m) in bodies.iter_mut().zip(mass) {
            b.drift(m, -time / steps);
        }
        let poses = system.poses(&bodies.map(|b| b.pose()));
        free &= !system.touches(&poses);
        left -= 1.0;
    }
    (bodies, free)
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
