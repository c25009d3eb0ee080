//! Filters that reduce the photon noise of an image (dissertation, section 5.5).
//!
//! [`gaussian`] and [`mean`] average over neighbouring pixels, [`cone`] over the k photons nearest
//! to a pixel. Filters also blur, so a filter must become narrower as photons are added; otherwise
//! the image would never become sharp. With N photons per pixel, a filter of radius r has an error
//! of r² from blur and 1/(r √N) from noise. Both decrease at the same rate for r ∝ N^(-1/6), the
//! rule of Knaus and Zwicker ("Progressive photon mapping", ACM TOG 2011) with α = 2/3. Sizes are
//! therefore given for one photon per pixel, and [`Filter::shrunk`] converts them to N.

pub mod cone;
pub mod gaussian;
pub mod mean;

/// A noise filter. Sizes are for one photon per pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Filter {
    /// No filter: each pixel shows its own photons.
    None,
    /// A Gaussian of standard deviation `sigma_px`.
    Gaussian {
        /// Standard deviation in pixels.
        sigma_px: f64,
    },
    /// The mean over a square that reaches `radius_px` to every side.
    Mean {
        /// Radius in pixels.
        radius_px: f64,
    },
    /// A cone over the nearest photons.
    Cone {
        /// Number of photons, k.
        nearest: u32,
    },
}

impl Filter {
    /// The filter for `samples` photons per pixel. Radii shrink as N^(-1/6). k grows as N^(2/3), so
    /// that the radius of the k nearest, which is proportional to √(k/N), shrinks at the same rate.
    #[must_use]
    pub fn shrunk(self, samples: u32) -> Filter {
        let n = f64::from(samples.max(1));
        let narrower = n.powf(-1.0 / 6.0);
        match self {
            Filter::None => Filter::None,
            Filter::Gaussian { sigma_px } => Filter::Gaussian { sigma_px: sigma_px * narrower },
            Filter::Mean { radius_px } => Filter::Mean { radius_px: radius_px * narrower },
            Filter::Cone { nearest } => Filter::Cone {
                nearest: (f64::from(nearest) * n.powf(2.0 / 3.0)).round().max(2.0) as u32,
            },
        }
    }

    /// Weights by distance along rows and columns; `None` for a cone, which has none.
    #[cfg(feature = "gpu")]
    pub(crate) fn weights(self) -> Option<Vec<f64>> {
        match self {
            Filter::None => Some(vec![1.0]),
            Filter::Gaussian { sigma_px } => Some(gaussian::weights(sigma_px)),
            Filter::Mean { radius_px } => Some(mean::weights(radius_px)),
            Filter::Cone { .. } => None,
        }
    }

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Filter::None => "none",
            Filter::Gaussian { .. } => "gaussian",
            Filter::Mean { .. } => "mean",
            Filter::Cone { .. } => "cone",
        }
    }
}

/// Convolves rows and then columns with the symmetric kernel `weights[|distance|]`. At the image's
/// edge, weights outside the image are dropped and the rest are scaled up, so that a uniform image
/// stays uniform.
pub(crate) fn separable<const C: usize>(
    pixels: &[[f32; C]],
    width: usize,
    weights: &[f64],
) -> Vec<[f32; C]> {
    use rayon::prelude::*;
    let height = pixels.len() / width.max(1);
    let reach = weights.len() as isize - 1;
    let line = |at: isize, length: usize, pixel: &dyn Fn(usize) -> [f32; C]| {
        let (mut sum, mut total) = ([0.0f64; C], 0.0);
        for d in -reach..=reach {
            let i = at + d;
            if i >= 0 && i < length as isize {
                let (w, p) = (weights[d.unsigned_abs()], pixel(i as usize));
                total += w;
                (0..C).for_each(|c| sum[c] += w * f64::from(p[c]));
            }
        }
        sum.map(|s| (s / total) as f32)
    };
    let mut rows = vec![[0.0; C]; pixels.len()];
    rows.par_chunks_mut(width.max(1)).zip(pixels.par_chunks(width.max(1))).for_each(
        |(out, row)| {
            out.iter_mut().enumerate().for_each(|(x, o)| *o = line(x as isize, width, &|i| row[i]));
        },
    );
    let mut out = vec![[0.0; C]; pixels.len()];
    out.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        let column = |x: usize| move |i: usize| i * width + x;
        row.iter_mut()
            .enumerate()
            .for_each(|(x, o)| *o = line(y as isize, height, &|i| rows[column(x)(i)]));
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_shrink_as_samples_grow() {
        let Filter::Gaussian { sigma_px } = (Filter::Gaussian { sigma_px: 2.0 }).shrunk(64) else {
            panic!()
        };
        assert!((sigma_px - 1.0).abs() < 1e-12);
        assert_eq!(Filter::Cone { nearest: 10 }.shrunk(8), Filter::Cone { nearest: 40 });
        assert_eq!(Filter::Mean { radius_px: 3.0 }.shrunk(1), Filter::Mean { radius_px: 3.0 });
    }

    #[test]
    fn uniform_images_stay_uniform_and_energy_stays() {
        let even = vec![[0.25f32, 2.0]; 12 * 9];
        let mut spot = vec![[0.0f32; 1]; 31 * 31];
        spot[15 * 31 + 15] = [1.0];
        for weights in [gaussian::weights(1.7), mean::weights(2.3)] {
            for p in separable(&even, 12, &weights) {
                assert!((p[0] - 0.25).abs() < 1e-6 && (p[1] - 2.0).abs() < 1e-6);
            }
            let sum: f32 = separable(&spot, 31, &weights).iter().map(|p| p[0]).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{sum}");
        }
    }
}
