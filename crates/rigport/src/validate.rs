//! Validation of messages, whatever carries them, and the rig's end of the port: every command is
//! validated here before a plant sees it, and the safe state is kept here.

use core::time::Duration;

use crate::{
    message::{
        Capabilities, Flags, PERIODS_NS, PROTOCOL_VERSION, Refusal, RigCommand, RigMeasurement,
        RigMode, Status,
    },
    rig::{CommandForm, Plant},
};

/// What a side remembers of the other to validate its next message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sequence {
    /// Session in force, 0 before the first.
    pub session: u64,
    /// Last tick accepted in it.
    pub tick: Option<u64>,
}

impl Sequence {
    /// Validates a command at a rig that follows `form`; an accepted one becomes the last. `now_ns` is
    /// the clock of the time stamps, `None` in lockstep, where the rig has no clock of its own.
    ///
    /// # Errors
    /// Why the command is not to be used.
    pub fn command(
        &mut self,
        c: &RigCommand,
        form: CommandForm,
        now_ns: Option<u64>,
    ) -> Result<RigMode, Refusal> {
        if c.protocol_version != PROTOCOL_VERSION {
            return Err(Refusal::Version);
        }
        if !c.keeps_reserved() {
            return Err(Refusal::Reserved);
        }
        let mode = RigMode::from_number(c.mode).ok_or(Refusal::Mode)?;
        if mode == RigMode::Track && !form.follows(c.leg_count) {
            return Err(Refusal::Legs);
        }
        if !PERIODS_NS.contains(&c.period_ns) {
            return Err(Refusal::Period);
        }
        if c.session == 0 {
            return Err(Refusal::Session);
        }
        if c.session == self.session && self.tick.is_some_and(|last| c.tick <= last) {
            return Err(Refusal::TickBack);
        }
        if !c.is_finite() {
            return Err(Refusal::NotFinite);
        }
        if !c.is_in_range() {
            return Err(Refusal::Range);
        }
        if now_ns.is_some_and(|now| c.wakeup_ns > now) {
            return Err(Refusal::Future);
        }
        *self = Self { session: c.session, tick: Some(c.tick) };
        Ok(mode)
    }

    /// Validates a measurement at the loop, whose session is `self.session`; an accepted one becomes
    /// the last, and its numbers that do not hold become zero. `now_ns` is the clock of the time
    /// stamps: loop time in lockstep.
    ///
    /// A measurement with [`Status::REFUSED`] names the tick of a command that was not used, so that
    /// number is not validated and does not count.
    ///
    /// # Errors
    /// Why the measurement is not to be used.
    pub fn measurement(&mut self, m: &mut RigMeasurement, now_ns: u64) -> Result<(), Refusal> {
        if m.protocol_version != PROTOCOL_VERSION {
            return Err(Refusal::Version);
        }
        if !m.keeps_reserved() {
            return Err(Refusal::Reserved);
        }
        if m.session != self.session {
            return Err(Refusal::Session);
        }
        let refused = m.is(Status::REFUSED);
        if !refused && self.tick.is_some_and(|last| m.tick <= last) {
            return Err(Refusal::TickBack);
        }
        if !m.is_finite() {
            return Err(Refusal::NotFinite);
        }
        if !m.is_in_range() {
            return Err(Refusal::Range);
        }
        if m.stamp_ns > now_ns {
            return Err(Refusal::Future);
        }
        if !refused {
            self.tick = Some(m.tick);
        }
        m.clear_absent();
        Ok(())
    }
}

/// Periods without a good command after which a rig leaves the commands, in real time.
pub const SILENT_PERIODS: u64 = 10;

/// Numbers of [`Refusal`], 0 included.
const REFUSALS: usize = Refusal::ALL.len() + 1;

/// Between two ticks, ns, as long as no good command has said otherwise.
const DEFAULT_PERIOD_NS: u64 = 1_000_000;

/// What a rig's end has seen since it was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RigEndCounts {
    /// Commands that came, refused ones included.
    pub commands: u64,
    /// Refused commands by [`Refusal`] as number; index 0 stays 0.
    pub refused: [u64; REFUSALS],
    /// Ticks that the loop missed, as gaps in the numbers of its commands show.
    pub missed: u64,
    /// Commands that came after the instant their answer is for.
    pub late: u64,
    /// How often the safe state was entered.
    pub safe_states: u64,
}

