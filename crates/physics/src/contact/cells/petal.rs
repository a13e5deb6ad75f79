//! Cells of a petal, against a ring or another petal.

use docktwin_core::DVec3;

use super::{Elastic, Load, Touch, first_share};
use crate::contact::search::{KeptProof, Pairing, Place, Proof, Rect, Start, deepest};

/// Cells across the rulings, and along them.
pub(crate) const ACROSS: usize = 4;
pub(crate) const ALONG: usize = 2;
pub(crate) const CELLS: usize = ACROSS * ALONG;

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

fn spans(cell: usize) -> ([f64; 2], [f64; 2]) {
    let (column, row) = (cell % ACROSS, cell / ACROSS);
    ([u_at(column), u_at(column + 1)], [s_at(row), s_at(row + 1)])
}

/// The rectangle of a cell.
pub(crate) fn cell_rect<P: OnPetal<N>, const N: usize>(pairing: &P, cell: usize) -> Rect<N> {
    let (u, s) = spans(cell);
    pairing.over(u, s)
}

/// Cells that share a border or a corner with one.
pub(crate) fn are_neighbours(a: usize, b: usize) -> bool {
    let (ca, ra, cb, rb) = (a % ACROSS, a / ACROSS, b % ACROSS, b / ACROSS);
    ca.abs_diff(cb) <= 1 && ra.abs_diff(rb) <= 1
}

/// What one measurement of a petal's pair remembers for the next.
pub(crate) struct Memory<const N: usize> {
    /// Where each cell was deepest.
    pub(crate) starts: [Option<Start<N>>; CELLS],
    /// How far each cell is known to be apart, m; not above zero: not known.
    pub(crate) apart_m: [f64; CELLS],
}

struct Element<const N: usize, A> {
    place: Place<N, A>,
    proof: Option<Proof<N>>,
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

/// Energy and forces of a pair. `memory` tells where to look, and learns it for the next time.
pub(crate) fn load<P: OnPetal<N>, const N: usize>(
    pairing: &P,
    elastic: &Elastic,
    memory: &mut Memory<N>,
) -> Load {
    let cells = touching_cells(pairing, elastic, memory);
    let mut out = Load::NONE;
    let mut net = 0.0;
    for (i, e) in cells.iter().enumerate() {
        if let Some(e) = e {
            net += e.force_n;
            add_cell(elastic, i, e, &mut out);
        }
    }
    if out.len > 1 {
        let borders = shared_borders(pairing, elastic, &cells);
        net += subtract_borders(elastic, &cells, &borders, &mut out);
        net += add_corners(pairing, elastic, &borders, &mut out);
        for t in &mut out.touches[..out.len] {
            let own = cells[usize::from(t.cell)].as_ref().map_or(1.0, |e| e.force_n);
            t.rubbing_n = t.rubbing_n.max(0.0);
            t.share = if own > 0.0 { (t.rubbing_n / own).min(1.0) } else { 0.0 };
        }
    }
    out.level_rubbing(net);
    out
}

/// One place alone.
pub(crate) fn single_load<P: OnPetal<N>, const N: usize>(
    pairing: &P,
    elastic: &Elastic,
    cell: usize,
    place: Place<N, P::Aim>,
) -> Load {
    let mut out = Load::NONE;
    add_cell(elastic, cell, &element(pairing, elastic, place), &mut out);
    out
}

fn add_cell<const N: usize, A>(elastic: &Elastic, cell: usize, e: &Element<N, A>, out: &mut Load) {
    out.energy_j += elastic.energy(e.place.effective);
    out.push(e.point, e.normal * e.force_n);
    let mut z = [0.0; 4];
    z[..N].copy_from_slice(&e.place.z);
    out.touches[out.len] = Touch {
        cell: u8::try_from(cell).unwrap_or(u8::MAX),
        z,
        proof: e.proof.as_ref().map(KeptProof::of),
        depth: e.place.depth,
        elastic: e.normal * e.force_n,
        rubbing_n: e.force_n,
        share: 1.0,
        point: e.point,
        dir: e.normal,
        ..Touch::NONE
    };
    out.len += 1;
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
        proof: None,
    }
}

