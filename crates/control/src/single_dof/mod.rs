//! The HIL simulation with a single degree of freedom (§6): the smallest whole loop.
//!
//! ```text
//!            ┌── (6) simulated system: G_DDyn, G_DMech ──────────────────┐
//! body programme ── command ──> motion simulator ──> mechanism ──> force sensor ──┐
//!   m_r x'' = −F      1 kHz        G_MSim (9)          G_DMech        G_FSensor    │
//!       ^───────────────────────────── (7) ────────────────────────────────────────┘
//! ```
//!
//! Two bodies meet along one axis, `m_r = m1 m2/(m1 + m2)`. [`transfer`] has (4)–(9) as transfer
//! functions; [`Docking::simulated`] integrates the simulated system, and [`Docking::hil`] runs the
//! sampled loop with an interface: ideal, or one hydraulic leg with its controller and a force sensor.
//!
//! The body programme is a leapfrog of 1 kHz: in tick k the force measured at `t_k` kicks over the
//! whole tick, then the displacement drifts to `t_{k+1}`, so velocities lie half a tick behind.
//! With an ideal rig it neither gains nor loses energy. What is written in tick k is for `t_{k+1}`.

mod hil;
mod mechanism;
pub mod transfer;

use core::f64::consts::TAU;

use docktwin_model::{HydraulicDrive, HydraulicPreset};
use docktwin_physics::hydraulics::LegParameters;

pub use self::{
    hil::{Interface, measure},
    mechanism::{At, Mechanism, Memory},
};
use crate::{
    leg::{LegTuning, REFERRED_MASS_KG},
    rig::{SetupError, TICK_S},
};

/// Step with which the simulated system is integrated, s.
const REFERENCE_STEP_S: f64 = 1e-5;
/// Free flight before first touch, whole ticks.
const APPROACH_TICKS: f64 = 60.0;

/// A force sensor of second order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceSensor {
    /// Natural frequency, Hz (350: the paper's lower bound).
    pub natural_frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
}

impl ForceSensor {
    /// How late slow forces come, s.
    #[must_use]
    pub fn delay_s(&self) -> f64 {
        2.0 * self.damping_ratio / (TAU * self.natural_frequency_hz)
    }
}

/// What is done so that `G_I` comes near to one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compensation {
    /// Feed-forward of the commanded motion, as it is known, and nothing else.
    None,
    /// The motion is commanded ahead by dead time and sensor delay, with displacement, speed,
    /// acceleration and jerk of the body programme, and the measured contact force is fed forward
    /// to the leg.
    Ahead,
}

/// The hardware of a single-DOF HIL simulation: one leg that carries the plate, and a force sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct SingleDofSetup {
    /// The leg as built.
    pub leg: LegParameters,
    /// The leg as the controller believes it to be.
    pub believed_leg: LegParameters,
    /// Mass on the leg, kg (Table 1: 2500).
    pub mass_kg: f64,
    /// Tuning of the inner loop.
    pub tuning: LegTuning,
    /// From command to controller, s.
    pub dead_time_s: f64,
    /// The force sensor.
    pub sensor: ForceSensor,
    /// What the interface does about its delay.
    pub compensation: Compensation,
}

impl SingleDofSetup {
    /// Table 1 with oil, valve and seal of a rig's file, its own tuning, a sensor of 350 Hz and
    /// damping ratio 0.7, not compensated.
    #[must_use]
    pub fn of_drive(drive: &HydraulicDrive, preset: HydraulicPreset) -> Self {
        let leg = LegParameters::of_drive(drive, preset);
        Self {
            leg,
            believed_leg: leg,
            mass_kg: REFERRED_MASS_KG,
            tuning: LegTuning::preset(preset, &leg),
            dead_time_s: drive.valve.dead_time_s,
            sensor: ForceSensor { natural_frequency_hz: 350.0, damping_ratio: 0.7 },
            compensation: Compensation::None,
        }
    }

    /// The same with another compensation.
    #[must_use]
    pub fn with(&self, compensation: Compensation) -> Self {
        Self { compensation, ..self.clone() }
    }

    /// How far ahead a motion is commanded, s.
    #[must_use]
    pub fn lead_s(&self) -> f64 {
        match self.compensation {
            Compensation::None => 0.0,
            Compensation::Ahead => self.dead_time_s + self.sensor.delay_s(),
        }
    }
}

