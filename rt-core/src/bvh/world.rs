//! The two-level acceleration structure for tracing rays: instances of geometries.

use super::blas::{Blas, IdWriter, leaf_primitive_ids};
use super::build::{MAX_PRIMS, PrimRef, build_wide};
use super::error::BuildError;
use super::layout::wide::{ChildRef, Unit, WideBvh};
use super::options::{BuildOptions, BuildQuality, BuildReport, Robustness};
use super::partition::{GlobalLayout, blas_of};
use super::placement::{ORDINARY_LENGTHS, Placement, distance_to_sphere};
use super::query::{AnyHit, ClosestHit, FastTest, TriangleTest, WatertightTest};
use crate::bvh::traverse::single::{LeafTest, RaySetup, inflate_t, traverse};
use crate::math::{Aabb, exp2i, max_abs};
use crate::mesh::{MeshError, TriMesh};
use crate::ray::{Hit, Ray};
use crate::shapes::Shape;
use crate::simd::SimdLevel;
use fearless_simd::{Level, Simd, dispatch};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::marker::PhantomData;
use std::sync::Arc;
use std::time::Instant;

/// Geometry that rays can hit, shared between instances.
#[derive(Clone)]
pub enum Geometry {
    /// Triangles.
    Mesh(Arc<TriMesh>),
    /// Spheres, tubes, isosurfaces, user-defined geometry.
    Shape(Arc<dyn Shape>),
}

impl Geometry {
    /// Address of the shared data. It is the same for two clones of one geometry and for two
    /// appearances of one shape, and different for any two others that are both alive.
    fn address(&self) -> usize {
        let of_shape = |s: &Arc<dyn Shape>| Arc::as_ptr(s) as *const () as usize;
        match self {
            Geometry::Mesh(m) => Arc::as_ptr(m) as usize,
            Geometry::Shape(s) => s.tree_of().as_ref().map_or_else(|| of_shape(s), of_shape),
        }
    }

    /// Number of triangles of a mesh, or of primitives of a shape.
    pub fn num_primitives(&self) -> usize {
        match self {
            Geometry::Mesh(m) => m.indices.len(),
            Geometry::Shape(s) => s.num_primitives(),
        }
    }

    /// Whether geometry `index` can be built.
    fn check(&self, index: usize) -> Result<(), BuildError> {
        let Geometry::Mesh(mesh) = self else { return Ok(()) };
        let error = |source| BuildError::Mesh { geometry: index, source };
        mesh.check().map_err(error)?;
        if mesh.indices.len() >= MAX_PRIMS {
            let found = mesh.indices.len();
            return Err(error(MeshError::TooLarge {
                what: "triangles",
                found,
                limit: MAX_PRIMS - 1,
            }));
        }
        Ok(())
    }
}

/// A geometry placed in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instance {
    /// Index of the geometry.
    pub geometry: usize,
    /// Object to world; may mirror and scale unevenly, must be invertible.
    pub world_from_object: DAffine3,
}

/// Which instances rays can hit.
#[derive(Debug, Clone, Copy)]
pub(crate) enum InstanceFilter<'a> {
    /// All instances.
    All,
    /// Marked instances. A missing mark counts as not set.
    #[cfg_attr(not(feature = "render"), allow(dead_code, reason = "only the renderer marks some"))]
    Marked(&'a [bool]),
    /// Unmarked instances.
    #[cfg_attr(not(feature = "render"), allow(dead_code, reason = "only the renderer marks some"))]
    Unmarked(&'a [bool]),
}

impl InstanceFilter<'_> {
    #[inline(always)]
    pub(super) fn has(self, instance: usize) -> bool {
        match self {
            InstanceFilter::All => true,
            InstanceFilter::Marked(marks) => marks.get(instance).is_some_and(|m| *m),
            InstanceFilter::Unmarked(marks) => !marks.get(instance).is_some_and(|m| *m),
        }
    }
}

/// Instances of geometries with their acceleration structures.
pub struct World {
    pub(super) geometries: Vec<Geometry>,
    instances: Vec<Instance>,
    origin: DVec3,
    bounds: Aabb,
    report: BuildReport,
    /// Shared with worlds made from this one ([`World::build_sharing`]).
    pub(super) blas: Vec<Arc<Blas>>,
    pub(super) options: BuildOptions,
    pub(super) placements: Vec<Placement>,
    pub(super) tlas: WideBvh,
    pub(super) robustness: Robustness,
    pub(super) level: Level,
}

