//! Table 4 of the paper, a spring stick between two stops, through the whole loop.

use core::fmt::Write as _;

use docktwin_model::HydraulicPreset;
use docktwin_plot::{Axis, Colour, Dash, Line, Plot, PlotError};
use docktwin_run::rig_place::{ClockKind, RigPlace};
use docktwin_study::vibro_impact::{
    ContactFigures, SimulatedState, VibroFigures, VibroImpact, VibroRecord, VibroSummary, VibroTick,
};

use super::{NamedText, sheet::sheet};

/// `vibro-impact.csv`.
#[must_use]
pub fn tables(found: &VibroImpact) -> Vec<NamedText> {
    vec![("vibro-impact.csv".to_owned(), csv(&found.summary.tests))]
}

/// Force and speed of every test.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn plots(found: &VibroImpact) -> Result<Vec<NamedText>, PlotError> {
    let compensation = compensation(&found.summary);
    let tests = found.summary.tests.iter().zip(&found.records);
    tests.map(|(t, record)| plot(t, record, &compensation)).collect()
}

const COLUMNS: [&str; 13] = [
    "axis",
    "case",
    "frequency_hz",
    "rig",
    "contact",
    "r_e",
    "r_t",
    "r_t_sensed",
    "peak_ratio",
    "nrms_force",
    "nrms_position",
    "delta_energy",
    "v0_m_s",
];

fn csv(tests: &[VibroFigures]) -> String {
    let mut out = COLUMNS.join(",");
    out.push('\n');
    let mut line = |t: &VibroFigures, rig: &str, n: usize, c: &ContactFigures| {
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "{},{},{},{rig},{n},{},{},{},{},{},{},{},{}",
            t.axis,
            t.case,
            t.frequency_hz,
            c.r_e,
            c.r_t,
            c.r_t_sensed,
            c.peak_force_ratio,
            c.nrms_force,
            c.nrms_position,
            c.delta_energy,
            c.v0_m_s
        );
    };
    for t in tests {
        t.contacts.iter().enumerate().for_each(|(i, c)| line(t, "file", i + 1, c));
        for (i, c) in t.draws.iter().enumerate() {
            if let Some(c) = c {
                line(t, &format!("draw_{}", i + 1), 1, c);
            }
        }
    }
    out
}

/// Off one, in percent with its sign.
fn off(x: f64) -> String {
    format!("{:+.2}", (x - 1.0) * 100.0)
}

/// What was done against the delay.
fn compensation(s: &VibroSummary) -> String {
    match s.compensator.as_str() {
        "none" => "without compensation".to_owned(),
        "lead" => format!("with a lead of {:.2} ms", s.lead_s * 1e3),
        "twin" => format!("with two twins and a lead of {:.2} ms", s.lead_s * 1e3),
        other => format!("with the compensator `{other}`, {:.2} ms", s.lead_s * 1e3),
    }
}

/// The answer in words.
#[must_use]
pub fn words(found: &VibroImpact, place: &RigPlace, clock: ClockKind) -> String {
    let place = match place {
        RigPlace::Emulated => "emulated rig",
        RigPlace::Port(_) => "rig behind a port",
    };
    let preset = found.summary.preset.map_or("no oil", HydraulicPreset::word);
    let compensation = compensation(&found.summary);
    let mut out = format!("Table 4 on the {place} ({preset}), {compensation}; % off one\n");
    out.push_str(
        "axis        case   Hz     R_e-1   R_T-1  sensed   peak-1  NRMS F  NRMS x   dE/E0   paper R_e-1 R_T-1\n",
    );
    for (t, record) in found.summary.tests.iter().zip(&found.records) {
        contacts_words(t, &mut out);
        if let Some(stop) = &record.stop {
            let _ = writeln!(
                out,
                "{:11} {:4} stopped by the supervisor: {} {:.3}, allowed {:.3}",
                t.axis, t.case, stop.limit, stop.value, stop.allowed
            );
        } else if t.contacts.is_empty() {
            let _ = writeln!(out, "{:11} {:4} no whole contact", t.axis, t.case);
        }
        if clock == ClockKind::Realtime {
            let k = &t.loop_;
            let _ = writeln!(
                out,
                "{:11} {:4} of {} ticks {} left out, {} without a measurement; woken at most {:.3} ms late{}{}",
                "",
                "",
                k.ticks + k.missed_ticks,
                k.missed_ticks,
                k.ticks_without_measurement,
                k.lateness_max_ms,
                if k.best_effort.is_some() { "; " } else { "" },
                k.best_effort.as_deref().unwrap_or_default(),
            );
        }
        if let Some(s) = t.draw_statistics() {
            let [em, ew, tm, tw] =
                [s.r_e_mean, s.r_e_worst, s.r_t_mean, s.r_t_worst].map(|x| x * 100.0);
            let [p, fm, fw] =
                [s.peak_worst, s.nrms_force_mean, s.nrms_force_worst].map(|x| x * 100.0);
            let _ = writeln!(
                out,
                "{:11} {:4} {} of {} drawn rigs: |R_e-1| mean {em:.2} worst {ew:.2}, |R_T-1| mean {tm:.2} worst {tw:.2}, \
                 |peak-1| worst {p:.2}, NRMS F mean {fm:.2} worst {fw:.2}",
                "", "", s.judged, s.rigs
            );
        }
    }
    out
}

