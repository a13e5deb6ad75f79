//! Small inputs of the kinds on which the product was once wrong, and the right value of each: units, inertias,
//! limits by steps, logs, swapped files, edited numbers, odd paths, closed pipes and full devices, names, latch
//! zones against play, figures that are not known, directories that are there.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use docktwin_model::{Report, model_check};
use docktwin_record::{Outcome, Summary};
use docktwin_rigport::ipc::RigServer;
use docktwin_run::{Rehearsal, RehearsalOptions, SummaryOnly, TwinKind};
use docktwin_scenario::Loader;
use serde_json::Value;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn docktwin(words: &[impl AsRef<OsStr>], at: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_docktwin"))
        .args(words)
        .current_dir(at)
        .env("NO_COLOR", "1")
        .stdin(Stdio::null())
        .output()
        .expect("docktwin starts")
}

fn said(o: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&o.stdout), String::from_utf8_lossy(&o.stderr))
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("room");
    for entry in fs::read_dir(from).expect("a folder") {
        let path = entry.expect("an entry").path();
        let target = to.join(path.file_name().expect("a name"));
        if path.is_dir() { copy(&path, &target) } else { drop(fs::copy(&path, target)) }
    }
}

/// Fails with all that is wrong, not with the first.
fn settle(wrong: &[String]) {
    assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n"));
}

// Models ---------------------------------------------------------------------------------------

/// A shipped model with texts replaced, as `model check` sees it.
fn checked(stem: &str, edits: &[(&str, &str, &str)]) -> Report {
    let dir = tempfile::tempdir().expect("a folder");
    let urdf = dir.path().join("models/urdf");
    copy(&root().join("meshes"), &dir.path().join("meshes"));
    fs::create_dir_all(&urdf).expect("room");
    for entry in fs::read_dir(root().join("models/urdf")).expect("models") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        let mut text = fs::read_to_string(&path).expect("a text");
        for (file, from, to) in edits.iter().filter(|(f, _, _)| name == format!("{stem}.{f}")) {
            assert!(text.contains(from), "{file} has no {from:?}: mend the case");
            text = text.replacen(from, to, 1);
        }
        fs::write(urdf.join(name), text).expect("room");
    }
    model_check(&urdf.join(format!("{stem}.toml")))
}

/// A file by its ending, a text in it, and what stands there instead.
type Edit<'a> = (&'a str, &'a str, &'a str);

/// What a check must find.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Finds {
    Refused,
    Flagged,
    Nothing,
}
use Finds::{Flagged, Nothing, Refused};

const MASS: &str = "value=\"7960.9\"";
const INERTIA: &str =
    "ixx=\"7254.37\" ixy=\"0\" ixz=\"0\" iyy=\"36134.193\" iyz=\"0\" izz=\"36134.193\"";

