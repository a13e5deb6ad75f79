//! What is recorded is what is read: every bit of every column and contact, events, summary, and
//! the same numbers in the Parquet table.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use docktwin_core::{DVec3, SimTime, Tick};
use docktwin_record::{
    Cell, Column, ColumnKind, ContactRow, Event, Outcome, Policy, RecordError, RunReader,
    RunWriter, StepUs, Summary, Verdict, files, first_difference, flip_bit,
};
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;
use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;

const MS: u64 = 1_000_000;

fn columns() -> Vec<Column> {
    vec![
        Column::f64("/chaser/truth", "chaser_position_x_m"),
        Column::bool("/latches", "latch_1_closed"),
        Column::f64("/chaser/truth", "chaser_position_y_m"),
        Column::u64("/digests", "state_digest_short"),
        Column::f64("/latches", "latch_1_force_n"),
        Column::bool("/chaser/truth", "thrust_on"),
    ]
}

fn metadata() -> BTreeMap<String, String> {
    [("tool_version", "0.1.0"), ("scenario", "apas_nominal"), ("seed", "7")]
        .map(|(k, v)| (k.to_owned(), v.to_owned()))
        .into()
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
        energy_in_j: 5.0,
        energy_dissipated_j: 4.0,
        energy_balance_error: 1e-5,
        momentum_error: 1e-15,
        duration_s: 10.0,
        ticks: 10_000,
        wall_s: 0.5,
        realtime_factor: 20.0,
        step_us: StepUs { p50: 10.0, p99: 20.0, p999: 30.0, max: 40.0, n: 50_000 },
        ..Summary::new("apas_nominal", Outcome::Captured, Verdict::Pass)
    }
}

/// Numbers that a careless copy would change.
const ODD: [u64; 8] = [
    0x8000_0000_0000_0000, // −0.0
    0x7ff8_dead_beef_0001, // NaN with a payload
    0xfff0_0000_0000_0001, // signalling NaN
    0x7ff0_0000_0000_0000, // infinity
    0x0000_0000_0000_0001, // smallest subnormal
    0xffff_ffff_ffff_ffff,
    0x3ff0_0000_0000_0001, // 1 + 1 ulp
    0,
];

fn row(tick: u64) -> Vec<Cell> {
    let at = |i: u64| ODD[((tick + i) % 8) as usize];
    vec![
        Cell::from_bits(at(0)),
        Cell::from(tick.is_multiple_of(3)),
        Cell::from(tick as f64 * 0.1),
        Cell::from_bits(at(1)),
        Cell::from_bits(at(2)),
        Cell::from(tick.is_multiple_of(2)),
    ]
}

fn contacts(tick: u64) -> Vec<ContactRow> {
    let point = |i: u64| ContactRow {
        pair: i as u16,
        point_w_m: DVec3::new(0.1 * tick as f64, -0.0, f64::from_bits(ODD[1])),
        normal_w: DVec3::X,
        depth_m: 1e-5 * i as f64,
        normal_force_n: f64::from_bits(ODD[(tick % 8) as usize]),
        friction_w_n: DVec3::new(1.0, 2.0, 3.0),
    };
    // Long stretches without contacts, and a change every tick elsewhere.
    if tick % 40 < 20 { vec![] } else { (0..tick % 4).map(point).collect() }
}

fn events(ticks: u64) -> Vec<Event> {
    (0..ticks)
        .step_by(97)
        .map(|i| {
            Event::new(
                Tick(i),
                SimTime::of_tick(Tick(i), MS),
                "contact_begin",
                format!("petal 1 touches \"ring\" – tick {i}\nsecond line"),
                serde_json::json!({ "pair": 3, "depth_m": 0.1 + 0.2 }),
            )
        })
        .collect()
}

