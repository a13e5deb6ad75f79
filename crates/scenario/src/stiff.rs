//! Whether the springs and dampers of a mechanism are slow enough for the steps of a run.
//!
//! A step of h follows a spring k and a damper c on a reduced mass m while h²k/m and hc/m stay below 1: the
//! leapfrog is stable to 4, the implicit middle of a kick converges to 2, and several of them act at once. What is
//! beyond does not move as it should, gains energy, or is not finite after some steps.

use docktwin_core::DVec3;
use docktwin_model::{
    Attenuator, AxisChannel, DockingMechanism, NormalLaw, PiecewiseCurve, Spacecraft,
};

/// Step of a twin that is not told otherwise, s: that of the full twin, the longer one.
const STEP_S: f64 = 2e-4;
/// Fastest closing that a scenario may have, m/s.
const FASTEST_M_S: f64 = 2.0;
/// Break-away displacement of dry friction in an attenuator, m or rad, as its law has it.
const DRY_BREAKAWAY: f64 = 2e-4;

/// A spring or damper that is too fast.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TooStiff {
    /// Key of the scenario, or behind `mechanism.` of the mechanism's file.
    pub(crate) key: String,
    /// Value, in the unit of its key.
    pub(crate) value: f64,
    /// Largest value for these steps.
    pub(crate) most: f64,
    /// Longest step for this value, s.
    pub(crate) step_s: f64,
    /// Step of this run, s.
    pub(crate) taken_s: f64,
}

/// Everything that moves, and the steps it is to move in.
pub(crate) struct Moving<'a> {
    pub(crate) chaser: &'a Spacecraft,
    pub(crate) target: &'a Spacecraft,
    pub(crate) mechanism: &'a DockingMechanism,
    pub(crate) tick_s: f64,
    pub(crate) steps_per_tick: Option<u32>,
}

/// One over the reduced masses, 1/kg, and over the inertia, 1/(kg·m²), that the ring's centre feels.
#[derive(Clone, Copy)]
struct Lightness {
    linear: f64,
    angular: f64,
}

impl Lightness {
    /// Of a force between two bodies.
    fn with(self, other: Self) -> Self {
        Self { linear: self.linear + other.linear, angular: self.angular + other.angular }
    }
}

fn least_moment(i: &docktwin_core::DMat3) -> f64 {
    i.x_axis.x.min(i.y_axis.y).min(i.z_axis.z)
}

