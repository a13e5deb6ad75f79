//! The test bench against closed forms, and against the mechanism's own account.
mod common;

use std::path::{Path, PathBuf};

use docktwin_core::{DVec3, Pose};
use docktwin_model::{
    AttenuationChoice, Attenuator, AxisChannel, DampingPhases, DockingMechanism, NormalLaw,
    PiecewiseCurve, SeriesBrake, load_mechanism,
};
use docktwin_physics::{
    attenuator::{AttenuatorGeometry, AttenuatorState, elastic_wrench, stored_energy},
    bench::{
        Axis, BenchError, Cycling, Others, Six, Wave, characterise, contact_loop, coupling,
        instability, run, slope, tangent, travel,
    },
};

fn models(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(file)
}

fn apas(choice: AttenuationChoice) -> DockingMechanism {
    load_mechanism(&models("apas_active.urdf"), &models("apas_passive.urdf"), Some(choice))
        .expect("the default mechanism")
        .model
}

const BOTH: [(&str, AttenuationChoice); 2] = [
    ("characteristic", AttenuationChoice::Characteristic),
    ("differential", AttenuationChoice::Differential),
];

fn test(axis: Axis, end: f64, speed: f64) -> Cycling {
    Cycling {
        axis,
        ends: [end, -end],
        speed,
        wave: Wave::Triangle,
        cycles: 2,
        others: Others::Held,
        offset: [0.0; 6],
        damping_phase: 0.0,
    }
}

/// The default mechanism with another channel on the axis X.
fn with_axial(channel: AxisChannel) -> DockingMechanism {
    let mut m = common::apas();
    let Attenuator::Characteristic(c) = &mut m.attenuator else { panic!("characteristic") };
    c.axial = channel;
    m
}

fn close(got: f64, want: f64, relative: f64, what: &str) {
    println!("{what}: {got:.6} against {want:.6}");
    assert!((got / want - 1.0).abs() < relative, "{what}: {got} against {want}");
}

#[test]
fn oracle_a_brake_in_series_with_a_spring_takes_4f_times_what_it_slips() {
    let (k, f, x) = (3e5, 2500.0, 0.05);
    let mut c = common::channel(k, [0.0, 0.0], [0.2, 0.2], 1e6, 0.0);
    // No damper and next to no viscosity: the element of the textbook.
    c.series_brake = Some(SeriesBrake { force: f, viscous: 500.0 });
    let m = with_axial(c.clone());
    let v = 1e-3;
    let r = run(&m, &test(Axis::X, x, v)).expect("runs");
    // While it slips at v the brake holds F + b v.
    let hold = f + 500.0 * v;
    close(r.cycle_work_j[1], 4.0 * hold * (x - hold / k), 1e-4, "loop area of the second cycle");
    let [at, force] = r.first_slip.expect("it slips");
    close(at, f / k, 0.01, "displacement of the first slip");
    close(force, f, 0.01, "force of the first slip");

    // Dry friction beside it: the bristle turns over within s₀, which it does not lose.
    let (d, s0) = (250.0, 2e-4);
    c.dry_friction = d;
    let r = run(&with_axial(c), &test(Axis::X, x, v)).expect("runs");
    let want = 4.0 * hold * (x - hold / k) + 4.0 * d * (x - s0);
    close(r.cycle_work_j[1], want, 1e-4, "with dry friction");
}

#[test]
fn oracle_a_damper_takes_pi_c_omega_a_squared() {
    // Sine of amplitude A with speed Aω in the middle: π c (Aω) A.
    let m = with_axial(common::channel(800.0, [100.0, 1000.0], [0.2, 0.2], 1e6, 0.0));
    for (phase, c) in [(0.0, 100.0), (1.0, 1000.0), (0.5, 550.0)] {
        let t = Cycling { wave: Wave::Sine, damping_phase: phase, ..test(Axis::X, 0.03, 0.1) };
        let r = run(&m, &t).expect("runs");
        close(r.cycle_work_j[0], core::f64::consts::PI * c * 0.1 * 0.03, 1e-5, "damper");
    }
}

