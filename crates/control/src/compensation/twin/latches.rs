//! When the latches of both twins catch.
//!
//! Those of the ground twin catch with the rig's: it is to be like the rig. Those of the orbit twin catch where the
//! rig's did, which is not when: the rig sags, its ring does not feel the chaser accelerate, and by that it comes to
//! the same gap some milliseconds earlier or later. Where it was the ground twin tells by its own gap at that
//! moment, so that a latch that catches at another gap than believed, or late, does so in orbit too:
//!
//! - The rig's has caught: in orbit it catches at the gap that the ground twin had then; after 0.1 s in any case, or
//!   bodies would part that the rig holds together.
//! - It has not, and the ground twin has been where it should: in orbit it does not catch either.
//! - It has not, and the ground twin has not been there yet, as with sag: in orbit it catches by itself.

use docktwin_core::StateHasher;
use docktwin_model::MOST_LATCHES;
use docktwin_physics::mechanism::{LatchPhase, LatchRule};

use super::LATCHES;

/// Ticks after which a latch of the orbit twin catches with the rig's.
const PATIENCE: u32 = 100;

/// What is known of the rig's latches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Latches {
    /// Of those that have caught: gap of the ground twin when they did, m, and ticks since.
    caught: [Option<(f64, u32)>; LATCHES],
    /// Gaps of the ground twin a tick ago, m.
    before_m: [f64; LATCHES],
}

/// By what the latches of both twins catch in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Rules {
    pub(super) ground: [LatchRule; MOST_LATCHES],
    pub(super) orbit: [LatchRule; MOST_LATCHES],
}

impl Latches {
    /// The rules for a tick whose measurement reports the phases `told`. Of the ground twin, which stands a tick
    /// before: the gaps of its latches, m, and which have been where they would have caught.
    pub(super) fn rules(
        &mut self,
        told: &[Option<u32>; LATCHES],
        gaps_m: &[f64; MOST_LATCHES],
        reached: &[bool; MOST_LATCHES],
    ) -> Rules {
        let mut out = Rules::default();
        for i in 0..LATCHES {
            let Some(phase) = told[i] else { continue };
            let gap_m = gaps_m[i];
            // It caught within the tick: half a tick on from the last gap.
            let when_m = gap_m + 0.5 * (gap_m - self.before_m[i]);
            self.before_m[i] = gap_m;
            if phase >= LatchPhase::Latched as u32 {
                let (gap_m, ticks) = self.caught[i].get_or_insert((when_m, 0));
                *ticks = ticks.saturating_add(1);
                out.ground[i] = LatchRule::Caught;
                out.orbit[i] =
                    if *ticks <= PATIENCE { LatchRule::Within(*gap_m) } else { LatchRule::Caught };
            } else {
                out.ground[i] = LatchRule::Held;
                if reached[i] {
                    out.orbit[i] = LatchRule::Held;
                }
            }
        }
        out
    }

    pub(super) fn hash_into(&self, h: &mut StateHasher) {
        for ((caught, before_m), i) in self.caught.iter().zip(&self.before_m).zip(0..) {
            if let Some((gap_m, ticks)) = caught {
                h.u64(i);
                h.f64(*gap_m);
                h.u64(u64::from(*ticks));
            }
            h.f64(*before_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: Option<u32> = Some(0);
    const CAUGHT: Option<u32> = Some(LatchPhase::Latched as u32);

    /// The first latch of a rig that reports it, and of the twins.
    fn rule(latches: &mut Latches, told: Option<u32>, gap_m: f64, reached: bool) -> [LatchRule; 2] {
        let mut all = [None; LATCHES];
        all[0] = told;
        let rules = latches.rules(&all, &[gap_m; MOST_LATCHES], &[reached; MOST_LATCHES]);
        assert_eq!(rules.ground[1], LatchRule::Own, "what is not reported catches by itself");
        [rules.ground[0], rules.orbit[0]]
    }

    /// A rig that catches at 4 mm, closing by 0.2 mm a tick, where 3 mm were believed: in orbit it is 4 mm too, and
    /// at the latest 0.1 s later.
    #[test]
    fn oracle_a_latch_catches_at_the_gap_at_which_the_rigs_did() {
        let mut latches = Latches::default();
        for gap_mm in [5.0, 4.8, 4.6, 4.4, 4.2] {
            let found = rule(&mut latches, FREE, gap_mm * 1e-3, false);
            assert_eq!(found, [LatchRule::Held, LatchRule::Own]);
        }
        // It has caught within the tick after 4.1 mm, half a tick on.
        for tick in 0..2 * PATIENCE {
            let [ground, orbit] = rule(&mut latches, CAUGHT, 4.1e-3, true);
            assert_eq!(ground, LatchRule::Caught);
            match orbit {
                LatchRule::Within(gap_m) => {
                    assert!(tick < PATIENCE && (gap_m - 4.05e-3).abs() < 1e-9, "{gap_m}");
                }
                other => {
                    assert!(tick >= PATIENCE && other == LatchRule::Caught, "{tick}: {other:?}")
                }
            }
        }
    }

    /// A rig whose latch has not caught where it should have: in orbit it does not either, yet.
    #[test]
    fn oracle_a_late_latch_is_late_in_orbit_too() {
        let mut latches = Latches::default();
        assert_eq!(rule(&mut latches, FREE, 2.9e-3, true), [LatchRule::Held, LatchRule::Held]);
        let [_, orbit] = rule(&mut latches, CAUGHT, 2.9e-3, true);
        assert!(matches!(orbit, LatchRule::Within(gap_m) if (gap_m - 2.9e-3).abs() < 1e-9));
    }
}
