//! What a measurement found, and the law applied to it for given velocities.

use arrayvec::ArrayVec;
use docktwin_core::{DVec3, Pose, Twist, Wrench};
use docktwin_model::{ContactLaw, NormalLaw};

use super::{
    cells::{Load, Touch},
    law,
    look::Look,
    memory::{Apart, ContactState, MOST_PAIRS, MOST_PLACES, Seeds, Track},
};

/// One place, in the active ring's frame.
#[derive(Clone, Copy, Debug)]
struct Place {
    pair: u8,
    touch: Touch,
    bristle: DVec3,
    /// Friction of a pair of listed surfaces; `None` for the law's own.
    friction: Option<f64>,
}

/// What [`super::Scene::measure`] found.
#[derive(Clone, Debug)]
pub struct Contacts {
    places: ArrayVec<Place, MOST_PLACES>,
    law: ContactLaw,
    /// Elastic wrench of all places on the passive side about the active ring's centre, in its axes.
    elastic: Wrench,
    x_wr: Pose,
    stored_j: f64,
    deepest_m: f64,
    touching: bool,
    /// For the next search: where elements are deepest, and how far the others are apart.
    pub(crate) seeds: Seeds,
    apart: ArrayVec<Apart, MOST_PAIRS>,
    pub(crate) x_rp: Pose,
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
    /// Pair of surfaces, see [`super::SurfacePair::from_index`].
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

/// Damping and friction of one place on the passive side.
struct Loss {
    /// Along the mean normal, N.
    damping: DVec3,
    friction: DVec3,
    /// About the place's point, N·m.
    couple: DVec3,
    bristle_end: DVec3,
    power: ContactEnergy,
}

impl Contacts {
    /// Nothing yet, of a measurement at `x_rp`.
    #[inline]
    pub(crate) fn new(law: &ContactLaw, x_wr: Pose, x_rp: Pose) -> Self {
        Self {
            places: ArrayVec::new(),
            law: *law,
            elastic: Wrench::ZERO,
            x_wr,
            stored_j: 0.0,
            deepest_m: 0.0,
            touching: false,
            seeds: ArrayVec::new(),
            apart: ArrayVec::new(),
            x_rp,
        }
    }

    /// As [`Self::new`], in place: nothing is moved but what is kept.
    #[inline]
    pub(crate) fn begin(&mut self, law: &ContactLaw, x_wr: Pose, x_rp: Pose) {
        self.places.clear();
        self.seeds.clear();
        self.apart.clear();
        self.law = *law;
        self.elastic = Wrench::ZERO;
        self.x_wr = x_wr;
        self.stored_j = 0.0;
        self.deepest_m = 0.0;
        self.touching = false;
        self.x_rp = x_rp;
    }

    /// Keeps how far the next pair's elements are apart.
    pub(crate) fn push_apart(&mut self, apart: Apart) {
        // A scene has no more pairs than there is room for.
        let _ = self.apart.try_push(apart);
    }

    /// Adds what the next pair does.
    pub(crate) fn add(
        &mut self,
        load: &Load,
        look: &Look<'_>,
        apart: Apart,
        neighbours: fn(usize, usize) -> bool,
    ) {
        self.push_apart(apart);
        self.take(load, look, None, neighbours);
    }

    /// Adds what a pair of listed surfaces does; any two of its places may follow each other.
    pub(crate) fn add_listed(&mut self, load: &Load, look: &Look<'_>, friction: f64) {
        self.take(load, look, Some(friction), |_, _| true);
    }

    fn take(
        &mut self,
        load: &Load,
        look: &Look<'_>,
        friction: Option<f64>,
        neighbours: fn(usize, usize) -> bool,
    ) {
        if load.touches.is_empty() {
            return;
        }
        let (x, sign, pair) = (&look.first, look.sign, look.pair);
        self.touching = true;
        self.deepest_m = self.deepest_m.max(load.depth());
        self.stored_j += load.energy_j;
        let force = x.r * load.force * sign;
        self.elastic.f += force;
        self.elastic.m += x.r * load.moment * sign + x.p.cross(force);
        for touch in &load.touches {
            let mut t = *touch;
            t.point = x.point(t.point);
            t.elastic = x.r * t.elastic * sign;
            t.dir = x.r * t.dir * sign;
            t.couple = x.r * t.couple * sign;
            let of_pair = || look.state.of_pair(pair);
            let from = of_pair().find(|k| k.cell == t.cell).or_else(|| {
                of_pair().find(|k| neighbours(usize::from(k.cell), usize::from(t.cell)))
            });
            let bristle = from.map_or(DVec3::ZERO, |k| k.bristle);
            let pair = u8::try_from(pair).unwrap_or(u8::MAX);
            if self.places.try_push(Place { pair, touch: t, bristle, friction }).is_err() {
                return;
            }
        }
    }

    /// Number of places.
    #[must_use]
    pub fn len(&self) -> usize {
        self.places.iter().filter(|p| p.touch.rubbing_n > 0.0).count()
    }

