//! A run directory under random mutations, read by everything that reads one: nothing wrong is presented as
//! good, nothing that can be read is lost, nothing panics or hangs.
//!
//! `DOCKTWIN_MUTATIONS=2000 cargo test -p docktwin-tests --test mutated_runs -- --nocapture` is the long run;
//! `DOCKTWIN_MUTATION_SEED` gives another one.

#[path = "../../crates/record/tests/mcap_rewrite/mod.rs"]
mod mcap_rewrite;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    ops::Range,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    sync::mpsc,
    time::Duration,
};

use docktwin_core::Tick;
use docktwin_record::{
    Cut, Flaw, Policy, RunReader, RunWriter, Selection, TickRecord, export_csv, export_mat, files,
    first_difference, flip_bit, read_summary, read_table, recover,
};
use docktwin_run::{Rehearsal, RehearsalOptions, Replay, RunDirectory, TwinKind};
use docktwin_scenario::Loader;
use mcap_rewrite::{Rewrite, rewrite, scale};

/// Mutations in the test; the environment may ask for more.
const MUTATIONS: usize = 40;
/// Far longer than any reader takes for a run this short.
const HANGS: Duration = Duration::from_secs(120);

/// A generator of numbers that repeats (SplitMix64).
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    fn of<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.below(items.len())]
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository").to_owned()
}

fn rehearse(speed: f64, dir: &Path) {
    let loader = Loader::new().set("run.duration_s", 0.4).set("initial.axial_speed_m_s", speed);
    let scenario = loader.load(&root().join("scenarios/basic_central_impact.toml"));
    let scenario = scenario.expect("a scenario");
    let options = RehearsalOptions { twin: TwinKind::Reduced, seed: 0 };
    let run = Rehearsal::with(&scenario, options).expect("the sides are apart");
    let _ = run.run(&mut RunDirectory::new(dir)).expect("room");
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("room");
    for e in fs::read_dir(from).expect("a folder") {
        let path = e.expect("an entry").path();
        let target = to.join(path.file_name().expect("a name"));
        if path.is_dir() {
            copy(&path, &target);
        } else {
            fs::copy(&path, target).expect("room");
        }
    }
}

/// All files below, relative.
fn files_of(dir: &Path) -> Vec<PathBuf> {
    let mut out = Vec::new();
    let mut left = vec![dir.to_owned()];
    while let Some(d) = left.pop() {
        for e in fs::read_dir(d).expect("a folder") {
            let path = e.expect("an entry").path();
            if path.is_dir() {
                left.push(path);
            } else {
                out.push(path.strip_prefix(dir).expect("below").to_owned());
            }
        }
    }
    out.sort();
    out
}

fn all_ticks(mut r: RunReader) -> (Vec<TickRecord>, Option<Cut>) {
    let mut out = Vec::new();
    while let Some(t) = r.next_tick().expect("damage is a cut") {
        out.push(t);
    }
    (out, r.cut().cloned())
}

/// Byte ranges of the chunks of a log as the recorder wrote it, and the ticks in each.
fn chunks(bytes: &[u8]) -> Vec<(Range<usize>, Vec<u64>)> {
    let (mut at, mut out) = (mcap::MAGIC.len(), Vec::new());
    while at + 9 < bytes.len() && bytes[at..] != *mcap::MAGIC {
        let len = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("8 bytes")) as usize;
        if bytes[at] == mcap::records::op::CHUNK {
            out.push((at..at + 9 + len, Vec::new()));
        }
        at += 9 + len;
    }
    let summary = mcap::Summary::read(bytes).expect("a log").expect("an index");
    for index in &summary.chunk_indexes {
        let of = out.iter_mut().find(|(r, _)| r.start as u64 == index.chunk_start_offset);
        let (_, ticks) = of.expect("a chunk of the index");
        for m in summary.stream_chunk(bytes, index).expect("a chunk") {
            let m = m.expect("a message");
            if m.channel.topic == "/tick" {
                ticks.push(u64::from(m.sequence));
            }
        }
    }
    out
}

/// A run as it was recorded.
struct Truth {
    dir: PathBuf,
    ticks: BTreeMap<u64, TickRecord>,
    lines: BTreeSet<String>,
    csv: String,
    log: Vec<u8>,
    chunks: Vec<(Range<usize>, Vec<u64>)>,
    page: String,
}

