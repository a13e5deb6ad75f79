//! What the weight of the ring does to a mechanism that stands on a rig: how far each channel of its
//! attenuation sags, and what it takes of brake and travel.
//!
//! Static, and without dry friction, which may hold a part of the weight: the largest sag.

use docktwin_core::{DVec3, Wrench};
use nalgebra::{Matrix6, Vector6};

use crate::{Attenuator, AxisChannel, DifferentialAttenuator, DockingMechanism, Rig};

/// What to do about a mechanism that sags out of its travel.
pub const SAG_REMEDY: &str = "turn the docking axis into the vertical and let [offload] of the rig's file carry \
                              the ring, or take a mechanism that bears its weight";

/// The weight on one channel of the attenuation.
#[derive(Clone, Debug, PartialEq)]
pub struct Sag {
    /// Name of the channel: an axis of the characteristic, or a brake coordinate of the differentials.
    pub channel: String,
    /// Unit of `sag` and `travel`: `m`, or `rad` for rotations of the characteristic.
    pub unit: &'static str,
    /// Force or moment on the channel, N or N·m, ≥ 0.
    pub load: f64,
    /// How far it sags, ≥ 0; infinite where the load slips the brake.
    pub sag: f64,
    /// Travel in the direction of the sag.
    pub travel: f64,
    /// Holding force of the brake in series, N or N·m, where there is one.
    pub brake: Option<f64>,
}

impl Sag {
    /// Part of the travel that it takes.
    #[must_use]
    pub fn travel_share(&self) -> f64 {
        if self.sag > 0.0 { self.sag / self.travel } else { 0.0 }
    }

    /// Part of the brake that it takes.
    #[must_use]
    pub fn brake_share(&self) -> Option<f64> {
        self.brake.map(|b| self.load / b)
    }

    /// In words: load, sag, and its share of travel and brake.
    #[must_use]
    pub fn line(&self) -> String {
        let force = if self.unit == "m" { "N" } else { "N·m" };
        let brake = self.brake_share().map_or_else(String::new, |share| {
            format!(
                ", {:.2} % of the brake of {} {force}",
                100.0 * share,
                self.brake.unwrap_or(0.0)
            )
        });
        format!(
            "sag, {} = {:.6} {} under {:.2} {force}, {:.2} % of the travel of {} {}{brake}",
            self.channel,
            self.sag,
            self.unit,
            self.load,
            100.0 * self.travel_share(),
            self.travel,
            self.unit
        )
    }
}

/// Static sag of every channel of a mechanism on a rig, the offload of the rig's file carrying its share;
/// empty where no ring moves.
///
/// A channel without dry friction under a weight W sags by W/k, k being its stiffness there.
#[must_use]
pub fn static_sag(rig: &Rig, mechanism: &DockingMechanism) -> Vec<Sag> {
    let ring = &mechanism.ring_body;
    let weight = rig.gravity_in_e3_m_s2() * (rig.uncarried() * ring.mass_kg);
    let w = Wrench::at(ring.com_m, weight);
    match &mechanism.attenuator {
        Attenuator::Rigid => Vec::new(),
        Attenuator::Characteristic(a) => [
            ("axial", "m", &a.axial, w.f.x),
            ("lateral", "m", &a.lateral, w.f.y.hypot(w.f.z)),
            ("roll", "rad", &a.roll, w.m.x),
            ("tilt", "rad", &a.tilt, w.m.y.hypot(w.m.z)),
        ]
        .into_iter()
        .map(|(name, unit, channel, load)| of_channel(name.to_owned(), unit, channel, load))
        .collect(),
        Attenuator::Differential(a) => {
            let Some(loads) = channel_loads(a, mechanism.ring_rest_offset_m, &w) else {
                return Vec::new();
            };
            let name = |i: usize| format!("brake coordinate {i}");
            a.channels
                .iter()
                .zip(loads.iter())
                .enumerate()
                .map(|(i, (channel, load))| of_channel(name(i), "m", channel, *load))
                .collect()
        }
    }
}

