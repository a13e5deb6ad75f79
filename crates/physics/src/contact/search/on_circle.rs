//! A petal against a ring: a rectangle of the petal's sheet against the whole circle.
//!
//! In the half-plane through the circle's axis and a point, with x along the axis and ρ from it, the
//! circle is one point: the distance is that of (x, ρ) from (0, R), a closed form.

use docktwin_core::{DMat3, DVec3};
use glam::DVec2;

use super::{
    AMPLE_M, Lift, NO_GAP, Pairing, Place, Rect, Stiffness,
    newton::{Jet, is_positive},
};
use crate::contact::{
    cells::OnPetal,
    geometry::{Circle, Jet as SheetJet, Patch, PatchAbout, Sheet, off_axis},
};

/// The pair, in the sheet's frame for what it gives back.
pub(crate) struct OnCircle<'a> {
    pub(crate) sheet: &'a Sheet,
    pub(crate) circle: Circle,
    /// The sheet's frame in the circle's.
    pub(crate) r: DMat3,
    pub(crate) p: DVec3,
    pub(crate) stiffness: Stiffness,
    /// By how much the sheet was moved off the circle, m (see [`super::follow`]).
    pub(crate) lift: f64,
}

/// Direction from the sheet to the circle: in the half-plane (x, ρ), and the half-plane's own (y, z).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aim {
    pub(crate) n: DVec2,
    pub(crate) e: DVec2,
}

/// How far the share of the curvature's lateral part is given up to remainders.
const GIVEN: f64 = 0.65;
/// Slopes of a place that count as zero, m per parameter.
const STATIONARY: f64 = 1e-9;

/// Derivatives of (x, ρ) along the sheet; those by s alone beyond the first come from ρ only.
struct Half {
    at: DVec2,
    /// First derivatives by u and s.
    first: [DVec2; 2],
    /// Components of the first derivatives around the axis.
    around: [f64; 2],
    /// Second derivatives uu, us of the point: in the half-plane, and around the axis.
    second: [(DVec2, f64); 2],
}

impl OnCircle<'_> {
    /// A vector of the sheet's frame: in the half-plane of `e`, and around the axis.
    fn split(&self, e: DVec2, v: DVec3) -> (DVec2, f64) {
        let v = self.r * v;
        (DVec2::new(v.x, e.x * v.y + e.y * v.z), v.z * e.x - v.y * e.y)
    }

    fn half(&self, j: &SheetJet) -> (Half, DVec2) {
        let x = self.r * j.p + self.p;
        let rho = off_axis(x).max(1e-12);
        let e = DVec2::new(x.y, x.z) / rho;
        let ((u, au), (s, a_s)) = (self.split(e, j.u), self.split(e, j.s));
        let half = Half {
            at: DVec2::new(x.x, rho),
            first: [u, s],
            around: [au, a_s],
            second: [self.split(e, j.uu), self.split(e, j.us)],
        };
        (half, e)
    }

    /// Distance and direction of a point of the sheet's frame.
    fn distance(&self, x: DVec3) -> (f64, Aim) {
        let x = self.r * x + self.p;
        let rho = off_axis(x).max(1e-12);
        let (d, n) = self.oriented(DVec2::new(-x.x, self.circle.radius - rho));
        (d, Aim { n, e: DVec2::new(x.y, x.z) / rho })
    }

    /// Distance and direction of a gap in the half-plane.
    fn oriented(&self, gap: DVec2) -> (f64, DVec2) {
        let d = gap.length();
        (d - self.lift, if d > NO_GAP { gap / d } else { DVec2::X })
    }
}

impl OnPetal<2> for OnCircle<'_> {
    fn over(&self, u: [f64; 2], s: [f64; 2]) -> Rect<2> {
        Rect { lo: [u[0], s[0]], hi: [u[1], s[1]] }
    }

    fn contact(&self, place: &Place<2, Aim>) -> (DVec3, DVec3) {
        let Aim { n, e } = place.aim;
        let normal = self.r.transpose() * DVec3::new(n.x, n.y * e.x, n.y * e.y);
        (self.sheet.at(place.z[0], place.z[1]), normal)
    }

    fn ball(&self) -> f64 {
        self.sheet.ball
    }
}

