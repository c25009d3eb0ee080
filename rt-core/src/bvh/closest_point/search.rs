//! The search through the upper level and the entries' trees, nearest box first.

use super::ClosestPoint;
use crate::bvh::Unit;
use crate::bvh::compact::with_cache;
use crate::bvh::entry::Entry;
use crate::bvh::geometry::Geometry;
use crate::bvh::instance_filter::InstanceFilter;
use crate::bvh::layout::triangles::{leaf_floats, leaf_triangle_ids, row};
use crate::bvh::layout::wide::{CHILD_ROW, ChildRef, NODE_UNITS, WIDTH};
use crate::bvh::world::World;
use crate::math::nearest_of_triangle;
use fearless_simd::dispatch;
use glam::{DAffine3, DMat3, DVec3, Vec3};

/// Squared distances of boxes are lowered by this factor before a box is left out: more than what
/// the arithmetic in f64 can be wrong by.
const SLACK: f64 = 1.0 - 1e-12;

/// A node or leaf that is still to be visited, and the square of its distance at least.
type Pending = (f64, ChildRef);

pub(super) struct Search<'w> {
    world: &'w World,
    /// In render space.
    point: DVec3,
    /// Squares of larger distances are of no interest.
    limit2: f64,
    best: Option<(f64, ClosestPoint)>,
}

impl<'w> Search<'w> {
    pub(super) fn new(world: &'w World, point: Vec3, max_distance: f32) -> Self {
        let limit = f64::from(max_distance);
        Search { world, point: point.as_dvec3(), limit2: limit * limit, best: None }
    }

    pub(super) fn find(mut self) -> Option<ClosestPoint> {
        let world = self.world;
        match world.only {
            Some(id) => self.search_entry(world.entry(id)),
            None => {
                let units = &world.tlas.units;
                self.visit(units, self.point, 1.0, |search, leaf| {
                    if let Some(entry) = world.entry_of_leaf(units, leaf, InstanceFilter::All) {
                        search.search_entry(entry);
                    }
                });
            }
        }
        self.best.map(|(_, found)| found)
    }

    fn search_entry(&mut self, entry: Entry<'_>) {
        let Some(tree) = entry.triangles(InstanceFilter::All) else { return };
        let units = tree.units;
        let local_from_render = entry.placement().local_from_render();
        let render_from_local = local_from_render.inverse();
        let local = local_from_render.transform_point3(self.point);
        let scale2 = 1.0 / largest_stretch2(&local_from_render.matrix3);
        if tree.meshlets() != 0 {
            let level = self.world.level;
            with_cache(|cache| {
                let last = &mut cache.borrow_mut().last;
                self.visit(units, local, scale2, |search, leaf| {
                    let (expanded, words) =
                        dispatch!(level, simd => last.meshlet(simd, tree.meshlets(), units, leaf));
                    let (nodes, leaves) =
                        dispatch!(level, simd => expanded.with_all_nodes(simd, words));
                    search.visit(nodes, local, scale2, |search, leaf| {
                        let units = dispatch!(level, simd => leaves.with(simd, words, leaf));
                        search.test_leaf(units, leaf, entry, &render_from_local);
                    });
                });
            });
            return;
        }
        self.visit(units, local, scale2, |search, leaf| {
            search.test_leaf(units, leaf, entry, &render_from_local);
        });
    }

    /// Visits the leaves of a tree that may be nearer than the best point so far. `point` is in the
    /// tree's space, and `scale2` the least square of a distance in render space over that in the
    /// tree's.
    fn visit(
        &mut self,
        units: &[Unit],
        point: DVec3,
        scale2: f64,
        mut leaf: impl FnMut(&mut Self, ChildRef),
    ) {
        let mut stack: Vec<Pending> = vec![(0.0, ChildRef::node(0))];
        while let Some((distance2, child)) = stack.pop() {
            if distance2 > self.limit2 {
                continue;
            }
            if child.is_leaf() {
                leaf(self, child);
                continue;
            }
            let node = &units[child.unit()..child.unit() + NODE_UNITS];
            let near = box_distances2(node, point);
            let base = stack.len();
            for (slot, near) in near.into_iter().enumerate() {
                let child = ChildRef(node[CHILD_ROW].bits()[slot]);
                let distance2 = near * scale2 * SLACK;
                if child != ChildRef::NONE && distance2 <= self.limit2 {
                    stack.push((distance2, child));
                }
            }
            stack[base..].sort_by(|a, b| b.0.total_cmp(&a.0));
        }
    }

    fn test_leaf(
        &mut self,
        units: &[Unit],
        leaf: ChildRef,
        entry: Entry<'_>,
        to_render: &DAffine3,
    ) {
        let floats = leaf_floats(units, leaf);
        let ids = leaf_triangle_ids(floats);
        for i in 0..leaf.count() {
            let corner = |vertex: usize| {
                let at = |axis: usize| f64::from(row(floats, 3 * vertex + axis)[i]);
                to_render.transform_point3(DVec3::new(at(0), at(1), at(2))) - self.point
            };
            let corners = [corner(0), corner(1), corner(2)];
            let near = nearest_of_triangle(corners);
            if near.distance2.is_nan() || near.distance2 > self.limit2 {
                continue;
            }
            let (instance, prim) = match entry {
                Entry::Instance { number, .. } => (number, ids[i]),
                Entry::Group(group) => group.owner(ids[i]),
            };
            let first = self.best.is_none_or(|(distance2, b)| {
                near.distance2 < distance2 || (instance, prim) < (b.instance, b.prim)
            });
            if !first || !self.is_present(instance, prim) {
                continue;
            }
            let [a, b, c] = corners;
            let offset = a + (b - a) * near.u + (c - a) * near.v;
            let found = ClosestPoint {
                point: (self.point + offset).as_vec3(),
                distance: near.distance2.sqrt() as f32,
                u: near.u as f32,
                v: near.v as f32,
                prim,
                instance,
            };
            self.limit2 = near.distance2;
            self.best = Some((near.distance2, found));
        }
    }
}

impl Search<'_> {
    /// Whether the triangle has corners: leaves hold a point in place of those that a refit made
    /// invalid.
    fn is_present(&self, instance: u32, prim: u32) -> bool {
        let geometry = self.world.instances()[instance as usize].geometry;
        match &self.world.geometries()[geometry] {
            Geometry::Mesh(mesh) => mesh.is_renderable(prim as usize),
            Geometry::Slices(facts) => facts.is_present(prim),
            Geometry::Shape(_) => false,
        }
    }
}

/// Squares of the distances to a node's eight boxes; infinite for slots without a child.
fn box_distances2(node: &[Unit], point: DVec3) -> [f64; WIDTH] {
    let mut sum = [0.0; WIDTH];
    for axis in 0..3 {
        let (lo, hi, p) = (&node[2 * axis].0, &node[2 * axis + 1].0, point[axis]);
        for slot in 0..WIDTH {
            let outside = (f64::from(lo[slot]) - p).max(p - f64::from(hi[slot])).max(0.0);
            sum[slot] += outside * outside;
        }
    }
    sum
}

/// No vector becomes longer than by the root of this factor: the largest sum of magnitudes in a row
/// of MᵀM bounds its largest eigenvalue, and is that of a rotation with a scale.
fn largest_stretch2(m: &DMat3) -> f64 {
    let gram = m.transpose() * *m;
    let rows = gram.to_cols_array_2d().map(|c| c.iter().map(|x| x.abs()).sum::<f64>());
    rows.into_iter().fold(0.0, f64::max)
}
