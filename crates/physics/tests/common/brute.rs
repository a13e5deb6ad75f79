//! Depths and the stored energy by brute force: dense grids, refined. Shares no code with the crate's search.
#![allow(dead_code, unreachable_pub, reason = "every test file uses its own part")]

use core::f64::consts::TAU;

use docktwin_core::{DVec3, Pose};
use docktwin_model::{DockingMechanism, NormalLaw, PetalGeometry, SideGeometry};
use docktwin_physics::contact::SurfacePair;

/// Grids and refinements are finer than a micrometre of depth.
#[derive(Clone, Copy)]
pub struct Brute<'a> {
    pub m: &'a DockingMechanism,
    /// Intervals of a petal across and along, for its whole extent.
    pub grid: usize,
}

/// A rectangle of a petal's parameters.
type Span = ([f64; 2], [f64; 2]);
const WHOLE: Span = ([-1.0, 1.0], [0.0, 1.0]);

/// Least value between `a` and `b` of a function with one valley there.
fn golden(mut a: f64, mut b: f64, rounds: u32, f: impl Fn(f64) -> f64) -> (f64, f64) {
    const R: f64 = 0.618_033_988_749_895;
    let (mut x, mut y) = (b - R * (b - a), a + R * (b - a));
    let (mut fx, mut fy) = (f(x), f(y));
    for _ in 0..rounds {
        if fx < fy {
            (b, y, fy) = (y, x, fx);
            x = b - R * (b - a);
            fx = f(x);
        } else {
            (a, x, fx) = (x, y, fy);
            y = a + R * (b - a);
            fy = f(y);
        }
    }
    [(a, f(a)), (b, f(b)), (x, fx), (y, fy)]
        .into_iter()
        .min_by(|p, q| p.1.total_cmp(&q.1))
        .expect("four")
}

/// Parameters of the nearest points of two segments, by the cases of their ends.
fn between(a: [DVec3; 2], sr: [f64; 2], b: [DVec3; 2]) -> (f64, f64) {
    let (d, e, r) = (a[1] - a[0], b[1] - b[0], a[0] - b[0]);
    let at = |s: f64, t: f64| (r + d * s - e * t).length_squared();
    let on_b = |s: f64| (e.dot(r + d * s) / e.length_squared()).clamp(0.0, 1.0);
    let on_a = |t: f64| (d.dot(e * t - r) / d.length_squared()).clamp(sr[0], sr[1]);
    let mut all =
        vec![(sr[0], on_b(sr[0])), (sr[1], on_b(sr[1])), (on_a(0.0), 0.0), (on_a(1.0), 1.0)];
    let n = d.cross(e);
    if n.length_squared() > 1e-12 * d.length_squared() * e.length_squared() {
        let s = -r.cross(e).dot(n) / n.length_squared();
        if (sr[0]..=sr[1]).contains(&s) {
            all.push((s, on_b(s)));
        }
    }
    let best = all.into_iter().min_by(|p, q| at(p.0, p.1).total_cmp(&at(q.0, q.1)));
    best.expect("four ends at least")
}

/// A petal with what softens it.
#[derive(Clone, Copy)]
struct Leaf<'a> {
    g: &'a PetalGeometry,
    i: u32,
    /// Compliance of the tip relative to the surfaces', or 0.
    soft: f64,
}

impl Leaf<'_> {
    fn ruling(&self, x: Pose, u: f64) -> [DVec3; 2] {
        self.g.ruling(self.i, u).map(|p| x.transform_point(p))
    }
}

impl<'a> Brute<'a> {
    fn exponent(&self) -> (f64, f64) {
        match self.m.contact.normal {
            NormalLaw::HuntCrossley { stiffness, exponent, .. } => (stiffness, exponent),
            NormalLaw::KelvinVoigt { stiffness, .. } => (stiffness, 1.0),
        }
    }

