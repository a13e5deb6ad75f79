//! The recording of a motion simulator.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use docktwin_core::{DVec3, Pose, SimTime};
use docktwin_model::{DockingWorkspace, Leg, Rig};
use re_sdk_types::archetypes::{LineStrips3D, Mesh3D, Points3D, SeriesLines};
use re_sdk_types::components::Radius;

use crate::columns::{Curves, Legs, Points, Poses, Texts};
use crate::mesh::{Mesh, f32x3};
use crate::scene::{log_mesh, transform};
use crate::stream::{Sent, Stream};
use crate::{ViewError, blueprint, paths, style};

/// Legs in plots.
const LEGS: [u32; 6] =
    [0xF0_74_38_FF, 0xF2_D0_3A_FF, 0x62_F0_8C_FF, 0x4F_E8_F0_FF, 0x6A_9C_FF_FF, 0xD0_70_F0_FF];
const CYLINDER: u32 = 0x9A_A0_AA_FF;
const FLOOR: u32 = 0x6A_70_78_FF;
/// A sign for a mechanism: rig files do not say its size. m
const PORT_RADIUS_M: f64 = 0.65;
/// Room to the end of a stroke, as a share of half the stroke, below which a leg is drawn in red.
const SHORT: f64 = 0.1;

/// Writes the recording of a motion simulator, in its ground frame `eb`.
pub struct RigWriter {
    rec: Stream,
    path: PathBuf,
    rig: Rig,
    plate: Poses,
    cylinders: Legs,
    rods: Legs,
    way: Points,
    room: Curves,
    force: Curves,
    text: Texts,
}

/// The room a leg of this length has to its nearer end, m.
fn room_m(leg: &Leg, length_m: f64) -> f64 {
    (length_m - leg.shortest_m).min(leg.longest_m - length_m)
}

/// Green in the middle of the stroke, yellow half way to an end, red at it.
fn stroke_colour(leg: &Leg, room_m: f64) -> u32 {
    let share = room_m / (0.5 * (leg.longest_m - leg.shortest_m));
    let mix = |a: [f64; 3], b: [f64; 3], t: f64| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a colour, 0 to 255"
        )]
        let byte = |i: usize| (a[i] + (b[i] - a[i]) * t.clamp(0.0, 1.0)) as u8;
        u32::from_be_bytes([byte(0), byte(1), byte(2), 0xFF])
    };
    let (red, yellow, green) = ([240.0, 60.0, 60.0], [242.0, 208.0, 58.0], [70.0, 210.0, 110.0]);
    if share < 0.5 {
        mix(red, yellow, (share - SHORT) / (0.5 - SHORT))
    } else {
        mix(yellow, green, 2.0 * (share - 0.5))
    }
}

impl RigWriter {
    /// Starts the recording and writes what stands still. `reach_m` tells how far the origin of `e4`
    /// gets from the middle of the docking workspace in a direction of `e3`, the attitude that of the
    /// middle. An existing file is replaced.
    ///
    /// # Errors
    /// [`ViewError::Create`] when the file cannot be made, [`ViewError::Encode`] when rerun refuses a
    /// part of the scene.
    pub fn create(
        path: &Path,
        rig: &Rig,
        reach_m: impl Fn(DVec3) -> f64,
    ) -> Result<Self, ViewError> {
        let rec = Stream::create(path, &rig.name)?;
        let middle = rig.middle();
        let reach = rig.legs.iter().map(|l| l.base_joint_m().length()).fold(1.0, f64::max);
        let target = 0.5 * middle.p + DVec3::X * 0.3 * reach;
        let eye = target + DVec3::new(0.55, -1.5, 0.9) * reach;
        let write = || -> Sent {
            blueprint::send(&rec, &blueprint::rig(eye, target))?;
            log_static(&rec, rig, &reach_m)
        };
        write().map_err(|e| ViewError::encode(paths::RIG, e))?;
        Ok(Self {
            rec,
            path: path.to_owned(),
            rig: rig.clone(),
            plate: Poses::default(),
            cylinders: Legs::default(),
            rods: Legs::default(),
            way: Points::default(),
            room: Curves::default(),
            force: Curves::default(),
            text: Texts::default(),
        })
    }

