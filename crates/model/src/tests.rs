use std::path::{Path, PathBuf};

use docktwin_core::{DMat3, DVec3};

use crate::*;

fn models() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf")
}

fn spacecraft(name: &str) -> Spacecraft {
    load_spacecraft(&models().join(name)).unwrap_or_else(|e| panic!("{name}: {e}")).model
}

fn mechanism(preset: &str, choice: Option<AttenuationChoice>) -> DockingMechanism {
    let side = |s: &str| models().join(format!("{preset}_{s}.urdf"));
    load_mechanism(&side("active"), &side("passive"), choice)
        .unwrap_or_else(|e| panic!("{preset}: {e}"))
        .model
}

/// A copy of the models with texts replaced; meshes are empty files.
struct Copy(tempfile::TempDir);

impl Copy {
    fn new(edits: &[(&str, &str, &str)]) -> Self {
        let dir = tempfile::tempdir().expect("a folder");
        let urdf = dir.path().join("models/urdf");
        let meshes = dir.path().join("meshes");
        std::fs::create_dir_all(&urdf).expect("a folder");
        std::fs::create_dir_all(&meshes).expect("a folder");
        for name in [
            "chaser_8t",
            "apas_active",
            "apas_passive",
            "probe_active",
            "probe_passive",
            "ring_active",
            "ring_passive",
        ] {
            for ext in ["urdf", "toml"] {
                let file = format!("{name}.{ext}");
                let mut text = std::fs::read_to_string(models().join(&file)).expect("model");
                for (_, from, to) in edits.iter().filter(|(f, _, _)| *f == file) {
                    assert!(text.contains(from), "{file} has no {from:?}: mend the case");
                    text = text.replacen(from, to, 1);
                }
                std::fs::write(urdf.join(file), text).expect("write");
            }
        }
        let parts = [
            "chaser_8t_hull",
            "apas_active_ring",
            "apas_active_petal",
            "ring_active_ring",
            "ring_passive_ring",
        ];
        for part in parts.iter().chain(&["apas_passive_ring", "apas_passive_petal"]) {
            std::fs::write(meshes.join(format!("{part}.obj")), "").expect("write");
        }
        Self(dir)
    }

    fn at(&self, file: &str) -> PathBuf {
        self.0.path().join("models/urdf").join(file)
    }

    fn problems_of(&self, preset: &str) -> Vec<Problem> {
        let side = |s: &str| self.at(&format!("{preset}_{s}.urdf"));
        load_mechanism(&side("active"), &side("passive"), None)
            .err()
            .map_or_else(Vec::new, |e| e.problems)
    }

    fn problems(&self) -> Vec<Problem> {
        let mut problems = Vec::new();
        if let Err(e) = load_spacecraft(&self.at("chaser_8t.urdf")) {
            problems.extend(e.problems);
        }
        let (a, p) = (self.at("apas_active.urdf"), self.at("apas_passive.urdf"));
        if let Err(e) = load_mechanism(&a, &p, None) {
            problems.extend(e.problems);
        }
        problems
    }
}

#[test]
fn regress_every_model_loads() {
    for name in
        ["chaser_8t", "target_12t", "heavy_100t", "heavy_100t_target", "light_575kg", "test_8t"]
    {
        let craft = spacecraft(&format!("{name}.urdf"));
        assert_eq!(craft.name, name);
    }
    for preset in ["apas", "apas75"] {
        for (_, choice) in AttenuationChoice::WORDS {
            assert_eq!(mechanism(preset, Some(choice)).name, format!("{preset}_active"));
        }
    }
    for preset in ["ring", "guide"] {
        assert_eq!(mechanism(preset, None).attenuator, Attenuator::Rigid);
    }
}

#[test]
fn regress_apas_is_the_published_set() {
    let m = mechanism("apas", None);
    assert!((m.docked_length_m() - 0.450).abs() < 1e-12);
    assert!((m.ring_body.mass_kg - 39.1).abs() < 1e-12);
    let p = m.active.petals.expect("petals");
    assert_eq!(p.count, 3);
    assert!((p.base_half_angle_rad.to_degrees() - 28.0).abs() < 1e-12);
    assert!((m.outcome.settled_rate_rad_s.to_degrees() - 0.1).abs() < 1e-12);
    let Attenuator::Characteristic(c) = m.attenuator else { panic!("default attenuation") };
    assert!((c.tilt.travel_negative.to_degrees() - 10.0).abs() < 1e-12);
    assert!(c.axial.series_brake.is_some() && c.roll.series_brake.is_none());
    assert!(
        m.contact.normal
            == NormalLaw::HuntCrossley { stiffness: 1e6, exponent: 1.0, damping_s_m: 1.0 }
    );
}

/// Every file of `models/foreign` is the default mechanism but for the one thing that it says.
#[test]
fn invariant_foreign_mechanisms_differ_in_one_thing() {
    type Edit = fn(&mut DockingMechanism);
    fn axial(m: &mut DockingMechanism) -> &mut AxisChannel {
        let Attenuator::Characteristic(a) = &mut m.attenuator else { panic!("by tables") };
        &mut a.axial
    }
    let edits: [(&str, Edit); 6] = [
        ("hertz", |m| {
            m.contact.normal =
                NormalLaw::HuntCrossley { stiffness: 2e7, exponent: 1.5, damping_s_m: 1.0 };
        }),
        ("kelvin_voigt", |m| {
            m.contact.normal = NormalLaw::KelvinVoigt { stiffness: 1e6, damping_n_s_m: 2000.0 };
        }),
        ("differential", |m| {
            m.attenuator = mechanism("apas", Some(AttenuationChoice::Differential)).attenuator;
        }),
        ("backlash", |m| axial(m).backlash = 1e-3),
        ("stiff", |m| {
            axial(m).loading.points[1][1] *= 2.0;
            axial(m).unloading.points[1][1] *= 2.0;
        }),
        ("late_latch", |m| m.latches.as_mut().expect("latches").catch_delay_s = 0.02),
    ];
    let folder = models().with_file_name("foreign");
    let files = std::fs::read_dir(&folder).expect("a folder").count();
    assert_eq!(files, 2 * edits.len(), "a file of models/foreign has no row here");
    for (name, edit) in edits {
        let of = mechanism("apas", None);
        let path = folder.join(format!("apas_{name}_active.toml"));
        let found = load_other_active_from(&Sources::disk(), &path, &of);
        let found = found.unwrap_or_else(|e| panic!("{name}: {e}")).model;
        let mut expected = of.clone();
        edit(&mut expected);
        expected.digest = found.digest;
        assert_eq!(found, expected, "{name}");
        let plain = DockingMechanism { digest: found.digest, ..of };
        assert_ne!(found, plain, "{name}");
    }
}

/// Cases C6 and C12: what is ignored may be wrong, a mesh is a mesh of this model, and a remedy mends.
#[test]
fn regress_meshes_are_of_the_model_and_ignored_elements_may_be_wrong() {
    const MESH: &str = "<mesh filename=\"../../meshes/chaser_8t_hull.obj\"/>";
    let with = |mesh: &str| Copy::new(&[("chaser_8t.urdf", MESH, mesh)]);
    let says = |copy: &Copy| model_check(&copy.at("chaser_8t.urdf")).lines().join("\n");
    let named = |name: &str| format!("<mesh filename=\"{name}\"/>");
    for (name, problem) in [
        ("../../../../../etc/passwd", "is not the name of a mesh"),
        ("../../../elsewhere/hull.obj", "is outside of the model's folders"),
        ("../../meshes/../../../hull.obj", "is outside of the model's folders"),
        ("/etc/hull.obj", "is not a relative path"),
        ("../../meshes/none.obj", "does not exist"),
    ] {
        let lines = says(&with(&named(name)));
        assert!(lines.contains(problem), "{name}: {lines}");
    }
    // A link that leads out is no way round.
    #[cfg(unix)]
    {
        let copy = with(&named("../../meshes/linked.obj"));
        let link = copy.at("../../meshes/linked.obj");
        std::os::unix::fs::symlink("/etc/passwd", link).expect("a link");
        let lines = says(&copy);
        assert!(lines.contains("by a link"), "{lines}");
    }
    let scaled = "<mesh filename=\"../../meshes/chaser_8t_hull.obj\" scale=\"0.001 0.001 0.001\"/>";
    let lines = says(&with(scaled));
    assert!(lines.contains("multiply the vertices in the file by the scale"), "{lines}");
    // Two materials, and a collision of nonsense: both are ignored, and neither is parsed again.
    let material = "<material name=\"a\"/>\n      <material name=\"b\"/>\n    </visual>\n    \
                    <collision><geometry><mesh filename=\"/etc/passwd\" scale=\"x\"/></geometry>\
                    </collision>\n";
    let copy = Copy::new(&[("chaser_8t.urdf", "</visual>\n", material)]);
    let report = model_check(&copy.at("chaser_8t.urdf"));
    assert!(report.refused.is_empty(), "{:?}", report.lines());
    assert_eq!(report.ignored.len(), 3, "{:?}", report.ignored);
    let text = std::fs::read_to_string(copy.at("chaser_8t.urdf")).expect("a URDF");
    assert_eq!(crate::named_meshes(&text), ["../../meshes/chaser_8t_hull.obj"]);
}

