//! Cells of a ring against a ring: 32 arcs, whose borders are 32 points.
//!
//! Rings that lie flat on each other are where a docking ends, and there a maximum would jump from one
//! side to the other with the smallest tilt. So the depth of an arc is smooth in the depths of its
//! ends: with `S` their smooth maximum and `M ≥ S` the arc's deepest point, `F = S + rise(M − S)`. What
//! is sharp stays exact. All around a ring, where every border is deep, one more term counts the touch
//! as one place and not none: `+ Φ(lowest border)`, a smooth minimum.

use docktwin_core::{DMat3, DVec3};

use super::{Elastic, Load, Touch, first_share, half_size, rise, smooth_max};
use crate::contact::geometry::{Circle, off_axis, root_derivatives};

/// Arcs of a ring: a power of two, so that the minimum of all weighs equal borders equally.
const ARCS: usize = 32;
/// Groups of arcs, each with one bristle.
pub(crate) const EIGHTHS: usize = 8;
const ARCS_IN_EIGHTH: usize = ARCS / EIGHTHS;
const STEP: f64 = core::f64::consts::TAU / ARCS as f64;

/// Cosine and sine of the borders' azimuths.
#[derive(Clone, Debug)]
pub(crate) struct RingTable([[f64; 2]; ARCS]);

impl RingTable {
    pub(crate) fn new() -> Self {
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        Self(core::array::from_fn(|i| {
            let (s, c) = (STEP * i as f64).sin_cos();
            [c, s]
        }))
    }
}

/// Two rings, in the frame of the first.
pub(crate) struct RingPair<'a> {
    pub(crate) own: Circle,
    pub(crate) other: Circle,
    /// The first ring's frame in the second's.
    r: DMat3,
    p: DVec3,
    table: &'a RingTable,
    /// Width of the smooth extremes, m.
    width: f64,
    /// Height of the first circle's point above the plane of the second: constant, cosine, sine.
    height: [f64; 3],
    /// Its squared distance from the second's centre.
    square: [f64; 3],
    /// Bounds of the amplitudes of the squared distance from the second's axis: once and twice around.
    waves: [f64; 2],
}

/// Half the squared distance from the second circle, with derivatives by azimuth.
#[derive(Clone, Copy, Debug)]
struct At {
    azimuth: f64,
    /// Squared distance, m².
    q: f64,
    slope: f64,
    bend: f64,
    /// Distance from the second circle's axis, m.
    rho: f64,
}

/// Deepest point of an arc.
#[derive(Clone, Copy, Debug)]
struct Deepest {
    azimuth: f64,
    depth: f64,
}

/// A point that pushes: azimuth, and dU/dδ there.
struct Push {
    azimuth: f64,
    force_n: f64,
}

impl<'a> RingPair<'a> {
    pub(crate) fn new(
        (own, other): (Circle, Circle),
        (r, p): (DMat3, DVec3),
        table: &'a RingTable,
        width: f64,
    ) -> Self {
        let [y, z] = [r.y_axis, r.z_axis].map(|v| v * own.radius);
        let height = [p.x, y.x, z.x];
        let square = [own.radius * own.radius + p.length_squared(), 2.0 * p.dot(y), 2.0 * p.dot(z)];
        // ρ² = square − height²: once around, and twice around.
        let once = (square[1] - 2.0 * height[0] * height[1])
            .hypot(square[2] - 2.0 * height[0] * height[2]);
        let twice = 0.5 * (height[1] * height[1] + height[2] * height[2]);
        Self { own, other, r, p, table, width, height, square, waves: [once, twice] }
    }

    fn sum(&self) -> f64 {
        self.own.ball + self.other.ball
    }

    fn depth(&self, q: f64) -> f64 {
        self.sum() - q.max(0.0).sqrt()
    }

    fn look(&self, azimuth: f64, [c, s]: [f64; 2]) -> At {
        let wave = |w: &[f64; 3]| (w[0] + w[1] * c + w[2] * s, w[2] * c - w[1] * s, w[0]);
        let (p, p1, p0) = wave(&self.square);
        let (h, h1, h0) = wave(&self.height);
        let (p2, h2) = (p0 - p, h0 - h);
        let rho = (p - h * h).max(1e-24).sqrt();
        let rho1 = (0.5 * p1 - h * h1) / rho;
        let rho2 = (0.5 * p2 - h1 * h1 - h * h2 - rho1 * rho1) / rho;
        let radius = self.other.radius;
        At {
            azimuth,
            // |p|² + R² − 2Rρ, without the loss of the large terms: h² + (ρ − R)².
            q: h * h + (rho - radius) * (rho - radius),
            slope: p1 - 2.0 * radius * rho1,
            bend: p2 - 2.0 * radius * rho2,
            rho,
        }
    }

