//! `bench run peers --mesh FILE`: the triangles of any file that `bench render` reads.

use crate::image::subject::{LoadOptions, Subject};
use crate::meshes::MeshScene;
use anyhow::Context as _;
use datasets::cli::{CommonArgs, UsageError};
use rt_core::bvh::Geometry;
use rt_core::glam::DVec3;
use rt_core::mesh::TriMesh;
use std::path::Path;
use std::sync::Arc;

/// The triangles of a file as a scene for the tracers.
pub(super) fn read_mesh(common: CommonArgs, file: &Path) -> anyhow::Result<MeshScene> {
    let shown = file.display();
    common.note(1, format_args!("reading {shown}"));
    let opened = datasets::read::open(file)?;
    let subject = Subject::from_file(&opened, &LoadOptions::default())
        .with_context(|| format!("{shown}: no triangles to trace"))?;
    for warning in &subject.warnings {
        common.warn(format_args!("{shown}: {warning}"));
    }
    let all = subject.parts.len();
    let meshes = subject.parts.into_iter().filter_map(|part| match part.geometry {
        Geometry::Mesh(mesh) => Some(mesh),
        Geometry::Shape(_) | Geometry::Slices(_) => None,
    });
    let (meshes, moved): (Vec<Arc<TriMesh>>, usize) = with_one_origin(meshes.collect());
    if moved > 0 {
        common.note(0, format_args!("{shown}: {moved} meshes moved to the origin of the first"));
    }
    if meshes.len() < all {
        let left_out = all - meshes.len();
        common.warn(format_args!("{shown}: {left_out} parts that are not triangles are left out"));
    }
    let meshes: Vec<Arc<TriMesh>> = meshes.into_iter().map(without_unusable).collect();
    let meshes: Vec<Arc<TriMesh>> = meshes.into_iter().filter(|m| m.num_triangles() > 0).collect();
    if meshes.is_empty() {
        return Err(UsageError(format!(
            "{shown} has no triangles; `bench render {shown}` shows what \
                                       it has"
        ))
        .into());
    }
    let name = file.file_name().map_or_else(|| shown.to_string(), |n| n.to_string_lossy().into());
    Ok(match <[_; 1]>::try_from(meshes) {
        Ok([mesh]) => MeshScene::one(&name, mesh),
        Err(meshes) => MeshScene::many(&name, meshes),
    })
}

/// The meshes relative to the origin of the first, and how many had another one.
fn with_one_origin(meshes: Vec<Arc<TriMesh>>) -> (Vec<Arc<TriMesh>>, usize) {
    let Some(origin) = meshes.first().map(|m| m.origin) else { return (meshes, 0) };
    with_origin(meshes, origin)
}

/// The meshes relative to `origin`, and how many had another one.
pub(super) fn with_origin(meshes: Vec<Arc<TriMesh>>, origin: DVec3) -> (Vec<Arc<TriMesh>>, usize) {
    let mut moved = 0;
    let move_one = |mesh: Arc<TriMesh>| {
        if mesh.origin == origin {
            return mesh;
        }
        moved += 1;
        let shift = mesh.origin - origin;
        let mut mesh = Arc::unwrap_or_clone(mesh);
        mesh.positions.iter_mut().for_each(|p| *p = (p.as_dvec3() + shift).as_vec3());
        mesh.origin = origin;
        Arc::new(mesh)
    };
    let meshes = meshes.into_iter().map(move_one).collect();
    (meshes, moved)
}

/// The triangles that every tracer takes, with the vertices that they use.
fn without_unusable(mesh: Arc<TriMesh>) -> Arc<TriMesh> {
    let count = mesh.num_triangles();
    let usable: Vec<u32> =
        (0..count).filter(|&i| mesh.is_renderable(i)).map(|i| i as u32).collect();
    if usable.len() == count { mesh } else { Arc::new(mesh.part(&usable).0) }
}
