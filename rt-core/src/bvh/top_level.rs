//! The upper level of a world: where the instances are in render space, and a tree over them.

use super::blas::Blas;
use super::build::{LeafCapacity, PrimRef, Progress, build_wide};
use super::error::BuildError;
use super::geometry::Instance;
use super::layout::local_frame::LocalFrame;
use super::layout::wide::{LeafWriter, Unit, WideBvh};
use super::mesh_group::{GroupChoice, MeshGroup};
use super::options::BuildQuality;
use super::placement::{PLACEMENT_UNITS, Placement};
use super::turned_bounds::Outlines;
use crate::math::Aabb;
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// The upper level.
pub(super) struct TopLevel {
    pub(super) placements: Vec<Placement>,
    /// Instances by number, and the group by the number after the last instance.
    pub(super) tlas: WideBvh,
    /// The boxes around the geometries' boxes: a part knows those of the whole without its trees.
    pub(super) bounds: Aabb,
    /// The entry when there is only one.
    pub(super) only: Option<u32>,
    /// All entries when there are at most [`MOST_IN_TURN`].
    pub(super) few: Vec<u32>,
}

/// Blocks of rays in any direction try at most this many entries one after the other. Ray by ray
/// through the upper level, they would share no work.
const MOST_IN_TURN: usize = 4;

/// Leaves of one entry each, with its placement. An instance is entered only if a ray meets its own
/// box: with four in a leaf, a ray was moved into the space of all four where it met the box around
/// them.
struct EntryWriter<'a> {
    placements: &'a [Placement],
    group: Option<&'a MeshGroup>,
}

impl EntryWriter<'_> {
    fn placement(&self, id: usize) -> Option<&Placement> {
        self.placements.get(id).or_else(|| self.group.map(|g| &g.placement))
    }
}

impl LeafWriter for EntryWriter<'_> {
    const UNITS: usize = PLACEMENT_UNITS;
    const CAPACITY: usize = 1;

    fn write(&self, prims: &[u32], out: &mut [Unit]) {
        for &id in prims {
            if let Some(placement) = self.placement(id as usize) {
                placement.write(id, out);
            }
        }
    }
}

/// Places the instances in render space, whose zero is at `origin` in the world.
pub(super) fn build_top_level(
    instances: &[Instance],
    blas: &[Arc<Blas>],
    group: Option<&MeshGroup>,
    origin: DVec3,
    notes: &mut Vec<String>,
    progress: &Progress<'_>,
) -> Result<TopLevel, BuildError> {
    let outlines = Outlines::new(blas.len());
    let place_one = |(i, inst): (usize, &Instance)| {
        let b = &blas[inst.geometry];
        let (bounds, to_world) = ([b.reach(), b.bounds()], &inst.world_from_object);
        let mut placement = Placement::new(inst.geometry, to_world, &b.frame, bounds, origin)
            .ok_or(BuildError::SingularTransform {
                instance: i,
                determinant: to_world.matrix3.determinant(),
            })?;
        let around = placement.bounds();
        if let Some(outline) = outlines.of_turned(inst, b) {
            placement.tighten(outline, to_world, &b.frame, origin);
        }
        Ok((placement, around))
    };
    // Of several errors, the first in order is returned, whichever thread finds its error first.
    let placed: Vec<_> =
        instances.par_iter().enumerate().with_min_len(1024).map(place_one).collect();
    let placed = placed.into_iter().collect::<Result<Vec<_>, BuildError>>()?;
    let (placements, around): (Vec<_>, Vec<_>) = placed.into_iter().unzip();
    let alone = |p: &Placement| blas[p.geometry()].bvh().is_some();
    let entries = placements.iter().enumerate().filter(|(_, p)| alone(p));
    let entries = entries.chain(group.map(|g| (placements.len(), &g.placement)));
    let refs: Vec<PrimRef> = entries
        .filter(|(_, p)| {
            let b = p.bounds();
            !b.is_empty() && b.min.is_finite() && b.max.is_finite()
        })
        .map(|(id, p)| PrimRef::new(p.bounds(), id as u32))
        .collect();
    let of_group = group.map_or(Aabb::EMPTY, |g| g.placement.bounds());
    let around = |r: &PrimRef| around.get(r.id() as usize).copied().unwrap_or(of_group);
    let bounds = refs.iter().map(around).fold(Aabb::EMPTY, Aabb::union);
    let only = match (instances, refs.as_slice()) {
        ([_], _) => Some(0),
        (_, [only]) => Some(only.id()),
        _ => None,
    };
    let few = if refs.len() <= MOST_IN_TURN {
        refs.iter().map(PrimRef::id).collect()
    } else {
        Vec::new()
    };
    let mut config = BuildQuality::Balanced.config();
    config.sah.leaves = LeafCapacity::One;
    let writer = EntryWriter { placements: &placements, group };
    let tlas = build_wide(refs, &writer, config, notes, progress)?;
    Ok(TopLevel { placements, tlas, bounds, only, few })
}

/// The origin of render space: zero, or the centre of the world's bounds when they are more than
/// four times their size away from zero. A single geometry without rotation gets its own centre, so
/// that its local space and render space coincide.
///
/// `space_of` gives the local space of a geometry and its bounds there; `None` for members of the
/// group.
pub(super) fn choose_origin(
    instances: &[Instance],
    space_of: impl Fn(usize) -> Option<(LocalFrame, Aabb)> + Sync,
    group: Option<&GroupChoice>,
) -> DVec3 {
    if let [only] = instances
        && let Some((frame, _)) = space_of(only.geometry)
        && only.world_from_object.matrix3 == DMat3::IDENTITY
        && only.world_from_object.is_finite()
    {
        return frame.center + only.world_from_object.translation;
    }
    let join = |(lo, hi): (DVec3, DVec3), (a, b): (DVec3, DVec3)| (lo.min(a), hi.max(b));
    let nothing = || (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let of_instance = |inst: &Instance| {
        let Some((frame, bounds)) = space_of(inst.geometry) else { return nothing() };
        if bounds.is_empty() {
            return nothing();
        }
        let of_corner = |c: Vec3| {
            let object = c.as_dvec3() / frame.scale + frame.center;
            let p = inst.world_from_object.transform_point3(object);
            (p, p)
        };
        bounds.corners().map(of_corner).into_iter().fold(nothing(), join)
    };
    // Chunks of a fixed size, merged in order: the sign of a zero does not depend on the threads.
    let pieces: Vec<_> = instances
        .par_chunks(1024)
        .map(|piece| piece.iter().map(of_instance).fold(nothing(), join))
        .collect();
    let members = group.iter().flat_map(|g| &g.bounds).map(|&[lo, hi]| (lo, hi));
    let (lo, hi) = pieces.into_iter().chain(members).fold(nothing(), join);
    let center = 0.5 * lo + 0.5 * hi;
    let far = center.abs().max_element() > 4.0 * (hi - lo).max_element();
    if center.is_finite() && far { center.as_vec3().as_dvec3() } else { DVec3::ZERO }
}
