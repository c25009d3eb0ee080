//! The views of a frame. A view is a group of draws that share a projection and a viewport, so they
//! form one image that rays can be traced for.
//!
//! Programs with several viewports, or with a small set of axes under its own projection, have
//! several views per frame. Light does not pass from one view to another.

use crate::capture::draw::{Draw, Shading};
use crate::trace::{Rect, matrix};
use rt_core::camera::Camera;
use rt_core::glam::DMat4;

/// How eye space is projected to the screen.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    /// The matrix from eye space to clip space.
    pub(crate) projection: DMat4,
    pub(crate) camera: Camera,
    pub(crate) viewport: Rect,
    /// True when all rays have the same direction.
    pub(crate) parallel: bool,
    /// True when a surface with counter-clockwise corners, as the viewer sees them, is clockwise on
    /// the screen.
    pub(crate) mirrored: bool,
}

/// The matrix of a draw from eye space to clip space.
fn projection(draw: &Draw) -> DMat4 {
    match &draw.shading {
        Shading::Fixed => matrix(&draw.state.projection),
        Shading::Program(p) => matrix(&p.clip_from_object) * matrix(&p.view_from_object).inverse(),
    }
}

/// True when two matrices differ by no more than the f32 rounding of a product.
fn same(a: &DMat4, b: &DMat4) -> bool {
    let (a, b) = (a.to_cols_array(), b.to_cols_array());
    let size = a.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    a.iter().zip(&b).all(|(x, y)| (x - y).abs() <= 1e-4 * size)
}

impl View {
    /// Returns `None` when no rays can be derived from the draw's projection.
    pub(crate) fn of(draw: &Draw) -> Option<View> {
        let [x, y, w, h] = draw.state.viewport;
        View::new(projection(draw), Rect { x, y, w, h })
    }

    /// Returns `None` when no rays can be derived from `projection`, the matrix from eye space to
    /// clip space.
    pub(crate) fn new(projection: DMat4, viewport: Rect) -> Option<View> {
        let camera = Camera::from_matrix(projection).ok()?;
        // A small counter-clockwise triangle in front of the viewer.
        let (origin, dir) = camera.world_ray([0.0, 0.0]);
        let (u, v) = (-dir.normalize()).any_orthonormal_pair();
        let at = origin + dir;
        let step = 1e-3 * dir.length().max(1e-12);
        let c = [at, at + u * step, at + v * step].map(|p| projection * p.extend(1.0));
        let h3 = c.map(|v| rt_core::glam::DVec3::new(v.x, v.y, v.w));
        Some(View {
            projection,
            parallel: projection.row(3).truncate() == rt_core::glam::DVec3::ZERO,
            camera,
            viewport,
            mirrored: h3[0].dot(h3[1].cross(h3[2])) < 0.0,
        })
    }

    /// True when the draw belongs to this view.
    pub(crate) fn holds(&self, draw: &Draw) -> bool {
        let [x, y, w, h] = draw.state.viewport;
        self.viewport == Rect { x, y, w, h } && same(&self.projection, &projection(draw))
    }

    /// Normalised device coordinates of a point of the window.
    pub(crate) fn ndc(&self, x: f64, y: f64) -> [f64; 2] {
        let v = self.viewport;
        [
            2.0 * (x - f64::from(v.x)) / f64::from(v.w) - 1.0,
            2.0 * (y - f64::from(v.y)) / f64::from(v.h) - 1.0,
        ]
    }
}

/// The indices of the draws of each view. Views come in the order of their first draws. Draws whose
/// projection allows no rays are left out.
pub(crate) fn views<'a>(draws: impl Iterator<Item = &'a Draw>) -> Vec<(View, Vec<usize>)> {
    let mut out: Vec<(View, Vec<usize>)> = Vec::new();
    for (i, d) in draws.enumerate() {
        match out.iter_mut().find(|(v, _)| v.holds(d)) {
            Some((_, members)) => members.push(i),
            None => out.extend(View::of(d).map(|v| (v, vec![i]))),
        }
    }
    out
}

/// The eye space of a camera. Its axes point right, up and backward. Its origin is the eye, or a
/// point in the middle for parallel projections.
fn eye_space(camera: &Camera) -> DMat4 {
    let axes = camera.world_from_view().transpose();
    let eye = camera.eye().unwrap_or_else(|| camera.world_ray([0.0, 0.0]).0);
    DMat4::from_mat3(axes) * DMat4::from_translation(-eye)
}

/// The matrix from object space to eye space for a draw of which only the matrix from object space
/// to clip space (`clip`) is known. `reference` holds both matrices of another draw. When the two
/// clip matrices differ by an affine map, both draws share one space. Returns `None` for matrices
/// that allow no rays.
pub(crate) fn eye_from_clip(clip: DMat4, reference: Option<(DMat4, DMat4)>) -> Option<DMat4> {
    let placed = reference.and_then(|(other, eye)| {
        let here = other.inverse() * clip;
        let here = here * here.row(3).w.recip();
        let affine = here.row(3).truncate().length() < 1e-5 && here.is_finite();
        // Rounding residue in the last row is not perspective.
        let exact = DMat4::from_cols(
            here.x_axis.with_w(0.0),
            here.y_axis.with_w(0.0),
            here.z_axis.with_w(0.0),
            here.w_axis.with_w(1.0),
        );
        affine.then(|| eye * exact)
    });
    placed.or_else(|| Camera::from_matrix(clip).ok().map(|c| eye_space(&c)))
}

/// Assigns eye spaces to draws whose shaders have none. These are VTK's shaders, where a light at
/// the eye needs only normals.
pub(crate) fn assign_eye_spaces<T>(draws: &mut [(Draw, T)]) {
    let matrices = |d: &Draw| match &d.shading {
        Shading::Program(p) => Some((matrix(&p.clip_from_object), matrix(&p.view_from_object))),
        Shading::Fixed => None,
    };
    let known = |(_, eye): &(DMat4, DMat4)| eye.determinant() != 0.0 && eye.is_finite();
    let mut reference = draws.iter().filter_map(|(d, _)| matrices(d)).find(known);
    for (d, _) in draws {
        let Some((clip, _)) = matrices(d).filter(|m| !known(m)) else { continue };
        let Some(eye) = eye_from_clip(clip, reference) else { continue };
        reference.get_or_insert((clip, eye));
        if let Shading::Program(p) = &mut d.shading {
            std::sync::Arc::make_mut(p).view_from_object = eye.to_cols_array().map(|v| v as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::glam::DVec3;

    #[test]
    fn a_matrix_alone_tells_where_the_eye_is_and_a_second_draw_is_placed_by_the_first() {
        let (a, b) = (-301.0 / 299.0, -600.0 / 299.0);
        let frustum = DMat4::from_cols_array(&[
            1., 0., 0., 0., 0., 1., 0., 0., 0., 0., a, -1., 0., 0., b, 0.,
        ]);
        let eye =
            DMat4::from_rotation_y(0.3) * DMat4::from_translation(DVec3::new(1.0, -2.0, -9.0));
        let first = frustum * eye;
        let found = eye_from_clip(first, None).expect("a camera");
        assert!((found - eye).to_cols_array().iter().all(|v| v.abs() < 1e-9), "{found} {eye}");
        let object = DMat4::from_scale(DVec3::new(2.0, 3.0, 0.5)) * DMat4::from_rotation_x(1.0);
        let second = eye_from_clip(first * object, Some((first, eye))).expect("placed");
        assert!((second - eye * object).to_cols_array().iter().all(|v| v.abs() < 1e-9));
    }
}