fn csv(mut r: RunReader) -> (String, Option<Cut>) {
    let mut out = Vec::new();
    let done = export_csv(&mut r, &Selection::default(), &mut out, None, Path::new("left.csv"));
    let done = done.expect("damage is a cut");
    (String::from_utf8(out).expect("text"), done.cut)
}

/// The page without the sizes of the files, which say nothing of the run.
fn page(dir: &Path, out: &Path) -> Result<(docktwin_report::Written, String), String> {
    let written = docktwin_report::write(dir, out).map_err(|e| e.to_string())?;
    let mut text = fs::read_to_string(out).expect("the page");
    for name in [files::LOG, files::TABLE, files::EVENTS, "run.rrd"] {
        let head = format!("<tr><th scope=\"row\">{name}</th>");
        while let Some(at) = text.find(&head) {
            let end = text[at..].find("</tr>").expect("closed") + at + 5;
            text.replace_range(at..end, "");
        }
    }
    Ok((written, text))
}

impl Truth {
    /// The page is made at `place`, so that it names the same directory as those of the mutated runs.
    fn of(dir: &Path, place: &Path, out: &Path) -> Self {
        let (ticks, cut) = all_ticks(RunReader::open(dir).expect("a recording"));
        assert_eq!(cut, None);
        let log = fs::read(dir.join(files::LOG)).expect("a log");
        let chunks = chunks(&log);
        let csv = csv(RunReader::open(dir).expect("a recording")).0;
        copy(dir, place);
        let (written, page) = page(place, out).expect("a page");
        assert!(written.as_recorded && written.incomplete.is_none(), "{written:?}");
        assert!(
            page.contains("Loads on the passive ring")
                && page.contains("summary.json") == page.contains("So says summary")
        );
        fs::remove_dir_all(place).expect("removed");
        Self {
            dir: dir.to_owned(),
            ticks: ticks.into_iter().map(|t| (t.tick.0, t)).collect(),
            lines: csv.lines().map(str::to_owned).collect(),
            csv,
            log,
            chunks,
            page,
        }
    }

    /// Whether each of these ticks is as it was recorded.
    fn has(&self, ticks: &[TickRecord]) -> bool {
        ticks.iter().all(|t| {
            self.ticks.get(&t.tick.0).is_some_and(|u| {
                let same = t.contacts.iter().zip(&u.contacts).all(|(a, b)| a.same_bits(b));
                (t.time, &t.row, t.contacts.len()) == (u.time, &u.row, u.contacts.len()) && same
            })
        })
    }

    /// The ticks of all chunks for which `whole` is true.
    fn of_chunks(&self, whole: impl Fn(usize, &Range<usize>) -> bool) -> BTreeSet<u64> {
        let chunks = self.chunks.iter().enumerate().filter(|(i, (r, _))| whole(*i, r));
        chunks.flat_map(|(_, (_, ticks))| ticks.iter().copied()).collect()
    }
}

/// What was done to a run directory.
struct Mutation {
    words: String,
    /// Ticks whose chunk was left whole: they must be there after a recovery.
    intact: BTreeSet<u64>,
    /// Whether every digest was made to fit: a replay alone can tell.
    forged: bool,
    /// Whether the log is that of the other run.
    other_log: bool,
}

fn splice(bytes: &[u8], parts: &[Range<usize>]) -> Vec<u8> {
    parts.iter().flat_map(|r| bytes[r.clone()].iter().copied()).collect()
}

/// Digits of a text of numbers.
fn edit_digit(bytes: &mut [u8], dice: &mut Dice) {
    let digits: Vec<usize> = (0..bytes.len()).filter(|i| bytes[*i].is_ascii_digit()).collect();
    let at = *dice.of(&digits);
    bytes[at] = b'0' + (bytes[at] - b'0' + 1 + dice.below(9) as u8) % 10;
}

