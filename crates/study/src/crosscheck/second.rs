//! The second engine as a process: found, run, and what it answers.

use std::{
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use docktwin_record::{Outcome, Summary, Verdict};
use docktwin_scenario::{ExpectedOutcome, Measured, Scenario};
use serde::{Deserialize, Serialize};

/// What shows that a directory is docktwin's `validation`.
const ENTRY: &str = "mujoco/docktwin_mujoco/__main__.py";

/// What the second engine reports of its run, beside its tables.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EngineResult {
    /// Name and version.
    pub engine: String,
    /// Step, s.
    pub step_s: f64,
    /// Name of the integrator.
    pub integrator: String,
    /// How the docking ended.
    pub outcome: Outcome,
    /// Why, in words.
    pub reason: String,
    /// When that was decided, s.
    pub decided_s: f64,
    /// End of the run, s.
    pub end_s: f64,
    /// First contact, s.
    pub first_contact_s: Option<f64>,
    /// Capture, s.
    pub capture_s: Option<f64>,
    /// Each latch, s.
    pub latches_s: Vec<Option<f64>>,
    /// Largest contact force, N.
    pub peak_force_n: f64,
    /// Largest contact moment, N·m.
    pub peak_moment_nm: f64,
    /// Deepest penetration, m.
    pub peak_penetration_m: f64,
    /// Impulse of the contact force, N·s.
    pub impulse_ns: f64,
    /// Rows of its table.
    pub ticks: u64,
    /// Computing time, s.
    pub wall_s: f64,
}

/// Why the second engine gives no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EngineError {
    /// A directory that was named is not docktwin's `validation`.
    #[error("not docktwin's validation directory: {}", path.display())]
    NotValidation {
        /// As named.
        path: PathBuf,
    },
    /// The directory `validation` was not found.
    #[error("docktwin's directory `validation` is neither above the scenario nor above here")]
    NoValidation,
    /// No interpreter was named, and there is none where it is usually installed.
    #[error("there is no Python with MuJoCo here")]
    NoPython {
        /// Commands that install one.
        install: String,
    },
    /// The interpreter has not what the second engine needs.
    #[error("this Python has no MuJoCo for docktwin ({why}): {}", python.display())]
    Incomplete {
        /// The interpreter.
        python: PathBuf,
        /// What it said.
        why: String,
        /// Commands that install one.
        install: String,
    },
    /// The process could not be started.
    #[error("cannot start {}: {why}", python.display())]
    Start {
        /// The interpreter.
        python: PathBuf,
        /// The system's words.
        why: String,
    },
    /// The process failed.
    #[error("MuJoCo's side did not run ({status}): {stderr}")]
    Exit {
        /// Exit status, in words.
        status: String,
        /// What it wrote to its error output.
        stderr: String,
    },
    /// Its answer is not what it should be.
    #[error("MuJoCo's side gave no result that can be read: {why}")]
    Answer {
        /// Where and why.
        why: String,
    },
}

impl EngineError {
    /// What to do about it.
    #[must_use]
    pub fn remedy(&self) -> String {
        match self {
            Self::NotValidation { .. } => format!("give the one that holds {ENTRY}"),
            Self::NoValidation => "name it".to_owned(),
            Self::NoPython { install } | Self::Incomplete { install, .. } => {
                format!("install it:\n{install}\nor name a Python that has it")
            }
            Self::Start { .. } | Self::Exit { .. } | Self::Answer { .. } => {
                "docktwin's own run is written; what the second engine can run is in \
                 validation/README.md"
                    .to_owned()
            }
        }
    }
}

/// Where the second engine is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SecondEngine {
    python: PathBuf,
    validation: PathBuf,
}

/// A recorded run, and how the second engine is to run it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EngineRun<'a> {
    /// Run directory of docktwin's run.
    pub run: &'a Path,
    /// Directory for the second engine's tables.
    pub tables: &'a Path,
    /// Its step, ms, a whole fraction of the tick.
    pub step_ms: f64,
    /// Where its compiled code is kept; without one, where its environment says.
    pub cache: Option<&'a Path>,
}

