//! A torus or hollow against spheres and capsules, in the meridian plane.
//!
//! The core of a torus or hollow is a line in the half-plane (x, ρ), turned about X: one point for a torus, straight
//! walls between points for a hollow. The nearest of its points to a point stands at the same azimuth, so distances
//! are those of the half-plane. Along the straight core of a capsule the squared distance from a circle is convex,
//! concave and convex again, and that from a wall convex or concave by its side: all extremes are found.

use arrayvec::ArrayVec;
use docktwin_core::DVec3;

use super::{
    MOST_SPOTS, Spot, Spots,
    around::{Points, Wave},
    extremes::{Breaks, extremes},
};
use crate::contact::{geometry::off_axis, look::Frame};

/// Nearer to the axis than this a distance from it counts as `(ρ²/w + w)/2`, m: a ball in the middle of a cone or ring
/// is pushed along the axis alone, and its depth is right to half of this.
const SEAT_M: f64 = 2e-6;

/// Extremes around a torus.
type Around = ArrayVec<Spot, 48>;

/// One piece of the meridian line.
#[derive(Clone, Copy, Debug)]
enum Piece {
    /// A circle: x and radius.
    Circle([f64; 2]),
    /// From a point along a direction, so long.
    Wall { from: [f64; 2], along: [f64; 2], length: f64 },
}

/// The meridian line of a core.
#[derive(Clone, Debug)]
pub(super) struct Meridian {
    /// Walls, or the circle of a torus: each has places of its own.
    cells: Vec<Piece>,
    /// Circles at which neighbouring walls meet, counted twice by them.
    edges: Vec<Piece>,
}

/// A point against a piece, in the half-plane.
struct Against {
    distance: f64,
    /// From the nearest point of the piece, over the distance.
    away: [f64; 2],
}

impl Piece {
    fn nearest(&self, [x, rho]: [f64; 2]) -> [f64; 2] {
        match *self {
            Self::Circle(c) => c,
            Self::Wall { from, along, length } => {
                let t = (along[0] * (x - from[0]) + along[1] * (rho - from[1])).clamp(0.0, length);
                [from[0] + along[0] * t, from[1] + along[1] * t]
            }
        }
    }

    fn against(&self, p: DVec3) -> Against {
        let rho = seated(off_axis(p));
        let c = self.nearest([p.x, rho]);
        let v = [p.x - c[0], rho - c[1]];
        let distance = v[0].hypot(v[1]);
        let over = if distance > 1e-12 { 1.0 / distance } else { 0.0 };
        Against { distance, away: [v[0] * over, v[1] * over] }
    }

    fn spot(&self, p: DVec3, balls: [f64; 2]) -> Spot {
        let a = self.against(p);
        let depth = balls[0] + balls[1] - a.distance;
        let across = DVec3::new(0.0, p.y, p.z) / off_axis(p).max(SEAT_M);
        let normal = DVec3::X * a.away[0] + across * a.away[1];
        Spot { depth, point: p - normal * (balls[1] - 0.5 * depth), normal }
    }

    /// Of the sign of the derivative of the distance as a point at `p` moves by `d`.
    fn slope(&self, p: DVec3, d: DVec3) -> f64 {
        let a = self.against(p);
        a.away[0] * d.x + a.away[1] * (p.y * d.y + p.z * d.z) / off_axis(p).max(SEAT_M)
    }
}

/// A distance from the axis, smooth on it.
fn seated(rho: f64) -> f64 {
    if rho < SEAT_M { 0.5 * (rho * rho / SEAT_M + SEAT_M) } else { rho }
}

/// A segment from `p` along `d` about the axis: ρ² = a s² + b s + c.
struct Segment {
    p: DVec3,
    d: DVec3,
    square: [f64; 3],
}

impl Segment {
    fn new([p, q]: [DVec3; 2]) -> Self {
        let d = q - p;
        let square = [d.y * d.y + d.z * d.z, 2.0 * (p.y * d.y + p.z * d.z), p.y * p.y + p.z * p.z];
        Self { p, d, square }
    }