#[test]
fn oracle_loading_and_unloading_branches_enclose_their_difference() {
    // Branches 1000 x and 600 x: half their difference is lost like friction that grows with x.
    let mut c = common::channel(1000.0, [0.0, 0.0], [0.2, 0.2], 1e6, 0.0);
    c.unloading = PiecewiseCurve { points: vec![[0.0, 0.0], [0.1, 60.0]] };
    c.branch_change = 1e-4;
    let (a, s) = (0.08, 1e-4);
    let r = run(&with_axial(c), &test(Axis::X, a, 1e-3)).expect("runs");
    // Two triangles of ½ (k₁ − k₂) A²; at the outer turns the bristle takes s to turn over, which
    // takes 2 · ½(k₁ − k₂) A · s off each, and next to nothing at zero.
    let want = 400.0 * a * a - 2.0 * 2.0 * 200.0 * a * s;
    close(r.cycle_work_j[1], want, 2e-3, "branches");
}

#[test]
fn invariant_work_is_stored_or_lost_on_every_axis() {
    for (name, choice) in BOTH {
        let m = apas(choice);
        for axis in Axis::ALL {
            let (end, speed) = if axis.turns() { (0.05, 0.0175) } else { (0.03, 0.05) };
            let end = if axis == Axis::X { 0.009 } else { end };
            for (offset, phase) in [([0.0; 6], 0.0), ([-0.02, 0.02, 0.0, 0.0, 0.035, 0.0], 1.0)] {
                let t = Cycling { offset, damping_phase: phase, ..test(axis, end, speed) };
                let r = run(&m, &t).expect("runs");
                let (a, b) = (&r.samples[0], r.samples.last().expect("samples"));
                let (work, lost) = (b.work_j - a.work_j, b.lost_j - a.lost_j);
                let stored = b.stored_j - a.stored_j;
                let scale = lost.abs().max(b.stored_j.max(a.stored_j));
                let error = (work - lost - stored) / scale;
                println!("{name} {}: {work:.4} J, off by {error:.1e}", axis.name());
                assert!(error.abs() < 2e-3, "{name} {}: {error:e}", axis.name());
                assert!(r.cycle_lost_j.iter().all(|j| *j > 0.0), "{name} {}", axis.name());
            }
        }
    }
}

#[test]
fn oracle_figures_of_the_default_mechanism_are_those_of_its_file() {
    for (name, choice) in BOTH {
        let m = apas(choice);
        for (axis, soft, negative, positive) in [
            (Axis::X, 3e5, -0.15, 0.01),
            (Axis::Y, 800.0, -0.12, 0.12),
            (Axis::Roll, 600.0, -15f64.to_radians(), 15f64.to_radians()),
            (Axis::Pitch, 1000.0, -10f64.to_radians(), 10f64.to_radians()),
        ] {
            // Sideways and in rotation the ring of the legs moves along other axes too; axially it
            // must be held, or it would give way (see below).
            let others = if axis == Axis::X { Others::Held } else { Others::Free };
            let f = characterise(&m, axis, others).expect("runs").figures;
            println!("{name} {f:?}");
            let what = format!("{name} {}", axis.name());
            close(f.soft_stiffness, soft, 2e-3, &format!("{what} soft stiffness"));
            // The file of the legs gives its travels to first order at rest.
            let near = if choice == AttenuationChoice::Characteristic { 1e-6 } else { 0.15 };
            close(f.travel[0].expect("travel"), negative, near, &format!("{what} travel"));
            close(f.travel[1].expect("travel"), positive, near, &format!("{what} travel"));
            if axis == Axis::X {
                close(f.friction, 250.0, 0.01, &format!("{what} dry friction"));
                let [at, force] = f.slip.expect("slips");
                close(at, -2500.0 / 3e5, 0.02, &format!("{what} slip at"));
                close(force, -2750.0, 0.01, &format!("{what} slip force"));
                assert!(f.working_stiffness.abs() < 0.1 * soft, "{what} {}", f.working_stiffness);
            } else if choice == AttenuationChoice::Characteristic {
                assert!(f.friction < 1e-3 * soft * f.soft_amplitude, "{what} {}", f.friction);
                close(f.working_stiffness, soft, 1e-3, &format!("{what} working stiffness"));
                let stop = if axis == Axis::Y { 1e5 } else { 5e4 };
                close(f.stop_stiffness, stop + soft, 1e-3, &format!("{what} stop"));
                close(f.end_reaction[1], soft * positive, 3e-3, &format!("{what} end"));
            }
        }
    }
}

