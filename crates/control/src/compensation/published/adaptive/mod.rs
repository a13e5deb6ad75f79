//! Inverses of the drives whose coefficients are identified while the rig moves:
//!
//! ```text
//! command = x₀ + (a₀ + c₁ s + c₂ s²)(x − x₀)      c = coefficients of e^(τ_F s) (a₀ + a₁ s + a₂ s²)
//! ```
//!
//! x₀ is where the first command was, τ_F the lag of the sensor. a is found from what was commanded, u, and where the
//! plate was measured, y, `u = a₀ y + a₁ y' + a₂ y''`; what finds it is the method ([`laws`], [`unscented`]). All begin with
//! what is believed of the rig, stay within the bounds that are shipped with OpenFresco's examples (a₁ ≤ 60 ms), and learn from
//! the run-up on, from measurements of the tick alone, what stays between both at rest before taken off. In free flight a₁ is
//! seen and a₂ is not.

mod laws;
mod smooth;
mod unscented;

use docktwin_core::{DVec3, Pose, StateHasher, Twist};
use docktwin_physics::{mounted::Ports, platform::Platform, programme::RelativeMotion};
use nalgebra::Vector6;

use self::{
    laws::{Gradient, Recursive, Series},
    smooth::Smooth,
    unscented::Unscented,
};
use crate::{
    compensation::{
        Believed, Compensator, Demand, LoopContext, Phase, delays::Delays, history::History,
    },
    excitation::displacement,
};

/// How the coefficients are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Learning {
    /// Least squares over the last second (Chae, Kazemibidokhti and Ricles, Earthquake Eng. Struct. Dyn. 42, 2013, "Adaptive
    /// time series compensator").
    TimeSeries,
    /// Along the gradient of the error (Fermandois and others, adaptive model-based compensation).
    Gradient,
    /// Recursive least squares for every leg (decentralized compensation of several axes; Fermandois and others).
    RecursiveLegs,
    /// Unscented Kalman filter of plate and drive (Frontiers Built Env. 2024, 10.3389/fbuil.2024.1477804).
    Unscented,
}

impl Learning {
    /// Name of its method as on the command line.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::TimeSeries => "ats",
            Self::Gradient => "amb",
            Self::RecursiveLegs => "rls-inverse",
            Self::Unscented => "ukf-inverse",
        }
    }
}

/// a₀, a₁ in s, a₂ in s².
type Coefficients = [f64; 3];

/// Bounds of the coefficients.
const BOUNDS: [[f64; 2]; 3] = [[0.9, 1.1], [0.0, 0.06], [0.0, 3.2e-3]];

fn bounded(a: Coefficients) -> Coefficients {
    core::array::from_fn(|i| a[i].clamp(BOUNDS[i][0], BOUNDS[i][1]))
}

/// What finds the coefficients of one coordinate.
#[derive(Clone, Debug)]
enum Law {
    Series(Smooth, Box<Series>),
    Gradient(Smooth, Gradient),
    Recursive(Smooth, Recursive),
    Unscented(Box<Unscented>),
}

impl Law {
    fn new(learning: Learning, believed: Coefficients) -> Self {
        match learning {
            Learning::TimeSeries => Self::Series(Smooth::new(), Box::new(Series::new(believed))),
            Learning::Gradient => Self::Gradient(Smooth::new(), Gradient::new(believed)),
            Learning::RecursiveLegs => Self::Recursive(Smooth::new(), Recursive::new(believed)),
            Learning::Unscented => Self::Unscented(Box::new(Unscented::new(believed))),
        }
    }

    /// As new, in its own memory.
    fn reset(&mut self, believed: Coefficients) {
        match self {
            Self::Series(smooth, law) => {
                (*smooth, **law) = (Smooth::new(), Series::new(believed));
            }
            Self::Gradient(smooth, law) => {
                (*smooth, *law) = (Smooth::new(), Gradient::new(believed));
            }
            Self::Recursive(smooth, law) => {
                (*smooth, *law) = (Smooth::new(), Recursive::new(believed));
            }
            Self::Unscented(law) => **law = Unscented::new(believed),
        }
    }

    /// Takes in that `y` was measured where `u` was commanded, `period_s` after the tick before.
    fn see(&mut self, u: f64, y: f64, period_s: f64) {
        match self {
            Self::Series(smooth, law) => law.see(&smooth.of(u, y, period_s), period_s),
            Self::Gradient(smooth, law) => law.see(&smooth.of(u, y, period_s), period_s),
            Self::Recursive(smooth, law) => law.see(&smooth.of(u, y, period_s), period_s),
            Self::Unscented(law) => law.see(u, y, period_s),
        }
    }

