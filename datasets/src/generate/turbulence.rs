//! Imitates turbulence without solving its equations: smooth mean fields are evaluated at displaced
//! positions.
//!
//! Two displacements are applied one after the other. [`Vortices`] wind the field up around a few
//! large cores (Kelvin-Helmholtz rollers, the rings of puffing plumes). [`Turbulence`] displaces by
//! gradient noise in octaves down to six cells, with amplitudes ∝ wavelength^(1/3). Differences of
//! a passive scalar then grow with distance^(1/3), as Obukhov and Corrsin found for real
//! turbulence. Fronts of the mean field become folded, torn sheets that stay as sharp as in the
//! mean field.

use super::flow::Flow;
use super::noise::{Noise, RowScratch};

/// Cells per wavelength of the finest octave; below that, waves would be aliased and gradients
/// unresolved.
const CELLS_PER_WAVELENGTH: f64 = 6.0;

/// Displacements by noise on the lattice of a flow.
pub(crate) struct Turbulence {
    octaves: Vec<Octave>,
    points: [u32; 3],
}

struct Octave {
    noise: [Noise; 3],
    wavelength_m: f64,
}

/// Storage of [`Turbulence::displace_row`].
#[derive(Default)]
pub(crate) struct Displacement {
    /// Displacements along x, y and z, per point of the row, in metres.
    pub(crate) rows: [Vec<f32>; 3],
    octave: Vec<f32>,
    scratch: Vec<[RowScratch; 3]>,
    /// Size and strength along the row, and the resulting weights of each octave. Most rows reuse
    /// those of the previous row.
    local: Vec<(f64, f64)>,
    weights: Vec<Vec<f32>>,
}

impl Turbulence {
    /// Octaves from `largest_m` downwards. Coarser lattices have the same large octaves but fewer
    /// of them.
    pub(crate) fn new(flow: &Flow, largest_m: f64, seed: u64) -> Turbulence {
        let length = flow.spacing_m * (flow.dims - 1).as_dvec3();
        let finest = CELLS_PER_WAVELENGTH * flow.spacing_m.max_element();
        let octaves = (0..16u64)
            .map(|o| (o, largest_m * 0.5f64.powi(o as i32)))
            .take_while(|(o, wavelength)| *o == 0 || *wavelength >= finest)
            .map(|(o, wavelength_m)| {
                let period = [0, 1, 2].map(|a| (length[a] / wavelength_m).round().max(1.0) as u32);
                let noise = [1, 2, 3].map(|c| Noise { period, seed: seed ^ (4 * o + c) << 48 });
                Octave { noise, wavelength_m }
            })
            .collect();
        Turbulence { octaves, points: flow.dims.to_array() }
    }

    /// Computes the displacements along the row of constant y and z with indices `j`, `k`.
    /// `strength(i)` returns the local size of the eddies at point `i`, and how far they carry gas
    /// as a fraction of that size.
    pub(crate) fn displace_row(
        &self,
        out: &mut Displacement,
        j: u32,
        k: u32,
        strength: impl Fn(usize) -> (f64, f64),
    ) {
        let n = self.points[0] as usize;
        let [dx, dy, dz] = self.points.map(|p| 1.0 / (p - 1) as f64);
        out.scratch.resize_with(self.octaves.len(), Default::default);
        for row in &mut out.rows {
            row.clear();
            row.resize(n, 0.0);
        }
        let local: Vec<(f64, f64)> = (0..n).map(strength).collect();
        if local != out.local || out.weights.len() != self.octaves.len() {
            let of_octave =
                |o: &Octave| local.iter().map(|&l| weight(o.wavelength_m, l) as f32).collect();
            out.weights = self.octaves.iter().map(of_octave).collect();
            out.local = local;
        }
        for (o, octave) in self.octaves.iter().enumerate() {
            for c in 0..3 {
                out.octave.clear();
                out.octave.resize(n, 0.0);
                let scratch = &mut out.scratch[o][c];
                octave.noise[c].add_row(
                    &mut out.octave,
                    dx,
                    j as f64 * dy,
                    k as f64 * dz,
                    1.0,
                    scratch,
                );
                for ((sum, v), w) in out.rows[c].iter_mut().zip(&out.octave).zip(&out.weights[o]) {
                    *sum += v * w;
                }
            }
        }
    }
}

