//! Clips a mesh to the part above a plane (Sutherland and Hodgman 1974), with its attributes.

use rt_core::glam::{Vec2, Vec3};
use rt_core::mesh::{Attribute, PerElement, TriMesh};

/// The part of `mesh` where `plane` · (x, y, z, 1) is not negative.
pub(super) fn above(mesh: &TriMesh, plane: [f64; 4]) -> TriMesh {
    let height: Vec<f64> = mesh
        .positions
        .iter()
        .map(|p| {
            plane[0] * f64::from(p.x)
                + plane[1] * f64::from(p.y)
                + plane[2] * f64::from(p.z)
                + plane[3]
        })
        .collect();
    let mut out = ClippedMesh { mesh: mesh.clone() };
    out.mesh.indices.clear();
    let mut from = Vec::new();
    for (number, t) in mesh.indices.iter().enumerate() {
        let mut corners: Vec<u32> = Vec::with_capacity(4);
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            let (ha, hb) = (height[a as usize], height[b as usize]);
            if ha >= 0.0 {
                corners.push(a);
            }
            if (ha >= 0.0) != (hb >= 0.0) {
                // Interpolates from the higher end, so that both triangles of an edge get the same
                // point.
                let (p, q, hp, hq) = if ha >= 0.0 { (a, b, ha, hb) } else { (b, a, hb, ha) };
                corners.push(out.between(p, q, (hp / (hp - hq)) as f32));
            }
        }
        for i in 1..corners.len().saturating_sub(1) {
            out.mesh.indices.push([corners[0], corners[i], corners[i + 1]]);
            from.push(number);
        }
    }
    if let Some(c) = out.mesh.colors.as_mut().filter(|c| c.per == PerElement::Face) {
        c.values = from.iter().map(|f| c.values[*f]).collect();
    }
    out.mesh
}

struct ClippedMesh {
    mesh: TriMesh,
}

fn push<T: Copy>(a: &mut Option<Attribute<T>>, p: u32, q: u32, mix: impl Fn(T, T) -> T) {
    if let Some(a) = a.as_mut().filter(|a| a.per == PerElement::Vertex) {
        let v = mix(a.values[p as usize], a.values[q as usize]);
        a.values.push(v);
    }
}

impl ClippedMesh {
    /// A new vertex between two others.
    fn between(&mut self, p: u32, q: u32, t: f32) -> u32 {
        let m = &mut self.mesh;
        let at = m.positions[p as usize].lerp(m.positions[q as usize], t);
        m.positions.push(at);
        push(&mut m.normals, p, q, |a: Vec3, b| a.lerp(b, t));
        push(&mut m.colors, p, q, |a: [f32; 4], b: [f32; 4]| {
            std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t)
        });
        if let Some(c) = &mut m.texcoords {
            let v: Vec2 = c[p as usize].lerp(c[q as usize], t);
            c.push(v);
        }
        m.positions.len() as u32 - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_loses_a_corner_or_two_and_keeps_its_attributes() {
        let mut mesh = TriMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
        mesh.colors = Some(Attribute::per_vertex(vec![[0.0; 4], [1.0; 4], [0.0; 4]]));
        // x <= 1/4 leaves a quadrilateral.
        let left = above(&mesh, [-1.0, 0.0, 0.0, 0.25]);
        assert_eq!(left.indices.len(), 2);
        let area = |m: &TriMesh| -> f32 {
            let one = |i: usize| {
                let [a, b, c] = m.triangle(i);
                0.5 * (b - a).cross(c - a).length()
            };
            (0..m.indices.len()).map(one).sum()
        };
        let right = above(&mesh, [1.0, 0.0, 0.0, -0.25]);
        assert_eq!(right.indices.len(), 1);
        assert!((area(&left) + area(&right) - 0.5).abs() < 1e-6);
        let colors = left.colors.expect("kept").values;
        for (p, c) in left.positions.iter().zip(colors) {
            assert!((p.x - c[0]).abs() < 1e-6, "{p} {c:?}");
        }
        assert!(above(&mesh, [0.0, 0.0, 0.0, -1.0]).indices.is_empty());
    }
}
