//! A rig that follows every command exactly, with a spring between rack and plate: what the loop must
//! reproduce without any compensation, because G_I = 1.

use docktwin_core::{DQuat, DVec3, Pose, StateHasher, Twist, Wrench};
use docktwin_model::Rig;
use docktwin_physics::platform::Platform;

use crate::{
    port::{RigCommand, RigMeasurement, RigMode, status},
    rig::Plant,
};

/// Speed at which the plate draws back, m/s.
const RETRACT_M_S: f64 = 0.01;
/// By how much the force readings go up and down from tick to tick, N: a sensor that never changes
/// counts as dead.
const FLICKER_N: f64 = 1e-9;

/// A stick on the plate between two stops on the rack: (14) without damping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stops {
    /// Along which the stops act, or about which, unit vector in `e3`.
    pub axis: DVec3,
    /// `Some` for stops that act on a turn, at this lever, m; play and stiffness are meant there.
    pub lever_m: Option<f64>,
    /// Position of the origin of `e4` from that of `e3` in the middle between the stops, in `e3`, m.
    pub middle_m: DVec3,
    /// Free play to each side, m, not negative.
    pub free_play_m: f64,
    /// Stiffness of a stop, N/m; 0 for none.
    pub stiffness_n_m: f64,
}

impl Default for Stops {
    /// Table 4, rows 1 to 3, along the docking axis: 35.4 kN/m, ±10 mm.
    fn default() -> Self {
        Self {
            axis: DVec3::X,
            lever_m: None,
            middle_m: DVec3::ZERO,
            free_play_m: 0.010,
            stiffness_n_m: 35.4e3,
        }
    }
}

impl Stops {
    /// Wrench on what the plate carries, about the origin of `e4`, in axes of `e3`.
    #[must_use]
    pub fn wrench(&self, x_34: &Pose) -> Wrench {
        let x = match self.lever_m {
            None => (x_34.p - self.middle_m).dot(self.axis),
            Some(lever_m) => x_34.q.to_scaled_axis().dot(self.axis) * lever_m,
        };
        let depth_m = (x.abs() - self.free_play_m).max(0.0);
        let force = self.axis * (-x.signum() * self.stiffness_n_m * depth_m);
        match self.lever_m {
            None => Wrench { f: force, m: DVec3::ZERO },
            Some(lever_m) => Wrench { f: DVec3::ZERO, m: force * lever_m },
        }
    }
}

/// A rig without mass, delay or error.
///
/// Its sensors stand in `e3` (A) and `e4` (B) and weigh nothing, so they feel what the ports feel.
/// Its legs have the lengths of the plate's pose, whatever lengths are commanded. In [`RigMode::Idle`] it goes back to where it began, so that runs repeat.
#[derive(Clone, Debug)]
pub struct IdealRig {
    platform: Platform,
    stops: Stops,
    start: Pose,
    x_bp: Pose,
    twist: Twist,
    leg_force_n: [f64; 6],
    flicker_n: f64,
}

impl IdealRig {
    /// With the geometry of `rig` and its plate at `start`, `X_bp`.
    #[must_use]
    pub fn new(rig: &Rig, stops: Stops, start: Pose) -> Self {
        Self {
            platform: Platform::new(rig),
            stops,
            start,
            x_bp: start,
            twist: Twist::default(),
            leg_force_n: [0.0; 6],
            flicker_n: FLICKER_N,
        }
    }

    fn reset(&mut self) {
        self.rest();
        self.x_bp = self.start;
        self.leg_force_n = [0.0; 6];
        self.flicker_n = FLICKER_N;
    }

    fn rest(&mut self) {
        self.twist = Twist::default();
    }

    fn follow(&mut self, c: &RigCommand) {
        let [w, x, y, z] = c.plate_attitude;
        let q = DQuat::from_xyzw(x, y, z, w);
        self.x_bp = Pose::new(DVec3::from_array(c.plate_position_m), q);
        self.twist = Twist {
            v: DVec3::from_array(c.plate_velocity_m_s),
            w: DVec3::from_array(c.plate_rate_rad_s),
        };
        self.leg_force_n = c.leg_force_n;
    }

    fn retract(&mut self, period_s: f64) {
        // Away from the rack: +X of `e3` points from the active to the passive mechanism.
        let x_34 = self.platform.docking_from_plate(&self.x_bp);
        let back = Twist { v: DVec3::X * RETRACT_M_S, w: DVec3::ZERO };
        self.twist = self.platform.plate_twist(&x_34, &back);
        self.x_bp.p += self.twist.v * period_s;
    }

    /// Wrench on the chaser at `e3`, and on the target at `e4`, each in its own axes.
    fn ports(&self) -> (Wrench, Wrench) {
        let x_34 = self.platform.docking_from_plate(&self.x_bp);
        let on_target = self.stops.wrench(&x_34);
        ((-on_target).shifted(-x_34.p), on_target.rotated(x_34.q.conjugate()))
    }

    fn measure(&mut self, status: u32) -> RigMeasurement {
        let (f3, f4) = self.ports();
        let (f3, f4) = (array(f3.f, f3.m), array(f4.f, f4.m));
        let q = self.x_bp.q;
        let attitude = [q.w, q.x, q.y, q.z];
        let legs = self.platform.at(&self.x_bp);
        let mut m = RigMeasurement {
            status: status | status::TRUTH,
            leg_length_m: legs.length_m,
            leg_speed_m_s: legs.rates(&self.twist),
            leg_force_n: self.leg_force_n,
            sensor_a: f3,
            sensor_b: f4,
            truth_position_m: self.x_bp.p.to_array(),
            truth_attitude: attitude,
            truth_twist: array(self.twist.v, self.twist.w),
            truth_port3: f3,
            truth_port4: f4,
            ..RigMeasurement::zero()
        };
        self.flicker_n = -self.flicker_n;
        m.sensor_a[0] += self.flicker_n;
        m.sensor_b[0] += self.flicker_n;
        m.state_digest = digest(&m);
        m
    }
}

