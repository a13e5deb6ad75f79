//! A rig as every command meets it: where it is, who lets it move, what the machine grants the loop
//! around it, and what was found out about it beforehand.

use core::{fmt, str::FromStr};
use std::{
    io::{BufRead as _, IsTerminal as _, Write as _},
    path::Path,
    time::Duration,
};

use clap::Args;
use docktwin::rigfile::{CalibrationFile, IdentificationFile, Read, RigFile, read};
use docktwin_control::compensation::{Compensation, MOST_LEAD_S};
use docktwin_hil::{
    calibrate::Calibration,
    clock::Clock,
    identify::Identification,
    realtime::{RealtimeReport, RealtimeSetup, Shortage, keep_others_off},
};
use docktwin_model::Rig as RigModel;
use docktwin_rigport::ipc::IpcRig;
use docktwin_scenario::CompensatorChoice;

use crate::{cli::ClockArg, failure::Failure};

pub(crate) use docktwin_core::PERIOD_NS;

/// How long a rig in another process may take over a tick in lockstep, and to be found at all.
const LOCKSTEP_PATIENCE: Duration = Duration::from_secs(5);
const CONNECT_PATIENCE: Duration = Duration::from_secs(10);

/// Where a rig is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum RigPlace {
    /// Emulated in this process.
    Emulated,
    /// Behind the port of this name, and perhaps of steel.
    Port(String),
}

impl FromStr for RigPlace {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.strip_prefix("ipc:")) {
            ("emulated", _) => Ok(Self::Emulated),
            (_, Some(name)) if !name.is_empty() => Ok(Self::Port(name.to_owned())),
            _ => Err("take `emulated`, or `ipc:NAME` of a rig that runs as \
                      `docktwin rig emulate RIG.toml --name NAME`"
                .to_owned()),
        }
    }
}

impl fmt::Display for RigPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Emulated => f.write_str("emulated"),
            Self::Port(name) => write!(f, "ipc:{name}"),
        }
    }
}

/// A number for a run that no earlier one has had.
pub(crate) fn new_session() -> u64 {
    u64::try_from(jiff::Timestamp::now().as_nanosecond()).unwrap_or(1).max(1)
}

/// Finds the rig behind a port.
pub(crate) fn connect(name: &str) -> Result<IpcRig, Failure> {
    IpcRig::connect(name, CONNECT_PATIENCE).map_err(|e| Failure::Usage {
        what: e.to_string(),
        remedy: format!("start it with `docktwin rig emulate RIG.toml --name {name}`"),
    })
}

/// How long a loop with this clock waits for a measurement.
pub(crate) const fn patience<K: Clock>() -> Duration {
    if K::LOCKSTEP { LOCKSTEP_PATIENCE } else { Duration::ZERO }
}

/// A rig behind a port may be of steel: it moves when somebody has said so, by `--yes` or at the
/// terminal. An emulated one is not asked about.
pub(crate) fn confirm(place: &RigPlace, yes: bool) -> Result<(), Failure> {
    if *place == RigPlace::Emulated || yes {
        return Ok(());
    }
    let stdin = std::io::stdin();
    if !stdin.is_terminal() {
        return Err(Failure::Usage {
            what: "nobody is there to confirm that the rig may move".to_owned(),
            remedy: "run it in a terminal, or add --yes when the emergency stop has been tested \
                     and nobody is near the rig"
                .to_owned(),
        });
    }
    eprint!("Emergency stop tested, nobody near the rig? Type `arm`: ");
    let _ = std::io::stderr().flush();
    let mut line = String::new();
    let read = stdin.lock().read_line(&mut line);
    if read.is_ok() && line.trim() == "arm" {
        return Ok(());
    }
    Err(Failure::Usage {
        what: "not confirmed: nothing has moved".to_owned(),
        remedy: "test the emergency stop, see that nobody is near the rig, and type `arm`"
            .to_owned(),
    })
}

/// How a rig is led, and with whose leave.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct LedArgs {
    /// What drives the ticks
    #[arg(long, value_enum, default_value_t)]
    pub(crate) clock: ClockArg,
    /// Confirm beforehand that the emergency stop was tested and nobody is near the rig
    #[arg(long)]
    pub(crate) yes: bool,
    #[command(flatten)]
    pub(crate) realtime: RealtimeArgs,
}

