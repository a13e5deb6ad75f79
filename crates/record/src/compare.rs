//! Comparison of two recordings within tolerances, such as a run against a rig and its rehearsal.

use std::collections::{BTreeMap, VecDeque};

use serde::Serialize;

use crate::column::{Column, ColumnKind};
use crate::tick::TickRecord;
use crate::{RecordError, RunReader};

/// Which instants of two recordings are compared with each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Align {
    /// The starts of both.
    #[default]
    Start,
    /// The first ticks with a contact.
    FirstContact,
}

/// Differences that still count as equal. The larger of both tolerances of a column holds; a column
/// without a tolerance is compared but not judged.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tolerance {
    /// Of the peak of the first recording: of a vector's largest length, for its components.
    pub relative: Option<f64>,
    /// By unit as it ends a column's name (`m`, `n`, `rad_s`), in that unit.
    pub by_unit: BTreeMap<String, f64>,
}

/// How two recordings are compared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CompareOptions {
    /// What is still the same.
    pub tolerance: Tolerance,
    /// Which instants belong together.
    pub align: Align,
}

/// A column of numbers of both recordings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColumnComparison {
    /// The column.
    pub column: String,
    /// Its unit as it ends the name; empty for a pure number.
    pub unit: String,
    /// Largest absolute value of the first recording, of the vector's length for a component.
    pub peak: f64,
    /// Largest difference.
    pub worst: f64,
    /// Time of the first recording at which it is, s.
    pub worst_time_s: f64,
    /// What both had there.
    pub worst_values: [f64; 2],
    /// Root mean square of the difference.
    pub rms: f64,
    /// `worst / peak`; null where the peak is zero.
    pub worst_of_peak: Option<f64>,
    /// `rms / peak`; null where the peak is zero.
    pub rms_of_peak: Option<f64>,
    /// Difference allowed; null where no tolerance speaks of the column.
    pub allowed: Option<f64>,
    /// `worst / allowed`: above 1 it is beyond. Infinite where nothing is allowed, null where not
    /// judged.
    pub times_allowed: Option<f64>,
    /// First tick of the first recording beyond its tolerance, and its time, s.
    pub first_beyond: Option<(u64, f64)>,
}

impl ColumnComparison {
    /// Whether the difference is larger than allowed.
    #[must_use]
    pub const fn beyond(&self) -> bool {
        self.first_beyond.is_some()
    }
}

/// A column of counts, states or true and false: reported, not judged.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StateComparison {
    /// The column.
    pub column: String,
    /// Ticks at which it differs.
    pub ticks_differing: u64,
    /// The first of them, and its time, s.
    pub first: Option<(u64, f64)>,
}

/// Result of the comparison of two recordings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Ticks of the first recording that were compared.
    pub ticks: u64,
    /// Ticks of each recording.
    pub ticks_of: [u64; 2],
    /// Length of a tick of each, s; null with fewer than two ticks.
    pub tick_s: [Option<f64>; 2],
    /// Time of each, s, at which the compared times are zero.
    pub zero_s: [f64; 2],
    /// Whether the second was interpolated to the times of the first.
    pub interpolated: bool,
    /// Numbers, the furthest beyond tolerance first.
    pub columns: Vec<ColumnComparison>,
    /// Counts and states.
    pub states: Vec<StateComparison>,
    /// Columns of only the first, of only the second.
    pub only: [Vec<String>; 2],
}

impl Comparison {
    /// Columns beyond their tolerance.
    pub fn beyond(&self) -> impl Iterator<Item = &ColumnComparison> {
        self.columns.iter().filter(|c| c.beyond())
    }
}

/// Units a column's name may end with, longest first.
const UNITS: [&str; 18] = [
    "kg_m2_s", "kg_m_s", "rad_s2", "n_s_m", "rad_s", "m_s2", "n_s", "m_s", "rad", "nm", "hz", "kg",
    "us", "m", "n", "j", "s", "w",
];

/// Unit at the end of a column's name, `m_s` of `chaser_velocity_x_m_s`; empty for a pure number.
#[must_use]
pub fn unit_of(name: &str) -> &'static str {
    // The parts of a quaternion are w, x, y, z.
    if name.contains("_attitude_") && is_quaternion_part(name) {
        return "";
    }
    UNITS
        .into_iter()
        .find(|u| name.strip_suffix(u).is_some_and(|rest| rest.ends_with('_')))
        .unwrap_or("")
}

