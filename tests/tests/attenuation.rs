//! The attenuators of the default mechanism on a test bench: force over displacement on every axis,
//! coupling, and how long attenuation lasts after capture (Fig. 6–9, published time scales).

use std::path::{Path, PathBuf};

use docktwin_core::{DVec3, Euler, Pose, Twist};
use docktwin_model::{AttenuationChoice, DockingMechanism, load_mechanism, load_spacecraft};
use docktwin_physics::{
    attenuator::{AttenuatorGeometry, AttenuatorState, force},
    initial::{ContactConditions, initial_state},
    mechanism::System,
    reduced::{DockingTwin, Inputs, ReducedTwin},
};

fn models(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/urdf").join(file)
}

fn mechanism(choice: AttenuationChoice) -> DockingMechanism {
    load_mechanism(&models("apas_active.urdf"), &models("apas_passive.urdf"), Some(choice))
        .expect("the default mechanism")
        .model
}

const BOTH: [(&str, AttenuationChoice); 2] = [
    ("characteristic", AttenuationChoice::Characteristic),
    ("differential", AttenuationChoice::Differential),
];

/// Drives the ring slowly along one axis to `amplitude`, back to `-back`, and returns to zero;
/// gives (displacement, force or moment on that axis) a thousand times.
fn sweep(
    m: &DockingMechanism,
    axis: usize,
    amplitude: f64,
    back: f64,
    seconds: f64,
) -> Vec<(f64, f64)> {
    let mut state = AttenuatorState::default();
    let h = 1e-4;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few thousand")]
    let steps = (seconds / h) as usize;
    let mut out = Vec::new();
    let at = |i: usize| {
        #[expect(clippy::cast_precision_loss, reason = "small")]
        let s = i as f64 / steps as f64;
        // Three quarters of a triangle wave: out, through zero, back.
        if s < 0.4 {
            amplitude * s / 0.4
        } else if s < 0.8 {
            amplitude - (amplitude + back) * (s - 0.4) / 0.4
        } else {
            -back + back * (s - 0.8) / 0.2
        }
    };
    for i in 0..steps {
        let (x, v) = (at(i), (at(i + 1) - at(i)) / h);
        let unit = [DVec3::X, DVec3::Y, DVec3::Z][axis % 3];
        let (d, psi, rel) = if axis < 3 {
            (unit * x, DVec3::ZERO, Twist { v: unit * v, w: DVec3::ZERO })
        } else {
            (DVec3::ZERO, unit * x, Twist { v: DVec3::ZERO, w: unit * v })
        };
        let x_3r = Pose::new(
            DVec3::X * m.ring_rest_offset_m + d,
            docktwin_core::DQuat::from_scaled_axis(psi),
        );
        let g = AttenuatorGeometry::new(x_3r, m.ring_rest_offset_m);
        let f = force(&m.attenuator, &g, &state, rel, 0.0, h);
        state = f.next;
        if i % (steps / 1000).max(1) == 0 {
            let w = f.on_ring;
            out.push((x, -if axis < 3 { w.f.dot(unit) } else { w.m.dot(unit) }));
        }
    }
    out
}

/// Slope of force over displacement between two displacements of the first quarter (loading).
fn slope(curve: &[(f64, f64)], a: f64, b: f64) -> f64 {
    let near = |x: f64| {
        *curve[..380]
            .iter()
            .min_by(|p, q| (p.0 - x).abs().total_cmp(&(q.0 - x).abs()))
            .expect("points")
    };
    let (p, q) = (near(a), near(b));
    (q.1 - p.1) / (q.0 - p.0)
}

#[test]
fn oracle_force_over_displacement_on_every_axis() {
    for (name, choice) in BOTH {
        let m = mechanism(choice);
        // Compression: spring of 3e5 N/m up to the brake's 2500 N, then nearly flat; dry friction of
        // 250 N beside it.
        let x = sweep(&m, 0, -0.04, 0.004, 40.0);
        let stiff = slope(&x, -0.003, -0.006);
        let plateau = slope(&x, -0.015, -0.035);
        let peak = x.iter().map(|p| p.1.abs()).fold(0.0, f64::max);
        println!(
            "{name}: X {stiff:.3e} N/m, after the brake slips {plateau:.2e} N/m, peak {peak:.0} N"
        );
        assert!((stiff / 3e5 - 1.0).abs() < 0.05, "{stiff}");
        assert!(plateau.abs() < 0.05 * stiff, "{plateau}");
        assert!((2700.0..2850.0).contains(&peak), "{peak}");
        // Unloading: the loop encloses work, the brake keeps its slip.
        let work: f64 = x.windows(2).map(|w| 0.5 * (w[0].1 + w[1].1) * (w[1].0 - w[0].0)).sum();
        assert!(work > 60.0, "{name}: the axial loop dissipates {work} J");

        // The soft channels: one tenth of a per cent of the axial stiffness and less.
        for (axis, want, amplitude, unit) in [
            (1, 800.0, 0.08, "N/m"),
            (2, 800.0, 0.08, "N/m"),
            (3, 600.0, 0.15, "N·m/rad"),
            (4, 1000.0, 0.1, "N·m/rad"),
            (5, 1000.0, 0.1, "N·m/rad"),
        ] {
            // Held at constant x, a large sideways move of the differential ring lengthens all six
            // legs and pulls on the longitudinal brake: the coupling between axes. Its own stiffness
            // shows in a small one.
            let small = if choice == AttenuationChoice::Differential { 0.05 } else { 1.0 };
            let amplitude = amplitude * small;
            let c = sweep(&m, axis, amplitude, amplitude, 200.0);
            let k = slope(&c, 0.1 * amplitude, 0.3 * amplitude);
            println!("{name}: axis {axis} {k:.0} {unit}");
            assert!((k / want - 1.0).abs() < 0.12, "{name} axis {axis}: {k} against {want}");
        }
        // End stop of the lateral travel.
        if choice == AttenuationChoice::Characteristic {
            let c = sweep(&m, 1, 0.13, 0.0, 200.0);
            let stop = slope(&c, 0.123, 0.128);
            assert!((stop / 1.008e5 - 1.0).abs() < 0.05, "{stop}");
        }
    }
}

