//! `validate single-dof`: the HIL simulation with one degree of freedom (§6.4 of the paper) against
//! the simulated system, in frequency (Fig. 23, 24) and in time (Fig. 25, 26).

mod plots;

use core::fmt::Write as _;
use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use docktwin_model::{AttenuationChoice, load_mechanism, load_rig};
use docktwin_study::single_dof::{
    DURATION_S, InterfaceKind, Simulations, SingleDof, SingleDofOptions, single_dof,
};

use crate::{
    args::PresetArg,
    failure::{Failure, OTHERWISE},
    inputs::sides,
    results::Results,
};

pub(super) const EXAMPLES: &str = "\
Two spacecraft of 8 t and 12 t (Table 2) on one axis. The simulated system, bodies and mechanism
alone, is integrated finely; the HIL simulation runs at 1 kHz with an interface: one that is
exactly one (G_I = 1); the hydraulic leg of Table 1 with its control, friction, dead time and a
force sensor of 350 Hz; and the same with the motion asked for ahead and the contact force expected
(compensated). Required: with G_I = 1 displacement and force of the docking, in RMS and peak, are
those of the simulated system within 0.1 %, at the worst of eight moments of first touch within a
tick. Where a mechanism's force begins with a large step or it meets its end stop, 1 kHz can be too
slow for that: exit code 1 says so.

The directory holds fig23_interface.svg (Bode of G_I, linear and measured by sines on the running
leg), fig24_loop.svg (Bode of (7) over (6), spring of Table 3), fig25_displacement.svg and
fig26_force.svg (docking with the axial characteristic of the mechanism's file), spring.svg (the
spring of Table 3, joined, at a fifth of the speed), interface.csv, loop.csv, docking.csv,
spring.csv and single-dof.json (what --json prints).

Examples:
  docktwin validate single-dof
  docktwin validate single-dof --preset stiff --out stiff --json
  docktwin validate single-dof --rig mine.toml --mechanism my_active.urdf --speed-m-s 0.2

Exit codes: 0 within the requirement; 1 not; 2 bad input.";

/// Options of `validate single-dof`.
#[derive(Debug, Args)]
pub(crate) struct SingleDofArgs {
    /// TOML or URDF of the rig that has oil, valve and friction of the leg
    #[arg(long, value_name = "FILE", default_value = "models/urdf/stewart.toml")]
    rig: PathBuf,
    /// Oil volume [default: as the file says]
    #[arg(long, value_enum)]
    preset: Option<PresetArg>,
    /// Active side of the mechanism, the passive one beside it
    #[arg(long, value_name = "FILE", default_value = "models/urdf/apas_active.urdf")]
    mechanism: PathBuf,
    /// Closing speed, m/s
    #[arg(long, value_name = "M/S", default_value_t = 0.35, value_parser = speed)]
    speed_m_s: f64,
    /// Directory of the results; by default a new one under `analysis`.
    #[arg(long, value_name = "DIR", help = "Directory [default: analysis/single-dof-<utc>]")]
    out: Option<PathBuf>,
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (0.01..=0.5).contains(&x) => Ok(x),
        _ => Err("a closing speed is 0.01 to 0.5 m/s".to_owned()),
    }
}

/// Runs the command.
pub(super) fn run(args: &SingleDofArgs, json: bool) -> Result<ExitCode, Failure> {
    let rig = load_rig(&args.rig)?;
    if !json {
        rig.notes.iter().for_each(|n| eprintln!("note: {n}"));
    }
    let (active, passive) = sides(&args.mechanism, None)?;
    let mechanism = load_mechanism(&active, &passive, Some(AttenuationChoice::Characteristic))?;
    if !json {
        mechanism.notes.iter().for_each(|n| eprintln!("ignored {n}"));
    }
    let options = SingleDofOptions {
        preset: args.preset.map(PresetArg::preset),
        closing_speed_m_s: args.speed_m_s,
    };
    let mut out = Results::new(args.out.as_deref(), "single-dof")?;
    let found = single_dof(&rig.model, &mechanism.model, &options)?;
    out.save("interface.csv".to_owned(), &interface_csv(&found))?;
    out.save("loop.csv".to_owned(), &loop_csv(&found))?;
    out.save("docking.csv".to_owned(), &time_csv(&found.docking))?;
    out.save("spring.csv".to_owned(), &time_csv(&found.joined_spring))?;
    out.plots(plots::all(&found))?;
    out.finish("single-dof", &found.summary, &words(&found), json)?;
    Ok(if found.summary.holds { ExitCode::SUCCESS } else { ExitCode::from(OTHERWISE) })
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

fn words(f: &SingleDof) -> String {
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
