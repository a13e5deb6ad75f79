//! Dockings on the emulated rig against the simulated system, and a budget of what they differ by.
//!
//! A budget takes one cause of deviation after the other out of the rig's file, and puts each alone into a rig
//! without any. What the loop believes follows the file, so a cause is removed from the rig and from its model
//! alike. Drawn mechanisms: [`draws`]; balances of other quality: [`offloads`]. The figures are those of `docktwin_run::fidelity`; nothing is defined here a second time.

use docktwin_hil::pushed::Pushed;
use docktwin_model::{Offload, Rig, SixAxisSensor};
use docktwin_physics::reduced::Inputs;
use docktwin_record::{Fidelity, FidelityFigures, FidelityOf, Outcome};
use docktwin_run::{
    Control as _, HilOptions, HilRun, RunError, Situation, SummaryOnly, TimedThrusts,
};
use docktwin_scenario::Scenario;
use serde::{Deserialize, Serialize};

use crate::Progress;

pub mod draws;
pub mod offloads;

/// Something that makes a docking on the rig differ from the one in orbit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Weight of the ring, and the balance that carries it.
    Weight,
    /// F4, M4 from sensor A by (12) and (13), which leave the inertia of the ring out.
    SensorScheme,
    /// Noise and steps of all sensors.
    Noise,
    /// Dead zone of the force sensors.
    DeadZone,
    /// Lag and delay of the force sensors and accelerometers.
    SensorLag,
    /// Dead time of the legs beyond one tick.
    Delay,
    /// Friction of the legs' seals.
    LegFriction,
    /// Lag of the servo valves.
    Valve,
    /// Legs that do not go exactly where they are commanded: oil, valves and seals, which act through it, or
    /// position loops.
    Legs,
    /// The rack stands still where the chaser in orbit gives way, so the ring feels less.
    Rack,
    /// Halves of a drawn mechanism that do not stand where the files say.
    Mounts,
}

/// Fastest sensor and valve of a rig without that cause, Hz.
const FAST_HZ: f64 = 5000.0;
const FAST_VALVE_HZ: f64 = 1000.0;
/// What is left of friction and noise in a rig without them: a sensor that never changes counts as dead.
const NEARLY_NONE: f64 = 1e-6;
/// Dead time of a rig without delay, s: the tick from a command to its arrival.
const ONE_TICK_S: f64 = 0.001;

impl Cause {
    /// All, in the order of the tables.
    pub const ALL: [Self; 11] = [
        Self::Weight,
        Self::SensorScheme,
        Self::Noise,
        Self::DeadZone,
        Self::SensorLag,
        Self::Delay,
        Self::LegFriction,
        Self::Valve,
        Self::Legs,
        Self::Rack,
        Self::Mounts,
    ];

    /// Its name in files and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Weight => "weight",
            Self::SensorScheme => "sensor_scheme",
            Self::Noise => "noise",
            Self::DeadZone => "dead_zone",
            Self::SensorLag => "sensor_lag",
            Self::Delay => "delay",
            Self::LegFriction => "leg_friction",
            Self::Valve => "valve",
            Self::Legs => "legs",
            Self::Rack => "rack",
            Self::Mounts => "mounts",
        }
    }

    /// What must be there for it to act at all.
    #[must_use]
    pub const fn acts_through(self) -> Option<Self> {
        match self {
            Self::LegFriction | Self::Valve => Some(Self::Legs),
            _ => None,
        }
    }

    /// Takes it out of a rig.
    fn remove_from(self, rig: &mut Rig) {
        let mut sensors = |change: &dyn Fn(&mut SixAxisSensor)| {
            if let Some(s) = &mut rig.sensors {
                change(&mut s.force);
                s.accelerometer.iter_mut().for_each(change);
            }
        };
        match self {
            Self::Weight => {
                let ideal = Offload {
                    share: 1.0,
                    friction_n: 0.0,
                    added_mass_kg: 0.0,
                    stiffness_n_m: 1e6,
                    damping_ratio: 0.0,
                };
                rig.offload = Some(ideal);
            }
            // A setting of the loop, and what no file of a rig can say.
            Self::SensorScheme | Self::Legs | Self::Rack | Self::Mounts => {}
            Self::Noise => {
                sensors(&|s| {
                    s.noise = s.noise.map(|x| x * NEARLY_NONE);
                    (s.quantum, s.drift_per_s) = ([0.0; 2], [0.0; 2]);
                });
                if let Some(s) = &mut rig.sensors {
                    (s.length_noise_m, s.length_quantum_m, s.pressure_noise_n) = (0.0, 0.0, 0.0);
                }
            }
            Self::DeadZone => sensors(&|s| s.dead_zone = [0.0; 2]),
            Self::SensorLag => sensors(&|s| {
                (s.natural_frequency_hz, s.damping_ratio, s.delay_s) = (FAST_HZ, 0.7, 0.0);
            }),
            Self::Delay => rig.drive.set_dead_time_s(rig.drive.dead_time_s().min(ONE_TICK_S)),
            // Of oil alone; what position loops do of themselves is told by the legs.
            Self::LegFriction => {
                if let Some(h) = rig.drive.hydraulic_mut() {
                    h.friction.coulomb_n *= NEARLY_NONE;
                    h.friction.static_n *= NEARLY_NONE;
                }
            }
            Self::Valve => {
                if let Some(h) = rig.drive.hydraulic_mut() {
                    h.valve.natural_frequency_hz = h.valve.natural_frequency_hz.max(FAST_VALVE_HZ);
                }
            }
        }
    }
}

