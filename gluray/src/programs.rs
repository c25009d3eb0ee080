//! Programs with shaders: VTK's family (ParaView, PyVista, Slicer, VisIt, Mayavi) is recognised, all others are the driver's.
//!
//! VTK assembles its shaders from pieces. Here `main` of both shaders is taken apart into statements, and a program counts as recognised only
//! when every statement is one whose meaning is written down in `template`: a shader with anything else in it (picking, edges, depth peeling,
//! physically based materials) is left to the driver.

mod peeling;
mod template;
mod wire;

use crate::arrays::{Elements, Source, Taken, positions};
use crate::cache::Geometry;
use crate::capture::{Attributes, Draw, Shading, Values};
use crate::config::Mode;
use crate::context::Context;
use crate::decide::{self, Verdict};
use crate::effects::{Place, Visibility, vector};
use crate::enums::*;
use crate::lighting::{normalized, transform};
use crate::overrides::Look;
use crate::real::gl;
use crate::state::current::Current;
use crate::texturing::{self, Image};
use crate::trace::mixed;
use peeling::Peeling;
use rt_core::mesh::TriMesh;
use std::collections::HashMap;
use std::sync::Arc;
use template::{Colors, Peel, Template};

/// What colours a program's surface.
pub(crate) enum ProgramSkin<'a> {
    /// Uniforms.
    Constant,
    /// The vertices' colours, times this.
    PerVertex(f32),
    /// A colour map, times this.
    Map(&'a Image, f32),
}

