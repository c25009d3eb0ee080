//! Isosurfaces of fields that do not fit into memory. Planes are requested in batches; only one
//! batch and the result are in memory. The result is identical to that of the whole field in
//! memory, including the ids.

use super::inside_bits::Block;
use super::{
    Arrays, IsosurfaceError, Isosurfaces, Options, Placement, count_planes, cuts, prefix, slab,
    split_planes,
};
use glam::{DVec3, UVec3};
use rayon::prelude::*;
use rt_core::grid::Grid;

/// A scalar field that can compute any plane of its grid.
pub trait PlaneSource: Sync {
    /// Points per axis.
    fn dims(&self) -> UVec3;
    /// World position of point (0,0,0).
    fn origin(&self) -> DVec3;
    /// World distance between neighbouring points.
    fn spacing(&self) -> DVec3;
    /// Writes the `dims.x * dims.y` values of plane `k`, x fastest. Called once or twice per plane,
    /// from several threads.
    fn fill_plane(&self, k: u32, values: &mut [f32]);
}

impl PlaneSource for Grid {
    fn dims(&self) -> UVec3 {
        Grid::dims(self)
    }
    fn origin(&self) -> DVec3 {
        Grid::origin(self)
    }
    fn spacing(&self) -> DVec3 {
        Grid::spacing(self)
    }
    fn fill_plane(&self, k: u32, values: &mut [f32]) {
        values.copy_from_slice(&self.values()[k as usize * values.len()..][..values.len()]);
    }
}

/// Extracts one surface while holding about `batch_planes` planes of the field in memory (at least
/// 4). `progress` receives the number of finished planes and may stop the extraction by returning
/// false; the surface then ends at that plane.
pub fn extract_streamed(
    source: &dyn PlaneSource,
    iso: f64,
    options: Options,
    batch_planes: usize,
    mut progress: impl FnMut(usize) -> bool,
) -> Result<Isosurfaces, IsosurfaceError> {
    let dims = source.dims();
    let points = dims.x as u64 * dims.y as u64 * dims.z as u64;
    let placement =
        Placement::of(dims.as_u64vec3(), source.origin(), source.spacing(), points as usize)?;
    let mut result = Isosurfaces { triangles_per_iso: vec![0], ..Default::default() };
    result.mesh.origin = placement.mesh_origin;
    let cut = cuts(&[iso], &placement)?[0];
    if !placement.has_cells() {
        return Ok(result);
    }
    let [nx, ny, planes] = placement.dims;
    let step = batch_planes.saturating_sub(3).max(1);
    let mut arrays = Arrays::new(options);
    let (mut vertices, mut triangles) = (0u64, 0u64);
    // In memory: the planes of the batch, the one before and the two after (the gradient looks one
    // plane further).
    let mut values: Vec<f32> = Vec::new();
    let mut held = 0usize..0;

    let mut start = 0;
    while start < planes {
        let range = start..(start + step).min(planes);
        let needed = start.saturating_sub(1)..(range.end + 2).min(planes);
        let kept = held.end.saturating_sub(needed.start.max(held.start)).min(held.len());
        values.drain(..values.len() - kept * nx * ny);
        values.resize(needed.len() * nx * ny, 0.0);
        values.par_chunks_mut(nx * ny).enumerate().skip(kept).for_each(|(n, plane)| {
            source.fill_plane((needed.start + n) as u32, plane);
        });
        held = needed;

        let has_missing = values.par_chunks(1 << 16).any(|c| c.iter().any(|v| !v.is_finite()));
        let block =
            Block { dims: placement.dims, first_plane: held.start, values: &values, has_missing };
        let counts = count_planes(&block, &cut, range.clone());
        let (old_vertices, old_triangles) = (vertices as usize, triangles as usize);
        let first = prefix(&counts, &mut vertices);
        triangles += counts.iter().map(|c| c.triangles as u64).sum::<u64>();
        result.skipped_cells += counts.iter().map(|c| c.skipped_cells as u64).sum::<u64>();
        arrays.allocate(vertices, triangles)?;

        let mut rest = arrays.remaining_output(old_vertices, old_triangles);
        let jobs: Vec<_> = split_planes(range.clone())
            .into_iter()
            .map(|r| (rest.take(&counts[r.start - start..r.end - start]), r))
            .collect();
        jobs.into_par_iter().for_each(|(out, r)| {
            slab::emit(&block, &cut, r.clone(), &first[r.start - start..=r.end - start], out);
        });
        start = range.end;
        if !progress(start) && start < planes {
            // The last slab's triangles refer to vertices of the next plane, which is not
            // processed.
            let known = arrays.positions.len() as u32;
            arrays.triangles.retain(|t| t.iter().all(|&v| v < known));
            break;
        }
    }
    if let Some(scalars) = &mut arrays.scalars {
        scalars.fill(iso as f32);
    }
    result.triangles_per_iso[0] = arrays.triangles.len();
    arrays.into_mesh(&mut result.mesh);
    result.mesh.positions.shrink_to_fit();
    result.mesh.indices.shrink_to_fit();
    Ok(result)
}
