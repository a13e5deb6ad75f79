//! What a rig can do, over its docking workspace: reach, natural frequencies, accuracy, payload.
//!
//! Degrees of freedom are those of docking: X, Y, Z of the origin of `e4` in the axes of `e3`, then
//! roll, pitch and yaw about that origin. Stiffness is that of the oil springs, (10), the same in
//! every leg and at every stroke; the valve is closed. The stiffness that preloaded legs have across
//! themselves (a leg's force over its length, some kN/m against tens of MN/m) is left out.

use core::f64::consts::TAU;

use docktwin_core::{DMat3, DQuat, DVec3, Pose, Wrench};
use docktwin_model::{DockingWorkspace, Place, Rig};
use nalgebra::{Matrix6, SymmetricEigen, Vector6};

use super::{Configuration, Platform};

/// The paper's positional tolerance, m: ±1.27 mm.
pub const PAPER_POSITION_M: f64 = 1.27e-3;
/// The paper's tolerance of attitude, rad: ±0.10°.
pub const PAPER_ATTITUDE_RAD: f64 = 0.10 * TAU / 360.0;
/// The paper's payload, kg.
pub const PAPER_PAYLOAD_KG: f64 = 1135.0;

/// The fastest approach that the paper asks for (3.1), per degree of freedom: m/s and rad/s.
pub const PAPER_RATES: [f64; 6] = [0.35, 0.10, 0.10, TAU / 360.0, TAU / 360.0, TAU / 360.0];

/// Stiffness between plate and rack at the origin of `e4`: N/m along X, Y, Z of `e3`, N·m/rad about
/// them. Zero is a plate that touches nothing.
pub type PayloadStiffness = [f64; 6];

/// Reach in one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Length of every leg, m.
    pub lengths_m: [f64; 6],
    /// Least room of a leg to an end of its stroke, m; negative out of reach.
    pub stroke_margin_m: f64,
    /// Leg with the least room.
    pub leg: usize,
    /// Least room of a universal or spherical joint, rad; negative out of reach.
    pub joint_margin_rad: f64,
    /// Least singular value of the Jacobian, moments over the radius of the plate joints.
    pub singularity: f64,
}

impl Reach {
    /// Whether every stroke and every joint has room.
    #[must_use]
    pub fn reached(&self) -> bool {
        self.stroke_margin_m >= 0.0 && self.joint_margin_rad >= 0.0
    }
}

/// Whether the docking workspace fits into the reachable one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workspace {
    /// Shortest and longest length of every leg over the docking workspace, m.
    pub legs_m: [[f64; 2]; 6],
    /// Shortest and longest of all legs there, m.
    pub lengths_m: [f64; 2],
    /// Stroke that the docking workspace needs, m: the largest over the legs.
    pub stroke_m: f64,
    /// Where a stroke has least room, and how much, m.
    pub stroke_margin_m: (f64, Place),
    /// Where a joint has least room, and how much, rad.
    pub joint_margin_rad: (f64, Place),
    /// Fastest leg when the mechanisms move with [`PAPER_RATES`] in the worst signs, m/s, and where.
    pub fastest_leg_m_s: (f64, Place),
    /// Where the platform is nearest to a singular pose, and the least singular value there.
    pub singularity: (f64, Place),
    /// The same in the middle.
    pub singularity_in_the_middle: f64,
    /// How far a single degree of freedom goes from the middle, down and up: m and rad.
    pub range: [[f64; 2]; 6],
}

/// The platform's six modes on its oil springs in one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Modes {
    /// Natural frequencies, rising, Hz.
    pub frequency_hz: [f64; 6],
    /// Columns are the modes' shapes in the degrees of freedom of docking, scaled so that
    /// `sᵀ M s = 1`.
    pub shape: Matrix6<f64>,
    /// For every degree of freedom its natural frequency while the other five are held, Hz:
    /// `√(K_jj / M_jj)`.
    pub held_hz: [f64; 6],
    /// For every degree of freedom the mode to whose kinetic energy it contributes the largest part.
    pub leading: [usize; 6],
    /// Static stiffness at the origin of `e4` against a single force or moment, the others free:
    /// N/m and N·m/rad, `1 / (K⁻¹)_jj`.
    pub stiffness: [f64; 6],
}

/// Least and greatest value over the docking workspace, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Least value and its place.
    pub least: (f64, Place),
    /// Greatest value and its place.
    pub greatest: (f64, Place),
}

