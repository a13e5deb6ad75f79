//! Commands of the loop and of a drive, made from what control computes.

use docktwin_control::{
    feedforward::{LegCommand, LegCorrections, PathTimes, PlateMotion},
    safety::SafetyLimits,
};
use docktwin_core::{DMat3, DVec3, Pose, Wrench};
use docktwin_model::Rig as RigModel;
use docktwin_rigport::{
    guard::{Guard, GuardLimits},
    message::{
        Capabilities, Flags, LARGEST, LEGS, RigCommand, RigMeasurement, RigMode, attitude, six,
    },
};

use crate::clock::Clock;

/// A command without motion, for a tick that is due at `due_ns`.
pub(crate) fn still<K: Clock>(
    clock: &K,
    mode: RigMode,
    session: u64,
    tick: u64,
    due_ns: u64,
) -> RigCommand {
    RigCommand {
        mode: mode as u32,
        flags: if K::LOCKSTEP { Flags::LOCKSTEP } else { Flags::empty() },
        session,
        tick,
        loop_time_ns: due_ns,
        wakeup_ns: due_ns,
        period_ns: clock.period_ns(),
        ..RigCommand::zero()
    }
}

/// What a rig follows, as its measurements say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// Leg values, and the pose they come from.
    Legs,
    /// The plate's pose and twist alone.
    Pose,
}

impl Form {
    /// Leg values where the rig takes those of six legs, its plate's pose where it takes that, or `None`.
    pub(crate) fn of(m: &RigMeasurement) -> Option<Self> {
        if m.has(Capabilities::LEG_COMMAND) && m.leg_count as usize == LEGS {
            Some(Self::Legs)
        } else {
            m.has(Capabilities::POSE_COMMAND).then_some(Self::Pose)
        }
    }
}

/// A motion of the plate as it is commanded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    /// What its legs are to do.
    pub(crate) legs: [LegCommand; LEGS],
    /// The motion at the moment of arrival.
    pub(crate) arrival: PlateMotion,
    /// Wrench of the contact expected on the plate, about the origin of `ep`, in `eb`.
    pub(crate) external: Wrench,
}

/// Writes a motion into a command, its flows corrected by what was identified of the legs.
pub(crate) fn write_motion(
    c: &mut RigCommand,
    form: Form,
    motion: &Motion,
    corrections: &LegCorrections,
    times: PathTimes,
) {
    if form == Form::Legs {
        c.leg_count = LEGS as u32;
        for (i, leg) in motion.legs.iter().enumerate() {
            c.leg_length_m[i] = leg.length_m;
            c.leg_speed_m_s[i] = leg.speed_m_s;
            c.leg_flow_speed_m_s[i] = corrections.flow_speed_m_s(i, leg.flow_speed_m_s);
            c.leg_force_n[i] = leg.force_n;
        }
        (c.flow_ahead_s, c.force_ahead_s) = (times.flow_ahead_s, times.force_ahead_s);
    }
    let plate = &motion.arrival;
    c.plate_position_m = plate.x_bp.p.to_array();
    c.plate_attitude = attitude(plate.x_bp.q);
    c.plate_velocity_m_s = plate.twist.v.to_array();
    c.plate_rate_rad_s = plate.twist.w.to_array();
    c.plate_acceleration = six(plate.acceleration.v, plate.acceleration.w);
    c.plate_wrench = six(motion.external.f, motion.external.m);
}

/// How far the guard's limits are beyond the supervisor's: it is the second layer, which acts when the
/// supervisor has not.
const GUARD_MARGIN: f64 = 1.25;