#[test]
#[expect(clippy::too_many_lines, reason = "a table of inputs")]
fn oracle_units_and_inertias_are_refused_or_flagged() {
    let inertia = |axial: f64, across: f64| {
        format!(
            "ixx=\"{axial:e}\" ixy=\"0\" ixz=\"0\" iyy=\"{across:e}\" iyz=\"0\" izz=\"{across:e}\""
        )
    };
    let scaled = |by: f64| inertia(7254.37 * by, 36134.193 * by);
    // kg·cm², lb·ft², slug·ft² (a factor of 0.74: no body tells them apart), about the port instead of the
    // mass centre: 36134 + 7960.9 · 3.5².
    let [cm2, feet, slugs] = [1e4, 23.73, 0.7376].map(scaled);
    let about_port = inertia(7254.37, 36134.193 + 7960.9 * 3.5 * 3.5);
    let chaser: &[(&str, &[Edit<'_>], Finds, &str)] = &[
        ("inertia in kg·cm²", &[("urdf", INERTIA, &cm2)], Refused, "radius of gyration"),
        (
            "inertia in lb·ft²",
            &[("urdf", INERTIA, &feet)],
            Flagged,
            "look at the unit of the inertia",
        ),
        ("inertia in slug·ft²", &[("urdf", INERTIA, &slugs)], Nothing, ""),
        (
            "inertia about the port",
            &[("urdf", INERTIA, &about_port)],
            Flagged,
            "radius of gyration about Y",
        ),
        ("no inertia", &[("urdf", INERTIA, &scaled(0.0))], Refused, "not positive definite"),
        (
            "a rod without a radius",
            &[("urdf", "ixx=\"7254.37\"", "ixx=\"0.001\"")],
            Refused,
            "a rod of the densest",
        ),
        (
            "a rod of 4 cm",
            &[("urdf", "ixx=\"7254.37\"", "ixx=\"8\"")],
            Flagged,
            "radius of gyration about X",
        ),
        ("mass in lb", &[("urdf", MASS, "value=\"17550.8\"")], Nothing, ""),
        ("mass in mg", &[("urdf", MASS, "value=\"7.9609e9\"")], Refused, "is out of range"),
        ("hull in mm", &[("toml", "value = 1.35", "value = 1350.0")], Refused, "≤ 50 m"),
        (
            "hull in km",
            &[
                ("toml", "value = 1.35", "value = 0.00135"),
                ("toml", "value = 7.0", "value = 0.007"),
            ],
            Refused,
            "densest material",
        ),
        (
            "port in mm",
            &[("urdf", "xyz=\"3.5 0 0\"", "xyz=\"3500 0 0\"")],
            Flagged,
            "looks like millimetres",
        ),
        ("port in cm", &[("urdf", "xyz=\"3.5 0 0\"", "xyz=\"350 0 0\"")], Flagged, "port at"),
        (
            "port turned by 5 degrees as radians",
            &[("urdf", "xyz=\"3.5 0 0\" rpy=\"0 0 0\"", "xyz=\"3.5 0 0\" rpy=\"0 0 5\"")],
            Flagged,
            "rpy is in radians",
        ),
        (
            "port turned by 30 degrees as radians",
            &[("urdf", "xyz=\"3.5 0 0\" rpy=\"0 0 0\"", "xyz=\"3.5 0 0\" rpy=\"0 0 30\"")],
            Refused,
            "≤ 6.28",
        ),
        (
            "a port that looks aside by 20 degrees",
            &[("urdf", "xyz=\"3.5 0 0\" rpy=\"0 0 0\"", "xyz=\"3.5 0 0\" rpy=\"0 0 0.35\"")],
            Nothing,
            "",
        ),
    ];
    let mut wrong = Vec::new();
    for (what, edits, finds, says) in chaser {
        let report = checked("chaser_8t", edits);
        let found = match (report.refused.is_empty(), report.flagged.is_empty()) {
            (false, _) => Refused,
            (true, false) => Flagged,
            (true, true) => Nothing,
        };
        let lines = report.lines().join("\n");
        if found != *finds || !lines.contains(says) {
            wrong.push(format!("{what}: {found:?} instead of {finds:?} {says:?}\n{lines}"));
        }
    }
    // A mechanism in other units.
    for (what, from, to, says) in [
        (
            "travel in mm",
            "travel_negative_m = { value = 0.15",
            "travel_negative_m = { value = 150.0",
            "≤ 5",
        ),
        (
            "an angle in radians beyond 90",
            "tip_half_angle_deg = { value = 14.0",
            "tip_half_angle_deg = { value = 140.0",
            "≤ 90",
        ),
        ("ring in mm", "mean_radius_m = { value = 0.6", "mean_radius_m = { value = 600.0", "≤ 5 m"),
        (
            "one ring of 1.2 m diameter as radius",
            "mean_radius_m = { value = 0.6",
            "mean_radius_m = { value = 1.2",
            "float free",
        ),
    ] {
        let report = checked("apas_active", &[("toml", from, to)]);
        if !report.refused.iter().any(|r| r.contains(says)) {
            wrong.push(format!("{what}: {:?}", report.refused));
        }
    }
    settle(&wrong);
}

/// Case C20 and its kind: a zone of a latch below the mated play is flagged, with a width that mends it.
#[test]
fn oracle_latch_zones_are_held_against_the_play() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    for part in ["models/urdf", "meshes"] {
        copy(&root().join(part), &at.join(part));
    }
    let file = at.join("models/urdf/apas_active.toml");
    let good = fs::read_to_string(&file).expect("a text");
    // ±4.39° at 0.6 m are 0.046 m.
    let mut wrong = Vec::new();
    for (zone, flagged) in [(0.060, false), (0.0462, false), (0.0458, true), (0.010, true)] {
        let with = |zone: f64| {
            let from = "tangential_zone_m = { value = 0.06";
            assert!(good.contains(from), "mend the case");
            let text = good.replacen(from, &format!("tangential_zone_m = {{ value = {zone}"), 1);
            fs::write(&file, text).expect("room");
            said(&docktwin(&["model", "check", "models/urdf/apas_active.toml"], at))
        };
        let text = with(zone);
        let is = text.contains("less than the mated roll play");
        if is != flagged {
            wrong.push(format!("{zone}: {text}"));
        }
        if let Some((_, rest)) = text.split_once("; make it ") {
            let least: f64 =
                rest.split_once(" m or more").expect("a width").0.parse().expect("a number");
            let text = with(least);
            if text.contains("flagged") && text.contains("less than the mated roll play") {
                wrong.push(format!("{zone}, obeyed with {least}: {text}"));
            }
        }
    }
    settle(&wrong);
}

/// Case C22: which body turns, and whose axes a latch has, stands where the keys are explained.
#[test]
fn regress_what_decides_outcomes_is_stated() {
    let words = |words: &[&str]| {
        said(&docktwin(words, &root())).split_whitespace().collect::<Vec<_>>().join(" ")
    };
    for (key, says) in [("initial.roll_rate_deg_s", "target"), ("initial.roll_deg", "about")] {
        let text = words(&["scenario", "explain", key]);
        assert!(text.contains(says), "{key}: {text}");
    }
    for (key, says) in
        [("latches.axes", "those of the active ring"), ("petals.base_half_angle_deg", "straight")]
    {
        let text = words(&["model", "explain", key]);
        assert!(text.contains(says), "{key}: {text}");
    }
}

// Limits ---------------------------------------------------------------------------------------

/// Case C2 and its kind: how a run is divided into ticks changes neither verdict nor figures.
#[test]
fn oracle_ticks_of_any_length_give_one_verdict() {
    let run = |tick_s: f64, steps: i64| -> Summary {
        let loader = Loader::new()
            .set("run.tick_s", tick_s)
            .set("run.steps_per_tick", steps)
            .set("run.duration_s", 0.6)
            .set("initial.gap_m", 0.01)
            .set("initial.axial_speed_m_s", 0.3)
            .set("mechanism.contact.stiffness_n_m", 3e7);
        let scenario =
            loader.load(&root().join("scenarios/apas_nominal.toml")).expect("a scenario");
        let options = RehearsalOptions { twin: TwinKind::Reduced, seed: 0 };
        let run = Rehearsal::with(&scenario, options).expect("the sides are apart");
        run.run(&mut SummaryOnly).expect("a summary")
    };
    let of =
        |s: &Summary| (s.outcome, s.peak_force_n, s.peak_penetration_m, s.failure_reason.clone());
    let one = run(0.001, 10);
    for (tick_s, steps) in [(0.0001, 1), (0.0005, 5), (0.002, 20)] {
        let other = run(tick_s, steps);
        // Peaks are those up to the tick in which the limit was passed.
        assert_eq!(of(&other).0, of(&one).0, "{tick_s} s: {other:?}");
        let near = (other.peak_force_n / one.peak_force_n - 1.0).abs() < 0.02;
        assert!(
            near || one.outcome == Outcome::LimitExceeded,
            "{tick_s} s: {:?} {:?}",
            of(&other),
            of(&one)
        );
        let passed = |s: &Summary| s.outcome == Outcome::Captured && s.failure_reason.is_some();
        assert!(!passed(&other) && !passed(&one));
    }
}

// Runs -----------------------------------------------------------------------------------------

/// Two runs of 0.25 s, made once.
fn runs() -> &'static Path {
    static RUNS: OnceLock<tempfile::TempDir> = OnceLock::new();
    RUNS.get_or_init(|| {
        let dir = tempfile::tempdir().expect("a folder");
        for (name, speed) in [("one", "0.35"), ("two", "0.36")] {
            let speed = format!("initial.axial_speed_m_s={speed}");
            let out = dir.path().join(name);
            let words = [
                "rehearse",
                "scenarios/basic_central_impact.toml",
                "--twin",
                "reduced",
                "--no-rrd",
                "--set",
                "run.duration_s=0.25",
                "--set",
                &speed,
                "--out",
            ];
            let words: Vec<&OsStr> =
                words.iter().map(OsStr::new).chain([out.as_os_str()]).collect();
            let done = docktwin(&words, &root());
            assert!(matches!(done.status.code(), Some(0 | 1)), "{}", said(&done));
        }
        dir
    })
    .path()
}

