//! What carries the active ring: per-axis characteristics, or screw legs coupled by differentials.
//!
//! The ring's deflection is the pose of `r3` in `e3` against its rest. Forces act on the ring at
//! the ring centre and on the chaser, opposite, at the same point, so momentum is conserved
//! whatever the deflection. Rotations are measured by the rotation vector ψ; its rate is
//! ψ' = J⁻¹(ψ) ω, so a moment that derives from V(ψ) is −J⁻ᵀ ∂V/∂ψ.
//!
//! Tables, damping and brake of a channel are one element; with play (`play`) the ring finds it only
//! after the width of the play.

use docktwin_core::{DMat3, DVec3, Pose, StateHasher, Twist, Wrench, skew};
use docktwin_model::{
    Attenuator, AxisChannel, CharacteristicAttenuator, DifferentialAttenuator, PiecewiseCurve,
};

use crate::contact::law::bristle;

mod play;

/// Over this far into a stop its damping grows to its full value, m or rad.
const STOP_ENGAGEMENT: f64 = 1e-3;
/// Channels: four in the characteristic model, six in the differential one.
const CHANNELS: usize = 6;

/// Value and integral from zero at `x` ≥ 0: linear between points, last slope beyond.
fn curve(c: &PiecewiseCurve, x: f64) -> (f64, f64) {
    let mut area = 0.0;
    for (i, w) in c.points.windows(2).enumerate() {
        let ([x0, f0], [x1, f1]) = (w[0], w[1]);
        if x <= x1 || i + 2 == c.points.len() {
            let slope = (f1 - f0) / (x1 - x0);
            let d = x - x0;
            return (f0 + slope * d, area + d * (f0 + 0.5 * slope * d));
        }
        area += 0.5 * (f0 + f1) * (x1 - x0);
    }
    (0.0, 0.0)
}

/// Memory of one channel; vectors so that isotropic channels (Y/Z, pitch/yaw) are one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct ChannelState {
    /// Slip of the series brake, m or rad.
    slip: DVec3,
    /// Bristle of the dry friction and of the branches.
    dry: DVec3,
    /// The element's loaded end, where there is play.
    play: play::End,
}

/// What the attenuator remembers from step to step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AttenuatorState {
    channels: [ChannelState; CHANNELS],
}

impl AttenuatorState {
    /// Adds all bits to a digest.
    pub fn hash_into(&self, h: &mut StateHasher) {
        for c in &self.channels {
            h.vec3(c.slip);
            h.vec3(c.dry);
            c.play.hash_into(h);
        }
    }

    /// Slip of the longitudinal brake, m.
    #[must_use]
    pub const fn axial_slip_m(&self) -> f64 {
        self.channels[0].slip.x
    }
}

/// Force of one channel and where its energy goes.
#[derive(Clone, Copy, Debug, Default)]
struct ChannelForce {
    force: DVec3,
    lost_w: f64,
    next: ChannelState,
}

/// One channel at deflection `x` moving at `v`.
fn channel(
    c: &AxisChannel,
    state: &ChannelState,
    x: DVec3,
    v: DVec3,
    damping_phase: f64,
    h: f64,
) -> ChannelForce {
    let damping = c.damping.before_capture
        + (c.damping.after_capture - c.damping.before_capture) * damping_phase;
    let mut element = if c.backlash > 0.0 {
        play::element(c, state, x.x, v.x, damping, h)
    } else {
        element(c, state, x, v, damping, h)
    };
    // Branches and dry friction: one bristle.
    let dry = c.dry_friction + element.branch;
    let branch = element.branch;
    let ChannelForce { force, lost_w: lost, next } = &mut element.force;
    if dry > 0.0 {
        let breakaway = if branch > 0.0 { c.branch_change } else { AxisChannel::DRY_BREAKAWAY };
        let (mean, end) = bristle(breakaway, state.dry, v, h);
        let f = -mean * dry;
        *force += f;
        next.dry = end;
        *lost -= f.dot(v);
    }
    // End stops.
    let (over, unit) = beyond_travel(c, x);
    if over > 0.0 {
        let rate = v.dot(unit);
        let damp = c.stop_damping * rate * (over / STOP_ENGAGEMENT).min(1.0);
        let push = (c.stop_stiffness * over + damp).max(0.0);
        *force -= unit * push;
        *lost += (push - c.stop_stiffness * over) * rate;
    }
    element.force
}

