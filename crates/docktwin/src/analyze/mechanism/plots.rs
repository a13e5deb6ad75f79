//! Plots of `analyze mechanism`.

use docktwin_physics::bench::{Axis, Others, Record};
use docktwin_plot::{Axis as PlotAxis, Colour, Dash, Embed, Line, Marker, Plot, PlotError};

use super::{AxisResult, Results, docking_speed};
use crate::analyze::plots::sheet;

/// Every plot, with its file name.
pub(super) fn all(
    r: &Results,
    contact: &[(f64, Vec<[f64; 2]>)],
) -> Result<Vec<(String, String)>, PlotError> {
    let mut out = Vec::new();
    for a in &r.axes {
        out.push((format!("loop_{}.svg", a.main.figures.axis.name()), axis(r, a)?));
    }
    out.push(("coupling.svg".to_owned(), coupling(r)?));
    out.push(("contact.svg".to_owned(), contact_plot(contact)?));
    Ok(out)
}

/// Millimetres or degrees to a metre or radian.
fn shown(axis: Axis) -> f64 {
    if axis.turns() { 1f64.to_degrees() } else { 1e3 }
}

fn x_axis(axis: Axis) -> PlotAxis {
    if axis.turns() {
        PlotAxis::new(format!("{} angle", axis.name()), "deg")
    } else {
        PlotAxis::new(format!("{} displacement", axis.name().to_uppercase()), "mm")
    }
}

fn y_axis(axis: Axis) -> PlotAxis {
    if axis.turns() { PlotAxis::new("torque", "N m") } else { PlotAxis::new("force", "N") }
}

/// Deflection and reaction of the driven axis in one cycle; a cycle after the first is closed.
fn points(r: &Record, cycle: u32) -> Vec<[f64; 2]> {
    let k = r.test.axis.index();
    let mut out: Vec<[f64; 2]> = r
        .samples
        .iter()
        .filter(|s| s.cycle == cycle)
        .map(|s| [s.deflection[k] * shown(r.test.axis), s.reaction[k]])
        .collect();
    if cycle > 0 {
        out.extend(out.first().copied());
    }
    out
}

fn axis(r: &Results, a: &AxisResult) -> Result<String, PlotError> {
    let f = &a.main.figures;
    let axis = f.axis;
    let [soft, working] = [points(&a.main.soft, 1), points(&a.main.working, 1)];
    // From rest to the first turn.
    let turn = a.main.working.test.ends[0];
    let mut first = points(&a.main.working, 0);
    let end = first.iter().position(|p| (p[0] / shown(axis) / turn) > 0.999).unwrap_or(0);
    first.truncate(end + 1);
    let stops = points(&a.main.stops, 0);
    let (figure, what) = match axis {
        Axis::X => ("Fig. 6", "Force and displacement in X"),
        Axis::Y => ("Fig. 7", "Force and displacement in Y"),
        Axis::Z => ("Fig. 7", "Force and displacement in Z"),
        Axis::Roll => ("Fig. 9", "Torque and angle in roll"),
        Axis::Pitch => ("Fig. 8", "Torque and angle in pitch"),
        Axis::Yaw => ("Fig. 8", "Torque and angle in yaw"),
    };
    let others = if f.others == Others::Held { "held" } else { "free" };
    let held = a.held.as_ref().map(|h| points(&h.working, 1)).filter(|h| {
        // Where axes are independent it is the same loop.
        let peak = |p: &[[f64; 2]]| p.iter().map(|q| q[1].abs()).fold(0.0, f64::max);
        (peak(h) / peak(&working) - 1.0).abs() > 0.02
    });
    let title = format!("{what} (as {figure}): {}, {}", r.name, r.attenuation);
    let mut top = Plot::new(title)
        .x_axis(x_axis(axis))
        .y_axis(y_axis(axis))
        .size(760.0, 250.0)
        .line(
            Line::new(format!("first loading, other axes {others}"), &first)
                .colour(Colour::Grey)
                .width(1.0),
        )
        .line(
            Line::new(format!("98 % of the travel, other axes {others}"), &working)
                .colour(Colour::Blue)
                .width(2.0),
        )
        .line(Line::new("soft travel", &soft).colour(Colour::Vermilion).width(2.0));
    if let Some(h) = &held {
        top = top.line(
            Line::new("98 % of its travel, other axes held", h)
                .colour(Colour::Purple)
                .dash(Dash::Dashed),
        );
    }
    if let Some(u) = a.unstable {
        top = top.marker(Marker::new(
            u.at * shown(axis),
            format!("{} gives way beyond, unless held", u.weakest.name()),
        ));
    }
    let mut left = Plot::new("Into the end stops, slowly")
        .x_axis(x_axis(axis))
        .y_axis(y_axis(axis))
        .size(375.0, 210.0)
        .line(Line::new("", &stops).colour(Colour::Blue).width(1.5));
    for t in f.travel.iter().flatten() {
        left = left.marker(Marker::new(t * shown(axis), "end of travel"));
    }
    let fast = [points(&a.fast[0], 1), points(&a.fast[1], 1)];
    let speed = if axis.turns() {
        format!("{:.1} deg/s", docking_speed(axis).to_degrees())
    } else {
        format!("{:.2} m/s", docking_speed(axis))
    };
    let right = Plot::new(format!("Sine, up to {speed}"))
        .x_axis(x_axis(axis))
        .y_axis(y_axis(axis))
        .size(375.0, 210.0)
        .line(Line::new("after capture", &fast[1]).colour(Colour::Green).width(1.5))
        .line(Line::new("before capture", &fast[0]).colour(Colour::Amber).width(1.5));
    sheet(&[&[top], &[left, right]])
}

