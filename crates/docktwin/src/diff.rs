//! `diff`: two recordings, bit by bit or within tolerances.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{Args, ValueEnum};
use docktwin_record::{
    Align, ColumnComparison, CompareOptions, Comparison, Cut, Difference, KEPT_KEY, RunReader,
    Summary, Tolerance, compare, first_difference, first_difference_except, unit_of,
};
use serde_json::{Value, json};

use crate::failure::{Failure, OTHERWISE};

pub(crate) const EXAMPLES: &str = "\
Without tolerances every bit is compared, and the first tick, body and component that differ are
named. With --tolerance or --tol each column of numbers is judged: the difference may be as large as
the larger of both; give --tol for what is zero but for rounding, such as the total momentum. Angles are compared on the circle, attitudes up to the sign of the quaternion.
Outcome and order of the latches must agree; counts and states are told, not judged. Recordings with
other tick lengths are interpolated to the ticks of A. A cut recording is compared up to the cut.
One that is damaged or edited, or lies beside the summary of another run, is never called the same.

Examples:
  docktwin diff runs/monday runs/tuesday
  docktwin diff runs/rehearsal runs/rig --tolerance 1e-3 --align first-contact
  docktwin diff runs/rehearsal runs/rig --tolerance 0.01 --tol m=1e-3 --tol n=5 --tol nm=2

Exit codes: 0 the same; 1 they differ; 2 bad input or usage.";

/// Options of `diff`.
#[derive(Debug, Args)]
pub(crate) struct DiffArgs {
    /// Run directory A, the reference
    run_a: PathBuf,
    /// Run directory B
    run_b: PathBuf,
    /// Difference allowed, relative to the peak in A (of a vector: of its length)
    #[arg(long, value_name = "SHARE", value_parser = tolerance)]
    tolerance: Option<f64>,
    /// Difference allowed for columns of a unit, repeatable: m, m_s, rad, rad_s, n, nm, j ...
    #[arg(long, value_name = "UNIT=VALUE", value_parser = unit_tolerance)]
    tol: Vec<(String, f64)>,
    /// Which instants belong together [default: start]
    #[arg(long, value_enum, value_name = "AT")]
    align: Option<AlignAt>,
}

/// Instants that belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum AlignAt {
    /// The starts of both recordings
    Start,
    /// The first ticks with a contact
    FirstContact,
}

fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x >= 0.0 => Ok(x),
        _ => Err("a tolerance is a number, 0 or larger, such as 1e-3".to_owned()),
    }
}

fn unit_tolerance(text: &str) -> Result<(String, f64), String> {
    let (unit, value) = text.split_once('=').ok_or("write it as unit=value, such as m=1e-3")?;
    // A name of that unit gives it back, if docktwin knows it.
    if unit.is_empty() || unit_of(&format!("x_{unit}")) != unit {
        return Err(format!(
            "`{unit}` is not a unit of a column; a column's name ends with it: m, m_s, rad, rad_s, \
             n, nm, j, kg_m_s, kg_m2_s, s"
        ));
    }
    Ok((unit.to_owned(), tolerance(value)?))
}

/// Runs the command.
pub(crate) fn run(args: &DiffArgs, json: bool) -> Result<ExitCode, Failure> {
    let mut a = RunReader::open(&args.run_a)?;
    let mut b = RunReader::open(&args.run_b)?;
    let same = if args.tolerance.is_none() && args.tol.is_empty() {
        if args.align.is_some() {
            return Err(Failure::Usage {
                what: "--align needs a tolerance: bit by bit, ticks are compared by their number"
                    .to_owned(),
                remedy: "add --tolerance 1e-3 or --tol m=1e-3".to_owned(),
            });
        }
        exact(args, &mut a, &mut b, json)?
    } else {
        tolerant(args, &mut a, &mut b, json)?
    };
    Ok(ExitCode::from(if same { 0 } else { OTHERWISE }))
}

/// Where recordings end before their runs, in words.
fn cuts(args: &DiffArgs, a: &RunReader, b: &RunReader) -> Vec<String> {
    let of = |r: &RunReader, path: &Path| {
        let why = r.cut().map(|c| format!("is cut: {c}"));
        let why = why.or_else(|| r.recovered().map(|w| format!("was recovered: {w}")));
        let all = why.into_iter().chain(r.changed_files());
        all.map(|w| format!("{} {w}", path.display())).collect::<Vec<_>>()
    };
    of(a, &args.run_a).into_iter().chain(of(b, &args.run_b)).collect()
}