    /// Depths of all borders, or how far the rings are apart, m.
    fn borders(&self) -> Result<[At; ARCS], f64> {
        // The planes' slab first.
        let tilt = (1.0 - self.r.x_axis.x * self.r.x_axis.x).max(0.0).sqrt();
        let apart = self.p.x.abs() - self.own.radius * tilt - self.sum();
        if apart > 0.0 {
            return Err(apart);
        }
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let nodes: [At; ARCS] =
            core::array::from_fn(|i| self.look(STEP * i as f64, self.table.0[i]));
        // Between borders the distance changes by no more than half the arc.
        let nearest = nodes.iter().map(|n| n.q).fold(f64::INFINITY, f64::min);
        let apart = -self.depth(nearest) - 0.5 * STEP * self.own.radius;
        if apart > 0.0 { Err(apart) } else { Ok(nodes) }
    }

    /// Deepest point of an arc: nearest point of the first circle between two of its points.
    fn deepest(&self, a: &At, b: &At) -> Deepest {
        let mut best = if a.q <= b.q { *a } else { *b };
        self.descend(a, b, &mut best, 0);
        Deepest { azimuth: best.azimuth, depth: self.depth(best.q) }
    }

    fn descend(&self, a: &At, b: &At, best: &mut At, level: u32) {
        let l = b.azimuth - a.azimuth;
        // The distance changes by no more than the arc.
        let reach = 0.5 * (a.q.sqrt() + b.q.sqrt() - l * self.own.radius);
        if reach > best.q.sqrt() {
            return;
        }
        let [third, fourth] = self.high_derivatives(a.rho.min(b.rho) - 0.5 * l * self.own.radius);
        let convex = a.bend.min(b.bend) - 0.125 * l * l * fourth;
        let concave = a.bend.max(b.bend) + 0.125 * l * l * fourth;
        let steady = a.slope.abs().min(b.slope.abs()) - 0.125 * l * l * third;
        if concave < 0.0 || a.slope * b.slope > 0.0 && steady > 0.0 {
            return; // an end
        }
        if convex > 0.0 {
            if a.slope < 0.0 && b.slope > 0.0 {
                self.polish(a, b, best);
            }
            return;
        }
        let even = 0.5
            * l
            * (a.slope.abs().max(b.slope.abs()) + 0.5 * l * concave.abs().max(convex.abs()));
        if level >= 20 || even < 1e-12 {
            return; // flat: any point will do
        }
        let azimuth = 0.5 * (a.azimuth + b.azimuth);
        let (s, c) = azimuth.sin_cos();
        let m = self.look(azimuth, [c, s]);
        if m.q < best.q {
            *best = m;
        }
        self.descend(a, &m, best, level + 1);
        self.descend(&m, b, best, level + 1);
    }

    /// Newton's method for the one minimum between two points, held between them.
    fn polish(&self, a: &At, b: &At, best: &mut At) {
        let (mut lo, mut hi) = (a.azimuth, b.azimuth);
        let mut x = lo + (hi - lo) * a.slope / (a.slope - b.slope);
        for _ in 0..40 {
            let (s, c) = x.sin_cos();
            let at = self.look(x, [c, s]);
            if at.q < best.q {
                *best = at;
            }
            if at.slope < 0.0 {
                lo = x
            } else {
                hi = x
            }
            let next = x - at.slope / at.bend;
            let next = if next > lo && next < hi { next } else { 0.5 * (lo + hi) };
            let moved = (next - x).abs();
            x = next;
            if moved < 1e-9 {
                let (s, c) = x.sin_cos();
                let at = self.look(x, [c, s]);
                if at.q <= best.q {
                    *best = at;
                }
                return;
            }
        }
    }

    /// Bounds of the third and fourth derivative of the squared distance where points are at least
    /// `rho` from the second circle's axis.
    fn high_derivatives(&self, rho: f64) -> [f64; 2] {
        if rho < 0.1 * self.other.radius {
            return [f64::INFINITY; 2];
        }
        let [once, twice] = self.waves;
        let w = |k: i32| once + 2.0f64.powi(k) * twice;
        let [third, fourth] = root_derivatives([w(1), w(2), w(3), w(4)], rho);
        let own = self.square[1].hypot(self.square[2]);
        let twice_radius = 2.0 * self.other.radius;
        [own + twice_radius * third, own + twice_radius * fourth]
    }

