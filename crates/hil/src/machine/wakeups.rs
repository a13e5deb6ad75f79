//! How late a loop wakes up on this machine, and cyclictest to compare with.

use std::{
    process::{Command, Stdio},
    thread,
};

use super::{Check, State};
use crate::{
    clock::{Clock as _, ClockCounts, OverrunPolicy, RealtimeClock},
    histogram::{Latencies, LatencyHistogram},
    realtime::{RealtimeReport, RealtimeSetup, Shortage, Step, relax},
};

/// Period of the loop that is measured, ns.
pub const PERIOD_NS: u64 = 1_000_000;
/// So late may 99 of 100 wake-ups be, ns: a quarter of the period, the rest is for the work.
const P99_LIMIT_NS: u64 = PERIOD_NS / 4;

/// Why nothing could be measured.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// No thread to measure in.
    #[error("cannot start a thread to measure in: {0}")]
    Thread(#[source] std::io::Error),
    /// The thread ended before its time.
    #[error("the measurement broke off")]
    BrokenOff,
}

/// Why there is no cyclictest to compare with.
#[derive(Debug, thiserror::Error)]
pub enum NoCyclictest {
    /// It cannot be started.
    #[error("cyclictest, to compare with, cannot be started ({0}): sudo apt install rt-tests")]
    Start(#[source] std::io::Error),
    /// What it says holds no histogram.
    #[error("cyclictest, to compare with, does not measure: {why}")]
    Answer {
        /// What it says instead.
        why: String,
    },
}

/// Nanoseconds as microseconds.
#[expect(clippy::cast_precision_loss, reason = "times far below 2^53 ns")]
#[must_use]
pub fn micros(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

/// What the idle loop saw.
pub struct Measured {
    /// What the loop was granted, and was not.
    pub report: RealtimeReport,
    /// How late its wake-ups were.
    pub latencies: Latencies,
    /// Ticks that were late or missed.
    pub counts: ClockCounts,
    /// Upper edges, powers of two of 1 µs, ns, and how many wake-ups below them.
    pub bars: Vec<(u64, u64)>,
}

/// Runs a loop of 1 kHz that does nothing, for so many seconds; in a thread of its own, because it asks
/// for priority.
///
/// # Errors
/// No thread can be started, or it broke off.
pub fn measure(seconds: u32) -> Result<Measured, MeasureError> {
    let loop_ = move || {
        let mut lateness = LatencyHistogram::new();
        let report = RealtimeSetup::default().apply(Shortage::BestEffort).unwrap_or_default();
        let mut clock = RealtimeClock::new(PERIOD_NS, OverrunPolicy::Skip);
        clock.start();
        let ticks = u64::from(seconds) * 1_000_000_000 / PERIOD_NS;
        loop {
            let wakeup = clock.wait();
            lateness.record_ns(wakeup.lateness_ns);
            if wakeup.tick + 1 >= ticks {
                break;
            }
        }
        relax();
        let mut bars: Vec<(u64, u64)> = Vec::new();
        for (ns, n) in lateness.cells() {
            let edge = 1000 * ns.div_ceil(1000).max(1).next_power_of_two();
            match bars.last_mut() {
                Some(last) if last.0 == edge => last.1 += n,
                _ => bars.push((edge, n)),
            }
        }
        Measured { report, latencies: lateness.latencies(), counts: clock.counts(), bars }
    };
    let thread = thread::Builder::new().spawn(loop_).map_err(MeasureError::Thread)?;
    thread.join().map_err(|_| MeasureError::BrokenOff)
}

impl Measured {
    /// Our p99 as a multiple of that of cyclictest.
    #[must_use]
    pub fn p99_ratio(&self, cyclic_ns: u64) -> f64 {
        micros(self.latencies.p99_ns) / micros(cyclic_ns.max(1))
    }
}

/// The measured loop as a check.
pub(super) fn check(measured: &Measured) -> Check {
    let (l, name) = (&measured.latencies, "wake-ups");
    let found = format!(
        "late by p50 {:.1} µs, p99 {:.1} µs, p99.9 {:.1} µs, max {:.1} µs, n {}; {} ticks missed",
        micros(l.p50_ns),
        micros(l.p99_ns),
        micros(l.p999_ns),
        micros(l.max_ns),
        l.n,
        measured.counts.missed
    );
    let remedy = "end other programs, mend what stands above, measure again: docktwin doctor";
    if l.p99_ns > P99_LIMIT_NS {
        let cost = "one tick in a hundred begins more than a quarter of a period late";
        return Check::short(State::Lacking, name, found, cost, remedy);
    }
    if measured.counts.missed > 0 {
        let cost = "ticks without a command: a rig holds the one before";
        return Check::short(State::Doubtful, name, found, cost, remedy);
    }
    Check::good(name, found)
}

/// p99 of cyclictest's wake-ups, ns, with the rights that our loop got.
///
/// # Errors
/// It is not installed, or does not measure.
pub fn cyclictest(seconds: u32, report: &RealtimeReport) -> Result<u64, NoCyclictest> {
    let mut c = Command::new("cyclictest");
    c.args(["--quiet", "--threads=1", "--interval=1000", "--histogram=100000"]);
    c.arg(format!("--duration={seconds}"));
    if report.granted.contains(&Step::Priority) {
        c.arg("--priority=80");
    }
    if report.granted.contains(&Step::Memory) {
        c.arg("--mlockall");
    }
    let said = c.stdin(Stdio::null()).output().map_err(NoCyclictest::Start)?;
    p99_of_histogram(&String::from_utf8_lossy(&said.stdout)).ok_or_else(|| {
        let why = String::from_utf8_lossy(&said.stderr);
        let why = why.lines().find(|l| !l.trim().is_empty()).unwrap_or("it says nothing");
        NoCyclictest::Answer { why: why.to_owned() }
    })
}

/// From lines of "µs count"; everything else is a comment.
fn p99_of_histogram(text: &str) -> Option<u64> {
    let cells: Vec<(u64, u64)> = text
        .lines()
        .filter_map(|line| {
            let mut words = line.split_whitespace();
            let cell = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
            words.next().is_none().then_some(cell)
        })
        .collect();
    let all: u64 = cells.iter().map(|(_, n)| n).sum();
    let mut below = 0;
    cells.into_iter().find_map(|(us, n)| {
        below += n;
        (n > 0 && below * 100 >= all * 99).then_some(us * 1000)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_p99_of_what_cyclictest_writes() {
        let text = "# /dev/cpu_dma_latency set to 0us\n# Histogram\n000000 000000\n000001\t000050\n\
                    000002\t000048\n000003\t000001\n000009\t000001\n# Total: 000000100\n";
        assert_eq!(p99_of_histogram(text), Some(3000));
        assert_eq!(p99_of_histogram("# nothing\n"), None);
    }
}