/// A copy of the first run, changed.
fn changed(change: impl FnOnce(&Path)) -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("a folder");
    copy(&runs().join("one"), &dir.path().join("one"));
    copy(&runs().join("two"), &dir.path().join("two"));
    change(&dir.path().join("one"));
    dir
}

/// Bytes of a file of a run, changed.
fn edit(run: &Path, file: &str, change: impl FnOnce(&mut Vec<u8>)) {
    let mut bytes = fs::read(run.join(file)).expect("a file");
    change(&mut bytes);
    fs::write(run.join(file), bytes).expect("room");
}

fn swap(run: &Path, file: &str) {
    fs::copy(run.with_file_name("two").join(file), run.join(file)).expect("room");
}

/// Logs that are broken, files of another run, numbers that were edited: no reader says that all is well.
#[test]
fn oracle_what_is_not_the_run_is_told_by_every_reader() {
    type Change = fn(&Path);
    let cases: &[(&str, Change)] = &[
        ("a log cut by a third", |r| edit(r, "run.mcap", |b| b.truncate(b.len() * 2 / 3))),
        ("a log without its last byte", |r| edit(r, "run.mcap", |b| b.truncate(b.len() - 1))),
        ("a log with one byte flipped", |r| {
            edit(r, "run.mcap", |b| {
                let n = b.len() / 2;
                b[n] ^= 1;
            })
        }),
        ("a log with its middle gone", |r| {
            edit(r, "run.mcap", |b| {
                let n = b.len();
                b.drain(n / 3..n / 2);
            })
        }),
        ("an empty log", |r| edit(r, "run.mcap", Vec::clear)),
        ("the log of another run", |r| swap(r, "run.mcap")),
        ("the summary of another run", |r| swap(r, "summary.json")),
        ("the scenario of another run", |r| swap(r, "scenario.toml")),
        ("an edited figure", |r| {
            edit(r, "summary.json", |b| {
                let text = String::from_utf8(b.clone()).expect("text");
                let (head, rest) = text.split_once("\"peak_force_n\": ").expect("a peak");
                *b = format!("{head}\"peak_force_n\": 1{rest}").into_bytes();
            })
        }),
        ("an edited model", |r| {
            edit(r, "models/models/urdf/test_8t.urdf", |b| b.extend(b"<!-- -->"))
        }),
    ];
    let mut wrong = Vec::new();
    for (what, change) in cases {
        let dir = changed(*change);
        // What is not whole is no success of a reader that vouches for it.
        for words in [&["replay", "one"][..], &["report", "one"], &["diff", "one", "one"]] {
            let done = docktwin(words, dir.path());
            // A log that merely ends, as of a run that was killed, is told of, and right as far as it goes. A run
            // is the same as itself, whatever its models and its scenario are.
            let text = said(&done);
            let told = text.contains("cut") || text.contains("incomplete");
            let same = words[0] == "diff" && (what.contains("scenario") || what.contains("model"));
            if done.status.code() == Some(0) && !told && !same {
                wrong.push(format!("{what}: {words:?} is content: {}", said(&done)));
            }
        }
    }
    // Of this test: the run as it is contents all.
    let dir = changed(|_| {});
    for words in [&["replay", "one"][..], &["report", "one"], &["diff", "one", "one"]] {
        let done = docktwin(words, dir.path());
        if done.status.code() != Some(0) {
            wrong.push(format!("the run itself: {words:?}: {}", said(&done)));
        }
    }
    settle(&wrong);
}

