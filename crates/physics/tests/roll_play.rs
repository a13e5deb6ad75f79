//! Roll play of docked sides from the surfaces that touch, against the distance of the petals' straight edges.

use std::path::Path;

use docktwin_core::{DQuat, DVec3, Pose};
use docktwin_model::{DockingMechanism, PetalGeometry, SideGeometry, load_mechanism};
use docktwin_physics::contact::Scene;

fn mechanism(name: &str) -> DockingMechanism {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf");
    let file = |side: &str| models.join(format!("{name}_{side}.urdf"));
    load_mechanism(&file("active"), &file("passive"), None).expect("a mechanism").model
}

/// Distance of two segments, by alternating projection (convex, so it converges).
fn distance(a: [DVec3; 2], b: [DVec3; 2]) -> f64 {
    let onto = |p: DVec3, [x, y]: [DVec3; 2]| {
        let d = y - x;
        x + d * ((p - x).dot(d) / d.length_squared()).clamp(0.0, 1.0)
    };
    let (mut p, mut q) = (a[0], b[0]);
    for _ in 0..20_000 {
        p = onto(q, a);
        q = onto(p, b);
    }
    (p - q).length()
}

/// Both side edges of all petals of a side, in its ring frame.
fn edges(g: &SideGeometry) -> Vec<[DVec3; 2]> {
    let p: &PetalGeometry = g.petals.as_ref().expect("petals");
    let at = |x: f64, r: f64, az: f64| DVec3::new(x, r * az.cos(), r * az.sin());
    (0..p.count)
        .flat_map(|i| [-1.0, 1.0].map(|side| (p.azimuth_rad(i), side)))
        .map(|(az, side)| {
            [
                at(0.0, p.base_radius_m, az + side * p.base_half_angle_rad),
                at(p.height_m, p.tip_radius_m, az + side * p.tip_half_angle_rad),
            ]
        })
        .collect()
}

#[test]
fn oracle_roll_play_is_where_straight_edges_meet() {
    // Published case: 4.39° of the default geometry, between 4.35° (rings first) and 4.45° (petals first).
    for (name, about_deg) in [("apas", Some(4.39)), ("guide", None), ("apas75", None)] {
        let m = mechanism(name);
        let [back, ahead] = Scene::new(&m).roll_play().map(|p| p.expect("petals touch"));
        if let Some(deg) = about_deg {
            assert!((ahead.to_degrees() - deg).abs() < 0.02, "{name}: {}", ahead.to_degrees());
        }
        let planes = m.active.ring.section_radius_m + m.passive.ring.section_radius_m;
        let thick = |g: &SideGeometry| g.petals.as_ref().map_or(0.0, |p| p.thickness_m);
        let together = 0.5 * (thick(&m.active) + thick(&m.passive));
        let gap = |roll: f64| {
            let half_turn = DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0);
            let x = Pose::new(DVec3::X * planes, DQuat::from_rotation_x(roll) * half_turn);
            let passive = edges(&m.passive).into_iter().map(|e| e.map(|p| x.transform_point(p)));
            let passive: Vec<_> = passive.collect();
            let each =
                edges(&m.active).into_iter().flat_map(|a| passive.iter().map(move |b| (a, *b)));
            each.map(|(a, b)| distance(a, b)).fold(f64::INFINITY, f64::min) - together
        };
        for roll in [-back, ahead] {
            // 0.01° at the ring is 0.1 mm.
            let off = gap(roll);
            assert!(off.abs() < 1e-5, "{name}: edges are {off} m apart at {}°", roll.to_degrees());
        }
    }
}
