//! Reading a URDF without losing anything: the XML is walked first, so that elements and numbers
//! that `urdf-rs` drops without a word are refused or noted; `urdf-rs` then gives the data.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use docktwin_core::{DMat3, DQuat, DVec3, Pose};
use roxmltree::{Document, Node, ParsingOptions};
use urdf_rs::{Geometry, JointType, Robot};

use crate::input::{Lines, is_unprintable, shown};
use crate::problem::{Findings, Note, Problem, ReadValue};

/// More than any URDF of ours by a factor of hundred.
const MAX_NODES: u32 = 50_000;
/// Deepest nesting of elements; URDF itself needs six.
const MAX_DEPTH: usize = 32;
/// Attributes of one element; a parser compares each with each.
const MAX_ATTRIBUTES: usize = 64;
/// Links of one URDF.
const MAX_LINKS: usize = 1000;
/// Placements and mesh sizes beyond this, m, are a slip of the unit.
const FARTHEST_M: f64 = 1e4;
/// Mass of one link, kg.
pub(crate) const MASS_KG: (f64, f64) = (1e-4, 1e7);

/// A URDF that is a tree of links, and where everything stands in it.
pub(crate) struct UrdfTree {
    pub(crate) robot: Robot,
    /// Name of the only link without parent.
    pub(crate) root: String,
    /// Pose of each link in the root link, movable joints at zero.
    pub(crate) links: BTreeMap<String, Pose>,
    /// Links that have an `inertial`.
    pub(crate) with_inertial: BTreeSet<String>,
    lines: BTreeMap<String, usize>,
}

impl UrdfTree {
    /// Line of a link or a joint.
    pub(crate) fn line(&self, tag: &str, name: &str) -> Option<usize> {
        self.lines.get(&format!("{tag} {name}")).copied()
    }

    /// Whether a link is fixed, directly or by others, to another one.
    pub(crate) fn hangs_on(&self, link: &str, other: &str) -> bool {
        let mut at = link;
        // A tree has no longer way than it has links.
        for _ in 0..self.links.len() {
            let Some(joint) = self.robot.joints.iter().find(|j| j.child.link == at) else {
                return false;
            };
            if joint.joint_type != JointType::Fixed {
                return false;
            }
            if joint.parent.link == other {
                return true;
            }
            at = &joint.parent.link;
        }
        false
    }
}

/// How an element or an attribute is treated.
#[derive(Clone, Copy, PartialEq)]
enum Use {
    /// Needed, once.
    Once,
    /// May be there, at most once.
    Optional,
    /// May be there, any number of times.
    Many,
    /// Standard URDF, not used by docktwin; the reason follows.
    Ignored(&'static str),
}
use Use::{Ignored, Many, Once, Optional};

const NO_LIMIT: Use =
    Ignored("fixed and floating joints have no limits; travel stands in the TOML");
const NO_DRIVE: Use = Ignored("no joint is driven");

/// Children of a joint that turns about or slides along its axis.
const MOVING_JOINT: Names = &[
    ("parent", Once),
    ("child", Once),
    ("origin", Optional),
    ("axis", Once),
    ("limit", Once),
    ("dynamics", Ignored("damping and friction stand in the TOML")),
    ("mimic", NO_DRIVE),
    ("safety_controller", NO_DRIVE),
    ("calibration", NO_DRIVE),
];

/// Names and how each is treated.
type Names = &'static [(&'static str, Use)];

