//! The colour of a fragment, step by step as VTK's shaders compute it: the surface's own colour,
//! back faces, edges, lights.

use super::program::{CellEdges, PbrMaterial, ProgramLight, VtkProgram};
use super::signature::{ActorTexture, ColorSource};
use crate::capture::draw::Attributes;
use crate::state::matrix::transform;
use crate::trace::lighting::normalized;
use crate::trace::mixed;
use crate::trace::occlusion::Visibility;
use rt_core::glam::Vec3;
use rt_core::mesh::TriMesh;
use rt_core::vtk_pbr::{Cosines, GAMMA, VtkPbr};

type V3 = [f32; 3];

/// The surface before lighting: colours with their coefficients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Surface {
    pub(super) ambient: V3,
    pub(super) diffuse: V3,
    pub(super) specular: V3,
    pub(super) power: f32,
    pub(super) alpha: f32,
}

/// The position of a fragment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FragmentSample {
    pub(crate) prim: usize,
    pub(crate) weights: V3,
    pub(crate) front: bool,
    /// The window's pixel that shows it, for primary rays.
    pub(crate) pixel: Option<(i32, i32)>,
    /// The number of texels of the actor's texture that the pixel covers, where it is known.
    pub(crate) texels: Option<f32>,
    /// The sample offset from the pixel centre.
    pub(crate) sample_offset: [f32; 2],
}

