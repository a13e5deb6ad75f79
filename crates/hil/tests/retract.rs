//! A rig that draws back by itself: it comes to rest where nothing touches, and whatever goes wrong on the
//! way ends it.

mod common;
mod stand;

use common::stick::{Fate, Spoilt};
use docktwin_control::safety::Limit;
use docktwin_core::{DQuat, DVec3, Pose};
use docktwin_hil::{
    drive::DriveError,
    port::{RigMeasurement, RigMode},
    scheduler::LegCorrections,
};
use stand::{Stand, free_stick};

/// Draws back from `from`, every measurement spoilt; the modes that were sent, too.
fn drawn_back(
    from: &Pose,
    spoil: impl FnMut(RigMeasurement) -> Fate,
) -> (Result<Pose, DriveError>, Vec<u32>) {
    let stand = Stand::new(None);
    let rig = Spoilt::new(stand.emulated(free_stick(), from), spoil);
    let sent = rig.sent.clone();
    let mut drive = stand.lead(rig, LegCorrections::default());
    (drive.retract(), sent.take())
}

fn aside() -> Pose {
    let middle = Stand::new(None).middle();
    let turned = DQuat::from_scaled_axis(DVec3::new(0.0, 0.06, -0.04));
    Pose::new(middle.p + DVec3::new(-0.05, 0.02, 0.0), (turned * middle.q).normalize())
}

/// A stick goes to the middle of its frame, turned as it was: to rest in place and in attitude.
#[test]
fn oracle_it_comes_to_rest_where_nothing_touches() {
    let middle = Stand::new(None).middle();
    for from in [aside(), Pose::new(middle.p, aside().q)] {
        let stands = drawn_back(&from, |m| Ok(Some(m))).0.expect("nothing is in its way");
        let off = middle.inverse() * stands;
        assert!(off.p.length() < 1e-3 && off.q.to_scaled_axis().length() < 1e-3, "{off:?}");
    }
}

#[test]
fn invariant_what_goes_wrong_on_the_way_ends_it() {
    let (held, sent) = drawn_back(&aside(), |mut m| {
        m.mechanism[9] = 1.0;
        Ok(Some(m))
    });
    assert_eq!(held, Err(DriveError::Joined));
    assert!(sent.ends_with(&[RigMode::Idle as u32]), "left without a stop");
    for (limit, spoil) in [
        (
            Limit::Force,
            (|m: &mut RigMeasurement| m.sensor_a[0] -= 800.0) as fn(&mut RigMeasurement),
        ),
        (Limit::LegForce, |m| m.leg_force_n[3] = 7e4),
        (Limit::Stroke, |m| m.leg_length_m[2] = 9.0),
        (Limit::Rig, |m| m.status &= !docktwin_hil::port::status::ENABLED),
    ] {
        let mut ticks = 0;
        let (ended, sent) = drawn_back(&aside(), |mut m| {
            ticks += 1;
            if ticks > 1000 {
                spoil(&mut m);
            }
            Ok(Some(m))
        });
        match (limit, ended) {
            // Lengths of no pose are known for that before they are a limit.
            (Limit::Stroke, Err(DriveError::Pose)) => {}
            (_, Err(DriveError::Trip(t))) => assert_eq!(t.limit, limit),
            (_, other) => panic!("{limit:?}: {other:?}"),
        }
        assert!(sent.contains(&(RigMode::Stop as u32)));
    }
    let mut ticks = 0;
    let (silent, _) = drawn_back(&aside(), |m| {
        ticks += 1;
        Ok((ticks < 1000).then_some(m))
    });
    assert!(matches!(silent, Err(DriveError::Trip(t)) if t.limit == Limit::Watchdog), "{silent:?}");
}
