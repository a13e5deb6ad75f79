//! The motion simulator's platform: kinematics, dynamics of the reduced rig, maps.
//!
//! Everything is in `eb`, the ground of the rig, unless its name says otherwise. The twist of the
//! plate is the velocity of the origin of `ep` and the plate's angular velocity; its acceleration
//! (also a [`Twist`]) is the time derivative of both; a wrench on the plate is about the origin of
//! `ep`. Six-vectors have force or velocity first, moment or angular velocity after. A leg's force is
//! positive when the leg pushes, its rate positive when it grows.
//!
//! Allocation-free; errors are `Copy`.

mod dynamics;
pub mod maps;

use docktwin_core::{DQuat, DVec3, Pose, Twist, Wrench};
use docktwin_model::{Rig, RigidMass};
use nalgebra::{Matrix6, Vector6};

/// Newton steps after which forward kinematics gives up.
pub const MOST_NEWTON_STEPS: u32 = 12;

/// A Newton step smaller than this, m and rad, is the last: the next would be of the order of its
/// square over the length of a leg, 1e-13.
const LAST_NEWTON_STEP: f64 = 1e-6;

/// A rig as its kinematics and its reduced dynamics need it.
#[derive(Clone, Debug)]
pub struct Platform {
    /// `X_b3`, and its counterpart on the plate.
    x_b3: Pose,
    x_4p: Pose,
    middle: Pose,
    gravity: DVec3,
    plate: RigidMass,
    legs: [dynamics::LegBody; 6],
    /// Mean distance of the plate joints from their middle, m.
    plate_radius_m: f64,
    strokes_m: [[f64; 2]; 6],
}

/// Forward kinematics without answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ForwardError {
    /// The Jacobian cannot be inverted on the way.
    Singular,
    /// No pose with these leg lengths near the one that was given.
    NotFound {
        /// Largest difference of a leg's length where the search ended, m.
        residual_m: f64,
    },
}

/// What forward kinematics found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forward {
    /// Plate in the ground.
    pub x_bp: Pose,
    /// Newton steps taken.
    pub steps: u32,
}

impl Platform {
    /// Takes what is needed from a rig.
    #[must_use]
    pub fn new(rig: &Rig) -> Self {
        let centre = rig.legs.iter().map(|l| l.plate_joint_m).sum::<DVec3>() / 6.0;
        let radius = rig.legs.iter().map(|l| (l.plate_joint_m - centre).length()).sum::<f64>();
        Self {
            x_b3: rig.x_b0 * rig.x_03,
            x_4p: rig.x_4p,
            middle: rig.middle(),
            gravity: rig.gravity_m_s2,
            plate: rig.plate,
            legs: rig.legs.each_ref().map(dynamics::LegBody::new),
            plate_radius_m: radius / 6.0,
            strokes_m: rig.legs.each_ref().map(|l| [l.shortest_m, l.longest_m]),
        }
    }

    /// Mean distance of the plate joints from their middle, m.
    #[must_use]
    pub const fn plate_radius_m(&self) -> f64 {
        self.plate_radius_m
    }

    /// Plate in the middle of the docking workspace, `X_bp`.
    #[must_use]
    pub fn middle(&self) -> Pose {
        self.middle
    }

    /// `X_bp` of the plate at which the mechanisms have the relative pose `X_34`:
    /// `X_0p = X_03 · X_34 · X_4p`, seen from the ground.
    #[must_use]
    pub fn plate_from_docking(&self, x_34: &Pose) -> Pose {
        self.x_b3 * *x_34 * self.x_4p
    }

    /// `X_34` that the mechanisms see with the plate at `X_bp`.
    #[must_use]
    pub fn docking_from_plate(&self, x_bp: &Pose) -> Pose {
        self.x_b3.inverse() * *x_bp * self.x_4p.inverse()
    }

    /// Twist of the plate for a relative twist: velocity of the origin of `e4` and angular velocity
    /// of `e4`, both against `e3` and in its axes.
    #[must_use]
    pub fn plate_twist(&self, x_34: &Pose, twist_34: &Twist) -> Twist {
        let arm = x_34.q * self.x_4p.p;
        let v = twist_34.v + twist_34.w.cross(arm);
        Twist { v: self.x_b3.q * v, w: self.x_b3.q * twist_34.w }
    }

    /// Relative twist, as in [`Platform::plate_twist`], with the plate at `x_bp` moving so.
    #[must_use]
    pub fn docking_twist(&self, x_bp: &Pose, twist: &Twist) -> Twist {
        let arm = self.arm_from_e4(x_bp);
        let back = self.x_b3.q.conjugate();
        Twist { v: back * (twist.v - twist.w.cross(arm)), w: back * twist.w }
    }