/// Children and attributes of every element that is read.
fn schema(tag: &str) -> (Names, Names) {
    match tag {
        "robot" => (
            &[
                ("link", Many),
                ("joint", Many),
                ("material", Ignored("colours come from the viewer")),
                ("transmission", NO_DRIVE),
                ("gazebo", Ignored("for another simulator")),
                ("ros2_control", NO_DRIVE),
                ("sensor", Ignored("sensors stand in the rig file")),
            ],
            &[("name", Once), ("version", Ignored("no element that is used depends on it"))],
        ),
        "link" => (
            &[
                ("inertial", Optional),
                ("visual", Many),
                ("collision", Ignored("contact shapes are generated from the TOML parameters")),
            ],
            &[("name", Once)],
        ),
        "inertial" => (&[("origin", Optional), ("mass", Once), ("inertia", Once)], &[]),
        "mass" => (&[], &[("value", Once)]),
        "inertia" => (
            &[],
            &[
                ("ixx", Once),
                ("ixy", Once),
                ("ixz", Once),
                ("iyy", Once),
                ("iyz", Once),
                ("izz", Once),
            ],
        ),
        "visual" => (
            &[
                ("origin", Optional),
                ("geometry", Once),
                ("material", Ignored("colours come from the viewer")),
            ],
            &[("name", Ignored("visuals are told apart by their link"))],
        ),
        "geometry" => (
            &[
                ("mesh", Once),
                ("box", Ignored("only meshes are drawn")),
                ("cylinder", Ignored("only meshes are drawn")),
                ("sphere", Ignored("only meshes are drawn")),
                ("capsule", Ignored("only meshes are drawn")),
            ],
            &[],
        ),
        "mesh" => (&[], &[("filename", Once), ("scale", Optional)]),
        "joint" => (
            &[
                ("parent", Once),
                ("child", Once),
                ("origin", Optional),
                ("axis", Ignored("fixed and floating joints have no axis")),
                ("limit", NO_LIMIT),
                ("dynamics", Ignored("damping and friction stand in the TOML")),
                ("mimic", NO_DRIVE),
                ("safety_controller", NO_DRIVE),
                ("calibration", NO_DRIVE),
            ],
            &[("name", Once), ("type", Once)],
        ),
        "parent" | "child" => (&[], &[("link", Once)]),
        "limit" => (&[], &[("lower", Once), ("upper", Once), ("effort", Once), ("velocity", Once)]),
        "axis" => (&[], &[("xyz", Once)]),
        "origin" => (&[], &[("xyz", Optional), ("rpy", Optional)]),
        _ => (&[], &[]),
    }
}

/// How many numbers an attribute holds, for those that hold numbers.
fn numbers_in(tag: &str, attribute: &str) -> Option<usize> {
    match (tag, attribute) {
        ("origin" | "axis", _) | ("mesh", "scale") => Some(3),
        ("mass" | "inertia" | "limit", _) => Some(1),
        _ => None,
    }
}

struct Walk<'a> {
    path: &'a Path,
    lines: &'a Lines,
    out: &'a mut Findings,
    /// Elements that are ignored, as bytes of the text.
    ignored: Vec<core::ops::Range<usize>>,
}

