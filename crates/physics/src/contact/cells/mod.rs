//! From depths to one energy, and from the energy to forces.
//!
//! One surface of a pair is divided into cells once and for all: a petal into 4 × 2 rectangles of its
//! parameters, a ring into 32 arcs. Every cell, every border between two cells and every corner
//! where cells meet has an effective depth of its own, the deepest of its points against the *whole*
//! other surface. The pair stores
//!
//! `U = Σ Φ(cells) − Σ Φ(borders) + Σ Φ(corners)`,
//!
//! Φ the energy of the law. By inclusion and exclusion that counts what is deeper than t once for every
//! connected piece of it (Euler's characteristic), summed over all t: one place has energy Φ and
//! stiffness k wherever the cells lie; n places that are apart have Σ Φ; two places with a saddle
//! between them Φ + Φ − Φ(saddle). No place is chosen among others, so nothing flips.
//!
//! Every depth changes by no more than the surfaces move, so the energy is continuous in the pose
//! whatever it does, and forces are its gradient: `Φ' ` along the normal of each element's point. A place
//! that wanders over a border does so through a point that both cells share.

mod petal;
mod ring;

pub(crate) use petal::{
    CELLS, ELEMENTS, OnPetal, are_neighbours as petals_neighbour, load as petal_load, single_load,
};
pub(crate) use ring::{EIGHTHS, RingPair, RingTable};

use arrayvec::ArrayVec;
use docktwin_core::DVec3;
use docktwin_model::NormalLaw;

use super::law;

/// Most cells of a pair that carry friction: those of a petal, or eighths of a ring.
pub(crate) const MOST_TOUCHES: usize = 8;

/// The law as far as it depends on depths only.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Elastic {
    pub(crate) normal: NormalLaw,
}

impl Elastic {
    pub(crate) fn energy(&self, effective: f64) -> f64 {
        law::stored_energy(&self.normal, law::stiffness(&self.normal), effective)
    }

    /// dΦ/dη, N.
    pub(crate) fn force(&self, effective: f64) -> f64 {
        law::elastic_force(&self.normal, law::stiffness(&self.normal), effective)
    }
}

/// One cell, or an eighth of a ring, that touches: what damping, friction and the record need.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch {
    pub(crate) cell: u8,
    /// Depth, m.
    pub(crate) depth: f64,
    /// Elastic force on the second surface, its share of borders and corners included, N.
    pub(crate) elastic: DVec3,
    /// Elastic normal force that damps and rubs, N.
    pub(crate) rubbing_n: f64,
    /// Part of the law's damper that acts, 0 … 1.
    pub(crate) share: f64,
    /// Where it acts.
    pub(crate) point: DVec3,
    /// Mean of the normals from the first to the second surface.
    pub(crate) dir: DVec3,
    /// Mean of (x − point) × n.
    pub(crate) couple: DVec3,
    /// Root-mean-square distance of the points from `point`, m.
    pub(crate) spread_m: f64,
}

impl Touch {
    pub(crate) const NONE: Self = Self {
        cell: 0,
        depth: 0.0,
        elastic: DVec3::ZERO,
        rubbing_n: 0.0,
        share: 0.0,
        point: DVec3::ZERO,
        dir: DVec3::ZERO,
        couple: DVec3::ZERO,
        spread_m: 0.0,
    };
}

/// What a pair stores and how it pushes, in the frame of its first surface.
#[derive(Debug)]
pub(crate) struct Load {
    pub(crate) energy_j: f64,
    /// Elastic force on the second surface, N, and moment about the frame's origin, N·m.
    pub(crate) force: DVec3,
    pub(crate) moment: DVec3,
    pub(crate) touches: ArrayVec<Touch, MOST_TOUCHES>,
}

impl Load {
    pub(crate) fn new() -> Self {
        Self { energy_j: 0.0, force: DVec3::ZERO, moment: DVec3::ZERO, touches: ArrayVec::new() }
    }

