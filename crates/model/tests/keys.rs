//! The tables of keys and the loaders are one: every key is read, and nothing is read beside them.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use docktwin_model::keys::{FileKind, Key, Shape, explained, without_indices};
use docktwin_model::{Report, model_check};

fn models() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf")
}

fn kind_of(toml: &Path) -> FileKind {
    let text = fs::read_to_string(toml).expect("a model");
    let word = text.lines().find_map(|l| l.strip_prefix("kind = ")).expect("a kind");
    let found = FileKind::WORDS.iter().find(|(w, _)| *w == word.trim_matches('"'));
    found.expect("a known kind").1
}

/// `apas` with texts of its active TOML replaced.
struct Apas(tempfile::TempDir);

impl Apas {
    fn with(edits: &[(&str, &str)]) -> Self {
        Self::side_with("apas_active.toml", edits)
    }

    fn with_passive(edits: &[(&str, &str)]) -> Self {
        Self::side_with("apas_passive.toml", edits)
    }

    fn side_with(file: &str, edits: &[(&str, &str)]) -> Self {
        let dir = tempfile::tempdir().expect("a folder");
        let (urdf, meshes) = (dir.path().join("models/urdf"), dir.path().join("meshes"));
        fs::create_dir_all(&urdf).expect("a folder");
        fs::create_dir_all(&meshes).expect("a folder");
        for side in ["active", "passive"] {
            for name in [format!("apas_{side}.urdf"), format!("apas_{side}.toml")] {
                let mut text = fs::read_to_string(models().join(&name)).expect("a model");
                for (from, to) in edits.iter().filter(|_| name == file) {
                    assert!(text.contains(from), "no {from:?}: mend the case");
                    text = text.replacen(from, to, 1);
                }
                fs::write(urdf.join(&name), text).expect("write");
            }
            for part in ["ring", "petal"] {
                fs::write(meshes.join(format!("apas_{side}_{part}.obj")), "").expect("write");
            }
        }
        Self(dir)
    }

    fn check(&self) -> Report {
        model_check(&self.0.path().join("models/urdf/apas_active.toml"))
    }
}

/// Keys of TOML files that a check has read, each with its kind of file.
fn read_keys(report: &Report) -> BTreeSet<(&'static str, String)> {
    let of_toml = |p: &Path| p.extension().is_some_and(|e| e == "toml");
    let values = report.values.iter().filter(|v| of_toml(&v.file));
    values.map(|v| (kind_of(&v.file).word(), without_indices(&v.key))).collect()
}

/// The other normal law, which no shipped file has.
const OTHER_LAW: &[(&str, &str)] = &[
    ("normal_law = \"hunt_crossley\"", "normal_law = \"kelvin_voigt\""),
    ("exponent = {", "damping_n_s_m = { value = 4000.0, assumed = \"a test\" }\n# {"),
    ("damping_s_m = {", "# {"),
];

/// A brake in every channel that has none in the shipped files, and a play in a coordinate of the differentials.
fn brakes() -> Vec<(String, String)> {
    let channels = [
        ("lateral", "force_n", "viscous_n_s_m"),
        ("tilt", "force_nm", "viscous_nm_s_rad"),
        ("roll", "force_nm", "viscous_nm_s_rad"),
    ];
    let brake = |(table, force, viscous): (&str, &str, &str)| {
        let head = format!("[attenuation.characteristic.{table}]\n");
        let number = "{ value = 300.0, assumed = \"a test\" }";
        let body = format!("{head}series_brake = {{ {force} = {number}, {viscous} = {number} }}\n");
        (head, body)
    };
    let head = "[[attenuation.differential.channels]]\n".to_owned();
    let play = "backlash = { width_m = { value = 0.001, assumed = \"a test\" } }\n";
    let with_play = (head.clone(), format!("{head}{play}"));
    channels.map(brake).into_iter().chain([with_play]).collect()
}

