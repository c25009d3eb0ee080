//! Unusual behaviour found in real programs, one small program each. The image must equal the
//! driver's, and be traced where possible.

mod common;

use common::cases::{Expected, check};

fn draws(case: &str, traced: bool, options: &[&str]) {
    check("traps.py", case, &Expected { traced, exit: 0 }, options);
}

#[test]
fn generated_lists_with_state_between_primitives() {
    draws("generated_lists_with_state_between_primitives", true, &[]);
}

#[test]
fn quads_of_immediate_mode() {
    draws("quads_of_immediate_mode", true, &[]);
}

#[test]
fn quads_of_which_one_is_clipped() {
    draws("quads_of_which_one_is_clipped", true, &[]);
}

#[test]
fn quads_of_a_display_list() {
    draws("quads_of_a_display_list", true, &[]);
}

#[test]
fn quads_of_a_list_that_is_passed() {
    draws("quads_of_a_list_that_is_passed", false, &[]);
}

#[test]
fn quads_by_index() {
    draws("quads_by_index", true, &[]);
}

#[test]
fn arrays_of_a_list_leave_the_current_normal_alone() {
    draws("arrays_of_a_list_leave_the_current_normal_alone", true, &[]);
}

#[test]
fn strips_that_restart_within_a_list() {
    draws("strips_that_restart_within_a_list", true, &[]);
}

#[test]
fn a_second_texture_is_bound_right_after_a_draw_with_the_first() {
    draws("a_second_texture_is_bound_right_after_a_draw_with_the_first", true, &[]);
}

#[test]
fn things_around_the_viewer() {
    draws("things_around_the_viewer", true, &[]);
}

#[test]
fn masks_that_tell_front_from_back() {
    draws("masks_that_tell_front_from_back", true, &["--trace", "all"]);
}

#[test]
fn textures_of_few_components() {
    draws("textures_of_few_components", true, &[]);
}

#[test]
fn fog_by_distance() {
    draws("fog_by_distance", false, &["--trace", "all"]);
}

#[test]
fn an_alpha_test_for_equality() {
    draws("an_alpha_test_for_equality", false, &["--trace", "all"]);
}

#[test]
fn mipmaps_in_views_of_odd_heights() {
    draws("mipmaps_in_views_of_odd_heights", true, &[]);
}

#[test]
fn colour_material_with_the_same_colour_again() {
    draws("colour_material_with_the_same_colour_again", true, &[]);
}

#[test]
fn a_framebuffer_object_and_then_the_window() {
    draws("a_framebuffer_object_and_then_the_window", true, &["--trace", "all"]);
}

#[test]
fn colour_material_after_a_material_that_nobody_has_drawn_with() {
    draws("colour_material_after_a_material_that_nobody_has_drawn_with", true, &[]);
}

#[test]
fn pixels_that_are_scaled_while_surfaces_wait() {
    draws("pixels_that_are_scaled_while_surfaces_wait", true, &[]);
}

#[test]
fn names_of_lists_are_small() {
    draws("names_of_lists_are_small", true, &[]);
}

#[test]
fn elements_of_arrays_in_a_list() {
    draws("elements_of_arrays_in_a_list", true, &[]);
}
