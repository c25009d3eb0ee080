//! Programs with shaders: VTK's family (ParaView, PyVista, Slicer, VisIt, Mayavi) is recognised, all others are the driver's.
//!
//! VTK assembles its shaders from pieces. Here `main` of both shaders is taken apart into statements, and a program counts as recognised only
//! when every statement is one whose meaning is written down below: a shader with anything else in it (picking, edges, depth peeling,
//! physically based materials) is left to the driver.

use crate::arrays::{Elements, Source, Taken, positions};
use crate::cache::Geometry;
use crate::capture::{Attributes, Shading, Values};
use crate::config::Mode;
use crate::context::Context;
use crate::decide::{self, Verdict};
use crate::effects::{Place, Visibility, vector};
use crate::enums::*;
use crate::lighting::{normalized, transform};
use crate::real::gl;
use crate::state::current::Current;
use crate::texturing::{self, Image};
use crate::trace::mixed;
use rt_core::mesh::TriMesh;
use std::collections::HashMap;
use std::sync::Arc;

/// Where the surface's colour comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Colors {
    #[default]
    Uniform,
    /// Attribute `scalarColor`.
    PerVertex,
    /// Texture `colortexture` at attribute `tcoord`.
    Map,
}

/// What a program's text says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Template {
    colors: Colors,
    overrides: bool,
    /// Normals from the triangle instead of an attribute.
    flat: bool,
    headlight: bool,
    /// Number of directional lights.
    directional: usize,
    lit: bool,
}

const MOST_LIGHTS: usize = 6;

/// Statements of `main`, without blanks and comments; light numbers become `#`.
fn statements(source: &str) -> Option<Vec<String>> {
    let mut text = String::new();
    for line in source.lines() {
        let line = line.split("//").next().unwrap_or("");
        if !line.trim_start().starts_with('#') {
            text += line;
            text.push('\n');
        }
    }
    while let Some(start) = text.find("/*") {
        let end = text[start..].find("*/").map_or(text.len(), |e| start + e + 2);
        text.replace_range(start..end, " ");
    }
    let body = &text[text.find("void main")?..];
    let body = &body[body.find('{')? + 1..body.rfind('}')?];
    let squeezed: String = body.chars().filter(|c| !c.is_whitespace()).collect();
    Some(squeezed.split([';', '{', '}']).filter(|s| !s.is_empty()).map(str::to_owned).collect())
}

/// Light numbers out of a statement.
fn without_light(s: &str) -> (String, Option<usize>) {
    for name in ["lightDirectionVC", "lightColor"] {
        if let Some(at) = s.find(name) {
            let digit = s[at + name.len()..].chars().next().and_then(|c| c.to_digit(10));
            if let Some(d) = digit {
                let mut out = s.to_owned();
                for n in ["lightDirectionVC", "lightColor"] {
                    out = out.replace(&format!("{n}{d}"), n);
                }
                return (out, Some(d as usize));
            }
        }
    }
    (s.to_owned(), None)
}

