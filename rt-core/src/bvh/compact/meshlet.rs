//! The form of a meshlet: 32-bit words, of which the first are a header of fixed length.
//!
//! ```text
//! word 0      triangles − 1 (6 bits), vertices − 1 (8), nodes − 1 (4), leaves − 1 (5),
//!             bits of the range of the triangle numbers (6), whether vertices lie on edges (1)
//! word 1      the lowest triangle number
//! word 2      exponents of the boxes' lattice + 127 (8 bits each), bits of a vertex number (4)
//! words 3–5   origin of the lattice
//! words 6–8   smallest coordinates
//! word 9      bits of the coordinates (6 each), words of the nodes (7),
//!             groups of the triangle numbers − 1 (6)
//! word 10     different coordinates, when each is stored once (8 each),
//!             bits of a triangle number in its group (5)
//! then        the nodes: kinds of the children (4 bits each), planes (a byte each)
//! then        without gaps: of each triangle, three vertex numbers and its number;
//!             where the groups of triangle numbers start, unless there is only one;
//!             the x, y and z that are stored once; of each vertex, x, y and z or their numbers,
//!             or, on an edge, its axis (2 bits), its coordinate there, and two numbers
//! ```
//!
//! What belongs to one triangle, or to one vertex, lies together, so that one read has all of it:
//! with each coordinate by itself, a leaf took 36 reads for its corners in place of 12. Vertices
//! are in the order of their first use, and so those of a leaf lie together too. Every meshlet is
//! followed by others, by nodes or by zeros, because readers take more than they need.
//!
//! Nodes are in the order in which the nodes before them name them, and so are leaves and their
//! triangles: neither needs a reference.

use super::bits::{self, Writer};
use super::boxes::Lattice;
use super::coordinates::{Axis, Coordinates, Values};
use super::cut::Part;
use super::edges::{EdgeBits, EdgeCoder};
use super::triangle_numbers::{NumberCoder, TriangleNumbers};
use crate::bvh::build::{BuilderConfig, LeafCapacity, PrimRef, UNWATCHED, build_wide};
use crate::bvh::layout::triangles::TriWriter;
use crate::bvh::layout::wide::{
    CHILD_ROW, ChildRef, LeafWriter, NODE_UNITS, Unit, WIDTH, WideBvh, get_box,
};
use crate::bvh::options::BuildQuality;
use crate::math::Aabb;
use std::collections::VecDeque;

/// Most nodes of the small tree.
pub(super) const MAX_NODES: usize = 9;
/// Words before the nodes.
pub(super) const HEADER_WORDS: usize = 11;

/// A child that is a node. Leaves have their number of triangles less one, in two bits.
pub(super) const NODE: u32 = 8;
/// No child.
pub(super) const NONE: u32 = 15;

/// The fixed part of a meshlet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Header {
    pub(super) triangles: u32,
    pub(super) vertices: u32,
    pub(super) nodes: u32,
    pub(super) leaves: u32,
    pub(super) numbers: TriangleNumbers,
    /// Bits of a vertex number.
    pub(super) index_bits: u32,
    pub(super) lattice: Lattice,
    pub(super) axes: [Axis; 3],
    /// Whether the vertices are coded as [`super::edges`] says.
    pub(super) on_edges: bool,
    /// Words of the nodes. Counting them at each meshlet took a 25th of the time of rays of
    /// ambient occlusion.
    pub(super) node_words: u32,
}

impl Header {
    fn words(&self) -> [u32; HEADER_WORDS] {
        let three = |bits: u32, of: fn(&Axis) -> u32| {
            self.axes.iter().rev().fold(0, |word, axis| word << bits | of(axis))
        };
        let counts = (self.triangles - 1)
            | (self.vertices - 1) << 6
            | (self.nodes - 1) << 14
            | (self.leaves - 1) << 18
            | self.numbers.range_bits << 23
            | u32::from(self.on_edges) << 29;
        let exponents =
            self.lattice.exponents.iter().rev().fold(0, |word, e| word << 8 | (e + 127) as u32);
        let [ox, oy, oz] = self.lattice.origin.map(f32::to_bits);
        let [x, y, z] = self.axes.map(|axis| axis.base);
        let (bits, entries) = (three(6, |axis| axis.bits), three(8, |axis| axis.entries));
        let bits = bits | self.node_words << 18 | (self.numbers.groups - 1) << 25;
        let entries = entries | self.numbers.low_bits << 24;
        let exponents = exponents | self.index_bits << 24;
        [counts, self.numbers.first, exponents, ox, oy, oz, x, y, z, bits, entries]
    }

