//! What happens in a run, as values; their words for a reader are made here and nowhere else.

use docktwin_control::safety::Trip;
use docktwin_core::{SimTime, Tick};
use docktwin_hil::scheduler::Phase;
use docktwin_physics::{contact::SurfacePair, limits::LimitPassed, mechanism::LatchPhase};
use docktwin_record::{Event, Fidelity, FidelityOf, Outcome};
use docktwin_scenario::Body;
use serde_json::{Value, json};

/// Something that happened in a tick.
#[derive(Clone, Debug, PartialEq)]
pub enum RunEvent {
    /// A pair of surfaces begins to touch.
    ContactBegin {
        /// Which pair.
        pair: SurfacePair,
        /// Sum of its normal forces, N.
        force_n: f64,
    },
    /// A pair of surfaces has parted for longer than [`docktwin_core::CONTACT_GAP_NS`].
    ContactEnd {
        /// Which pair.
        pair: SurfacePair,
        /// First touch, s.
        since_s: f64,
        /// Last touch, s.
        until_s: f64,
        /// Largest sum of normal forces in a recorded tick, N.
        peak_n: f64,
    },
    /// A latch comes to another phase.
    Latch {
        /// Its index, from 0.
        latch: usize,
        /// The new phase.
        phase: LatchPhase,
        /// Its axial gap, m.
        gap_m: f64,
    },
    /// Enough latches hold.
    Captured {
        /// When, s.
        capture_s: f64,
        /// Whether they are latches with places of their own, which `captured_when` names.
        own_latches: bool,
    },
    /// The control wrench of a spacecraft becomes zero or other than zero.
    Thrust {
        /// Of which.
        on: Body,
        /// Whether there is one now.
        active: bool,
    },
    /// A limit of the mechanism was passed.
    Limit(LimitPassed),
    /// The loop with a rig comes to another phase.
    Phase(Phase),
    /// The supervisor stops the rig.
    SafetyStop(Trip),
    /// Ticks of the loop were left out.
    MissedTicks {
        /// How many.
        missed: u64,
        /// How late the wake-up was, ms.
        lateness_ms: f64,
    },
    /// The compensator has given its model up and goes on with its command alone.
    FellBack {
        /// Its name.
        method: &'static str,
        /// Force measured at port 4 less the expected one, N.
        residual_n: f64,
    },
    /// The loop has added energy: above a tenth of its budget, or above half of it, from where it is damped.
    EnergyGained {
        /// Over the kinetic energy of the relative motion.
        share: f64,
        /// J.
        energy_j: f64,
        /// Whether it is damped.
        damped: bool,
    },
    /// How near a run with a rig came to the simulated system.
    Fidelity(Box<Fidelity>),
    /// Something that no bound asks about and a reader should know.
    Warning(String),
    /// The end of the run.
    Outcome {
        /// How it ended.
        outcome: Outcome,
        /// Why.
        reason: String,
        /// When it was decided, s.
        decided_s: f64,
    },
}

const fn body_name(body: Body) -> &'static str {
    match body {
        Body::Chaser => "chaser",
        Body::Target => "target",
    }
}

/// Felt and hardware over the longer windows, as far as they are known.
fn fidelity_words(f: &Fidelity) -> String {
    let share = |x: Option<f64>| x.map_or("–".to_owned(), |x| format!("{:.1} %", 100.0 * x));
    let ratio = |x: Option<f64>| x.map_or("–".to_owned(), |x| format!("{x:.3}"));
    let mut out = Vec::new();
    for (name, of) in [("felt", f.felt), ("hardware", f.hardware)] {
        let windows = of.iter().flat_map(FidelityOf::windows).skip(1);
        for (window, x) in windows.filter(|(_, x)| x.window_s.is_some()) {
            out.push(format!(
                "{name} {} peak {}, force {}, moment {}, pose {} off",
                window.replace('_', " "),
                ratio(x.peak_force_ratio),
                share(x.nrms_force),
                share(x.nrms_moment),
                share(x.nrms_pose)
            ));
        }
        if let Some(t) = of.and_then(|of| of.capture_difference_s) {
            out.push(format!("{name} capture {:+.2} ms", t * 1e3));
        }
    }
    out.join("; ")
}

fn missed_ticks(t: f64, missed: u64, lateness_ms: f64) -> (String, Value) {
    (
        format!("t = {t:.3} s {missed} ticks left out: woken {lateness_ms:.3} ms late"),
        json!({ "missed": missed, "lateness_ms": lateness_ms }),
    )
}

fn fell_back(t: f64, method: &str, residual_n: f64) -> (String, Value) {
    let text = format!(
        "t = {t:.3} s `{method}` gives its model up, {residual_n:.0} N off what is measured, and goes on with \
         its command alone"
    );
    (text, json!({ "compensator": method, "residual_n": residual_n }))
}

fn energy_gained(t: f64, [share, energy_j]: [f64; 2], damped: bool) -> (String, Value) {
    let damping = if damped { ", and is damped" } else { "" };
    let percent = share * 100.0;
    (
        format!(
            "t = {t:.3} s the loop has added {percent:.2} % of the kinetic energy, {energy_j:.3} J{damping}"
        ),
        json!({ "share": share, "energy_j": energy_j, "damped": damped }),
    )
}

