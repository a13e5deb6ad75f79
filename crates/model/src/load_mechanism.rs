use core::f64::consts::PI;
use std::path::Path;

use docktwin_core::{DMat3, DQuat, DVec3, Pose};

use crate::Sources;
use crate::keys::read::{self, Section};
use crate::keys::{FileKind, NORMAL_LAWS};
use crate::load_surfaces::{
    OwnLatches, check_gaps, check_pairs, place_surfaces, read_own_latches, read_surfaces,
};
use crate::problem::{Findings, Loaded, ModelErrors, Problem};
use crate::urdf::{self, UrdfTree};
use crate::{
    AttenuationChoice, Attenuator, AxisChannel, CharacteristicAttenuator, ContactLaw,
    DampingPhases, DifferentialAttenuator, DockingMechanism, LatchAxes, LatchSet, MechanismLimits,
    MechanismSpread, NormalLaw, OutcomeRules, PartOffsets, PetalGeometry, PiecewiseCurve, RingBody,
    RingGeometry, SeriesBrake, SideGeometry, Stick,
};

/// Reads both sides of a docking mechanism, each a URDF with a TOML of the same name beside it.
/// Without `attenuation` the default of the active side's file is taken.
///
/// # Errors
/// All problems of all four files, and those between the sides.
pub fn load_mechanism(
    active_urdf: &Path,
    passive_urdf: &Path,
    attenuation: Option<AttenuationChoice>,
) -> Result<Loaded<DockingMechanism>, ModelErrors> {
    load_mechanism_from(&Sources::disk(), active_urdf, passive_urdf, attenuation)
}

/// As [`load_mechanism`], from files in memory too.
///
/// # Errors
/// All problems of all four files, and those between the sides.
pub fn load_mechanism_from(
    sources: &Sources,
    active_urdf: &Path,
    passive_urdf: &Path,
    attenuation: Option<AttenuationChoice>,
) -> Result<Loaded<DockingMechanism>, ModelErrors> {
    let mut out = Findings::from(sources);
    let active = read_active(active_urdf, true, &mut out);
    let passive = read_passive(passive_urdf, true, &mut out);
    let model = active.zip(passive).and_then(|(a, p)| join(a, p, attenuation, &mut out));
    let flags = core::mem::take(&mut out.flags);
    out.notes.extend(flags);
    out.finish(model)
}

/// Reads another active side for a mechanism whose passive side stands: what a rig may carry instead of the
/// mechanism of a scenario. Meshes that its URDF names are not looked at.
///
/// # Errors
/// All problems of both files, and those between the sides.
pub fn load_other_active_from(
    sources: &Sources,
    active_urdf: &Path,
    of: &DockingMechanism,
) -> Result<Loaded<DockingMechanism>, ModelErrors> {
    let mut out = Findings::from(sources);
    let active = read_active(&active_urdf.with_extension("urdf"), false, &mut out);
    let passive = PassiveSide {
        name: of.name.clone(),
        geometry: of.passive.clone(),
        toml: active_urdf.with_extension("toml"),
        clean: true,
        ring_offset_m: of.passive_ring_offset_m,
    };
    let model = active.and_then(|a| join(a, passive, None, &mut out));
    out.finish(model)
}

/// The active side as read, with every attenuator of its file.
#[derive(Clone, Debug)]
pub(crate) struct ActiveSide {
    pub(crate) name: String,
    pub(crate) geometry: SideGeometry,
    pub(crate) toml: std::path::PathBuf,
    /// Whether every parameter was read well; otherwise placeholders are among them.
    clean: bool,
    ring_body: RingBody,
    ring_rest_offset_m: f64,
    contact: ContactLaw,
    default_choice: AttenuationChoice,
    characteristic: Option<CharacteristicAttenuator>,
    differential: Option<DifferentialAttenuator>,
    latches: Option<LatchSet>,
    own_latches: OwnLatches,
    stick: Option<Stick>,
    limits: MechanismLimits,
    outcome: OutcomeRules,
    spread: Option<MechanismSpread>,
}

/// The passive side as read.
#[derive(Clone, Debug)]
pub(crate) struct PassiveSide {
    pub(crate) name: String,
    pub(crate) geometry: SideGeometry,
    pub(crate) toml: std::path::PathBuf,
    /// As for the active side.
    clean: bool,
    ring_offset_m: f64,
}

pub(crate) fn read_active(
    urdf_path: &Path,
    meshes: bool,
    out: &mut Findings,
) -> Option<ActiveSide> {
    let (toml, tree, text) = open(urdf_path, "active side", meshes, out);
    let text = text?;
    let checker = FileKind::MechanismActive.checker(&toml, &text);
    let side = read::read(&checker, FileKind::MechanismActive, |t| {
        let (ring_rest_offset_m, radius) =
            t.section("placement", |p| (p.number("ring_rest_offset_m"), reference_radius(t, p)));
        let geometry = read_geometry(t, radius);
        let ring_body = t.section("ring_body", read_ring_body);
        let contact = t.section("contact", read_contact);
        let (default_choice, characteristic, differential) =
            t.section("attenuation", |a| read_attenuation(a, ring_rest_offset_m));
        let latches = t.optional_section("latches", read_latches);
        let own_latches = read_own_latches(t);
        let stick = t.optional_section("stick", read_stick);
        let limits = t.section("limits", read_limits);
        let outcome = t.section("outcome", |o| OutcomeRules {
            guided_radius_m: o.number("guided_radius_m"),
            settled_speed_m_s: o.number("settled_speed_m_s"),
            settled_rate_rad_s: o.number("settled_rate_deg_s").to_radians(),
            jam_time_s: o.number("jam_time_s"),
        });
        let spread = t.optional_section("spread", read_spread);
        ActiveSide {
            name: String::new(),
            geometry,
            toml: toml.clone(),
            clean: false,
            ring_body,
            ring_rest_offset_m,
            contact,
            default_choice,
            characteristic,
            differential,
            latches,
            own_latches,
            stick,
            limits,
            outcome,
            spread,
        }
    });
    let clean = checker.is_clean();
    let (problems, values) = checker.finish();
    out.problems.extend(problems);
    out.values.extend(values);
    let (tree, mut side) = (tree?, side?);
    side.name.clone_from(&tree.robot.name);
    side.clean = clean;
    // Placements are compared only with parameters that were read well.
    if clean {
        let ring = Pose::from_translation(DVec3::X * side.ring_rest_offset_m);
        let expect = Placements { urdf_path, toml: &toml, tree: &tree };
        expect.check(ring, "placement.ring_rest_offset_m", "floating", &side.geometry, out);
        expect.check_ring_body(&side.ring_body, out);
        place_surfaces(&mut side.geometry, &tree, &toml, true, out);
    }
    Some(side)
}