/// A program whose picture we can make, with its uniforms at one draw.
#[derive(Debug, Clone)]
pub(crate) struct Recognised {
    pub(crate) clip_from_object: [f32; 16],
    pub(crate) view_from_object: [f32; 16],
    normal_matrix: [f32; 9],
    template: Template,
    pub(crate) ambient: [f32; 3],
    pub(crate) diffuse: [f32; 3],
    ambient_intensity: f32,
    diffuse_intensity: f32,
    pub(crate) specular: [f32; 3],
    pub(crate) specular_power: f32,
    pub(crate) opacity: f32,
    parallel: bool,
    overrides: bool,
    /// Direction of travel and colour.
    pub(crate) lights: Vec<([f32; 3], [f32; 3])>,
    map: Option<Arc<Image>>,
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Recognised {
    /// The uniforms now.
    fn query(program: u32, template: Template, map: Option<Arc<Image>>) -> Recognised {
        fn value<const N: usize>(program: u32, name: &str) -> [f32; N] {
            match gl::uniform_location(program, name) {
                -1 => [0.0; N],
                at => gl::uniform_f(program, at),
            }
        }
        let one = |name: &str| value::<1>(program, name)[0];
        let flag = |name: &str| match gl::uniform_location(program, name) {
            -1 => false,
            at => gl::uniform_i::<1>(program, at)[0] != 0,
        };
        let intensity = one("specularIntensity");
        let lights = match template.headlight {
            true => vec![([0.0, 0.0, -1.0], value(program, "lightColor0"))],
            false => (0..template.directional)
                .map(|i| {
                    (
                        value(program, &format!("lightDirectionVC{i}")),
                        value(program, &format!("lightColor{i}")),
                    )
                })
                .collect(),
        };
        Recognised {
            clip_from_object: value(program, "MCDCMatrix"),
            view_from_object: value(program, "MCVCMatrix"),
            normal_matrix: value(program, "normalMatrix"),
            template,
            ambient: value(program, "ambientColorUniform"),
            diffuse: value(program, "diffuseColorUniform"),
            ambient_intensity: one("ambientIntensity"),
            diffuse_intensity: one("diffuseIntensity"),
            specular: value::<3>(program, "specularColorUniform").map(|v| v * intensity),
            specular_power: one("specularPowerUniform"),
            opacity: one("opacityUniform"),
            parallel: flag("cameraParallel"),
            overrides: template.overrides && flag("OverridesColor"),
            lights,
            map,
        }
    }

    /// One colour everywhere, instead of colour maps and colours of vertices.
    pub(crate) fn paint(&mut self, color: [f32; 3]) {
        (self.ambient, self.diffuse) = (color, color);
        self.template.colors = Colors::Uniform;
    }

    /// Where the lights are, in eye space.
    pub(crate) fn places(&self) -> Vec<Place> {
        self.lights.iter().map(|(d, _)| Place::Far(vector(d.map(|v| -v)))).collect()
    }

    /// True when every fragment has alpha 1.
    pub(crate) fn is_opaque(&self, attributes: &Attributes, vertices: usize) -> bool {
        self.opacity == 1.0
            && match self.template.colors {
                Colors::Uniform => true,
                Colors::Map => self.map.as_ref().is_some_and(|m| m.is_opaque()),
                Colors::PerVertex => (0..vertices).all(|i| attributes.colors.at(i)[3] == 1.0),
            }
    }

    /// Colour and alpha of vertices or the colour map; `None` for the uniforms' colours.
    fn own_color(&self, a: &Attributes, corners: [usize; 3], w: [f32; 3]) -> (Option<[f32; 3]>, f32) {
        match self.template.colors {
            _ if self.overrides => (None, 1.0),
            Colors::Uniform => (None, 1.0),
            Colors::PerVertex => {
                let [r, g, b, alpha] = mixed(corners.map(|i| a.colors.at(i)), w);
                (Some([r, g, b]), alpha)
            }
            Colors::Map => {
                let [s, t, ..] = mixed(corners.map(|i| a.tex.at(i)), w);
                let [r, g, b, alpha] = self.map.as_ref().map_or([1.0; 4], |m| m.sample(s, t));
                (Some([r, g, b]), alpha)
            }
        }
    }

    /// Diffuse colour with its coefficient, and opacity.
    pub(crate) fn base(&self, a: &Attributes, mesh: &TriMesh, prim: usize, w: [f32; 3]) -> ([f32; 3], f32) {
        let (own, alpha) = self.own_color(a, mesh.indices[prim].map(|i| i as usize), w);
        let unlit = if self.template.lit { 0.0 } else { self.ambient_intensity };
        let color: [f32; 3] = match own {
            Some(c) => c.map(|v| v * (self.diffuse_intensity + unlit)),
            None => {
                std::array::from_fn(|k| self.diffuse[k] * self.diffuse_intensity + self.ambient[k] * unlit)
            }
        };
        (color, alpha * self.opacity)
    }

    /// Where colours come from, with the factor on them.
    pub(crate) fn skin(&self) -> ProgramSkin<'_> {
        let unlit = if self.template.lit { 0.0 } else { self.ambient_intensity };
        let factor = self.diffuse_intensity + unlit;
        match (self.template.colors, &self.map) {
            (Colors::PerVertex, _) if !self.overrides => ProgramSkin::PerVertex(factor),
            (Colors::Map, Some(map)) if !self.overrides => ProgramSkin::Map(map, factor),
            _ => ProgramSkin::Constant,
        }
    }

    /// True when the surface answers lights.
    pub(crate) fn is_lit(&self) -> bool {
        self.template.lit
    }

    /// True when a single light at the eye is all there is (VTK then makes highlights by N·L).
    pub(crate) fn has_headlight(&self) -> bool {
        self.template.headlight
    }

    /// The part of the light that no light has to send.
    pub(crate) fn ambient_light(&self) -> [f32; 3] {
        self.ambient.map(|v| v * self.ambient_intensity)
    }

    /// Eye space from the normals of vertices; `None` where triangles have none but their own.
    pub(crate) fn eye_from_normal(&self) -> Option<&[f32; 9]> {
        (!self.template.flat).then_some(&self.normal_matrix)
    }

