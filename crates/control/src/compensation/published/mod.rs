//! Methods of the literature, beside which a twin has to stand.
//!
//! They were published for one axis or for tests of structures; here each is written for six axes and for the seam of
//! [`Compensator`], with what its source says. What a source leaves open is chosen here, and said at the method.

mod adaptive;
mod force_lead;
mod passivity;
mod polynomial;
mod prior;
mod smith;
mod state_force;

pub use self::{
    adaptive::{Adaptive, Learning},
    force_lead::ForceLead,
    passivity::Passivity,
    polynomial::Polynomial,
    prior::Prior,
    smith::Smith,
    state_force::StateForce,
};
use super::{Believed, Method, delays::Delays};

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
    /// Inverse of the drives whose coefficients are learned while the rig moves.
    Adaptive(Learning),
    /// Damping that takes the energy that came from nowhere.
    Passivity,
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

impl Order {
    /// Name of its polynomial as on the command line.
    const fn name(self) -> &'static str {
        match self {
            Self::First => "pe1",
            Self::Second => "pe2",
            Self::Third => "pe3",
        }
    }
}

impl Published {
    /// All of them.
    pub const ALL: [Self; 13] = [
        Self::ForceLead,
        Self::Polynomial(Order::First),
        Self::Polynomial(Order::Second),
        Self::Polynomial(Order::Third),
        Self::StateForceInverse,
        Self::SmithLead,
        Self::SmithDob,
        Self::PriorForce,
        Self::Adaptive(Learning::TimeSeries),
        Self::Adaptive(Learning::Gradient),
        Self::Adaptive(Learning::RecursiveLegs),
        Self::Adaptive(Learning::Unscented),
        Self::Passivity,
    ];

    /// Name as on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ForceLead => force_lead::NAME,
            Self::Polynomial(order) => order.name(),
            Self::StateForceInverse => state_force::NAME,
            Self::SmithLead => smith::LEAD,
            Self::SmithDob => smith::DOB,
            Self::PriorForce => prior::NAME,
            Self::Adaptive(learning) => learning.name(),
            Self::Passivity => passivity::NAME,
        }
    }

    /// The method for a rig and a mechanism as they are believed, and the lag of plate and sensor together.
    pub(super) fn method(self, believed: &Believed<'_>, lead_s: f64) -> Method {
        let delays = Delays::new(believed, lead_s);
        match self {
            Self::ForceLead => Method::ForceLead(ForceLead::new(delays)),
            Self::Polynomial(order) => Method::Polynomial(Polynomial::new(order, lead_s)),
            Self::StateForceInverse => Method::StateForce(StateForce::new(delays)),
            Self::SmithLead => Method::Smith(Box::new(Smith::new(believed, delays, false))),
            Self::SmithDob => Method::Smith(Box::new(Smith::new(believed, delays, true))),
            Self::PriorForce => Method::Prior(Box::new(Prior::new(believed, delays))),
            Self::Adaptive(learning) => {
                Method::Adaptive(Box::new(Adaptive::new(learning, believed, delays)))
            }
            Self::Passivity => Method::Passivity(Box::new(Passivity::new(believed))),
        }
    }
}
