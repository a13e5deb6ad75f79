//! A scenario as it is loaded: plain data, angles in radians.

use docktwin_core::{DVec3, Euler, FULL_STEPS_PER_MS};
use docktwin_model::{
    DockingMechanism, FileDigest, HydraulicPreset, Note, Problem, Sources, Spacecraft, input,
};

use crate::expect::Expect;

/// A scenario with everything it names, checked. Angles are radians.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Name.
    pub name: String,
    /// What happens.
    pub description: String,
    /// The chaser, active side.
    pub chaser: Spacecraft,
    /// The target, passive side.
    pub target: Spacecraft,
    /// The mechanism between them, overrides of the scenario applied.
    pub mechanism: DockingMechanism,
    /// Relative state at the plane of first contact.
    pub initial: InitialConditions,
    /// Time and steps.
    pub run: RunSettings,
    /// Control wrenches.
    pub thrusts: Vec<Thrust>,
    /// The loop that `hil` closes around a rig.
    pub hil: HilSettings,
    /// What makes the verdict.
    pub expect: Expect,
    /// What the model files hold that is not used.
    pub notes: Vec<Note>,
    /// Every file read, the scenario first.
    pub files: Vec<FileDigest>,
    /// Where they were read from.
    pub sources: Sources,
    /// The scenario file with the overrides applied.
    pub effective_toml: String,
}

impl Scenario {
    /// The scenario as it ran: the file with overrides applied, and the digest of every file it was
    /// made from as comments. It can be loaded again.
    #[must_use]
    pub fn as_run_toml(&self) -> String {
        let mut text = self.effective_toml.trim_end().to_owned();
        text.push_str("\n\n# Files of this run: digest and path\n");
        for file in &self.files {
            // A line feed in a name would end the comment.
            text.push_str(&format!("# {} {}\n", file.digest, input::shown_path(&file.path)));
        }
        text
    }
}

/// Relative state of the ports at the plane of first contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitialConditions {
    /// Closing speed of the ring centres along X3, m/s, > 0.
    pub axial_speed_m_s: f64,
    /// Offset of the target's ring centre from the chaser's along Y3 and Z3, m.
    pub lateral_m: [f64; 2],
    /// Speed of the target's ring centre relative to the chaser's along Y3 and Z3, m/s.
    pub lateral_speed_m_s: [f64; 2],
    /// Euler angles of `R_34`, rad.
    pub attitude: Euler,
    /// Angular velocity of the target relative to the chaser, in e4, rad/s.
    pub rates_rad_s: DVec3,
    /// Which body has these rates before contact.
    pub turning: TurningBody,
    /// How far before first contact, along X3, the run starts, m.
    pub gap_m: f64,
}

/// Which body turns before contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TurningBody {
    /// The target alone.
    #[default]
    Target,
    /// The chaser alone, with its ring.
    Chaser,
    /// Each at half of the rate, opposite.
    Both,
}

impl TurningBody {
    /// Words by which a scenario names them.
    pub const WORDS: [(&'static str, Self); 3] =
        [("target", Self::Target), ("chaser", Self::Chaser), ("both", Self::Both)];
}

/// Time and steps of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunSettings {
    /// Simulated time after which the run ends at the latest, s.
    pub duration_s: f64,
    /// Period of the recorded ticks, ns.
    pub tick_nanos: u64,
    /// Steps of the integrator in one tick; `None` leaves it to the twin.
    pub steps_per_tick: Option<u32>,
    /// Whether the run ends as soon as the outcome cannot change.
    pub stop_when_decided: bool,
}

impl RunSettings {
    /// Number of ticks within the duration, at least one.
    #[must_use]
    pub fn ticks(&self) -> u64 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "the duration is positive and at most 1e5 s"
        )]
        let n = (self.duration_s * 1e9 / self.tick_nanos as f64).round() as u64;
        n.max(1)
    }

    /// Steps of a tick: its own, or those of a twin with `per_ms` steps in a tick of 1 ms, at least one.
    #[must_use]
    pub fn steps_in_tick(&self, per_ms: u32) -> u32 {
        self.steps_per_tick.unwrap_or_else(|| {
            let n = (self.tick_nanos * u64::from(per_ms)).div_ceil(1_000_000);
            u32::try_from(n).unwrap_or(u32::MAX).max(1)
        })
    }

    /// Longest step that a twin of a rehearsal takes with these settings, s: that of the full twin.
    #[must_use]
    pub fn longest_step_s(&self) -> f64 {
        self.tick_s() / f64::from(self.steps_in_tick(FULL_STEPS_PER_MS))
    }

    pub(crate) fn tick_s(&self) -> f64 {
        self.tick_nanos as f64 / 1e9
    }
}

