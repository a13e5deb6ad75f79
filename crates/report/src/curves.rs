//! Plots of a run: every quantity around the contact and over the whole run.

use core::ops::Range;

use docktwin_plot::{Axis, Bar, Colour, Dash, Embed, Lane, Line, Marker, Plot, PlotError, Span};

use crate::load::Run;
use crate::story::KINDS;

const WIDE: f64 = 860.0;
const NARROW: f64 = 400.0;
const HEIGHT: f64 = 170.0;
/// Left of every plot, so that the time axes of a column are in line.
const LEFT: f64 = 66.0;
const LEFT_LANES: f64 = 118.0;

/// One quantity, three times: around the contact (wide and narrow), and over the whole run.
pub(crate) struct Drawn {
    pub(crate) wide: String,
    pub(crate) narrow: String,
    /// `None` where the first two show the whole run already.
    pub(crate) whole: Option<String>,
}

struct Curve {
    name: String,
    points: Vec<[f64; 2]>,
    colour: Colour,
    dash: Dash,
}

struct Quantity {
    title: String,
    axis: Axis,
    curves: Vec<Curve>,
}

/// Largest value below which a quantity counts as zero throughout, in the unit of its axis.
const NOTHING: f64 = 1e-9;

/// What is worth a close look: from shortly before the first contact to shortly after capture, or
/// after the last contact.
pub(crate) fn interesting(run: &Run) -> Range<f64> {
    let end = run.end_s().max(1e-3);
    let Some(first) = run.first_contact_s() else { return 0.0..end };
    let last = match run.capture_s() {
        Some(capture) => {
            let port = run.loads.map_or(capture, |l| l.force_n.time_s);
            let after = if port > capture && port < capture + 3.0 { port } else { capture };
            after + (0.6 * (capture - first)).max(0.3)
        }
        None => {
            let last = run.contacts.iter().map(|c| c.end_s).fold(first, f64::max);
            last + (0.1 * (last - first)).max(0.1)
        }
    };
    let before = (0.12 * (last - first)).max(0.03);
    let (a, b) = ((first - before).max(0.0), last.min(end));
    if b - a > 0.8 * end || b <= a { 0.0..end } else { a..b }
}

fn colours(i: usize) -> (Colour, Dash) {
    [(Colour::Blue, Dash::Solid), (Colour::Vermilion, Dash::Dashed), (Colour::Green, Dash::DashDot)]
        .get(i)
        .copied()
        .unwrap_or((Colour::of_series(i), Dash::Solid))
}

/// Vector quantities: title, axis name, unit, least span, column stem, column unit, factor, what the
/// components are called.
type Vectors = (
    &'static str,
    &'static str,
    &'static str,
    f64,
    &'static str,
    &'static str,
    f64,
    &'static [(&'static str, &'static str)],
);

const DEGREES: f64 = 180.0 / core::f64::consts::PI;
const XYZ: &[(&str, &str)] = &[("x", "X"), ("y", "Y"), ("z", "Z")];
const YZ: &[(&str, &str)] = &[("y", "Y"), ("z", "Z")];
const TURN: &[(&str, &str)] = &[("x", "roll"), ("y", "pitch"), ("z", "yaw")];

const VECTORS: [Vectors; 10] = [
    (
        "Distance of the ports along the axis",
        "X",
        "m",
        1e-3,
        "relative_position",
        "m",
        1.0,
        &[("x", "")],
    ),
    ("Lateral offset of the ports", "offset", "mm", 1.0, "relative_position", "m", 1e3, YZ),
    (
        "Attitude of the target against the chaser",
        "angle",
        "°",
        0.05,
        "relative_attitude",
        "rad",
        DEGREES,
        TURN,
    ),
    (
        "Relative velocity at the passive ring",
        "velocity",
        "m/s",
        1e-3,
        "relative_velocity",
        "m_s",
        1.0,
        XYZ,
    ),
    ("Relative rates", "rate", "°/s", 0.01, "relative_rate", "rad_s", DEGREES, TURN),
    ("Deflection of the active ring", "deflection", "mm", 0.5, "ring_deflection", "m", 1e3, XYZ),
    ("Tilt of the active ring", "angle", "°", 0.05, "ring_rotation", "rad", DEGREES, TURN),
    ("Force at the chaser's port (F3)", "force", "N", 1.0, "port3_force", "n", 1.0, XYZ),
    ("Moment at the chaser's port (M3)", "moment", "N·m", 1.0, "port3_moment", "nm", 1.0, TURN),
    ("Control force on the chaser", "force", "N", 1.0, "chaser_control_force", "n", 1.0, XYZ),
];

