//! `analyze bode`: frequency response of the running rig, its linear model laid over it, and whether
//! the requirements hold.

use core::fmt::Write as _;
use std::{
    process::ExitCode,
    sync::atomic::{AtomicUsize, Ordering},
};

use docktwin_control::{
    linear::Pole,
    response::{Bench, Point, ResponseError, Sweep},
    rig::RigSetup,
};
use docktwin_core::DVec3;
use docktwin_model::{HydraulicPreset, Place};
use docktwin_plot::{Axis, Colour, Dash, Line, Plot, PlotError};
use serde_json::{Value, json};

use super::{
    Results,
    plots::sheet,
    rig::{DOFS, PLACE_COLUMNS, Subject, at_json, middle_and_corners, singular},
};
use crate::{
    cli::{BodeArgs, PayloadArg, PlacesArg},
    failure::Failure,
    observers::progress,
};

/// Stiffness of the payloads, N/m: the paper's stiffest contact.
pub(super) const PAYLOAD_N_M: f64 = 1e6;
/// Poles above this are those of sampling and valve and say nothing of modes, Hz.
pub(super) const MODAL_HZ: f64 = 1000.0;
/// Frequency of the paper's requirement, Hz, and the requirement: dB and degrees of lag.
pub(super) const PAPER_HZ: f64 = 10.0;
const PAPER_DB: f64 = 2.0;
const PAPER_DEG: f64 = 70.0;
/// Upper end of the band where |G| must be near one, Hz.
const FLAT_HZ: f64 = 5.0;
/// Allowed response of another degree of freedom there, and least modal damping.
const COUPLING: f64 = 0.15;
const DAMPING: f64 = 0.1;

/// Frequencies that are told, Hz.
const HZ: [f64; 16] =
    [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0];
/// Spectra are averaged so far to either side, Hz.
const HALF_BAND_HZ: f64 = 0.1;

/// Most that |G| may differ from one below [`FLAT_HZ`].
fn flat(preset: HydraulicPreset) -> f64 {
    if preset == HydraulicPreset::Stiff { 0.05 } else { 0.10 }
}

/// A spring at the port.
#[derive(Clone, Copy)]
struct Payload {
    name: &'static str,
    words: &'static str,
    n_m: DVec3,
    colour: Colour,
}

fn payloads(which: PayloadArg) -> Vec<Payload> {
    let payload = |name, words, n_m, colour| Payload { name, words, n_m, colour };
    let none = payload("none", "no payload", DVec3::ZERO, Colour::Blue);
    let axial = payload("axial", "1e6 N/m along X", DVec3::X * PAYLOAD_N_M, Colour::Vermilion);
    let lateral = payload("lateral", "1e6 N/m along Y", DVec3::Y * PAYLOAD_N_M, Colour::Green);
    match which {
        PayloadArg::None => vec![none],
        PayloadArg::Axial => vec![axial],
        PayloadArg::Lateral => vec![lateral],
        PayloadArg::All => vec![none, axial, lateral],
    }
}

/// One drive at one place.
struct Case {
    payload: usize,
    place: Place,
    dof: usize,
    measured: Vec<Point>,
    linear: Vec<Point>,
}

/// The linear model against a payload, over the middle and all corners.
struct Linear {
    /// Poles in the middle.
    poles: Vec<Pole>,
    /// Least modal damping, and where.
    damping: (f64, Place),
    /// Worst figures of all degrees of freedom.
    worst: Worst,
}

/// A value, and where: degree of freedom, frequency in Hz, place.
type At = (f64, usize, f64, Place);

/// Worst figures of many points.
#[derive(Clone, Copy)]
struct Worst {
    /// Least and greatest gain at 10 Hz, dB, and phase, degrees.
    db: [f64; 2],
    deg: [f64; 2],
    /// | |G| − 1 | from 0.5 to 5 Hz.
    flat: At,
    /// Response of another degree of freedom from 0.5 to 5 Hz.
    coupling: At,
    /// Least coherence.
    coherence: f64,
}

impl Worst {
    const NONE: Self = Self {
        db: [f64::INFINITY, f64::NEG_INFINITY],
        deg: [f64::INFINITY, f64::NEG_INFINITY],
        flat: (0.0, 0, 0.0, Place([0.0; 6])),
        coupling: (0.0, 0, 0.0, Place([0.0; 6])),
        coherence: 1.0,
    };

