use std::collections::BTreeSet;
use std::path::Path;

use docktwin_core::{DMat3, DQuat, DVec3, Pose};
use urdf_rs::{Joint, JointType};

use crate::Sources;
use crate::keys::FileKind;
use crate::keys::read::{self, Section};
use crate::problem::{Findings, Loaded, ModelErrors, Note, Problem};
use crate::rig::FORCE_SENSORS;
use crate::urdf::{self, UrdfTree};
use crate::{
    DeadZoneLaw, DockingWorkspace, Drive, Leg, LegLimits, LegPart, Offload, Rig, RigSensors,
    RigidMass, SixAxisSensor, Spread,
};
use crate::{load_drive, rig_check};

/// How well poses and axes of the tree must agree with the closures, m and rad: what is lost when
/// numbers are written with nine decimals.
const CLOSURE_M: f64 = 1e-6;

/// Reads a motion simulator: the URDF (joints, masses, limits, the plate in the middle) and the TOML
/// of the same name beside it (loop closures, hydraulics, docking workspace, source of every
/// number). Either file may be named.
///
/// # Errors
/// All problems of both files, and geometry with which the rig cannot work: closures that do not
/// close, strokes that do not reach, joints in one place, legs that cross, singular poses.
pub fn load_rig(path: &Path) -> Result<Loaded<Rig>, ModelErrors> {
    load_rig_from(&Sources::disk(), path)
}

/// As [`load_rig`], from files in memory too.
///
/// # Errors
/// As [`load_rig`].
pub fn load_rig_from(sources: &Sources, path: &Path) -> Result<Loaded<Rig>, ModelErrors> {
    let mut out = Findings::from(sources);
    let rig = read_rig(&path.with_extension("urdf"), &mut out);
    let flags = core::mem::take(&mut out.flags);
    out.notes.extend(flags);
    out.finish(rig)
}

/// One row of the closure list.
struct Closure {
    rod: String,
    rod_point_m: DVec3,
    plate_point_m: DVec3,
}

/// What the TOML says.
struct Said {
    ground: String,
    rack: String,
    active: String,
    plate: String,
    passive: String,
    gravity_m_s2: DVec3,
    closures: Vec<Closure>,
    ball_limit_rad: f64,
    docking: DockingWorkspace,
    dead_length_m: f64,
    radius_m: f64,
    length_error_m: f64,
    drive: Drive,
    sensors: Option<RigSensors>,
    offload: Option<Offload>,
    spread: Spread,
}

pub(crate) fn read_rig(urdf_path: &Path, out: &mut Findings) -> Option<Rig> {
    let start = out.problems.len();
    let urdf_text = out.read(urdf_path, "rig URDF");
    let toml_path = urdf_path.with_extension("toml");
    let toml_text = out.read(&toml_path, "TOML beside the URDF");
    let tree = urdf_text.and_then(|text| urdf::read(urdf_path, &text, true, out));
    let toml_text = toml_text?;
    let checker = FileKind::Rig.checker(&toml_path, &toml_text);
    let said = read::read(&checker, FileKind::Rig, |t| read_toml(t, tree.as_ref()));
    let (problems, values) = checker.finish();
    out.problems.extend(problems);
    out.values.extend(values);
    let (tree, said) = (tree?, said?);
    // The tree can be put together from right names and points, whatever else is wrong.
    let names = [&said.ground, &said.rack, &said.active, &said.plate, &said.passive];
    let known = |name: &String| tree.links.contains_key(name);
    let whole = said.closures.len() == 6
        && names.into_iter().all(known)
        && said
            .closures
            .iter()
            .all(|c| known(&c.rod) && c.rod_point_m.is_finite() && c.plate_point_m.is_finite());
    if !whole {
        return None;
    }
    let rig = Assembly { urdf_path, toml_path: &toml_path, tree: &tree, out }.put(said)?;
    // Geometry of wrong numbers means nothing.
    if out.problems.len() == start {
        rig_check::check(&rig, urdf_path, &toml_path, out);
    }
    Some(rig)
}

// The TOML -------------------------------------------------------------------------------------

