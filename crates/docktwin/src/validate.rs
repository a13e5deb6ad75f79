//! `validate`: docktwin held against something else. `crosscheck`: the same scenario in MuJoCo, by the
//! Python side under `validation/`, which shares no code with this one. `fidelity`: dockings on the rig
//! against the simulated system. `single-dof`: the smallest HIL
//! simulation against the simulated system.

mod fidelity;
mod single_dof;
mod vibro;

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{Args, Subcommand};
use docktwin_playback::Align;
use docktwin_record::{RecordError, files, read_table};
use docktwin_report::study::crosscheck::{Answer, plots};
use docktwin_run::{Rehearsal, RehearsalOptions, RunDirectory, TwinKind};
use docktwin_scenario::load_scenario;
use docktwin_study::crosscheck::{EngineRun, SecondEngine, Side, compare, record};

use crate::{
    failure::{Failure, OTHERWISE},
    inputs::overrides,
    results::directory,
    view::save_two,
};

/// `validate …`.
#[derive(Debug, Subcommand)]
pub(crate) enum ValidateCommand {
    /// Run a scenario in MuJoCo too and compare
    #[command(after_help = CROSSCHECK)]
    Crosscheck(CrosscheckArgs),
    /// Hold dockings on the emulated rig against the simulated system, and tell what they differ by
    #[command(after_help = fidelity::EXAMPLES)]
    Fidelity(fidelity::FidelityArgs),
    /// Run the single-DOF HIL simulation of the paper (Fig. 23 to 26) against the simulated system
    #[command(after_help = single_dof::EXAMPLES)]
    SingleDof(single_dof::SingleDofArgs),
    /// Run Table 4 of the paper, a spring stick between two stops, through the whole loop
    #[command(after_help = vibro::EXAMPLES)]
    VibroImpact(vibro::VibroArgs),
}

/// Names the Python with MuJoCo.
const PYTHON: &str = "DOCKTWIN_PYTHON";

const CROSSCHECK: &str = "\
MuJoCo integrates, and geometry and contact law are written a second time in Python, from the model
files alone. Both start from the same state and are compared from first contact on. Required:
relative pose within 1 mm and 0.1 degrees until the first latch, peak force within 5 %, the same
outcome and the same order of latches. The rest is told, not judged.

The directory holds `docktwin` and `mujoco` (run directories, for `view`, `diff`, `report`),
comparison.json (what --json prints), plots as SVG, and crosscheck.rrd (MuJoCo's run laid over
docktwin's). First contact is known to a step, by which alignment may be off.

MuJoCo needs Python 3.11 or newer with validation/requirements.txt; `cargo xtask test` makes such an
environment under target/venv-validation. The first run compiles the second engine, half a minute.

Examples:
  docktwin validate crosscheck scenarios/apas_nominal.toml
  docktwin validate crosscheck scenarios/apas_fast.toml --set run.duration_s=1 --out runs/cross
  docktwin validate crosscheck my.toml --python ~/venv/bin/python --validation docktwin/validation
  docktwin view --compare runs/cross/docktwin runs/cross/mujoco --align first-contact

Exit codes: 0 within the requirements; 1 not; 2 bad input, or no Python with MuJoCo.";

/// Options of `validate crosscheck`.
#[derive(Debug, Args)]
pub(crate) struct CrosscheckArgs {
    /// Scenario file
    scenario: PathBuf,
    /// Override a key of the scenario, repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    set: Vec<String>,
    /// Directory of the results; by default a new one under `runs`.
    #[arg(
        long,
        value_name = "DIR",
        help = "Directory [default: runs/<scenario>-crosscheck-<utc>]"
    )]
    out: Option<PathBuf>,
    /// Python with MuJoCo [default: DOCKTWIN_PYTHON, or target/venv-validation of the repository]
    #[arg(long, value_name = "PATH")]
    python: Option<PathBuf>,
    /// The directory `validation` [default: that of the repository of the scenario, or of here]
    #[arg(long, value_name = "DIR")]
    validation: Option<PathBuf>,
    /// Step of MuJoCo, a whole fraction of the tick
    #[arg(long, value_name = "MS", default_value_t = 0.2, value_parser = step_ms)]
    step_ms: f64,
}

