//! Frequency response of the running rig to a swept sine (Fig. 39, 40), its linear model, and whether
//! the requirements hold.

use docktwin_control::{
    linear,
    response::{Bench, Point, Sweep},
    rig::RigSetup,
};
use docktwin_core::DVec3;
use docktwin_model::{HydraulicPreset, Place, Rig};
use serde::{Deserialize, Serialize};

use super::{
    Build, Dof, Extreme, LegControl, MIDDLE, OptionProblem, RigError, Subject, SubjectSummary,
    middle_and_corners,
};
use crate::{
    Progress,
    number::{largest, null_is_nan, null_is_nan_pair},
    parallel::in_parallel,
};

/// Stiffness of the payloads, N/m: the paper's stiffest contact.
pub const PAYLOAD_N_M: f64 = 1e6;
/// Poles at and above this are those of sampling and valve, no modes of the rig, Hz.
pub(super) const MODAL_HZ: f64 = 1000.0;
/// Frequency of the paper's requirement, Hz.
pub const PAPER_HZ: f64 = 10.0;
/// Upper end of the band where |G| must be near one, Hz.
pub const FLAT_HZ: f64 = 5.0;

/// Frequencies of the responses, Hz.
const HZ: [f64; 16] =
    [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0];
/// Spectra are averaged so far to either side, Hz.
const HALF_BAND_HZ: f64 = 0.1;
/// Largest amplitude, m.
const MOST_AMPLITUDE_M: f64 = 0.05;

/// What the plate works against: a spring at the origin of `e4`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Payload {
    /// Nothing.
    None,
    /// [`PAYLOAD_N_M`] along X of `e3`.
    Axial,
    /// [`PAYLOAD_N_M`] along Y of `e3`.
    Lateral,
}

impl Payload {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::None, Self::Axial, Self::Lateral];

    /// Its name, as serialised.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Axial => "axial",
            Self::Lateral => "lateral",
        }
    }

    /// Direction of its spring in `e3`, a unit vector; zero for none.
    #[must_use]
    pub const fn direction(self) -> DVec3 {
        match self {
            Self::None => DVec3::ZERO,
            Self::Axial => DVec3::X,
            Self::Lateral => DVec3::Y,
        }
    }
}

impl core::fmt::Display for Payload {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::None => "no payload",
            Self::Axial => "1e6 N/m along X",
            Self::Lateral => "1e6 N/m along Y",
        })
    }
}

/// Where in the docking workspace the running rig is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Places {
    /// Its middle.
    #[default]
    Middle,
    /// Its middle and five corners.
    Sample,
    /// Its middle and all 64 corners.
    All,
}

impl Places {
    fn list(self) -> Vec<Place> {
        let all = middle_and_corners();
        match self {
            Self::Middle => vec![MIDDLE],
            Self::Sample => [0, 1, 12, 27, 38, 64].map(|i| all[i]).to_vec(),
            Self::All => all,
        }
    }
}

/// How the response of a rig is measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BodeOptions {
    /// The rig.
    pub build: Build,
    /// Where to measure. The linear model is evaluated at the middle and all corners in any case.
    pub places: Places,
    /// What the plate works against, at least one; each gets measurements of its own.
    pub payloads: Vec<Payload>,
    /// Degrees of freedom to drive, at least one.
    pub dofs: Vec<Dof>,
    /// Amplitude of the drive, m, above 0, at most 0.05 (default 0.002, the paper's); of a rotation at
    /// the radius of the plate joints.
    pub amplitude_m: f64,
    /// Changes to the leg control.
    pub leg_control: LegControl,
    /// Whether the commanded motion is known ahead by the delay of the valve, as a predictor knows it.
    pub foreseen: bool,
    /// Leaves out friction, null bias and orifice, so that the rig is as linear as its model.
    pub linear_range: bool,
}