// The system -----------------------------------------------------------------------------------

/// Odd names of directories: a run goes there, and can be replayed from there.
#[test]
#[cfg(unix)]
fn oracle_paths_of_any_bytes_hold_a_run() {
    use std::os::unix::ffi::OsStringExt as _;
    let dir = tempfile::tempdir().expect("a folder");
    let mut wrong = Vec::new();
    for name in [
        &b"with blanks and 'quotes'"[..],
        b"two\nlines",
        b"100%\\n",
        b"#hash",
        b"\xff\xfe not UTF-8",
        b"-dash",
        "ünïcode ✓".as_bytes(),
        b"a=b",
        b"[x].toml",
    ] {
        let out = dir.path().join(OsString::from_vec(name.to_vec()));
        let shown = String::from_utf8_lossy(name);
        let words: Vec<OsString> = [
            "rehearse",
            "scenarios/free_flight.toml",
            "--twin",
            "reduced",
            "--no-rrd",
            "--set",
            "run.duration_s=0.05",
            "--out",
        ]
        .iter()
        .map(OsString::from)
        .chain([out.clone().into()])
        .collect();
        let done = docktwin(&words, &root());
        if !matches!(done.status.code(), Some(0 | 1)) {
            wrong.push(format!("{shown:?}: {}", said(&done)));
            continue;
        }
        let again = docktwin(&[OsStr::new("replay"), out.as_os_str()], &root());
        if again.status.code() != Some(0) {
            wrong.push(format!("{shown:?}, replayed: {}", said(&again)));
        }
    }
    settle(&wrong);
}

