//! Table 4 of the paper (§7.4): a spring stick between two stops, run through the body programme in six
//! degrees of freedom and the whole loop.
//!
//! Nothing is lost in the stick, so R_e (speed after over speed before, of the body programme) and
//! R_T (duration of contact over π√(m_r/K)) would both be 1; a deviation is an error of the loop.
//! [`crate::table4`] has one test; here many are run, on the rig and on rigs drawn within the
//! spread of its file, and put together. How a test reaches a rig is the caller's part
//! ([`vibro_impact`]); [`on_emulated_rig`] is one way.
//!
//! ```
//! # use std::path::Path;
//! # use docktwin_model::{load_mechanism, load_rig, load_spacecraft};
//! use docktwin_control::compensation::Compensation;
//! use docktwin_study::vibro_impact::{VibroModels, VibroOptions, on_emulated_rig, vibro_impact};
//!
//! # let at = |name: &str| Path::new("../../models/urdf").join(name);
//! let rig = load_rig(&at("stewart.toml"))?.model;
//! let stick = load_mechanism(&at("stick_active.urdf"), &at("stick_passive.urdf"), None)?.model;
//! let spacecraft = load_spacecraft(&at("test_2026kg.urdf"))?.model;
//! let models = VibroModels { rig: &rig, stick: &stick, spacecraft: &spacecraft };
//!
//! // Row 6 of Table 4 along X and along Y, nothing done against the delay of the rig.
//! let options = VibroOptions { cases: vec![6], ..VibroOptions::new(Compensation::None) };
//! let table = vibro_impact(&models, &options, &mut (), |test, draw| {
//!     on_emulated_rig(&rig, &options, test, draw)
//! })?;
//! // The loop adds energy: the spacecraft part faster than they came.
//! let along_x = &table.summary.tests[0].contacts[0];
//! assert!(along_x.r_e > 1.02 && along_x.delta_energy > 0.04);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod commissioned;
mod place;
mod unknown;

use core::{fmt, str::FromStr, time::Duration};

use docktwin_control::{
    compensation::{Compensation, MOST_LEAD_S},
    sensing::SensorScheme,
};
use docktwin_core::PERIOD_NS;
use docktwin_hil::{
    calibrate::Calibration,
    clock::{Clock, VirtualClock},
    emulated::{EmulatedRig, EmulationError},
    identify::Identification,
    scheduler::{Loop, RigParameters, TickRecord},
};
use docktwin_model::{DockingMechanism, HydraulicPreset, Rig, Spacecraft};
use docktwin_rigport::{in_process::InProcess, rig::Rig as RigPort};
use serde::{Deserialize, Serialize};

use crate::{
    Progress,
    parallel::in_parallel,
    table4::{Axis, Contact, Row, Sample, TABLE_4, VibroError, VibroRun, VibroSettings, VibroTest},
};

pub use self::{
    commissioned::commissioned,
    place::{PlacedTestError, StickModels, on_rig},
    unknown::{Unknown, in_corner},
};

/// Rows that the paper has; one more, at 5 Hz, is docktwin's.
pub const PAPER_CASES: usize = 6;
/// Rows that there are.
pub const CASES: usize = TABLE_4.len();
/// Most contacts of one test.
const MOST_CONTACTS: u32 = 1000;
/// How long a rig in this process may take over a tick.
const PATIENCE: Duration = Duration::from_secs(5);

/// Axes along which both spacecraft move at once; the first is judged. In words `x`, `roll`, or
/// `x+y+roll`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AxisSet(Vec<Axis>);

impl AxisSet {
    /// The axes, at least one.
    #[must_use]
    pub fn axes(&self) -> &[Axis] {
        &self.0
    }
}

impl fmt::Display for AxisSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = self.0.iter().map(|a| a.name()).collect();
        f.write_str(&names.join("+"))
    }
}

/// What is no set of axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an axis is x, y, z, roll, pitch or yaw; join several by +")]
pub struct NoAxes;

impl FromStr for AxisSet {
    type Err = NoAxes;

    fn from_str(text: &str) -> Result<Self, NoAxes> {
        let known = |word: &str| Axis::ALL.iter().find(|(name, _)| *name == word).map(|(_, a)| *a);
        text.split('+').map(known).collect::<Option<_>>().map(Self).ok_or(NoAxes)
    }
}

/// The models of a test.
#[derive(Clone, Copy, Debug)]
pub struct VibroModels<'a> {
    /// The rig as its file describes it.
    pub rig: &'a Rig,
    /// A mechanism with a stick.
    pub stick: &'a DockingMechanism,
    /// Both spacecraft, but for mass and inertia, which are the row's.
    pub spacecraft: &'a Spacecraft,
}

