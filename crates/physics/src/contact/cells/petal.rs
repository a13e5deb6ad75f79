//! Cells of a petal, against a ring or another petal.

use docktwin_core::DVec3;

use super::{Elastic, Load, Touch, first_share};
use crate::contact::{
    memory::PairMemory,
    search::{KeptProof, Pairing, Place, Rect, Start, deepest},
};

/// Cells across the rulings, and along them.
pub(crate) const ACROSS: usize = 4;
pub(crate) const ALONG: usize = 2;
pub(crate) const CELLS: usize = ACROSS * ALONG;
/// Borders along rulings, and those across.
const UPRIGHT: usize = (ACROSS - 1) * ALONG;
const BORDERS: usize = UPRIGHT + ACROSS * (ALONG - 1);
const CORNERS: usize = (ACROSS - 1) * (ALONG - 1);
/// Cells, then borders, then corners.
pub(crate) const ELEMENTS: usize = CELLS + BORDERS + CORNERS;

/// What is less than this apart is remembered as if it touched, m: it may touch in the next step.
const NEAR_M: f64 = 1e-4;

/// A pairing whose first core is a petal's sheet.
pub(crate) trait OnPetal<const N: usize>: Pairing<N> {
    /// The rectangle over part of the sheet, with all of the second core.
    fn over(&self, u: [f64; 2], s: [f64; 2]) -> Rect<N>;
    /// Point on the sheet and unit vector from it to the second core, in the sheet's frame.
    fn contact(&self, place: &Place<N, Self::Aim>) -> (DVec3, DVec3);
    /// Radius of the ball that sweeps the sheet, m.
    fn ball(&self) -> f64;
}

#[expect(clippy::cast_precision_loss, reason = "small numbers")]
fn u_at(column: usize) -> f64 {
    -1.0 + 2.0 * column as f64 / ACROSS as f64
}

#[expect(clippy::cast_precision_loss, reason = "small numbers")]
fn s_at(row: usize) -> f64 {
    row as f64 / ALONG as f64
}

fn cell(column: usize, row: usize) -> usize {
    row * ACROSS + column
}

/// The part of the sheet that an element is.
fn span(element: usize) -> ([f64; 2], [f64; 2]) {
    if element < CELLS {
        let (column, row) = (element % ACROSS, element / ACROSS);
        ([u_at(column), u_at(column + 1)], [s_at(row), s_at(row + 1)])
    } else if element < CELLS + BORDERS {
        border(element - CELLS).1
    } else {
        let (column, row) = corner(element - CELLS - BORDERS);
        ([u_at(column); 2], [s_at(row); 2])
    }
}

/// Column and row of the cell that begins at a corner.
fn corner(i: usize) -> (usize, usize) {
    (i % (ACROSS - 1) + 1, i / (ACROSS - 1) + 1)
}

/// Cells that share a border or a corner with one.
pub(crate) fn are_neighbours(a: usize, b: usize) -> bool {
    let (ca, ra, cb, rb) = (a % ACROSS, a / ACROSS, b % ACROSS, b / ACROSS);
    ca.abs_diff(cb) <= 1 && ra.abs_diff(rb) <= 1
}

struct Element<const N: usize, A> {
    place: Place<N, A>,
    point: DVec3,
    normal: DVec3,
    /// Φ' along the normal, N.
    force_n: f64,
}

/// A border of two cells, or none where they do not share what is deeper than zero.
struct Border<const N: usize, A> {
    cells: [usize; 2],
    element: Element<N, A>,
}

/// Energy and forces of a pair.
pub(crate) fn load<P: OnPetal<N>, const N: usize>(
    pairing: &P,
    elastic: &Elastic,
    memory: &mut PairMemory<'_>,
    out: &mut Load,
) {
    let cells = touching_cells(pairing, elastic, memory);
    let mut net = 0.0;
    for (i, e) in cells.iter().enumerate() {
        if let Some(e) = e {
            net += e.force_n;
            add_cell(elastic, i, e, out);
        }
    }
    if out.touches.len() > 1 {
        let borders = shared_borders(pairing, elastic, &cells, memory);
        net += subtract_borders(elastic, &cells, &borders, out);
        net += add_corners((pairing, elastic), &borders, memory, out);
        for t in &mut out.touches {
            let own = cells[usize::from(t.cell)].as_ref().map_or(1.0, |e| e.force_n);
            t.rubbing_n = t.rubbing_n.max(0.0);
            t.share = if own > 0.0 { (t.rubbing_n / own).min(1.0) } else { 0.0 };
        }
    }
    out.level_rubbing(net);
}

