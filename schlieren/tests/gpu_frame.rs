//! Tests frames that a GPU exposes as a whole against those of the CPU.
//!
//! Any Vulkan device will do, also Mesa's lavapipe. Without one these tests print that they are
//! skipped and pass, unless RTSV_REQUIRE_PEERS=1.
#![cfg(feature = "gpu")]

mod common;
mod device;

use common::{cube, lopsided};
use glam::DVec3;
use schlieren::field::{Field, Node};
use schlieren::media::{Media, Property, Volume};
use schlieren::render::{Control, Layers, RenderOutput, TestSection, render};
use schlieren::scene::Scene;
use schlieren::solids::Solids;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether there is a device. Without one, prints why the test is skipped.
fn has_gpu() -> bool {
    device::gpu().is_some()
}

const PHOTONS: &str = "[sampling]\nmethod = \"photons\"\nsamples = 4\nseed = 77\n";
const BEAMS: &str = "[sampling]\nmethod = \"beams\"\ncells_per_side = 2\n";
const NO_FILTER: &str = "[sampling.filter]\nkind = \"none\"\n";

fn scene(device: &str, film: &str, rest: &str) -> Scene {
    marched(device, film, ["verlet", "b-spline"], rest)
}

fn marched(device: &str, film: &str, [march, interpolant]: [&str; 2], rest: &str) -> Scene {
    let toml = format!(
        "[flow]\nfile = \"\"\ndensity = \"-\"\n[film]\nsize = [41, 30]\n{film}[march]\ndevice = \
         \"{device}\"\nmethod = \"{march}\"\ninterpolant = \"{interpolant}\"\nstep_voxels = \
         1.0\n{rest}"
    );
    Scene::from_toml(&toml).unwrap_or_else(|e| panic!("{toml}: {e}"))
}

fn exposed(field: &Field, scene: &Scene) -> RenderOutput {
    let section = TestSection::of_fields(scene, vec![field.clone()], None).unwrap();
    let layers = Layers { counts: true, noise: true, ..Layers::NONE };
    render(scene, &section, layers, &Control::default()).unwrap()
}

/// As [`exposed`], through smoke in waves that turns the light's polarisation. Their lattices are
/// not that of the field.
fn exposed_through_smoke(field: &Field, scene: &Scene) -> RenderOutput {
    let wave = |p: DVec3| (3.0 * p.x - 2.0 * p.y + 4.0 * p.z).sin();
    let volume = |n: usize, scale: f64, offset: f64| {
        let spacing_m = field.size_m() * 1.2 / (n - 1) as f64;
        let low = field.origin_m() - 0.1 * field.size_m();
        let value = |p: DVec3| offset + scale * wave(p - field.origin_m());
        Volume::from_fn([n; 3], spacing_m.to_array(), low, value).unwrap()
    };
    let media = Media::default()
        .with(Property::Absorption, volume(19, 0.3, 0.4))
        .with(Property::Rotation, volume(40, 2.0, -0.5));
    let section = TestSection::of_fields(scene, vec![field.clone()], None).unwrap();
    render(scene, &section.with_media(media), Layers::NONE, &Control::default()).unwrap()
}

/// The frames of the GPU and of the CPU. The GPU must have exposed its own.
fn both(field: &Field, film: &str, rest: &str) -> [RenderOutput; 2] {
    let [gpu, cpu] = ["gpu", "cpu"].map(|d| exposed(field, &scene(d, film, rest)));
    check_device(&gpu, &cpu, rest);
    [gpu, cpu]
}

/// Checks that the GPU has exposed its frame, and that the same light arrived.
fn check_device(gpu: &RenderOutput, cpu: &RenderOutput, rest: &str) {
    let device = gpu.report.device.expect("the work of the device");
    let tally = gpu.report.tally;
    assert_eq!(device.photons, tally.sent, "{rest}: {:?}", gpu.report.warnings);
    assert!(gpu.report.device.is_some() && cpu.report.device.is_none());
    assert_eq!(tally.sent, cpu.report.tally.sent, "{rest}");
    let stopped = |o: &RenderOutput| [o.report.tally.blocked_in_field, o.report.tally.turned];
    assert_eq!(stopped(gpu), stopped(cpu), "{rest}");
    assert_eq!(tally.not_a_number, 0);
}