impl Span {
    const EMPTY: Self = Self {
        least: (f64::INFINITY, Place([0.0; 6])),
        greatest: (f64::NEG_INFINITY, Place([0.0; 6])),
    };

    fn add(&mut self, value: f64, place: Place) {
        if value < self.least.0 {
            self.least = (value, place);
        }
        if value > self.greatest.0 {
            self.greatest = (value, place);
        }
    }
}

/// Natural frequencies over the docking workspace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrequencyMap {
    /// In the middle.
    pub middle: Modes,
    /// Every degree of freedom, the others held, Hz.
    pub held_hz: [Span; 6],
    /// Every mode, counted from the lowest, Hz.
    pub mode_hz: [Span; 6],
    /// Effective masses in the middle, rising, kg.
    pub effective_mass_middle_kg: [f64; 6],
    /// Least and greatest effective mass over the workspace, kg.
    pub effective_mass_kg: Span,
    /// Static stiffness at the origin of `e4`, N/m and N·m/rad.
    pub stiffness: [Span; 6],
}

/// What load the legs must be able to move beside their own weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Acceleration of the plate in any direction, m/s².
    pub acceleration_m_s2: f64,
    /// Force at the origin of `e4` in any direction, N.
    pub port_force_n: f64,
}

impl Demand {
    /// The paper's requirement of 10 Hz at an amplitude of 2 mm.
    pub const AT_10_HZ: Self =
        Self { acceleration_m_s2: 2e-3 * (10.0 * TAU) * (10.0 * TAU), port_force_n: 0.0 };
    /// Standing still.
    pub const AT_REST: Self = Self { acceleration_m_s2: 0.0, port_force_n: 0.0 };
}

/// Tolerance, range and payload of a rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capability {
    /// Largest error of X, Y, Z at the origin of `e4`, m, when every leg's length is wrong by at most
    /// [`docktwin_model::LegLimits::length_error_m`] in the worst combination.
    pub position_error_m: f64,
    /// Largest error of roll, pitch and yaw, rad, likewise.
    pub attitude_error_rad: f64,
    /// Error of the legs' lengths that just keeps the paper's ±1.27 mm and ±0.10°, m.
    pub leg_error_allowed_m: f64,
    /// How far a single degree of freedom goes from the middle, down and up: m and rad.
    pub range: [[f64; 2]; 6],
    /// Mass that can be added at the origin of `e4` before a leg needs more than its force, kg, and
    /// where: standing still.
    pub payload_at_rest_kg: (f64, Place),
    /// The same while the plate moves with 2 mm at 10 Hz in any direction.
    pub payload_at_10_hz_kg: (f64, Place),
}

/// Maps of one rig.
#[derive(Clone, Debug)]
pub struct Maps<'a> {
    rig: &'a Rig,
    platform: Platform,
    middle: Pose,
}

impl<'a> Maps<'a> {
    /// For a rig.
    #[must_use]
    pub fn new(rig: &'a Rig) -> Self {
        Self { rig, platform: Platform::new(rig), middle: rig.middle() }
    }

    /// The platform that the maps are of.
    #[must_use]
    pub fn platform(&self) -> &Platform {
        &self.platform
    }

    /// The legs at a place of the docking workspace.
    #[must_use]
    pub fn at(&self, place: Place) -> Configuration {
        self.platform.at(&self.rig.plate_from_docking(&self.rig.docking.pose(place.0)))
    }

    /// Reach with the plate at `X_bp`.
    #[must_use]
    pub fn reach(&self, x_bp: &Pose) -> Reach {
        let c = self.platform.at(x_bp);
        let margins = self.platform.stroke_margins_m(&c.length_m);
        let leg = (0..6).min_by(|a, b| margins[*a].total_cmp(&margins[*b])).unwrap_or(0);
        let mut joint_margin_rad = f64::INFINITY;
        for (i, leg) in self.rig.legs.iter().enumerate() {
            let v = c.unit[i] * c.length_m[i];
            let [q1, q2] = leg.universal_angles(v);
            let ball = leg.ball_limit_rad - leg.ball_angle(x_bp, &self.middle, v);
            let swing = leg.swing_limit_rad - q1.abs().max(q2.abs());
            joint_margin_rad = joint_margin_rad.min(ball).min(swing);
        }
        Reach {
            lengths_m: c.length_m,
            stroke_margin_m: margins[leg],
            leg,
            joint_margin_rad,
            singularity: self.platform.singularity(&c),
        }
    }