/// Listed surfaces of the kinds that no shipped file has, out of reach, and `[[latch]]` with them.
fn kinds() -> String {
    let list = |x: &str| format!("{{ value = {x}, assumed = \"a test\" }}");
    let sizes = [
        ("torus", format!("core_radius_m = {}", list("0.2"))),
        ("cylinder", format!("core_radius_m = {}\nlength_m = {}", list("0.2"), list("0.2"))),
        ("box", format!("size_m = {}", list("[0.1, 0.1, 0.1]"))),
        (
            "hull",
            format!("points_m = {}", list("[[0.0, 0.0, 0.1], [0.0, 0.1, 0.0], [0.1, 0.0, 0.0]]")),
        ),
        ("hollow", format!("profile_m = {}", list("[[0.0, 0.1], [0.2, 0.3]]"))),
    ];
    let table = |(kind, sizes): &(&str, String)| {
        format!(
            "[[surface]]\nname = \"{kind}\"\nkind = \"{kind}\"\nlink = \"ring\"\nposition_m = {}\nrpy_deg = {}\nrounding_m = {}\n\
             {sizes}\nstiffness_n_m = {}\nfriction = {}\n",
            list("[0.0, 9.0, 0.0]"),
            list("[0.0, 90.0, 0.0]"),
            list("0.05"),
            list("1e6"),
            list("0.1"),
        )
    };
    sizes.iter().map(table).collect()
}

#[test]
fn invariant_every_key_is_read_and_none_beside() {
    let mut read = BTreeSet::new();
    let mut files = 0;
    let mut take = |report: &Report, what: &str| {
        assert_eq!(report.refused, [""; 0], "{what}");
        read.extend(read_keys(report));
    };
    for entry in fs::read_dir(models()).expect("models") {
        let path = entry.expect("an entry").path();
        if path.extension().is_some_and(|e| e == "toml") {
            take(&model_check(&path), &path.to_string_lossy());
            files += 1;
        }
    }
    assert!(files >= 20, "{files}");
    let foreign = models().with_file_name("foreign");
    for entry in fs::read_dir(foreign).expect("models of other structures") {
        let path = entry.expect("an entry").path();
        if path.extension().is_some_and(|e| e == "toml") {
            take(&model_check(&path), &path.to_string_lossy());
        }
    }
    let other = Apas::with(OTHER_LAW);
    take(&other.check(), "the other normal law");
    let brakes = brakes();
    let edits: Vec<(&str, &str)> = brakes.iter().map(|(f, t)| (f.as_str(), t.as_str())).collect();
    let braked = Apas::with(&edits);
    take(&braked.check(), "brakes");

    let kinds = format!("{}[ring_body]", kinds());
    take(&Apas::with(&[("[ring_body]", &kinds)]).check(), "kinds of surfaces");
    take(
        &Apas::with_passive(&[("[petals]", &kinds.replace("[ring_body]", "[petals]"))]).check(),
        "on the passive side",
    );

    let dotted = |table: &str, k: &Key| {
        if table.is_empty() { k.name.to_owned() } else { format!("{table}.{}", k.name) }
    };
    let known: BTreeSet<(&str, String)> = FileKind::WORDS
        .into_iter()
        .flat_map(|(word, kind)| kind.keys().map(move |(t, k)| (word, dotted(t, k))))
        .collect();
    let missing: Vec<_> = known.difference(&read).collect();
    let beside: Vec<_> = read.difference(&known).collect();
    assert!(missing.is_empty() && beside.is_empty(), "not read: {missing:?}; beside: {beside:?}");
}

