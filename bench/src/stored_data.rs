//! The dissertation's data in files that may be larger than memory.

use datasets::catalogue::SEED;
use datasets::cli::CureExt as _;
use datasets::generate::mixing_layer::{self, MixingLayer};
use datasets::generate::nested_wavelet::{POINTS, isovalues_for};
use datasets::generate::wavelet::Wavelet;
use datasets::isosurface::{self, Options, PlaneSource};
use datasets::{stored_mesh, stored_volume};
use rayon::prelude::*;
use rt_core::bvh::StoredMeshReport;
use rt_core::glam::DVec3;
use rt_core::grid::Grid;
use rt_core::mesh::TriMesh;
use rt_core::stored_volume::{StoredVolumeReport, ValueType, VolumeLayout};
use rt_core::volume::GridExtent;
use std::ops::Range;
use std::path::Path;

/// Planes of the mixing layer that are made before they are stored.
const PLANES_AT_ONCE: u32 = 32;

/// Stores the Richtmyer-Meshkov-like mixing layer in bytes, as the simulation was published: the
/// fraction of the heavy gas times 255. `progress` gets the number of planes that are stored, and
/// of all; an error of it ends the work.
///
/// # Errors
/// Those of `progress`, and when the file cannot be written.
pub fn store_mixing_layer(
    path: &Path,
    points: u32,
    progress: &mut dyn FnMut(u32, u32) -> anyhow::Result<()>,
) -> anyhow::Result<(VolumeLayout, StoredVolumeReport)> {
    let layer = MixingLayer::new(points, SEED);
    let (dims, origin, spacing) = (layer.dims(), layer.origin(), layer.spacing());
    let layout = VolumeLayout { dims, origin, spacing, values: ValueType::U8 };
    let mut writer = stored_volume::create(path, layout)?;
    let in_bytes = |z: u32| -> Vec<u8> {
        let mut plane = vec![0.0f32; dims.x as usize * dims.y as usize];
        layer.fill_plane(z, &mut plane);
        plane.iter().map(|v| (255.0 * v).round() as u8).collect()
    };
    for first in (0..dims.z).step_by(PLANES_AT_ONCE as usize) {
        progress(first, dims.z)?;
        let end = (first + PLANES_AT_ONCE).min(dims.z);
        let planes: Vec<Vec<u8>> = (first..end).into_par_iter().map(in_bytes).collect();
        planes.iter().try_for_each(|plane| writer.add_plane(plane))?;
    }
    Ok((layout, stored_volume::finish(writer)?))
}

/// The mixing layer as [`store_mixing_layer`] stores it: rounded to bytes, in single precision.
///
/// # Errors
/// When the points are more than a grid can have.
pub fn mixing_layer_grid(points: u32) -> anyhow::Result<Grid> {
    let layer = MixingLayer::new(points, SEED);
    let dims = layer.dims();
    let mut values = vec![0.0f32; dims.as_usizevec3().element_product()];
    let planes = values.par_chunks_mut(dims.x as usize * dims.y as usize);
    (0..dims.z).into_par_iter().zip(planes).for_each(|(z, plane)| {
        layer.fill_plane(z, plane);
        plane.iter_mut().for_each(|v| *v = (255.0 * *v).round());
    });
    Ok(Grid::new(dims, layer.origin(), layer.spacing(), values)?)
}

/// The interface of the mixing layer in pieces; see [`store_mixing_layer`] for the layer and for
/// `progress`. The field is not rounded to bytes.
///
/// # Errors
/// Those of `progress` and of `take`.
pub fn mixing_layer_pieces(
    points: u32,
    options: Options,
    progress: &mut dyn FnMut(u32, u32) -> anyhow::Result<()>,
    take: impl FnMut(TriMesh) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    surface_pieces(&MixingLayer::new(points, SEED), mixing_layer::ISO, options, progress, take)
}

/// An isosurface of a field that is made plane by plane, in pieces; see [`store_mixing_layer`] for
/// `progress`.
///
/// # Errors
/// Those of `progress` and of `take`.
pub fn surface_pieces(
    source: &dyn PlaneSource,
    iso: f64,
    options: Options,
    progress: &mut dyn FnMut(u32, u32) -> anyhow::Result<()>,
    take: impl FnMut(TriMesh) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let (dims, origin, spacing) = (source.dims(), source.origin(), source.spacing());
    let extent = GridExtent { dims, origin, spacing };
    let plane = dims.x as usize * dims.y as usize;
    let fill = |range: Range<u32>, values: &mut [f32]| {
        progress(range.start, dims.z)?;
        let planes = values.par_chunks_mut(plane).enumerate();
        planes.for_each(|(k, plane)| source.fill_plane(range.start + k as u32, plane));
        Ok(())
    };
    let batch = PLANES_AT_ONCE as usize;
    isosurface::extract_pieces(&extent, iso, options, batch, fill, take)?;
    Ok(())
}

/// One of the nested surfaces of the wavelet.
pub struct WaveletSurface {
    /// Its number among all, for people.
    pub label: String,
    /// Share of the surfaces with this one, 0..=1.
    pub share: f64,
    /// Its triangles.
    pub mesh: TriMesh,
}

/// Stores the nested isosurfaces of the wavelet, without normals, in pieces of which `memory` bytes
/// wait at a time. `progress` gets each surface before it is stored; an error of it ends the work.
///
/// # Errors
/// Those of `progress`, and when the wavelet cannot be made or the file not be written.
pub fn store_wavelet(
    path: &Path,
    millions: u32,
    memory: usize,
    progress: &mut dyn FnMut(&WaveletSurface) -> anyhow::Result<()>,
) -> anyhow::Result<StoredMeshReport> {
    let mut writer = stored_mesh::create(path, DVec3::ZERO)?;
    writer.set_memory(memory);
    for surface in wavelet_surfaces(millions, false)? {
        let surface = surface?;
        progress(&surface)?;
        writer.add_mesh(&surface.mesh)?;
    }
    Ok(stored_mesh::finish(writer)?)
}

/// Nested isosurfaces of the wavelet, one after the other: the dissertation's scaling series
/// (section 4.3), which goes to 256 million triangles.
///
/// # Errors
/// When the wavelet cannot be made; each surface may have an error of its own.
pub fn wavelet_surfaces(
    millions: u32,
    normals: bool,
) -> anyhow::Result<impl Iterator<Item = anyhow::Result<WaveletSurface>>> {
    let grid = Wavelet::with_points(POINTS).grid()?;
    let isovalues = isovalues_for(&grid, millions as usize * 1_000_000)?;
    let options = Options { normals, ..Options::default() };
    let count = isovalues.len();
    Ok(isovalues.into_iter().enumerate().map(move |(number, isovalue)| {
        let surface = isosurface::extract(&grid, &[isovalue], options)
            .cure("ask for fewer millions of triangles")?;
        let (label, share) =
            (format!("surface {} of {count}", number + 1), (number + 1) as f64 / count as f64);
        Ok(WaveletSurface { label, share, mesh: surface.mesh })
    }))
}