/// What tables, damping and brake of a channel do.
#[derive(Clone, Copy, Debug, Default)]
struct Element {
    force: ChannelForce,
    /// Half the distance of the branches, for their bristle.
    branch: f64,
}

/// Elastic force against an elongation, and half the distance of the branches there.
fn spring(c: &AxisChannel, e: DVec3) -> (DVec3, f64) {
    let size = e.length();
    let unit = if size > 1e-15 { e / size } else { DVec3::ZERO };
    let (up, _) = curve(&c.loading, size);
    let (down, _) = curve(&c.unloading, size);
    (unit * (0.5 * (up + down)), 0.5 * (up - down).max(0.0))
}

/// The element without play, its end at deflection `x` moving at `v`.
fn element(
    c: &AxisChannel,
    state: &ChannelState,
    x: DVec3,
    v: DVec3,
    damping: f64,
    h: f64,
) -> Element {
    let mut next = *state;
    let (elastic, branch) = spring(c, x - state.slip);
    let mut series = -(elastic + v * damping);
    let lost_w = match &c.series_brake {
        Some(b) if series.length() > b.force => {
            // Spring and damper in series with the slipping brake: the force is the same in
            // both, k e + c (v − s') = F_b + b s'.
            let size = series.length();
            let pull = -series / size;
            let rate = (size - b.force) / (damping + b.viscous);
            let slip_rate = pull * rate;
            series = -(elastic + (v - slip_rate) * damping);
            next.slip += slip_rate * h;
            -series.dot(slip_rate) + damping * (v - slip_rate).length_squared()
        }
        _ => damping * v.length_squared(),
    };
    Element { force: ChannelForce { force: series, lost_w, next }, branch }
}

/// How far beyond its travel, and in which direction.
fn beyond_travel(c: &AxisChannel, x: DVec3) -> (f64, DVec3) {
    let one_sided = x.y.abs() + x.z.abs() < 1e-300;
    let size = x.length();
    if size < 1e-15 {
        return (0.0, DVec3::X);
    }
    let travel = if one_sided && x.x < 0.0 { c.travel_negative } else { c.travel_positive };
    ((size - travel).max(0.0), x / size)
}

fn channel_energy(c: &AxisChannel, state: &ChannelState, x: DVec3) -> f64 {
    let e = if c.backlash > 0.0 {
        play::Held::at(c, state, x.x).elongation.abs()
    } else {
        (x - state.slip).length()
    };
    let (over, _) = beyond_travel(c, x);
    spring_energy(c, e) + 0.5 * c.stop_stiffness * over * over
}

/// Stored at an elongation of this size, J: under the mean of both branches.
fn spring_energy(c: &AxisChannel, size: f64) -> f64 {
    0.5 * (curve(&c.loading, size).1 + curve(&c.unloading, size).1)
}

/// Deflection of the ring against its rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deflection {
    /// Ring centre, in `e3`, m.
    pub d: DVec3,
    /// Rotation vector of `R_3r`, in `e3`, rad.
    pub psi: DVec3,
}

/// Wrench of the attenuator on the ring at the ring centre, axes of `e3`, and its losses.
#[derive(Clone, Copy, Debug, Default)]
pub struct AttenuatorForce {
    /// On the ring, N and N·m, about the ring centre, axes of `e3`.
    pub on_ring: Wrench,
    /// Power lost, W.
    pub lost_w: f64,
    /// Memory at the end of the step.
    pub next: AttenuatorState,
}

/// The attenuator at one deflection: everything that depends on positions only.
#[derive(Clone, Copy, Debug)]
pub struct AttenuatorGeometry {
    deflection: Deflection,
    j_inv: DMat3,
    x_3r: Pose,
}

