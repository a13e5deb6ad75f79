//! The comparison with MuJoCo, in a Python environment of its own under `target/`.

use std::path::{Path, PathBuf};

use docktwin_core::Digest;

use crate::{gate, shell};

const REQUIREMENTS: &str = "validation/requirements.txt";

/// Prepares the environment and runs every check; none may be skipped.
pub(crate) fn run(root: &Path) -> Result<(), String> {
    let python = environment(root)?;
    let mut tests = shell::command(root, &python, &["-m", "pytest", "validation"]);
    tests.env("DOCKTWIN_BIN", gate::binary(root));
    tests.env("DOCKTWIN_PEERS_BIN", gate::program(root, "docktwin-peers"));
    // Figures must not depend on how many threads numpy finds.
    tests.env("OMP_NUM_THREADS", "1").env("PYTHONDONTWRITEBYTECODE", "1");
    let last = shell::run_and_keep_last_line(&mut tests)?;
    whole(&last)
}

/// Whether the closing line of pytest speaks of tests that passed and of nothing else.
fn whole(last: &str) -> Result<(), String> {
    let fine = last.contains(" passed")
        && !["skipped", "failed", "error", "deselected", "xfailed", "xpassed"]
            .iter()
            .any(|word| last.contains(word));
    if fine { Ok(()) } else { Err(format!("a check was left out: `{}`", last.trim())) }
}

/// The interpreter of the environment, made or renewed when the requirements changed.
fn environment(root: &Path) -> Result<PathBuf, String> {
    let bytes = std::fs::read(root.join(REQUIREMENTS))
        .map_err(|e| format!("{REQUIREMENTS} cannot be read ({e})"))?;
    let wanted = Digest::of_bytes(&bytes).to_string();
    let dir = gate::target(root).join("venv-validation");
    let python = dir.join("bin").join("python");
    let stamp = dir.join("requirements.digest");
    if python.is_file() && std::fs::read_to_string(&stamp).is_ok_and(|had| had == wanted) {
        println!("using {}", dir.display());
        return Ok(python);
    }
    prerequisites(root)?;
    println!("making {} from {REQUIREMENTS}", dir.display());
    let of = |p: &Path| p.display().to_string();
    shell::run(&mut shell::command(root, "python3", &["-m", "venv", "--clear", &of(&dir)]))?;
    let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    let mut install = shell::command(root, &python, &pip);
    install.args(["--requirement", REQUIREMENTS]);
    shell::run(&mut install)?;
    std::fs::write(&stamp, wanted)
        .map_err(|e| format!("{} cannot be written ({e})", of(&stamp)))?;
    Ok(python)
}

/// One clear line for each thing this machine lacks.
fn prerequisites(root: &Path) -> Result<(), String> {
    let has = |code: &str| {
        shell::capture(&mut shell::command(root, "python3", &["-c", code]))
            .is_ok_and(|(_, status, _)| status == Some(0))
    };
    if !has("") {
        return Err("Python 3 is missing: `apt-get install python3 python3-venv`".to_owned());
    }
    if !has("import sys; sys.exit(sys.version_info < (3, 11))") {
        return Err("Python 3.11 or newer is needed: `apt-get install python3.11 python3.11-venv`"
            .to_owned());
    }
    if !has("import venv, ensurepip") {
        return Err("Python's venv module is missing: `apt-get install python3-venv`".to_owned());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::whole;

    #[test]
    fn invariant_a_skipped_check_is_not_a_pass() {
        assert!(whole("70 passed in 24.31s").is_ok());
        assert!(whole("69 passed, 1 skipped in 24.31s").is_err());
        assert!(whole("70 passed, 1 deselected in 3.0s").is_err());
        assert!(whole("no tests ran in 0.01s").is_err());
        assert!(whole("").is_err());
    }
}
