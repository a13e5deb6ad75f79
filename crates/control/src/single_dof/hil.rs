//! The sampled loop in time, and the interface measured by a sine.

use core::f64::consts::TAU;

use docktwin_physics::hydraulics::{Leg, SingleLeg, SingleLegState};
use nalgebra::{Complex, Matrix2, Vector2};

use super::{At, Compensation, Docking, ForceSensor, Mechanism, Memory, Sample, SingleDofSetup};
use crate::{
    feedforward::LegCommand,
    leg::{LegController, LegMeasurement},
    rig::{CommandPath, SetupError, TICK_S, samples_per_tick},
};

/// Steps of the plant in a tick, as of the six-leg rig.
const PLANT_STEPS: u32 = 8;
/// Steps of an ideal rig's mechanism in a tick.
const IDEAL_STEPS: u32 = 16;
/// A rig further away than this has run off, m.
const LOST_M: f64 = 1.0;

/// What stands between programme and mechanism.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interface<'a> {
    /// `G_I = e^(−τ s)`: a rig and a sensor without fault but a delay τ of 0 to 10 ms; 0 is `G_I = 1`.
    Ideal {
        /// τ, s.
        delay_s: f64,
    },
    /// One hydraulic leg and a force sensor.
    Leg(&'a SingleDofSetup),
}

/// The motion that a command asks for, at the time it is for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Motion {
    x_m: f64,
    v_m_s: f64,
    a_m_s2: f64,
    j_m_s3: f64,
    /// Contact force expected then, N, and its rate.
    force_n: f64,
    force_rate_n_s: f64,
}

impl Motion {
    /// The motion `t` later, with constant jerk and rate of force.
    fn ahead(&self, t: f64) -> Self {
        Self {
            x_m: self.x_m + t * (self.v_m_s + t / 2.0 * (self.a_m_s2 + t / 3.0 * self.j_m_s3)),
            v_m_s: self.v_m_s + t * (self.a_m_s2 + t / 2.0 * self.j_m_s3),
            a_m_s2: self.a_m_s2 + t * self.j_m_s3,
            force_n: self.force_n + t * self.force_rate_n_s,
            ..*self
        }
    }
}

/// A second-order sensor, exact for a force that changes evenly within a step.
#[derive(Clone, Copy, Debug)]
struct SensorState {
    step: Matrix2<f64>,
    delay_s: f64,
    /// Reading less the steady reading of the present ramp, and its rate.
    state: Vector2<f64>,
    force_n: f64,
}

impl SensorState {
    fn new(sensor: &ForceSensor, step_s: f64) -> Self {
        let w = TAU * sensor.natural_frequency_hz;
        let a = Matrix2::new(0.0, 1.0, -w * w, -2.0 * sensor.damping_ratio * w);
        Self {
            step: (a * step_s).exp(),
            delay_s: sensor.delay_s(),
            state: Vector2::zeros(),
            force_n: 0.0,
        }
    }

    fn run(&mut self, force_n: f64, step_s: f64) {
        let rate = (force_n - self.force_n) / step_s;
        // On a ramp the reading stands `delay` behind.
        let steady = |force: f64| Vector2::new(force - rate * self.delay_s, rate);
        self.state = steady(force_n) + self.step * (self.state - steady(self.force_n));
        self.force_n = force_n;
    }

    fn reading_n(&self) -> f64 {
        self.state[0]
    }
}

/// A leg in motion.
struct RunningLeg<'a> {
    setup: &'a SingleDofSetup,
    plant: SingleLeg,
    state: SingleLegState,
    controller: LegController,
    path: CommandPath<LegCommand>,
    sensor: SensorState,
    samples: u32,
    step_s: f64,
    valve_delay_s: f64,
}

