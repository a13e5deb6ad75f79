//! Where a rig is, confirmation by the operator, real-time settings of the machine, and files of
//! identification and calibration.

use core::{fmt, str::FromStr};
use std::{path::Path, time::Duration};

use docktwin_control::compensation::{
    Compensation, Learning, MOST_LEAD_S, Order, Published, Residual,
};
use docktwin_hil::{
    calibrate::Calibration,
    clock::Clock,
    identify::Identification,
    realtime::{RealtimeReport, RealtimeSetup, Shortage, keep_others_off},
    scheduler::Check,
};
use docktwin_model::Rig as RigModel;
use docktwin_rigport::ipc::IpcRig;
use docktwin_scenario::CompensatorChoice;

use crate::{
    error::RunError,
    rigfile::{CalibrationFile, IdentificationFile, Read, RigFile, read},
};

/// How long a rig in another process may take over a tick in lockstep, and to be found at all.
const LOCKSTEP_PATIENCE: Duration = Duration::from_secs(5);
const CONNECT_PATIENCE: Duration = Duration::from_secs(10);

/// Where a rig is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum RigPlace {
    /// Emulated in this process.
    #[default]
    Emulated,
    /// Through the rig port of this name; may be a physical rig.
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

/// What drives the ticks of a loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClockKind {
    /// As fast as loop and rig can, in lockstep.
    #[default]
    Virtual,
    /// Real time.
    Realtime,
}

impl ClockKind {
    /// Its word in recordings and on command lines.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Virtual => "virtual",
            Self::Realtime => "realtime",
        }
    }
}

/// The person responsible for the rig.
pub trait Operator {
    /// Whether the rig at this place may move now. Called for a rig at the rig port, which may be a
    /// physical one, not for an emulated rig in this process.
    ///
    /// # Errors
    /// It may not: nothing moves.
    fn confirm(&mut self, place: &RigPlace) -> Result<(), RunError>;

    /// The checklist as it was passed.
    fn checklist(&mut self, _checks: &[Check]) {}

    /// Something to know that stops nothing, such as what the machine does not grant.
    fn note(&mut self, _text: &str) {}
}

/// Lets any rig move: for a program that has asked before.
impl Operator for () {
    fn confirm(&mut self, _place: &RigPlace) -> Result<(), RunError> {
        Ok(())
    }
}

impl<O: Operator + ?Sized> Operator for &mut O {
    fn confirm(&mut self, place: &RigPlace) -> Result<(), RunError> {
        (**self).confirm(place)
    }

    fn checklist(&mut self, checks: &[Check]) {
        (**self).checklist(checks);
    }

    fn note(&mut self, text: &str) {
        (**self).note(text);
    }
}

/// Asks where it has to be asked.
///
/// # Errors
/// The rig may not move.
pub fn confirm(operator: &mut impl Operator, place: &RigPlace) -> Result<(), RunError> {
    if *place == RigPlace::Emulated { Ok(()) } else { operator.confirm(place) }
}

/// A number for a run that no earlier one has had.
#[must_use]
pub fn new_session() -> u64 {
    u64::try_from(jiff::Timestamp::now().as_nanosecond()).unwrap_or(1).max(1)
}

/// Connects to a rig through the rig port.
///
/// # Errors
/// There is none.
pub fn connect(name: &str) -> Result<IpcRig, RunError> {
    IpcRig::connect(name, CONNECT_PATIENCE).map_err(|e| {
        RunError::usage(
            e.to_string(),
            format!("start it with `docktwin rig emulate RIG.toml --name {name}`"),
        )
    })
}

/// How long a loop with this clock waits for a measurement.
#[must_use]
pub const fn patience<K: Clock>() -> Duration {
    if K::LOCKSTEP { LOCKSTEP_PATIENCE } else { Duration::ZERO }
}

/// What a loop asks of the machine, in real time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RealtimeOptions {
    /// Run on what the machine grants; a verdict is then `degraded`.
    pub best_effort: bool,
    /// Core to keep to; whatever else this process does goes elsewhere.
    pub core: Option<usize>,
}

