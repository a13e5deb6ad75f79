//! Numbers and names of the pairs of surfaces.

/// Most petals a side may have.
pub(crate) const MAX_PETALS: usize = 3;
/// Numbers of pairs of rings and petals: ring–ring, 3 active petals on the passive ring, 3 passive petals on the
/// active ring, 9 pairs of petals.
pub const RING_AND_PETAL_PAIRS: usize = 1 + 2 * MAX_PETALS + MAX_PETALS * MAX_PETALS;
/// Most pairs of surfaces: after those of rings and petals the pairs of surfaces that the files list.
pub const PAIRS: usize = docktwin_model::MOST_PAIRS;
const _: () = assert!(RING_AND_PETAL_PAIRS == docktwin_model::RING_AND_PETAL_PAIRS);

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
    /// Listed surfaces, by the place in [`docktwin_model::DockingMechanism::surface_pairs`].
    Listed(usize),
}

impl SurfacePair {
    /// From its number below [`PAIRS`].
    #[must_use]
    pub fn from_index(i: usize) -> Self {
        match i {
            0 => Self::RingRing,
            1..=3 => Self::PetalRing(i - 1),
            4..=6 => Self::RingPetal(i - 4),
            RING_AND_PETAL_PAIRS.. => Self::Listed(i - RING_AND_PETAL_PAIRS),
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
            Self::Listed(i) => RING_AND_PETAL_PAIRS + i,
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
            // Their names stand in the files.
            Self::Listed(i) => write!(f, "listed surfaces, pair {}", i + 1),
        }
    }
}
