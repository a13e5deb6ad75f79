//! `model` and `scenario`: files checked, their keys explained.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::Subcommand;
use docktwin_core::{DQuat, DVec3, Pose};
use docktwin_model::{
    DockingMechanism, RING_AND_PETAL_PAIRS,
    keys::{self, FileKind},
};
use docktwin_physics::contact::Scene;
use docktwin_run::{
    RunError,
    inspection::{OnItsRig, on_its_rig, weighed},
};
use docktwin_scenario::{Scenario, explained, load_scenario};

use crate::{
    failure::{BAD_INPUT, Failure, problem_json},
    inputs::overrides,
};

/// `model …`.
#[derive(Debug, Subcommand)]
pub(crate) enum ModelCommand {
    /// Tell everything read, refused or ignored in a URDF or its TOML, all problems at once
    #[command(
        after_help = "Examples:\n  docktwin model check models/urdf/apas_active.urdf\n  docktwin model check models/urdf/chaser_8t.toml --json\n  docktwin model check models/urdf/stewart.toml --mechanism models/urdf/apas_active.urdf"
    )]
    Check {
        /// URDF or TOML of a spacecraft, of one side of a mechanism or of a rig
        file: PathBuf,
        /// Active side of the mechanism that is to stand on the rig: its static sag there, and what the
        /// weight takes of every brake and travel
        #[arg(long, value_name = "ACTIVE")]
        mechanism: Option<PathBuf>,
    },
    /// Explain a key of the TOML of spacecraft, mechanisms and rigs, or all of them
    #[command(
        after_help = "Examples:\n  docktwin model explain\n  docktwin model explain ring_body.mass_kg\n  docktwin model explain spread --kind rig"
    )]
    Explain {
        /// Key or table, with dots
        key: Option<String>,
        /// Only of one kind of file
        #[arg(long, value_name = "KIND", value_parser = file_kind)]
        kind: Option<FileKind>,
    },
}

fn file_kind(text: &str) -> Result<FileKind, String> {
    let words = FileKind::WORDS;
    words
        .into_iter()
        .find(|(w, _)| *w == text)
        .map(|(_, kind)| kind)
        .ok_or_else(|| format!("a kind is one of {}", words.map(|(w, _)| w).join(", ")))
}

/// `scenario …`.
#[derive(Debug, Subcommand)]
pub(crate) enum ScenarioCommand {
    /// Check a scenario and every model it names, all problems at once
    #[command(
        after_help = "Examples:\n  docktwin scenario check scenarios/apas_nominal.toml\n  docktwin scenario check my.toml --set run.duration_s=5"
    )]
    Check {
        /// Scenario file
        file: PathBuf,
        /// Override a key of the scenario, repeatable
        #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
        set: Vec<String>,
    },
    /// Explain a key of the scenario file, or all of them
    #[command(
        after_help = "Examples:\n  docktwin scenario explain\n  docktwin scenario explain initial.gap_m"
    )]
    Explain {
        /// Key, with dots
        key: Option<String>,
    },
}

/// Runs `model …`.
pub(crate) fn model(command: &ModelCommand, json: bool) -> Result<ExitCode, Failure> {
    match command {
        ModelCommand::Check { file, mechanism } => {
            Ok(model_check(file, mechanism.as_deref(), json))
        }
        ModelCommand::Explain { key, kind } => explain_model(key.as_deref(), *kind, json),
    }
}

/// Runs `scenario …`.
pub(crate) fn scenario(command: &ScenarioCommand, json: bool) -> Result<ExitCode, Failure> {
    match command {
        ScenarioCommand::Check { file, set } => check_scenario(file, set, json),
        ScenarioCommand::Explain { key } => explain_scenario(key.as_deref(), json),
    }
}

fn model_check(file: &Path, mechanism: Option<&Path>, json: bool) -> ExitCode {
    let mut report = docktwin_model::model_check_with(file, mechanism);
    if let Some(mechanism) = report.mechanism.take() {
        let fit = fit_of_surfaces(&mechanism);
        let docked = when_docked(&mechanism);
        report.read.extend(docked.read);
        report.flagged.extend(docked.flagged);
        report.read.extend(fit.read);
        report.flagged.extend(fit.flagged);
    }
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

/// How far surfaces may lie inside each other when docked, m: less is the rounding of a file.
const ROUNDING_M: f64 = 1e-5;

/// What a mechanism is when docked.
#[derive(Default)]
struct WhenDocked {
    read: Vec<String>,
    flagged: Vec<String>,
}

/// Gap of every pair of listed surfaces when docked, and where the strikers of latches with places of their own are.
fn when_docked(m: &DockingMechanism) -> WhenDocked {
    let planes = m.active.ring.section_radius_m + m.passive.ring.section_radius_m;
    let half_turn = DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0);
    let docked = Pose::new(DVec3::X * planes, half_turn);
    let depths = Scene::new(m).depths(docked, f64::NEG_INFINITY);
    let mut out = WhenDocked::default();
    for (pair, depth) in m.surface_pairs().iter().zip(&depths[RING_AND_PETAL_PAIRS..]) {
        let name = DockingMechanism::surface_pair_name(pair);
        out.read.push(format!("pair {name}: gap when docked = {:.6} m", -depth));
        if *depth > ROUNDING_M {
            out.flagged.push(format!(
                "pair {name}: {:.2} mm inside each other when docked: the sides never come that far; make one of \
                 them smaller, or move it",
                depth * 1e3
            ));
        }
    }
    for l in &m.own_latches {
        let off = docked.transform_point(l.striker_p) - l.latch_r;
        let (ahead, aside) = (off.x, off.y.hypot(off.z));
        let name = &l.name;
        let there = format!("{:.2} mm ahead and {:.2} mm aside", ahead * 1e3, aside * 1e3);
        out.read.push(format!("latch {name}: striker when docked {there}"));
        if ahead > l.catch_gap_m || aside > l.lateral_zone_m || ahead < -l.approach_gap_m {
            out.flagged.push(format!(
                "latch {name}: its striker is {there} of it when docked, outside its zone: it does not catch as \
                 docked sides lie; mend latch_m or striker_m"
            ));
        }
    }
    out
}