impl AttenuatorGeometry {
    /// From the pose of the ring frame in `e3` and the rest offset along X3 (m).
    #[must_use]
    pub fn new(x_3r: Pose, rest_offset_m: f64) -> Self {
        let q = if x_3r.q.w < 0.0 { -x_3r.q } else { x_3r.q };
        let psi = q.to_scaled_axis();
        Self {
            deflection: Deflection { d: x_3r.p - DVec3::X * rest_offset_m, psi },
            j_inv: left_jacobian_inverse(psi),
            x_3r,
        }
    }

    /// The deflection.
    #[must_use]
    pub const fn deflection(&self) -> Deflection {
        self.deflection
    }

    /// J⁻¹ of `ψ' = J⁻¹ ω`.
    pub(crate) const fn rotation_rate_matrix(&self) -> DMat3 {
        self.j_inv
    }
}

/// J⁻¹ with ψ' = J⁻¹ ω, ω in the frame against which the rotation is measured.
pub(crate) fn left_jacobian_inverse(psi: DVec3) -> DMat3 {
    let t2 = psi.length_squared();
    let s = skew(psi);
    // 1/θ² − (1 + cos θ)/(2 θ sin θ) = 1/12 + θ²/720 + …
    let c = if t2 < 1e-6 {
        1.0 / 12.0 + t2 / 720.0
    } else {
        let t = t2.sqrt();
        1.0 / t2 - (1.0 + t.cos()) / (2.0 * t * t.sin())
    };
    DMat3::IDENTITY - s * 0.5 + s * s * c
}

const X: DVec3 = DVec3::X;

/// Force of the attenuator. `rel` is the motion of the ring relative to `e3` at the ring centre, in
/// `e3`; `damping_phase` goes from 0 (before capture) to 1 (after).
#[must_use]
pub fn force(
    model: &Attenuator,
    g: &AttenuatorGeometry,
    state: &AttenuatorState,
    rel: Twist,
    damping_phase: f64,
    h: f64,
) -> AttenuatorForce {
    match model {
        Attenuator::Rigid => AttenuatorForce { next: *state, ..AttenuatorForce::default() },
        Attenuator::Characteristic(m) => characteristic(m, g, state, rel, damping_phase, h),
        Attenuator::Differential(m) => differential(m, g, state, rel, damping_phase, h),
    }
}

fn across(v: DVec3) -> DVec3 {
    DVec3::new(0.0, v.y, v.z)
}

fn characteristic(
    m: &CharacteristicAttenuator,
    g: &AttenuatorGeometry,
    state: &AttenuatorState,
    rel: Twist,
    phase: f64,
    h: f64,
) -> AttenuatorForce {
    let Deflection { d, psi } = g.deflection;
    let psi_rate = g.j_inv * rel.w;
    let parts = [
        channel(&m.axial, &state.channels[0], X * d.x, X * rel.v.x, phase, h),
        channel(&m.lateral, &state.channels[1], across(d), across(rel.v), phase, h),
        channel(&m.roll, &state.channels[2], X * psi.x, X * psi_rate.x, phase, h),
        channel(&m.tilt, &state.channels[3], across(psi), across(psi_rate), phase, h),
    ];
    let mut next = *state;
    parts.iter().zip(&mut next.channels).for_each(|(p, n)| *n = p.next);
    AttenuatorForce {
        on_ring: Wrench {
            f: parts[0].force + parts[1].force,
            m: g.j_inv.transpose() * (parts[2].force + parts[3].force),
        },
        lost_w: parts.iter().map(|p| p.lost_w).sum(),
        next,
    }
}

/// Leg vectors, lengths against rest, and their Jacobian rows (force direction, moment arm about
/// the ring centre), all in `e3`.
fn legs(m: &DifferentialAttenuator, g: &AttenuatorGeometry) -> [(f64, DVec3, DVec3); 6] {
    let rest = DVec3::X * (g.x_3r.p.x - g.deflection.d.x);
    core::array::from_fn(|i| {
        let arm = g.x_3r.q * m.ring_joints_m[i];
        let leg = g.x_3r.p + arm - m.base_joints_m[i];
        let length = leg.length();
        let l_rest = (rest + m.ring_joints_m[i] - m.base_joints_m[i]).length();
        (length - l_rest, leg / length, arm)
    })
}

