//! Vertex arrays: client memory or buffer objects, indexed or not, to meshes.
//!
//! The driver is asked which arrays are on when the draw comes. Client memory is copied then and there, because the program may change
//! it as soon as the call returns.

use crate::cache::hash;
use crate::capture::{Attributes, Draw, Packed, Shading, Values, component_bytes};
use crate::client_memory;
use crate::context::{Context, Sink};
use crate::decide::Verdict;
use crate::enums::*;
use crate::overrides::Look;
use crate::primitives::{Split, is_filled, triangulate};
use crate::programs::DrawCall;
use crate::real::gl;
use crate::state::snapshot::Snapshot;
use std::borrow::Cow;
use std::sync::Arc;

/// Where an array is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Source {
    pub(crate) size: usize,
    pub(crate) kind: u32,
    pub(crate) stride: usize,
    pub(crate) address: usize,
    /// 0 for client memory.
    pub(crate) buffer: u32,
    pub(crate) normalized: bool,
}

impl Source {
    fn element(&self) -> usize {
        component_bytes(self.kind) * self.size
    }

    /// Bytes from one vertex to the next.
    fn step(&self) -> usize {
        if self.stride == 0 { self.element() } else { self.stride }
    }

    /// Vertices `first..first + count` where they are, with gaps; an error in words when they cannot be read.
    pub(crate) fn view(&self, first: usize, count: usize) -> Result<Cow<'static, [u8]>, &'static str> {
        let element = self.element();
        if element == 0 || self.size > 4 {
            return Err("an array of a type that is not read");
        }
        let start = self.address + first * self.step();
        let length = if count == 0 { 0 } else { (count - 1) * self.step() + element };
        match self.buffer {
            0 if self.address == 0 => Err("an array without an address"),
            // For the time of this call: nobody keeps it.
            0 => Ok(Cow::Borrowed(client_memory::view(start, length))),
            buffer => read_buffer(buffer, start, length).map(Cow::Owned),
        }
    }

    /// Bytes of [`Source::view`] tightly packed.
    pub(crate) fn pack(&self, bytes: Cow<'_, [u8]>) -> Packed {
        let (element, step) = (self.element(), self.step());
        let bytes = match step == element {
            true => bytes.into_owned(),
            false => {
                let mut out = Vec::with_capacity(bytes.len() / step * element + element);
                // A stride below the element's size makes vertices overlap.
                for at in (0..(bytes.len() + 1).saturating_sub(element)).step_by(step) {
                    out.extend_from_slice(&bytes[at..at + element]);
                }
                out
            }
        };
        Packed { bytes, kind: self.kind, size: self.size, normalized: self.normalized }
    }

    /// Vertices `first..first + count`, tightly packed; an error in words when they cannot be read.
    pub(crate) fn read(&self, first: usize, count: usize) -> Result<Packed, &'static str> {
        Ok(self.pack(self.view(first, count)?))
    }

    /// What makes the same bytes another array.
    pub(crate) fn layout(&self) -> (usize, u32, usize, bool) {
        (self.step(), self.kind, self.size, self.normalized)
    }
}

/// A part of a buffer object.
fn read_buffer(buffer: u32, start: usize, length: usize) -> Result<Vec<u8>, &'static str> {
    let bound = gl::word(ARRAY_BUFFER_BINDING);
    gl::bind_buffer(ARRAY_BUFFER, buffer);
    let size = gl::buffer_i::<1>(ARRAY_BUFFER, BUFFER_SIZE)[0].max(0) as usize;
    let mapped = gl::buffer_i::<1>(ARRAY_BUFFER, BUFFER_MAPPED)[0] != 0;
    let answer = if mapped {
        Err("a mapped buffer")
    } else if start.checked_add(length).is_none_or(|end| end > size) {
        Err("arrays beyond the end of their buffer")
    } else {
        Ok(gl::buffer_bytes(ARRAY_BUFFER, start, length))
    };
    gl::bind_buffer(ARRAY_BUFFER, bound);
    answer
}

/// The fixed-function arrays that are on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Arrays {
    pub(crate) position: Source,
    pub(crate) normal: Option<Source>,
    pub(crate) color: Option<Source>,
    pub(crate) tex: Option<Source>,
}

fn source(
    size: usize,
    kind: u32,
    stride: u32,
    pointer: u32,
    buffer: u32,
    normalized: bool,
    buffers: bool,
) -> Source {
    Source {
        size,
        kind: gl::word(kind),
        stride: gl::int(stride).max(0) as usize,
        address: gl::pointer(pointer),
        buffer: if buffers { gl::word(buffer) } else { 0 },
        normalized,
    }
}

