//! `analyze bode`: frequency response of the running rig, its linear model laid over it, and whether
//! the requirements hold.

use core::fmt::Write as _;
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use docktwin_plot::{Axis, Colour, Dash, Line, Plot, PlotError};
use docktwin_study::rig::{
    Bode, BodeOptions, Dof, FLAT_HZ, LegControl, MeasuredResponse, Payload, Places, ResponsePoint,
    WorstAt, WorstResponse, bode,
};

use super::{
    plots::sheet,
    rig::{PLACE_COLUMNS, RigArgs, build, load_and_change, place_csv, title},
};
use crate::{
    args::AxisArg,
    failure::Failure,
    results::{Bars, Results},
};

pub(super) const EXAMPLES: &str = "\
One degree of freedom of the port is driven by a repeated swept sine on the running, nonlinear
rig, its control, friction and dead time included, and all six are measured. Required: at 10 Hz
at most 2 dB and 70 degrees; from 0.5 to 5 Hz |G| within 10 % (stiff: 5 %) and at most 0.15 in
other degrees of freedom; modal damping of at least 0.1. Rotations count at the radius of the
plate joints.

What is measured is where --places says; the linear model covers the middle and all 64 corners,
and takes the legs of a drawn rig to be as the first one. On two cores `middle` takes 20
seconds, `sample` (and five corners) two minutes, `all` (and 64 corners) 20 minutes; one payload
takes a third of it.

Keys of --set: position_gain_1_s, damping_ratio (of pressure feedback at 2500 kg), high_pass_hz,
valve_lead_hz (0: none), rate_hz, dead_time_s.

The directory holds bode.csv, poles.csv, bode_DOF.svg (Fig. 39 and 40 of the paper) and
bode.json (what --json prints).

Examples:
  docktwin analyze bode models/urdf/stewart.toml --dof x --dof y
  docktwin analyze bode models/urdf/stewart.toml --preset stiff --places sample --payload none
  docktwin analyze bode models/urdf/stewart.toml --seed 7 --set position_gain_1_s=20 --json";

/// Options of `analyze bode`.
#[derive(Debug, Args)]
pub(crate) struct BodeArgs {
    #[command(flatten)]
    rig: RigArgs,
    /// Where in the docking workspace to measure
    #[arg(long, value_enum, default_value_t = PlacesArg::Middle)]
    places: PlacesArg,
    /// Spring of 1e6 N/m at the port
    #[arg(long, value_enum, default_value_t = PayloadArg::All)]
    payload: PayloadArg,
    /// Degree of freedom to drive, repeatable [default: all]
    #[arg(long, value_enum)]
    dof: Vec<AxisArg>,
    /// Amplitude, mm; of a rotation at the radius of the plate joints
    #[arg(long, value_name = "MM", default_value_t = 2.0, value_parser = amplitude_mm)]
    amplitude_mm: f64,
    /// Override a setting of the leg control, repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Give the wanted motion ahead by the valve's delay, as a predictor knows it
    #[arg(long)]
    foreseen: bool,
    /// Leave out friction, null bias and orifice: the linear range
    #[arg(long)]
    ideal: bool,
}

fn amplitude_mm(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x <= 50.0 => Ok(x),
        _ => Err("an amplitude is a number of millimetres above 0, at most 50".to_owned()),
    }
}

/// Where in the docking workspace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PlacesArg {
    /// Its middle
    Middle,
    /// Its middle and five corners
    Sample,
    /// Its middle and all 64 corners
    All,
}

/// What the plate touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PayloadArg {
    /// Nothing
    None,
    /// A spring along X
    Axial,
    /// A spring along Y
    Lateral,
    /// One after the other
    All,
}

/// What the arguments ask for.
fn options(args: &BodeArgs, leg_control: LegControl) -> BodeOptions {
    let dofs: Vec<Dof> = args.dof.iter().map(|d| Dof::ALL[d.axis().index()]).collect();
    BodeOptions {
        build: build(&args.rig),
        places: match args.places {
            PlacesArg::Middle => Places::Middle,
            PlacesArg::Sample => Places::Sample,
            PlacesArg::All => Places::All,
        },
        payloads: match args.payload {
            PayloadArg::None => vec![Payload::None],
            PayloadArg::Axial => vec![Payload::Axial],
            PayloadArg::Lateral => vec![Payload::Lateral],
            PayloadArg::All => Payload::ALL.to_vec(),
        },
        dofs: if dofs.is_empty() { Dof::ALL.to_vec() } else { dofs },
        amplitude_m: args.amplitude_mm * 1e-3,
        leg_control,
        foreseen: args.foreseen,
        linear_range: args.ideal,
    }
}

