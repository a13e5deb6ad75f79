//! The table as Markdown, for `docs/signals.md`.

use core::fmt::Write as _;

use docktwin_record::ColumnKind;

use super::{Group, Signal};

/// Signals of the groups, one row each, and what their numbers mean.
#[must_use]
pub fn markdown(groups: &[Group]) -> String {
    let differs = all(groups).any(|(_, s)| !s.with_rig.is_empty());
    let (head, line) = if differs { (" in a run against a rig |", " --- |") } else { ("", "") };
    let mut out = format!(
        "| columns | topic | unit | frame | point | meaning |{head}\n\
         | --- | --- | --- | --- | --- | --- |{line}\n"
    );
    let dash = |text: &str| if text.is_empty() { "–".to_owned() } else { text.to_owned() };
    for (group, s) in all(groups) {
        // Writing to a String cannot fail.
        let _ = write!(
            out,
            "| {} | `{}` | {} | {} | {} | {} |",
            names(group, s),
            s.topic,
            unit(s),
            dash(s.frame),
            dash(s.point),
            s.meaning,
        );
        if differs {
            let _ = write!(out, " {} |", dash(s.with_rig));
        }
        out.push('\n');
    }
    for (group, s) in all(groups).filter(|(_, s)| !s.values.is_empty() || !s.bits.is_empty()) {
        let _ = write!(out, "\n{}:\n\n", names(group, s));
        for (value, meaning) in s.values {
            let _ = writeln!(out, "- {value}: {meaning}");
        }
        for (mask, meaning) in s.bits {
            let _ = writeln!(out, "- bit {}: {meaning}", mask.trailing_zeros());
        }
    }
    out
}

fn all(groups: &[Group]) -> impl Iterator<Item = (&Group, &Signal)> {
    groups.iter().flat_map(|g| g.signals.iter().map(move |s| (g, s)))
}

/// Names of the columns, components and indices shortened: `` `latch_1_force_x_n` … `z` ``.
fn names(group: &Group, s: &Signal) -> String {
    let names: Vec<String> = s.names(1).collect();
    let first = names.first().map_or("", String::as_str);
    let mut out = format!("`{first}`");
    if let Some(last) = s.components.last() {
        let between = if s.components.len() > 3 { " …" } else { ", `y`," };
        let _ = write!(out, "{between} `{last}`");
    }
    if let Some(n) = group.count {
        let _ = write!(out, "; {} 1 to {n}", group.of);
    }
    out
}

fn unit(s: &Signal) -> &'static str {
    match s.kind {
        ColumnKind::Bool => "true or false",
        ColumnKind::U64 if !s.values.is_empty() => "enumeration",
        ColumnKind::U64 if !s.bits.is_empty() => "bits",
        ColumnKind::U64 => "whole number",
        ColumnKind::F64 => s.unit.written,
    }
}