impl Arrays {
    /// The array of positions alone.
    pub(crate) fn query_position() -> Result<Source, &'static str> {
        if !gl::is_enabled(VERTEX_ARRAY) {
            return Err("no vertex array");
        }
        let size = gl::int(VERTEX_ARRAY_SIZE).max(0) as usize;
        let (kind, stride) = (VERTEX_ARRAY_TYPE, VERTEX_ARRAY_STRIDE);
        let buffer = VERTEX_ARRAY_BUFFER_BINDING;
        Ok(source(size, kind, stride, VERTEX_ARRAY_POINTER, buffer, false, true))
    }

    /// As the driver has them; an error in words when rays cannot stand for them.
    pub(crate) fn query(version: u32) -> Result<Arrays, &'static str> {
        let buffers = version >= 15;
        if !gl::is_enabled(VERTEX_ARRAY) {
            return Err("no vertex array");
        }
        for (cap, least) in [(SECONDARY_COLOR_ARRAY, 14), (FOG_COORD_ARRAY, 14), (INDEX_ARRAY, 11)] {
            if version >= least && gl::is_enabled(cap) {
                return Err("arrays of secondary colours, fog coordinates or colour indices");
            }
        }
        if version >= 20 && (0..8).any(|i| gl::vertex_attrib_i::<1>(i, VERTEX_ATTRIB_ARRAY_ENABLED)[0] != 0) {
            return Err("generic attributes without a program");
        }
        let size = |what| gl::int(what).max(0) as usize;
        let position = source(
            size(VERTEX_ARRAY_SIZE),
            VERTEX_ARRAY_TYPE,
            VERTEX_ARRAY_STRIDE,
            VERTEX_ARRAY_POINTER,
            VERTEX_ARRAY_BUFFER_BINDING,
            false,
            buffers,
        );
        let normal = gl::is_enabled(NORMAL_ARRAY).then(|| {
            let b = NORMAL_ARRAY_BUFFER_BINDING;
            source(3, NORMAL_ARRAY_TYPE, NORMAL_ARRAY_STRIDE, NORMAL_ARRAY_POINTER, b, true, buffers)
        });
        let color = match gl::is_enabled(COLOR_ARRAY) {
            true => {
                let b = COLOR_ARRAY_BUFFER_BINDING;
                let components = gl::word(COLOR_ARRAY_SIZE);
                if components == BGRA {
                    return Err("colours in the order BGRA");
                }
                let s = source(
                    components as usize,
                    COLOR_ARRAY_TYPE,
                    COLOR_ARRAY_STRIDE,
                    COLOR_ARRAY_POINTER,
                    b,
                    true,
                    buffers,
                );
                Some(s)
            }
            false => None,
        };
        let client_unit = if version >= 13 { gl::word(CLIENT_ACTIVE_TEXTURE) } else { TEXTURE0 };
        if client_unit != TEXTURE0 {
            return Err("a client texture unit other than 0 is active");
        }
        let tex = gl::is_enabled(TEXTURE_COORD_ARRAY).then(|| {
            let (s, b) = (size(TEXTURE_COORD_ARRAY_SIZE), TEXTURE_COORD_ARRAY_BUFFER_BINDING);
            let (k, t, p) =
                (TEXTURE_COORD_ARRAY_TYPE, TEXTURE_COORD_ARRAY_STRIDE, TEXTURE_COORD_ARRAY_POINTER);
            source(s, k, t, p, b, false, buffers)
        });
        Ok(Arrays { position, normal, color, tex })
    }
}

/// What became of a draw that is not left to the driver alone.
pub(crate) enum Taken {
    /// Rays make its pixels.
    Traced,
    /// The driver makes its colours, rays its shadows.
    Shape,
}

/// Which vertices a draw takes.
pub(crate) enum Elements {
    /// Neighbours in the arrays.
    Range { first: usize, count: usize },
    /// By index; `least` is the smallest, `count` the span.
    Indexed { indices: Vec<u32>, least: usize, count: usize },
}

impl Elements {
    /// Stands for the index at which a primitive ends and another begins.
    const RESTART: u32 = u32::MAX;

