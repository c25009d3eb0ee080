//! Triangles of tubes around polylines, for programs that draw triangles alone: what vtkTubeFilter
//! makes. rt-core traces the tubes themselves ([`Polylines::into_tubes`]), which are round.

use super::polylines::Polylines;
use glam::Vec3;
use rayon::prelude::*;
use rt_core::mesh::{Attribute, MeshError, PerElement, TriMesh};
use std::f32::consts::TAU;

/// Most vertices of a mesh: their indices are 32 bits wide.
const MOST_VERTICES: usize = u32::MAX as usize;

impl Polylines {
    /// Tubes of so many flat sides (at least 3), open at their ends, with normals as of round ones
    /// and the scalars of the lines. A segment is `2 * sides` triangles. Lines of one point, or of
    /// points that are all the same, are left out.
    ///
    /// The sections do not turn around the line from point to point: Wang, Jüttler, Zheng and
    /// Liu, "Computation of rotation minimizing frames", ACM Transactions on Graphics 27 (2008),
    /// table I.
    ///
    /// # Errors
    /// [`MeshError::TooLarge`] for more vertices than a mesh can have.
    pub fn to_tube_mesh(&self, sides: u32) -> Result<TriMesh, MeshError> {
        let sides = sides.max(3) as usize;
        let found = self.points.len().saturating_mul(sides);
        if found > MOST_VERTICES {
            return Err(MeshError::TooLarge { what: "vertices", found, limit: MOST_VERTICES });
        }
        let around: Vec<(f32, f32)> =
            (0..sides).map(|k| (TAU * k as f32 / sides as f32).sin_cos()).collect();
        let lines: Vec<Option<Sections>> = self
            .offsets
            .par_windows(2)
            .map(|w| Sections::of(self.points.get(w[0] as usize..w[1] as usize)?))
            .collect();
        let mut mesh = TriMesh::default();
        let (mut normals, mut scalars) = (vec![], vec![]);
        for (w, sections) in self.offsets.windows(2).zip(lines) {
            let Some(sections) = sections else { continue };
            let first = mesh.positions.len() as u32;
            for (i, (across, other)) in sections.axes.iter().enumerate() {
                let point = w[0] as usize + i;
                for &(sin, cos) in &around {
                    let normal = *across * cos + *other * sin;
                    mesh.positions.push(self.points[point] + normal * self.radii[point]);
                    normals.push(normal);
                    scalars.push(self.scalars[point]);
                }
            }
            let sides = sides as u32;
            for ring in 0..sections.axes.len() as u32 - 1 {
                let (near, far) = (first + ring * sides, first + (ring + 1) * sides);
                for k in 0..sides {
                    let next = (k + 1) % sides;
                    mesh.indices.push([near + k, near + next, far + next]);
                    mesh.indices.push([near + k, far + next, far + k]);
                }
            }
        }
        mesh.normals = Some(Attribute { per: PerElement::Vertex, values: normals });
        mesh.scalars = Some(Attribute { per: PerElement::Vertex, values: scalars });
        Ok(mesh)
    }
}

/// Two axes across the line at each of its points, at right angles to it and to each other.
struct Sections {
    axes: Vec<(Vec3, Vec3)>,
}

impl Sections {
    fn of(points: &[Vec3]) -> Option<Sections> {
        let tangents = tangents(points)?;
        let mut across = tangents[0].any_orthonormal_vector();
        let mut axes = vec![(across, tangents[0].cross(across))];
        for i in 1..points.len() {
            // Reflected in the plane between the points, then in that which makes the tangents
            // one: two reflections are a rotation.
            let step = points[i] - points[i - 1];
            let (mut axis, mut tangent) = (across, tangents[i - 1]);
            if let Some(step) = step.try_normalize() {
                axis = axis.reflect(step);
                tangent = tangent.reflect(step);
            }
            if let Some(change) = (tangents[i] - tangent).try_normalize() {
                axis = axis.reflect(change);
            }
            // Rounding adds up along a line of thousands of points.
            let straight = axis.reject_from_normalized(tangents[i]).try_normalize();
            across = straight.unwrap_or_else(|| tangents[i].any_orthonormal_vector());
            axes.push((across, tangents[i].cross(across)));
        }
        Some(Sections { axes })
    }
}

