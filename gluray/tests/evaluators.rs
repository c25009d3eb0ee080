//! Surfaces and curves of OpenGL's evaluators, one small program each. The image must equal the
//! driver's, and be traced where possible.

mod common;

use common::cases::{Expected, check};

fn draws(case: &str, traced: bool, options: &[&str]) {
    let Some(m) = check("evaluators.py", case, &Expected { traced, exit: 0 }, options) else {
        return;
    };
    assert!(m.raw <= 0.2 && m.tolerant <= 0.02, "{case}: {m:?}");
}

macro_rules! traced {
    ($($name:ident)*) => { $(
        #[test]
        fn $name() {
            draws(stringify!($name), true, &[]);
        }
    )* };
}

traced! {
    patch_with_automatic_normals
    patches_of_every_order
    a_map_of_normals
    colours_by_map_without_light
    colours_by_map_as_material
    texture_coordinates_by_maps
    vertices_by_evaluators_among_others
    in_display_lists
    rational_surfaces
    weights_that_are_not_positive
    lines_and_points_over_patches
    flat_patches
    transparent_colours_by_map
    maps_of_attribute_stacks
    errors_of_evaluators
    nurbs_of_glu
    a_library_that_is_opened_late
}

#[test]
fn without_a_depth_test() {
    draws("without_a_depth_test", false, &[]);
    draws("without_a_depth_test", true, &["--trace", "all"]);
}

#[test]
fn automatic_normals_over_a_domain_that_runs_backwards() {
    draws("automatic_normals_over_a_domain_that_runs_backwards", false, &[]);
}
