//! `rig emulate`, `rig calibrate`, `rig identify` as users meet them.

use std::{
    io::{BufRead as _, BufReader, Lines},
    path::{Path, PathBuf},
    process::{Child, ChildStdout, Command, Output, Stdio},
};

use docktwin_model::load_rig;
use docktwin_run::rigfile::{CalibrationFile, IdentificationFile, RigFileError, read, write};
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

const RIG: &str = "models/urdf/stewart.toml";

/// `docktwin rig emulate` in a process of its own.
struct Emulated {
    child: Child,
    said: Lines<BufReader<ChildStdout>>,
    /// `ipc:NAME`.
    port: String,
}

impl Emulated {
    fn start(what: &str, more: &[&str]) -> Self {
        let name = format!("test-{what}-{}", std::process::id());
        let mut child = Command::new(env!("CARGO_BIN_EXE_docktwin"))
            .args(["rig", "emulate", RIG, "--name", &name, "--allow-best-effort"])
            .args(more)
            .current_dir(root())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("docktwin runs");
        let mut said = BufReader::new(child.stdout.take().expect("piped")).lines();
        let port = format!("ipc:{name}");
        let ready = said.next().expect("a line").expect("text");
        assert!(ready.starts_with(&format!("ready: {port}")), "{ready}");
        Self { child, said, port }
    }

