//! Fault injection: faults as data, and wrappers that inject them into any rig or plant.
//!
//! A fault has a kind, a begin, a duration and a size. [`FaultyRig`] is between the loop and a rig
//! and injects all kinds; [`FaultyPlant`] is on the rig side of the rig port and injects only
//! faults of the rig itself. Without an active fault all data pass unchanged, bit by bit.
//!
//! ```
//! use docktwin_hil::faults::{Fault, FaultKind, Instrument, When};
//!
//! // 30 ms after the first contact sensor A shows the wrong sign, to the end of the run.
//! let sign = Fault::from(FaultKind::Sign(Instrument::SensorA), When::Contact(0.03));
//! // The zero of sensor A jumps by 500 N along its X for a tenth of a second.
//! let jump = Fault {
//!     for_s: Some(0.1),
//!     size: 500.0,
//!     ..Fault::from(FaultKind::Offset(Instrument::SensorA, 0), When::Tracking(2.0))
//! };
//! # let _ = (sign, jump);
//! ```

mod effect;
mod kind;

use core::time::Duration;

use docktwin_core::PORT_CONTACT_N;
use docktwin_physics::sensor::Noise;
use docktwin_rigport::{
    message::{Capabilities, Refusal, RigCommand, RigMeasurement, RigMode, wrench},
    rig::{CommandForm, Plant, Rig, RigError},
    validate::Sequence,
};

pub use kind::{FaultKind, Instrument};

/// When a fault begins, by the loop's time of the commands of a session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum When {
    /// With the command of this tick.
    Tick(u64),
    /// So many seconds after the first command.
    Time(f64),
    /// So many seconds after the first command of motion.
    Tracking(f64),
    /// So many seconds after the first contact: more than [`PORT_CONTACT_N`] at port 4, truly where the rig
    /// knows it, else as the change of sensor A since the first command of motion.
    Contact(f64),
}

/// What goes wrong, when, for how long and how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// What.
    pub what: FaultKind,
    /// From when on.
    pub at: When,
    /// For how long, s; `None` to the end of the run.
    pub for_s: Option<f64>,
    /// How much, in the unit of [`FaultKind::size_unit`].
    pub size: f64,
}

impl Fault {
    /// From then on to the end, of size 0.
    #[must_use]
    pub const fn from(what: FaultKind, at: When) -> Self {
        Self { what, at, for_s: None, size: 0.0 }
    }

    /// The same fault of another size.
    #[must_use]
    pub const fn sized(self, size: f64) -> Self {
        Self { size, ..self }
    }

    /// The same fault for so long, s.
    #[must_use]
    pub const fn lasting(self, for_s: f64) -> Self {
        Self { for_s: Some(for_s), ..self }
    }
}

/// Longest delay of a measurement, ticks.
pub const MOST_LATE: usize = 64;

/// A fault on its way.
#[derive(Clone, Debug)]
struct Pending {
    fault: Fault,
    /// Whether it is active in the present tick.
    active: bool,
    /// Loop time of the tick in which it became active, ns.
    began_ns: Option<u64>,
    /// Command and measurement with which it began.
    command: Option<RigCommand>,
    measurement: Option<RigMeasurement>,
    noise: Noise,
}

/// Faults of a run, and what of them is active.
#[derive(Clone, Debug)]
struct Faults {
    pending: Vec<Pending>,
    session: u64,
    now_ns: u64,
    /// Loop times of the first command, of the first of motion, and of the first contact, ns.
    first_ns: Option<u64>,
    tracking_ns: Option<u64>,
    contact_ns: Option<u64>,
    /// Sensor A with the first command of motion.
    untouched: Option<[f64; 6]>,
}

fn ns(time_s: f64) -> u64 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a cast saturates, and no fault begins before the run or after centuries"
    )]
    let ns = (time_s * 1e9).round() as u64;
    ns
}

impl Faults {
    fn new(faults: &[Fault]) -> Self {
        let pending = faults.iter().enumerate().map(|(i, fault)| Pending {
            fault: *fault,
            active: false,
            began_ns: None,
            command: None,
            measurement: None,
            noise: Noise::new(0, i as u64),
        });
        Self {
            pending: pending.collect(),
            session: 0,
            now_ns: 0,
            first_ns: None,
            tracking_ns: None,
            contact_ns: None,
            untouched: None,
        }
    }

