//! Fig. 23 to 26, and the joined spring in time.

use docktwin_plot::{Axis, Colour, Dash, Line, Plot, PlotError, Points};
use docktwin_study::{
    Complex,
    single_dof::{
        InterfaceKind, InterfaceResponse, LoopPoint, PAPER_HZ, Simulations, SingleDof,
        SingleDofTick,
    },
};

use super::{
    super::{NamedText, sheet::sheet},
    title,
};

type Curve = Vec<[f64; 2]>;

/// What the paper allows at its frequency.
const PAPER_DB: f64 = 2.0;
const PAPER_DEG: f64 = 70.0;
/// Axes of all panels begin in line.
const LEFT: f64 = 68.0;

const fn colour(kind: InterfaceKind) -> Colour {
    match kind {
        InterfaceKind::One => Colour::Blue,
        InterfaceKind::Uncompensated => Colour::Vermilion,
        InterfaceKind::Compensated => Colour::Green,
    }
}

/// `fig23_interface.svg`, `fig24_loop.svg`, `fig25_displacement.svg`, `fig26_force.svg` and `spring.svg`.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn plots(f: &SingleDof) -> Result<Vec<NamedText>, PlotError> {
    let title = format!("{} at {} m/s", f.summary.mechanism, f.docking.closing_speed_m_s);
    let spring = f.joined_spring.closing_speed_m_s;
    Ok(vec![
        ("fig23_interface.svg".to_owned(), interface(f)?),
        ("fig24_loop.svg".to_owned(), closed_loop(f)?),
        (
            "fig25_displacement.svg".to_owned(),
            in_time(&f.docking, &DISPLACEMENT, &format!("Displacement (as Fig. 25): {title}"))?,
        ),
        (
            "fig26_force.svg".to_owned(),
            in_time(&f.docking, &FORCE, &format!("Force (as Fig. 26): {title}"))?,
        ),
        (
            "spring.svg".to_owned(),
            in_time(
                &f.joined_spring,
                &DISPLACEMENT,
                &format!("Joined spring of 1e6 N/m without damping, {spring:.3} m/s"),
            )?,
        ),
    ])
}

fn frequency<'a>(title: &str, y: Axis, height: f64) -> Plot<'a> {
    Plot::new(title)
        .x_axis(Axis::new("frequency", "Hz").range(0.1..30.0).log())
        .y_axis(y)
        .size(760.0, height)
        .margin_left(LEFT)
}

/// Fig. 23: `G_I`, linear as lines, measured as points.
fn interface(f: &SingleDof) -> Result<String, PlotError> {
    type Part = fn(Complex) -> f64;
    let parts: [Part; 2] = [Complex::db, Complex::phase_deg];
    let curves = |of: &InterfaceResponse| {
        parts.map(|p| {
            [&of.linear, &of.measured]
                .map(|c| -> Curve { c.iter().map(|g| [g.hz, p(g.value)]).collect() })
        })
    };
    let shown: Vec<(&InterfaceResponse, [[Curve; 2]; 2])> =
        f.interfaces.iter().map(|of| (of, curves(of))).collect();
    let at = [PAPER_HZ * 0.93, PAPER_HZ * 1.07];
    let limits: [Vec<Curve>; 2] = [
        [PAPER_DB, -PAPER_DB].map(|y| at.map(|x| [x, y]).to_vec()).to_vec(),
        vec![at.map(|x| [x, -PAPER_DEG]).to_vec()],
    ];
    let title = format!("Interface G_I (as Fig. 23): one leg, 2500 kg, {}", preset(f));
    let axes = [
        Axis::new("gain |G_I|", "dB").include(-2.5).include(2.5),
        Axis::new("phase", "deg").include(-80.0).include(20.0),
    ];
    let mut panels = Vec::new();
    for (k, (axis, title)) in axes.into_iter().zip([title.as_str(), ""]).enumerate() {
        let mut p = frequency(title, axis, 230.0);
        let name = |text: String| if k == 0 { text } else { String::new() };
        for (b, curves) in &shown {
            let stiff = b.payload_n_m > 0.0;
            let against = if stiff { "against 1e6 N/m" } else { "no payload" };
            let dash = if stiff { Dash::Dashed } else { Dash::Solid };
            let [linear, measured] = &curves[k];
            p = p
                .line(
                    Line::new(name(format!("{}, {against}", b.interface.name())), linear)
                        .colour(colour(b.interface))
                        .dash(dash)
                        .width(1.8),
                )
                .points(Points::new("", measured).colour(colour(b.interface)).radius(2.8));
        }
        if k == 0 {
            p = p.legend("lines: linear; points: measured", Colour::Grey);
        }
        for (i, l) in limits[k].iter().enumerate() {
            let text = if i == 0 { "allowed at 10 Hz" } else { "" };
            p = p.line(Line::new(name(text.to_owned()), l).colour(Colour::Purple).width(2.5));
        }
        panels.push([p]);
    }
    rows(&panels)
}

fn preset(f: &SingleDof) -> &'static str {
    f.summary.preset.word()
}

