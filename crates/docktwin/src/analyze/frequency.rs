//! `analyze frequency`: natural frequency per degree of freedom over the docking workspace.

use core::fmt::Write as _;
use std::process::ExitCode;

use docktwin_model::{DockingWorkspace, HydraulicPreset, Place};
use docktwin_physics::platform::maps::{FrequencyMap, Maps, Span};
use docktwin_plot::{Axis, Bar, Colour, Dash, Lane, Line, Plot, PlotError};
use serde_json::{Value, json};

use super::{
    Results,
    plots::sheet,
    rig::{DOFS, PLACE_COLUMNS, Subject, at_json, singular},
};
use crate::{cli::RigArgs, failure::Failure};

/// The plate touches nothing.
const FREE: [f64; 6] = [0.0; 6];

/// Presets with their maps, in the order of the words.
type Presets = Vec<(HydraulicPreset, FrequencyMap)>;

/// Natural frequency of a degree of freedom, Hz, on the six straight ways through the middle, over the
/// place on the way in half-widths.
type Ways = [Vec<[f64; 2]>; 6];

/// Runs the command.
pub(super) fn run(args: &RigArgs, json: bool) -> Result<ExitCode, Failure> {
    let subject = Subject::load(args, json)?;
    let mut out = Results::new(args.out.as_deref(), &format!("{}-frequency", subject.rig.name))?;
    let maps = Maps::new(&subject.rig);
    let spring = subject.oil_spring_n_m();
    let mut table = PLACE_COLUMNS.to_owned();
    DOFS.iter().for_each(|d| table.push_str(&format!(",{}_hz", d.to_lowercase())));
    (0..6).for_each(|i| table.push_str(&format!(",mode_{i}_hz")));
    table.push('\n');
    for place in DockingWorkspace::grid() {
        let modes = maps.modes(&maps.at(place), spring, &FREE).ok_or_else(singular)?;
        table.push_str(&subject.place_csv(place));
        for hz in modes.held_hz.iter().chain(&modes.frequency_hz) {
            let _ = write!(table, ",{hz:.5}");
        }
        table.push('\n');
    }
    let presets: Option<Presets> = HydraulicPreset::WORDS
        .iter()
        .map(|(_, p)| Some((*p, maps.frequencies(subject.with(*p).oil_spring_n_m(), &FREE)?)))
        .collect();
    let presets = presets.ok_or_else(singular)?;
    let map = maps.frequencies(spring, &FREE).ok_or_else(singular)?;
    let mut ways: [Ways; 6] = Default::default();
    for way in 0..6 {
        for n in -10..=10 {
            let mut place = Place([0.0; 6]);
            place.0[way] = f64::from(n) / 10.0;
            let modes = maps.modes(&maps.at(place), spring, &FREE).ok_or_else(singular)?;
            for (ways, hz) in ways.iter_mut().zip(modes.held_hz) {
                ways[way].push([place.0[way], hz]);
            }
        }
    }
    out.save("frequency.csv".to_owned(), &table)?;
    out.plots(
        plot(&subject, &map, &presets, &ways).map(|svg| vec![("frequency.svg".to_owned(), svg)]),
    )?;
    let answer = as_json(&subject, &map, &presets);
    out.finish("frequency", &answer, &words(&subject, &map, &presets), json)
}

fn plot(
    subject: &Subject,
    map: &FrequencyMap,
    presets: &Presets,
    ways: &[Ways; 6],
) -> Result<String, PlotError> {
    let ends: Vec<[Vec<[f64; 2]>; 2]> = map
        .held_hz
        .iter()
        .map(|s| [s.least.0, s.greatest.0].map(|hz| vec![[-1.0, hz], [1.0, hz]]))
        .collect();
    let panels: Vec<Plot<'_>> = (0..6)
        .map(|i| {
            let figure = [31, 32, 33, 34, 36, 35][i];
            let title = format!("{} (as Fig. {figure}): {}", DOFS[i], subject.title());
            let mut p = Plot::new(title)
                .x_axis(Axis::new("one coordinate, from the middle to its limits at ±1", ""))
                .y_axis(Axis::new("natural frequency", "Hz").at_least(1.0))
                .margin_left(56.0)
                .size(485.0, 170.0);
            for (way, name) in ways[i].iter().zip(DOFS) {
                p = p.line(Line::new(name, way).width(2.0));
            }
            for (k, end) in ends[i].iter().enumerate() {
                let name = if k == 0 { "extremes" } else { "" };
                p = p.line(Line::new(name, end).colour(Colour::Ink).dash(Dash::Dashed).width(1.0));
            }
            p
        })
        .collect();
    let all = || presets.iter().flat_map(|(_, m)| m.held_hz);
    let from = all().map(|s| s.least.0).fold(f64::INFINITY, f64::min);
    let to = all().map(|s| s.greatest.0).fold(0.0, f64::max);
    let mut lanes = Plot::new(format!(
        "{}: natural frequency over the whole docking workspace, presets of the oil volume",
        subject.rig.name
    ))
    .x_axis(
        Axis::new("natural frequency, the other five held", "Hz").range(0.9 * from..1.1 * to).log(),
    )
    .size(980.0, 190.0)
    .margin_left(60.0);
    let colours = [Colour::Blue, Colour::Green, Colour::Vermilion];
    for ((preset, _), colour) in presets.iter().zip(colours) {
        lanes = lanes.legend(preset.word(), colour);
    }
    for (i, name) in DOFS.iter().enumerate() {
        let bars = presets
            .iter()
            .zip(colours)
            .map(|((_, map), colour)| {
                let s = map.held_hz[i];
                Bar {
                    range: s.least.0..s.greatest.0,
                    colour,
                    height: 0.7,
                    label: format!("{:.0}–{:.0}", s.least.0, s.greatest.0),
                }
            })
            .collect();
        lanes = lanes.lane(Lane { name: (*name).to_owned(), bars });
    }
    sheet(&[&panels[..2], &panels[2..4], &panels[4..], &[lanes]])
}