/// Brake coordinates `coupling · (l − l_rest)`, m.
fn brake_coordinates(m: &DifferentialAttenuator, along: impl Fn(usize) -> f64) -> [f64; 6] {
    m.coupling.map(|row| (0..6).map(|i| row[i] * along(i)).sum())
}

/// Every channel with what it sees of the deflection, in the order of the state.
fn channel_deflections<'a>(
    model: &'a Attenuator,
    g: &AttenuatorGeometry,
) -> [Option<(&'a AxisChannel, DVec3)>; CHANNELS] {
    let Deflection { d, psi } = g.deflection;
    match model {
        Attenuator::Rigid => [None; CHANNELS],
        Attenuator::Characteristic(m) => [
            Some((&m.axial, X * d.x)),
            Some((&m.lateral, across(d))),
            Some((&m.roll, X * psi.x)),
            Some((&m.tilt, across(psi))),
            None,
            None,
        ],
        Attenuator::Differential(m) => {
            let legs = legs(m, g);
            let x = brake_coordinates(m, |i| legs[i].0);
            core::array::from_fn(|row| Some((&m.channels[row], X * x[row])))
        }
    }
}

fn differential(
    m: &DifferentialAttenuator,
    g: &AttenuatorGeometry,
    state: &AttenuatorState,
    rel: Twist,
    phase: f64,
    h: f64,
) -> AttenuatorForce {
    let legs = legs(m, g);
    let rates = legs.map(|(_, e, arm)| e.dot(rel.v + rel.w.cross(arm)));
    let mut out = AttenuatorForce { next: *state, ..AttenuatorForce::default() };
    let mut leg_force = [0.0; 6];
    let x = brake_coordinates(m, |i| legs[i].0);
    let v = brake_coordinates(m, |i| rates[i]);
    for (row, c) in m.channels.iter().enumerate() {
        let part = channel(c, &state.channels[row], X * x[row], X * v[row], phase, h);
        out.lost_w += part.lost_w;
        out.next.channels[row] = part.next;
        for (f, k) in leg_force.iter_mut().zip(m.coupling[row]) {
            *f += k * part.force.x;
        }
    }
    for ((_, e, arm), f) in legs.iter().zip(leg_force) {
        out.on_ring.push(*arm, *e * f);
    }
    out
}

/// Stored energy, J.
#[must_use]
pub fn stored_energy(model: &Attenuator, g: &AttenuatorGeometry, state: &AttenuatorState) -> f64 {
    channel_deflections(model, g)
        .into_iter()
        .zip(&state.channels)
        .filter_map(|(at, s)| at.map(|(c, x)| channel_energy(c, s, x)))
        .sum()
}

/// How far the attenuator is pushed beyond its travel, m; rotations count at `ring_radius_m`.
#[must_use]
pub fn overtravel(model: &Attenuator, g: &AttenuatorGeometry, ring_radius_m: f64) -> f64 {
    let turns = matches!(model, Attenuator::Characteristic(_));
    channel_deflections(model, g)
        .into_iter()
        .enumerate()
        .filter_map(|(row, at)| {
            // Rows 2 and 3 of the characteristic are roll and tilt.
            let radius = if turns && row >= 2 { ring_radius_m } else { 1.0 };
            at.map(|(c, x)| beyond_travel(c, x).0 * radius)
        })
        .fold(0.0, f64::max)
}

/// What springs and stops do to the ring: minus the gradient of [`stored_energy`] at constant
/// memory, N and N·m about the ring centre, axes of `e3`.
#[must_use]
pub fn elastic_wrench(
    model: &Attenuator,
    g: &AttenuatorGeometry,
    state: &AttenuatorState,
) -> Wrench {
    let parts: [DVec3; CHANNELS] = {
        let at = channel_deflections(model, g);
        core::array::from_fn(|row| {
            at[row].map_or(DVec3::ZERO, |(c, x)| elastic_part(c, &state.channels[row], x))
        })
    };
    match model {
        Attenuator::Rigid => Wrench::ZERO,
        Attenuator::Characteristic(_) => {
            Wrench { f: parts[0] + parts[1], m: g.j_inv.transpose() * (parts[2] + parts[3]) }
        }
        Attenuator::Differential(m) => {
            let mut out = Wrench::ZERO;
            for (i, (_, e, arm)) in legs(m, g).iter().enumerate() {
                let f: f64 = (0..6).map(|row| m.coupling[row][i] * parts[row].x).sum();
                out.push(*arm, *e * f);
            }
            out
        }
    }
}

/// Spring and stop of one channel, without damping and friction.
fn elastic_part(c: &AxisChannel, state: &ChannelState, x: DVec3) -> DVec3 {
    let (over, unit) = beyond_travel(c, x);
    let stop = unit * (c.stop_stiffness * over);
    if c.backlash > 0.0 {
        return -(X * play::Held::at(c, state, x.x).slope_n(c) + stop);
    }
    let e = x - state.slip;
    let mean = 0.5 * (curve(&c.loading, e.length()).0 + curve(&c.unloading, e.length()).0);
    -(e.normalize_or_zero() * mean + stop)
}

/// The memory with which no brake carries a load and no friction is engaged at this deflection.
pub(crate) fn relaxed(model: &Attenuator, g: &AttenuatorGeometry) -> AttenuatorState {
    let channels = channel_deflections(model, g).map(|at| match at {
        Some((c, x)) if c.series_brake.is_some() => {
            ChannelState { slip: x, play: play::End::at(x.x), ..ChannelState::default() }
        }
        _ => ChannelState::default(),
    });
    AttenuatorState { channels }
}

/// How far all series brakes have slipped, m and rad added up without sign.
pub(crate) fn total_slip(state: &AttenuatorState) -> f64 {
    state.channels.iter().map(|c| c.slip.length()).sum()
}

/// The channels of a model, in the order of the state.
pub(crate) fn channels(model: &Attenuator) -> impl Iterator<Item = &AxisChannel> {
    let rest = AttenuatorGeometry::new(Pose::IDENTITY, 0.0);
    channel_deflections(model, &rest).into_iter().flatten().map(|(c, _)| c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use docktwin_core::DQuat;

    #[test]
    fn oracle_rotation_vector_rate() {
        // ψ' by differentiating R(t) = exp([ω t]×) R0 numerically.
        let psi = DVec3::new(0.1, -0.2, 0.15);
        let w = DVec3::new(0.3, 0.5, -0.4);
        let at = |t: f64| {
            (DQuat::from_scaled_axis(w * t) * DQuat::from_scaled_axis(psi)).to_scaled_axis()
        };
        let h = 1e-5;
        let want = (at(h) - at(-h)) / (2.0 * h);
        assert!((left_jacobian_inverse(psi) * w - want).length() < 1e-9);
        let small = psi * 1e-4;
        let at = |t: f64| {
            (DQuat::from_scaled_axis(w * t) * DQuat::from_scaled_axis(small)).to_scaled_axis()
        };
        let want = (at(h) - at(-h)) / (2.0 * h);
        assert!((left_jacobian_inverse(small) * w - want).length() < 1e-9);
    }

    #[test]
    fn oracle_curve_and_its_area() {
        let c = PiecewiseCurve { points: vec![[0.0, 0.0], [1.0, 2.0], [3.0, 3.0]] };
        let close =
            |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).abs() < 1e-12 && (a.1 - b.1).abs() < 1e-12;
        assert!(close(curve(&c, 0.5), (1.0, 0.25)));
        assert!(close(curve(&c, 2.0), (2.5, 1.0 + 2.25)));
        assert!(close(curve(&c, 5.0), (4.0, 1.0 + 5.0 + 7.0)));
    }
}
