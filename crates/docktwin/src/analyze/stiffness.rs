//! `analyze stiffness`: how the closed loop moves with the stiffness of its payload, (11).

use core::fmt::Write as _;
use std::process::ExitCode;

use docktwin_control::{
    linear::{LinearRig, Pole},
    response::{Bench, Point},
};
use docktwin_core::DVec3;
use docktwin_model::{HydraulicPreset, Place};
use docktwin_plot::{Axis, Colour, Line, Marker, Plot, PlotError, Points};
use serde_json::{Value, json};

use super::{
    Results,
    bode::{MODAL_HZ, PAPER_HZ, PAYLOAD_N_M, in_parallel},
    plots::sheet,
    rig::{Changes, DOFS, Subject, at_json, middle_and_corners, singular},
};
use crate::{cli::StiffnessArgs, failure::Failure};

/// Directions of the payload's spring.
const DIRECTIONS: [(&str, DVec3); 2] = [("axial", DVec3::X), ("lateral", DVec3::Y)];

/// Stiffnesses of the pole map, N/m.
fn stiffnesses() -> Vec<f64> {
    // Eight in a decade: dots that the eye joins.
    core::iter::once(0.0)
        .chain((0..=24).map(|n| PAYLOAD_N_M * 10f64.powf(f64::from(n) / 8.0 - 3.0)))
        .collect()
}

/// Poles and 10 Hz response in the middle against one stiffness.
struct Step {
    n_m: f64,
    poles: Vec<Pole>,
    points: [Point; 6],
}

/// A change, the degree of freedom and the place where it is largest.
type Change = (f64, usize, Place);

/// A preset against a payload in one direction.
struct Course {
    steps: Vec<Step>,
    /// Least modal damping over the middle and all corners, free and against the stiffest payload.
    damping: [(f64, Place); 2],
    /// Slowest pole, likewise, Hz.
    slowest_hz: [(f64, Place); 2],
    /// Largest change of |G| at 10 Hz from free to the stiffest, dB, degree of freedom, place.
    gain_db: Change,
    /// Largest change of its phase, degrees.
    phase_deg: Change,
    /// The same with the bulk modulus half as large again.
    stiffer_oil: [f64; 2],
}

/// Factor of the bulk modulus of oil without air.
const WITHOUT_AIR: f64 = 1.5;

struct Found {
    subject: Subject,
    courses: [Course; 2],
}

/// The loop of a subject.
struct Loop<'a> {
    subject: &'a Subject,
    bench: Bench,
}

impl<'a> Loop<'a> {
    fn new(subject: &'a Subject, changes: &Changes) -> Self {
        let setup = subject.setup(changes);
        let lever_m = setup.platform.plate_radius_m();
        let bench = Bench {
            x_34: subject.file.docking.pose([0.0; 6]),
            setup,
            payload_n_m: DVec3::ZERO,
            lever_m,
            foreseen: false,
        };
        Self { subject, bench }
    }

    fn at(&self, place: Place, payload_n_m: DVec3) -> Option<(Bench, LinearRig)> {
        let bench = Bench {
            x_34: self.subject.file.docking.pose(place.0),
            payload_n_m,
            ..self.bench.clone()
        };
        let linear = bench.linear()?;
        Some((bench, linear))
    }

    /// Response at 10 Hz from every degree of freedom.
    fn paper_points(&self, place: Place, payload_n_m: DVec3) -> Option<[Point; 6]> {
        let (bench, linear) = self.at(place, payload_n_m)?;
        bench.linear_points(&linear, PAPER_HZ)
    }

    /// Largest changes at 10 Hz over the middle and all corners.
    fn change(&self, way: DVec3) -> Option<(Change, Change)> {
        let none: Change = (0.0, 0, Place([0.0; 6]));
        let (mut gain, mut phase) = (none, none);
        for place in middle_and_corners() {
            let free = self.paper_points(place, DVec3::ZERO)?;
            let stiff = self.paper_points(place, way * PAYLOAD_N_M)?;
            for dof in 0..6 {
                let db = stiff[dof].gain_db(dof) - free[dof].gain_db(dof);
                let deg = stiff[dof].phase_deg(dof) - free[dof].phase_deg(dof);
                if db.abs() > gain.0.abs() {
                    gain = (db, dof, place);
                }
                if deg.abs() > phase.0.abs() {
                    phase = (deg, dof, place);
                }
            }
        }
        Some((gain, phase))
    }

