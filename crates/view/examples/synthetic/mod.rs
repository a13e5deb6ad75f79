//! A made-up docking, so that the writer can be looked at without a twin: real geometry of rings
//! and petals, contacts found by sampling the surfaces, springs pushed by hand. Not physics.

use docktwin_core::{DMat3, DQuat, DVec3, Digest, Euler, Pose, SimTime};
use docktwin_model::{
    Attenuator, AxisChannel, ContactLaw, DampingPhases, DifferentialAttenuator, DockingMechanism,
    LatchAxes, LatchSet, MechanismLimits, NormalLaw, OutcomeRules, PartOffsets, PetalGeometry,
    PiecewiseCurve, RingBody, RingGeometry, SideGeometry, Spacecraft,
};
use docktwin_view::{ContactArrow, Energies, Frame, Scalars, SceneModel, SceneWriter, ViewError};

/// Frames a second of the made-up run.
pub(crate) const RATE_HZ: f64 = 100.0;

fn cylinder(name: &str, mass_kg: f64, radius: f64, length: f64, port: Pose) -> Spacecraft {
    let across = mass_kg * (3.0 * radius * radius + length * length) / 12.0;
    Spacecraft {
        name: name.into(),
        mass_kg,
        inertia_kg_m2: DMat3::from_diagonal(DVec3::new(
            0.5 * mass_kg * radius * radius,
            across,
            across,
        )),
        x_body_port: port,
        digest: Digest::default(),
    }
}

pub(crate) fn chaser() -> Spacecraft {
    cylinder("chaser_8t", 8000.0, 1.35, 7.0, Pose::from_translation(DVec3::X * 3.5))
}

pub(crate) fn target() -> Spacecraft {
    cylinder("target_12t", 12000.0, 1.5, 9.0, Pose::from_translation(DVec3::X * -4.5))
}

fn channel() -> AxisChannel {
    let curve = PiecewiseCurve { points: vec![[0.0, 0.0], [0.1, 3.0e4]] };
    AxisChannel {
        loading: curve.clone(),
        unloading: curve,
        branch_change: 1e-3,
        damping: DampingPhases { before_capture: 100.0, after_capture: 1000.0 },
        series_brake: None,
        backlash: 0.0,
        dry_friction: 0.0,
        travel_negative: 0.15,
        travel_positive: 0.01,
        stop_stiffness: 1e6,
        stop_damping: 2e3,
    }
}

fn latches() -> LatchSet {
    LatchSet {
        axes: LatchAxes::Active,
        azimuths_rad: [30f64, 150.0, 270.0].map(f64::to_radians),
        approach_gap_m: 0.05,
        strike_gap_m: 0.01,
        catch_gap_m: 0.003,
        catch_delay_s: 0.0,
        radial_zone_m: 0.01,
        tangential_zone_m: 0.06,
        hold_stiffness_n_m: 1e6,
        joined_stiffness_n_m: 1e6,
        joined_damping_n_s_m: 1500.0,
    }
}

