//! `docs/models.md` says what the tables of keys and the shipped files say, and its example is a model.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use docktwin_model::keys::{FileKind, markdown};
use docktwin_model::{Attenuator, load_mechanism, load_spacecraft};

#[path = "../../../tests/page.rs"]
mod page;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

#[test]
fn invariant_the_page_of_models_is_up_to_date() {
    let mut blocks = vec![("masses", masses())];
    blocks.extend(FileKind::WORDS.map(|(word, kind)| (word, markdown(kind))));
    page::check("models.md", &blocks);
}

/// What chaser and ring weigh in every shipped scenario.
fn masses() -> String {
    // By models and attenuation, the scenarios that have them.
    let mut found: BTreeMap<[String; 4], Vec<String>> = BTreeMap::new();
    for entry in fs::read_dir(root().join("scenarios")).expect("scenarios") {
        let path = entry.expect("an entry").path();
        let text = fs::read_to_string(&path).expect("a scenario");
        let scenario: toml::Table = text.parse().expect("TOML");
        let word = |table: &str, key: &str| {
            scenario[table].get(key).and_then(toml::Value::as_str).unwrap_or_default().to_owned()
        };
        let models = [
            word("chaser", "model"),
            word("mechanism", "active"),
            word("mechanism", "passive"),
            word("mechanism", "attenuation"),
        ];
        let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
        found.entry(models).or_default().push(name);
    }
    let mut rows: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for ([chaser, active, passive, attenuation], names) in found {
        let kg = load_spacecraft(&root().join(&chaser)).expect("loads").model.mass_kg;
        let words = docktwin_model::AttenuationChoice::WORDS;
        let choice = words.iter().find(|(w, _)| *w == attenuation).map(|(_, c)| *c);
        let mechanism = load_mechanism(&root().join(&active), &root().join(&passive), choice);
        let mechanism = mechanism.expect("loads").model;
        let ring_kg = mechanism.ring_body.mass_kg;
        let is = match mechanism.attenuator {
            Attenuator::Rigid => "part of the chaser (`rigid`)",
            _ => "a body of its own",
        };
        let stem =
            |p: &str| format!("`{}`", Path::new(p).file_stem().expect("a name").to_string_lossy());
        let row = format!(
            "{} {kg} kg | {} {ring_kg} kg | {:.3} kg | {is}",
            stem(&chaser),
            stem(&active),
            kg + ring_kg
        );
        rows.entry(row).or_default().extend(names);
    }
    let mut out = String::from(
        "| chaser's URDF | ring | together | the ring is | scenarios |\n| --- | --- | --- | --- | --- |\n",
    );
    for (row, mut names) in rows {
        names.sort();
        let _ = writeln!(out, "| {row} | {} |", names.join(", "));
    }
    out
}

/// The first block of this language on the page.
fn block(page: &str, language: &str) -> String {
    let (_, rest) = page.split_once(&format!("```{language}\n")).expect("a block");
    rest.split_once("```").expect("its end").0.to_owned()
}

#[test]
fn invariant_the_example_of_the_page_is_a_spacecraft() {
    let page = fs::read_to_string(root().join("docs/models.md")).expect("the page");
    let dir = tempfile::tempdir().expect("a folder");
    let urdf = dir.path().join("my_chaser.urdf");
    fs::write(&urdf, block(&page, "xml")).expect("write");
    let (_, own) = page.split_once("A model of one's own").expect("the section");
    fs::write(urdf.with_extension("toml"), block(own, "toml")).expect("write");
    let craft = load_spacecraft(&urdf).unwrap_or_else(|e| panic!("{e}")).model;
    assert!((craft.mass_kg - 5960.9).abs() < 1e-9 && craft.x_body_port.p.x > 3.0);
}
