//! Traversal by one ray at a time: eight boxes per step, nearest child first.

use super::child_order::push_by_distance;
use super::three;
use super::tree_view::TreeView;
use crate::bvh::Unit;
use crate::bvh::intersect::watertight::Shear;
use crate::bvh::layout::wide::{CHILD_ROW, ChildRef, NODE_UNITS, STACK_SIZE, WIDTH};
use crate::bvh::query::HitQuery;
use crate::ray::Ray;
use crate::simd::{Stack, StackMemory, prefetch};
use crate::stats::{Counter, count};
use fearless_simd::{Simd, SimdBase, SimdMask, f32x8, mask32x8, u32x8};

/// Relative widening of a box's far distance, 16 u with u = 2⁻²⁴. With it, the box test never
/// rejects a box whose triangle the triangle test hits.
///
/// Ize ("Robust BVH Ray Traversal", JCGT 2013) derives 6 u for the slab test by itself. The
/// triangle test shears with a slope that has rounding errors of its own: they turn the ray against
/// the slabs by 3 u at either end. The multiplication by this factor rounds once more. Errors of
/// the triangle test that are proportional to the size of the triangle, not to the distance, are
/// covered by the boxes: see [`crate::bvh::layout::triangles::widened`]. So box tests never decide
/// an answer: single rays, packets and every tree give the same one.
pub(crate) const BOX_SLACK: f32 = 1.0 + 8.0 * f32::EPSILON;

/// A distance slightly larger than `t`, from which boxes are skipped. A triangle's `t` and its
/// box's distance round differently, and of two surfaces at the same distance both must be tested
/// so that the lower number wins.
#[inline(always)]
pub(crate) fn inflate_t(t: f32) -> f32 {
    t * (1.0 + 32.0 * f32::EPSILON)
}

/// Smallest magnitude of a direction component in a reciprocal, 2⁻¹²⁴. It keeps the reciprocal
/// finite, so 0·∞ cannot occur in the slab test. It must not be larger: in the local space of a
/// mesh of size 10²⁵, directions are about 10⁻²⁵.
pub(crate) const MIN_COMPONENT: f32 = 4.0 * f32::MIN_POSITIVE;

/// Constants of a ray that every step needs, computed once.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RaySetup {
    pub(crate) origin: [f32; 3],
    pub(crate) rcp: [f32; 3],
    /// Per axis, the row of the plane that the ray reaches first. The other plane is that row with
    /// the lowest bit flipped.
    pub(crate) near: [usize; 3],
    pub(crate) shear: Shear,
    pub(crate) t_min: f32,
}

/// 1/d with tiny components replaced, keeping the sign of zero.
#[inline(always)]
pub(crate) fn safe_reciprocal(d: f32) -> f32 {
    1.0 / d.abs().max(MIN_COMPONENT).copysign(d)
}

impl RaySetup {
    pub(crate) const ZERO: RaySetup = RaySetup {
        origin: [0.0; 3],
        rcp: [0.0; 3],
        near: [0; 3],
        shear: Shear { kx: 0, ky: 0, kz: 0, sx: 0.0, sy: 0.0, sz: 0.0 },
        t_min: 0.0,
    };

    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Self {
        let d = ray.dir.to_array();
        let rcp = d.map(safe_reciprocal);
        // Near planes follow the sign of the reciprocal, so -0.0 and +0.0 agree with it.
        let near = std::array::from_fn(|a| 2 * a + (rcp[a] < 0.0) as usize);
        RaySetup {
            origin: ray.origin.to_array(),
            rcp,
            near,
            shear: Shear::new(d),
            t_min: ray.t_min,
        }
    }
}

/// The primitive test at a leaf.
pub(crate) trait LeafTest<S: Simd> {
    /// What is asked about the ray. Closest-hit queries visit the nearest child first; any-hit
    /// queries do not need an order.
    type Query: HitQuery;

    /// Tests the primitives of `leaf`. Lowers `skip_t`, the distance from which boxes are skipped,
    /// to [`inflate_t`] of the closest hit so far. Returns true when the search is over.
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, skip_t: &mut f32) -> bool;

    /// The number of the closest primitive so far, in tests that keep one.
    #[inline(always)]
    fn closest(&self) -> Option<u32> {
        None
    }

    /// Whether the leaves among a node's children are tested together, as soon as the ray has
    /// entered their boxes.
    const TOGETHER: bool = false;

    /// Whether the numbers of triangles matter, beside their corners.
    const NUMBERS: bool = true;

    /// Whether leaves are trees of their own, so that a far one is better left until nearer ones
    /// have been searched.
    const TREES: bool = false;

    /// Tests the primitives of the leaves in `leaves`, a set of slots in a row of references.
    #[inline(always)]
    fn test_many(
        &mut self,
        simd: S,
        units: &[Unit],
        refs: &[u32; WIDTH],
        mut leaves: u32,
        skip_t: &mut f32,
    ) -> bool {
        while leaves != 0 {
            let leaf = ChildRef(refs[leaves.trailing_zeros() as usize & 7]);
            leaves &= leaves - 1;
            if self.test(simd, units, leaf, skip_t) {
                return true;
            }
        }
        false
    }
}

