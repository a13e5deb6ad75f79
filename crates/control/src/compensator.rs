//! What is done against the delay of the rig, between the bodies' motion and the command.

use docktwin_physics::programme::RelativeMotion;

/// From the motion of the bodies at `t_{k+1}` to the motion that the rig is asked for.
///
/// On the path of the loop: no allocation, no lock, no clock.
pub trait Compensator {
    /// Name as on the command line.
    fn name(&self) -> &'static str;

    /// The motion to command.
    fn compensate(&mut self, motion: &RelativeMotion) -> RelativeMotion;
}

/// Longest lead, s.
pub const MOST_LEAD_S: f64 = 0.1;

/// The compensators there are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Compensation {
    /// None: the motion as it is.
    None,
    /// `x + τ v`: the lead τ in seconds, 0 to [`MOST_LEAD_S`]. Larger than the delay of the rig it
    /// takes energy out of every contact.
    Lead(f64),
}

impl Compensation {
    /// Its lead, s.
    #[must_use]
    pub const fn lead_s(&self) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Lead(lead_s) => *lead_s,
        }
    }
}

impl Compensator for Compensation {
    fn name(&self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Lead(_) => "lead",
        }
    }

    fn compensate(&mut self, motion: &RelativeMotion) -> RelativeMotion {
        match self {
            Self::None => *motion,
            Self::Lead(lead_s) => motion.led(*lead_s),
        }
    }
}
