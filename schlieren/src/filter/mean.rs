//! The mean filter: replaces every pixel by the mean of the square around it.

/// Weights at distances 0, 1, 2… pixels for a window that extends `radius_px` beyond either edge of
/// a pixel. The outermost pixel is weighted by its covered fraction.
pub fn weights(radius_px: f64) -> Vec<f64> {
    let radius = radius_px.max(0.0);
    let whole = radius.floor() as usize;
    let mut w = vec![1.0; whole + 1];
    if radius > whole as f64 {
        w.push(radius - whole as f64);
    }
    w
}

/// Filters an image with rows of `width` pixels.
pub fn mean<const C: usize>(pixels: &[[f32; C]], width: usize, radius_px: f64) -> Vec<[f32; C]> {
    super::separable(pixels, width, &weights(radius_px))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radius_zero_is_the_image_and_one_is_three_by_three() {
        let pixels: Vec<[f32; 1]> = (0..25u16).map(|i| [f32::from(i * i)]).collect();
        assert_eq!(mean(&pixels, 5, 0.0), pixels);
        let m = mean(&pixels, 5, 1.0)[12][0];
        let expected =
            [6, 7, 8, 11, 12, 13, 16, 17, 18].iter().map(|i: &i32| (i * i) as f32).sum::<f32>()
                / 9.0;
        assert!((m - expected).abs() < 1e-4, "{m} {expected}");
    }
}
