//! Depths as such: of every petal to what is nearest, for eyes, and of every pair, for tests.

use docktwin_core::{DQuat, DVec3, Pose};

use super::{Frame, MAX_PETALS, OnPetal, PAIRS, Scene, Start, Stiffness, SurfacePair, deepest};

/// Gap of each petal, m: its distance to the ring or petal of the other side that is nearest, positive
/// apart, negative in contact (right while the cores of the surfaces have not met). NaN where the
/// side has no such petal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PetalGaps {
    /// Petals of the active side.
    pub active_m: [f64; MAX_PETALS],
    /// Petals of the passive side.
    pub passive_m: [f64; MAX_PETALS],
}

/// Depth of a whole petal; below `floor` a bound from above.
fn depth<P: OnPetal<N>, const N: usize>(pairing: &P, floor: f64) -> f64 {
    let rect = pairing.over([-1.0, 1.0], [0.0, 1.0]);
    let found = deepest(pairing, &rect, floor, &Start::at(rect.middle()));
    if found.place.depth > floor { found.place.depth } else { found.at_most }
}

const RIGID: Stiffness = Stiffness { a: 0.0, b: 0.0, power: 0.5 };

impl Scene {
    /// Roll either way, rad, from the docked position (rings face to face and touching, `R_34 = I`) until a
    /// petal touches: of the passive ring in the active ring frame, negative and positive. `None` where no
    /// petal does within 60°, zero where one touches when docked. For reports: takes milliseconds.
    #[must_use]
    pub fn roll_play(&self) -> [Option<f64>; 2] {
        const STEP: f64 = 2e-3;
        const MOST: u32 = 524;
        let planes = self.active.ring.ball + self.passive.ring.ball;
        let half_turn = DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0);
        let touches = |roll: f64| {
            let x = Pose::new(DVec3::X * planes, DQuat::from_rotation_x(roll) * half_turn);
            // The rings touch at any roll.
            let petals = self.pairs.iter().filter(|p| **p != SurfacePair::RingRing);
            petals.map(|p| self.depth_of(*p, x, -0.05)).any(|depth| depth >= 0.0)
        };
        [-1.0, 1.0].map(|sign| {
            let first =
                (0..=MOST).map(|i| f64::from(i) * STEP).find(|roll| touches(sign * roll))?;
            let (mut free, mut touching) = ((first - STEP).max(0.0), first);
            while touching - free > 1e-7 {
                let middle = 0.5 * (free + touching);
                if touches(sign * middle) { touching = middle } else { free = middle }
            }
            Some(touching)
        })
    }

    /// Gap of every petal, with `x_rp` the pose of the passive ring frame `r4` in the active ring
    /// frame `r3`. Tens of microseconds: for every frame of a picture, not for every step.
    #[must_use]
    pub fn petal_gaps(&self, x_rp: Pose) -> PetalGaps {
        let mut out =
            PetalGaps { active_m: [f64::NAN; MAX_PETALS], passive_m: [f64::NAN; MAX_PETALS] };
        let (active, passive) = (self.active.count(), self.passive.count());
        for i in 0..active {
            out.active_m[i] = -self.depth_of(SurfacePair::PetalRing(i), x_rp, f64::NEG_INFINITY);
        }
        for j in 0..passive {
            out.passive_m[j] = -self.depth_of(SurfacePair::RingPetal(j), x_rp, f64::NEG_INFINITY);
        }
        for i in 0..active {
            for j in 0..passive {
                let known = out.active_m[i].max(out.passive_m[j]);
                let pair = SurfacePair::PetalPetal(i, j);
                if self.least_gap(pair, x_rp) > known {
                    continue;
                }
                let gap = -self.depth_of(pair, x_rp, -known);
                out.active_m[i] = out.active_m[i].min(gap);
                out.passive_m[j] = out.passive_m[j].min(gap);
            }
        }
        out
    }

    /// Depth of every pair of surfaces as such, m: positive in contact, negative apart; NaN where
    /// there is no such pair. Of a pair less deep than `floor_m` only a bound from above, below the floor.
    /// Nothing is remembered, merged or weighed: for tests and reports.
    #[must_use]
    pub fn depths(&self, x_rp: Pose, floor_m: f64) -> [f64; PAIRS] {
        let mut out = [f64::NAN; PAIRS];
        for pair in &self.pairs {
            out[pair.index()] = self.depth_of(*pair, x_rp, floor_m);
        }
        for i in 0..self.listed.len() {
            let pair = SurfacePair::Listed(i);
            out[pair.index()] = self.depth_of(pair, x_rp, floor_m);
        }
        out
    }

    fn depth_of(&self, pair: SurfacePair, x_rp: Pose, floor: f64) -> f64 {
        match pair {
            SurfacePair::Listed(i) => {
                let x = Frame::of(x_rp);
                self.listed.get(i).map_or(f64::NAN, |pair| pair.depth(&x, &self.table))
            }
            SurfacePair::RingRing => self.rings(&Frame::of(x_rp).inverse()).depth_m(),
            SurfacePair::PetalRing(i) | SurfacePair::RingPetal(i) => {
                let active = matches!(pair, SurfacePair::PetalRing(_));
                let x = Frame::of(x_rp);
                let x_cf = if active {
                    x.inverse() * self.active.turn(i)
                } else {
                    x * self.passive.turn(i)
                };
                self.on_circle(active, &x_cf).map_or(f64::NAN, |mut pairing| {
                    pairing.stiffness = RIGID;
                    depth(&pairing, floor)
                })
            }
            SurfacePair::PetalPetal(i, j) => {
                let (Some(a), Some(b)) = (&self.active.petals, &self.passive.petals) else {
                    return f64::NAN;
                };
                let x = self.between(i, j, x_rp);
                let mut pairing = self.on_sheet((a, b), &x);
                pairing.stiffness = RIGID;
                depth(&pairing, floor)
            }
        }
    }

    /// Distance of the balls around two petals, m.
    fn least_gap(&self, pair: SurfacePair, x_rp: Pose) -> f64 {
        let (SurfacePair::PetalPetal(i, j), Some(a), Some(b)) =
            (pair, &self.active.petals, &self.passive.petals)
        else {
            return 0.0;
        };
        let apart = self.between(i, j, x_rp).point(b.centre) - a.centre;
        apart.length() - a.reach - b.reach - a.sheet.ball - b.sheet.ball
    }

    /// Frame of passive petal `j` in that of active petal `i`.
    fn between(&self, i: usize, j: usize, x_rp: Pose) -> Frame {
        self.active.turn(i).inverse() * Frame::of(x_rp) * self.passive.turn(j)
    }
}
