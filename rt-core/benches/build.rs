//! Building the acceleration structure: every preset, on all threads. `cargo bench -p rt-core --bench build`
//!
//! For watching a change while working on it; comparisons with other ray tracers, with rounds in turns, are bench's experiments.

mod common;

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use rt_core::accel::{BuildOptions, BuildQuality, World};
use std::hint::black_box;
use std::sync::Arc;

fn build(c: &mut Criterion) {
    let mesh = Arc::new(common::shells());
    let mut group = c.benchmark_group("build");
    group.throughput(Throughput::Elements(mesh.num_triangles() as u64));
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    for quality in BuildQuality::ALL {
        let options = BuildOptions { quality, ..Default::default() };
        group.bench_function(quality.name(), |b| {
            b.iter(|| World::from_mesh(black_box(mesh.clone()), &options).expect("a sound mesh"));
        });
    }
    group.finish();
}

/// Moved vertices under the same tree.
fn refit(c: &mut Criterion) {
    let mut mesh = common::shells();
    let mut world = World::from_mesh(mesh.clone(), &BuildOptions::default()).expect("a sound mesh");
    let mut group = c.benchmark_group("refit");
    group.throughput(Throughput::Elements(mesh.num_triangles() as u64));
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    let mut stretch = 1.0;
    group.bench_function("stretched", |b| {
        b.iter_batched(
            || {
                stretch = if stretch == 1.0 { 1.01 } else { 1.0 / 1.01 };
                mesh.positions.iter_mut().for_each(|p| p.x *= stretch);
                Arc::new(mesh.clone())
            },
            |moved| world.refit(0, moved).map(black_box).expect("the same triangles"),
            criterion::BatchSize::PerIteration,
        );
    });
    group.finish();
}

criterion_group!(benches, build, refit);
criterion_main!(benches);
