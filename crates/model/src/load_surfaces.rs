//! Reading surfaces and latches of their own, and checking the pairs they make.

use std::path::{Path, PathBuf};

use docktwin_core::{DQuat, DVec3, Pose};

use crate::keys::read::Section;
use crate::keys::{SURFACE_KINDS, SurfaceKind};
use crate::mechanism::{DockingMechanism, SideGeometry};
use crate::problem::{Findings, Note, Problem};
use crate::surface::{
    CapturedWhen, Latch, MOST_LATCHES, MOST_PAIRS, RING_AND_PETAL_PAIRS, Surface, SurfaceCore,
};
use crate::urdf::UrdfTree;

/// Most points of a hull, and of a hollow.
const MOST_POINTS: usize = 64;
const MOST_PROFILE: usize = 6;

/// Latches with places of their own.
#[derive(Clone, Debug, Default)]
pub(crate) struct OwnLatches {
    pub(crate) latches: Vec<Latch>,
    pub(crate) captured_when: CapturedWhen,
}

/// The surfaces of a side; their place in the ring frame comes with the URDF.
pub(crate) fn read_surfaces(t: Section<'_, '_, '_>) -> Vec<Surface> {
    let mut names: Vec<String> = vec!["ring".to_owned()];
    t.sections("surface", |s| {
        let surface = read_surface(s);
        if names.contains(&surface.name) {
            s.refuse(
                "name",
                "is the name of another surface, or of the ring",
                "choose another name",
            );
        }
        names.push(surface.name.clone());
        surface
    })
}

fn read_surface(s: Section<'_, '_, '_>) -> Surface {
    let name = s.text("name");
    let kind = s.choice("kind", &SURFACE_KINDS).unwrap_or(SurfaceKind::Sphere);
    let link = s.text("link");
    let p = DVec3::from_array(s.list("position_m"));
    let [roll, pitch, yaw] = s.list::<3>("rpy_deg").map(f64::to_radians);
    // Fixed axes X, Y, Z in this order, as in URDF.
    let q =
        DQuat::from_rotation_z(yaw) * DQuat::from_rotation_y(pitch) * DQuat::from_rotation_x(roll);
    let rounding_m = s.number("rounding_m");
    let half = || 0.5 * s.number("length_m");
    let core = match kind {
        SurfaceKind::Sphere => SurfaceCore::Sphere,
        SurfaceKind::Capsule => SurfaceCore::Capsule { half: half() },
        SurfaceKind::Torus => SurfaceCore::Torus { radius: s.number("core_radius_m") },
        SurfaceKind::Box => SurfaceCore::Box { half: 0.5 * DVec3::from_array(s.list("size_m")) },
        SurfaceKind::Cylinder => {
            SurfaceCore::Cylinder { radius: s.number("core_radius_m"), half: half() }
        }
        SurfaceKind::Cone => SurfaceCore::Cone { radius: s.number("core_radius_m"), half: half() },
        SurfaceKind::Hull => SurfaceCore::Hull { points: read_points(s) },
        SurfaceKind::Hollow => SurfaceCore::Hollow { profile: read_profile(s) },
    };
    if let SurfaceCore::Torus { radius } = core
        && rounding_m >= radius
    {
        s.refuse(
            "rounding_m",
            format!("is not below core_radius_m, {radius} m"),
            "make the section thinner than the circle",
        );
    }
    Surface {
        name,
        link,
        x_link: Pose::new(p, q),
        x_ring: Pose::IDENTITY,
        core,
        rounding_m,
        stiffness_n_m: s.number("stiffness_n_m"),
        friction: s.number("friction"),
    }
}

fn read_points(s: Section<'_, '_, '_>) -> Vec<DVec3> {
    let points: Vec<DVec3> = s.rows::<3>("points_m").into_iter().map(DVec3::from_array).collect();
    if points.len() > MOST_POINTS {
        let what = format!("has {} points, and a hull at most {MOST_POINTS}", points.len());
        s.refuse("points_m", what, "leave out points inside the hull, or make two surfaces of it");
    }
    points
}

