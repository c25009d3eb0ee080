//! Coding of vertices on the edges of a lattice, without loss.
//!
//! An isosurface of a lattice has its vertices where it crosses edges: of each vertex, two
//! coordinates are those of lattice planes, which many others share, and one is free. So a meshlet
//! stores the few values of the planes once per axis, and for each vertex which axis is free, what
//! is to be added to the smallest integer of that axis, and two numbers of planes. (The stored file
//! of 259 million triangles of nested isosurfaces went from 18.2 to 16.1 bytes each by this and by
//! two words less per meshlet.)

use super::bits::{self, Writer};
use super::coordinates::{Axis, Coordinates, Values, float, ordered};

/// Bits of the axis that is free.
const AXIS_BITS: u32 = 2;

/// Most planes, of all axes together, with one vertex each in a meshlet that is coded so.
const MAX_SINGLE: usize = 16;

/// Most planes, of all axes together, in a meshlet that is coded so.
const MAX_PLANES: usize = 96;

/// The bits of a vertex.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct EdgeBits {
    /// Of the free coordinate.
    free: u32,
    /// Of the number of a plane.
    plane: u32,
}

/// A vertex, as its bits say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EdgeVertex {
    /// The axis whose coordinate is free.
    pub(super) axis: usize,
    /// The numbers of the planes on the two axes after it, in cyclic order.
    pub(super) planes: [u32; 2],
}

impl EdgeBits {
    /// The bits of the vertices of a meshlet, of whose axes each has as many entries as planes.
    #[inline(always)]
    pub(super) fn new(axes: &[Axis; 3]) -> EdgeBits {
        let [x, y, z] = axes;
        let most = x.entries.max(y.entries).max(z.entries);
        EdgeBits {
            free: x.bits.max(y.bits).max(z.bits),
            plane: bits::width(most.saturating_sub(1)),
        }
    }

    /// The bits of a whole vertex: at most 50.
    #[inline(always)]
    pub(super) fn vertex(self) -> u32 {
        AXIS_BITS + self.free + 2 * self.plane
    }

    /// The vertex that these bits start with.
    pub(super) fn read(self, vertex: u64) -> EdgeVertex {
        let plane = |k: u32| {
            (vertex >> (AXIS_BITS + self.free + k * self.plane)) as u32 & ((1 << self.plane) - 1)
        };
        EdgeVertex { axis: (vertex & 3) as usize, planes: [plane(0), plane(1)] }
    }

    /// The coordinates on `axis`, which is coded as `coding` says, of vertices of which these bits
    /// were read.
    #[inline(always)]
    pub(super) fn coordinates<const N: usize>(
        self,
        words: &[u32],
        vertices: &[u64; N],
        axis: usize,
        coding: &Coordinates,
    ) -> [f32; N] {
        let &Coordinates { base, bits, values, .. } = coding;
        let free_mask = ((1u64 << self.free) - 1) as u32;
        let plane_mask = (1 << self.plane) - 1;
        let (first, second) = (AXIS_BITS + self.free, AXIS_BITS + self.free + self.plane);
        let before = (axis as u64 + 2) % 3;
        let mut all = [0.0; N];
        for (x, vertex) in all.iter_mut().zip(vertices) {
            let of_vertex = vertex & 3;
            let shift = if of_vertex == before { first } else { second };
            let is_free = of_vertex == axis as u64;
            // A free coordinate has no plane: the first one is read then, which is there.
            let plane = if is_free { 0 } else { (vertex >> shift) as u32 & plane_mask };
            let on_plane = bits::read(words, values + (plane * bits) as usize, bits);
            let free = (vertex >> AXIS_BITS) as u32 & free_mask;
            *x = float(base.wrapping_add(if is_free { free } else { on_plane }));
        }
        all
    }
}

/// The vertices of a meshlet as ends of edges.
#[derive(Debug, Default)]
pub(super) struct EdgeCoder {
    /// Integers of the planes, ascending.
    planes: [Vec<u32>; 3],
    sorted: Vec<u32>,
    axes: Vec<u8>,
}