fn is_quaternion_part(name: &str) -> bool {
    ["_attitude_w", "_attitude_x", "_attitude_y", "_attitude_z"].iter().any(|s| name.ends_with(s))
}

/// Name of the vector a component belongs to: `port3_force_x_n` belongs to `port3_force_n`.
fn vector_of(name: &str) -> String {
    let unit = unit_of(name);
    let rest = name.strip_suffix(unit).unwrap_or(name).trim_end_matches('_');
    let base = ["_w", "_x", "_y", "_z"].iter().find_map(|a| rest.strip_suffix(a));
    base.map_or_else(|| name.to_owned(), |b| format!("{b}_{unit}"))
}

/// What a first reading of a recording finds.
struct Survey {
    ticks: u64,
    tick_ns: Option<i128>,
    start_ns: i128,
    contact_ns: Option<i128>,
    peaks: BTreeMap<String, f64>,
}

fn survey(r: &mut RunReader) -> Result<Survey, RecordError> {
    let vectors: Vec<Option<String>> = r
        .columns()
        .iter()
        .map(|c| (c.kind == ColumnKind::F64).then(|| vector_of(&c.name)))
        .collect();
    let mut names: Vec<String> = vectors.iter().flatten().cloned().collect();
    names.sort();
    names.dedup();
    let index: Vec<Option<usize>> =
        vectors.iter().map(|v| v.as_ref().and_then(|v| names.binary_search(v).ok())).collect();
    let (mut squares, mut peaks) = (vec![0.0f64; names.len()], vec![0.0f64; names.len()]);
    let mut s =
        Survey { ticks: 0, tick_ns: None, start_ns: 0, contact_ns: None, peaks: BTreeMap::new() };
    let mut before = None;
    r.rewind()?;
    while let Some(t) = r.next_tick()? {
        let now = i128::from(t.time.nanos());
        match before {
            None => s.start_ns = now,
            Some(b) => {
                s.tick_ns.get_or_insert(now - b);
            }
        }
        before = Some(now);
        s.ticks += 1;
        if s.contact_ns.is_none() && !t.contacts.is_empty() {
            s.contact_ns = Some(now);
        }
        squares.fill(0.0);
        for (cell, i) in t.row.iter().zip(&index) {
            if let Some(i) = i {
                squares[*i] += cell.as_f64().powi(2);
            }
        }
        for (peak, square) in peaks.iter_mut().zip(&squares) {
            *peak = peak.max(square.sqrt());
        }
    }
    s.peaks = names.into_iter().zip(peaks).collect();
    Ok(s)
}

/// A column that both recordings have.
struct Pair {
    a: usize,
    b: usize,
    /// Euler angles are the same a turn apart.
    angle: bool,
    sum_square: f64,
    out: ColumnComparison,
}

/// A quaternion that both recordings have, as indices of its parts: `q` and `−q` are the same
/// attitude.
struct Attitude {
    a: [usize; 4],
    b: [usize; 4],
}

/// The second recording at any time that does not go back.
struct Later<'a> {
    reader: &'a mut RunReader,
    /// The last tick at or before the time asked for, and the one after.
    around: VecDeque<TickRecord>,
}

impl Later<'_> {
    /// Ticks on both sides of `ns` and where between them it lies, 0 to 1; the first alone where it
    /// lies exactly there. `None` outside of the recording.
    fn at(&mut self, ns: i128) -> Result<Option<(&TickRecord, &TickRecord, f64)>, RecordError> {
        loop {
            if self.around.len() < 2 {
                match self.reader.next_tick()? {
                    Some(t) => self.around.push_back(t),
                    None => break,
                }
                continue;
            }
            if i128::from(self.around[1].time.nanos()) <= ns {
                self.around.pop_front();
            } else {
                break;
            }
        }
        let Some(first) = self.around.front() else { return Ok(None) };
        let from = i128::from(first.time.nanos());
        if from == ns {
            return Ok(Some((first, first, 0.0)));
        }
        let Some(second) = self.around.get(1) else { return Ok(None) };
        let to = i128::from(second.time.nanos());
        if ns < from || ns > to {
            return Ok(None);
        }
        #[expect(clippy::cast_precision_loss, reason = "differences of times, far below 2^53 ns")]
        let share = (ns - from) as f64 / (to - from) as f64;
        Ok(Some((first, second, share)))
    }
}