    /// Takes the time of a command, and finds out which faults are active with it.
    fn begin(&mut self, c: &RigCommand) {
        if c.session != self.session {
            self.session = c.session;
            (self.first_ns, self.tracking_ns, self.contact_ns) = (None, None, None);
            self.untouched = None;
            for p in &mut self.pending {
                (p.active, p.began_ns, p.command, p.measurement) = (false, None, None, None);
            }
        }
        self.now_ns = c.loop_time_ns;
        self.first_ns.get_or_insert(self.now_ns);
        if c.mode == RigMode::Track as u32 {
            self.tracking_ns.get_or_insert(self.now_ns);
        }
        for p in &mut self.pending {
            let due_ns = match p.fault.at {
                When::Tick(tick) => (c.tick >= tick).then_some(self.now_ns),
                When::Time(s) => self.first_ns.map(|t| t + ns(s)),
                When::Tracking(s) => self.tracking_ns.map(|t| t + ns(s)),
                When::Contact(s) => self.contact_ns.map(|t| t + ns(s)),
            };
            if due_ns.is_some_and(|due| self.now_ns >= due) {
                p.began_ns.get_or_insert(self.now_ns);
            }
            p.active = p
                .began_ns
                .is_some_and(|began| p.fault.for_s.is_none_or(|s| self.now_ns - began < ns(s)));
        }
    }

    /// What the rig gets of a command.
    fn command(&mut self, c: &RigCommand) -> RigCommand {
        let mut out = *c;
        for p in self.pending.iter_mut().filter(|p| p.active) {
            let first = *p.command.get_or_insert(*c);
            effect::on_command(&p.fault, &mut out, &first, seconds_since(p.began_ns, self.now_ns));
        }
        out
    }

    /// What becomes of a measurement.
    fn measurement(&mut self, m: &mut RigMeasurement) {
        self.look(m);
        for p in self.pending.iter_mut().filter(|p| p.active) {
            let first = *p.measurement.get_or_insert(*m);
            effect::on_measurement(&p.fault, m, &first, &mut p.noise);
        }
    }

    /// Finds the first contact in a measurement as the rig gave it.
    fn look(&mut self, m: &RigMeasurement) {
        if self.tracking_ns.is_none() {
            return;
        }
        let untouched = *self.untouched.get_or_insert(m.sensor_a);
        let force_n = if m.has(Capabilities::TRUTH) {
            wrench(&m.truth_port4).f.length()
        } else {
            (wrench(&m.sensor_a).f - wrench(&untouched).f).length()
        };
        if force_n > PORT_CONTACT_N {
            self.contact_ns.get_or_insert(self.now_ns);
        }
    }

    /// Whether a fault of this kind is active, and how large.
    fn active(&self, what: FaultKind) -> Option<f64> {
        self.pending.iter().find(|p| p.active && p.fault.what == what).map(|p| p.fault.size)
    }

    /// Ticks by which measurements are late.
    fn late(&self) -> usize {
        let late = self.active(FaultKind::Late).unwrap_or(0.0);
        let grown = self
            .pending
            .iter()
            .filter(|p| p.active && p.fault.what == FaultKind::LagGrows)
            .map(|p| p.fault.size * seconds_since(p.began_ns, self.now_ns))
            .fold(0.0, f64::max);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a cast saturates"
        )]
        let ticks = late.max(grown) as usize;
        ticks.min(MOST_LATE)
    }
}

fn seconds_since(began_ns: Option<u64>, now_ns: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "hours are far below 2^53 ns")]
    let s = (now_ns - began_ns.unwrap_or(now_ns)) as f64 * 1e-9;
    s
}

/// A rig with faults, as the loop sees it: its measurements are spoiled on their way and then validated,
/// as a transport validates them.
///
/// Nothing of it allocates after [`FaultyRig::new`].
#[derive(Clone, Debug)]
pub struct FaultyRig<R> {
    rig: R,
    faults: Faults,
    sequence: Sequence,
    /// Measurements on their way, newest at `taken − 1`, modulo its length.
    way: Box<[Option<RigMeasurement>]>,
    taken: usize,
    last: Option<RigMeasurement>,
}

impl<R> FaultyRig<R> {
    /// A rig and its faults.
    pub fn new(rig: R, faults: &[Fault]) -> Self {
        Self {
            rig,
            faults: Faults::new(faults),
            sequence: Sequence::default(),
            way: vec![None; MOST_LATE + 1].into(),
            taken: 0,
            last: None,
        }
    }