    /// Relative pose displaced from the middle: metres along X3, Y3, Z3, then a rotation vector in
    /// `e3`, rad.
    #[must_use]
    pub fn displaced(&self, offset_m: DVec3, turn_rad: DVec3) -> Pose {
        let x_34 =
            Pose::new(self.rig.docking.middle_m + offset_m, DQuat::from_scaled_axis(turn_rad));
        self.rig.plate_from_docking(&x_34)
    }

    /// Whether the plate can be there: strokes and joints have room, and no singular pose is near.
    fn reached(&self, x_bp: &Pose) -> bool {
        let r = self.reach(x_bp);
        r.reached() && r.singularity > 0.02
    }

    /// How far the plate goes from the middle along a direction (as [`Maps::displaced`], of any
    /// length) until a stroke or a joint ends, or it comes near a singular pose: a factor of the
    /// direction, at most `most`, to 1e-4 of a step of a hundredth of `most`. The first end counts:
    /// what lies beyond cannot be reached on this way.
    #[must_use]
    pub fn reach_along(&self, offset_m: DVec3, turn_rad: DVec3, most: f64) -> f64 {
        first_end(most, |s| self.reached(&self.displaced(offset_m * s, turn_rad * s)))
    }

    /// As [`Maps::reach_along`], with the attitude `R_34` all the way; 0 where the middle itself
    /// cannot be reached in it.
    #[must_use]
    pub fn reach_turned(&self, offset_m: DVec3, attitude: DQuat, most: f64) -> f64 {
        first_end(most, |s| {
            let x_34 = Pose::new(self.rig.docking.middle_m + offset_m * s, attitude);
            self.reached(&self.rig.plate_from_docking(&x_34))
        })
    }

    /// Factor of all half-widths of the docking workspace up to which its 729 places (edges, faces
    /// and corners) are in reach, at most `most`.
    #[must_use]
    pub fn growth(&self, most: f64) -> f64 {
        first_end(most, |s| {
            DockingWorkspace::grid().all(|place| {
                let x_34 = self.rig.docking.pose(place.0.map(|x| x * s));
                self.reached(&self.rig.plate_from_docking(&x_34))
            })
        })
    }

    /// How far every single degree of freedom goes from the middle, down and up: m and rad.
    #[must_use]
    pub fn range(&self) -> [[f64; 2]; 6] {
        core::array::from_fn(|i| {
            let axis = DVec3::AXES[i % 3];
            let (offset, turn) = if i < 3 { (axis, DVec3::ZERO) } else { (DVec3::ZERO, axis) };
            // 3 m and a little less than half a turn are beyond any rig of this kind.
            [-self.reach_along(-offset, -turn, 3.0), self.reach_along(offset, turn, 3.0)]
        })
    }

    /// Fig. 30: whether the docking workspace fits, and with what room, over the 729 places of its
    /// grid of three (64 corners among them).
    #[must_use]
    pub fn workspace(&self) -> Workspace {
        let mut w = Workspace {
            legs_m: [[f64::INFINITY, 0.0]; 6],
            lengths_m: [f64::INFINITY, 0.0],
            stroke_m: 0.0,
            stroke_margin_m: (f64::INFINITY, Place([0.0; 6])),
            joint_margin_rad: (f64::INFINITY, Place([0.0; 6])),
            fastest_leg_m_s: (0.0, Place([0.0; 6])),
            singularity: (f64::INFINITY, Place([0.0; 6])),
            singularity_in_the_middle: self.reach(&self.middle).singularity,
            range: self.range(),
        };
        for place in DockingWorkspace::grid() {
            let c = self.at(place);
            let rows = c.jacobian() * self.docking_to_plate(&c);
            for i in 0..6 {
                let speed = (0..6).map(|j| rows[(i, j)].abs() * PAPER_RATES[j]).sum();
                if speed > w.fastest_leg_m_s.0 {
                    w.fastest_leg_m_s = (speed, place);
                }
            }
            let r = self.reach(&c.x_bp);
            for (leg, l) in w.legs_m.iter_mut().zip(r.lengths_m) {
                *leg = [leg[0].min(l), leg[1].max(l)];
            }
            if r.stroke_margin_m < w.stroke_margin_m.0 {
                w.stroke_margin_m = (r.stroke_margin_m, place);
            }
            if r.joint_margin_rad < w.joint_margin_rad.0 {
                w.joint_margin_rad = (r.joint_margin_rad, place);
            }
            if r.singularity < w.singularity.0 {
                w.singularity = (r.singularity, place);
            }
        }
        for [short, long] in w.legs_m {
            w.lengths_m = [w.lengths_m[0].min(short), w.lengths_m[1].max(long)];
            w.stroke_m = w.stroke_m.max(long - short);
        }
        w
    }

