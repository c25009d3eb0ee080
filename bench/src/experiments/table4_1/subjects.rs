//! What the programs of table 4.1 draw: the wavelet's surfaces from all around, and the
//! dissertation's data sets from the views that they are known by.

use super::super::Context;
use super::super::wavelet_series::has_room;
use crate::record::Record;
use datasets::catalogue::{self, Data};
use datasets::generate::nested_wavelet::Size;
use datasets::isosurface::Options;
use datasets::view::View;
use rt_core::mesh::TriMesh;
use std::sync::Arc;

/// What a program takes a triangle with the mesh in it: gmsh, and what gluray keeps.
const BYTES_OF_ANY: f64 = 700.0;
/// The same of programs that take a view: ParaView.
const BYTES_WITH_A_VIEW: f64 = 400.0;
/// Flat sides of a tube, as many as make a streamline's segment 16 triangles.
const SIDES: u32 = 8;

/// A mesh, and the views in which programs draw it.
pub(super) struct Subject {
    pub(super) data: &'static str,
    pub(super) mesh: Arc<TriMesh>,
    /// `None`: once around the data.
    pub(super) views: Vec<Option<View>>,
}

/// The data sets of table 4.1 that are not the wavelet's series: name in the catalogue, size, size
/// with `--thesis` (the largest that a program has room for on a machine of 24 GB), and triangles
/// of both.
const DATA_SETS: [(&str, [&str; 2], [f64; 2]); 5] = [
    ("wavelet", ["4M", "16M"], [4e6, 16e6]),
    ("mixing-layer", ["medium", "large"], [6.8e6, 42.5e6]),
    ("plasma", ["medium", "large"], [3.3e6, 18.7e6]),
    ("star-field-lines", ["medium", "thesis"], [3.4e6, 34e6]),
    ("impact", ["medium", "large"], [1.5e6, 6.1e6]),
];

/// Number of subjects.
pub(super) fn count(context: &Context<'_>) -> usize {
    if context.quick { 1 } else { SERIES.len() + DATA_SETS.len() }
}

const SERIES: [Size; 3] = [Size::M1, Size::M4, Size::M16];

/// The name of subject number `i`, with its size.
pub(super) fn name(thesis: bool, i: usize) -> String {
    match SERIES.get(i) {
        Some(size) => format!("wavelet around, {}", size.name()),
        None => {
            let (name, sizes, _) = DATA_SETS[i - SERIES.len()];
            format!("{name}, {}", sizes[usize::from(thesis)])
        }
    }
}

/// Subject number `i`; `None` where there is no room for it, which the record then says.
pub(super) fn subject(
    context: &mut Context<'_>,
    record: &mut Record,
    i: usize,
) -> anyhow::Result<Option<Subject>> {
    if context.quick {
        let mesh = crate::meshes::coarse_wavelet(51)?;
        return Ok(Some(Subject { data: "wavelet", mesh, views: vec![None] }));
    }
    let mut room = |name: &str, bytes: f64| {
        let refused = has_room(bytes).map_err(|why| {
            record.missing.push(format!("{name}: a program {why}"));
        });
        refused.is_ok()
    };
    if let Some(&size) = SERIES.get(i) {
        if !room(&format!("wavelet, {}", size.name()), BYTES_OF_ANY * size.triangles() as f64) {
            return Ok(None);
        }
        let mesh = context.wavelet(size)?;
        return Ok(Some(Subject { data: "wavelet", mesh, views: vec![None] }));
    }
    let (name, sizes, triangles) = DATA_SETS[i - SERIES.len()];
    let which = usize::from(context.thesis);
    let size = sizes[which];
    if !room(&format!("{name}, {size}"), BYTES_WITH_A_VIEW * triangles[which]) {
        return Ok(None);
    }
    let entry = catalogue::find(name)?;
    context.report_step(format!("making {name}, {size}"))?;
    let data = entry.generate(size, Options { normals: true, scalars: false }, &mut |_, _| true)?;
    let mesh = match data {
        Data::Mesh(mesh) => mesh,
        Data::Lines(lines) => lines.to_tube_mesh(SIDES)?,
    };
    let views = entry.views().into_iter().map(Some).collect();
    Ok(Some(Subject { data: entry.name, mesh: Arc::new(mesh), views }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_sets_have_the_sizes_and_triangles_that_are_planned_for() {
        for (name, sizes, triangles) in DATA_SETS {
            let entry = catalogue::find(name).unwrap();
            for (size, planned) in sizes.into_iter().zip(triangles) {
                let elements = entry.size(size).unwrap().elements as f64;
                let per_element = if entry.is_lines() { f64::from(2 * SIDES) } else { 1.0 };
                let ratio = elements * per_element / planned;
                assert!((0.98..1.02).contains(&ratio), "{name}, {size}: {ratio}");
            }
            assert!(!entry.views().is_empty(), "{name}");
        }
    }
}
