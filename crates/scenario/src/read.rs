//! Reading a table of a scenario by the table of keys.

use docktwin_core::DVec3;
use docktwin_model::toml_check::{Range, Table};

use crate::keys::{Shape, find};

/// A number as the table of keys describes it; NaN when it is absent or wrong.
pub(crate) fn number(t: &Table<'_, '_>, key: &'static str) -> f64 {
    match find(&t.key(key)).map(|k| k.shape) {
        Some(Shape::Number(range)) => t.number(key, range),
        Some(Shape::Default(range, default)) => t.optional_number(key, range).unwrap_or(default),
        Some(Shape::Maybe(range)) => t.optional_number(key, range).unwrap_or(f64::NAN),
        _ => t.number(key, Range::ANY),
    }
}

/// A number that may be absent.
pub(crate) fn maybe(t: &Table<'_, '_>, key: &'static str) -> Option<f64> {
    t.has(key).then(|| number(t, key))
}

pub(crate) fn count(t: &Table<'_, '_>, key: &'static str) -> Option<u32> {
    match find(&t.key(key)).map(|k| k.shape) {
        Some(Shape::Count(lo, hi)) => t.optional_count(key, lo, hi),
        _ => t.optional_count(key, 0, u32::MAX),
    }
}

pub(crate) fn flag(t: &Table<'_, '_>, key: &'static str) -> bool {
    let default = matches!(find(&t.key(key)).map(|k| k.shape), Some(Shape::Flag(true)));
    t.flag(key, default)
}

pub(crate) fn vector(t: &Table<'_, '_>, keys: [&'static str; 3]) -> DVec3 {
    DVec3::from_array(keys.map(|k| number(t, k)))
}
