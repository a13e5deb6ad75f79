//! Inputs of a fuzzer are bytes; here they are choices.

/// The bytes of an input, taken from the front. Behind their end everything is 0, so that a shorter input is a
/// simpler one.
pub(crate) struct Dice<'a>(&'a [u8]);

impl<'a> Dice<'a> {
    pub(crate) const fn new(input: &'a [u8]) -> Self {
        Self(input)
    }

    /// Whether nothing is left to choose by.
    pub(crate) const fn spent(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }

    /// Below `n`, which is at most 2^24.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        let bytes =
            if n <= 1 << 8 { 1 } else { 1 + usize::from(n > 1 << 8) + usize::from(n > 1 << 16) };
        let x = (0..bytes).fold(0, |x, _| x << 8 | usize::from(self.byte()));
        x % n.max(1)
    }

    pub(crate) fn of<'b, T>(&mut self, items: &'b [T]) -> &'b T {
        &items[self.below(items.len())]
    }
}