fn step_ms(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x > 0.0 => Ok(x),
        _ => Err("a step is a number of milliseconds above 0, such as 0.2".to_owned()),
    }
}

/// Runs the command.
pub(crate) fn run(command: &ValidateCommand, json: bool) -> Result<ExitCode, Failure> {
    match command {
        ValidateCommand::Crosscheck(args) => crosscheck(args, json),
        ValidateCommand::Fidelity(args) => fidelity::run(args, json),
        ValidateCommand::SingleDof(args) => single_dof::run(args, json),
        ValidateCommand::VibroImpact(args) => vibro::run(args, json),
    }
}

fn crosscheck(args: &CrosscheckArgs, json: bool) -> Result<ExitCode, Failure> {
    let scenario = load_scenario(&args.scenario, &overrides(&args.set)?)?;
    // Before the work of a rehearsal: there may be no second engine.
    let named = std::env::var_os(PYTHON).filter(|v| !v.is_empty()).map(PathBuf::from);
    let python = args.python.clone().or(named);
    let second = SecondEngine::find(&args.scenario, args.validation.as_deref(), python.as_deref())?;
    let name = format!("{}-crosscheck", scenario.name);
    let out = directory(args.out.as_deref(), "runs", &name)?;
    let (ours, theirs) = (out.join("docktwin"), out.join("mujoco"));
    for dir in [&ours, &theirs] {
        let path = dir.join(files::LOG);
        if path.exists() {
            return Err(RecordError::Exists { path }.into());
        }
    }
    if !json {
        scenario.notes.iter().for_each(|n| eprintln!("{} {n}", n.word()));
    }
    let options = RehearsalOptions { twin: TwinKind::Reduced, seed: 0 };
    let summary = Rehearsal::with(&scenario, options)?.run(&mut RunDirectory::new(&ours))?;
    if !json {
        eprintln!("docktwin: {}; now MuJoCo", summary.outcome);
    }
    let tables = out.join("mujoco-tables");
    let cache = std::env::var_os("NUMBA_CACHE_DIR").is_none().then(|| second.default_cache());
    let result = second.run(&EngineRun {
        run: &ours,
        tables: &tables,
        step_ms: args.step_ms,
        cache: cache.as_deref(),
    })?;
    let now = jiff::Timestamp::now().as_nanosecond();
    let their_summary = record(&scenario, &result, &tables, &theirs, now)?;
    // All of it is in the run directory now.
    let _ = std::fs::remove_dir_all(&tables);

    let sides = [
        Side::new(&read_table(ours.join(files::TABLE))?, summary)?,
        Side::new(&read_table(theirs.join(files::TABLE))?, their_summary)?,
    ];
    let found = compare(&scenario.name, &result, &sides);
    let mut names = Vec::new();
    for (name, svg) in plots(&found, &sides).map_err(|e| Failure::Usage {
        what: format!("a plot could not be drawn: {e}"),
        remedy: "the runs are written; `docktwin diff` compares them".to_owned(),
    })? {
        save(&out.join(&name), &svg)?;
        names.push(name);
    }
    let align = if found.summary.aligned { Align::FirstContact } else { Align::Start };
    save_two(&[ours, theirs], align, None, &out.join("crosscheck.rrd"))?;
    names.extend(["crosscheck.rrd".to_owned(), "comparison.json".to_owned()]);
    let answer = Answer::new(&found);
    let text = serde_json::to_string_pretty(&answer).unwrap_or_default();
    save(&out.join("comparison.json"), &(text + "\n"))?;
    if json {
        println!("{}", serde_json::to_value(&answer).unwrap_or_default());
    } else {
        answer.lines().iter().for_each(|l| println!("{l}"));
        println!("written to {}: docktwin, mujoco, {}", out.display(), names.join(", "));
    }
    Ok(ExitCode::from(if found.summary.within { 0 } else { OTHERWISE }))
}

fn save(path: &Path, text: &str) -> Result<(), Failure> {
    std::fs::write(path, text).map_err(|e| RecordError::of_file("write a result", path, &e).into())
}