    /// From the arguments of `glDrawElements`, and the index that restarts primitives.
    pub(crate) fn indexed(
        n: i32,
        kind: u32,
        at: usize,
        base: i32,
        restart: Option<u32>,
    ) -> Result<Elements, &'static str> {
        let n = usize::try_from(n).map_err(|_| "a negative count")?;
        let width = component_bytes(kind);
        if !matches!(kind, UNSIGNED_BYTE | UNSIGNED_SHORT | UNSIGNED_INT) {
            return Err("indices of a type that OpenGL refuses");
        }
        let buffer = gl::word(ELEMENT_ARRAY_BUFFER_BINDING);
        let owned;
        let bytes: &[u8] = if buffer == 0 {
            if at == 0 {
                return Err("indices without an address");
            }
            client_memory::view(at, n * width)
        } else {
            owned = read_buffer(buffer, at, n * width)?;
            &owned
        };
        let decode = |b: &[u8]| match *b {
            [a] => u32::from(a),
            [a, b] => u32::from(u16::from_ne_bytes([a, b])),
            [a, b, c, d] => u32::from_ne_bytes([a, b, c, d]),
            _ => 0,
        };
        let place = |raw: u32| match restart {
            Some(r) if r == raw => Elements::RESTART,
            _ => raw.wrapping_add_signed(base),
        };
        let indices: Vec<u32> = bytes.chunks_exact(width).map(|b| place(decode(b))).collect();
        let real = || indices.iter().filter(|i| restart.is_none() || **i != Elements::RESTART);
        let (Some(&least), Some(&most)) = (real().min(), real().max()) else {
            return Ok(Elements::Indexed { indices, least: 0, count: 0 });
        };
        let count = (most - least) as usize + 1;
        // Client arrays of unknown length: an index that is out of order must not make us read gigabytes.
        if count > 1 << 28 {
            return Err("indices that are too far apart");
        }
        Ok(Elements::Indexed { indices, least: least as usize, count })
    }

    /// Names the geometry of these elements of an array of positions, whose bytes are given.
    fn key(&self, mode: u32, bytes: &[u8], layout: (usize, u32, usize, bool), split: &Split) -> u128 {
        let (stride, kind, size, _) = layout;
        let rules = u64::from(split.first_provokes) << 1 | u64::from(split.all_turned);
        let (_, count) = self.span();
        let tail = [stride as u64, u64::from(kind), size as u64, u64::from(mode), rules, count as u64];
        let tail = bytemuck::cast_slice(&tail);
        match self {
            Elements::Range { .. } => hash(&[bytes, tail, bytemuck::cast_slice(&split.turned)]),
            Elements::Indexed { indices, least, .. } => {
                hash(&[bytes, bytemuck::cast_slice(indices), &least.to_ne_bytes(), tail])
            }
        }
    }

    /// First vertex, and how many there are from it on.
    pub(crate) fn span(&self) -> (usize, usize) {
        match self {
            Elements::Range { first, count } => (*first, *count),
            Elements::Indexed { least, count, .. } => (*least, *count),
        }
    }

    /// Up to `most` different vertices, spread over the draw.
    pub(crate) fn some(&self, most: usize) -> Vec<u32> {
        let n = match self {
            Elements::Range { count, .. } => *count,
            Elements::Indexed { indices, .. } => indices.len(),
        };
        let take = most.min(n);
        let number = |i: usize| match self {
            Elements::Range { first, .. } => (first + i) as u32,
            Elements::Indexed { indices, .. } => indices[i],
        };
        let mut out: Vec<u32> = (0..take).map(|i| number(i * (n - 1) / (take - 1).max(1))).collect();
        out.sort_unstable();
        out.dedup();
        out
    }

    /// How the driver splits quads where nobody knows what it clips.
    pub(crate) fn plain_split(&self, first_provokes: bool) -> Split {
        Split { first_provokes, all_turned: matches!(self, Elements::Indexed { .. }), turned: Vec::new() }
    }

    /// How the driver would split quads: see [`Split`].
    pub(crate) fn split(&self, mode: u32, s: &Snapshot, position: &Source, bytes: &[u8]) -> Split {
        let mut split = self.plain_split(s.first_vertex_provokes);
        split.all_turned |= s.flat;
        let (_, count) = self.span();
        if mode == QUADS && !split.all_turned {
            let clipped = s.clips();
            let (step, one, size) = (position.step(), component_bytes(position.kind), position.size.min(3));
            split.look_for_clipped(0, count as u32, |from, to| {
                (from..to).any(|i| {
                    let at = i as usize * step;
                    let mut p = [0.0; 3];
                    for (k, v) in p.iter_mut().enumerate().take(size) {
                        let b = bytes.get(at + k * one..at + (k + 1) * one);
                        *v = b.map_or(0.0, |b| crate::capture::component(b, position.kind, false));
                    }
                    clipped(p)
                })
            });
        }
        split
    }

    /// Triangles, in vertex numbers of the span.
    pub(crate) fn triangles(&self, mode: u32, split: &Split) -> Vec<[u32; 3]> {
        let mut out = Vec::new();
        match self {
            Elements::Range { count, .. } => triangulate(mode, 0, *count as u32, split, &mut out),
            Elements::Indexed { indices, least, .. } => {
                triangulate(mode, 0, indices.len() as u32, split, &mut out);
                let vertex = |i: u32| indices[i as usize] - *least as u32;
                out.iter_mut().for_each(|t| *t = t.map(vertex));
            }
        }
        out
    }

    /// Vertex numbers of the span in the order they are drawn; `None` where a primitive ends and another begins.
    fn order(&self) -> Box<dyn Iterator<Item = Option<usize>> + '_> {
        match self {
            Elements::Range { count, .. } => Box::new((0..*count).map(Some)),
            Elements::Indexed { indices, least, .. } => {
                let place = move |i: &u32| (*i as usize).checked_sub(*least);
                Box::new(indices.iter().map(move |i| place(i).filter(|_| *i != Elements::RESTART)))
            }
        }
    }
}