impl Walk<'_> {
    fn line(&self, node: Node<'_, '_>) -> Option<usize> {
        Some(self.lines.at(node.range().start))
    }

    fn refuse(&mut self, node: Node<'_, '_>, what: &str, remedy: &str) {
        let (line, key) = (self.line(node), place(node));
        self.out.problems.push(Problem {
            file: self.path.into(),
            line,
            key,
            what: what.into(),
            remedy: remedy.into(),
            ..Problem::default()
        });
    }

    fn ignore(&mut self, node: Node<'_, '_>, what: String) {
        let line = self.line(node);
        self.out.notes.push(Note { file: self.path.into(), line, what, flagged: false });
    }

    fn element(&mut self, node: Node<'_, '_>) {
        let tag = node.tag_name().name();
        let (mut children, attributes) = schema(tag);
        if tag == "joint" && matches!(node.attribute("type"), Some("revolute" | "prismatic")) {
            children = MOVING_JOINT;
        }
        self.attributes(node, attributes);
        for text in node.children().filter(Node::is_text) {
            if text.text().is_some_and(|t| !t.trim().is_empty()) {
                self.refuse(node, "holds text, which URDF has no use for", "remove the text");
            }
        }
        for child in node.children().filter(Node::is_element) {
            let name = child.tag_name().name();
            match children.iter().find(|(n, _)| *n == name).map(|(_, u)| *u) {
                Some(Ignored(why)) => {
                    self.ignore(child, format!("{} is ignored: {why}", place(child)));
                    // A geometry needs one shape, whichever it is.
                    if tag != "geometry" {
                        self.ignored.push(child.range());
                    }
                }
                Some(_) => self.element(child),
                None => {
                    let known: Vec<_> = children.iter().map(|(n, _)| *n).collect();
                    let remedy = if known.is_empty() {
                        format!("remove it: `{tag}` has no elements inside")
                    } else {
                        format!("remove it or use one of {}", known.join(", "))
                    };
                    self.refuse(child, "is not an element of URDF at this place", &remedy);
                }
            }
        }
        let count = |name: &str| {
            node.children().filter(|c| c.is_element() && c.tag_name().name() == name).count()
        };
        // A geometry that is not a mesh is noted above and complete without one.
        let shapes = children.iter().filter(|(_, u)| matches!(u, Ignored(_)));
        let other_shape = tag == "geometry" && shapes.map(|(n, _)| count(n)).sum::<usize>() > 0;
        for (name, used) in children {
            match (used, count(name)) {
                (Once, 0) if !other_shape => {
                    self.refuse(node, &format!("has no `{name}`"), &format!("add one `{name}`"))
                }
                (Once | Optional, 2..) => self.refuse(
                    node,
                    &format!("has more than one `{name}`, of which only one would count"),
                    &format!("leave one `{name}`"),
                ),
                _ => {}
            }
        }
    }

    fn attributes(&mut self, node: Node<'_, '_>, known: &[(&str, Use)]) {
        let tag = node.tag_name().name();
        for a in node.attributes() {
            match known.iter().find(|(n, _)| *n == a.name()).map(|(_, u)| *u) {
                Some(Ignored(why)) => {
                    self.ignore(
                        node,
                        format!("{} attribute `{}` is ignored: {why}", place(node), a.name()),
                    );
                }
                Some(_) => self.numbers(node, tag, a.name(), a.value()),
                None => {
                    let names: Vec<_> = known.iter().map(|(n, _)| *n).collect();
                    let remedy = if names.is_empty() {
                        format!("remove it: `{tag}` has no attributes")
                    } else {
                        format!("remove it; known here: {}", names.join(", "))
                    };
                    self.refuse(
                        node,
                        &format!("has the unknown attribute `{}`", a.name()),
                        &remedy,
                    );
                }
            }
        }
        for (name, used) in known {
            if *used == Once && node.attribute(*name).is_none() {
                self.refuse(
                    node,
                    &format!("has no attribute `{name}`"),
                    &format!("add {name}=\"…\""),
                );
            }
        }
    }

    /// `urdf-rs` drops words that are not numbers from a list; here they are refused.
    fn numbers(&mut self, node: Node<'_, '_>, tag: &str, attribute: &str, text: &str) {
        let line = self.line(node);
        let key = format!("{} {attribute}", place(node));
        if let Some(count) = numbers_in(tag, attribute) {
            let parsed: Vec<f64> =
                text.split_whitespace().map(|w| w.parse().unwrap_or(f64::NAN)).collect();
            if parsed.len() != count || parsed.iter().any(|x| !x.is_finite()) {
                self.out.problems.push(Problem {
                    file: self.path.into(),
                    line,
                    key,
                    value: shown(text),
                    unit: unit_of(tag, attribute).into(),
                    what: what_is_wrong(&parsed, count),
                    allowed: match count {
                        1 => "one finite number".into(),
                        n => format!("{n} finite numbers, separated by spaces"),
                    },
                    remedy: "change the value".into(),
                });
                return;
            }
            let farthest = match (tag, attribute) {
                ("origin", "xyz") => FARTHEST_M,
                ("origin", "rpy") => core::f64::consts::TAU,
                ("inertia", _) => 1e12,
                _ => f64::INFINITY,
            };
            let unit = unit_of(tag, attribute);
            if parsed.iter().any(|x| x.abs() > farthest) {
                self.out.problems.push(Problem {
                    file: self.path.into(),
                    line,
                    key,
                    value: shown(text),
                    unit: unit.into(),
                    what: "is out of range".into(),
                    allowed: format!("≥ -{farthest} and ≤ {farthest} {unit}"),
                    remedy: "change the value".into(),
                });
                return;
            }
            self.read_value(line, key, text, unit);
        } else if text.chars().any(is_unprintable) {
            self.out.problems.push(Problem {
                file: self.path.into(),
                line,
                key,
                value: shown(text),
                what: "holds a character that cannot be printed".into(),
                allowed: "printable text on one line".into(),
                remedy: "change the name".into(),
                ..Problem::default()
            });
        } else {
            self.read_value(line, key, text, "");
        }
    }

    fn read_value(&mut self, line: Option<usize>, key: String, text: &str, unit: &str) {
        self.out.values.push(ReadValue {
            file: self.path.into(),
            line,
            key,
            value: shown(text),
            unit: unit.into(),
            note: String::new(),
        });
    }
}

