//! Writes a mesh in the formats that the programs read: binary STL, binary OFF with normals, VTP.

use anyhow::Context as _;
use datasets::model::{Dataset, PolyData};
use datasets::write::{VtkOptions, write_vtk};
use rt_core::mesh::TriMesh;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Binary STL: triangles without shared vertices.
    Stl,
    /// Geomview's OFF, binary, big-endian.
    Off,
    /// VTK's polygons in XML, with normals when the mesh has them.
    Vtp,
}

impl Format {
    /// The file extension of the format.
    pub fn extension(self) -> &'static str {
        match self {
            Format::Stl => "stl",
            Format::Off => "off",
            Format::Vtp => "vtp",
        }
    }
}

/// Writes `mesh` to `file`.
pub fn write(mesh: &TriMesh, format: Format, file: &Path) -> anyhow::Result<()> {
    if format == Format::Vtp {
        let data = Dataset::PolyData(PolyData::from_trimesh(mesh));
        return write_vtk(file, &data, VtkOptions::default())
            .with_context(|| format!("cannot write `{}`", file.display()));
    }
    let save = || -> std::io::Result<()> {
        let mut out = BufWriter::with_capacity(1 << 20, File::create(file)?);
        match format {
            Format::Stl => stl(mesh, &mut out)?,
            _ => off(mesh, &mut out)?,
        }
        out.flush()
    };
    save().with_context(|| format!("cannot write `{}`", file.display()))
}

fn stl(mesh: &TriMesh, out: &mut impl std::io::Write) -> std::io::Result<()> {
    out.write_all(&[0; 80])?;
    out.write_all(&(mesh.num_triangles() as u32).to_le_bytes())?;
    for t in 0..mesh.num_triangles() {
        let [a, b, c] = mesh.triangle(t);
        let n = (b - a).cross(c - a).normalize_or_zero();
        let mut record = [0; 50];
        for (i, v) in [n, a, b, c].into_iter().flat_map(|v| v.to_array()).enumerate() {
            record[4 * i..4 * i + 4].copy_from_slice(&v.to_le_bytes());
        }
        out.write_all(&record)?;
    }
    Ok(())
}

fn off(mesh: &TriMesh, out: &mut impl std::io::Write) -> std::io::Result<()> {
    out.write_all(b"OFF BINARY\n")?;
    for n in [mesh.positions.len(), mesh.num_triangles(), 0] {
        out.write_all(&(n as i32).to_be_bytes())?;
    }
    for p in &mesh.positions {
        for v in p.to_array() {
            out.write_all(&v.to_be_bytes())?;
        }
    }
    for t in &mesh.indices {
        let [a, b, c] = t.map(|i| i as i32);
        for v in [3, a, b, c, 0] {
            out.write_all(&v.to_be_bytes())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn files_have_the_sizes_that_their_formats_say() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let mesh =
            TriMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z], vec![[0, 1, 2], [0, 2, 3]]);
        let size = |format: Format| {
            let file = dir.path().join("mesh").with_extension(format.extension());
            write(&mesh, format, &file).expect("written");
            std::fs::metadata(&file).expect("there").len()
        };
        assert_eq!(size(Format::Stl), 84 + 2 * 50);
        assert_eq!(size(Format::Off), 11 + 12 + 4 * 12 + 2 * 20);
        assert!(size(Format::Vtp) > 4 * 12 + 2 * 12);
    }
}
