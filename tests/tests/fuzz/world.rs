//! The shipped models and scenarios in memory, and what a model or scenario that was accepted must do.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use docktwin_model::input::is_unprintable;
use docktwin_model::{Problem, Sources};
use docktwin_physics::reduced::Inputs;
use docktwin_run::{Rehearsal, RehearsalOptions, RunError, SummaryOnly, TwinKind};
use docktwin_scenario::Scenario;

/// Where the files stand; no such folder is on the disk.
const PLACE: &str = "/fuzzed";
/// How long an accepted model is stepped, s.
const STEPPED_S: f64 = 0.05;
/// And at most so many steps.
const MOST_STEPS: u64 = 4000;

/// Every text file that is shipped, by its path from the root of the repository.
pub(crate) struct World {
    pub(crate) files: BTreeMap<String, Vec<u8>>,
    pub(crate) sources: Sources,
}

impl World {
    pub(crate) fn new() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let (mut files, mut sources) = (BTreeMap::new(), Sources::memory());
        for folder in ["models/urdf", "scenarios", "meshes"] {
            for entry in fs::read_dir(root.join(folder)).expect("a folder of the repository") {
                let path = entry.expect("an entry").path();
                let name = path.file_name().expect("a name").to_string_lossy().into_owned();
                let name = format!("{folder}/{name}");
                // Of a mesh it only counts that it is there.
                let mesh = folder == "meshes";
                let bytes = if mesh { Vec::new() } else { fs::read(&path).expect("a file") };
                sources = sources.with(place(&name), bytes.clone());
                if !mesh {
                    files.insert(name, bytes);
                }
            }
        }
        Self { files, sources }
    }

    /// Names of the files in a folder with an ending.
    pub(crate) fn names(&self, folder: &str, ending: &str) -> Vec<&str> {
        let fits = |n: &&str| n.starts_with(folder) && n.ends_with(ending);
        self.files.keys().map(String::as_str).filter(fits).collect()
    }

    /// All files, one of them with another content.
    pub(crate) fn with(&self, name: &str, content: &[u8]) -> Sources {
        self.sources.clone().with(place(name), content)
    }
}

/// Where a file stands.
pub(crate) fn place(name: &str) -> PathBuf {
    Path::new(PLACE).join(name)
}

/// A refusal names a file, a key and a remedy, and can be printed. Gives what kind of refusal it is.
pub(crate) fn refused(problems: &[Problem]) -> String {
    assert!(!problems.is_empty(), "refused without a reason");
    for p in problems {
        let text = p.to_string();
        assert!(!p.file.as_os_str().is_empty(), "no file: {text}");
        assert!(!p.key.is_empty() && !p.what.is_empty() && !p.remedy.is_empty(), "{p:?}");
        assert!(!text.chars().any(is_unprintable), "{text:?}");
        assert!(text.len() < 5000, "{text}");
    }
    let kind = |p: &Problem| format!("{}: {}", plain(&p.key), plain(&p.what));
    kind(&problems[0])
}

/// Words alone: what differs from number to number and from name to name is one kind.
fn plain(text: &str) -> String {
    let unquoted = text.split('`').step_by(2).collect::<String>();
    let words = unquoted.split(|c: char| !c.is_alphabetic());
    let words: Vec<&str> = words.filter(|w| w.len() > 2).take(12).collect();
    words.join(" ")
}

/// A refusal by the run.
pub(crate) fn refused_run(e: &RunError) -> String {
    match e {
        RunError::Input { problems } => refused(problems),
        other => {
            let text = other.to_string();
            assert!(!text.is_empty() && text.len() < 20_000, "{text:?}");
            let says = !other.remedy().is_empty() || text.contains(':') || text.contains(';');
            assert!(says, "no remedy: {text}");
            plain(&text)
        }
    }
}

/// What was accepted has finite numbers and steps for 50 ms, during which it stays finite and does not double its
/// kinetic energy.
pub(crate) fn steps(s: &Scenario) -> String {
    let numbers = format!(
        "{:?}{:?}{:?}{:?}{:?}{:?}",
        s.initial, s.run, s.thrusts, s.mechanism, s.chaser, s.target
    );
    for word in ["NaN", ": inf", "-inf", "(inf", "[inf"] {
        assert!(!numbers.contains(word), "{word} in {numbers}");
    }
    assert!(s.run.ticks() <= 100_000_000);
    let options = RehearsalOptions { twin: TwinKind::Reduced, seed: 0 };
    let run = match Rehearsal::with(s, options) {
        Ok(run) => run,
        Err(e) => return refused_run(&e),
    };
    let mut run = run.begin(SummaryOnly).expect("it writes nothing");
    let kinetic_j = |run: &docktwin_run::RunningRehearsal<'_, SummaryOnly>| {
        let moving = run.system().mass().iter().zip(&run.now().state.bodies);
        moving.map(|(m, b)| 0.5 * m.mass() * b.v.length_squared()).sum::<f64>()
    };
    let before_j = kinetic_j(&run);
    let steps = u64::from(TwinKind::Reduced.steps_per_tick(s));
    let ticks = (STEPPED_S * 1e9 / s.run.tick_nanos as f64).ceil() as u64;
    for _ in 0..ticks.min((MOST_STEPS / steps).max(1)) {
        run.tick(&Inputs::default());
    }
    let after_j = kinetic_j(&run);
    let touched = run.now().state.first_contact_s.is_some();
    let (summary, _) = run.finish();
    let why = summary.failure_reason.unwrap_or_default();
    assert!(!why.contains("is not finite"), "accepted, and then {why}");
    if s.thrusts.is_empty() {
        assert!(
            after_j <= 2.0 * before_j + 1.0,
            "accepted, and then {before_j:.3e} J became {after_j:.3e} J: {}, {why}",
            summary.outcome
        );
    }
    format!("stepped: {} {touched}", summary.outcome)
}