    /// Acceleration of the plate for a relative twist and its time derivative in `e3`.
    #[must_use]
    pub fn plate_acceleration(&self, x_34: &Pose, twist_34: &Twist, rate_34: &Twist) -> Twist {
        let arm = x_34.q * self.x_4p.p;
        let w = twist_34.w;
        let a = rate_34.v + rate_34.w.cross(arm) + w.cross(w.cross(arm));
        Twist { v: self.x_b3.q * a, w: self.x_b3.q * rate_34.w }
    }

    /// The wrench F4, M4 (in `e4`, about its origin) as a wrench on the plate.
    #[must_use]
    pub fn wrench_from_port(&self, x_bp: &Pose, port: &Wrench) -> Wrench {
        // The arm from the origin of ep to the origin of e4.
        port.rotated(x_bp.q * self.x_4p.q.conjugate()).shifted(self.arm_from_e4(x_bp))
    }

    /// From the origin of `e4` to the origin of `ep`, in `eb`.
    fn arm_from_e4(&self, x_bp: &Pose) -> DVec3 {
        x_bp.q * (self.x_4p.q.conjugate() * self.x_4p.p)
    }

    /// Inverse kinematics: the legs with the plate at `X_bp`, exact.
    #[must_use]
    pub fn at(&self, x_bp: &Pose) -> Configuration {
        let mut c = Configuration {
            x_bp: *x_bp,
            arm: [DVec3::ZERO; 6],
            unit: [DVec3::ZERO; 6],
            length_m: [0.0; 6],
        };
        for (i, leg) in self.legs.iter().enumerate() {
            c.arm[i] = x_bp.q * leg.plate_joint;
            let vector = x_bp.p + c.arm[i] - leg.base_joint;
            c.length_m[i] = vector.length();
            c.unit[i] = vector / c.length_m[i];
        }
        c
    }

    /// Forward kinematics: the pose with these leg lengths that Newton's method finds from a pose
    /// near it, in general the last one.
    ///
    /// # Errors
    /// There is none near, or a singular pose lies on the way.
    pub fn forward(&self, lengths_m: &[f64; 6], from: &Pose) -> Result<Forward, ForwardError> {
        let mut x = *from;
        for steps in 1..=MOST_NEWTON_STEPS {
            let c = self.at(&x);
            let mut short = [0.0; 6];
            for i in 0..6 {
                short[i] = lengths_m[i] - c.length_m[i];
            }
            let step = solve(c.rows(), short).ok_or(ForwardError::Singular)?;
            let turn = DVec3::new(step[3], step[4], step[5]);
            x.p += DVec3::new(step[0], step[1], step[2]);
            x.q = (DQuat::from_scaled_axis(turn) * x.q).normalize();
            let largest = step.iter().fold(0.0_f64, |a, s| a.max(s.abs()));
            // A maximum passes over NaN, a pose does not.
            if !x.is_finite() {
                break;
            }
            if largest < LAST_NEWTON_STEP {
                return Ok(Forward { x_bp: x, steps });
            }
        }
        let c = self.at(&x);
        let miss = (0..6).map(|i| (lengths_m[i] - c.length_m[i]).abs());
        let residual_m = miss.fold(0.0, |a: f64, d| if a > d { a } else { d });
        Err(ForwardError::NotFound { residual_m })
    }

    /// Least room of each leg to either end of its stroke, m; negative beyond it.
    #[must_use]
    pub fn stroke_margins_m(&self, lengths_m: &[f64; 6]) -> [f64; 6] {
        core::array::from_fn(|i| {
            let [shortest, longest] = self.strokes_m[i];
            (lengths_m[i] - shortest).min(longest - lengths_m[i])
        })
    }

    /// Least singular value of the Jacobian with moments over the radius of the plate joints: 0 in a
    /// singular pose, where a motion of the plate changes no leg's length.
    #[must_use]
    pub fn singularity(&self, c: &Configuration) -> f64 {
        let mut j = c.jacobian();
        for mut column in j.column_iter_mut().skip(3) {
            column /= self.plate_radius_m;
        }
        // Least eigenvalue of J Jᵀ; rounding may leave it just below 0.
        (j * j.transpose()).symmetric_eigenvalues().min().max(0.0).sqrt()
    }
}

/// The legs at one pose of the plate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Configuration {
    /// Plate in the ground.
    pub x_bp: Pose,
    /// From the origin of `ep` to each plate joint, in `eb`, m.
    pub arm: [DVec3; 6],
    /// Direction of each leg from base to plate, in `eb`.
    pub unit: [DVec3; 6],
    /// Length of each leg from joint to joint, m.
    pub length_m: [f64; 6],
}

