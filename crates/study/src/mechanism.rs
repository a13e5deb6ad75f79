//! A docking mechanism on the test bench (Fig. 6–9): force over displacement on every axis, coupling
//! between the axes, and the contact law.
//!
//! The ring is moved along one axis at a time; [`docktwin_physics::bench`] says how, and defines
//! deflection and reaction. Axes are those of `e3`: X along the docking axis (compression is
//! negative), Y and Z sideways, roll, pitch and yaw about them. Along X the other axes are held, as in
//! a docking; along the others the ring is free in the remaining ones, and held for comparison.

use docktwin_model::{AttenuationChoice, Attenuator, DockingMechanism};
use docktwin_physics::bench::{
    self, Axis, AxisFigures, AxisTests, BenchError, Cycling, Instability, Matrix6, Others, Record,
    Six, Wave, characterise, instability, tangent,
};
use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use serde::{Deserialize, Serialize};

/// Depth of the contact loops, m.
const CONTACT_DEPTH_M: f64 = 0.01;
/// Speeds at touch of the contact loops, m/s: slow, the fastest of IDSS, the paper's.
const CONTACT_SPEEDS_M_S: [f64; 3] = [0.0, 0.10, 0.35];
/// Steps of a contact loop.
const CONTACT_STEPS: u32 = 400;
/// Couplings at and below this are left out of [`PoseMatrices::couplings`].
const LEAST_COUPLING: f64 = 0.05;
/// So many times the others' stiffness is that of X at least where the ring is "stiff in X and soft
/// in the others" (§3.5).
const STIFF_IN_X: f64 = 10.0;

/// Which axes are tested.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MechanismOptions {
    /// At least one.
    pub axes: Vec<Axis>,
}

impl Default for MechanismOptions {
    /// All six.
    fn default() -> Self {
        Self { axes: Axis::ALL.to_vec() }
    }
}

/// Why a mechanism has no result.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MechanismError {
    /// The bench refused or failed.
    #[error(transparent)]
    Bench(#[from] BenchError),
    /// No axis was asked for.
    #[error("no axis is to be tested")]
    NoAxis,
}

impl MechanismError {
    /// What to do about it.
    #[must_use]
    pub const fn remedy(&self) -> &'static str {
        match self {
            Self::Bench(BenchError::Rigid) => "give a mechanism with an attenuation that moves",
            Self::Bench(BenchError::Motion) => {
                "check the travels and the series brakes of the attenuation; a brake that is stiff \
                 and hardly viscous needs very small steps"
            }
            Self::Bench(BenchError::NoEquilibrium { .. }) => {
                "give the free channels some stiffness or damping, so that they have a place of \
                 their own"
            }
            Self::NoAxis => "name at least one in `axes`",
        }
    }
}

/// A mechanism on the test bench.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MechanismBench {
    /// The answer in figures.
    pub summary: MechanismSummary,
    /// Stiffness along X against the others; `None` unless X and another axis were tested.
    pub axial_contrast: Option<AxialContrast>,
    /// Records of the tests, in the order of `summary.axes`.
    pub records: Vec<AxisRecords>,
    /// The contact law, one loop for every speed.
    pub contact_loops: Vec<ContactLoop>,
}

/// A mechanism on the test bench in figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MechanismSummary {
    /// Name of the mechanism.
    pub mechanism: String,
    /// What carries the ring.
    pub attenuation: AttenuationChoice,
    /// Every tested axis.
    pub axes: Vec<AxisSummary>,
    /// Stiffness and damping about six poses of the ring.
    pub matrices: Vec<PoseMatrices>,
    /// Stiffness along X over that of the stiffest other axis: see [`AxialContrast`].
    pub stiffest_in_x_by: Option<f64>,
}

/// Figures of one axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisSummary {
    /// The axis.
    pub axis: Axis,
    /// Units of deflection, reaction and energy of all figures of this axis: `"m, N, J"` or
    /// `"rad, N m, J"`.
    pub units: String,
    /// As a docking meets it: X with the other axes held, the others with the ring free in them.
    pub as_in_a_docking: TestFigures,
    /// With the other axes held; `None` for X, where it is the same.
    pub others_held: Option<TestFigures>,
    /// Losses at the speed of a docking.
    pub lost_per_cycle_at_docking_speed_j: DockingSpeedLoss,
    /// Where the ring, held on this axis, would give way on another; `None` where it does not within
    /// its travel.
    pub unstable_from: Option<StabilityLoss>,
}

