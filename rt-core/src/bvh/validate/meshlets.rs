//! Checks a finished compact tree: for [`crate::bvh::World::validate`].

use super::TreeStats;
use crate::bvh::compact::{CompactBvh, MeshletCache, with_cache};
use crate::bvh::layout::triangles::{leaf_floats, leaf_triangle_ids};
use crate::bvh::layout::wide::{CHILD_ROW, ChildRef, NODE_UNITS, Unit, WIDTH, get_box};
use crate::math::Aabb;
use fearless_simd::{Level, dispatch};

impl CompactBvh {
    /// Checks that every box contains the triangles below it, whose numbers `mark` takes leaf by
    /// leaf and whose boxes `triangle` gives by their slot in the units of a leaf.
    pub(super) fn validate(
        &self,
        mut mark: impl FnMut(&[u32]) -> Result<(), String>,
        triangle: impl Fn(&[Unit], ChildRef, usize) -> Aabb,
    ) -> Result<TreeStats, String> {
        let mut stats = TreeStats::default();
        let mut todo = vec![(ChildRef::node(0), self.bvh.bounds, 1)];
        with_cache(|cache| {
            let cache = &mut *cache.borrow_mut();
            while let Some((child, bounds, depth)) = todo.pop() {
                if child.is_leaf() {
                    self.validate_meshlet(cache, child, bounds, &mut stats, &mut mark, &triangle)?;
                    continue;
                }
                stats.nodes += 1;
                stats.depth = stats.depth.max(depth);
                if depth > self.bvh.depth {
                    return Err(format!("a node {depth} deep, {} recorded", self.bvh.depth));
                }
                let at = child.unit();
                let Some(node) = self.bvh.units.get(at..at + NODE_UNITS) else {
                    return Err(format!("node {at} beyond the end"));
                };
                for (child, b) in children(node) {
                    if bounds.union(b) != bounds {
                        return Err(format!("node {at}: {b:?} sticks out of {bounds:?}"));
                    }
                    stats.children += 1;
                    todo.push((child, b, depth + 1));
                }
            }
            Ok(())
        })?;
        Ok(stats)
    }

    fn validate_meshlet(
        &self,
        cache: &mut MeshletCache,
        meshlet: ChildRef,
        bounds: Aabb,
        stats: &mut TreeStats,
        mark: &mut impl FnMut(&[u32]) -> Result<(), String>,
        triangle: &impl Fn(&[Unit], ChildRef, usize) -> Aabb,
    ) -> Result<(), String> {
        let level = Level::new();
        let units = &self.bvh.units;
        let (expanded, words) =
            dispatch!(level, simd => cache.last.meshlet(simd, self.key, units, meshlet));
        let (nodes, leaves) = dispatch!(level, simd => expanded.with_all_nodes(simd, words));
        // A box of the small tree may stick out of the one around it, which is rounded too.
        let mut todo = vec![(ChildRef::node(0), vec![bounds])];
        while let Some((child, around)) = todo.pop() {
            if !child.is_leaf() {
                stats.nodes += 1;
                for (child, b) in children(&nodes[child.unit()..child.unit() + NODE_UNITS]) {
                    stats.children += 1;
                    todo.push((child, [around.as_slice(), &[b]].concat()));
                }
                continue;
            }
            stats.leaves += 1;
            stats.primitives += child.count();
            let units = dispatch!(level, simd => leaves.with(simd, words, child));
            let ids = leaf_triangle_ids(leaf_floats(units, child));
            mark(&ids[..child.count()])?;
            for slot in 0..child.count() {
                let b = triangle(units, child, slot);
                if let Some(bounds) = around.iter().find(|bounds| bounds.union(b) != **bounds) {
                    let at = meshlet.unit();
                    return Err(format!("meshlet {at}: {b:?} sticks out of {bounds:?}"));
                }
            }
        }
        Ok(())
    }
}

/// The children of a node and their boxes.
fn children(node: &[Unit]) -> impl Iterator<Item = (ChildRef, Aabb)> + '_ {
    let of_slot = |slot: usize| (ChildRef(node[CHILD_ROW].bits()[slot]), get_box(node, slot));
    (0..WIDTH).map(of_slot).filter(|(child, _)| *child != ChildRef::NONE)
}
