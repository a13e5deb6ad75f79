use std::path::{Path, PathBuf};

use docktwin_core::Pose;
use docktwin_model::{RingGeometry, SurfaceCore};

use super::*;
use crate::Loader;

/// Step, s.
const H: f64 = 2e-4;

fn scenario_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../scenarios/{name}.toml"))
}

fn loaded(name: &str) -> Scenario {
    Scenario::from_path(scenario_path(name)).unwrap_or_else(|e| panic!("{e}"))
}

fn sphere(stiffness_n_m: f64, rounding_m: f64) -> Surface {
    Surface {
        name: "ball".to_owned(),
        link: "ring".to_owned(),
        x_link: Pose::IDENTITY,
        x_ring: Pose::IDENTITY,
        core: SurfaceCore::Sphere,
        rounding_m,
        stiffness_n_m,
        friction: 0.0,
    }
}

/// 200 kg with 50 kg·m² against 300 kg with 80 kg·m², ports and centres of rings at their mass centres, nothing that
/// touches, no loss.
fn bare() -> Scenario {
    let mut s = loaded("basic_ring_ring");
    (s.chaser.mass_kg, s.target.mass_kg) = (200.0, 300.0);
    s.chaser.inertia_kg_m2 = DMat3::from_diagonal(DVec3::splat(50.0));
    s.target.inertia_kg_m2 = DMat3::from_diagonal(DVec3::splat(80.0));
    (s.chaser.x_body_port, s.target.x_body_port) = (Pose::IDENTITY, Pose::IDENTITY);
    let m = &mut s.mechanism;
    (m.ring_rest_offset_m, m.passive_ring_offset_m) = (0.0, 0.0);
    for side in [&mut m.active, &mut m.passive] {
        (side.has_ring, side.petals) = (false, None);
    }
    s
}

fn found(s: &Scenario) -> Vec<TooStiff> {
    too_stiff(&Moving::of(s), H)
}

fn accepted(s: &Scenario) {
    let all = found(s);
    assert!(all.is_empty(), "{all:?}");
}

fn near(got: f64, want: f64) -> bool {
    (got / want - 1.0).abs() < 1e-9
}

#[test]
fn oracle_the_least_principal_moment_of_a_coupled_inertia() {
    // Eigenvalues 0.01, 0.99 and 1; the smallest element of the diagonal is 0.5.
    let coupled = DMat3::from_cols(
        DVec3::new(0.5, 0.49, 0.0),
        DVec3::new(0.49, 0.5, 0.0),
        DVec3::new(0.0, 0.0, 1.0),
    );
    let around = Lightness::new(2.0, coupled, DVec3::ZERO, 0.3);
    assert!(near(around.angular, 100.0), "{around:?}");
    assert!(near(around.linear, 0.5 + 0.3 * 0.3 * 100.0), "{around:?}");
    // A force at a point on X turns about Y and Z alone: (I⁻¹)_yy = 0.5/(0.25 − 0.2401).
    let ahead = Lightness::new(2.0, coupled, DVec3::X * 0.3, 0.0);
    assert!(near(ahead.linear, 0.5 + 0.09 * 0.5 / 0.0099), "{ahead:?}");
}

/// Balls of 0.1 m: 1/m = 1/200 + 0.1²/50 + 1/300 + 0.1²/80, and both in series.
#[test]
fn oracle_the_bound_of_a_pair_of_surfaces() {
    let light = 1.0 / 200.0 + 0.01 / 50.0 + 1.0 / 300.0 + 0.01 / 80.0;
    let k = 1.0 / (H * H * light);
    let mut s = bare();
    // 4/3 k and 4 k in series are k.
    s.mechanism.active.surfaces = vec![sphere(4.0 / 3.0 * k, 0.1)];
    s.mechanism.passive.surfaces = vec![sphere(4.0 * k, 0.1)];
    accepted(&s);
    s.mechanism.active.surfaces[0].stiffness_n_m *= 1.0 + 1e-6;
    let all = found(&s);
    assert_eq!(all.len(), 1, "{all:?}");
    // The stiffer of both is named.
    assert_eq!(all[0].key, "mechanism.surface.0.stiffness_n_m");
    assert_eq!(all[0].place, Place::Passive);
    assert!(all[0].most < 4.0 * k && all[0].step_s < H, "{all:?}");
    s.mechanism.passive.surfaces[0].stiffness_n_m = all[0].most;
    accepted(&s);
    // Far beyond: of 8 k and 8 k one is to be 8/7 k.
    s.mechanism.active.surfaces[0].stiffness_n_m = 8.0 * k;
    s.mechanism.passive.surfaces[0].stiffness_n_m = 8.0 * k;
    let all = found(&s);
    assert_eq!((all.len(), all[0].place), (1, Place::Active), "{all:?}");
    assert!(near(all[0].most, 8.0 / 7.0 * k) && near(all[0].step_s, 0.5 * H), "{all:?}");
    let line = all[0].line();
    assert!(line.contains("in the file of the active side = "), "{line}");
    assert!(line.contains("acts faster than steps of 0.2 ms") && !line.contains("tick"), "{line}");
}

