//! Control wrenches on the spacecraft: timed thrusts, a pilot, a controller.

use docktwin_core::{Pose, Twist, Wrench};
use docktwin_physics::{body::BodyState, reduced::Inputs};
use docktwin_scenario::{Scenario, Thrust};

use crate::setup::{inputs_after, thrust_ahead_of};

/// What is known at the beginning of a tick.
#[derive(Clone, Copy, Debug)]
pub struct Situation {
    /// Simulated time, s; in a loop with a rig since the loop was closed.
    pub time_s: f64,
    /// Chaser and target.
    pub bodies: [BodyState; 2],
    /// `X_34`, the pose of `e4` in `e3`.
    pub x_34: Pose,
    /// Motion of `e4` against `e3` at the passive ring's centre, axes of `e3`: m/s and rad/s.
    pub relative: Twist,
    /// F4, M4: on the target at the origin of `e4`, in `e4`; N and N·m. With a rig as measured.
    pub port4: Wrench,
    /// Time of first contact, s.
    pub first_contact_s: Option<f64>,
    /// Time of capture, s.
    pub captured_s: Option<f64>,
}

impl Situation {
    /// Closing speed of the ports along the docking axis, m/s.
    #[must_use]
    pub fn closing_m_s(&self) -> f64 {
        -self.relative.v.x
    }
}

/// A source of control wrenches. It is asked once a tick; in a loop with a rig that is on the path of the
/// loop, where nothing may allocate, lock or wait.
///
/// A closure `FnMut(&Situation) -> Inputs` is one; two in a pair add up; `None` is nothing.
pub trait Control {
    /// Wrenches about the mass centres, in body axes, held over the tick that begins.
    fn wrenches(&mut self, now: &Situation) -> Inputs;

    /// Whether a wrench is on, or may still come: then an outcome is not yet decided.
    fn ahead(&self, _now: &Situation) -> bool {
        false
    }

    /// Whether the run is to end with this tick.
    fn ended(&self) -> bool {
        false
    }

    /// An order from outside to stop now, and what gave it, such as `SIGINT`: the run is closed with the
    /// outcome `stopped`, a rig comes to rest first.
    fn stopped(&self) -> Option<&'static str> {
        None
    }

    /// Whether a pilot gives the wrenches: the run then keeps real time.
    fn in_person(&self) -> bool {
        false
    }
}

impl<F: FnMut(&Situation) -> Inputs> Control for F {
    fn wrenches(&mut self, now: &Situation) -> Inputs {
        self(now)
    }
}

/// Nothing moves them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Coasting;

impl Control for Coasting {
    fn wrenches(&mut self, _now: &Situation) -> Inputs {
        Inputs::default()
    }
}

impl<A: Control, B: Control> Control for (A, B) {
    fn wrenches(&mut self, now: &Situation) -> Inputs {
        let (a, b) = (self.0.wrenches(now), self.1.wrenches(now));
        Inputs { chaser: a.chaser + b.chaser, target: a.target + b.target }
    }

    fn ahead(&self, now: &Situation) -> bool {
        self.0.ahead(now) || self.1.ahead(now)
    }

    fn ended(&self) -> bool {
        self.0.ended() || self.1.ended()
    }

    fn stopped(&self) -> Option<&'static str> {
        self.0.stopped().or_else(|| self.1.stopped())
    }

    fn in_person(&self) -> bool {
        self.0.in_person() || self.1.in_person()
    }
}

impl<C: Control> Control for Option<C> {
    fn wrenches(&mut self, now: &Situation) -> Inputs {
        self.as_mut().map_or_else(Inputs::default, |c| c.wrenches(now))
    }

    fn ahead(&self, now: &Situation) -> bool {
        self.as_ref().is_some_and(|c| c.ahead(now))
    }

    fn ended(&self) -> bool {
        self.as_ref().is_some_and(Control::ended)
    }

    fn stopped(&self) -> Option<&'static str> {
        self.as_ref().and_then(Control::stopped)
    }

    fn in_person(&self) -> bool {
        self.as_ref().is_some_and(Control::in_person)
    }
}

/// The timed thrusts of a scenario.
#[derive(Clone, Debug)]
pub struct TimedThrusts(Vec<Thrust>);

impl TimedThrusts {
    /// Those of a scenario.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Self {
        Self(scenario.thrusts.clone())
    }
}

impl Control for TimedThrusts {
    fn wrenches(&mut self, now: &Situation) -> Inputs {
        inputs_after(&self.0, now.first_contact_s, now.captured_s, now.time_s)
    }

    fn ahead(&self, now: &Situation) -> bool {
        thrust_ahead_of(&self.0, now.first_contact_s, now.captured_s, now.time_s)
    }
}