    /// Records one instant: the plate at `X_bp`, and the force of every leg, N, pushing positive, where
    /// it is known.
    ///
    /// # Errors
    /// [`ViewError::Frame`] when the pose or a force is not finite, or the time is beyond what the
    /// viewer can show.
    pub fn frame(
        &mut self,
        time: SimTime,
        x_bp: &Pose,
        forces_n: Option<[f64; 6]>,
    ) -> Result<(), ViewError> {
        let mut problems = Vec::new();
        if !x_bp.is_finite() {
            problems.push(format!("x_bp: {:?} m, {:?} is not finite", x_bp.p, x_bp.q));
        }
        if let Some(f) = forces_n.filter(|f| f.iter().any(|f| !f.is_finite())) {
            problems.push(format!("forces_n: {f:?} N is not finite"));
        }
        let Ok(at) = i64::try_from(time.nanos()) else {
            problems.push(format!(
                "time: {} ns, the viewer shows up to {}",
                time.nanos(),
                i64::MAX
            ));
            return Err(ViewError::Frame { time_s: time.seconds(), problems });
        };
        if !problems.is_empty() {
            return Err(ViewError::Frame { time_s: time.seconds(), problems });
        }
        let legs = self.rig.legs.map(|leg| (leg, leg.vector(x_bp)));
        self.plate.push(at, x_bp);
        self.cylinders.push(
            at,
            legs.iter().map(|(leg, v)| {
                let base = leg.base_joint_m();
                ([base, base + v.normalize_or_zero() * leg.shortest_m], CYLINDER)
            }),
        );
        self.rods.push(
            at,
            legs.iter().map(|(leg, v)| {
                // Out of the cylinder as far as it is drawn.
                let base = leg.base_joint_m();
                let gland = base + v.normalize_or_zero() * leg.shortest_m;
                ([gland, base + *v], stroke_colour(leg, room_m(leg, v.length())))
            }),
        );
        let port = *x_bp * self.rig.x_4p.inverse();
        self.way.push(at, &[f32x3(port.p)], &[style::PASSIVE]);
        let rooms = legs.map(|(leg, v)| room_m(&leg, v.length()));
        self.room.push(at, &rooms);
        if let Some(f) = forces_n {
            self.force.push(at, &f.map(|f| 1e-3 * f));
        }
        self.text.push(at, "", self.state(x_bp, &rooms, forces_n));
        Ok(())
    }

    /// Where the plate is, in words.
    fn state(&self, x_bp: &Pose, rooms: &[f64; 6], forces_n: Option<[f64; 6]>) -> String {
        let x_34 = self.rig.docking_from_plate(x_bp);
        let turn = x_34.q.to_scaled_axis().length().to_degrees();
        let mut t = format!(
            "Passive mounting plane e4 at ({:.3}, {:.3}, {:.3}) m in e3, turned by {turn:.1}°.\n\n\
             | leg | length m | room to its end m | force kN |\n|---|---|---|---|\n",
            x_34.p.x, x_34.p.y, x_34.p.z
        );
        for (i, (leg, room)) in self.rig.legs.iter().zip(rooms).enumerate() {
            let force = forces_n.map_or("–".to_owned(), |f| format!("{:.2}", 1e-3 * f[i]));
            // Writing to a string cannot fail.
            let _ = writeln!(
                t,
                "| {i} | {:.3} | {room:.3}{} | {force} |",
                leg.vector(x_bp).length(),
                if *room < 0.0 { " **out of reach**" } else { "" }
            );
        }
        t.push_str("\nRods: green in the middle of the stroke, red at its end.\n");
        t
    }

    /// Writes what was gathered and closes the file.
    ///
    /// # Errors
    /// [`ViewError::Encode`] when rerun refuses the data, [`ViewError::Write`] when the file cannot be
    /// written.
    pub fn finish(mut self) -> Result<(), ViewError> {
        let rec = &self.rec;
        self.plate.send(rec, paths::RIG_PLATE)?;
        self.cylinders.send(rec, paths::RIG_CYLINDERS, 0.11)?;
        self.rods.send(rec, paths::RIG_RODS, 0.06)?;
        self.way.send(rec, paths::RIG_WAY, Radius::new_scene_units(0.04))?;
        self.room.send(rec, paths::RIG_ROOM)?;
        self.force.send(rec, paths::RIG_FORCE)?;
        self.text.send_markdown(rec, paths::RIG_TEXT)?;
        self.rec.close(&self.path)
    }
}