/// What it means that the summaries are of different versions of the schema, if they are.
fn schemas(a: &RunReader, b: &RunReader) -> Result<Option<String>, Failure> {
    let [x, y] = [own_summary(a)?, own_summary(b)?];
    let versions = x.zip(y).map(|(x, y)| (x.schema_version, y.schema_version));
    Ok(versions.filter(|(x, y)| x != y).map(|(x, y)| {
        let before_2 = if x.min(y) < 2 {
            ": before version 2 peak_moment_nm was about another point, and with a rig \
             peak_penetration_m and impulse_ns went on after capture, forces below 5 N counted in the impulse, \
             and fidelity was laid over at the nearest tick, of the measured pose"
        } else {
            ""
        };
        format!("summaries of schema versions {x} and {y} do not mean the same by every key{before_2}")
    }))
}

/// Whether both are what was recorded, as far as they go: one that is damaged, edited, or beside the summary
/// or the models of another run is the same as nothing.
fn as_recorded(a: &RunReader, b: &RunReader) -> bool {
    let whole = |r: &RunReader| r.cut().is_none_or(Cut::merely_ends);
    [a, b].into_iter().all(|r| whole(r) && r.changed_files().is_empty())
}

/// The summary of a run, where it belongs to the log.
fn own_summary(r: &RunReader) -> Result<Option<Summary>, Failure> {
    if r.summary_problem().is_some() { Ok(None) } else { Ok(r.summary()?) }
}

/// Metadata that differ, except the date.
fn told_apart(a: &RunReader, b: &RunReader) -> Vec<String> {
    let keys: BTreeMap<&String, ()> =
        a.metadata().keys().chain(b.metadata().keys()).map(|k| (k, ())).collect();
    let of = |r: &RunReader, key: &str| r.metadata().get(key).cloned().unwrap_or("–".to_owned());
    keys.into_keys()
        .filter(|k| !["started_unix_ns", "recovered", "record_digest"].contains(&k.as_str()))
        // The same digests stand beside the names of the models.
        .filter(|k| !k.starts_with(KEPT_KEY))
        .filter(|k| a.metadata().get(*k) != b.metadata().get(*k))
        .map(|k| format!("{k}: {} against {}", of(a, k), of(b, k)))
        .collect()
}

/// Body, component and unit of a column.
fn words(r: &RunReader, column: &str) -> (String, String, &'static str) {
    let Some(i) = r.column_index(column) else {
        return match column.split_once('.') {
            Some((at, part)) => (at.to_owned(), part.to_owned(), ""),
            None => (column.to_owned(), String::new(), ""),
        };
    };
    let topic = r.columns()[i].topic.trim_start_matches('/');
    let unit = unit_of(column);
    let rest = column.strip_suffix(unit).unwrap_or(column).trim_end_matches('_');
    let rest = rest.strip_prefix(topic).map_or(rest, |r| r.trim_start_matches('_'));
    (topic.replace('/', " "), rest.replace('_', " "), unit)
}

fn exact(
    args: &DiffArgs,
    a: &mut RunReader,
    b: &mut RunReader,
    json: bool,
) -> Result<bool, Failure> {
    let found = first_difference(a, b)?;
    // A recording that is cut has no more to say; as far as it goes it is the same.
    let ended_by_cut = |d: &Difference| {
        d.column == "end"
            && (d.a == "has ended" && a.cut().is_some() || d.b == "has ended" && b.cut().is_some())
    };
    let found = found.filter(|d| !ended_by_cut(d));
    // A digest sees what no column shows; where it alone differs, the first column is told too.
    let is_digest = |name: &str| name.contains("digest");
    let visible = match &found {
        Some(d) if is_digest(&d.column) => first_difference_except(a, b, |c| is_digest(&c.name))?,
        _ => None,
    };
    let (cuts, apart) = (cuts(args, a, b), told_apart(a, b));
    let schemas = schemas(a, b)?;
    let same = found.is_none() && as_recorded(a, b);
    let ticks = [&*a, b].map(|r| r.last_tick().map_or(0, |(t, _)| t.0 + 1));
    let compared = ticks[0].min(ticks[1]);
    if compared == 0 && found.is_none() {
        let empty = if ticks[0] == 0 { &args.run_a } else { &args.run_b };
        return Err(Failure::Usage {
            what: format!(
                "no tick of this run can be read, so nothing can be compared: {}",
                empty.display()
            ),
            remedy: "give a run that was recorded for at least one tick".to_owned(),
        });
    }
    if json {
        let told = |d: &Difference| {
            let (body, component, unit) = words(a, &d.column);
            json!({
                "tick": d.tick.0, "time_s": d.time.seconds(), "column": d.column, "body": body,
                "component": component, "unit": unit, "a": d.a, "b": d.b,
                "other_columns_in_this_tick": d.others,
            })
        };
        let (first, visible) = (found.as_ref().map(told), visible.as_ref().map(told));
        println!(
            "{}",
            json!({
                "mode": "exact", "same": same, "first_difference": first,
                "first_visible": visible,
                "metadata": apart, "cut": cuts, "schemas": schemas,
            })
        );
        return Ok(same);
    }
    cuts.iter().for_each(|c| eprintln!("{c}"));
    apart.iter().for_each(|m| eprintln!("metadata differ: {m}"));
    schemas.iter().for_each(|s| eprintln!("{s}"));
    match &found {
        None if !same => println!(
            "every bit is the same up to tick {}, but not both are what was recorded",
            compared.saturating_sub(1)
        ),
        None if cuts.is_empty() => {
            println!("the same: every bit up to tick {}", compared.saturating_sub(1))
        }
        None => {
            println!("the same up to the cut: every bit up to tick {}", compared.saturating_sub(1))
        }
        Some(d) => {
            println!("{}", sentence(a, d));
            match &visible {
                Some(v) => println!("first in a column: {}", sentence(a, v)),
                None if is_digest(&d.column) => {
                    println!("no column differs: a state that is not recorded does");
                }
                None => {}
            }
        }
    }
    Ok(same)
}

