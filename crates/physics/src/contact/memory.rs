//! What contact remembers from step to step.

use arrayvec::ArrayVec;
use docktwin_core::{DVec3, Pose, StateHasher};

use super::{
    cells::{CELLS, ELEMENTS},
    pair::RING_AND_PETAL_PAIRS,
    search::{KeptProof, Rect, Start},
};

/// Pairs of surfaces of which distances are remembered: those of rings and petals, 42 bytes a pair in every copy.
/// The others are found anew each step.
pub(crate) const MOST_PAIRS: usize = RING_AND_PETAL_PAIRS;
/// Places with friction at a time. Where more touch, the last ones neither rub nor damp.
pub(crate) const MOST_PLACES: usize = 24;
/// Elements remembered for the search. What finds no room is sought anew each step.
const MOST_SEEDS: usize = 48;

/// One place that touched in the step before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Track {
    pub(crate) pair: u8,
    pub(crate) cell: u8,
    /// Bristle, relative to the break-away displacement; active ring's frame.
    pub(crate) bristle: DVec3,
    /// From the active to the passive surface, active ring's frame: tells on which side a surface is once the
    /// cores have met.
    pub(crate) normal: DVec3,
    /// Depth, m.
    pub(crate) depth: f64,
}

/// What is this far apart is forgotten, m.
const FAR_M: f64 = 5e-4;

/// Where an element of a pair was deepest: the start of the next search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Seed {
    pub(crate) pair: u8,
    pub(crate) element: u8,
    pub(crate) z: [f64; 4],
    /// What was proven of the element. Saves time, changes nothing, and is no part of the digest.
    pub(crate) proof: Option<KeptProof>,
}

pub(crate) type Seeds = ArrayVec<Seed, MOST_SEEDS>;

/// How far all elements of a pair are surely apart, in tenths of a micrometre and never longer than it is; zero:
/// not known. Whole numbers, because a step takes off all of them what has moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Apart([u16; ELEMENTS]);

impl Apart {
    const UNIT_M: f64 = 1e-7;
    pub(crate) const UNKNOWN: Self = Self([0; ELEMENTS]);

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped, floor")]
    fn units(m: f64) -> u16 {
        (m * (1.0 / Self::UNIT_M)).clamp(0.0, f64::from(u16::MAX)) as u16
    }

    /// All by the same distance, m.
    pub(crate) fn all(m: f64) -> Self {
        Self([Self::units(m); ELEMENTS])
    }

    pub(crate) fn set(&mut self, element: usize, m: f64) {
        self.0[element] = Self::units(m);
    }

    /// What is left of it once anything may have moved by `m`.
    fn after(&self, m: f64) -> Self {
        let moved = Self::units(m + Self::UNIT_M);
        Self(self.0.map(|a| a.saturating_sub(moved)))
    }

    /// Whether an element does not touch.
    pub(crate) const fn is_apart(&self, element: usize) -> bool {
        self.0[element] > 0
    }

    /// Whether it is so near that it is remembered.
    fn is_near(&self, element: usize) -> bool {
        self.0[element] < Self::units(FAR_M)
    }

    /// Whether no cell touches.
    fn cells_apart(&self) -> bool {
        self.0[..CELLS].iter().all(|a| *a > 0)
    }
}

/// What contact remembers from step to step: bristles and normals of places, where the search found them, and how
/// far apart the rest was.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactState {
    tracks: ArrayVec<Track, MOST_PLACES>,
    seeds: Seeds,
    apart: ArrayVec<Apart, MOST_PAIRS>,
    /// Pose of the passive ring in the active ring's frame of the measurement.
    measured_at: Option<Pose>,
}

impl ContactState {
    /// Forgets all places, for a new measurement at `x_rp`.
    pub(crate) fn begin(&mut self, x_rp: Pose) {
        self.tracks.clear();
        self.measured_at = Some(x_rp);
    }

    /// Keeps what a measurement found for the next search.
    pub(crate) fn keep(&mut self, seeds: &Seeds, apart: &ArrayVec<Apart, MOST_PAIRS>) {
        self.seeds.clone_from(seeds);
        self.apart.clone_from(apart);
    }

