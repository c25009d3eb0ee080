//! Converts the renderer's meshes and grids to data sets, for writing.

use super::{Attributes, Cells, DataArray, ImageData, Points, PolyData, Values};
use glam::DMat3;
use rt_core::grid::Grid;
use rt_core::mesh::{PerElement, TriMesh};

impl ImageData {
    /// Converts a scalar field to image data with one point array.
    pub fn from_grid(grid: &Grid, name: &str) -> Self {
        let attributes = Attributes {
            point: vec![DataArray::new(name, 1, Values::F32(grid.values().to_vec()))],
            point_scalars: Some(name.into()),
            ..Default::default()
        };
        let extent =
            std::array::from_fn(|i| if i % 2 == 0 { 0 } else { grid.dims()[i / 2] as i32 - 1 });
        ImageData {
            extent,
            origin: grid.origin(),
            spacing: grid.spacing(),
            direction: DMat3::IDENTITY,
            attributes,
        }
    }
}

impl PolyData {
    /// Converts a mesh to polygons. Scalars are named `scalars`; colours become the 8-bit sRGB
    /// array `RGBA`. Positions are double precision when the mesh has an origin, so that none is
    /// rounded.
    pub fn from_trimesh(mesh: &TriMesh) -> Self {
        let points = if mesh.origin == glam::DVec3::ZERO {
            Points::F32(mesh.positions.iter().map(|p| p.to_array()).collect())
        } else {
            Points::F64(
                mesh.positions.iter().map(|p| (mesh.origin + p.as_dvec3()).to_array()).collect(),
            )
        };
        let polys = Cells::uniform(3, mesh.indices.as_flattened().to_vec());
        let mut a = Attributes::default();
        let mut put = |per: PerElement, array: DataArray| match per {
            PerElement::Vertex => a.point.push(array),
            PerElement::Face => a.cell.push(array),
        };
        if let Some(s) = &mesh.scalars {
            put(s.per, DataArray::new("scalars", 1, Values::F32(s.values.clone())));
        }
        if let Some(c) = &mesh.colors {
            let bytes = c.values.iter().flat_map(|c| srgb8_from_linear(*c)).collect();
            put(c.per, DataArray::new("RGBA", 4, Values::U8(bytes)));
        }
        if let Some(n) = &mesh.normals {
            let values = n.values.iter().flat_map(|v| v.to_array()).collect();
            put(n.per, DataArray::new("Normals", 3, Values::F32(values)));
        }
        if let Some(t) = &mesh.texcoords {
            let values = t.iter().flat_map(|v| v.to_array()).collect();
            put(PerElement::Vertex, DataArray::new("TCoords", 2, Values::F32(values)));
            a.point_texcoords = Some("TCoords".into());
        }
        let has = |list: &[DataArray], name: &str| {
            list.iter().any(|x| x.name == name).then(|| name.to_string())
        };
        a.point_normals = has(&a.point, "Normals");
        a.cell_normals = has(&a.cell, "Normals");
        a.point_scalars = has(&a.point, "scalars").or_else(|| has(&a.point, "RGBA"));
        a.cell_scalars = has(&a.cell, "scalars").or_else(|| has(&a.cell, "RGBA"));
        PolyData { points, polys, attributes: a, ..Default::default() }
    }
}

/// Linear RGBA as 8-bit sRGB with linear alpha (IEC 61966-2-1).
pub(crate) fn srgb8_from_linear(c: [f32; 4]) -> [u8; 4] {
    std::array::from_fn(|i| {
        let v = c[i].clamp(0.0, 1.0);
        let v = match i {
            3 => v,
            _ if v <= 0.003_130_8 => 12.92 * v,
            _ => 1.055 * v.powf(1.0 / 2.4) - 0.055,
        };
        (255.0 * v).round() as u8
    })
}