/// What is run.
#[derive(Clone, Debug, PartialEq)]
pub struct VibroOptions {
    /// At least one.
    pub axes: Vec<AxisSet>,
    /// Rows of Table 4, 1 to [`CASES`], at least one; every one is run on every set of axes.
    pub cases: Vec<usize>,
    /// Against the delay of the rig; a lead is 0 to [`MOST_LEAD_S`].
    pub compensation: Compensation,
    /// What is believed of the rig besides its file, as `rig identify` found it.
    pub identification: Option<Identification>,
    /// What `rig calibrate` found of its sensors.
    pub calibration: Option<Calibration>,
    /// Where F4, M4 come from.
    pub scheme: SensorScheme,
    /// Contacts to run through in each test, 1 to 1000.
    pub contacts: u32,
    /// Drawn rigs on which every test is run too.
    pub draws: u32,
    /// Volume of the oil; without one, the rig file's default.
    pub preset: Option<HydraulicPreset>,
    /// Seed of the sensors' noise; drawn rigs have the seeds after it.
    pub seed: u64,
    /// What an emulated rig has and the loop does not believe.
    pub unknown: Unknown,
    /// Ticks by which every command is held back, which the lead does not follow by itself.
    pub added_ticks: usize,
}

impl VibroOptions {
    /// X and Y in the paper's six rows, one contact, sensor A, no drawn rigs.
    #[must_use]
    pub fn new(compensation: Compensation) -> Self {
        let [(_, x), (_, y), ..] = Axis::ALL;
        Self {
            axes: [x, y].map(|a| AxisSet(vec![a])).into(),
            cases: (1..=PAPER_CASES).collect(),
            compensation,
            identification: None,
            calibration: None,
            scheme: SensorScheme::Single,
            contacts: 1,
            draws: 0,
            preset: None,
            seed: 0,
            unknown: Unknown::NOTHING,
            added_ticks: 0,
        }
    }

    /// Whether they can be run on a rig.
    ///
    /// # Errors
    /// All that is wrong with them.
    pub fn check(&self, rig: &Rig) -> Result<(), Vec<String>> {
        let mut problems = Vec::new();
        let mut require = |right: bool, what: String| {
            if !right {
                problems.push(what);
            }
        };
        require(!self.axes.is_empty(), "`axes` is empty: give at least one set".to_owned());
        require(!self.cases.is_empty(), "`cases` is empty: give at least one row".to_owned());
        for case in self.cases.iter().filter(|c| !(1..=CASES).contains(*c)) {
            require(false, format!("`cases` has {case}: rows are 1 to {CASES}"));
        }
        let contacts = self.contacts;
        require(
            (1..=MOST_CONTACTS).contains(&contacts),
            format!("`contacts` = {contacts}: give 1 to {MOST_CONTACTS}"),
        );
        let lead_s = self.compensation.lead_s();
        require(
            (0.0..=MOST_LEAD_S).contains(&lead_s),
            format!("a lead of {lead_s} s: give 0 to {MOST_LEAD_S} s"),
        );
        require(
            self.preset.is_none() || rig.drive.hydraulic().is_some(),
            format!(
                "an oil volume is asked for, and no oil moves {}: leave the preset out",
                rig.name
            ),
        );
        require(
            self.scheme == SensorScheme::Single || rig.sensors.is_some_and(|s| s.plate_force),
            format!("{} has no sensor B: take the sensors \"single\"", rig.name),
        );
        problems.extend(self.unknown.problems());
        if problems.is_empty() { Ok(()) } else { Err(problems) }
    }

    /// The drawn rig with index `i`, from 0.
    #[must_use]
    pub const fn draw(&self, i: usize) -> RigDraw {
        RigDraw::Seed(self.seed.wrapping_add(i as u64 + 1))
    }

    /// What is believed of the rig.
    #[must_use]
    pub fn parameters(&self, rig: &Rig) -> RigParameters {
        RigParameters::new(rig, self.identification.as_ref(), self.calibration.as_ref())
    }

    /// How one test is run. `session` is the number of the run at the port.
    #[must_use]
    pub fn settings(&self, rig: &Rig, session: u64, patience: Duration) -> VibroSettings {
        VibroSettings {
            preset: rig.preset(self.preset),
            parameters: Some(self.parameters(rig)),
            compensation: self.compensation,
            scheme: self.scheme,
            contacts: self.contacts,
            added_ticks: self.added_ticks,
            session,
            patience,
        }
    }
}

