//! Compensators of the delay of the rig: one file for each method, one trait for all.
//!
//! A method is called twice in a tick, because it can act at two points of a tick:
//!
//! 1. [`Compensator::wrench`], before the bodies are integrated: what was measured is known, and a
//!    correction of the wrenches still reaches the bodies in this tick. One that came after would be a
//!    tick late, which in the fastest row of Table 4 is 3 % of R_e.
//! 2. [`Compensator::command`], after it: the motion of the bodies at `t_{k+1}` is known, and the command
//!    for it is made.
//!
//! A new method needs a file here, a variant of [`Compensation`] and of [`Method`], and a name on
//! the command line; `tests/compensation.rs` has the tests that every method must pass. The recipe is in
//! CONTRIBUTING.md, "A new compensator".

mod believed;
mod context;
mod delays;
mod energy;
mod history;
mod lead;
mod none;
mod published;
mod twin;

use docktwin_core::Wrench;
use docktwin_physics::{mounted::Ports, programme::RelativeMotion};

pub use believed::Believed;
pub use context::{LoopContext, Measured, Phase};
pub use energy::{EnergyObserver, Gained};
pub use lead::{Lead, MOST_LEAD_S};
pub use none::Uncompensated;
pub use published::{
    Adaptive, ForceLead, Learning, Order, Passivity, Polynomial, Prior, Published, Smith,
    StateForce,
};
pub use twin::{Residual, Twin};

/// Latches whose phases a measurement has room for.
pub const LATCHES: usize = 8;

/// A compensator of the delay of the rig.
///
/// Called in the real-time loop: no allocation, no lock, no clock, no logging. The same calls give
/// the same bits. Finite inputs give finite outputs.
pub trait Compensator {
    /// Name as on the command line.
    fn name(&self) -> &'static str;

    /// Resets its state. Called when the loop is armed, before its first tick.
    fn reset(&mut self);

    /// The wrenches to add to those measured at the ports before the bodies take them, or `None` where
    /// the method corrects none. `seen.bodies` stands at `t_k`, the instant of the measurement.
    ///
    /// It is called in every phase, so that a model can follow the rig; only the closed loop applies it.
    /// Limits, first contact and verdicts go by the measured wrenches.
    fn wrench(&mut self, seen: &LoopContext<'_>) -> Option<Ports>;

    /// The command with which the rig reproduces `next`, the motion commanded for `t_{k+1}`.
    /// `seen.bodies` is now at `t_{k+1}`.
    fn command(&mut self, seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand;

    /// Digest of the method's own state, for methods that have any: a replay compares it.
    fn digest(&self) -> Option<u64> {
        None
    }

    /// What a method that corrects wrenches by a model says of the last tick.
    fn report(&self) -> Option<Report> {
        None
    }
}

/// What a method that corrects wrenches by a model says of a tick, for the record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// Measured wrenches less what the model of the rig expects to measure.
    pub residual: Ports,
    /// Share of the model's correction that is applied, 0 to 1.
    pub trust: f64,
    /// Share of that which is left of its fast part, 0 to 1.
    pub trust_fast: f64,
    /// The model was too far off and is not used any more.
    pub fallen_back: bool,
}

impl Default for Report {
    fn default() -> Self {
        Self { residual: Ports::default(), trust: 1.0, trust_fast: 1.0, fallen_back: false }
    }
}

/// What the rig is commanded: the relative motion at the time at which each path arrives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Demand {
    /// Lengths and pose.
    pub pose: Target,
    /// Flow through the valves, later by [`PathTimes::flow_ahead_s`]; without, it is carried on from
    /// `pose` with constant jerk.
    ///
    /// [`PathTimes::flow_ahead_s`]: crate::feedforward::PathTimes::flow_ahead_s
    pub flow: Option<Target>,
    /// Force of the legs, later by [`PathTimes::force_ahead_s`]; without, it is that of `pose`.
    ///
    /// [`PathTimes::force_ahead_s`]: crate::feedforward::PathTimes::force_ahead_s
    pub force: Option<Target>,
}

impl Demand {
    /// One motion for all paths, no contact expected.
    #[must_use]
    pub fn of(motion: RelativeMotion) -> Self {
        Self { pose: Target { motion, contact: None }, flow: None, force: None }
    }

    /// True when every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        [Some(self.pose), self.flow, self.force].iter().flatten().all(Target::is_finite)
    }
}

/// Motion that one path of a command has to reach at its time of arrival, and the contact expected
/// there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Target {
    /// Motion of `e4` against `e3`.
    pub motion: RelativeMotion,
    /// The contact expected, which the legs must hold against.
    pub contact: Option<ExpectedContact>,
}

