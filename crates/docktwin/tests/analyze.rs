//! `analyze mechanism`: its files and its answer.

use std::{path::Path, process::Command};

fn run(args: &[&str]) -> (Option<i32>, String) {
    let out = Command::new(env!("CARGO_BIN_EXE_docktwin")).args(args).output().expect("starts");
    (out.status.code(), String::from_utf8(out.stdout).expect("UTF-8"))
}

fn model(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(name);
    path.to_string_lossy().into_owned()
}

#[test]
fn oracle_the_answer_is_that_of_the_model_file() {
    let dir = tempfile::tempdir().expect("a directory");
    let at = |n: &str| dir.path().join(n).to_string_lossy().into_owned();
    let file = model("apas_passive.toml");
    let test = |out: &str| {
        run(&[
            "analyze",
            "mechanism",
            &file,
            "--axis",
            "roll",
            "--axis",
            "x",
            "--json",
            "--out",
            out,
        ])
    };
    let (code, text) = test(&at("a"));
    assert_eq!(code, Some(0), "{text}");
    let v: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(v["attenuation"], "characteristic");
    let axis = |i: usize| &v["axes"][i]["as_in_a_docking"];
    let near = |got: &serde_json::Value, want: f64| {
        let got = got.as_f64().expect("a number");
        assert!((got / want - 1.0).abs() < 2e-3, "{got} against {want}");
    };
    assert_eq!((&v["axes"][0]["axis"], &v["axes"][1]["axis"]), (&"x".into(), &"roll".into()));
    near(&axis(0)["soft_stiffness"], 3e5);
    near(&axis(0)["dry_friction"], 250.0);
    near(&axis(0)["travel"][0], -0.15);
    near(&axis(1)["soft_stiffness"], 600.0);
    near(&axis(1)["travel"][1], 15f64.to_radians());
    // The loop area in the file is the loss of the cycle.
    let csv = std::fs::read_to_string(dir.path().join("a/loop_x.csv")).expect("CSV");
    let mut rows = csv.lines();
    assert_eq!(
        rows.next(),
        Some(
            "test,other_axes,cycle,time_s,x_m,y_m,z_m,rotation_x_rad,rotation_y_rad,rotation_z_rad,\
             force_x_n,force_y_n,force_z_n,moment_x_nm,moment_y_nm,moment_z_nm,stored_j,lost_j,work_j"
        )
    );
    let points: Vec<[f64; 2]> = rows
        .map(|r| r.split(',').collect::<Vec<_>>())
        .filter(|r| r[0] == "working" && r[2] == "1")
        .map(|r| [r[4], r[10]].map(|x| x.parse().expect("a number")))
        .collect();
    let closed = points.iter().chain(points.first()).collect::<Vec<_>>();
    let area: f64 =
        closed.windows(2).map(|w| 0.5 * (w[0][1] + w[1][1]) * (w[1][0] - w[0][0])).sum();
    near(&axis(0)["lost_per_cycle_j"], area);
    for f in ["loop_x.svg", "loop_roll.svg", "coupling.svg", "contact.svg"] {
        let svg = std::fs::read_to_string(dir.path().join("a").join(f)).expect(f);
        assert!(svg.starts_with("<svg") && svg.contains("<path"), "{f}");
        assert!(!svg.contains("NaN") && svg.len() < 300_000, "{f}: {}", svg.len());
    }
    for f in ["matrices.csv", "contact.csv", "mechanism.json"] {
        assert!(dir.path().join("a").join(f).is_file(), "{f}");
    }
    assert!(!dir.path().join("a/loop_y.csv").exists());

    // The same answer again, bit for bit, and never over an old one.
    let (_, again) = test(&at("b"));
    assert_eq!(text, again);
    let other = std::fs::read_to_string(dir.path().join("b/loop_x.csv")).expect("CSV");
    assert!(csv == other, "the loops repeat");
    let (code, refusal) = test(&at("a"));
    assert_eq!(code, Some(2), "{refusal}");
    assert!(refusal.contains("is not empty"), "{refusal}");
}