impl RigEndCounts {
    /// Refused commands of all reasons.
    #[must_use]
    pub fn refused_in_all(&self) -> u64 {
        self.refused.iter().sum()
    }
}

/// The rig's end of one port.
#[derive(Clone, Copy, Debug)]
pub struct RigEnd {
    sequence: Sequence,
    /// The last command that the plant got.
    held: RigCommand,
    safe: bool,
    /// A stop was commanded and no idle command since.
    stopped: bool,
    period_ns: u64,
    /// Instant of the plant's state.
    stamp_ns: u64,
    /// When the plant last took a tick, ns of `CLOCK_MONOTONIC`.
    moved_ns: u64,
    /// Ticks the plant has taken since the last good command.
    ahead: u64,
    /// The plant took its last tick without a command.
    silent: bool,
    counts: RigEndCounts,
}

impl Default for RigEnd {
    fn default() -> Self {
        Self::new()
    }
}

impl RigEnd {
    /// Before the first command.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            sequence: Sequence { session: 0, tick: None },
            held: RigCommand::zero(),
            safe: false,
            stopped: false,
            period_ns: DEFAULT_PERIOD_NS,
            stamp_ns: 0,
            moved_ns: 0,
            ahead: 0,
            silent: false,
            counts: RigEndCounts {
                commands: 0,
                refused: [0; REFUSALS],
                missed: 0,
                late: 0,
                safe_states: 0,
            },
        }
    }

    /// What was seen so far.
    #[must_use]
    pub const fn counts(&self) -> RigEndCounts {
        self.counts
    }

    /// True while the rig has left the commands.
    #[must_use]
    pub const fn is_safe(&self) -> bool {
        self.safe
    }

    /// Session in force, 0 before the first.
    #[must_use]
    pub const fn session(&self) -> u64 {
        self.sequence.session
    }

    /// Last good tick of the session, 0 before the first.
    #[must_use]
    pub fn tick(&self) -> u64 {
        self.sequence.tick.unwrap_or(0)
    }

    /// Between two ticks, ns, after the last good command.
    #[must_use]
    pub const fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// When the rig is to take a tick of its own if no command comes, ns of `CLOCK_MONOTONIC`: after
    /// [`SILENT_PERIODS`] periods, in lockstep after `lockstep_patience`; in its safe state every
    /// period, in lockstep as soon as it is silent; never while it rests.
    #[must_use]
    pub fn due_ns(&self, lockstep_patience: Duration) -> u64 {
        let patience_ns = if self.safe && (self.silent || !self.in_lockstep()) {
            self.period_ns
        } else if !self.safe && !self.is_led() {
            return u64::MAX;
        } else if self.in_lockstep() {
            u64::try_from(lockstep_patience.as_nanos()).unwrap_or(u64::MAX)
        } else {
            SILENT_PERIODS * self.period_ns
        };
        self.moved_ns.saturating_add(patience_ns)
    }

    /// True when a loop moves the rig or keeps it in place, so that silence must not last.
    fn is_led(&self) -> bool {
        let resting = [RigMode::Idle as u32, RigMode::Stop as u32].contains(&self.held.mode);
        !resting && !self.safe && self.sequence.tick.is_some()
    }

    /// True when the last good command came with a virtual clock.
    #[must_use]
    pub const fn in_lockstep(&self) -> bool {
        self.held.flags.contains(Flags::LOCKSTEP)
    }

    /// Validates a command and lets the plant take its tick. `now_ns` is `CLOCK_MONOTONIC`; it is not
    /// looked at in lockstep.
    pub fn command(
        &mut self,
        plant: &mut impl Plant,
        command: &RigCommand,
        now_ns: u64,
    ) -> RigMeasurement {
        let clock = (!command.flags.contains(Flags::LOCKSTEP)).then_some(now_ns);
        let before = self.sequence;
        // The caller may not have called `silence` in time.
        if clock.is_some() && !self.in_lockstep() && now_ns > self.due_ns(Duration::MAX) {
            self.enter_safe_state();
        }
        (self.moved_ns, self.silent) = (now_ns, false);
        match self.sequence.command(command, plant.command_form(), clock) {
            Ok(mode) => self.accept(plant, command, mode, before, clock),
            Err(refusal) => self.refuse(plant, refusal, command.session, command.tick, clock),
        }
    }

    /// Answers what cannot even be read as a command, such as a datagram of another size.
    pub fn unreadable(&mut self, plant: &mut impl Plant, now_ns: u64) -> RigMeasurement {
        let clock = (!self.in_lockstep()).then_some(now_ns);
        self.moved_ns = now_ns;
        self.refuse(plant, Refusal::Size, self.sequence.session, self.tick(), clock)
    }

    /// One period without a command after the timeout: the safe state. The measurement is for
    /// observers.
    pub fn silence(&mut self, plant: &mut impl Plant, now_ns: u64) -> RigMeasurement {
        // From then on along a grid, but never behind by more than a period.
        let on_grid_ns =
            if self.safe { self.moved_ns.saturating_add(self.period_ns) } else { now_ns };
        self.moved_ns = on_grid_ns.min(now_ns).max(now_ns.saturating_sub(self.period_ns));
        self.enter_safe_state();
        self.silent = true;
        self.ahead += 1;
        let mut m = plant.alone(self.period_ns);
        m.status |= Status::UNSOLICITED;
        // In lockstep the time of the loop stands still.
        let stamp_ns = if self.in_lockstep() { self.stamp_ns } else { now_ns };
        self.fill_in(m, plant.command_form(), self.sequence.session, self.tick(), stamp_ns)
    }

    fn accept(
        &mut self,
        plant: &mut impl Plant,
        command: &RigCommand,
        mode: RigMode,
        before: Sequence,
        clock: Option<u64>,
    ) -> RigMeasurement {
        self.counts.commands += 1;
        self.period_ns = command.period_ns;
        let stamp_ns = command.wakeup_ns.saturating_add(command.period_ns);
        self.counts.late += u64::from(clock.is_some_and(|now| now > stamp_ns));
        let new_session = before.session != command.session;
        if mode == RigMode::Idle {
            self.safe &= !new_session;
            self.stopped = false;
        } else if new_session {
            // A loop that was there before the rig, or one that does not know where the rig is.
            self.enter_safe_state();
        }
        self.stopped |= mode == RigMode::Stop;
        let missed = match before.tick {
            Some(last) if !new_session => command.tick - last - 1,
            _ => 0,
        };
        self.counts.missed += missed;
        // In real time a rig lives on while the loop misses ticks.
        let owed = if clock.is_some() { missed.saturating_sub(self.ahead) } else { 0 };
        self.ahead = 0;
        let m = if self.safe {
            plant.alone(command.period_ns)
        } else {
            for _ in 0..owed.min(SILENT_PERIODS) {
                plant.answer(&self.held);
            }
            self.held = *command;
            if self.stopped {
                self.held.mode = RigMode::Stop as u32;
            }
            plant.answer(&self.held)
        };
        // What stands in `held` is also how the loop keeps its time.
        self.held.flags = command.flags;
        self.fill_in(m, plant.command_form(), command.session, command.tick, stamp_ns)
    }

    fn refuse(
        &mut self,
        plant: &mut impl Plant,
        refusal: Refusal,
        session: u64,
        tick: u64,
        clock: Option<u64>,
    ) -> RigMeasurement {
        self.counts.commands += 1;
        self.counts.refused[refusal as usize] += 1;
        self.enter_safe_state();
        self.ahead += 1;
        let mut m = plant.alone(self.period_ns);
        m.status |= Status::REFUSED;
        // The times in a refused command are not to be trusted.
        let stamp_ns = clock.unwrap_or(self.stamp_ns.saturating_add(self.period_ns));
        m = self.fill_in(m, plant.command_form(), session, tick, stamp_ns);
        m.refusal = refusal as u32;
        m
    }

    fn enter_safe_state(&mut self) {
        self.counts.safe_states += u64::from(!self.safe);
        self.safe = true;
    }

    fn fill_in(
        &mut self,
        mut m: RigMeasurement,
        form: CommandForm,
        session: u64,
        tick: u64,
        stamp_ns: u64,
    ) -> RigMeasurement {
        self.stamp_ns = stamp_ns;
        m.protocol_version = PROTOCOL_VERSION;
        m.capabilities.set(Capabilities::LEG_COMMAND, form.legs > 0);
        m.capabilities.set(Capabilities::POSE_COMMAND, form.pose);
        m.session = session;
        m.tick = tick;
        m.stamp_ns = stamp_ns;
        if self.safe {
            m.status |= Status::SAFE_STATE;
        }
        m
    }
}
