//! The deepest place of two cores, found and proven.
//!
//! Nothing here samples: a *place* is polished by Newton's method, and everything else is *proven* to
//! be no deeper. A part of the pair (a rectangle of the parameters of both cores) is settled
//!
//! 1. by a separating function: a function f that changes by no more than the distance moved (a plane's
//!    normal, or a cone's about an axis). With `f ≤ α` on one part and `f ≥ β` on the other, they are
//!    at least β − α apart;
//! 2. or by curvature, where the part holds the place itself: the distance is convex enough about it
//!    that the place is the only one there ([`Pairing::is_alone`]).
//!
//! A part that neither settles is cut in two. Most contacts are settled whole, by the plane through
//! the place across its normal. Where that took parts, the proof is kept: it holds until the
//! surfaces have moved as far as what is outside the place's neighbourhood lay below it.
//!
//! Depths are *effective* depths (see [`Stiffness`]): by them, not by depths in metres, one place is
//! more than another where a petal's softness changes along it.

mod newton;
mod on_circle;
mod on_sheet;
mod proof;

pub(crate) use on_circle::OnCircle;
pub(crate) use on_sheet::OnSheet;
pub(crate) use proof::{KeptProof, Start, deepest};

use docktwin_core::DVec3;
use newton::{Jet, minimise};
use proof::{AMPLE_M, FEW_ROUNDS};

/// A rectangle of parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rect<const N: usize> {
    pub(crate) lo: [f64; N],
    pub(crate) hi: [f64; N],
}

impl<const N: usize> Rect<N> {
    /// Whether `other` lies within.
    fn holds(&self, other: &Self) -> bool {
        (0..N).all(|i| self.lo[i] <= other.lo[i] && other.hi[i] <= self.hi[i])
    }

    pub(crate) fn contains(&self, z: &[f64; N]) -> bool {
        (0..N).all(|i| self.lo[i] <= z[i] && z[i] <= self.hi[i])
    }

    /// Whether more than a side is shared.
    fn meets(&self, other: &Self) -> bool {
        (0..N).all(|i| {
            self.lo[i] < other.hi[i] && other.lo[i] < self.hi[i] || other.lo[i] >= other.hi[i]
        })
    }

    pub(crate) fn clamp(&self, z: &[f64; N]) -> [f64; N] {
        core::array::from_fn(|i| z[i].clamp(self.lo[i], self.hi[i]))
    }

    pub(crate) fn middle(&self) -> [f64; N] {
        core::array::from_fn(|i| 0.5 * (self.lo[i] + self.hi[i]))
    }
}

/// How the stiffness of two surfaces in contact falls along a petal.
///
/// With the compliance of both petals' tips relative to the surfaces' own, `a` and `b`,
/// `k/k_c = 1/(1 + a s³ + b t³)`. The effective depth is the depth at which the surfaces alone would
/// store the same energy: `η = δ (k/k_c)^(1/(n+1))`, so that `U = k_c η^(n+1)/(n+1)`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stiffness {
    pub(crate) a: f64,
    pub(crate) b: f64,
    /// 1/(n + 1).
    pub(crate) power: f64,
}

/// The inverse of the gain `g = η/δ` at a place, and its derivatives by s and t.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Softening {
    pub(crate) inverse: f64,
    pub(crate) slope: [f64; 2],
}

impl Stiffness {
    fn sum(&self, s: f64, t: f64) -> f64 {
        1.0 + self.a * s.powi(3) + self.b * t.powi(3)
    }

    fn raise(&self, h: f64) -> f64 {
        if (self.power - 0.5).abs() < f64::EPSILON { h.sqrt() } else { h.powf(self.power) }
    }

    /// Effective depth of a depth at (s, t). Where surfaces are apart the softness says nothing.
    pub(crate) fn effective(&self, depth: f64, s: f64, t: f64) -> f64 {
        if depth > 0.0 { depth / self.raise(self.sum(s, t)) } else { depth }
    }

