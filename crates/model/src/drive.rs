//! What moves the legs of a rig: oil, a position loop that is known by its parameters, or one that is known by its
//! measured response.

use core::f64::consts::TAU;

use docktwin_core::PERIOD_NS;
use nalgebra::Complex;
use serde::{Deserialize, Serialize};

/// What `drive.kind` says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DriveWord {
    Hydraulic,
    PositionLoop,
    Measured,
}

/// Words by which files name the kinds.
pub(crate) const DRIVES: [(&str, DriveWord); 3] = [
    ("hydraulic", DriveWord::Hydraulic),
    ("position_loop", DriveWord::PositionLoop),
    ("measured", DriveWord::Measured),
];

/// What moves the legs, all six alike.
#[derive(Clone, Debug, PartialEq)]
pub enum Drive {
    /// Oil, valves and seals, with a controller of docktwin's around each leg.
    Hydraulic(HydraulicDrive),
    /// A drive with a position loop of its own: electric cylinders.
    PositionLoop(PositionLoop),
    /// A drive of which the response was measured.
    Measured(MeasuredDrive),
}

impl Drive {
    /// Oil, valves and seals, where there are any.
    #[must_use]
    pub const fn hydraulic(&self) -> Option<&HydraulicDrive> {
        match self {
            Self::Hydraulic(h) => Some(h),
            Self::PositionLoop(_) | Self::Measured(_) => None,
        }
    }

    /// The same, to be changed.
    pub const fn hydraulic_mut(&mut self) -> Option<&mut HydraulicDrive> {
        match self {
            Self::Hydraulic(h) => Some(h),
            Self::PositionLoop(_) | Self::Measured(_) => None,
        }
    }

    /// The position loop of a leg that has one: the one described, or the one fitted to what was measured.
    #[must_use]
    pub const fn position_loop(&self) -> Option<&PositionLoop> {
        match self {
            Self::Hydraulic(_) => None,
            Self::PositionLoop(l) => Some(l),
            Self::Measured(m) => Some(&m.fitted),
        }
    }

    /// From a command to what answers it, the valve or the position loop, s.
    #[must_use]
    pub const fn dead_time_s(&self) -> f64 {
        match self {
            Self::Hydraulic(h) => h.valve.dead_time_s,
            Self::PositionLoop(l) => l.delay_s,
            Self::Measured(m) => m.fitted.delay_s,
        }
    }

    /// Sets [`Self::dead_time_s`].
    pub const fn set_dead_time_s(&mut self, dead_time_s: f64) {
        match self {
            Self::Hydraulic(h) => h.valve.dead_time_s = dead_time_s,
            Self::PositionLoop(l) => l.delay_s = dead_time_s,
            Self::Measured(m) => m.fitted.delay_s = dead_time_s,
        }
    }

    /// From a command to the motion of the leg when it moves slowly, s. A hydraulic leg is fed forward, and has
    /// its dead time alone.
    #[must_use]
    pub fn lag_s(&self) -> f64 {
        self.dead_time_s() + self.position_loop().map_or(0.0, PositionLoop::loop_lag_s)
    }
}

/// A drive with oil: cylinder, valve and seals of every leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HydraulicDrive {
    /// Oil and cylinder.
    pub hydraulics: Hydraulics,
    /// Servo valve.
    pub valve: ServoValve,
    /// Friction of a leg's seals.
    pub friction: SealFriction,
}

impl HydraulicDrive {
    /// The oil of a leg with the volumes of a preset.
    #[must_use]
    pub const fn leg(&self, preset: HydraulicPreset) -> LegHydraulics {
        let h = &self.hydraulics;
        let v = match preset {
            HydraulicPreset::Printed => h.printed,
            HydraulicPreset::Consistent => h.consistent,
            HydraulicPreset::Stiff => h.stiff,
        };
        LegHydraulics {
            area_m2: h.area_m2,
            total_volume_m3: v.total_volume_m3,
            bulk_modulus_pa: h.bulk_modulus_pa,
            leakage_m3_s_pa: v.leakage_m3_s_pa,
            viscous_n_s_m: h.viscous_n_s_m,
        }
    }
}

