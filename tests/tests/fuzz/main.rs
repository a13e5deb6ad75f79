//! Everything that reads what strangers write, under damage made by a fuzzer: URDF, TOML of models and of
//! scenarios, messages of the rig port, and recordings.
//!
//! Nothing panics, hangs or eats memory; what is refused says why and what to do; what is accepted is finite and
//! stays so when it is stepped for 50 ms.
//!
//! As a test it replays the corpus (`__fuzz__/TARGET/corpus`) and a fixed sample of new inputs, the same every
//! time. `cargo xtask fuzz TARGET --minutes 10` goes on with random ones. An input that fails becomes a case of
//! `findings.rs`, in plain words.

mod damage;
mod dice;
mod findings;
mod memory;
mod models;
mod port;
mod recordings;
mod world;

use std::collections::BTreeSet;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use models::Damaged;
use world::World;

/// Bytes of an input: the file, and some eight edits.
const LONGEST: usize = 48;
/// Most that one input may ask of the heap: far above what is needed, far below what hurts.
const MOST_BYTES: isize = 96 << 20;
/// What may stay behind after an input, on the average of many: caches that grow once.
const LEFT_BYTES: isize = 4 << 20;
/// Far longer than any input takes, also on a machine that is busy.
const HANGS: Duration = Duration::from_secs(60);
/// Inputs that an endless run keeps for a target, of different outcomes.
const KEPT: usize = 48;

/// Counts inputs that are being tried; a thread looks whether it moves on.
struct Watch {
    name: &'static str,
    begun: AtomicU64,
    ended: AtomicU64,
    input: Mutex<Vec<u8>>,
}

impl Watch {
    /// Ends the process when an input takes too long, and says which.
    fn new(name: &'static str) -> &'static Self {
        let (begun, ended) = (AtomicU64::new(0), AtomicU64::new(0));
        let watch: &'static Self =
            Box::leak(Box::new(Self { name, begun, ended, input: Mutex::default() }));
        std::thread::spawn(move || {
            let (mut at, mut since) = (0, Instant::now());
            loop {
                std::thread::sleep(Duration::from_millis(500));
                let begun = watch.begun.load(Ordering::Relaxed);
                if begun != at || watch.ended.load(Ordering::Relaxed) == begun {
                    (at, since) = (begun, Instant::now());
                } else if since.elapsed() > HANGS {
                    let input = watch.input.lock().unwrap_or_else(PoisonError::into_inner);
                    eprintln!("{}: input {begun} hangs: {input:?}", watch.name);
                    std::process::abort();
                }
            }
        });
        watch
    }

    fn begin(&self, input: &[u8]) {
        let mut last = self.input.lock().unwrap_or_else(PoisonError::into_inner);
        last.clear();
        last.extend_from_slice(input);
        self.begun.fetch_add(1, Ordering::Relaxed);
    }

    fn end(&self) {
        self.ended.fetch_add(1, Ordering::Relaxed);
    }
}

/// What was seen of a target in this process.
struct Seen {
    name: &'static str,
    watch: &'static Watch,
    outcomes: BTreeSet<String>,
    inputs: u64,
    slowest: (Duration, Vec<u8>),
    most: (isize, Vec<u8>),
    /// Bytes in use after the first inputs, which fill what is filled once.
    settled: Option<isize>,
    /// Inputs with a new outcome are added to the corpus.
    keep: bool,
    /// Inputs are printed before they are tried.
    show: bool,
}

impl Seen {
    fn new(name: &'static str) -> Self {
        Self {
            name,
            watch: Watch::new(name),
            outcomes: BTreeSet::new(),
            inputs: 0,
            slowest: Default::default(),
            most: Default::default(),
            settled: None,
            keep: std::env::var_os("DOCKTWIN_FUZZ_KEEP").is_some(),
            show: std::env::var_os("DOCKTWIN_FUZZ_SHOW").is_some(),
        }
    }

    /// Tries one input; `show` tells what it is when it fails.
    fn judge(&mut self, input: &[u8], judge: impl FnOnce() -> String, show: impl Fn() -> String) {
        if self.show {
            eprintln!("{}: {input:?} is\n{}", self.name, show());
        }
        self.watch.begin(input);
        let begin = Instant::now();
        let (outcome, bytes) = memory::peak_of(|| catch_unwind(AssertUnwindSafe(judge)));
        let took = begin.elapsed();
        self.watch.end();
        let outcome = outcome.unwrap_or_else(|why| {
            eprintln!("{}: {input:?} is\n{}", self.name, show());
            resume_unwind(why)
        });
        self.inputs += 1;
        if took > self.slowest.0 {
            self.slowest = (took, input.to_vec());
        }
        if bytes > self.most.0 {
            self.most = (bytes, input.to_vec());
        }
        assert!(bytes < MOST_BYTES, "{}: {bytes} bytes for {input:?}", self.name);
        if self.outcomes.insert(outcome) && self.keep && self.outcomes.len() <= KEPT {
            let folder = corpus(self.name);
            fs::create_dir_all(&folder).expect("room");
            let name: String = input.iter().take(12).map(|b| format!("{b:02x}")).collect();
            let name = format!("x{name}");
            fs::write(folder.join(name), input).expect("room");
        }
        match self.settled {
            None if self.inputs == 200 => self.settled = Some(memory::live()),
            Some(before) => {
                let left = memory::live() - before;
                assert!(left < LEFT_BYTES, "{}: {left} bytes more stay in use", self.name);
            }
            None => {}
        }
    }

