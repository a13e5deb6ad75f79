//! The HIL simulation with one degree of freedom (§6.4) against the simulated system, in frequency
//! (Fig. 23, 24) and in time (Fig. 25, 26).
//!
//! Two spacecraft of 8 t and 12 t (Table 2) meet on one axis. The *simulated system*, bodies and
//! mechanism alone, is the reference. The HIL simulation runs at 1 kHz through an *interface*
//! ([`InterfaceKind`]): one that is exactly one, the hydraulic leg of Table 1 as it is, and the same
//! compensated. [`docktwin_control::single_dof`] has the models.

use docktwin_control::{
    rig::{SetupError, TICK_S},
    single_dof::{
        Compensation, Docking, Interface, Likeness, Mechanism, Rebound, Sample, SingleDofSetup,
        measure,
        transfer::{self, LinearSimulator, body_dynamics, closed, s_of},
    },
};
use docktwin_model::{Attenuator, DockingMechanism, HydraulicPreset, Rig};
use serde::{Deserialize, Serialize};

use crate::number::{Complex, largest, null_is_nan};

/// Stiffness of Table 3, N/m.
pub const STIFFNESS_N_M: f64 = 1e6;
/// Damping of Table 3, N·s/m.
const DAMPING_N_S_M: f64 = 0.0;
/// Largest deviation that is allowed with an interface of one, a fraction.
pub const REQUIRED: f64 = 1e-3;
/// Length of the simulations, ticks of 1 ms.
const TICKS: u32 = 2000;
/// Length of the simulations, s.
pub const DURATION_S: f64 = TICKS as f64 * TICK_S;
/// Amplitude of the measured sines, m.
const AMPLITUDE_M: f64 = 2e-3;
/// Frequencies of the measured sines, Hz.
const SINES_HZ: [f64; 12] = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0];
/// Frequency of the paper's requirement, Hz.
pub const PAPER_HZ: f64 = 10.0;
/// Docking happens below this frequency, Hz.
const DOCKING_HZ: f64 = 5.0;
/// Moments of first touch within a tick that are judged.
const TOUCHES: u32 = 8;
/// Part of the closing speed at which the joined spring is met: its motion grows.
const SPRING_SPEED: f64 = 0.2;
/// The interface that is exactly one.
const ONE: Interface<'_> = Interface::Ideal { delay_s: 0.0 };

type C = nalgebra::Complex<f64>;

/// What stands between the bodies' programme and the mechanism.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum InterfaceKind {
    /// `G_I = 1`: a rig and a sensor without fault.
    One,
    /// The hydraulic leg with its control, friction and dead time, and a force sensor of 350 Hz.
    Uncompensated,
    /// The same, the motion commanded ahead and the contact force expected.
    Compensated,
}

impl InterfaceKind {
    /// All of them, in the order of every array over interfaces.
    pub const ALL: [Self; 3] = [Self::One, Self::Uncompensated, Self::Compensated];

    /// Its name, as serialised.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::One => "one",
            Self::Uncompensated => "uncompensated",
            Self::Compensated => "compensated",
        }
    }
}

/// The leg without and with compensation.
const LEGS: [(InterfaceKind, Compensation); 2] = [
    (InterfaceKind::Uncompensated, Compensation::None),
    (InterfaceKind::Compensated, Compensation::Ahead),
];

/// How the comparison is made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SingleDofOptions {
    /// Volume of the oil; without one, the rig file's default.
    pub preset: Option<HydraulicPreset>,
    /// Closing speed, m/s, 0.01 to 0.5 (default 0.35, the paper's).
    pub closing_speed_m_s: f64,
}

impl Default for SingleDofOptions {
    fn default() -> Self {
        Self { preset: None, closing_speed_m_s: 0.35 }
    }
}