impl World {
    /// Builds the acceleration structures.
    pub fn build(
        geometries: Vec<Geometry>,
        instances: Vec<Instance>,
        options: &BuildOptions,
    ) -> Result<World, BuildError> {
        World::build_sharing(geometries, instances, options, None)
    }

    /// As [`World::build`], but reuses the acceleration structure of every geometry that `previous`
    /// also has (the same [`Arc`], at any index). When one of five hundred meshes changes, or only
    /// transforms do, the others cost nothing. If the options differ from those of `previous`,
    /// everything is rebuilt. The hits equal those of a world built from scratch (after a
    /// [`World::refit`] of `previous`: those of the refitted world).
    pub fn build_sharing(
        geometries: Vec<Geometry>,
        instances: Vec<Instance>,
        options: &BuildOptions,
        previous: Option<&World>,
    ) -> Result<World, BuildError> {
        World::build_in_layout(geometries, instances, options, None, previous)
    }

    /// Builds a world, or a part of one. Reuses the structures of `previous` for geometries that
    /// both have.
    pub(super) fn build_in_layout(
        geometries: Vec<Geometry>,
        instances: Vec<Instance>,
        options: &BuildOptions,
        whole: Option<&GlobalLayout>,
        previous: Option<&World>,
    ) -> Result<World, BuildError> {
        let start = Instant::now();
        let mut phases = Vec::new();
        let level = SimdLevel::resolve(options.simd)?;
        for (i, inst) in instances.iter().enumerate() {
            if inst.geometry >= geometries.len() {
                let count = geometries.len();
                return Err(BuildError::NoSuchGeometry {
                    instance: i,
                    geometry: inst.geometry,
                    count,
                });
            }
        }
        let known = previous.filter(|w| w.options == *options).map(World::trees_by_address);
        for (i, g) in geometries.iter().enumerate() {
            g.check(i)?;
        }
        let build = |i: usize| {
            let g = &geometries[i];
            match (known.as_ref().and_then(|k| k.get(&g.address())), g) {
                (Some(tree), Geometry::Mesh(_)) => Arc::clone(tree),
                (Some(tree), Geometry::Shape(s)) => Blas::with_shape(tree, s),
                (None, _) => Arc::new(blas_of(i, g, options, whole)),
            }
        };
        let blas = build_in_parallel(&geometries, build);
        phases.push(("geometries", start.elapsed()));

        let mut notes: Vec<String> = blas
            .iter()
            .enumerate()
            .flat_map(|(i, b)| b.notes.iter().map(move |n| format!("geometry {i}: {n}")))
            .collect();
        let TopLevel { origin, placements, tlas } =
            build_top_level(&instances, &blas, whole, &mut notes)?;
        phases.push(("instances", start.elapsed() - phases[0].1));
        let report = BuildReport {
            total: start.elapsed(),
            phases,
            depth: blas.iter().map(|b| b.bvh().depth).max().unwrap_or(0),
            primitives: blas.iter().map(|b| b.primitives).sum(),
            skipped: blas.iter().map(|b| b.skipped).sum(),
            bytes: (tlas.units.len() + blas.iter().map(|b| b.bvh().units.len()).sum::<usize>())
                * size_of::<Unit>(),
            notes,
        };
        Ok(World {
            geometries,
            instances,
            origin,
            bounds: whole.map_or(tlas.bounds, |w| w.bounds),
            report,
            blas,
            placements,
            tlas,
            options: *options,
            robustness: options.robustness,
            level,
        })
    }

    /// A world of one mesh, without a transform.
    pub fn from_mesh(
        mesh: impl Into<Arc<TriMesh>>,
        options: &BuildOptions,
    ) -> Result<World, BuildError> {
        let instance = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
        World::build(vec![Geometry::Mesh(mesh.into())], vec![instance], options)
    }

    fn trees_by_address(&self) -> HashMap<usize, &Arc<Blas>> {
        self.geometries.iter().map(Geometry::address).zip(&self.blas).collect()
    }

