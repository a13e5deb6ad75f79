//! Whether the springs and dampers of a mechanism are slow enough for the steps of a run.
//!
//! A step of h follows a spring k and a damper c on a reduced mass m while h²k/m and hc/m stay below 1: the
//! leapfrog is stable to 4, the implicit middle of a kick converges to 2, and several of them act at once. What is
//! beyond does not move as it should, gains energy, or is not finite after some steps.
//!
//! One over m is an upper bound for any direction: of a body of mass M and inertia I, at a point within ρ of p, it is
//! 1/M + (|I^(−1/2) [p]×| + ρ/√I₁)², I₁ being the least principal moment.

use docktwin_core::{DMat3, DVec3, skew};
use docktwin_model::{
    Attenuator, AxisChannel, ChannelKeys, DockingMechanism, Latch, LatchSet, NormalLaw,
    PiecewiseCurve, SideGeometry, Spacecraft, Surface, SurfacePairing, principal_moments,
};

use crate::scenario::{InitialConditions, Scenario};

/// How much faster than at the start a contact may be: what turns and swings in between adds to it.
const SPEED_MARGIN: f64 = 2.0;
/// Of the bound, for what rounding does to a value that stands on it.
const ROUNDING: f64 = 1e-9;

/// Where a value stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// In the scenario, or in the table `[contact]` of the active side's file.
    Scenario,
    /// In the file of the active side.
    Active,
    /// In the file of the passive side.
    Passive,
}

impl Place {
    /// Words that go behind a value, with a space before them; none for the scenario.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Scenario => "",
            Self::Active => " in the file of the active side",
            Self::Passive => " in the file of the passive side",
        }
    }
}

/// A spring or damper that is too fast for a step.
#[derive(Clone, Debug, PartialEq)]
pub struct TooStiff {
    /// Key of the scenario, or behind `mechanism.` that of the file of a side.
    pub key: String,
    /// Which file it stands in.
    pub place: Place,
    /// Whether key and values are of a curve, of which the steepest slope is meant.
    pub slope: bool,
    /// Value, in the unit of its key; of a curve N/m or N·m/rad.
    pub value: f64,
    /// Largest value for these steps, in the same unit.
    pub most: f64,
    /// Longest step for this value, s.
    pub step_s: f64,
    /// Step that is taken, s.
    pub taken_s: f64,
}

impl TooStiff {
    /// What is to be made smaller: `it`, or of a curve `its steepest slope`.
    #[must_use]
    pub const fn subject(&self) -> &'static str {
        if self.slope { "its steepest slope" } else { "it" }
    }

    /// What is wrong with the value, without key and value.
    #[must_use]
    pub fn what(&self) -> String {
        format!(
            "{}acts faster than steps of {} ms can follow on what it moves, at most {:.2e}",
            if self.slope { "its steepest slope " } else { "" },
            self.taken_s * 1e3,
            self.most
        )
    }

    /// All of it in a line: key, file, value, and what is wrong.
    #[must_use]
    pub fn line(&self) -> String {
        format!("{}{} = {:e}: {}", self.key, self.place.words(), self.value, self.what())
    }
}

/// Everything that moves, and how fast it comes together.
#[derive(Clone, Copy, Debug)]
pub struct Moving<'a> {
    /// The chaser, active side.
    pub chaser: &'a Spacecraft,
    /// The target, passive side.
    pub target: &'a Spacecraft,
    /// The mechanism between them.
    pub mechanism: &'a DockingMechanism,
    /// Relative state at first contact.
    pub initial: &'a InitialConditions,
    /// Whether thrusts or a pilot may add speed: forces are then as large as the mechanism's limits let them be.
    pub pushed: bool,
}

impl<'a> Moving<'a> {
    /// That of a scenario, pushed where it has thrusts.
    #[must_use]
    pub fn of(scenario: &'a Scenario) -> Self {
        Self {
            chaser: &scenario.chaser,
            target: &scenario.target,
            mechanism: &scenario.mechanism,
            initial: &scenario.initial,
            pushed: !scenario.thrusts.is_empty(),
        }
    }
}

