//! Plots of a cross-check: both runs over each other, and their differences.

use docktwin_core::Euler;
use docktwin_plot::{Axis, Colour, Dash, Embed, Line, Marker, Plot, PlotError};

use super::comparison::{Comparison, Side};

/// A curve: times from first contact, s, and values.
type Curve = Vec<[f64; 2]>;

/// Every plot, with its file name.
pub(super) fn all(c: &Comparison, sides: &[Side; 2]) -> Result<Vec<(String, String)>, PlotError> {
    // Curves of each side, values by its tick.
    let curves = |value: &dyn Fn(&Side, usize) -> f64| -> [Curve; 2] {
        core::array::from_fn(|s| {
            let side = &sides[s];
            (0..side.time_s.len()).map(|i| [side.time_s[i] - c.zero_s[s], value(side, i)]).collect()
        })
    };
    let differences = |value: &dyn Fn(usize) -> f64| -> Curve {
        (0..c.difference.len()).map(|i| [c.difference[i].0 - c.zero_s[0], value(i)]).collect()
    };
    let axes = [("X", Colour::Vermilion), ("Y", Colour::Blue), ("Z", Colour::Green)];
    let angles = [("roll", Colour::Vermilion), ("pitch", Colour::Blue), ("yaw", Colour::Green)];

    let position = [0, 1, 2].map(|k| curves(&|s, i| s.position_m[i].to_array()[k]));
    let attitude = [0, 1, 2].map(|k| {
        curves(&|s, i| {
            let e = Euler::from_quat(s.attitude[i]);
            [e.roll, e.pitch, e.yaw][k].to_degrees()
        })
    });
    let apart: [Curve; 3] =
        [0, 1, 2].map(|k| differences(&|i| c.difference[i].1.to_array()[k] * 1e3));
    let turned = differences(&|i| c.difference[i].2.to_degrees());
    let force = curves(&|s, i| s.port4_n[i]);

    let time = if c.aligned { "time from first contact" } else { "time" };
    let plot = |title: &str, y: Axis| {
        let mut p = Plot::new(title).x_axis(Axis::new(time, "s")).y_axis(y).size(760.0, 260.0);
        for (i, t) in sides[0].summary.latches_s.iter().enumerate() {
            if let Some(t) = t {
                p = p.marker(Marker::new(t - c.zero_s[0], format!("latch {}", i + 1)));
            }
        }
        p
    };
    let mut out = Vec::new();
    for (file, title, unit, curves, names) in [
        ("relative_position.svg", "Target port from the chaser's, in e3", "m", &position, axes),
        ("relative_attitude.svg", "Target port against the chaser's", "deg", &attitude, angles),
    ] {
        let y = if unit == "m" { "position" } else { "angle" };
        let mut p = plot(title, Axis::new(y, unit));
        for (c, (name, colour)) in curves.iter().zip(names) {
            p = p.line(Line::new(format!("{name}, docktwin"), &c[0]).colour(colour));
        }
        for (i, c) in curves.iter().enumerate() {
            let name = if i == 0 { "MuJoCo" } else { "" };
            p = p.line(Line::new(name, &c[1]).colour(Colour::Ink).dash(Dash::Dotted));
        }
        out.push((file.to_owned(), p.svg(Embed::Alone)?));
    }
    let mut p = plot("Relative position: MuJoCo minus docktwin", Axis::new("difference", "mm"));
    for (curve, (name, colour)) in apart.iter().zip(axes) {
        p = p.line(Line::new(name, curve).colour(colour));
    }
    out.push(("position_difference.svg".to_owned(), p.svg(Embed::Alone)?));
    let p = plot("Angle between both relative attitudes", Axis::new("angle", "deg"))
        .line(Line::new("", &turned));
    out.push(("attitude_difference.svg".to_owned(), p.svg(Embed::Alone)?));
    let p = plot("Force on the target's port, F4", Axis::new("force", "N"))
        .line(Line::new("docktwin", &force[0]).colour(Colour::Blue))
        .line(Line::new("MuJoCo", &force[1]).colour(Colour::Ink).dash(Dash::Dotted));
    out.push(("port_force.svg".to_owned(), p.svg(Embed::Alone)?));
    Ok(out)
}
