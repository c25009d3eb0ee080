//! Shapes in the world's acceleration structure must give the same result as trying every
//! primitive.

mod shapes_common;

use glam::{DAffine3, DVec3, UVec3, Vec3};
use rt_core::bvh::{BuildOptions, BuildQuality, Geometry, Instance, World};
use rt_core::grid::Grid;
use rt_core::ray::Ray;
use rt_core::shapes::{Isosurface, Radii, Shape, Spheres, Tubes};
use shapes_common::{Random, closest};
use std::sync::Arc;

fn world_of(shape: Arc<dyn Shape>, quality: BuildQuality) -> World {
    let instance = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
    let options = BuildOptions { quality, ..Default::default() };
    World::build(vec![Geometry::Shape(shape)], vec![instance], &options).unwrap()
}

#[test]
fn hits_through_the_world_are_those_of_trying_every_primitive() {
    let mut rng = Random::new(1);
    let points: Vec<Vec3> = (0..200).map(|_| 4.0 * rng.cube()).collect();
    let n = 17u32;
    let ball: Vec<f32> = (0..n * n * n)
        .map(|i| (UVec3::new(i % n, i / n % n, i / n / n).as_vec3() - 8.0).length())
        .collect();
    let grid =
        Arc::new(Grid::new(UVec3::splat(n), DVec3::splat(-4.0), DVec3::splat(0.5), ball).unwrap());
    let shapes: [Arc<dyn Shape>; 3] = [
        Arc::new(Spheres::new(points.clone(), Radii::Common(0.3)).unwrap()),
        Arc::new(Tubes::new(points, &[0, 50, 120, 200], Radii::Common(0.1)).unwrap()),
        Arc::new(Isosurface::new(grid, &[5.3, 7.0], &Default::default()).unwrap()),
    ];
    for (s, shape) in shapes.iter().enumerate() {
        for quality in BuildQuality::ALL {
            let world = world_of(shape.clone(), quality);
            // The difference between the object's origin and the world's.
            let shift = (world.origin() - shape.origin()).as_vec3();
            let mut hits = 0;
            for k in 0..3000 {
                let origin = 8.0 * rng.unit_vector();
                let mut target = 3.0 * rng.cube();
                if k % 2 == 0 {
                    target = (2.0 * target).round() / 2.0; // grid points
                }
                let ray = Ray::new(origin, target - origin);
                let found = world.closest(&ray);
                let expected = closest(shape.as_ref(), &Ray { origin: ray.origin + shift, ..ray });
                assert_eq!(found.is_some(), expected.is_some(), "shape {s} {quality:?} ray {k}");
                if let (Some(f), Some((prim, e))) = (found, expected) {
                    assert!(
                        (f.t - e.t).abs() <= 4e-6 * e.t,
                        "shape {s} {quality:?} ray {k}: {} {}",
                        f.t,
                        e.t
                    );
                    assert!(f.prim == prim || (f.t - e.t).abs() <= 4e-6 * e.t);
                    assert!(world.occluded(&ray));
                    hits += 1;
                }
            }
            assert!(hits > 200, "{hits}");
        }
    }
}

#[test]
fn no_ray_leaves_a_closed_isosurface_through_the_world() {
    let n = 33u32;
    let ball: Vec<f32> = (0..n * n * n)
        .map(|i| (UVec3::new(i % n, i / n % n, i / n / n).as_vec3() - 16.0).length())
        .collect();
    let origin = DVec3::new(1e6, -3e5, 7.0);
    let grid = Arc::new(Grid::new(UVec3::splat(n), origin, DVec3::splat(0.01), ball).unwrap());
    let world = world_of(
        Arc::new(Isosurface::new(grid, &[11.7], &Default::default()).unwrap()),
        BuildQuality::Balanced,
    );
    let mut rng = Random::new(3);
    let render = |index: Vec3| world.render_from_world(origin + 0.01 * index.as_dvec3());
    let mut leaks = 0;
    for k in 0..200_000 {
        let start = if k % 2 == 0 { Vec3::splat(16.0) } else { 16.0 + 3.0 * rng.cube() };
        let mut target = 16.0 + 16.0 * rng.cube();
        match k % 4 {
            0 => target = target.round(),
            1 => target.x = target.x.round(),
            2 => target = start + (2.0 * rng.cube()).round(),
            _ => {}
        }
        if target == start {
            continue;
        }
        let ray = Ray::new(render(start), render(target) - render(start));
        leaks += world.closest(&ray).is_none() as u32;
    }
    assert_eq!(leaks, 0);
}
