//! Measures ray-steps and photons per second of one core, in CPU time of the thread, which other
//! programs on the machine disturb least.
//!
//! Run with `cargo bench -p schlieren`. Elements are ray-steps (march) or photons (line of sight).
//! Two cores do twice as much.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use schlieren::field::Field;
use schlieren::interpolate::Interpolant;
use schlieren::march::{BlankCells, Deviational, LineOfSight, Options};
use schlieren::path::{Exit, LightPaths, PathQuantities, Start};
use schlieren::view::{Axis, View};
use std::time::Duration;

fn thread_cpu() -> Duration {
    let t = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::new(t.tv_sec as u64, t.tv_nsec as u32)
}

/// Rays over the middle of the image in tiles of 4x4, one packet each, as the renderer sends them.
fn starts(width: usize, rows: usize) -> Vec<Start> {
    let mut out = Vec::with_capacity(width * rows);
    for tile in 0..width * rows / 16 {
        let (bx, by) = (tile % (width / 4), tile / (width / 4));
        for i in 0..16 {
            let at = |block: usize, i: usize| ((block * 4 + i) as f32 + 0.5) / width as f32;
            let middle = 0.5 * rows as f32 / width as f32;
            out.push(Start {
                position_m: [at(bx, i % 4) - 0.5, at(by, i / 4) - middle],
                tilt_rad: [0.0; 2],
            });
        }
    }
    out
}

fn speed(c: &mut Criterion) {
    let n = 256;
    let blob = |p: DVec3| 1e-5 * (-p.length_squared() / (2.0 * 0.0144)).exp();
    let field = Field::from_fn([n; 3], [1.0 / (n - 1) as f64; 3], DVec3::splat(-0.5), 1.0, blob)
        .expect("a field");
    let oblique = View::new(DVec3::new(0.6f64.sin(), 0.0, 0.6f64.cos()), DVec3::Y, DVec3::ZERO)
        .expect("a view");
    for (name, view) in [("axis", View::along(Axis::Z, DVec3::ZERO)), ("0.6 rad", oblique)] {
        let rays = starts(256, 16);
        let mut exits = vec![Exit::UNDISTURBED; rays.len()];
        let mut group = c.benchmark_group(format!("march 256^3, {name}"));
        group.sample_size(10);
        for interpolant in
            [Interpolant::Trilinear, Interpolant::TrilinearGradient, Interpolant::BSpline]
        {
            for opd in [false, true] {
                let paths = Deviational::new(
                    &field,
                    view,
                    interpolant,
                    Options { quantities: PathQuantities { opd }, ..Options::default() },
                );
                paths.trace(&rays, &mut exits);
                group.throughput(Throughput::Elements(paths.counters().ray_steps));
                let name = format!("{interpolant:?}{}", if opd { " with path" } else { "" });
                group.bench_function(name, |b| {
                    b.iter_custom(|times| {
                        let begin = thread_cpu();
                        for _ in 0..times {
                            paths.trace(&rays, &mut exits);
                        }
                        thread_cpu() - begin
                    });
                });
            }
        }
        group.finish();

        let photons = starts(512, 512);
        let mut exits = vec![Exit::UNDISTURBED; photons.len()];
        let mut group = c.benchmark_group(format!("line of sight 256^3, {name}"));
        group.sample_size(10);
        group.throughput(Throughput::Elements(photons.len() as u64));
        let paths = LineOfSight::new(
            &field,
            view,
            Interpolant::BSpline,
            PathQuantities { opd: true },
            BlankCells::Opaque,
        );
        group.bench_function("photons", |b| {
            b.iter_custom(|times| {
                let begin = thread_cpu();
                for _ in 0..times {
                    paths.trace(&photons, &mut exits);
                }
                thread_cpu() - begin
            });
        });
        group.finish();
    }
}

criterion_group!(benches, speed);
criterion_main!(benches);
