//! Rows that are not those recorded are told, whatever checksums say; a log in other chunks is the same log.

mod mcap_rewrite;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use docktwin_core::{SimTime, Tick};
use docktwin_record::{
    Cell, Column, ContactRow, Cut, Event, Flaw, Outcome, Policy, RunReader, RunWriter, Summary,
    TickRecord, Verdict, files, flip_bit, read_summary, recover,
};
use mcap_rewrite::{Rewrite, rewrite, scale};

const MS: u64 = 1_000_000;
const TICKS: u64 = 400;

fn row(tick: u64) -> Vec<Cell> {
    let t = tick as f64;
    vec![Cell::from(100.0 + t), Cell::from(tick.is_multiple_of(3)), Cell::from((0.1 * t).sin())]
}

fn contacts(tick: u64) -> Vec<ContactRow> {
    let one = |k| ContactRow { pair: k, depth_m: 1e-4 * tick as f64, ..ContactRow::default() };
    (0..(tick % 3) as u16).map(one).collect()
}

fn summary() -> Summary {
    Summary {
        seed: 7,
        state_digest: "00ff".into(),
        first_contact_s: Some(0.1),
        latches_s: vec![Some(0.3), None, None],
        peak_force_n: 1234.5,
        peak_moment_nm: 0.1 + 0.2,
        impulse_ns: 12.0,
        peak_penetration_m: 1e-4,
        energy_dissipated_j: 4.0,
        energy_balance_error: 1e-5,
        momentum_error: 1e-15,
        duration_s: 0.4,
        ticks: TICKS,
        wall_s: 0.5,
        realtime_factor: 20.0,
        ..Summary::new("swing", Outcome::Captured, Verdict::Pass)
    }
}

fn record(dir: &Path) {
    let columns = vec![
        Column::f64("/loads", "force_x_n"),
        Column::bool("/latches", "latch_1_closed"),
        Column::f64("/loads", "force_y_n"),
    ];
    let metadata: BTreeMap<String, String> =
        [("scenario", "swing"), ("seed", "7"), ("started_unix_ns", "1700000000000000000")]
            .map(|(k, v)| (k.to_owned(), v.to_owned()))
            .into();
    let pairs = vec!["ring".into(), "petal".into()];
    let mut w = RunWriter::create(dir, columns, pairs, &metadata, Policy::Wait).expect("fresh");
    for i in 0..TICKS {
        let time = SimTime::of_tick(Tick(i), MS);
        if i % 60 == 30 {
            w.event(&Event::new(Tick(i), time, "limit", format!("tick {i}"), i.into()))
                .expect("room");
        }
        w.tick(Tick(i), time, &row(i), &contacts(i)).expect("room");
    }
    w.finish(&summary()).expect("room");
}

fn recorded() -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("a folder");
    record(dir.path());
    dir
}

fn log(dir: &tempfile::TempDir) -> std::path::PathBuf {
    dir.path().join(files::LOG)
}

fn read(mut r: RunReader) -> (Vec<TickRecord>, Option<Cut>, RunReader) {
    let mut ticks = Vec::new();
    while let Some(t) = r.next_tick().expect("readable") {
        ticks.push(t);
    }
    let cut = r.cut().cloned();
    (ticks, cut, r)
}

fn open(dir: &tempfile::TempDir) -> RunReader {
    RunReader::open(dir.path()).expect("a recording")
}

fn right(ticks: &[TickRecord]) -> bool {
    ticks.iter().all(|t| {
        let same = |(a, b): (&ContactRow, &ContactRow)| a.same_bits(b);
        let want = contacts(t.tick.0);
        t.row == row(t.tick.0)
            && t.contacts.len() == want.len()
            && t.contacts.iter().zip(&want).all(same)
    })
}

/// Byte ranges of the chunks of a log.
fn chunks(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let (mut at, mut out) = (mcap::MAGIC.len(), Vec::new());
    while let Some(len) = bytes.get(at + 1..at + 9) {
        let len = u64::from_le_bytes(len.try_into().expect("8 bytes")) as usize;
        if bytes[at] == mcap::records::op::CHUNK {
            out.push(at..at + 9 + len);
        }
        at += 9 + len;
        if bytes[at..] == *mcap::MAGIC {
            break;
        }
    }
    out
}

