//! What the leaves of a tree are: a few triangles, or meshlets with many.

use super::single::{LeafTest, RaySetup};
use crate::bvh::compact::TrianglePlace;
use fearless_simd::Simd;

/// A kind of leaf, which turns the test of triangles into one of leaves.
pub(crate) trait LeafKind<'r>: Copy {
    /// Whether leaves are meshlets.
    const COMPACT: bool;

    /// The test of a leaf.
    type Leaf<S: Simd, L: LeafTest<S> + Copy>: LeafTest<S, Query = L::Query> + Copy;

    /// The test of leaves by that of triangles, for a ray.
    fn around<S: Simd, L: LeafTest<S> + Copy>(
        self,
        ray: &'r RaySetup,
        inner: L,
    ) -> Self::Leaf<S, L>;

    /// The test of triangles after the search, and the place of the closest one where that is kept.
    fn found<S: Simd, L: LeafTest<S> + Copy>(leaf: Self::Leaf<S, L>) -> (L, Option<TrianglePlace>);
}

/// Leaves of a few triangles.
#[derive(Clone, Copy)]
pub(crate) struct OfTriangles;

impl<'r> LeafKind<'r> for OfTriangles {
    const COMPACT: bool = false;
    type Leaf<S: Simd, L: LeafTest<S> + Copy> = L;

    #[inline(always)]
    fn around<S: Simd, L: LeafTest<S> + Copy>(self, _: &'r RaySetup, inner: L) -> L {
        inner
    }

    #[inline(always)]
    fn found<S: Simd, L: LeafTest<S> + Copy>(leaf: L) -> (L, Option<TrianglePlace>) {
        (leaf, None)
    }
}
