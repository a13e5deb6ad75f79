//! The surfaces of both sides and their pairs.

use docktwin_core::{DVec3, Pose};
use docktwin_model::{ContactLaw, DockingMechanism, SideGeometry};

use super::{
    cells::{
        EIGHTHS, Elastic, Load, OnPetal, RingPair, RingTable, petal_load, petals_neighbour,
        single_load,
    },
    contacts::Contacts,
    geometry::{Circle, Sheet, off_axis},
    law,
    look::{Frame, Look, MEETING_M},
    memory::{Apart, ContactState, PairMemory},
    pair::{MAX_PETALS, PAIRS, RING_AND_PETAL_PAIRS, SurfacePair},
    search::{Lift, OnCircle, OnSheet, Start, Stiffness, deepest, follow},
    shapes::ShapePair,
};

mod gaps;

pub use gaps::PetalGaps;

/// One side: its ring, and its petals, which are alike but for their azimuths.
#[derive(Clone, Debug)]
struct Side {
    ring: Circle,
    petals: Option<Petals>,
}

#[derive(Clone, Debug)]
struct Petals {
    sheet: Sheet,
    /// Each petal's own frame in the ring frame.
    turns: Vec<Frame>,
    /// Ball that holds the sheet without its thickness, in the petal's frame.
    centre: DVec3,
    reach: f64,
}

impl Side {
    /// `offsets_m` of the petals are those of [`docktwin_model::PartOffsets`].
    fn new(g: &SideGeometry, offsets_m: &[DVec3]) -> Self {
        let ring = Circle { radius: g.ring.mean_radius_m, ball: g.ring.section_radius_m };
        let petals = g.petals.as_ref().map(|p| {
            let sheet = Sheet::new(p);
            let (centre, reach) = sheet.ball_around();
            let most = u32::try_from(MAX_PETALS).unwrap_or(u32::MAX);
            let mut turns: Vec<Frame> =
                (0..p.count.min(most)).map(|i| Frame::turned(p.azimuth_rad(i))).collect();
            // Radially outward is +Y of a petal's own frame.
            turns.iter_mut().zip(offsets_m).for_each(|(turn, d)| turn.p = turn.r * *d);
            Petals { sheet, turns, centre, reach }
        });
        Self { ring, petals }
    }

    fn turn(&self, petal: usize) -> Frame {
        self.petals.as_ref().map_or(Frame::IDENTITY, |p| p.turns[petal])
    }

    fn count(&self) -> usize {
        self.petals.as_ref().map_or(0, |p| p.turns.len())
    }

    /// Farthest point from the ring's centre, m.
    fn reach(&self) -> f64 {
        let ring = self.ring.radius + self.ring.ball;
        self.petals.as_ref().map_or(ring, |p| {
            let off = p.turns.iter().map(|turn| turn.p.length()).fold(0.0, f64::max);
            ring.max(p.centre.length() + p.reach + p.sheet.ball + off)
        })
    }
}

/// Both sides, immutable.
#[derive(Clone, Debug)]
pub struct Scene {
    active: Side,
    passive: Side,
    pairs: Vec<SurfacePair>,
    listed: Vec<ShapePair>,
    law: ContactLaw,
    table: RingTable,
    /// Farthest point of the passive side from its ring centre, m.
    reach: f64,
}