/// A chaser in other units, and what becomes of it (cases C3 to C5): in kg·mm², in g, in mm, as a point, in t.
#[test]
fn regress_spacecraft_in_other_units_are_refused_or_flagged() {
    const MASS: &str = "<mass value=\"7960.9\"/>";
    const INERTIA: &str =
        "ixx=\"7254.37\" ixy=\"0\" ixz=\"0\" iyy=\"36134.193\" iyz=\"0\" izz=\"36134.193\"";
    const PORT: &str = "<origin xyz=\"3.5 0 0\" rpy=\"0 0 0\"/>\n  </joint>";
    const COM: &str = "<inertial>\n      <origin xyz=\"0 0 0\"";
    let inertia = |factor: f64| {
        let (a, t) = (7254.37 * factor, 36134.193 * factor);
        format!("ixx=\"{a:e}\" ixy=\"0\" ixz=\"0\" iyy=\"{t:e}\" iyz=\"0\" izz=\"{t:e}\"")
    };
    let (mm2, point, wide, thin) = (inertia(1e6), inertia(1e-22), inertia(16.0), inertia(0.05));
    let port = |x: &str| PORT.replace("3.5 0 0", x);
    let (far, near) = (port("3500 0 0"), port("4.2 0 0"));
    let cases: &[(&str, &str, &str, &str)] = &[
        (INERTIA, &mm2, "refused", "radius of gyration about X is 954.6 m"),
        (INERTIA, &point, "refused", "even a sphere of the densest material"),
        (INERTIA, &wide, "flagged", "right only with large panels"),
        (INERTIA, &thin, "flagged", "fills the hull evenly has 0.955 m"),
        (MASS, "<mass value=\"7960900\"/>", "refused", "the densest material has 22590"),
        (MASS, "<mass value=\"7.9609\"/>", "refused", "radius of gyration about X is 30.2 m"),
        (MASS, "<mass value=\"150\"/>", "flagged", "less than an empty tank"),
        (PORT, &far, "flagged", "looks like millimetres"),
        (PORT, &near, "", "0.700 m outside of the hull"),
        (
            COM,
            "<inertial>\n      <origin xyz=\"0 30 0\"",
            "flagged",
            "mass centre at [0.000, 30.000",
        ),
    ];
    for (from, to, verdict, says) in cases {
        let copy = Copy::new(&[("chaser_8t.urdf", from, to)]);
        let report = model_check(&copy.at("chaser_8t.urdf"));
        let lines = report.lines().join("\n");
        assert!(lines.contains(says), "{to}: {says}\n{lines}");
        assert_eq!(!report.refused.is_empty(), *verdict == "refused", "{to}\n{lines}");
        assert_eq!(!report.flagged.is_empty(), *verdict == "flagged", "{to}\n{lines}");
        // What is refused does not load; what is flagged does, and says so.
        let loaded = load_spacecraft(&copy.at("chaser_8t.urdf"));
        assert_eq!(loaded.is_err(), *verdict == "refused", "{to}");
        if let Ok(loaded) = loaded {
            assert_eq!(!loaded.notes.is_empty(), *verdict == "flagged", "{to}");
        }
    }
}

/// No shipped spacecraft is refused or flagged: the bounds do not cry wolf.
#[test]
fn invariant_shipped_spacecraft_are_neither_refused_nor_flagged() {
    let mut seen = 0;
    for entry in std::fs::read_dir(models()).expect("models") {
        let path = entry.expect("an entry").path();
        let toml = path.extension().is_some_and(|e| e == "toml");
        if toml && crate::check::kind_of(&path) == Some(crate::keys::FileKind::Spacecraft) {
            let report = model_check(&path);
            assert!(report.refused.is_empty() && report.flagged.is_empty(), "{:?}", report.lines());
            seen += 1;
        }
    }
    assert!(seen > 8, "{seen}");
}

#[test]
fn oracle_inertia_of_a_homogeneous_cylinder() {
    for (name, radius, length, port) in
        [("chaser_8t.urdf", 1.35, 7.0, 3.5), ("target_12t.urdf", 1.5, 9.0, -4.5)]
    {
        let c = spacecraft(name);
        let axial = c.mass_kg * radius * radius / 2.0;
        let across = c.mass_kg * (3.0 * radius * radius + length * length) / 12.0;
        let want = DMat3::from_diagonal(DVec3::new(axial, across, across));
        assert!((c.inertia_kg_m2 - want).abs_diff_eq(DMat3::ZERO, 1e-3), "{name}");
        assert!(c.x_body_port.p.distance(DVec3::X * port) < 1e-12);
    }
}

/// Two point-like bodies on a rod: masses 2 kg and 6 kg, 4 m apart, mass centre 3 m from the first,
/// I = 2·3² + 6·1² = 24 kg·m² across the rod, beside their own 0.1 kg·m² each.
#[test]
fn oracle_links_are_composed_by_parallel_axes() {
    let dir = tempfile::tempdir().expect("a folder");
    let urdf = dir.path().join("two.urdf");
    let body = |name: &str, mass: f64| {
        format!(
            r#"<link name="{name}"><inertial><mass value="{mass}"/>
            <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>"#
        )
    };
    let joint = |child: &str, x: f64| {
        format!(
            r#"<joint name="to_{child}" type="fixed"><parent link="a"/><child link="{child}"/>
            <origin xyz="0 {x} 0" rpy="0 0 1.5707963267948966"/></joint>"#
        )
    };
    let text = format!(
        r#"<robot name="two">{}{}<link name="port"/>{}{}</robot>"#,
        body("a", 2.0),
        body("b", 6.0),
        joint("b", 4.0),
        joint("port", 5.0)
    );
    std::fs::write(&urdf, text).expect("write");
    let notes = std::fs::read_to_string(models().join("chaser_8t.toml")).expect("notes");
    std::fs::write(urdf.with_extension("toml"), notes).expect("write");
    let c = load_spacecraft(&urdf).expect("loads").model;
    assert!((c.mass_kg - 8.0).abs() < 1e-12);
    let want = DMat3::from_diagonal(DVec3::new(24.2, 0.2, 24.2));
    assert!((c.inertia_kg_m2 - want).abs_diff_eq(DMat3::ZERO, 1e-12), "{}", c.inertia_kg_m2);
    assert!(c.x_body_port.p.distance(DVec3::Y * 2.0) < 1e-12);
    // Yaw of 90°: X of the port is Y of the body.
    assert!((c.x_body_port.q * DVec3::X).distance(DVec3::Y) < 1e-12);
}

#[test]
fn oracle_principal_moments() {
    let q = docktwin_core::DQuat::from_scaled_axis(DVec3::new(0.3, -1.1, 0.7));
    let m = docktwin_core::inertia_world(q, DMat3::from_diagonal(DVec3::new(3.0, 5.0, 7.0)));
    let p = urdf::principal_moments(m);
    for (got, want) in p.iter().zip([3.0, 5.0, 7.0]) {
        assert!((got - want).abs() < 1e-12, "{p:?}");
    }
}

