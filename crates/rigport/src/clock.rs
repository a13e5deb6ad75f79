//! The clock of all time stamps at the port.

use nix::time::{ClockId, clock_gettime};

/// Time of `CLOCK_MONOTONIC`, ns: shared by all processes of this machine, never set back.
#[must_use]
pub fn monotonic_ns() -> u64 {
    // The clock exists on every Linux, so the call cannot fail; its time is not negative.
    let t = clock_gettime(ClockId::CLOCK_MONOTONIC).map_or((0, 0), |t| (t.tv_sec(), t.tv_nsec()));
    t.0.unsigned_abs() * 1_000_000_000 + t.1.unsigned_abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_time_does_not_go_back() {
        let mut last = monotonic_ns();
        assert!(last > 0);
        for _ in 0..1000 {
            let now = monotonic_ns();
            assert!(now >= last);
            last = now;
        }
    }
}