/// All rows again, one of them changed, by the recorder itself: every digest fits.
fn forge(a: &Truth, dir: &Path, dice: &mut Dice) {
    let mut r = RunReader::open(&a.dir).expect("a recording");
    let metadata: BTreeMap<String, String> = r
        .metadata()
        .iter()
        .filter(|(k, _)| !["docktwin_record_schema", "record_digest"].contains(&k.as_str()))
        .map(|(k, v)| (k.clone(), v.clone()))
        .collect();
    let summary = r.summary().expect("readable").expect("a summary");
    let events = r.events().expect("events");
    for name in [files::LOG, files::TABLE, files::EVENTS, files::SUMMARY] {
        fs::remove_file(dir.join(name)).expect("it was there");
    }
    let (columns, pairs) = (r.columns().to_vec(), r.pair_names().to_vec());
    let mut w = RunWriter::create(dir, columns, pairs, &metadata, Policy::Wait).expect("fresh");
    let at = dice.below(a.ticks.len()) as u64;
    let loads: Vec<usize> =
        (0..r.columns().len()).filter(|i| r.columns()[*i].topic == "/loads").collect();
    let column = *dice.of(&loads);
    while let Some(mut t) = r.next_tick().expect("whole") {
        if t.tick.0 == at {
            t.row[column] = docktwin_record::Cell::from(t.row[column].as_f64() * 0.1 + 1.0);
        }
        w.tick(t.tick, t.time, &t.row, &t.contacts).expect("room");
    }
    events.iter().for_each(|e| w.event(e).expect("room"));
    w.finish(&summary).expect("room");
}

#[expect(clippy::too_many_lines, reason = "a table of mutations")]
fn mutate(a: &Truth, b: &Truth, dir: &Path, dice: &mut Dice) -> Mutation {
    let log = dir.join(files::LOG);
    let mut m = Mutation {
        words: String::new(),
        intact: a.of_chunks(|_, _| true),
        forged: false,
        other_log: false,
    };
    let all = files_of(dir);
    let mut named: Vec<PathBuf> = vec![files::LOG.into(); 6];
    named.extend(vec![PathBuf::from(files::SUMMARY); 3]);
    named.extend([files::EVENTS, files::TABLE, files::SCENARIO].map(PathBuf::from));
    named.push(dice.of(&all).clone());
    let file = dice.of(&named).clone();
    let is_log = file == Path::new(files::LOG);
    let mut bytes = fs::read(dir.join(&file)).expect("a file");
    let n = bytes.len();
    match dice.below(13) {
        0..3 => {
            let places: Vec<usize> = (0..=dice.below(4)).map(|_| dice.below(n)).collect();
            places.iter().for_each(|p| bytes[*p] ^= 1 << dice.below(8));
            m.words = format!("bits flipped in {} at {places:?}", file.display());
            if is_log {
                m.intact = a.of_chunks(|_, r| places.iter().all(|p| !r.contains(p)));
                // The numbers of the channels stand in the first chunk, columns in the head.
                if places.iter().any(|p| *p < a.chunks[0].0.start) {
                    m.intact.clear();
                }
            }
            fs::write(dir.join(&file), bytes).expect("room");
        }
        3 => {
            let end = dice.below(n);
            m.words = format!("{} cut at {end} of {n}", file.display());
            if is_log {
                m.intact = a.of_chunks(|_, r| r.end <= end);
            }
            fs::write(dir.join(&file), &bytes[..end]).expect("room");
        }
        4 => {
            m.words = format!("{} removed", file.display());
            if is_log {
                m.intact.clear();
            }
            fs::remove_file(dir.join(&file)).expect("it was there");
        }
        5 => {
            m.words = format!("{} of the other run", file.display());
            if is_log {
                m.intact.clear();
                m.other_log = true;
            }
            if b.dir.join(&file).exists() {
                fs::copy(b.dir.join(&file), dir.join(&file)).expect("room");
            }
        }
        6 => {
            let topics =
                ["/loads", "/contacts", "/relative", "/latches", "/energy", "/tick", "/events"];
            let (topic, factor) = (*dice.of(&topics), [0.1, -1.0, 1.5][dice.below(3)]);
            let at = dice.below(a.ticks.len()) as u32;
            let all_of_them = dice.below(2) == 0;
            let (chunk_size, sorted) =
                ([Some(300), Some(20_000), Some(1 << 22), None][dice.below(4)], dice.below(4) == 0);
            m.words = format!("{topic} × {factor} at {at} ({all_of_them}), chunks {chunk_size:?}");
            let place = dice.below(6);
            m.intact.clear();
            rewrite(
                &log,
                &Rewrite { chunk_size, sorted, metadata_last: false },
                |t, tick, data| {
                    let at = 4 + 8 * place;
                    if t == topic && (all_of_them || tick == at as u32) && data.len() >= at + 8 {
                        scale(data, at, factor);
                    }
                    true
                },
            );
        }
        7 => {
            m.words = "an edited number in summary.json".into();
            let mut text = fs::read(dir.join(files::SUMMARY)).expect("a summary");
            edit_digit(&mut text, dice);
            fs::write(dir.join(files::SUMMARY), text).expect("room");
        }
        8 => {
            m.words = "an edited number in events.jsonl or scenario.toml".into();
            let name = *dice.of(&[files::EVENTS, files::SCENARIO]);
            let mut text = fs::read(dir.join(name)).expect("a text");
            edit_digit(&mut text, dice);
            fs::write(dir.join(name), text).expect("room");
        }
        9 => {
            let (i, j) = (dice.below(a.chunks.len()), dice.below(a.chunks.len()));
            let (x, y) = (a.chunks[i.min(j)].0.clone(), a.chunks[i.max(j)].0.clone());
            let n = a.log.len();
            let kind = dice.below(3);
            m.words = format!("chunk {i} {} (and {j})", ["removed", "doubled", "swapped"][kind]);
            let new = match kind {
                0 => splice(&a.log, &[0..x.start, x.end..n]),
                1 => splice(&a.log, &[0..y.end, x, y.end..n]),
                _ if x == y => a.log.clone(),
                _ => splice(&a.log, &[0..x.start, y.clone(), x.end..y.start, x, y.end..n]),
            };
            m.intact = match kind {
                0 => a.of_chunks(|k, _| k != i.min(j)),
                1 => m.intact,
                // What goes back in time is not taken for data.
                _ => a.of_chunks(|k, _| k < i.min(j) || k >= i.max(j)),
            };
            fs::write(&log, new).expect("room");
        }
        10 => {
            let (from, len) = (dice.below(a.log.len()), 1 + dice.below(5000));
            let to = (from + len).min(a.log.len());
            let mut new = a.log.clone();
            new[from..to].fill(0);
            m.words = format!("zeros from {from} to {to}");
            m.intact = a.of_chunks(|_, r| r.end <= from || r.start >= to);
            if from < a.chunks[0].0.start {
                m.intact.clear();
            }
            fs::write(&log, new).expect("room");
        }
        11 => {
            m.words = "the digests of the rows left out of the log".into();
            rewrite(&log, &Rewrite::default(), |t, _, _| t != "/record_digest");
        }
        _ => {
            m.forged = true;
            m.intact.clear();
            if dice.below(2) == 0 {
                m.words = "a row changed and everything written anew".into();
                forge(a, dir, dice);
            } else {
                // The summary still has the digest of the rows that were.
                m.forged = false;
                m.words = "a bit of a row changed and the chain of the log made anew".into();
                let tick = Tick(dice.below(a.ticks.len()) as u64);
                flip_bit(dir, tick, "port4_force_x_n", dice.below(64) as u32).expect("a bit");
            }
        }
    }
    m
}