    /// Least damping of modes and slowest pole over the middle and all corners.
    fn margins(&self, payload_n_m: DVec3) -> Option<[(f64, Place); 2]> {
        let mut out = [(f64::INFINITY, Place([0.0; 6])); 2];
        for place in middle_and_corners() {
            for p in modal(&self.at(place, payload_n_m)?.1.poles()?) {
                for (worst, value) in out.iter_mut().zip([p.damping, p.frequency_hz]) {
                    if value < worst.0 {
                        *worst = (value, place);
                    }
                }
            }
        }
        Some(out)
    }
}

fn modal(poles: &[Pole]) -> Vec<Pole> {
    poles.iter().filter(|p| p.frequency_hz < MODAL_HZ).copied().collect()
}

impl Found {
    fn new(subject: Subject, changes: &Changes) -> Option<Self> {
        let l = Loop::new(&subject, changes);
        let mut softer = subject.file.clone();
        softer.hydraulics.bulk_modulus_pa *= WITHOUT_AIR;
        let without_air = Subject::of(softer, subject.preset, subject.seed);
        let airless = Loop::new(&without_air, changes);
        let free = l.margins(DVec3::ZERO)?;
        let course = |way: DVec3| {
            let steps: Option<Vec<Step>> = stiffnesses()
                .into_iter()
                .map(|n_m| {
                    let (bench, linear) = l.at(Place([0.0; 6]), way * n_m)?;
                    Some(Step {
                        n_m,
                        poles: linear.poles()?,
                        points: bench.linear_points(&linear, PAPER_HZ)?,
                    })
                })
                .collect();
            let held = l.margins(way * PAYLOAD_N_M)?;
            let (gain_db, phase_deg) = l.change(way)?;
            let airless = airless.change(way)?;
            Some(Course {
                steps: steps?,
                damping: [free[0], held[0]],
                slowest_hz: [free[1], held[1]],
                gain_db,
                phase_deg,
                stiffer_oil: [airless.0.0, airless.1.0],
            })
        };
        let [axial, lateral] = DIRECTIONS.map(|(_, way)| course(way));
        let courses = [axial?, lateral?];
        Some(Self { subject, courses })
    }

    /// Stable everywhere, at both ends and on the way.
    fn stable(&self) -> bool {
        self.courses.iter().all(|c| {
            c.damping.iter().all(|d| d.0 > 0.0)
                && c.steps.iter().all(|s| s.poles.iter().all(|p| p.s[0] < 0.0))
        })
    }

    /// Least modal damping of all.
    fn damping(&self) -> f64 {
        self.courses.iter().flat_map(|c| c.damping).map(|d| d.0).fold(1.0, f64::min)
    }
}

/// Runs the command.
pub(super) fn run(args: &StiffnessArgs, json: bool) -> Result<ExitCode, Failure> {
    let (subject, changes) = Subject::load_and_change(&args.rig, &args.set, json)?;
    let mut out =
        Results::new(args.rig.out.as_deref(), &format!("{}-stiffness", subject.rig.name))?;
    let presets: Vec<HydraulicPreset> = match args.rig.preset {
        Some(p) => vec![p.preset()],
        None => HydraulicPreset::WORDS.iter().map(|(_, p)| *p).collect(),
    };
    let found = in_parallel(presets.len(), json, |i| {
        Found::new(subject.with(presets[i]), &changes).ok_or_else(singular)
    })?;
    out.save("poles.csv".to_owned(), &poles_csv(&found))?;
    out.save("response.csv".to_owned(), &response_csv(&found))?;
    out.plots(plot(&found).map(|svg| vec![("poles.svg".to_owned(), svg)]))?;
    out.finish("stiffness", &as_json(&subject, &found), &words(&subject, &found), json)
}

/// Every course with its preset and direction.
fn courses(found: &[Found]) -> impl Iterator<Item = (&Found, &'static str, &Course)> {
    found
        .iter()
        .flat_map(|f| DIRECTIONS.iter().zip(&f.courses).map(move |((name, _), c)| (f, *name, c)))
}

