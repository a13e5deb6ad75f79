//! The mid-surface of a petal: straight rulings between an arc at the base and an arc at the tip.
//!
//! A sheet has a frame of its own, the ring frame turned about X so that the petal's middle is at
//! azimuth zero. Its parameters are −1 ≤ u ≤ 1 across the rulings and 0 ≤ s ≤ 1 along them:
//! `x(u, s) = (1 − s) base(u) + s tip(u)`.

use core::cell::Cell;

use docktwin_core::{DMat3, DVec3};
use docktwin_model::PetalGeometry;
use glam::DVec2;

/// One arc that bounds the sheet: at height `x`, of `radius`, over azimuths ±`half`.
#[derive(Clone, Copy, Debug)]
struct Arc {
    x: f64,
    radius: f64,
    half: f64,
}

impl Arc {
    fn at(&self, u: f64) -> DVec3 {
        let (s, c) = sin_cos_small(u * self.half);
        DVec3::new(self.x, self.radius * c, self.radius * s)
    }

    /// First derivative by u at a point of the arc.
    fn first(&self, p: DVec3) -> DVec3 {
        DVec3::new(0.0, -p.z, p.y) * self.half
    }

    /// Second derivative by u at a point of the arc.
    fn second(&self, p: DVec3) -> DVec3 {
        DVec3::new(0.0, p.y, p.z) * -(self.half * self.half)
    }

    /// Length of the k-th derivative by u, the same at every u.
    fn size(&self, k: i32) -> f64 {
        self.radius * self.half.powi(k)
    }
}

/// A petal's mid-surface, in its own frame.
#[derive(Clone, Debug)]
pub(crate) struct Sheet {
    base: Arc,
    tip: Arc,
    /// Radius of the ball that sweeps it, m.
    pub(crate) ball: f64,
    /// Compliance of the tip as a cantilever of the middle ruling's length L, L³/(3EI), m/N.
    pub(crate) tip_compliance: f64,
    pub(crate) reach: Reach,
    /// First to fourth.
    powers: [Powers; 4],
}

/// One power of the half angles of base and tip: their own, of twice them, of their difference and of their sum.
#[derive(Clone, Copy, Debug)]
struct Powers {
    own: [f64; 2],
    twice: [f64; 2],
    difference: f64,
    sum: f64,
}

impl Powers {
    fn new([a, b]: [f64; 2], k: i32) -> Self {
        Self {
            own: [a.powi(k), b.powi(k)],
            twice: [(2.0 * a).powi(k), (2.0 * b).powi(k)],
            difference: (a - b).abs().powi(k),
            sum: (a + b).powi(k),
        }
    }
}

/// Bounds of derivatives over a whole sheet, m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    /// Those by u: first, second, third, fourth.
    pub(crate) u: [f64; 4],
    /// The change of those along a ruling, and of the point itself: its length, then first to third.
    pub(crate) s: [f64; 4],
}

/// A point of the sheet with its derivatives; those by s alone beyond the first vanish.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jet {
    pub(crate) p: DVec3,
    pub(crate) u: DVec3,
    pub(crate) s: DVec3,
    pub(crate) uu: DVec3,
    pub(crate) us: DVec3,
    pub(crate) uuu: DVec3,
    pub(crate) uus: DVec3,
}

impl Sheet {
    pub(crate) fn new(g: &PetalGeometry) -> Self {
        let base = Arc { x: 0.0, radius: g.base_radius_m, half: g.base_half_angle_rad };
        let tip = Arc { x: g.height_m, radius: g.tip_radius_m, half: g.tip_half_angle_rad };
        let length = (tip.at(0.0) - base.at(0.0)).length();
        let larger = |k: i32| base.size(k).max(tip.size(k));
        // The difference of two arrows of given lengths is longest at the widest angle between them.
        let apart = (base.half - tip.half).cos();
        let change = |k: i32| {
            let (b, t) = (base.size(k), tip.size(k));
            (b * b + t * t - 2.0 * b * t * apart).max(0.0).sqrt()
        };
        Self {
            base,
            tip,
            ball: 0.5 * g.thickness_m,
            tip_compliance: length.powi(3) / (3.0 * g.flexural_rigidity_n_m2),
            reach: Reach {
                u: [larger(1), larger(2), larger(3), larger(4)],
                s: [(tip.at(1.0) - base.at(1.0)).length(), change(1), change(2), change(3)],
            },
            powers: [1, 2, 3, 4].map(|k| Powers::new([base.half, tip.half], k)),
        }
    }

