//! The clock of the loop: a grid of ticks, driven by the machine's time or by nothing but the loop.

use docktwin_rigport::clock::monotonic_ns;

use crate::realtime::sleep_until_ns;

/// What to do with ticks whose time has passed before they could begin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OverrunPolicy {
    /// They are left out: the loop goes on with the present tick, on the same grid. For a rig,
    /// which moves on meanwhile.
    #[default]
    Skip,
    /// They are executed late, one after the other without a pause. For a twin, whose simulated
    /// time would otherwise be lost.
    CatchUp,
}

/// One wake-up of the loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wakeup {
    /// The tick that begins, from 0 at the start.
    pub tick: u64,
    /// When it was due, ns of the clock: start + tick · period, whatever happened before.
    pub due_ns: u64,
    /// How late the wake-up came, ns, after the tick that was next: with skipped ticks more than a
    /// period.
    pub lateness_ns: u64,
    /// Ticks left out before this one.
    pub missed: u64,
}

/// What a clock has seen since its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClockCounts {
    /// Wake-ups.
    pub wakeups: u64,
    /// Wake-ups that came a whole period late, or more.
    pub overruns: u64,
    /// Ticks left out.
    pub missed: u64,
}

/// What wakes the loop once a tick. Nothing here allocates, locks or logs.
pub trait Clock {
    /// True when time stands still while the loop works: a run is then deterministic, and a rig knows by
    /// [`docktwin_rigport::message::Flags::LOCKSTEP`].
    const LOCKSTEP: bool;

    /// Between two ticks, ns.
    fn period_ns(&self) -> u64;

    /// Begins the grid; the next [`Clock::wait`] gives tick 0.
    fn start(&mut self);

    /// Goes on after work that belongs to no tick: on a clock that ran on meanwhile the grid begins anew.
    fn resume(&mut self) {}

    /// Waits for the next tick.
    fn wait(&mut self) -> Wakeup;

    /// The time of the clock, ns: of `CLOCK_MONOTONIC`, or the loop's own.
    fn now_ns(&self) -> u64;

    /// Counts since the start.
    fn counts(&self) -> ClockCounts;
}

/// The grid of ticks, in whole nanoseconds: no rounding, so no drift.
#[derive(Clone, Copy, Debug)]
struct Grid {
    start_ns: u64,
    period_ns: u64,
    next: u64,
    counts: ClockCounts,
}

impl Grid {
    fn new(period_ns: u64, start_ns: u64) -> Self {
        Self { start_ns, period_ns: period_ns.max(1), next: 0, counts: ClockCounts::default() }
    }

    fn next_due_ns(&self) -> u64 {
        self.start_ns + self.next * self.period_ns
    }

    /// The tick that begins at `now_ns`, at which the loop woke up.
    fn wake(&mut self, now_ns: u64, policy: OverrunPolicy) -> Wakeup {
        let lateness_ns = now_ns.saturating_sub(self.next_due_ns());
        let whole = lateness_ns / self.period_ns;
        let missed = match policy {
            OverrunPolicy::Skip => whole,
            OverrunPolicy::CatchUp => 0,
        };
        self.next += missed;
        let wakeup = Wakeup { tick: self.next, due_ns: self.next_due_ns(), lateness_ns, missed };
        self.next += 1;
        self.counts.wakeups += 1;
        self.counts.overruns += u64::from(whole > 0);
        self.counts.missed += missed;
        wakeup
    }
}

/// As fast as the loop can: its time is that of the ticks, from 0. Two runs see the same time.
#[derive(Clone, Copy, Debug)]
pub struct VirtualClock {
    grid: Grid,
    now_ns: u64,
}

impl VirtualClock {
    /// `period_ns` between two ticks, at least 1.
    #[must_use]
    pub fn new(period_ns: u64) -> Self {
        Self { grid: Grid::new(period_ns, 0), now_ns: 0 }
    }
}

impl Clock for VirtualClock {
    const LOCKSTEP: bool = true;

    fn period_ns(&self) -> u64 {
        self.grid.period_ns
    }

    fn start(&mut self) {
        *self = Self::new(self.grid.period_ns);
    }

    fn wait(&mut self) -> Wakeup {
        self.now_ns = self.grid.next_due_ns();
        self.grid.wake(self.now_ns, OverrunPolicy::Skip)
    }

    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn counts(&self) -> ClockCounts {
        self.grid.counts
    }
}

/// `CLOCK_MONOTONIC`, with wake-ups at absolute instants: what one tick takes does not move the next.
/// How exact it is depends on the machine: see [`crate::realtime::RealtimeSetup`].
#[derive(Clone, Copy, Debug)]
pub struct RealtimeClock {
    grid: Grid,
    policy: OverrunPolicy,
}

