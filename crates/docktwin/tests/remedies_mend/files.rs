//! Remedies for files: each is obeyed on a file that fails, and the file is looked at again.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use docktwin_model::{Problem, Sources, load_mechanism_from, load_rig_from, load_spacecraft_from};
use docktwin_scenario::Loader;

use crate::texts::is_of;

/// A file, a text in it, and what stands there instead.
type Edit = (&'static str, &'static str, &'static str);

/// A remedy as it stands in the sources, a file that needs it, and every way of obeying it.
pub(crate) struct Case {
    pub(crate) remedy: &'static str,
    broken: Vec<Edit>,
    mends: Vec<Vec<Edit>>,
}

/// Obeyed by taking back what was done, because that is what it says.
fn undo(remedy: &'static str, broken: &[Edit]) -> Case {
    let back = broken.iter().rev().map(|(file, from, to)| (*file, *to, *from)).collect();
    Case { remedy, broken: broken.to_vec(), mends: vec![back] }
}

/// Obeyed in each of several ways.
fn case(remedy: &'static str, broken: &[Edit], mends: &[&[Edit]]) -> Case {
    Case { remedy, broken: broken.to_vec(), mends: mends.iter().map(|m| m.to_vec()).collect() }
}

/// Short names of shipped files.
const SHIPPED: [(&str, &str); 17] = [
    ("chaser.urdf", "models/urdf/chaser_8t.urdf"),
    ("chaser.toml", "models/urdf/chaser_8t.toml"),
    ("active.urdf", "models/urdf/apas_active.urdf"),
    ("active.toml", "models/urdf/apas_active.toml"),
    ("passive.urdf", "models/urdf/apas_passive.urdf"),
    ("passive.toml", "models/urdf/apas_passive.toml"),
    ("bare.toml", "models/urdf/ring_active.toml"),
    ("bare_passive.toml", "models/urdf/ring_passive.toml"),
    ("stick.toml", "models/urdf/stick_active.toml"),
    ("probe.toml", "models/urdf/probe_active.toml"),
    ("drogue.toml", "models/urdf/probe_passive.toml"),
    ("rig.urdf", "models/urdf/stewart.urdf"),
    ("rig.toml", "models/urdf/stewart.toml"),
    ("hexapod.toml", "models/urdf/electric_hexapod.toml"),
    ("measured.toml", "models/urdf/electric_hexapod_measured.toml"),
    ("scenario", "scenarios/apas_nominal.toml"),
    ("bare_scenario", "scenarios/basic_ring_ring.toml"),
];

fn path_of(file: &str) -> &'static str {
    SHIPPED.iter().find(|(short, _)| *short == file).expect("a shipped file").1
}

/// Where the files stand; no such folder is on the disk.
fn place(name: &str) -> PathBuf {
    Path::new("/shipped").join(name)
}

type Files = BTreeMap<String, Vec<u8>>;

fn shipped() -> Files {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut files = Files::new();
    for folder in ["models/urdf", "scenarios", "meshes"] {
        for entry in fs::read_dir(root.join(folder)).expect("a folder") {
            let path = entry.expect("an entry").path();
            let name = path.file_name().expect("a name").to_string_lossy().into_owned();
            let bytes =
                if folder == "meshes" { Vec::new() } else { fs::read(&path).expect("a file") };
            files.insert(format!("{folder}/{name}"), bytes);
        }
    }
    files
}

/// A shipped text.
pub(crate) fn text(file: &str) -> String {
    String::from_utf8(shipped()[path_of(file)].clone()).expect("text")
}

fn edit(files: &mut Files, edits: &[Edit]) {
    for (file, from, to) in edits {
        let bytes = files.get_mut(path_of(file)).expect("a shipped file");
        let text = String::from_utf8(bytes.clone()).expect("text");
        assert!(text.contains(from), "{file} has no {from:?}: mend the case");
        *bytes = text.replacen(from, to, 1).into_bytes();
    }
}

/// What is wrong with the model or scenario that a file belongs to.
fn problems(files: &Files, file: &str) -> Vec<Problem> {
    let add = |s: Sources, (name, bytes): (&String, &Vec<u8>)| s.with(place(name), bytes.clone());
    let sources = files.iter().fold(Sources::memory(), add);
    let model = |name: &str| place(&format!("models/urdf/{name}.urdf"));
    let mechanism = |base: &str| {
        let [a, p] = ["active", "passive"].map(|side| model(&format!("{base}_{side}")));
        load_mechanism_from(&sources, &a, &p, None).map(drop)
    };
    let found = match file.split('.').next() {
        Some("chaser") => load_spacecraft_from(&sources, &model("chaser_8t")).map(drop),
        Some("active" | "passive") => mechanism("apas"),
        Some("bare" | "bare_passive") => mechanism("ring"),
        Some("stick") => mechanism("stick"),
        Some("probe" | "drogue") => mechanism("probe"),
        Some("rig") => load_rig_from(&sources, &model("stewart")).map(drop),
        Some("hexapod") => load_rig_from(&sources, &model("electric_hexapod")).map(drop),
        Some("measured") => load_rig_from(&sources, &model("electric_hexapod_measured")).map(drop),
        _ => {
            let loaded = Loader::new().sources(sources).load(&place(path_of(file)));
            return loaded.err().map(|e| e.problems).unwrap_or_default();
        }
    };
    found.err().map(|e| e.problems).unwrap_or_default()
}

fn listed(problems: &[Problem]) -> String {
    problems.iter().map(|p| format!("    {p}\n")).collect()
}

/// What is not as it should be with a case.
fn wrong(good: &Files, case: &Case) -> Option<String> {
    let (mut broken, about) = (good.clone(), case.broken[0].0);
    edit(&mut broken, &case.broken);
    let told = problems(&broken, about);
    if !told.iter().any(|p| is_of(&p.remedy, case.remedy)) {
        return Some(format!("{:?} is not said:\n{}", case.remedy, listed(&told)));
    }
    for (i, mend) in case.mends.iter().enumerate() {
        let mut mended = broken.clone();
        edit(&mut mended, mend);
        let left = problems(&mended, about);
        if !left.is_empty() {
            let way = i + 1;
            return Some(format!("{:?}, obeyed ({way}), leaves:\n{}", case.remedy, listed(&left)));
        }
    }
    None
}

#[test]
fn invariant_a_remedy_for_a_file_mends_it() {
    let good = shipped();
    for (file, _) in SHIPPED {
        assert!(problems(&good, file).is_empty(), "{file}");
    }
    let wrong: Vec<String> = cases().iter().filter_map(|c| wrong(&good, c)).collect();
    assert!(wrong.is_empty(), "{} remedies\n{}", wrong.len(), wrong.join("\n"));
}

