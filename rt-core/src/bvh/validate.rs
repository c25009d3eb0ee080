//! Checks finished trees, for tests and debugging: slow, and not needed by correct programs.

mod meshlets;

use super::blas::{Blas, Content};
use super::geometry::Geometry;
use super::layout::id_leaf::leaf_primitive_ids;
use super::layout::local_frame::LocalFrame;
use super::layout::triangles::{
    TRI_LEAF_UNITS, TriWriter, leaf_floats, leaf_triangle_ids, row, widened,
};
use super::layout::wide::{
    CHILD_ROW, ChildRef, MAX_DEPTH, NODE_UNITS, Unit, WIDTH, WideBvh, get_box,
};
use super::mesh_group::MeshGroup;
use super::placement::PLACEMENT_UNITS;
use super::traverse::tree_view::NO_OWNER;
use super::world::World;
use crate::math::Aabb;
use crate::mesh::TriMesh;
use glam::Vec3;

/// Counts of [`World::validate`] over all geometries' trees.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct TreeStats {
    /// 8-wide nodes.
    pub nodes: usize,
    /// Children of these nodes.
    pub children: usize,
    /// Leaves.
    pub leaves: usize,
    /// Primitives in leaves.
    pub primitives: usize,
    /// Nodes on the longest path of any tree.
    pub depth: usize,
}

/// An invalid tree: a defect of this crate, please report it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{tree}: {fault}")]
#[non_exhaustive]
pub struct InvalidTree {
    /// "geometry 3" or "instances".
    pub tree: String,
    /// What is wrong, and where.
    pub fault: String,
}

impl World {
    /// Checks that every box contains what is below it, that every primitive is in exactly one
    /// leaf, and that no tree is deeper than traversal allows.
    pub fn validate(&self) -> Result<TreeStats, InvalidTree> {
        let mut stats = TreeStats::default();
        for (i, (blas, geometry)) in self.blas.iter().zip(&self.geometries).enumerate() {
            let fail = |fault| InvalidTree { tree: format!("geometry {i}"), fault };
            stats = stats.and(validate_blas(blas, geometry).map_err(fail)?);
        }
        if let Some(group) = &self.group {
            let fail = |fault| InvalidTree { tree: "mesh group".into(), fault };
            stats = stats.and(validate_group(group, &self.geometries).map_err(fail)?);
        }
        let entries = self.placements.len() + usize::from(self.group.is_some());
        let mut seen = vec![false; entries];
        let instances = TreeWalker::new(&self.tlas, PLACEMENT_UNITS);
        instances
            .run(|leaf| {
                let ids = leaf_primitive_ids(&self.tlas.units, leaf).to_vec();
                mark(&mut seen, &ids)?;
                Ok(ids.iter().map(|&id| self.entry(id).placement().bounds()).collect())
            })
            .map_err(|fault| InvalidTree { tree: "instances".into(), fault })?;
        Ok(stats)
    }
}

impl TreeStats {
    fn and(self, o: TreeStats) -> TreeStats {
        TreeStats {
            nodes: self.nodes + o.nodes,
            children: self.children + o.children,
            leaves: self.leaves + o.leaves,
            primitives: self.primitives + o.primitives,
            depth: self.depth.max(o.depth),
        }
    }
}

