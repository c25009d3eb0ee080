//! OpenGL's lighting at the corners of 16 fragments' triangles at a time: [`Setup::vertex`] for many.
//!
//! Every step is written as a plain loop over the lanes, which compilers turn into vector code (closures may become calls of code for the oldest
//! processors); the order of sums is that of the scalar code. Only powers are another function: exact to a millionth for exponents up to OpenGL's 128.

use super::Setup;
use super::powers::{power, powers};
use crate::capture::{Attributes, Packed, Values};
use crate::enums::*;
use crate::state::current::{Material, sides};
use rt_core::ray::LANES;

/// A number in each lane.
pub(super) type F = [f32; LANES];
pub(super) const ZERO: F = [0.0; LANES];

/// Colours of fragments, not yet clamped to bytes.
pub(crate) struct Colors {
    pub(crate) rgba: [F; 4],
}

/// One corner of each lane's triangle.
struct Corner {
    position: [F; 3],
    normal: [F; 3],
    color: [F; 4],
}

/// A side's material with what the colours replace.
struct Surface {
    ambient: [F; 3],
    diffuse: [F; 3],
    specular: [F; 3],
    emission: [F; 3],
    alpha: F,
    shininess: F,
    /// The shininess of all lanes, where that is one whole number.
    whole: Option<u32>,
    /// There are highlights.
    shines: bool,
}

/// Which side each lane sees.
struct Pick<'a> {
    back: &'a [bool; LANES],
    /// Backs have a material of their own.
    two: bool,
}

impl Pick<'_> {
    /// A property of front and back, or the colour where that stands for it.
    #[inline(always)]
    fn of(&self, values: [f32; 2], tracked: [bool; 2], color: &F) -> F {
        let mut out = if tracked[0] { *color } else { [values[0]; LANES] };
        if self.two {
            let behind = if tracked[1] { *color } else { [values[1]; LANES] };
            for l in 0..LANES {
                out[l] = if self.back[l] { behind[l] } else { out[l] };
            }
        }
        out
    }
}

#[inline(always)]
fn dot(a: &[F; 3], b: &[F; 3]) -> F {
    let mut out = ZERO;
    for l in 0..LANES {
        out[l] = a[0][l] * b[0][l] + a[1][l] * b[1][l] + a[2][l] * b[2][l];
    }
    out
}

/// From 0 to 1; not a number stays what it is.
#[inline(always)]
fn unit(v: f32) -> f32 {
    let v = if v < 0.0 { 0.0 } else { v };
    if v > 1.0 { 1.0 } else { v }
}

#[inline(always)]
fn units(v: &mut F) {
    for l in 0..LANES {
        v[l] = unit(v[l]);
    }
}

/// Unit length; zero stays zero.
#[inline(always)]
fn normalize(v: &mut [F; 3]) {
    for l in 0..LANES {
        let square = v[0][l] * v[0][l] + v[1][l] * v[1][l] + v[2][l] * v[2][l];
        let inverse = if square > 0.0 { 1.0 / square.sqrt() } else { 1.0 };
        v[0][l] *= inverse;
        v[1][l] *= inverse;
        v[2][l] *= inverse;
    }
}

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
                    put(l, std::array::from_fn(|k| (f32::from(b[k].cast_signed()) / 127.0).max(-1.0)));
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
fn rows<const N: usize>(p: &Packed) -> &[[f32; N]] {
    let floats: &[f32] = bytemuck::try_cast_slice(&p.bytes).unwrap_or(&[]);
    floats.as_chunks().0
}