    #[inline(always)]
    pub(super) fn read(words: &[u32]) -> Header {
        let words: &[u32; HEADER_WORDS] = words.first_chunk().expect("a meshlet's header");
        let axis = |a: usize| Axis {
            base: words[6 + a],
            bits: words[9] >> (6 * a) & 63,
            entries: words[10] >> (8 * a) & 255,
        };
        let exponent = |a: usize| (words[2] >> (8 * a) & 255) as i32 - 127;
        Header {
            triangles: (words[0] & 63) + 1,
            vertices: (words[0] >> 6 & 255) + 1,
            nodes: (words[0] >> 14 & 15) + 1,
            leaves: (words[0] >> 18 & 31) + 1,
            numbers: TriangleNumbers {
                first: words[1],
                range_bits: words[0] >> 23 & 63,
                groups: (words[9] >> 25 & 63) + 1,
                low_bits: words[10] >> 24 & 31,
            },
            index_bits: words[2] >> 24 & 15,
            lattice: Lattice {
                origin: [words[3], words[4], words[5]].map(f32::from_bits),
                exponents: [exponent(0), exponent(1), exponent(2)],
            },
            axes: [axis(0), axis(1), axis(2)],
            on_edges: words[0] >> 29 & 1 == 1,
            node_words: words[9] >> 18 & 127,
        }
    }
}

/// Where the numbers of a meshlet lie, in bits from its start.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sections {
    pub(super) triangles: usize,
    /// Bits of a triangle.
    pub(super) triangle: u32,
    /// The starts of the groups of triangle numbers.
    pub(super) groups: usize,
    pub(super) vertices: usize,
    /// Bits of a vertex.
    pub(super) vertex: u32,
    /// Bits of a vertex before its z. A read of 64 bits has z too, or starts there.
    pub(super) before_z: u32,
    pub(super) coordinates: [Coordinates; 3],
    /// For vertices on edges.
    pub(super) edge: Option<EdgeBits>,
    pub(super) end: usize,
}

impl Sections {
    pub(super) const EMPTY: Sections = Sections {
        triangles: 0,
        triangle: 0,
        groups: 0,
        vertices: 0,
        vertex: 0,
        before_z: 0,
        coordinates: [Coordinates::EMPTY; 3],
        edge: None,
        end: 0,
    };

    /// Whether 64 bits have all of a vertex.
    #[inline(always)]
    pub(super) fn one_read(&self) -> bool {
        self.vertex <= u64::BITS
    }
}

impl Header {
    /// The sections behind the nodes.
    #[inline(always)]
    pub(super) fn sections(&self) -> Sections {
        let triangle = 3 * self.index_bits + self.numbers.number_bits();
        let [x, y, z] = &self.axes;
        let triangles = 32 * (HEADER_WORDS + self.node_words as usize);
        let groups = triangles + (self.triangles * triangle) as usize;
        let of_x = groups + self.numbers.groups_bits() as usize;
        let of_y = of_x + x.value_bits() as usize;
        let of_z = of_y + y.value_bits() as usize;
        let vertices = of_z + z.value_bits() as usize;
        let before_z = x.number_bits() + y.number_bits();
        let edge = self.on_edges.then(|| EdgeBits::new(&self.axes));
        let vertex = edge.map_or(before_z + z.number_bits(), EdgeBits::vertex);
        let shift_of_z = if vertex <= u64::BITS { before_z } else { 0 };
        Sections {
            triangles,
            triangle,
            groups,
            vertices,
            vertex,
            before_z,
            coordinates: [
                Coordinates::new(x, of_x, 0),
                Coordinates::new(y, of_y, x.number_bits()),
                Coordinates::new(z, of_z, shift_of_z),
            ],
            edge,
            end: vertices + (self.vertices * vertex) as usize,
        }
    }
}