/// Why there is no comparison.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SingleDofError {
    /// The closing speed is out of its range.
    #[error("a closing speed of {closing_speed_m_s} m/s")]
    Speed {
        /// As given.
        closing_speed_m_s: f64,
    },
    /// The mechanism has no axial characteristic.
    #[error("{mechanism} has no axial characteristic")]
    NoCharacteristic {
        /// Name of the mechanism.
        mechanism: String,
    },
    /// No oil moves the legs.
    #[error("no oil moves the legs of {rig}, and the study is of one hydraulic leg")]
    NoOil {
        /// Name of the rig.
        rig: String,
    },
    /// The leg cannot be linearised.
    #[error("the leg has no linear model")]
    Singular,
    /// The leg cannot be built.
    #[error(transparent)]
    Setup(#[from] SetupError),
}

impl SingleDofError {
    /// What to do about it.
    #[must_use]
    pub const fn remedy(&self) -> &'static str {
        match self {
            Self::Speed { .. } => "give 0.01 to 0.5 m/s",
            Self::NoCharacteristic { .. } => {
                "give a mechanism with [attenuation.characteristic], loaded with that attenuation"
            }
            Self::NoOil { .. } => "give a hydraulic rig, models/urdf/stewart.toml is one",
            Self::Singular => "correct oil volume and valve in the rig file",
            Self::Setup(_) => "correct the rig file",
        }
    }
}

/// The HIL simulation with one degree of freedom against the simulated system.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SingleDof {
    /// The answer in figures.
    pub summary: SingleDofSummary,
    /// `G_I` of both legs, without payload and against [`STIFFNESS_N_M`] (Fig. 23).
    pub interfaces: Vec<InterfaceResponse>,
    /// The closed loops with the spring of Table 3 (Fig. 24).
    pub loops: Vec<LoopPoint>,
    /// A docking with the mechanism's axial characteristic (Fig. 25, 26).
    pub docking: Simulations,
    /// The spring of Table 3, joined from first touch on, at a fifth of the closing speed.
    pub joined_spring: Simulations,
    /// The spring of Table 3, touched and left again.
    pub contact: Simulations,
}

/// The comparison in figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SingleDofSummary {
    /// Robot name of the rig's URDF.
    pub rig: String,
    /// Volume of the oil.
    pub preset: HydraulicPreset,
    /// Name of the mechanism.
    pub mechanism: String,
    /// m1 of Table 2, kg.
    pub chaser_kg: f64,
    /// m2 of Table 2, kg.
    pub target_kg: f64,
    /// `m1 m2 / (m1 + m2)`, kg.
    pub reduced_mass_kg: f64,
    /// Closing speed of the docking, m/s.
    pub closing_speed_m_s: f64,
    /// Free way before first touch, m.
    pub gap_m: f64,
    /// Moments of first touch within a tick over which the interface of one is judged.
    pub touches_with_g_i_one: u32,
    /// [`REQUIRED`].
    pub required_with_g_i_one: f64,
    /// Whether displacement and force of the docking with the interface of one are those of the
    /// simulated system, in RMS and peak, within [`REQUIRED`].
    pub holds: bool,
    /// `G_I` of both legs in figures.
    pub g_i: Vec<InterfaceFigures>,
    /// The simulations with every interface in figures.
    pub hil: [HilFigures; 3],
}

/// `G_I` of one leg against one payload in figures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InterfaceFigures {
    /// The leg.
    pub interface: InterfaceKind,
    /// Stiffness that it works against, N/m.
    pub payload_n_m: f64,
    /// Measured gain at 10 Hz, dB.
    #[serde(deserialize_with = "null_is_nan")]
    pub gain_10_hz_db: f64,
    /// Measured phase at 10 Hz, degrees, −180 to 180, negative when late.
    #[serde(deserialize_with = "null_is_nan")]
    pub phase_10_hz_deg: f64,
    /// Largest measured |G_I − 1| up to 5 Hz.
    #[serde(deserialize_with = "null_is_nan")]
    pub off_one_to_5_hz: f64,
    /// Largest distance between measured and linear `G_I`.
    #[serde(deserialize_with = "null_is_nan")]
    pub measured_against_linear: f64,
}