    /// Ends of the ruling at `u`: base, tip.
    pub(crate) fn ends(&self, u: f64) -> [DVec3; 2] {
        [self.base.at(u), self.tip.at(u)]
    }

    pub(crate) fn at(&self, u: f64, s: f64) -> DVec3 {
        let [b, t] = self.ends(u);
        b + (t - b) * s
    }

    pub(crate) fn jet(&self, u: f64, s: f64) -> Jet {
        let [b, t] = self.ends(u);
        let (b1, t1) = (self.base.first(b), self.tip.first(t));
        let (b2, t2) = (self.base.second(b), self.tip.second(t));
        let (b3, t3) = (self.base.second(b1), self.tip.second(t1));
        Jet {
            p: b + (t - b) * s,
            u: b1 + (t1 - b1) * s,
            s: t - b,
            uu: b2 + (t2 - b2) * s,
            uuu: b3 + (t3 - b3) * s,
            us: t1 - b1,
            uus: t2 - b2,
        }
    }

    /// Middle and radius of a ball that holds the sheet without its thickness.
    pub(crate) fn ball_around(&self) -> (DVec3, f64) {
        let centre = self.at(0.0, 0.5);
        // On every line of the patch the farthest point is an end; the arcs bulge away from the axis.
        let corners = [(-1.0, 0.0), (0.0, 0.0), (-1.0, 1.0), (0.0, 1.0)];
        let radius =
            corners.iter().map(|(u, s)| (self.at(*u, *s) - centre).length()).fold(0.0, f64::max);
        (centre, radius)
    }
}

/// A rectangle of a sheet's parameters, with the ends of its two outer rulings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patch {
    pub(crate) u: [f64; 2],
    pub(crate) s: [f64; 2],
    /// `[base, tip]` of the rulings at `u[0]` and at `u[1]`.
    ends: [[DVec3; 2]; 2],
}

impl Patch {
    pub(crate) fn new(sheet: &Sheet, u: [f64; 2], s: [f64; 2]) -> Self {
        Self { u, s, ends: [sheet.ends(u[0]), sheet.ends(u[1])] }
    }

    /// The parts before and after `at`, cut across u.
    pub(crate) fn cut_u(&self, sheet: &Sheet, at: f64) -> [Self; 2] {
        let ends = sheet.ends(at);
        let (mut low, mut high) = (*self, *self);
        (low.u[1], low.ends[1]) = (at, ends);
        (high.u[0], high.ends[0]) = (at, ends);
        [low, high]
    }

    /// The parts before and after `at`, cut across s.
    pub(crate) fn cut_s(&self, at: f64) -> [Self; 2] {
        let (mut low, mut high) = (*self, *self);
        (low.s[1], high.s[0]) = (at, at);
        [low, high]
    }

    /// Extent across and along, m.
    pub(crate) fn sizes(&self, sheet: &Sheet) -> [f64; 2] {
        let across = |s: f64| {
            let b = sheet.base.size(1);
            b + (sheet.tip.size(1) - b) * s
        };
        let wide = across(self.s[0]).max(across(self.s[1]));
        [wide * (self.u[1] - self.u[0]), sheet.reach.s[0] * (self.s[1] - self.s[0])]
    }

    /// The corner that is farthest along n.
    pub(crate) fn corner(&self, n: DVec3) -> DVec3 {
        let mut best = (f64::NEG_INFINITY, DVec3::ZERO);
        for [b, t] in self.ends {
            for s in self.s {
                let x = b + (t - b) * s;
                let d = n.dot(x);
                if d > best.0 {
                    best = (d, x);
                }
            }
        }
        best.1
    }

    /// Bounds from above of n·x on the patch's edges at `s[0]` and at `s[1]`. Between them n·x is
    /// linear along every ruling, so it is bounded by the line between these bounds.
    pub(crate) fn tops(&self, sheet: &Sheet, n: DVec3) -> [f64; 2] {
        let h2 = (self.u[1] - self.u[0]).powi(2);
        let rim = off_axis(n);
        let rise = n.x * sheet.tip.x;
        let at = |arc: &Arc, end: usize| {
            let g = [self.ends[0][end], self.ends[1][end]].map(|p| n.y * p.y + n.z * p.z);
            // An arc's part of n·x is a cosine: its second derivative is −half² times itself.
            let half2 = arc.half * arc.half;
            let top = g[0].max(g[1]) + arc.radius * rim * half2 * h2 * 0.125;
            (g, half2 * top)
        };
        let ((b, kb), (t, kt)) = (at(&sheet.base, 0), at(&sheet.tip, 1));
        self.s.map(|s| {
            let mix = |b: f64, t: f64| b + (t - b) * s;
            chord(mix(b[0], t[0]), mix(b[1], t[1]), mix(kb, kt) * h2) + rise * s
        })
    }
}

