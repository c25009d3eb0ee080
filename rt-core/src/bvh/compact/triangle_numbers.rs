//! Coding of the numbers that the triangles of a meshlet have in their mesh.
//!
//! Meshes are written row by row, and so the triangles of a meshlet have numbers in a few ranges
//! far apart. In a sheet with rows of 1000 triangles, 64 neighbours from six rows take 13 bits for
//! a number less the lowest one, and 4 for a number less the lowest one of its row. So numbers form
//! **groups**. A meshlet stores where each group starts, and of each triangle its group and its
//! number less that start.
//! (A mesh of 2.6 million triangles went from 13.9 to 13.1 bytes each.)

use super::bits::{self, Writer};

/// How the numbers of a meshlet's triangles are coded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TriangleNumbers {
    /// The lowest number.
    pub(super) first: u32,
    /// Bits of the highest number less the lowest one.
    pub(super) range_bits: u32,
    /// With one group, a triangle has its number less the lowest one.
    pub(super) groups: u32,
    /// With several, the bits of a number less the start of its group.
    pub(super) low_bits: u32,
}

impl TriangleNumbers {
    pub(super) const EMPTY: TriangleNumbers =
        TriangleNumbers { first: 0, range_bits: 0, groups: 1, low_bits: 0 };

    /// Bits below the number of the group.
    #[inline(always)]
    fn bits_in_group(&self) -> u32 {
        if self.groups == 1 { self.range_bits } else { self.low_bits }
    }

    /// Bits that a triangle has: at most 32.
    #[inline(always)]
    pub(super) fn number_bits(&self) -> u32 {
        bits::width(self.groups - 1) + self.bits_in_group()
    }

    /// Bits of the start of a group.
    #[inline(always)]
    fn start_bits(&self) -> u32 {
        if self.groups == 1 { 0 } else { self.range_bits }
    }

    /// Bits of the starts of all groups.
    #[inline(always)]
    pub(super) fn groups_bits(&self) -> u32 {
        self.groups * self.start_bits()
    }

    /// The group of a triangle that has these bits.
    #[inline(always)]
    pub(super) fn group(&self, bits: u64) -> u32 {
        let bits = bits & ((1 << self.number_bits()) - 1);
        (bits >> self.bits_in_group()) as u32
    }

    /// The number of a triangle whose bits `triangle` starts with. The groups start at bit `groups`
    /// of the words.
    #[inline(always)]
    pub(super) fn read(&self, words: &[u32], groups: usize, triangle: u64) -> u32 {
        let low = triangle & ((1 << self.bits_in_group()) - 1);
        let start_bits = self.start_bits();
        // The only group has no bits: its start is 0.
        let start = groups + (self.group(triangle) * start_bits) as usize;
        let start = bits::read(words, start, start_bits);
        self.first.wrapping_add(start).wrapping_add(low as u32)
    }
}

/// Finds the groups of the numbers; keeps its buffers from one meshlet to the next.
#[derive(Debug, Default)]
pub(super) struct NumberCoder {
    sorted: Vec<u32>,
    /// The lowest number of each group, ascending.
    starts: Vec<u32>,
}

impl NumberCoder {
    /// The coding that takes the fewest bits for these numbers.
    pub(super) fn choose(&mut self, ids: &[u32]) -> TriangleNumbers {
        self.sorted.clear();
        self.sorted.extend(ids);
        self.sorted.sort_unstable();
        self.starts.clear();
        let (Some(&first), Some(&last)) = (self.sorted.first(), self.sorted.last()) else {
            return TriangleNumbers::EMPTY;
        };
        let range_bits = bits::width(last - first);
        let count = ids.len() as u32;
        let mut best = TriangleNumbers { first, range_bits, ..TriangleNumbers::EMPTY };
        let mut least = count * best.number_bits();
        for low_bits in (0..range_bits).rev() {
            // No more than triangles: what a header can name.
            let groups = starts(&self.sorted, low_bits).count() as u32;
            if groups * range_bits >= least {
                // With fewer bits, there are as many groups or more.
                break;
            }
            let coding = TriangleNumbers { groups, low_bits, ..best };
            let bits = coding.groups_bits() + count * coding.number_bits();
            if bits < least {
                (best, least) = (coding, bits);
            }
        }
        if best.groups > 1 {
            self.starts.extend(starts(&self.sorted, best.low_bits));
        }
        best
    }

    /// Appends the bits of a triangle with the number `id`.
    pub(super) fn write(&self, numbers: &TriangleNumbers, id: u32, out: &mut Writer<'_>) {
        let group = self.starts.partition_point(|&start| start <= id).saturating_sub(1);
        let start = self.starts.get(group).copied().unwrap_or(numbers.first);
        out.push(id - start, numbers.bits_in_group());
        out.push(group as u32, bits::width(numbers.groups - 1));
    }

    /// Appends the starts of the groups.
    pub(super) fn write_groups(&self, numbers: &TriangleNumbers, out: &mut Writer<'_>) {
        self.starts.iter().for_each(|&start| out.push(start - numbers.first, numbers.range_bits));
    }
}

/// The lowest numbers of groups in which each number is less than 2 to the power of `low_bits`
/// above the lowest one, which has fewer than 32 bits.
fn starts(sorted: &[u32], low_bits: u32) -> impl Iterator<Item = u32> {
    let mut rest = sorted;
    std::iter::from_fn(move || {
        let &start = rest.first()?;
        let count = rest.partition_point(|&id| id - start < 1 << low_bits);
        rest = &rest[count..];
        Some(start)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_shapes::Random;

    #[test]
    fn numbers_in_ranges_far_apart_come_back_in_fewer_bits() {
        let mut r = Random::new(23);
        let rows = |rows: u32, apart: u32| -> Vec<u32> {
            (0..64).map(|i| 70 + i % rows * apart + i / rows).collect()
        };
        // With the bits of a triangle, starts of groups shared among all, by hand.
        let sets: [(Vec<u32>, u32); 8] = [
            (rows(1, 0), 6),
            (rows(4, 10_000), 2 + 4 + 1),
            (rows(8, 100_000), 3 + 3 + 3),
            (rows(2, u32::MAX / 2), 1 + 5 + 1),
            ((0..64).map(|i| i * (u32::MAX / 64)).collect(), 32),
            (vec![u32::MAX], 0),
            (vec![u32::MAX, 0], 32),
            ((0..64).map(|_| r.bits() as u32).collect(), 32),
        ];
        let mut coder = NumberCoder::default();
        for (ids, most) in sets {
            let numbers = coder.choose(&ids);
            let mut words = Vec::new();
            let mut out = Writer::new(&mut words);
            out.push(1, 3);
            ids.iter().for_each(|&id| coder.write(&numbers, id, &mut out));
            coder.write_groups(&numbers, &mut out);
            out.finish();
            words.push(0);
            let width = numbers.number_bits() as usize;
            let groups = 3 + ids.len() * width;
            for (i, &id) in ids.iter().enumerate() {
                let triangle = bits::read_57(&words, 3 + i * width);
                assert!(numbers.group(triangle) < numbers.groups);
                assert_eq!(numbers.read(&words, groups, triangle), id, "{numbers:?}");
            }
            let bits = numbers.groups_bits() as usize + ids.len() * width;
            assert!(bits <= ids.len() * most as usize, "{bits} bits, {numbers:?}");
            assert!(width <= 32, "{numbers:?}");
        }
    }
}
