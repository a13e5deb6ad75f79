use core::fmt;
use std::collections::BTreeMap;

use serde::{Deserialize, Deserializer, Serialize};

/// Version of `summary.json`; a reader refuses a newer one.
pub const SUMMARY_SCHEMA: u32 = 2;

/// How a docking ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// All latches hold.
    Captured,
    /// Contact, then parted.
    Rebounded,
    /// Passed by without contact.
    Missed,
    /// In contact and stuck without capture.
    Jammed,
    /// A limit of the scenario was exceeded.
    LimitExceeded,
    /// Ended by a stop.
    Stopped,
}

/// Whether a run ended as its scenario expects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// As expected.
    Pass,
    /// Otherwise.
    Fail,
    /// As expected, but not under the conditions asked for.
    Degraded,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Captured => "captured",
            Self::Rebounded => "rebounded",
            Self::Missed => "missed",
            Self::Jammed => "jammed",
            Self::LimitExceeded => "limit_exceeded",
            Self::Stopped => "stopped",
        })
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pass => "pass",
            Self::Fail => "fail",
            Self::Degraded => "degraded",
        })
    }
}

/// JSON has no NaN and no infinity: they are written as null and come back as NaN.
fn null_is_nan<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(d)?.unwrap_or(f64::NAN))
}

/// Computing time of a step, µs of wall time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StepUs {
    /// Median.
    #[serde(deserialize_with = "null_is_nan")]
    pub p50: f64,
    /// 99th percentile.
    #[serde(deserialize_with = "null_is_nan")]
    pub p99: f64,
    /// 99.9th percentile.
    #[serde(deserialize_with = "null_is_nan")]
    pub p999: f64,
    /// Longest.
    #[serde(deserialize_with = "null_is_nan")]
    pub max: f64,
    /// Steps counted.
    pub n: u64,
}

/// How late the loop woke, µs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LatenessUs {
    /// Median.
    #[serde(deserialize_with = "null_is_nan")]
    pub p50: f64,
    /// 99th percentile.
    #[serde(deserialize_with = "null_is_nan")]
    pub p99: f64,
    /// 99.9th percentile.
    #[serde(deserialize_with = "null_is_nan")]
    pub p999: f64,
    /// Latest.
    #[serde(deserialize_with = "null_is_nan")]
    pub max: f64,
}

/// Duration of one phase of the loop, µs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PhaseUs {
    /// Median.
    #[serde(deserialize_with = "null_is_nan")]
    pub p50: f64,
    /// 99th percentile.
    #[serde(deserialize_with = "null_is_nan")]
    pub p99: f64,
    /// Longest.
    #[serde(deserialize_with = "null_is_nan")]
    pub max: f64,
}

/// How the loop kept its time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LoopSummary {
    /// Period, µs.
    #[serde(deserialize_with = "null_is_nan")]
    pub period_us: f64,
    /// Ticks that began late.
    pub late: u64,
    /// Ticks that were left out.
    pub missed: u64,
    /// Lateness of waking.
    pub lateness_us: LatenessUs,
    /// Durations by phase.
    pub phases: BTreeMap<String, PhaseUs>,
    /// Lead of the compensator, ms; null in summaries before it was told.
    #[serde(default)]
    pub lead_ms: Option<f64>,
    /// The lead that is believed to undo the rig, ms: delay and lag of its drives and of sensor A, by its file or
    /// by identification and calibration.
    #[serde(default)]
    pub believed_lead_ms: Option<f64>,
}

/// The HIL run against the simulated system; null where not defined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(non_snake_case, reason = "the names of the paper, as summary.json has them")]
pub struct Fidelity {
    /// Ratio of the exit to the entry velocity, over that of the simulated system.
    pub R_e: Option<f64>,
    /// Ratio of contact durations.
    pub R_T: Option<f64>,
    /// Peak force over that of the simulated system.
    pub peak_force_ratio: Option<f64>,
    /// Normalised RMS difference of the force.
    pub nrms_force: Option<f64>,
    /// Normalised RMS difference of the pose.
    pub nrms_pose: Option<f64>,
    /// Energy gained by the loop, relative.
    pub delta_energy: Option<f64>,
    /// First contact later than that of the simulated system, s; interpolated below the tick.
    #[serde(default)]
    pub first_contact_difference_s: Option<f64>,
    /// What the bodies' programme received; `None` in summaries before 0.3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub felt: Option<FidelityOf>,
    /// What the article on the rig bore; `None` in summaries before 0.3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hardware: Option<FidelityOf>,
}

