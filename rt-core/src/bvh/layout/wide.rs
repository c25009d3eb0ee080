//! The memory layout of an 8-wide bounding volume hierarchy.
//!
//! Nodes and leaves are stored in one array of 32-byte units. A node has 7 units: six rows of eight
//! floats with the planes of its eight children's boxes (x low, x high, y low, y high, z low, z
//! high), and a row of child references. A leaf follows close to its parent, so both are often on
//! the same page. The unit is 32 bytes, not a 64-byte cache line, because a triangle leaf is 160
//! bytes: it touches three cache lines wherever it starts, and 16 M triangles take 55 bytes each
//! instead of 66.

use crate::math::Aabb;
use glam::Vec3;

/// Number of children of a node.
pub(crate) const WIDTH: usize = 8;
/// Largest number of primitives in a leaf.
pub(crate) const LEAF_SIZE: usize = 4;
/// Number of units of a node.
pub(crate) const NODE_UNITS: usize = 7;
/// The row of child references.
pub(crate) const CHILD_ROW: usize = 6;

/// Depth of the deepest tree that the traversal stack can hold: each node on the path leaves at
/// most seven siblings on it.
pub(crate) const MAX_DEPTH: usize = (STACK_SIZE - WIDTH) / (WIDTH - 1);
/// Number of entries of a traversal stack.
pub(crate) const STACK_SIZE: usize = 640;

/// 32 bytes: eight floats, or the bits of eight child references.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(32))]
pub(crate) struct Unit(pub(crate) [f32; 8]);

impl Unit {
    pub(crate) const ZERO: Unit = Unit([0.0; 8]);

    /// The unit as integers.
    #[inline(always)]
    pub(crate) fn bits(&self) -> &[u32; 8] {
        bytemuck::cast_ref(&self.0)
    }

    /// The unit as mutable integers.
    #[inline(always)]
    pub(crate) fn bits_mut(&mut self) -> &mut [u32; 8] {
        bytemuck::cast_mut(&mut self.0)
    }
}

/// Reference to a child: a node, or a leaf with its number of primitives.
///
/// Bit 31: leaf. Bits 30..29: primitives − 1. Bits 28..0: index of the first unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ChildRef(pub(crate) u32);

impl ChildRef {
    const LEAF: u32 = 1 << 31;
    const OFFSET: u32 = (1 << 29) - 1;
    /// Largest number of units in an arena: 16 GiB.
    pub(crate) const MAX_UNITS: usize = Self::OFFSET as usize;
    /// No child. Its box is empty, so it is never visited.
    pub(crate) const NONE: ChildRef = ChildRef(u32::MAX);

    pub(crate) fn node(unit: usize) -> Self {
        debug_assert!(unit < Self::MAX_UNITS, "unit {unit} does not fit a child reference");
        ChildRef(unit as u32)
    }

    pub(crate) fn leaf(unit: usize, count: usize) -> Self {
        debug_assert!(
            unit < Self::MAX_UNITS && (1..=LEAF_SIZE).contains(&count),
            "leaf {unit} of {count}"
        );
        ChildRef(Self::LEAF | ((count as u32 - 1) << 29) | unit as u32)
    }

    /// The reference to the same node or leaf `units` further on; sums wrap around.
    #[inline]
    pub(crate) fn moved(self, units: usize) -> Self {
        let unit = self.unit().wrapping_add(units);
        debug_assert!(unit < Self::MAX_UNITS, "unit {unit} does not fit a child reference");
        ChildRef(self.0 & !Self::OFFSET | unit as u32)
    }

    #[inline(always)]
    pub(crate) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    #[inline(always)]
    pub(crate) fn unit(self) -> usize {
        (self.0 & Self::OFFSET) as usize
    }

    /// Number of primitives in a leaf.
    #[inline(always)]
    pub(crate) fn count(self) -> usize {
        ((self.0 >> 29) & 3) as usize + 1
    }
}

/// An 8-wide hierarchy. The root node is at unit 0.
#[derive(Debug, Clone, Default)]
pub(crate) struct WideBvh {
    pub(crate) units: Vec<Unit>,
    /// Bounds of all primitives. Empty if there are none.
    pub(crate) bounds: Aabb,
    /// Largest number of nodes on a path from the root to a leaf.
    pub(crate) depth: usize,
}

impl Default for Aabb {
    fn default() -> Self {
        Aabb::EMPTY
    }
}

/// Writes a node with at most eight `children` into the seven units of `out`.
pub(crate) fn write_node(out: &mut [Unit], children: &[(Aabb, ChildRef)]) {
    for row in 0..3 {
        out[2 * row].0 = [f32::INFINITY; WIDTH];
        out[2 * row + 1].0 = [f32::NEG_INFINITY; WIDTH];
    }
    *out[CHILD_ROW].bits_mut() = [ChildRef::NONE.0; WIDTH];
    for (slot, (b, child)) in children.iter().enumerate() {
        set_box(out, slot, *b);
        out[CHILD_ROW].bits_mut()[slot] = child.0;
    }
}

/// Replaces the box of child `slot`.
pub(crate) fn set_box(node: &mut [Unit], slot: usize, b: Aabb) {
    for axis in 0..3 {
        node[2 * axis].0[slot] = b.min[axis];
        node[2 * axis + 1].0[slot] = b.max[axis];
    }
}

/// Writes the ids of a leaf whose primitives are stored elsewhere (shapes, instances): one unit.
pub(crate) fn write_id_leaf(out: &mut [Unit], ids: impl Iterator<Item = u32>) {
    let row = out[0].bits_mut();
    *row = [u32::MAX; 8];
    for (slot, id) in row.iter_mut().zip(ids) {
        *slot = id;
    }
}

/// The box of child `slot`.
pub(crate) fn get_box(node: &[Unit], slot: usize) -> Aabb {
    let lo = Vec3::from_array(std::array::from_fn(|a| node[2 * a].0[slot]));
    let hi = Vec3::from_array(std::array::from_fn(|a| node[2 * a + 1].0[slot]));
    Aabb::new(lo, hi)
}

/// Writes primitives into leaves.
pub(crate) trait LeafWriter: Sync {
    /// Number of units of a leaf.
    const UNITS: usize;
    /// Largest number of primitives of a leaf.
    const CAPACITY: usize = LEAF_SIZE;
    /// Whether these are primitives or instances of the world, which the progress of a build
    /// counts, or parts of its trees.
    const COUNTS: bool = true;
    /// Writes up to four primitives into a leaf's units.
    fn write(&self, prims: &[u32], out: &mut [Unit]);
    /// The reference that the leaf's parent holds. The leaf starts at `unit`.
    fn reference(&self, unit: usize, prims: &[u32]) -> ChildRef {
        ChildRef::leaf(unit, prims.len())
    }
}
