//! The platform's half of the comparison by its command line. Being here, these tests also have cargo
//! build the binary that the Python side starts.
#![expect(clippy::unwrap_used, reason = "a test may fail where it stands")]

use std::process::{Command, Output};

use serde_json::Value;

fn peers(arguments: &[&str]) -> Output {
    let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/urdf/stewart.urdf");
    Command::new(env!("CARGO_BIN_EXE_docktwin-peers"))
        .args(["platform", arguments[0], rig])
        .args(&arguments[1..])
        .output()
        .unwrap()
}

fn poses(out: &Output) -> Vec<Vec<f64>> {
    let all: Value = serde_json::from_slice(&out.stdout).unwrap();
    serde_json::from_value(all["poses"].clone()).unwrap()
}

#[test]
fn invariant_a_plate_let_go_where_its_springs_hold_it_stays() {
    let out = peers(&["release", "--place", "0,0,0,0,0,0", "--until-s", "0.5"]);
    let poses = poses(&out);
    assert_eq!(poses.len(), 51);
    let far = poses.iter().flat_map(|p| p.iter().zip(&poses[0])).map(|(a, b)| (a - b).abs());
    assert!(far.fold(0.0, f64::max) < 1e-9);
    let away = peers(&["release", "--place", "0.01,0,0,0,0,0", "--until-s", "0.5"]);
    assert!((self::poses(&away)[0][0] - poses[0][0] - 0.003).abs() < 1e-12);
}

#[test]
fn regress_what_cannot_be_computed_is_refused() {
    for arguments in [
        ["release", "--place", "0,0,0,0,0,0", "--step-ms", "3"],
        ["release", "--place", "0,0,0", "--step-ms", "1"],
    ] {
        let out = peers(&arguments);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}");
        assert!(!out.stderr.is_empty());
    }
}
