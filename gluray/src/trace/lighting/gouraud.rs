//! Evaluates OpenGL's lighting at the corners of 16 fragments' triangles at a time. It vectorises
//! [`LightingSetup::vertex`].
//!
//! Sums keep the order of the scalar code. Vectors are written out, because compilers unroll loops
//! over 16 lanes before they recognise vectors. Only powers use another function. It is exact to a
//! millionth for exponents up to OpenGL's 128.

use super::LightingSetup;
use super::powers::powers;
use crate::capture::draw::{Attributes, PackedArray, Values};
use crate::enums::*;
use crate::state::material::{Material, sides};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16, mask32x16};
use rt_core::ray::LANES;

/// A number in each lane.
pub(super) type F = [f32; LANES];
pub(super) const ZERO: F = [0.0; LANES];
/// The same in registers.
type V<S> = f32x16<S>;

/// Colours of fragments, not yet clamped to bytes.
pub(crate) struct FragmentColors {
    pub(crate) rgba: [F; 4],
}

/// A side's material with what the colours replace.
struct Surface<S: Simd> {
    ambient: [V<S>; 3],
    diffuse: [V<S>; 3],
    specular: [V<S>; 3],
    emission: [V<S>; 3],
    alpha: V<S>,
    shininess: V<S>,
    /// The shininess of all lanes, where that is one whole number.
    whole: Option<u32>,
    /// There are highlights.
    shines: bool,
}

/// Which side each lane sees.
#[derive(Clone, Copy)]
struct SideSelect<S: Simd> {
    back: mask32x16<S>,
    /// Backs have a material of their own.
    two: bool,
}

impl<S: Simd> SideSelect<S> {
    /// A property of front and back, or the colour where that stands for it.
    #[inline(always)]
    fn of(&self, simd: S, values: [f32; 2], tracked: [bool; 2], color: V<S>) -> V<S> {
        let front = if tracked[0] { color } else { V::splat(simd, values[0]) };
        if !self.two {
            return front;
        }
        let behind = if tracked[1] { color } else { V::splat(simd, values[1]) };
        self.back.select(behind, front)
    }
}

#[inline(always)]
fn dot<S: Simd>(a: [V<S>; 3], b: [V<S>; 3]) -> V<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// From 0 to 1; not a number stays what it is.
#[inline(always)]
fn unit<S: Simd>(simd: S, v: V<S>) -> V<S> {
    let (zero, one) = (V::splat(simd, 0.0), V::splat(simd, 1.0));
    let v = v.simd_lt(zero).select(zero, v);
    v.simd_gt(one).select(one, v)
}

/// From 0 on; not a number is 0.
#[inline(always)]
fn positive<S: Simd>(simd: S, v: V<S>) -> V<S> {
    let zero = V::splat(simd, 0.0);
    v.simd_gt(zero).select(v, zero)
}

/// Unit length; zero stays zero.
#[inline(always)]
fn normalized<S: Simd>(simd: S, v: [V<S>; 3]) -> [V<S>; 3] {
    let square = dot(v, v);
    let one = V::splat(simd, 1.0);
    let inverse = square.simd_gt(V::splat(simd, 0.0)).select(one / square.sqrt(), one);
    [v[0] * inverse, v[1] * inverse, v[2] * inverse]
}

/// Primary and secondary colours.
pub(super) type LaneColors<S> = ([V<S>; 4], [V<S>; 3]);