impl Moving<'_> {
    fn step_s(&self) -> f64 {
        self.steps_per_tick.map_or(STEP_S.min(self.tick_s), |n| self.tick_s / f64::from(n))
    }

    /// What contacts and latches move, at the guide ring, and what the attenuator moves.
    fn lightness(&self) -> [Lightness; 2] {
        let m = self.mechanism;
        let out_m = m.active.ring.mean_radius_m.max(m.passive.ring.mean_radius_m);
        let craft = |c: &Spacecraft, ahead_m: f64| {
            let arm: DVec3 = c.x_body_port.p;
            let arm_m = arm.length() + ahead_m + out_m;
            let angular = 1.0 / least_moment(&c.inertia_kg_m2);
            Lightness { linear: 1.0 / c.mass_kg + arm_m * arm_m * angular, angular }
        };
        let target = craft(self.target, m.passive_ring_offset_m);
        let chaser = craft(self.chaser, m.ring_rest_offset_m);
        if m.attenuator == Attenuator::Rigid {
            return [chaser.with(target); 2];
        }
        let angular = 1.0 / least_moment(&m.ring_body.inertia_kg_m2);
        let linear = 1.0 / m.ring_body.mass_kg + out_m * out_m * angular;
        let ring = Lightness { linear, angular };
        [ring.with(target), ring.with(chaser)]
    }

    /// What is too fast, all of it.
    pub(crate) fn too_stiff(&self) -> Vec<TooStiff> {
        let [at_contact, at_ring] = self.lightness();
        let mut f = Finder { light: at_contact, step_s: self.step_s(), found: Vec::new() };
        self.contact(&mut f);
        if let Some(l) = &self.mechanism.latches {
            f.spring("mechanism.latches.hold_stiffness_n_m", l.hold_stiffness_n_m, f.light.linear);
            f.spring(
                "mechanism.latches.joined_stiffness_n_m",
                l.joined_stiffness_n_m,
                f.light.linear,
            );
            f.damper(
                "mechanism.latches.joined_damping_n_s_m",
                l.joined_damping_n_s_m,
                f.light.linear,
            );
        }
        if let Some(s) = &self.mechanism.stick {
            f.spring("mechanism.stick.stiffness_n_m", s.stiffness_n_m, f.light.linear);
        }
        match &self.mechanism.attenuator {
            Attenuator::Rigid => {}
            Attenuator::Characteristic(a) => {
                let Lightness { linear, angular } = at_ring;
                for (name, channel, light) in [
                    ("axial", &a.axial, linear),
                    ("lateral", &a.lateral, linear),
                    ("tilt", &a.tilt, angular),
                    ("roll", &a.roll, angular),
                ] {
                    f.channel(
                        &format!("mechanism.attenuation.characteristic.{name}"),
                        channel,
                        light,
                    );
                }
            }
            Attenuator::Differential(a) => {
                for (i, channel) in a.channels.iter().enumerate() {
                    // The rate of a coordinate is that of the legs by its row.
                    let gain: f64 = a.coupling[i].iter().map(|x| x.abs()).sum();
                    let light = at_ring.linear * (gain * gain).min(1.0);
                    f.channel(
                        &format!("mechanism.attenuation.differential.channels.{i}"),
                        channel,
                        light,
                    );
                }
            }
        }
        f.found
    }

    fn contact(&self, f: &mut Finder) {
        let (m, law, light) = (self.mechanism, &self.mechanism.contact, f.light.linear);
        let key = "mechanism.contact.stiffness_n_m";
        let stiffness = match law.normal {
            NormalLaw::HuntCrossley { stiffness, exponent, damping_s_m } => {
                // The steepest at the deepest that a limit lets it be.
                let steep = exponent * m.limits.depth_m.min(1.0).powf(exponent - 1.0);
                f.spring_by(key, stiffness, steep, light);
                // F = k d (1 + c d') at the depth of a collision, v sqrt(m/k).
                let depth = FASTEST_M_S / (steep * stiffness * light).sqrt();
                let deepest = depth.min(m.limits.depth_m);
                let of_damping = steep * stiffness * deepest;
                f.damper_by("mechanism.contact.damping_s_m", damping_s_m, of_damping, light);
                steep * stiffness
            }
            NormalLaw::KelvinVoigt { stiffness, damping_n_s_m } => {
                f.spring(key, stiffness, light);
                f.damper("mechanism.contact.damping_n_s_m", damping_n_s_m, light);
                stiffness
            }
        };
        // Micro-damping of a sticking bristle under the force of a collision, v sqrt(k m).
        let force_n = (FASTEST_M_S * (stiffness / light).sqrt()).min(m.limits.compression_n);
        let of_time = law.friction_static * force_n / law.bristle_breakaway_m;
        f.damper_by("mechanism.contact.bristle_damping_s", law.bristle_damping_s, of_time, light);
    }
}

struct Finder {
    light: Lightness,
    step_s: f64,
    found: Vec<TooStiff>,
}

impl Finder {
    fn spring(&mut self, key: &str, value: f64, light: f64) {
        self.spring_by(key, value, 1.0, light);
    }

    /// A spring of `per` times a value.
    fn spring_by(&mut self, key: &str, value: f64, per: f64, light: f64) {
        let rate2 = value * per * light;
        self.take(key, value, self.step_s.powi(2) * rate2, 1.0 / rate2.sqrt());
    }

    fn damper(&mut self, key: &str, value: f64, light: f64) {
        self.damper_by(key, value, 1.0, light);
    }

    /// A damper of `per` times a value.
    fn damper_by(&mut self, key: &str, value: f64, per: f64, light: f64) {
        let rate = value * per * light;
        self.take(key, value, self.step_s * rate, 1.0 / rate);
    }

    /// `share` is how much of what these steps can follow the value takes.
    fn take(&mut self, key: &str, value: f64, share: f64, step_s: f64) {
        if share > 1.0 {
            let most = value / share;
            self.found.push(TooStiff {
                key: key.to_owned(),
                value,
                most,
                step_s,
                taken_s: self.step_s,
            });
        }
    }

    fn channel(&mut self, table: &str, c: &AxisChannel, light: f64) {
        let slope = |c: &PiecewiseCurve| {
            let slopes = c.points.windows(2).map(|w| (w[1][1] - w[0][1]) / (w[1][0] - w[0][0]));
            slopes.fold(0.0, f64::max)
        };
        let key = |name: &str| format!("{table}.{name}");
        self.spring(&key("loading"), slope(&c.loading).max(slope(&c.unloading)), light);
        self.spring(&key("stop_stiffness"), c.stop_stiffness, light);
        self.damper(&key("stop_damping"), c.stop_damping, light);
        let damping = c.damping.before_capture.max(c.damping.after_capture);
        self.damper(&key("damping"), damping, light);
        self.spring_by(&key("dry_friction"), c.dry_friction, 1.0 / DRY_BREAKAWAY, light);
    }
}
