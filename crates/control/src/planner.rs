//! Path of the rig from rest to the initial condition of a docking (§6, locus planning).
//!
//! First a route of moves, each from rest to rest, from the present pose to the beginning of the run-up: straight
//! where that touches nothing, else with the lateral and angular part of it made at a distance. Then the
//! run-up along the free flight that leads to the initial condition, time-scaled by a smooth ramp:
//! every pose of the run-up is a pose of the free flight, and at its end position, velocity,
//! acceleration and jerk are continuous with it. There the loop is closed.

use docktwin_core::{DQuat, DVec3, Pose, Twist};
use docktwin_physics::programme::{Programme, RelativeMotion};

/// `p(u) = 35u⁴ − 84u⁵ + 70u⁶ − 20u⁷`, from 0 to 1, and its first three derivatives.
pub(crate) fn smooth(u: f64) -> [f64; 4] {
    let u = u.clamp(0.0, 1.0);
    let (u2, v) = (u * u, 1.0 - u);
    [
        u2 * u2 * (35.0 - u * (84.0 - u * (70.0 - 20.0 * u))),
        140.0 * u * u2 * v * v * v,
        420.0 * u2 * v * v * (1.0 - 2.0 * u),
        840.0 * u * v * (1.0 - u * (5.0 - 5.0 * u)),
    ]
}

/// Integral of [`smooth`] from 0.
pub(crate) fn smooth_area(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    let u2 = u * u;
    u2 * u2 * u * (7.0 - u * (14.0 - u * (10.0 - 2.5 * u)))
}

/// From rest to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    from: Pose,
    /// Way of the origin, m, and rotation vector, rad, both in `e3`.
    way: DVec3,
    turn: DVec3,
    /// How long it takes, s.
    pub duration_s: f64,
}

impl Move {
    /// From one relative pose to another, nowhere faster than `speed_m_s` and `rate_rad_s`.
    #[must_use]
    pub fn new(from: &Pose, to: &Pose, speed_m_s: f64, rate_rad_s: f64) -> Self {
        let way = to.p - from.p;
        let mut q = (to.q * from.q.conjugate()).normalize();
        if q.w < 0.0 {
            q = -q;
        }
        let turn = q.to_scaled_axis();
        // The derivative of the smooth step is 35/16 in its middle.
        let longest = (way.length() / speed_m_s).max(turn.length() / rate_rad_s);
        Self { from: *from, way, turn, duration_s: (35.0 / 16.0 * longest).max(SHORTEST_S) }
    }

    /// Whether it touches nothing.
    pub fn is_clear(&self, touches: impl Fn(&Pose) -> bool) -> bool {
        is_clear(self.duration_s, |t| self.at(t), 0.0, touches)
    }

    /// The motion `time_s` after its start.
    #[must_use]
    pub fn at(&self, time_s: f64) -> RelativeMotion {
        let t = self.duration_s;
        let [p, v, a, j] = smooth(time_s / t);
        let along = |x: f64| Twist { v: self.way * x, w: self.turn * x };
        let q = DQuat::from_scaled_axis(self.turn * p) * self.from.q;
        RelativeMotion {
            x_34: Pose::new(self.from.p + self.way * p, q.normalize()),
            twist: along(v / t),
            acceleration: along(a / (t * t)),
            jerk: along(j / (t * t * t)),
        }
    }
}

/// Whether a way touches nothing before its end, `at` its motion by time over `duration_s`, seen so much nearer along the
/// docking axis, m: a ring that sags is not where it is believed.
fn is_clear(
    duration_s: f64,
    at: impl Fn(f64) -> RelativeMotion,
    nearer_m: f64,
    touches: impl Fn(&Pose) -> bool,
) -> bool {
    (0..LOOKS).all(|i| {
        let x = at(duration_s * f64::from(i) / f64::from(LOOKS)).x_34;
        !touches(&Pose::new(x.p - DVec3::X * nearer_m, x.q))
    })
}