#[test]
fn oracle_free_and_held_agree_where_axes_are_independent() {
    let m = apas(AttenuationChoice::Characteristic);
    for (axis, end, speed) in [(Axis::X, 0.009, 0.01), (Axis::Y, 0.1, 0.05), (Axis::Yaw, 0.1, 0.05)]
    {
        let held = run(&m, &test(axis, end, speed)).expect("runs");
        let free = run(&m, &Cycling { others: Others::Free, ..test(axis, end, speed) });
        let free = free.expect("finds equilibrium");
        close(free.cycle_work_j[1], held.cycle_work_j[1], 2e-3, axis.name());
        assert!(free.residual_n < 1e-6, "{}", free.residual_n);
    }
}

#[test]
fn invariant_free_axes_carry_nothing_and_the_legs_take_the_ring_along() {
    let m = apas(AttenuationChoice::Differential);
    let t = Cycling { others: Others::Free, ..test(Axis::Y, 0.1, 0.02) };
    let free = run(&m, &t).expect("finds equilibrium");
    let held = run(&m, &Cycling { others: Others::Held, ..t }).expect("runs");
    let peak = |r: &[docktwin_physics::bench::Sample], i: usize| {
        r.iter().map(|s| s.reaction[i].abs()).fold(0.0, f64::max)
    };
    assert!(free.residual_n < 1e-3, "{}", free.residual_n);
    // Held, the ring pulls on the longitudinal brake; free, it comes nearer to the chaser instead.
    let (x_held, x_free) = (peak(&held.samples, 0), peak(&free.samples, 0));
    println!("axial reaction {x_held:.0} N held, {x_free:.1e} N free");
    assert!(x_held > 2000.0, "{x_held}");
    assert!(peak(&free.samples, 1) < 0.5 * peak(&held.samples, 1));
    let drift = free.samples.iter().map(|s| s.deflection[0]).fold(0.0, f64::min);
    println!("drift along X {:.1} mm", 1e3 * drift);
    assert!((-0.05..-0.001).contains(&drift), "{drift}");
}

fn at(q: &Six, m: &DockingMechanism) -> AttenuatorGeometry {
    let d = DVec3::new(q[0], q[1], q[2]) + DVec3::X * m.ring_rest_offset_m;
    let psi = DVec3::new(q[3], q[4], q[5]);
    AttenuatorGeometry::new(
        Pose::new(d, docktwin_core::DQuat::from_scaled_axis(psi)),
        m.ring_rest_offset_m,
    )
}

