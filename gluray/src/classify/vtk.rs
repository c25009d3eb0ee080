//! Programs with shaders. Those of VTK's family (ParaView, PyVista, Slicer, VisIt, Mayavi) are
//! recognised. The driver draws all others.
//!
//! VTK assembles its shaders from blocks. A program is recognised only when its sources consist of
//! such blocks, whose meaning `blocks` and `signature` describe, in VTK's order and with nothing
//! else among them. The driver draws with any other shader, for example for picking, for lights
//! from images, or after a script has replaced something.

mod actor_texture;
mod blocks;
mod cell_data;
mod codec;
mod color;
mod depth_peeling;
mod glsl;
mod glyphs;
mod program;
mod shadow_maps;
mod signature;
mod weighted_blending;

use crate::capture::draw::{Attributes, Draw, Shading, Values};
use crate::capture::geometry_cache::Geometry;
use crate::capture::vertex_arrays::{ArrayDrawOutcome, Instances, positions};
use crate::classify::rules::{self, Classification, TraceFilter};
use crate::driver::gl;
use crate::enums::*;
use crate::host::config::Mode;
use crate::interpose::client_memory::{ArraySource, Elements};
use crate::interpose::context::Context;
use crate::interpose::flush_reason::FlushReason;
use crate::interpose::kept_errors::KeptErrors;
use crate::state::current_attributes::CurrentAttributes;
use crate::state::texture_sampling;
use crate::trace::overrides::{self, RayMaterial};
use crate::trace::texturing::Image;
pub(crate) use color::FragmentSample;
use depth_peeling::DepthPeeling;
use glyphs::GlyphArrays;
use program::CellData;
pub(crate) use program::{ProgramColorSource, ProgramLight, VtkProgram};
use shadow_maps::ShadowMaps;
use signature::{ActorTexture, ColorSource, TranslucencyPass, VtkShaderSignature};
use std::collections::HashMap;
use std::sync::Arc;
use weighted_blending::WeightedBlending;

/// See [`crate::recognise`].
pub(crate) fn recognise(vertex: &str, geometry: &str, fragment: &str) -> Result<(), &'static str> {
    VtkShaderSignature::read(vertex, geometry, fragment).map(|_| ())
}

/// The buffers that a draw reads. Until one of them is written, the results are reused.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct DrawCacheKey {
    sources: Sources,
    glyphs: Option<GlyphArrays>,
    mode: u32,
    call: DrawCall,
    /// The number of the first triangle in buffer textures.
    first: i32,
    /// The numbers of their last writes.
    written: ([u64; 7], [u64; 3], u64),
}

/// Positions, normals, colours, texture coordinates; colours and edges of cells; coordinates of the
/// actor's texture where they are separate.
type Sources = [Option<ArraySource>; 7];

/// The programs of a context.
#[derive(Default)]
pub(crate) struct VtkPrograms {
    signatures: HashMap<u32, Result<VtkShaderSignature, &'static str>>,
    made: HashMap<DrawCacheKey, CachedDraw>,
    frame: u64,
    pub(crate) peeling: DepthPeeling,
    pub(crate) weighted: WeightedBlending,
    shadow_maps: ShadowMaps,
}

/// The data that was made of a draw's buffers, and the frame that used it last.
struct CachedDraw {
    geometry: Arc<Geometry>,
    attributes: Arc<Attributes>,
    cells: CellData,
    used: u64,
}

impl VtkPrograms {
    /// Ends a frame and drops what no draw used.
    pub(crate) fn frame_done(&mut self) {
        const KEPT_FRAMES: u64 = 3;
        self.frame += 1;
        let now = self.frame;
        self.made.retain(|_, m| now - m.used <= KEPT_FRAMES);
    }
}

/// The sources of a program's shaders, and whether it has shaders of other kinds.
#[derive(Default)]
struct AttachedSources {
    vertex: String,
    geometry: String,
    fragment: String,
    other: bool,
}

impl AttachedSources {
    fn query(program: u32) -> AttachedSources {
        let mut sources = AttachedSources::default();
        for shader in gl::attached(program) {
            match gl::shader_i::<1>(shader, SHADER_TYPE)[0].cast_unsigned() {
                VERTEX_SHADER => sources.vertex = gl::source_of(shader),
                FRAGMENT_SHADER => sources.fragment = gl::source_of(shader),
                GEOMETRY_SHADER => sources.geometry = gl::source_of(shader),
                _ => sources.other = true,
            }
        }
        sources
    }