    /// Point of contact and normal, from the first circle to the second, at an azimuth; first frame.
    fn contact(&self, azimuth: f64) -> (DVec3, DVec3) {
        let a = self.own.at(azimuth);
        let x = self.r * a + self.p;
        let rho = off_axis(x).max(1e-12);
        let scale = self.other.radius / rho - 1.0;
        let gap = DVec3::new(-x.x, x.y * scale, x.z * scale);
        let d = gap.length();
        let n = self.r.transpose() * if d > 1e-12 { gap / d } else { DVec3::X };
        (a + n * (self.own.ball - 0.5 * (self.sum() - d)), n)
    }
}

/// Width of the smooth extremes within an arc, over that of the lowest border. With equal widths two rings
/// flat on each other would store most when exactly flat, and tip: what smoothing takes off the lowest
/// border by tilting them must be less than what it adds to the arcs.
const ARC_SHARE: f64 = 0.25;

/// Depths of all elements and what they are made of.
struct Depths {
    nodes: [f64; ARCS],
    /// Smooth depth of each arc.
    arcs: [f64; ARCS],
    deepest: [Deepest; ARCS],
    /// Derivatives of an arc's depth: by its first and second border, and by its deepest point.
    weights: [[f64; 3]; ARCS],
}

impl RingPair<'_> {
    /// Energy and forces, or how far the rings are apart, m.
    pub(crate) fn load(&self, elastic: &Elastic, out: &mut Load) -> Result<(), f64> {
        let nodes = self.borders()?;
        let depths = self.depths(&nodes);
        let top = depths.arcs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if top <= 0.0 {
            return Err(-top);
        }
        self.forces(elastic, &depths, out);
        Ok(())
    }

    /// Depth of the deepest point of all, m.
    pub(crate) fn depth_m(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let node = |i: usize| self.look(STEP * i as f64, self.table.0[i % ARCS]);
        let mut best = node(0);
        for i in 0..ARCS {
            let (a, b) = (node(i), node(i + 1));
            for end in [a, b] {
                if end.q < best.q {
                    best = end;
                }
            }
            self.descend(&a, &b, &mut best, 0);
        }
        self.depth(best.q)
    }

    fn depths(&self, nodes: &[At; ARCS]) -> Depths {
        let at = nodes.map(|n| self.depth(n.q));
        let mut out = Depths {
            nodes: at,
            arcs: [f64::NEG_INFINITY; ARCS],
            deepest: [Deepest { azimuth: 0.0, depth: 0.0 }; ARCS],
            weights: [[0.0; 3]; ARCS],
        };
        for i in 0..ARCS {
            let j = (i + 1) % ARCS;
            let mut end = nodes[j];
            if j == 0 {
                end.azimuth = core::f64::consts::TAU;
            }
            let ends = at[i].max(at[j]);
            let surely = ends + 0.5 * STEP * self.own.radius;
            let found = if surely > 0.0 {
                self.deepest(&nodes[i], &end)
            } else {
                Deepest { azimuth: nodes[i].azimuth, depth: surely }
            };
            let width = ARC_SHARE * self.width;
            let (s, first) = smooth_max(at[i], at[j], width);
            let (over, lift) = rise(found.depth - s, width);
            out.arcs[i] = if surely > 0.0 { s + over } else { surely };
            out.deepest[i] = found;
            out.weights[i] = [(1.0 - lift) * first, (1.0 - lift) * (1.0 - first), lift];
        }
        out
    }

    fn forces(&self, elastic: &Elastic, d: &Depths, out: &mut Load) {
        let (closed, weigh) = lowest(&d.nodes, self.width);
        let around = elastic.force(closed);
        out.energy_j = elastic.energy(closed);
        let mut node = [0.0; ARCS];
        let mut rubbing = [0.0; ARCS];
        let mut net = around;
        for i in 0..ARCS {
            let j = (i + 1) % ARCS;
            let f = elastic.force(d.arcs[i]);
            out.energy_j += elastic.energy(d.arcs[i]) - elastic.energy(d.nodes[i]);
            let border = elastic.force(d.nodes[i]);
            net += f - border;
            node[i] += f * d.weights[i][0] - border + around * weigh[i];
            node[j] += f * d.weights[i][1];
            let before = (i + ARCS - 1) % ARCS;
            let share = first_share(d.arcs[before], d.arcs[i], d.nodes[i]);
            rubbing[before] -= share * border;
            rubbing[i] += f - (1.0 - share) * border + 0.5 * around * (weigh[i] + weigh[j]);
        }
        for eighth in 0..EIGHTHS {
            let arcs = eighth * ARCS_IN_EIGHTH..(eighth + 1) * ARCS_IN_EIGHTH;
            let own = arcs.clone().map(|i| Push {
                azimuth: d.deepest[i].azimuth,
                force_n: elastic.force(d.arcs[i]) * d.weights[i][2],
            });
            #[expect(clippy::cast_precision_loss, reason = "small numbers")]
            let shared = arcs.clone().map(|i| Push { azimuth: STEP * i as f64, force_n: node[i] });
            let mut elastic_n = DVec3::ZERO;
            for push in own.chain(shared).filter(|p| p.force_n != 0.0) {
                let (point, n) = self.contact(push.azimuth);
                out.push(point, n * push.force_n);
                elastic_n += n * push.force_n;
            }
            let rubs = || arcs.clone().map(|i| (i, rubbing[i].max(0.0)));
            // What is left of each arc's own force damps: one damper in all where the ring lies flat.
            let share = arcs.clone().map(|i| match elastic.force(d.arcs[i]) {
                own if own > 0.0 => (rubbing[i].max(0.0) / own).min(1.0),
                _ => 0.0,
            });
            self.touch(out, d, eighth, rubs, (elastic_n, share.sum::<f64>().min(1.0)));
        }
        out.level_rubbing(net);
    }

    /// One eighth of the ring as a place with a bristle, where any of its arcs rubs.
    fn touch<I: Iterator<Item = (usize, f64)>>(
        &self,
        out: &mut Load,
        d: &Depths,
        eighth: usize,
        rubs: impl Fn() -> I,
        (elastic, share): (DVec3, f64),
    ) {
        let deep = rubs().map(|(i, _)| d.arcs[i]).fold(f64::NEG_INFINITY, f64::max);
        if deep <= 0.0 {
            return;
        }
        let total: f64 = rubs().map(|(_, n)| n).sum();
        let first = eighth * ARCS_IN_EIGHTH;
        let best = rubs().fold(first, |b, (i, _)| if d.arcs[i] > d.arcs[b] { i } else { b });
        let mut t = Touch {
            cell: u8::try_from(eighth).unwrap_or(u8::MAX),
            depth: rubs().map(|(i, _)| d.deepest[i].depth).fold(0.0, f64::max),
            elastic,
            rubbing_n: total,
            share,
            ..Touch::NONE
        };
        let (mut torque, mut squares) = (DVec3::ZERO, 0.0);
        for (i, n) in rubs() {
            let w = if total > 0.0 { n / total } else { f64::from(u8::from(i == best)) };
            if w <= 0.0 {
                continue;
            }
            for (azimuth, part) in self.spread(d, i) {
                let (point, normal) = self.contact(azimuth);
                t.point += point * (w * part);
                t.dir += normal * (w * part);
                torque += point.cross(normal) * (w * part);
                squares += point.length_squared() * (w * part);
            }
        }
        t.couple = torque - t.point.cross(t.dir);
        t.spread_m = (squares - t.point.length_squared()).max(0.0).sqrt();
        out.touches.push(t);
    }

    /// Azimuths that make an arc's depth, with their weights.
    fn spread(&self, d: &Depths, i: usize) -> [(f64, f64); 3] {
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let at = |i: usize| STEP * i as f64;
        let w = d.weights[i];
        [(at(i), w[0]), (at(i + 1), w[1]), (d.deepest[i].azimuth, w[2])]
    }
}

/// Smooth minimum of all borders and its derivative by each: by twos, then twos of twos, and so on.
/// Minus infinity where it is surely not above zero.
fn lowest(nodes: &[f64; ARCS], width: f64) -> (f64, [f64; ARCS]) {
    let least = nodes.iter().copied().fold(f64::INFINITY, f64::min);
    let mut weights = [0.0; ARCS];
    // Each round lies above the minimum by no more than 2/27 of the width.
    if least < -0.4 * width {
        return (f64::NEG_INFINITY, weights);
    }
    weights = [1.0; ARCS];
    let mut values = *nodes;
    let mut len = ARCS;
    while len > 1 {
        let members = ARCS / len;
        len /= 2;
        for i in 0..len {
            let (a, b) = (values[2 * i], values[2 * i + 1]);
            let (g, slope) = half_size(a - b, width);
            values[i] = 0.5 * (a + b) - g;
            let by_a = 0.5 - slope;
            let first = 2 * i * members;
            weights[first..first + members].iter_mut().for_each(|w| *w *= by_a);
            weights[first + members..first + 2 * members].iter_mut().for_each(|w| *w *= 1.0 - by_a);
        }
    }
    (values[0], weights)
}
