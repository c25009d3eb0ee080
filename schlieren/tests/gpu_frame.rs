//! Tests frames that a GPU exposes as a whole against those of the CPU.
//!
//! Any Vulkan device will do, also Mesa's lavapipe. Without one these tests print that they are
//! skipped and pass, unless RTSV_REQUIRE_PEERS=1.
#![cfg(feature = "gpu")]

mod common;
mod device;
mod frames;

use common::{cube, lopsided};
use frames::{
    BEAMS, KNIFE, NO_FILTER, PHOTONS, both, changed, check_device, difference, exposed,
    exposed_through_smoke, has_gpu, marched, scene, techniques,
};
use glam::DVec3;
use schlieren::field::{Field, Node};
use schlieren::media::{Media, Property, Volume};
use schlieren::render::{Control, Layers, RenderOutput, TestSection, render};
use schlieren::solids::Solids;
use std::sync::atomic::{AtomicBool, Ordering};

/// Photons land in other pixels where their positions differ by a rounding, and step functions
/// (sampled sources, dots) switch. Each such photon changes a pixel by its energy; without filter
/// the number of changed pixels counts them.
#[test]
fn photons_of_the_device_are_those_of_the_cpu() {
    if !has_gpu() {
        return;
    }
    let field = cube(33, lopsided);
    for (name, technique) in techniques() {
        let film = if name == "shadowgraph" { "focus_m = 3.0\n" } else { "" };
        let [gpu, cpu] = both(&field, film, &format!("{technique}{PHOTONS}{NO_FILTER}"));
        let changed = changed(&gpu, &cpu, 2e-5);
        let [worst, brightest] = difference(&gpu, &cpu);
        assert!(changed <= 3, "{name}: {changed} pixels differ, by {worst} of {brightest}");
        let [low, high] = cpu.report.levels;
        assert!(high - low > 0.02, "{name}: an empty image, {low} to {high}");
        let [a, b] = [&gpu, &cpu].map(|o| o.report.tally);
        assert!(a.on_film.abs_diff(b.on_film) <= 2 && a.landed == b.landed, "{name}: {a:?} {b:?}");
        let [a, b] = [&gpu, &cpu].map(|o| o.counts.clone().expect("counts"));
        let others = a.iter().zip(&b).filter(|(a, b)| a != b).count();
        assert!(others <= 4, "{name}: {others} pixels have other numbers of photons");
        assert_eq!(gpu.noise.is_some(), cpu.noise.is_some());
    }
}

#[test]
fn beams_of_the_device_are_those_of_the_cpu() {
    if !has_gpu() {
        return;
    }
    let field = cube(33, lopsided);
    for (name, technique) in techniques() {
        for film in ["", "focus_m = 3.0\n"] {
            let [gpu, cpu] = both(&field, film, &format!("{technique}{BEAMS}"));
            let [worst, brightest] = difference(&gpu, &cpu);
            assert!(worst < 2e-5 * brightest.max(1.0), "{name} {film}: {worst:e} of {brightest}");
            let [a, b] = [&gpu, &cpu].map(|o| o.report.tally);
            assert_eq!(a.landed, b.landed, "{name}");
        }
    }
}

