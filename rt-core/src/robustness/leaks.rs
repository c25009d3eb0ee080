//! Counts rays that leak between the triangles of a closed mesh.
//!
//! A ray that starts inside a closed surface must hit it. Random rays almost never find the points
//! where a tracer fails, so these rays are aimed there: exactly at vertices and edges, next to
//! edges by a few roundings, and from close to the surface, where a triangle is large compared with
//! its distance.

use super::batch_numbers;
use crate::bvh::{Coherence, InstanceFilter, World};
use crate::math::SplitMix64;
use crate::mesh::TriMesh;
use crate::ray::{HitBlock, NO_HIT, Ray, RayBlock};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// What a ray is aimed at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum RayTarget {
    /// A vertex.
    Vertex,
    /// A point on an edge, rounded to f32.
    Edge,
    /// A point next to an edge, off by up to 10⁻⁶ of its length: there the edge test and the box
    /// test may disagree.
    NearEdge,
    /// Any point of a triangle.
    Anywhere,
}

impl RayTarget {
    /// All targets.
    pub const ALL: [RayTarget; 4] =
        [RayTarget::Vertex, RayTarget::Edge, RayTarget::NearEdge, RayTarget::Anywhere];

    /// The name used in records.
    pub fn name(self) -> &'static str {
        match self {
            RayTarget::Vertex => "vertices",
            RayTarget::Edge => "edges",
            RayTarget::NearEdge => "beside edges",
            RayTarget::Anywhere => "anywhere",
        }
    }
}

/// Where rays start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RayOrigins {
    /// In a ball inside the surface, world coordinates.
    Ball {
        /// Its centre.
        center: DVec3,
        /// Its radius.
        radius: f64,
    },
    /// Between the centre, from which every point of the surface is visible, and the point of the
    /// triangle that the ray is aimed at. Most are close to the surface, down to 10⁻⁶ of the
    /// distance or eight steps of f32, whichever is more. (Closer to the surface, `t` may round to
    /// below zero, and the ray counts as having started behind the surface.)
    NearSurface {
        /// World coordinates.
        center: DVec3,
    },
}

/// The queries of the world that trace the rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum QueryKind {
    /// [`World::closest`] and [`World::occluded`].
    Single,
    /// [`World::closest_coherent`] and [`World::occluded_coherent`].
    Coherent,
    /// [`World::closest_incoherent`] and [`World::occluded_incoherent`].
    Incoherent,
}

impl QueryKind {
    /// All kinds of queries.
    pub const ALL: [QueryKind; 3] = [QueryKind::Single, QueryKind::Coherent, QueryKind::Incoherent];
}

/// Counts of a leak test.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct LeakCount {
    /// Rays traced.
    pub rays: u64,
    /// Rays without a closest hit.
    pub leaks: u64,
    /// Rays that were not occluded.
    pub occlusion_leaks: u64,
}

/// A closed mesh, alone in its world, and the rays to test it with.
///
/// ```
/// use rt_core::bvh::{BuildOptions, World};
/// use rt_core::glam::{DVec3, Vec3};
/// use rt_core::mesh::TriMesh;
/// use rt_core::robustness::{RayTarget, LeakTest, QueryKind, RayOrigins};
///
/// // A tetrahedron, and the same with one side left out.
/// let corners = [[1., 1., 1.], [1., -1., -1.], [-1., 1., -1.], [-1., -1., 1.]].map(Vec3::from);
/// let closed = TriMesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]);
/// let open = TriMesh { indices: closed.indices[..3].to_vec(), ..closed.clone() };
/// let leaks = |mesh: &TriMesh| {
///     let world = World::from_mesh(mesh.clone(), &BuildOptions::default()).unwrap();
///     let start = RayOrigins::Ball { center: DVec3::ZERO, radius: 0.3 };
///     let test = LeakTest { world: &world, mesh: &closed, start, aim: RayTarget::Edge, seed: 1 };
///     test.count(QueryKind::Coherent, 10_000).leaks
/// };
/// assert_eq!(leaks(&closed), 0);
/// assert!(leaks(&open) > 0);
/// ```
#[derive(Clone, Copy)]
pub struct LeakTest<'a> {
    /// The world.
    pub world: &'a World,
    /// The mesh of its first instance.
    pub mesh: &'a TriMesh,
    /// Where rays start.
    pub start: RayOrigins,
    /// What they are aimed at.
    pub aim: RayTarget,
    /// Seed of the rays: the same seed gives the same rays on any number of threads.
    pub seed: u64,
}

/// Rays generated and traced by one task.
const BATCH: usize = 4096;
/// Rays that share an origin and go to neighbouring triangles; every other such group has unrelated
/// rays.
const TILE: usize = 256;

