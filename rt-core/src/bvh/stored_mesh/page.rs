//! A page of a stored mesh: a compact tree of a few thousand triangles.

use super::format::PageEntry;
use crate::bvh::compact::{CompactBvh, TrianglePlace, check_units, new_key, with_cache};
use crate::bvh::layout::triangles::{leaf_floats, leaf_triangle_ids};
use crate::bvh::layout::wide::{ChildRef, LEAF_SIZE, Unit, WIDTH, WideBvh};
use crate::bvh::query::{ClosestHit, WatertightTest};
use crate::bvh::traverse::block_hits::set_bits;
use crate::bvh::traverse::meshlets;
use crate::bvh::traverse::single::{LeafTest, RaySetup};
use crate::bvh::traverse::tree_view::TreeView;
use crate::bvh::traverse::triangle_leaf::{ClosestLeaf, ClosestTri};
use crate::bvh::triangle_bvh;
use crate::ray::{LANES, Ray};
use fearless_simd::{Level, Simd, dispatch};
use glam::Vec3;

/// A page in memory.
pub(super) struct Page {
    tree: CompactBvh,
    /// Number of the triangle with the number 0 in the page.
    first: u64,
}

/// A triangle that a ray hits.
pub(super) struct PageHit {
    first: u64,
    /// Number in the page.
    pub(super) id: u32,
    pub(super) corners: [Vec3; 3],
}

impl PageHit {
    pub(super) const NONE: PageHit = PageHit { first: 0, id: 0, corners: [Vec3::ZERO; 3] };

    /// Number of the triangle in the mesh.
    pub(super) fn triangle(&self) -> u64 {
        self.first + u64::from(self.id)
    }
}

impl Page {
    /// The page with these units, which its checksum covers. The error says what is wrong with
    /// them.
    pub(super) fn of_units(units: Vec<Unit>, entry: &PageEntry) -> Result<Page, &'static str> {
        let depth = check_units(&units)?;
        let bvh = WideBvh { units, bounds: entry.bounds, depth };
        let tree = CompactBvh { bvh, skipped: 0, notes: Vec::new(), key: new_key() };
        Ok(Page { tree, first: entry.first })
    }

    /// The tree of its triangles.
    pub(super) fn view(&self) -> TreeView<'_> {
        TreeView::of_meshlets(&self.tree)
    }

    /// Bytes in memory.
    pub(super) fn bytes(&self) -> usize {
        self.tree.bvh.units.len() * size_of::<Unit>() + size_of::<Page>()
    }

    pub(super) fn closest(&self, level: Level, ray: &Ray) -> Option<ClosestTri> {
        let view = self.view();
        let hit = dispatch!(
            level,
            simd => triangle_bvh::closest::<_, WatertightTest>(simd, &view, ray)
        );
        hit.found.then_some(hit)
    }

    pub(super) fn occluded(&self, level: Level, ray: &Ray) -> bool {
        let view = self.view();
        dispatch!(
            level,
            simd => triangle_bvh::occluded::<_, WatertightTest>(simd, &view, ray)
        )
    }

    /// The triangle that [`Page::closest`] finds.
    pub(super) fn triangle(&self, level: Level, ray: &Ray) -> Option<PageHit> {
        let (view, setup) = (self.view(), RaySetup::new(ray));
        let inner = ClosestLeaf::<WatertightTest>::new(&setup, ray.t_max);
        let leaf = WithCorners { inner, corners: [Vec3::ZERO; 3] };
        let leaf = dispatch!(level, simd => meshlets::search(simd, &view, &setup, ray.t_max, leaf));
        let best = leaf.inner.best;
        best.found.then_some(PageHit { first: self.first, id: best.prim, corners: leaf.corners })
    }
}

impl Page {
    /// The triangles at those places of `lanes` that are known.
    pub(super) fn triangles_at(
        &self,
        level: Level,
        lanes: u16,
        places: &[TrianglePlace; LANES],
        mut found: impl FnMut(usize, PageHit),
    ) {
        let (units, key) = (&self.tree.bvh.units, self.tree.key);
        with_cache(|cache| {
            let mut cache = cache.borrow_mut();
            dispatch!(level, simd => for lane in set_bits(lanes) {
                let Some((unit, leaf, slot)) = places[lane].parts() else { continue };
                if unit >= units.len() {
                    continue;
                }
                let meshlet = ChildRef::leaf(unit, 1);
                let (expanded, words) = cache.last.meshlet(simd, key, units, meshlet);
                if let Some((id, corners)) = expanded.triangle(simd, words, leaf, slot) {
                    found(lane, PageHit { first: self.first, id, corners });
                }
            });
        });
    }
}

/// The test for the closest hit, which keeps the corners of the triangle that is hit.
struct WithCorners<'r> {
    inner: ClosestLeaf<'r, WatertightTest>,
    corners: [Vec3; 3],
}

impl<S: Simd> LeafTest<S> for WithCorners<'_> {
    type Query = ClosestHit;
    const TOGETHER: bool = <ClosestLeaf<'_, WatertightTest> as LeafTest<S>>::TOGETHER;

    #[inline(always)]
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, skip_t: &mut f32) -> bool {
        let before = self.inner.best;
        let over = self.inner.test(simd, units, leaf, skip_t);
        self.keep(before, units, [leaf].into_iter());
        over
    }

    #[inline(always)]
    fn test_many(
        &mut self,
        simd: S,
        units: &[Unit],
        refs: &[u32; WIDTH],
        leaves: u32,
        skip_t: &mut f32,
    ) -> bool {
        let before = self.inner.best;
        let over = self.inner.test_many(simd, units, refs, leaves, skip_t);
        let slots = (0..WIDTH).filter(|slot| leaves >> slot & 1 == 1);
        self.keep(before, units, slots.map(|slot| ChildRef(refs[slot])));
        over
    }
}

impl WithCorners<'_> {
    /// Keeps the corners of the best triangle, where a test of `leaves` has changed it.
    #[inline(never)]
    fn keep(&mut self, before: ClosestTri, units: &[Unit], leaves: impl Iterator<Item = ChildRef>) {
        let best = self.inner.best;
        if !best.found || (before.found && before.prim == best.prim) {
            return;
        }
        for leaf in leaves {
            let floats = leaf_floats(units, leaf);
            let ids = leaf_triangle_ids(floats);
            if let Some(slot) = (0..LEAF_SIZE).find(|&slot| ids[slot] == best.prim) {
                let at = |corner: usize, axis: usize| floats[4 * (3 * corner + axis) + slot];
                self.corners =
                    [0, 1, 2].map(|corner| Vec3::from_array([0, 1, 2].map(|a| at(corner, a))));
                return;
            }
        }
    }
}
