//! Time to build the acceleration structure with every preset, on all threads. `cargo bench -p
//! rt-core --bench build`
//!
//! Use it to see the effect of a change during development. Comparisons with other ray tracers, in
//! alternating rounds, are experiments of `bench`.

mod common;

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use rt_core::bvh::{BuildOptions, BuildQuality, Geometry, Instance, World};
use rt_core::glam::DAffine3;
use rt_core::mesh::TriMesh;
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

/// Refits a tree to moved vertices.
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

/// Worlds of many geometries: a thousand small ones, each too small for a task of its own, and the
/// same together with a large one.
fn many(c: &mut Criterion) {
    let small: Vec<Arc<TriMesh>> = (0..1000).map(|k| Arc::new(common::bumpy(k))).collect();
    let mut with_large = small.clone();
    with_large.insert(500, Arc::new(common::shells()));
    let mut group = c.benchmark_group("many geometries");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    for (name, meshes) in [("1000 small", small), ("1000 small and a large one", with_large)] {
        let triangles: usize = meshes.iter().map(|m| m.num_triangles()).sum();
        group.throughput(Throughput::Elements(triangles as u64));
        let geometries: Vec<Geometry> = meshes.into_iter().map(Geometry::Mesh).collect();
        let place = |geometry| Instance { geometry, world_from_object: DAffine3::IDENTITY };
        let instances: Vec<Instance> = (0..geometries.len()).map(place).collect();
        group.bench_function(name, |b| {
            b.iter(|| {
                World::build(geometries.clone(), instances.clone(), &BuildOptions::default())
                    .expect("sound meshes")
            });
        });
    }
    group.finish();
}

criterion_group!(benches, build, many, refit);
criterion_main!(benches);
