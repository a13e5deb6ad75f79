//! `analyze mechanism`: the docking mechanism on a test bench.

mod plots;

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
    process::ExitCode,
};

use docktwin_model::{AttenuationChoice, Attenuator, DockingMechanism, load_mechanism};
use docktwin_physics::bench::{
    self, Axis, AxisTests, BenchError, Cycling, Instability, Matrix6, Others, Record, Six, Tangent,
    Wave, characterise, coupling, instability, run as run_test, tangent,
};
use serde_json::{Value, json};

use crate::{
    analyze::{Results as Directory, say},
    cli::{AttenuationArg, MechanismArgs},
    failure::Failure,
};

impl From<BenchError> for Failure {
    fn from(e: BenchError) -> Self {
        let remedy = match e {
            BenchError::Rigid => {
                "choose one that the file describes with --attenuation characteristic or \
                 --attenuation differential, or give a mechanism that has one"
            }
            BenchError::Motion => {
                "check the travels and the series brakes of the attenuation; a brake that is stiff \
                 and hardly viscous needs very small steps"
            }
            BenchError::NoEquilibrium { .. } => {
                "give the free channels some stiffness or damping, so that they have a place of \
                 their own"
            }
        };
        Self::Usage { what: e.to_string(), remedy: remedy.to_owned() }
    }
}

/// Speeds of the tests at the speed of a docking: the paper's initial conditions (m/s, rad/s).
fn docking_speed(axis: Axis) -> f64 {
    match axis {
        Axis::X => 0.35,
        Axis::Y | Axis::Z => 0.10,
        _ => 1f64.to_radians(),
    }
}

/// The tests of one axis.
struct AxisResult {
    /// In the way a docking meets it: X held, the others free.
    main: AxisTests,
    /// With the other axes held (X: none, it is the same).
    held: Option<AxisTests>,
    /// At the speed of a docking, before and after capture.
    fast: [Record; 2],
    unstable: Option<Instability>,
}