/// Every march and interpolant of the CPU, with a technique that reads the path
/// and one that does not. Steps are no part of a voxel: where stages of a full march lie on faces
/// of cells, the gradient of trilinear interpolation jumps there, and roundings decide.
///
/// The full marches of the CPU are in double precision. Their path has forty waves here, and a
/// millionth of it is 2.5e-4 of a radian of the fringes' phase.
#[test]
fn every_march_and_interpolant_exposes_the_frame_of_the_cpu() {
    if !has_gpu() {
        return;
    }
    let field = cube(24, lopsided);
    let interferogram = "[technique]\nkind = \"interferogram\"\n";
    for march in ["verlet", "euler", "pefrl", "sharma", "rk4", "line-of-sight"] {
        let is_full = !["verlet", "euler", "line-of-sight"].contains(&march);
        for interpolant in ["b-spline", "trilinear", "trilinear-gradient"] {
            for (rest, allowed) in [
                (format!("{KNIFE}{PHOTONS}{NO_FILTER}"), 2e-5),
                (format!("{interferogram}{BEAMS}"), if is_full { 1e-4 } else { 2e-5 }),
            ] {
                let [gpu, cpu] = ["gpu", "cpu"].map(|d| {
                    let mut scene = marched(d, "", [march, interpolant], &rest);
                    scene.march.step_voxels = Some(0.83);
                    exposed(&field, &scene)
                });
                check_device(&gpu, &cpu, &rest);
                assert!(gpu.report.march.starts_with(march), "{}", gpu.report.march);
                assert!(gpu.report.march.contains(&format!("{interpolant},")));
                let changed = changed(&gpu, &cpu, allowed);
                let [worst, _] = difference(&gpu, &cpu);
                assert!(changed <= 3, "{march}, {interpolant}, {rest}: {changed}, {worst:e}");
            }
        }
    }
}

/// Straight rays, in every technique: along an axis and obliquely, tilted, against the light, with
/// bodies on the lattice, and through smoke.
#[test]
fn straight_rays_on_the_device_expose_the_frame_of_the_cpu() {
    if !has_gpu() {
        return;
    }
    let straight = |d: &str, rest: &str| marched(d, "", ["line-of-sight", "b-spline"], rest);
    let field = cube(24, lopsided);
    let view = "[view]\ndirection = \"31,-17\"\n";
    let side = "[view]\ndirection = \"y\"\n";
    let tilted = "[light]\nbeams = \"tilted\"\n[light.source]\nkind = \"circle\"\ndiameter_m = \
                  2e-2\n";
    let photons = format!("{PHOTONS}{NO_FILTER}");
    for (name, technique) in techniques() {
        for at in ["", view, side] {
            for sampling in [&photons, BEAMS] {
                let rest = format!("{technique}{at}{sampling}");
                let [gpu, cpu] = ["gpu", "cpu"].map(|d| exposed(&field, &straight(d, &rest)));
                check_device(&gpu, &cpu, &rest);
                let [worst, _] = difference(&gpu, &cpu);
                let changed = changed(&gpu, &cpu, 2e-5);
                assert!(changed <= 3, "{name}: {rest}: {changed}, {worst:e}");
                assert!(gpu.report.march.starts_with("line-of-sight, b-spline, on "));
            }
        }
    }
    for (field, rest) in [
        (&field, format!("{KNIFE}{tilted}{view}{photons}")),
        (&device::with_body(24), format!("{KNIFE}{photons}")),
        (&device::with_body(24), format!("{KNIFE}{view}{BEAMS}")),
    ] {
        let [gpu, cpu] = ["gpu", "cpu"].map(|d| exposed(field, &straight(d, &rest)));
        check_device(&gpu, &cpu, &rest);
        let changed = changed(&gpu, &cpu, 2e-5);
        assert!(changed <= 3, "{rest}: {changed}, {:e}", difference(&gpu, &cpu)[0]);
    }
    let dark = "[media]\nabsorption = \"a\"\nrotation = \"b\"\nanalyser_deg = 30.0\n";
    let rest = format!("{KNIFE}{photons}{dark}");
    let [gpu, cpu] = ["gpu", "cpu"].map(|d| exposed_through_smoke(&field, &straight(d, &rest)));
    check_device(&gpu, &cpu, &rest);
    assert!(changed(&gpu, &cpu, 5e-5) <= 3, "{:e}", difference(&gpu, &cpu)[0]);
}