#[test]
fn oracle_elastic_wrench_is_the_gradient_of_the_stored_energy() {
    let state = AttenuatorState::default();
    for (name, choice) in BOTH {
        let m = apas(choice);
        for pose in
            [[0.0; 6], [-0.1, 0.05, -0.09, 0.1, -0.12, 0.05], [0.011, 0.125, 0.0, 0.0, 0.18, 0.0]]
        {
            let g = at(&pose, &m);
            let w = elastic_wrench(&m.attenuator, &g, &state);
            for k in 0..6 {
                // A virtual displacement of the ring: translation, or a turn about `e3`'s axis.
                let moved = |eps: f64| {
                    let x = Pose::new(
                        DVec3::new(pose[0], pose[1], pose[2]) + DVec3::X * m.ring_rest_offset_m,
                        docktwin_core::DQuat::from_scaled_axis(DVec3::new(
                            pose[3], pose[4], pose[5],
                        )),
                    );
                    let unit = [DVec3::X, DVec3::Y, DVec3::Z][k % 3] * eps;
                    let x = if k < 3 {
                        Pose::new(x.p + unit, x.q)
                    } else {
                        Pose::new(x.p, docktwin_core::DQuat::from_scaled_axis(unit) * x.q)
                    };
                    let g = AttenuatorGeometry::new(x, m.ring_rest_offset_m);
                    stored_energy(&m.attenuator, &g, &state)
                };
                let eps = 1e-6;
                let want = -(moved(eps) - moved(-eps)) / (2.0 * eps);
                let got = if k < 3 { w.f[k] } else { w.m[k - 3] };
                assert!((got - want).abs() < 1e-3 + 1e-6 * want.abs(), "{name} {k}: {got} {want}");
            }
        }
    }
}

#[test]
fn invariant_stiffness_has_a_potential_and_is_symmetric() {
    for (name, choice) in BOTH {
        let m = apas(choice);
        for pose in [
            [0.0; 6],
            [0.0, 0.02, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.02, 0.0, 0.0, 2f64.to_radians(), 0.0],
            [-0.05, 0.03, -0.06, 0.1, -0.05, 0.08],
        ] {
            let t = tangent(&m, &pose).expect("computes");
            for i in 0..6 {
                for j in 0..i {
                    let scale = (t.stiffness[i][i] * t.stiffness[j][j]).abs().sqrt();
                    for (what, a) in [
                        ("stiffness", &t.stiffness),
                        ("damping before", &t.damping_before),
                        ("damping after", &t.damping_after),
                    ] {
                        let scale = scale.max((a[i][i] * a[j][j]).abs().sqrt());
                        let odd = (a[i][j] - a[j][i]).abs() / scale;
                        assert!(odd < 1e-6, "{name} {what} {pose:?} [{i}][{j}] {odd:e}");
                    }
                }
            }
        }
    }
}

#[test]
fn oracle_six_by_six_of_the_legs_is_jacobian_transposed_k_jacobian() {
    let m = apas(AttenuationChoice::Differential);
    let Attenuator::Differential(d) = &m.attenuator else { panic!("differential") };
    let t = tangent(&m, &[0.0; 6]).expect("computes");
    let rest = DVec3::X * m.ring_rest_offset_m;
    let jacobian: [Six; 6] = core::array::from_fn(|i| {
        let n = (rest + d.ring_joints_m[i] - d.base_joints_m[i]).normalize();
        let c = d.ring_joints_m[i].cross(n);
        [n.x, n.y, n.z, c.x, c.y, c.z]
    });
    let gain: [Six; 6] = core::array::from_fn(|r| {
        core::array::from_fn(|k| (0..6).map(|leg| d.coupling[r][leg] * jacobian[leg][k]).sum())
    });
    let form = |of: &dyn Fn(&AxisChannel) -> f64, i: usize, j: usize| -> f64 {
        (0..6).map(|r| of(&d.channels[r]) * gain[r][i] * gain[r][j]).sum()
    };
    let k = |c: &AxisChannel| c.loading.points[1][1] / c.loading.points[1][0];
    let phase = |f: fn(&DampingPhases) -> f64| move |c: &AxisChannel| f(&c.damping);
    let (before, after) = (phase(|p| p.before_capture), phase(|p| p.after_capture));
    for i in 0..6 {
        for j in 0..6 {
            for (what, got, of) in [
                ("K", &t.stiffness, &k as &dyn Fn(&AxisChannel) -> f64),
                ("before", &t.damping_before, &before),
                ("after", &t.damping_after, &after),
            ] {
                let scale = (form(of, i, i) * form(of, j, j)).sqrt();
                let error = (got[i][j] - form(of, i, j)).abs() / scale;
                assert!(error < 1e-6, "{what}[{i}][{j}] {error:e}");
            }
        }
    }
    // The coupling between sideways motion and tilt that the model file announces.
    let most = |a| coupling(a, 1, 5).abs().max(coupling(a, 1, 4).abs());
    println!("coupling {:.3} {:.3}", most(&t.damping_before), most(&t.damping_after));
    close(most(&t.damping_before), 0.57, 0.01, "coupling before capture");
    close(most(&t.damping_after), 0.54, 0.01, "coupling after capture");
}

