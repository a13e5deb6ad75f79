//! `cargo xtask test`: the steps of the gate, in their order.

use std::{
    io::Write,
    path::{Path, PathBuf},
    process::ExitCode,
    time::Instant,
};

use crate::{scenarios, shell, validation};

/// A step: what it is called and what it does.
type Step = (&'static str, fn(&Path) -> Result<(), String>);

const STEPS: &[Step] = &[
    ("format: cargo fmt --check", format),
    ("lints: cargo clippy --workspace --all-targets -- -D warnings", lints),
    ("docs: cargo doc --workspace --no-deps, warnings denied", docs),
    ("build: cargo test --workspace --no-run", build),
    ("tests: cargo test --workspace", tests),
    ("scenarios: every file of scenarios/ with both twins", scenarios::rehearse_all),
    ("replay: a recording of each twin, tick by tick", scenarios::replay),
    ("validation: MuJoCo against docktwin", validation::run),
];

/// Runs the steps until one fails.
pub(crate) fn run(root: &Path) -> ExitCode {
    let (mut passed, mut failed) = (0, 0);
    let all = Instant::now();
    for (i, (name, step)) in STEPS.iter().enumerate() {
        say(&format!("\n[{}/{}] {name}", i + 1, STEPS.len()));
        let begin = Instant::now();
        let done = step(root);
        let seconds = begin.elapsed().as_secs_f64();
        match done {
            Ok(()) => {
                passed += 1;
                say(&format!("[{}/{}] passed in {seconds:.1} s", i + 1, STEPS.len()));
            }
            Err(why) => {
                failed += 1;
                say(&format!("[{}/{}] FAILED after {seconds:.1} s: {why}", i + 1, STEPS.len()));
                let left = STEPS.len() - i - 1;
                if left > 0 {
                    say(&format!("{left} further steps were not tried"));
                }
                break;
            }
        }
    }
    say(&format!("\ngate of {} steps, {:.0} s", STEPS.len(), all.elapsed().as_secs_f64()));
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
        .map_err(|e| format!("{e}; mend it with `cargo fmt --all`"))
}

fn lints(root: &Path) -> Result<(), String> {
    shell::run(&mut shell::cargo(
        root,
        &["clippy", "--quiet", "--workspace", "--all-targets", "--", "-D", "warnings"],
    ))
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
    let binary = binary(root);
    if binary.is_file() { Ok(()) } else { Err(format!("no binary was built: {}", binary.display())) }
}

fn tests(root: &Path) -> Result<(), String> {
    shell::run(&mut shell::cargo(root, &["test", "--workspace", "--no-fail-fast"]))
}

/// Where cargo puts what it builds.
pub(crate) fn target(root: &Path) -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), |dir| root.join(dir))
}

/// The command line of this workspace, dev profile.
pub(crate) fn binary(root: &Path) -> PathBuf {
    target(root).join("debug").join(format!("docktwin{}", std::env::consts::EXE_SUFFIX))
}
