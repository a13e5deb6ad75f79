use core::fmt;
use std::collections::BTreeSet;

use docktwin_core::DVec3;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColumnKind {
    /// A number; its unit stands in the column's name.
    F64,
    /// A count, a digest or an enumeration.
    U64,
    /// Yes or no.
    Bool,
}

impl ColumnKind {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::F64 => "float64",
            Self::U64 => "uint64",
            Self::Bool => "bool",
        }
    }

    pub(crate) fn from_name(name: &str) -> Option<Self> {
        [Self::F64, Self::U64, Self::Bool].into_iter().find(|k| k.name() == name)
    }

    /// Bytes in a message; also the alignment there.
    pub(crate) const fn size(self) -> usize {
        match self {
            Self::F64 | Self::U64 => 8,
            Self::Bool => 1,
        }
    }
}

/// One recorded signal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Name with its unit last, `chaser_position_x_m`; lower case, digits, single underscores.
    pub name: String,
    /// Topic whose message carries the column, `/chaser/truth`.
    pub topic: String,
    /// What it holds.
    pub kind: ColumnKind,
}

impl Column {
    /// A column of any kind.
    #[must_use]
    pub fn new(kind: ColumnKind, topic: impl Into<String>, name: impl Into<String>) -> Self {
        Self { name: name.into(), topic: topic.into(), kind }
    }

    /// A column of numbers.
    #[must_use]
    pub fn f64(topic: impl Into<String>, name: impl Into<String>) -> Self {
        Self::new(ColumnKind::F64, topic, name)
    }

    /// A column of integers.
    #[must_use]
    pub fn u64(topic: impl Into<String>, name: impl Into<String>) -> Self {
        Self::new(ColumnKind::U64, topic, name)
    }

    /// A column of yes or no.
    #[must_use]
    pub fn bool(topic: impl Into<String>, name: impl Into<String>) -> Self {
        Self::new(ColumnKind::Bool, topic, name)
    }
}

/// The bits of one value of one column. Equal means the same bits: NaN equals itself, −0.0 and 0.0
/// differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Cell(u64);

impl Cell {
    /// From raw bits.
    #[must_use]
    pub const fn from_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// The raw bits.
    #[must_use]
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// Read as a number.
    #[must_use]
    pub const fn as_f64(self) -> f64 {
        f64::from_bits(self.0)
    }

    /// Read as an integer.
    #[must_use]
    pub const fn as_u64(self) -> u64 {
        self.0
    }

    /// Read as yes or no.
    #[must_use]
    pub const fn as_bool(self) -> bool {
        self.0 != 0
    }

    /// The value in words, with its bits where the decimal does not tell all.
    #[must_use]
    pub fn describe(self, kind: ColumnKind) -> String {
        match kind {
            ColumnKind::F64 => format!("{:?} (bits 0x{:016x})", self.as_f64(), self.0),
            ColumnKind::U64 => format!("{} (0x{:016x})", self.0, self.0),
            ColumnKind::Bool => self.as_bool().to_string(),
        }
    }
}

impl From<f64> for Cell {
    fn from(x: f64) -> Self {
        Self(x.to_bits())
    }
}

impl From<u64> for Cell {
    fn from(x: u64) -> Self {
        Self(x)
    }
}

impl From<bool> for Cell {
    fn from(x: bool) -> Self {
        Self(u64::from(x))
    }
}

/// One contact point of a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactRow {
    /// Index into the pair names given to [`crate::RunWriter::create`].
    pub pair: u16,
    /// Where, in the world, m.
    pub point_w_m: DVec3,
    /// Unit normal in the world, from the first of the pair to the second.
    pub normal_w: DVec3,
    /// Penetration, m.
    pub depth_m: f64,
    /// Force along the normal, N.
    pub normal_force_n: f64,
    /// Friction force in the world, N.
    pub friction_w_n: DVec3,
}

impl ContactRow {
    /// Names of the numbers, in the order of [`Self::numbers`].
    pub const NUMBERS: [&str; 11] = [
        "point_w_m.x",
        "point_w_m.y",
        "point_w_m.z",
        "normal_w.x",
        "normal_w.y",
        "normal_w.z",
        "depth_m",
        "normal_force_n",
        "friction_w_n.x",
        "friction_w_n.y",
        "friction_w_n.z",
    ];

