//! The balance on which the ring hangs on a rig ([`Offload`]): a constant lift on a moving mass, its Coulomb
//! friction, and a rope from it to the mass centre of the ring.
//!
//! With y the rise of the moving mass and s that of the ring, both from where the rope has the tension of
//! the lift S alone:
//!
//! ```text
//! T = S + k (y − s) + c (y' − s')  ≥ 0     the rope pulls the ring up; it does not push
//! m y'' = S − T − F(y')                    F: Coulomb friction with a bristle before break-away
//! ```
//!
//! Without moving mass T = S − F holds at once, friction and rope being one bristle in series. Deliberately
//! absent: forces sideways and moments; the balance follows the ring there.

use docktwin_core::{DVec3, StateHasher};
use docktwin_model::Offload;

use crate::{body::MIDPOINT_ITERATIONS, contact::law::bristle};

const BREAKAWAY_M: f64 = Offload::BREAKAWAY_M;

/// What the moving mass remembers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct HangerState {
    /// Rise of the moving mass, m.
    rise_m: f64,
    /// Its velocity, m/s.
    speed_m_s: f64,
    /// Deflection of the friction's bristle over the break-away displacement.
    bristle: f64,
}

/// A balance with its moving mass, stepped with the ring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hanger {
    offload: Offload,
    /// Against gravity, unit vector in the ground's axes.
    up: DVec3,
    lift_n: f64,
    damping_n_s_m: f64,
    state: HangerState,
}

impl Hanger {
    /// A balance under a ring of this mass, at rest; `None` where gravity gives it nothing to carry.
    #[must_use]
    pub fn new(offload: Offload, gravity_m_s2: DVec3, ring_kg: f64) -> Option<Self> {
        let weight_n = gravity_m_s2.length() * ring_kg;
        let up = (-gravity_m_s2).try_normalize()?;
        let critical = 2.0 * (offload.stiffness_n_m * offload.added_mass_kg).sqrt();
        Some(Self {
            offload,
            up,
            lift_n: offload.share * weight_n,
            damping_n_s_m: offload.damping_ratio * critical,
            state: HangerState::default(),
        })
    }

    /// Lift of the balance, N: the tension of the rope where nothing moves and no friction acts.
    #[must_use]
    pub const fn lift_n(&self) -> f64 {
        self.lift_n
    }

    /// Half of a step before, or after, the kick.
    pub const fn drift(&mut self, half_step_s: f64) {
        self.state.rise_m += self.state.speed_m_s * half_step_s;
    }

    /// Gives the moving mass a velocity, m/s upwards.
    #[cfg(test)]
    pub(crate) const fn shove(&mut self, speed_m_s: f64) {
        self.state.speed_m_s = speed_m_s;
    }

    /// Takes a part of the moving mass's velocity out, for settling.
    pub const fn calm(&mut self, part: f64) {
        self.state.speed_m_s *= 1.0 - part;
    }

    /// Force on the ring at its mass centre over a step of `h`, N, in the ground's axes, and the balance
    /// carried over its kick. `moved` is the way of the ring's mass centre from its rest without weight in
    /// the middle of the step, m, `velocity` its velocity at the beginning, m/s.
    pub fn kick(&mut self, moved: DVec3, velocity: DVec3, h: f64) -> DVec3 {
        let (way, speed) = (self.up.dot(moved), self.up.dot(velocity));
        let tension = if self.offload.added_mass_kg > 0.0 {
            self.swing(way, speed, h)
        } else {
            self.slide(speed, h)
        };
        self.up * tension
    }

    /// Friction of the balance moving at `speed` over a step, N, and its bristle at the end.
    fn friction(&self, breakaway_m: f64, speed: f64, h: f64) -> (f64, f64) {
        let (mean, end) = bristle(breakaway_m, DVec3::X * self.state.bristle, DVec3::X * speed, h);
        (self.offload.friction_n * mean.x, end.x)
    }

