//! The same unmodified scripts in Debian's VTK 9.1, without and with the bridge.

use crate::capture::Capture;
use crate::compare::{Limits, faults};
use crate::peers::skip;
use crate::scripts::{Exception, differences};
use crate::session::{Program, Run, With, output, scripts_in};
use std::sync::OnceLock;

/// Runs without and with the bridge.
struct Both {
    stock: Run,
    ours: Run,
}

fn both() -> Option<&'static Both> {
    static BOTH: OnceLock<Result<Both, String>> = OnceLock::new();
    let made = BOTH.get_or_init(|| {
        let scripts = scripts_in("vtk");
        let run = |with, name| Run::new(Program::Vtk, with, &scripts, output(name), &[]);
        // In parallel: stock needs neither the bridge nor the compiler that builds its shims.
        let (stock, ours) = std::thread::scope(|s| {
            let stock = s.spawn(|| run(With::Stock, "vtk-stock"));
            let ours = run(With::Bridge, "vtk-ours");
            (stock.join().expect("stock's thread"), ours)
        });
        Ok(Both { stock: stock?, ours: ours? })
    });
    made.as_ref().map_err(|reason| skip(reason)).ok()
}

/// Limits for shaded volumes.
pub(crate) const SHADED: Limits = Limits { color_mean: 1.5, ..Limits::STRICT };
/// Limits for volumes with gradient opacity.
const GRADIENT_OPACITY: Limits = Limits { color_mean: 2.5, color_strays: 0.002, ..Limits::STRICT };
/// Limits for isosurfaces of volumes.
const ISOSURFACES: Limits = Limits { color_strays: 0.005, ..SHADED };

/// Limits for windows with several samples: stock's depth is that of a sample, ours that of the
/// centre where a surface fills the pixel.
const SAMPLED: Limits = Limits { depth_ulp: u32::MAX, depth_strays: 1.0, ..Limits::STRICT };
const SAMPLED_WHY: &str = "stock's depth is that of the first sample";

const SAMPLED_LINES: Limits = Limits { silhouette: 0.002, color_strays: 0.002, ..SAMPLED };
const SAMPLED_LINES_WHY: &str =
    "what lines of VTK 9.1 reach beyond the surface is not hit by rays and has one sample";

const LEFT_BEHIND: &str = "OpenGL's light does not follow a turned volume; ours does \
                           (`turning_a_volume_or_camera_and_light_is_the_same`)";

