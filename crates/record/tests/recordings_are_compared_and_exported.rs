//! Comparison within tolerances, export, and recovery of cut recordings.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use docktwin_core::{DVec3, SimTime, Tick};
use docktwin_record::{
    Align, Cell, Column, CompareOptions, ContactRow, Event, Policy, RecordError, RunReader,
    RunWriter, Selection, Tolerance, compare, export_csv, export_mat, files, first_difference,
    recover,
};

/// A body that swings: position in x and y, an Euler angle, an attitude, a state.
fn columns() -> Vec<Column> {
    let mut out = vec![
        Column::f64("/chaser", "chaser_position_x_m"),
        Column::f64("/chaser", "chaser_position_y_m"),
        Column::f64("/chaser", "chaser_turn_rad"),
    ];
    out.extend(
        ["w", "x", "y", "z"].map(|p| Column::f64("/chaser", format!("chaser_attitude_{p}"))),
    );
    out.push(Column::u64("/latches", "latch_1_phase"));
    out.push(Column::bool("/latches", "latch_1_closed"));
    out
}

/// Swings by 2 m in x and 1 mm in y; `late_s` later, `off_m` aside, with the other quaternion.
fn row(t: f64, late_s: f64, off_m: f64, sign: f64) -> Vec<Cell> {
    let s = t - late_s;
    // Just below and just above half a turn: the same angle to 2e-9.
    let turn = sign * (core::f64::consts::PI - 1e-9);
    let q = [(0.5 * s).cos(), (0.5 * s).sin(), 0.0, 0.0].map(|x| Cell::from(sign * x));
    let mut out =
        vec![Cell::from(2.0 * s.sin() + off_m), Cell::from(1e-3 * s.cos()), Cell::from(turn)];
    out.extend(q);
    out.extend([Cell::from(u64::from(s > 0.5)), Cell::from(s > 0.5)]);
    out
}

struct Swing {
    ticks: u64,
    tick_ns: u64,
    late_s: f64,
    off_m: f64,
    sign: f64,
}

const SWING: Swing = Swing { ticks: 1000, tick_ns: 1_000_000, late_s: 0.0, off_m: 0.0, sign: 1.0 };

fn record(dir: &Path, s: &Swing) {
    let metadata: BTreeMap<String, String> =
        [("scenario", "swing"), ("started_unix_ns", "1700000000000000000")]
            .map(|(k, v)| (k.to_owned(), v.to_owned()))
            .into();
    let pairs = vec!["ring, \"active\"".to_owned(), "petal 1".to_owned()];
    let mut w = RunWriter::create(dir, columns(), pairs, &metadata, Policy::Wait).expect("fresh");
    for i in 0..s.ticks {
        let time = SimTime::of_tick(Tick(i), s.tick_ns);
        let t = time.seconds();
        let contact = ContactRow {
            pair: (i % 2) as u16,
            point_w_m: DVec3::new(t, -0.0, 1.0 / 3.0),
            depth_m: 1e-4,
            ..ContactRow::default()
        };
        // In contact from 0.25 s on, by its own clock.
        let n = usize::from(t - s.late_s > 0.25);
        w.tick(Tick(i), time, &row(t, s.late_s, s.off_m, s.sign), &[contact][..n]).expect("room");
        if i % 100 == 99 {
            let e = Event::new(Tick(i), time, "limit", format!("tick {i}"), i.into());
            w.event(&e).expect("room");
        }
    }
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary directory")
}

fn open(dir: &tempfile::TempDir) -> RunReader {
    RunReader::open(dir.path()).expect("a recording")
}

fn tolerance(relative: Option<f64>, by_unit: &[(&str, f64)]) -> Tolerance {
    let by_unit = by_unit.iter().map(|(u, x)| ((*u).to_owned(), *x)).collect();
    Tolerance { relative, by_unit }
}

