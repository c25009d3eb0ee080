//! Writes meshes as Wavefront OBJ text.

use super::{WriteError, write_file};
use rt_core::mesh::{PerElement, TriMesh};
use std::path::Path;

/// Writes positions, vertex normals, texture coordinates and triangles. OBJ cannot store colours
/// and scalars: a mesh that has them is rejected, so that they are not lost silently.
pub fn write_obj(path: impl AsRef<Path>, mesh: &TriMesh) -> Result<(), WriteError> {
    let path = path.as_ref();
    if mesh.colors.is_some() || mesh.scalars.is_some() {
        return Err(WriteError::refused(
            path,
            "OBJ cannot hold colours or scalars",
            "write PLY or VTP, or drop them first",
        ));
    }
    mesh.check().map_err(|e| {
        WriteError::refused(path, e.to_string(), "make the attributes as long as the mesh")
    })?;
    let normals = mesh.normals.as_ref().filter(|n| n.per == PerElement::Vertex);
    write_file(path, |f| {
        for p in &mesh.positions {
            let p = mesh.origin + p.as_dvec3();
            // Without an origin, the f32 text is exact and shorter.
            if mesh.origin == glam::DVec3::ZERO {
                let p = p.as_vec3();
                writeln!(f, "v {:?} {:?} {:?}", p.x, p.y, p.z)?;
            } else {
                writeln!(f, "v {:?} {:?} {:?}", p.x, p.y, p.z)?;
            }
        }
        for t in mesh.texcoords.iter().flatten() {
            writeln!(f, "vt {:?} {:?}", t.x, t.y)?;
        }
        for n in normals.iter().flat_map(|n| &n.values) {
            writeln!(f, "vn {:?} {:?} {:?}", n.x, n.y, n.z)?;
        }
        for t in &mesh.indices {
            let corner = |k: u32| {
                let k = u64::from(k) + 1;
                match (mesh.texcoords.is_some(), normals.is_some()) {
                    (false, false) => format!("{k}"),
                    (true, false) => format!("{k}/{k}"),
                    (false, true) => format!("{k}//{k}"),
                    (true, true) => format!("{k}/{k}/{k}"),
                }
            };
            writeln!(f, "f {} {} {}", corner(t[0]), corner(t[1]), corner(t[2]))?;
        }
        Ok(())
    })
}