fn record(dir: &Path, ticks: u64) {
    let mut w =
        RunWriter::create(dir, columns(), vec!["petal_1 ring".into()], &metadata(), Policy::Wait)
            .expect("the directory is fresh");
    w.scenario_toml("schema = 1\n").expect("the directory can be written");
    let mut events = events(ticks).into_iter().peekable();
    for i in 0..ticks {
        let time = SimTime::of_tick(Tick(i), MS);
        w.tick(Tick(i), time, &row(i), &contacts(i)).expect("the disk has room");
        while let Some(e) = events.next_if(|e| e.tick == i) {
            w.event(&e).expect("the disk has room");
        }
    }
    let recorded = w.finish(&summary()).expect("the disk has room");
    assert_eq!((recorded.ticks, recorded.dropped_ticks), (ticks, 0));
    assert_eq!(recorded.policy, "wait");
}

#[test]
fn invariant_every_bit_comes_back() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    // Past one row group and not a whole number of chunks.
    let ticks = 4_321;
    record(dir.path(), ticks);
    let mut r = RunReader::open(dir.path()).expect("it was just written");
    assert_eq!(r.columns(), columns());
    assert_eq!(r.pair_names(), ["petal_1 ring"]);
    assert_eq!(r.metadata()["scenario"], "apas_nominal");
    assert_eq!(r.metadata()["docktwin_record_schema"], "1");
    // Twice, as a reader may go back.
    for _ in 0..2 {
        let mut n = 0;
        while let Some(t) = r.next_tick().expect("a whole file") {
            assert_eq!(t.tick, Tick(n));
            assert_eq!(t.time, SimTime::of_tick(Tick(n), MS));
            assert_eq!(t.row, row(n), "tick {n}");
            let want = contacts(n);
            assert_eq!(t.contacts.len(), want.len(), "tick {n}");
            assert!(t.contacts.iter().zip(&want).all(|(a, b)| a.same_bits(b)), "tick {n}");
            n += 1;
        }
        assert_eq!(n, ticks);
        assert_eq!(r.cut(), None);
        r.rewind().expect("a whole file");
    }
    assert_eq!(r.events().expect("a whole file"), events(ticks));
    assert_eq!(r.scenario_toml().expect("it was written"), "schema = 1\n");

    let read = r.summary().expect("a summary").expect("the run ended");
    let recording = read.recording.clone().expect("finish fills it in");
    assert_eq!(recording.ticks, ticks);
    let size = |name| std::fs::metadata(dir.path().join(name)).expect("a file").len();
    assert_eq!(recording.log_bytes, size(files::LOG));
    assert_eq!(recording.table_bytes, size(files::TABLE));
    assert!(read.record_digest.is_some() && read.summary_digest.is_some());
    let filled_in = Summary {
        recording: read.recording.clone(),
        record_digest: read.record_digest.clone(),
        summary_digest: read.summary_digest.clone(),
        ..summary()
    };
    assert_eq!(read, filled_in);
}

#[test]
fn invariant_the_summary_stands_in_the_order_of_its_contract() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    record(dir.path(), 10);
    let text = std::fs::read_to_string(dir.path().join(files::SUMMARY)).expect("a summary");
    let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let keys: Vec<_> = value.as_object().expect("an object").keys().cloned().collect();
    let want = "schema_version tool_version scenario seed state_digest outcome verdict \
        failure_reason first_contact_s capture_s latches_s peak_force_n peak_moment_nm impulse_ns \
        peak_penetration_m energy_in_j energy_dissipated_j energy_balance_error momentum_error \
        duration_s ticks wall_s realtime_factor step_us recording record_digest summary_digest";
    assert_eq!(keys, want.split_whitespace().collect::<Vec<_>>());
    assert_eq!(value["outcome"], "captured");
    assert!(value["failure_reason"].is_null() && value["latches_s"][1].is_null());
}

