//! Tasks of the project: `cargo xtask test`, `cargo xtask meshes`, `cargo xtask docs`,
//! `cargo xtask docs-tables`, `cargo xtask fuzz`.

mod deny;
mod fuzz;
mod gate;
mod python;
mod scenarios;
mod shell;
mod validation;

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{Parser, Subcommand};

/// Tasks of the docktwin project.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", max_term_width = 100, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask test                     before every push; .ci/run calls exactly this
  cargo xtask test --only scenarios    one step again, while you fix it
  cargo xtask meshes                   after a change of a ring, a petal or a hull
  cargo xtask docs                     the public API, as HTML under target/doc
  cargo xtask docs-tables              after a change of a key (models, scenarios) or of a signal
  cargo xtask fuzz urdf --minutes 10   after a change of what reads files of strangers";

#[derive(Debug, Subcommand)]
enum Task {
    /// Everything CI checks: format, dependencies, lints, docs, tests, every scenario, replay, MuJoCo
    ///
    /// Stops at the first step that fails. The last line counts the steps: `N passed, N failed`.
    Test {
        /// Only this step; it finds what the steps before it left
        #[arg(long, value_name = "STEP", value_parser = gate::names())]
        only: Option<String>,
    },
    /// Write meshes/ again from the parameters of the models
    Meshes,
    /// Build the documentation of the public API, warnings denied
    Docs,
    /// Write the tables of keys and signals in docs/ again, from the tables in the code
    DocsTables,
    /// Try random inputs of a kind for some minutes; the gate tries a fixed sample of every kind
    Fuzz {
        /// What is damaged
        #[arg(value_name = "TARGET", value_parser = fuzz::TARGETS)]
        target: String,
        /// How long
        #[arg(long, value_name = "N", default_value_t = 10.0)]
        minutes: f64,
        /// Add inputs with new outcomes to the corpus
        #[arg(long)]
        keep: bool,
    },
}

fn main() -> ExitCode {
    let root = root();
    let done = match Cli::parse().task {
        Task::Test { only } => return gate::run(&root, only.as_deref()),
        Task::Meshes => meshes(&root),
        Task::Docs => gate::docs(&root).map(|()| {
            println!("open {}", root.join("target/doc/docktwin/index.html").display());
        }),
        Task::DocsTables => docs_tables(&root),
        Task::Fuzz { target, minutes, keep } => fuzz::run(&root, &target, minutes, keep),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(what) => {
            eprintln!("{what}");
            ExitCode::FAILURE
        }
    }
}

/// The repository: the folder above this package.
fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_owned()
}

/// With UPDATE_DOCS the tests that compare the pages with the code write the pages instead.
fn docs_tables(root: &Path) -> Result<(), String> {
    let mut tests = shell::cargo(root, &["test", "--quiet", "-p", "docktwin-model"]);
    tests.args(["-p", "docktwin-scenario", "-p", "docktwin-run"]);
    tests.args(["--test", "models_page", "--test", "scenarios_page", "--test", "signals_page"]);
    shell::run(tests.env("UPDATE_DOCS", "1"))?;
    println!("docs/models.md, docs/scenarios.md, docs/signals.md");
    Ok(())
}

/// By an example of the model crate, so that no engine is built before the gate can begin.
fn meshes(root: &Path) -> Result<(), String> {
    let example = ["run", "--quiet", "--package", "docktwin-model", "--example", "meshes"];
    shell::run(&mut shell::cargo(root, &example))
}
