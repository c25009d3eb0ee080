//! Sixteen points that wait for light, one row per component.

use super::frame_context::FrameContext;
use super::point::Point;
use crate::material::Material;
use crate::ray::LANES;
use crate::simd::vectors::{Row, Rows3};

/// What light at a point depends on. Lanes without a point repeat the first one.
#[repr(C, align(64))]
pub(super) struct PointBlock {
    pub(super) point: Rows3,
    pub(super) face_normal: Rows3,
    pub(super) normal: Rows3,
    pub(super) color: Rows3,
    pub(super) view: Rows3,
    pub(super) point_error: Row,
    /// The points on which light changes something.
    pub(super) lit: u16,
}

impl PointBlock {
    /// Of one to sixteen points.
    #[inline(always)]
    pub(super) fn gather(points: &[Point]) -> PointBlock {
        let mut b = PointBlock {
            point: Rows3::ZERO,
            face_normal: Rows3::ZERO,
            normal: Rows3::ZERO,
            color: Rows3::ZERO,
            view: Rows3::ZERO,
            point_error: [0.0; LANES],
            lit: 0,
        };
        for lane in 0..LANES {
            let p = points.get(lane).unwrap_or(&points[0]);
            b.point.set(lane, p.surface.point);
            b.face_normal.set(lane, p.surface.face_normal);
            b.normal.set(lane, p.surface.normal);
            b.color.set(lane, p.surface.color);
            b.view.set(lane, p.view);
            b.point_error[lane] = p.surface.point_error;
            b.lit |= ((p.lit && lane < points.len()) as u16) << lane;
        }
        b
    }
}

/// Calls `f` with each material of the points in `lanes` and the lanes that have it.
#[inline(always)]
pub(super) fn by_material<'c>(
    context: &FrameContext<'c>,
    points: &[Point],
    lanes: u16,
    mut f: impl FnMut(&'c Material, u16),
) {
    let material = |p: &Point| context.instances[p.instance as usize].material;
    let mut left = lanes;
    while left != 0 {
        let first = &points[left.trailing_zeros() as usize & 15];
        let this = material(first);
        let mut same = 0;
        for (lane, p) in points.iter().enumerate() {
            let shared = p.instance == first.instance || std::ptr::eq(material(p), this);
            same |= (shared as u16) << lane;
        }
        f(this, left & same);
        left &= !same;
    }
}