/// The closed position loop of a leg: its length follows the commanded one, whatever the load, up to the limits of
/// speed and force of every leg ([`crate::LegLimits`]) and of acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionLoop {
    /// Natural frequency, Hz; of a loop of first order its corner.
    pub natural_frequency_hz: f64,
    /// Damping ratio of a loop of second order; `None` for one of first order.
    pub damping_ratio: Option<f64>,
    /// From a command to the loop, s: bus, computing, interpolation.
    pub delay_s: f64,
    /// Largest acceleration of a leg, m/s²; `None` without a limit.
    pub acceleration_m_s2: Option<f64>,
}

impl PositionLoop {
    /// 1 or 2.
    #[must_use]
    pub const fn order(&self) -> u32 {
        if self.damping_ratio.is_some() { 2 } else { 1 }
    }

    /// Lag of the loop on a slow move, its delay apart, s: 2ζ/ω, or 1/ω of a first order.
    #[must_use]
    pub fn loop_lag_s(&self) -> f64 {
        self.damping_ratio.map_or(1.0, |z| 2.0 * z) / (TAU * self.natural_frequency_hz)
    }

    /// Coefficients of s and s² of the inverse of the loop's transfer function, its delay apart, s and s²: 2ζ/ω and
    /// 1/ω², or 1/ω and 0 of a first order.
    #[must_use]
    pub fn inverse(&self) -> [f64; 2] {
        let w = TAU * self.natural_frequency_hz;
        [self.loop_lag_s(), self.damping_ratio.map_or(0.0, |_| 1.0 / (w * w))]
    }

    /// From the commanded to the actual length at a frequency, the delay included.
    #[must_use]
    pub fn response(&self, hz: f64) -> Complex<f64> {
        let x = hz / self.natural_frequency_hz;
        let pole = match self.damping_ratio {
            Some(z) => Complex::new(1.0 - x * x, 2.0 * z * x),
            None => Complex::new(1.0, x),
        };
        Complex::new(0.0, -TAU * hz * self.delay_s).exp() / pole
    }

    /// The loop in words.
    #[must_use]
    pub fn words(&self) -> String {
        let damping =
            self.damping_ratio.map_or_else(String::new, |z| format!(" and damping ratio {z:.4}"));
        format!(
            "order {}, {:.4} Hz{damping}, {:.3} ms of delay: {:.3} ms behind a slow move",
            self.order(),
            self.natural_frequency_hz,
            self.delay_s * 1e3,
            (self.delay_s + self.loop_lag_s()) * 1e3
        )
    }
}

/// A drive known by what `rig identify` measured of it, and the position loop that was fitted to that.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredDrive {
    /// From the instant a command is for to the plate on slow moves, s.
    pub lag_s: f64,
    /// The response as measured, at least two points.
    pub response: Vec<MeasuredPoint>,
    /// What an emulated rig does in its place.
    pub fitted: PositionLoop,
    /// How far the fitted response is from the measured one at most, over the measured one.
    pub residual: f64,
}

/// A measured point of a response: from the motion commanded for an instant to the motion at that instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredPoint {
    /// Frequency, Hz.
    pub hz: f64,
    /// Gain and phase.
    pub gain: Complex<f64>,
}

/// A command is for the instant one tick after it is sent.
const TICK_S: f64 = PERIOD_NS as f64 * 1e-9;
/// At which frequency a wrong lag counts as much as a wrong point of the response, Hz.
const LAG_COUNTS_AT_HZ: f64 = 1.0;
/// Longest delay of a fitted loop, s, and steps of the search for it.
const LONGEST_DELAY_S: f64 = 0.05;
const DELAY_STEPS: u32 = 500;
/// Rounds of weighting with the denominator of the round before (Sanathanan and Koerner 1963).
const WEIGHTINGS: u32 = 6;
/// Shortest time constant that is told from none, s.
const SHORTEST_S: f64 = 1e-5;

