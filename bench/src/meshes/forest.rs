//! A forest: few meshes, each in many places, turned and scaled.

use super::scene::MeshScene;
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use rt_core::bvh::Instance;
use rt_core::math::SplitMix64;
use rt_core::mesh::TriMesh;
use std::f32::consts::TAU;
use std::f64::consts;
use std::sync::Arc;

/// Meshes that stand in the forest.
const KINDS: usize = 40;

/// `trees` instances of forty meshes of about 100 to 10,000 triangles. They are turned about the
/// vertical, lean a little, and are 0.5 to 1.5 times as large as their mesh; their crowns touch.
pub fn forest(trees: u32) -> MeshScene {
    let mut random = SplitMix64::new(23);
    let kinds = (0..KINDS).map(|kind| {
        let triangles = 100.0 * 100f64.powf(kind as f64 / (KINDS - 1) as f64);
        Arc::new(tree(triangles as usize, &mut random))
    });
    let meshes: Vec<Arc<TriMesh>> = kinds.collect();
    let side = f64::from(trees).sqrt();
    let instances = (0..trees).map(|_| {
        let at = DVec3::new(random.between(-0.5, 0.5), 0.0, random.between(-0.5, 0.5)) * side;
        let lean = DVec3::new(random.between(-0.1, 0.1), 1.0, random.between(-0.1, 0.1));
        let turn = DQuat::from_rotation_arc(DVec3::Y, lean.normalize())
            * DQuat::from_rotation_y(random.unit() * consts::TAU);
        // Slender and stout ones: the scale differs between the axes.
        let size = random.between(0.5, 1.5);
        let scale = DVec3::new(size, size * random.between(0.8, 1.3), size);
        let linear = DMat3::from_quat(turn) * DMat3::from_diagonal(scale);
        let geometry = (random.unit() * KINDS as f64) as usize;
        Instance { geometry, world_from_object: DAffine3::from_mat3_translation(linear, at) }
    });
    let instances = instances.collect();
    MeshScene { name: "forest".into(), meshes, instances }
}

/// A trunk and leaves of two triangles each, y upwards, about 1.5 high.
fn tree(triangles: usize, random: &mut SplitMix64) -> TriMesh {
    const SIDES: u32 = 8;
    let mut mesh = TriMesh::default();
    for floor in 0..4u32 {
        let up = floor as f32 / 3.0;
        for s in 0..SIDES {
            let (sin, cos) = (TAU * s as f32 / SIDES as f32).sin_cos();
            let r = 0.06 * (1.2 - up);
            mesh.positions.push(Vec3::new(r * cos, 1.2 * up, r * sin));
        }
    }
    let at = |floor: u32, s: u32| floor * SIDES + s % SIDES;
    for floor in 0..3 {
        for s in 0..SIDES {
            mesh.indices.push([at(floor, s), at(floor + 1, s), at(floor + 1, s + 1)]);
            mesh.indices.push([at(floor, s), at(floor + 1, s + 1), at(floor, s + 1)]);
        }
    }
    // As much leaf area in every tree, in few large leaves or many small ones.
    let leaves = triangles.saturating_sub(mesh.indices.len()) / 2;
    let size = (1.2 / leaves.max(1) as f64).sqrt();
    let width = random.between(0.3, 0.7);
    for _ in 0..leaves {
        let place = random.direction() * random.unit().cbrt() * DVec3::new(width, 0.5, width);
        let place = place + DVec3::Y;
        let along = random.direction();
        let across = along.any_orthonormal_vector() * 0.5;
        let first = mesh.positions.len() as u32;
        for corner in [-along, across, along, -across] {
            mesh.positions.push((place + corner * size).as_vec3());
        }
        mesh.indices.extend([[0, 1, 2], [0, 2, 3]].map(|t| t.map(|k| first + k)));
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_forest_has_forty_clean_meshes_in_many_places() {
        let scene = forest(2000);
        assert_eq!((scene.meshes.len(), scene.instances.len()), (KINDS, 2000));
        let sizes: Vec<usize> = scene.meshes.iter().map(|m| m.num_triangles()).collect();
        assert!(sizes.is_sorted() && sizes[0] >= 90 && sizes[KINDS - 1] >= 9900, "{sizes:?}");
        for mesh in &scene.meshes {
            assert_eq!(mesh.validate().skipped() + mesh.validate().zero_area, 0);
        }
        let mut used = [0; KINDS];
        for i in &scene.instances {
            used[i.geometry] += 1;
            assert!(i.world_from_object.matrix3.determinant() > 0.05);
        }
        assert!(used.iter().all(|&n| n > 20), "{used:?}");
        assert_eq!(forest(50).instances, forest(50).instances);
        let bounds = scene.bounds();
        let corner = scene.corners(1999, 0)[0].as_vec3();
        assert!(corner.cmpge(bounds.min).all() && corner.cmple(bounds.max).all());
        assert!(!scene.is_unmoved() && scene.only_mesh().is_none());
    }
}