#[test]
fn oracle_a_known_offset_is_found_in_size_place_and_share_of_the_peak() {
    let (a, b) = (folder(), folder());
    record(a.path(), &SWING);
    record(b.path(), &Swing { off_m: 0.01, sign: -1.0, ..SWING });
    let options =
        CompareOptions { tolerance: tolerance(Some(1e-3), &[("m", 2e-3)]), align: Align::Start };
    let c = compare(&mut open(&a), &mut open(&b), &options).expect("comparable");
    assert_eq!((c.ticks, c.interpolated), (1000, false));
    // The peak of the vector: 2 sin(0.999) with 1e-3 cos beside it.
    let (x, y) = (2.0 * 0.999f64.sin(), 1e-3 * 0.999f64.cos());
    let first = &c.columns[0];
    assert_eq!(first.column, "chaser_position_x_m");
    assert!((first.peak - x.hypot(y)).abs() < 1e-12, "{first:?}");
    assert!((first.worst - 0.01).abs() < 1e-12 && (first.rms - 0.01).abs() < 1e-12, "{first:?}");
    // The larger of 1e-3 of 1.68 m and 2 mm is 2 mm: five times beyond, from the first tick.
    assert!((first.times_allowed.expect("judged") - 5.0).abs() < 1e-9, "{first:?}");
    assert_eq!(first.first_beyond, Some((0, 0.0)));
    // Half a turn from both sides, and q against −q, are no differences.
    assert_eq!(c.beyond().count(), 1, "{:?}", c.columns);
    let turn = c.columns.iter().find(|c| c.column == "chaser_turn_rad").expect("there");
    assert!((turn.worst - 2e-9).abs() < 1e-12, "{turn:?}");
    let none = CompareOptions { tolerance: tolerance(Some(0.01), &[]), ..options };
    let c = compare(&mut open(&a), &mut open(&b), &none).expect("comparable");
    assert_eq!(c.beyond().count(), 0, "1 % of 1.68 m is more than 1 cm");
}

#[test]
fn oracle_first_contact_and_interpolation_bring_other_clocks_together() {
    let (a, b) = (folder(), folder());
    record(a.path(), &SWING);
    // 30 ms later, on ticks of 0.4 ms: every other instant falls between two of them.
    record(b.path(), &Swing { ticks: 2500, tick_ns: 400_000, late_s: 0.03, ..SWING });
    let strict = tolerance(None, &[("m", 1e-3)]);
    let at = |align| CompareOptions { tolerance: strict.clone(), align };
    let apart = compare(&mut open(&a), &mut open(&b), &at(Align::Start)).expect("comparable");
    // By the mean value theorem 2 · 0.03 at most, and nearly that where the cosine is one.
    assert!(apart.interpolated && (apart.columns[0].worst - 0.06).abs() < 1e-3, "{apart:?}");
    let c = compare(&mut open(&a), &mut open(&b), &at(Align::FirstContact)).expect("comparable");
    // First ticks of contact are within a tick of either: 2 m/s · 1 ms.
    assert!(c.columns[0].worst < 2e-3, "{:?}", c.columns[0]);
    assert_eq!(c.ticks_of, [1000, 2500]);
    assert!((c.zero_s[1] - c.zero_s[0] - 0.03).abs() < 1e-3, "{:?}", c.zero_s);
    // States change once, within a tick.
    assert!(c.states.iter().all(|s| s.ticks_differing <= 1), "{:?}", c.states);
}

#[test]
fn invariant_what_cannot_be_aligned_is_refused() {
    let (a, b) = (folder(), folder());
    record(a.path(), &SWING);
    record(b.path(), &Swing { ticks: 100, ..SWING });
    let options = CompareOptions { align: Align::FirstContact, ..CompareOptions::default() };
    let e = compare(&mut open(&a), &mut open(&b), &options).expect_err("no contact in b");
    assert!(matches!(&e, RecordError::Absent { .. }), "{e}");
    assert!(e.to_string().contains("contact"), "{e}");
}

#[test]
fn invariant_csv_gives_the_bits_back() {
    let dir = folder();
    record(dir.path(), &SWING);
    let (mut table, mut points) = (Vec::new(), Vec::new());
    let all = Selection::default();
    let at = Path::new("x.csv");
    let done = export_csv(&mut open(&dir), &all, &mut table, Some(&mut points), at).expect("room");
    let text = String::from_utf8(table).expect("UTF-8");
    let mut lines = text.lines();
    let names: Vec<String> = columns().into_iter().map(|c| c.name).collect();
    assert_eq!(lines.next(), Some(format!("tick,time_s,{}", names.join(",")).as_str()));
    let mut r = open(&dir);
    for line in lines {
        let t = r.next_tick().expect("whole").expect("as many lines as ticks");
        let cells: Vec<&str> = line.split(',').collect();
        let number = |i: usize| cells[i].parse::<f64>().expect("a number").to_bits();
        assert_eq!(cells[0], t.tick.0.to_string());
        assert_eq!(number(1), t.time.seconds().to_bits());
        (0..7).for_each(|i| assert_eq!(number(i + 2), t.row[i].bits(), "{line}"));
        assert_eq!(cells[9], t.row[7].as_u64().to_string());
        assert_eq!(cells[10], u8::from(t.row[8].as_bool()).to_string());
    }
    assert_eq!((done.rows, r.next_tick().expect("whole")), (1000, None));
    let text = String::from_utf8(points).expect("UTF-8");
    assert_eq!(text.lines().count() as u64, done.contacts + 1);
    assert!(text.lines().nth(1).expect("a point").contains(",1,petal 1,"), "{text:.300}");
    // A name with a comma and quotes, as RFC 4180 writes it; −0.0 keeps its sign.
    assert!(
        text.contains(",0,\"ring, \"\"active\"\"\",") && text.contains(",-0.0,"),
        "{text:.300}"
    );
}

