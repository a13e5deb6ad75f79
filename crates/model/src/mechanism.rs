use docktwin_core::{DMat3, DVec3, Digest};
use serde::{Deserialize, Serialize};

use crate::surface::{CapturedWhen, Latch, Surface};

/// Both sides of a docking mechanism and the laws between them.
///
/// Frames: the active side hangs on `e3`, the passive one is fixed to `e4`. Each side has a *ring
/// frame* at its ring centre whose +X points toward the other side: `r3` (active, axes parallel to
/// `e3` at rest, origin at `p_34`-axis offset `ring_rest_offset_m`) and `r4` (passive: `e4` turned
/// by 180° about Z, so +X points along −X4; origin at `−passive_ring_offset_m` on X4).
/// Azimuth α of a ring frame is measured from +Y toward +Z: the point at radius ρ is
/// `(x, ρ cos α, ρ sin α)`.
#[derive(Clone, Debug, PartialEq)]
pub struct DockingMechanism {
    /// Name, from the URDF of the active side.
    pub name: String,
    /// Ring and petals of the active side, in `r3`.
    pub active: SideGeometry,
    /// Ring and petals of the passive side, in `r4`.
    pub passive: SideGeometry,
    /// Mass properties of the active ring with its petals and latches.
    pub ring_body: RingBody,
    /// Distance along +X3 from the origin of `e3` to the active ring's centre at rest, m.
    pub ring_rest_offset_m: f64,
    /// Distance along −X4 from the origin of `e4` to the passive ring's centre, m.
    pub passive_ring_offset_m: f64,
    /// Law of contact between the sides.
    pub contact: ContactLaw,
    /// What carries the active ring.
    pub attenuator: Attenuator,
    /// Three capture latches around the rings; `None` without them.
    pub latches: Option<LatchSet>,
    /// Latches with places and zones of their own, instead of `latches`; empty without them.
    pub own_latches: Vec<Latch>,
    /// Which of `own_latches` make a capture.
    pub captured_when: CapturedWhen,
    /// Spring stick in a frame instead of rings and petals, whose surfaces then do not touch;
    /// `None` for docking mechanisms.
    pub stick: Option<Stick>,
    /// Limits that end a run as `limit_exceeded`.
    pub limits: MechanismLimits,
    /// Thresholds of the outcomes.
    pub outcome: OutcomeRules,
    /// How far a mechanism as built may differ from these files; `None` where they do not say.
    pub spread: Option<MechanismSpread>,
    /// How far parts stand off the places above: nothing as read, drawn for a mechanism as built.
    pub offsets: PartOffsets,
    /// Digest of every file this was read from.
    pub digest: Digest,
}

/// Half-widths within which a mechanism as built is drawn away from its files, each uniformly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MechanismSpread {
    /// Of the contact stiffness, relative.
    pub contact_stiffness: f64,
    /// Of both friction coefficients of the contact together, relative.
    pub friction: f64,
    /// Of the flexural rigidity of the petals, each side by itself, relative.
    pub petal_rigidity: f64,
    /// Of the forces of the attenuator's curves, each channel by itself, relative.
    pub attenuator_curves: f64,
    /// Of the holding force of every series brake, relative.
    pub brake: f64,
    /// Of mass and inertia of the active ring together, relative.
    pub ring_mass: f64,
    /// Of the places of petals, latches and mounts along each axis, well aligned, m.
    pub position_fine_m: f64,
    /// The same, coarsely aligned, m.
    pub position_coarse_m: f64,
}

/// How far parts stand off the places that the files give them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PartOffsets {
    /// Of every petal of the active side, each along X of its ring frame, radially outward and along the ring
    /// (toward growing azimuth), m; none where it is shorter than the petals are many.
    pub active_petals_m: Vec<DVec3>,
    /// The same of the passive side.
    pub passive_petals_m: Vec<DVec3>,
    /// Of every latch against its striker, in the same axes of `r3`, m.
    pub latches_m: [DVec3; 3],
}

impl DockingMechanism {
    /// `L`: distance between the mounting planes when docked (rings face to face, ring at rest), m.
    #[must_use]
    pub fn docked_length_m(&self) -> f64 {
        self.ring_rest_offset_m
            + self.active.ring.section_radius_m
            + self.passive.ring.section_radius_m
            + self.passive_ring_offset_m
    }

    /// Number of latches.
    #[must_use]
    pub fn latch_count(&self) -> usize {
        if self.latches.is_some() { 3 } else { self.own_latches.len() }
    }
}

/// One side's guiding surfaces, in its ring frame.
#[derive(Clone, Debug, PartialEq)]
pub struct SideGeometry {
    /// The ring: a torus about the X axis, its centre circle in the plane x = 0.
    pub ring: RingGeometry,
    /// Whether the ring is there to be touched. Without it only its radius counts, the section being 0.
    pub has_ring: bool,
    /// Petals, alike, evenly spread; may be `None` (bare ring).
    pub petals: Option<PetalGeometry>,
    /// Surfaces beside ring and petals.
    pub surfaces: Vec<Surface>,
}

