//! Evaluates OpenGL's lighting at a vertex (compatibility profile specification, section 12.2), in
//! f32 and in the order of Mesa's vertex programs.

mod gouraud;
mod powers;
mod vertices;

use crate::capture::draw::Attributes;
use crate::enums::*;
use crate::state::material::{Material, sides};
use crate::state::matrix::transform;
use crate::state::snapshot::{GlLight, Snapshot};
use crate::trace::occlusion::{LightPosition, Visibility, vector};

/// The clamped colours of a vertex: primary and secondary (separate specular), front and back.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct VertexColors {
    pub(crate) primary: [[f32; 4]; 2],
    pub(crate) secondary: [[f32; 3]; 2],
}

type V3 = [f32; 3];

fn dot(a: V3, b: V3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn add(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn scaled(a: V3, s: f32) -> V3 {
    a.map(|x| x * s)
}

pub(crate) fn normalized(a: V3) -> V3 {
    let l = dot(a, a);
    if l > 0.0 { scaled(a, 1.0 / l.sqrt()) } else { a }
}

/// The values that are equal for all vertices of a draw.
pub(crate) struct LightingSetup<'a> {
    state: &'a Snapshot,
    /// Inverse of the model-view's upper left, for normals; row by row of the transposed.
    normal_matrix: [[f32; 3]; 3],
    rescale: f32,
    lights: Vec<PreparedLight<'a>>,
}

struct PreparedLight<'a> {
    light: &'a GlLight,
    directional: bool,
    to_light: V3,
    half: V3,
    spot: Option<(V3, f32)>,
}

impl<'a> LightingSetup<'a> {
    pub(crate) fn new(state: &'a Snapshot) -> LightingSetup<'a> {
        let inverse = inverse_3(&state.model_view);
        // GL_RESCALE_NORMAL: one over the length of the third row of the inverse.
        let row = [inverse[2][0], inverse[2][1], inverse[2][2]];
        let rescale =
            if state.rescale_normal && !state.normalize { 1.0 / dot(row, row).sqrt() } else { 1.0 };
        let lights = state
            .lights
            .iter()
            .map(|light| {
                let p = light.position;
                let directional = p[3] == 0.0;
                let at = if directional {
                    [p[0], p[1], p[2]]
                } else {
                    [p[0] / p[3], p[1] / p[3], p[2] / p[3]]
                };
                let to_light = if directional { normalized(at) } else { at };
                let half = normalized(add(to_light, [0.0, 0.0, 1.0]));
                let spot = (light.spot_cutoff_deg != 180.0).then(|| {
                    (normalized(light.spot_direction), light.spot_cutoff_deg.to_radians().cos())
                });
                PreparedLight { light, directional, to_light, half, spot }
            })
            .collect();
        let rescale = if rescale.is_finite() { rescale } else { 1.0 };
        LightingSetup { state, normal_matrix: inverse, rescale, lights }
    }

    /// The eye-space normal that lighting uses.
    pub(crate) fn eye_normal(&self, n: V3) -> V3 {
        let m = &self.normal_matrix;
        // The transposed inverse: columns of the inverse are dotted with the normal.
        let e: V3 = std::array::from_fn(|c| n[0] * m[0][c] + n[1] * m[1][c] + n[2] * m[2][c]);
        if self.state.normalize { normalized(e) } else { scaled(e, self.rescale) }
    }

    /// The colours of vertex `i` at object-space position `p`.
    pub(crate) fn vertex(&self, attributes: &Attributes, i: usize, p: V3) -> VertexColors {
        let color = attributes.colors.at(i);
        if !self.state.lighting {
            let c = color.map(|v| v.clamp(0.0, 1.0));
            return VertexColors { primary: [c; 2], secondary: [[0.0; 3]; 2] };
        }
        let eye = transform(&self.state.model_view, p);
        let eye = [eye[0] / eye[3], eye[1] / eye[3], eye[2] / eye[3]];
        let normal = self.eye_normal(attributes.normals.at(i));
        let materials = attributes.materials_at(i);
        let full = &Visibility::FULL;
        let front = self.side(&self.tracked(&materials[0], 0, color), eye, normal, full);
        let back = match self.state.two_side {
            true => {
                self.side(&self.tracked(&materials[1], 1, color), eye, scaled(normal, -1.0), full)
            }
            false => front,
        };
        VertexColors { primary: [front.0, back.0], secondary: [front.1, back.1] }
    }

    /// The colours of a point that is lit by itself: primary and secondary. `normal` and `color`
    /// are interpolated. The normal is in eye space.
    pub(crate) fn point(
        &self,
        materials: &[Material; 2],
        color: [f32; 4],
        eye: V3,
        normal: V3,
        back: bool,
        reaches: &Visibility,
    ) -> ([f32; 4], V3) {
        let back = back && self.state.two_side;
        let (side, normal) = if back { (1, scaled(normal, -1.0)) } else { (0, normal) };
        self.side(&self.tracked(&materials[side], side, color), eye, normal, reaches)
    }

    /// The positions of the lights in eye space.
    pub(crate) fn light_positions(&self) -> Vec<LightPosition> {
        let place = |p: &PreparedLight<'_>| match p.directional {
            true => LightPosition::Directional(vector(p.to_light)),
            false => LightPosition::Positional(vector(p.to_light)),
        };
        self.lights.iter().map(place).collect()
    }

