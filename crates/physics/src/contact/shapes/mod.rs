//! Pairs of the surfaces that a file lists: a core with a ball swept over it, on either side.
//!
//! As for rings and petals every place counts, no place is chosen among others, and all forces are the gradient of
//! one energy: places along a partner's core less the saddles between them, and walls of a hollow less the edges at
//! which they meet (`contact/cells`). Two convex cores have one place.

mod around;
mod convex;
mod extremes;
mod revolved;

use arrayvec::ArrayVec;
use docktwin_core::DVec3;
use docktwin_model::{ContactLaw, DockingMechanism, NormalLaw, Surface, SurfaceCore};

use super::{
    cells::{Elastic, Load, RingPair, RingTable, Touch, first_share},
    geometry::Circle,
    look::Frame,
};
use revolved::Meridian;

/// Most places of a pair that are told apart, and as many saddles.
pub(crate) const MOST_SPOTS: usize = 24;

/// A point where two surfaces are deepest in each other, or a saddle between two of them; in the frame of the first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot {
    /// Depth, m.
    pub(crate) depth: f64,
    /// Middle between both surfaces.
    pub(crate) point: DVec3,
    /// −∂depth/∂(place of the second surface): the normal from the first to the second; shorter than 1 only on the
    /// axis of a hollow or torus, where the pushes of all sides cancel.
    pub(crate) normal: DVec3,
}

/// Places in their order along the partner's core, and what is taken off between neighbours.
#[derive(Debug, Default)]
pub(crate) struct Spots {
    places: ArrayVec<(u8, Spot), MOST_SPOTS>,
    /// Each with the two places between which it lies.
    saddles: ArrayVec<([usize; 2], Spot), MOST_SPOTS>,
    /// What saddles on an edge of two walls take off twice.
    corners: ArrayVec<Spot, MOST_SPOTS>,
}

impl Spots {
    /// Bristles are told apart by the wall and the place along the partner.
    fn place(&mut self, wall: usize, spot: Spot) {
        let along = self.places.iter().filter(|(cell, _)| usize::from(cell / 8) == wall).count();
        let cell = u8::try_from(8 * wall + along.min(7)).unwrap_or(u8::MAX);
        // A checked hollow has no more walls, and a wall no more places, than there is room for.
        let _ = self.places.try_push((cell, spot));
    }

    fn saddle(&mut self, between: [usize; 2], spot: Spot) {
        if spot.depth > 0.0 {
            let _ = self.saddles.try_push((between, spot));
        }
    }

    fn corner(&mut self, spot: Spot) {
        if spot.depth > 0.0 {
            let _ = self.corners.try_push(spot);
        }
    }

    fn count(&self) -> usize {
        self.places.len()
    }

    /// The deepest place from one on.
    fn deepest_from(&self, first: usize) -> usize {
        let of = first..self.places.len();
        of.max_by(|a, b| self.places[*a].1.depth.total_cmp(&self.places[*b].1.depth))
            .unwrap_or(first)
    }

    fn deepest(&self) -> f64 {
        self.places.iter().map(|(_, s)| s.depth).fold(f64::NEG_INFINITY, f64::max)
    }

    fn load(&self, elastic: &Elastic, out: &mut Load) {
        let mut touch_of = [None; MOST_SPOTS];
        let mut net_n = 0.0;
        for (i, (cell, s)) in self.places.iter().enumerate().filter(|(_, (_, s))| s.depth > 0.0) {
            let force_n = elastic.force(s.depth);
            net_n += force_n * s.normal.length();
            out.energy_j += elastic.energy(s.depth);
            out.push(s.point, s.normal * force_n);
            touch_of[i] = Some(out.touches.len());
            let touch = Touch {
                cell: *cell,
                depth: s.depth,
                elastic: s.normal * force_n,
                rubbing_n: force_n,
                share: 1.0,
                point: s.point,
                dir: s.normal,
                ..Touch::NONE
            };
            if out.touches.try_push(touch).is_err() {
                touch_of[i] = None;
            }
        }
        for ([a, b], s) in self.saddles.iter().filter(|(_, s)| s.depth > 0.0) {
            let force_n = elastic.force(s.depth);
            net_n -= force_n * s.normal.length();
            out.energy_j -= elastic.energy(s.depth);
            out.push(s.point, -s.normal * force_n);
            let depth = |place: usize| self.places.get(place).map_or(s.depth, |(_, p)| p.depth);
            let part = first_share(depth(*a), depth(*b), s.depth);
            for (place, part) in [(*a, part), (*b, 1.0 - part)] {
                let Some(t) = touch_of
                    .get(place)
                    .copied()
                    .flatten()
                    .and_then(|t: usize| out.touches.get_mut(t))
                else {
                    continue;
                };
                let before = t.rubbing_n;
                t.elastic -= s.normal * (force_n * part);
                t.rubbing_n = (t.rubbing_n - force_n * part).max(0.0);
                t.share *= if before > 0.0 { t.rubbing_n / before } else { 0.0 };
            }
        }
        for s in self.corners.iter().filter(|s| s.depth > 0.0) {
            let force_n = elastic.force(s.depth);
            net_n += force_n * s.normal.length();
            out.energy_j += elastic.energy(s.depth);
            out.push(s.point, s.normal * force_n);
        }
        out.level_rubbing(net_n.max(0.0));
    }
}

