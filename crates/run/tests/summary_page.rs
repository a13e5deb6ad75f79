//! `docs/summary.md` explains every key of a summary.

use std::{fs, path::Path};

use docktwin_run::{HilOptions, HilRun, RunDirectory};
use docktwin_scenario::Loader;
use serde_json::Value;

/// Dotted names of the keys; what has other keys from run to run counts as one.
fn keys(value: &Value, prefix: &str, out: &mut Vec<String>) {
    const OPEN: [&str; 4] = ["step_us", "loop.lateness_us", "loop.phases", "safety.min_margin"];
    match value {
        Value::Object(fields) if !OPEN.contains(&prefix) => {
            for (key, value) in fields {
                let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
                keys(value, &name, out);
            }
        }
        _ => out.push(prefix.to_owned()),
    }
}

#[test]
fn invariant_the_page_of_the_summary_has_every_key() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let page = fs::read_to_string(root.join("docs/summary.md")).expect("the page");
    let scenario = Loader::new()
        .set("run.duration_s", 0.2)
        .load(&root.join("scenarios/apas_nominal.toml"))
        .expect("a scenario");
    let run = HilRun::new(&scenario, HilOptions::default()).expect("a run");
    let rig = run.emulated().expect("a rig");
    let dir = tempfile::tempdir().expect("a folder");
    let summary = run.run(rig, &mut RunDirectory::new(dir.path().join("run"))).expect("a summary");
    let mut found = Vec::new();
    keys(&serde_json::to_value(&summary).expect("JSON"), "", &mut found);
    assert!(found.len() > 35, "{found:?}");
    let missing: Vec<&String> =
        found.iter().filter(|k| !page.contains(&format!("`{k}`"))).collect();
    assert!(missing.is_empty(), "docs/summary.md does not explain {missing:?}");
}
