//! Leaves that hold the numbers of primitives which are stored elsewhere.

use super::wide::{ChildRef, LeafWriter, Unit, write_id_leaf};

/// Writes at most `MOST` numbers into a leaf.
pub(crate) struct IdWriter<const MOST: usize>;

impl<const MOST: usize> LeafWriter for IdWriter<MOST> {
    const UNITS: usize = 1;
    const CAPACITY: usize = MOST;

    fn write(&self, prims: &[u32], out: &mut [Unit]) {
        write_id_leaf(out, prims.iter().copied());
    }
}

/// The numbers in an id leaf.
#[inline(always)]
pub(crate) fn leaf_primitive_ids(units: &[Unit], leaf: ChildRef) -> &[u32] {
    &units[leaf.unit()].bits()[..leaf.count()]
}