fn poles_csv(found: &[Found]) -> String {
    let mut out = String::from(
        "preset,payload,stiffness_n_m,frequency_hz,damping_ratio,real_rad_s,imaginary_rad_s\n",
    );
    for (f, name, c) in courses(found) {
        for s in &c.steps {
            for p in &s.poles {
                let _ = writeln!(
                    out,
                    "{},{name},{:.6e},{:.5},{:.6},{:.5},{:.5}",
                    f.subject.preset.word(),
                    s.n_m,
                    p.frequency_hz,
                    p.damping,
                    p.s[0],
                    p.s[1]
                );
            }
        }
    }
    out
}

fn response_csv(found: &[Found]) -> String {
    let mut out = String::from("preset,payload,stiffness_n_m,dof,gain_10_hz_db,phase_10_hz_deg\n");
    for (f, name, c) in courses(found) {
        for s in &c.steps {
            for (dof, p) in s.points.iter().enumerate() {
                let _ = writeln!(
                    out,
                    "{},{name},{:.6e},{},{:.5},{:.4}",
                    f.subject.preset.word(),
                    s.n_m,
                    DOFS[dof],
                    p.gain_db(dof),
                    p.phase_deg(dof)
                );
            }
        }
    }
    out
}

/// Poles of steps, in Hz; without mirror images below the real axis, and where they move less than is
/// seen, one stands for all.
fn drawn(steps: &[Step]) -> Vec<[f64; 2]> {
    let mut out: Vec<[f64; 2]> = Vec::new();
    for p in steps.iter().flat_map(|s| &s.poles) {
        let at = p.s.map(|x| x / core::f64::consts::TAU);
        let new = out.iter().all(|q| (q[0] - at[0]).hypot(q[1] - at[1]) > 0.03);
        if p.s[1] >= 0.0 && p.frequency_hz < 200.0 && new {
            out.push(at);
        }
    }
    out
}

