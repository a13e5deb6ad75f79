//! A rig that draws back by itself: it comes to rest where nothing touches, and whatever goes wrong on the
//! way ends it.

mod common;
mod stand;

use common::stick::Watched;
use docktwin_control::{feedforward::LegCorrections, safety::Limit};
use docktwin_core::{DQuat, DVec3, Pose};
use docktwin_hil::{
    drive::DriveError,
    faults::{Fault, FaultKind, Instrument, When},
};
use docktwin_rigport::message::RigMode;
use stand::{Stand, free_stick};

/// Draws back from `from` with faults; the modes that were sent, too.
fn drawn_back(from: &Pose, faults: &[Fault]) -> (Result<Pose, DriveError>, Vec<u32>) {
    let stand = Stand::new(None);
    let rig = Watched::new(stand.emulated(free_stick(), from), faults);
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
        let stands = drawn_back(&from, &[]).0.expect("nothing is in its way");
        let off = middle.inverse() * stands;
        assert!(off.p.length() < 1e-3 && off.q.to_scaled_axis().length() < 1e-3, "{off:?}");
    }
}

#[test]
fn invariant_what_goes_wrong_on_the_way_ends_it() {
    let joined = Fault::from(FaultKind::JoinedReads, When::Tick(0));
    let (held, sent) = drawn_back(&aside(), &[joined]);
    assert_eq!(held, Err(DriveError::Joined));
    assert!(sent.ends_with(&[RigMode::Idle as u32]), "left without a stop");
    let later = |what| Fault::from(what, When::Tick(1000));
    for (limit, fault) in [
        (Limit::Force, later(FaultKind::Offset(Instrument::SensorA, 0)).sized(-800.0)),
        (Limit::LegForce, later(FaultKind::ForceReads(3)).sized(7e4)),
        (Limit::Stroke, later(FaultKind::LengthReads(2)).sized(9.0)),
        (Limit::Rig, later(FaultKind::SupplyLost)),
        (Limit::Watchdog, later(FaultKind::Missing)),
    ] {
        let (ended, sent) = drawn_back(&aside(), &[fault]);
        match (limit, ended) {
            // Lengths of no pose are known for that before they are a limit.
            (Limit::Stroke, Err(DriveError::Pose)) => {}
            (_, Err(DriveError::Trip(t))) => assert_eq!(t.limit, limit),
            (_, other) => panic!("{limit:?}: {other:?}"),
        }
        assert!(sent.contains(&(RigMode::Stop as u32)));
    }
}
