//! The choices of a world, agreed on by parts of it that each hold some of its primitives.
//!
//! A world chooses its spaces from bounds, and those of the whole are the unions of those of its
//! parts. So no part needs the primitives of another: a few boxes for each geometry are enough.

use super::geometry::{Geometry, Instance, MeshExtent};
use super::layout::local_frame::LocalFrame;
use super::layout::triangles::{TriWriter, widened};
use super::mesh_group::{GroupChoice, GroupLayout, members_among};
use super::partition::GlobalLayout;
use super::placement::Placement;
use super::top_level::choose_origin;
use crate::math::Aabb;
use rayon::prelude::*;

impl GlobalLayout {
    /// The layout of the world of which every part holds some primitives. All parts call this with
    /// the same `instances` and with geometries of the same number, order, kind (mesh or shape) and
    /// origin; a part that has nothing of a geometry gives an empty one. `primitives` are the
    /// numbers of primitives of each geometry in all parts together.
    ///
    /// `join` is called one to three times, with as many boxes in all parts, and replaces each box
    /// by the union of those that all parts have at its place. The result has the bits of
    /// [`super::World::global_layout`] of a world that has everything, unless that world has more
    /// small meshes than one tree can hold.
    ///
    /// ```
    /// # use rt_core::{bvh::*, math::Aabb, mesh::TriMesh, glam::{DAffine3, Vec3}};
    /// let mesh = TriMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
    /// let (geometries, placed) = (
    ///     vec![Geometry::Mesh(mesh.into())],
    ///     vec![Instance { geometry: 0, world_from_object: DAffine3::IDENTITY }],
    /// );
    /// let alone = |_: &mut [Aabb]| Ok::<(), ()>(());
    /// let layout = GlobalLayout::of_parts(&geometries, &placed, &[1], alone).unwrap();
    /// let whole = World::build(geometries, placed, &BuildOptions::default()).unwrap();
    /// assert_eq!(layout, whole.global_layout());
    /// ```
    ///
    /// # Errors
    /// Those of `join`.
    pub fn of_parts<E>(
        geometries: &[Geometry],
        instances: &[Instance],
        primitives: &[u64],
        mut join: impl FnMut(&mut [Aabb]) -> Result<(), E>,
    ) -> Result<GlobalLayout, E> {
        // ---- Bounds of the vertices, which decide the local spaces.
        let mut extents: Vec<Option<MeshExtent>> =
            geometries.par_iter().map(Geometry::mesh_extent).collect();
        let mut boxes: Vec<Aabb> =
            extents.iter().map(|e| e.as_ref().map_or(Aabb::EMPTY, |e| e.bounds)).collect();
        join(&mut boxes)?;
        for (i, (extent, bounds)) in extents.iter_mut().zip(boxes).enumerate() {
            if let Some(extent) = extent {
                extent.bounds = bounds;
                extent.triangles = primitives.get(i).map_or(0, |&n| n as usize);
            }
        }
        let choice = members_among(instances, geometries.len(), |g| extents[g]);
        let frame_of = |(g, extent): (&Geometry, &Option<MeshExtent>)| match (g, extent) {
            (Geometry::Shape(s), _) => LocalFrame { center: s.origin(), scale: 1.0 },
            (_, Some(e)) => LocalFrame::choose(e.origin, e.bounds),
            (_, None) => unreachable!("every geometry that is no shape has an extent"),
        };
        let mut frames: Vec<LocalFrame> = geometries.iter().zip(&extents).map(frame_of).collect();

        // ---- Bounds of the trees of geometries alone, which decide the origin.
        let members: Vec<usize> =
            choice.iter().flat_map(|c| &c.instances).map(|&i| geometry_of(instances, i)).collect();
        let mut is_member = vec![false; geometries.len()];
        members.iter().for_each(|&g| is_member[g] = true);
        let alone: Vec<usize> = (0..geometries.len()).filter(|&g| !is_member[g]).collect();
        let bounds_of = |&g: &usize| tree_bounds(&geometries[g], &frames[g]);
        let mut boxes: Vec<Aabb> = alone.iter().map(bounds_of).collect();
        if !boxes.is_empty() {
            join(&mut boxes)?;
        }
        let mut reaches: Vec<Option<Aabb>> = vec![None; geometries.len()];
        for (&g, b) in alone.iter().zip(boxes) {
            reaches[g] = Some(b);
        }
        let spaces: Vec<Option<(LocalFrame, Aabb)>> =
            frames.iter().zip(&reaches).map(|(&frame, reach)| Some((frame, (*reach)?))).collect();
        let origin = choose_origin(instances, |g| spaces[g], choice.as_ref());

        // ---- Bounds of the meshes that share a tree, in its space.
        let group = choice.map(|c: GroupChoice| (c.frame(origin), c.instances));
        let mut group_reach = Aabb::EMPTY;
        if let Some((frame, _)) = &group {
            let mut boxes: Vec<Aabb> =
                members.iter().map(|&g| tree_bounds(&geometries[g], frame)).collect();
            join(&mut boxes)?;
            for (&g, b) in members.iter().zip(boxes) {
                (frames[g], reaches[g]) = (*frame, Some(b));
                group_reach = group_reach.union(b);
            }
        }
        let geometries: Vec<(LocalFrame, Aabb)> = frames
            .into_iter()
            .zip(reaches)
            .map(|(frame, reach)| (frame, reach.unwrap_or(Aabb::EMPTY)))
            .collect();
        let group =
            group.map(|(frame, instances)| GroupLayout { instances, frame, reach: group_reach });

        // ---- Bounds of everything, as the upper level has them.
        let placed = instances.iter().filter(|i| !is_member[i.geometry]).filter_map(|i| {
            let (frame, reach) = geometries[i.geometry];
            Placement::new(i.geometry, &i.world_from_object, &frame, [reach; 2], origin)
        });
        let of_group = group.as_ref().and_then(|g| super::mesh_group::place_group(g, origin));
        let bounds = placed
            .chain(of_group)
            .map(|p| p.bounds())
            .filter(|b| !b.is_empty() && b.min.is_finite() && b.max.is_finite())
            .fold(Aabb::EMPTY, Aabb::union);
        Ok(GlobalLayout { origin, bounds, geometries, group })
    }
}

fn geometry_of(instances: &[Instance], instance: u32) -> usize {
    instances[instance as usize].geometry
}

/// Bounds of the boxes that a tree over a geometry in this space is built from.
fn tree_bounds(geometry: &Geometry, frame: &LocalFrame) -> Aabb {
    let n = geometry.num_primitives() as u32;
    let join = |of: &(dyn Fn(u32) -> Aabb + Sync)| {
        (0..n).into_par_iter().with_min_len(1 << 14).map(of).reduce(|| Aabb::EMPTY, Aabb::union)
    };
    match geometry {
        Geometry::Mesh(mesh) => {
            let writer = TriWriter::new(mesh.triangles(), frame, 0);
            join(&|i| writer.bounds(i))
        }
        Geometry::Shape(shape) => join(&|i| {
            let b = shape.bounds(i);
            let usable = !b.is_empty() && b.min.is_finite() && b.max.is_finite();
            if usable { widened(b) } else { Aabb::EMPTY }
        }),
        // Their arrays are gone: the builder refuses them by name.
        Geometry::Slices(_) => Aabb::EMPTY,
    }
}
