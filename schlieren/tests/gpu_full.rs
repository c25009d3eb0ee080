//! Tests the full marches of the GPU, in single precision, against those of the CPU, in double
//! precision.
//!
//! Any Vulkan device will do, also Mesa's lavapipe. Without one these tests print that they are
//! skipped and pass, unless RTSV_REQUIRE_PEERS=1.
#![cfg(feature = "gpu")]

mod common;
mod device;

use common::{cube, difference, grid, largest, lopsided, oblique, trace};
use device::{gpu, relative, with_body};
use glam::DVec3;
use schlieren::field::Field;
use schlieren::gpu::{Gpu, GpuOptions, GpuPaths, Method};
use schlieren::interpolate::{BSpline, Interpolant, Interpolate, Trilinear, TrilinearGradient};
use schlieren::march::{BlankCells, Full, FullOptions, Pefrl, RungeKutta4, Sharma};
use schlieren::path::{Exit, PathQuantities, Start, Status};
use schlieren::view::{Axis, View};
use std::sync::Arc;

const FULL: [Method; 3] = [Method::Pefrl, Method::Sharma, Method::RungeKutta4];

/// Largest difference of a full march from that in double precision, relative to the largest value.
/// Positions across a field of 32 voxels are rounded to 1e-6 of a voxel, and eps changes by as much
/// of itself over a few voxels.
const OF_DOUBLE_PRECISION: f64 = 2e-6;

/// The same of deflections through glass, and of displacements, paths and turning points in parts
/// of the field's size: a lens enlarges the roundings before it.
const THROUGH_GLASS: f64 = 1e-5;
const BEHIND_GLASS_M: f64 = 1e-4;

/// Exits of the full march on the CPU, in double precision.
fn full(
    field: &Field,
    view: View,
    interpolant: Interpolant,
    options: GpuOptions,
    starts: &[Start],
) -> Vec<Exit> {
    match interpolant {
        Interpolant::BSpline => full_with(field, &BSpline::new(field), view, options, starts),
        Interpolant::Trilinear => full_with(field, &Trilinear::new(field), view, options, starts),
        Interpolant::TrilinearGradient => {
            full_with(field, &TrilinearGradient::new(field), view, options, starts)
        }
    }
}

fn full_with<I: Interpolate>(
    field: &Field,
    interpolate: &I,
    view: View,
    GpuOptions { method, step_voxels, quantities, blank, .. }: GpuOptions,
    starts: &[Start],
) -> Vec<Exit> {
    let options = FullOptions { step_voxels, quantities, blank, ..FullOptions::default() };
    match method {
        Method::Sharma => trace(&Full::new(field, interpolate, Sharma, view, options), starts),
        Method::RungeKutta4 => {
            trace(&Full::new(field, interpolate, RungeKutta4, view, options), starts)
        }
        _ => trace(&Full::new(field, interpolate, Pefrl, view, options), starts),
    }
}

/// Exits of the GPU, and of the CPU in double precision.
fn both(
    gpu: Arc<Gpu>,
    field: &Field,
    view: View,
    interpolant: Interpolant,
    options: GpuOptions,
    starts: &[Start],
) -> [Vec<Exit>; 2] {
    let on_gpu = GpuPaths::new(gpu, field, view, interpolant, options).unwrap();
    let exits = trace(&on_gpu, starts);
    assert_eq!(on_gpu.counters().rays_on_cpu, 0, "the device failed");
    [exits, full(field, view, interpolant, options, starts)]
}

/// The full marches of the CPU are in double precision. Deviations are small and their sums are
/// compensated, so the device's single precision differs by roundings of positions.
#[test]
fn full_marches_agree_with_double_precision_through_gases_of_any_strength() {
    let Some(gpu) = gpu() else { return };
    for amplitude in [1e-8, 1e-4] {
        let field = cube(33, |p| amplitude * 1e4 * lopsided(p));
        for view in [View::along(Axis::Z, DVec3::ZERO), oblique()] {
            for method in FULL {
                for step_voxels in [1.0, 0.37] {
                    let quantities = PathQuantities { opd: true };
                    let options =
                        GpuOptions { method, step_voxels, quantities, ..GpuOptions::default() };
                    let interpolant = Interpolant::BSpline;
                    let starts = grid(11, 0.9);
                    let [a, b] = both(gpu.clone(), &field, view, interpolant, options, &starts);
                    let (_, max) = difference(&a, &b);
                    let xi = relative(&a, &b, |e| e.displacement_m[0]);
                    let opd = relative(&a, &b, |e| e.opd_m);
                    assert!(
                        max.max(xi).max(opd) < OF_DOUBLE_PRECISION,
                        "{method:?}, {amplitude:e}: {max:e} {xi:e} {opd:e}"
                    );
                    for (a, b) in a.iter().zip(&b) {
                        assert_eq!((a.status, a.transmission), (b.status, b.transmission));
                        assert!((a.exit_depth_m - b.exit_depth_m).abs() < 1e-6);
                    }
                }
            }
        }
    }
}