fn check_export(m: &Mutation, a: &Truth, b: &Truth, dir: &Path) {
    let Ok(r) = RunReader::open(dir) else { return };
    let (text, cut) = csv(r);
    if cut.is_none() {
        assert!(text == a.csv || m.forged, "other rows were exported without a word");
    }
    let other = |l: &&str| !(a.lines.contains(*l) || m.other_log && b.lines.contains(*l));
    let merely_ends = cut.as_ref().is_none_or(Cut::merely_ends);
    // With every digest of the log made anew the summary tells, and the rows are those of the log.
    let told = cut.as_ref().is_some_and(|c| c.flaw == Flaw::Foreign);
    if merely_ends || !told {
        // Names of columns stand at the head of the log: without a row they say nothing.
        let wrong = text.lines().find(other).filter(|_| text.lines().count() > 1);
        assert!(wrong.is_none() || m.forged, "exported: {wrong:?}, {cut:?}");
    }
    let mut r = RunReader::open(dir).expect("it was opened before");
    let out = std::io::Cursor::new(Vec::new());
    let done = export_mat(&mut r, &Selection::default(), out, true, Path::new("left.mat"));
    assert_eq!(done.expect("damage is a cut").cut, cut);
}

fn check_replay(a: &Truth, dir: &Path) -> bool {
    let Ok(found) = Replay::open(dir).and_then(Replay::run) else { return false };
    if !found.identical() {
        return false;
    }
    let (ticks, cut) = all_ticks(RunReader::open(dir).expect("it was replayed"));
    assert!(a.has(&ticks), "replay called other rows identical");
    assert!(cut.as_ref().is_none_or(Cut::merely_ends), "{cut:?}");
    assert_eq!(found.cut.is_none(), ticks.len() == a.ticks.len() && cut.is_none());
    if found.cut.is_none() && found.figures > 0 {
        let [then, now] = [&a.dir, dir].map(|d| read_summary(d).expect("readable"));
        let [then, now] = [then, now].map(|s| s.expect("a summary").summary);
        assert_eq!(then.peak_force_n.to_bits(), now.peak_force_n.to_bits());
        assert_eq!((then.state_digest, then.outcome), (now.state_digest, now.outcome));
    }
    true
}

