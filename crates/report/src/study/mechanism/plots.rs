//! Plots of the mechanism on its bench.

use docktwin_physics::bench::{Axis, Record};
use docktwin_plot::{Axis as PlotAxis, Colour, Dash, Embed, Line, Marker, Plot, PlotError};
use docktwin_study::mechanism::{AxisRecords, AxisSummary, ContactLoop, MechanismBench};

use super::{
    super::{NamedText, sheet::sheet},
    attenuation_word, others_word,
};

type Curve = Vec<[f64; 2]>;

/// `loop_AXIS.svg` of every axis, Fig. 6 to 9 of the paper, `coupling.svg` and `contact.svg`.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn plots(r: &MechanismBench) -> Result<Vec<NamedText>, PlotError> {
    let mut out = Vec::new();
    for (a, records) in r.summary.axes.iter().zip(&r.records) {
        out.push((format!("loop_{}.svg", a.axis.name()), axis(r, a, records)?));
    }
    out.push(("coupling.svg".to_owned(), coupling(r)?));
    out.push(("contact.svg".to_owned(), contact_plot(&r.contact_loops)?));
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
fn points(r: &Record, cycle: u32) -> Curve {
    let k = r.test.axis.index();
    let mut out: Curve = r
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

/// From rest to the first turn.
fn first_loading(working: &Record) -> Curve {
    let turn = working.test.ends[0];
    let mut first = points(working, 0);
    let turned = |p: &[f64; 2]| p[0] / shown(working.test.axis) / turn > 0.999;
    let end = first.iter().position(turned).unwrap_or(0);
    first.truncate(end + 1);
    first
}

fn axis(r: &MechanismBench, a: &AxisSummary, records: &AxisRecords) -> Result<String, PlotError> {
    let main = &records.as_in_a_docking;
    let [soft, working] = [points(&main.soft, 1), points(&main.working, 1)];
    let first = first_loading(&main.working);
    let stops = points(&main.stops, 0);
    let held = records.others_held.as_ref().map(|h| points(&h.working, 1)).filter(|h| {
        // Where axes are independent it is the same loop.
        let peak = |p: &[[f64; 2]]| p.iter().map(|q| q[1].abs()).fold(0.0, f64::max);
        (peak(h) / peak(&working) - 1.0).abs() > 0.02
    });
    let others = others_word(a.as_in_a_docking.other_axes);
    let mut top = Plot::new(title(r, a.axis))
        .x_axis(x_axis(a.axis))
        .y_axis(y_axis(a.axis))
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
    if let Some(u) = &a.unstable_from {
        top = top.marker(Marker::new(
            u.at * shown(a.axis),
            format!("{} gives way beyond, unless held", u.weakest_axis.name()),
        ));
    }
    let mut left = Plot::new("Into the end stops, slowly")
        .x_axis(x_axis(a.axis))
        .y_axis(y_axis(a.axis))
        .size(375.0, 210.0)
        .line(Line::new("", &stops).colour(Colour::Blue).width(1.5));
    for t in a.as_in_a_docking.travel.iter().flatten() {
        left = left.marker(Marker::new(t * shown(a.axis), "end of travel"));
    }
    let fast = records.docking_speed.each_ref().map(|r| points(r, 1));
    sheet(&[&[top], &[left, fast_plot(a, &fast)]])
}

fn title(r: &MechanismBench, axis: Axis) -> String {
    let (figure, what) = match axis {
        Axis::X => ("Fig. 6", "Force and displacement in X"),
        Axis::Y => ("Fig. 7", "Force and displacement in Y"),
        Axis::Z => ("Fig. 7", "Force and displacement in Z"),
        Axis::Roll => ("Fig. 9", "Torque and angle in roll"),
        Axis::Pitch => ("Fig. 8", "Torque and angle in pitch"),
        Axis::Yaw => ("Fig. 8", "Torque and angle in yaw"),
    };
    format!("{what} (as {figure}): {}, {}", r.summary.mechanism, attenuation_word(&r.summary))
}

/// The sine at the speed of a docking, before and after capture.
fn fast_plot<'a>(a: &AxisSummary, fast: &'a [Curve; 2]) -> Plot<'a> {
    let speed = a.lost_per_cycle_at_docking_speed_j.speed;
    let speed = if a.axis.turns() {
        format!("{:.1} deg/s", speed.to_degrees())
    } else {
        format!("{speed:.2} m/s")
    };
    Plot::new(format!("Sine, up to {speed}"))
        .x_axis(x_axis(a.axis))
        .y_axis(y_axis(a.axis))
        .size(375.0, 210.0)
        .line(Line::new("after capture", &fast[1]).colour(Colour::Green).width(1.5))
        .line(Line::new("before capture", &fast[0]).colour(Colour::Amber).width(1.5))
}

/// What one axis does to another: the axial force while the ring is moved sideways and turned.
fn coupling(r: &MechanismBench) -> Result<String, PlotError> {
    let share = |rec: &Record, i: usize, scale: f64, from_reaction: bool| -> Curve {
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
    let moved = || r.records.iter().filter_map(|a| Some((a, a.others_held.as_ref()?)));
    let held: Vec<(Axis, Curve)> =
        moved().map(|(a, h)| (a.axis, share(&h.working, 0, 1.0, true))).collect();
    let free: Vec<(Axis, Curve)> =
        moved().map(|(a, _)| (a.axis, share(&a.as_in_a_docking.working, 0, 1e3, false))).collect();
    let mut left =
        Plot::new(format!("Other axes held: force in X ({})", attenuation_word(&r.summary)))
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

fn contact_plot(loops: &[ContactLoop]) -> Result<String, PlotError> {
    let millimetres: Vec<(f64, Curve)> = loops
        .iter()
        .map(|l| {
            let points = l.points.iter().map(|p| [p.depth_m * 1e3, p.force_n]);
            (l.speed_at_touch_m_s, points.collect())
        })
        .collect();
    let mut plot = Plot::new("Contact law: pressed in and let go (sine)")
        .x_axis(PlotAxis::new("depth", "mm"))
        .y_axis(PlotAxis::new("normal force", "N"))
        .size(560.0, 230.0);
    for (v, p) in &millimetres {
        plot = plot.line(Line::new(format!("{v:.2} m/s at touch"), p));
    }
    plot.svg(Embed::Alone)
}