    /// Asks it to end; its last line.
    fn end(mut self) -> String {
        let killed = Command::new("kill").args(["-TERM", &self.child.id().to_string()]).status();
        assert!(killed.expect("kill is there").success());
        let last = self.said.next().expect("a line").expect("text");
        assert!(self.child.wait().expect("it was started here").success());
        last
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What was measured comes back bit by bit, belongs to its rig, and is refused when it was touched.
#[test]
fn invariant_files_come_back_as_they_were_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let text = |path: &Path| path.to_str().expect("plain").to_owned();
    let legs = at("legs.toml");
    let done = docktwin(&[
        "rig",
        "identify",
        "--rig",
        "emulated",
        "--model",
        RIG,
        "--perturb",
        "7",
        "--dof",
        "y",
        "--out",
        &text(&legs),
    ]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let found = read::<IdentificationFile>(&legs).expect("it was just written");
    let rig = load_rig(&root().join(RIG)).expect("the rig of the repository").model;
    found.made_for(&rig).expect("it is of this rig");
    assert!(found.content.origin.age_days() < 1.0);
    let known = found.content.identification().expect("it is whole");
    assert_eq!(known.response.len(), 9);
    // Gain and phase are written, not real and imaginary part.
    let again = IdentificationFile::new(found.content.origin.clone(), &known);
    let second = at("again.toml");
    write(&second, &again).expect("a new file");
    let again = read::<IdentificationFile>(&second).expect("it was just written");
    assert_eq!(again.content.leg, found.content.leg);
    assert!(write(&second, &again.content).is_err(), "written over");

    let sensors = at("sensors.toml");
    let done = docktwin(&[
        "rig",
        "calibrate",
        "--rig",
        "emulated",
        "--model",
        RIG,
        "--perturb",
        "7",
        "--identification",
        &text(&legs),
        "--out",
        &text(&sensors),
    ]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let found = read::<CalibrationFile>(&sensors).expect("it was just written");
    let known = found.content.calibration();
    assert!((known.of_b.expect("a sensor B").payload.mass_kg - 200.0).abs() < 0.5);
    let back = CalibrationFile::new(found.content.origin.clone(), &known);
    assert_eq!(back.payload_inertia_kg_m2, found.content.payload_inertia_kg_m2);

    // A key of nobody, a number of no rig, another kind, another rig.
    let whole = std::fs::read_to_string(&sensors).expect("it is there");
    let bad = |name: &str, text: String| {
        let path = at(name);
        std::fs::write(&path, text).expect("a file");
        path
    };
    let unknown = bad("a.toml", whole.replace("rest_n =", "rest_newton ="));
    assert!(matches!(read::<CalibrationFile>(&unknown), Err(RigFileError::Content { .. })));
    let mass = found.content.payload_mass_kg.expect("a sensor B");
    let mass = format!("payload_mass_kg = {mass:?}");
    let torn = bad("d.toml", whole.replace(&mass, ""));
    assert!(matches!(read::<CalibrationFile>(&torn), Err(RigFileError::Content { .. })));
    let negative = bad("b.toml", whole.replace(&mass, "payload_mass_kg = nan"));
    assert!(matches!(read::<CalibrationFile>(&negative), Err(RigFileError::Value { .. })));
    assert!(matches!(read::<IdentificationFile>(&sensors), Err(RigFileError::Content { .. })));
    let other = bad("c.toml", whole.replace(&found.content.origin.rig_digest, "0000"));
    let other = read::<CalibrationFile>(&other).expect("well formed");
    assert!(matches!(other.made_for(&rig), Err(RigFileError::Rig { .. })));
}

/// A rig in a process of its own is identified as one in this process, bit by bit, and ends with
/// counts.
#[test]
fn invariant_a_rig_in_another_process_is_the_same_rig() {
    let folder = tempfile::tempdir().expect("a folder");
    let rig = Emulated::start("identified", &["--perturb", "7"]);
    let found: Vec<_> = ["emulated", &rig.port]
        .iter()
        .enumerate()
        .map(|(i, port)| {
            let path = folder.path().join(format!("{i}.toml"));
            let done = docktwin(&[
                "rig",
                "identify",
                "--rig",
                port,
                "--yes",
                "--model",
                RIG,
                "--perturb",
                "7",
                "--dof",
                "x",
                "--out",
                path.to_str().expect("plain"),
            ]);
            assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
            let f = read::<IdentificationFile>(&path).expect("it was just written").content;
            (f.delay_s.to_bits(), f.leg, f.response)
        })
        .collect();
    assert_eq!(found[0], found[1]);
    let last = rig.end();
    assert!(last.starts_with("ended: ") && last.contains(" 0 refused"), "{last}");
}

/// A rig behind a port moves only when somebody said so; then a row of Table 4 runs on it as on one in
/// this process, bit by bit, and in real time too.
#[test]
fn invariant_table_4_runs_on_a_rig_in_another_process() {
    let folder = tempfile::tempdir().expect("a folder");
    let rig = Emulated::start("struck", &["--scenario", "scenarios/vibro_impact.toml"]);
    let row = |name: &str, port: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let out = out.to_str().expect("plain").to_owned();
        let mut args = vec!["validate", "vibro-impact", "--axis", "x", "--case", "3", "--json"];
        args.extend(["--rig", port, "--out", &out]);
        docktwin(&[&args, more].concat())
    };
    let told = |o: &Output| -> Value { serde_json::from_slice(&o.stdout).expect("JSON") };

    let refused = row("refused", &rig.port, &[]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(told(&refused)["error"][0].as_str().is_some_and(|e| e.contains("nobody is there")));

    let [here, there] = ["emulated", &rig.port].map(|port| {
        let done = told(&row(port.split(':').next().unwrap_or(port), port, &["--yes"]));
        assert_eq!(done["tests"][0]["loop"]["ticks_without_measurement"], 0, "{done}");
        done["tests"][0]["contacts"].clone()
    });
    assert!(here[0]["R_e"].is_f64(), "{here}");
    assert_eq!(here, there);

    // How well it keeps time is the machine's; that it is told is ours.
    let more = ["--yes", "--clock", "realtime", "--allow-best-effort"];
    let timed = told(&row("timed", &rig.port, &more));
    let kept = &timed["tests"][0]["loop"];
    assert!(kept["ticks"].as_u64().is_some_and(|n| n > 0), "{timed}");
    assert!(kept["missed_ticks"].is_u64() && kept["lateness_max_ms"].is_f64(), "{timed}");
    rig.end();
}

/// A run leaves the rig docked. The next is refused until the rig has been drawn back, and then it is
/// captured again.
#[test]
fn invariant_a_rig_is_drawn_back_between_two_dockings() {
    let folder = tempfile::tempdir().expect("a folder");
    let rig = Emulated::start("docked", &[]);
    let run = |name: &str| {
        let out = folder.path().join(name);
        let done = docktwin(&[
            "hil",
            "scenarios/apas_nominal.toml",
            "--rig",
            &rig.port,
            "--yes",
            "--set",
            "run.duration_s=3",
            "--out",
            out.to_str().expect("plain"),
        ]);
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    assert_eq!(run("first").0, Some(0));
    let (code, said) = run("second");
    assert_eq!(code, Some(2));
    assert!(said.contains("since the run before") && said.contains("rig retract"), "{said}");
    let asked = ["rig", "retract", "--rig", &rig.port, "--model", RIG];
    assert_eq!(docktwin(&asked).status.code(), Some(2), "moved without being allowed to");
    let done = docktwin(&[&asked[..], &["--yes", "--json"]].concat());
    let told: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    assert!((told["x_34_m"][0].as_f64().expect("a number") - 0.8).abs() < 1e-3, "{told}");
    assert_eq!(run("third").0, Some(0));
    rig.end();
}
