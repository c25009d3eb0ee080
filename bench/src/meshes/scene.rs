//! What the tracers are compared on: one mesh, or many meshes that stay apart.

use rt_core::mesh::TriMesh;
use std::sync::Arc;

/// Triangles that every tracer gets, in the same division into meshes.
#[derive(Clone)]
pub struct MeshScene {
    /// Name in the tables.
    pub name: String,
    /// All triangles in one mesh. Rays are made from it.
    pub merged: Arc<TriMesh>,
    /// The meshes that are given to a tracer as geometries of their own; empty when the scene is
    /// one mesh.
    pub parts: Vec<Arc<TriMesh>>,
}

impl MeshScene {
    /// A scene of one mesh.
    pub fn one(name: &str, mesh: Arc<TriMesh>) -> MeshScene {
        MeshScene { name: name.into(), merged: mesh, parts: vec![] }
    }

    /// A scene of many meshes with the same origin.
    pub fn many(name: &str, parts: Vec<Arc<TriMesh>>) -> MeshScene {
        let mut merged = TriMesh::default();
        merged.origin = parts.first().map_or(merged.origin, |m| m.origin);
        for part in &parts {
            let first = merged.positions.len() as u32;
            merged.positions.extend_from_slice(&part.positions);
            merged.indices.extend(part.indices.iter().map(|t| t.map(|k| k + first)));
        }
        MeshScene { name: name.into(), merged: Arc::new(merged), parts }
    }

    /// The meshes as a tracer gets them.
    pub fn meshes(&self) -> &[Arc<TriMesh>] {
        if self.parts.is_empty() { std::slice::from_ref(&self.merged) } else { &self.parts }
    }
}
