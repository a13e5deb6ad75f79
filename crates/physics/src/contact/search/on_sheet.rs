//! A petal against a petal: a rectangle of one sheet against the whole of another.

#![expect(clippy::needless_range_loop, reason = "vectors and matrices by their indices")]

use docktwin_core::{DMat3, DVec3};

use super::{
    Lift, NO_GAP, Pairing, Place, Rect, Stiffness,
    newton::{Jet, is_positive},
    on_circle::held,
};
use crate::contact::{
    cells::OnPetal,
    geometry::{Jet as SheetJet, Patch, Sheet, nearest_on_pieces},
};

/// The pair, in the first sheet's frame. Parameters: u, s of the first, v, t of the second.
pub(crate) struct OnSheet<'a> {
    pub(crate) a: &'a Sheet,
    pub(crate) b: &'a Sheet,
    /// The second sheet's frame in the first's.
    pub(crate) r: DMat3,
    pub(crate) p: DVec3,
    pub(crate) stiffness: Stiffness,
    /// By how much the second sheet was moved off the first, m (see [`super::follow`]).
    pub(crate) lift: f64,
}

const GIVEN: f64 = 0.65;
const CORNER_STEPS: usize = 4;
const STATIONARY: f64 = 1e-9;

impl OnSheet<'_> {
    /// Distance and direction of a gap.
    fn oriented(&self, gap: DVec3) -> (f64, DVec3) {
        let d = gap.length();
        (d - self.lift, if d > NO_GAP { gap / d } else { DVec3::X })
    }

    fn gap(&self, z: &[f64; 4]) -> DVec3 {
        self.r * self.b.at(z[2], z[3]) + self.p - self.a.at(z[0], z[1])
    }

    /// Vector from the first point to the second, and its first derivatives.
    fn first(&self, a: &SheetJet, b: &SheetJet) -> (DVec3, [DVec3; 4]) {
        let gap = self.r * b.p + self.p - a.p;
        (gap, [-a.u, -a.s, self.r * b.u, self.r * b.s])
    }

    /// Adds `factor` n·x'' of the vector between the points to the upper half of `h`.
    fn bend(&self, h: &mut [[f64; 4]; 4], (a, b): (&SheetJet, &SheetJet), n: DVec3, factor: f64) {
        let n_b = self.r.transpose() * n;
        h[0][0] -= factor * n.dot(a.uu);
        h[0][1] -= factor * n.dot(a.us);
        h[2][2] += factor * n_b.dot(b.uu);
        h[2][3] += factor * n_b.dot(b.us);
    }
}

impl OnPetal<4> for OnSheet<'_> {
    fn over(&self, u: [f64; 2], s: [f64; 2]) -> Rect<4> {
        Rect { lo: [u[0], s[0], -1.0, 0.0], hi: [u[1], s[1], 1.0, 1.0] }
    }

    fn contact(&self, place: &Place<4, DVec3>) -> (DVec3, DVec3) {
        (self.a.at(place.z[0], place.z[1]), place.aim)
    }

    fn ball(&self) -> f64 {
        self.a.ball
    }
}

