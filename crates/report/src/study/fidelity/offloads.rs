//! What a balance costs: table, words and plots.

use core::fmt::Write as _;

use docktwin_plot::{Axis, Embed, Line, Plot, PlotError};
use docktwin_study::fidelity::offloads::{
    Balance, Balanced, FRICTIONS_N, MASSES_KG, OffloadMap, SHARES,
};

use super::{FIGURES, heads, number, row};
use crate::study::NamedText;

/// `fidelity-offload.csv`: one row a scenario and balance.
#[must_use]
pub fn offload_tables(all: &[OffloadMap]) -> Vec<NamedText> {
    let mut out = "scenario,share,friction_n,added_mass_kg,sag_share_of_travel,weight_share_of_brake,outcome,\
                   simulated,borne"
        .to_owned();
    for (name, _) in FIGURES {
        let _ = write!(out, ",{}", name.replace(' ', "_"));
    }
    out.push('\n');
    let cell = |x: Option<f64>| x.map_or(String::new(), |x| x.to_string());
    for map in all {
        for b in &map.balances {
            let Balance { share, friction_n, added_mass_kg } = b.balance;
            let outcome =
                b.on_rig.as_ref().map_or("refused".to_owned(), |on| on.outcome.to_string());
            let _ = write!(
                out,
                "{},{share},{friction_n},{added_mass_kg},{},{},{outcome},{},{}",
                map.scenario,
                cell(b.sag_share),
                cell(b.brake_share),
                map.simulated,
                b.borne(&map.simulated)
            );
            for (_, f) in FIGURES {
                let x = b.on_rig.as_ref().and_then(|on| f(on, on.window()));
                let _ = write!(out, ",{}", cell(x));
            }
            out.push('\n');
        }
    }
    vec![("fidelity-offload.csv".to_owned(), out)]
}

/// One row a balance; what is not borne says why.
#[must_use]
pub fn offload_words(map: &OffloadMap) -> String {
    let mut out = String::new();
    let Balance { share, friction_n, added_mass_kg } = map.own;
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "{}: simulated {}; the rig's own balance carries {} %, {friction_n} N, {added_mass_kg} kg",
        map.scenario,
        map.simulated,
        100.0 * share
    );
    let _ = writeln!(
        out,
        "{:>7}{:>12}{:>10}{:>9}{:>9}{}",
        "share",
        "friction N",
        "added kg",
        "travel",
        "brake",
        heads()
    );
    let part = |x: Option<f64>| x.map_or("–".to_owned(), |x| format!("{:.1} %", 100.0 * x));
    for b in &map.balances {
        let Balance { share, friction_n, added_mass_kg } = b.balance;
        let figures = b.on_rig.as_ref().map_or(String::new(), |on| {
            let over = on.window();
            row(|f| number(f(on, over), false))
        });
        let _ = writeln!(
            out,
            "{:>5} %{friction_n:>12}{added_mass_kg:>10}{:>9}{:>9}{figures}{}",
            100.0 * share,
            part(b.sag_share),
            part(b.brake_share),
            ending(map, b)
        );
    }
    out
}

fn ending(map: &OffloadMap, b: &Balanced) -> String {
    match (&b.refused, &b.on_rig) {
        (Some(why), _) => format!("  refused: {why}"),
        (None, Some(on)) => match &on.stopped {
            Some(why) => format!("  stopped: {why}"),
            None if on.outcome != map.simulated => format!("  {}", on.outcome),
            None => String::new(),
        },
        (None, None) => String::new(),
    }
}

/// `fidelity-offload-SCENARIO-friction.svg` and `…-mass.svg`: the error of the force on the hardware over friction
/// and over moving mass, a line a share, the other number as nearest to the rig's own.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn offload_plots(all: &[OffloadMap]) -> Result<Vec<NamedText>, PlotError> {
    let mut out = Vec::new();
    for map in all {
        let nearest = |of: [f64; 4], own: f64| {
            of.into_iter().min_by(|a, b| (a - own).abs().total_cmp(&(b - own).abs())).unwrap_or(own)
        };
        let mass = nearest(MASSES_KG, map.own.added_mass_kg);
        let friction = nearest(FRICTIONS_N, map.own.friction_n);
        let by_friction = lines(map, |b| same(b.added_mass_kg, mass).then_some(b.friction_n));
        let by_mass = lines(map, |b| same(b.friction_n, friction).then_some(b.added_mass_kg));
        let name = |what: &str| format!("fidelity-offload-{}-{what}.svg", map.scenario);
        let title =
            |held: String| format!("{}: error of the force on the hardware, {held}", map.scenario);
        let x = Axis::new("friction of the balance", "N").include(0.0);
        let held = title(format!("moving mass {mass} kg"));
        out.push((name("friction"), plot(held, x, &by_friction)?));
        let x = Axis::new("moving mass of the balance", "kg").include(0.0);
        let held = title(format!("friction {friction} N"));
        out.push((name("mass"), plot(held, x, &by_mass)?));
    }
    Ok(out)
}

/// Both are one number of the lattice.
fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits()
}

/// Error of the force on the hardware, %, over what `x` picks; a line for each share.
fn lines(map: &OffloadMap, x: impl Fn(&Balance) -> Option<f64>) -> Vec<(f64, Vec<[f64; 2]>)> {
    let point = |b: &Balanced| {
        let on = b.on_rig.as_ref().filter(|on| on.stopped.is_none());
        let y = on.and_then(|on| on.hardware(on.window()).nrms_force);
        Some([x(&b.balance)?, 100.0 * y.unwrap_or(f64::NAN)])
    };
    let of = |share: f64| map.balances.iter().filter(move |b| same(b.balance.share, share));
    SHARES.into_iter().map(|share| (share, of(share).filter_map(point).collect())).collect()
}

fn plot(title: String, x: Axis, lines: &[(f64, Vec<[f64; 2]>)]) -> Result<String, PlotError> {
    let mut plot = Plot::new(title)
        .x_axis(x)
        .y_axis(Axis::new("NRMS of the force", "%").include(0.0).at_least(1.0))
        .size(900.0, 420.0);
    for (share, points) in lines {
        plot = plot.line(
            Line::new(format!("{} % of the weight carried", 100.0 * share), points).width(2.0),
        );
    }
    plot.svg(Embed::Alone)
}
