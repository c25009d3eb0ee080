//! Closest points and signed distances against every triangle in f64.

use crate::common::*;
use rt_core::bvh::{BuildOptions, Geometry, Instance, NoDistance, World};
use rt_core::glam::{DAffine3, DQuat, DVec3, Vec3};
use rt_core::math::SplitMix64;
use rt_core::mesh::TriMesh;
use rt_core::shapes::{Radii, Spheres};
use std::sync::Arc;

/// The distance of `p` to a triangle by ternary search over its weights: slow, and without the
/// cases of the formula under test.
fn distance_by_search(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let least = |f: &dyn Fn(f64) -> f64| {
        let (mut lo, mut hi) = (0.0, 1.0);
        for _ in 0..45 {
            let (x, y) = (lo + (hi - lo) / 3.0, hi - (hi - lo) / 3.0);
            if f(x) < f(y) { hi = y } else { lo = x }
        }
        f(0.5 * (lo + hi))
    };
    // The distance is convex in both weights.
    least(&|u| least(&|s| (a + (b - a) * u + (c - a) * (s * (1.0 - u)) - p).length()))
}

fn place(geometry: usize, world_from_object: DAffine3) -> Instance {
    Instance { geometry, world_from_object }
}

/// Meshes that share a tree, and two instances of another one, sheared and turned.
fn many() -> (Vec<Geometry>, Vec<Instance>) {
    let meshes = [soup(60, 1), soup(40, 2), soup(30, 3)];
    let geometries = meshes.into_iter().map(|m| Geometry::Mesh(Arc::new(m))).collect();
    let shear =
        DAffine3::from_cols_array(&[1.0, 0.0, 0.0, 0.7, 0.4, 0.0, 0.0, -0.3, 2.0, 1.5, 0.0, 0.0]);
    let turn = DAffine3::from_scale_rotation_translation(
        DVec3::splat(0.5),
        DQuat::from_rotation_y(1.0),
        DVec3::new(-1.0, 1.0, 0.5),
    );
    let i = DAffine3::IDENTITY;
    (geometries, vec![place(0, i), place(1, i), place(2, shear), place(2, turn)])
}

/// The triangles of all instances, in world space.
fn triangles(world: &World) -> Vec<[DVec3; 3]> {
    let of = |i: &Instance| {
        let Geometry::Mesh(mesh) = &world.geometries()[i.geometry] else { return vec![] };
        let corner = |p: Vec3| i.world_from_object.transform_point3(p.as_dvec3() + mesh.origin);
        let usable = (0..mesh.num_triangles()).filter(|&k| mesh.is_renderable(k));
        usable.map(|k| mesh.triangle(k).map(corner)).collect()
    };
    world.instances().iter().flat_map(of).collect()
}

#[test]
fn closest_points_are_those_of_every_triangle() {
    let (geometries, instances) = many();
    for options in some_options() {
        let world = World::build(geometries.clone(), instances.clone(), &options).unwrap();
        let all = triangles(&world);
        let mut random = SplitMix64::new(4);
        for _ in 0..15 {
            let p = random.direction() * (3.0 * random.unit());
            let expected =
                all.iter().map(|t| distance_by_search(p, *t)).fold(f64::INFINITY, f64::min);
            let at = world.render_from_world(p);
            let found = world.closest_point(at, f32::INFINITY).unwrap().unwrap();
            let error = (f64::from(found.distance) - expected).abs();
            assert!(error < 1e-6, "{options:?}: {p}: {found:?}, expected {expected}");
            // The point is where the triangle and the weights say, and that far away.
            let instance = &world.instances()[found.instance as usize];
            let Geometry::Mesh(mesh) = &world.geometries()[instance.geometry] else { panic!() };
            let [a, b, c] = mesh
                .triangle(found.prim as usize)
                .map(|p| instance.world_from_object.transform_point3(p.as_dvec3() + mesh.origin));
            let q = a + (b - a) * f64::from(found.u) + (c - a) * f64::from(found.v);
            let point = found.point.as_dvec3() + world.origin();
            assert!((q - point).length() < 1e-5, "{options:?}: {q} is not {point}");
            assert!((point - p).length() - expected < 1e-5, "{options:?}: {point}");
            // Nothing is found within less than the distance, and the same within more.
            assert_eq!(world.closest_point(at, 0.999 * found.distance - 1e-6), Ok(None));
            assert_eq!(world.closest_point(at, 1.001 * found.distance + 1e-6), Ok(Some(found)));
        }
    }
}