/// A ring on legs that carry F between hinges a height apart gives way sideways when F over that
/// height passes the sideways stiffness.
#[test]
fn oracle_compressed_legs_give_way_like_a_column_on_hinges() {
    let m = apas(AttenuationChoice::Characteristic);
    assert_eq!(instability(&m, Axis::X, -0.1), Ok(None), "independent axes have nothing to lose");
    let m = apas(AttenuationChoice::Differential);
    let Attenuator::Differential(d) = &m.attenuator else { panic!("differential") };
    assert_eq!(instability(&m, Axis::X, 0.008), Ok(None), "tension holds the ring");
    let lost = instability(&m, Axis::X, -0.01).expect("runs").expect("gives way");
    println!("{lost:?}");
    assert!(lost.weakest == Axis::Y || lost.weakest == Axis::Z, "{:?}", lost.weakest);
    // Each leg carries F₁ along n; its hinge moves sideways with −F₁ (1 − n_y²)/l.
    let rest = DVec3::X * m.ring_rest_offset_m;
    let (mut axial, mut sideways) = (0.0, 0.0);
    for i in 0..6 {
        let leg = rest + d.ring_joints_m[i] - d.base_joints_m[i];
        let n = leg.normalize();
        axial += n.x;
        sideways += (1.0 - n.y * n.y) / leg.length();
    }
    let spring = 800.0 / sideways * axial;
    // Of the reaction the dry friction is no part of the stored energy.
    // The stiffness of y is coupled to the tilt, so that it is lost a little before.
    close(lost.reaction, -(spring + 250.0), 0.02, "axial force at which it gives way");
}

#[test]
fn oracle_a_contact_loop_takes_two_thirds_k_a_depth_squared_speed() {
    let m = common::apas();
    let NormalLaw::HuntCrossley { stiffness, damping_s_m, exponent } = m.contact.normal else {
        panic!("Hunt and Crossley")
    };
    close(exponent, 1.0, 1e-12, "exponent");
    let (depth, speed) = (0.01, 0.35);
    let points = contact_loop(&m.contact, depth, speed, 4000);
    let area: f64 =
        points.windows(2).map(|w| 0.5 * (w[0][1] + w[1][1]) * (w[1][0] - w[0][0])).sum();
    close(area, 2.0 / 3.0 * stiffness * damping_s_m * depth * depth * speed, 1e-5, "loop");
}

#[test]
fn regress_tests_that_cannot_be_done_are_refused() {
    let mut m = common::apas();
    let good = test(Axis::X, 0.005, 0.01);
    for bad in [
        Cycling { speed: 0.0, ..good },
        Cycling { speed: f64::NAN, ..good },
        Cycling { ends: [1e3, -1e3], ..good },
        Cycling { cycles: 0, ..good },
        Cycling { ends: [0.0, 0.0], ..good },
        Cycling { offset: [f64::INFINITY; 6], ..good },
    ] {
        assert_eq!(run(&m, &bad).err(), Some(BenchError::Motion), "{bad:?}");
    }
    assert_eq!(tangent(&m, &[f64::NAN; 6]), Err(BenchError::Motion));
    m.attenuator = Attenuator::Rigid;
    assert_eq!(run(&m, &good).err(), Some(BenchError::Rigid));
    assert_eq!(tangent(&m, &[0.0; 6]), Err(BenchError::Rigid));
    assert_eq!(travel(&m, Axis::X, 1.0, Others::Held, 0.01, 0.1), Err(BenchError::Rigid));
    assert!(slope(&run(&common::apas(), &good).expect("runs"), 7, |_, _| true).is_none());
}
