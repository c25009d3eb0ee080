//! Coincident surfaces: the lowest instance wins, then the lowest primitive, for every query and
//! every order of traversal.

use crate::common::*;
use rt_core::bvh::{Geometry, Instance, World};
use rt_core::glam::{DAffine3, DQuat, DVec3, Vec3};
use rt_core::mesh::TriMesh;
use rt_core::ray::Ray;
use std::sync::Arc;

fn layers(one: &TriMesh, copies: u32) -> TriMesh {
    let n = one.positions.len() as u32;
    let mut mesh = TriMesh::default();
    for c in 0..copies {
        mesh.positions.extend(&one.positions);
        mesh.indices.extend(one.indices.iter().map(|t| t.map(|i| i + c * n)));
    }
    mesh
}

fn views() -> Vec<Ray> {
    let mut rays = camera(Vec3::new(2.1, -3.3, 1.7), Vec3::ZERO, 1.3, 4);
    rays.extend(inward_rays(3000, 5));
    rays
}

#[test]
fn coplanar_layers_have_one_winner() {
    for one in [cube(5), sphere(3, 1.0, DVec3::ZERO)] {
        let first = one.indices.len() as u32;
        let mesh = layers(&one, 3);
        for options in some_options() {
            let w = world(&mesh, &options);
            let hits = hits_all_ways(&w, &views(), &format!("{options:?}"));
            let wrong = hits.iter().flatten().filter(|h| h.prim >= first).count();
            assert_eq!(
                wrong,
                0,
                "{options:?}: hits that are not of the first layer, of {}",
                hits.len()
            );
        }
    }
}

#[test]
fn coplanar_instances_have_one_winner() {
    let turn = DAffine3::from_rotation_translation(
        DQuat::from_euler(rt_core::glam::EulerRot::XYZ, 0.5, 1.0, -0.3),
        DVec3::new(0.1, -0.2, 0.3),
    );
    for place in [DAffine3::IDENTITY, turn] {
        for options in some_options() {
            let geometries =
                vec![Geometry::Mesh(Arc::new(cube(4))), Geometry::Mesh(Arc::new(cube(4)))];
            let instances =
                [1, 0, 0, 1].map(|geometry| Instance { geometry, world_from_object: place });
            let w = World::build(geometries, instances.to_vec(), &options).expect("invertible");
            let hits = hits_all_ways(&w, &views(), &format!("{options:?} {place:?}"));
            assert!(hits.iter().flatten().count() > 3000);
            assert!(
                hits.iter().flatten().all(|h| h.instance == 0),
                "{options:?}: the lowest instance wins"
            );
        }
    }
}

#[test]
fn a_hundred_thousand_copies_of_one_triangle_build_and_answer() {
    let mesh = TriMesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        indices: vec![[0, 1, 2]; 100_000],
        ..Default::default()
    };
    let through = Ray::new(Vec3::new(0.2, 0.3, 1.0), -Vec3::Z);
    for options in some_options() {
        let w = world(&mesh, &options);
        let hit = w.closest(&through).expect("in the middle of it");
        assert_eq!((hit.prim, hit.t), (0, 1.0), "{options:?}");
        assert!(
            !w.occluded(&Ray::new(Vec3::new(0.6, 0.6, 1.0), -Vec3::Z)),
            "{options:?}: beside it"
        );
    }
}