/// The rig that a test runs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RigDraw {
    /// As its file says; the noise has the options' seed.
    File,
    /// Drawn within the spread of its file with this seed.
    Seed(u64),
}

/// Why there is no Table 4.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VibroImpactError<E> {
    /// Options outside of what is allowed: all of them.
    #[error("{}", .0.join("; "))]
    Options(Vec<String>),
    /// The mechanism has no stick.
    #[error("the mechanism {mechanism} has no table [stick]")]
    NoStick {
        /// Name of the mechanism.
        mechanism: String,
    },
    /// A test could not be run.
    #[error(transparent)]
    Run(#[from] E),
}

/// Table 4 as it was run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VibroImpact {
    /// The answer in figures.
    pub summary: VibroSummary,
    /// Every test, in the order of `summary.tests`.
    pub records: Vec<VibroRecord>,
}

/// Table 4 in figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VibroSummary {
    /// Volume of the oil; `None` where no oil moves the legs.
    pub preset: Option<HydraulicPreset>,
    /// Name of the compensator.
    pub compensator: String,
    /// Its lead, s.
    pub lead_s: f64,
    /// Where F4, M4 come from.
    pub sensors: Sensors,
    /// By axes, then by row.
    pub tests: Vec<VibroFigures>,
}

impl VibroSummary {
    /// Whether every test was run to its end and had a contact.
    #[must_use]
    pub fn complete(&self) -> bool {
        self.tests.iter().all(|t| t.stopped_by.is_none() && !t.contacts.is_empty())
    }
}

/// Where F4, M4 come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sensors {
    /// From sensor A by (12), (13).
    Single,
    /// From sensor B.
    Two,
}

impl From<SensorScheme> for Sensors {
    fn from(scheme: SensorScheme) -> Self {
        match scheme {
            SensorScheme::Single => Self::Single,
            SensorScheme::Two => Self::Two,
        }
    }
}

/// One test in figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VibroFigures {
    /// Axes that moved, joined by `+`; the first is judged.
    pub axis: String,
    /// Row of Table 4, from 1.
    pub case: usize,
    /// Natural frequency as printed, Hz.
    pub frequency_hz: f64,
    /// Nominal length of the stick, m.
    pub length_m: f64,
    /// Stiffness of the stick, N/m.
    pub stiffness_n_m: f64,
    /// Mass of each spacecraft, kg.
    pub mass_kg: f64,
    /// Approach speed, m/s.
    pub speed_m_s: f64,
    /// What the paper has in this row on this axis.
    pub paper: Option<PaperRatios>,
    /// Contacts that began and ended, in their order.
    pub contacts: Vec<ContactFigures>,
    /// The first contact on every drawn rig; `None` where there was no whole one.
    pub draws: Vec<Option<ContactFigures>>,
    /// The limit at which the supervisor stopped the test on the rig of the file.
    pub stopped_by: Option<String>,
    /// How the loop kept its time.
    #[serde(rename = "loop")]
    pub loop_: LoopTiming,
}

/// R_e and R_T of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PaperRatios {
    /// (19).
    #[serde(rename = "R_e")]
    pub r_e: f64,
    /// (18).
    #[serde(rename = "R_T")]
    pub r_t: f64,
}

/// One contact as Table 4 judges it; ratios are over the simulated system, fractions of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactFigures {
    /// (19): speed after over speed before, of the body programme.
    #[serde(rename = "R_e")]
    pub r_e: f64,
    /// (18): duration over π√(m_r/K), from the true force, or the sensed one where there is no other.
    #[serde(rename = "R_T")]
    pub r_t: f64,
    /// (18) from the sensed force.
    #[serde(rename = "R_T_sensed")]
    pub r_t_sensed: f64,
    /// Peak force over that of the simulated system.
    pub peak_force_ratio: f64,
    /// RMS error of the force over the RMS of the simulated system's, aligned at the onset.
    pub nrms_force: f64,
    /// The same of the position of the rod's end beyond the play.
    pub nrms_position: f64,
    /// Energy gained over the energy before, R_e² − 1.
    pub delta_energy: f64,
    /// Onset, s since the loop was closed.
    pub begin_s: f64,
    /// Speed before, with its sign, m/s; of a rotation at the lever of the stick.
    pub v0_m_s: f64,
    /// Speed after, with its sign, m/s.
    pub v1_m_s: f64,
}

impl From<&Contact> for ContactFigures {
    fn from(c: &Contact) -> Self {
        Self {
            r_e: c.r_e,
            r_t: c.r_t,
            r_t_sensed: c.r_t_sensed,
            peak_force_ratio: c.peak_ratio,
            nrms_force: c.nrms_force,
            nrms_position: c.nrms_position,
            delta_energy: c.delta_energy,
            begin_s: c.begin_s,
            v0_m_s: c.v0_m_s,
            v1_m_s: c.v1_m_s,
        }
    }
}