#[test]
fn signed_distances_are_those_of_a_sphere_and_a_cube() {
    let ball = sphere(4, 2.0, DVec3::new(1e6, -3e5, 2e4));
    let world = World::from_mesh(ball, &BuildOptions::default()).unwrap();
    let mut random = SplitMix64::new(6);
    for _ in 0..300 {
        let p = random.direction() * (4.0 * random.unit());
        let at = world.render_from_world(DVec3::new(1e6, -3e5, 2e4) + p);
        let d = world.signed_distance(at).unwrap().unwrap();
        // The triangles cut the sphere by up to 0.3 % of its radius.
        assert!((f64::from(d) - (p.length() - 2.0)).abs() < 0.01, "{p}: {d}");
    }
    let world = World::from_mesh(cube(3), &BuildOptions::default()).unwrap();
    for (p, d) in [
        (Vec3::ZERO, -1.0),
        (Vec3::new(0.5, 0.25, 0.0), -0.5),
        (Vec3::new(0.0, 3.0, 0.0), 2.0),
        (Vec3::new(2.0, 2.0, 0.0), 2f32.sqrt()),
        (Vec3::new(2.0, 2.0, 2.0), 3f32.sqrt()),
        (Vec3::new(1.0, 0.5, 0.5), 0.0),
        (Vec3::ONE, 0.0),
    ] {
        assert_eq!(world.signed_distance(p), Ok(Some(d)), "{p}");
    }
}

#[test]
fn triangles_without_area_and_of_nan_have_the_distance_of_what_they_are() {
    let nan = Vec3::NAN;
    // A segment, a point, and a triangle of NaN that comes after the build.
    let positions = vec![Vec3::X * 3.0, Vec3::X * 5.0, Vec3::Y * 7.0, Vec3::Z, nan];
    let mesh =
        |positions: Vec<Vec3>| TriMesh::new(positions, vec![[0, 1, 0], [2, 2, 2], [0, 3, 4]]);
    let mut before = positions.clone();
    before[4] = Vec3::Z * 2.0;
    let mut world = World::from_mesh(mesh(before), &BuildOptions::default()).unwrap();
    assert_eq!(world.closest_point(Vec3::Z, 9.0).unwrap().map(|c| c.prim), Some(2));
    world.refit(0, Arc::new(mesh(positions))).unwrap();
    let near = |p: Vec3| world.closest_point(p, f32::INFINITY).unwrap().unwrap();
    let found = near(Vec3::ZERO);
    assert_eq!((found.prim, found.distance, found.point), (0, 3.0, Vec3::X * 3.0));
    let found = near(Vec3::new(4.0, 1.0, 0.0));
    assert_eq!((found.prim, found.distance, found.point), (0, 1.0, Vec3::X * 4.0));
    let found = near(Vec3::Y * 8.0);
    assert_eq!((found.prim, found.distance, found.point), (1, 1.0, Vec3::Y * 7.0));
}

#[test]
fn points_without_an_answer_get_none_and_shapes_are_refused_by_number() {
    let empty = World::from_mesh(TriMesh::default(), &BuildOptions::default()).unwrap();
    assert_eq!(empty.closest_point(Vec3::ZERO, f32::INFINITY), Ok(None));
    assert_eq!(empty.signed_distance(Vec3::ZERO), Ok(None));
    let world = World::from_mesh(cube(1), &BuildOptions::default()).unwrap();
    for (p, limit) in [(Vec3::NAN, 1.0), (Vec3::INFINITY, 1.0), (Vec3::ZERO, f32::NAN)] {
        assert_eq!(world.closest_point(p, limit), Ok(None));
    }
    assert_eq!(world.closest_point(Vec3::ZERO, -1.0), Ok(None));
    let spheres = Spheres::new(vec![Vec3::ZERO], Radii::Common(1.0)).unwrap();
    let geometries = vec![Geometry::Mesh(Arc::new(cube(1))), Geometry::Shape(Arc::new(spheres))];
    let instances = [0, 1].map(|g| place(g, DAffine3::IDENTITY)).to_vec();
    let world = World::build(geometries, instances, &BuildOptions::default()).unwrap();
    let refused = Err(NoDistance { instance: 1 });
    assert_eq!(world.closest_point(Vec3::ZERO, 1.0), refused);
}