fn quantities(run: &Run) -> Vec<Quantity> {
    let mut out = Vec::new();
    for (title, name, unit, least, stem, column_unit, factor, parts) in VECTORS {
        let curves = parts
            .iter()
            .enumerate()
            .filter_map(|(i, (a, label))| {
                let points = run.curve(&format!("{stem}_{a}_{column_unit}"), factor)?;
                let (colour, dash) = if *a == "y" && parts.len() == 2 {
                    colours(1)
                } else {
                    colours(i + usize::from(parts.len() == 2))
                };
                Some(Curve { name: (*label).to_owned(), points, colour, dash })
            })
            .collect();
        out.push(Quantity {
            title: title.to_owned(),
            axis: Axis::new(name, unit).at_least(least),
            curves,
        });
    }
    let by_kind = KINDS.iter().zip(&run.by_kind_n).enumerate().filter_map(|(i, (name, values))| {
        let colour = [Colour::Ink, Colour::Purple, Colour::Green, Colour::Grey][i];
        let dash = [Dash::Solid, Dash::Solid, Dash::Dashed, Dash::Dotted][i];
        let any = values.iter().any(|v| *v > 0.0);
        any.then(|| Curve {
            name: (*name).to_owned(),
            points: run.over_time(values, 1.0),
            colour,
            dash,
        })
    });
    out.insert(
        0,
        Quantity {
            title: "Normal force of the contacts".to_owned(),
            axis: Axis::new("force", "N").include(0.0).at_least(1.0),
            curves: by_kind.collect(),
        },
    );
    if run.has_latches() {
        let gaps = (1..=run.latch_count()).filter_map(|i| {
            let points = run.curve(&format!("latch_{i}_gap_m"), 1e3)?;
            let (colour, dash) = colours(i - 1);
            Some(Curve { name: format!("latch {i}"), points, colour, dash })
        });
        out.push(Quantity {
            title: "Axial gap at the latches".to_owned(),
            axis: Axis::new("gap", "mm").at_least(1.0),
            curves: gaps.collect(),
        });
    }
    out.extend(petal_gaps(run));
    let energy = [
        ("kinetic", "kinetic", Colour::Ink, Dash::Solid),
        ("stored", "stored", Colour::Sky, Dash::Solid),
        ("lost_attenuator", "lost in the attenuator", Colour::Vermilion, Dash::Solid),
        ("lost_contact", "lost in contacts", Colour::Purple, Dash::Dashed),
        ("lost_friction", "lost by friction", Colour::Green, Dash::DashDot),
        ("lost_joint", "lost in the joint", Colour::Amber, Dash::Dotted),
        ("lost_capture", "lost at capture", Colour::Grey, Dash::Dashed),
        ("work_in", "work of thrusters", Colour::Blue, Dash::Dotted),
    ];
    let energy = energy.into_iter().filter_map(|(key, name, colour, dash)| {
        let points = run.curve(&format!("energy_{key}_j"), 1.0)?;
        let any = points.iter().any(|p| p[1].abs() > NOTHING);
        any.then(|| Curve { name: name.to_owned(), points, colour, dash })
    });
    out.push(Quantity {
        title: "Energy".to_owned(),
        axis: Axis::new("energy", "J").include(0.0).at_least(0.01),
        curves: energy.collect(),
    });
    out
}

/// Gaps of petals, where a recording has them.
fn petal_gaps(run: &Run) -> Option<Quantity> {
    let names: Vec<String> = run
        .column_names()
        .filter(|n| n.contains("petal") && n.contains("gap") && n.ends_with("_m"))
        .map(str::to_owned)
        .collect();
    let curves: Vec<Curve> = names
        .iter()
        .enumerate()
        .filter_map(|(i, n)| {
            let (colour, dash) =
                (Colour::of_series(i), if i < 6 { Dash::Solid } else { Dash::Dashed });
            let name = n.trim_end_matches("_m").replace('_', " ");
            Some(Curve { name, points: run.curve(n, 1e3)?, colour, dash })
        })
        .collect();
    (!curves.is_empty()).then(|| Quantity {
        title: "Gap at the petals".to_owned(),
        axis: Axis::new("gap", "mm").at_least(1.0),
        curves,
    })
}

/// Events that every plot marks.
fn markers(run: &Run) -> Vec<(f64, String, Colour)> {
    let mut out = Vec::new();
    if let Some(t) = run.first_contact_s() {
        out.push((t, "first contact".to_owned(), Colour::Grey));
    }
    for (i, t) in run.latched_s().into_iter().enumerate() {
        out.extend(t.map(|t| (t, format!("latch {}", i + 1), Colour::Grey)));
    }
    if let Some(t) = run.capture_s() {
        out.push((t, "captured".to_owned(), Colour::Green));
    }
    for e in run.events.iter().filter(|e| e.kind == "limit") {
        out.push((e.time_s, "limit".to_owned(), Colour::Vermilion));
    }
    out
}

fn framed<'a>(mut plot: Plot<'a>, run: &Run, range: &Range<f64>, labels: bool) -> Plot<'a> {
    for (t, label, colour) in markers(run) {
        let label = if labels { label } else { String::new() };
        plot = plot.marker(Marker::new(t, label).colour(colour));
    }
    plot.x_axis(Axis::new("time", "s").range(range.clone()))
}

