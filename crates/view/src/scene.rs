//! What is logged once: bodies, rings, petals, names and colours of curves.

use core::f64::consts::PI;

use docktwin_core::{DQuat, DVec3, Pose};
use docktwin_model::{
    Attenuator, DockingMechanism, PetalGeometry, RingGeometry, SideGeometry, Spacecraft,
};
use re_sdk_types::archetypes::{
    Arrows3D, LineStrips3D, Mesh3D, Points3D, SeriesLines, StateConfiguration, Transform3D,
    TransformAxes3D, ViewCoordinates,
};
use re_sdk_types::components::Radius;
use re_sdk_types::datatypes::Quaternion;

use crate::eye::{Eye, reach};
use crate::mesh::{Mesh, f32x3};
use crate::stream::{Sent, Stream};
use crate::style::{self, PairClass};
use crate::{SceneModel, paths};

/// Half a turn about Z: from `e4` to `r4`, whose +X points toward the chaser.
const HALF_TURN_Z: DQuat = DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0);

pub(crate) fn transform(pose: &Pose) -> Transform3D {
    Transform3D::from_translation_rotation(
        f32x3(pose.p),
        Quaternion::from_xyzw(pose.q.as_quat().to_array()),
    )
}

/// The hull behind a port, +X toward the other vehicle, the port at x = 0. Radius and length are
/// those of the homogeneous cylinder of the same mass and inertia; a cone leads to the port.
fn hull(s: &Spacecraft, port_radius_m: f64) -> Mesh {
    let across = 0.5 * (s.inertia_kg_m2.y_axis.y + s.inertia_kg_m2.z_axis.z);
    let radius = (2.0 * s.inertia_kg_m2.x_axis.x / s.mass_kg).sqrt();
    let radius = if radius.is_finite() { radius.max(port_radius_m) } else { port_radius_m };
    let length = (12.0 * across / s.mass_kg - 3.0 * radius * radius).sqrt();
    let length = if length.is_finite() { length } else { 2.0 * radius };
    let cone = 1.3 * (radius - port_radius_m);
    let rear = (s.x_body_port.p.x.abs() + 0.5 * length).max(cone + 0.5 * radius);
    Mesh::revolution(&[
        [-0.03, 0.0],
        [-0.03, port_radius_m],
        [-0.08, port_radius_m],
        [-0.08 - cone, radius],
        [-rear, radius],
        [-rear, 0.0],
    ])
}

pub(crate) fn log_mesh(rec: &Stream, path: &str, mesh: Mesh, colour: u32) -> Sent {
    rec.log_static(
        path,
        &Mesh3D::new(mesh.positions)
            .with_vertex_normals(mesh.normals)
            .with_triangle_indices(mesh.triangles)
            .with_albedo_factor(colour),
    )
}

fn log_side(rec: &Stream, path: &str, side: &SideGeometry, colour: u32, glass: u32) -> Sent {
    if side.has_ring {
        log_mesh(rec, &format!("{path}/ring"), Mesh::torus(&side.ring), glass)?;
        log_edges(rec, &format!("{path}/ring/edges"), torus_edges(&side.ring), colour)?;
    }
    for (i, s) in side.surfaces.iter().enumerate() {
        log_mesh(rec, &format!("{path}/surface_{i}"), Mesh::surface(s), glass)?;
    }
    if let Some(petals) = &side.petals {
        for i in 0..petals.count {
            log_mesh(rec, &format!("{path}/petal_{i}"), Mesh::petal(petals, i), glass)?;
            let edges = vec![petal_edge(petals, i)];
            log_edges(rec, &format!("{path}/petal_{i}/edges"), edges, colour)?;
        }
    }
    Ok(())
}

fn log_edges(rec: &Stream, path: &str, edges: Vec<Vec<[f32; 3]>>, colour: u32) -> Sent {
    let edges =
        LineStrips3D::new(edges).with_radii([Radius::new_ui_points(0.9)]).with_colors([colour]);
    rec.log_static(path, &edges)
}

