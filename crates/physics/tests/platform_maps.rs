//! Maps over the docking workspace: closed forms, other ways of computing, and the figures of the
//! sizing study of the default rig.
use std::path::Path;

use docktwin_core::{DMat3, DVec3, Pose, Twist, Wrench};
use docktwin_model::{DockingWorkspace, HydraulicPreset, Place, Rig, load_rig};
use docktwin_physics::platform::{Platform, maps::*};

fn rig() -> Rig {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf/stewart.urdf");
    load_rig(&path).unwrap_or_else(|e| panic!("{e}")).model
}

fn oil(rig: &Rig, preset: HydraulicPreset) -> f64 {
    rig.leg_hydraulics(preset).expect("on oil").oil_spring_n_m()
}

/// Inertia of a point mass about a point at `r` from it.
fn point(mass_kg: f64, r: DVec3) -> DMat3 {
    let outer = DMat3::from_cols(r * r.x, r * r.y, r * r.z);
    (DMat3::from_diagonal(DVec3::splat(r.length_squared())) - outer) * mass_kg
}

/// The rig as the sizing study had it: attitude turns about the middle of the plate joints, and of
/// the 150 kg of a rod one half moves with the plate joint, the other along the leg only. The first
/// half is here part of the plate.
fn of_the_study(rig: &Rig) -> Rig {
    let mut study = rig.clone();
    study.docking.middle_m += rig.x_4p.p;
    study.x_4p = Pose::IDENTITY;
    for leg in &mut study.legs {
        leg.cross_inertia_kg_m2 = DMat3::ZERO;
        for part in [&mut leg.cylinder, &mut leg.rod] {
            (part.mass_kg, part.axial_kg_m2, part.transverse_kg_m2) = (0.0, 0.0, 0.0);
        }
    }
    let (m, com) = (rig.plate.mass_kg, rig.plate.com_m);
    let all = m + 6.0 * 75.0;
    study.plate.mass_kg = all;
    study.plate.com_m = com * (m / all);
    study.plate.inertia_kg_m2 += point(m, com - study.plate.com_m);
    for leg in &rig.legs {
        study.plate.inertia_kg_m2 += point(75.0, leg.plate_joint_m - study.plate.com_m);
    }
    study
}

#[test]
fn oracle_figures_of_the_sizing_study() {
    let rig = of_the_study(&rig());
    let maps = Maps::new(&rig);
    let w = maps.workspace();
    println!("{w:?}");
    assert!((w.lengths_m[0] - 3.16).abs() < 0.005 && (w.lengths_m[1] - 5.31).abs() < 0.005);
    // One leg alone needs a little less than 2.15 m: none is both the shortest and the longest.
    assert!((w.lengths_m[1] - w.lengths_m[0] - 2.15).abs() < 0.005 && w.stroke_m < 2.14);

    // The half that moves along the leg only adds 75 kg to every effective mass.
    let masses = |place: Place| {
        let c = maps.at(place);
        maps.platform().effective_masses_kg(&c).expect("not singular").map(|m| m + 75.0)
    };
    let middle = masses(Place([0.0; 6]));
    let (mut least, mut greatest) = (f64::INFINITY, 0.0_f64);
    for place in DockingWorkspace::corners() {
        let m = masses(place);
        (least, greatest) = (least.min(m[0]), greatest.max(m[5]));
    }
    println!("middle {middle:.0?}, corners {least:.0} to {greatest:.0}");
    assert!((middle[0] - 507.0).abs() < 1.0 && (middle[5] - 2190.0).abs() < 1.0, "{middle:?}");
    assert!((least - 451.0).abs() < 1.0 && (greatest - 2938.0).abs() < 1.0);
    let h = rig.leg_hydraulics(HydraulicPreset::Printed).expect("on oil");
    assert!((h.natural_frequency_hz(greatest) - 15.4).abs() < 0.05);
    assert!((h.natural_frequency_hz(least) - 39.4).abs() < 0.05);

    println!("fastest leg {:.4} m/s", w.fastest_leg_m_s.0);
    assert!((w.fastest_leg_m_s.0 - 0.426).abs() < 0.002, "{:?}", w.fastest_leg_m_s);
}

