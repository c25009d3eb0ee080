//! Clipping planes of a mapper. Triangles are clipped (Sutherland and Hodgman 1974), because the
//! ray tracer has no clipping planes.
//!
//! OpenGL interpolates the distance to the plane over the triangle and drops fragments where it is
//! negative. A cut along the plane gives the same result, up to rounding. New vertices record the
//! edge that they were made on, so colours can be interpolated later without a new mesh.

use rt_core::glam::{DVec3, Vec2, Vec3, Vec4};
use rt_core::mesh::{Attribute, PerElement, TriMesh};
use std::collections::HashMap;

/// Origin of a vertex of a clipped mesh: `(1 - t) a + t b` of two vertices of the mesh before the
/// cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClipVertex {
    /// First vertex.
    pub a: u32,
    /// Second vertex.
    pub b: u32,
    /// Weight of the second vertex.
    pub t: f32,
}

/// Relates a clipped mesh to the unclipped one, plane by plane.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ClipMap {
    /// For each plane, the origins of all vertices in terms of the mesh before that plane.
    pub steps: Vec<Vec<ClipVertex>>,
    /// For each triangle of the clipped mesh, the triangle of the unclipped one.
    pub triangles: Vec<u32>,
}

impl ClipMap {
    /// Interpolates values of the unclipped mesh's vertices to the clipped mesh.
    pub fn vertex_values<T: Copy>(&self, values: &[T], mix: impl Fn(T, T, f32) -> T) -> Vec<T> {
        let mut values = values.to_vec();
        for step in &self.steps {
            values = step
                .iter()
                .map(|o| {
                    let a = values[o.a as usize];
                    if o.t == 0.0 { a } else { mix(a, values[o.b as usize], o.t) }
                })
                .collect();
        }
        values
    }
}

/// Returns the part of `mesh` on the positive side of every plane.
pub(super) fn clip(mesh: &TriMesh, planes: &[[f64; 4]]) -> (TriMesh, ClipMap) {
    let mut clip_map =
        ClipMap { triangles: (0..mesh.indices.len() as u32).collect(), ..ClipMap::default() };
    let mut positions = mesh.positions.clone();
    let mut indices = mesh.indices.clone();
    for plane in planes {
        let (origins, new_indices, parents) = cut(mesh.origin, &positions, &indices, plane);
        positions = origins
            .iter()
            .map(|o| {
                let (a, b) = (positions[o.a as usize], positions[o.b as usize]);
                // In f64, so that the cut does not depend on the length of the edge.
                if o.t == 0.0 {
                    a
                } else {
                    a.as_dvec3().lerp(b.as_dvec3(), f64::from(o.t)).as_vec3()
                }
            })
            .collect();
        indices = new_indices;
        clip_map.triangles = parents.iter().map(|&p| clip_map.triangles[p as usize]).collect();
        clip_map.steps.push(origins);
    }
    let normals = mesh.normals.as_ref().map(|n| match n.per {
        PerElement::Vertex => {
            Attribute::per_vertex(clip_map.vertex_values(&n.values, |a: Vec3, b, t| a.lerp(b, t)))
        }
        PerElement::Face => {
            Attribute::per_face(clip_map.triangles.iter().map(|&i| n.values[i as usize]).collect())
        }
    });
    let texcoords =
        mesh.texcoords.as_ref().map(|v| clip_map.vertex_values(v, |a: Vec2, b, t| a.lerp(b, t)));
    let tangents =
        mesh.tangents.as_ref().map(|v| clip_map.vertex_values(v, |a: Vec4, b, t| a.lerp(b, t)));
    let origin = mesh.origin;
    (
        TriMesh { origin, positions, indices, normals, texcoords, tangents, ..TriMesh::default() },
        clip_map,
    )
}

