//! Distance of every petal to what is nearest on the other side: for eyes, not for forces.

use docktwin_core::{DVec3, Pose};

use super::{COARSE, Circle, MAX_PETALS, Petal, Scene, Segment, Side, climb};
use crate::contact::shape::{segment_circle, segment_segment};

/// Rounds of refinement, each with a parabola: the last one looks 4 % of a petal's width to either side.
const ROUNDS: usize = 3;

/// Gap of each petal, m: its distance to the ring or petal of the other side that is nearest, positive
/// apart, negative in contact (right while the cores of the surfaces have not met). NaN where the
/// side has no such petal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PetalGaps {
    /// Petals of the active side.
    pub active_m: [f64; MAX_PETALS],
    /// Petals of the passive side.
    pub passive_m: [f64; MAX_PETALS],
}

impl Scene {
    /// Gap of every petal, with `x_rp` the pose of the passive ring frame `r4` in the active ring
    /// frame `r3`. Tens of microseconds: for every frame of a picture, not for every step.
    #[must_use]
    pub fn petal_gaps(&self, x_rp: Pose) -> PetalGaps {
        let mut out =
            PetalGaps { active_m: [f64::NAN; MAX_PETALS], passive_m: [f64::NAN; MAX_PETALS] };
        let to_rings = |side: &Side, ring: &Side, x: Pose, gaps: &mut [f64]| {
            let circle = Circle {
                centre: x.p,
                axis: x.q * DVec3::X,
                e0: x.q * DVec3::Y,
                e1: x.q * DVec3::Z,
                radius: ring.circle.radius,
            };
            for (petal, gap) in side.petals.iter().zip(gaps) {
                *gap = petal_circle(petal, &circle) - petal.radius - ring.tube;
            }
        };
        to_rings(&self.active, &self.passive, x_rp, &mut out.active_m);
        to_rings(&self.passive, &self.active, x_rp.inverse(), &mut out.passive_m);
        for (p, gap_p) in self.passive.petals.iter().zip(&mut out.passive_m) {
            let centre = x_rp.transform_point(p.centre);
            let moved = |s: Segment| Segment { a: x_rp.transform_point(s.a), d: x_rp.q * s.d };
            let coarse = p.coarse.map(moved);
            for (a, gap_a) in self.active.petals.iter().zip(&mut out.active_m) {
                let radii = a.radius + p.radius;
                let least = (centre - a.centre).length() - a.reach - p.reach - radii;
                if least > gap_a.max(*gap_p) {
                    continue;
                }
                let look = gap_a.max(*gap_p) + radii;
                let d = petal_petal(a, &coarse, |v| moved(p.ruling(v)), look) - radii;
                (*gap_a, *gap_p) = (gap_a.min(d), gap_p.min(d));
            }
        }
        out
    }
}

#[expect(clippy::cast_precision_loss, reason = "small numbers")]
fn u_of(i: usize) -> f64 {
    -1.0 + 2.0 * i as f64 / (COARSE - 1) as f64
}

/// Least distance between the mid-surface of a petal and a circle.
fn petal_circle(petal: &Petal, circle: &Circle) -> f64 {
    let of = |s: &Segment| {
        let (_, p, q) = segment_circle(s, circle);
        -(q - p).length()
    };
    let (mut u, mut best) = (0.0, f64::NEG_INFINITY);
    for (i, s) in petal.coarse.iter().enumerate() {
        let near = of(s);
        if near > best {
            (u, best) = (u_of(i), near);
        }
    }
    let mut h = u_of(1) - u_of(0);
    for _ in 0..ROUNDS {
        (u, best) = climb(u, best, (u - h).max(-1.0), (u + h).min(1.0), |x| of(&petal.ruling(x)));
        h *= 0.4;
    }
    -best
}

/// Least distance between the mid-surfaces of two petals, `coarse` and `ruling` those of the second
/// in the frame of the first. Not refined where it cannot be below `look`.
fn petal_petal(
    a: &Petal,
    coarse: &[Segment; COARSE],
    ruling: impl Fn(f64) -> Segment,
    look: f64,
) -> f64 {
    let of = |s: &Segment, t: &Segment| {
        let near = segment_segment(s, t);
        -(near.pb - near.pa).length()
    };
    let (mut u, mut v, mut best) = (0.0, 0.0, f64::NEG_INFINITY);
    for (i, s) in a.coarse.iter().enumerate() {
        for (j, t) in coarse.iter().enumerate() {
            let near = of(s, t);
            if near > best {
                (u, v, best) = (u_of(i), u_of(j), near);
            }
        }
    }
    // Between the rulings looked at it can fall by no more than half their distances.
    let step = |r: &[Segment; COARSE]| (r[0].a - r[1].a).length();
    if -best - 0.5 * (step(&a.coarse) + step(coarse)) > look {
        return -best;
    }
    let mut h = u_of(1) - u_of(0);
    for _ in 0..ROUNDS {
        let t = ruling(v);
        (u, best) = climb(u, best, (u - h).max(-1.0), (u + h).min(1.0), |x| of(&a.ruling(x), &t));
        let s = a.ruling(u);
        (v, best) = climb(v, best, (v - h).max(-1.0), (v + h).min(1.0), |x| of(&s, &ruling(x)));
        h *= 0.4;
    }
    -best
}
