//! How the closed loop moves with the stiffness of its payload, (11).

use core::fmt::Write as _;

use docktwin_plot::{Axis, Colour, Line, Marker, Plot, PlotError, Points};
use docktwin_study::rig::{Dof, Payload, ResponsePoint, Stiffness, StiffnessSeries, StiffnessStep};

use super::{NamedText, sheet::sheet};

/// `poles.csv` and `response.csv`.
#[must_use]
pub fn tables(found: &Stiffness) -> Vec<NamedText> {
    vec![
        ("poles.csv".to_owned(), poles_csv(found)),
        ("response.csv".to_owned(), response_csv(found)),
    ]
}

/// `poles.svg`.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn plots(found: &Stiffness) -> Result<Vec<NamedText>, PlotError> {
    Ok(vec![("poles.svg".to_owned(), plot(found)?)])
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

/// The answer in words.
#[must_use]
pub fn words(found: &Stiffness) -> String {
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