    fn hash_into(&self, h: &mut StateHasher) {
        match self {
            Self::Series(smooth, law) => {
                smooth.hash_into(h);
                law.hash_into(h);
            }
            Self::Gradient(smooth, law) => {
                smooth.hash_into(h);
                law.hash_into(h);
            }
            Self::Recursive(smooth, law) => {
                smooth.hash_into(h);
                law.hash_into(h);
            }
            Self::Unscented(law) => law.hash_into(h),
        }
    }

    fn coefficients(&self) -> Coefficients {
        bounded(match self {
            Self::Series(_, law) => law.coefficients(),
            Self::Gradient(_, law) => law.coefficients(),
            Self::Recursive(_, law) => law.coefficients(),
            Self::Unscented(law) => law.coefficients(),
        })
    }
}

/// See the module's page.
#[derive(Clone, Debug)]
pub struct Adaptive {
    learning: Learning,
    delays: Delays,
    platform: Platform,
    /// Where displacements are counted from, `X_34`.
    place: Option<Pose>,
    /// What was commanded, `X_34`, for the last ticks.
    commanded: History<Pose, KEPT>,
    tick: Option<u64>,
    /// Tick of the last measurement.
    learned: Option<u64>,
    /// What stays between command and measurement at rest.
    standing: [f64; 6],
    laws: [Law; 6],
}

/// Time over which that is averaged, s.
const STANDING_S: f64 = 0.1;

/// Commands that are kept: measurements are a few ticks old at most.
const KEPT: usize = 64;

impl Adaptive {
    pub(super) fn new(learning: Learning, believed: &Believed<'_>, delays: Delays) -> Self {
        let [a1, a2] = delays.of_plate();
        let laws = core::array::from_fn(|_| Law::new(learning, [1.0, a1, a2]));
        Self {
            learning,
            delays,
            platform: Platform::new(believed.rig),
            place: None,
            commanded: History::new(Pose::IDENTITY),
            tick: None,
            learned: None,
            standing: [0.0; 6],
            laws,
        }
    }

    const fn by_legs(&self) -> bool {
        matches!(self.learning, Learning::RecursiveLegs)
    }

    /// Coordinates of the mechanisms at `x_34`: displacement of `e4` from the place, or of the legs' lengths.
    fn coordinates(&self, place: &Pose, x_34: &Pose) -> [f64; 6] {
        if self.by_legs() {
            let lengths =
                |x: &Pose| self.platform.at(&self.platform.plate_from_docking(x)).length_m;
            let (now, then) = (lengths(x_34), lengths(place));
            core::array::from_fn(|i| now[i] - then[i])
        } else {
            displacement(place, x_34)
        }
    }

    fn learn(&mut self, seen: &LoopContext<'_>) {
        let Some(place) = self.place else { return };
        if !seen.measured.fresh || matches!(seen.phase, Phase::Move | Phase::Stop) {
            return;
        }
        let since = seen.tick.saturating_sub(self.learned.replace(seen.tick).unwrap_or(seen.tick));
        #[expect(clippy::cast_precision_loss, reason = "a few ticks")]
        let period_s = since.max(1) as f64 * seen.period_s;
        // What was commanded for the instant of the measurement: here, not what is on its way to the rig, which may have been
        // held back.
        let (new, old, part) = self.commanded.ago(seen.measured.age_s / seen.period_s);
        let commanded = Pose::new(new.p + (old.p - new.p) * part, new.q.slerp(old.q, part));
        let u = self.coordinates(&place, &commanded);
        let y = self.coordinates(&place, &seen.measured.x_34);
        for (i, law) in self.laws.iter_mut().enumerate() {
            if seen.phase == Phase::Settle {
                // What stays between both at rest is no lag.
                self.standing[i] +=
                    (u[i] - y[i] - self.standing[i]) * (period_s / STANDING_S).min(1.0);
            } else {
                law.see(u[i], y[i] + self.standing[i], period_s);
            }
        }
    }

    /// a₀, c₁ and c₂ of every coordinate.
    fn series(&self) -> [[f64; 6]; 3] {
        let s = self.delays.sensor_s;
        let mut out = [[0.0; 6]; 3];
        for (i, law) in self.laws.iter().enumerate() {
            let [a0, a1, a2] = law.coefficients();
            out[0][i] = a0;
            out[1][i] = a1 + a0 * s;
            out[2][i] = a2 + a1 * s + a0 * s * s / 2.0;
        }
        out
    }