/// A ring has twice the stiffness of the law, and the law alone binds nothing that does not touch.
#[test]
fn oracle_the_bound_of_a_ring_with_a_surface() {
    let turned = (0.4 + 0.05) * (0.4 + 0.05) / 80.0;
    let k = 1.0 / (H * H * (1.0 / 200.0 + 0.01 / 50.0 + 1.0 / 300.0 + turned));
    let mut s = bare();
    let NormalLaw::HuntCrossley { stiffness, .. } = &mut s.mechanism.contact.normal else {
        panic!("another law")
    };
    *stiffness = 2.0 * k;
    accepted(&s);
    s.mechanism.active.surfaces = vec![sphere(4.0 / 3.0 * k, 0.1)];
    s.mechanism.passive.has_ring = true;
    s.mechanism.passive.ring =
        RingGeometry { mean_radius_m: 0.4, section_radius_m: 0.05, segments: 8 };
    accepted(&s);
    s.mechanism.active.surfaces[0].stiffness_n_m *= 1.0 + 1e-6;
    let all = found(&s);
    assert_eq!(all.len(), 1, "{all:?}");
    assert_eq!(all[0].key, "mechanism.contact.stiffness_n_m");
    assert!(all[0].most < 2.0 * k && near(all[0].value, 2.0 * k), "{all:?}");
}

/// 0.2 m ahead of both mass centres, its striker within 5 mm.
#[test]
fn oracle_the_bound_of_an_own_latch() {
    let light = 1.0 / 200.0 + 0.205 * 0.205 / 50.0 + 1.0 / 300.0 + 0.04 / 80.0;
    let (k, c) = (1.0 / (H * H * light), 1.0 / (H * light));
    let mut s = bare();
    s.mechanism.own_latches = vec![Latch {
        name: "latch".to_owned(),
        latch_r: DVec3::X * 0.2,
        striker_p: DVec3::X * -0.2,
        approach_gap_m: 0.05,
        strike_gap_m: 0.004,
        catch_gap_m: 0.003,
        lateral_zone_m: 0.004,
        angle_zone_rad: 0.1,
        hold_stiffness_n_m: k,
        joined_stiffness_n_m: k,
        joined_damping_n_s_m: c,
    }];
    accepted(&s);
    let latch = &mut s.mechanism.own_latches[0];
    latch.hold_stiffness_n_m *= 1.0 + 1e-6;
    latch.joined_stiffness_n_m *= 4.0;
    latch.joined_damping_n_s_m *= 4.0;
    let all = found(&s);
    let keys: Vec<&str> = all.iter().map(|f| f.key.as_str()).collect();
    assert_eq!(
        keys,
        [
            "mechanism.latch.0.hold_stiffness_n_m",
            "mechanism.latch.0.joined_stiffness_n_m",
            "mechanism.latch.0.joined_damping_n_s_m"
        ]
    );
    assert!(near(all[1].most, k) && near(all[1].step_s, 0.5 * H), "{all:?}");
    assert!(near(all[2].most, c) && near(all[2].step_s, 0.25 * H), "{all:?}");
    // Two of them hold together.
    let twin = s.mechanism.own_latches[0].clone();
    s.mechanism.own_latches.push(twin);
    let all = found(&s);
    assert!(near(all[1].most, 0.5 * k), "{all:?}");
}

