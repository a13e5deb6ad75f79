//! The shipped files with random damage: each loads, or is refused with a file and a remedy. What
//! loads can be started and stepped. Nothing panics.
//!
//! The same damage every time. More of it: `DOCKTWIN_MUTATIONS=100000 cargo test --workspace --test
//! mutated_inputs`.

use std::{
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    process::Command,
};

use docktwin_model::{Problem, input::is_unprintable, model_check};
use docktwin_physics::reduced::{DockingTwin, Inputs, ReducedTwin};
use docktwin_record::{RunReader, files};
use docktwin_run::setup::start;
use docktwin_scenario::load_scenario;

/// Files damaged in a run of the tests.
fn rounds() -> u64 {
    std::env::var("DOCKTWIN_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(1000)
}

/// splitmix64 (Steele, Lea, Flood 2014).
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
        usize::try_from(self.next() % n.max(1) as u64).expect("below n")
    }
}

/// What stands in for a number.
const NUMBERS: [&str; 28] = [
    "0",
    "-1",
    "-0.0",
    "1e308",
    "-1e308",
    "nan",
    "inf",
    "-inf",
    "1e-320",
    "1e-9",
    "1e-3",
    "0.5",
    "1",
    "2",
    "3",
    "12",
    "1e6",
    "1e9",
    "1e12",
    "1e18",
    "4294967296",
    "9223372036854775808",
    "1_0",
    "0x7f",
    "true",
    "\"text\"",
    "[]",
    "{}",
];
/// What is put between.
const WORDS: [&str; 18] = [
    "\u{1b}[31m",
    "\0",
    "é",
    "\u{202e}",
    "\"",
    "'",
    "[",
    "]",
    "{",
    "}",
    "<",
    ">",
    "&",
    "=",
    "\n",
    "#",
    ".",
    "&#x9b;",
];

/// Damages a text in one to three places.
fn damage_text(good: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut b = good.to_vec();
    for _ in 0..=dice.below(3) {
        if b.is_empty() {
            break;
        }
        let at = dice.below(b.len());
        let to = (at + 1 + dice.below(40)).min(b.len());
        match dice.below(9) {
            0 => b[at] ^= 1 << dice.below(8),
            1 => b.truncate(at),
            2 => drop(b.drain(at..to)),
            3 => {
                let piece = b[at..to].to_vec();
                let there = dice.below(b.len());
                b.splice(there..there, piece);
            }
            4 => drop(b.splice(at..at, WORDS[dice.below(WORDS.len())].bytes())),
            5 => swap_lines(&mut b, dice),
            _ => replace_number(&mut b, dice),
        }
    }
    b
}

fn swap_lines(b: &mut Vec<u8>, dice: &mut Dice) {
    let mut lines: Vec<Vec<u8>> = b.split(|c| *c == b'\n').map(<[u8]>::to_vec).collect();
    let (i, j) = (dice.below(lines.len()), dice.below(lines.len()));
    lines.swap(i, j);
    *b = lines.join(&b'\n');
}

/// Puts another number in place of one behind `=`, a quote, a comma or a space.
fn replace_number(b: &mut Vec<u8>, dice: &mut Dice) {
    let digit = |c: u8| c.is_ascii_digit() || matches!(c, b'.' | b'-' | b'e' | b'+');
    let begins: Vec<usize> = (1..b.len())
        .filter(|i| {
            (b[*i].is_ascii_digit() || b[*i] == b'-')
                && matches!(b[i - 1], b' ' | b'"' | b'[' | b',')
        })
        .collect();
    if begins.is_empty() {
        return;
    }
    let at = begins[dice.below(begins.len())];
    let to = (at..b.len()).find(|i| !digit(b[*i])).unwrap_or(b.len());
    b.splice(at..to, NUMBERS[dice.below(NUMBERS.len())].bytes());
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn says_enough(problems: &[Problem]) {
    assert!(!problems.is_empty(), "refused without a reason");
    for p in problems {
        let text = p.to_string();
        assert!(!p.file.as_os_str().is_empty(), "no file: {text}");
        assert!(!p.key.is_empty() && !p.what.is_empty() && !p.remedy.is_empty(), "{p:?}");
        assert!(!text.chars().any(is_unprintable), "{text:?}");
        assert!(text.len() < 5000, "{text}");
    }
}

/// Loads a scenario; what loads has finite numbers and takes some steps.
fn load(path: &Path) {
    match load_scenario(path, &[]) {
        Err(e) => says_enough(&e.problems),
        Ok(s) => {
            let numbers = format!(
                "{:?}{:?}{:?}{:?}{:?}{:?}",
                s.initial, s.run, s.thrusts, s.mechanism, s.chaser, s.target
            );
            for word in ["NaN", ": inf", "-inf", "(inf"] {
                assert!(!numbers.contains(word), "{word} in {numbers}");
            }
            assert!(s.run.ticks() <= 100_000_000);
            if let Ok((system, bodies)) = start(&s) {
                let mut twin = ReducedTwin::new(system, bodies, 1e-4);
                (0..20).for_each(|_| twin.step(&Inputs::default()));
            }
        }
    }
}

#[test]
fn invariant_damaged_text_files_load_or_are_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut texts = Vec::new();
    for (folder, keep) in [("models/urdf", true), ("meshes", false), ("scenarios", true)] {
        fs::create_dir_all(dir.path().join(folder)).expect("a folder");
        let mut names: Vec<_> = fs::read_dir(root().join(folder))
            .expect("files")
            .map(|f| f.expect("a file").file_name())
            .collect();
        names.sort();
        for name in names {
            let to = dir.path().join(folder).join(&name);
            fs::copy(root().join(folder).join(&name), &to).expect("copied");
            if keep {
                texts.push((to, fs::read(root().join(folder).join(&name)).expect("a file")));
            }
        }
    }
    // Model files are seen through scenarios that name them.
    let scenarios: Vec<(PathBuf, String)> = texts
        .iter()
        .filter(|(p, _)| p.parent().is_some_and(|d| d.ends_with("scenarios")))
        .map(|(p, b)| (p.clone(), String::from_utf8_lossy(b).into_owned()))
        .collect();
    let mut dice = Dice(1);
    for round in 0..rounds() {
        let (path, good) = &texts[dice.below(texts.len())];
        let bad = damage_text(good, &mut dice);
        fs::write(path, &bad).expect("written");
        let stem = path.file_stem().expect("a name").to_string_lossy().into_owned();
        let seen = catch_unwind(AssertUnwindSafe(|| {
            if path.parent().is_some_and(|d| d.ends_with("scenarios")) {
                load(path);
            } else {
                let report = model_check(path);
                if !report.problems.is_empty() {
                    says_enough(&report.problems);
                }
                let user =
                    scenarios.iter().find(|(_, text)| text.contains(&format!("/{stem}.urdf")));
                if let Some((scenario, _)) = user {
                    load(scenario);
                }
            }
        }));
        if seen.is_err() {
            panic!("round {round}, {}:\n{}", path.display(), String::from_utf8_lossy(&bad));
        }
        fs::write(path, good).expect("written");
    }
}

