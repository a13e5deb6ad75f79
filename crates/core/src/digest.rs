use core::fmt;

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// First 16 bytes of a BLAKE3 hash: names a file or a state.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Digest(pub [u8; 16]);

impl Digest {
    /// Digest of bytes.
    #[must_use]
    pub fn of_bytes(bytes: &[u8]) -> Self {
        let mut h = StateHasher::new();
        h.bytes(bytes);
        h.finish()
    }

    /// First eight bytes as an integer, for a telemetry column.
    #[must_use]
    pub fn short(self) -> u64 {
        let mut b = [0; 8];
        b.copy_from_slice(&self.0[..8]);
        u64::from_be_bytes(b)
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|b| write!(f, "{b:02x}"))
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

/// Hashes the bits of a state in a stated order. Allocates nothing.
#[derive(Clone, Default)]
pub struct StateHasher(blake3::Hasher);

impl StateHasher {
    /// Empty.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Continues a chain: the digest before becomes the first input.
    #[must_use]
    pub fn chained(previous: Digest) -> Self {
        let mut h = Self::new();
        h.bytes(&previous.0);
        h
    }

    /// Raw bytes.
    pub fn bytes(&mut self, b: &[u8]) {
        self.0.update(b);
    }

    /// The bits of a number: −0.0 and 0.0 differ, as they may behave differently later.
    pub fn f64(&mut self, x: f64) {
        self.bytes(&x.to_bits().to_le_bytes());
    }

    /// An integer.
    pub fn u64(&mut self, x: u64) {
        self.bytes(&x.to_le_bytes());
    }

    /// Three numbers.
    pub fn vec3(&mut self, v: DVec3) {
        v.to_array().into_iter().for_each(|x| self.f64(x));
    }

    /// Four numbers.
    pub fn quat(&mut self, q: DQuat) {
        q.to_array().into_iter().for_each(|x| self.f64(x));
    }

    /// The digest so far.
    #[must_use]
    pub fn finish(&self) -> Digest {
        let mut out = [0; 16];
        out.copy_from_slice(&self.0.finalize().as_bytes()[..16]);
        Digest(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_the_last_bit_counts() {
        let one = |x: f64| {
            let mut h = StateHasher::new();
            h.f64(x);
            h.finish()
        };
        assert_ne!(one(1.0), one(f64::from_bits(1.0f64.to_bits() ^ 1)));
        assert_eq!(one(1.0), one(1.0));
    }
}