/// A docking on an emulated rig.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OnRig {
    /// Against the simulated system.
    pub fidelity: Fidelity,
    /// How it ended.
    pub outcome: Outcome,
    /// Why the supervisor stopped it, if it did: its figures are those of a part of a docking.
    pub stopped: Option<String>,
}

/// Over what the figures of a docking count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Window {
    /// From first contact to capture + 1 s.
    ToCapture,
    /// All of it, where nothing is captured.
    WholeRun,
}

impl OnRig {
    /// The window that counts for it.
    #[must_use]
    pub fn window(&self) -> Window {
        let of = self.fidelity.hardware.or(self.fidelity.felt).unwrap_or_default();
        if of.to_capture.window_s.is_some() { Window::ToCapture } else { Window::WholeRun }
    }

    /// The hardware's figures.
    #[must_use]
    pub fn hardware(&self, window: Window) -> FidelityFigures {
        of_window(self.fidelity.hardware, window)
    }

    /// The same of what was felt.
    #[must_use]
    pub fn felt(&self, window: Window) -> FidelityFigures {
        of_window(self.fidelity.felt, window)
    }
}

fn of_window(of: Option<FidelityOf>, window: Window) -> FidelityFigures {
    let of = of.unwrap_or_default();
    match window {
        Window::ToCapture => of.to_capture,
        Window::WholeRun => of.whole_run,
    }
}

/// Runs a scenario on the emulated rig, some causes removed.
///
/// # Errors
/// Problems of the rig's files, or a rig that cannot be armed.
pub fn on_rig(
    scenario: &Scenario,
    options: &HilOptions,
    removed: &[Cause],
) -> Result<OnRig, RunError> {
    let mut scenario = scenario.clone();
    scenario.hil.two_sensors |= removed.contains(&Cause::SensorScheme);
    let mut run = HilRun::with_rig(&scenario, options.clone(), |rig| {
        removed.iter().for_each(|cause| cause.remove_from(rig));
    })?;
    if removed.contains(&Cause::Mounts) {
        run = run.mounted_as_filed();
    }
    ended(run, removed, &scenario)
}

/// Runs it to its end.
fn ended(run: HilRun<'_>, removed: &[Cause], scenario: &Scenario) -> Result<OnRig, RunError> {
    let pushed = Pushed::default();
    let rig = run.emulated_with(|mut rig| {
        if removed.contains(&Cause::Legs) {
            rig = rig.with_exact_legs();
        }
        if removed.contains(&Cause::Rack) {
            rig = rig.with_yielding_rack(pushed.clone());
        }
        rig
    })?;
    // The loop adds the thrusts to the bodies by itself; the rack is told here.
    let mut thrusts = TimedThrusts::of(scenario);
    let told = |now: &Situation| {
        pushed.set(&thrusts.wrenches(now).chaser);
        Inputs::default()
    };
    let summary = run.run_with(rig, &mut SummaryOnly, told, &mut (), &mut ())?;
    let stopped = (summary.outcome == Outcome::Stopped)
        .then(|| summary.failure_reason.unwrap_or_else(|| "stopped by the supervisor".to_owned()));
    Ok(OnRig { fidelity: summary.fidelity.unwrap_or_default(), outcome: summary.outcome, stopped })
}