type Elements<P, const N: usize> = [Option<Element<N, <P as Pairing<N>>::Aim>>; CELLS];

fn touching_cells<P: OnPetal<N>, const N: usize>(
    pairing: &P,
    elastic: &Elastic,
    memory: &mut Memory<N>,
) -> Elements<P, N> {
    let mut found: Elements<P, N> = [const { None }; CELLS];
    // Those that touched before come first: their places are good starts for their neighbours.
    for known in [true, false] {
        for i in 0..CELLS {
            if memory.starts[i].is_some() != known || memory.apart_m[i] > 0.0 {
                continue;
            }
            let rect = cell_rect(pairing, i);
            let near = || {
                let neighbour = (0..CELLS).filter(|k| are_neighbours(i, *k));
                neighbour.filter_map(|k| found[k].as_ref()).map(|e| e.place.z).next()
            };
            let start = memory.starts[i]
                .unwrap_or_else(|| Start::at(near().unwrap_or_else(|| rect.middle())));
            let best = deepest(pairing, &rect, 0.0, &start);
            if best.place.effective > 0.0 {
                found[i] =
                    Some(Element { proof: best.proof, ..element(pairing, elastic, best.place) });
            } else {
                memory.apart_m[i] = -best.at_most;
            }
        }
    }
    found
}

/// The deepest place on a border or corner: that of a cell or border which is deepest there, if there is
/// one.
fn on_rect<P: OnPetal<N>, const N: usize>(
    pairing: &P,
    elastic: &Elastic,
    (u, s): ([f64; 2], [f64; 2]),
    known: &[&Place<N, P::Aim>],
) -> Option<Element<N, P::Aim>> {
    let within = |z: &[f64; N]| u[0] <= z[0] && z[0] <= u[1] && s[0] <= z[1] && z[1] <= s[1];
    let lowest = known.iter().min_by(|a, b| a.effective.total_cmp(&b.effective))?;
    let place = match known.iter().find(|p| within(&p.z)) {
        Some(place) => **place,
        None => deepest(pairing, &pairing.over(u, s), 0.0, &Start::at(lowest.z)).place,
    };
    (place.effective > 0.0).then(|| element(pairing, elastic, place))
}

const BORDERS: usize = (ACROSS - 1) * ALONG + ACROSS * (ALONG - 1);
type Borders<P, const N: usize> = [Option<Border<N, <P as Pairing<N>>::Aim>>; BORDERS];

fn shared_borders<P: OnPetal<N>, const N: usize>(
    pairing: &P,
    elastic: &Elastic,
    cells: &Elements<P, N>,
) -> Borders<P, N> {
    let mut out: Borders<P, N> = [const { None }; BORDERS];
    for (i, slot) in out.iter_mut().enumerate() {
        let (pair, span) = border(i);
        let [Some(a), Some(b)] = pair.map(|c| cells[c].as_ref()) else { continue };
        *slot = on_rect(pairing, elastic, span, &[&a.place, &b.place])
            .map(|element| Border { cells: pair, element });
    }
    out
}

/// Cells on both sides of a border, and its place: first those along rulings, then those across.
fn border(i: usize) -> ([usize; 2], ([f64; 2], [f64; 2])) {
    const UPRIGHT: usize = (ACROSS - 1) * ALONG;
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
    out.touches[..out.len].iter_mut().find(|t| usize::from(t.cell) == cell)
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
    pairing: &P,
    elastic: &Elastic,
    borders: &Borders<P, N>,
    out: &mut Load,
) -> f64 {
    let mut net = 0.0;
    for row in 1..ALONG {
        for column in 1..ACROSS {
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
            let (u, s) = (u_at(column), s_at(row));
            let at = ([u, u], [s, s]);
            let places = [a, b, c, d].map(|b| &b.element.place);
            let Some(e) = on_rect(pairing, elastic, at, &places) else { continue };
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
    }
    net
}