pub(crate) fn mechanism() -> DockingMechanism {
    let ring = RingGeometry { mean_radius_m: 0.600, section_radius_m: 0.025, segments: 48 };
    let petals = PetalGeometry {
        count: 3,
        first_azimuth_rad: 30f64.to_radians(),
        base_radius_m: 0.597,
        tip_radius_m: 0.410,
        height_m: 0.187,
        base_half_angle_rad: 28f64.to_radians(),
        tip_half_angle_rad: 14f64.to_radians(),
        thickness_m: 0.020,
        strips: 6,
        flexural_rigidity_n_m2: 1.6e4,
    };
    let joint = |k: usize, x: f64, r: f64, off: f64| {
        let a =
            (120.0 * (k / 2) as f64 + if k.is_multiple_of(2) { off } else { -off }).to_radians();
        DVec3::new(x, r * a.cos(), r * a.sin())
    };
    DockingMechanism {
        stick: None,
        name: "made-up".into(),
        active: SideGeometry { has_ring: true, ring, petals: Some(petals), surfaces: Vec::new() },
        passive: SideGeometry { has_ring: true, ring, petals: Some(petals), surfaces: Vec::new() },
        ring_body: RingBody {
            mass_kg: 39.1,
            inertia_kg_m2: DMat3::from_diagonal(DVec3::new(12.7, 6.4, 6.4)),
            com_m: DVec3::X * 0.032,
        },
        ring_rest_offset_m: 0.300,
        passive_ring_offset_m: 0.030,
        contact: ContactLaw {
            normal: NormalLaw::HuntCrossley { stiffness: 1e6, exponent: 1.0, damping_s_m: 1.0 },
            friction_kinetic: 0.1,
            friction_static: 0.1,
            stribeck_velocity_m_s: 3e-3,
            bristle_breakaway_m: 1e-5,
            bristle_damping_s: 1e-3,
            merge_depth_m: 1e-4,
        },
        attenuator: Attenuator::Differential(DifferentialAttenuator {
            base_joints_m: core::array::from_fn(|k| joint(k, 0.0, 0.60, 52.0)),
            ring_joints_m: core::array::from_fn(|k| joint(k, -0.02, 0.60, 8.0)),
            coupling: core::array::from_fn(|i| {
                core::array::from_fn(|j| f64::from(u8::from(i == j)))
            }),
            channels: core::array::from_fn(|_| channel()),
            damping_ramp_s: 0.5,
        }),
        own_latches: Vec::new(),
        captured_when: Default::default(),
        latches: Some(latches()),
        limits: MechanismLimits {
            tension_n: 3.9e3,
            compression_n: 6.5e3,
            shear_n: 3.2e3,
            torsion_nm: 1.5e3,
            bending_nm: 2.8e3,
            depth_m: 0.04,
            overtravel_m: 0.02,
        },
        outcome: OutcomeRules {
            guided_radius_m: 0.1,
            settled_speed_m_s: 1e-3,
            settled_rate_rad_s: 1e-3,
            jam_time_s: 5.0,
        },
        spread: None,
        offsets: PartOffsets::default(),
        digest: Digest::default(),
    }
}

/// Names of the pairs: ring on ring, passive petals on the active ring, active petals on the
/// passive ring, petals on petals, latches.
pub(crate) fn pair_names() -> Vec<String> {
    let mut names = vec!["active ring · passive ring".to_owned()];
    names.extend((0..3).map(|i| format!("active ring · passive petal {i}")));
    names.extend((0..3).map(|i| format!("active petal {i} · passive ring")));
    for a in 0..3 {
        names.extend((0..3).map(|p| format!("active petal {a} · passive petal {p}")));
    }
    names.extend((1..4).map(|i| format!("latch {i} · striker {i}")));
    names
}

/// Deepest place of a swept surface (points of its mid-surface, half thickness) in a torus about X.
fn in_torus(points: &[DVec3], half: f64, ring: &RingGeometry) -> Option<(f64, DVec3, DVec3)> {
    let place = |p: &DVec3| {
        let circle = DVec3::new(0.0, p.y, p.z).normalize_or(DVec3::Y) * ring.mean_radius_m;
        let gap = *p - circle;
        let depth = half + ring.section_radius_m - gap.length();
        let n = gap.normalize_or(DVec3::X);
        (depth, circle + n * (ring.section_radius_m - 0.5 * depth), n)
    };
    points.iter().map(place).filter(|x| x.0 > 0.0).max_by(|a, b| a.0.total_cmp(&b.0))
}

fn petal_points(g: &PetalGeometry, i: u32) -> Vec<DVec3> {
    let steps = (0..=40).flat_map(|a| (0..=30).map(move |b| (a, b)));
    steps
        .map(|(a, b)| {
            let [base, tip] = g.ruling(i, f64::from(a) / 20.0 - 1.0);
            base.lerp(tip, f64::from(b) / 30.0)
        })
        .collect()
}