/// What one cause does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Share {
    /// The cause.
    pub cause: Cause,
    /// The docking without it, all others there.
    pub without: OnRig,
    /// The docking with it alone, and with what it acts through.
    pub alone: OnRig,
}

/// What a scenario on the rig differs by.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Budget {
    /// Name of the scenario.
    pub scenario: String,
    /// The rig as its file says.
    pub as_is: OnRig,
    /// All causes removed.
    pub without_all: OnRig,
    /// Cause by cause.
    pub shares: Vec<Share>,
}

/// A figure of a docking over a window; `None` where it means nothing.
pub type Figure = fn(&OnRig, Window) -> Option<f64>;

impl Budget {
    /// What a cause adds to a figure: by taking it away from the rig as it is, by adding it to a rig without
    /// any cause; their difference is its interaction with the others. All over the window of the docking as it is;
    /// `None` where a run was stopped or has no such window.
    #[must_use]
    pub fn parts(&self, share: &Share, figure: Figure) -> [Option<f64>; 2] {
        let value = |r: &OnRig| figure(r, self.as_is.window()).filter(|_| r.stopped.is_none());
        let less = |a: &OnRig, b: &OnRig| Some(value(a)? - value(b)?);
        [less(&self.as_is, &share.without), less(&share.alone, self.without(share.cause))]
    }

    /// What removing a cause takes away beyond what it adds alone: its interaction with the others.
    #[must_use]
    pub fn interaction(&self, share: &Share, figure: Figure) -> Option<f64> {
        let [removed, alone] = self.parts(share, figure);
        Some(removed? - alone?)
    }

    /// The docking without any cause but what this one acts through.
    fn without(&self, cause: Cause) -> &OnRig {
        let through = self.shares.iter().find(|s| Some(s.cause) == cause.acts_through());
        through.map_or(&self.without_all, |s| &s.alone)
    }

    /// All runs that the supervisor stopped: what was removed or left, and why.
    pub fn stopped(&self) -> impl Iterator<Item = &str> {
        let of_causes = self.shares.iter().flat_map(|s| [&s.without, &s.alone]);
        let all = [&self.as_is, &self.without_all].into_iter().chain(of_causes);
        all.filter_map(|r| r.stopped.as_deref())
    }

    /// The cause whose removal takes most off the force's error on the hardware, and what is left of it.
    #[must_use]
    pub fn mend_first(&self) -> Option<(Cause, f64)> {
        let window = self.as_is.window();
        let left = |s: &Share| s.without.hardware(window).nrms_force;
        let best = self
            .shares
            .iter()
            .filter(|s| s.without.stopped.is_none())
            .filter_map(|s| Some((s.cause, left(s)?)));
        best.min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// The budget of a scenario: two runs a cause, and two.
///
/// # Errors
/// As [`on_rig`].
pub fn budget(
    scenario: &Scenario,
    options: &HilOptions,
    progress: &mut impl Progress,
) -> Result<Budget, RunError> {
    let of = 2 * Cause::ALL.len() as u64 + 2;
    let mut done = 0;
    let mut run = |removed: &[Cause]| {
        let out = on_rig(scenario, options, removed)?;
        done += 1;
        progress.at(done, of);
        Ok::<_, RunError>(out)
    };
    let as_is = run(&[])?;
    let without_all = run(&Cause::ALL)?;
    let mut shares = Vec::new();
    for cause in Cause::ALL {
        let stays = |c: Cause| c == cause || cause.acts_through() == Some(c);
        let others: Vec<Cause> = Cause::ALL.into_iter().filter(|c| !stays(*c)).collect();
        shares.push(Share { cause, without: run(&[cause])?, alone: run(&others)? });
    }
    progress.done();
    Ok(Budget { scenario: scenario.name.clone(), as_is, without_all, shares })
}