#[test]
fn oracle_summary_and_log_name_one_digest_that_equal_rows_share() {
    let (a, b) = (recorded(), recorded());
    let digest = |dir: &tempfile::TempDir| {
        let s = open(dir).summary().expect("readable").expect("a summary");
        let recording = s.recording.expect("filled in");
        (s.record_digest.expect("filled in"), recording.events_digest.expect("filled in"))
    };
    // Two runs of one scenario: other times of the wall, other chunks, one digest.
    assert_eq!(digest(&a), digest(&b));
    assert_eq!(digest(&a).0.len(), 32);
    let file = read_summary(a.path()).expect("readable").expect("a summary");
    assert_eq!(file.damage, None);
    // The last message on the topic says the same.
    let bytes = fs::read(log(&a)).expect("a log");
    let links: Vec<_> = mcap::MessageStream::new(&bytes)
        .expect("a log")
        .map(|m| m.expect("whole"))
        .filter(|m| m.channel.topic == "/record_digest")
        .collect();
    assert_eq!(links.len(), chunks(&bytes).len(), "one a chunk");
    let text = String::from_utf8_lossy(&links.last().expect("one").data).into_owned();
    assert!(text.contains(&digest(&a).0) && text.contains(&digest(&a).1), "{text}");
    let schema = links[0].channel.schema.as_ref().expect("a schema");
    assert!(String::from_utf8_lossy(&schema.data).contains("string before\nstring after\n"));
    let (ticks, cut, _) = read(open(&a));
    assert_eq!((ticks.len() as u64, cut), (TICKS, None));
}

#[test]
fn oracle_a_log_in_other_chunks_is_the_same_log() {
    let whole = recorded();
    let reference = read(open(&whole)).0;
    // From less than a message, so that every tick lies in many chunks, to one chunk, to none at all.
    for chunk_size in [Some(1), Some(100), Some(700), Some(5000), Some(1 << 22), None] {
        for (metadata_last, sorted) in [(false, false), (true, false), (false, true)] {
            let dir = recorded();
            fs::copy(log(&whole), log(&dir)).expect("room");
            let how = Rewrite { chunk_size, metadata_last, sorted };
            rewrite(&log(&dir), &how, |_, _, _| true);
            let (ticks, cut, r) = read(open(&dir));
            assert_eq!(cut, None, "{chunk_size:?} {metadata_last} {sorted}");
            assert!(ticks == reference, "{chunk_size:?} {metadata_last} {sorted}");
            assert_eq!(r.logged_events(), r.events().expect("events"));
            let done = recover(dir.path()).expect("whole");
            assert!(!done.changed() && done.as_recorded(), "{done:?}");
        }
    }
    // An old recording, without digests, too.
    let old = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/schema-1/docking");
    let copy = tempfile::tempdir().expect("a folder");
    for chunk_size in [Some(300), Some(40_000), None] {
        fs::copy(old.join(files::LOG), log(&copy)).expect("room");
        rewrite(&log(&copy), &Rewrite { chunk_size, ..Rewrite::default() }, |_, _, _| true);
        let (ticks, cut, _) = read(open(&copy));
        assert_eq!(cut, None);
        assert!(ticks == read(RunReader::open(&old).expect("old")).0, "{chunk_size:?}");
    }
}