#[test]
fn invariant_the_table_has_the_numbers_of_the_log() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    // Two whole row groups and a part of a third.
    let ticks = 17_000;
    record(dir.path(), ticks);
    let first = check_table(dir.path(), ticks);
    // A table made anew from the log is the same, byte for byte.
    std::fs::remove_file(dir.path().join(files::TABLE)).expect("it is there");
    assert_eq!(docktwin_record::rebuild_parquet(dir.path()).expect("a whole log"), ticks);
    assert!(first == check_table(dir.path(), ticks), "the rebuilt table is another");
}

fn check_table(dir: &Path, ticks: u64) -> Vec<u8> {
    let path = dir.join(files::TABLE);
    let reader = SerializedFileReader::new(File::open(&path).expect("a table")).expect("Parquet");
    assert_eq!(reader.metadata().num_row_groups(), 3);
    let mut n = 0;
    for r in reader.get_row_iter(None).expect("rows") {
        let fields: Vec<_> = r.expect("a row").into_columns();
        let names: Vec<_> = fields.iter().map(|(name, _)| name.as_str()).collect();
        let own = ["tick", "time_s"].into_iter();
        let columns = columns();
        assert_eq!(names, own.chain(columns.iter().map(|c| c.name.as_str())).collect::<Vec<_>>());
        assert_eq!(fields[0].1, Field::ULong(n));
        let seconds = SimTime::of_tick(Tick(n), MS).seconds();
        assert!(matches!(fields[1].1, Field::Double(t) if t.to_bits() == seconds.to_bits()));
        for (cell, (column, (_, field))) in row(n).into_iter().zip(columns.iter().zip(&fields[2..]))
        {
            let got = match *field {
                Field::Double(x) => Cell::from(x),
                Field::ULong(x) => Cell::from(x),
                Field::Bool(x) => Cell::from(x),
                ref other => panic!("{other:?} in {}", column.name),
            };
            assert_eq!(got, cell, "tick {n}, {}", column.name);
        }
        n += 1;
    }
    assert_eq!(n, ticks);
    std::fs::read(path).expect("a table")
}

#[test]
fn invariant_a_flipped_bit_is_found() {
    let (a, b) = (
        tempfile::tempdir().expect("a temporary directory"),
        tempfile::tempdir().expect("a temporary directory"),
    );
    record(a.path(), 500);
    record(b.path(), 500);
    let diff = || {
        let mut x = RunReader::open(a.path()).expect("a recording");
        let mut y = RunReader::open(b.path()).expect("a recording");
        first_difference(&mut x, &mut y).expect("the same columns")
    };
    assert_eq!(diff(), None);
    flip_bit(b.path(), Tick(333), "chaser_position_y_m", 0).expect("tick and column are there");
    let d = diff().expect("a bit was flipped");
    assert_eq!((d.tick, d.column.as_str()), (Tick(333), "chaser_position_y_m"));
    assert!(d.a != d.b && d.to_string().contains("0.333"), "{d}");
    // Flipped back, it is the same again: nothing else was touched.
    flip_bit(b.path(), Tick(333), "chaser_position_y_m", 0).expect("tick and column are there");
    assert_eq!(diff(), None);

    for (tick, column) in [(500, "thrust_on"), (1, "no_such")] {
        let e = flip_bit(b.path(), Tick(tick), column, 0).expect_err("it is not there");
        assert!(matches!(e, RecordError::Absent { .. }), "{e}");
    }
}

#[test]
fn invariant_recordings_are_compared_to_their_ends_and_by_their_contacts() {
    let dirs = [(); 3].map(|()| tempfile::tempdir().expect("a temporary directory"));
    record(dirs[0].path(), 100);
    record(dirs[1].path(), 101);
    let open = |i: usize| RunReader::open(dirs[i].path()).expect("a recording");
    let d =
        first_difference(&mut open(0), &mut open(1)).expect("the same columns").expect("longer");
    assert_eq!((d.tick, d.column.as_str(), d.a.as_str()), (Tick(100), "end", "has ended"));

    let mut w = RunWriter::create(dirs[2].path(), columns(), vec![], &metadata(), Policy::Wait)
        .expect("a fresh directory");
    for i in 0..100 {
        let mut c = contacts(i);
        if i == 23 {
            c[1].depth_m = -c[1].depth_m;
        }
        w.tick(Tick(i), SimTime::of_tick(Tick(i), MS), &row(i), &c).expect("the disk has room");
    }
    w.finish(&summary()).expect("the disk has room");
    let d = first_difference(&mut open(0), &mut open(2)).expect("the same columns").expect("depth");
    assert_eq!((d.tick, d.column.as_str()), (Tick(23), "contacts[1].depth_m"));
}