/// Of this test: a remedy that does not mend is seen.
#[test]
fn invariant_a_remedy_that_does_not_mend_is_seen() {
    let broken: &[Edit] = &[("chaser.urdf", "\"7960.9\"", "\"-5\"")];
    let mends: &[&[Edit]] = &[&[("chaser.urdf", "\"-5\"", "\"-6\"")]];
    let text = wrong(&shipped(), &case("change the inertial in the URDF", broken, mends));
    assert!(text.is_some_and(|t| t.contains("obeyed (1), leaves")));
    let text = wrong(&shipped(), &case("make it longer", broken, mends));
    assert!(text.is_some_and(|t| t.contains("is not said")));
}

/// A text that lives as long as the test.
fn kept(text: String) -> &'static str {
    Box::leak(text.into_boxed_str())
}

/// A part of a shipped file, from one text to before another.
fn part(file: &str, from: &str, to: &str) -> &'static str {
    let text = text(file);
    let begin = text.find(from).expect("it begins");
    let end = text[begin + from.len()..].find(to).map_or(text.len(), |i| begin + from.len() + i);
    kept(text[begin..end].to_owned())
}

pub(crate) fn cases() -> Vec<Case> {
    let mut out = spacecraft_urdf();
    out.extend(trees());
    out.extend(meshes());
    out.extend(spacecraft_toml());
    out.extend(keys());
    out.extend(mechanism_parts());
    out.extend(attenuation());
    out.extend(both_sides());
    out.extend(surfaces());
    out.extend(drives());
    out.extend(rig_files());
    out.extend(rig_geometry());
    out.extend(scenario());
    out
}

fn spacecraft_urdf() -> Vec<Case> {
    const U: &str = "chaser.urdf";
    const MASS: &str = "<mass value=\"7960.9\"/>";
    let n = 40;
    let deep = kept(format!("<gazebo>{}{}</gazebo></robot>", "<a>".repeat(n), "</a>".repeat(n)));
    let flat = kept(format!("<gazebo>{}</gazebo></robot>", "<a/>".repeat(n)));
    let attributes: String = (0..70).map(|i| format!("a{i}=\"\" ")).collect();
    let crowded = kept(format!("<robot {attributes}name=\"chaser_8t\">"));
    let comments = kept(format!("{}</robot>", "<!-- -->".repeat(60_000)));
    let link = |i: usize| {
        format!(
            "<link name=\"l{i}\"/><joint name=\"j{i}\" type=\"fixed\"><parent link=\"port\"/>\
             <child link=\"l{i}\"/></joint>"
        )
    };
    let links = kept(format!("{}</robot>", (0..1000).map(link).collect::<String>()));
    let inertial = part(U, "<inertial>", "<visual>");
    vec![
        undo("change the value", &[(U, "value=\"7960.9\"", "value=\"heavy\"")]),
        undo("change the value", &[(U, "xyz=\"3.5 0 0\"", "xyz=\"3.5e6 0 0\"")]),
        undo("change the name", &[(U, "robot name=\"chaser_8t\"", "robot name=\"&#x9b;\"")]),
        undo(
            "remove it: `{tag}` has no elements inside",
            &[(U, MASS, "<mass value=\"7960.9\"><x/></mass>")],
        ),
        case(
            "remove it or use one of {}",
            &[(U, "<visual>", "<visual><colour name=\"grey\"/>")],
            &[
                &[(U, "<colour name=\"grey\"/>", "")],
                &[(U, "<colour name=\"grey\"/>", "<material name=\"grey\"/>")],
            ],
        ),
        undo("remove it; known here: {}", &[(U, "<mass ", "<mass unit=\"kg\" ")]),
        undo(
            "remove it: `{tag}` has no attributes",
            &[(U, "<inertial>", "<inertial unit=\"kg\">")],
        ),
        undo("remove the text", &[(U, "<parent link", "text<parent link")]),
        undo("add one `{name}`", &[(U, MASS, "<!-- no mass -->")]),
        undo("leave one `{name}`", &[(U, MASS, "<mass value=\"1\"/><mass value=\"7960.9\"/>")]),
        undo("add {name}=\"…\"", &[(U, "<inertia ixx=\"7254.37\" ", "<inertia ")]),
        undo("mend the element", &[(U, "type=\"fixed\"", "type=\"glued\"")]),
        case("URDF needs six: close the elements", &[(U, "</robot>", deep)], &[&[(U, deep, flat)]]),
        undo("URDF needs six at most: remove them", &[(U, "<robot name=\"chaser_8t\">", crowded)]),
        undo(
            "a model of a docking needs some hundred: leave out what is not needed",
            &[(U, "</robot>", comments)],
        ),
        undo("remove `<!DOCTYPE …>`", &[(U, "<robot ", "<!DOCTYPE robot []><robot ")]),
        undo("write well-formed XML", &[(U, "</robot>", "</robt>")]),
        undo(
            "the outermost element of a URDF is `robot`; expand xacro first",
            &[(U, "<robot ", "<model "), (U, "</robot>", "</model>")],
        ),
        undo("leave out links that carry no mass", &[(U, "</robot>", links)]),
        undo("change the inertial in the URDF", &[(U, MASS, "<mass value=\"-5\"/>")]),
        undo("change the inertial in the URDF", &[(U, "iyy=\"36134.193\"", "iyy=\"-1\"")]),
        undo("make the joint fixed", &[(U, "type=\"fixed\"", "type=\"floating\"")]),
        undo("add an inertial with mass and inertia", &[(U, inertial, "<!-- no mass -->")]),
    ]
}

