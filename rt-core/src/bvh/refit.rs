//! Moves the vertices of a mesh without rebuilding its tree.
//!
//! Leaves get the new vertices and boxes are recomputed from the bottom up; triangles stay in their
//! leaves. A time step of a deforming mesh then costs a seventh of a build (42 ms of CPU against
//! 290 for 1 M triangles). Rays become slower the further the vertices move from where the tree was
//! built: the report estimates by how much.

use super::blas::{Blas, Content};
use super::build::UNWATCHED;
use super::geometry::{Geometry, SliceFacts};
use super::layout::local_frame::LocalFrame;
use super::layout::triangles::{TRI_LEAF_UNITS, TriWriter, leaf_floats, leaf_triangle_ids};
use super::layout::wide::{
    CHILD_ROW, ChildRef, LeafWriter, NODE_UNITS, Unit, WIDTH, get_box, set_box,
};
use super::mesh_group::{MeshGroup, choose_members};
use super::top_level::choose_origin;
use super::world::{BuildRequest, World};
use crate::math::Aabb;
use crate::mesh::{MeshError, MeshSlices, TriMesh, Triangles};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Report of [`World::refit`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct RefitReport {
    /// Time from the new vertices to a traversable structure.
    pub elapsed: Duration,
    /// Triangles that cannot be hit because a vertex is NaN or infinite now. They return when their
    /// vertices become finite.
    pub unusable: usize,
    /// Triangles that could be hit, but were left out when the tree was built. Only a new build
    /// includes them.
    pub absent: usize,
    /// Expected box and leaf tests of a ray that hits the mesh (the cost of the surface area
    /// heuristic), relative to when the tree was built. It predicts single rays well: 1 M triangles
    /// twisted until this was 1.14, 1.32, 1.57, 1.89 took 1.15, 1.33, 1.47, 1.69 times as long as
    /// in a new tree, coherent packets 1.04, 1.16, 1.26, 1.37 times.
    pub cost_growth: f64,
}

/// Why [`World::refit`] failed. The world is unchanged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RefitError {
    /// The geometry index is out of range.
    #[error("there is no geometry {geometry}: the world has {count}")]
    NoSuchGeometry {
        /// The index.
        geometry: usize,
        /// Number of geometries.
        count: usize,
    },
    /// Only meshes can be refitted.
    #[error("geometry {geometry} is not a triangle mesh; build a new world instead")]
    NotAMesh {
        /// The index.
        geometry: usize,
    },
    /// The world is a part of another one, whose bounds would also have to be chosen again.
    #[error(
        "geometry {geometry} is a part of a larger one; move the vertices of the whole, and build \
         its parts again"
    )]
    OfAPart {
        /// The index.
        geometry: usize,
    },
    /// The tree is compact: its boxes and coordinates have no room for other positions.
    #[error(
        "geometry {geometry} is in compact storage, which cannot be refitted; build a new world, \
         or build with Storage::Plain"
    )]
    Compact {
        /// The index.
        geometry: usize,
    },
    /// The new mesh is unusable.
    #[error("geometry {geometry}: {source}")]
    Mesh {
        /// The index.
        geometry: usize,
        /// What is wrong with it.
        source: MeshError,
    },
    /// The number of vertices or triangles differs.
    #[error(
        "geometry {geometry}: the new mesh has {found} {what}, the tree was built for {expected}; \
         refit only moves vertices, build a new world"
    )]
    Topology {
        /// The index.
        geometry: usize,
        /// "vertices" or "triangles".
        what: &'static str,
        /// The number in the tree.
        expected: usize,
        /// The number in the new mesh.
        found: usize,
    },
    /// The mesh was built from slices.
    #[error(
        "geometry {geometry} was built from borrowed slices, which the world does not keep; give \
         them to World::refit_slices"
    )]
    WithoutArrays {
        /// The index.
        geometry: usize,
    },
    /// Slices were given for a geometry that was not built from slices.
    #[error("geometry {geometry} was not built from slices; move its vertices with World::refit")]
    WithArrays {
        /// The index.
        geometry: usize,
    },
    /// Slices were not given for every mesh.
    #[error("slices of {found} meshes for a world of {expected}; give those of all its meshes")]
    Meshes {
        /// Geometries of the world.
        expected: usize,
        /// Meshes given.
        found: usize,
    },
    /// The new mesh has different vertex indices.
    #[error(
        "geometry {geometry}: triangle {triangle} has other vertex indices than when the tree was \
         built; refit only moves vertices, build a new world"
    )]
    Indices {
        /// The index.
        geometry: usize,
        /// The first triangle that differs.
        triangle: usize,
    },
}