impl<'a> RunningLeg<'a> {
    fn new(setup: &'a SingleDofSetup, start_m: f64) -> Result<Self, SetupError> {
        let step_s = TICK_S / f64::from(PLANT_STEPS);
        let rest = LegCommand { length_m: start_m, ..LegCommand::default() };
        Ok(Self {
            plant: SingleLeg {
                leg: Leg::new(setup.leg, step_s),
                mass_kg: setup.mass_kg,
                payload_n_m: 0.0,
            },
            state: SingleLegState { y_m: start_m, ..SingleLegState::default() },
            controller: LegController::new(setup.tuning, setup.believed_leg),
            path: CommandPath::new(rest, setup.dead_time_s)?,
            sensor: SensorState::new(&setup.sensor, step_s),
            samples: samples_per_tick(setup.tuning.rate_hz)?,
            step_s,
            valve_delay_s: setup.tuning.valve_delay_s(&setup.believed_leg),
            setup,
        })
    }

    /// Prefilter of (9): what the leg is to do for a motion.
    fn command(&self, motion: &Motion) -> LegCommand {
        let (setup, oil) = (self.setup, &self.setup.believed_leg.oil);
        // The path takes a command for the moment at which it is given.
        let at = motion.ahead(setup.lead_s() - TICK_S);
        let later = at.ahead(self.valve_delay_s);
        let force = |m: &Motion| setup.mass_kg * m.a_m_s2 + oil.viscous_n_s_m * m.v_m_s + m.force_n;
        let rate =
            setup.mass_kg * later.j_m_s3 + oil.viscous_n_s_m * later.a_m_s2 + later.force_rate_n_s;
        LegCommand {
            length_m: at.x_m,
            speed_m_s: at.v_m_s,
            flow_speed_m_s: later.v_m_s
                + rate / oil.oil_spring_n_m()
                + force(&later) * oil.leakage_m3_s_pa / (oil.area_m2 * oil.area_m2),
            force_n: force(&at),
        }
    }

    fn at(&self) -> At {
        At { x_m: self.state.y_m, v_m_s: self.state.v_m_s }
    }

    /// One tick towards the motion that is wanted at its end.
    fn tick(&mut self, motion: &Motion, mechanism: &Mechanism, memory: &mut Memory) {
        self.path.take(self.command(motion));
        let h = self.step_s;
        for k in 0..self.samples {
            let sample_s = self.setup.tuning.sample_s();
            let (now, before, since) = self.path.at(f64::from(k) * sample_s);
            let target = now.target(before, since, self.valve_delay_s);
            let measured = LegMeasurement {
                length_m: self.state.y_m,
                pressure_pa: self.state.leg.pressure_pa,
            };
            let valve = self.controller.step(&target, &measured);
            for _ in 0..PLANT_STEPS / self.samples {
                // The step kicks in its middle, after half a drift.
                let from = self.at();
                let mid = At { x_m: from.x_m + 0.5 * h * from.v_m_s, v_m_s: from.v_m_s };
                mechanism.advance(memory, from, mid, 0.5 * h);
                self.plant.step(&mut self.state, valve, mechanism.force_n(memory, mid));
                let to = self.at();
                mechanism.advance(memory, At { v_m_s: to.v_m_s, ..mid }, to, 0.5 * h);
                self.sensor.run(mechanism.force_n(memory, to), h);
            }
        }
    }
}

/// An interface at work.
enum Running<'a> {
    Ideal { path: Box<CommandPath<Motion>>, at: At },
    Leg(Box<RunningLeg<'a>>),
}

impl<'a> Running<'a> {
    fn new(interface: &Interface<'a>, start: &Motion) -> Result<Self, SetupError> {
        Ok(match interface {
            Interface::Ideal { delay_s } => Self::Ideal {
                path: Box::new(CommandPath::new(*start, *delay_s)?),
                at: At { x_m: start.x_m, v_m_s: start.v_m_s },
            },
            Interface::Leg(setup) => Self::Leg(Box::new(RunningLeg::new(setup, start.x_m)?)),
        })
    }

    fn at(&self) -> At {
        match self {
            Self::Ideal { at, .. } => *at,
            Self::Leg(leg) => leg.at(),
        }
    }