/// Links and joints that are no tree.
fn trees() -> Vec<Case> {
    const U: &str = "chaser.urdf";
    const PORT: &str = "<link name=\"port\"/>";
    const END: &str = "</robot>";
    const SPARE: &str = "<link name=\"spare\"/><joint name=\"body_port\" type=\"fixed\"><parent link=\"body\"/>\
                         <child link=\"spare\"/></joint></robot>";
    const TWICE: &str = "<joint name=\"two\" type=\"fixed\"><parent link=\"body\"/><child link=\"port\"/></joint>\
                         </robot>";
    const BACK: &str = "<joint name=\"back\" type=\"fixed\"><parent link=\"port\"/><child link=\"body\"/></joint>\
                        </robot>";
    const X: &str = "<link name=\"x\"/></robot>";
    const HANGS: &str = "<joint name=\"x\" type=\"fixed\"><parent link=\"body\"/><child link=\"x\"/></joint></robot>";
    const CYCLE: &str = "<link name=\"x\"/><link name=\"y\"/>\
                         <joint name=\"xy\" type=\"fixed\"><parent link=\"x\"/><child link=\"y\"/></joint>\
                         <joint name=\"yx\" type=\"fixed\"><parent link=\"y\"/><child link=\"x\"/></joint></robot>";
    let renamed = kept(SPARE.replace("body_port", "body_spare"));
    vec![
        undo("rename or remove one", &[(U, PORT, "<link name=\"port\"/><link name=\"port\"/>")]),
        case("rename or remove one", &[(U, END, SPARE)], &[&[(U, SPARE, renamed)]]),
        undo(
            "add the link or name one of {}",
            &[(U, "<child link=\"port\"/>", "<child link=\"prot\"/>")],
        ),
        undo("add the link or name one of {}", &[(U, PORT, "<!-- port -->")]),
        undo("a URDF is a tree: leave one; loops are closed in the TOML", &[(U, END, TWICE)]),
        undo(
            "a URDF is a tree: remove the joint above the link that is to be its root",
            &[(U, END, BACK)],
        ),
        case("join the links by joints into one tree", &[(U, END, X)], &[&[(U, END, HANGS)]]),
        case(
            "a URDF is a tree: cut the cycle and let one of its links hang on the others",
            &[(U, END, CYCLE)],
            &[&[(U, "<parent link=\"y\"/>", "<parent link=\"body\"/>")]],
        ),
    ]
}

fn meshes() -> Vec<Case> {
    const U: &str = "chaser.urdf";
    const HULL: &str = "\"../../meshes/chaser_8t_hull.obj\"";
    const SCALED: &str = "\"../../meshes/chaser_8t_hull.obj\" scale=\"0.001 0.001 0.001\"";
    let named = |remedy, name| undo(remedy, &[(U, HULL, name)]);
    vec![
        named(
            "give the path from the folder of the URDF",
            "\"/shipped/meshes/chaser_8t_hull.obj\"",
        ),
        named("give the path from the folder of the URDF", "\"package://x/chaser_8t_hull.obj\""),
        named(
            "name a file that ends in .obj, .stl, .dae, .ply, .gltf or .glb",
            "\"../../meshes/chaser_8t_hull\"",
        ),
        named(
            "put it into the folder of the URDF, or at most two folders above that, such as \
             `../../meshes/NAME.obj`",
            "\"../../../meshes/chaser_8t_hull.obj\"",
        ),
        named("run `cargo xtask meshes`, or mend the file name", "\"../../meshes/hull.obj\""),
        named(
            "multiply the vertices in the file by the scale, then remove the scale from the URDF",
            SCALED,
        ),
    ]
}

fn spacecraft_toml() -> Vec<Case> {
    const U: &str = "chaser.urdf";
    const T: &str = "chaser.toml";
    const MASS: &str = "give masses in kg (CAD often writes g), and the hull its size in m";
    const INERTIA: &str = "give inertias in kg·m² about the mass centre (CAD often writes kg·mm² or g·mm²), \
                           and the hull its size in m";
    const SMALL: &str = "give inertias in kg·m² about the mass centre, and masses in kg";
    let iyy = ("iyy=\"36134.193\" iyz=\"0\" izz=\"36134.193\"", "ixx=\"7254.37\"");
    let mm2 = "iyy=\"36134193000\" iyz=\"0\" izz=\"36134193000\"";
    let tiny = "iyy=\"3.6e-4\" iyz=\"0\" izz=\"3.6e-4\"";
    vec![
        undo(MASS, &[(U, "\"7960.9\"", "\"7960900\"")]),
        undo(MASS, &[(T, "value = 1.35", "value = 0.0135"), (T, "value = 7.0", "value = 0.07")]),
        undo(INERTIA, &[(U, iyy.0, mm2), (U, iyy.1, "ixx=\"7254370000\"")]),
        undo(INERTIA, &[(U, "\"7960.9\"", "\"7.9609\"")]),
        undo(SMALL, &[(U, iyy.0, tiny), (U, iyy.1, "ixx=\"7.2e-5\"")]),
        case(
            "name one of {names}, or add it to the URDF",
            &[(T, "port_link = \"port\"", "port_link = \"prt\"")],
            &[
                &[(T, "port_link = \"prt\"", "port_link = \"port\"")],
                &[(
                    U,
                    "</robot>",
                    "<link name=\"prt\"/><joint name=\"prt\" type=\"fixed\"><parent link=\"port\"/>\
                     <child link=\"prt\"/></joint></robot>",
                )],
            ],
        ),
        undo(
            "remove it: the number itself stands in the URDF",
            &[(T, "mass_kg = { source", "mass_kg = { value = 1.0, source")],
        ),
    ]
}

/// Keys of any TOML.
fn keys() -> Vec<Case> {
    const T: &str = "chaser.toml";
    const S: &str = "scenario";
    let radius = part(T, "radius_m = {", "length_m");
    let note = part(T, "com_m = {", "port =");
    let hull = part(T, "[hull]", "\0");
    let nested = kept(format!("roll_deg = {}2.0{}", "[".repeat(90), "]".repeat(90)));
    let unknown: String = (0..150).map(|i| format!("colour_of_part_{i} = 1\n")).collect();
    let many = kept(format!("{unknown}[chaser]"));
    vec![
        undo("change the value", &[(T, "value = 1.35", "value = 0")]),
        undo("change the value", &[(S, "roll_deg = 2.0", "roll_deg = \"two\"")]),
        undo("add {key} = {NOTED}", &[(T, radius, "# no radius\n")]),
        undo("add {key} = {NOTE}", &[(T, note, "# no note\n")]),
        undo("write {key} = {form}", &[(T, radius, "radius_m = 1.35\n")]),
        case(
            "write {key} = {form}",
            &[(T, note, "com_m = {}\n")],
            &[&[(T, "com_m = {}", "com_m = { source = \"measured\" }")]],
        ),
        case(
            "write {key} = {form}",
            &[(T, radius, "radius_m = { value = 1.35, source = \"a\", assumed = \"b\" }\n")],
            &[&[(T, ", assumed = \"b\"", "")]],
        ),
        undo("add the key `{key}`", &[(S, "axial_speed_m_s = 0.07\n", "# none\n")]),
        undo("add the key `{key}`", &[(T, "kind = \"spacecraft\"", "# no kind")]),
        undo("add [{}] with its keys", &[(T, hull, "# no hull\n")]),
        undo("remove it", &[(T, "value = 1.35,", "value = 1.35, colour = \"red\",")]),
        undo("remove it", &[(S, "[chaser]", "colour_of_it = \"red\"\n[chaser]")]),
        undo("remove it", &[(S, "roll_deg = 2.0", "rol_deg = 1.0\nroll_deg = 2.0")]),
        undo("remove it: `{m}` is given already", &[(S, "[run]", "[run]\nroll_deg = 3.0")]),
        undo("did you mean `{m}`?", &[(S, "roll_deg = 2.0", "rol_deg = 2.0")]),
        case(
            "did you mean `{m}`?",
            &[(S, "[run]", "[run]\ngap_m = 0.1")],
            &[&[(S, "[run]\ngap_m = 0.1", "[run]"), (S, "[initial]", "[initial]\ngap_m = 0.1")]],
        ),
        undo(
            "no key of docktwin is deeper than five: flatten it",
            &[(S, "roll_deg = 2.0", nested)],
        ),
        undo("write valid TOML on this line", &[(S, "[initial]", "[initial")]),
        undo("add `schema = {v}`", &[(T, "schema = 1\n", "")]),
        undo("mend those above first", &[(S, "[chaser]", many)]),
    ]
}