/// One place alone.
pub(crate) fn single_load<P: OnPetal<N>, const N: usize>(
    pairing: &P,
    elastic: &Elastic,
    cell: usize,
    place: Place<N, P::Aim>,
    out: &mut Load,
) {
    add_cell(elastic, cell, &element(pairing, elastic, place), out);
}

fn add_cell<const N: usize, A>(elastic: &Elastic, cell: usize, e: &Element<N, A>, out: &mut Load) {
    out.energy_j += elastic.energy(e.place.effective);
    out.push(e.point, e.normal * e.force_n);
    out.touches.push(Touch {
        cell: u8::try_from(cell).unwrap_or(u8::MAX),
        depth: e.place.depth,
        elastic: e.normal * e.force_n,
        rubbing_n: e.force_n,
        share: 1.0,
        point: e.point,
        dir: e.normal,
        ..Touch::NONE
    });
}

fn element<P: OnPetal<N>, const N: usize>(
    pairing: &P,
    elastic: &Elastic,
    place: Place<N, P::Aim>,
) -> Element<N, P::Aim> {
    let (core, normal) = pairing.contact(&place);
    Element {
        point: core + normal * (pairing.ball() - 0.5 * place.depth),
        normal,
        force_n: elastic.force(place.effective) / place.softening.inverse,
        place,
    }
}

type Elements<P, const N: usize> = [Option<Element<N, <P as Pairing<N>>::Aim>>; CELLS];

/// Deepest place of an element, if it touches; `near` tells where to look for one not yet known.
fn place_of<P: OnPetal<N>, const N: usize>(
    pairing: &P,
    number: usize,
    memory: &mut PairMemory<'_>,
    near: impl FnOnce(&Rect<N>) -> [f64; N],
) -> Option<Place<N, P::Aim>> {
    if memory.apart.is_apart(number) {
        memory.carry(number);
        return None;
    }
    let (u, s) = span(number);
    let rect = pairing.over(u, s);
    let start = memory.start(number, &rect).unwrap_or_else(|| Start::at(near(&rect)));
    let best = deepest(pairing, &rect, -NEAR_M, &start);
    if best.place.effective > -NEAR_M {
        memory.learn(number, &best.place.z, best.proof.as_ref().map(KeptProof::of));
    }
    memory.apart.set(number, -best.at_most);
    (best.place.effective > 0.0).then_some(best.place)
}

fn touching_cells<P: OnPetal<N>, const N: usize>(
    pairing: &P,
    elastic: &Elastic,
    memory: &mut PairMemory<'_>,
) -> Elements<P, N> {
    let mut found: Elements<P, N> = [const { None }; CELLS];
    // Those that touched before come first: their places are good starts for their neighbours.
    for known in [true, false] {
        for i in 0..CELLS {
            if memory.is_known(i) != known {
                continue;
            }
            let near = |rect: &Rect<N>| {
                let touching = (0..CELLS).filter(|k| are_neighbours(i, *k));
                let mut places = touching.filter_map(|k| found[k].as_ref()).map(|e| e.place.z);
                places.next().unwrap_or_else(|| rect.middle())
            };
            found[i] = place_of(pairing, i, memory, near).map(|p| element(pairing, elastic, p));
        }
    }
    found
}

/// The deepest place of a border or corner, if it touches: that of a cell or border beside it which is
/// deepest just there, if there is one.
fn between<P: OnPetal<N>, const N: usize>(
    pairing: &P,
    number: usize,
    memory: &mut PairMemory<'_>,
    beside: &[&Place<N, P::Aim>],
) -> Option<Place<N, P::Aim>> {
    let (u, s) = span(number);
    let within = |z: &[f64; N]| u[0] <= z[0] && z[0] <= u[1] && s[0] <= z[1] && z[1] <= s[1];
    let lowest = beside.iter().min_by(|a, b| a.effective.total_cmp(&b.effective))?;
    match beside.iter().find(|p| within(&p.z)) {
        Some(place) => Some(**place),
        None => place_of(pairing, number, memory, |_| lowest.z),
    }
}

