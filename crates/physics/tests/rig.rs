//! Six hydraulic legs under the plate.
#![expect(clippy::unwrap_used, reason = "a test may fail where it stands")]

use std::path::Path;

use docktwin_core::{DVec3, Pose, Twist, Wrench};
use docktwin_model::{HydraulicPreset, Rig, load_rig};
use docktwin_physics::{
    hydraulics::LegParameters,
    platform::Platform,
    rig::{PerturbedRig, PortSpring, ReducedRig, RigState},
};

fn file() -> Rig {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf/stewart.urdf");
    load_rig(&path).unwrap().model
}

fn lossless(rig: &Rig, preset: HydraulicPreset) -> ReducedRig {
    let mut leg = LegParameters::of_drive(rig.drive.hydraulic().unwrap(), preset).ideal();
    leg.oil.leakage_m3_s_pa = 0.0;
    leg.oil.viscous_n_s_m = 0.0;
    ReducedRig::new(Platform::new(rig), &[leg; 6], 1.25e-4)
}

fn free(_: &Pose, _: &Twist) -> Wrench {
    Wrench::ZERO
}

fn step(rig: &ReducedRig, s: &mut RigState) {
    rig.step(s, &[0.0; 6], free).unwrap();
}

/// Ten seconds on six oil springs, kicked in all six degrees of freedom.
#[test]
fn invariant_the_platform_on_its_oil_springs_keeps_its_energy() {
    let file = file();
    for (word, preset) in HydraulicPreset::WORDS {
        for place in [[0.0; 6], [1.0, -1.0, 1.0, 1.0, -1.0, 1.0]] {
            let rig = lossless(&file, preset);
            let x_bp = file.plate_from_docking(&file.docking.pose(place));
            let mut s = rig.at_rest(&x_bp, &Wrench::ZERO).unwrap();
            let rest = rig.energy_j(&s);
            s.twist = Twist { v: DVec3::new(0.03, 0.05, -0.04), w: DVec3::new(0.04, -0.03, 0.02) };
            let mean = |s: &mut RigState| {
                // Half a second: several periods of every mode.
                let mut sum = 0.0;
                for _ in 0..4000 {
                    step(&rig, s);
                    sum += (rig.energy_j(s) - rest) / 4000.0;
                }
                sum
            };
            let before = mean(&mut s);
            for _ in 0..76_000 {
                step(&rig, &mut s);
            }
            let drift = mean(&mut s) / before - 1.0;
            println!("{word} {place:?}: {before:.3} J, drift {drift:.1e} in 10 s");
            assert!(drift.abs() < 1e-3, "{word} {place:?}: {drift}");
        }
    }
}

/// On its oil springs the plate has the phase of a step sixteen times shorter: plain leapfrog would be
/// 28 µm off after two seconds.
#[test]
fn invariant_the_plate_on_its_oil_is_of_high_order() {
    let file = file();
    let mut leg =
        LegParameters::of_drive(file.drive.hydraulic().unwrap(), HydraulicPreset::Printed).ideal();
    leg.oil.leakage_m3_s_pa = 0.0;
    leg.oil.viscous_n_s_m = 0.0;
    let end = |step_s: f64, steps: u32| {
        let rig = ReducedRig::new(Platform::new(&file), &[leg; 6], step_s);
        let mut s = rig.at_rest(&file.middle(), &Wrench::ZERO).unwrap();
        s.twist = Twist { v: DVec3::new(0.03, 0.05, -0.04), w: DVec3::new(0.04, -0.03, 0.02) };
        for _ in 0..steps {
            step(&rig, &mut s);
        }
        s.x_bp
    };
    let fine = end(1.5625e-5, 128_000);
    let off = [5e-4, 2.5e-4].map(|h| {
        let x = end(h, (2.0 / h).round() as u32);
        (x.p - fine.p).length()
    });
    println!("{off:?} m");
    assert!(off[0] < 5e-7 && off[1] < 0.3 * off[0], "{off:?}");
}

/// A push at the port moves the plate by its compliance, legs in series with the oil only.
#[test]
fn oracle_hydraulic_stiffness_at_the_port() {
    let file = file();
    let platform = Platform::new(&file);
    let x_bp = file.middle();
    for (i, axis) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
        let leg =
            LegParameters::of_drive(file.drive.hydraulic().unwrap(), HydraulicPreset::Printed);
        let rig = lossless(&file, HydraulicPreset::Printed);
        let c = platform.at(&x_bp);
        let arm = x_bp.q * file.x_4p.inverse().p;
        let push = Wrench::at(arm, axis * 1e4);
        let mut s = rig.at_rest(&x_bp, &Wrench::ZERO).unwrap();
        let (mut way, n) = (0.0, 64_000);
        for _ in 0..n {
            rig.step(&mut s, &[0.0; 6], |_, _| push).unwrap();
            let moved = s.x_bp.transform_point(file.x_4p.inverse().p) - x_bp.p - arm;
            way += moved.dot(axis) / f64::from(n);
        }
        let j = c.jacobian();
        let compliance = (j.transpose() * j * leg.oil.oil_spring_n_m()).try_inverse().unwrap();
        let at = nalgebra::Vector6::new(push.f.x, push.f.y, push.f.z, push.m.x, push.m.y, push.m.z);
        let exact = (at.transpose() * compliance * at)[0] / 1e4;
        println!("{i}: {way:.3e} m against {exact:.3e}: {:.1} MN/m", 1e-2 / exact);
        assert!((way / exact - 1.0).abs() < 0.01, "{way} {exact}");
    }
}

#[test]
fn invariant_it_stands_still_when_nothing_leaks() {
    let file = file();
    let x_bp = file.plate_from_docking(&file.docking.pose([1.0, 1.0, -1.0, 1.0, 1.0, -1.0]));
    let spring = PortSpring {
        port_m: file.x_4p.inverse().p,
        rest_m: x_bp.transform_point(file.x_4p.inverse().p) + DVec3::new(0.01, 0.0, 0.002),
        stiffness_n_m: DVec3::splat(1e6),
    };
    let rig = lossless(&file, HydraulicPreset::Stiff);
    let mut s = rig.at_rest(&x_bp, &spring.wrench(&x_bp)).unwrap();
    for _ in 0..8000 {
        rig.step(&mut s, &[0.0; 6], |x, _| spring.wrench(x)).unwrap();
    }
    assert!((s.x_bp.p - x_bp.p).length() < 1e-9, "{:?}", s.x_bp.p - x_bp.p);
}

#[test]
fn invariant_a_drawn_rig_is_another_rig_and_repeats() {
    let file = file();
    let draw = |seed| PerturbedRig::draw(&file, HydraulicPreset::Printed, seed);
    let (a, b, c) = (draw(1), draw(1), draw(2));
    assert_eq!(a.rig, b.rig);
    assert_eq!(a.legs, b.legs);
    assert_ne!(a.legs, c.legs);
    assert_ne!(a.rig.plate.mass_kg.to_bits(), c.rig.plate.mass_kg.to_bits());
    let legs = a.legs.hydraulic().unwrap();
    assert_ne!(legs[0], legs[1]);
    let off = a.rig.plate.mass_kg / file.plate.mass_kg - 1.0;
    assert!(off.abs() <= file.spread.plate_mass);
}