fn log_static(rec: &Stream, rig: &Rig, reach_m: &impl Fn(DVec3) -> f64) -> Sent {
    let x_b3 = rig.x_b0 * rig.x_03;
    let disc = |thickness: f64| {
        let r = PORT_RADIUS_M;
        Mesh::revolution(&[[0.0, 0.0], [0.0, r], [-thickness, r], [-thickness, 0.0]])
    };
    // Ground: the ring of base joints and the rack with the plane of the active mechanism.
    let bases = rig.legs.map(|l| f32x3(l.base_joint_m()));
    let around = bases.into_iter().chain([bases[0]]);
    lines(rec, "rig/base", vec![around.collect()], FLOOR, 0.03)?;
    rec.log_static(
        "rig/base/joints",
        &Points3D::new(bases)
            .with_radii([Radius::new_scene_units(0.12)])
            .with_colors([FLOOR])
            .with_labels((0..6).map(|i| format!("leg {i}"))),
    )?;
    rec.log_static("rig/rack", &transform(&x_b3))?;
    log_mesh(rec, "rig/rack/plane", disc(x_b3.p.x.abs().max(0.05)), style::ACTIVE)?;
    // Plate: its joints, and the adapter down to the plane of the passive mechanism.
    let joints = rig.legs.map(|l| f32x3(l.plate_joint_m));
    let around = joints.into_iter().chain([joints[0]]);
    lines(rec, "rig/plate/joints", vec![around.collect()], style::PASSIVE, 0.05)?;
    let x_p4 = rig.x_4p.inverse();
    rec.log_static("rig/plate/port", &transform(&x_p4))?;
    let adapter = Mesh::revolution(&[
        [-x_p4.p.x, 0.0],
        [-x_p4.p.x, 1.6 * PORT_RADIUS_M],
        [0.0, PORT_RADIUS_M],
        [0.0, 0.0],
    ]);
    log_mesh(rec, "rig/plate/port/adapter", adapter, style::faded(style::PASSIVE, 0x60))?;
    // Where e4's origin gets, and where dockings want it.
    let middle = x_b3 * Pose::new(rig.docking.middle_m, docktwin_core::DQuat::IDENTITY);
    rec.log_static(paths::RIG_REACHABLE, &transform(&middle))?;
    let hull = Mesh::star(reach_m);
    rec.log_static(
        "rig/reachable/hull",
        &Mesh3D::new(hull.positions)
            .with_vertex_normals(hull.normals)
            .with_triangle_indices(hull.triangles)
            .with_albedo_factor(style::faded(style::TEXT, 0x18)),
    )?;
    rec.log_static(paths::RIG_DOCKING, &transform(&middle))?;
    lines(rec, "rig/docking_workspace/box", edges(&rig.docking), 0xF2_D0_3A_FF, 0.012)?;

    for path in [paths::RIG_ROOM, paths::RIG_FORCE] {
        rec.log_static(
            path,
            &SeriesLines::new()
                .with_names((0..6).map(|i| format!("leg {i}")))
                .with_colors(LEGS)
                .with_widths([1.5; 6]),
        )?;
    }
    Ok(())
}

fn lines(rec: &Stream, path: &str, strips: Vec<Vec<[f32; 3]>>, colour: u32, radius_m: f32) -> Sent {
    let strips = LineStrips3D::new(strips)
        .with_radii([Radius::new_scene_units(radius_m)])
        .with_colors([colour]);
    rec.log_static(path, &strips)
}

/// The twelve edges of the box of positions, about its middle.
fn edges(w: &DockingWorkspace) -> Vec<Vec<[f32; 3]>> {
    let half = DVec3::new(w.axial_m, w.lateral_m, w.lateral_m);
    let corner = |n: usize| {
        let sign = |i: usize| if n >> i & 1 == 1 { 1.0 } else { -1.0 };
        f32x3(half * DVec3::new(sign(0), sign(1), sign(2)))
    };
    (0..8)
        .flat_map(|n| (0..3).filter(move |i| n >> i & 1 == 0).map(move |i| (n, n | 1 << i)))
        .map(|(a, b)| vec![corner(a), corner(b)])
        .collect()
}