    /// The material, with the properties that GL_COLOR_MATERIAL takes from the colour.
    fn tracked(&self, m: &Material, side: usize, color: [f32; 4]) -> Material {
        let mut m = *m;
        if let Some((face, what)) = self.state.color_material
            && sides(face).contains(&side)
        {
            match what {
                AMBIENT => m.ambient = color,
                DIFFUSE => m.diffuse = color,
                SPECULAR => m.specular = color,
                EMISSION => m.emission = color,
                _ => (m.ambient, m.diffuse) = (color, color),
            }
        }
        m
    }

    fn side(&self, m: &Material, eye: V3, normal: V3, reaches: &Visibility) -> ([f32; 4], V3) {
        let rgb = |v: [f32; 4]| [v[0], v[1], v[2]];
        let times = |a: [f32; 4], b: [f32; 4]| [a[0] * b[0], a[1] * b[1], a[2] * b[2]];
        let mut primary = add(
            rgb(m.emission),
            scaled(times(m.ambient, self.state.model_ambient), reaches.ambient),
        );
        let mut specular = [0.0; 3];
        for (p, visible) in self.lights.iter().zip(&reaches.lights) {
            let (to_light, mut strength, distance) = if p.directional {
                (p.to_light, 1.0, 0.0)
            } else {
                let v = sub(p.to_light, eye);
                let d = dot(v, v).sqrt();
                let [c, l, q] = p.light.attenuation;
                (scaled(v, 1.0 / d), 1.0 / (c + l * d + q * d * d), d)
            };
            if let Some((direction, cutoff)) = p.spot {
                let cosine = -dot(to_light, direction);
                strength *=
                    if cosine < cutoff { 0.0 } else { power(cosine, p.light.spot_exponent) };
            }
            if strength == 0.0 || distance.is_nan() {
                continue;
            }
            primary =
                add(primary, scaled(times(m.ambient, p.light.ambient), strength * reaches.ambient));
            strength *= visible;
            let cosine = dot(normal, to_light);
            if cosine <= 0.0 {
                continue;
            }
            primary = add(primary, scaled(times(m.diffuse, p.light.diffuse), cosine * strength));
            let s = times(m.specular, p.light.specular);
            if s == [0.0; 3] {
                continue;
            }
            let half = match self.state.local_viewer {
                true => normalized(sub(to_light, normalized(eye))),
                false if p.directional => p.half,
                false => normalized(add(to_light, [0.0, 0.0, 1.0])),
            };
            let h = dot(normal, half).max(0.0);
            specular = add(specular, scaled(s, power(h, m.shininess) * strength));
        }
        let clamp3 = |v: V3| v.map(|x| x.clamp(0.0, 1.0));
        if !self.state.separate_specular {
            primary = add(primary, specular);
            specular = [0.0; 3];
        }
        let [r, g, b] = clamp3(primary);
        ([r, g, b, m.diffuse[3].clamp(0.0, 1.0)], clamp3(specular))
    }
}

fn power(x: f32, e: f32) -> f32 {
    if e == 0.0 { 1.0 } else { x.powf(e) }
}