/// The slots of a row of references that hold leaves, or nothing.
#[inline(always)]
pub(crate) fn leaf_slots<S: Simd>(simd: S, refs: &[u32; WIDTH]) -> u32 {
    u32x8::from_slice(simd, refs).simd_ge(u32x8::splat(simd, 1 << 31)).to_bitmask() as u32
}

/// Visits the leaves whose boxes the ray enters before `t_max`. Boxes are widened for rounding
/// errors in every mode, because that costs nothing.
///
/// Never inlined: one body per instruction set and kind of leaf. Inlining it into its callers
/// multiplied the compile time by thirty.
#[inline(never)]
pub(crate) fn traverse<S: Simd, L: LeafTest<S>>(
    simd: S,
    tree: &TreeView<'_>,
    ray: &RaySetup,
    t_max: f32,
    leaves: &mut L,
) {
    simd.vectorize(
        #[inline(always)]
        || traverse_body(simd, tree, ray, t_max, leaves),
    );
}

/// [`traverse`] without a function of its own, for callers already compiled for the instruction
/// set.
#[inline(always)]
pub(crate) fn traverse_body<S: Simd, L: LeafTest<S>>(
    simd: S,
    tree: &TreeView<'_>,
    ray: &RaySetup,
    t_max: f32,
    leaves: &mut L,
) {
    traverse_from(simd, tree, ray, t_max, ChildRef::node(0), leaves);
}

/// Traverses the subtree at `start`.
#[inline(always)]
pub(crate) fn traverse_from<S: Simd, L: LeafTest<S>>(
    simd: S,
    tree: &TreeView<'_>,
    ray: &RaySetup,
    t_max: f32,
    start: ChildRef,
    leaves: &mut L,
) {
    let units = tree.units;
    let mut skip_t = inflate_t(t_max);
    let origin: [f32x8<S>; 3] = three!(|a| f32x8::splat(simd, ray.origin[a]));
    let rcp: [f32x8<S>; 3] = three!(|a| f32x8::splat(simd, ray.rcp[a]));
    let t_min = f32x8::splat(simd, ray.t_min);
    // The slack is part of the far planes' reciprocals, so it costs nothing in the loop. Far
    // distances below zero never matter, because t_min is not negative.
    let slack = f32x8::splat(simd, BOX_SLACK);
    let rcp_far: [f32x8<S>; 3] = three!(|a| rcp[a] * slack);
    // The distance is in the high half, so integer order is the order of distances. t_min >= 0
    // keeps the distance non-negative.
    let mut memory = StackMemory::<u64, STACK_SIZE>::new();
    let mut stack = Stack::empty(&mut memory);
    let mut current = start;
    loop {
        if current.is_leaf() {
            count(Counter::Leaves, 1);
            if leaves.test(simd, units, current, &mut skip_t) {
                return;
            }
        } else {
            count(Counter::Nodes, 1);
            let at = current.unit();
            let node: &[Unit; NODE_UNITS] =
                units[at..at + NODE_UNITS].try_into().expect("a slice of that length");
            let [x, y, z]: [f32x8<S>; 3] =
                three!(|a| distances(simd, node, ray.near[a], origin[a], rcp[a]));
            let near = x.max(y).max(z.max(t_min));
            let [x, y, z]: [f32x8<S>; 3] =
                three!(|a| distances(simd, node, ray.near[a] ^ 1, origin[a], rcp_far[a]));
            let far = x.min(y).min(z);
            let hit = near.simd_le(far.min(f32x8::splat(simd, skip_t)));
            let hit = tree.visible(at, hit.to_bitmask() as u32);
            let refs = node[CHILD_ROW].bits();
            let now = if L::TOGETHER { hit & leaf_slots(simd, refs) } else { 0 };
            let next =
                push_children::<S, L::Query, true>(simd, units, node, near, hit & !now, &mut stack);
            if now != 0 {
                count(Counter::Leaves, now.count_ones() as u64);
                if leaves.test_many(simd, units, refs, now, &mut skip_t) {
                    return;
                }
            }
            if let Some(child) = next {
                current = child;
                continue;
            }
        }
        // ---- The next entry that is still nearer than the closest hit.
        loop {
            let Some(e) = stack.pop() else { return };
            if f32::from_bits((e >> 32) as u32) <= skip_t {
                current = ChildRef(e as u32);
                break;
            }
        }
    }
}

