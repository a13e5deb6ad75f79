//! Whether the docking workspace fits into what legs and joints reach (Fig. 30), and what the rig can
//! do there.

use core::f64::consts::TAU;

use docktwin_core::{DQuat, DVec3, Pose, SimTime, Twist, Wrench};
use docktwin_model::{DockingWorkspace, Place, Rig};
use docktwin_physics::platform::maps::Maps;
use serde::{Deserialize, Serialize};

use super::{Build, Capability, Dof, Extreme, RigError, Subject, SubjectSummary, capability};

/// Farther than any rig of this kind reaches, m: where a search along a direction ends.
pub const FARTHEST_M: f64 = 3.0;
/// Directions of a section.
const DIRECTIONS: u32 = 180;
/// Largest factor that is tried for the half-widths of the docking workspace.
const MOST_GROWTH: f64 = 5.0;

/// Reach of a rig.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Workspace {
    /// The answer in figures.
    pub summary: WorkspaceSummary,
    /// The box of relative poses `X_34` that docking needs.
    pub docking_workspace: DockingWorkspace,
    /// Every leg: what it has, and what the docking workspace uses of it.
    pub legs: [LegRange; 6],
    /// Largest speed of a rod, m/s: from the rig file.
    pub speed_limit_m_s: f64,
    /// Reach at the 729 places of the grid of the docking workspace: middle, corners, and the middles
    /// of edges and faces.
    pub places: Vec<PlaceReach>,
    /// Reach of the port in the planes Y-X and Y-Z of `e3` through the middle.
    pub sections: [Section; 2],
}

/// Reach of a rig in figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorkspaceSummary {
    /// The rig.
    pub subject: SubjectSummary,
    /// Whether every place of the docking workspace is in reach, with no singular pose near.
    pub fits: bool,
    /// Factor of all six half-widths of the docking workspace up to which it is in reach, 0 to 5.
    pub growth: f64,
    /// Least distance of a leg from an end of its stroke, m; negative out of reach.
    pub stroke_margin_m: Extreme,
    /// Least angle of a universal or spherical joint from its limit, rad; negative out of reach.
    pub joint_margin_rad: Extreme,
    /// Shortest and longest leg over the docking workspace, from joint to joint, m.
    pub lengths_m: [f64; 2],
    /// Stroke that the docking workspace needs of a leg, m: the largest over the legs.
    pub stroke_needed_m: f64,
    /// Speed of the fastest leg when the mechanisms move as fast as the paper asks for (§3.1), with the
    /// worst combination of signs, m/s.
    pub fastest_leg_m_s: Extreme,
    /// Least singular value of the Jacobian, moments over the radius of the plate joints; 0 is a
    /// singular pose.
    pub least_singular_value: Extreme,
    /// The same in the middle.
    pub least_singular_value_in_the_middle: f64,
    /// What the rig can do.
    #[serde(flatten)]
    pub capability: Capability,
}

/// Lengths of a leg from joint to joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LegRange {
    /// Shortest length that the leg has, m.
    pub shortest_m: f64,
    /// Longest length that the leg has, m.
    pub longest_m: f64,
    /// Shortest and longest length over the docking workspace, m.
    pub used_m: [f64; 2],
}

/// Reach at one place of the docking workspace.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlaceReach {
    /// The place.
    pub place: Place,
    /// Length of every leg from joint to joint, m.
    pub lengths_m: [f64; 6],
    /// Least distance of a leg from an end of its stroke, m; negative out of reach.
    pub stroke_margin_m: f64,
    /// The leg with that distance, 0 to 5.
    pub tightest_leg: usize,
    /// Least angle of a joint from its limit, rad; negative out of reach.
    pub joint_margin_rad: f64,
    /// Least singular value of the Jacobian, moments over the radius of the plate joints.
    pub least_singular_value: f64,
}

/// Reach in one plane: how far the port goes from the middle in 180 directions. The first point stands
/// again at the end, so the outlines are closed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Section {
    /// Horizontal and vertical axis of the plane, in `e3`; displacements.
    pub axes: [Dof; 2],
    /// Outline in the attitude of the middle: horizontal and vertical displacement from the middle, m.
    pub in_middle_attitude_m: Vec<[f64; 2]>,
    /// Outline of what is reached in each of the eight attitudes at the corners of the docking
    /// workspace, m.
    pub in_every_attitude_m: Vec<[f64; 2]>,
}