#[test]
fn invariant_edited_rows_with_right_checksums_are_not_handed_out() {
    type Edit = fn(&str, u32, &mut Vec<u8>) -> bool;
    let edits: [(&str, Edit); 7] = [
        ("a load", |topic, tick, data| {
            if topic == "/loads" && tick == 123 {
                scale(data, 4, 0.1);
            }
            true
        }),
        ("all loads", |topic, _, data| {
            if topic == "/loads" {
                scale(data, 4, 0.1);
            }
            true
        }),
        ("a latch", |topic, tick, data| {
            if topic == "/latches" && tick == 123 {
                data[4] ^= 1;
            }
            true
        }),
        ("a depth", |topic, tick, data| {
            if topic == "/contacts" && tick == 122 {
                scale(data, 68, 0.5);
            }
            true
        }),
        ("contacts are gone", |topic, tick, _| topic != "/contacts" || tick != 122),
        ("a tick is gone", |topic, tick, _| topic == "/record_digest" || tick != 123),
        ("digests are gone", |topic, tick, _| topic != "/record_digest" || tick < 100),
    ];
    for (what, edit) in edits {
        for chunk_size in [Some(200), Some(1 << 20)] {
            let dir = recorded();
            rewrite(&log(&dir), &Rewrite { chunk_size, ..Rewrite::default() }, edit);
            let (ticks, cut, _) = read(open(&dir));
            let cut = cut.unwrap_or_else(|| panic!("{what}: nothing was said"));
            assert_eq!(cut.flaw, Flaw::Edited, "{what}: {cut}");
            assert!(cut.to_string().contains("the log is not what was recorded"), "{cut}");
            assert!(right(&ticks) && ticks.len() <= 123, "{what}: {} ticks", ticks.len());
            if what == "a load" {
                assert!(cut.why.contains("ticks 1") || cut.why.contains("tick 123"), "{cut}");
                assert!(cut.why.contains("edited or damaged"), "{cut}");
                // Negative control: who asks for them gets them, and is told all the same.
                let (all, told, _) = read(open(&dir).unchecked());
                assert_eq!((all.len() as u64, right(&all)), (TICKS, false));
                assert_eq!(told.map(|c| c.flaw), Some(Flaw::Edited));
            }
            // What is not edited is not lost.
            if what != "all loads" {
                let (behind, _, r) = read(open(&dir).over_holes());
                assert!(right(&behind), "{what}");
                assert!(behind.len() as u64 >= TICKS - 60, "{what}: {}", behind.len());
                assert!(!r.holes().is_empty(), "{what}");
            }
        }
    }
}

#[test]
fn invariant_an_edited_event_is_told() {
    let dir = recorded();
    rewrite(&log(&dir), &Rewrite::default(), |topic, tick, data| {
        if topic == "/events" && tick == 150 {
            let at = data.windows(8).position(|w| w == b"tick 150").expect("its text");
            data[at..at + 8].copy_from_slice(b"tick 151");
        }
        true
    });
    let (ticks, cut, _) = read(open(&dir));
    assert!(right(&ticks));
    let cut = cut.expect("told");
    assert!(cut.flaw == Flaw::Edited && cut.why.contains("events do not fit"), "{cut}");
    // Those of events.jsonl are right.
    let done = recover(dir.path()).expect("recoverable");
    assert!(!done.as_recorded() && done.log_rewritten, "{done:?}");
    let events = open(&dir).events().expect("events");
    assert!(events.iter().any(|e| e.text == "tick 150"), "{events:?}");
    assert!(events.iter().all(|e| e.text != "tick 151"), "{events:?}");
}

#[test]
fn invariant_the_head_of_the_log_counts() {
    let dir = recorded();
    let path = log(&dir);
    let bytes = fs::read(&path).expect("a log");
    let at = bytes.windows(5).position(|w| w == b"swing").expect("the scenario");
    let mut other = bytes.clone();
    other[at] = b'x';
    fs::write(&path, other).expect("room");
    let (ticks, cut, _) = read(open(&dir));
    let cut = cut.expect("told");
    assert!(ticks.is_empty() && cut.flaw == Flaw::Edited && cut.why.contains("head"), "{cut}");
    // The rows themselves are right, and are not lost.
    let (behind, _, _) = read(open(&dir).over_holes());
    assert!(right(&behind) && behind.len() as u64 == TICKS);
}

