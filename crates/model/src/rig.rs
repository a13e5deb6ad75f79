use core::f64::consts::TAU;
use core::fmt;

use docktwin_core::{DMat3, DVec3, Digest, Euler, Pose};
use serde::{Deserialize, Serialize};

use crate::drive::{Drive, HydraulicPreset, LegHydraulics};

/// The motion simulator: a Stewart platform whose plate carries the passive mechanism, and a fixed
/// rack that carries the active one.
///
/// | frame | place |
/// | --- | --- |
/// | `eb` | ground of the rig; the base joints stand in it |
/// | `e0` | fixed rack |
/// | `e3`, `e4` | mounting planes of the active mechanism (on the rack) and of the passive one (on the plate) |
/// | `ep` | moving plate; the plate joints stand in it |
///
/// The plate is placed so that the mechanisms see the simulated relative pose:
/// `X_0p = X_03 · X_34 · X_4p`.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// Robot name of the URDF.
    pub name: String,
    /// Rack in the ground, `X_b0`.
    pub x_b0: Pose,
    /// Mounting plane of the active mechanism in the rack, `X_03`.
    pub x_03: Pose,
    /// Plate in the mounting plane of the passive mechanism, `X_4p`.
    pub x_4p: Pose,
    /// Gravity in `eb`, m/s².
    pub gravity_m_s2: DVec3,
    /// Everything that moves with the plate, what it carries included; seen from `ep`.
    pub plate: RigidMass,
    /// Part of [`Rig::plate`] beyond the plate's sensor, seen from `ep`: the load on that sensor.
    pub passive_payload: Option<RigidMass>,
    /// What the sensor on the rack carries, seen from `e0`.
    pub active_payload: Option<RigidMass>,
    /// The legs.
    pub legs: [Leg; 6],
    /// Where the mechanisms may have to go.
    pub docking: DockingWorkspace,
    /// Speed, force and size limits of a leg.
    pub limits: LegLimits,
    /// What moves the legs.
    pub drive: Drive,
    /// Sensors of force and length; `None` where the file has none, and then there is no loop.
    pub sensors: Option<RigSensors>,
    /// What carries the weight of the ring; `None` where nothing does.
    pub offload: Option<Offload>,
    /// How far an emulated rig may differ from this file.
    pub spread: Spread,
    /// Digest of the URDF and its TOML.
    pub digest: Digest,
}

impl Rig {
    /// The same rig with its mechanisms mounted elsewhere: `e3` and `e4` as they stand, seen from where this
    /// file has them.
    #[must_use]
    pub fn mounted(&self, [e3, e4]: &[Pose; 2]) -> Self {
        Self { x_03: self.x_03 * *e3, x_4p: e4.inverse() * self.x_4p, ..self.clone() }
    }
}

/// A rigid body seen from a stated frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidMass {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Mass centre, m.
    pub com_m: DVec3,
    /// Inertia about the mass centre, kg·m².
    pub inertia_kg_m2: DMat3,
}

/// One leg: a cross link and a cylinder on a universal joint at the base, a rod sliding in the
/// cylinder, a spherical joint at the plate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Leg frame in `eb` with the plate in the middle: origin at the base joint, +X to the plate
    /// joint, +Z the first axis of the universal joint (fixed to the ground), +Y its second (fixed
    /// to the cylinder). Away from the middle the leg points along `Rz(q1) Ry(q2) X` of this frame.
    pub x_b_leg: Pose,
    /// Plate joint in `ep`, m.
    pub plate_joint_m: DVec3,
    /// Length from joint to joint with the plate in the middle, m.
    pub middle_length_m: f64,
    /// Shortest length, m.
    pub shortest_m: f64,
    /// Longest length, m.
    pub longest_m: f64,
    /// Largest angle of either axis of the universal joint from the middle, rad.
    pub swing_limit_rad: f64,
    /// Largest angle between the leg and its direction in the plate at the middle, rad.
    pub ball_limit_rad: f64,
    /// Mass of the cross link, kg; its mass centre is the base joint.
    pub cross_mass_kg: f64,
    /// Inertia of the cross link about the base joint in leg axes, kg·m².
    pub cross_inertia_kg_m2: DMat3,
    /// The cylinder; `com_m` from the base joint towards the plate.
    pub cylinder: LegPart,
    /// The rod; `com_m` from the plate joint towards the base.
    pub rod: LegPart,
}

