use std::path::Path;

use docktwin_core::Pose;

use crate::keys::{FileKind, read};
use crate::problem::{Findings, Loaded, ModelErrors, Problem};
use crate::spacecraft_check::Body;
use crate::urdf::{self, UrdfTree};
use crate::{Sources, Spacecraft, SpacecraftHull};

/// Reads a spacecraft: the URDF (masses, placements) and the TOML of the same name beside it (which
/// link is the port, hull, source of every number).
///
/// The body frame of the result stands at the mass centre with the axes of the root link.
///
/// # Errors
/// All problems of both files.
pub fn load_spacecraft(urdf_path: &Path) -> Result<Loaded<Spacecraft>, ModelErrors> {
    load_spacecraft_from(&Sources::disk(), urdf_path)
}

/// As [`load_spacecraft`], from files in memory too.
///
/// # Errors
/// All problems of both files.
pub fn load_spacecraft_from(
    sources: &Sources,
    urdf_path: &Path,
) -> Result<Loaded<Spacecraft>, ModelErrors> {
    let mut out = Findings::from(sources);
    let read = read_spacecraft(urdf_path, true, &mut out);
    let flags = core::mem::take(&mut out.flags);
    out.notes.extend(flags);
    out.finish(read.map(|r| r.spacecraft))
}

/// A spacecraft as its files describe it.
pub(crate) struct ReadSpacecraft {
    pub(crate) spacecraft: Spacecraft,
    pub(crate) hull: SpacecraftHull,
    /// What was read, as a person would check it.
    pub(crate) lines: Vec<String>,
}

pub(crate) fn read_spacecraft(
    urdf_path: &Path,
    meshes: bool,
    out: &mut Findings,
) -> Option<ReadSpacecraft> {
    let urdf_text = out.read(urdf_path, "spacecraft URDF");
    let toml_path = urdf_path.with_extension("toml");
    let toml_text = out.read(&toml_path, "TOML beside the URDF");
    let tree = urdf_text.and_then(|text| urdf::read(urdf_path, &text, meshes, out));
    let toml_text = toml_text?;

    let checker = FileKind::Spacecraft.checker(&toml_path, &toml_text);
    let said = read::read(&checker, FileKind::Spacecraft, |t| {
        let port_link = t.text("port_link");
        if let Some(tree) = &tree
            && !port_link.is_empty()
            && !tree.links.contains_key(&port_link)
        {
            let names = urdf::list(tree.links.keys().map(String::as_str));
            let remedy = format!("name one of {names}, or add it to the URDF");
            t.refuse("port_link", "is not a link of the URDF", remedy);
        }
        t.section("numbers", |n| n.notes());
        let hull = t.section("hull", |h| SpacecraftHull {
            radius_m: h.number("radius_m"),
            length_m: h.number("length_m"),
        });
        (port_link, hull)
    });
    let (problems, values) = checker.finish();
    out.problems.extend(problems);
    out.values.extend(values);

    let tree = tree?;
    let mass = body_mass(urdf_path, &tree, out);
    let (port_link, hull) = said?;
    let port = tree.links.get(&port_link)?;
    let mass = mass?;
    let port_axis = port.q * docktwin_core::DVec3::X;
    let body = Body { mass: &mass, hull, port_m: port.p, port_axis };
    // What a wrong number of another kind makes of mass and hull means nothing.
    if out.problems.is_empty() {
        body.check(urdf_path, tree.line("link", &tree.root), out);
    }
    let lines = body.lines();
    let spacecraft = Spacecraft {
        name: tree.robot.name.clone(),
        mass_kg: mass.mass_kg,
        inertia_kg_m2: mass.inertia_kg_m2,
        x_body_port: Pose::new(port.p - mass.com_m, port.q),
        digest: out.digest(),
    };
    Some(ReadSpacecraft { spacecraft, hull, lines })
}

/// All links as one rigid body.
fn body_mass(path: &Path, tree: &UrdfTree, out: &mut Findings) -> Option<urdf::MassProperties> {
    for joint in tree.robot.joints.iter().filter(|j| !urdf::is_fixed(&j.joint_type)) {
        out.problems.push(Problem {
            file: path.into(),
            line: tree.line("joint", &joint.name),
            key: format!("joint `{}`", joint.name),
            value: format!("{:?}", joint.joint_type).to_lowercase(),
            what: "moves, but a spacecraft is one rigid body".into(),
            allowed: "fixed".into(),
            remedy: "make the joint fixed".into(),
            ..Problem::default()
        });
    }
    let mut parts = Vec::new();
    for link in tree.robot.links.iter().filter(|l| tree.with_inertial.contains(&l.name)) {
        let x = tree.links.get(&link.name).copied().unwrap_or_default();
        parts.push(urdf::mass_of(path, tree, link, x, out));
    }
    if parts.is_empty() {
        out.problems.push(Problem {
            file: path.into(),
            line: tree.line("link", &tree.root),
            key: format!("link `{}`", tree.root),
            what: "no link has an inertial, so the spacecraft has no mass".into(),
            remedy: "add an inertial with mass and inertia".into(),
            ..Problem::default()
        });
        return None;
    }
    Some(urdf::compose(&parts))
}
