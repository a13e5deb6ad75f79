//! What the analyses of a rig have in common.

use std::path::PathBuf;

use clap::Args;
use docktwin_model::{Problem, Rig, load_rig};
use docktwin_study::rig::{Build, LegControl, LegSetting};

use crate::{args::PresetArg, failure::Failure};

/// What every analysis of a rig can be told.
#[derive(Debug, Args)]
pub(crate) struct RigArgs {
    /// TOML or URDF of the rig, the other beside it
    pub(super) rig: PathBuf,
    /// Oil volume [default: as the file says; `stiffness`: all]
    #[arg(long, value_enum)]
    pub(super) preset: Option<PresetArg>,
    /// Draw the rig as built within the spread of its file; controllers still believe the file
    #[arg(long, value_name = "N")]
    pub(super) seed: Option<u64>,
    /// Directory of the results; by default a new one under `analysis`.
    #[arg(long, value_name = "DIR", help = "Directory [default: analysis/<rig>-<command>-<utc>]")]
    pub(super) out: Option<PathBuf>,
}

/// Which rig the arguments ask for.
pub(super) fn build(args: &RigArgs) -> Build {
    Build { preset: args.preset.map(|p| p.preset()), seed: args.seed }
}

/// Reads a rig.
pub(super) fn load(args: &RigArgs, json: bool) -> Result<Rig, Failure> {
    Ok(load_and_change(args, &[], json)?.0)
}

/// Reads a rig, and settings of its leg control; all problems of both at once.
pub(super) fn load_and_change(
    args: &RigArgs,
    set: &[String],
    json: bool,
) -> Result<(Rig, LegControl), Failure> {
    let (loaded, changes) = match (load_rig(&args.rig), leg_control(set)) {
        (Ok(loaded), Ok(changes)) => (loaded, changes),
        (loaded, changes) => {
            let mut problems = loaded.err().map(|e| e.problems).unwrap_or_default();
            problems.extend(changes.err().unwrap_or_default());
            return Err(Failure::Input { problems });
        }
    };
    if !json {
        loaded.notes.iter().for_each(|n| eprintln!("note: {n}"));
    }
    Ok((loaded.model, changes))
}

/// `--set KEY=VALUE` of the leg control.
fn leg_control(set: &[String]) -> Result<LegControl, Vec<Problem>> {
    let mut out = LegControl::default();
    let mut problems = Vec::new();
    for text in set {
        let (key, value) = text.split_once('=').unwrap_or((text, ""));
        let (key, value) = (key.trim(), value.trim());
        let mut problem = |what: &str, unit: &str, allowed: &str, remedy: &str| {
            problems.push(Problem {
                file: "--set".into(),
                key: key.to_owned(),
                value: value.to_owned(),
                unit: unit.to_owned(),
                what: what.to_owned(),
                allowed: allowed.to_owned(),
                remedy: remedy.to_owned(),
                ..Problem::default()
            });
        };
        let Some(setting) = LegSetting::from_key(key) else {
            let known = LegSetting::ALL.map(LegSetting::key).join(", ");
            problem("is no setting of the leg control", "", &known, "name one");
            continue;
        };
        match value.parse::<f64>() {
            Err(_) => {
                let remedy = "write it as --set KEY=NUMBER";
                problem("is not a number", "", setting.allowed(), remedy);
            }
            Ok(x) => {
                if out.set(setting, x).is_err() {
                    let remedy = "give a value in the range";
                    problem("is out of range", setting.unit(), setting.allowed(), remedy);
                }
            }
        }
    }
    if problems.is_empty() { Ok(out) } else { Err(problems) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_wrong_settings_are_told_all_at_once() {
        let read = |set: &[&str]| {
            leg_control(&set.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>())
                .map_err(|all| all.iter().map(|p| p.key.clone()).collect::<Vec<_>>())
        };
        let wrong =
            ["rate_hz=3000", "kp=20", "dead_time_s=0.001", "high_pass_hz", "damping_ratio=NaN"];
        let told = read(&wrong).expect_err("four are wrong");
        assert_eq!(told, ["rate_hz", "kp", "high_pass_hz", "damping_ratio"]);
        assert_eq!(read(&["rate_hz = 2000"]).expect("right").get(LegSetting::Rate), Some(2000.0));
    }
}
