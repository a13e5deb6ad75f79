//! Logs with damage, through every reader: what is handed out without a word is what was recorded.

use std::fs;
use std::path::{Path, PathBuf};

use docktwin_record::{
    Flaw, RunReader, Selection, TickRecord, export_csv, files, first_difference, recover,
};
use docktwin_run::{Rehearsal, RehearsalOptions, Replay, RunDirectory, TwinKind};
use docktwin_scenario::Loader;

use crate::damage;
use crate::dice::Dice;
use crate::world::{World, place};

/// The run that is damaged, kept so that the same input is the same damage every time. Where it is missing
/// a test makes it, to be committed.
const KEPT: &str = "tests/fuzz/recording";

/// A good run, and a folder for damaged ones.
pub(crate) struct Start {
    good: PathBuf,
    run: PathBuf,
    log: Vec<u8>,
    records: Vec<Record>,
    ticks: Vec<TickRecord>,
    _folder: tempfile::TempDir,
}

/// A record of the container: its kind and what is in it.
#[derive(Clone)]
struct Record {
    op: u8,
    body: Vec<u8>,
}

const MAGIC: usize = 8;
const CHUNK: u8 = 6;

fn records(bytes: &[u8]) -> Vec<Record> {
    let (mut at, mut out) = (MAGIC, Vec::new());
    while at + 9 <= bytes.len() - MAGIC {
        let n = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("8 bytes")) as usize;
        out.push(Record { op: bytes[at], body: bytes[at + 9..at + 9 + n].to_vec() });
        at += 9 + n;
    }
    out
}

fn written(magic: &[u8], records: &[Record]) -> Vec<u8> {
    let mut out = magic.to_vec();
    for r in records {
        out.push(r.op);
        out.extend((r.body.len() as u64).to_le_bytes());
        out.extend(&r.body);
    }
    out.extend(magic);
    out
}

/// A chunk with damage to what is packed in it; its checksum may fit again.
fn damage_chunk(body: &mut Vec<u8>, dice: &mut Dice<'_>) {
    // Times of begin and end, size, checksum, name of the compression, length of what is packed.
    let (size, sum, name, packed) = (16..24, 24..28, 28..32, 36..44);
    if body.len() < 44 || body[name] != 4_u32.to_le_bytes() || &body[32..36] != b"zstd" {
        return damage::bytes_once(body, dice);
    }
    let Ok(mut inside) = zstd::bulk::decompress(&body[44..], 1 << 24) else { return };
    for _ in 0..=dice.below(3) {
        if !inside.is_empty() {
            damage::bytes_once(&mut inside, dice);
        }
    }
    let small = zstd::bulk::compress(&inside, 1).expect("packed");
    let claimed = match dice.below(8) {
        0 => 1 << 40,
        1 => 0,
        _ => inside.len() as u64,
    };
    let checksum = match dice.below(4) {
        0 => 0,
        1 => 1,
        _ => crc32fast::hash(&inside),
    };
    body[size].copy_from_slice(&claimed.to_le_bytes());
    body[sum].copy_from_slice(&checksum.to_le_bytes());
    body[packed].copy_from_slice(&(small.len() as u64).to_le_bytes());
    body.truncate(44);
    body.extend(small);
}

/// The log with damage to its bytes, to its records, or within its chunks.
fn damaged(start: &Start, dice: &mut Dice<'_>) -> Vec<u8> {
    let mut all = start.records.clone();
    for _ in 0..=dice.below(3) {
        if all.is_empty() {
            break;
        }
        // Head and chunks are hit as often as the many records of the index.
        let chunks: Vec<usize> = (0..all.len()).filter(|i| all[*i].op == CHUNK).collect();
        let at = match dice.below(3) {
            0 if !chunks.is_empty() => *dice.of(&chunks),
            1 => dice.below(all.len().min(8)),
            _ => dice.below(all.len()),
        };
        match dice.below(10) {
            0 => drop(all.remove(at)),
            1 => {
                let twice = all[at].clone();
                all.insert(dice.below(all.len()), twice);
            }
            2 => {
                let other = dice.below(all.len());
                all.swap(at, other);
            }
            3 => all[at].op = dice.byte() % 18,
            4 => all[at].body.clear(),
            5..7 if !all[at].body.is_empty() => damage::bytes_once(&mut all[at].body, dice),
            _ if all[at].op == CHUNK => damage_chunk(&mut all[at].body, dice),
            _ if !all[at].body.is_empty() => damage::bytes_once(&mut all[at].body, dice),
            _ => {}
        }
    }
    let mut out = written(&start.log[..MAGIC], &all);
    for _ in 0..dice.below(3) {
        damage::bytes_once(&mut out, dice);
        if out.is_empty() {
            break;
        }
    }
    out
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("room");
    for entry in fs::read_dir(from).expect("a folder") {
        let path = entry.expect("an entry").path();
        let target = to.join(path.file_name().expect("a name"));
        if path.is_dir() { copy(&path, &target) } else { drop(fs::copy(&path, target)) }
    }
}

fn record(world: &World, dir: &Path) {
    let loader = Loader::new().set("run.duration_s", 0.25).set("initial.gap_m", 0.02);
    let scenario = loader
        .sources(world.sources.clone())
        .load(&place("scenarios/basic_central_impact.toml"))
        .expect("it is shipped");
    let options = RehearsalOptions { twin: TwinKind::Reduced, seed: 0 };
    let rehearsal = Rehearsal::with(&scenario, options).expect("the sides are apart");
    rehearsal.run(&mut RunDirectory::new(dir)).expect("room");
}