fn spans_json(spans: &[Span; 6]) -> Vec<Value> {
    spans
        .iter()
        .map(|s| json!({ "least": at_json(s.least), "greatest": at_json(s.greatest) }))
        .collect()
}

fn as_json(subject: &Subject, map: &FrequencyMap, presets: &Presets) -> Value {
    json!({
        "subject": subject.json(),
        "dofs": DOFS,
        "middle": {
            "held_hz": map.middle.held_hz,
            "mode_hz": map.middle.frequency_hz,
            "leading_mode": map.middle.leading,
            "stiffness": map.middle.stiffness,
            "effective_mass_kg": map.effective_mass_middle_kg,
        },
        "held_hz": spans_json(&map.held_hz),
        "mode_hz": spans_json(&map.mode_hz),
        "stiffness": spans_json(&map.stiffness),
        "effective_mass_kg": {
            "least": at_json(map.effective_mass_kg.least),
            "greatest": at_json(map.effective_mass_kg.greatest),
        },
        "presets": presets.iter().map(|(p, m)| json!({
            "preset": p.word(),
            "lumped_hz": subject.with(*p).lumped_hz(),
            "held_hz": m.held_hz.map(|s| [s.least.0, s.greatest.0]),
            "mode_hz": m.mode_hz.map(|s| [s.least.0, s.greatest.0]),
        })).collect::<Vec<_>>(),
    })
}

fn words(subject: &Subject, map: &FrequencyMap, presets: &Presets) -> String {
    let mut out = format!(
        "{}: plate on its oil springs of {:.3e} N/m, valves closed\n\
         {:14} middle    least                                     greatest\n",
        subject.title(),
        subject.oil_spring_n_m(),
        "natural freq."
    );
    let mut line = |name: &str, middle: f64, s: &Span| {
        let _ = writeln!(
            out,
            "  {name:12} {middle:6.1} Hz {:6.1} Hz at {:30} {:6.1} Hz at {}, {:+.0} to {:+.0} %",
            s.least.0,
            s.least.1.to_string(),
            s.greatest.0,
            s.greatest.1,
            100.0 * (s.least.0 / middle - 1.0),
            100.0 * (s.greatest.0 / middle - 1.0)
        );
    };
    for ((name, middle), span) in DOFS.iter().zip(map.middle.held_hz).zip(&map.held_hz) {
        line(name, middle, span);
    }
    for (i, (middle, span)) in map.middle.frequency_hz.iter().zip(&map.mode_hz).enumerate() {
        line(&format!("mode {i}"), *middle, span);
    }
    let _ = writeln!(
        out,
        "{:14} {:.0} to {:.0} kg of effective mass on a leg",
        "legs see", map.effective_mass_kg.least.0, map.effective_mass_kg.greatest.0
    );
    for (preset, m) in presets {
        let _ = writeln!(
            out,
            "{:14} lowest mode {:.1} to {:.1} Hz, highest {:.1} to {:.1} Hz; {:.0} kg on one leg \
             {:.1} Hz",
            preset.word(),
            m.mode_hz[0].least.0,
            m.mode_hz[0].greatest.0,
            m.mode_hz[5].least.0,
            m.mode_hz[5].greatest.0,
            subject.rig.plate.mass_kg,
            subject.with(*preset).lumped_hz()
        );
    }
    out
}
