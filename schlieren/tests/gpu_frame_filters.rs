//! Tests the noise filters of frames that a GPU exposes against those of the CPU, as gpu_frame.rs
//! does the frames.
#![cfg(feature = "gpu")]

mod common;
mod device;
mod frames;

use common::{cube, lopsided};
use frames::{KNIFE, PHOTONS, both, difference, exposed, has_gpu, scene};
use schlieren::render::{Control, Layers, TestSection, render};

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
        ("no light at all", &body, "field_of_view_m = 0.02\n"),
    ] {
        for nearest in [3, 40] {
            let filter = format!("[sampling.filter]\nkind = \"cone\"\nnearest = {nearest}\n");
            let [gpu, cpu] = both(field, film, &format!("{shadowgraph}{PHOTONS}{filter}"));
            let [worst, brightest] = difference(&gpu, &cpu);
            assert!(worst <= 5e-5 * brightest, "{name}, {nearest}: {worst:e} of {brightest}");
            let [low, high] = cpu.report.levels;
            let is_dark = name == "no light at all";
            let shows = if is_dark { high == 0.0 } else { high > 0.4 && low < 0.1 * high };
            assert!(shows, "{name}, {nearest}: {low} to {high}");
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
