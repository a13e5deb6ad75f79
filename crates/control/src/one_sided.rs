//! What a loop without compensation must do (§6): the interface `G_I` as measured, brought to a delay
//! and a low-order rational function, and a body that meets a one-sided spring through it.
//!
//! ```text
//! m_r x'' = −F_s      F_s = K [x_p]₊      x_p = G_I x
//! ```
//!
//! This is a solution of its own, beside the loop and the rig: it knows nothing of either but `G_I`.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use docktwin_model::SixAxisSensor;
use nalgebra::{Complex, DMatrix, DVector};

type C = Complex<f64>;

/// A measured point of a frequency response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrequencyPoint {
    /// Frequency, Hz.
    pub hz: f64,
    /// From commanded to achieved; late is a negative phase.
    pub response: C,
}

/// `e^(−sτ) (1 + b₁s + b₂s²) / (1 + a₁s + a₂s²)`: gain 1 at rest, because a rig stands where it is
/// commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interface {
    /// τ, s.
    pub delay_s: f64,
    /// b₁ (s) and b₂ (s²).
    pub numerator: [f64; 2],
    /// a₁ (s) and a₂ (s²); both zero for a pure delay.
    pub denominator: [f64; 2],
}

/// Delays tried between nothing and one and a half times that of a pure delay.
const DELAYS: u32 = 60;
/// What two poles and two zeros must bring the distance down to.
const MUST_GAIN: f64 = 0.8;
/// Rounds of reweighting (Sanathanan and Koerner).
const ROUNDS: u32 = 12;
/// A pole this many times above the highest frequency is not seen by the points.
const UNSEEN: f64 = 30.0;

impl Interface {
    /// A delay and nothing else.
    #[must_use]
    pub const fn delay(delay_s: f64) -> Self {
        Self { delay_s, numerator: [0.0; 2], denominator: [0.0; 2] }
    }

    /// A second-order lag with a delay, such as a force sensor.
    #[must_use]
    pub fn second_order(natural_frequency_hz: f64, damping_ratio: f64, delay_s: f64) -> Self {
        let w = TAU * natural_frequency_hz;
        Self { delay_s, numerator: [0.0; 2], denominator: [2.0 * damping_ratio / w, 1.0 / (w * w)] }
    }

    /// A force sensor as part of the interface.
    #[must_use]
    pub fn of_sensor(sensor: &SixAxisSensor) -> Self {
        Self::second_order(sensor.natural_frequency_hz, sensor.damping_ratio, sensor.delay_s)
    }

    /// Response at `hz`.
    #[must_use]
    pub fn at(&self, hz: f64) -> C {
        let s = C::new(0.0, TAU * hz);
        let poly = |k: &[f64; 2]| C::new(1.0, 0.0) + s * k[0] + s * s * k[1];
        (-s * self.delay_s).exp() * poly(&self.numerator) / poly(&self.denominator)
    }

    /// Lag at rest, s: what a slow ramp is late by.
    #[must_use]
    pub fn lag_s(&self) -> f64 {
        self.delay_s + self.denominator[0] - self.numerator[0]
    }

    /// The stable interface that is nearest to the points, and its largest distance from one. A pure
    /// delay stands where two poles and two zeros bring less than a fifth. `None` without points
    /// above 0 Hz.
    #[must_use]
    pub fn fitted(points: &[FrequencyPoint]) -> Option<(Self, f64)> {
        let top = points.iter().map(|p| p.hz).fold(0.0, f64::max);
        if points.iter().any(|p| !(p.hz > 0.0 && p.response.norm().is_finite())) || top <= 0.0 {
            return None;
        }
        // Phase by least squares through the origin.
        let (mut wp, mut ww) = (0.0, 0.0);
        for p in points {
            let w = TAU * p.hz;
            wp -= w * p.response.arg();
            ww += w * w;
        }
        let pure = Self::delay((wp / ww).max(0.0));
        let mut best = (pure, pure.distance(points));
        let limit = MUST_GAIN * best.1;
        let longest = 1.5 * pure.delay_s;
        for i in 0..=DELAYS {
            let delay_s = longest * f64::from(i) / f64::from(DELAYS);
            let Some(found) = Self::rational(points, delay_s, TAU * top) else { continue };
            let distance = found.distance(points);
            if distance < best.1.min(limit) {
                best = (found, distance);
            }
        }
        Some(best)
    }

    fn distance(&self, points: &[FrequencyPoint]) -> f64 {
        points.iter().map(|p| (self.at(p.hz) - p.response).norm()).fold(0.0, f64::max)
    }

