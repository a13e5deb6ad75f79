//! The surfaces of both sides, their pairs, and the state that contact carries from step to step.

use docktwin_core::{DMat3, DVec3, Pose, StateHasher, Twist, Wrench};
use docktwin_model::{ContactLaw, DockingMechanism, PetalGeometry, SideGeometry};

use super::{
    law,
    merge::{Merged, Sample, places, single},
    shape::{Circle, Segment, parabola_peak, segment_circle, segment_segment},
};

mod gaps;

pub use gaps::PetalGaps;

/// Most petals a side may have.
const MAX_PETALS: usize = 3;
/// Pairs of surfaces: ring–ring, 3 active petals on the passive ring, 3 passive petals on the
/// active ring, 9 pairs of petals.
pub const PAIRS: usize = 1 + 2 * MAX_PETALS + MAX_PETALS * MAX_PETALS;
/// Two places and two saddles for every pair with a ring, one place for two petals.
const MAX_PLACES: usize = 4 * (1 + 2 * MAX_PETALS) + MAX_PETALS * MAX_PETALS;
/// Places with friction of one pair.
const SLOTS: usize = 2;
/// Intervals of a petal across its rulings, against a ring.
const RING_INTERVALS: usize = 6;
/// Intervals around a ring, against a ring.
const CIRCLE_INTERVALS: usize = 24;
/// Most samples that one soft maximum is taken over.
const MOST_SAMPLES: f64 = 24.0;
/// Rulings of a petal for the first look, against a petal.
const COARSE: usize = 5;
/// Most rounds of refinement from the first look. The first reaches a seventh of the way to the
/// neighbouring rulings, far enough to climb and short enough to see a peak nearby; a round that leads
/// no further is followed by one seven times finer.
const REFINEMENTS: usize = 24;
/// Pieces along a ruling over which a line contact is spread.
const ALONG: usize = 5;

/// One pair of surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurfacePair {
    /// Active ring on passive ring.
    RingRing,
    /// Active petal on passive ring.
    PetalRing(usize),
    /// Active ring on passive petal.
    RingPetal(usize),
    /// Active petal on passive petal.
    PetalPetal(usize, usize),
}

impl SurfacePair {
    /// From its number below [`PAIRS`].
    #[must_use]
    pub fn from_index(i: usize) -> Self {
        match i {
            0 => Self::RingRing,
            1..=3 => Self::PetalRing(i - 1),
            4..=6 => Self::RingPetal(i - 4),
            _ => Self::PetalPetal((i - 7) / MAX_PETALS, (i - 7) % MAX_PETALS),
        }
    }

    /// Its number.
    #[must_use]
    pub const fn index(self) -> usize {
        match self {
            Self::RingRing => 0,
            Self::PetalRing(i) => 1 + i,
            Self::RingPetal(i) => 4 + i,
            Self::PetalPetal(a, p) => 7 + MAX_PETALS * a + p,
        }
    }
}

impl core::fmt::Display for SurfacePair {
    /// Petals are numbered from 1; those of the passive side carry a prime.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::RingRing => write!(f, "active ring · passive ring"),
            Self::PetalRing(i) => write!(f, "active petal {} · passive ring", i + 1),
            Self::RingPetal(i) => write!(f, "active ring · passive petal {}'", i + 1),
            Self::PetalPetal(a, p) => {
                write!(f, "active petal {} · passive petal {}'", a + 1, p + 1)
            }
        }
    }
}

/// One petal with what does not change.
#[derive(Clone, Debug)]
struct Petal {
    geometry: PetalGeometry,
    /// Sine and cosine of the azimuth of the middle.
    azimuth: (f64, f64),
    radius: f64,
    /// Nodes and middles of [`RING_INTERVALS`].
    fine: [Segment; 2 * RING_INTERVALS + 1],
    coarse: [Segment; COARSE],
    /// Ball around the petal with its thickness.
    centre: DVec3,
    reach: f64,
    /// 1/(3EI) and the length of a ruling.
    compliance: f64,
    length: f64,
}

impl Petal {
    fn new(g: &PetalGeometry, index: u32) -> Self {
        let at = |u: f64| {
            let [a, b] = g.ruling(index, u);
            Segment::between(a, b)
        };
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let u_of = |i: usize, n: usize| -1.0 + 2.0 * i as f64 / (n - 1) as f64;
        let fine = core::array::from_fn(|i| at(u_of(i, 2 * RING_INTERVALS + 1)));
        let coarse: [Segment; COARSE] = core::array::from_fn(|i| at(u_of(i, COARSE)));
        let middle = at(0.0);
        let centre = middle.at(0.5);
        let reach = coarse
            .iter()
            .flat_map(|s| [s.at(0.0), s.at(1.0)])
            .map(|p| (p - centre).length())
            .fold(0.0, f64::max);
        Self {
            geometry: *g,
            azimuth: g.azimuth_rad(index).sin_cos(),
            radius: 0.5 * g.thickness_m,
            fine,
            coarse,
            centre,
            reach,
            compliance: 1.0 / (3.0 * g.flexural_rigidity_n_m2),
            length: middle.d.length(),
        }
    }