/// Unit of the numbers of an attribute.
fn unit_of(tag: &str, attribute: &str) -> &'static str {
    match (tag, attribute) {
        ("mass", _) => "kg",
        ("inertia", _) => "kg·m²",
        ("origin", "xyz") => "m",
        ("origin", "rpy") => "rad",
        _ => "",
    }
}

/// Numbers that cannot be used: how many there are, or which of them is none.
fn what_is_wrong(parsed: &[f64], count: usize) -> String {
    match parsed.iter().position(|x| !x.is_finite()) {
        Some(_) if count == 1 && parsed.len() == 1 => "is not a finite number".into(),
        Some(i) if parsed.len() == count => format!("number {} is not a finite number", i + 1),
        _ => format!("has {} numbers", parsed.len()),
    }
}

/// An element with the link or joint it belongs to.
fn place(node: Node<'_, '_>) -> String {
    let tag = shown(node.tag_name().name());
    let name = |n: Node<'_, '_>| shown(n.attribute("name").unwrap_or("?"));
    let owner = node.ancestors().find(|n| matches!(n.tag_name().name(), "link" | "joint"));
    match owner {
        Some(o) if o == node => format!("{tag} `{}`", name(o)),
        Some(o) => format!("{tag} of {} `{}`", o.tag_name().name(), name(o)),
        None => tag,
    }
}

/// Reads a URDF text. Problems and notes go to `out`; `None` when the text is not a URDF tree.
/// With `meshes`, every mesh that is named must exist.
pub(crate) fn read(path: &Path, text: &str, meshes: bool, out: &mut Findings) -> Option<UrdfTree> {
    let mut refuse = |defect: Defect| out.problems.push(defect.at(path));
    let doc = parse(text).map_err(&mut refuse).ok()?;
    let line_of = Lines::of(text);
    check_size(&doc, &line_of).map_err(&mut refuse).ok()?;
    let root = doc.root_element();
    let problems_before = out.problems.len();
    let mut walk = Walk { path, lines: &line_of, out, ignored: Vec::new() };
    walk.element(root);
    // What is ignored is not parsed a second time.
    let used = without(text, &walk.ignored);

    let robot = match urdf_rs::read_from_string(&used) {
        Ok(robot) => robot,
        Err(error) => {
            // What the walk found is the cause; otherwise urdf-rs knows something we do not.
            if out.problems.len() == problems_before {
                let what = shown(&error.to_string());
                out.problems.push(Defect::new(Some(1), "robot", what, "mend the element").at(path));
            }
            return None;
        }
    };
    let mut lines = BTreeMap::new();
    let mut with_inertial = BTreeSet::new();
    for node in root.children().filter(Node::is_element) {
        let tag = node.tag_name().name();
        let name = node.attribute("name").unwrap_or_default();
        lines.insert(format!("{tag} {name}"), line_of.at(node.range().start));
        if tag == "link" && node.children().any(|c| c.tag_name().name() == "inertial") {
            with_inertial.insert(name.to_owned());
        }
    }
    let (root, links) = place_links(path, &robot, &lines, out)?;
    check_meshes(path, &robot, &lines, meshes, out);
    Some(UrdfTree { robot, root, links, with_inertial, lines })
}

/// A text with blanks in the place of some of its parts, its lines where they were.
fn without(text: &str, parts: &[core::ops::Range<usize>]) -> String {
    let mut out = String::with_capacity(text.len());
    let mut at = 0;
    for part in parts {
        // Parts come in their order, and one inside another is not among them.
        let (Some(before), Some(gone)) = (text.get(at..part.start), text.get(part.clone())) else {
            continue;
        };
        out.push_str(before);
        out.extend(gone.chars().map(|c| if c == '\n' { '\n' } else { ' ' }));
        at = part.end;
    }
    out.push_str(text.get(at..).unwrap_or_default());
    out
}

/// What is wrong with a text, whatever its file.
struct Defect {
    line: Option<usize>,
    key: String,
    what: String,
    remedy: &'static str,
}