    /// Twist of the plate from the rates of the degrees of freedom of docking: `t = T q̇`.
    fn docking_to_plate(&self, c: &Configuration) -> Matrix6<f64> {
        let r = DMat3::from_quat(self.platform.x_b3.q);
        let arm = self.platform.arm_from_e4(&c.x_bp);
        let mut t = Matrix6::zeros();
        for j in 0..3 {
            let axis = r.col(j);
            let v = axis.cross(arm);
            for i in 0..3 {
                t[(i, j)] = axis[i];
                t[(i + 3, j + 3)] = axis[i];
                t[(i, j + 3)] = v[i];
            }
        }
        t
    }

    /// Modes on springs of `leg_n_m` in every leg, the load between plate and rack having a
    /// stiffness of its own, (11). `None` in a singular pose.
    #[must_use]
    pub fn modes(
        &self,
        c: &Configuration,
        leg_n_m: f64,
        payload: &PayloadStiffness,
    ) -> Option<Modes> {
        let t = self.docking_to_plate(c);
        let mass = t.transpose() * self.platform.mass_matrix(c) * t;
        let j = c.jacobian() * t;
        let payload = Matrix6::from_diagonal(&Vector6::from_column_slice(payload));
        let stiffness = j.transpose() * j * leg_n_m + payload;
        // M = L Lᵀ; the modes are those of L⁻¹ K L⁻ᵀ.
        let lower = mass.cholesky()?.l();
        let inverse = lower.try_inverse()?;
        let reduced = inverse * stiffness * inverse.transpose();
        let reduced = (reduced + reduced.transpose()) * 0.5;
        let eigen = SymmetricEigen::try_new(reduced, 1e-14, 1000)?;
        let mut order: [usize; 6] = core::array::from_fn(|i| i);
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let hz = |x: f64| x.max(0.0).sqrt() / TAU;
        let shapes = inverse.transpose() * eigen.eigenvectors;
        let shape = Matrix6::from_fn(|i, k| shapes[(i, order[k])]);
        let flexibility = stiffness.try_inverse()?;
        Some(Modes {
            frequency_hz: order.map(|k| hz(eigen.eigenvalues[k])),
            shape,
            held_hz: core::array::from_fn(|i| hz(stiffness[(i, i)] / mass[(i, i)])),
            leading: core::array::from_fn(|i| {
                // Share of a degree of freedom in a mode's kinetic energy, sᵀ M s = 1.
                let share = |k: usize| mass[(i, i)] * shape[(i, k)] * shape[(i, k)];
                (0..6).max_by(|a, b| share(*a).total_cmp(&share(*b))).unwrap_or(0)
            }),
            stiffness: core::array::from_fn(|i| 1.0 / flexibility[(i, i)]),
        })
    }

    /// Fig. 31–36: natural frequencies over the 729 places of the docking workspace: that of roll is
    /// highest on a face, not in a corner. `None` when a pose is singular.
    #[must_use]
    pub fn frequencies(&self, leg_n_m: f64, payload: &PayloadStiffness) -> Option<FrequencyMap> {
        let middle = Place([0.0; 6]);
        let c = self.at(middle);
        let mut map = FrequencyMap {
            middle: self.modes(&c, leg_n_m, payload)?,
            held_hz: [Span::EMPTY; 6],
            mode_hz: [Span::EMPTY; 6],
            effective_mass_middle_kg: self.platform.effective_masses_kg(&c)?,
            effective_mass_kg: Span::EMPTY,
            stiffness: [Span::EMPTY; 6],
        };
        for place in DockingWorkspace::grid() {
            let c = self.at(place);
            let modes = self.modes(&c, leg_n_m, payload)?;
            for i in 0..6 {
                map.held_hz[i].add(modes.held_hz[i], place);
                map.mode_hz[i].add(modes.frequency_hz[i], place);
                map.stiffness[i].add(modes.stiffness[i], place);
            }
            for mass in self.platform.effective_masses_kg(&c)? {
                map.effective_mass_kg.add(mass, place);
            }
        }
        Some(map)
    }

