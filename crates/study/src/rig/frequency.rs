//! Natural frequencies of the plate on its oil springs over the docking workspace (Fig. 31–36).

use docktwin_model::{DockingWorkspace, HydraulicPreset, Place, Rig};
use docktwin_physics::platform::maps::{self, FrequencyMap, Maps};
use serde::{Deserialize, Serialize};

use super::{Build, Dof, Extreme, MIDDLE, RigError, Subject, SubjectSummary};

/// The plate touches nothing.
const FREE: maps::PayloadStiffness = [0.0; 6];
/// Steps of a line from the middle to its end.
const LINE_STEPS: i32 = 10;

/// Natural frequencies of a rig.
///
/// The plate stands on the oil springs of its six legs, valves closed. A degree of freedom is *held*
/// when the other five are fixed; a *mode* moves all six.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frequency {
    /// The answer in figures.
    pub summary: FrequencySummary,
    /// The box of relative poses `X_34` that docking needs.
    pub docking_workspace: DockingWorkspace,
    /// Frequencies at the 729 places of the grid of the docking workspace.
    pub places: Vec<PlaceModes>,
    /// Frequencies on the straight line through the middle along every degree of freedom, in the
    /// order of [`Dof::ALL`].
    pub lines: [LineModes; 6],
}

/// Natural frequencies of a rig in figures. Arrays of six are in the order of [`Dof::ALL`], or of the
/// modes from the lowest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrequencySummary {
    /// The rig.
    pub subject: SubjectSummary,
    /// [`Dof::ALL`].
    pub dofs: [Dof; 6],
    /// In the middle of the docking workspace.
    pub middle: MiddleModes,
    /// Every degree of freedom with the others held, Hz, over the 729 places.
    pub held_hz: [Span; 6],
    /// Every mode, Hz.
    pub mode_hz: [Span; 6],
    /// Static stiffness at the origin of `e4` against a single force or moment, the other degrees of
    /// freedom free: N/m for displacements, N·m/rad for rotations.
    pub stiffness: [Span; 6],
    /// Effective mass on a leg, kg: the eigenvalues of `(J M⁻¹ Jᵀ)⁻¹`.
    pub effective_mass_kg: Span,
    /// The same rig with each volume of the oil.
    pub presets: Vec<PresetFrequencies>,
}

/// The plate's modes in the middle of the docking workspace.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MiddleModes {
    /// Every degree of freedom with the others held, Hz.
    pub held_hz: [f64; 6],
    /// Every mode, rising, Hz.
    pub mode_hz: [f64; 6],
    /// For every degree of freedom the mode in whose kinetic energy it has the largest part, 0 to 5.
    pub leading_mode: [usize; 6],
    /// Static stiffness, N/m for displacements, N·m/rad for rotations.
    pub stiffness: [f64; 6],
    /// Effective masses on the legs, rising, kg.
    pub effective_mass_kg: [f64; 6],
}

/// Least and greatest value over the docking workspace.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Span {
    /// Least value and where it occurs.
    pub least: Extreme,
    /// Greatest value and where it occurs.
    pub greatest: Extreme,
}

impl From<maps::Span> for Span {
    fn from(s: maps::Span) -> Self {
        Self { least: s.least.into(), greatest: s.greatest.into() }
    }
}

/// Frequencies with one volume of the oil.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PresetFrequencies {
    /// The volume.
    pub preset: HydraulicPreset,
    /// The plate's mass on the oil spring of one leg, Hz.
    pub lumped_hz: f64,
    /// Least and greatest frequency of every degree of freedom, the others held, Hz.
    pub held_hz: [[f64; 2]; 6],
    /// Least and greatest frequency of every mode, Hz.
    pub mode_hz: [[f64; 2]; 6],
}

/// Natural frequencies at one place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlaceModes {
    /// The place.
    pub place: Place,
    /// Every degree of freedom with the others held, Hz.
    pub held_hz: [f64; 6],
    /// Every mode, rising, Hz.
    pub mode_hz: [f64; 6],
}

/// Natural frequencies on a line through the middle along one degree of freedom.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LineModes {
    /// The degree of freedom that changes along the line.
    pub along: Dof,
    /// 21 places, from the lower end to the upper one.
    pub places: Vec<PlaceModes>,
}

