//! However a run is ended, and wherever its words go: it is closed, it says why, and its exit code is
//! true. With the real binary.

#![cfg(unix)]

use std::{
    fs,
    io::Read as _,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};

use docktwin_record::RunReader;
use serde_json::Value;

const BINARY: &str = env!("CARGO_BIN_EXE_docktwin");

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn docktwin(words: &[&str]) -> Command {
    let mut c = Command::new(BINARY);
    c.current_dir(root()).args(words);
    c
}

fn summary(run: &Path) -> Value {
    let text = fs::read_to_string(run.join("summary.json")).expect("a summary");
    serde_json::from_str(&text).expect("JSON")
}

fn signal(child: &Child, name: &str) {
    let id = child.id().to_string();
    let sent = Command::new("kill").args([name, &id]).status().expect("kill can be called");
    assert!(sent.success());
}

/// Waits until the log has grown: the run is under way.
fn under_way(run: &Path) {
    let begin = Instant::now();
    let log = run.join("run.mcap");
    while fs::metadata(&log).map_or(0, |m| m.len()) < 200_000 {
        assert!(begin.elapsed() < Duration::from_secs(60), "the run does not begin");
        sleep(Duration::from_millis(20));
    }
}

fn stopped_by(words: &[&str], name: &str, at: &Path) {
    let run = at.join(name);
    let out = run.to_str().expect("a path of letters");
    // A shell without job control starts what runs in the background deaf to interrupts, as `nohup` does to
    // hangups, and docktwin keeps to that: here it must hear.
    let child = Command::new("env")
        .args(["--default-signal=INT,TERM,HUP", BINARY])
        .args([words, &["--no-rrd", "--json", "--out", out]].concat())
        .current_dir(root())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("docktwin starts");
    under_way(&run);
    signal(&child, &format!("-{name}"));
    let done: Output = child.wait_with_output().expect("it ends");
    assert_eq!(done.status.code(), Some(1), "{words:?} {name}");
    let s = summary(&run);
    assert_eq!(s["outcome"], "stopped", "{words:?} {name}");
    assert_eq!(s["verdict"], "fail");
    assert_eq!(s["failure_reason"], format!("stopped by SIG{name}"));
    let printed: Value = serde_json::from_slice(&done.stdout).expect("the summary");
    assert_eq!(printed["state_digest"], s["state_digest"]);
    let mut log = RunReader::open(&run).expect("a log");
    let ticks = log.ticks().count();
    assert!(log.cut().is_none() && ticks > 100, "{ticks} ticks, {:?}", log.cut());
    let events = log.events().expect("events");
    let last = events.last().expect("an event");
    assert!(last.text.contains("stopped"), "{}", last.text);
}

/// Case C13: an interrupt, a request to end, a terminal that is closed.
#[test]
fn regress_a_signal_closes_a_run() {
    let at = tempfile::tempdir().expect("a folder");
    // Docked, it goes on for longer than the test waits.
    let long = ["--set", "run.stop_when_decided=false", "--set", "run.duration_s=2000"];
    let rehearse = [&["rehearse", "scenarios/apas_nominal.toml"][..], &long].concat();
    for name in ["INT", "TERM", "HUP"] {
        stopped_by(&rehearse, name, at.path());
    }
    let dir = at.path().join("hil");
    fs::create_dir(&dir).expect("a folder");
    let hil = ["hil", "scenarios/apas_nominal.toml", "--rig", "emulated"];
    stopped_by(&[&hil[..], &long].concat(), "INT", &dir);
}

/// Case C14: several processes in one second.
#[test]
fn regress_runs_begun_in_one_second_have_directories_of_their_own() {
    let at = tempfile::tempdir().expect("a folder");
    let scenario = root().join("scenarios/basic_ring_ring.toml");
    let words = ["rehearse", scenario.to_str().expect("letters"), "--no-rrd", "--json"];
    let set = ["--set", "run.duration_s=0.05", "--twin", "reduced"];
    let children: Vec<Child> = (0..6)
        .map(|_| {
            Command::new(BINARY)
                .current_dir(at.path())
                .args(words.iter().chain(&set))
                .stdout(Stdio::null())
                .stderr(Stdio::piped())
                .spawn()
                .expect("docktwin starts")
        })
        .collect();
    for mut child in children {
        let mut said = String::new();
        child.stderr.take().expect("a pipe").read_to_string(&mut said).expect("words");
        // Too short to be decided: ended otherwise than expected, but run.
        assert_ne!(child.wait().expect("it ends").code(), Some(2), "{said}");
    }
    let runs: Vec<PathBuf> = fs::read_dir(at.path().join("runs"))
        .expect("runs")
        .map(|e| e.expect("an entry").path())
        .collect();
    assert_eq!(runs.len(), 6, "{runs:?}");
    assert!(runs.iter().all(|r| r.join("summary.json").is_file()), "{runs:?}");
}

/// Case C16: a full device is no success; a reader that leaves is none of our errors.
#[test]
fn regress_output_that_is_lost_is_no_success_and_a_closed_pipe_is_no_error() {
    let at = tempfile::tempdir().expect("a folder");
    let run = at.path().join("run");
    let out = run.to_str().expect("letters");
    if Path::new("/dev/full").exists() {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").expect("a device");
        let done = docktwin(&[
            "rehearse",
            "scenarios/basic_ring_ring.toml",
            "--no-rrd",
            "--json",
            "--out",
            out,
        ])
        .stdout(full)
        .output()
        .expect("docktwin starts");
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(1), "{said}");
        assert!(said.contains("could not be written"), "{said}");
    }
    let mut export = docktwin(&["export", out, "--format", "csv", "--out", "-"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("docktwin starts");
    let mut line = [0; 100];
    export.stdout.take().expect("a pipe").read_exact(&mut line).expect("a beginning");
    let done = export.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(0), "{said}");
    assert!(!said.contains("disk"), "{said}");
}
