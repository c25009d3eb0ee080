//! Draws the "numerical schlieren" of most CFD papers for comparison: `exp(-strength |∇eps| /
//! largest)` on one slice (Quirk and Karni, JFM 318, 1996, figure captions). It resembles a
//! schlieren image but has no light, no integral through the flow, no direction and no unit.

use super::volume::{ComparisonError, gradient_grid, index_of};
use crate::field::Field;
use crate::film::Framing;
use crate::view::View;
use rayon::prelude::*;

/// The image of the slice across the view, at `depth_m` along the light from the view's centre, row
/// by row from the top. It is 1 outside the field.
///
/// # Errors
/// If no grid can be made of the field's gradient.
pub fn slice(
    field: &Field,
    view: &View,
    framing: &Framing,
    depth_m: f64,
    strength: f64,
) -> Result<Vec<f32>, ComparisonError> {
    let grid = gradient_grid(field)?;
    let pixel = |start: &crate::path::Start| {
        let [x, y] = start.position_m.map(f64::from);
        let at = view.centre_m + view.right * x + view.up * y + view.forward * depth_m;
        index_of(&grid, at).map_or(1.0, |i| (-strength * f64::from(grid.value(i))).exp() as f32)
    };
    Ok(framing.pixel_centers().par_iter().map(pixel).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Axis;
    use glam::DVec3;

    #[test]
    fn the_slice_is_dark_where_the_gradient_is_and_bright_outside() {
        // A kink at x = 0: there is a gradient only to the right of it.
        let field = Field::from_fn([17, 9, 9], [0.1; 3], DVec3::new(-0.8, 0.0, 0.0), 1.0, |p| {
            1e-4 * p.x.max(0.0)
        });
        let field = field.unwrap();
        let view = View::along(Axis::Z, field.centre_m());
        let framing = Framing::fitted(32, 32, [1.6, 0.8]);
        let p = slice(&field, &view, &framing, 0.1, 3.0).unwrap();
        let dark = f64::from(p[16 * 32 + 26]);
        assert!(p[16 * 32 + 4] == 1.0 && (dark - (-3.0f64).exp()).abs() < 1e-3, "{dark}");
        assert_eq!(p[26], 1.0, "above the field");
    }
}