    fn add(&mut self, p: &Point, dof: usize, place: Place) {
        self.coherence = self.coherence.min(p.coherence);
        if (p.hz - PAPER_HZ).abs() < 1e-9 {
            let (db, deg) = (p.gain_db(dof), p.phase_deg(dof));
            self.db = [self.db[0].min(db), self.db[1].max(db)];
            self.deg = [self.deg[0].min(deg), self.deg[1].max(deg)];
        }
        if p.hz <= FLAT_HZ {
            let off = (p.response[dof].norm() - 1.0).abs();
            if off > self.flat.0 {
                self.flat = (off, dof, p.hz, place);
            }
            let coupling = p.cross_coupling(dof);
            if coupling > self.coupling.0 {
                self.coupling = (coupling, dof, p.hz, place);
            }
        }
    }

    fn holds(&self, preset: HydraulicPreset) -> bool {
        self.db[0] >= -PAPER_DB
            && self.db[1] <= PAPER_DB
            && self.deg[0] >= -PAPER_DEG
            && self.flat.0 <= flat(preset)
            && self.coupling.0 <= COUPLING
    }

    fn json(&self) -> Value {
        let at = |w: &At| json!({ "value": w.0, "dof": DOFS[w.1], "hz": w.2, "at": w.3.0 });
        json!({
            "gain_10_hz_db": self.db,
            "phase_10_hz_deg": self.deg,
            "gain_error_to_5_hz": at(&self.flat),
            "coupling_to_5_hz": at(&self.coupling),
            "least_coherence": self.coherence,
        })
    }

    fn words(&self) -> String {
        let at = |w: &At| format!("{} {} Hz, {}", DOFS[w.1], w.2, w.3);
        format!(
            "10 Hz {} to {} dB, {} to {} deg; to 5 Hz |G| within {:.1} % ({}), coupling \
             {:.3} ({})",
            number(self.db[0], 2),
            number(self.db[1], 2),
            number(self.deg[0], 0),
            number(self.deg[1], 0),
            100.0 * self.flat.0,
            at(&self.flat),
            self.coupling.0,
            at(&self.coupling)
        )
    }
}

/// With its sign, and never a minus zero.
fn number(x: f64, decimals: usize) -> String {
    let text = format!("{x:+.decimals$}");
    if text.trim_matches(['+', '-', '0', '.']).is_empty() { "0".to_owned() } else { text }
}

/// What is measured, and how.
struct Work<'a> {
    subject: &'a Subject,
    setup: RigSetup,
    payloads: Vec<Payload>,
    lever_m: f64,
    amplitude_m: f64,
    foreseen: bool,
}

impl Work<'_> {
    fn bench(&self, payload: usize, place: Place) -> Bench {
        Bench {
            setup: self.setup.clone(),
            x_34: self.subject.file.docking.pose(place.0),
            payload_n_m: self.payloads[payload].n_m,
            lever_m: self.lever_m,
            foreseen: self.foreseen,
        }
    }

    fn case(&self, payload: usize, place: Place, dof: usize) -> Result<Case, Failure> {
        let b = self.bench(payload, place);
        let sweep = Sweep {
            dof,
            amplitude: if dof < 3 { self.amplitude_m } else { self.amplitude_m / self.lever_m },
            from_hz: 0.4,
            to_hz: 12.5,
            period_s: 20.0,
            sweeps: 1,
        };
        let measured = b.swept_sine(&sweep, &HZ, HALF_BAND_HZ).map_err(|e| Failure::Usage {
            what: format!(
                "{} at {place} against {} cannot be measured: {e}",
                DOFS[dof], self.payloads[payload].words
            ),
            remedy: match e {
                ResponseError::Rig(_) => {
                    "the loop is unstable there: `docktwin analyze stiffness` tells its poles; \
                     lower the gains with --set, or give a smaller --amplitude-mm"
                }
                _ => "mend the rig file, or the settings given with --set",
            }
            .to_owned(),
        })?;
        let l = b.linear().ok_or_else(singular)?;
        let linear: Option<Vec<Point>> = HZ.iter().map(|hz| b.linear_point(&l, dof, *hz)).collect();
        Ok(Case { payload, place, dof, measured, linear: linear.ok_or_else(singular)? })
    }

    fn linear(&self, payload: usize) -> Option<Linear> {
        let mut out = Linear {
            poles: Vec::new(),
            damping: (f64::INFINITY, Place([0.0; 6])),
            worst: Worst::NONE,
        };
        for place in middle_and_corners() {
            let b = self.bench(payload, place);
            let l = b.linear()?;
            let poles = l.poles()?;
            for p in poles.iter().filter(|p| p.frequency_hz < MODAL_HZ) {
                if p.damping < out.damping.0 {
                    out.damping = (p.damping, place);
                }
            }
            if out.poles.is_empty() {
                out.poles = poles;
            }
            for hz in HZ {
                let points = b.linear_points(&l, hz)?;
                points.iter().enumerate().for_each(|(dof, p)| out.worst.add(p, dof, place));
            }
        }
        Some(out)
    }
}