/// What a scenario says of the loop and its rig; what is `None` is left to the rig and the tool.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HilSettings {
    /// URDF of the rig as named in the scenario.
    pub rig: Option<String>,
    /// Oil volume.
    pub preset: Option<HydraulicPreset>,
    /// What is done against the delay of the rig and what it adds.
    pub compensator: Option<CompensatorChoice>,
    /// Lead, s.
    pub lead_s: Option<f64>,
    /// By which every command is held back, s.
    pub added_delay_s: f64,
    /// True with a sensor of its own for F4, M4.
    pub two_sensors: bool,
    /// Of the supervisor, N.
    pub force_limit_n: Option<f64>,
    /// Of the supervisor, N·m.
    pub moment_limit_nm: Option<f64>,
    /// Of the supervisor: energy that the loop may add, over the kinetic energy.
    pub energy_limit: Option<f64>,
}

/// Compensator of the delay of a rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CompensatorChoice {
    /// Nothing.
    None,
    /// `x + τ v`.
    Lead,
    /// Phase lead of the force, second-order lead of the position.
    ForceLead,
    /// Polynomial of first order through past commands.
    Pe1,
    /// Of second order.
    Pe2,
    /// Of third order.
    Pe3,
    /// Inverse of the drives from position, speed and measured force.
    StateForceInverse,
    /// Smith predictor with a contact identified in the contact, and a lead.
    SmithLead,
    /// The same with an observer of the dead zone.
    SmithDob,
    /// Force corrected by a simple model known beforehand.
    PriorForce,
    /// Inverse whose coefficients are found by least squares over the last second.
    Ats,
    /// Inverse whose coefficients follow the gradient of the error.
    Amb,
    /// Inverse of every leg by recursive least squares.
    RlsInverse,
    /// Inverse by an unscented Kalman filter of plate and drive.
    UkfInverse,
    /// Damping that takes the energy that came from nowhere.
    Passivity,
    /// Two twins, in orbit and on the ground, and a lead.
    Twin,
    /// The same with the measured wrenches left out: a control for validations.
    TwinModelOnly,
}

impl CompensatorChoice {
    /// Words by which scenario and command line name them.
    pub const WORDS: [(&'static str, Self); 17] = [
        ("none", Self::None),
        ("lead", Self::Lead),
        ("force-lead", Self::ForceLead),
        ("pe1", Self::Pe1),
        ("pe2", Self::Pe2),
        ("pe3", Self::Pe3),
        ("state-force-inverse", Self::StateForceInverse),
        ("smith-lead", Self::SmithLead),
        ("smith-dob", Self::SmithDob),
        ("prior-force", Self::PriorForce),
        ("ats", Self::Ats),
        ("amb", Self::Amb),
        ("rls-inverse", Self::RlsInverse),
        ("ukf-inverse", Self::UkfInverse),
        ("passivity", Self::Passivity),
        ("twin", Self::Twin),
        ("twin-model-only", Self::TwinModelOnly),
    ];

    /// The same words as an option of the command line shows them.
    pub const NAMES: &'static str = "none|lead|force-lead|pe1|pe2|pe3|state-force-inverse|smith-lead|smith-dob|prior-force|ats|amb|rls-inverse|ukf-inverse|passivity|twin|twin-model-only";
}

/// The body a thrust acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Body {
    /// F1, M1.
    Chaser,
    /// F2, M2.
    Target,
}

/// The event from which a thrust is timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trigger {
    /// The start of the run.
    Start,
    /// First contact.
    FirstContact,
    /// Capture.
    Capture,
}

/// A constant force and moment for some time, at the mass centre in body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thrust {
    /// The body.
    pub on: Body,
    /// The event.
    pub after: Trigger,
    /// From the event to the thrust, s.
    pub delay_s: f64,
    /// How long it lasts, s.
    pub duration_s: f64,
    /// Force, N.
    pub force_n: DVec3,
    /// Moment, N·m.
    pub moment_nm: DVec3,
    /// Whether it ends at capture.
    pub until_capture: bool,
}

/// All problems of a scenario and of the models it names.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}", problems.iter().map(Problem::to_string).collect::<Vec<_>>().join("\n"))]
pub struct ScenarioErrors {
    /// At least one.
    pub problems: Vec<Problem>,
}