#[expect(clippy::cast_precision_loss, reason = "times far below 2^53 ns")]
fn seconds(ns: i128) -> f64 {
    ns as f64 * 1e-9
}

/// Compares two recordings tick by tick of the first; the second is interpolated where its ticks
/// fall between. Columns of only one of them are listed. Cut recordings are compared up to there.
///
/// # Errors
/// A file that cannot be read; [`RecordError::Absent`] when the first contact is asked for and one
/// of them has none, or when they have no time in common.
pub fn compare(
    a: &mut RunReader,
    b: &mut RunReader,
    options: &CompareOptions,
) -> Result<Comparison, RecordError> {
    let surveys = [survey(a)?, survey(b)?];
    let [sa, sb] = &surveys;
    let absent = |r: &RunReader, what: &str, remedy| RecordError::Absent {
        what: what.into(),
        remedy,
        path: r.log_path().to_owned(),
    };
    let untouched = |r: &RunReader| {
        let remedy = "align the runs at their start, or give runs in which something touches";
        absent(r, "a contact to align by", remedy)
    };
    let zero = match options.align {
        Align::Start => [sa.start_ns, sb.start_ns],
        Align::FirstContact => {
            [sa.contact_ns.ok_or_else(|| untouched(a))?, sb.contact_ns.ok_or_else(|| untouched(b))?]
        }
    };
    let shift = zero[1] - zero[0];
    let (mut pairs, mut states) = (Vec::new(), Vec::new());
    for (i, c) in a.columns().iter().enumerate() {
        let Some(j) = b.columns().iter().position(|d| d.name == c.name && d.kind == c.kind) else {
            continue;
        };
        if c.kind == ColumnKind::F64 {
            pairs.push(new_pair(i, j, &c.name, sa, &options.tolerance));
        } else if !c.name.contains("digest") {
            // A digest tells that anything differs, which says nothing here.
            let column = c.name.clone();
            states.push((i, j, StateComparison { column, ticks_differing: 0, first: None }));
        }
    }
    let attitudes = attitudes(a, b);
    let mut out = Comparison {
        ticks: 0,
        ticks_of: [sa.ticks, sb.ticks],
        tick_s: [sa, sb].map(|s| s.tick_ns.map(seconds)),
        zero_s: zero.map(seconds),
        interpolated: false,
        columns: Vec::new(),
        states: Vec::new(),
        only: [only(a.columns(), b.columns()), only(b.columns(), a.columns())],
    };
    a.rewind()?;
    b.rewind()?;
    let mut second = Later { reader: b, around: VecDeque::new() };
    let mut row = Vec::new();
    while let Some(t) = a.next_tick()? {
        let Some((p, q, share)) = second.at(i128::from(t.time.nanos()) + shift)? else { continue };
        out.ticks += 1;
        out.interpolated |= share > 0.0;
        row.clear();
        row.extend(p.row.iter().zip(&q.row).map(|(x, y)| {
            let (x, y) = (x.as_f64(), y.as_f64());
            if share > 0.0 { x + (y - x) * share } else { x }
        }));
        for q in &attitudes {
            let dot: f64 = (0..4).map(|k| t.row[q.a[k]].as_f64() * row[q.b[k]]).sum();
            if dot < 0.0 {
                q.b.iter().for_each(|k| row[*k] = -row[*k]);
            }
        }
        let at = (t.tick.0, t.time.seconds());
        for pair in &mut pairs {
            pair.look(t.row[pair.a].as_f64(), row[pair.b], at);
        }
        for (i, j, s) in &mut states {
            if t.row[*i] != p.row[*j] {
                s.ticks_differing += 1;
                s.first.get_or_insert(at);
            }
        }
    }
    if out.ticks == 0 {
        let remedy = "give two runs of at least one tick, and align them where both have ticks";
        return Err(absent(a, "a time in common with the other recording", remedy));
    }
    out.columns = pairs.into_iter().map(|p| p.finish(out.ticks)).collect();
    worst_first(&mut out.columns);
    out.states = states.into_iter().map(|(_, _, s)| s).collect();
    Ok(out)
}

/// Names of the columns of `x` that `y` does not have.
fn only(x: &[Column], y: &[Column]) -> Vec<String> {
    let same = |c: &&Column| y.iter().any(|d| d.name == c.name && d.kind == c.kind);
    x.iter().filter(|c| !same(c)).map(|c| c.name.clone()).collect()
}