    /// [`PetalGeometry::ruling`], faster: called dozens of times a step.
    fn ruling(&self, u: f64) -> Segment {
        let g = &self.geometry;
        let at = |x: f64, r: f64, half: f64| {
            let (s, c) = sin_cos_small(u * half);
            let (sa, ca) = self.azimuth;
            DVec3::new(x, r * (ca * c - sa * s), r * (sa * c + ca * s))
        };
        Segment::between(
            at(0.0, g.base_radius_m, g.base_half_angle_rad),
            at(g.height_m, g.tip_radius_m, g.tip_half_angle_rad),
        )
    }

    /// How the point at `s` of a ruling moves with the ruling's parameter, m.
    fn sweep(&self, ruling: &Segment, s: f64) -> DVec3 {
        let g = &self.geometry;
        let turn = |p: DVec3, half: f64| DVec3::new(0.0, -p.z, p.y) * half;
        turn(ruling.a, g.base_half_angle_rad) * (1.0 - s)
            + turn(ruling.at(1.0), g.tip_half_angle_rad) * s
    }
}

/// Where in a range a function is highest, from its slope at both ends and anywhere: regula falsi
/// (Illinois), which copes with the kinks where the deepest point comes to a petal's edge. Starts at
/// `u`; to a relative 1e-4 of the range, where the function itself is right to 1e-8 of its change.
fn top(u: f64, range: [(f64, f64); 2], slope: impl Fn(f64) -> f64) -> f64 {
    let [mut low, mut high] = range;
    // Rising or falling all along: the end.
    if low.1 <= 0.0 || high.1 >= 0.0 {
        return if low.1 <= 0.0 { low.0 } else { high.0 };
    }
    let close = 1e-4 * (high.0 - low.0);
    let mut next = if u > low.0 && u < high.0 { u } else { 0.5 * (low.0 + high.0) };
    let mut rose = None;
    for _ in 0..12 {
        let now = (next, slope(next));
        let rises = now.1 > 0.0;
        let (end, other) = if rises { (&mut low, &mut high) } else { (&mut high, &mut low) };
        *end = now;
        // The same end twice: the other one holds the chord up.
        if rose.replace(rises) == Some(rises) {
            other.1 *= 0.5;
        }
        next = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
        if (next - now.0).abs() < close {
            break;
        }
    }
    next
}

/// Sine and cosine by their series, to rounding for |x| ≤ 0.7; the library's beyond.
fn sin_cos_small(x: f64) -> (f64, f64) {
    if x.abs() > 0.7 {
        return x.sin_cos();
    }
    let y = x * x;
    let sin = x
        * (1.0
            - y / 6.0
                * (1.0
                    - y / 20.0
                        * (1.0
                            - y / 42.0
                                * (1.0
                                    - y / 72.0
                                        * (1.0
                                            - y / 110.0
                                                * (1.0 - y / 156.0 * (1.0 - y / 210.0)))))));
    let cos = 1.0
        - y / 2.0
            * (1.0
                - y / 12.0
                    * (1.0
                        - y / 30.0
                            * (1.0
                                - y / 56.0
                                    * (1.0
                                        - y / 90.0
                                            * (1.0
                                                - y / 132.0
                                                    * (1.0 - y / 182.0 * (1.0 - y / 240.0)))))));
    (sin, cos)
}

/// One side.
#[derive(Clone, Debug)]
struct Side {
    circle: Circle,
    tube: f64,
    petals: Vec<Petal>,
}

impl Side {
    fn new(g: &SideGeometry) -> Self {
        let petals = g
            .petals
            .as_ref()
            .map(|p| (0..p.count.min(3)).map(|i| Petal::new(p, i)).collect())
            .unwrap_or_default();
        Self {
            circle: Circle {
                centre: DVec3::ZERO,
                axis: DVec3::X,
                e0: DVec3::Y,
                e1: DVec3::Z,
                radius: g.ring.mean_radius_m,
            },
            tube: g.ring.section_radius_m,
            petals,
        }
    }
}

/// Both sides, immutable.
#[derive(Clone, Debug)]
pub struct Scene {
    active: Side,
    passive: Side,
    law: ContactLaw,
    /// Farthest point of the passive side from its ring centre, m.
    reach: f64,
    /// The soft maximum of n samples begins up to ε ln n before the surfaces meet, m.
    soft_reach: f64,
    /// cos and sin of the nodes and middles of [`CIRCLE_INTERVALS`].
    around: [(f64, f64); 2 * CIRCLE_INTERVALS],
}

/// Friction memory of one place, in the frame of the active ring.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Bristle {
    y: DVec3,
    u: f64,
    active: bool,
}

/// What contact remembers from step to step: bristles and sides.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactState {
    bristles: [[Bristle; SLOTS]; PAIRS],
    /// Last normal of each pair in contact, in the active ring's frame; zero when apart. It tells
    /// on which side a surface is once the cores have met.
    normals: [DVec3; PAIRS],
    /// Distance by which each pair is still known to be apart, m: it need not be measured before
    /// the sides have moved that far. Saves time, changes nothing, and is no part of the digest.
    clearance: [f64; PAIRS],
    /// `X_r3r4` for which the clearances hold.
    measured_at: Option<Pose>,
}

