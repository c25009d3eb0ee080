//! The points that a part of a file uses, numbered in the part: for readers that take a part's
//! cells first, and then the points that these name.

use crate::model::Cells;
use rayon::slice::ParallelSliceMut;

/// Numbers a table may span, as a multiple of the corners: it takes 6 bytes for each corner then, a
/// sorted list 8.
const MOST_SPAN: u64 = 32;

/// The points that the cells of a part use, and their corners by the points' places among them.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct UsedPoints {
    /// The points' numbers in the file, each once, ascending.
    pub(super) numbers: Vec<u64>,
    /// Of each corner, the place of its point in `numbers`; [`Cells::NO_POINT`] without a point.
    pub(super) places: Vec<u32>,
    /// Corners without a point.
    pub(super) missing: usize,
}

impl UsedPoints {
    /// `corners` gives the points' numbers, `None` for points that do not exist, and the same
    /// whenever it is called.
    pub(super) fn of<I: Iterator<Item = Option<u64>>>(corners: impl Fn() -> I) -> UsedPoints {
        let (mut count, mut low, mut high) = (0u64, u64::MAX, 0);
        for number in corners().flatten() {
            (count, low, high) = (count + 1, low.min(number), high.max(number));
        }
        if count == 0 {
            return UsedPoints::placed(Vec::new(), corners(), |_, _| 0);
        }
        if (high - low) / MOST_SPAN < count {
            let table = Table::of(corners().flatten(), low, high);
            return UsedPoints::placed(table.numbers(), corners(), |_, number| table.place(number));
        }
        let mut numbers: Vec<u64> = corners().flatten().collect();
        numbers.par_sort_unstable();
        numbers.dedup();
        UsedPoints::placed(numbers, corners(), |numbers, number| {
            numbers.partition_point(|&n| n < number) as u32
        })
    }

    fn placed(
        numbers: Vec<u64>,
        corners: impl Iterator<Item = Option<u64>>,
        place: impl Fn(&[u64], u64) -> u32,
    ) -> UsedPoints {
        let mut missing = 0;
        let places = corners
            .map(|number| match number {
                Some(number) => place(&numbers, number),
                None => {
                    missing += 1;
                    Cells::NO_POINT
                }
            })
            .collect();
        UsedPoints { numbers, places, missing }
    }
}

/// A bit for each number of a range, and how many are set before each word of them.
struct Table {
    low: u64,
    words: Vec<u64>,
    before: Vec<u32>,
}

impl Table {
    fn of(numbers: impl Iterator<Item = u64>, low: u64, high: u64) -> Table {
        let mut words = vec![0u64; ((high - low) / 64 + 1) as usize];
        numbers.for_each(|n| words[((n - low) / 64) as usize] |= 1 << ((n - low) % 64));
        let mut count = 0;
        let before = words
            .iter()
            .map(|word| {
                let before = count;
                count += word.count_ones();
                before
            })
            .collect();
        Table { low, words, before }
    }

    /// The place of a number that is there.
    fn place(&self, number: u64) -> u32 {
        let (word, bit) = (((number - self.low) / 64) as usize, (number - self.low) % 64);
        self.before[word] + (self.words[word] & ((1 << bit) - 1)).count_ones()
    }

    fn numbers(&self) -> Vec<u64> {
        let mut numbers = Vec::new();
        for (first, &word) in (self.low..).step_by(64).zip(&self.words) {
            let mut rest = word;
            while rest != 0 {
                numbers.push(first + u64::from(rest.trailing_zeros()));
                rest &= rest - 1;
            }
        }
        numbers
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::math::SplitMix64;
    use std::collections::BTreeSet;

    #[test]
    fn places_lead_to_the_numbers_of_the_corners_near_and_far() {
        let mut random = SplitMix64::new(5);
        // Spans below, at and far above what a table is for, and one number alone.
        for (count, span) in [(400, 90), (400, 12_799), (400, 12_801), (50, u64::MAX), (1, 1)] {
            let first = random.bits() % (u64::MAX - span + 1).max(1);
            let corners: Vec<Option<u64>> =
                (0..count).map(|i| (i % 7 != 3).then(|| first + random.bits() % span)).collect();
            let used = UsedPoints::of(|| corners.iter().copied());
            let wanted: BTreeSet<u64> = corners.iter().copied().flatten().collect();
            assert_eq!(used.numbers, wanted.into_iter().collect::<Vec<_>>(), "{span}");
            assert_eq!(used.missing, corners.iter().filter(|c| c.is_none()).count());
            for (corner, &place) in corners.iter().zip(&used.places) {
                match corner {
                    Some(number) => assert_eq!(used.numbers[place as usize], *number, "{span}"),
                    None => assert_eq!(place, Cells::NO_POINT),
                }
            }
        }
    }

    #[test]
    fn corners_without_points_use_none() {
        let used = UsedPoints::of(|| [None, None].into_iter());
        let places = vec![Cells::NO_POINT; 2];
        assert_eq!(used, UsedPoints { numbers: Vec::new(), places, missing: 2 });
    }
}
