//! Whether a rig can do what its file asks of it, said in terms of its geometry.

use core::f64::consts::TAU;
use std::path::Path;

use docktwin_core::{DVec3, Pose};
use nalgebra::{Matrix6, Vector6};

use crate::problem::{Findings, Note, Problem};
use crate::{DockingWorkspace, Drive, HydraulicDrive, HydraulicPreset, Place, PositionLoop, Rig};

/// Joints nearer to each other than this cannot both be built, m.
const JOINTS_APART_M: f64 = 0.02;

/// Least singular value of the Jacobian, moments over the radius of the plate joints, below which a
/// pose counts as singular. 1 would be legs along the axes; a usable platform has 0.1 to 0.6.
const SINGULAR: f64 = 0.02;

/// Initial conditions of the paper, 3.1: 0.35 m/s along X, 0.10 m/s along Y and Z, 1 deg/s about each.
const DOCKING_SPEED: (f64, f64, f64) = (0.35, 0.10, 1.0);

/// The geometry of a rig at one pose.
pub(crate) struct AtPose {
    lengths_m: [f64; 6],
    /// Rows `[ûᵀ, (r × û)ᵀ]`, about the origin of `ep`, in `eb`.
    jacobian: Matrix6<f64>,
}

pub(crate) fn at(rig: &Rig, x_bp: &Pose) -> AtPose {
    let mut jacobian = Matrix6::zeros();
    let lengths_m = core::array::from_fn(|i| {
        let leg = &rig.legs[i];
        let v = leg.vector(x_bp);
        let u = v.normalize_or_zero();
        let m = (x_bp.q * leg.plate_joint_m).cross(u);
        jacobian.set_row(i, &Vector6::new(u.x, u.y, u.z, m.x, m.y, m.z).transpose());
        v.length()
    });
    AtPose { lengths_m, jacobian }
}

/// Mean distance of the plate joints from their middle, m.
fn plate_radius(rig: &Rig) -> f64 {
    let centre = rig.legs.iter().map(|l| l.plate_joint_m).sum::<DVec3>() / 6.0;
    rig.legs.iter().map(|l| (l.plate_joint_m - centre).length()).sum::<f64>() / 6.0
}

/// Singular values of the Jacobian with moments over the plate's radius: the least one, and on which
/// side of a singular pose this one lies.
fn singularity(rig: &Rig, here: &AtPose) -> (f64, f64) {
    let radius = plate_radius(rig).max(1e-9);
    let mut j = here.jacobian;
    for mut column in j.column_iter_mut().skip(3) {
        column /= radius;
    }
    (j.singular_values().min(), j.determinant().signum())
}

/// Largest angle between gravity and a docking axis along which a balance carries, deg: the force along
/// the axis is then right within 0.02 %.
const OFF_VERTICAL_DEG: f64 = 1.0;
/// Fastest swing of the moving mass of a balance that an emulated rig follows with its steps of
/// 0.125 ms: ω h is 0.4, and the leapfrog moves it by (ω h)²/24, 0.6 %.
const FASTEST_HANGER_HZ: f64 = 500.0;

struct Finder<'a> {
    urdf_path: &'a Path,
    toml_path: &'a Path,
    out: &'a mut Findings,
}

impl Finder<'_> {
    fn refuse(&mut self, key: String, what: String, remedy: &str) {
        self.out.problems.push(Problem {
            file: self.urdf_path.into(),
            key,
            what,
            remedy: remedy.into(),
            ..Problem::default()
        });
    }

    fn flag(&mut self, what: String) {
        self.out.flags.push(Note { file: self.toml_path.into(), line: None, what, flagged: true });
    }
}

