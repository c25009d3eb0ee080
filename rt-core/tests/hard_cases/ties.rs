//! Surfaces in the same place: the lowest instance, then the lowest primitive wins, whoever asks.

use crate::common::*;
use rt_core::glam::Vec3;
use rt_core::mesh::TriMesh;

fn layers(n: u32, copies: u32) -> TriMesh {
    let one = cube(n);
    let mut mesh = one.clone();
    for c in 1..copies {
        let base = mesh.positions.len() as u32;
        mesh.positions.extend(&one.positions);
        let _ = c;
        mesh.indices.extend(one.indices.iter().map(|t| t.map(|i| i + base)));
    }
    mesh
}

#[test]
fn coplanar_layers_have_one_winner() {
    let mesh = layers(5, 3);
    let first = mesh.indices.len() as u32 / 3;
    let mut rays = camera(Vec3::new(2.1, -3.3, 1.7), Vec3::ZERO, 1.3, 4);
    rays.extend(inward_rays(4000, 5));
    for options in some_options() {
        let w = world(&mesh, &options);
        let hits = hits_all_ways(&w, &rays, &format!("{options:?}"));
        let wrong = hits.iter().flatten().filter(|h| h.prim >= first).count();
        assert_eq!(wrong, 0, "{options:?}: hits that are not of the first layer, of {}", hits.len());
    }
}