/// A patch about the X axis of another frame: its points as (x, ρ), ρ the distance from that axis. What bounds
/// in any direction need is worked out once.
#[derive(Clone, Debug)]
pub(crate) struct PatchAbout {
    pub(crate) patch: Patch,
    /// Ends of the patch's outer rulings in the other frame.
    ends: [[DVec3; 2]; 2],
    edges: [EdgeAbout; 2],
}

/// One edge of constant s: (x, ρ) of its two corners, and how it bends once that was asked for.
#[derive(Clone, Debug)]
struct EdgeAbout {
    corners: [DVec2; 2],
    bend: Cell<Option<BendAbout>>,
}

/// Second derivative of (x, ρ) by u in the middle of an edge, and by how much it can change to either end.
#[derive(Clone, Copy, Debug)]
struct BendAbout {
    middle: DVec2,
    change: f64,
}

impl EdgeAbout {
    fn new(ends: &[[DVec3; 2]; 2], s: f64) -> Self {
        let corners = ends.map(|[b, t]| {
            let x = b + (t - b) * s;
            DVec2::new(x.x, off_axis(x))
        });
        Self { corners, bend: Cell::new(None) }
    }
}

impl PatchAbout {
    /// (r, p) takes the sheet's frame into the other.
    pub(crate) fn new(patch: Patch, (r, p): (&DMat3, DVec3)) -> Self {
        let ends = patch.ends.map(|e| e.map(|x| *r * x + p));
        let edges = patch.s.map(|s| EdgeAbout::new(&ends, s));
        Self { patch, ends, edges }
    }

    /// The parts before and after `at`, cut across u.
    pub(crate) fn cut_u(&self, sheet: &Sheet, (r, p): (&DMat3, DVec3), at: f64) -> [Self; 2] {
        let [low, high] = self.patch.cut_u(sheet, at);
        let middle = low.ends[1].map(|x| *r * x + p);
        let part = |patch: Patch, ends: [[DVec3; 2]; 2]| Self {
            edges: patch.s.map(|s| EdgeAbout::new(&ends, s)),
            patch,
            ends,
        };
        [part(low, [self.ends[0], middle]), part(high, [middle, self.ends[1]])]
    }

    /// The parts before and after `at`, cut across s.
    pub(crate) fn cut_s(&self, at: f64) -> [Self; 2] {
        let [low, high] = self.patch.cut_s(at);
        let middle = EdgeAbout::new(&self.ends, at);
        let [first, second] = self.edges.clone();
        [
            Self { patch: low, ends: self.ends, edges: [first, middle.clone()] },
            Self { patch: high, ends: self.ends, edges: [middle, second] },
        ]
    }

    /// As [`Patch::tops`], of `m.x·x + m.y·ρ`; m is a unit vector, m.y ≥ 0. Convex along every ruling. A
    /// bound below `enough` is not made tighter.
    pub(crate) fn tops(
        &self,
        sheet: &Sheet,
        x: (&DMat3, DVec3),
        m: DVec2,
        enough: [f64; 2],
    ) -> [f64; 2] {
        let h = self.patch.u[1] - self.patch.u[0];
        core::array::from_fn(|i| {
            let (s, edge) = (self.patch.s[i], &self.edges[i]);
            let g = edge.corners.map(|c| m.dot(c));
            let k = sheet.base.size(2) * (1.0 - s) + sheet.tip.size(2) * s;
            let top = chord(g[0], g[1], k * h * h);
            if (g[1] - g[0]).abs() >= 0.5 * k * h * h || top <= enough[i] {
                return top;
            }
            let bend = edge.bend.get().unwrap_or_else(|| {
                let bend = self.bend(sheet, x, s);
                edge.bend.set(Some(bend));
                bend
            });
            // How fast the slope along the edge can fall.
            let fall = (0.5 * h * bend.change - m.dot(bend.middle)).max(0.0);
            chord(g[0], g[1], k.min(fall) * h * h)
        })
    }