/// What a loop asks of the machine, in real time.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct RealtimeArgs {
    /// Run in real time on what the machine grants, and say so; a verdict is then `degraded`
    #[arg(long)]
    pub(crate) allow_best_effort: bool,
    /// Core to keep to, in real time; whatever else this process does goes elsewhere
    #[arg(long, value_name = "N")]
    pub(crate) core: Option<usize>,
}

impl RealtimeArgs {
    /// Asks for it, for this thread. `realtime::relax` gives it back.
    pub(crate) fn apply(&self) -> Result<RealtimeReport, Failure> {
        let shortage = if self.allow_best_effort { Shortage::BestEffort } else { Shortage::Refuse };
        let setup = RealtimeSetup { core: self.core, ..RealtimeSetup::default() };
        let report = setup.apply(shortage).map_err(|e| Failure::Usage {
            what: e.to_string(),
            remedy: "`docktwin doctor` tells what mends it; --allow-best-effort does without"
                .to_owned(),
        })?;
        if let Some(core) = self.core {
            keep_others_off(core);
        }
        Ok(report)
    }

    /// The same, and tells what is lacking.
    pub(crate) fn apply_aloud(&self) -> Result<(), Failure> {
        if let Some(lacking) = best_effort(&self.apply()?) {
            eprintln!("{lacking}");
        }
        Ok(())
    }
}

/// What is lacking, if anything is.
pub(crate) fn best_effort(report: &RealtimeReport) -> Option<String> {
    let words: Vec<String> = report.shortfalls.iter().map(|s| s.step.to_string()).collect();
    report.is_best_effort().then(|| format!("best effort: without {}", words.join(", ")))
}

/// A compensator that was chosen, and its lead.
pub(crate) fn compensation(
    choice: CompensatorChoice,
    lead_s: f64,
) -> Result<Compensation, Failure> {
    if !(0.0..=MOST_LEAD_S).contains(&lead_s) {
        return Err(Failure::Usage {
            what: format!("a lead of {lead_s} s"),
            remedy: format!("give 0 to {} ms with --lead-ms", MOST_LEAD_S * 1e3),
        });
    }
    Ok(match choice {
        CompensatorChoice::None => Compensation::None,
        CompensatorChoice::Lead => Compensation::Lead(lead_s),
    })
}

fn made_for<T: RigFile>(path: &Path, rig: &RigModel) -> Result<Read<T>, Failure> {
    let file = read::<T>(path)?;
    file.made_for(rig)?;
    Ok(file)
}

/// A file of `rig identify` that was made for this rig.
pub(crate) fn identification(
    path: &Path,
    rig: &RigModel,
) -> Result<(Read<IdentificationFile>, Identification), Failure> {
    let file = made_for::<IdentificationFile>(path, rig)?;
    let found = file.content.identification().ok_or_else(|| Failure::Usage {
        what: format!(
            "a leg is missing or too many, or a response has no amplitude: {}",
            path.display()
        ),
        remedy: "make it again with `docktwin rig identify`".to_owned(),
    })?;
    Ok((file, found))
}

/// A file of `rig calibrate` that was made for this rig.
pub(crate) fn calibration(
    path: &Path,
    rig: &RigModel,
) -> Result<(Read<CalibrationFile>, Calibration), Failure> {
    let file = made_for::<CalibrationFile>(path, rig)?;
    let found = file.content.calibration();
    Ok((file, found))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_places_read_as_they_are_written() {
        for text in ["emulated", "ipc:lab", "ipc:ipc:x"] {
            assert_eq!(text.parse::<RigPlace>().expect("a place").to_string(), text);
        }
        for text in ["", "ipc:", "lab", "Emulated", "udp:lab"] {
            assert!(text.parse::<RigPlace>().is_err(), "{text}");
        }
    }

    #[test]
    fn oracle_an_emulated_rig_needs_nobody() {
        assert!(confirm(&RigPlace::Emulated, false).is_ok());
        assert!(confirm(&RigPlace::Port("lab".to_owned()), true).is_ok());
    }
}
