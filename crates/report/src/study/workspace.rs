//! Where a rig reaches, against its docking workspace, and what it can.

use core::fmt::Write as _;

use docktwin_plot::{Axis, Bar, Colour, Dash, Lane, Line, Plot, PlotError};
use docktwin_study::rig::{Dof, Extreme, PAPER_RANGE, Section, Workspace};

use super::{
    NamedText,
    rig::{PLACE_COLUMNS, half_width, place_csv, title},
    say::say,
    sheet::sheet,
};

/// `workspace.csv` and `sections.csv`.
#[must_use]
pub fn tables(f: &Workspace) -> Vec<NamedText> {
    vec![
        ("workspace.csv".to_owned(), places_csv(f)),
        ("sections.csv".to_owned(), sections_csv(&f.sections)),
    ]
}

/// `workspace.svg`, Fig. 30 of the paper.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn plots(f: &Workspace) -> Result<Vec<NamedText>, PlotError> {
    Ok(vec![("workspace.svg".to_owned(), plot(f)?)])
}

fn places_csv(found: &Workspace) -> String {
    let mut table = format!(
        "{PLACE_COLUMNS},{},stroke_margin_m,tightest_leg,joint_margin_deg,least_singular_value\n",
        [0, 1, 2, 3, 4, 5].map(|i| format!("leg_{i}_m")).join(",")
    );
    for r in &found.places {
        // Writing to a String cannot fail.
        let _ = write!(table, "{}", place_csv(&found.docking_workspace, r.place));
        for l in r.lengths_m {
            let _ = write!(table, ",{l:.6}");
        }
        let _ = writeln!(
            table,
            ",{:.6},{},{:.4},{:.6}",
            r.stroke_margin_m,
            r.tightest_leg,
            r.joint_margin_rad.to_degrees(),
            r.least_singular_value
        );
    }
    table
}

/// Name of a section: its axes in their order.
fn section_name(s: &Section) -> String {
    let mut axes = s.axes;
    axes.sort_unstable();
    axes.map(Dof::name).join("-")
}

fn sections_csv(sections: &[Section]) -> String {
    let mut out = String::from("section,attitude,x_m,y_m,z_m\n");
    for s in sections {
        for (attitude, outline) in
            [("middle", &s.in_middle_attitude_m), ("every corner", &s.in_every_attitude_m)]
        {
            for q in outline {
                let mut p = [0.0; 3];
                (p[s.axes[0].index()], p[s.axes[1].index()]) = (q[0], q[1]);
                let [x, y, z] = p;
                let _ = writeln!(out, "{},{attitude},{x:.6},{y:.6},{z:.6}", section_name(s));
            }
        }
    }
    out
}

fn plot(f: &Workspace) -> Result<String, PlotError> {
    let needed = f.sections.each_ref().map(|s| {
        let [a, b] = s.axes.map(|dof| half_width(&f.docking_workspace, dof));
        [[-a, -b], [a, -b], [a, b], [-a, b], [-a, -b]]
    });
    let sections: Vec<Plot<'_>> = f
        .sections
        .iter()
        .zip(&needed)
        .map(|(s, needed)| section_plot(s, needed, &f.summary.subject.rig))
        .collect();
    let ranges = [
        range_plot(f, &Dof::ALL[..3], "Translation", "m", 1.0),
        range_plot(f, &Dof::ALL[3..], "Rotation", "deg", 1f64.to_degrees()),
    ];
    sheet(&[&sections, &ranges, &[legs_plot(f)]])
}

fn section_plot<'a>(s: &'a Section, needed: &'a [[f64; 2]], rig: &str) -> Plot<'a> {
    let axis = |dof: Dof| Axis::new(format!("{dof} from the middle"), "m");
    let [a, b] = s.axes;
    Plot::new(format!("Reach of {rig} in the plane {} (as Fig. 30)", section_name(s)))
        .x_axis(axis(a))
        .y_axis(axis(b))
        .size(480.0, 380.0)
        .margin_left(60.0)
        .equal_aspect()
        .line(
            Line::new("attitude of the middle", &s.in_middle_attitude_m)
                .colour(Colour::Blue)
                .width(2.0),
        )
        .line(
            Line::new("in every attitude of docking", &s.in_every_attitude_m)
                .colour(Colour::Green)
                .width(2.0),
        )
        .line(
            Line::new("docking workspace", needed)
                .colour(Colour::Vermilion)
                .dash(Dash::Dashed)
                .width(2.0),
        )
}

fn bar(range: [f64; 2], colour: Colour, height: f64) -> Bar {
    Bar { range: range[0]..range[1], colour, height, label: String::new() }
}