    fn by_axes(&self, place: &Pose, next: &RelativeMotion) -> RelativeMotion {
        let c = self.series();
        let x = displacement(place, &next.x_34);
        let [v, a, j] = [next.twist, next.acceleration, next.jerk].map(components);
        let way: [f64; 6] =
            core::array::from_fn(|i| (c[0][i] - 1.0) * x[i] + c[1][i] * v[i] + c[2][i] * a[i]);
        RelativeMotion {
            x_34: Platform::moved(&next.x_34, &twist(way), 1.0),
            twist: twist(core::array::from_fn(|i| {
                c[0][i] * v[i] + c[1][i] * a[i] + c[2][i] * j[i]
            })),
            acceleration: twist(core::array::from_fn(|i| c[0][i] * a[i] + c[1][i] * j[i])),
            jerk: next.jerk,
        }
    }

    /// The legs' ways made one of the plate by their Jacobian: a few millimetres, of which the second order is
    /// micrometres.
    fn by_lengths(&self, place: &Pose, next: &RelativeMotion) -> RelativeMotion {
        let c = self.series();
        let p = &self.platform;
        let x_bp = p.plate_from_docking(&next.x_34);
        let at = p.at(&x_bp);
        let (v, a) = (
            p.plate_twist(&next.x_34, &next.twist),
            p.plate_acceleration(&next.x_34, &next.twist, &next.acceleration),
        );
        let j = p.plate_acceleration(&next.x_34, &Twist::default(), &next.jerk);
        let x = self.coordinates(place, &next.x_34);
        let (lv, la, lj) = (at.rates(&v), at.accelerations(&v, &a), at.rates(&j));
        let Some(back) = at.jacobian().try_inverse() else { return *next };
        let of_plate = |legs: [f64; 6]| twist((back * Vector6::from(legs)).into());
        let way =
            core::array::from_fn(|i| (c[0][i] - 1.0) * x[i] + c[1][i] * lv[i] + c[2][i] * la[i]);
        let more =
            core::array::from_fn(|i| (c[0][i] - 1.0) * lv[i] + c[1][i] * la[i] + c[2][i] * lj[i]);
        let (way, more) = (of_plate(way), of_plate(more));
        let there = Platform::moved(&x_bp, &way, 1.0);
        let c1 = c[1].iter().sum::<f64>() / 6.0;
        RelativeMotion {
            x_34: p.docking_from_plate(&there),
            twist: p.docking_twist(&there, &Twist { v: v.v + more.v, w: v.w + more.w }),
            ..next.by_series([c1, 0.0, 0.0])
        }
    }
}

fn components(t: Twist) -> [f64; 6] {
    [t.v.x, t.v.y, t.v.z, t.w.x, t.w.y, t.w.z]
}

fn twist([x, y, z, a, b, c]: [f64; 6]) -> Twist {
    Twist { v: DVec3::new(x, y, z), w: DVec3::new(a, b, c) }
}

impl Compensator for Adaptive {
    fn name(&self) -> &'static str {
        self.learning.name()
    }

    fn reset(&mut self) {
        (self.place, self.tick, self.learned) = (None, None, None);
        self.standing = [0.0; 6];
        self.commanded.rest(Pose::IDENTITY);
        let [a1, a2] = self.delays.of_plate();
        self.laws.iter_mut().for_each(|law| law.reset([1.0, a1, a2]));
    }

    fn wrench(&mut self, seen: &LoopContext<'_>) -> Option<Ports> {
        self.learn(seen);
        None
    }

    fn command(&mut self, seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        let since = self.tick.map_or(1, |before| seen.tick.saturating_sub(before));
        self.tick = Some(seen.tick);
        if self.place.is_none() {
            // It has been there for ever.
            self.commanded.rest(next.x_34);
        }
        let place = *self.place.get_or_insert(next.x_34);
        let led =
            if self.by_legs() { self.by_lengths(&place, next) } else { self.by_axes(&place, next) };
        (0..since.clamp(1, KEPT as u64)).for_each(|_| self.commanded.push(led.x_34));
        Demand::of(led)
    }

    fn digest(&self) -> Option<u64> {
        let mut h = StateHasher::new();
        h.u64(self.tick.unwrap_or(u64::MAX));
        let oldest = self.commanded.oldest();
        h.vec3(oldest.p);
        h.quat(oldest.q);
        self.standing.iter().for_each(|x| h.f64(*x));
        self.laws.iter().for_each(|law| law.hash_into(&mut h));
        Some(h.finish().short())
    }
}