/// What follows from the surfaces that touch.
struct SurfaceFit {
    read: Option<String>,
    flagged: Option<String>,
}

fn fit_of_surfaces(m: &DockingMechanism) -> SurfaceFit {
    let play = Scene::new(m).roll_play();
    let [Some(back), Some(ahead)] = play.map(|p| p.map(f64::to_degrees)) else {
        return SurfaceFit { read: None, flagged: None };
    };
    let least = back.min(ahead);
    let both = if (back - ahead).abs() < 5e-3 {
        format!("±{least:.2}")
    } else {
        format!("-{back:.2} to {ahead:.2}")
    };
    let zone = m.latches.as_ref().map(|l| l.tangential_zone_m);
    let radius_m = m.active.ring.mean_radius_m;
    let narrow = zone.filter(|zone| (zone / radius_m).to_degrees() < back.max(ahead));
    let flagged = if least == 0.0 {
        Some("petals of both sides touch when docked: they never latch; turn one side's petals, or make them \
              narrower or thinner".to_owned())
    } else {
        narrow.map(|zone| {
            format!(
                "latches.tangential_zone_m = {zone} m: ±{:.2} deg at the ring, less than the mated roll play of \
                 {both} deg: sides that come to rest beyond it never latch; make it {:.3} m or more",
                (zone / radius_m).to_degrees(),
                (back.max(ahead).to_radians() * radius_m * 1e3).ceil() / 1e3
            )
        })
    };
    let read = format!("mated roll play = {both} deg (until petals touch)");
    SurfaceFit { read: Some(read), flagged }
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
    let craft = weighed(&scenario);
    let rig = on_its_rig(&scenario);
    if json {
        let notes: Vec<String> = scenario.notes.iter().map(|n| n.to_string()).collect();
        println!(
            "{}",
            serde_json::json!({
                "scenario": scenario.name, "notes": notes, "spacecraft": craft,
                "rig": rig_json(&rig),
            })
        );
    } else {
        scenario.notes.iter().for_each(|n| println!("{} {n}", n.word()));
        craft.iter().for_each(|c| println!("read    {}", c.line()));
        rig_lines(&scenario, &rig).iter().for_each(|l| println!("{l}"));
        println!(
            "{}: nothing to mend; expects `{}`, {}",
            scenario.name, scenario.expect.outcome, scenario.expect.because
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// How the mechanism stands on the rig, or why `hil` would not take it there. A default rig that is not found
/// was never asked about.
fn rig_lines(scenario: &Scenario, rig: &Result<OnItsRig, RunError>) -> Vec<String> {
    match rig {
        Ok(on) => {
            let name = on.rig.with_extension("toml");
            let mut lines: Vec<String> = on
                .sags
                .iter()
                .map(|s| format!("read    on {}: {}", name.display(), s.line()))
                .collect();
            lines.extend(sag_flag(on));
            lines
        }
        Err(why) if scenario.hil.rig.is_some() => {
            vec![format!("flagged `hil` refuses its rig: {why}")]
        }
        Err(_) => Vec::new(),
    }
}

/// That `hil` refuses the mechanism on its rig, if it does.
pub(crate) fn sag_flag(on: &OnItsRig) -> Option<String> {
    let why = on.refused.as_ref()?;
    let name = on.rig.with_extension("toml");
    Some(format!("flagged `hil` refuses it on {}: {why}; {}", name.display(), OnItsRig::remedy()))
}

fn rig_json(rig: &Result<OnItsRig, RunError>) -> serde_json::Value {
    match rig {
        Ok(on) => serde_json::json!({
            "file": on.rig.with_extension("toml").to_string_lossy(),
            "sag": on.sags.iter().map(docktwin_model::Sag::line).collect::<Vec<_>>(),
            "refused": on.refused,
        }),
        Err(why) => serde_json::json!({ "refused": why.to_string() }),
    }
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