/// The outermost and the innermost circle of the torus.
fn torus_edges(g: &RingGeometry) -> Vec<Vec<[f32; 3]>> {
    let (r, s) = (g.mean_radius_m, g.section_radius_m);
    let circle = |r: f64| {
        let at = |k: i32| {
            let (sin, cos) = (f64::from(k) * PI / 48.0).sin_cos();
            f32x3(DVec3::new(0.0, r * cos, r * sin))
        };
        (0..=96).map(at).collect()
    };
    [r + s, r - s].map(circle).to_vec()
}

/// The outline of the mid-surface of petal `i`.
fn petal_edge(g: &PetalGeometry, i: u32) -> Vec<[f32; 3]> {
    let us = (-12..=12).map(|k| f64::from(k) / 12.0);
    let base = us.clone().map(|u| g.ruling(i, u)[0]);
    let tip = us.rev().map(|u| g.ruling(i, u)[1]);
    base.chain(tip).chain([g.ruling(i, -1.0)[0]]).map(f32x3).collect()
}

/// Petals of a side that have a gap of their own in the frames: three at most.
pub(crate) fn petal_count(side: &SideGeometry) -> usize {
    side.petals.map_or(0, |p| p.count.min(3) as usize)
}

/// Short names of the petals, "A1" and "P1'", at their middles.
fn log_petal_names(
    rec: &Stream,
    path: &str,
    side: &SideGeometry,
    name: impl Fn(u32) -> String,
    colour: u32,
) -> Sent {
    let Some(g) = &side.petals else { return Ok(()) };
    let middle = |i| {
        let [base, tip] = g.ruling(i, 0.0);
        f32x3(base.lerp(tip, 0.6))
    };
    rec.log_static(
        format!("{path}/petal_names"),
        &Points3D::new((0..g.count).map(middle))
            .with_radii([Radius::new_ui_points(0.0)])
            .with_colors([colour])
            .with_labels((0..g.count).map(name))
            .with_show_labels(true),
    )
}

/// Points of the latches on the face of the active ring, in `r3`, m.
pub(crate) fn latch_points(m: &DockingMechanism) -> Option<[DVec3; 3]> {
    m.latches.as_ref().map(|l| {
        l.azimuths_rad.map(|a| {
            let ring = &m.active.ring;
            DVec3::new(
                ring.section_radius_m,
                ring.mean_radius_m * a.cos(),
                ring.mean_radius_m * a.sin(),
            )
        })
    })
}

/// Ends of the legs that carry the ring: on the chaser in `e3`, on the ring in `r3`, m. Those of
/// the differential attenuator are real; a characteristic one has only tables, its legs are a sign.
pub(crate) fn legs(m: &DockingMechanism) -> Vec<[DVec3; 2]> {
    match &m.attenuator {
        Attenuator::Rigid => vec![],
        Attenuator::Differential(d) => {
            core::iter::zip(d.base_joints_m, d.ring_joints_m).map(|(a, b)| [a, b]).collect()
        }
        Attenuator::Characteristic(_) => {
            let r = m.active.ring.mean_radius_m;
            let at = |azimuth: f64| DVec3::new(0.0, r * azimuth.cos(), r * azimuth.sin());
            (0..6u32)
                .map(|k| {
                    let pair = f64::from(k / 2) * PI / 1.5;
                    let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
                    [at(pair + sign * 0.9), at(pair + sign * 0.12)]
                })
                .collect()
        }
    }
}