fn three<'a>(
    run: &Run,
    left: f64,
    height: f64,
    plot: impl Fn() -> Plot<'a>,
) -> Result<Drawn, PlotError> {
    let (near, all) = (interesting(run), 0.0..run.end_s().max(1e-3));
    let draw = |range: &Range<f64>, width: f64, labels: bool| {
        framed(plot(), run, range, labels).size(width, height).margin_left(left).svg(Embed::Page)
    };
    let zoomed = near != all;
    let whole = || {
        let plot = plot().span(Span::new(near.clone()).colour(Colour::Amber));
        framed(plot, run, &all, false).size(NARROW, height).margin_left(left).svg(Embed::Page)
    };
    Ok(Drawn {
        wide: draw(&near, WIDE, true)?,
        narrow: draw(&near, NARROW, true)?,
        whole: zoomed.then(whole).transpose()?,
    })
}

/// All plots, and the titles of quantities that are zero throughout.
pub(crate) fn draw(run: &Run) -> Result<(Vec<Drawn>, Vec<String>), PlotError> {
    let (mut out, mut zero) = (Vec::new(), Vec::new());
    if run.time_s.len() < 2 {
        return Ok((out, zero));
    }
    out.extend(lanes(run)?);
    for q in quantities(run) {
        let flat = q.curves.iter().all(|c| c.points.iter().all(|p| p[1].abs() <= NOTHING));
        if flat {
            zero.push(q.title);
            continue;
        }
        out.push(three(run, LEFT, HEIGHT, || {
            let mut plot = Plot::new(q.title.clone()).y_axis(q.axis.clone());
            for c in &q.curves {
                plot =
                    plot.line(Line::new(c.name.clone(), &c.points).colour(c.colour).dash(c.dash));
            }
            plot
        })?);
    }
    Ok((out, zero))
}

const PHASES: [(&str, Colour); 4] = [
    ("free", Colour::Grey),
    ("near its striker", Colour::Amber),
    ("struck", Colour::Vermilion),
    ("caught", Colour::Green),
];

/// Contacts by pair, and states of the latches, as bars over time.
fn lanes(run: &Run) -> Result<Vec<Drawn>, PlotError> {
    let mut out = Vec::new();
    let largest = run.strongest().map_or(1.0, |c| c.peak.force_n).max(1e-9);
    let mut pairs: Vec<usize> = run.contacts.iter().map(|c| c.pair).collect();
    pairs.sort_unstable();
    pairs.dedup();
    if !pairs.is_empty() {
        let lanes: Vec<Lane> = pairs
            .iter()
            .filter_map(|i| {
                let pair = run.pairs.get(*i)?;
                let colour =
                    [Colour::Ink, Colour::Purple, Colour::Green, Colour::Grey][pair.kind()];
                let bars = run.contacts.iter().filter(|c| c.pair == *i).map(|c| Bar {
                    range: c.begin_s..c.end_s,
                    colour,
                    // Height by force, but never invisible.
                    height: (c.peak.force_n / largest).sqrt().max(0.18),
                    label: String::new(),
                });
                Some(Lane { name: pair.to_string(), bars: bars.collect() })
            })
            .collect();
        #[expect(clippy::cast_precision_loss, reason = "few lanes")]
        let height = 20.0 * lanes.len() as f64;
        out.push(three(run, LEFT_LANES, height, || {
            lanes
                .iter()
                .fold(Plot::new("Who touches whom"), |p, l| p.lane(l.clone()))
                .legend("petal on ring", Colour::Purple)
                .legend("petal on petal", Colour::Green)
                .legend("ring on ring", Colour::Ink)
        })?);
    }
    if run.has_latches() {
        let lanes: Vec<Lane> = (1..=run.latch_count()).filter_map(|i| latch_lane(run, i)).collect();
        if !lanes.is_empty() {
            out.push(three(run, LEFT_LANES, 66.0, || {
                let plot = lanes.iter().fold(Plot::new("Latches"), |p, l| p.lane(l.clone()));
                PHASES.iter().fold(plot, |p, (name, c)| p.legend(*name, *c))
            })?);
        }
    }
    Ok(out)
}

fn latch_lane(run: &Run, i: usize) -> Option<Lane> {
    let phases = run.curve(&format!("latch_{i}_phase"), 1.0)?;
    let mut bars: Vec<Bar> = Vec::new();
    let step = run.tick_s();
    for group in phases.chunk_by(|a, b| (a[1] - b[1]).abs() < 0.5) {
        let (first, last) = (group.first()?, group.last()?);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 3")]
        let phase = (first[1].max(0.0) as usize).min(3);
        let (name, colour) = PHASES[phase];
        bars.push(Bar {
            range: first[0]..last[0] + step,
            colour,
            height: if phase == 0 { 0.25 } else { 0.9 },
            label: if phase == 0 { String::new() } else { name.to_owned() },
        });
    }
    Some(Lane { name: format!("latch {i}"), bars })
}