impl Defect {
    fn new(line: Option<usize>, key: &str, what: impl Into<String>, remedy: &'static str) -> Self {
        Self { line, key: key.to_owned(), what: what.into(), remedy }
    }

    fn at(self, path: &Path) -> Problem {
        Problem {
            file: path.into(),
            line: self.line,
            key: self.key,
            what: self.what,
            remedy: self.remedy.into(),
            ..Problem::default()
        }
    }
}

/// The text as XML of bearable size.
fn parse(text: &str) -> Result<Document<'_>, Defect> {
    if let Some(line) = crowded_tag(text) {
        let what = format!("has more than {MAX_ATTRIBUTES} attributes in one element");
        return Err(Defect::new(Some(line), "xml", what, "URDF needs six at most: remove them"));
    }
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|error| match error {
        roxmltree::Error::NodesLimitReached => Defect::new(
            None,
            "xml",
            format!("has more than {MAX_NODES} elements, texts and comments"),
            "a model of a docking needs some hundred: leave out what is not needed",
        ),
        roxmltree::Error::DtdDetected => Defect::new(
            text.find("<!DOCTYPE").map(|at| Lines::of(text).at(at)),
            "xml",
            "has a DTD, whose entities URDF has no use for",
            "remove `<!DOCTYPE …>`",
        ),
        error => Defect::new(
            Some(error.pos().row as usize),
            "xml",
            shown(&error.to_string()),
            "write well-formed XML",
        ),
    })
}

/// What `urdf-rs`, which recurses into everything, can take, and a URDF at all.
fn check_size(doc: &Document<'_>, line_of: &Lines) -> Result<(), Defect> {
    let line = |node: Node<'_, '_>| Some(line_of.at(node.range().start));
    if let Some((depth, node)) = deepest(doc).filter(|(depth, _)| *depth > MAX_DEPTH) {
        let what = format!("nests elements {depth} deep; allowed: at most {MAX_DEPTH}");
        let remedy = "URDF needs six: close the elements";
        return Err(Defect::new(line(node), "xml", what, remedy));
    }
    let root = doc.root_element();
    if root.tag_name().name() != "robot" {
        return Err(Defect::new(
            Some(1),
            &shown(root.tag_name().name()),
            "is not a URDF",
            "the outermost element of a URDF is `robot`; expand xacro first",
        ));
    }
    let links = root.children().filter(|n| n.has_tag_name("link")).count();
    if links > MAX_LINKS {
        let what = format!("has {links} links; allowed: at most {MAX_LINKS}");
        let remedy = "leave out links that carry no mass";
        return Err(Defect::new(line(root), "robot", what, remedy));
    }
    Ok(())
}

/// Checks that links and joints form one tree and gives the pose of every link in its root.
fn place_links(
    path: &Path,
    robot: &Robot,
    lines: &BTreeMap<String, usize>,
    out: &mut Findings,
) -> Option<(String, BTreeMap<String, Pose>)> {
    let before = out.problems.len();
    let mut refuse = |tag: &str, name: &str, what: String, remedy: String| {
        out.problems.push(Problem {
            file: path.into(),
            line: lines.get(&format!("{tag} {name}")).copied(),
            key: format!("{tag} `{}`", shown(name)),
            what,
            remedy,
            ..Problem::default()
        });
    };
    let mut names = BTreeSet::new();
    for link in &robot.links {
        if !names.insert(link.name.as_str()) {
            refuse("link", &link.name, "stands twice".into(), "rename or remove one".into());
        }
    }
    let mut joints = BTreeSet::new();
    let mut parent_of = BTreeMap::new();
    for j in &robot.joints {
        if !joints.insert(j.name.as_str()) {
            refuse("joint", &j.name, "stands twice".into(), "rename or remove one".into());
        }
        for end in [&j.parent.link, &j.child.link] {
            if !names.contains(end.as_str()) {
                refuse(
                    "joint",
                    &j.name,
                    format!("names the link `{}`, which does not exist", shown(end)),
                    format!("add the link or name one of {}", list(names.iter().copied())),
                );
            }
        }
        if parent_of.insert(j.child.link.as_str(), j).is_some() {
            refuse(
                "link",
                &j.child.link,
                "is the child of more than one joint".into(),
                "a URDF is a tree: leave one; loops are closed in the TOML".into(),
            );
        }
    }
    let roots: Vec<&str> = names.iter().copied().filter(|n| !parent_of.contains_key(n)).collect();
    if roots.len() != 1 {
        let (what, remedy) = wrong_roots(&roots);
        refuse("robot", &robot.name, what, remedy.into());
    }
    let mut poses = BTreeMap::new();
    for name in &names {
        // Up to the root, at most as many steps as there are links.
        let mut chain = Vec::new();
        let mut at = *name;
        while let Some(j) = parent_of.get(at) {
            if chain.len() > names.len() {
                break;
            }
            chain.push(*j);
            at = j.parent.link.as_str();
        }
        if chain.len() > names.len() {
            refuse(
                "link",
                name,
                "hangs on a cycle of joints".into(),
                "a URDF is a tree: cut the cycle and let one of its links hang on the others"
                    .into(),
            );
            continue;
        }
        let pose = chain.iter().rev().fold(Pose::IDENTITY, |x, j| x * pose_of(&j.origin));
        poses.insert((*name).to_owned(), pose);
    }
    (out.problems.len() == before).then(|| (roots[0].to_owned(), poses))
}