impl Default for BodeOptions {
    /// All degrees of freedom against all payloads, in the middle, with 2 mm.
    fn default() -> Self {
        Self {
            build: Build::default(),
            places: Places::default(),
            payloads: Payload::ALL.to_vec(),
            dofs: Dof::ALL.to_vec(),
            amplitude_m: 2e-3,
            leg_control: LegControl::default(),
            foreseen: false,
            linear_range: false,
        }
    }
}

impl BodeOptions {
    fn check(&self) -> Result<(), RigError> {
        let mut problems = Vec::new();
        let mut problem = |wrong: bool, option, value: &dyn core::fmt::Debug, allowed| {
            if wrong {
                problems.push(OptionProblem { option, value: format!("{value:?}"), allowed });
            }
        };
        let amplitude = self.amplitude_m > 0.0 && self.amplitude_m <= MOST_AMPLITUDE_M;
        problem(!amplitude, "amplitude_m", &self.amplitude_m, "above 0, at most 0.05 m");
        problem(self.payloads.is_empty(), "payloads", &self.payloads, "at least one");
        problem(self.dofs.is_empty(), "dofs", &self.dofs, "at least one");
        if problems.is_empty() { Ok(()) } else { Err(RigError::Options { problems }) }
    }
}

/// Response of a rig.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bode {
    /// The answer in figures.
    pub summary: BodeSummary,
    /// Places where the running rig was measured.
    pub places: Vec<Place>,
    /// Every measurement, by payload, then place, then degree of freedom.
    pub responses: Vec<MeasuredResponse>,
    /// Poles of the linear model in the middle, one entry a payload.
    pub poles: Vec<PayloadPoles>,
}

/// Response of a rig in figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BodeSummary {
    /// The rig.
    pub subject: SubjectSummary,
    /// Rotations count as displacements at this lever, m: the radius of the plate joints.
    pub lever_m: f64,
    /// Amplitude of the drive, m.
    pub amplitude_m: f64,
    /// What is required.
    pub required: Requirements,
    /// Whether gain, phase, flatness and coupling hold in every measurement.
    pub holds_where_measured: bool,
    /// Whether the same and the modal damping hold for the linear model in the middle and all 64
    /// corners, in all degrees of freedom.
    pub linear_model_holds_everywhere: bool,
    /// Figures for every payload.
    pub payloads: Vec<PayloadSummary>,
}

/// What is required of a rig's response.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Requirements {
    /// Largest error of the gain at 10 Hz, dB (the paper's 2).
    pub gain_10_hz_db: f64,
    /// Largest lag at 10 Hz, degrees (the paper's 70), dead time included.
    pub lag_10_hz_deg: f64,
    /// Largest distance of |G| from one up to 5 Hz: 0.10, or 0.05 with the stiff preset.
    pub gain_error_to_5_hz: f64,
    /// Largest response of another degree of freedom up to 5 Hz, per unit of the drive.
    pub coupling_to_5_hz: f64,
    /// Least damping ratio of a mode.
    pub modal_damping: f64,
}

impl Requirements {
    /// With a volume of the oil.
    #[must_use]
    pub fn of(preset: HydraulicPreset) -> Self {
        Self {
            gain_10_hz_db: 2.0,
            lag_10_hz_deg: 70.0,
            gain_error_to_5_hz: if preset == HydraulicPreset::Stiff { 0.05 } else { 0.10 },
            coupling_to_5_hz: 0.15,
            modal_damping: 0.1,
        }
    }
}

/// Figures against one payload.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PayloadSummary {
    /// The payload.
    pub payload: Payload,
    /// Worst figures of all measurements.
    pub measured: WorstResponse,
    /// Worst figures of the linear model in the middle and all corners; its coherence is 1.
    pub linear_everywhere: WorstResponse,
    /// Least damping ratio of a mode of the linear model there; negative is unstable.
    pub least_modal_damping: Extreme,
    /// Frequency of the slowest pole in the middle, Hz.
    pub slowest_pole_hz: Option<f64>,
    /// Largest distance between measured and linear response of any degree of freedom, per unit of the
    /// drive.
    #[serde(deserialize_with = "null_is_nan")]
    pub measured_against_linear: f64,
}

