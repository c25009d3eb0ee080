//! Where a triangle of a compact tree lies, so that it is found again without a search.

/// The first unit of a meshlet, a leaf of it, and a slot of the leaf; or none of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TrianglePlace(u32);

/// Bits of the number of a leaf in its meshlet, and of a slot in its leaf.
const LEAF_BITS: u32 = 5;
const SLOT_BITS: u32 = 2;

impl TrianglePlace {
    /// Not known.
    pub(crate) const NONE: TrianglePlace = TrianglePlace(u32::MAX);

    /// The place in slot 0 of leaf `leaf` of the meshlet at `unit`; none in trees with more units
    /// than places can name.
    #[inline(always)]
    pub(crate) fn of_leaf(unit: usize, leaf: usize) -> TrianglePlace {
        if unit >= (1 << (u32::BITS - LEAF_BITS - SLOT_BITS)) - 1 {
            return TrianglePlace::NONE;
        }
        TrianglePlace((unit as u32) << (LEAF_BITS + SLOT_BITS) | (leaf as u32) << SLOT_BITS)
    }

    /// The place in another slot of the leaf, for a place in slot 0.
    #[inline(always)]
    pub(crate) fn in_slot(self, slot: usize) -> TrianglePlace {
        TrianglePlace(self.0 | slot as u32)
    }

    /// The first unit of the meshlet, the leaf, and the slot. `None` when it is not known.
    #[inline(always)]
    pub(crate) fn parts(self) -> Option<(usize, usize, usize)> {
        if self == TrianglePlace::NONE {
            return None;
        }
        let leaf = self.0 >> SLOT_BITS & ((1 << LEAF_BITS) - 1);
        let slot = self.0 & ((1 << SLOT_BITS) - 1);
        Some(((self.0 >> (LEAF_BITS + SLOT_BITS)) as usize, leaf as usize, slot as usize))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_keep_their_parts_and_too_large_ones_are_none() {
        for parts in [(0, 0, 0), (5, 23, 3), ((1 << 25) - 2, 31, 1)] {
            let place = TrianglePlace::of_leaf(parts.0, parts.1).in_slot(parts.2);
            assert_eq!(place.parts(), Some(parts));
        }
        let none = TrianglePlace::of_leaf((1 << 25) - 1, 3);
        assert_eq!((none.parts(), none.in_slot(2).parts()), (None, None));
    }
}