    /// Whether nothing touches.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        !self.touching
    }

    /// Whether any pair overlaps.
    #[must_use]
    pub const fn touching(&self) -> bool {
        self.touching
    }

    /// Deepest overlap, m.
    #[must_use]
    pub const fn deepest_m(&self) -> f64 {
        self.deepest_m
    }

    /// Stored elastic energy, J.
    #[must_use]
    pub const fn stored_j(&self) -> f64 {
        self.stored_j
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
        let mut w = self.elastic;
        let mut e = ContactEnergy::default();
        let motion = self.motion(about_w, active, passive);
        for p in self.places.iter().filter(|p| p.touch.rubbing_n > 0.0) {
            let one = self.loss(p, motion, h);
            w.push(p.touch.point, one.damping + one.friction);
            w.m += one.couple;
            e.damping_w += one.power.damping_w;
            e.friction_w += one.power.friction_w;
        }
        (w.rotated(self.x_wr.q).shifted(about_w - self.x_wr.p), e)
    }

    /// Motion of the passive side against the active one at the active ring's centre, in its axes.
    fn motion(&self, about_w: DVec3, active: Twist, passive: Twist) -> Twist {
        let back = self.x_wr.q.conjugate();
        let w = passive.w - active.w;
        let v = passive.v - active.v + w.cross(self.x_wr.p - about_w);
        Twist { v: back * v, w: back * w }
    }

    fn loss(&self, p: &Place, motion: Twist, h: f64) -> Loss {
        let t = &p.touch;
        let w_rel = motion.w;
        let v_rel = motion.v + w_rel.cross(t.point);
        let rate = -(t.dir.dot(v_rel) + t.couple.dot(w_rel));
        let damping_n = self.damping_n(t, rate);
        let size = t.dir.length();
        let n = if size > 1e-9 { t.dir / size } else { DVec3::X };
        // One bristle for sliding (tangential) and for turning about the normal (along n, at the
        // lever of the spread): a touch spread around a ring resists roll.
        let slip = v_rel - n * n.dot(v_rel) + n * (n.dot(w_rel) * t.spread_m);
        let normal_n = (t.rubbing_n + damping_n) * size;
        let own;
        let law = match p.friction {
            None => &self.law,
            Some(friction) => {
                own = self.law.of_pair(law::stiffness(&self.law.normal), friction);
                &own
            }
        };
        let (rub, mut bristle_end) = law::friction(law, normal_n, p.bristle, slip, h);
        if normal_n <= 0.0 && law::rubs(law) {
            // Its neighbour carries the load, and may pass it on.
            bristle_end = law::bristle(law.bristle_breakaway_m, p.bristle, slip, h).1;
        }
        let twist = n.dot(rub);
        Loss {
            damping: t.dir * damping_n,
            friction: rub - n * twist,
            couple: t.couple * damping_n + n * (twist * t.spread_m),
            bristle_end,
            power: ContactEnergy { damping_w: damping_n * rate, friction_w: -rub.dot(slip) },
        }
    }

    /// Dissipative part of a place's normal force, N; it never pulls more than the elastic part pushes.
    fn damping_n(&self, t: &Touch, depth_rate_m_s: f64) -> f64 {
        let normal = match self.law.normal {
            NormalLaw::KelvinVoigt { stiffness, damping_n_s_m } => {
                NormalLaw::KelvinVoigt { stiffness, damping_n_s_m: damping_n_s_m * t.share }
            }
            other @ NormalLaw::HuntCrossley { .. } => other,
        };
        let f = law::normal_force(&normal, t.rubbing_n, depth_rate_m_s);
        f.total_n - f.elastic_n
    }

    /// Lets the memory live on over `h`, with the velocities of [`Self::wrench`].
    pub fn commit(
        &self,
        state: &mut ContactState,
        about_w: DVec3,
        active: Twist,
        passive: Twist,
        h: f64,
    ) {
        let motion = self.motion(about_w, active, passive);
        state.begin(self.x_rp);
        state.keep(&self.seeds, &self.apart);
        for p in self.places.iter() {
            let one = self.loss(p, motion, h);
            state.push(Track {
                pair: p.pair,
                cell: p.touch.cell,
                bristle: one.bristle_end,
                normal: p.touch.dir.normalize_or_zero(),
                depth: p.touch.depth,
            });
        }
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
        let motion = self.motion(about_w, active, passive);
        let q = self.x_wr.q;
        let mut n = 0;
        for p in self.places.iter().filter(|p| p.touch.rubbing_n > 0.0) {
            let Some(slot) = out.get_mut(n) else { break };
            let one = self.loss(p, motion, h);
            *slot = ContactSample {
                pair: usize::from(p.pair),
                point_w_m: self.x_wr.transform_point(p.touch.point),
                normal_w_n: q * (p.touch.elastic + one.damping),
                friction_w_n: q * one.friction,
                depth_m: p.touch.depth,
            };
            n += 1;
        }
        n
    }
}