    /// Adds all bits that the next step depends on to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        for t in &self.tracks {
            h.u64(u64::from(t.pair) << 8 | u64::from(t.cell));
            h.vec3(t.bristle);
            h.vec3(t.normal);
            h.f64(t.depth);
        }
        for s in &self.seeds {
            h.u64(u64::from(s.pair) << 8 | u64::from(s.element));
            s.z.iter().for_each(|z| h.f64(*z));
        }
    }

    pub(crate) fn push(&mut self, track: Track) {
        // As many as a measurement has places.
        let _ = self.tracks.try_push(track);
    }

    pub(crate) fn of_pair(&self, pair: usize) -> impl Iterator<Item = &Track> {
        self.tracks.iter().filter(move |t| usize::from(t.pair) == pair)
    }

    /// Seeds of a pair; they lie together, by pairs in ascending order.
    pub(crate) fn seeds_of(&self, pair: usize) -> &[Seed] {
        let first = self.seeds.partition_point(|s| usize::from(s.pair) < pair);
        let end = self.seeds.partition_point(|s| usize::from(s.pair) <= pair);
        &self.seeds[first..end]
    }

    /// How far any point of the passive side may have moved against the active one since the last
    /// measurement, m, none being farther than `reach` from its ring's centre.
    pub(crate) fn moved(&self, x_rp: Pose, reach: f64) -> f64 {
        self.measured_at.map_or(f64::INFINITY, |last| {
            let turn = last.q.conjugate() * x_rp.q;
            // A chord is no longer than its arc; sin x ≥ x/1.05 up to half a radian, and beyond it
            // everything is measured anyway.
            (x_rp.p - last.p).length() + 2.1 * turn.xyz().length() * reach
        })
    }

    /// What is left of a pair's known distances after the sides have moved so far.
    pub(crate) fn still_apart(&self, pair: usize, moved: f64) -> Apart {
        self.apart.get(pair).map_or(Apart::UNKNOWN, |a| a.after(moved))
    }
}

impl Seed {
    fn new<const N: usize>(pair: u8, element: usize, z: &[f64; N]) -> Self {
        let mut out = Self {
            pair,
            element: u8::try_from(element).unwrap_or(u8::MAX),
            z: [0.0; 4],
            proof: None,
        };
        out.z[..N].copy_from_slice(z);
        out
    }
}

/// What the search of one pair knows beforehand, and learns for the next time.
pub(crate) struct PairMemory<'a> {
    pub(crate) pair: u8,
    pub(crate) known: &'a [Seed],
    /// How far anything has moved since, m.
    pub(crate) moved: f64,
    pub(crate) apart: Apart,
    pub(crate) learned: &'a mut Seeds,
}

impl PairMemory<'_> {
    /// Where to begin with an element.
    pub(crate) fn start<const N: usize>(&self, element: usize, rect: &Rect<N>) -> Option<Start<N>> {
        let seed = self.known.iter().find(|s| usize::from(s.element) == element)?;
        Some(Start {
            z: core::array::from_fn(|i| seed.z[i]),
            proof: seed.proof.map(|p| p.after(self.moved, rect)),
        })
    }

    pub(crate) fn is_known(&self, element: usize) -> bool {
        self.known.iter().any(|s| usize::from(s.element) == element)
    }

    /// Remembers where an element is deepest. Without room it will be sought anew.
    pub(crate) fn learn<const N: usize>(
        &mut self,
        element: usize,
        z: &[f64; N],
        proof: Option<KeptProof>,
    ) {
        let _ = self.learned.try_push(Seed { proof, ..Seed::new(self.pair, element, z) });
    }

    /// Whether no cell of the pair can touch.
    pub(crate) fn cells_apart(&self) -> bool {
        self.apart.cells_apart()
    }

    /// Hands on what is known of the pair where nothing needs to be looked at now.
    pub(crate) fn carry_all(&mut self) {
        for i in 0..self.known.len() {
            let element = usize::from(self.known[i].element);
            self.carry(element);
        }
    }

    /// Hands on what is known of an element that need not be looked at now, unless it is far off.
    pub(crate) fn carry(&mut self, element: usize) {
        if !self.apart.is_near(element) {
            return;
        }
        if let Some(seed) = self.known.iter().find(|s| usize::from(s.element) == element) {
            let proof = seed.proof.map(|p| p.raised(self.moved));
            let _ = self.learned.try_push(Seed { proof, ..*seed });
        }
    }
}