impl Scene {
    /// Builds the tables of a checked model.
    #[must_use]
    pub fn new(m: &DockingMechanism) -> Self {
        let active = Side::new(&m.active, &m.offsets.active_petals_m);
        let passive = Side::new(&m.passive, &m.offsets.passive_petals_m);
        let (a, p) = (active.count(), passive.count());
        let petals = (0..a).flat_map(|i| (0..p).map(move |j| SurfacePair::PetalPetal(i, j)));
        let (ring_a, ring_p) = (m.active.has_ring, m.passive.has_ring);
        let pairs = core::iter::once(SurfacePair::RingRing)
            .filter(|_| ring_a && ring_p)
            .chain((0..a).filter(|_| ring_p).map(SurfacePair::PetalRing))
            .chain((0..p).filter(|_| ring_a).map(SurfacePair::RingPetal))
            .chain(petals)
            .collect();
        let mut listed = ShapePair::all(m);
        // A checked model has no more.
        listed.truncate(PAIRS - RING_AND_PETAL_PAIRS);
        Self {
            reach: passive.reach(),
            listed,
            active,
            passive,
            pairs,
            law: m.contact,
            table: RingTable::new(),
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
        self.measure(&ContactState::default(), Pose::IDENTITY, x_rp).touching()
    }

    /// Measures all pairs. `x_wr` and `x_wp` are the world poses of the ring frames `r3` and `r4`.
    #[must_use]
    pub fn measure(&self, state: &ContactState, x_wr: Pose, x_wp: Pose) -> Contacts {
        let mut out = Contacts::new(&self.law, x_wr, x_wr.inverse() * x_wp);
        self.measure_into(state, &mut out);
        out
    }

    /// Measures all pairs at the poses of `out`, which is new.
    pub(crate) fn measure_into(&self, state: &ContactState, out: &mut Contacts) {
        let x_rp = out.x_rp;
        let moved = state.moved(x_rp, self.reach);
        let mut load = Load::new();
        let x = Frame::of(x_rp);
        let back = x.inverse();
        for (slot, pair) in self.pairs.iter().enumerate() {
            let number = pair.index();
            let mut memory = PairMemory {
                pair: u8::try_from(number).unwrap_or(u8::MAX),
                known: state.seeds_of(number),
                moved,
                apart: state.still_apart(slot, moved),
                learned: &mut out.seeds,
            };
            if memory.cells_apart() {
                memory.carry_all();
                let apart = memory.apart;
                out.push_apart(apart);
                continue;
            }
            let look = |first: Frame, sign: f64| Look { state, pair: number, first, sign };
            load.clear();
            match *pair {
                // Not among these.
                SurfacePair::Listed(_) => {}
                SurfacePair::RingRing => {
                    self.ring_ring(&back, &mut memory, &mut load);
                    let apart = memory.apart;
                    out.add(&load, &look(Frame::IDENTITY, 1.0), apart, eighths_neighbour);
                }
                SurfacePair::PetalRing(i) => {
                    let turn = self.active.turn(i);
                    let look = look(turn, 1.0);
                    self.petal_ring(true, &(back * turn), &look, &mut memory, &mut load);
                    let apart = memory.apart;
                    out.add(&load, &look, apart, petals_neighbour);
                }
                SurfacePair::RingPetal(j) => {
                    let first = x * self.passive.turn(j);
                    let look = look(first, -1.0);
                    self.petal_ring(false, &first, &look, &mut memory, &mut load);
                    let apart = memory.apart;
                    out.add(&load, &look, apart, petals_neighbour);
                }
                SurfacePair::PetalPetal(i, j) => {
                    let turn = self.active.turn(i);
                    let look = look(turn, 1.0);
                    let x_ab = turn.inverse() * x * self.passive.turn(j);
                    self.petal_petal(&x_ab, &look, &mut memory, &mut load);
                    let apart = memory.apart;
                    out.add(&load, &look, apart, petals_neighbour);
                }
            }
        }
        self.measure_listed(&x, state, &mut load, out);
    }

    fn measure_listed(&self, x: &Frame, state: &ContactState, load: &mut Load, out: &mut Contacts) {
        for (i, pair) in self.listed.iter().enumerate() {
            load.clear();
            pair.load(x, &self.table, load);
            let sign = if pair.turned { -1.0 } else { 1.0 };
            let number = SurfacePair::Listed(i).index();
            let look = Look { state, pair: number, first: pair.first_frame(x), sign };
            out.add_listed(load, &look, pair.friction);
        }
    }
}

fn eighths_neighbour(a: usize, b: usize) -> bool {
    let d = a.abs_diff(b);
    d.min(EIGHTHS - d) <= 1
}

impl Scene {
    fn elastic(&self) -> Elastic {
        Elastic { normal: self.law.normal }
    }

    fn stiffness(&self, a: &Sheet, b: Option<&Sheet>) -> Stiffness {
        let k = law::stiffness(&self.law.normal);
        let n = self.law.exponent();
        Stiffness {
            a: k * a.tip_compliance,
            b: b.map_or(0.0, |b| k * b.tip_compliance),
            power: 1.0 / (n + 1.0),
        }
    }

    fn ring_ring(&self, back: &Frame, memory: &mut PairMemory<'_>, out: &mut Load) {
        let apart = self.rings(back).load(&self.elastic(), out).err().unwrap_or(0.0);
        memory.apart = Apart::all(apart);
    }