/// Positions as x, y, z; points with w > 0 are divided by it.
pub(crate) fn positions(p: &Packed) -> Result<Vec<[f32; 3]>, &'static str> {
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

impl Context {
    pub(crate) fn draw_arrays(&mut self, mode: u32, first: i32, count: i32) -> bool {
        let call = DrawCall { first: first.max(0) as usize, count: count.max(0) as usize, kind: 0, at: 0 };
        self.array_draw(mode, call, || match (usize::try_from(first), usize::try_from(count)) {
            (Ok(first), Ok(count)) => Ok(Elements::Range { first, count }),
            _ => Err("a negative count"),
        })
    }

    pub(crate) fn draw_elements(&mut self, mode: u32, count: i32, kind: u32, at: usize, base: i32) -> bool {
        let buffer = gl::word(ELEMENT_ARRAY_BUFFER_BINDING) as usize;
        let call =
            DrawCall { first: (buffer << 32) | base as u32 as usize, count: count.max(0) as usize, kind, at };
        let restart = if self.sink == Sink::List { self.restart_index(kind) } else { None };
        self.array_draw(mode, call, || Elements::indexed(count, kind, at, base, restart))
    }

    fn array_draw(
        &mut self,
        mode: u32,
        call: DrawCall,
        elements: impl FnOnce() -> Result<Elements, &'static str>,
    ) -> bool {
        if self.sink == Sink::Trace {
            self.unswallow("a draw call between Begin and End");
            return false;
        }
        if self.sink == Sink::List {
            return self.array_into_list(mode, elements);
        }
        if self.sink == Sink::Pass {
            return false;
        }
        let verdict = self.verdict();
        self.keep_errors();
        let taken = match verdict {
            _ if !is_filled(mode) => Err("lines and points"),
            _ if self.restarts() => Err("primitive restart"),
            // Recognised programs decide for themselves what blending means.
            _ if self.state.program != 0 => self.take_program_arrays(mode, call, elements),
            Verdict::Pass(why) => Err(why),
            v => self.take_arrays(mode, elements, v).map(|()| Taken::Traced),
        };
        self.drop_errors();
        match taken {
            Ok(Taken::Traced) => true,
            // The driver draws it, and rays darken it when the frame ends.
            Ok(Taken::Shape) => {
                self.sync();
                self.mark_current();
                false
            }
            Err(why) => {
                self.passing(why, is_filled(mode));
                if is_filled(mode) {
                    self.draw_over();
                }
                // The arrays of the driver's draw leave some current values undefined.
                self.mark_current();
                false
            }
        }
    }

    fn restarts(&self) -> bool {
        self.can.version >= 31 && gl::is_enabled(PRIMITIVE_RESTART)
            || self.can.version >= 43 && gl::is_enabled(PRIMITIVE_RESTART_FIXED_INDEX)
    }

    /// The index that restarts primitives, if one does.
    fn restart_index(&self, kind: u32) -> Option<u32> {
        if self.can.version >= 43 && gl::is_enabled(PRIMITIVE_RESTART_FIXED_INDEX) {
            return Some(u32::MAX >> (32 - 8 * component_bytes(kind).clamp(1, 4)));
        }
        self.restarts().then(|| gl::word(PRIMITIVE_RESTART_INDEX))
    }