/// Moves one after the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    poses: Vec<Pose>,
    moves: Vec<Move>,
    /// How long it takes, s.
    pub duration_s: f64,
}

/// Poses of a way that are looked at.
const LOOKS: u32 = 300;
/// By how much nearer along the docking axis a route is to be clear too, m, the first of these that can be had.
const CLEARANCES_M: [f64; 3] = [0.005, 0.001, 0.0];
/// How far the mechanisms are drawn apart for a move sideways where they are near each other, m.
const APART_M: f64 = 0.1;

impl Route {
    /// Through these poses, nowhere faster than `speed_m_s` and `rate_rad_s`; two poses at least.
    #[must_use]
    pub fn through(poses: &[Pose], speed_m_s: f64, rate_rad_s: f64) -> Self {
        let moves: Vec<Move> =
            poses.windows(2).map(|p| Move::new(&p[0], &p[1], speed_m_s, rate_rad_s)).collect();
        let duration_s = moves.iter().map(|m| m.duration_s).sum();
        Self { poses: poses.to_vec(), moves, duration_s }
    }

    /// The same way from another beginning near its own.
    #[must_use]
    pub fn begun_at(mut self, from: &Pose, [speed_m_s, rate_rad_s]: [f64; 2]) -> Self {
        self.poses[0] = *from;
        Self::through(&self.poses, speed_m_s, rate_rad_s)
    }

    /// From one relative pose to another, `X_34`, along which nothing touches: straight; or sideways first, at the
    /// larger of both distances; or apart first. `None` where each of them touches.
    #[must_use]
    pub fn clear(
        [from, to]: [&Pose; 2],
        [speed_m_s, rate_rad_s]: [f64; 2],
        touches: impl Fn(&Pose) -> bool,
    ) -> Option<Self> {
        let at = |x: f64, of: &Pose| Pose::new(DVec3::new(x, of.p.y, of.p.z), of.q);
        let far = from.p.x.max(to.p.x);
        let farther = far + APART_M;
        let ways: [&[Pose]; 3] = [
            &[*from, *to],
            &[*from, at(far, to), *to],
            &[*from, at(farther, from), at(farther, to), *to],
        ];
        let routes = ways.map(|poses| Self::through(poses, speed_m_s, rate_rad_s));
        CLEARANCES_M.into_iter().find_map(|clearance_m| {
            let clear = |r: &&Self| is_clear(r.duration_s, |t| r.at(t), clearance_m, &touches);
            routes.iter().find(clear).cloned()
        })
    }

    /// The motion `time_s` after its start.
    #[must_use]
    pub fn at(&self, time_s: f64) -> RelativeMotion {
        let mut left = time_s;
        let mut out = RelativeMotion::default();
        for m in &self.moves {
            out = m.at(left);
            if left < m.duration_s {
                break;
            }
            left -= m.duration_s;
        }
        out
    }
}

/// The shortest a move takes, s.
const SHORTEST_S: f64 = 0.5;

/// Along the free flight up to the initial condition.
#[derive(Clone, Debug)]
pub struct RunUp {
    bodies: Programme,
    /// How long it takes, s; half of it is the free flight it goes through.
    pub duration_s: f64,
}

impl RunUp {
    /// Whether it touches nothing, seen so much nearer along the docking axis, m.
    pub fn is_clear(&self, nearer_m: f64, touches: impl Fn(&Pose) -> bool) -> bool {
        is_clear(self.duration_s, |t| self.at(t), nearer_m, touches)
    }

    /// To the present state of `bodies`, within `duration_s`.
    #[must_use]
    pub fn new(bodies: &Programme, duration_s: f64) -> Self {
        Self { bodies: bodies.clone(), duration_s }
    }