pub(crate) fn check(rig: &Rig, urdf_path: &Path, toml_path: &Path, out: &mut Findings) {
    let mut f = Finder { urdf_path, toml_path, out };
    joints_apart(rig, &mut f);
    let usable = singular(rig, &mut f);
    reach(rig, &mut f);
    crossing(rig, &mut f);
    retraction(rig, &mut f);
    if let Some(h) = rig.drive.hydraulic() {
        oil(rig, h, &mut f);
    }
    position_loop(rig, &mut f);
    sensors(rig, &mut f);
    if usable {
        speed_and_force(rig, &mut f);
    }
    gravity(rig, &mut f);
    offload(rig, &mut f);
}

fn joints_apart(rig: &Rig, f: &mut Finder<'_>) {
    for i in 0..6 {
        for j in i + 1..6 {
            let (a, b) = (&rig.legs[i], &rig.legs[j]);
            let base = (a.base_joint_m() - b.base_joint_m()).length();
            let plate = (a.plate_joint_m - b.plate_joint_m).length();
            for (place, apart) in [("base", base), ("plate", plate)] {
                if apart < JOINTS_APART_M {
                    f.refuse(
                        format!("{place} joints of legs {i} and {j}"),
                        format!("are {apart:.4} m apart, which leaves no room for two joints"),
                        "move them apart, at least 0.02 m",
                    );
                }
            }
        }
    }
}

/// Whether no pose is singular.
fn singular(rig: &Rig, f: &mut Finder<'_>) -> bool {
    let middle = singularity(rig, &at(rig, &rig.middle()));
    if middle.0 < SINGULAR {
        f.refuse(
            "plate in the middle".into(),
            format!(
                "the pose is singular: the least singular value of the Jacobian is {:.4}, so there \
                 is a motion of the plate that changes no leg's length",
                middle.0
            ),
            "turn the plate's joint triangle by 60 deg against the base's, the two legs of a corner to different corners",
        );
        return false;
    }
    let mut worst: Option<(f64, Place)> = None;
    let mut beyond = None;
    for place in DockingWorkspace::grid() {
        let x = rig.plate_from_docking(&rig.docking.pose(place.0));
        let (least, side) = singularity(rig, &at(rig, &x));
        if side * middle.1 < 0.0 {
            beyond.get_or_insert(place);
        }
        if worst.is_none_or(|w| least < w.0) {
            worst = Some((least, place));
        }
    }
    if let Some(place) = beyond {
        f.refuse(
            format!("docking workspace at {place}"),
            "lies beyond a singular pose: on the way from the middle the legs lose control of the \
             plate"
                .into(),
            "make the workspace smaller or the platform larger",
        );
        return false;
    }
    if let Some((least, place)) = worst.filter(|w| w.0 < SINGULAR) {
        f.refuse(
            format!("docking workspace at {place}"),
            format!("is singular: the least singular value of the Jacobian is {least:.4}"),
            "make the workspace smaller or the platform larger",
        );
        return false;
    }
    true
}

