//! From words to work.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use docktwin_model::{
    input::shown,
    keys::{self, FileKind},
};
use docktwin_scenario::{Loader, explained, load_scenario};

use crate::{
    analyze,
    cli::{Cli, Command, ModelCommand, ScenarioCommand},
    failure::{BAD_INPUT, Failure, problem_json},
    rehearse, replay, report, view,
};

/// Runs the command.
pub(crate) fn run(cli: &Cli) -> Result<ExitCode, Failure> {
    let json = cli.common.json;
    match &cli.command {
        Command::Rehearse(args) => rehearse::run(args, json),
        Command::Hil(args) => crate::hil::run(args, json),
        Command::Replay(args) => replay::run(args, json),
        Command::Diff(args) => crate::diff::run(args, json),
        Command::Export(args) => crate::export::run(args, json),
        Command::Recover(args) => crate::recover::run(args, json),
        Command::View(args) => view::run(args, json),
        Command::Analyze(command) => analyze::run(command, json),
        Command::Report(args) => report::run(args, json),
        Command::Doctor(args) => crate::doctor::run(args, json),
        Command::Rig(command) => crate::rig::run(command, json),
        Command::Validate(command) => crate::validate::run(command, json),
        Command::Model(ModelCommand::Check { file }) => Ok(model_check(file, json)),
        Command::Model(ModelCommand::Explain { key, kind }) => {
            explain_model(key.as_deref(), *kind, json)
        }
        Command::Scenario(ScenarioCommand::Check { file, set }) => check_scenario(file, set, json),
        Command::Scenario(ScenarioCommand::Explain { key }) => {
            explain_scenario(key.as_deref(), json)
        }
    }
}

fn model_check(file: &Path, json: bool) -> ExitCode {
    let report = docktwin_model::model_check(file);
    let code = if report.refused.is_empty() { 0 } else { BAD_INPUT };
    if !json {
        report.lines().iter().for_each(|l| println!("{l}"));
        return ExitCode::from(code);
    }
    let files: Vec<String> = report.files.iter().map(|f| f.display().to_string()).collect();
    let values: Vec<_> = report
        .values
        .iter()
        .map(|v| {
            serde_json::json!({
                "file": v.file.to_string_lossy(), "line": v.line, "key": v.key,
                "value": v.value, "unit": v.unit, "note": v.note,
            })
        })
        .collect();
    let problems: Vec<_> = report.problems.iter().map(problem_json).collect();
    println!(
        "{}",
        serde_json::json!({
            "files": files,
            "read": report.read,
            "ignored": report.ignored,
            "refused": report.refused,
            "values": values,
            "problems": problems,
            "exit_code": code,
        })
    );
    ExitCode::from(code)
}

fn explain_model(
    key: Option<&str>,
    kind: Option<FileKind>,
    json: bool,
) -> Result<ExitCode, Failure> {
    let keys = keys::explained(kind, key).map_err(|unknown| Failure::Usage {
        what: unknown.to_string(),
        remedy: "`docktwin model explain` lists every key".to_owned(),
    })?;
    if json {
        let keys: Vec<_> = keys
            .iter()
            .map(|k| {
                serde_json::json!({
                    "files": k.files, "key": k.key, "meaning": k.meaning, "why": k.why,
                    "unit": k.unit, "allowed": k.allowed, "example": k.example,
                })
            })
            .collect();
        println!("{}", serde_json::json!({ "keys": keys }));
    } else {
        for k in keys {
            println!("{} ({})\n    {}", k.key, k.files.join(", "), k.allowed);
            println!("    {} {}\n    example: {}", k.meaning, k.why, k.example);
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn check_scenario(file: &Path, set: &[String], json: bool) -> Result<ExitCode, Failure> {
    let scenario = load_scenario(file, &overrides(set)?)?;
    if json {
        let notes: Vec<String> = scenario.notes.iter().map(|n| n.to_string()).collect();
        println!("{}", serde_json::json!({ "scenario": scenario.name, "notes": notes }));
    } else {
        scenario.notes.iter().for_each(|n| println!("ignored {n}"));
        println!(
            "{}: nothing to mend; expects `{}`, {}",
            scenario.name, scenario.expect.outcome, scenario.expect.because
        );
    }
    Ok(ExitCode::SUCCESS)
}

fn explain_scenario(key: Option<&str>, json: bool) -> Result<ExitCode, Failure> {
    let keys = explained(key).map_err(|unknown| Failure::Usage {
        what: unknown.to_string(),
        remedy: "`docktwin scenario explain` lists every key".to_owned(),
    })?;
    if json {
        let keys: Vec<_> = keys
            .iter()
            .map(|k| {
                serde_json::json!({
                    "key": k.key, "meaning": k.meaning, "unit": k.unit,
                    "allowed": k.allowed, "example": k.example,
                })
            })
            .collect();
        println!("{}", serde_json::json!({ "keys": keys }));
    } else {
        for k in keys {
            println!("{}\n    {}\n    {}", k.key, k.allowed, k.meaning);
            println!("    example: {}", k.example);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// `--set key.path=value` as pairs.
pub(crate) fn overrides(set: &[String]) -> Result<Vec<(String, String)>, Failure> {
    set.iter()
        .map(|s| {
            s.split_once('=').map(|(k, v)| (k.trim().to_owned(), v.trim().to_owned())).ok_or_else(
                || Failure::Usage {
                    what: format!("`--set {}` has no `=`", shown(s)),
                    remedy: "write it as --set key.path=value, for example \
                             --set initial.lateral_y_m=0.1"
                        .to_owned(),
                },
            )
        })
        .collect()
}

/// Reads scenarios with `--set` applied.
pub(crate) fn loader(set: &[String]) -> Result<Loader, Failure> {
    Ok(Loader::new().set_texts("--set ", &overrides(set)?))
}

/// The present instant as names of files have it.
pub(crate) fn timestamp() -> String {
    jiff::Timestamp::now().strftime("%Y%m%dT%H%M%SZ").to_string()
}

/// A directory that is not there yet, named after what goes there and the time.
pub(crate) fn new_directory(parent: &str, name: &str) -> PathBuf {
    let now = timestamp();
    let mut directory = Path::new(parent).join(format!("{name}-{now}"));
    let mut n = 1;
    while directory.exists() {
        n += 1;
        directory = Path::new(parent).join(format!("{name}-{now}-{n}"));
    }
    directory
}
