//! How long things took, in memory that is fixed beforehand.

use hdrhistogram::Histogram;

/// Longest time distinguished, ns; a longer one counts as this.
const LONGEST_NS: u64 = 100_000_000_000;

/// Times of one kind, 1 ns to 100 s, to three digits. Recording allocates nothing.
#[derive(Clone, Debug)]
pub struct LatencyHistogram {
    counts: Histogram<u64>,
}

impl Default for LatencyHistogram {
    fn default() -> Self {
        Self::new()
    }
}

/// A distribution of times, ns. All zero when nothing was recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Latencies {
    /// Half are at most this long.
    pub p50_ns: u64,
    /// 99 of 100.
    pub p99_ns: u64,
    /// 999 of 1000.
    pub p999_ns: u64,
    /// The longest.
    pub max_ns: u64,
    /// How many were recorded.
    pub n: u64,
}

impl LatencyHistogram {
    /// Empty; takes about 250 kB, every page of them touched.
    #[must_use]
    pub fn new() -> Self {
        let mut counts = Histogram::new_with_bounds(1, LONGEST_NS, 3)
            .expect("1 ns to 100 s at three digits is a valid histogram");
        // Writes every cell: the first record must not wait for a page.
        counts.reset();
        Self { counts }
    }

    /// Takes one time in.
    pub fn record_ns(&mut self, ns: u64) {
        self.counts.saturating_record(ns);
    }

    /// The distribution so far.
    #[must_use]
    pub fn latencies(&self) -> Latencies {
        if self.counts.is_empty() {
            return Latencies::default();
        }
        let at = |q: f64| self.counts.value_at_quantile(q);
        Latencies {
            p50_ns: at(0.5),
            p99_ns: at(0.99),
            p999_ns: at(0.999),
            max_ns: self.counts.max(),
            n: self.counts.len(),
        }
    }

    /// Cells that hold something: the longest time that counts into it, ns, and how many did.
    pub fn cells(&self) -> impl Iterator<Item = (u64, u64)> {
        self.counts.iter_recorded().map(|c| (c.value_iterated_to(), c.count_at_value()))
    }
}

/// Histograms of the phases of a tick, by name.
#[derive(Clone, Debug)]
pub struct PhaseHistograms {
    phases: Vec<(&'static str, LatencyHistogram)>,
}

impl PhaseHistograms {
    /// One empty histogram for every name.
    #[must_use]
    pub fn new(names: &[&'static str]) -> Self {
        Self { phases: names.iter().map(|n| (*n, LatencyHistogram::new())).collect() }
    }

    /// Takes in how long phase `phase` took, in the order of the names; one that was not named is
    /// left out.
    pub fn record_ns(&mut self, phase: usize, ns: u64) {
        if let Some((_, h)) = self.phases.get_mut(phase) {
            h.record_ns(ns);
        }
    }

    /// Names and distributions, in their order.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, Latencies)> {
        self.phases.iter().map(|(name, h)| (*name, h.latencies()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_a_ramp_has_the_quantiles_of_a_ramp() {
        let mut h = LatencyHistogram::new();
        assert_eq!(h.latencies(), Latencies::default());
        (1..=100_000).for_each(|ns| h.record_ns(ns));
        let l = h.latencies();
        for (got, true_ns) in
            [(l.p50_ns, 50_000), (l.p99_ns, 99_000), (l.p999_ns, 99_900), (l.max_ns, 100_000)]
        {
            assert!(got.abs_diff(true_ns) <= true_ns / 1000, "{got} for {true_ns}");
        }
        assert_eq!(l.n, 100_000);
        assert_eq!(h.cells().map(|(_, n)| n).sum::<u64>(), 100_000);
    }

    #[test]
    fn invariant_no_time_is_too_long_or_too_short() {
        let mut h = LatencyHistogram::new();
        h.record_ns(0);
        h.record_ns(u64::MAX);
        let l = h.latencies();
        assert_eq!(l.n, 2);
        assert!(l.max_ns >= LONGEST_NS);
    }

    #[test]
    fn invariant_phases_keep_apart() {
        let mut p = PhaseHistograms::new(&["read", "work"]);
        p.record_ns(1, 500);
        p.record_ns(2, 500);
        let n: Vec<_> = p.iter().map(|(name, l)| (name, l.n)).collect();
        assert_eq!(n, [("read", 0), ("work", 1)]);
    }
}
