//! `analyze workspace`: where a rig reaches, against its docking workspace, and what it can.

use core::f64::consts::TAU;
use core::fmt::Write as _;
use std::{path::Path, process::ExitCode};

use docktwin_core::{DQuat, DVec3, SimTime, Twist, Wrench};
use docktwin_model::{DockingWorkspace, Rig};
use docktwin_physics::platform::maps::{
    Capability, Maps, PAPER_ATTITUDE_RAD, PAPER_PAYLOAD_KG, PAPER_POSITION_M, Workspace,
};
use docktwin_plot::{Axis, Bar, Colour, Dash, Lane, Line, Plot, PlotError};
use docktwin_view::RigWriter;
use serde_json::{Value, json};

use super::{
    Results,
    plots::sheet,
    rig::{DOFS, PLACE_COLUMNS, Subject, at_json, singular},
    say,
};
use crate::{cli::RigArgs, failure::Failure};

/// The paper's motion range (3.1), half of it: 0.61 m of vertical travel, ±0.15 m, ±5 degrees.
const PAPER_RANGE: [f64; 6] =
    [0.305, 0.15, 0.15, 5.0 / 360.0 * TAU, 5.0 / 360.0 * TAU, 5.0 / 360.0 * TAU];

/// A plane of displacements of the port from the middle, Euler angles zero or in the corners.
struct Section {
    /// Indices of the horizontal and the vertical axis of `e3`.
    axes: [usize; 2],
    /// Outline of what is reached in the attitude of the middle, m.
    level: Vec<[f64; 2]>,
    /// Outline of what is reached in all eight attitudes at the corners of the docking workspace, m.
    turned: Vec<[f64; 2]>,
}

/// Directions of a section.
const DIRECTIONS: u32 = 180;
/// Farther than any rig of this kind reaches, m.
const FAR_M: f64 = 3.0;

impl Section {
    fn new(maps: &Maps<'_>, rig: &Rig, axes: [usize; 2]) -> Self {
        let attitudes: Vec<DQuat> = DockingWorkspace::corners()
            // One of the eight corners of position, with all attitudes.
            .filter(|p| p.0[..3].iter().all(|x| *x > 0.0))
            .map(|p| rig.docking.pose(p.0).q)
            .collect();
        let outline = |attitudes: &[DQuat]| -> Vec<[f64; 2]> {
            (0..=DIRECTIONS)
                .map(|n| {
                    let (s, c) =
                        (f64::from(n % DIRECTIONS) / f64::from(DIRECTIONS) * TAU).sin_cos();
                    let way = DVec3::AXES[axes[0]] * c + DVec3::AXES[axes[1]] * s;
                    let far = attitudes
                        .iter()
                        .fold(FAR_M, |far, q| far.min(maps.reach_turned(way, *q, FAR_M)));
                    [c * far, s * far]
                })
                .collect()
        };
        Self { axes, level: outline(&[DQuat::IDENTITY]), turned: outline(&attitudes) }
    }

    /// The docking workspace in this plane, m.
    fn needed(&self, rig: &Rig) -> Vec<[f64; 2]> {
        let half = half_widths(rig);
        let [a, b] = self.axes.map(|i| half[i]);
        vec![[-a, -b], [a, -b], [a, b], [-a, b], [-a, -b]]
    }

    fn name(&self) -> String {
        let mut axes = self.axes;
        axes.sort_unstable();
        axes.map(|i| DOFS[i]).join("-")
    }
}

/// Half-widths of the docking workspace, m and rad.
fn half_widths(rig: &Rig) -> [f64; 6] {
    let d = &rig.docking;
    [d.axial_m, d.lateral_m, d.lateral_m, d.roll_rad, d.pitch_yaw_rad, d.pitch_yaw_rad]
}

/// Everything found.
struct Found {
    workspace: Workspace,
    capability: Capability,
    /// Factor by which the docking workspace could be larger.
    growth: f64,
    sections: [Section; 2],
}