fn dot(a: V3, b: V3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `v` to a power. Whole ones are products, exact to the last bit or two.
fn raised(v: f32, power: f32) -> f32 {
    const MOST: f32 = 1024.0;
    match power.fract() == 0.0 && (1.0..=MOST).contains(&power) {
        true => f64::from(v).powi(power as i32) as f32,
        false => v.powf(power),
    }
}

fn mix(a: V3, b: V3, t: f32) -> V3 {
    std::array::from_fn(|k| a[k] * (1.0 - t) + b[k] * t)
}

impl ProgramLight {
    /// The direction from which its light arrives at a point, and its share there.
    fn reaching(&self, at: V3) -> (V3, f32) {
        let Some(lamp) = self.lamp else { return (self.direction, 1.0) };
        let away: V3 = std::array::from_fn(|k| at[k] - lamp.position[k]);
        let distance = dot(away, away).sqrt();
        let direction = normalized(away);
        let [constant, linear, quadratic] = lamp.attenuation;
        let mut share = 1.0 / (constant + linear * distance + quadratic * distance * distance);
        if lamp.cone_deg < 90.0 {
            let cosine = dot(direction, self.direction);
            share *= if cosine >= lamp.cone_deg.to_radians().cos() {
                cosine.powf(lamp.exponent)
            } else {
                0.0
            };
        }
        (direction, share)
    }
}

impl PbrMaterial {
    fn model(&self) -> VtkPbr {
        VtkPbr {
            metallic: self.metallic,
            roughness: self.roughness,
            base_reflectance: self.base,
            edge_tint: self.tint.into(),
            min_divisor: self.least_divisor,
        }
    }
}

impl CellEdges {
    /// The share of a fragment that edges cover. `corners` are the triangle's in clip space.
    fn share(&self, corners: [[f32; 4]; 3], at: &FragmentSample) -> f32 {
        let sides = self.sides.get(at.prim).copied().unwrap_or(7);
        let [vx, vy, vw, vh] = self.viewport;
        let p = corners.map(|c| {
            [(c[0] / c[3] * 0.5 + 0.5) * vw + vx, (c[1] / c[3] * 0.5 + 0.5) * vh + vy]
                .map(f64::from)
        });
        let cross =
            (p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) - (p[1][1] - p[0][1]) * (p[2][0] - p[0][0]);
        let turn = if cross < 0.0 { -1.0 } else { 1.0 };
        let [mx, my] = at.sample_offset.map(f64::from);
        let (px, py) = match at.pixel {
            Some((x, y)) => (f64::from(x) + 0.5 - mx, f64::from(y) + 0.5 - my),
            // At any position in a pixel, or in a mirror: where the eye would see it.
            None => {
                let [x, y, _, w] = mixed(corners, at.weights);
                (f64::from((x / w * 0.5 + 0.5) * vw + vx), f64::from((y / w * 0.5 + 0.5) * vh + vy))
            }
        };
        let mut nearest = f64::INFINITY;
        for i in 0..3 {
            let (a, b) = (p[i], p[(i + 1) % 3]);
            let along = [b[0] - a[0], b[1] - a[1]];
            let length = along[0].hypot(along[1]);
            let inward = [-along[1] * turn / length, along[0] * turn / length];
            let mut distance = inward[0] * (px - a[0]) + inward[1] * (py - a[1]);
            if sides & 1 << i == 0 {
                distance += f64::from(self.width);
            }
            nearest = nearest.min(distance);
        }
        ((0.5 + 0.5 * f64::from(self.width) - nearest) as f32).clamp(0.0, 1.0)
    }
}

impl VtkProgram {
    /// The colour and alpha of vertices, triangles or the colour map. No colour when the uniforms'
    /// colour is used.
    pub(super) fn own_color(
        &self,
        a: &Attributes,
        mesh: &TriMesh,
        prim: usize,
        w: [f32; 3],
    ) -> (Option<V3>, f32) {
        let corners = mesh.indices[prim].map(|i| i as usize);
        let [r, g, b, alpha] = match self.signature.colors {
            ColorSource::Uniform => return (None, 1.0),
            ColorSource::PerVertex => mixed(corners.map(|i| a.colors.at(i)), w),
            ColorSource::Map => {
                let [s, t] = mixed(corners.map(|i| self.map_coordinates(a, i)), w);
                self.map.as_ref().map_or([1.0; 4], |m| m.sample(s, t))
            }
            ColorSource::PerCell => self.map.as_ref().map_or([1.0; 4], |m| m.numbered(prim)),
        };
        (Some([r, g, b]).filter(|_| !self.overrides), alpha)
    }

    /// The surface of a fragment before lighting, step by step as in the shader.
    fn surface(
        &self,
        a: &Attributes,
        mesh: &TriMesh,
        at: &FragmentSample,
        picture: Option<[f32; 4]>,
    ) -> Surface {
        let mut surface = match self.back {
            Some(back) if !at.front => back,
            _ => {
                let (own, alpha) = self.own_color(a, mesh, at.prim, at.weights);
                let plain = |v: f32| if self.signature.linear { v.powf(GAMMA) } else { v };
                Surface {
                    ambient: own.unwrap_or(self.ambient).map(|v| plain(v * self.ambient_intensity)),
                    diffuse: own.unwrap_or(self.diffuse).map(|v| plain(v * self.diffuse_intensity)),
                    specular: self.specular,
                    power: self.specular_power,
                    alpha: alpha * self.opacity,
                }
            }
        };
        // The colour of a block replaces those of back faces and is not made linear.
        if self.overrides {
            surface.ambient = self.ambient.map(|v| v * self.ambient_intensity);
            surface.diffuse = self.diffuse.map(|v| v * self.diffuse_intensity);
        }
        if let Some(edges) = &self.edges {
            let corners =
                mesh.triangle(at.prim).map(|p| transform(&self.clip_from_object, p.to_array()));
            let line = edges.share(corners, at) * edges.opacity;
            surface.diffuse = mix(surface.diffuse, [0.0; 3], line);
            surface.ambient = mix(surface.ambient, edges.color, line);
        }
        if let (ActorTexture::Albedo | ActorTexture::AlbedoAlone, Some([r, g, b, alpha])) =
            (self.signature.actor_texture, picture)
        {
            let [x, y, z] = surface.diffuse;
            surface.diffuse = [x * r, y * g, z * b];
            surface.alpha = if self.signature.actor_texture == ActorTexture::Albedo {
                self.opacity * alpha
            } else {
                alpha
            };
        }
        surface
    }

    /// The position and normal of a fragment in eye space. Where nothing is `seen_from` there, the
    /// position of a smooth surface is left out.
    fn eye_point(
        &self,
        a: &Attributes,
        mesh: &TriMesh,
        at: &FragmentSample,
        seen_from: bool,
    ) -> (V3, V3) {
        let corners = mesh.indices[at.prim].map(|i| i as usize);
        let view = match seen_from || self.signature.flat {
            true => corners.map(|i| {
                let v = transform(&self.view_from_object, mesh.positions[i].to_array());
                [v[0], v[1], v[2]]
            }),
            false => [[0.0; 3]; 3],
        };
        let point = mixed(view, at.weights);
        let normal = if self.signature.flat {
            let e = |k: usize| -> V3 { std::array::from_fn(|c| view[k][c] - view[0][c]) };
            let (p, q) = (e(1), e(2));
            let n = normalized([
                p[1] * q[2] - p[2] * q[1],
                p[2] * q[0] - p[0] * q[2],
                p[0] * q[1] - p[1] * q[0],
            ]);
            let away = if self.parallel { n[2] < 0.0 } else { dot(n, point) > 0.0 };
            if away { n.map(|v| -v) } else { n }
        } else {
            let m = &self.normal_matrix;
            let each = corners.map(|i| {
                let n = a.normals.at(i);
                std::array::from_fn(|r| m[r] * n[0] + m[3 + r] * n[1] + m[6 + r] * n[2])
            });
            let n = normalized(mixed(each, at.weights));
            if at.front { n } else { n.map(|v| -v) }
        };
        (point, normal)
    }

    /// The fragment's colour, as the shader computes it.
    pub(crate) fn color(
        &self,
        a: &Attributes,
        mesh: &TriMesh,
        at: &FragmentSample,
        reaches: &Visibility,
    ) -> [f32; 4] {
        let picture = self.picture_at(a, mesh, at.prim, at.weights, at.texels);
        let s = self.surface(a, mesh, at, picture);
        let out = if !self.signature.lit {
            std::array::from_fn(|k| s.ambient[k] + s.diffuse[k])
        } else {
            let seen_from = self.physical.is_some()
                || s.specular != [0.0; 3]
                || self.lights.iter().any(|l| l.lamp.is_some());
            let (point, normal) = self.eye_point(a, mesh, at, seen_from);
            match &self.physical {
                Some(p) => self.physically_lit(p, &s, point, normal, reaches),
                None => self.lit(&s, point, normal, reaches),
            }
        };
        self.under_picture([out[0], out[1], out[2], s.alpha], picture, at.front)
    }

    fn lit(&self, s: &Surface, point: V3, normal: V3, reaches: &Visibility) -> V3 {
        // A power costs more than the rest of a light, and most surfaces have no highlights.
        let shines = s.specular != [0.0; 3];
        let highlight = |cosine: f32| if shines { raised(cosine, s.power) } else { 0.0 };
        let mut lit = [0.0; 3];
        let mut shine = [0.0; 3];
        if self.signature.headlight {
            let least = if self.signature.cosines_from_zero { 0.0 } else { 0.000_001 };
            let df = normal[2].max(least) * reaches.lights[0];
            let sf = highlight(df);
            for k in 0..3 {
                lit[k] = df * self.lights[0].color[k];
                shine[k] = sf * self.lights[0].color[k];
            }
        }
        // A light that the user has added to a headlight is treated like any other light.
        let others = &self.lights[usize::from(self.signature.headlight)..];
        let visible = &reaches.lights[usize::from(self.signature.headlight)..];
        let to_eye = normalized(point.map(|v| -v));
        let least = if self.signature.cosines_from_zero { 0.0 } else { 1e-5 };
        for (light, visible) in others.iter().zip(visible) {
            let (direction, share) = light.reaching(point);
            let color = light.color.map(|c| c * visible);
            let cosine = -dot(normal, direction);
            if cosine * share <= 0.0 {
                continue;
            }
            // reflect(I, N) = I - 2 (N . I) N
            let r: V3 = std::array::from_fn(|k| direction[k] + 2.0 * cosine * normal[k]);
            let sf = share * highlight(dot(r, to_eye).max(least));
            for k in 0..3 {
                lit[k] += cosine * share * color[k];
                shine[k] += sf * color[k];
            }
        }
        std::array::from_fn(|k| {
            s.ambient[k] * reaches.ambient + s.diffuse[k] * lit[k] + s.specular[k] * shine[k]
        })
    }

    fn physically_lit(
        &self,
        p: &PbrMaterial,
        s: &Surface,
        point: V3,
        normal: V3,
        reaches: &Visibility,
    ) -> V3 {
        let (model, albedo) = (p.model(), Vec3::from(s.diffuse));
        let to_eye = normalized(point.map(|v| -v));
        let cosines = |l: V3| Cosines::new(normal.into(), to_eye.into(), l.into());
        let mut sum = Vec3::ZERO;
        for (i, (light, visible)) in self.lights.iter().zip(&reaches.lights).enumerate() {
            let (cosines, share) = if self.signature.headlight && i == 0 {
                // Light, viewer and half vector are one.
                let n_v = cosines(to_eye).n_v;
                (Cosines { n_h: n_v, n_v, n_l: n_v, h_l: 1.0 }, 1.0)
            } else {
                let (direction, share) = light.reaching(point);
                (cosines(normalized(direction.map(|v| -v))), share)
            };
            let reflected = model.brdf(albedo, cosines);
            sum += Vec3::from(light.color) * (share * visible) * reflected * cosines.n_l;
        }
        sum.to_array().map(|v| v.powf(1.0 / GAMMA))
    }
}

#[cfg(test)]
mod tests {
    use super::super::program::PositionalLight;
    use super::*;
    use std::sync::Arc;

    #[test]
    fn lamps_lose_strength_with_distance_and_outside_of_their_cones() {
        let lamp = PositionalLight {
            position: [0.0; 3],
            attenuation: [0.5, 0.25, 0.0],
            cone_deg: 45.0,
            exponent: 2.0,
        };
        let light = ProgramLight { direction: [0.0, 0.0, -1.0], color: [1.0; 3], lamp: Some(lamp) };
        let (direction, share) = light.reaching([0.0, 0.0, -2.0]);
        assert_eq!((direction, share), ([0.0, 0.0, -1.0], 1.0));
        let (_, beside) = light.reaching([1.0, 0.0, -2.0]);
        let (distance, cosine) = (5.0_f32.sqrt(), 2.0 / 5.0_f32.sqrt());
        assert!((beside - cosine * cosine / (0.5 + 0.25 * distance)).abs() < 1e-6);
        assert_eq!(light.reaching([3.0, 0.0, -2.0]).1, 0.0, "outside of the cone");
        let far = ProgramLight { lamp: None, ..light };
        assert_eq!(far.reaching([3.0, 0.0, -2.0]), ([0.0, 0.0, -1.0], 1.0));
    }

    #[test]
    fn whole_powers_are_those_of_the_general_function() {
        for power in [1.0, 2.0, 7.0, 30.0, 100.0, 128.0, 1024.0, 0.5, 30.5] {
            for step in 0..=1000 {
                let v = step as f32 / 1000.0;
                let [ours, exact] = [f64::from(raised(v, power)), f64::from(v).powf(power.into())];
                assert!((ours - exact).abs() <= 2e-7 * exact + 1e-37, "{v} to {power}: {ours}");
            }
        }
    }

    #[test]
    fn lines_lie_along_the_sides_that_are_edges_of_cells() {
        let corners = [[-1.0, -1.0, 0.0, 1.0], [1.0, -1.0, 0.0, 1.0], [-1.0, 1.0, 0.0, 1.0]];
        let edges = |sides: u8| CellEdges {
            sides: Arc::new(vec![sides]),
            width: 1.0,
            color: [0.0; 3],
            opacity: 1.0,
            viewport: [0.0, 0.0, 20.0, 20.0],
        };
        let at = |x, y| FragmentSample {
            prim: 0,
            weights: [1.0, 0.0, 0.0],
            front: true,
            pixel: Some((x, y)),
            texels: None,
            sample_offset: [0.0; 2],
        };
        // Half a pixel from the lower side, far from the others.
        assert_eq!(edges(1).share(corners, &at(6, 0)), 0.5);
        assert_eq!(edges(2).share(corners, &at(6, 0)), 0.0, "that side is none");
        assert_eq!(edges(4).share(corners, &at(0, 6)), 0.5, "the third side is the left one");
        assert_eq!(edges(7).share(corners, &at(5, 5)), 0.0, "inside");
        // The same place by the corners' weights: 6.5 and 0.5 of 20.
        let weights = [0.65, 0.325, 0.025];
        let by_weights =
            edges(1).share(corners, &FragmentSample { pixel: None, weights, ..at(0, 0) });
        assert!((by_weights - 0.5).abs() < 1e-5, "{by_weights}");
    }
}