impl Default for ContactState {
    fn default() -> Self {
        Self {
            bristles: [[Bristle::default(); SLOTS]; PAIRS],
            normals: [DVec3::ZERO; PAIRS],
            clearance: [0.0; PAIRS],
            measured_at: None,
        }
    }
}

impl ContactState {
    /// Adds all bits to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        for b in self.bristles.iter().flatten() {
            h.vec3(b.y);
            h.f64(b.u);
            h.u64(u64::from(b.active));
        }
        self.normals.iter().for_each(|n| h.vec3(*n));
    }
}

/// One place of contact, world frame.
#[derive(Clone, Copy, Debug)]
struct Place {
    pair: usize,
    slot: usize,
    merged: Merged,
    /// Bristle in world axes.
    y: DVec3,
}

/// What [`Scene::measure`] found: at most two places and a saddle per pair.
#[derive(Clone, Debug)]
pub struct Contacts {
    places: [Place; MAX_PLACES],
    len: usize,
    law: ContactLaw,
    q_wr: docktwin_core::DQuat,
    deepest: f64,
    touching: bool,
    clearance: [f64; PAIRS],
    x_rp: Pose,
}

/// Powers and energy of all contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactEnergy {
    /// Power lost in the normal law, W.
    pub damping_w: f64,
    /// Power lost in friction, W.
    pub friction_w: f64,
}

/// One place of contact for the record, world frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactSample {
    /// Pair of surfaces, see [`SurfacePair::from_index`].
    pub pair: usize,
    /// Point of contact, m.
    pub point_w_m: DVec3,
    /// Normal force on the passive side, N.
    pub normal_w_n: DVec3,
    /// Friction on the passive side, N.
    pub friction_w_n: DVec3,
    /// Depth, m.
    pub depth_m: f64,
}