/// Springs and dampers that steps of `step_s` (s) cannot follow on what they move, none twice.
#[must_use]
pub fn too_stiff(moving: &Moving<'_>, step_s: f64) -> Vec<TooStiff> {
    let mut f = Finder { step_s, found: Vec::new() };
    for touch in moving.touches() {
        moving.judge_touch(&touch, &mut f);
    }
    if let Some(l) = &moving.mechanism.latches {
        moving.judge_latches(l, &mut f);
    }
    let latches = &moving.mechanism.own_latches;
    for (i, l) in latches.iter().enumerate() {
        moving.judge_own_latch(i, l, latches.len(), &mut f);
    }
    if let Some(s) = &moving.mechanism.stick {
        // A turn by ψ counts as a bend by its lever times ψ.
        let ahead = DVec3::X * moving.mechanism.docked_length_m();
        let chaser = of_craft(moving.chaser, ahead, s.lever_m);
        let light = chaser.with(of_craft(moving.target, DVec3::ZERO, s.lever_m)).linear;
        f.spring(Value::active("stick.stiffness_n_m", s.stiffness_n_m), 1.0, light);
    }
    moving.judge_attenuator(&mut f);
    f.found
}

/// One over the reduced mass that a force feels, 1/kg, and over the inertia that a moment does, 1/(kg·m²).
#[derive(Clone, Copy, Debug)]
struct Lightness {
    linear: f64,
    angular: f64,
}

impl Lightness {
    /// Of a body, at any point no farther than `reach_m` from `at`, which counts from its mass centre.
    fn new(mass_kg: f64, inertia_kg_m2: DMat3, at: DVec3, reach_m: f64) -> Self {
        let least = principal_moments(inertia_kg_m2)[0];
        // A force n at p turns the body by I⁻¹ (p × n).
        let arm = skew(at);
        let turned = arm.transpose() * inertia_kg_m2.inverse() * arm;
        let turn = principal_moments(turned)[2].max(0.0).sqrt() + reach_m / least.sqrt();
        Self { linear: 1.0 / mass_kg + turn * turn, angular: 1.0 / least }
    }

    /// Of a force between two bodies.
    fn with(self, other: Self) -> Self {
        Self { linear: self.linear + other.linear, angular: self.angular + other.angular }
    }
}

/// A spacecraft within `reach_m` of `at` in the frame of its port.
fn of_craft(c: &Spacecraft, at: DVec3, reach_m: f64) -> Lightness {
    Lightness::new(c.mass_kg, c.inertia_kg_m2, c.x_body_port.transform_point(at), reach_m)
}

/// A point of a side's ring frame, m, and how far about it something may act, m.
#[derive(Clone, Copy, Debug)]
struct Spot {
    at: DVec3,
    reach_m: f64,
}

impl Spot {
    /// Anywhere as far from the ring's centre.
    const fn around(reach_m: f64) -> Self {
        Self { at: DVec3::ZERO, reach_m }
    }

    fn of_surface(s: &Surface) -> Self {
        let (at, reach_m) = s.ball_around();
        Self { at, reach_m }
    }

    fn farthest_m(&self) -> f64 {
        self.at.length() + self.reach_m
    }
}

/// How far ring and petals of a side reach from its ring's centre, m.
fn guides_reach_m(side: &SideGeometry) -> f64 {
    let ring = side.ring.mean_radius_m + side.ring.section_radius_m;
    side.petals.as_ref().map_or(ring, |p| {
        let middle = p.base_radius_m.max(p.tip_radius_m.hypot(p.height_m));
        ring.max(middle + 0.5 * p.thickness_m)
    })
}

/// Two surfaces that may touch.
struct Touch {
    /// k, N/mⁿ.
    stiffness: f64,
    /// Sticking friction coefficient.
    friction: f64,
    /// One over the reduced mass, 1/kg.
    light: f64,
    /// Farthest from a ring's centre that they touch, m.
    arm_m: f64,
    /// Where its stiffness comes from.
    stiffest: Stiffest,
}

/// The value that makes a pair stiff: of two in series the larger one, as the pair is soft enough with a small one.
struct Stiffest {
    value: Value,
    /// What it is in series with, N/mⁿ; `None` where the value is the pair's own.
    partner: Option<f64>,
    /// How many times the value its part in the series has: 2 for a ring.
    times: f64,
}

/// Largest forces of a contact, N.
struct Largest {
    elastic_n: f64,
    normal_n: f64,
}