/// Images with their own limits, or without limits, and the reason.
pub(crate) const EXCEPTIONS: &[Exception] = &[
    (
        "volume_blends",
        "gradient_opacity",
        Some(GRADIENT_OPACITY),
        "OpenGL takes differences over a twentieth more than the distance of points, and half of \
         them at the bounds",
    ),
    ("volume_blends", "gradient_opacity_shaded", Some(GRADIENT_OPACITY), "as gradient opacity"),
    (
        "edges",
        "edges",
        Some(Limits { depth_strays: 0.003, ..Limits::STRICT }),
        "where moved triangles overlap inside a surface, OpenGL shows the one in front, we the one \
         that the ray meets",
    ),
    (
        "odd_inputs",
        "not_a_number",
        None,
        "OpenGL shows nothing of a surface with one bad point; we show the rest \
         (`one_bad_point_costs_only_its_own_triangles`)",
    ),
    (
        "pbr_terms",
        "lines_of_physical_surfaces",
        Some(Limits { color_mean: 6.0, color_strays: 0.25, ..Limits::STRICT }),
        "along the rims of lines OpenGL mixes colours before it lights them, we the two results",
    ),
    (
        "pbr_terms",
        "lines_under_highlights",
        Some(Limits { color_mean: 0.8, color_strays: 0.015, ..Limits::STRICT }),
        "where lines of VTK 9.1 reach beyond the surface, OpenGL lights them and we do not",
    ),
    (
        "projections",
        "sheared",
        Some(Limits { color_mean: 255.0, color_strays: 1.0, ..Limits::STRICT }),
        "OpenGL shades in sheared coordinates, where right angles are none: its light is wrong",
    ),
    (
        "volumes",
        "shaded",
        Some(SHADED),
        "at the bounds of the grid OpenGL takes its gradient from clamped texels, which is half of \
         the difference across",
    ),
    (
        "volume_blends",
        "isosurfaces",
        Some(ISOSURFACES),
        "OpenGL's steps pass by where a ray only grazes a surface",
    ),
    ("volume_blends", "isosurfaces_shaded", Some(ISOSURFACES), "as isosurfaces and shaded volumes"),
    ("volume_lights", "three", Some(SHADED), "as shaded volumes"),
    ("volume_lights", "one_beside", Some(SHADED), "as shaded volumes"),
    ("volume_lights", "colored_headlight", Some(SHADED), "as shaded volumes"),
    ("volume_lights", "weak_headlight", Some(SHADED), "as shaded volumes"),
    ("volume_lights", "kit", Some(SHADED), "as shaded volumes"),
    ("volume_lights", "kit_turned", None, LEFT_BEHIND),
    ("volume_lights", "turned", None, LEFT_BEHIND),
    ("volume_lights", "camera_turned", Some(SHADED), "as shaded volumes"),
    ("volume_regions", "cells_shaded", Some(SHADED), "as shaded volumes"),
    ("volume_regions", "plane_and_light", Some(SHADED), "as shaded volumes"),
    (
        "volume_regions",
        "largest_in_a_box",
        Some(Limits { color_strays: 0.001, ..Limits::STRICT }),
        "where the largest scalar lies on a plane of the cropping, OpenGL's samples end before it",
    ),
    (
        "volumes",
        "translucent_inside",
        Some(Limits { color_mean: 3.0, color_strays: 0.2, ..Limits::STRICT }),
        "OpenGL blends volumes over all translucent surfaces, also over those in front of them and \
         inside",
    ),
    ("window_samples", "glyphs_4", Some(SAMPLED), SAMPLED_WHY),
    ("window_samples", "glyphs_8", Some(SAMPLED), SAMPLED_WHY),
    ("window_samples", "isosurface_4", Some(SAMPLED), SAMPLED_WHY),
    ("window_samples", "isosurface_8", Some(SAMPLED), SAMPLED_WHY),
    ("window_samples", "creases_4", Some(SAMPLED), SAMPLED_WHY),
    ("window_samples", "creases_8", Some(SAMPLED), SAMPLED_WHY),
    ("window_samples", "edges_4", Some(SAMPLED_LINES), SAMPLED_LINES_WHY),
    ("window_samples", "edges_8", Some(SAMPLED_LINES), SAMPLED_LINES_WHY),
    ("window_samples", "translucent_4", Some(SAMPLED), SAMPLED_WHY),
    ("window_samples", "translucent_8", Some(SAMPLED), SAMPLED_WHY),
    (
        "windows",
        "one_pixel",
        Some(Limits { color_mean: 1.0, ..Limits::STRICT }),
        "one level of one pixel is more than half a level",
    ),
    (
        "textures",
        "transparent",
        Some(Limits { silhouette: 1.0, depth_ulp: u32::MAX, ..Limits::STRICT }),
        "OpenGL writes no depth for a surface with a translucent texture; we write it where the \
         texture is opaque",
    ),
];

/// Images that contain nothing to trace.
pub(crate) const EMPTY: &[(&str, &str)] =
    &[("odd_inputs", "nothing"), ("windows", "no_renderer"), ("windows", "actor_gone")];

fn same_as_stock(script: &str) {
    let Some(both) = both() else { return };
    let found = differences(&both.stock, &both.ours, script, &[EXCEPTIONS], EMPTY);
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
}

macro_rules! scripts {
    ($($test:ident: $script:literal,)*) => {
        /// Every script has a test.
        const TESTED: &[&str] = &[$($script),*];
        $(#[test]
        fn $test() {
            same_as_stock($script);
        })*
    };
}