/// Figures of one axis, m, N, N/m, J, or rad, N·m, N·m/rad, J. The *first end* of the travel is
/// compression along X and the positive end of the other axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TestFigures {
    /// What the bench did with the other axes.
    pub other_axes: Others,
    /// Ends of the travel, negative and positive; `None` beyond 0.5 m or 1 rad.
    pub travel: [Option<f64>; 2],
    /// Slope of small cycles about rest, every brake holding.
    pub soft_stiffness: f64,
    /// Amplitude of those cycles, above 0.
    pub soft_amplitude: f64,
    /// Half the height of that loop at rest, at least 0.
    pub dry_friction: f64,
    /// Deflection at which a series brake begins to slip on the way to the first end.
    pub brake_slips_at: Option<f64>,
    /// The reaction there.
    pub brake_slips_with: Option<f64>,
    /// Slope over the outer half of the travel, going to the first end.
    pub working_stiffness: f64,
    /// Reaction over deflection at 98 % of the travel, the first end.
    pub secant_stiffness: f64,
    /// Reaction at the travel's negative and positive end, reached slowly.
    pub reaction_at_travel_end: [f64; 2],
    /// Slope beyond the travel, going into the end stop of the first end.
    pub stop_stiffness: f64,
    /// Loss of one slow cycle over 98 % of the travel, J.
    pub lost_per_cycle_j: f64,
    /// Work of one slow stroke from rest to 98 % of the first end, J.
    pub work_of_one_stroke_j: f64,
}

impl From<&AxisFigures> for TestFigures {
    fn from(f: &AxisFigures) -> Self {
        Self {
            other_axes: f.others,
            travel: f.travel,
            soft_stiffness: f.soft_stiffness,
            soft_amplitude: f.soft_amplitude,
            dry_friction: f.friction,
            brake_slips_at: f.slip.map(|s| s[0]),
            brake_slips_with: f.slip.map(|s| s[1]),
            working_stiffness: f.working_stiffness,
            secant_stiffness: f.secant_stiffness,
            reaction_at_travel_end: f.end_reaction,
            stop_stiffness: f.stop_stiffness,
            lost_per_cycle_j: f.cycle_loss_j,
            work_of_one_stroke_j: f.stroke_work_j,
        }
    }
}

/// Losses of one cycle over nine tenths of the test's travel at the speed of a docking, J.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DockingSpeedLoss {
    /// Greatest speed of the sine, m/s or rad/s: the paper's initial conditions (§3.1).
    pub speed: f64,
    /// With the damping before capture, J.
    pub before_capture: Option<f64>,
    /// With the damping after capture, J.
    pub after_capture: Option<f64>,
}

/// Where the ring, held on one axis alone, stops being stable on the others.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StabilityLoss {
    /// Deflection of the held axis, m or rad.
    pub at: f64,
    /// Reaction on it, N or N·m.
    pub reaction: f64,
    /// The axis that lost most of the stiffness it has at rest.
    pub weakest_axis: Axis,
    /// What is left of that stiffness, N/m or N·m/rad.
    pub its_stiffness: f64,
}

impl From<Instability> for StabilityLoss {
    fn from(u: Instability) -> Self {
        Self { at: u.at, reaction: u.reaction, weakest_axis: u.weakest, its_stiffness: u.stiffness }
    }
}

/// Stiffness and damping of the ring about one pose, every brake holding. Rows are reactions (force N,
/// moment N·m), columns displacements (m) and rotation vector (rad), or their rates, along `e3`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseMatrices {
    /// The pose in words.
    pub pose: String,
    /// The pose: displacements from rest (m), rotation vector (rad).
    pub deflection: Six,
    /// Reaction at rest in it, N and N·m about the ring's centre.
    pub reaction: Six,
    /// Hessian of the stored energy, N/m, N/rad = N·m/m, N·m/rad; symmetric.
    pub stiffness: Matrix6,
    /// Damping before capture, N·s/m, N·s/rad, N·m·s/m, N·m·s/rad.
    pub damping_before_capture: Matrix6,
    /// Damping after capture, likewise.
    pub damping_after_capture: Matrix6,
}

/// A coupling of two axes in a matrix.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coupling {
    /// The axes, in their order.
    pub axes: [Axis; 2],
    /// Element of the matrix over the geometric mean of the diagonal: 0 uncoupled, ±1 as strong as
    /// the axes themselves.
    pub coupling: f64,
}

