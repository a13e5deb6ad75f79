//! The guard: limits that come with every command and that the rig's end can enforce by itself, without
//! a memory, a model or the loop.
//!
//! The supervisor of the loop acts first and knows more; the guard is the second layer, in case the
//! loop is faulty. Its limits are valid from one valid command to the next, so a loop can narrow
//! them on the way to a contact and widen them in contact. [`Guard::passed`] is the complete check;
//! the protocol page gives it as formulas.

use docktwin_core::{DVec3, Pose, Twist, Wrench};

pub use crate::message::GuardLimits;
use crate::message::{
    Capabilities, RigCommand, RigMeasurement, RigMode, attitude, pose, six, wrench,
};

/// The limits of one command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guard {
    /// Which of the limits below are set.
    pub limits: GuardLimits,
    /// Readings of sensors A and B with nothing touching.
    pub reference: [Wrench; 2],
    /// Most force of a sensor beyond its reference, N.
    pub force_n: f64,
    /// Most moment of a sensor beyond its reference, N·m.
    pub moment_nm: f64,
    /// Fastest leg, m/s.
    pub leg_speed_m_s: f64,
    /// Fastest motion of the point, m/s.
    pub speed_m_s: f64,
    /// Fastest turning of the plate, rad/s.
    pub rate_rad_s: f64,
    /// Point of the plate that must stay in the box, m, in `ep`.
    pub point_m: DVec3,
    /// Middle and axes of the box in `eb`; the attitude is the one of `ep` from which it may turn.
    pub middle: Pose,
    /// Half the box's widths along its axes, m.
    pub half_m: DVec3,
    /// Furthest turn from the box's attitude, rad.
    pub turn_rad: f64,
}

impl Guard {
    /// Without a limit.
    pub const NONE: Self = Self {
        limits: GuardLimits::empty(),
        reference: [Wrench::ZERO; 2],
        force_n: 0.0,
        moment_nm: 0.0,
        leg_speed_m_s: 0.0,
        speed_m_s: 0.0,
        rate_rad_s: 0.0,
        point_m: DVec3::ZERO,
        middle: Pose::IDENTITY,
        half_m: DVec3::ZERO,
        turn_rad: 0.0,
    };

    /// The guard of a command.
    #[must_use]
    pub fn of(c: &RigCommand) -> Self {
        Self {
            limits: c.guard_limits,
            reference: [wrench(&c.guard_reference_a), wrench(&c.guard_reference_b)],
            force_n: c.guard_force_n,
            moment_nm: c.guard_moment_nm,
            leg_speed_m_s: c.guard_leg_speed_m_s,
            speed_m_s: c.guard_speed_m_s,
            rate_rad_s: c.guard_rate_rad_s,
            point_m: DVec3::from_array(c.guard_point_m),
            middle: pose(&c.guard_box_middle_m, &c.guard_box_attitude),
            half_m: DVec3::from_array(c.guard_box_half_m),
            turn_rad: c.guard_box_turn_rad,
        }
    }

    /// Writes it into a command.
    pub fn write(&self, c: &mut RigCommand) {
        c.guard_limits = self.limits;
        let [a, b] = self.reference.map(|w| six(w.f, w.m));
        (c.guard_reference_a, c.guard_reference_b) = (a, b);
        c.guard_force_n = self.force_n;
        c.guard_moment_nm = self.moment_nm;
        c.guard_leg_speed_m_s = self.leg_speed_m_s;
        c.guard_speed_m_s = self.speed_m_s;
        c.guard_rate_rad_s = self.rate_rad_s;
        c.guard_point_m = self.point_m.to_array();
        c.guard_box_middle_m = self.middle.p.to_array();
        c.guard_box_attitude = attitude(self.middle.q);
        c.guard_box_half_m = self.half_m.to_array();
        c.guard_box_turn_rad = self.turn_rad;
    }

    /// The limits that a command, or what was measured after it, passes.
    ///
    /// Forces count in every mode in which the rig is under power and is to go on: hold, track, retract. A
    /// limit on a sensor that is not there counts as passed: it cannot be kept. Speeds and poses count in
    /// track, those commanded and, as far as there are any, those measured; in other modes a rig moves by
    /// itself, if at all.
    #[must_use]
    pub fn passed(&self, c: &RigCommand, m: &RigMeasurement) -> GuardLimits {
        let mut out = GuardLimits::empty();
        let mode = RigMode::from_number(c.mode);
        if matches!(mode, Some(RigMode::Hold | RigMode::Track | RigMode::Retract)) {
            out |= self.forces_passed(m);
        }
        if mode == Some(RigMode::Track) {
            out |= self.motion_passed(c, m);
        }
        out & self.limits
    }

