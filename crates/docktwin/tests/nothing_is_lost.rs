//! Killed processes and full disks, with the real binary: what was written stays readable, and what
//! went wrong is said once.
//!
//! `DOCKTWIN_KILLS=100` kills more often. How old the last tick of each killed run was is printed
//! (`--nocapture`): its wall clock stands in the log beside it.

#![cfg(unix)]

use std::{
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    time::Duration,
};

use docktwin_record::{RunReader, TickRecord, files, recover};
use serde_json::Value;

const BINARY: &str = env!("CARGO_BIN_EXE_docktwin");
const SCENARIO: &str = "scenarios/apas_fast.toml";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn docktwin(words: &[&str]) -> Output {
    Command::new(BINARY).current_dir(root()).args(words).output().expect("docktwin starts")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path of letters")
}

fn now_ns() -> i128 {
    jiff::Timestamp::now().as_nanosecond()
}

/// A number between 0 and 1 that looks random and is the same in every run of the test.
fn share(i: u64) -> f64 {
    let x = (i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (x >> 11) as f64 / (1u64 << 53) as f64
}

fn ticks(r: &mut RunReader) -> Vec<TickRecord> {
    r.ticks().map(|t| t.expect("readable")).collect()
}

#[test]
fn invariant_a_killed_run_is_readable_comparable_and_recoverable() {
    let kills = std::env::var("DOCKTWIN_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(20u64);
    let at = tempfile::tempdir().expect("a folder");
    // What the killed runs would have become, as far as they can have got.
    let whole = at.path().join("whole");
    let start = now_ns();
    let words = ["rehearse", SCENARIO, "--no-rrd", "--set", "run.duration_s=8", "--out"];
    let done = docktwin(&[&words[..], &[text(&whole)]].concat());
    assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
    let length_ns = now_ns() - start;
    let reference = ticks(&mut RunReader::open(&whole).expect("a recording"));

    let (mut cut, mut ages) = (0, Vec::new());
    for i in 0..kills {
        let dir = at.path().join(format!("killed-{i}"));
        // 40 s long: it never comes to its end.
        let mut words = vec!["rehearse", SCENARIO];
        // The viewer's file is written in every other run.
        if i % 2 == 0 {
            words.push("--no-rrd");
        }
        words.extend(["--out", text(&dir)]);
        let mut run = Command::new(BINARY)
            .current_dir(root())
            .args(words)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("docktwin starts");
        // From the first chunk on; a run that ended before is read as any other.
        while std::fs::metadata(dir.join(files::LOG)).map_or(0, |m| m.len()) < 20_000
            && run.try_wait().expect("a process").is_none()
        {
            std::thread::sleep(Duration::from_millis(1));
        }
        let wait = share(i) * 0.5 * length_ns as f64;
        std::thread::sleep(Duration::from_nanos(wait as u64));
        let killed_at = now_ns();
        run.kill().expect("SIGKILL");
        run.wait().expect("it is gone");

        let mut r = RunReader::open(&dir).expect("the head was written long ago");
        let got = ticks(&mut r);
        assert!(!got.is_empty(), "the first chunk was there");
        // What is there is right, to the last bit, as far as the reference goes.
        for (t, w) in got.iter().zip(&reference) {
            assert_eq!((t.tick, t.time, &t.row), (w.tick, w.time, &w.row), "kill {i}");
            assert!(t.contacts.iter().zip(&w.contacts).all(|(x, y)| x.same_bits(y)), "kill {i}");
        }
        let Some(found) = r.cut() else { continue };
        assert!(found.to_string().contains("recovered up to tick"), "{found}");
        cut += 1;
        let last = got.last().and_then(|t| t.recorded_unix_ns).expect("a wall clock");
        ages.push((killed_at - i128::from(last)) as f64 * 1e-6);

        // Replay and diff go as far as it goes and say so.
        if i % 5 == 0 {
            let done = docktwin(&["replay", text(&dir), "--json"]);
            let said: Value = serde_json::from_slice(&done.stdout).expect("JSON");
            assert_eq!((done.status.code(), &said["identical"]), (Some(0), &Value::Bool(true)));
            assert_eq!(said["ticks"], got.len());
            assert!(said["cut"].as_str().is_some_and(|c| c.contains("recovered up to")), "{said}");
            if got.len() < reference.len() {
                let done = docktwin(&["diff", text(&whole), text(&dir), "--json"]);
                let said: Value = serde_json::from_slice(&done.stdout).expect("JSON");
                assert_eq!(done.status.code(), Some(0), "{said}");
                assert!(said["cut"][0].as_str().is_some_and(|c| c.contains("is cut")), "{said}");
            }
        }
        let done = recover(&dir).expect("recoverable");
        assert_eq!(done.ticks, got.len() as u64);
        let mut r = RunReader::open(&dir).expect("recovered");
        assert!(ticks(&mut r) == got, "kill {i}: recovery changed a tick");
        assert!(r.cut().is_none());
        assert!(dir.join("run.mcap.cut").is_file());
    }
    assert!(cut > kills / 2, "only {cut} of {kills} runs were killed before their end");
    ages.sort_by(f64::total_cmp);
    println!(
        "{cut} of {kills} runs killed on their way; their last tick was {:.1} ms old in the median \
         and {:.1} ms at most",
        ages[ages.len() / 2],
        ages[ages.len() - 1]
    );
}

/// What a rehearsal on a full disk must do. `read` is where its directory can be read afterwards.
fn check_full(done: &Output, read: &Path, how: &str) {
    let (out, err) = (String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr));
    let said = format!("{how}: exit {:?}\n{out}\n{err}", done.status.code());
    // The rehearsal has its result, but not its recording: degraded.
    assert_eq!(done.status.code(), Some(1), "{said}");
    let complaints: Vec<&str> = err.lines().filter(|l| !l.starts_with("ignored ")).collect();
    assert_eq!(complaints.len(), 1, "one clear error, {said}");
    for word in ["could not write the ", "free some space", "run.mcap"] {
        assert!(complaints[0].contains(word), "`{word}` is missing, {said}");
    }
    assert!(out.contains("captured (degraded)"), "{said}");

    let mut r = RunReader::open(read).expect("what was written can be read");
    let got = ticks(&mut r);
    assert!(got.len() >= 100 && r.cut().is_some(), "{} ticks, {said}", got.len());
    let summary = r.summary().expect("readable").expect("room was kept for it");
    let recording = summary.recording.expect("told");
    // Safe is what was written without an error; of the chunk that failed all may still be there.
    let beyond = got.len() as u64 - recording.ticks;
    assert!(
        recording.ticks > 0 && beyond <= 50,
        "{} safe of {}, {said}",
        recording.ticks,
        got.len()
    );
    assert!(recording.error.is_some_and(|e| e.contains("run.mcap")), "{said}");
    assert_eq!(summary.verdict.to_string(), "degraded");
    assert!(summary.failure_reason.is_some_and(|w| w.contains("free some space")));
    r.events().expect("whole lines");
}

/// A real file system that is full, in a mount namespace of its own; `None` where this user may not
/// mount one.
fn on_a_small_disk(kib: u64, at: &Path) -> Option<Output> {
    let (disk, saved) = (at.join(format!("disk-{kib}")), at.join(format!("saved-{kib}")));
    std::fs::create_dir_all(&disk).expect("room");
    // What is on the disk goes with the namespace, so it is copied out first.
    let script = format!(
        "mount -t tmpfs -o size={kib}k tmpfs '{disk}' || exit 99\n\
         '{BINARY}' rehearse {SCENARIO} --set run.duration_s=4 --out '{disk}/run'\n\
         code=$?\ncp -r '{disk}/run' '{saved}'\nexit $code",
        disk = disk.display(),
        saved = saved.display()
    );
    for namespace in [&["-m"][..], &["-rm"][..]] {
        let done = Command::new("unshare")
            .args(namespace)
            .args(["sh", "-c", &script])
            .current_dir(root())
            .output();
        match done {
            Ok(done) if saved.join(files::LOG).is_file() => return Some(done),
            _ => {}
        }
    }
    None
}

/// The same with a limit on the size of files, which every user may set: writing beyond it fails.
fn with_limited_files(blocks: u64, run: &Path) -> Output {
    // `ulimit -f` counts in blocks of 512 bytes; without the trap a signal would end the process.
    let script = format!(
        "trap '' XFSZ; ulimit -f {blocks}; exec '{BINARY}' rehearse {SCENARIO} --no-rrd \
         --set run.duration_s=4 --out '{}'",
        run.display()
    );
    Command::new("sh").args(["-c", &script]).current_dir(root()).output().expect("a shell")
}

#[test]
fn invariant_a_full_disk_is_one_error_and_what_was_written_stays() {
    let at = tempfile::tempdir().expect("a folder");
    for (i, kib) in [900, 1200, 1500, 2400, 3300].into_iter().enumerate() {
        match on_a_small_disk(kib, at.path()) {
            Some(done) => {
                let saved = at.path().join(format!("saved-{kib}"));
                check_full(&done, &saved, &format!("a disk of {kib} KiB"));
                println!("a disk of {kib} KiB: full, as it should be");
            }
            None => {
                println!("no disk can be mounted here: files limited to {kib} KiB instead");
                let run = at.path().join(format!("limited-{i}"));
                // Half: the log is the larger one of two.
                check_full(&with_limited_files(kib, &run), &run, "limited files");
            }
        }
    }
    // And in any case once with a limit on files.
    let run = at.path().join("limited");
    check_full(&with_limited_files(1000, &run), &run, "limited files");
}

/// A directory that has no room from the start is bad input: nothing ran.
#[test]
fn invariant_a_run_that_cannot_begin_is_bad_input() {
    let at = tempfile::tempdir().expect("a folder");
    let run = at.path().join("run");
    let script = format!(
        "trap '' XFSZ; ulimit -f 1; exec '{BINARY}' rehearse {SCENARIO} --json --out '{}'",
        run.display()
    );
    let done = Command::new("sh").args(["-c", &script]).current_dir(root()).output().expect("sh");
    let said: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    assert_eq!((done.status.code(), &said["exit_code"]), (Some(2), &Value::from(2)), "{said}");
    let errors = said["error"].as_array().expect("errors");
    assert!(errors.len() == 1 && errors[0].as_str().is_some_and(|e| e.contains("free some space")));
}

/// Moved elsewhere, a run is replayed from its own copies of the models; an altered copy is told.
#[test]
fn invariant_a_run_directory_stands_alone() {
    let at = tempfile::tempdir().expect("a folder");
    let made = at.path().join("made");
    let words = ["rehearse", SCENARIO, "--no-rrd", "--set", "run.duration_s=0.3", "--out"];
    let done = docktwin(&[&words[..], &[text(&made)]].concat());
    assert_eq!(done.status.code(), Some(1), "0.3 s are too short for a capture");
    let moved = at.path().join("elsewhere");
    std::fs::rename(&made, &moved).expect("the same disk");
    let replay = || {
        let words = ["replay", text(&moved), "--json"];
        // Not from the repository, where the originals would be found too.
        let mut c = Command::new(BINARY);
        let done = c.args(words).current_dir(at.path()).output().expect("docktwin starts");
        (done.status.code(), String::from_utf8_lossy(&done.stdout).into_owned())
    };
    let (code, said) = replay();
    assert_eq!(code, Some(0), "{said}");
    let scenario = docktwin_scenario::load_scenario(&moved.join(files::SCENARIO), &[]);
    let scenario = scenario.expect("its models stand beside it");
    let home = std::path::absolute(&moved).expect("a path");
    for f in &scenario.files {
        let path = std::path::absolute(&f.path).expect("a path");
        assert!(path.starts_with(&home), "{} is not of the run", path.display());
    }
    let model = moved.join("models/models/urdf/apas_active.toml");
    let mut text = std::fs::read_to_string(&model).expect("a copy");
    text.push_str("\n# altered\n");
    std::fs::write(&model, text).expect("room");
    let (code, said) = replay();
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("apas_active.toml"), "{said}");
}

#[test]
fn invariant_an_output_that_is_full_or_closed_is_no_defect() {
    for (sink, words) in [("> /dev/full", Some("could not be written")), ("| head -c 10", None)] {
        let script = format!("'{BINARY}' scenario explain {sink}");
        let done = Command::new("sh").args(["-c", &script]).output().expect("a shell");
        let err = String::from_utf8_lossy(&done.stderr);
        assert!(!err.contains("defect") && !err.contains("panicked"), "{err}");
        assert_eq!(err.lines().count(), usize::from(words.is_some()), "{err}");
        assert!(words.is_none_or(|w| err.contains(w)) && done.status.code() != Some(70), "{err}");
    }
}