impl SecondEngine {
    /// Finds the Python side (`validation`: that one, or the one at or above the scenario or the
    /// working directory) and an interpreter that has what it needs (`python`: that one, or the one
    /// that `cargo xtask test` installs beside it).
    ///
    /// # Errors
    /// See [`EngineError`].
    pub fn find(
        scenario: &Path,
        validation: Option<&Path>,
        python: Option<&Path>,
    ) -> Result<Self, EngineError> {
        let validation = match validation {
            Some(dir) if dir.join(ENTRY).is_file() => dir.to_owned(),
            Some(dir) => return Err(EngineError::NotValidation { path: dir.to_owned() }),
            None => {
                near(scenario).or_else(|| near(Path::new("."))).ok_or(EngineError::NoValidation)?
            }
        };
        let validation = std::path::absolute(&validation).unwrap_or(validation);
        let target = validation.with_file_name("target");
        let kept = target.join("venv-validation/bin/python");
        let install = format!(
            "  python3 -m venv {venv}\n  {venv}/bin/pip install -r {requirements}",
            venv = target.join("venv-validation").display(),
            requirements = validation.join("requirements.txt").display(),
        );
        let named = python.map(Path::to_owned);
        let Some(python) = named.or_else(|| kept.is_file().then_some(kept)) else {
            return Err(EngineError::NoPython { install });
        };
        let answer = Command::new(&python)
            .args(["-c", "import mujoco, numba, pyarrow"])
            .stdin(Stdio::null())
            .output();
        let why = match answer {
            Ok(o) if o.status.success() => return Ok(Self { python, validation }),
            Ok(o) => {
                let text = String::from_utf8_lossy(&o.stderr).trim().to_owned();
                text.lines().last().unwrap_or("it failed without a word").to_owned()
            }
            Err(e) => e.to_string(),
        };
        Err(EngineError::Incomplete { python, why, install })
    }

    /// Where compiled code is kept beside other things that are built.
    #[must_use]
    pub fn default_cache(&self) -> PathBuf {
        self.validation.with_file_name("target").join("numba")
    }

    /// Runs a recorded run once more. Its tables go to a directory of their own.
    ///
    /// # Errors
    /// See [`EngineError`].
    pub fn run(&self, what: &EngineRun<'_>) -> Result<EngineResult, EngineError> {
        let mut c = Command::new(&self.python);
        c.args(["-m", "docktwin_mujoco"]).arg(what.run).arg(what.tables);
        c.args(["--step-ms", &what.step_ms.to_string()]);
        c.env("PYTHONPATH", self.validation.join("mujoco")).env("OMP_NUM_THREADS", "1");
        if let Some(cache) = what.cache {
            c.env("NUMBA_CACHE_DIR", cache);
        }
        let o = c
            .stdin(Stdio::null())
            .output()
            .map_err(|e| EngineError::Start { python: self.python.clone(), why: e.to_string() })?;
        if !o.status.success() {
            let stderr = String::from_utf8_lossy(&o.stderr).trim().to_owned();
            return Err(EngineError::Exit { status: o.status.to_string(), stderr });
        }
        serde_json::from_slice(&o.stdout).map_err(|e| EngineError::Answer { why: e.to_string() })
    }
}

/// The directory `validation` at or above a path.
fn near(path: &Path) -> Option<PathBuf> {
    let path = std::path::absolute(path).ok()?;
    path.ancestors().map(|d| d.join("validation")).find(|d| d.join(ENTRY).is_file())
}