scripts! {
    annotations_stay_opengl_in_the_same_image: "annotations",
    smoothed_images_stay_smooth: "antialiased",
    back_faces_are_as_in_stock_vtk: "backfaces",
    data_that_changes_is_drawn_as_it_is_now: "changing",
    clipping_planes_cut_as_in_stock_vtk: "clipping",
    colors_of_points_cells_and_fields_are_stock: "colors",
    properties_that_meet_are_as_in_stock_vtk: "combinations",
    contours_are_as_in_stock_vtk: "contours",
    data_sets_of_other_kinds_are_as_in_stock_vtk: "data_sets",
    domains_of_any_size_and_place_show_the_same_picture_as_stock: "domains",
    edges_of_surfaces_are_as_in_stock_vtk: "edges",
    glyphs_are_as_in_stock_vtk: "glyphs",
    glyphs_of_one_source_are_instances: "instances",
    lights_are_as_in_stock_vtk: "lights",
    five_hundred_actors_are_as_in_stock_vtk: "many_actors",
    blocks_have_their_own_color_opacity_and_visibility: "multiblock",
    odd_inputs_are_survived: "odd_inputs",
    opacity_is_as_with_depth_peeling: "opacity",
    highlights_of_parallel_projections_are_as_in_stock_vtk: "parallel_lights",
    physically_based_surfaces_are_as_in_stock_vtk: "pbr",
    textures_of_physically_based_surfaces_are_as_in_stock_vtk: "pbr_maps",
    coefficients_scalars_lines_and_smooth_metals_are_lit_as_by_vtks_shader_of_this_version: "pbr_terms",
    projections_of_all_kinds_are_exact: "projections",
    blocks_beside_a_refused_one_are_not_drawn_twice: "refused_blocks",
    props_of_every_reason_are_as_in_stock_vtk: "reasons",
    edges_points_and_mixed_cells_are_as_in_stock_vtk: "representations",
    picks_and_selections_are_stock: "selection",
    highlights_are_as_in_stock_vtk: "specular",
    streamlines_are_as_in_stock_vtk: "streamlines",
    textures_are_as_in_stock_vtk: "textures",
    viewports_do_not_mix: "viewports",
    volumes_mix_with_surfaces: "volume",
    projections_of_volumes_are_as_in_stock_vtk: "volume_blends",
    shaded_volumes_under_any_lights_are_as_in_stock_vtk: "volume_lights",
    parts_of_volumes_and_scalars_of_cells_are_as_in_stock_vtk: "volume_regions",
    volumes_are_as_in_stock_vtk: "volumes",
    edges_are_as_smooth_as_the_windows_samples: "window_samples",
    windows_come_and_go: "windows",
}

#[test]
fn every_script_has_a_test() {
    let there = scripts_in("vtk");
    let names: Vec<&str> = there.iter().filter_map(|p| p.file_stem()?.to_str()).collect();
    let mut tested = TESTED.to_vec();
    tested.sort_unstable();
    assert_eq!(names, tested);
}

/// Shows that the limits measure the bridge and not the scheduling of OpenGL's threads.
#[test]
fn stock_against_stock_passes_and_planted_faults_do_not() {
    // Separate runs of the two scripts that are compared: neither the bridge nor the other scripts
    // are needed.
    let mut scripts = scripts_in("vtk");
    scripts.retain(|p| p.ends_with("contours.py") || p.ends_with("opacity.py"));
    let run = |name| Run::new(Program::Vtk, With::Stock, &scripts, output(name), &[]);
    let (first, again) = match (run("vtk-stock-once"), run("vtk-stock-again")) {
        (Ok(first), Ok(again)) => (first, again),
        (Err(reason), _) | (_, Err(reason)) => return skip(&reason),
    };
    for (script, name) in [("contours", "turned"), ("contours", "flat"), ("opacity", "opacity")] {
        let [stock, second] = [&first, &again].map(|r| r.capture(script, name).unwrap());
        assert_eq!(
            faults(&stock, &second, &Limits::STRICT),
            Vec::<String>::new(),
            "{script}/{name}"
        );
        let mut shifted = second.clone();
        shifted.rgb.rotate_right(1);
        shifted.depth.rotate_right(1);
        assert!(
            !faults(&stock, &shifted, &Limits::STRICT).is_empty(),
            "{script}/{name}: a shift by a pixel passed"
        );
        let mut brighter = second.clone();
        brighter.rgb.iter_mut().flatten().for_each(|c| *c = c.saturating_add(2));
        assert!(
            !faults(&stock, &brighter, &Limits::STRICT).is_empty(),
            "{script}/{name}: two of 255 brighter passed"
        );
    }
}