impl Fidelity {
    /// Every figure by its dotted key, in the order of the file; those that a summary before 0.3 does not
    /// have are left out.
    #[must_use]
    pub fn figures(&self) -> Vec<(String, Option<f64>)> {
        let mut out: Vec<(String, Option<f64>)> = [
            ("R_e", self.R_e),
            ("R_T", self.R_T),
            ("peak_force_ratio", self.peak_force_ratio),
            ("nrms_force", self.nrms_force),
            ("nrms_pose", self.nrms_pose),
            ("delta_energy", self.delta_energy),
        ]
        .map(|(key, x)| (key.to_owned(), x))
        .into();
        for (name, of) in [("felt", self.felt), ("hardware", self.hardware)] {
            let Some(of) = of else { continue };
            for (window, f) in of.windows() {
                let figures = f.figures().into_iter();
                out.extend(figures.map(|(key, x)| (format!("{name}.{window}.{key}"), x)));
            }
            for (i, t) in of.latch_difference_s.into_iter().enumerate() {
                out.push((format!("{name}.latch_difference_s.{i}"), t));
            }
            out.push((format!("{name}.capture_difference_s"), of.capture_difference_s));
        }
        if self.felt.is_some() {
            out.push(("first_contact_difference_s".to_owned(), self.first_contact_difference_s));
        }
        out
    }
}

impl FidelityOf {
    /// The three windows by their keys.
    #[must_use]
    pub const fn windows(&self) -> [(&'static str, FidelityFigures); 3] {
        [
            ("to_first_latch", self.to_first_latch),
            ("to_capture", self.to_capture),
            ("whole_run", self.whole_run),
        ]
    }
}

/// A window whose simulated force stays below this share of the run's largest says little by its ratios: a
/// large part of little.
const SMALL_FORCE: f64 = 0.5;

impl FidelityOf {
    /// Where the forces of a window are small beside those of the run: its largest simulated force and that of
    /// the run, N.
    #[must_use]
    pub fn small_forces(&self, window: &FidelityFigures) -> Option<[f64; 2]> {
        let (peak, most) = (window.simulated_peak_force_n?, self.whole_run.simulated_peak_force_n?);
        (peak < SMALL_FORCE * most).then_some([peak, most])
    }
}

impl FidelityFigures {
    /// The figures by their keys.
    #[must_use]
    pub const fn figures(&self) -> [(&'static str, Option<f64>); 10] {
        [
            ("window_s", self.window_s),
            ("simulated_peak_force_n", self.simulated_peak_force_n),
            ("peak_force_ratio", self.peak_force_ratio),
            ("peak_moment_ratio", self.peak_moment_ratio),
            ("nrms_force", self.nrms_force),
            ("nrms_moment", self.nrms_moment),
            ("nrms_pose", self.nrms_pose),
            ("nrms_attitude", self.nrms_attitude),
            ("impulse_ratio", self.impulse_ratio),
            ("delta_energy", self.delta_energy),
        ]
    }
}

/// One of the two comparisons with the simulated system: in three windows, all from first contact, and by
/// the times of the latches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FidelityOf {
    /// To the first latch of the simulated system.
    pub to_first_latch: FidelityFigures,
    /// To one second after the capture of the simulated system.
    pub to_capture: FidelityFigures,
    /// To the end of the run.
    pub whole_run: FidelityFigures,
    /// How much later than in the simulated system each latch caught, s.
    pub latch_difference_s: [Option<f64>; 3],
    /// How much later than in the simulated system the last latch caught, s.
    pub capture_difference_s: Option<f64>,
}

/// Figures of one window; null where one means nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FidelityFigures {
    /// Length of the window, s; null where the run did not last to its end.
    pub window_s: Option<f64>,
    /// Largest |F4| of the simulated system, N; `None` in summaries before 0.3.
    #[serde(default)]
    pub simulated_peak_force_n: Option<f64>,
    /// Largest |F4| over that of the simulated system.
    pub peak_force_ratio: Option<f64>,
    /// Largest |M4| over that of the simulated system.
    pub peak_moment_ratio: Option<f64>,
    /// RMS of the difference of F4 over the RMS of F4 of the simulated system.
    pub nrms_force: Option<f64>,
    /// The same of M4.
    pub nrms_moment: Option<f64>,
    /// RMS of the difference of `p_34` over the RMS of the simulated one about its mean.
    pub nrms_pose: Option<f64>,
    /// The same of the attitude `R_34`, by rotation vectors.
    pub nrms_attitude: Option<f64>,
    /// Impulse of F4 along that of the simulated system, over the latter.
    pub impulse_ratio: Option<f64>,
    /// Energy that the ports gave the motion, less that of the simulated system, over the kinetic energy at
    /// the start.
    pub delta_energy: Option<f64>,
}