pub(crate) fn read_passive(
    urdf_path: &Path,
    meshes: bool,
    out: &mut Findings,
) -> Option<PassiveSide> {
    let (toml, tree, text) = open(urdf_path, "passive side", meshes, out);
    let text = text?;
    let checker = FileKind::MechanismPassive.checker(&toml, &text);
    let side = read::read(&checker, FileKind::MechanismPassive, |t| {
        let (ring_offset_m, radius) =
            t.section("placement", |p| (p.number("passive_ring_offset_m"), reference_radius(t, p)));
        let geometry = read_geometry(t, radius);
        PassiveSide {
            name: String::new(),
            geometry,
            toml: toml.clone(),
            clean: false,
            ring_offset_m,
        }
    });
    let clean = checker.is_clean();
    let (problems, values) = checker.finish();
    out.problems.extend(problems);
    out.values.extend(values);
    let (tree, mut side) = (tree?, side?);
    side.name.clone_from(&tree.robot.name);
    side.clean = clean;
    if clean {
        // r4: e4 turned by 180° about Z.
        let ring = Pose::new(-DVec3::X * side.ring_offset_m, DQuat::from_rotation_z(PI));
        let expect = Placements { urdf_path, toml: &toml, tree: &tree };
        expect.check(ring, "placement.passive_ring_offset_m", "fixed", &side.geometry, out);
        place_surfaces(&mut side.geometry, &tree, &toml, false, out);
        for link in &tree.with_inertial {
            out.notes.push(crate::Note {
                file: urdf_path.into(),
                line: tree.line("link", link),
                what: format!(
                    "inertial of link `{link}` is ignored: the passive side is part of the target"
                ),
                flagged: false,
            });
        }
    }
    Some(side)
}

fn open(
    urdf_path: &Path,
    side: &str,
    meshes: bool,
    out: &mut Findings,
) -> (std::path::PathBuf, Option<UrdfTree>, Option<String>) {
    let urdf_text = out.read(urdf_path, &format!("URDF of the {side}"));
    let toml = urdf_path.with_extension("toml");
    let toml_text = out.read(&toml, &format!("TOML of the {side}"));
    let tree = urdf_text.and_then(|text| urdf::read(urdf_path, &text, meshes, out));
    (toml, tree, toml_text)
}

// Sections of the TOML -------------------------------------------------------------------------

/// Radius that stands for a ring that is not there; 0 where one is.
fn reference_radius(file: Section<'_, '_, '_>, placement: Section<'_, '_, '_>) -> f64 {
    if file.has("ring") { 0.0 } else { placement.number("reference_radius_m") }
}

fn read_ring(r: Section<'_, '_, '_>) -> RingGeometry {
    let ring = RingGeometry {
        mean_radius_m: r.number("mean_radius_m"),
        section_radius_m: r.number("section_radius_m"),
        segments: r.count("segments"),
    };
    if ring.section_radius_m >= ring.mean_radius_m {
        r.refuse(
            "section_radius_m",
            format!("is not below the mean radius, {} m", ring.mean_radius_m),
            "make the section thinner than the ring",
        );
    }
    ring
}

fn read_geometry(t: Section<'_, '_, '_>, reference_radius_m: f64) -> SideGeometry {
    let ring = t.optional_section("ring", read_ring);
    let has_ring = ring.is_some();
    let ring = ring.unwrap_or(RingGeometry {
        mean_radius_m: reference_radius_m,
        section_radius_m: 0.0,
        segments: 8,
    });
    if !has_ring && t.has("petals") {
        t.refuse(
            "petals",
            "stand on a ring, and this side has none",
            "add [ring], or take [petals] out",
        );
    }
    let petals = t.optional_section("petals", |p| {
        let petals = PetalGeometry {
            count: p.count("count"),
            first_azimuth_rad: p.number("first_azimuth_deg").to_radians(),
            base_radius_m: p.number("base_radius_m"),
            tip_radius_m: p.number("tip_radius_m"),
            height_m: p.number("height_m"),
            base_half_angle_rad: p.number("base_half_angle_deg").to_radians(),
            tip_half_angle_rad: p.number("tip_half_angle_deg").to_radians(),
            thickness_m: p.number("thickness_m"),
            strips: p.count("strips"),
            flexural_rigidity_n_m2: p.number("flexural_rigidity_n_m2"),
        };
        let widest = petals.base_half_angle_rad.max(petals.tip_half_angle_rad);
        let room = PI / f64::from(petals.count);
        if widest >= room {
            p.refuse(
                "base_half_angle_deg",
                format!(
                    "neighbouring petals of this side overlap: the wider half-angle is {:.1}° and \
                     must stay below 180°/count = {:.1}°",
                    widest.to_degrees(),
                    room.to_degrees()
                ),
                "make the half-angles smaller",
            );
        }
        if petals.thickness_m >= petals.height_m {
            p.refuse(
                "thickness_m",
                format!("is not below the height, {} m", petals.height_m),
                "make the petal thinner",
            );
        }
        let off_ring = (petals.base_radius_m - ring.mean_radius_m).abs();
        if has_ring && off_ring > ring.section_radius_m + petals.thickness_m / 2.0 {
            p.refuse(
                "base_radius_m",
                format!("the petals float free of the ring of radius {} m", ring.mean_radius_m),
                "bring the base within the section of the ring",
            );
        }
        petals
    });
    let surfaces = read_surfaces(t);
    if !has_ring && !t.has("surface") {
        t.refuse(
            "ring",
            "is missing, and there is no [[surface]] either: nothing could touch",
            "add [ring] or a [[surface]]",
        );
    }
    SideGeometry { ring, has_ring, petals, surfaces }
}