    /// The rings, `back` being the active one's frame in the passive one's.
    fn rings(&self, back: &Frame) -> RingPair<'_> {
        RingPair::new(
            (self.active.ring, self.passive.ring),
            (back.r, back.p),
            &self.table,
            self.law.merge_depth_m,
        )
    }

    fn on_circle(&self, active: bool, x_cf: &Frame) -> Option<OnCircle<'_>> {
        let (own, other) =
            if active { (&self.active, &self.passive) } else { (&self.passive, &self.active) };
        let sheet = &own.petals.as_ref()?.sheet;
        Some(OnCircle {
            sheet,
            circle: other.ring,
            r: x_cf.r,
            p: x_cf.p,
            stiffness: self.stiffness(sheet, None),
            lift: 0.0,
        })
    }

    /// A petal of the active or the passive side, whose frame is `x_cf` in that of the other side's ring.
    fn petal_ring(
        &self,
        active: bool,
        x_cf: &Frame,
        look: &Look<'_>,
        memory: &mut PairMemory<'_>,
        out: &mut Load,
    ) {
        let Some(pairing) = self.on_circle(active, x_cf) else { return };
        let own = if active { &self.active } else { &self.passive };
        let Some(petals) = &own.petals else { return };
        let centre = x_cf.point(petals.centre);
        let away = centre.x.hypot(off_axis(centre) - pairing.circle.radius);
        let sum = pairing.sheet.ball + pairing.circle.ball;
        let gap = away - petals.reach - sum;
        if gap > 0.0 {
            memory.apart = Apart::all(gap);
            return;
        }
        if !self.beyond(&pairing, look, memory, out) {
            self.petal(&pairing, memory, out);
        }
    }

    fn on_sheet<'a>(&'a self, (a, b): (&'a Petals, &'a Petals), x_ab: &Frame) -> OnSheet<'a> {
        OnSheet {
            a: &a.sheet,
            b: &b.sheet,
            r: x_ab.r,
            p: x_ab.p,
            stiffness: self.stiffness(&a.sheet, Some(&b.sheet)),
            lift: 0.0,
        }
    }

    fn petal_petal(
        &self,
        x_ab: &Frame,
        look: &Look<'_>,
        memory: &mut PairMemory<'_>,
        out: &mut Load,
    ) {
        let (Some(a), Some(b)) = (&self.active.petals, &self.passive.petals) else {
            return;
        };
        let sum = a.sheet.ball + b.sheet.ball;
        let gap = (x_ab.point(b.centre) - a.centre).length() - a.reach - b.reach - sum;
        if gap > 0.0 {
            memory.apart = Apart::all(gap);
            return;
        }
        let pairing = self.on_sheet((a, b), x_ab);
        if !self.beyond(&pairing, look, memory, out) {
            self.petal(&pairing, memory, out);
        }
    }

    /// The one place followed where the cores meet or have met; false while they are still apart.
    fn beyond<P: OnPetal<N> + Lift<N>, const N: usize>(
        &self,
        pairing: &P,
        look: &Look<'_>,
        memory: &mut PairMemory<'_>,
        out: &mut Load,
    ) -> bool {
        let Some((cell, normal, depth)) = look.meeting(pairing.sum()) else { return false };
        let whole = pairing.over([-1.0, 1.0], [0.0, 1.0]);
        let Some(start) = memory.start(cell, &whole) else { return false };
        let place = follow(pairing, &whole, &start.z, (normal, depth));
        if place.depth <= pairing.sum() - MEETING_M {
            return false;
        }
        memory.apart = Apart::UNKNOWN;
        memory.learn(cell, &place.z, None);
        single_load(pairing, &self.elastic(), cell, place, out);
        true
    }

    fn petal<P: OnPetal<N>, const N: usize>(
        &self,
        pairing: &P,
        memory: &mut PairMemory<'_>,
        out: &mut Load,
    ) {
        if memory.known.is_empty() {
            // The petal as a whole, before its cells.
            let rect = pairing.over([-1.0, 1.0], [0.0, 1.0]);
            let found = deepest(pairing, &rect, 0.0, &Start::at(rect.middle()));
            if found.place.effective <= 0.0 {
                memory.apart = Apart::all(-found.at_most);
                return;
            }
            memory.apart = Apart::UNKNOWN;
        }
        petal_load(pairing, &self.elastic(), memory, out);
    }
}