#[test]
fn oracle_stiffness_at_the_port() {
    let rig = rig();
    let maps = Maps::new(&rig);
    let map =
        maps.frequencies(oil(&rig, HydraulicPreset::Printed), &[0.0; 6]).expect("not singular");
    println!("middle {:.0?}", map.middle.stiffness);
    for (i, s) in map.stiffness.iter().enumerate() {
        println!("{i}: {:.3e} at {} to {:.3e}", s.least.0, s.least.1, s.greatest.0);
    }
    // By hand along X: six springs under the same inclination, 6 k cos².
    let cos = 3.0 / rig.legs[0].middle_length_m;
    let want = 6.0 * 2.76e7 * cos * cos;
    assert!((map.middle.stiffness[0] / want - 1.0).abs() < 1e-9);
    // The study: 85 MN/m axial and 39 lateral in the middle, 32 at the worst corner.
    assert!((map.middle.stiffness[0] / 85e6 - 1.0).abs() < 0.01);
    assert!((map.middle.stiffness[1] / 39e6 - 1.0).abs() < 0.02);
    assert!((map.stiffness[1].least.0.min(map.stiffness[2].least.0) / 32e6 - 1.0).abs() < 0.05);
}

#[test]
fn oracle_modes_of_equal_springs_are_the_effective_masses() {
    let rig = rig();
    let maps = Maps::new(&rig);
    for place in DockingWorkspace::corners().take(8) {
        let c = maps.at(place);
        for (_, preset) in HydraulicPreset::WORDS {
            let h = rig.leg_hydraulics(preset).expect("on oil");
            let modes = maps.modes(&c, h.oil_spring_n_m(), &[0.0; 6]).expect("not singular");
            let mut masses = maps.platform().effective_masses_kg(&c).expect("not singular");
            masses.reverse();
            for (f, m) in modes.frequency_hz.iter().zip(masses) {
                assert!((f / h.natural_frequency_hz(m) - 1.0).abs() < 1e-9, "{f} {m}");
            }
        }
    }
}

#[test]
fn oracle_a_mode_swings_with_its_frequency() {
    // The nonlinear reduced rig, let go a little way along a mode, passes the middle again after
    // half a period: no matrix of the maps takes part.
    let mut rig = rig();
    rig.gravity_m_s2 = DVec3::ZERO;
    let maps = Maps::new(&rig);
    let platform = Platform::new(&rig);
    let x0 = platform.middle();
    let c0 = platform.at(&x0);
    let k = oil(&rig, HydraulicPreset::Printed);
    let modes = maps.modes(&c0, k, &[0.0; 6]).expect("not singular");
    for n in [0, 2, 5] {
        let s = modes.shape.column(n);
        // Shape in docking coordinates to a displacement of 20 µm or 20 µrad at most.
        let scale = 2e-5 / s.amax();
        let displaced = maps
            .displaced(DVec3::new(s[0], s[1], s[2]) * scale, DVec3::new(s[3], s[4], s[5]) * scale);
        let (mut x, mut t) = (displaced, Twist::default());
        let along = |x: &Pose| {
            let l = platform.at(x).length_m;
            let first = platform.at(&displaced).length_m;
            (0..6).map(|i| (l[i] - c0.length_m[i]) * (first[i] - c0.length_m[i])).sum::<f64>()
        };
        // Leapfrog; its frequency is high by (w h)²/24.
        let h = 1e-5;
        let (mut time, mut before) = (0.0, along(&x));
        let mut crossings = Vec::new();
        while crossings.len() < 3 {
            x = Platform::moved(&x, &t, 0.5 * h);
            let c = platform.at(&x);
            let forces = core::array::from_fn(|i| -k * (c.length_m[i] - c0.length_m[i]));
            let a = platform.forward_dynamics(&c, &t, &forces, &Wrench::ZERO).expect("definite");
            t = Twist { v: t.v + a.v * h, w: t.w + a.w * h };
            x = Platform::moved(&x, &t, 0.5 * h);
            time += h;
            let now = along(&x);
            if before * now < 0.0 {
                crossings.push(time - h * now / (now - before));
            }
            before = now;
        }
        let hz = 1.0 / (crossings[2] - crossings[0]);
        println!("mode {n}: {hz:.4} Hz against {:.4}", modes.frequency_hz[n]);
        assert!((hz / modes.frequency_hz[n] - 1.0).abs() < 1e-3);
    }
}