    /// Empties it. It is used over and over: copies of it cost more than what it holds.
    pub(crate) fn clear(&mut self) {
        (self.energy_j, self.force, self.moment) = (0.0, DVec3::ZERO, DVec3::ZERO);
        self.touches.clear();
    }

    pub(crate) fn push(&mut self, point: DVec3, force: DVec3) {
        self.force += force;
        self.moment += point.cross(force);
    }

    /// Deepest place, m.
    pub(crate) fn depth(&self) -> f64 {
        self.touches.iter().map(|t| t.depth).fold(0.0, f64::max)
    }

    /// Scales what rubs so that together it is the net normal force: saddles do not rub, and what they
    /// take back does not either.
    pub(crate) fn level_rubbing(&mut self, net_n: f64) {
        let all: f64 = self.touches.iter().map(|t| t.rubbing_n).sum();
        let scale = if all > 0.0 { (net_n / all).clamp(0.0, 1.0) } else { 0.0 };
        for t in &mut self.touches {
            t.rubbing_n *= scale;
            t.share *= scale;
        }
    }
}

/// Of the force of a border between two cells, the part that is the first one's: the one that stands
/// less above the border loses more of its friction, so that none jumps as two places become one.
pub(crate) fn first_share(first: f64, second: f64, border: f64) -> f64 {
    const EVEN_M: f64 = 1e-6;
    let (x, y) = ((first - border).max(0.0) + EVEN_M, (second - border).max(0.0) + EVEN_M);
    y / (x + y)
}

/// Half of |x| where |x| is above `width`, smooth below: `x²/w − |x|³/(2w²)`; and its derivative.
///
/// Zero at zero: two equal depths have themselves as their smooth maximum, so a touch spread over many
/// cells is not deeper than it is.
fn half_size(x: f64, width: f64) -> (f64, f64) {
    let y = x.abs() / width;
    if y >= 1.0 {
        (0.5 * x.abs(), 0.5 * x.signum())
    } else {
        (width * y * y * (1.0 - 0.5 * y), x.signum() * y * (2.0 - 1.5 * y))
    }
}

/// Smooth maximum of two depths and its derivative by the first; exact where they differ by more than
/// `width`.
fn smooth_max(a: f64, b: f64, width: f64) -> (f64, f64) {
    let (g, slope) = half_size(a - b, width);
    (0.5 * (a + b) + g, 0.5 + slope)
}

/// `x` above `width`, flat at zero: `2x²/w − x³/w²`; and its derivative.
fn rise(x: f64, width: f64) -> (f64, f64) {
    let y = (x / width).max(0.0);
    if y >= 1.0 { (x, 1.0) } else { (width * y * y * (2.0 - y), y * (4.0 - 3.0 * y)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_smooth_extremes_are_exact_apart_and_at_a_tie() {
        let w = 2e-5;
        for (a, b) in [(3e-4, 1e-4), (-1e-4, 2e-4), (5e-5, 5e-5)] {
            assert!((smooth_max(a, b, w).0 - f64::max(a, b)).abs() < 1e-18);
        }
        let mut lowest = 0.0f64;
        for i in 0..=100 {
            let (a, b) = (1e-4, 1e-4 - w * f64::from(i) / 50.0);
            let (value, by_a) = smooth_max(a, b, w);
            let h = 1e-10;
            let slope = (smooth_max(a + h, b, w).0 - smooth_max(a - h, b, w).0) / (2.0 * h);
            assert!((slope - by_a).abs() < 1e-5);
            let x = w * f64::from(i) / 50.0;
            let slope = (rise(x + h, w).0 - rise(x - h, w).0) / (2.0 * h);
            assert!((slope - rise(x, w).1).abs() < 1e-5 || i == 0);
            lowest = lowest.max(a - value);
        }
        // Between tie and apart it lies below by no more than 2/27 of the width.
        assert!((lowest / w - 2.0 / 27.0).abs() < 1e-3, "{}", lowest / w);
    }
}
