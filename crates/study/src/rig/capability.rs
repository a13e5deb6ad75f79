//! What a rig can do, against the paper's §3.1: tolerance, motion range, payload.

use core::f64::consts::TAU;

use docktwin_model::Rig;
use docktwin_physics::platform::maps::{
    Maps, PAPER_ATTITUDE_RAD, PAPER_PAYLOAD_KG, PAPER_POSITION_M,
};
use serde::{Deserialize, Serialize};

use super::{Build, Dof, Extreme, RigError, Subject};

/// Half of the paper's motion range (§3.1) in the order of [`Dof::ALL`], m and rad: 0.61 m of vertical
/// travel, which is along X, ±0.15 m sideways, ±5° of rotation.
pub const PAPER_RANGE: [f64; 6] =
    [0.305, 0.15, 0.15, 5.0 / 360.0 * TAU, 5.0 / 360.0 * TAU, 5.0 / 360.0 * TAU];

/// Tolerance, motion range and payload of a rig over the 729 places of its docking workspace.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Capability {
    /// How far every degree of freedom goes alone, in the order of [`Dof::ALL`].
    pub range: [DofRange; 6],
    /// How exactly the mechanisms can be placed.
    pub tolerance: Tolerance,
    /// Mass that can be added at the origin of `e4` before a leg needs more than its force, the plate
    /// at rest, kg, at the worst place; negative when the legs cannot hold the rig as it is.
    pub payload_at_rest_kg: Extreme,
    /// The same while the plate moves with 2 mm at 10 Hz in any direction.
    pub payload_at_10_hz_kg: Extreme,
    /// Which of the paper's figures are met.
    pub meets_the_paper: MeetsPaper,
}

/// How far one degree of freedom goes from the middle of the docking workspace while the others stay
/// there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DofRange {
    /// The degree of freedom.
    pub dof: Dof,
    /// Down (at most 0) and up (at least 0), m or rad.
    pub range: [f64; 2],
}

/// Errors of the port when legs are as long as they are known to be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tolerance {
    /// Largest error of X, Y or Z of the origin of `e4` in `e3`, m, at the worst place with the worst
    /// combination of errors of the legs.
    pub position_m: f64,
    /// Largest error of roll, pitch or yaw, rad, likewise.
    pub attitude_rad: f64,
    /// Bound of the error of a leg's length, m: from the rig file.
    pub leg_error_m: f64,
    /// Bound that would just keep the paper's ±1.27 mm and ±0.10°, m.
    pub leg_error_allowed_m: f64,
}

/// Whether the paper's figures (§3.1) are met.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeetsPaper {
    /// ±1.27 mm and ±0.10°.
    pub tolerance: bool,
    /// [`PAPER_RANGE`], one degree of freedom at a time.
    pub range: bool,
    /// 1135 kg, at rest.
    pub payload_at_rest: bool,
    /// 1135 kg, with 2 mm at 10 Hz.
    pub payload_at_10_hz: bool,
}

/// Tolerance, motion range and payload of a rig.
///
/// # Errors
/// [`RigError::Singular`].
pub fn capability(rig: &Rig, build: &Build) -> Result<Capability, RigError> {
    let subject = Subject::new(rig, build);
    of(&Maps::new(&subject.rig), &subject.rig)
}

pub(super) fn of(maps: &Maps<'_>, rig: &Rig) -> Result<Capability, RigError> {
    let c = maps.capability().ok_or(RigError::Singular)?;
    let [at_rest, at_10_hz] =
        [c.payload_at_rest_kg, c.payload_at_10_hz_kg].map(|p| p.0 >= PAPER_PAYLOAD_KG);
    Ok(Capability {
        range: core::array::from_fn(|i| DofRange { dof: Dof::ALL[i], range: c.range[i] }),
        tolerance: Tolerance {
            position_m: c.position_error_m,
            attitude_rad: c.attitude_error_rad,
            leg_error_m: rig.limits.length_error_m,
            leg_error_allowed_m: c.leg_error_allowed_m,
        },
        payload_at_rest_kg: c.payload_at_rest_kg.into(),
        payload_at_10_hz_kg: c.payload_at_10_hz_kg.into(),
        meets_the_paper: MeetsPaper {
            tolerance: c.position_error_m <= PAPER_POSITION_M
                && c.attitude_error_rad <= PAPER_ATTITUDE_RAD,
            range: c.range.iter().zip(PAPER_RANGE).all(|([down, up], p)| *down <= -p && *up >= p),
            payload_at_rest: at_rest,
            payload_at_10_hz: at_10_hz,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::{super::tests::shipped, *};

    #[test]
    fn oracle_the_verdict_follows_the_figures() {
        let mut rig = shipped();
        let good = capability(&rig, &Build::default()).expect("a regular rig");
        assert_eq!(
            good.meets_the_paper,
            MeetsPaper {
                tolerance: true,
                range: true,
                payload_at_rest: true,
                payload_at_10_hz: true
            }
        );
        // A bound of the legs' error just inside and just outside of what is allowed.
        let allowed = good.tolerance.leg_error_allowed_m;
        for (part, within) in [(0.999, true), (1.001, false)] {
            rig.limits.length_error_m = part * allowed;
            let c = capability(&rig, &Build::default()).expect("a regular rig");
            assert_eq!(c.meets_the_paper.tolerance, within, "{part}");
            // Errors grow with their cause; what is allowed does not change.
            assert!((c.tolerance.leg_error_allowed_m / allowed - 1.0).abs() < 1e-12);
        }
        // Legs of a fifth of the force carry less than the paper's payload, in motion first.
        rig.limits.force_n *= 0.2;
        let weak = capability(&rig, &Build::default()).expect("a regular rig");
        assert!(weak.payload_at_10_hz_kg.value < weak.payload_at_rest_kg.value);
        assert!(!weak.meets_the_paper.payload_at_10_hz);
    }

    #[test]
    fn invariant_the_result_survives_json() {
        let found = capability(&shipped(), &Build { seed: Some(5), ..Build::default() });
        let found = found.expect("a regular rig");
        let text = serde_json::to_string(&found).expect("JSON");
        assert_eq!(serde_json::from_str::<Capability>(&text).expect("JSON"), found);
    }
}
