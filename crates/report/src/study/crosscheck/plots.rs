//! Plots of a cross-check: both runs over each other, and their differences.

use docktwin_core::Euler;
use docktwin_plot::{Axis, Colour, Dash, Embed, Line, Marker, Plot, PlotError};
use docktwin_study::crosscheck::{CrossCheck, PoseDifference, Side};

use super::super::NamedText;

/// A curve: times from first contact, s, and values.
type Curve = Vec<[f64; 2]>;

/// A file name, a title, an axis and curves of each side by coordinate.
struct Overlay<'a> {
    file: &'a str,
    title: &'a str,
    axis: Axis,
    curves: [[Curve; 2]; 3],
    names: [&'a str; 3],
}

const COLOURS: [Colour; 3] = [Colour::Vermilion, Colour::Blue, Colour::Green];

/// Curves of each side, values by its row.
fn curves(c: &CrossCheck, sides: &[Side; 2], value: impl Fn(&Side, usize) -> f64) -> [Curve; 2] {
    core::array::from_fn(|s| {
        let side = &sides[s];
        let at = |i: usize| [side.time_s[i] - c.summary.zero_s[s], value(side, i)];
        (0..side.time_s.len()).map(at).collect()
    })
}

/// An empty plot over time, with docktwin's latches.
fn over_time<'a>(c: &CrossCheck, sides: &[Side; 2], title: &str, y: Axis) -> Plot<'a> {
    let time = if c.summary.aligned { "time from first contact" } else { "time" };
    let mut p = Plot::new(title).x_axis(Axis::new(time, "s")).y_axis(y).size(760.0, 260.0);
    for (i, t) in sides[0].summary.latches_s.iter().enumerate() {
        if let Some(t) = t {
            p = p.marker(Marker::new(t - c.summary.zero_s[0], format!("latch {}", i + 1)));
        }
    }
    p
}

/// `relative_position.svg`, `relative_attitude.svg`, `position_difference.svg`,
/// `attitude_difference.svg` and `port_force.svg`.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn plots(c: &CrossCheck, sides: &[Side; 2]) -> Result<Vec<NamedText>, PlotError> {
    let angles = |s: &Side, i: usize| {
        let e = Euler::from_quat(s.attitude[i]);
        [e.roll, e.pitch, e.yaw]
    };
    let mut out = Vec::new();
    for o in [
        Overlay {
            file: "relative_position.svg",
            title: "Target port from the chaser's, in e3",
            axis: Axis::new("position", "m"),
            curves: [0, 1, 2].map(|k| curves(c, sides, |s, i| s.position_m[i].to_array()[k])),
            names: ["X", "Y", "Z"],
        },
        Overlay {
            file: "relative_attitude.svg",
            title: "Target port against the chaser's",
            axis: Axis::new("angle", "deg"),
            curves: [0, 1, 2].map(|k| curves(c, sides, |s, i| angles(s, i)[k].to_degrees())),
            names: ["roll", "pitch", "yaw"],
        },
    ] {
        out.push((o.file.to_owned(), overlay(c, sides, &o)?));
    }
    out.extend(differences(c, sides)?);
    let force = curves(c, sides, |s, i| s.port4_n[i]);
    let p = over_time(c, sides, "Force on the target's port, F4", Axis::new("force", "N"))
        .line(Line::new("docktwin", &force[0]).colour(Colour::Blue))
        .line(Line::new("MuJoCo", &force[1]).colour(Colour::Ink).dash(Dash::Dotted));
    out.push(("port_force.svg".to_owned(), p.svg(Embed::Alone)?));
    Ok(out)
}

fn overlay(c: &CrossCheck, sides: &[Side; 2], o: &Overlay<'_>) -> Result<String, PlotError> {
    let mut p = over_time(c, sides, o.title, o.axis.clone());
    for ((curves, name), colour) in o.curves.iter().zip(o.names).zip(COLOURS) {
        p = p.line(Line::new(format!("{name}, docktwin"), &curves[0]).colour(colour));
    }
    for (i, curves) in o.curves.iter().enumerate() {
        let name = if i == 0 { "MuJoCo" } else { "" };
        p = p.line(Line::new(name, &curves[1]).colour(Colour::Ink).dash(Dash::Dotted));
    }
    p.svg(Embed::Alone)
}

fn differences(c: &CrossCheck, sides: &[Side; 2]) -> Result<[NamedText; 2], PlotError> {
    let curve = |value: &dyn Fn(&PoseDifference) -> f64| -> Curve {
        c.differences.iter().map(|d| [d.time_s - c.summary.zero_s[0], value(d)]).collect()
    };
    let apart = [0, 1, 2].map(|k| curve(&|d| d.position_m.to_array()[k] * 1e3));
    let title = "Relative position: MuJoCo minus docktwin";
    let mut p = over_time(c, sides, title, Axis::new("difference", "mm"));
    for ((curve, name), colour) in apart.iter().zip(["X", "Y", "Z"]).zip(COLOURS) {
        p = p.line(Line::new(name, curve).colour(colour));
    }
    let position = p.svg(Embed::Alone)?;
    let turned = curve(&|d| d.angle_rad.to_degrees());
    let title = "Angle between both relative attitudes";
    let p = over_time(c, sides, title, Axis::new("angle", "deg")).line(Line::new("", &turned));
    Ok([
        ("position_difference.svg".to_owned(), position),
        ("attitude_difference.svg".to_owned(), p.svg(Embed::Alone)?),
    ])
}
