//! A mechanism that is not mounted where the rig's file says: the truth follows the mounts, sensors their file.

mod stand;

use docktwin_core::{DQuat, DVec3, Pose, Wrench};
use docktwin_hil::emulated::EmulatedRig;
use docktwin_physics::mounted::Article;
use docktwin_rigport::{
    message::{Capabilities, RigCommand, RigMode},
    rig::Plant as _,
};
use stand::{Stand, free_stick};

fn mounts() -> [Pose; 2] {
    let turned = |x, y, z| DQuat::from_scaled_axis(DVec3::new(x, y, z));
    [
        Pose::new(DVec3::new(1e-3, -2e-3, 3e-3), turned(2e-3, 0.0, -1e-3)),
        Pose::new(DVec3::new(-1e-3, 2e-3, 1e-3), turned(0.0, 1e-3, 3e-3)),
    ]
}

/// X_34 of the halves as they stand is m₃⁻¹ X_34 m₄, X_34 being what the loop believes.
#[test]
fn oracle_the_true_pose_is_that_of_the_mounts() {
    let stand = Stand::new(None);
    let believed =
        Pose::new(DVec3::new(0.75, 0.02, -0.03), DQuat::from_scaled_axis(DVec3::Y * 0.05));
    let [e3, e4] = mounts();
    let article = Article { system: free_stick(), mounts: Some([e3, e4]) };
    let rig =
        EmulatedRig::new(&stand.rig, stand.preset, None, 1, article, &believed).expect("a rig");
    let (found, expected) = (rig.x_34(), e3.inverse() * believed * e4);
    assert!((found.p - expected.p).length() < 1e-9, "{found:?} {expected:?}");
    assert!(found.q.angle_between(expected.q) < 1e-7, "{found:?} {expected:?}");
    assert!((found.p - believed.p).length() > 1e-3, "the mounts move nothing");
}

/// A force through the true plane has the lever of the mount at the sensor.
#[test]
fn oracle_a_sensor_stands_where_the_file_says() {
    let mounts = mounts();
    let article = Article { system: free_stick(), mounts: Some(mounts) };
    let w = Wrench { f: DVec3::new(1000.0, 20.0, -30.0), m: DVec3::new(1.0, 2.0, 3.0) };
    for (i, mount) in mounts.iter().enumerate() {
        let at = article.at_seat(i, w);
        let f = mount.q * w.f;
        assert!((at.f - f).length() < 1e-9);
        assert!((at.m - (mount.q * w.m + mount.p.cross(f))).length() < 1e-9, "{at:?}");
    }
    assert_eq!(Article::from(free_stick()).at_seat(1, w), w);
}

/// Mounts that stand where the file has them change nothing but rounding.
#[test]
fn invariant_mounts_in_their_places_change_nothing() {
    let stand = Stand::new(None);
    let at = stand.rig.docking.pose([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let readings = |mounts| {
        let article = Article { system: free_stick(), mounts };
        let mut rig =
            EmulatedRig::new(&stand.rig, stand.preset, None, 1, article, &at).expect("a rig");
        let command = RigCommand { mode: RigMode::Hold as u32, ..RigCommand::zero() };
        let m = (0..20).map(|_| rig.answer(&command)).last().expect("twenty");
        assert!(m.has(Capabilities::TRUTH));
        (m.sensor_a, m.sensor_b)
    };
    let ([a, b], [c, d]) = {
        let (x, y) = (readings(None), readings(Some([Pose::IDENTITY; 2])));
        ([x.0, x.1], [y.0, y.1])
    };
    for (x, y) in a.iter().chain(&b).zip(c.iter().chain(&d)) {
        assert!((x - y).abs() < 0.2, "{x} {y}");
    }
}
