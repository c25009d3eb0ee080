//! What `datasets info` says of files of stored meshes and volumes, which other commands cannot
//! read.

use super::description::{Array, Info, Part, Stored};
use datasets::{stored_mesh, stored_volume};
use rt_core::bvh::StoredMesh;
use rt_core::stored_volume::{StoredVolume, ValueType};
use std::io::Read as _;
use std::path::Path;

/// Describes the file, when it is one of them.
pub(super) fn describe(path: &Path) -> anyhow::Result<Option<Info>> {
    let mut start = [0; 8];
    // What cannot be read is the readers' to report.
    let read = std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut start));
    if read.is_ok() && StoredMesh::recognizes(&start) {
        return Ok(Some(mesh(path, &stored_mesh::open(path, 0)?)));
    }
    if read.is_ok() && StoredVolume::recognizes(&start) {
        return Ok(Some(volume(path, &stored_volume::open(path, 0)?)));
    }
    Ok(None)
}

fn mesh(path: &Path, mesh: &StoredMesh) -> Info {
    let (report, attributes) = (mesh.report(), mesh.attributes());
    let array = |name: &str, components, range: Option<[f32; 2]>| Array {
        name: name.into(),
        of: "point or cell",
        scalar_type: "f32",
        components,
        tuples: None,
        range: range.map(|[lo, hi]| (lo.into(), hi.into())),
    };
    let arrays = [
        attributes.normals.then(|| array("normals", 3, None)),
        attributes.colors.then(|| array("colors", 4, None)),
        attributes.scalars.map(|range| array("scalars", 1, Some(range))),
    ];
    let mut info = Info::new(path, "stored mesh", "mesh");
    if report.skipped > 0 {
        info.warnings.push(format!("{} triangles cannot be hit", report.skipped));
    }
    info.parts.push(Part {
        name: String::new(),
        kind: "mesh",
        points: None,
        cells: report.triangles,
        arrays: arrays.into_iter().flatten().collect(),
    });
    info.stored = Some(Stored { pages: report.pages, bytes: report.bytes });
    info
}

fn volume(path: &Path, volume: &StoredVolume) -> Info {
    let (report, layout) = (volume.report(), volume.layout());
    let scalar_type = match layout.values {
        ValueType::U8 => "u8",
        ValueType::I8 => "i8",
        ValueType::U16 => "u16",
        ValueType::I16 => "i16",
        _ => "f32",
    };
    let values = Array {
        name: "values".into(),
        of: "point",
        scalar_type,
        components: 1,
        tuples: Some(report.points),
        range: volume.range().map(|(lo, hi)| (lo.into(), hi.into())),
    };
    let mut info = Info::new(path, "stored volume", "ImageData");
    if report.non_finite > 0 {
        info.warnings.push(format!("{} values are not finite", report.non_finite));
    }
    let [x, y, z] = layout.dims.to_array();
    info.parts.push(Part {
        name: format!("{x} x {y} x {z}"),
        kind: "ImageData",
        points: Some(report.points),
        cells: (layout.dims - 1).as_u64vec3().element_product(),
        arrays: vec![values],
    });
    info.stored = Some(Stored { pages: report.bricks, bytes: report.bytes });
    info
}