/// Worst figures of many responses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorstResponse {
    /// Least and greatest gain at 10 Hz, dB.
    #[serde(deserialize_with = "null_is_nan_pair")]
    pub gain_10_hz_db: [f64; 2],
    /// Least and greatest phase at 10 Hz, degrees, −180 to 180, negative when late.
    #[serde(deserialize_with = "null_is_nan_pair")]
    pub phase_10_hz_deg: [f64; 2],
    /// Largest distance of |G| from one up to 5 Hz.
    pub gain_error_to_5_hz: WorstAt,
    /// Largest response of another degree of freedom up to 5 Hz, per unit of the drive.
    pub coupling_to_5_hz: WorstAt,
    /// Least coherence at any frequency, 0 to 1.
    pub least_coherence: f64,
}

/// A worst value, and where it occurs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorstAt {
    /// The value; its meaning stands at the field that holds it.
    #[serde(deserialize_with = "null_is_nan")]
    pub value: f64,
    /// Driven degree of freedom.
    pub dof: Dof,
    /// Frequency, Hz; 0 where nothing was worse than 0.
    pub hz: f64,
    /// Place in the docking workspace.
    pub at: Place,
}

impl WorstAt {
    const NONE: Self = Self { value: 0.0, dof: Dof::X, hz: 0.0, at: MIDDLE };

    /// Takes a value that is larger, or NaN for good: what could not be computed is the worst.
    fn raise(&mut self, value: f64, dof: Dof, hz: f64, at: Place) {
        if value > self.value || value.is_nan() {
            *self = Self { value, dof, hz, at };
        }
    }
}

impl WorstResponse {
    const NONE: Self = Self {
        gain_10_hz_db: [f64::INFINITY, f64::NEG_INFINITY],
        phase_10_hz_deg: [f64::INFINITY, f64::NEG_INFINITY],
        gain_error_to_5_hz: WorstAt::NONE,
        coupling_to_5_hz: WorstAt::NONE,
        least_coherence: 1.0,
    };

    fn add(&mut self, p: &ResponsePoint, dof: Dof, place: Place) {
        self.least_coherence = self.least_coherence.min(p.coherence);
        if (p.hz - PAPER_HZ).abs() < 1e-9 {
            let widen = |[least, most]: [f64; 2], x: f64| match x.is_nan() || least.is_nan() {
                true => [f64::NAN; 2],
                false => [least.min(x), most.max(x)],
            };
            self.gain_10_hz_db = widen(self.gain_10_hz_db, p.gain_db(dof));
            self.phase_10_hz_deg = widen(self.phase_10_hz_deg, p.phase_deg(dof));
        }
        if p.hz <= FLAT_HZ {
            let off = (p.gain[dof.index()] - 1.0).abs();
            self.gain_error_to_5_hz.raise(off, dof, p.hz, place);
            self.coupling_to_5_hz.raise(p.cross_coupling(dof), dof, p.hz, place);
        }
    }

    /// Whether gain, phase, flatness and coupling are as required; false where one of them is not
    /// known.
    #[must_use]
    pub fn holds(&self, required: &Requirements) -> bool {
        let [least, most] = self.gain_10_hz_db;
        // Least above greatest: nothing was measured at 10 Hz.
        least <= most
            && least >= -required.gain_10_hz_db
            && most <= required.gain_10_hz_db
            && self.phase_10_hz_deg[0] >= -required.lag_10_hz_deg
            && self.gain_error_to_5_hz.value <= required.gain_error_to_5_hz
            && self.coupling_to_5_hz.value <= required.coupling_to_5_hz
    }
}