/// How the loop kept its time in a test.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LoopTiming {
    /// Ticks that were run.
    pub ticks: u64,
    /// Ticks that were left out.
    pub missed_ticks: u64,
    /// Ticks without a measurement of their own.
    pub ticks_without_measurement: u64,
    /// Latest wake-up, ms after its time.
    pub lateness_max_ms: f64,
    /// What the machine did not grant; `None` where nothing is lacking.
    pub best_effort: Option<String>,
}

impl LoopTiming {
    /// Counts a tick.
    fn add(&mut self, r: &TickRecord) {
        #[expect(clippy::cast_precision_loss, reason = "far below 2^53 ns")]
        let late_ms = r.lateness_ns as f64 * 1e-6;
        self.ticks += 1;
        self.missed_ticks += r.missed;
        self.ticks_without_measurement += u64::from(!r.fresh);
        self.lateness_max_ms = self.lateness_max_ms.max(late_ms);
    }
}

/// One test on one rig.
#[derive(Clone, Debug, PartialEq)]
pub struct TestRun {
    /// The closed loop and its contacts.
    pub run: VibroRun,
    /// How the loop kept its time.
    pub timing: LoopTiming,
}

/// Figures of drawn rigs; a deviation is |ratio − 1|, a fraction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DrawStatistics {
    /// Rigs that were drawn.
    pub rigs: usize,
    /// Those on which there was a whole contact, above 0.
    pub judged: usize,
    /// Mean deviation of R_e.
    pub r_e_mean: f64,
    /// Largest deviation of R_e.
    pub r_e_worst: f64,
    /// Mean deviation of R_T.
    pub r_t_mean: f64,
    /// Largest deviation of R_T.
    pub r_t_worst: f64,
    /// Largest deviation of the peak force.
    pub peak_worst: f64,
    /// Mean of NRMS of the force.
    pub nrms_force_mean: f64,
    /// Largest NRMS of the force.
    pub nrms_force_worst: f64,
}

impl VibroFigures {
    /// What the drawn rigs came to; `None` where none was judged.
    #[must_use]
    pub fn draw_statistics(&self) -> Option<DrawStatistics> {
        let judged: Vec<&ContactFigures> = self.draws.iter().flatten().collect();
        if judged.is_empty() {
            return None;
        }
        #[expect(clippy::cast_precision_loss, reason = "a count of rigs")]
        let n = judged.len() as f64;
        let of = |off: fn(&ContactFigures) -> f64| {
            let sizes = || judged.iter().map(|c| off(c).abs());
            (sizes().sum::<f64>() / n, crate::number::largest(sizes()))
        };
        let (r_e_mean, r_e_worst) = of(|c| c.r_e - 1.0);
        let (r_t_mean, r_t_worst) = of(|c| c.r_t - 1.0);
        let (nrms_force_mean, nrms_force_worst) = of(|c| c.nrms_force);
        Some(DrawStatistics {
            peak_worst: of(|c| c.peak_force_ratio - 1.0).1,
            nrms_force_mean,
            nrms_force_worst,
            rigs: self.draws.len(),
            judged: judged.len(),
            r_e_mean,
            r_e_worst,
            r_t_mean,
            r_t_worst,
        })
    }
}

/// A limit that stopped a test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stop {
    /// Name of the limit.
    pub limit: String,
    /// Reached, in the unit at the end of the name.
    pub value: f64,
    /// Allowed, likewise.
    pub allowed: f64,
}

/// One test, tick by tick, and the simulated system beside it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VibroRecord {
    /// The limit that stopped the test.
    pub stop: Option<Stop>,
    /// The closed loop.
    pub ticks: Vec<VibroTick>,
    /// The simulated system that this test would be.
    pub simulated: SimulatedStick,
}

/// One tick of the axis that is judged; rotations at the lever of the stick.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct VibroTick {
    /// Time since the loop was closed, s.
    pub time_s: f64,
    /// Relative position of the bodies, m from the middle of the frame.
    pub body_m: f64,
    /// Relative speed of the bodies, m/s.
    pub speed_m_s: f64,
    /// Relative position of the mechanisms, measured, m.
    pub measured_m: f64,
    /// True contact force on the target, N; emulated rigs only.
    pub true_force_n: Option<f64>,
    /// The same from the sensors, N.
    pub sensed_force_n: f64,
}

