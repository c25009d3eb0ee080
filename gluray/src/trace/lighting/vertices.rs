//! Lights all vertices of a small mesh once: [`LightingSetup::vertex`] for 16 at a time.

use super::gouraud::{self, F, ZERO};
use super::{LightingSetup, VertexColors};
use crate::capture::draw::Attributes;
use fearless_simd::{Level, Simd, SimdBase, dispatch};
use rayon::prelude::*;
use rt_core::glam::Vec3;
use rt_core::ray::LANES;

/// The number of vertices that a thread takes at once.
const SHARE: usize = 64 * LANES;

impl LightingSetup<'_> {
    /// Colours of all vertices; of attributes that [`LightingSetup::lights_blocks`].
    pub(crate) fn all(&self, a: &Attributes, positions: &[Vec3]) -> Vec<VertexColors> {
        let mut out = vec![VertexColors::default(); positions.len()];
        let light = |(i, out): (usize, &mut [VertexColors])| {
            dispatch!(Level::new(), simd => self.some(simd, a, positions, i * SHARE, out));
        };
        match out.len() {
            ..=SHARE => out.chunks_mut(SHARE).enumerate().for_each(light),
            _ => out.par_chunks_mut(SHARE).enumerate().for_each(light),
        }
        out
    }

    #[inline(always)]
    fn some<S: Simd>(
        &self,
        simd: S,
        a: &Attributes,
        positions: &[Vec3],
        first: usize,
        out: &mut [VertexColors],
    ) {
        let two = self.state.lighting && self.state.two_side;
        for (block, out) in out.chunks_mut(LANES).enumerate() {
            let first = first + block * LANES;
            let mut vertices = [first; LANES];
            for l in 0..out.len() {
                vertices[l] = first + l;
            }
            let used = u16::MAX >> (LANES - out.len());
            let front = rows(self.vertices(simd, a, positions, &vertices, &[false; LANES], used));
            let back = match two {
                true => rows(self.vertices(simd, a, positions, &vertices, &[true; LANES], used)),
                false => front,
            };
            for (l, out) in out.iter_mut().enumerate() {
                for (side, (primary, secondary)) in [&front, &back].into_iter().enumerate() {
                    out.primary[side] = primary.map(|v| v[l]);
                    out.secondary[side] = secondary.map(|v| v[l]);
                }
            }
        }
    }
}

/// From registers into memory.
#[inline(always)]
fn rows<S: Simd>((primary, secondary): gouraud::LaneColors<S>) -> ([F; 4], [F; 3]) {
    let (mut p, mut s) = ([ZERO; 4], [ZERO; 3]);
    for k in 0..4 {
        primary[k].store_slice(&mut p[k]);
    }
    for k in 0..3 {
        secondary[k].store_slice(&mut s[k]);
    }
    (p, s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::draw::Values;
    use crate::state::current_attributes::CurrentAttributes;
    use crate::state::material::Material;
    use crate::state::snapshot::{GlLight, Snapshot};

    #[test]
    fn all_vertices_are_lit_as_each_alone() {
        let material = |v: f32| Material {
            diffuse: [v, 0.5, 0.25, 0.75],
            specular: [0.5, v, 1.0, 1.0],
            shininess: 15.0 * v,
            ..Material::default()
        };
        let n = 2 * SHARE + 5;
        let positions: Vec<Vec3> =
            (0..n).map(|i| Vec3::new((i % 7) as f32 - 3.0, (i % 5) as f32 - 2.0, -4.0)).collect();
        let normals = (0..n).map(|i| [(i % 9) as f32 - 4.0, (i % 11) as f32 - 5.0, 1.0]).collect();
        let mut a = Attributes::constant(&CurrentAttributes::default());
        a.materials = vec![[material(1.0), material(0.5)]];
        a.normals = Values::PerVertex(normals);
        for two_side in [false, true] {
            let state = Snapshot {
                model_view: [
                    0.8, 0.1, 0., 0., -0.1, 0.9, 0., 0., 0., 0.2, 1.1, 0., 0.1, 0.2, -0.3, 1.,
                ],
                lighting: true,
                normalize: true,
                two_side,
                separate_specular: true,
                lights: vec![GlLight {
                    diffuse: [0.7; 4],
                    specular: [0.3; 4],
                    position: [0.3, 0.2, 1.0, 0.0],
                    spot_cutoff_deg: 180.0,
                    attenuation: [1.0, 0.0, 0.0],
                    ..GlLight::default()
                }],
                ..Snapshot::default()
            };
            let setup = LightingSetup::new(&state);
            let all = setup.all(&a, &positions);
            let mut dark = 0;
            for (i, lit) in all.iter().enumerate() {
                let one = setup.vertex(&a, i, positions[i].to_array());
                for side in 0..2 {
                    let (p, q) = (lit.primary[side], one.primary[side]);
                    let (s, t) = (lit.secondary[side], one.secondary[side]);
                    assert!(
                        p.iter().zip(q).all(|(a, b)| (a - b).abs() < 1e-5),
                        "{i}: {p:?} for {q:?}"
                    );
                    assert!(
                        s.iter().zip(t).all(|(a, b)| (a - b).abs() < 1e-5),
                        "{i}: {s:?} for {t:?}"
                    );
                    dark += usize::from(s == [0.0; 3]);
                }
            }
            assert!(
                (n / 10..2 * n - n / 10).contains(&dark),
                "the test is about nothing: {dark} of {n}"
            );
        }
    }
}
