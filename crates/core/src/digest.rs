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

/// A chunk of BLAKE3: whole ones are hashed several blocks at a time, single numbers are not.
const CHUNK: usize = 1024;

/// Hashes the bits of a state in a stated order. Allocates nothing.
#[derive(Clone)]
pub struct StateHasher {
    hasher: blake3::Hasher,
    pending: [u8; CHUNK],
    len: usize,
}

impl Default for StateHasher {
    fn default() -> Self {
        Self { hasher: blake3::Hasher::new(), pending: [0; CHUNK], len: 0 }
    }
}

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
        if self.len + b.len() > CHUNK {
            self.hasher.update(&self.pending[..self.len]);
            self.len = 0;
        }
        if b.len() > CHUNK {
            self.hasher.update(b);
            return;
        }
        self.pending[self.len..self.len + b.len()].copy_from_slice(b);
        self.len += b.len();
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
        let mut hasher = self.hasher.clone();
        hasher.update(&self.pending[..self.len]);
        let mut out = [0; 16];
        out.copy_from_slice(&hasher.finalize().as_bytes()[..16]);
        Digest(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_pieces_of_any_length_give_the_digest_of_the_whole() {
        let data: Vec<u8> =
            (0..10_000u32).map(|i| (i.wrapping_mul(0x9e37_79b9) >> 24) as u8).collect();
        for size in [1, 7, 8, 1023, 1024, 1025, 3000, 10_000] {
            let mut h = StateHasher::new();
            data.chunks(size).for_each(|c| h.bytes(c));
            assert_eq!(h.finish().0, blake3::hash(&data).as_bytes()[..16], "pieces of {size}");
        }
    }

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