#[test]
fn invariant_a_selection_takes_what_it_names() {
    let dir = folder();
    record(dir.path(), &SWING);
    let export = |columns: &[&str], every| {
        let columns = columns.iter().map(|c| (*c).to_owned()).collect();
        let mut out = Vec::new();
        let s = Selection { columns, every };
        export_csv(&mut open(&dir), &s, &mut out, None, Path::new("x.csv"))
            .map(|d| (d.rows, d.columns, String::from_utf8(out).expect("UTF-8")))
    };
    let (rows, columns, text) = export(&["/latches", "*_x_m"], 300).expect("they are there");
    assert_eq!((rows, columns), (4, 3));
    assert!(text.starts_with("tick,time_s,chaser_position_x_m,latch_1_phase,latch_1_closed\n0,"));
    assert!(text.lines().nth(2).expect("a line").starts_with("300,0.3,"));
    for wrong in ["nothing*", "[a"] {
        let e = export(&[wrong], 1).expect_err("nothing is called that");
        assert!(matches!(&e, RecordError::Absent { .. }) && e.to_string().contains(wrong), "{e}");
    }
}

/// Elements of a MAT file: type, body.
fn elements(mut bytes: &[u8]) -> Vec<(u32, &[u8])> {
    let mut out = Vec::new();
    while !bytes.is_empty() {
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("a word"));
        let (kind, len) = (word(0), word(4) as usize);
        out.push((kind, &bytes[8..8 + len]));
        bytes = &bytes[8 + len.next_multiple_of(8)..];
    }
    out
}

/// By the tables of "MAT-File Format", version 5: types, classes, flags, paddings.
#[test]
fn oracle_a_mat_file_is_laid_out_as_its_format_says() {
    let dir = folder();
    record(dir.path(), &SWING);
    let mut out = Cursor::new(Vec::new());
    let selection = Selection { columns: vec![], every: 3 };
    let at = Path::new("x.mat");
    let done = export_mat(&mut open(&dir), &selection, &mut out, true, at).expect("room");
    let bytes = out.into_inner();
    assert!(bytes.starts_with(b"MATLAB 5.0 MAT-file"));
    assert_eq!(bytes[124..128], [0x00, 0x01, b'I', b'M']);
    assert_eq!((done.rows, done.columns), (334, 9));
    let mut seen = BTreeMap::new();
    for (kind, body) in elements(&bytes[128..]) {
        assert_eq!(kind, 14, "every variable is a matrix");
        let parts = elements(body);
        let [(6, flags), (5, dims), (1, name), ..] = parts[..] else { panic!("{parts:?}") };
        let int =
            |b: &[u8], i: usize| i32::from_le_bytes(b[4 * i..4 * i + 4].try_into().expect("4"));
        let name = String::from_utf8(name.to_vec()).expect("a name");
        seen.insert(name, (flags[0], flags[1], int(dims, 0), int(dims, 1), parts[3..].to_vec()));
    }
    let n = done.contacts as i32;
    // Double is class 6, uint64 15, uint8 9 with the logical flag, uint16 11, char 4 as miUTF16 17, cell 1.
    for (name, class, flag, rows) in [
        ("tick", 15, 0, 334),
        ("time_s", 6, 0, 334),
        ("chaser_position_x_m", 6, 0, 334),
        ("latch_1_phase", 15, 0, 334),
        ("latch_1_closed", 9, 2, 334),
        ("contacts_pair_number", 11, 0, n),
        ("contacts_depth_m", 6, 0, n),
        ("pair_names", 1, 0, 2),
    ] {
        let (c, f, r, k, _) = &seen[name];
        assert_eq!((*c, *f, *r, *k), (class, flag, rows, 1), "{name}");
    }
    let (class, _, 1, 5, text) = &seen["scenario"] else { panic!("scenario") };
    let utf16: Vec<u8> = "swing".encode_utf16().flat_map(u16::to_le_bytes).collect();
    assert_eq!((*class, text[0]), (4, (17, &utf16[..])));
    // The numbers themselves, by their types: miDOUBLE 9, miUINT8 2, miUINT16 4.
    let mut r = open(&dir);
    let ticks: Vec<_> = r.ticks().map(|t| t.expect("whole")).step_by(3).collect();
    let (9, x) = seen["chaser_position_x_m"].4[0] else { panic!("miDOUBLE") };
    let want: Vec<u8> = ticks.iter().flat_map(|t| t.row[0].bits().to_le_bytes()).collect();
    assert_eq!(x, want);
    let (2, closed) = seen["latch_1_closed"].4[0] else { panic!("miUINT8") };
    assert_eq!(closed, ticks.iter().map(|t| u8::from(t.row[8].as_bool())).collect::<Vec<_>>());
    let (4, pair) = seen["contacts_pair_number"].4[0] else { panic!("miUINT16") };
    assert_eq!(pair[..4], [2, 0, 1, 0], "pairs 1, 0, … of ours are 2, 1, … of MATLAB's");
}