/// Runs the command.
pub(super) fn run(args: &BodeArgs, json: bool) -> Result<ExitCode, Failure> {
    let (rig, changes) = load_and_change(&args.rig, &args.set, json)?;
    let mut out = Results::new(args.rig.out.as_deref(), &format!("{}-bode", rig.name))?;
    let found = bode(&rig, &options(args, changes), &mut Bars::new(json))?;
    out.save("bode.csv".to_owned(), &csv(&found, &rig.docking))?;
    out.save("poles.csv".to_owned(), &poles_csv(&found))?;
    let drawn: Result<Vec<_>, PlotError> = Dof::ALL
        .into_iter()
        .filter(|dof| found.responses.iter().any(|r| r.dof == *dof))
        .map(|dof| Ok((format!("bode_{}.svg", dof.name().to_lowercase()), plot(&found, dof)?)))
        .collect();
    out.plots(drawn)?;
    out.finish("bode", &found.summary, &words(&found), json)
}

fn csv(f: &Bode, docking: &docktwin_model::DockingWorkspace) -> String {
    let mut out = format!(
        "payload,{PLACE_COLUMNS},dof,frequency_hz,gain_db,phase_deg,coherence,largest_coupling,\
         linear_gain_db,linear_phase_deg,linear_largest_coupling\n"
    );
    for r in &f.responses {
        for (m, l) in r.measured.iter().zip(&r.linear) {
            // Writing to a String cannot fail.
            let _ = writeln!(
                out,
                "{},{},{},{},{:.5},{:.4},{:.6},{:.6},{:.5},{:.4},{:.6}",
                r.payload.name(),
                place_csv(docking, r.place),
                r.dof,
                m.hz,
                m.gain_db(r.dof),
                m.phase_deg(r.dof),
                m.coherence,
                m.cross_coupling(r.dof),
                l.gain_db(r.dof),
                l.phase_deg(r.dof),
                l.cross_coupling(r.dof)
            );
        }
    }
    out
}

fn poles_csv(f: &Bode) -> String {
    let mut out = String::from("payload,frequency_hz,damping_ratio,real_rad_s,imaginary_rad_s\n");
    for of in &f.poles {
        for p in &of.poles {
            let _ = writeln!(
                out,
                "{},{:.5},{:.6},{:.5},{:.5}",
                of.payload.name(),
                p.frequency_hz,
                p.damping_ratio,
                p.real_rad_s,
                p.imaginary_rad_s
            );
        }
    }
    out
}

type Curve = Vec<[f64; 2]>;

/// A response in the three panels: gain, phase, coherence; each measured and linear.
struct Curves<'a> {
    of: &'a MeasuredResponse,
    panels: [[Curve; 2]; 3],
}

impl<'a> Curves<'a> {
    fn new(of: &'a MeasuredResponse) -> Self {
        type Value = fn(&ResponsePoint, Dof) -> f64;
        let values: [Value; 3] =
            [ResponsePoint::gain_db, ResponsePoint::phase_deg, |p, _| p.coherence];
        let panels = values.map(|v| {
            [&of.measured, &of.linear].map(|p| p.iter().map(|p| [p.hz, v(p, of.dof)]).collect())
        });
        Self { of, panels }
    }

    fn in_the_middle(&self) -> bool {
        self.of.place.0.iter().all(|x| x.abs() < 1e-12)
    }
}

const fn colour(payload: Payload) -> Colour {
    match payload {
        Payload::None => Colour::Blue,
        Payload::Axial => Colour::Vermilion,
        Payload::Lateral => Colour::Green,
    }
}

/// What is required, as lines in the three panels.
fn limits(f: &Bode, from_hz: f64) -> [Vec<Curve>; 3] {
    let db = |g: f64| 20.0 * g.log10();
    let required = &f.summary.required;
    let flat = required.gain_error_to_5_hz;
    let at = [9.3, 10.75];
    let level = |y: f64| vec![[from_hz, y], [FLAT_HZ, y]];
    let at_10_hz = |y: f64| at.map(|hz| [hz, y]).to_vec();
    [
        vec![
            level(db(1.0 + flat)),
            level(db(1.0 - flat)),
            at_10_hz(required.gain_10_hz_db),
            at_10_hz(-required.gain_10_hz_db),
        ],
        vec![at_10_hz(-required.lag_10_hz_deg)],
        vec![],
    ]
}