/// Runs the command.
pub(super) fn run(args: &RigArgs, json: bool) -> Result<ExitCode, Failure> {
    let subject = Subject::load(args, json)?;
    let mut out = Results::new(args.out.as_deref(), &format!("{}-workspace", subject.rig.name))?;
    let rig = &subject.rig;
    let maps = Maps::new(rig);
    let mut table = format!(
        "{PLACE_COLUMNS},{},stroke_margin_m,tightest_leg,joint_margin_deg,least_singular_value\n",
        [0, 1, 2, 3, 4, 5].map(|i| format!("leg_{i}_m")).join(",")
    );
    for place in DockingWorkspace::grid() {
        let r = maps.reach(&rig.plate_from_docking(&rig.docking.pose(place.0)));
        let _ = write!(table, "{}", subject.place_csv(place));
        for l in r.lengths_m {
            let _ = write!(table, ",{l:.6}");
        }
        let _ = writeln!(
            table,
            ",{:.6},{},{:.4},{:.6}",
            r.stroke_margin_m,
            r.leg,
            r.joint_margin_rad.to_degrees(),
            r.singularity
        );
    }
    let found = Found {
        workspace: maps.workspace(),
        capability: maps.capability().ok_or_else(singular)?,
        growth: maps.growth(5.0),
        sections: [[1, 0], [1, 2]].map(|axes| Section::new(&maps, rig, axes)),
    };
    out.save("workspace.csv".to_owned(), &table)?;
    out.save("sections.csv".to_owned(), &sections_csv(&found.sections))?;
    out.plots(plot(&subject, &found).map(|svg| vec![("workspace.svg".to_owned(), svg)]))?;
    scene(&maps, rig, &out.file("rig.rrd"))?;
    out.finish("workspace", &as_json(&subject, &found), &words(&subject, &found), json)
}

/// Pictures from corner to corner of the docking workspace.
const PICTURES: u32 = 20;
/// Between two pictures, ns.
const PICTURE_NS: u64 = 50_000_000;

/// The rig for the viewer: it tours all 64 corners of the docking workspace, along one coordinate after
/// the other; leg forces hold it still in every pose.
fn scene(maps: &Maps<'_>, rig: &Rig, path: &Path) -> Result<(), Failure> {
    let mut writer = RigWriter::create(path, rig, |way| maps.reach_along(way, DVec3::ZERO, FAR_M))?;
    let mut stops = vec![[0.0; 6]];
    // Neighbours in Gray's code differ in one coordinate.
    stops.extend((0..64_u32).map(|n| {
        let code = n ^ (n >> 1);
        core::array::from_fn(|i| if code >> i & 1 == 1 { 1.0 } else { -1.0 })
    }));
    let platform = maps.platform();
    let still = Twist::default();
    let mut time = SimTime::ZERO;
    for pair in stops.windows(2) {
        for k in 1..=PICTURES {
            let t = f64::from(k) / f64::from(PICTURES);
            let gentle = t * t * (3.0 - 2.0 * t);
            let place = core::array::from_fn(|i| pair[0][i] + (pair[1][i] - pair[0][i]) * gentle);
            let x_bp = rig.plate_from_docking(&rig.docking.pose(place));
            let forces =
                platform.inverse_dynamics(&platform.at(&x_bp), &still, &still, &Wrench::ZERO);
            writer.frame(time, &x_bp, forces)?;
            time = SimTime::from_nanos(time.nanos() + PICTURE_NS);
        }
    }
    Ok(writer.finish()?)
}

fn sections_csv(sections: &[Section]) -> String {
    let mut out = String::from("section,attitude,x_m,y_m,z_m\n");
    for s in sections {
        for (attitude, outline) in [("middle", &s.level), ("every corner", &s.turned)] {
            for q in outline {
                let mut p = [0.0; 3];
                (p[s.axes[0]], p[s.axes[1]]) = (q[0], q[1]);
                let [x, y, z] = p;
                let _ = writeln!(out, "{},{attitude},{x:.6},{y:.6},{z:.6}", s.name());
            }
        }
    }
    out
}