    fn tell(&self) {
        println!(
            "{}: {} inputs, {} outcomes, slowest {:.3} s {:?}, most {:.1} MB {:?}",
            self.name,
            self.inputs,
            self.outcomes.len(),
            self.slowest.0.as_secs_f64(),
            self.slowest.1,
            self.most.0 as f64 / 1e6,
            self.most.1
        );
    }
}

fn corpus(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/__fuzz__").join(name).join("corpus")
}

/// The corpus and a fixed sample of `n` inputs; random ones for as long as bolero is asked to.
fn fuzz(name: &'static str, n: u64, mut judge: impl FnMut(&mut Seen, &[u8])) {
    let mut seen = Seen::new(name);
    let asked = |key| std::env::var_os(key).is_some();
    let long = asked("BOLERO_RANDOM_TEST_TIME_MS") || asked("BOLERO_RANDOM_ITERATIONS");
    let target = bolero::check!(name = name).with_max_len(LONGEST);
    let target = if long { target } else { target.with_iterations(0) };
    {
        let both = Mutex::new((&mut seen, &mut judge));
        target.for_each(|input: &[u8]| {
            let mut both = both.lock().unwrap_or_else(PoisonError::into_inner);
            let (seen, judge) = &mut *both;
            judge(seen, input);
        });
    }
    if !long {
        for i in 0..n {
            judge(&mut seen, &sample(i));
        }
    }
    seen.tell();
}

/// The same bytes every time (splitmix64 of Steele, Lea and Flood 2014), 4 to 48 of them.
fn sample(i: u64) -> Vec<u8> {
    let mut x = i.wrapping_mul(0x2545_f491_4f6c_dd1d);
    let mut next = || {
        x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = x;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    let words = 1 + next() % 6;
    let bytes: Vec<u8> = (0..words).flat_map(|_| next().to_le_bytes()).collect();
    bytes[..bytes.len() - (next() % 5) as usize].to_vec()
}

fn shown(d: &Damaged) -> String {
    format!("{}:\n{}", d.name, String::from_utf8_lossy(&d.text))
}

#[test]
fn urdf() {
    let world = World::new();
    fuzz("urdf", 250, |seen, input| {
        let d = models::urdf(&world, input);
        seen.judge(input, || models::judge_model(&world, &d), || shown(&d));
    });
}

#[test]
fn model_toml() {
    let world = World::new();
    fuzz("model_toml", 250, |seen, input| {
        let d = models::model_toml(&world, input);
        seen.judge(input, || models::judge_model(&world, &d), || shown(&d));
    });
}

/// The files of a folder on the disk, one of them damaged, as `model check` sees them.
#[test]
fn model_check() {
    let world = World::new();
    let dir = tempfile::tempdir().expect("a folder");
    let place = |name: &str| dir.path().join(name);
    fs::create_dir_all(place("models/urdf")).expect("room");
    for name in world.files.keys().filter(|n| n.starts_with("models/")) {
        fs::write(place(name), &world.files[name]).expect("room");
    }
    for i in 0..200 {
        let input = sample(i);
        let d = if i % 2 == 0 {
            models::urdf(&world, &input)
        } else {
            models::model_toml(&world, &input)
        };
        fs::write(place(&d.name), &d.text).expect("room");
        let judged = catch_unwind(|| {
            let report = docktwin_model::model_check(&place(&d.name));
            if !report.problems.is_empty() {
                world::refused(&report.problems);
            }
        });
        if let Err(why) = judged {
            eprintln!("{}", shown(&d));
            resume_unwind(why);
        }
        fs::write(place(&d.name), &world.files[&d.name]).expect("room");
    }
}

#[test]
fn scenario_toml() {
    let world = World::new();
    fuzz("scenario_toml", 250, |seen, input| {
        let d = models::scenario_toml(&world, input);
        seen.judge(input, || models::judge_scenario(&world, &d), || shown(&d));
    });
}

#[test]
fn rig_port() {
    let start = port::Start::new(&World::new());
    fuzz("rig_port", 200, |seen, input| {
        seen.judge(input, || port::judge(&start, input), || "messages".to_owned());
    });
}

#[test]
fn recordings() {
    let start = recordings::Start::new(&World::new());
    fuzz("recordings", 60, |seen, input| {
        seen.judge(input, || recordings::judge(&start, input), || "a log".to_owned());
    });
}
