//! An isosurface of cells that are no uniform lattice.

use datasets::contour::{ContourOf, contour};
use datasets::model::{ColorBy, Dataset};
use glam::DVec3;
use rt_core::mesh::TriMesh;

/// The surface, what it is, and what a user should know about it.
pub(super) struct CellContour {
    pub(super) mesh: TriMesh,
    pub(super) content: String,
    pub(super) warnings: Vec<String>,
}

/// The surface where `array` has a value, in the colours of `color_by`, relative to `origin`.
///
/// # Errors
/// Arrays that are not there, and no surface at that value.
pub(super) fn contour_of_cells(
    data: &Dataset,
    array: &str,
    isovalue: f32,
    color_by: Option<&str>,
    origin: Option<DVec3>,
) -> anyhow::Result<CellContour> {
    let of = ContourOf::Values { array, isovalues: &[f64::from(isovalue)] };
    let made = contour(data, &of, color_by, origin)?;
    if made.mesh.num_triangles() == 0 {
        let by = ColorBy::find(data, array)?;
        let leaves = data.leaves().into_iter().filter_map(|leaf| leaf.attributes());
        let ranges = leaves.filter_map(|attributes| by.array(attributes)?.range());
        let (lo, hi) = ranges
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), (a, b)| (lo.min(a), hi.max(b)));
        anyhow::bail!(
            "no isosurface at {isovalue}: `{array}` ranges from {lo} to {hi} in {} cells with a \
             volume; choose --isovalue in between",
            made.report.solids
        );
    }
    // Without an array for the colours, they would be the isovalue.
    let scalars = made.mesh.scalars.filter(|_| color_by.is_some());
    Ok(CellContour {
        mesh: TriMesh { scalars, ..made.mesh },
        content: format!("`{array}` = {isovalue} in {} cells", made.report.solids),
        warnings: made.report.warnings(),
    })
}