fn mechanism_parts() -> Vec<Case> {
    const A: &str = "active.toml";
    const U: &str = "active.urdf";
    vec![
        undo(
            "make the section thinner than the ring",
            &[("bare.toml", "mean_radius_m = { value = 0.6", "mean_radius_m = { value = 0.02")],
        ),
        case(
            "make the section thinner than the ring",
            &[("bare.toml", "mean_radius_m = { value = 0.6", "mean_radius_m = { value = 0.02")],
            &[&[(
                "bare.toml",
                "section_radius_m = { value = 0.025",
                "section_radius_m = { value = 0.01",
            )]],
        ),
        undo(
            "make the half-angles smaller",
            &[(A, "base_half_angle_deg = { value = 28.0", "base_half_angle_deg = { value = 61.0")],
        ),
        undo(
            "make the petal thinner",
            &[(A, "thickness_m = { value = 0.02", "thickness_m = { value = 0.19")],
        ),
        undo(
            "bring the base within the section of the ring",
            &[(A, "base_radius_m = { value = 0.597", "base_radius_m = { value = 0.5")],
        ),
        undo(
            "make the opening wider than the stick",
            &[(
                "stick.toml",
                "frame_opening_m = { value = 0.0275",
                "frame_opening_m = { value = 0.0075",
            )],
        ),
        undo(
            "make element ij equal to element ji",
            &[(A, "  [0.0, 6.4, 0.0],", "  [0.1, 6.4, 0.0],")],
        ),
        undo("change the tensor", &[(A, "  [12.7, 0.0, 0.0],", "  [13.7, 0.0, 0.0],")]),
        undo(
            "make it at least as large",
            &[(A, "friction_static = { value = 0.1", "friction_static = { value = 0.05")],
        ),
        undo(
            "a latch is struck before it catches: make it larger",
            &[(A, "strike_gap_m = { value = 0.006", "strike_gap_m = { value = 0.002")],
        ),
        undo(
            "a latch approaches before it is struck: make it larger",
            &[(A, "approach_gap_m = { value = 0.05", "approach_gap_m = { value = 0.001")],
        ),
        undo(
            "spread the three latches, 30° or more apart",
            &[(A, "[0.0, 120.0, 240.0]", "[0.0, 10.0, 240.0]")],
        ),
        undo(
            "change the URDF: the parameter with its source stands in {}",
            &[(U, "xyz=\"0.3 0 0\"", "xyz=\"0.31 0 0\"")],
        ),
        undo(
            "change the URDF: the parameter with its source stands in {}",
            &[(U, "<mass value=\"39.1\"/>", "<mass value=\"39.2\"/>")],
        ),
        undo("change the type", &[(U, "type=\"floating\"", "type=\"fixed\"")]),
    ]
}

fn attenuation() -> Vec<Case> {
    const A: &str = "active.toml";
    const AXIAL: &str = "loading_n_over_m = { value = [[0.0, 0.0], [0.15, 45000.0]]";
    const RAMP: &str = "damping_ramp_s = { value = 0.2, assumed = \"a test\" }\n";
    let last = part(A, "# pair difference, second", "# One latch");
    let characteristic = part(A, "[attenuation.characteristic.axial]", "# Six screw legs");
    let differential = part(A, "[attenuation.differential]", "# One latch");
    let described = |tables: &str, word: &str| {
        kept(format!("default = \"{word}\"\n{RAMP}\n{tables}\n# Passing one"))
    };
    const S: &str = "scenario";
    let rest = "default = \"rigid\"\n\n# Passing one";
    let asked = "default = \"characteristic\"\n\n# Passing one";
    let with = described(characteristic, "characteristic");
    let mechanism = "passive = \"models/urdf/apas_passive.urdf\"\n";
    let chosen = kept(format!("{mechanism}attenuation = \"differential\"\n"));
    let other = kept(format!("{mechanism}attenuation = \"characteristic\"\n"));
    let coupling = part(A, "  [0.577350269189626, 0.577350269189626", "\n");
    let doubled = part(A, "  [0.166666666666667, 0.166666666666667", "\n");
    let base = part(A, "  [0.000000000, 0.512206990, 0.400179959],", "], assumed");
    let ring = part(A, "  [0.000000000, 0.342401161, 0.468146820],", "], assumed");
    let brake = "series_brake = { force_n = { value = 2500.0, assumed = \"default parameter set of the project, \
                 chosen after seeing outcomes: friction brake in series with spring and damper\" }, viscous_n_s_m \
                 = { value = 500.0";
    let dry = kept(brake.replace("{ value = 500.0", "{ value = 0.0"));
    let damping = "damping_before_capture_n_s_m = { value = 4000.0";
    let none = "damping_before_capture_n_s_m = { value = 0.0";
    vec![
        case(
            "add the table [attenuation.<choice>] or name another default",
            &[("bare.toml", rest, asked)],
            &[&[("bare.toml", asked, with)], &[("bare.toml", asked, rest)]],
        ),
        case(
            "add the table, or choose another attenuation",
            &[(S, mechanism, chosen), (A, differential, "# no legs\n\n")],
            &[&[(A, "# no legs\n\n", differential)], &[(S, chosen, other)]],
        ),
        case(
            "give the damping or the brake's viscous part a value above 0",
            &[(A, brake, dry), (A, damping, none)],
            &[&[(A, none, damping)], &[(A, dry, brake)]],
        ),
        undo(
            "lower it to the loading branch or below",
            &[(
                A,
                &AXIAL.replace("loading", "unloading").leak()[..],
                kept(AXIAL.replace("loading", "unloading").replace("45000", "46000")),
            )],
        ),
        undo(
            "start with [0, F0]",
            &[(A, AXIAL, kept(AXIAL.replace("[[0.0, 0.0]", "[[0.01, 0.0]")))],
        ),
        undo(
            "sort or mend the points",
            &[(A, AXIAL, kept(AXIAL.replace("]]", "], [0.1, 46000.0]]")))],
        ),
        undo("give [[attenuation.differential.channels]] six times", &[(A, last, "# five\n")]),
        undo("make the six rows independent", &[(A, coupling, doubled)]),
        undo(
            "move the joints, so that the legs are neither parallel nor meet in one line",
            &[(A, ring, base)],
        ),
    ]
}

