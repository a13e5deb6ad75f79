//! `validate single-dof`: the HIL simulation with one degree of freedom (§6.4 of the paper) against
//! the simulated system, in frequency (Fig. 23, 24) and in time (Fig. 25, 26).

mod plots;

use core::fmt::Write as _;
use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use docktwin_control::{
    rig::{SetupError, TICK_S},
    single_dof::{
        Compensation, Docking, Interface, Likeness, Mechanism, Rebound, Sample, SingleDofSetup,
        measure,
        transfer::{Complex, LinearSimulator, body_dynamics, closed, mechanism, s_of},
    },
};
use docktwin_model::{AttenuationChoice, Attenuator, AxisChannel, load_mechanism, load_rig};
use serde_json::{Value, json};

use crate::{
    analyze::{Results, mechanism::sides},
    cli::PresetArg,
    failure::{Failure, OTHERWISE},
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

/// Table 3, and the mass that Table 2 makes.
const STIFFNESS_N_M: f64 = 1e6;
const DAMPING_N_S_M: f64 = 0.0;
/// Required of an interface of one.
const REQUIRED: f64 = 1e-3;
/// Length of the runs, ticks of 1 ms.
const TICKS: u32 = 2000;
/// Amplitude of the measured sines, m.
const AMPLITUDE_M: f64 = 2e-3;
/// Frequencies of the measured sines, Hz.
const SINES_HZ: [f64; 12] = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0];
/// The paper's requirement is at this frequency; docking happens below the other, Hz.
const PAPER_HZ: f64 = 10.0;
const DOCKING_HZ: f64 = 5.0;
/// `G_I` = 1.
const ONE: Interface<'_> = Interface::Ideal { delay_s: 0.0 };
/// Moments of first touch within a tick that are judged.
const TOUCHES: u32 = 8;
/// Parts of the docking's speed at which the joined spring is met: it swings up.
const SPRING_SPEED: f64 = 0.2;

type C = Complex<f64>;

/// An interface, as it is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    One,
    Plain,
    Compensated,
}

impl Kind {
    const ALL: [Self; 3] = [Self::One, Self::Plain, Self::Compensated];

    const fn word(self) -> &'static str {
        match self {
            Self::One => "one",
            Self::Plain => "uncompensated",
            Self::Compensated => "compensated",
        }
    }

    const fn title(self) -> &'static str {
        match self {
            Self::One => "HIL, G_I = 1",
            Self::Plain => "HIL, uncompensated",
            Self::Compensated => "HIL, compensated",
        }
    }
}

/// The leg without and with compensation.
const LEGS: [(Kind, Compensation); 2] =
    [(Kind::Plain, Compensation::None), (Kind::Compensated, Compensation::Ahead)];

/// `G_I` of one leg against one payload.
struct Bode {
    kind: Kind,
    payload_n_m: f64,
    linear: Vec<(f64, C)>,
    measured: Vec<(f64, C)>,
}

impl Bode {
    fn new(kind: Kind, setup: &SingleDofSetup, payload_n_m: f64) -> Result<Self, Failure> {
        let linear = LinearSimulator::new(setup, payload_n_m).ok_or_else(singular)?;
        let at = |hz: f64| Some((hz, linear.interface(hz)?));
        let measured = SINES_HZ.map(|hz| {
            let g = measure(setup, payload_n_m, AMPLITUDE_M, hz)?;
            Ok((hz, g * setup.sensor.response(s_of(hz))))
        });
        let measured: Result<Vec<_>, SetupError> = measured.into_iter().collect();
        Ok(Self {
            kind,
            payload_n_m,
            linear: frequencies().map(at).collect::<Option<_>>().ok_or_else(singular)?,
            measured: measured.map_err(|e| refused(&e))?,
        })
    }

    /// Measured at the paper's frequency.
    fn at_paper_hz(&self) -> C {
        self.measured.iter().find(|(hz, _)| *hz >= PAPER_HZ).map_or(C::ZERO, |(_, g)| *g)
    }

    /// Greatest |G_I − 1| measured up to the docking frequencies.
    fn off_one(&self) -> f64 {
        let docking = self.measured.iter().filter(|(hz, _)| *hz <= DOCKING_HZ);
        docking.map(|(_, g)| (g - 1.0).norm()).fold(0.0, f64::max)
    }

