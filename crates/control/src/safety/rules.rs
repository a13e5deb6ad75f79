//! The rules of the supervisor, one function each: which quantity is compared with which limit.

use super::{Limit, SafetyLimits, Watched};

/// What a rule finds in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reading {
    /// Reached, in the unit of the limit's name.
    pub(super) value: f64,
    /// Allowed.
    pub(super) allowed: f64,
    /// Whether the limit is exceeded. False for NaN, which the supervisor checks separately.
    pub(super) passed: bool,
    /// 1 with nothing used up, 0 at the limit.
    pub(super) margin: f64,
}

/// A rule; `None` where its quantity is not measured.
pub(super) type Rule = fn(&Watched, &SafetyLimits) -> Option<Reading>;

/// All of them, in the order in which they are judged.
pub(super) const RULES: [(Limit, Rule); Limit::COUNT] = [
    (Limit::Stroke, stroke),
    (Limit::LegSpeed, leg_speed),
    (Limit::LegForce, leg_force),
    (Limit::Force, port_force),
    (Limit::Moment, port_moment),
    (Limit::Pose, pose),
    (Limit::Tracking, tracking),
    (Limit::Watchdog, watchdog),
    (Limit::Rig, rig),
    (Limit::Saturated, saturated),
    (Limit::Frozen, frozen),
    (Limit::Energy, energy),
    (Limit::Finite, finite),
];

/// Room of a leg that counts as untouched, m.
const STROKE_SCALE_M: f64 = 0.3;

/// A quantity that must stay below its limit.
fn at_most(value: f64, allowed: f64) -> Option<Reading> {
    Some(Reading { value, allowed, passed: value > allowed, margin: 1.0 - value / allowed })
}

/// A condition that must not be.
fn never(is: bool, limits: &SafetyLimits, limit: Limit) -> Option<Reading> {
    at_most(f64::from(u8::from(is)), limits.of(limit))
}

fn stroke(w: &Watched, l: &SafetyLimits) -> Option<Reading> {
    let (value, allowed) = (w.stroke_margin_m, l.stroke_margin_m);
    let margin = ((value - allowed) / STROKE_SCALE_M).min(1.0);
    Some(Reading { value, allowed, passed: value < allowed, margin })
}

fn leg_speed(w: &Watched, l: &SafetyLimits) -> Option<Reading> {
    at_most(w.leg_speed_m_s, l.leg_speed_m_s)
}

fn leg_force(w: &Watched, l: &SafetyLimits) -> Option<Reading> {
    at_most(w.leg_force_n?, l.leg_force_n)
}

fn port_force(w: &Watched, l: &SafetyLimits) -> Option<Reading> {
    at_most(w.port_force_n, l.port_force_n)
}

fn port_moment(w: &Watched, l: &SafetyLimits) -> Option<Reading> {
    at_most(w.port_moment_nm, l.port_moment_nm)
}

fn pose(w: &Watched, l: &SafetyLimits) -> Option<Reading> {
    at_most(w.pose_half_widths, l.pose_half_widths)
}

fn tracking(w: &Watched, l: &SafetyLimits) -> Option<Reading> {
    at_most(w.tracking_error_m, l.tracking_error_m)
}

fn watchdog(w: &Watched, l: &SafetyLimits) -> Option<Reading> {
    at_most(f64::from(w.ticks_without), l.of(Limit::Watchdog))
}

fn rig(w: &Watched, l: &SafetyLimits) -> Option<Reading> {
    never(w.rig_left, l, Limit::Rig)
}

fn saturated(w: &Watched, l: &SafetyLimits) -> Option<Reading> {
    never(w.saturated, l, Limit::Saturated)
}

fn frozen(w: &Watched, l: &SafetyLimits) -> Option<Reading> {
    at_most(f64::from(w.ticks_frozen), l.of(Limit::Frozen))
}

fn energy(w: &Watched, l: &SafetyLimits) -> Option<Reading> {
    at_most(w.energy_gained?, l.energy_gained?)
}

fn finite(w: &Watched, l: &SafetyLimits) -> Option<Reading> {
    never(!w.is_finite(), l, Limit::Finite)
}
