//! How a run says how far it is, and how it asks before something moves.

/// Learns how far a run is.
pub trait Progress {
    /// So many ticks of so many are done.
    fn at(&mut self, done: u64, of: u64);

    /// The run is over.
    fn done(&mut self) {}
}

/// Nobody looks.
impl Progress for () {
    fn at(&mut self, _done: u64, _of: u64) {}
}

impl<P: Progress + ?Sized> Progress for &mut P {
    fn at(&mut self, done: u64, of: u64) {
        (**self).at(done, of);
    }

    fn done(&mut self) {
        (**self).done();
    }
}