/// A torus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RingGeometry {
    /// Radius of the centre circle, m.
    pub mean_radius_m: f64,
    /// Radius of the section, m.
    pub section_radius_m: f64,
    /// Straight pieces by which meshes and engines without a torus approximate the ring; our own
    /// contact law uses the exact circle.
    pub segments: u32,
}

/// `count` alike petals. The mid-surface of one is ruled by straight lines between an arc at the
/// base (radius `base_radius_m`, x = 0) and an arc at the tip (radius `tip_radius_m`,
/// x = `height_m`), the ruling at −1 ≤ u ≤ 1 going from azimuth `u · base_half_angle` to
/// `u · tip_half_angle` off the petal's own azimuth; swept by a ball of half the thickness.
/// Inward petals have `tip_radius_m < base_radius_m`, outward ones the reverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PetalGeometry {
    /// Number of petals.
    pub count: u32,
    /// Azimuth of the middle of petal 0, rad.
    pub first_azimuth_rad: f64,
    /// Radius of the mid-surface at the base, m.
    pub base_radius_m: f64,
    /// Radius of the mid-surface at the tip, m.
    pub tip_radius_m: f64,
    /// Height of the mid-surface, m.
    pub height_m: f64,
    /// Half-angle at the base, rad.
    pub base_half_angle_rad: f64,
    /// Half-angle at the tip, rad.
    pub tip_half_angle_rad: f64,
    /// Thickness, m; edges are rounded with half of it.
    pub thickness_m: f64,
    /// Strips into which the petal is divided, for meshes, for engines of convex pieces, and as
    /// the first guess of our own search.
    pub strips: u32,
    /// Flexural rigidity EI of the petal as a cantilever, N·m²; smaller makes the tip softer.
    pub flexural_rigidity_n_m2: f64,
}

impl PetalGeometry {
    /// Azimuth of the middle of petal `i`, rad.
    #[must_use]
    pub fn azimuth_rad(&self, i: u32) -> f64 {
        self.first_azimuth_rad + f64::from(i) * core::f64::consts::TAU / f64::from(self.count)
    }

    /// Ends (base, tip) of the ruling `u` of petal `i`, in the ring frame, m.
    #[must_use]
    pub fn ruling(&self, i: u32, u: f64) -> [DVec3; 2] {
        let a = self.azimuth_rad(i);
        let at = |x: f64, r: f64, half: f64| {
            let (s, c) = (a + u * half).sin_cos();
            DVec3::new(x, r * c, r * s)
        };
        [
            at(0.0, self.base_radius_m, self.base_half_angle_rad),
            at(self.height_m, self.tip_radius_m, self.tip_half_angle_rad),
        ]
    }
}

/// The active ring as a rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RingBody {
    /// Mass with petals and latches, kg.
    pub mass_kg: f64,
    /// Inertia about its own mass centre, axes of `r3`, kg·m².
    pub inertia_kg_m2: DMat3,
    /// Mass centre in `r3`, m.
    pub com_m: DVec3,
}

/// Law of contact between one pair of surfaces at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactLaw {
    /// Normal law.
    pub normal: NormalLaw,
    /// Kinetic friction coefficient; 0 switches friction off.
    pub friction_kinetic: f64,
    /// Static friction coefficient, ≥ kinetic.
    pub friction_static: f64,
    /// Stribeck velocity, m/s: how fast the static coefficient fades with sliding speed.
    pub stribeck_velocity_m_s: f64,
    /// Break-away displacement of the bristle, m; smaller is nearer to ideal Coulomb friction.
    pub bristle_breakaway_m: f64,
    /// Time constant of the bristle's own damping while it sticks, s.
    pub bristle_damping_s: f64,
    /// Width of the smooth extremes where two rings lie flat on each other, m: depths that differ by more are
    /// not changed by it.
    pub merge_depth_m: f64,
}

impl ContactLaw {
    /// k, N/mⁿ.
    #[must_use]
    pub const fn stiffness(&self) -> f64 {
        match self.normal {
            NormalLaw::HuntCrossley { stiffness, .. }
            | NormalLaw::KelvinVoigt { stiffness, .. } => stiffness,
        }
    }

    /// Exponent n of the normal force `k δⁿ`; 1 of a linear law.
    #[must_use]
    pub const fn exponent(&self) -> f64 {
        match self.normal {
            NormalLaw::HuntCrossley { exponent, .. } => exponent,
            NormalLaw::KelvinVoigt { .. } => 1.0,
        }
    }