    /// Shading normal in eye space.
    pub(crate) fn smooth_normal(&self, a: &Attributes, mesh: &TriMesh, prim: usize, w: [f32; 3]) -> [f32; 3] {
        let corners = mesh.indices[prim].map(|i| i as usize);
        match self.eye_from_normal() {
            Some(m) => {
                let each = corners.map(|i| {
                    let n = a.normals.at(i);
                    std::array::from_fn(|r| m[r] * n[0] + m[3 + r] * n[1] + m[6 + r] * n[2])
                });
                normalized(mixed(each, w))
            }
            // The triangle's own decides.
            None => [0.0; 3],
        }
    }

    /// The fragment's colour, as the shader computes it.
    pub(crate) fn color(
        &self,
        a: &Attributes,
        mesh: &TriMesh,
        prim: usize,
        w: [f32; 3],
        front: bool,
        reaches: &Visibility,
    ) -> [f32; 4] {
        let corners = mesh.indices[prim].map(|i| i as usize);
        let (surface, alpha) = self.own_color(a, corners, w);
        let ambient = surface.unwrap_or(self.ambient).map(|v| v * self.ambient_intensity);
        let diffuse = surface.unwrap_or(self.diffuse).map(|v| v * self.diffuse_intensity);
        let alpha = alpha * self.opacity;
        if !self.template.lit {
            return [ambient[0] + diffuse[0], ambient[1] + diffuse[1], ambient[2] + diffuse[2], alpha];
        }
        let view = corners.map(|i| {
            let v = transform(&self.view_from_object, mesh.positions[i].to_array());
            [v[0], v[1], v[2]]
        });
        let at = mixed(view, w);
        let normal = if self.template.flat {
            let e = |k: usize| -> [f32; 3] { std::array::from_fn(|c| view[k][c] - view[0][c]) };
            let (p, q) = (e(1), e(2));
            let n =
                normalized([p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]);
            let away = if self.parallel { n[2] < 0.0 } else { dot(n, at) > 0.0 };
            if away { n.map(|v| -v) } else { n }
        } else {
            let m = &self.normal_matrix;
            let each = corners.map(|i| {
                let n = a.normals.at(i);
                std::array::from_fn(|r| m[r] * n[0] + m[3 + r] * n[1] + m[6 + r] * n[2])
            });
            let n = normalized(mixed(each, w));
            if front { n } else { n.map(|v| -v) }
        };
        let mut lit = [0.0; 3];
        let mut shine = [0.0; 3];
        if self.template.headlight {
            let df = normal[2].max(0.000_001) * reaches.lights[0];
            let sf = df.powf(self.specular_power);
            for k in 0..3 {
                lit[k] = df * self.lights[0].1[k];
                shine[k] = sf * self.lights[0].1[k];
            }
        } else {
            let to_eye = normalized(at.map(|v| -v));
            for ((direction, color), visible) in self.lights.iter().zip(&reaches.lights) {
                let color = color.map(|c| c * visible);
                let cosine = -dot(normal, *direction);
                if cosine <= 0.0 {
                    continue;
                }
                // reflect(I, N) = I - 2 (N . I) N
                let r: [f32; 3] = std::array::from_fn(|k| direction[k] + 2.0 * cosine * normal[k]);
                let sf = dot(r, to_eye).max(1e-5).powf(self.specular_power);
                for k in 0..3 {
                    lit[k] += cosine * color[k];
                    shine[k] += sf * color[k];
                }
            }
        }
        let out: [f32; 3] = std::array::from_fn(|k| {
            ambient[k] * reaches.ambient + diffuse[k] * lit[k] + self.specular[k] * shine[k]
        });
        [out[0], out[1], out[2], alpha]
    }
}

/// Which buffers a draw reads: while none was written, what was made of them serves again.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct Key {
    sources: [Option<Source>; 4],
    elements: (u32, usize, usize, u32, usize),
    /// When each of them was written last.
    written: [u64; 5],
}

