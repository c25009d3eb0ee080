//! Line integral convolution: noise smeared along a vector field, which shows its direction
//! everywhere (Cabral and Leedom 1993).

use rt_core::math::mix64;

/// Length of the line to either side of a pixel, in pixels, and the step along it.
const HALF_LENGTH_PX: f64 = 12.0;
const STEP_PX: f64 = 0.5;

/// Grey levels 0..=1 with the mean 0.5 from vectors along right and up, row by row from the top;
/// 0.5 where a vector is zero or not finite. Lines end there, and at the border.
///
/// ```
/// use schlieren::drawing::line_integral_convolution;
/// let grey = line_integral_convolution(&[[1.0, 0.0]; 64 * 8], 64);
/// // Along a row neighbours are alike, and across the rows they are not.
/// let change = |step: usize| (64..192).map(|i| (grey[i] - grey[i + step]).abs()).sum::<f32>();
/// assert!(3.0 * change(1) < change(64));
/// ```
pub fn line_integral_convolution(vectors: &[[f32; 2]], width: usize) -> Vec<f32> {
    use rayon::prelude::*;
    let height = vectors.len() / width.max(1);
    let unit = |x: f64, y: f64| {
        let inside = x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64;
        let v = inside.then(|| vectors[y as usize * width + x as usize].map(f64::from))?;
        let length = v[0].hypot(v[1]);
        // Rows count downwards.
        (length > 0.0 && length.is_finite()).then(|| [v[0] / length, -v[1] / length])
    };
    let noise = |x: f64, y: f64| {
        let word = mix64((x as u64) | (y as u64) << 32);
        (mix64(word) >> 40) as f64 / (1u64 << 24) as f64
    };
    let steps = (HALF_LENGTH_PX / STEP_PX) as usize;
    let grey = |pixel: usize| -> f32 {
        let (x, y) = ((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
        if unit(x, y).is_none() {
            return 0.5;
        }
        let (mut sum, mut count) = (noise(x, y), 1.0);
        for sign in [-1.0, 1.0] {
            let (mut x, mut y) = (x, y);
            for _ in 0..steps {
                let Some(u) = unit(x, y) else { break };
                x += sign * STEP_PX * u[0];
                y += sign * STEP_PX * u[1];
                if unit(x, y).is_none() {
                    break;
                }
                sum += noise(x, y);
                count += 1.0;
            }
        }
        // The mean of n independent values has the n-th part of their variance; a step of half a
        // pixel meets each twice. This stretches it to that of a value.
        let stretched = 0.5 + (sum / count - 0.5) * (0.5f64 * count).max(1.0).sqrt();
        stretched.clamp(0.0, 1.0) as f32
    };
    (0..vectors.len()).into_par_iter().map(grey).collect()
}
