//! What a demo shows: meshes and lines of the catalogue, or the surfaces of a file.
use super::demo_error::DemoError;
use datasets::catalogue::{self, Data};
use datasets::isosurface::Options as SurfaceOptions;
use datasets::read;
use datasets::view::View;
use rt_core::glam::DVec3;
use rt_core::material::Material;
use rt_core::math::Aabb;
use rt_core::mesh::TriMesh;
use rt_core::scene::SceneBuilder;
use rt_core::shapes::{Shape, Tubes};
use std::path::Path;
use std::sync::Arc;

/// Shapes to show, with their views.
pub(super) struct DemoModel {
    pub(super) bodies: Vec<DemoShape>,
    pub(super) views: Vec<View>,
}

/// One shape.
pub(super) enum DemoShape {
    Mesh(Arc<TriMesh>),
    Tubes(Arc<Tubes>),
}

impl DemoShape {
    /// World bounds.
    fn bounds(&self) -> [DVec3; 2] {
        let (origin, b) = match self {
            DemoShape::Mesh(mesh) => (mesh.origin, mesh.bounds()),
            DemoShape::Tubes(tubes) => {
                let all = (0..tubes.num_primitives() as u32).map(|p| tubes.bounds(p));
                (tubes.origin(), all.fold(Aabb::EMPTY, |a, b| a.union(b)))
            }
        };
        [origin + b.min.as_dvec3(), origin + b.max.as_dvec3()]
    }

    pub(super) fn add_to(self, builder: &mut SceneBuilder, material: Material) {
        match self {
            DemoShape::Mesh(mesh) => builder.mesh(mesh, material),
            DemoShape::Tubes(tubes) => builder.shape(tubes, material),
        };
    }
}

impl DemoModel {
    /// `name` is a data set of the catalogue, or else a file.
    pub(super) fn load(
        name: &str,
        size: Option<&str>,
        progress: &mut dyn FnMut(usize, usize) -> bool,
    ) -> Result<DemoModel, DemoError> {
        let path = Path::new(name);
        match catalogue::find(name) {
            Ok(entry) => {
                let size = size.unwrap_or(entry.sizes[0].name);
                let normals = SurfaceOptions { normals: true, ..SurfaceOptions::default() };
                let body = match entry.generate(size, normals, progress)? {
                    Data::Mesh(mesh) => DemoShape::Mesh(mesh.into()),
                    Data::Lines(lines) => DemoShape::Tubes(Arc::new(lines.into_tubes()?)),
                };
                Ok(DemoModel { bodies: vec![body], views: entry.views() })
            }
            Err(_) if path.is_file() => {
                if let Some(size) = size {
                    return Err(DemoError::SizeOfFile { file: name.into(), size: size.into() });
                }
                let (model, _) = read::open(path)?.to_meshes(None)?;
                let bodies: Vec<DemoShape> =
                    model.meshes.into_iter().map(|m| DemoShape::Mesh(m.mesh.into())).collect();
                if model_is_empty(&bodies) {
                    return Err(DemoError::NoSurface { file: name.into() });
                }
                let views = vec![whole(middle_and_radius(&bodies))];
                Ok(DemoModel { bodies, views })
            }
            Err(unknown) if path.extension().is_some() || path.components().count() > 1 => {
                Err(DemoError::NoFile { file: name.into(), unknown })
            }
            Err(unknown) => Err(unknown.into()),
        }
    }
}

fn model_is_empty(bodies: &[DemoShape]) -> bool {
    !bodies.iter().any(|b| matches!(b, DemoShape::Mesh(m) if m.num_triangles() > 0))
}

/// Centre of the bounding box of all bodies, and the radius of the ball around it.
pub(super) fn middle_and_radius(bodies: &[DemoShape]) -> (DVec3, f64) {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for [lo, hi] in bodies.iter().map(DemoShape::bounds) {
        (low, high) = (low.min(lo), high.max(hi));
    }
    middle_and_radius_of([low, high])
}

/// The same for a box.
pub(super) fn middle_and_radius_of([low, high]: [DVec3; 2]) -> (DVec3, f64) {
    if low.is_finite() && high.is_finite() {
        let radius = 0.5 * (high - low).length();
        // The view of a single point is that of a ball around it.
        (0.5 * (low + high), if radius > 0.0 { radius } else { 1.0 })
    } else {
        (DVec3::ZERO, 1.0)
    }
}

/// A view of everything, from a little above.
pub(super) fn whole((middle, radius): (DVec3, f64)) -> View {
    let from = DVec3::new(0.5, -1.0, 0.5).normalize();
    View::new("whole", middle + from * radius.max(f64::MIN_POSITIVE) * 4.0, middle)
}
