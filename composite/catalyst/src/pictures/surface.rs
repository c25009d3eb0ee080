//! The outer surface of this rank's cells; and the scene of a surface of each rank.

use super::{Group, PictureError, Totals};
use crate::blueprint::{Domain, dataset};
use crate::settings::{Picture, Show};
use composite::render::RankScene;
use datasets::colormaps;
use datasets::model::{Block, ColorBy, Dataset, Points, extent_dims};
use rt_core::colormap::ColorMap;
use rt_core::glam::DVec3;
use rt_core::material::{ColorSource, Material};
use rt_core::mesh::{PerElement, TriMesh};

pub(super) type Domains<'n, 'a> = Result<Vec<Domain<'n, 'a>>, String>;

/// The outer surface of all cells.
pub(super) fn outer(
    group: &mut Group<'_>,
    domains: Domains<'_, '_>,
    wanted: &Picture,
    warnings: &mut Vec<String>,
) -> Result<(RankScene, Totals), PictureError> {
    let copied = domains.and_then(|domains| copied(&domains, wanted.topology.as_deref(), warnings));
    let mine = copied.as_ref().map(|data| {
        let leaves = data.leaves();
        let boxes = leaves.iter().fold(Totals::NOTHING, |all, leaf| all.with_box(bounds(leaf)));
        boxes.with_values(values(data, wanted.array.as_deref()).into_iter())
    });
    let whole = group.totals(&mine.map_err(String::clone))?;
    let origin = origin_of(&whole);
    let mesh = copied.and_then(|data| {
        if data.leaves().is_empty() {
            return Ok(TriMesh { origin, ..TriMesh::default() });
        }
        let made = data.to_trimesh_at(wanted.array.as_deref(), Some(origin));
        let (mesh, report) = made.map_err(|e| e.to_string())?;
        warnings.extend(report.warnings());
        if report.line_and_point_cells > 0 && mesh.num_triangles() == 0 {
            let n = report.line_and_point_cells;
            warnings.push(format!("{n} cells are lines and points, which have no surface"));
        }
        Ok(mesh)
    });
    // The range of the whole array: faces inside, between domains, show values that the surface
    // does not have, and would change the colours with the number of ranks.
    scene_of(group, mesh, Totals { range: whole.range, ..Totals::NOTHING }, wanted)
}

/// Copies of all domains.
pub(super) fn copied(
    domains: &[Domain<'_, '_>],
    topology: Option<&str>,
    warnings: &mut Vec<String>,
) -> Result<Dataset, String> {
    let mut blocks = Vec::new();
    for domain in domains {
        let read = dataset(domain, topology).map_err(|e| e.to_string())?;
        let Some((data, said)) = read else { continue };
        warnings.extend(said);
        blocks.push(Block { name: domain.path.clone(), data });
    }
    Ok(Dataset::MultiBlock(blocks))
}

/// Positions of all ranks are relative to this. Far from zero they keep their digits so.
pub(super) fn origin_of(totals: &Totals) -> DVec3 {
    let middle = 0.5 * (totals.low + totals.high);
    let size = (totals.high - totals.low).max_element();
    let far = !totals.is_nothing() && middle.abs().max_element() > 4.0 * size;
    if far { middle.as_vec3().as_dvec3() } else { DVec3::ZERO }
}

/// Bounds of points; those that are no numbers are left out.
pub(super) fn bounds(data: &Dataset) -> [DVec3; 2] {
    let nothing = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let grow = |[low, high]: [DVec3; 2], p: DVec3| match p.is_finite() {
        true => [low.min(p), high.max(p)],
        false => [low, high],
    };
    let of_points = |points: &Points| (0..points.len()).map(|i| points.get(i)).fold(nothing, grow);
    match data {
        Dataset::PolyData(d) => of_points(&d.points),
        Dataset::UnstructuredGrid(d) => of_points(&d.points),
        Dataset::StructuredGrid(d) => of_points(&d.points),
        Dataset::ImageData(d) => {
            let [i, j, k] = extent_dims(d.extent).map(|n| n.saturating_sub(1));
            [d.point(0, 0, 0), d.point(i, j, k)].into_iter().fold(nothing, grow)
        }
        Dataset::RectilinearGrid(d) => {
            let [x, y, z] = &d.coordinates;
            let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            for (axis, values) in [x, y, z].into_iter().enumerate() {
                for v in values.iter().filter(|v| v.is_finite()) {
                    (low[axis], high[axis]) = (low[axis].min(*v), high[axis].max(*v));
                }
            }
            [low, high]
        }
        Dataset::MultiBlock(_) => nothing,
    }
}

/// All values of the array.
pub(super) fn values(data: &Dataset, name: Option<&str>) -> Vec<f64> {
    let Some(Ok(by)) = name.map(|name| ColorBy::find(data, name)) else { return Vec::new() };
    let mut all = Vec::new();
    for leaf in data.leaves() {
        if let Some(array) = leaf.attributes().and_then(|attributes| by.array(attributes)) {
            all.extend((0..array.tuples()).map(|i| f64::from(by.value(array, i))));
        }
    }
    all
}

/// The scene of a mesh of each rank, with what is known of the whole besides the meshes.
pub(super) fn scene_of(
    group: &mut Group<'_>,
    mesh: Result<TriMesh, String>,
    known: Totals,
    wanted: &Picture,
) -> Result<(RankScene, Totals), PictureError> {
    let mine = mesh.as_ref().map(totals_of).map_err(String::clone);
    let totals = group.totals(&mine)?.with(&known);
    if totals.values_of == [true; 2] {
        let name = wanted.array.as_deref().unwrap_or_default();
        let reason = format!("`{name}` belongs to points on some ranks, to cells on others");
        return Err(PictureError::Contradiction { reason });
    }
    let mut material = match wanted.show {
        // Colours of a slice are read, and not seen in a light.
        Show::Slice => Material::unlit([0.8; 3]),
        _ => Material::matte([0.8; 3]),
    }
    .with_opacity(wanted.opacity);
    if wanted.is_colored() {
        material.color_source = ColorSource::Scalars(colors(&totals, wanted).into());
    }
    let mut scene = RankScene::new();
    let number = scene.material(material);
    if let Ok(mesh) = mesh
        && mesh.num_triangles() > 0
    {
        scene.mesh("surface", mesh, number);
    }
    Ok((scene, totals))
}

/// The map of colours of a picture.
pub(super) fn colors(totals: &Totals, wanted: &Picture) -> ColorMap {
    let range = totals.color_range(wanted.range);
    // The name was checked with the settings.
    colormaps::by_name(&wanted.colors, range).unwrap_or_else(|| colormaps::viridis(range))
}

fn totals_of(mesh: &TriMesh) -> Totals {
    if mesh.num_triangles() == 0 {
        return Totals::NOTHING;
    }
    let b = mesh.bounds();
    let corners = [b.min, b.max].map(|corner| mesh.origin + corner.as_dvec3());
    let totals = Totals::NOTHING.with_box(corners);
    let Some(scalars) = &mesh.scalars else { return totals };
    let of_points = scalars.per == PerElement::Vertex;
    Totals { values_of: [of_points, !of_points], ..totals }
}