/// Clips by one plane. Returns the origins of the remaining and new vertices, the triangles, and
/// the source triangle of each.
fn cut(
    origin: DVec3,
    positions: &[Vec3],
    indices: &[[u32; 3]],
    &[a, b, c, d]: &[f64; 4],
) -> (Vec<ClipVertex>, Vec<[u32; 3]>, Vec<u32>) {
    let normal = DVec3::new(a, b, c);
    let offset = normal.dot(origin) + d;
    let distance: Vec<f64> = positions.iter().map(|p| normal.dot(p.as_dvec3()) + offset).collect();
    let mut origins = Vec::new();
    let mut kept: Vec<u32> = vec![u32::MAX; positions.len()];
    let mut on_edges: HashMap<(u32, u32), u32> = HashMap::new();
    let (mut triangles, mut parents) = (Vec::new(), Vec::new());
    for (parent, triangle) in indices.iter().enumerate() {
        if triangle.iter().any(|&v| distance.get(v as usize).is_none_or(|d| !d.is_finite())) {
            continue;
        }
        let mut polygon: Vec<u32> = Vec::with_capacity(4);
        for k in 0..3 {
            let (v, w) = (triangle[k], triangle[(k + 1) % 3]);
            let (dv, dw) = (distance[v as usize], distance[w as usize]);
            if dv >= 0.0 {
                let slot = &mut kept[v as usize];
                if *slot == u32::MAX {
                    *slot = origins.len() as u32;
                    origins.push(ClipVertex { a: v, b: v, t: 0.0 });
                }
                polygon.push(*slot);
            }
            if (dv >= 0.0) != (dw >= 0.0) {
                // Computed once per edge and always from the same end, so that neighbouring
                // triangles stay connected.
                let edge = (v.min(w), v.max(w));
                let vertex = *on_edges.entry(edge).or_insert_with(|| {
                    let (da, db) = (distance[edge.0 as usize], distance[edge.1 as usize]);
                    origins.push(ClipVertex { a: edge.0, b: edge.1, t: (da / (da - db)) as f32 });
                    origins.len() as u32 - 1
                });
                polygon.push(vertex);
            }
        }
        for k in 1..polygon.len().saturating_sub(1) {
            triangles.push([polygon[0], polygon[k], polygon[k + 1]]);
            parents.push(parent as u32);
        }
    }
    (origins, triangles, parents)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(mesh: &TriMesh) -> f32 {
        let of = |i| {
            let [a, b, c] = mesh.triangle(i);
            (b - a).cross(c - a).length() / 2.0
        };
        (0..mesh.indices.len()).map(of).sum()
    }

    #[test]
    fn half_a_square_remains_with_its_attributes() {
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let mut mesh = TriMesh::new(
            corners.iter().map(|c| Vec3::new(c.0, c.1, 0.0)).collect(),
            vec![[0, 1, 2], [0, 2, 3]],
        );
        mesh.texcoords = Some(corners.iter().map(|c| Vec2::new(c.0, c.1)).collect());
        let (out, clip_map) = clip(&mesh, &[[1.0, 0.0, 0.0, -0.25], [0.0, -1.0, 0.0, 0.5]]);
        assert!((area(&out) - 0.75 * 0.5).abs() < 1e-6, "{}", area(&out));
        for (p, t) in out.positions.iter().zip(out.texcoords.as_ref().expect("carried over")) {
            assert!((p.truncate() - *t).length() < 1e-6, "{p} {t}");
        }
        let x: Vec<f32> = corners.iter().map(|c| c.0).collect();
        let carried = clip_map.vertex_values(&x, |a, b, t| a + (b - a) * t);
        assert!(carried.iter().zip(&out.positions).all(|(x, p)| (x - p.x).abs() < 1e-6));
        assert!(clip_map.triangles.iter().all(|t| *t < 2));
    }

    #[test]
    fn neighbours_share_the_vertices_on_the_cut() {
        let mesh = TriMesh::new(
            vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X + Vec3::Y],
            vec![[0, 1, 2], [1, 3, 2]],
        );
        let (out, _) = clip(&mesh, &[[1.0, 0.0, 0.0, -0.5]]);
        assert_eq!(out.positions.len(), 5, "two corners and one new vertex on each of three edges");
    }

    #[test]
    fn nan_vertices_and_missing_numbers_are_left_out() {
        let mesh = TriMesh::new(vec![Vec3::NAN, Vec3::X, Vec3::Y], vec![[0, 1, 2], [1, 2, 9]]);
        let (out, _) = clip(&mesh, &[[1.0, 0.0, 0.0, 5.0]]);
        assert_eq!(out.indices.len(), 0);
    }
}