    /// Greatest distance of measured and linear, over the measured points.
    fn off_linear(&self) -> f64 {
        let near = |hz: f64| {
            self.linear.iter().min_by(|a, b| (a.0 - hz).abs().total_cmp(&(b.0 - hz).abs()))
        };
        let off = |(hz, g): &(f64, C)| near(*hz).map_or(f64::NAN, |(_, l)| (g - l).norm());
        self.measured.iter().map(off).fold(0.0, f64::max)
    }
}

/// Frequencies of the curves, Hz: 0.1 to 30, even in their logarithm, and those of the sines.
fn frequencies() -> impl Iterator<Item = f64> {
    let mut all: Vec<f64> = (0..=300).map(|i| 0.1 * 300f64.powf(f64::from(i) / 300.0)).collect();
    all.extend(SINES_HZ);
    all.sort_by(f64::total_cmp);
    all.into_iter()
}

/// The closed loops with the spring of Table 3: (6) and, for both legs, (7).
struct Loop {
    hz: f64,
    simulated: C,
    hil: [C; 2],
}

fn loops(mass_kg: f64, bodes: &[Bode]) -> Vec<Loop> {
    let of = |kind: Kind| {
        bodes.iter().find(|b| b.kind == kind && b.payload_n_m > 0.0).map(|b| b.linear.as_slice())
    };
    let [Some(plain), Some(ahead)] = [of(Kind::Plain), of(Kind::Compensated)] else {
        return Vec::new();
    };
    let rows = plain.iter().zip(ahead);
    rows.map(|(p, a)| {
        let s = s_of(p.0);
        let open = body_dynamics(mass_kg, s) * mechanism(STIFFNESS_N_M, DAMPING_N_S_M, s);
        Loop { hz: p.0, simulated: closed(open), hil: [p.1, a.1].map(|g| closed(open * g)) }
    })
    .collect()
}

/// One docking as it would be, and with every interface.
struct Runs {
    docking: Docking,
    simulated: Vec<Sample>,
    hil: [Vec<Sample>; 3],
}

impl Runs {
    fn new(docking: Docking, legs: &[SingleDofSetup; 2]) -> Result<Self, Failure> {
        let run =
            |interface: &Interface<'_>| docking.hil(interface, TICKS).map_err(|e| refused(&e));
        let hil = [run(&ONE)?, run(&Interface::Leg(&legs[0]))?, run(&Interface::Leg(&legs[1]))?];
        Ok(Self { simulated: docking.simulated(TICKS), hil, docking })
    }

    fn likeness(&self) -> [Likeness; 3] {
        core::array::from_fn(|i| Likeness::of(&self.hil[i], &self.simulated))
    }

    /// With `G_I` = 1 the worst of several moments of first touch within a tick.
    fn likeness_of_one(&self) -> Result<Likeness, Failure> {
        let mut worst = Likeness::of(&self.hil[0], &self.simulated);
        for i in 0..TOUCHES {
            let d = self.docking.touching((f64::from(i) + 0.5) / f64::from(TOUCHES));
            let hil = d.hil(&ONE, TICKS).map_err(|e| refused(&e))?;
            worst = worst.or_worse(&Likeness::of(&hil, &d.simulated(TICKS)));
        }
        Ok(worst)
    }

    /// Restitution and duration over the simulated system's.
    fn rebounds(&self) -> Option<[[f64; 2]; 3]> {
        let reference = Rebound::of(&self.docking, &self.simulated)?;
        let mut out = [[0.0; 2]; 3];
        for (out, run) in out.iter_mut().zip(&self.hil) {
            let r = Rebound::of(&self.docking, run)?;
            *out = [r.restitution / reference.restitution, r.time_s / reference.time_s];
        }
        Some(out)
    }
}

/// Everything that was found.
struct Found {
    rig: String,
    preset: &'static str,
    mechanism: String,
    bodes: Vec<Bode>,
    loops: Vec<Loop>,
    docking: Runs,
    spring: Runs,
    contact: Runs,
    /// Of the docking; with `G_I` = 1 the worst of several touches.
    likeness: [Likeness; 3],
}

impl Found {
    fn holds(&self) -> bool {
        self.likeness[0].worst() <= REQUIRED
    }
}

fn singular() -> Failure {
    Failure::Usage {
        what: "the leg has no linear model".to_owned(),
        remedy: "mend oil volume and valve in the rig file".to_owned(),
    }
}

fn refused(e: &SetupError) -> Failure {
    Failure::Usage { what: e.to_string(), remedy: "mend the rig file".to_owned() }
}