/// What one axis does to another: the axial force while the ring is moved sideways and turned.
fn coupling(r: &Results) -> Result<String, PlotError> {
    let moved: Vec<&AxisResult> = r.axes.iter().filter(|a| a.held.is_some()).collect();
    let share = |rec: &Record, i: usize, scale: f64, from_reaction: bool| -> Vec<[f64; 2]> {
        let k = rec.test.axis.index();
        let end = rec.test.ends[0].abs();
        rec.samples
            .iter()
            .filter(|s| s.cycle == rec.test.cycles - 1)
            .map(|s| {
                let y = if from_reaction { s.reaction[i] } else { s.deflection[i] };
                [100.0 * s.deflection[k] / end, y * scale]
            })
            .collect()
    };
    let held: Vec<(Axis, Vec<[f64; 2]>)> = moved
        .iter()
        .filter_map(|a| a.held.as_ref())
        .map(|h| (h.figures.axis, share(&h.working, 0, 1.0, true)))
        .collect();
    let free: Vec<(Axis, Vec<[f64; 2]>)> = moved
        .iter()
        .map(|a| (a.main.figures.axis, share(&a.main.working, 0, 1e3, false)))
        .collect();
    let mut left = Plot::new(format!("Other axes held: force in X ({})", r.attenuation))
        .x_axis(PlotAxis::new("of the travel of the axis", "%"))
        .y_axis(PlotAxis::new("force in X", "N").at_least(10.0))
        .size(375.0, 230.0);
    let mut right = Plot::new("Other axes free: the ring moves in X")
        .x_axis(PlotAxis::new("of the travel of the axis", "%"))
        .y_axis(PlotAxis::new("displacement in X", "mm").at_least(1.0))
        .size(375.0, 230.0);
    for (axis, p) in &held {
        left = left.line(Line::new(axis.name(), p));
    }
    for (axis, p) in &free {
        right = right.line(Line::new(axis.name(), p));
    }
    sheet(&[&[left, right]])
}

fn contact_plot(loops: &[(f64, Vec<[f64; 2]>)]) -> Result<String, PlotError> {
    let millimetres: Vec<(f64, Vec<[f64; 2]>)> =
        loops.iter().map(|(v, p)| (*v, p.iter().map(|q| [q[0] * 1e3, q[1]]).collect())).collect();
    let mut plot = Plot::new("Contact law: pressed in and let go (sine)")
        .x_axis(PlotAxis::new("depth", "mm"))
        .y_axis(PlotAxis::new("normal force", "N"))
        .size(560.0, 230.0);
    for (v, p) in &millimetres {
        plot = plot.line(Line::new(format!("{v:.2} m/s at touch"), p));
    }
    plot.svg(Embed::Alone)
}
