//! What the tracers are compared on: meshes, and where they stand.

use glam::{DAffine3, DVec3};
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