/// Two spacecraft that close along one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Docking {
    /// m1, kg (Table 2: 8000).
    pub chaser_kg: f64,
    /// m2, kg (Table 2: 12000).
    pub target_kg: f64,
    /// Closing speed, m/s, above 0.
    pub closing_speed_m_s: f64,
    /// Free way before first touch, m.
    pub gap_m: f64,
    /// What is between them.
    pub mechanism: Mechanism,
}

/// The docking at the beginning of one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Time, s.
    pub time_s: f64,
    /// Displacement of the bodies, m, from first touch on; positive when pressed together.
    pub body_m: f64,
    /// Their speed, m/s, half a tick before `time_s` in a HIL simulation.
    pub speed_m_s: f64,
    /// Displacement of the mechanism, m: the bodies' own in the simulated system, the rig's in a HIL
    /// simulation.
    pub rig_m: f64,
    /// True force of the mechanism, N; positive pushes apart.
    pub force_n: f64,
}

impl Docking {
    /// The bodies of Table 2 at a closing speed (m/s, above 0), 60 ms before they touch, a sixteenth of
    /// a tick after a tick.
    #[must_use]
    pub fn of_table_2(mechanism: Mechanism, closing_speed_m_s: f64) -> Self {
        let (chaser_kg, target_kg) = (8000.0, 12000.0);
        let docking = Self { chaser_kg, target_kg, closing_speed_m_s, gap_m: 0.0, mechanism };
        docking.touching(1.0 / 16.0)
    }

    /// The same, touching first so far after a tick, in parts of it (0 to 1). A programme that is
    /// sampled cannot know that moment, and forces that begin with a step depend on it.
    #[must_use]
    pub fn touching(&self, part: f64) -> Self {
        let gap_m = self.closing_speed_m_s * (APPROACH_TICKS + part) * TICK_S;
        Self { gap_m, ..self.clone() }
    }

    /// `m_r = m1 m2/(m1 + m2)`, kg.
    #[must_use]
    pub fn reduced_mass_kg(&self) -> f64 {
        self.chaser_kg * self.target_kg / (self.chaser_kg + self.target_kg)
    }

    /// The simulated system: bodies and mechanism alone, by fourth-order Runge–Kutta with 10 µs from
    /// the exact instant of first touch on, sampled at every tick. This is the reference.
    #[must_use]
    pub fn simulated(&self, ticks: u32) -> Vec<Sample> {
        let (v0, mass) = (self.closing_speed_m_s, self.reduced_mass_kg());
        let touch_s = self.gap_m / v0;
        let rates = |y: &[f64; 4]| -> [f64; 4] {
            let (m, at) = split(y);
            let [slip, bristle] = self.mechanism.memory_rates(&m, at);
            [at.v_m_s, -self.mechanism.force_n(&m, at) / mass, slip, bristle]
        };
        let mut y = [0.0, v0, 0.0, 0.0];
        let mut time_s = touch_s;
        let mut out = Vec::new();
        for tick in 0..=ticks {
            let t = f64::from(tick) * TICK_S;
            if t < touch_s {
                let body_m = v0 * t - self.gap_m;
                out.push(Sample {
                    time_s: t,
                    body_m,
                    speed_m_s: v0,
                    rig_m: body_m,
                    force_n: self
                        .mechanism
                        .force_n(&Memory::default(), At { x_m: body_m, v_m_s: v0 }),
                });
                continue;
            }
            // Equal steps that end on the tick.
            let steps = ((t - time_s) / REFERENCE_STEP_S).ceil().max(1.0);
            let h = (t - time_s) / steps;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "100 a tick"
            )]
            for _ in 0..steps as u32 {
                y = runge_kutta(rates, &y, h);
            }
            time_s = t;
            let (m, at) = split(&y);
            out.push(Sample {
                time_s: t,
                body_m: at.x_m,
                speed_m_s: at.v_m_s,
                rig_m: at.x_m,
                force_n: self.mechanism.force_n(&m, at),
            });
        }
        out
    }

    /// The HIL simulation with an interface, sampled at every tick; it ends early when the rig is
    /// more than 1 m away or its state is not finite.
    ///
    /// # Errors
    /// The interface cannot be built.
    pub fn hil(&self, interface: &Interface<'_>, ticks: u32) -> Result<Vec<Sample>, SetupError> {
        hil::run(self, interface, ticks)
    }
}