/// The log with the record that ends the data in front of its time, and a chunk behind that gone.
pub(crate) fn ended_early(start: &Start) -> Vec<u8> {
    const DATA_END: u8 = 15;
    let mut all = start.records.clone();
    let end = all.iter().position(|r| r.op == DATA_END).expect("it ends");
    let end = all.remove(end);
    let chunks: Vec<usize> = (0..all.len()).filter(|i| all[*i].op == CHUNK).collect();
    all.remove(chunks[3]);
    all.insert(chunks[2], end);
    written(&start.log[..MAGIC], &all)
}

impl Start {
    pub(crate) fn new(world: &World) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let good = Path::new(env!("CARGO_MANIFEST_DIR")).join(KEPT);
        let run = folder.path().join("run");
        if !good.exists() {
            record(world, &good);
        }
        let log = fs::read(good.join(files::LOG)).expect("a log");
        let mut reader = RunReader::open(&good).expect("a recording");
        let ticks: Vec<_> = reader.ticks().map(|t| t.expect("a tick")).collect();
        assert!(ticks.iter().any(|t| !t.contacts.is_empty()), "nothing touches");
        Self { records: records(&log), good, run, log, ticks, _folder: folder }
    }

    /// Whether these are ticks that were recorded, in their order.
    fn has(&self, ticks: &[TickRecord]) -> bool {
        ticks.iter().all(|t| {
            usize::try_from(t.tick.0).ok().and_then(|i| self.ticks.get(i)).is_some_and(|u| {
                let same = t.contacts.iter().zip(&u.contacts).all(|(a, b)| a.same_bits(b));
                (t.time, &t.row, t.contacts.len()) == (u.time, &u.row, u.contacts.len()) && same
            })
        })
    }
}

/// What an error says, which names the place and what to do.
fn says(text: &str) -> String {
    assert!(text.contains("run"), "no place: {text}");
    assert!(text.len() < 20_000, "{}", &text[..2000]);
    text.chars().filter(|c| c.is_alphabetic() || *c == ' ').take(60).collect()
}

pub(crate) fn judge(start: &Start, input: &[u8]) -> String {
    let mut dice = Dice::new(input);
    let deep = dice.below(4) == 0;
    let log = damaged(start, &mut dice);
    judge_log(start, &log, deep)
}

/// A log in the place of the good one; `deep` with the readers that take long.
pub(crate) fn judge_log(start: &Start, log: &[u8], deep: bool) -> String {
    if start.run.exists() {
        fs::remove_dir_all(&start.run).expect("it is ours");
    }
    copy(&start.good, &start.run);
    fs::write(start.run.join(files::LOG), log).expect("room");
    let said = match RunReader::open(&start.run) {
        Ok(mut reader) => read(start, &mut reader, log),
        Err(e) => says(&e.to_string()),
    };
    if deep {
        other_readers(start);
    }
    said
}

fn read(start: &Start, reader: &mut RunReader, log: &[u8]) -> String {
    let mut ticks = Vec::new();
    while let Some(t) = reader.next_tick().expect("damage is a cut") {
        assert_eq!(t.row.len(), reader.columns().len());
        ticks.push(t);
    }
    let cut = reader.cut().cloned();
    let whole = start.has(&ticks) && ticks.len() == start.ticks.len();
    assert!(whole || cut.is_some() || log == start.log, "{} ticks, and no word", ticks.len());
    let foreign = cut.as_ref().is_some_and(|c| c.flaw == Flaw::Foreign);
    assert!(start.has(&ticks) || foreign, "rows that were not recorded: {cut:?}");
    for e in [reader.summary().err(), reader.events().err()].into_iter().flatten() {
        says(&e.to_string());
    }
    format!("{} ticks of {}: {:?}", ticks.len(), start.ticks.len(), cut.map(|c| c.flaw))
}

fn other_readers(start: &Start) {
    let run = &start.run;
    if let Ok(mut reader) = RunReader::open(run) {
        let done = export_csv(&mut reader, &Selection::default(), std::io::sink(), None, run);
        done.expect("damage is a cut");
        let mut good = RunReader::open(&start.good).expect("a recording");
        if let Err(e) = first_difference(&mut good, &mut reader) {
            assert!(!e.to_string().is_empty());
        }
    }
    if let Err(e) = docktwin_report::write(run, &run.join("report.html")) {
        says(&e.to_string());
    }
    match Replay::open(run).and_then(Replay::run) {
        Ok(found) => assert!(found.ticks > 0),
        Err(e) => drop(says(&e.to_string())),
    }
    let Ok(done) = recover(run) else { return };
    let mut reader = RunReader::open(run).expect("it was recovered");
    let ticks: Vec<_> = reader.ticks().map(|t| t.expect("a tick")).collect();
    assert_eq!(ticks.len() as u64, done.ticks, "{done:?} {:?}", reader.cut());
    let foreign = reader.cut().is_some_and(|c| c.flaw == Flaw::Foreign);
    // Rows beside damage whose digest is lost, in a chunk whose checksum was made to fit: they are counted.
    let wrong = ticks.iter().filter(|t| !start.has(core::slice::from_ref(t))).count() as u64;
    let told = foreign || wrong <= done.unverified && !done.as_recorded();
    assert!(wrong == 0 || told, "{wrong} recovered rows that were not recorded: {done:?}");
    assert!(
        !recover(run).expect("it was recovered").changed(),
        "a second recovery changed something"
    );
}