fn read_profile(s: Section<'_, '_, '_>) -> Vec<[f64; 2]> {
    let profile = s.rows::<2>("profile_m");
    if profile.len() > MOST_PROFILE {
        let what = format!("has {} points, and a hollow at most {MOST_PROFILE}", profile.len());
        s.refuse("profile_m", what, "leave points out, or make two surfaces of it");
    }
    if profile.iter().any(|p| p[1] < 0.0) {
        s.refuse(
            "profile_m",
            "has a radius below 0",
            "points are (x, radius), the radius 0 on the axis and else above",
        );
    }
    let short = |w: &[[f64; 2]]| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1]) < 1e-6;
    if profile.windows(2).any(short) {
        s.refuse("profile_m", "has the same point twice in turn", "take one of them out");
    }
    profile
}

/// `[[latch]]` and `captured_when`.
pub(crate) fn read_own_latches(t: Section<'_, '_, '_>) -> OwnLatches {
    let mut names: Vec<String> = Vec::new();
    let latches = t.sections("latch", |s| {
        let latch = read_latch(s);
        if names.contains(&latch.name) {
            s.refuse("name", "is the name of another latch", "choose another name");
        }
        names.push(latch.name.clone());
        latch
    });
    if latches.len() > MOST_LATCHES {
        let what = format!("has {} latches, and a mechanism at most {MOST_LATCHES}", latches.len());
        t.refuse("latch", what, "leave some out");
    }
    if t.has("latch") && t.has("latches") {
        t.refuse("latch", "stands beside [latches], which has latches too", "keep one of both");
    }
    if !t.has("latch") {
        return OwnLatches::default();
    }
    let words = t.text("captured_when");
    let captured_when = match words.as_str() {
        "" | "all" => CapturedWhen::All,
        "any" => CapturedWhen::Any,
        list => {
            let places: Vec<Option<usize>> =
                list.split(',').map(|n| names.iter().position(|name| name == n.trim())).collect();
            if places.contains(&None) {
                let what =
                    format!("names a latch that is not there; there are {}", names.join(", "));
                t.refuse(
                    "captured_when",
                    what,
                    "write `all`, `any`, or names of latches with commas between them",
                );
            }
            CapturedWhen::These(places.into_iter().flatten().collect())
        }
    };
    OwnLatches { latches, captured_when }
}

fn read_latch(s: Section<'_, '_, '_>) -> Latch {
    let latch = Latch {
        name: s.text("name"),
        latch_r: DVec3::from_array(s.list("latch_m")),
        striker_p: DVec3::from_array(s.list("striker_m")),
        approach_gap_m: s.number("approach_gap_m"),
        strike_gap_m: s.number("strike_gap_m"),
        catch_gap_m: s.number("catch_gap_m"),
        lateral_zone_m: s.number("lateral_zone_m"),
        angle_zone_rad: s.number("angle_zone_deg").to_radians(),
        hold_stiffness_n_m: s.number("hold_stiffness_n_m"),
        joined_stiffness_n_m: s.number("joined_stiffness_n_m"),
        joined_damping_n_s_m: s.number("joined_damping_n_s_m"),
    };
    check_gaps(s, [latch.approach_gap_m, latch.strike_gap_m, latch.catch_gap_m]);
    latch
}

/// Puts the surfaces of a side where their links stand.
pub(crate) fn place_surfaces(
    side: &mut SideGeometry,
    tree: &UrdfTree,
    toml: &Path,
    active: bool,
    out: &mut Findings,
) {
    let Some(x_ring) = tree.links.get("ring").copied() else { return };
    for (i, s) in side.surfaces.iter_mut().enumerate() {
        let mut refuse = |what: String, remedy: String| {
            out.problems.push(Problem {
                file: toml.into(),
                key: format!("surface.{i}.link"),
                value: s.link.clone(),
                what,
                remedy,
                ..Problem::default()
            });
        };
        let Some(x_link) = tree.links.get(&s.link) else {
            let names: Vec<&str> = tree.links.keys().map(String::as_str).collect();
            refuse(
                "is no link of the URDF".to_owned(),
                format!("name one of {}", names.join(", ")),
            );
            continue;
        };
        if active && s.link != "ring" && !tree.hangs_on(&s.link, "ring") {
            let what =
                "does not move with the ring, and what stands on the chaser itself cannot touch"
                    .to_owned();
            refuse(what, "name `ring` or a link fixed to it".to_owned());
            continue;
        }
        s.x_ring = x_ring.inverse() * *x_link * s.x_link;
    }
}