    fn felt_n(&self, force_n: f64) -> f64 {
        match self {
            Self::Ideal { .. } => force_n,
            Self::Leg(leg) => leg.sensor.reading_n(),
        }
    }

    /// Delay of the measured force, s; `None` if the force is not fed forward to the leg.
    fn expects_after_s(&self) -> Option<f64> {
        match self {
            Self::Leg(leg) if leg.setup.compensation == Compensation::Ahead => {
                Some(leg.setup.sensor.delay_s())
            }
            _ => None,
        }
    }

    /// One tick towards the motion commanded for its end.
    fn tick(&mut self, motion: &Motion, mechanism: &Mechanism, memory: &mut Memory) {
        match self {
            Self::Leg(leg) => leg.tick(motion, mechanism, memory),
            Self::Ideal { path, at } => {
                path.take(*motion);
                let h = TICK_S / f64::from(IDEAL_STEPS);
                for k in 1..=IDEAL_STEPS {
                    // Before the end of a step, so that a command never counts before it arrives.
                    let (now, _, since) = path.at(f64::from(k - 1) * h);
                    let m = now.ahead(since + h - TICK_S);
                    let to = At { x_m: m.x_m, v_m_s: m.v_m_s };
                    mechanism.advance(memory, *at, to, h);
                    *at = to;
                }
            }
        }
    }
}

pub(super) fn run(
    docking: &Docking,
    interface: &Interface<'_>,
    ticks: u32,
) -> Result<Vec<Sample>, SetupError> {
    let mass = docking.reduced_mass_kg();
    let mechanism = &docking.mechanism;
    let (mut x, mut v) = (-docking.gap_m, docking.closing_speed_m_s);
    let mut memory = Memory::default();
    let run_up = RunUp { end_m: x, speed_m_s: v };
    let mut rig = Running::new(interface, &run_up.at(0))?;
    for tick in 0..RunUp::TICKS {
        rig.tick(&run_up.at(tick + 1), mechanism, &mut memory);
    }
    let (mut out, mut felt_before) = (Vec::new(), 0.0);
    for tick in 0..=ticks {
        let at = rig.at();
        if !(at.x_m.abs() < LOST_M && x.abs() < LOST_M) {
            break;
        }
        let force_n = mechanism.force_n(&memory, at);
        out.push(Sample {
            time_s: f64::from(tick) * TICK_S,
            body_m: x,
            speed_m_s: v,
            rig_m: at.x_m,
            force_n,
        });
        let felt = rig.felt_n(force_n);
        let a = -felt / mass;
        let rate = (felt - felt_before) / TICK_S;
        felt_before = felt;
        v += a * TICK_S;
        let mut motion = Motion {
            x_m: x,
            v_m_s: v - 0.5 * a * TICK_S,
            a_m_s2: a,
            j_m_s3: -rate / mass,
            ..Motion::default()
        };
        if let Some(late_s) = rig.expects_after_s() {
            motion.force_n = felt + rate * late_s;
            motion.force_rate_n_s = rate;
        }
        x += v * TICK_S;
        rig.tick(&Motion { x_m: x, ..motion.ahead(TICK_S) }, mechanism, &mut memory);
    }
    Ok(out)
}

/// The run-up: from rest, softly to the speed of approach, then evenly.
struct RunUp {
    end_m: f64,
    speed_m_s: f64,
}

impl RunUp {
    const SOFT_S: f64 = 0.5;
    const TICKS: u32 = 1500;

    /// The motion `tick` ticks after its beginning.
    fn at(&self, tick: u32) -> Motion {
        let left_s = f64::from(Self::TICKS - tick) * TICK_S;
        let e = (f64::from(tick) * TICK_S / Self::SOFT_S).min(1.0);
        let v = self.speed_m_s;
        // Speed 3e² − 2e³; at its end this is half a soft time behind an even run.
        let behind = Self::SOFT_S * (0.5 - e + e * e * e * (1.0 - 0.5 * e));
        Motion {
            x_m: self.end_m - v * (left_s - behind),
            v_m_s: v * e * e * (3.0 - 2.0 * e),
            a_m_s2: v * 6.0 * e * (1.0 - e) / Self::SOFT_S,
            ..Motion::default()
        }
    }
}