    /// All numbers: place, normal, depth, normal force, friction.
    #[must_use]
    pub fn numbers(&self) -> [f64; 11] {
        let (p, n, t) = (self.point_w_m, self.normal_w, self.friction_w_n);
        [p.x, p.y, p.z, n.x, n.y, n.z, self.depth_m, self.normal_force_n, t.x, t.y, t.z]
    }

    pub(crate) fn from_numbers(pair: u16, x: [f64; 11]) -> Self {
        Self {
            pair,
            point_w_m: DVec3::new(x[0], x[1], x[2]),
            normal_w: DVec3::new(x[3], x[4], x[5]),
            depth_m: x[6],
            normal_force_n: x[7],
            friction_w_n: DVec3::new(x[8], x[9], x[10]),
        }
    }

    /// True when every bit is the same.
    #[must_use]
    pub fn same_bits(&self, other: &Self) -> bool {
        self.pair == other.pair
            && self.numbers().map(f64::to_bits) == other.numbers().map(f64::to_bits)
    }
}

/// One reason why a set of columns cannot be recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnProblem {
    /// Position in the list given, from 0.
    pub index: usize,
    /// The name or topic at fault.
    pub value: String,
    /// What is wrong with it and what to do.
    pub why: &'static str,
}

impl fmt::Display for ColumnProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "column {}, `{}`: {}", self.index, self.value, self.why)
    }
}

pub(crate) const TICK_TOPIC: &str = "/tick";
pub(crate) const CONTACTS_TOPIC: &str = "/contacts";
pub(crate) const EVENTS_TOPIC: &str = "/events";
pub(crate) const DIGEST_TOPIC: &str = "/record_digest";
/// Topics that the recorder writes itself, in the order of their channels, from 1.
pub(crate) const OWN_TOPICS: [&str; 4] = [TICK_TOPIC, CONTACTS_TOPIC, EVENTS_TOPIC, DIGEST_TOPIC];
/// Columns that every recording has without being asked.
pub(crate) const OWN_COLUMNS: [&str; 2] = ["tick", "time_s"];

/// A field name as ROS 2 allows it: `[a-z][a-z0-9_]*` without `__` and without `_` at the end.
fn is_field_name(s: &str) -> bool {
    s.starts_with(|c: char| c.is_ascii_lowercase())
        && s.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && !s.contains("__")
        && !s.ends_with('_')
}

/// All reasons why these columns cannot be recorded.
pub(crate) fn problems(columns: &[Column]) -> Vec<ColumnProblem> {
    let mut seen = BTreeSet::new();
    let mut out = Vec::new();
    for (index, c) in columns.iter().enumerate() {
        let mut push =
            |value: &str, why| out.push(ColumnProblem { index, value: value.into(), why });
        if !is_field_name(&c.name) {
            push(
                &c.name,
                "a column's name starts with a small letter and has small letters, digits and \
                 single underscores, such as chaser_position_x_m",
            );
        }
        if OWN_COLUMNS.contains(&c.name.as_str()) {
            push(&c.name, "every recording has this column already; leave it out");
        } else if !seen.insert(c.name.as_str()) {
            push(&c.name, "another column has this name; names are unique over all topics");
        }
        if !c.topic.strip_prefix('/').is_some_and(|t| t.split('/').all(is_field_name)) {
            push(
                &c.topic,
                "a topic is a slash and words of small letters, digits and single underscores \
                 between slashes, such as /chaser/truth",
            );
        }
        if OWN_TOPICS.contains(&c.topic.as_str()) {
            push(&c.topic, "this topic is written by the recorder itself; choose another");
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_all_column_problems_are_told_at_once() {
        let bad = [
            Column::f64("/chaser/truth", "R_e"),
            Column::f64("chaser", "x_m"),
            Column::u64("/a", "tick"),
            Column::bool("/events", "x_m"),
            Column::f64("/a", "trailing_"),
        ];
        let found: Vec<_> = problems(&bad).into_iter().map(|p| (p.index, p.value)).collect();
        let want =
            [(0, "R_e"), (1, "chaser"), (2, "tick"), (3, "x_m"), (3, "/events"), (4, "trailing_")];
        assert_eq!(found, want.map(|(i, v)| (i, v.to_owned())));
        assert!(problems(&[Column::f64("/chaser/truth", "chaser_position_x_m")]).is_empty());
    }

    #[test]
    fn invariant_cells_are_compared_by_bits() {
        assert_eq!(Cell::from(f64::NAN), Cell::from(f64::NAN));
        assert_ne!(Cell::from(0.0), Cell::from(-0.0));
        assert!(Cell::from(-0.0).as_f64().is_sign_negative());
    }
}