    /// Tension with a moving mass: implicit midpoint of its velocity, as every kick.
    fn swing(&mut self, way: f64, speed: f64, h: f64) -> f64 {
        let o = self.offload;
        let start = self.state.speed_m_s;
        let (mut middle, mut tension, mut end) = (start, self.lift_n, self.state.bristle);
        for _ in 0..MIDPOINT_ITERATIONS {
            let spring = o.stiffness_n_m * (self.state.rise_m - way);
            tension = (self.lift_n + spring + self.damping_n_s_m * (middle - speed)).max(0.0);
            let (friction, bristle_end) = self.friction(BREAKAWAY_M, middle, h);
            end = bristle_end;
            middle = start + 0.5 * h * (self.lift_n - tension - friction) / o.added_mass_kg;
        }
        self.state.speed_m_s = 2.0 * middle - start;
        self.state.bristle = end;
        tension
    }

    /// Tension without: friction and rope, compliances in series, act on the ring as one bristle.
    fn slide(&mut self, speed: f64, h: f64) -> f64 {
        let breakaway_m = BREAKAWAY_M + self.offload.friction_n / self.offload.stiffness_n_m;
        let (friction, end) = self.friction(breakaway_m, speed, h);
        self.state.bristle = end;
        (self.lift_n - friction).max(0.0)
    }

    /// Adds all bits to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        [self.state.rise_m, self.state.speed_m_s, self.state.bristle]
            .iter()
            .for_each(|x| h.f64(*x));
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::TAU;

    use super::*;

    const H: f64 = 1.25e-4;
    const RING_KG: f64 = 39.1;
    const G: DVec3 = DVec3::new(-9.81, 0.0, 0.0);

    fn hanger(friction_n: f64, added_mass_kg: f64, damping_ratio: f64) -> Hanger {
        let offload =
            Offload { share: 0.98, friction_n, added_mass_kg, stiffness_n_m: 2e5, damping_ratio };
        Hanger::new(offload, G, RING_KG).expect("as it is made")
    }

    /// A ring of `RING_KG` on nothing but the balance and a spring of `k` N/m, pushed from rest by `push`
    /// N, a function of the time in s: its way against gravity over `n` steps.
    fn ring(mut hanger: Hanger, k: f64, push: impl Fn(f64) -> f64, n: usize) -> Vec<f64> {
        let (mut x, mut v) = (0.0, 0.0);
        (0..n)
            .map(|i| {
                x += 0.5 * H * v;
                hanger.drift(0.5 * H);
                let pull = hanger.kick(DVec3::X * x, DVec3::X * v, H).x;
                v += H * (pull + G.x * RING_KG - k * x + push(i as f64 * H)) / RING_KG;
                x += 0.5 * H * v;
                hanger.drift(0.5 * H);
                x
            })
            .collect()
    }

    /// Frequency of a swing about `middle` by its upward crossings, interpolated.
    fn frequency_hz(x: &[f64], middle: f64) -> f64 {
        let mut ups = x.windows(2).enumerate().filter(|(_, w)| w[0] < middle && w[1] >= middle);
        let at = |(i, w): (usize, &[f64])| (i as f64 + (middle - w[0]) / (w[1] - w[0])) * H;
        let first = at(ups.next().expect("as it is made"));
        let rest: Vec<f64> = ups.map(at).collect();
        rest.len() as f64 / (rest[rest.len() - 1] - first)
    }