    fn signature(&self) -> Result<VtkShaderSignature, &'static str> {
        match self.other {
            true => Err("a geometry or tessellation shader"),
            false => VtkShaderSignature::read(&self.vertex, &self.geometry, &self.fragment),
        }
    }

    fn is_vertex_and_fragment(&self) -> bool {
        !self.other && self.geometry.is_empty()
    }
}

/// The array of a generic attribute by name. `None` when the program has no such attribute or its
/// array is disabled.
pub(crate) fn attribute(program: u32, name: &str) -> Option<ArraySource> {
    let at = u32::try_from(gl::attrib_location(program, name)).ok()?;
    ArraySource::of_attribute(at)
}

impl Context {
    /// `glLinkProgram`: the shaders are attached now, perhaps for the last time.
    pub(crate) fn link_program(&mut self, program: u32) -> bool {
        self.attributes.sync();
        gl::link_program(program);
        let sources = self.errors.hiding(|| AttachedSources::query(program));
        let signature = sources.signature();
        if signature.is_err() && sources.is_vertex_and_fragment() {
            self.classifier.probes.prepare(program, &self.config.settings, &self.capabilities);
            KeptErrors::drop_ours();
        }
        self.classifier.programs.signatures.insert(program, signature);
        true
    }

    /// A draw with a program.
    pub(crate) fn take_program_arrays<'c>(
        &mut self,
        mode: u32,
        call: DrawCall,
        elements: impl FnOnce() -> Result<Elements<'c>, &'static str>,
    ) -> Result<ArrayDrawOutcome, &'static str> {
        if self.config.settings.enabled {
            self.check_presenter()?;
        }
        let program = self.state.snapshot.program;
        let signature = self
            .classifier
            .programs
            .signatures
            .get(&program)
            .copied()
            .unwrap_or(Err("a program linked before us"));
        if signature.is_err()
            && self.config.settings.mode == Mode::Enhance
            && self.config.settings.enabled
        {
            if call.instances.is_some() || call.draws != 1 {
                // Its shader may ask which copy or draw it is in.
                return Err("instances or several draws of a program that is not recognised");
            }
            return self.take_shape(mode, call, elements).map(|()| ArrayDrawOutcome::Shape);
        }
        if !matches!(signature, Ok(t) if t.peel != TranslucencyPass::No) {
            self.classifier.programs.is_drawn_once(&signature)?;
        }
        let signature = signature?;
        let numbers_cells = signature.colors == ColorSource::PerCell || signature.edges;
        if call.draws != 1 && numbers_cells {
            return Err("several draws in one call, with data of cells");
        }
        match (signature.glyphs, call.instances) {
            (true, Some(Instances { count: 1.., .. })) | (false, None) => {}
            (true, Some(_)) => return Err("no instances"),
            (true, None) => return Err("glyphs of VTK's without instances"),
            (false, Some(_)) => return Err("instances of a surface of VTK's"),
        }
        match signature.peel {
            TranslucencyPass::Weighted => weighted_blending::check_pass(
                &self.state.snapshot,
                &self.config.settings,
                self.capabilities.core,
            )?,
            pass => self.classifier.programs.peeling.check_pass(
                pass,
                &self.state.snapshot,
                &self.config.settings,
                self.counters.report.passed_draws,
            )?,
        }
        let position = attribute(program, "vertexMC").ok_or("a program without positions")?;
        let cells = |wanted: bool, sampler: &str| -> Result<Option<ArraySource>, &'static str> {
            wanted.then(|| cell_data::buffer_texture(program, sampler)).transpose()
        };
        let sources = [
            Some(position),
            attribute(program, "normalMC"),
            attribute(program, "scalarColor"),
            // VTK 9.7 separates the coordinates of colour maps from those of the actor's texture.
            attribute(program, "colorTCoord").or_else(|| attribute(program, "tcoord")),
            cells(signature.colors == ColorSource::PerCell, "textureC")?,
            cells(signature.edges, "edgeTexture")?,
            attribute(program, "tcoord").filter(|_| signature.two_coordinates),
        ];
        let glyphs =
            signature.glyphs.then(|| GlyphArrays::query(program, &signature)).transpose()?;
        let of_glyphs = glyphs.map_or([None; 3], |g| g.buffers());
        if sources.iter().chain(&of_glyphs).flatten().any(|s| s.buffer == 0) {
            return Err("a program with arrays in client memory");
        }
        let map = match signature.colors {
            ColorSource::Map => {
                Some(self.image_of(program, "colortexture", texture_sampling::check_sampling)?)
            }
            _ => None,
        };
        let picture = match signature.actor_texture {
            ActorTexture::No => None,
            over => Some(self.picture_of(program, over)?),
        };
        let recognised = VtkProgram::from_uniforms(program, signature, [map, picture]);
        let first = match gl::uniform_location(program, "PrimitiveIDOffset") {
            -1 => 0,
            at => gl::uniform_i::<1>(program, at)[0],
        };
        let key = DrawCacheKey {
            sources,
            glyphs,
            mode,
            call,
            first,
            written: {
                let writes = self.shared.writes();
                let of_glyphs = glyphs.map_or([None; 3], |g| g.buffers());
                let of_indices = writes.last_to((call.first >> 32) as u32);
                (writes.last(&sources), writes.last(&of_glyphs), of_indices)
            },
        };
        let now = self.classifier.programs.frame;
        let known = self.classifier.programs.made.get_mut(&key).map(|m| {
            m.used = now;
            (m.geometry.clone(), m.attributes.clone(), m.cells.clone())
        });
        let (geometry, attributes, cells) = match known {
            Some(known) => known,
            None => {
                let copies = glyphs.zip(call.instances);
                let (geometry, attributes) =
                    self.read_program_arrays(mode, &sources, copies, elements)?;
                let copies = call.instances.map_or(1, |i| i.count);
                let triangles = geometry.mesh.num_triangles() / copies;
                let cells = read_cells(&sources, first, triangles)?.repeated(copies);
                let same = |k: &DrawCacheKey| {
                    (&k.sources, k.glyphs, k.mode, k.call, k.first)
                        == (&key.sources, key.glyphs, key.mode, key.call, key.first)
                };
                self.classifier.programs.made.retain(|k, _| !same(k));
                let made = CachedDraw {
                    geometry: geometry.clone(),
                    attributes: attributes.clone(),
                    cells: cells.clone(),
                    used: now,
                };
                self.classifier.programs.made.insert(key, made);
                (geometry, attributes, cells)
            }
        };
        let recognised = recognised.with_cells(&cells);
        self.capture.geometry_cache.touch(&geometry);
        let filter = TraceFilter::of(&self.config.settings);
        // VTK leaves blending enabled. Without transparency it changes nothing.
        let mut state = (*self.state.snapshot).clone();
        if signature.depth_offset {
            if state.polygon_offset.is_some() {
                return Err("polygon offset of OpenGL's and of VTK's");
            }
            state.polygon_offset = Some(polygon_offset_of(program));
            state.offset_by_length = true;
        }
        if matches!(signature.peel, TranslucencyPass::Layers | TranslucencyPass::Weighted) {
            match signature.peel {
                TranslucencyPass::Weighted => weighted_blending::check_surface(&mut state, filter)?,
                _ => depth_peeling::check_surface(&mut state, filter)?,
            }
            let clip_from_object = recognised.clip_from_object;
            let shading = Shading::Program(Arc::new(recognised));
            let (state, ray_material) = (Arc::new(state), RayMaterial::default());
            let mut draw = Draw {
                geometry,
                attributes,
                state,
                shading,
                clip_from_object,
                calls: 1,
                ray_material,
            };
            overrides::apply(&mut draw, &self.config.settings);
            // VTK would peel at least two layers of both sides, and draws sums once.
            let passes = if signature.peel == TranslucencyPass::Layers { 4.0 } else { 1.0 };
            let triangles = draw.geometry.mesh.num_triangles();
            self.counters.count_traced(draw.calls, triangles);
            self.routing.trace(draw.calls, triangles, passes);
            match signature.peel {
                TranslucencyPass::Weighted => self.classifier.programs.weighted.take(draw),
                _ => self.classifier.programs.peeling.take(draw),
            }
            return Ok(ArrayDrawOutcome::Traced);
        }
        let offset = (state.polygon_offset, state.offset_by_length);
        if state.blend_is_over && recognised.is_opaque(&attributes, geometry.mesh.positions.len()) {
            state.blend = false;
        }
        let in_order = match rules::classify(&state, filter) {
            Classification::Pass(why) | Classification::TraceIfOpaque(why) => return Err(why),
            v => v == Classification::TraceInOrder,
        };
        if in_order {
            self.flush(FlushReason::OrderedDraw);
        }
        self.end_batch();
        let (clip_from_object, shading) =
            (recognised.clip_from_object, Shading::Program(Arc::new(recognised)));
        let (mut state, ray_material) = (self.state.snapshot.clone(), RayMaterial::default());
        if signature.depth_offset {
            let state = Arc::make_mut(&mut state);
            (state.polygon_offset, state.offset_by_length) = offset;
        }
        self.add(
            Draw { geometry, attributes, state, shading, clip_from_object, calls: 1, ray_material },
            in_order,
        );
        Ok(ArrayDrawOutcome::Traced)
    }

    fn picture_of(
        &mut self,
        program: u32,
        actor_texture: ActorTexture,
    ) -> Result<Arc<Image>, &'static str> {
        let sampler = if actor_texture.is_over_all() { "actortexture" } else { "albedoTex" };
        let version = self.capabilities.version;
        let image =
            self.image_of(
                program,
                sampler,
                |target| match texture_sampling::unsupported_sampling(target, version) {
                    Some(why) => Err(why),
                    None => Ok(()),
                },
            )?;
        // Only these formats give the same components in all samplers.
        if image.is_of_colors() { Ok(image) } else { Err("a picture of luminance or alpha alone") }
    }

    /// The image of a program's sampler, if rays can reproduce its filters.
    fn image_of(
        &mut self,
        program: u32,
        sampler: &str,
        followed: impl FnOnce(u32) -> Result<(), &'static str>,
    ) -> Result<Arc<Image>, &'static str> {
        let at = gl::uniform_location(program, sampler);
        let unit = if at < 0 { 0 } else { gl::uniform_i::<1>(program, at)[0].max(0) };
        let active = gl::word(ACTIVE_TEXTURE);
        gl::active_texture(TEXTURE0 + unit as u32);
        let name = gl::word(TEXTURE_BINDING_2D);
        let followed = followed(TEXTURE_2D);
        let version = self.shared.texture_version();
        let image = self.capture.textures.get(TEXTURE_2D, name, version);
        gl::active_texture(active);
        followed?;
        image.ok_or("a texture without an image")
    }

    fn read_program_arrays<'c>(
        &mut self,
        mode: u32,
        sources: &Sources,
        glyphs: Option<(GlyphArrays, Instances)>,
        elements: impl FnOnce() -> Result<Elements<'c>, &'static str>,
    ) -> Result<(Arc<Geometry>, Arc<Attributes>), &'static str> {
        let elements = elements()?;
        let (_, count) = elements.span();
        let read = |s: &Option<ArraySource>| s.map(|s| s.read(&elements)).transpose();
        let [position, normal, color, tex, _, _, picture] = sources;
        let mut positions = positions(&read(position)?.ok_or("a program without positions")?)?;
        let mut triangles = elements
            .triangles(mode, &elements.plain_split(self.state.snapshot.first_vertex_provokes));
        let mut attributes = Attributes::constant(&CurrentAttributes::default());
        if let Some(p) = read(normal)? {
            attributes.normals = Values::Packed(Arc::new(p));
        }
        if let Some(p) = read(color)? {
            attributes.colors = Values::Packed(Arc::new(p));
        }
        if let Some(p) = read(tex)? {
            attributes.tex = match read(picture)? {
                None => Values::Packed(Arc::new(p)),
                Some(q) => {
                    let both = |i| {
                        let ([s, t], [u, v]) = (p.at(i, [0.0; 2]), q.at(i, [0.0; 2]));
                        [s, t, u, v]
                    };
                    Values::PerVertex((0..count).map(both).collect())
                }
            };
        }
        if let Some((arrays, instances)) = glyphs {
            let glyphs = arrays.read(instances, positions.len(), triangles.len())?;
            glyphs.repeat(&mut positions, &mut triangles, &mut attributes);
        }
        let geometry = self.capture.geometry_cache.of_indices(&positions, &triangles);
        Ok((geometry, Arc::new(attributes)))
    }
}