impl From<&Sample> for VibroTick {
    fn from(s: &Sample) -> Self {
        Self {
            time_s: s.time_s,
            body_m: s.body_m,
            speed_m_s: s.speed_m_s,
            measured_m: s.measured_m,
            true_force_n: s.true_force_n,
            sensed_force_n: s.sensed_force_n,
        }
    }
}

/// The stick without a loop: half a sine of force, then flight to the other side, and so on for ever,
/// from the onset of the first contact of a test on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulatedStick {
    /// Onset of the first contact, s since the loop was closed; `None` where there was none.
    pub onset_s: Option<f64>,
    /// Speed before it, with its sign, m/s.
    pub speed_m_s: f64,
    /// T_v of (17), s.
    pub contact_time_s: f64,
    /// Free play to either side, m.
    pub play_m: f64,
    /// Stiffness, N/m.
    pub stiffness_n_m: f64,
}

/// The simulated system at one time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulatedState {
    /// Force on the target, N.
    pub force_n: f64,
    /// Relative speed, m/s.
    pub speed_m_s: f64,
}

impl SimulatedStick {
    /// Force and speed at a time since the loop was closed, s.
    #[must_use]
    pub fn at(&self, time_s: f64) -> SimulatedState {
        let (v, sign) = (self.speed_m_s.abs(), self.speed_m_s.signum());
        let since = self.onset_s.map_or(-1.0, |onset| time_s - onset);
        if since < 0.0 {
            return SimulatedState { force_n: 0.0, speed_m_s: v * sign };
        }
        let rate = core::f64::consts::PI / self.contact_time_s;
        let period = self.contact_time_s + 2.0 * self.play_m / v;
        let n = (since / period).floor();
        let side = if (n / 2.0).fract() > 0.25 { -sign } else { sign };
        let into = since - n * period;
        if into < self.contact_time_s {
            let peak = v * self.stiffness_n_m / rate;
            SimulatedState {
                force_n: -peak * (rate * into).sin() * side,
                speed_m_s: v * (rate * into).cos() * side,
            }
        } else {
            SimulatedState { force_n: 0.0, speed_m_s: -v * side }
        }
    }
}

/// A test that was run, and its run.
struct Tested<'a> {
    axes: &'a AxisSet,
    case: usize,
    row: Row,
    contact_time_s: f64,
    play_m: f64,
    run: VibroRun,
    timing: LoopTiming,
    draws: Vec<Option<ContactFigures>>,
}

impl Tested<'_> {
    /// R_e and R_T of the paper, which has X and Y alone.
    fn paper(&self) -> Option<PaperRatios> {
        let column = match self.axes.axes() {
            [one] if one.name() == "x" => 0,
            [one] if one.name() == "y" => 1,
            _ => return None,
        };
        let [r_e, r_t] = self.row.paper?[column];
        Some(PaperRatios { r_e, r_t })
    }

    fn record(&self) -> VibroRecord {
        let first = self.run.contacts.first();
        VibroRecord {
            stop: self.run.trip.map(|t| Stop {
                limit: t.limit.name().to_owned(),
                value: t.value,
                allowed: t.allowed,
            }),
            ticks: self.run.samples.iter().map(VibroTick::from).collect(),
            simulated: SimulatedStick {
                onset_s: first.map(|c| c.begin_s),
                speed_m_s: first.map_or(self.row.speed_m_s, |c| c.v0_m_s),
                contact_time_s: self.contact_time_s,
                play_m: self.play_m,
                stiffness_n_m: self.row.stiffness_n_m,
            },
        }
    }

    fn figures(self) -> VibroFigures {
        VibroFigures {
            axis: self.axes.to_string(),
            case: self.case,
            frequency_hz: self.row.frequency_hz,
            length_m: self.row.length_m,
            stiffness_n_m: self.row.stiffness_n_m,
            mass_kg: self.row.mass_kg,
            speed_m_s: self.row.speed_m_s,
            paper: self.paper(),
            contacts: self.run.contacts.iter().map(ContactFigures::from).collect(),
            draws: self.draws,
            stopped_by: self.run.trip.map(|t| t.limit.name().to_owned()),
            loop_: self.timing,
        }
    }
}

