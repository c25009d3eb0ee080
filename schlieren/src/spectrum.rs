//! Computes the colours that a film records for light of several wavelengths.
//!
//! With one wavelength (or white light whose dispersion does not matter), images are grey or have
//! the colours of the filter. With several, each wavelength is traced separately through its own
//! indices, and the film adds their colours. Dispersion appears as coloured edges, interference as
//! Newton's colours.

use crate::cutoff::Rgb;

/// One line of the source's spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Vacuum wavelength.
    pub wavelength_nm: f64,
    /// Fraction of the light; all fractions add up to 1.
    pub weight: f64,
}

/// The CIE 1931 colour matching functions by the piecewise Gaussians of Wyman, Sloan and Shirley,
/// "Simple analytic approximations to the CIE XYZ color matching functions" (JCGT 2013, equation 4
/// and table 1).
pub fn xyz(wavelength_nm: f64) -> [f64; 3] {
    let lobe = |scale: f64, mean: f64, below: f64, above: f64| {
        let t = (wavelength_nm - mean) * if wavelength_nm < mean { below } else { above };
        scale * (-0.5 * t * t).exp()
    };
    [
        lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323)
            - lobe(0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    ]
}

/// The colours (linear sRGB) of the lines on the film, balanced so that their sum is white, (1, 1,
/// 1). Pure spectral colours lie outside the sRGB gamut; negative components are clipped before
/// balancing.
///
/// If the lines do not contribute to a channel (as with two red lasers), no balance can make them
/// white, and that channel stays dark.
pub fn film_colors(lines: &[Line]) -> Vec<Rgb> {
    let rgb = |line: &Line| {
        let [x, y, z] = xyz(line.wavelength_nm);
        // XYZ to linear sRGB, IEC 61966-2-1.
        let rgb = [
            3.2406 * x - 1.5372 * y - 0.4986 * z,
            -0.9689 * x + 1.8758 * y + 0.0415 * z,
            0.0557 * x - 0.2040 * y + 1.0570 * z,
        ];
        rgb.map(|c| c.max(0.0) * line.weight)
    };
    let colors: Vec<[f64; 3]> = lines.iter().map(rgb).collect();
    let total = [0, 1, 2].map(|c| colors.iter().map(|v| v[c]).sum::<f64>());
    // Balancing a channel below a thousandth of the strongest would only amplify noise.
    let strongest = total.iter().copied().fold(0.0, f64::max);
    let balance = total.map(|t| if t > 1e-3 * strongest { 1.0 / t } else { 0.0 });
    colors.iter().map(|v| [0, 1, 2].map(|c| (v[c] * balance[c]) as f32)).collect()
}

/// Weights of a filter's red, green and blue for a wavelength. They add up to 1, so a grey filter
/// is grey for every wavelength. Blue below 450 nm, green at 540 nm, red above 620 nm, linear
/// between.
pub fn filter_band(wavelength_nm: f64) -> Rgb {
    let ramp = |from: f64, to: f64| ((wavelength_nm - from) / (to - from)).clamp(0.0, 1.0);
    let (green_up, red_up) = (ramp(450.0, 540.0), ramp(540.0, 620.0));
    [red_up, green_up - red_up, 1.0 - green_up].map(|v| v as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(nm: &[f64]) -> Vec<Line> {
        nm.iter()
            .map(|&wavelength_nm| Line { wavelength_nm, weight: 1.0 / nm.len() as f64 })
            .collect()
    }

    #[test]
    fn matching_functions_have_the_known_peaks() {
        // CIE 1931: y peaks with 1 at 555 nm; x with 1.06 near 600; z with 1.78 near 446.
        let y = |nm: i32| xyz(f64::from(nm))[1];
        let peak = (400..700).max_by(|a, b| y(*a).total_cmp(&y(*b))).unwrap();
        assert!((peak - 555).abs() <= 4 && (y(peak) - 1.0).abs() < 0.02, "{peak} {}", y(peak));
        assert!((xyz(600.0)[0] - 1.06).abs() < 0.03 && (xyz(446.0)[2] - 1.78).abs() < 0.05);
    }

    #[test]
    fn all_lines_together_are_white_and_each_has_its_color() {
        let colors = film_colors(&lines(&[450.0, 540.0, 633.0]));
        for c in 0..3 {
            let sum: f32 = colors.iter().map(|v| v[c]).sum();
            assert!((sum - 1.0).abs() < 1e-6);
        }
        assert!(colors[0][2] > 0.9 && colors[1][1] > 0.8 && colors[2][0] > 0.8, "{colors:?}");
    }

    #[test]
    fn lines_without_blue_leave_it_dark() {
        let colors = film_colors(&lines(&[633.0, 650.0]));
        assert!(colors.iter().all(|c| c[2] == 0.0) && colors[0][0] > 0.0);
    }

    #[test]
    fn grey_filters_are_grey_to_every_wavelength() {
        for nm in 300..900 {
            let sum: f32 = filter_band(f64::from(nm)).iter().sum();
            assert!(
                (sum - 1.0).abs() < 1e-6 && filter_band(f64::from(nm)).iter().all(|v| *v >= 0.0)
            );
        }
    }
}
