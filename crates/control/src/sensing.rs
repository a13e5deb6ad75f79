//! From the sensors' readings to the wrenches at both ports (§5).
//!
//! Sensor A on the rack gives F3, M3. F4, M4 come from sensor B on the moving plate (two-sensor
//! scheme), less weight and inertia of what it carries, or from A by (12) and (13) (single-sensor
//! scheme), which neglects the inertia of the moving part of the active mechanism.

use docktwin_core::{DVec3, Pose, Wrench};
use docktwin_model::{DeadZoneLaw, SixAxisSensor};
use docktwin_physics::mounted::{Carried, Payload, Ports};

/// Where F4, M4 come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SensorScheme {
    /// From sensor A by (12), (13).
    #[default]
    Single,
    /// From sensor B.
    Two,
}

/// (12) and (13): the wrench on the target at `e4` that belongs to the wrench on the chaser at `e3`,
/// when nothing between them has mass. In (13) `r_ab` runs from `O_a` to `O_b`.
#[must_use]
pub fn opposite(port3: &Wrench, x_34: &Pose) -> Wrench {
    let at_4 = port3.shifted(x_34.p);
    (-at_4).rotated(x_34.q.conjugate())
}

/// What is read of one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Readings {
    /// Sensor A.
    pub a: Wrench,
    /// Sensor B.
    pub b: Wrench,
    /// Displacement of the ring, m, in `e3`; zero where the mechanism does not measure it.
    pub ring: DVec3,
}

/// Conditioning of both sensors.
#[derive(Clone, Copy, Debug)]
pub struct Conditioning {
    scheme: SensorScheme,
    /// What sensor B carries, as believed.
    payload: Payload,
    /// Weight of the ring that no balance carries, N, in `e3`: its moment at sensor A depends on the position of the ring.
    ring_weight: DVec3,
    /// Thresholds that dead zones take off the readings of A and of B, N and N·m.
    taken_off: [[f64; 2]; 2],
    tare: Readings,
    sum: Readings,
    samples: u32,
}

/// The threshold that a dead zone takes off every reading, N and N·m; none where it passes larger ones whole.
#[must_use]
pub const fn taken_off(sensor: &SixAxisSensor) -> [f64; 2] {
    match sensor.dead_zone_law {
        DeadZoneLaw::Subtractive => sensor.dead_zone,
        DeadZoneLaw::Zeroing => [0.0; 2],
    }
}

/// A reading with the threshold put back. Where it is zero, the force is somewhere within the dead zone.
#[must_use]
pub fn put_back(w: &Wrench, threshold: [f64; 2]) -> Wrench {
    each(w, threshold, |x, by| if x == 0.0 { 0.0 } else { x + by.copysign(x) })
}

/// A reading of what is felt, the threshold taken off.
fn take_off(w: &Wrench, threshold: [f64; 2]) -> Wrench {
    each(w, threshold, |x, by| x - x.clamp(-by, by))
}

fn each(w: &Wrench, [force_n, moment_nm]: [f64; 2], of: impl Fn(f64, f64) -> f64) -> Wrench {
    let all = |v: DVec3, by: f64| DVec3::new(of(v.x, by), of(v.y, by), of(v.z, by));
    Wrench { f: all(w.f, force_n), m: all(w.m, moment_nm) }
}

impl Conditioning {
    /// Not tared yet.
    #[must_use]
    pub fn new(scheme: SensorScheme, payload: Payload, ring_weight: DVec3) -> Self {
        let (tare, sum) = (Readings::default(), Readings::default());
        Self { scheme, payload, ring_weight, taken_off: [[0.0; 2]; 2], tare, sum, samples: 0 }
    }

    /// The same for sensors with dead zones, which take these thresholds off the readings of A and of B
    /// ([`taken_off`]).
    #[must_use]
    pub const fn with_dead_zones(mut self, taken_off: [[f64; 2]; 2]) -> Self {
        self.taken_off = taken_off;
        self
    }

    /// What the sensors felt.
    fn felt(&self, read: &Readings) -> [Wrench; 2] {
        [put_back(&read.a, self.taken_off[0]), put_back(&read.b, self.taken_off[1])]
    }

    /// What the sensors read with nothing touching, as of the last tare: of B less what it carries.
    #[must_use]
    pub fn reference(&self) -> Readings {
        let Readings { a, b, ring } = self.tare;
        let [of_a, of_b] = self.taken_off;
        Readings { a: take_off(&a, of_a), b: take_off(&b, of_b), ring }
    }

    /// Takes a sample for the tare; nothing touches.
    pub fn tare_sample(&mut self, read: &Readings, carried: &Carried) {
        let [a, b] = self.felt(read);
        self.sum.a += a;
        self.sum.b += b + -self.payload.wrench(carried);
        self.sum.ring += read.ring;
        self.samples += 1;
    }

    /// Makes the mean of the samples the tare and begins anew. Nothing happens without samples.
    pub fn tare(&mut self) {
        if self.samples == 0 {
            return;
        }
        let n = f64::from(self.samples);
        let mean = |w: &Wrench| Wrench { f: w.f / n, m: w.m / n };
        let Readings { a, b, ring } = core::mem::take(&mut self.sum);
        self.tare = Readings { a: mean(&a), b: mean(&b), ring: ring / n };
        self.samples = 0;
    }