#[test]
fn regress_a_key_in_the_wrong_table_is_sent_to_the_right_one() {
    let remedy = |given: &str, to: &str, key: &str| {
        let report = Apas::with(&[("[limits]\n", to), ("friction_kinetic =", given)]).check();
        let found = report.problems.iter().find(|p| p.key == key);
        found.unwrap_or_else(|| panic!("no {key} among {:?}", report.refused)).remedy.clone()
    };
    let number = "{ value = 0.1, assumed = \"a test\" }";
    // In another table, misspelt in its own, and unlike anything.
    let (there, gone) = ("friction_kinetic =", "# friction_kinetic =");
    for (given, name, meant) in [
        (gone, "friction_kinetic", "did you mean `contact.friction_kinetic`?"),
        (there, "friction_kinetic", "remove it: `contact.friction_kinetic` is given already"),
        // A key with the right name is there too.
        (there, "tension", "remove it"),
        (there, "zzzzzzzzzz", "remove it"),
    ] {
        let to = format!("[limits]\n{name} = {number}\n");
        assert_eq!(remedy(given, &to, &format!("limits.{name}")), meant);
    }
    let misspelt = remedy("friction_kinetik =", "[limits]\n", "contact.friction_kinetik");
    assert_eq!(misspelt, "did you mean `friction_kinetic`?");
}

/// Whether the loader takes the example of a key.
fn is_taken(k: &Key, value: &toml::Value) -> bool {
    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    let number = |v: &toml::Value| v.as_float().or(v.as_integer().map(|i| i as f64));
    let all = |v: &toml::Value, n: usize, within: &dyn Fn(f64) -> bool| {
        v.as_array().is_some_and(|list| {
            list.len() == n && list.iter().all(|x| number(x).is_some_and(within))
        })
    };
    match k.shape {
        Shape::Version(v) => value.as_integer() == Some(i64::from(v)),
        Shape::Text(_) => value.as_str().is_some_and(|t| !t.is_empty()),
        Shape::Words(words) => value.as_str().is_some_and(|t| words.contains(&t)),
        Shape::Number(r) => number(value).is_some_and(|x| r.contains(x)),
        Shape::Count(lo, hi) => {
            value.as_integer().is_some_and(|i| (i64::from(lo)..=i64::from(hi)).contains(&i))
        }
        Shape::List(n, r) => all(value, n, &|x| r.contains(x)),
        Shape::Rows(rows, n, r) => value.as_array().is_some_and(|list| {
            rows.map_or(list.len() >= 2, |m| list.len() == m)
                && list.iter().all(|row| all(row, n, &|x| r.contains(x)))
        }),
        Shape::Note => value.as_table().is_some_and(|t| {
            t.len() == 1 && ["source", "assumed"].iter().any(|w| t.contains_key(*w))
        }),
    }
}

#[test]
fn invariant_examples_are_what_the_loaders_take() {
    for (word, kind) in FileKind::WORDS {
        for (table, k) in kind.keys() {
            let at = format!("{word}: {table}.{}", k.name);
            assert!(k.meaning.ends_with('.') && k.why.ends_with('.'), "{at}");
            // Long lists are cut.
            if k.example.contains('…') {
                continue;
            }
            let text = format!("x = {}", k.example);
            let found: toml::Table = text.parse().unwrap_or_else(|e| panic!("{at}: {e}"));
            assert!(is_taken(k, &found["x"]), "{at}: {} is not {:?}", k.example, k.shape);
        }
    }
}

#[test]
fn regress_keys_are_explained() {
    assert!(explained(None, None).expect("all keys").len() > 150);
    // What both sides of a mechanism have in common is told once.
    let radius = explained(None, Some("ring.mean_radius_m")).expect("a key");
    assert_eq!(radius.len(), 1);
    assert_eq!(radius[0].files, ["mechanism_active", "mechanism_passive"]);
    assert_eq!(radius[0].example, "mean_radius_m = { value = 0.6, source = \"…\" }");
    // With an index, as a problem names it; a table; the last word alone; nothing like it.
    let of_list = explained(Some(FileKind::Rig), Some("closures.3.rod")).expect("a key");
    assert_eq!(of_list[0].key, "closures.rod");
    assert_eq!(explained(None, Some("limits")).expect("a table").len(), 7);
    let unknown = explained(None, Some("tension_n")).expect_err("without its table");
    let says = "`tension_n` is no key of a model; did you mean `limits.tension_n`?";
    assert_eq!(unknown.to_string(), says);
    let strange = explained(None, Some(&"x\u{1b}".repeat(500))).expect_err("no such key");
    assert!(strange.nearest.is_empty() && !strange.to_string().contains('\u{1b}'), "{strange}");
}
