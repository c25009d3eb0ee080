//! Rays through a compact tree: the ordinary traversals lead to the meshlets, and the search of one
//! is the test of a leaf.

use crate::bvh::compact::{MeshletCache, Nodes, SearchRoom, TrianglePlace, with_cache};
use crate::bvh::layout::wide::{ChildRef, Unit, WIDTH};
use crate::bvh::query::{HitQuery, TriangleTest};
use crate::bvh::traverse::leaf_kind::LeafKind;
use crate::bvh::traverse::single::{BOX_SLACK, LeafTest, RaySetup, traverse, traverse_body};
use crate::bvh::traverse::three;
use crate::bvh::traverse::tree_view::TreeView;
use crate::bvh::traverse::triangle_leaf::{AnyLeaf, ClosestLeaf, ClosestTri};
use crate::ray::Ray;
use crate::simd::prefetch;
use crate::stats::{Counter, count};
use fearless_simd::{Simd, SimdBase, SimdMask, f32x8};
use std::cell::RefCell;

/// The leaf test of a compact tree: the small tree of a meshlet, and the ordinary test `inner` for
/// its leaves.
#[derive(Clone, Copy)]
pub(crate) struct Meshlets<'c, 'r, L> {
    cache: &'c RefCell<MeshletCache>,
    key: u64,
    ray: &'r RaySetup,
    pub(crate) inner: L,
    /// Whether somebody will ask for `place`.
    keeps_place: bool,
    /// The place of the closest triangle, where this search has found it.
    pub(crate) place: Option<TrianglePlace>,
}

impl<S: Simd, L: LeafTest<S>> LeafTest<S> for Meshlets<'_, '_, L> {
    type Query = L::Query;
    const TREES: bool = true;

    #[inline(always)]
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, skip_t: &mut f32) -> bool {
        let mut cache = self.cache.borrow_mut();
        let cache = &mut *cache;
        let before = self.inner.closest();
        let meshlet = (self.key, units, leaf);
        let over = visit(simd, cache, meshlet, self.ray, skip_t, &mut self.inner);
        let after = self.inner.closest();
        if self.keeps_place
            && after != before
            && let Some(id) = after
        {
            let (expanded, _) = cache.last.meshlet(simd, self.key, units, leaf);
            self.place = Some(expanded.leaves.place_of(leaf.unit(), id));
        }
        over
    }
}

/// Leaves that are meshlets of the tree with this key.
#[derive(Clone, Copy)]
pub(crate) struct InMeshlets<'c> {
    pub(crate) cache: &'c RefCell<MeshletCache>,
    pub(crate) key: u64,
    pub(crate) keeps_places: bool,
}

impl<'c, 'r> LeafKind<'r> for InMeshlets<'c> {
    const COMPACT: bool = true;
    type Leaf<S: Simd, L: LeafTest<S> + Copy> = Meshlets<'c, 'r, L>;

    #[inline(always)]
    fn around<S: Simd, L: LeafTest<S> + Copy>(
        self,
        ray: &'r RaySetup,
        inner: L,
    ) -> Meshlets<'c, 'r, L> {
        self.meshlets(ray, inner)
    }

    #[inline(always)]
    fn found<S: Simd, L: LeafTest<S> + Copy>(
        leaf: Meshlets<'c, 'r, L>,
    ) -> (L, Option<TrianglePlace>) {
        (leaf.inner, leaf.place)
    }
}

impl<'c> InMeshlets<'c> {
    /// The meshlets of a tree, for rays of which nobody asks where the closest triangle lies.
    #[inline(always)]
    fn alone(cache: &'c RefCell<MeshletCache>, tree: &TreeView<'_>) -> Self {
        InMeshlets { cache, key: tree.meshlets(), keeps_places: false }
    }

    /// The leaf test of a ray.
    #[inline(always)]
    pub(crate) fn meshlets<'r, L>(self, ray: &'r RaySetup, inner: L) -> Meshlets<'c, 'r, L> {
        let InMeshlets { cache, key, keeps_places: keeps_place } = self;
        Meshlets { cache, key, ray, inner, keeps_place, place: None }
    }
}