#[test]
fn oracle_payload_stiffness_stands_beside_the_oil() {
    let rig = rig();
    let maps = Maps::new(&rig);
    let c = maps.at(Place([0.0; 6]));
    for (word, preset) in HydraulicPreset::WORDS {
        let k = oil(&rig, preset);
        let free = maps.modes(&c, k, &[0.0; 6]).expect("not singular");
        for dof in 0..3 {
            let mut payload = [0.0; 6];
            payload[dof] = 1e6;
            let held = maps.modes(&c, k, &payload).expect("not singular");
            // Springs side by side against a force: K + 1e6 N/m.
            let sum = free.stiffness[dof] + 1e6;
            assert!((held.stiffness[dof] / sum - 1.0).abs() < 1e-9);
            for i in 0..6 {
                let rise = held.frequency_hz[i] / free.frequency_hz[i] - 1.0;
                // Rayleigh: never down, and at most as the stiffest ratio K/K_port.
                let most = (1.0 + 1e6 / free.stiffness[dof]).sqrt() - 1.0;
                assert!(rise > -1e-12 && rise < most + 1e-12, "{word} {dof} {i}: {rise} {most}");
            }
            let shift = (0..6)
                .map(|i| held.frequency_hz[i] / free.frequency_hz[i] - 1.0)
                .fold(0.0_f64, f64::max);
            println!(
                "{word}, 1e6 N/m along {dof}: K/K_port {:.4}, modes rise by at most {:.3} %",
                1e6 / free.stiffness[dof],
                100.0 * shift
            );
            assert!(shift > 1e-4, "{word} {dof}: it must be seen, {shift}");
        }
    }
}

#[test]
fn invariant_shapes_are_normal_and_leading_modes_exist() {
    let rig = rig();
    let maps = Maps::new(&rig);
    let k = oil(&rig, HydraulicPreset::Printed);
    let map = maps.frequencies(k, &[0.0; 6]).expect("not singular");
    for (name, f) in ["X", "Y", "Z", "roll", "pitch", "yaw"].iter().zip(map.held_hz) {
        println!(
            "{name}: {:.2} Hz ({}) to {:.2} Hz ({})",
            f.least.0, f.least.1, f.greatest.0, f.greatest.1
        );
    }
    for (n, f) in map.mode_hz.iter().enumerate() {
        println!("mode {n}: {:.2} to {:.2} Hz", f.least.0, f.greatest.0);
    }
    println!(
        "middle: {:.2?} Hz, held {:.2?}, leading {:?}",
        map.middle.frequency_hz, map.middle.held_hz, map.middle.leading
    );
    println!(
        "effective masses {:.0?}, {:.0} to {:.0}",
        map.effective_mass_middle_kg,
        map.effective_mass_kg.least.0,
        map.effective_mass_kg.greatest.0
    );
    for place in DockingWorkspace::corners() {
        let modes = maps.modes(&maps.at(place), k, &[0.0; 6]).expect("not singular");
        for dof in 0..6 {
            // Rayleigh: a motion of one degree of freedom lies between the extreme modes.
            assert!(modes.held_hz[dof] >= modes.frequency_hz[0] - 1e-9);
            assert!(modes.held_hz[dof] <= modes.frequency_hz[5] + 1e-9);
        }
    }
    // Threefold symmetry of the middle: Y and Z alike, pitch and yaw alike.
    let m = &map.middle;
    for (a, b) in [(1, 2), (4, 5)] {
        assert!((m.held_hz[a] / m.held_hz[b] - 1.0).abs() < 1e-6, "{:?}", m.held_hz);
    }
}

