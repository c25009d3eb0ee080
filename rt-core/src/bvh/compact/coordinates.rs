//! Coding of one coordinate of a meshlet's vertices, without loss.
//!
//! The bits of floats, with those of negative ones inverted, are integers in the order of the
//! numbers. Neighbouring vertices differ in few of the low bits, so a meshlet stores the smallest
//! integer, and for each vertex what is to be added. On isosurfaces of lattices, and on terrain,
//! most vertices share coordinates with others; then the different values are stored once, and each
//! vertex has the number of its value.
//!
//! Where two coordinates of each vertex are shared, [`super::edges`] has a shorter coding.

use super::bits::{self, Writer};

/// The coordinates of a meshlet's vertices, axis by axis.
pub(super) type Values = [Vec<f32>; 3];

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
pub(super) fn ordered(x: f32) -> u32 {
    let b = x.to_bits();
    b ^ (((b as i32 >> 31) as u32) | 1 << 31)
}

/// The float of an integer.
#[inline(always)]
pub(super) fn float(k: u32) -> f32 {
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
        // Each costs one more read: not for a few bits.
        let cheaper = each_once < all * bits / 4 * 3;
        Axis { base, bits, entries: if cheaper { different } else { 0 } }
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

    /// Appends the values that are stored once. `sorted` is what [`Axis::choose`] left there.
    pub(super) fn write_values(&self, sorted: &[u32], out: &mut Writer<'_>) {
        if self.entries != 0 {
            sorted.iter().for_each(|&k| out.push(k - self.base, self.bits));
        }
    }

    /// The number of a vertex with this coordinate.
    pub(super) fn number(&self, x: f32, sorted: &[u32]) -> u32 {
        match self.entries {
            0 => ordered(x) - self.base,
            _ => sorted.partition_point(|&k| k < ordered(x)) as u32,
        }
    }
}

/// One coordinate of a meshlet's vertices, ready to be read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coordinates {
    pub(super) base: u32,
    pub(super) bits: u32,
    entries: u32,
    /// Where the vertices' numbers lie in the bits that are read of a vertex.
    shift: u32,
    mask: u32,
    /// Where the values start that are stored once, in bits.
    pub(super) values: usize,
}

impl Coordinates {
    pub(super) const EMPTY: Coordinates =
        Coordinates { base: 0, bits: 0, entries: 0, shift: 0, mask: 0, values: 0 };

    /// Coordinates whose values start at bit `values`, and whose numbers start at bit `shift` of
    /// what is read of a vertex.
    #[inline(always)]
    pub(super) fn new(axis: &Axis, values: usize, shift: u32) -> Coordinates {
        let &Axis { base, bits, entries } = axis;
        let mask = ((1u64 << axis.number_bits()) - 1) as u32;
        // Of 64 bits, none is left: the mask is 0 then.
        Coordinates { base, bits, entries, shift: shift & 63, mask, values }
    }

    /// The coordinates of vertices of which these bits were read. Of values that are stored once,
    /// only those of the vertices are read: a ray sees one or two leaves of most meshlets.
    #[inline(always)]
    pub(super) fn of<const N: usize>(&self, words: &[u32], vertices: &[u64; N]) -> [f32; N] {
        let mut all = [0.0; N];
        let &Coordinates { base, bits, shift, mask, values, .. } = self;
        // No `map`: its closure would be compiled without the caller's instruction set.
        let mut numbers = [0; N];
        for (number, vertex) in numbers.iter_mut().zip(vertices) {
            *number = (vertex >> shift) as u32 & mask;
        }
        if self.entries != 0 {
            for number in &mut numbers {
                *number = bits::read(words, values + (*number * bits) as usize, bits);
            }
        }
        for (x, number) in all.iter_mut().zip(numbers) {
            *x = float(base.wrapping_add(number));
        }
        all
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
            axis.write_values(&sorted, &mut out);
            values.iter().for_each(|&x| out.push(axis.number(x, &sorted), axis.number_bits()));
            out.finish();
            words.push(0);
            let numbers = 3 + axis.value_bits() as usize;
            for shift in [0, 7, 32] {
                let coordinates = Coordinates::new(&axis, 3, shift);
                for (i, x) in values.iter().enumerate() {
                    let at = numbers + i * axis.number_bits() as usize;
                    let vertex = bits::read_64(&words, at) << shift;
                    let [back] = coordinates.of(&words, &[vertex]);
                    assert_eq!(back.to_bits(), x.to_bits(), "{x} of {values:?}");
                }
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
