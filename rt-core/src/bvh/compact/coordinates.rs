//! Coding of one coordinate of a meshlet's vertices, without loss.
//!
//! The bits of floats, with those of negative ones inverted, are integers in the order of the
//! numbers. Neighbouring vertices differ in few of the low bits, so a meshlet stores the smallest
//! integer, and for each vertex what is to be added. On isosurfaces of lattices, and on terrain,
//! most vertices share coordinates with others; then the different values are stored once, and each
//! vertex has the number of its value.

use super::bits::{self, Writer};

/// How one coordinate is coded.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Axis {
    /// The smallest integer.
    pub(super) base: u32,
    /// Bits of what is added to it.
    pub(super) bits: u32,
    /// Number of different values when these are stored once; else 0.
    pub(super) entries: u32,
}

/// The integer of a float. Zeros of both signs keep their difference.
#[inline(always)]
fn ordered(x: f32) -> u32 {
    let b = x.to_bits();
    b ^ (((b as i32 >> 31) as u32) | 1 << 31)
}

/// The float of an integer.
#[inline(always)]
fn float(k: u32) -> f32 {
    f32::from_bits(k ^ (!(((k as i32) >> 31) as u32) | 1 << 31))
}

impl Axis {
    /// The cheaper coding of these coordinates. `sorted` is room for their integers.
    pub(super) fn choose(values: &[f32], sorted: &mut Vec<u32>) -> Axis {
        sorted.clear();
        sorted.extend(values.iter().map(|&x| ordered(x)));
        sorted.sort_unstable();
        sorted.dedup();
        let (Some(&base), Some(&last)) = (sorted.first(), sorted.last()) else {
            return Axis::default();
        };
        let (different, all) = (sorted.len() as u32, values.len() as u32);
        let bits = bits::width(last - base);
        let each_once = different * bits + all * bits::width(different - 1);
        Axis { base, bits, entries: if each_once < all * bits { different } else { 0 } }
    }

    /// Bits of the number that a vertex has.
    #[inline(always)]
    pub(super) fn number_bits(&self) -> u32 {
        if self.entries == 0 { self.bits } else { bits::width(self.entries - 1) }
    }

    /// Bits of the values before the vertices' numbers.
    #[inline(always)]
    pub(super) fn value_bits(&self) -> u32 {
        self.entries * self.bits
    }

    /// Appends the coordinates. `sorted` is what [`Axis::choose`] left there.
    pub(super) fn write(&self, values: &[f32], sorted: &[u32], out: &mut Writer<'_>) {
        if self.entries == 0 {
            values.iter().for_each(|&x| out.push(ordered(x) - self.base, self.bits));
            return;
        }
        sorted.iter().for_each(|&k| out.push(k - self.base, self.bits));
        for &x in values {
            let number = sorted.partition_point(|&k| k < ordered(x));
            out.push(number as u32, self.number_bits());
        }
    }
}

/// One coordinate of a meshlet, ready to be read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coordinates {
    base: u32,
    bits: u32,
    number_bits: u32,
    /// Where the values start, in bits; where the vertices' numbers do.
    values: usize,
    numbers: usize,
    each_once: bool,
}

impl Coordinates {
    pub(super) const EMPTY: Coordinates =
        Coordinates { base: 0, bits: 0, number_bits: 0, values: 0, numbers: 0, each_once: false };

    /// The coordinates that start at bit `at`, and where they end.
    #[inline(always)]
    pub(super) fn at(axis: &Axis, vertices: u32, at: usize) -> (Coordinates, usize) {
        let (number_bits, numbers) = (axis.number_bits(), at + axis.value_bits() as usize);
        let coordinates = Coordinates {
            base: axis.base,
            bits: axis.bits,
            number_bits,
            values: at,
            numbers,
            each_once: axis.entries != 0,
        };
        (coordinates, numbers + (vertices * number_bits) as usize)
    }

    /// The coordinate of a vertex.
    #[inline(always)]
    pub(super) fn of(&self, words: &[u32], vertex: u32) -> f32 {
        let at = self.numbers + (vertex * self.number_bits) as usize;
        let mut number = bits::read(words, at, self.number_bits);
        if self.each_once {
            number = bits::read(words, self.values + (number * self.bits) as usize, self.bits);
        }
        float(self.base.wrapping_add(number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_shapes::Random;

    #[test]
    fn coordinates_of_every_kind_come_back_bit_for_bit() {
        let mut r = Random::new(2);
        let edges = [0.0, -0.0, 1e-45, -1e-45, f32::MAX, f32::MIN, 1.0, -1.0, 1.0f32.next_up()];
        let sets: [Vec<f32>; 6] = [
            edges.to_vec(),
            vec![-0.0; 5],
            (0..192).map(|_| r.unit()).collect(),
            (0..100).map(|i| (i % 7) as f32 * 0.1 - 0.3).collect(),
            (0..100).map(|_| f32::from_bits(r.bits() as u32)).filter(|x| x.is_finite()).collect(),
            vec![3.5],
        ];
        let mut once = 0;
        for values in sets {
            let (mut sorted, mut words) = (Vec::new(), Vec::new());
            let axis = Axis::choose(&values, &mut sorted);
            once += usize::from(axis.entries > 0);
            let mut out = Writer::new(&mut words);
            out.push(5, 3);
            axis.write(&values, &sorted, &mut out);
            out.finish();
            let (coordinates, end) = Coordinates::at(&axis, values.len() as u32, 3);
            assert!(end <= 32 * words.len(), "{end} of {}", words.len());
            for (i, x) in values.iter().enumerate() {
                let back = coordinates.of(&words, i as u32);
                assert_eq!(back.to_bits(), x.to_bits(), "{x} of {values:?}");
            }
        }
        assert!((1..6).contains(&once), "{once} sets with each value once");
    }

    #[test]
    fn integers_are_in_the_order_of_the_numbers() {
        let ascending = [f32::MIN, -1.0, -1e-45, -0.0, 0.0, 1e-45, 1.0, f32::MAX];
        assert!(ascending.map(ordered).is_sorted_by(|a, b| a < b));
        assert_eq!(ascending.map(|x| float(ordered(x)).to_bits()), ascending.map(f32::to_bits));
    }
}
