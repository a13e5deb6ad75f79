//! `replay`: the recorded inputs through the same twin, compared tick by tick.

use std::{path::Path, process::ExitCode};

use docktwin::{
    setup::{start, tick_digest},
    signals::input_columns,
};
use docktwin_core::{DVec3, Wrench};
use docktwin_model::FileDigest;
use docktwin_physics::reduced::{DockingTwin, Inputs, ReducedTwin};
use docktwin_record::{Cell, RunReader};
use docktwin_scenario::load_scenario;
use docktwin_twin::FullTwin;
use serde_json::json;

use crate::{
    cli::ReplayArgs,
    failure::{Failure, OTHERWISE},
    hil::RecordedTick,
    rehearse::digest_keys,
};

/// Steps in one tick, as a scenario may ask for.
const MOST_STEPS: u64 = 10_000;

/// What a replay found.
struct Found {
    ticks: u64,
    cut: Option<String>,
    first_difference: Option<(u64, f64, u64, u64)>,
}

/// Runs the command.
pub(crate) fn run(args: &ReplayArgs, json: bool) -> Result<ExitCode, Failure> {
    let mut reader = RunReader::open(&args.run)?;
    let metadata = reader.metadata().clone();
    let of = |key: &str| {
        metadata.get(key).cloned().ok_or_else(|| Failure::Usage {
            what: format!("{} names no `{key}`", args.run.display()),
            remedy: "this recording was not made by `docktwin rehearse`".to_owned(),
        })
    };
    let number = |key: &str| {
        of(key)?.parse::<u64>().map_err(|e| Failure::Usage {
            what: format!("`{key}` of {}: {e}", args.run.display()),
            remedy: "the recording is damaged; use another copy".to_owned(),
        })
    };
    if of("command")? == "hil" {
        let found = against_rig(&mut reader, &args.run, &metadata)?;
        return Ok(told(&found, json));
    }
    let scenario = load_scenario(&args.run.join("scenario.toml"), &[])?;
    same_files(&scenario.files, &metadata, &args.run)?;
    let (tick_nanos, steps) = (number("tick_nanos")?, number("steps_per_tick")?);
    let damaged = |what: String| Failure::Usage {
        what: format!("{what}: {}", args.run.display()),
        remedy: "run.mcap and scenario.toml are not of one run, or damaged; use another copy"
            .to_owned(),
    };
    if tick_nanos != scenario.run.tick_nanos {
        return Err(damaged(format!(
            "the recording has ticks of {tick_nanos} ns, its scenario.toml of {} ns",
            scenario.run.tick_nanos
        )));
    }
    if !(1..=MOST_STEPS).contains(&steps) {
        return Err(damaged(format!(
            "the recording has {steps} steps in a tick; allowed: 1 to {MOST_STEPS}"
        )));
    }
    #[expect(clippy::cast_precision_loss, reason = "far below 2^53")]
    let h = tick_nanos as f64 / 1e9 / steps as f64;
    let twin = of("twin")?;
    let (system, bodies) = start(&scenario)?;
    let found = match twin.as_str() {
        "full" => compare(&mut reader, FullTwin::new(system, bodies, h), steps, &args.run)?,
        "reduced" => compare(&mut reader, ReducedTwin::new(system, bodies, h), steps, &args.run)?,
        other => {
            return Err(Failure::Usage {
                what: format!(
                    "the recording was made by a twin called `{other}`: {}",
                    args.run.display()
                ),
                remedy: "this version knows `full` and `reduced`".to_owned(),
            });
        }
    };
    Ok(told(&found, json))
}

/// Says what was found.
fn told(found: &Found, json: bool) -> ExitCode {
    let same = found.first_difference.is_none();
    if json {
        let difference = found.first_difference.map(|(tick, time_s, recorded, replayed)| {
            json!({
                "tick": tick, "time_s": time_s,
                "recorded": format!("{recorded:016x}"), "replayed": format!("{replayed:016x}"),
            })
        });
        println!(
            "{}",
            json!({ "identical": same, "ticks": found.ticks, "first_difference": difference, "cut": found.cut })
        );
    } else {
        if let Some(cut) = &found.cut {
            eprintln!("the recording is cut: {cut}");
        }
        match found.first_difference {
            None => println!("identical: {} ticks, every state digest the same", found.ticks),
            Some((tick, time_s, recorded, replayed)) => println!(
                "differs first at tick {tick} (t = {time_s:.3} s): recorded {recorded:016x}, replayed {replayed:016x}"
            ),
        }
    }
    ExitCode::from(if same { 0 } else { OTHERWISE })
}

