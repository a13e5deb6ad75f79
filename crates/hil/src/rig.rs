//! A rig as the loop sees it, and as it sees the loop.

use core::time::Duration;

use crate::port::{Refusal, RigCommand, RigMeasurement};

/// What went wrong between loop and rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RigError {
    /// The rig does not answer any more.
    #[error("the rig does not answer: see that it runs, and whether it has stopped itself")]
    Gone,
    /// A measurement was refused; it was not used.
    #[error("a measurement was refused, {0}")]
    Refused(Refusal),
    /// The transport is broken.
    #[error("the connection to the rig is broken: start the rig again, then the loop")]
    Transport,
}

/// The rig, from the loop: emulated in process, another process, a rig of steel.
///
/// On the path of the loop: nothing here allocates, locks, logs or waits longer than asked.
pub trait Rig {
    /// Sends the command of a tick.
    ///
    /// # Errors
    /// See [`RigError`].
    fn send(&mut self, command: &RigCommand) -> Result<(), RigError>;

    /// The newest measurement that has not been handed out, judged (see
    /// [`crate::port::Sequence::measurement`]); waits up to `patience` for one to come. `None` when
    /// none came. `now_ns` is the clock of the time stamps.
    ///
    /// # Errors
    /// See [`RigError`]. After [`RigError::Refused`] the next one may be good.
    fn receive(
        &mut self,
        patience: Duration,
        now_ns: u64,
    ) -> Result<Option<RigMeasurement>, RigError>;
}

impl<R: Rig + ?Sized> Rig for &mut R {
    fn send(&mut self, command: &RigCommand) -> Result<(), RigError> {
        (**self).send(command)
    }

    fn receive(
        &mut self,
        patience: Duration,
        now_ns: u64,
    ) -> Result<Option<RigMeasurement>, RigError> {
        (**self).receive(patience, now_ns)
    }
}

/// What stands behind the rig's end of the port.
pub trait Plant {
    /// Takes a judged command, advances by its period, and says what is there at its end. Session,
    /// tick, stamp and version are filled in by the port.
    fn answer(&mut self, command: &RigCommand) -> RigMeasurement;

    /// One tick without a command, or with one that was refused: leaves the commands, comes to rest
    /// and holds.
    fn alone(&mut self, period_ns: u64) -> RigMeasurement;
}