impl EdgeCoder {
    /// The axes when these vertices lie on edges of few planes and take less than `most` bits so,
    /// with the values of the planes. `different` is how many values differ on all axes together.
    pub(super) fn choose(
        &mut self,
        values: &Values,
        different: usize,
        most: u32,
    ) -> Option<[Axis; 3]> {
        let count = values[0].len();
        if different > count + MAX_PLANES {
            // A vertex on an edge has one value for itself. Most meshes end here.
            return None;
        }
        let mut axes = [Axis::default(); 3];
        for ((axis, planes), values) in axes.iter_mut().zip(&mut self.planes).zip(values) {
            self.sorted.clear();
            self.sorted.extend(values.iter().map(|&x| ordered(x)));
            self.sorted.sort_unstable();
            let (Some(&base), Some(&last)) = (self.sorted.first(), self.sorted.last()) else {
                return None;
            };
            (axis.base, axis.bits) = (base, bits::width(last - base));
            planes.clear();
            // Whoever shares a value shares a plane.
            let twice = self.sorted.windows(2).filter(|pair| pair[0] == pair[1]);
            planes.extend(twice.map(|pair| pair[0]));
            planes.dedup();
        }

        // ---- The free axis of each vertex, and planes for those that share too few.
        let mut single = [const { Vec::new() }; 3];
        self.axes.clear();
        for vertex in 0..count {
            let shared = [0, 1, 2]
                .map(|a| self.planes[a].binary_search(&ordered(values[a][vertex])).is_ok());
            let free = shared.iter().position(|shared| !shared).unwrap_or(0);
            for a in (0..3).filter(|&a| a != free && !shared[a]) {
                single[a].push(ordered(values[a][vertex]));
            }
            if single.iter().map(Vec::len).sum::<usize>() > MAX_SINGLE {
                return None;
            }
            self.axes.push(free as u8);
        }
        for ((axis, planes), single) in axes.iter_mut().zip(&mut self.planes).zip(single) {
            planes.extend(single);
            planes.sort_unstable();
            planes.dedup();
            if planes.is_empty() {
                // Every vertex is free on this axis. Readers expect a plane.
                planes.push(axis.base);
            }
            axis.entries = planes.len() as u32;
        }
        let tables: u32 = axes.iter().map(Axis::value_bits).sum();
        let fits = axes.iter().all(|axis| axis.entries < 256);
        (fits && tables + count as u32 * EdgeBits::new(&axes).vertex() < most).then_some(axes)
    }

    /// The integers of the planes that [`EdgeCoder::choose`] found.
    pub(super) fn planes(&self) -> &[Vec<u32>; 3] {
        &self.planes
    }

    /// Appends the vertices.
    pub(super) fn write(&self, axes: &[Axis; 3], values: &Values, out: &mut Writer<'_>) {
        let EdgeBits { free, plane } = EdgeBits::new(axes);
        for (vertex, &axis) in self.axes.iter().enumerate() {
            let axis = usize::from(axis);
            out.push(axis as u32, AXIS_BITS);
            out.push(ordered(values[axis][vertex]) - axes[axis].base, free);
            for other in [(axis + 1) % 3, (axis + 2) % 3] {
                let value = ordered(values[other][vertex]);
                let number = self.planes[other].partition_point(|&k| k < value);
                out.push(number as u32, plane);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_shapes::Random;

    /// Vertices on edges between planes with these values, and `astray` on none.
    fn vertices(r: &mut Random, planes: &[f32], count: usize, astray: usize) -> Values {
        let mut values = [const { Vec::new() }; 3];
        for vertex in 0..count {
            let free = r.bits() as usize % 3;
            for (a, values) in values.iter_mut().enumerate() {
                let plane = planes[r.bits() as usize % planes.len()];
                values.push(if a == free || vertex < astray { r.unit() } else { plane });
            }
        }
        values
    }

    #[test]
    fn vertices_on_edges_come_back_bit_for_bit() {
        let mut r = Random::new(11);
        let extremes = [0.0, -0.0, f32::MAX, f32::MIN, 1e-45, -1e-45, 1.0];
        let (mut coder, mut coded) = (EdgeCoder::default(), 0);
        let sets: [(&[f32], usize, usize); 6] = [
            (&[0.25, 0.5, 0.75], 192, 0),
            (&extremes, 100, 0),
            (&[-3.0], 40, 0),
            (&[0.1, 0.2, 0.3, 0.4], 120, 5),
            (&[0.5], 1, 0),
            (&[0.5, 0.25], 60, 40),
        ];
        for (planes, count, astray) in sets {
            let values = vertices(&mut r, planes, count, astray);
            let Some(axes) = coder.choose(&values, 0, u32::MAX) else { continue };
            coded += 1;
            let mut words = Vec::new();
            let mut out = Writer::new(&mut words);
            out.push(3, 5);
            let mut starts = [5; 3];
            for a in 0..3 {
                starts[a] =
                    if a == 0 { 5 } else { starts[a - 1] + axes[a - 1].value_bits() as usize };
                axes[a].write_values(&coder.planes()[a], &mut out);
            }
            coder.write(&axes, &values, &mut out);
            out.finish();
            words.push(0);
            let edge = EdgeBits::new(&axes);
            assert!(edge.vertex() <= 50, "{edge:?}");
            let first = starts[2] + axes[2].value_bits() as usize;
            for vertex in 0..count {
                let bits = bits::read_57(&words, first + vertex * edge.vertex() as usize);
                let whole = edge.read(bits);
                assert!(whole.axis < 3);
                for a in 0..3 {
                    let coding = Coordinates::new(&axes[a], starts[a], 0);
                    let [back] = edge.coordinates(&words, &[bits], a, &coding);
                    assert_eq!(back.to_bits(), values[a][vertex].to_bits(), "{planes:?} {vertex}");
                }
            }
        }
        assert_eq!(coded, 5, "all but the set where most vertices lie on no edge");
    }
}
