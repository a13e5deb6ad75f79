//! The six-axis sensors of the rig, force–torque (§5) and accelerometers, and their noise
//! generator.
//!
//! A value is a pair of vectors: force (N) and moment (N·m), or specific force (m/s²) and angular
//! acceleration (rad/s²). From the load to the reading: delay, second-order lag, zero and drift,
//! noise, dead zone, quantisation, saturation, in this order.

use docktwin_core::{DVec3, StateHasher};
use docktwin_model::{DeadZoneLaw, SixAxisSensor};

use crate::hydraulics::{Draws, SecondOrder};

/// Most steps of delay that a sensor keeps: 5 ms at 0.1 ms and some.
const KEPT: usize = 64;

/// Normal draws of mean 0 and deviation 1 (Box–Muller), the same from machine to machine.
#[derive(Clone, Debug)]
pub struct Noise {
    draws: Draws,
    second: Option<f64>,
}

impl Noise {
    /// `stream` keeps one source apart from another of the same seed.
    #[must_use]
    pub fn new(seed: u64, stream: u64) -> Self {
        Self { draws: Draws::new(seed, stream), second: None }
    }

    /// The next.
    pub fn normal(&mut self) -> f64 {
        if let Some(x) = self.second.take() {
            return x;
        }
        // (0, 1] for the logarithm.
        let u = 0.5 * (1.0 - self.draws.uniform());
        let angle = core::f64::consts::PI * self.draws.uniform();
        let r = (-2.0 * u.max(f64::MIN_POSITIVE).ln()).sqrt();
        let (s, c) = angle.sin_cos();
        self.second = Some(r * s);
        r * c
    }
}

/// Along and about three axes.
pub type Pair = [DVec3; 2];

/// Rounds to whole steps of `quantum`; 0 leaves the value.
#[must_use]
pub fn quantised(x: f64, quantum: f64) -> f64 {
    if quantum > 0.0 { (x / quantum).round() * quantum } else { x }
}

/// A sensor as built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorParameters {
    /// What the file says, the delay as drawn.
    pub model: SixAxisSensor,
    /// Zero before taring, along and about each axis.
    pub zero: Pair,
}

impl SensorParameters {
    /// As the file says, with a perfect zero.
    #[must_use]
    pub const fn of_file(model: SixAxisSensor) -> Self {
        Self { model, zero: [DVec3::ZERO; 2] }
    }

    /// Drawn within the file's spread.
    #[must_use]
    pub fn drawn(model: SixAxisSensor, seed: u64, stream: u64) -> Self {
        let mut draws = Draws::new(seed, stream);
        let mut out = Self::of_file(model);
        out.model.delay_s = (model.delay_s + model.delay_spread_s * draws.uniform()).max(0.0);
        let mut zero =
            |half: f64| DVec3::new(draws.uniform(), draws.uniform(), draws.uniform()) * half;
        out.zero = model.zero_spread.map(&mut zero);
        out
    }
}

/// A sensor that runs.
#[derive(Clone, Debug)]
pub struct Sensor {
    parameters: SensorParameters,
    lag: SecondOrder,
    step_s: f64,
    /// What was felt in the last steps; that of step `n` stands at `n % KEPT`.
    past: [Pair; KEPT],
    steps: u64,
    /// Reading before everything that is added, and its rate.
    value: Pair,
    rate: Pair,
    noise: Noise,
}

/// What a sensor says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// In the sensor's axes.
    pub value: Pair,
    /// At the end of the range.
    pub saturated: bool,
}

impl Sensor {
    /// A sensor after a long time at the constant load `value`. Steps of `step_s` seconds; a delay
    /// beyond 60 of them is cut there.
    #[must_use]
    pub fn new(parameters: SensorParameters, step_s: f64, noise: Noise, value: Pair) -> Self {
        let m = &parameters.model;
        Self {
            lag: SecondOrder::new(m.natural_frequency_hz, m.damping_ratio, step_s),
            parameters,
            step_s,
            past: [value; KEPT],
            steps: KEPT as u64,
            value,
            rate: [DVec3::ZERO; 2],
            noise,
        }
    }

    /// One step under `felt`, the mean over it.
    pub fn step(&mut self, felt: Pair) {
        self.past[(self.steps % KEPT as u64) as usize] = felt;
        self.steps += 1;
        // Between two kept steps it goes on straight.
        // A delay that was calibrated may come out a microsecond below none.
        let back = (self.parameters.model.delay_s / self.step_s).clamp(0.0, (KEPT - 4) as f64);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 60")]
        let whole = back as u64;
        let part = back - back.floor();
        let at = |n: u64| self.past[((self.steps - 1 - n) % KEPT as u64) as usize];
        let (late, later) = (at(whole), at(whole + 1));
        for i in 0..2 {
            let input = late[i] * (1.0 - part) + later[i] * part;
            (self.value[i], self.rate[i]) = self.lag.step(self.value[i], self.rate[i], input);
        }
    }

