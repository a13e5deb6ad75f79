//! The table of ARCHITECTURE.md, held against `cargo metadata` and the sources.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use serde_json::Value;

/// Packages that are no rooms: they serve the house and nothing depends on them.
const OUTSIDE: [&str; 3] = ["docktwin-peers", "docktwin-tests", "xtask"];

/// The only files that may hold code the compiler cannot check: calls of the operating system for a
/// real-time loop, and counting allocators.
const UNCHECKED: [&str; 5] = [
    "crates/control/tests/compensation.rs",
    "crates/hil/src/realtime.rs",
    "crates/hil/tests/no_allocation.rs",
    "crates/physics/tests/no_allocation.rs",
    "tests/tests/fuzz/memory.rs",
];

/// What a word of the column "never sees" means: dependencies (a name, or a prefix before `*`) and
/// words of the source.
const NEVER: [(&str, &[&str], &[&str]); 9] = [
    ("the command line", &["clap*"], &["clap::"]),
    ("rapier", &["rapier*"], &["rapier3d"]),
    (
        "rerun",
        &["rerun*", "re_*"],
        &[
            "rerun::",
            "re_chunk",
            "re_log_encoding",
            "re_log_types",
            "re_sdk_types",
            "re_grpc_client",
        ],
    ),
    ("files", &["tempfile", "memmap*"], &["std::fs", "fs::", "File::", "OpenOptions"]),
    (
        "clocks",
        &["jiff", "chrono", "time", "web-time", "quanta"],
        &["std::time", "Instant::now", "SystemTime", "UNIX_EPOCH"],
    ),
    ("sockets", &["socket2", "mio", "tokio", "iceoryx2"], &["std::net", "std::os::unix::net"]),
    ("environment", &[], &["std::env", "env::var"]),
    (
        "threads",
        &["rayon", "crossbeam*", "tokio"],
        &["std::thread", "thread::", "Mutex", "RwLock", "Condvar", "mpsc"],
    ),
    (
        "printing",
        &["clap*", "miette", "indicatif", "crossterm"],
        &["println!", "print!", "eprintln!", "eprint!", "io::stdout", "io::stderr"],
    ),
];

/// Engines and devices that only one room may name, and that room; parry serves tests only.
const ONLY: [(&str, &[&str]); 5] = [
    ("rapier*", &["docktwin-twin"]),
    ("re_*", &["docktwin-view"]),
    ("parry*", &["docktwin-physics"]),
    ("crossterm", &["docktwin-pilot"]),
    ("evdev", &["docktwin-pilot"]),
];

/// What makes a result depend on more than its inputs.
const UNREPEATABLE: [&str; 4] = ["HashMap", "HashSet", "RandomState", "DefaultHasher"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository").to_owned()
}

struct Package {
    name: String,
    folder: PathBuf,
    /// Names of dependencies that are part of what is shipped.
    uses: Vec<String>,
}

fn packages() -> Vec<Package> {
    let out = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(root())
        .output()
        .expect("cargo can be called");
    assert!(out.status.success(), "cargo metadata: {}", String::from_utf8_lossy(&out.stderr));
    let all: Value = serde_json::from_slice(&out.stdout).expect("cargo writes JSON");
    let text = |v: &Value| v.as_str().expect("a text").to_owned();
    all["packages"]
        .as_array()
        .expect("packages")
        .iter()
        .map(|p| Package {
            name: text(&p["name"]),
            folder: Path::new(&text(&p["manifest_path"])).parent().expect("a folder").to_owned(),
            uses: p["dependencies"]
                .as_array()
                .expect("dependencies")
                .iter()
                // `null` is an ordinary dependency; `dev` ones are not shipped.
                .filter(|d| d["kind"] != "dev")
                .map(|d| text(&d["name"]))
                .collect(),
        })
        .collect()
}

/// A row of the table: what a room may use, and what it never sees.
struct Room {
    may_use: Option<Vec<String>>,
    never: Vec<String>,
}

/// Rows of the table, by crate.
fn rooms(page: &str) -> BTreeMap<String, Room> {
    let words = |cell: &str| -> Vec<String> {
        cell.split(',').map(|w| w.trim().to_owned()).filter(|w| !w.is_empty() && w != "–").collect()
    };
    page.lines()
        .filter_map(|line| {
            let cells: Vec<&str> = line.trim().trim_matches('|').split('|').collect();
            let [name, _, may_use, never] = cells[..] else { return None };
            let name = name.trim().strip_prefix('`')?.strip_suffix('`')?;
            let may_use = (may_use.trim() != "all")
                .then(|| words(may_use).iter().map(|w| format!("docktwin-{w}")).collect());
            name.starts_with("docktwin")
                .then(|| (name.to_owned(), Room { may_use, never: words(never) }))
        })
        .collect()
}

