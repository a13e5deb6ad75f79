//! What was at the last ticks.

/// The last `N` ticks, and what was between two of them.
#[derive(Clone, Debug)]
pub(super) struct History<T, const N: usize> {
    kept: Box<[T; N]>,
    /// Place of the newest.
    newest: usize,
}

impl<T: Copy, const N: usize> History<T, N> {
    /// After a long time at `rest`.
    pub(super) fn new(rest: T) -> Self {
        Self { kept: Box::new([rest; N]), newest: 0 }
    }

    /// Forgets: after a long time at `rest`.
    pub(super) fn rest(&mut self, rest: T) {
        self.kept.fill(rest);
        self.newest = 0;
    }

    /// Takes a tick in.
    pub(super) fn push(&mut self, now: T) {
        self.newest = (self.newest + 1) % N;
        self.kept[self.newest] = now;
    }

    /// So many ticks ago, 0 to `N` − 2: the ticks after and before it, and the part of the way from that to this.
    pub(super) fn ago(&self, ticks: f64) -> (&T, &T, f64) {
        #[expect(clippy::cast_precision_loss, reason = "hundreds")]
        let ticks = ticks.clamp(0.0, (N - 2) as f64);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to N")]
        let whole = ticks as usize;
        let at = |i: usize| &self.kept[(self.newest + N - i) % N];
        (at(whole), at(whole + 1), ticks.fract())
    }

    /// The oldest there is: by it a digest tells how far back it remembers.
    pub(super) fn oldest(&self) -> &T {
        &self.kept[(self.newest + 1) % N]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_a_line_is_what_it_was() {
        let mut line = History::<f64, 8>::new(-1.0);
        let ago = |h: &History<f64, 8>, ticks: f64| {
            let (a, b, part) = h.ago(ticks);
            a + (b - a) * part
        };
        (0..20).for_each(|i| line.push(f64::from(i)));
        for ticks in [0.0, 0.25, 1.0, 5.5, 6.0] {
            assert!((ago(&line, ticks) - (19.0 - ticks)).abs() < 1e-12, "{ticks}");
        }
        // No farther back than it goes, and not ahead.
        assert!(
            (ago(&line, 100.0) - 13.0).abs() < 1e-12 && (ago(&line, -3.0) - 19.0).abs() < 1e-12
        );
        assert!((line.oldest() - 12.0).abs() < 1e-12);
        line.rest(4.0);
        assert!((ago(&line, 3.7) - 4.0).abs() < 1e-12);
    }
}