fn both_sides() -> Vec<Case> {
    const A: &str = "active.toml";
    const P: &str = "passive.toml";
    const U: &str = "passive.urdf";
    let narrow = "base_half_angle_deg = { value = 28.0";
    let (tip, wide_tip) =
        ("tip_half_angle_deg = { value = 14.0", "tip_half_angle_deg = { value = 37.0");
    let thick = "thickness_m = { value = 0.02";
    let first = "<child link=\"petal_0\"/>\n    <origin xyz=\"0 0 0\" rpy=\"0 0 0\"/>";
    let turned = kept(first.replace("rpy=\"0 0 0\"", "rpy=\"1.0471975511965976 0 0\""));
    vec![
        undo(
            "give both sides the same count",
            &[(P, "count = { value = 3", "count = { value = 4")],
        ),
        undo(
            "make one of the half-angles smaller",
            &[(P, narrow, "base_half_angle_deg = { value = 33.0")],
        ),
        case(
            "make the petals of one side narrower or thinner",
            &[(A, tip, wide_tip), (P, tip, wide_tip)],
            &[
                &[(P, wide_tip, tip), (P, narrow, "base_half_angle_deg = { value = 20.0")],
                &[(P, thick, "thickness_m = { value = 0.002")],
            ],
        ),
        undo(
            "turn the petals, in the URDF too, to first_azimuth_deg = {deg:.3}",
            &[
                (P, "first_azimuth_deg = { value = 0.0", "first_azimuth_deg = { value = 60.0"),
                (U, "rpy=\"4.1887902047863905 0 0\"", "rpy=\"5.235987755982989 0 0\""),
                (U, "rpy=\"2.0943951023931953 0 0\"", "rpy=\"3.141592653589793 0 0\""),
                (U, first, turned),
            ],
        ),
        undo(
            "let both lean the same way",
            &[(P, "tip_radius_m = { value = 0.41", "tip_radius_m = { value = 0.8")],
        ),
        case(
            "move the base away from the ring circle, or make the petals thinner",
            &[(A, "base_radius_m = { value = 0.597", "base_radius_m = { value = 0.602")],
            &[
                &[(A, "base_radius_m = { value = 0.602", "base_radius_m = { value = 0.597")],
                &[(A, thick, "thickness_m = { value = 0.01")],
            ],
        ),
        undo(
            "put the latches where the passive ring is free",
            &[(A, "[0.0, 120.0, 240.0]", "[60.0, 180.0, 300.0]")],
        ),
    ]
}

/// Surfaces listed by file, and latches of their own.
#[expect(clippy::too_many_lines, reason = "a table of inputs")]
fn surfaces() -> Vec<Case> {
    const P: &str = "probe.toml";
    const D: &str = "drogue.toml";
    let number = |x: &str| format!("{{ value = {x}, assumed = \"a test\" }}");
    let surface = |name: &str, kind: &str, more: &str| {
        format!(
            "[[surface]]\nname = \"{name}\"\nkind = \"{kind}\"\nlink = \"ring\"\nposition_m = {0}\nrpy_deg = {0}\n\
             rounding_m = {1}\nstiffness_n_m = {2}\nfriction = {1}\n{more}\n",
            number("[0.0, 0.0, 0.0]"),
            number("0.1"),
            number("1e6"),
        )
    };
    let before = |what: &str| kept(format!("{what}[ring_body]"));
    let points = |n: usize| {
        let each = |i: usize| format!("[0.0, {:.4}, {:.4}]", (i as f64).sin(), (i as f64).cos());
        let all: Vec<String> = (0..n).map(each).collect();
        format!("points_m = {}", number(&format!("[{}]", all.join(", "))))
    };
    let hull = before(&surface("hull", "hull", &points(65)));
    let torus = before(&surface("torus", "torus", &format!("core_radius_m = {}", number("0.05"))));
    let balls: String = (0..47).map(|i| surface(&format!("ball_{i}"), "sphere", "")).collect();
    let latch = part(P, "[[latch]]", "\n\n");
    let again = kept(format!("{latch}\n\n{latch}"));
    let many: String =
        (0..13).map(|i| latch.replace("\"socket\"", &format!("\"socket_{i}\"")) + "\n\n").collect();
    let latches = part("active.toml", "[latches]", "\n\n");
    let both = kept(format!("{latches}\n\n{latch}"));
    let boxed = "kind = \"box\"\nlink = \"head\"\nsize_m = { value = [0.01, 0.01, 0.01], assumed = \"a test\" }";
    let drogue = part(D, "[[surface]]", "no such text");
    vec![
        undo("choose another name", &[(P, "name = \"stem\"", "name = \"probe_head\"")]),
        undo("choose another name", &[(P, latch, again)]),
        undo("make the section thinner than the circle", &[(P, "[ring_body]", torus)]),
        undo(
            "leave out points inside the hull, or make two surfaces of it",
            &[(P, "[ring_body]", hull)],
        ),
        undo(
            "leave points out, or make two surfaces of it",
            &[(
                D,
                "  [0.08, 0.06],",
                "  [0.01, 0.06],\n  [0.02, 0.06],\n  [0.03, 0.06],\n  [0.08, 0.06],",
            )],
        ),
        undo(
            "points are (x, radius), the radius 0 on the axis and else above",
            &[(D, "[0.08, 0.06]", "[0.08, -0.06]")],
        ),
        undo("take one of them out", &[(D, "  [0.08, 0.06],", "  [0.0, 0.06],\n  [0.08, 0.06],")]),
        undo("leave some out", &[(P, latch, kept(many))]),
        undo("keep one of both", &[(P, latch, both)]),
        undo(
            "write `all`, `any`, or names of latches with commas between them",
            &[(P, "captured_when = \"all\"", "captured_when = \"hook\"")],
        ),
        undo("name one of {}", &[(D, "link = \"drogue\"", "link = \"nowhere\"")]),
        undo("name `ring` or a link fixed to it", &[(P, "link = \"head\"", "link = \"mount\"")]),
        undo(
            "make one of them of another kind (spheres and capsules touch every kind), take one out, or \
             place it out of reach",
            &[(P, "kind = \"sphere\"\nlink = \"head\"", boxed)],
        ),
        undo(
            "make it smaller, or the rounding of one of them larger",
            &[(P, "depth_m = { value = 0.02", "depth_m = { value = 0.035")],
        ),
        case(
            "make it 0.04 m or less",
            &[("bare.toml", "depth_m = { value = 0.04", "depth_m = { value = 0.05")],
            &[&[("bare.toml", "depth_m = { value = 0.05", "depth_m = { value = 0.04")]],
        ),
        undo(
            "take surfaces out, or make one hull of several",
            &[(P, "[ring_body]", before(&balls))],
        ),
        undo("add [ring] or a [[surface]]", &[(D, drogue, "# no surface\n")]),
        undo(
            "add [ring], or take [petals] out",
            &[("passive.toml", part("passive.toml", "[ring]", "\n\n"), "# no ring")],
        ),
    ]
}