    /// The rational part for a given delay: Levy's linear equations, weighted anew by the last
    /// denominator. `top` makes s a number near one.
    fn rational(points: &[FrequencyPoint], delay_s: f64, top: f64) -> Option<Self> {
        let mut x = [0.0; 4];
        for _ in 0..ROUNDS {
            let n = points.len();
            let mut a = DMatrix::<f64>::zeros(2 * n, 4);
            let mut b = DVector::<f64>::zeros(2 * n);
            for (i, p) in points.iter().enumerate() {
                let w = TAU * p.hz;
                let s = C::new(0.0, w / top);
                let g = p.response * C::new(0.0, w * delay_s).exp();
                let weight = 1.0 / (C::new(1.0, 0.0) + s * x[2] + s * s * x[3]).norm();
                // 1 + b₁s + b₂s² − g (1 + a₁s + a₂s²) = 0
                let row = [s, s * s, -g * s, -g * s * s].map(|c| c * weight);
                let right = (g - C::new(1.0, 0.0)) * weight;
                for (j, c) in row.into_iter().enumerate() {
                    (a[(2 * i, j)], a[(2 * i + 1, j)]) = (c.re, c.im);
                }
                (b[2 * i], b[2 * i + 1]) = (right.re, right.im);
            }
            let found = a.svd(true, true).solve(&b, 1e-9).ok()?;
            x = [found[0], found[1], found[2], found[3]];
        }
        let stable = x[2] > 0.0 && x[3] > UNSEEN.powi(-2);
        stable.then_some(Self {
            delay_s,
            numerator: [x[0] / top, x[1] / (top * top)],
            denominator: [x[2] / top, x[3] / (top * top)],
        })
    }
}

/// One contact without compensation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OneSided {
    /// (19): speed after over speed before.
    pub r_e: f64,
    /// (18): time of contact over that of the simulated system.
    pub r_t: f64,
    /// Largest force over that of the simulated system.
    pub peak_ratio: f64,
}

/// Step of the integration, rad of the contact.
const STEP: f64 = 1e-3;
/// A contact that has not ended by then does not end, rad.
const LONGEST: f64 = 30.0;

/// Body, and the two states of the rational part; time in rad of the contact, speed 1 before it.
#[derive(Clone, Copy, Debug)]
struct State {
    x: f64,
    v: f64,
    w: f64,
    r: f64,
}

impl State {
    fn plus(&self, d: &Self, h: f64) -> Self {
        Self { x: self.x + h * d.x, v: self.v + h * d.v, w: self.w + h * d.w, r: self.r + h * d.r }
    }
}

/// Integrates one contact with natural rate `rate_rad_s`, √(K/m_r), from onset to release: fourth
/// order, the body's way kept for the delay. `None` when the plate does not come free again.
#[must_use]
pub fn one_sided(interface: &Interface, rate_rad_s: f64) -> Option<OneSided> {
    let w = rate_rad_s;
    let theta = interface.delay_s * w;
    let [b1, b2] = [interface.numerator[0] * w, interface.numerator[1] * w * w];
    let [a1, a2] = [interface.denominator[0] * w, interface.denominator[1] * w * w];
    let rational = a2 > 0.0;
    // On the ramp before contact everything is late by the lag at rest; onset is at time 0.
    let start = interface.lag_s() * w;
    let mut past = vec![(start, 1.0)];
    let mut s = State { x: start, v: 1.0, w: -b1, r: 1.0 };
    let late = |past: &[(f64, f64)], time: f64| -> f64 {
        let at = (time - theta) / STEP;
        if at <= 0.0 {
            return start + at * STEP;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "steps")]
        let n = at as usize;
        let last = past.len() - 1;
        if n >= last {
            // Within the step that is being taken: straight on.
            return past[last].0 + past[last].1 * (at - last as f64) * STEP;
        }
        // Cubic through positions and speeds.
        let (u, (x0, v0), (x1, v1)) = (at - n as f64, past[n], past[n + 1]);
        let d = x1 - x0;
        x0 + u
            * (v0 * STEP
                + u * (3.0 * d - (2.0 * v0 + v1) * STEP)
                + u * u * ((v0 + v1) * STEP - 2.0 * d))
    };
    // Deflection of the spring, and all rates.
    let rates = |s: &State, u: f64| -> (f64, State) {
        if rational {
            let acc = (u - s.w - a1 * s.r) / a2;
            let y = s.w + b1 * s.r + b2 * acc;
            (y, State { x: s.v, v: -y, w: s.r, r: acc })
        } else {
            (u, State { x: s.v, v: -u, w: 0.0, r: 0.0 })
        }
    };
    let (mut time, mut before, mut top) = (0.0, 0.0, 0.0_f64);
    while time < LONGEST {
        // Without delay the way is that of the step itself.
        let input = |x: &State, t: f64| if theta > 0.0 { late(&past, t) } else { x.x };
        let (y, k1) = rates(&s, input(&s, time));
        if y < 0.0 && time > 10.0 * STEP {
            // Between the last step and this one.
            let part = before / (before - y);
            let t = time - (1.0 - part) * STEP;
            let last = past[past.len() - 2].1;
            let r_e = -(last + (s.v - last) * part);
            return Some(OneSided { r_e, r_t: t / PI, peak_ratio: top });
        }
        (before, top) = (y, top.max(y));
        let half = s.plus(&k1, 0.5 * STEP);
        let (_, k2) = rates(&half, input(&half, time + 0.5 * STEP));
        let half = s.plus(&k2, 0.5 * STEP);
        let (_, k3) = rates(&half, input(&half, time + 0.5 * STEP));
        let end = s.plus(&k3, STEP);
        let (_, k4) = rates(&end, input(&end, time + STEP));
        s = s.plus(&k1, STEP / 6.0).plus(&k2, STEP / 3.0).plus(&k3, STEP / 3.0);
        s = s.plus(&k4, STEP / 6.0);
        past.push((s.x, s.v));
        time += STEP;
    }
    None
}