/// One degree of freedom driven at one place against one payload: measured and linear.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasuredResponse {
    /// What the plate worked against.
    pub payload: Payload,
    /// Place in the docking workspace.
    pub place: Place,
    /// Driven degree of freedom.
    pub dof: Dof,
    /// Measured on the running rig, at 16 frequencies from 0.5 to 12 Hz.
    pub measured: Vec<ResponsePoint>,
    /// Of the linear model, at the same frequencies.
    pub linear: Vec<ResponsePoint>,
}

/// Response at one frequency: from the commanded motion of the driven degree of freedom to the motion
/// that all six have, rotations as displacements at the lever. Arrays are in the order of
/// [`Dof::ALL`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResponsePoint {
    /// Frequency, Hz.
    pub hz: f64,
    /// Amplitude per unit of the drive.
    pub gain: [f64; 6],
    /// Phase, rad, −π to π, negative when late.
    pub phase_rad: [f64; 6],
    /// Share of the driven degree of freedom's motion that follows the drive linearly, 0 to 1; 1 for
    /// the linear model.
    pub coherence: f64,
}

impl ResponsePoint {
    /// Gain of a degree of freedom, dB.
    #[must_use]
    pub fn gain_db(&self, dof: Dof) -> f64 {
        20.0 * self.gain[dof.index()].log10()
    }

    /// Phase of a degree of freedom, degrees.
    #[must_use]
    pub fn phase_deg(&self, dof: Dof) -> f64 {
        self.phase_rad[dof.index()].to_degrees()
    }

    /// Largest response of a degree of freedom other than the driven one, per unit of the drive.
    #[must_use]
    pub fn cross_coupling(&self, driven: Dof) -> f64 {
        let others = Dof::ALL.into_iter().filter(|dof| *dof != driven);
        largest(others.map(|dof| self.gain[dof.index()]))
    }
}

impl From<&Point> for ResponsePoint {
    fn from(p: &Point) -> Self {
        Self {
            hz: p.hz,
            gain: p.response.map(|g| g.norm()),
            phase_rad: p.response.map(|g| g.arg()),
            coherence: p.coherence,
        }
    }
}

/// Poles of the closed loop against one payload.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PayloadPoles {
    /// The payload.
    pub payload: Payload,
    /// All poles, slowest first.
    pub poles: Vec<Pole>,
}

/// A pole in the plane of s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pole {
    /// |s| / 2π, Hz.
    pub frequency_hz: f64,
    /// Damping ratio: 1 for a decaying real pole, negative if unstable.
    pub damping_ratio: f64,
    /// Real part, rad/s; negative if stable.
    pub real_rad_s: f64,
    /// Imaginary part, rad/s, at most π times the rate of the leg controllers.
    pub imaginary_rad_s: f64,
}

impl From<&linear::Pole> for Pole {
    fn from(p: &linear::Pole) -> Self {
        let [real_rad_s, imaginary_rad_s] = p.s;
        Self { frequency_hz: p.frequency_hz, damping_ratio: p.damping, real_rad_s, imaginary_rad_s }
    }
}

/// What is measured, and how.
struct Work<'a> {
    subject: &'a Subject,
    setup: RigSetup,
    lever_m: f64,
    amplitude_m: f64,
    foreseen: bool,
}

/// Points of one drive as control has them, for the arithmetic.
struct Case {
    payload: Payload,
    place: Place,
    dof: Dof,
    measured: Vec<Point>,
    linear: Vec<Point>,
}

impl Case {
    /// Largest distance between measured and linear response.
    fn apart(&self) -> f64 {
        let pairs = self.measured.iter().zip(&self.linear);
        let apart = |(m, l): (&Point, &Point)| {
            largest((0..6).map(|k| (m.response[k] - l.response[k]).norm()))
        };
        largest(pairs.map(apart))
    }