/// The simulations with one interface in figures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HilFigures {
    /// The interface.
    pub interface: InterfaceKind,
    /// Of the docking; with the interface of one, the worst of all moments of first touch.
    pub docking: Deviation,
    /// Of the joined spring.
    pub joined_spring: Deviation,
    /// Restitution of the contact over that of the simulated system; `None` where a simulation does
    /// not part again.
    pub contact_restitution_ratio: Option<f64>,
    /// Duration of the contact over that of the simulated system.
    pub contact_time_ratio: Option<f64>,
}

/// How far a HIL simulation lies from the simulated system, from first touch on; all are fractions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// RMS of the difference of the bodies' displacement over the RMS of the reference.
    #[serde(deserialize_with = "null_is_nan")]
    pub displacement_nrms: f64,
    /// The same of the force.
    #[serde(deserialize_with = "null_is_nan")]
    pub force_nrms: f64,
    /// Greatest displacement over the reference's, less one.
    #[serde(deserialize_with = "null_is_nan")]
    pub displacement_peak_error: f64,
    /// Greatest force over the reference's, less one.
    #[serde(deserialize_with = "null_is_nan")]
    pub force_peak_error: f64,
}

impl Deviation {
    fn of(hil: &[Sample], reference: &[Sample]) -> Self {
        let l = Likeness::of(hil, reference);
        Self {
            displacement_nrms: l.displacement_nrms,
            force_nrms: l.force_nrms,
            displacement_peak_error: l.displacement_peak,
            force_peak_error: l.force_peak,
        }
    }

    /// Figure by figure the one of both that is larger without sign; one that is not known stays so.
    fn or_worse(&self, other: &Self) -> Self {
        let worse = |a: f64, b: f64| if a.is_nan() || b.abs() <= a.abs() { a } else { b };
        Self {
            displacement_nrms: worse(self.displacement_nrms, other.displacement_nrms),
            force_nrms: worse(self.force_nrms, other.force_nrms),
            displacement_peak_error: worse(
                self.displacement_peak_error,
                other.displacement_peak_error,
            ),
            force_peak_error: worse(self.force_peak_error, other.force_peak_error),
        }
    }

    /// Whether no figure is larger than `most`, without sign; a figure that is not known is.
    #[must_use]
    pub fn within(&self, most: f64) -> bool {
        [
            self.displacement_nrms,
            self.force_nrms,
            self.displacement_peak_error,
            self.force_peak_error,
        ]
        .iter()
        .all(|x| x.abs() <= most)
    }
}

/// `G_I` of one leg against one payload (Fig. 23), force sensor included.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InterfaceResponse {
    /// The leg.
    pub interface: InterfaceKind,
    /// Stiffness that it works against, N/m.
    pub payload_n_m: f64,
    /// Of the linear model, 0.1 to 30 Hz, the frequencies of `measured` among them.
    pub linear: Vec<TransferPoint>,
    /// Measured by sines of 2 mm on the running leg.
    pub measured: Vec<TransferPoint>,
}

/// A transfer function at one frequency.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransferPoint {
    /// Frequency, Hz.
    pub hz: f64,
    /// Its value, output over input, no unit.
    pub value: Complex,
}

/// The closed loops at one frequency (Fig. 24): force of the mechanism over an outer force on the
/// bodies, no unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoopPoint {
    /// Frequency, Hz.
    pub hz: f64,
    /// (6), the simulated system.
    pub simulated: Complex,
    /// (7) with the leg as it is.
    pub uncompensated: Complex,
    /// (7) with the leg compensated.
    pub compensated: Complex,
}