/// Unit tangents: the mean direction of the segments at a point. Where these are opposite or have
/// no length, that of the point before.
fn tangents(points: &[Vec3]) -> Option<Vec<Vec3>> {
    let directions: Vec<Option<Vec3>> =
        points.windows(2).map(|w| (w[1] - w[0]).try_normalize()).collect();
    let mut last = directions.iter().flatten().copied().next()?;
    let tangents = (0..points.len()).map(|i| {
        let before = i.checked_sub(1).and_then(|b| directions[b]);
        let after = directions.get(i).copied().flatten();
        let mean = before.unwrap_or(Vec3::ZERO) + after.unwrap_or(Vec3::ZERO);
        last = mean.try_normalize().unwrap_or(last);
        last
    });
    Some(tangents.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::polylines::Line;

    fn line(points: Vec<Vec3>, radius: f32) -> Line {
        let n = points.len();
        Line { radii: vec![radius; n], scalars: (0..n).map(|i| i as f32).collect(), points }
    }

    fn helix(turns: f32) -> Vec<Vec3> {
        let at = |i: u16| {
            let angle = turns * TAU * f32::from(i) / 400.0;
            Vec3::new(angle.cos(), angle.sin(), 0.1 * angle)
        };
        (0..=400).map(at).collect()
    }

    #[test]
    fn vertices_are_a_radius_from_the_line_and_normals_point_away() {
        let points = helix(3.0);
        let tubes = Polylines::from_lines(vec![line(points.clone(), 0.05)]);
        let mesh = tubes.to_tube_mesh(12).unwrap();
        assert_eq!((mesh.num_triangles(), mesh.positions.len()), (400 * 24, 401 * 12));
        let normals = &mesh.normals.as_ref().unwrap().values;
        for (i, (p, n)) in mesh.positions.iter().zip(normals).enumerate() {
            let out = *p - points[i / 12];
            assert!((out.length() - 0.05).abs() < 1e-6, "{i}: {out}");
            assert!((out.normalize() - *n).length() < 1e-4 && n.is_normalized(), "{i}: {n}");
        }
        let scalars = &mesh.scalars.as_ref().unwrap().values;
        assert_eq!((scalars[0], scalars[12], *scalars.last().unwrap()), (0.0, 1.0, 400.0));
    }

    #[test]
    fn triangles_face_outwards_and_sections_do_not_turn() {
        let tubes = Polylines::from_lines(vec![line(helix(3.0), 0.05)]);
        let mesh = tubes.to_tube_mesh(12).unwrap();
        let normals = &mesh.normals.as_ref().unwrap().values;
        for (t, corners) in mesh.indices.iter().enumerate() {
            let [a, b, c] = mesh.triangle(t);
            let face = (b - a).cross(c - a);
            let mean: Vec3 = corners.iter().map(|&k| normals[k as usize]).sum();
            assert!(face.dot(mean) > 0.0, "triangle {t}");
        }
        // A side of the tube is nearly along the line: twisted sections would tilt it.
        for ring in 0..400 {
            let along = mesh.positions[(ring + 1) * 12] - mesh.positions[ring * 12];
            let turned = normals[(ring + 1) * 12] - normals[ring * 12];
            let sideways = turned.dot(along.cross(normals[ring * 12]).normalize());
            assert!(sideways.abs() < 2e-3, "ring {ring}: {sideways}");
        }
    }

    #[test]
    fn points_that_repeat_and_lines_that_turn_back_have_finite_tubes() {
        let [o, x] = [Vec3::ZERO, Vec3::X];
        let lines = vec![
            line(vec![o, o, x, x, 2.0 * x], 0.1),
            line(vec![o, x, o], 0.1),
            line(vec![x], 0.1),
            line(vec![x, x, x], 0.1),
            line(vec![], 0.1),
        ];
        let mesh = Polylines::from_lines(lines).to_tube_mesh(5).unwrap();
        assert_eq!(mesh.num_triangles(), (4 + 2) * 10);
        let normals = &mesh.normals.as_ref().unwrap().values;
        assert!(mesh.positions.iter().all(|p| p.is_finite()));
        assert!(normals.iter().all(|n| n.is_normalized()));
        assert_eq!(Polylines::default().to_tube_mesh(5).unwrap().num_triangles(), 0);
    }
}
