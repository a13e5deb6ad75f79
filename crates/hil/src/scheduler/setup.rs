//! Everything a run needs, and the one place where it is put together.

use core::{fmt, time::Duration};

use docktwin_control::{
    compensation::{Believed, Compensation, MOST_LEAD_S, Method},
    feedforward::{Feedforward, LegCorrections},
    one_sided::Interface,
    rig::RigSetup,
    safety::{Limit, SafetyLimits},
    sensing::SensorScheme,
};
use docktwin_core::PERIOD_NS;
use docktwin_model::{HydraulicPreset, Rig as RigModel, SixAxisSensor};
use docktwin_physics::{
    body::BodyState, mechanism::System, mounted::Payload, programme::Programme,
};

use super::IN_FLIGHT;
use crate::{
    calibrate::{Calibration, accelerometers_ahead_s},
    identify::Identification,
};

/// Most ticks by which commands can be held back.
pub const MOST_ADDED: usize = 30;

/// Loads at which the supervisor stops, over the mechanism's own limits.
const LOAD_MARGIN: f64 = 1.2;

/// Everything a run needs, nothing of which changes in it. Made by [`LoopSetup::builder`].
#[derive(Clone, Debug)]
pub struct LoopSetup {
    /// The rig as its file says.
    pub rig: RigModel,
    /// Feed-forward of the legs, with their assumed parameters.
    pub feedforward: Feedforward,
    /// Other assumed parameters of the rig.
    pub parameters: RigParameters,
    /// The spacecraft at the initial condition.
    pub bodies: Programme,
    /// Mechanism and spacecraft as their files say: a compensator may model them, and they must not touch on the way
    /// to the initial condition.
    pub system: System,
    /// Compensator of the delay of the rig.
    pub compensation: Compensation,
    /// Ticks by which every command is held back, at most [`MOST_ADDED`]: emulates a rig with a
    /// longer delay.
    pub added_ticks: usize,
    /// Where F4, M4 come from.
    pub scheme: SensorScheme,
    /// Mass of the ring, whose weight sensor A measures where the mechanism reports it, kg; 0 where none
    /// moves.
    pub ring_mass_kg: f64,
    /// What ends the run.
    pub limits: SafetyLimits,
    /// Times and speeds of the way to the initial condition.
    pub approach: Approach,
    /// Ticks of the closed loop.
    pub ticks: u64,
    /// Number of this run at the port, not 0.
    pub session: u64,
    /// Timeout of a measurement: in lockstep long enough for the rig, otherwise almost zero.
    pub patience: Duration,
    /// Slowly to the initial condition and back, without closing the loop.
    pub dry_run: bool,
}

/// The way to the initial condition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Fastest of the first move, m/s.
    pub speed_m_s: f64,
    /// Fastest turning of it, rad/s.
    pub rate_rad_s: f64,
    /// Rest before the run-up, over whose second half sensors are tared, s.
    pub settle_s: f64,
    /// Duration of the run-up, s.
    pub run_up_s: f64,
}

/// What is believed of a rig besides its geometry and its legs: by its file, by identification and by
/// calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigParameters {
    /// What was identified of every leg and is to be undone.
    pub corrections: LegCorrections,
    /// What sensor B carries.
    pub payload: Payload,
    /// From the time of a command to the time at which sensor B measures the resulting motion of
    /// the plate, s: delay of the plate and lag of the sensor. Used to subtract weight and inertia
    /// of the load on the sensor if the plate has no accelerometers.
    pub interface_delay_s: f64,
    /// The lead that undoes the delay of plate and sensor A, s.
    pub lead_s: f64,
    /// Lag of sensor B less that of the accelerometers, s.
    pub accelerometers_ahead_s: f64,
    /// Force sensors A and B, with the delays that were calibrated; `None` without a table `[sensors]`.
    pub sensors: Option<[SixAxisSensor; 2]>,
}