/// Damages bytes in one to three places.
fn damage_bytes(good: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut b = good.to_vec();
    for _ in 0..=dice.below(3) {
        if b.len() < 16 {
            break;
        }
        // The head and the records' own fields are hit as often as the numbers within.
        let span = if dice.below(2) == 0 { b.len().min(4000) } else { b.len() };
        let at = dice.below(span - 8);
        match dice.below(6) {
            0 => b[at] ^= 1 << dice.below(8),
            1 => b.truncate(at),
            2 => {
                let to = (at + 1 + dice.below(1000)).min(b.len());
                b.drain(at..to);
            }
            3 => {
                let n = [0, 1, 1 << 31, 1 << 40, 1 << 60, u64::MAX][dice.below(6)];
                b[at..at + 8].copy_from_slice(&n.to_le_bytes());
            }
            4 => {
                let n = dice.next();
                b[at..at + 8].copy_from_slice(&n.to_le_bytes());
            }
            _ => {
                let piece =
                    b[at..(at + dice.below(500)).min(good.len()).min(b.len()).max(at)].to_vec();
                b.splice(at..at, piece);
            }
        }
    }
    b
}

#[test]
fn invariant_damaged_recordings_are_read_up_to_the_damage_or_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let run = dir.path().join("run");
    let done = Command::new(env!("CARGO_BIN_EXE_docktwin"))
        .current_dir(root())
        .args(["rehearse", "scenarios/basic_central_impact.toml", "--twin", "reduced", "--no-rrd"])
        .args(["--set", "run.duration_s=0.2", "--out"])
        .arg(&run)
        .output()
        .expect("docktwin starts");
    assert!(matches!(done.status.code(), Some(0 | 1)), "{}", String::from_utf8_lossy(&done.stderr));
    let good: Vec<(PathBuf, Vec<u8>)> =
        [files::LOG, files::LOG, files::LOG, files::SUMMARY, files::EVENTS]
            .map(|f| (run.join(f), fs::read(run.join(f)).expect("a file")))
            .into();
    let mut dice = Dice(2);
    for round in 0..rounds() {
        let (path, bytes) = &good[dice.below(good.len())];
        let bad = damage_bytes(bytes, &mut dice);
        fs::write(path, &bad).expect("written");
        let read = catch_unwind(|| {
            let mut reader = match RunReader::open(&run) {
                Ok(reader) => reader,
                Err(e) => return assert!(e.to_string().contains("run"), "{e}"),
            };
            let mut ticks = 0;
            while let Some(t) = reader.next_tick().expect("damage is a cut") {
                assert_eq!(t.row.len(), reader.columns().len());
                ticks += 1;
            }
            // Bits that a checksum covers never come out changed; a copied chunk may come twice.
            assert!(
                ticks == 201 || reader.cut().is_some() || bad.len() != bytes.len(),
                "{ticks} ticks, no cut"
            );
            for e in [reader.summary().err(), reader.events().err()].into_iter().flatten() {
                assert!(e.to_string().contains("run"), "{e}");
            }
        });
        assert!(read.is_ok(), "round {round}, {}", path.display());
        fs::write(path, bytes).expect("written");
    }
}