impl Moving<'_> {
    /// What a spot of the active side moves: the ring, or the chaser where the ring is rigid.
    fn active(&self, spot: Spot) -> Lightness {
        let m = self.mechanism;
        if m.attenuator == Attenuator::Rigid {
            return self.chaser_at(spot);
        }
        let ring = &m.ring_body;
        Lightness::new(ring.mass_kg, ring.inertia_kg_m2, spot.at - ring.com_m, spot.reach_m)
    }

    /// The chaser, at a spot of `r3`.
    fn chaser_at(&self, spot: Spot) -> Lightness {
        let rest = DVec3::X * self.mechanism.ring_rest_offset_m;
        of_craft(self.chaser, rest + spot.at, spot.reach_m)
    }

    /// The target, at a spot of `r4`, which is turned by 180° about Z.
    fn passive(&self, spot: Spot) -> Lightness {
        let at = DVec3::new(-spot.at.x, -spot.at.y, spot.at.z);
        let ring = DVec3::X * -self.mechanism.passive_ring_offset_m;
        of_craft(self.target, ring + at, spot.reach_m)
    }

    fn touches(&self) -> Vec<Touch> {
        let m = self.mechanism;
        // A stick stands instead of them.
        if m.stick.is_some() {
            return Vec::new();
        }
        let mut out = Vec::new();
        let guides = |side: &SideGeometry| side.has_ring || side.petals.is_some();
        if guides(&m.active) && guides(&m.passive) {
            let spots = [&m.active, &m.passive].map(|side| Spot::around(guides_reach_m(side)));
            let value = Value::contact("stiffness_n_m", m.contact.stiffness());
            out.push(Touch {
                stiffness: m.contact.stiffness(),
                friction: m.contact.friction_static,
                light: self.active(spots[0]).with(self.passive(spots[1])).linear,
                arm_m: spots[0].reach_m.max(spots[1].reach_m),
                stiffest: Stiffest { value, partner: None, times: 1.0 },
            });
        }
        out.extend(m.surface_pairs().iter().map(|pair| self.touch_of(pair)));
        out
    }

    fn touch_of(&self, pair: &SurfacePairing) -> Touch {
        let spots = pair.surfaces.each_ref().map(Spot::of_surface);
        Touch {
            stiffness: pair.stiffness_n_m,
            friction: pair.friction,
            light: self.active(spots[0]).with(self.passive(spots[1])).linear,
            arm_m: spots[0].farthest_m().max(spots[1].farthest_m()),
            stiffest: self.stiffest(pair),
        }
    }

    fn stiffest(&self, pair: &SurfacePairing) -> Stiffest {
        let m = self.mechanism;
        let [a, b] = &pair.surfaces;
        let (side, stiff, other, place) = if a.stiffness_n_m >= b.stiffness_n_m {
            (&m.active, a, b, Place::Active)
        } else {
            (&m.passive, b, a, Place::Passive)
        };
        let partner = Some(other.stiffness_n_m);
        let Some(i) = side.surfaces.iter().position(|s| s.name == stiff.name) else {
            // The ring: it has twice the stiffness of two rings.
            let value = Value::contact("stiffness_n_m", m.contact.stiffness());
            return Stiffest { value, partner, times: 2.0 };
        };
        let key = format!("mechanism.surface.{i}.stiffness_n_m");
        let value = Value { key, place, slope: false, value: stiff.stiffness_n_m };
        Stiffest { value, partner, times: 1.0 }
    }

    /// Fastest that surfaces may meet, m/s, as far as `arm_m` from a ring's centre; `None` where thrusts or a pilot
    /// may add to it.
    fn closing_m_s(&self, arm_m: f64) -> Option<f64> {
        let i = self.initial;
        let [y, z] = i.lateral_speed_m_s;
        let ahead = i.axial_speed_m_s.abs() + y.hypot(z) + i.rates_rad_s.length() * arm_m;
        (!self.pushed).then_some(SPEED_MARGIN * ahead)
    }

    /// Largest forces of a contact: those of the whole spacecraft coming together, no larger than the limits let be.
    fn largest(&self, t: &Touch) -> Largest {
        let (m, limits) = (self.mechanism, &self.mechanism.limits);
        let limit_n = limits.compression_n.max(limits.tension_n).hypot(limits.shear_n);
        let exponent = m.contact.exponent();
        let elastic_n =
            |depth_m: f64| (t.stiffness * depth_m.min(limits.depth_m).powf(exponent)).min(limit_n);
        let Some(speed) = self.closing_m_s(t.arm_m) else {
            return Largest { elastic_n: elastic_n(limits.depth_m), normal_n: limit_n };
        };
        let chaser_kg = self.chaser.mass_kg + m.ring_body.mass_kg;
        let mass_kg = chaser_kg * self.target.mass_kg / (chaser_kg + self.target.mass_kg);
        // m v²/2 = k dⁿ⁺¹/(n + 1).
        let energy_j = 0.5 * mass_kg * speed * speed;
        let depth_m = ((exponent + 1.0) * energy_j / t.stiffness).powf(1.0 / (exponent + 1.0));
        let elastic_n = elastic_n(depth_m);
        let normal_n = match m.contact.normal {
            NormalLaw::HuntCrossley { damping_s_m, .. } => elastic_n * (1.0 + damping_s_m * speed),
            NormalLaw::KelvinVoigt { damping_n_s_m, .. } => elastic_n + damping_n_s_m * speed,
        };
        Largest { elastic_n, normal_n: normal_n.min(limit_n) }
    }

    fn judge_touch(&self, t: &Touch, f: &mut Finder) {
        let law = &self.mechanism.contact;
        let exponent = law.exponent();
        // The steepest is at the deepest that a limit lets it be.
        let depth_m = self.mechanism.limits.depth_m.min(1.0);
        let steep = exponent * depth_m.powf(exponent - 1.0);
        let share = f.step_s.powi(2) * t.stiffness * steep * t.light;
        let most = t.stiffest.most(t.stiffness / share, exponent);
        f.take(&t.stiffest.value, share, most, f.step_s / share.sqrt());
        let Largest { elastic_n, normal_n } = self.largest(t);
        match law.normal {
            // F = k dⁿ (1 + a d').
            NormalLaw::HuntCrossley { damping_s_m, .. } => {
                f.damper(Value::contact("damping_s_m", damping_s_m), elastic_n, t.light);
            }
            NormalLaw::KelvinVoigt { damping_n_s_m, .. } => {
                f.damper(Value::contact("damping_n_s_m", damping_n_s_m), 1.0, t.light);
            }
        }
        // Micro-damping of a sticking bristle.
        let of_time = t.friction * normal_n / law.bristle_breakaway_m;
        f.damper(Value::contact("bristle_damping_s", law.bristle_damping_s), of_time, t.light);
    }

    fn judge_latches(&self, l: &LatchSet, f: &mut Finder) {
        let m = self.mechanism;
        let [a, p] = [&m.active, &m.passive].map(|side| Spot::around(side.ring.mean_radius_m));
        let light = self.active(a).with(self.passive(p)).linear;
        f.spring(Value::active("latches.hold_stiffness_n_m", l.hold_stiffness_n_m), 1.0, light);
        f.spring(Value::active("latches.joined_stiffness_n_m", l.joined_stiffness_n_m), 1.0, light);
        f.damper(Value::active("latches.joined_damping_n_s_m", l.joined_damping_n_s_m), 1.0, light);
    }

    /// A latch of its own, one of `count`, which hold their strikers all together from capture on.
    fn judge_own_latch(&self, i: usize, l: &Latch, count: usize, f: &mut Finder) {
        // It acts at its striker, which is this near to it.
        let zone_m = l.lateral_zone_m.hypot(l.catch_gap_m);
        let latch = Spot { at: l.latch_r, reach_m: zone_m };
        let striker = Spot { at: l.striker_p, reach_m: 0.0 };
        let light = self.active(latch).with(self.passive(striker)).linear;
        let of = |name: &str, value: f64| Value::active(&format!("latch.{i}.{name}"), value);
        let together = count as f64;
        f.spring(of("hold_stiffness_n_m", l.hold_stiffness_n_m), 1.0, light);
        f.spring(of("joined_stiffness_n_m", l.joined_stiffness_n_m), together, light);
        f.damper(of("joined_damping_n_s_m", l.joined_damping_n_s_m), together, light);
    }

    fn judge_attenuator(&self, f: &mut Finder) {
        let between = |reach_m: f64| {
            let spot = Spot::around(reach_m);
            self.active(spot).with(self.chaser_at(spot))
        };
        match &self.mechanism.attenuator {
            Attenuator::Rigid => {}
            Attenuator::Characteristic(a) => {
                let Lightness { linear, angular } = between(0.0);
                let (lengths, angles) = (&ChannelKeys::TRANSLATION, &ChannelKeys::ROTATION);
                for (name, channel, keys, light) in [
                    ("axial", &a.axial, lengths, linear),
                    ("lateral", &a.lateral, lengths, linear),
                    ("tilt", &a.tilt, angles, angular),
                    ("roll", &a.roll, angles, angular),
                ] {
                    f.channel(&format!("characteristic.{name}"), channel, keys, light);
                }
            }
            Attenuator::Differential(a) => {
                let reach_m = a.ring_joints_m.iter().map(|p| p.length()).fold(0.0, f64::max);
                let linear = between(reach_m).linear;
                for (i, (channel, row)) in a.channels.iter().zip(&a.coupling).enumerate() {
                    // The rate of a coordinate is that of the legs by its row.
                    let gain: f64 = row.iter().map(|x| x.abs()).sum();
                    let table = format!("differential.channels.{i}");
                    f.channel(&table, channel, &ChannelKeys::TRANSLATION, linear * gain * gain);
                }
            }
        }
    }
}

