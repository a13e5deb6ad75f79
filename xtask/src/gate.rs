//! `cargo xtask test`: the steps of the gate, in their order.

use std::{io::Write, path::Path, process::ExitCode, time::Instant};

use crate::{deny, scenarios, shell, validation};

/// A step of the gate.
struct Step {
    name: &'static str,
    what: &'static str,
    run: fn(&Path) -> Result<(), String>,
}

const STEPS: &[Step] = &[
    Step { name: "format", what: "cargo fmt --check", run: format },
    Step { name: "dependencies", what: "cargo deny check bans licenses sources", run: deny::run },
    Step {
        name: "lints",
        what: "cargo clippy --workspace --all-targets -- -D warnings",
        run: lints,
    },
    Step { name: "docs", what: "cargo doc --workspace --no-deps, warnings denied", run: docs },
    Step { name: "build", what: "cargo test --workspace --no-run", run: build },
    Step { name: "tests", what: "cargo test --workspace", run: tests },
    Step {
        name: "scenarios",
        what: "docktwin rehearse of every file of scenarios/, both twins",
        run: scenarios::rehearse_all,
    },
    Step {
        name: "hil",
        what: "docktwin hil of every file of scenarios/ on the emulated rig, virtual clock",
        run: scenarios::hil_all,
    },
    Step {
        name: "replay",
        what: "docktwin replay of a recording of each twin",
        run: scenarios::replay,
    },
    Step {
        name: "validation",
        what: "python -m pytest validation: MuJoCo against docktwin",
        run: validation::run,
    },
];

/// Names of the steps, in their order.
pub(crate) fn names() -> Vec<&'static str> {
    STEPS.iter().map(|s| s.name).collect()
}

/// Runs the steps, or `only` one of them, until one fails.
pub(crate) fn run(root: &Path, only: Option<&str>) -> ExitCode {
    let steps: Vec<&Step> = STEPS.iter().filter(|s| only.is_none_or(|o| o == s.name)).collect();
    let (mut passed, mut failed) = (0, 0);
    let all = Instant::now();
    for (i, step) in steps.iter().enumerate() {
        let number = format!("[{}/{}]", i + 1, steps.len());
        say(&format!("\n{number} {}: {}", step.name, step.what));
        let begin = Instant::now();
        let done = (step.run)(root);
        let seconds = begin.elapsed().as_secs_f64();
        match done {
            Ok(()) => {
                passed += 1;
                say(&format!("{number} {} passed in {seconds:.1} s", step.name));
            }
            Err(why) => {
                failed += 1;
                say(&format!("{number} {} FAILED after {seconds:.1} s: {why}", step.name));
                let left = steps.len() - i - 1;
                if left > 0 {
                    say(&format!("{left} further steps were not tried"));
                }
                break;
            }
        }
    }
    say(&format!("\n{:.0} s", all.elapsed().as_secs_f64()));
    say(&format!("{passed} passed, {failed} failed"));
    if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// A line on stdout, there before the next program writes.
fn say(line: &str) {
    println!("{line}");
    // A closed stdout is no reason to stop checking.
    let _ = std::io::stdout().flush();
}

fn format(root: &Path) -> Result<(), String> {
    shell::run(&mut shell::cargo(root, &["fmt", "--all", "--check"]))
        .map_err(|e| format!("{e}; fix it with `cargo fmt --all`"))
}

fn lints(root: &Path) -> Result<(), String> {
    // The second build is the one without the live viewer.
    for which in [&["--all-targets"][..], &["--no-default-features"]] {
        let mut clippy = shell::cargo(root, &["clippy", "--quiet", "--workspace"]);
        shell::run(clippy.args(which).args(["--", "-D", "warnings"]))?;
    }
    Ok(())
}

/// Documentation of every crate.
pub(crate) fn docs(root: &Path) -> Result<(), String> {
    shell::run(
        shell::cargo(root, &["doc", "--quiet", "--workspace", "--no-deps"])
            .env("RUSTDOCFLAGS", "-D warnings"),
    )
}

/// Builds the tests and, for the tests of the command line, the binary: with the features of the
/// whole workspace, so that the next steps build nothing again.
fn build(root: &Path) -> Result<(), String> {
    shell::run(&mut shell::cargo(root, &["test", "--quiet", "--workspace", "--no-run"]))?;
    let binary = shell::binary(root);
    if binary.is_file() {
        Ok(())
    } else {
        Err(format!("no binary was built: {}", binary.display()))
    }
}

fn tests(root: &Path) -> Result<(), String> {
    shell::run(&mut shell::cargo(root, &["test", "--workspace", "--no-fail-fast"]))?;
    // Without the live viewer the files are the same, and `--live` says how to build it.
    let view = ["test", "--quiet", "--workspace", "--no-default-features", "--test", "recording"];
    shell::run(&mut shell::cargo(root, &view))
}