/// What was done against the delay of the rig and what the rig adds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CompensatorSummary {
    /// Name of the method.
    pub name: String,
    /// Its lead, s; 0 where it has none.
    pub lead_s: f64,
    /// RMS over the closed loop of the force that a method with a model added at port 4, N.
    pub correction_rms_n: Option<f64>,
    /// The same of the force measured there less what its model of the rig expected to measure.
    pub residual_rms_n: Option<f64>,
    /// Share of the model's correction that was applied, 0 to 1: its mean over the closed loop.
    pub trust_mean: Option<f64>,
    /// Its least.
    pub trust_min: Option<f64>,
    /// When the model was given up, s; null where it was not.
    pub fell_back_s: Option<f64>,
}

/// What the safety supervisor saw.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SafetySummary {
    /// Its state at the end.
    pub state: String,
    /// Trips in order.
    pub trips: Vec<String>,
    /// Smallest margin to each limit, by the limit's name.
    pub min_margin: BTreeMap<String, f64>,
}

/// What was recorded; filled in by [`crate::RunWriter::finish`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordingSummary {
    /// What happened when the recorder was slower than the run: `wait` or `drop_newest`.
    pub policy: String,
    /// Ticks recorded.
    pub ticks: u64,
    /// Ticks lost because the ring was full.
    pub dropped_ticks: u64,
    /// Events lost because the ring was full.
    pub dropped_events: u64,
    /// Size of `run.mcap`, bytes.
    pub log_bytes: u64,
    /// Size of `telemetry.parquet`, bytes.
    pub table_bytes: u64,
    /// Chained digest of all events of the log, hexadecimal; none in recordings before 0.2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub events_digest: Option<String>,
    /// Why the recording ends before the run, in one line; `ticks` then counts those that are
    /// safe, and at most one chunk more can be read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// Masses of what moves, kg.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Masses {
    /// Chaser without the ring of its mechanism.
    pub chaser: f64,
    /// Target.
    pub target: f64,
    /// Active ring with its petals; where it does not move in the chaser, it belongs to it.
    pub ring: f64,
}

/// `summary.json`, in its order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// [`SUMMARY_SCHEMA`].
    pub schema_version: u32,
    /// Version of docktwin.
    pub tool_version: String,
    /// Name of the scenario.
    pub scenario: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Digest of the last state, hexadecimal.
    pub state_digest: String,
    /// How it ended.
    pub outcome: Outcome,
    /// Whether that was expected.
    pub verdict: Verdict,
    /// One line, or null.
    pub failure_reason: Option<String>,
    /// First contact, s.
    pub first_contact_s: Option<f64>,
    /// Capture, s.
    pub capture_s: Option<f64>,
    /// Each latch, s.
    pub latches_s: Vec<Option<f64>>,
    /// Largest contact force, N.
    #[serde(deserialize_with = "null_is_nan")]
    pub peak_force_n: f64,
    /// Largest contact moment, N·m.
    #[serde(deserialize_with = "null_is_nan")]
    pub peak_moment_nm: f64,
    /// Impulse of the contact force, N·s.
    #[serde(deserialize_with = "null_is_nan")]
    pub impulse_ns: f64,
    /// Size of the time integral of the force on the target over the whole run, N·s; none in recordings
    /// before 0.3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub net_impulse_ns: Option<f64>,
    /// Deepest penetration, m.
    #[serde(deserialize_with = "null_is_nan")]
    pub peak_penetration_m: f64,
    /// Masses of what moves; none in recordings before 0.3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<Masses>,
    /// Energy brought in, J.
    #[serde(deserialize_with = "null_is_nan")]
    pub energy_in_j: f64,
    /// Energy dissipated, J.
    #[serde(deserialize_with = "null_is_nan")]
    pub energy_dissipated_j: f64,
    /// Error of the energy balance, relative.
    #[serde(deserialize_with = "null_is_nan")]
    pub energy_balance_error: f64,
    /// Error of the momentum balance, relative.
    #[serde(deserialize_with = "null_is_nan")]
    pub momentum_error: f64,
    /// Simulated time, s.
    #[serde(deserialize_with = "null_is_nan")]
    pub duration_s: f64,
    /// Ticks run.
    pub ticks: u64,
    /// Wall time, s.
    #[serde(deserialize_with = "null_is_nan")]
    pub wall_s: f64,
    /// Simulated over wall time.
    #[serde(deserialize_with = "null_is_nan")]
    pub realtime_factor: f64,
    /// Computing time of a step.
    pub step_us: StepUs,
    /// HIL only.
    #[serde(rename = "loop", default, skip_serializing_if = "Option::is_none")]
    pub loop_: Option<LoopSummary>,
    /// HIL only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fidelity: Option<Fidelity>,
    /// HIL only; none in summaries before 0.3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compensator: Option<CompensatorSummary>,
    /// HIL only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub safety: Option<SafetySummary>,
    /// What the verdict does not say and a reader should know, one line each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// Bounds of the scenario's `expect`, by key, that a run of this kind does not judge.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_judged: Vec<String>,
    /// Give `None`: [`crate::RunWriter::finish`] fills it in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recording: Option<RecordingSummary>,
    /// Chained digest of all rows of the log, hexadecimal. Give `None`: [`crate::RunWriter::finish`] fills it
    /// in; none in recordings before 0.2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub record_digest: Option<String>,
    /// Digest of all other keys, hexadecimal. Give `None`, as above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub summary_digest: Option<String>,
}