/// Runs one test, on the rig of the file and on every drawn one.
fn test<'a, E: Send>(
    models: &VibroModels<'_>,
    options: &'a VibroOptions,
    (axes, case): (&'a AxisSet, usize),
    run: &(impl Fn(&VibroTest, RigDraw) -> Result<TestRun, E> + Sync),
) -> Result<Tested<'a>, VibroImpactError<E>> {
    let row = TABLE_4[case - 1];
    let no_stick = || VibroImpactError::NoStick { mechanism: models.stick.name.clone() };
    let stick = models.stick.stick.as_ref().ok_or_else(no_stick)?;
    let test =
        VibroTest::new(row, axes.axes(), models.spacecraft, models.stick).ok_or_else(no_stick)?;
    let TestRun { run: on_file, timing } = run(&test, RigDraw::File)?;
    let draws = in_parallel(options.draws as usize, &mut (), |i| {
        let draw = options.draw(i);
        let drawn = run(&options.unknown.test(&test, draw), draw)?.run;
        Ok::<_, E>(drawn.contacts.first().map(ContactFigures::from))
    })?;
    Ok(Tested {
        axes,
        case,
        row,
        contact_time_s: test.contact_time_s(),
        play_m: stick.play_m(),
        run: on_file,
        timing,
        draws,
    })
}

/// Runs rows of Table 4 and puts them together. `run` runs one test on the rig of the file or on a
/// drawn one: see [`on_rig`], [`run_test`] and [`on_emulated_rig`].
///
/// # Errors
/// See [`VibroImpactError`].
pub fn vibro_impact<E: Send>(
    models: &VibroModels<'_>,
    options: &VibroOptions,
    progress: &mut dyn Progress,
    run: impl Fn(&VibroTest, RigDraw) -> Result<TestRun, E> + Sync,
) -> Result<VibroImpact, VibroImpactError<E>> {
    options.check(models.rig).map_err(VibroImpactError::Options)?;
    let plan: Vec<(&AxisSet, usize)> =
        options.axes.iter().flat_map(|a| options.cases.iter().map(move |c| (a, *c))).collect();
    let (mut records, mut tests) = (Vec::new(), Vec::new());
    let of = u64::try_from(plan.len()).unwrap_or(u64::MAX);
    for (done, what) in (1..).zip(plan) {
        let tested = test(models, options, what, &run)?;
        records.push(tested.record());
        tests.push(tested.figures());
        progress.at(done, of);
    }
    progress.done();
    Ok(VibroImpact {
        summary: VibroSummary {
            preset: models.rig.oil(models.rig.preset(options.preset)),
            compensator: options.compensation.name().to_owned(),
            lead_s: options.compensation.lead_s(),
            sensors: options.scheme.into(),
            tests,
        },
        records,
    })
}

/// Runs one test on a rig, whatever it is and whatever drives the ticks. `believed` is the rig as its
/// file describes it.
///
/// # Errors
/// The loop is not armed, or the rig does not answer any more.
pub fn run_test<R: RigPort, K: Clock>(
    test: &VibroTest,
    believed: &Rig,
    settings: &VibroSettings,
    rig: R,
    clock: K,
) -> Result<TestRun, VibroError> {
    let mut timing = LoopTiming::default();
    let idle = Loop::new(test.setup(believed, settings)?, rig, clock);
    let run = test.run(idle, |r| timing.add(r))?;
    Ok(TestRun { run, timing })
}

