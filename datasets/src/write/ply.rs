//! Writes meshes as binary PLY, which MeshLab, Blender and ParaView read.

use super::{WriteError, write_file};
use crate::model::from_core::srgb8_from_linear;
use rt_core::mesh::{PerElement, TriMesh};
use std::path::Path;

/// Writes a mesh as binary little-endian PLY: positions (double precision when the mesh has an
/// origin), normals, colours as 8-bit sRGB, texture coordinates `s t`, and scalars as the property
/// `scalar`. Values per face become properties of the faces.
pub fn write_ply(path: impl AsRef<Path>, mesh: &TriMesh) -> Result<(), WriteError> {
    let path = path.as_ref();
    mesh.check().map_err(|e| {
        WriteError::refused(path, e.to_string(), "make the attributes as long as the mesh")
    })?;
    if let Some(t) = mesh.indices.iter().flatten().find(|&&k| k as usize >= mesh.positions.len()) {
        let what = format!("a triangle names vertex {t} of {}", mesh.positions.len());
        return Err(WriteError::refused(path, what, "leave that triangle out"));
    }
    let wide = mesh.origin != glam::DVec3::ZERO;
    let normals = mesh.normals.as_ref().filter(|n| n.per == PerElement::Vertex);
    let [vertex, face] = [PerElement::Vertex, PerElement::Face];
    let colors = |per| mesh.colors.as_ref().filter(|c| c.per == per);
    let scalars = |per| mesh.scalars.as_ref().filter(|s| s.per == per);
    let bytes = srgb8_from_linear;

    let mut head = String::from("ply\nformat binary_little_endian 1.0\n");
    let rgba = ["red", "green", "blue", "alpha"].as_slice();
    let real = if wide { "double" } else { "float" };
    head.push_str(&format!("element vertex {}\n", mesh.positions.len()));
    for (kind, names, present) in [
        (real, ["x", "y", "z"].as_slice(), true),
        ("float", &["nx", "ny", "nz"], normals.is_some()),
        ("uchar", rgba, colors(vertex).is_some()),
        ("float", &["s", "t"], mesh.texcoords.is_some()),
        ("float", &["scalar"], scalars(vertex).is_some()),
    ] {
        if present {
            names.iter().for_each(|n| head.push_str(&format!("property {kind} {n}\n")));
        }
    }
    head.push_str(&format!(
        "element face {}\nproperty list uchar uint vertex_indices\n",
        mesh.indices.len()
    ));
    if colors(face).is_some() {
        rgba.iter().for_each(|n| head.push_str(&format!("property uchar {n}\n")));
    }
    if scalars(face).is_some() {
        head.push_str("property float scalar\n");
    }
    head.push_str("end_header\n");

    write_file(path, |f| {
        f.write_all(head.as_bytes())?;
        for (i, p) in mesh.positions.iter().enumerate() {
            if wide {
                let q = mesh.origin + p.as_dvec3();
                f.write_all(bytemuck::bytes_of(&q.to_array().map(f64::to_le_bytes)))?;
            } else {
                f.write_all(bytemuck::bytes_of(&p.to_array().map(f32::to_le_bytes)))?;
            }
            if let Some(n) = normals {
                f.write_all(bytemuck::bytes_of(&n.values[i].to_array().map(f32::to_le_bytes)))?;
            }
            if let Some(c) = colors(vertex) {
                f.write_all(&bytes(c.values[i]))?;
            }
            if let Some(t) = &mesh.texcoords {
                f.write_all(bytemuck::bytes_of(&t[i].to_array().map(f32::to_le_bytes)))?;
            }
            if let Some(s) = scalars(vertex) {
                f.write_all(&s.values[i].to_le_bytes())?;
            }
        }
        for (i, t) in mesh.indices.iter().enumerate() {
            f.write_all(&[3])?;
            f.write_all(bytemuck::bytes_of(&t.map(u32::to_le_bytes)))?;
            if let Some(c) = colors(face) {
                f.write_all(&bytes(c.values[i]))?;
            }
            if let Some(s) = scalars(face) {
                f.write_all(&s.values[i].to_le_bytes())?;
            }
        }
        Ok(())
    })
}