impl Scene {
    /// Builds the tables of a checked model.
    #[must_use]
    pub fn new(m: &DockingMechanism) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let around = core::array::from_fn(|i| {
            let (s, c) = (core::f64::consts::PI * i as f64 / CIRCLE_INTERVALS as f64).sin_cos();
            (c, s)
        });
        let passive = Side::new(&m.passive);
        let reach = passive
            .petals
            .iter()
            .map(|p| p.centre.length() + p.reach + p.radius)
            .fold(passive.circle.radius + passive.tube, f64::max);
        Self {
            active: Side::new(&m.active),
            passive,
            reach,
            soft_reach: m.contact.merge_depth_m * MOST_SAMPLES.ln(),
            law: m.contact,
            around,
        }
    }

    /// The law.
    #[must_use]
    pub const fn law(&self) -> &ContactLaw {
        &self.law
    }

    /// Whether the sides overlap anywhere with `x_rp`, the pose of the passive ring frame `r4` in
    /// the active ring frame `r3`.
    #[must_use]
    pub fn touches(&self, x_rp: Pose) -> bool {
        self.measure(&ContactState::default(), Pose::IDENTITY, x_rp).touching
    }

    /// Measures all pairs. `x_wr` and `x_wp` are the world poses of the ring frames `r3` and `r4`.
    #[must_use]
    #[expect(clippy::too_many_lines, reason = "one pass over all pairs")]
    pub fn measure(&self, state: &ContactState, x_wr: Pose, x_wp: Pose) -> Contacts {
        let x_rp = x_wr.inverse() * x_wp;
        let mut out = Contacts::none(&self.law, x_wr);
        out.x_rp = x_rp;
        // No point of the passive side has moved further than this since the clearances were found.
        let moved = state.measured_at.map_or(f64::INFINITY, |last| {
            let turn = last.q.conjugate() * x_rp.q;
            (x_rp.p - last.p).length() + 2.1 * turn.xyz().length() * self.reach
        });
        for (now, then) in out.clearance.iter_mut().zip(state.clearance) {
            *now = (then - moved).max(0.0);
        }
        let passive_circle = Circle {
            centre: x_rp.p,
            axis: x_rp.q * DVec3::X,
            e0: x_rp.q * DVec3::Y,
            e1: x_rp.q * DVec3::Z,
            radius: self.passive.circle.radius,
        };
        let x_pr = x_rp.inverse();
        let active_circle_p = Circle {
            centre: x_pr.p,
            axis: x_pr.q * DVec3::X,
            e0: x_pr.q * DVec3::Y,
            e1: x_pr.q * DVec3::Z,
            radius: self.active.circle.radius,
        };

        if out.clearance[0] <= 0.0 {
            self.ring_ring(state, &passive_circle, x_wr, &mut out);
        }
        for (i, petal) in self.active.petals.iter().enumerate() {
            let pair = SurfacePair::PetalRing(i).index();
            if out.clearance[pair] > 0.0 {
                continue;
            }
            let before = state.normals[pair];
            self.petal_ring(
                petal,
                &passive_circle,
                self.passive.tube,
                before,
                |s| s,
                pair,
                state,
                x_wr,
                &mut out,
            );
        }
        for (i, petal) in self.passive.petals.iter().enumerate() {
            let pair = SurfacePair::RingPetal(i).index();
            if out.clearance[pair] > 0.0 {
                continue;
            }
            // Measured in r4 with the petal first; turned round so that normals point to passive.
            let before = x_pr.q * -state.normals[pair];
            let turn = |mut s: Sample| {
                s.c = x_rp.transform_point(s.c);
                s.n = -(x_rp.q * s.n);
                s.softening = -(x_rp.q * s.softening);
                s
            };
            self.petal_ring(
                petal,
                &active_circle_p,
                self.active.tube,
                before,
                turn,
                pair,
                state,
                x_wr,
                &mut out,
            );
        }
        for (j, passive) in self.passive.petals.iter().enumerate() {
            let centre = x_rp.transform_point(passive.centre);
            let mut coarse: Option<[Segment; COARSE]> = None;
            for (i, active) in self.active.petals.iter().enumerate() {
                let pair = SurfacePair::PetalPetal(i, j).index();
                if out.clearance[pair] > 0.0 {
                    continue;
                }
                let gap = (centre - active.centre).length()
                    - active.reach
                    - passive.reach
                    - active.radius
                    - passive.radius
                    - self.soft_reach;
                if gap > 0.0 {
                    out.clearance[pair] = gap;
                    continue;
                }
                let moved = coarse.get_or_insert_with(|| {
                    passive
                        .coarse
                        .map(|s| Segment { a: x_rp.transform_point(s.a), d: x_rp.q * s.d })
                });
                self.petal_petal(active, passive, moved, x_rp, (i, j), state, x_wr, &mut out);
            }
        }
        out
    }

    fn ring_ring(&self, state: &ContactState, other: &Circle, x_wr: Pose, out: &mut Contacts) {
        let (own, sum) = (&self.active.circle, self.active.tube + self.passive.tube);
        // The rings are apart when their planes' slab and their centres say so.
        let reach = other.radius * (1.0 - other.axis.x * other.axis.x).max(0.0).sqrt();
        let apart = other.centre.x.abs() - reach - sum - self.soft_reach;
        if apart > 0.0 {
            out.clearance[0] = apart;
            return;
        }
        const N: usize = 2 * CIRCLE_INTERVALS;
        let mut d = [0.0; N];
        let mut deepest = f64::NEG_INFINITY;
        for (d, (c, s)) in d.iter_mut().zip(self.around) {
            let p = own.at(c, s);
            *d = sum - (other.nearest(p) - p).length();
            deepest = deepest.max(*d);
        }
        // Between nodes 7.5° apart the distance changes by no more than the arc.
        let between = own.radius * core::f64::consts::PI / (2.0 * CIRCLE_INTERVALS as f64);
        let far = -between - self.soft_reach - deepest;
        if far > 0.0 {
            out.clearance[0] = far;
            return;
        }
        let mut samples = [Sample::NONE; CIRCLE_INTERVALS];
        let width = core::f64::consts::PI / CIRCLE_INTERVALS as f64;
        let k = law::stiffness(&self.law.normal);
        for (i, sample) in samples.iter_mut().enumerate() {
            let (l, m, r) = (d[2 * i], d[2 * i + 1], d[(2 * i + 2) % N]);
            let (t, guess) = parabola_peak(l, m, r);
            #[expect(clippy::cast_precision_loss, reason = "small numbers")]
            let mid = (2 * i + 1) as f64 * width;
            let mut u = mid + t * width;
            if guess < deepest - 40.0 * self.law.merge_depth_m && guess < -1e-3 - self.soft_reach {
                // Far from deciding anything: the interpolated value will do.
                *sample = Sample { u, depth: guess, ..Sample::NONE };
                continue;
            }
            let (mut c, mut n, mut depth) = (DVec3::ZERO, DVec3::ZERO, 0.0);
            for last in [false, false, true] {
                let (sin, cos) = u.sin_cos();
                let p = own.at(cos, sin);
                let q = other.nearest(p);
                let gap = q - p;
                let dist = gap.length();
                (n, depth) = (gap / dist.max(1e-12), sum - dist);
                c = p + n * (self.active.tube - 0.5 * depth);
                if last {
                    break;
                }
                // Newton on f(u) = ½|q − p|²: f' = −(q − p)·p', and q moves along its own tangent.
                let dp = (own.e1 * cos - own.e0 * sin) * own.radius;
                let tau = other.axis.cross(q - other.centre) / other.radius;
                let along = dp.dot(tau);
                // How far q follows p along its circle.
                let lever =
                    (p - other.centre).dot((q - other.centre) / other.radius) / other.radius;
                let f1 = -gap.dot(dp);
                let f2 =
                    dp.length_squared() - along * along / lever.max(0.1) + gap.dot(p - own.centre);
                let next =
                    if f2 > 1e-9 { (u - f1 / f2).clamp(mid - width, mid + width) } else { u };
                // The depth is stationary there: a micrometre along the ring changes nothing.
                if (next - u).abs() * own.radius < 1e-6 {
                    break;
                }
                u = next;
            }
            *sample = Sample { u, depth, c, n, k, softening: DVec3::ZERO };
        }
        let found = places(&samples, true, self.law.merge_depth_m, &self.law.normal);
        out.add(0, found, state, x_wr, true);
    }

    #[expect(clippy::too_many_arguments, reason = "one call site per direction")]
    fn petal_ring(
        &self,
        petal: &Petal,
        circle: &Circle,
        tube: f64,
        before: DVec3,
        turn: impl Fn(Sample) -> Sample,
        pair: usize,
        state: &ContactState,
        x_wr: Pose,
        out: &mut Contacts,
    ) {
        let sum = petal.radius + tube;
        let away = (circle.nearest(petal.centre) - petal.centre).length();
        let far = away - petal.reach - sum - self.soft_reach;
        if far > 0.0 {
            out.clearance[pair] = far;
            return;
        }
        let signed = |p: DVec3, q: DVec3| {
            let gap = q - p;
            let dist = gap.length();
            if crossed(gap, dist, before) { -dist } else { dist }
        };
        let look = |seg: &Segment| {
            let (s, p, q) = segment_circle(seg, circle);
            let dist = signed(p, q);
            // The distance is stationary along the ruling and around the ring, so the depth grows
            // with u as the ruling's own point moves towards the ring. Times the distance, which
            // leaves zeros where they are.
            let slope = petal.sweep(seg, s).dot(q - p) * dist.signum();
            ((s, p, q, dist), slope)
        };
        const N: usize = 2 * RING_INTERVALS + 1;
        let mut d = [f64::NEG_INFINITY; N];
        let mut slopes = [0.0; N];
        let mut deepest = f64::NEG_INFINITY;
        // Nodes first: most petals are far from the ring, and rulings half an interval apart are
        // at most this far from each other.
        let step = (petal.fine[0].a - petal.fine[1].a).length();
        for start in [0, 1] {
            for i in (start..N).step_by(2) {
                let ((.., dist), slope) = look(&petal.fine[i]);
                (d[i], slopes[i]) = (sum - dist, slope);
                deepest = deepest.max(d[i]);
            }
            let far = -step - self.soft_reach - deepest;
            if start == 0 && far > 0.0 {
                out.clearance[pair] = far;
                return;
            }
        }
        let mut samples = [Sample::NONE; RING_INTERVALS];
        let width = 1.0 / RING_INTERVALS as f64;
        let kc = law::stiffness(&self.law.normal);
        for (i, sample) in samples.iter_mut().enumerate() {
            let (t, guess) = parabola_peak(d[2 * i], d[2 * i + 1], d[2 * i + 2]);
            #[expect(clippy::cast_precision_loss, reason = "small numbers")]
            let mid = -1.0 + (2 * i + 1) as f64 * width;
            let mut u = mid + t * width;
            if guess < deepest - 40.0 * self.law.merge_depth_m && guess < -1e-3 - self.soft_reach {
                *sample = Sample { u, depth: guess, ..Sample::NONE };
                continue;
            }
            if guess > deepest - 10.0 * self.law.merge_depth_m {
                // A parabola through nodes this far apart misses a narrow peak by micrometres.
                let half = if slopes[2 * i + 1] > 0.0 { 2 * i + 1 } else { 2 * i };
                let from = if half == 2 * i { mid - width } else { mid };
                u = top(u, [(from, slopes[half]), (from + width, slopes[half + 1])], |u| {
                    look(&petal.ruling(u)).1
                });
            }
            let seg = petal.ruling(u);
            let ((s, p, q, dist), _) = look(&seg);
            let gap = q - p;
            let n = if gap.length() < 1e-4 && before != DVec3::ZERO { before } else { gap / dist };
            let depth = sum - dist;
            let (k, soft) = petal_stiffness(kc, &[(petal, s)]);
            let tau = circle.axis.cross(q - circle.centre) / circle.radius;
            let softening = if s > 0.0 && s < 1.0 {
                sliding_direction(seg.d.normalize(), tau) * soft[0]
            } else {
                DVec3::ZERO
            };
            *sample =
                turn(Sample { u, depth, c: p + n * (petal.radius - 0.5 * depth), n, k, softening });
        }
        let found = places(&samples, false, self.law.merge_depth_m, &self.law.normal);
        out.add(pair, found, state, x_wr, true);
    }

    #[expect(clippy::too_many_arguments, reason = "one call site")]
    #[expect(clippy::too_many_lines, reason = "one search, its pieces share everything")]
    fn petal_petal(
        &self,
        a: &Petal,
        b: &Petal,
        b_coarse: &[Segment; COARSE],
        x_rp: Pose,
        (i, j): (usize, usize),
        state: &ContactState,
        x_wr: Pose,
        out: &mut Contacts,
    ) {
        let pair = SurfacePair::PetalPetal(i, j).index();
        let before = state.normals[pair];
        let sum = a.radius + b.radius;
        let depth_of = |near: &super::shape::Nearest| {
            let gap = near.pb - near.pa;
            let dist = gap.length();
            sum - if crossed(gap, dist, before) { -dist } else { dist }
        };
        let mut table = [[0.0; COARSE]; COARSE];
        let mut deepest = f64::NEG_INFINITY;
        for (row, sa) in table.iter_mut().zip(&a.coarse) {
            for (cell, sb) in row.iter_mut().zip(b_coarse) {
                *cell = depth_of(&segment_segment(sa, sb));
                deepest = deepest.max(*cell);
            }
        }
        let step = |p: &Petal| 0.5 * (p.coarse[0].a - p.coarse[1].a).length();
        let between = step(a) + step(b);
        let far = -between - self.soft_reach - deepest;
        if far > 0.0 {
            out.clearance[pair] = far;
            return;
        }
        let r_rp = DMat3::from_quat(x_rp.q);
        let b_ruling = |v: f64| {
            let s = b.ruling(v);
            Segment { a: x_rp.p + r_rp * s.a, d: r_rp * s.d }
        };
        let kc = law::stiffness(&self.law.normal);
        let spacing = 2.0 / (COARSE - 1) as f64;
        let mut samples = [Sample::NONE; 2 * ALONG];
        // Both halves of the active petal have a candidate of their own: an edge each.
        let best_of = |half: usize| {
            let rows = if half == 0 { 0..=(COARSE - 1) / 2 } else { (COARSE - 1) / 2..=COARSE - 1 };
            let (mut bi, mut bj) = (*rows.start(), 0);
            for r in rows {
                for c in 0..COARSE {
                    if table[r][c] > table[bi][bj] {
                        (bi, bj) = (r, c);
                    }
                }
            }
            (table[bi][bj], bi, bj)
        };
        let looks = [best_of(0), best_of(1)];
        let first = usize::from(looks[1].0 > looks[0].0);
        for half in [first, 1 - first] {
            let (u_min, u_max) = if half == 0 { (-1.0, 0.0) } else { (0.0, 1.0) };
            let (mut best, bi, bj) = looks[half];
            #[expect(clippy::cast_precision_loss, reason = "small numbers")]
            let (mut u, mut v) = (-1.0 + spacing * bi as f64, -1.0 + spacing * bj as f64);
            // Between the rulings looked at it can rise by no more than their distance.
            if best + between < deepest - 40.0 * self.law.merge_depth_m {
                continue;
            }
            let mut h = 0.15 * spacing;
            let of = |s: &Segment, t: &Segment| depth_of(&segment_segment(s, t));
            for _ in 0..REFINEMENTS {
                let before_round = best;
                let (u0, u1) = ((u - h).max(u_min), (u + h).min(u_max));
                let t = b_ruling(v);
                (u, best) = climb(u, best, u0, u1, |x| of(&a.ruling(x), &t));
                let (v0, v1) = ((v - h).max(-1.0), (v + h).min(1.0));
                let s = a.ruling(u);
                (v, best) = climb(v, best, v0, v1, |x| of(&s, &b_ruling(x)));
                // A ridge may lead away between the two directions.
                let (mut to, from) = ((u, v), (u, v));
                let us = [-h, h].map(|d| (from.0 + d).clamp(u_min, u_max));
                let vs = [-h, h].map(|d| (from.1 + d).clamp(-1.0, 1.0));
                let (ss, ts) = (us.map(|u| a.ruling(u)), vs.map(b_ruling));
                for (x, s) in us.iter().zip(&ss) {
                    for (y, t) in vs.iter().zip(&ts) {
                        if (x - from.0).abs() < 1e-9 || (y - from.1).abs() < 1e-9 {
                            continue;
                        }
                        let value = of(s, t);
                        if value > best {
                            (to, best) = ((*x, *y), value);
                        }
                    }
                }
                (u, v) = to;
                // Shorter looks only where these lead no further; long ones see no peak that is
                // nearer than they reach.
                if best - before_round < 1e-6 {
                    h *= 0.15;
                    if h < 5e-4 {
                        break;
                    }
                }
            }
            deepest = deepest.max(best);
            let (sa, sb) = (a.ruling(u), b_ruling(v));
            for piece in 0..ALONG {
                #[expect(clippy::cast_precision_loss, reason = "small numbers")]
                let (s0, len) = (piece as f64 / ALONG as f64, 1.0 / ALONG as f64);
                let part = Segment { a: sa.at(s0), d: sa.d * len };
                let near = segment_segment(&part, &sb);
                let depth = depth_of(&near);
                let gap = near.pb - near.pa;
                let n = if gap.length() < 1e-4 && before != DVec3::ZERO {
                    before
                } else if gap.length() < 1e-12 {
                    sa.d.cross(sb.d).normalize_or(DVec3::X)
                } else {
                    gap / (sum - depth)
                };
                let s_a = s0 + near.sa * len;
                let (k, soft) = petal_stiffness(kc, &[(a, s_a), (b, near.sb)]);
                let (da, db) = (sa.d.normalize(), sb.d.normalize());
                let mut softening = DVec3::ZERO;
                if s_a > 0.0 && s_a < 1.0 {
                    softening += sliding_direction(da, db) * soft[0];
                }
                if near.sb > 0.0 && near.sb < 1.0 {
                    softening -= sliding_direction(db, da) * soft[1];
                }
                samples[half * ALONG + piece] =
                    Sample { u, depth, c: near.pa + n * (a.radius - 0.5 * depth), n, k, softening };
            }
        }
        // One place per pair of petals, however long the line of contact.
        let found = single(&samples, self.law.merge_depth_m, &self.law.normal);
        out.add(pair, found, state, x_wr, false);
    }
}