/// One line per leg and kind of limit, at the place where it is worst.
fn reach(rig: &Rig, f: &mut Finder<'_>) {
    let middle = rig.middle();
    for (i, leg) in rig.legs.iter().enumerate() {
        let mut short = (0.0, 0.0, Place([0.0; 6]), 0_u32);
        let mut long = short;
        let mut swing = short;
        let mut ball = short;
        for place in DockingWorkspace::grid() {
            let x = rig.plate_from_docking(&rig.docking.pose(place.0));
            let v = leg.vector(&x);
            let length = v.length();
            let [q1, q2] = leg.universal_angles(v);
            let angle = q1.abs().max(q2.abs());
            let tilt = leg.ball_angle(&x, &middle, v);
            for (worst, by, value) in [
                (&mut short, leg.shortest_m - length, length),
                (&mut long, length - leg.longest_m, length),
                (&mut swing, angle - leg.swing_limit_rad, angle),
                (&mut ball, tilt - leg.ball_limit_rad, tilt),
            ] {
                if by > 0.0 {
                    worst.3 += 1;
                }
                if by > worst.0 {
                    (worst.0, worst.1, worst.2) = (by, value, place);
                }
            }
        }
        let count = |n: u32| format!("{n} of 729 places checked are out of reach for it");
        if short.3 > 0 {
            f.refuse(
                format!("stroke of leg {i}"),
                format!(
                    "does not reach the docking workspace: at {} it must be {:.4} m long and cannot \
                     be shorter than {:.4} m, {:.4} m short; {}",
                    short.2, short.1, leg.shortest_m, short.0, count(short.3)
                ),
                "lower the limit of its rod, or make the workspace smaller",
            );
        }
        if long.3 > 0 {
            f.refuse(
                format!("stroke of leg {i}"),
                format!(
                    "does not reach the docking workspace: at {} it must be {:.4} m long and cannot \
                     be longer than {:.4} m, {:.4} m short; {}",
                    long.2, long.1, leg.longest_m, long.0, count(long.3)
                ),
                "raise the limit of its rod, or make the workspace smaller",
            );
        }
        for (name, worst, limit) in [
            ("universal joint", swing, leg.swing_limit_rad),
            ("spherical joint", ball, leg.ball_limit_rad),
        ] {
            if worst.3 > 0 {
                f.refuse(
                    format!("{name} of leg {i}"),
                    format!(
                        "does not turn far enough for the docking workspace: at {} it must turn by \
                         {:.2} deg of at most {:.2} deg; {}",
                        worst.2,
                        worst.1.to_degrees(),
                        limit.to_degrees(),
                        count(worst.3)
                    ),
                    "raise the limit of the joint, or make the workspace smaller",
                );
            }
        }
    }
}

