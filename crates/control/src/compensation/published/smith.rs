//! Hybrid Smith predictor with a phase lead (Qi and others, Acta Astronaut. 147, 2018) and the same with an observer of
//! the sensor's dead zone, stiffness and damping of the contact identified in the contact (Li, Li, Qi, Hu, Gao, Zhao,
//! J. Aerospace Eng. 2026):
//!
//! ```text
//! felt = measured(t) + F̂(bodies at t) − F̂(plate at t − τ_F)       F̂ = K̂ depth + Ĉ rate
//! command = x + τ v   (smith-lead),   inverse of dead time and drives to the second order   (smith-dob)
//! ```
//!
//! Both sources have one axis and one stiffness. In six axes the force acts along its direction n as measured, and a
//! moment about its own: K̂ and Ĉ are those along n, by least squares over the last tens of milliseconds of what force
//! and place have changed by in 5 ms. A contact only presses: a correction never turns the force round.
//!
//! The observer fills in what a dead zone hides: where the sensor reads nothing and the contact as identified has
//! less than the threshold, that force. The sources do not say how a first contact begins for which nothing is
//! identified; here nothing is filled in then.

use docktwin_core::{DVec3, Pose, StateHasher, Twist, Wrench};
use docktwin_physics::{mounted::Ports, programme::RelativeMotion};

use crate::{
    compensation::{
        Believed, Compensator, Demand, LoopContext, Phase, delays::Delays, history::History,
    },
    excitation::apart,
    sensing::opposite,
};

/// Names as on the command line.
pub(super) const LEAD: &str = "smith-lead";
pub(super) const DOB: &str = "smith-dob";

/// Measured poses that are kept, ticks.
const KEPT: usize = 64;
/// Ticks over which changes of force and place are taken.
const OVER: f64 = 5.0;
/// Memory of the least squares, s.
const MEMORY_S: f64 = 0.03;
/// Memory of the place at which a contact begins, s.
const PLACE_S: f64 = 0.01;
/// Force and moment from which on there is a contact, N and N·m.
const TOUCH: [f64; 2] = [5.0, 2.0];
/// Stiffest and most damped contacts that are believed, N/m and N·s/m, N·m/rad and N·m·s/rad.
const MOST: [[f64; 2]; 2] = [[1e8, 1e5], [1e7, 1e4]];
/// What the squares of a change of place must exceed, m² and rad², and of its rate.
const NOISE: [[f64; 2]; 2] = [[4e-10, 4e-5], [4e-10, 4e-5]];

/// Force or moment of a contact along its direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Contact {
    /// Squares and products: depth², depth · rate, rate², depth · force, rate · force.
    sums: [f64; 5],
    /// Direction of the last contact.
    direction: DVec3,
    /// Place along it at which the contact begins, m or rad; unknown before the first.
    begins: Option<f64>,
    touches: bool,
}

/// What changed along a direction.
#[derive(Clone, Copy, Debug, Default)]
struct Change {
    depth: f64,
    rate: f64,
    force: f64,
}

impl Contact {
    fn learn(&mut self, c: Change, period_s: f64) {
        let keep = 1.0 - (period_s / MEMORY_S).min(1.0);
        let new = [
            c.depth * c.depth,
            c.depth * c.rate,
            c.rate * c.rate,
            c.depth * c.force,
            c.rate * c.force,
        ];
        for (sum, x) in self.sums.iter_mut().zip(new) {
            *sum = *sum * keep + x;
        }
    }

    /// K̂ and Ĉ; zero as long as nothing has moved enough.
    fn identified(&self, most: [f64; 2], noise: [f64; 2]) -> [f64; 2] {
        let [dd, dr, rr, df, rf] = self.sums;
        if dd < noise[0] {
            return [0.0; 2];
        }
        // Without changes of the rate the damping is not seen, and left out.
        let rr = rr + noise[1];
        let determinant = dd * rr - dr * dr;
        let (k, c) = if determinant > 1e-3 * dd * rr {
            ((df * rr - rf * dr) / determinant, (rf * dd - df * dr) / determinant)
        } else {
            (df / dd, 0.0)
        };
        [k.clamp(0.0, most[0]), c.clamp(0.0, most[1])]
    }
}