    fn at(&self, s: f64) -> DVec3 {
        self.p + self.d * s
    }

    /// Where the squared distance from a circle of this radius goes from convex to concave: |d|² = R ρ''.
    fn bends(&self, radius: f64, breaks: &mut Breaks) {
        let [a, b, c] = self.square;
        let whole = self.d.length_squared();
        if whole > 0.0 {
            let cube = radius * (a * c - 0.25 * b * b).max(0.0) / whole;
            breaks.add_roots([a, b, c - cube.powf(2.0 / 3.0)]);
        }
    }

    /// Where the foot on a wall comes to one of its ends.
    fn ends(&self, from: [f64; 2], along: [f64; 2], length: f64, breaks: &mut Breaks) {
        let [a, b, c] = self.square;
        let square = along[1] * along[1];
        let slope = -along[0] * self.d.x;
        for end in [0.0, length] {
            // along·(x, ρ) = along·from + end, with ρ on one side, squared.
            let rest = end + along[0] * (from[0] - self.p.x) + along[1] * from[1];
            breaks.add_roots([
                square * a - slope * slope,
                square * b - 2.0 * slope * rest,
                square * c - rest * rest,
            ]);
        }
    }

    fn breaks(&self, piece: &Piece) -> Breaks {
        let mut out = Breaks::new();
        match *piece {
            Piece::Circle([_, radius]) => self.bends(radius, &mut out),
            Piece::Wall { from, along, length } => {
                self.bends(from[1], &mut out);
                self.bends(from[1] + along[1] * length, &mut out);
                self.ends(from, along, length, &mut out);
            }
        }
        out
    }
}

/// A circle about the axis of another core.
struct Ring {
    centre: DVec3,
    /// Its points at 0 and 90° from the centre.
    cos: DVec3,
    sin: DVec3,
    /// x, ρ² and half the squared distance from the origin.
    x: Wave,
    square: Wave,
    half: Wave,
}

impl Ring {
    fn new(x: &Frame, radius: f64) -> Self {
        let (centre, cos, sin) = (x.p, x.r.y_axis * radius, x.r.z_axis * radius);
        let along = |f: fn(DVec3) -> f64| Wave::first(f(centre), f(cos), f(sin));
        let [y, z] = [along(|v| v.y), along(|v| v.z)];
        let half = Wave::first(
            0.5 * (centre.length_squared() + radius * radius),
            centre.dot(cos),
            centre.dot(sin),
        );
        Self { centre, cos, sin, x: along(|v| v.x), square: y.times(y).plus(z.times(z), 1.0), half }
    }

    fn at(&self, t: f64) -> (DVec3, DVec3) {
        let (s, c) = t.sin_cos();
        (self.centre + self.cos * c + self.sin * s, self.sin * c - self.cos * s)
    }

    /// Adds where `slope + b ρ'` may be zero.
    fn stationary(&self, slope: Wave, b: f64, points: &mut Points) {
        let q = self.square.derivative();
        let p = slope.times(slope).times(self.square);
        points.add_roots(&p.plus(q.times(q), -0.25 * b * b));
    }

    fn points(&self, piece: &Piece) -> Points {
        let mut out = Points::default();
        let circle = |[x, r]: [f64; 2], out: &mut Points| {
            self.stationary(self.half.plus(self.x, -x).derivative(), -r, out);
        };
        match *piece {
            Piece::Circle(c) => circle(c, &mut out),
            Piece::Wall { from, along, length } => {
                circle(from, &mut out);
                circle([from[0] + along[0] * length, from[1] + along[1] * length], &mut out);
                // Along the wall's normal (−along ρ, along x).
                let across = Wave::default().plus(self.x, -along[1]);
                self.stationary(across.derivative(), along[0], &mut out);
                for end in [0.0, length] {
                    let rest = end + along[0] * from[0] + along[1] * from[1];
                    let line = Wave::first(rest, 0.0, 0.0).plus(self.x, -along[0]);
                    out.add_roots(&line.times(line).plus(self.square, -along[1] * along[1]));
                }
            }
        }
        out
    }
}