/// Gain, phase and coherence of one degree of freedom, all payloads and places.
fn plot(f: &Bode, dof: Dof) -> Result<String, PlotError> {
    let shown: Vec<Curves<'_>> =
        f.responses.iter().filter(|r| r.dof == dof).map(Curves::new).collect();
    let hz: Vec<f64> = shown.iter().flat_map(|c| &c.of.measured).map(|p| p.hz).collect();
    let range =
        hz.iter().copied().fold(f64::INFINITY, f64::min)..hz.iter().copied().fold(0.0, f64::max);
    let limits = limits(f, range.start);
    let figure = match dof {
        Dof::X => " (as Fig. 39)",
        Dof::Y => " (as Fig. 40)",
        _ => "",
    };
    let axes = [
        Axis::new("gain |G|", "dB").include(-2.3).include(2.3),
        Axis::new("phase", "deg").include(-75.0).include(5.0),
        Axis::new("coherence", "").include(0.98).include(1.0),
    ];
    let titles = [
        format!(
            "Response in {dof}{figure}: {}, {} mm",
            title(&f.summary.subject),
            f.summary.amplitude_m * 1e3
        ),
        String::new(),
        String::new(),
    ];
    let heights = [220.0, 160.0, 80.0];
    let mut panels = Vec::new();
    for (k, (axis, title)) in axes.into_iter().zip(titles).enumerate() {
        let p = Plot::new(title)
            .x_axis(Axis::new("frequency", "Hz").range(range.clone()).log())
            .y_axis(axis)
            .size(760.0, heights[k])
            .margin_left(62.0);
        let mut p = panel(p, k, &shown);
        if k == 0 && shown.len() > f.poles.len() {
            p = p.legend("thin: other places", Colour::Grey);
        }
        for (i, l) in limits[k].iter().enumerate() {
            let name = if k == 0 && i == 0 { "required" } else { "" };
            p = p.line(Line::new(name, l).colour(Colour::Purple).dash(Dash::Dashed).width(2.0));
        }
        panels.push([p]);
    }
    let rows: Vec<&[Plot<'_>]> = panels.iter().map(<[Plot<'_>; 1]>::as_slice).collect();
    sheet(&rows)
}

/// The curves of panel `k`: in the middle thick with the linear model, elsewhere thin.
fn panel<'a>(mut p: Plot<'a>, k: usize, shown: &'a [Curves<'a>]) -> Plot<'a> {
    let first = shown.first().map(|c| c.of.payload);
    let mut named = false;
    for c in shown {
        let payload = c.of.payload;
        let [measured, linear] = &c.panels[k];
        if !c.in_the_middle() {
            p = p.line(Line::new("", measured).colour(colour(payload)).width(0.5));
            continue;
        }
        let name = match k {
            0 => format!("measured, {payload}"),
            _ => String::new(),
        };
        // Where payloads do nothing, the one below still shows.
        let width = if Some(payload) == first { 4.0 } else { 1.8 };
        p = p.line(Line::new(name, measured).colour(colour(payload)).width(width));
        if k < 2 {
            let name = if k == 0 && !named { "linear model" } else { "" };
            named = true;
            p = p.line(Line::new(name, linear).colour(Colour::Ink).dash(Dash::Dotted).width(1.6));
        }
    }
    p
}

/// With its sign, and never a minus zero.
fn number(x: f64, decimals: usize) -> String {
    let text = format!("{x:+.decimals$}");
    if text.trim_matches(['+', '-', '0', '.']).is_empty() { "0".to_owned() } else { text }
}

fn worst_words(w: &WorstResponse) -> String {
    let at = |w: &WorstAt| format!("{} {} Hz, {}", w.dof, w.hz, w.at);
    format!(
        "10 Hz {} to {} dB, {} to {} deg; to 5 Hz |G| within {:.1} % ({}), coupling \
         {:.3} ({})",
        number(w.gain_10_hz_db[0], 2),
        number(w.gain_10_hz_db[1], 2),
        number(w.phase_10_hz_deg[0], 0),
        number(w.phase_10_hz_deg[1], 0),
        100.0 * w.gain_error_to_5_hz.value,
        at(&w.gain_error_to_5_hz),
        w.coupling_to_5_hz.value,
        at(&w.coupling_to_5_hz)
    )
}

fn words(f: &Bode) -> String {
    let s = &f.summary;
    let at = match f.places.len() {
        1 => "in the middle".to_owned(),
        places => format!("at {places} places of the docking workspace"),
    };
    let mut out = format!(
        "{}: swept sine of {} mm on the running rig, {at}; linear model at the middle and 64 corners\n",
        title(&s.subject),
        s.amplitude_m * 1e3
    );
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "{name:14} {text}");
    };
    for p in &s.payloads {
        line("payload", p.payload.to_string());
        let m = &p.measured;
        line("  measured", format!("{}; coherence over {:.4}", worst_words(m), m.least_coherence));
        line("  linear", worst_words(&p.linear_everywhere));
        let damping = &p.least_modal_damping;
        line("  poles", format!("modal damping at least {:.3} (at {})", damping.value, damping.at));
    }
    let r = &s.required;
    line(
        "required",
        format!(
            "10 Hz within {} dB and {} deg; to 5 Hz |G| within {:.0} %, coupling \
             {}; modal damping {}",
            r.gain_10_hz_db,
            r.lag_10_hz_deg,
            100.0 * r.gain_error_to_5_hz,
            r.coupling_to_5_hz,
            r.modal_damping
        ),
    );
    let holds = |yes: bool| if yes { "holds" } else { "does NOT hold" };
    line(
        "answer",
        format!(
            "{} {at} (measured); {} over the middle and 64 corners (linear model)",
            holds(s.holds_where_measured),
            holds(s.linear_model_holds_everywhere)
        ),
    );
    out
}