impl Summary {
    /// Of a run of which nothing else is known: every figure is null, and written by this version.
    #[must_use]
    pub fn new(scenario: &str, outcome: Outcome, verdict: Verdict) -> Self {
        Self {
            schema_version: SUMMARY_SCHEMA,
            tool_version: env!("CARGO_PKG_VERSION").to_owned(),
            scenario: scenario.to_owned(),
            seed: 0,
            state_digest: String::new(),
            outcome,
            verdict,
            failure_reason: None,
            first_contact_s: None,
            capture_s: None,
            latches_s: vec![None; 3],
            peak_force_n: f64::NAN,
            peak_moment_nm: f64::NAN,
            impulse_ns: f64::NAN,
            net_impulse_ns: None,
            peak_penetration_m: f64::NAN,
            mass_kg: None,
            energy_in_j: f64::NAN,
            energy_dissipated_j: f64::NAN,
            energy_balance_error: f64::NAN,
            momentum_error: f64::NAN,
            duration_s: f64::NAN,
            ticks: 0,
            wall_s: 0.0,
            realtime_factor: 0.0,
            step_us: StepUs::default(),
            loop_: None,
            fidelity: None,
            compensator: None,
            safety: None,
            warnings: Vec::new(),
            not_judged: Vec::new(),
            recording: None,
            record_digest: None,
            summary_digest: None,
        }
    }

    /// Notes that the run was stopped before its end: that is its outcome, and never a pass.
    pub fn stop(&mut self, why: &str) {
        self.outcome = Outcome::Stopped;
        self.verdict = Verdict::Fail;
        self.failure_reason = Some(why.to_owned());
    }

    /// Notes that the run did not have the conditions asked for, such as a recording to its end: a
    /// pass becomes `degraded`, and the reason is told.
    pub fn degrade(&mut self, why: &str) {
        if self.verdict == Verdict::Pass {
            self.verdict = Verdict::Degraded;
        }
        match &mut self.failure_reason {
            Some(reason) if reason.contains(why) => {}
            Some(reason) => {
                reason.push_str("; ");
                reason.push_str(why);
            }
            None => self.failure_reason = Some(why.to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_infinite_numbers_come_back_as_nan() {
        let s = StepUs { p50: f64::INFINITY, p99: 0.1, p999: f64::NAN, max: 3.0, n: 2 };
        let text = serde_json::to_string(&s).unwrap();
        assert_eq!(text, r#"{"p50":null,"p99":0.1,"p999":null,"max":3.0,"n":2}"#);
        let back: StepUs = serde_json::from_str(&text).unwrap();
        assert!(back.p50.is_nan() && back.p999.is_nan());
        assert_eq!(back.p99.to_bits(), 0.1f64.to_bits());
    }
}
