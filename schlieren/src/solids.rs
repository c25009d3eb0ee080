//! Models in the test section: triangle meshes that block light, as in every photograph from a wind
//! tunnel.
//!
//! Whether a photon is blocked is asked once, along its undisturbed straight ray, before it is
//! traced: blocked photons cost no march, and the meshes need not know how light bends. Where light
//! is bent one way on its way through, as by most flows, the true ray is farthest from the straight
//! one where it leaves, so a silhouette is off by no more than the displacement there:
//! [`crate::render::Report::silhouette_error_px`] is the largest one seen, in pixels, and there is
//! a warning when it is above half a pixel. In gases it is far below. Testing every step of a march
//! against the meshes would cost a BVH query per step and gain nothing visible; where bodies stand
//! in strongly bending media, mark their cells in the field, which stops the bent ray itself.

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
pub enum SolidsError {
    /// The file cannot be read.
    #[error("the body cannot be read")]
    Read(#[from] ReadError),
    /// The file holds no surface.
    #[error("{path}: no surface can be made of it")]
    Surface {
        /// The file.
        path: std::path::PathBuf,
        /// Why.
        source: ModelError,
    },
    /// Nothing to block light.
    #[error("{path}: it holds no triangles; a body needs a surface (OBJ, STL, PLY, glTF, VTP)")]
    Empty {
        /// The file.
        path: std::path::PathBuf,
    },
    /// The acceleration structure cannot be built.
    #[error("the bodies cannot be built")]
    Build(#[from] BuildError),
}

impl Solids {
    /// Bodies from files, in metres in the flow's coordinates. Also what readers repaired or left
    /// out.
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

    /// Bodies that are at hand already.
    pub fn from_world(world: World) -> Solids {
        Solids { triangles: world.report().primitives, world }
    }

    /// How many triangles there are.
    pub fn triangles(&self) -> usize {
        self.triangles
    }

    /// Whether a body lies anywhere on the photon's straight ray.
    pub fn block(&self, view: &View, start: &Start) -> bool {
        self.world.occluded(&self.ray(view, start).0)
    }

    /// How far along the photon's straight ray the first body is, from the plane through the view's
    /// centre; `None` when there is none.
    pub fn depth_m(&self, view: &View, start: &Start) -> Option<f64> {
        let (ray, before_m) = self.ray(view, start);
        self.world.closest(&ray).map(|hit| before_m + f64::from(hit.t))
    }

    /// A photon's straight ray, and where on it that begins.
    fn ray(&self, view: &View, start: &Start) -> (Ray, f64) {
        let [right, up, direction] = [view.right, view.up, view.beam(start.tilt_rad)[2]];
        let at = view.centre_m
            + right * f64::from(start.position_m[0])
            + up * f64::from(start.position_m[1]);
        let bounds = self.world.bounds();
        let radius = f64::from((bounds.max - bounds.min).length());
        let middle = self.world.origin() + ((bounds.max + bounds.min) * 0.5).as_dvec3();
        // From before all bodies: one radius in front of their bounding sphere, wherever that is.
        let back = (middle - at).dot(direction) - radius;
        let (ray, moved) = self.world.ray_from_world(at + direction * back, direction);
        (ray, back + moved)
    }
}
