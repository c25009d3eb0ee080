//! Fragments that wait until 16 of one draw can be lit together.

use super::{Prepared, Seen, to_bytes};
use fearless_simd::{Level, dispatch};
use rt_core::ray::LANES;

/// Up to 16 fragments of one draw that are lit together.
#[derive(Default)]
pub(super) struct Batch {
    pub(super) draw: u32,
    pub(super) count: usize,
    pixels: [usize; LANES],
    triangles: [[u32; 3]; LANES],
    weights: [[f32; LANES]; 3],
    back: [bool; LANES],
}

impl Batch {
    pub(super) fn add(&mut self, p: &Prepared<'_>, draw: u32, pixel: usize, s: &Seen, color: &mut [[u8; 4]]) {
        // One with room left is of the same draw: others are shaded before the draw changes.
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
        let used = ((1_u32 << self.count) - 1) as u16;
        let positions = &p.draw.geometry.mesh.positions;
        let a = &p.draw.attributes;
        let (triangles, weights, back) = (&self.triangles, &self.weights, &self.back);
        let lit = dispatch!(Level::new(), _simd => p.lighting.fragments(a, positions, triangles, weights, back, used));
        for l in 0..self.count {
            color[self.pixels[l]] = to_bytes(lit.rgba.map(|c| c[l]));
        }
        self.count = 0;
    }
}