/// Least distance between two segments, m.
pub(crate) fn segment_distance(p: [DVec3; 2], q: [DVec3; 2]) -> f64 {
    // Minimum over both parameters by clamping in turn; convex, so three sweeps settle it unless the
    // segments are parallel, where any pair of parameters on the common part is as good.
    let (d1, d2, r) = (p[1] - p[0], q[1] - q[0], p[0] - q[0]);
    let (a, e, b) = (d1.length_squared(), d2.length_squared(), d1.dot(d2));
    let (c, g) = (d1.dot(r), d2.dot(r));
    let denominator = a * e - b * b;
    let mut s = if denominator > 1e-12 * a * e {
        ((b * g - c * e) / denominator).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let mut t = 0.0;
    for _ in 0..3 {
        t = ((b * s + g) / e).clamp(0.0, 1.0);
        s = ((b * t - c) / a).clamp(0.0, 1.0);
    }
    (r + d1 * s - d2 * t).length()
}

fn crossing(rig: &Rig, f: &mut Finder<'_>) {
    let room = 2.0 * rig.limits.radius_m;
    for i in 0..6 {
        for j in i + 1..6 {
            let mut worst = (f64::INFINITY, Place([0.0; 6]));
            for place in DockingWorkspace::grid() {
                let x = rig.plate_from_docking(&rig.docking.pose(place.0));
                let ends = [i, j].map(|k| {
                    let leg = &rig.legs[k];
                    [leg.base_joint_m(), x.transform_point(leg.plate_joint_m)]
                });
                let apart = segment_distance(ends[0], ends[1]);
                if apart < worst.0 {
                    worst = (apart, place);
                }
            }
            if worst.0 < room {
                f.refuse(
                    format!("legs {i} and {j}"),
                    format!(
                        "cross: at {} their axes come within {:.4} m of each other, and each is \
                         {:.4} m thick",
                        worst.1, worst.0, room
                    ),
                    "exchange their plate joints, or move the joints apart",
                );
            }
        }
    }
}

fn retraction(rig: &Rig, f: &mut Finder<'_>) {
    for (i, leg) in rig.legs.iter().enumerate() {
        let stroke = leg.longest_m - leg.shortest_m;
        let needed = stroke + rig.limits.dead_length_m;
        if leg.shortest_m < needed {
            f.refuse(
                format!("stroke of leg {i}"),
                format!(
                    "does not fit into the retracted leg: a stroke of {stroke:.4} m and {:.4} m of \
                     dead length need {needed:.4} m, and the shortest leg is {:.4} m long",
                    rig.limits.dead_length_m, leg.shortest_m
                ),
                "make the stroke shorter",
            );
        }
    }
}

fn oil(rig: &Rig, drive: &HydraulicDrive, f: &mut Finder<'_>) {
    let stroke = rig.legs.iter().map(|l| l.longest_m - l.shortest_m).fold(0.0_f64, f64::max);
    let h = &drive.hydraulics;
    let needed = h.area_m2 * stroke + h.dead_volume_m3;
    for (word, preset) in HydraulicPreset::WORDS {
        let v = drive.leg(preset).total_volume_m3;
        let fits = ((v - h.dead_volume_m3) / h.area_m2).max(0.0);
        if v < 0.9 * needed || v > 1.25 * needed {
            f.flag(format!(
                "hydraulics.{word}.total_volume_m3 = {v} m³ does not belong to the stroke: {:.4} m² \
                 over {stroke:.3} m and {:.4} m³ of dead volume make {needed:.4} m³; {v} m³ would be \
                 {fits:.2} m of stroke",
                h.area_m2, h.dead_volume_m3
            ));
        }
    }
}

fn speed_and_force(rig: &Rig, f: &mut Finder<'_>) {
    let (axial, lateral, rate) = DOCKING_SPEED;
    let rate = rate.to_radians();
    let e3 = (rig.x_b0 * rig.x_03).q;
    let weight = rig.plate.mass_kg * rig.gravity_m_s2;
    let mut fastest = (0.0, Place([0.0; 6]));
    let mut strongest = fastest;
    for place in DockingWorkspace::grid() {
        let x = rig.plate_from_docking(&rig.docking.pose(place.0));
        let here = at(rig, &x);
        // Speed of e4 and rate about it, taken to the origin of ep: v_p = v_4 + ω × p_4p.
        let arm = x.q * (rig.x_4p.q.conjugate() * rig.x_4p.p);
        for leg in 0..6 {
            let row = here.jacobian.row(leg);
            let u = DVec3::new(row[0], row[1], row[2]);
            let m = DVec3::new(row[3], row[4], row[5]) + arm.cross(u);
            let (u, m) = ((e3.conjugate() * u).abs(), (e3.conjugate() * m).abs());
            // The worst signs at once.
            let speed = axial * u.x + lateral * (u.y + u.z) + rate * m.element_sum();
            if speed > fastest.0 {
                fastest = (speed, place);
            }
        }
        let moment = (x.q * rig.plate.com_m).cross(weight);
        let w = -Vector6::new(weight.x, weight.y, weight.z, moment.x, moment.y, moment.z);
        if let Some(forces) = here.jacobian.transpose().lu().solve(&w) {
            let largest = forces.amax();
            if largest > strongest.0 {
                strongest = (largest, place);
            }
        }
    }
    let limit = rig.limits.speed_m_s;
    if fastest.0 > limit {
        f.flag(format!(
            "leg_speed_m_s = {limit} m/s is below the {:.3} m/s that docking at {axial} m/s along X, \
             {lateral} m/s sideways and {} deg/s needs at {}",
            fastest.0,
            rate.to_degrees(),
            fastest.1
        ));
    }
    if let Some(h) = rig.drive.hydraulic() {
        no_load_speed(h, limit, f);
    }
    if strongest.0 > rig.limits.force_n {
        f.refuse(
            "effort of the rods".into(),
            format!(
                "{:.0} N do not carry the plate of {} kg: at {} a leg must bear {:.0} N at rest",
                rig.limits.force_n, rig.plate.mass_kg, strongest.1, strongest.0
            ),
            "raise the effort, or make the plate lighter",
        );
    }
    if let Some(h) = rig.drive.hydraulic() {
        supply(h, rig.limits.force_n, f);
    }
}

fn no_load_speed(h: &HydraulicDrive, limit: f64, f: &mut Finder<'_>) {
    let no_load = h.valve.no_load_flow_m3_s / h.hydraulics.area_m2;
    if no_load < limit {
        f.flag(format!(
            "valve.no_load_flow_m3_s = {} m³/s moves {} m² at {no_load:.3} m/s at most, below the \
             limit of {limit} m/s",
            h.valve.no_load_flow_m3_s, h.hydraulics.area_m2
        ));
    }
}

fn supply(h: &HydraulicDrive, force_n: f64, f: &mut Finder<'_>) {
    let push = h.valve.supply_pressure_pa * h.hydraulics.area_m2;
    if push < force_n {
        f.flag(format!(
            "the supply of {:.0} Pa on {} m² pushes with {push:.0} N at most, below the limit of \
             {force_n:.0} N",
            h.valve.supply_pressure_pa, h.hydraulics.area_m2
        ));
    }
}

/// Frequency up to which a rig has to follow dockings, Hz, and the response that the paper asks for at 10 Hz.
const DOCKINGS_HZ: f64 = 5.0;
const PAPER: (f64, f64, f64) = (10.0, 2.0, 70.0);

fn position_loop(rig: &Rig, f: &mut Finder<'_>) {
    let Some(l) = rig.drive.position_loop() else { return };
    let (hz, db, deg) = PAPER;
    let g = l.response(hz);
    let gain_db = 20.0 * g.norm().log10();
    // The argument alone would lose whole turns.
    let late_deg = 360.0 * hz * l.delay_s + pole_lag_deg(l, hz);
    if gain_db.abs() > db || late_deg > deg {
        f.flag(format!(
            "the legs are {gain_db:+.1} dB and {late_deg:.0} deg late at {hz} Hz; the paper asks for \
             {db} dB and {deg} deg, and a docking without compensation of this delay gains energy"
        ));
    }
    if let Some(most) = l.acceleration_m_s2 {
        let needed = DOCKINGS_HZ * TAU * DOCKING_SPEED.1;
        if most < needed {
            f.flag(format!(
                "drive.acceleration_m_s2 = {most} m/s² is below the {needed:.1} m/s² of {} m/s at \
                 {DOCKINGS_HZ} Hz",
                DOCKING_SPEED.1
            ));
        }
    }
}

/// Lag of the poles of a loop, deg.
fn pole_lag_deg(l: &PositionLoop, hz: f64) -> f64 {
    let without_delay = PositionLoop { delay_s: 0.0, ..*l };
    -without_delay.response(hz).arg().to_degrees()
}

/// Accelerometers take off what the load on sensor B does: without that sensor they are of no use.
fn sensors(rig: &Rig, f: &mut Finder<'_>) {
    let Some(s) = rig.sensors else { return };
    if !s.plate_force && s.accelerometer.is_some() {
        f.flag(
            "sensors.accelerometer is used with sensor B alone, and sensors.force_sensors says there is none"
                .to_owned(),
        );
    }
}

fn gravity(rig: &Rig, f: &mut Finder<'_>) {
    let g = rig.gravity_in_e3_m_s2();
    if g.y.hypot(g.z) > 1e-3 * g.length() {
        f.flag(format!(
            "gravity does not lie along the docking axis: [{:.3}, {:.3}, {:.3}] m/s² in e3",
            g.x, g.y, g.z
        ));
    }
}

fn offload(rig: &Rig, f: &mut Finder<'_>) {
    let Some(o) = rig.offload else { return };
    let off = rig.axis_off_vertical_rad().to_degrees();
    if rig.gravity_m_s2.length() < 1e-6 {
        f.out.refuse(
            f.toml_path,
            "offload",
            "has nothing to carry: gravity.gravity_m_s2 is zero".into(),
            "remove [offload], or give gravity",
        );
    } else if off > OFF_VERTICAL_DEG {
        f.out.refuse(
            f.toml_path,
            "offload",
            format!(
                "carries along a vertical docking axis only, and gravity lies {off:.1} deg off this one"
            ),
            "turn the docking axis into the vertical, or remove [offload]",
        );
    }
    let hz = o.hanger_hz();
    if hz > FASTEST_HANGER_HZ {
        f.out.refuse(
            f.toml_path,
            "offload.stiffness_n_m",
            format!(
                "lets {} kg swing on the hanger at {hz:.0} Hz, which an emulated rig cannot follow; at \
                 most {FASTEST_HANGER_HZ:.0} Hz",
                o.added_mass_kg
            ),
            "lower the stiffness, or make the added mass 0, which takes the hanger's stiffness into its \
             friction",
        );
    }
}

/// What follows from a right rig, as lines for people.
pub(crate) fn summary(rig: &Rig) -> Vec<String> {
    let mut lengths = (f64::INFINITY, 0.0_f64);
    let mut margin = (f64::INFINITY, 0, Place([0.0; 6]));
    let mut least = (f64::INFINITY, Place([0.0; 6]));
    for place in DockingWorkspace::grid() {
        let x = rig.plate_from_docking(&rig.docking.pose(place.0));
        let here = at(rig, &x);
        for (i, (leg, l)) in rig.legs.iter().zip(here.lengths_m).enumerate() {
            lengths = (lengths.0.min(l), lengths.1.max(l));
            let room = (l - leg.shortest_m).min(leg.longest_m - l);
            if room < margin.0 {
                margin = (room, i, place);
            }
        }
        let s = singularity(rig, &here).0;
        if s < least.0 {
            least = (s, place);
        }
    }
    let middle = singularity(rig, &at(rig, &rig.middle())).0;
    let mut lines = vec![
        format!("leg length over the docking workspace = {:.4} to {:.4} m", lengths.0, lengths.1),
        format!("least stroke margin = {:.4} m (leg {}, {})", margin.0, margin.1, margin.2),
        format!(
            "least singular value, moments over the plate radius = {middle:.4} in the middle, {:.4} \
             at {}",
            least.0, least.1
        ),
    ];
    let presets = HydraulicPreset::WORDS.into_iter();
    for (word, h) in presets.filter_map(|(w, p)| Some((w, rig.leg_hydraulics(p)?))) {
        lines.push(format!(
            "oil spring, {word} = {:.4e} N/m, {:.1} Hz with the plate's mass on one leg",
            h.oil_spring_n_m(),
            h.natural_frequency_hz(rig.plate.mass_kg)
        ));
    }
    lines.extend(drive_lines(rig));
    lines.push(match rig.offload {
        None => "offload = none: the ring's whole weight lies on the mechanism".to_owned(),
        Some(o) => format!(
            "offload = {:.1} % of the ring's weight, {} N of friction, {} kg more to move, hanger at {:.1} Hz",
            100.0 * o.share,
            o.friction_n,
            o.added_mass_kg,
            o.hanger_hz()
        ),
    });
    lines
}

/// What moves the legs, where that is a position loop, and which sensors there are.
fn drive_lines(rig: &Rig) -> Vec<String> {
    let mut lines = match &rig.drive {
        Drive::Hydraulic(_) => return Vec::new(),
        Drive::PositionLoop(l) => vec![format!("position loop = {}", l.words())],
        Drive::Measured(m) => vec![
            format!("measured drive = {} points of a response", m.response.len()),
            format!(
                "position loop fitted to them = {}; at most {:.3} % off",
                m.fitted.words(),
                100.0 * m.residual
            ),
        ],
    };
    if let Some(s) = rig.sensors {
        let force = if s.plate_force { "rack (A) and plate (B)" } else { "rack (A)" };
        lines.push(format!("force sensors = {force}"));
    }
    lines
}