impl MeasuredDrive {
    /// Lag of the fitted loop on slow moves, as `lag_s` counts, s.
    #[must_use]
    pub fn fitted_lag_s(&self) -> f64 {
        self.fitted.delay_s + self.fitted.loop_lag_s() - TICK_S
    }

    /// The loop of second order with a delay (of first order, where that has no stable second one) that is
    /// nearest to a measured response, static gain 1: linear least squares for every delay, and the best
    /// delay. `None` where nothing stable comes near.
    #[must_use]
    pub fn fit(
        lag_s: f64,
        response: Vec<MeasuredPoint>,
        acceleration_m_s2: Option<f64>,
    ) -> Option<Self> {
        let step_s = LONGEST_DELAY_S / f64::from(DELAY_STEPS);
        let score = |delay_s: f64| {
            let fitted = fit_at(delay_s, lag_s, &response)?;
            Some((sum_of_squares(&fitted, lag_s, &response), fitted))
        };
        let coarse = (0..=DELAY_STEPS).filter_map(|i| score(f64::from(i) * step_s));
        let mut best = coarse.min_by(|a, b| a.0.total_cmp(&b.0))?;
        // Finer around the best until nanoseconds.
        let mut width_s = step_s;
        while width_s > 1e-9 {
            width_s *= 0.5;
            for side in [-width_s, width_s] {
                let delay_s = (best.1.delay_s + side).clamp(0.0, LONGEST_DELAY_S);
                if let Some(found) = score(delay_s).filter(|f| f.0 < best.0) {
                    best = found;
                }
            }
        }
        let fitted = PositionLoop { acceleration_m_s2, ..best.1 };
        let residual = response
            .iter()
            .map(|p| (as_measured(&fitted, p.hz) - p.gain).norm() / p.gain.norm())
            .fold(0.0, f64::max);
        Some(Self { lag_s, response, fitted, residual })
    }
}

/// The response as `rig identify` measures it: against the instant that a command is for.
fn as_measured(l: &PositionLoop, hz: f64) -> Complex<f64> {
    l.response(hz) * Complex::new(0.0, TAU * hz * TICK_S).exp()
}

fn sum_of_squares(l: &PositionLoop, lag_s: f64, response: &[MeasuredPoint]) -> f64 {
    let lag = l.delay_s + l.loop_lag_s() - TICK_S - lag_s;
    let points = response.iter().map(|p| (as_measured(l, p.hz) - p.gain).norm_sqr());
    points.sum::<f64>() + (TAU * LAG_COUNTS_AT_HZ * lag).powi(2)
}

/// The loop with this delay: `G e^{s(T − tick)} (1 + a₁ s + a₂ s²) = 1` in the least-squares sense.
fn fit_at(delay_s: f64, lag_s: f64, response: &[MeasuredPoint]) -> Option<PositionLoop> {
    let of_loop = |a: [f64; 2]| {
        let second = a[0] > SHORTEST_S && a[1] > SHORTEST_S * SHORTEST_S;
        let (hz, damping_ratio) = if second {
            let w = 1.0 / a[1].sqrt();
            (w / TAU, Some(0.5 * a[0] * w))
        } else {
            (1.0 / (TAU * a[0].max(SHORTEST_S)), None)
        };
        PositionLoop { natural_frequency_hz: hz, damping_ratio, delay_s, acceleration_m_s2: None }
    };
    let lag_weight = TAU * LAG_COUNTS_AT_HZ;
    let solve = |orders: usize| {
        let mut a = [0.0; 2];
        for _ in 0..WEIGHTINGS {
            // Normal equations of the real and imaginary parts, and of the lag.
            let (mut m, mut b) = ([[0.0; 2]; 2], [0.0; 2]);
            let mut add = |row: [f64; 2], right: f64| {
                for i in 0..2 {
                    b[i] += row[i] * right;
                    for j in 0..2 {
                        m[i][j] += row[i] * row[j];
                    }
                }
            };
            for p in response {
                let s = Complex::new(0.0, TAU * p.hz);
                let g = p.gain * (s * (delay_s - TICK_S)).exp();
                let weight = 1.0 / (1.0 + s * a[0] + s * s * a[1]).norm();
                let (c1, c2, right) = (g * s * weight, g * s * s * weight, (1.0 - g) * weight);
                add([c1.re, c2.re], right.re);
                add([c1.im, c2.im], right.im);
            }
            add([lag_weight, 0.0], lag_weight * (lag_s + TICK_S - delay_s));
            if orders == 1 {
                a = [b[0] / m[0][0], 0.0];
            } else {
                let det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
                a = [
                    (b[0] * m[1][1] - b[1] * m[0][1]) / det,
                    (m[0][0] * b[1] - m[1][0] * b[0]) / det,
                ];
            }
        }
        a
    };
    let second = solve(2);
    let stable = second[0] > SHORTEST_S && second[1] > SHORTEST_S * SHORTEST_S;
    let fitted = of_loop(if stable { second } else { solve(1) });
    fitted.natural_frequency_hz.is_finite().then_some(fitted)
}

