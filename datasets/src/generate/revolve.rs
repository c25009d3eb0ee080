//! Closed surfaces of revolution about the x axis.

use glam::{DVec2, DVec3};
use rt_core::mesh::TriMesh;
use std::f64::consts::TAU;

/// Revolves a profile of (x, r) about the x axis with `segments` (at least 3) per turn. The profile
/// must begin and end on the axis (r = 0), run from upstream to downstream and have r above 0 in
/// between. Then the surface is closed and counter-clockwise from outside.
pub(crate) fn revolve(profile: &[DVec2], segments: u32) -> TriMesh {
    let segments = segments.max(3);
    let inner = &profile[1..profile.len() - 1];
    let mut points = vec![DVec3::new(profile[0].x, 0.0, 0.0)];
    for p in inner {
        points.extend((0..segments).map(|s| {
            let (sin, cos) = (TAU * s as f64 / segments as f64).sin_cos();
            DVec3::new(p.x, p.y * cos, p.y * sin)
        }));
    }
    let last = points.len() as u32;
    points.push(DVec3::new(profile[profile.len() - 1].x, 0.0, 0.0));
    let at = |ring: u32, s: u32| 1 + ring * segments + s % segments;
    let rings = inner.len() as u32;
    let mut triangles = Vec::new();
    for s in 0..segments {
        triangles.push([0, at(0, s + 1), at(0, s)]);
        for ring in 0..rings - 1 {
            let [a, b, c, d] = [at(ring, s), at(ring, s + 1), at(ring + 1, s + 1), at(ring + 1, s)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
        triangles.push([at(rings - 1, s), at(rings - 1, s + 1), last]);
    }
    TriMesh::from_f64_positions(&points, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{open_or_flipped_edges, volume};

    #[test]
    fn cone_is_closed_and_points_outwards() {
        let cone = revolve(&[DVec2::ZERO, DVec2::new(3.0, 1.0), DVec2::new(3.0, 0.0)], 256);
        assert_eq!(open_or_flipped_edges(&cone.indices), 0);
        assert!((volume(&cone) / std::f64::consts::PI - 1.0).abs() < 2e-4, "{}", volume(&cone));
    }
}