/// An attribute of the vertices `corners` picks, lane by lane.
#[inline(always)]
fn gather<const N: usize>(values: &Values<N>, vertices: &[usize; LANES], used: u16) -> [F; N] {
    let mut out = [ZERO; N];
    let mut put = |l: usize, v: [f32; N]| {
        for k in 0..N {
            out[k][l] = v[k];
        }
    };
    match values {
        Values::Constant(v) => {
            for l in 0..LANES {
                put(l, *v);
            }
        }
        Values::PerVertex(all) => {
            for l in 0..LANES {
                if used >> l & 1 == 0 {
                    continue;
                }
                put(l, all.get(vertices[l]).copied().unwrap_or([0.0; N]));
            }
        }
        Values::Packed(p) if p.kind == FLOAT && p.size == N => {
            let all: &[[f32; N]] = rows(p);
            for l in 0..LANES {
                if used >> l & 1 == 0 {
                    continue;
                }
                put(l, all.get(vertices[l]).copied().unwrap_or([0.0; N]));
            }
        }
        Values::Packed(p) if p.kind == BYTE && p.size == N && p.normalized => {
            for l in 0..LANES {
                if used >> l & 1 == 0 {
                    continue;
                }
                if let Some(b) = p.bytes.get(vertices[l] * N..vertices[l] * N + N) {
                    put(
                        l,
                        std::array::from_fn(|k| (f32::from(b[k].cast_signed()) / 127.0).max(-1.0)),
                    );
                }
            }
        }
        Values::Packed(p) if p.kind == UNSIGNED_BYTE && p.size == N && p.normalized => {
            for l in 0..LANES {
                if used >> l & 1 == 0 {
                    continue;
                }
                if let Some(b) = p.bytes.get(vertices[l] * N..vertices[l] * N + N) {
                    put(l, std::array::from_fn(|k| f32::from(b[k]) / 255.0));
                }
            }
        }
        other => {
            for l in 0..LANES {
                if used >> l & 1 == 0 {
                    continue;
                }
                put(l, other.at(vertices[l]));
            }
        }
    }
    out
}

/// A packed array of floats as rows; empty when it is not aligned, which a `Vec` of bytes may be.
#[inline(always)]
fn rows<const N: usize>(p: &PackedArray) -> &[[f32; N]] {
    let floats: &[f32] = bytemuck::try_cast_slice(&p.bytes).unwrap_or(&[]);
    floats.as_chunks().0
}