/// Rings of 0.625 m, 2.3 m ahead of 8 t and 2.1 m ahead of 12 t.
#[test]
fn oracle_a_file_at_the_bound_passes() {
    let chaser = 1.0 / 8e3 + (2.3_f64 + 0.625).powi(2) / 8e3;
    let target = 1.0 / 12e3 + (2.1_f64 + 0.625).powi(2) / 12e3;
    let k = 1.0 / (H * H * (chaser + target));
    let load = |k: f64| {
        let loader = Loader::new().set("mechanism.contact.stiffness_n_m", k);
        loader.load(&scenario_path("basic_ring_ring"))
    };
    load(k).unwrap_or_else(|e| panic!("{e}"));
    let e = load(k * (1.0 + 1e-6)).expect_err("beyond the bound");
    assert_eq!(e.problems.len(), 1, "{e}");
    let p = &e.problems[0];
    assert_eq!(p.key, "mechanism.contact.stiffness_n_m");
    assert!(p.what.contains("steps of 0.2 ms"), "{e}");
    assert!(p.remedy.ends_with("or take run.steps_per_tick = 6"), "{e}");
    let finer = Loader::new().set("mechanism.contact.stiffness_n_m", k * (1.0 + 1e-6));
    let finer = finer.set("run.steps_per_tick", 6_i64).load(&scenario_path("basic_ring_ring"));
    finer.unwrap_or_else(|e| panic!("{e}"));
}

/// A bristle of 1 µm is fast under a large force alone: at 0.03 m/s that is 2 (v + ω r) sqrt(k m), at 2 m/s, or
/// pushed, what the limits let be.
#[test]
fn oracle_bristles_are_judged_at_the_force_of_the_scenario() {
    let at = |speed: f64| {
        let loader = Loader::new()
            .set("mechanism.contact.bristle_breakaway_m", 1e-6)
            .set("initial.axial_speed_m_s", speed);
        loader.load(&scenario_path("basic_impact_with_roll"))
    };
    let s = at(0.03).unwrap_or_else(|e| panic!("{e}"));
    let speed = 2.0 * (0.03 + 1f64.to_radians() * 0.625);
    let chaser_kg = s.chaser.mass_kg + s.mechanism.ring_body.mass_kg;
    let mass_kg = chaser_kg * 12e3 / (chaser_kg + 12e3);
    let touch = Moving::of(&s).touches().remove(0);
    let force_n = Moving::of(&s).largest(&touch).normal_n;
    assert!(near(force_n, speed * (1e6 * mass_kg).sqrt()), "{force_n}");
    let pushed = Moving { pushed: true, ..Moving::of(&s) };
    // 0.04 m of depth, and 0.1 MN of compression and of shear.
    assert!(near(pushed.largest(&touch).elastic_n, 4e4));
    assert!(near(pushed.largest(&touch).normal_n, 1e5 * 2f64.sqrt()));
    assert_eq!(too_stiff(&pushed, H).len(), 1);
    let e = at(2.0).expect_err("it is fast");
    assert_eq!(e.problems[0].key, "mechanism.contact.bristle_damping_s", "{e}");
}

/// Whether a file has a key, numbers being places in a list.
fn has(file: &toml::Table, key: &str) -> bool {
    let mut parts = key.split('.');
    let mut at = parts.next().and_then(|first| file.get(first));
    for part in parts {
        at = at.and_then(|value| match part.parse::<usize>() {
            Ok(i) => value.get(i),
            Err(_) => value.get(part),
        });
    }
    at.is_some()
}

/// In steps of a second everything is too stiff, and every key stands in the file that is named.
#[test]
fn invariant_keys_are_those_of_the_files() {
    for (scenario, stem, attenuation, least) in [
        ("apas_nominal", "apas", "characteristic", 20),
        ("apas_nominal", "apas", "differential", 30),
        ("probe_drogue", "probe", "characteristic", 20),
    ] {
        let path = scenario_path(scenario);
        let s = Loader::new().set("mechanism.attenuation", attenuation).load(&path);
        let s = s.unwrap_or_else(|e| panic!("{e}"));
        let all = too_stiff(&Moving::of(&s), 1.0);
        assert!(all.len() > least, "{}: {all:?}", all.len());
        let file = |side: &str| {
            let path = path.with_file_name(format!("../models/urdf/{stem}_{side}.toml"));
            let text = std::fs::read_to_string(path).expect("a model");
            text.parse::<toml::Table>().expect("TOML")
        };
        let (active, passive) = (file("active"), file("passive"));
        for f in &all {
            let key = f.key.strip_prefix("mechanism.").expect("of the mechanism");
            let file = if f.place == Place::Passive { &passive } else { &active };
            assert!(has(file, key), "{}", f.line());
            assert_eq!(f.slope, key.contains("_over_"), "{}", f.line());
        }
    }
}