    /// A sample now, `time_s` after the amplifier's reset.
    pub fn read(&mut self, time_s: f64) -> Reading {
        let p = self.parameters;
        let mut saturated = false;
        let mut part = |v: DVec3, zero: DVec3, i: usize| {
            let m = &p.model;
            let each = |x: f64, zero: f64, noise: f64| {
                let x = x + zero + m.drift_per_s[i] * time_s + m.noise[i] * noise;
                let x = match m.dead_zone_law {
                    DeadZoneLaw::Zeroing if x.abs() < m.dead_zone[i] => 0.0,
                    DeadZoneLaw::Zeroing => x,
                    DeadZoneLaw::Subtractive => x - x.clamp(-m.dead_zone[i], m.dead_zone[i]),
                };
                quantised(x, m.quantum[i]).clamp(-m.range[i], m.range[i])
            };
            let noise = [self.noise.normal(), self.noise.normal(), self.noise.normal()];
            let out = DVec3::new(
                each(v.x, zero.x, noise[0]),
                each(v.y, zero.y, noise[1]),
                each(v.z, zero.z, noise[2]),
            );
            saturated |= out.abs().max_element() >= p.model.range[i];
            out
        };
        let value = [part(self.value[0], p.zero[0], 0), part(self.value[1], p.zero[1], 1)];
        Reading { value, saturated }
    }

    /// Adds all bits to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        self.value.iter().chain(&self.rate).for_each(|v| h.vec3(*v));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORCE: SixAxisSensor = SixAxisSensor {
        natural_frequency_hz: 350.0,
        damping_ratio: 0.7,
        noise: [0.0; 2],
        drift_per_s: [0.0; 2],
        dead_zone: [0.0; 2],
        dead_zone_law: DeadZoneLaw::Zeroing,
        quantum: [0.0; 2],
        range: [1e4, 1e3],
        delay_s: 0.0,
        delay_spread_s: 0.0,
        zero_spread: [0.0; 2],
    };
    const H: f64 = 1.25e-4;

    fn sensor(model: SixAxisSensor) -> Sensor {
        Sensor::new(SensorParameters::of_file(model), H, Noise::new(1, 1), [DVec3::ZERO; 2])
    }

    fn force(x: f64) -> Pair {
        [DVec3::X * x, DVec3::ZERO]
    }

    /// A sine comes out with the gain and the lag of the second order, and later by the delay.
    #[test]
    fn oracle_a_sine_comes_out_as_of_a_second_order() {
        for (hz, delay_s) in [(5.0, 0.0), (50.0, 0.0), (50.0, 3.3e-4)] {
            let mut s = sensor(SixAxisSensor { delay_s, ..FORCE });
            let w = core::f64::consts::TAU * hz;
            let n = 8000;
            let (mut re, mut im) = (0.0, 0.0);
            for i in 0..2 * n {
                let end = f64::from(i + 1) * H;
                s.step(force((w * (end - 0.5 * H)).sin()));
                if i >= n {
                    let y = s.read(0.0).value[0].x;
                    re += y * (w * end).sin() * 2.0 / f64::from(n);
                    im += y * (w * end).cos() * 2.0 / f64::from(n);
                }
            }
            let x = hz / 350.0;
            let want = -f64::atan2(2.0 * 0.7 * x, 1.0 - x * x) - w * delay_s;
            let gain = 1.0 / ((1.0 - x * x).powi(2) + (1.4 * x).powi(2)).sqrt();
            assert!((f64::hypot(re, im) - gain).abs() < 2e-3, "{hz}: gain");
            assert!((im.atan2(re) - want).abs() < w * 2e-6 + 1e-4, "{hz}: {}", im.atan2(re) - want);
        }
    }

    /// A delay calibrated as a microsecond below none is none; it was a whole step.
    #[test]
    fn regress_a_delay_below_none_is_none() {
        let [mut none, mut below] =
            [0.0, -1e-6].map(|delay_s| sensor(SixAxisSensor { delay_s, ..FORCE }));
        for i in 0..50 {
            let felt = force(f64::from(i));
            none.step(felt);
            below.step(felt);
        }
        assert_eq!(none.read(0.0), below.read(0.0));
    }

    #[test]
    fn oracle_dead_zone_step_and_range() {
        let settled = |model: SixAxisSensor, x: f64| {
            let mut s = sensor(model);
            (0..400).for_each(|_| s.step(force(x)));
            s.read(0.0)
        };
        let zeroing = SixAxisSensor { dead_zone: [8.0, 1.0], quantum: [0.1, 0.1], ..FORCE };
        assert!(settled(zeroing, 7.9).value[0].x.abs() < 1e-12);
        assert!((settled(zeroing, 8.12).value[0].x - 8.1).abs() < 1e-9);
        let subtractive = SixAxisSensor { dead_zone_law: DeadZoneLaw::Subtractive, ..zeroing };
        assert!((settled(subtractive, -20.0).value[0].x + 12.0).abs() < 1e-9);
        let over = settled(FORCE, 2e4);
        assert!(over.saturated && (over.value[0].x - 1e4).abs() < 1e-9);
        assert!(!settled(FORCE, 9e3).saturated);
    }

    #[test]
    fn oracle_noise_has_its_deviation() {
        let mut s = sensor(SixAxisSensor { noise: [0.3, 0.1], ..FORCE });
        let n = 20_000;
        let x: Vec<f64> = (0..n).map(|_| s.read(0.0).value[0].x).collect();
        let mean = x.iter().sum::<f64>() / f64::from(n);
        let square = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / f64::from(n);
        assert!(mean.abs() < 0.01 && (square.sqrt() - 0.3).abs() < 0.01);
    }
}