/// `G_MSim` measured: the running, nonlinear leg follows a sine of `amplitude_m` at `hz` against a
/// spring of `payload_n_m`, friction and dead time included. From the commanded displacement to
/// that of the leg.
///
/// # Errors
/// The leg cannot be built.
pub fn measure(
    setup: &SingleDofSetup,
    payload_n_m: f64,
    amplitude_m: f64,
    hz: f64,
) -> Result<Complex<f64>, SetupError> {
    const SETTLE_S: f64 = 1.5;
    const MEASURE_S: f64 = 2.0;
    // Frequency brought to a whole number of ticks over a whole number of periods.
    let periods = (MEASURE_S * hz).ceil().max(1.0);
    let window = (periods / (hz * TICK_S)).round();
    let w = TAU * periods / (window * TICK_S);
    let mechanism = Mechanism::Linear { stiffness_n_m: payload_n_m, damping_n_s_m: 0.0 };
    let mut memory = Memory { touched: true, ..Memory::default() };
    let mut leg = RunningLeg::new(setup, 0.0)?;
    let (mut drive, mut answer) = (Complex::<f64>::ZERO, Complex::<f64>::ZERO);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "ticks of seconds")]
    let (settle, all) = ((SETTLE_S / TICK_S) as u32, (SETTLE_S / TICK_S + window) as u32);
    let mut felt_before = 0.0;
    for tick in 0..all {
        let t = f64::from(tick) * TICK_S;
        // A smooth beginning.
        let e = (t / 0.3).min(1.0);
        let a = amplitude_m * e * e * (3.0 - 2.0 * e);
        let (sin, cos) = (w * t).sin_cos();
        let mut motion = Motion {
            x_m: a * sin,
            v_m_s: a * w * cos,
            a_m_s2: -a * w * w * sin,
            j_m_s3: -a * w * w * w * cos,
            ..Motion::default()
        };
        if tick >= settle {
            let turn = Complex::new(0.0, -w * t).exp();
            drive += turn * motion.x_m;
            answer += turn * leg.state.y_m;
        }
        let felt = leg.sensor.reading_n();
        let rate = (felt - felt_before) / TICK_S;
        felt_before = felt;
        if setup.compensation == Compensation::Ahead {
            motion.force_n = felt + rate * setup.sensor.delay_s();
            motion.force_rate_n_s = rate;
        }
        leg.tick(&motion.ahead(TICK_S), &mechanism, &mut memory);
    }
    Ok(answer / drive)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::single_dof::transfer::s_of;

    /// The sensor's answer to a sine is the one of its transfer function.
    #[test]
    fn oracle_a_sensor_has_its_response() {
        let sensor = ForceSensor { natural_frequency_hz: 350.0, damping_ratio: 0.7 };
        let step_s = TICK_S / f64::from(PLANT_STEPS);
        for hz in [2.0, 10.0, 100.0, 350.0] {
            let mut s = SensorState::new(&sensor, step_s);
            let mut sum = Complex::<f64>::ZERO;
            for i in 1..=32_000 {
                let t = f64::from(i) * step_s;
                s.run((TAU * hz * t).sin(), step_s);
                if i > 16_000 {
                    sum += Complex::new(0.0, -TAU * hz * t).exp() * s.reading_n() / 8_000.0;
                }
            }
            let measured = sum * Complex::new(0.0, 1.0);
            let off = (measured / sensor.response(s_of(hz)) - 1.0).norm();
            // Straight lines between samples take (ω h)²/12 away.
            assert!(off < 1e-5 + (TAU * hz * step_s).powi(2) / 11.0, "{hz}: {off}");
        }
    }
}