    fn bend(&self, sheet: &Sheet, (r, p): (&DMat3, DVec3), s: f64) -> BendAbout {
        let [low, high] = self.patch.u;
        let j = sheet.jet(0.5 * (low + high), s);
        let (x, d1, d2) = (*r * j.p + p, *r * j.u, *r * j.uu);
        let rho = off_axis(x);
        let nearest = rho - 0.5 * (high - low) * sheet.reach.u[0];
        if nearest < 0.1 * rho {
            return BendAbout { middle: DVec2::ZERO, change: f64::INFINITY };
        }
        let e = DVec2::new(x.y, x.z) / rho;
        let around = d1.z * e.x - d1.y * e.y;
        let middle = DVec2::new(d2.x, around * around / rho + e.x * d2.y + e.y * d2.z);
        let change = sheet.third_about(s, (r, p), nearest);
        BendAbout { middle, change }
    }
}

/// The sheet's arcs about the X axis of another frame: what bounds of derivatives by u are made of.
struct ArcsAbout<'a> {
    sheet: &'a Sheet,
    /// Radii of the arcs by their shares of a ruling's point.
    radii: [f64; 2],
    /// Largest distance of the arcs' axis from the other, as the other's (y, z) see it.
    offset: f64,
    even: f64,
    odd: f64,
    rise: f64,
}

impl<'a> ArcsAbout<'a> {
    fn new(sheet: &'a Sheet, span: [f64; 2], (r, p): (&DMat3, DVec3)) -> Self {
        let off = |v: DVec3| DVec2::new(v.y, v.z);
        let (y, z) = (off(r.y_axis), off(r.z_axis));
        let (base, tip) = (sheet.base.x, sheet.tip.x);
        let offset = |s: f64| {
            let centre = off(p + r.x_axis * (base + (tip - base) * s));
            DVec2::new(centre.dot(y), centre.dot(z)).length_squared()
        };
        let widest =
            if span[0] < span[1] { offset(span[0]).max(offset(span[1])) } else { offset(span[0]) };
        let (yy, zz) = (y.length_squared(), z.length_squared());
        Self {
            sheet,
            radii: [sheet.base.radius * (1.0 - span[0]), sheet.tip.radius * span[1]],
            offset: widest.sqrt(),
            even: 0.5 * (yy + zz),
            odd: DVec2::new(0.5 * (yy - zz), y.dot(z)).length(),
            rise: DVec2::new(r.y_axis.x, r.z_axis.x).length(),
        }
    }

    /// Size of the k-th derivative of ρ²: a sum of cosines of u.
    fn of_square(&self, k: usize) -> f64 {
        let ([a, b], p) = (self.radii, &self.sheet.powers[k - 1]);
        2.0 * self.offset * (a * p.own[0] + b * p.own[1])
            + self.odd * (a * a * p.twice[0] + b * b * p.twice[1])
            + 2.0 * a * b * (self.even * p.difference + self.odd * p.sum)
    }

    /// Of (x, ρ), `of_root` being that of ρ.
    fn whole(&self, k: usize, of_root: f64) -> f64 {
        let ([a, b], p) = (self.radii, &self.sheet.powers[k - 1]);
        DVec2::new(of_root, self.rise * (a * p.own[0] + b * p.own[1])).length()
    }
}

impl Sheet {
    /// Bounds of the third and fourth derivative by u of (x, ρ) wherever s is in `span`, at least `nearest` from
    /// the axis. The squared distance from the axis is a sum of cosines of u; where the axes nearly agree
    /// all of them are small.
    pub(crate) fn change_about(
        &self,
        span: [f64; 2],
        x: (&DMat3, DVec3),
        nearest: f64,
    ) -> [f64; 2] {
        let arcs = ArcsAbout::new(self, span, x);
        let q = [1, 2, 3, 4].map(|k| arcs.of_square(k));
        let [third, fourth] = root_derivatives(q, nearest);
        [arcs.whole(3, third), arcs.whole(4, fourth)]
    }

    /// The first of [`Sheet::change_about`] on one edge.
    fn third_about(&self, s: f64, x: (&DMat3, DVec3), nearest: f64) -> f64 {
        let arcs = ArcsAbout::new(self, [s, s], x);
        let [q1, q2, q3] = [1, 2, 3].map(|k| arcs.of_square(k));
        arcs.whole(3, root_third([q1, q2, q3], nearest))
    }
}

