//! A rig in the loop's own process: a plant behind the same judging as at the end of a wire.

use core::time::Duration;

use crate::{
    desk::{DeskCounts, RigDesk},
    port::{RigCommand, RigMeasurement, Sequence, status},
    realtime::monotonic_ns,
    rig::{Plant, Rig, RigError},
};

/// Any plant as a [`Rig`]. It answers at once, so nothing here waits.
#[derive(Clone, Debug)]
pub struct InProcess<P> {
    plant: P,
    desk: RigDesk,
    sequence: Sequence,
    answer: Option<RigMeasurement>,
}

impl<P: Plant> InProcess<P> {
    /// Before the first command.
    pub fn new(plant: P) -> Self {
        Self { plant, desk: RigDesk::new(), sequence: Sequence::default(), answer: None }
    }

    /// The plant.
    pub fn plant(&self) -> &P {
        &self.plant
    }

    /// What the rig's end has seen.
    pub fn counts(&self) -> DeskCounts {
        self.desk.counts()
    }

    /// One period without a command, as when a loop has fallen silent.
    pub fn silence(&mut self) -> RigMeasurement {
        self.desk.silence(&mut self.plant, monotonic_ns())
    }
}

impl<P: Plant> Rig for InProcess<P> {
    fn send(&mut self, command: &RigCommand) -> Result<(), RigError> {
        if command.session != self.sequence.session {
            self.sequence = Sequence { session: command.session, tick: None };
        }
        self.answer = Some(self.desk.command(&mut self.plant, command, monotonic_ns()));
        Ok(())
    }

    fn receive(
        &mut self,
        _patience: Duration,
        now_ns: u64,
    ) -> Result<Option<RigMeasurement>, RigError> {
        let Some(m) = self.answer.take() else { return Ok(None) };
        if m.has(status::UNASKED) {
            return Ok(None);
        }
        self.sequence.measurement(&m, now_ns).map_err(RigError::Refused)?;
        Ok(Some(m))
    }
}