/// 2.5 mm of clearance; half-angles leave ±5.7°, of which straight edges that lean take some.
#[test]
fn oracle_mated_fit_of_the_default_geometry() {
    let m = mechanism("apas", None);
    let fit = mated_fit(&m.active, &m.passive);
    assert!((fit.petal_to_ring_m - 0.0025).abs() < 1e-4, "{fit:?}");
    let play = fit.roll_play_rad.expect("petals").to_degrees();
    assert!((play - 4.39).abs() < 0.01, "{play}");
    // The ring of 0.600 m with petals from 0.600 m to 0.400 m leaves 0.36 mm.
    let mut tight = m.clone();
    for side in [&mut tight.active, &mut tight.passive] {
        let p = side.petals.as_mut().expect("petals");
        (p.base_radius_m, p.tip_radius_m, p.height_m) = (0.600, 0.400, 0.200);
    }
    let fit = mated_fit(&tight.active, &tight.passive);
    assert!((fit.petal_to_ring_m - 0.36e-3).abs() < 1e-5, "{fit:?}");
}

/// Stiffness of the coupled legs at rest, seen at the ring's centre, is the diagonal of the
/// characteristic: 3e5 axially, 800 N/m sideways, 600 N·m/rad in roll, 1000 N·m/rad in tilt.
#[test]
fn oracle_differential_reproduces_the_characteristic_at_rest() {
    for preset in ["apas", "apas75"] {
        let m = mechanism(preset, Some(AttenuationChoice::Differential));
        let Attenuator::Differential(d) = &m.attenuator else { panic!("differential") };
        let rest = DVec3::X * m.ring_rest_offset_m;
        let mut jacobian = [[0.0; 6]; 6];
        for (i, row) in jacobian.iter_mut().enumerate() {
            let n = (rest + d.ring_joints_m[i] - d.base_joints_m[i]).normalize();
            let t = d.ring_joints_m[i].cross(n);
            *row = [n.x, n.y, n.z, t.x, t.y, t.z];
        }
        let mut gain = [[0.0; 6]; 6];
        for (g, c) in gain.iter_mut().zip(&d.coupling) {
            for (k, x) in g.iter_mut().enumerate() {
                *x = (0..6).map(|leg| c[leg] * jacobian[leg][k]).sum();
            }
        }
        let slope = |c: &AxisChannel| c.loading.points[1][1] / c.loading.points[1][0];
        let want = [3e5, 800.0, 800.0, 600.0, 1000.0, 1000.0];
        for i in 0..6 {
            for j in 0..6 {
                let k: f64 = (0..6).map(|r| slope(&d.channels[r]) * gain[r][i] * gain[r][j]).sum();
                let expected = if i == j { want[i] } else { 0.0 };
                let scale = f64::sqrt(want[i] * want[j]);
                assert!((k - expected).abs() < 1e-6 * scale, "{preset} K[{i}][{j}] = {k}");
            }
        }
        // The damping reproduces the diagonal, before and after capture.
        let damping = |after: bool, axis: usize| -> f64 {
            let c = |x: &AxisChannel| {
                if after { x.damping.after_capture } else { x.damping.before_capture }
            };
            (0..6).map(|r| c(&d.channels[r]) * gain[r][axis] * gain[r][axis]).sum()
        };
        for (axis, before, after) in
            [(0, 4000.0, 4000.0), (1, 100.0, 1000.0), (3, 60.0, 1500.0), (5, 60.0, 2500.0)]
        {
            assert!((damping(false, axis) / before - 1.0).abs() < 1e-6, "{preset} {axis}");
            assert!((damping(true, axis) / after - 1.0).abs() < 1e-6, "{preset} {axis}");
        }
    }
}

#[test]
fn invariant_any_changed_byte_changes_the_digest() {
    let digest = |edits: &[(&str, &str, &str)]| {
        let copy = Copy::new(edits);
        let craft = load_spacecraft(&copy.at("chaser_8t.urdf")).expect("loads").model.digest;
        let (a, p) = (copy.at("apas_active.urdf"), copy.at("apas_passive.urdf"));
        let loaded = load_mechanism(&a, &p, None).expect("loads");
        assert_eq!(loaded.files.len(), 4);
        (craft, loaded.model.digest)
    };
    let same = digest(&[]);
    assert_eq!(same, digest(&[]));
    assert_ne!(same.0, digest(&[("chaser_8t.urdf", "7960.9", "7960.8")]).0);
    assert_ne!(same.0, digest(&[("chaser_8t.toml", "the paper", "a paper")]).0);
    assert_ne!(same.1, digest(&[("apas_active.toml", "# One law", "# The one law")]).1);
}

#[test]
fn invariant_what_is_not_used_is_noted() {
    let link = r#"<link name="body">"#;
    let unused =
        r#"<link name="body"><collision><geometry><box size="1 1 1"/></geometry></collision>"#;
    let joint = r#"<parent link="body"/>"#;
    let drive = r#"<limit effort="1" velocity="2"/><dynamics damping="3"/><parent link="body"/>"#;
    let copy = Copy::new(&[
        ("chaser_8t.urdf", link, unused),
        ("chaser_8t.urdf", joint, drive),
        ("chaser_8t.urdf", "<visual>", "<visual><material name=\"grey\"/>"),
        ("chaser_8t.urdf", "</robot>", "<transmission name=\"t\"/></robot>"),
    ]);
    let loaded = load_spacecraft(&copy.at("chaser_8t.urdf")).expect("loads");
    for word in ["collision", "limit", "dynamics", "material", "transmission"] {
        let hits = loaded.notes.iter().filter(|n| n.what.contains(word)).count();
        assert_eq!(hits, 1, "{word} in {:?}", loaded.notes);
    }
    assert!(loaded.notes.iter().all(|n| n.line.is_some()));
}