/// Work for as many threads as the machine has; results in the order of the work, whoever did it.
pub(super) fn in_parallel<T: Send>(
    n: usize,
    json: bool,
    work: impl Fn(usize) -> Result<T, Failure> + Sync,
) -> Result<Vec<T>, Failure> {
    let next = AtomicUsize::new(0);
    let bar = progress(u64::try_from(n).unwrap_or(u64::MAX), json);
    let one = || {
        let mut mine = Vec::new();
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            if i >= n {
                return mine;
            }
            mine.push((i, work(i)));
            bar.inc(1);
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, |t| t.get());
    let mut all: Vec<(usize, Result<T, Failure>)> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.min(n)).map(|_| scope.spawn(one)).collect();
        workers
            .into_iter()
            .flat_map(|w| w.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    });
    bar.finish_and_clear();
    all.sort_by_key(|(i, _)| *i);
    all.into_iter().map(|(_, r)| r).collect()
}

/// Runs the command.
pub(super) fn run(args: &BodeArgs, json: bool) -> Result<ExitCode, Failure> {
    let (subject, changes) = Subject::load_and_change(&args.rig, &args.set, json)?;
    let mut out = Results::new(args.rig.out.as_deref(), &format!("{}-bode", subject.rig.name))?;
    let mut setup = subject.setup(&changes);
    if args.ideal {
        setup.legs = setup.legs.map(|l| l.ideal());
        setup.believed_legs = setup.believed_legs.map(|l| l.ideal());
    }
    let lever_m = setup.platform.plate_radius_m();
    let work = Work {
        subject: &subject,
        setup,
        payloads: payloads(args.payload),
        lever_m,
        amplitude_m: args.amplitude_mm * 1e-3,
        foreseen: args.foreseen,
    };
    let mut dofs: Vec<usize> = args.dof.iter().map(|d| d.axis().index()).collect();
    if dofs.is_empty() {
        dofs = (0..6).collect();
    }
    dofs.sort_unstable();
    dofs.dedup();
    let everywhere = middle_and_corners();
    let places: Vec<Place> = match args.places {
        PlacesArg::Middle => everywhere[..1].to_vec(),
        PlacesArg::Sample => [0, 1, 12, 27, 38, 64].map(|i| everywhere[i]).to_vec(),
        PlacesArg::All => everywhere,
    };
    let mut plan = Vec::new();
    for payload in 0..work.payloads.len() {
        for place in &places {
            plan.extend(dofs.iter().map(|dof| (payload, *place, *dof)));
        }
    }
    let cases = in_parallel(plan.len(), json, |i| {
        let (payload, place, dof) = plan[i];
        work.case(payload, place, dof)
    })?;
    let linear = in_parallel(work.payloads.len(), json, |i| work.linear(i).ok_or_else(singular))?;
    out.save("bode.csv".to_owned(), &csv(&work, &cases))?;
    out.save("poles.csv".to_owned(), &poles_csv(&work, &linear))?;
    let drawn: Result<Vec<_>, PlotError> = dofs
        .iter()
        .map(|dof| {
            let svg = plot(&work, &cases, *dof)?;
            Ok((format!("bode_{}.svg", DOFS[*dof].to_lowercase()), svg))
        })
        .collect();
    out.plots(drawn)?;
    let verdict = Verdict::new(&work, &cases, &linear);
    let answer = as_json(&work, &cases, &linear, &verdict);
    out.finish("bode", &answer, &words(&work, places.len(), &linear, &verdict), json)
}