/// The factor and units of polygon offset that move depths as VTK's shader does.
fn polygon_offset_of(program: u32) -> (f32, f32) {
    let one = |name: &str| match gl::uniform_location(program, name) {
        -1 => 0.0,
        at => gl::uniform_f::<1>(program, at)[0],
    };
    // A unit is two steps of the depth buffer.
    let units = f64::from(one("cOffset")) / 65_000.0 * crate::trace::DEPTH_STEPS / 2.0;
    (one("cFactor"), units as f32)
}

/// The contents of buffer textures for the triangles of a draw. The first triangle has number
/// `first`.
fn read_cells(sources: &Sources, first: i32, triangles: usize) -> Result<CellData, &'static str> {
    let first = usize::try_from(first).map_err(|_| "a negative number of a cell")?;
    let [.., colors, sides, _] = sources;
    Ok(CellData {
        colors: colors.map(|s| cell_data::colors(&s, first, triangles)).transpose()?,
        sides: sides.map(|s| cell_data::sides(&s, first, triangles)).transpose()?,
    })
}

/// The arguments of a draw call, for its key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct DrawCall {
    pub(crate) first: usize,
    pub(crate) count: usize,
    pub(crate) kind: u32,
    pub(crate) at: usize,
    /// The number of draws in the call.
    pub(crate) draws: usize,
    pub(crate) instances: Option<Instances>,
}