fn worst_first(columns: &mut [ColumnComparison]) {
    let rank = |c: &ColumnComparison| c.times_allowed.unwrap_or(-1.0);
    let of_peak = |c: &ColumnComparison| c.worst_of_peak.unwrap_or(0.0);
    columns.sort_by(|x, y| rank(y).total_cmp(&rank(x)).then(of_peak(y).total_cmp(&of_peak(x))));
}

fn new_pair(a: usize, b: usize, name: &str, sa: &Survey, tolerance: &Tolerance) -> Pair {
    let unit = unit_of(name);
    let peak = sa.peaks.get(&vector_of(name)).copied().unwrap_or(0.0);
    let of_peak = tolerance.relative.map(|r| r * peak);
    let allowed = match (of_peak, tolerance.by_unit.get(unit).copied()) {
        (Some(x), Some(y)) => Some(x.max(y)),
        (x, y) => x.or(y),
    };
    Pair {
        a,
        b,
        angle: unit == "rad",
        sum_square: 0.0,
        out: ColumnComparison {
            column: name.to_owned(),
            unit: unit.to_owned(),
            peak,
            worst: 0.0,
            worst_time_s: 0.0,
            worst_values: [0.0; 2],
            rms: 0.0,
            worst_of_peak: None,
            rms_of_peak: None,
            allowed,
            times_allowed: None,
            first_beyond: None,
        },
    }
}

impl Pair {
    fn look(&mut self, x: f64, y: f64, (tick, time_s): (u64, f64)) {
        let turn = core::f64::consts::TAU;
        let mut d = x - y;
        if self.angle {
            d -= turn * (d / turn).round();
        }
        // Two that are no numbers are the same; one alone is as far off as can be.
        let d = if x.is_nan() && y.is_nan() || x.to_bits() == y.to_bits() {
            0.0
        } else if d.is_nan() {
            f64::INFINITY
        } else {
            d.abs()
        };
        self.sum_square += d * d;
        let out = &mut self.out;
        if d > out.worst {
            (out.worst, out.worst_time_s, out.worst_values) = (d, time_s, [x, y]);
        }
        if out.allowed.is_some_and(|allowed| d > allowed) {
            out.first_beyond.get_or_insert((tick, time_s));
        }
    }

    fn finish(self, ticks: u64) -> ColumnComparison {
        let mut out = self.out;
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53 ticks")]
        let n = ticks as f64;
        out.rms = (self.sum_square / n).sqrt();
        if out.peak > 0.0 {
            out.worst_of_peak = Some(out.worst / out.peak);
            out.rms_of_peak = Some(out.rms / out.peak);
        }
        out.times_allowed = out.allowed.map(|allowed| match out.worst {
            worst if worst <= 0.0 => 0.0,
            worst => worst / allowed,
        });
        out
    }
}

fn attitudes(a: &RunReader, b: &RunReader) -> Vec<Attitude> {
    let bodies = a.columns().iter().filter_map(|c| c.name.strip_suffix("_attitude_w"));
    let parts = |r: &RunReader, body: &str| -> Option<[usize; 4]> {
        let mut out = [0; 4];
        for (i, p) in ["w", "x", "y", "z"].into_iter().enumerate() {
            out[i] = r.column_index(&format!("{body}_attitude_{p}"))?;
        }
        Some(out)
    };
    bodies.filter_map(|body| Some(Attitude { a: parts(a, body)?, b: parts(b, body)? })).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_units_and_vectors_come_from_names() {
        for (name, unit, vector) in [
            ("chaser_position_x_m", "m", "chaser_position_m"),
            ("chaser_velocity_y_m_s", "m_s", "chaser_velocity_m_s"),
            ("angular_momentum_z_kg_m2_s", "kg_m2_s", "angular_momentum_kg_m2_s"),
            ("port3_moment_x_nm", "nm", "port3_moment_nm"),
            ("relative_attitude_x_rad", "rad", "relative_attitude_rad"),
            ("chaser_attitude_w", "", "chaser_attitude_"),
            ("energy_kinetic_j", "j", "energy_kinetic_j"),
            ("contact_depth_m", "m", "contact_depth_m"),
        ] {
            assert_eq!((unit_of(name), vector_of(name).as_str()), (unit, vector));
        }
    }
}