/// Logs all that does not change. `compared` names the curves as those of run A.
pub(crate) fn log_static(rec: &Stream, s: &SceneModel<'_>, compared: bool) -> Sent {
    let m = s.mechanism;
    rec.log_static(paths::SCENE, &ViewCoordinates::FLU())?;

    let port_radius = m.active.ring.mean_radius_m + 2.0 * m.active.ring.section_radius_m;
    log_mesh(
        rec,
        &format!("{}/hull", paths::CHASER),
        hull(s.chaser, port_radius),
        style::ACTIVE_HULL,
    )?;
    rec.log_static(format!("{}/port_e3", paths::CHASER), &TransformAxes3D::new(0.15))?;
    let glass = |colour| style::faded(colour, style::GLASS);
    log_side(rec, paths::ACTIVE, &m.active, style::ACTIVE, glass(style::ACTIVE))?;
    log_petal_names(rec, paths::ACTIVE, &m.active, |i| format!("A{}", i + 1), style::ACTIVE)?;

    // The target's entity is its port frame e4; the hull behind it looks toward −X.
    let half_turn = Pose::new(DVec3::ZERO, HALF_TURN_Z);
    let hull_path = format!("{}/hull", paths::TARGET);
    rec.log_static(hull_path.as_str(), &transform(&half_turn))?;
    log_mesh(rec, &hull_path, hull(s.target, port_radius), style::PASSIVE_HULL)?;
    rec.log_static(paths::PASSIVE, &transform(&passive_ring(m)))?;
    log_side(rec, paths::PASSIVE, &m.passive, style::PASSIVE, glass(style::PASSIVE))?;
    log_petal_names(rec, paths::PASSIVE, &m.passive, |i| format!("P{}'", i + 1), style::PASSIVE)?;

    if let (Some(points), Some(latches)) = (latch_points(m), m.latches.as_ref()) {
        rec.log_static(
            paths::LATCHES,
            &Points3D::new(points.map(f32x3))
                .with_radii([Radius::new_scene_units(style::LATCH_RADIUS_M)])
                .with_labels(["L1", "L2", "L3"]),
        )?;
        let strikers = latches.azimuths_rad.map(|a| {
            let ring = &m.passive.ring;
            let a = PI - a;
            [
                ring.section_radius_m as f32,
                (ring.mean_radius_m * a.cos()) as f32,
                (ring.mean_radius_m * a.sin()) as f32,
            ]
        });
        rec.log_static(
            format!("{}/strikers", paths::PASSIVE),
            &Points3D::new(strikers)
                .with_radii([Radius::new_scene_units(0.7 * style::LATCH_RADIUS_M)])
                .with_colors([style::STRIKER]),
        )?;
    }
    log_latch_lanes(rec, shown_latches(m), |path| path)?;
    log_legend(rec, s, compared)?;
    log_series(rec, m, |path| path.to_owned(), if compared { "A " } else { "" }, |c| c, 1.5)
}

/// The same for the run behind the other one: its mechanism in grey, its curves paler.
pub(crate) fn log_ghost(rec: &Stream, s: &SceneModel<'_>) -> Sent {
    let m = s.mechanism;
    let glass = style::faded(style::GHOST, style::GHOST_GLASS);
    let at = |path: &str| paths::of_ghost(path);
    log_side(rec, &at(paths::ACTIVE), &m.active, style::GHOST_EDGES, glass)?;
    rec.log_static(at(paths::PASSIVE), &transform(&passive_ring(m)))?;
    log_side(rec, &at(paths::PASSIVE), &m.passive, style::GHOST_EDGES, glass)?;
    log_latch_lanes(rec, shown_latches(m), |path| paths::of_ghost(&path))?;
    log_series(rec, m, at, "B ", style::ghostly, 1.0)
}

/// `X_4r4`.
fn passive_ring(m: &DockingMechanism) -> Pose {
    Pose::from_translation(DVec3::X * -m.passive_ring_offset_m)
        * Pose::new(DVec3::ZERO, HALF_TURN_Z)
}

/// Latches whose states and gaps are shown: the first three.
pub(crate) fn shown_latches(m: &DockingMechanism) -> usize {
    m.latch_count().min(3)
}

fn log_latch_lanes(rec: &Stream, count: usize, at: impl Fn(String) -> String) -> Sent {
    for i in 0..count {
        rec.log_static(
            at(paths::latch_state(i)),
            &StateConfiguration::new()
                .with_values(style::LATCH_NAMES)
                .with_labels(style::LATCH_NAMES)
                .with_colors(style::LATCH_COLOURS),
        )?;
    }
    Ok(())
}

