//! The docking mechanism on a test bench.

mod plots;

use core::fmt::Write as _;

use docktwin_model::AttenuationChoice;
use docktwin_physics::bench::{self, Axis, Others, Record};
use docktwin_study::mechanism::{
    AxialContrast, AxisRecords, AxisSummary, ContactLoop, MechanismBench, MechanismSummary,
    PoseMatrices, StabilityLoss, TestFigures,
};

use super::{NamedText, say::say};

pub use self::plots::plots;

/// `loop_AXIS.csv` of every axis, `matrices.csv` and `contact.csv`.
#[must_use]
pub fn tables(found: &MechanismBench) -> Vec<NamedText> {
    let mut out: Vec<NamedText> = found
        .records
        .iter()
        .map(|r| (format!("loop_{}.csv", r.axis.name()), loop_csv(r)))
        .collect();
    out.push(("matrices.csv".to_owned(), matrices_csv(&found.summary.matrices)));
    out.push(("contact.csv".to_owned(), contact_csv(&found.contact_loops)));
    out
}

const DEFLECTION: [&str; 6] =
    ["x_m", "y_m", "z_m", "rotation_x_rad", "rotation_y_rad", "rotation_z_rad"];
const REACTION: [&str; 6] =
    ["force_x_n", "force_y_n", "force_z_n", "moment_x_nm", "moment_y_nm", "moment_z_nm"];

const fn others_word(others: Others) -> &'static str {
    match others {
        Others::Held => "held",
        Others::Free => "free",
    }
}

fn loop_csv(a: &AxisRecords) -> String {
    let mut out = format!(
        "test,other_axes,cycle,time_s,{},{},stored_j,lost_j,work_j\n",
        DEFLECTION.join(","),
        REACTION.join(",")
    );
    let mut add = |name: &str, r: &Record| {
        let others = others_word(r.test.others);
        for s in &r.samples {
            let _ = write!(out, "{name},{others},{},{:.6}", s.cycle, s.time_s);
            for x in s.deflection.iter().chain(&s.reaction).chain(&[s.stored_j, s.lost_j, s.work_j])
            {
                let _ = write!(out, ",{x:.6e}");
            }
            out.push('\n');
        }
    };
    for t in core::iter::once(&a.as_in_a_docking).chain(&a.others_held) {
        add("soft", &t.soft);
        add("working", &t.working);
        add("stops", &t.stops);
    }
    add("docking_speed_before_capture", &a.docking_speed[0]);
    add("docking_speed_after_capture", &a.docking_speed[1]);
    out
}

fn matrices_csv(all: &[PoseMatrices]) -> String {
    let mut out = String::from("pose,matrix,row,column,value,unit,coupling\n");
    for m in all {
        for (name, a) in m.named() {
            for (i, row) in a.iter().enumerate() {
                for (j, x) in row.iter().enumerate() {
                    let unit = match (name == "stiffness", i >= 3, j >= 3) {
                        (true, false, false) => "N/m",
                        (true, true, true) => "N m/rad",
                        (true, false, true) => "N/rad",
                        (true, true, false) => "N m/m",
                        (false, false, false) => "N s/m",
                        (false, true, true) => "N m s/rad",
                        (false, false, true) => "N s/rad",
                        (false, true, false) => "N m s/m",
                    };
                    let _ = writeln!(
                        out,
                        "\"{}\",{name},{},{},{x:.9e},{unit},{:.6}",
                        m.pose,
                        Axis::ALL[i].name(),
                        Axis::ALL[j].name(),
                        bench::coupling(a, i, j)
                    );
                }
            }
        }
    }
    out
}

fn contact_csv(loops: &[ContactLoop]) -> String {
    let mut out = String::from("speed_at_touch_m_s,depth_m,force_n\n");
    for l in loops {
        for p in &l.points {
            let _ = writeln!(out, "{},{:.9e},{:.9e}", l.speed_at_touch_m_s, p.depth_m, p.force_n);
        }
    }
    out
}

/// Attenuation as a word.
const fn attenuation_word(s: &MechanismSummary) -> &'static str {
    match s.attenuation {
        AttenuationChoice::Characteristic => "characteristic",
        AttenuationChoice::Differential => "differential",
        AttenuationChoice::Rigid => "rigid",
    }
}