    fn result(&self) -> MeasuredResponse {
        let points = |p: &[Point]| p.iter().map(ResponsePoint::from).collect();
        MeasuredResponse {
            payload: self.payload,
            place: self.place,
            dof: self.dof,
            measured: points(&self.measured),
            linear: points(&self.linear),
        }
    }
}

/// The linear model against a payload, in the middle and all corners.
struct Linear {
    /// Poles in the middle.
    poles: Vec<linear::Pole>,
    damping: Extreme,
    worst: WorstResponse,
}

impl Work<'_> {
    fn bench(&self, payload: Payload, place: Place) -> Bench {
        Bench {
            setup: self.setup.clone(),
            x_34: self.subject.file.docking.pose(place.0),
            payload_n_m: payload.direction() * PAYLOAD_N_M,
            lever_m: self.lever_m,
            foreseen: self.foreseen,
        }
    }

    fn case(&self, payload: Payload, place: Place, dof: Dof) -> Result<Case, RigError> {
        let bench = self.bench(payload, place);
        let sweep = Sweep {
            dof: dof.index(),
            amplitude: if dof.turns() { self.amplitude_m / self.lever_m } else { self.amplitude_m },
            from_hz: 0.4,
            to_hz: 12.5,
            period_s: 20.0,
            sweeps: 1,
        };
        let measured = bench
            .swept_sine(&sweep, &HZ, HALF_BAND_HZ)
            .map_err(|source| RigError::Response { dof, place, payload, source })?;
        let model = bench.linear().ok_or(RigError::Singular)?;
        let linear = HZ.iter().map(|hz| bench.linear_point(&model, dof.index(), *hz));
        let linear = linear.collect::<Option<_>>().ok_or(RigError::Singular)?;
        Ok(Case { payload, place, dof, measured, linear })
    }

    fn linear(&self, payload: Payload) -> Option<Linear> {
        let mut out =
            Linear { poles: Vec::new(), damping: Extreme::HIGHEST, worst: WorstResponse::NONE };
        for place in middle_and_corners() {
            let bench = self.bench(payload, place);
            let model = bench.linear()?;
            let poles = model.poles()?;
            for p in poles.iter().filter(|p| p.frequency_hz < MODAL_HZ) {
                out.damping.lower(p.damping, place);
            }
            if out.poles.is_empty() {
                out.poles = poles;
            }
            for hz in HZ {
                let points = bench.linear_points(&model, hz)?;
                for (dof, p) in Dof::ALL.into_iter().zip(&points) {
                    out.worst.add(&p.into(), dof, place);
                }
            }
        }
        Some(out)
    }
}

/// Measures the response of a running rig by a swept sine from 0.4 to 12.5 Hz, one degree of freedom
/// at a time, and evaluates its linear model. All degrees of freedom in the middle take some ten
/// seconds a payload on one core; work is shared by all cores, and the result does not depend on how.
///
/// # Errors
/// See [`RigError`].
pub fn bode(
    rig: &Rig,
    options: &BodeOptions,
    progress: &mut (dyn Progress + Send),
) -> Result<Bode, RigError> {
    options.check()?;
    let subject = Subject::new(rig, &options.build);
    let mut setup = subject.setup(&options.leg_control);
    let asks_for_oil = options.build.preset.is_some() || options.leg_control.needs_oil();
    match setup.hydraulic_mut() {
        Some(oil) if options.linear_range => {
            oil.legs = oil.legs.map(|l| l.ideal());
            oil.believed_legs = oil.believed_legs.map(|l| l.ideal());
        }
        None if asks_for_oil => return Err(subject.no_oil()),
        _ => {}
    }
    let work = Work {
        lever_m: setup.platform.plate_radius_m(),
        subject: &subject,
        setup,
        amplitude_m: options.amplitude_m,
        foreseen: options.foreseen,
    };
    let (payloads, dofs) = (sorted(&options.payloads), sorted(&options.dofs));
    let places = options.places.list();
    let mut plan = Vec::new();
    for payload in &payloads {
        for place in &places {
            plan.extend(dofs.iter().map(|dof| (*payload, *place, *dof)));
        }
    }
    let cases = in_parallel(plan.len(), progress, |i| {
        let (payload, place, dof) = plan[i];
        work.case(payload, place, dof)
    })?;
    let linear = in_parallel(payloads.len(), progress, |i| {
        work.linear(payloads[i]).ok_or(RigError::Singular)
    })?;
    Ok(Bode {
        summary: summary(&work, &payloads, &cases, &linear),
        places,
        responses: cases.iter().map(Case::result).collect(),
        poles: payloads
            .iter()
            .zip(&linear)
            .map(|(payload, l)| PayloadPoles {
                payload: *payload,
                poles: l.poles.iter().map(Pole::from).collect(),
            })
            .collect(),
    })
}

