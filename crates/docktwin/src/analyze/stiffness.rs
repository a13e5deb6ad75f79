//! `analyze stiffness`: how the closed loop moves with the stiffness of its payload, (11).

use core::fmt::Write as _;
use std::process::ExitCode;

use clap::Args;
use docktwin_plot::{Axis, Colour, Line, Marker, Plot, PlotError, Points};
use docktwin_study::rig::{
    Dof, Payload, ResponsePoint, Stiffness, StiffnessOptions, StiffnessSeries, StiffnessStep,
    stiffness,
};

use super::{
    plots::sheet,
    rig::{RigArgs, build, load_and_change},
};
use crate::{
    failure::Failure,
    results::{Bars, Results},
};

pub(super) const EXAMPLES: &str = "\
Poles and 10 Hz response of the linear model, controllers, sampling and dead time included,
against a spring of 0 to 1e6 N/m at the port, along X (axial) and along Y (lateral): in the
middle at many stiffnesses, at the 64 corners at both ends. Beside it the same with the bulk
modulus half as large again, as the paper's oil without air. Takes a few seconds.

Keys of --set: as of `docktwin analyze bode`.

The directory holds poles.csv, response.csv, poles.svg and stiffness.json (what --json prints).

Examples:
  docktwin analyze stiffness models/urdf/stewart.toml
  docktwin analyze stiffness models/urdf/stewart.toml --preset printed --out poles --json
  docktwin analyze stiffness models/urdf/stewart.toml --set damping_ratio=0.3 --set high_pass_hz=2";

/// Options of `analyze stiffness`.
#[derive(Debug, Args)]
pub(crate) struct StiffnessArgs {
    #[command(flatten)]
    rig: RigArgs,
    /// Override a setting of the leg control, repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// Runs the command.
pub(super) fn run(args: &StiffnessArgs, json: bool) -> Result<ExitCode, Failure> {
    let (rig, leg_control) = load_and_change(&args.rig, &args.set, json)?;
    let mut out = Results::new(args.rig.out.as_deref(), &format!("{}-stiffness", rig.name))?;
    let options = StiffnessOptions { build: build(&args.rig), leg_control };
    let found = stiffness(&rig, &options, &mut Bars::new(json))?;
    out.save("poles.csv".to_owned(), &poles_csv(&found))?;
    out.save("response.csv".to_owned(), &response_csv(&found))?;
    out.plots(plot(&found).map(|svg| vec![("poles.svg".to_owned(), svg)]))?;
    out.finish("stiffness", &found.summary, &words(&found), json)
}

fn poles_csv(found: &Stiffness) -> String {
    let mut out = String::from(
        "preset,payload,stiffness_n_m,frequency_hz,damping_ratio,real_rad_s,imaginary_rad_s\n",
    );
    for c in &found.series {
        for s in &c.steps {
            for p in &s.poles {
                // Writing to a String cannot fail.
                let _ = writeln!(
                    out,
                    "{},{},{:.6e},{:.5},{:.6},{:.5},{:.5}",
                    c.preset.word(),
                    c.payload.name(),
                    s.stiffness_n_m,
                    p.frequency_hz,
                    p.damping_ratio,
                    p.real_rad_s,
                    p.imaginary_rad_s
                );
            }
        }
    }
    out
}

fn response_csv(found: &Stiffness) -> String {
    let mut out = String::from("preset,payload,stiffness_n_m,dof,gain_10_hz_db,phase_10_hz_deg\n");
    for c in &found.series {
        for s in &c.steps {
            for (dof, p) in Dof::ALL.into_iter().zip(&s.response_10_hz) {
                let _ = writeln!(
                    out,
                    "{},{},{:.6e},{dof},{:.5},{:.4}",
                    c.preset.word(),
                    c.payload.name(),
                    s.stiffness_n_m,
                    p.gain_db(dof),
                    p.phase_deg(dof)
                );
            }
        }
    }
    out
}

type Curve = Vec<[f64; 2]>;

/// Poles of steps, in Hz; without mirror images below the real axis, and where they move less than is
/// seen, one stands for all.
fn drawn(steps: &[StiffnessStep]) -> Curve {
    let mut out: Curve = Vec::new();
    for p in steps.iter().flat_map(|s| &s.poles) {
        let at = [p.real_rad_s, p.imaginary_rad_s].map(|x| x / core::f64::consts::TAU);
        let new = out.iter().all(|q| (q[0] - at[0]).hypot(q[1] - at[1]) > 0.03);
        if p.imaginary_rad_s >= 0.0 && p.frequency_hz < 200.0 && new {
            out.push(at);
        }
    }
    out
}

/// Poles of one preset: without payload, against rising axial and lateral payloads, and the stiffest
/// of both.
struct PoleMap<'a> {
    preset: &'a str,
    curves: [Curve; 5],
}

impl<'a> PoleMap<'a> {
    /// Series come in pairs, axial and lateral.
    fn new(pair: &'a [StiffnessSeries]) -> Option<Self> {
        let [axial, lateral] = pair else { return None };
        let end = |c: &StiffnessSeries| drawn(&c.steps[c.steps.len() - 1..]);
        let curves = [
            drawn(&axial.steps[..1]),
            drawn(&axial.steps),
            drawn(&lateral.steps),
            end(axial),
            end(lateral),
        ];
        Some(Self { preset: axial.preset.word(), curves })
    }

