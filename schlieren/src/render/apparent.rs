//! How far the dots of a background seem to move, as particle image velocimetry measures it.
//!
//! A ray from the camera through the point x of the image hits the background at x + d(x), so the
//! image is I(x) = I₀(x + d(x)) of the undisturbed one. The dot at p is seen where x + d(x) = p: it
//! has moved by u(p) = -d(p + u(p)). That is the opposite of the ray's shift, taken where the dot
//! is seen.

use crate::film::Framing;

/// Iterations at most, and the change, in pixels, at which they end. With shifts whose slope is
/// below 1 the iteration contracts; where it is more, light crosses and a dot has several images.
const ITERATIONS: usize = 50;
const CLOSE_PX: f64 = 1e-4;

/// Displacement of the dot at each pixel's centre in the undisturbed image, along right and up, in
/// metres in the test section. NaN where the dot is not seen: behind a body, outside the image, or
/// where light crosses.
pub(crate) fn displacements(
    framing: &Framing,
    shifts_m: &[[f32; 2]],
    transmission: &[f32],
) -> Vec<[f32; 2]> {
    let shifts = Shifts { framing, shifts_m, transmission };
    let one = |at: usize| shifts.displacement(at).map_or([f32::NAN; 2], |u| u.map(|x| x as f32));
    (0..shifts_m.len()).map(one).collect()
}

/// Shifts of rays, row by row from the top.
struct Shifts<'a> {
    framing: &'a Framing,
    shifts_m: &'a [[f32; 2]],
    transmission: &'a [f32],
}

impl Shifts<'_> {
    /// In metres.
    fn displacement(&self, pixel: usize) -> Option<[f64; 2]> {
        let width = self.framing.width as usize;
        let (column, row) = ((pixel % width) as f64, (pixel / width) as f64);
        let side = self.framing.pixel_m;
        let mut moved = [0.0; 2];
        for _ in 0..ITERATIONS {
            // Rows count downwards.
            let shift = self.between_pixels(column + moved[0] / side, row - moved[1] / side)?;
            let next = shift.map(|d| -d);
            let change = (next[0] - moved[0]).hypot(next[1] - moved[1]);
            moved = next;
            if change <= CLOSE_PX * side {
                return Some(moved);
            }
        }
        None
    }

    /// The ray's shift between the centres of pixels, linear along both axes.
    fn between_pixels(&self, column: f64, row: f64) -> Option<[f64; 2]> {
        let [columns, rows] = [self.framing.width, self.framing.height].map(|n| n as usize);
        let cell = |at: f64, count: usize| {
            let last = (count - 1) as f64;
            // The image ends half a pixel beyond the centres.
            (at >= -0.5 && at <= last + 0.5).then(|| {
                let at = at.clamp(0.0, last);
                let first = (at as usize).min(count.saturating_sub(2));
                (first, (first + 1).min(count - 1), at - first as f64)
            })
        };
        let ((i, i1, s), (j, j1, t)) = (cell(column, columns)?, cell(row, rows)?);
        let mut sum = [0.0; 2];
        for (x, y, weight) in [
            (i, j, (1.0 - s) * (1.0 - t)),
            (i1, j, s * (1.0 - t)),
            (i, j1, (1.0 - s) * t),
            (i1, j1, s * t),
        ] {
            let at = y * columns + x;
            if weight > 0.0 && self.transmission[at] <= 0.0 {
                return None;
            }
            for (sum, d) in sum.iter_mut().zip(self.shifts_m[at]) {
                *sum += weight * f64::from(d);
            }
        }
        Some(sum)
    }
}
