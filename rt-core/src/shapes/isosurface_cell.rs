//! Where a ray first crosses an isosurface in a cell of a lattice, and the surface there: what
//! isosurfaces have in common, wherever their values are.

use super::{ShapeError, ShapeHit, ShapeSurface, rounded_point};
use crate::grid::cell_of;
use crate::grid_walk::{Crossing, IndexRay};
use crate::ray::Ray;
use crate::ray_cubic;
use glam::{DVec3, UVec3, Vec3};

/// What errors call the shape.
pub(crate) const SHAPE: &str = "isosurface";

/// A root: ray parameter, number of its isovalue.
pub(crate) struct Root {
    pub(crate) t: f64,
    pub(crate) isovalue: usize,
}

/// # Errors
/// Without an isovalue, or with one that is not finite.
pub(crate) fn check_isovalues(isovalues: &[f32]) -> Result<(), ShapeError> {
    if isovalues.is_empty() {
        return Err(ShapeError::Length {
            shape: SHAPE,
            field: "isovalues",
            per: "surface",
            expected: 1,
            found: 0,
        });
    }
    match isovalues.iter().find(|v| !v.is_finite()) {
        Some(&value) => {
            let (field, rule) = ("isovalue", "finite");
            Err(ShapeError::Value { shape: SHAPE, field, value, rule })
        }
        None => Ok(()),
    }
}

/// Smallest and largest of eight values; NaN is ignored.
#[inline]
pub(crate) fn min_max(v: &[f32; 8]) -> (f32, f32) {
    v.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &x| (l.min(x), h.max(x)))
}

/// Whether one corner is below `iso` and another is not, and all are finite. Without branches, so
/// that the loop is vectorized.
#[inline(always)]
fn crosses(corners: &[f32; 8], iso: f32) -> bool {
    let (mut below, mut above, mut finite) = (false, false, true);
    for v in corners {
        below |= *v < iso;
        above |= *v >= iso;
        finite &= v.is_finite();
    }
    below & above & finite
}

/// The first crossing of a surface in the cell with these values at its corners, x fastest. A cell
/// with a corner that is not finite is empty.
#[inline(always)]
pub(crate) fn root_in_cell(
    corners: &[f32; 8],
    isovalues: &[f32],
    ray: &IndexRay,
    crossing: &Crossing,
) -> Option<Root> {
    let mut positions = None;
    let mut best: Option<(f64, usize)> = None;
    for (n, &iso) in isovalues.iter().enumerate() {
        if !crosses(corners, iso) {
            continue;
        }
        let (p, q) = positions.get_or_insert_with(
            #[inline(always)]
            || ray.fractions(crossing, 1),
        );
        // Differences first: f32 values minus an f32 are exact in f64 unless 2²⁹ apart, so the sign
        // at grid points is right.
        let (iso, mut above) = (f64::from(iso), [0.0; 8]);
        for (above, v) in above.iter_mut().zip(corners) {
            *above = f64::from(*v) - iso;
        }
        let b = ray_cubic::along(&above, p, q);
        // A ray that starts exactly on the surface touches it there, in any direction.
        let touches = crossing.entry.is_none() && b[0] == 0.0;
        if let Some(u) = if touches { Some(0.0) } else { ray_cubic::first_change(&b) }
            && best.is_none_or(|(least, _)| u < least)
        {
            best = Some((u, n));
        }
    }
    best.map(|(u, isovalue)| Root { t: crossing.t0 + u * (crossing.t1 - crossing.t0), isovalue })
}

/// A point on a surface.
pub(crate) struct SurfacePlace {
    /// Continuous index in the lattice.
    pub(crate) index: DVec3,
    /// Number of the isovalue.
    pub(crate) isovalue: usize,
    point: Vec3,
    point_error: f32,
}

