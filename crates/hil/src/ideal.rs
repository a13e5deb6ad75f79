//! A rig that follows every command exactly, with a spring between rack and plate: what the loop must
//! reproduce without any compensation, because G_I = 1.

use docktwin_core::{DVec3, Pose, StateHasher, Twist, Wrench};
use docktwin_model::{Rig, Stick};
use docktwin_physics::{platform::Platform, stick::StickContact};
use docktwin_rigport::{
    message::{Capabilities, LEGS, RigCommand, RigMeasurement, RigMode, Status, attitude, six},
    rig::{CommandForm, Plant},
};

/// Speed at which the plate draws back, m/s, and how far from the middle, m: in the play of its stick
/// nothing touches.
const RETRACT_M_S: f64 = 0.01;
const RETRACT_M: f64 = 0.008;
/// By how much the force readings go up and down from tick to tick, N: a sensor that never changes
/// counts as dead.
const FLICKER_N: f64 = 1e-9;

/// A rig without mass, delay or error.
///
/// Its sensors stand in `e3` (A) and `e4` (B) and carry nothing, so they measure the wrenches at the ports.
/// It takes commands with leg values and without; its legs have the lengths of the plate's pose, whatever
/// lengths are commanded. In [`RigMode::Idle`]
/// it goes back to where it began, so that runs repeat.
#[derive(Clone, Debug)]
pub struct IdealRig {
    platform: Platform,
    stick: Stick,
    docked_m: f64,
    start: Pose,
    x_bp: Pose,
    twist: Twist,
    leg_force_n: [f64; 6],
    flicker_n: f64,
}