/// A part of a leg whose mass centre lies on the leg's axis and which is symmetric about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegPart {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Distance of the mass centre from the part's own joint, m.
    pub com_m: f64,
    /// Inertia about the leg's axis, kg·m².
    pub axial_kg_m2: f64,
    /// Inertia about the mass centre across the axis, kg·m².
    pub transverse_kg_m2: f64,
}

impl Leg {
    /// Base joint in `eb`, m.
    #[must_use]
    pub fn base_joint_m(&self) -> DVec3 {
        self.x_b_leg.p
    }

    /// First axis of the universal joint, fixed in `eb`; unit vector.
    #[must_use]
    pub fn swing_axis(&self) -> DVec3 {
        self.x_b_leg.q * DVec3::Z
    }

    /// From the base joint to the plate joint, in `eb`, m.
    #[must_use]
    pub fn vector(&self, x_bp: &Pose) -> DVec3 {
        x_bp.transform_point(self.plate_joint_m) - self.x_b_leg.p
    }

    /// Angles `[q1, q2]` of the universal joint for a leg vector in `eb`, rad.
    #[must_use]
    pub fn universal_angles(&self, vector_m: DVec3) -> [f64; 2] {
        let u = self.x_b_leg.q.conjugate() * vector_m.normalize();
        [u.y.atan2(u.x), -u.z.clamp(-1.0, 1.0).asin()]
    }

    /// Angle between the leg and its middle direction, seen from the plate, rad.
    #[must_use]
    pub fn ball_angle(&self, x_bp: &Pose, x_bp_middle: &Pose, vector_m: DVec3) -> f64 {
        let now = x_bp.q.conjugate() * vector_m;
        let then = x_bp_middle.q.conjugate() * (self.x_b_leg.q * DVec3::X);
        now.angle_between(then)
    }
}

impl Rig {
    /// Part of the ring's weight that no balance carries, 0 to 1: what the attenuator and sensor A bear.
    #[must_use]
    pub fn uncarried(&self) -> f64 {
        1.0 - self.offload.map_or(0.0, |o| o.share)
    }

    /// Angle between gravity and the docking axis (X of `e3`, up or down), rad; 0 without gravity.
    #[must_use]
    pub fn axis_off_vertical_rad(&self) -> f64 {
        let g = self.gravity_in_e3_m_s2();
        g.y.hypot(g.z).atan2(g.x.abs())
    }

    /// Gravity in `e3`, m/s².
    #[must_use]
    pub fn gravity_in_e3_m_s2(&self) -> DVec3 {
        (self.x_b0 * self.x_03).q.conjugate() * self.gravity_m_s2
    }

    /// Pose of the plate in the ground, `X_bp`, at which the mechanisms have the relative pose
    /// `X_34`.
    #[must_use]
    pub fn plate_from_docking(&self, x_34: &Pose) -> Pose {
        self.x_b0 * self.x_03 * *x_34 * self.x_4p
    }

    /// Relative pose `X_34` that the mechanisms see with the plate at `X_bp`.
    #[must_use]
    pub fn docking_from_plate(&self, x_bp: &Pose) -> Pose {
        (self.x_b0 * self.x_03).inverse() * *x_bp * self.x_4p.inverse()
    }

    /// Plate in the middle of the docking workspace, `X_bp`.
    #[must_use]
    pub fn middle(&self) -> Pose {
        self.plate_from_docking(&self.docking.pose([0.0; 6]))
    }

    /// The oil of a leg with the volumes of a preset; `None` where no oil moves the legs.
    #[must_use]
    pub fn leg_hydraulics(&self, preset: HydraulicPreset) -> Option<LegHydraulics> {
        self.drive.hydraulic().map(|h| h.leg(preset))
    }

    /// The oil volume that is meant: the one asked for, or the file's. A rig without oil has none, and what
    /// is given back for it is looked at by nobody.
    #[must_use]
    pub fn preset(&self, asked: Option<HydraulicPreset>) -> HydraulicPreset {
        let filed = self.drive.hydraulic().map(|h| h.hydraulics.default_preset);
        asked.or(filed).unwrap_or(HydraulicPreset::Printed)
    }