    pub(crate) fn softening(&self, s: f64, t: f64) -> Softening {
        let h = self.sum(s, t);
        let inverse = self.raise(h);
        let by = 3.0 * self.power * inverse / h;
        Softening { inverse, slope: [by * self.a * s * s, by * self.b * t * t] }
    }

    pub(crate) fn least_gain(&self) -> f64 {
        1.0 / self.raise(self.sum(1.0, 1.0))
    }

    /// Whether 1/g is convex in (s, t), so that its tangent is a bound from below: always for n ≤ 2.
    fn is_convex(&self) -> bool {
        1.5 * (1.0 - self.power) <= 1.0
            || (self.a + self.b) * (1.5 * (1.0 - self.power) - 1.0) < 1.0
    }

    /// Minus the effective depth with derivatives, from the distance's: `at.f` is minus the depth, s and t
    /// are the parameters numbered `along` (`usize::MAX`: none).
    fn weigh<const N: usize>(&self, at: &mut Jet<N>, z: &[f64; N], along: [usize; 2]) {
        let depth = -at.f;
        if depth <= 0.0 || self.a + self.b <= 0.0 {
            return;
        }
        let value = |i: usize| z.get(along[i]).copied().unwrap_or(0.0);
        let (s, t) = (value(0), value(1));
        let h = self.sum(s, t);
        let g = 1.0 / self.raise(h);
        let (first, second) = (-self.power * g / h, self.power * (self.power + 1.0) * g / (h * h));
        let mut by = [0.0; N];
        let mut twice = [0.0; N];
        for (i, x, c) in [(along[0], s, self.a), (along[1], t, self.b)] {
            if i < N {
                (by[i], twice[i]) = (3.0 * c * x * x, 6.0 * c * x);
            }
        }
        let slope = at.g;
        for i in 0..N {
            for k in 0..N {
                let mut gg = second * by[i] * by[k];
                if i == k {
                    gg += first * twice[i];
                }
                at.h[i][k] =
                    g * at.h[i][k] + first * (slope[i] * by[k] + by[i] * slope[k]) - depth * gg;
            }
            at.g[i] = g * slope[i] - depth * first * by[i];
        }
        at.f = -depth * g;
    }
}

/// A place: the deepest of its neighbourhood.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place<const N: usize, A> {
    pub(crate) z: [f64; N],
    /// Effective depth, m; negative when apart.
    pub(crate) effective: f64,
    /// Depth, m.
    pub(crate) depth: f64,
    pub(crate) softening: Softening,
    /// Direction from the first core to the second.
    pub(crate) aim: A,
}

/// Two cores, the first with its parameters in front.
pub(crate) trait Pairing<const N: usize> {
    /// A rectangle with what bounds on it need.
    type Part: Clone;
    /// A direction of separation.
    type Aim: Copy;

    fn part(&self, rect: &Rect<N>) -> Self::Part;
    fn rect(part: &Self::Part) -> Rect<N>;
    fn cut(&self, part: &Self::Part, dim: usize, at: f64) -> [Self::Part; 2];
    /// Sum of the radii of the balls that sweep the cores, m.
    fn sum(&self) -> f64;
    /// The least effective depth of a depth of one metre.
    fn least_gain(&self) -> f64;
    /// Extent of a part along each parameter, m.
    fn sizes(&self, part: &Self::Part) -> [f64; N];
    /// Lengths by which a step of one of each parameter moves at most, m.
    fn scales(&self) -> [f64; N];
    /// Minus the effective depth.
    fn eval(&self, z: &[f64; N]) -> Jet<N>;
    fn place(&self, z: [f64; N]) -> Place<N, Self::Aim>;
    /// A pair of points of the part that are near each other, close to the parameters `z` of the part.
    fn near(&self, part: &Self::Part, z: &[f64; N]) -> ([f64; N], f64, Self::Aim);
    /// By how much the part may be deeper than `target` (m, effective) as far as the separating
    /// function across `aim` can tell; not above zero: it is not.
    fn excess(
        &self,
        part: &Self::Part,
        aim: &Self::Aim,
        best: &Place<N, Self::Aim>,
        target: f64,
    ) -> f64;
    /// Whether nothing in `rect`, which holds the place, is deeper than it.
    fn is_alone(&self, rect: &Rect<N>, place: &Place<N, Self::Aim>) -> bool;
}