impl Configuration {
    /// Rows `[ûᵀ, (r × û)ᵀ]`.
    fn rows(&self) -> [[f64; 6]; 6] {
        core::array::from_fn(|i| {
            let (u, m) = (self.unit[i], self.arm[i].cross(self.unit[i]));
            [u.x, u.y, u.z, m.x, m.y, m.z]
        })
    }

    /// Jacobian: leg rates from the twist of the plate.
    #[must_use]
    pub fn jacobian(&self) -> Matrix6<f64> {
        let rows = self.rows();
        Matrix6::from_fn(|i, j| rows[i][j])
    }

    /// Leg rates, m/s.
    #[must_use]
    pub fn rates(&self, twist: &Twist) -> [f64; 6] {
        core::array::from_fn(|i| self.unit[i].dot(self.joint_velocity(i, twist)))
    }

    /// Leg accelerations, m/s².
    #[must_use]
    pub fn accelerations(&self, twist: &Twist, acceleration: &Twist) -> [f64; 6] {
        core::array::from_fn(|i| {
            let v = self.joint_velocity(i, twist);
            let along = self.unit[i].dot(v);
            // The leg turns: what moves across it makes it longer.
            let across = (v.length_squared() - along * along) / self.length_m[i];
            self.unit[i].dot(self.joint_acceleration(i, twist, acceleration)) + across
        })
    }

    fn joint_velocity(&self, i: usize, twist: &Twist) -> DVec3 {
        twist.v + twist.w.cross(self.arm[i])
    }

    fn joint_acceleration(&self, i: usize, twist: &Twist, acceleration: &Twist) -> DVec3 {
        let w = twist.w;
        acceleration.v + acceleration.w.cross(self.arm[i]) + w.cross(w.cross(self.arm[i]))
    }

    /// Twist of the plate from leg rates; `None` in a singular pose.
    #[must_use]
    pub fn twist(&self, rates_m_s: &[f64; 6]) -> Option<Twist> {
        let t = solve(self.rows(), *rates_m_s)?;
        Some(Twist { v: DVec3::new(t[0], t[1], t[2]), w: DVec3::new(t[3], t[4], t[5]) })
    }

    /// Wrench of leg forces on the plate, `JᵀF`.
    #[must_use]
    pub fn wrench(&self, forces_n: &[f64; 6]) -> Wrench {
        let mut w = Wrench::ZERO;
        for (i, force) in forces_n.iter().enumerate() {
            w.push(self.arm[i], self.unit[i] * *force);
        }
        w
    }

    /// Leg forces that make a wrench on the plate, `J⁻ᵀW`; `None` in a singular pose.
    #[must_use]
    pub fn leg_forces(&self, wrench: &Wrench) -> Option<[f64; 6]> {
        let rows = self.rows();
        let columns = core::array::from_fn(|i| core::array::from_fn(|j| rows[j][i]));
        solve(columns, [wrench.f.x, wrench.f.y, wrench.f.z, wrench.m.x, wrench.m.y, wrench.m.z])
    }
}

/// `A x = b` by elimination with row exchange; `None` when `A` is singular to rounding.
///
/// Own code instead of the LU decomposition of nalgebra, because forward kinematics spends most of
/// its time here.
fn solve(mut a: [[f64; 6]; 6], mut b: [f64; 6]) -> Option<[f64; 6]> {
    for k in 0..6 {
        let mut pivot = k;
        for i in k + 1..6 {
            if a[i][k].abs() > a[pivot][k].abs() {
                pivot = i;
            }
        }
        let size = a[pivot][k].abs();
        if size.is_nan() || size <= 1e-12 {
            return None;
        }
        a.swap(k, pivot);
        b.swap(k, pivot);
        let inverse = 1.0 / a[k][k];
        for i in k + 1..6 {
            let f = a[i][k] * inverse;
            let above = a[k];
            for (below, above) in a[i].iter_mut().zip(above).skip(k + 1) {
                *below -= f * above;
            }
            b[i] -= f * b[k];
        }
    }
    let mut x = [0.0; 6];
    for k in (0..6).rev() {
        let mut sum = b[k];
        for j in k + 1..6 {
            sum -= a[k][j] * x[j];
        }
        x[k] = sum / a[k][k];
    }
    Some(x)
}

fn six(twist: &Twist) -> Vector6<f64> {
    Vector6::new(twist.v.x, twist.v.y, twist.v.z, twist.w.x, twist.w.y, twist.w.z)
}

fn six_of(wrench: &Wrench) -> Vector6<f64> {
    Vector6::new(wrench.f.x, wrench.f.y, wrench.f.z, wrench.m.x, wrench.m.y, wrench.m.z)
}

fn twist_of(v: &Vector6<f64>) -> Twist {
    Twist { v: DVec3::new(v[0], v[1], v[2]), w: DVec3::new(v[3], v[4], v[5]) }
}