impl RealtimeClock {
    /// `period_ns` between two ticks, at least 1.
    #[must_use]
    pub fn new(period_ns: u64, policy: OverrunPolicy) -> Self {
        Self { grid: Grid::new(period_ns, monotonic_ns()), policy }
    }
}

impl Clock for RealtimeClock {
    const LOCKSTEP: bool = false;

    fn period_ns(&self) -> u64 {
        self.grid.period_ns
    }

    fn start(&mut self) {
        // One period ahead, so that the first wake-up is a wake-up.
        let period_ns = self.grid.period_ns;
        self.grid = Grid::new(period_ns, monotonic_ns() + period_ns);
    }

    fn resume(&mut self) {
        self.start();
    }

    fn wait(&mut self) -> Wakeup {
        sleep_until_ns(self.grid.next_due_ns());
        self.grid.wake(monotonic_ns(), self.policy)
    }

    fn now_ns(&self) -> u64 {
        monotonic_ns()
    }

    fn counts(&self) -> ClockCounts {
        self.grid.counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn invariant_virtual_time_is_the_ticks_and_nothing_else() {
        let mut clock = VirtualClock::new(MS);
        for _ in 0..2 {
            clock.start();
            for k in 0..1000 {
                let w = clock.wait();
                assert_eq!(w, Wakeup { tick: k, due_ns: k * MS, ..Wakeup::default() });
                assert_eq!(clock.now_ns(), k * MS);
            }
            assert_eq!(clock.counts(), ClockCounts { wakeups: 1000, ..ClockCounts::default() });
        }
    }

    #[test]
    fn invariant_the_grid_of_real_time_has_no_drift() {
        let mut clock = RealtimeClock::new(MS, OverrunPolicy::Skip);
        clock.start();
        let first = clock.wait();
        let mut last = first;
        assert_eq!(first.tick, first.missed);
        while last.tick < 200 {
            let w = clock.wait();
            assert_eq!(w.tick, last.tick + 1 + w.missed);
            assert_eq!(w.due_ns - first.due_ns, (w.tick - first.tick) * MS, "off the grid");
            assert!(clock.now_ns() >= w.due_ns, "woken before its time");
            last = w;
        }
    }

    #[test]
    fn invariant_a_slow_tick_is_skipped_over_and_counted() {
        let mut clock = RealtimeClock::new(MS, OverrunPolicy::Skip);
        clock.start();
        let before = clock.wait();
        sleep_until_ns(before.due_ns + 5 * MS + MS / 2);
        let after = clock.wait();
        assert!(after.missed >= 4, "{after:?}");
        assert!(after.lateness_ns >= 4 * MS + MS / 2, "{after:?}");
        assert_eq!(after.tick, before.tick + 1 + after.missed);
        assert_eq!(after.due_ns, before.due_ns + (1 + after.missed) * MS);
        let counts = clock.counts();
        assert_eq!(counts.wakeups, 2);
        assert!(counts.overruns >= 1);
        assert_eq!(counts.missed, before.missed + after.missed);
    }

    #[test]
    fn invariant_catching_up_leaves_no_tick_out() {
        let mut clock = RealtimeClock::new(MS, OverrunPolicy::CatchUp);
        clock.start();
        let before = clock.wait();
        sleep_until_ns(before.due_ns + 5 * MS);
        for k in 1..=20 {
            let w = clock.wait();
            assert_eq!((w.tick, w.missed), (before.tick + k, 0));
            assert_eq!(w.due_ns, before.due_ns + k * MS);
        }
        assert!(clock.counts().overruns >= 4);
        assert_eq!(clock.counts().missed, 0);
    }

    /// The rule itself, without a machine's own lateness.
    #[test]
    fn oracle_lateness_is_counted_in_whole_periods() {
        for (late_ns, missed) in [(0, 0), (MS - 1, 0), (MS, 1), (2 * MS - 1, 1), (7 * MS + 3, 7)] {
            let mut grid = Grid::new(MS, 100);
            let w = grid.wake(100 + late_ns, OverrunPolicy::Skip);
            assert_eq!((w.lateness_ns, w.missed, w.tick), (late_ns, missed, missed));
            assert_eq!(grid.counts.overruns, u64::from(missed > 0));
            let mut grid = Grid::new(MS, 100);
            let w = grid.wake(100 + late_ns, OverrunPolicy::CatchUp);
            assert_eq!((w.lateness_ns, w.missed, w.tick), (late_ns, 0, 0));
        }
    }
}