impl Pairing<2> for OnCircle<'_> {
    type Part = PatchAbout;
    type Aim = Aim;

    fn part(&self, rect: &Rect<2>) -> PatchAbout {
        let patch = Patch::new(self.sheet, [rect.lo[0], rect.hi[0]], [rect.lo[1], rect.hi[1]]);
        PatchAbout::new(patch, (&self.r, self.p))
    }

    fn rect(part: &PatchAbout) -> Rect<2> {
        let Patch { u, s, .. } = part.patch;
        Rect { lo: [u[0], s[0]], hi: [u[1], s[1]] }
    }

    fn cut(&self, part: &PatchAbout, dim: usize, at: f64) -> [PatchAbout; 2] {
        if dim == 0 { part.cut_u(self.sheet, (&self.r, self.p), at) } else { part.cut_s(at) }
    }

    fn sum(&self) -> f64 {
        self.sheet.ball + self.circle.ball
    }

    fn least_gain(&self) -> f64 {
        self.stiffness.least_gain()
    }

    fn sizes(&self, part: &PatchAbout) -> [f64; 2] {
        part.patch.sizes(self.sheet)
    }

    fn scales(&self) -> [f64; 2] {
        [self.sheet.reach.u[0], self.sheet.reach.s[0]]
    }

    fn eval(&self, z: &[f64; 2]) -> Jet<2> {
        let (h, _) = self.half(&self.sheet.jet(z[0], z[1]));
        let (d, n) = self.oriented(DVec2::new(-h.at.x, self.circle.radius - h.at.y));
        let per_d = 1.0 / (d + self.lift).max(NO_GAP);
        let across = DVec2::new(-n.y, n.x);
        let c = h.first.map(|v| across.dot(v));
        let bend = |i: usize, k: usize| c[i] * c[k] * per_d - n.dot(h.second(i, k));
        let mixed = bend(0, 1);
        let mut out = Jet {
            f: d - self.sum(),
            g: h.first.map(|v| -n.dot(v)),
            h: [[bend(0, 0), mixed], [mixed, bend(1, 1)]],
        };
        self.stiffness.weigh(&mut out, z, [1, usize::MAX]);
        out
    }

    fn place(&self, z: [f64; 2]) -> Place<2, Aim> {
        let (d, aim) = self.distance(self.sheet.at(z[0], z[1]));
        let depth = self.sum() - d;
        Place {
            z,
            effective: self.stiffness.effective(depth, z[1], 0.0),
            depth,
            softening: self.stiffness.softening(z[1], 0.0),
            aim,
        }
    }

    fn near(&self, _: &PatchAbout, z: &[f64; 2]) -> ([f64; 2], f64, Aim) {
        let (d, aim) = self.distance(self.sheet.at(z[0], z[1]));
        (*z, self.stiffness.effective(self.sum() - d, z[1], 0.0), aim)
    }

    fn excess(&self, part: &PatchAbout, aim: &Aim, best: &Place<2, Aim>, target: f64) -> f64 {
        let Aim { n, e } = *aim;
        let room = self.sum() - n.y * self.circle.radius;
        let w = &best.softening;
        // The depth in metres that makes the target at either end of the rulings.
        let deep = part.patch.s.map(|s| {
            if target <= 0.0 {
                target
            } else if self.stiffness.is_convex() {
                target * (w.inverse + w.slope[0] * (s - best.z[1]))
            } else {
                target * self.stiffness.softening(part.patch.s[0], 0.0).inverse
            }
        });
        // A circle outside is parted by a cone about its axis, one inside by a plane.
        let tops = if n.y > 0.0 {
            let enough = deep.map(|d| d - room - AMPLE_M);
            part.tops(self.sheet, (&self.r, self.p), n, enough)
        } else {
            let n = DVec3::new(n.x, n.y * e.x, n.y * e.y);
            let shift = n.dot(self.p);
            part.patch.tops(self.sheet, self.r.transpose() * n).map(|t| t + shift)
        };
        room + (tops[0] - deep[0]).max(tops[1] - deep[1])
    }

    fn is_alone(&self, rect: &Rect<2>, place: &Place<2, Aim>) -> bool {
        let j = self.sheet.jet(place.z[0], place.z[1]);
        let (h, e) = self.half(&j);
        let d = self.sum() - place.depth + self.lift;
        let n = place.aim.n;
        let far: [f64; 2] =
            core::array::from_fn(|i| (rect.hi[i] - place.z[i]).max(place.z[i] - rect.lo[i]));
        let over = place.depth.max(0.0) * place.softening.slope[0] / place.softening.inverse;
        let slope = [-n.dot(h.first[0]), -n.dot(h.first[1]) + over];
        let across = DVec2::new(-n.y, n.x);
        let c = h.first.map(|v| across.dot(v));
        let bend = |i: usize, k: usize| (1.0 - GIVEN) * c[i] * c[k] - d * n.dot(h.second(i, k));
        let mut m = [[bend(0, 0), bend(0, 1)], [0.0, bend(1, 1) - 2.0 * over * over]];
        let even = (m[0][0] / m[1][1]).max(0.0).sqrt().clamp(0.02, 1.0);
        let Some(rest) = Remainder::new(self, &h, [rect.lo[1], rect.hi[1]], far, even) else {
            return false;
        };
        let lateral = rest.lateral(&h, across);
        let cubic = rest.cubic(&h, n, [self.split(e, j.uuu).0, self.split(e, j.uus).0]);
        for i in 0..2 {
            m[i][i] -= lateral[i] + 2.0 * d * cubic[i];
            let held = held(i, &place.z, rect, slope[i]);
            if far[i] <= 0.0 {
                (m[0][1], m[i][i]) = (0.0, 1.0);
            } else if held < -STATIONARY {
                return false;
            } else {
                m[i][i] += 2.0 * d * held.max(0.0) / far[i];
            }
        }
        is_positive(m)
    }
}