/// Amplitude of an octave for eddies of this size and strength: follows the third-root law below
/// the size and is small above it.
fn weight(wavelength_m: f64, (size_m, strength): (f64, f64)) -> f64 {
    if size_m <= 0.0 || strength <= 0.0 {
        return 0.0;
    }
    let relative = wavelength_m / size_m;
    strength * size_m * relative.cbrt() / (1.0 + relative.powi(4))
}

/// Vortex cores that wind up the surrounding gas in a plane: (x, y) for rollers, (r, z) for rings.
pub(crate) struct Vortices(pub(crate) Vec<Vortex>);

pub(crate) struct Vortex {
    pub(crate) center_m: [f64; 2],
    pub(crate) size_m: f64,
    /// Angle by which the core has turned, positive from the first axis to the second.
    pub(crate) turn_rad: f64,
}

impl Vortices {
    /// The position of the gas at `p` before the cores turned it.
    pub(crate) fn origin_of(&self, p: [f64; 2]) -> [f64; 2] {
        let mut q = p;
        for v in &self.0 {
            let d = [q[0] - v.center_m[0], q[1] - v.center_m[1]];
            let s = (d[0] * d[0] + d[1] * d[1]) / (v.size_m * v.size_m);
            if s < 9.0 {
                let (sin, cos) = (-v.turn_rad * (-s).exp()).sin_cos();
                q = [
                    v.center_m[0] + d[0] * cos - d[1] * sin,
                    v.center_m[1] + d[0] * sin + d[1] * cos,
                ];
            }
        }
        q
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, UVec3};

    #[test]
    fn differences_grow_with_the_third_root_of_distance() {
        let flow = Flow::over(UVec3::new(513, 40, 40), DVec3::ZERO, DVec3::new(512.0, 39.0, 39.0))
            .unwrap();
        let turbulence = Turbulence::new(&flow, 256.0, 5);
        let mut out = Displacement::default();
        let mut squares = [0.0; 2];
        for jk in 0..400 {
            turbulence.displace_row(&mut out, jk % 40, jk / 10, |_| (2048.0, 0.3));
            for (s, distance) in squares.iter_mut().zip([6, 48]) {
                *s += out.rows[1]
                    .windows(distance + 1)
                    .map(|w| ((w[distance] - w[0]) as f64).powi(2))
                    .sum::<f64>()
                    / (513 - distance) as f64;
            }
        }
        let exponent = 0.5 * (squares[1] / squares[0]).ln() / 8f64.ln();
        // The range of wavelengths is finite: its ends bend the line.
        assert!((0.23..0.43).contains(&exponent), "{exponent}");
    }

    #[test]
    fn calm_places_stay_where_they_are() {
        let flow = Flow::over(UVec3::splat(20), DVec3::ZERO, DVec3::ONE).unwrap();
        let turbulence = Turbulence::new(&flow, 0.5, 5);
        let mut out = Displacement::default();
        turbulence.displace_row(&mut out, 3, 4, |i| if i < 10 { (0.0, 1.0) } else { (0.5, 0.3) });
        for row in &out.rows {
            assert!(
                row[..10].iter().all(|&v| v == 0.0) && row[10..].iter().any(|&v| v.abs() > 1e-3)
            );
        }
    }

    #[test]
    fn vortex_turns_its_core_and_leaves_the_distance() {
        let vortex = Vortices(vec![Vortex { center_m: [1.0, 2.0], size_m: 0.5, turn_rad: 1.5 }]);
        assert_eq!(vortex.origin_of([4.0, 2.0]), [4.0, 2.0]);
        let q = vortex.origin_of([1.1, 2.0]);
        let (d, angle) = ((q[0] - 1.0).hypot(q[1] - 2.0), (q[1] - 2.0).atan2(q[0] - 1.0));
        assert!((d - 0.1).abs() < 1e-12 && (angle + 1.5 * (-0.04f64).exp()).abs() < 1e-12);
    }
}
