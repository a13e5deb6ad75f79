//! Methods of the literature, beside which a twin has to stand.
//!
//! They were published for one axis or for tests of structures; here each is written for six axes and for the seam of
//! [`Compensator`], with what its source says. What a source leaves open is chosen here, and said at the method.

mod force_lead;
mod polynomial;
mod prior;
mod smith;
mod state_force;

use docktwin_physics::{mounted::Ports, programme::RelativeMotion};

use self::{
    force_lead::ForceLead, polynomial::Polynomial, prior::Prior, smith::Smith,
    state_force::StateForce,
};
use super::{Believed, Compensator, Demand, LoopContext, delays::Delays};

/// Which method of the literature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Published {
    /// Phase lead of the force, second-order lead of the position.
    ForceLead,
    /// Polynomial through the last two, three or four commands.
    Polynomial(Order),
    /// Inverse of the drives from position, speed and the acceleration that the measured force makes.
    StateForceInverse,
    /// Smith predictor with a contact that is identified in the contact, and a lead.
    SmithLead,
    /// The same with an observer of what the dead zone of the sensor hides.
    SmithDob,
    /// Force corrected by a simple model of the mechanism, known beforehand.
    PriorForce,
}

/// Order of a polynomial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Through two points.
    First,
    /// Through three.
    Second,
    /// Through four.
    Third,
}

impl Published {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::ForceLead,
        Self::Polynomial(Order::First),
        Self::Polynomial(Order::Second),
        Self::Polynomial(Order::Third),
        Self::StateForceInverse,
        Self::SmithLead,
        Self::SmithDob,
        Self::PriorForce,
    ];

    /// Name as on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ForceLead => "force-lead",
            Self::Polynomial(Order::First) => "pe1",
            Self::Polynomial(Order::Second) => "pe2",
            Self::Polynomial(Order::Third) => "pe3",
            Self::StateForceInverse => "state-force-inverse",
            Self::SmithLead => "smith-lead",
            Self::SmithDob => "smith-dob",
            Self::PriorForce => "prior-force",
        }
    }

    /// The method for a rig and a mechanism as they are believed, and the lag of plate and sensor together.
    #[must_use]
    pub(super) fn method(self, believed: &Believed<'_>, lead_s: f64) -> PublishedMethod {
        let delays = Delays::new(believed, lead_s);
        let of = match self {
            Self::ForceLead => Of::ForceLead(ForceLead::new(delays)),
            Self::Polynomial(order) => Of::Polynomial(Polynomial::new(order, lead_s)),
            Self::StateForceInverse => Of::StateForce(StateForce::new(delays)),
            Self::SmithLead => Of::Smith(Box::new(Smith::new(believed, delays, false))),
            Self::SmithDob => Of::Smith(Box::new(Smith::new(believed, delays, true))),
            Self::PriorForce => Of::Prior(Box::new(Prior::new(believed, delays))),
        };
        PublishedMethod { name: self.name(), of }
    }
}

/// A method of the literature that runs.
#[derive(Clone, Debug)]
pub struct PublishedMethod {
    name: &'static str,
    of: Of,
}

#[derive(Clone, Debug)]
enum Of {
    ForceLead(ForceLead),
    Polynomial(Polynomial),
    StateForce(StateForce),
    Smith(Box<Smith>),
    Prior(Box<Prior>),
}

/// What each of them does.
trait Does {
    fn reset(&mut self);
    fn wrench(&mut self, seen: &LoopContext<'_>) -> Option<Ports>;
    fn command(&mut self, seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand;
    fn digest(&self) -> Option<u64>;
}

impl PublishedMethod {
    fn each(&self) -> &dyn Does {
        match &self.of {
            Of::ForceLead(m) => m,
            Of::Polynomial(m) => m,
            Of::StateForce(m) => m,
            Of::Smith(m) => m.as_ref(),
            Of::Prior(m) => m.as_ref(),
        }
    }

    fn each_mut(&mut self) -> &mut dyn Does {
        match &mut self.of {
            Of::ForceLead(m) => m,
            Of::Polynomial(m) => m,
            Of::StateForce(m) => m,
            Of::Smith(m) => m.as_mut(),
            Of::Prior(m) => m.as_mut(),
        }
    }
}

impl Compensator for PublishedMethod {
    fn name(&self) -> &'static str {
        self.name
    }

    fn reset(&mut self) {
        self.each_mut().reset();
    }

    fn wrench(&mut self, seen: &LoopContext<'_>) -> Option<Ports> {
        self.each_mut().wrench(seen)
    }

    fn command(&mut self, seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        self.each_mut().command(seen, next)
    }

    fn digest(&self) -> Option<u64> {
        self.each().digest()
    }
}