    fn leaf(&self, side: &'a SideGeometry, i: usize, weighed: bool) -> Leaf<'a> {
        let g = side.petals.as_ref().expect("petals");
        let [a, b] = g.ruling(0, 0.0);
        let tip = (b - a).length().powi(3) / (3.0 * g.flexural_rigidity_n_m2);
        let soft = if weighed { self.exponent().0 * tip } else { 0.0 };
        Leaf { g, i: u32::try_from(i).expect("small"), soft }
    }

    /// `−η`, η the depth that stores as much in surfaces alone.
    fn value(&self, gap: f64, sum: f64, soft: f64) -> f64 {
        let depth = sum - gap;
        if depth <= 0.0 {
            -depth
        } else {
            -depth * (1.0 + soft).powf(-1.0 / (self.exponent().1 + 1.0))
        }
    }

    /// Depth of a pair, m: positive in contact.
    pub fn depth(&self, pair: SurfacePair, x_rp: Pose) -> f64 {
        self.over(pair, x_rp, WHOLE, false)
    }

    /// Deepest place of a pair with its first petal restricted to `span`; effective depth when `weighed`.
    fn over(&self, pair: SurfacePair, x_rp: Pose, span: Span, weighed: bool) -> f64 {
        let (a, p) = (&self.m.active, &self.m.passive);
        match pair {
            SurfacePair::RingRing => self.rings(x_rp, 0.0, TAU, 4000),
            SurfacePair::PetalRing(i) => {
                self.on_ring((self.leaf(a, i, weighed), p), x_rp.inverse(), span)
            }
            SurfacePair::RingPetal(j) => self.on_ring((self.leaf(p, j, weighed), a), x_rp, span),
            SurfacePair::PetalPetal(i, j) => {
                let leaves = (self.leaf(a, i, weighed), self.leaf(p, j, weighed));
                self.petals(leaves, x_rp, span)
            }
            SurfacePair::Listed(_) => unreachable!("rings and petals only"),
        }
    }

    /// Deepest point of the active ring between two azimuths.
    fn rings(&self, x_rp: Pose, from: f64, to: f64, points: u32) -> f64 {
        let (a, b) = (self.m.active.ring, self.m.passive.ring);
        let gap = |t: f64| {
            let (s, c) = t.sin_cos();
            let q = DVec3::new(0.0, a.mean_radius_m * c, a.mean_radius_m * s);
            let q = x_rp.inverse_transform_point(q);
            q.x.hypot(q.y.hypot(q.z) - b.mean_radius_m)
        };
        let step = (to - from) / f64::from(points);
        let at = |i: u32| from + step * f64::from(i);
        let best = (0..=points).min_by(|i, k| gap(at(*i)).total_cmp(&gap(at(*k)))).expect("points");
        let (lo, hi) = (at(best.saturating_sub(1)), at((best + 1).min(points)));
        a.section_radius_m + b.section_radius_m - golden(lo, hi, 40, gap).1
    }

    /// A petal on the ring of the other side, into whose frame `x` takes it.
    fn on_ring(
        &self,
        (leaf, other): (Leaf<'_>, &SideGeometry),
        x: Pose,
        ([u0, u1], [s0, s1]): Span,
    ) -> f64 {
        let ring = other.ring;
        let sum = 0.5 * leaf.g.thickness_m + ring.section_radius_m;
        let at = |r: [DVec3; 2], s: f64| {
            let q = r[0] + (r[1] - r[0]) * s;
            let gap = q.x.hypot(q.y.hypot(q.z) - ring.mean_radius_m);
            self.value(gap, sum, leaf.soft * s.powi(3))
        };
        // Along a ruling the distance may have two valleys: a grid, then the best of it refined.
        let along = |u: f64, rounds: u32| {
            let r = leaf.ruling(x, u);
            let n = self.grid.min(40);
            let s = |i: usize| s0 + (s1 - s0) * i as f64 / n as f64;
            if s0 >= s1 {
                return at(r, s0);
            }
            let best =
                (0..=n).min_by(|i, k| at(r, s(*i)).total_cmp(&at(r, s(*k)))).expect("points");
            if rounds == 0 {
                return at(r, s(best));
            }
            golden(s(best.saturating_sub(1)), s((best + 1).min(n)), rounds, |s| at(r, s)).1
        };
        if u0 >= u1 {
            return -along(u0, 36);
        }
        let n = self.grid;
        let u = |i: usize| u0 + (u1 - u0) * i as f64 / n as f64;
        let rough: Vec<f64> = (0..=n).map(|i| along(u(i), 12)).collect();
        let mut best = f64::INFINITY;
        let least = rough.iter().copied().fold(f64::INFINITY, f64::min);
        for i in 0..=n {
            let (lo, hi) = (i.saturating_sub(1), (i + 1).min(n));
            if rough[i] <= rough[lo] && rough[i] <= rough[hi] && rough[i] < least + 2e-3 {
                best = best.min(golden(u(lo), u(hi), 30, |u| along(u, 30)).1);
            }
        }
        -best
    }

    fn petals(&self, (a, b): (Leaf<'_>, Leaf<'_>), x: Pose, ([u0, u1], sr): Span) -> f64 {
        let sum = 0.5 * (a.g.thickness_m + b.g.thickness_m);
        let value = |r: [DVec3; 2], q: [DVec3; 2], s: f64, t: f64| {
            let gap = (r[0].lerp(r[1], s) - q[0].lerp(q[1], t)).length();
            self.value(gap, sum, a.soft * s.powi(3) + b.soft * t.powi(3))
        };
        let near = |u: f64, v: f64| {
            let (r, q) = (a.ruling(Pose::IDENTITY, u), b.ruling(x, v));
            let (s, t) = between(r, sr, q);
            value(r, q, s, t)
        };
        // With softness the deepest place of two rulings lies a little beside the nearest points.
        let fine = |u: f64, v: f64| {
            let (r, q) = (a.ruling(Pose::IDENTITY, u), b.ruling(x, v));
            let (s, t) = between(r, sr, q);
            if a.soft + b.soft <= 0.0 || value(r, q, s, t) > 0.0 {
                return value(r, q, s, t);
            }
            let on = |s: f64| {
                let lo = (t - 0.1).max(0.0);
                golden(lo, (t + 0.1).min(1.0), 26, |t| value(r, q, s, t)).1
            };
            golden((s - 0.1).max(sr[0]), (s + 0.1).min(sr[1]), 26, on).1.min(value(r, q, s, t))
        };
        let n = self.grid;
        let nu = if u0 < u1 { n } else { 0 };
        let u = |i: usize| if nu == 0 { u0 } else { u0 + (u1 - u0) * i as f64 / nu as f64 };
        let v = |k: usize| -1.0 + 2.0 * k as f64 / n as f64;
        let rough: Vec<Vec<f64>> =
            (0..=nu).map(|i| (0..=n).map(|k| near(u(i), v(k))).collect()).collect();
        let least = rough.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        let mut best = least;
        for i in 0..=nu {
            for k in 0..=n {
                let here = rough[i][k];
                let around = |di: usize, dk: usize| {
                    let (i, k) =
                        ((i + di).saturating_sub(1).min(nu), (k + dk).saturating_sub(1).min(n));
                    rough[i][k]
                };
                let lowest = (0..9).all(|c| here <= around(c / 3, c % 3));
                if lowest && here < least + 2e-3 {
                    let box_ = ([u0, u1], [-1.0, 1.0]);
                    let size = [if nu == 0 { 0.0 } else { (u1 - u0) / n as f64 }, 2.0 / n as f64];
                    let start = compass([u(i), v(k)], size, box_, 1e-5, near);
                    best = best
                        .min(compass(start.0, [1e-3_f64.min(size[0]), 1e-3], box_, 1e-8, fine).1);
                }
            }
        }
        -best
    }

    /// Stored energy of all pairs as the physics notes state it, J.
    pub fn energy(&self, x_rp: Pose) -> f64 {
        let count = |s: &SideGeometry| s.petals.as_ref().map_or(0, |p| p.count as usize);
        let (a, p) = (count(&self.m.active), count(&self.m.passive));
        let mut pairs: Vec<SurfacePair> = (0..a).map(SurfacePair::PetalRing).collect();
        pairs.extend((0..p).map(SurfacePair::RingPetal));
        pairs.extend((0..a).flat_map(|i| (0..p).map(move |j| SurfacePair::PetalPetal(i, j))));
        let petals: f64 = pairs
            .into_iter()
            .filter(|pair| self.depth(*pair, x_rp) > -1e-4)
            .map(|pair| self.petal_energy(pair, x_rp))
            .sum();
        petals + self.ring_energy(x_rp)
    }

    fn stored(&self, effective: f64) -> f64 {
        let (k, n) = self.exponent();
        k * effective.max(0.0).powf(n + 1.0) / (n + 1.0)
    }

    /// Cells less borders plus corners.
    fn petal_energy(&self, pair: SurfacePair, x_rp: Pose) -> f64 {
        let us = [-1.0, -0.5, 0.0, 0.5, 1.0];
        let ss = [0.0, 0.5, 1.0];
        let of = |u: [f64; 2], s: [f64; 2]| self.stored(self.over(pair, x_rp, (u, s), true));
        let mut sum = 0.0;
        for w in us.windows(2) {
            for h in ss.windows(2) {
                sum += of([w[0], w[1]], [h[0], h[1]]);
            }
            sum -= of([w[0], w[1]], [0.5; 2]);
        }
        for u in [-0.5, 0.0, 0.5] {
            sum += of([u; 2], [0.5; 2]) - of([u; 2], [0.0, 0.5]) - of([u; 2], [0.5, 1.0]);
        }
        sum
    }

    /// Arcs less borders, plus the lowest border of all.
    fn ring_energy(&self, x_rp: Pose) -> f64 {
        const ARCS: u32 = 32;
        let w = self.m.contact.merge_depth_m;
        let at = |i: u32| TAU * f64::from(i) / f64::from(ARCS);
        // Half of |x|, rounded over w.
        let half = |x: f64, w: f64| {
            let y = (x.abs() / w).min(1.0);
            if y < 1.0 { w * (y * y - 0.5 * y * y * y) } else { 0.5 * x.abs() }
        };
        let rise = |x: f64, w: f64| {
            let y = (x.max(0.0) / w).min(1.0);
            if y < 1.0 { w * (2.0 * y * y - y * y * y) } else { x }
        };
        // The page gives the arcs a quarter of the width.
        let arc = 0.25 * w;
        let nodes: Vec<f64> = (0..ARCS).map(|i| self.rings(x_rp, at(i), at(i), 1)).collect();
        let mut sum = 0.0;
        for i in 0..ARCS {
            let (a, b) = (nodes[i as usize], nodes[((i + 1) % ARCS) as usize]);
            let deepest = self.rings(x_rp, at(i), at(i + 1), 200);
            let ends = 0.5 * (a + b) + half(a - b, arc);
            sum += self.stored(ends + rise(deepest - ends, arc)) - self.stored(a);
        }
        let mut low = nodes;
        while low.len() > 1 {
            low = low.chunks(2).map(|c| 0.5 * (c[0] + c[1]) - half(c[0] - c[1], w)).collect();
        }
        sum + self.stored(low[0])
    }
}

/// Goes down by steps in twelve directions, shorter ones when none helps.
fn compass(
    mut z: [f64; 2],
    mut size: [f64; 2],
    box_: ([f64; 2], [f64; 2]),
    least: f64,
    f: impl Fn(f64, f64) -> f64,
) -> ([f64; 2], f64) {
    let mut now = f(z[0], z[1]);
    let mut turn = 0.0;
    while size[0].max(size[1]) > least {
        let mut better = false;
        for k in 0..12 {
            turn += 0.37;
            let (s, c) = (TAU * f64::from(k) / 12.0 + turn).sin_cos();
            let y = [
                (z[0] + c * size[0]).clamp(box_.0[0], box_.0[1]),
                (z[1] + s * size[1]).clamp(box_.1[0], box_.1[1]),
            ];
            let there = f(y[0], y[1]);
            if there < now - 1e-15 {
                (z, now, better) = (y, there, true);
                break;
            }
        }
        if better { size = size.map(|x| 1.6 * x) } else { size = size.map(|x| 0.5 * x) }
    }
    (z, now)
}