impl Setup<'_> {
    /// True when [`Setup::fragments`] has the colours that the scalar code has.
    pub(crate) fn lights_blocks(&self, a: &Attributes) -> bool {
        let aligned = |p: &Packed| p.kind != FLOAT || bytemuck::try_cast_slice::<u8, f32>(&p.bytes).is_ok();
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

    /// Colours of 16 fragments: `triangles` are their vertices, `weights` those of the corners, `back` says whose back side is seen.
    #[inline(always)]
    pub(crate) fn fragments(
        &self,
        a: &Attributes,
        positions: &[rt_core::glam::Vec3],
        triangles: &[[u32; 3]; LANES],
        weights: &[F; 3],
        back: &[bool; LANES],
        used: u16,
    ) -> Colors {
        let mut primary = [ZERO; 4];
        let mut secondary = [ZERO; 3];
        let last = [ZERO, ZERO, [1.0; LANES]];
        let weights = if self.state.flat { &last } else { weights };
        let first = if self.state.flat { 2 } else { 0 };
        for k in first..3 {
            let mut vertices = [0; LANES];
            for l in 0..LANES {
                vertices[l] = triangles[l][k] as usize;
            }
            let (p, s) = self.vertices(a, positions, &vertices, back, used);
            for c in 0..4 {
                for l in 0..LANES {
                    primary[c][l] += p[c][l] * weights[k][l];
                }
            }
            for c in 0..3 {
                for l in 0..LANES {
                    secondary[c][l] += s[c][l] * weights[k][l];
                }
            }
        }
        for k in 0..3 {
            for l in 0..LANES {
                primary[k][l] = unit(primary[k][l] + secondary[k][l]);
            }
        }
        Colors { rgba: primary }
    }

    /// Primary and secondary colours of the vertices in the lanes of `used`, from the side that `back` says.
    #[inline(always)]
    pub(crate) fn vertices(
        &self,
        a: &Attributes,
        positions: &[rt_core::glam::Vec3],
        vertices: &[usize; LANES],
        back: &[bool; LANES],
        used: u16,
    ) -> ([F; 4], [F; 3]) {
        let mut corner = Corner {
            position: [ZERO; 3],
            normal: if self.state.lighting { gather(&a.normals, vertices, used) } else { [ZERO; 3] },
            color: gather(&a.colors, vertices, used),
        };
        if self.needs_places() {
            for l in 0..LANES {
                if used >> l & 1 != 0 {
                    let p = positions[vertices[l]];
                    (corner.position[0][l], corner.position[1][l], corner.position[2][l]) = (p.x, p.y, p.z);
                }
            }
        }
        self.corner(&corner, &a.materials[0], back)
    }

    /// Where a vertex is counts for its light.
    #[inline(always)]
    fn needs_places(&self) -> bool {
        let near = |p: &super::PreparedLight<'_>| !p.directional || p.spot.is_some();
        self.state.lighting && (self.state.local_viewer || self.lights.iter().any(near))
    }

    #[inline(always)]
    fn corner(&self, c: &Corner, materials: &[Material; 2], back: &[bool; LANES]) -> ([F; 4], [F; 3]) {
        let s = self.state;
        if !s.lighting {
            let mut out = c.color;
            for v in &mut out {
                units(v);
            }
            return (out, [ZERO; 3]);
        }
        let two = s.two_side && back.contains(&true);
        let m = &s.model_view;
        let mut eye = [ZERO; 3];
        if self.needs_places() {
            for l in 0..LANES {
                let p = [c.position[0][l], c.position[1][l], c.position[2][l]];
                let row = |r: usize| m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r];
                let w = row(3);
                (eye[0][l], eye[1][l], eye[2][l]) = (row(0) / w, row(1) / w, row(2) / w);
            }
        }
        let n = &self.normal_matrix;
        let mut normal = [ZERO; 3];
        for k in 0..3 {
            for l in 0..LANES {
                normal[k][l] = c.normal[0][l] * n[0][k] + c.normal[1][l] * n[1][k] + c.normal[2][l] * n[2][k];
            }
        }
        if s.normalize {
            normalize(&mut normal);
        } else {
            for v in &mut normal {
                for l in 0..LANES {
                    v[l] *= self.rescale;
                }
            }
        }
        if two {
            for v in &mut normal {
                for l in 0..LANES {
                    v[l] = if back[l] { -v[l] } else { v[l] };
                }
            }
        }
        let surface = self.surface(materials, &c.color, back, two);
        self.lit(&surface, &eye, &normal)
    }

    /// The material of the side that is seen, with what `glColorMaterial` takes from the colour.
    #[inline(always)]
    fn surface(
        &self,
        [front, behind]: &[Material; 2],
        color: &[F; 4],
        back: &[bool; LANES],
        two: bool,
    ) -> Surface {
        let (faces, what) = self.state.color_material.map_or((&[][..], 0), |(face, w)| (sides(face), w));
        let faces = [faces.contains(&0), faces.contains(&1)];
        let ambient = what == AMBIENT || what == AMBIENT_AND_DIFFUSE;
        let diffuse = what == DIFFUSE || what == AMBIENT_AND_DIFFUSE;
        let pick = Pick { back, two };
        let mut out = Surface {
            ambient: [ZERO; 3],
            diffuse: [ZERO; 3],
            specular: [ZERO; 3],
            emission: [ZERO; 3],
            alpha: ZERO,
            shininess: pick.of([front.shininess, behind.shininess], [false; 2], &ZERO),
            whole: (front.shininess == behind.shininess || !two)
                .then_some(front.shininess)
                .filter(|e| (0.0..=128.0).contains(e) && e.fract() == 0.0)
                .map(|e| e as u32),
            shines: what == SPECULAR
                || front.specular[..3] != [0.0; 3]
                || two && behind.specular[..3] != [0.0; 3],
        };
        for k in 0..3 {
            let by = |tracked: bool| faces.map(|f| f && tracked);
            out.ambient[k] = pick.of([front.ambient[k], behind.ambient[k]], by(ambient), &color[k]);
            out.diffuse[k] = pick.of([front.diffuse[k], behind.diffuse[k]], by(diffuse), &color[k]);
            out.specular[k] =
                pick.of([front.specular[k], behind.specular[k]], by(what == SPECULAR), &color[k]);
            out.emission[k] =
                pick.of([front.emission[k], behind.emission[k]], by(what == EMISSION), &color[k]);
        }
        let tracked = faces.map(|f| f && diffuse);
        out.alpha = pick.of([front.diffuse[3], behind.diffuse[3]], tracked, &color[3]);
        out
    }

    /// Primary and secondary colours.
    #[inline(always)]
    fn lit(&self, m: &Surface, eye: &[F; 3], normal: &[F; 3]) -> ([F; 4], [F; 3]) {
        let s = self.state;
        let mut primary = [ZERO; 4];
        let mut specular = [ZERO; 3];
        for k in 0..3 {
            for l in 0..LANES {
                primary[k][l] = m.emission[k][l] + m.ambient[k][l] * s.model_ambient[k];
            }
        }
        for p in &self.lights {
            let mut to_light = [ZERO; 3];
            let mut strength = [1.0; LANES];
            if p.directional {
                for k in 0..3 {
                    to_light[k] = [p.to_light[k]; LANES];
                }
            } else {
                let [c, lin, q] = p.light.attenuation;
                for l in 0..LANES {
                    let v = [0, 1, 2].map(|k| p.to_light[k] - eye[k][l]);
                    let d = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
                    let inverse = 1.0 / d;
                    (to_light[0][l], to_light[1][l], to_light[2][l]) =
                        (v[0] * inverse, v[1] * inverse, v[2] * inverse);
                    strength[l] = if d.is_nan() { 0.0 } else { 1.0 / (c + lin * d + q * d * d) };
                }
            }
            if let Some((direction, cutoff)) = p.spot {
                for l in 0..LANES {
                    let cosine = -(to_light[0][l] * direction[0]
                        + to_light[1][l] * direction[1]
                        + to_light[2][l] * direction[2]);
                    let inside = cosine >= cutoff;
                    strength[l] *= if inside { power(cosine, p.light.spot_exponent) } else { 0.0 };
                }
            }
            let cosine = dot(normal, &to_light);
            let mut half = [[p.half[0]; LANES], [p.half[1]; LANES], [p.half[2]; LANES]];
            if s.local_viewer {
                let mut towards = *eye;
                normalize(&mut towards);
                for k in 0..3 {
                    for l in 0..LANES {
                        half[k][l] = to_light[k][l] - towards[k][l];
                    }
                }
                normalize(&mut half);
            } else if !p.directional {
                half = to_light;
                for l in 0..LANES {
                    half[2][l] += 1.0;
                }
                normalize(&mut half);
            }
            for k in 0..3 {
                for l in 0..LANES {
                    let faced = cosine[l].max(0.0) * strength[l];
                    let v = primary[k][l] + m.ambient[k][l] * p.light.ambient[k] * strength[l];
                    primary[k][l] = v + m.diffuse[k][l] * p.light.diffuse[k] * faced;
                }
            }
            if m.shines && p.light.specular[..3] != [0.0; 3] {
                let mut h = dot(normal, &half);
                for l in 0..LANES {
                    h[l] = h[l].max(0.0);
                }
                let mut shine = powers(&h, &m.shininess, m.whole);
                for l in 0..LANES {
                    shine[l] = if cosine[l] > 0.0 { shine[l] * strength[l] } else { 0.0 };
                }
                for k in 0..3 {
                    for l in 0..LANES {
                        specular[k][l] += m.specular[k][l] * p.light.specular[k] * shine[l];
                    }
                }
            }
        }
        if !s.separate_specular {
            for k in 0..3 {
                for l in 0..LANES {
                    primary[k][l] += specular[k][l];
                }
            }
            specular = [ZERO; 3];
        }
        primary[3] = m.alpha;
        for v in &mut primary {
            units(v);
        }
        for v in &mut specular {
            units(v);
        }
        (primary, specular)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::current::Current;
    use crate::state::snapshot::{GlLight, Snapshot};
    use rt_core::glam::Vec3;

    /// Every kind of light, both sides, tracked colours, local viewer: blocks have the colours of single vertices.
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
        let normals =
            (0..48).map(|i| [((i * 5) % 9) as f32 - 4.0, ((i * 7) % 11) as f32 - 5.0, 1.0 + (i % 4) as f32]);
        let colors = (0..48).map(|i| [(i % 3) as f32 * 0.5, 0.25, (i % 2) as f32, 0.5]).collect();
        let mut a = Attributes::constant(&Current::default());
        a.materials = vec![[material(1.0), material(0.5)]];
        a.normals = Values::PerVertex(normals.collect());
        a.colors = Values::PerVertex(colors);
        let mut compared = 0;
        for case in 0..64 {
            let state = Snapshot {
                model_view: [0.8, 0.1, 0., 0., -0.1, 0.9, 0., 0., 0., 0.2, 1.1, 0., 0.1, 0.2, -0.3, 1.],
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
            let setup = Setup::new(&state);
            assert!(setup.lights_blocks(&a));
            let triangles: [[u32; 3]; LANES] =
                std::array::from_fn(|l| [l as u32, l as u32 + 16, l as u32 + 32]);
            let weights = [[0.2; LANES], [0.3; LANES], [0.5; LANES]];
            let back = std::array::from_fn(|l| l % 3 == 0);
            let all = setup.fragments(&a, &positions, &triangles, &weights, &back, u16::MAX);
            for l in 0..LANES {
                let side = usize::from(back[l] && state.lighting && state.two_side);
                let mut wanted = [0.0; 4];
                for (k, w) in [0.2, 0.3, 0.5].into_iter().enumerate() {
                    let i = triangles[l][k] as usize;
                    let lit = setup.vertex(&a, i, positions[i].to_array());
                    for c in 0..4 {
                        wanted[c] +=
                            w * lit.primary[side][c] + if c < 3 { w * lit.secondary[side][c] } else { 0.0 };
                    }
                }
                for c in 0..4 {
                    let (ours, one) = (all.rgba[c][l], wanted[c].clamp(0.0, 1.0));
                    assert!((ours - one).abs() < 1e-5, "case {case}, lane {l}, {c}: {ours} for {one}");
                    compared += 1;
                }
            }
        }
        assert_eq!(compared, 64 * 64);
    }
}
