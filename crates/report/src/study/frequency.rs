//! Natural frequency per degree of freedom over the docking workspace.

use core::fmt::Write as _;

use docktwin_plot::{Axis, Bar, Colour, Dash, Lane, Line, Plot, PlotError};
use docktwin_study::rig::{Dof, Frequency, Span};

use super::{
    NamedText,
    rig::{PLACE_COLUMNS, place_csv, title},
    sheet::sheet,
};

/// `frequency.csv`.
#[must_use]
pub fn tables(f: &Frequency) -> Vec<NamedText> {
    vec![("frequency.csv".to_owned(), csv(f))]
}

/// `frequency.svg`, Fig. 31 to 36 of the paper.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn plots(f: &Frequency) -> Result<Vec<NamedText>, PlotError> {
    Ok(vec![("frequency.svg".to_owned(), plot(f)?)])
}

fn csv(f: &Frequency) -> String {
    let mut table = PLACE_COLUMNS.to_owned();
    Dof::ALL.iter().for_each(|d| table.push_str(&format!(",{}_hz", d.name().to_lowercase())));
    (0..6).for_each(|i| table.push_str(&format!(",mode_{i}_hz")));
    table.push('\n');
    for p in &f.places {
        table.push_str(&place_csv(&f.docking_workspace, p.place));
        for hz in p.held_hz.iter().chain(&p.mode_hz) {
            // Writing to a String cannot fail.
            let _ = write!(table, ",{hz:.5}");
        }
        table.push('\n');
    }
    table
}

/// Frequency of a degree of freedom, Hz, on the six lines through the middle, over the place on the
/// line in half-widths.
fn lines(f: &Frequency, dof: Dof) -> [Vec<[f64; 2]>; 6] {
    f.lines.each_ref().map(|line| {
        let at = line.along.index();
        line.places.iter().map(|p| [p.place.0[at], p.held_hz[dof.index()]]).collect()
    })
}

fn plot(f: &Frequency) -> Result<String, PlotError> {
    let lines = Dof::ALL.map(|dof| lines(f, dof));
    let ends = f
        .summary
        .held_hz
        .each_ref()
        .map(|s| [&s.least, &s.greatest].map(|e| vec![[-1.0, e.value], [1.0, e.value]]));
    let title = title(&f.summary.subject);
    let panels: Vec<Plot<'_>> = Dof::ALL
        .into_iter()
        .zip([31, 32, 33, 34, 36, 35])
        .zip(lines.iter().zip(&ends))
        .map(|((dof, figure), (lines, ends))| {
            let mut p = Plot::new(format!("{dof} (as Fig. {figure}): {title}"))
                .x_axis(Axis::new("one coordinate, from the middle to its limits at ±1", ""))
                .y_axis(Axis::new("natural frequency", "Hz").at_least(1.0))
                .margin_left(56.0)
                .size(485.0, 170.0);
            for (line, along) in lines.iter().zip(Dof::ALL) {
                p = p.line(Line::new(along.name(), line).width(2.0));
            }
            for (k, end) in ends.iter().enumerate() {
                let name = if k == 0 { "extremes" } else { "" };
                p = p.line(Line::new(name, end).colour(Colour::Ink).dash(Dash::Dashed).width(1.0));
            }
            p
        })
        .collect();
    sheet(&[&panels[..2], &panels[2..4], &panels[4..], &[presets_plot(f)]])
}

fn presets_plot<'a>(f: &Frequency) -> Plot<'a> {
    let presets = &f.summary.presets;
    let all = || presets.iter().flat_map(|p| p.held_hz);
    let from = all().map(|[least, _]| least).fold(f64::INFINITY, f64::min);
    let to = all().map(|[_, greatest]| greatest).fold(0.0, f64::max);
    let mut lanes = Plot::new(format!(
        "{}: natural frequency over the whole docking workspace, presets of the oil volume",
        f.summary.subject.rig
    ))
    .x_axis(
        Axis::new("natural frequency, the other five held", "Hz").range(0.9 * from..1.1 * to).log(),
    )
    .size(980.0, 190.0)
    .margin_left(60.0);
    let colours = [Colour::Blue, Colour::Green, Colour::Vermilion];
    for (p, colour) in presets.iter().zip(colours) {
        lanes = lanes.legend(p.preset.word(), colour);
    }
    for dof in Dof::ALL {
        let bars = presets
            .iter()
            .zip(colours)
            .map(|(p, colour)| {
                let [least, greatest] = p.held_hz[dof.index()];
                let label = format!("{least:.0}–{greatest:.0}");
                Bar { range: least..greatest, colour, height: 0.7, label }
            })
            .collect();
        lanes = lanes.lane(Lane { name: dof.name().to_owned(), bars });
    }
    lanes
}

/// The answer in words.
#[must_use]
pub fn words(f: &Frequency) -> String {
    let s = &f.summary;
    let mut out = format!(
        "{}: plate on its oil springs of {:.3e} N/m, valves closed\n\
         {:14} middle    least                                     greatest\n",
        title(&s.subject),
        s.subject.oil_spring_n_m.unwrap_or(f64::NAN),
        "natural freq."
    );
    let mut line = |name: &str, middle: f64, span: &Span| {
        let (least, greatest) = (&span.least, &span.greatest);
        let _ = writeln!(
            out,
            "  {name:12} {middle:6.1} Hz {:6.1} Hz at {:30} {:6.1} Hz at {}, {:+.0} to {:+.0} %",
            least.value,
            least.at.to_string(),
            greatest.value,
            greatest.at,
            100.0 * (least.value / middle - 1.0),
            100.0 * (greatest.value / middle - 1.0)
        );
    };
    for ((dof, middle), span) in Dof::ALL.iter().zip(s.middle.held_hz).zip(&s.held_hz) {
        line(dof.name(), middle, span);
    }
    for (i, (middle, span)) in s.middle.mode_hz.iter().zip(&s.mode_hz).enumerate() {
        line(&format!("mode {i}"), *middle, span);
    }
    let _ = writeln!(
        out,
        "{:14} {:.0} to {:.0} kg of effective mass on a leg",
        "legs see", s.effective_mass_kg.least.value, s.effective_mass_kg.greatest.value
    );
    for p in &s.presets {
        let ([low, low_most], [high, high_most]) = (p.mode_hz[0], p.mode_hz[5]);
        let _ = writeln!(
            out,
            "{:14} lowest mode {low:.1} to {low_most:.1} Hz, highest {high:.1} to {high_most:.1} Hz; \
             {:.0} kg on one leg {:.1} Hz",
            p.preset.word(),
            s.subject.plate_mass_kg,
            p.lumped_hz
        );
    }
    out
}