    /// The same law with another stiffness and friction, sticking friction included.
    #[must_use]
    pub const fn of_pair(&self, k: f64, friction: f64) -> Self {
        let normal = match self.normal {
            NormalLaw::HuntCrossley { exponent, damping_s_m, .. } => {
                NormalLaw::HuntCrossley { stiffness: k, exponent, damping_s_m }
            }
            NormalLaw::KelvinVoigt { damping_n_s_m, .. } => {
                NormalLaw::KelvinVoigt { stiffness: k, damping_n_s_m }
            }
        };
        Self { normal, friction_kinetic: friction, friction_static: friction, ..*self }
    }
}

/// Normal force of one place, clipped at ≥ 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NormalLaw {
    /// `F = k δⁿ (1 + a δ')`.
    HuntCrossley {
        /// k, N/mⁿ.
        stiffness: f64,
        /// n.
        exponent: f64,
        /// a, s/m.
        damping_s_m: f64,
    },
    /// `F = k δ + c δ'`, the validation law.
    KelvinVoigt {
        /// k, N/m.
        stiffness: f64,
        /// c, N·s/m.
        damping_n_s_m: f64,
    },
}

/// What carries the active ring.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one per model, and it is never moved about"
)]
pub enum Attenuator {
    /// The ring is part of the chaser (tests of the law on rings alone).
    Rigid,
    /// Six tables, one per axis.
    Characteristic(CharacteristicAttenuator),
    /// Six screw legs coupled through differentials.
    Differential(DifferentialAttenuator),
}

/// Which attenuator carries the active ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AttenuationChoice {
    /// Six tables, one per axis.
    Characteristic,
    /// Six coupled screw legs.
    Differential,
    /// None: the ring is part of the chaser.
    Rigid,
}

impl AttenuationChoice {
    /// Words by which files name the choices.
    pub const WORDS: [(&'static str, Self); 3] = [
        ("characteristic", Self::Characteristic),
        ("differential", Self::Differential),
        ("rigid", Self::Rigid),
    ];
}

/// Per-axis characteristic of the attenuation (Fig. 6–9): X; Y/Z; pitch/yaw; roll.
#[derive(Clone, Debug, PartialEq)]
pub struct CharacteristicAttenuator {
    /// Axial, N over m; positive deflection is extension (+X3).
    pub axial: AxisChannel,
    /// Lateral, N over m; isotropic in Y and Z.
    pub lateral: AxisChannel,
    /// Pitch and yaw, N·m over rad; isotropic.
    pub tilt: AxisChannel,
    /// Roll, N·m over rad.
    pub roll: AxisChannel,
    /// Time over which damping goes from its value before capture to that after, s.
    pub damping_ramp_s: f64,
}

/// One channel. Units are N, m, N·s/m for translations and N·m, rad, N·m·s/rad for rotations.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisChannel {
    /// Force of the loading branch over deflection ≥ 0, from (0, F0 ≥ 0), rising.
    pub loading: PiecewiseCurve,
    /// Force of the unloading branch, nowhere above the loading one. The mean of both is stored,
    /// half their difference is dissipated.
    pub unloading: PiecewiseCurve,
    /// Displacement over which the force goes from one branch to the other after a reversal.
    pub branch_change: f64,
    /// Viscous damping.
    pub damping: DampingPhases,
    /// Brake in series with the tables and the damping, if any.
    pub series_brake: Option<SeriesBrake>,
    /// Width of the play between the ring and tables, damping and brake; 0 for none. Dry friction and end
    /// stops act beside it. Channels of one coordinate alone have it: along X3, and those of differentials.
    pub backlash: f64,
    /// Dry friction beside everything else.
    pub dry_friction: f64,
    /// Travel in the negative direction (compression), ≥ 0.
    pub travel_negative: f64,
    /// Travel in the positive direction (extension), ≥ 0.
    pub travel_positive: f64,
    /// Stiffness of the end stops.
    pub stop_stiffness: f64,
    /// Damping of the end stops, acting in proportion to how far the stop is engaged.
    pub stop_damping: f64,
}

impl AxisChannel {
    /// Break-away displacement of dry friction, m or rad: within it friction is a spring.
    pub const DRY_BREAKAWAY: f64 = 2e-4;
}

/// Damping before and after capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DampingPhases {
    /// Until all latches have caught.
    pub before_capture: f64,
    /// Afterwards, reached over the ramp.
    pub after_capture: f64,
}

/// A friction brake in series: it slips above `force`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeriesBrake {
    /// Holding force, N (N·m).
    pub force: f64,
    /// Viscous part while it slips, N·s/m (N·m·s/rad).
    pub viscous: f64,
}

/// A curve through points of strictly rising abscissa, linear between them, extended with the last
/// slope.
#[derive(Clone, Debug, PartialEq)]
pub struct PiecewiseCurve {
    /// (deflection, force).
    pub points: Vec<[f64; 2]>,
}