/// Leaves of the small tree, by their number in the part.
struct LeafNumbers;

impl LeafWriter for LeafNumbers {
    const UNITS: usize = 0;
    const CAPACITY: usize = 1;
    const COUNTS: bool = false;

    fn write(&self, _: &[u32], _: &mut [Unit]) {}

    fn reference(&self, _: usize, prims: &[u32]) -> ChildRef {
        ChildRef::leaf(prims[0] as usize, 1)
    }
}

/// The settings for trees with one leaf of the writer per box.
pub(super) fn one_to_a_leaf() -> BuilderConfig {
    let mut config = BuildQuality::Balanced.config();
    config.sah.leaves = LeafCapacity::One;
    config
}

/// Writes meshlets; keeps its buffers from one to the next.
#[derive(Default)]
pub(super) struct Encoder {
    sorted: Vec<u32>,
    corners: Vec<([u32; 3], u32)>,
    vertex_of_corner: Vec<u32>,
    first_use: Vec<u32>,
    values: Values,
    edges: EdgeCoder,
    numbers: NumberCoder,
}

impl Encoder {
    /// Appends the meshlets of a part, of which each has its box and its first unit, to `out`: one,
    /// unless the part's small tree would have too many nodes.
    pub(super) fn write(
        &mut self,
        part: &Part,
        triangles: &TriWriter<'_>,
        out: &mut Vec<Unit>,
        placed: &mut Vec<(Aabb, usize)>,
    ) {
        let refs = part.leaves.iter().enumerate();
        let refs = refs.map(|(i, leaf)| PrimRef::new(leaf.bounds, i as u32)).collect();
        let tree = build_wide(refs, &LeafNumbers, one_to_a_leaf(), &mut Vec::new(), &UNWATCHED);
        let Ok(tree) = tree else { unreachable!("nobody watches") };
        if tree.units.len() / NODE_UNITS > MAX_NODES {
            // Boxes without surface: the builder has no reason to fill its nodes.
            let (first, second) = part.leaves.split_at(part.leaves.len() / 2);
            for half in [first, second] {
                self.write(&Part::of(half.to_vec()), triangles, out, placed);
            }
            return;
        }
        placed.push((tree.bounds, out.len()));
        let words = self.words(part, &tree, triangles);
        let units = words.len().div_ceil(8);
        let first = out.len();
        out.resize(first + units, Unit::ZERO);
        let room: &mut [u32] = bytemuck::cast_slice_mut(&mut out[first..]);
        room[..words.len()].copy_from_slice(&words);
    }