impl Pairing<4> for OnSheet<'_> {
    type Part = [Patch; 2];
    type Aim = DVec3;

    fn part(&self, r: &Rect<4>) -> [Patch; 2] {
        [
            Patch::new(self.a, [r.lo[0], r.hi[0]], [r.lo[1], r.hi[1]]),
            Patch::new(self.b, [r.lo[2], r.hi[2]], [r.lo[3], r.hi[3]]),
        ]
    }

    fn rect([a, b]: &[Patch; 2]) -> Rect<4> {
        Rect { lo: [a.u[0], a.s[0], b.u[0], b.s[0]], hi: [a.u[1], a.s[1], b.u[1], b.s[1]] }
    }

    fn cut(&self, [a, b]: &[Patch; 2], dim: usize, at: f64) -> [[Patch; 2]; 2] {
        match dim {
            0 => a.cut_u(self.a, at).map(|a| [a, *b]),
            1 => a.cut_s(at).map(|a| [a, *b]),
            2 => b.cut_u(self.b, at).map(|b| [*a, b]),
            _ => b.cut_s(at).map(|b| [*a, b]),
        }
    }

    fn sum(&self) -> f64 {
        self.a.ball + self.b.ball
    }

    fn least_gain(&self) -> f64 {
        self.stiffness.least_gain()
    }

    fn sizes(&self, [a, b]: &[Patch; 2]) -> [f64; 4] {
        let (a, b) = (a.sizes(self.a), b.sizes(self.b));
        [a[0], a[1], b[0], b[1]]
    }

    fn scales(&self) -> [f64; 4] {
        [self.a.reach.u[0], self.a.reach.s[0], self.b.reach.u[0], self.b.reach.s[0]]
    }

    fn eval(&self, z: &[f64; 4]) -> Jet<4> {
        let (a, b) = (self.a.jet(z[0], z[1]), self.b.jet(z[2], z[3]));
        let (gap, first) = self.first(&a, &b);
        let (d, n) = self.oriented(gap);
        let per_d = 1.0 / (d + self.lift).max(NO_GAP);
        let along = first.map(|v| v.dot(n));
        let mut h = [[0.0; 4]; 4];
        for i in 0..4 {
            for k in i..4 {
                h[i][k] = (first[i].dot(first[k]) - along[i] * along[k]) * per_d;
            }
        }
        self.bend(&mut h, (&a, &b), n, 1.0);
        for i in 0..4 {
            for k in 0..i {
                h[i][k] = h[k][i];
            }
        }
        let mut out = Jet { f: d - self.sum(), g: along, h };
        self.stiffness.weigh(&mut out, z, [1, 3]);
        out
    }

    fn place(&self, z: [f64; 4]) -> Place<4, DVec3> {
        let (d, n) = self.oriented(self.gap(&z));
        let depth = self.sum() - d;
        Place {
            z,
            effective: self.stiffness.effective(depth, z[1], z[3]),
            depth,
            softening: self.stiffness.softening(z[1], z[3]),
            aim: n,
        }
    }

    /// The nearest points of the rulings at `z[0]` and `z[2]`, as far as the part goes.
    fn near(&self, [a, b]: &[Patch; 2], z: &[f64; 4]) -> ([f64; 4], f64, DVec3) {
        let [base, tip] = self.a.ends(z[0]);
        let first = (base, tip - base, a.s);
        let [base, tip] = self.b.ends(z[2]);
        let second = (self.r * base + self.p, self.r * (tip - base), b.s);
        let (s, t, gap) = nearest_on_pieces(first, second);
        let effective = self.stiffness.effective(self.sum() - gap.length(), s, t);
        ([z[0], s, z[2], t], effective, self.across([a, b], gap))
    }

    fn excess(&self, [a, b]: &[Patch; 2], n: &DVec3, best: &Place<4, DVec3>, target: f64) -> f64 {
        let tops = [a.tops(self.a, *n), b.tops(self.b, -(self.r.transpose() * *n))];
        let room = self.sum() - n.dot(self.p);
        let highest = |t: [f64; 2]| t[0].max(t[1]);
        if target <= 0.0 {
            return room + highest(tops[0]) + highest(tops[1]) - target;
        }
        let w = &best.softening;
        if !self.stiffness.is_convex() {
            let least = self.stiffness.softening(a.s[0], b.s[0]).inverse;
            return room + highest(tops[0]) + highest(tops[1]) - target * least;
        }
        let over = |i: usize, patch: &Patch, at: f64| {
            let one = |e: usize| tops[i][e] - target * w.slope[i] * (patch.s[e] - at);
            one(0).max(one(1))
        };
        room + over(0, a, best.z[1]) + over(1, b, best.z[3]) - target * w.inverse
    }

    fn is_alone(&self, rect: &Rect<4>, place: &Place<4, DVec3>) -> bool {
        let z = &place.z;
        let jets = (self.a.jet(z[0], z[1]), self.b.jet(z[2], z[3]));
        let (_, first) = self.first(&jets.0, &jets.1);
        let n = place.aim;
        let d = self.sum() - place.depth + self.lift;
        let far: [f64; 4] = core::array::from_fn(|i| (rect.hi[i] - z[i]).max(z[i] - rect.lo[i]));
        let w = &place.softening;
        let over = w.slope.map(|x| place.depth.max(0.0) * x / w.inverse);
        let mut slope = first.map(|v| v.dot(n));
        let lateral = core::array::from_fn::<_, 4, _>(|i| first[i] - n * slope[i]);
        slope[1] += over[0];
        slope[3] += over[1];
        let mut m = [[0.0; 4]; 4];
        for i in 0..4 {
            for k in i..4 {
                m[i][k] = (1.0 - GIVEN) * lateral[i].dot(lateral[k]);
            }
        }
        self.bend(&mut m, (&jets.0, &jets.1), n, d);
        let taken = self.remainders((&jets.0, &jets.1), n, far, d);
        m[1][1] -= 2.0 * over[0] * over[0];
        m[3][3] -= 2.0 * over[1] * over[1];
        for i in 0..4 {
            let held = held(i, z, rect, slope[i]);
            if far[i] <= 0.0 {
                for k in 0..4 {
                    m[i.min(k)][i.max(k)] = 0.0;
                }
                m[i][i] = 1.0;
            } else if held < -STATIONARY {
                return false;
            } else {
                m[i][i] += 2.0 * d * held.max(0.0) / far[i] - taken[i];
            }
        }
        is_positive(m)
    }
}

