//! Collects fragments until 16 of one draw can be lit together.

use super::nearest::PixelHit;
use super::{Prepared, mixed, to_bytes};
use crate::trace::lighting::VertexColors;
use fearless_simd::{Level, dispatch};
use rt_core::ray::LANES;

/// Up to 16 fragments of one draw that are lit together.
#[derive(Default)]
pub(super) struct FragmentBatch {
    pub(super) draw: u32,
    pub(super) count: usize,
    pixels: [usize; LANES],
    triangles: [[u32; 3]; LANES],
    weights: [[f32; LANES]; 3],
    back: [bool; LANES],
}

impl FragmentBatch {
    pub(super) fn add(
        &mut self,
        p: &Prepared<'_>,
        draw: u32,
        pixel: usize,
        s: &PixelHit,
        color: &mut [[u8; 4]],
    ) {
        // A batch with free lanes always has fragments of this draw. Those of other draws are
        // shaded before the draw changes.
        debug_assert!(self.count == 0 || self.draw == draw, "a batch is of one draw");
        self.draw = draw;
        let n = self.count;
        self.pixels[n] = pixel;
        self.triangles[n] = p.draw.geometry.mesh.indices[s.prim as usize];
        for k in 0..3 {
            self.weights[k][n] = s.fragment.weights[k] as f32;
        }
        self.back[n] = !s.fragment.front;
        self.count = n + 1;
        if self.count == LANES {
            self.shade(p, color);
        }
    }

    pub(super) fn shade(&mut self, p: &Prepared<'_>, color: &mut [[u8; 4]]) {
        if let Some(lit) = &p.lit {
            return self.interpolate(p, lit, color);
        }
        let used = ((1_u32 << self.count) - 1) as u16;
        let positions = &p.draw.geometry.mesh.positions;
        let a = &p.draw.attributes;
        let (triangles, weights, back) = (&self.triangles, &self.weights, &self.back);
        let lit = dispatch!(Level::new(), simd => p.lighting.fragments(simd, a, positions, triangles, weights, back, used));
        for l in 0..self.count {
            color[self.pixels[l]] = to_bytes(lit.rgba.map(|c| c[l]));
        }
        self.count = 0;
    }

    /// Interpolates colours between vertices that are already lit.
    fn interpolate(&mut self, p: &Prepared<'_>, lit: &[VertexColors], color: &mut [[u8; 4]]) {
        let s = &*p.draw.state;
        let two = s.lighting && s.two_side;
        for l in 0..self.count {
            let side = usize::from(self.back[l] && two);
            let weights = self.weights.map(|w| w[l]);
            let [a, b, c] = self.triangles[l].map(|i| &lit[i as usize]);
            let (mut rgba, secondary) = match s.flat {
                true => (c.primary[side], c.secondary[side]),
                false => {
                    let primary =
                        mixed([a.primary[side], b.primary[side], c.primary[side]], weights);
                    (
                        primary,
                        mixed([a.secondary[side], b.secondary[side], c.secondary[side]], weights),
                    )
                }
            };
            for k in 0..3 {
                rgba[k] = (rgba[k] + secondary[k]).clamp(0.0, 1.0);
            }
            color[self.pixels[l]] = to_bytes(rgba);
        }
        self.count = 0;
    }
}