#[test]
fn one_bad_point_costs_only_its_own_triangles() {
    let Some(both) = both() else { return };
    let images = ["odd", "not_a_number"].map(|p| both.ours.capture("odd_inputs", p).unwrap());
    let shown = |c: &Capture| c.depth.iter().filter(|d| **d < 1.0).count();
    let [whole, torn] = [shown(&images[0]), shown(&images[1])];
    assert!(torn > whole / 2, "{torn} of {whole} pixels are left");
    let warnings = images[1].warnings();
    assert!(warnings.iter().any(|w| w.contains("not a number")), "{warnings:?}");
}

/// OpenGL's own images differ in the last digit between sizes. Ours must show the same scene at
/// every size.
#[test]
fn size_and_position_do_not_change_our_image() {
    let Some(both) = both() else { return };
    let names = both.ours.images("domains").unwrap();
    let reference = both.ours.capture("domains", "size_1_at_0").unwrap();
    for name in names {
        let other = both.ours.capture("domains", &name).unwrap();
        // At 1e9 the corners of a sphere of size 1 are rounded to 1e-7.
        let limits = Limits { depth_ulp: 40, ..Limits::STRICT };
        let found = faults(&reference, &other, &limits);
        assert!(found.is_empty(), "{name}: {found:?}");
    }
}

/// A requirement on our images only: the two images of stock VTK differ by 16 levels.
#[test]
fn turning_a_volume_or_camera_and_light_is_the_same() {
    let Some(both) = both() else { return };
    let images = ["turned", "camera_turned"];
    let [volume, camera] = images.map(|p| both.ours.capture("volume_lights", p).unwrap());
    let [stock_volume, stock_camera] =
        images.map(|p| both.stock.capture("volume_lights", p).unwrap());
    let limits = Limits { color_mean: 0.05, ..Limits::STRICT };
    assert_eq!(faults(&volume, &camera, &limits), Vec::<String>::new());
    let stock_differs = faults(&stock_volume, &stock_camera, &Limits { color_mean: 5.0, ..SHADED });
    assert!(!stock_differs.is_empty(), "stock VTK's light follows now: hold turned volumes to it");
}

/// Pixels that differ by more than 8 levels, as a fraction.
pub(crate) fn off(stock: &Capture, ours: &Capture) -> f64 {
    let far = |(a, b): (&[u8; 3], &[u8; 3])| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > 8);
    stock.rgb.iter().zip(&ours.rgb).filter(|p| far(*p)).count() as f64 / stock.rgb.len() as f64
}

/// One sample per pixel has 4 to 5.5 % of them off.
pub(crate) fn check_samples(stock: &Run, ours: &Run, scenes: &[&str]) {
    for scene in scenes {
        for samples in [4, 8] {
            let name = format!("{scene}_{samples}");
            let [a, b] = [stock, ours].map(|r| r.capture("window_samples", &name).unwrap());
            let part = off(&a, &b);
            assert!(part <= 0.0005, "{name}: {:.4} % of the pixels are off", 100.0 * part);
        }
    }
}

#[test]
fn windows_with_samples_are_as_smooth_as_stock() {
    let Some(both) = both() else { return };
    check_samples(&both.stock, &both.ours, &["glyphs", "isosurface", "creases"]);
}

#[test]
fn what_stays_opengl_is_in_the_report_with_its_reason() {
    let Some(both) = both() else { return };
    let passed = both.ours.capture("annotations", "annotations").unwrap().passed("reason");
    for reason in ["wireframe", "points"] {
        assert!(passed.iter().any(|p| p.contains(reason)), "{reason}: {passed:?}");
    }
}

