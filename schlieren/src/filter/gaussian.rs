//! The Gaussian filter: averages neighbouring pixels with Gaussian weights.

/// Weights of a Gaussian at distances 0, 1, 2… pixels, down to 1e-6 of the central weight. A
/// pixel's weight is the integral of the Gaussian over it, by Simpson's rule, so that narrow
/// Gaussians keep their width.
pub fn weights(sigma_px: f64) -> Vec<f64> {
    if sigma_px.is_nan() || sigma_px <= 0.0 {
        return vec![1.0];
    }
    let density = |x: f64| (-0.5 * (x / sigma_px).powi(2)).exp();
    let reach = (5.3 * sigma_px + 0.5).ceil() as usize;
    // Below σ = 1/4, a pixel is too wide for three points.
    let parts = (2.0 / sigma_px).ceil().max(1.0) as usize;
    let pixel = |d: usize| {
        let h = 1.0 / parts as f64;
        let part = |k: usize| {
            let x = d as f64 - 0.5 + k as f64 * h;
            (density(x) + 4.0 * density(x + 0.5 * h) + density(x + h)) * h / 6.0
        };
        (0..parts).map(part).sum::<f64>()
    };
    (0..=reach).map(pixel).collect()
}

/// Filters an image with rows of `width` pixels.
pub fn gaussian<const C: usize>(pixels: &[[f32; C]], width: usize, sigma_px: f64) -> Vec<[f32; C]> {
    super::separable(pixels, width, &weights(sigma_px))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn has_the_variance_it_was_asked_for() {
        for sigma in [0.5, 1.0, 2.5] {
            let w = weights(sigma);
            let total: f64 = w[0] + 2.0 * w[1..].iter().sum::<f64>();
            let second: f64 =
                w.iter().enumerate().skip(1).map(|(d, w)| 2.0 * w * (d * d) as f64).sum();
            // The width of a pixel adds 1/12, less an aliasing error of 2.5 % at σ = 0.5 and none
            // from σ = 1.
            let expected = sigma * sigma + 1.0 / 12.0;
            assert!(
                (second / total - expected).abs() < 0.03 * expected,
                "{sigma}: {}",
                second / total
            );
        }
        assert_eq!(weights(0.0), [1.0]);
    }
}