    fn take_arrays(
        &mut self,
        mode: u32,
        elements: impl FnOnce() -> Result<Elements, &'static str>,
        verdict: Verdict,
    ) -> Result<(), &'static str> {
        let arrays = Arrays::query(self.can.version)?;
        let elements = elements()?;
        let (first, count) = elements.span();
        let seen = arrays.position.view(first, count)?;
        let split = elements.split(mode, &self.state, &arrays.position, &seen);
        let key = elements.key(mode, &seen, arrays.position.layout(), &split);
        let geometry = match self.cache.known(key) {
            Some(geometry) => geometry,
            None => {
                let positions = positions(&arrays.position.pack(seen))?;
                let triangles = elements.triangles(mode, &split);
                self.cache.put(key, &positions, triangles)
            }
        };
        let mut read = |s: &Option<Source>| -> Result<Option<Arc<Packed>>, &'static str> {
            let Some(s) = s else { return Ok(None) };
            let bytes = s.view(first, count)?;
            Ok(Some(self.packed.get(&bytes, s.layout(), || s.pack(Cow::Borrowed(&bytes)))))
        };
        let (normal, color, tex) = (read(&arrays.normal)?, read(&arrays.color)?, read(&arrays.tex)?);
        if let Verdict::TraceIfOpaque(why) = verdict {
            let by_color = !self.state.lighting
                || self
                    .state
                    .color_material
                    .is_some_and(|(_, what)| matches!(what, DIFFUSE | AMBIENT_AND_DIFFUSE));
            let opaque = match &color {
                Some(p) if by_color => (0..count).all(|i| p.at::<4>(i, [1.0; 4])[3] == 1.0),
                _ => self.is_opaque_now(),
            };
            if !opaque {
                return Err(why);
            }
        }
        self.sync();
        if verdict == Verdict::TraceInOrder {
            self.flush("a draw whose order matters");
        }
        self.end_batch();
        let mut attributes = Attributes::constant(&self.current);
        if let Some(p) = normal {
            attributes.normals = Values::Packed(p);
        }
        if let Some(p) = color {
            attributes.colors = Values::Packed(p);
        }
        if let Some(p) = tex {
            attributes.tex = Values::Packed(p);
        }
        let state = self.state.clone();
        let clip_from_object = crate::lighting::product(&state.projection, &state.model_view);
        let (attributes, shading, look) = (Arc::new(attributes), Shading::Fixed, Look::default());
        let draw = Draw { geometry, attributes, state, shading, clip_from_object, calls: 1, look };
        self.add(draw, verdict == Verdict::TraceInOrder);
        Ok(())
    }

    /// Hands a finished draw to the frame.
    pub(crate) fn mark_current(&mut self) {
        if !self.can.core {
            self.dirty |= crate::symbols::class::CURRENT;
        }
    }

    /// While a list is compiled the arrays are read at once, as OpenGL says, and become steps of it.
    fn array_into_list(
        &mut self,
        mode: u32,
        elements: impl FnOnce() -> Result<Elements, &'static str>,
    ) -> bool {
        if !is_filled(mode) {
            if let Some(r) = &mut self.recording {
                r.note_driver_call(0, false, true);
            }
            return false;
        }
        let read = || -> Result<_, &'static str> {
            let arrays = Arrays::query(self.can.version)?;
            let elements = elements()?;
            let (first, count) = elements.span();
            let read = |s: &Option<Source>| s.map(|s| s.read(first, count)).transpose();
            let position = arrays.position.read(first, count)?;
            Ok((position, read(&arrays.normal)?, read(&arrays.color)?, read(&arrays.tex)?, elements))
        };
        let Ok((position, normal, color, tex, elements)) = read() else {
            if let Some(r) = &mut self.recording {
                r.note_driver_call(0, false, true);
            }
            return false;
        };
        let end = [0.0, 0.0, 0.0, 1.0];
        self.list_begin_arrays(mode);
        for i in elements.order() {
            let Some(i) = i else {
                self.list_end();
                self.list_begin_arrays(mode);
                continue;
            };
            if let Some(p) = &normal {
                self.list_normal(p.at(i, [0.0; 3]));
            }
            if let Some(p) = &color {
                self.list_color(p.at(i, end));
            }
            if let Some(p) = &tex {
                self.list_tex(p.at(i, end));
            }
            self.list_vertex(position.at(i, end));
        }
        self.list_end()
    }
}