impl PoseMatrices {
    /// The three matrices with their names.
    #[must_use]
    pub const fn named(&self) -> [(&'static str, &Matrix6); 3] {
        [
            ("stiffness", &self.stiffness),
            ("damping_before_capture", &self.damping_before_capture),
            ("damping_after_capture", &self.damping_after_capture),
        ]
    }

    /// Couplings of a matrix above 0.05, largest first; an axis whose diagonal is not positive has
    /// none.
    #[must_use]
    pub fn couplings(matrix: &Matrix6) -> Vec<Coupling> {
        let pairs = Axis::ALL.into_iter().flat_map(|b| Axis::ALL.map(|a| [a, b]));
        let mut out: Vec<Coupling> = pairs
            .filter(|[a, b]| a < b)
            .map(|axes| Coupling {
                axes,
                coupling: bench::coupling(matrix, axes[0].index(), axes[1].index()),
            })
            .filter(|c| c.coupling.abs() > LEAST_COUPLING)
            .collect();
        out.sort_by(|a, b| b.coupling.abs().total_cmp(&a.coupling.abs()));
        out
    }

    /// Axes whose diagonal element of a matrix is not positive.
    #[must_use]
    pub fn lost(matrix: &Matrix6) -> Vec<Axis> {
        Axis::ALL.into_iter().filter(|a| matrix[a.index()][a.index()] <= 0.0).collect()
    }
}

/// Stiffness along X against the stiffest other axis, rotations taken at the ring's mean radius.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxialContrast {
    /// Soft stiffness along X, N/m.
    pub axial_n_m: f64,
    /// The stiffest other axis that was tested.
    pub stiffest_other: Axis,
    /// Its soft stiffness, N/m; of a rotation over the square of the ring's radius.
    pub other_n_m: f64,
    /// Whether the ring is stiff in X and soft in the others, as the paper says (§3.5): more than ten
    /// times.
    pub as_the_paper_says: bool,
}

impl AxialContrast {
    fn of(axes: &[AxisSummary], ring_radius_m: f64) -> Option<Self> {
        let k = |a: &AxisSummary| {
            let soft = a.as_in_a_docking.soft_stiffness;
            if a.axis.turns() { soft / (ring_radius_m * ring_radius_m) } else { soft }
        };
        let axial_n_m = axes.iter().find(|a| a.axis == Axis::X).map(k)?;
        let others = axes.iter().filter(|a| a.axis != Axis::X);
        let other = others.max_by(|a, b| k(a).total_cmp(&k(b)))?;
        let other_n_m = k(other);
        Some(Self {
            axial_n_m,
            stiffest_other: other.axis,
            other_n_m,
            as_the_paper_says: axial_n_m > STIFF_IN_X * other_n_m,
        })
    }
}

/// Records of the tests of one axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisRecords {
    /// The axis.
    pub axis: Axis,
    /// As a docking meets it.
    pub as_in_a_docking: SlowTests,
    /// With the other axes held; `None` for X, where it is the same.
    pub others_held: Option<SlowTests>,
    /// Sine at the speed of a docking, before and after capture.
    pub docking_speed: [Record; 2],
}

/// Slow tests of one axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SlowTests {
    /// Two small cycles about rest.
    pub soft: Record,
    /// Two cycles over 98 % of the travel.
    pub working: Record,
    /// One cycle into the end stops.
    pub stops: Record,
}

impl From<AxisTests> for SlowTests {
    fn from(t: AxisTests) -> Self {
        Self { soft: t.soft, working: t.working, stops: t.stops }
    }
}

/// The contact law: pressed in as a sine to 10 mm and let go.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactLoop {
    /// Speed at touch, m/s.
    pub speed_at_touch_m_s: f64,
    /// 401 points from touch to touch.
    pub points: Vec<ContactPoint>,
}

/// A point of a contact loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactPoint {
    /// Depth, m, at least 0.
    pub depth_m: f64,
    /// Normal force, N, at least 0.
    pub force_n: f64,
}

/// Speed of a docking along an axis: the paper's initial conditions (§3.1), m/s or rad/s.
#[must_use]
pub fn docking_speed(axis: Axis) -> f64 {
    match axis {
        Axis::X => 0.35,
        Axis::Y | Axis::Z => 0.10,
        _ => 1f64.to_radians(),
    }
}