/// The axial characteristic of a mechanism, and its name.
fn axial(args: &SingleDofArgs, json: bool) -> Result<(AxisChannel, String), Failure> {
    let (active, passive) = sides(&args.mechanism, None)?;
    let loaded = load_mechanism(&active, &passive, Some(AttenuationChoice::Characteristic))?;
    if !json {
        loaded.notes.iter().for_each(|n| eprintln!("ignored {n}"));
    }
    match loaded.model.attenuator {
        Attenuator::Characteristic(c) => Ok((c.axial, loaded.model.name)),
        _ => Err(Failure::Usage {
            what: format!("{} has no axial characteristic", args.mechanism.display()),
            remedy: "give the active side of a mechanism with [attenuation.characteristic]"
                .to_owned(),
        }),
    }
}

/// Runs the command.
pub(super) fn run(args: &SingleDofArgs, json: bool) -> Result<ExitCode, Failure> {
    let rig = load_rig(&args.rig)?;
    if !json {
        rig.notes.iter().for_each(|n| eprintln!("note: {n}"));
    }
    let rig = rig.model;
    let (axial, mechanism) = axial(args, json)?;
    let preset = args.preset.map_or(rig.hydraulics.default_preset, |p| p.preset());
    let mut out = Results::new(args.out.as_deref(), "single-dof")?;

    let legs = LEGS.map(|(_, c)| SingleDofSetup::of_rig(&rig, preset).with(c));
    let mut bodes = Vec::new();
    for ((kind, _), setup) in LEGS.iter().zip(&legs) {
        for payload_n_m in [0.0, STIFFNESS_N_M] {
            bodes.push(Bode::new(*kind, setup, payload_n_m)?);
        }
    }
    let runs =
        |m: Mechanism, part: f64| Runs::new(Docking::of_table_2(m, part * args.speed_m_s), &legs);
    let docking = runs(Mechanism::Characteristic(axial), 1.0)?;
    let mut likeness = docking.likeness();
    likeness[0] = docking.likeness_of_one()?;
    let joined = Mechanism::Linear { stiffness_n_m: STIFFNESS_N_M, damping_n_s_m: DAMPING_N_S_M };
    let found = Found {
        rig: rig.name,
        preset: preset.word(),
        mechanism,
        loops: loops(docking.docking.reduced_mass_kg(), &bodes),
        bodes,
        likeness,
        docking,
        spring: runs(joined, SPRING_SPEED)?,
        contact: runs(Mechanism::Contact { stiffness_n_m: STIFFNESS_N_M }, 1.0)?,
    };

    out.save("interface.csv".to_owned(), &interface_csv(&found))?;
    out.save("loop.csv".to_owned(), &loop_csv(&found))?;
    out.save("docking.csv".to_owned(), &time_csv(&found.docking))?;
    out.save("spring.csv".to_owned(), &time_csv(&found.spring))?;
    out.plots(plots::all(&found))?;
    out.finish("single-dof", &as_json(&found), &words(&found), json)?;
    Ok(if found.holds() { ExitCode::SUCCESS } else { ExitCode::from(OTHERWISE) })
}

fn db(g: C) -> f64 {
    20.0 * g.norm().log10()
}

fn interface_csv(f: &Found) -> String {
    let mut out = String::from(
        "interface,payload_n_m,frequency_hz,linear_gain_db,linear_phase_deg,measured_gain_db,\
         measured_phase_deg\n",
    );
    for b in &f.bodes {
        for (hz, g) in &b.linear {
            let m = b.measured.iter().find(|m| m.0.to_bits() == hz.to_bits());
            let measured = m.map_or_else(
                || ",".to_owned(),
                |(_, m)| format!("{:.5},{:.4}", db(*m), m.arg().to_degrees()),
            );
            let _ = writeln!(
                out,
                "{},{},{hz:.5},{:.5},{:.4},{measured}",
                b.kind.word(),
                b.payload_n_m,
                db(*g),
                g.arg().to_degrees()
            );
        }
    }
    out
}

fn loop_csv(f: &Found) -> String {
    let mut out = String::from(
        "frequency_hz,simulated_real,simulated_imaginary,uncompensated_real,\
         uncompensated_imaginary,compensated_real,compensated_imaginary\n",
    );
    for l in &f.loops {
        let _ = write!(out, "{:.5}", l.hz);
        for g in [l.simulated, l.hil[0], l.hil[1]] {
            let _ = write!(out, ",{:.7},{:.7}", g.re, g.im);
        }
        out.push('\n');
    }
    out
}