/// What is between the plate at which a force was measured, and the bodies: a way and its rate, from a place; or a turn.
#[derive(Clone, Copy, Debug)]
struct Between {
    way: DVec3,
    rate: DVec3,
    place: DVec3,
}

/// Where the plate was, and what was measured, at one tick.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    x_34: Pose,
    /// F4, M4 about the origin of `e4`, in axes of `e3`.
    wrench: Wrench,
}

/// See the module's page.
#[derive(Clone, Debug)]
pub struct Smith {
    delays: Delays,
    /// Threshold of the dead zone, N and N·m, where it is observed.
    observes: Option<[f64; 2]>,
    past: History<Seen, KEPT>,
    begun: bool,
    contacts: [Contact; 2],
    correction: Ports,
}

impl Smith {
    pub(super) fn new(believed: &Believed<'_>, delays: Delays, observer: bool) -> Self {
        let dead_zone = believed.sensors.map_or([0.0; 2], |[a, _]| a.dead_zone);
        Self {
            delays,
            observes: observer.then_some(dead_zone),
            past: History::new(Seen::default()),
            begun: false,
            contacts: [Contact::default(); 2],
            correction: Ports::default(),
        }
    }

    /// The plate so many ticks ago.
    fn plate_ago(&self, ticks: f64) -> Pose {
        let (a, b, part) = self.past.ago(ticks);
        Pose::new(a.x_34.p + (b.x_34.p - a.x_34.p) * part, a.x_34.q.slerp(b.x_34.q, part))
    }

    /// What is to be added to force or moment (`which` 0 or 1) `f`.
    fn correct(&mut self, which: usize, f: DVec3, at: &Between, period_s: f64) -> DVec3 {
        let Between { way, rate, place } = *at;
        let (size, threshold) = (f.length(), self.observes.map_or(0.0, |x| x[which]));
        let contact = &mut self.contacts[which];
        contact.touches = size > TOUCH[which].max(threshold);
        if contact.touches && contact.direction.dot(f) < 0.5 * size {
            // Another contact: nothing of the last one counts.
            *contact = Contact { touches: true, ..Contact::default() };
        }
        let [k, c] = contact.identified(MOST[which], NOISE[which]);
        if contact.touches {
            let n = f / size;
            contact.direction = n;
            if k > 0.0 {
                let begins = -n.dot(place) - size / k;
                let before = contact.begins.unwrap_or(begins);
                contact.begins = Some(before + (begins - before) * (period_s / PLACE_S).min(1.0));
            }
            let more = k * -n.dot(way) + c * -n.dot(rate);
            return n * more.max(-size);
        }
        let Some(begins) = contact.begins.filter(|_| self.observes.is_some() && k > 0.0) else {
            return DVec3::ZERO;
        };
        // What the dead zone hides, at the place of the bodies.
        let n = contact.direction;
        let hidden = k * (-n.dot(place + way) - begins);
        n * if size <= threshold && hidden > 0.0 && hidden < 2.0 * threshold {
            hidden - size
        } else {
            0.0
        }
    }

    /// Least squares over what has changed.
    fn learn(&mut self, period_s: f64) {
        let ticks = self.delays.sensor_s / period_s;
        let at = [0.0, OVER, 2.0 * OVER].map(|i| self.plate_ago(ticks + i));
        let [new, old] = [apart(&at[1], &at[0]), apart(&at[2], &at[1])].map(|t| [t.v, t.w]);
        let over_s = OVER * period_s;
        let by = self.past.ago(0.0).0.wrench - self.past.ago(OVER).0.wrench;
        for (i, force) in [by.f, by.m].into_iter().enumerate() {
            let contact = &mut self.contacts[i];
            if !contact.touches {
                continue;
            }
            let n = contact.direction;
            let (depth, before) = (-n.dot(new[i]), -n.dot(old[i]));
            let change = Change { depth, rate: (depth - before) / over_s, force: n.dot(force) };
            contact.learn(change, period_s);
        }
    }
}

