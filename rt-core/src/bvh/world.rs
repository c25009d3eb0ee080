//! The two-level acceleration structure for tracing rays: instances of geometries.

mod build;
mod compact_members;

use super::blas::Blas;
use super::build::UNWATCHED;
use super::entry::Entry;
use super::geometry::{Geometry, Instance};
use super::instance_filter::InstanceFilter;
use super::layout::wide::{ChildRef, Unit, WideBvh};
use super::mesh_group::MeshGroup;
use super::options::{BuildOptions, BuildReport, Robustness};
use super::placement::{ORDINARY_LENGTHS, Placement};
use super::query::{AnyHit, ClosestHit, FastTest, TriangleTest, WatertightTest};
use super::render_space::RenderSpace;
use super::top_level::{TopLevel, build_top_level};
use crate::bvh::traverse::single::{LeafTest, RaySetup, inflate_t, traverse};
use crate::bvh::traverse::tree_view::TreeView;
use crate::math::{Aabb, exp2i, max_abs};
use crate::ray::{Hit, Ray};
pub(in crate::bvh) use build::BuildRequest;
use fearless_simd::{Level, Simd, dispatch};
use glam::{DVec3, Vec3};
use std::marker::PhantomData;
use std::sync::Arc;

/// Instances of geometries with their acceleration structures.
pub struct World {
    pub(super) geometries: Vec<Geometry>,
    pub(super) instances: Vec<Instance>,
    origin: DVec3,
    bounds: Aabb,
    report: BuildReport,
    /// Shared with worlds made from this one ([`World::build_sharing`]).
    pub(super) blas: Vec<Arc<Blas>>,
    pub(super) options: BuildOptions,
    pub(super) placements: Vec<Placement>,
    /// The meshes that share one tree.
    pub(super) group: Option<Arc<MeshGroup>>,
    /// Whether meshes could share a tree, but it would be too deep or too large.
    pub(super) group_is_impossible: bool,
    /// The upper level: instances by number, the group by the number after the last instance.
    pub(super) tlas: WideBvh,
    /// The entry of the upper level when it has only one.
    pub(super) only: Option<u32>,
    /// All entries when they are few.
    pub(super) few: Vec<u32>,
    pub(super) robustness: Robustness,
    pub(crate) level: Level,
}

impl World {
    /// The first shape that could not read its data, by its number, and what it says
    /// ([`crate::shapes::Shape::failure`]). Answers since then may be wrong.
    pub fn failure(&self) -> Option<(usize, String)> {
        self.geometries.iter().enumerate().find_map(|(number, geometry)| match geometry {
            Geometry::Shape(shape) => shape.failure().map(|reason| (number, reason)),
            Geometry::Mesh(_) | Geometry::Slices(_) => None,
        })
    }

    /// Rebuilds the upper level after a geometry has changed. Render space may have another origin.
    pub(super) fn rebuild_top_level(&mut self, origin: DVec3) {
        let notes = &mut self.report.notes;
        let group = self.group.as_deref();
        let placed = build_top_level(&self.instances, &self.blas, group, origin, notes, &UNWATCHED);
        let TopLevel { placements, tlas, bounds, only, few } =
            placed.expect("the build accepted these transforms");
        self.report.primitives = self.blas.iter().map(|b| b.primitives).sum();
        self.report.skipped = self.blas.iter().map(|b| b.skipped).sum();
        (self.origin, self.bounds) = (origin, bounds);
        (self.placements, self.tlas) = (placements, tlas);
        (self.only, self.few) = (only, few);
    }