/// Whether the cores have gone through each other. Only then does the gap lie opposite the last
/// normal; far parts of a curved petal may lie a little behind it.
fn crossed(gap: DVec3, dist: f64, before: DVec3) -> bool {
    gap.dot(before) < -0.7 * dist
}

/// One parabolic step uphill between `lo` and `hi`.
fn climb(x: f64, fx: f64, lo: f64, hi: f64, f: impl Fn(f64) -> f64) -> (f64, f64) {
    let (a, b) = (x - lo, hi - x);
    let mut best = (x, fx);
    // At an end of the range there is nothing to look at on that side.
    let look = |at: f64, far: bool, best: &mut (f64, f64)| {
        let value = if far { f(at) } else { f64::NEG_INFINITY };
        if value > best.1 {
            *best = (at, value);
        }
        value
    };
    let fl = look(lo, a > 1e-9, &mut best);
    let fh = look(hi, b > 1e-9, &mut best);
    if a > 1e-9 && b > 1e-9 {
        // Lagrange parabola through three points that need not be evenly spaced.
        let (dl, dh) = ((fx - fl) / a, (fh - fx) / b);
        let curve = (dh - dl) / (a + b);
        if curve < 0.0 {
            let slope = dl + curve * a;
            let t = (x - slope / (2.0 * curve)).clamp(lo, hi);
            look(t, (t - x).abs() > 1e-9, &mut best);
        }
    }
    best
}

