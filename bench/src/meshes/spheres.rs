//! Spheres, each a mesh of its own: the simplest scene of very many small meshes, such as molecules
//! and the glyphs of a program that makes a mesh of each.

use super::globe;
use super::scene::MeshScene;
use glam::Vec3;
use rt_core::math::SplitMix64;
use rt_core::mesh::TriMesh;
use std::sync::Arc;

/// `count` spheres of 144 triangles at random places in a cube. About a tenth of the cube is
/// filled, whatever their number, and some overlap.
pub fn spheres(count: u32) -> MeshScene {
    let mut random = SplitMix64::new(13);
    let unit = globe(12, 7);
    // 4/3 pi r^3 n = 0.1 of a cube of side 2.
    let radius = (0.8 * 0.75 / std::f64::consts::PI / f64::from(count.max(1))).cbrt();
    let parts = (0..count).map(|_| {
        let place = [(); 3].map(|()| random.between(-1.0, 1.0) as f32);
        let size = (radius * random.between(0.7, 1.3)) as f32;
        let at = |p: &Vec3| Vec3::from(place) + *p * size;
        let positions = unit.positions.iter().map(at).collect();
        Arc::new(TriMesh::new(positions, unit.indices.clone()))
    });
    MeshScene::many("spheres", parts.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spheres_are_clean_and_fill_the_same_part_of_the_cube_at_every_number() {
        for count in [10, 1000] {
            let scene = spheres(count);
            assert_eq!(scene.meshes.len(), count as usize);
            assert_eq!(scene.num_triangles(), 144 * count as usize);
            let volume = |mesh: &Arc<TriMesh>| {
                let size = mesh.bounds().max - mesh.bounds().min;
                f64::from(size.x * size.y * size.z) * std::f64::consts::PI / 6.0
            };
            let filled: f64 = scene.meshes.iter().map(volume).sum::<f64>() / 8.0;
            assert!((0.05..0.2).contains(&filled), "{count}: {filled}");
            for mesh in &scene.meshes {
                assert_eq!(mesh.validate().skipped() + mesh.validate().zero_area, 0);
            }
        }
    }
}