fn range_plot<'a>(f: &Workspace, dofs: &[Dof], name: &str, unit: &str, scale: f64) -> Plot<'a> {
    let reach = |dof: Dof| f.summary.capability.range[dof.index()].range;
    let far = dofs.iter().flat_map(|dof| reach(*dof)).map(f64::abs).fold(0.0, f64::max);
    let far = 1.05 * scale * far.max(1e-3);
    let mut p = Plot::new(format!("{name}: reach from the middle, one at a time"))
        .x_axis(Axis::new("displacement from the middle", unit).range(-far..far))
        .size(480.0, 120.0)
        .margin_left(60.0)
        .legend("reach", Colour::Blue)
        .legend("docking workspace", Colour::Vermilion)
        .legend("the paper's motion range", Colour::Ink);
    for dof in dofs {
        let both = |x: f64| [-x * scale, x * scale];
        p = p.lane(Lane {
            name: dof.name().to_owned(),
            bars: vec![
                bar(reach(*dof).map(|x| x * scale), Colour::Blue, 0.85),
                bar(both(half_width(&f.docking_workspace, *dof)), Colour::Vermilion, 0.5),
                bar(both(PAPER_RANGE[dof.index()]), Colour::Ink, 0.15),
            ],
        });
    }
    p
}

fn legs_plot<'a>(f: &Workspace) -> Plot<'a> {
    let ends = [
        f.legs.iter().map(|l| l.shortest_m).fold(f64::INFINITY, f64::min),
        f.legs.iter().map(|l| l.longest_m).fold(0.0, f64::max),
    ];
    let room = 0.03 * (ends[1] - ends[0]);
    let mut legs = Plot::new("Legs: length over the docking workspace, and stroke")
        .x_axis(Axis::new("length from joint to joint", "m").range(ends[0] - room..ends[1] + room))
        .size(970.0, 170.0)
        .margin_left(60.0)
        .legend("stroke of the leg", Colour::Blue)
        .legend("docking workspace", Colour::Vermilion);
    for (i, leg) in f.legs.iter().enumerate() {
        legs = legs.lane(Lane {
            name: format!("leg {i}"),
            bars: vec![
                bar([leg.shortest_m, leg.longest_m], Colour::Blue, 0.85),
                bar(leg.used_m, Colour::Vermilion, 0.5),
            ],
        });
    }
    legs
}

/// The answer in words.
#[must_use]
pub fn words(f: &Workspace) -> String {
    let s = &f.summary;
    let mut out =
        format!("{}: reach about the middle of the docking workspace\n", title(&s.subject));
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "{name:14} {text}");
    };
    line(
        "fits",
        format!(
            "{}: all six half-widths of the docking workspace could be {:.2} times as large",
            if s.fits { "yes" } else { "NO" },
            s.growth
        ),
    );
    line(
        "margin",
        format!(
            "stroke {} at {}; joints {} at {}",
            say(s.stroke_margin_m.value, "m"),
            s.stroke_margin_m.at,
            say(s.joint_margin_rad.value, "rad"),
            s.joint_margin_rad.at
        ),
    );
    line(
        "legs",
        format!(
            "{:.3} to {:.3} m long, {:.3} m of stroke; up to {:.3} of {:.3} m/s at the paper's fastest \
             approach",
            s.lengths_m[0],
            s.lengths_m[1],
            s.stroke_needed_m,
            s.fastest_leg_m_s.value,
            f.speed_limit_m_s
        ),
    );
    line(
        "singular",
        format!(
            "no: least singular value {:.3} in the middle, {:.3} at {}",
            s.least_singular_value_in_the_middle,
            s.least_singular_value.value,
            s.least_singular_value.at
        ),
    );
    capability_words(f, &mut line);
    out
}

fn capability_words(f: &Workspace, line: &mut dyn FnMut(&str, String)) {
    let c = &f.summary.capability;
    let (t, met) = (&c.tolerance, &c.meets_the_paper);
    line(
        "tolerance",
        format!(
            "±{} and ±{} with legs known to ±{}: {} the paper's ±1.27 mm and ±0.10 deg, which allow \
             ±{} of a leg",
            say(t.position_m, "m"),
            say(t.attitude_rad, "rad"),
            say(t.leg_error_m, "m"),
            if met.tolerance { "within" } else { "NOT within" },
            say(t.leg_error_allowed_m, "m")
        ),
    );
    let ranges = c.range.map(|r| {
        let [down, up] = r.range;
        if r.dof.turns() {
            format!("{} {:.0} to {:.0} deg", r.dof, down.to_degrees(), up.to_degrees())
        } else {
            format!("{} {down:.2} to {up:.2} m", r.dof)
        }
    });
    line(
        "range",
        format!(
            "{}; the paper's 0.61 m, ±0.15 m and ±5 deg {}",
            ranges.join(", "),
            if met.range { "are within" } else { "are NOT within" }
        ),
    );
    let payload = |kg: &Extreme, met: bool| {
        format!(
            "{:.0} kg at {}, {} the paper's 1135 kg",
            kg.value,
            kg.at,
            if met { "at least" } else { "BELOW" }
        )
    };
    line("payload", format!("at rest {}", payload(&c.payload_at_rest_kg, met.payload_at_rest)));
    line(
        "",
        format!("with 2 mm at 10 Hz {}", payload(&c.payload_at_10_hz_kg, met.payload_at_10_hz)),
    );
}