    fn forces_passed(&self, m: &RigMeasurement) -> GuardLimits {
        let mut out = GuardLimits::empty();
        for (limit, capability, read, reference) in [
            (GuardLimits::SENSOR_A, Capabilities::SENSOR_A, &m.sensor_a, self.reference[0]),
            (GuardLimits::SENSOR_B, Capabilities::SENSOR_B, &m.sensor_b, self.reference[1]),
        ] {
            let change = wrench(read) + -reference;
            // Written so that NaN exceeds the limit.
            let kept = change.f.length() <= self.force_n && change.m.length() <= self.moment_nm;
            out.set(limit, !(m.has(capability) && kept));
        }
        out
    }

    fn motion_passed(&self, c: &RigCommand, m: &RigMeasurement) -> GuardLimits {
        let slow = |v: &[f64; 6]| v.iter().all(|v| v.abs() <= self.leg_speed_m_s);
        let measured = m.has(Capabilities::LEG_SPEED);
        let legs =
            (c.leg_count == 0 || slow(&c.leg_speed_m_s)) && (!measured || slow(&m.leg_speed_m_s));
        let within = |x: &Pose, t: &Twist| {
            let v = t.v + t.w.cross(x.q * self.point_m);
            v.length() <= self.speed_m_s && t.w.length() <= self.rate_rad_s
        };
        let twists = within(&c.plate(), &c.plate_twist())
            && m.plate().zip(m.plate_twist()).is_none_or(|(x, t)| within(&x, &t));
        let poses = self.holds(&c.plate()) && m.plate().is_none_or(|x| self.holds(&x));
        let mut out = GuardLimits::empty();
        out.set(GuardLimits::LEG_SPEED, !legs);
        out.set(GuardLimits::PLATE_SPEED, !twists);
        out.set(GuardLimits::POSE, !poses);
        out
    }

    /// Whether a pose of the plate is in the box.
    fn holds(&self, x_bp: &Pose) -> bool {
        let off = self.middle.q.conjugate() * (x_bp.transform_point(self.point_m) - self.middle.p);
        let turn = self.middle.q.conjugate() * x_bp.q;
        let turn_rad = 2.0 * turn.xyz().length().atan2(turn.w.abs());
        off.abs().cmple(self.half_m).all() && turn_rad <= self.turn_rad
    }
}

#[cfg(test)]
mod tests {
    use docktwin_core::DQuat;

    use super::*;

    fn guard() -> Guard {
        Guard {
            limits: GuardLimits::all(),
            reference: [
                Wrench { f: DVec3::new(-2000.0, 0.0, 0.0), m: DVec3::ZERO },
                Wrench { f: DVec3::ZERO, m: DVec3::new(0.0, 50.0, 0.0) },
            ],
            force_n: 500.0,
            moment_nm: 100.0,
            leg_speed_m_s: 0.6,
            speed_m_s: 0.4,
            rate_rad_s: 0.2,
            point_m: DVec3::X,
            // Axes of the box turned by 90° about Z.
            middle: Pose::new(
                DVec3::new(0.0, 1.0, 3.0),
                DQuat::from_rotation_z(core::f64::consts::FRAC_PI_2),
            ),
            half_m: DVec3::new(0.1, 0.2, 0.3),
            turn_rad: 0.3,
        }
    }

    /// A command and a measurement with the plate's point in the middle of the box.
    fn good() -> (RigCommand, RigMeasurement) {
        let g = guard();
        let plate = Pose::new(g.middle.p - g.middle.q * g.point_m, g.middle.q);
        let mut c = RigCommand { mode: RigMode::Track as u32, leg_count: 6, ..RigCommand::zero() };
        (c.plate_position_m, c.plate_attitude) = (plate.p.to_array(), attitude(plate.q));
        g.write(&mut c);
        let mut m = RigMeasurement { capabilities: Capabilities::all(), ..RigMeasurement::zero() };
        (m.plate_position_m, m.plate_attitude) = (plate.p.to_array(), attitude(plate.q));
        m.sensor_a[0] = -2000.0;
        m.sensor_b[4] = 50.0;
        (c, m)
    }

    #[test]
    fn invariant_a_guard_is_the_same_after_the_wire() {
        let (c, _) = good();
        let there = RigCommand::from_bytes(&c.to_bytes()).expect("its size");
        assert_eq!(Guard::of(&there), Guard::of(&c));
        let back = Guard::of(&c);
        assert!((back.middle.q.dot(guard().middle.q).abs() - 1.0).abs() < 1e-15);
        assert_eq!(Guard { middle: guard().middle, ..back }, guard());
    }