fn array(first: DVec3, second: DVec3) -> [f64; 6] {
    [first.x, first.y, first.z, second.x, second.y, second.z]
}

fn digest(m: &RigMeasurement) -> u64 {
    let mut h = StateHasher::new();
    let state = m.truth_position_m.iter().chain(&m.truth_attitude).chain(&m.truth_twist);
    for x in state.chain(&m.leg_length_m).chain(&m.leg_force_n) {
        h.f64(*x);
    }
    h.finish().short()
}

impl Plant for IdealRig {
    fn answer(&mut self, command: &RigCommand) -> RigMeasurement {
        let mode = RigMode::from_number(command.mode).unwrap_or(RigMode::Stop);
        match mode {
            RigMode::Idle => self.reset(),
            RigMode::Hold | RigMode::Stop => self.rest(),
            RigMode::Track => self.follow(command),
            #[expect(clippy::cast_precision_loss, reason = "a period is far below 2^53 ns")]
            RigMode::Retract => self.retract(command.period_ns as f64 * 1e-9),
        }
        self.measure(if mode == RigMode::Idle { 0 } else { status::ENABLED })
    }

    fn alone(&mut self, _period_ns: u64) -> RigMeasurement {
        self.rest();
        self.measure(status::ENABLED)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rig whose docking axis points up and whose plate is turned and shifted.
    fn tilted() -> (IdealRig, RigCommand) {
        let x_b3 = Pose::new(
            DVec3::new(0.25, -0.5, 4.0),
            DQuat::from_rotation_y(-core::f64::consts::FRAC_PI_2),
        );
        let x_4p = Pose::from_translation(DVec3::new(0.3, 0.1, 0.0));
        let x_34 = Pose::new(DVec3::new(0.03, 0.2, -0.1), DQuat::from_rotation_z(0.2));
        let x_bp = x_b3 * x_34 * x_4p;
        let mut c = RigCommand { period_ns: 1_000_000, ..RigCommand::zero() };
        c.mode = RigMode::Track as u32;
        c.plate_position_m = x_bp.p.to_array();
        c.plate_attitude = [x_bp.q.w, x_bp.q.x, x_bp.q.y, x_bp.q.z];
        c.plate_velocity_m_s = [0.1, 0.2, 0.3];
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/urdf/stewart.urdf");
        let mut rig = docktwin_model::load_rig(file.as_ref()).expect("the default rig").model;
        (rig.x_b0, rig.x_03, rig.x_4p) = (x_b3, Pose::IDENTITY, x_4p);
        (IdealRig::new(&rig, Stops::default(), x_b3 * x_4p), c)
    }

    fn wrench(x: &[f64; 6]) -> Wrench {
        Wrench { f: DVec3::new(x[0], x[1], x[2]), m: DVec3::new(x[3], x[4], x[5]) }
    }

    /// What both ports feel holds itself in balance, whatever the pose: moved to one point and turned
    /// to one frame, force and moment cancel.
    #[test]
    fn invariant_both_ports_are_in_balance() {
        let (mut rig, c) = tilted();
        let m = rig.answer(&c);
        let (f3, f4) = (wrench(&m.truth_port3), wrench(&m.truth_port4));
        assert!((f3.f - DVec3::X * 35.4e3 * 0.02).length() < 1e-6, "{f3:?}");
        let x_34 = rig.platform.docking_from_plate(&rig.x_bp);
        let at_3 = f4.rotated(x_34.q).shifted(-x_34.p);
        assert!((f3.f + at_3.f).length() < 1e-9 && (f3.m + at_3.m).length() < 1e-9);
    }

    #[test]
    fn invariant_it_draws_back_along_the_docking_axis_and_rests_when_alone() {
        let (mut rig, mut c) = tilted();
        let before = DVec3::from_array(rig.answer(&c).truth_position_m);
        c.mode = RigMode::Retract as u32;
        let m = rig.answer(&c);
        let gone = DVec3::from_array(m.truth_position_m) - before;
        assert!((gone - DVec3::Z * RETRACT_M_S * 1e-3).length() < 1e-12, "{gone:?}");
        let m = rig.alone(1_000_000);
        assert_eq!(m.truth_twist.map(f64::to_bits), [0; 6]);
        assert!((DVec3::from_array(m.truth_position_m) - before - gone).length() < 1e-15);
    }

    #[test]
    fn oracle_stops_push_back_beyond_the_free_play_alone() {
        let stops = Stops::default();
        let turning = Stops { axis: DVec3::Y, lever_m: Some(0.5), ..stops };
        for (x_m, force_n) in
            [(0.0, 0.0), (0.01, 0.0), (-0.009, 0.0), (0.011, -35.4), (-0.02, 354.0)]
        {
            let w = stops.wrench(&Pose::from_translation(DVec3::new(x_m, 1.0, 2.0)));
            assert!((w.f - DVec3::X * force_n).length() + w.m.length() < 1e-9, "{x_m} m: {w:?}");
            let turned = Pose::new(DVec3::splat(1.0), DQuat::from_rotation_y(x_m / 0.5));
            let w = turning.wrench(&turned);
            let moment = DVec3::Y * force_n * 0.5;
            assert!((w.m - moment).length() + w.f.length() < 1e-9, "{x_m} m: {w:?}");
        }
    }
}
