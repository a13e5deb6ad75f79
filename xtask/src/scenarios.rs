//! Every scenario with both twins through the command line, and replay.

use std::{
    path::{Path, PathBuf},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
};

use serde_json::Value;

use crate::shell;

const TWINS: [&str; 2] = ["full", "reduced"];
/// Against the emulated rig instead of a twin.
const HIL: &str = "hil";
/// Scenarios with attitudes or distances beyond the workspace of the rig; `hil` refuses them.
const BEYOND_THE_RIG: [&str; 3] = ["apas_rebound", "basic_guide_guide", "free_flight"];
/// The recordings that are replayed.
const REPLAYED: &str = "apas_nominal";
/// Energy that may be unaccounted for, relative to the energy put in.
const ENERGY_BOUND: f64 = 1e-3;

/// Momentum that may be unaccounted for, relative to the approaching vehicle's: rounding in our
/// integrator, per second; rapier's explicit gyroscopic term in the full twin.
fn momentum_bound(twin: &str, duration_s: f64) -> f64 {
    if twin == "reduced" { 1e-12 * duration_s.max(1.0) } else { 1e-6 }
}

/// Where the recordings of the gate are.
fn folder(root: &Path) -> PathBuf {
    shell::target(root).join("scenario-runs")
}

/// Names of the files under `scenarios/`, sorted.
fn names(root: &Path) -> Result<Vec<String>, String> {
    let entries = std::fs::read_dir(root.join("scenarios"))
        .map_err(|e| format!("scenarios/ cannot be read ({e})"))?;
    let mut names = Vec::new();
    for entry in entries {
        let path = entry.map_err(|e| format!("scenarios/ cannot be read ({e})"))?.path();
        if path.extension().is_some_and(|e| e == "toml") {
            names.extend(path.file_stem().map(|n| n.to_string_lossy().into_owned()));
        }
    }
    names.sort();
    if names.is_empty() {
        Err("there is no scenario under scenarios/".to_owned())
    } else {
        Ok(names)
    }
}

/// What became of one rehearsal.
struct Ran {
    scenario: String,
    twin: &'static str,
    /// The summary, when there is one.
    summary: Value,
    /// What is wrong, if anything.
    wrong: Option<String>,
}

fn rehearse(root: &Path, scenario: &str, twin: &'static str) -> Ran {
    let out = folder(root).join(format!("{scenario}-{twin}"));
    let file = Path::new("scenarios").join(format!("{scenario}.toml"));
    let mut c = if twin == HIL {
        let mut c = shell::command(root, shell::binary(root), &["hil", "--rig", "emulated"]);
        c.arg(file);
        c
    } else {
        let mut c = shell::command(root, shell::binary(root), &["rehearse", "--twin", twin]);
        c.arg(file);
        c
    };
    c.args(["--json", "--no-rrd", "--out"]).arg(out);
    let mut ran = Ran { scenario: scenario.to_owned(), twin, summary: Value::Null, wrong: None };
    match shell::capture(&mut c) {
        Err(e) => ran.wrong = Some(e),
        Ok((stdout, code, stderr)) => {
            ran.summary = serde_json::from_str(&stdout).unwrap_or_default();
            ran.wrong = if twin == HIL && BEYOND_THE_RIG.contains(&scenario) {
                (code != Some(2)).then(|| format!("exit {code:?}, not refused as beyond the rig"))
            } else if code == Some(0) {
                check(&ran.summary, twin)
            } else {
                let reason = ran.summary["failure_reason"].as_str();
                Some(format!("exit {code:?}: {}", reason.unwrap_or(stderr.trim())))
            };
        }
    }
    ran
}

/// What a summary must hold beside its verdict.
fn check(s: &Value, twin: &str) -> Option<String> {
    let number = |key: &str| s[key].as_f64();
    let (Some(momentum), Some(duration)) = (number("momentum_error"), number("duration_s")) else {
        return Some("stdout is no summary".to_owned());
    };
    if s["verdict"] != "pass" {
        return Some(format!("exit 0, but the verdict is {}", s["verdict"]));
    }
    if twin == HIL {
        // Nothing tells where energy went on a rig: it has no account.
        return s["loop"].is_null().then(|| "the summary has no `loop`".to_owned());
    }
    let Some(energy) = number("energy_balance_error") else {
        return Some("the energy account was not computed".to_owned());
    };
    let bound = momentum_bound(twin, duration);
    // NaN comes as null in JSON and has been refused above.
    if energy.abs() > ENERGY_BOUND {
        return Some(format!("energy is off by {energy:.1e}, allowed {ENERGY_BOUND:.0e}"));
    }
    if momentum.abs() > bound {
        return Some(format!("momentum is off by {momentum:.1e}, allowed {bound:.0e}"));
    }
    None
}