/// The inverse of the upper left 3 x 3 of a column-major matrix, row by row. For a singular matrix
/// it is the identity (Mesa, too, then leaves normals unchanged).
fn inverse_3(m: &[f32; 16]) -> [[f32; 3]; 3] {
    let a = |r: usize, c: usize| f64::from(m[4 * c + r]);
    let cofactor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        a(r1, c1) * a(r2, c2) - a(r1, c2) * a(r2, c1)
    };
    let determinant: f64 = (0..3).map(|c| a(0, c) * cofactor(0, c)).sum();
    std::array::from_fn(|r| {
        std::array::from_fn(|c| match determinant {
            0.0 => f32::from(u8::from(r == c)),
            d => (cofactor(c, r) / d) as f32,
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::draw::Values;
    use crate::state::current_attributes::CurrentAttributes;

    const IDENTITY: [f32; 16] = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];

    fn lit(change: impl Fn(&mut Snapshot, &mut Attributes)) -> VertexColors {
        let mut material = Material {
            diffuse: [1.0, 0.5, 0.25, 0.5],
            specular: [1.0; 4],
            shininess: 2.0,
            ..Material::default()
        };
        material.ambient = [0.1, 0.1, 0.1, 1.0];
        let current = CurrentAttributes {
            normal: [0.0, 0.0, 1.0],
            color: [0.0, 1.0, 0.0, 1.0],
            tex: [0.0; 4],
            materials: [material; 2],
        };
        let mut attributes = Attributes::constant(&current);
        let light = GlLight {
            diffuse: [1.0; 4],
            position: [0.0, 0.0, 1.0, 0.0],
            spot_cutoff_deg: 180.0,
            attenuation: [1.0, 0.0, 0.0],
            ..GlLight::default()
        };
        let mut state = Snapshot {
            model_view: IDENTITY,
            projection: IDENTITY,
            lighting: true,
            lights: vec![light],
            model_ambient: [1.0; 4],
            ..Snapshot::default()
        };
        change(&mut state, &mut attributes);
        LightingSetup::new(&state).vertex(&attributes, 0, [0.0, 0.0, -2.0])
    }

    #[test]
    fn a_headlight_gives_ambient_and_diffuse() {
        let l = lit(|_, _| ());
        assert_eq!(l.primary[0], [1.0, 0.6, 0.35, 0.5]);
    }

    #[test]
    fn backs_are_lit_from_behind_when_both_sides_are() {
        let l = lit(|s, _| s.two_side = true);
        assert_eq!(l.primary[1], [0.1, 0.1, 0.1, 0.5], "the light is in front");
    }

    #[test]
    fn color_material_replaces_what_it_names() {
        let l = lit(|s, _| s.color_material = Some((FRONT_AND_BACK, DIFFUSE)));
        assert_eq!(l.primary[0], [0.1, 1.0, 0.1, 1.0]);
    }

    #[test]
    fn separate_highlights_stay_apart() {
        let l = lit(|s, _| {
            s.lights[0].specular = [0.5; 4];
            s.separate_specular = true;
        });
        assert_eq!(l.secondary[0], [0.5; 3]);
        assert_eq!(l.primary[0], [1.0, 0.6, 0.35, 0.5]);
    }

    #[test]
    fn a_scaled_model_view_shortens_normals_unless_they_are_rescaled() {
        let scale = |s: &mut Snapshot| {
            s.model_view = [2., 0., 0., 0., 0., 2., 0., 0., 0., 0., 2., 0., 0., 0., 0., 1.];
        };
        assert_eq!(lit(|s, _| scale(s)).primary[0][1], 0.5 * 0.5 + 0.1);
        for rescale in [true, false] {
            let l = lit(|s, _| {
                scale(s);
                (s.rescale_normal, s.normalize) = (rescale, !rescale);
            });
            assert!((l.primary[0][1] - 0.6).abs() < 1e-6, "rescale {rescale}: {l:?}");
        }
    }

    #[test]
    fn spots_are_dark_outside_of_their_cone() {
        let spot = |direction: [f32; 3]| {
            lit(|s, _| {
                let l = &mut s.lights[0];
                (l.position, l.spot_direction, l.spot_cutoff_deg, l.spot_exponent) =
                    ([0.0, 0.0, 0.0, 1.0], direction, 10.0, 4.0);
            })
        };
        assert_eq!(spot([0.0, 0.0, -1.0]).primary[0][0], 1.0);
        assert_eq!(spot([1.0, 0.0, -1.0]).primary[0][0], 0.1);
    }

    #[test]
    fn byte_normals_light_like_floats() {
        let l = lit(|_, a| {
            let packed = crate::capture::draw::PackedArray {
                bytes: vec![0, 0, 127],
                kind: BYTE,
                size: 3,
                normalized: true,
            };
            a.normals = Values::Packed(std::sync::Arc::new(packed));
        });
        assert_eq!(l.primary[0], [1.0, 0.6, 0.35, 0.5]);
    }
}