impl Section {
    fn new(maps: &Maps<'_>, rig: &Rig, axes: [Dof; 2]) -> Self {
        let attitudes: Vec<DQuat> = DockingWorkspace::corners()
            // One of the eight corners of position, with all attitudes.
            .filter(|p| p.0[..3].iter().all(|x| *x > 0.0))
            .map(|p| rig.docking.pose(p.0).q)
            .collect();
        let [a, b] = axes.map(|dof| DVec3::AXES[dof.index()]);
        let outline = |attitudes: &[DQuat]| -> Vec<[f64; 2]> {
            (0..=DIRECTIONS)
                .map(|n| {
                    let (s, c) =
                        (f64::from(n % DIRECTIONS) / f64::from(DIRECTIONS) * TAU).sin_cos();
                    let way = a * c + b * s;
                    let far = attitudes
                        .iter()
                        .fold(FARTHEST_M, |far, q| far.min(maps.reach_turned(way, *q, FARTHEST_M)));
                    [c * far, s * far]
                })
                .collect()
        };
        Self {
            axes,
            in_middle_attitude_m: outline(&[DQuat::IDENTITY]),
            in_every_attitude_m: outline(&attitudes),
        }
    }
}

/// Reach of a rig: whether its docking workspace fits, with what margins, and what the rig can do.
///
/// # Errors
/// [`RigError::Singular`].
pub fn workspace(rig: &Rig, build: &Build) -> Result<Workspace, RigError> {
    let subject = Subject::new(rig, build);
    let rig = &subject.rig;
    let maps = Maps::new(rig);
    let capability = capability::of(&maps, rig)?;
    let w = maps.workspace();
    let growth = maps.growth(MOST_GROWTH);
    let places = DockingWorkspace::grid().map(|place| {
        let r = maps.reach(&rig.plate_from_docking(&rig.docking.pose(place.0)));
        PlaceReach {
            place,
            lengths_m: r.lengths_m,
            stroke_margin_m: r.stroke_margin_m,
            tightest_leg: r.leg,
            joint_margin_rad: r.joint_margin_rad,
            least_singular_value: r.singularity,
        }
    });
    Ok(Workspace {
        docking_workspace: rig.docking,
        legs: core::array::from_fn(|i| LegRange {
            shortest_m: rig.legs[i].shortest_m,
            longest_m: rig.legs[i].longest_m,
            used_m: w.legs_m[i],
        }),
        speed_limit_m_s: rig.limits.speed_m_s,
        places: places.collect(),
        sections: [[Dof::Y, Dof::X], [Dof::Y, Dof::Z]].map(|axes| Section::new(&maps, rig, axes)),
        summary: WorkspaceSummary {
            subject: subject.summary(),
            fits: w.stroke_margin_m.0 >= 0.0 && w.joint_margin_rad.0 >= 0.0 && growth >= 1.0,
            growth,
            stroke_margin_m: w.stroke_margin_m.into(),
            joint_margin_rad: w.joint_margin_rad.into(),
            lengths_m: w.lengths_m,
            stroke_needed_m: w.stroke_m,
            fastest_leg_m_s: w.fastest_leg_m_s.into(),
            least_singular_value: w.singularity.into(),
            least_singular_value_in_the_middle: w.singularity_in_the_middle,
            capability,
        },
    })
}

/// The rig at one moment of [`corner_tour`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TourFrame {
    /// Time from the beginning of the tour.
    pub time: SimTime,
    /// The plate in the ground, `X_bp`.
    pub plate: Pose,
    /// Forces of the legs that hold the plate still there, N, positive when a leg pushes; `None` in a
    /// singular pose.
    pub leg_forces_n: Option<[f64; 6]>,
}

/// Frames from corner to corner.
const TOUR_FRAMES: u32 = 20;
/// Time between two frames, ns.
const TOUR_STEP_NS: u64 = 50_000_000;

/// A tour from the middle through all 64 corners of the docking workspace, along one coordinate after
/// the other, 20 frames a s, held still in every pose: for whoever shows the rig.
#[must_use]
pub fn corner_tour(rig: &Rig) -> Vec<TourFrame> {
    let mut stops = vec![[0.0; 6]];
    // Neighbours in Gray's code differ in one coordinate.
    stops.extend((0..64_u32).map(|n| {
        let code = n ^ (n >> 1);
        core::array::from_fn(|i| if code >> i & 1 == 1 { 1.0 } else { -1.0 })
    }));
    let maps = Maps::new(rig);
    let platform = maps.platform();
    let still = Twist::default();
    let mut time = SimTime::ZERO;
    let mut frames = Vec::new();
    for pair in stops.windows(2) {
        for k in 1..=TOUR_FRAMES {
            let t = f64::from(k) / f64::from(TOUR_FRAMES);
            let smooth = t * t * (3.0 - 2.0 * t);
            let place = core::array::from_fn(|i| pair[0][i] + (pair[1][i] - pair[0][i]) * smooth);
            let plate = rig.plate_from_docking(&rig.docking.pose(place));
            let legs = platform.at(&plate);
            let leg_forces_n = platform.inverse_dynamics(&legs, &still, &still, &Wrench::ZERO);
            frames.push(TourFrame { time, plate, leg_forces_n });
            time = SimTime::from_nanos(time.nanos() + TOUR_STEP_NS);
        }
    }
    frames
}

