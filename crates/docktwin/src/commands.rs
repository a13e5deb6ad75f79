//! From words to work.

use std::process::ExitCode;

use docktwin_scenario::{explain, load_scenario};

use crate::{
    cli::{Cli, Command, ModelCommand, ScenarioCommand},
    failure::{BAD_INPUT, Failure},
    rehearse, replay, report,
};

/// Runs the command.
pub(crate) fn run(cli: &Cli) -> Result<ExitCode, Failure> {
    let json = cli.common.json;
    match &cli.command {
        Command::Rehearse(args) => rehearse::run(args, json),
        Command::Replay(args) => replay::run(args, json),
        Command::Report(args) => report::run(args, json),
        Command::Model(ModelCommand::Check { file }) => {
            let report = docktwin_model::model_check(file);
            let code = if report.refused.is_empty() { 0 } else { BAD_INPUT };
            if json {
                let files: Vec<String> =
                    report.files.iter().map(|f| f.display().to_string()).collect();
                println!(
                    "{}",
                    serde_json::json!({
                        "files": files,
                        "read": report.read,
                        "ignored": report.ignored,
                        "refused": report.refused,
                    })
                );
            } else {
                report.lines().iter().for_each(|l| println!("{l}"));
            }
            Ok(ExitCode::from(code))
        }
        Command::Scenario(ScenarioCommand::Check { file, set }) => {
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
        Command::Scenario(ScenarioCommand::Explain { key }) => match explain(key.as_deref()) {
            Ok(text) => {
                println!("{text}");
                Ok(ExitCode::SUCCESS)
            }
            Err(unknown) => Err(Failure::Usage {
                what: unknown.to_string(),
                remedy: "`docktwin scenario explain` lists every key".to_owned(),
            }),
        },
    }
}

/// `--set key.path=value` as pairs.
pub(crate) fn overrides(set: &[String]) -> Result<Vec<(String, String)>, Failure> {
    set.iter()
        .map(|s| {
            s.split_once('=').map(|(k, v)| (k.trim().to_owned(), v.trim().to_owned())).ok_or_else(
                || Failure::Usage {
                    what: format!("`--set {s}` has no `=`"),
                    remedy: "write it as --set key.path=value, for example \
                             --set initial.lateral_y_m=0.1"
                        .to_owned(),
                },
            )
        })
        .collect()
}
