//! Computes the colour of a fragment. It combines vertex colours, texture and fog, or evaluates
//! lighting at the fragment itself with the results of rays.

use crate::capture::draw::Shading;
use crate::classify::vtk::FragmentSample;
use crate::enums::*;
use crate::host::config::Mode;
use crate::state::matrix::transform;
use crate::state::snapshot::TextureUnit;
use crate::trace::lighting::VertexColors;
use crate::trace::occlusion::{Eye, RayScene, Visibility, vector};
use crate::trace::texturing;
use crate::trace::{Fragment, Prepared, mixed};
use rt_core::glam::{DVec3, Mat3};

impl Prepared<'_> {
    /// The eye-space position and shading normal of a fragment.
    fn eye_point(&self, prim: usize, w: [f32; 3]) -> ([f32; 3], [f32; 3]) {
        let mesh = &self.draw.geometry.mesh;
        let corners = mesh.indices[prim].map(|i| i as usize);
        let matrix = match &self.draw.shading {
            Shading::Fixed => &self.draw.state.model_view,
            Shading::Program(program) => &program.view_from_object,
        };
        let eye = corners.map(|i| {
            let v = transform(matrix, mesh.positions[i].to_array());
            [v[0] / v[3], v[1] / v[3], v[2] / v[3]]
        });
        let normal = |i: usize| self.lighting.eye_normal(self.draw.attributes.normals.at(i));
        let normal =
            if self.draw.state.flat { normal(corners[2]) } else { mixed(corners.map(normal), w) };
        (mixed(eye, w), crate::trace::lighting::normalized(normal))
    }

    /// The normal that lights a fragment: the shading normal, as long as the vertices' are. OpenGL
    /// lights with normals of any length unless it is told to normalise them (OpenGL 4.6
    /// compatibility profile, section 12.2.1), and longer ones are brighter. Interpolation alone
    /// would shorten those that diverge.
    fn lit_normal(&self, prim: usize, w: [f32; 3], normal: [f32; 3]) -> [f32; 3] {
        let corners = self.draw.geometry.mesh.indices[prim].map(|i| i as usize);
        let length = |i: usize| {
            let n = self.lighting.eye_normal(self.draw.attributes.normals.at(i));
            [n.iter().map(|v| v * v).sum::<f32>().sqrt()]
        };
        let [length] = match self.draw.state.flat {
            _ if self.draw.state.normalize => [1.0],
            true => length(corners[2]),
            false => mixed(corners.map(length), w),
        };
        normal.map(|v| v * length)
    }

    /// The matrix that takes normals from eye space to object space: the transposed model-view.
    pub(crate) fn normal_from_eye(&self) -> Mat3 {
        let m = crate::trace::occlusion::eye_from_object(self.draw);
        rt_core::glam::DMat3::from_mat4(m).transpose().as_mat3()
    }

    /// The shading normal in eye space, as the program gave it. Its length is arbitrary.
    pub(crate) fn smooth_normal(&self, prim: usize, w: [f32; 3]) -> [f32; 3] {
        match &self.draw.shading {
            Shading::Fixed => self.eye_point(prim, w).1,
            Shading::Program(program) => {
                program.smooth_normal(&self.draw.attributes, &self.draw.geometry.mesh, prim, w)
            }
        }
    }

    /// The colour of the surface without lighting: the diffuse colour with vertex colours and
    /// texture.
    pub(crate) fn base_color(&self, prim: usize, f: &Fragment) -> [f32; 4] {
        let mesh = &self.draw.geometry.mesh;
        let corners = mesh.indices[prim].map(|i| i as usize);
        let w = f.weights.map(|w| w as f32);
        if let Shading::Program(program) = &self.draw.shading {
            let (color, alpha) = program.base(&self.draw.attributes, mesh, prim, w);
            return [color[0], color[1], color[2], alpha];
        }
        let s = &*self.draw.state;
        let of = |i: usize| self.base_of_vertex(i);
        let mut color = if s.flat { of(corners[2]) } else { mixed(corners.map(of), w) };
        if let (Some(unit), Some(image)) = (&s.texture, &self.image) {
            let coords = corners.map(|i| self.texture_coordinates(unit, i));
            color = texturing::apply(unit, image, color, mixed(coords, w), None);
        }
        color
    }

    /// The diffuse colour of a fixed-function vertex.
    pub(crate) fn base_of_vertex(&self, i: usize) -> [f32; 4] {
        let (s, a) = (&*self.draw.state, &self.draw.attributes);
        let tracked =
            s.color_material.is_some_and(|(_, what)| matches!(what, DIFFUSE | AMBIENT_AND_DIFFUSE));
        let c = if s.lighting && !tracked { a.materials_at(i)[0].diffuse } else { a.colors.at(i) };
        c.map(|v| v.clamp(0.0, 1.0))
    }

    /// The texture coordinates of a fixed-function vertex.
    pub(crate) fn texture_coordinates(&self, unit: &TextureUnit, i: usize) -> [f32; 4] {
        let p = self.draw.geometry.mesh.positions[i].to_array();
        texturing::coordinates(unit, &self.draw.state, &self.draw.attributes, &self.lighting, i, p)
    }

    /// The number of texels of a texture of `size` that the fragment of triangle `prim` covers at a
    /// pixel. Returns `None` where the triangle's plane passes through the eye there.
    ///
    /// This follows the driver: differences within a quad of two by two pixels, from the upper left
    /// pixel to its neighbours.
    /// neighbours.
    fn footprint(
        &self,
        prim: usize,
        corners: [[f32; 4]; 3],
        size: [f32; 2],
        pixel: (i32, i32),
    ) -> Option<f32> {
        let s = &*self.draw.state;
        let (x, y) = (pixel.0 & !1, pixel.1);
        // Window rows are counted from the top.
        let (top, below) = match s.framebuffer {
            0 => {
                let height = s.window_height;
                let row = (height - 1 - y) & !1;
                (height - 1 - row, height - 2 - row)
            }
            _ => (y & !1, (y & !1) + 1),
        };
        let at = |x: i32, y: i32| {
            let w = self.weights_at(prim, x, y)?;
            Some(texturing::divided(mixed(corners, w)))
        };
        let (here, right, down) = (at(x, top)?, at(x + 1, top)?, at(x, below)?);
        let length = |to: [f32; 2]| {
            let d: [f32; 2] = std::array::from_fn(|k| (to[k] - here[k]) * size[k]);
            d[0].hypot(d[1])
        };
        Some(length(right).max(length(down)))
    }

    /// The colour that the mode gives a fragment.
    pub(crate) fn shaded(
        &self,
        prim: usize,
        f: &Fragment,
        mode: Mode,
        ray_scene: Option<&RayScene<'_>>,
        pixel: (i32, i32),
    ) -> [f32; 4] {
        let per_pixel = matches!(mode, Mode::Phong | Mode::Rich | Mode::Path);
        let lit = match &self.draw.shading {
            Shading::Fixed => self.draw.state.lighting,
            Shading::Program(_) => true,
        };
        if ray_scene.is_none() || !lit {
            return self.color(prim, f, per_pixel, &Visibility::FULL, Some(pixel));
        }
        let (eye, _) = self.eye_point(prim, f.weights.map(|w| w as f32));
        // Neither the origin nor the z axis of eye space: a program may place or turn the viewer
        // by the projection, or mirror the view by the model-view.
        let towards = match self.eye {
            Eye::Point(at, _) => at - vector(eye),
            Eye::Parallel(back) => back,
        };
        self.lit_from(prim, f, mode, ray_scene, (pixel, true), towards)
    }

    /// The same for a viewer who looks along `-towards` (in eye space).
    pub(crate) fn shaded_from(
        &self,
        prim: usize,
        f: &Fragment,
        mode: Mode,
        ray_scene: Option<&RayScene<'_>>,
        pixel: (i32, i32),
        towards: DVec3,
    ) -> [f32; 4] {
        self.lit_from(prim, f, mode, ray_scene, (pixel, false), towards)
    }

    /// For a pixel, the function also knows whether the eye sees the fragment there.
    fn lit_from(
        &self,
        prim: usize,
        f: &Fragment,
        mode: Mode,
        ray_scene: Option<&RayScene<'_>>,
        (pixel, seen): ((i32, i32), bool),
        towards: DVec3,
    ) -> [f32; 4] {
        let own = seen.then_some(pixel);
        let per_pixel = matches!(mode, Mode::Phong | Mode::Rich | Mode::Path);
        let lit = self.draw.state.lighting || matches!(self.draw.shading, Shading::Program(_));
        let (Some(ray_scene), true) = (ray_scene, lit) else {
            return self.color(prim, f, per_pixel, &Visibility::FULL, own);
        };
        // The plane of the triangle, turned to the viewer: what is in front of it is what the eye
        // sees.
        let weights = f.weights.map(|w| w as f32);
        let (eye, _) = self.eye_point(prim, weights);
        let at = |w| vector(self.eye_point(prim, w).0);
        let [a, b, c] = [at([1.0, 0.0, 0.0]), at([0.0, 1.0, 0.0]), at([0.0, 0.0, 1.0])];
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let normal = if normal.dot(towards) < 0.0 { -normal } else { normal };
        let reaches = ray_scene.visibility(
            vector(eye),
            normal,
            &self.light_positions,
            seen.then_some(self.eye),
            pixel,
        );
        if mode != Mode::Enhance {
            // Point lights at the eye cast no shadow that the eye could see. Corners dim all of
            // them equally.
            let mut r = reaches;
            r.lights.iter_mut().for_each(|l| *l *= 0.5 + 0.5 * reaches.ambient);
            return self.color(prim, f, per_pixel, &r, own);
        }
        let color = self.color(prim, f, per_pixel, &Visibility::FULL, own);
        let n = self.light_positions.len().clamp(1, crate::trace::occlusion::MOST_LIGHTS);
        let light = reaches.lights[..n].iter().sum::<f32>() / n as f32;
        let dim = (0.4 + 0.6 * light) * (0.3 + 0.7 * reaches.ambient);
        [color[0] * dim, color[1] * dim, color[2] * dim, color[3]]
    }

    /// The colour of OpenGL's lighting, computed at the vertices or at the fragment itself. `pixel`
    /// is the window pixel that shows the fragment, where the eye sees it.
    pub(crate) fn color(
        &self,
        prim: usize,
        f: &Fragment,
        per_pixel: bool,
        reaches: &Visibility,
        pixel: Option<(i32, i32)>,
    ) -> [f32; 4] {
        let mesh = &self.draw.geometry.mesh;
        let corners = mesh.indices[prim].map(|i| i as usize);
        if let Shading::Program(program) = &self.draw.shading {
            let picture = program.picture().filter(|image| image.needs_footprint());
            let texels = picture.zip(pixel).and_then(|(image, at)| {
                let coordinates =
                    corners.map(|i| program.picture_coordinates(&self.draw.attributes, i));
                self.footprint(prim, coordinates.map(|[s, t]| [s, t, 0.0, 1.0]), image.size(), at)
            });
            let at = FragmentSample {
                prim,
                weights: f.weights.map(|w| w as f32),
                front: f.front,
                pixel,
                texels,
                sample_offset: self.draw.state.sample_place,
            };
            return program.color(&self.draw.attributes, mesh, &at, reaches);
        }
        let s = &*self.draw.state;
        let side = usize::from(!f.front && s.lighting && s.two_side);
        let lit = corners.map(|i| match &self.lit {
            _ if per_pixel && s.lighting => VertexColors::default(),
            Some(all) => all[i],
            None => self.lighting.vertex(&self.draw.attributes, i, mesh.positions[i].to_array()),
        });
        let w = f.weights.map(|w| w as f32);
        let (mut color, secondary) = match s.flat {
            _ if per_pixel && s.lighting => {
                let (eye, normal) = self.eye_point(prim, w);
                let normal = self.lit_normal(prim, w, normal);
                let color = if s.flat {
                    self.draw.attributes.colors.at(corners[2])
                } else {
                    mixed(corners.map(|i| self.draw.attributes.colors.at(i)), w)
                };
                let materials = self.draw.attributes.materials_at(corners[2]);
                self.lighting.point(materials, color, eye, normal, !f.front, reaches)
            }
            true => (lit[2].primary[side], lit[2].secondary[side]),
            false => {
                (mixed(lit.map(|l| l.primary[side]), w), mixed(lit.map(|l| l.secondary[side]), w))
            }
        };
        if let (Some(unit), Some(image)) = (&s.texture, &self.image) {
            let coords = corners.map(|i| self.texture_coordinates(unit, i));
            let rho = pixel.filter(|_| image.needs_footprint());
            let [across, up] = image.size();
            let size = [across, if unit.target == TEXTURE_1D { 0.0 } else { up }];
            let rho = rho.and_then(|at| self.footprint(prim, coords, size, at));
            color = texturing::apply(unit, image, color, mixed(coords, w), rho);
        }
        for k in 0..3 {
            color[k] = (color[k] + secondary[k]).clamp(0.0, 1.0);
        }
        if let Some(fog) = &s.fog {
            let m = &s.model_view;
            let z = corners.map(|i| [transform(m, mesh.positions[i].to_array())[2].abs()]);
            let d = mixed(z, w)[0];
            let factor = crate::trace::path_tracing::fog::factor(fog, d);
            for k in 0..3 {
                color[k] = fog.color[k].clamp(0.0, 1.0) * (1.0 - factor) + color[k] * factor;
            }
        }
        color
    }
}