/// One docking: as it would be, and with every interface, 2 s at 1 kHz.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Simulations {
    /// Closing speed, m/s.
    pub closing_speed_m_s: f64,
    /// The simulated system, by Runge–Kutta.
    pub simulated: Vec<SingleDofTick>,
    /// The HIL simulations, in the order of [`InterfaceKind::ALL`]; one ends early when its rig leaves
    /// a metre.
    pub hil: [Vec<SingleDofTick>; 3],
}

/// One tick of a simulation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SingleDofTick {
    /// Time, s.
    pub time_s: f64,
    /// Displacement of the bodies, m, from first touch on; positive when pressed together.
    pub body_m: f64,
    /// Displacement of the mechanism, m: the bodies' own in the simulated system, the rig's in a HIL
    /// simulation.
    pub rig_m: f64,
    /// Force of the mechanism, N; positive pushes apart.
    pub force_n: f64,
}

impl From<&Sample> for SingleDofTick {
    fn from(s: &Sample) -> Self {
        Self { time_s: s.time_s, body_m: s.body_m, rig_m: s.rig_m, force_n: s.force_n }
    }
}

/// `G_I` of one leg against one payload.
struct Bode {
    interface: InterfaceKind,
    payload_n_m: f64,
    linear: Vec<(f64, C)>,
    measured: Vec<(f64, C)>,
}

impl Bode {
    fn new(
        interface: InterfaceKind,
        setup: &SingleDofSetup,
        payload_n_m: f64,
    ) -> Result<Self, SingleDofError> {
        let linear = LinearSimulator::new(setup, payload_n_m).ok_or(SingleDofError::Singular)?;
        let at = |hz: f64| Some((hz, linear.interface(hz)?));
        let measured = SINES_HZ.map(|hz| {
            let g = measure(setup, payload_n_m, AMPLITUDE_M, hz)?;
            Ok((hz, g * setup.sensor.response(s_of(hz))))
        });
        let measured = measured.into_iter().collect::<Result<_, SetupError>>()?;
        let linear =
            frequencies().map(at).collect::<Option<_>>().ok_or(SingleDofError::Singular)?;
        Ok(Self { interface, payload_n_m, linear, measured })
    }

    /// Measured at the paper's frequency.
    fn at_paper_hz(&self) -> C {
        self.measured.iter().find(|(hz, _)| *hz >= PAPER_HZ).map_or(C::ZERO, |(_, g)| *g)
    }

    /// Greatest |G_I − 1| measured up to the docking frequencies.
    fn off_one(&self) -> f64 {
        let docking = self.measured.iter().filter(|(hz, _)| *hz <= DOCKING_HZ);
        largest(docking.map(|(_, g)| (g - 1.0).norm()))
    }

    /// Greatest distance of measured and linear, over the measured points.
    fn off_linear(&self) -> f64 {
        let near = |hz: f64| {
            self.linear.iter().min_by(|a, b| (a.0 - hz).abs().total_cmp(&(b.0 - hz).abs()))
        };
        let off = |(hz, g): &(f64, C)| near(*hz).map_or(f64::NAN, |(_, l)| (g - l).norm());
        largest(self.measured.iter().map(off))
    }

    fn figures(&self) -> InterfaceFigures {
        let g = Complex::from(self.at_paper_hz());
        InterfaceFigures {
            interface: self.interface,
            payload_n_m: self.payload_n_m,
            gain_10_hz_db: g.db(),
            phase_10_hz_deg: g.phase_deg(),
            off_one_to_5_hz: self.off_one(),
            measured_against_linear: self.off_linear(),
        }
    }

