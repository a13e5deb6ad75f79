//! Dockings on the emulated rig against the simulated system: tables and words.

use core::fmt::Write as _;

use docktwin_plot::{Axis, Bar, Colour, Embed, Lane, Plot, PlotError};
use docktwin_study::fidelity::{Budget, Cause, Figure, OnRig, Window};

mod draws;
mod offloads;

pub use draws::{draw_tables, draw_words, draws_json};
pub use offloads::{offload_plots, offload_tables, offload_words};

use super::NamedText;

/// Part of the force's error that a cause must make to be worth mending.
const LEAST_SHARE: f64 = 0.05;

/// A cause in words.
#[must_use]
pub const fn cause(cause: Cause) -> &'static str {
    match cause {
        Cause::Weight => "weight of the ring and its balance",
        Cause::SensorScheme => "single-sensor scheme",
        Cause::Noise => "noise of the sensors",
        Cause::DeadZone => "dead zone of the sensors",
        Cause::SensorLag => "lag of the sensors",
        Cause::Delay => "dead time of the legs",
        Cause::LegFriction => "friction of the legs",
        Cause::Valve => "lag of the valves",
        Cause::Legs => "legs: oil, valves, seals",
        Cause::Rack => "rack that does not give way",
        Cause::Mounts => "mounts of a drawn mechanism",
    }
}

/// Figures of the tables: name, and where it stands.
const FIGURES: [(&str, Figure); 6] = [
    ("felt peak", |r, w| r.felt(w).peak_force_ratio),
    ("felt force", |r, w| r.felt(w).nrms_force),
    ("felt pose", |r, w| r.felt(w).nrms_pose),
    ("hardware peak", |r, w| r.hardware(w).peak_force_ratio),
    ("hardware force", |r, w| r.hardware(w).nrms_force),
    ("hardware pose", |r, w| r.hardware(w).nrms_pose),
];

fn number(x: Option<f64>, signed: bool) -> String {
    match x {
        None => "–".to_owned(),
        Some(x) if signed => format!("{x:+.4}"),
        Some(x) => format!("{x:.4}"),
    }
}

/// A window in words.
#[must_use]
pub const fn window(window: Window) -> &'static str {
    match window {
        Window::ToCapture => "to capture + 1 s",
        Window::WholeRun => "whole run",
    }
}

/// One row for every scenario: both comparisons, to capture + 1 s or of the whole run.
#[must_use]
pub fn words(all: &[(String, OnRig)]) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = writeln!(out, "{:<24}{:<18}{}", "scenario", "window", heads());
    for (name, on) in all {
        let over = on.window();
        let figures = row(|f| number(f(on, over), false));
        let _ = writeln!(out, "{name:<24}{:<18}{figures}", window(over));
        if let Some(why) = &on.stopped {
            let _ = writeln!(out, "{:<24}stopped, so these are figures of a part: {why}", "");
        }
    }
    out
}

fn heads() -> String {
    FIGURES.iter().fold(String::new(), |a, (name, _)| format!("{a}{name:>16}"))
}

fn row(cell: impl Fn(Figure) -> String) -> String {
    FIGURES.iter().fold(String::new(), |a, (_, f)| format!("{a}{:>16}", cell(*f)))
}

/// A budget: the docking as it is, without every cause, and what each adds, by being taken away and by being
/// alone.
#[must_use]
pub fn budget_words(b: &Budget) -> String {
    let mut out = String::new();
    let over = b.as_is.window();
    let _ = writeln!(out, "{}\n{:<44}{}", b.scenario, window(over), heads());
    for (name, on) in [("as it is", &b.as_is), ("all causes removed", &b.without_all)] {
        let _ = writeln!(out, "{name:<44}{}", row(|f| number(f(on, over), false)));
    }
    for share in &b.shares {
        let name = cause(share.cause);
        for (by, i) in [("removed", 0), ("alone", 1)] {
            let label = format!("{name}, {by}");
            let _ = writeln!(out, "{label:<44}{}", row(|f| number(b.parts(share, f)[i], true)));
        }
        let label = format!("{name}, interaction");
        let _ = writeln!(out, "{label:<44}{}", row(|f| number(b.interaction(share, f), true)));
    }
    for why in b.stopped() {
        let _ = writeln!(out, "a run was stopped and is left out: {why}");
    }
    let _ = writeln!(out, "{}", mend_first(b));
    out
}

