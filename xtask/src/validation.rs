//! The comparison with MuJoCo, in a Python environment of its own under `target/`.

use std::path::Path;

use crate::{python, shell};

const REQUIREMENTS: &str = "validation/requirements.txt";

/// Prepares the environment and runs every check; none may be skipped.
pub(crate) fn run(root: &Path) -> Result<(), String> {
    let python = python::environment(root, "venv-validation", REQUIREMENTS)?.join("python");
    let mut tests = shell::command(root, &python, &["-m", "pytest", "validation"]);
    tests.env("DOCKTWIN_BIN", shell::binary(root));
    tests.env("DOCKTWIN_PEERS_BIN", shell::program(root, "docktwin-peers"));
    // Figures must not depend on how many threads numpy finds.
    tests.env("OMP_NUM_THREADS", "1").env("PYTHONDONTWRITEBYTECODE", "1");
    let last = shell::run_and_keep_last_line(&mut tests)?;
    whole(&last)
}

/// Error unless the last line of pytest reports passed tests only.
fn whole(last: &str) -> Result<(), String> {
    let fine = last.contains(" passed")
        && !["skipped", "failed", "error", "deselected", "xfailed", "xpassed"]
            .iter()
            .any(|word| last.contains(word));
    if fine { Ok(()) } else { Err(format!("a check was left out: `{}`", last.trim())) }
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