/// Distances of a ray to the planes in row `row` of a node, given its origin and the reciprocal of
/// its direction along the planes' axis.
#[inline(always)]
pub(super) fn distances<S: Simd>(
    simd: S,
    node: &[Unit; NODE_UNITS],
    row: usize,
    origin: f32x8<S>,
    rcp: f32x8<S>,
) -> f32x8<S> {
    (f32x8::from_slice(simd, &node[row & 7].0) - origin) * rcp
}

/// Selects the next child of a node, given the boxes in `mask` that the ray hits at the distances
/// `near`. Returns the nearest child for closest-hit queries, any child for any-hit queries, and
/// pushes the others on the stack. `None` means that the next entry is on the stack. With
/// `PREFETCH`, the children are requested from memory; without, the caller does it.
#[inline(always)]
pub(super) fn push_children<S: Simd, Q: HitQuery, const PREFETCH: bool>(
    simd: S,
    units: &[Unit],
    node: &[Unit; NODE_UNITS],
    near: f32x8<S>,
    mut mask: u32,
    stack: &mut Stack<'_, u64, STACK_SIZE>,
) -> Option<ChildRef> {
    let refs = node[CHILD_ROW].bits();
    if Q::ANY && !PREFETCH {
        // The children that are hit, without gaps.
        let hit = mask32x8::from_bitmask(simd, u64::from(mask));
        let children = u32x8::from_slice(simd, refs).compress(hit).to_array();
        stack.push_first(children.map(u64::from), mask.count_ones() as usize);
        return None;
    }
    // Narrower vectors need more steps than the branches cost.
    if !PREFETCH && <S::f32s as SimdBase<S>>::LEN >= WIDTH {
        push_by_distance(simd, refs, near, mask, stack);
        return None;
    }
    if mask == 0 {
        return None;
    }
    let first = mask.trailing_zeros() as usize;
    mask &= mask - 1;
    if mask == 0 {
        let child = ChildRef(refs[first & 7]);
        if PREFETCH {
            prefetch::<4, _>(units, child.unit());
        }
        return Some(child);
    }
    let near: [f32; 8] = near.to_array();
    let entry = |i: usize| {
        let child = refs[i & 7];
        if PREFETCH {
            prefetch::<4, _>(units, ChildRef(child).unit());
        }
        ((near[i & 7].to_bits() as u64) << 32) | child as u64
    };
    if Q::ANY {
        let child = ChildRef(entry(first) as u32);
        while mask != 0 {
            stack.push(entry(mask.trailing_zeros() as usize));
            mask &= mask - 1;
        }
        return Some(child);
    }
    // Up to three are sorted in registers. Which of two boxes is nearer is unpredictable, so this
    // code has no branches.
    let (a, b) = (entry(first), entry(mask.trailing_zeros() as usize));
    mask &= mask - 1;
    let (e0, e1) = (a.min(b), a.max(b));
    if mask == 0 {
        stack.push(e1);
        return Some(ChildRef(e0 as u32));
    }
    let c = entry(mask.trailing_zeros() as usize);
    mask &= mask - 1;
    let (e0, c) = (e0.min(c), e0.max(c));
    let (e1, e2) = (e1.min(c), e1.max(c));
    let base = stack.len();
    stack.push(e2);
    stack.push(e1);
    if mask == 0 {
        return Some(ChildRef(e0 as u32));
    }
    stack.push(e0);
    while mask != 0 {
        stack.push(entry(mask.trailing_zeros() as usize));
        mask &= mask - 1;
    }
    stack.sort_descending_from(base);
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::query::AnyHit;
    use crate::simd::SimdLevel;
    use fearless_simd::dispatch;

    #[test]
    fn any_hit_queries_push_the_children_that_are_hit_and_no_others_at_every_level() {
        let refs = [3, 1 << 31 | 5, 0, 7, 1 << 29, 9, 11, u32::MAX];
        let mut node = [Unit::ZERO; NODE_UNITS];
        *node[CHILD_ROW].bits_mut() = refs;
        for level in SimdLevel::available() {
            let name = level.name();
            let level = SimdLevel::resolve(Some(level)).expect("listed as available");
            for mask in 0..256u32 {
                let mut memory = StackMemory::new();
                let mut stack = Stack::empty(&mut memory);
                stack.push(42);
                let next = dispatch!(level, simd => {
                    let near = f32x8::splat(simd, 0.0);
                    push_children::<_, AnyHit, false>(simd, &[], &node, near, mask, &mut stack)
                });
                assert!(next.is_none(), "{name}: {mask:08b}");
                let hit = (0..WIDTH).filter(|slot| mask >> slot & 1 == 1);
                let expected = hit.map(|slot| u64::from(refs[slot])).rev().chain([42]);
                let popped = std::iter::from_fn(|| stack.pop());
                assert!(popped.eq(expected), "{name}: {mask:08b}");
            }
        }
    }
}
