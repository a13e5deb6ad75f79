//! `validate fidelity`: dockings on the emulated rig against the simulated system, and what they differ by.

use std::{fmt::Write as _, path::PathBuf, process::ExitCode};

use clap::Args;
use docktwin_report::study::fidelity as report;
use docktwin_run::{HilOptions, HilRun};
use docktwin_scenario::{Scenario, load_scenario};
use docktwin_study::fidelity::{
    Cause, budget,
    draws::{DrawOptions, Draws, draws},
    offloads::{Balanced, offload_map},
    on_rig,
};
use serde_json::json;

use crate::{
    args::OnRigArgs,
    failure::{Failure, OTHERWISE},
    inputs::overrides,
    results::{Bars, Results},
};

pub(super) const EXAMPLES: &str = "\
Every scenario is run in the loop with the emulated rig and compared with the same docking without a
rig: what the bodies' programme felt, and what the hardware bore. Peaks are over those of the
simulated system; force and pose are RMS differences over the RMS of the simulated one, from first
contact to one second after capture, or of the whole run where that does not hold it.

With --budget one cause after the other is taken out of the rig, and put alone into a rig without
any: weight of the ring, single-sensor scheme, noise, dead zone and lag of the sensors, dead time
of the legs, their oil, valves and seals, the rack, which does not give way as the chaser does in
orbit, and the mounts of a drawn mechanism. What a cause adds by either way differs where causes
interact. That makes 24 runs a scenario. With --without the scenarios run once, these causes taken
away.

With --draws the rig's mechanism is drawn N times within [spread] of its file, mounts included, and
compared with the simulated system that has the drawn mechanism: outcomes, and the distribution of
every figure. Draws whose simulated outcome a shift of the initial position by 50 um turns are named
and left out. That makes five rehearsals and a run on the rig a draw, on all cores.

With --offload-map the rig's balance is varied: 90, 95, 98 and 100 % of the ring's weight carried,
0, 5, 10 and 20 N of friction, 0, 2, 10 and 40 kg of moving mass, each with each. The table says
what each costs and what the mechanism does not bear. That makes 64 runs a scenario, on all cores.

--compensator twin is to be seen beside twin-model-only, which leaves out what was measured:
where the rig's mechanism is not the believed one, that must be clearly worse.

The directory holds fidelity.json (what --json prints), with --budget also fidelity-budget.csv and a
plot of every scenario, with --draws fidelity-draws.csv (one row a draw) and
fidelity-distribution.csv, with --offload-map fidelity-offload.csv and two plots of every scenario.

Examples:
  docktwin validate fidelity scenarios/apas_nominal.toml scenarios/apas_fast.toml
  docktwin validate fidelity scenarios/apas_fast.toml --budget
  docktwin validate fidelity scenarios/apas_fast.toml --without legs --without rack
  docktwin validate fidelity scenarios/apas_fast.toml --compensator twin --mechanism-draw 3
  docktwin validate fidelity scenarios/heavy_pair.toml --compensator none --set run.duration_s=5 --json
  docktwin validate fidelity scenarios/apas_fast.toml --perturb 7 --identification p7.toml
  docktwin validate fidelity scenarios/apas_fast.toml --draws 100 --mechanism-grade coarse
  docktwin validate fidelity scenarios/apas_fast.toml --offload-map --set run.duration_s=8
  docktwin validate fidelity scenarios/apas_fast.toml \\
      --rig-mechanism models/foreign/apas_hertz_active.toml

Exit codes: 0 every run came to its end; 1 the supervisor stopped one; 2 bad input.";

/// Options of `validate fidelity`.
#[derive(Debug, Args)]
pub(crate) struct FidelityArgs {
    /// Scenario files
    #[arg(required = true)]
    scenarios: Vec<PathBuf>,
    /// Take one cause of deviation after the other away
    #[arg(long)]
    budget: bool,
    /// Take these causes away, `all` or names as in fidelity.json, repeatable
    #[arg(long, value_name = "CAUSE", value_parser = causes, conflicts_with_all = ["budget", "draws"])]
    without: Vec<Causes>,
    /// Draw the rig's mechanism so many times, from 1 on
    #[arg(long, value_name = "N", conflicts_with = "budget",
        value_parser = clap::value_parser!(u32).range(1..=100_000))]
    draws: Option<u32>,
    /// Vary the rig's balance
    #[arg(long, conflicts_with_all = ["budget", "draws", "without"])]
    offload_map: bool,
    #[command(flatten)]
    on_rig: OnRigArgs,
    /// Directory of the results; by default a new one under `analysis`.
    #[arg(long, value_name = "DIR", help = "Directory [default: analysis/fidelity-<utc>]")]
    out: Option<PathBuf>,
}

/// One cause, or all.
#[derive(Clone, Debug)]
struct Causes(Vec<Cause>);

fn causes(text: &str) -> Result<Causes, String> {
    if text == "all" {
        return Ok(Causes(Cause::ALL.to_vec()));
    }
    let found = Cause::ALL.into_iter().find(|c| c.name() == text);
    found
        .map(|c| Causes(vec![c]))
        .ok_or_else(|| format!("give all or one of {}", Cause::ALL.map(Cause::name).join(", ")))
}

