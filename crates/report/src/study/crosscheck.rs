//! A docking in a second engine against docktwin's own: rows, words and plots.

mod plots;

use core::fmt::Display;

use docktwin_study::crosscheck::{Compared, ComparisonSummary, CrossCheck};
use serde::Serialize;

pub use self::plots::plots;

/// What `comparison.json` holds, and what `--json` prints.
#[derive(Debug, Serialize)]
pub struct Answer<'a> {
    #[serde(flatten)]
    summary: &'a ComparisonSummary,
    /// The comparison in words.
    rows: Vec<Row>,
}

/// A line of the comparison.
#[derive(Debug, Serialize)]
struct Row {
    what: String,
    docktwin: String,
    mujoco: String,
    difference: String,
    /// In words; null where nothing is required.
    required: Option<&'static str>,
    /// Null where nothing is required.
    pass: Option<bool>,
}

impl Row {
    /// Nothing is required.
    fn new(what: &str, [docktwin, mujoco]: [String; 2], difference: String) -> Self {
        Self { what: what.to_owned(), docktwin, mujoco, difference, required: None, pass: None }
    }

    fn required(self, required: &'static str, pass: bool) -> Self {
        Self { required: Some(required), pass: Some(pass), ..self }
    }

    fn time(what: &str, c: &Compared<Option<f64>>) -> Self {
        let seconds = |t: Option<f64>| t.map_or("–".to_owned(), |t| format!("{t:.4} s"));
        let later = c.docktwin.zip(c.mujoco);
        let later = later.map_or("–".to_owned(), |(x, y)| format!("{:+.2} ms", (y - x) * 1e3));
        Self::new(what, [seconds(c.docktwin), seconds(c.mujoco)], later)
    }

    fn same<T: PartialEq>(what: &str, c: &Compared<T>, word: impl Fn(&T) -> String) -> Self {
        let difference = if c.docktwin == c.mujoco { "same" } else { "different" };
        Self::new(what, [word(&c.docktwin), word(&c.mujoco)], difference.to_owned())
    }

    fn line(&self) -> String {
        let verdict = match self.pass {
            Some(true) => "  pass",
            Some(false) => "  FAIL",
            None => "",
        };
        columns([
            &self.what,
            &self.docktwin,
            &self.mujoco,
            &self.difference,
            &format!("{:>10}{verdict}", self.required.unwrap_or("")),
        ])
    }
}

fn columns([what, docktwin, mujoco, difference, rest]: [&dyn Display; 5]) -> String {
    let line = format!("{what:<18} {docktwin:>14} {mujoco:>14} {difference:>12} {rest:>10}");
    line.trim_end().to_owned()
}

fn rows(c: &CrossCheck) -> Vec<Row> {
    let (s, passes) = (&c.summary, &c.passes);
    let order = |o: &Vec<usize>| {
        let words: Vec<String> = o.iter().map(ToString::to_string).collect();
        if words.is_empty() { "none caught".to_owned() } else { words.join(" ") }
    };
    let mut rows = vec![
        Row::same("outcome", &c.outcome, ToString::to_string).required("same", passes.outcome),
        Row::time("first contact", &c.first_contact_s),
        Row::same("latch order", &c.latch_order, order).required("same", passes.latch_order),
    ];
    for (i, latch) in c.latches_s.iter().enumerate() {
        if latch.docktwin.or(latch.mujoco).is_some() {
            rows.push(Row::time(&format!("latch {}", i + 1), latch));
        }
    }
    rows.push(Row::time("capture", &c.capture_s));
    let both = |c: &Compared<f64>, word: fn(f64) -> String| [word(c.docktwin), word(c.mujoco)];
    let percent = |x: f64| format!("{:.3} %", x * 100.0);
    let newtons = both(&c.peak_force_n, |x| format!("{x:.1} N"));
    rows.push(
        Row::new("peak force", newtons, percent(s.peak_force_difference))
            .required("5 %", passes.peak_force),
    );
    let impulses = both(&c.impulse_ns, |x| format!("{x:.2} N·s"));
    rows.push(Row::new("impulse", impulses, percent(s.impulse_difference)));
    let none = || [String::new(), String::new()];
    let position = format!("{:.4} mm", s.position_m * 1e3);
    rows.push(
        Row::new("relative position", none(), position).required("1 mm", passes.relative_position),
    );
    let attitude = format!("{:.5}°", s.angle_rad.to_degrees());
    rows.push(
        Row::new("relative attitude", none(), attitude).required("0.1°", passes.relative_attitude),
    );
    rows
}

impl<'a> Answer<'a> {
    /// The comparison in rows.
    #[must_use]
    pub fn new(c: &'a CrossCheck) -> Self {
        Self { summary: &c.summary, rows: rows(c) }
    }

    /// The comparison in words.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let s = self.summary;
        let mut out = vec![
            format!(
                "{}: docktwin (reduced twin) and {} (RK4, {} ms), law held equal",
                s.scenario,
                s.engine,
                s.engine_step_s * 1e3
            ),
            columns([&"", &"docktwin", &"MuJoCo", &"difference", &"required"]),
        ];
        out.extend(self.rows.iter().map(Row::line));
        let from = if s.aligned { "first contact" } else { "the start: not both touch" };
        out.push(format!(
            "Relative pose is the worst of {} ticks until the {}, aligned at {from}; without alignment \
             {:.4} mm; to the end {:.3} mm and {:.4}°.",
            s.ticks_judged,
            s.until.name(),
            s.position_from_start_m * 1e3,
            s.position_whole_m * 1e3,
            s.angle_whole_rad.to_degrees(),
        ));
        out.push(if s.within { "within the requirements" } else { "NOT within" }.to_owned());
        out
    }
}