fn time_csv(r: &Runs) -> String {
    let mut out = String::from("time_s,simulated_m,simulated_n");
    for k in Kind::ALL {
        let w = k.word();
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

fn as_json(f: &Found) -> Value {
    let likeness = |l: &Likeness| {
        json!({
            "displacement_nrms": l.displacement_nrms,
            "force_nrms": l.force_nrms,
            "displacement_peak_error": l.displacement_peak,
            "force_peak_error": l.force_peak,
        })
    };
    let interfaces: Vec<Value> = f
        .bodes
        .iter()
        .map(|b| {
            json!({
                "interface": b.kind.word(),
                "payload_n_m": b.payload_n_m,
                "gain_10_hz_db": db(b.at_paper_hz()),
                "phase_10_hz_deg": b.at_paper_hz().arg().to_degrees(),
                "off_one_to_5_hz": b.off_one(),
                "measured_against_linear": b.off_linear(),
            })
        })
        .collect();
    let (rebounds, spring) = (f.contact.rebounds(), f.spring.likeness());
    let runs: Vec<Value> = (0..3)
        .map(|i| {
            json!({
                "interface": Kind::ALL[i].word(),
                "docking": likeness(&f.likeness[i]),
                "joined_spring": likeness(&spring[i]),
                "contact_restitution_ratio": rebounds.map(|r| r[i][0]),
                "contact_time_ratio": rebounds.map(|r| r[i][1]),
            })
        })
        .collect();
    let d = &f.docking.docking;
    json!({
        "rig": f.rig,
        "preset": f.preset,
        "mechanism": f.mechanism,
        "chaser_kg": d.chaser_kg,
        "target_kg": d.target_kg,
        "reduced_mass_kg": d.reduced_mass_kg(),
        "closing_speed_m_s": d.closing_speed_m_s,
        "gap_m": d.gap_m,
        "touches_with_g_i_one": TOUCHES,
        "required_with_g_i_one": REQUIRED,
        "holds": f.holds(),
        "g_i": interfaces,
        "hil": runs,
    })
}

fn words(f: &Found) -> String {
    let d = &f.docking.docking;
    let mut out = format!(
        "{}, {}, one leg; {} at {} m/s, {:.0} kg on {:.0} kg\n",
        f.rig, f.preset, f.mechanism, d.closing_speed_m_s, d.chaser_kg, d.target_kg
    );
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "{name:14} {text}");
    };
    for b in &f.bodes {
        let against = if b.payload_n_m > 0.0 { "against 1e6 N/m" } else { "no payload" };
        let g = b.at_paper_hz();
        line(
            "G_I",
            format!(
                "{}, {against}: 10 Hz {:+.2} dB, {:+.1} deg; to 5 Hz within {:.1} % of one",
                b.kind.word(),
                db(g),
                g.arg().to_degrees(),
                100.0 * b.off_one()
            ),
        );
    }
    for (kind, l) in Kind::ALL.iter().zip(&f.likeness) {
        line(
            "docking",
            format!(
                "{}: displacement {:.3} % RMS, peak {:+.3} %; force {:.3} % RMS, peak {:+.3} %",
                kind.title(),
                100.0 * l.displacement_nrms,
                100.0 * l.displacement_peak,
                100.0 * l.force_nrms,
                100.0 * l.force_peak
            ),
        );
    }
    for (i, [e, t]) in f.contact.rebounds().iter().flatten().enumerate() {
        line(
            "contact",
            format!(
                "{}, spring of 1e6 N/m: R_e {:+.3} %, R_T {:+.3} %",
                Kind::ALL[i].title(),
                100.0 * (e - 1.0),
                100.0 * (t - 1.0)
            ),
        );
    }
    for (kind, l) in Kind::ALL.iter().zip(f.spring.likeness()) {
        line(
            "joined spring",
            format!(
                "{}: displacement {:.3} % RMS after {:.0} s",
                kind.title(),
                100.0 * l.displacement_nrms,
                f64::from(TICKS) * TICK_S
            ),
        );
    }
    line(
        "answer",
        format!(
            "with G_I = 1 {} within {} % of the simulated system",
            if f.holds() { "holds:" } else { "does NOT hold: not" },
            100.0 * REQUIRED
        ),
    );
    out
}
