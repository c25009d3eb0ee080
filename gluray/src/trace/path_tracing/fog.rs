//! Applies OpenGL's fog to path-traced images. As with the traced colours of the other modes, the
//! fog depends on the depth of the surface visible at a pixel.
//!
//! Surfaces seen in mirrors or through glass get the fog of the mirror or the glass.

use crate::enums::*;
use crate::state::snapshot::Fog;
use crate::trace::Layer;
use crate::trace::view::View;
use crate::trace::whitted::ColorImage;
use rt_core::glam::{DMat4, DVec4};

/// The share of a surface's colour that remains at eye distance `d`.
pub(crate) fn factor(fog: &Fog, d: f32) -> f32 {
    let left = match fog.mode {
        EXP => (-fog.density * d).exp(),
        EXP2 => (-(fog.density * d) * (fog.density * d)).exp(),
        _ => (fog.end - d) / (fog.end - fog.start),
    };
    if left.is_nan() { 0.0 } else { left.clamp(0.0, 1.0) }
}

/// Computes distances from the eye's plane for points in a view's window.
struct Unprojection {
    eye_from_clip: DMat4,
    depth_range: [f64; 2],
}

impl Unprojection {
    fn distance(&self, ndc: [f64; 2], depth: f32) -> f32 {
        let [n, f] = self.depth_range;
        let z = if n == f { 0.0 } else { (f64::from(depth) - n) / (f - n) * 2.0 - 1.0 };
        let p = self.eye_from_clip * DVec4::new(ndc[0], ndc[1], z, 1.0);
        (p.z / p.w).abs() as f32
    }
}

/// Applies fog to the part of an image that `surfaces`, the draws with fog, cover. `all` holds the
/// nearest surfaces of all draws.
pub(crate) fn over(
    colors: &mut ColorImage,
    view: &View,
    fog: &Fog,
    depth_range: [f64; 2],
    surfaces: &Layer,
    all: &Layer,
) {
    let eye_from_clip = view.projection.inverse();
    if !eye_from_clip.is_finite() {
        return;
    }
    let eye = Unprojection { eye_from_clip, depth_range };
    let rect = colors.rect;
    for (i, c) in colors.rgba.iter_mut().enumerate() {
        let (x, y) = (rect.x + i as i32 % rect.w, rect.y + i as i32 / rect.w);
        let Some(depth) = seen(all, x, y).filter(|d| seen(surfaces, x, y) == Some(*d)) else {
            continue;
        };
        let ndc = view.ndc(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let left = factor(fog, eye.distance(ndc, depth));
        // Colours are premultiplied: where a silhouette covers half a pixel, half of the fog
        // applies.
        for k in 0..3 {
            c[k] = c[k] * left + fog.color[k].clamp(0.0, 1.0) * (1.0 - left) * c[3];
        }
    }
}

/// The depth at a pixel. Where its centre has none, the depth of the nearest adjacent surface.
fn seen(layer: &Layer, x: i32, y: i32) -> Option<f32> {
    let at = |x: i32, y: i32| {
        let (x, y) = (x - layer.rect.x, y - layer.rect.y);
        let inside = (0..layer.rect.w).contains(&x) && (0..layer.rect.h).contains(&y);
        inside.then(|| layer.depth[(y * layer.rect.w + x) as usize]).filter(|d| *d < 1.5)
    };
    let ray_scene = || {
        let beside = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy)));
        beside.filter_map(|(x, y)| at(x, y)).reduce(f32::min)
    };
    at(x, y).or_else(ray_scene)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::{Rect, UNCOVERED};

    #[test]
    fn fog_is_that_of_the_distance_and_of_half_a_pixel_half() {
        // A frustum of 90 degrees from 1 to 100, a pixel in its middle at distance 10.
        let (a, b) = (-101.0 / 99.0, -200.0 / 99.0);
        let projection = DMat4::from_cols_array(&[
            1., 0., 0., 0., 0., 1., 0., 0., 0., 0., a, -1., 0., 0., b, 0.,
        ]);
        let rect = Rect { x: 0, y: 0, w: 3, h: 1 };
        let view = View::new(projection, rect).expect("a camera");
        let depth = (((-10.0 * a + b) / 10.0) * 0.5 + 0.5) as f32;
        let layer = |depth| Layer { rect, color: Vec::new(), depth, covered: 0 };
        let all = layer(vec![depth, UNCOVERED, 0.25]);
        let fogged = layer(vec![depth, UNCOVERED, UNCOVERED]);
        let fog = Fog {
            mode: LINEAR,
            start: 5.0,
            end: 25.0,
            color: [1.0, 0.0, 0.5, 1.0],
            ..Fog::default()
        };
        let mut colors = ColorImage {
            rect,
            rgba: vec![[0.4, 0.4, 0.4, 1.0], [0.2, 0.2, 0.2, 0.5], [0.4, 0.4, 0.4, 1.0]],
            rays: Vec::new(),
            warnings: Vec::new(),
        };
        over(&mut colors, &view, &fog, [0.0, 1.0], &fogged, &all);
        let near = |a: [f32; 4], b: [f32; 4]| a.iter().zip(&b).all(|(x, y)| (x - y).abs() < 1e-3);
        assert!(near(colors.rgba[0], [0.55, 0.3, 0.425, 1.0]), "{:?}", colors.rgba[0]);
        assert_eq!(colors.rgba[2], [0.4, 0.4, 0.4, 1.0], "a nearer draw without fog");
        // The neighbour shows a nearer surface without fog, so it is unknown whose half the pixel
        // is.
        assert_eq!(colors.rgba[1], [0.2, 0.2, 0.2, 0.5]);
    }
}
