//! How the closed-loop poles move with the stiffness of the payload, (11).

use docktwin_control::{
    linear,
    response::{Bench, LinearModel, Point},
};
use docktwin_core::DVec3;
use docktwin_model::{HydraulicPreset, Place, Rig};
use serde::{Deserialize, Serialize};

use super::{
    Build, Dof, Extreme, LegControl, MIDDLE, PAPER_HZ, PAYLOAD_N_M, Payload, Pole, ResponsePoint,
    RigError, Subject, bode::MODAL_HZ, middle_and_corners,
};
use crate::{Progress, parallel::in_parallel};

/// Factor of the bulk modulus of the oil with which the changes are computed once more: oil without
/// air.
pub const MORE_BULK_MODULUS: f64 = 1.5;

/// Directions of the payload's spring.
const DIRECTIONS: [Payload; 2] = [Payload::Axial, Payload::Lateral];

/// Stiffnesses of the pole map, N/m: none, then eight in a decade.
fn stiffnesses_n_m() -> impl Iterator<Item = f64> {
    core::iter::once(0.0)
        .chain((0..=24).map(|n| PAYLOAD_N_M * 10f64.powf(f64::from(n) / 8.0 - 3.0)))
}

/// How the poles are computed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StiffnessOptions {
    /// The rig; without a preset, every volume of the oil in turn.
    pub build: Build,
    /// Changes to the leg control.
    pub leg_control: LegControl,
}

/// How the closed loop changes with the stiffness of its payload.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stiffness {
    /// The answer in figures.
    pub summary: StiffnessSummary,
    /// Poles and responses in the middle, by preset, then direction.
    pub series: Vec<StiffnessSeries>,
}

/// How the closed loop changes with the stiffness of its payload, in figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StiffnessSummary {
    /// Robot name of the URDF.
    pub rig: String,
    /// Seed of the draw; `None` for the rig exactly as its file says.
    pub seed: Option<u64>,
    /// Figures for every volume of the oil.
    pub presets: Vec<PresetStiffness>,
}

/// Figures for one volume of the oil.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PresetStiffness {
    /// The volume.
    pub preset: HydraulicPreset,
    /// Stiffness K_h of the oil of one leg, (10), N/m: the mean of the six.
    pub oil_spring_n_m: f64,
    /// K/K_h of (11) for the stiffest payload; should be far below 1.
    pub stiffness_ratio: f64,
    /// Whether all poles decay: against every stiffness in the middle, and against none and the
    /// stiffest payload in all corners.
    pub stable: bool,
    /// Least damping ratio of a mode in the middle and all corners, against none and the stiffest
    /// payload, at most 1.
    pub least_modal_damping: f64,
    /// Figures for the directions axial and lateral.
    pub payloads: [PayloadStiffness; 2],
}

/// Figures for one direction of the payload. Pairs are against no payload, then against
/// [`PAYLOAD_N_M`], over the middle and all corners.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PayloadStiffness {
    /// Direction of the spring.
    pub payload: Payload,
    /// Least damping ratio of a mode; negative is unstable.
    pub least_modal_damping: [Extreme; 2],
    /// Frequency of the slowest pole, Hz.
    pub slowest_pole_hz: [Extreme; 2],
    /// Largest change of the gain at 10 Hz from no payload to [`PAYLOAD_N_M`], dB, with its sign.
    pub gain_change_10_hz_db: Change,
    /// Largest change of the phase at 10 Hz, degrees, with its sign.
    pub phase_change_10_hz_deg: Change,
    /// [`MORE_BULK_MODULUS`].
    pub with_bulk_modulus_times: f64,
    /// Largest change of the gain with so much more bulk modulus, dB.
    pub then_gain_change_10_hz_db: f64,
    /// Largest change of the phase with so much more bulk modulus, degrees.
    pub then_phase_change_10_hz_deg: f64,
}

/// The largest change, and where it occurs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// The change; its unit stands at the field that holds it.
    pub value: f64,
    /// Driven degree of freedom.
    pub dof: Dof,
    /// Place in the docking workspace.
    pub at: Place,
}

impl Change {
    const NONE: Self = Self { value: 0.0, dof: Dof::X, at: MIDDLE };

    fn enlarge(&mut self, value: f64, dof: Dof, at: Place) {
        if value.abs() > self.value.abs() {
            *self = Self { value, dof, at };
        }
    }
}

/// One volume of the oil against payloads in one direction, in the middle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StiffnessSeries {
    /// The volume.
    pub preset: HydraulicPreset,
    /// Direction of the spring.
    pub payload: Payload,
    /// From no payload to [`PAYLOAD_N_M`].
    pub steps: Vec<StiffnessStep>,
}