impl Stiffest {
    /// The value with which the pair has `k`, N/mⁿ.
    fn most(&self, k: f64, exponent: f64) -> f64 {
        let part = self.partner.map_or(k, |partner| {
            let gives = |k: f64| k.powf(-1.0 / exponent);
            (gives(k) - gives(partner)).powf(-exponent)
        });
        part / self.times
    }
}

/// A value that may be too large.
#[derive(Clone, Debug)]
struct Value {
    key: String,
    place: Place,
    slope: bool,
    value: f64,
}

impl Value {
    /// Of the law of contact, which a scenario may change.
    fn contact(name: &str, value: f64) -> Self {
        let key = format!("mechanism.contact.{name}");
        Self { key, place: Place::Scenario, slope: false, value }
    }

    /// Of the active side's file.
    fn active(name: &str, value: f64) -> Self {
        Self { key: format!("mechanism.{name}"), place: Place::Active, slope: false, value }
    }
}

struct Finder {
    step_s: f64,
    found: Vec<TooStiff>,
}

impl Finder {
    /// A spring of `per` times a value, on what is so light, 1/kg or 1/(kg·m²).
    fn spring(&mut self, v: Value, per: f64, light: f64) {
        let share = self.step_s.powi(2) * v.value * per * light;
        self.take(&v, share, v.value / share, self.step_s / share.sqrt());
    }