/// Number of pixels of which a channel differs by more than is allowed.
fn changed(a: &RenderOutput, b: &RenderOutput, allowed: f32) -> usize {
    let off = |(a, b): &(&[f32; 3], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > allowed);
    a.pixels.iter().zip(&b.pixels).filter(off).count()
}

/// Largest difference of the two images, and the largest brightness.
fn difference(a: &RenderOutput, b: &RenderOutput) -> [f32; 2] {
    let mut worst = [0.0f32; 2];
    for (a, b) in a.pixels.iter().zip(&b.pixels) {
        for c in 0..3 {
            assert!(a[c].is_finite());
            worst = [worst[0].max((a[c] - b[c]).abs()), worst[1].max(b[c])];
        }
    }
    worst
}

const KNIFE: &str = "[technique]\nkind = \"schlieren\"\n[technique.cutoff]\nkind = \"knife\"\n";

/// The scenes: technique, cut-off and source of each.
fn techniques() -> Vec<(&'static str, String)> {
    let schlieren =
        |cutoff: &str| format!("[technique]\nkind = \"schlieren\"\n[technique.cutoff]\n{cutoff}");
    let disc = "[light.source]\nkind = \"circle\"\ndiameter_m = 2e-3\n";
    let slit = "[light.source]\nkind = \"slit\"\nwidth_m = 1e-3\nlength_m = 2e-3\nangle_deg = \
                20.0\n";
    vec![
        ("knife", KNIFE.to_string()),
        ("knife before a turned slit", KNIFE.to_string() + slit),
        ("knife before a disc", KNIFE.to_string() + disc),
        ("circle", schlieren("kind = \"circle\"\nradius_m = 1e-3\n") + disc),
        ("circle before a slit", schlieren("kind = \"circle\"\nradius_m = 4e-4\n")),
        ("dark field", schlieren("kind = \"complemented-circle\"\nradius_m = 1e-3\n") + disc),
        ("colours", schlieren("kind = \"color\"\nradius_m = 2e-3\n")),
        ("interferogram", "[technique]\nkind = \"interferogram\"\n".into()),
        (
            "finite fringes",
            "[technique]\nkind = \"interferogram\"\nfringe_spacing_m = 0.05\nvisibility = 0.7\n"
                .into(),
        ),
        ("dots", "[technique]\nkind = \"bos\"\nseed = 5\n".into()),
        ("shadowgraph", "[technique]\nkind = \"shadowgraph\"\n".into()),
    ]
}

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

/// The page asks for the noise of each of its frames.
#[test]
fn the_noise_of_a_picture_comes_back_with_it_and_not_the_film() {
    if !has_gpu() {
        return;
    }
    let field = cube(17, lopsided);
    let color = "[technique]\nkind = \"schlieren\"\n[technique.cutoff]\nkind = \
                 \"color\"\nradius_m = 2e-3\n[light.source]\nkind = \"point\"\n";
    for (technique, channels) in [(KNIFE, 1), (color, 3)] {
        for samples in [2, 7] {
            let rest =
                format!("{technique}[sampling]\nmethod = \"photons\"\nsamples = {samples}\n");
            let [gpu, cpu] = ["gpu", "cpu"].map(|d| {
                let scene = scene(d, "", &rest);
                let section = TestSection::of_fields(&scene, vec![field.clone()], None).unwrap();
                let layers = Layers { noise: true, ..Layers::NONE };
                render(&scene, &section, layers, &Control::default()).unwrap()
            });
            let work = gpu.report.device.unwrap();
            let pixels = 2 * 4 * 41 * 30 * channels;
            assert_eq!(work.bytes_from_device, pixels + 56 + 4096 * 32, "{work:?}");
            assert!(difference(&gpu, &cpu)[0] < 2e-5);
            let [on_gpu, on_cpu] = [&gpu, &cpu].map(|r| r.noise.as_ref().unwrap());
            let pairs = || on_gpu.iter().zip(on_cpu);
            let worst = pairs().map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            let largest = on_cpu.iter().copied().fold(0.0, f32::max);
            assert!(worst < 2e-5 && largest > 1e-3, "{samples}: {worst:e} of {largest:e}");
        }
    }
}

