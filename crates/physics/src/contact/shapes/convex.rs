//! Two convex bodies: the distance of their cores, by closed forms for spheres and capsules, else by parry.

use docktwin_core::{DQuat, DVec3};
use docktwin_model::SurfaceCore;
use parry3d_f64::{
    math::{Pose, Vector},
    query::gjk::{CsoPoint, GJKResult, VoronoiSimplex, closest_points},
    shape::SupportMap,
};

use super::Spot;
use crate::contact::look::Frame;

/// A core as parry wants it: larger by [`SCALE`], because parry's GJK takes an area below 5e-8 for none whatever the
/// unit, and comes to rest micrometres from the truth on small curved bodies.
struct Core<'a>(&'a SurfaceCore);

const SCALE: f64 = 1e5;

impl SupportMap for Core<'_> {
    fn local_support_point(&self, dir: Vector) -> Vector {
        self.0.farthest(dir) * SCALE
    }
}

/// The place of two convex surfaces, deepest or nearest; `x` is the second's frame in the first's.
pub(super) fn spot(first: &SurfaceCore, second: &SurfaceCore, x: &Frame, balls: [f64; 2]) -> Spot {
    let ends = |core: &SurfaceCore| match core {
        SurfaceCore::Sphere => Some(0.0),
        SurfaceCore::Capsule { half } => Some(*half),
        _ => None,
    };
    let between = ends(first).zip(ends(second)).map_or_else(
        || by_parry(first, second, x),
        |(a, b)| {
            segments([DVec3::X * -a, DVec3::X * a], [x.point(DVec3::X * -b), x.point(DVec3::X * b)])
        },
    );
    between_points(between, balls)
}

/// The place of two surfaces whose cores are nearest at these points.
pub(super) fn between_points([a, b]: [DVec3; 2], balls: [f64; 2]) -> Spot {
    let gap = b - a;
    let far = gap.length();
    let normal = if far > 1e-12 { gap / far } else { DVec3::X };
    let depth = balls[0] + balls[1] - far;
    Spot { depth, point: a + normal * (balls[0] - 0.5 * depth), normal }
}

/// Nearest points of two segments (Ericson, Real-Time Collision Detection, 5.1.9).
fn segments([p1, q1]: [DVec3; 2], [p2, q2]: [DVec3; 2]) -> [DVec3; 2] {
    let (d1, d2, r) = (q1 - p1, q2 - p2, p1 - p2);
    let (a, e) = (d1.length_squared(), d2.length_squared());
    let (b, c, f) = (d1.dot(d2), d1.dot(r), d2.dot(r));
    let part = |x: f64, of: f64| if of > 0.0 { (x / of).clamp(0.0, 1.0) } else { 0.0 };
    let between = a * e - b * b;
    let s = if between > 1e-14 * a * e { ((b * f - c * e) / between).clamp(0.0, 1.0) } else { 0.5 };
    let t = part(b * s + f, e);
    let s = part(b * t - c, a);
    [p1 + d1 * s, p2 + d2 * part(b * s + f, e)]
}

/// Nearest points by parry's GJK; one point twice where the cores meet.
fn by_parry(first: &SurfaceCore, second: &SurfaceCore, x: &Frame) -> [DVec3; 2] {
    let pose = Pose::from_parts(x.p * SCALE, DQuat::from_mat3(&x.r).normalize());
    let (a, b) = (Core(first), Core(second));
    let mut simplex = VoronoiSimplex::new();
    let dir = if x.p.length_squared() > 0.0 { -x.p.normalize() } else { DVec3::X };
    simplex.reset(CsoPoint::from_shapes(&pose, &a, &b, dir));
    match closest_points(&pose, &a, &b, f64::MAX, true, &mut simplex) {
        GJKResult::ClosestPoints(p, q, _) => [p / SCALE, q / SCALE],
        _ => [DVec3::ZERO; 2],
    }
}
