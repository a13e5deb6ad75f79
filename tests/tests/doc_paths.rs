//! Paths of sources that the pages name exist: a page that sends its reader to a file that was moved is
//! worse than none.

use std::{fs, path::PathBuf};

fn root() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// Pages in the root and in `docs/`, without the changelog, which tells of what was.
fn pages() -> Vec<PathBuf> {
    let of = |folder: PathBuf| {
        let entries = fs::read_dir(&folder).expect("a folder of pages");
        let mut paths: Vec<PathBuf> = entries.map(|e| e.expect("an entry").path()).collect();
        paths.sort();
        paths
    };
    let mut all = of(root());
    all.extend(of(root().join("docs")));
    all.retain(|p| p.extension().is_some_and(|e| e == "md") && !p.ends_with("CHANGELOG.md"));
    all
}

/// Words between backticks that are paths into the folders of sources.
fn paths(text: &str) -> Vec<String> {
    let folders =
        ["crates/", "examples/", "tests/", "xtask/", "benches/", "validation/", "scenarios/"];
    text.split('`')
        .skip(1)
        .step_by(2)
        .filter(|w| folders.iter().any(|f| w.starts_with(f)))
        .filter(|w| !w.contains(['*', '<', '{', ' ', '…', '\n']) && !w.contains("NAME"))
        .map(|w| w.trim_end_matches('/').to_owned())
        .collect()
}

#[test]
fn invariant_pages_name_files_that_exist() {
    let mut missing = Vec::new();
    let mut seen = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).expect("a page");
        for path in paths(&text) {
            seen += 1;
            if !root().join(&path).exists() {
                missing.push(format!("{}: {path}", page.display()));
            }
        }
    }
    assert!(seen > 60, "only {seen} paths found: does the reading of pages still work?");
    assert!(missing.is_empty(), "no such file:\n{}", missing.join("\n"));
}

#[test]
fn regress_a_wrong_path_is_seen() {
    let found = paths("see `crates/none/src/x.rs` and `cargo run`, `crates/*/src`");
    assert_eq!(found, ["crates/none/src/x.rs"]);
    assert!(!root().join(&found[0]).exists());
}
