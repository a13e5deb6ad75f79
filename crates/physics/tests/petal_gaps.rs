//! Gaps of the petals against a search over both surfaces.

mod common;

use docktwin_core::{DQuat, DVec3, Pose};
use docktwin_model::DockingMechanism;
use docktwin_physics::contact::Scene;

/// Least distance by looking at every ruling and every place along it.
fn brute(m: &DockingMechanism, x_rp: Pose, active: bool, i: u32) -> f64 {
    let (own, other) = if active { (&m.active, &m.passive) } else { (&m.passive, &m.active) };
    let x = if active { x_rp } else { x_rp.inverse() };
    let (mine, theirs) = (own.petals.expect("petals"), other.petals.expect("petals"));
    let us = || (0..=80).map(|k| -1.0 + f64::from(k) / 40.0);
    let mut best = f64::INFINITY;
    for u in us() {
        let [b, t] = mine.ruling(i, u);
        for k in 0..=100 {
            let q = x.inverse_transform_point(b.lerp(t, f64::from(k) / 100.0));
            let ring = (q.y.hypot(q.z) - other.ring.mean_radius_m).hypot(q.x);
            best = best.min(ring - other.ring.section_radius_m - 0.5 * mine.thickness_m);
            for j in 0..theirs.count {
                for v in us() {
                    let [c, d] = theirs.ruling(j, v);
                    let s = ((q - c).dot(d - c) / (d - c).length_squared()).clamp(0.0, 1.0);
                    let r = 0.5 * (mine.thickness_m + theirs.thickness_m);
                    best = best.min(q.distance(c.lerp(d, s)) - r);
                }
            }
        }
    }
    best
}

#[test]
fn oracle_gaps_are_those_of_a_search_over_both_surfaces() {
    let m = common::apas();
    let scene = Scene::new(&m);
    // r4 is r3 turned half way about Z when docked.
    let turn = DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0);
    for (p, roll, pitch) in [
        (DVec3::new(0.45, 0.0, 0.0), 0.0, 0.0),
        (DVec3::new(0.30, 0.05, -0.02), 0.26, 0.05),
        (DVec3::new(0.20, -0.03, 0.04), -0.1, 0.1),
    ] {
        let tilt = DQuat::from_rotation_x(roll) * DQuat::from_rotation_y(pitch);
        let x_rp = Pose::new(p, tilt * turn);
        let gaps = scene.petal_gaps(x_rp);
        for i in 0..3u32 {
            for (active, found) in
                [(true, gaps.active_m[i as usize]), (false, gaps.passive_m[i as usize])]
            {
                let want = brute(&m, x_rp, active, i);
                // The brute search steps 2 mm along and across: it finds no less than the least
                // distance and up to a tenth of a millimetre more.
                assert!(
                    found < want + 1e-5 && found > want - 3e-4,
                    "{p} {active} {i}: {found} but {want}"
                );
            }
        }
    }
}