impl World {
    /// Replaces the vertices (and attributes) of a mesh; the triangles stay. All of its instances
    /// change. Hits equal those of a new build. As in a build, the origin of render space is chosen
    /// again, so convert points again afterwards.
    ///
    /// ```
    /// # use rt_core::{bvh::*, mesh::TriMesh, ray::Ray, glam::Vec3};
    /// # use std::sync::Arc;
    /// let mut mesh = TriMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
    /// let mut world = World::from_mesh(mesh.clone(), &BuildOptions::default())?;
    /// mesh.positions.iter_mut().for_each(|p| p.z += 1.0);
    /// let report = world.refit(0, Arc::new(mesh))?;
    /// assert_eq!(report.unusable, 0);
    /// let hit = world.closest(&Ray::new(Vec3::new(0.2, 0.2, 3.0), -Vec3::Z)).expect("in the way");
    /// assert!((hit.t - 2.0).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn refit(
        &mut self,
        geometry: usize,
        mesh: Arc<TriMesh>,
    ) -> Result<RefitReport, RefitError> {
        let start = Instant::now();
        let count = self.geometries.len();
        let old = match self.geometries.get(geometry) {
            None => return Err(RefitError::NoSuchGeometry { geometry, count }),
            Some(Geometry::Shape(_)) => return Err(RefitError::NotAMesh { geometry }),
            Some(Geometry::Slices(_)) => return Err(RefitError::WithoutArrays { geometry }),
            Some(Geometry::Mesh(_)) if self.blas[geometry].is_compact() => {
                return Err(RefitError::Compact { geometry });
            }
            Some(Geometry::Mesh(_)) if self.blas[geometry].is_part() => {
                return Err(RefitError::OfAPart { geometry });
            }
            Some(Geometry::Mesh(old)) => old,
        };
        mesh.check().map_err(|source| RefitError::Mesh { geometry, source })?;
        for (what, expected, found) in [
            ("vertices", old.positions.len(), mesh.positions.len()),
            ("triangles", old.indices.len(), mesh.indices.len()),
        ] {
            if expected != found {
                return Err(RefitError::Topology { geometry, what, expected, found });
            }
        }
        if old.indices != mesh.indices {
            let differs = old.indices.iter().zip(&mesh.indices).position(|(a, b)| a != b);
            return Err(RefitError::Indices { geometry, triangle: differs.unwrap_or(0) });
        }

        self.geometries[geometry] = Geometry::Mesh(Arc::clone(&mesh));
        Ok(self.move_vertices(geometry, mesh.triangles(), &[], start))
    }

    /// As [`World::refit`], for a world from [`World::from_slices`]. `meshes` are all meshes of the
    /// world, as the build got them but for the vertices of mesh `geometry`, which have moved.
    /// Nothing of them is copied but the corners in the leaves.
    ///
    /// ```
    /// use rt_core::mesh::MeshSlices;
    /// use rt_core::prelude::*;
    ///
    /// let mut corners = vec![0., 0., 0., 1., 0., 0., 0., 1., 0.];
    /// let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
    /// let mesh = MeshSlices::new(&corners, &[0, 1, 2]);
    /// let mut world = World::from_slices(&[mesh], vec![placed], &BuildOptions::default())?;
    /// for z in [2, 5, 8] {
    ///     corners[z] += 1.0;
    /// }
    /// let report = world.refit_slices(0, &[MeshSlices::new(&corners, &[0, 1, 2])])?;
    /// assert_eq!(report.unusable, 0);
    /// let hit = world.closest(&Ray::new(Vec3::new(0.2, 0.2, 3.0), -Vec3::Z)).expect("in the way");
    /// assert!((hit.t - 2.0).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`World::refit`]. The world has no old indices to compare the new ones with; with others,
    /// rays meet the new triangles, but are slower.
    pub fn refit_slices(
        &mut self,
        geometry: usize,
        meshes: &[MeshSlices<'_>],
    ) -> Result<RefitReport, RefitError> {
        let start = Instant::now();
        let count = self.geometries.len();
        if geometry >= count {
            return Err(RefitError::NoSuchGeometry { geometry, count });
        }
        if self.blas[geometry].is_compact() {
            return Err(RefitError::Compact { geometry });
        }
        if meshes.len() != count {
            return Err(RefitError::Meshes { expected: count, found: meshes.len() });
        }
        for (geometry, (old, mesh)) in self.geometries.iter().zip(meshes).enumerate() {
            let Geometry::Slices(old) = old else {
                return Err(RefitError::WithArrays { geometry });
            };
            mesh.check().map_err(|source| RefitError::Mesh { geometry, source })?;
            for (what, expected, found) in [
                ("vertices", old.num_vertices(), mesh.num_vertices()),
                ("triangles", old.num_triangles(), mesh.num_triangles()),
            ] {
                if expected != found {
                    return Err(RefitError::Topology { geometry, what, expected, found });
                }
            }
        }
        let mesh = meshes[geometry].triangles();
        self.geometries[geometry] = Geometry::Slices(Arc::new(SliceFacts::of_refitted(mesh)));
        Ok(self.move_vertices(geometry, mesh, meshes, start))
    }

    /// Moves the vertices of `geometry`, which is the new one already, in the trees.
    fn move_vertices(
        &mut self,
        geometry: usize,
        mesh: Triangles<'_>,
        slices: &[MeshSlices<'_>],
        start: Instant,
    ) -> RefitReport {
        // Copies a tree that another world also uses.
        let blas = Arc::make_mut(&mut self.blas[geometry]);
        let absent = match &mut self.group {
            Some(group) if blas.bvh().is_none() => {
                refit_member(Arc::make_mut(group), geometry, blas, mesh)
            }
            _ => refit_blas(blas, mesh),
        };
        let (unusable, mut cost_growth) = (blas.skipped - absent, blas.cost_growth);
        let choice = if self.group_is_impossible {
            None
        } else {
            choose_members(&self.geometries, &self.instances)
        };
        let alone = |g: usize| {
            let b = &self.blas[g];
            b.bvh().is_some().then(|| (b.frame, b.bounds()))
        };
        let origin = choose_origin(&self.instances, alone, choice.as_ref());
        let keeps_group = match (&self.group, &choice) {
            (Some(group), Some(choice)) => {
                let members = group.members.iter().map(|m| m.instance);
                choice.frame(origin) == group.frame && members.eq(choice.instances.iter().copied())
            }
            (None, None) => true,
            (Some(_), None) | (None, Some(_)) => false,
        };
        if keeps_group {
            if let Some(group) = &mut self.group {
                Arc::make_mut(group).place(origin);
            }
            self.rebuild_top_level(origin);
        } else {
            // Other meshes share a tree now, or the same ones in another space.
            let (geometries, instances) = (self.geometries.clone(), self.instances.clone());
            let options = self.options;
            let request = BuildRequest::new(&options, &UNWATCHED);
            *self = BuildRequest { slices, ..request }
                .build(geometries, instances)
                .expect("the same transforms, and the new mesh was checked");
            cost_growth = 1.0;
        }
        RefitReport { elapsed: start.elapsed(), unusable, absent, cost_growth }
    }
}

/// Moves the vertices in the tree; returns how many usable triangles are not in it.
fn refit_blas(blas: &mut Blas, mesh: Triangles<'_>) -> usize {
    let Content::Triangles(tris) = &mut blas.content else { return 0 };
    let frame = LocalFrame::choose(mesh.origin, mesh.bounds());
    let writer = TriWriter::new(mesh, &frame, 0);
    let before = tris.bvh.bounds;
    let root = refit_node(&mut tris.bvh.units, 0, &writer);
    tris.bvh.bounds = root.bounds;
    blas.frame = frame;
    record_refit(blas, mesh, before, &root)
}

/// As [`refit_blas`], in the subtree of a group's member.
fn refit_member(
    group: &mut MeshGroup,
    geometry: usize,
    blas: &mut Blas,
    mesh: Triangles<'_>,
) -> usize {
    let Some(member) = group.members.iter().find(|m| m.geometry == geometry).cloned() else {
        return 0;
    };
    let frame = group.frame;
    let writer = TriWriter::new(mesh, &frame, member.first);
    let before = blas.bounds();
    let units = &mut group.bvh.units[member.units.clone()];
    let root = refit_node(units, member.units.start, &writer);
    group.update_upper_boxes(member.instance, &writer);
    if let Content::Member { bounds, .. } = &mut blas.content {
        *bounds = root.bounds;
    }
    record_refit(blas, mesh, before, &root)
}

/// Updates the counts and the cost of a mesh whose tree had the bounds `before`; returns how many
/// usable triangles are not in the tree.
fn record_refit(blas: &mut Blas, mesh: Triangles<'_>, before: Aabb, root: &RefitTotals) -> usize {
    // Both sums are relative to the area of the whole: their quotient is the ratio of expected
    // tests per ray.
    let (before, after) = (before.half_area() as f64, root.bounds.half_area() as f64);
    let growth = (root.new_area / after) / (root.old_area / before);
    blas.cost_growth *= if growth.is_finite() && growth > 0.0 { growth } else { 1.0 };
    let usable = (0..mesh.indices.len())
        .into_par_iter()
        .with_min_len(1 << 14)
        .filter(|&i| mesh.is_renderable(i));
    let absent = usable.count() - root.usable;
    blas.primitives = root.usable;
    blas.skipped = mesh.indices.len() - root.usable;
    absent
}

/// Result of refitting a subtree.
#[derive(Clone, Copy)]
struct RefitTotals {
    bounds: Aabb,
    /// Summed half areas of all boxes in it, before and after.
    old_area: f64,
    new_area: f64,
    /// Triangles that can be hit.
    usable: usize,
}

impl RefitTotals {
    const NOTHING: RefitTotals =
        RefitTotals { bounds: Aabb::EMPTY, old_area: 0.0, new_area: 0.0, usable: 0 };
}

/// Subtrees of at least this many units are separate tasks.
const PARALLEL_UNITS: usize = 1 << 14;

/// Refits the subtree in `units`, whose first unit has the index `base` in the arena. A subtree is
/// contiguous in the arena: its node, followed by the children's subtrees in order.
fn refit_node(units: &mut [Unit], base: usize, writer: &TriWriter<'_>) -> RefitTotals {
    let children = *units[CHILD_ROW].bits();
    let (node, mut rest) = units.split_at_mut(NODE_UNITS);

    // ---- The children's subtrees, in arena order.
    let mut slots: [usize; WIDTH] = std::array::from_fn(|i| i);
    let used = children.iter().filter(|&&c| ChildRef(c) != ChildRef::NONE).count();
    // Unused slots sort last.
    slots.sort_unstable_by_key(|&s| {
        if ChildRef(children[s]) == ChildRef::NONE {
            usize::MAX
        } else {
            ChildRef(children[s]).unit()
        }
    });
    let whole = rest.len();
    let mut at = base + NODE_UNITS;
    let mut pieces: Vec<(usize, ChildRef, usize, &mut [Unit])> = Vec::with_capacity(WIDTH);
    for (k, &slot) in slots[..used].iter().enumerate() {
        let child = ChildRef(children[slot]);
        let end = slots[..used]
            .get(k + 1)
            .map_or(base + NODE_UNITS + whole, |&s| ChildRef(children[s]).unit());
        let (mine, others) = rest.split_at_mut(end - at);
        pieces.push((slot, child, at, mine));
        (at, rest) = (end, others);
    }

    let refit_child = |(slot, child, at, mine): (usize, ChildRef, usize, &mut [Unit])| {
        let r = if child.is_leaf() {
            refit_leaf(mine, child, writer)
        } else {
            refit_node(mine, at, writer)
        };
        (slot, r)
    };
    let done: Vec<(usize, RefitTotals)> = if whole >= PARALLEL_UNITS {
        pieces.into_par_iter().map(refit_child).collect()
    } else {
        pieces.into_iter().map(refit_child).collect()
    };
    let mut sum = RefitTotals::NOTHING;
    for (slot, r) in done {
        sum.old_area += r.old_area + get_box(node, slot).half_area() as f64;
        sum.new_area += r.new_area + r.bounds.half_area() as f64;
        sum.usable += r.usable;
        sum.bounds = sum.bounds.union(r.bounds);
        set_box(node, slot, r.bounds);
    }
    sum
}

fn refit_leaf(units: &mut [Unit], leaf: ChildRef, writer: &TriWriter<'_>) -> RefitTotals {
    debug_assert_eq!(units.len(), TRI_LEAF_UNITS, "a leaf's piece is the leaf");
    let ids = leaf_triangle_ids(leaf_floats(units, ChildRef::leaf(0, leaf.count())));
    let ids = &writer.in_mesh(ids)[..leaf.count()];
    let mut r = RefitTotals::NOTHING;
    for b in ids.iter().map(|&i| writer.bounds(i)).filter(|b| !b.is_empty()) {
        r.usable += 1;
        r.bounds = r.bounds.union(b);
    }
    writer.write(ids, units);
    r
}

#[cfg(test)]
mod tests;