/// `tick 1234 (1.234 s): chaser, position x [m]: … against …`
fn sentence(r: &RunReader, d: &Difference) -> String {
    let (body, component, unit) = words(r, &d.column);
    let what: Vec<String> = [body, component].into_iter().filter(|w| !w.is_empty()).collect();
    let unit = if unit.is_empty() { String::new() } else { format!(" [{unit}]") };
    let more = match d.others {
        0 => String::new(),
        n => format!(" (and {n} more columns in this tick)"),
    };
    let at = format!("tick {} ({:.3} s)", d.tick.0, d.time.seconds());
    format!("{at}: {}{unit}: {} against {}{more}", what.join(", "), d.a, d.b)
}

fn tolerant(
    args: &DiffArgs,
    a: &mut RunReader,
    b: &mut RunReader,
    json: bool,
) -> Result<bool, Failure> {
    let options = CompareOptions {
        tolerance: Tolerance {
            relative: args.tolerance,
            by_unit: args.tol.iter().cloned().collect(),
        },
        align: match args.align {
            Some(AlignAt::FirstContact) => Align::FirstContact,
            Some(AlignAt::Start) | None => Align::Start,
        },
    };
    let found = compare(a, b, &options)?;
    let summaries = [own_summary(a)?, own_summary(b)?];
    let stories = stories(&summaries);
    let agree = |key: &str| {
        stories.iter().all(|(k, x, y)| *k != key || x == y || x == UNKNOWN || y == UNKNOWN)
    };
    let same = found.beyond().next().is_none()
        && agree("outcome")
        && agree("latch order")
        && as_recorded(a, b);
    let (cuts, apart) = (cuts(args, a, b), told_apart(a, b));
    let schemas = schemas(a, b)?;
    if json {
        let side_by_side: BTreeMap<&str, Value> =
            stories.iter().map(|(k, x, y)| (*k, json!({ "a": x, "b": y }))).collect();
        let mut out = serde_json::to_value(&found).unwrap_or_default();
        out["mode"] = json!("tolerance");
        out["same"] = json!(same);
        out["align"] = json!(options.align);
        out["beyond"] = json!(found.beyond().count());
        out["side_by_side"] = json!(side_by_side);
        out["metadata"] = json!(apart);
        out["cut"] = json!(cuts);
        out["schemas"] = json!(schemas);
        println!("{out}");
        return Ok(same);
    }
    cuts.iter().for_each(|c| eprintln!("{c}"));
    apart.iter().for_each(|m| eprintln!("metadata differ: {m}"));
    schemas.iter().for_each(|s| eprintln!("{s}"));
    print(args, &found, &stories, options.align);
    println!("{}", if same { "the same within tolerance" } else { "they differ" });
    Ok(same)
}

const UNKNOWN: &str = "–";