impl RigParameters {
    /// As the rig's file says, and better where it was identified or calibrated.
    #[must_use]
    pub fn new(
        rig: &RigModel,
        identification: Option<&Identification>,
        calibration: Option<&Calibration>,
    ) -> Self {
        let [plate_s, sensor_s] = believed_delays_s(rig);
        let force = rig.sensors.map(|s| s.force);
        let delays_s = force.map(|force| {
            let of_a = calibration.map_or(force, |c| c.sensor(0, &force));
            let lag_s = calibration
                .map_or_else(|| Interface::of_sensor(&force).lag_s(), |c| c.lag_s(1, &force));
            identification.map_or_else(
                || (plate_s + lag_s, plate_s + Interface::of_sensor(&of_a).lag_s()),
                |found| (found.delay_s() + lag_s, found.lead_s(&of_a)),
            )
        });
        let filed_s = plate_s + sensor_s;
        let sensors = force.map(|f| [0, 1].map(|i| calibration.map_or(f, |c| c.sensor(i, &f))));
        let (interface_delay_s, lead_s) = delays_s.unwrap_or((filed_s, filed_s));
        Self {
            corrections: identification
                .map_or_else(LegCorrections::default, Identification::corrections),
            payload: calibration.and_then(|c| c.of_b).map_or_else(
                || Payload::of(rig.passive_payload, &rig.x_4p.inverse()),
                |b| b.payload,
            ),
            interface_delay_s,
            lead_s,
            accelerometers_ahead_s: rig.sensors.map_or(0.0, |file| {
                calibration.map_or_else(
                    || accelerometers_ahead_s(&file),
                    |c| c.accelerometers_ahead_s(&file),
                )
            }),
            sensors,
        }
    }
}

/// Delays of the rig according to its file, s: from the time of a command to the motion of the
/// plate (transport and, with position loops, their lag), and from the force to its reading by sensor A. Their
/// sum is the lead that is believed to undo the rig.
#[must_use]
pub fn believed_delays_s(rig: &RigModel) -> [f64; 2] {
    let sensor = rig.sensors.map_or(0.0, |s| Interface::of_sensor(&s.force).lag_s());
    [rig.drive.lag_s() - tick_s(), sensor]
}

fn tick_s() -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a period is far below 2^53 ns")]
    let s = PERIOD_NS as f64 * 1e-9;
    s
}

/// Why a set-up cannot be run: all that is wrong with it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct SetupProblems(pub Vec<String>);

impl fmt::Display for SetupProblems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the loop cannot be set up: {}", self.0.join("; "))
    }
}

impl LoopSetup {
    /// A loop at 1 kHz around a rig as its file says: without compensation, with one force sensor, loads
    /// limited by the mechanism, a slow approach with a run-up of one second, and ten seconds of the
    /// closed loop as session 1. `bodies` are chaser, ring and target at the initial condition.
    #[must_use]
    pub fn builder(
        rig: &RigModel,
        preset: HydraulicPreset,
        system: &System,
        bodies: &[BodyState; 3],
    ) -> LoopSetupBuilder {
        let loads = &system.mechanism().limits;
        let force_n = loads.tension_n.max(loads.compression_n).max(loads.shear_n) * LOAD_MARGIN;
        let moment_nm = loads.torsion_nm.max(loads.bending_nm) * LOAD_MARGIN;
        LoopSetupBuilder(Self {
            feedforward: RigSetup::of_rig(rig, preset, None).feedforward(),
            parameters: RigParameters::new(rig, None, None),
            bodies: Programme::new(system, bodies, tick_s()),
            system: system.clone(),
            compensation: Compensation::None,
            added_ticks: 0,
            scheme: SensorScheme::Single,
            ring_mass_kg: system.ring_mass_kg(),
            limits: SafetyLimits::of_rig(rig, force_n, moment_nm),
            approach: Approach { speed_m_s: 0.05, rate_rad_s: 0.05, settle_s: 0.6, run_up_s: 1.0 },
            ticks: 10_000,
            session: 1,
            patience: Duration::ZERO,
            dry_run: false,
            rig: rig.clone(),
        })
    }

    /// The compensator that is named, made of what is believed of rig and mechanism.
    #[must_use]
    pub fn method(&self) -> Method {
        self.compensation.method(&self.believed())
    }

