//! Work in parallel, and how far it has come.

use std::sync::{Mutex, PoisonError};

use docktwin_run::progress::Progress;
use rayon::iter::{IndexedParallelIterator as _, IntoParallelIterator as _, ParallelIterator as _};

/// Runs parts `0..parts` on all cores. Results, and the error where there is one, are in the order of
/// the parts: they do not depend on which thread did what.
pub(crate) fn in_parallel<T: Send, E: Send>(
    parts: usize,
    progress: &mut (dyn Progress + Send),
    work: impl Fn(usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let of = u64::try_from(parts).unwrap_or(u64::MAX);
    let so_far = Mutex::new((0, &mut *progress));
    let all: Vec<Result<T, E>> = (0..parts)
        .into_par_iter()
        // Parts are long: each may go to another thread.
        .with_max_len(1)
        .map(|i| {
            let result = work(i);
            let mut so_far = so_far.lock().unwrap_or_else(PoisonError::into_inner);
            so_far.0 += 1;
            let done = so_far.0;
            so_far.1.at(done, of);
            result
        })
        .collect();
    progress.done();
    all.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Seen {
        at: Vec<(u64, u64)>,
        done: u32,
    }

    impl Progress for Seen {
        fn at(&mut self, done: u64, of: u64) {
            self.at.push((done, of));
        }

        fn done(&mut self) {
            self.done += 1;
        }
    }

    #[test]
    fn invariant_results_and_errors_come_in_the_order_of_the_parts() {
        let mut seen = Seen::default();
        let squares = in_parallel(100, &mut seen, |i| Ok::<_, ()>(i * i));
        assert_eq!(squares, Ok((0..100).map(|i| i * i).collect()));
        assert_eq!(seen.at, (1..=100).map(|n| (n, 100)).collect::<Vec<_>>());
        assert_eq!(seen.done, 1);
        for _ in 0..50 {
            let failed = in_parallel(64, &mut (), |i| if i % 10 == 7 { Err(i) } else { Ok(i) });
            assert_eq!(failed, Err(7), "the first part that failed, whoever ran it");
        }
    }
}