/// Scale and colours of the arrows. The scale is as far from the eye as the mechanism, so that it is
/// as large as the forces; the classes are nearer, at the lower edge of the view.
fn log_legend(rec: &Stream, s: &SceneModel<'_>, compared: bool) -> Sent {
    let m = s.mechanism;
    let eye = Eye::new(m);
    rec.log_static(
        format!("{}/force_scale", paths::LEGEND),
        &Arrows3D::from_vectors([f32x3(eye.right() * 1000.0 * style::METRES_PER_NEWTON)])
            .with_origins([f32x3(eye.point([0.55, 0.66], 1.0))])
            .with_radii([Radius::new_ui_points(3.0)])
            .with_colors([style::TEXT])
            .with_labels(["arrow of 1 kN"]),
    )?;
    if compared {
        rec.log_static(
            format!("{}/ghost", paths::LEGEND),
            &Points3D::new([f32x3(eye.point([0.0, -0.82], 0.4))])
                .with_radii([Radius::new_ui_points(0.0)])
                .with_colors([style::GHOST])
                .with_labels(["grey: run B"]),
        )?;
    }
    rec.log_static(
        format!("{}/vehicles", paths::LEGEND),
        &Points3D::new([[-0.75, -0.92], [0.75, -0.92]].map(|at| f32x3(eye.point(at, 0.4))))
            .with_radii([Radius::new_ui_points(0.0)])
            .with_colors([style::ACTIVE, style::PASSIVE])
            .with_labels([
                format!("{}: chaser, active side (A)", s.chaser.name),
                format!("{}: target, passive side (P)", s.target.name),
            ]),
    )?;
    let r = reach(m);
    let classes = PairClass::ALL;
    let places = [-0.9, -0.5, -0.1, 0.3, 0.7].map(|x| f32x3(eye.point([x, 0.88], 0.4)));
    rec.log_static(
        format!("{}/classes", paths::LEGEND),
        &Arrows3D::from_vectors(classes.map(|_| f32x3(eye.right() * 0.1 * r)))
            .with_origins(places)
            .with_radii([Radius::new_ui_points(3.0)])
            .with_colors(classes.map(PairClass::colour))
            .with_labels(classes.map(PairClass::name)),
    )
}

fn log_series(
    rec: &Stream,
    m: &DockingMechanism,
    at: impl Fn(&str) -> String,
    prefix: &str,
    shade: impl Fn(u32) -> u32,
    width: f32,
) -> Sent {
    let log = |path: &str, names: &[&str], colours: &[u32]| {
        rec.log_static(
            at(path),
            &SeriesLines::new()
                .with_names(names.iter().map(|n| format!("{prefix}{n}")))
                .with_colors(colours.iter().map(|c| shade(*c)))
                .with_widths(names.iter().map(|_| width)),
        )
    };
    let [x, y, z] = style::AXES;
    log(paths::PORT_FORCE, &["X", "Y", "Z", "Σ contact"], &[x, y, z, style::TEXT])?;
    for path in [paths::POSITION, paths::VELOCITY, paths::RING_DEFLECTION] {
        log(path, &["X", "Y", "Z"], &style::AXES)?;
    }
    log(paths::PORT_MOMENT, &["roll X", "pitch Y", "yaw Z"], &style::AXES)?;
    for path in [paths::ATTITUDE, paths::RATE, paths::RING_TILT] {
        log(path, &["roll", "pitch", "yaw"], &style::AXES)?;
    }
    log(
        paths::ENERGY,
        &["kinetic", "stored", "friction", "contact", "attenuator"],
        &[
            style::TEXT,
            style::AXES[2],
            PairClass::PetalRing.colour(),
            PairClass::RingRing.colour(),
            style::ACTIVE,
        ],
    )?;
    let (a, p) = (petal_count(&m.active), petal_count(&m.passive));
    if a > 0 {
        log(paths::GAP_ACTIVE, &["A1", "A2", "A3"][..a], &style::ACTIVE_PETALS[..a])?;
    }
    if p > 0 {
        log(paths::GAP_PASSIVE, &["P1'", "P2'", "P3'"][..p], &style::PASSIVE_PETALS[..p])?;
    }
    let latches = shown_latches(m);
    let colours =
        [PairClass::Latch.colour(), PairClass::RingRing.colour(), PairClass::PetalRing.colour()];
    let names = ["latch 1", "latch 2", "latch 3"];
    if latches > 0 {
        log(paths::LATCH_GAP, &names[..latches], &colours[..latches])?;
    }
    Ok(())
}