fn read_stick(t: Section<'_, '_, '_>) -> Stick {
    let stick = Stick {
        stiffness_n_m: t.number("stiffness_n_m"),
        diameter_m: t.number("diameter_m"),
        frame_opening_m: t.number("frame_opening_m"),
        lever_m: t.number("lever_m"),
    };
    if stick.play_m() <= 0.0 {
        t.refuse(
            "frame_opening_m",
            format!("is not above the diameter of the stick, {} m", stick.diameter_m),
            "make the opening wider than the stick",
        );
    }
    stick
}

fn read_ring_body(t: Section<'_, '_, '_>) -> RingBody {
    let mass_kg = t.number("mass_kg");
    let com_m = DVec3::from_array(t.list("com_m"));
    let rows = t.rows::<3>("inertia_kg_m2");
    let Ok(rows) = <[[f64; 3]; 3]>::try_from(rows) else {
        return RingBody { mass_kg, com_m, inertia_kg_m2: DMat3::NAN };
    };
    let m = DMat3::from_cols_array_2d(&rows);
    let asymmetry = (0..3).flat_map(|i| (0..3).map(move |j| (i, j)));
    if asymmetry.into_iter().any(|(i, j)| (rows[i][j] - rows[j][i]).abs() > 1e-12) {
        t.refuse("inertia_kg_m2", "is not symmetric", "make element ij equal to element ji");
    } else if m.is_finite() {
        let p = urdf::principal_moments(m);
        if p[0] <= 0.0 || p[0] + p[1] < p[2] * (1.0 - 1e-9) {
            t.refuse(
                "inertia_kg_m2",
                format!(
                    "is not that of any body: principal moments {} {} {} must be above 0 and each \
                     at most the sum of the others",
                    p[0], p[1], p[2]
                ),
                "change the tensor",
            );
        }
    }
    RingBody { mass_kg, inertia_kg_m2: m, com_m }
}

fn read_contact(t: Section<'_, '_, '_>) -> ContactLaw {
    let hunt_crossley = t.choice("normal_law", &NORMAL_LAWS).unwrap_or(true);
    let stiffness = t.number("stiffness_n_m");
    let normal = if hunt_crossley {
        NormalLaw::HuntCrossley {
            stiffness,
            exponent: t.number("exponent"),
            damping_s_m: t.number("damping_s_m"),
        }
    } else {
        NormalLaw::KelvinVoigt { stiffness, damping_n_s_m: t.number("damping_n_s_m") }
    };
    let law = ContactLaw {
        normal,
        friction_kinetic: t.number("friction_kinetic"),
        friction_static: t.number("friction_static"),
        stribeck_velocity_m_s: t.number("stribeck_velocity_m_s"),
        bristle_breakaway_m: t.number("bristle_breakaway_m"),
        bristle_damping_s: t.number("bristle_damping_s"),
        merge_depth_m: t.number("merge_depth_m"),
    };
    if law.friction_static < law.friction_kinetic {
        t.refuse(
            "friction_static",
            format!("is below the kinetic coefficient, {}", law.friction_kinetic),
            "make it at least as large",
        );
    }
    law
}

type Attenuations =
    (AttenuationChoice, Option<CharacteristicAttenuator>, Option<DifferentialAttenuator>);

fn read_attenuation(t: Section<'_, '_, '_>, ring_rest_offset_m: f64) -> Attenuations {
    let default_choice =
        t.choice("default", &AttenuationChoice::WORDS).unwrap_or(AttenuationChoice::Rigid);
    let damped = t.has("characteristic") || t.has("differential");
    let damping_ramp_s =
        if damped || t.has("damping_ramp_s") { t.number("damping_ramp_s") } else { 0.0 };
    let characteristic = t.optional_section("characteristic", |c| CharacteristicAttenuator {
        axial: c.section("axial", |t| read_channel(t, &ChannelKeys::TRANSLATION)),
        lateral: c.section("lateral", |t| read_channel(t, &ChannelKeys::TRANSLATION)),
        tilt: c.section("tilt", |t| read_channel(t, &ChannelKeys::ROTATION)),
        roll: c.section("roll", |t| read_channel(t, &ChannelKeys::ROTATION)),
        damping_ramp_s,
    });
    let differential = t
        .optional_section("differential", |d| {
            read_differential(d, ring_rest_offset_m, damping_ramp_s)
        })
        .flatten();
    let missing = match default_choice {
        AttenuationChoice::Characteristic => !t.has("characteristic"),
        AttenuationChoice::Differential => !t.has("differential"),
        AttenuationChoice::Rigid => false,
    };
    if missing {
        t.refuse(
            "default",
            "is not described in this file",
            "add the table [attenuation.<choice>] or name another default",
        );
    }
    (default_choice, characteristic, differential)
}

