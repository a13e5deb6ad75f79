//! Branch and bound: polish a place, prove that the rest is no deeper.

#![expect(clippy::needless_range_loop, reason = "vectors and matrices by their indices")]

use arrayvec::ArrayVec;

use super::{Pairing, Place, Rect, newton::minimise};

/// Two places of one part whose depths differ by less than this are as deep, m.
const EQUAL_M: f64 = 1e-9;
/// How far below the floor a part that stays apart is pinned down, of its distance from it.
const ROOM: f64 = 0.3;
/// A proof with this much to spare is good enough, m.
pub(super) const AMPLE_M: f64 = 5e-4;
/// Parts looked at before a search gives up. Reached only where the cores meet.
const MOST_PARTS: u32 = 4000;
/// Parts that wait at a time; of more the shallowest are given up, at their bounds.
const MOST_OPEN: usize = 64;
/// Every so many parts the one at hand is polished: a second place nearly as deep is then settled
/// by its own curvature.
const POLISH_EVERY: u32 = 16;
/// Rounds of a polish: of the first, whose place may be as flat as a line of contact, and of those that follow.
const MANY_ROUNDS: usize = 1000;
pub(super) const FEW_ROUNDS: usize = 60;
/// Neighbourhoods kept at a time.
const MOST_BASINS: usize = 6;

/// That a place is the deepest of a rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Proof<const N: usize> {
    /// Where the place is alone by curvature.
    pub(crate) basin: Rect<N>,
    /// Effective depth that nothing outside exceeds, m.
    pub(crate) rest: f64,
}

/// A proof of at most four parameters as it is kept: rounded so that its neighbourhood is no smaller and
/// its rest no shallower.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct KeptProof {
    lo: [f32; 4],
    hi: [f32; 4],
    rest: f64,
}

#[expect(clippy::cast_possible_truncation, reason = "rounded outwards afterwards")]
fn outwards(x: f64, up: bool) -> f32 {
    let near = x as f32;
    if up && f64::from(near) < x {
        near.next_up()
    } else if !up && f64::from(near) > x {
        near.next_down()
    } else {
        near
    }
}

impl KeptProof {
    pub(crate) fn of<const N: usize>(proof: &Proof<N>) -> Self {
        let mut out = Self { lo: [0.0; 4], hi: [0.0; 4], rest: proof.rest };
        for i in 0..N {
            out.lo[i] = outwards(proof.basin.lo[i], false);
            out.hi[i] = outwards(proof.basin.hi[i], true);
        }
        out
    }

    /// The same once the surfaces have moved by up to `moved`, m.
    pub(crate) fn raised(&self, moved: f64) -> Self {
        Self { rest: self.rest + moved, ..*self }
    }

    /// The proof once the surfaces have moved by up to `moved`, m, for a cell `rect`.
    pub(crate) fn after<const N: usize>(&self, moved: f64, rect: &Rect<N>) -> Proof<N> {
        let basin = Rect {
            lo: core::array::from_fn(|i| f64::from(self.lo[i]).max(rect.lo[i])),
            hi: core::array::from_fn(|i| f64::from(self.hi[i]).min(rect.hi[i])),
        };
        Proof { basin, rest: self.rest + moved }
    }
}

/// Where to begin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start<const N: usize> {
    pub(crate) z: [f64; N],
    /// What was proven before, with `rest` raised by how far the surfaces have moved since.
    pub(crate) proof: Option<Proof<N>>,
}

impl<const N: usize> Start<N> {
    pub(crate) const fn at(z: [f64; N]) -> Self {
        Self { z, proof: None }
    }
}

/// What a search found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found<const N: usize, A> {
    pub(crate) place: Place<N, A>,
    /// Effective depth that no point of the rectangle exceeds, m.
    pub(crate) at_most: f64,
    /// For the next search; `None` where a plane proves it at once, or the place does not touch.
    pub(crate) proof: Option<Proof<N>>,
}

