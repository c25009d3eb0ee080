//! Converts vertex arrays to meshes: client memory or buffer objects, indexed or not.
//!
//! The driver is asked at the draw which arrays are enabled. Client memory is copied immediately,
//! because the program may change it as soon as the call returns.

use crate::capture::ImmediateModeTarget;
use crate::capture::draw::{Attributes, Draw, PackedArray, Shading, Values, component_bytes};
use crate::capture::geometry_cache::hash;
use crate::capture::primitives::is_filled;
use crate::classify::rules::Classification;
use crate::classify::vtk::DrawCall;
use crate::driver::gl;
use crate::enums::*;
use crate::interpose::client_memory::{
    ActiveCall, ArraySource, ComponentCount, DrawArguments, Elements,
};
use crate::interpose::context::Context;
use crate::interpose::flush_reason::FlushReason;
use crate::interpose::kept_errors::KeptErrors;
use crate::trace::overrides::RayMaterial;
use std::borrow::Cow;
use std::sync::Arc;

/// The queries for the array of positions.
const POSITION: [u32; 4] =
    [VERTEX_ARRAY_TYPE, VERTEX_ARRAY_STRIDE, VERTEX_ARRAY_POINTER, VERTEX_ARRAY_BUFFER_BINDING];

/// The enabled fixed-function arrays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct VertexArrays {
    pub(crate) position: ArraySource,
    pub(crate) normal: Option<ArraySource>,
    pub(crate) color: Option<ArraySource>,
    pub(crate) tex: Option<ArraySource>,
}

impl VertexArrays {
    /// Only the array of positions.
    pub(crate) fn query_position() -> Result<ArraySource, &'static str> {
        if !gl::is_enabled(VERTEX_ARRAY) {
            return Err("no vertex array");
        }
        Ok(ArraySource::of_fixed(ComponentCount::Asked(VERTEX_ARRAY_SIZE), POSITION, false, true))
    }

    /// The driver's arrays, or the reason why rays cannot replace a draw of them.
    pub(crate) fn query(version: u32) -> Result<VertexArrays, &'static str> {
        let buffers = version >= 15;
        if !gl::is_enabled(VERTEX_ARRAY) {
            return Err("no vertex array");
        }
        for (cap, least) in [(SECONDARY_COLOR_ARRAY, 14), (FOG_COORD_ARRAY, 14), (INDEX_ARRAY, 11)]
        {
            if version >= least && gl::is_enabled(cap) {
                return Err("arrays of secondary colours, fog coordinates or colour indices");
            }
        }
        if version >= 20
            && (0..8).any(|i| gl::vertex_attrib_i::<1>(i, VERTEX_ATTRIB_ARRAY_ENABLED)[0] != 0)
        {
            return Err("generic attributes without a program");
        }
        let position = ArraySource::of_fixed(
            ComponentCount::Asked(VERTEX_ARRAY_SIZE),
            POSITION,
            false,
            buffers,
        );
        let normal = gl::is_enabled(NORMAL_ARRAY).then(|| {
            let asked = [
                NORMAL_ARRAY_TYPE,
                NORMAL_ARRAY_STRIDE,
                NORMAL_ARRAY_POINTER,
                NORMAL_ARRAY_BUFFER_BINDING,
            ];
            ArraySource::of_fixed(ComponentCount::Three, asked, true, buffers)
        });
        let color = match gl::is_enabled(COLOR_ARRAY) {
            true => {
                if gl::word(COLOR_ARRAY_SIZE) == BGRA {
                    return Err("colours in the order BGRA");
                }
                let asked = [
                    COLOR_ARRAY_TYPE,
                    COLOR_ARRAY_STRIDE,
                    COLOR_ARRAY_POINTER,
                    COLOR_ARRAY_BUFFER_BINDING,
                ];
                Some(ArraySource::of_fixed(
                    ComponentCount::Asked(COLOR_ARRAY_SIZE),
                    asked,
                    true,
                    buffers,
                ))
            }
            false => None,
        };
        let client_unit = if version >= 13 { gl::word(CLIENT_ACTIVE_TEXTURE) } else { TEXTURE0 };
        if client_unit != TEXTURE0 {
            return Err("a client texture unit other than 0 is active");
        }
        let tex = gl::is_enabled(TEXTURE_COORD_ARRAY).then(|| {
            let asked = [
                TEXTURE_COORD_ARRAY_TYPE,
                TEXTURE_COORD_ARRAY_STRIDE,
                TEXTURE_COORD_ARRAY_POINTER,
                TEXTURE_COORD_ARRAY_BUFFER_BINDING,
            ];
            ArraySource::of_fixed(
                ComponentCount::Asked(TEXTURE_COORD_ARRAY_SIZE),
                asked,
                false,
                buffers,
            )
        });
        Ok(VertexArrays { position, normal, color, tex })
    }
}