/// A ball of glass bends rays by up to a quarter turn and turns those at its rim; a plane between
/// media reflects all light that comes from the denser one.
#[test]
fn rays_through_glass_agree_and_those_that_turn_are_the_same() {
    let Some(gpu) = gpu() else { return };
    let field = cube(33, |p| 0.5 / (1.0 + ((p.length() - 0.25) / 0.03).exp()));
    let mirror = cube(33, |p| 0.6 - 0.9 / (1.0 + ((p.z + p.x - 0.1) / -0.05).exp()));
    let mut all_turned = 0;
    for (field, name) in [(&field, "ball"), (&mirror, "mirror")] {
        for method in FULL {
            for view in [View::along(Axis::Z, DVec3::ZERO), oblique()] {
                let quantities = PathQuantities { opd: true };
                let options =
                    GpuOptions { method, step_voxels: 0.5, quantities, ..GpuOptions::default() };
                let starts = grid(21, 0.9);
                let [a, b] = both(gpu.clone(), field, view, Interpolant::BSpline, options, &starts);
                let turned = b.iter().filter(|e| e.status == Status::Turned).count();
                let scale = largest(&b);
                let mut worst = [0.0f64; 4];
                for (a, b) in a.iter().zip(&b) {
                    assert_eq!((a.status, a.transmission), (b.status, b.transmission), "{name}");
                    assert_eq!(a.opd_m.is_nan(), b.opd_m.is_nan());
                    // Rays that leave along the exit plane reach it far away.
                    let far = b.displacement_m.iter().any(|x| x.abs() > 1.0);
                    for c in 0..2 {
                        let d = f64::from(a.deflection_rad[c] - b.deflection_rad[c]).abs();
                        worst[0] = worst[0].max(d / scale);
                        let d = f64::from(a.displacement_m[c] - b.displacement_m[c]).abs();
                        worst[1] = worst[1].max(if far { 0.0 } else { d });
                    }
                    let d = f64::from(a.exit_depth_m - b.exit_depth_m).abs();
                    let opd = f64::from(a.opd_m - b.opd_m).abs();
                    worst[2] = worst[2].max(d);
                    worst[3] = worst[3].max(if far || opd.is_nan() { 0.0 } else { opd });
                }
                let [deflection, others @ ..] = worst;
                assert!(deflection < THROUGH_GLASS, "{name}, {method:?}: {deflection:e}");
                let other = others.into_iter().fold(0.0, f64::max);
                assert!(other < BEHIND_GLASS_M, "{name}, {method:?}: {others:?}");
                all_turned += turned;
            }
        }
    }
    assert!(all_turned > 500, "{all_turned}");
}

#[test]
fn masks_stop_the_rays_of_full_marches_that_they_stop_on_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let field = with_body(29);
    let starts = grid(23, 0.9);
    for blank in [BlankCells::Opaque, BlankCells::Continued] {
        for method in FULL {
            let options = GpuOptions { method, blank, ..GpuOptions::default() };
            let interpolant = Interpolant::BSpline;
            let [a, b] = both(gpu.clone(), &field, oblique(), interpolant, options, &starts);
            let scale = largest(&b);
            for (a, b) in a.iter().zip(&b) {
                assert_eq!((a.status, a.transmission), (b.status, b.transmission), "{method:?}");
                let free = if a.transmission > 0.0 { 0..2 } else { 0..0 };
                for c in free {
                    let d = f64::from((a.deflection_rad[c] - b.deflection_rad[c]).abs());
                    assert!(d < OF_DOUBLE_PRECISION * scale, "{method:?}: {d:e} rad");
                }
            }
            let dark = a.iter().filter(|e| e.transmission == 0.0).count();
            assert!((10..400).contains(&dark), "{dark} of {} rays are stopped", a.len());
        }
    }
}