impl LeakTest<'_> {
    /// Traces `rays` rays (rounded up to a multiple of 4096) and counts those that get through.
    pub fn count(&self, query: QueryKind, rays: usize) -> LeakCount {
        (0..rays.div_ceil(BATCH)).into_par_iter().map(|b| self.count_batch(query, b as u64)).reduce(
            LeakCount::default,
            |a, b| LeakCount {
                rays: a.rays + b.rays,
                leaks: a.leaks + b.leaks,
                occlusion_leaks: a.occlusion_leaks + b.occlusion_leaks,
            },
        )
    }

    fn count_batch(&self, query: QueryKind, batch: u64) -> LeakCount {
        let rays = self.rays(batch);
        let n = rays.len();
        let (hits, blocked) = match query {
            QueryKind::Single => (
                rays.iter().filter(|r| self.world.closest(r).is_some()).count(),
                rays.iter().filter(|r| self.world.occluded(r)).count(),
            ),
            QueryKind::Coherent | QueryKind::Incoherent => {
                let blocks = RayBlock::from_rays(&rays);
                let (mut hits, mut any) =
                    (vec![HitBlock::MISS; blocks.len()], vec![0u16; blocks.len()]);
                let alike = query == QueryKind::Coherent;
                let coherence = if alike { Coherence::Coherent } else { Coherence::Incoherent };
                self.world.closest_stream(&blocks, &mut hits, coherence, InstanceFilter::All);
                self.world.occluded_stream(&blocks, &mut any, coherence, InstanceFilter::All);
                let found =
                    hits.iter().map(|h| h.prim.iter().filter(|&&p| p != NO_HIT).count()).sum();
                (found, any.iter().map(|a| a.count_ones() as usize).sum())
            }
        };
        LeakCount {
            rays: n as u64,
            leaks: (n - hits) as u64,
            occlusion_leaks: (n - blocked) as u64,
        }
    }

    /// The rays of batch `batch`, in render space: 4096, each starting inside.
    pub fn rays(&self, batch: u64) -> Vec<Ray> {
        let mut random = batch_numbers(self.seed, batch);
        let n = self.mesh.num_triangles();
        if n == 0 {
            return vec![Ray::new(Vec3::ZERO, Vec3::ZERO); BATCH];
        }
        let place = self.world.instances()[0].world_from_object;
        let to_render =
            |p: Vec3| place.transform_point3(self.mesh.origin + p.as_dvec3()) - self.world.origin();
        let (mut common, mut first) = (Vec3::ZERO, 0);
        (0..BATCH)
            .map(|i| {
                let tile = (i / TILE).is_multiple_of(2);
                if tile && i % TILE == 0 {
                    first = below(&mut random, n);
                }
                let triangle =
                    if tile { (first + i % TILE / 2) % n } else { below(&mut random, n) };
                let corners = self.mesh.triangle(triangle).map(to_render);
                let (on_surface, target) = self.target(corners, &mut random);
                let new_origin = i % TILE == 0 || !tile;
                let origin =
                    if new_origin { self.origin(corners, on_surface, &mut random) } else { common };
                common = origin;
                Ray::new(origin, target - origin)
            })
            .collect()
    }

    /// A point of the triangle, and the point aimed at: the same or next to it.
    fn target(&self, corners: [DVec3; 3], random: &mut SplitMix64) -> (DVec3, Vec3) {
        let k = below(random, 3);
        let (a, b, c) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
        let (on, off) = match self.aim {
            RayTarget::Vertex => (a, DVec3::ZERO),
            RayTarget::Edge => (a.lerp(b, random.unit()), DVec3::ZERO),
            RayTarget::NearEdge => {
                let off = 1e-6 * (a - b).length() * (10f64).powf(-3.0 * random.unit());
                (a.lerp(b, random.unit()), random.direction() * off)
            }
            RayTarget::Anywhere => (a.lerp(b, random.unit()).lerp(c, random.unit()), DVec3::ZERO),
        };
        (on, (on + off).as_vec3())
    }

    fn origin(&self, corners: [DVec3; 3], near: DVec3, random: &mut SplitMix64) -> Vec3 {
        match self.start {
            RayOrigins::Ball { center, radius } => {
                let inside = random.direction() * random.unit().cbrt() * radius;
                (center + inside - self.world.origin()).as_vec3()
            }
            RayOrigins::NearSurface { center } => {
                let on = corners[0].lerp(corners[1], random.unit()).lerp(corners[2], random.unit());
                let on = near.lerp(on, (10f64).powf(-4.0 * random.unit()));
                // At least eight f32 steps deep, so that rounding cannot put the start outside.
                let center = center - self.world.origin();
                let step = on.abs().max_element() * f32::EPSILON as f64 / (center - on).length();
                let depth = (10f64).powf(-6.0 * random.unit()).max(8.0 * step).min(1.0);
                on.lerp(center, depth).as_vec3()
            }
        }
    }
}

/// A random number below `n`, which must be 1 to 2^32.
fn below(random: &mut SplitMix64, n: usize) -> usize {
    (((random.bits() >> 32) * n as u64) >> 32) as usize
}
