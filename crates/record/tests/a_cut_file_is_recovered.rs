//! A process that dies leaves a log that can be read up to at most 100 ticks, or 100 ms, before.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::Duration;

use docktwin_core::{SimTime, Tick};
use docktwin_record::{
    Cell, Column, ContactRow, Event, Policy, RECORD_SCHEMA, RecordError, RunReader, RunWriter,
    TickRecord, files,
};

const MS: u64 = 1_000_000;
const COLUMNS: u64 = 12;

fn columns() -> Vec<Column> {
    (0..COLUMNS).map(|i| Column::f64(format!("/t{}", i % 3), format!("c{i}_m"))).collect()
}

fn row(tick: u64) -> Vec<Cell> {
    let bits = |i: u64| (tick * COLUMNS + i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (0..COLUMNS).map(|i| Cell::from_bits(bits(i))).collect()
}

fn writer(dir: &Path, policy: Policy) -> RunWriter {
    RunWriter::create(dir, columns(), vec![], &BTreeMap::new(), policy).expect("a fresh directory")
}

fn tick(w: &mut RunWriter, i: u64) {
    let contacts = [ContactRow::default(); 3];
    let n = (i % 4) as usize;
    w.tick(Tick(i), SimTime::of_tick(Tick(i), MS), &row(i), &contacts[..n.min(3)])
        .expect("the disk has room");
}

/// What another process finds in the file now: what stays when this one is killed.
fn snapshot(from: &Path, to: &Path) {
    fs::copy(from.join(files::LOG), to.join(files::LOG)).expect("the log is there");
}

fn read(dir: &Path) -> (Vec<TickRecord>, Option<String>) {
    let mut r = RunReader::open(dir).expect("the head is there");
    let ticks: Vec<_> = r.ticks().map(|t| t.expect("readable")).collect();
    for (i, t) in ticks.iter().enumerate() {
        let i = i as u64;
        assert_eq!((t.tick, &t.row), (Tick(i), &row(i)), "a recovered tick is another");
        assert_eq!(t.contacts.len() as u64, i % 4);
    }
    (ticks, r.cut().map(ToString::to_string))
}

#[test]
fn invariant_at_most_100_ticks_are_lost_at_full_speed() {
    let (dir, copy) = (
        tempfile::tempdir().expect("a temporary directory"),
        tempfile::tempdir().expect("a temporary directory"),
    );
    let mut w = writer(dir.path(), Policy::Wait);
    for i in 0..5_000 {
        tick(&mut w, i);
        if i % 701 == 700 {
            snapshot(dir.path(), copy.path());
            let (ticks, cut) = read(copy.path());
            let lost = i + 1 - ticks.len() as u64;
            assert!(lost <= 100, "{lost} ticks lost after tick {i}");
            assert!(cut.is_some(), "a log without an end was not called cut");
        }
    }
}

#[test]
fn invariant_a_run_that_hangs_has_all_its_ticks_in_the_file() {
    let (dir, copy) = (
        tempfile::tempdir().expect("a temporary directory"),
        tempfile::tempdir().expect("a temporary directory"),
    );
    for policy in [Policy::Wait, Policy::DropNewest] {
        let dir = dir.path().join(policy.to_string());
        let mut w = writer(&dir, policy);
        (0..7).for_each(|i| tick(&mut w, i));
        let event = Event::new(Tick(6), SimTime::from_nanos(6 * MS), "limit", "", 1.into());
        w.event(&event).expect("the disk has room");
        // Far longer than the 100 ms, as a busy machine may be slow; the writer is not touched.
        let found = (0..500).any(|_| {
            std::thread::sleep(Duration::from_millis(20));
            snapshot(&dir, copy.path());
            read(copy.path()).0.len() == 7
        });
        assert!(found, "ticks never reached the file by themselves");
        let live = RunReader::open(&dir).expect("a recording");
        assert_eq!(live.events().expect("events"), [event]);
        assert_eq!(live.summary().expect("no summary is no error"), None);
    }
}

#[test]
fn invariant_a_file_cut_anywhere_is_recovered() {
    let (dir, copy) = (
        tempfile::tempdir().expect("a temporary directory"),
        tempfile::tempdir().expect("a temporary directory"),
    );
    let n = 1_000;
    let mut w = writer(dir.path(), Policy::Wait);
    (0..n).for_each(|i| tick(&mut w, i));
    drop(w);
    let whole = fs::read(dir.path().join(files::LOG)).expect("a log");
    let (ticks, cut) = read(dir.path());
    assert_eq!((ticks.len() as u64, cut), (n, None));

    // Where each tick is safe: the file's length when its chunk was complete.
    let bytes_per_tick = whole.len() as u64 / n;
    let mut last = 0;
    let mut lengths: Vec<usize> =
        (0..400usize).map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15) % whole.len()).collect();
    lengths.extend(whole.len() - 40..whole.len());
    lengths.sort_unstable();
    for len in lengths {
        fs::write(copy.path().join(files::LOG), &whole[..len]).expect("room");
        let r = RunReader::open(copy.path());
        let head_ended = last > 0 || len > 4_000;
        if let Err(e) = r {
            assert!(!head_ended && matches!(e, RecordError::NotARecording { .. }), "{len}: {e}");
            continue;
        }
        let (ticks, cut) = read(copy.path());
        let count = ticks.len() as u64;
        assert!(count >= last, "a longer file gave fewer ticks");
        last = count;
        // The file is as good as linear in time, so this bounds what a cut costs.
        let expected = (len as u64 / bytes_per_tick).saturating_sub(120);
        assert!(count >= expected.min(n), "{len} bytes gave {count} ticks, not {expected}");
        let cut = cut.expect("a cut file was called whole");
        let words = if count == 0 { "no tick was recovered" } else { "recovered up to tick" };
        assert!(cut.contains(words), "{cut}");
    }
    assert_eq!(last, n, "a file cut behind its last tick lost some");
}

