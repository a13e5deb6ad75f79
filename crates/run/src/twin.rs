//! A twin and how it is stepped from tick to tick: the one place where a tick becomes steps.

use docktwin_core::Digest;
use docktwin_physics::{
    body::BodyState,
    mechanism::System,
    reduced::{DockingState, DockingTwin as _, Inputs, ReducedTwin},
};
use docktwin_scenario::Scenario;
use docktwin_twin::FullTwin;

use crate::{
    setup::{FULL_STEPS_PER_MS, REDUCED_STEPS_PER_MS, StartOverlap, start, steps_per_tick},
    signals::Instant,
};

/// Which integrator steps the bodies; laws and results are the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TwinKind {
    /// rapier, in steps of 0.2 ms.
    #[default]
    Full,
    /// Our own, in steps of 0.1 ms: without allocation, about four times as fast.
    Reduced,
}

impl TwinKind {
    /// Words by which recordings and command lines name them.
    pub const WORDS: [(&'static str, Self); 2] = [("full", Self::Full), ("reduced", Self::Reduced)];

    /// Its word.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Reduced => "reduced",
        }
    }

    /// Steps of a tick of this twin in a scenario.
    #[must_use]
    pub fn steps_per_tick(self, scenario: &Scenario) -> u32 {
        steps_per_tick(
            scenario,
            match self {
                Self::Full => FULL_STEPS_PER_MS,
                Self::Reduced => REDUCED_STEPS_PER_MS,
            },
        )
    }
}

/// Either twin.
pub enum AnyTwin {
    /// rapier.
    Full(Box<FullTwin>),
    /// Our own.
    Reduced(Box<ReducedTwin>),
}

impl AnyTwin {
    /// A twin of this kind with these bodies, in steps of `step_s`.
    #[must_use]
    pub fn new(kind: TwinKind, system: System, bodies: [BodyState; 3], step_s: f64) -> Self {
        match kind {
            TwinKind::Full => Self::Full(Box::new(FullTwin::new(system, bodies, step_s))),
            TwinKind::Reduced => Self::Reduced(Box::new(ReducedTwin::new(system, bodies, step_s))),
        }
    }
}

impl AnyTwin {
    /// The spacecraft and the mechanism.
    #[must_use]
    pub fn system(&self) -> &System {
        match self {
            Self::Full(t) => t.system(),
            Self::Reduced(t) => t.system(),
        }
    }

    /// Advances by one physics step with the control wrenches held.
    pub fn step(&mut self, inputs: &Inputs) {
        match self {
            Self::Full(t) => t.step(inputs),
            Self::Reduced(t) => t.step(inputs),
        }
    }

    /// State of the present instant.
    #[must_use]
    pub fn state(&self) -> DockingState {
        match self {
            Self::Full(t) => t.state(),
            Self::Reduced(t) => t.state(),
        }
    }

    /// Digest of everything the next step depends on.
    #[must_use]
    pub fn digest(&self) -> Digest {
        match self {
            Self::Full(t) => t.digest(),
            Self::Reduced(t) => t.digest(),
        }
    }
}

/// A twin with its steps in a tick.
pub struct TickedTwin {
    twin: AnyTwin,
    steps: u32,
    step_s: f64,
}

impl TickedTwin {
    /// Of these bodies, in `steps` steps a tick of `tick_nanos`.
    #[must_use]
    pub fn new(
        kind: TwinKind,
        system: System,
        bodies: [BodyState; 3],
        tick_nanos: u64,
        steps: u32,
    ) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "a tick is far below 2^53 ns")]
        let step_s = tick_nanos as f64 / 1e9 / f64::from(steps);
        Self { twin: AnyTwin::new(kind, system, bodies, step_s), steps, step_s }
    }

    /// At the start of a scenario, in the scenario's steps or the twin's own.
    ///
    /// # Errors
    /// The sides overlap there.
    pub fn of(scenario: &Scenario, kind: TwinKind) -> Result<Self, StartOverlap> {
        let (system, bodies) = start(scenario)?;
        let steps = kind.steps_per_tick(scenario);
        Ok(Self::new(kind, system, bodies, scenario.run.tick_nanos, steps))
    }

    /// The twin.
    #[must_use]
    pub const fn twin(&self) -> &AnyTwin {
        &self.twin
    }

    /// Steps in a tick.
    #[must_use]
    pub const fn steps(&self) -> u32 {
        self.steps
    }

    /// Physics step, s.
    #[must_use]
    pub const fn step_s(&self) -> f64 {
        self.step_s
    }

    /// Everything at the present instant, which is `time_s` after the start.
    #[must_use]
    pub fn instant(&self, time_s: f64) -> Instant {
        Instant::new(self.twin.system(), self.twin.state(), time_s, self.step_s)
    }

    /// Steps over a tick with the control wrenches held.
    pub fn tick(&mut self, control: &Inputs) {
        for _ in 0..self.steps {
            self.twin.step(control);
        }
    }
}