/// The closed loop against one stiffness, in the middle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StiffnessStep {
    /// Stiffness of the payload, N/m.
    pub stiffness_n_m: f64,
    /// All poles, slowest first.
    pub poles: Vec<Pole>,
    /// Response of the linear model at 10 Hz, one point for every driven degree of freedom.
    pub response_10_hz: [ResponsePoint; 6],
}

/// The closed loop of a subject.
struct ClosedLoop<'a> {
    subject: &'a Subject,
    bench: Bench,
}

impl<'a> ClosedLoop<'a> {
    fn new(subject: &'a Subject, changes: &LegControl) -> Self {
        let setup = subject.setup(changes);
        let bench = Bench {
            x_34: subject.file.docking.pose(MIDDLE.0),
            lever_m: setup.platform.plate_radius_m(),
            setup,
            payload_n_m: DVec3::ZERO,
            foreseen: false,
        };
        Self { subject, bench }
    }

    fn at(&self, place: Place, payload_n_m: DVec3) -> Option<(Bench, LinearModel)> {
        let bench = Bench {
            x_34: self.subject.file.docking.pose(place.0),
            payload_n_m,
            ..self.bench.clone()
        };
        let linear = bench.linear()?;
        Some((bench, linear))
    }

    fn step(&self, payload: Payload, stiffness_n_m: f64) -> Option<StiffnessStep> {
        let (bench, linear) = self.at(MIDDLE, payload.direction() * stiffness_n_m)?;
        Some(StiffnessStep {
            stiffness_n_m,
            poles: linear.poles()?.iter().map(Pole::from).collect(),
            response_10_hz: bench
                .linear_points(&linear, PAPER_HZ)?
                .each_ref()
                .map(ResponsePoint::from),
        })
    }

    /// Response at 10 Hz from every degree of freedom.
    fn response_10_hz(&self, place: Place, payload_n_m: DVec3) -> Option<[Point; 6]> {
        let (bench, linear) = self.at(place, payload_n_m)?;
        bench.linear_points(&linear, PAPER_HZ)
    }

    /// Largest changes of gain (dB) and phase (degrees) at 10 Hz over the middle and all corners.
    fn changes(&self, payload: Payload) -> Option<[Change; 2]> {
        let [mut gain, mut phase] = [Change::NONE; 2];
        for place in middle_and_corners() {
            let free = self.response_10_hz(place, DVec3::ZERO)?;
            let stiff = self.response_10_hz(place, payload.direction() * PAYLOAD_N_M)?;
            for dof in Dof::ALL {
                let i = dof.index();
                gain.enlarge(stiff[i].gain_db(i) - free[i].gain_db(i), dof, place);
                phase.enlarge(stiff[i].phase_deg(i) - free[i].phase_deg(i), dof, place);
            }
        }
        Some([gain, phase])
    }

    /// Least damping of a mode and slowest pole over the middle and all corners.
    fn margins(&self, payload_n_m: DVec3) -> Option<[Extreme; 2]> {
        let [mut damping, mut slowest] = [Extreme::HIGHEST; 2];
        for place in middle_and_corners() {
            let poles = self.at(place, payload_n_m)?.1.poles()?;
            for p in poles.iter().filter(|p: &&linear::Pole| p.frequency_hz < MODAL_HZ) {
                damping.lower(p.damping, place);
                slowest.lower(p.frequency_hz, place);
            }
        }
        Some([damping, slowest])
    }
}

/// Figures and series of one volume of the oil.
fn of(subject: &Subject, changes: &LegControl) -> Option<(PresetStiffness, Vec<StiffnessSeries>)> {
    let l = ClosedLoop::new(subject, changes);
    let mut file = subject.file.clone();
    file.drive.hydraulic_mut()?.hydraulics.bulk_modulus_pa *= MORE_BULK_MODULUS;
    let build = Build { preset: Some(subject.preset), seed: subject.seed };
    let stiffer = Subject::new(&file, &build);
    let stiffer = ClosedLoop::new(&stiffer, changes);
    let free = l.margins(DVec3::ZERO)?;
    let figures = |payload: Payload| {
        let held = l.margins(payload.direction() * PAYLOAD_N_M)?;
        let [gain, phase] = l.changes(payload)?;
        let [then_gain, then_phase] = stiffer.changes(payload)?;
        Some(PayloadStiffness {
            payload,
            least_modal_damping: [free[0], held[0]],
            slowest_pole_hz: [free[1], held[1]],
            gain_change_10_hz_db: gain,
            phase_change_10_hz_deg: phase,
            with_bulk_modulus_times: MORE_BULK_MODULUS,
            then_gain_change_10_hz_db: then_gain.value,
            then_phase_change_10_hz_deg: then_phase.value,
        })
    };
    let [axial, lateral] = DIRECTIONS.map(figures);
    let payloads = [axial?, lateral?];
    let series = DIRECTIONS.iter().map(|payload| {
        let steps = stiffnesses_n_m().map(|n_m| l.step(*payload, n_m)).collect::<Option<_>>()?;
        Some(StiffnessSeries { preset: subject.preset, payload: *payload, steps })
    });
    let series = series.collect::<Option<Vec<_>>>()?;
    let dampings = || payloads.iter().flat_map(|p| p.least_modal_damping).map(|d| d.value);
    let poles = || series.iter().flat_map(|c| &c.steps).flat_map(|s| &s.poles);
    let oil_spring_n_m = subject.oil_spring_n_m()?;
    let figures = PresetStiffness {
        preset: subject.preset,
        oil_spring_n_m,
        stiffness_ratio: PAYLOAD_N_M / oil_spring_n_m,
        stable: dampings().all(|d| d > 0.0) && poles().all(|p| p.real_rad_s < 0.0),
        least_modal_damping: dampings().fold(1.0, f64::min),
        payloads,
    };
    Some((figures, series))
}