/// Cylinder and oil, (10) and Table 1, with three choices of volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hydraulics {
    /// Effective piston area A, m², both sides alike.
    pub area_m2: f64,
    /// Bulk modulus β_e of the oil, Pa.
    pub bulk_modulus_pa: f64,
    /// Viscous friction B_c, N·s/m.
    pub viscous_n_s_m: f64,
    /// Oil that no piston position expels, both chambers and lines to the valve together, m³.
    pub dead_volume_m3: f64,
    /// Table 1 as printed.
    pub printed: OilVolume,
    /// The volume that fits the stroke.
    pub consistent: OilVolume,
    /// A tenth of the printed volume, with a bypass leak.
    pub stiff: OilVolume,
    /// The preset that is meant when none is named.
    pub default_preset: HydraulicPreset,
}

/// What a preset of the hydraulics changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OilVolume {
    /// Total volume V_t, m³, as (10) uses it: `K_h = 4 β_e A² / V_t`.
    pub total_volume_m3: f64,
    /// Total flow–pressure coefficient K_ce, m³/(s·Pa).
    pub leakage_m3_s_pa: f64,
}

/// Names of the three choices of volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HydraulicPreset {
    /// Table 1 as printed.
    Printed,
    /// The volume that fits the stroke.
    Consistent,
    /// A tenth of the printed volume, with a bypass leak.
    Stiff,
}

impl HydraulicPreset {
    /// Words by which files and commands name the presets.
    pub const WORDS: [(&'static str, Self); 3] =
        [("printed", Self::Printed), ("consistent", Self::Consistent), ("stiff", Self::Stiff)];

    /// The word of this preset.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Printed => "printed",
            Self::Consistent => "consistent",
            Self::Stiff => "stiff",
        }
    }
}

/// Oil and cylinder of one leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegHydraulics {
    /// Effective piston area A, m².
    pub area_m2: f64,
    /// Total volume V_t, m³.
    pub total_volume_m3: f64,
    /// Bulk modulus β_e, Pa.
    pub bulk_modulus_pa: f64,
    /// Total flow–pressure coefficient K_ce, m³/(s·Pa).
    pub leakage_m3_s_pa: f64,
    /// Viscous friction B_c, N·s/m.
    pub viscous_n_s_m: f64,
}

impl LegHydraulics {
    /// Oil spring `K_h = 4 β_e A² / V_t`, N/m.
    #[must_use]
    pub fn oil_spring_n_m(&self) -> f64 {
        4.0 * self.bulk_modulus_pa * self.area_m2 * self.area_m2 / self.total_volume_m3
    }

    /// Hydraulic natural frequency with a mass on one leg, Hz.
    #[must_use]
    pub fn natural_frequency_hz(&self, mass_kg: f64) -> f64 {
        (self.oil_spring_n_m() / mass_kg).sqrt() / TAU
    }
}

