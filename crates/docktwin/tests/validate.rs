//! `docktwin validate crosscheck`: refusals. The comparison itself runs in `validation/tests`, where
//! there is a Python with MuJoCo.

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn crosscheck(words: &[&str]) -> Output {
    let mut c = Command::new(env!("CARGO_BIN_EXE_docktwin"));
    c.current_dir(root()).args(["validate", "crosscheck"]).args(words);
    c.env("NO_COLOR", "1").env_remove("DOCKTWIN_PYTHON");
    c.output().expect("docktwin starts")
}

fn said(o: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&o.stdout), String::from_utf8_lossy(&o.stderr))
}

#[test]
fn regress_a_missing_python_says_how_to_install_it() {
    let at = tempfile::tempdir().expect("a folder");
    let out = at.path().join("out");
    let out_s = out.display().to_string();
    let o =
        crosscheck(&["scenarios/apas_fast.toml", "--out", &out_s, "--python", "/no/such/python"]);
    assert_eq!(o.status.code(), Some(2), "{}", said(&o));
    for word in ["/no/such/python", "-m venv", "requirements.txt", "--python PATH"] {
        assert!(said(&o).contains(word), "{word} in {}", said(&o));
    }
    // Refused before any work.
    assert!(!out.exists());
}

#[test]
fn regress_bad_input_is_told_before_python_is_looked_for() {
    let o = crosscheck(&["scenarios/no_such.toml", "--python", "/no/such/python"]);
    assert_eq!(o.status.code(), Some(2));
    assert!(said(&o).contains("no_such.toml") && !said(&o).contains("venv"), "{}", said(&o));
    let o = crosscheck(&["scenarios/apas_fast.toml", "--validation", "scenarios"]);
    assert_eq!(o.status.code(), Some(2));
    assert!(said(&o).contains("not docktwin's validation directory"), "{}", said(&o));
    let o = crosscheck(&["scenarios/apas_fast.toml", "--step-ms", "0"]);
    assert_eq!(o.status.code(), Some(2));
}