/// A ray through the small tree of a meshlet: a leaf of the tree with this key. As [`traverse`],
/// whose results must not differ.
#[inline(always)]
fn visit<S: Simd, L: LeafTest<S>>(
    simd: S,
    cache: &mut MeshletCache,
    (key, units, meshlet): (u64, &[Unit], ChildRef),
    ray: &RaySetup,
    skip_t: &mut f32,
    inner: &mut L,
) -> bool {
    let words = bytemuck::cast_slice(&units[meshlet.unit()..]);
    let MeshletCache { last, search: SearchRoom { starts, stack } } = cache;
    let mut nodes = Nodes::new(words, starts);
    let (first_plane, step) = nodes.lattice();
    let origin: [f32x8<S>; 3] = three!(|a| f32x8::splat(simd, ray.origin[a]));
    let rcp: [f32x8<S>; 3] = three!(|a| f32x8::splat(simd, ray.rcp[a]));
    let t_min = f32x8::splat(simd, ray.t_min);
    let slack = f32x8::splat(simd, BOX_SLACK);
    let (mut len, mut at) = (0, 0);
    loop {
        count(Counter::Nodes, 1);
        let node = nodes.node(at);
        let [x, y, z]: [f32x8<S>; 3] = three!(|a| {
            (node.planes(simd, ray.near[a], first_plane[a], step[a]) - origin[a]) * rcp[a]
        });
        let near = x.max(y).max(z.max(t_min));
        let [x, y, z]: [f32x8<S>; 3] = three!(|a| {
            (node.planes(simd, ray.near[a] ^ 1, first_plane[a], step[a]) - origin[a]) * rcp[a]
        });
        let far = x.min(y).min(z) * slack;
        let hit = near.simd_le(far.min(f32x8::splat(simd, *skip_t))).to_bitmask() as u32;
        let hit = hit & node.slots();
        if at == 0 && hit != 0 {
            // Traversals request the first four lines. Leaves are read after the nodes: requested
            // when a ray needs one, they come too late.
            prefetch::<8, _>(units, meshlet.unit() + 8);
        }
        let now = hit & node.leaf_slots();
        if now != 0 {
            count(Counter::Leaves, now.count_ones() as u64);
            let (expanded, _) = last.meshlet(simd, key, units, meshlet);
            // Two at a time, as the test has them: the next may not be needed.
            let mut rest = now;
            while rest != 0 {
                let (mut refs, mut two) = ([0; WIDTH], 0);
                for _ in 0..2 {
                    let slot = rest.trailing_zeros() as usize & 7;
                    let (number, first, last) = node.leaf_in(slot);
                    let leaves = &mut expanded.leaves;
                    refs[slot] = if L::NUMBERS {
                        leaves.leaf::<S, true>(simd, words, number, first, last).0
                    } else {
                        leaves.leaf::<S, false>(simd, words, number, first, last).0
                    };
                    two |= 1 << slot;
                    rest &= rest - 1;
                    if rest == 0 {
                        break;
                    }
                }
                if inner.test_many(simd, expanded.leaves.units(), &refs, two, skip_t) {
                    return true;
                }
            }
        }
        let mut rest = hit & !now;
        if rest != 0 {
            let near: [f32; WIDTH] = near.to_array();
            let base = len;
            while rest != 0 {
                let slot = rest.trailing_zeros() as usize & 7;
                rest &= rest - 1;
                let entry = u64::from(near[slot].to_bits()) << 32 | node.node_in(slot) as u64;
                // Farthest first, so that the nearest is on top.
                let mut place = len & 15;
                while !<L::Query as HitQuery>::ANY
                    && place > base
                    && stack[(place - 1) & 15] < entry
                {
                    stack[place & 15] = stack[(place - 1) & 15];
                    place -= 1;
                }
                stack[place & 15] = entry;
                len += 1;
            }
        }
        loop {
            if len == 0 {
                return false;
            }
            len -= 1;
            let entry = stack[len & 15];
            if f32::from_bits((entry >> 32) as u32) <= *skip_t {
                at = entry as u32 as usize;
                break;
            }
        }
    }
}

/// A search of `tree`, which is compact, by one ray with the ordinary leaf test.
pub(crate) fn search<S: Simd, L: LeafTest<S>>(
    simd: S,
    tree: &TreeView<'_>,
    ray: &RaySetup,
    t_max: f32,
    inner: L,
) -> L {
    with_cache(|cache| {
        let mut leaves = InMeshlets::alone(cache, tree).meshlets(ray, inner);
        traverse(simd, tree, ray, t_max, &mut leaves);
        leaves.inner
    })
}

/// The closest hit of a local-space ray.
#[inline(never)]
pub(crate) fn closest<S: Simd, T: TriangleTest>(
    simd: S,
    tree: &TreeView<'_>,
    ray: &Ray,
) -> ClosestTri {
    with_cache(|cache| {
        simd.vectorize(
            #[inline(always)]
            || {
                let setup = RaySetup::new(ray);
                let inner = ClosestLeaf::<T>::new(&setup, ray.t_max);
                let mut leaves = InMeshlets::alone(cache, tree).meshlets(&setup, inner);
                traverse_body(simd, tree, &setup, ray.t_max, &mut leaves);
                leaves.inner.best
            },
        )
    })
}

/// Whether anything blocks a local-space ray.
#[inline(never)]
pub(crate) fn occluded<S: Simd, T: TriangleTest>(simd: S, tree: &TreeView<'_>, ray: &Ray) -> bool {
    with_cache(|cache| {
        simd.vectorize(
            #[inline(always)]
            || {
                let setup = RaySetup::new(ray);
                let inner = AnyLeaf::<T>::new(&setup, ray.t_max);
                let mut leaves = InMeshlets::alone(cache, tree).meshlets(&setup, inner);
                traverse_body(simd, tree, &setup, ray.t_max, &mut leaves);
                leaves.inner.found
            },
        )
    })
}
