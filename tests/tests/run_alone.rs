//! Whoever runs dockings from Rust brings in no command line, no viewer and no terminal: a crate outside
//! the workspace that uses `docktwin-run` alone is resolved, checked by the compiler, and looked through.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use serde_json::Value;

/// Packages that belong to the command line: a name, or a prefix before `*`.
const STRANGERS: [&str; 9] = [
    "clap*",
    "rerun*",
    "re_*",
    "crossterm*",
    "indicatif",
    "miette*",
    "console",
    "docktwin",
    "docktwin-view",
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository").to_owned()
}

/// A crate outside the workspace, with the versions that the workspace has locked.
fn outside(dir: &Path) {
    let path = |name: &str| root().join("crates").join(name);
    let manifest = format!(
        "[package]\nname = \"outside\"\nversion = \"0.0.0\"\nedition = \"2024\"\n\n[workspace]\n\n\
         [dependencies]\ndocktwin-run = {{ path = {:?} }}\ndocktwin-scenario = {{ path = {:?} }}\n",
        path("run"),
        path("scenario")
    );
    fs::create_dir_all(dir.join("src")).expect("a folder");
    fs::write(dir.join("Cargo.toml"), manifest).expect("room on the disk");
    fs::copy(root().join("Cargo.lock"), dir.join("Cargo.lock")).expect("room on the disk");
    let source = "use docktwin_run::{Rehearsal, RunError, SummaryOnly};\n\
                  fn main() -> Result<(), RunError> {\n    \
                  let scenario = docktwin_scenario::Scenario::from_path(\"x.toml\")?;\n    \
                  println!(\"{}\", Rehearsal::new(&scenario)?.run(&mut SummaryOnly)?.outcome);\n    \
                  Ok(())\n}\n";
    fs::write(dir.join("src/main.rs"), source).expect("room on the disk");
}

fn cargo(dir: &Path, args: &[&str]) -> Vec<u8> {
    let out = Command::new(env!("CARGO"))
        .args(args)
        .arg("--offline")
        .current_dir(dir)
        // What fits is taken from what is built already.
        .env("CARGO_TARGET_DIR", target())
        .output()
        .expect("cargo can be called");
    assert!(out.status.success(), "cargo {args:?}: {}", String::from_utf8_lossy(&out.stderr));
    out.stdout
}

/// Other platforms have dependencies that are not downloaded here.
fn host() -> String {
    format!("{}-unknown-linux-gnu", std::env::consts::ARCH)
}

/// The folder in which this test was built.
fn target() -> PathBuf {
    let test = std::env::current_exe().expect("this program has a path");
    test.ancestors().nth(3).expect("target/debug/deps").to_owned()
}

/// Names of the packages that are compiled for `root`, as its dependencies of the ordinary kind.
fn packages(dir: &Path, root: &str) -> Vec<String> {
    let all: Value = serde_json::from_slice(&cargo(
        dir,
        &["metadata", "--format-version", "1", "--filter-platform", &host()],
    ))
    .expect("JSON");
    let named = all["packages"].as_array().expect("packages");
    let nodes = all["resolve"]["nodes"].as_array().expect("nodes");
    let root = named.iter().find(|p| p["name"] == root).expect("the package");
    let mut open = vec![root["id"].as_str().expect("an id").to_owned()];
    let mut seen = Vec::new();
    while let Some(id) = open.pop() {
        if seen.contains(&id) {
            continue;
        }
        let node = nodes.iter().find(|n| n["id"] == id.as_str()).expect("a node");
        for d in node["deps"].as_array().expect("dependencies") {
            let ordinary = d["dep_kinds"].as_array().expect("kinds").iter();
            if ordinary.into_iter().any(|k| k["kind"].is_null()) {
                open.push(d["pkg"].as_str().expect("an id").to_owned());
            }
        }
        seen.push(id);
    }
    let name = |id: &String| {
        let p = named.iter().find(|p| p["id"] == id.as_str()).expect("a package");
        p["name"].as_str().expect("a name").to_owned()
    };
    seen.iter().map(name).collect()
}

fn strangers(packages: &[String]) -> Vec<&String> {
    let stranger = |name: &String| {
        STRANGERS.iter().any(|s| {
            s.strip_suffix('*').map_or(name.as_str() == *s, |start| name.starts_with(start))
        })
    };
    packages.iter().filter(|p| stranger(p)).collect()
}

#[test]
fn invariant_run_brings_in_no_command_line_and_no_viewer() {
    let dir = tempfile::tempdir().expect("a folder");
    outside(dir.path());
    let found = packages(dir.path(), "outside");
    assert!(found.iter().any(|p| p == "docktwin-physics"), "{found:?}");
    assert!(strangers(&found).is_empty(), "docktwin-run brings in {:?}", strangers(&found));
    cargo(dir.path(), &["check", "--quiet"]);
}

/// The negative control: the command line itself would be seen.
#[test]
fn invariant_a_command_line_would_be_seen() {
    let found = packages(&root(), "docktwin");
    let seen = strangers(&found);
    for name in ["clap", "rerun", "indicatif"] {
        assert!(seen.iter().any(|p| p.starts_with(&name[..2])), "{name} is not seen in {seen:?}");
    }
}