impl RealtimeOptions {
    /// Asks for it, for this thread. [`docktwin_hil::realtime::relax`] gives it back.
    ///
    /// # Errors
    /// The machine does not grant it all, and best effort is not enough.
    pub fn apply(&self) -> Result<RealtimeReport, RunError> {
        let shortage = if self.best_effort { Shortage::BestEffort } else { Shortage::Refuse };
        let setup = RealtimeSetup { core: self.core, ..RealtimeSetup::default() };
        let report = setup.apply(shortage).map_err(|e| {
            RunError::usage(
                e.to_string(),
                "`docktwin doctor` tells what mends it; --allow-best-effort does without",
            )
        })?;
        if let Some(core) = self.core {
            keep_others_off(core);
        }
        Ok(report)
    }
}

/// What is lacking, if anything is.
#[must_use]
pub fn best_effort(report: &RealtimeReport) -> Option<String> {
    let words: Vec<String> = report.shortfalls.iter().map(|s| s.step.to_string()).collect();
    report.is_best_effort().then(|| format!("best effort: without {}", words.join(", ")))
}

/// A compensator that was chosen, and its lead.
///
/// # Errors
/// The lead is out of range.
pub fn compensation(choice: CompensatorChoice, lead_s: f64) -> Result<Compensation, RunError> {
    if choice != CompensatorChoice::None && !(0.0..=MOST_LEAD_S).contains(&lead_s) {
        return Err(RunError::usage(
            format!("a lead of {lead_s} s, given or believed by the delays of the rig"),
            format!("give 0 to {} ms with --lead-ms", MOST_LEAD_S * 1e3),
        ));
    }
    let published = |method| Compensation::Published { method, lead_s };
    Ok(match choice {
        CompensatorChoice::None => Compensation::None,
        CompensatorChoice::Lead => Compensation::Lead(lead_s),
        CompensatorChoice::ForceLead => published(Published::ForceLead),
        CompensatorChoice::Pe1 => published(Published::Polynomial(Order::First)),
        CompensatorChoice::Pe2 => published(Published::Polynomial(Order::Second)),
        CompensatorChoice::Pe3 => published(Published::Polynomial(Order::Third)),
        CompensatorChoice::StateForceInverse => published(Published::StateForceInverse),
        CompensatorChoice::SmithLead => published(Published::SmithLead),
        CompensatorChoice::SmithDob => published(Published::SmithDob),
        CompensatorChoice::PriorForce => published(Published::PriorForce),
        CompensatorChoice::Ats => published(Published::Adaptive(Learning::TimeSeries)),
        CompensatorChoice::Amb => published(Published::Adaptive(Learning::Gradient)),
        CompensatorChoice::RlsInverse => published(Published::Adaptive(Learning::RecursiveLegs)),
        CompensatorChoice::UkfInverse => published(Published::Adaptive(Learning::Unscented)),
        CompensatorChoice::Passivity => published(Published::Passivity),
        CompensatorChoice::Twin => Compensation::Twin { lead_s, residual: Residual::Felt },
        CompensatorChoice::TwinModelOnly => {
            Compensation::Twin { lead_s, residual: Residual::LeftOut }
        }
    })
}

fn made_for<T: RigFile>(path: &Path, rig: &RigModel) -> Result<Read<T>, RunError> {
    let file = read::<T>(path)?;
    file.made_for(rig)?;
    Ok(file)
}

/// A file of `rig identify` that was made for this rig.
///
/// # Errors
/// It cannot be read, or belongs to another rig.
pub fn identification(
    path: &Path,
    rig: &RigModel,
) -> Result<(Read<IdentificationFile>, Identification), RunError> {
    let file = made_for::<IdentificationFile>(path, rig)?;
    let found = file.content.identification().ok_or_else(|| {
        RunError::usage(
            format!(
                "a leg is missing or too many, or lacks what another has, or a response has no amplitude: {}",
                path.display()
            ),
            "make it again with `docktwin rig identify`",
        )
    })?;
    Ok((file, found))
}

/// A file of `rig calibrate` that was made for this rig.
///
/// # Errors
/// It cannot be read, or belongs to another rig.
pub fn calibration(
    path: &Path,
    rig: &RigModel,
) -> Result<(Read<CalibrationFile>, Calibration), RunError> {
    let file = made_for::<CalibrationFile>(path, rig)?;
    let found = file.content.calibration();
    Ok((file, found))
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Nobody;

    impl Operator for Nobody {
        fn confirm(&mut self, _place: &RigPlace) -> Result<(), RunError> {
            Err(RunError::usage("nobody is there", ""))
        }
    }

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
        assert!(confirm(&mut Nobody, &RigPlace::Emulated).is_ok());
        assert!(confirm(&mut Nobody, &RigPlace::Port("lab".to_owned())).is_err());
    }
}