#[test]
fn invariant_the_summary_of_another_run_is_told() {
    let (a, b) = (recorded(), recorded());
    // The other differs in one bit of one row.
    flip_bit(b.path(), Tick(200), "force_x_n", 0).expect("the bit is there");
    let (ticks, cut, _) = read(open(&b));
    assert_eq!(ticks.len() as u64, TICKS);
    let cut = cut.expect("its summary is that of the unchanged rows");
    assert!(cut.flaw == Flaw::Foreign && cut.why.contains("not of one run"), "{cut}");
    // The bit is back: so is the digest.
    flip_bit(b.path(), Tick(200), "force_x_n", 0).expect("the bit is there");
    assert_eq!(read(open(&b)).1, None);

    let path = a.path().join(files::SUMMARY);
    let text = fs::read_to_string(&path).expect("a summary");
    // Edited numbers, another scenario, and a digest left out.
    for (from, to, said) in [
        ("1234.5", "1234.6", "summary.json is not as it was written"),
        ("\"pass\"", "\"fail\"", "summary.json is not as it was written"),
        ("\"energy_in_j\": null", "\"energy_in_j\": 0.0", "summary.json is not as it was written"),
        ("\"summary_digest\"", "\"no_digest\"", ""),
        ("\"record_digest\"", "\"no_digest\"", "summary.json is not as it was written"),
    ] {
        fs::write(&path, text.replacen(from, to, 1)).expect("room");
        let (ticks, cut, _) = read(open(&a));
        assert!(right(&ticks) && ticks.len() as u64 == TICKS, "the log is right");
        match cut {
            Some(cut) => assert!(cut.flaw == Flaw::Foreign && cut.why.contains(said), "{cut}"),
            None => assert!(said.is_empty(), "{from}: nothing was said"),
        }
    }
    // Otherwise spaced and ordered it is the same summary.
    let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    fs::write(&path, serde_json::to_string(&value).expect("JSON")).expect("room");
    assert_eq!(read(open(&a)).1, None);
}

#[test]
fn invariant_reading_goes_on_behind_a_damaged_chunk() {
    let whole = recorded();
    let bytes = fs::read(log(&whole)).expect("a log");
    let all = chunks(&bytes);
    assert!(all.len() >= 8, "{}", all.len());
    let reference = read(open(&whole)).0;
    let per_chunk = |i: usize| {
        let mut one = 0;
        let dir = tempfile::tempdir().expect("a folder");
        let mut lacks = bytes.clone();
        lacks[all[i].end - 20] ^= 0x10;
        fs::write(log(&dir), lacks).expect("room");
        let (ticks, cut, r) = read(open(&dir).over_holes());
        one += TICKS as usize - ticks.len();
        (one, ticks, cut, r.holes().to_vec(), dir)
    };
    for i in 0..all.len() {
        let (lost, ticks, cut, holes, dir) = per_chunk(i);
        // A chunk has 50 ticks at most; all others are there.
        assert!((1..=50).contains(&lost), "chunk {i}: {lost} lost");
        assert!(right(&ticks));
        assert_eq!(cut.expect("told").flaw, Flaw::Damaged);
        assert_eq!(holes.len(), 1, "{holes:?}");
        let (first, last) = holes[0].ticks().expect("ticks are missing");
        let last = last.unwrap_or(TICKS - 1);
        assert_eq!(last + 1 - first, lost as u64, "{holes:?}");
        assert!(ticks.iter().all(|t| t.tick.0 < first || t.tick.0 > last));
        // Otherwise it stops there.
        let (before, told, _) = read(open(&dir));
        assert_eq!(before.len() as u64, first);
        assert!(before == reference[..before.len()]);
        assert!(told.expect("told").to_string().contains("is damaged"));
    }
    // A record that is none of ours and claims to reach over the next chunks: they are there all the same.
    let index = all[2].end;
    let mut hides = bytes.clone();
    hides[index] = 0x90;
    let over = (all[5].start - index - 9 + 3) as u64;
    hides[index + 1..index + 9].copy_from_slice(&over.to_le_bytes());
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(log(&dir), &hides).expect("room");
    let (ticks, cut, r) = read(open(&dir).over_holes());
    assert!(right(&ticks) && ticks.len() as u64 == TICKS, "{:?}", r.holes());
    assert!(cut.is_some());
    // With damage in the header, two holes, and what a machine that died may leave.
    let mut two = bytes.clone();
    two[all[2].start + 3] ^= 0x40;
    two[all[5].start + 40] ^= 0x01;
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(log(&dir), &two).expect("room");
    let (ticks, _, r) = read(open(&dir).over_holes());
    assert!(right(&ticks) && ticks.len() as u64 >= TICKS - 100);
    assert_eq!(r.holes().len(), 2, "{:?}", r.holes());
    let mut zeros = bytes[..all[4].start].to_vec();
    zeros.resize(bytes.len(), 0);
    fs::write(log(&dir), &zeros).expect("room");
    let (_, cut, r) = read(open(&dir).over_holes());
    assert!(r.holes().is_empty() && cut.expect("told").merely_ends());
}