fn drives() -> Vec<Case> {
    const M: &str = "measured.toml";
    const ROW: &str = "  [10, 0.828";
    let rows = part(M, "response_hz_1_deg = { value = [", "\n],");
    let alone = "response_hz_1_deg = { value = [\n  [2.308, 1.0, -18.1],\n  [2.308, 1.0, -18.2],";
    let many = kept(format!("{}  [0.235, 0.9999", "  [0.5, 1.0, -3.9],\n".repeat(1000)));
    vec![
        undo(
            "remove the table",
            &[("hexapod.toml", "[sensors]\n", "[friction]\ncoulomb_n = 1.0\n[sensors]\n")],
        ),
        undo(
            "give rows of frequency (0.01 to 200 Hz), gain (0.01 to 10) and phase in degrees",
            &[(M, "  [0.235, 0.9999", "  [0.235, 90.9999")],
        ),
        undo("give 2 to 1000 rows", &[(M, "  [0.235, 0.9999", many)]),
        undo("give rows of two frequencies or more", &[(M, rows, alone)]),
        undo(
            "give frequencies in Hz, phases in degrees with late negative, and `delay_s` of the same identification",
            &[(M, "lag_s = { value = 0.0", "lag_s = { value = 0.03")],
        ),
        case(
            "leave out frequencies above those that dockings have, 5 Hz, or measure it again with `rig identify`",
            &[(M, ROW, "  [10, 2.828")],
            &[&[(M, "  [10, 2.828", "  # [10, 2.828")], &[(M, "  [10, 2.828", ROW)]],
        ),
    ]
}

#[expect(clippy::too_many_lines, reason = "a table of inputs")]
fn rig_files() -> Vec<Case> {
    const T: &str = "rig.toml";
    const U: &str = "rig.urdf";
    let loop_5 = part(T, "[[closures]]\nrod = \"rod_5\"", "\0");
    let rod = part(U, "<link name=\"rod_0\">\n    <inertial>", "</inertial>");
    let rod_0 = "<axis xyz=\"1 0 0\"/>\n    <limit lower=\"-1.12\" upper=\"1.28\" effort=\"60000\"";
    let spare = "<link name=\"spare\"/><joint name=\"spare\" type=\"revolute\"><parent link=\"ground\"/>\
                 <child link=\"spare\"/><axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" effort=\"0\" \
                 velocity=\"1\"/></joint></robot>";
    let fixed = "<link name=\"spare\"/><joint name=\"spare\" type=\"fixed\"><parent link=\"ground\"/>\
                 <child link=\"spare\"/></joint></robot>";
    let plate = "<joint name=\"ground_plate\" type=\"floating\">\n    <parent link=\"ground\"/>";
    let swing = "<joint name=\"swing_0\" type=\"revolute\">\n    <parent link=\"ground\"/>";
    let slides = "rpy=\"0 0 0\"/>\n    <axis xyz=\"1 0 0\"/>";
    let cross = "<link name=\"cross_0\">\n    <inertial>\n      <origin xyz=\"0 0 0\"";
    let tilt = "<child link=\"cylinder_0\"/>\n    <origin xyz=\"0 0 0\"";
    let stroke = "<origin xyz=\"4.182172066592 0 0\"";
    vec![
        case(
            "name one of {}, or add it to the URDF",
            &[(T, "rack = \"rack\"", "rack = \"bench\"")],
            &[
                &[(T, "rack = \"bench\"", "rack = \"rack\"")],
                &[
                    (U, "<link name=\"rack\"/>", "<link name=\"bench\"/>"),
                    (U, "child link=\"rack\"", "child link=\"bench\""),
                    (U, "parent link=\"rack\"", "parent link=\"bench\""),
                ],
            ],
        ),
        undo("write six tables [[closures]], one for each rod", &[(T, loop_5, "# five\n")]),
        undo(
            "make it at least the Coulomb friction",
            &[(T, "static_n = { value = 650.0", "static_n = { value = 400.0")],
        ),
        undo(
            "change the type of the joint",
            &[(U, "\"stroke_0\" type=\"prismatic\"", "\"stroke_0\" type=\"fixed\"")],
        ),
        undo(
            "it is the root: name another link in the TOML",
            &[(T, "rod = \"rod_0\"", "rod = \"ground\"")],
        ),
        undo(
            "name the root as links.ground, or hang everything on this link",
            &[(T, "ground = \"ground\"", "ground = \"rack\"")],
        ),
        undo(
            "add an inertial with mass and inertia",
            &[
                (U, rod, "<link name=\"rod_0\"><!-- "),
                (
                    U,
                    "</inertial>\n  </link>\n  <joint name=\"swing_0\"",
                    "-->\n  </link>\n  <joint name=\"swing_0\"",
                ),
            ],
        ),
        undo(
            "close every loop once, each with a rod of its own",
            &[(T, "rod = \"rod_1\"", "rod = \"rod_0\" # again")],
        ),
        case(
            "fix it to one of them, or remove it",
            &[(U, "</robot>", spare)],
            &[&[(U, spare, fixed)], &[(U, spare, "</robot>")]],
        ),
        undo(
            "make the ground its parent",
            &[(U, plate, kept(plate.replace("\"ground\"/", "\"rack\"/")))],
        ),
        undo(
            "make the ground its parent",
            &[(U, swing, kept(swing.replace("\"ground\"/", "\"rack\"/")))],
        ),
        case(
            "write this p_34, or move the plate by its floating joint and close the loops there",
            &[(T, "middle_p_34_m = { value = [0.6,", "middle_p_34_m = { value = [0.7,")],
            &[&[(T, "middle_p_34_m = { value = [0.7,", "middle_p_34_m = { value = [0.6,")]],
        ),
        undo(
            "let the floating joint of the URDF turn the plate until R_34 is not turned, and the loops close \
             there",
            &[(
                U,
                "<origin xyz=\"2.6 0 0\" rpy=\"0 0 0\"",
                "<origin xyz=\"2.6 0 0\" rpy=\"0.01 0 0\"",
            )],
        ),
        undo(
            "give all six rods the same limits",
            &[(U, rod_0, kept(rod_0.replace("60000", "50000")))],
        ),
        undo(
            "join them by fixed joints",
            &[(
                U,
                "<joint name=\"rack_active\" type=\"fixed\"",
                "<joint name=\"rack_active\" type=\"floating\"",
            )],
        ),
        undo("move its plate joint away from its base", &[(U, stroke, "<origin xyz=\"0.0 0 0\"")]),
        undo(
            "turn its axis, or move the joints",
            &[(U, slides, kept(slides.replace("1 0 0", "1 0.1 0")))],
        ),
        undo(
            "put the mass centre of the cross at its joint",
            &[(U, cross, kept(cross.replace("0 0 0", "0.1 0 0")))],
        ),
        undo("give the axis a direction", &[(U, "<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 0 0\"/>")]),
        undo("give it the origin 0 0 0", &[(U, tilt, kept(tilt.replace("0 0 0", "0.1 0 0")))]),
        undo(
            "make the three axes perpendicular; turn one that points backwards",
            &[(U, "<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 -1 0\"/>")],
        ),
        undo(
            "mend the points, or the origins of the rod's joint and of the plate's",
            &[(
                T,
                "rod_point_m = { value = [0.0, 0.0, 0.0]",
                "rod_point_m = { value = [0.01, 0.0, 0.0]",
            )],
        ),
        undo("make lower < 0 < upper", &[(U, "lower=\"-0.7\"", "lower=\"0.1\"")]),
        undo("make both positive", &[(U, rod_0, kept(rod_0.replace("60000", "0")))]),
        undo(
            "put the mass centre on the axis and make ixx = a, iyy = izz = t, the others 0",
            &[(U, "<origin xyz=\"-1.35 0 0\"", "<origin xyz=\"-1.35 0.1 0\"")],
        ),
    ]
}

