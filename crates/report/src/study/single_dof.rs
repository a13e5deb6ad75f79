//! The HIL simulation with one degree of freedom (§6.4 of the paper) against the simulated system, in
//! frequency (Fig. 23, 24) and in time (Fig. 25, 26).

mod plots;

use core::fmt::Write as _;

use docktwin_study::single_dof::{DURATION_S, InterfaceKind, Simulations, SingleDof};

use super::NamedText;

pub use self::plots::plots;

/// `interface.csv`, `loop.csv`, `docking.csv` and `spring.csv`.
#[must_use]
pub fn tables(f: &SingleDof) -> Vec<NamedText> {
    vec![
        ("interface.csv".to_owned(), interface_csv(f)),
        ("loop.csv".to_owned(), loop_csv(f)),
        ("docking.csv".to_owned(), time_csv(&f.docking)),
        ("spring.csv".to_owned(), time_csv(&f.joined_spring)),
    ]
}

fn interface_csv(f: &SingleDof) -> String {
    let mut out = String::from(
        "interface,payload_n_m,frequency_hz,linear_gain_db,linear_phase_deg,measured_gain_db,\
         measured_phase_deg\n",
    );
    for of in &f.interfaces {
        for p in &of.linear {
            let m = of.measured.iter().find(|m| m.hz.to_bits() == p.hz.to_bits());
            let measured = m.map_or_else(
                || ",".to_owned(),
                |m| format!("{:.5},{:.4}", m.value.db(), m.value.phase_deg()),
            );
            // Writing to a String cannot fail.
            let _ = writeln!(
                out,
                "{},{},{:.5},{:.5},{:.4},{measured}",
                of.interface.name(),
                of.payload_n_m,
                p.hz,
                p.value.db(),
                p.value.phase_deg()
            );
        }
    }
    out
}

fn loop_csv(f: &SingleDof) -> String {
    let mut out = String::from(
        "frequency_hz,simulated_real,simulated_imaginary,uncompensated_real,\
         uncompensated_imaginary,compensated_real,compensated_imaginary\n",
    );
    for l in &f.loops {
        let _ = write!(out, "{:.5}", l.hz);
        for g in [l.simulated, l.uncompensated, l.compensated] {
            let _ = write!(out, ",{:.7},{:.7}", g.re, g.im);
        }
        out.push('\n');
    }
    out
}

fn time_csv(r: &Simulations) -> String {
    let mut out = String::from("time_s,simulated_m,simulated_n");
    for kind in InterfaceKind::ALL {
        let w = kind.name();
        let _ = write!(out, ",{w}_m,{w}_rig_m,{w}_n");
    }
    out.push('\n');
    for (i, s) in r.simulated.iter().enumerate() {
        let _ = write!(out, "{:.3},{:.9},{:.4}", s.time_s, s.body_m, s.force_n);
        for run in &r.hil {
            // A run that ended early leaves its cells empty.
            let _ = match run.get(i) {
                Some(s) => write!(out, ",{:.9},{:.9},{:.4}", s.body_m, s.rig_m, s.force_n),
                None => write!(out, ",,,"),
            };
        }
        out.push('\n');
    }
    out
}

/// An interface as a title.
const fn title(kind: InterfaceKind) -> &'static str {
    match kind {
        InterfaceKind::One => "HIL, G_I = 1",
        InterfaceKind::Uncompensated => "HIL, uncompensated",
        InterfaceKind::Compensated => "HIL, compensated",
    }
}

/// The answer in words.
#[must_use]
pub fn words(f: &SingleDof) -> String {
    let s = &f.summary;
    let mut out = format!(
        "{}, {}, one leg; {} at {} m/s, {:.0} kg on {:.0} kg\n",
        s.rig,
        s.preset.word(),
        s.mechanism,
        s.closing_speed_m_s,
        s.chaser_kg,
        s.target_kg
    );
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "{name:14} {text}");
    };
    for g in &s.g_i {
        let against = if g.payload_n_m > 0.0 { "against 1e6 N/m" } else { "no payload" };
        line(
            "G_I",
            format!(
                "{}, {against}: 10 Hz {:+.2} dB, {:+.1} deg; to 5 Hz within {:.1} % of one",
                g.interface.name(),
                g.gain_10_hz_db,
                g.phase_10_hz_deg,
                100.0 * g.off_one_to_5_hz
            ),
        );
    }
    for h in &s.hil {
        let d = &h.docking;
        line(
            "docking",
            format!(
                "{}: displacement {:.3} % RMS, peak {:+.3} %; force {:.3} % RMS, peak {:+.3} %",
                title(h.interface),
                100.0 * d.displacement_nrms,
                100.0 * d.displacement_peak_error,
                100.0 * d.force_nrms,
                100.0 * d.force_peak_error
            ),
        );
    }
    for h in &s.hil {
        if let Some((e, t)) = h.contact_restitution_ratio.zip(h.contact_time_ratio) {
            line(
                "contact",
                format!(
                    "{}, spring of 1e6 N/m: R_e {:+.3} %, R_T {:+.3} %",
                    title(h.interface),
                    100.0 * (e - 1.0),
                    100.0 * (t - 1.0)
                ),
            );
        }
    }
    for h in &s.hil {
        line(
            "joined spring",
            format!(
                "{}: displacement {:.3} % RMS after {DURATION_S:.0} s",
                title(h.interface),
                100.0 * h.joined_spring.displacement_nrms
            ),
        );
    }
    line(
        "answer",
        format!(
            "with G_I = 1 {} within {} % of the simulated system",
            if s.holds { "holds:" } else { "does NOT hold: not" },
            100.0 * s.required_with_g_i_one
        ),
    );
    out
}