/// `R_e ≈ exp(−(π/2) arg G_I)` and `R_T ≈ |G_I|^(−1/2) (1 + ⅜ θ²)`, `G_I` at the natural rate of the
/// contact (§6); good to 1 % for rows 1 to 4 of Table 4.
#[must_use]
pub fn narrow_band(response: C) -> [f64; 2] {
    let theta = response.arg();
    [(-FRAC_PI_2 * theta).exp(), (1.0 + 0.375 * theta * theta) / response.norm().sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// θ, and R_e and R_T of a pure delay by the method of steps.
    const EXACT: [[f64; 3]; 6] = [
        [0.01, 1.01583, 1.00004],
        [0.1, 1.1696, 1.0037],
        [0.3, 1.5841, 1.0311],
        [0.3524, 1.7089, 1.0420],
        [0.5, 2.0943, 1.0790],
        [1.0, 3.7236, 1.2463],
    ];

    #[test]
    fn oracle_pure_delays() {
        for [theta, r_e, r_t] in EXACT {
            let w = 7.0;
            let got = one_sided(&Interface::delay(theta / w), w).expect("it comes free");
            assert!((got.r_e - r_e).abs() < 6e-5, "{theta}: {} for {r_e}", got.r_e);
            assert!((got.r_t - r_t).abs() < 6e-5, "{theta}: {} for {r_t}", got.r_t);
        }
        let none = one_sided(&Interface::delay(0.0), 3.0).expect("it comes free");
        assert!((none.r_e - 1.0).abs() < 1e-6 && (none.r_t - 1.0).abs() < 1e-6);
        assert!((none.peak_ratio - 1.0).abs() < 1e-6);
    }

    /// The lag of the study (12.33 Hz, damping 0.579), its Table 5.1.
    #[test]
    fn oracle_a_second_order_lag() {
        let lag = Interface::second_order(12.33, 0.579, 0.0);
        for (hz, r_e, r_t) in
            [(0.941, 1.150, 1.002), (1.731, 1.296, 1.008), (2.884, 1.546, 1.024), (5.0, 2.11, 1.08)]
        {
            let got = one_sided(&lag, TAU * hz).expect("it comes free");
            assert!((got.r_e / r_e - 1.0).abs() < 3e-3, "{hz}: {} for {r_e}", got.r_e);
            assert!((got.r_t / r_t - 1.0).abs() < 3e-3, "{hz}: {} for {r_t}", got.r_t);
        }
    }

    #[test]
    fn oracle_a_fit_finds_what_made_the_points() {
        let hz = [0.235, 0.471, 0.941, 1.731, 2.308, 2.884, 5.0, 7.0, 10.0];
        let made = [
            Interface::delay(1.8e-3),
            Interface::second_order(12.33, 0.579, 2e-3),
            Interface { delay_s: 1e-3, numerator: [0.02, 4e-4], denominator: [0.024, 4.5e-4] },
        ];
        for g in made {
            let points: Vec<_> =
                hz.iter().map(|hz| FrequencyPoint { hz: *hz, response: g.at(*hz) }).collect();
            let (found, distance) = Interface::fitted(&points).expect("there are points");
            assert!(distance < 2e-4, "{g:?} became {found:?}: {distance}");
            for row in [0.941, 2.884] {
                let [a, b] = [&g, &found].map(|g| one_sided(g, TAU * row).expect("it comes free"));
                assert!((a.r_e - b.r_e).abs() < 2e-3, "{row} Hz: {} for {}", b.r_e, a.r_e);
                assert!((a.r_t - b.r_t).abs() < 2e-3, "{row} Hz: {} for {}", b.r_t, a.r_t);
            }
        }
        assert!(Interface::fitted(&[]).is_none());
    }

    /// The closed forms against the simulation, where they are good to 1 %.
    #[test]
    fn oracle_narrow_band_forms_in_slow_rows() {
        let g = Interface::second_order(12.33, 0.579, 0.0);
        for hz in [0.235, 0.471, 0.941, 1.731] {
            let [r_e, r_t] = narrow_band(g.at(hz));
            let got = one_sided(&g, TAU * hz).expect("it comes free");
            assert!((got.r_e / r_e - 1.0).abs() < 1e-2, "{hz}: {} for {r_e}", got.r_e);
            assert!((got.r_t / r_t - 1.0).abs() < 1e-2, "{hz}: {} for {r_t}", got.r_t);
        }
    }
}