/// Rays that a plane between media reflects are counted as turned and leave the film dark.
#[test]
fn rays_that_turn_are_counted_and_dark_on_both() {
    if !has_gpu() {
        return;
    }
    let field = cube(24, |p| 0.6 - 0.9 / (1.0 + ((p.z + p.x - 0.1) / -0.05).exp()));
    for sampling in [format!("{PHOTONS}{NO_FILTER}"), BEAMS.to_string()] {
        let rest = format!("{KNIFE}{sampling}");
        let [gpu, cpu] = ["gpu", "cpu"].map(|d| {
            let mut scene = marched(d, "", ["pefrl", "b-spline"], &rest);
            scene.march.step_voxels = Some(0.83);
            exposed(&field, &scene)
        });
        check_device(&gpu, &cpu, &rest);
        let changed = changed(&gpu, &cpu, 2e-5);
        assert!(changed <= 3, "{rest}: {changed}, {:e}", difference(&gpu, &cpu)[0]);
        let is_beams = sampling == BEAMS;
        assert!(is_beams || gpu.report.tally.turned > 100, "{:?}", gpu.report.tally);
    }
}

/// The tolerance for skipping is far below what a picture shows, and the report is that of the
/// device's own rays.
#[test]
fn a_frame_that_skips_gas_is_the_frame_that_does_not() {
    if !has_gpu() {
        return;
    }
    let field = cube(65, |p| lopsided(2.5 * p));
    for rest in [format!("{KNIFE}{BEAMS}"), format!("{KNIFE}{PHOTONS}")] {
        let toml = |device: &str, skip: &str| {
            let mut scene = scene(device, "", &rest);
            scene.march.skip_rad = skip.parse().unwrap();
            scene
        };
        let [gpu, cpu, all] = [("gpu", "1e-9"), ("cpu", "1e-9"), ("gpu", "0")]
            .map(|(d, s)| exposed(&field, &toml(d, s)));
        assert!(
            gpu.report.march.contains("skipping at most 1e-9 rad, on "),
            "{}",
            gpu.report.march
        );
        assert!(difference(&gpu, &cpu)[0] < 2e-5 && difference(&gpu, &all)[0] < 2e-5);
        let [a, b] = [&gpu, &cpu].map(|o| o.report.skip_report.unwrap());
        assert!(a.bound_rad > 0.0 && a.bound_rad <= 1e-9, "{a:?}");
        // Rays that decide by themselves skip more than packets.
        assert!(a.steps_part >= b.steps_part && a.steps_part < 0.95, "{a:?} {b:?}");
        assert_eq!(all.report.skip_report, None);
    }
}

/// Oblique views, and beams tilted by an extended source, clip the field at other faces for each
/// ray.
#[test]
fn oblique_views_and_tilted_beams_start_where_they_do_on_the_cpu() {
    if !has_gpu() {
        return;
    }
    let field = cube(24, lopsided);
    let view = "[view]\ndirection = \"31,-17\"\n";
    let tilted = "[light]\nbeams = \"tilted\"\n[light.source]\nkind = \"circle\"\ndiameter_m = \
                  2e-2\n";
    for rest in
        [view.to_string(), tilted.to_string(), format!("{view}{tilted}"), format!("{view}{BEAMS}")]
    {
        let sampling = if rest.contains("sampling") { "" } else { PHOTONS };
        let filter = if sampling.is_empty() { "" } else { NO_FILTER };
        let [gpu, cpu] = both(&field, "", &format!("{KNIFE}{rest}{sampling}{filter}"));
        let changed = changed(&gpu, &cpu, 2e-5);
        let [worst, _] = difference(&gpu, &cpu);
        assert!(changed <= 3, "{rest}: {changed} pixels differ, by up to {worst}");
    }
}

/// Bodies and blank places on the lattice stop the same photons.
#[test]
fn bodies_of_the_lattice_cast_the_same_shadows() {
    if !has_gpu() {
        return;
    }
    let n = 24;
    let plain = cube(n, lopsided);
    let node = |i: usize| {
        let at = [i % n, i / n % n, i / (n * n)].map(|k| k as f64 / (n - 1) as f64 - 0.5);
        if glam::DVec3::from(at).length() < 0.2 { Node::Solid } else { Node::Gas }
    };
    let field = Field::new(
        plain.dims(),
        plain.spacing_m(),
        plain.origin_m(),
        plain.eps().to_vec(),
        1.0,
        Some((0..n * n * n).map(node).collect()),
    )
    .unwrap();
    for sampling in [PHOTONS.to_string() + NO_FILTER, BEAMS.to_string()] {
        let [gpu, cpu] = both(&field, "", &format!("{KNIFE}{sampling}"));
        assert!(difference(&gpu, &cpu)[0] < 2e-5, "{sampling}");
        let dark = gpu.pixels.iter().filter(|p| p[0] == 0.0).count();
        assert!((30..400).contains(&dark), "{dark} pixels are dark");
    }
}