/// Computes how the closed-loop poles of a rig's linear model move as the payload's stiffness goes
/// from 0 to [`PAYLOAD_N_M`], along X and along Y.
///
/// # Errors
/// [`RigError::Singular`], [`RigError::NoOil`].
pub fn stiffness(
    rig: &Rig,
    options: &StiffnessOptions,
    progress: &mut (dyn Progress + Send),
) -> Result<Stiffness, RigError> {
    let subject = Subject::new(rig, &options.build);
    if subject.legs.hydraulic().is_none() {
        return Err(subject.no_oil());
    }
    let presets: Vec<HydraulicPreset> = match options.build.preset {
        Some(preset) => vec![preset],
        None => HydraulicPreset::WORDS.iter().map(|(_, preset)| *preset).collect(),
    };
    let found = in_parallel(presets.len(), progress, |i| {
        of(&subject.with(presets[i]), &options.leg_control).ok_or(RigError::Singular)
    })?;
    let (presets, series): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    Ok(Stiffness {
        summary: StiffnessSummary { rig: subject.rig.name, seed: subject.seed, presets },
        series: series.into_iter().flatten().collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::{
        super::{LegSetting, tests::shipped},
        *,
    };

    #[test]
    fn oracle_no_stiffness_has_no_direction_and_the_shipped_rig_is_stable() {
        let options = StiffnessOptions {
            build: Build { preset: Some(HydraulicPreset::Consistent), seed: Some(1) },
            ..StiffnessOptions::default()
        };
        let found = stiffness(&shipped(), &options, &mut ()).expect("a regular rig");
        let [axial, lateral] = &found.series[..] else { panic!("two directions") };
        assert_eq!((axial.steps.len(), axial.steps[0].clone()), (26, lateral.steps[0].clone()));
        assert_ne!(axial.steps[25], lateral.steps[25]);
        assert!((axial.steps[25].stiffness_n_m - PAYLOAD_N_M).abs() < 1e-6);
        let p = &found.summary.presets[0];
        assert!(p.stable && p.least_modal_damping >= 0.1);
        for payload in &p.payloads {
            // More bulk modulus makes the payload matter less.
            let change = payload.gain_change_10_hz_db.value.abs();
            assert!(payload.then_gain_change_10_hz_db.abs() < change, "{payload:?}");
        }
        let text = serde_json::to_string(&found).expect("JSON");
        assert_eq!(serde_json::from_str::<Stiffness>(&text).expect("JSON"), found);
        let text = serde_json::to_string(&options).expect("JSON");
        assert_eq!(serde_json::from_str::<StiffnessOptions>(&text).expect("JSON"), options);
    }

    #[test]
    fn oracle_a_loop_with_too_much_gain_is_unstable() {
        let mut options = StiffnessOptions {
            build: Build { preset: Some(HydraulicPreset::Printed), seed: None },
            ..StiffnessOptions::default()
        };
        options.leg_control.set(LegSetting::PositionGain, 200.0).expect("in range");
        options.leg_control.set(LegSetting::DampingRatio, 0.0).expect("in range");
        let found = stiffness(&shipped(), &options, &mut ()).expect("a regular rig");
        let p = &found.summary.presets[0];
        assert!(!p.stable && p.least_modal_damping < 0.0, "{p:?}");
        // A pole on the right is growing motion.
        let poles = found.series.iter().flat_map(|c| &c.steps).flat_map(|s| &s.poles);
        assert!(poles.into_iter().any(|p| p.real_rad_s > 0.0 && p.damping_ratio < 0.0));
    }
}