fn validate_blas(blas: &Blas, geometry: &Geometry) -> Result<TreeStats, String> {
    let stats = match (&blas.content, geometry) {
        (Content::Triangles(tris), Geometry::Mesh(_) | Geometry::Slices(_)) => {
            let corners = Corners::of(geometry, &blas.frame, 0);
            let mut seen = vec![false; geometry.num_primitives()];
            let stats = TreeWalker::new(&tris.bvh, TRI_LEAF_UNITS).run(|leaf| {
                let ids = &leaf_triangle_ids(leaf_floats(&tris.bvh.units, leaf))[..leaf.count()];
                mark(&mut seen, ids)?;
                let units = &tris.bvh.units;
                Ok((0..ids.len()).map(|k| corners.bounds(units, leaf, k)).collect())
            })?;
            let lost = (0..seen.len()).find(|&i| !seen[i] && corners.is_renderable(i));
            // A refit can make a triangle usable that the build left out; it counts as skipped.
            if let Some(i) = lost
                && blas.skipped == 0
            {
                return Err(format!("triangle {i} is in no leaf"));
            }
            stats
        }
        (Content::Shape { bvh, shape }, _) => {
            let mut seen = vec![false; shape.num_primitives()];
            TreeWalker::new(bvh, 1).run(|leaf| {
                let ids = leaf_primitive_ids(&bvh.units, leaf).to_vec();
                mark(&mut seen, &ids)?;
                Ok(ids.iter().map(|&i| shape.bounds(i)).collect())
            })?
        }
        (Content::Compact(tree), Geometry::Mesh(_) | Geometry::Slices(_)) => {
            let corners = Corners::of(geometry, &blas.frame, 0);
            let mut seen = vec![false; geometry.num_primitives()];
            let stats = tree.validate(
                |ids| mark(&mut seen, ids),
                |units, leaf, slot| corners.bounds(units, leaf, slot),
            )?;
            if let Some(i) = (0..seen.len()).find(|&i| !seen[i] && corners.is_renderable(i)) {
                return Err(format!("triangle {i} is in no leaf"));
            }
            stats
        }
        // Checked with its group.
        (Content::Member { .. }, Geometry::Mesh(_) | Geometry::Slices(_)) => {
            return Ok(TreeStats::default());
        }
        (
            Content::Triangles(_) | Content::Compact(_) | Content::Member { .. },
            Geometry::Shape(_),
        ) => {
            return Err("a tree of triangles for a shape".into());
        }
    };
    if stats.primitives < blas.primitives {
        return Err(format!(
            "{} primitives in leaves, {} expected",
            stats.primitives, blas.primitives
        ));
    }
    Ok(stats)
}

fn mark(seen: &mut [bool], ids: &[u32]) -> Result<(), String> {
    for &i in ids {
        match seen.get_mut(i as usize) {
            None => return Err(format!("a leaf holds primitive {i} of {}", seen.len())),
            Some(true) => return Err(format!("primitive {i} is in two leaves")),
            Some(s) => *s = true,
        }
    }
    Ok(())
}

/// Where the corners of a leaf's triangles are known from.
enum Corners<'a> {
    /// The mesh.
    Mesh(TriWriter<'a>, &'a TriMesh),
    /// Only the leaves: the mesh was built from slices.
    Leaves,
}

impl<'a> Corners<'a> {
    /// `first`: number of the mesh's first triangle in leaves.
    fn of(geometry: &'a Geometry, frame: &'a LocalFrame, first: u32) -> Self {
        match geometry {
            Geometry::Mesh(mesh) => {
                Corners::Mesh(TriWriter::new(mesh.triangles(), frame, first), mesh)
            }
            Geometry::Slices(_) | Geometry::Shape(_) => Corners::Leaves,
        }
    }

    /// The box of the triangle in `slot` of a leaf.
    fn bounds(&self, units: &[Unit], leaf: ChildRef, slot: usize) -> Aabb {
        let floats = leaf_floats(units, leaf);
        match self {
            Corners::Mesh(writer, _) => {
                writer.bounds(writer.in_mesh(leaf_triangle_ids(floats))[slot])
            }
            Corners::Leaves => {
                let corner = |vertex: usize| Vec3::from_array(corner_of(floats, slot, vertex));
                let corners = [0, 1, 2].map(corner);
                // Points stand for triangles that a refit made invalid.
                let is_point = corners == [Vec3::ZERO; 3];
                if is_point { Aabb::EMPTY } else { widened(Aabb::from_points(&corners)) }
            }
        }
    }

    fn is_renderable(&self, triangle: usize) -> bool {
        match self {
            Corners::Mesh(_, mesh) => mesh.is_renderable(triangle),
            Corners::Leaves => false,
        }
    }
}

fn corner_of(floats: &[f32; 8 * TRI_LEAF_UNITS], slot: usize, vertex: usize) -> [f32; 3] {
    [0, 1, 2].map(|axis| row(floats, 3 * vertex + axis)[slot])
}