/// Poses of the matrices.
fn poses() -> [(&'static str, Six); 6] {
    let tilt = 2f64.to_radians();
    [
        ("rest", [0.0; 6]),
        ("x -20 mm", [-0.02, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ("y 20 mm", [0.0, 0.02, 0.0, 0.0, 0.0, 0.0]),
        ("pitch 2 deg", [0.0, 0.0, 0.0, 0.0, tilt, 0.0]),
        ("y 20 mm, pitch 2 deg", [0.0, 0.02, 0.0, 0.0, tilt, 0.0]),
        ("x -20 mm, y 20 mm, pitch 2 deg", [-0.02, 0.02, 0.0, 0.0, tilt, 0.0]),
    ]
}

fn test_axis(m: &DockingMechanism, axis: Axis) -> Result<AxisResult, BenchError> {
    let others = if axis == Axis::X { Others::Held } else { Others::Free };
    let main = characterise(m, axis, others)?;
    let held = if axis == Axis::X { None } else { Some(characterise(m, axis, Others::Held)?) };
    let far = main.working.test.ends;
    let fast = |damping_phase| {
        run_test(
            m,
            &Cycling {
                axis,
                ends: far.map(|x| 0.9 * x),
                speed: docking_speed(axis),
                wave: Wave::Sine,
                cycles: 2,
                others,
                offset: [0.0; 6],
                damping_phase,
            },
        )
    };
    let fast = [fast(0.0)?, fast(1.0)?];
    Ok(AxisResult { unstable: instability(m, axis, far[0])?, main, held, fast })
}

/// Everything measured.
struct Results {
    name: String,
    attenuation: &'static str,
    ring_radius_m: f64,
    axes: Vec<AxisResult>,
    tangents: Vec<(&'static str, Tangent)>,
}

/// Runs the command.
pub(super) fn run(args: &MechanismArgs, json: bool) -> Result<ExitCode, Failure> {
    let (active, passive) = sides(&args.mechanism, args.passive.as_deref())?;
    let choice = args.attenuation.map(|a| match a {
        AttenuationArg::Characteristic => AttenuationChoice::Characteristic,
        AttenuationArg::Differential => AttenuationChoice::Differential,
    });
    let loaded = load_mechanism(&active, &passive, choice)?;
    if !json {
        loaded.notes.iter().for_each(|n| eprintln!("ignored {n}"));
    }
    let m = loaded.model;
    let attenuation = match &m.attenuator {
        Attenuator::Rigid => return Err(BenchError::Rigid.into()),
        Attenuator::Characteristic(_) => "characteristic",
        Attenuator::Differential(_) => "differential",
    };
    let mut wanted: Vec<Axis> = args.axis.iter().map(|a| a.axis()).collect();
    if wanted.is_empty() {
        wanted = Axis::ALL.to_vec();
    }
    wanted.sort_unstable();
    wanted.dedup();
    let mut out = Directory::new(args.out.as_deref(), &m.name)?;
    // Axes are tests of their own; the results do not depend on who runs them.
    let axes: Result<Vec<AxisResult>, BenchError> = std::thread::scope(|scope| {
        let workers: Vec<_> =
            wanted.iter().map(|axis| scope.spawn(|| test_axis(&m, *axis))).collect();
        workers
            .into_iter()
            .map(|w| w.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    });
    let tangents: Result<Vec<_>, BenchError> =
        poses().into_iter().map(|(name, q)| Ok((name, tangent(&m, &q)?))).collect();
    let results = Results {
        name: m.name.clone(),
        attenuation,
        ring_radius_m: m.active.ring.mean_radius_m,
        axes: axes?,
        tangents: tangents?,
    };
    for a in &results.axes {
        let axis = a.main.figures.axis.name();
        out.save(format!("loop_{axis}.csv"), &loop_csv(a))?;
    }
    out.save("matrices.csv".to_owned(), &matrices_csv(&results.tangents))?;
    let contact =
        CONTACT_SPEEDS.map(|v| (v, bench::contact_loop(&m.contact, CONTACT_DEPTH_M, v, 400)));
    out.save("contact.csv".to_owned(), &contact_csv(&contact))?;
    out.plots(plots::all(&results, &contact))?;
    out.finish("mechanism", &as_json(&results), &words(&results), json)
}

/// Depth of the contact loops, m.
const CONTACT_DEPTH_M: f64 = 0.01;
/// Speeds at touch of the contact loops, m/s: slow, IDSS's fastest, the paper's.
const CONTACT_SPEEDS: [f64; 3] = [0.0, 0.10, 0.35];

/// Both sides of a mechanism from any of its files.
pub(crate) fn sides(file: &Path, passive: Option<&Path>) -> Result<(PathBuf, PathBuf), Failure> {
    let urdf = file.with_extension("urdf");
    if let Some(p) = passive {
        return Ok((urdf, p.with_extension("urdf")));
    }
    let stem = urdf.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let beside = |s: &str, side: &str| urdf.with_file_name(format!("{s}{side}.urdf"));
    if let Some(s) = stem.strip_suffix("_active") {
        return Ok((urdf.clone(), beside(s, "_passive")));
    }
    if let Some(s) = stem.strip_suffix("_passive") {
        return Ok((beside(s, "_active"), urdf.clone()));
    }
    Err(Failure::Usage {
        what: format!("`{}` does not say which side of a mechanism it is", file.display()),
        remedy: "give the file of the active side and --passive FILE, or name the two \
                 …_active.urdf and …_passive.urdf"
            .to_owned(),
    })
}

const DEFLECTION: [&str; 6] =
    ["x_m", "y_m", "z_m", "rotation_x_rad", "rotation_y_rad", "rotation_z_rad"];
const REACTION: [&str; 6] =
    ["force_x_n", "force_y_n", "force_z_n", "moment_x_nm", "moment_y_nm", "moment_z_nm"];

fn loop_csv(a: &AxisResult) -> String {
    let mut out = format!(
        "test,other_axes,cycle,time_s,{},{},stored_j,lost_j,work_j\n",
        DEFLECTION.join(","),
        REACTION.join(",")
    );
    let mut add = |name: &str, r: &Record| {
        let others = if r.test.others == Others::Held { "held" } else { "free" };
        for s in &r.samples {
            let _ = write!(out, "{name},{others},{},{:.6}", s.cycle, s.time_s);
            for x in s.deflection.iter().chain(&s.reaction).chain(&[s.stored_j, s.lost_j, s.work_j])
            {
                let _ = write!(out, ",{x:.6e}");
            }
            out.push('\n');
        }
    };
    for t in core::iter::once(&a.main).chain(&a.held) {
        add("soft", &t.soft);
        add("working", &t.working);
        add("stops", &t.stops);
    }
    add("docking_speed_before_capture", &a.fast[0]);
    add("docking_speed_after_capture", &a.fast[1]);
    out
}

fn matrices_csv(tangents: &[(&'static str, Tangent)]) -> String {
    let mut out = String::from("pose,matrix,row,column,value,unit,coupling\n");
    for (pose, t) in tangents {
        for (name, a) in matrices(t) {
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
                        "\"{pose}\",{name},{},{},{x:.9e},{unit},{:.6}",
                        Axis::ALL[i].name(),
                        Axis::ALL[j].name(),
                        coupling(a, i, j)
                    );
                }
            }
        }
    }
    out
}

fn matrices(t: &Tangent) -> [(&'static str, &Matrix6); 3] {
    [
        ("stiffness", &t.stiffness),
        ("damping_before_capture", &t.damping_before),
        ("damping_after_capture", &t.damping_after),
    ]
}

fn contact_csv(loops: &[(f64, Vec<[f64; 2]>)]) -> String {
    let mut out = String::from("speed_at_touch_m_s,depth_m,force_n\n");
    for (v, points) in loops {
        for [d, f] in points {
            let _ = writeln!(out, "{v},{d:.9e},{f:.9e}");
        }
    }
    out
}

/// Couplings above this are told.
const TELL: f64 = 0.05;

/// The largest couplings of a matrix, largest first; a lost stiffness has none.
fn couplings(a: &Matrix6) -> Vec<(usize, usize, f64)> {
    let mut out: Vec<(usize, usize, f64)> = (0..6)
        .flat_map(|i| (0..i).map(move |j| (j, i)))
        .map(|(j, i)| (j, i, coupling(a, j, i)))
        .filter(|c| c.2.abs() > TELL)
        .collect();
    out.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
    out
}

/// Stiffness of X over that of the stiffest other axis, rotations over the ring's radius squared.
fn stiffest_other(r: &Results) -> Option<(f64, Axis, f64)> {
    let k = |a: &AxisResult| {
        let f = &a.main.figures;
        if f.axis.turns() {
            f.soft_stiffness / (r.ring_radius_m * r.ring_radius_m)
        } else {
            f.soft_stiffness
        }
    };
    let x = r.axes.iter().find(|a| a.main.figures.axis == Axis::X).map(k)?;
    let other = r
        .axes
        .iter()
        .filter(|a| a.main.figures.axis != Axis::X)
        .max_by(|a, b| k(a).total_cmp(&k(b)))?;
    Some((x, other.main.figures.axis, k(other)))
}

fn as_json(r: &Results) -> Value {
    let axes: Vec<Value> = r
        .axes
        .iter()
        .map(|a| {
            let one = |t: &AxisTests| {
                let f = &t.figures;
                json!({
                    "other_axes": if f.others == Others::Held { "held" } else { "free" },
                    "travel": f.travel,
                    "soft_stiffness": f.soft_stiffness,
                    "soft_amplitude": f.soft_amplitude,
                    "dry_friction": f.friction,
                    "brake_slips_at": f.slip.map(|s| s[0]),
                    "brake_slips_with": f.slip.map(|s| s[1]),
                    "working_stiffness": f.working_stiffness,
                    "secant_stiffness": f.secant_stiffness,
                    "reaction_at_travel_end": f.end_reaction,
                    "stop_stiffness": f.stop_stiffness,
                    "lost_per_cycle_j": f.cycle_loss_j,
                    "work_of_one_stroke_j": f.stroke_work_j,
                })
            };
            let axis = a.main.figures.axis;
            json!({
                "axis": axis.name(),
                "units": if axis.turns() { "rad, N m, J" } else { "m, N, J" },
                "as_in_a_docking": one(&a.main),
                "others_held": a.held.as_ref().map(one),
                "lost_per_cycle_at_docking_speed_j": {
                    "speed": docking_speed(axis),
                    "before_capture": a.fast[0].cycle_lost_j.last(),
                    "after_capture": a.fast[1].cycle_lost_j.last(),
                },
                "unstable_from": a.unstable.map(|u| json!({
                    "at": u.at,
                    "reaction": u.reaction,
                    "weakest_axis": u.weakest.name(),
                    "its_stiffness": u.stiffness,
                })),
            })
        })
        .collect();
    let tangents: Vec<Value> = r
        .tangents
        .iter()
        .map(|(pose, t)| {
            let mut v = json!({ "pose": pose, "deflection": t.deflection, "reaction": t.reaction });
            for (name, a) in matrices(t) {
                v[name] = json!(a);
            }
            v
        })
        .collect();
    json!({
        "mechanism": r.name,
        "attenuation": r.attenuation,
        "axes": axes,
        "matrices": tangents,
        "stiffest_in_x_by": stiffest_other(r).map(|(x, _, k)| x / k),
    })
}

fn words(r: &Results) -> String {
    let mut out = format!(
        "{}, {} attenuation: the ring on the bench\n\
         moved slowly before capture, unless said otherwise; the reaction is that of the bench\n",
        r.name, r.attenuation
    );
    for a in &r.axes {
        axis_words(a, &mut out);
    }
    out.push_str("couplings (0 none, 1 as strong as the axes themselves), brakes holding\n");
    for (pose, t) in &r.tangents {
        for (name, a) in matrices(t) {
            let lost: Vec<&str> =
                (0..6).filter(|i| a[*i][*i] <= 0.0).map(|i| Axis::ALL[i].name()).collect();
            let all: Vec<String> = couplings(a)
                .into_iter()
                .take(4)
                .map(|(i, j, c)| format!("{}–{} {c:.2}", Axis::ALL[i].name(), Axis::ALL[j].name()))
                .collect();
            let mut told = if all.is_empty() { "none".to_owned() } else { all.join(", ") };
            if !lost.is_empty() {
                let _ = write!(told, "; negative on {}", lost.join(", "));
            }
            let _ = writeln!(out, "  {pose:31} {:23} {told}", name.replace('_', " "));
        }
    }
    if let Some((x, other, k)) = stiffest_other(r) {
        let verdict = if x > 10.0 * k {
            "stiff in x and soft in the others, as the paper says"
        } else {
            "NOT stiff in x and soft in the others, as the paper says it should be"
        };
        let _ = writeln!(
            out,
            "shape          {verdict}: {} against {} of {} at the ring's radius, {:.0} times",
            say(x, "N/m"),
            say(k, "N/m"),
            other.name(),
            x / k
        );
    }
    out
}

fn axis_words(a: &AxisResult, out: &mut String) {
    let f = &a.main.figures;
    let (x, force) = if f.axis.turns() { ("rad", "N m") } else { ("m", "N") };
    let k = format!("{force}/{x}");
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "  {name:12} {text}");
    };
    let others = if f.others == Others::Held { "held" } else { "free" };
    line(f.axis.name(), format!("(other axes {others})"));
    line(
        "  soft",
        format!(
            "{} within ±{}, dry friction {}",
            say(f.soft_stiffness, &k),
            say(f.soft_amplitude, x),
            say(f.friction, force)
        ),
    );
    if let Some([at, with]) = f.slip {
        line("  brake", format!("slips from {} on, with {}", say(at, x), say(with, force)));
    }
    let end = |i: usize| {
        f.travel[i].map_or("no end found".to_owned(), |t| {
            format!("{} ({})", say(t, x), say(f.end_reaction[i], force))
        })
    };
    line("  working", format!("{} in the outer half of the travel", say(f.working_stiffness, &k)));
    line("  travel", format!("{} to {}", end(0), end(1)));
    line("  end stop", say(f.stop_stiffness, &k));
    line(
        "  energy",
        format!(
            "{} taken in one stroke; lost in a cycle {} slowly, {} before and {} after capture at {}",
            say(f.stroke_work_j, "J"),
            say(f.cycle_loss_j, "J"),
            say(a.fast[0].cycle_lost_j.last().copied().unwrap_or(0.0), "J"),
            say(a.fast[1].cycle_lost_j.last().copied().unwrap_or(0.0), "J"),
            if f.axis.turns() {
                format!("{:.1} deg/s", docking_speed(f.axis).to_degrees())
            } else {
                format!("{:.2} m/s", docking_speed(f.axis))
            }
        ),
    );
    if let Some(h) = &a.held {
        let h = &h.figures;
        let peak = h.end_reaction[1];
        if (peak / f.end_reaction[1] - 1.0).abs() > 0.02 {
            line(
                "  held",
                format!(
                    "with the other axes held {} at {}",
                    say(peak, force),
                    h.travel[1].map_or("no end found".to_owned(), |t| say(t, x))
                ),
            );
        }
    }
    if let Some(u) = a.unstable {
        line(
            "  gives way",
            format!(
                "from {} on ({}): the ring leans over, the stiffness of {} is lost, unless \
                 something else holds it",
                say(u.at, x),
                say(u.reaction, force),
                u.weakest.name()
            ),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_sides_are_found_from_any_file() {
        let pair = |f: &str| sides(Path::new(f), None).ok();
        let want = Some((PathBuf::from("m/a_active.urdf"), PathBuf::from("m/a_passive.urdf")));
        for f in ["m/a_active.urdf", "m/a_active.toml", "m/a_passive.toml", "m/a_passive.urdf"] {
            assert_eq!(pair(f), want, "{f}");
        }
        assert_eq!(pair("m/ring.urdf"), None);
    }
}
