//! A run flown by hand through a pseudo-terminal, and what becomes of the terminal.

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
};

use docktwin_record::RunReader;
use serde_json::Value;

/// Starts `docktwin` on a terminal of its own, types what it is told when it sees what it waits for,
/// and says at last whether the terminal is as it was.
const TYPIST: &str = r#"
import os, pty, select, subprocess, sys, termios
script, command = sys.argv[1].split("|"), sys.argv[2:]
master, slave = pty.openpty()
before = termios.tcgetattr(slave)
child = subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, start_new_session=True)
seen, all = b"", b""
while child.poll() is None:
    if select.select([master], [], [], 0.05)[0]:
        new = os.read(master, 65536)
        seen, all = seen + new, all + new
    # Steps are "what to wait for>what to type".
    while script and script[0].split(">")[0].encode() in seen:
        os.write(master, script.pop(0).split(">")[1].encode().replace(b"^C", b"\x03"))
        seen = b""
while select.select([master], [], [], 0.05)[0]:
    all += os.read(master, 65536)
sys.stdout.write(all.decode(errors="replace"))
print("terminal", "restored" if termios.tcgetattr(slave) == before else "LEFT RAW")
print("steps left", script)
sys.exit(child.returncode)
"#;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn python(script: &[&str], rest: &[&str]) -> Output {
    Command::new("python3")
        .current_dir(root())
        .args(["-c", TYPIST])
        .args(script)
        .arg(env!("CARGO_BIN_EXE_docktwin"))
        .args(rest)
        .output()
        .expect("python3 starts")
}

/// The run can be repeated, all its ticks, to the last bit.
fn replays_identically(dir: &Path, ticks: u32) {
    let replay = Command::new(env!("CARGO_BIN_EXE_docktwin"))
        .current_dir(root())
        .args(["replay", "--json"])
        .arg(dir)
        .output()
        .expect("docktwin starts");
    let said: Value = serde_json::from_slice(&replay.stdout).expect("JSON");
    assert_eq!(said["identical"], Value::Bool(true), "{said}");
    assert_eq!(said["ticks"], ticks);
}

const FLIGHT: [&str; 10] = [
    "rehearse",
    "scenarios/free_flight.toml",
    "--twin",
    "reduced",
    "--no-rrd",
    "--set",
    "run.duration_s=12",
    "--pilot",
    // Until it is let go of, however slow the machine.
    "--pilot-hold=10",
    "--out",
];

#[test]
fn invariant_a_piloted_run_replays_bit_by_bit() {
    let at = tempfile::tempdir().expect("a folder");
    let dir = at.path().join("flown");
    let mut words = FLIGHT.to_vec();
    words.push(dir.to_str().expect("a path of text"));
    let done =
        python(&["t    0.10>w|F1 +160 +0 +0>o|F1 +160 +0 +0 N  M1 +> |F1 +0 +0 +0>q"], &words);
    let text = String::from_utf8_lossy(&done.stdout);
    assert!(text.contains("terminal restored"), "{text}");
    assert!(text.contains("steps left []"), "{text}");
    assert!(matches!(done.status.code(), Some(0 | 1)), "{:?}: {text}", done.status);

    // 0.02 m/s² of 8 t, pushed for a while and let go of, in the columns of every thrust.
    let mut reader = RunReader::open(&dir).expect("a recording");
    let x = reader.column_index("chaser_control_force_x_n").expect("its column");
    let roll = reader.column_index("chaser_control_moment_x_nm").expect("its column");
    let (mut pushed, mut turned, mut ticks) = (0, 0, 0);
    while let Some(t) = reader.next_tick().expect("a tick") {
        ticks += 1;
        let f = t.row[x].as_f64();
        assert!(f.abs() < 1e-9 || (f - 160.0).abs() < 1e-9, "{f} N");
        pushed += u32::from(f > 0.0);
        turned += u32::from(t.row[roll].as_f64() > 0.0);
    }
    assert!(pushed > 0 && turned > 0 && pushed < ticks, "{pushed} and {turned} of {ticks}");
    assert!(ticks < 12_000, "q did not end it");

    replays_identically(&dir, ticks);
}

const LOOP: [&str; 6] =
    ["hil", "scenarios/vibro_impact.toml", "--rig", "emulated", "--no-rrd", "--pilot-hold=60"];

