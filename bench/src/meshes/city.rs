//! A city: thousands of meshes of different size in one scene, none of them instanced. CAD
//! assemblies, ParaView's blocks and the draws of an OpenGL program look like this.

use super::scene::MeshScene;
use glam::Vec3;
use rt_core::math::SplitMix64;
use rt_core::mesh::TriMesh;
use std::f32::consts::TAU;
use std::sync::Arc;

/// `towers` meshes of 100 to 20,000 triangles on a square, their sizes spread evenly over the
/// logarithm squared, so that most are small. They stand close, and some touch.
pub fn city(towers: u32) -> MeshScene {
    let mut random = SplitMix64::new(11);
    let side = (f64::from(towers)).sqrt();
    let parts = (0..towers).map(|_| {
        let triangles = 100.0 * 200f64.powf(random.unit() * random.unit());
        let place = [random.between(-0.5, 0.5) * side, random.between(-0.5, 0.5) * side];
        let height = 0.3 + 2.5 * random.unit() * random.unit();
        let radius = 0.15 + 0.35 * random.unit();
        let twist = random.between(-1.0, 1.0);
        let shape = [height, radius, twist].map(|x| x as f32);
        Arc::new(tower(triangles, place.map(|x| x as f32), shape))
    });
    MeshScene::many("city", parts.collect())
}

/// A tower with a closed roof, y upwards.
fn tower(triangles: f64, [x, z]: [f32; 2], [height, radius, twist]: [f32; 3]) -> TriMesh {
    let sides = (triangles / 2.0).sqrt().max(5.0) as u32;
    let floors = ((triangles - f64::from(sides)) / (2.0 * f64::from(sides))).max(1.0) as u32;
    let mut mesh = TriMesh::default();
    for f in 0..=floors {
        let up = f as f32 / floors as f32;
        // Every second floor stands back, so that the walls have ledges.
        let r = radius * (1.0 - 0.4 * up) * if f % 2 == 0 { 1.0 } else { 0.93 };
        for s in 0..sides {
            let (sin, cos) = (TAU * (s as f32 / sides as f32) + twist * up).sin_cos();
            mesh.positions.push(Vec3::new(x + r * cos, height * up, z + r * sin));
        }
    }
    let roof = mesh.positions.len() as u32;
    mesh.positions.push(Vec3::new(x, height * 1.05, z));
    let at = |f: u32, s: u32| f * sides + s % sides;
    for s in 0..sides {
        for f in 0..floors {
            mesh.indices.push([at(f, s), at(f + 1, s), at(f + 1, s + 1)]);
            mesh.indices.push([at(f, s), at(f + 1, s + 1), at(f, s + 1)]);
        }
        mesh.indices.push([at(floors, s), roof, at(floors, s + 1)]);
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_city_has_many_clean_meshes_of_different_size() {
        let scene = city(400);
        assert_eq!(scene.meshes.len(), 400);
        let sizes: Vec<usize> = scene.meshes.iter().map(|m| m.num_triangles()).collect();
        let (least, most) = (sizes.iter().min().unwrap(), sizes.iter().max().unwrap());
        assert!((60..=130).contains(least) && (9_000..=21_000).contains(most), "{least}, {most}");
        assert_eq!(scene.num_triangles(), sizes.iter().sum::<usize>());
        for mesh in &scene.meshes {
            assert_eq!(mesh.validate().skipped() + mesh.validate().zero_area, 0);
        }
    }
}