    /// A damper of `per` times a value, on what is so light.
    fn damper(&mut self, v: Value, per: f64, light: f64) {
        let share = self.step_s * v.value * per * light;
        self.take(&v, share, v.value / share, self.step_s / share);
    }

    /// `share` is how much of what these steps can follow the value takes; `most` is the largest value, `step_s` the
    /// longest step. Of several findings about one key the strictest is kept.
    fn take(&mut self, v: &Value, share: f64, most: f64, step_s: f64) {
        if share <= 1.0 + ROUNDING {
            return;
        }
        let new = TooStiff {
            key: v.key.clone(),
            place: v.place,
            slope: v.slope,
            value: v.value,
            most,
            step_s,
            taken_s: self.step_s,
        };
        match self.found.iter_mut().find(|old| old.key == new.key && old.place == new.place) {
            None => self.found.push(new),
            Some(old) => {
                old.most = old.most.min(new.most);
                old.step_s = old.step_s.min(new.step_s);
            }
        }
    }

    fn channel(&mut self, table: &str, c: &AxisChannel, keys: &ChannelKeys, light: f64) {
        let value =
            |name: &str, value: f64| Value::active(&format!("attenuation.{table}.{name}"), value);
        for (name, curve) in [(keys.loading, &c.loading), (keys.unloading, &c.unloading)] {
            let steepest = Value { slope: true, ..value(name, steepest(curve)) };
            self.spring(steepest, 1.0, light);
        }
        self.spring(value(keys.stop_stiffness, c.stop_stiffness), 1.0, light);
        self.damper(value(keys.stop_damping, c.stop_damping), 1.0, light);
        self.damper(value(keys.before, c.damping.before_capture), 1.0, light);
        self.damper(value(keys.after, c.damping.after_capture), 1.0, light);
        let bristle = 1.0 / AxisChannel::DRY_BREAKAWAY;
        self.spring(value(keys.dry, c.dry_friction), bristle, light);
    }
}

/// Steepest slope of a curve, N/m or N·m/rad.
fn steepest(c: &PiecewiseCurve) -> f64 {
    let slopes = c.points.windows(2).map(|w| (w[1][1] - w[0][1]) / (w[1][0] - w[0][0]));
    slopes.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests;
