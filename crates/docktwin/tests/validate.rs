//! `docktwin validate crosscheck`: refusals. The comparison itself runs in `validation/tests`, where
//! there is a Python with MuJoCo. `docktwin validate vibro-impact` with rigs that the loop does not know.

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

/// Two drawn rigs with sticks and dead zones that the loop does not know, identified and calibrated through their ports:
/// twins leave little, and without commissioning more. A corner is no worse than the middle.
#[test]
fn oracle_commissioned_rigs_are_true_and_others_are_not() {
    let at = tempfile::tempdir().expect("a folder");
    let run = |name: &str, more: &[&str]| -> Vec<f64> {
        let out = at.path().join(name);
        let mut c = Command::new(env!("CARGO_BIN_EXE_docktwin"));
        c.current_dir(root()).args(["validate", "vibro-impact", "--axis", "y", "--case", "6"]);
        c.args(["--compensator", "twin", "--json", "--out"]).arg(&out).args(more);
        let o = c.output().expect("docktwin starts");
        assert_eq!(o.status.code(), Some(0), "{}", said(&o));
        let answer: serde_json::Value = serde_json::from_slice(&o.stdout).expect("JSON");
        let test = &answer["tests"][0];
        let all = test["draws"].as_array().into_iter().chain(test["contacts"].as_array());
        all.flatten().map(|c| (c["R_e"].as_f64().expect("a number") - 1.0).abs()).collect()
    };
    let drawn = ["--draws", "2", "--draw-stick", "--dead-zone", "8"];
    let known = run("known", &[&drawn[..], &["--commission"]].concat());
    let believed = run("believed", &drawn);
    println!("{known:?} {believed:?}");
    assert_eq!((known.len(), believed.len()), (3, 3));
    assert!(known.iter().all(|x| *x < 2e-3), "{known:?}");
    assert!(believed[0].max(believed[1]) > 2.0 * known[0].max(known[1]), "{believed:?} {known:?}");
    let corner = run(
        "corner",
        &["--corner", "36", "--subtractive", "--dead-zone", "8", "--dead-zone-known"],
    );
    assert!(corner[0] < 2e-3, "{corner:?}");
}