/// Writes the made-up run until `end_s`; gives the time each frame took to write, s.
#[expect(clippy::too_many_lines, reason = "one recording, told from its begin to its end")]
pub(crate) fn write(path: &std::path::Path, end_s: f64) -> Result<Vec<f64>, ViewError> {
    let (chaser, target, m) = (chaser(), target(), mechanism());
    let scene = SceneModel {
        scenario: "made_up",
        chaser: &chaser,
        target: &target,
        mechanism: &m,
        with_rig: false,
    };
    let names = pair_names();
    let mut spent_s = Vec::new();
    let start = std::time::Instant::now();
    let mut writer = SceneWriter::create(path, &scene, &names)?;
    println!("create: {:.1} ms", 1e3 * start.elapsed().as_secs_f64());

    let Some(petals) = m.active.petals else { return Ok(vec![]) };
    let half = 0.5 * petals.thickness_m;
    let points: Vec<_> = (0..3).map(|i| petal_points(&petals, i)).collect();
    let half_turn = DQuat::from_rotation_z(core::f64::consts::PI);
    let docked = m.docked_length_m();
    // Both drift, so that the scene shows that it is drawn in e3.
    let drift = |t: f64| {
        Pose::new(
            DVec3::new(20.0, -5.0, 3.0) + DVec3::Y * t,
            DQuat::from_rotation_z(0.4 + 0.02 * t),
        )
    };

    // Position of e4 in e3, its velocity, the ring's displacement and tilt.
    let (mut p, mut v) = (DVec3::new(docked + 0.42, 0.055, -0.030), DVec3::new(-0.14, 0.0, 0.01));
    let (mut ring, mut ring_v) = (DVec3::ZERO, DVec3::ZERO);
    let mut tilt = 1.0;
    let (mut captured, mut latches, mut energy) = (None, [0u8; 3], Energies::default());
    let mut touching = 0;
    let dt = 2e-4;
    let steps = (end_s / dt).round() as u64;
    let reduced_mass = 4800.0;
    for step in 0..=steps {
        let t = step as f64 * dt;
        let q_34 = Euler::from_degrees(2.5 * tilt, 2.0 * tilt, -1.5 * tilt).to_quat();
        let x_34 = Pose::new(p, q_34);
        let x_r4 = x_34 * Pose::new(DVec3::X * -m.passive_ring_offset_m, half_turn);
        let x_r3 = Pose::from_translation(DVec3::X * m.ring_rest_offset_m + ring);
        let (x_34r, x_43r) = (x_r3.inverse() * x_r4, x_r4.inverse() * x_r3);

        // Contacts in e3: force on the active side.
        let mut contacts: Vec<ContactArrow> = Vec::new();
        let mut push = |pair: usize, depth: f64, point: DVec3, n_on_active: DVec3, k: f64| {
            let normal = n_on_active * (k * depth);
            let slide = (v - ring_v).reject_from(n_on_active).normalize_or_zero();
            contacts.push(ContactArrow {
                pair,
                point_w_m: point,
                normal_force_w_n: normal,
                friction_w_n: slide * (0.1 * normal.length()),
                depth_m: depth,
            });
        };
        for (i, petal) in points.iter().enumerate() {
            let moved: Vec<_> = petal.iter().map(|q| x_34r.transform_point(*q)).collect();
            if let Some((d, at, n)) = in_torus(&moved, half, &m.active.ring) {
                push(1 + i, d, x_r3.transform_point(at), x_r3.q * -n, 4e5);
            }
            let moved: Vec<_> = petal.iter().map(|q| x_43r.transform_point(*q)).collect();
            if let Some((d, at, n)) = in_torus(&moved, half, &m.passive.ring) {
                push(4 + i, d, x_r4.transform_point(at), x_r4.q * n, 4e5);
            }
        }
        let circle: Vec<_> = (0..72)
            .map(|k| {
                let a = f64::from(k) / 72.0 * core::f64::consts::TAU;
                x_34r.transform_point(DVec3::new(0.0, 0.6 * a.cos(), 0.6 * a.sin()))
            })
            .collect();
        for third in circle.chunks(24) {
            if let Some((d, at, n)) = in_torus(third, 0.025, &m.active.ring) {
                push(0, d, x_r3.transform_point(at), x_r3.q * -n, 4e5);
            }
        }
        let mut gaps = [0.0; 3];
        if let Some(set) = &m.latches {
            for (i, a) in set.azimuths_rad.into_iter().enumerate() {
                let at = |s: f64, a: f64| DVec3::new(s, 0.6 * a.cos(), 0.6 * a.sin());
                let latch = x_r3.transform_point(at(0.025, a));
                let striker = x_r4.transform_point(at(0.025, core::f64::consts::PI - a));
                gaps[i] = (striker - latch).x;
                let state = match gaps[i] {
                    g if g < set.catch_gap_m => 3,
                    g if g < set.strike_gap_m => 2,
                    g if g < set.approach_gap_m => 1,
                    _ => 0,
                };
                if state > latches[i] {
                    latches[i] = state;
                    let what = ["free", "approaches", "struck", "latched"][usize::from(state)];
                    let time = SimTime::from_nanos((t * 1e9) as u64);
                    writer.event(time, "latch", &format!("latch {}: {what}", i + 1))?;
                }
                if latches[i] == 3 && gaps[i] > set.catch_gap_m {
                    let pull = striker - latch;
                    let force = pull * 6e4;
                    contacts.push(ContactArrow {
                        pair: 16 + i,
                        point_w_m: latch,
                        normal_force_w_n: force,
                        friction_w_n: DVec3::ZERO,
                        depth_m: 0.0,
                    });
                }
            }
        }
        if captured.is_none() && latches == [3; 3] {
            captured = Some(t);
            writer.event(
                SimTime::from_nanos((t * 1e9) as u64),
                "outcome",
                "captured: all three latched",
            )?;
        }

        let force: DVec3 = contacts.iter().map(|c| c.normal_force_w_n + c.friction_w_n).sum();
        let rising = contacts.len() != touching;
        if contacts.len() > touching {
            let pair = contacts.last().map_or("", |c| names[c.pair].as_str());
            writer.event(SimTime::from_nanos((t * 1e9) as u64), "contact", pair)?;
        }
        touching = contacts.len();
        energy.kinetic_relative_j = 0.5 * reduced_mass * v.length_squared();
        energy.stored_j =
            contacts.iter().map(|c| 0.5 * c.normal_force_w_n.length() * c.depth_m).sum::<f64>()
                + 0.5 * (3e4 * ring.x * ring.x + 800.0 * (ring.y * ring.y + ring.z * ring.z));
        let every = (1.0 / (RATE_HZ * dt)).round() as u64;
        if step % every == 0 || rising {
            let w = drift(t);
            let contacts_w: Vec<_> = contacts
                .iter()
                .map(|c| ContactArrow {
                    point_w_m: w.transform_point(c.point_w_m),
                    normal_force_w_n: w.q * c.normal_force_w_n,
                    friction_w_n: w.q * c.friction_w_n,
                    ..*c
                })
                .collect();
            let attenuator = DVec3::new(-3e4 * ring.x, -800.0 * ring.y, -800.0 * ring.z);
            let scalars = Scalars {
                relative_position_m: p,
                relative_attitude_deg: DVec3::new(2.5, 2.0, -1.5) * tilt,
                relative_velocity_m_s: v,
                relative_rate_deg_s: DVec3::ZERO,
                ring_deflection_mm: ring * 1e3,
                ring_tilt_deg: DVec3::ZERO,
                port_force_n: -attenuator,
                port_moment_nm: (DVec3::X * 0.3 + ring).cross(-attenuator),
                contact_normal_sum_n: contacts.iter().map(|c| c.normal_force_w_n.length()).sum(),
                energy,
                between_force_n: attenuator.length(),
                between_moment_nm: 0.0,
                latch_gap_m: gaps,
                petal_gap_m: [[f64::NAN; 3]; 2],
            };
            let x_1 = w * chaser.x_body_port.inverse();
            let frame = Frame {
                time: SimTime::from_nanos((t * 1e9).round() as u64),
                x_world_chaser: x_1,
                x_world_target: w * x_34 * target.x_body_port.inverse(),
                x_world_ring: w * x_r3,
                contacts: &contacts_w,
                latches,
                scalars: &scalars,
            };
            let start = std::time::Instant::now();
            writer.frame(&frame)?;
            spent_s.push(start.elapsed().as_secs_f64());
        }

        // Pushes everything on by hand.
        let damp = if captured.is_some() { 3000.0 } else { 200.0 };
        let on_ring = force - DVec3::new(3e4, 800.0, 800.0) * ring - ring_v * 6000.0;
        let lost = (v - ring_v).length_squared() * damp * f64::from(u8::from(touching > 0));
        energy.dissipated_contact_j += lost * dt;
        energy.dissipated_friction_j +=
            contacts.iter().map(|c| c.friction_w_n.length()).sum::<f64>()
                * (v - ring_v).length()
                * dt;
        energy.dissipated_attenuator_j += 6000.0 * ring_v.length_squared() * dt;
        let between = if touching > 0 { (v - ring_v) * damp } else { DVec3::ZERO };
        v += (-force - between) / reduced_mass * dt;
        ring_v += (on_ring + between) / 39.1 * dt;
        p += v * dt;
        ring += ring_v * dt;
        let rate = if touching > 0 { 1.5 } else { 0.02 };
        tilt -= tilt * rate * dt;
    }
    let start = std::time::Instant::now();
    writer.finish()?;
    println!("finish: {:.1} ms", 1e3 * start.elapsed().as_secs_f64());
    Ok(spent_s)
}