impl Lift<2> for OnCircle<'_> {
    fn lifted(&self, normal: DVec3, by: f64) -> Self {
        Self { p: self.p - self.r * normal * by, lift: by, ..*self }
    }

    fn normal(&self, place: &Place<2, Aim>) -> DVec3 {
        self.contact(place).1
    }
}

/// How firmly a place is held in parameter `i`: the slope that keeps it at a side of the rectangle, or
/// minus the size of the slope, which should be zero, inside.
pub(super) fn held<const N: usize>(i: usize, z: &[f64; N], rect: &Rect<N>, slope: f64) -> f64 {
    if z[i] <= rect.lo[i] {
        slope
    } else if z[i] >= rect.hi[i] {
        -slope
    } else {
        -slope.abs()
    }
}

impl Half {
    /// Second derivative of (x, ρ): that of ρ is e·w + τ²/ρ, w the second derivative across the axis, τ the
    /// first one's turn around it.
    fn second(&self, i: usize, k: usize) -> DVec2 {
        let own = if i + k < 2 { self.second[i + k].0 } else { DVec2::ZERO };
        own + DVec2::Y * (self.around[i] * self.around[k] / self.at.y)
    }

    /// Third derivative of ρ but for the straight part:
    /// `Σ (t·w_ij) τ_k/ρ − Σ ρ_i τ_j τ_k/ρ²`, t around the axis, over the three ways to take one out.
    fn third(&self, [i, j, k]: [usize; 3]) -> f64 {
        let turn = |i: usize, k: usize| if i + k < 2 { self.second[i + k].1 } else { 0.0 };
        let (t, rho) = (&self.around, self.at.y);
        let climb = |i: usize| self.first[i].y;
        (turn(i, j) * t[k] + turn(i, k) * t[j] + turn(j, k) * t[i]) / rho
            - (climb(i) * t[j] * t[k] + climb(j) * t[i] * t[k] + climb(k) * t[i] * t[j])
                / (rho * rho)
    }
}

/// What Taylor's remainders of (x, ρ) may take from a quadratic form over steps of (u, s) up to `far`.
///
/// Terms of u alone are bounded by how (x, ρ) really moves along u ([`Sheet::change_about`]), which is little
/// where the petal lies along the ring. Mixed terms are bounded by sizes of derivatives of the point x:
/// `|x'| ≤ v₀ du + v₁ ds`, `|x''| ≤ w₀ du² + 2 w₁ du ds`, `|x'''| ≤ y₀ du³ + 3 y₁ du² ds`, and so on with
/// z. They go to the diagonal by `|du ds| ≤ (ε du² + ds²/ε)/2`.
struct Remainder {
    far: [f64; 2],
    /// Least distance from the axis.
    low: f64,
    /// Bounds of the third and fourth derivative of (x, ρ) by u.
    pure: [f64; 2],
    v: [f64; 2],
    w: [f64; 2],
    y: [f64; 2],
    z: [f64; 2],
    /// ε.
    even: f64,
}