/// Cores nearer than this have no direction of their own, m.
const NO_GAP: f64 = 1e-9;

/// How far apart two cores are brought to follow a place through their meeting, m.
const LIFT_M: f64 = 0.02;
/// Rounds in which the direction settles, and how still it is then.
const MOST_TURNS: u32 = 12;
const STILL: f64 = 1e-10;

/// A pairing whose cores can be moved apart.
pub(crate) trait Lift<const N: usize>: Pairing<N> {
    /// The same with the first core moved off the second by `by`, m, against `normal` (first core's
    /// frame, first to second). Distances count from where it was.
    fn lifted(&self, normal: DVec3, by: f64) -> Self;
    /// A place's direction from the first core to the second, first core's frame.
    fn normal(&self, place: &Place<N, Self::Aim>) -> DVec3;
}

/// The place near `z` whose normal and depth (m) are about those given, also where the cores meet or have gone through
/// each other, with a distance below zero then.
///
/// There the nearest points have no direction. But with one core moved off along the normal the cores are
/// apart, and where the nearest points are then as far apart in *that* direction, they also were points of
/// stationary signed distance before: gap = d n, n across both cores.
pub(crate) fn follow<P: Lift<N>, const N: usize>(
    pairing: &P,
    rect: &Rect<N>,
    z: &[f64; N],
    (normal, depth): (DVec3, f64),
) -> Place<N, P::Aim> {
    let lift = LIFT_M + (depth - pairing.sum()).max(0.0);
    let (mut z, mut normal) = (*z, normal);
    let mut turns = 0;
    loop {
        let lifted = pairing.lifted(normal, lift);
        let (next, _) = minimise(z, [&rect.lo, &rect.hi], FEW_ROUNDS, |z| lifted.eval(z));
        let place = lifted.place(next);
        let there = lifted.normal(&place);
        turns += 1;
        if (there - normal).length() < STILL || turns == MOST_TURNS {
            return place;
        }
        (z, normal) = (next, there);
    }
}

#[cfg(test)]
mod tests {
    use docktwin_core::{DMat3, DQuat};
    use docktwin_model::PetalGeometry;

    use super::*;
    use crate::contact::{
        cells::OnPetal,
        geometry::{Circle, Sheet},
    };

    struct Draws(u64);

    impl Draws {
        fn within(&mut self, half: f64) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let bits = u32::try_from(self.0 >> 33).expect("31 bits");
            half * (2.0 * f64::from(bits) / f64::from(1u32 << 31) - 1.0)
        }

