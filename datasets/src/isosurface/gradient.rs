//! Gradients at grid points by central differences, as in VTK's contour filters.

use super::inside_bits::Block;
use glam::{DVec3, Vec3};

/// Gradient in value per world unit at point `p`: central where both neighbours are usable,
/// one-sided at the border of the grid and next to missing values, 0 along an axis without usable
/// neighbours. The block must hold the planes next to `p` that exist.
pub(crate) fn at_point(block: &Block<'_>, p: [usize; 3], spacing: DVec3) -> Vec3 {
    let stride = [1, block.dims[0]];
    let at = p[1] * stride[1] + p[0];
    let plane = block.plane(p[2]);
    let here = plane[at];
    let along = |axis: usize| -> f32 {
        let neighbour = |forward: bool| -> Option<f32> {
            let exists = if forward { p[axis] + 1 < block.dims[axis] } else { p[axis] > 0 };
            if !exists {
                return None;
            }
            let v = match (axis, forward) {
                (2, true) => block.plane(p[2] + 1)[at],
                (2, false) => block.plane(p[2] - 1)[at],
                (_, true) => plane[at + stride[axis]],
                (_, false) => plane[at - stride[axis]],
            };
            (!block.has_missing || v.is_finite()).then_some(v)
        };
        match (neighbour(false), neighbour(true)) {
            (Some(a), Some(b)) => 0.5 * (b - a),
            (Some(a), None) => here - a,
            (None, Some(b)) => b - here,
            (None, None) => 0.0,
        }
    };
    Vec3::new(along(0), along(1), along(2)) / spacing.as_vec3()
}

/// Unit normal at fraction `t` of the edge from `a` to `b`, away from the larger values. Where the
/// gradient vanishes (or overflows), the normal follows the edge towards the smaller value.
pub(crate) fn normal_on_edge(
    block: &Block<'_>,
    a: [usize; 3],
    b: [usize; 3],
    t: f32,
    spacing: DVec3,
) -> Vec3 {
    let (ga, gb) = (at_point(block, a, spacing), at_point(block, b, spacing));
    let n = -(ga + (gb - ga) * t);
    n.try_normalize().unwrap_or_else(|| {
        let value = |p: [usize; 3]| block.plane(p[2])[p[1] * block.dims[0] + p[0]];
        let along = Vec3::new((b[0] - a[0]) as f32, (b[1] - a[1]) as f32, (b[2] - a[2]) as f32);
        if value(a) > value(b) { along } else { -along }
    })
}