/// The results of both runs side by side.
fn stories(s: &[Option<Summary>; 2]) -> Vec<(&'static str, String, String)> {
    let of = |f: &dyn Fn(&Summary) -> Option<String>| {
        let [a, b] = [0, 1].map(|i| s[i].as_ref().and_then(f).unwrap_or(UNKNOWN.to_owned()));
        (a, b)
    };
    let seconds = |t: Option<f64>| t.map(|t| format!("{t:.4} s"));
    type Row<'a> = (&'static str, &'a dyn Fn(&Summary) -> Option<String>);
    let rows: [Row<'_>; 9] = [
        ("outcome", &|s| Some(s.outcome.to_string())),
        ("latch order", &|s| Some(latch_order(&s.latches_s))),
        ("first contact", &|s| seconds(s.first_contact_s)),
        ("capture", &|s| seconds(s.capture_s)),
        ("peak force", &|s| Some(format!("{:.2} N", s.peak_force_n))),
        ("peak moment", &|s| Some(format!("{:.2} N·m", s.peak_moment_nm))),
        ("peak depth", &|s| Some(format!("{:.4} mm", s.peak_penetration_m * 1e3))),
        ("impulse", &|s| Some(format!("{:.3} N·s", s.impulse_ns))),
        ("dissipated", &|s| Some(format!("{:.4} J", s.energy_dissipated_j))),
    ];
    rows.into_iter()
        .map(|(name, f)| {
            let (a, b) = of(f);
            (name, a, b)
        })
        .collect()
}

/// `2 3 1`: the latches in the order in which they caught.
fn latch_order(latches_s: &[Option<f64>]) -> String {
    let mut caught: Vec<(f64, usize)> =
        latches_s.iter().enumerate().filter_map(|(i, t)| t.map(|t| (t, i + 1))).collect();
    caught.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
    if caught.is_empty() {
        return "none caught".to_owned();
    }
    caught.iter().map(|(_, i)| i.to_string()).collect::<Vec<_>>().join(" ")
}

/// Columns shown that are within tolerance, beside all that are beyond.
const SHOWN: usize = 8;

fn print(
    args: &DiffArgs,
    found: &Comparison,
    stories: &[(&'static str, String, String)],
    align: Align,
) {
    println!("A {}\nB {}\n", args.run_a.display(), args.run_b.display());
    println!("{:<14} {:>16} {:>16}", "", "A", "B");
    for (name, x, y) in stories {
        println!("{name:<14} {x:>16} {y:>16}");
    }
    let from = match align {
        Align::Start => "the start",
        Align::FirstContact => "first contact",
    };
    let [za, zb] = found.zero_s;
    println!(
        "\n{} ticks of A ({} in A, {} in B) from {from} (A {za:.4} s, B {zb:.4} s){}",
        found.ticks,
        found.ticks_of[0],
        found.ticks_of[1],
        if found.interpolated { ", B interpolated" } else { "" }
    );
    let beyond = found.beyond().count();
    let judged = found.columns.iter().filter(|c| c.allowed.is_some()).count();
    println!(
        "{beyond} of {judged} columns beyond tolerance, {} compared and not judged\n",
        found.columns.len() - judged
    );
    println!(
        "{:<28} {:>10} {:>10} {:>9} {:>9} {:>10} {:>9}  first beyond",
        "column", "worst", "at s", "of peak", "rms", "allowed", "× allowed"
    );
    for c in found.columns.iter().take(beyond + SHOWN) {
        println!("{}", line(c));
    }
    let hidden = found.columns.len().saturating_sub(beyond + SHOWN);
    if hidden > 0 {
        println!("… {hidden} more columns, closer; --json has all");
    }
    let states: Vec<String> = found
        .states
        .iter()
        .filter_map(|s| {
            let (tick, t) = s.first?;
            let n = s.ticks_differing;
            Some(format!("  {}: {n} ticks, first tick {tick} ({t:.3} s)", s.column))
        })
        .collect();
    if !states.is_empty() {
        println!("\ncounts and states that differ (not judged)\n{}", states.join("\n"));
    }
    for (side, names) in ["A", "B"].into_iter().zip(&found.only) {
        if !names.is_empty() {
            println!("\nonly {side} has: {}", names.join(", "));
        }
    }
    println!();
}

fn line(c: &ColumnComparison) -> String {
    let share = |x: Option<f64>| x.map_or(UNKNOWN.to_owned(), |x| format!("{x:.1e}"));
    let first = c.first_beyond.map_or(UNKNOWN.to_owned(), |(n, t)| format!("tick {n} ({t:.3} s)"));
    format!(
        "{:<28} {:>10.3e} {:>10.3} {:>9} {:>9} {:>10} {:>9}  {first}",
        c.column,
        c.worst,
        c.worst_time_s,
        share(c.worst_of_peak),
        share(c.rms_of_peak),
        share(c.allowed),
        c.times_allowed.map_or(UNKNOWN.to_owned(), |x| format!("{x:.2}")),
    )
}
