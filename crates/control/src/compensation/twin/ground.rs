//! The mechanism on the rig, as it is believed to be: where the plate was measured, with weight and balance, read by
//! sensors with their lag and delay, and conditioned as the loop conditions what it measures.
//!
//! The pose is that of this tick, since a pose one tick late costs 2 to 3 % of the force. The twist is that of the
//! bodies: differences of measured poses are too noisy for the friction of sliding contacts.

use docktwin_core::{DVec3, Pose, StateHasher, Twist, Wrench};
use docktwin_model::{DeadZoneLaw, MOST_LATCHES, SixAxisSensor};
use docktwin_physics::{
    mechanism::LatchRule,
    mounted::{Carried, Mounted, Payload, Ports},
    platform::Platform,
    sensor::{Noise, Sensor, SensorParameters},
};

use super::{Believed, LoopContext, STEPS, orbit::step_s, plate::Plate};
use crate::sensing::{Conditioning, Readings};

/// Most ticks that are made up for at once, after ticks that a loop has left out.
const MOST_TICKS: u64 = 8;

/// The ground twin.
#[derive(Clone, Debug)]
pub(super) struct Ground {
    mounted: Mounted,
    /// A and B.
    sensors: Option<[Sensor; 2]>,
    conditioning: Conditioning,
    /// Wrenches and sensors at rest, for a reset.
    at_rest: (Ports, Option<[Sensor; 2]>),
    plate: Option<Plate>,
    /// In the middle of the last step.
    ports: Ports,
    /// As read and conditioned at the last measurement.
    read: Ports,
}

/// A sensor without what is random or small: lag and delay are left.
fn smooth(file: &SixAxisSensor) -> SixAxisSensor {
    SixAxisSensor {
        noise: [0.0; 2],
        drift_per_s: [0.0; 2],
        dead_zone: [0.0; 2],
        dead_zone_law: DeadZoneLaw::Zeroing,
        quantum: [0.0; 2],
        range: [f64::MAX; 2],
        ..*file
    }
}

/// Wrenches at both ports with nothing touching. A stick is rigid and carries nothing then; where it does not touch
/// is between its stops, not far away.
fn at_rest(mounted: &Mounted) -> Ports {
    if mounted.system().rigid() {
        return Ports::default();
    }
    let far = Pose::from_translation(mounted.chaser().p + DVec3::X * 1e3);
    mounted.now(&far, &Twist::default())
}

impl Ground {
    pub(super) fn new(believed: &Believed<'_>) -> Self {
        let rig = believed.rig;
        let mounted = Mounted::new(believed.system.clone(), rig, step_s());
        let ports = at_rest(&mounted);
        let on_a = ports.port3 + mounted.ring_weight();
        let sensor = |file: &SixAxisSensor, load: Wrench| {
            let parameters = SensorParameters::of_file(smooth(file));
            Sensor::new(parameters, step_s(), Noise::new(0, 0), [load.f, load.m])
        };
        let sensors =
            believed.sensors.as_ref().map(|[a, b]| [sensor(a, on_a), sensor(b, Wrench::ZERO)]);
        let weight = rig.gravity_in_e3_m_s2() * (believed.system.ring_mass_kg() * rig.uncarried());
        let mut out = Self {
            mounted,
            at_rest: (ports, sensors.clone()),
            sensors,
            conditioning: Conditioning::new(believed.scheme, Payload::NONE, weight),
            plate: None,
            ports,
            read: Ports::default(),
        };
        let read = out.readings(true);
        out.conditioning.tare_sample(&read, &Carried::default());
        out.conditioning.tare();
        out
    }

    pub(super) fn reset(&mut self) {
        self.mounted.reset();
        self.ports = self.at_rest.0;
        self.sensors.clone_from(&self.at_rest.1);
        (self.plate, self.read) = (None, Ports::default());
    }

    /// A step with the plate at `at` in its middle.
    fn step(&mut self, at: &Plate) {
        let ports = self.mounted.advance(&at.x_bp, &at.twist).1;
        let on_a = ports.port3 + self.mounted.ring_weight();
        if let Some([a, b]) = &mut self.sensors {
            a.step([on_a.f, on_a.m]);
            b.step([ports.port4.f, ports.port4.m]);
        }
        self.ports = ports;
    }

    /// What the sensors read; where the mechanism does not report its ring the loop takes it for resting.
    fn readings(&mut self, ring_reported: bool) -> Readings {
        let on_a = self.ports.port3 + self.mounted.ring_weight();
        let b = self.ports.port4;
        let [a, b] = self.sensors.as_mut().map_or([on_a, b], |sensors| {
            sensors.each_mut().map(|s| {
                let [f, m] = s.read(0.0).value;
                Wrench { f, m }
            })
        });
        let ring = if ring_reported {
            self.mounted.ring_deflection().0
        } else {
            self.conditioning.reference().ring
        };
        Readings { a, b, ring }
    }

    /// To the instant of this tick, `ticks` after the last one. `bodies` is the plate's twist by the bodies. Without a
    /// measurement the plate goes on with it, and the wrenches stay those of the last measurement.
    pub(super) fn advance(
        &mut self,
        seen: &LoopContext<'_>,
        bodies: &Twist,
        ticks: u64,
        latches: [LatchRule; MOST_LATCHES],
    ) {
        let measured = seen.measured;
        let before = self.plate.unwrap_or(Plate { x_bp: measured.x_bp, twist: *bodies });
        let ticks = ticks.min(MOST_TICKS) as u32;
        let x_bp = if measured.fresh {
            measured.x_bp
        } else {
            Platform::moved(&before.x_bp, bodies, f64::from(ticks) * seen.period_s)
        };
        let now = Plate { x_bp, twist: *bodies };
        self.mounted.rule_latches(latches);
        let steps = STEPS * ticks;
        for i in 0..steps {
            let part = (f64::from(i) + 0.5) / f64::from(steps);
            self.step(&Plate::between(&before, &now, part));
        }
        self.plate = Some(now);
        if measured.fresh {
            let read = self.readings(measured.ring.is_some());
            self.read = self.conditioning.ports(&read, &measured.x_34, &Carried::default());
        }
    }

    /// What the loop would have measured at the last measurement, if all were as believed.
    pub(super) const fn expected(&self) -> &Ports {
        &self.read
    }

    /// F4, M4 on the article now, before the sensor's lag.
    pub(super) const fn on_article(&self) -> Wrench {
        self.ports.port4
    }

    /// The mechanism.
    pub(super) const fn mounted(&self) -> &Mounted {
        &self.mounted
    }

    pub(super) fn hash_into(&self, h: &mut StateHasher) {
        self.mounted.hash_into(h);
        self.mounted.state().reached_catch().iter().for_each(|x| h.u64(u64::from(*x)));
        self.sensors.iter().flatten().for_each(|s| s.hash_into(h));
        for w in [&self.read.port3, &self.read.port4] {
            h.vec3(w.f);
            h.vec3(w.m);
        }
    }
}
