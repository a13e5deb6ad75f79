//! Colours, classes of contact and how forces are drawn.

use docktwin_model::RING_AND_PETAL_PAIRS;

/// Arrows: metres per newton, so that 1 kN is 0.5 m.
pub(crate) const METRES_PER_NEWTON: f64 = 0.5 / 1000.0;

pub(crate) const ACTIVE: u32 = 0xF0_74_38_FF;
pub(crate) const PASSIVE: u32 = 0x4C_90_F0_FF;
/// Opacity of rings and petals: what happens between them must show, so their edges are drawn and
/// their faces are like glass.
pub(crate) const GLASS: u8 = 0x24;
/// Opacity of hulls: the mechanism must be visible through them.
pub(crate) const ACTIVE_HULL: u32 = 0x9A_84_6C_10;
pub(crate) const PASSIVE_HULL: u32 = 0x6C_80_9C_10;
/// The other run of a comparison: faces and edges.
pub(crate) const GHOST: u32 = 0xB4_B8_C0_FF;
pub(crate) const GHOST_GLASS: u8 = 0x14;
pub(crate) const GHOST_EDGES: u32 = 0xB4_B8_C0_90;
pub(crate) const LATCH_RADIUS_M: f32 = 0.026;
pub(crate) const STRIKER: u32 = 0xC9_D6_E8_FF;
pub(crate) const LEG: u32 = 0x8A_8F_98_70;
pub(crate) const LEG_RADIUS_M: f32 = 0.006;
pub(crate) const TEXT: u32 = 0xE6_E9_EE_FF;

/// Red, green, blue of the axes X, Y, Z; roll, pitch, yaw.
pub(crate) const AXES: [u32; 3] = [0xF0_5A_5A_FF, 0x5A_D0_6A_FF, 0x6A_9C_FF_FF];

/// Petals 1, 2, 3 of the active side in plots, shades of its colour.
pub(crate) const ACTIVE_PETALS: [u32; 3] = [0xFF_B0_40_FF, 0xF0_74_38_FF, 0xD0_40_60_FF];
/// Petals 1', 2', 3' of the passive side in plots.
pub(crate) const PASSIVE_PETALS: [u32; 3] = [0x50_E0_FF_FF, 0x4C_90_F0_FF, 0xA0_78_FF_FF];

/// Latch: free, approach, struck, latched.
pub(crate) const LATCH_COLOURS: [u32; 4] =
    [0x7C_84_90_FF, 0xF2_D0_3A_FF, 0xFF_7A_2E_FF, 0x3A_E0_6E_FF];
pub(crate) const LATCH_NAMES: [&str; 4] = ["free", "approach", "struck", "latched"];

/// What kinds of surfaces touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PairClass {
    RingRing,
    PetalRing,
    PetalPetal,
    Listed,
    Latch,
}

impl PairClass {
    pub(crate) const ALL: [Self; 5] =
        [Self::RingRing, Self::PetalRing, Self::PetalPetal, Self::Listed, Self::Latch];

    /// Of pair `i` of `names`: behind those of rings and petals stand those of listed surfaces, whose names users
    /// choose, and the first three latches last.
    pub(crate) fn of(names: &[String], i: usize) -> Self {
        let listed = RING_AND_PETAL_PAIRS..names.len().saturating_sub(3);
        if listed.contains(&i) { Self::Listed } else { Self::of_name(&names[i]) }
    }

    /// From the name of a pair of rings and petals, or of a latch: how often it says "petal", whether it names a latch.
    pub(crate) fn of_name(name: &str) -> Self {
        let name = name.to_lowercase();
        if ["latch", "striker", "joint"].iter().any(|w| name.contains(w)) {
            return Self::Latch;
        }
        match name.matches("petal").count() {
            0 => Self::RingRing,
            1 => Self::PetalRing,
            _ => Self::PetalPetal,
        }
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::RingRing => "ring on ring",
            Self::PetalRing => "petal on ring",
            Self::PetalPetal => "petal on petal",
            Self::Listed => "listed surfaces",
            Self::Latch => "latch",
        }
    }

    /// Part of the entity path.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::RingRing => "ring_ring",
            Self::PetalRing => "petal_ring",
            Self::PetalPetal => "petal_petal",
            Self::Listed => "listed",
            Self::Latch => "latch",
        }
    }

    pub(crate) fn colour(self) -> u32 {
        match self {
            Self::RingRing => 0xFF_F2_4A_FF,
            Self::PetalRing => 0xFF_4F_C8_FF,
            Self::PetalPetal => 0x62_F0_8C_FF,
            Self::Listed => 0xB0_8C_FF_FF,
            Self::Latch => 0x4F_E8_F0_FF,
        }
    }
}

/// The colour with another opacity.
pub(crate) fn faded(rgba: u32, alpha: u8) -> u32 {
    (rgba & 0xFF_FF_FF_00) | u32::from(alpha)
}

/// Halfway to white: friction beside the normal force of the same class.
pub(crate) fn paled(rgba: u32) -> u32 {
    let [r, g, b, a] = rgba.to_be_bytes();
    let pale = |c: u8| c / 2 + 127;
    u32::from_be_bytes([pale(r), pale(g), pale(b), a])
}

/// What the ghost of a comparison is drawn in: half grey, half the colour.
pub(crate) fn ghostly(rgba: u32) -> u32 {
    let mix = |c: u8, g: u8| c / 2 + g / 2;
    let (c, g) = (rgba.to_be_bytes(), GHOST.to_be_bytes());
    u32::from_be_bytes([mix(c[0], g[0]), mix(c[1], g[1]), mix(c[2], g[2]), c[3] / 4 * 3])
}

/// `640 N`, `1.91 kN`, `24.2 kN`.
pub(crate) fn newtons(f: f64) -> String {
    if f < 999.5 {
        format!("{f:.0} N")
    } else if f < 9995.0 {
        format!("{:.2} kN", f / 1000.0)
    } else {
        format!("{:.1} kN", f / 1000.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_class_of_a_pair_is_read_from_its_name() {
        for (name, class) in [
            ("active ring · passive ring", PairClass::RingRing),
            ("active ring · passive petal 2", PairClass::PetalRing),
            ("active petal 0 · passive ring", PairClass::PetalRing),
            ("Active Petal 0 · passive petal 2", PairClass::PetalPetal),
            ("latch 1 · striker 1", PairClass::Latch),
        ] {
            assert_eq!(PairClass::of_name(name), class, "{name}");
        }
    }

    #[test]
    fn oracle_forces_are_written_with_three_digits() {
        assert_eq!(newtons(0.4), "0 N");
        assert_eq!(newtons(640.2), "640 N");
        assert_eq!(newtons(999.6), "1.00 kN");
        assert_eq!(newtons(1912.0), "1.91 kN");
        assert_eq!(newtons(24249.0), "24.2 kN");
    }
}
