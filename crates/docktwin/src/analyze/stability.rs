//! `analyze stability`: which contacts can be tested on a rig, with each method against the delay.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use docktwin_report::study::stability as report;
use docktwin_run::rig_place::compensation;
use docktwin_scenario::CompensatorChoice;
use docktwin_study::{
    stability::{Mismatch, StabilityOptions, stability},
    vibro_impact::{AxisSet, StickModels},
};

use crate::{
    args::{PresetArg, compensator},
    failure::Failure,
    results::{Bars, Results},
};

pub(super) const EXAMPLES: &str = "\
Every row of Table 4 (a spring stick, 0.235 to 5 Hz) is run with every method against the delay, on
the rig with its own lag and with more, which the loop knows; and with what it does not know: a
lead that is 0.5 or 1 ms too short or too long, a stick 0.8 or 1.25 times as stiff as believed. A
cell is good where R_e, R_T, peak and the RMS error of the force are all within 1, 2 or 5 %. That
makes 196 tests a method, half a minute of a core for each.

The directory holds stability.csv (one row a cell), stability.svg and stability.json (what --json
prints).

Examples:
  docktwin analyze stability models/urdf/stewart.toml
  docktwin analyze stability models/urdf/electric_hexapod.toml --compensator lead --compensator twin
  docktwin analyze stability models/urdf/stewart.toml --axis y --added-ms 0 --added-ms 30 --json";

/// Most ticks of a millisecond that a command can be held back by.
const MOST_ADDED_MS: i64 = 30;

/// Options of `analyze stability`.
#[derive(Debug, Args)]
pub(crate) struct StabilityArgs {
    /// TOML or URDF of the rig, the other beside it
    #[arg(value_name = "RIG")]
    rig: PathBuf,
    /// Method against the delay, repeatable [default: all but twin-model-only]
    #[arg(long, value_parser = compensator, value_name = CompensatorChoice::NAMES)]
    compensator: Vec<CompensatorChoice>,
    /// x, y, z, roll, pitch or yaw
    #[arg(long, default_value = "x")]
    axis: AxisSet,
    /// Delay added to that of the rig, whole ms, repeatable [default: 0, 5, 10 and 20]
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u8).range(0..=MOST_ADDED_MS))]
    added_ms: Vec<u8>,
    /// Oil volume [default: as the file says]
    #[arg(long, value_enum)]
    preset: Option<PresetArg>,
    /// Seed of the noise
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Directory of the results; by default a new one under `analysis`.
    #[arg(long, value_name = "DIR", help = "Directory [default: analysis/RIG-stability-<utc>]")]
    out: Option<PathBuf>,
}

/// Runs the command.
pub(super) fn run(args: &StabilityArgs, json: bool) -> Result<ExitCode, Failure> {
    let models = StickModels::load(&args.rig)?;
    let [axis] = args.axis.axes() else {
        return Err(Failure::Usage {
            what: format!("{} are several axes", args.axis),
            remedy: "give one: a map is of one axis".to_owned(),
        });
    };
    let mut chosen = args.compensator.clone();
    if chosen.is_empty() {
        chosen.extend(CompensatorChoice::WORDS.map(|(_, choice)| choice));
        chosen.retain(|c| *c != CompensatorChoice::TwinModelOnly);
    }
    let mut once = Vec::new();
    chosen.retain(|c| {
        let new = !once.contains(c);
        once.push(*c);
        new
    });
    let methods = chosen.into_iter().map(|c| compensation(c, 0.0));
    let mut added =
        if args.added_ms.is_empty() { vec![0, 5, 10, 20] } else { args.added_ms.clone() };
    added.sort_unstable();
    added.dedup();
    let options = StabilityOptions {
        methods: methods.collect::<Result<_, _>>()?,
        axis: *axis,
        added_ticks: added.into_iter().map(usize::from).collect(),
        mismatches: Mismatch::ALL.to_vec(),
        preset: args.preset.map(PresetArg::preset),
        seed: args.seed,
    };
    let mut out = Results::new(args.out.as_deref(), &format!("{}-stability", models.rig.name))?;
    let found = stability(&models.models(), &options, &mut Bars::new(json)).map_err(|e| {
        Failure::Usage {
            what: e.to_string(),
            remedy: "see docs/bring-up-a-rig.md for what a rig needs before a test".to_owned(),
        }
    })?;
    out.tables(report::tables(&found))?;
    out.plots(report::plots(&found))?;
    let answer = serde_json::json!({
        "rig": found.rig, "lead_s": found.lead_s, "axis": found.axis, "reach": found.reach(),
        "cells": found.cells,
    });
    out.finish("stability", &answer, &report::words(&found), json)
}