type Borders<P, const N: usize> = [Option<Border<N, <P as Pairing<N>>::Aim>>; BORDERS];

fn shared_borders<P: OnPetal<N>, const N: usize>(
    pairing: &P,
    elastic: &Elastic,
    cells: &Elements<P, N>,
    memory: &mut PairMemory<'_>,
) -> Borders<P, N> {
    let mut out: Borders<P, N> = [const { None }; BORDERS];
    for (i, slot) in out.iter_mut().enumerate() {
        let (pair, _) = border(i);
        let [Some(a), Some(b)] = pair.map(|c| cells[c].as_ref()) else { continue };
        *slot = between(pairing, CELLS + i, memory, &[&a.place, &b.place])
            .map(|place| Border { cells: pair, element: element(pairing, elastic, place) });
    }
    out
}

/// Cells on both sides of a border, and its place: first those along rulings, then those across.
fn border(i: usize) -> ([usize; 2], ([f64; 2], [f64; 2])) {
    if i < UPRIGHT {
        let (column, row) = (i % (ACROSS - 1), i / (ACROSS - 1));
        let u = u_at(column + 1);
        ([cell(column, row), cell(column + 1, row)], ([u, u], [s_at(row), s_at(row + 1)]))
    } else {
        let (column, row) = ((i - UPRIGHT) % ACROSS, (i - UPRIGHT) / ACROSS);
        let s = s_at(row + 1);
        ([cell(column, row), cell(column, row + 1)], ([u_at(column), u_at(column + 1)], [s, s]))
    }
}

fn touch_of(out: &mut Load, cell: usize) -> Option<&mut Touch> {
    out.touches.iter_mut().find(|t| usize::from(t.cell) == cell)
}

/// Takes the borders' energy and forces off; returns the change of the net normal force.
fn subtract_borders<const N: usize, A>(
    elastic: &Elastic,
    cells: &[Option<Element<N, A>>; CELLS],
    borders: &[Option<Border<N, A>>],
    out: &mut Load,
) -> f64 {
    let mut net = 0.0;
    for b in borders.iter().flatten() {
        let e = &b.element;
        net -= e.force_n;
        out.energy_j -= elastic.energy(e.place.effective);
        out.push(e.point, e.normal * -e.force_n);
        let depth = |i: usize| cells[b.cells[i]].as_ref().map_or(0.0, |c| c.place.effective);
        let first = first_share(depth(0), depth(1), e.place.effective);
        for (cell, share) in [(b.cells[0], first), (b.cells[1], 1.0 - first)] {
            if let Some(t) = touch_of(out, cell) {
                t.rubbing_n -= share * e.force_n;
                t.elastic -= e.normal * (share * e.force_n);
            }
        }
    }
    net
}

/// Adds the corners' energy and forces; returns the change of the net normal force.
fn add_corners<P: OnPetal<N>, const N: usize>(
    (pairing, elastic): (&P, &Elastic),
    borders: &Borders<P, N>,
    memory: &mut PairMemory<'_>,
    out: &mut Load,
) -> f64 {
    let mut net = 0.0;
    for i in 0..CORNERS {
        let (column, row) = corner(i);
        let around = [
            cell(column - 1, row - 1),
            cell(column, row - 1),
            cell(column - 1, row),
            cell(column, row),
        ];
        let meets = |b: &&Border<N, P::Aim>| b.cells.iter().all(|c| around.contains(c));
        let mut sides = borders.iter().flatten().filter(meets);
        let (Some(a), Some(b), Some(c), Some(d)) =
            (sides.next(), sides.next(), sides.next(), sides.next())
        else {
            continue;
        };
        let beside = [a, b, c, d].map(|b| &b.element.place);
        let Some(place) = between(pairing, CELLS + BORDERS + i, memory, &beside) else { continue };
        let e = element(pairing, elastic, place);
        net += e.force_n;
        out.energy_j += elastic.energy(e.place.effective);
        out.push(e.point, e.normal * e.force_n);
        for cell in around {
            if let Some(t) = touch_of(out, cell) {
                t.rubbing_n += 0.25 * e.force_n;
                t.elastic += e.normal * (0.25 * e.force_n);
            }
        }
    }
    net
}
