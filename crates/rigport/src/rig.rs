//! A rig as the loop sees it, and as it sees the loop.

use core::time::Duration;

use crate::message::{LEGS, Refusal, RigCommand, RigMeasurement};

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

/// The rig as the loop sees it: emulated in process, another process, or a physical rig.
///
/// Called in the real-time loop: nothing here allocates, locks, logs or waits longer than
/// `patience`.
pub trait Rig {
    /// Sends the command of a tick.
    ///
    /// # Errors
    /// See [`RigError`].
    fn send(&mut self, command: &RigCommand) -> Result<(), RigError>;

    /// The newest measurement that has not been handed out, validated (see
    /// [`crate::validate::Sequence::measurement`]); waits up to `patience` for one to come. `None` when
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

/// Which numbers of a command a rig follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandForm {
    /// Legs that follow the values of their own, at most [`LEGS`]; 0 for a rig that takes no leg values.
    pub legs: u32,
    /// Whether it follows the plate's pose and twist in a command without leg values.
    pub pose: bool,
}

impl CommandForm {
    /// Six legs, and no command without them.
    pub const LEGS: Self = Self { legs: LEGS as u32, pose: false };
    /// The plate's pose and twist alone.
    pub const POSE: Self = Self { legs: 0, pose: true };
    /// Either: six legs where a command has them, else the plate's pose.
    pub const EITHER: Self = Self { legs: LEGS as u32, pose: true };

    /// Whether a tracking command with the values of so many legs can be followed.
    #[must_use]
    pub const fn follows(self, leg_count: u32) -> bool {
        match (leg_count, self.legs) {
            (0, _) => self.pose,
            // Leg values that nobody looks at do no harm.
            (_, 0) => true,
            (n, legs) => n == legs,
        }
    }
}

/// What stands behind the rig's end of the port.
pub trait Plant {
    /// Which numbers of a command it follows; the same as long as it lives.
    fn command_form(&self) -> CommandForm;

    /// Takes a validated command, advances by its period, and gives what is measured at its end.
    /// Version, session, tick, stamp and the capabilities of [`Plant::command_form`] are filled in by
    /// the port.
    fn answer(&mut self, command: &RigCommand) -> RigMeasurement;

    /// One tick without a command, or with one that was refused: leaves the commands, comes to rest
    /// and holds.
    fn alone(&mut self, period_ns: u64) -> RigMeasurement;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_which_commands_a_rig_follows() {
        let six_legs = [(0, false), (5, false), (6, true)];
        let pose = [(0, true), (5, true), (6, true)];
        let either = [(0, true), (5, false), (6, true)];
        for (form, cases) in [
            (CommandForm::LEGS, six_legs),
            (CommandForm::POSE, pose),
            (CommandForm::EITHER, either),
        ] {
            for (legs, expected) in cases {
                assert_eq!(form.follows(legs), expected, "{form:?}, {legs} legs");
            }
        }
    }
}