/// Poses of the matrices.
fn poses() -> [(&'static str, Six); 6] {
    let tilt = 2f64.to_radians();
    [
        ("rest", [0.0; 6]),
        ("x -20 mm", [-0.02, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ("y 20 mm", [0.0, 0.02, 0.0, 0.0, 0.0, 0.0]),
        ("pitch 2 deg", [0.0, 0.0, 0.0, 0.0, tilt, 0.0]),
        ("y 20 mm, pitch 2 deg", [0.0, 0.02, 0.0, 0.0, tilt, 0.0]),
        ("x -20 mm, y 20 mm, pitch 2 deg", [-0.02, 0.02, 0.0, 0.0, tilt, 0.0]),
    ]
}

fn test_axis(m: &DockingMechanism, axis: Axis) -> Result<(AxisSummary, AxisRecords), BenchError> {
    let others = if axis == Axis::X { Others::Held } else { Others::Free };
    let main = characterise(m, axis, others)?;
    let held = if axis == Axis::X { None } else { Some(characterise(m, axis, Others::Held)?) };
    let ends = main.working.test.ends;
    let fast = |damping_phase| {
        bench::run(
            m,
            &Cycling {
                axis,
                ends: ends.map(|x| 0.9 * x),
                speed: docking_speed(axis),
                wave: Wave::Sine,
                cycles: 2,
                others,
                offset: [0.0; 6],
                damping_phase,
            },
        )
    };
    let fast = [fast(0.0)?, fast(1.0)?];
    let unstable = instability(m, axis, ends[0])?;
    let summary = AxisSummary {
        axis,
        units: if axis.turns() { "rad, N m, J" } else { "m, N, J" }.to_owned(),
        as_in_a_docking: TestFigures::from(&main.figures),
        others_held: held.as_ref().map(|h| TestFigures::from(&h.figures)),
        lost_per_cycle_at_docking_speed_j: DockingSpeedLoss {
            speed: docking_speed(axis),
            before_capture: fast[0].cycle_lost_j.last().copied(),
            after_capture: fast[1].cycle_lost_j.last().copied(),
        },
        unstable_from: unstable.map(StabilityLoss::from),
    };
    let records = AxisRecords {
        axis,
        as_in_a_docking: main.into(),
        others_held: held.map(SlowTests::from),
        docking_speed: fast,
    };
    Ok((summary, records))
}

fn matrices(m: &DockingMechanism) -> Result<Vec<PoseMatrices>, BenchError> {
    let of = |(pose, deflection): (&str, Six)| {
        let t = tangent(m, &deflection)?;
        Ok(PoseMatrices {
            pose: pose.to_owned(),
            deflection: t.deflection,
            reaction: t.reaction,
            stiffness: t.stiffness,
            damping_before_capture: t.damping_before,
            damping_after_capture: t.damping_after,
        })
    };
    poses().into_iter().map(of).collect()
}

fn contact_loop(m: &DockingMechanism, speed_at_touch_m_s: f64) -> ContactLoop {
    let points =
        bench::contact_loop(&m.contact, CONTACT_DEPTH_M, speed_at_touch_m_s, CONTACT_STEPS);
    ContactLoop {
        speed_at_touch_m_s,
        points: points
            .into_iter()
            .map(|[depth_m, force_n]| ContactPoint { depth_m, force_n })
            .collect(),
    }
}

/// What carries the ring of a mechanism.
///
/// # Errors
/// It is rigid: there is nothing to test.
pub const fn attenuation(
    mechanism: &DockingMechanism,
) -> Result<AttenuationChoice, MechanismError> {
    match mechanism.attenuator {
        Attenuator::Rigid => Err(MechanismError::Bench(BenchError::Rigid)),
        Attenuator::Characteristic(_) => Ok(AttenuationChoice::Characteristic),
        Attenuator::Differential(_) => Ok(AttenuationChoice::Differential),
    }
}

/// Tests a mechanism. All six axes take a second; axes are shared by all cores, and the result does
/// not depend on how.
///
/// # Errors
/// See [`MechanismError`].
pub fn mechanism(
    mechanism: &DockingMechanism,
    options: &MechanismOptions,
) -> Result<MechanismBench, MechanismError> {
    let attenuation = attenuation(mechanism)?;
    let mut axes = options.axes.clone();
    axes.sort_unstable();
    axes.dedup();
    if axes.is_empty() {
        return Err(MechanismError::NoAxis);
    }
    let tested: Vec<_> = axes.par_iter().map(|axis| test_axis(mechanism, *axis)).collect();
    let (axes, records): (Vec<_>, Vec<_>) =
        tested.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
    let axial_contrast = AxialContrast::of(&axes, mechanism.active.ring.mean_radius_m);
    Ok(MechanismBench {
        summary: MechanismSummary {
            mechanism: mechanism.name.clone(),
            attenuation,
            axes,
            matrices: matrices(mechanism)?,
            stiffest_in_x_by: axial_contrast.map(|c| c.axial_n_m / c.other_n_m),
        },
        axial_contrast,
        records,
        contact_loops: CONTACT_SPEEDS_M_S.map(|v| contact_loop(mechanism, v)).to_vec(),
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use docktwin_model::load_mechanism;

    use super::*;

    fn shipped(name: &str, choice: Option<AttenuationChoice>) -> DockingMechanism {
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf");
        let side = |s: &str| models.join(format!("{name}_{s}.urdf"));
        load_mechanism(&side("active"), &side("passive"), choice).expect("shipped").model
    }

    #[test]
    fn oracle_figures_are_those_of_the_model_file() {
        let m = shipped("apas", None);
        let options = MechanismOptions { axes: vec![Axis::Roll, Axis::X, Axis::Roll] };
        let found = mechanism(&m, &options).expect("it moves");
        let [x, roll] = &found.summary.axes[..] else { panic!("two axes") };
        assert_eq!((x.axis, roll.axis), (Axis::X, Axis::Roll));
        let near = |got: f64, want: f64| assert!((got / want - 1.0).abs() < 2e-3, "{got} {want}");
        near(x.as_in_a_docking.soft_stiffness, 3e5);
        near(x.as_in_a_docking.dry_friction, 250.0);
        near(x.as_in_a_docking.travel[0].expect("an end"), -0.15);
        near(roll.as_in_a_docking.soft_stiffness, 600.0);
        assert!(x.others_held.is_none() && roll.others_held.is_some());
        let contrast = found.axial_contrast.expect("X and another");
        near(contrast.axial_n_m, 3e5);
        near(contrast.other_n_m, 600.0 / (0.6 * 0.6));
        assert!(contrast.as_the_paper_says && contrast.stiffest_other == Axis::Roll);
        near(found.summary.stiffest_in_x_by.expect("a ratio"), 180.0);
        // 1e6 N/m pressed in by 10 mm, slowly.
        let deepest = found.contact_loops[0].points[200];
        near(deepest.depth_m, 0.01);
        near(deepest.force_n, 1e4);
    }

    #[test]
    fn oracle_couplings_of_a_matrix() {
        let mut a = [[0.0; 6]; 6];
        for (i, row) in a.iter_mut().enumerate() {
            row[i] = 4.0;
        }
        (a[0][4], a[4][0], a[1][5], a[5][1]) = (1.0, 1.0, -3.0, -3.0);
        (a[2][3], a[3][2]) = (0.1, 0.1);
        let axes = |c: &[Coupling]| c.iter().map(|c| (c.axes, c.coupling)).collect::<Vec<_>>();
        let want = [([Axis::Y, Axis::Yaw], -0.75), ([Axis::X, Axis::Pitch], 0.25)];
        assert_eq!(axes(&PoseMatrices::couplings(&a)), want);
        a[5][5] = -4.0;
        assert_eq!(axes(&PoseMatrices::couplings(&a)), want[1..]);
        assert_eq!(PoseMatrices::lost(&a), [Axis::Yaw]);
    }

    #[test]
    fn regress_what_cannot_be_tested_says_what_to_do() {
        let rigid = mechanism(&shipped("ring", None), &MechanismOptions::default());
        let e = rigid.expect_err("rigid");
        assert_eq!(e, MechanismError::Bench(BenchError::Rigid));
        assert!(e.remedy().contains("attenuation that moves"), "{e}");
        let none = mechanism(&shipped("apas", None), &MechanismOptions { axes: Vec::new() });
        assert_eq!(none, Err(MechanismError::NoAxis));
    }

    #[test]
    fn invariant_the_result_survives_json() {
        let m = shipped("apas", Some(AttenuationChoice::Differential));
        let options = MechanismOptions { axes: vec![Axis::X, Axis::Pitch] };
        let found = mechanism(&m, &options).expect("it moves");
        let text = serde_json::to_string(&found).expect("JSON");
        assert_eq!(serde_json::from_str::<MechanismBench>(&text).expect("JSON"), found);
        let text = serde_json::to_string(&options).expect("JSON");
        assert_eq!(text, r#"{"axes":["x","pitch"]}"#);
        assert_eq!(serde_json::from_str::<MechanismOptions>(&text).expect("JSON"), options);
    }
}