/// Deepest place of `rect`. Where it stays below `floor` (m, effective) the place is not sought further,
/// only how far below the whole rectangle is.
pub(crate) fn deepest<P: Pairing<N>, const N: usize>(
    pairing: &P,
    rect: &Rect<N>,
    floor: f64,
    start: &Start<N>,
) -> Found<N, P::Aim> {
    let place = polish(pairing, rect, &start.z, MANY_ROUNDS);
    let known =
        start.proof.filter(|p| p.basin.contains(&place.z) && pairing.is_alone(&p.basin, &place));
    if let Some(proof) = known
        && proof.rest <= place.effective
    {
        return Found { place, at_most: place.effective, proof: Some(proof) };
    }
    let part = pairing.part(rect);
    let target = goal(place.effective, floor);
    let excess = pairing.excess(&part, &place.aim, &place, target);
    if excess <= 0.0 {
        return Found { place, at_most: target, proof: None };
    }
    let mut search = Search {
        pairing,
        rect: *rect,
        floor,
        best: place,
        target,
        basins: [None; MOST_BASINS],
        open: ArrayVec::new(),
        given_up: f64::NEG_INFINITY,
        parts: 0,
    };
    match known {
        Some(proof) => search.basins[0] = Some(proof.basin),
        None => search.keep_basin(&place),
    }
    let mut rest = search.run();
    // Below the floor it does not matter which.
    if rest > search.target && search.best.effective > floor {
        search.look_at_sides();
        rest = rest.max(search.best.effective);
    }
    let basin = search.basins[0].filter(|_| search.best.effective > floor);
    Found {
        place: search.best,
        at_most: search.target.max(rest),
        proof: basin.map(|basin| Proof { basin, rest }),
    }
}

fn goal(effective: f64, floor: f64) -> f64 {
    effective + if effective > floor { EQUAL_M } else { (ROOM * (floor - effective)).max(EQUAL_M) }
}

fn polish<P: Pairing<N>, const N: usize>(
    pairing: &P,
    rect: &Rect<N>,
    z: &[f64; N],
    rounds: usize,
) -> Place<N, P::Aim> {
    let (z, _) = minimise(*z, [&rect.lo, &rect.hi], rounds, |z| pairing.eval(z));
    pairing.place(z)
}

/// A part that waits.
struct Open<T, A> {
    part: T,
    /// By how much it may be deeper than the target, m, as far as known.
    excess: f64,
    /// The direction that told so.
    aim: A,
    /// Whether its own directions were tried.
    tried: bool,
}

struct Search<'a, P: Pairing<N>, const N: usize> {
    pairing: &'a P,
    rect: Rect<N>,
    floor: f64,
    best: Place<N, P::Aim>,
    /// Nothing may be deeper than this.
    target: f64,
    /// Neighbourhoods of places: that of the best, then of others.
    basins: [Option<Rect<N>>; MOST_BASINS],
    open: ArrayVec<Open<P::Part, P::Aim>, MOST_OPEN>,
    /// Largest excess of parts that found no room, and of places in other neighbourhoods, m.
    given_up: f64,
    parts: u32,
}