/// Output that is lost is no success; a reader that has enough is no error.
#[test]
#[cfg(target_os = "linux")]
fn oracle_full_devices_and_closed_pipes() {
    let binary = env!("CARGO_BIN_EXE_docktwin");
    let run = runs().join("one");
    let run = run.display();
    let mut wrong = Vec::new();
    let mut shell = |line: String, code: i32| {
        let line = format!("set -o pipefail; {line}");
        let done =
            Command::new("bash").args(["-c", &line]).current_dir(root()).output().expect("bash");
        if done.status.code() != Some(code) || said(&done).contains("panicked") {
            wrong.push(format!("`{line}` ends with {:?}: {}", done.status.code(), said(&done)));
        }
    };
    for words in [
        "scenario explain".to_owned(),
        "model explain".to_owned(),
        "model check models/urdf/apas_active.toml".to_owned(),
        format!("replay {run}"),
        format!("diff {run} {run} --json"),
        format!("export {run} --format csv --out -"),
    ] {
        shell(format!("{binary} {words} > /dev/full"), 1);
    }
    for words in [
        "scenario explain".to_owned(),
        "model explain --json".to_owned(),
        format!("export {run} --format csv --out -"),
    ] {
        shell(format!("{binary} {words} | head -c 10 > /dev/null"), 0);
    }
    settle(&wrong);
}

/// Names of scenarios become directories, names of rigs become files of shared memory.
#[test]
fn oracle_names_that_are_none_are_refused() {
    let long = "x".repeat(101);
    for (name, good) in [
        (".hidden", false),
        ("a/b", false),
        ("a b", false),
        ("con:", false),
        ("..", false),
        (long.as_str(), false),
        (&long[1..], true),
        ("Ünï_9", true),
        ("2026-11-28.a", true),
    ] {
        let loaded =
            Loader::new().set("name", name).load(&root().join("scenarios/free_flight.toml"));
        assert_eq!(loaded.is_ok(), good, "{name}");
    }
    let long = "x".repeat(65);
    for name in ["", "a/b", "..", "rig one", "räg", "a\0b", &long] {
        let text = RigServer::open(name).err().map(|e| e.to_string()).unwrap_or_default();
        let refused = text.contains("is no name for a rig") || name == "..";
        assert!(refused, "{name:?}: {text}");
    }
}