/// The programs of a context.
#[derive(Default)]
pub(crate) struct Programs {
    templates: HashMap<u32, Result<Template, &'static str>>,
    made: HashMap<Key, Made>,
    frame: u64,
    pub(crate) peeling: Peeling,
}

/// What was made of a draw's buffers, and the frame that used it last.
struct Made {
    geometry: Arc<Geometry>,
    attributes: Arc<Attributes>,
    used: u64,
}

impl Programs {
    /// A frame is over: what no draw asked for goes.
    pub(crate) fn frame_done(&mut self) {
        const KEPT_FRAMES: u64 = 3;
        self.frame += 1;
        let now = self.frame;
        self.made.retain(|_, m| now - m.used <= KEPT_FRAMES);
    }
}

/// A generic attribute's array by name; `None` when the program has no such attribute or its array is off.
pub(crate) fn attribute(program: u32, name: &str) -> Option<Source> {
    let at = u32::try_from(gl::attrib_location(program, name)).ok()?;
    let get = |what| gl::vertex_attrib_i::<1>(at, what)[0];
    (get(VERTEX_ATTRIB_ARRAY_ENABLED) != 0).then(|| Source {
        size: get(VERTEX_ATTRIB_ARRAY_SIZE).max(0) as usize,
        kind: get(VERTEX_ATTRIB_ARRAY_TYPE).cast_unsigned(),
        stride: get(VERTEX_ATTRIB_ARRAY_STRIDE).max(0) as usize,
        address: gl::vertex_attrib_address(at),
        buffer: get(VERTEX_ATTRIB_ARRAY_BUFFER_BINDING).cast_unsigned(),
        normalized: get(VERTEX_ATTRIB_ARRAY_NORMALIZED) != 0,
    })
}

impl Context {
    /// `glLinkProgram`: the shaders are attached now, and perhaps never again.
    pub(crate) fn link_program(&mut self, program: u32) -> bool {
        self.sync();
        gl::link_program(program);
        self.keep_errors();
        let (mut vertex, mut fragment, mut other) = (String::new(), String::new(), false);
        for shader in gl::attached(program) {
            match gl::shader_i::<1>(shader, 0x8b4f)[0].cast_unsigned() {
                VERTEX_SHADER => vertex = gl::source_of(shader),
                FRAGMENT_SHADER => fragment = gl::source_of(shader),
                _ => other = true,
            }
        }
        self.drop_errors();
        let template =
            if other { Err("a geometry or tessellation shader") } else { Template::read(&vertex, &fragment) };
        if template.is_err() && !other {
            self.prepare_probe(program);
            self.drop_errors();
        }
        self.programs.templates.insert(program, template);
        true
    }