impl<P: Pairing<N>, const N: usize> Search<'_, P, N> {
    /// Works off the part that may be deepest until none may be deeper than the target. Returns the effective
    /// depth that nothing outside the best place's neighbourhood exceeds.
    fn run(&mut self) -> f64 {
        self.restart();
        while let Some(i) = self.worst() {
            self.parts += 1;
            if self.open[i].excess <= 0.0 || self.parts >= MOST_PARTS {
                break;
            }
            let before = self.target;
            self.work_off(i);
            if self.target > before {
                self.restart();
            }
        }
        let most = self.open.iter().map(|o| o.excess).fold(self.given_up, f64::max);
        // An excess is a depth; as an effective depth it is less by the gain, of which the least counts.
        self.target + most * if most < 0.0 { self.pairing.least_gain() } else { 1.0 }
    }

    /// Where cores touch along a line a place has others as good as it all along, to less than a bound can tell. Of those
    /// the best is at a side of the rectangle or known: which one is taken must not depend on where the search began.
    fn look_at_sides(&mut self) {
        for _ in 0..MOST_BASINS {
            let before = self.best;
            for i in 0..N {
                for side in [self.rect.lo[i], self.rect.hi[i]] {
                    let mut on_side = self.rect;
                    (on_side.lo[i], on_side.hi[i]) = (side, side);
                    let start = on_side.clamp(&before.z);
                    let there = polish(self.pairing, &on_side, &start, FEW_ROUNDS);
                    let place = polish(self.pairing, &self.rect, &there.z, FEW_ROUNDS);
                    if place.effective > self.best.effective {
                        self.best = place;
                        self.target = goal(place.effective, self.floor);
                    }
                }
            }
            if self.best.effective <= before.effective {
                break;
            }
        }
        // No neighbourhood is known to be the new place's own.
        self.basins = [None; MOST_BASINS];
    }

    /// Begins anew with the whole rectangle, for another target.
    fn restart(&mut self) {
        self.open.clear();
        self.given_up = f64::NEG_INFINITY;
        let part = self.pairing.part(&self.rect);
        let aim = self.best.aim;
        let excess = self.pairing.excess(&part, &aim, &self.best, self.target);
        self.push(Open { part, excess, aim, tried: false });
    }

    fn worst(&self) -> Option<usize> {
        let waiting = self.open.iter().enumerate();
        waiting.max_by(|a, b| a.1.excess.total_cmp(&b.1.excess)).map(|(i, _)| i)
    }

    fn push(&mut self, open: Open<P::Part, P::Aim>) {
        if let Err(full) = self.open.try_push(open) {
            self.given_up = self.given_up.max(full.element().excess);
        }
    }

    /// Tries the part's own directions, or cuts it.
    fn work_off(&mut self, i: usize) {
        let mut open = self.open.swap_remove(i);
        let rect = P::rect(&open.part);
        if self.basins.iter().flatten().any(|b| b.holds(&rect)) {
            return;
        }
        if !open.tried {
            open.tried = true;
            let before = open.excess;
            for z in [rect.clamp(&self.best.z), rect.middle()] {
                let (z, effective, aim) = self.pairing.near(&open.part, &z);
                self.consider(&z, effective);
                let excess = self.pairing.excess(&open.part, &aim, &self.best, self.target);
                if excess < open.excess {
                    (open.excess, open.aim) = (excess, aim);
                }
            }
            if open.excess < 0.5 * before || open.excess <= 0.0 {
                self.push(open);
                return;
            }
        }
        let (dim, at) = self.where_to_cut(&open.part, &rect);
        for part in self.pairing.cut(&open.part, dim, at) {
            let look = |aim: &P::Aim| self.pairing.excess(&part, aim, &self.best, self.target);
            let (own, best) = (look(&open.aim), look(&self.best.aim));
            let (excess, aim) = if own <= best { (own, open.aim) } else { (best, self.best.aim) };
            self.push(Open { part, excess: excess.min(open.excess), aim, tried: false });
        }
    }

    /// Takes a place that is deeper than the best, or gives one nearly as deep a neighbourhood.
    fn consider(&mut self, z: &[f64; N], effective: f64) {
        let deeper = effective > self.best.effective + EQUAL_M;
        if !deeper && !self.parts.is_multiple_of(POLISH_EVERY) {
            return;
        }
        let place = polish(self.pairing, &self.rect, z, FEW_ROUNDS);
        if place.effective > self.best.effective + EQUAL_M {
            self.best = place;
            self.target = goal(place.effective, self.floor);
            self.basins = [None; MOST_BASINS];
            self.keep_basin(&place);
        } else if !self.basins.iter().flatten().any(|b| b.contains(&place.z)) {
            self.given_up = self.given_up.max(place.effective - self.target);
            self.keep_basin(&place);
        }
    }

    /// The largest neighbourhood of a place in which it is alone, and a little less, so that it stays so.
    fn keep_basin(&mut self, place: &Place<N, P::Aim>) {
        let scales = self.pairing.scales();
        let around = |reach: &[f64; N]| Rect {
            lo: core::array::from_fn(|i| (place.z[i] - reach[i] / scales[i]).max(self.rect.lo[i])),
            hi: core::array::from_fn(|i| (place.z[i] + reach[i] / scales[i]).min(self.rect.hi[i])),
        };
        let mut reach = [0.3; N];
        let mut tries = 0;
        while !self.pairing.is_alone(&around(&reach), place) {
            reach = reach.map(|r| 0.5 * r);
            tries += 1;
            if tries == 8 {
                return;
            }
        }
        for i in 0..N {
            let mut longer = reach;
            for _ in 0..tries.min(3) {
                longer[i] *= 2.0;
                if !self.pairing.is_alone(&around(&longer), place) {
                    break;
                }
                reach = longer;
            }
        }
        if let Some(free) = self.basins.iter_mut().find(|b| b.is_none()) {
            *free = Some(around(&reach.map(|r| 0.8 * r)));
        }
    }

    /// Parameter and value at which to cut a part: along the side of a neighbourhood that leaves the
    /// most outside, else through the middle of its longest side.
    fn where_to_cut(&self, part: &P::Part, rect: &Rect<N>) -> (usize, f64) {
        let sizes = self.pairing.sizes(part);
        let longest = (0..N).fold(0, |b, i| if sizes[i] > sizes[b] { i } else { b });
        let mut cut = (longest, 0.5 * (rect.lo[longest] + rect.hi[longest]));
        let Some(basin) = self.basins.iter().flatten().find(|b| b.meets(rect)) else {
            return cut;
        };
        let mut most = 0.0;
        for i in 0..N {
            let whole = rect.hi[i] - rect.lo[i];
            for (outside, at) in
                [(basin.lo[i] - rect.lo[i], basin.lo[i]), (rect.hi[i] - basin.hi[i], basin.hi[i])]
            {
                if whole > 0.0 && outside * sizes[i] > most * whole {
                    most = outside * sizes[i] / whole;
                    cut = (i, at);
                }
            }
        }
        cut
    }
}