    /// The moving mass adds to the ring: √(k/(m + m_a)) on a spring far softer than the hanger, whose own
    /// compliance makes it less stiff by the share m_a ω²/k_h.
    #[test]
    fn oracle_the_added_mass_lowers_the_resonance() {
        let k = 2e4;
        let plain = frequency_hz(&ring(hanger(0.0, 0.0, 0.0), k, |_| 50.0, 80_000), 50.0 / k);
        let left = (1.0 - 0.98) * G.x * RING_KG;
        let about = (50.0 + left) / k;
        assert!((plain - (k / RING_KG).sqrt() / TAU).abs() < 1e-3 * plain, "{plain}");
        for added in [2.0, 10.0, 40.0] {
            let found = frequency_hz(&ring(hanger(0.0, added, 0.0), k, |_| 50.0, 80_000), about);
            // Two masses and two springs: the lower root of
            // (k + k_h − m w)(k_h − m_a w) = k_h², w = ω².
            let (m, kh) = (RING_KG, 2e5);
            let (a, b, c) = (m * added, -(added * (k + kh) + m * kh), k * kh);
            let w = (-b - (b * b - 4.0 * a * c).sqrt()) / (2.0 * a);
            let expected = w.sqrt() / TAU;
            assert!((found - expected).abs() < 1e-3 * expected, "{added} kg: {found}, {expected}");
        }
    }

    /// A static load spreads as the closed form says: what is left of the weight over the spring.
    #[test]
    fn oracle_the_ring_sags_by_the_weight_that_is_left() {
        let k = 2e4;
        // Undamped: it swings about its rest, over whole periods the mean of the way.
        let x = ring(hanger(0.0, 2.0, 0.0), k, |_| 0.0, 200_000);
        let mean = x.iter().sum::<f64>() / x.len() as f64;
        let sag = (1.0 - 0.98) * G.x * RING_KG / k;
        assert!((mean - sag).abs() < 3e-3 * sag.abs(), "{mean} {sag}");
    }

    /// Below its Coulomb friction the balance sticks: under a load F that grows slowly the bristle gives way by
    /// s₀ ln(1/(1 − F/F_f)) and the rope by F/k; without moving mass both are one bristle of s₀ + F_f/k.
    #[test]
    fn oracle_friction_sticks_below_break_away() {
        let (friction, most, k) = (20.0_f64, 10.0, 2e5);
        let weight = 0.02 * 9.81 * RING_KG;
        for added in [2.0, 0.0] {
            // Without a jerk, which would leave a swing: a bristle creeps under one.
            let slowly = |t: f64| weight + most * (t / 20.0).powi(2) * (3.0 - t / 10.0);
            let moved = ring(hanger(friction, added, 0.05), 0.0, slowly, 160_000);
            let given = (1.0 / (1.0 - most / friction)).ln();
            let way = if added > 0.0 {
                BREAKAWAY_M * given + most / k
            } else {
                (BREAKAWAY_M + friction / k) * given
            };
            let end = moved[159_999];
            assert!((end - way).abs() < 0.01 * way, "{added} kg: {end} {way}");
        }
    }

    /// Above it it slips, and the whole of it is felt.
    #[test]
    fn oracle_friction_slips_above_break_away() {
        let slips = ring(hanger(20.0, 2.0, 0.05), 0.0, |_| -40.0, 16_000);
        let a = (40.0 + 0.02 * 9.81 * RING_KG - 20.0) / (RING_KG + 2.0);
        // Second difference over the last second: the swing of the first blow has died away.
        let [x0, x1, x2] = [7_999, 11_999, 15_999].map(|i: usize| slips[i]);
        let t = 4_000.0 * H;
        let found = -(x2 - 2.0 * x1 + x0) / (t * t);
        assert!((found - a).abs() < 1e-3 * a, "{found} {a}");
    }

    /// A rope does not push: a ring thrown upwards faster than the balance follows feels its weight alone.
    #[test]
    fn oracle_a_slack_rope_leaves_the_weight() {
        let mut h = hanger(0.0, 40.0, 0.0);
        assert!(h.kick(DVec3::X * 0.05, DVec3::ZERO, H) == DVec3::ZERO);
        // The lift accelerates the moving mass alone.
        let expected = h.lift_n() / 40.0 * H;
        assert!((h.state.speed_m_s - expected).abs() < 1e-12);
    }

    /// Without gravity there is nothing to carry.
    #[test]
    fn invariant_no_weight_no_balance() {
        let offload = hanger(5.0, 2.0, 0.05).offload;
        assert!(Hanger::new(offload, DVec3::ZERO, RING_KG).is_none());
    }
}