impl RunEvent {
    /// The stable word for it in `events.jsonl`.
    #[must_use]
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::ContactBegin { .. } => "contact_begin",
            Self::ContactEnd { .. } => "contact_end",
            Self::Latch { phase: LatchPhase::Free, .. } => "latch_free",
            Self::Latch { phase: LatchPhase::Approach, .. } => "latch_approach",
            Self::Latch { phase: LatchPhase::Struck, .. } => "latch_strike",
            Self::Latch { phase: LatchPhase::Latched, .. } => "latched",
            Self::Captured { .. } => "captured",
            Self::Thrust { active: true, .. } => "thrust_on",
            Self::Thrust { active: false, .. } => "thrust_off",
            Self::Limit(_) => "limit",
            Self::Phase(_) => "phase",
            Self::SafetyStop(_) => "safety_stop",
            Self::MissedTicks { .. } => "missed_ticks",
            Self::FellBack { .. } => "fell_back",
            Self::EnergyGained { .. } => "energy_gained",
            Self::Fidelity(_) => "fidelity",
            Self::Warning(_) => "warning",
            Self::Outcome { .. } => "outcome",
        }
    }

    /// As it is recorded, with a sentence for a reader. `pair_name` names a pair of surfaces.
    #[must_use]
    pub fn record(
        &self,
        tick: Tick,
        time: SimTime,
        pair_name: impl Fn(SurfacePair) -> String,
    ) -> Event {
        let (text, body) = self.words(time.seconds(), pair_name);
        Event::new(tick, time, self.kind(), text, body)
    }

    fn words(&self, t: f64, pair_name: impl Fn(SurfacePair) -> String) -> (String, Value) {
        match self {
            Self::ContactBegin { pair, force_n } => {
                let pair = pair_name(*pair);
                (format!("t = {t:.3} s {pair} touch"), json!({ "pair": pair, "force_n": force_n }))
            }
            Self::ContactEnd { pair, since_s, until_s, peak_n } => {
                let pair = pair_name(*pair);
                (
                    format!(
                        "t = {until_s:.3} s {pair} part after {:.3} s, peak {:.2} kN",
                        until_s - since_s,
                        peak_n * 1e-3
                    ),
                    json!({
                        "pair": pair, "since_s": since_s, "until_s": until_s, "peak_n": peak_n,
                    }),
                )
            }
            Self::Latch { latch, phase, gap_m } => {
                let word = match phase {
                    LatchPhase::Free => "is free again",
                    LatchPhase::Approach => "approaches its striker",
                    LatchPhase::Struck => "is struck",
                    LatchPhase::Latched => "has caught",
                };
                (
                    format!("t = {t:.3} s latch {} {word}", latch + 1),
                    json!({ "latch": latch + 1, "gap_m": gap_m }),
                )
            }
            Self::Captured { capture_s, own_latches } => (
                if *own_latches {
                    format!("t = {capture_s:.3} s the latches that make a capture hold")
                } else {
                    format!("t = {capture_s:.3} s all three latches hold: the rings are joined")
                },
                json!({ "capture_s": capture_s }),
            ),
            Self::Thrust { on, active } => {
                let (name, word) = (body_name(*on), if *active { "on" } else { "off" });
                (format!("t = {t:.3} s thrust of the {name} {word}"), json!({ "on": name }))
            }
            Self::Limit(l) => (
                format!(
                    "t = {:.3} s {} passed its limit of {:.4}: {:.4}",
                    l.time_s, l.name, l.limit, l.reached
                ),
                json!({ "limit": l.name, "value": l.limit, "reached": l.reached }),
            ),
            Self::Phase(phase) => {
                (format!("t = {t:.3} s {}", phase.name()), json!({ "phase": phase.name() }))
            }
            Self::SafetyStop(trip) => (
                format!(
                    "t = {t:.3} s the supervisor stops the rig: {} {:.4}, allowed {:.4}",
                    trip.limit.name(),
                    trip.value,
                    trip.allowed
                ),
                json!({
                    "limit": trip.limit.name(), "value": trip.value, "allowed": trip.allowed,
                }),
            ),
            Self::MissedTicks { missed, lateness_ms } => missed_ticks(t, *missed, *lateness_ms),
            Self::FellBack { method, residual_n } => fell_back(t, method, *residual_n),
            Self::EnergyGained { share, energy_j, damped } => {
                energy_gained(t, [*share, *energy_j], *damped)
            }
            Self::Fidelity(f) => (
                format!("against the simulated system: {}", fidelity_words(f)),
                // Plain numbers and nulls: it always serialises.
                serde_json::to_value(f).unwrap_or_default(),
            ),
            Self::Warning(what) => (format!("warning: {what}"), json!({ "warning": what })),
            Self::Outcome { outcome, reason, decided_s } => (
                format!("{outcome}: {reason}"),
                json!({ "outcome": outcome.to_string(), "decided_s": decided_s }),
            ),
        }
    }
}