/// The same against the emulated rig: pushed from the run-up on, ended by the pilot in the closed loop.
#[test]
fn invariant_a_piloted_run_against_a_rig_replays_bit_by_bit() {
    let at = tempfile::tempdir().expect("a folder");
    let dir = at.path().join("flown");
    let path = dir.to_str().expect("a path of text");
    let words = [&LOOP[..], &["--pilot", "--out", path]].concat();
    let done = python(&["settle>w|F1 +41>q"], &words);
    let text = String::from_utf8_lossy(&done.stdout);
    assert!(text.contains("terminal restored") && text.contains("steps left []"), "{text}");

    let mut reader = RunReader::open(&dir).expect("a recording");
    let x = reader.column_index("chaser_control_force_x_n").expect("its column");
    let (mut pushed, mut ticks) = (0, 0);
    while let Some(t) = reader.next_tick().expect("a tick") {
        ticks += 1;
        pushed += u32::from(t.row[x].as_f64() > 0.0);
    }
    assert!(pushed > 10 && ticks < 1500, "{pushed} of {ticks}");
    replays_identically(&dir, ticks);
}

/// In real time the lines come from beside the loop; and no line begins where the one before ended.
#[test]
fn invariant_a_pilot_in_real_time_sees_where_he_is() {
    let at = tempfile::tempdir().expect("a folder");
    let dir = at.path().join("flown");
    let path = dir.to_str().expect("a path of text");
    let timed = ["--clock", "realtime", "--allow-best-effort", "--pilot", "--out", path];
    let words = [&LOOP[..], &timed].concat();
    let done = python(&["settle>w|F1 +41>q"], &words);
    let text = String::from_utf8_lossy(&done.stdout);
    assert!(text.contains("terminal restored") && text.contains("steps left []"), "{text}");
    let (flight, _) = text.split_once("terminal restored").expect("just seen");
    assert!(flight.contains("ok   operator"), "{text}");
    assert_eq!(flight.matches('\n').count(), flight.matches("\r\n").count(), "{text}");
}

#[test]
fn invariant_control_c_gives_the_terminal_back() {
    let at = tempfile::tempdir().expect("a folder");
    let dir = at.path().join("flown");
    let mut words = FLIGHT.to_vec();
    words.push(dir.to_str().expect("a path of text"));
    let done = python(&["t    0.10>^C"], &words);
    let text = String::from_utf8_lossy(&done.stdout);
    assert!(text.contains("terminal restored") && text.contains("steps left []"), "{text}");
    // Its files are whole, as after any other end.
    assert!(text.contains("Replay it with"), "{text}");
}

#[test]
fn invariant_without_a_terminal_nobody_flies() {
    const ALONE: &str = "import subprocess, sys\n\
        sys.exit(subprocess.run(sys.argv[1:], stdin=subprocess.DEVNULL, start_new_session=True).returncode)";
    let at = tempfile::tempdir().expect("a folder");
    let done = Command::new("python3")
        .current_dir(root())
        .args(["-c", ALONE, env!("CARGO_BIN_EXE_docktwin")])
        .args(FLIGHT)
        .arg(at.path().join("flown"))
        .output()
        .expect("python3 starts");
    let text = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(2), "{text}");
    assert!(text.contains("needs a terminal"), "{text}");
    assert!(!at.path().join("flown").exists(), "nothing is written");
}

#[test]
fn invariant_without_a_viewer_a_live_run_is_refused_with_what_to_do() {
    let at = tempfile::tempdir().expect("a folder");
    let done = Command::new(env!("CARGO_BIN_EXE_docktwin"))
        .current_dir(root())
        .args(["rehearse", "scenarios/free_flight.toml", "--out"])
        .arg(at.path().join("shown"))
        // A port that no program of a user may open.
        .arg("--live=rerun+http://127.0.0.1:1/proxy")
        .output()
        .expect("docktwin starts");
    let text = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(2), "{text}");
    let parts = if cfg!(feature = "live") {
        ["no viewer answers at rerun+http://127.0.0.1:1/proxy", "rerun --bind 127.0.0.1"]
    } else {
        ["without the live view", "cargo build --release --features live"]
    };
    for part in parts {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
    assert!(!at.path().join("shown").exists(), "nothing is written");
}