/// Only sums come back, and work is given to the device once for each part of a frame.
#[test]
fn only_pixels_come_back_and_each_part_of_a_frame_is_submitted_once() {
    if !has_gpu() {
        return;
    }
    let field = cube(17, lopsided);
    let rest = format!("{KNIFE}[sampling]\nmethod = \"photons\"\nsamples = 300\n");
    let out = exposed(&field, &scene("gpu", "", &rest));
    let work = out.report.device.unwrap();
    let margin = 2 * u64::from(out.report.margin_px);
    let photons = (41 + margin) * (30 + margin) * 300;
    assert_eq!(work.photons, photons);
    // Tiles of 16 x 4 pixels are not all full. The margin was measured with 4,096 rays. A fast
    // device gets larger parts.
    let tiles = (41 + margin).div_ceil(16) * (30 + margin).div_ceil(4) * 300;
    let most = 1 + (64 * tiles).div_ceil(1 << 18);
    assert!((2..=most).contains(&work.submissions) && work.rays == 4096, "{work:?}, {most}");
    // Two films of energies for the noise, and counts; the rays of the margin are 32 bytes each.
    let film = 41 * 30 * (2 * 8 + 4) + 56;
    assert_eq!(work.bytes_from_device, film + 4096 * 32);
    // Rows of four coefficients, or a GPU in a processor has coefficients alone.
    let flow = [16 * 16 * 19 * 19, 4 * 19 * 19 * 19];
    let rays = 4096 * 64 + 96;
    let frames = work.submissions - 1;
    let others = rays + 96 + frames * 352;
    assert!(flow.contains(&(work.bytes_to_device - others)), "{work:?}");

    // The picture alone is filtered on the device.
    let scene = scene("gpu", "", &rest);
    let section = TestSection::of_fields(&scene, vec![field], None).unwrap();
    let out = render(&scene, &section, Layers::NONE, &Control::default()).unwrap();
    let picture = out.report.device.unwrap();
    assert!((3..=most + 1).contains(&picture.submissions), "{picture:?}, {most}");
    assert_eq!(picture.bytes_from_device, 41 * 30 * 4 + 56 + 4096 * 32);
}

/// The sums of integers do not depend on the order in which photons arrive.
#[test]
fn a_frame_has_the_same_bits_in_every_run() {
    if !has_gpu() {
        return;
    }
    let field = cube(17, lopsided);
    for sampling in [PHOTONS, BEAMS] {
        let scene = scene("gpu", "focus_m = 3.0\n", &format!("{KNIFE}{sampling}"));
        let first = exposed(&field, &scene).pixels;
        for _ in 0..3 {
            assert_eq!(exposed(&field, &scene).pixels, first, "{sampling}");
        }
    }
}

#[test]
fn the_medium_dims_and_turns_the_light_of_a_frame_on_the_device() {
    if !has_gpu() {
        return;
    }
    let field = cube(24, lopsided);
    let bos = "[technique]\nkind = \"bos\"\nseed = 5\n";
    let tilted =
        "[light]\nbeams = \"tilted\"\n[light.source]\nkind = \"circle\"\ndiameter_m = 2e-3\n";
    for media in [
        "absorption = \"smoke\"\n",
        "rotation = \"turn\"\nanalyser_deg = 30.0\n",
        "absorption = \"smoke\"\nrotation = \"turn\"\nanalyser_deg = 75.0\n",
    ] {
        for rest in [
            format!("{KNIFE}{PHOTONS}{NO_FILTER}"),
            format!("{KNIFE}{BEAMS}"),
            format!("{KNIFE}{tilted}{PHOTONS}{NO_FILTER}"),
            format!("{bos}{PHOTONS}{NO_FILTER}"),
        ] {
            let rest = format!("[media]\n{media}{rest}");
            let [gpu, cpu] =
                ["gpu", "cpu"].map(|d| exposed_through_smoke(&field, &scene(d, "", &rest)));
            check_device(&gpu, &cpu, &rest);
            let changed = changed(&gpu, &cpu, 5e-5);
            let [worst, brightest] = difference(&gpu, &cpu);
            assert!(changed <= 3, "{rest}: {changed} pixels, {worst:e} of {brightest}");
            // The CPU traces corners of beams twice where its tiles meet.
            let [on_gpu, on_cpu] = [&gpu, &cpu].map(|o| o.report.counters.media_rays);
            assert!(on_gpu == on_cpu || rest.contains("beams\"\n") && on_gpu < on_cpu, "{rest}");
        }
    }
}

