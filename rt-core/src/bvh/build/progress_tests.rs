//! Builds that are watched and stopped.

use super::progress::PRIMITIVES_BETWEEN_CHECKS;
use crate::bvh::{BuildError, BuildOptions, BuildQuality, Geometry, Instance, World};
use crate::shapes::{Radii, Spheres};
use crate::test_shapes::noise_soup;
use glam::{DAffine3, Vec3};
use std::ops::ControlFlow;
use std::sync::Arc;

/// One large mesh, many that share a tree, and spheres.
fn scenes() -> Vec<Vec<Geometry>> {
    let mesh = |n: usize| Geometry::Mesh(Arc::new(noise_soup(n, n as u64)));
    let centers: Vec<Vec3> = (0..100_000).map(|i| Vec3::new(i as f32, 0.0, 0.0)).collect();
    let spheres = Spheres::new(centers, Radii::Common(0.5)).expect("sound spheres");
    vec![
        vec![mesh(200_000)],
        (1..60).map(|k| mesh(k * 40)).chain([mesh(140_000)]).collect(),
        vec![Geometry::Shape(Arc::new(spheres))],
    ]
}

fn once_each(geometries: &[Geometry]) -> Vec<Instance> {
    let instance = |geometry| Instance { geometry, world_from_object: DAffine3::IDENTITY };
    (0..geometries.len()).map(instance).collect()
}

/// Builds on `threads` threads and stops at call `stop_at` of the watch. Returns the world and what
/// was told.
fn build(
    geometries: &[Geometry],
    quality: BuildQuality,
    threads: usize,
    stop_at: usize,
) -> (Result<World, BuildError>, Vec<f64>) {
    let mut told = Vec::new();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let options = BuildOptions { quality, ..Default::default() };
    let watch = |done: f64| {
        told.push(done);
        if told.len() > stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let (all, placed) = (geometries.to_vec(), once_each(geometries));
    let world = pool.install(|| World::build_watched(all, placed, &options, None, watch));
    (world, told)
}

fn words(world: &World) -> Vec<Vec<u32>> {
    let group = world.group.as_ref().map(|g| &g.bvh);
    let trees = world.blas.iter().filter_map(|b| b.bvh()).chain(group).chain([&world.tlas]);
    trees.map(|t| bytemuck::cast_slice::<_, u32>(&t.units).to_vec()).collect()
}

#[test]
fn a_watched_build_tells_how_far_it_is_and_gives_the_same_tree() {
    for (scene, geometries) in scenes().iter().enumerate() {
        let options = BuildOptions::default();
        let plain = World::build(geometries.clone(), once_each(geometries), &options).unwrap();
        for threads in [1, 3] {
            let (world, told) = build(geometries, options.quality, threads, usize::MAX);
            assert!(words(&world.unwrap()) == words(&plain), "scene {scene}, {threads} threads");
            assert_eq!((told[0], told.last()), (0.0, Some(&1.0)), "scene {scene}");
            assert!(told.is_sorted(), "scene {scene}: {told:?}");
            let primitives: usize = geometries.iter().map(Geometry::num_primitives).sum();
            let step = PRIMITIVES_BETWEEN_CHECKS as f64 / primitives as f64;
            if threads == 1 {
                let steps = told.windows(2).all(|w| w[1] - w[0] <= step);
                assert!(steps, "scene {scene}: more than {step} at once: {told:?}");
                // Boxes, cuts, fragments and the writing of these have calls of their own.
                assert!(told.len() > 8, "scene {scene}: {told:?}");
            }
        }
    }
}

#[test]
fn a_build_can_be_stopped_at_every_stage() {
    for (scene, geometries) in scenes().iter().enumerate() {
        for quality in [BuildQuality::Balanced, BuildQuality::Best] {
            let calls = build(geometries, quality, 1, usize::MAX).1.len();
            for stop_at in (0..calls).step_by((calls / 9).max(1)).chain([calls - 1]) {
                let (world, told) = build(geometries, quality, 1, stop_at);
                assert_eq!(world.err(), Some(BuildError::Cancelled), "{scene}: call {stop_at}");
                assert_eq!(told.len(), stop_at + 1, "scene {scene}: asked again after the stop");
            }
        }
        for stop_at in [0, 3, 7] {
            let (world, told) = build(geometries, BuildQuality::Balanced, 4, stop_at);
            assert_eq!(world.err(), Some(BuildError::Cancelled), "scene {scene}: call {stop_at}");
            assert_eq!(told.len(), stop_at + 1, "scene {scene}: asked again after the stop");
        }
    }
}

#[test]
fn a_stopped_build_leaves_nothing_behind() {
    let meshes: Vec<_> = (1..5).map(|k| Arc::new(noise_soup(k * 1000, k as u64))).collect();
    let geometries: Vec<_> = meshes.iter().cloned().map(Geometry::Mesh).collect();
    let placed = once_each(&geometries);
    let options = BuildOptions::default();
    let earlier = World::build(geometries[..3].to_vec(), placed[..3].to_vec(), &options).unwrap();
    let before = words(&earlier);
    let owners = || meshes.iter().map(Arc::strong_count).collect::<Vec<_>>();
    let held = owners();
    let mut calls = 0;
    let watch = |_| {
        calls += 1;
        if calls == 4 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let all = geometries.clone();
    let stopped = World::build_watched(all, placed.clone(), &options, Some(&earlier), watch);
    assert_eq!(stopped.err(), Some(BuildError::Cancelled));
    assert_eq!(owners(), held, "a mesh is still held");
    assert!(words(&earlier) == before);
    let built = World::build_sharing(geometries, placed, &options, Some(&earlier));
    assert!(built.is_ok(), "the earlier world still lends its trees");
}