/// What is wrong with links that have another number of roots than one, and what to do.
fn wrong_roots(roots: &[&str]) -> (String, &'static str) {
    if roots.is_empty() {
        let what = "has no root link: every link hangs on another one";
        let remedy = "a URDF is a tree: remove the joint above the link that is to be its root";
        return (what.to_owned(), remedy);
    }
    let remedy = "join the links by joints into one tree";
    (format!("has {} root links: {}", roots.len(), list(roots.iter().copied())), remedy)
}

fn check_meshes(
    path: &Path,
    robot: &Robot,
    lines: &BTreeMap<String, usize>,
    must_exist: bool,
    out: &mut Findings,
) {
    let folder = path.parent().unwrap_or(Path::new(""));
    let sources = out.sources.clone();
    for link in &robot.links {
        for visual in &link.visual {
            let Geometry::Mesh { filename, scale } = &visual.geometry else { continue };
            let mut refuse = |what: &str, remedy: &str| {
                out.problems.push(Problem {
                    file: path.into(),
                    line: lines.get(&format!("link {}", link.name)).copied(),
                    key: format!("mesh of link `{}`", shown(&link.name)),
                    value: shown(filename),
                    what: what.into(),
                    remedy: remedy.into(),
                    ..Problem::default()
                });
            };
            if filename.contains("://") || Path::new(filename).is_absolute() {
                refuse("is not a relative path", "give the path from the folder of the URDF");
            } else if !is_mesh_name(filename) {
                refuse(
                    "is not the name of a mesh",
                    "name a file that ends in .obj, .stl, .dae, .ply, .gltf or .glb",
                );
            } else if levels_up(filename) > MOST_LEVELS_UP {
                refuse(
                    "is outside of the model's folders",
                    "put it into the folder of the URDF, or at most two folders above that, such as \
                     `../../meshes/NAME.obj`",
                );
            } else if must_exist && !sources.is_file(&folder.join(filename)) {
                refuse("does not exist", "run `cargo xtask meshes`, or mend the file name");
            } else if must_exist && leads_out(&sources, folder, filename) {
                refuse(
                    "leads out of the model's folders by a link",
                    "put the mesh itself there, not a link to it",
                );
            }
            let unscaled = |s: &urdf_rs::Vec3| s.iter().all(|x| (x - 1.0).abs() < f64::EPSILON);
            if scale.as_ref().is_some_and(|s| !unscaled(s)) {
                refuse(
                    "is scaled, and meshes are in metres",
                    "multiply the vertices in the file by the scale, then remove the scale from the URDF",
                );
            }
        }
    }
}

/// A mesh may lie so many folders above the one of its URDF.
const MOST_LEVELS_UP: usize = 2;

/// Meshes are copied into run directories: a URDF from elsewhere must not name other files by them.
fn is_mesh_name(name: &str) -> bool {
    let kinds = ["obj", "stl", "dae", "ply", "gltf", "glb"];
    let extension = Path::new(name).extension().map(|e| e.to_string_lossy().to_lowercase());
    extension.is_some_and(|e| kinds.contains(&e.as_str()))
}