fn check_diff(m: &Mutation, a: &Truth, dir: &Path) {
    let Ok(mut r) = RunReader::open(dir) else { return };
    let mut good = RunReader::open(&a.dir).expect("a recording");
    let Ok(found) = first_difference(&mut good, &mut r) else { return };
    // As the command judges.
    let by_cut = found.as_ref().is_some_and(|d| d.column == "end") && r.cut().is_some();
    let same = (found.is_none() || by_cut) && r.cut().is_none_or(Cut::merely_ends);
    if same {
        let (ticks, _) = all_ticks(RunReader::open(dir).expect("it was compared"));
        assert!(a.has(&ticks) || m.forged, "other rows were called the same");
    }
}

fn check_report(m: &Mutation, a: &Truth, dir: &Path, out: &Path) {
    let Ok((written, text)) = page(dir, out) else { return };
    if written.as_recorded && written.incomplete.is_none() {
        if !m.forged {
            let (x, y) =
                (text.split('>').collect::<Vec<_>>(), a.page.split('>').collect::<Vec<_>>());
            let first = x.iter().zip(&y).find(|(p, q)| p != q);
            assert!(
                text == a.page || written_with_note(&text),
                "another page without a word: {first:?}"
            );
        }
        return;
    }
    assert!(!text.contains(">as expected<") && !text.contains(">not as expected<"));
    let warned = text.contains("class=\"warning\"") || text.contains("class=\"note\"");
    assert!(warned, "nothing was said first");
    // Loads are those of all ticks, or are not there.
    let (cut, has_loads) = (
        RunReader::open(dir).ok().and_then(|r| all_ticks(r).1),
        text.contains("<table class=\"loads\">"),
    );
    assert!(cut.is_none() || !has_loads, "loads of a log that was not read whole");
}

/// Events or the table are made good from the log, and it is said.
fn written_with_note(text: &str) -> bool {
    text.contains("events.jsonl") && text.contains("class=\"note\"")
}

fn rows(dir: &Path) -> Option<usize> {
    let table = catch_unwind(|| read_table(dir.join(files::TABLE)).ok()).ok()??;
    table.get("tick").map(Vec::len)
}

fn whole_lines(dir: &Path) -> usize {
    fs::read(dir.join(files::EVENTS)).map_or(0, |b| b.iter().filter(|c| **c == b'\n').count())
}

fn check_recover(m: &Mutation, a: &Truth, b: &Truth, dir: &Path) {
    let before: Vec<(PathBuf, Vec<u8>)> = files_of(dir)
        .into_iter()
        .map(|f| (f.clone(), fs::read(dir.join(&f)).expect("a file")))
        .collect();
    let (rows_before, lines_before) = (rows(dir), whole_lines(dir));
    let done = recover(dir);
    // Whatever was there is there, or beside.
    for (name, bytes) in &before {
        let beside = (1..4).map(|n| match n {
            1 => format!("{}.cut", name.display()),
            n => format!("{}.cut-{n}", name.display()),
        });
        let mut places = core::iter::once(name.display().to_string()).chain(beside);
        let kept = places.any(|p| fs::read(dir.join(p)).is_ok_and(|now| now == *bytes));
        assert!(kept, "{} is lost", name.display());
    }
    let Ok(done) = done else {
        assert_eq!(files_of(dir).len(), before.len(), "a refused recovery left something");
        return;
    };
    assert!(rows(dir) >= rows_before, "a table became shorter: {done:?}");
    assert!(whole_lines(dir) >= lines_before, "events became fewer: {done:?}");
    let (ticks, cut) = all_ticks(RunReader::open(dir).expect("recovered"));
    assert_eq!(ticks.len() as u64, done.ticks);
    assert!(
        a.has(&ticks) || m.forged || m.other_log && b.has(&ticks) || told(cut.as_ref()),
        "a row that was not recorded"
    );
    let flaw = cut.map(|c| c.flaw);
    assert!(matches!(flaw, None | Some(Flaw::Foreign | Flaw::Recovered)), "{flaw:?}");
    let there: BTreeSet<u64> = ticks.iter().map(|t| t.tick.0).collect();
    let lost: Vec<&u64> = m.intact.difference(&there).collect();
    assert!(lost.is_empty(), "lost although whole: {lost:?}, {done:?}");
    if done.as_recorded() {
        assert!(a.has(&ticks) || m.forged, "called whole: {done:?}");
    }
    let again = recover(dir).expect("it was recovered");
    assert!(!again.changed(), "the second recovery changed something: {again:?}");
}

