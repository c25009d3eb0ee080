//! One small program per hard case, run natively and through gluray. Colour and depth must agree.

mod common;

use common::cases::{self, Expected};
use common::metrics::{compare, depths_beyond_edges, wrong_beyond_edges};
use common::{Picture, Run, Xvfb, folder, peer};
use std::path::Path;

fn check(case: &str, expected: &Expected, options: &[&str]) {
    cases::check("hard_cases.py", case, expected, options);
}

macro_rules! cases {
    ($($name:ident: $traced:literal $exit:literal;)*) => { $(
        #[test]
        fn $name() {
            check(stringify!($name), &Expected { traced: $traced, exit: $exit }, &[]);
        }
    )* };
}

cases! {
    plain: true 0;
    perspective: true 0;
    depth_range_is_clamped: true 0;
    reversed_depth_range: true 0;
    byte_normals: true 0;
    mirrored_model_view: true 0;
    singular_model_view: true 0;
    negative_w: true 0;
    vertices_behind_the_eye: true 0;
    concave_polygon: true 0;
    degenerate_strips: true 0;
    nan_vertices: true 0;
    nested_lists: true 0;
    list_changed_while_in_use: true 0;
    flat_shading: true 0;
    polygon_offset_under_lines: true 0;
    surfaces_parallel_to_the_screen: true 0;
    clip_planes: true 0;
    fog: true 0;
    color_map_texture: true 0;
    environments_of_textures: true 0;
    material_per_vertex: true 0;
    blended_over_traced: true 0;
    seventeen_contexts: true 0;
    context_destroyed_in_flight: true 0;
    threads: true 0;
    a_program_that_forks: true 0;
    arrays_beyond_their_buffer: true 0;
    errors: true 0;
    select_and_feedback: true 0;
    a_program_that_ends_without_handlers: true 3;
    soak: true 0;
}

#[test]
fn the_same_by_ld_preload() {
    for case in ["plain", "nested_lists", "seventeen_contexts"] {
        check(case, &Expected { traced: true, exit: 0 }, &["--via", "preload"]);
    }
}

#[test]
fn nothing_is_traced_when_tracing_is_off() {
    check("plain", &Expected { traced: false, exit: 0 }, &["--mode", "off"]);
}

#[test]
fn near_and_far_planes_at_any_distance_leave_no_holes() {
    check_all(&["near_plane_far_in_front", "near_plane_somewhat_in_front", "far_plane_far_behind"]);
}

/// Cases with lists, attributes and state between them, where splitting a list can be seen.
const LISTS: [&str; 4] = [
    "colour_material_twice",
    "colour_material_twice_in_a_list",
    "colour_material_twice_in_a_list_that_is_executed",
    "material_before_colour_material_in_a_list",
];

#[test]
fn colours_between_changes_of_colour_material_are_the_drivers() {
    check_all(&LISTS);
}

/// What a case draws natively, and with what `set` of variables and options; both to the bit.
fn assert_untouched(case: &str, options: &[&str], environment: &[(&str, &str)]) {
    let Some(python) = peer("RTSV_SYSTEM_PYTHON") else { return };
    let Some(x) = Xvfb::start() else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/hard_cases.py");
    let place = folder();
    let draw = |through, environment| {
        let run = Run { x: &x, folder: place.path(), through, environment };
        let (output, report) =
            run.program(&python, &[script.to_str().expect("UTF-8"), case, "out"]);
        assert!(output.status.success() && output.stderr.is_empty(), "{case}: {output:?}");
        (std::fs::read(place.path().join("out")).expect("a picture"), report)
    };
    let ((native, _), (ours, report)) = (draw(None, &[]), draw(Some(options), environment));
    let differ = native.iter().zip(&ours).filter(|(a, b)| a != b).count();
    assert_eq!((native.len(), differ), (ours.len(), 0), "{case}: bytes of colour and depth");
    assert_eq!((report.traced_draws, report.mode.as_str()), (0, "off"), "{case}");
}

#[test]
fn with_tracing_off_every_call_is_the_drivers() {
    let others =
        ["nested_lists", "lists_over_several_frames", "material_per_vertex", "clip_planes"];
    for case in LISTS.iter().chain(&others) {
        assert_untouched(case, &["--mode", "off"], &[]);
    }
    assert_untouched(LISTS[1], &["--via", "preload"], &[("GLURAY_ENABLED", "0")]);
}

#[test]
fn quads_of_smooth_points_or_lines_are_split_as_the_driver_does() {
    check_all(&[
        "quads_with_smooth_lines",
        "quads_with_smooth_lines_and_offset",
        "quads_by_arrays_with_smooth_points_and_offset",
        "quads_with_stippled_and_offset_lines",
        "quads_with_unbroken_stippled_lines_and_offset",
        "quads_of_two_sides_with_smooth_lines",
        "quads_of_two_sides",
    ]);
}

#[test]
fn a_test_for_equal_depth_after_the_driver_is_the_drivers() {
    let traced = Expected { traced: false, exit: 0 };
    check("equal_depths_after_the_driver", &traced, &["--trace", "all"]);
}

