//! The cone filter: estimates the energy at a pixel from the k photons nearest to its centre, with
//! weights that decrease linearly to zero at the k-th (dissertation, section 5.5; Jensen,
//! "Realistic Image Synthesis Using Photon Mapping", 2001, section 7.2, with his k = 1).
//!
//! With r the distance of the k-th photon, `E = Σ e_i (1 - d_i/r) / (π r²/3)`. The k-th photon has
//! weight 0, which makes the estimate unbiased for uniformly distributed photons: each of the k - 1
//! inside has the mean weight 1/3, and (k-1)/(π r²) is an unbiased estimate of their density.

use crate::film::Framing;
use crate::film::photons::LandedPhoton;
use rayon::prelude::*;

/// Largest number of photons stored for this filter, about 2 GB.
pub const MAX_PHOTONS: u64 = 1 << 27;

/// Energy at each pixel's centre, in photons per pixel divided by `per_pixel`. With fewer than two
/// photons in total, the image is black.
pub fn cone<const C: usize>(
    photons: &[LandedPhoton<C>],
    framing: &Framing,
    nearest: u32,
    per_pixel: f64,
) -> Vec<[f32; C]> {
    let k = (nearest as usize).min(photons.len());
    let width = framing.width as usize;
    let mut out = vec![[0.0; C]; framing.pixels()];
    if k < 2 {
        return out;
    }
    let buckets = Buckets::new(photons, framing);
    out.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        let mut found: Vec<(f32, u32)> = Vec::new();
        for (x, pixel) in row.iter_mut().enumerate() {
            let center = [x as f32 + 0.5, y as f32 + 0.5];
            let r2 = buckets.nearest(photons, center, k, &mut found);
            let r = f64::from(r2).sqrt();
            if r <= 0.0 {
                continue;
            }
            let mut sum = [0.0f64; C];
            for &(d2, i) in &found {
                let weight = 1.0 - f64::from(d2).sqrt() / r;
                (0..C).for_each(|c| sum[c] += weight * f64::from(photons[i as usize].energy[c]));
            }
            let scale = 3.0 / (std::f64::consts::PI * r * r * per_pixel);
            *pixel = sum.map(|s| (s * scale) as f32);
        }
    });
    out
}

/// Photons sorted into squares of one pixel, over the image and a border. Photons farther out are
/// in the squares of the border.
struct Buckets {
    low: [i64; 2],
    size: [i64; 2],
    /// First entry of each square in `order`, followed by the total number.
    first: Vec<u32>,
    order: Vec<u32>,
}

impl Buckets {
    fn new<const C: usize>(photons: &[LandedPhoton<C>], framing: &Framing) -> Buckets {
        const BORDER: i64 = 8;
        let low = [-BORDER, -BORDER];
        let size = [i64::from(framing.width) + 2 * BORDER, i64::from(framing.height) + 2 * BORDER];
        let mut buckets = Buckets { low, size, first: Vec::new(), order: vec![0; photons.len()] };
        // Counting sort. It is stable, so each square keeps the order of the photons.
        let mut first = vec![0u32; (size[0] * size[1]) as usize + 1];
        for p in photons {
            first[buckets.square(p.at_px) + 1] += 1;
        }
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        let mut next = first.clone();
        for (i, p) in photons.iter().enumerate() {
            let slot = &mut next[buckets.square(p.at_px)];
            buckets.order[*slot as usize] = i as u32;
            *slot += 1;
        }
        buckets.first = first;
        buckets
    }

    fn square(&self, at: [f32; 2]) -> usize {
        let [i, j] =
            [0, 1].map(|a| (at[a].floor() as i64 - self.low[a]).clamp(0, self.size[a] - 1));
        (j * self.size[0] + i) as usize
    }

    /// Finds the k photons nearest to `at`, as squared distances and indices, nearest first and
    /// ties by index. Returns the k-th squared distance.
    fn nearest<const C: usize>(
        &self,
        photons: &[LandedPhoton<C>],
        at: [f32; 2],
        k: usize,
        found: &mut Vec<(f32, u32)>,
    ) -> f32 {
        let here = [0, 1].map(|a| at[a].floor() as i64 - self.low[a]);
        found.clear();
        let widest = self.size[0].max(self.size[1]);
        for ring in 0..=widest {
            let mut add = |i: i64, j: i64| {
                if (0..self.size[0]).contains(&i) && (0..self.size[1]).contains(&j) {
                    let s = (j * self.size[0] + i) as usize;
                    for &p in &self.order[self.first[s] as usize..self.first[s + 1] as usize] {
                        let q = photons[p as usize].at_px;
                        found.push(((q[0] - at[0]).powi(2) + (q[1] - at[1]).powi(2), p));
                    }
                }
            };
            for i in here[0] - ring..=here[0] + ring {
                if ring == 0 {
                    add(i, here[1]);
                } else {
                    add(i, here[1] - ring);
                    add(i, here[1] + ring);
                }
            }
            for j in here[1] - ring + 1..here[1] + ring {
                add(here[0] - ring, j);
                add(here[0] + ring, j);
            }
            // All photons within `ring` + 1/2 of the centre have been visited.
            let seen = (ring as f32 + 0.5).powi(2);
            if found.len() >= k && found.iter().filter(|f| f.0 <= seen).count() >= k {
                break;
            }
        }
        found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.truncate(k);
        found.last().map_or(0.0, |f| f.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::sampler::{Sampler, Sampling};

    const FRAMING: Framing = Framing { width: 24, height: 16, pixel_m: 1.0, center_m: [0.0; 2] };

    /// Random photons, also up to a few pixels outside the image.
    fn photons(per_pixel: u32) -> Vec<LandedPhoton<1>> {
        let area = (24 + 16) * (16 + 16) * per_pixel;
        let at = |i| Sampler::new(Sampling::Random, 3, 0, 0, i).square(0);
        (0..area)
            .map(at)
            .map(|p| LandedPhoton { at_px: [p[0] * 40.0 - 8.0, p[1] * 32.0 - 8.0], energy: [1.0] })
            .collect()
    }

    #[test]
    fn nearest_equal_brute_force() {
        let all = photons(3);
        let buckets = Buckets::new(&all, &FRAMING);
        let mut found = Vec::new();
        for at in [[0.5f32, 0.5], [12.5, 7.5], [23.5, 15.5]] {
            for k in [1, 7, 100, all.len()] {
                buckets.nearest(&all, at, k, &mut found);
                let mut slow: Vec<(f32, u32)> = all
                    .iter()
                    .zip(0..)
                    .map(|(p, i)| ((p.at_px[0] - at[0]).powi(2) + (p.at_px[1] - at[1]).powi(2), i))
                    .collect();
                slow.sort_by(|a, b| a.0.total_cmp(&b.0));
                assert_eq!(found, slow[..k], "{at:?} {k}");
            }
        }
    }

    #[test]
    fn even_light_has_mean_1_whatever_k() {
        let all = photons(20);
        for k in [5, 30, 200] {
            let film = cone(&all, &FRAMING, k, 20.0);
            let mean = film.iter().map(|p| f64::from(p[0])).sum::<f64>() / film.len() as f64;
            // 24*16*20 photons have a standard error of 1.2 %; the filter also reaches photons
            // outside the image.
            assert!((mean - 1.0).abs() < 0.03, "{k}: {mean}");
        }
    }

    #[test]
    fn no_photons_make_a_black_image() {
        assert!(cone::<1>(&[], &FRAMING, 10, 1.0).iter().all(|p| p[0] == 0.0));
    }
}