#[test]
fn invariant_other_columns_are_not_compared() {
    let (a, b) = (
        tempfile::tempdir().expect("a temporary directory"),
        tempfile::tempdir().expect("a temporary directory"),
    );
    record(a.path(), 5);
    let mut other = columns();
    other[0].kind = ColumnKind::U64;
    RunWriter::create(b.path(), other, vec![], &metadata(), Policy::Wait)
        .expect("a fresh directory")
        .finish(&summary())
        .expect("the disk has room");
    let mut x = RunReader::open(a.path()).expect("a recording");
    let mut y = RunReader::open(b.path()).expect("a recording");
    let e = first_difference(&mut x, &mut y).expect_err("the columns differ").to_string();
    assert!(e.contains("only the first has `chaser_position_x_m` (float64"), "{e}");
    assert!(e.contains("only the second has `chaser_position_x_m` (uint64"), "{e}");
}

#[test]
fn invariant_a_recording_is_never_overwritten() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    record(dir.path(), 5);
    let before = std::fs::read(dir.path().join(files::TABLE)).expect("a table");
    let e = RunWriter::create(dir.path(), columns(), vec![], &metadata(), Policy::Wait)
        .expect_err("a recording is there");
    assert!(matches!(e, RecordError::Exists { .. }), "{e}");
    assert!(e.to_string().contains("--out"), "{e}");
    assert_eq!(std::fs::read(dir.path().join(files::TABLE)).expect("a table"), before);
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 16,
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..ProptestConfig::default()
    })]

    #[test]
    fn invariant_any_columns_and_any_bits_come_back(
        kinds in prop::collection::vec((0..3usize, 0..4u8), 0..12),
        seed in any::<u64>(),
        ticks in 0..180u64,
    ) {
        let dir = tempfile::tempdir().expect("a temporary directory");
        let kind = [ColumnKind::F64, ColumnKind::U64, ColumnKind::Bool];
        let columns: Vec<_> = kinds
            .iter()
            .enumerate()
            .map(|(i, (k, t))| Column::new(kind[*k], format!("/t{t}"), format!("c{i}")))
            .collect();
        let row = |tick: u64| -> Vec<Cell> {
            columns
                .iter()
                .enumerate()
                .map(|(i, c)| {
                    let x = (seed ^ (tick << 8) ^ i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                    if c.kind == ColumnKind::Bool { Cell::from(x >> 63 == 1) } else { Cell::from_bits(x) }
                })
                .collect()
        };
        let mut w = RunWriter::create(
            dir.path(), columns.clone(), vec![], &BTreeMap::new(), Policy::Wait,
        ).expect("a fresh directory");
        for i in 0..ticks {
            // Ticks and times with gaps.
            w.tick(Tick(3 * i + 1), SimTime::from_nanos(7 * i), &row(i), &[]).expect("room");
        }
        w.finish(&summary()).expect("room");
        let mut r = RunReader::open(dir.path()).expect("a recording");
        prop_assert_eq!(r.columns(), &columns[..]);
        let mut n = 0;
        for t in r.ticks() {
            let t = t.expect("a whole file");
            prop_assert_eq!((t.tick, t.time), (Tick(3 * n + 1), SimTime::from_nanos(7 * n)));
            prop_assert_eq!(t.row, row(n));
            n += 1;
        }
        prop_assert_eq!(n, ticks);
    }
}