fn read_toml(t: Section<'_, '_, '_>, tree: Option<&UrdfTree>) -> Said {
    let names: BTreeSet<String> =
        tree.map(|tree| tree.links.keys().cloned().collect()).unwrap_or_default();
    let link = |t: Section<'_, '_, '_>, key: &'static str| {
        let name = t.text(key);
        if tree.is_some() && !name.is_empty() && !names.contains(&name) {
            let known: Vec<_> = names.iter().map(String::as_str).collect();
            let remedy = format!("name one of {}, or add it to the URDF", known.join(", "));
            t.refuse(key, "is not a link of the URDF", remedy);
        }
        name
    };
    let [ground, rack, active, plate, passive] = t.section("links", |l| {
        ["ground", "rack", "active_mount", "plate", "passive_mount"].map(|key| link(l, key))
    });
    t.section("numbers", |n| n.notes());
    let gravity_m_s2 = t.section("gravity", |g| g.list("gravity_m_s2"));
    let closures = t.sections("closures", |c| Closure {
        rod: link(c, "rod"),
        rod_point_m: DVec3::from_array(c.list("rod_point_m")),
        plate_point_m: DVec3::from_array(c.list("plate_point_m")),
    });
    if closures.len() != 6 {
        t.refuse(
            "closures",
            format!("has {} loops; six rods carry the plate", closures.len()),
            "write six tables [[closures]], one for each rod",
        );
    }
    let docking = t.section("docking_workspace", |d| DockingWorkspace {
        middle_m: DVec3::from_array(d.list("middle_p_34_m")),
        axial_m: d.number("axial_m"),
        lateral_m: d.number("lateral_m"),
        roll_rad: d.number("roll_deg").to_radians(),
        pitch_yaw_rad: d.number("pitch_yaw_deg").to_radians(),
    });
    let [dead_length_m, radius_m, length_error_m, ball_limit_rad] = t.section("legs", |l| {
        [
            l.number("dead_length_m"),
            l.number("radius_m"),
            l.number("length_error_m"),
            l.number("ball_limit_deg").to_radians(),
        ]
    });
    let drive = load_drive::read_drive(t);
    Said {
        ground,
        rack,
        active,
        plate,
        passive,
        gravity_m_s2: DVec3::from_array(gravity_m_s2),
        closures,
        ball_limit_rad,
        docking,
        dead_length_m,
        radius_m,
        length_error_m,
        offload: t.optional_section("offload", read_offload),
        spread: load_drive::read_spread(t, &drive),
        sensors: t.optional_section("sensors", |s| read_sensors(s, &drive)),
        drive,
    }
}

fn read_offload(t: Section<'_, '_, '_>) -> Offload {
    Offload {
        share: t.number("share"),
        friction_n: t.number("friction_n"),
        added_mass_kg: t.number("added_mass_kg"),
        stiffness_n_m: t.number("stiffness_n_m"),
        damping_ratio: t.number("damping_ratio"),
    }
}

fn read_sensors(t: Section<'_, '_, '_>, drive: &Drive) -> RigSensors {
    let pair = |s: Section<'_, '_, '_>, key: &'static str| s.list(key);
    // What sensors of both kinds have.
    let common = |s: Section<'_, '_, '_>| SixAxisSensor {
        natural_frequency_hz: s.number("natural_frequency_hz"),
        damping_ratio: s.number("damping_ratio"),
        delay_s: s.number("delay_s"),
        delay_spread_s: s.number("delay_spread_s"),
        noise: [0.0; 2],
        drift_per_s: [0.0; 2],
        dead_zone: [0.0; 2],
        dead_zone_law: DeadZoneLaw::Zeroing,
        quantum: [0.0; 2],
        range: [0.0; 2],
        zero_spread: [0.0; 2],
    };
    RigSensors {
        force: t.section("force", |s| SixAxisSensor {
            noise: pair(s, "noise_n_nm"),
            drift_per_s: pair(s, "drift_per_s_n_nm"),
            dead_zone: pair(s, "dead_zone_n_nm"),
            dead_zone_law: s
                .choice("dead_zone_law", &DeadZoneLaw::WORDS)
                .unwrap_or(DeadZoneLaw::Zeroing),
            quantum: pair(s, "quantum_n_nm"),
            range: pair(s, "range_n_nm"),
            zero_spread: pair(s, "zero_spread_n_nm"),
            ..common(s)
        }),
        accelerometer: t.optional_section("accelerometer", |s| SixAxisSensor {
            noise: pair(s, "noise_m_s2_rad_s2"),
            quantum: pair(s, "quantum_m_s2_rad_s2"),
            range: pair(s, "range_m_s2_rad_s2"),
            zero_spread: pair(s, "zero_spread_m_s2_rad_s2"),
            ..common(s)
        }),
        plate_force: t.optional_choice("force_sensors", &FORCE_SENSORS).unwrap_or(true),
        length_noise_m: t.number("length_noise_m"),
        length_quantum_m: t.number("length_quantum_m"),
        pressure_noise_n: match drive.hydraulic() {
            Some(_) => t.number("pressure_noise_n"),
            None => 0.0,
        },
    }
}

