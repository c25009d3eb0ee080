//! Sixteen points that wait for light, one row per component.

use super::frame_context::FrameContext;
use super::point::Point;
use super::surfaces::BlockSurfaces;
use crate::material::Material;
use crate::ray::{HitBlock, LANES, RayBlock};
use crate::simd::vectors::{Row, Rows3};
use glam::Vec3;

/// What light at a point depends on.
#[derive(Clone)]
#[repr(C, align(64))]
pub(super) struct PointBlock {
    pub(super) point: Rows3,
    pub(super) face_normal: Rows3,
    pub(super) normal: Rows3,
    pub(super) color: Rows3,
    /// [`Point::towards_viewer`].
    pub(super) view: Rows3,
    pub(super) point_error: Row,
    /// Numbers of the instances that the points are on.
    pub(super) instance: [u32; LANES],
    /// The points on which light changes something. Other lanes are undefined.
    pub(super) lit: u16,
}

impl PointBlock {
    /// No points.
    pub(super) const NONE: PointBlock = PointBlock {
        point: Rows3::ZERO,
        face_normal: Rows3::ZERO,
        normal: Rows3::ZERO,
        color: Rows3::ZERO,
        view: Rows3::ZERO,
        point_error: [0.0; LANES],
        instance: [0; LANES],
        lit: 0,
    };

    /// The surfaces that the camera rays of a block have met in the lanes `lit`.
    #[inline(always)]
    pub(super) fn of_surfaces(
        surfaces: &BlockSurfaces,
        rays: &RayBlock,
        hits: &HitBlock,
        lit: u16,
        viewer: Option<Vec3>,
    ) -> PointBlock {
        let (shading, exact) = surfaces.rows();
        let mut view = Rows3([rays.dx, rays.dy, rays.dz]);
        if let Some(viewer) = viewer {
            for lane in 0..LANES {
                view.set(lane, (viewer - exact.point.get(lane)).normalize_or_zero());
            }
        } else {
            for row in &mut view.0 {
                for lane in 0..LANES {
                    row[lane] *= surfaces.to_view[lane];
                }
            }
        }
        PointBlock {
            point: exact.point,
            face_normal: exact.face_normal,
            normal: shading.normal,
            color: shading.color,
            view,
            point_error: exact.point_error,
            instance: hits.instance,
            lit,
        }
    }

    /// One to sixteen points. The lanes after them repeat the first one.
    #[inline(always)]
    pub(super) fn gather(points: &[Point], viewer: Option<Vec3>) -> PointBlock {
        let mut b = PointBlock::NONE;
        for lane in 0..LANES {
            let p = points.get(lane).unwrap_or(&points[0]);
            b.point.set(lane, p.surface.point);
            b.face_normal.set(lane, p.surface.face_normal);
            b.normal.set(lane, p.surface.normal);
            b.color.set(lane, p.surface.color);
            b.view.set(lane, p.towards_viewer(viewer));
            b.point_error[lane] = p.surface.point_error;
            b.instance[lane] = p.instance;
            b.lit |= ((p.lit && lane < points.len()) as u16) << lane;
        }
        b
    }
}

/// Calls `f` with each material of the points in `lanes` and the lanes that have it.
#[inline(always)]
pub(super) fn by_material<'c>(
    context: &FrameContext<'c>,
    instances: &[u32; LANES],
    lanes: u16,
    mut f: impl FnMut(&'c Material, u16),
) {
    let material = |lane: usize| context.instances[instances[lane] as usize].material;
    let mut left = lanes;
    while left != 0 {
        let first = left.trailing_zeros() as usize & 15;
        let this = material(first);
        let mut same =
            (0..LANES).fold(0u16, |m, l| m | ((instances[l] == instances[first]) as u16) << l);
        let mut others = left & !same;
        while others != 0 {
            let lane = others.trailing_zeros() as usize & 15;
            same |= (std::ptr::eq(material(lane), this) as u16) << lane;
            others &= others - 1;
        }
        f(this, left & same);
        left &= !same;
    }
}
