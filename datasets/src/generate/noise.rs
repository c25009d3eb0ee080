//! Periodic gradient noise (Perlin 2002), evaluated one grid row at a time.
//!
//! Along a row of constant y and z, the noise in each lattice cell is a blend of two linear
//! functions of x. Their coefficients are computed once per cell. About a dozen operations per
//! point remain, which makes fields of 8 billion points affordable.

#[cfg(test)]
use glam::DVec3;
use rt_core::math::mix64;

/// Noise with `period` lattice cells per unit length along each axis that repeats after one unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Noise {
    pub(crate) period: [u32; 3],
    pub(crate) seed: u64,
}

/// Storage of [`Noise::add_row`]; keep one for each noise. Consecutive rows mostly lie in the same
/// lattice cells in y and z and then reuse the gradients.
#[derive(Default)]
pub(crate) struct RowScratch {
    /// Key of `gradients`: lattice cell in y and z, last node, and the noise itself.
    key: Option<([i64; 3], Noise)>,
    /// Gradients at each lattice node, for the four corners (y, z) of the cell.
    gradients: Vec<[[f32; 3]; 4]>,
    /// Slope and offset at each lattice node.
    nodes: Vec<[f32; 2]>,
}

impl Noise {
    fn gradient(&self, cell: [i64; 3]) -> [f32; 3] {
        let wrapped = |a: usize| cell[a].rem_euclid(self.period[a] as i64) as u64;
        let key = wrapped(0) | wrapped(1) << 21 | wrapped(2) << 42;
        let h = mix64(key ^ self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        // Each component is uniform in -1..1. The gradients are not unit vectors, but isotropic
        // enough once octaves are added.
        [0, 21, 42].map(|shift| ((h >> shift & 0x1f_ffff) as f32) * (2.0 / 0x1f_ffff as f32) - 1.0)
    }

    /// Adds `amplitude` times the noise at x = 0, dx, 2·dx… to `row`. Values are within about ±1.
    pub(crate) fn add_row(
        &self,
        row: &mut [f32],
        dx: f64,
        y: f64,
        z: f64,
        amplitude: f32,
        scratch: &mut RowScratch,
    ) {
        let [py, pz] = [1, 2].map(|a| self.period[a] as f64);
        let (y, z) = (y * py, z * pz);
        let (j, k) = (y.floor(), z.floor());
        let (fy, fz) = ((y - j) as f32, (z - k) as f32);
        let (wy, wz) = (fade(fy), fade(fz));
        let per_point = dx * self.period[0] as f64;
        let last_cell = ((row.len().max(1) - 1) as f64 * per_point).floor() as i64;

        let key = Some(([j as i64, k as i64, last_cell], *self));
        if scratch.key != key {
            scratch.key = key;
            scratch.gradients.clear();
            let corners = [(0, 0), (1, 0), (0, 1), (1, 1)];
            scratch.gradients.extend(
                (0..=last_cell + 1)
                    .map(|i| corners.map(|(b, c)| self.gradient([i, j as i64 + b, k as i64 + c]))),
            );
        }
        let weights = [(1.0 - wy) * (1.0 - wz), wy * (1.0 - wz), (1.0 - wy) * wz, wy * wz];
        scratch.nodes.clear();
        scratch.nodes.extend(scratch.gradients.iter().map(|corners| {
            let (mut slope, mut offset) = (0.0, 0.0);
            for (b, (g, w)) in corners.iter().zip(weights).enumerate() {
                slope += w * g[0];
                offset += w * (g[1] * (fy - (b & 1) as f32) + g[2] * (fz - (b >> 1) as f32));
            }
            [slope * amplitude, offset * amplitude]
        }));
        for (i, v) in row.iter_mut().enumerate() {
            let x = i as f64 * per_point;
            // Rounding can place the last point one cell beyond `last_cell`.
            let cell = (x as usize).min(last_cell as usize);
            let fx = (x - cell as f64) as f32;
            let [a, b] = [scratch.nodes[cell], scratch.nodes[cell + 1]];
            let (left, right) = (a[0] * fx + a[1], b[0] * (fx - 1.0) + b[1]);
            *v += left + (right - left) * fade(fx);
        }
    }

    /// The noise at one point: the slow reference implementation of [`Noise::add_row`].
    #[cfg(test)]
    pub(crate) fn at(&self, p: DVec3) -> f32 {
        let q = p * DVec3::new(self.period[0] as f64, self.period[1] as f64, self.period[2] as f64);
        let cell = q.floor();
        let f = (q - cell).as_vec3();
        let mut sum = 0.0;
        for corner in 0..8 {
            let o = [corner & 1, corner >> 1 & 1, corner >> 2];
            let g = self.gradient([0, 1, 2].map(|a| cell[a] as i64 + o[a] as i64));
            let dot = |a: usize| g[a] * (f[a] - o[a] as f32);
            let weight = |a: usize| if o[a] == 1 { fade(f[a]) } else { 1.0 - fade(f[a]) };
            sum += (dot(0) + dot(1) + dot(2)) * weight(0) * weight(1) * weight(2);
        }
        sum
    }
}

/// 6t⁵ - 15t⁴ + 10t³: first and second derivatives vanish at both ends.
fn fade(t: f32) -> f32 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_equal_points_and_the_noise_repeats() {
        let noise = Noise { period: [5, 7, 3], seed: 9 };
        let dx = 1.0 / 24.0; // two periods
        let mut scratch = RowScratch::default();
        let mut row = Vec::new();
        // The second row reuses the gradients of the first; the others must not.
        for (y, z) in [(0.37, 1.81), (0.38, 1.82), (0.5, 1.82), (0.5, 0.1)] {
            row = vec![0f32; 50];
            noise.add_row(&mut row, dx, y, z, 2.0, &mut scratch);
            for (i, v) in row.iter().enumerate() {
                let expected = 2.0 * noise.at(DVec3::new(i as f64 * dx, y, z));
                assert!((v - expected).abs() < 1e-5, "{i} {y} {z}: {v} {expected}");
            }
        }
        for i in 0..24 {
            assert!((row[i] - row[i + 24]).abs() < 1e-5, "{i}");
        }
        assert!(row.iter().any(|v| v.abs() > 0.2));
    }
}