    /// Mass that can be added at the origin of `e4` before a leg needs more than its force, kg;
    /// negative when the rig as it is needs more. `None` in a singular pose.
    #[must_use]
    pub fn payload_kg(&self, c: &Configuration, demand: &Demand) -> Option<f64> {
        let still = docktwin_core::Twist::default();
        let own = self.platform.inverse_dynamics(c, &still, &still, &Wrench::ZERO)?;
        // The port's arm from the origin of ep.
        let arm = -self.platform.arm_from_e4(&c.x_bp);
        let weight = c.leg_forces(&Wrench::at(arm, -self.rig.gravity_m_s2))?;
        // Columns: leg forces of a unit force at the port, and of a unit acceleration of the plate.
        let mut port = [[0.0; 6]; 3];
        let mut inertia = [[0.0; 6]; 3];
        let mass = self.platform.mass_matrix(c);
        for (k, axis) in DVec3::AXES.into_iter().enumerate() {
            port[k] = c.leg_forces(&Wrench::at(arm, axis))?;
            let push = mass.column(k);
            inertia[k] = c.leg_forces(&Wrench {
                f: DVec3::new(push[0], push[1], push[2]),
                m: DVec3::new(push[3], push[4], push[5]),
            })?;
        }
        // The worst direction of a vector is along the row: its length.
        let worst = |rows: &[[f64; 6]; 3], i: usize| {
            DVec3::new(rows[0][i], rows[1][i], rows[2][i]).length()
        };
        let mut least = f64::INFINITY;
        for i in 0..6 {
            let taken = own[i].abs()
                + worst(&inertia, i) * demand.acceleration_m_s2
                + worst(&port, i) * demand.port_force_n;
            let per_kg = weight[i].abs() + worst(&port, i) * demand.acceleration_m_s2;
            least = least.min((self.rig.limits.force_n - taken) / per_kg);
        }
        Some(least)
    }

    /// Tolerance, range and payload, over the 729 places of the docking workspace. `None` when a
    /// pose is singular.
    #[must_use]
    pub fn capability(&self) -> Option<Capability> {
        let error = self.rig.limits.length_error_m;
        let mut out = Capability {
            position_error_m: 0.0,
            attitude_error_rad: 0.0,
            leg_error_allowed_m: 0.0,
            range: self.range(),
            payload_at_rest_kg: (f64::INFINITY, Place([0.0; 6])),
            payload_at_10_hz_kg: (f64::INFINITY, Place([0.0; 6])),
        };
        for place in DockingWorkspace::grid() {
            let c = self.at(place);
            let inverse = (c.jacobian() * self.docking_to_plate(&c)).try_inverse()?;
            for i in 0..6 {
                let largest: f64 = inverse.row(i).iter().map(|x| x.abs() * error).sum();
                if i < 3 {
                    out.position_error_m = out.position_error_m.max(largest);
                } else {
                    out.attitude_error_rad = out.attitude_error_rad.max(largest);
                }
            }
            for (worst, demand) in [
                (&mut out.payload_at_rest_kg, Demand::AT_REST),
                (&mut out.payload_at_10_hz_kg, Demand::AT_10_HZ),
            ] {
                let kg = self.payload_kg(&c, &demand)?;
                if kg < worst.0 {
                    *worst = (kg, place);
                }
            }
        }
        out.leg_error_allowed_m = error
            * (PAPER_POSITION_M / out.position_error_m)
                .min(PAPER_ATTITUDE_RAD / out.attitude_error_rad);
        Some(out)
    }
}

/// Where on the way from 0 to `most` a condition first ends, in steps of a hundredth, to 1e-4 of a
/// step.
fn first_end(most: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let step = most / 100.0;
    let Some(first) = (1..=100).find(|n| !holds(f64::from(*n) * step)) else { return most };
    let (mut inside, mut outside) = (f64::from(first - 1) * step, f64::from(first) * step);
    while outside - inside > 1e-4 * step {
        let middle = 0.5 * (inside + outside);
        if holds(middle) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    inside
}