    /// All poles, and the slow ones larger; `least` is the ray of damping ratio 0.1.
    fn plots(&'a self, least: &'a [[f64; 2]]) -> [Plot<'a>; 2] {
        let [free, axial, lateral, stiff_axial, stiff_lateral] = &self.curves;
        let whole = (Axis::new("real part / 2π", "Hz"), Axis::new("imaginary part / 2π", "Hz"));
        let near = (whole.0.clone().range(-16.0..1.0), whole.1.clone().range(-1.0..16.0));
        let deepest = free.iter().map(|p| p[0]).fold(-1.0, f64::min);
        let highest = free.iter().map(|p| p[1]).fold(1.0, f64::max);
        let whole = (
            whole.0.range(1.05 * deepest..-0.05 * deepest),
            whole.1.range(-0.05 * highest..1.1 * highest),
        );
        [
            (format!("Closed-loop poles, {}, in the middle", self.preset), whole),
            ("The slow ones, larger".to_owned(), near),
        ]
        .map(|(title, (x, y))| {
            Plot::new(title)
                .x_axis(x)
                .y_axis(y)
                .size(480.0, 230.0)
                .margin_left(56.0)
                .line(Line::new("damping 0.1", least).colour(Colour::Grey).width(1.0))
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
        })
    }
}

/// Change of gain (dB) and phase (degrees) at 10 Hz in the direction of the payload, over its
/// stiffness.
fn change(c: &StiffnessSeries) -> [Curve; 2] {
    let dof = if c.payload == Payload::Axial { Dof::X } else { Dof::Y };
    let curve = |value: fn(&ResponsePoint, Dof) -> f64| {
        let at = |s: &StiffnessStep| value(&s.response_10_hz[dof.index()], dof);
        let free = at(&c.steps[0]);
        c.steps[1..].iter().map(|s| [s.stiffness_n_m, at(s) - free]).collect()
    };
    [curve(ResponsePoint::gain_db), curve(ResponsePoint::phase_deg)]
}

fn plot(found: &Stiffness) -> Result<String, PlotError> {
    let maps: Vec<PoleMap<'_>> = found.series.chunks(2).filter_map(PoleMap::new).collect();
    let least = [[0.0, 0.0], [-20.0, 20.0 * (1.0f64 / 0.01 - 1.0).sqrt()]];
    let mut rows: Vec<Vec<Plot<'_>>> = maps.iter().map(|m| m.plots(&least).into()).collect();
    let changes: Vec<(&StiffnessSeries, [Curve; 2])> =
        found.series.iter().map(|c| (c, change(c))).collect();
    let last = [
        ("Change of |G| at 10 Hz along the payload", Axis::new("change", "dB").at_least(0.2)),
        ("Change of its phase", Axis::new("change", "deg").at_least(2.0)),
    ];
    let last = last.into_iter().enumerate().map(|(k, (title, y))| {
        let mut p = Plot::new(title)
            .x_axis(Axis::new("stiffness of the payload", "N/m").log())
            .y_axis(y)
            .size(480.0, 170.0);
        for (c, curves) in &changes {
            let name = format!("{}, {}", c.preset.word(), c.payload.name());
            p = p.line(Line::new(name, &curves[k]));
        }
        p
    });
    rows.push(last.collect());
    let rows: Vec<&[Plot<'_>]> = rows.iter().map(Vec::as_slice).collect();
    sheet(&rows)
}

fn words(found: &Stiffness) -> String {
    let mut out = format!(
        "{}: closed loop against a payload of 0 to 1e6 N/m at the port, linear model, middle and 64 \
         corners\n",
        found.summary.rig
    );
    for p in &found.summary.presets {
        let _ = writeln!(
            out,
            "{:14} {}, modal damping at least {:.3}; K/K_h = {:.4} at 1e6 N/m",
            p.preset.word(),
            if p.stable { "stable" } else { "UNSTABLE" },
            p.least_modal_damping,
            p.stiffness_ratio
        );
        for of in &p.payloads {
            let ([damping, held], [slowest, held_slowest]) =
                (of.least_modal_damping, of.slowest_pole_hz);
            let (gain, phase) = (&of.gain_change_10_hz_db, &of.phase_change_10_hz_deg);
            let _ = writeln!(
                out,
                "  {:12} least damping {:.3} to {:.3}, slowest pole {:.2} to {:.2} Hz; at 10 Hz \
                 {:+.2} dB ({} at {}), {:+.1} deg ({} at {})",
                of.payload.name(),
                damping.value,
                held.value,
                slowest.value,
                held_slowest.value,
                gain.value,
                gain.dof,
                gain.at,
                phase.value,
                phase.dof,
                phase.at
            );
            let _ = writeln!(
                out,
                "  {:12} with {} times the bulk modulus {:+.2} dB, {:+.1} deg",
                "",
                of.with_bulk_modulus_times,
                of.then_gain_change_10_hz_db,
                of.then_phase_change_10_hz_deg
            );
        }
    }
    out
}
