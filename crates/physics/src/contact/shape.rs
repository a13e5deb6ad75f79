//! Distances between the cores of the guiding surfaces: circles (rings) and straight rulings
//! (petals), all in one frame.
//!
//! The cores are exact, so there is no tessellation to refine: a ring is its centre circle swept by
//! a ball, a petal is a family of straight rulings swept by a ball (see
//! [`docktwin_model::PetalGeometry`]). Depth is the sum of the ball radii minus the distance of the
//! cores, and stays right until the cores meet; beyond that the side of the last step is kept.

use docktwin_core::DVec3;
use parry3d_f64::query::details::closest_points_segment_segment_with_locations_nD;
use parry3d_f64::shape::SegmentPointLocation;

/// A circle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Circle {
    pub(crate) centre: DVec3,
    /// Unit normal of its plane.
    pub(crate) axis: DVec3,
    /// Unit vector in the plane: azimuth zero.
    pub(crate) e0: DVec3,
    /// `axis × e0`.
    pub(crate) e1: DVec3,
    pub(crate) radius: f64,
}

impl Circle {
    /// Point at azimuth with the given cosine and sine.
    pub(crate) fn at(&self, cos: f64, sin: f64) -> DVec3 {
        self.centre + (self.e0 * cos + self.e1 * sin) * self.radius
    }

    /// Nearest point of the circle. On the axis, where every point is as near, azimuth zero.
    pub(crate) fn nearest(&self, p: DVec3) -> DVec3 {
        let r = p - self.centre;
        let in_plane = r - self.axis * r.dot(self.axis);
        let rho2 = in_plane.length_squared();
        if rho2 < 1e-24 {
            return self.centre + self.e0 * self.radius;
        }
        self.centre + in_plane * (self.radius / rho2.sqrt())
    }
}

/// A straight piece from `a` to `a + d`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Segment {
    pub(crate) a: DVec3,
    pub(crate) d: DVec3,
}

impl Segment {
    pub(crate) fn between(a: DVec3, b: DVec3) -> Self {
        Self { a, d: b - a }
    }

    pub(crate) fn at(&self, s: f64) -> DVec3 {
        self.a + self.d * s
    }
}

/// Nearest points of two cores.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nearest {
    /// On the first core (active side).
    pub(crate) pa: DVec3,
    /// On the second core (passive side).
    pub(crate) pb: DVec3,
    /// Parameter on the first, 0 … 1, where it is a segment.
    pub(crate) sa: f64,
    /// Parameter on the second, 0 … 1, where it is a segment.
    pub(crate) sb: f64,
}

/// Segment to circle: parameter on the segment, nearest point of the segment, nearest of the circle.
///
/// The squared distance along the segment is `|p − c|² + R² − 2Rρ`, ρ the distance of p from the
/// circle's axis; both squares are parabolas of the parameter, so Newton's method costs one root a
/// round.
pub(crate) fn segment_circle(seg: &Segment, circle: &Circle) -> (f64, DVec3, DVec3) {
    let r = seg.a - circle.centre;
    let (height, climb) = (r.dot(circle.axis), seg.d.dot(circle.axis));
    // |p − c|² = A + 2Bs + Cs², its part in the plane of the circle a + 2bs + cs².
    let (b2, c2) = (r.dot(seg.d), seg.d.length_squared());
    let (a, b, c) = (r.length_squared() - height * height, b2 - height * climb, c2 - climb * climb);
    let mut s = 0.5;
    for _ in 0..12 {
        let rho = (a + s * (2.0 * b + s * c)).max(1e-24).sqrt();
        let k = circle.radius / rho;
        let half = b + c * s;
        let slope = b2 + c2 * s - k * half;
        let curve = c2 - k * (c - (half / rho) * (half / rho));
        // Where the distance is not convex: alternating projections, which always go down.
        let step = if curve > 0.05 * c2 { slope / curve } else { slope / c2 };
        let next = (s - step).clamp(0.0, 1.0);
        let moved = (next - s).abs();
        s = next;
        // The distance is stationary there: a micrometre along the ruling changes nothing.
        if moved < 1e-6 {
            break;
        }
    }
    let p = seg.at(s);
    (s, p, circle.nearest(p))
}