/// Series stiffness of the place with the petals bending as cantilevers, 1/k = 1/k_c + Σ s³/(3EI),
/// and −∂ln k/∂s of each, 1/m. `s` is given as a fraction of the ruling.
fn petal_stiffness<const N: usize>(kc: f64, petals: &[(&Petal, f64); N]) -> (f64, [f64; N]) {
    let mut compliance = 1.0 / kc;
    for (p, s) in petals {
        compliance += (s * p.length).powi(3) * p.compliance;
    }
    let k = 1.0 / compliance;
    let soft = core::array::from_fn(|i| {
        let (p, s) = petals[i];
        k * 3.0 * (s * p.length).powi(2) * p.compliance
    });
    (k, soft)
}

/// How the contact point moves along `a` when the other surface, whose own line of contact runs
/// along `b`, is displaced: the vector dual to `a` in the plane of both.
fn sliding_direction(a: DVec3, b: DVec3) -> DVec3 {
    let c = a.dot(b);
    (a - b * c) / (1.0 - c * c).max(0.1)
}

impl Contacts {
    /// No contact.
    pub(crate) const fn none(law: &ContactLaw, x_wr: Pose) -> Self {
        const NOWHERE: Place = Place { pair: 0, slot: 0, merged: Merged::ZERO, y: DVec3::ZERO };
        Self {
            places: [NOWHERE; MAX_PLACES],
            len: 0,
            law: *law,
            q_wr: x_wr.q,
            deepest: 0.0,
            touching: false,
            clearance: [0.0; PAIRS],
            x_rp: Pose::IDENTITY,
        }
    }