#[test]
fn every_prop_that_opengl_draws_has_its_own_reason() {
    let Some(both) = both() else { return };
    let capture = both.ours.capture("reasons", "reasons").unwrap();
    assert!(capture.expected_reasons().len() > 20);
    assert_eq!(capture.passed("reason"), capture.expected_reasons());
}

#[test]
fn colors_and_matrices_do_not_rebuild() {
    let Some(both) = both() else { return };
    let rebuilt = |script: &str, image: &str| -> u64 {
        let capture = both.ours.capture(script, image).unwrap();
        // The last renderer is this script's; renderers of earlier scripts may still exist.
        capture.renderers().last().and_then(|r| r["rebuilt"].as_u64()).expect("a report")
    };
    for (script, image) in [("colors", "recolored"), ("changing", "moved"), ("contours", "turned")]
    {
        assert_eq!(
            rebuilt(script, image),
            0,
            "{script}/{image} built an acceleration structure again"
        );
    }
    assert!(rebuilt("changing", "deformed") > 0, "points that moved must be built again");
}

/// The depth of the plane through a triangle's corners, in f64, at every pixel, shows which image
/// is right where we and OpenGL differ.
#[test]
fn our_window_depth_is_exact_where_opengl_rounds() {
    let scripts = [crate::peers::scripts().join("exact/triangles.py")];
    let run = |with, name| Run::new(Program::Vtk, with, &scripts, output(name), &[]);
    let (stock, ours) = match (run(With::Stock, "exact-stock"), run(With::Bridge, "exact-ours")) {
        (Ok(stock), Ok(ours)) => (stock, ours),
        (Err(reason), _) | (_, Err(reason)) => return skip(&reason),
    };
    let [stock, ours] = [stock, ours].map(|r| r.capture("triangles", "triangles").unwrap());
    let worst = |c: &Capture| {
        let corners: Vec<f64> = c.facts["corners"]
            .as_array()
            .expect("a list")
            .iter()
            .filter_map(|v| v.as_f64())
            .collect();
        let mut worst = (0, 0);
        for y in 0..c.height {
            for x in 0..c.width {
                let at = [(x as f64 + 0.5) / c.width as f64, (y as f64 + 0.5) / c.height as f64]
                    .map(|v| 2.0 * v - 1.0);
                let depths = corners.chunks_exact(9).filter_map(|t| depth_at(t, at));
                let exact = depths.fold(1.0, f64::min) as f32;
                let seen = c.depth[y * c.width + x];
                if exact < 1.0 && seen < 1.0 {
                    worst = (worst.0.max(exact.to_bits().abs_diff(seen.to_bits())), worst.1 + 1);
                }
            }
        }
        assert!(worst.1 > 1000, "the triangles cover {} pixels", worst.1);
        worst.0
    };
    let (opengl, rays) = (worst(&stock), worst(&ours));
    assert!(
        rays <= 1,
        "our depth is {rays} units in the last place beside the exact one, OpenGL's {opengl}"
    );
}

/// Window depth at `p` of the triangle with these projected corners (x, y, z from -1 to 1), if it
/// covers `p`.
fn depth_at(t: &[f64], p: [f64; 2]) -> Option<f64> {
    let edge = |i: usize| [t[3 * i] - t[0], t[3 * i + 1] - t[1], t[3 * i + 2] - t[2]];
    let ([ux, uy, uz], [vx, vy, vz]) = (edge(1), edge(2));
    let [px, py] = [p[0] - t[0], p[1] - t[1]];
    let area = ux * vy - uy * vx;
    let [a, b] = [(px * vy - py * vx) / area, (ux * py - uy * px) / area];
    // Slightly inside: exactly at the edge, the neighbour may be visible.
    let inside = a > 1e-6 && b > 1e-6 && a + b < 1.0 - 1e-6;
    inside.then_some(0.5 * (t[2] + a * uz + b * vz) + 0.5)
}