impl LightingSetup<'_> {
    /// True when [`LightingSetup::fragments`] has the colours that the scalar code has.
    pub(crate) fn lights_blocks(&self, a: &Attributes) -> bool {
        let aligned = |p: &PackedArray| {
            p.kind != FLOAT || bytemuck::try_cast_slice::<u8, f32>(&p.bytes).is_ok()
        };
        let fits = match &a.normals {
            Values::Packed(p) => aligned(p),
            _ => true,
        };
        let colors_fit = match &a.colors {
            Values::Packed(p) => aligned(p),
            _ => true,
        };
        let s = self.state;
        fits && colors_fit && a.material_of.is_empty() && s.texture.is_none() && s.fog.is_none()
    }

    /// Colours of 16 fragments: `triangles` are their vertices, `weights` those of the corners,
    /// `back` says whose back side is seen.
    #[inline(always)]
    #[allow(clippy::too_many_arguments, reason = "rows of a block")]
    pub(crate) fn fragments<S: Simd>(
        &self,
        simd: S,
        a: &Attributes,
        positions: &[rt_core::glam::Vec3],
        triangles: &[[u32; 3]; LANES],
        weights: &[F; 3],
        back: &[bool; LANES],
        used: u16,
    ) -> FragmentColors {
        let zero = V::splat(simd, 0.0);
        let (mut primary, mut secondary) = ([zero; 4], [zero; 3]);
        let last = [ZERO, ZERO, [1.0; LANES]];
        let weights = if self.state.flat { &last } else { weights };
        let first = if self.state.flat { 2 } else { 0 };
        for k in first..3 {
            let mut vertices = [0; LANES];
            for l in 0..LANES {
                vertices[l] = triangles[l][k] as usize;
            }
            let (p, s) = self.vertices(simd, a, positions, &vertices, back, used);
            let weight = V::from_slice(simd, &weights[k]);
            for c in 0..4 {
                primary[c] += p[c] * weight;
            }
            for c in 0..3 {
                secondary[c] += s[c] * weight;
            }
        }
        let mut rgba = [ZERO; 4];
        for k in 0..3 {
            unit(simd, primary[k] + secondary[k]).store_slice(&mut rgba[k]);
        }
        primary[3].store_slice(&mut rgba[3]);
        FragmentColors { rgba }
    }

    /// Primary and secondary colours of the vertices in the lanes of `used`, from the side that
    /// `back` says.
    #[inline(always)]
    pub(super) fn vertices<S: Simd>(
        &self,
        simd: S,
        a: &Attributes,
        positions: &[rt_core::glam::Vec3],
        vertices: &[usize; LANES],
        back: &[bool; LANES],
        used: u16,
    ) -> LaneColors<S> {
        let s = self.state;
        let color = match &a.colors {
            Values::Constant(c) => [
                V::splat(simd, c[0]),
                V::splat(simd, c[1]),
                V::splat(simd, c[2]),
                V::splat(simd, c[3]),
            ],
            colors => {
                let rows = gather(colors, vertices, used);
                [
                    V::from_slice(simd, &rows[0]),
                    V::from_slice(simd, &rows[1]),
                    V::from_slice(simd, &rows[2]),
                    V::from_slice(simd, &rows[3]),
                ]
            }
        };
        let zero = V::splat(simd, 0.0);
        if !s.lighting {
            let [r, g, b, a] = color;
            return ([unit(simd, r), unit(simd, g), unit(simd, b), unit(simd, a)], [zero; 3]);
        }
        let mut eye = [zero; 3];
        if self.needs_places() {
            let mut rows = [ZERO; 3];
            for l in 0..LANES {
                if used >> l & 1 != 0 {
                    let p = positions[vertices[l]];
                    (rows[0][l], rows[1][l], rows[2][l]) = (p.x, p.y, p.z);
                }
            }
            let [x, y, z] = [
                V::from_slice(simd, &rows[0]),
                V::from_slice(simd, &rows[1]),
                V::from_slice(simd, &rows[2]),
            ];
            let m = &s.model_view;
            let w = x * m[3] + y * m[7] + z * m[11] + m[15];
            for k in 0..3 {
                eye[k] = (x * m[k] + y * m[4 + k] + z * m[8 + k] + m[12 + k]) / w;
            }
        }
        let mut normal = [zero; 3];
        let rows = gather(&a.normals, vertices, used);
        let [x, y, z] = [
            V::from_slice(simd, &rows[0]),
            V::from_slice(simd, &rows[1]),
            V::from_slice(simd, &rows[2]),
        ];
        let n = &self.normal_matrix;
        for k in 0..3 {
            normal[k] = x * n[0][k] + y * n[1][k] + z * n[2][k];
        }
        if s.normalize {
            normal = normalized(simd, normal);
        } else {
            for k in 0..3 {
                normal[k] *= self.rescale;
            }
        }
        let mut backs = 0;
        for l in 0..LANES {
            backs |= u64::from(back[l]) << l;
        }
        let pick = SideSelect {
            back: mask32x16::from_bitmask(simd, backs),
            two: s.two_side && backs != 0,
        };
        if pick.two {
            for k in 0..3 {
                normal[k] = pick.back.select(-normal[k], normal[k]);
            }
        }
        let surface = self.surface(simd, &a.materials[0], color, pick);
        self.lit(simd, &surface, eye, normal)
    }

    /// Where a vertex is counts for its light.
    #[inline(always)]
    fn needs_places(&self) -> bool {
        self.state.local_viewer || self.lights.iter().any(|p| !p.directional)
    }

    /// The material of the side that is seen, with what `glColorMaterial` takes from the colour.
    #[inline(always)]
    fn surface<S: Simd>(
        &self,
        simd: S,
        [front, behind]: &[Material; 2],
        color: [V<S>; 4],
        pick: SideSelect<S>,
    ) -> Surface<S> {
        let (faces, what) =
            self.state.color_material.map_or((&[][..], 0), |(face, w)| (sides(face), w));
        let faces = [faces.contains(&0), faces.contains(&1)];
        let by = |tracked: bool| [faces[0] && tracked, faces[1] && tracked];
        let ambient = by(what == AMBIENT || what == AMBIENT_AND_DIFFUSE);
        let diffuse = by(what == DIFFUSE || what == AMBIENT_AND_DIFFUSE);
        let (specular, emission) = (by(what == SPECULAR), by(what == EMISSION));
        let zero = V::splat(simd, 0.0);
        let mut out = Surface {
            ambient: [zero; 3],
            diffuse: [zero; 3],
            specular: [zero; 3],
            emission: [zero; 3],
            alpha: pick.of(simd, [front.diffuse[3], behind.diffuse[3]], diffuse, color[3]),
            shininess: pick.of(simd, [front.shininess, behind.shininess], [false; 2], zero),
            whole: (front.shininess == behind.shininess || !pick.two)
                .then_some(front.shininess)
                .and_then(whole),
            shines: what == SPECULAR
                || front.specular[..3] != [0.0; 3]
                || pick.two && behind.specular[..3] != [0.0; 3],
        };
        for k in 0..3 {
            out.ambient[k] =
                pick.of(simd, [front.ambient[k], behind.ambient[k]], ambient, color[k]);
            out.diffuse[k] =
                pick.of(simd, [front.diffuse[k], behind.diffuse[k]], diffuse, color[k]);
            out.specular[k] =
                pick.of(simd, [front.specular[k], behind.specular[k]], specular, color[k]);
            out.emission[k] =
                pick.of(simd, [front.emission[k], behind.emission[k]], emission, color[k]);
        }
        out
    }

    /// Primary and secondary colours.
    #[inline(always)]
    fn lit<S: Simd>(
        &self,
        simd: S,
        m: &Surface<S>,
        eye: [V<S>; 3],
        normal: [V<S>; 3],
    ) -> LaneColors<S> {
        let s = self.state;
        let (zero, one) = (V::splat(simd, 0.0), V::splat(simd, 1.0));
        let (mut primary, mut specular) = ([zero; 4], [zero; 3]);
        for k in 0..3 {
            primary[k] = m.emission[k] + m.ambient[k] * s.model_ambient[k];
        }
        for p in &self.lights {
            let at =
                |v: [f32; 3]| [V::splat(simd, v[0]), V::splat(simd, v[1]), V::splat(simd, v[2])];
            let (mut to_light, mut strength) = (at(p.to_light), one);
            if !p.directional {
                let [c, lin, q] = p.light.attenuation;
                let v = [to_light[0] - eye[0], to_light[1] - eye[1], to_light[2] - eye[2]];
                let d = dot(v, v).sqrt();
                let inverse = one / d;
                to_light = [v[0] * inverse, v[1] * inverse, v[2] * inverse];
                let faded = one / (V::splat(simd, c) + d * lin + d * d * q);
                strength = d.simd_eq(d).select(faded, zero);
            }
            if let Some((direction, cutoff)) = p.spot {
                let cosine = -dot(to_light, at(direction));
                let e = p.light.spot_exponent;
                let share = powers(simd, positive(simd, cosine), V::splat(simd, e), whole(e));
                let inside = cosine.simd_ge(V::splat(simd, cutoff));
                strength *= inside.select(share, zero);
            }
            let cosine = dot(normal, to_light);
            let faced = positive(simd, cosine) * strength;
            for k in 0..3 {
                let v = primary[k] + m.ambient[k] * p.light.ambient[k] * strength;
                primary[k] = v + m.diffuse[k] * p.light.diffuse[k] * faced;
            }
            if !m.shines || p.light.specular[..3] == [0.0; 3] {
                continue;
            }
            let half = if s.local_viewer {
                let towards = normalized(simd, eye);
                let half =
                    [to_light[0] - towards[0], to_light[1] - towards[1], to_light[2] - towards[2]];
                normalized(simd, half)
            } else if p.directional {
                at(p.half)
            } else {
                normalized(simd, [to_light[0], to_light[1], to_light[2] + one])
            };
            let h = positive(simd, dot(normal, half));
            let shine = powers(simd, h, m.shininess, m.whole) * strength;
            let shine = cosine.simd_gt(zero).select(shine, zero);
            for k in 0..3 {
                specular[k] += m.specular[k] * p.light.specular[k] * shine;
            }
        }
        if !s.separate_specular {
            for k in 0..3 {
                primary[k] += specular[k];
            }
            specular = [zero; 3];
        }
        primary[3] = m.alpha;
        for v in &mut primary {
            *v = unit(simd, *v);
        }
        for v in &mut specular {
            *v = unit(simd, *v);
        }
        (primary, specular)
    }
}