    /// Entry `id` of the upper level.
    #[inline]
    pub(super) fn entry(&self, id: u32) -> Entry<'_> {
        match (self.placements.get(id as usize), &self.group) {
            (None, Some(group)) => Entry::Group(group),
            _ => {
                let placement = &self.placements[id as usize];
                let blas = &self.blas[placement.geometry()];
                Entry::Instance { number: id, placement, blas }
            }
        }
    }

    /// The entry in a leaf of the upper level; `None` when `filter` does not allow it.
    #[inline(always)]
    pub(super) fn entry_of_leaf<'w>(
        &'w self,
        units: &'w [Unit],
        leaf: ChildRef,
        filter: InstanceFilter<'_>,
    ) -> Option<Entry<'w>> {
        let (placement, number) = Placement::of_leaf(units, leaf);
        if !self.allows(filter, number) {
            return None;
        }
        match &self.group {
            Some(group) if number as usize >= self.placements.len() => Some(Entry::Group(group)),
            _ => Some(Entry::Instance {
                number,
                placement,
                blas: self.blas.get(placement.geometry())?,
            }),
        }
    }

    /// The entry of the upper level when it has only one.
    #[inline]
    pub(super) fn only_entry(&self) -> Option<Entry<'_>> {
        self.only.map(|id| self.entry(id))
    }

    /// Whether `filter` allows entry `id` of the upper level. The group filters its own members.
    #[inline]
    pub(super) fn allows(&self, filter: InstanceFilter<'_>, id: u32) -> bool {
        id as usize >= self.placements.len() || filter.has(id as usize)
    }

    /// World position of render space's origin: `world = origin + render`.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Bounds of everything, in render space; empty for an empty world.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The geometries as given.
    pub fn geometries(&self) -> &[Geometry] {
        &self.geometries
    }

    /// The instances as given.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// Report on the build.
    pub fn report(&self) -> &BuildReport {
        &self.report
    }

    /// Robustness mode of this world.
    pub fn robustness(&self) -> Robustness {
        self.robustness
    }

    /// Render-space point of a world point.
    pub fn render_from_world(&self, p: DVec3) -> Vec3 {
        self.render_space().point(p)
    }

    /// A render-space ray from f64 world coordinates. An origin far outside the bounds is first
    /// moved along the ray, in f64, to the first point where the ray can reach them, so that a
    /// camera 10⁹ away loses no accuracy. Returns the ray and how far its origin was moved (add it
    /// to a hit's `t`). `dir` need not be of unit length.
    pub fn ray_from_world(&self, origin: DVec3, dir: DVec3) -> (Ray, f64) {
        self.render_space().ray(origin, dir)
    }

    /// The shift to render space, to be had once for many rays or points.
    pub fn render_space(&self) -> RenderSpace {
        RenderSpace::new(self.origin, self.bounds)
    }

    /// The closest hit along `ray`. Ties (coplanar layers) go to the lowest instance, then the
    /// lowest primitive.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        if !ray.is_valid() {
            return None;
        }
        let mut room = Ray::UNSET;
        let (ray, unit) = with_ordinary_length(ray, &mut room);
        let hit = match self.robustness {
            Robustness::Fast => {
                dispatch!(
                    self.level,
                    simd => self.closest_in::<_, FastTest>(simd, ray, InstanceFilter::All)
                )
            }
            Robustness::Watertight => {
                dispatch!(
                    self.level,
                    simd => self.closest_in::<_, WatertightTest>(simd, ray, InstanceFilter::All)
                )
            }
        };
        hit.map(|h| Hit { t: h.t * unit, ..h })
    }

    /// Whether anything lies within `[t_min, t_max)` of `ray`.
    pub fn occluded(&self, ray: &Ray) -> bool {
        if !ray.is_valid() {
            return false;
        }
        let mut room = Ray::UNSET;
        let (ray, _) = with_ordinary_length(ray, &mut room);
        match self.robustness {
            Robustness::Fast => {
                dispatch!(
                    self.level,
                    simd => self.occluded_in::<_, FastTest>(simd, ray, InstanceFilter::All)
                )
            }
            Robustness::Watertight => {
                dispatch!(
                    self.level,
                    simd => self.occluded_in::<_, WatertightTest>(simd, ray, InstanceFilter::All)
                )
            }
        }
    }

    /// The closest hit with an instance of `filter`.
    pub(crate) fn closest_in<S: Simd, T: TriangleTest>(
        &self,
        simd: S,
        ray: &Ray,
        filter: InstanceFilter<'_>,
    ) -> Option<Hit> {
        let mut leaves = InstanceClosest::<T>::new(self, ray, filter);
        match self.only {
            Some(id) if !self.allows(filter, id) => return None,
            Some(id) => {
                let only = self.entry(id);
                if only.placement().accepts(ray) {
                    return only.closest::<S, T>(simd, ray, filter);
                }
                let mut t_max = ray.t_max;
                leaves.try_entry(simd, only, &mut t_max);
            }
            None => {
                let setup = RaySetup::new(ray);
                traverse(simd, &TreeView::all(&self.tlas), &setup, ray.t_max, &mut leaves);
            }
        }
        leaves.best
    }

    /// Whether an instance of `filter` blocks the ray.
    pub(crate) fn occluded_in<S: Simd, T: TriangleTest>(
        &self,
        simd: S,
        ray: &Ray,
        filter: InstanceFilter<'_>,
    ) -> bool {
        if let Some(id) = self.only {
            return self.allows(filter, id) && occludes::<S, T>(simd, self.entry(id), ray, filter);
        }
        let mut leaves = InstanceAny::<T>::new(self, ray, filter);
        let setup = RaySetup::new(ray);
        traverse(simd, &TreeView::all(&self.tlas), &setup, ray.t_max, &mut leaves);
        leaves.found
    }
}