/// The filters of the device are those of the CPU, also where they reach over the image's edge.
#[test]
fn pictures_are_filtered_on_the_device_as_on_the_cpu() {
    if !has_gpu() {
        return;
    }
    let field = cube(24, lopsided);
    let color = "[technique]\nkind = \"schlieren\"\n[technique.cutoff]\nkind = \
                 \"color\"\nradius_m = 2e-3\n";
    let source = "[light.source]\nkind = \"point\"\n";
    for technique in [KNIFE.to_string(), format!("{color}{source}")] {
        for filter in [
            "kind = \"gaussian\"\nsigma_px = 1.7",
            "kind = \"gaussian\"\nsigma_px = 30.0",
            "kind = \"mean\"\nradius_px = 2.4",
            "kind = \"none\"",
            "kind = \"cone\"\nnearest = 2",
            "kind = \"cone\"\nnearest = 8",
            "kind = \"cone\"\nnearest = 600",
            "kind = \"cone\"\nnearest = 10000",
        ] {
            let rest = format!("{technique}{PHOTONS}[sampling.filter]\n{filter}\n");
            let [gpu, cpu] = ["gpu", "cpu"].map(|d| {
                let scene = scene(d, "", &rest);
                let section = TestSection::of_fields(&scene, vec![field.clone()], None).unwrap();
                render(&scene, &section, Layers::NONE, &Control::default()).unwrap()
            });
            assert_eq!(gpu.report.warnings, cpu.report.warnings, "{filter}");
            assert_eq!(gpu.report.tally, cpu.report.tally, "{filter}");
            assert_eq!(gpu.report.counters, cpu.report.counters, "{filter}");
            let [worst, brightest] = difference(&gpu, &cpu);
            assert!(brightest > 0.3 && worst < 2e-5, "{filter}: {worst:e} of {brightest}");
        }
    }
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

/// Photons are few in shadows and beyond the film's edge, many in a focus, and none where a body
/// takes the whole film: pixels find the nearest wherever they are. Counts and noise come back as
/// without the filter.
#[test]
fn the_cone_filter_finds_photons_in_shadows_and_foci_on_the_device() {
    if !has_gpu() {
        return;
    }
    let lens = cube(24, |p| -4e-3 * (p.x * p.x + p.y * p.y));
    let thrown_out = cube(24, |p| 2e-3 * p.x);
    let body = device::with_body(24);
    let shadowgraph = "[technique]\nkind = \"shadowgraph\"\n";
    for (name, field, film) in [
        ("focus", &lens, "focus_m = 60.0\n"),
        ("beyond the edge", &thrown_out, "focus_m = 150.0\n"),
        ("shadow", &body, ""),
        ("a corner of the shadow", &body, "field_of_view_m = 0.02\n"),
    ] {
        for nearest in [3, 40] {
            let filter = format!("[sampling.filter]\nkind = \"cone\"\nnearest = {nearest}\n");
            let [gpu, cpu] = both(field, film, &format!("{shadowgraph}{PHOTONS}{filter}"));
            let [worst, brightest] = difference(&gpu, &cpu);
            assert!(worst <= 5e-5 * brightest, "{name}, {nearest}: {worst:e} of {brightest}");
            let [a, b] = [&gpu, &cpu].map(|o| o.counts.clone().expect("counts"));
            let others = a.iter().zip(&b).filter(|(a, b)| a != b).count();
            assert!(others <= 4, "{name}: {others} pixels have other numbers of photons");
            assert!(gpu.noise.is_some() == cpu.noise.is_some(), "{name}");
            assert_eq!(gpu.report.warnings, cpu.report.warnings, "{name}");
            let again =
                exposed(field, &scene("gpu", film, &format!("{shadowgraph}{PHOTONS}{filter}")));
            assert_eq!(again.pixels, gpu.pixels, "{name}: other bits in the next run");
        }
    }
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
