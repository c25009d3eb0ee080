//! A tree of triangles in a quarter of the memory, with the hits of the ordinary tree bit for bit.
//!
//! The leaves of an 8-wide hierarchy are **meshlets** here: up to 64 neighbouring triangles, with
//! their vertices once, vertex numbers of a few bits, the numbers of the triangles in the mesh, and
//! a small tree whose boxes have 8 bits per plane. (Benthin, Wald, Woop and Áfra, "Compressed-Leaf
//! Bounding Volume Hierarchies", HPG 2018, also compress the lowest levels alone.) Everything of a
//! meshlet lies in the array of the tree's nodes, so a compact tree is a [`WideBvh`].
//!
//! Nothing is lost. Coordinates are the bits of the ordinary tree's, coded without loss
//! ([`coordinates`]), and boxes are rounded outwards. Box tests never decide an answer, so larger
//! boxes change the work alone.
//!
//! A ray tests the boxes of a meshlet's [nodes] as they are stored. Of the triangles, the calling
//! thread [expands][cache] each leaf that a ray reaches to the layout of the ordinary tree, and
//! keeps those of the last few meshlets. So every kind of query uses its ordinary leaf test.
//!
//! A sheet without any lattice takes 13.4 bytes per triangle (the test `compact_memory`), an
//! isosurface by tetrahedra 13.1 (the example `storage`).

pub(crate) mod bits;
mod boxes;
mod build;
mod cache;
mod check;
mod coordinates;
mod cut;
mod edges;
mod expand;
mod expand_leaf;
mod meshlet;
mod nodes;
mod pieces;
mod place;
mod triangle_numbers;

use super::layout::wide::WideBvh;
pub(crate) use cache::{MeshletCache, SearchRoom, new_key, with_cache};
pub(crate) use check::check_units;
pub(crate) use expand_leaf::ExpandedLeaves;
pub(crate) use nodes::Nodes;
pub(crate) use pieces::{BYTES_WHILE_DIVIDED, Pieces, divide};
pub(crate) use place::TrianglePlace;

/// A tree whose leaves are meshlets.
#[derive(Clone)]
pub(crate) struct CompactBvh {
    pub(crate) bvh: WideBvh,
    pub(crate) skipped: usize,
    pub(crate) notes: Vec<String>,
    /// Different for any two trees of a process: what threads have expanded is found by it.
    pub(crate) key: u64,
}