/// What was found, against what is required.
struct Verdict {
    /// Measured, per payload.
    measured: Vec<Worst>,
    holds: bool,
    /// The same of the linear model, over the middle and all corners, damping included.
    linear_holds: bool,
}

impl Verdict {
    fn new(work: &Work<'_>, cases: &[Case], linear: &[Linear]) -> Self {
        let preset = work.subject.preset;
        let mut measured = vec![Worst::NONE; work.payloads.len()];
        for c in cases {
            c.measured.iter().for_each(|p| measured[c.payload].add(p, c.dof, c.place));
        }
        Self {
            holds: measured.iter().all(|w| w.holds(preset)),
            linear_holds: linear.iter().all(|l| l.worst.holds(preset) && l.damping.0 >= DAMPING),
            measured,
        }
    }
}

fn csv(work: &Work<'_>, cases: &[Case]) -> String {
    let mut out = format!(
        "payload,{PLACE_COLUMNS},dof,frequency_hz,gain_db,phase_deg,coherence,largest_coupling,\
         linear_gain_db,linear_phase_deg,linear_largest_coupling\n"
    );
    for c in cases {
        for (m, l) in c.measured.iter().zip(&c.linear) {
            let _ = writeln!(
                out,
                "{},{},{},{},{:.5},{:.4},{:.6},{:.6},{:.5},{:.4},{:.6}",
                work.payloads[c.payload].name,
                work.subject.place_csv(c.place),
                DOFS[c.dof],
                m.hz,
                m.gain_db(c.dof),
                m.phase_deg(c.dof),
                m.coherence,
                m.cross_coupling(c.dof),
                l.gain_db(c.dof),
                l.phase_deg(c.dof),
                l.cross_coupling(c.dof)
            );
        }
    }
    out
}

fn poles_csv(work: &Work<'_>, linear: &[Linear]) -> String {
    let mut out = String::from("payload,frequency_hz,damping_ratio,real_rad_s,imaginary_rad_s\n");
    for (payload, l) in work.payloads.iter().zip(linear) {
        for p in &l.poles {
            let _ = writeln!(
                out,
                "{},{:.5},{:.6},{:.5},{:.5}",
                payload.name, p.frequency_hz, p.damping, p.s[0], p.s[1]
            );
        }
    }
    out
}