impl Remainder {
    /// `None` where the axis is too near.
    fn new(
        pairing: &OnCircle<'_>,
        h: &Half,
        span: [f64; 2],
        far: [f64; 2],
        even: f64,
    ) -> Option<Self> {
        let k = &pairing.sheet.reach;
        let v = [k.u[0], k.s[0] + k.s[1] * far[0]];
        let low = h.at.y - v[0] * far[0] - v[1] * far[1];
        (low > 0.15 * pairing.circle.radius).then(|| Self {
            far,
            low,
            pure: pairing.sheet.change_about(span, (&pairing.r, pairing.p), low),
            v,
            w: [k.u[1], k.s[1]],
            y: [k.u[2], k.s[2]],
            z: [k.u[3], k.s[3]],
            even,
        })
    }

    /// Mixed terms of third order, `|x'''| + 3|x'||x''|/ρ + 1.2|x'|³/ρ²`: the factor of du² ds, and of ds²
    /// what remains.
    fn mixed_third(&self) -> [f64; 2] {
        let ([u, s], [v, l], [w, b]) = (self.far, self.v, self.w);
        let i = 1.0 / self.low;
        let one = 3.0 * self.y[1] + 3.0 * i * (2.0 * v * b + l * w) + 3.6 * i * i * v * v * l;
        let rest = 6.0 * i * l * b * u + 1.2 * i * i * (3.0 * v * l * l * u + l.powi(3) * s);
        [one, rest]
    }

    /// Mixed terms of fourth order,
    /// `|x''''| + (4|x'||x'''| + 3|x''|²)/ρ + 9.8|x''||x'|²/ρ² + 3|x'|⁴/ρ³`: the factor of du³ ds, and of
    /// ds² what remains.
    fn mixed_fourth(&self) -> [f64; 2] {
        let ([u, s], [v, l], [w, b], [y, c]) = (self.far, self.v, self.w, self.y);
        let i = 1.0 / self.low;
        let one = 4.0 * self.z[1]
            + i * (4.0 * (3.0 * v * c + l * y) + 12.0 * w * b)
            + 9.8 * i * i * (2.0 * w * v * l + 2.0 * b * v * v)
            + 12.0 * i.powi(3) * v.powi(3) * l;
        let rest = i * (12.0 * l * c * u * u + 12.0 * b * b * u * u)
            + 9.8 * i * i * (w * l * l * u * u + 4.0 * b * v * l * u * u + 2.0 * b * l * l * u * s)
            + 3.0 * i.powi(3) * l * l * (6.0 * v * v * u * u + 4.0 * v * l * u * s + l * l * s * s);
        [one, rest]
    }

    /// Puts `pure` du² + `mixed` du ds + `rest` ds² on the diagonal.
    fn diagonal(&self, pure: f64, mixed: f64, rest: f64) -> [f64; 2] {
        [pure + 0.5 * self.even * mixed, rest + 0.5 / self.even * mixed]
    }

    /// The step across the normal beyond its first order, squared: second derivatives as they are, and
    /// bounds of the third.
    fn lateral(&self, h: &Half, across: DVec2) -> [f64; 2] {
        let [u, s] = self.far;
        let c = |i: usize, k: usize| across.dot(h.second(i, k)).abs();
        let [one, rest] = self.mixed_third();
        let pure = 0.5 * c(0, 0) + self.pure[0] * u / 6.0;
        let mixed = c(0, 1) + one * u / 6.0;
        let rest = 0.5 * c(1, 1) + rest / 6.0;
        let most = pure * u * u + mixed * u * s + rest * s * s;
        self.diagonal(pure, mixed, rest).map(|x| x * most * (1.0 / GIVEN - 1.0))
    }

    /// Along the normal the third order as it is, `straight` being x''' by uuu and uus, and bounds of the
    /// fourth.
    fn cubic(&self, h: &Half, n: DVec2, straight: [DVec2; 2]) -> [f64; 2] {
        let [u, s] = self.far;
        let c = |i: [usize; 3], own: f64| (own + n.y * h.third(i)).abs();
        let [one, rest] = self.mixed_fourth();
        let pure = c([0, 0, 0], n.dot(straight[0])) * u / 6.0 + self.pure[1] * u * u / 24.0;
        let mixed = c([0, 0, 1], n.dot(straight[1])) * u / 2.0 + one * u * u / 24.0;
        let rest = c([0, 1, 1], 0.0) * u / 2.0 + c([1, 1, 1], 0.0) * s / 6.0 + rest / 24.0;
        self.diagonal(pure, mixed, rest)
    }
}
