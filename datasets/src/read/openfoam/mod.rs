//! Cases of OpenFOAM: the folder of a case, a `.foam` file in it, or the folder of one time.
//!
//! Files may be text or binary (labels and scalars of 32 or 64 bits), plain or gzipped; the case
//! may be decomposed (`processor0`, `processor1`, ..., or collated in `processorsN`), its mesh may
//! move. Fields on cells become cell arrays. A case that is one cell thick, between patches of type
//! `empty` or `wedge`, becomes a plane of polygons, which schlieren extrudes or revolves. The
//! patches of the boundary are listed in the field data `boundary patches`, one text
//! `NAME TYPE FACES` each: a `wall` is a body, a `patch` is open. Two faces of walls at one place
//! are a wall without thickness, listed as [`crate::model::BAFFLES`].
//!
//! Source: OpenFOAM User Guide, chapters "Case structure", "Mesh description" and "Boundaries".

mod baffles;
mod case_folder;
mod collated;
mod fields;
mod plane;
mod poly_mesh;
mod shapes;
mod text;

use super::error::Fault;
use super::options::step_at;
use super::{Content, LoadedFile, OpenOptions, ReadError};
use crate::model::Dataset;
use baffles::Baffles;
use case_folder::CaseFolder;
use plane::Symmetry;
use poly_mesh::PolyMesh;
use std::path::Path;

pub(crate) const FORMAT: &str = text::FORMAT;
/// Name of the field data that lists the patches.
pub const BOUNDARY_PATCHES: &str = "boundary patches";

/// Whether the path is that of a case, or of one of its times.
pub fn is_case(path: &Path) -> bool {
    case_folder::locate(path).is_some()
}

/// Whether the path is that of a case, and not of one of its times.
pub fn is_whole_case(path: &Path) -> bool {
    case_folder::locate(path).is_some_and(|(_, time)| time.is_none())
}

/// Reads a case at its last time, or at the time that the path or the options name.
///
/// # Errors
/// If the mesh or a field is missing or damaged, or there is no such time.
pub fn read(path: &Path, options: &OpenOptions) -> Result<LoadedFile, ReadError> {
    let fault = |f: Fault| f.in_file(path, FORMAT);
    options.refuse_lattice().map_err(fault)?;
    let Some((root, named)) = case_folder::locate(path) else {
        let what = "it is neither a case nor a time of one";
        return Err(fault(Fault::option(
            super::At::Field("the folder".into()),
            what,
            "name the folder that holds constant and system, or a .foam file in it",
        )));
    };
    let case = CaseFolder::open(&root)?;
    let mut warnings = case.warnings.clone();
    let steps = case.steps();
    let time = match (&named, options.time) {
        (Some(_), Some(_)) => {
            options.refuse_time().map_err(fault)?;
            None
        }
        (Some(name), None) => match case.times.iter().position(|t| t.1 == *name) {
            Some(i) => Some(i),
            None => {
                let value = name.parse().unwrap_or(f64::NAN);
                let step = step_at(&steps, value).map_err(fault)?;
                steps.iter().position(|s| s.time == step.time)
            }
        },
        (None, Some(t)) => {
            let step = step_at(&steps, t).map_err(fault)?;
            steps.iter().position(|s| s.time == step.time)
        }
        (None, None) => steps.len().checked_sub(1),
    };
    if named.is_none() && options.time.is_none() && steps.len() > 1 {
        let last = steps.last().map_or(0.0, |s| s.time);
        warnings.push(format!("a case with {} times; this is the last, t = {last}", steps.len()));
    }

    let mut parts = Vec::with_capacity(case.parts.len());
    for part in &case.parts {
        parts.push(PolyMesh::read(|name| case.mesh_file(part, name, time))?);
    }
    let cells_of_parts: Vec<usize> = parts.iter().map(|p| p.cells).collect();
    let mesh = PolyMesh::join(parts);
    let arrays = match time {
        Some(t) => fields::fields(&case, t, &cells_of_parts, &mut warnings)?,
        None => {
            warnings.push("the case has no times: only its mesh is read".into());
            Vec::new()
        }
    };
    let patches = patches(&mesh);
    let baffles = Baffles::of(&mesh);
    warnings.extend(baffles.warning());
    let mut grid = match plane::flattened(&mesh) {
        Some((mut plane, symmetry)) => {
            if symmetry == Symmetry::Axis {
                plane.attributes.set_axisymmetric();
            }
            warnings.push(match symmetry {
                Symmetry::Plane => "the case is two-dimensional (patches of type empty): it is \
                                    read as a plane of polygons"
                    .into(),
                Symmetry::Axis => "the case is axisymmetric (patches of type wedge): it is read \
                                   as a plane of polygons, x along the axis and y the radius"
                    .into(),
            });
            plane
        }
        None => shapes::solid_cells(mesh),
    };
    grid.attributes.cell = arrays;
    grid.attributes.field.extend(baffles.array());
    grid.attributes.text.push((BOUNDARY_PATCHES.into(), patches));
    let data = Dataset::UnstructuredGrid(grid);
    data.check().map_err(|e| fault(e.into()))?;
    Ok(LoadedFile { format: FORMAT, content: Content::Data(data), warnings, time_steps: steps })
}

/// Name, type and number of faces of each patch, summed over the parts of a decomposed case.
fn patches(mesh: &PolyMesh) -> Vec<String> {
    let mut sums: Vec<(&str, &str, usize)> = Vec::new();
    for p in mesh.patches.iter().filter(|p| !p.kind.starts_with("processor")) {
        match sums.iter_mut().find(|s| s.0 == p.name) {
            Some(sum) => sum.2 += p.faces.len(),
            None => sums.push((&p.name, &p.kind, p.faces.len())),
        }
    }
    sums.into_iter().map(|(name, kind, faces)| format!("{name} {kind} {faces}")).collect()
}
