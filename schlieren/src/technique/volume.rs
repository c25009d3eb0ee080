//! Draws the "volume rendered schlieren" of visualization programs for comparison: the magnitude of
//! the gradient of eps along straight rays, as smoke (figure 5.12). It simulates no optics:
//! directions of gradients are lost, opposite gradients do not cancel, and it has no unit.
//!
//! A ray's brightness is `exp(-strength ∫ |∇eps| ds / (g L))`, with g the largest gradient and L
//! the field's depth along the view.

use crate::field::Field;
use crate::film::Framing;
use crate::view::View;
use glam::{DVec3, UVec3, Vec3};
use rayon::prelude::*;
use rt_core::colormap::ColorMap;
use rt_core::grid::{Grid, GridError};
use rt_core::ray::Ray;
use rt_core::transfer_function::{TransferFunction, TransferFunctionError};
use rt_core::volume::{Volume, VolumeError, VolumeOptions, VolumeQuality};

/// Errors of drawing a comparison.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ComparisonError {
    /// No grid can be made of the field's gradient.
    #[error("the gradient of the field cannot be stored as a grid")]
    Grid(#[from] GridError),
    /// No volume can be made of the grid.
    #[error("the gradient of the field cannot be rendered as a volume")]
    Volume(#[from] VolumeError),
    /// No transfer function can be made of the strength.
    #[error("the strength gives no valid transfer function; give a number above 0")]
    Transfer(#[from] TransferFunctionError),
}

/// The magnitude |∇eps| at the nodes in 1/m, by central differences (one-sided at the border), and
/// its largest value. It is 0 at nodes that are not gas.
pub fn gradient_size(field: &Field) -> (Vec<f32>, f32) {
    let dims = field.dims();
    let (eps, spacing) = (field.eps(), field.spacing_m());
    let stride = [1, dims[0], dims[0] * dims[1]];
    let at = |i: usize| {
        if field.nodes().is_some_and(|n| n[i] != crate::field::Node::Gas) {
            return 0.0;
        }
        let node = [i % dims[0], i / dims[0] % dims[1], i / stride[2]];
        let component = |c: usize| {
            let (low, high) = (node[c].saturating_sub(1), (node[c] + 1).min(dims[c] - 1));
            let value = |n: usize| f64::from(eps[i + n * stride[c] - node[c] * stride[c]]);
            (value(high) - value(low)) / ((high - low) as f64 * spacing[c])
        };
        let [x, y, z] = [0, 1, 2].map(component);
        (x * x + y * y + z * z).sqrt() as f32
    };
    let sizes: Vec<f32> = (0..eps.len()).into_par_iter().map(at).collect();
    let largest = sizes.iter().copied().fold(0.0f32, f32::max);
    (sizes, largest)
}

/// |∇eps| / largest as a grid of rt-core.
pub(super) fn gradient_grid(field: &Field) -> Result<Grid, ComparisonError> {
    let (mut sizes, largest) = gradient_size(field);
    if largest > 0.0 {
        sizes.par_iter_mut().for_each(|g| *g /= largest);
    }
    let dims = UVec3::from_array(field.dims().map(|d| d as u32));
    Ok(Grid::new(dims, field.origin_m(), DVec3::from(field.spacing_m()), sizes)?)
}

/// The image, row by row from the top. It is 1 where there is no gradient.
///
/// # Errors
/// If no volume can be made of the field's gradient, or `strength` is not above 0.
pub fn volume(
    field: &Field,
    view: &View,
    framing: &Framing,
    strength: f64,
) -> Result<Vec<f32>, ComparisonError> {
    let grid = gradient_grid(field)?;
    let depth = field.size_m().dot(view.forward.abs());
    let black = ColorMap::new(vec![[0.0, 0.0, 0.0, 1.0]], [0.0, 1.0]);
    let transfer =
        TransferFunction::new(black, vec![[0.0, 0.0], [1.0, (strength / depth) as f32]])?;
    let volume = Volume::new(grid.into(), transfer, VolumeOptions::default())?;
    let radius = field.size_m().length();
    let pixel = |start: &crate::path::Start| {
        let [x, y] = start.position_m.map(f64::from);
        let origin = view.centre_m + view.right * x + view.up * y - view.forward * radius;
        let ray = Ray::new((origin - volume.origin()).as_vec3(), view.forward.as_vec3());
        let seen =
            volume.integrate(&ray, 0.0, f32::INFINITY, &VolumeQuality::Tolerance { levels: 0.1 });
        1.0 - seen.rgba[3]
    };
    Ok(framing.pixel_centers().par_iter().map(pixel).collect())
}

/// Index of a world point in a grid, or `None` outside.
pub(super) fn index_of(grid: &Grid, at: DVec3) -> Option<Vec3> {
    let index = (at - grid.origin()) / grid.spacing();
    let last = (grid.dims() - UVec3::ONE).as_dvec3();
    // A thousandth of a cell: the frame's border pixels may lie on the border of the field.
    let inside = index.cmpge(DVec3::splat(-1e-3)).all() && index.cmple(last + 1e-3).all();
    inside.then(|| index.as_vec3())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Axis;

    #[test]
    fn an_even_gradient_darkens_by_the_length_of_the_way() {
        // eps grows along x, so |∇eps| is the same everywhere and the image is e^-strength inside
        // and 1 outside.
        let field = Field::from_fn([9, 9, 9], [0.1; 3], DVec3::ZERO, 1.0, |p| 1e-4 * p.x).unwrap();
        let view = View::along(Axis::Z, field.centre_m());
        let framing = Framing::fitted(20, 10, [0.8, 0.8]);
        let p = volume(&field, &view, &framing, 2.0).unwrap();
        assert!((p[5 * 20 + 10] - (-2.0f32).exp()).abs() < 1e-3, "{}", p[5 * 20 + 10]);
        assert_eq!(p[5 * 20], 1.0);
    }
}