#[test]
fn invariant_all_problems_come_at_once_with_their_lines() {
    let copy = Copy::new(&[
        ("chaser_8t.urdf", r#"mass value="7960.9""#, r#"mass value="-1""#),
        ("chaser_8t.toml", "radius_m = {", "radiu_m = {"),
        ("apas_active.toml", "count = { value = 3,", "count = { value = 3.5,"),
        ("apas_active.toml", "jam_time_s = { value = 10.0,", "jam_time_s = { value = nan,"),
        ("apas_passive.toml", "schema = 1", "schema = 2"),
    ]);
    let problems = copy.problems();
    // A misspelt key is both an unknown and a missing one.
    assert_eq!(problems.len(), 6, "{problems:#?}");
    assert!(problems.iter().all(|p| p.line.is_some() && !p.remedy.is_empty()), "{problems:#?}");
    let jam = problems.iter().find(|p| p.key == "outcome.jam_time_s").expect("reported");
    let text = std::fs::read_to_string(copy.at("apas_active.toml")).expect("text");
    let line = 1 + text.lines().position(|l| l.starts_with("jam_time_s")).expect("line");
    assert_eq!(jam.line, Some(line));
    let text = jam.to_string();
    for part in ["outcome.jam_time_s", "nan s", "finite", "> 0 and ≤ 10000", "apas_active.toml:"]
    {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn invariant_model_check_lists_read_ignored_and_refused() {
    let copy = Copy::new(&[]);
    for file in ["apas_active.urdf", "apas_passive.toml", "chaser_8t.toml"] {
        let report = model_check(&copy.at(file));
        assert!(report.refused.is_empty(), "{file}: {:?}", report.refused);
        assert!(report.read.len() > 10);
    }
    let report = model_check(&copy.at("apas_active.toml"));
    assert_eq!(report.files.len(), 4);
    assert!(report.mechanism.is_some(), "both sides were put together");
    assert!(report.lines().iter().any(|l| l.contains("ring.mean_radius_m = 0.6 m (source:")));

    let missing = model_check(&copy.at("nothing.toml"));
    assert_eq!(missing.refused.len(), 1);
    let copy = Copy::new(&[("chaser_8t.urdf", "ixx=\"7254.37\"", "ixx=\"-7254.37\"")]);
    assert_eq!(model_check(&copy.at("chaser_8t.urdf")).refused.len(), 1);
}

/// Each case: file, text, what replaces it, what the message must say.
const BAD: &[(&str, &str, &str, &str)] = &[
    // URDF of a spacecraft.
    ("chaser_8t.urdf", "\"7960.9\"", "\"-5\"", "mass of link `body` = -5 kg: is out of range"),
    ("chaser_8t.urdf", "\"7960.9\"", "\"0\"", "≥ 0.0001 and"),
    ("chaser_8t.urdf", "\"7960.9\"", "\"NaN\"", "one finite number"),
    ("chaser_8t.urdf", "\"7960.9\"", "\"heavy\"", "one finite number"),
    ("chaser_8t.urdf", "ixx=\"7254.37\"", "ixx=\"-1\"", "positive definite"),
    ("chaser_8t.urdf", "ixx=\"7254.37\"", "ixx=\"99999\"", "not that of any body"),
    ("chaser_8t.urdf", "ixx=\"7254.37\"", "", "has no attribute `ixx`"),
    ("chaser_8t.urdf", "chaser_8t_hull.obj", "nothing.obj", "cargo xtask meshes"),
    ("chaser_8t.urdf", "../../meshes/chaser_8t_hull.obj", "package://a/b.obj", "relative path"),
    ("chaser_8t.urdf", "<mesh ", "<mesh scale=\"0.001 0.001 0.001\" ", "meshes are in metres"),
    ("chaser_8t.urdf", "<visual>", "<visual><colour/>", "not an element of URDF at this place"),
    ("chaser_8t.urdf", "<link name=\"port\"/>", "<lnk name=\"port\"/>", "not an element of URDF"),
    ("chaser_8t.urdf", "<mass ", "<mass unit=\"kg\" ", "unknown attribute `unit`"),
    ("chaser_8t.urdf", "<mass ", "<mass value=\"1\"/><mass ", "more than one `mass`"),
    ("chaser_8t.urdf", "type=\"fixed\"", "type=\"revolute\"", "one rigid body"),
    ("chaser_8t.urdf", "type=\"fixed\"", "type=\"glued\"", "glued"),
    ("chaser_8t.urdf", "xyz=\"3.5 0 0\"", "xyz=\"3.5 0\"", "3 finite number"),
    ("chaser_8t.urdf", "xyz=\"3.5 0 0\"", "xyz=\"3.5 0 0 m\"", "3 finite number"),
    ("chaser_8t.urdf", "<child link=\"port\"/>", "<child link=\"prot\"/>", "does not exist"),
    ("chaser_8t.urdf", "<link name=\"port\"/>", "<link name=\"port\"/><link name=\"x\"/>", "root"),
    ("chaser_8t.urdf", "<link name=\"port\"/>", "<link name=\"body\"/>", "stands twice"),
    (
        "chaser_8t.urdf",
        "</robot>",
        "<joint name=\"back\" type=\"fixed\"><parent link=\"port\"/><child link=\"body\"/></joint></robot>",
        "no root link",
    ),
    (
        "chaser_8t.urdf",
        "</robot>",
        "<link name=\"x\"/><link name=\"y\"/>\
         <joint name=\"xy\" type=\"fixed\"><parent link=\"x\"/><child link=\"y\"/></joint>\
         <joint name=\"yx\" type=\"fixed\"><parent link=\"y\"/><child link=\"x\"/></joint></robot>",
        "cycle",
    ),
    (
        "chaser_8t.urdf",
        "</robot>",
        "<joint name=\"two\" type=\"fixed\"><parent link=\"body\"/><child link=\"port\"/></joint></robot>",
        "child of more than one joint",
    ),
    ("chaser_8t.urdf", "<parent link=\"body\"/>", "text<parent link=\"body\"/>", "holds text"),
    ("chaser_8t.urdf", "</robot>", "", "well-formed XML"),
    ("chaser_8t.urdf", "<inertial>", "<inertial><!-- --></inertial><!-- ", "well-formed XML"),
    // TOML of a spacecraft.
    ("chaser_8t.toml", "port_link = \"port\"", "port_link = \"prt\"", "not a link of the URDF"),
    ("chaser_8t.toml", "port_link", "port_lnk", "did you mean `port_link`?"),
    ("chaser_8t.toml", "mass_kg = {", "# {", "numbers.mass_kg: is missing"),
    (
        "chaser_8t.toml",
        "{ assumed = \"the body frame",
        "{ value = 1.0, assumed = \"the",
        "in the URDF",
    ),
    ("chaser_8t.toml", "\"the cylinder of the inertia\"", "\"\"", "no note where it comes from"),
    ("chaser_8t.toml", "radius_m = { value = 1.35", "radius_m = { value = 0", "> 0 and ≤ 50"),
    ("chaser_8t.toml", "\"spacecraft\"", "\"spaceship\"", "allowed: spacecraft"),
    ("chaser_8t.toml", "schema = 1", "schema = 2", "whole number from 1 to 1"),
    ("chaser_8t.toml", "[hull]", "[hull", "valid TOML"),
    ("chaser_8t.toml", "[hull]", "[hulls]", "add [hull]"),
    // TOML of the active side.
    (
        "apas_active.toml",
        "{ value = 0.6, source = \"published diameter 1.2 m of APAS-89 and IDSS\" }",
        "0.6",
        "no note",
    ),
    ("apas_active.toml", "value = 0.3, ", "", "has a note but no value"),
    (
        "apas_active.toml",
        "value = 0.3, ",
        "value = 0.3, source = \"x\", ",
        "both a source and an assumed",
    ),
    (
        "apas_active.toml",
        "value = 0.3, ",
        "value = 0.3, sources = \"x\", ",
        "placement.ring_rest_offset_m.sources",
    ),
    ("apas_active.toml", "value = 0.3, ", "value = \"0.3\", ", "is a string"),
    ("apas_active.toml", "value = 0.3, ", "value = inf, ", "not a finite number"),
    ("apas_active.toml", "segments = { value = 48", "segments = { value = 48.5", "whole numbers"),
    (
        "apas_active.toml",
        "mean_radius_m = { value = 0.6",
        "mean_radius_m = { value = 0.02",
        "below the mean radius",
    ),
    (
        "apas_active.toml",
        "travel_negative_m = { value = 0.15",
        "travel_negative_m = { value = -0.15",
        "≥ 0 and ≤ 5",
    ),
    (
        "apas_active.toml",
        "[[0.0, 0.0], [0.15, 45000.0]]",
        "[[0.0, 0.0], [0.15, 45000.0], [0.1, 46000.0]]",
        "does not rise",
    ),
    (
        "apas_active.toml",
        "[[0.0, 0.0], [0.15, 45000.0]]",
        "[[0.01, 0.0], [0.15, 45000.0]]",
        "deflection 0",
    ),
    ("apas_active.toml", "[[0.0, 0.0], [0.15, 45000.0]]", "[[0.0, 0.0]]", "has 1 rows"),
    ("apas_active.toml", "[[0.0, 0.0], [0.15, 45000.0]]", "[[0.0, 0.0], [0.15]]", "has 1 numbers"),
    (
        "apas_active.toml",
        "[[0.0, 0.0], [0.15, 45000.0]]",
        "[[0.0, 0.0], [0.15, 40000.0]]",
        "above the loading branch",
    ),
    (
        "apas_active.toml",
        "friction_static = { value = 0.1",
        "friction_static = { value = 0.05",
        "below the kinetic",
    ),
    ("apas_active.toml", "\"hunt_crossley\"", "\"hertz\"", "hunt_crossley | kelvin_voigt"),
    (
        "apas_active.toml",
        "\"hunt_crossley\"",
        "\"kelvin_voigt\"",
        "contact.damping_n_s_m: is missing",
    ),
    (
        "apas_active.toml",
        "depth_m = { value = 0.04,",
        "depth_m = { value = 0.05,",
        "is more than 0.04 m",
    ),
    ("apas_active.toml", "  [0.0, 6.4, 0.0],", "  [0.1, 6.4, 0.0],", "not symmetric"),
    ("apas_active.toml", "  [12.7, 0.0, 0.0],", "  [13.7, 0.0, 0.0],", "not that of any body"),
    (
        "apas_active.toml",
        "base_half_angle_deg = { value = 28.0",
        "base_half_angle_deg = { value = 61.0",
        "neighbouring petals",
    ),
    (
        "apas_active.toml",
        "base_radius_m = { value = 0.597",
        "base_radius_m = { value = 0.5",
        "float free",
    ),
    (
        "apas_active.toml",
        "base_radius_m = { value = 0.597",
        "base_radius_m = { value = 0.605",
        "collide with the ring",
    ),
    (
        "apas_active.toml",
        "thickness_m = { value = 0.02",
        "thickness_m = { value = 0.19",
        "not below the height",
    ),
    (
        "apas_active.toml",
        "strike_gap_m = { value = 0.006",
        "strike_gap_m = { value = 0.002",
        "below the catch gap",
    ),
    ("apas_active.toml", "[0.0, 120.0, 240.0]", "[0.0, 10.0, 240.0]", "apart"),
    (
        "apas_active.toml",
        "catch_gap_m = {",
        "catch_delay_s = { value = -1.0, assumed = \"a test\" }\ncatch_gap_m = {",
        "≥ 0 and ≤ 10",
    ),
    (
        "apas_active.toml",
        "[attenuation.characteristic.axial]",
        "[attenuation.characteristic.axial]\nbacklash = { width_m = { value = 0.0, assumed = \"a test\" } }",
        "> 0 and ≤ 0.1",
    ),
    (
        "apas_active.toml",
        "[attenuation.characteristic.lateral]",
        "[attenuation.characteristic.lateral]\nbacklash = { width_m = { value = 0.001, assumed = \"a test\" } }",
        "lateral.backlash",
    ),
    ("apas_active.toml", "friction = { value = 0.5", "friction = { value = 1.5", "≥ 0 and ≤ 0.9"),
    (
        "apas_active.toml",
        "position_coarse_m = { value = 0.001",
        "position_coarse_m = { value = 0.0001",
        "below the fine grade",
    ),
    (
        "apas_active.toml",
        "[0.0, 120.0, 240.0]",
        "[60.0, 180.0, 300.0]",
        "striker would lie under petal",
    ),
    ("apas_active.toml", "[0.0, 120.0, 240.0]", "[0.0, 120.0]", "list of 3 numbers"),
    (
        "apas_active.toml",
        "default = \"characteristic\"",
        "default = \"soft\"",
        "characteristic | differential | rigid",
    ),
    (
        "apas_active.toml",
        "[attenuation.characteristic.roll]",
        "[attenuation.characteristic.rol]",
        "did you mean `roll`?",
    ),
    (
        "apas_active.toml",
        "  [0.000000000000000, 0.000000000000000, 0.500000000000000, 0.500000000000000, -0.5",
        "  [0.577350269189626, 0.577350269189626, -0.288675134594813, -0.288675134594813, -0.288675134594813, -0.288675134594813], # [-0.5",
        "coupling",
    ),
    (
        "apas_active.toml",
        "# pair sum, first\n[[attenuation.differential.channels]]",
        "# pair sum, first\n[[attenuation.differential.canals]]",
        "5 channels",
    ),
    ("apas_active.toml", "[limits]", "[limit]", "add [limits]"),
    // URDF of the active side against its TOML.
    (
        "apas_active.urdf",
        "xyz=\"0.3 0 0\"",
        "xyz=\"0.31 0 0\"",
        "placement.ring_rest_offset_m puts it",
    ),
    (
        "apas_active.urdf",
        "rpy=\"2.0943951023931953 0 0\"",
        "rpy=\"2.1 0 0\"",
        "petals.first_azimuth_deg",
    ),
    ("apas_active.urdf", "mass value=\"39.1\"", "mass value=\"39.2\"", "ring_body.mass_kg = 39.1"),
    ("apas_active.urdf", "xyz=\"0.032 0 0\"", "xyz=\"0.03 0 0\"", "ring_body.com_m"),
    ("apas_active.urdf", "iyy=\"6.4\"", "iyy=\"6.5\"", "ring_body.inertia_kg_m2"),
    ("apas_active.urdf", "type=\"floating\"", "type=\"fixed\"", "allowed: floating"),
    ("apas_active.urdf", "name=\"petal_2\"", "name=\"petal_3\"", "petal_2"),
    // The passive side, and both sides together.
    (
        "apas_passive.toml",
        "base_half_angle_deg = { value = 28.0",
        "base_half_angle_deg = { value = 33.0",
        "petals collide when docked",
    ),
    (
        "apas_passive.toml",
        "tip_radius_m = { value = 0.41",
        "tip_radius_m = { value = 0.8",
        "lean inward",
    ),
    ("apas_passive.toml", "mechanism_passive", "mechanism_active", "allowed: mechanism_passive"),
    (
        "apas_passive.urdf",
        "rpy=\"0 0 3.141592653589793\"",
        "rpy=\"0 0 0\"",
        "passive_ring_offset_m puts it",
    ),
    (
        "apas_passive.urdf",
        "xyz=\"-0.1 0 0\"",
        "xyz=\"0.1 0 0\"",
        "the parameter with its source stands in",
    ),
];

#[test]
fn regress_bad_files_are_refused_with_a_reason() {
    let mut wrong = Vec::new();
    for (file, from, to, says) in BAD {
        let problems = Copy::new(&[(*file, *from, *to)]).problems();
        let text: Vec<String> = problems.iter().map(ToString::to_string).collect();
        if !text.iter().any(|t| t.contains(says)) {
            let got = text.join("\n");
            wrong.push(format!("{file}: {from:?} → {to:?} should say {says:?}, says\n{got}\n"));
        }
        for p in &problems {
            assert!(!p.remedy.is_empty() && !p.what.is_empty() && !p.key.is_empty(), "{p}");
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn regress_petals_turned_into_each_other_are_refused() {
    // Both the parameter and the placements that must agree with it.
    let mut edits = vec![(
        "apas_passive.toml",
        "first_azimuth_deg = { value = 0.0",
        "first_azimuth_deg = { value = 60.0",
    )];
    edits.push((
        "apas_passive.urdf",
        "rpy=\"4.1887902047863905 0 0\"",
        "rpy=\"5.235987755982989 0 0\"",
    ));
    edits.push((
        "apas_passive.urdf",
        "rpy=\"2.0943951023931953 0 0\"",
        "rpy=\"3.141592653589793 0 0\"",
    ));
    edits.push((
        "apas_passive.urdf",
        "<child link=\"petal_0\"/>\n    <origin xyz=\"0 0 0\" rpy=\"0 0 0\"/>",
        "<child link=\"petal_0\"/>\n    <origin xyz=\"0 0 0\" rpy=\"1.0471975511965976 0 0\"/>",
    ));
    let problems = Copy::new(&edits).problems();
    assert!(problems.iter().any(|p| p.what.contains("roll play")), "{problems:#?}");
    assert!(!problems.iter().any(|p| p.what.contains("puts it")), "{problems:#?}");
}

#[test]
fn regress_missing_files_and_missing_attenuation() {
    let copy = Copy::new(&[]);
    let gone = load_spacecraft(&copy.at("gone.urdf")).expect_err("is not there");
    assert_eq!(gone.problems.len(), 2);
    let ring = |s: &str| models().join(format!("ring_{s}.urdf"));
    let choice = Some(AttenuationChoice::Differential);
    let e = load_mechanism(&ring("active"), &ring("passive"), choice).expect_err("not described");
    assert!(e.to_string().contains("does not describe it"), "{e}");
}

#[test]
fn regress_rigs_load() {
    for name in ["stewart", "stewart_statics", "electric_hexapod", "electric_hexapod_measured"] {
        let report = model_check(&models().join(format!("{name}.toml")));
        assert_eq!(report.refused, [""; 0], "{name}");
    }
}

#[test]
fn oracle_oil_springs_of_the_presets() {
    let rig = load_rig(&models().join("stewart.urdf")).unwrap_or_else(|e| panic!("{e}")).model;
    for (preset, k, hz) in [
        (HydraulicPreset::Printed, 2.76e7, 16.7),
        (HydraulicPreset::Consistent, 6.62e7, 25.9),
        (HydraulicPreset::Stiff, 2.76e8, 52.9),
    ] {
        let h = rig.leg_hydraulics(preset).unwrap_or_else(|| panic!("it is on oil"));
        assert!((h.oil_spring_n_m() / k - 1.0).abs() < 1e-3, "{}", preset.word());
        assert!((h.natural_frequency_hz(2500.0) - hz).abs() < 0.05, "{}", preset.word());
    }
    assert!((rig.plate.mass_kg - 2500.0).abs() < 1e-9);
    assert!((rig.plate.com_m - DVec3::new(-0.3, 0.0, 0.0)).length() < 1e-9);
    let inertia = DMat3::from_diagonal(DVec3::new(2800.0, 1600.0, 1600.0));
    assert!(rig.plate.inertia_kg_m2.abs_diff_eq(inertia, 1e-6), "{:?}", rig.plate);
}

/// What `model check` refuses of the default rig with texts replaced, and what it flags.
fn rig_with(edits: &[(&str, &str, &str)]) -> Report {
    named_rig_with("stewart", edits)
}

fn named_rig_with(name: &str, edits: &[(&str, &str, &str)]) -> Report {
    let dir = tempfile::tempdir().expect("a folder");
    for ext in ["urdf", "toml"] {
        let file = format!("{name}.{ext}");
        let mut text = std::fs::read_to_string(models().join(&file)).expect("model");
        for (_, from, to) in edits.iter().filter(|(e, _, _)| *e == ext) {
            assert!(text.contains(from), "{file} has no {from:?}: mend the case");
            text = text.replacen(from, to, 1);
        }
        std::fs::write(dir.path().join(file), text).expect("write");
    }
    model_check(&dir.path().join(format!("{name}.toml")))
}

/// What a drive of another kind has, or what is out of range, is refused with all the rest at once.
#[test]
fn regress_wrong_drives_are_refused_all_at_once() {
    let report = named_rig_with(
        "electric_hexapod",
        &[
            ("toml", "order = { value = 2", "order = { value = 3"),
            ("toml", "delay_s = { value = 0.004", "delay_s = { value = 0.4"),
            ("toml", "[sensors]\n", "[valve]\nnull_bias = 0.0\n\n[sensors]\n"),
            ("toml", "loop_frequency", "valve_frequency"),
            ("toml", "force_sensors = \"rack\"", "force_sensors = \"plate\""),
        ],
    );
    for says in [
        "drive.order = 3",
        "drive.delay_s = 0.4 s",
        "valve",
        "belongs to a hydraulic drive",
        "spread.loop_frequency",
        "spread.valve_frequency",
        "allowed: rack_and_plate, rack",
    ] {
        let told = report.refused.iter().any(|r| r.replace(" | ", ", ").contains(says));
        assert!(told, "{says:?} is not told: {:#?}", report.refused);
    }
    // A loop of first order has no damping ratio, and a hydraulic rig no loop.
    let first = named_rig_with(
        "electric_hexapod",
        &[("toml", "order = { value = 2", "order = { value = 1")],
    );
    assert!(first.refused.iter().any(|r| r.contains("damping_ratio")), "{:?}", first.refused);
    let on_oil =
        rig_with(&[("toml", "[hydraulics]\n", "[drive]\nkind = \"hydraulic\"\n\n[hydraulics]\n")]);
    assert_eq!(on_oil.refused, [""; 0]);
    let half = rig_with(&[("toml", "[spread]\n", "[spread]\nloop_frequency = 0.1\n")]);
    assert!(half.refused.iter().any(|r| r.contains("spread.loop_frequency")), "{:?}", half.refused);
}

/// What is told of a drive: how late it is, and how well the fit of a measured one is.
#[test]
fn oracle_a_measured_drive_is_fitted_to_the_rig_that_was_measured() {
    let loops = ["electric_hexapod", "electric_hexapod_measured"].map(|name| {
        let rig =
            load_rig(&models().join(format!("{name}.toml"))).unwrap_or_else(|e| panic!("{e}"));
        *rig.model.drive.position_loop().unwrap_or_else(|| panic!("it has position loops"))
    });
    let [is, fitted] = loops;
    assert!((fitted.natural_frequency_hz / is.natural_frequency_hz - 1.0).abs() < 1e-3);
    assert!((fitted.delay_s - is.delay_s).abs() < 2e-5, "{fitted:?}");
    let report = model_check(&models().join("electric_hexapod_measured.toml"));
    let line =
        report.read.iter().find(|l| l.contains("fitted")).unwrap_or_else(|| panic!("a line"));
    assert!(line.contains("order 2") && line.contains("0.035 % off"), "{line}");
    assert!(
        report.flagged.iter().any(|f| f.contains("90 deg late at 10 Hz")),
        "{:?}",
        report.flagged
    );
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table of inputs")]
fn regress_impossible_rigs_are_refused_by_file() {
    // An edit, and what the refusal must say.
    type Case<'a> = (&'a [(&'a str, &'a str, &'a str)], &'a [&'a str]);
    let cases: &[Case<'_>] = &[
        (
            &[("toml", "area_m2 = { value = 0.06", "area_m2 = { value = -0.06")],
            &["hydraulics.area_m2 = -0.06 m²: is out of range"],
        ),
        // All problems of both files at once.
        (
            &[
                ("toml", "area_m2 = { value = 0.06", "area_m2 = { value = -0.06"),
                ("urdf", r#"<mass value="150"/>"#, r#"<mass value="-150"/>"#),
                ("urdf", r#"<axis xyz="0 1 0"/>"#, r#"<axis xyz="0 -1 0"/>"#),
            ],
            &["hydraulics.area_m2", "mass of link `rod_0`", "joint `tilt_0`"],
        ),
        (
            &[("toml", "share = { value = 0.98", "share = { value = 1.02")],
            &["offload.share = 1.02: is out of range"],
        ),
        (
            &[(
                "toml",
                "gravity_m_s2 = { value = [-9.81, 0.0, 0.0]",
                "gravity_m_s2 = { value = [0.0, 0.0, -9.81]",
            )],
            &["offload: carries along a vertical docking axis only, and gravity lies 90.0 deg off"],
        ),
        (
            &[(
                "toml",
                "gravity_m_s2 = { value = [-9.81, 0.0, 0.0]",
                "gravity_m_s2 = { value = [0.0, 0.0, 0.0]",
            )],
            &["offload: has nothing to carry"],
        ),
        (
            &[("toml", "stiffness_n_m = { value = 2.0e5", "stiffness_n_m = { value = 9.0e7")],
            &["offload.stiffness_n_m: lets 2 kg swing on the hanger at 1068 Hz"],
        ),
        (
            &[("urdf", r#"upper="1.28""#, r#"upper="1.0""#)],
            &[
                "stroke of leg 0: does not reach the docking workspace: at X−",
                "cannot be longer than 5.1822 m, 0.0884 m short; 3 of 729 places checked",
            ],
        ),
        (
            &[("urdf", r#"lower="-1.12""#, r#"lower="-0.9""#)],
            &[
                "stroke of leg 0: does not reach the docking workspace: at X+",
                "cannot be shorter than 3.2822 m",
            ],
        ),
        (
            &[("urdf", r#"lower="-1.12" upper="1.28""#, r#"lower="-1.7" upper="1.28""#)],
            &["stroke of leg 0: does not fit into the retracted leg"],
        ),
        (
            &[("urdf", r#"lower="-0.7""#, r#"lower="-0.1""#)],
            &["universal joint of leg 0: does not turn far enough"],
        ),
        (
            &[("toml", "ball_limit_deg = { value = 40.0", "ball_limit_deg = { value = 9.0")],
            &["spherical joint of leg 0", "spherical joint of leg 5"],
        ),
        (
            &[(
                "toml",
                "[0.0, 0.0, 0.0], assumed = \"the frame of the rod",
                "[0.01, 0.0, 0.0], assumed = \"the frame of the rod",
            )],
            &["closures.0: does not close", "0.010000 m apart"],
        ),
        (
            &[("urdf", r#"<axis xyz="0 1 0"/>"#, r#"<axis xyz="0 -1 0"/>"#)],
            &["joint `tilt_0`", "right-handed"],
        ),
        (
            &[("urdf", r#"<axis xyz="1 0 0"/>"#, r#"<axis xyz="0 0 0"/>"#)],
            &["joint `stroke_0`: has no axis"],
        ),
        (
            &[("urdf", r#"<limit lower="-1.12" upper="1.28" effort="60000" velocity="0.7"/>"#, "")],
            &["joint `stroke_0`: has no `limit`"],
        ),
        (&[("urdf", r#"effort="60000""#, r#"effort="50000""#)], &["has a rod of other limits"]),
        (
            &[("urdf", r#"type="prismatic""#, r#"type="fixed""#)],
            &["joint `stroke_0`: is fixed, but a rod's joint must be prismatic"],
        ),
        (
            &[("urdf", r#"<mass value="150"/>"#, r#"<mass value="-150"/>"#)],
            &["mass of link `rod_0` = -150 kg"],
        ),
        (
            &[("urdf", r#"<origin xyz="-1.35 0 0""#, r#"<origin xyz="-1.35 0.1 0""#)],
            &["link `rod_0`: is not symmetric about the leg's axis"],
        ),
        (
            &[("toml", "middle_p_34_m = { value = [0.6", "middle_p_34_m = { value = [0.7")],
            &["differs from the tree with its joints at zero, where p_34 is [0.600000"],
        ),
        (
            &[("toml", "rod = \"rod_1\"", "rod = \"rod_0\"")],
            &["name one rod twice", "link `rod_1`"],
        ),
        (&[("toml", "plate = \"plate\"", "plate = \"table\"")], &["links.plate", "is not a link"]),
        (
            &[("toml", "axial_m = { value = 0.3", "axial_m = { value = 0.6")],
            &["does not reach the docking workspace", "of 729 places checked"],
        ),
    ];
    for (edits, say) in cases {
        let refused = rig_with(edits).refused.join("\n");
        for want in *say {
            assert!(refused.contains(want), "{edits:?}: {want:?} is not in\n{refused}");
        }
    }
}

#[test]
fn regress_impossible_rigs_are_refused_by_geometry() {
    use crate::problem::Findings;
    use core::f64::consts::FRAC_PI_3;

    let good = load_rig(&models().join("stewart.urdf")).unwrap_or_else(|e| panic!("{e}")).model;
    let check = |rig: &Rig| {
        let mut out = Findings::default();
        crate::rig_check::check(rig, Path::new("a.urdf"), Path::new("a.toml"), &mut out);
        let lines = out
            .problems
            .iter()
            .map(ToString::to_string)
            .chain(out.flags.iter().map(|n| format!("flagged {n}")));
        lines.collect::<Vec<_>>().join("\n")
    };
    let says = |rig: &Rig, wants: &[&str]| {
        let got = check(rig);
        for want in wants {
            assert!(got.contains(want), "{want:?} is not in\n{got}");
        }
    };
    // Default: nothing but the two volumes that do not belong to the stroke.
    let flags = check(&good);
    assert_eq!(flags.lines().count(), 2, "{flags}");
    says(
        &good,
        &["flagged hydraulics.printed", "5.90 m of stroke", "flagged hydraulics.stiff", "0.50 m"],
    );

    // Each refusal, and that it is gone once its remedy is obeyed.
    let mended = |rig: &Rig, gone: &str| {
        let got = check(rig);
        assert!(!got.contains(gone), "{gone:?} is still in\n{got}");
    };
    let mut rig = good.clone();
    rig.legs[1].plate_joint_m = rig.legs[2].plate_joint_m;
    says(&rig, &["plate joints of legs 1 and 2: are 0.0000 m apart", "at least 0.02 m"]);
    rig.legs[1].plate_joint_m.y += 0.0201;
    mended(&rig, "plate joints of legs 1 and 2");

    // The plate's triangle not turned: all legs' lines meet in one point.
    let mut rig = good.clone();
    for (i, leg) in rig.legs.iter_mut().enumerate() {
        let a =
            (i / 2) as f64 * 2.0 * FRAC_PI_3 + if i % 2 == 0 { -8.0_f64 } else { 8.0 }.to_radians();
        leg.plate_joint_m = DVec3::new(0.0, a.cos(), a.sin()) * 2.0;
    }
    says(&rig, &["plate in the middle: the pose is singular", "turn the plate's joint triangle"]);
    for (i, leg) in rig.legs.iter_mut().enumerate() {
        // Both ways: turned one way alike, all legs lie on one hyperboloid, which is singular too.
        let by = if i % 2 == 0 { -FRAC_PI_3 } else { FRAC_PI_3 };
        leg.plate_joint_m = docktwin_core::DQuat::from_rotation_x(by) * leg.plate_joint_m;
    }
    mended(&rig, "the pose is singular");

    // Turned by 35 deg about the docking axis on the way: past the singular pose at 90 deg.
    let mut rig = good.clone();
    rig.docking.roll_rad = 100.0_f64.to_radians();
    says(&rig, &["lies beyond a singular pose", "make the workspace smaller"]);
    rig.docking.roll_rad = 20.0_f64.to_radians();
    mended(&rig, "singular pose");

    // Long legs to the far plate joints cross.
    let mut rig = good.clone();
    (rig.legs[0].plate_joint_m, rig.legs[1].plate_joint_m) =
        (rig.legs[1].plate_joint_m, rig.legs[0].plate_joint_m);
    says(&rig, &["legs 0 and 1: cross: at ", "exchange their plate joints"]);
    (rig.legs[0].plate_joint_m, rig.legs[1].plate_joint_m) =
        (rig.legs[1].plate_joint_m, rig.legs[0].plate_joint_m);
    mended(&rig, "cross: at ");

    let mut rig = good.clone();
    rig.limits.force_n = 5000.0;
    says(&rig, &["5000 N do not carry the plate of 2500"]);
    let mut rig = good.clone();
    rig.limits.speed_m_s = 0.3;
    says(&rig, &["flagged leg_speed_m_s = 0.3 m/s is below"]);
    let mut rig = good;
    rig.gravity_m_s2 = DVec3::new(-9.0, 3.9, 0.0);
    says(&rig, &["flagged gravity does not lie along the docking axis"]);
}

/// What `model check RIG --mechanism ACTIVE` says of the weight: W/k, its share of travel and brake; and
/// that a mechanism does not stand on a rig that lies.
#[test]
fn oracle_a_rig_with_a_mechanism_tells_the_sag() {
    let active = models().join("apas_active.urdf");
    let report = crate::model_check_with(&models().join("stewart.toml"), Some(&active));
    assert!(report.refused.is_empty(), "{:?}", report.refused);
    // 2 % of 39.1 kg · 9.81 m/s² = 7.67 N on 3e5 N/m, of 150 mm of travel and a brake of 2500 N.
    let says = "sag, axial = 0.000026 m under 7.67 N, 0.02 % of the travel of 0.15 m, 0.31 % of the brake of \
                2500 N";
    assert!(report.read.iter().any(|l| l == says), "{:#?}", report.read);

    let dir = tempfile::tempdir().expect("a folder");
    for ext in ["urdf", "toml"] {
        let file = format!("stewart.{ext}");
        let text = std::fs::read_to_string(models().join(&file)).expect("model");
        let begin = text.find("[offload]").unwrap_or(text.len());
        let end = text[begin..].find("# Half-widths").map_or(text.len(), |i| begin + i);
        let text = format!("{}{}", &text[..begin], &text[end..]);
        let text = text.replace("[-9.81, 0.0, 0.0]", "[0.0, 0.0, -9.81]");
        std::fs::write(dir.path().join(file), text).expect("write");
    }
    let report = crate::model_check_with(&dir.path().join("stewart.toml"), Some(&active));
    let refused = report.refused.join("\n");
    assert!(
        refused.contains("would sag out of its travel: lateral by 0.4795 m of 0.12 m"),
        "{refused}"
    );
    assert!(crate::model_check_with(&active, Some(&active)).refused[0].contains("is no rig"));
}

#[test]
fn oracle_distance_of_legs() {
    use crate::rig_check::segment_distance;
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let cases = [
        ([-x, x], [z - y, z + y], 1.0),
        ([DVec3::ZERO, x], [2.0 * x, 3.0 * x], 1.0),
        ([DVec3::ZERO, x], [y, x + y], 1.0),
        ([DVec3::ZERO, x], [2.0 * x + y, 2.0 * x + 3.0 * y], 2.0_f64.sqrt()),
        ([DVec3::ZERO, 4.0 * x], [3.0 * x + z, 3.0 * x + 5.0 * z], 1.0),
    ];
    for (p, q, want) in cases {
        for got in [segment_distance(p, q), segment_distance(q, p)] {
            assert!((got - want).abs() < 1e-12, "{p:?} {q:?}: {got} against {want}");
        }
    }
}

/// What a copy of the probe with these edits is refused for, against what must be said.
fn probe_says(edits: &[(&str, &str, &str)], wanted: &[&str]) {
    let problems = Copy::new(edits).problems_of("probe");
    let text: Vec<String> = problems.iter().map(ToString::to_string).collect();
    for w in wanted {
        assert!(text.iter().any(|t| t.contains(w)), "no {w:?} among\n{}", text.join("\n"));
    }
    let told = |p: &Problem| !p.remedy.is_empty() && !p.what.is_empty();
    assert!(problems.iter().all(told), "{}", text.join("\n"));
}

const PROBE: &str = "probe_active.toml";
const DROGUE: &str = "probe_passive.toml";

fn a_number(x: &str) -> String {
    format!("{{ value = {x}, assumed = \"a test\" }}")
}

/// A probe whose TOML has everything wrong at once that can be wrong with surfaces and latches.
#[test]
fn regress_a_hostile_file_of_surfaces_is_refused_all_at_once() {
    let hull = format!(
        "[[surface]]\nname = \"hull\"\nkind = \"hull\"\nlink = \"ring\"\nposition_m = {}\nrpy_deg = {}\nrounding_m = {}\npoints_m = {}\n\
         stiffness_n_m = {}\nfriction = {}\nlength_m = {}\n[ring_body]",
        a_number("[0.0, 0.0, 0.0]"),
        a_number("[0.0, 0.0, 0.0]"),
        a_number("-0.1"),
        a_number(&format!("[{}]", vec!["[0.0, 0.0, 0.1]"; 65].join(", "))),
        a_number("1e6"),
        a_number("5.0"),
        a_number("1.0"),
    );
    // What one file says of itself comes at once, whatever the other one says.
    probe_says(
        &[
            (PROBE, "name = \"stem\"", "name = \"probe_head\""),
            (PROBE, "kind = \"capsule\"", "kind = \"cigar\""),
            (PROBE, "captured_when = \"all\"", "captured_when = \"hook\""),
            (PROBE, "[ring_body]", &hull),
            (PROBE, "strike_gap_m = { value = 0.008", "strike_gap_m = { value = 0.001"),
            (PROBE, "approach_gap_m = { value = 0.05", "approach_gap_m = { value = 0.0009"),
            (PROBE, "angle_zone_deg = { value = 15.0", "angle_zone_deg = { value = 200.0"),
            (
                DROGUE,
                "  [0.08, 0.06],",
                "  [0.0, 0.06],\n  [0.08, -0.06],\n  [0.1, 0.1],\n  [0.2, 0.2],",
            ),
            (DROGUE, "reference_radius_m", "referenz_radius_m"),
        ],
        &[
            "is the name of another surface",
            "sphere | capsule | torus",
            "names a latch that is not there; there are socket",
            "has 65 points, and a hull at most 64",
            "rounding_m = -0.1",
            "friction = 5",
            "surface.2.length_m",
            "a latch is struck before it catches",
            "a latch approaches before it is struck",
            "angle_zone_deg = 200",
            "has the same point twice in turn",
            "has a radius below 0",
            "has 7 points, and a hollow at most 6",
            "reference_radius_m",
        ],
    );
}

/// What only both sides of a probe and drogue together tell.
#[test]
fn regress_pairs_of_surfaces_are_refused_by_name() {
    let drogue = "kind = \"hollow\"\nlink = \"drogue\"";
    probe_says(
        &[
            (
                PROBE,
                "kind = \"sphere\"\nlink = \"head\"",
                "kind = \"box\"\nlink = \"head\"\nsize_m = { value = [0.01, 0.01, 0.01], assumed = \"a test\" }",
            ),
            (PROBE, "depth_m = { value = 0.02", "depth_m = { value = 0.035"),
        ],
        &[
            "box `probe_head` · hollow `drogue`",
            "have no law of contact",
            "where their cores would meet",
        ],
    );
    probe_says(
        &[(DROGUE, drogue, "kind = \"hollow\"\nlink = \"nowhere\"")],
        &["is no link of the URDF"],
    );
    probe_says(&[(PROBE, "link = \"head\"", "link = \"mount\"")], &["does not move with the ring"]);
    let many = |table: &str, times: usize| {
        let one = |i: usize| table.replace("$", &i.to_string());
        (0..times).map(one).collect::<String>()
    };
    let ball = format!(
        "[[surface]]\nname = \"ball_$\"\nkind = \"sphere\"\nlink = \"ring\"\nposition_m = {}\nrpy_deg = {}\nrounding_m = {}\n\
         stiffness_n_m = {}\nfriction = {}\n",
        a_number("[0.0, 0.0, 0.0]"),
        a_number("[0.0, 0.0, 0.0]"),
        a_number("0.1"),
        a_number("1e6"),
        a_number("0.1"),
    );
    probe_says(
        &[(PROBE, "[ring_body]", &(many(&ball, 47) + "[ring_body]"))],
        &["makes 49 pairs with the other side, and there is room for 48"],
    );
    let text = std::fs::read_to_string(models().join(PROBE)).expect("a model");
    let from = text.find("[[latch]]").expect("a latch");
    let latch = &text[from..from + text[from..].find("\n\n").expect("an end")];
    let latches = many(&format!("{}\n", latch.replace("\"socket\"", "\"socket_$\"")), 13);
    probe_says(&[(PROBE, latch, &latches)], &["has 13 latches, and a mechanism at most 12"]);
    // A ring's depth has its own bound.
    let deep =
        Copy::new(&[("ring_active.toml", "depth_m = { value = 0.04", "depth_m = { value = 0.05")]);
    let text: Vec<String> = deep.problems_of("ring").iter().map(ToString::to_string).collect();
    assert!(text.iter().any(|t| t.contains("beyond which the normals of rings")), "{text:?}");
}

/// The probe as it is shipped: where its surfaces stand, and what its pair is made of.
#[test]
fn oracle_surfaces_stand_where_their_links_do() {
    let m = mechanism("probe", None);
    assert!(!m.active.has_ring && !m.passive.has_ring && (m.docked_length_m() - 0.3).abs() < 1e-12);
    let head = &m.active.surfaces[0];
    assert!(
        (head.x_ring.p - DVec3::X * 0.345).length() < 1e-12 && (head.top_m() - 0.39).abs() < 1e-12
    );
    let drogue = &m.passive.surfaces[0];
    assert!((drogue.x_ring.p + DVec3::X * 0.4).length() < 1e-12);
    assert!((drogue.top_m() - 0.01).abs() < 1e-12, "{}", drogue.top_m());
    let pairs = m.surface_pairs();
    assert_eq!(pairs.len(), 2);
    // 1/k = 1/k₁ + 1/k₂, and √(μ₁ μ₂).
    assert!((pairs[0].stiffness_n_m - 1e6).abs() < 1e-6 && (pairs[0].friction - 0.1).abs() < 1e-12);
}