/// Rehearses everything, prints the table, tells what is wrong.
pub(crate) fn rehearse_all(root: &Path) -> Result<(), String> {
    let dir = folder(root);
    if dir.exists() {
        std::fs::remove_dir_all(&dir)
            .map_err(|e| format!("{} cannot be removed ({e})", dir.display()))?;
    }
    let jobs = names(root)?.into_iter().flat_map(|n| TWINS.map(|t| (n.clone(), t))).collect();
    let ran = run(root, jobs);
    println!("{}", table(&ran));
    let mut wrong = told(&ran);
    wrong.extend(twins_differ(&ran));
    if wrong.is_empty() {
        println!(
            "{} rehearsals; poses of the twins are compared by the test twins_agree",
            ran.len()
        );
        return Ok(());
    }
    Err(format!("{} problems\n  {}", wrong.len(), wrong.join("\n  ")))
}

/// Runs everything against the emulated rig in virtual time, one of them twice.
pub(crate) fn hil_all(root: &Path) -> Result<(), String> {
    let jobs = names(root)?.into_iter().map(|n| (n, HIL)).collect();
    let ran = run(root, jobs);
    println!("{}", table(&ran));
    let mut wrong = told(&ran);
    let first = folder(root).join(format!("{REPLAYED}-{HIL}"));
    let kept = first.with_extension("first");
    std::fs::rename(&first, &kept)
        .map_err(|e| format!("{} cannot be renamed ({e})", first.display()))?;
    let again = rehearse(root, REPLAYED, HIL);
    let digest = |r: &Ran| r.summary["state_digest"].as_str().map(str::to_owned);
    let before = ran.iter().find(|r| r.scenario == REPLAYED).and_then(digest);
    if before.is_none() || digest(&again) != before {
        wrong.push(format!("{REPLAYED}: two runs have other digests"));
    }
    if wrong.is_empty() {
        println!("{} runs; {REPLAYED} twice with the same digest", ran.len());
        return Ok(());
    }
    Err(format!("{} problems\n  {}", wrong.len(), wrong.join("\n  ")))
}

fn told(ran: &[Ran]) -> Vec<String> {
    ran.iter()
        .filter_map(|r| r.wrong.as_ref().map(|w| format!("{} ({}): {w}", r.scenario, r.twin)))
        .collect()
}

/// Runs jobs on all cores, sorted afterwards.
fn run(root: &Path, jobs: Vec<(String, &'static str)>) -> Vec<Ran> {
    let ran = Mutex::new(Vec::new());
    let next = AtomicUsize::new(0);
    let workers = std::thread::available_parallelism().map_or(1, usize::from).min(jobs.len());
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some((name, twin)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let one = rehearse(root, name, twin);
                    ran.lock().unwrap_or_else(PoisonError::into_inner).push(one);
                }
            });
        }
    });
    let mut ran = ran.into_inner().unwrap_or_else(PoisonError::into_inner);
    ran.sort_by(|a, b| (&a.scenario, a.twin).cmp(&(&b.scenario, b.twin)));
    ran
}

/// Order in which the latches caught.
fn latch_order(s: &Value) -> Vec<usize> {
    let times = s["latches_s"].as_array().cloned().unwrap_or_default();
    let mut caught: Vec<(f64, usize)> =
        times.iter().enumerate().filter_map(|(i, t)| t.as_f64().map(|t| (t, i + 1))).collect();
    caught.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    caught.into_iter().map(|(_, i)| i).collect()
}

/// Scenarios in which the twins tell different stories. `ran` is sorted by scenario.
fn twins_differ(ran: &[Ran]) -> Vec<String> {
    ran.chunk_by(|a, b| a.scenario == b.scenario)
        .filter_map(|pair| {
            let [a, b] = pair else { return Some(format!("{}: one twin only", pair[0].scenario)) };
            let story = |r: &Ran| (r.summary["outcome"].clone(), latch_order(&r.summary));
            let (x, y) = (story(a), story(b));
            (x != y).then(|| {
                format!(
                    "{}: the twins differ: {} {:?} ({}), {} {:?} ({})",
                    a.scenario, x.0, x.1, a.twin, y.0, y.1, b.twin
                )
            })
        })
        .collect()
}