/// In a budget the lead follows the delays that are left in the rig: a given one would be too long for them.
fn refuse_given_lead(args: &FidelityArgs, all: &[Scenario]) -> Result<(), Failure> {
    let given = |s: &&Scenario| s.hil.lead_s.is_some();
    let where_ = match (args.on_rig.lead_ms, all.iter().find(given)) {
        (Some(_), _) => "--lead-ms".to_owned(),
        (None, Some(s)) => format!("loop.lead_s of {}", s.name),
        (None, None) if args.on_rig.identification.is_some() => "--identification".to_owned(),
        (None, None) => return Ok(()),
    };
    Err(Failure::Usage {
        what: format!("{where_} fixes the lead, but --budget and --without take delays away"),
        remedy: "leave it out: the lead then follows the rig".to_owned(),
    })
}

/// Runs the command.
pub(super) fn run(args: &FidelityArgs, json: bool) -> Result<ExitCode, Failure> {
    let mechanism = match args.draws {
        Some(_) => args.on_rig.mechanism.of_draws()?,
        None => args.on_rig.mechanism.options()?,
    };
    let options = args.on_rig.options_with(mechanism);
    let set = overrides(&args.on_rig.set)?;
    let all = args
        .scenarios
        .iter()
        .map(|path| load_scenario(path, &set))
        .collect::<Result<Vec<_>, _>>()?;
    // Before the first run, so that a later scenario that the rig cannot run costs no figures.
    for scenario in &all {
        HilRun::new(scenario, options.clone())?;
    }
    let results = Results::new(args.out.as_deref(), "fidelity")?;
    let removed: Vec<Cause> = args.without.iter().flat_map(|c| c.0.iter().copied()).collect();
    if args.budget || !removed.is_empty() {
        refuse_given_lead(args, &all)?;
    }
    if args.budget {
        return of_budgets(&all, &options, results, json);
    }
    if args.offload_map {
        return of_offloads(&all, &options, results, json);
    }
    if let Some(n) = args.draws {
        let asked = DrawOptions { draws: n, grade: args.on_rig.mechanism.grade() };
        return of_draws(&all, &options, asked, results, json);
    }
    let mut found = Vec::new();
    for scenario in &all {
        found.push((scenario.name.clone(), on_rig(scenario, &options, &removed)?));
    }
    let scenarios: Vec<_> = found
        .iter()
        .map(|(name, on)| {
            json!({
                "scenario": name, "outcome": on.outcome, "stopped": on.stopped,
                "window": on.window(), "fidelity": on.fidelity, "without": removed,
            })
        })
        .collect();
    let all = json!({ "scenarios": scenarios });
    let mut words = report::words(&found);
    if !removed.is_empty() {
        let names: Vec<_> = removed.iter().map(|c| c.name()).collect();
        let _ = writeln!(words, "taken away: {}", names.join(", "));
    }
    let code = results.finish("fidelity", &all, &words, json)?;
    let stopped = found.iter().any(|(_, on)| on.stopped.is_some());
    Ok(if stopped { ExitCode::from(OTHERWISE) } else { code })
}

fn exit(code: ExitCode, stopped: bool) -> ExitCode {
    if stopped { ExitCode::from(OTHERWISE) } else { code }
}

fn of_budgets(
    all: &[Scenario],
    options: &HilOptions,
    mut results: Results,
    json: bool,
) -> Result<ExitCode, Failure> {
    let of = |scenario| budget(scenario, options, &mut Bars::new(json));
    let budgets = all.iter().map(of).collect::<Result<Vec<_>, _>>()?;
    results.tables(report::tables(&budgets))?;
    results.plots(report::plots(&budgets))?;
    let words: String = budgets.iter().map(report::budget_words).collect();
    let code = results.finish("fidelity", &json!({ "budgets": budgets }), &words, json)?;
    Ok(exit(code, budgets.iter().any(|b| b.stopped().next().is_some())))
}

fn of_draws(
    all: &[Scenario],
    options: &HilOptions,
    asked: DrawOptions,
    mut results: Results,
    json: bool,
) -> Result<ExitCode, Failure> {
    let of = |scenario| draws(scenario, options, asked, &mut Bars::new(json));
    let found = all.iter().map(of).collect::<Result<Vec<Draws>, _>>()?;
    results.tables(report::draw_tables(&found))?;
    let words: String = found.iter().map(report::draw_words).collect();
    let code = results.finish("fidelity", &report::draws_json(&found), &words, json)?;
    Ok(exit(code, found.iter().any(|d| d.stopped().next().is_some())))
}

fn of_offloads(
    all: &[Scenario],
    options: &HilOptions,
    mut results: Results,
    json: bool,
) -> Result<ExitCode, Failure> {
    let of = |scenario| offload_map(scenario, options, &mut Bars::new(json));
    let maps = all.iter().map(of).collect::<Result<Vec<_>, _>>()?;
    results.tables(report::offload_tables(&maps))?;
    results.plots(report::offload_plots(&maps))?;
    let words: String = maps.iter().map(report::offload_words).collect();
    let code = results.finish("fidelity", &json!({ "offload_maps": maps }), &words, json)?;
    let stopped = |b: &Balanced| b.on_rig.as_ref().is_some_and(|on| on.stopped.is_some());
    Ok(exit(code, maps.iter().any(|m| m.balances.iter().any(stopped))))
}