    /// Rebuilds the upper level after a geometry has changed.
    pub(super) fn rebuild_top_level(&mut self) {
        let placed = build_top_level(&self.instances, &self.blas, None, &mut self.report.notes);
        let TopLevel { origin, placements, tlas } =
            placed.expect("the build accepted these transforms");
        self.report.primitives = self.blas.iter().map(|b| b.primitives).sum();
        self.report.skipped = self.blas.iter().map(|b| b.skipped).sum();
        (self.origin, self.bounds) = (origin, tlas.bounds);
        (self.placements, self.tlas) = (placements, tlas);
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
        (p - self.origin).as_vec3()
    }

    /// A render-space ray from f64 world coordinates. An origin far outside the bounds is first
    /// moved along the ray, in f64, to the first point where the ray can reach them, so that a
    /// camera 10⁹ away loses no accuracy. Returns the ray and how far its origin was moved (add it
    /// to a hit's `t`). `dir` need not be of unit length.
    pub fn ray_from_world(&self, origin: DVec3, dir: DVec3) -> (Ray, f64) {
        let o = origin - self.origin;
        let moved = if self.bounds.is_empty() {
            0.0
        } else {
            let (center, radius) = (self.bounds.center().as_dvec3(), self.bounds.radius() as f64);
            let far = (o - center).abs().max_element() > 64.0 * radius;
            if far { distance_to_sphere(o, dir, center, radius) } else { 0.0 }
        };
        (Ray::new((o + dir * moved).as_vec3(), dir.as_vec3()), moved)
    }