#[test]
fn invariant_a_cut_recording_is_recovered_without_loss() {
    let (whole, dir) = (folder(), folder());
    record(whole.path(), &SWING);
    let log = std::fs::read(whole.path().join(files::LOG)).expect("a log");
    let cut = &log[..log.len() * 6 / 10];
    std::fs::write(dir.path().join(files::LOG), cut).expect("room");
    // Of the events only the first two are left, and a torn third.
    let events = std::fs::read_to_string(whole.path().join(files::EVENTS)).expect("events");
    let ends: Vec<usize> = events.match_indices('\n').map(|(i, _)| i + 1).collect();
    let torn = &events[..ends[1] + 9];
    std::fs::write(dir.path().join(files::EVENTS), torn).expect("room");
    std::fs::write(dir.path().join(files::TABLE), b"PAR1").expect("room");

    let before = open(&dir).ticks().count() as u64;
    let done = recover(dir.path()).expect("recoverable");
    assert_eq!((done.ticks, done.changed(), done.table_rewritten), (before, true, true));
    let kept = |name: &str| std::fs::read(dir.path().join(name)).expect("the original is kept");
    assert_eq!(kept("run.mcap.cut"), cut);
    assert_eq!(kept("events.jsonl.cut"), torn.as_bytes());

    // Whole, by the mcap crate's own judgement, and bit for bit what there was.
    let bytes = kept(files::LOG);
    let stats = mcap::Summary::read(&bytes).expect("readable").expect("a summary");
    let n = stats.stats.expect("statistics").channel_message_counts[&1];
    assert_eq!(n, before);
    let mut r = open(&dir);
    let mut original = open(&whole);
    while let Some(t) = r.next_tick().expect("whole") {
        assert_eq!(Some(t), original.next_tick().expect("whole"));
    }
    assert!(r.cut().is_none() && r.recovered().is_some_and(|w| w.contains("recovered up to tick")));
    // Every event of the recovered ticks is back, from the log.
    let n = before / 100;
    let back = r.events().expect("events");
    assert_eq!(back.len() as u64, n, "{back:?}");
    assert_eq!(back, original.events().expect("events")[..back.len()]);
    assert_eq!(first_difference(&mut open(&dir), &mut open(&dir)).expect("same columns"), None);

    // Once more: nothing is left to do.
    let again = recover(dir.path()).expect("whole");
    assert!(!again.changed() && again.kept.is_empty(), "{again:?}");
    assert_eq!((again.ticks, again.events), (done.ticks, done.events));
}

#[test]
fn invariant_the_wall_clock_of_a_tick_is_kept_and_does_not_go_back() {
    let dir = folder();
    record(dir.path(), &SWING);
    let walls: Vec<u64> = open(&dir)
        .ticks()
        .map(|t| t.expect("whole").recorded_unix_ns.expect("a start was given"))
        .collect();
    assert!(walls[0] >= 1_700_000_000_000_000_000 && walls.is_sorted());
}