#[test]
fn oracle_capability_by_brute_force() {
    let rig = rig();
    let maps = Maps::new(&rig);
    let got = maps.capability().expect("not singular");
    println!(
        "position ±{:.3} mm, attitude ±{:.4} deg; allowed leg error {:.3} mm",
        got.position_error_m * 1e3,
        got.attitude_error_rad.to_degrees(),
        got.leg_error_allowed_m * 1e3
    );
    println!(
        "payload {:.0?} kg at rest, {:.0?} kg at 10 Hz",
        got.payload_at_rest_kg.0, got.payload_at_10_hz_kg.0
    );
    println!("range {:.3?}", got.range);

    // Tolerance: every combination of signs of the legs' errors through forward kinematics.
    let e = rig.limits.length_error_m;
    let (mut position, mut attitude) = (0.0_f64, 0.0_f64);
    for place in DockingWorkspace::grid() {
        let c = maps.at(place);
        let x_34 = maps.platform().docking_from_plate(&c.x_bp);
        for signs in DockingWorkspace::corners() {
            let lengths: [f64; 6] = core::array::from_fn(|i| c.length_m[i] + e * signs.0[i]);
            let t = c.twist(&signs.0.map(|s| s * e)).expect("not singular");
            let near = Platform::moved(&c.x_bp, &t, 1.0);
            let x = maps.platform().forward(&lengths, &near).expect("near").x_bp;
            let off = maps.platform().docking_from_plate(&x);
            let turn = (off.q * x_34.q.conjugate()).to_scaled_axis();
            position = position.max((off.p - x_34.p).abs().max_element());
            attitude = attitude.max(turn.abs().max_element());
        }
    }
    assert!((position / got.position_error_m - 1.0).abs() < 2e-3, "{position}");
    assert!((attitude / got.attitude_error_rad - 1.0).abs() < 2e-3, "{attitude}");

    // Payload at rest: with that mass at e4 the worst leg bears its limit, nowhere more.
    let mut loaded = rig.clone();
    let (m, extra) = (rig.plate.mass_kg, got.payload_at_rest_kg.0);
    let e4 = rig.x_4p.inverse().p;
    loaded.plate.mass_kg = m + extra;
    loaded.plate.com_m = (m * rig.plate.com_m + extra * e4) / (m + extra);
    let heavy = Platform::new(&loaded);
    let still = Twist::default();
    let mut most = 0.0_f64;
    for place in DockingWorkspace::grid() {
        let c = maps.at(place);
        let forces =
            heavy.inverse_dynamics(&c, &still, &still, &Wrench::ZERO).expect("not singular");
        most = forces.iter().fold(most, |a, f| a.max(f.abs()));
    }
    assert!((most / rig.limits.force_n - 1.0).abs() < 1e-6, "{most}");

    // Range: inside it everything has room, beyond it something has not.
    for (i, [down, up]) in got.range.iter().enumerate() {
        for end in [*down, *up] {
            let at = |s: f64| {
                let v = DVec3::AXES[i % 3] * end * s;
                let (p, w) = if i < 3 { (v, DVec3::ZERO) } else { (DVec3::ZERO, v) };
                let r = maps.reach(&maps.displaced(p, w));
                r.reached() && r.singularity > 0.02
            };
            assert!(at(0.999) && !at(1.001), "{i}: {end}");
        }
    }
    let w = maps.workspace();
    println!("{w:?}");
    assert!(w.stroke_margin_m.0 > 0.1, "{:?}", w.stroke_margin_m);
}