    fn add(
        &mut self,
        pair: usize,
        (found, depth): super::merge::Places,
        state: &ContactState,
        x_wr: Pose,
        several: bool,
    ) {
        if depth <= 0.0 {
            // Half of the gap, because what is far from touching is only interpolated.
            self.clearance[pair] = (-0.5 * depth - 2e-4).max(0.0);
            return;
        }
        self.touching = true;
        let both = found[0].is_some() && found[1].is_some();
        for (order, merged) in found.into_iter().enumerate() {
            let Some(mut m) = merged else { continue };
            self.deepest = self.deepest.max(m.depth);
            let slot = if order >= 2 || !several {
                0
            } else {
                state.slot_for(pair, m.u, both.then_some(order), &found)
            };
            m.point = x_wr.transform_point(m.point);
            m.dir = x_wr.q * m.dir;
            m.couple = x_wr.q * m.couple;
            m.slide_n = x_wr.q * m.slide_n;
            let memory = state.bristles[pair][slot];
            let y = if memory.active { x_wr.q * memory.y } else { DVec3::ZERO };
            self.places[self.len] = Place { pair, slot, merged: m, y };
            self.len += 1;
        }
    }

    /// Number of places, saddles included.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Whether nothing touches.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Whether any pair overlaps.
    #[must_use]
    pub const fn touching(&self) -> bool {
        self.touching
    }

    /// Deepest overlap, m.
    #[must_use]
    pub const fn deepest_m(&self) -> f64 {
        self.deepest
    }

    /// Stored elastic energy, J.
    #[must_use]
    pub fn stored_j(&self) -> f64 {
        self.places[..self.len].iter().map(|p| p.merged.energy_j).sum()
    }