/// Keys of a channel as files name them: the same in metres and newtons, or in degrees, radians and newton
/// metres.
#[derive(Clone, Copy, Debug)]
pub struct ChannelKeys {
    backlash: Option<&'static str>,
    /// Of [`AxisChannel::loading`], N over m or N·m over rad.
    pub loading: &'static str,
    /// Of [`AxisChannel::unloading`], N over m or N·m over rad.
    pub unloading: &'static str,
    branch_change: &'static str,
    /// Of [`DampingPhases::before_capture`], N·s/m or N·m·s/rad.
    pub before: &'static str,
    /// Of [`DampingPhases::after_capture`], N·s/m or N·m·s/rad.
    pub after: &'static str,
    brake_force: &'static str,
    brake_viscous: &'static str,
    /// Of [`AxisChannel::dry_friction`], N or N·m.
    pub dry: &'static str,
    negative: &'static str,
    positive: &'static str,
    /// Of [`AxisChannel::stop_stiffness`], N/m or N·m/rad.
    pub stop_stiffness: &'static str,
    /// Of [`AxisChannel::stop_damping`], N·s/m or N·m·s/rad.
    pub stop_damping: &'static str,
    /// From the unit of lengths in the file to that in the code.
    to_si: f64,
}

impl ChannelKeys {
    /// Of a channel of lengths, m and N: axial, lateral, and those of differentials.
    pub const TRANSLATION: Self = Self {
        backlash: Some("width_m"),
        loading: "loading_n_over_m",
        unloading: "unloading_n_over_m",
        branch_change: "branch_change_m",
        before: "damping_before_capture_n_s_m",
        after: "damping_after_capture_n_s_m",
        brake_force: "force_n",
        brake_viscous: "viscous_n_s_m",
        dry: "dry_friction_n",
        negative: "travel_negative_m",
        positive: "travel_positive_m",
        stop_stiffness: "stop_stiffness_n_m",
        stop_damping: "stop_damping_n_s_m",
        to_si: 1.0,
    };

    /// Of a channel of angles, degrees, rad and N·m: tilt and roll.
    pub const ROTATION: Self = Self {
        backlash: None,
        loading: "loading_nm_over_rad",
        unloading: "unloading_nm_over_rad",
        branch_change: "branch_change_deg",
        before: "damping_before_capture_nm_s_rad",
        after: "damping_after_capture_nm_s_rad",
        brake_force: "force_nm",
        brake_viscous: "viscous_nm_s_rad",
        dry: "dry_friction_nm",
        negative: "travel_negative_deg",
        positive: "travel_positive_deg",
        stop_stiffness: "stop_stiffness_nm_rad",
        stop_damping: "stop_damping_nm_s_rad",
        to_si: PI / 180.0,
    };
}

fn read_channel(t: Section<'_, '_, '_>, k: &ChannelKeys) -> AxisChannel {
    let channel = AxisChannel {
        loading: read_curve(t, k.loading),
        unloading: read_curve(t, k.unloading),
        branch_change: k.to_si * t.number(k.branch_change),
        damping: DampingPhases {
            before_capture: t.number(k.before),
            after_capture: t.number(k.after),
        },
        series_brake: t.optional_section("series_brake", |b| SeriesBrake {
            force: b.number(k.brake_force),
            viscous: b.number(k.brake_viscous),
        }),
        backlash: read_backlash(t, k),
        dry_friction: t.number(k.dry),
        travel_negative: k.to_si * t.number(k.negative),
        travel_positive: k.to_si * t.number(k.positive),
        stop_stiffness: t.number(k.stop_stiffness),
        stop_damping: t.number(k.stop_damping),
    };
    if let Some(b) = &channel.series_brake {
        let damping = channel.damping.before_capture.min(channel.damping.after_capture);
        if b.viscous + damping <= 0.0 {
            t.refuse(
                k.before,
                "with a series brake that has no viscous part, zero damping leaves the slip rate open"
                    .to_owned(),
                "give the damping or the brake's viscous part a value above 0",
            );
        }
    }
    if let Some(x) = first_above(&channel.unloading, &channel.loading) {
        t.refuse(
            k.unloading,
            format!("lies above the loading branch at {x}, which would make energy"),
            "lower it to the loading branch or below",
        );
    }
    channel
}

fn read_curve(t: Section<'_, '_, '_>, key: &'static str) -> PiecewiseCurve {
    let points = t.rows::<2>(key);
    let rises = points.windows(2).all(|w| w[1][0] > w[0][0] && w[1][1] >= w[0][1]);
    if points.iter().flatten().all(|x| x.is_finite()) && !points.is_empty() {
        if points[0][0] > 0.0 {
            t.refuse(key, "does not start at deflection 0", "start with [0, F0]");
        }
        if !rises {
            t.refuse(
                key,
                "does not rise: each point needs a larger deflection and no smaller force than the \
                 one before",
                "sort or mend the points",
            );
        }
    }
    PiecewiseCurve { points }
}

/// Play of a channel of one coordinate; the others have no such table.
fn read_backlash(t: Section<'_, '_, '_>, k: &ChannelKeys) -> f64 {
    let Some(key) = k.backlash else { return 0.0 };
    if !t.knows("backlash") {
        return 0.0;
    }
    t.optional_section("backlash", |b| b.number(key)).unwrap_or(0.0)
}

/// First deflection at which one curve lies above another, looking at the corners of both and at
/// the slopes with which they are extended.
fn first_above(upper: &PiecewiseCurve, lower: &PiecewiseCurve) -> Option<f64> {
    let (u, l) = (&upper.points, &lower.points);
    if u.len() < 2 || l.len() < 2 {
        return None;
    }
    let mut at: Vec<f64> = u.iter().chain(l).map(|p| p[0]).collect();
    at.sort_by(f64::total_cmp);
    // One point far out stands for the extension.
    at.push(at.last().copied().unwrap_or(0.0) * 1e3 + 1.0);
    at.into_iter().find(|x| value_at(u, *x) > value_at(l, *x) * (1.0 + 1e-9) + 1e-9)
}

fn value_at(points: &[[f64; 2]], x: f64) -> f64 {
    let i = points.partition_point(|p| p[0] <= x).clamp(1, points.len() - 1);
    let ([x0, y0], [x1, y1]) = (points[i - 1], points[i]);
    y0 + (y1 - y0) * (x - x0) / (x1 - x0)
}

