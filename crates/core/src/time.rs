use serde::{Deserialize, Serialize};

/// Period of the loop with a rig, ns: 1 kHz.
pub const PERIOD_NS: u64 = 1_000_000;

/// Steps of a tick of 1 ms of the full twin: 0.2 ms each.
pub const FULL_STEPS_PER_MS: u32 = 5;
/// Steps of a tick of 1 ms of the reduced twin: 0.1 ms each.
pub const REDUCED_STEPS_PER_MS: u32 = 10;

/// Number of a tick of the scheduler (1 ms by default), counted from the start of the run.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct Tick(pub u64);

/// Simulated time since the start of the run, in whole nanoseconds, so that a million ticks of 1 ms
/// are exactly 1000 s.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct SimTime {
    nanos: u64,
}

impl SimTime {
    /// The start of the run.
    pub const ZERO: Self = Self { nanos: 0 };

    /// From whole nanoseconds.
    #[must_use]
    pub const fn from_nanos(nanos: u64) -> Self {
        Self { nanos }
    }

    /// Whole nanoseconds.
    #[must_use]
    pub const fn nanos(self) -> u64 {
        self.nanos
    }

    /// Seconds, rounded to the nearest f64.
    #[must_use]
    pub fn seconds(self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "exact below 104 days")]
        let n = self.nanos as f64;
        n / 1e9
    }

    /// Instant of a tick of the given period.
    #[must_use]
    pub const fn of_tick(tick: Tick, period_nanos: u64) -> Self {
        Self { nanos: tick.0 * period_nanos }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_a_million_milliseconds_are_a_thousand_seconds() {
        assert_eq!(SimTime::of_tick(Tick(1_000_000), 1_000_000).nanos(), 1_000_000_000_000);
    }
}