#[test]
fn blending_in_order_is_traced_when_all_is_asked_for() {
    check("blended_over_traced", &Expected { traced: true, exit: 0 }, &["--trace", "all"]);
}

fn check_all(cases: &[&str]) {
    for case in cases {
        check(case, &Expected { traced: true, exit: 0 }, &[]);
    }
}

#[test]
fn several_draws_in_one_call_are_traced_as_one_by_one() {
    check_all(&[
        "several_ranges",
        "several_clipped_quads",
        "several_lists_of_indices",
        "several_ranges_in_a_list",
        "several_lists_of_indices_in_a_list",
        "several_draws_that_are_refused",
    ]);
}

#[test]
fn mipmaps_are_the_drivers() {
    check_all(&["mipmaps", "levels_and_limits_of_textures", "generated_mipmaps"]);
}

#[test]
fn what_was_drawn_keeps_its_texels_and_textures_that_are_gone_are_not_held() {
    check_all(&["textures_replaced_between_draws", "a_thousand_textures"]);
}

#[test]
fn samples_are_the_drivers_one_by_one_and_resolved() {
    check_all(&["samples_of_surfaces", "resolved_samples", "samples_switched_off"]);
}

#[test]
fn samples_of_draws_in_order_are_written_one_by_one() {
    check("samples_in_order", &Expected { traced: true, exit: 0 }, &["--trace", "all"]);
}

#[test]
fn of_layers_in_one_plane_the_last_is_seen() {
    check("layers_in_one_plane", &Expected { traced: true, exit: 0 }, &["--trace", "all"]);
}

/// A square of 128 x 128 pixels with a large surface and, if `small` is given, a triangle of three
/// to six pixels a side.
fn planted(small: Option<usize>) -> (Picture, Vec<f32>) {
    const SIZE: usize = 128;
    let (mut pixels, mut depth) = (vec![[20, 20, 40]; SIZE * SIZE], vec![1.0; SIZE * SIZE]);
    for y in 0..SIZE {
        for x in 0..SIZE {
            if x > 10 && y > 10 && x + y < 120 {
                (pixels[y * SIZE + x], depth[y * SIZE + x]) =
                    ([200, 120, 60], 0.5 + 0.001 * x as f32);
            }
            if small.is_some_and(|n| x >= 100 && y >= 100 && x + y < 200 + n) {
                (pixels[y * SIZE + x], depth[y * SIZE + x]) = ([60, 200, 90], 0.25);
            }
        }
    }
    (Picture { width: SIZE, height: SIZE, pixels }, depth)
}

#[test]
fn a_lost_small_triangle_and_an_added_one_are_found() {
    let (without, far) = planted(None);
    for side in 1..7 {
        let (with, near) = planted(Some(side));
        let m = compare(&with, &without);
        assert!(m.raw <= 0.5 && m.overlap >= 0.995, "too small for shares of the picture: {m:?}");
        assert!(!wrong_beyond_edges(&with, &without).is_empty(), "lost, {side} pixels a side");
        assert!(!wrong_beyond_edges(&without, &with).is_empty(), "added, {side} pixels a side");
        assert!(
            !depths_beyond_edges(128, &near, &far, 1e-6).is_empty(),
            "lost, {side} pixels a side"
        );
        assert!(
            !depths_beyond_edges(128, &far, &near, 1e-6).is_empty(),
            "added, {side} pixels a side"
        );
    }
    assert!(wrong_beyond_edges(&without, &planted(None).0).is_empty());
}

#[test]
fn an_edge_that_is_moved_by_a_pixel_is_found_in_corners_and_where_it_is_an_area() {
    let (native, _) = planted(None);
    let mut ours = planted(None).0;
    // One more pixel of the slanted edge, which rounding can explain; then a block of them.
    ours.pixels[60 * 128 + 60] = [200, 120, 60];
    assert_eq!(wrong_beyond_edges(&native, &ours), Vec::<String>::new());
    for (x, y) in [(61, 60), (60, 61), (61, 61)] {
        ours.pixels[y * 128 + x] = [200, 120, 60];
    }
    assert!(!wrong_beyond_edges(&native, &ours).is_empty());
}

#[test]
fn a_depth_beside_an_edge_may_continue_the_surface_and_no_more() {
    const SIZE: usize = 32;
    // Nearest at its edge, in front of a distant background.
    let curved = |end: usize| -> Vec<f32> {
        let depth = |x: usize| if x < end { 0.5 - 1e-4 * (x * x) as f32 } else { 1.0 };
        (0..SIZE * SIZE).map(|i| depth(i % SIZE)).collect()
    };
    let (native, at) = (curved(20), 16 * SIZE + 20);
    let mut ours = native.clone();
    ours[at] = curved(21)[at];
    assert_eq!(depths_beyond_edges(SIZE, &native, &ours, 1e-6), Vec::<String>::new());
    assert_eq!(depths_beyond_edges(SIZE, &ours, &native, 1e-6), Vec::<String>::new());
    ours[at] = native[at - 1] + 3.0 * (native[at - 1] - native[at - 2]);
    assert!(!depths_beyond_edges(SIZE, &native, &ours, 1e-6).is_empty());
    assert!(!depths_beyond_edges(SIZE, &ours, &native, 1e-6).is_empty());
}