    /// Wrenches at both ports from readings of one instant, at which the mechanisms stood at `x_34`.
    #[must_use]
    pub fn ports(&self, read: &Readings, x_34: &Pose, carried: &Carried) -> Ports {
        let [a, b] = self.felt(read);
        let mut port3 = a - self.tare.a;
        port3.m -= (read.ring - self.tare.ring).cross(self.ring_weight);
        let port4 = match self.scheme {
            SensorScheme::Single => opposite(&port3, x_34),
            SensorScheme::Two => b - self.tare.b - self.payload.wrench(carried),
        };
        Ports { port3, port4 }
    }
}

#[cfg(test)]
mod tests {
    use docktwin_core::{DMat3, DQuat, Twist};

    use super::*;

    /// A mechanism without mass is in equilibrium: what it does to both spacecraft adds up to nothing
    /// about any point.
    #[test]
    fn oracle_signs_of_12_and_13_by_equilibrium() {
        let x_34 = Pose::new(
            DVec3::new(0.7, 0.1, -0.2),
            DQuat::from_scaled_axis(DVec3::new(0.2, -0.1, 0.3)),
        );
        let w3 = Wrench { f: DVec3::new(10.0, -4.0, 7.0), m: DVec3::new(1.0, 2.0, -3.0) };
        let w4 = opposite(&w3, &x_34);
        // In e3, about its origin.
        let back = w4.rotated(x_34.q);
        let total = DVec3::ZERO.cross(w3.f) + w3.m + x_34.p.cross(back.f) + back.m;
        assert!((w3.f + back.f).length() < 1e-12 && total.length() < 1e-12);
        // (13) with r_ab from O_a to O_b: r_42 + r_21 − r_31 is r_43.
        let r_43 = -x_34.p;
        let printed = r_43.cross(back.f) - w3.m;
        assert!((printed - back.m).length() < 1e-12);
    }

    /// A plate that is thrown about with nothing touching reads nothing.
    #[test]
    fn oracle_weight_and_inertia_are_taken_off() {
        let payload = Payload {
            mass_kg: 200.0,
            com_m: DVec3::new(0.1, 0.02, -0.03),
            inertia_kg_m2: DMat3::from_diagonal(DVec3::new(40.0, 30.0, 20.0)),
        };
        let mut c = Conditioning::new(SensorScheme::Two, payload, DVec3::ZERO);
        let still = Carried { gravity: DVec3::new(-9.81, 0.0, 0.0), ..Carried::default() };
        let zero = Wrench { f: DVec3::splat(3.0), m: DVec3::splat(-2.0) };
        let read = |at: &Carried| Readings { b: payload.wrench(at) + zero, ..Readings::default() };
        for _ in 0..10 {
            c.tare_sample(&read(&still), &still);
        }
        c.tare();
        let moving = Carried {
            gravity: DQuat::from_rotation_y(0.1) * still.gravity,
            rate: DVec3::new(0.1, 0.2, -0.3),
            acceleration: Twist { v: DVec3::new(1.0, -2.0, 0.5), w: DVec3::new(0.3, 0.1, 0.2) },
        };
        let ports = c.ports(&read(&moving), &Pose::IDENTITY, &moving);
        assert!(ports.port4.f.length() < 1e-9 && ports.port4.m.length() < 1e-9);
        // Accelerometers say the same without knowing where down is.
        let [v, w] = moving.feels();
        let by_accelerometers = Carried::felt(v, w, moving.rate);
        let ports = c.ports(&read(&moving), &Pose::IDENTITY, &by_accelerometers);
        assert!(ports.port4.f.length() < 1e-9 && ports.port4.m.length() < 1e-9);
    }

    /// A sensor with a zero of 20 N and a threshold of 8 N that it takes off: 30 N press, and 30 N pull.
    #[test]
    fn oracle_what_a_dead_zone_takes_off_is_put_back() {
        let reads = |felt_n: f64| {
            let raw = felt_n + 20.0;
            let a = Wrench { f: DVec3::X * (raw - raw.clamp(-8.0, 8.0)), m: DVec3::ZERO };
            Readings { a, ..Readings::default() }
        };
        let mut c = Conditioning::new(SensorScheme::Single, Payload::NONE, DVec3::ZERO)
            .with_dead_zones([[8.0, 1.0], [0.0; 2]]);
        c.tare_sample(&reads(0.0), &Carried::default());
        c.tare();
        for felt_n in [30.0, -30.0, 300.0, -11.0] {
            let found = c.ports(&reads(felt_n), &Pose::IDENTITY, &Carried::default());
            assert!((found.port3.f.x - felt_n).abs() < 1e-12, "{felt_n}");
        }
        // Within the dead zone nothing is known of it.
        let found = c.ports(&reads(-15.0), &Pose::IDENTITY, &Carried::default());
        assert!((found.port3.f.x + 15.0).abs() <= 8.0);
    }

    /// A ring that is pushed aside turns its weight about sensor A, and nothing touches for that.
    #[test]
    fn oracle_a_ring_aside_weighs_the_same() {
        let weight = DVec3::new(-390.0, 3.0, 0.0);
        let reads = |ring: DVec3| Readings {
            a: Wrench { f: weight, m: (DVec3::X * 0.4 + ring).cross(weight) },
            ring,
            ..Readings::default()
        };
        let mut c = Conditioning::new(SensorScheme::Single, Payload::NONE, weight);
        c.tare_sample(&reads(DVec3::new(-0.01, 0.0, 0.001)), &Carried::default());
        c.tare();
        let aside = reads(DVec3::new(-0.02, 0.015, -0.01));
        let ports = c.ports(&aside, &Pose::IDENTITY, &Carried::default());
        assert!(ports.port3.f.length() < 1e-12 && ports.port3.m.length() < 1e-12);
    }
}