/// Phase without jumps, from the lowest frequency on, degrees.
fn unwrapped(g: impl Iterator<Item = (f64, Complex)>) -> Curve {
    let mut out: Curve = Vec::new();
    for (hz, g) in g {
        let deg = g.phase_deg();
        let before = out.last().map_or(0.0, |p| p[1]);
        out.push([hz, deg + 360.0 * ((before - deg) / 360.0).round()]);
    }
    out
}

/// Fig. 24: (7) over (6).
fn closed_loop(f: &SingleDof) -> Result<String, PlotError> {
    let gain = |g: &dyn Fn(&LoopPoint) -> Complex| -> Curve {
        f.loops.iter().map(|l| [l.hz, g(l).db()]).collect()
    };
    // Without damping the phase of (6) is a step of half a turn, downwards.
    let six: [Curve; 2] = [
        gain(&|l| l.simulated),
        f.loops.iter().map(|l| [l.hz, if l.simulated.re > 0.0 { 0.0 } else { -180.0 }]).collect(),
    ];
    type Leg = (InterfaceKind, fn(&LoopPoint) -> Complex);
    let legs: [Leg; 2] = [
        (InterfaceKind::Uncompensated, |l| l.uncompensated),
        (InterfaceKind::Compensated, |l| l.compensated),
    ];
    let seven: [[Curve; 3]; 2] = legs.map(|(_, of)| {
        let ratio = |l: &LoopPoint| of(l).over(l.simulated);
        [gain(&of), unwrapped(f.loops.iter().map(|l| (l.hz, of(l)))), gain(&ratio)]
    });
    let title = format!("HIL loop (7) over simulated system (6) (as Fig. 24): {}", preset(f));
    let axes = [
        Axis::new("gain", "dB"),
        Axis::new("phase", "deg").include(-190.0).include(190.0),
        // The peak of (6) has no end without damping; it is not what is compared here.
        Axis::new("(7) / (6)", "dB").range(-6.0..6.0),
    ];
    let mut panels = Vec::new();
    for (k, axis) in axes.into_iter().enumerate() {
        let (title, height) = if k == 0 { (title.as_str(), 230.0) } else { ("", 170.0) };
        let mut p = frequency(title, axis, height);
        let name = |text: &str| if k == 0 { text.to_owned() } else { String::new() };
        for ((kind, _), seven) in legs.iter().zip(&seven) {
            let line = Line::new(name(self::title(*kind)), &seven[k]);
            p = p.line(line.colour(colour(*kind)).width(2.4));
        }
        if let Some(six) = six.get(k) {
            let line = Line::new(name("simulated system"), six);
            p = p.line(line.colour(Colour::Ink).dash(Dash::Dotted).width(1.8));
        }
        panels.push([p]);
    }
    rows(&panels)
}

/// A quantity over time.
struct Quantity {
    name: &'static str,
    unit: &'static str,
    value: fn(&SingleDofTick) -> f64,
}

const DISPLACEMENT: Quantity =
    Quantity { name: "displacement", unit: "mm", value: |s| s.body_m * 1e3 };
const FORCE: Quantity = Quantity { name: "force", unit: "kN", value: |s| s.force_n * 1e-3 };

/// The simulated system and the HIL simulations over time, and how far they are apart.
fn in_time(r: &Simulations, q: &Quantity, title: &str) -> Result<String, PlotError> {
    let reference: Curve = r.simulated.iter().map(|s| [s.time_s, (q.value)(s)]).collect();
    let curves: [[Curve; 2]; 3] = core::array::from_fn(|i| {
        let pairs = r.hil[i].iter().zip(&r.simulated);
        let apart = pairs.map(|(a, b)| [a.time_s, (q.value)(a) - (q.value)(b)]).collect();
        [r.hil[i].iter().map(|s| [s.time_s, (q.value)(s)]).collect(), apart]
    });
    let end = r.simulated.last().map_or(1.0, |s| s.time_s);
    let plot = |title: &str, name: &str, height: f64| {
        Plot::new(title)
            .x_axis(Axis::new("time", "s").range(0.0..end))
            .y_axis(Axis::new(name, q.unit))
            .size(760.0, height)
            .margin_left(LEFT)
    };
    let mut above = plot(title, q.name, 230.0);
    let mut below = plot("", "HIL less simulated", 150.0);
    for (i, (kind, width)) in InterfaceKind::ALL.into_iter().zip([6.0, 2.2, 2.2]).enumerate() {
        let line = |name: &'static str, k: usize, width: f64| {
            Line::new(name, &curves[i][k]).colour(colour(kind)).width(width)
        };
        above = above.line(line(self::title(kind), 0, width));
        below = below.line(line("", 1, 1.8));
    }
    above = above.line(
        Line::new("simulated system", &reference).colour(Colour::Ink).dash(Dash::Dotted).width(1.8),
    );
    rows(&[[above], [below]])
}

fn rows(panels: &[[Plot<'_>; 1]]) -> Result<String, PlotError> {
    let rows: Vec<&[Plot<'_>]> = panels.iter().map(<[Plot<'_>; 1]>::as_slice).collect();
    sheet(&rows)
}
