//! Parts of a world that know only their own primitives agree on the choices of the whole.

use rt_core::bvh::{BuildOptions, Geometry, GlobalLayout, Instance, World};
use rt_core::glam::{DAffine3, DVec3, Vec3};
use rt_core::math::{Aabb, SplitMix64};
use rt_core::mesh::TriMesh;
use rt_core::shapes::{Radii, Spheres};
use std::sync::Arc;

/// Triangles around `center`, some of them unusable.
fn mesh(seed: u64, origin: DVec3, center: Vec3, size: f32, triangles: usize) -> TriMesh {
    let mut random = SplitMix64::new(seed);
    let mut number = || (random.bits() >> 40) as f32 / (1 << 24) as f32 - 0.5;
    let mut positions: Vec<Vec3> = (0..3 * triangles)
        .map(|_| center + size * Vec3::new(number(), number(), number()))
        .collect();
    if triangles > 4 {
        positions[4].y = f32::NAN;
        positions[7] = Vec3::splat(f32::INFINITY);
    }
    let indices = (0..triangles as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    TriMesh { origin, ..TriMesh::new(positions, indices) }
}

fn spheres(origin: DVec3, count: usize) -> Geometry {
    let centers = (0..count).map(|k| Vec3::new(k as f32, 0.3 * k as f32, -1.0)).collect();
    Geometry::Shape(Arc::new(
        Spheres::new(centers, Radii::Common(0.4)).unwrap().with_origin(origin),
    ))
}

/// Every third primitive of a geometry, from `part` on.
fn third(geometry: &Geometry, part: usize) -> Geometry {
    let kept: Vec<u32> = (part..geometry.num_primitives()).step_by(3).map(|k| k as u32).collect();
    match geometry {
        Geometry::Mesh(m) => {
            let used: Vec<[u32; 3]> = kept.iter().map(|&k| m.indices[k as usize]).collect();
            let positions = used.iter().flatten().map(|&k| m.positions[k as usize]).collect();
            let indices = (0..used.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
            let part = TriMesh { origin: m.origin, ..TriMesh::new(positions, indices) };
            Geometry::Mesh(Arc::new(part))
        }
        Geometry::Shape(s) => Geometry::Shape(s.part(&kept).expect("spheres can be cut")),
        Geometry::Slices(_) => unreachable!("there are none"),
    }
}

/// The layout that three parts agree on. A part that is behind the others in the number of its
/// joins waits until the next round, in which it is run again.
fn agreed(geometries: &[Geometry], instances: &[Instance]) -> GlobalLayout {
    let parts: Vec<Vec<Geometry>> =
        (0..3).map(|part| geometries.iter().map(|g| third(g, part)).collect()).collect();
    let primitives: Vec<u64> = geometries.iter().map(|g| g.num_primitives() as u64).collect();
    let mut known: Vec<Vec<Aabb>> = Vec::new();
    loop {
        let mut next: Vec<Vec<Aabb>> = Vec::new();
        let mut done = Vec::new();
        for part in &parts {
            let mut call = 0;
            let layout = GlobalLayout::of_parts(part, instances, &primitives, |boxes| {
                call += 1;
                match known.get(call - 1) {
                    Some(joined) => boxes.copy_from_slice(joined),
                    None => {
                        next.push(boxes.to_vec());
                        return Err(());
                    }
                }
                Ok(())
            });
            done.extend(layout.ok());
        }
        match done.len() {
            0 => {}
            3 => {
                assert!(done.windows(2).all(|pair| pair[0] == pair[1]), "parts disagree");
                return done.remove(0);
            }
            n => panic!("{n} of 3 parts asked for fewer joins than the others"),
        }
        let join =
            |a: &Vec<Aabb>, b: &Vec<Aabb>| a.iter().zip(b).map(|(a, b)| a.union(*b)).collect();
        let all = join(&join(&next[0], &next[1]), &next[2]);
        known.push(all);
    }
}

#[test]
fn parts_agree_on_the_layout_of_the_whole() {
    let near = DVec3::ZERO;
    let far = DVec3::new(4e6, -3e6, 1e6);
    let m = |seed, origin, center, size, n| {
        Geometry::Mesh(Arc::new(mesh(seed, origin, Vec3::splat(center), size, n)))
    };
    let placed = |count: usize| -> Vec<Instance> {
        let one = |geometry| Instance { geometry, world_from_object: DAffine3::IDENTITY };
        (0..count).map(one).collect()
    };
    let turned = |geometry, by: DVec3| Instance {
        geometry,
        world_from_object: DAffine3::from_rotation_z(0.7) * DAffine3::from_translation(by),
    };
    let cases: Vec<(&str, Vec<Geometry>, Vec<Instance>)> = vec![
        ("one mesh", vec![m(1, near, 0.0, 2.0, 50)], placed(1)),
        ("one mesh far from zero", vec![m(2, far, 90.0, 2.0, 50)], placed(1)),
        ("a huge one", vec![m(3, near, 0.0, 1e12, 50)], placed(1)),
        (
            "meshes that share a tree, and one too small for it",
            vec![m(4, near, 0.0, 2.0, 50), m(5, near, 3.0, 2.0, 40), m(6, near, 1.0, 1e-4, 9)],
            placed(3),
        ),
        (
            "far meshes and spheres",
            vec![m(7, far, 0.0, 2.0, 50), m(8, far, 3.0, 2.0, 40), spheres(far, 7)],
            placed(3),
        ),
        (
            "instances",
            vec![m(9, near, 0.0, 2.0, 50), m(10, near, 5.0, 2.0, 1), spheres(near, 2)],
            vec![
                turned(0, DVec3::X),
                turned(0, 9.0 * DVec3::Y),
                turned(2, DVec3::Z),
                Instance { geometry: 1, world_from_object: DAffine3::IDENTITY },
            ],
        ),
        ("nothing", vec![m(11, near, 0.0, 2.0, 0), spheres(near, 0)], placed(2)),
        ("no instance", vec![m(12, near, 0.0, 2.0, 9)], Vec::new()),
    ];
    for (name, geometries, instances) in cases {
        let whole =
            World::build(geometries.clone(), instances.clone(), &BuildOptions::default()).unwrap();
        assert_eq!(agreed(&geometries, &instances), whole.global_layout(), "{name}");
    }
}
