//! Adds opaque bodies to the test section: triangle meshes that block light, such as wind-tunnel
//! models.
//!
//! Each photon is tested once before it is traced, along its undisturbed straight ray. Blocked
//! photons need no march, and the meshes do not depend on how light bends.
//!
//! The test neglects the displacement of the bent ray. In most flows, light bends in one direction
//! on its path, so the displacement is largest where the ray leaves the field. That displacement
//! bounds the error of a silhouette. [`crate::render::Report::silhouette_error_px`] is the largest
//! one, in pixels, and a warning reports it above half a pixel. In gases it is far smaller. Testing
//! every step of a march against the meshes would cost a BVH query per step without visible
//! benefit. For bodies in strongly refracting media, mark their cells in the field as solid: this
//! stops the bent ray itself.

use crate::path::Start;
use crate::view::View;
use datasets::model::ModelError;
use datasets::read::ReadError;
use rt_core::bvh::{BuildError, BuildOptions, Geometry, Instance, World};
use rt_core::ray::Ray;
use std::path::Path;
use std::sync::Arc;

/// Opaque bodies.
pub struct Solids {
    world: World,
    triangles: usize,
}

/// Why a body cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SolidsError {
    /// The file cannot be read.
    #[error("the body cannot be read")]
    Read(#[from] ReadError),
    /// The file cannot be converted to a surface.
    #[error("{path}: it cannot be converted to a surface")]
    Surface {
        /// The file.
        path: std::path::PathBuf,
        /// Why.
        source: ModelError,
    },
    /// The file has no triangles.
    #[error("{path}: no triangles; a body needs a surface (OBJ, STL, PLY, glTF, VTP)")]
    Empty {
        /// The file.
        path: std::path::PathBuf,
    },
    /// The acceleration structure cannot be built.
    #[error("the acceleration structure of the bodies cannot be built")]
    Build(#[from] BuildError),
}

impl Solids {
    /// Reads bodies from files, in metres in the flow's coordinates. Also returns warnings about
    /// what the readers repaired or ignored.
    pub fn open<P: AsRef<Path>>(paths: &[P]) -> Result<(Solids, Vec<String>), SolidsError> {
        let (mut geometries, mut instances, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
        let mut triangles = 0;
        for path in paths {
            let path = path.as_ref();
            let opened = datasets::read::open(path)?;
            let surface = |source| SolidsError::Surface { path: path.into(), source };
            let (model, report) = opened.to_meshes(None).map_err(surface)?;
            let name = path.display();
            warnings.extend(
                opened.warnings.iter().chain(&report.warnings()).map(|w| format!("{name}: {w}")),
            );
            if model.num_triangles() == 0 {
                return Err(SolidsError::Empty { path: path.into() });
            }
            triangles += model.num_triangles();
            for mesh in model.meshes {
                instances.push(Instance {
                    geometry: geometries.len(),
                    world_from_object: glam::DAffine3::IDENTITY,
                });
                geometries.push(Geometry::Mesh(Arc::new(mesh.mesh)));
            }
        }
        let world = World::build(geometries, instances, &BuildOptions::default())?;
        warnings.extend(world.report().notes.iter().cloned());
        Ok((Solids { world, triangles }, warnings))
    }

    /// Uses bodies that are already in memory.
    pub fn from_world(world: World) -> Solids {
        Solids { triangles: world.report().primitives, world }
    }

    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        self.triangles
    }

    /// Whether a body lies anywhere on the photon's straight ray.
    pub fn block(&self, view: &View, start: &Start) -> bool {
        self.world.occluded(&self.ray(view, start).0)
    }

    /// Distance along the photon's straight ray from the plane through the view's centre to the
    /// first body; `None` when the ray hits no body.
    pub fn depth_m(&self, view: &View, start: &Start) -> Option<f64> {
        let (ray, before_m) = self.ray(view, start);
        self.world.closest(&ray).map(|hit| before_m + f64::from(hit.t))
    }

    /// A photon's straight ray, and the distance of its origin from the plane through the view's
    /// centre.
    fn ray(&self, view: &View, start: &Start) -> (Ray, f64) {
        let [right, up, direction] = [view.right, view.up, view.beam(start.tilt_rad)[2]];
        let at = view.centre_m
            + right * f64::from(start.position_m[0])
            + up * f64::from(start.position_m[1]);
        let bounds = self.world.bounds();
        let radius = f64::from((bounds.max - bounds.min).length());
        let middle = self.world.origin() + ((bounds.max + bounds.min) * 0.5).as_dvec3();
        // The ray begins in front of all bodies, at the front of a sphere around them that is
        // larger than their bounding sphere.
        let back = (middle - at).dot(direction) - radius;
        let (ray, moved) = self.world.ray_from_world(at + direction * back, direction);
        (ray, back + moved)
    }
}
