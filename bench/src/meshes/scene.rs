//! What the tracers are compared on: meshes, and where they stand.

use glam::{DAffine3, DVec3, Vec3};
use rt_core::bvh::Instance;
use rt_core::math::Aabb;
use rt_core::mesh::TriMesh;
use std::sync::Arc;

/// Triangles that every tracer gets, in the same division into meshes and instances.
#[derive(Clone)]
pub struct MeshScene {
    /// Name in the tables.
    pub name: String,
    /// The meshes, each a geometry of its own. All have the same origin.
    pub meshes: Vec<Arc<TriMesh>>,
    /// Where the meshes stand.
    pub instances: Vec<Instance>,
}

impl MeshScene {
    /// A scene of one mesh.
    pub fn one(name: &str, mesh: Arc<TriMesh>) -> MeshScene {
        MeshScene::many(name, vec![mesh])
    }

    /// A scene of many meshes with the same origin, none of them transformed.
    pub fn many(name: &str, meshes: Vec<Arc<TriMesh>>) -> MeshScene {
        let instances = (0..meshes.len()).map(unmoved).collect();
        MeshScene { name: name.into(), meshes, instances }
    }

    /// The same triangles in one mesh, in the order of the instances. Without normals and colours.
    pub fn merged(&self) -> MeshScene {
        let mut all = TriMesh::default();
        for i in &self.instances {
            let (mesh, first) = (&self.meshes[i.geometry], all.positions.len() as u32);
            let place = |p: &Vec3| i.world_from_object.transform_point3(p.as_dvec3()).as_vec3();
            all.positions.extend(mesh.positions.iter().map(place));
            all.indices.extend(mesh.indices.iter().map(|t| t.map(|corner| corner + first)));
        }
        all.origin = self.meshes.first().map_or(DVec3::ZERO, |m| m.origin);
        MeshScene::one(&self.name, Arc::new(all))
    }

    /// The mesh of a scene that is one mesh.
    pub fn only_mesh(&self) -> Option<&Arc<TriMesh>> {
        let [mesh] = &self.meshes[..] else { return None };
        (self.instances == [unmoved(0)]).then_some(mesh)
    }

    /// Whether each mesh is used once, in order and where it is.
    pub fn is_unmoved(&self) -> bool {
        self.instances.iter().copied().eq((0..self.meshes.len()).map(unmoved))
    }

    /// Triangles that rays can meet: those of a mesh count for each of its instances.
    pub fn num_triangles(&self) -> usize {
        self.instances.iter().map(|i| self.meshes[i.geometry].num_triangles()).sum()
    }

    /// The bounds of all instances, relative to the meshes' origin.
    pub fn bounds(&self) -> Aabb {
        let boxes: Vec<Aabb> = self.meshes.iter().map(|m| m.bounds()).collect();
        let corner = |i: &Instance| {
            let place = i.world_from_object;
            boxes[i.geometry].corners().map(|c| place.transform_point3(c.as_dvec3()).as_vec3())
        };
        self.instances.iter().flat_map(corner).fold(Aabb::EMPTY, |b, p| b.grown(p))
    }

    /// The corners of a triangle that a ray has met, relative to the meshes' origin.
    pub fn corners(&self, instance: u32, prim: u32) -> [DVec3; 3] {
        let Instance { geometry, world_from_object } = self.instances[instance as usize];
        let corners = self.meshes[geometry].triangle(prim as usize);
        corners.map(|p| world_from_object.transform_point3(p.as_dvec3()))
    }
}

fn unmoved(geometry: usize) -> Instance {
    Instance { geometry, world_from_object: DAffine3::IDENTITY }
}

#[cfg(test)]
mod tests {
    use crate::meshes;

    #[test]
    fn a_merged_scene_has_the_corners_of_its_parts() {
        for scene in [meshes::city(5), meshes::forest(7)] {
            let merged = scene.merged();
            let whole = merged.only_mesh().expect("one mesh");
            assert_eq!(whole.num_triangles(), scene.num_triangles());
            let mut triangle = 0;
            for (i, place) in scene.instances.iter().enumerate() {
                for prim in 0..scene.meshes[place.geometry].num_triangles() {
                    let part = scene.corners(i as u32, prim as u32).map(|p| p.as_vec3());
                    assert_eq!(whole.triangle(triangle), part, "{}: {triangle}", scene.name);
                    triangle += 1;
                }
            }
        }
    }
}
