//! The coordinate frame in which a geometry is stored.

use crate::math::{Aabb, exp2i};
use glam::{DVec3, Vec3};

/// Local = (object − center) · scale, where object space is the geometry's own f64 coordinates
/// before the instance's transform.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LocalFrame {
    pub(crate) center: DVec3,
    pub(crate) scale: f64,
}

impl LocalFrame {
    /// Chooses the frame for positions with `bounds` relative to `origin`.
    pub(crate) fn choose(origin: DVec3, bounds: Aabb) -> Self {
        if bounds.is_empty() {
            return LocalFrame { center: origin, scale: 1.0 };
        }
        let (center, size) = (bounds.center(), bounds.extent().max_element());
        // Within four sizes of zero, at most two bits are lost, so the numbers stay as they are.
        let far = center.abs().max_element() > 4.0 * size;
        let shift = if far { center.as_dvec3() } else { DVec3::ZERO };
        let reach = if far { size } else { bounds.min.abs().max(bounds.max.abs()).max_element() };
        LocalFrame::around(origin + shift, reach)
    }

    /// The frame with `center` for positions within `reach` of it along each axis.
    pub(crate) fn around(center: DVec3, reach: f32) -> Self {
        // The triangle test multiplies three lengths. With these limits the product stays between
        // 1e-27 and 1e27.
        let scale = if reach > 0.0 && !(1e-6..=1e9).contains(&reach) {
            exp2i(-(reach.log2().round() as i32)) as f64
        } else {
            1.0
        };
        LocalFrame { center, scale }
    }

    /// Converts a position relative to `origin` to local space.
    #[inline]
    pub(crate) fn local(&self, origin: DVec3, p: Vec3) -> Vec3 {
        ((p.as_dvec3() + (origin - self.center)) * self.scale).as_vec3()
    }
}