impl Template {
    /// Reads the shaders; the error says why the program is not recognised.
    pub(crate) fn read(vertex: &str, fragment: &str) -> Result<Template, &'static str> {
        const NOT_VTK: &str = "a program that is not recognised";
        let (Some(vs), Some(fs)) = (statements(vertex), statements(fragment)) else { return Err(NOT_VTK) };
        let mut t = Template::default();
        for s in &vs {
            match s.as_str() {
                "normalVCVSOutput=normalMatrix*normalMC"
                | "tcoordVCVSOutput=tcoord"
                | "vertexColorVSOutput=scalarColor"
                | "vertexVCVSOutput=MCVCMatrix*vertexMC"
                | "gl_Position=MCDCMatrix*vertexMC" => {}
                _ => return Err(NOT_VTK),
            }
        }
        if !vs.iter().any(|s| s == "gl_Position=MCDCMatrix*vertexMC") {
            return Err(NOT_VTK);
        }
        for s in &fs {
            let (s, light) = without_light(s);
            match s.as_str() {
                "vec4vertexVC=vertexVCVSOutput"
                | "vec3fdx=dFdx(vertexVC.xyz)"
                | "vec3fdy=dFdy(vertexVC.xyz)"
                | "vec3specularColor=specularIntensity*specularColorUniform"
                | "floatspecularPower=specularPowerUniform"
                | "vec3ambientColor=ambientIntensity*ambientColorUniform"
                | "vec3diffuseColor=diffuseIntensity*diffuseColorUniform"
                | "floatopacity=opacityUniform"
                | "vec3normalVCVSOutput=normalize(normalVCVSOutput)"
                | "if(gl_FrontFacing==false)"
                | "normalVCVSOutput=-normalVCVSOutput"
                | "if(cameraParallel==1&&normalVCVSOutput.z<0.0)"
                | "if(cameraParallel==0&&dot(normalVCVSOutput,vertexVC.xyz)>0.0)"
                | "normalVCVSOutput=-1.0*normalVCVSOutput"
                | "floatdf"
                | "floatsf"
                | "vec3diffuse=vec3(0,0,0)"
                | "vec3specular=vec3(0,0,0)"
                | "if(fragOutput0.a<=0.0)"
                | "discard"
                | "diffuse=diffuse*diffuseColor"
                | "specular=specular*specularColor"
                | "diffuse+=(df*lightColor)"
                | "specular+=(sf*lightColor)"
                | "floatsf=pow(df,specularPower)"
                | "vec3diffuse=df*diffuseColor*lightColor"
                | "vec3specular=sf*specularColor*lightColor"
                | "sf=sign(df)*pow(max(1e-5,dot(reflect(lightDirectionVC,normalVCVSOutput),normalize(-vertexVC.xyz))),specularPower)" =>
                    {}
                "vec4texColor=texture(colortexture,tcoordVCVSOutput.st)" => t.colors = Colors::Map,
                "vec3ambientColor=ambientIntensity*texColor.rgb"
                | "vec3diffuseColor=diffuseIntensity*texColor.rgb"
                | "floatopacity=opacityUniform*texColor.a" => t.colors = Colors::Map,
                "vec3ambientColor=ambientIntensity*vertexColorVSOutput.rgb"
                | "vec3diffuseColor=diffuseIntensity*vertexColorVSOutput.rgb"
                | "floatopacity=opacityUniform*vertexColorVSOutput.a" => t.colors = Colors::PerVertex,
                "if(OverridesColor)" => t.overrides = true,
                "ambientColor=ambientColorUniform*ambientIntensity"
                | "diffuseColor=diffuseColorUniform*diffuseIntensity" => {}
                "vec3normalVCVSOutput=normalize(cross(fdx,fdy))" => t.flat = true,
                "floatdf=max(0.000001,normalVCVSOutput.z)" if light.is_none() => t.headlight = true,
                "df=max(0.0,dot(normalVCVSOutput,-lightDirectionVC))" => {
                    t.directional = t.directional.max(light.unwrap_or(0) + 1);
                }
                "fragOutput0=vec4(ambientColor+diffuse+specular,opacity)" => t.lit = true,
                "fragOutput0=vec4(ambientColor+diffuseColor,opacity)" => t.lit = false,
                _ => return Err(NOT_VTK),
            }
        }
        let one_kind = t.headlight != (t.directional > 0);
        if (t.lit && !one_kind) || t.directional > MOST_LIGHTS { Err(NOT_VTK) } else { Ok(t) }
    }
}

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
    fn is_opaque(&self, attributes: &Attributes, vertices: usize) -> bool {
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
        let position = attribute(program, "vertexMC").ok_or("a program without positions")?;
        let sources = [
            Some(position),
            attribute(program, "normalMC"),
            attribute(program, "scalarColor"),
            attribute(program, "tcoord"),
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
        let triangles = elements.triangles(mode, self.state.first_vertex_provokes, false);
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

#[cfg(test)]
mod tests {
    use super::*;

    const VERTEX: &str = "#version 150\nin vec4 vertexMC; // a comment\nvoid main()\n{\n  vertexVCVSOutput = MCVCMatrix * vertexMC;\n  gl_Position = MCDCMatrix * vertexMC;\n}\n";
    fn fragment(extra: &str) -> String {
        format!(
            "#version 150\n/* text */\nvoid main()\n{{\n vec4 vertexVC = vertexVCVSOutput;\n float opacity = opacityUniform;\n\
             vec3 normalVCVSOutput = normalize(normalVCVSOutput);\n if (gl_FrontFacing == false) {{ normalVCVSOutput = -normalVCVSOutput; }}\n\
             {extra}\n fragOutput0 = vec4(ambientColor + diffuse + specular, opacity);\n if (fragOutput0.a <= 0.0)\n {{\n discard;\n }}\n}}\n"
        )
    }

    #[test]
    fn headlights_and_light_kits_are_told_apart() {
        let head = Template::read(VERTEX, &fragment("float df = max(0.000001, normalVCVSOutput.z);"))
            .expect("known");
        assert!(head.headlight && head.lit && head.directional == 0);
        let kit = "df = max(0.0, dot(normalVCVSOutput, -lightDirectionVC0)); df = max(0.0, dot(normalVCVSOutput, -lightDirectionVC4));";
        assert_eq!(Template::read(VERTEX, &fragment(kit)).expect("known").directional, 5);
    }

    #[test]
    fn a_statement_that_is_not_known_makes_the_program_the_drivers() {
        let selector = "float df = max(0.000001, normalVCVSOutput.z); fragOutput0 = vec4(propID, 1.0);";
        assert!(Template::read(VERTEX, &fragment(selector)).is_err());
        assert!(Template::read("void main() { gl_Position = vec4(sin(t)); }", &fragment("")).is_err());
        assert!(Template::read(VERTEX, &fragment("")).is_err(), "lit, but by nothing that is known");
    }
}