fn told(cut: Option<&Cut>) -> bool {
    cut.is_some_and(|c| c.flaw == Flaw::Foreign)
}

/// All readers on one mutated run. The last to come is recovery, which changes it.
fn check(m: &Mutation, a: &Truth, b: &Truth, dir: &Path, out: &Path) {
    check_export(m, a, b, dir);
    check_diff(m, a, dir);
    check_report(m, a, dir, out);
    let identical = check_replay(a, dir);
    assert!(!(m.forged && identical), "a forged row was called identical");
    check_recover(m, a, b, dir);
    if !m.forged {
        check_report(m, a, dir, out);
    }
}

#[test]
fn invariant_mutated_runs_are_told_and_nothing_is_lost() {
    let asked = |key: &str| std::env::var(key).ok().and_then(|n| n.parse::<u64>().ok());
    let n = asked("DOCKTWIN_MUTATIONS").map_or(MUTATIONS, |n| n as usize);
    let seed = asked("DOCKTWIN_MUTATION_SEED").unwrap_or(7);
    let at = tempfile::tempdir().expect("a folder");
    let (place, out) = (at.path().join("run"), at.path().join("page.html"));
    let [one, two] = [("one", 0.35), ("two", 0.36)].map(|(name, speed)| {
        let dir = at.path().join(name);
        rehearse(speed, &dir);
        dir
    });
    let (a, b) = (Truth::of(&one, &place, &out), Truth::of(&two, &place, &out));
    assert!(a.ticks.len() > 300 && a.chunks.len() >= 6 && a.csv != b.csv);
    assert!(a.ticks.values().any(|t| !t.contacts.is_empty()), "nothing touches");
    let (sender, finished) = mpsc::channel();
    let worker = std::thread::spawn(move || {
        let mut wrong = Vec::new();
        for i in 0..n {
            let mut dice = Dice(seed ^ (i as u64).wrapping_mul(0x2545_f491_4f6c_dd1d));
            copy(&a.dir, &place);
            let m = mutate(&a, &b, &place, &mut dice);
            let done = catch_unwind(AssertUnwindSafe(|| check(&m, &a, &b, &place, &out)));
            if let Err(e) = done {
                let why = e.downcast_ref::<String>().cloned();
                let why = why.or_else(|| e.downcast_ref::<&str>().map(|s| (*s).to_owned()));
                wrong.push(format!("{i}: {}: {}", m.words, why.unwrap_or_default()));
            }
            fs::remove_dir_all(&place).expect("removed");
            // The other end may have given up.
            let _ = sender.send(m.words);
        }
        wrong
    });
    let mut kinds: BTreeMap<String, usize> = BTreeMap::new();
    for i in 0..n {
        let words = finished.recv_timeout(HANGS).unwrap_or_else(|e| panic!("mutation {i}: {e}"));
        let kind: Vec<&str> = words.split(' ').take(2).collect();
        *kinds.entry(kind.join(" ")).or_default() += 1;
    }
    let wrong = worker.join().expect("mutations are checked");
    println!("{n} mutations, seed {seed}: {} wrong; {kinds:?}", wrong.len());
    assert!(wrong.is_empty(), "{} of {n}:\n{}", wrong.len(), wrong.join("\n"));
}
