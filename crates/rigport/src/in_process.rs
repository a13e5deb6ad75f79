//! A rig in the loop's own process: a plant behind the same validation as at the end of a wire.

use core::time::Duration;

use crate::{
    clock::monotonic_ns,
    message::{RigCommand, RigMeasurement, Status},
    rig::{Plant, Rig, RigError},
    validate::{RigEnd, RigEndCounts, Sequence},
};

/// Any plant as a [`Rig`]. It answers at once, so nothing here waits.
#[derive(Clone, Debug)]
pub struct InProcess<P> {
    plant: P,
    end: RigEnd,
    sequence: Sequence,
    answer: Option<RigMeasurement>,
}

impl<P: Plant> InProcess<P> {
    /// Before the first command.
    pub fn new(plant: P) -> Self {
        Self { plant, end: RigEnd::new(), sequence: Sequence::default(), answer: None }
    }

    /// The plant.
    pub fn plant(&self) -> &P {
        &self.plant
    }

    /// What the rig's end has seen.
    pub fn counts(&self) -> RigEndCounts {
        self.end.counts()
    }

    /// One period without a command, as when a loop has fallen silent.
    pub fn silence(&mut self) -> RigMeasurement {
        self.end.silence(&mut self.plant, monotonic_ns())
    }
}

impl<P: Plant> Rig for InProcess<P> {
    fn send(&mut self, command: &RigCommand) -> Result<(), RigError> {
        if command.session != self.sequence.session {
            self.sequence = Sequence { session: command.session, tick: None };
        }
        self.answer = Some(self.end.command(&mut self.plant, command, monotonic_ns()));
        Ok(())
    }

    fn receive(
        &mut self,
        _patience: Duration,
        now_ns: u64,
    ) -> Result<Option<RigMeasurement>, RigError> {
        let Some(mut m) = self.answer.take() else { return Ok(None) };
        if m.is(Status::UNSOLICITED) {
            return Ok(None);
        }
        self.sequence.measurement(&mut m, now_ns).map_err(RigError::Refused)?;
        Ok(Some(m))
    }
}