    /// Each limit alone, just inside and just outside, commanded and measured.
    #[test]
    fn oracle_every_limit_is_passed_alone_and_by_a_little() {
        type Change = fn(&mut RigCommand, &mut RigMeasurement, f64);
        let cases: [(GuardLimits, Change); 14] = [
            (GuardLimits::SENSOR_A, |_, m, k| m.sensor_a[0] -= 500.0 * k),
            (GuardLimits::SENSOR_A, |_, m, k| m.sensor_a[4] += 100.0 * k),
            (GuardLimits::SENSOR_B, |_, m, k| m.sensor_b[2] = -500.0 * k),
            (GuardLimits::SENSOR_B, |_, m, k| m.sensor_b[4] -= 100.0 * k),
            (GuardLimits::LEG_SPEED, |c, _, k| c.leg_speed_m_s[3] = -0.6 * k),
            (GuardLimits::LEG_SPEED, |_, m, k| m.leg_speed_m_s[5] = 0.6 * k),
            // The box's X is Y of the ground.
            (GuardLimits::POSE, |c, _, k| c.plate_position_m[1] += 0.1 * k),
            (GuardLimits::POSE, |_, m, k| m.plate_position_m[0] -= 0.2 * k),
            (GuardLimits::POSE, |_, m, k| m.plate_position_m[2] += 0.3 * k),
            // A turn about the plate's X leaves the point where it is.
            (GuardLimits::POSE, |c, _, k| {
                let q = c.plate().q * DQuat::from_rotation_x(0.3 * k);
                c.plate_attitude = attitude(q);
            }),
            (GuardLimits::PLATE_SPEED, |c, _, k| c.plate_velocity_m_s[2] = 0.4 * k),
            (GuardLimits::PLATE_SPEED, |_, m, k| m.plate_velocity_m_s[0] = -0.4 * k),
            (GuardLimits::PLATE_SPEED, |_, m, k| m.plate_rate_rad_s[1] = 0.2 * k),
            // 0.15 rad/s about Z move the point by 0.15 m/s along −X of the ground.
            (GuardLimits::PLATE_SPEED, |c, _, k| {
                c.plate_rate_rad_s[2] = 0.15;
                c.plate_velocity_m_s[0] = -(0.4 * k - 0.15);
            }),
        ];
        let g = guard();
        for (i, (limit, change)) in cases.into_iter().enumerate() {
            for (k, passed) in [(0.999, GuardLimits::empty()), (1.001, limit)] {
                let (mut c, mut m) = good();
                change(&mut c, &mut m, k);
                assert_eq!(g.passed(&c, &m), passed, "case {i} at {k}");
                let without = Guard { limits: g.limits - limit, ..g };
                assert_eq!(without.passed(&c, &m), GuardLimits::empty(), "case {i}, not set");
            }
        }
    }

    #[test]
    fn invariant_what_cannot_be_kept_counts_as_passed() {
        let (c, mut m) = good();
        assert_eq!(guard().passed(&c, &m), GuardLimits::empty());
        // Commanded values are enough for speeds and poses, but not for forces.
        m.capabilities = Capabilities::empty();
        let forces = GuardLimits::SENSOR_A | GuardLimits::SENSOR_B;
        assert_eq!(guard().passed(&c, &m), forces);
        assert_eq!(Guard::NONE.passed(&c, &m), GuardLimits::empty());
        let (c, mut m) = good();
        m.sensor_a[3] = f64::NAN;
        m.leg_speed_m_s[0] = f64::NAN;
        m.plate_position_m[0] = f64::NAN;
        let passed = guard().passed(&c, &m);
        let expected = GuardLimits::SENSOR_A | GuardLimits::LEG_SPEED | GuardLimits::POSE;
        assert!(passed.contains(expected), "{passed:?}");
    }

    /// A rig that holds, retracts or rests is not driven: only forces count, and none where it is
    /// to stop.
    #[test]
    fn oracle_motion_counts_in_track_alone() {
        let (mut c, mut m) = good();
        m.sensor_a[0] = 0.0;
        m.plate_position_m[2] = 9.0;
        m.plate_velocity_m_s[2] = 9.0;
        m.leg_speed_m_s = [9.0; 6];
        let motion = GuardLimits::LEG_SPEED | GuardLimits::PLATE_SPEED | GuardLimits::POSE;
        for (mode, passed) in [
            (RigMode::Track, motion | GuardLimits::SENSOR_A),
            (RigMode::Hold, GuardLimits::SENSOR_A),
            (RigMode::Retract, GuardLimits::SENSOR_A),
            (RigMode::Stop, GuardLimits::empty()),
            (RigMode::Idle, GuardLimits::empty()),
        ] {
            c.mode = mode as u32;
            assert_eq!(guard().passed(&c, &m), passed, "{mode:?}");
        }
    }
}
