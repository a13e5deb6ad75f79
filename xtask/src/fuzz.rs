//! `cargo xtask fuzz`: the fuzzed tests with random inputs.

use std::path::Path;

use crate::shell;

/// Tests of `tests/tests/fuzz`.
pub(crate) const TARGETS: [&str; 5] =
    ["urdf", "model_toml", "scenario_toml", "rig_port", "recordings"];

/// Runs one for some minutes, and says how many inputs were tried.
pub(crate) fn run(root: &Path, target: &str, minutes: f64, keep: bool) -> Result<(), String> {
    if !(minutes > 0.0 && minutes < 1e5) {
        return Err(format!("{minutes} minutes: give a number above 0 and below 100000"));
    }
    let mut test = shell::cargo(root, &["test", "--quiet", "--workspace", "--test", "fuzz", "--"]);
    test.args([target, "--exact", "--nocapture"]);
    test.env("BOLERO_RANDOM_TEST_TIME_MS", format!("{:.0}", minutes * 60e3));
    if keep {
        test.env("DOCKTWIN_FUZZ_KEEP", "1");
    }
    shell::run(&mut test).map_err(|e| {
        format!("{e}; mend what the input above shows, and make it a case of tests/tests/fuzz/findings.rs")
    })
}
