//! What contact remembers from step to step.

use docktwin_core::{DVec3, Pose, StateHasher};

use super::{cells::CELLS, search::KeptProof};

/// Pairs of surfaces a scene may have.
pub(crate) const MOST_PAIRS: usize = 64;
/// Places with a memory at a time. Where more touch, the last ones start anew each step.
pub(crate) const MOST_TRACKS: usize = 32;

/// One place that touched in the step before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Track {
    pub(crate) pair: u8,
    pub(crate) cell: u8,
    /// Parameters of the place.
    pub(crate) z: [f64; 4],
    /// Bristle, relative to the break-away displacement; active ring's frame.
    pub(crate) bristle: DVec3,
    /// From the active to the passive surface, active ring's frame: tells on which side a surface is once the
    /// cores have met.
    pub(crate) normal: DVec3,
    /// Depth, m.
    pub(crate) depth: f64,
    /// What was proven of the cell. Saves time, changes nothing, and is no part of the digest.
    pub(crate) proof: Option<KeptProof>,
}

impl Track {
    const NONE: Self = Self {
        pair: 0,
        cell: 0,
        z: [0.0; 4],
        bristle: DVec3::ZERO,
        normal: DVec3::ZERO,
        depth: 0.0,
        proof: None,
    };
}

/// What contact remembers from step to step: where pairs touch with their bristles, and how far the others
/// are apart.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactState {
    tracks: [Track; MOST_TRACKS],
    len: usize,
    /// Distance by which each cell of each pair is known to be apart, m: it need not be measured before
    /// the sides have moved that far. Saves time, changes nothing, and is no part of the digest.
    apart_m: [[f32; CELLS]; MOST_PAIRS],
    /// `X_r3r4` for which those distances hold.
    measured_at: Option<Pose>,
}

impl Default for ContactState {
    fn default() -> Self {
        Self {
            tracks: [Track::NONE; MOST_TRACKS],
            len: 0,
            apart_m: [[0.0; CELLS]; MOST_PAIRS],
            measured_at: None,
        }
    }
}

impl ContactState {
    /// Forgets all places, for a new measurement at `x_rp`.
    pub(crate) fn begin(&mut self, x_rp: Pose) {
        self.len = 0;
        self.measured_at = Some(x_rp);
    }

    /// Keeps how far the cells of a pair are apart, m.
    pub(crate) fn set_apart(&mut self, pair: usize, apart_m: &[f32; CELLS]) {
        self.apart_m[pair] = *apart_m;
    }

    /// Adds all bits that the next step depends on to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        for t in self.tracks() {
            h.u64(u64::from(t.pair) << 8 | u64::from(t.cell));
            t.z.iter().for_each(|z| h.f64(*z));
            h.vec3(t.bristle);
            h.vec3(t.normal);
            h.f64(t.depth);
        }
    }

    pub(crate) fn tracks(&self) -> &[Track] {
        &self.tracks[..self.len]
    }

    pub(crate) fn push(&mut self, track: Track) {
        if let Some(free) = self.tracks.get_mut(self.len) {
            *free = track;
            self.len += 1;
        }
    }

    pub(crate) fn of_pair(&self, pair: usize) -> impl Iterator<Item = &Track> {
        self.tracks().iter().filter(move |t| usize::from(t.pair) == pair)
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
    pub(crate) fn still_apart(&self, pair: usize, moved: f64) -> [f64; CELLS] {
        self.apart_m[pair].map(|a| f64::from(a) - moved)
    }
}

/// A distance as it is remembered: never longer than it is.
pub(crate) fn shortened(m: f64) -> f32 {
    #[expect(clippy::cast_possible_truncation, reason = "shortened by more than the rounding")]
    let short = (m * (1.0 - 1e-6)) as f32;
    short.max(0.0)
}