/// Time after which the square of a rate stays below a tenth of its start, s.
fn nine_tenths_gone(rates: &[(f64, f64)], start: f64) -> f64 {
    rates.iter().rev().find(|(_, v)| v * v > 0.1 * start * start).map_or(0.0, |(t, _)| *t)
}

#[test]
fn oracle_attenuation_lasts_tenths_seconds_and_tens_of_seconds() {
    let chaser = load_spacecraft(&models("chaser_8t.urdf")).expect("chaser").model;
    let target = load_spacecraft(&models("target_12t.urdf")).expect("target").model;
    for (name, choice) in BOTH {
        // Docked face to face: the latches catch at once, then attenuation goes on by itself.
        let run = |velocity: DVec3, rate: DVec3, seconds: f64| {
            let system = System::new(&chaser, &target, mechanism(choice));
            let conditions = ContactConditions {
                attitude: Euler::default(),
                lateral_m: DVec3::ZERO,
                velocity_m_s: velocity,
                rate_rad_s: rate,
                ..ContactConditions::default()
            };
            let start = initial_state(&system, &conditions, 1e-4);
            let mut twin = ReducedTwin::new(system, start.bodies, 2e-4);
            let mut out = Vec::new();
            let mut t = 0.0;
            while t < seconds {
                for _ in 0..50 {
                    twin.step(&Inputs::default());
                }
                t += 0.01;
                let s = twin.state();
                let mass = *twin.system().mass();
                let poses = s.poses();
                let f = twin.system().poses(&poses);
                let at = |i: usize| {
                    let tw = s.bodies[i].twist(&mass[i]);
                    (tw.v + tw.w.cross(f.x_wp.p - poses[i].p), tw.w)
                };
                let ((vc, wc), (vt, wt)) = (at(0), at(2));
                let back = f.x_w3.q.conjugate();
                out.push((t, back * (vt - vc), back * (wt - wc)));
            }
            assert!(twin.state().mechanism.captured_s().is_some(), "{name}: never captured");
            out
        };
        let slow = 0.01;
        let axial = run(DVec3::X * -0.35, DVec3::ZERO, 20.0);
        let gentle = run(DVec3::X * -0.07, DVec3::ZERO, 20.0);
        let lateral = run(DVec3::new(-slow, 0.05, 0.0), DVec3::ZERO, 60.0);
        let rotation = run(DVec3::X * -slow, DVec3::new(0.0, 0.5f64.to_radians(), 0.0), 150.0);
        let x = |r: &[(f64, DVec3, DVec3)]| r.iter().map(|(t, v, _)| (*t, v.x)).collect::<Vec<_>>();
        let t_axial = nine_tenths_gone(&x(&axial), 0.35);
        let t_gentle = nine_tenths_gone(&x(&gentle), 0.07);
        let y: Vec<_> = lateral.iter().map(|(t, v, _)| (*t, v.y)).collect();
        let t_lateral = nine_tenths_gone(&y, 0.05);
        let w: Vec<_> = rotation.iter().map(|(t, _, w)| (*t, w.length())).collect();
        let t_rotation = nine_tenths_gone(&w, w.iter().map(|p| p.1).fold(0.0, f64::max));
        println!(
            "{name}: 90 % gone axially in {t_axial:.2} s (0.35 m/s), {t_gentle:.2} s (0.07 m/s); \
             laterally in {t_lateral:.2} s; rotation in {t_rotation:.1} s"
        );
        assert!((0.05..1.0).contains(&t_axial), "axial {t_axial}");
        assert!((0.05..2.0).contains(&t_gentle), "axial at 0.07 m/s {t_gentle}");
        assert!((0.5..15.0).contains(&t_lateral), "lateral {t_lateral}");
        assert!((10.0..120.0).contains(&t_rotation), "rotation {t_rotation}");
    }
}
