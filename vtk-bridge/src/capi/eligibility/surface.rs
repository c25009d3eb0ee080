//! The data of actors: their cells, colours and textures.

use super::super::facts::{RTV_SURFACE, RtvSurfaceFacts};
use super::super::types::RTV_COLOR_PROPERTY;
use super::{Radii, first};

/// The array of point numbers that could not be read: the type of its numbers and its VTK class.
#[derive(Debug, Clone, Copy)]
pub(in crate::capi) struct CellArray<'a> {
    pub(in crate::capi) number_type: &'a str,
    /// Empty if there is no array.
    pub(in crate::capi) class: &'a str,
}

/// Why OpenGL draws an actor with this surface.
pub(in crate::capi) fn surface(
    f: &RtvSurfaceFacts,
    cells: CellArray<'_>,
    radii: Radii,
) -> Option<String> {
    let polygons = f.representation == RTV_SURFACE;
    let (texture, back) = (f.texture != 0, f.has_back != 0);
    let of_data = first(&[
        (f.not_polygons != 0, "its data are not polygons"),
        (
            polygons && f.num_verts > 0 && radii.point <= 0.0,
            "it has vertices (set RTV_POINT_RADIUS to trace them as spheres)",
        ),
        (
            polygons && f.num_lines > 0 && radii.line <= 0.0,
            "it has lines (set RTV_LINE_RADIUS to trace them as tubes)",
        ),
    ]);
    let of_cells = || {
        let array = match cells.class {
            "" => "no array".to_owned(),
            class => format!("{} x {} of {class}", f.cell_components, cells.number_type),
        };
        (f.unreadable_cells != 0).then(|| format!("its cells are numbered by {array}"))
    };
    let of_surface = first(&[
        (f.triangulated != 0 && f.edges != 0, "edges of polygons that are not convex"),
        (texture && back, "a texture on a surface whose backs have a property of their own"),
        (texture && f.color_source != RTV_COLOR_PROPERTY, "it has a texture and colours"),
        (
            f.maps != 0 && back,
            "textures of the property on a surface whose backs have a property of their own",
        ),
        (f.invalid_arrays != 0, "its arrays do not fit together (a warning names them)"),
    ]);
    of_data.map(str::to_owned).or_else(of_cells).or_else(|| of_surface.map(str::to_owned))
}