#[test]
fn invariant_recovery_goes_on_behind_damage_and_replaces_nothing_by_less() {
    let whole = recorded();
    let bytes = fs::read(log(&whole)).expect("a log");
    let table = fs::read(whole.path().join(files::TABLE)).expect("a table");
    let all = chunks(&bytes);
    let dir = recorded();
    let mut damaged = bytes.clone();
    damaged[all[3].end - 20] ^= 0x10;
    fs::write(log(&dir), &damaged).expect("room");
    let done = recover(dir.path()).expect("recoverable");
    assert!(done.log_rewritten && !done.as_recorded(), "{done:?}");
    assert!((TICKS - 50..TICKS).contains(&done.ticks) && done.holes.len() == 1);
    // The table has all rows, the log has not.
    assert!(!done.table_rewritten && !done.events_rewritten, "{done:?}");
    assert!(done.notes.iter().any(|n| n.contains("it is left as it is")), "{:?}", done.notes);
    assert_eq!(fs::read(dir.path().join(files::TABLE)).expect("a table"), table);
    assert_eq!(fs::read(dir.path().join("run.mcap.cut")).expect("kept"), damaged);
    let (ticks, cut, r) = read(open(&dir));
    assert!(right(&ticks) && ticks.len() as u64 == done.ticks);
    // It says for ever what it lacks.
    assert!(r.recovered().expect("told").contains("are missing"), "{:?}", r.recovered());
    assert_eq!(cut.expect("told").flaw, Flaw::Recovered);
    let again = recover(dir.path()).expect("whole");
    assert!(!again.changed() && !again.as_recorded(), "{again:?}");

    // A log whose end is lost is the same log once it has an end again.
    let dir = recorded();
    fs::write(log(&dir), &bytes[..all[all.len() - 1].end]).expect("room");
    let done = recover(dir.path()).expect("recoverable");
    assert!(done.log_rewritten && done.as_recorded() && !done.table_rewritten, "{done:?}");
    assert_eq!(read(open(&dir)).1, None);
}

#[test]
fn invariant_recovery_mends_a_table_and_events_from_a_whole_log() {
    let dir = recorded();
    let good_table = fs::read(dir.path().join(files::TABLE)).expect("a table");
    let good_events = fs::read(dir.path().join(files::EVENTS)).expect("events");
    let mut table = good_table.clone();
    // In the middle of the first column of numbers.
    let at = table.len() / 3;
    table[at] ^= 0x20;
    fs::write(dir.path().join(files::TABLE), &table).expect("room");
    let text = String::from_utf8(good_events.clone()).expect("text");
    fs::write(dir.path().join(files::EVENTS), text.replace("tick 150", "tick 151")).expect("room");
    let done = recover(dir.path()).expect("recoverable");
    assert!(!done.log_rewritten && done.table_rewritten && done.events_rewritten, "{done:?}");
    assert_eq!(fs::read(dir.path().join(files::EVENTS)).expect("events"), good_events);
    assert_eq!(fs::read(dir.path().join("telemetry.parquet.cut")).expect("kept"), table);
    let done = recover(dir.path()).expect("whole");
    assert!(!done.changed() && done.kept.is_empty(), "{done:?}");
}