fn read_differential(
    t: Section<'_, '_, '_>,
    ring_rest_offset_m: f64,
    damping_ramp_s: f64,
) -> Option<DifferentialAttenuator> {
    let joints = |key| {
        let rows = t.rows::<3>(key);
        let points: Vec<_> = rows.into_iter().map(DVec3::from_array).collect();
        <[DVec3; 6]>::try_from(points).ok()
    };
    let base_joints_m = joints("base_joints_m");
    let ring_joints_m = joints("ring_joints_m");
    let rows = t.rows::<6>("coupling");
    let coupling = <[[f64; 6]; 6]>::try_from(rows).ok();
    let channels = t.sections("channels", |c| read_channel(c, &ChannelKeys::TRANSLATION));
    let found = channels.len();
    let channels = <[AxisChannel; 6]>::try_from(channels).ok();
    if channels.is_none() {
        t.refuse(
            "channels",
            format!("{found} channels, but there are six brake coordinates"),
            "give [[attenuation.differential.channels]] six times",
        );
    }
    let (base, ring, coupling) = (base_joints_m?, ring_joints_m?, coupling?);
    if coupling.iter().flatten().all(|x| x.is_finite()) && is_singular(coupling) {
        t.refuse(
            "coupling",
            "is singular: some motion of the legs would meet no brake at all",
            "make the six rows independent",
        );
    }
    let rest = DVec3::X * ring_rest_offset_m;
    if rest.is_finite() && base.iter().chain(&ring).all(|p| p.is_finite()) {
        // Rows (n, r × n): leg rates from velocity and rate of the ring about its centre.
        let jacobian: [[f64; 6]; 6] = core::array::from_fn(|i| {
            let n = (rest + ring[i] - base[i]).normalize_or_zero();
            let m = ring[i].cross(n);
            [n.x, n.y, n.z, m.x, m.y, m.z]
        });
        if is_singular(jacobian) {
            t.refuse(
                "ring_joints_m",
                "the legs do not hold the ring: the Jacobian at rest is singular",
                "move the joints, so that the legs are neither parallel nor meet in one line",
            );
        }
    }
    Some(DifferentialAttenuator {
        base_joints_m: base,
        ring_joints_m: ring,
        coupling,
        channels: channels?,
        damping_ramp_s,
    })
}

/// Whether elimination with pivoting meets a pivot below 1e-6 of the first.
fn is_singular(mut a: [[f64; 6]; 6]) -> bool {
    let mut first = 0.0;
    for k in 0..6 {
        let pivot = (k..6).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).unwrap_or(k);
        a.swap(k, pivot);
        let p = a[k];
        if k == 0 {
            first = p[0].abs();
        }
        if p[k].abs() <= 1e-6 * first {
            return true;
        }
        for row in a.iter_mut().skip(k + 1) {
            let f = row[k] / p[k];
            row.iter_mut().zip(p).for_each(|(x, y)| *x -= f * y);
        }
    }
    false
}

fn read_latches(t: Section<'_, '_, '_>) -> LatchSet {
    let set = LatchSet {
        azimuths_rad: t.list::<3>("azimuths_deg").map(f64::to_radians),
        axes: t.optional_choice("axes", &LatchAxes::WORDS).unwrap_or_default(),
        approach_gap_m: t.number("approach_gap_m"),
        strike_gap_m: t.number("strike_gap_m"),
        catch_gap_m: t.number("catch_gap_m"),
        catch_delay_s: t.optional_number("catch_delay_s").unwrap_or(0.0),
        radial_zone_m: t.number("radial_zone_m"),
        tangential_zone_m: t.number("tangential_zone_m"),
        hold_stiffness_n_m: t.number("hold_stiffness_n_m"),
        joined_stiffness_n_m: t.number("joined_stiffness_n_m"),
        joined_damping_n_s_m: t.number("joined_damping_n_s_m"),
    };
    check_gaps(t, [set.approach_gap_m, set.strike_gap_m, set.catch_gap_m]);
    let [a, b, c] = set.azimuths_rad;
    for (x, y) in [(a, b), (b, c), (c, a)] {
        if turn(x, y) < 30f64.to_radians() {
            let what = format!("has two latches only {:.1}° apart", turn(x, y).to_degrees());
            t.refuse("azimuths_deg", what, "spread the three latches, 30° or more apart");
        }
    }
    set
}

fn read_spread(t: Section<'_, '_, '_>) -> MechanismSpread {
    let spread = MechanismSpread {
        contact_stiffness: t.number("contact_stiffness"),
        friction: t.number("friction"),
        petal_rigidity: t.number("petal_rigidity"),
        attenuator_curves: t.number("attenuator_curves"),
        brake: t.number("brake"),
        ring_mass: t.number("ring_mass"),
        position_fine_m: t.number("position_fine_m"),
        position_coarse_m: t.number("position_coarse_m"),
    };
    if spread.position_coarse_m < spread.position_fine_m {
        t.refuse(
            "position_coarse_m",
            format!("is below the fine grade, {} m", spread.position_fine_m),
            "make it at least as large",
        );
    }
    spread
}

fn read_limits(t: Section<'_, '_, '_>) -> MechanismLimits {
    MechanismLimits {
        tension_n: t.number("tension_n"),
        compression_n: t.number("compression_n"),
        shear_n: t.number("shear_n"),
        torsion_nm: t.number("torsion_nm"),
        bending_nm: t.number("bending_nm"),
        depth_m: t.number("depth_m"),
        overtravel_m: t.number("overtravel_m"),
    }
}

/// Angle between two azimuths, 0..π.
fn turn(a: f64, b: f64) -> f64 {
    let d = (a - b).rem_euclid(2.0 * PI);
    d.min(2.0 * PI - d)
}