    /// The motion `time_s` after its start; at its end that of the bodies.
    #[must_use]
    pub fn at(&self, time_s: f64) -> RelativeMotion {
        let t = self.duration_s;
        let u = time_s / t;
        let [w, w1, w2, _] = smooth(u);
        let free = self.bodies.free(t * (smooth_area(u) - 0.5));
        let (v, a) = (free.twist, free.acceleration);
        let mix = |x: f64, y: f64| Twist { v: v.v * x + a.v * y, w: v.w * x + a.w * y };
        let (w1, w2) = (w1 / t, w2 / (t * t));
        RelativeMotion {
            x_34: free.x_34,
            twist: mix(w, 0.0),
            acceleration: mix(w1, w * w),
            jerk: mix(w2, 3.0 * w * w1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every derivative is that of the one before.
    #[test]
    fn oracle_derivatives_of_the_smooth_step() {
        let h = 1e-5;
        for i in 1..20 {
            let u = f64::from(i) / 20.0;
            let (a, b) = (smooth(u - h), smooth(u + h));
            let here = smooth(u);
            for k in 0..3 {
                let slope = (b[k] - a[k]) / (2.0 * h);
                assert!((slope - here[k + 1]).abs() < 1e-5, "{u} {k}: {slope} {}", here[k + 1]);
            }
            let slope = (smooth_area(u + h) - smooth_area(u - h)) / (2.0 * h);
            assert!((slope - here[0]).abs() < 1e-6);
        }
        assert!((smooth_area(1.0) - 0.5).abs() < 1e-15);
    }

    #[test]
    fn invariant_a_move_keeps_its_limits_and_ends() {
        let from = Pose::IDENTITY;
        let to = Pose::new(DVec3::new(0.3, -0.1, 0.2), DQuat::from_rotation_x(0.2));
        let m = Move::new(&from, &to, 0.05, 0.02);
        let n = 1000;
        for i in 0..=n {
            let at = m.at(m.duration_s * f64::from(i) / f64::from(n));
            assert!(at.twist.v.length() <= 0.05 + 1e-12 && at.twist.w.length() <= 0.02 + 1e-12);
        }
        let end = m.at(m.duration_s);
        assert!((end.x_34.p - to.p).length() < 1e-15 && end.twist.v.length() < 1e-15);
        assert!((end.x_34.q.dot(to.q).abs() - 1.0).abs() < 1e-15);
    }

    /// A wall that only a way round it avoids, and one that none does.
    #[test]
    fn invariant_a_route_goes_round_what_it_would_touch() {
        let from = Pose::new(DVec3::new(0.6, 0.0, 0.0), DQuat::IDENTITY);
        let to = Pose::new(DVec3::new(0.3, 0.2, 0.0), DQuat::from_rotation_x(0.1));
        let speeds = [0.05, 0.05];
        let find = |touches: fn(&Pose) -> bool| Route::clear([&from, &to], speeds, touches);
        let straight = find(|_| false).expect("nothing is there");
        assert_eq!(straight.moves, [Move::new(&from, &to, 0.05, 0.05)]);
        // A corner that sticks out between both.
        let corner = |x: &Pose| x.p.x < 0.5 && x.p.y < 0.15;
        let round = find(corner).expect("there is a way");
        assert_eq!(round.moves.len(), 2);
        for i in 0..=1000 {
            let at = round.at(round.duration_s * f64::from(i) / 1000.0);
            assert!(!corner(&at.x_34));
            assert!(at.twist.v.length() <= 0.05 + 1e-12);
        }
        let end = round.at(round.duration_s).x_34;
        assert!((end.p - to.p).length() < 1e-15 && end.q.dot(to.q).abs() > 1.0 - 1e-15);
        // Near each other: apart first.
        let shelf = |x: &Pose| x.p.x < 0.65 && x.p.y > 0.02 && x.p.y < 0.18;
        assert_eq!(find(shelf).expect("there is a way").moves.len(), 3);
        assert_eq!(find(|x| x.p.y > 0.1 && x.p.y < 0.15), None);
    }
}