    pub(super) fn believed(&self) -> Believed<'_> {
        Believed {
            rig: &self.rig,
            system: &self.system,
            scheme: self.scheme,
            sensors: self.parameters.sensors,
        }
    }

    /// Why this cannot be run.
    #[must_use]
    pub fn problems(&self) -> Vec<String> {
        let mut out = Vec::new();
        let mut check = |good: bool, problem: &dyn Fn() -> String| {
            if !good {
                out.push(problem());
            }
        };
        let lead_s = self.compensation.lead_s();
        check((0.0..=MOST_LEAD_S).contains(&lead_s), &|| {
            format!("a lead of {lead_s} s: give 0 to {MOST_LEAD_S} s")
        });
        check(self.added_ticks <= MOST_ADDED, &|| {
            format!("{} added ticks: give at most {MOST_ADDED}", self.added_ticks)
        });
        check(self.session != 0, &|| "session 0: give another number".to_owned());
        check(self.ticks > 0, &|| "no ticks of the closed loop: give at least 1".to_owned());
        let a = &self.approach;
        for (what, value) in [
            ("speed of the approach", a.speed_m_s),
            ("rate of the approach", a.rate_rad_s),
            ("rest before the run-up", a.settle_s),
            ("duration of the run-up", a.run_up_s),
        ] {
            check(value > 0.0 && value.is_finite(), &|| {
                format!("a {what} of {value}: give a finite number above 0")
            });
        }
        for limit in Limit::ALL {
            let value = self.limits.of(limit);
            check(value > 0.0, &|| {
                format!("a limit of {value} for {}: give a number above 0", limit.name())
            });
        }
        let p = &self.parameters;
        let remembered_s = (IN_FLIGHT - 2) as f64 * tick_s();
        check(self.scheme == SensorScheme::Single || p.interface_delay_s <= remembered_s, &|| {
            format!(
                "two sensors and a delay of {:.1} ms: what sensor B carries is taken off by commands of the last {:.0} ms; \
                 use one sensor",
                p.interface_delay_s * 1e3,
                remembered_s * 1e3
            )
        });
        check(p.interface_delay_s.is_finite() && p.accelerometers_ahead_s.is_finite(), &|| {
            "a delay that is not finite: make identification and calibration again".to_owned()
        });
        out
    }
}

/// A [`LoopSetup`] in the making.
#[derive(Clone, Debug)]
pub struct LoopSetupBuilder(LoopSetup);

impl LoopSetupBuilder {
    /// What is believed of the rig besides its file.
    #[must_use]
    pub fn parameters(mut self, parameters: RigParameters) -> Self {
        self.0.parameters = parameters;
        self
    }

    /// Against the delay of the rig.
    #[must_use]
    pub const fn compensation(mut self, compensation: Compensation) -> Self {
        self.0.compensation = compensation;
        self
    }

    /// Holds every command back by so many ticks, at most [`MOST_ADDED`].
    #[must_use]
    pub const fn added_ticks(mut self, added_ticks: usize) -> Self {
        self.0.added_ticks = added_ticks;
        self
    }

    /// Where F4, M4 come from.
    #[must_use]
    pub const fn sensors(mut self, scheme: SensorScheme) -> Self {
        self.0.scheme = scheme;
        self
    }

    /// Loads at the ports that end the run, N and N·m; `None` leaves those of the mechanism.
    #[must_use]
    pub fn loads(mut self, force_n: Option<f64>, moment_nm: Option<f64>) -> Self {
        let limits = &mut self.0.limits;
        limits.port_force_n = force_n.unwrap_or(limits.port_force_n);
        limits.port_moment_nm = moment_nm.unwrap_or(limits.port_moment_nm);
        self
    }

    /// Most energy that the loop may add, over the kinetic energy of the relative motion; `None`: it is not judged.
    #[must_use]
    pub const fn energy_limit(mut self, share: Option<f64>) -> Self {
        self.0.limits.energy_gained = share;
        self
    }

    /// Times and speeds of the way to the initial condition.
    #[must_use]
    pub const fn approach(mut self, approach: Approach) -> Self {
        self.0.approach = approach;
        self
    }

    /// Duration of the run-up, s, the approach otherwise as it is.
    #[must_use]
    pub const fn run_up_s(mut self, run_up_s: f64) -> Self {
        self.0.approach.run_up_s = run_up_s;
        self
    }

    /// Ticks of the closed loop.
    #[must_use]
    pub const fn ticks(mut self, ticks: u64) -> Self {
        self.0.ticks = ticks;
        self
    }

    /// Number of this run at the port, not 0.
    #[must_use]
    pub const fn session(mut self, session: u64) -> Self {
        self.0.session = session;
        self
    }

    /// How long to wait for a measurement.
    #[must_use]
    pub const fn patience(mut self, patience: Duration) -> Self {
        self.0.patience = patience;
        self
    }

    /// Slowly to the initial condition and back, without closing the loop.
    #[must_use]
    pub const fn dry_run(mut self, dry_run: bool) -> Self {
        self.0.dry_run = dry_run;
        self
    }

    /// The set-up.
    ///
    /// # Errors
    /// All that is wrong with it.
    pub fn build(self) -> Result<LoopSetup, SetupProblems> {
        let problems = self.0.problems();
        if problems.is_empty() { Ok(self.0) } else { Err(SetupProblems(problems)) }
    }
}