impl Meridian {
    pub(super) fn new(points: &[[f64; 2]]) -> Self {
        let walls = points.windows(2).map(|w| {
            let d = [w[1][0] - w[0][0], w[1][1] - w[0][1]];
            let length = d[0].hypot(d[1]);
            Piece::Wall { from: w[0], along: [d[0] / length, d[1] / length], length }
        });
        let cells: Vec<Piece> = walls.collect();
        if cells.is_empty() {
            return Self {
                cells: points.iter().map(|p| Piece::Circle(*p)).collect(),
                edges: Vec::new(),
            };
        }
        let edges = points[1..points.len() - 1].iter().map(|p| Piece::Circle(*p)).collect();
        Self { cells, edges }
    }

    pub(super) fn against_point(&self, p: DVec3, balls: [f64; 2], out: &mut Spots) {
        for (i, cell) in self.cells.iter().enumerate().take(MOST_SPOTS) {
            out.place(i, cell.spot(p, balls));
        }
        for (i, edge) in self.edges.iter().enumerate() {
            out.saddle([i, i + 1], edge.spot(p, balls));
        }
    }

    /// The circle of a torus whose frame is `x`. All around it a touch is one place, so the lowest of the saddles is none.
    pub(super) fn against_circle(&self, x: &Frame, radius: f64, balls: [f64; 2], out: &mut Spots) {
        let ring = Ring::new(x, radius);
        let along = |piece: &Piece| {
            let slope = |t: f64| {
                let (p, d) = ring.at(t);
                piece.slope(p, d)
            };
            let found = ring.points(piece).extremes(slope);
            let spots: Around = found.iter().map(|e| piece.spot(ring.at(e.at).0, balls)).collect();
            // Minima of the distance and the maxima after them in turn.
            let lowest = (1..spots.len())
                .step_by(2)
                .min_by(|a, b| spots[*a].depth.total_cmp(&spots[*b].depth));
            (spots, lowest)
        };
        let mut deepest = [0; MOST_SPOTS];
        for (i, cell) in self.cells.iter().enumerate().take(MOST_SPOTS) {
            let first = out.count();
            let (spots, lowest) = along(cell);
            for spot in spots.iter().step_by(2) {
                out.place(i, *spot);
            }
            let count = out.count() - first;
            for at in (1..spots.len()).step_by(2).filter(|at| Some(*at) != lowest) {
                let place = at / 2;
                out.saddle([first + place, first + (place + 1) % count.max(1)], spots[at]);
            }
            deepest[i] = out.deepest_from(first);
        }
        for (i, edge) in self.edges.iter().enumerate() {
            let (spots, lowest) = along(edge);
            for (at, spot) in spots.iter().enumerate().filter(|(at, _)| Some(*at) != lowest) {
                if at % 2 == 0 {
                    out.saddle([deepest[i], deepest[i + 1]], *spot);
                } else {
                    out.corner(*spot);
                }
            }
        }
    }

    pub(super) fn against_segment(&self, ends: [DVec3; 2], balls: [f64; 2], out: &mut Spots) {
        let segment = Segment::new(ends);
        let along = |piece: &Piece| {
            extremes(&segment.breaks(piece), |s| piece.slope(segment.at(s), segment.d))
        };
        // The deepest place of each wall: an edge is taken off from those beside it.
        let mut deepest = [0; MOST_SPOTS];
        for (i, cell) in self.cells.iter().enumerate().take(MOST_SPOTS) {
            let first = out.count();
            for e in along(cell) {
                let spot = cell.spot(segment.at(e.at), balls);
                if e.least {
                    out.place(i, spot);
                } else {
                    let last = out.count();
                    out.saddle([last - 1, last], spot);
                }
            }
            deepest[i] = out.deepest_from(first);
        }
        for (i, edge) in self.edges.iter().enumerate() {
            for e in along(edge) {
                let spot = edge.spot(segment.at(e.at), balls);
                if e.least {
                    out.saddle([deepest[i], deepest[i + 1]], spot);
                } else {
                    out.corner(spot);
                }
            }
        }
    }
}
