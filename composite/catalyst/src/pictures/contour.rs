//! Isosurfaces and slices of this rank's domains.

use super::surface::{Domains, bounds, copied, origin_of, scene_of, values};
use super::{Group, PictureError, Totals};
use crate::blueprint::{Domain, Lattice, is_whole_lattice};
use crate::settings::{Picture, Show};
use composite::render::RankScene;
use datasets::contour::{ContourOf, contour as contour_of_cells};
use datasets::isosurface;
use datasets::model::Dataset;
use rt_core::glam::{DVec3, UVec3};
use rt_core::grid::Grid;
use rt_core::mesh::TriMesh;

/// What a rank has: uniform points, whose surfaces have the fewest triangles, and copies of all
/// else.
struct Fields<'a> {
    lattices: Vec<Lattice<'a>>,
    cells: Dataset,
}

/// The isosurfaces of an array, or a slice.
pub(super) fn contour(
    group: &mut Group<'_>,
    domains: Domains<'_, '_>,
    wanted: &Picture,
    warnings: &mut Vec<String>,
) -> Result<(RankScene, Totals), PictureError> {
    let fields = domains.and_then(|domains| fields_of(&domains, wanted, warnings));
    let mine = fields.as_ref().map(|fields| known_of(fields, wanted)).map_err(String::clone);
    let whole = group.totals(&mine)?;
    let origin = origin_of(&whole);
    let mesh = fields.and_then(|fields| {
        let (mesh, averaged) = surfaces(&fields, wanted, &whole, origin, warnings)?;
        if averaged && group.comm.size() > 1 {
            let name = wanted.array.as_deref().unwrap_or_default();
            warnings.push(format!(
                "`{name}` belongs to cells: isosurfaces meet at the borders of ranks only with \
                 copies of the neighbours' cells"
            ));
        }
        Ok(mesh)
    });
    // The bounds of all cells, so that the view stays as it is while surfaces grow.
    scene_of(group, mesh, whole, wanted)
}

fn fields_of<'a>(
    domains: &[Domain<'_, 'a>],
    wanted: &Picture,
    warnings: &mut Vec<String>,
) -> Result<Fields<'a>, String> {
    let topology = wanted.topology.as_deref();
    let (mut lattices, mut others) = (Vec::new(), Vec::new());
    for domain in domains {
        let is_plain = wanted.show == Show::Isosurface && wanted.color_array.is_none();
        if is_plain && is_whole_lattice(domain, topology).map_err(|e| e.to_string())? {
            let name = wanted.array.as_deref().unwrap_or_default();
            let lattice = Lattice::of(domain, topology, name).map_err(|e| e.to_string())?;
            if let Some(lattice) = lattice.filter(|l| !l.of_cells) {
                lattices.push(lattice);
                continue;
            }
        }
        others.push(domain.clone());
    }
    Ok(Fields { lattices, cells: copied(&others, topology, warnings)? })
}

/// Bounds, and the values that give colours.
fn known_of(fields: &Fields<'_>, wanted: &Picture) -> Totals {
    let lattices = fields.lattices.iter().fold(Totals::NOTHING, |totals, lattice| {
        let last = DVec3::from(lattice.dims.map(|n| n.saturating_sub(1) as f64));
        let corners = [lattice.origin, lattice.origin + lattice.spacing * last];
        totals.with_box(corners).with_values(lattice.values())
    });
    let leaves = fields.cells.leaves();
    let boxes = leaves.iter().fold(lattices, |totals, leaf| totals.with_box(bounds(leaf)));
    boxes.with_values(values(&fields.cells, wanted.coloring_array()).into_iter())
}

/// The surfaces, and whether values of cells have become means at points.
fn surfaces(
    fields: &Fields<'_>,
    wanted: &Picture,
    whole: &Totals,
    origin: DVec3,
    warnings: &mut Vec<String>,
) -> Result<(TriMesh, bool), String> {
    let mut all = TriMesh { origin, ..TriMesh::default() };
    for lattice in &fields.lattices {
        append(&mut all, of_lattice(lattice, &wanted.isovalues, origin, warnings)?)?;
    }
    if fields.cells.leaves().is_empty() {
        return Ok((all, false));
    }
    let of = match wanted.show {
        Show::Slice => ContourOf::Plane {
            point: wanted.slice_point.map_or(0.5 * (whole.low + whole.high), DVec3::from),
            normal: wanted.slice_normal.map_or(DVec3::Y, DVec3::from),
        },
        _ => ContourOf::Values {
            array: wanted.array.as_deref().unwrap_or_default(),
            isovalues: &wanted.isovalues,
        },
    };
    let color_by = match wanted.show {
        Show::Slice => wanted.array.as_deref(),
        _ => wanted.color_array.as_deref(),
    };
    let made = contour_of_cells(&fields.cells, &of, color_by, Some(origin));
    let made = made.map_err(|e| e.to_string())?;
    warnings.extend(made.report.warnings());
    append(&mut all, made.mesh)?;
    Ok((all, made.report.averaged))
}

fn of_lattice(
    lattice: &Lattice<'_>,
    isovalues: &[f64],
    origin: DVec3,
    warnings: &mut Vec<String>,
) -> Result<TriMesh, String> {
    let dims = lattice.dims.map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    let values = lattice.values().map(|v| v as f32).collect();
    let grid = Grid::new(UVec3::from(dims), lattice.origin, lattice.spacing, values);
    let grid = grid.map_err(|e| e.to_string())?;
    let options = isosurface::Options { normals: false, scalars: true };
    let made = isosurface::extract_at(&grid, isovalues, options, Some(origin));
    let made = made.map_err(|e| e.to_string())?;
    if made.skipped_cells > 0 {
        let n = made.skipped_cells;
        warnings.push(format!("{n} cells have no surface: a value there is no finite number"));
    }
    Ok(made.mesh)
}

fn append(whole: &mut TriMesh, piece: TriMesh) -> Result<(), String> {
    let Ok(first) = u32::try_from(whole.positions.len()) else {
        return Err("the surfaces of one rank have more than 2^32 vertices".into());
    };
    whole.positions.extend(piece.positions);
    whole.indices.extend(piece.indices.iter().map(|t| t.map(|k| k.saturating_add(first))));
    match (&mut whole.scalars, piece.scalars) {
        (Some(all), Some(more)) => all.values.extend(more.values),
        (none, more) => *none = more,
    }
    Ok(())
}