/// Servo valve and supply of one leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoValve {
    /// Natural frequency of the spool, Hz.
    pub natural_frequency_hz: f64,
    /// Damping ratio of the spool.
    pub damping_ratio: f64,
    /// No-load flow at full spool, m³/s.
    pub no_load_flow_m3_s: f64,
    /// Fastest spool motion, full strokes per second.
    pub slew_per_s: f64,
    /// Spool position at zero command, as a part of full stroke.
    pub null_bias: f64,
    /// Supply over return pressure, Pa.
    pub supply_pressure_pa: f64,
    /// From a command to the valve, s.
    pub dead_time_s: f64,
}

/// Bristle friction of a leg's seals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SealFriction {
    /// Coulomb friction, N.
    pub coulomb_n: f64,
    /// Static friction, N.
    pub static_n: f64,
    /// Stribeck velocity, m/s.
    pub stribeck_velocity_m_s: f64,
    /// Bristle stiffness, N/m.
    pub bristle_n_m: f64,
    /// Bristle damping, N·s/m.
    pub bristle_damping_n_s_m: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRUTH: PositionLoop = PositionLoop {
        natural_frequency_hz: 12.0,
        damping_ratio: Some(0.7),
        delay_s: 0.004,
        acceleration_m_s2: None,
    };

    fn measured(of: &PositionLoop) -> Vec<MeasuredPoint> {
        let hz = [0.235, 0.471, 0.941, 1.731, 2.308, 2.884, 5.0, 7.0, 10.0];
        hz.map(|hz| MeasuredPoint { hz, gain: as_measured(of, hz) }).into()
    }

    #[test]
    fn oracle_a_loop_is_found_in_its_own_response() {
        for truth in [
            TRUTH,
            PositionLoop { damping_ratio: None, natural_frequency_hz: 4.0, ..TRUTH },
            PositionLoop { damping_ratio: Some(1.6), delay_s: 0.0, ..TRUTH },
            PositionLoop { natural_frequency_hz: 80.0, delay_s: 0.0113, ..TRUTH },
        ] {
            let lag_s = truth.delay_s + truth.loop_lag_s() - TICK_S;
            let found = MeasuredDrive::fit(lag_s, measured(&truth), None).expect("stable");
            let (is, got) = (&truth, &found.fitted);
            assert!(found.residual < 1e-5, "{truth:?}: {}", found.residual);
            assert!((got.delay_s - is.delay_s).abs() < 2e-6, "{truth:?}: {got:?}");
            assert!((got.loop_lag_s() - is.loop_lag_s()).abs() < 2e-6, "{truth:?}: {got:?}");
        }
    }

    #[test]
    fn invariant_what_no_loop_does_leaves_a_residual() {
        // A resonance and its notch within the band.
        let notched = measured(&TRUTH).into_iter().map(|p| {
            let x = p.hz / 5.0;
            let pair = |z: f64| Complex::new(1.0 - x * x, 2.0 * z * x);
            MeasuredPoint { gain: p.gain * pair(0.05) / pair(0.5), ..p }
        });
        let found = MeasuredDrive::fit(0.0216, notched.collect(), None).expect("stable");
        assert!(found.residual > 0.1, "{}", found.residual);
    }

    #[test]
    fn oracle_the_response_is_that_of_the_equation() {
        // At its natural frequency a second order has the gain 1/2ζ and a quarter of a period of lag.
        let g = TRUTH.response(12.0);
        assert!((g.norm() - 1.0 / 1.4).abs() < 1e-12);
        let turn = -0.25 - 12.0 * 0.004;
        assert!((g.arg() - TAU * turn).abs() < 1e-12, "{}", g.arg());
        let first = PositionLoop { damping_ratio: None, delay_s: 0.0, ..TRUTH };
        assert!((first.response(12.0) - Complex::new(0.5, -0.5)).norm() < 1e-12);
    }
}
