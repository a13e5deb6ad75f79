//! Keys of what `analyze` and `validate` print with `--json` are part of the public interface: they may
//! be added to, never renamed or removed. The lists under `keys/` are those of released versions; a key
//! that is new may be added to them, none may be taken out.

use std::{collections::BTreeSet, path::Path, process::Command};

use serde_json::Value;

/// Paths of all keys, `[]` for the elements of a list.
fn paths(value: &Value, at: &str, out: &mut BTreeSet<String>) {
    match value {
        Value::Object(fields) => {
            for (key, value) in fields {
                let path = if at.is_empty() { key.clone() } else { format!("{at}.{key}") };
                paths(value, &path, out);
                out.insert(path);
            }
        }
        Value::Array(all) => all.iter().for_each(|v| paths(v, &format!("{at}[]"), out)),
        _ => {}
    }
}

/// Keys on the list that an answer has not.
fn missing(list: &str, answer: &Value) -> Vec<String> {
    let mut found = BTreeSet::new();
    paths(answer, "", &mut found);
    list.lines().filter(|l| !found.contains(*l)).map(str::to_owned).collect()
}

fn check(name: &str, list: &str, words: &[&str]) {
    let at = tempfile::tempdir().expect("a folder");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let out = at.path().join(name);
    let mut c = Command::new(env!("CARGO_BIN_EXE_docktwin"));
    let o = c.current_dir(root).args(words).args(["--json", "--out"]).arg(&out).output();
    let o = o.expect("docktwin starts");
    assert_eq!(o.status.code(), Some(0), "{}", String::from_utf8_lossy(&o.stderr));
    let answer: Value = serde_json::from_slice(&o.stdout).expect("JSON");
    let gone = missing(list, &answer);
    assert!(gone.is_empty(), "{name} has lost keys: {gone:?}");
    assert!(list.lines().count() > 20, "{name}: a list of keys");
}

const RIG: &str = "models/urdf/stewart.toml";

#[test]
fn regress_keys_of_analyses_stay() {
    let mechanism = "models/urdf/apas_active.toml";
    check(
        "mechanism",
        include_str!("keys/mechanism.txt"),
        &[
            "analyze",
            "mechanism",
            mechanism,
            "--attenuation",
            "differential",
            "--axis",
            "x",
            "--axis",
            "pitch",
        ],
    );
    check("workspace", include_str!("keys/workspace.txt"), &["analyze", "workspace", RIG]);
    check("frequency", include_str!("keys/frequency.txt"), &["analyze", "frequency", RIG]);
    check(
        "bode",
        include_str!("keys/bode.txt"),
        &["analyze", "bode", RIG, "--dof", "z", "--payload", "axial"],
    );
    check(
        "stiffness",
        include_str!("keys/stiffness.txt"),
        &["analyze", "stiffness", RIG, "--preset", "stiff"],
    );
}

#[test]
fn regress_keys_of_validations_stay() {
    check("single-dof", include_str!("keys/single-dof.txt"), &["validate", "single-dof"]);
    check(
        "vibro-impact",
        include_str!("keys/vibro-impact.txt"),
        &["validate", "vibro-impact", "--axis", "x", "--case", "6", "--draws", "1"],
    );
}

/// The negative control.
#[test]
fn invariant_a_key_that_is_gone_is_seen() {
    let answer = serde_json::json!({ "a": [{ "b": 1 }, { "c": { "d": null } }], "e": 2 });
    assert!(missing("a\na[].b\na[].c.d\n", &answer).is_empty());
    assert_eq!(missing("a\na[].f\ne.g\n", &answer), ["a[].f", "e.g"]);
}