/// Refuses pairs without a law within reach, too many pairs, and depths at which cores would meet.
pub(crate) fn check_pairs(m: &DockingMechanism, files: &[PathBuf; 2], out: &mut Findings) {
    let [active, passive] = files;
    let mut refuse = |key: &str, value: String, what: String, remedy: &str| {
        out.problems.push(Problem {
            file: active.clone(),
            key: key.into(),
            value,
            what,
            remedy: remedy.into(),
            ..Problem::default()
        });
    };
    for [a, b] in m.lawless_pairs() {
        refuse(
            "surface",
            format!("{a} · {b}"),
            format!(
                "have no law of contact and come within reach of each other on the way to the docked place ({})",
                passive.display()
            ),
            "make one of them of another kind (spheres and capsules touch every kind), take one out, or \
             place it out of reach",
        );
    }
    let sides = [&m.active, &m.passive];
    if m.limits.depth_m > 0.04 && sides.iter().any(|s| s.has_ring || s.petals.is_some()) {
        let what = "is more than 0.04 m, beyond which the normals of rings and petals are not to be believed";
        refuse(
            "limits.depth_m",
            format!("{} m", m.limits.depth_m),
            what.to_owned(),
            "make it 0.04 m or less",
        );
    }
    let pairs = m.surface_pairs();
    let most = MOST_PAIRS - RING_AND_PETAL_PAIRS;
    if pairs.len() > most {
        let what = format!(
            "makes {} pairs with the other side, and there is room for {most}",
            pairs.len()
        );
        refuse("surface", String::new(), what, "take surfaces out, or make one hull of several");
    }
    let shallowest = pairs.iter().min_by(|a, b| radii(&a.surfaces).total_cmp(&radii(&b.surfaces)));
    if let Some(p) = shallowest
        && m.limits.depth_m >= radii(&p.surfaces)
    {
        let sum = radii(&p.surfaces);
        refuse(
            "limits.depth_m",
            format!("{} m", m.limits.depth_m),
            format!(
                "is not below the rounding of both surfaces of {} together, {sum} m, where their cores would meet",
                DockingMechanism::surface_pair_name(p)
            ),
            "make it smaller, or the rounding of one of them larger",
        );
    }
    for p in pairs.iter().filter(|p| p.surfaces.iter().all(|s| s.core.can_lie_flat())) {
        let name = DockingMechanism::surface_pair_name(p);
        out.flags.push(Note {
            file: active.clone(),
            line: None,
            what: format!(
                "pair {name}: where faces or lines lie flat on each other the moment is that of their deepest \
                 point alone, which goes from one edge to the other as they rock"
            ),
            flagged: true,
        });
    }
    if m.stick.is_some() && !pairs.is_empty() {
        refuse(
            "surface",
            String::new(),
            "stands beside [stick], with which no surfaces touch".to_owned(),
            "keep one of both",
        );
    }
}

fn radii(s: &[Surface; 2]) -> f64 {
    s[0].rounding_m + s[1].rounding_m
}

/// A latch is approached, struck and caught in this order.
pub(crate) fn check_gaps(t: Section<'_, '_, '_>, [approach_m, strike_m, catch_m]: [f64; 3]) {
    if strike_m < catch_m {
        let what = format!("is below the catch gap, {catch_m} m");
        t.refuse("strike_gap_m", what, "a latch is struck before it catches: make it larger");
    }
    if approach_m < strike_m {
        let what = format!("is below the strike gap, {strike_m} m");
        t.refuse("approach_gap_m", what, "a latch approaches before it is struck: make it larger");
    }
}