    fn result(&self) -> InterfaceResponse {
        let points = |points: &[(f64, C)]| {
            points.iter().map(|(hz, g)| TransferPoint { hz: *hz, value: (*g).into() }).collect()
        };
        InterfaceResponse {
            interface: self.interface,
            payload_n_m: self.payload_n_m,
            linear: points(&self.linear),
            measured: points(&self.measured),
        }
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
fn loops(mass_kg: f64, bodes: &[Bode]) -> Vec<LoopPoint> {
    let of = |kind: InterfaceKind| {
        let stiff = |b: &&Bode| b.interface == kind && b.payload_n_m > 0.0;
        bodes.iter().find(stiff).map(|b| b.linear.as_slice())
    };
    let (Some(plain), Some(ahead)) =
        (of(InterfaceKind::Uncompensated), of(InterfaceKind::Compensated))
    else {
        return Vec::new();
    };
    let point = |((hz, plain), (_, ahead)): (&(f64, C), &(f64, C))| {
        let s = s_of(*hz);
        let open = body_dynamics(mass_kg, s) * transfer::mechanism(STIFFNESS_N_M, DAMPING_N_S_M, s);
        LoopPoint {
            hz: *hz,
            simulated: closed(open).into(),
            uncompensated: closed(open * plain).into(),
            compensated: closed(open * ahead).into(),
        }
    };
    plain.iter().zip(ahead).map(point).collect()
}

/// One docking as it would be, and with every interface.
struct Runs {
    docking: Docking,
    simulated: Vec<Sample>,
    hil: [Vec<Sample>; 3],
}

impl Runs {
    fn new(docking: Docking, legs: &[SingleDofSetup; 2]) -> Result<Self, SetupError> {
        let run = |interface: &Interface<'_>| docking.hil(interface, TICKS);
        let hil = [run(&ONE)?, run(&Interface::Leg(&legs[0]))?, run(&Interface::Leg(&legs[1]))?];
        Ok(Self { simulated: docking.simulated(TICKS), hil, docking })
    }

    fn deviations(&self) -> [Deviation; 3] {
        self.hil.each_ref().map(|hil| Deviation::of(hil, &self.simulated))
    }

    /// With the interface of one the worst of several moments of first touch within a tick.
    fn deviation_of_one(&self) -> Result<Deviation, SetupError> {
        let mut worst = Deviation::of(&self.hil[0], &self.simulated);
        for i in 0..TOUCHES {
            let d = self.docking.touching((f64::from(i) + 0.5) / f64::from(TOUCHES));
            let hil = d.hil(&ONE, TICKS)?;
            worst = worst.or_worse(&Deviation::of(&hil, &d.simulated(TICKS)));
        }
        Ok(worst)
    }

    /// Restitution and duration over the simulated system's.
    fn rebounds(&self) -> Option<[Rebound; 3]> {
        let reference = Rebound::of(&self.docking, &self.simulated)?;
        let ratio = |run: &Vec<Sample>| {
            let r = Rebound::of(&self.docking, run)?;
            Some(Rebound {
                restitution: r.restitution / reference.restitution,
                time_s: r.time_s / reference.time_s,
            })
        };
        let [one, plain, ahead] = self.hil.each_ref().map(ratio);
        Some([one?, plain?, ahead?])
    }

    fn result(&self) -> Simulations {
        let ticks = |run: &[Sample]| run.iter().map(SingleDofTick::from).collect();
        Simulations {
            closing_speed_m_s: self.docking.closing_speed_m_s,
            simulated: ticks(&self.simulated),
            hil: self.hil.each_ref().map(|run| ticks(run)),
        }
    }
}

/// Everything that was computed.
struct Found {
    bodes: Vec<Bode>,
    docking: Runs,
    /// Of the docking; with the interface of one the worst of several touches.
    deviations: [Deviation; 3],
    spring: Runs,
    contact: Runs,
}

impl Found {
    fn hil(&self) -> [HilFigures; 3] {
        let (rebounds, spring) = (self.contact.rebounds(), self.spring.deviations());
        core::array::from_fn(|i| HilFigures {
            interface: InterfaceKind::ALL[i],
            docking: self.deviations[i],
            joined_spring: spring[i],
            contact_restitution_ratio: rebounds.map(|r| r[i].restitution),
            contact_time_ratio: rebounds.map(|r| r[i].time_s),
        })
    }

    fn summary(&self, rig: &Rig, preset: HydraulicPreset, mechanism: &str) -> SingleDofSummary {
        let d = &self.docking.docking;
        SingleDofSummary {
            rig: rig.name.clone(),
            preset,
            mechanism: mechanism.to_owned(),
            chaser_kg: d.chaser_kg,
            target_kg: d.target_kg,
            reduced_mass_kg: d.reduced_mass_kg(),
            closing_speed_m_s: d.closing_speed_m_s,
            gap_m: d.gap_m,
            touches_with_g_i_one: TOUCHES,
            required_with_g_i_one: REQUIRED,
            holds: self.deviations[0].within(REQUIRED),
            g_i: self.bodes.iter().map(Bode::figures).collect(),
            hil: self.hil(),
        }
    }
}

/// Compares the HIL simulation with the simulated system, in one second of computing. The rig gives
/// oil, valve and friction of the leg, the mechanism its axial characteristic.
///
/// # Errors
/// See [`SingleDofError`].
pub fn single_dof(
    rig: &Rig,
    mechanism: &DockingMechanism,
    options: &SingleDofOptions,
) -> Result<SingleDof, SingleDofError> {
    let closing_speed_m_s = options.closing_speed_m_s;
    if !(0.01..=0.5).contains(&closing_speed_m_s) {
        return Err(SingleDofError::Speed { closing_speed_m_s });
    }
    let Attenuator::Characteristic(characteristic) = &mechanism.attenuator else {
        return Err(SingleDofError::NoCharacteristic { mechanism: mechanism.name.clone() });
    };
    let preset = rig.preset(options.preset);
    let oil = rig.drive.hydraulic();
    let oil = oil.ok_or_else(|| SingleDofError::NoOil { rig: rig.name.clone() })?;
    let legs = LEGS.map(|(_, c)| SingleDofSetup::of_drive(oil, preset).with(c));
    let mut bodes = Vec::new();
    for ((interface, _), setup) in LEGS.iter().zip(&legs) {
        for payload_n_m in [0.0, STIFFNESS_N_M] {
            bodes.push(Bode::new(*interface, setup, payload_n_m)?);
        }
    }
    let runs = |m: Mechanism, part: f64| {
        Runs::new(Docking::of_table_2(m, part * closing_speed_m_s), &legs)
    };
    let docking = runs(Mechanism::Characteristic(characteristic.axial.clone()), 1.0)?;
    let mut deviations = docking.deviations();
    deviations[0] = docking.deviation_of_one()?;
    let joined = Mechanism::Linear { stiffness_n_m: STIFFNESS_N_M, damping_n_s_m: DAMPING_N_S_M };
    let found = Found {
        bodes,
        deviations,
        docking,
        spring: runs(joined, SPRING_SPEED)?,
        contact: runs(Mechanism::Contact { stiffness_n_m: STIFFNESS_N_M }, 1.0)?,
    };
    Ok(SingleDof {
        summary: found.summary(rig, preset, &mechanism.name),
        interfaces: found.bodes.iter().map(Bode::result).collect(),
        loops: loops(found.docking.docking.reduced_mass_kg(), &found.bodes),
        docking: found.docking.result(),
        joined_spring: found.spring.result(),
        contact: found.contact.result(),
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use docktwin_model::{load_mechanism, load_rig};

    use super::*;

    fn models(mechanism: &str) -> (Rig, DockingMechanism) {
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf");
        let side = |s: &str| models.join(format!("{mechanism}_{s}.urdf"));
        let rig = load_rig(&models.join("stewart.toml")).expect("shipped").model;
        let m = load_mechanism(&side("active"), &side("passive"), None).expect("shipped").model;
        (rig, m)
    }

    #[test]
    fn oracle_figures_are_those_of_the_curves() {
        let (rig, m) = models("apas");
        let found = single_dof(&rig, &m, &SingleDofOptions::default()).expect("a regular leg");
        let s = &found.summary;
        assert!((s.reduced_mass_kg - 4800.0).abs() < 1e-9 && s.holds);
        // RMS from first touch on, by hand: with a leg the docking of the curves is the one judged.
        for (figures, run) in s.hil.iter().zip(&found.docking.hil).skip(1) {
            let pairs = run.iter().zip(&found.docking.simulated).filter(|(_, b)| b.body_m >= 0.0);
            let (mut apart, mut size) = (0.0, 0.0);
            for (a, b) in pairs {
                apart += (a.body_m - b.body_m).powi(2);
                size += b.body_m * b.body_m;
            }
            let nrms = (apart / size).sqrt();
            assert!((nrms / figures.docking.displacement_nrms - 1.0).abs() < 1e-3, "{figures:?}");
        }
        let at_10_hz = |i: usize| {
            found.interfaces[i].measured.iter().find(|p| p.hz >= PAPER_HZ).expect("10 Hz").value
        };
        for (i, g) in s.g_i.iter().enumerate() {
            assert_eq!(g.gain_10_hz_db.to_bits(), at_10_hz(i).db().to_bits());
        }
        // (6) without damping: ω²_n / (ω²_n − ω²) with ω²_n = K/m_r.
        for p in found.loops.iter().filter(|p| (p.hz - 2.297).abs() > 0.05) {
            let ratio = core::f64::consts::TAU * p.hz;
            let natural = STIFFNESS_N_M / 4800.0;
            let want = natural / (natural - ratio * ratio);
            assert!((p.simulated.re / want - 1.0).abs() < 1e-9 && p.simulated.im.abs() < 1e-9);
        }
    }

    #[test]
    fn invariant_a_figure_that_is_not_known_is_not_within() {
        let good = Deviation {
            displacement_nrms: 1e-3,
            force_nrms: 0.0,
            displacement_peak_error: -1e-3,
            force_peak_error: 1e-4,
        };
        assert!(good.within(REQUIRED));
        for wrong in [1.1e-3, -1.1e-3, f64::NAN] {
            let bad = Deviation { force_peak_error: wrong, ..good };
            assert!(!bad.within(REQUIRED), "{wrong}");
            assert!(!good.or_worse(&bad).within(REQUIRED), "{wrong}");
            assert!(!bad.or_worse(&good).within(REQUIRED), "{wrong}");
        }
    }

    #[test]
    fn regress_what_cannot_be_compared_says_what_to_do() {
        let (rig, m) = models("ring");
        let refused =
            |o: &SingleDofOptions| single_dof(&rig, &m, o).expect_err("no characteristic");
        let e = refused(&SingleDofOptions::default());
        assert_eq!(e, SingleDofError::NoCharacteristic { mechanism: m.name.clone() });
        for closing_speed_m_s in [0.0, 0.51, f64::NAN] {
            let o = SingleDofOptions { closing_speed_m_s, ..SingleDofOptions::default() };
            let e = refused(&o);
            assert!(matches!(e, SingleDofError::Speed { .. }), "{e}");
            assert!(e.remedy().contains("0.01 to 0.5 m/s"), "{e}");
        }
    }

    #[test]
    fn invariant_the_result_survives_json() {
        let (rig, m) = models("apas");
        let options =
            SingleDofOptions { preset: Some(HydraulicPreset::Stiff), closing_speed_m_s: 0.2 };
        let found = single_dof(&rig, &m, &options).expect("a regular leg");
        let text = serde_json::to_string(&found).expect("JSON");
        assert_eq!(serde_json::from_str::<SingleDof>(&text).expect("JSON"), found);
        let text = serde_json::to_string(&options).expect("JSON");
        assert_eq!(serde_json::from_str::<SingleDofOptions>(&text).expect("JSON"), options);
    }
}