    /// The oil volume where there is oil: what records and results say of it.
    #[must_use]
    pub fn oil(&self, preset: HydraulicPreset) -> Option<HydraulicPreset> {
        self.drive.hydraulic().map(|_| preset)
    }

    /// The oil volume in a word, `none` where there is no oil.
    #[must_use]
    pub fn oil_word(&self, preset: HydraulicPreset) -> &'static str {
        self.oil(preset).map_or("none", HydraulicPreset::word)
    }
}

/// The box of relative poses `X_34` that docking needs, about its middle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DockingWorkspace {
    /// `p_34` in the middle, in `e3`, m; the attitude of the middle is `R_34 = I`.
    pub middle_m: DVec3,
    /// Half-width along X3, m.
    pub axial_m: f64,
    /// Half-width along Y3 and along Z3, m.
    pub lateral_m: f64,
    /// Half-width in roll, rad.
    pub roll_rad: f64,
    /// Half-width in pitch and in yaw, rad.
    pub pitch_yaw_rad: f64,
}

impl DockingWorkspace {
    /// Relative pose at a place of the box: X, Y, Z, roll, pitch, yaw, each in [−1, 1]. The attitude
    /// turns about the origin of `e4`.
    #[must_use]
    pub fn pose(&self, place: [f64; 6]) -> Pose {
        let [x, y, z, roll, pitch, yaw] = place;
        let euler = Euler {
            roll: roll * self.roll_rad,
            pitch: pitch * self.pitch_yaw_rad,
            yaw: yaw * self.pitch_yaw_rad,
        };
        let offset = DVec3::new(x * self.axial_m, y * self.lateral_m, z * self.lateral_m);
        Pose::new(self.middle_m + offset, euler.to_quat())
    }

    /// The 64 corners.
    pub fn corners() -> impl Iterator<Item = Place> {
        (0..64_u32)
            .map(|n| Place(core::array::from_fn(|i| if n >> i & 1 == 1 { 1.0 } else { -1.0 })))
    }

    /// The middle, the corners, and the middles of all edges and faces: 729 places.
    pub fn grid() -> impl Iterator<Item = Place> {
        (0..729_u32)
            .map(|n| Place(core::array::from_fn(|i| f64::from(n / 3_u32.pow(i as u32) % 3) - 1.0)))
    }
}

/// A place in the docking workspace: X, Y, Z, roll, pitch, yaw, each from −1 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place(pub [f64; 6]);

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.iter().all(|x| x.abs() < 1e-12) {
            return write!(f, "middle");
        }
        let names = ["X", "Y", "Z", "roll", "pitch", "yaw"];
        for (i, (name, at)) in names.iter().zip(self.0).enumerate() {
            let gap = if i == 0 { "" } else { " " };
            let sign = if at > 0.0 {
                "+"
            } else if at < 0.0 {
                "−"
            } else {
                "0"
            };
            write!(f, "{gap}{name}{sign}")?;
            if at.abs() < 1.0 && at.abs() > 0.0 {
                write!(f, "{:.2}", at.abs())?;
            }
        }
        Ok(())
    }
}

/// Limits of every leg; strokes stand in each [`Leg`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegLimits {
    /// Largest speed of a rod, m/s.
    pub speed_m_s: f64,
    /// Largest force of a rod, N, pulling or pushing.
    pub force_n: f64,
    /// What a retracted leg is longer than its stroke, at least, m: piston, glands, joints.
    pub dead_length_m: f64,
    /// Radius of the thickest part of a leg, m.
    pub radius_m: f64,
    /// Error of a leg's length as known to the rig, m: length sensor, joints, calibration; bound.
    pub length_error_m: f64,
}

/// What measures on the rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigSensors {
    /// The force–torque sensors, alike: A on the rack, at the origin of `e3`, with its axes; B, where there is
    /// one, on the plate, at the origin of `e4`, with its axes.
    pub force: SixAxisSensor,
    /// Whether there is a sensor B.
    pub plate_force: bool,
    /// Accelerometers on the plate: specific force (m/s², acceleration less gravity) at the origin of
    /// `e4` and angular acceleration (rad/s²), in its axes. Not every rig has them.
    pub accelerometer: Option<SixAxisSensor>,
    /// Standard deviation of the length sensors' noise, m.
    pub length_noise_m: f64,
    /// Step of the length sensors or encoders, m.
    pub length_quantum_m: f64,
    /// Standard deviation of the pressure sensors' noise, as force, N; 0 where no oil moves the legs.
    pub pressure_noise_n: f64,
}

