//! Meshes, rays and hits in f64.

use glam::DVec3;

/// Indexed triangles with positions in f64.
///
/// ```
/// use rt_core::prelude::*;
///
/// let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
/// let mesh = MeshF64::new(corners, vec![[0, 1, 2], [0, 1, 7]]);
/// assert!(mesh.triangle(0).is_some());
/// assert!(mesh.triangle(1).is_none()); // there is no vertex 7
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MeshF64 {
    /// World positions of the vertices.
    pub positions: Vec<DVec3>,
    /// Three vertex indices per triangle.
    pub indices: Vec<[u32; 3]>,
}

impl MeshF64 {
    /// A mesh of these arrays.
    pub fn new(positions: Vec<DVec3>, indices: Vec<[u32; 3]>) -> Self {
        MeshF64 { positions, indices }
    }

    /// The corners of triangle `i`; `None` when it has an index out of range or a coordinate that
    /// is not finite, or does not exist.
    #[inline]
    pub fn triangle(&self, i: usize) -> Option<[DVec3; 3]> {
        let [a, b, c] = *self.indices.get(i)?;
        let at = |k: u32| self.positions.get(k as usize).copied().filter(|p| p.is_finite());
        Some([at(a)?, at(b)?, at(c)?])
    }
}

/// A ray in world coordinates. Hits are reported for `t_min <= t < t_max`, where `t` is the exact
/// parameter, not the rounded one. Hits whose `t` overflows f64 are ignored. `dir` need not have
/// unit length; `t` is in units of its length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayF64 {
    /// Start point.
    pub origin: DVec3,
    /// Direction; any non-zero length, components may be ±0.
    pub dir: DVec3,
    /// Smallest parameter that counts as a hit (inclusive).
    pub t_min: f64,
    /// Largest parameter (exclusive); infinity for no limit.
    pub t_max: f64,
}

impl RayF64 {
    /// A ray without a limit, starting at `origin`.
    pub fn new(origin: DVec3, dir: DVec3) -> Self {
        RayF64 { origin, dir, t_min: 0.0, t_max: f64::INFINITY }
    }

    /// The same ray limited to `t < t_max`.
    pub fn with_t_max(self, t_max: f64) -> Self {
        RayF64 { t_max, ..self }
    }

    /// The point at parameter `t`, rounded. [`super::WorldF64::point_of_hit`] is closer to the
    /// surface where `t` is large.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.dir * t
    }

    /// Whether the ray can hit anything: false for an empty range, infinity or NaN. Such rays are
    /// answered with "no hit".
    #[inline]
    pub fn is_valid(&self) -> bool {
        self.origin.is_finite()
            && self.dir.is_finite()
            && self.dir != DVec3::ZERO
            && self.t_min < self.t_max
    }
}

/// The closest intersection of a [`RayF64`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HitF64 {
    /// Ray parameter, at most 2 ulp from the exact value.
    pub t: f64,
    /// Weight of the triangle's second vertex.
    pub u: f64,
    /// Weight of the triangle's third vertex.
    pub v: f64,
    /// Triangle within its mesh: the index into [`MeshF64::indices`].
    pub prim: u32,
    /// Index of the mesh in the world.
    pub mesh: u32,
}