/// Segment to segment, parry's closed form.
pub(crate) fn segment_segment(a: &Segment, b: &Segment) -> Nearest {
    let (la, lb) =
        closest_points_segment_segment_with_locations_nD((&a.a, &a.at(1.0)), (&b.a, &b.at(1.0)));
    let param = |l: SegmentPointLocation| match l {
        SegmentPointLocation::OnVertex(i) => f64::from(i),
        SegmentPointLocation::OnEdge(w) => w[1],
    };
    let (sa, sb) = (param(la), param(lb));
    Nearest { pa: a.at(sa), pb: b.at(sb), sa, sb }
}

/// Abscissa, in [−1, 1], of the highest point of the parabola through (−1, l), (0, m), (1, r),
/// clamped; and its value.
pub(crate) fn parabola_peak(l: f64, m: f64, r: f64) -> (f64, f64) {
    let slope = 0.5 * (r - l);
    let curve = r - 2.0 * m + l;
    let t = if curve < -1e-300 {
        (-slope / curve).clamp(-1.0, 1.0)
    } else if r > l {
        1.0
    } else {
        -1.0
    };
    (t, m + t * (slope + 0.5 * curve * t))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_circle() -> Circle {
        Circle { centre: DVec3::ZERO, axis: DVec3::X, e0: DVec3::Y, e1: DVec3::Z, radius: 0.6 }
    }

    #[test]
    fn oracle_point_on_ruling_nearest_to_a_coaxial_circle() {
        // In the half-plane: line from (0, 0.597) at 45° inwards, circle point (0.05, 0.6).
        let seg = Segment::between(DVec3::new(0.0, 0.597, 0.0), DVec3::new(0.187, 0.41, 0.0));
        let mut c = unit_circle();
        c.centre = DVec3::new(0.05, 0.0, 0.0);
        let (_, p, q) = segment_circle(&seg, &c);
        let want = (0.05 + 0.6 - 0.597) / 2.0f64.sqrt();
        assert!(((q - p).length() - want).abs() < 1e-12);
    }

    #[test]
    fn oracle_newton_along_a_ruling_agrees_with_a_scan() {
        // Rulings as petals have them, against circles displaced and tilted as in a docking.
        let mut c = unit_circle();
        for k in 0..400 {
            let t = f64::from(k);
            let turn = docktwin_core::DQuat::from_rotation_y(0.15 * (0.7 * t).sin())
                * docktwin_core::DQuat::from_rotation_z(0.15 * (1.3 * t).cos());
            c.centre =
                DVec3::new(0.1 + 0.1 * t.sin(), 0.1 * (2.0 * t).sin(), 0.1 * (3.0 * t).cos());
            (c.axis, c.e0, c.e1) = (turn * DVec3::X, turn * DVec3::Y, turn * DVec3::Z);
            let (sin, cos) = (0.05 * t).sin_cos();
            let seg = Segment::between(
                DVec3::new(0.0, 0.597 * cos, 0.597 * sin),
                DVec3::new(0.187, 0.41 * cos, 0.41 * sin),
            );
            let far = |s: f64| (c.nearest(seg.at(s)) - seg.at(s)).length();
            let scan = (0..=2000).map(|i| far(f64::from(i) / 2000.0)).fold(f64::INFINITY, f64::min);
            let (s, p, q) = segment_circle(&seg, &c);
            assert!((0.0..=1.0).contains(&s));
            assert!((p - q).length() <= scan + 1e-9, "{k}: {} {scan}", (p - q).length());
        }
    }

    #[test]
    fn oracle_parabola() {
        let f = |t: f64| 3.0 - 2.0 * (t - 0.3) * (t - 0.3);
        let (t, v) = parabola_peak(f(-1.0), f(0.0), f(1.0));
        assert!((t - 0.3).abs() < 1e-12 && (v - 3.0).abs() < 1e-12);
        assert!((parabola_peak(0.0, 1.0, 2.0).0 - 1.0).abs() < 1e-12);
    }
}