fn rig_geometry() -> Vec<Case> {
    const T: &str = "rig.toml";
    const U: &str = "rig.urdf";
    const SMALLER: &str = "or make the workspace smaller";
    let axial = "axial_m = { value = 0.3";
    let lateral = "lateral_m = { value = 0.3";
    let small: [Edit; 4] = [
        (T, axial, "axial_m = { value = 0.05"),
        (T, lateral, "lateral_m = { value = 0.02"),
        (T, "roll_deg = { value = 15.0", "roll_deg = { value = 2.0"),
        (T, "pitch_yaw_deg = { value = 7.0", "pitch_yaw_deg = { value = 1.0"),
    ];
    let lie = "gravity_m_s2 = { value = [0.0, 0.0, -9.81]";
    let stand = "gravity_m_s2 = { value = [-9.81, 0.0, 0.0]";
    let balance = part(T, "[offload]", "# Half-widths");
    let text = text(U);
    let weak = kept(text.replace("effort=\"60000\"", "effort=\"5000\""));
    let text = kept(text);
    let light = kept(weak.replacen("<mass value=\"2300\"/>", "<mass value=\"300\"/>", 1));
    let shorter = |limit: &str| kept(format!("{limit} of its rod, {SMALLER}"));
    vec![
        case(
            shorter("lower the limit"),
            &[(U, "lower=\"-1.12\"", "lower=\"-0.9\"")],
            &[&[(U, "lower=\"-0.9\"", "lower=\"-1.12\"")], &small],
        ),
        case(
            shorter("raise the limit"),
            &[(U, "upper=\"1.28\"", "upper=\"1.0\"")],
            &[&[(U, "upper=\"1.0\"", "upper=\"1.28\"")], &small],
        ),
        case(
            "raise the limit of the joint, or make the workspace smaller",
            &[(T, "ball_limit_deg = { value = 40.0", "ball_limit_deg = { value = 9.0")],
            &[&[(T, "ball_limit_deg = { value = 9.0", "ball_limit_deg = { value = 40.0")], &small],
        ),
        undo(
            "make the stroke shorter",
            &[(U, "lower=\"-1.12\" upper=\"1.28\"", "lower=\"-1.7\" upper=\"1.28\"")],
        ),
        case(
            "raise the effort, or make the plate lighter",
            &[(U, text, weak)],
            &[&[(U, weak, text)], &[(U, weak, light)]],
        ),
        case(
            "remove [offload], or give gravity",
            &[(T, stand, "gravity_m_s2 = { value = [0.0, 0.0, 0.0]")],
            &[
                &[(T, balance, "")],
                &[(T, "[0.0, 0.0, 0.0], assumed = \"9.81", "[-9.81, 0.0, 0.0], assumed = \"9.81")],
            ],
        ),
        case(
            "turn the docking axis into the vertical, or remove [offload]",
            &[(T, stand, lie)],
            &[&[(T, lie, stand)], &[(T, balance, "")]],
        ),
        case(
            "lower the stiffness, or make the added mass 0, which takes the hanger's stiffness into its friction",
            &[(T, "stiffness_n_m = { value = 2.0e5", "stiffness_n_m = { value = 9.0e7")],
            &[
                &[(T, "stiffness_n_m = { value = 9.0e7", "stiffness_n_m = { value = 2.0e5")],
                &[(T, "added_mass_kg = { value = 2.0", "added_mass_kg = { value = 0.0")],
            ],
        ),
        undo(
            "make the workspace smaller or the platform larger",
            &[(T, "roll_deg = { value = 15.0", "roll_deg = { value = 89.0")],
        ),
    ]
}