impl IdealRig {
    /// With the geometry of `rig` and its plate at `start`, `X_bp`; the stick stands in the middle of its
    /// frame at `docked_m` between the mounting planes.
    #[must_use]
    pub fn new(rig: &Rig, stick: Stick, docked_m: f64, start: Pose) -> Self {
        Self {
            platform: Platform::new(rig),
            stick,
            docked_m,
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
        (self.x_bp, self.twist) = (c.plate(), c.plate_twist());
        self.leg_force_n = c.leg_force_n;
    }

    fn retract(&mut self, period_s: f64) {
        // Away from the rack: +X of `e3` points from the active to the passive mechanism.
        let x_34 = self.platform.docking_from_plate(&self.x_bp);
        if x_34.p.x > self.docked_m + RETRACT_M {
            self.rest();
            return;
        }
        let back = Twist { v: DVec3::X * RETRACT_M_S, w: DVec3::ZERO };
        self.twist = self.platform.plate_twist(&x_34, &back);
        self.x_bp.p += self.twist.v * period_s;
    }

    /// Wrench on the chaser at `e3`, and on the target at `e4`, each in its own axes.
    fn ports(&self) -> (Wrench, Wrench) {
        let x_34 = self.platform.docking_from_plate(&self.x_bp);
        let stick = StickContact::measure(&self.stick, self.docked_m, &x_34);
        let on_target = Wrench { f: stick.force_n, m: stick.couple_nm };
        ((-on_target).shifted(-x_34.p), on_target.rotated(x_34.q.conjugate()))
    }

    fn measure(&mut self, status: Status) -> RigMeasurement {
        let (f3, f4) = self.ports();
        let (f3, f4) = (six(f3.f, f3.m), six(f4.f, f4.m));
        let legs = self.platform.at(&self.x_bp);
        let mut m = RigMeasurement {
            status,
            capabilities: HOLDS,
            leg_count: LEGS as u32,
            leg_length_m: legs.length_m,
            leg_speed_m_s: legs.rates(&self.twist),
            leg_force_n: self.leg_force_n,
            sensor_a: f3,
            sensor_b: f4,
            truth_position_m: self.x_bp.p.to_array(),
            truth_attitude: attitude(self.x_bp.q),
            truth_twist: six(self.twist.v, self.twist.w),
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

fn digest(m: &RigMeasurement) -> u64 {
    let mut h = StateHasher::new();
    let state = m.truth_position_m.iter().chain(&m.truth_attitude).chain(&m.truth_twist);
    for x in state.chain(&m.leg_length_m).chain(&m.leg_force_n) {
        h.f64(*x);
    }
    h.finish().short()
}

/// What of its measurements holds.
const HOLDS: Capabilities = Capabilities::LEG_LENGTH
    .union(Capabilities::LEG_SPEED)
    .union(Capabilities::LEG_FORCE)
    .union(Capabilities::SENSOR_A)
    .union(Capabilities::SENSOR_B)
    .union(Capabilities::TRUTH);

impl Plant for IdealRig {
    fn command_form(&self) -> CommandForm {
        CommandForm::EITHER
    }

    fn answer(&mut self, command: &RigCommand) -> RigMeasurement {
        let mode = RigMode::from_number(command.mode).unwrap_or(RigMode::Stop);
        match mode {
            RigMode::Idle => self.reset(),
            RigMode::Hold | RigMode::Stop => self.rest(),
            RigMode::Track => self.follow(command),
            #[expect(clippy::cast_precision_loss, reason = "a period is far below 2^53 ns")]
            RigMode::Retract => self.retract(command.period_ns as f64 * 1e-9),
        }
        self.measure(if mode == RigMode::Idle { Status::empty() } else { Status::ENABLED })
    }

    fn alone(&mut self, _period_ns: u64) -> RigMeasurement {
        self.rest();
        self.measure(Status::ENABLED)
    }
}

#[cfg(test)]
mod tests {
    use docktwin_core::DQuat;
    use docktwin_rigport::message::wrench;

    use super::*;

    const STICK: Stick =
        Stick { stiffness_n_m: 35.4e3, diameter_m: 0.0075, frame_opening_m: 0.0275, lever_m: 0.5 };

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
        c.plate_attitude = attitude(x_bp.q);
        c.plate_velocity_m_s = [0.1, 0.2, 0.3];
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/urdf/stewart.urdf");
        let mut rig = docktwin_model::load_rig(file.as_ref()).expect("the default rig").model;
        (rig.x_b0, rig.x_03, rig.x_4p) = (x_b3, Pose::IDENTITY, x_4p);
        (IdealRig::new(&rig, STICK, 0.0, x_b3 * x_4p), c)
    }

    /// The wrenches at both ports balance each other, whatever the pose: moved to one point and turned
    /// to one frame, force and moment cancel.
    #[test]
    fn invariant_both_ports_are_in_balance() {
        let (mut rig, c) = tilted();
        let m = rig.answer(&c);
        let (f3, f4) = (wrench(&m.truth_port3), wrench(&m.truth_port4));
        assert!((f3.f.x - 35.4e3 * 0.02).abs() < 1e-6, "{f3:?}");
        let x_34 = rig.platform.docking_from_plate(&rig.x_bp);
        let at_3 = f4.rotated(x_34.q).shifted(-x_34.p);
        assert!((f3.f + at_3.f).length() < 1e-9 && (f3.m + at_3.m).length() < 1e-9);
    }

    #[test]
    fn invariant_it_draws_back_along_the_docking_axis_and_rests_when_alone() {
        let (mut rig, mut c) = tilted();
        // Below where it comes to rest.
        c.plate_position_m[2] -= 0.04;
        let before = DVec3::from_array(rig.answer(&c).truth_position_m);
        c.mode = RigMode::Retract as u32;
        let m = rig.answer(&c);
        let gone = DVec3::from_array(m.truth_position_m) - before;
        assert!((gone - DVec3::Z * RETRACT_M_S * 1e-3).length() < 1e-12, "{gone:?}");
        let m = rig.alone(1_000_000);
        assert_eq!(m.truth_twist.map(f64::to_bits), [0; 6]);
        assert!((DVec3::from_array(m.truth_position_m) - before - gone).length() < 1e-15);
    }
}