/// Bound of the third derivative of a root, as [`root_derivatives`].
fn root_third([q1, q2, q3]: [f64; 3], least: f64) -> f64 {
    let i = 1.0 / least;
    let i3 = i * i * i;
    0.5 * i * q3 + i3 * q1 * (0.75 * q2 + 0.375 * i * i * q1 * q1)
}

/// Bounds of the third and fourth derivative of a root, from those of the first to fourth of what is under
/// it, by Faà di Bruno; the root is at least `least`.
pub(crate) fn root_derivatives([q1, q2, q3, q4]: [f64; 4], least: f64) -> [f64; 2] {
    let i = 1.0 / least;
    let third = root_third([q1, q2, q3], least);
    let fourth = 0.5 * i * q4
        + 0.25 * i.powi(3) * (4.0 * q1 * q3 + 3.0 * q2 * q2)
        + 2.25 * i.powi(5) * q1 * q1 * q2
        + 0.9375 * i.powi(7) * q1.powi(4);
    [third, fourth]
}

/// Distance from the X axis.
pub(crate) fn off_axis(x: DVec3) -> f64 {
    (x.y * x.y + x.z * x.z).sqrt()
}

/// Highest value on an interval of a function with values `g0`, `g1` at the ends whose second
/// derivative is nowhere below −k, `k` times the square of the interval's length.
pub(crate) fn chord(g0: f64, g1: f64, k: f64) -> f64 {
    let d = g1 - g0;
    if d.abs() >= 0.5 * k { g0.max(g1) } else { 0.5 * (g0 + g1) + 0.125 * k + d * d / (2.0 * k) }
}

/// A piece of a straight line: `a + s d` with s in `range`.
pub(crate) type Piece = (DVec3, DVec3, [f64; 2]);

/// Parameters of the nearest points of two pieces of lines, and the vector from the first to the
/// second.
pub(crate) fn nearest_on_pieces(a: Piece, b: Piece) -> (f64, f64, DVec3) {
    let ((p, d, sr), (q, e, tr)) = (a, b);
    let r = p - q;
    let (dd, de, ee) = (d.dot(d), d.dot(e), e.dot(e));
    let (f, g) = (d.dot(r), e.dot(r));
    let det = dd * ee - de * de;
    // Lines that are as good as parallel: any start will do, the clamps find an end.
    let free = if det > 1e-12 * dd * ee { (de * g - ee * f) / det } else { 0.5 * (sr[0] + sr[1]) };
    let mut s = free.clamp(sr[0], sr[1]);
    let mut t = (de * s + g) / ee;
    if t < tr[0] || t > tr[1] {
        t = t.clamp(tr[0], tr[1]);
        s = ((de * t - f) / dd).clamp(sr[0], sr[1]);
    }
    (s, t, q + e * t - p - d * s)
}

/// Sine and cosine by their series, to rounding for |x| ≤ 0.7; the library's beyond.
fn sin_cos_small(x: f64) -> (f64, f64) {
    if x.abs() > 0.7 {
        return x.sin_cos();
    }
    const SIN: [f64; 8] = taylor(1);
    const COS: [f64; 9] = taylor(0);
    let y = x * x;
    let sum = |c: &[f64]| c.iter().rev().fold(0.0, |sum, c| sum * y + c);
    (x * sum(&SIN), sum(&COS))
}