/// The result of a draw that is not the driver's alone.
pub(crate) enum ArrayDrawOutcome {
    /// Rays compute its pixels.
    Traced,
    /// The driver computes its colours, and rays its shadows.
    Shape,
}

/// Positions as x, y, z. Points with w > 0 are divided by it.
pub(crate) fn positions(p: &PackedArray) -> Result<Vec<[f32; 3]>, &'static str> {
    if p.kind == FLOAT && p.size == 3 {
        return Ok(bytemuck::pod_collect_to_vec(&p.bytes));
    }
    let element = component_bytes(p.kind) * p.size;
    (0..p.bytes.len() / element.max(1))
        .map(|i| {
            let [x, y, z, w] = p.at::<4>(i, [0.0, 0.0, 0.0, 1.0]);
            match w {
                1.0 => Ok([x, y, z]),
                w if w > 0.0 => Ok([x / w, y / w, z / w]),
                _ => Err("vertices with w not positive"),
            }
        })
        .collect()
}

/// The copies that an instanced draw call makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Instances {
    pub(crate) count: usize,
    /// The element of the first one in arrays with a divisor.
    pub(crate) first: usize,
}

impl Instances {
    /// As in a call. A negative number, which OpenGL refuses, is none.
    pub(crate) fn of(count: i32, first: u32) -> Instances {
        Instances { count: usize::try_from(count).unwrap_or(0), first: first as usize }
    }
}

impl Context {
    /// A draw call of arrays, in order or by indices.
    pub(crate) fn draw(&mut self, mode: u32, call: &ActiveCall<'_>) -> bool {
        self.draw_elements(mode, call, None)
    }

    /// An instanced draw call.
    pub(crate) fn draw_instances(
        &mut self,
        mode: u32,
        call: &ActiveCall<'_>,
        instances: Instances,
    ) -> bool {
        self.draw_elements(mode, call, Some(instances))
    }

    fn draw_elements(
        &mut self,
        mode: u32,
        call: &ActiveCall<'_>,
        instances: Option<Instances>,
    ) -> bool {
        let (key, restart) = match call.named() {
            DrawArguments::Elements { count, kind, at, base } => {
                let buffer = gl::word(ELEMENT_ARRAY_BUFFER_BINDING) as usize;
                let first = (buffer << 32) | base as u32 as usize;
                let count = count.max(0) as usize;
                let key = DrawCall { first, count, kind, at, draws: 1, instances };
                (
                    key,
                    if self.capture.immediate_target == ImmediateModeTarget::List {
                        self.restart_index(kind)
                    } else {
                        None
                    },
                )
            }
            DrawArguments::Arrays { first, count } => {
                let (first, count) = (first.max(0) as usize, count.max(0) as usize);
                (DrawCall { first, count, kind: 0, at: 0, draws: 1, instances }, None)
            }
            DrawArguments::SeveralArrays { .. } | DrawArguments::SeveralElements { .. } => {
                self.several_draws(call)
            }
            DrawArguments::Element(_) => return false,
        };
        self.array_draw(mode, key, || Elements::of(call, restart))
    }

