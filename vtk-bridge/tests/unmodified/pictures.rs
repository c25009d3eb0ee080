//! The same picture with and without rays.

use crate::peers::{Program, Run, peers};
use crate::shot::Difference;

/// Silhouettes may differ in this share of the pixels: two rasterisers' opinions about centres that lie on an edge.
const SILHOUETTE: f64 = 0.0002;
/// Depth, in steps of the 24-bit buffer: OpenGL transforms vertices in f32 and interpolates over triangles.
const DEPTH_STEPS: f64 = 4.0;
/// Mean of colour, levels of 255, where the shading is the same.
const COLOR: f64 = 0.5;

fn compare(program: Program, script: &str) -> Option<Difference> {
    let peers = peers()?;
    let (stock, _) = peers.shot(program, script, &Run::plain());
    let (traced, said) = peers.shot(program, script, &Run::traced());
    assert!(stock.covered() * 100 > stock.rgba.len(), "{script}: the stock picture is empty");
    assert!(stock.classes.iter().all(|c| c != "vtkRtvRenderer"), "{:?}", stock.classes);
    assert!(traced.classes.iter().any(|c| c == "vtkRtvRenderer"), "{:?}\n{said}", traced.classes);
    assert!(!said.contains("vtk-bridge:"), "{script} needs no warning: {said}");
    assert_eq!(stock.answers, traced.answers, "{script}: picks and selections");
    let d = stock.difference(&traced);
    assert!(d.silhouette <= SILHOUETTE, "{script}: {d:?}");
    assert!(d.depth_steps <= DEPTH_STEPS, "{script}: {d:?}");
    Some(d)
}

fn same_picture(program: Program, script: &str) {
    if let Some(d) = compare(program, script) {
        assert!(d.color_mean <= COLOR && d.inner_color_mean <= COLOR, "{script}: {d:?}");
    }
}

macro_rules! same_pictures {
    ($($name:ident: $program:expr, $script:literal;)*) => {
        $(#[test]
        fn $name() {
            same_picture($program, $script);
        })*
    };
}

same_pictures! {
    contours_with_a_lookup_table: Program::Vtk, "vtk/contours";
    highlights_flat_and_smooth_under_several_lights: Program::Vtk, "vtk/specular";
    the_light_kit: Program::Vtk, "vtk/light_kit";
    glyphs_are_instances_in_their_places: Program::Vtk, "vtk/glyphs";
    streamlines_in_an_outline: Program::Vtk, "vtk/streamlines";
    blocks_keep_their_colours_and_visibility: Program::Vtk, "vtk/multi_block";
    opacity_in_the_order_of_depth_peeling: Program::Vtk, "vtk/opacity";
    textures_nearest_and_linear: Program::Vtk, "vtk/textures";
    physically_based_surfaces: Program::Vtk, "vtk/pbr";
    parallel_projection_off_centre_with_cell_colours: Program::Vtk, "vtk/parallel_projection";
    clipping_planes_of_a_moved_actor: Program::Vtk, "vtk/clipping";
    a_volume_around_a_surface: Program::Vtk, "vtk/volume_and_surface";
    annotations_and_wireframe_at_the_right_depth: Program::Vtk, "vtk/annotations";
    two_viewports_and_a_layer: Program::Vtk, "vtk/two_viewports";
    picks_and_selections: Program::Vtk, "vtk/selection";
    unstructured_grids_culled_backs_and_scaled_actors: Program::Vtk, "vtk/data_set_mapper";
    paraview_s_light_kit_axes_and_scalar_bar: Program::ParaView, "paraview/light_kit";
}

#[test]
fn paraview_s_translucent_contours() {
    // ParaView peels only four layers where ours has all: edges where five overlap differ.
    if let Some(d) = compare(Program::ParaView, "paraview/opacity") {
        assert!(d.color_mean <= COLOR, "{d:?}");
    }
}