/// Case C18 and its kind: what was not computed is null, and never a number.
#[test]
fn oracle_figures_that_are_not_known_are_null() {
    let dir = tempfile::tempdir().expect("a folder");
    let run = |command: &str, scenario: &str, seconds: &str, out: &str| -> Value {
        let scenario = format!("scenarios/{scenario}.toml");
        let seconds = format!("run.duration_s={seconds}");
        let out = dir.path().join(out);
        let rig = if command == "hil" { &["--rig", "emulated"][..] } else { &[] };
        let words =
            [&[command, &scenario], rig, &["--no-rrd", "--json", "--set", &seconds, "--out"]]
                .concat();
        let words: Vec<&OsStr> = words.iter().map(OsStr::new).chain([out.as_os_str()]).collect();
        let done = docktwin(&words, &root());
        let text = fs::read_to_string(out.join("summary.json")).unwrap_or_else(|_| said(&done));
        serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"))
    };
    let free = run("rehearse", "free_flight", "0.1", "free");
    for key in ["first_contact_s", "capture_s"] {
        assert!(free[key].is_null(), "{key}: {}", free[key]);
    }
    assert!(free["energy_balance_error"].is_number() && free["loop"].is_null(), "{free}");
    let hil = run("hil", "free_flight", "0.1", "hil");
    assert!(hil["energy_balance_error"].is_null(), "{}", hil["energy_balance_error"]);
    assert!(hil["first_contact_s"].is_null() && hil["capture_s"].is_null(), "{hil}");
    let text = hil["fidelity"].to_string();
    assert!(hil["fidelity"].is_null() || text.contains("null"), "no contact has no ratio: {text}");
    assert!(!text.contains("0.0e0") && !hil.to_string().contains("NaN"), "{text}");
}

/// Nothing that is there is written over.
#[test]
fn oracle_directories_and_files_that_are_there_stay() {
    let dir = changed(|_| {});
    let at = dir.path();
    fs::write(at.join("kept.csv"), "kept").expect("room");
    let scenario = root().join("scenarios/free_flight.toml");
    let scenario = scenario.to_str().expect("text");
    let rig = root().join("models/urdf/stewart.toml");
    let rig = rig.to_str().expect("text");
    let before = fs::read(at.join("one/run.mcap")).expect("a log");
    for words in [
        &["rehearse", scenario, "--no-rrd", "--set", "run.duration_s=0.05", "--out", "one"][..],
        &["hil", scenario, "--no-rrd", "--set", "run.duration_s=0.05", "--out", "one"],
        &["export", "one", "--format", "csv", "--out", "kept.csv"],
        &["analyze", "stiffness", rig, "--out", "one"],
        &["rig", "identify", "--rig", "emulated", "--model", rig, "--drive", "kept.csv"],
        &["rig", "identify", "--rig", "emulated", "--model", rig, "--out", "kept.csv"],
        &["rig", "calibrate", "--rig", "emulated", "--model", rig, "--out", "kept.csv"],
        &["rig", "identify", "--rig", "emulated", "--model", rig, "--out", "a", "--drive", "a"],
        // A file is no folder.
        &["rig", "calibrate", "--rig", "emulated", "--model", rig, "--out", "kept.csv/a.toml"],
    ] {
        let done = docktwin(words, at);
        assert_eq!(done.status.code(), Some(2), "{words:?}: {}", said(&done));
    }
    assert_eq!(fs::read(at.join("one/run.mcap")).expect("a log"), before);
    assert_eq!(fs::read(at.join("kept.csv")).expect("a file"), b"kept");
}
