//! A bounded ring buffer between the real-time loop and the thread that observes its ticks.
//!
//! A slot belongs to the reader from the moment `head` passes it until `tail` does, to the writer
//! otherwise: no lock is ever contended, and the writer takes a bounded number of steps whatever
//! the reader does. A channel is not suitable: if its receiver is preempted while it receives, the
//! sender spins.

use std::sync::{
    Mutex,
    atomic::{AtomicBool, AtomicU64, Ordering},
};

/// Places of `T`, one writer, one reader.
pub struct Ring<T> {
    slots: Box<[Mutex<T>]>,
    /// Written so far.
    head: AtomicU64,
    /// Read so far.
    tail: AtomicU64,
    closed: AtomicBool,
}

impl<T> Ring<T> {
    /// With so many places, each made by `place` and therefore in memory.
    pub fn new(places: usize, place: impl FnMut() -> T) -> Self {
        Self {
            slots: core::iter::repeat_with(place).take(places.max(1)).map(Mutex::new).collect(),
            head: AtomicU64::new(0),
            tail: AtomicU64::new(0),
            closed: AtomicBool::new(false),
        }
    }

    fn slot(&self, number: u64) -> &Mutex<T> {
        #[expect(clippy::cast_possible_truncation, reason = "below the number of places")]
        let place = (number % self.slots.len() as u64) as usize;
        &self.slots[place]
    }

    /// Writes the next place; false when there is none free.
    pub fn write(&self, fill: impl FnOnce(&mut T)) -> bool {
        let head = self.head.load(Ordering::Relaxed);
        if head - self.tail.load(Ordering::Acquire) >= self.slots.len() as u64 {
            return false;
        }
        let Ok(mut slot) = self.slot(head).try_lock() else { return false };
        fill(&mut slot);
        drop(slot);
        self.head.store(head + 1, Ordering::Release);
        true
    }

    /// Reads the next place; `None` when there is nothing.
    pub fn read<R>(&self, look: impl FnOnce(&T) -> R) -> Option<R> {
        let tail = self.tail.load(Ordering::Relaxed);
        if tail == self.head.load(Ordering::Acquire) {
            return None;
        }
        let slot = self.slot(tail).try_lock().ok()?;
        let out = look(&slot);
        drop(slot);
        self.tail.store(tail + 1, Ordering::Release);
        Some(out)
    }

    /// Says that nothing more will be written.
    pub fn close(&self) {
        self.closed.store(true, Ordering::Release);
    }

    /// Whether nothing more will be written. Ask before the last look, or what was written in between
    /// is lost.
    pub fn is_closed(&self) -> bool {
        self.closed.load(Ordering::Acquire)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[test]
    fn oracle_a_full_ring_refuses_and_keeps_what_it_has() {
        let ring = Ring::new(3, || 0);
        let write = |n| ring.write(|s| *s = n);
        let read = || ring.read(|s| *s);
        assert_eq!(read(), None);
        assert_eq!([1, 2, 3, 4].map(write), [true, true, true, false]);
        assert_eq!(read(), Some(1));
        assert!(write(5));
        assert_eq!([2, 3, 5].map(Some), core::array::from_fn(|_| read()));
        assert_eq!(read(), None);
    }

    #[test]
    fn invariant_what_arrives_is_whole_and_in_order_and_the_rest_is_counted() {
        let ring = Arc::new(Ring::new(8, || [0_u64; 2]));
        let reader = {
            let ring = Arc::clone(&ring);
            std::thread::spawn(move || {
                let (mut n, mut last) = (0_u64, 0);
                loop {
                    let closed = ring.is_closed();
                    match ring.read(|s| *s) {
                        Some([t, not]) => {
                            assert_eq!(t, !not, "torn");
                            assert!(t > last, "{t} after {last}");
                            (n, last) = (n + 1, t);
                        }
                        None if closed => return n,
                        None => std::thread::yield_now(),
                    }
                }
            })
        };
        let sent: u64 = (1..=100_000).map(|n| u64::from(ring.write(|s| *s = [n, !n]))).sum();
        ring.close();
        assert_eq!(reader.join().expect("no panic"), sent);
        assert!(sent >= 8);
    }
}