/// The smoke stays on the device for the next frame.
#[test]
fn the_medium_is_copied_to_the_device_once() {
    if !has_gpu() {
        return;
    }
    let rest = format!("[media]\nabsorption = \"smoke\"\n{KNIFE}{PHOTONS}");
    let scene = scene("gpu", "", &rest);
    let field = cube(17, lopsided);
    let smoke = Volume::from_fn([20; 3], [0.05; 3], DVec3::splat(-0.5), |p| p.x * p.x).unwrap();
    let section = TestSection::of_fields(&scene, vec![field], None).unwrap();
    let section = section.with_media(Media::default().with(Property::Absorption, smoke));
    let section = section.with_caches();
    let [first, second] = [(); 2].map(|()| {
        let out = render(&scene, &section, Layers::NONE, &Control::default()).unwrap();
        out.report.device.unwrap().bytes_to_device
    });
    assert!(second + 4 * 20 * 20 * 20 <= first, "{first} {second}");

    // Other smoke in the same section is not the one that the device has.
    let clear = Volume::from_fn([20; 3], [0.05; 3], DVec3::splat(-0.5), |_| 0.0).unwrap();
    let picture = |s: &TestSection| {
        let out = render(&scene, s, Layers::NONE, &Control::default()).unwrap();
        out.pixels.iter().map(|p| f64::from(p[0])).sum::<f64>()
    };
    let smoky = picture(&section);
    let section = section.with_media(Media::default().with(Property::Absorption, clear));
    assert!(picture(&section) > 1.01 * smoky);
}

#[test]
fn what_the_device_cannot_expose_is_named_and_exposed_by_the_cpu() {
    if !has_gpu() {
        return;
    }
    let field = cube(17, lopsided);
    let dots = "[technique]\nkind = \"bos\"\ndot_spacing_m = 1e-8\n";
    let [gpu, cpu] =
        ["gpu", "cpu"].map(|d| exposed(&field, &scene(d, "", &format!("{dots}{PHOTONS}"))));
    let named = |o: &RenderOutput| o.report.warnings.iter().filter(|w| w.contains("dots")).count();
    assert_eq!([named(&gpu), named(&cpu)], [1, 0], "{:?}", gpu.report.warnings);
    assert_eq!(gpu.report.device.unwrap().photons, 0);
    assert_eq!(gpu.report.tally.sent, cpu.report.tally.sent);
}

/// Cancelling ends a frame between two submissions.
#[test]
fn a_frame_that_is_cancelled_ends() {
    if !has_gpu() {
        return;
    }
    let field = cube(17, lopsided);
    let scene =
        scene("gpu", "", &format!("{KNIFE}[sampling]\nmethod = \"photons\"\nsamples = 4000\n"));
    let section = TestSection::of_fields(&scene, vec![field], None).unwrap();
    let cancel = AtomicBool::new(false);
    let progress = |done: f64| {
        assert!(done < 0.5, "{done}");
        cancel.store(true, Ordering::Relaxed);
    };
    let control = Control { cancel: &cancel, progress: &progress };
    let ended = render(&scene, &section, Layers::NONE, &control);
    assert!(matches!(ended, Err(schlieren::render::RenderError::Cancelled)));
}