// The tree -------------------------------------------------------------------------------------

/// The rig being put together from both files.
struct Assembly<'a> {
    urdf_path: &'a Path,
    toml_path: &'a Path,
    tree: &'a UrdfTree,
    out: &'a mut Findings,
}

impl Assembly<'_> {
    fn refuse(&mut self, tag: &str, name: &str, what: String, remedy: &str) {
        self.out.problems.push(Problem {
            file: self.urdf_path.into(),
            line: self.tree.line(tag, name),
            key: format!("{tag} `{name}`"),
            what,
            remedy: remedy.into(),
            ..Problem::default()
        });
    }

    /// Pose of a link in the ground with the plate in the middle.
    fn pose(&self, link: &str) -> Pose {
        self.tree.links.get(link).copied().unwrap_or_default()
    }

    /// The joint that carries a link, which must be of one kind.
    fn joint_above(&mut self, link: &str, kind: JointType, role: &str) -> Option<Joint> {
        let found = self.tree.robot.joints.iter().find(|j| j.child.link == link).cloned();
        match found {
            Some(j) if j.joint_type == kind => Some(j),
            Some(j) => {
                let what =
                    format!("is {}, but {role} must be {}", word(&j.joint_type), word(&kind));
                self.refuse("joint", &j.name, what, "change the type of the joint");
                None
            }
            None => {
                let what = format!("hangs on no joint, but {role} is expected above it");
                self.refuse("link", link, what, "it is the root: name another link in the TOML");
                None
            }
        }
    }

    /// A link and everything fixed to it, as names.
    fn fixed_below(&self, link: &str) -> BTreeSet<String> {
        let mut found = BTreeSet::from([link.to_owned()]);
        loop {
            let before = found.len();
            for j in &self.tree.robot.joints {
                if urdf::is_fixed(&j.joint_type) && found.contains(&j.parent.link) {
                    found.insert(j.child.link.clone());
                }
            }
            if found.len() == before {
                return found;
            }
        }
    }

    /// Links as one body, seen from the frame at `x` in the ground; `None` when none has mass.
    fn body(&mut self, links: &BTreeSet<String>, x: Pose) -> Option<RigidMass> {
        let tree = self.tree;
        let parts: Vec<_> = tree
            .robot
            .links
            .iter()
            .filter(|l| links.contains(&l.name) && tree.with_inertial.contains(&l.name))
            .map(|l| {
                let x_link = x.inverse() * self.pose(&l.name);
                urdf::mass_of(self.urdf_path, tree, l, x_link, self.out)
            })
            .collect();
        (!parts.is_empty()).then(|| {
            let m = urdf::compose(&parts);
            RigidMass { mass_kg: m.mass_kg, com_m: m.com_m, inertia_kg_m2: m.inertia_kg_m2 }
        })
    }

    fn put(mut self, said: Said) -> Option<Rig> {
        if self.tree.root != said.ground {
            let what = format!("is not the root, which is `{}`", self.tree.root);
            let remedy = "name the root as links.ground, or hang everything on this link";
            self.refuse("link", &said.ground, what, remedy);
            return None;
        }
        self.check_mounts(&said);
        let x_bp = self.pose(&said.plate);
        let x_b0 = self.pose(&said.rack);
        let x_b3 = self.pose(&said.active);
        let x_b4 = self.pose(&said.passive);

        let on_plate = self.fixed_below(&said.plate);
        let plate = self.body(&on_plate, x_bp);
        if plate.is_none() {
            let what = "has no inertial, nor has anything fixed to it".to_owned();
            self.refuse("link", &said.plate, what, "add an inertial with mass and inertia");
        }
        // What counts twice would be reported twice.
        let before = self.out.problems.len();
        let passive_payload = {
            let links = self.fixed_below(&said.passive);
            self.body(&links, x_bp)
        };
        self.out.problems.truncate(before);
        let active_payload = {
            let links = self.fixed_below(&said.active);
            self.body(&links, x_b0)
        };

        let mut used = on_plate;
        used.extend(self.fixed_below(&said.ground));
        let mut legs = Vec::new();
        for (i, closure) in said.closures.iter().enumerate() {
            legs.extend(self.leg(i, closure, &said, x_bp, &mut used));
        }
        let rods: BTreeSet<_> = said.closures.iter().map(|c| c.rod.as_str()).collect();
        if rods.len() < said.closures.len() {
            self.out.refuse(
                self.toml_path,
                "closures",
                "name one rod twice".into(),
                "close every loop once, each with a rod of its own",
            );
        }
        let unused: Vec<_> =
            self.tree.links.keys().filter(|l| !used.contains(*l)).cloned().collect();
        for link in unused {
            let what = "belongs to no leg, nor to the plate, the rack or the ground".to_owned();
            self.refuse("link", &link, what, "fix it to one of them, or remove it");
        }
        self.note_fixed_masses(&said);

        self.check_middle(&said, &(x_b3.inverse() * x_b4));
        let prismatic = self.rod_limits(&said.closures)?;
        let legs = <[Leg; 6]>::try_from(legs).ok()?;
        Some(Rig {
            name: self.tree.robot.name.clone(),
            x_b0,
            x_03: x_b0.inverse() * x_b3,
            x_4p: x_b4.inverse() * x_bp,
            gravity_m_s2: said.gravity_m_s2,
            plate: plate?,
            passive_payload,
            active_payload,
            legs,
            docking: said.docking,
            limits: LegLimits {
                speed_m_s: prismatic.velocity,
                force_n: prismatic.effort,
                dead_length_m: said.dead_length_m,
                radius_m: said.radius_m,
                length_error_m: said.length_error_m,
            },
            drive: said.drive,
            sensors: said.sensors,
            offload: said.offload,
            spread: said.spread,
            digest: self.out.digest(),
        })
    }

    fn check_mounts(&mut self, said: &Said) {
        self.check_fixed(&said.rack, &said.ground, "the rack");
        self.check_fixed(&said.active, &said.rack, "the active mechanism's mount");
        self.check_fixed(&said.passive, &said.plate, "the passive mechanism's mount");
        let floating = self.joint_above(&said.plate, JointType::Floating, "the plate's joint");
        if let Some(j) = floating.filter(|j| j.parent.link != said.ground) {
            let what = format!("hangs on `{}`, not on the ground", j.parent.link);
            self.refuse("joint", &j.name, what, "make the ground its parent");
        }
    }

    /// The tree with its joints at zero has the pose that the docking workspace is about.
    fn check_middle(&mut self, said: &Said, middle: &Pose) {
        let off = (middle.p - said.docking.middle_m).length();
        let turned = middle.q.angle_between(DQuat::IDENTITY);
        if off > CLOSURE_M || turned > CLOSURE_M {
            let remedy = if turned > CLOSURE_M {
                "let the floating joint of the URDF turn the plate until R_34 is not turned, and the loops \
                 close there"
            } else {
                "write this p_34, or move the plate by its floating joint and close the loops there"
            };
            self.out.refuse(
                self.toml_path,
                "docking_workspace.middle_p_34_m",
                format!(
                    "differs from the tree with its joints at zero, where p_34 is [{:.6}, {:.6}, \
                     {:.6}] m and R_34 is turned by {:.6} rad",
                    middle.p.x, middle.p.y, middle.p.z, turned
                ),
                remedy,
            );
        }
    }

    /// Speed and force of the rods, which are the same for all.
    fn rod_limits(&mut self, closures: &[Closure]) -> Option<urdf_rs::JointLimit> {
        let first = closures.first()?;
        let prismatic =
            self.tree.robot.joints.iter().find(|j| j.child.link == first.rod)?.limit.clone();
        for closure in closures {
            let slide = self.tree.robot.joints.iter().find(|j| j.child.link == closure.rod);
            let other = slide.map_or((0.0, 0.0), |j| (j.limit.velocity, j.limit.effort));
            let off = (other.0 - prismatic.velocity).abs() + (other.1 - prismatic.effort).abs();
            if off > 1e-9 {
                let what = format!(
                    "has a rod of other limits ({} m/s, {} N) than `{}` ({} m/s, {} N)",
                    other.0, other.1, first.rod, prismatic.velocity, prismatic.effort
                );
                self.refuse("link", &closure.rod, what, "give all six rods the same limits");
            }
        }
        Some(prismatic)
    }

    fn check_fixed(&mut self, link: &str, to: &str, role: &str) {
        if !self.fixed_below(to).contains(link) {
            let what = format!("is {role}, but is not fixed to `{to}`");
            self.refuse("link", link, what, "join them by fixed joints");
        }
    }

    /// Masses that never move, and are not weighed by a sensor, are not needed.
    fn note_fixed_masses(&mut self, said: &Said) {
        let weighed = self.fixed_below(&said.active);
        for link in self.fixed_below(&said.ground) {
            if self.tree.with_inertial.contains(&link) && !weighed.contains(&link) {
                self.out.notes.push(Note {
                    file: self.urdf_path.into(),
                    line: self.tree.line("link", &link),
                    what: format!(
                        "inertial of link `{link}` is ignored: it is fixed to the ground"
                    ),
                    flagged: false,
                });
            }
        }
    }

    fn leg(
        &mut self,
        i: usize,
        closure: &Closure,
        said: &Said,
        x_bp: Pose,
        used: &mut BTreeSet<String>,
    ) -> Option<Leg> {
        let slide = self.joint_above(&closure.rod, JointType::Prismatic, "a rod's joint")?;
        let cylinder = slide.parent.link.clone();
        let second =
            self.joint_above(&cylinder, JointType::Revolute, "the universal joint's second axis")?;
        let cross = second.parent.link.clone();
        let first =
            self.joint_above(&cross, JointType::Revolute, "the universal joint's first axis")?;
        if first.parent.link != said.ground {
            let what = format!("hangs on `{}`, not on the ground", first.parent.link);
            self.refuse("joint", &first.name, what, "make the ground its parent");
        }
        used.extend([closure.rod.clone(), cylinder.clone(), cross.clone()]);

        // Axes and points in the ground, joints at zero.
        let axis = |link: &str, j: &Joint| {
            (self.pose(link).q * DVec3::from_array(j.axis.xyz.0)).normalize_or_zero()
        };
        let (x, y, z) =
            (axis(&closure.rod, &slide), axis(&cylinder, &second), axis(&cross, &first));
        let base = self.pose(&cross).p;
        self.check_axes([&first, &second, &slide], [x, y, z], self.pose(&cylinder).p - base)?;
        let tip = self.rod_end(i, closure, &x_bp);
        let along = tip - base;
        let length = along.length();
        if length < 0.01 {
            let what = format!("is {length:.4} m long in the middle");
            self.refuse("link", &closure.rod, what, "move its plate joint away from its base");
            return None;
        }
        if (along / length - x).length() > CLOSURE_M {
            self.refuse(
                "joint",
                &slide.name,
                "does not slide along the line from the base joint to the plate joint".into(),
                "turn its axis, or move the joints",
            );
        }
        self.check_limits([&first, &second, &slide]);
        let x_b_leg = Pose::new(base, DQuat::from_mat3(&DMat3::from_cols(x, y, z)).normalize());
        let swing = [&first, &second]
            .iter()
            .flat_map(|j| [-j.limit.lower, j.limit.upper])
            .fold(f64::INFINITY, f64::min);
        let x_tip = Pose::new(tip, x_b_leg.q);
        let cross_body = self.link_body(&cross, x_b_leg)?;
        let cylinder_body = self.link_body(&cylinder, x_b_leg);
        let rod_body = self.link_body(&closure.rod, x_tip);
        if cross_body.com_m.length() > CLOSURE_M {
            self.refuse(
                "link",
                &cross,
                "has its mass centre off the universal joint's centre".into(),
                "put the mass centre of the cross at its joint",
            );
        }
        Some(Leg {
            x_b_leg,
            plate_joint_m: closure.plate_point_m,
            middle_length_m: length,
            shortest_m: length + slide.limit.lower,
            longest_m: length + slide.limit.upper,
            swing_limit_rad: swing,
            ball_limit_rad: said.ball_limit_rad,
            cross_mass_kg: cross_body.mass_kg,
            cross_inertia_kg_m2: cross_body.inertia_kg_m2,
            cylinder: self.part(&cylinder, cylinder_body?, 1.0),
            rod: self.part(&closure.rod, rod_body?, -1.0),
        })
    }

    /// A leg's slide, second and first axis in the ground, joints at zero, which are the X, Y and Z of a
    /// frame; `offset` is the way from its first axis to its second. `None` when one has no direction.
    fn check_axes(
        &mut self,
        [first, second, slide]: [&Joint; 3],
        [x, y, z]: [DVec3; 3],
        offset: DVec3,
    ) -> Option<()> {
        let before = self.out.problems.len();
        for (joint, a) in [(slide, x), (second, y), (first, z)] {
            if !a.is_normalized() {
                let what = "has no axis: its three components are zero".to_owned();
                self.refuse("joint", &joint.name, what, "give the axis a direction");
            }
        }
        if self.out.problems.len() > before {
            return None;
        }
        if offset.length() > CLOSURE_M {
            self.refuse(
                "joint",
                &second.name,
                "its axis does not meet the first axis of the universal joint".into(),
                "give it the origin 0 0 0",
            );
        }
        if (y - z.cross(x)).length() > CLOSURE_M {
            self.refuse(
                "joint",
                &second.name,
                "with its joints at zero the leg's slide, second and first axis are not the X, Y \
                 and Z of a right-handed frame"
                    .into(),
                "make the three axes perpendicular; turn one that points backwards",
            );
        }
        Some(())
    }

    /// The rod's end in the ground, joints at zero, which is where the plate has its joint.
    fn rod_end(&mut self, i: usize, closure: &Closure, x_bp: &Pose) -> DVec3 {
        let tip = self.pose(&closure.rod).transform_point(closure.rod_point_m);
        let on_plate = x_bp.transform_point(closure.plate_point_m);
        let miss = (tip - on_plate).length();
        if miss > CLOSURE_M {
            self.out.refuse(
                self.toml_path,
                &format!("closures.{i}"),
                format!(
                    "does not close: in the middle the rod's point [{:.6}, {:.6}, {:.6}] m and the \
                     plate's point [{:.6}, {:.6}, {:.6}] m, both in the ground, are {:.6} m apart",
                    tip.x, tip.y, tip.z, on_plate.x, on_plate.y, on_plate.z, miss
                ),
                "mend the points, or the origins of the rod's joint and of the plate's",
            );
        }
        tip
    }

    /// Limits of a leg's joints: around the middle, and of the slide with speed and force.
    fn check_limits(&mut self, [first, second, slide]: [&Joint; 3]) {
        for j in [first, second, slide] {
            if !(j.limit.lower < 0.0 && j.limit.upper > 0.0) {
                let what = format!(
                    "has limits {} and {}, between which the middle (0) does not lie",
                    j.limit.lower, j.limit.upper
                );
                self.refuse("joint", &j.name, what, "make lower < 0 < upper");
            }
        }
        if slide.limit.effort <= 0.0 || slide.limit.velocity <= 0.0 {
            let what = format!(
                "has effort {} N and velocity {} m/s",
                slide.limit.effort, slide.limit.velocity
            );
            self.refuse("joint", &slide.name, what, "make both positive");
        }
    }

    fn link_body(&mut self, link: &str, x: Pose) -> Option<RigidMass> {
        let body = self.body(&BTreeSet::from([link.to_owned()]), x);
        if body.is_none() {
            let what = "has no inertial; every part of a leg has mass".to_owned();
            self.refuse("link", link, what, "add an inertial with mass and inertia");
        }
        body
    }

    /// A part of a leg, which must be symmetric about the leg's axis: the equations of a leg's motion
    /// are exact for such parts only.
    fn part(&mut self, link: &str, b: RigidMass, outward: f64) -> LegPart {
        let m = b.inertia_kg_m2;
        let (axial, transverse) = (m.x_axis.x, 0.5 * (m.y_axis.y + m.z_axis.z));
        let off_axis = b.com_m.y.hypot(b.com_m.z);
        let rest = m - DMat3::from_diagonal(DVec3::new(axial, transverse, transverse));
        let largest = rest.to_cols_array().iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        if off_axis > CLOSURE_M || largest > 1e-6 * transverse.abs().max(1.0) {
            self.refuse(
                "link",
                link,
                format!(
                    "is not symmetric about the leg's axis: its mass centre is {off_axis:.6} m off \
                     the axis, its inertia differs by {largest:.6} kg·m² from diag(a, t, t)"
                ),
                "put the mass centre on the axis and make ixx = a, iyy = izz = t, the others 0",
            );
        }
        LegPart {
            mass_kg: b.mass_kg,
            com_m: outward * b.com_m.x,
            axial_kg_m2: axial,
            transverse_kg_m2: transverse,
        }
    }
}

fn word(kind: &JointType) -> String {
    format!("{kind:?}").to_lowercase()
}