/// How far a relative path leaves the folder it begins in.
fn levels_up(name: &str) -> usize {
    let (mut level, mut most) = (0_isize, 0_isize);
    for part in Path::new(name).components() {
        match part {
            std::path::Component::ParentDir => level -= 1,
            std::path::Component::Normal(_) => level += 1,
            _ => {}
        }
        most = most.max(-level);
    }
    most.unsigned_abs()
}

/// Whether a file is reached by a symbolic link to outside of the folders that a mesh may be in.
fn leads_out(sources: &crate::Sources, folder: &Path, name: &str) -> bool {
    if sources.in_memory(&folder.join(name)) {
        return false;
    }
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let (Ok(folder), Ok(file)) = (here.canonicalize(), here.join(name).canonicalize()) else {
        return false;
    };
    let top = folder.ancestors().nth(MOST_LEVELS_UP).unwrap_or(&folder);
    !file.starts_with(top)
}

/// Files of the meshes that a URDF names, as it names them: from its own folder. Empty for a text
/// that is no XML.
#[must_use]
pub fn named_meshes(urdf: &str) -> Vec<String> {
    let Ok(document) = roxmltree::Document::parse(urdf) else { return Vec::new() };
    let mut out: Vec<String> = document
        .descendants()
        // Those of collisions are ignored, and nobody has looked at their names.
        .filter(|n| n.has_tag_name("mesh") && n.ancestors().any(|a| a.has_tag_name("visual")))
        .filter_map(|n| n.attribute("filename").map(str::to_owned))
        .collect();
    out.sort();
    out.dedup();
    out
}

/// URDF origin: translation, then rotation about the fixed axes X, Y, Z in this order.
pub(crate) fn pose_of(origin: &urdf_rs::Pose) -> Pose {
    let [roll, pitch, yaw] = origin.rpy.0;
    let q =
        DQuat::from_rotation_z(yaw) * DQuat::from_rotation_y(pitch) * DQuat::from_rotation_x(roll);
    Pose::new(DVec3::from_array(origin.xyz.0), q)
}

/// Mass, mass centre and inertia about it, all in the axes of the frame they are seen from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MassProperties {
    pub(crate) mass_kg: f64,
    pub(crate) com_m: DVec3,
    pub(crate) inertia_kg_m2: DMat3,
}

/// Mass properties of one link seen from a frame in which the link stands at `x`; checks them.
pub(crate) fn mass_of(
    path: &Path,
    tree: &UrdfTree,
    link: &urdf_rs::Link,
    x: Pose,
    out: &mut Findings,
) -> MassProperties {
    let i = &link.inertial.inertia;
    let inertia = DMat3::from_cols(
        DVec3::new(i.ixx, i.ixy, i.ixz),
        DVec3::new(i.ixy, i.iyy, i.iyz),
        DVec3::new(i.ixz, i.iyz, i.izz),
    );
    let mass_kg = link.inertial.mass.value;
    let mut wrong = |key: &str, value: String, unit: &str, what: &str, allowed: &str| {
        out.problems.push(Problem {
            file: path.into(),
            line: tree.line("link", &link.name),
            key: format!("{key} of link `{}`", shown(&link.name)),
            value,
            unit: unit.into(),
            what: what.into(),
            allowed: allowed.into(),
            remedy: "change the inertial in the URDF".into(),
        });
    };
    let (least, most) = MASS_KG;
    // One that is no number was told where it stands.
    if mass_kg.is_finite() && !(mass_kg >= least && mass_kg <= most) {
        let allowed = format!("≥ {least} and ≤ {most} kg");
        wrong("mass", mass_kg.to_string(), "kg", "is out of range", &allowed);
    }
    let p = principal_moments(inertia);
    let shown = format!("principal moments {:.6} {:.6} {:.6}", p[0], p[1], p[2]);
    if p[0] <= 0.0 {
        let what = "is not positive definite";
        wrong("inertia", shown, "kg·m²", what, "three principal moments > 0");
    } else if p[0] + p[1] < p[2] * (1.0 - 1e-9) {
        let what = "is not that of any body: the sum of two principal moments is below the third";
        wrong("inertia", shown, "kg·m²", what, "each moment ≤ the sum of the others");
    }
    let x = x * pose_of(&link.inertial.origin);
    MassProperties {
        mass_kg,
        com_m: x.p,
        inertia_kg_m2: docktwin_core::inertia_world(x.q, inertia),
    }
}