/// What to mend first, in one sentence.
#[must_use]
pub fn mend_first(b: &Budget) -> String {
    let whole = b.as_is.hardware(b.as_is.window()).nrms_force;
    match (b.mend_first(), whole) {
        (Some((first, left)), Some(whole)) if left < (1.0 - LEAST_SHARE) * whole => format!(
            "{}: mend the {} first; without it the error of the force on the hardware is {:.1} % instead of \
             {:.1} %.",
            b.scenario,
            cause(first),
            100.0 * left,
            100.0 * whole
        ),
        _ => format!(
            "{}: no single cause takes {:.0} % off the error of the force on the hardware.",
            b.scenario,
            100.0 * LEAST_SHARE
        ),
    }
}

/// `fidelity-budget.csv`: one row a scenario, cause and way of finding its part.
#[must_use]
pub fn tables(all: &[Budget]) -> Vec<NamedText> {
    let mut out = "scenario,window,cause,by".to_owned();
    for (name, _) in FIGURES {
        let _ = write!(out, ",{}", name.replace(' ', "_"));
    }
    out.push('\n');
    let cell = |x: Option<f64>| x.map_or(String::new(), |x| format!(",{x}"));
    for b in all {
        for share in &b.shares {
            for (by, i) in [("removed", 0), ("alone", 1), ("interaction", 2)] {
                let over = window(b.as_is.window());
                let _ = write!(out, "{},{over},{},{by}", b.scenario, cause(share.cause));
                for (_, f) in FIGURES {
                    let part = cell(match i {
                        2 => b.interaction(share, f),
                        _ => b.parts(share, f)[i],
                    });
                    out.push_str(if part.is_empty() { "," } else { &part });
                }
                out.push('\n');
            }
        }
    }
    vec![("fidelity-budget.csv".to_owned(), out)]
}

/// `fidelity-budget-SCENARIO.svg` of every scenario: what each cause adds to the error of the force, felt and on the
/// hardware.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn plots(all: &[Budget]) -> Result<Vec<NamedText>, PlotError> {
    all.iter().map(|b| Ok((format!("fidelity-budget-{}.svg", b.scenario), plot(b)?))).collect()
}

fn plot(b: &Budget) -> Result<String, PlotError> {
    let force: [(&str, Figure); 2] =
        [("felt", |r, w| r.felt(w).nrms_force), ("hardware", |r, w| r.hardware(w).nrms_force)];
    let bar = |x: f64, colour, height| Bar {
        range: x.min(0.0)..x.max(0.0),
        colour,
        height,
        label: String::new(),
    };
    let over = b.as_is.window();
    let mut plot = Plot::new(format!("{}: error of the force, {}", b.scenario, window(over)))
        .x_axis(Axis::new("NRMS of the force", "%").include(0.0).at_least(1.0))
        .size(900.0, 30.0 * 2.0 * (b.shares.len() + 2) as f64)
        .legend("whole", Colour::Ink)
        .legend("taken away", Colour::Blue)
        .legend("alone", Colour::Amber);
    for (name, on) in [("as it is", &b.as_is), ("all causes removed", &b.without_all)] {
        for (of, figure) in force {
            let bars = figure(on, over).map(|x| bar(100.0 * x, Colour::Ink, 0.8));
            plot =
                plot.lane(Lane { name: format!("{name}, {of}"), bars: bars.into_iter().collect() });
        }
    }
    for share in &b.shares {
        for (of, figure) in force {
            let [removed, alone] = b.parts(share, figure);
            let bars = [(alone, Colour::Amber, 0.8), (removed, Colour::Blue, 0.4)];
            let bars = bars.into_iter().filter_map(|(x, c, h)| Some(bar(100.0 * x?, c, h)));
            plot = plot
                .lane(Lane { name: format!("{}, {of}", cause(share.cause)), bars: bars.collect() });
        }
    }
    plot.svg(Embed::Alone)
}