    /// The key of several draws in one call, and the index that restarts primitives.
    fn several_draws(&self, call: &ActiveCall<'_>) -> (DrawCall, Option<u32>) {
        // What OpenGL refuses is refused when the elements are read.
        let draws = call.several().unwrap_or_default();
        let list = self.capture.immediate_target == ImmediateModeTarget::List;
        let (kind, restart, buffer) = match call.named() {
            DrawArguments::SeveralElements { kind, .. } => {
                let restart = if list { self.restart_index(kind) } else { None };
                (kind, restart, gl::word(ELEMENT_ARRAY_BUFFER_BINDING) as usize)
            }
            _ => (0, None, 0),
        };
        let words: Vec<u64> =
            draws.iter().flat_map(|d| [d.at as u64, d.count as u64, d.base as u64]).collect();
        let digest = hash(&[bytemuck::cast_slice(&words)]);
        let count = draws.iter().fold(0_usize, |n, d| n.saturating_add(d.count));
        let (first, at) = (buffer << 32 | (digest >> 96) as usize, digest as usize);
        (DrawCall { first, count, kind, at, draws: draws.len(), instances: None }, restart)
    }

    fn array_draw<'c>(
        &mut self,
        mode: u32,
        call: DrawCall,
        elements: impl FnOnce() -> Result<Elements<'c>, &'static str>,
    ) -> bool {
        if self.capture.immediate_target == ImmediateModeTarget::Trace {
            self.replay_to_driver("a draw call between Begin and End");
            return false;
        }
        if self.capture.immediate_target == ImmediateModeTarget::List {
            if call.instances.is_some() {
                self.capture.list_driver_call(false, true);
                return false;
            }
            return self.array_into_list(mode, elements);
        }
        if self.capture.immediate_target == ImmediateModeTarget::Pass {
            return false;
        }
        let vertices = call.instances.map_or(1, |i| i.count).saturating_mul(call.count);
        if self.passes_draw(mode, u32::try_from(vertices).unwrap_or(u32::MAX)) {
            return false;
        }
        let classification = self.classify_draw();
        self.errors.keep();
        let taken = match classification {
            _ if !is_filled(mode) => Err("lines and points"),
            _ if self.restarts() => Err("primitive restart"),
            // Recognised programs have their own rules for blending.
            _ if self.state.snapshot.program != 0 => self.take_program_arrays(mode, call, elements),
            Classification::Pass(why) => Err(why),
            _ if call.instances.is_some() => Err("instances without a program"),
            v => self.take_arrays(mode, elements, v).map(|()| ArrayDrawOutcome::Traced),
        };
        KeptErrors::drop_ours();
        match taken {
            Ok(ArrayDrawOutcome::Traced) => true,
            // The driver draws it, and rays darken it at the end of the frame.
            Ok(ArrayDrawOutcome::Shape) => {
                self.attributes.sync();
                self.state.mark_current(&self.capabilities);
                false
            }
            Err(why) => {
                self.before_driver_draw(why, is_filled(mode));
                if is_filled(mode) {
                    self.classifier.programs.begin_redraw(&self.state.snapshot);
                }
                // After the driver's draw of arrays some current values are undefined.
                self.state.mark_current(&self.capabilities);
                false
            }
        }
    }

    fn restarts(&self) -> bool {
        self.capabilities.version >= 31 && gl::is_enabled(PRIMITIVE_RESTART)
            || self.capabilities.version >= 43 && gl::is_enabled(PRIMITIVE_RESTART_FIXED_INDEX)
    }

    /// The index that restarts primitives, if any.
    fn restart_index(&self, kind: u32) -> Option<u32> {
        if self.capabilities.version >= 43 && gl::is_enabled(PRIMITIVE_RESTART_FIXED_INDEX) {
            return Some(u32::MAX >> (32 - 8 * component_bytes(kind).clamp(1, 4)));
        }
        self.restarts().then(|| gl::word(PRIMITIVE_RESTART_INDEX))
    }

    fn take_arrays<'c>(
        &mut self,
        mode: u32,
        elements: impl FnOnce() -> Result<Elements<'c>, &'static str>,
        classification: Classification,
    ) -> Result<(), &'static str> {
        let arrays = VertexArrays::query(self.capabilities.version)?;
        let elements = elements()?;
        let (_, count) = elements.span();
        let seen = arrays.position.view(&elements)?;
        let split = elements.split(mode, &self.state.snapshot, &arrays.position, &seen);
        let key = elements.key(mode, &seen, arrays.position.layout(), &split);
        let geometry = match self.capture.geometry_cache.known(key) {
            Some(geometry) => geometry,
            None => {
                let positions = positions(&arrays.position.pack(seen))?;
                let triangles = elements.triangles(mode, &split);
                self.capture.geometry_cache.put(key, &positions, triangles)
            }
        };
        let mut read = |s: &Option<ArraySource>| -> Result<Option<Arc<PackedArray>>, &'static str> {
            let Some(s) = s else { return Ok(None) };
            let bytes = s.view(&elements)?;
            Ok(Some(
                self.capture
                    .attribute_cache
                    .get(&bytes, s.layout(), || s.pack(Cow::Borrowed(&bytes))),
            ))
        };
        let (normal, color, tex) =
            (read(&arrays.normal)?, read(&arrays.color)?, read(&arrays.tex)?);
        if let Classification::TraceIfOpaque(why) = classification {
            let by_color = !self.state.snapshot.lighting
                || self
                    .state
                    .snapshot
                    .color_material
                    .is_some_and(|(_, what)| matches!(what, DIFFUSE | AMBIENT_AND_DIFFUSE));
            let opaque = match &color {
                Some(p) if by_color => (0..count).all(|i| p.at::<4>(i, [1.0; 4])[3] == 1.0),
                _ => self.attributes.is_opaque(&self.state.snapshot),
            };
            if !opaque {
                return Err(why);
            }
        }
        self.attributes.sync();
        if classification == Classification::TraceInOrder {
            self.flush(FlushReason::OrderedDraw);
        }
        self.end_batch();
        let mut attributes = Attributes::constant(&self.attributes.current);
        if let Some(p) = normal {
            attributes.normals = Values::Packed(p);
        }
        if let Some(p) = color {
            attributes.colors = Values::Packed(p);
        }
        if let Some(p) = tex {
            attributes.tex = Values::Packed(p);
        }
        let state = self.state.snapshot.clone();
        let clip_from_object = crate::state::matrix::product(&state.projection, &state.model_view);
        let (attributes, shading, ray_material) =
            (Arc::new(attributes), Shading::Fixed, RayMaterial::default());
        let draw =
            Draw { geometry, attributes, state, shading, clip_from_object, calls: 1, ray_material };
        self.add(draw, classification == Classification::TraceInOrder);
        Ok(())
    }

    /// While a list is compiled, the arrays are read immediately, as OpenGL specifies, and become
    /// steps of the list.
    fn array_into_list<'c>(
        &mut self,
        mode: u32,
        elements: impl FnOnce() -> Result<Elements<'c>, &'static str>,
    ) -> bool {
        if !is_filled(mode) {
            self.capture.list_driver_call(false, true);
            return false;
        }
        let read = || -> Result<_, &'static str> {
            let arrays = VertexArrays::query(self.capabilities.version)?;
            let elements = elements()?;
            let read = |s: &Option<ArraySource>| s.map(|s| s.read(&elements)).transpose();
            let position = arrays.position.read(&elements)?;
            Ok((
                position,
                read(&arrays.normal)?,
                read(&arrays.color)?,
                read(&arrays.tex)?,
                elements,
            ))
        };
        let Ok((position, normal, color, tex, elements)) = read() else {
            self.capture.list_driver_call(false, true);
            return false;
        };
        let end = [0.0, 0.0, 0.0, 1.0];
        self.capture.list_begin_arrays(mode);
        for i in elements.order() {
            let Some(i) = i else {
                self.capture.list_end();
                self.capture.list_begin_arrays(mode);
                continue;
            };
            if let Some(p) = &normal {
                self.capture.list_normal(p.at(i, [0.0; 3]));
            }
            if let Some(p) = &color {
                self.capture.list_color(p.at(i, end));
            }
            if let Some(p) = &tex {
                self.capture.list_tex(p.at(i, end));
            }
            self.capture.list_vertex(position.at(i, end));
        }
        self.capture.list_end()
    }
}