/// Memory and motion of the reference's state: displacement, speed, slip, bristle.
const fn split(y: &[f64; 4]) -> (Memory, At) {
    let memory = Memory { touched: true, slip_m: y[2], bristle: y[3] };
    (memory, At { x_m: y[0], v_m_s: y[1] })
}

fn runge_kutta(rates: impl Fn(&[f64; 4]) -> [f64; 4], y: &[f64; 4], h: f64) -> [f64; 4] {
    let along = |k: &[f64; 4], by: f64| core::array::from_fn(|i| y[i] + by * k[i]);
    let k1 = rates(y);
    let k2 = rates(&along(&k1, 0.5 * h));
    let k3 = rates(&along(&k2, 0.5 * h));
    let k4 = rates(&along(&k3, h));
    core::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
}

/// How far a HIL simulation lies from the simulated system; all are fractions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Likeness {
    /// RMS of the difference of the bodies' displacement over the RMS of the reference.
    pub displacement_nrms: f64,
    /// The same of the force.
    pub force_nrms: f64,
    /// Greatest displacement over the reference's, less one.
    pub displacement_peak: f64,
    /// Greatest force over the reference's, less one.
    pub force_peak: f64,
}

impl Likeness {
    /// Compares from first touch on. A simulation that ended early is compared as far as it went.
    #[must_use]
    pub fn of(hil: &[Sample], reference: &[Sample]) -> Self {
        let touch = reference.iter().position(|s| s.body_m >= 0.0).unwrap_or(0);
        let pairs = || hil.iter().zip(reference).skip(touch);
        let of = |value: fn(&Sample) -> f64| {
            let square = |f: &dyn Fn(&Sample, &Sample) -> f64| {
                pairs().map(|(a, b)| f(a, b).powi(2)).sum::<f64>()
            };
            let most = |s: &[Sample]| s.iter().map(value).fold(0.0, f64::max);
            let nrms = (square(&|a, b| value(a) - value(b)) / square(&|_, b| value(b))).sqrt();
            (nrms, most(hil) / most(reference) - 1.0)
        };
        let (displacement_nrms, displacement_peak) = of(|s| s.body_m);
        let (force_nrms, force_peak) = of(|s| s.force_n);
        Self { displacement_nrms, force_nrms, displacement_peak, force_peak }
    }

    /// Figure by figure the one of both that is larger without sign.
    #[must_use]
    pub fn or_worse(&self, other: &Self) -> Self {
        let larger = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
        Self {
            displacement_nrms: larger(self.displacement_nrms, other.displacement_nrms),
            force_nrms: larger(self.force_nrms, other.force_nrms),
            displacement_peak: larger(self.displacement_peak, other.displacement_peak),
            force_peak: larger(self.force_peak, other.force_peak),
        }
    }

    /// The largest of all four, without sign.
    #[must_use]
    pub fn worst(&self) -> f64 {
        [self.displacement_nrms, self.force_nrms, self.displacement_peak, self.force_peak]
            .into_iter()
            .map(f64::abs)
            .fold(0.0, f64::max)
    }
}

/// What one contact did, seen from the body programme.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rebound {
    /// Speed apart over the speed of approach.
    pub restitution: f64,
    /// From first touch until the displacement is zero again, s.
    pub time_s: f64,
}

impl Rebound {
    /// Of a run that ends after its one contact; `None` if it does not.
    #[must_use]
    pub fn of(docking: &Docking, run: &[Sample]) -> Option<Self> {
        let back = run.windows(2).rev().find(|w| w[0].body_m > 0.0 && w[1].body_m <= 0.0)?;
        let last = run.last().filter(|s| s.rig_m < 0.0)?;
        let share = back[0].body_m / (back[0].body_m - back[1].body_m);
        let v0 = docking.closing_speed_m_s;
        Some(Self {
            restitution: -last.speed_m_s / v0,
            time_s: back[0].time_s + share * TICK_S - docking.gap_m / v0,
        })
    }
}
