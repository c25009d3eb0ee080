//! Glyphs: their sources, data and colours.

use super::super::facts::RtvGlyphFacts;
use super::first;

/// Why OpenGL draws an actor with these glyphs.
pub(in crate::capi) fn glyphs(f: &RtvGlyphFacts) -> Option<&'static str> {
    let source_is_polygons = f.num_source_polygons > 0 && f.num_other_source_cells == 0;
    // OpenGL gives the point of this number the colour of this number, whatever it belongs to.
    let colors_of_points = f.num_colors == f.num_points && f.color_components == 4;
    first(&[
        (f.source_table_tree != 0, "glyphs from a tree of sources"),
        (f.num_clipping_planes > 0, "glyphs with clipping planes"),
        (f.num_sources == 0, "glyphs without a source"),
        (f.has_source != 0 && !source_is_polygons, "glyphs whose source is not polygons"),
        (
            f.data_set == 0 && (f.composite == 0 || f.block_attributes != 0),
            "glyphs on blocks with colours or visibility of their own",
        ),
        (f.num_blocks_without_points > 0, "glyphs on data without points"),
        (f.has_colors != 0 && !colors_of_points, "glyphs with colours that are not of points"),
    ])
}
