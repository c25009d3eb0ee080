//! Tests GPUs that are lost while tracing, as by a driver's reset. These tests have a process of
//! their own, because they also lose the program's GPU, which all other tests share.
#![cfg(feature = "gpu")]

mod common;

use common::{cube, difference, grid, lopsided, oblique, trace};
use schlieren::field::Field;
use schlieren::gpu::{Gpu, GpuOptions, GpuPaths, Method};
use schlieren::interpolate::Interpolant;
use schlieren::march::{Deviational, Options};
use schlieren::path::LightPaths;
use schlieren::render::{Control, Layers, RenderOutput, TestSection, render};
use schlieren::scene::Scene;
use std::io::Write as _;
use std::sync::{Arc, Mutex, PoisonError};

/// The same as in tests/gpu.rs.
const TOLERANCE: f64 = 1e-6;

/// The program's device. Without one, prints why the test is skipped.
fn gpu() -> Option<Arc<Gpu>> {
    match Gpu::shared() {
        Ok(gpu) => Some(gpu),
        Err(e) => {
            assert!(std::env::var_os("RTSV_REQUIRE_PEERS").is_none_or(|v| v != "1"), "{e}");
            // The test harness captures eprintln! of tests that pass.
            let _ = writeln!(std::io::stderr(), "skipped: {e}");
            None
        }
    }
}

/// Tests that lose the program's device take turns.
static PROGRAM_GPU: Mutex<()> = Mutex::new(());

/// Renders a scene of `field` on the GPU.
fn rendered(field: &Field) -> RenderOutput {
    let toml = "[flow]\nfile = \"\"\ndensity = \"-\"\n[film]\nsize = [40, 30]\n[march]\ndevice \
                = \"gpu\"\nmethod = \"verlet\"";
    let scene = Scene::from_toml(toml).unwrap();
    let section = TestSection::of_fields(&scene, vec![field.clone()], None).unwrap();
    render(&scene, &section, Layers::NONE, &Control::default()).unwrap()
}

/// The device is lost as by a driver's reset: between two traces, and while other threads trace.
#[test]
fn a_lost_device_is_reopened_and_no_ray_is_left_to_the_cpu() {
    let Some(_) = gpu() else { return };
    let field = cube(17, lopsided);
    let starts = grid(32, 0.9);
    for interpolant in [Interpolant::BSpline, Interpolant::Trilinear] {
        let own = Arc::new(Gpu::open().unwrap());
        let paths =
            GpuPaths::new(own.clone(), &field, oblique(), interpolant, GpuOptions::default())
                .unwrap()
                .with_batch(100);
        let expected = format!("{:?}", trace(&paths, &starts));
        assert_eq!(paths.device_warning(), None);
        own.destroy();
        assert_eq!(format!("{:?}", trace(&paths, &starts)), expected, "{interpolant:?}");
        let c = paths.counters();
        assert!(c.rays_on_cpu == 0 && c.rays_repeated > 0, "{c:?}");
        assert!(
            !Arc::ptr_eq(&paths.gpu(), &own)
                && own.failure().is_some()
                && paths.gpu().failure().is_none()
        );
        let warning = paths.device_warning().unwrap();
        assert!(
            warning.contains("lost") && warning.contains("reopened") && !warning.contains("CPU"),
            "{warning}"
        );

        // While four threads trace with it.
        let lost = paths.gpu();
        std::thread::scope(|s| {
            for _ in 0..4 {
                let (paths, starts, expected) = (&paths, &starts, &expected);
                s.spawn(move || {
                    for _ in 0..6 {
                        assert_eq!(&format!("{:?}", trace(paths, starts)), expected);
                    }
                });
            }
            std::thread::sleep(std::time::Duration::from_millis(20));
            lost.destroy();
        });
        assert_eq!(format!("{:?}", trace(&paths, &starts)), expected, "{interpolant:?}");
        assert_eq!(paths.counters().rays_on_cpu, 0);
        assert!(!Arc::ptr_eq(&paths.gpu(), &lost));
    }
}

/// The program's device is lost: the next image uses a new one, and the page need not be restarted.
#[test]
fn the_program_s_gpu_comes_back_after_it_was_lost() {
    let _turn = PROGRAM_GPU.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(before) = gpu() else { return };
    let field = cube(17, lopsided);
    let expected = rendered(&field);
    before.destroy();
    for _ in 0..2 {
        let r = rendered(&field);
        assert!(r.pixels == expected.pixels, "another image");
        assert!(r.report.march.contains(" on "), "{}", r.report.march);
        assert!(
            !r.report
                .warnings
                .iter()
                .any(|w| w.contains("on the CPU") || w.contains("the CPU traced")),
            "{:?}",
            r.report.warnings
        );
    }
    let after = Gpu::shared().unwrap();
    assert!(after.failure().is_none() && !Arc::ptr_eq(&before, &after));
}