/// In order, each once.
fn sorted<T: Ord + Copy>(all: &[T]) -> Vec<T> {
    let mut all = all.to_vec();
    all.sort_unstable();
    all.dedup();
    all
}

fn summary(
    work: &Work<'_>,
    payloads: &[Payload],
    cases: &[Case],
    linear: &[Linear],
) -> BodeSummary {
    let required = Requirements::of(work.subject.preset);
    let payloads: Vec<PayloadSummary> = payloads
        .iter()
        .zip(linear)
        .map(|(payload, l)| {
            let cases = || cases.iter().filter(|c| c.payload == *payload);
            let mut measured = WorstResponse::NONE;
            for c in cases() {
                c.measured.iter().for_each(|p| measured.add(&p.into(), c.dof, c.place));
            }
            PayloadSummary {
                payload: *payload,
                measured,
                linear_everywhere: l.worst,
                least_modal_damping: l.damping,
                slowest_pole_hz: l.poles.first().map(|p| p.frequency_hz),
                measured_against_linear: largest(cases().map(Case::apart)),
            }
        })
        .collect();
    BodeSummary {
        subject: work.subject.summary(),
        lever_m: work.lever_m,
        amplitude_m: work.amplitude_m,
        required,
        holds_where_measured: payloads.iter().all(|p| p.measured.holds(&required)),
        linear_model_holds_everywhere: payloads.iter().all(|p| {
            p.linear_everywhere.holds(&required)
                && p.least_modal_damping.value >= required.modal_damping
        }),
        payloads,
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use docktwin_control::response::ResponseError;
    use nalgebra::Complex;

    use super::{
        super::{LegSetting, tests::shipped},
        *,
    };

    fn point(hz: f64, gain: f64, phase: f64, other: f64) -> Point {
        let mut response = [Complex::new(0.0, other); 6];
        response[1] = Complex::from_polar(gain, phase);
        Point { hz, response, coherence: 0.9 }
    }

    #[test]
    fn invariant_each_requirement_is_judged_by_itself() {
        let required = Requirements::of(HydraulicPreset::Printed);
        let of = |points: &[Point]| {
            let mut worst = WorstResponse::NONE;
            points.iter().for_each(|p| worst.add(&p.into(), Dof::Y, MIDDLE));
            worst
        };
        let lag = |deg: f64| -deg * PI / 180.0;
        let good = [point(5.0, 1.09, lag(30.0), 0.14), point(10.0, 1.25, lag(69.0), 0.9)];
        assert!(of(&good).holds(&required), "{:?}", of(&good));
        for (wrong, index) in [
            (point(10.0, 1.27, lag(69.0), 0.0), 1),
            (point(10.0, 0.79, lag(69.0), 0.0), 1),
            (point(10.0, 1.0, lag(71.0), 0.0), 1),
            (point(5.0, 1.11, lag(30.0), 0.0), 0),
            (point(5.0, 0.89, lag(30.0), 0.0), 0),
            (point(5.0, 1.0, lag(30.0), 0.16), 0),
            (point(10.0, f64::NAN, lag(69.0), 0.0), 1),
            (point(5.0, f64::NAN, lag(30.0), 0.0), 0),
            (point(5.0, 1.0, lag(30.0), f64::NAN), 0),
        ] {
            let mut points = good;
            points[index] = wrong;
            assert!(!of(&points).holds(&required), "{wrong:?}");
            // Nothing that comes after takes it back.
            assert!(!of(&[points, good].concat()).holds(&required), "{wrong:?}");
        }
        // The stiff preset must be flatter, and what was never measured does not hold.
        assert!(!of(&good).holds(&Requirements::of(HydraulicPreset::Stiff)));
        assert!(!WorstResponse::NONE.holds(&required));
        let worst = of(&good);
        assert_eq!((worst.coupling_to_5_hz.dof, worst.coupling_to_5_hz.hz), (Dof::Y, 5.0));
    }

    #[test]
    fn oracle_a_point_keeps_its_figures() {
        let p = point(3.0, 0.5, -0.25, 0.02);
        let r = ResponsePoint::from(&p);
        assert_eq!(r.gain_db(Dof::Y).to_bits(), p.gain_db(1).to_bits());
        assert_eq!(r.phase_deg(Dof::Y).to_bits(), p.phase_deg(1).to_bits());
        assert_eq!(r.cross_coupling(Dof::Y).to_bits(), p.cross_coupling(1).to_bits());
        assert!((r.gain_db(Dof::Y) + 6.0206).abs() < 1e-4);
    }

    #[test]
    fn invariant_wrong_options_come_all_at_once() {
        let options =
            BodeOptions { amplitude_m: f64::NAN, dofs: Vec::new(), ..BodeOptions::default() };
        let Err(RigError::Options { problems }) = bode(&shipped(), &options, &mut ()) else {
            panic!("the options are wrong");
        };
        assert_eq!(problems.iter().map(|p| p.option).collect::<Vec<_>>(), ["amplitude_m", "dofs"]);
    }

    #[test]
    fn regress_a_rig_that_cannot_run_is_named_with_what_was_tried() {
        let mut options = BodeOptions {
            dofs: vec![Dof::Z],
            payloads: vec![Payload::Lateral],
            ..BodeOptions::default()
        };
        let mut rig = shipped();
        // A dead time that the command path cannot hold.
        rig.drive.set_dead_time_s(10.0);
        let Err(e) = bode(&rig, &options, &mut ()) else { panic!("the rig cannot be built") };
        let RigError::Response { dof: Dof::Z, payload: Payload::Lateral, source, .. } = &e else {
            panic!("{e}");
        };
        assert!(matches!(source, ResponseError::Setup(_)), "{source}");
        assert!(e.to_string().contains("Z at middle against 1e6 N/m along Y"), "{e}");
        // The option takes it back.
        options.leg_control.set(LegSetting::DeadTime, 2e-3).expect("in range");
        assert!(bode(&rig, &options, &mut ()).is_ok());
    }

    #[test]
    fn invariant_the_result_survives_json_and_repeats() {
        let options = BodeOptions {
            dofs: vec![Dof::Roll, Dof::X, Dof::X],
            payloads: vec![Payload::Axial],
            build: Build { preset: Some(HydraulicPreset::Stiff), seed: Some(2) },
            ..BodeOptions::default()
        };
        let text = serde_json::to_string(&options).expect("JSON");
        assert_eq!(serde_json::from_str::<BodeOptions>(&text).expect("JSON"), options);
        let found = bode(&shipped(), &options, &mut ()).expect("a regular rig");
        assert_eq!(found.responses.iter().map(|r| r.dof).collect::<Vec<_>>(), [Dof::X, Dof::Roll]);
        let text = serde_json::to_string(&found).expect("JSON");
        assert_eq!(serde_json::from_str::<Bode>(&text).expect("JSON"), found);
        assert_eq!(bode(&shipped(), &options, &mut ()).expect("a regular rig"), found);
    }
}