/// Whether an entry blocks a ray in render space.
#[inline(always)]
fn occludes<S: Simd, T: TriangleTest>(
    simd: S,
    entry: Entry<'_>,
    ray: &Ray,
    filter: InstanceFilter<'_>,
) -> bool {
    let mut local = Ray::UNSET;
    entry.placement().enter(ray, ray.t_max, &mut local);
    local.t_max > local.t_min && entry.occluded::<S, T>(simd, &local, filter)
}

/// The ray itself when its direction is neither tiny nor huge; else a copy in `room`, scaled by a
/// power of two. The second value converts the scaled ray's `t` back.
#[inline]
pub(super) fn with_ordinary_length<'r>(ray: &'r Ray, room: &'r mut Ray) -> (&'r Ray, f32) {
    let m = max_abs(ray.dir);
    if ORDINARY_LENGTHS.contains(&m) {
        return (ray, 1.0);
    }
    let e = (m.log2().round() as i32).clamp(-125, 125);
    let k = exp2i(-e);
    // The smallest x with x · k >= t: quotients that underflow still keep the range half-open.
    let limit = |t: f32| {
        let x = t / k;
        if x * k < t { x.next_up() } else { x }
    };
    // Hits whose t overflows f32 are ignored.
    *room = Ray {
        dir: ray.dir * k,
        t_min: limit(ray.t_min),
        t_max: limit(ray.t_max.min(f32::MAX)),
        ..*ray
    };
    (room, k)
}

/// The closest hit of one ray among the entries that it meets.
pub(super) struct InstanceClosest<'w, T: TriangleTest> {
    world: &'w World,
    ray: &'w Ray,
    filter: InstanceFilter<'w>,
    pub(super) best: Option<Hit>,
    test: PhantomData<T>,
}

impl<'w, T: TriangleTest> InstanceClosest<'w, T> {
    pub(super) fn new(world: &'w World, ray: &'w Ray, filter: InstanceFilter<'w>) -> Self {
        InstanceClosest { world, ray, filter, best: None, test: PhantomData }
    }

    #[inline(always)]
    fn try_entry<S: Simd>(&mut self, simd: S, entry: Entry<'_>, skip_t: &mut f32) {
        // One ulp past the best so far: a tie may go to this entry.
        let limit = self.best.map_or(self.ray.t_max, |b| b.t.next_up());
        let mut local = Ray::UNSET;
        let moved = entry.placement().enter(self.ray, limit, &mut local);
        if local.t_max <= local.t_min {
            return;
        }
        let Some(hit) = entry.closest::<S, T>(simd, &local, self.filter) else { return };
        let t = if moved == 0.0 { hit.t } else { (hit.t as f64 + moved) as f32 };
        let better = self.best.is_none_or(|b| t < b.t || (t == b.t && hit.instance < b.instance));
        if better {
            self.best = Some(Hit { t, ..hit });
            *skip_t = inflate_t(t);
        }
    }
}

impl<S: Simd, T: TriangleTest> LeafTest<S> for InstanceClosest<'_, T> {
    type Query = ClosestHit;

    #[inline(always)]
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, skip_t: &mut f32) -> bool {
        if let Some(entry) = self.world.entry_of_leaf(units, leaf, self.filter) {
            self.try_entry(simd, entry, skip_t);
        }
        false
    }
}

/// Whether an entry blocks one ray.
pub(super) struct InstanceAny<'w, T: TriangleTest> {
    world: &'w World,
    ray: &'w Ray,
    filter: InstanceFilter<'w>,
    pub(super) found: bool,
    test: PhantomData<T>,
}

impl<'w, T: TriangleTest> InstanceAny<'w, T> {
    pub(super) fn new(world: &'w World, ray: &'w Ray, filter: InstanceFilter<'w>) -> Self {
        InstanceAny { world, ray, filter, found: false, test: PhantomData }
    }
}

impl<S: Simd, T: TriangleTest> LeafTest<S> for InstanceAny<'_, T> {
    type Query = AnyHit;

    #[inline(always)]
    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, _: &mut f32) -> bool {
        let entry = self.world.entry_of_leaf(units, leaf, self.filter);
        self.found = entry.is_some_and(|e| occludes::<S, T>(simd, e, self.ray, self.filter));
        self.found
    }
}
