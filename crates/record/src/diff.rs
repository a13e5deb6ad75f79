use core::fmt;

use docktwin_core::{SimTime, Tick};

use crate::column::{Column, ContactRow};
use crate::tick::TickRecord;
use crate::{RecordError, RunReader};

/// Where two recordings first differ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// Tick of the first recording, or of the second where the first has ended.
    pub tick: Tick,
    /// Its time.
    pub time: SimTime,
    /// The column, or `tick`, `time`, `contacts`, `contacts[2].depth_m`, `end`.
    pub column: String,
    /// What the first recording has.
    pub a: String,
    /// What the second has.
    pub b: String,
    /// Further columns that differ in the same tick.
    pub others: usize,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { tick, time, column, a, b, others } = self;
        write!(f, "tick {} ({:.6} s), {column}: {a} against {b}", tick.0, time.seconds())?;
        if *others > 0 {
            write!(f, ", and {others} more columns")?;
        }
        Ok(())
    }
}

/// The first difference between two recordings, bit by bit, from their beginning; `None` when every
/// tick, cell and contact is the same. Events, metadata and names of pairs are not compared.
///
/// # Errors
/// Other columns, or a file that cannot be read. A cut file is not an error: it ends earlier.
pub fn first_difference(
    a: &mut RunReader,
    b: &mut RunReader,
) -> Result<Option<Difference>, RecordError> {
    first_difference_except(a, b, |_| false)
}

/// As [`first_difference`], but columns for which `skip` is true may differ.
///
/// # Errors
/// As [`first_difference`].
pub fn first_difference_except(
    a: &mut RunReader,
    b: &mut RunReader,
    skip: impl Fn(&Column) -> bool,
) -> Result<Option<Difference>, RecordError> {
    let problems = column_differences(a.columns(), b.columns());
    if !problems.is_empty() {
        return Err(RecordError::ColumnsDiffer(problems));
    }
    a.rewind()?;
    b.rewind()?;
    loop {
        let (x, y) = (a.next_tick()?, b.next_tick()?);
        let (x, y) = match (x, y) {
            (None, None) => return Ok(None),
            (Some(x), Some(y)) => (x, y),
            (Some(x), None) => return Ok(Some(end(&x, "goes on", "has ended"))),
            (None, Some(y)) => return Ok(Some(end(&y, "has ended", "goes on"))),
        };
        if let Some((column, left, right)) = tick_difference(a.columns(), &skip, &x, &y) {
            let (tick, time) = (x.tick, x.time);
            let cells = core::iter::zip(&x.row, &y.row).filter(|(p, q)| p != q).count();
            let others = cells.saturating_sub(1);
            return Ok(Some(Difference { tick, time, column, a: left, b: right, others }));
        }
    }
}

fn end(at: &TickRecord, a: &str, b: &str) -> Difference {
    let (tick, time) = (at.tick, at.time);
    Difference { tick, time, column: "end".into(), a: a.into(), b: b.into(), others: 0 }
}

fn tick_difference(
    columns: &[Column],
    skip: impl Fn(&Column) -> bool,
    x: &TickRecord,
    y: &TickRecord,
) -> Option<(String, String, String)> {
    if x.tick != y.tick {
        return Some(("tick".into(), x.tick.0.to_string(), y.tick.0.to_string()));
    }
    if x.time != y.time {
        let ns = |t: SimTime| format!("{} ns", t.nanos());
        return Some(("time".into(), ns(x.time), ns(y.time)));
    }
    let mut cells = columns.iter().zip(x.row.iter().zip(&y.row));
    if let Some((c, (p, q))) = cells.find(|(c, (p, q))| p != q && !skip(c)) {
        return Some((c.name.clone(), p.describe(c.kind), q.describe(c.kind)));
    }
    if x.contacts.len() != y.contacts.len() {
        let points = |n: usize| format!("{n} points");
        let (p, q) = (x.contacts.len(), y.contacts.len());
        return Some(("contacts".into(), points(p), points(q)));
    }
    let mut contacts = x.contacts.iter().zip(&y.contacts).enumerate();
    contacts.find_map(|(i, (p, q))| contact_difference(i, p, q))
}

fn contact_difference(
    i: usize,
    p: &ContactRow,
    q: &ContactRow,
) -> Option<(String, String, String)> {
    if p.pair != q.pair {
        return Some((format!("contacts[{i}].pair"), p.pair.to_string(), q.pair.to_string()));
    }
    let mut numbers = ContactRow::NUMBERS.iter().zip(p.numbers().into_iter().zip(q.numbers()));
    let (name, (s, t)) = numbers.find(|(_, (s, t))| s.to_bits() != t.to_bits())?;
    let text = |x: f64| crate::Cell::from(x).describe(crate::ColumnKind::F64);
    Some((format!("contacts[{i}].{name}"), text(s), text(t)))
}

/// Every way in which two lists of columns differ.
fn column_differences(a: &[Column], b: &[Column]) -> Vec<String> {
    let show = |c: &Column| format!("`{}` ({} on {})", c.name, c.kind.name(), c.topic);
    let only = |x: &[Column], y: &[Column], which: &str| {
        x.iter()
            .filter(|c| !y.contains(c))
            .map(|c| format!("only the {which} has {}", show(c)))
            .collect::<Vec<_>>()
    };
    let mut out = only(a, b, "first");
    out.extend(only(b, a, "second"));
    if out.is_empty() && a != b {
        out.push("the same columns stand in another order".into());
    }
    out
}