#[expect(clippy::too_many_lines, reason = "a table of inputs")]
fn scenario() -> Vec<Case> {
    const S: &str = "scenario";
    const LAW: &str = "[initial]";
    let contact = |keys: &str| kept(format!("[mechanism.contact]\n{keys}\n\n[initial]"));
    let (voigt, damped) =
        (contact("normal_law = \"kelvin_voigt\""), contact("damping_n_s_m = 4000.0"));
    let both = contact("normal_law = \"kelvin_voigt\"\ndamping_n_s_m = 4000.0");
    let slippery = contact("friction_kinetic = 0.3");
    let rough = contact("friction_kinetic = 0.3\nfriction_static = 0.3");
    let (stiff, bearable) = (contact("stiffness_n_m = 1e11"), contact("stiffness_n_m = 1e7"));
    let run = "duration_s = 30.0";
    let long = "duration_s = 100000.0\ntick_s = 0.00001";
    let steps = "duration_s = 1000.0\ntick_s = 0.00001\nsteps_per_tick = 10000";
    let thrust = "[[thrust]]\non = \"chaser\"\nafter = \"capture\"\nduration_s = 1.0\n";
    let [nothing, pushes, until] =
        ["", "force_x_n = 1.0\n", "force_x_n = 1.0\nuntil_capture = true\n"]
            .map(|more| kept(format!("{thrust}{more}[expect]")));
    let late = "[loop]\ncompensator = \"none\"\nlead_s = 0.01\n[expect]";
    let bound = "capture_before_s = 15.0";
    let bounds = part(S, "[[expect.fidelity]]", "no such text");
    let to_capture =
        "[[expect.fidelity]]\nof = \"felt\"\nwindow = \"to_capture\"\nnrms_pose_below = 0.1\n";
    let nothing_bound = "[[expect.fidelity]]\nof = \"felt\"\nwindow = \"to_capture\"\n";
    let twice = kept(format!("{to_capture}{nothing_bound}nrms_force_below = 0.1\n"));
    let once = kept(format!("{to_capture}nrms_force_below = 0.1\n"));
    vec![
        undo("change the name", &[(S, "name = \"apas_nominal\"", "name = \"../nominal\"")]),
        undo("add `schema = 1`", &[(S, "schema = 1\n", "")]),
        case(
            "make it larger, or initial.gap_m smaller",
            &[(S, "axial_speed_m_s = 0.07", "axial_speed_m_s = 0.00002\ngap_m = 0.05")],
            &[
                &[(S, "axial_speed_m_s = 0.00002", "axial_speed_m_s = 0.07")],
                &[(S, "gap_m = 0.05", "gap_m = 0.005")],
            ],
        ),
        case(
            "round it",
            &[(S, run, "duration_s = 30.0\ntick_s = 0.00033333333333")],
            &[&[(S, "0.00033333333333", "0.000333333")]],
        ),
        case(
            "make it shorter than duration_s",
            &[(S, run, "duration_s = 0.001\ntick_s = 0.002")],
            &[&[(S, "tick_s = 0.002", "tick_s = 0.0005")]],
        ),
        case(
            "shorten the run, or make run.tick_s longer",
            &[(S, run, long)],
            &[&[(S, "100000.0", "1000.0")], &[(S, "0.00001", "0.002")]],
        ),
        case(
            "make it smaller, or shorten the run",
            &[(S, run, steps)],
            &[&[(S, "= 10000", "= 10")], &[(S, "= 1000.0", "= 1.0")]],
        ),
        case(
            "remove it, or take a method that leads",
            &[(S, "[expect]", late)],
            &[
                &[(S, "lead_s = 0.01\n", "")],
                &[(S, "\"none\"", "\"lead\"")],
                &[(S, "\"none\"", "\"twin\"")],
            ],
        ),
        case(
            "give one, or remove the thrust",
            &[(S, "[expect]", nothing)],
            &[&[(S, nothing, pushes)], &[(S, nothing, "[expect]")]],
        ),
        case("remove it", &[(S, "[expect]", until)], &[&[(S, "until_capture = true\n", "")]]),
        case(
            "remove it",
            &[(S, "\"captured\"", "\"missed\""), (S, bounds, "")],
            &[&[(S, bound, "")]],
        ),
        case(
            "take `whole_run`",
            &[(S, "\"captured\"", "\"missed\""), (S, bound, ""), (S, bounds, to_capture)],
            &[&[(S, "\"to_capture\"", "\"whole_run\"")]],
        ),
        case(
            "add a bound, such as nrms_force_below = 0.06, or remove the table",
            &[(S, bounds, nothing_bound)],
            &[&[(S, nothing_bound, bounds)], &[(S, nothing_bound, "")]],
        ),
        case(
            "put all bounds of one comparison and window into one table",
            &[(S, bounds, twice)],
            &[&[(S, twice, once)]],
        ),
        case(
            "make it larger",
            &[(S, bound, "capture_after_s = 5.0\ncapture_before_s = 1.0")],
            &[&[(S, "capture_before_s = 1.0", "capture_before_s = 9.0")]],
        ),
        case(
            "add {tolerance} = 0.01",
            &[(S, bound, "peak_force_n = 1000.0")],
            &[&[(
                S,
                "peak_force_n = 1000.0",
                "peak_force_n = 1000.0\npeak_force_tolerance = 0.01",
            )]],
        ),
        case(
            "add `{value}`",
            &[(S, bound, "peak_force_tolerance = 0.01")],
            &[&[(S, "peak_force_tolerance", "peak_force_n = 1000.0\npeak_force_tolerance")]],
        ),
        undo(
            "mend the path; it counts from the folder of the scenario or one above it",
            &[(S, "models/urdf/chaser_8t.urdf", "models/chaser_8t.urdf")],
        ),
        undo(
            "name a model whose port faces the other",
            &[(S, "models/urdf/chaser_8t.urdf", "models/urdf/target_12t.urdf")],
        ),
        case("add it", &[(S, LAW, voigt)], &[&[(S, voigt, both)]]),
        case(
            "remove it, or set normal_law",
            &[(S, LAW, damped)],
            &[&[(S, damped, LAW)], &[(S, damped, both)]],
        ),
        case(
            "make {it} {most:.2e} at most{place}, or take run.steps_per_tick = {steps}",
            &[(S, LAW, stiff)],
            &[&[(S, stiff, bearable)], &[(S, run, "duration_s = 30.0\nsteps_per_tick = 1000")]],
        ),
        undo(
            "make {it} {most:.2e} at most{place}",
            &[(
                "scenario",
                LAW,
                contact(
                    "normal_law = \"kelvin_voigt\"\ndamping_n_s_m = 4000.0\nbristle_damping_s = 1.0\nbristle_breakaway_m = 1e-8",
                ),
            )],
        ),
        case(
            "set friction_static too, at least as large as friction_kinetic",
            &[(S, LAW, slippery)],
            &[&[(S, slippery, rough)]],
        ),
    ]
}