    /// The closest hit along `ray`. Ties (coplanar layers) go to the lowest instance, then the
    /// lowest primitive.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        if !ray.is_valid() {
            return None;
        }
        let (ray, unit) = with_ordinary_length(ray);
        let hit = match self.robustness {
            Robustness::Fast => {
                dispatch!(
                    self.level,
                    simd => self.closest_in::<_, FastTest>(simd, &ray, InstanceFilter::All)
                )
            }
            Robustness::Watertight => {
                dispatch!(
                    self.level,
                    simd => self.closest_in::<_, WatertightTest>(simd, &ray, InstanceFilter::All)
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
        let (ray, _) = with_ordinary_length(ray);
        match self.robustness {
            Robustness::Fast => {
                dispatch!(
                    self.level,
                    simd => self.occluded_in::<_, FastTest>(simd, &ray, InstanceFilter::All)
                )
            }
            Robustness::Watertight => {
                dispatch!(
                    self.level,
                    simd => self.occluded_in::<_, WatertightTest>(simd, &ray, InstanceFilter::All)
                )
            }
        }
    }

    /// The closest hit with an instance of `filter`. With only one instance, the filter is ignored.
    pub(crate) fn closest_in<S: Simd, T: TriangleTest>(
        &self,
        simd: S,
        ray: &Ray,
        filter: InstanceFilter<'_>,
    ) -> Option<Hit> {
        if let [only] = self.placements.as_slice()
            && only.accepts(ray)
        {
            let c = self.blas[only.geometry].closest::<S, T>(simd, ray);
            return c.found.then_some(Hit { t: c.t, u: c.u, v: c.v, prim: c.prim, instance: 0 });
        }
        let mut leaves = InstanceClosest::<T>::new(self, *ray, filter);
        match self.placements.len() {
            0 => return None,
            1 => {
                let mut t_max = ray.t_max;
                leaves.try_instance(simd, 0, &mut t_max);
            }
            _ => {
                let setup = RaySetup::new(ray);
                traverse(simd, &self.tlas, &setup, ray.t_max, &mut leaves);
            }
        }
        leaves.best
    }

    /// Whether an instance of `filter` blocks the ray. With only one instance, the filter is
    /// ignored.
    pub(crate) fn occluded_in<S: Simd, T: TriangleTest>(
        &self,
        simd: S,
        ray: &Ray,
        filter: InstanceFilter<'_>,
    ) -> bool {
        if let [only] = self.placements.as_slice()
            && only.accepts(ray)
        {
            return self.blas[only.geometry].occluded::<S, T>(simd, ray);
        }
        let mut leaves = InstanceAny::<T>::new(self, *ray, filter);
        match self.placements.len() {
            0 => return false,
            1 => leaves.found = self.instance_occluded::<S, T>(simd, 0, ray),
            _ => {
                let setup = RaySetup::new(ray);
                traverse(simd, &self.tlas, &setup, ray.t_max, &mut leaves);
            }
        }
        leaves.found
    }

    fn instance_occluded<S: Simd, T: TriangleTest>(
        &self,
        simd: S,
        instance: usize,
        ray: &Ray,
    ) -> bool {
        let p = &self.placements[instance];
        let (local, _) = p.enter(ray);
        local.t_max > local.t_min && self.blas[p.geometry].occluded::<S, T>(simd, &local)
    }
}

/// Returns rays whose direction is neither tiny nor huge unchanged; scales others by a power of
/// two. The second value converts the scaled ray's `t` back.
pub(super) fn with_ordinary_length(ray: &Ray) -> (Ray, f32) {
    let m = max_abs(ray.dir);
    if ORDINARY_LENGTHS.contains(&m) {
        return (*ray, 1.0);
    }
    let e = (m.log2().round() as i32).clamp(-125, 125);
    let k = exp2i(-e);
    // The smallest x with x · k >= t: quotients that underflow still keep the range half-open.
    let limit = |t: f32| {
        let x = t / k;
        if x * k < t { x.next_up() } else { x }
    };
    // Hits whose t overflows f32 are ignored.
    (
        Ray {
            dir: ray.dir * k,
            t_min: limit(ray.t_min),
            t_max: limit(ray.t_max.min(f32::MAX)),
            ..*ray
        },
        k,
    )
}

/// Geometries with more primitives are built one after the other, each by all threads. Their cuts
/// give enough tasks, and the builder's boxes (64 bytes a primitive) are in memory for one geometry
/// at a time.
const LARGE_GEOMETRY: usize = 1 << 17;

/// `build(i)` for every geometry, in order. The results do not depend on the scheduling.
fn build_in_parallel<T: Send>(
    geometries: &[Geometry],
    build: impl Fn(usize) -> T + Sync,
) -> Vec<T> {
    let (large, small): (Vec<usize>, Vec<usize>) =
        (0..geometries.len()).partition(|&i| geometries[i].num_primitives() > LARGE_GEOMETRY);
    // Small geometries fill the gaps that the first, serial cut of a large one leaves. Each is a
    // separate task, so that threads share them evenly.
    let (of_large, of_small): (Vec<T>, Vec<T>) = rayon::join(
        || large.iter().map(|&i| build(i)).collect(),
        || small.par_iter().with_max_len(1).map(|&i| build(i)).collect(),
    );
    let mut built: Vec<(usize, T)> = large.into_iter().zip(of_large).collect();
    built.extend(small.into_iter().zip(of_small));
    built.sort_unstable_by_key(|(i, _)| *i);
    built.into_iter().map(|(_, t)| t).collect()
}

/// The upper level.
struct TopLevel {
    origin: DVec3,
    placements: Vec<Placement>,
    tlas: WideBvh,
}

/// Chooses render space (world space, translated when everything is far from zero) and places the
/// instances in it.
fn build_top_level(
    instances: &[Instance],
    blas: &[Arc<Blas>],
    whole: Option<&GlobalLayout>,
    notes: &mut Vec<String>,
) -> Result<TopLevel, BuildError> {
    let origin = whole.map_or_else(|| choose_origin(instances, blas), |w| w.origin);
    let place_one = |(i, inst): (usize, &Instance)| {
        let b = &blas[inst.geometry];
        let bounds = [b.reach(), b.bvh().bounds];
        Placement::new(inst.geometry, &inst.world_from_object, &b.frame, bounds, origin).ok_or(
            BuildError::SingularTransform {
                instance: i,
                determinant: inst.world_from_object.matrix3.determinant(),
            },
        )
    };
    // Of several errors, the first in order is returned, whichever thread finds its error first.
    let placed: Vec<_> =
        instances.par_iter().enumerate().with_min_len(1024).map(place_one).collect();
    let placements = placed.into_iter().collect::<Result<Vec<_>, _>>()?;
    let refs = placements
        .iter()
        .enumerate()
        .filter(|(_, p)| {
            !p.bounds.is_empty() && p.bounds.min.is_finite() && p.bounds.max.is_finite()
        })
        .map(|(i, p)| PrimRef::new(p.bounds, i as u32))
        .collect();
    let tlas = build_wide(refs, &IdWriter, BuildQuality::Balanced.config(), notes);
    Ok(TopLevel { origin, placements, tlas })
}

/// Zero, or the centre of the world's bounds when they are more than four times their size away
/// from zero. A single geometry without rotation gets its own centre, so that its local space and
/// render space coincide.
fn choose_origin(instances: &[Instance], blas: &[Arc<Blas>]) -> DVec3 {
    if let [only] = instances
        && only.world_from_object.matrix3 == DMat3::IDENTITY
        && only.world_from_object.is_finite()
    {
        return blas[only.geometry].frame.center + only.world_from_object.translation;
    }
    let join = |(lo, hi): (DVec3, DVec3), (a, b): (DVec3, DVec3)| (lo.min(a), hi.max(b));
    let nothing = || (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let of_instance = |inst: &Instance| {
        let b = &blas[inst.geometry];
        let bounds = b.bvh().bounds;
        if bounds.is_empty() {
            return nothing();
        }
        let of_corner = |c: Vec3| {
            let object = c.as_dvec3() / b.frame.scale + b.frame.center;
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
    let (lo, hi) = pieces.into_iter().fold(nothing(), join);
    let center = 0.5 * lo + 0.5 * hi;
    let far = center.abs().max_element() > 4.0 * (hi - lo).max_element();
    if center.is_finite() && far { center.as_vec3().as_dvec3() } else { DVec3::ZERO }
}

struct InstanceClosest<'w, T: TriangleTest> {
    world: &'w World,
    ray: Ray,
    filter: InstanceFilter<'w>,
    best: Option<Hit>,
    test: PhantomData<T>,
}

impl<'w, T: TriangleTest> InstanceClosest<'w, T> {
    fn new(world: &'w World, ray: Ray, filter: InstanceFilter<'w>) -> Self {
        InstanceClosest { world, ray, filter, best: None, test: PhantomData }
    }

    fn try_instance<S: Simd>(&mut self, simd: S, instance: u32, skip_t: &mut f32) {
        let p = &self.world.placements[instance as usize];
        // One ulp past the best so far: a tie may go to this instance.
        let limit = self.best.map_or(self.ray.t_max, |b| b.t.next_up());
        let (local, moved) = p.enter(&Ray { t_max: limit, ..self.ray });
        if local.t_max <= local.t_min {
            return;
        }
        let c = self.world.blas[p.geometry].closest::<S, T>(simd, &local);
        if !c.found {
            return;
        }
        let t = if moved == 0.0 { c.t } else { (c.t as f64 + moved) as f32 };
        let better = self.best.is_none_or(|b| t < b.t || (t == b.t && instance < b.instance));
        if better {
            self.best = Some(Hit { t, u: c.u, v: c.v, prim: c.prim, instance });
            *skip_t = inflate_t(t);
        }
    }
}

impl<S: Simd, T: TriangleTest> LeafTest<S> for InstanceClosest<'_, T> {
    type Query = ClosestHit;

    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, skip_t: &mut f32) -> bool {
        let filter = self.filter;
        for &i in leaf_primitive_ids(units, leaf).iter().filter(|&&i| filter.has(i as usize)) {
            self.try_instance(simd, i, skip_t);
        }
        false
    }
}

struct InstanceAny<'w, T: TriangleTest> {
    world: &'w World,
    ray: Ray,
    filter: InstanceFilter<'w>,
    found: bool,
    test: PhantomData<T>,
}

impl<'w, T: TriangleTest> InstanceAny<'w, T> {
    fn new(world: &'w World, ray: Ray, filter: InstanceFilter<'w>) -> Self {
        InstanceAny { world, ray, filter, found: false, test: PhantomData }
    }
}

impl<S: Simd, T: TriangleTest> LeafTest<S> for InstanceAny<'_, T> {
    type Query = AnyHit;

    fn test(&mut self, simd: S, units: &[Unit], leaf: ChildRef, _: &mut f32) -> bool {
        let (world, ray, filter) = (self.world, self.ray, self.filter);
        self.found = leaf_primitive_ids(units, leaf)
            .iter()
            .filter(|&&i| filter.has(i as usize))
            .any(|&i| world.instance_occluded::<S, T>(simd, i as usize, &ray));
        self.found
    }
}