    /// A draw with a program.
    pub(crate) fn take_program_arrays(
        &mut self,
        mode: u32,
        call: DrawCall,
        elements: impl FnOnce() -> Result<Elements, &'static str>,
    ) -> Result<Taken, &'static str> {
        let program = self.state.program;
        let template =
            self.programs.templates.get(&program).copied().unwrap_or(Err("a program linked before us"));
        if template.is_err() && self.config.settings.mode == Mode::Enhance && self.config.settings.enabled {
            return self.take_shape(mode, call, elements).map(|()| Taken::Shape);
        }
        let template = template?;
        self.peels(template.peel)?;
        let position = attribute(program, "vertexMC").ok_or("a program without positions")?;
        let sources = [
            Some(position),
            attribute(program, "normalMC"),
            attribute(program, "scalarColor"),
            // VTK 9.7 names the coordinates of colour maps apart from those of pictures.
            attribute(program, "tcoord").or_else(|| attribute(program, "colorTCoord")),
        ];
        if sources.iter().flatten().any(|s| s.buffer == 0) {
            return Err("a program with arrays in client memory");
        }
        let map = match template.colors {
            Colors::Map => Some(self.color_map(program)?),
            _ => None,
        };
        let recognised = Recognised::query(program, template, map);
        let key = Key {
            sources,
            elements: (mode, call.first, call.count, call.kind, call.at),
            written: self.writes().last(&sources, (call.first >> 32) as u32),
        };
        let now = self.programs.frame;
        let known = self.programs.made.get_mut(&key).map(|m| {
            m.used = now;
            (m.geometry.clone(), m.attributes.clone())
        });
        let (geometry, attributes) = match known {
            Some(known) => known,
            None => {
                let (geometry, attributes) = self.read_program_arrays(mode, &sources, elements)?;
                self.programs.made.retain(|k, _| (&k.sources, k.elements) != (&key.sources, key.elements));
                let made = Made { geometry: geometry.clone(), attributes: attributes.clone(), used: now };
                self.programs.made.insert(key, made);
                (geometry, attributes)
            }
        };
        self.cache.touch(&geometry);
        // VTK leaves blending on; without transparency it changes nothing.
        let mut state = (*self.state).clone();
        if template.peel == Peel::Layers {
            self.peeled_surface(&mut state)?;
            let clip_from_object = recognised.clip_from_object;
            let shading = Shading::Program(Arc::new(recognised));
            let (state, look) = (Arc::new(state), Look::default());
            self.take_peeled(Draw { geometry, attributes, state, shading, clip_from_object, calls: 1, look });
            return Ok(Taken::Traced);
        }
        if state.blend_is_over && recognised.is_opaque(&attributes, geometry.mesh.positions.len()) {
            state.blend = false;
        }
        let in_order = match decide::filled(&state, self.config.trace()) {
            Verdict::Pass(why) | Verdict::TraceIfOpaque(why) => return Err(why),
            v => v == Verdict::TraceInOrder,
        };
        if in_order {
            self.flush("a draw whose order matters");
        }
        self.end_batch();
        self.add_array_draw(geometry, attributes, Shading::Program(Arc::new(recognised)), in_order);
        Ok(Taken::Traced)
    }

    fn color_map(&mut self, program: u32) -> Result<Arc<Image>, &'static str> {
        let at = gl::uniform_location(program, "colortexture");
        let unit = if at < 0 { 0 } else { gl::uniform_i::<1>(program, at)[0].max(0) };
        let active = gl::word(ACTIVE_TEXTURE);
        gl::active_texture(TEXTURE0 + unit as u32);
        let name = gl::word(TEXTURE_BINDING_2D);
        let followed = texturing::followed(TEXTURE_2D);
        let image = self.presenter.images.get(TEXTURE_2D, name, self.texture_version);
        gl::active_texture(active);
        followed?;
        image.ok_or("a texture without an image")
    }

    fn read_program_arrays(
        &mut self,
        mode: u32,
        sources: &[Option<Source>; 4],
        elements: impl FnOnce() -> Result<Elements, &'static str>,
    ) -> Result<(Arc<Geometry>, Arc<Attributes>), &'static str> {
        let elements = elements()?;
        let (first, count) = elements.span();
        let read = |s: &Option<Source>| s.map(|s| s.read(first, count)).transpose();
        let [position, normal, color, tex] = sources;
        let positions = positions(&read(position)?.ok_or("a program without positions")?)?;
        let triangles = elements.triangles(mode, &elements.plain_split(self.state.first_vertex_provokes));
        let geometry = self.cache.of_indices(&positions, &triangles);
        let mut attributes = Attributes::constant(&Current::default());
        if let Some(p) = read(normal)? {
            attributes.normals = Values::Packed(Arc::new(p));
        }
        if let Some(p) = read(color)? {
            attributes.colors = Values::Packed(Arc::new(p));
        }
        if let Some(p) = read(tex)? {
            attributes.tex = Values::Packed(Arc::new(p));
        }
        Ok((geometry, Arc::new(attributes)))
    }
}

/// The arguments of a draw call, for its key.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DrawCall {
    pub(crate) first: usize,
    pub(crate) count: usize,
    pub(crate) kind: u32,
    pub(crate) at: usize,
}
