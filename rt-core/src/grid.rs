//! Uniform scalar fields: value and gradient by trilinear interpolation.

use glam::{DVec3, UVec3, Vec3};

/// A scalar on the points of a uniform grid, x fastest. World position of point (i,j,k) is
/// `origin + spacing * (i,j,k)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Each at least 1.
    pub(crate) dims: UVec3,
    pub(crate) origin: DVec3,
    /// Positive.
    pub(crate) spacing: DVec3,
    /// As many as there are points.
    pub(crate) values: Vec<f32>,
}

/// Reasons why a grid cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GridError {
    /// The number of values does not match the dimensions.
    #[error("grid of {dims} points needs {expected} values, found {found}")]
    Length {
        /// Points per axis.
        dims: UVec3,
        /// Product of `dims`.
        expected: u64,
        /// Number of values.
        found: usize,
    },
    /// The spacing is zero, negative or not finite, or the origin is not finite.
    #[error("grid {field} is {value}; it must be {rule}")]
    Geometry {
        /// "spacing" or "origin".
        field: &'static str,
        /// The invalid value.
        value: DVec3,
        /// What is allowed.
        rule: &'static str,
    },
}

impl Grid {
    /// A grid with checked values.
    pub fn new(
        dims: UVec3,
        origin: DVec3,
        spacing: DVec3,
        values: Vec<f32>,
    ) -> Result<Self, GridError> {
        let expected = dims.x as u64 * dims.y as u64 * dims.z as u64;
        if expected != values.len() as u64 || expected == 0 {
            return Err(GridError::Length { dims, expected, found: values.len() });
        }
        if !(spacing.is_finite() && spacing.cmpgt(DVec3::ZERO).all()) {
            return Err(GridError::Geometry {
                field: "spacing",
                value: spacing,
                rule: "finite and positive in every axis",
            });
        }
        if !origin.is_finite() {
            return Err(GridError::Geometry { field: "origin", value: origin, rule: "finite" });
        }
        Ok(Grid { dims, origin, spacing, values })
    }

    /// Points per axis, each at least 1.
    #[inline]
    pub fn dims(&self) -> UVec3 {
        self.dims
    }

    /// World position of point (0,0,0).
    #[inline]
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// World distance between neighbouring points, positive.
    #[inline]
    pub fn spacing(&self) -> DVec3 {
        self.spacing
    }

    /// The value of every point, x fastest.
    #[inline]
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The values, to change.
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// The values, without a copy.
    pub fn into_values(self) -> Vec<f32> {
        self.values
    }

    /// Value at point (i,j,k). Panics outside the grid.
    #[inline]
    pub fn at(&self, i: u32, j: u32, k: u32) -> f32 {
        self.values[self.index(i, j, k)]
    }

    /// Index of point (i,j,k) in `values`.
    #[inline]
    pub fn index(&self, i: u32, j: u32, k: u32) -> usize {
        (k as usize * self.dims.y as usize + j as usize) * self.dims.x as usize + i as usize
    }

    /// World position of the last point.
    pub fn max_corner(&self) -> DVec3 {
        self.origin + self.spacing * (self.dims - UVec3::ONE).as_dvec3()
    }

    /// Smallest and largest finite value; `None` when there is none.
    pub fn range(&self) -> Option<(f32, f32)> {
        let (lo, hi) = self
            .values
            .iter()
            .filter(|v| v.is_finite())
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
        (lo <= hi).then_some((lo, hi))
    }

    /// Trilinear value at the continuous index `p` (0..=dims-1 per axis; clamped to the grid).
    #[inline]
    pub fn value(&self, p: Vec3) -> f32 {
        let (c, f) = self.cell_of(p);
        let v = self.corners(c);
        let x = |a: f32, b: f32| a + (b - a) * f.x;
        let y = |a: f32, b: f32| a + (b - a) * f.y;
        let z0 = y(x(v[0], v[1]), x(v[2], v[3]));
        let z1 = y(x(v[4], v[5]), x(v[6], v[7]));
        z0 + (z1 - z0) * f.z
    }

    /// Gradient of the trilinear interpolant at the continuous index `p`, in value per world unit.
    #[inline]
    pub fn gradient(&self, p: Vec3) -> Vec3 {
        let (c, f) = self.cell_of(p);
        gradient_in_cell(&self.corners(c), f, self.spacing)
    }

    /// The eight corner values of the cell whose lowest point is `c`, x fastest. An axis with one
    /// point repeats it.
    #[inline]
    pub fn corners(&self, c: UVec3) -> [f32; 8] {
        let step = UVec3::ONE.min(self.dims - UVec3::ONE);
        let i = self.index(c.x, c.y, c.z);
        let (dx, dy) = (step.x as usize, step.y as usize * self.dims.x as usize);
        let dz = step.z as usize * self.dims.x as usize * self.dims.y as usize;
        [
            self.values[i],
            self.values[i + dx],
            self.values[i + dy],
            self.values[i + dy + dx],
            self.values[i + dz],
            self.values[i + dz + dx],
            self.values[i + dz + dy],
            self.values[i + dz + dy + dx],
        ]
    }

    /// Two neighbours along x, the first with this index in [`Grid::values`]; zeros past the end.
    #[cfg(feature = "render")]
    #[inline]
    pub(crate) fn pair(&self, index: usize) -> [f32; 2] {
        match self.values.get(index..).and_then(|v| v.first_chunk()) {
            Some(pair) => *pair,
            None => [0.0; 2],
        }
    }

    /// The cell of the continuous index `p`, clamped to the grid, and the position inside it
    /// (0..=1). NaN becomes 0.
    #[inline]
    pub fn cell_of(&self, p: Vec3) -> (UVec3, Vec3) {
        cell_of(self.dims, p)
    }
}

/// See [`Grid::cell_of`].
#[inline]
pub(crate) fn cell_of(dims: UVec3, p: Vec3) -> (UVec3, Vec3) {
    let last = (dims - UVec3::ONE).as_vec3();
    let q = p.max(Vec3::ZERO).min(last);
    let cell = q.floor().min((last - Vec3::ONE).max(Vec3::ZERO));
    (cell.as_uvec3(), q - cell)
}

/// Gradient of the trilinear interpolant at the position `f` (0..=1) inside the cell with these
/// values at its corners, x fastest; in value per world unit.
#[inline]
pub(crate) fn gradient_in_cell(v: &[f32; 8], f: Vec3, spacing: DVec3) -> Vec3 {
    let l = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let gx = l(l(v[1] - v[0], v[3] - v[2], f.y), l(v[5] - v[4], v[7] - v[6], f.y), f.z);
    let gy = l(l(v[2] - v[0], v[3] - v[1], f.x), l(v[6] - v[4], v[7] - v[5], f.x), f.z);
    let gz = l(l(v[4] - v[0], v[5] - v[1], f.x), l(v[6] - v[2], v[7] - v[3], f.x), f.y);
    Vec3::new(gx, gy, gz) / spacing.as_vec3()
}