fn plot(work: &Work<'_>, cases: &[Case], dof: usize) -> Result<String, PlotError> {
    type Value = fn(&Point, usize) -> f64;
    /// Measured and linear, of every panel.
    type Curves = [[Vec<[f64; 2]>; 2]; 3];
    let values: [Value; 3] =
        [|p, dof| p.gain_db(dof), |p, dof| p.phase_deg(dof), |p, _| p.coherence];
    let curves = |c: &Case| -> Curves {
        values.map(|v| {
            [&c.measured, &c.linear].map(|p| p.iter().map(|p| [p.hz, v(p, dof)]).collect())
        })
    };
    let shown: Vec<(&Case, Curves)> =
        cases.iter().filter(|c| c.dof == dof).map(|c| (c, curves(c))).collect();
    let db = |g: f64| 20.0 * g.log10();
    let flat = flat(work.subject.preset);
    let (from, at) = (HZ[0], [9.3, 10.75]);
    let limits: [Vec<Vec<[f64; 2]>>; 3] = [
        vec![
            vec![[from, db(1.0 + flat)], [FLAT_HZ, db(1.0 + flat)]],
            vec![[from, db(1.0 - flat)], [FLAT_HZ, db(1.0 - flat)]],
            at.map(|hz| [hz, PAPER_DB]).to_vec(),
            at.map(|hz| [hz, -PAPER_DB]).to_vec(),
        ],
        vec![at.map(|hz| [hz, -PAPER_DEG]).to_vec()],
        vec![],
    ];
    let figure = match dof {
        0 => " (as Fig. 39)",
        1 => " (as Fig. 40)",
        _ => "",
    };
    let axes = [
        Axis::new("gain |G|", "dB").include(-2.3).include(2.3),
        Axis::new("phase", "deg").include(-75.0).include(5.0),
        Axis::new("coherence", "").include(0.98).include(1.0),
    ];
    let titles = [
        format!(
            "Response in {}{figure}: {}, {} mm",
            DOFS[dof],
            work.subject.title(),
            work.amplitude_m * 1e3
        ),
        String::new(),
        String::new(),
    ];
    let heights = [220.0, 160.0, 80.0];
    let mut panels = Vec::new();
    for (k, (axis, title)) in axes.into_iter().zip(titles).enumerate() {
        let mut p = Plot::new(title)
            .x_axis(Axis::new("frequency", "Hz").range(HZ[0]..HZ[HZ.len() - 1]).log())
            .y_axis(axis)
            .size(760.0, heights[k])
            .margin_left(62.0);
        let mut told = false;
        for (c, curves) in &shown {
            let payload = &work.payloads[c.payload];
            let middle = c.place.0.iter().all(|x| x.abs() < 1e-12);
            if middle {
                let name =
                    if k == 0 { format!("measured, {}", payload.words) } else { String::new() };
                // Where payloads do nothing, the one below still shows.
                let width = if c.payload == 0 { 4.0 } else { 1.8 };
                p = p.line(Line::new(name, &curves[k][0]).colour(payload.colour).width(width));
            } else {
                p = p.line(Line::new("", &curves[k][0]).colour(payload.colour).width(0.5));
            }
            if middle && k < 2 {
                let name = if k == 0 && !told { "linear model" } else { "" };
                told = true;
                p = p.line(
                    Line::new(name, &curves[k][1])
                        .colour(Colour::Ink)
                        .dash(Dash::Dotted)
                        .width(1.6),
                );
            }
        }
        if k == 0 && shown.len() > work.payloads.len() {
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

fn as_json(work: &Work<'_>, cases: &[Case], linear: &[Linear], v: &Verdict) -> Value {
    let payloads: Vec<Value> = work
        .payloads
        .iter()
        .enumerate()
        .map(|(i, p)| {
            json!({
                "payload": p.name,
                "measured": v.measured[i].json(),
                "linear_everywhere": linear[i].worst.json(),
                "least_modal_damping": at_json(linear[i].damping),
                "slowest_pole_hz": linear[i].poles.first().map(|p| p.frequency_hz),
                "measured_against_linear": cases
                    .iter()
                    .filter(|c| c.payload == i)
                    .flat_map(|c| c.measured.iter().zip(&c.linear))
                    .map(|(m, l)| {
                        (0..6).map(|k| (m.response[k] - l.response[k]).norm()).fold(0.0, f64::max)
                    })
                    .fold(0.0, f64::max),
            })
        })
        .collect();
    json!({
        "subject": work.subject.json(),
        "lever_m": work.lever_m,
        "amplitude_m": work.amplitude_m,
        "required": {
            "gain_10_hz_db": PAPER_DB,
            "lag_10_hz_deg": PAPER_DEG,
            "gain_error_to_5_hz": flat(work.subject.preset),
            "coupling_to_5_hz": COUPLING,
            "modal_damping": DAMPING,
        },
        "holds_where_measured": v.holds,
        "linear_model_holds_everywhere": v.linear_holds,
        "payloads": payloads,
    })
}

fn words(work: &Work<'_>, places: usize, linear: &[Linear], v: &Verdict) -> String {
    let at = if places == 1 {
        "in the middle".to_owned()
    } else {
        format!("at {places} places of the docking workspace")
    };
    let mut out = format!(
        "{}: swept sine of {} mm on the running rig, {at}; linear model at the middle and 64 corners\n",
        work.subject.title(),
        work.amplitude_m * 1e3
    );
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "{name:14} {text}");
    };
    for ((p, w), l) in work.payloads.iter().zip(&v.measured).zip(linear) {
        line("payload", p.words.to_owned());
        line("  measured", format!("{}; coherence over {:.4}", w.words(), w.coherence));
        line("  linear", l.worst.words());
        line("  poles", format!("modal damping at least {:.3} (at {})", l.damping.0, l.damping.1));
    }
    line(
        "required",
        format!(
            "10 Hz within {PAPER_DB} dB and {PAPER_DEG} deg; to 5 Hz |G| within {:.0} %, coupling \
             {COUPLING}; modal damping {DAMPING}",
            100.0 * flat(work.subject.preset)
        ),
    );
    let holds = |yes: bool| if yes { "holds" } else { "does NOT hold" };
    line(
        "answer",
        format!(
            "{} {at} (measured); {} over the middle and 64 corners (linear model)",
            holds(v.holds),
            holds(v.linear_holds)
        ),
    );
    out
}