fn table(ran: &[Ran]) -> String {
    let mut out = format!(
        "{:<26} {:<8} {:<15} {:<8} {:>9} {:>9} {:>10} {:>9} {:>9}",
        "scenario",
        "twin",
        "outcome",
        "verdict",
        "energy",
        "momentum",
        "peak N",
        "capture s",
        "x real"
    );
    for r in ran {
        let s = &r.summary;
        let text = |key: &str| s[key].as_str().unwrap_or("–").to_owned();
        let number = |key: &str, f: &dyn Fn(f64) -> String| {
            s[key].as_f64().map_or_else(|| "–".to_owned(), f)
        };
        out.push_str(&format!(
            "\n{:<26} {:<8} {:<15} {:<8} {:>9} {:>9} {:>10} {:>9} {:>9}",
            r.scenario,
            r.twin,
            text("outcome"),
            if r.wrong.is_some() { "WRONG".to_owned() } else { text("verdict") },
            number("energy_balance_error", &|x| format!("{x:.1e}")),
            number("momentum_error", &|x| format!("{x:.1e}")),
            number("peak_force_n", &|x| format!("{x:.1}")),
            number("capture_s", &|x| format!("{x:.3}")),
            number("realtime_factor", &|x| format!("{x:.0}")),
        ));
    }
    out
}

/// Replays one recording of each twin and one against the emulated rig.
pub(crate) fn replay(root: &Path) -> Result<(), String> {
    for twin in TWINS.into_iter().chain([HIL]) {
        let run = folder(root).join(format!("{REPLAYED}-{twin}"));
        let mut c = shell::command(root, shell::binary(root), &["replay", "--json"]);
        let (stdout, code, stderr) = shell::capture(c.arg(&run))?;
        let said: Value = serde_json::from_str(&stdout).unwrap_or_default();
        let ticks = said["ticks"].as_u64().unwrap_or(0);
        let signals = said["signals"].as_u64().unwrap_or(0);
        if code != Some(0) || said["identical"] != true || ticks < 1000 || signals < 100 {
            return Err(format!(
                "replay of {REPLAYED} ({twin}) ended with {code:?}: {} {}",
                stdout.trim(),
                stderr.trim()
            ));
        }
        println!("{REPLAYED} ({twin}): {ticks} ticks, every bit of {signals} signals the same");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn ran(twin: &'static str, outcome: &str, latches: Value) -> Ran {
        let summary = json!({ "outcome": outcome, "latches_s": latches });
        Ran { scenario: "a".to_owned(), twin, summary, wrong: None }
    }

    #[test]
    fn invariant_twins_that_tell_different_stories_are_named() {
        let full = || ran("full", "captured", json!([2.0, 1.0, 3.0]));
        let order = |latches: Value| twins_differ(&[full(), ran("reduced", "captured", latches)]);
        assert!(order(json!([2.1, 1.1, 3.1])).is_empty());
        assert_eq!(order(json!([1.0, 1.1, 3.1])).len(), 1);
        assert_eq!(
            twins_differ(&[full(), ran("reduced", "jammed", json!([2.0, 1.0, 3.0]))]).len(),
            1
        );
        assert_eq!(twins_differ(&[full()]).len(), 1);
    }

    #[test]
    fn invariant_a_summary_is_held_to_its_bounds() {
        let s = |energy: Value, momentum: f64| {
            json!({
                "verdict": "pass", "energy_balance_error": energy,
                "momentum_error": momentum, "duration_s": 10.0,
            })
        };
        assert_eq!(check(&s(json!(1e-4), 5e-12), "reduced"), None);
        assert!(check(&s(json!(1e-4), 5e-11), "reduced").is_some());
        assert_eq!(check(&s(json!(1e-4), 5e-11), "full"), None);
        assert!(check(&s(json!(2e-3), 0.0), "full").is_some());
        assert!(check(&s(Value::Null, 0.0), "full").is_some());
        assert!(check(&Value::Null, "full").is_some());
        let mut on_rig = s(Value::Null, 0.0);
        assert!(check(&on_rig, HIL).is_some(), "no `loop`");
        on_rig["loop"] = json!({});
        assert_eq!(check(&on_rig, HIL), None);
        on_rig["verdict"] = json!("fail");
        assert!(check(&on_rig, HIL).is_some());
    }
}
