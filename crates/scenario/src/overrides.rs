//! `--set key.path=value` on the tree of a TOML file.

use std::collections::BTreeMap;

use docktwin_model::input::Lines;
use toml::de::{DeTable, DeValue};
use toml_edit::{DocumentMut, Item, Table, TableLike, Value};

/// Names in the longest path of a key.
const DEEPEST: usize = 8;
/// Bytes of the longest path of a key.
const LONGEST: usize = 200;

/// One value of a scenario, to stand in for what the text says.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Patch {
    /// Dotted path.
    pub(crate) key: String,
    /// As TOML; what is not TOML is text.
    pub(crate) value: String,
}

/// Puts one value into the document, making tables on the way. A value that is not TOML is taken as
/// text, so that words need no quotes.
pub(crate) fn set(document: &mut DocumentMut, path: &str, value: &str) -> Result<(), String> {
    let parts: Vec<&str> = path.split('.').map(str::trim).collect();
    if parts.iter().any(|p| p.is_empty()) {
        return Err("is not a key path".into());
    }
    if parts.len() > DEEPEST {
        return Err(format!("is a path of {} names; no key has more than {DEEPEST}", parts.len()));
    }
    let value = value.trim().parse::<Value>().unwrap_or_else(|_| Value::from(value.trim()));
    let Some((last, tables)) = parts.split_last() else { return Err("is empty".into()) };
    set_in(document.as_table_mut(), tables, last, value)
}

fn set_in(
    table: &mut dyn TableLike,
    path: &[&str],
    last: &str,
    mut value: Value,
) -> Result<(), String> {
    let Some((first, rest)) = path.split_first() else {
        if let Some(old) = table.get(last) {
            if let Some(old) = old.as_value() {
                *value.decor_mut() = old.decor().clone();
            } else {
                return Err(format!("`{last}` is a table, not a value"));
            }
        }
        table.insert(last, Item::Value(value));
        return Ok(());
    };
    if table.get(first).is_none() {
        table.insert(first, Item::Table(Table::new()));
    }
    let Some(item) = table.get_mut(first) else { return Err("cannot be added".into()) };
    let (item, rest): (&mut dyn TableLike, &[&str]) = match item {
        Item::ArrayOfTables(array) => {
            let n = array.len();
            let index = rest.first().and_then(|i| i.parse::<usize>().ok());
            match index.and_then(|i| array.get_mut(i)) {
                Some(t) => (t, &rest[1..]),
                None => {
                    return Err(format!(
                        "`{first}` is a list of {n}: name one of them, as {first}.0"
                    ));
                }
            }
        }
        other => match other.as_table_like_mut() {
            Some(t) => (t, rest),
            None => return Err(format!("`{first}` is a value, not a table")),
        },
    };
    set_in(item, rest, last, value)
}

/// Line of every key of a text, by dotted path.
pub(crate) fn lines(text: &str) -> BTreeMap<String, usize> {
    let (root, _) = DeTable::parse_recoverable(text);
    let mut lines = BTreeMap::new();
    walk(&Lines::of(text), "", root.get_ref(), &mut lines);
    lines
}

fn walk(text: &Lines, prefix: &str, table: &DeTable<'_>, lines: &mut BTreeMap<String, usize>) {
    // No key of ours is longer; a long one would be repeated for each key inside.
    if prefix.len() > LONGEST {
        return;
    }
    let line = |offset: usize| text.at(offset);
    for (k, v) in table {
        let path = if prefix.is_empty() {
            k.get_ref().to_string()
        } else {
            format!("{prefix}.{}", k.get_ref())
        };
        lines.insert(path.clone(), line(k.span().start));
        match v.get_ref() {
            DeValue::Table(t) => walk(text, &path, t, lines),
            DeValue::Array(items) => {
                for (i, item) in items.iter().enumerate() {
                    let path = format!("{path}.{i}");
                    lines.insert(path.clone(), line(item.span().start));
                    if let Some(t) = item.get_ref().as_table() {
                        walk(text, &path, t, lines);
                    }
                }
            }
            _ => {}
        }
    }
}