// URDF against TOML ----------------------------------------------------------------------------

/// Compares what the URDF places with the parameters of the TOML, which are the source.
struct Placements<'a> {
    urdf_path: &'a Path,
    toml: &'a Path,
    tree: &'a UrdfTree,
}

impl Placements<'_> {
    fn refuse(
        &self,
        line: Option<usize>,
        key: String,
        value: String,
        what: String,
        out: &mut Findings,
    ) {
        out.problems.push(Problem {
            file: self.urdf_path.into(),
            line,
            key,
            value,
            what,
            remedy: format!(
                "change the URDF: the parameter with its source stands in {}",
                self.toml.display()
            ),
            ..Problem::default()
        });
    }

    /// `mount` → `ring` at `x_mount_ring`, `ring` → `petal_i` turned by the petal's azimuth.
    fn check(
        &self,
        x_mount_ring: Pose,
        offset_key: &str,
        ring_joint: &str,
        geometry: &SideGeometry,
        out: &mut Findings,
    ) {
        let mut expected = vec![("mount".to_owned(), Pose::IDENTITY)];
        expected.push(("ring".to_owned(), x_mount_ring));
        if let Some(p) = &geometry.petals {
            for i in 0..p.count {
                let turned = Pose::new(DVec3::ZERO, DQuat::from_rotation_x(p.azimuth_rad(i)));
                expected.push((format!("petal_{i}"), x_mount_ring * turned));
            }
        }
        for (name, want) in &expected {
            let key = format!("link `{name}`");
            let Some(got) = self.tree.links.get(name) else {
                let what = "is missing".to_owned();
                self.refuse(None, key, String::new(), what, out);
                continue;
            };
            let joint = self.tree.robot.joints.iter().find(|j| j.child.link == *name);
            let line = joint.and_then(|j| self.tree.line("joint", &j.name));
            let apart = (got.p - want.p).length();
            let turned = got.q.angle_between(want.q);
            if apart > 1e-6 || turned > 1e-6 {
                let (source, says) = if name == "ring" || name == "mount" {
                    (offset_key, format!("{:?} m", want.p.to_array()))
                } else {
                    (
                        "petals.first_azimuth_deg and petals.count",
                        format!(
                            "{:?} m, petals turned about X by their azimuths",
                            want.p.to_array()
                        ),
                    )
                };
                let value = format!("{:?} m", got.p.to_array());
                let what = format!(
                    "stands {apart:.6} m and {:.4}° from where {source} puts it, {says}",
                    turned.to_degrees()
                );
                self.refuse(line, key, value, what, out);
            }
        }
        for link in &self.tree.robot.links {
            // Surfaces may stand on links of their own.
            let carries = !geometry.surfaces.is_empty() && self.tree.hangs_on(&link.name, "ring");
            if !carries && !expected.iter().any(|(name, _)| *name == link.name) {
                let names: Vec<_> = expected.iter().map(|(n, _)| n.as_str()).collect();
                self.refuse(
                    self.tree.line("link", &link.name),
                    format!("link `{}`", link.name),
                    String::new(),
                    format!("is not a part of this side, which has {}", names.join(", ")),
                    out,
                );
            }
        }
        for joint in &self.tree.robot.joints {
            let want = if joint.child.link == "ring" { ring_joint } else { "fixed" };
            let got = format!("{:?}", joint.joint_type).to_lowercase();
            if got != want {
                out.problems.push(Problem {
                    file: self.urdf_path.into(),
                    line: self.tree.line("joint", &joint.name),
                    key: format!("joint `{}` type", joint.name),
                    value: got,
                    what: "is not the type of this joint".into(),
                    allowed: want.into(),
                    remedy: "change the type".into(),
                    ..Problem::default()
                });
            }
        }
    }

    fn check_ring_body(&self, want: &RingBody, out: &mut Findings) {
        let links = &self.tree.robot.links;
        let Some(ring) = links.iter().find(|l| l.name == "ring") else { return };
        let line = self.tree.line("link", "ring");
        if !self.tree.with_inertial.contains("ring") {
            let what = "has no inertial, but ring_body has a mass".to_owned();
            self.refuse(line, "link `ring`".into(), String::new(), what, out);
            return;
        }
        for name in self.tree.with_inertial.iter().filter(|n| *n != "ring") {
            let what =
                "has an inertial: the mass of petals and latches belongs to `ring`, that of \
                        the mount to the chaser"
                    .to_owned();
            let line = self.tree.line("link", name);
            self.refuse(line, format!("link `{name}`"), String::new(), what, out);
        }
        let got = urdf::mass_of(self.urdf_path, self.tree, ring, Pose::IDENTITY, out);
        let far = |a: f64, b: f64, scale: f64| (a - b).abs() > 1e-6 * scale;
        if far(got.mass_kg, want.mass_kg, want.mass_kg) {
            let what = format!("differs from ring_body.mass_kg = {} kg", want.mass_kg);
            self.refuse(
                line,
                "mass of link `ring`".into(),
                format!("{} kg", got.mass_kg),
                what,
                out,
            );
        }
        if (got.com_m - want.com_m).length() > 1e-6 {
            let what = format!("differs from ring_body.com_m = {:?} m", want.com_m.to_array());
            let value = format!("{:?} m", got.com_m.to_array());
            self.refuse(line, "mass centre of link `ring`".into(), value, what, out);
        }
        let scale = want.inertia_kg_m2.x_axis.x.abs();
        let (g, w) = (got.inertia_kg_m2.to_cols_array(), want.inertia_kg_m2.to_cols_array());
        if g.iter().zip(w).any(|(a, b)| far(*a, b, scale)) {
            let what = format!("differs from ring_body.inertia_kg_m2 = {w:?} kg·m²");
            let value = format!("{g:?} kg·m²");
            self.refuse(line, "inertia of link `ring`".into(), value, what, out);
        }
    }
}