/// Natural frequencies of a rig over its docking workspace.
///
/// # Errors
/// [`RigError::Singular`], [`RigError::NoOil`].
pub fn frequency(rig: &Rig, build: &Build) -> Result<Frequency, RigError> {
    let subject = Subject::new(rig, build);
    let maps = Maps::new(&subject.rig);
    let spring = subject.oil_spring_n_m().ok_or_else(|| subject.no_oil())?;
    let modes = |place: Place| {
        let m = maps.modes(&maps.at(place), spring, &FREE).ok_or(RigError::Singular)?;
        Ok(PlaceModes { place, held_hz: m.held_hz, mode_hz: m.frequency_hz })
    };
    let map_of = |spring: f64| maps.frequencies(spring, &FREE).ok_or(RigError::Singular);
    let places = DockingWorkspace::grid().map(modes).collect::<Result<_, RigError>>()?;
    let mut lines = Dof::ALL.map(|along| LineModes { along, places: Vec::new() });
    for line in &mut lines {
        for n in -LINE_STEPS..=LINE_STEPS {
            let mut place = MIDDLE;
            place.0[line.along.index()] = f64::from(n) / f64::from(LINE_STEPS);
            line.places.push(modes(place)?);
        }
    }
    let presets = HydraulicPreset::WORDS.iter().map(|(_, preset)| {
        let other = subject.with(*preset);
        let (of_oil, lumped_hz) =
            other.oil_spring_n_m().zip(other.lumped_hz()).ok_or_else(|| other.no_oil())?;
        let map = map_of(of_oil)?;
        let ends = |spans: [maps::Span; 6]| spans.map(|s| [s.least.0, s.greatest.0]);
        Ok(PresetFrequencies {
            preset: *preset,
            lumped_hz,
            held_hz: ends(map.held_hz),
            mode_hz: ends(map.mode_hz),
        })
    });
    let presets = presets.collect::<Result<_, RigError>>()?;
    Ok(Frequency {
        summary: summary(&subject, &map_of(spring)?, presets),
        docking_workspace: subject.rig.docking,
        places,
        lines,
    })
}

fn summary(
    subject: &Subject,
    map: &FrequencyMap,
    presets: Vec<PresetFrequencies>,
) -> FrequencySummary {
    FrequencySummary {
        subject: subject.summary(),
        dofs: Dof::ALL,
        middle: MiddleModes {
            held_hz: map.middle.held_hz,
            mode_hz: map.middle.frequency_hz,
            leading_mode: map.middle.leading,
            stiffness: map.middle.stiffness,
            effective_mass_kg: map.effective_mass_middle_kg,
        },
        held_hz: map.held_hz.map(Span::from),
        mode_hz: map.mode_hz.map(Span::from),
        stiffness: map.stiffness.map(Span::from),
        effective_mass_kg: map.effective_mass_kg.into(),
        presets,
    }
}

#[cfg(test)]
mod tests {
    use super::{super::tests::shipped, *};

    #[test]
    fn oracle_frequencies_follow_the_oil_and_the_places() {
        let found = frequency(&shipped(), &Build::default()).expect("a regular rig");
        let s = &found.summary;
        // Table 1 with 2500 kg on one leg, and the square root of the volumes' ratio.
        for (p, (lumped_hz, volume)) in
            s.presets.iter().zip([(16.7, 0.36), (25.9, 0.15), (52.9, 0.036_f64)])
        {
            assert!((p.lumped_hz / lumped_hz - 1.0).abs() < 3e-3, "{p:?}");
            let factor = (0.36 / volume).sqrt();
            for (ends, printed) in p.held_hz.iter().zip(s.presets[0].held_hz) {
                for (hz, printed) in ends.iter().zip(printed) {
                    assert!((hz / (printed * factor) - 1.0).abs() < 1e-9, "{p:?}");
                }
            }
        }
        for (i, span) in s.held_hz.iter().enumerate() {
            let all = || found.places.iter().map(|p| p.held_hz[i]);
            let least = all().fold(f64::INFINITY, f64::min);
            let greatest = all().fold(0.0, f64::max);
            assert_eq!(span.least.value.to_bits(), least.to_bits());
            assert_eq!(span.greatest.value.to_bits(), greatest.to_bits());
            // A lone degree of freedom is at least as stiff as the softest mode and at most as the
            // stiffest (Rayleigh's quotient).
            let middle = &s.middle;
            assert!(
                middle.held_hz[i] >= middle.mode_hz[0] && middle.held_hz[i] <= middle.mode_hz[5]
            );
            // Every line passes the middle, and ends at faces of the box.
            let line = &found.lines[i].places;
            assert_eq!(
                (line.len(), line[10].place, line[10].held_hz),
                (21, MIDDLE, middle.held_hz)
            );
            let ends = [&line[0], &line[20]].map(|p| p.place.0[i]);
            assert!((ends[0] + 1.0).abs() < 1e-15 && (ends[1] - 1.0).abs() < 1e-15, "{ends:?}");
        }
    }

    #[test]
    fn invariant_the_result_survives_json() {
        let build = Build { seed: Some(3), preset: Some(HydraulicPreset::Stiff) };
        let found = frequency(&shipped(), &build).expect("a regular rig");
        let text = serde_json::to_string(&found).expect("JSON");
        assert_eq!(serde_json::from_str::<Frequency>(&text).expect("JSON"), found);
    }
}