#[test]
fn invariant_damage_is_told_and_never_read_as_data() {
    let (dir, copy) = (
        tempfile::tempdir().expect("a temporary directory"),
        tempfile::tempdir().expect("a temporary directory"),
    );
    let n = 500;
    let mut w = writer(dir.path(), Policy::Wait);
    (0..n).for_each(|i| tick(&mut w, i));
    drop(w);
    let whole = fs::read(dir.path().join(files::LOG)).expect("a log");
    // `read` checks that whatever is recovered is right.
    let mut found = 0;
    for i in 0..400usize {
        let mut bytes = whole.clone();
        let at = 3_000 + i.wrapping_mul(0x9e37_79b9_7f4a_7c15) % (whole.len() - 3_000);
        bytes[at] ^= 1 << (i % 8);
        fs::write(copy.path().join(files::LOG), bytes).expect("room");
        let (ticks, cut) = read(copy.path());
        assert!(cut.is_some() || ticks.len() as u64 == n, "ticks vanished without a word");
        found += u64::from(cut.is_some());
    }
    assert!(found > 200, "only {found} of 400 damages were noticed");

    // A machine that died may leave zeros where a file was growing.
    let mut bytes = whole[..whole.len() / 2].to_vec();
    bytes.resize(whole.len(), 0);
    fs::write(copy.path().join(files::LOG), bytes).expect("room");
    let (ticks, cut) = read(copy.path());
    assert!(ticks.len() > 100 && cut.is_some());
}

#[test]
fn invariant_a_newer_schema_is_refused() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    drop(writer(dir.path(), Policy::Wait));
    let path = dir.path().join(files::LOG);
    let mut bytes = fs::read(&path).expect("a log");
    let key = b"docktwin_record_schema";
    let at = bytes.windows(key.len()).position(|w| w == key).expect("the key") + key.len();
    // The value: its length, 1, then one digit.
    assert_eq!(bytes[at..at + 5], [1, 0, 0, 0, b'0' + RECORD_SCHEMA as u8]);
    bytes[at + 4] = b'9';
    fs::write(&path, bytes).expect("room");
    let e = RunReader::open(dir.path()).expect_err("schema 9 does not exist yet");
    assert!(matches!(e, RecordError::Newer { found: 9, supported: RECORD_SCHEMA, .. }), "{e}");
    assert!(e.to_string().contains("a newer one"), "{e}");
}

#[test]
fn invariant_other_files_are_refused() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let open = || RunReader::open(dir.path()).expect_err("no recording is there");
    assert!(matches!(open(), RecordError::Io { .. }));
    for text in [&b""[..], b"short", b"a long text that is no MCAP file at all"] {
        fs::write(dir.path().join(files::LOG), text).expect("room");
        let e = open();
        assert!(matches!(e, RecordError::NotARecording { .. }), "{e}");
    }
}

#[test]
fn invariant_a_half_written_event_is_left_out() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let mut w = writer(dir.path(), Policy::Wait);
    for i in 0..3 {
        let event = Event::new(Tick(i), SimTime::ZERO, "limit", "a limit", i.into());
        w.event(&event).expect("the disk has room");
    }
    drop(w);
    let path = dir.path().join(files::EVENTS);
    let text = fs::read(&path).expect("events");
    fs::write(&path, &text[..text.len() - 3]).expect("room");
    let r = RunReader::open(dir.path()).expect("a recording");
    assert_eq!(r.events().expect("two whole lines").len(), 2);
}