fn plot(subject: &Subject, f: &Found) -> Result<String, PlotError> {
    let rig = &subject.rig;
    let needed = f.sections.each_ref().map(|s| s.needed(rig));
    let sections: Vec<Plot<'_>> = f
        .sections
        .iter()
        .zip(&needed)
        .map(|(s, needed)| {
            let axis = |i: usize| Axis::new(format!("{} from the middle", DOFS[i]), "m");
            let [a, b] = s.axes;
            Plot::new(format!("Reach of {} in the plane {} (as Fig. 30)", rig.name, s.name()))
                .x_axis(axis(a))
                .y_axis(axis(b))
                .size(480.0, 380.0)
                .margin_left(60.0)
                .equal_aspect()
                .line(Line::new("attitude of the middle", &s.level).colour(Colour::Blue).width(2.0))
                .line(
                    Line::new("in every attitude of docking", &s.turned)
                        .colour(Colour::Green)
                        .width(2.0),
                )
                .line(
                    Line::new("docking workspace", needed)
                        .colour(Colour::Vermilion)
                        .dash(Dash::Dashed)
                        .width(2.0),
                )
        })
        .collect();
    let bar = |range: [f64; 2], colour: Colour, height: f64| Bar {
        range: range[0]..range[1],
        colour,
        height,
        label: String::new(),
    };
    let half = half_widths(rig);
    let range = |dofs: [usize; 3], name: &str, unit: &str, scale: f64| {
        let far = dofs.iter().flat_map(|i| f.workspace.range[*i]).map(f64::abs).fold(0.0, f64::max);
        let far = 1.05 * scale * far.max(1e-3);
        let mut p = Plot::new(format!("{name}: reach from the middle, one at a time"))
            .x_axis(Axis::new("displacement from the middle", unit).range(-far..far))
            .size(480.0, 120.0)
            .margin_left(60.0)
            .legend("reach", Colour::Blue)
            .legend("docking workspace", Colour::Vermilion)
            .legend("the paper's motion range", Colour::Ink);
        for i in dofs {
            let both = |x: f64| [-x * scale, x * scale];
            p = p.lane(Lane {
                name: DOFS[i].to_owned(),
                bars: vec![
                    bar(f.workspace.range[i].map(|x| x * scale), Colour::Blue, 0.85),
                    bar(both(half[i]), Colour::Vermilion, 0.5),
                    bar(both(PAPER_RANGE[i]), Colour::Ink, 0.15),
                ],
            });
        }
        p
    };
    let ends = [
        rig.legs.iter().map(|l| l.shortest_m).fold(f64::INFINITY, f64::min),
        rig.legs.iter().map(|l| l.longest_m).fold(0.0, f64::max),
    ];
    let room = 0.03 * (ends[1] - ends[0]);
    let mut legs = Plot::new("Legs: length over the docking workspace, and stroke")
        .x_axis(Axis::new("length from joint to joint", "m").range(ends[0] - room..ends[1] + room))
        .size(970.0, 170.0)
        .margin_left(60.0)
        .legend("stroke of the leg", Colour::Blue)
        .legend("docking workspace", Colour::Vermilion);
    for (i, (leg, used)) in rig.legs.iter().zip(f.workspace.legs_m).enumerate() {
        legs = legs.lane(Lane {
            name: format!("leg {i}"),
            bars: vec![
                bar([leg.shortest_m, leg.longest_m], Colour::Blue, 0.85),
                bar(used, Colour::Vermilion, 0.5),
            ],
        });
    }
    let ranges = [
        range([0, 1, 2], "Translation", "m", 1.0),
        range([3, 4, 5], "Rotation", "deg", 1f64.to_degrees()),
    ];
    sheet(&[&sections, &ranges, &[legs]])
}

/// Whether the paper's figures of 3.1 are met: tolerance, range, payload at rest and at 10 Hz.
fn met(f: &Found) -> [bool; 4] {
    let c = &f.capability;
    [
        c.position_error_m <= PAPER_POSITION_M && c.attitude_error_rad <= PAPER_ATTITUDE_RAD,
        c.range.iter().zip(PAPER_RANGE).all(|([down, up], p)| *down <= -p && *up >= p),
        c.payload_at_rest_kg.0 >= PAPER_PAYLOAD_KG,
        c.payload_at_10_hz_kg.0 >= PAPER_PAYLOAD_KG,
    ]
}

/// Every place is in reach, and no singular pose is near.
fn fits(f: &Found) -> bool {
    f.workspace.stroke_margin_m.0 >= 0.0 && f.workspace.joint_margin_rad.0 >= 0.0 && f.growth >= 1.0
}

