//! Time of rays without rendering, on one thread: primary rays, shadow rays to a point, ambient
//! occlusion. `cargo bench -p rt-core --bench trace`

mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rt_core::bvh::{BuildOptions, Geometry, Instance, Robustness, World};
use rt_core::glam::{DAffine3, Vec3};
use rt_core::math::orthonormal_basis;
use rt_core::mesh::TriMesh;
use rt_core::ray::{HitBlock, LANES, Ray, RayBlock};
use rt_core::sampler::{Sampler, Sampling, cosine_hemisphere};
use std::hint::black_box;
use std::sync::Arc;

const SIZE: u32 = 256;

fn trace(c: &mut Criterion) {
    let mesh = Arc::new(common::shells());
    for robustness in Robustness::ALL {
        let options = BuildOptions { robustness, ..Default::default() };
        let world = World::from_mesh(mesh.clone(), &options).expect("a sound mesh");
        let primary = common::primary_rays(&world, SIZE);
        let points = common::points_met(&world, &mesh, &primary);
        // From the light to the points: one common origin, which packets can exploit.
        let light = Vec3::new(4.0, 5.0, 3.0);
        let shadow: Vec<Ray> =
            points.iter().map(|(p, _)| Ray::new(light, *p - light).with_t_max(0.9999)).collect();
        let shadow = RayBlock::from_rays(&shadow);
        let around = |(i, (p, n)): (usize, &(Vec3, Vec3))| {
            let (x, y) = orthonormal_basis(*n);
            let (p, n) = (*p, *n);
            (0..8).map(move |k| {
                let d = cosine_hemisphere(
                    Sampler::new(Sampling::Sobol, 0, i as u32, 0, 0).square_of(0, k, 8),
                );
                Ray::new(p, x * d.x + y * d.y + n * d.z)
            })
        };
        let occlusion: Vec<Ray> = points.iter().enumerate().flat_map(around).collect();
        let occlusion = RayBlock::from_rays(&occlusion);

        let mut group = c.benchmark_group(format!("trace {}", robustness.name()));
        let mut hits = vec![HitBlock::MISS; primary.len()];
        let mut masks = vec![0; occlusion.len()];
        group.throughput(Throughput::Elements((primary.len() * LANES) as u64));
        group.bench_function("primary, packets", |b| {
            b.iter(|| world.closest_coherent(black_box(&primary), &mut hits).expect("one each"));
        });
        group.bench_function("primary, single rays", |b| {
            b.iter(|| {
                primary
                    .iter()
                    .flat_map(|r| (0..LANES).map(|l| r.get(l)))
                    .filter_map(|r| world.closest(&r))
                    .count()
            });
        });
        group.throughput(Throughput::Elements(points.len() as u64));
        group.bench_function("shadow, packets", |b| {
            let masks = &mut masks[..shadow.len()];
            b.iter(|| world.occluded_coherent(black_box(&shadow), masks).expect("one each"));
        });
        group.throughput(Throughput::Elements(8 * points.len() as u64));
        group.bench_function("ambient occlusion, streams", |b| {
            b.iter(|| {
                world.occluded_incoherent(black_box(&occlusion), &mut masks).expect("one each")
            });
        });
        group.finish();
    }
}

/// A thousand meshes, each a geometry of its own, and the same triangles in one mesh: the times
/// should be the same.
fn many_meshes(c: &mut Criterion) {
    let parts: Vec<TriMesh> = (0..1000)
        .map(|k| {
            let mut mesh = common::bumpy(k);
            // The plates tile a square of 32 x 32; the camera looks at the unit cube.
            mesh.positions.iter_mut().for_each(|p| *p = *p / 16.0 - Vec3::new(1.0, 1.0, 0.0));
            mesh
        })
        .collect();
    let mut one = TriMesh::default();
    for part in &parts {
        let first = one.positions.len() as u32;
        one.positions.extend_from_slice(&part.positions);
        one.indices.extend(part.indices.iter().map(|t| t.map(|i| i + first)));
    }
    let options = BuildOptions::default();
    let geometries: Vec<Geometry> =
        parts.into_iter().map(|m| Geometry::Mesh(Arc::new(m))).collect();
    let place = |geometry| Instance { geometry, world_from_object: DAffine3::IDENTITY };
    let instances = (0..geometries.len()).map(place).collect();
    let apart = World::build(geometries, instances, &options).expect("sound meshes");
    let merged = World::from_mesh(one, &options).expect("a sound mesh");
    let primary = common::primary_rays(&merged, SIZE);
    let mut group = c.benchmark_group("trace 1000 meshes");
    group.throughput(Throughput::Elements((primary.len() * LANES) as u64));
    for (name, world) in [("apart", &apart), ("merged", &merged)] {
        let mut hits = vec![HitBlock::MISS; primary.len()];
        group.bench_function(format!("primary, packets, {name}"), |b| {
            b.iter(|| world.closest_coherent(black_box(&primary), &mut hits).expect("one each"));
        });
        group.bench_function(format!("primary, blocks, {name}"), |b| {
            b.iter(|| world.closest_incoherent(black_box(&primary), &mut hits).expect("one each"));
        });
        group.bench_function(format!("primary, single rays, {name}"), |b| {
            b.iter(|| {
                let rays = primary.iter().flat_map(|r| (0..LANES).map(|l| r.get(l)));
                rays.filter_map(|r| world.closest(&r)).count()
            });
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = trace, many_meshes
}
criterion_main!(benches);
