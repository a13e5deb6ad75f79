//! What can be tested on a rig with each method against the delay.

use core::fmt::Write as _;

use docktwin_plot::{Axis, Bar, Colour, Lane, Plot, PlotError};
use docktwin_study::stability::{Cell, Mismatch, Reach, Stability};

use super::{NamedText, sheet::sheet};

/// `stability.csv`, a row a cell.
#[must_use]
pub fn tables(found: &Stability) -> Vec<NamedText> {
    let mut out = String::from(
        "method,case,frequency_hz,added_delay_s,lead_error_s,stiffness_factor,r_e,r_t,peak_ratio,nrms_force,stopped_by\n",
    );
    for c in &found.cells {
        let (lead_s, stiffness) = match c.mismatch {
            Mismatch::None => (0.0, 1.0),
            Mismatch::Lead(s) => (s, 1.0),
            Mismatch::Stiffness(by) => (0.0, by),
        };
        let figures = c.contact.map_or_else(
            || ",,,".to_owned(),
            |f| format!("{},{},{},{}", f.r_e, f.r_t, f.peak_force_ratio, f.nrms_force),
        );
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "{},{},{},{},{lead_s},{stiffness},{figures},{}",
            c.method,
            c.case,
            c.frequency_hz,
            c.added_s,
            c.stopped_by.as_deref().unwrap_or_default()
        );
    }
    vec![("stability.csv".to_owned(), out)]
}

/// `stability.svg`: for every delay the methods over the frequency, in the colour of their worst figure.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn plots(found: &Stability) -> Result<Vec<NamedText>, PlotError> {
    let delays = found.delays_s();
    let plots: Vec<Plot<'_>> = delays.iter().map(|s| plot(found, *s)).collect();
    let rows: Vec<&[Plot<'_>]> = plots.iter().map(core::slice::from_ref).collect();
    Ok(vec![("stability.svg".to_owned(), sheet(&rows)?)])
}

/// Colours of the levels, best first, and what they mean.
const LEGEND: [(&str, Colour); 4] = [
    ("within 1 %", Colour::Green),
    ("2 %", Colour::Sky),
    ("5 %", Colour::Amber),
    ("more, or stopped", Colour::Vermilion),
];

fn colour(worst: Option<f64>) -> Colour {
    let level = worst.map_or(3, |x| {
        docktwin_study::stability::LEVELS.iter().position(|level| x <= *level).unwrap_or(3)
    });
    LEGEND[level].1
}

fn plot(found: &Stability, added_s: f64) -> Plot<'_> {
    let total_ms = (found.lead_s + added_s) * 1e3;
    let mut out = Plot::new(format!(
        "{}, {}: lag of {total_ms:.1} ms, worst of all that is believed wrongly",
        found.rig, found.axis
    ))
    .x_axis(
        Axis::new("row of Table 4, 0.235 to 5 Hz; worst figure in the bars", "").range(0.5..7.5),
    )
    .margin_left(140.0);
    for (name, of) in LEGEND {
        out = out.legend(name, of);
    }
    for method in found.methods() {
        let mut rows: Vec<(usize, Option<f64>)> = Vec::new();
        for c in found.of(method).filter(|c| c.added_s.to_bits() == added_s.to_bits()) {
            match rows.iter_mut().find(|(case, _)| *case == c.case) {
                Some((_, worst)) => *worst = worse(*worst, c),
                None => rows.push((c.case, c.worst())),
            }
        }
        #[expect(clippy::cast_precision_loss, reason = "seven rows")]
        let bar = |(case, worst): (usize, Option<f64>)| Bar {
            range: case as f64 - 0.47..case as f64 + 0.47,
            colour: colour(worst),
            height: 0.8,
            label: worst.map_or_else(String::new, |x| format!("{:.2} %", x * 100.0)),
        };
        out = out.lane(Lane { name: method.to_owned(), bars: rows.into_iter().map(bar).collect() });
    }
    out
}

/// The worse of both; nothing is worst.
fn worse(worst: Option<f64>, c: &Cell) -> Option<f64> {
    Some(worst?.max(c.worst()?))
}

/// The answer in words.
#[must_use]
pub fn words(found: &Stability) -> String {
    let mut out = format!(
        "{}, {}: what can be tested with a lag of {:.2} ms and more; R_e, R_T, peak and RMS error of the force all within\n\
         and, of the least lag, the highest frequency up to which all rows are\n\
         {:22} cells within 1, 2, 5 %      up to Hz, as believed      up to Hz, believed wrongly\n",
        found.rig,
        found.axis,
        (found.lead_s + found.delays_s().into_iter().fold(f64::INFINITY, f64::min)) * 1e3,
        "method"
    );
    let hz = |x: &Option<f64>| x.map_or_else(|| "–".to_owned(), |x| format!("{x}"));
    let three = |x: &[Option<f64>; 3]| x.each_ref().map(hz).join(", ");
    let reach = found.reach();
    for Reach { method, cells, within: [a, b, c], up_to_hz, up_to_hz_mismatched } in &reach {
        let _ = writeln!(
            out,
            "{method:22} {:26} {:26} {}",
            format!("{a}, {b}, {c} of {cells}"),
            three(up_to_hz),
            three(up_to_hz_mismatched),
        );
    }
    for other in &reach {
        let [n, held] = found.held("twin", &other.method, 0.02);
        if other.method != "twin" && n > 0 && found.of("twin").next().is_some() {
            let _ = writeln!(
                out,
                "twin holds {held} of the {n} cells in which {} is within 2 %",
                other.method
            );
        }
    }
    out
}