/// An exponent that is a whole number up to OpenGL's 128.
fn whole(e: f32) -> Option<u32> {
    ((0.0..=128.0).contains(&e) && e.fract() == 0.0).then_some(e as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::current_attributes::CurrentAttributes;
    use crate::state::snapshot::{GlLight, Snapshot};
    use fearless_simd::{Level, dispatch};
    use rt_core::glam::Vec3;

    /// Every kind of light, both sides, tracked colours, local viewer: blocks have the colours of
    /// single vertices.
    #[test]
    fn blocks_are_lit_like_single_vertices() {
        let material = |v: f32| Material {
            ambient: [0.2 * v, 0.1, 0.3, 1.0],
            diffuse: [v, 0.5, 0.25, 0.75],
            specular: [0.5, v, 1.0, 1.0],
            emission: [0.0, 0.05, 0.0, 1.0],
            shininess: 12.0 * v,
        };
        let light = |position: [f32; 4], cutoff: f32| GlLight {
            ambient: [0.1; 4],
            diffuse: [0.7, 0.6, 0.5, 1.0],
            specular: [0.3; 4],
            position,
            spot_direction: [0.0, 0.1, -1.0],
            spot_exponent: 3.0,
            spot_cutoff_deg: cutoff,
            attenuation: [1.0, 0.1, 0.01],
        };
        let positions: Vec<Vec3> = (0..48)
            .map(|i| Vec3::new((i % 7) as f32 - 3.0, (i % 5) as f32 - 2.0, -4.0 - (i % 3) as f32))
            .collect();
        let normals = (0..48).map(|i| {
            [((i * 5) % 9) as f32 - 4.0, ((i * 7) % 11) as f32 - 5.0, 1.0 + (i % 4) as f32]
        });
        let colors = (0..48).map(|i| [(i % 3) as f32 * 0.5, 0.25, (i % 2) as f32, 0.5]).collect();
        let mut a = Attributes::constant(&CurrentAttributes::default());
        a.materials = vec![[material(1.0), material(0.5)]];
        a.normals = Values::PerVertex(normals.collect());
        a.colors = Values::PerVertex(colors);
        let mut compared = 0;
        for case in 0..64 {
            let state = Snapshot {
                model_view: [
                    0.8, 0.1, 0., 0., -0.1, 0.9, 0., 0., 0., 0.2, 1.1, 0., 0.1, 0.2, -0.3, 1.,
                ],
                lighting: case & 1 == 0,
                two_side: case & 2 != 0,
                local_viewer: case & 4 != 0,
                separate_specular: case & 8 != 0,
                color_material: (case & 16 != 0).then_some((FRONT, AMBIENT_AND_DIFFUSE)),
                normalize: case & 32 != 0,
                model_ambient: [0.2; 4],
                lights: vec![light([0.3, 0.2, 1.0, 0.0], 180.0), light([1.0, 2.0, 0.0, 1.0], 40.0)],
                ..Snapshot::default()
            };
            let setup = LightingSetup::new(&state);
            assert!(setup.lights_blocks(&a));
            let triangles: [[u32; 3]; LANES] =
                std::array::from_fn(|l| [l as u32, l as u32 + 16, l as u32 + 32]);
            let weights = [[0.2; LANES], [0.3; LANES], [0.5; LANES]];
            let back = std::array::from_fn(|l| l % 3 == 0);
            let all = dispatch!(Level::new(), simd => setup.fragments(simd, &a, &positions, &triangles, &weights, &back, u16::MAX));
            for l in 0..LANES {
                let side = usize::from(back[l] && state.lighting && state.two_side);
                let mut wanted = [0.0; 4];
                for (k, w) in [0.2, 0.3, 0.5].into_iter().enumerate() {
                    let i = triangles[l][k] as usize;
                    let lit = setup.vertex(&a, i, positions[i].to_array());
                    for c in 0..4 {
                        wanted[c] += w * lit.primary[side][c]
                            + if c < 3 { w * lit.secondary[side][c] } else { 0.0 };
                    }
                }
                for c in 0..4 {
                    let (ours, one) = (all.rgba[c][l], wanted[c].clamp(0.0, 1.0));
                    assert!(
                        (ours - one).abs() < 1e-5,
                        "case {case}, lane {l}, {c}: {ours} for {one}"
                    );
                    compared += 1;
                }
            }
        }
        assert_eq!(compared, 64 * 64);
    }
}