/// Why a mechanism cannot stand on a rig: its ring would sag out of its travel.
#[must_use]
pub fn sag_refusal(rig: &Rig, mechanism: &DockingMechanism) -> Option<String> {
    let out: Vec<String> = static_sag(rig, mechanism)
        .iter()
        .filter(|s| s.sag > s.travel)
        .map(|s| {
            if s.sag.is_finite() {
                format!("{} by {:.4} {} of {} {}", s.channel, s.sag, s.unit, s.travel, s.unit)
            } else {
                format!("{} slips its brake of {:.0} N", s.channel, s.brake.unwrap_or(0.0))
            }
        })
        .collect();
    (!out.is_empty()).then(|| {
        format!(
            "in this orientation of the docking axis ({:.1} deg off the vertical, {:.1} % of the ring's \
             weight on the mechanism) the mechanism would sag out of its travel: {}",
            rig.axis_off_vertical_rad().to_degrees(),
            100.0 * rig.uncarried(),
            out.join("; ")
        )
    })
}

fn of_channel(name: String, unit: &'static str, c: &AxisChannel, load: f64) -> Sag {
    let size = load.abs();
    let brake = c.series_brake.map(|b| b.force);
    let slips = brake.is_some_and(|b| size > b);
    Sag {
        channel: name,
        unit,
        load: size,
        sag: if slips { f64::INFINITY } else { deflection(c, size) + play_taken(c, size) },
        travel: if load < 0.0 { c.travel_negative } else { c.travel_positive },
        brake,
    }
}

/// A load takes half of the play.
fn play_taken(c: &AxisChannel, load: f64) -> f64 {
    if load > 0.0 { 0.5 * c.backlash } else { 0.0 }
}

/// Deflection at which the mean of both branches holds a load: linear between the points, with the last
/// slope beyond. Infinite on a branch that does not rise.
fn deflection(c: &AxisChannel, load: f64) -> f64 {
    let held = |x: f64| 0.5 * (value(&c.loading.points, x) + value(&c.unloading.points, x));
    let mut knots: Vec<f64> =
        c.loading.points.iter().chain(&c.unloading.points).map(|p| p[0]).collect();
    knots.sort_by(f64::total_cmp);
    knots.dedup();
    let last = knots.last().copied().unwrap_or(0.0);
    knots.push(last + 1.0);
    if load <= held(knots[0]) {
        return 0.0;
    }
    let mut between = (0.0, 1.0);
    for pair in knots.windows(2) {
        between = (pair[0], pair[1]);
        if held(pair[1]) >= load {
            break;
        }
    }
    let (x0, x1) = between;
    let slope = (held(x1) - held(x0)) / (x1 - x0);
    if slope > 0.0 { x0 + (load - held(x0)) / slope } else { f64::INFINITY }
}

fn value(points: &[[f64; 2]], x: f64) -> f64 {
    for (i, w) in points.windows(2).enumerate() {
        let ([x0, f0], [x1, f1]) = (w[0], w[1]);
        if x <= x1 || i + 2 == points.len() {
            return f0 + (f1 - f0) / (x1 - x0) * (x - x0);
        }
    }
    0.0
}

/// Forces of the brake coordinates that a wrench on the ring (about its centre, in `e3`) loads, ring at
/// rest: `W = Aᵀ f` with A from a twist of the ring to the rates of the coordinates.
fn channel_loads(a: &DifferentialAttenuator, rest_m: f64, w: &Wrench) -> Option<Vector6<f64>> {
    let legs = Matrix6::from_rows(&core::array::from_fn::<_, 6, _>(|i| {
        let arm = a.ring_joints_m[i];
        let e = (DVec3::X * rest_m + arm - a.base_joints_m[i]).normalize();
        let m = arm.cross(e);
        Vector6::new(e.x, e.y, e.z, m.x, m.y, m.z).transpose()
    }));
    let coupling = Matrix6::from_fn(|row, column| a.coupling[row][column]);
    let to_rates = coupling * legs;
    let load = Vector6::new(w.f.x, w.f.y, w.f.z, w.m.x, w.m.y, w.m.z);
    to_rates.transpose().lu().solve(&load)
}