#[cfg(test)]
mod tests {
    use super::{super::tests::shipped, *};

    #[test]
    fn oracle_figures_are_those_of_the_places_and_sections() {
        let rig = shipped();
        let found = workspace(&rig, &Build::default()).expect("a regular rig");
        let s = &found.summary;
        assert_eq!(found.places.len(), 729);
        let least = |of: fn(&PlaceReach) -> f64| {
            found.places.iter().map(of).fold(f64::INFINITY, f64::min).to_bits()
        };
        assert_eq!(least(|p| p.stroke_margin_m), s.stroke_margin_m.value.to_bits());
        assert_eq!(least(|p| p.joint_margin_rad), s.joint_margin_rad.value.to_bits());
        assert_eq!(least(|p| p.least_singular_value), s.least_singular_value.value.to_bits());
        let at = found.places.iter().find(|p| p.place == s.stroke_margin_m.at).expect("a place");
        assert_eq!(at.stroke_margin_m.to_bits(), s.stroke_margin_m.value.to_bits());
        // By hand: joints at radii 4 and 2 m, 8 degrees beside the corners of triangles turned by 60
        // degrees, 3 m apart; in the middle all legs are alike.
        let length = (9.0 + 16.0 + 4.0 - 16.0 * 44f64.to_radians().cos()).sqrt();
        let middle = found.places.iter().find(|p| p.place == super::super::MIDDLE).expect("it");
        assert!(middle.lengths_m.iter().all(|l| (l - length).abs() < 1e-9), "{middle:?}");
        // Outlines are closed, and turning the plate never makes its reach larger than untilted.
        for section in &found.sections {
            for outline in [&section.in_middle_attitude_m, &section.in_every_attitude_m] {
                assert_eq!((outline.len(), outline[0]), (181, outline[180]));
            }
        }
        assert!(s.fits && s.growth > 1.0 && s.growth < MOST_GROWTH);
    }

    #[test]
    fn oracle_a_box_that_is_too_large_does_not_fit() {
        let mut rig = shipped();
        rig.docking.axial_m *= 4.0;
        let found = workspace(&rig, &Build::default()).expect("a regular rig").summary;
        assert!(!found.fits && found.growth < 1.0 && found.stroke_margin_m.value < 0.0);
    }

    #[test]
    fn oracle_the_tour_passes_every_corner_once_and_holds_the_plate() {
        let mut rig = shipped();
        let tour = corner_tour(&rig);
        assert_eq!(tour.len(), 64 * 20);
        for corner in DockingWorkspace::corners() {
            let plate = rig.plate_from_docking(&rig.docking.pose(corner.0));
            let near = |f: &&TourFrame| {
                f.plate.p.distance(plate.p) < 1e-12 && f.plate.q.dot(plate.q).abs() > 1.0 - 1e-12
            };
            assert_eq!(tour.iter().filter(near).count(), 1, "{corner}");
        }
        // Legs without mass carry the plate's weight along the vertical, and nothing else.
        for leg in &mut rig.legs {
            leg.cross_mass_kg = 0.0;
            (leg.cylinder.mass_kg, leg.rod.mass_kg) = (0.0, 0.0);
        }
        let up = -rig.gravity_m_s2.normalize();
        for frame in corner_tour(&rig).iter().step_by(7) {
            let forces = frame.leg_forces_n.expect("a regular pose");
            let along = |leg: &docktwin_model::Leg| leg.vector(&frame.plate).normalize().dot(up);
            let carried: f64 = rig.legs.iter().zip(forces).map(|(leg, f)| f * along(leg)).sum();
            let weight = rig.plate.mass_kg * rig.gravity_m_s2.length();
            assert!((carried / weight - 1.0).abs() < 1e-9, "{carried} N of {weight} N");
        }
        assert_eq!(tour[20].time, SimTime::from_nanos(1_000_000_000));
    }

    #[test]
    fn invariant_the_result_survives_json() {
        let build = Build { seed: Some(7), ..Build::default() };
        let found = workspace(&shipped(), &build).expect("a regular rig");
        let text = serde_json::to_string(&found).expect("JSON");
        assert_eq!(serde_json::from_str::<Workspace>(&text).expect("JSON"), found);
        let frame = corner_tour(&shipped())[3];
        let text = serde_json::to_string(&frame).expect("JSON");
        assert_eq!(serde_json::from_str::<TourFrame>(&text).expect("JSON"), frame);
    }
}
