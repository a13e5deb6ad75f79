//! One table of every signal that is recorded: name, topic, unit, frame, reference point, meaning.
//!
//! The columns of `telemetry.parquet` and the topics of `run.mcap` are made from it, and so is
//! `docs/signals.md`. A new signal goes into this table and, at the same place, into
//! [`crate::signals::row`] or [`crate::telemetry::loop_row`]. Columns are added, never renamed: old
//! recordings are read by name.

mod page;
mod table;

use docktwin_record::{Column, ColumnKind};

pub use page::markdown;
pub use table::{DOCKING, WITH_RIG};

/// A physical unit: how it ends a column's name, and how it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unit {
    /// End of the name, without the underscore; empty for a pure number.
    pub suffix: &'static str,
    /// As a reader writes it.
    pub written: &'static str,
}

/// A signal: one column, or a vector whose components are columns of their own.
#[derive(Clone, Copy, Debug)]
pub struct Signal {
    /// Topic of `run.mcap`.
    pub topic: &'static str,
    /// Name before component and unit; `{i}` stands for the index of its group.
    pub name: &'static str,
    /// What the columns hold.
    pub kind: ColumnKind,
    /// Components, `x y z` or `w x y z`; empty for a single column.
    pub components: &'static [&'static str],
    /// Unit.
    pub unit: Unit,
    /// Axes in which the components are given; empty where there is no direction.
    pub frame: &'static str,
    /// Point it belongs to; empty where there is none.
    pub point: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// What differs in a run against a rig; empty where nothing does.
    pub with_rig: &'static str,
    /// What each number means, for an enumeration.
    pub values: &'static [(u64, &'static str)],
    /// What each bit means, for a set of bits.
    pub bits: &'static [(u64, &'static str)],
}

/// Signals that are recorded once for every index from 1 on, or once where there is no index.
#[derive(Clone, Copy, Debug)]
pub struct Group {
    /// How many; `None` for signals without index. Of latches at least these: a mechanism with more has columns for each.
    pub count: Option<u32>,
    /// What the index counts.
    pub of: &'static str,
    /// The signals; all of index 1 come before those of index 2.
    pub signals: &'static [Signal],
}

impl Signal {
    /// Names of its columns; `index` replaces `{i}`.
    pub fn names(&self, index: u32) -> impl Iterator<Item = String> + use<> {
        let name = self.name.replace("{i}", &index.to_string());
        let end = match self.unit.suffix {
            "" => String::new(),
            suffix => format!("_{suffix}"),
        };
        let single = self.components.is_empty().then(|| format!("{name}{end}"));
        let several = self.components.iter().map(move |a| format!("{name}_{a}{end}"));
        single.into_iter().chain(several)
    }
}

/// Latches that have columns in every recording, whether they are there or not.
pub(crate) const LATCH_COLUMNS: usize = 3;

/// Columns of groups of signals, in their order.
pub(crate) fn columns_of(groups: &[Group]) -> Vec<Column> {
    columns_with(groups, LATCH_COLUMNS)
}

/// As [`columns_of`], of a mechanism with so many latches.
pub(crate) fn columns_with(groups: &[Group], latches: usize) -> Vec<Column> {
    let latches = u32::try_from(latches.max(LATCH_COLUMNS)).unwrap_or(0);
    let mut out = Vec::new();
    for group in groups {
        let count = if group.of == "latch" { latches } else { group.count.unwrap_or(1) };
        for index in 1..=count {
            for s in group.signals {
                out.extend(s.names(index).map(|name| Column::new(s.kind, s.topic, name)));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests;