// Both sides -----------------------------------------------------------------------------------

/// How the sides fit when docked: rings face to face, `R_34 = I`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatedFit {
    /// Smallest distance between a petal and the ring of the other side, m; below 0 they collide.
    pub petal_to_ring_m: f64,
    /// Roll either way until edges of petals of the two sides touch, rad; not above 0: they collide. `None`
    /// when one side has no petals.
    pub roll_play_rad: Option<f64>,
}

/// Clearances of two sides when docked.
#[must_use]
pub fn mated_fit(active: &SideGeometry, passive: &SideGeometry) -> MatedFit {
    let planes_m = active.ring.section_radius_m + passive.ring.section_radius_m;
    let to_ring = |petals: &Option<PetalGeometry>, other: &SideGeometry| {
        let (Some(p), true) = (petals, other.has_ring) else { return f64::INFINITY };
        let ring = &other.ring;
        // In a meridian plane: from the circle (planes_m, mean radius) to the line of the petal.
        let (ax, ar) = (p.height_m, p.tip_radius_m - p.base_radius_m);
        let (bx, br) = (planes_m, ring.mean_radius_m - p.base_radius_m);
        let s = ((ax * bx + ar * br) / (ax * ax + ar * ar)).clamp(0.0, 1.0);
        (bx - s * ax).hypot(br - s * ar) - p.thickness_m / 2.0 - ring.section_radius_m
    };
    let petal_to_ring_m = to_ring(&active.petals, passive).min(to_ring(&passive.petals, active));
    let roll_play_rad = active.petals.zip(passive.petals).map(|(a, p)| {
        let azimuths =
            |g: &PetalGeometry| (0..g.count).map(|i| g.azimuth_rad(i)).collect::<Vec<_>>();
        // r4 is turned by 180° about Z: azimuth β of the passive side is π − β seen from r3.
        let mut play = f64::INFINITY;
        for x in azimuths(&a) {
            for y in azimuths(&p) {
                play = play.min(turn(x, PI - y));
            }
        }
        // Both half-angles change linearly between the ring planes, so the ends decide.
        let half = |g: &PetalGeometry, x: f64| {
            let s = (x / g.height_m).clamp(0.0, 1.0);
            let radius = g.base_radius_m + s * (g.tip_radius_m - g.base_radius_m);
            g.base_half_angle_rad
                + s * (g.tip_half_angle_rad - g.base_half_angle_rad)
                + g.thickness_m / 2.0 / radius
        };
        let at = |x: f64| half(&a, x) + half(&p, planes_m - x);
        let by_angles = play - at(0.0).max(at(planes_m));
        if by_angles <= 0.0 { by_angles } else { edge_play(&a, &p, planes_m, by_angles) }
    });
    MatedFit { petal_to_ring_m, roll_play_rad }
}

/// Roll until the side edges of petals touch, rad: straight lines from base to tip, rounded with half the
/// thickness. Between lines that lean the angles alone leave too much; `most` is what they leave.
fn edge_play(a: &PetalGeometry, p: &PetalGeometry, planes_m: f64, most: f64) -> f64 {
    let edges = |g: &PetalGeometry| -> Vec<[DVec3; 2]> {
        let at = |x: f64, r: f64, az: f64| DVec3::new(x, r * az.cos(), r * az.sin());
        let ends = |az: f64, side: f64| {
            [
                at(0.0, g.base_radius_m, az + side * g.base_half_angle_rad),
                at(g.height_m, g.tip_radius_m, az + side * g.tip_half_angle_rad),
            ]
        };
        (0..g.count).flat_map(|i| [-1.0, 1.0].map(|s| ends(g.azimuth_rad(i), s))).collect()
    };
    let (active, passive) = (edges(a), edges(p));
    let apart_m = 0.5 * (a.thickness_m + p.thickness_m);
    let free = |roll: f64| {
        let (s, c) = roll.sin_cos();
        // r4 is turned by 180° about Z and stands where the rings touch.
        let docked = |x: DVec3| DVec3::new(planes_m - x.x, -c * x.y - s * x.z, c * x.z - s * x.y);
        passive
            .iter()
            .map(|e| e.map(docked))
            .all(|e| active.iter().all(|other| segment_distance(*other, e) > apart_m))
    };
    [-1.0, 1.0]
        .map(|way| {
            if !free(0.0) {
                return 0.0;
            }
            let (mut within, mut beyond) = (0.0, most);
            while beyond - within > 1e-7 {
                let middle = 0.5 * (within + beyond);
                if free(way * middle) { within = middle } else { beyond = middle }
            }
            within
        })
        .into_iter()
        .fold(f64::INFINITY, f64::min)
}

/// Distance of two line segments (Ericson, Real-Time Collision Detection, §5.1.9).
fn segment_distance([p1, q1]: [DVec3; 2], [p2, q2]: [DVec3; 2]) -> f64 {
    let (d1, d2, r) = (q1 - p1, q2 - p2, p1 - p2);
    let (a, e) = (d1.length_squared(), d2.length_squared());
    let (b, c, f) = (d1.dot(d2), d1.dot(r), d2.dot(r));
    let between = a * e - b * b;
    let s = if between > 1e-12 * a * e { ((b * f - c * e) / between).clamp(0.0, 1.0) } else { 0.0 };
    let t = (b * s + f) / e;
    let (s, t) = if t < 0.0 {
        ((-c / a).clamp(0.0, 1.0), 0.0)
    } else if t > 1.0 {
        (((b - c) / a).clamp(0.0, 1.0), 1.0)
    } else {
        (s, t)
    };
    ((p1 + d1 * s) - (p2 + d2 * t)).length()
}

/// Whether petals lean inward.
fn leans_inward(p: &PetalGeometry) -> bool {
    p.tip_radius_m < p.base_radius_m
}