    /// The rig.
    pub const fn rig(&self) -> &R {
        &self.rig
    }

    /// The measurement that arrives now, if one does, of those that were sent up to now.
    fn arriving(&mut self, newest: Option<RigMeasurement>) -> Option<RigMeasurement> {
        let n = self.way.len();
        self.way[self.taken % n] = newest;
        self.taken += 1;
        let late = self.faults.late();
        let place = self.taken.checked_sub(1 + late)? % n;
        self.way[place].take()
    }

    /// Puts the faults of communication and clocks on a measurement that arrives.
    fn carry(&mut self, mut m: RigMeasurement) -> Result<RigMeasurement, RigError> {
        use FaultKind as K;
        if self.faults.active(K::Unreadable).is_some() {
            return Err(RigError::Refused(Refusal::Size));
        }
        if let (Some(_), Some(last)) = (self.faults.active(K::Repeated), self.last) {
            return Ok(last);
        }
        self.last = Some(m);
        for p in self.faults.pending.iter().filter(|p| p.active) {
            let since_s = seconds_since(p.began_ns, self.faults.now_ns);
            match p.fault.what {
                K::TickBack => m.tick = m.tick.saturating_sub(1),
                K::OtherSession => m.session = m.session.wrapping_add(1),
                K::OtherVersion => m.protocol_version += 1,
                K::StampOffset => m.stamp_ns = moved(m.stamp_ns, p.fault.size),
                K::StampDrift => m.stamp_ns = moved(m.stamp_ns, p.fault.size * since_s),
                _ => {}
            }
        }
        Ok(m)
    }
}

/// An instant later by `by_s`.
fn moved(instant_ns: u64, by_s: f64) -> u64 {
    if by_s < 0.0 { instant_ns.saturating_sub(ns(-by_s)) } else { instant_ns + ns(by_s) }
}

impl<R: Rig> Rig for FaultyRig<R> {
    fn send(&mut self, command: &RigCommand) -> Result<(), RigError> {
        if command.session != self.sequence.session {
            self.sequence = Sequence { session: command.session, tick: None };
            self.way.fill(None);
            self.last = None;
        }
        self.faults.begin(command);
        if self.faults.active(FaultKind::CommandLost).is_some() {
            return Ok(());
        }
        let command = self.faults.command(command);
        self.rig.send(&command)
    }

    fn receive(
        &mut self,
        patience: Duration,
        now_ns: u64,
    ) -> Result<Option<RigMeasurement>, RigError> {
        if self.faults.active(FaultKind::Gone).is_some() {
            return Err(RigError::Gone);
        }
        let mut newest = self.rig.receive(patience, now_ns)?;
        if let Some(m) = &mut newest {
            self.faults.measurement(m);
        }
        if self.faults.active(FaultKind::Missing).is_some() {
            newest = None;
        }
        let Some(arrived) = self.arriving(newest) else { return Ok(None) };
        let mut m = self.carry(arrived)?;
        self.sequence.measurement(&mut m, now_ns).map_err(RigError::Refused)?;
        Ok(Some(m))
    }
}

/// A plant with faults, behind the rig's end of any port. Faults of the link it does not have
/// ([`FaultKind::is_of_the_link`]): they are left out.
#[derive(Clone, Debug)]
pub struct FaultyPlant<P> {
    plant: P,
    faults: Faults,
}

impl<P> FaultyPlant<P> {
    /// A plant and its faults.
    pub fn new(plant: P, faults: &[Fault]) -> Self {
        Self { plant, faults: Faults::new(faults) }
    }

    /// The plant.
    pub const fn plant(&self) -> &P {
        &self.plant
    }
}

impl<P: Plant> Plant for FaultyPlant<P> {
    fn command_form(&self) -> CommandForm {
        self.plant.command_form()
    }

    fn answer(&mut self, command: &RigCommand) -> RigMeasurement {
        self.faults.begin(command);
        let command = self.faults.command(command);
        let mut m = self.plant.answer(&command);
        self.faults.measurement(&mut m);
        m
    }

    fn alone(&mut self, period_ns: u64) -> RigMeasurement {
        let mut m = self.plant.alone(period_ns);
        self.faults.measurement(&mut m);
        m
    }
}
