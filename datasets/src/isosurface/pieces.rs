//! Isosurfaces in pieces, for surfaces that do not fit into memory. The field's planes come one
//! after the other, as they do from a file.

use super::inside_bits::Block;
use super::{
    Arrays, IsosurfaceError, Options, Placement, count_planes, cuts, prefix, slab, split_planes,
};
use rayon::prelude::*;
use rt_core::mesh::TriMesh;
use rt_core::volume::GridExtent;
use std::ops::Range;

/// Extracts one surface in pieces, while about `batch_planes` planes of the field (at least 5) and
/// one piece are in memory. The pieces have the triangles of [`super::extract`], in its order and
/// with the same bits; vertices between two pieces are in both, and all are relative to the same
/// origin. Returns the number of cells without surface because a corner is NaN or infinite.
///
/// `fill` writes the values of the planes of a range, x fastest. The ranges follow each other, and
/// each plane is asked for once.
///
/// ```
/// use datasets::generate::wavelet::Wavelet;
/// use datasets::isosurface::{IsosurfaceError, extract_pieces};
/// use rt_core::volume::GridExtent;
///
/// let grid = Wavelet::with_points(21).grid()?;
/// let (dims, origin, spacing) = (grid.dims(), grid.origin(), grid.spacing());
/// let mut planes = grid.values().chunks(21 * 21);
/// let mut triangles = 0;
/// extract_pieces(
///     &GridExtent { dims, origin, spacing },
///     157.0909652709961,
///     Default::default(),
///     8,
///     |_range, values| {
///         for to in values.chunks_mut(21 * 21) {
///             to.copy_from_slice(planes.next().expect("21 planes"));
///         }
///         Ok::<_, IsosurfaceError>(())
///     },
///     |piece| {
///         triangles += piece.num_triangles();
///         Ok(())
///     },
/// )?;
/// assert_eq!(triangles, 5480);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Those of `fill` and `take`, and an isovalue or a lattice that cannot be.
pub fn extract_pieces<E: From<IsosurfaceError>>(
    extent: &GridExtent,
    iso: f64,
    options: Options,
    batch_planes: usize,
    mut fill: impl FnMut(Range<u32>, &mut [f32]) -> Result<(), E>,
    mut take: impl FnMut(TriMesh) -> Result<(), E>,
) -> Result<u64, E> {
    let dims = extent.dims.as_u64vec3();
    let points = dims.x.saturating_mul(dims.y).saturating_mul(dims.z);
    let placement = Placement::of(dims, extent.origin, extent.spacing, points as usize)
        .map_err(IsosurfaceError::from)?;
    let cut = cuts(&[iso], &placement)?[0];
    let mut skipped_cells = 0;
    if !placement.has_cells() {
        return Ok(skipped_cells);
    }
    let [nx, ny, planes] = placement.dims;
    let step = batch_planes.saturating_sub(4).max(1);
    // In memory: the planes of the piece, the one before and the two after (the gradient looks one
    // plane further).
    let mut values: Vec<f32> = Vec::new();
    let mut held = 0usize..0;

    let mut start = 0;
    while start + 1 < planes {
        // The slabs of the piece, and their planes.
        let end = (start + step).min(planes - 1);
        let range = start..end + 1;
        let needed = start.saturating_sub(1)..(end + 3).min(planes);
        let kept = held.end.saturating_sub(needed.start.max(held.start)).min(held.len());
        values.drain(..values.len() - kept * nx * ny);
        values.resize(needed.len() * nx * ny, 0.0);
        let new = needed.start + kept..needed.end;
        if !new.is_empty() {
            fill(new.start as u32..new.end as u32, &mut values[kept * nx * ny..])?;
        }
        held = needed;

        let has_missing = values.par_chunks(1 << 16).any(|c| c.iter().any(|v| !v.is_finite()));
        let block =
            Block { dims: placement.dims, first_plane: held.start, values: &values, has_missing };
        let counts = count_planes(&block, &cut, range.clone());
        let mut vertices = 0;
        let first = prefix(&counts, &mut vertices);
        let triangles: u64 = counts.iter().map(|c| u64::from(c.triangles)).sum();
        let mut arrays = Arrays::new(options);
        arrays.allocate(vertices, triangles).map_err(IsosurfaceError::from)?;
        let mut rest = arrays.remaining_output(0, 0);
        let jobs: Vec<_> = split_planes(range)
            .into_iter()
            .map(|r| (rest.take(&counts[r.start - start..r.end - start]), r))
            .collect();
        jobs.into_par_iter().for_each(|(out, r)| {
            slab::emit(&block, &cut, r.clone(), &first[r.start - start..=r.end - start], out);
        });

        // The slab above the last plane is the next piece's. Its triangles and the vertices that
        // they alone have come last.
        let (last, own) = counts.split_last().map_or((0, &counts[..]), |(l, o)| (l.triangles, o));
        skipped_cells += own.iter().map(|c| u64::from(c.skipped_cells)).sum::<u64>();
        arrays.triangles.truncate(triangles as usize - last as usize);
        let used = arrays.triangles.iter().flatten().max().map_or(0, |&v| v as usize + 1);
        arrays.positions.truncate(used);
        arrays.normals.iter_mut().for_each(|n| n.truncate(used));
        if let Some(scalars) = &mut arrays.scalars {
            scalars.truncate(used);
            scalars.fill(iso as f32);
        }
        if !arrays.triangles.is_empty() {
            let mut mesh = TriMesh { origin: placement.mesh_origin, ..TriMesh::default() };
            arrays.into_mesh(&mut mesh);
            take(mesh)?;
        }
        start = end;
    }
    Ok(skipped_cells)
}