/// The answer in words.
#[must_use]
pub fn words(r: &MechanismBench) -> String {
    let mut out = format!(
        "{}, {} attenuation: the ring on the bench\n\
         moved slowly before capture, unless said otherwise; the reaction is that of the bench\n",
        r.summary.mechanism,
        attenuation_word(&r.summary)
    );
    for a in &r.summary.axes {
        axis_words(a, &mut out);
    }
    out.push_str("couplings (0 none, 1 as strong as the axes themselves), brakes holding\n");
    for m in &r.summary.matrices {
        for (name, a) in m.named() {
            let _ = writeln!(
                out,
                "  {:31} {:23} {}",
                m.pose,
                name.replace('_', " "),
                couplings_words(a)
            );
        }
    }
    if let Some(c) = &r.axial_contrast {
        let _ = writeln!(out, "shape          {}", contrast_words(c));
    }
    out
}

fn couplings_words(a: &bench::Matrix6) -> String {
    let all: Vec<String> = PoseMatrices::couplings(a)
        .into_iter()
        .take(4)
        .map(|c| format!("{}–{} {:.2}", c.axes[0].name(), c.axes[1].name(), c.coupling))
        .collect();
    let mut out = if all.is_empty() { "none".to_owned() } else { all.join(", ") };
    let lost: Vec<&str> = PoseMatrices::lost(a).into_iter().map(Axis::name).collect();
    if !lost.is_empty() {
        let _ = write!(out, "; negative on {}", lost.join(", "));
    }
    out
}

fn contrast_words(c: &AxialContrast) -> String {
    let verdict = if c.as_the_paper_says {
        "stiff in x and soft in the others, as the paper says"
    } else {
        "NOT stiff in x and soft in the others, as the paper says it should be"
    };
    format!(
        "{verdict}: {} against {} of {} at the ring's radius, {:.0} times",
        say(c.axial_n_m, "N/m"),
        say(c.other_n_m, "N/m"),
        c.stiffest_other.name(),
        c.axial_n_m / c.other_n_m
    )
}

fn axis_words(a: &AxisSummary, out: &mut String) {
    let f = &a.as_in_a_docking;
    let (x, force) = if a.axis.turns() { ("rad", "N m") } else { ("m", "N") };
    let k = format!("{force}/{x}");
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "  {name:12} {text}");
    };
    line(a.axis.name(), format!("(other axes {})", others_word(f.other_axes)));
    line(
        "  soft",
        format!(
            "{} within ±{}, dry friction {}",
            say(f.soft_stiffness, &k),
            say(f.soft_amplitude, x),
            say(f.dry_friction, force)
        ),
    );
    if let Some((at, with)) = f.brake_slips_at.zip(f.brake_slips_with) {
        line("  brake", format!("slips from {} on, with {}", say(at, x), say(with, force)));
    }
    let end = |i: usize| {
        f.travel[i].map_or("no end found".to_owned(), |t| {
            format!("{} ({})", say(t, x), say(f.reaction_at_travel_end[i], force))
        })
    };
    line("  working", format!("{} in the outer half of the travel", say(f.working_stiffness, &k)));
    line("  travel", format!("{} to {}", end(0), end(1)));
    line("  end stop", say(f.stop_stiffness, &k));
    line("  energy", energy_words(a));
    if let Some(h) = &a.others_held {
        held_words(h, f, [x, force], &mut line);
    }
    if let Some(u) = &a.unstable_from {
        line("  gives way", stability_words(u, [x, force]));
    }
}

fn energy_words(a: &AxisSummary) -> String {
    let (f, fast) = (&a.as_in_a_docking, &a.lost_per_cycle_at_docking_speed_j);
    format!(
        "{} taken in one stroke; lost in a cycle {} slowly, {} before and {} after capture at {}",
        say(f.work_of_one_stroke_j, "J"),
        say(f.lost_per_cycle_j, "J"),
        say(fast.before_capture.unwrap_or(0.0), "J"),
        say(fast.after_capture.unwrap_or(0.0), "J"),
        if a.axis.turns() {
            format!("{:.1} deg/s", fast.speed.to_degrees())
        } else {
            format!("{:.2} m/s", fast.speed)
        }
    )
}

/// Where holding the other axes makes a difference.
fn held_words(
    held: &TestFigures,
    free: &TestFigures,
    [x, force]: [&str; 2],
    line: &mut dyn FnMut(&str, String),
) {
    let peak = held.reaction_at_travel_end[1];
    if (peak / free.reaction_at_travel_end[1] - 1.0).abs() > 0.02 {
        line(
            "  held",
            format!(
                "with the other axes held {} at {}",
                say(peak, force),
                held.travel[1].map_or("no end found".to_owned(), |t| say(t, x))
            ),
        );
    }
}

fn stability_words(u: &StabilityLoss, [x, force]: [&str; 2]) -> String {
    format!(
        "from {} on ({}): the ring leans over, the stiffness of {} is lost, unless \
         something else holds it",
        say(u.at, x),
        say(u.reaction, force),
        u.weakest_axis.name()
    )
}