impl Lift<4> for OnSheet<'_> {
    fn lifted(&self, normal: DVec3, by: f64) -> Self {
        Self { p: self.p + normal * by, lift: by, ..*self }
    }

    fn normal(&self, place: &Place<4, DVec3>) -> DVec3 {
        place.aim
    }
}

impl OnSheet<'_> {
    /// Direction across two flat patches: from a vector between them toward the shortest, by steps to
    /// the corners that lie farthest against it (Frank and Wolfe).
    fn across(&self, [a, b]: [&Patch; 2], gap: DVec3) -> DVec3 {
        let mut gap = gap;
        for _ in 0..CORNER_STEPS {
            let corner = self.r * b.corner(-(self.r.transpose() * gap)) + self.p - a.corner(gap);
            let d = corner - gap;
            let t = -gap.dot(d) / d.length_squared().max(1e-30);
            if t <= 0.0 {
                break;
            }
            gap += d * t.min(1.0);
        }
        gap.normalize_or(DVec3::X)
    }

    /// What second- and third-order remainders of both sheets may take from the quadratic form over the
    /// steps `far`, on its diagonal.
    fn remainders(
        &self,
        (a, b): (&SheetJet, &SheetJet),
        n: DVec3,
        far: [f64; 4],
        d: f64,
    ) -> [f64; 4] {
        // x(u + du, s + ds) − x − x_u du − x_s ds = x_us du ds + ½ x_uu du² + third order; across the
        // normal its square counts, along it the third order as it is and the fourth at most.
        let sides = [(self.a, a, n, 0), (self.b, b, self.r.transpose() * n, 2)];
        let across = |v: DVec3, n: DVec3| (v - n * n.dot(v)).length();
        let mut second = 0.0;
        let parts = sides.map(|(sheet, j, n, i)| {
            let (k, du, ds) = (&sheet.reach, far[i], far[i + 1]);
            let (twist, bend) = (across(j.us, n), across(j.uu, n));
            let third = k.u[2] * du / 6.0 + 0.5 * k.s[2] * ds;
            second += (0.5 * bend + third) * du * du + twist * du * ds;
            let cubic = n.dot(j.uus).abs() * ds + n.dot(j.uuu).abs() * du / 3.0;
            let fourth = k.u[3] * du * du / 12.0 + k.s[3] * du * ds / 3.0;
            (0.5 * bend + third + 0.5 * twist, 0.5 * twist, cubic + fourth)
        });
        let lateral = second * (1.0 / GIVEN - 1.0);
        let mut taken = [0.0; 4];
        for ((on_u, on_s, along), i) in parts.into_iter().zip([0, 2]) {
            taken[i] = lateral * on_u + d * along;
            taken[i + 1] = lateral * on_s;
        }
        taken
    }
}