impl Compensator for Smith {
    fn name(&self) -> &'static str {
        if self.observes.is_some() { DOB } else { LEAD }
    }

    fn reset(&mut self) {
        self.past.rest(Seen::default());
        self.begun = false;
        self.contacts = [Contact::default(); 2];
        self.correction = Ports::default();
    }

    fn wrench(&mut self, seen: &LoopContext<'_>) -> Option<Ports> {
        if seen.phase != Phase::Closed || !seen.measured.fresh {
            return (seen.phase == Phase::Closed).then_some(self.correction);
        }
        let x = seen.measured.x_34;
        let port4 = seen.ports.port4.rotated(x.q);
        let now = Seen { x_34: x, wrench: port4 };
        if !self.begun {
            self.past.rest(now);
            self.begun = true;
        }
        self.past.push(now);
        self.learn(seen.period_s);
        // Where the plate was when the force that is read now acted.
        let of_force = self.plate_ago(self.delays.sensor_s / seen.period_s);
        let Twist { v: way, w: turn } = apart(&of_force, &seen.motion.x_34);
        // The plate goes as the bodies did, later: by how much their speeds differ follows from what they accelerate.
        let late_s = self.delays.sensor_s;
        let rates = [seen.motion.acceleration.v * late_s, seen.motion.acceleration.w * late_s];
        let Twist { v: place, w: turned } = apart(&Pose::IDENTITY, &of_force);
        let ways = Between { way, rate: rates[0], place };
        let turns = Between { way: turn, rate: rates[1], place: turned };
        let f = self.correct(0, port4.f, &ways, seen.period_s);
        let m = self.correct(1, port4.m, &turns, seen.period_s);
        let port4 = Wrench { f, m }.rotated(x.q.conjugate());
        self.correction = Ports { port3: opposite(&port4, &x.inverse()), port4 };
        Some(self.correction)
    }

    fn command(&mut self, _seen: &LoopContext<'_>, next: &RelativeMotion) -> Demand {
        Demand::of(if self.observes.is_some() {
            self.delays.undo(next, 0.0)
        } else {
            next.led(self.delays.plate_s())
        })
    }

    fn digest(&self) -> Option<u64> {
        let mut h = StateHasher::new();
        h.u64(u64::from(self.begun));
        let oldest = self.past.oldest();
        h.vec3(oldest.x_34.p);
        h.quat(oldest.x_34.q);
        h.vec3(oldest.wrench.f);
        h.vec3(oldest.wrench.m);
        for c in &self.contacts {
            c.sums.iter().for_each(|x| h.f64(*x));
            h.vec3(c.direction);
            h.f64(c.begins.unwrap_or(f64::MAX));
            h.u64(u64::from(c.touches));
        }
        for w in [self.correction.port3, self.correction.port4] {
            h.vec3(w.f);
            h.vec3(w.m);
        }
        Some(h.finish().short())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A spring and a damper along the force, moved as a sine: both are found, within the bounds.
    #[test]
    fn oracle_least_squares_find_spring_and_damper() {
        let (k, c, w) = (9.4e4, 300.0, 18.0);
        let mut contact = Contact::default();
        let (x, v) = (|t: f64| 3e-3 * (w * t).sin(), |t: f64| 3e-3 * w * (w * t).cos());
        for i in 0..200 {
            let t = f64::from(i) * 1e-3;
            let (depth, rate) = (x(t) - x(t - 5e-3), v(t) - v(t - 5e-3));
            contact.learn(Change { depth, rate, force: k * depth + c * rate }, 1e-3);
        }
        let [found_k, found_c] = contact.identified(MOST[0], [4e-10, 0.0]);
        assert!((found_k / k - 1.0).abs() < 1e-9 && (found_c / c - 1.0).abs() < 1e-9);
        let bounded = contact.identified([1e4, 10.0], [4e-10, 0.0]);
        assert!((bounded[0] - 1e4).abs() < 1e-9 && (bounded[1] - 10.0).abs() < 1e-9);
        assert!(Contact::default().identified(MOST[0], NOISE[0]).iter().sum::<f64>() < 1e-12);
    }
}