        fn pose(&mut self) -> (DMat3, DVec3) {
            let turn = [self.within(1.0), self.within(0.7), self.within(0.7)];
            let q = DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0);
            let tilt = DQuat::from_scaled_axis(DVec3::from_array(turn));
            let p = DVec3::new(0.15 + self.within(0.2), self.within(0.3), self.within(0.3));
            (DMat3::from_quat(tilt * q), p)
        }

        fn part<const N: usize>(&mut self, whole: &Rect<N>) -> Rect<N> {
            let share = 0.5f64.powi(3 + i32::from(self.within(1.0) > 0.0) * 2);
            let middle: [f64; N] = self.of(whole);
            let reach = |i: usize| share * (whole.hi[i] - whole.lo[i]);
            Rect {
                lo: core::array::from_fn(|i| (middle[i] - reach(i)).max(whole.lo[i])),
                hi: core::array::from_fn(|i| (middle[i] + reach(i)).min(whole.hi[i])),
            }
        }

        fn of<const N: usize>(&mut self, r: &Rect<N>) -> [f64; N] {
            core::array::from_fn(|i| {
                0.5 * (r.lo[i] + r.hi[i]) + self.within(0.5 * (r.hi[i] - r.lo[i]))
            })
        }
    }

    fn petal() -> Sheet {
        Sheet::new(&PetalGeometry {
            count: 3,
            first_azimuth_rad: 0.0,
            base_radius_m: 0.597,
            tip_radius_m: 0.410,
            height_m: 0.187,
            base_half_angle_rad: 28f64.to_radians(),
            tip_half_angle_rad: 14f64.to_radians(),
            thickness_m: 0.02,
            strips: 6,
            flexural_rigidity_n_m2: 1.6e4,
        })
    }

    /// What a separating direction or a curvature proves holds at every point looked at. Returns how often
    /// either proved something.
    fn proofs_hold<P: OnPetal<N>, const N: usize>(pairing: &P, draws: &mut Draws) -> [u32; 2] {
        let whole = pairing.over([-1.0, 1.0], [0.0, 1.0]);
        let rect = draws.part(&whole);
        let start = draws.of(&rect);
        let (z, _) = minimise(start, [&rect.lo, &rect.hi], FEW_ROUNDS, |z| pairing.eval(z));
        let place = pairing.place(z);
        let mut found = [0; 2];
        // Of a neighbourhood around the place.
        let mut size = 0.3;
        while size > 1e-3 {
            let scales = pairing.scales();
            let around = Rect {
                lo: core::array::from_fn(|i| (z[i] - size / scales[i]).max(rect.lo[i])),
                hi: core::array::from_fn(|i| (z[i] + size / scales[i]).min(rect.hi[i])),
            };
            if pairing.is_alone(&around, &place) {
                found[0] = 1;
                for _ in 0..200 {
                    let there = pairing.place(draws.of(&around));
                    let over = there.effective - place.effective;
                    assert!(over < 1e-12, "{over} m at {:?} around {z:?}", there.z);
                }
                break;
            }
            size *= 0.5;
        }
        // Of any part against any target.
        let other = draws.part(&whole);
        let part = pairing.part(&other);
        let (_, effective, aim) = pairing.near(&part, &other.middle());
        let target = effective + 0.01 * (1.0 + draws.within(1.0));
        if pairing.excess(&part, &aim, &place, target) <= 0.0 {
            found[1] = 1;
            for _ in 0..200 {
                let there = pairing.place(draws.of(&other));
                let over = there.effective - target;
                assert!(over < 1e-12, "{over} m at {:?} in {other:?}", there.z);
            }
        }
        found
    }

    #[test]
    fn invariant_what_is_proven_holds() {
        let sheet = petal();
        let circle = Circle { radius: 0.6, ball: 0.025 };
        let mut draws = Draws(7);
        let mut found = [[0; 2]; 2];
        for _ in 0..3000 {
            let (r, p) = draws.pose();
            let soft = |b: f64| Stiffness { a: 0.4, b, power: 0.5 };
            let ring = OnCircle { sheet: &sheet, circle, r, p, stiffness: soft(0.0), lift: 0.0 };
            let petals = OnSheet { a: &sheet, b: &sheet, r, p, stiffness: soft(0.4), lift: 0.0 };
            let both = [proofs_hold(&ring, &mut draws), proofs_hold(&petals, &mut draws)];
            for (all, one) in found.iter_mut().zip(both) {
                all.iter_mut().zip(one).for_each(|(a, o)| *a += o);
            }
        }
        println!("proofs by curvature and by separation, of 3000: {found:?}");
        assert!(found.iter().flatten().all(|n| *n > 300), "{found:?}");
    }
}
