//! From a scenario to bodies, control wrenches and steps: what every way of running it shares.

use docktwin_core::{DVec3, Digest, StateHasher, Wrench};
pub use docktwin_core::{FULL_STEPS_PER_MS, REDUCED_STEPS_PER_MS};
use docktwin_physics::{
    body::BodyState,
    initial::{ContactConditions, Turning, initial_state},
    mechanism::System,
    reduced::{DockingState, Inputs},
};
use docktwin_record::Masses;
use docktwin_scenario::{Body, Scenario, Thrust, Trigger, TurningBody};

/// The sides overlap at the start of a scenario.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "{scenario}: the sides overlap at the start, {gap_m} m before first contact: the lateral motion \
     taken back that far leads through the petals"
)]
pub struct StartOverlap {
    /// Name of the scenario.
    pub scenario: String,
    /// Its `initial.gap_m`, m.
    pub gap_m: f64,
}

/// Steps of a tick: the scenario's, or `per_ms` of its own for a tick of 1 ms.
#[must_use]
pub fn steps_per_tick(scenario: &Scenario, per_ms: u32) -> u32 {
    scenario.run.steps_in_tick(per_ms)
}

/// Masses of what moves, as the files have them.
#[must_use]
pub const fn masses(scenario: &Scenario) -> Masses {
    Masses {
        chaser: scenario.chaser.mass_kg,
        target: scenario.target.mass_kg,
        ring: scenario.mechanism.ring_body.mass_kg,
    }
}

/// The bodies at the start.
///
/// # Errors
/// When the sides overlap there.
pub fn start(scenario: &Scenario) -> Result<(System, [BodyState; 3]), StartOverlap> {
    let system = System::new(&scenario.chaser, &scenario.target, scenario.mechanism.clone());
    let i = &scenario.initial;
    let conditions = ContactConditions {
        attitude: i.attitude,
        lateral_m: DVec3::new(0.0, i.lateral_m[0], i.lateral_m[1]),
        velocity_m_s: DVec3::new(
            -i.axial_speed_m_s,
            i.lateral_speed_m_s[0],
            i.lateral_speed_m_s[1],
        ),
        rate_rad_s: i.rates_rad_s,
        turning: match i.turning {
            TurningBody::Target => Turning::Target,
            TurningBody::Chaser => Turning::Chaser,
            TurningBody::Both => Turning::Both,
        },
    };
    let bodies = initial_state(&system, &conditions, i.gap_m).bodies;
    let touching = {
        let mut rigid = bodies;
        system.follow(&mut rigid);
        system.touches(&system.poses(&rigid.map(|b| b.pose())))
    };
    if touching {
        return Err(StartOverlap { scenario: scenario.name.clone(), gap_m: i.gap_m });
    }
    Ok((system, bodies))
}

/// Control wrenches of a tick that starts at `time_s`.
#[must_use]
pub fn inputs(thrusts: &[Thrust], state: &DockingState, time_s: f64) -> Inputs {
    inputs_after(thrusts, state.first_contact_s, state.mechanism.captured_s(), time_s)
}

/// Times of ticks are sums of decimals: within this of each other, s, they are one.
const SAME_TIME_S: f64 = 1e-9;

/// Control wrenches of a tick that starts at `time_s`, given the times of first contact and capture.
#[must_use]
pub fn inputs_after(
    thrusts: &[Thrust],
    first_contact_s: Option<f64>,
    captured_s: Option<f64>,
    time_s: f64,
) -> Inputs {
    let mut out = Inputs::default();
    for t in thrusts {
        let from = match t.after {
            Trigger::Start => Some(0.0),
            Trigger::FirstContact => first_contact_s,
            Trigger::Capture => captured_s,
        };
        let Some(from) = from else { continue };
        let since = time_s - from - t.delay_s + SAME_TIME_S;
        let captured = t.until_capture && captured_s.is_some();
        if since < 0.0 || since >= t.duration_s || captured {
            continue;
        }
        let w = Wrench { f: t.force_n, m: t.moment_nm };
        match t.on {
            Body::Chaser => out.chaser += w,
            Body::Target => out.target += w,
        }
    }
    out
}

/// Whether a thrust is on at `time_s` or still to come.
#[must_use]
pub fn thrust_ahead(thrusts: &[Thrust], state: &DockingState, time_s: f64) -> bool {
    thrust_ahead_of(thrusts, state.first_contact_s, state.mechanism.captured_s(), time_s)
}

/// Whether a thrust is on at `time_s` or still to come, given the times of first contact and capture.
#[must_use]
pub fn thrust_ahead_of(
    thrusts: &[Thrust],
    first_contact_s: Option<f64>,
    captured_s: Option<f64>,
    time_s: f64,
) -> bool {
    thrusts.iter().any(|t| {
        let from = match t.after {
            Trigger::Start => Some(0.0),
            Trigger::FirstContact => first_contact_s,
            // Without a capture this thrust never comes.
            Trigger::Capture => captured_s,
        };
        let ended = t.until_capture && captured_s.is_some();
        !ended && from.is_some_and(|from| time_s + SAME_TIME_S < from + t.delay_s + t.duration_s)
    })
}

/// Digest of a tick: the state at its start and the control wrenches held over it. A flipped bit of
/// an input shows even where rounding would hide it from the state.
#[must_use]
pub fn tick_digest(state: Digest, inputs: &Inputs) -> Digest {
    let mut h = StateHasher::chained(state);
    inputs.hash_into(&mut h);
    h.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A thrust of so many ticks after an event on a tick acts for so many ticks, whatever rounding makes of their
    /// times.
    #[test]
    fn invariant_a_thrust_begins_and_ends_on_its_ticks() {
        for (event, delay, length) in [(464_u32, 500_u32, 15_u32), (0, 900, 100), (1, 3, 7)] {
            let s = |ticks: u32| f64::from(ticks) * 1e-3;
            let thrusts = [Thrust {
                on: Body::Chaser,
                after: Trigger::FirstContact,
                delay_s: s(delay),
                duration_s: s(length),
                until_capture: false,
                force_n: DVec3::X,
                moment_nm: DVec3::ZERO,
            }];
            for k in 0..2000 {
                let from = event + delay;
                let on = (from..from + length).contains(&k);
                let got = inputs_after(&thrusts, Some(s(event)), None, s(k));
                assert_eq!(got.chaser.f == DVec3::X, on, "tick {k}: {event} {delay} {length}");
                let ahead = thrust_ahead_of(&thrusts, Some(s(event)), None, s(k));
                assert_eq!(ahead, k < from + length, "tick {k}: {event} {delay} {length}");
            }
        }
    }
}