/// Checks the tree of a mesh group: as any tree, and that the children of the upper part belong to
/// whom they say.
fn validate_group(group: &MeshGroup, geometries: &[Geometry]) -> Result<TreeStats, String> {
    let shape = group.members.iter().find(|m| !geometries[m.geometry].is_mesh());
    if let Some(member) = shape {
        return Err(format!("geometry {} is no mesh", member.geometry));
    }
    let all: usize = group.members.iter().map(|m| geometries[m.geometry].num_primitives()).sum();
    let mut seen = vec![false; all];
    let units = &group.bvh.units;
    let walker = TreeWalker {
        unused_units: group.replaced_units,
        ..TreeWalker::new(&group.bvh, TRI_LEAF_UNITS)
    };
    let stats = walker.run(|leaf| {
        let ids = &leaf_triangle_ids(leaf_floats(units, leaf))[..leaf.count()];
        mark(&mut seen, ids)?;
        ids.iter()
            .enumerate()
            .map(|(slot, &id)| {
                let (instance, prim) = group.owner(id);
                let k = group.members.iter().position(|m| m.instance == instance);
                let k = k.ok_or_else(|| format!("triangle {id} has no member"))?;
                let first = group.members[k].first;
                if first + prim != id {
                    return Err(format!("triangle {id} is not number {prim} from {first}"));
                }
                let geometry = &geometries[group.members[k].geometry];
                Ok(Corners::of(geometry, &group.frame, first).bounds(units, leaf, slot))
            })
            .collect()
    })?;
    for (n, owners) in group.owners().iter().enumerate() {
        let children = units[n * NODE_UNITS + CHILD_ROW].bits();
        for (&child, &owner) in children.iter().zip(owners).filter(|(_, o)| **o != NO_OWNER) {
            let unit = ChildRef(child).unit();
            let member = group.members.iter().find(|m| m.units.contains(&unit));
            if member.map(|m| m.instance) != Some(owner) {
                return Err(format!("unit {unit} does not belong to instance {owner}"));
            }
        }
    }
    Ok(stats)
}

struct TreeWalker<'b> {
    bvh: &'b WideBvh,
    leaf_units: usize,
    /// Units that no reference leads to.
    unused_units: usize,
}

impl<'b> TreeWalker<'b> {
    fn new(bvh: &'b WideBvh, leaf_units: usize) -> Self {
        TreeWalker { bvh, leaf_units, unused_units: 0 }
    }

    /// Visits every leaf; `contents` gives the boxes of its primitives (empty boxes for those that
    /// cannot be hit).
    fn run(
        &self,
        mut contents: impl FnMut(ChildRef) -> Result<Vec<Aabb>, String>,
    ) -> Result<TreeStats, String> {
        let units: &[Unit] = &self.bvh.units;
        let mut stats = TreeStats::default();
        let mut used = 0;
        let mut todo = vec![(ChildRef::node(0), self.bvh.bounds, 1)];
        while let Some((child, bounds, depth)) = todo.pop() {
            let at = child.unit();
            let inside = |b: Aabb| b.is_empty() || bounds.union(b) == bounds;
            if child.is_leaf() {
                stats.leaves += 1;
                stats.primitives += child.count();
                used += self.leaf_units;
                if at + self.leaf_units > units.len() {
                    return Err(format!("leaf {at} beyond the end"));
                }
                if let Some(b) = contents(child)?.into_iter().find(|b| !inside(*b)) {
                    return Err(format!("leaf {at}: {b:?} sticks out of {bounds:?}"));
                }
                continue;
            }
            stats.nodes += 1;
            stats.depth = stats.depth.max(depth);
            used += NODE_UNITS;
            let Some(node) = units.get(at..at + NODE_UNITS) else {
                return Err(format!("node {at} beyond the end"));
            };
            for slot in 0..WIDTH {
                let c = ChildRef(node[CHILD_ROW].bits()[slot]);
                let b = get_box(node, slot);
                if c == ChildRef::NONE {
                    if !b.is_empty() {
                        return Err(format!("node {at}: unused slot {slot} has the box {b:?}"));
                    }
                    continue;
                }
                if !inside(b) {
                    return Err(format!(
                        "node {at}: child {slot}, {b:?}, sticks out of {bounds:?}"
                    ));
                }
                if c.unit() <= at {
                    return Err(format!("node {at}: child {slot} at {} lies before it", c.unit()));
                }
                stats.children += 1;
                todo.push((c, b, depth + 1));
            }
        }
        // The depth of a group is a bound: the deepest subtree may hang under a shorter path.
        let exact = self.unused_units == 0;
        let wrong =
            if exact { stats.depth != self.bvh.depth } else { stats.depth > self.bvh.depth };
        if self.bvh.depth > MAX_DEPTH || wrong {
            return Err(format!(
                "depth {}, recorded {}, at most {MAX_DEPTH} allowed",
                stats.depth, self.bvh.depth
            ));
        }
        let used = used + self.unused_units;
        if used != units.len() {
            return Err(format!("{used} units in use of {}", units.len()));
        }
        Ok(stats)
    }
}