/// Six screw legs between `e3` and the ring; brake coordinates are `coupling * (l − l_rest)`.
#[derive(Clone, Debug, PartialEq)]
pub struct DifferentialAttenuator {
    /// Leg joints on the chaser, in `e3`, m.
    pub base_joints_m: [DVec3; 6],
    /// Leg joints on the ring, in `r3`, m.
    pub ring_joints_m: [DVec3; 6],
    /// Rows: brake coordinates; columns: legs. Row 0 is the longitudinal coordinate.
    pub coupling: [[f64; 6]; 6],
    /// Channel of each brake coordinate (N over m of the coordinate).
    pub channels: [AxisChannel; 6],
    /// As in [`CharacteristicAttenuator`].
    pub damping_ramp_s: f64,
}

/// In whose axes the gaps of a latch are measured, and along whose X it pulls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LatchAxes {
    /// Of the active ring, `r3`.
    #[default]
    Active,
    /// Of the passive ring, turned so that they are those of `r3` when docked.
    Passive,
}

impl LatchAxes {
    /// Words by which files name them.
    pub const WORDS: [(&'static str, Self); 2] =
        [("active", Self::Active), ("passive", Self::Passive)];
}

/// Capture latches on the active ring and their strikers on the passive ring, at the same points
/// of the ring faces when docked.
#[derive(Clone, Debug, PartialEq)]
pub struct LatchSet {
    /// Azimuths on the active ring, in `r3`, rad.
    pub azimuths_rad: [f64; 3],
    /// In whose axes gaps are measured, and along whose X a latch pulls.
    pub axes: LatchAxes,
    /// A latch approaches (is logged) below this axial gap, m.
    pub approach_gap_m: f64,
    /// A latch is struck below this axial gap, inside the radial and tangential zone, m.
    pub strike_gap_m: f64,
    /// It catches at or below this axial gap, m.
    pub catch_gap_m: f64,
    /// So long the striker must have stayed within the catch gap and the zones before it catches, s.
    pub catch_delay_s: f64,
    /// Radial zone, ± m.
    pub radial_zone_m: f64,
    /// Tangential zone, ± m.
    pub tangential_zone_m: f64,
    /// Tension stiffness of a caught latch beyond the catch gap, N/m.
    pub hold_stiffness_n_m: f64,
    /// Stiffness of the joined rings, all three points together, N/m.
    pub joined_stiffness_n_m: f64,
    /// Damping of each joint point, N·s/m.
    pub joined_damping_n_s_m: f64,
}

/// The spring stick of the validation model in its frame (the paper, §7.4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stick {
    /// K of (14), N/m; larger is harder.
    pub stiffness_n_m: f64,
    /// Diameter d of the stick, m.
    pub diameter_m: f64,
    /// Opening h of the frame, m.
    pub frame_opening_m: f64,
    /// Lever r with which rotations count, m: stiffness `K r²`, play over `r`.
    pub lever_m: f64,
}

impl Stick {
    /// Free play to either side of the middle, `(h − d)/2`, m.
    #[must_use]
    pub fn play_m(&self) -> f64 {
        0.5 * (self.frame_opening_m - self.diameter_m)
    }

    /// (14): stiffness of a cantilever of Young's modulus `young_pa`, N/m.
    #[must_use]
    pub fn cantilever_n_m(young_pa: f64, diameter_m: f64, length_m: f64) -> f64 {
        3.0 * core::f64::consts::PI * young_pa * diameter_m.powi(4) / (64.0 * length_m.powi(3))
    }
}

/// Limits of the mechanism; passing one ends the run as `limit_exceeded`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MechanismLimits {
    /// Tension at the port, N.
    pub tension_n: f64,
    /// Compression at the port, N.
    pub compression_n: f64,
    /// Shear at the port, N.
    pub shear_n: f64,
    /// Torsion at the port, N·m.
    pub torsion_nm: f64,
    /// Bending at the port, N·m.
    pub bending_nm: f64,
    /// Contact depth, m; beyond it the geometry is no longer to be believed.
    pub depth_m: f64,
    /// How far an attenuator may be pushed beyond its travel, m (and rad × ring radius).
    pub overtravel_m: f64,
}

/// Thresholds by which a run is judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutcomeRules {
    /// Ring centres within this distance sideways at closest approach were in the guided zone, m.
    pub guided_radius_m: f64,
    /// Relative port speed below which attenuation has ended, m/s.
    pub settled_speed_m_s: f64,
    /// Relative port rate below which attenuation has ended, rad/s.
    pub settled_rate_rad_s: f64,
    /// Time with one or two latches, or in slow contact, after which it is jammed, s.
    pub jam_time_s: f64,
}