/// A run against the emulated rig, once more.
fn against_rig(
    reader: &mut RunReader,
    run: &Path,
    metadata: &std::collections::BTreeMap<String, String>,
) -> Result<Found, Failure> {
    let columns = Columns::find(reader, run)?;
    let phase = Columns::index(reader, run, "loop_phase")?;
    let mut found = Found { ticks: 0, cut: None, first_difference: None };
    let ticks = &mut found.ticks;
    let difference = crate::hil::replay(run, metadata, || {
        Ok(reader.next_tick()?.map(|record| {
            *ticks += 1;
            RecordedTick {
                control: columns.control(&record.row),
                phase: record.row[phase].bits(),
                digest: record.row[columns.digest].bits(),
            }
        }))
    })?;
    #[expect(clippy::cast_precision_loss, reason = "exact below 2^53 ticks")]
    let differs = difference.map(|(tick, then, now)| (tick, tick as f64 * 1e-3, then, now));
    found.first_difference = differs;
    found.cut = reader.cut().map(|c| c.to_string());
    Ok(found)
}

/// Where control wrenches and digest stand in a row.
struct Columns {
    inputs: Vec<usize>,
    digest: usize,
}

impl Columns {
    fn find(reader: &RunReader, run: &Path) -> Result<Self, Failure> {
        let inputs = input_columns()
            .iter()
            .map(|n| Self::index(reader, run, n))
            .collect::<Result<_, _>>()?;
        Ok(Self { inputs, digest: Self::index(reader, run, "state_digest")? })
    }

    fn index(reader: &RunReader, run: &Path, name: &str) -> Result<usize, Failure> {
        reader.column_index(name).ok_or_else(|| Failure::Usage {
            what: format!("{} has no column `{name}`", run.display()),
            remedy: "the recording was made by another version; replay it with that one".to_owned(),
        })
    }

    fn control(&self, row: &[Cell]) -> Inputs {
        let number = |i: usize| f64::from_bits(Cell::bits(row[self.inputs[i]]));
        let vector = |i: usize| DVec3::new(number(i), number(i + 1), number(i + 2));
        Inputs {
            chaser: Wrench { f: vector(0), m: vector(3) },
            target: Wrench { f: vector(6), m: vector(9) },
        }
    }
}

fn same_files(
    files: &[FileDigest],
    metadata: &std::collections::BTreeMap<String, String>,
    run: &Path,
) -> Result<(), Failure> {
    let changed: Vec<String> = digest_keys(files)
        .filter_map(|(key, f)| {
            let then = metadata.get(&key)?;
            (*then != f.digest.to_string())
                .then(|| format!("{} was {then}, is {}", f.path.display(), f.digest))
        })
        .collect();
    if changed.is_empty() {
        return Ok(());
    }
    Err(Failure::Usage {
        what: format!(
            "model files changed since {} was recorded:\n{}",
            run.display(),
            changed.join("\n")
        ),
        remedy: "restore the files of that day, or rehearse again".to_owned(),
    })
}

fn compare<T: DockingTwin>(
    reader: &mut RunReader,
    mut twin: T,
    steps: u64,
    run: &Path,
) -> Result<Found, Failure> {
    let columns = Columns::find(reader, run)?;
    let mut found = Found { ticks: 0, cut: None, first_difference: None };
    while let Some(record) = reader.next_tick()? {
        found.ticks += 1;
        let control = columns.control(&record.row);
        let recorded = record.row[columns.digest].bits();
        let replayed = tick_digest(twin.digest(), &control).short();
        if recorded != replayed {
            found.first_difference =
                Some((record.tick.0, record.time.seconds(), recorded, replayed));
            break;
        }
        for _ in 0..steps {
            twin.step(&control);
        }
    }
    found.cut = reader.cut().map(|c| c.to_string());
    if found.ticks == 0 {
        let why = found.cut.unwrap_or_else(|| "it ends before the first".to_owned());
        return Err(Failure::Usage {
            what: format!("no tick can be read from the recording: {why}: {}", run.display()),
            remedy: "use another copy, or rehearse again".to_owned(),
        });
    }
    Ok(found)
}
