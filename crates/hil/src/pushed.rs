//! The control wrench on the chaser, told to an emulated rig whose rack gives way as the chaser does. A real
//! rig is never told: its rack stands still.

use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

use docktwin_core::Wrench;

/// A wrench that the run sets and the emulated rig reads: about the mass centre of the chaser, in its axes, N and
/// N·m. Clones are the same wrench. Zero until it is set.
#[derive(Clone, Debug, Default)]
pub struct Pushed(Arc<[AtomicU64; 6]>);

impl Pushed {
    /// From now on.
    pub fn set(&self, wrench: &Wrench) {
        let numbers = [wrench.f, wrench.m].map(|v| v.to_array());
        for (to, x) in self.0.iter().zip(numbers.as_flattened()) {
            to.store(x.to_bits(), Ordering::Relaxed);
        }
    }

    /// As set last.
    #[must_use]
    pub fn get(&self) -> Wrench {
        let x = |i: usize| f64::from_bits(self.0[i].load(Ordering::Relaxed));
        let at = |i: usize| docktwin_core::DVec3::new(x(i), x(i + 1), x(i + 2));
        Wrench { f: at(0), m: at(3) }
    }
}