    fn words(&mut self, part: &Part, tree: &WideBvh, triangles: &TriWriter<'_>) -> Vec<u32> {
        let lattice = Lattice::over(tree.bounds);
        let (nodes, order) = code_nodes(part, tree, &lattice);
        let ids: Vec<u32> =
            order.iter().flat_map(|&leaf| part.leaves[leaf].ids()).copied().collect();

        // ---- Vertices: equal bits are one vertex.
        let corners = ids.iter().flat_map(|&id| triangles.corners(id));
        let corners = corners.map(|p| p.to_array().map(f32::to_bits));
        self.corners.clear();
        self.corners.extend(corners.zip(0..));
        self.vertex_of_corner.resize(self.corners.len(), 0);
        self.corners.sort_unstable();
        // In the order of their first use, so that those of a leaf lie together.
        let same = |a: &([u32; 3], u32), b: &([u32; 3], u32)| a.0 == b.0;
        self.first_use.clear();
        self.first_use.extend(self.corners.chunk_by(same).map(|corners| corners[0].1));
        self.first_use.sort_unstable();
        self.values.iter_mut().for_each(|values| values.resize(self.first_use.len(), 0.0));
        for corners in self.corners.chunk_by(same) {
            let (bits, first) = corners[0];
            let vertex = self.first_use.partition_point(|&corner| corner < first);
            for (values, bits) in self.values.iter_mut().zip(bits) {
                values[vertex] = f32::from_bits(bits);
            }
            for &(_, corner) in corners {
                self.vertex_of_corner[corner as usize] = vertex as u32;
            }
        }
        let vertices = self.values[0].len() as u32;
        let index_bits = bits::width(vertices - 1);

        let numbers = self.numbers.choose(&ids);
        let mut sorted = [const { Vec::new() }; 3];
        let axes: [Axis; 3] = std::array::from_fn(|a| {
            let axis = Axis::choose(&self.values[a], &mut self.sorted);
            sorted[a].clone_from(&self.sorted);
            axis
        });
        let coded = |axis: &Axis| axis.value_bits() + vertices * axis.number_bits();
        // It costs more to read: not for a few bits.
        let most = axes.iter().map(coded).sum::<u32>() / 8 * 7;
        let different = sorted.iter().map(Vec::len).sum();
        let on_edges = self.edges.choose(&self.values, different, most);
        let axes = on_edges.unwrap_or(axes);
        let header = Header {
            on_edges: on_edges.is_some(),
            node_words: nodes.len() as u32,
            triangles: ids.len() as u32,
            vertices,
            nodes: (tree.units.len() / NODE_UNITS) as u32,
            leaves: part.leaves.len() as u32,
            numbers,
            index_bits,
            lattice,
            axes,
        };
        let mut words = header.words().to_vec();
        words.extend(nodes);
        let mut out = Writer::new(&mut words);
        for (corners, id) in self.vertex_of_corner.chunks_exact(3).zip(&ids) {
            corners.iter().for_each(|&vertex| out.push(vertex, index_bits));
            self.numbers.write(&numbers, *id, &mut out);
        }
        self.numbers.write_groups(&numbers, &mut out);
        let once = if header.on_edges { self.edges.planes() } else { &sorted };
        axes.iter().zip(once).for_each(|(axis, once)| axis.write_values(once, &mut out));
        if header.on_edges {
            self.edges.write(&axes, &self.values, &mut out);
        } else {
            for vertex in 0..vertices as usize {
                for ((axis, values), sorted) in axes.iter().zip(&self.values).zip(&sorted) {
                    out.push(axis.number(values[vertex], sorted), axis.number_bits());
                }
            }
        }
        out.finish();
        // Readers take 64 bits at a time, but something follows every meshlet.
        words.pop();
        words
    }
}

/// The nodes of the small tree, breadth first, and its leaves in the order in which they occur.
fn code_nodes(part: &Part, tree: &WideBvh, lattice: &Lattice) -> (Vec<u32>, Vec<usize>) {
    let (mut words, mut leaves) = (Vec::new(), Vec::new());
    let mut queue = VecDeque::from([0]);
    while let Some(at) = queue.pop_front() {
        let node = &tree.units[at..at + NODE_UNITS];
        let (mut kinds, mut rows, mut count) = (u32::MAX, [[0u8; WIDTH]; 6], 0);
        for slot in 0..WIDTH {
            let child = ChildRef(node[CHILD_ROW].bits()[slot]);
            if child == ChildRef::NONE {
                break;
            }
            let kind = if child.is_leaf() {
                leaves.push(child.unit());
                part.leaves[child.unit()].count as u32 - 1
            } else {
                queue.push_back(child.unit());
                NODE
            };
            kinds = kinds & !(NONE << (4 * slot)) | kind << (4 * slot);
            for (axis, planes) in lattice.around(get_box(node, slot)).into_iter().enumerate() {
                for (side, q) in planes.into_iter().enumerate() {
                    rows[2 * axis + side][slot] = q;
                }
            }
            count = slot + 1;
        }
        words.push(kinds);
        let planes: Vec<u8> = rows.iter().flat_map(|row| &row[..count]).copied().collect();
        words.extend(
            planes
                .chunks(4)
                .map(|four| four.iter().rev().fold(0, |word, &q| word << 8 | u32::from(q))),
        );
    }
    (words, leaves)
}