impl Target {
    /// True when every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let contact = |c: ExpectedContact| c.port4.is_finite() && c.rate.is_finite();
        self.motion.is_finite() && self.contact.is_none_or(contact)
    }
}

/// A contact as it is expected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExpectedContact {
    /// F4, M4: on the target at the origin of `e4`, in `e4`, N and N·m.
    pub port4: Wrench,
    /// Its rate, N/s and N·m/s.
    pub rate: Wrench,
}

/// A method and its parameters, as chosen for a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Compensation {
    /// None: the motion as it is.
    None,
    /// `x + τ v`: the lead τ in seconds, 0 to [`MOST_LEAD_S`].
    Lead(f64),
    /// A method of the literature.
    Published {
        /// Which.
        method: Published,
        /// Lag of plate and sensor together, which it undoes, s, 0 to [`MOST_LEAD_S`].
        lead_s: f64,
    },
    /// Two twins correct the wrenches, a lead the command.
    Twin {
        /// The lead, s, 0 to [`MOST_LEAD_S`].
        lead_s: f64,
        /// What becomes of what the twins do not know.
        residual: Residual,
    },
}

impl Compensation {
    /// Name as on the command line.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Lead(_) => "lead",
            Self::Published { method, .. } => method.name(),
            Self::Twin { residual: Residual::Felt, .. } => "twin",
            Self::Twin { residual: Residual::LeftOut, .. } => "twin-model-only",
        }
    }

    /// Its lead, s.
    #[must_use]
    pub const fn lead_s(&self) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Lead(lead_s) | Self::Published { lead_s, .. } | Self::Twin { lead_s, .. } => {
                *lead_s
            }
        }
    }

    /// The same with another lead, s.
    #[must_use]
    pub const fn with_lead_s(self, lead_s: f64) -> Self {
        match self {
            Self::None => Self::None,
            Self::Lead(_) => Self::Lead(lead_s),
            Self::Published { method, .. } => Self::Published { method, lead_s },
            Self::Twin { residual, .. } => Self::Twin { lead_s, residual },
        }
    }

    /// The method, before its first tick, for a rig and a mechanism as they are believed.
    #[must_use]
    pub fn method(&self, believed: &Believed<'_>) -> Method {
        match *self {
            Self::None => Method::None(Uncompensated),
            Self::Lead(lead_s) => Method::Lead(Lead::new(lead_s)),
            Self::Published { method, lead_s } => method.method(believed, lead_s),
            Self::Twin { lead_s, residual } => {
                Method::Twin(Box::new(Twin::new(believed, lead_s, residual)))
            }
        }
    }
}

/// The methods there are, one of which a loop of the command line runs. A loop may also be given a method
/// of one's own.
#[derive(Clone, Debug)]
pub enum Method {
    /// See [`Uncompensated`].
    None(Uncompensated),
    /// See [`Lead`].
    Lead(Lead),
    /// See [`ForceLead`].
    ForceLead(ForceLead),
    /// See [`Polynomial`].
    Polynomial(Polynomial),
    /// See [`StateForce`].
    StateForce(StateForce),
    /// See [`Smith`].
    Smith(Box<Smith>),
    /// See [`Prior`].
    Prior(Box<Prior>),
    /// See [`Adaptive`].
    Adaptive(Box<Adaptive>),
    /// See [`Passivity`].
    Passivity(Box<Passivity>),
    /// See [`Twin`].
    Twin(Box<Twin>),
}

/// Calls the same method of whatever method it is.
macro_rules! each {
    ($method:expr, $m:ident => $call:expr) => {
        match $method {
            Method::None($m) => $call,
            Method::Lead($m) => $call,
            Method::ForceLead($m) => $call,
            Method::Polynomial($m) => $call,
            Method::StateForce($m) => $call,
            Method::Smith($m) => $call,
            Method::Prior($m) => $call,
            Method::Adaptive($m) => $call,
            Method::Passivity($m) => $call,
            Method::Twin($m) => $call,
        }
    };
}

impl Compensator for Method {
    fn name(&self) -> &'static str {
        each!(self, m => m.name())
    }

    fn reset(&mut self) {
        each!(self, m => m.reset());
    }

    fn wrench(&mut self, seen: &LoopContext<'_>) -> Option<Ports> {
        each!(self, m => m.wrench(seen))
    }

    fn command(&mut self, seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        each!(self, m => m.command(seen, next))
    }

    fn digest(&self) -> Option<u64> {
        each!(self, m => m.digest())
    }

    fn report(&self) -> Option<Report> {
        each!(self, m => m.report())
    }
}