fn as_json(subject: &Subject, f: &Found) -> Value {
    let (w, c, met) = (&f.workspace, &f.capability, met(f));
    json!({
        "subject": subject.json(),
        "fits": fits(f),
        "growth": f.growth,
        "stroke_margin_m": at_json(w.stroke_margin_m),
        "joint_margin_rad": at_json(w.joint_margin_rad),
        "lengths_m": w.lengths_m,
        "stroke_needed_m": w.stroke_m,
        "fastest_leg_m_s": at_json(w.fastest_leg_m_s),
        "least_singular_value": at_json(w.singularity),
        "least_singular_value_in_the_middle": w.singularity_in_the_middle,
        "range": DOFS.iter().zip(w.range).map(|(n, r)| json!({ "dof": n, "range": r })).collect::<Vec<_>>(),
        "tolerance": {
            "position_m": c.position_error_m,
            "attitude_rad": c.attitude_error_rad,
            "leg_error_m": subject.rig.limits.length_error_m,
            "leg_error_allowed_m": c.leg_error_allowed_m,
        },
        "payload_at_rest_kg": at_json(c.payload_at_rest_kg),
        "payload_at_10_hz_kg": at_json(c.payload_at_10_hz_kg),
        "meets_the_paper": {
            "tolerance": met[0],
            "range": met[1],
            "payload_at_rest": met[2],
            "payload_at_10_hz": met[3],
        },
    })
}

fn words(subject: &Subject, f: &Found) -> String {
    let rig = &subject.rig;
    let (w, c, met) = (&f.workspace, &f.capability, met(f));
    let mut out = format!("{}: reach about the middle of the docking workspace\n", subject.title());
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "{name:14} {text}");
    };
    line(
        "fits",
        format!(
            "{}: all six half-widths of the docking workspace could be {:.2} times as large",
            if fits(f) { "yes" } else { "NO" },
            f.growth
        ),
    );
    line(
        "margin",
        format!(
            "stroke {} at {}; joints {} at {}",
            say(w.stroke_margin_m.0, "m"),
            w.stroke_margin_m.1,
            say(w.joint_margin_rad.0, "rad"),
            w.joint_margin_rad.1
        ),
    );
    line(
        "legs",
        format!(
            "{:.3} to {:.3} m long, {:.3} m of stroke; up to {:.3} of {:.3} m/s at the paper's fastest \
             approach",
            w.lengths_m[0], w.lengths_m[1], w.stroke_m, w.fastest_leg_m_s.0, rig.limits.speed_m_s
        ),
    );
    line(
        "singular",
        format!(
            "no: least singular value {:.3} in the middle, {:.3} at {}",
            w.singularity_in_the_middle, w.singularity.0, w.singularity.1
        ),
    );
    let against = |met: bool| if met { "within" } else { "NOT within" };
    line(
        "tolerance",
        format!(
            "±{} and ±{} with legs known to ±{}: {} the paper's ±1.27 mm and ±0.10 deg, which allow \
             ±{} of a leg",
            say(c.position_error_m, "m"),
            say(c.attitude_error_rad, "rad"),
            say(rig.limits.length_error_m, "m"),
            against(met[0]),
            say(c.leg_error_allowed_m, "m")
        ),
    );
    let ranges: Vec<String> = DOFS
        .iter()
        .zip(w.range)
        .enumerate()
        .map(|(i, (name, [down, up]))| {
            if i < 3 {
                format!("{name} {down:.2} to {up:.2} m")
            } else {
                format!("{name} {:.0} to {:.0} deg", down.to_degrees(), up.to_degrees())
            }
        })
        .collect();
    line(
        "range",
        format!(
            "{}; the paper's 0.61 m, ±0.15 m and ±5 deg {}",
            ranges.join(", "),
            if met[1] { "are within" } else { "are NOT within" }
        ),
    );
    let payload = |(kg, place): (f64, docktwin_model::Place), met: bool| {
        format!(
            "{kg:.0} kg at {place}, {} the paper's 1135 kg",
            if met { "at least" } else { "BELOW" }
        )
    };
    line("payload", format!("at rest {}", payload(c.payload_at_rest_kg, met[2])));
    line("", format!("with 2 mm at 10 Hz {}", payload(c.payload_at_10_hz_kg, met[3])));
    out
}
