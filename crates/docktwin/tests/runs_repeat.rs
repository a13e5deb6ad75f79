//! Two runs, and the replay of a recording, are the same bits; a changed bit is found.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use docktwin_core::Tick;
use docktwin_record::{RunReader, files, flip_bit};
use serde_json::Value;

const TWINS: [&str; 2] = ["full", "reduced"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Calls `docktwin … --json`; what it said, and its exit code.
fn docktwin(words: &[&str], dir: &Path) -> (Value, Option<i32>) {
    let mut c = Command::new(env!("CARGO_BIN_EXE_docktwin"));
    let done =
        c.current_dir(root()).args(words).arg(dir).arg("--json").output().expect("docktwin starts");
    let text = String::from_utf8_lossy(&done.stdout);
    let said = serde_json::from_str(&text).unwrap_or_else(|e| {
        panic!("{words:?}: {e}: {text}{}", String::from_utf8_lossy(&done.stderr))
    });
    (said, done.status.code())
}

fn rehearse(scenario: &str, twin: &str, extra: &[&str], dir: &Path) -> Value {
    let file = format!("scenarios/{scenario}.toml");
    let mut words = vec!["rehearse", &file, "--twin", twin, "--no-rrd"];
    words.extend_from_slice(extra);
    words.push("--out");
    let (summary, code) = docktwin(&words, dir);
    assert!(matches!(code, Some(0 | 1)), "exit {code:?}: {summary}");
    summary
}

#[test]
fn invariant_two_runs_and_a_replay_are_the_same_bits() {
    let at = tempfile::tempdir().expect("a folder");
    for twin in TWINS {
        let [one, two] = ["one", "two"].map(|n| at.path().join(format!("{n}-{twin}")));
        let (a, b) = (
            rehearse("basic_central_impact", twin, &[], &one),
            rehearse("basic_central_impact", twin, &[], &two),
        );
        assert_eq!(a["verdict"], "pass", "{a}");
        assert_eq!(a["state_digest"], b["state_digest"], "{twin}");
        assert!(a["state_digest"].as_str().is_some_and(|d| d.len() == 32), "{a}");

        let (said, code) = docktwin(&["replay"], &one);
        assert_eq!((code, &said["identical"]), (Some(0), &Value::Bool(true)), "{said}");
        assert_eq!(
            said["ticks"],
            a["ticks"].as_u64().expect("ticks") + 1,
            "every tick is compared"
        );

        // Another start is another story.
        let other = at.path().join(format!("other-{twin}"));
        let c = rehearse(
            "basic_central_impact",
            twin,
            &["--set", "initial.axial_speed_m_s=0.3500000000000001"],
            &other,
        );
        assert_ne!(a["state_digest"], c["state_digest"], "{twin}");
    }
    let digests = TWINS.map(|twin| {
        let text = std::fs::read(at.path().join(format!("one-{twin}")).join(files::SUMMARY));
        let s: Value = serde_json::from_slice(&text.expect("a summary")).expect("JSON");
        s["state_digest"].clone()
    });
    assert_ne!(digests[0], digests[1], "each twin has bits of its own");
}

/// The last bit of one recorded input, with and without a thrust that is on.
#[test]
fn invariant_a_flipped_last_bit_of_an_input_is_named_with_its_tick() {
    let at = tempfile::tempdir().expect("a folder");
    let cases: [(&str, &[&str], &str, u64); 2] = [
        ("basic_central_impact", &[], "chaser_control_force_x_n", 100),
        (
            "thrust_assist",
            &["--set", "run.duration_s=3.0"],
            "chaser_control_force_x_n",
            // A thrust is on in this tick, see below.
            0,
        ),
    ];
    for twin in TWINS {
        for (scenario, extra, column, tick) in cases {
            let run = at.path().join(format!("{scenario}-{twin}"));
            rehearse(scenario, twin, extra, &run);
            let tick = if tick > 0 { tick } else { first_thrust(&run, column) };
            flip_bit(&run, Tick(tick), column, 0).expect("the bit is there");
            let (said, code) = docktwin(&["replay"], &run);
            assert_eq!(code, Some(1), "{scenario}, {twin}: {said}");
            assert_eq!(said["identical"], false, "{scenario}, {twin}");
            let named = said["first_difference"]["tick"].as_u64().expect("a tick");
            assert!(
                (tick..=tick + 1).contains(&named),
                "{scenario}, {twin}: flipped in tick {tick}, named {named}"
            );
        }
    }
}

/// First tick but ten with a thrust, so that sums are no longer near zero.
fn first_thrust(run: &Path, column: &str) -> u64 {
    let mut reader = RunReader::open(run).expect("a recording");
    let index = reader.column_index(column).expect("a column");
    while let Some(t) = reader.next_tick().expect("a tick") {
        if f64::from_bits(t.row[index].bits()) != 0.0 {
            return t.tick.0 + 10;
        }
    }
    panic!("no thrust in {}", run.display());
}

/// Any one bit of the recorded digest, as a control that the comparison looks at every bit of it.
#[test]
fn invariant_a_flipped_digest_is_named_with_its_tick() {
    let at = tempfile::tempdir().expect("a folder");
    let run = at.path().join("run");
    rehearse("basic_central_impact", "reduced", &[], &run);
    for bit in [0, 31, 63] {
        flip_bit(&run, Tick(500), "state_digest", bit).expect("the bit is there");
        let (said, code) = docktwin(&["replay"], &run);
        assert_eq!(code, Some(1), "{said}");
        assert_eq!(said["first_difference"]["tick"], 500);
        flip_bit(&run, Tick(500), "state_digest", bit).expect("the bit is there");
    }
    let (said, code) = docktwin(&["replay"], &run);
    assert_eq!(code, Some(0), "all bits are back: {said}");
}

/// A summary of the first version beside one of today's: what its keys mean differs, and that is said.
#[test]
fn regress_summaries_of_two_versions_are_told_apart() {
    let at = tempfile::tempdir().expect("a folder");
    let new = at.path().join("new");
    rehearse("apas_fast", "reduced", &["--set", "run.duration_s=0.1"], &new);
    let old = "crates/record/tests/recordings/schema-1/docking";
    let (said, _) = docktwin(&["diff", old, "--tolerance", "1.0"], &new);
    let told = said["schemas"].as_str().unwrap_or_default();
    assert!(told.contains("schema versions 1 and 2") && told.contains("peak_moment_nm"), "{said}");
    let (same, _) = docktwin(&["diff", old, "--tolerance", "1.0"], &root().join(old));
    assert!(same["schemas"].is_null(), "{same}");
}