/// A line for every contact, the paper's figures beside the first.
fn contacts_words(t: &VibroFigures, out: &mut String) {
    let paper = t.paper.map_or_else(
        || "     –     –".to_owned(),
        |p| format!("{:>6} {:>6}", off(p.r_e), off(p.r_t)),
    );
    for (i, c) in t.contacts.iter().enumerate() {
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "{:11} {:4} {:6.3} {:>7} {:>7} {:>7}  {:>7} {:7.2} {:7.2} {:+8.2}   {}",
            if i == 0 { t.axis.as_str() } else { "" },
            t.case,
            t.frequency_hz,
            off(c.r_e),
            off(c.r_t),
            off(c.r_t_sensed),
            off(c.peak_force_ratio),
            c.nrms_force * 100.0,
            c.nrms_position * 100.0,
            c.delta_energy * 100.0,
            if i == 0 { paper.as_str() } else { "" },
        );
    }
}

/// Axes of both panels begin in line.
const LEFT: f64 = 68.0;

/// Force and speed against time, the simulated system laid over.
fn plot(
    t: &VibroFigures,
    record: &VibroRecord,
    compensation: &str,
) -> Result<NamedText, PlotError> {
    let curve = |f: &dyn Fn(&VibroTick, SimulatedState) -> f64| -> Vec<[f64; 2]> {
        let point = |s: &VibroTick| [s.time_s, f(s, record.simulated.at(s.time_s))];
        record.ticks.iter().map(point).collect()
    };
    let force = [
        curve(&|_, simulated| simulated.force_n),
        curve(&|s, _| s.true_force_n.unwrap_or(s.sensed_force_n)),
        curve(&|s, _| s.sensed_force_n),
    ];
    let speed =
        [curve(&|_, simulated| simulated.speed_m_s * 1e3), curve(&|s, _| s.speed_m_s * 1e3)];
    let title =
        format!("{} · {} Hz, m = {} kg · {compensation}", t.axis, t.frequency_hz, t.mass_kg);
    let panel = |title: &str, y: Axis| {
        Plot::new(title)
            .x_axis(Axis::new("time since closing", "s"))
            .y_axis(y)
            .size(760.0, 240.0)
            .margin_left(LEFT)
    };
    let force_panel = panel(&title, Axis::new("force on the target", "N"))
        .line(Line::new("simulated system", &force[0]).colour(Colour::Grey).width(3.0))
        .line(Line::new("true", &force[1]).colour(Colour::Vermilion).width(1.6))
        .line(Line::new("sensed", &force[2]).colour(Colour::Blue).dash(Dash::Dashed).width(1.2));
    let speed_panel = panel("", Axis::new("relative speed", "mm/s"))
        .line(Line::new("", &speed[0]).colour(Colour::Grey).width(3.0))
        .line(Line::new("", &speed[1]).colour(Colour::Vermilion).width(1.6));
    let svg = sheet(&[&[force_panel], &[speed_panel]])?;
    Ok((format!("{}_case{}.svg", t.axis.replace('+', "_"), t.case), svg))
}