/// What is precomputed of one surface.
#[derive(Clone, Debug)]
struct Shape {
    core: SurfaceCore,
    ball: f64,
    /// Its frame in the ring frame of its side.
    x: Frame,
    /// Ball that holds it, in its own frame.
    centre: DVec3,
    reach: f64,
    /// Of a torus or hollow.
    meridian: Option<Meridian>,
}

impl Shape {
    const fn rank(&self) -> u8 {
        match self.core {
            SurfaceCore::Hollow { .. } => 2,
            SurfaceCore::Torus { .. } => 1,
            _ => 0,
        }
    }

    fn new(s: &Surface) -> Self {
        let (centre, reach) = s.core.ball_around();
        let meridian = match &s.core {
            SurfaceCore::Torus { radius } => Some(Meridian::new(&[[0.0, *radius]])),
            SurfaceCore::Hollow { profile } => Some(Meridian::new(profile)),
            _ => None,
        };
        Self {
            core: s.core.clone(),
            ball: s.rounding_m,
            x: Frame::of(s.x_ring),
            centre,
            reach: reach + s.rounding_m,
            meridian,
        }
    }
}

/// One pair.
#[derive(Clone, Debug)]
pub(crate) struct ShapePair {
    /// The first in the frame of whose core the pair is measured.
    first: Shape,
    second: Shape,
    /// Whether the first one is the passive side's: a hollow comes before a torus, and that before the others.
    pub(crate) turned: bool,
    normal: NormalLaw,
    /// Kinetic and static.
    pub(crate) friction: f64,
    merge_depth_m: f64,
}

impl ShapePair {
    /// All pairs of a mechanism, in the order of [`DockingMechanism::surface_pairs`].
    pub(crate) fn all(m: &DockingMechanism) -> Vec<Self> {
        m.surface_pairs()
            .iter()
            .map(|p| {
                let law: ContactLaw = m.contact.of_pair(p.stiffness_n_m, p.friction);
                let [a, b] = &p.surfaces;
                let (a, b) = (Shape::new(a), Shape::new(b));
                let turned = b.rank() > a.rank();
                let (first, second) = if turned { (b, a) } else { (a, b) };
                Self {
                    first,
                    second,
                    turned,
                    normal: law.normal,
                    friction: p.friction,
                    merge_depth_m: m.contact.merge_depth_m,
                }
            })
            .collect()
    }

    /// Frame of the first surface in the active ring's.
    pub(crate) fn first_frame(&self, x_rp: &Frame) -> Frame {
        if self.turned { *x_rp * self.first.x } else { self.first.x }
    }

    /// The second surface's frame in the first's, `x_rp` being the passive ring's in the active one's.
    fn between(&self, x_rp: &Frame) -> Frame {
        let x = if self.turned { x_rp.inverse() } else { *x_rp };
        self.first.x.inverse() * x * self.second.x
    }

    /// What it stores and how it pushes, in the frame of the first surface; nothing where they are apart.
    pub(crate) fn load(&self, x_rp: &Frame, table: &RingTable, out: &mut Load) {
        let x = self.between(x_rp);
        let gap = (x.point(self.second.centre) - self.first.centre).length();
        if gap > self.first.reach + self.second.reach {
            return;
        }
        let elastic = Elastic { normal: self.normal };
        if let Some(rings) = self.rings(&x, table) {
            // Apart: nothing.
            let _ = rings.load(&elastic, out);
            return;
        }
        let spots = self.spots(&x);
        if spots.deepest() > 0.0 {
            spots.load(&elastic, out);
        }
    }

    /// Depth of the deepest place, m: positive in contact, negative apart.
    pub(crate) fn depth(&self, x_rp: &Frame, table: &RingTable) -> f64 {
        let x = self.between(x_rp);
        self.rings(&x, table).map_or_else(|| self.spots(&x).deepest(), |rings| rings.depth_m())
    }

    /// Two toruses are two rings.
    fn rings<'a>(&self, x: &Frame, table: &'a RingTable) -> Option<RingPair<'a>> {
        let (SurfaceCore::Torus { radius: a }, SurfaceCore::Torus { radius: b }) =
            (&self.first.core, &self.second.core)
        else {
            return None;
        };
        let circles = (
            Circle { radius: *a, ball: self.first.ball },
            Circle { radius: *b, ball: self.second.ball },
        );
        let back = x.inverse();
        Some(RingPair::new(circles, (back.r, back.p), table, self.merge_depth_m))
    }

    fn spots(&self, x: &Frame) -> Spots {
        let balls = [self.first.ball, self.second.ball];
        let mut out = Spots::default();
        match (&self.first.meridian, &self.second.core) {
            (Some(m), SurfaceCore::Sphere) => m.against_point(x.p, balls, &mut out),
            (Some(m), SurfaceCore::Capsule { half }) => {
                m.against_segment(
                    [x.point(DVec3::X * -half), x.point(DVec3::X * *half)],
                    balls,
                    &mut out,
                );
            }
            (Some(m), SurfaceCore::Torus { radius }) => {
                m.against_circle(x, *radius, balls, &mut out)
            }
            // A checked model has no others.
            (Some(_), _) => {}
            (None, other) => {
                let spot = convex::spot(&self.first.core, other, x, balls);
                out.place(0, spot);
            }
        }
        out
    }
}