/// A tetrahedron in the flow stops the same photons of both, also in tilted beams and from behind.
#[test]
fn meshes_of_bodies_cast_the_same_shadows() {
    if !has_gpu() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("body.obj");
    let obj = "v -0.2 -0.15 0\nv 0.25 -0.1 0.02\nv 0 0.22 -0.1\nv 0.03 0.02 0.3\nf 1 2 3\nf 1 2 \
               4\nf 2 3 4\nf 3 1 4\n";
    std::fs::write(&file, obj).unwrap();
    let field = cube(17, lopsided);
    let tilted = "[light]\nbeams = \"tilted\"\n";
    for rest in [
        format!("{KNIFE}{PHOTONS}{NO_FILTER}"),
        format!("{KNIFE}{BEAMS}"),
        format!("{KNIFE}{tilted}{PHOTONS}{NO_FILTER}"),
        format!("[technique]\nkind = \"bos\"\n{PHOTONS}{NO_FILTER}"),
    ] {
        let rest = format!("{rest}[solids]\nfiles = [\"{}\"]\n", file.display());
        let [gpu, cpu] = ["gpu", "cpu"].map(|d| {
            let scene = scene(d, "", &rest);
            let (solids, warnings) = Solids::open(&scene.solids.files).unwrap();
            assert!(warnings.is_empty(), "{warnings:?}");
            let section =
                TestSection::of_fields(&scene, vec![field.clone()], Some(solids)).unwrap();
            render(&scene, &section, Layers::NONE, &Control::default()).unwrap()
        });
        let [a, b] = [&gpu, &cpu].map(|o| o.report.tally);
        assert_eq!(gpu.report.device.unwrap().photons, a.sent, "{:?}", gpu.report.warnings);
        assert_eq!((a.blocked_by_solids, a.landed), (b.blocked_by_solids, b.landed), "{rest}");
        assert!(changed(&gpu, &cpu, 2e-5) <= 3, "{rest}");
        let dark = gpu.pixels.iter().filter(|p| p[0] == 0.0).count();
        assert!((40..400).contains(&dark), "{dark} pixels are dark: {rest}");
    }
}

/// Several wavelengths, each through a field of its own, behind a filter image of two colours.
#[test]
fn wavelengths_and_a_filter_image_have_the_colours_of_the_cpu() {
    if !has_gpu() {
        return;
    }
    let cutoff = "[technique]\nkind = \"schlieren\"\n[technique.cutoff]\nkind = \
                  \"painted\"\nsize_m = [4e-3, 3e-3]\npixels = 64\nground_rgb = [0.2, 0.5, \
                  0.9]\n[[technique.cutoff.strokes]]\nfrom_m = [0.0, -1e-3]\nto_m = [2e-4, \
                  1e-3]\nradius_m = 3e-4\nrgb = [1.0, 0.3, 0.0]\n";
    let strong = cube(24, |p| 1.1 * lopsided(p));
    let weak = cube(24, lopsided);
    for wavelengths in ["633.0", "450.0, 633.0"] {
        for sampling in [format!("{PHOTONS}{NO_FILTER}"), BEAMS.to_string()] {
            let light = format!("[light]\nwavelengths_nm = [{wavelengths}]\n");
            let [gpu, cpu] = ["gpu", "cpu"].map(|d| {
                let scene = scene(d, "", &format!("{cutoff}{light}{sampling}"));
                let mut fields = vec![strong.clone(), weak.clone()];
                fields.truncate(scene.light.wavelengths_nm.len());
                let section = TestSection::of_fields(&scene, fields, None).unwrap();
                render(&scene, &section, Layers::NONE, &Control::default()).unwrap()
            });
            let device = gpu.report.device.unwrap();
            assert_eq!(device.photons, gpu.report.tally.sent, "{:?}", gpu.report.warnings);
            let [worst, _] = difference(&gpu, &cpu);
            assert!(worst < 2e-5, "{wavelengths}, {sampling}: {worst}");
            assert!(gpu.colored && gpu.report.levels[1] - gpu.report.levels[0] > 0.05);
        }
    }
}