/// Coefficients (−1)^k/(2k + first)!.
const fn taylor<const N: usize>(first: u32) -> [f64; N] {
    let mut out = [1.0; N];
    let mut k = 1;
    while k < N {
        let m = (2 * k) as f64 + first as f64;
        out[k] = -out[k - 1] / (m * (m - 1.0));
        k += 1;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn petal() -> Sheet {
        Sheet::new(&PetalGeometry {
            count: 3,
            first_azimuth_rad: 0.3,
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

    #[test]
    fn oracle_series_of_sine_and_cosine() {
        for i in -70..=70 {
            let x = f64::from(i) * 0.01;
            let (s, c) = sin_cos_small(x);
            assert!((s - x.sin()).abs() < 2e-16 && (c - x.cos()).abs() < 3e-16, "{x}");
        }
    }

    #[test]
    fn oracle_derivatives_are_differences() {
        let sheet = petal();
        let h = 1e-5;
        for (u, s) in [(-1.0, 0.0), (0.3, 0.6), (0.9, 1.0)] {
            let j = sheet.jet(u, s);
            let by_u = (sheet.at(u + h, s) - sheet.at(u - h, s)) / (2.0 * h);
            let by_s = (sheet.at(u, s + h) - sheet.at(u, s - h)) / (2.0 * h);
            let twice = (sheet.jet(u + h, s).u - sheet.jet(u - h, s).u) / (2.0 * h);
            let mixed = (sheet.jet(u, s + h).u - sheet.jet(u, s - h).u) / (2.0 * h);
            let third = (sheet.jet(u, s + h).uu - sheet.jet(u, s - h).uu) / (2.0 * h);
            let thrice = (sheet.jet(u + h, s).uu - sheet.jet(u - h, s).uu) / (2.0 * h);
            for (got, want) in [
                (j.u, by_u),
                (j.s, by_s),
                (j.uu, twice),
                (j.us, mixed),
                (j.uus, third),
                (j.uuu, thrice),
            ] {
                assert!((got - want).length() < 1e-9, "{got} {want}");
            }
        }
    }

    /// Bounds hold at every point of random patches, and are tight on small ones.
    #[test]
    fn invariant_bounds_of_a_patch_hold() {
        let sheet = petal();
        let (turn, p) = (
            DMat3::from_quat(docktwin_core::DQuat::from_rotation_y(0.4)),
            DVec3::new(0.1, -0.05, 0.02),
        );
        for k in 0..400 {
            let t = f64::from(k);
            let (u, s) = (0.9 * (1.3 * t).sin(), 0.5 + 0.5 * (0.7 * t).sin());
            let size = 2.0f64.powi(-(k % 8));
            let patch = Patch::new(
                &sheet,
                [(u - size).max(-1.0), (u + size).min(1.0)],
                [(s - size).max(0.0), (s + size).min(1.0)],
            );
            let n = DVec3::new((2.1 * t).sin(), (3.3 * t).cos(), (1.7 * t).sin()).normalize();
            let m = DVec2::new((0.9 * t).cos(), (0.9 * t).sin().abs());
            let (flat, about) = (
                patch.tops(&sheet, n),
                PatchAbout::new(patch, (&turn, p)).tops(
                    &sheet,
                    (&turn, p),
                    m,
                    [f64::NEG_INFINITY; 2],
                ),
            );
            let mut most = [[f64::NEG_INFINITY; 2]; 2];
            for i in 0..=20 {
                let u = patch.u[0] + (patch.u[1] - patch.u[0]) * f64::from(i) / 20.0;
                for (e, s) in patch.s.into_iter().enumerate() {
                    let x = sheet.at(u, s);
                    let y = turn * x + p;
                    most[0][e] = most[0][e].max(n.dot(x));
                    most[1][e] = most[1][e].max(m.x * y.x + m.y * y.y.hypot(y.z));
                }
            }
            for e in 0..2 {
                assert!(flat[e] > most[0][e] - 1e-12 && about[e] > most[1][e] - 1e-12, "{k}");
                let room = 0.08 * size * size;
                assert!(flat[e] < most[0][e] + room && about[e] < most[1][e] + room, "{k}");
            }
        }
    }

    #[test]
    fn oracle_nearest_points_of_pieces_agree_with_a_scan() {
        for k in 0..300 {
            let t = f64::from(k);
            let v = |a: f64| DVec3::new((a * t).sin(), (1.7 * a * t).cos(), (2.3 * a * t).sin());
            let (p, d, q, e) = (v(1.1), v(0.7), v(1.9), v(0.4));
            let (sr, tr) = ([0.2, 0.9], [0.0, 0.6]);
            let (s, u, r) = nearest_on_pieces((p, d, sr), (q, e, tr));
            assert!((sr[0]..=sr[1]).contains(&s) && (tr[0]..=tr[1]).contains(&u));
            let mut best = f64::INFINITY;
            for i in 0..=200 {
                for j in 0..=200 {
                    let s = sr[0] + 0.7 * f64::from(i) / 200.0;
                    let u = 0.6 * f64::from(j) / 200.0;
                    best = best.min((q + e * u - p - d * s).length());
                }
            }
            assert!(r.length() < best + 1e-12 && r.length() > best - 0.01, "{k}");
        }
    }
}