fn matches(pattern: &str, name: &str) -> bool {
    pattern.strip_suffix('*').map_or(name == pattern, |start| name.starts_with(start))
}

/// The part of a source that is shipped: no comments, no test module at its end.
fn shipped(source: &str) -> String {
    let tests = source.find("#[cfg(test)]\nmod tests {").unwrap_or(source.len());
    source[..tests]
        .lines()
        .map(|line| line.split_once("//").map_or(line, |(code, _)| code))
        .collect::<Vec<_>>()
        .join("\n")
}

/// Whether `word` stands in `code` on its own, not as part of a longer name.
fn holds(code: &str, word: &str) -> bool {
    let part = |c: char| c.is_alphanumeric() || c == '_';
    let begins = word.starts_with(part);
    let ends = word.ends_with(part);
    code.match_indices(word).any(|(at, _)| {
        let before = code[..at].chars().next_back().is_some_and(part);
        let after = code[at + word.len()..].chars().next().is_some_and(part);
        !(begins && before || ends && after)
    })
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut out = Vec::new();
    for entry in entries {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            out.extend(sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
    out.sort();
    out
}

/// Sources of a package that are shipped, with their text.
fn shipped_sources(package: &Package) -> Vec<(PathBuf, String)> {
    let all: Vec<_> = sources(&package.folder.join("src"))
        .into_iter()
        .filter(|path| path.file_name().is_some_and(|n| n != "tests.rs"))
        .map(|path| {
            let text = fs::read_to_string(&path).expect("a source is text");
            (path, shipped(&text))
        })
        .collect();
    assert!(!all.is_empty(), "{} has no sources", package.name);
    all
}

fn breaches(package: &Package, room: &Room) -> Vec<String> {
    let mut out = Vec::new();
    if let Some(may) = &room.may_use {
        out.extend(
            package
                .uses
                .iter()
                .filter(|d| d.starts_with("docktwin") && !may.contains(d))
                .map(|d| format!("{} uses {d}, which its row does not allow", package.name)),
        );
    }
    let sources = shipped_sources(package);
    for word in &room.never {
        let Some((_, crates, code)) = NEVER.iter().find(|(w, ..)| w == word) else {
            out.push(format!("{}: nobody knows how to check `{word}`", package.name));
            continue;
        };
        for d in &package.uses {
            if crates.iter().any(|c| matches(c, d)) {
                out.push(format!("{} never sees {word}, but uses {d}", package.name));
            }
        }
        for (path, text) in &sources {
            for c in code.iter().filter(|c| holds(text, c)) {
                out.push(format!(
                    "{} never sees {word}, but `{c}` stands in {}",
                    package.name,
                    path.display()
                ));
            }
        }
    }
    out
}

fn page() -> String {
    fs::read_to_string(root().join("ARCHITECTURE.md")).expect("ARCHITECTURE.md is there")
}

#[test]
fn invariant_every_room_keeps_to_its_row() {
    let rooms = rooms(&page());
    let packages = packages();
    let mut wrong = Vec::new();
    for p in packages.iter().filter(|p| !OUTSIDE.contains(&p.name.as_str())) {
        match rooms.get(&p.name) {
            None => wrong.push(format!("{} has no row in ARCHITECTURE.md", p.name)),
            Some(room) => wrong.extend(breaches(p, room)),
        }
    }
    for name in rooms.keys().filter(|n| !packages.iter().any(|p| p.name == **n)) {
        wrong.push(format!("ARCHITECTURE.md has a row for {name}, which does not exist"));
    }
    for p in &packages {
        for d in p.uses.iter().filter(|d| OUTSIDE.contains(&d.as_str())) {
            wrong.push(format!("{} uses {d}, which serves the house only", p.name));
        }
    }
    assert!(wrong.is_empty(), "ARCHITECTURE.md is not kept\n  {}", wrong.join("\n  "));
}

#[test]
fn invariant_every_engine_lives_in_one_room() {
    let packages = packages();
    for (engine, home) in ONLY {
        let users: Vec<&str> = packages
            .iter()
            .filter(|p| p.uses.iter().any(|d| matches(engine, d)))
            .map(|p| p.name.as_str())
            .collect();
        assert_eq!(users, home, "who uses {engine}");
    }
}

/// The rows may change, but not these promises.
#[test]
fn invariant_physics_and_twin_are_functions_of_their_inputs() {
    let rooms = rooms(&page());
    for name in ["docktwin-core", "docktwin-physics", "docktwin-twin"] {
        for word in ["files", "clocks", "sockets", "environment", "threads"] {
            assert!(rooms[name].never.iter().any(|w| w == word), "{name} may see {word}");
        }
    }
    for p in packages().iter().filter(|p| rooms.contains_key(&p.name)) {
        for (path, text) in shipped_sources(p) {
            for word in UNREPEATABLE {
                assert!(!holds(&text, word), "`{word}` stands in {}", path.display());
            }
        }
    }
}

#[test]
fn invariant_the_compiler_checks_every_memory_access() {
    // Put together, so that this file does not hold the word.
    let word = concat!("un", "safe");
    let mut seen = 0;
    for folder in ["crates", "tests", "xtask", "benches"] {
        for path in sources(&root().join(folder)) {
            let name = path.strip_prefix(root()).expect("in the repository").to_owned();
            if UNCHECKED.iter().any(|u| name == Path::new(u)) {
                continue;
            }
            seen += 1;
            let text = fs::read_to_string(&path).expect("a source is text");
            let code: String = text
                .lines()
                .map(|line| line.split_once("//").map_or(line, |(code, _)| code))
                .collect::<Vec<_>>()
                .join("\n");
            assert!(!holds(&code, word), "`{word}` stands in {}", name.display());
        }
    }
    assert!(seen > 50, "only {seen} sources were found");
}

/// Names of all packages that are built for `package` on this platform, its own included: what a crate outside
/// the workspace links that depends on it alone.
fn linked_by(package: &str) -> BTreeSet<String> {
    let out = Command::new(env!("CARGO"))
        .args(["tree", "--offline", "--package", package, "--edges", "no-dev"])
        .args(["--prefix", "none", "--format", "{p}"])
        .current_dir(root())
        .output()
        .expect("cargo can be called");
    assert!(out.status.success(), "cargo tree: {}", String::from_utf8_lossy(&out.stderr));
    let tree = String::from_utf8(out.stdout).expect("cargo writes text");
    tree.lines().filter_map(|line| line.split_whitespace().next()).map(str::to_owned).collect()
}

/// An adapter to a rig depends on the port alone: it links no physics, no control, no model, no viewer.
#[test]
fn invariant_an_adapter_to_a_rig_links_no_physics() {
    let linked = linked_by("docktwin-rigport");
    let of_the_house: Vec<&String> = linked.iter().filter(|n| n.starts_with("docktwin")).collect();
    assert_eq!(of_the_house, ["docktwin-core", "docktwin-rigport"]);
    for pattern in ["rapier*", "parry*", "rerun*", "re_*", "nalgebra*", "clap*", "urdf*"] {
        let found: Vec<_> = linked.iter().filter(|n| matches(pattern, n)).collect();
        assert!(found.is_empty(), "an adapter links {found:?}");
    }
    // The negative control: the loop does.
    let linked = linked_by("docktwin-hil");
    for name in ["docktwin-physics", "docktwin-control", "nalgebra"] {
        assert!(linked.contains(name), "{name} is not seen");
    }
}

/// The negative control: these tests see what they are to see.
#[test]
fn invariant_a_breach_is_seen() {
    let code = shipped("let t = std::time::Instant::now();\n");
    assert!(holds(&code, "std::time") && holds(&code, "Instant::now"));
    assert!(!holds(&shipped("// reads no std::time\n"), "std::time"));
    assert!(!holds("let files = MyHashMapLike;", "HashMap"));
    assert!(!holds("std::timer", "std::time"));
    assert!(!holds(&shipped("fn a() {}\n#[cfg(test)]\nmod tests {\n use std::fs;\n}"), "std::fs"));
    assert!(holds("use std::fs::File;", "std::fs"));

    let row = "| `docktwin-x` | what it does | core, model | rapier, clocks |";
    let rooms = rooms(row);
    let room = &rooms["docktwin-x"];
    assert_eq!(room.never, ["rapier", "clocks"]);
    let physics = packages().into_iter().find(|p| p.name == "docktwin-physics").expect("physics");
    let with = |name: &str| Package {
        name: "docktwin-x".to_owned(),
        folder: physics.folder.clone(),
        uses: vec![name.to_owned()],
    };
    assert!(breaches(&with("docktwin-model"), room).is_empty());
    assert_eq!(breaches(&with("docktwin-record"), room).len(), 1);
    assert_eq!(breaches(&with("rapier3d-f64"), room).len(), 1);
    assert_eq!(breaches(&with("jiff"), room).len(), 1);
    let unseen = &self::rooms("| `docktwin-y` | what it does | core | rerun |")["docktwin-y"];
    assert_eq!(breaches(&with("re_chunk"), unseen).len(), 1);
    // The sources of the command line read a clock.
    let line = packages().into_iter().find(|p| p.name == "docktwin").expect("the command line");
    assert!(breaches(&line, room).iter().any(|b| b.contains("clocks")));
    // It prints, by itself and by its dependencies.
    let row = "| `docktwin-x` | what it does | all | printing |";
    let found = breaches(&line, &self::rooms(row)["docktwin-x"]);
    for sign in ["uses clap", "uses indicatif", "`println!`", "`eprint!`"] {
        assert!(found.iter().any(|b| b.contains(sign)), "{sign} in {found:?}");
    }
}