/// Several rigidly joined bodies as one.
pub(crate) fn compose(parts: &[MassProperties]) -> MassProperties {
    let mass_kg: f64 = parts.iter().map(|b| b.mass_kg).sum();
    let com_m = parts.iter().map(|b| b.mass_kg * b.com_m).sum::<DVec3>() / mass_kg;
    let mut inertia_kg_m2 = DMat3::ZERO;
    for b in parts {
        let s = docktwin_core::skew(b.com_m - com_m);
        // Parallel axes: I + m (d² 1 − d dᵀ) = I − m [d]× [d]×.
        inertia_kg_m2 += b.inertia_kg_m2 - s * s * b.mass_kg;
    }
    MassProperties { mass_kg, com_m, inertia_kg_m2 }
}

/// Eigenvalues of a symmetric matrix, rising, in its unit: of an inertia in kg·m² its principal moments, kg·m².
/// Jacobi rotations.
#[must_use]
pub fn principal_moments(m: DMat3) -> [f64; 3] {
    let mut a = m.to_cols_array_2d();
    for _ in 0..30 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q].abs() <= f64::MIN_POSITIVE {
                continue;
            }
            // tan 2t = 2 a_pq / (a_pp − a_qq), the rotation that clears a_pq.
            let t = 0.5 * (2.0 * a[p][q]).atan2(a[p][p] - a[q][q]);
            let (s, c) = t.sin_cos();
            for row in &mut a {
                (row[p], row[q]) = (c * row[p] + s * row[q], c * row[q] - s * row[p]);
            }
            let (rp, rq) = (a[p], a[q]);
            for k in 0..3 {
                a[p][k] = c * rp[k] + s * rq[k];
                a[q][k] = c * rq[k] - s * rp[k];
            }
        }
    }
    let mut d = [a[0][0], a[1][1], a[2][2]];
    d.sort_by(f64::total_cmp);
    d
}

/// Whether a joint cannot move.
pub(crate) fn is_fixed(kind: &JointType) -> bool {
    *kind == JointType::Fixed
}

/// Names in a row, a dozen at most.
pub(crate) fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let mut names = names.map(|n| format!("`{}`", shown(n)));
    let mut text = names.by_ref().take(12).collect::<Vec<_>>().join(", ");
    match names.count() {
        0 => {}
        more => text.push_str(&format!(" and {more} more")),
    }
    text
}

/// Line of the first element with more attributes than any of URDF. Looked for before parsing.
fn crowded_tag(text: &str) -> Option<usize> {
    let mut at = 0;
    while let Some(open) = text[at..].find('<').map(|i| at + i) {
        let rest = &text[open..];
        if rest.starts_with("<!--") {
            at = open + rest.find("-->")?;
            continue;
        }
        // To the end of the tag; a `>` may stand in quotes.
        let (mut quote, mut attributes, mut end) = (None, 0, rest.len());
        for (i, b) in rest.bytes().enumerate() {
            match (quote, b) {
                (None, b'"' | b'\'') => quote = Some(b),
                (Some(q), b) if q == b => quote = None,
                (None, b'=') => attributes += 1,
                (None, b'>') => {
                    end = i;
                    break;
                }
                _ => {}
            }
        }
        if attributes > MAX_ATTRIBUTES {
            return Some(Lines::of(text).at(open));
        }
        at = open + end;
    }
    None
}

/// The deepest element and how deep it is.
fn deepest<'a>(doc: &'a Document<'a>) -> Option<(usize, Node<'a, 'a>)> {
    let mut found: Option<(usize, Node<'a, 'a>)> = None;
    let (mut at, mut depth) = (doc.root(), 0);
    loop {
        if let Some(child) = at.first_child() {
            (at, depth) = (child, depth + 1);
        } else {
            while at.next_sibling().is_none() {
                let Some(parent) = at.parent() else { return found };
                (at, depth) = (parent, depth - 1);
            }
            let Some(next) = at.next_sibling() else { return found };
            at = next;
        }
        if at.is_element() && found.is_none_or(|(d, _)| depth > d) {
            found = Some((depth, at));
        }
    }
}