/// The guard that stands behind a supervisor with these limits: of what a rig with `capabilities`
/// measures or is commanded. `reference_a` is sensor A's reading with nothing touching, once it is known.
pub(crate) fn guard(
    rig: &RigModel,
    limits: &SafetyLimits,
    capabilities: Capabilities,
    reference_a: Option<Wrench>,
) -> Guard {
    let d = &rig.docking;
    let wide = GUARD_MARGIN * limits.pose_half_widths;
    let x_b3 = rig.x_b0 * rig.x_03;
    // The docking workspace is a box along the axes of `e3`. In those of the plate it is the one that
    // holds it.
    let half = DVec3::new(d.axial_m, d.lateral_m, d.lateral_m) * wide;
    let turn = DMat3::from_quat(rig.x_4p.q.conjugate());
    let half_m = DMat3::from_cols(turn.x_axis.abs(), turn.y_axis.abs(), turn.z_axis.abs()) * half;
    let turns = DVec3::new(d.roll_rad, d.pitch_yaw_rad, d.pitch_yaw_rad);
    let mut set = GuardLimits::POSE;
    set.set(
        GuardLimits::SENSOR_A,
        reference_a.is_some() && capabilities.contains(Capabilities::SENSOR_A),
    );
    set.set(
        GuardLimits::LEG_SPEED,
        capabilities.intersects(Capabilities::LEG_COMMAND | Capabilities::LEG_SPEED),
    );
    // A limit that there is none of is none of the message either, whose numbers are bounded.
    let most = |limit: f64| (GUARD_MARGIN * limit).min(LARGEST);
    Guard {
        limits: set,
        reference: [reference_a.unwrap_or_default(), Wrench::ZERO],
        force_n: most(limits.port_force_n),
        moment_nm: most(limits.port_moment_nm),
        leg_speed_m_s: most(limits.leg_speed_m_s),
        point_m: rig.x_4p.inverse().p,
        middle: Pose::new(x_b3.transform_point(d.middle_m), x_b3.q * rig.x_4p.q),
        half_m,
        turn_rad: (turns.length() * wide).min(core::f64::consts::PI),
        ..Guard::NONE
    }
}

/// The largest in size; a NaN comes through.
pub(crate) fn largest(x: &[f64; 6]) -> f64 {
    x.iter().fold(0.0, |a: f64, b| if b.abs() > a || b.is_nan() { b.abs() } else { a })
}

/// The least; a NaN comes through.
pub(crate) fn least(x: &[f64; 6]) -> f64 {
    x.iter().fold(f64::INFINITY, |a, b| if *b < a || b.is_nan() { *b } else { a })
}

#[cfg(test)]
mod tests {
    use docktwin_core::Euler;

    use super::*;

    fn rig() -> RigModel {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/urdf/stewart.urdf");
        docktwin_model::load_rig(file.as_ref()).expect("the default rig").model
    }

    /// The box of the guard holds what the supervisor allows, and not much more, whatever way the plate
    /// stands to its mechanism.
    #[test]
    fn oracle_the_guard_stands_behind_the_supervisor() {
        let turned = Euler { roll: 0.0, pitch: core::f64::consts::FRAC_PI_2, yaw: 0.0 }.to_quat();
        for q_4p in [docktwin_core::DQuat::IDENTITY, turned] {
            let mut rig = rig();
            rig.x_4p.q = q_4p;
            let limits = SafetyLimits::of_rig(&rig, 1000.0, f64::INFINITY);
            let all = Capabilities::all();
            let guard = guard(&rig, &limits, all, Some(Wrench::default()));
            let passes = |part: [f64; 6], of: f64| {
                let x = rig.docking.pose(part.map(|x| x * of * limits.pose_half_widths));
                let x_bp = rig.plate_from_docking(&x);
                let mut c = RigCommand { mode: RigMode::Track as u32, ..RigCommand::zero() };
                c.plate_position_m = x_bp.p.to_array();
                c.plate_attitude = attitude(x_bp.q);
                guard.write(&mut c);
                assert!(c.is_finite() && c.keeps_reserved());
                let m = RigMeasurement {
                    capabilities: Capabilities::SENSOR_A | Capabilities::LEG_SPEED,
                    ..RigMeasurement::zero()
                };
                Guard::of(&c).passed(&c, &m)
            };
            for axis in 0..6 {
                for sign in [1.0, -1.0] {
                    let mut part = [0.0; 6];
                    part[axis] = sign;
                    assert_eq!(passes(part, 1.0), GuardLimits::empty(), "axis {axis}");
                    // Turns are limited as one.
                    let beyond = if axis < 3 { 1.26 } else { 5.0 };
                    assert_eq!(passes(part, beyond), GuardLimits::POSE, "axis {axis}");
                }
            }
        }
    }
}