/// The second engine's run as a summary like any other; its verdict is that of the scenario's
/// `expect`. Energies and momentum are not numbers: it does not compute them.
#[must_use]
pub fn engine_summary(scenario: &Scenario, r: &EngineResult) -> Summary {
    let outcome = match r.outcome {
        Outcome::Captured => ExpectedOutcome::Captured,
        Outcome::Rebounded => ExpectedOutcome::Rebounded,
        Outcome::Missed => ExpectedOutcome::Missed,
        Outcome::Jammed => ExpectedOutcome::Jammed,
        Outcome::LimitExceeded | Outcome::Stopped => ExpectedOutcome::LimitExceeded,
    };
    let failures = scenario.expect.failures(&Measured {
        outcome,
        first_contact_s: r.first_contact_s,
        capture_s: r.capture_s,
        duration_s: r.end_s,
        peak_force_n: r.peak_force_n,
        peak_moment_nm: r.peak_moment_nm,
        peak_penetration_m: r.peak_penetration_m,
        impulse_ns: r.impulse_ns,
        exit_speed_m_s: None,
    });
    let verdict = if failures.is_empty() { Verdict::Pass } else { Verdict::Fail };
    Summary {
        failure_reason: (!failures.is_empty()).then(|| failures.join("; ")),
        first_contact_s: r.first_contact_s,
        capture_s: r.capture_s,
        latches_s: r.latches_s.clone(),
        peak_force_n: r.peak_force_n,
        peak_moment_nm: r.peak_moment_nm,
        impulse_ns: r.impulse_ns,
        peak_penetration_m: r.peak_penetration_m,
        duration_s: r.end_s,
        ticks: r.ticks,
        wall_s: r.wall_s,
        realtime_factor: r.end_s / r.wall_s.max(1e-9),
        not_judged: scenario.expect.not_judged_without_rig(),
        ..Summary::new(&scenario.name, r.outcome, verdict)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use docktwin_scenario::load_scenario;
    use serde_json::json;

    use super::*;

    /// As the second engine answers.
    pub(in crate::crosscheck) fn result() -> EngineResult {
        serde_json::from_value(json!({
            "engine": "MuJoCo 4.0.0", "integrator": "RK4", "step_s": 2e-4, "outcome": "jammed",
            "reason": "1 of 3", "decided_s": 0.09, "end_s": 0.09, "first_contact_s": 0.003,
            "capture_s": null, "latches_s": [null, 0.05, null], "peak_force_n": 12.5,
            "peak_moment_nm": 3.0, "peak_penetration_m": 1e-3, "impulse_ns": 0.25, "ticks": 90,
            "wall_s": 1.0,
        }))
        .expect("its answer")
    }

    fn root() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
    }

    #[test]
    fn oracle_the_verdict_is_that_of_the_scenario() {
        let file = root().join("scenarios/apas_fast.toml");
        let scenario = load_scenario(&file, &[]).expect("shipped");
        let s = engine_summary(&scenario, &result());
        // The scenario expects a capture.
        assert_eq!((s.outcome, s.verdict), (Outcome::Jammed, Verdict::Fail));
        assert!(s.failure_reason.is_some_and(|why| why.contains("captured")));
        assert_eq!(s.latches_s, [None, Some(0.05), None]);
        assert!(s.energy_balance_error.is_nan(), "not computed");
    }

    #[test]
    fn regress_what_is_missing_is_named_with_what_to_do() {
        let at = tempfile::tempdir().expect("a folder");
        let find = |validation: Option<&Path>, python: Option<&Path>| {
            SecondEngine::find(&at.path().join("a.toml"), validation, python).expect_err("missing")
        };
        let e = find(Some(at.path()), None);
        assert_eq!(e, EngineError::NotValidation { path: at.path().to_owned() });
        assert!(e.remedy().contains(ENTRY));
        let (validation, python) = (root().join("validation"), Path::new("/no/such/python"));
        let e = find(Some(&validation), Some(python));
        assert!(matches!(&e, EngineError::Incomplete { python: p, .. } if p == python), "{e}");
        assert!(e.remedy().contains("-m venv") && e.remedy().contains("requirements.txt"));
    }

    #[test]
    fn invariant_a_process_that_fails_or_prints_something_else_gives_no_result() {
        let at = tempfile::tempdir().expect("a folder");
        let run = |python: &str| {
            let engine = SecondEngine { python: python.into(), validation: root() };
            let (run, tables) = (at.path().join("run"), at.path().join("tables"));
            let what = EngineRun { run: &run, tables: &tables, step_ms: 0.2, cache: None };
            engine.run(&what).expect_err("no engine")
        };
        assert!(matches!(run("/no/such/python"), EngineError::Start { .. }));
        assert!(matches!(run("false"), EngineError::Exit { .. }));
        assert!(matches!(run("echo"), EngineError::Answer { .. }));
    }

    #[test]
    fn invariant_the_result_survives_json() {
        let text = serde_json::to_string(&result()).expect("JSON");
        assert_eq!(serde_json::from_str::<EngineResult>(&text).expect("JSON"), result());
    }
}