/// A device that is lost whenever it is opened is reopened a few times and then given up, and the
/// CPU traces the rays.
#[test]
fn a_device_that_is_lost_again_and_again_is_given_up_by_name() {
    let Some(_) = gpu() else { return };
    let field = cube(17, lopsided);
    let starts = grid(16, 0.9);
    let own = Arc::new(Gpu::open().unwrap());
    let paths =
        GpuPaths::new(own.clone(), &field, oblique(), Interpolant::BSpline, GpuOptions::default())
            .unwrap()
            .with_batch(64);
    let on_cpu = Deviational::new(&field, oblique(), Interpolant::BSpline, Options::default());
    let expected = trace(&on_cpu, &starts);
    for lost in 1..=5 {
        paths.gpu().destroy();
        let exits = trace(&paths, &starts);
        let (_, max) = difference(&exits, &expected);
        assert!(max < TOLERANCE, "{max:e}");
        let c = paths.counters();
        assert_eq!(c.rays_on_cpu > 0, lost > 3, "lost {lost} times: {c:?}");
    }
    let warning = paths.device_warning().unwrap();
    assert!(
        warning.contains("after 3 attempts to reopen it")
            && warning.contains("the CPU traced the rest"),
        "{warning}"
    );
}

/// What the CPU traces in place of the device is the same march with the same interpolant.
#[test]
fn the_cpu_traces_the_rest_by_the_march_of_the_device() {
    let Some(_) = gpu() else { return };
    let field = cube(17, lopsided);
    let starts = grid(16, 0.9);
    for method in Method::ALL {
        let options = GpuOptions { method, step_voxels: 0.83, ..GpuOptions::default() };
        let interpolant = Interpolant::TrilinearGradient;
        let own = Arc::new(Gpu::open().unwrap());
        let paths = GpuPaths::new(own, &field, oblique(), interpolant, options).unwrap();
        let expected = trace(&paths, &starts);
        for _ in 0..4 {
            paths.gpu().destroy();
            let (_, max) = difference(&trace(&paths, &starts), &expected);
            assert!(max < 2.0 * TOLERANCE, "{method:?}: {max:e}");
        }
        // Straight rays are never sent.
        let was_sent = method != Method::LineOfSight;
        assert_eq!(paths.counters().rays_on_cpu > 0, was_sent, "{method:?}");
    }
}

/// A frame that was under way starts again on the reopened device, and its film has each photon
/// once.
#[test]
fn a_frame_whose_device_is_lost_starts_again() {
    let _turn = PROGRAM_GPU.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(_) = gpu() else { return };
    let field = cube(17, lopsided);
    for method in ["verlet", "line-of-sight"] {
        lose_a_frame(&field, method);
    }
}

fn lose_a_frame(field: &Field, method: &str) {
    let toml = format!(
        "[flow]\nfile = \"\"\ndensity = \"-\"\n[film]\nsize = [40, 30]\n[march]\ndevice = \
         \"gpu\"\nmethod = \"{method}\"\n[sampling]\nmethod = \"photons\"\nsamples = 2000"
    );
    let scene = Scene::from_toml(&toml).unwrap();
    let section = TestSection::of_fields(&scene, vec![field.clone()], None).unwrap();
    let frame = |lose: bool| {
        let progress = |done: f64| {
            if lose && done > 0.0 && done < 1.0 {
                Gpu::shared().unwrap().destroy();
            }
        };
        let cancel = std::sync::atomic::AtomicBool::new(false);
        let control = Control { cancel: &cancel, progress: &progress };
        render(&scene, &section, Layers::NONE, &control).unwrap()
    };
    let expected = frame(false);
    // The device is lost after the first part of each attempt: three times it is reopened, then
    // the CPU exposes the film.
    let image = frame(true);
    let named = image.report.warnings.iter().any(|w| w.contains("lost"));
    assert!(named, "{:?}", image.report.warnings);
    let [a, b] = [&image, &expected].map(|o| o.report.tally);
    assert_eq!((a.sent, a.landed), (b.sent, b.landed));
    let worst = image
        .pixels
        .iter()
        .zip(&expected.pixels)
        .fold(0.0f32, |m, (a, b)| m.max((a[0] - b[0]).abs()));
    assert!(worst < 1e-3, "{worst}");
}