fn plot(found: &[Found]) -> Result<String, PlotError> {
    // Of every preset: without payload, against rising axial and lateral payloads, and the stiffest.
    let maps: Vec<[Vec<[f64; 2]>; 5]> = found
        .iter()
        .map(|f| {
            let [axial, lateral] = f.courses.each_ref().map(|c| c.steps.as_slice());
            let end = |steps: &[Step]| drawn(&steps[steps.len() - 1..]);
            [drawn(&axial[..1]), drawn(axial), drawn(lateral), end(axial), end(lateral)]
        })
        .collect();
    // Damping ratio 0.1 is a ray from the origin.
    let least = [[0.0, 0.0], [-20.0, 20.0 * (1.0f64 / 0.01 - 1.0).sqrt()]];
    let mut rows: Vec<Vec<Plot<'_>>> = Vec::new();
    for (f, [free, axial, lateral, stiff_axial, stiff_lateral]) in found.iter().zip(&maps) {
        let whole = (Axis::new("real part / 2π", "Hz"), Axis::new("imaginary part / 2π", "Hz"));
        let near = (whole.0.clone().range(-16.0..1.0), whole.1.clone().range(-1.0..16.0));
        let deepest = free.iter().map(|p| p[0]).fold(-1.0, f64::min);
        let highest = free.iter().map(|p| p[1]).fold(1.0, f64::max);
        let whole = (
            whole.0.range(1.05 * deepest..-0.05 * deepest),
            whole.1.range(-0.05 * highest..1.1 * highest),
        );
        let word = f.subject.preset.word();
        let row = [
            (format!("Closed-loop poles, {word}, in the middle"), whole),
            ("The slow ones, larger".to_owned(), near),
        ]
        .map(|(title, (x, y))| {
            Plot::new(title)
                .x_axis(x)
                .y_axis(y)
                .size(480.0, 230.0)
                .margin_left(56.0)
                .line(Line::new("damping 0.1", &least).colour(Colour::Grey).width(1.0))
                .marker(Marker::new(0.0, "unstable"))
                .points(Points::new("no payload", free).colour(Colour::Blue).radius(4.5))
                .points(Points::new("", axial).colour(Colour::Vermilion).radius(1.2))
                .points(Points::new("", lateral).colour(Colour::Green).radius(1.2))
                .points(
                    Points::new("1e6 N/m axial", stiff_axial).colour(Colour::Vermilion).radius(3.0),
                )
                .points(
                    Points::new("1e6 N/m lateral", stiff_lateral).colour(Colour::Green).radius(1.8),
                )
        });
        rows.push(row.into());
    }
    // Change at 10 Hz in the direction of the payload.
    let change: Vec<[Vec<[f64; 2]>; 2]> = courses(found)
        .map(|(_, name, c)| {
            let dof = usize::from(name != DIRECTIONS[0].0);
            let free = &c.steps[0].points[dof];
            let curve = |value: &dyn Fn(&Point) -> f64| {
                c.steps[1..].iter().map(|s| [s.n_m, value(&s.points[dof])]).collect()
            };
            [
                curve(&|p| p.gain_db(dof) - free.gain_db(dof)),
                curve(&|p| p.phase_deg(dof) - free.phase_deg(dof)),
            ]
        })
        .collect();
    let mut last = Vec::new();
    for (k, (title, y)) in [
        ("Change of |G| at 10 Hz along the payload", Axis::new("change", "dB").at_least(0.2)),
        ("Change of its phase", Axis::new("change", "deg").at_least(2.0)),
    ]
    .into_iter()
    .enumerate()
    {
        let mut p = Plot::new(title)
            .x_axis(Axis::new("stiffness of the payload", "N/m").log())
            .y_axis(y)
            .size(480.0, 170.0);
        for ((f, name, _), curves) in courses(found).zip(&change) {
            p = p.line(Line::new(format!("{}, {name}", f.subject.preset.word()), &curves[k]));
        }
        last.push(p);
    }
    rows.push(last);
    let rows: Vec<&[Plot<'_>]> = rows.iter().map(Vec::as_slice).collect();
    sheet(&rows)
}

fn as_json(subject: &Subject, found: &[Found]) -> Value {
    let changed = |c: Change| json!({ "value": c.0, "dof": DOFS[c.1], "at": c.2.0 });
    let presets: Vec<Value> = found
        .iter()
        .map(|f| {
            let payloads: Vec<Value> = DIRECTIONS
                .iter()
                .zip(&f.courses)
                .map(|((name, _), c)| {
                    json!({
                        "payload": name,
                        "least_modal_damping": c.damping.map(at_json),
                        "slowest_pole_hz": c.slowest_hz.map(at_json),
                        "gain_change_10_hz_db": changed(c.gain_db),
                        "phase_change_10_hz_deg": changed(c.phase_deg),
                        "with_bulk_modulus_times": WITHOUT_AIR,
                        "then_gain_change_10_hz_db": c.stiffer_oil[0],
                        "then_phase_change_10_hz_deg": c.stiffer_oil[1],
                    })
                })
                .collect();
            json!({
                "preset": f.subject.preset.word(),
                "oil_spring_n_m": f.subject.oil_spring_n_m(),
                "stiffness_ratio": PAYLOAD_N_M / f.subject.oil_spring_n_m(),
                "stable": f.stable(),
                "least_modal_damping": f.damping(),
                "payloads": payloads,
            })
        })
        .collect();
    json!({ "rig": subject.rig.name, "seed": subject.seed, "presets": presets })
}

fn words(subject: &Subject, found: &[Found]) -> String {
    let mut out = format!(
        "{}: closed loop against a payload of 0 to 1e6 N/m at the port, linear model, middle and 64 \
         corners\n",
        subject.rig.name
    );
    for f in found {
        let _ = writeln!(
            out,
            "{:14} {}, modal damping at least {:.3}; K/K_h = {:.4} at 1e6 N/m",
            f.subject.preset.word(),
            if f.stable() { "stable" } else { "UNSTABLE" },
            f.damping(),
            PAYLOAD_N_M / f.subject.oil_spring_n_m()
        );
        for ((name, _), c) in DIRECTIONS.iter().zip(&f.courses) {
            let _ = writeln!(
                out,
                "  {name:12} least damping {:.3} to {:.3}, slowest pole {:.2} to {:.2} Hz; at 10 Hz \
                 {:+.2} dB ({} at {}), {:+.1} deg ({} at {})",
                c.damping[0].0,
                c.damping[1].0,
                c.slowest_hz[0].0,
                c.slowest_hz[1].0,
                c.gain_db.0,
                DOFS[c.gain_db.1],
                c.gain_db.2,
                c.phase_deg.0,
                DOFS[c.phase_deg.1],
                c.phase_deg.2
            );
            let _ = writeln!(
                out,
                "  {:12} with {WITHOUT_AIR} times the bulk modulus {:+.2} dB, {:+.1} deg",
                "", c.stiffer_oil[0], c.stiffer_oil[1]
            );
        }
    }
    out
}
