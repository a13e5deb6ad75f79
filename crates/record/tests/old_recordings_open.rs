//! Recordings of every released schema can be opened, bit for bit.
//!
//! `recordings/schema-N/` holds runs made by the release that had schema N, each with an
//! `expected.json` that `recordings/expected.py` made with public packages alone. When
//! `RECORD_SCHEMA` is raised, make new runs with the code *before* the change, small ones (below
//! 300 kB together), put them beside the old ones, and run the script on each. Never renew an old
//! one.

use std::path::{Path, PathBuf};

use docktwin_record::{Cell, RECORD_SCHEMA, RunReader, files};
use serde_json::Value;

fn folder(schema: u32) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/recordings/schema-{schema}"))
}

fn runs(schema: u32) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder(schema)) else { return Vec::new() };
    let mut out: Vec<PathBuf> = entries.map(|e| e.expect("an entry").path()).collect();
    out.retain(|p| p.join(files::LOG).is_file());
    out.sort();
    out
}

/// What a run holds, in the words of its `expected.json`.
fn found(run: &Path) -> Value {
    let mut r = RunReader::open(run).expect("an old recording");
    let mut crc = [(); 4].map(|()| crc32fast::Hasher::new());
    let inputs: Vec<usize> =
        (0..r.columns().len()).filter(|i| r.columns()[*i].topic == "/inputs").collect();
    let digest = r.column_index("state_digest").expect("the digest of the state");
    let (mut ticks, mut contacts) = (0u64, 0u64);
    while let Some(t) = r.next_tick().expect("a whole file") {
        ticks += 1;
        crc[0].update(&t.tick.0.to_le_bytes());
        crc[0].update(&t.time.nanos().to_le_bytes());
        let mut add = |i: usize, cell: &Cell| crc[i].update(&cell.bits().to_le_bytes());
        t.row.iter().for_each(|c| add(0, c));
        inputs.iter().for_each(|i| add(2, &t.row[*i]));
        add(3, &t.row[digest]);
        for c in &t.contacts {
            contacts += 1;
            crc[1].update(&t.tick.0.to_le_bytes());
            crc[1].update(&c.pair.to_le_bytes());
            for v in [c.point_w_m, c.normal_w] {
                v.to_array().iter().for_each(|x| crc[1].update(&x.to_le_bytes()));
            }
            crc[1].update(&c.depth_m.to_le_bytes());
            crc[1].update(&c.normal_force_n.to_le_bytes());
            c.friction_w_n.to_array().iter().for_each(|x| crc[1].update(&x.to_le_bytes()));
        }
    }
    assert_eq!(r.cut(), None, "{}", run.display());
    let crc = crc.map(|h| format!("{:08x}", h.finalize()));
    serde_json::json!({
        "ticks": ticks,
        "columns": r.columns().len(),
        "pairs": r.pair_names().len(),
        "contacts": contacts,
        "events": r.events().expect("events").len(),
        "crc32": { "rows": crc[0], "contacts": crc[1], "inputs": crc[2], "digests": crc[3] },
    })
}

#[test]
fn oracle_old_recordings_hold_what_public_packages_read_from_them() {
    for schema in 1..=RECORD_SCHEMA {
        for run in runs(schema) {
            let text = std::fs::read_to_string(run.join("expected.json")).expect("expected.json");
            let expected: Value = serde_json::from_str(&text).expect("JSON");
            assert_eq!(found(&run), expected, "{}", run.display());
            assert!(expected["ticks"].as_u64() > Some(0));
        }
    }
}

#[test]
fn regress_old_recordings_open_with_everything_else() {
    for schema in 1..=RECORD_SCHEMA {
        for run in runs(schema) {
            let at = run.display();
            let r = RunReader::open(&run).expect("an old recording");
            assert_eq!(r.metadata()["docktwin_record_schema"], schema.to_string(), "{at}");
            assert_eq!(r.metadata()["tool"], "docktwin", "{at}");
            assert!(r.metadata().keys().any(|k| k.starts_with("digest:")), "{at}");
            let summary = r.summary().expect("a summary").expect("the run ended");
            assert_eq!(Some(&summary.scenario), r.metadata().get("scenario"), "{at}");
            assert_eq!(summary.state_digest.len(), 32, "{at}");
            assert_eq!(summary.ticks + 1, found(&run)["ticks"].as_u64().expect("ticks"), "{at}");
            assert!(r.scenario_toml().expect("a scenario").contains("schema = 1"), "{at}");
            assert_eq!(r.events().expect("events").last().expect("one").kind, "outcome", "{at}");

            // A copy without its end mark is read up to there.
            let dir = tempfile::tempdir().expect("a temporary directory");
            let log = std::fs::read(run.join(files::LOG)).expect("a log");
            std::fs::write(dir.path().join(files::LOG), &log[..log.len() - 9]).expect("room");
            let mut cut = RunReader::open(dir.path()).expect("a cut recording");
            let got: Vec<_> = cut.ticks().map(|t| t.expect("readable")).collect();
            assert_eq!(got.len() as u64, summary.ticks + 1, "{at}");
            assert!(cut.cut().is_some(), "{at}");
        }
    }
}

#[test]
fn invariant_every_schema_has_recordings_of_its_release() {
    for schema in 1..=RECORD_SCHEMA {
        assert!(
            !runs(schema).is_empty(),
            "RECORD_SCHEMA is {RECORD_SCHEMA}, but tests/recordings/schema-{schema} holds no run; \
             the head of this file tells how to make one"
        );
    }
    // A schema without a number of its own would hide here.
    assert!(runs(RECORD_SCHEMA + 1).is_empty(), "recordings of a schema that does not exist");
}