    /// Wrench on the passive side about `about_w` (m, world), world axes, and the power lost. The
    /// active side gets the opposite at the same points. `active` and `passive` are the motions of
    /// both bodies as velocity at `about_w` and angular velocity, world axes; `h` is the step over
    /// which bristles move.
    #[must_use]
    pub fn wrench(
        &self,
        about_w: DVec3,
        active: Twist,
        passive: Twist,
        h: f64,
    ) -> (Wrench, ContactEnergy) {
        let mut w = Wrench::ZERO;
        let mut e = ContactEnergy::default();
        for p in &self.places[..self.len] {
            let one = self.evaluate(p, about_w, active, passive, h);
            w += one.wrench;
            e.damping_w += one.damping_w;
            e.friction_w += one.friction_w;
        }
        (w, e)
    }

    fn evaluate(&self, p: &Place, about_w: DVec3, active: Twist, passive: Twist, h: f64) -> One {
        let m = &p.merged;
        let arm = m.point - about_w;
        let w_rel = passive.w - active.w;
        let v_rel = passive.v - active.v + w_rel.cross(arm);
        let rate = -(m.dir.dot(v_rel) + m.couple.dot(w_rel));
        let normal = law::normal_force(&self.law.normal, m.elastic_n, rate);
        let size = m.dir.length();
        let n = if size > 1e-9 { m.dir / size } else { DVec3::X };
        // One bristle for sliding (tangential) and for turning about the normal (along n, at the
        // lever of the spread): a touch spread around a ring resists roll.
        let slip = v_rel - n * n.dot(v_rel) + n * (n.dot(w_rel) * m.spread_m);
        let (rub, y_end) =
            law::friction(&self.law, normal.total_n * size * m.rubbing, p.y, slip, h);
        let twist = n.dot(rub);
        let friction = rub - n * twist;
        let f_n = m.dir * normal.total_n;
        let mut wrench = Wrench::at(arm, f_n + friction + m.slide_n);
        wrench.m += m.couple * normal.total_n + n * (twist * m.spread_m);
        One {
            wrench,
            normal: f_n,
            friction,
            y_end,
            damping_w: (normal.total_n - normal.elastic_n) * rate,
            friction_w: -rub.dot(slip),
        }
    }

    /// Lets the friction memory live on over `h`, with the velocities of [`Self::wrench`].
    pub fn commit(
        &self,
        state: &mut ContactState,
        about_w: DVec3,
        active: Twist,
        passive: Twist,
        h: f64,
    ) {
        let back = self.q_wr.conjugate();
        let mut next = ContactState {
            clearance: self.clearance,
            measured_at: Some(self.x_rp),
            ..ContactState::default()
        };
        for p in &self.places[..self.len] {
            if p.merged.elastic_n < 0.0 {
                continue;
            }
            let one = self.evaluate(p, about_w, active, passive, h);
            next.bristles[p.pair][p.slot] =
                Bristle { y: back * one.y_end, u: p.merged.u, active: true };
            let dir = back * p.merged.dir;
            if next.normals[p.pair] == DVec3::ZERO {
                next.normals[p.pair] = dir.normalize_or_zero();
            }
        }
        *state = next;
    }

    /// The places for the record; returns how many were written.
    pub fn samples(
        &self,
        about_w: DVec3,
        active: Twist,
        passive: Twist,
        h: f64,
        out: &mut [ContactSample],
    ) -> usize {
        let mut n = 0;
        for p in self.places[..self.len].iter().filter(|p| p.merged.elastic_n >= 0.0) {
            let Some(slot) = out.get_mut(n) else { break };
            let one = self.evaluate(p, about_w, active, passive, h);
            *slot = ContactSample {
                pair: p.pair,
                point_w_m: p.merged.point,
                normal_w_n: one.normal,
                friction_w_n: one.friction,
                depth_m: p.merged.depth,
            };
            n += 1;
        }
        n
    }
}

struct One {
    wrench: Wrench,
    normal: DVec3,
    friction: DVec3,
    y_end: DVec3,
    damping_w: f64,
    friction_w: f64,
}

impl ContactState {
    /// Slot whose remembered place is nearest; with two places at once each gets its own.
    fn slot_for(
        &self,
        pair: usize,
        u: f64,
        order: Option<usize>,
        found: &[Option<Merged>; 4],
    ) -> usize {
        let slots = &self.bristles[pair];
        let far = |slot: usize, u: f64| {
            if !slots[slot].active {
                return f64::INFINITY;
            }
            let d = (slots[slot].u - u).abs();
            // Around a ring positions repeat after 2π; rulings span only 2, so this never applies.
            if d > core::f64::consts::PI { core::f64::consts::TAU - d } else { d }
        };
        match (order, found[0], found[1]) {
            (Some(order), Some(a), Some(b)) => {
                let straight = far(0, a.u).min(far(1, b.u));
                let crossed = far(1, a.u).min(far(0, b.u));
                usize::from(crossed < straight) ^ order
            }
            _ => usize::from(far(1, u) < far(0, u)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_series_of_sine_and_cosine() {
        for i in -70..=70 {
            let x = f64::from(i) * 0.01;
            let (s, c) = sin_cos_small(x);
            assert!((s - x.sin()).abs() < 2e-16 && (c - x.cos()).abs() < 3e-16, "{x}");
        }
    }
}
