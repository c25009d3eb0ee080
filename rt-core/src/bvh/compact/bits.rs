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

/// The 64 bits from bit `at` on. Needs two words after the one where they start.
#[inline(always)]
pub(super) fn read_64(words: &[u32], at: usize) -> u64 {
    let (word, shift) = (at >> 5, at & 31);
    let three: &[u32; 3] = words[word..word + 3].try_into().expect("a slice of that length");
    let low = u64::from(three[0]) | u64::from(three[1]) << 32;
    // By 64 less the shift, in two steps: it may be 64.
    low >> shift | u64::from(three[2]) << 1 << (63 - shift)
}

/// Bits that [`read_57`] has at least.
pub(super) const SHORT_READ: u32 = 57;

/// At least 57 bits from bit `at` on, below others. Needs two words after the one where they start.
/// One load, where [`read_64`] needs three.
#[inline(always)]
pub(super) fn read_57(words: &[u32], at: usize) -> u64 {
    if cfg!(target_endian = "big") {
        return read_64(words, at);
    }
    let bytes: &[u8] = bytemuck::cast_slice(words);
    let first = at >> 3;
    let eight: [u8; 8] = bytes[first..first + 8].try_into().expect("a slice of that length");
    u64::from_le_bytes(eight) >> (at & 7)
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
    fn sixty_four_bits_are_read_from_any_place() {
        let mut r = Random::new(3);
        let words: Vec<u32> = (0..8).map(|_| r.bits() as u32).collect();
        for at in 0..32 * 5 {
            let expected = (0..64).fold(0, |bits, i| {
                bits | u64::from(words[(at + i) / 32] >> ((at + i) % 32) & 1) << i
            });
            assert_eq!(read_64(&words, at), expected, "from bit {at}");
            let short = read_57(&words, at) ^ expected;
            assert_eq!(short << (64 - SHORT_READ), 0, "from bit {at}");
        }
    }

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