/// Why a test was not run on an emulated rig.
#[derive(Debug, thiserror::Error)]
pub enum EmulatedTestError {
    /// The rig cannot be emulated.
    #[error(transparent)]
    Emulation(#[from] EmulationError),
    /// The test was not run to its end.
    #[error(transparent)]
    Test(#[from] VibroError),
}

/// Runs one test on the emulated rig in this process, as fast as it goes: the same again for the same
/// options.
///
/// # Errors
/// See [`EmulatedTestError`].
pub fn on_emulated_rig(
    rig: &Rig,
    options: &VibroOptions,
    test: &VibroTest,
    draw: RigDraw,
) -> Result<TestRun, EmulatedTestError> {
    let settings = options.settings(rig, 1, PATIENCE);
    let emulated = emulated_rig(rig, options, test, draw)?;
    let clock = VirtualClock::new(PERIOD_NS);
    Ok(run_test(test, rig, &settings, InProcess::new(emulated), clock)?)
}

/// The emulated rig of a test, at rest in the middle of its docking workspace.
///
/// # Errors
/// See [`EmulationError`].
pub fn emulated_rig(
    rig: &Rig,
    options: &VibroOptions,
    test: &VibroTest,
    draw: RigDraw,
) -> Result<EmulatedRig, EmulationError> {
    let built = match draw {
        RigDraw::File => None,
        RigDraw::Seed(seed) => Some(seed),
    };
    let preset = rig.preset(options.preset);
    let rest = rig.docking.pose([0.0; 6]);
    let rig = options.unknown.rig(rig, draw);
    EmulatedRig::new(&rig, preset, built, options.seed, test.system.clone(), &rest)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use docktwin_hil::scheduler::believed_delays_s;
    use docktwin_model::{load_mechanism, load_rig, load_spacecraft};

    use super::*;

    fn models(mechanism: &str) -> (Rig, DockingMechanism, Spacecraft) {
        let at =
            |name: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(name);
        let side = |s: &str| at(&format!("{mechanism}_{s}.urdf"));
        let mechanism = load_mechanism(&side("active"), &side("passive"), None).expect("shipped");
        let rig = load_rig(&at("stewart.urdf")).expect("shipped").model;
        let body = load_spacecraft(&at("test_2026kg.urdf")).expect("shipped").model;
        (rig, mechanism.model, body)
    }

    /// In a corner the plate stands where it stands in that corner of the rig as it is, with the mechanism in the
    /// middle.
    #[test]
    fn oracle_a_frame_in_a_corner_is_where_the_workspace_has_one() {
        let (rig, ..) = models("stick");
        let corners = docktwin_model::DockingWorkspace::corners();
        for (i, place) in corners.enumerate() {
            let moved = in_corner(&rig, i).expect("a corner");
            let found = moved.plate_from_docking(&rig.docking.pose([0.0; 6]));
            let wanted = rig.plate_from_docking(&rig.docking.pose(place.0));
            let off = wanted.inverse() * found;
            assert!(off.p.length() < 1e-12 && off.q.to_scaled_axis().length() < 1e-12, "{i}");
        }
        assert!(in_corner(&rig, 64).is_none());
    }

    /// A stick that the loop does not know stands on the rig and judges the test, and what is believed stays.
    #[test]
    fn oracle_a_stick_that_is_not_known_judges_the_test() {
        let (_, stick, body) = models("stick");
        let axes: AxisSet = "x".parse().expect("an axis");
        let test = VibroTest::new(TABLE_4[5], axes.axes(), &body, &stick).expect("a stick");
        let other = test.with_stick(1.2, 5e-4);
        let of = |s: &docktwin_physics::mechanism::System| s.mechanism().stick.expect("a stick");
        assert!(
            (of(&other.system).stiffness_n_m / of(&test.system).stiffness_n_m - 1.2).abs() < 1e-12
        );
        assert!((of(&other.system).play_m() - of(&test.system).play_m() - 5e-4).abs() < 1e-12);
        assert_eq!(of(&other.believed), of(&test.system));
        assert!(
            (other.contact_time_s() / test.contact_time_s() - 1.2_f64.sqrt().recip()).abs() < 1e-12
        );
    }

    #[test]
    fn oracle_sets_of_axes_read_as_they_are_written() {
        for text in ["x", "roll", "x+y+roll"] {
            assert_eq!(text.parse::<AxisSet>().expect("axes").to_string(), text);
        }
        for text in ["", "w", "x+", "X", "x y"] {
            assert_eq!(text.parse::<AxisSet>(), Err(NoAxes), "{text}");
        }
    }

    #[test]
    fn oracle_the_simulated_stick_is_half_a_sine_and_a_flight() {
        // 1013 kg on 35.4 kN/m at 35.5 mm/s.
        let (m_r, k, v) = (1013.0_f64, 35.4e3, -0.0355);
        let stick = SimulatedStick {
            onset_s: Some(0.2),
            speed_m_s: v,
            contact_time_s: core::f64::consts::PI * (m_r / k).sqrt(),
            play_m: 0.01,
            stiffness_n_m: k,
        };
        let at = |t: f64| stick.at(0.2 + t);
        let flying = SimulatedState { force_n: 0.0, speed_m_s: v };
        assert_eq!(stick.at(0.1), flying);
        // Deepest in the middle: energy of the approach in the spring; pushed against the motion.
        let middle = at(0.5 * stick.contact_time_s);
        let peak = v.abs() * (k * m_r).sqrt();
        assert!((middle.force_n - peak).abs() < 1e-9 && middle.speed_m_s.abs() < 1e-12);
        // The impulse of a contact turns the speed about.
        let h = stick.contact_time_s / 10_000.0;
        let impulse: f64 = (0..10_000).map(|i| at((f64::from(i) + 0.5) * h).force_n * h).sum();
        assert!((impulse / (2.0 * m_r * v.abs()) - 1.0).abs() < 1e-6, "{impulse}");
        let back = at(1.01 * stick.contact_time_s);
        assert_eq!(back, SimulatedState { force_n: 0.0, speed_m_s: -v });
        // The next contact is on the other side.
        let period = stick.contact_time_s + 0.02 / v.abs();
        let other = at(period + 0.5 * stick.contact_time_s);
        assert!((other.force_n + peak).abs() < 1e-6, "{other:?}");
        let never = SimulatedStick { onset_s: None, ..stick };
        assert_eq!(never.at(10.0), flying);
    }

    #[test]
    fn oracle_drawn_rigs_are_counted_and_the_worst_is_kept() {
        let contact = |r_e: f64, r_t: f64| ContactFigures {
            r_e,
            r_t,
            r_t_sensed: 1.0,
            peak_force_ratio: 1.0,
            nrms_force: 0.0,
            nrms_position: 0.0,
            delta_energy: r_e * r_e - 1.0,
            begin_s: 0.0,
            v0_m_s: 1.0,
            v1_m_s: -r_e,
        };
        let mut test = VibroFigures {
            axis: "x".to_owned(),
            case: 3,
            frequency_hz: 0.941,
            length_m: 0.14,
            stiffness_n_m: 35.4e3,
            mass_kg: 2026.0,
            speed_m_s: 0.0355,
            paper: None,
            contacts: vec![contact(1.0, 1.0)],
            draws: vec![Some(contact(1.04, 1.0)), None, Some(contact(0.94, 0.9))],
            stopped_by: None,
            loop_: LoopTiming::default(),
        };
        let s = test.draw_statistics().expect("two");
        assert_eq!((s.rigs, s.judged), (3, 2));
        for (got, want) in
            [(s.r_e_mean, 0.05), (s.r_e_worst, 0.06), (s.r_t_mean, 0.05), (s.r_t_worst, 0.10)]
        {
            assert!((got - want).abs() < 1e-12, "{s:?}");
        }
        test.draws = vec![None];
        assert_eq!(test.draw_statistics(), None);
    }

    #[test]
    fn oracle_a_row_on_the_emulated_rig_repeats_and_survives_json() {
        let (rig, stick, spacecraft) = models("stick");
        let models = VibroModels { rig: &rig, stick: &stick, spacecraft: &spacecraft };
        let lead = Compensation::Lead(believed_delays_s(&rig).iter().sum());
        let mut options = VibroOptions::new(lead);
        (options.cases, options.draws) = (vec![6], 1);
        options.axes = vec!["x".parse().expect("an axis"), "y+yaw".parse().expect("axes")];
        let table = || {
            let run = |test: &VibroTest, draw| on_emulated_rig(&rig, &options, test, draw);
            vibro_impact(&models, &options, &mut (), run).expect("it runs")
        };
        let found = table();
        assert!(found.summary.complete());
        let [x, y] = &found.summary.tests[..] else { panic!("two tests") };
        assert_eq!((x.axis.as_str(), y.axis.as_str(), x.case), ("x", "y+yaw", 6));
        assert_eq!(x.paper, Some(PaperRatios { r_e: 0.975, r_t: 1.005 }));
        assert_eq!(y.paper, None);
        // The loop with its lead is near the simulated system, and so is the curve beside it.
        assert!((x.contacts[0].r_e - 1.0).abs() < 0.02, "{:?}", x.contacts[0]);
        assert_ne!(x.draws[0], Some(x.contacts[0]), "a drawn rig is another");
        for record in &found.records {
            let peak = |force: &dyn Fn(&VibroTick) -> f64| {
                record.ticks.iter().map(|t| force(t).abs()).fold(0.0, f64::max)
            };
            let simulated = peak(&|t| record.simulated.at(t.time_s).force_n);
            let ratio = peak(&|t| t.true_force_n.expect("emulated")) / simulated;
            assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
        }
        assert_eq!(found, table());
        let text = serde_json::to_string(&found).expect("JSON");
        assert_eq!(serde_json::from_str::<VibroImpact>(&text).expect("JSON"), found);
    }

    #[test]
    fn regress_wrong_options_come_all_at_once_and_a_mechanism_needs_a_stick() {
        let (rig, ring, spacecraft) = models("ring");
        let models = VibroModels { rig: &rig, stick: &ring, spacecraft: &spacecraft };
        let run = |options: &VibroOptions| {
            let never = |_: &VibroTest, _| Err::<TestRun, _>(NoAxes);
            vibro_impact(&models, options, &mut (), never).expect_err("refused")
        };
        let good = VibroOptions::new(Compensation::None);
        assert_eq!(run(&good), VibroImpactError::NoStick { mechanism: ring.name.clone() });
        let bad = VibroOptions {
            cases: vec![0, 8],
            contacts: 0,
            axes: Vec::new(),
            compensation: Compensation::Lead(0.2),
            ..good
        };
        let VibroImpactError::Options(problems) = run(&bad) else { panic!("options") };
        assert_eq!(problems.len(), 5, "{problems:?}");
    }
}
