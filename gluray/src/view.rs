//! The views of a frame: draws that share a projection and a viewport, and so one picture that rays can be sent into.
//!
//! Programs with several viewports, or with a small set of axes under a projection of its own, have several a frame. Light does not pass from
//! one to another.

use crate::capture::{Draw, Shading};
use crate::trace::{Rect, matrix};
use rt_core::camera::Camera;
use rt_core::glam::DMat4;

/// How eye space comes to the screen.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    /// Clip from eye.
    pub(crate) projection: DMat4,
    pub(crate) camera: Camera,
    pub(crate) viewport: Rect,
    /// All rays have one direction.
    pub(crate) parallel: bool,
    /// A surface whose corners turn left as the viewer sees them turns right on the screen.
    pub(crate) mirrored: bool,
}

/// Clip from eye of a draw.
fn projection(draw: &Draw) -> DMat4 {
    match &draw.shading {
        Shading::Fixed => matrix(&draw.state.projection),
        Shading::Program(p) => matrix(&p.clip_from_object) * matrix(&p.view_from_object).inverse(),
    }
}

/// Matrices that differ by what f32 makes of a product.
fn same(a: &DMat4, b: &DMat4) -> bool {
    let (a, b) = (a.to_cols_array(), b.to_cols_array());
    let size = a.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    a.iter().zip(&b).all(|(x, y)| (x - y).abs() <= 1e-4 * size)
}

impl View {
    /// `None` where rays cannot be made for the draw's projection.
    pub(crate) fn of(draw: &Draw) -> Option<View> {
        let projection = projection(draw);
        let camera = Camera::from_matrix(projection).ok()?;
        let [x, y, w, h] = draw.state.viewport;
        // A small triangle that turns left before the viewer.
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
            viewport: Rect { x, y, w, h },
            mirrored: h3[0].dot(h3[1].cross(h3[2])) < 0.0,
        })
    }

    /// Whether the draw is seen this way.
    pub(crate) fn holds(&self, draw: &Draw) -> bool {
        let [x, y, w, h] = draw.state.viewport;
        self.viewport == Rect { x, y, w, h } && same(&self.projection, &projection(draw))
    }

    /// Normalised device coordinates of a point of the window.
    pub(crate) fn ndc(&self, x: f64, y: f64) -> [f64; 2] {
        let v = self.viewport;
        [2.0 * (x - f64::from(v.x)) / f64::from(v.w) - 1.0, 2.0 * (y - f64::from(v.y)) / f64::from(v.h) - 1.0]
    }
}

/// Numbers of the draws of each view, in the order of their first draws. Draws that rays cannot be made for are left out.
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
