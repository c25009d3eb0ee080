//! Numbers of any width, packed into 32-bit words.

/// The mask of the `count` lowest bits; `count` is at most 32.
#[inline(always)]
fn mask(count: u32) -> u64 {
    (1 << count) - 1
}

/// The `count` bits from bit `at` on, at most 32. Needs one word after the one where they start.
#[inline(always)]
pub(crate) fn read(words: &[u32], at: usize, count: u32) -> u32 {
    let word = at >> 5;
    let pair: &[u32; 2] = words[word..word + 2].try_into().expect("a slice of that length");
    let pair = u64::from(pair[0]) | u64::from(pair[1]) << 32;
    (pair >> (at & 31) & mask(count)) as u32
}

/// Bits needed for numbers up to `largest`.
pub(crate) fn width(largest: u32) -> u32 {
    32 - largest.leading_zeros()
}

/// Appends numbers.
pub(crate) struct Writer<'w> {
    words: &'w mut Vec<u32>,
    /// Bits that are not yet in `words`.
    pending: u64,
    count: u32,
}

impl<'w> Writer<'w> {
    pub(crate) fn new(words: &'w mut Vec<u32>) -> Self {
        Writer { words, pending: 0, count: 0 }
    }

    /// Appends the lowest `count` bits of `value`, which has no others.
    pub(crate) fn push(&mut self, value: u32, count: u32) {
        debug_assert!(u64::from(value) <= mask(count), "{value} in {count} bits");
        self.pending |= u64::from(value) << self.count;
        self.count += count;
        if self.count >= 32 {
            self.words.push(self.pending as u32);
            self.pending >>= 32;
            self.count -= 32;
        }
    }

    /// Fills the last word, and adds the one that [`read`] needs behind it.
    pub(crate) fn finish(self) {
        self.words.extend([self.pending as u32, 0]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_shapes::Random;

    #[test]
    fn numbers_of_every_width_come_back() {
        let mut r = Random::new(1);
        let numbers: Vec<(u32, u32)> = (0..3000u32)
            .map(|i| {
                let count = i % 33;
                ((r.bits() & mask(count)) as u32, count)
            })
            .collect();
        let mut words = vec![7];
        let mut writer = Writer::new(&mut words);
        numbers.iter().for_each(|&(value, count)| writer.push(value, count));
        writer.finish();
        let mut at = 32;
        for (value, count) in numbers {
            assert_eq!(read(&words, at, count), value, "{count} bits at {at}");
            at += count as usize;
        }
        assert_eq!([0, 1, 2, 255, 256, u32::MAX].map(width), [0, 1, 2, 8, 9, 32]);
    }
}
