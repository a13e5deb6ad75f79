//! The tables of keys as Markdown, for `docs/models.md`.

use core::fmt::Write as _;

use super::explain::{bracketed, needed, value};
use super::{FileKind, Group, Heading, Key, Need};

/// The keys of one kind of file, table by table.
#[must_use]
pub fn markdown(kind: FileKind) -> String {
    let mut out = String::new();
    let groups = kind.groups();
    for (i, group) in groups.iter().enumerate() {
        headings(group.tables, &mut out);
        match groups[..i].iter().find(|g| g.has_keys_of(group)) {
            // Writing to a String cannot fail.
            Some(same) => {
                let _ = writeln!(out, "Keys as of {}.\n", in_words(same.tables));
            }
            None if group.keys.is_empty() => {}
            None => keys(group, &mut out),
        }
    }
    out.truncate(out.trim_end().len());
    out.push('\n');
    out
}

fn in_words(tables: &[Heading]) -> String {
    tables.iter().map(|h| format!("`{}`", bracketed(h))).collect::<Vec<_>>().join(", ")
}

fn headings(tables: &[Heading], out: &mut String) {
    for h in tables {
        let times = match h.times {
            None => String::new(),
            Some(0) => ", any number of them".to_owned(),
            Some(n) => format!(", {n} times"),
        };
        let need = needed(h.need);
        let _ = match h.path {
            "" => writeln!(out, "**At the top of the file.**\n"),
            _ => writeln!(out, "**`{}`** ({need}{times}). {}\n", bracketed(h), h.meaning),
        };
    }
}

fn keys(group: &Group, out: &mut String) {
    out.push_str(
        "| key | value | example | meaning, and why it is needed |\n| --- | --- | --- | --- |\n",
    );
    for k in group.keys {
        let _ = writeln!(
            out,
            "| `{}` | {} | {} | {} {} |",
            k.name,
            cell(&value_and_need(k)),
            format_args!("`{}`", cell(k.example)),
            cell(k.meaning),
            cell(k.why)
        );
    }
    out.push('\n');
}

fn value_and_need(k: &Key) -> String {
    match k.need {
        Need::Required => value(k),
        need => format!("{}; {}", value(k), needed(need)),
    }
}

/// A bar would end the cell.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}