/// The place of a hit. `first` finds the first root on a ray.
pub(crate) fn place_on(
    index_ray: &IndexRay,
    dims: UVec3,
    spacing: DVec3,
    hit: &ShapeHit,
    ray: &Ray,
    first: impl FnOnce(&Ray) -> Option<Root>,
) -> SurfacePlace {
    // The root again in f64, in the few ulps around the reported parameter.
    let near =
        Ray { t_min: hit.t.next_down().max(ray.t_min), t_max: hit.t.next_up().next_up(), ..*ray };
    let root = first(&near);
    let t = root.as_ref().map_or(f64::from(hit.t), |r| r.t);
    let isovalue = root.map_or(hit.u as usize, |r| r.isovalue);
    let last = (dims - UVec3::ONE).as_dvec3();
    let index = DVec3::from_array(index_ray.at(t)).clamp(DVec3::ZERO, last);
    // Rounding of o + t·d in index space: relative to the largest of its terms.
    let terms = (0..3)
        .map(|a| (index_ray.o[a].abs() + (t * index_ray.d[a]).abs()) * spacing[a])
        .fold(0.0, f64::max);
    let (point, point_error) = rounded_point(index * spacing, 8.0 * f64::EPSILON * terms);
    SurfacePlace { index, isovalue, point, point_error }
}

impl SurfacePlace {
    /// The surface with this gradient of the values, in value per world unit.
    pub(crate) fn surface(&self, gradient: Vec3, scalar: f32, ray: &Ray) -> ShapeSurface {
        // In f64: gradients of 1e-30 per metre have squares below f32's range.
        let normal = (-gradient.as_dvec3()).normalize_or(-ray.dir.as_dvec3().normalize_or_zero());
        ShapeSurface {
            point: self.point,
            point_error: self.point_error,
            normal: normal.as_vec3(),
            shading_normal: None,
            scalar: Some(scalar),
            color: None,
        }
    }
}

/// Central differences (one-sided at the border) at the corners of the cell around the continuous
/// index `p`, interpolated; in value per world unit. NaN where a neighbour is. `value` is asked for
/// points of the lattice.
pub(crate) fn smooth_gradient(
    dims: UVec3,
    spacing: DVec3,
    p: Vec3,
    value: impl Fn(UVec3) -> f32,
) -> Vec3 {
    let (cell, f) = cell_of(dims, p);
    let mut sum = Vec3::ZERO;
    for corner in 0..8u32 {
        let bit = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
        let c = (cell + bit).min(dims - UVec3::ONE);
        let weight = Vec3::select(bit.cmpeq(UVec3::ONE), f, Vec3::ONE - f).element_product();
        if weight == 0.0 {
            continue;
        }
        let mut g = [0f32; 3];
        for a in 0..3 {
            let (mut lo, mut hi) = (c, c);
            lo[a] = lo[a].saturating_sub(1);
            hi[a] = (hi[a] + 1).min(dims[a] - 1);
            let width = (hi[a] - lo[a]) as f32 * spacing[a] as f32;
            if width > 0.0 {
                g[a] = (value(hi) - value(lo)) / width;
            }
        }
        sum += weight * Vec3::from_array(g);
    }
    sum
}

/// [`smooth_gradient`] at the position `f` (0..=1) in a cell that no border of the lattice touches,
/// with the values of the 4 x 4 x 4 points around it, x fastest.
pub(crate) fn smooth_gradient_inside(v: &[f32; 64], f: Vec3, spacing: DVec3) -> Vec3 {
    let width = 2.0 * spacing.as_vec3();
    let mut sum = Vec3::ZERO;
    for corner in 0..8 {
        let bit = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
        let weight = Vec3::select(bit.cmpeq(UVec3::ONE), f, Vec3::ONE - f).element_product();
        if weight == 0.0 {
            continue;
        }
        let i = (21 + bit.x + 4 * bit.y + 16 * bit.z) as usize;
        let change = Vec3::new(v[i + 1] - v[i - 1], v[i + 4] - v[i - 4], v[i + 16] - v[i - 16]);
        sum += weight * Vec3::select(width.cmpgt(Vec3::ZERO), change / width, Vec3::ZERO);
    }
    sum
}