/// What to do about petals that leave no room between each other wherever they are turned.
const NARROWER_REMEDY: &str = "make the petals of one side narrower or thinner";

/// How to turn petals so that they lie in the middle between those of the active side; `None` where that
/// leaves no room either.
fn between(active: &SideGeometry, passive: &PetalGeometry) -> Option<String> {
    let part = 2.0 * PI / f64::from(passive.count);
    let first = (PI - active.petals?.first_azimuth_rad - 0.5 * part).rem_euclid(part);
    let turned = PetalGeometry { first_azimuth_rad: first, ..*passive };
    let side = SideGeometry { petals: Some(turned), ..active.clone() };
    let play = mated_fit(active, &side).roll_play_rad?;
    let deg = first.to_degrees();
    let remedy = format!("turn the petals, in the URDF too, to first_azimuth_deg = {deg:.3}");
    (play > 0.0).then_some(remedy)
}

/// Refuses sides that collide when docked.
fn check_fit(active: &ActiveSide, passive: &PassiveSide, out: &mut Findings) {
    let mut refuse = |file: &Path, key: &str, value: String, what: String, remedy: &str| {
        out.problems.push(Problem {
            file: file.into(),
            key: key.into(),
            value,
            what,
            remedy: remedy.into(),
            ..Problem::default()
        });
    };
    let fit = mated_fit(&active.geometry, &passive.geometry);
    if let (Some(a), Some(p)) = (&active.geometry.petals, &passive.geometry.petals) {
        let both = (a.base_half_angle_rad + p.base_half_angle_rad).to_degrees();
        let room = 180.0 / f64::from(a.count);
        if a.count != p.count {
            let what = format!("the active side has {}, so they cannot interleave", a.count);
            let value = p.count.to_string();
            refuse(&passive.toml, "petals.count", value, what, "give both sides the same count");
        } else if both >= room {
            refuse(
                &passive.toml,
                "petals.base_half_angle_deg",
                format!("{:.3}", p.base_half_angle_rad.to_degrees()),
                format!(
                    "petals collide when docked: the base half-angles of both sides add up to \
                     {both:.2}°, and 180°/count = {room:.2}°"
                ),
                "make one of the half-angles smaller",
            );
        } else if let Some(play) = fit.roll_play_rad
            && play <= 0.0
        {
            refuse(
                &passive.toml,
                "petals.first_azimuth_deg",
                format!("{:.3}", p.first_azimuth_rad.to_degrees()),
                format!(
                    "petals collide when docked: roll play {:.2}° (azimuth β of the passive side \
                     is 180° − β seen from the active ring)",
                    play.to_degrees()
                ),
                between(&active.geometry, p).as_deref().unwrap_or(NARROWER_REMEDY),
            );
        }
        if leans_inward(a) != leans_inward(p) {
            let what = "petals of one side lean inward, those of the other outward".to_owned();
            let remedy = "let both lean the same way";
            refuse(&passive.toml, "petals.tip_radius_m", p.tip_radius_m.to_string(), what, remedy);
        }
    }
    if fit.petal_to_ring_m <= 0.0 {
        refuse(
            &active.toml,
            "petals.base_radius_m",
            String::new(),
            format!(
                "petals collide with the ring of the other side when docked, by {:.2} mm",
                -1e3 * fit.petal_to_ring_m
            ),
            "move the base away from the ring circle, or make the petals thinner",
        );
    }
    if let (Some(latches), Some(p)) = (&active.latches, &passive.geometry.petals) {
        for azimuth in latches.azimuths_rad {
            for i in 0..p.count {
                if turn(azimuth, PI - p.azimuth_rad(i)) < p.base_half_angle_rad {
                    refuse(
                        &active.toml,
                        "latches.azimuths_deg",
                        format!("{:.3}", azimuth.to_degrees()),
                        format!("the striker would lie under petal {i} of the passive side"),
                        "put the latches where the passive ring is free",
                    );
                }
            }
        }
    }
}

pub(crate) fn join(
    active: ActiveSide,
    passive: PassiveSide,
    attenuation: Option<AttenuationChoice>,
    out: &mut Findings,
) -> Option<DockingMechanism> {
    // Placeholders of one side would give nonsense about both.
    if active.clean && passive.clean {
        check_fit(&active, &passive, out);
    }
    let choice = attenuation.unwrap_or(active.default_choice);
    let attenuator = match choice {
        AttenuationChoice::Rigid => Some(Attenuator::Rigid),
        AttenuationChoice::Characteristic => active.characteristic.map(Attenuator::Characteristic),
        AttenuationChoice::Differential => active.differential.map(Attenuator::Differential),
    };
    if attenuator.is_none() && active.clean {
        let word = AttenuationChoice::WORDS.iter().find(|(_, c)| *c == choice).map_or("", |w| w.0);
        out.problems.push(Problem {
            file: active.toml.clone(),
            key: "attenuation".into(),
            value: word.into(),
            what: "is asked for, but this file does not describe it".into(),
            remedy: "add the table, or choose another attenuation".into(),
            ..Problem::default()
        });
    }
    let clean = active.clean && passive.clean;
    let files = [active.toml.clone(), passive.toml.clone()];
    let mechanism = DockingMechanism {
        name: active.name,
        active: active.geometry,
        passive: passive.geometry,
        ring_body: active.ring_body,
        ring_rest_offset_m: active.ring_rest_offset_m,
        passive_ring_offset_m: passive.ring_offset_m,
        contact: active.contact,
        attenuator: attenuator?,
        latches: active.latches,
        own_latches: active.own_latches.latches,
        captured_when: active.own_latches.captured_when,
        stick: active.stick,
        limits: active.limits,
        outcome: active.outcome,
        spread: active.spread,
        offsets: PartOffsets::default(),
        digest: out.digest(),
    };
    if clean {
        check_pairs(&mechanism, &files, out);
    }
    Some(mechanism)
}
