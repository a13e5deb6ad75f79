//! Frequency response of the running rig, its linear model laid over it, and whether the requirements
//! hold.

use core::fmt::Write as _;

use docktwin_model::DockingWorkspace;
use docktwin_plot::{Axis, Colour, Dash, Line, Plot, PlotError};
use docktwin_study::rig::{
    Bode, Dof, FLAT_HZ, MeasuredResponse, Payload, ResponsePoint, WorstAt, WorstResponse,
};

use super::{
    NamedText,
    rig::{PLACE_COLUMNS, place_csv, title},
    sheet::sheet,
};

/// `bode.csv` and `poles.csv`; places are told in the docking workspace of the rig.
#[must_use]
pub fn tables(f: &Bode, docking: &DockingWorkspace) -> Vec<NamedText> {
    vec![("bode.csv".to_owned(), csv(f, docking)), ("poles.csv".to_owned(), poles_csv(f))]
}

/// `bode_DOF.svg` of every degree of freedom that was driven, Fig. 39 and 40 of the paper.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn plots(f: &Bode) -> Result<Vec<NamedText>, PlotError> {
    Dof::ALL
        .into_iter()
        .filter(|dof| f.responses.iter().any(|r| r.dof == *dof))
        .map(|dof| Ok((format!("bode_{}.svg", dof.name().to_lowercase()), plot(f, dof)?)))
        .collect()
}

fn csv(f: &Bode, docking: &DockingWorkspace) -> String {
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

/// The answer in words.
#[must_use]
pub fn words(f: &Bode) -> String {
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
