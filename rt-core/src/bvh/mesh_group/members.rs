//! Which instances share one tree, and in which coordinates.

use crate::bvh::geometry::{Geometry, Instance, MeshExtent};
use crate::bvh::layout::local_frame::LocalFrame;
use crate::math::Aabb;
use glam::{DAffine3, DVec3};
use rayon::prelude::*;

/// A mesh smaller than this part of the group keeps a tree and a local space of its own. Seen from
/// as far as the group is large, f32 coordinates in the group's space are coarser than 2⁻¹² of such
/// a mesh.
const SMALLEST_SHARE: f64 = 1.0 / 4096.0;

/// The members of a group and their bounds.
pub(in crate::bvh) struct GroupChoice {
    /// Instances, ascending.
    pub(in crate::bvh) instances: Vec<u32>,
    /// Corners of the bounds of each member, in world space.
    pub(in crate::bvh) bounds: Vec<[DVec3; 2]>,
}

/// What a group has chosen from the bounds of all its members.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::bvh) struct GroupLayout {
    pub(in crate::bvh) instances: Vec<u32>,
    pub(in crate::bvh) frame: LocalFrame,
    pub(in crate::bvh) reach: Aabb,
}

/// Instances of meshes that are used once and not transformed; `None` for fewer than two. Others
/// would need a copy of their triangles for each instance, or a new tree when their transform
/// changes.
pub(in crate::bvh) fn choose_members(
    geometries: &[Geometry],
    instances: &[Instance],
) -> Option<GroupChoice> {
    members_among(instances, geometries.len(), |g| geometries[g].mesh_extent())
}

/// The same for `geometries` geometries of which `extent_of` tells the extents; `None` for shapes.
/// It is asked once about each geometry that may be a member.
pub(in crate::bvh) fn members_among(
    instances: &[Instance],
    geometries: usize,
    extent_of: impl Fn(usize) -> Option<MeshExtent> + Sync,
) -> Option<GroupChoice> {
    if instances.len() < 2 {
        return None;
    }
    let mut uses = vec![0u32; geometries];
    for i in instances {
        uses[i.geometry] += 1;
    }
    let bounds_of = |(i, instance): (usize, &Instance)| {
        if uses[instance.geometry] != 1 || instance.world_from_object != DAffine3::IDENTITY {
            return None;
        }
        let mesh = extent_of(instance.geometry)?;
        let b = mesh.bounds;
        let corners = [b.min, b.max].map(|p| p.as_dvec3() + mesh.origin);
        let usable = !b.is_empty() && mesh.triangles > 0;
        (usable && corners.iter().all(|p| p.is_finite())).then_some((i as u32, corners))
    };
    let mut found: Vec<(u32, [DVec3; 2])> =
        instances.par_iter().enumerate().filter_map(bounds_of).collect();
    let size_of = |[lo, hi]: &[DVec3; 2]| (*hi - *lo).max_element();
    let whole = found
        .iter()
        .map(|(_, b)| *b)
        .reduce(|[lo, hi], [a, b]| [lo.min(a), hi.max(b)])
        .map_or(0.0, |b| size_of(&b));
    found.retain(|(_, b)| size_of(b) >= SMALLEST_SHARE * whole);
    if found.len() < 2 {
        return None;
    }
    let (instances, bounds) = found.into_iter().unzip();
    Some(GroupChoice { instances, bounds })
}

impl GroupChoice {
    /// The members of the whole world, for a part of it.
    pub(in crate::bvh) fn of_layout(layout: &GroupLayout) -> GroupChoice {
        GroupChoice { instances: layout.instances.clone(), bounds: Vec::new() }
    }

    /// The space of the group: render space with `origin`, scaled when the group is tiny or huge.
    pub(in crate::bvh) fn frame(&self, origin: DVec3) -> LocalFrame {
        let reach = self.bounds.iter().flatten().map(|p| (*p - origin).abs().max_element());
        LocalFrame::around(origin, reach.fold(0.0, f64::max) as f32)
    }
}
