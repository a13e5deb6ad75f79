//! Models written out by hand, so that the tests of the laws do not depend on model files.
#![allow(dead_code, unreachable_pub, reason = "every test file uses its own part")]

use docktwin_core::{DMat3, DQuat, DVec3, Digest, Euler, Pose};
use docktwin_model::{
    Attenuator, AxisChannel, CharacteristicAttenuator, ContactLaw, DampingPhases, DockingMechanism,
    LatchAxes, LatchSet, MechanismLimits, NormalLaw, OutcomeRules, PartOffsets, PetalGeometry,
    PiecewiseCurve, RingBody, RingGeometry, SeriesBrake, SideGeometry, Spacecraft,
};
use docktwin_physics::{
    initial::{ContactConditions, initial_state},
    mechanism::System,
    reduced::DockingState,
};

pub fn cylinder(mass: f64, radius: f64, length: f64) -> DMat3 {
    let axial = 0.5 * mass * radius * radius;
    let across = mass * (3.0 * radius * radius + length * length) / 12.0;
    DMat3::from_diagonal(DVec3::new(axial, across, across))
}

pub fn chaser() -> Spacecraft {
    Spacecraft {
        name: "chaser".into(),
        mass_kg: 8000.0 - 39.1,
        inertia_kg_m2: cylinder(8000.0 - 39.1, 1.35, 7.0),
        x_body_port: Pose::from_translation(DVec3::X * 3.5),
        digest: Digest::default(),
    }
}

pub fn target() -> Spacecraft {
    Spacecraft {
        name: "target".into(),
        mass_kg: 12000.0,
        inertia_kg_m2: cylinder(12000.0, 1.5, 9.0),
        x_body_port: Pose::from_translation(DVec3::X * -4.5),
        digest: Digest::default(),
    }
}

pub fn line(k: f64, to: f64) -> PiecewiseCurve {
    PiecewiseCurve { points: vec![[0.0, 0.0], [to, k * to]] }
}

pub fn channel(
    k: f64,
    [before, after]: [f64; 2],
    [neg, pos]: [f64; 2],
    stop: f64,
    sd: f64,
) -> AxisChannel {
    AxisChannel {
        loading: line(k, 0.1),
        unloading: line(k, 0.1),
        branch_change: 1e-3,
        damping: DampingPhases { before_capture: before, after_capture: after },
        series_brake: None,
        backlash: 0.0,
        dry_friction: 0.0,
        travel_negative: neg,
        travel_positive: pos,
        stop_stiffness: stop,
        stop_damping: sd,
    }
}

pub fn attenuator() -> CharacteristicAttenuator {
    let deg = 1f64.to_radians();
    CharacteristicAttenuator {
        axial: AxisChannel {
            series_brake: Some(SeriesBrake { force: 2500.0, viscous: 500.0 }),
            dry_friction: 250.0,
            ..channel(3e5, [4000.0, 4000.0], [0.15, 0.01], 1e6, 2000.0)
        },
        lateral: channel(800.0, [100.0, 1000.0], [0.12, 0.12], 1e5, 2000.0),
        tilt: channel(1000.0, [60.0, 2500.0], [10.0 * deg, 10.0 * deg], 5e4, 1000.0),
        roll: channel(600.0, [60.0, 1500.0], [15.0 * deg, 15.0 * deg], 5e4, 1000.0),
        damping_ramp_s: 0.2,
    }
}

pub fn law() -> ContactLaw {
    ContactLaw {
        normal: NormalLaw::HuntCrossley { stiffness: 1e6, exponent: 1.0, damping_s_m: 1.0 },
        friction_kinetic: 0.1,
        friction_static: 0.1,
        stribeck_velocity_m_s: 3e-3,
        bristle_breakaway_m: 3e-4,
        bristle_damping_s: 2e-3,
        merge_depth_m: 5e-5,
    }
}

pub fn petals() -> PetalGeometry {
    PetalGeometry {
        count: 3,
        first_azimuth_rad: 0.0,
        base_radius_m: 0.597,
        tip_radius_m: 0.410,
        height_m: 0.187,
        base_half_angle_rad: 28f64.to_radians(),
        tip_half_angle_rad: 14f64.to_radians(),
        thickness_m: 0.020,
        strips: 6,
        flexural_rigidity_n_m2: 1.6e4,
    }
}

pub fn side(with_petals: bool) -> SideGeometry {
    SideGeometry {
        has_ring: true,
        surfaces: Vec::new(),
        ring: RingGeometry { mean_radius_m: 0.6, section_radius_m: 0.025, segments: 48 },
        petals: with_petals.then(petals),
    }
}

pub fn apas() -> DockingMechanism {
    let third = core::f64::consts::TAU / 3.0;
    DockingMechanism {
        name: "apas".into(),
        active: side(true),
        passive: side(true),
        ring_body: RingBody {
            mass_kg: 39.1,
            inertia_kg_m2: DMat3::from_diagonal(DVec3::new(12.7, 6.4, 6.4)),
            com_m: DVec3::X * 0.032,
        },
        ring_rest_offset_m: 0.3,
        passive_ring_offset_m: 0.1,
        contact: law(),
        attenuator: Attenuator::Characteristic(attenuator()),
        stick: None,
        own_latches: Vec::new(),
        captured_when: Default::default(),
        latches: Some(LatchSet {
            axes: LatchAxes::Active,
            azimuths_rad: [0.0, third, 2.0 * third],
            approach_gap_m: 0.05,
            strike_gap_m: 0.005,
            catch_gap_m: 0.003,
            catch_delay_s: 0.0,
            radial_zone_m: 0.010,
            tangential_zone_m: 0.060,
            hold_stiffness_n_m: 1e6,
            joined_stiffness_n_m: 1e6,
            joined_damping_n_s_m: 1500.0,
        }),
        limits: MechanismLimits {
            tension_n: 1e5,
            compression_n: 1e5,
            shear_n: 1e5,
            torsion_nm: 1e5,
            bending_nm: 1e5,
            depth_m: 0.04,
            overtravel_m: 0.1,
        },
        outcome: OutcomeRules {
            guided_radius_m: 0.1,
            settled_speed_m_s: 0.005,
            settled_rate_rad_s: 0.1f64.to_radians(),
            jam_time_s: 10.0,
        },
        spread: None,
        offsets: PartOffsets::default(),
        digest: Digest::default(),
    }
}

/// Bare rings, rigid, on point-like 8 t and 12 t bodies.
pub fn bare_rings() -> DockingMechanism {
    DockingMechanism {
        active: side(false),
        passive: side(false),
        attenuator: Attenuator::Rigid,
        latches: None,
        stick: None,
        ..apas()
    }
}

pub fn conditions(v: f64, dy: f64, dz: f64, euler_deg: [f64; 3]) -> ContactConditions {
    ContactConditions {
        attitude: Euler::from_degrees(euler_deg[0], euler_deg[1], euler_deg[2]),
        lateral_m: DVec3::new(0.0, dy, dz),
        velocity_m_s: DVec3::new(-v, 0.0, 0.0),
        rate_rad_s: DVec3::ZERO,
        ..ContactConditions::default()
    }
}

pub fn start(system: &System, c: &ContactConditions, gap: f64) -> DockingState {
    DockingState::new(initial_state(system, c, gap).bodies)
}

pub fn pose(x: f64, y: f64, z: f64, euler_deg: [f64; 3]) -> Pose {
    Pose::new(
        DVec3::new(x, y, z),
        Euler::from_degrees(euler_deg[0], euler_deg[1], euler_deg[2]).to_quat()
            * DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0),
    )
}
