//! Verdicts of runs against a rig, and mechanisms that no rig bears, as users meet them.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use serde_json::Value;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn docktwin(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_docktwin"))
        .args(args)
        .current_dir(root())
        .output()
        .expect("docktwin runs")
}

fn said(o: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&o.stdout), String::from_utf8_lossy(&o.stderr))
}

/// The default rig in a folder, its TOML changed; gives the path of that.
fn rig(to: &Path, change: impl Fn(&str) -> String) -> String {
    let models = root().join("models/urdf");
    fs::copy(models.join("stewart.urdf"), to.join("stewart.urdf")).expect("shipped");
    let text = fs::read_to_string(models.join("stewart.toml")).expect("shipped");
    let changed = change(&text);
    assert_ne!(text, changed, "the rig's file has other words now");
    fs::write(to.join("stewart.toml"), changed).expect("a file");
    to.join("stewart.toml").to_string_lossy().into_owned()
}

fn without_balance(text: &str) -> String {
    let begin = text.find("[offload]").expect("its table");
    let end = text[begin..].find("\n[").or(text[begin..].find("# Half-widths")).expect("the next");
    format!("{}{}", &text[..begin], &text[begin + end..])
}

/// A fast docking for 2.5 s, which hold capture and a second after it.
fn fast(dir: &Path, name: &str, model: Option<&str>, more: &[&str]) -> (Option<i32>, Value) {
    let out = dir.join(name).to_string_lossy().into_owned();
    let mut args =
        vec!["hil", "scenarios/apas_fast.toml", "--rig", "emulated", "--json", "--no-rrd"];
    args.extend(["--set", "run.duration_s=2.5", "--out", &out]);
    args.extend(model.iter().flat_map(|m| ["--model", *m]));
    args.extend(more);
    let o = docktwin(&args);
    let summary = serde_json::from_slice(&o.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&o)));
    (o.status.code(), summary)
}

#[test]
fn regress_a_rig_without_a_balance_no_longer_passes() {
    let dir = tempfile::tempdir().expect("a folder");
    let bare = rig(dir.path(), without_balance);
    let (code, s) = fast(dir.path(), "balanced", None, &[]);
    assert_eq!((code, &s["verdict"]), (Some(0), &Value::from("pass")), "{s}");
    // Bounds of the docking without a rig are named, not judged.
    assert_eq!(s["not_judged"], Value::from(vec!["expect.capture_before_s"]), "{s}");
    let (code, s) = fast(dir.path(), "bare", Some(&bare), &[]);
    assert_eq!((code, &s["verdict"]), (Some(1), &Value::from("fail")), "{s}");
    let why = s["failure_reason"].as_str().expect("a reason");
    assert!(why.contains("fidelity.hardware.to_capture.nrms_force 0.2"), "{why}");
    assert_eq!(s["outcome"], "captured");
    assert!(s["warnings"].is_null(), "it is bounded: {s}");

    // Without bounds of a rig the same run passes as it did, and is warned of: printed, in the events too.
    let text = fs::read_to_string(root().join("scenarios/apas_fast.toml")).expect("shipped");
    let tables = text.find("[expect.hil]").or(text.find("[[expect.fidelity]]")).expect("bounds");
    let open = dir.path().join("apas_fast.toml");
    let models = format!("\"{}/models/", root().display());
    fs::write(&open, text[..tables].replace("\"models/", &models)).expect("a file");
    let run = dir.path().join("open").to_string_lossy().into_owned();
    let open = open.to_string_lossy().into_owned();
    let mut args = vec!["hil", &open, "--rig", "emulated", "--model", &bare, "--out", &run];
    args.extend(["--set", "run.duration_s=2.5"]);
    let o = docktwin(&args);
    let told = said(&o);
    assert_eq!(o.status.code(), Some(0), "{told}");
    assert!(told.contains("  warning        the force is "), "{told}");
    let events = fs::read_to_string(Path::new(&run).join("events.jsonl")).expect("events");
    assert!(events.contains("\"kind\":\"warning\"") && events.contains("\"kind\":\"fidelity\""));
    let summary = fs::read_to_string(Path::new(&run).join("summary.json")).expect("a summary");
    assert!(summary.contains("\"warnings\""), "{summary}");
    let report = docktwin(&["report", &run]);
    assert!(report.status.success(), "{}", said(&report));
    let page = fs::read_to_string(Path::new(&run).join("report.html")).expect("a page");
    assert!(page.contains("Warning: ") && page.contains("forces are small here"));

    // A rehearsal says which bounds it leaves to `hil`, and does not fail by them.
    let out = dir.path().join("rehearsed").to_string_lossy().into_owned();
    let mut args = vec!["rehearse", "scenarios/apas_fast.toml", "--twin", "reduced", "--no-rrd"];
    args.extend(["--set", "run.duration_s=2.5", "--out", &out]);
    let o = docktwin(&args);
    assert_eq!(o.status.code(), Some(0), "{}", said(&o));
    assert!(said(&o).contains("expect.fidelity.0.nrms_force_below"), "{}", said(&o));
}

/// A mechanism that would sag out of its travel: refused by all that arm or emulate a rig, in the same words;
/// told where only the scenario is at hand.
#[test]
fn regress_a_mechanism_that_sags_stands_on_no_rig() {
    let dir = tempfile::tempdir().expect("a folder");
    let lying = rig(dir.path(), |text| {
        without_balance(text).replace("value = [-9.81, 0.0, 0.0]", "value = [0.0, 0.0, -9.81]")
    });
    let says = "would sag out of its travel: lateral by 0.4795 m of 0.12 m";
    let one = |args: &[&str], code: i32| {
        let o = docktwin(args);
        assert_eq!(o.status.code(), Some(code), "{args:?}: {}", said(&o));
        let told = said(&o).split_whitespace().filter(|w| *w != "│").collect::<Vec<_>>().join(" ");
        assert!(told.contains(says), "{args:?}: {told}");
    };
    let nominal = "scenarios/apas_nominal.toml";
    let file = format!("loop.rig=\"{lying}\"");
    let out = dir.path().join("run").to_string_lossy().into_owned();
    one(&["model", "check", &lying, "--mechanism", "models/urdf/apas_active.urdf"], 2);
    one(&["hil", nominal, "--rig", "emulated", "--model", &lying, "--out", &out], 2);
    one(&["rig", "emulate", &lying, "--name", "lying", "--scenario", nominal], 2);
    let found = dir.path().join("found.toml").to_string_lossy().into_owned();
    let measure = ["--rig", "emulated", "--model", &lying, "--scenario", nominal, "--out", &found];
    one(&[&["rig", "identify"], measure.as_slice()].concat(), 2);
    one(&[&["rig", "calibrate"], measure.as_slice()].concat(), 2);
    one(&["scenario", "check", nominal, "--set", &file], 0);
    one(&["scenario", "check", nominal, "--set", &file, "--json"], 0);
    let mut args = vec!["rehearse", nominal, "--set", &file, "--set", "run.duration_s=0.1"];
    args.extend(["--no-rrd", "--out", &out]);
    let o = docktwin(&args);
    // It ends too early to be captured; that it sags is told.
    assert!(said(&o).contains("flagged `hil` refuses it on"), "{}", said(&o));
    // Without the lie nothing is flagged.
    let o = docktwin(&["scenario", "check", nominal]);
    assert!(o.status.success() && !said(&o).contains("flagged"), "{}", said(&o));
    assert!(said(&o).contains("with the ring of 39.100 kg"), "{}", said(&o));
}