/// Words by which files say which force sensors there are, and whether sensor B is among them.
pub(crate) const FORCE_SENSORS: [(&str, bool); 2] = [("rack_and_plate", true), ("rack", false)];

/// A sensor of six axes; pairs are of force (N) and moment (N·m), or of specific force (m/s²) and
/// angular acceleration (rad/s²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SixAxisSensor {
    /// Natural frequency, Hz.
    pub natural_frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Standard deviation of the noise of a sample.
    pub noise: [f64; 2],
    /// Drift of the zero, per second.
    pub drift_per_s: [f64; 2],
    /// Threshold of the dead zone.
    pub dead_zone: [f64; 2],
    /// What it does with readings above the threshold.
    pub dead_zone_law: DeadZoneLaw,
    /// Step of the reading.
    pub quantum: [f64; 2],
    /// End of the range.
    pub range: [f64; 2],
    /// From the load to the reading, in addition to the lag of the sensor, s; at most 5 ms.
    pub delay_s: f64,
    /// Half-width by which the delay of an emulated sensor is drawn, s.
    pub delay_spread_s: f64,
    /// Half-width by which the zero of an emulated sensor is drawn, before taring.
    pub zero_spread: [f64; 2],
}

/// What a dead zone does with readings above its threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeadZoneLaw {
    /// Passes them whole.
    Zeroing,
    /// Takes the threshold off: like a larger gap at the contact.
    Subtractive,
}

impl DeadZoneLaw {
    /// Words by which files name the laws.
    pub const WORDS: [(&'static str, Self); 2] =
        [("zeroing", Self::Zeroing), ("subtractive", Self::Subtractive)];
}

/// The balance on which the moving ring of the active mechanism hangs: a constant lift on a small moving
/// mass, from which a rope goes down to the mass centre of the ring. It stands beside the rack, so no
/// sensor carries it, and follows the ring sideways.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offload {
    /// Part of the ring's weight that it lifts, above 0, at most 1; what is left sags and uses up brakes.
    pub share: f64,
    /// Coulomb friction of its guides and pulleys on the moving mass, N; more holds the ring where it is.
    pub friction_n: f64,
    /// Mass that moves with the ring along the docking axis, reduced to the rope, kg; more makes the ring
    /// heavier along that axis alone.
    pub added_mass_kg: f64,
    /// Stiffness of the hanger (rope and frame) between ring and moving mass, N/m; softer lets the ring
    /// move before the moving mass does. A rope does not push.
    pub stiffness_n_m: f64,
    /// Damping of the moving mass on the hanger as a part of the critical one.
    pub damping_ratio: f64,
}

impl Offload {
    /// Displacement after which the balance's friction slips, m: presliding of guides and bearings.
    pub const BREAKAWAY_M: f64 = 1e-4;

    /// Natural frequency of the moving mass on the hanger and on its friction before break-away, the ring at
    /// rest, Hz; 0 without moving mass.
    #[must_use]
    pub fn hanger_hz(&self) -> f64 {
        if self.added_mass_kg > 0.0 {
            let stiffness = self.stiffness_n_m + self.friction_n / Self::BREAKAWAY_M;
            (stiffness / self.added_mass_kg).sqrt() / TAU
        } else {
            0.0
        }
    }
}

/// Half-widths by which an emulated rig may be drawn away from its file; those of another kind of drive are 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// Of the flow gain, relative.
    pub flow_gain: f64,
    /// Of the null bias, parts of full spool.
    pub null_bias: f64,
    /// Of Coulomb and static friction, relative.
    pub friction: f64,
    /// Of the bulk modulus, relative.
    pub bulk_modulus: f64,
    /// Of the plate's mass and inertia, relative.
    pub plate_mass: f64,
    /// Of the valve's natural frequency, relative.
    pub valve_frequency: f64,
    /// Of the natural frequency of the legs' position loops, relative.
    pub loop_frequency: f64,
    /// Of their damping ratio, relative.
    pub loop_damping: f64,
    /// Of the dead time, s.
    pub dead_time_s: f64,
}
