//! Records immediate mode: positions, attributes that cost nothing while they do not change, and
//! the primitives.
//!
//! A call only puts its values into a ring. When the ring is full, its vertices are compared, all
//! at once and bit for bit, with those at the same position of the previous frame. They are stored
//! where they differ.

mod attribute_stream;
mod earlier_frames;

use crate::capture::draw::{Attributes, Values};
use crate::capture::geometry_cache::Geometry;
use crate::capture::primitives::PrimitiveRun;
use crate::enums::QUADS;
use crate::state::current_attributes::CurrentAttributes;
use crate::state::material::Materials;
use attribute_stream::AttributeStream;
pub(crate) use attribute_stream::same_bits;
use earlier_frames::EarlierBatch;
use rt_core::mesh::TriMesh;
use std::collections::HashMap;
use std::sync::Arc;

/// The number of vertices in the ring.
const RING: usize = 64;

/// The latest vertices, which have not been compared yet.
struct VertexRing {
    positions: [[f32; 3]; RING],
    normals: [[f32; 3]; RING],
    /// The vertices that came with a normal of their own, as bits.
    set: u64,
}

impl Default for VertexRing {
    fn default() -> Self {
        VertexRing { positions: [[0.0; 3]; RING], normals: [[0.0; 3]; RING], set: 0 }
    }
}

const NO_RUN: PrimitiveRun = PrimitiveRun { mode: 0, count: u32::MAX, times: 0 };

/// The vertices of immediate mode since the last change of state.
pub(crate) struct VertexRecorder {
    /// The number of vertices so far. Those from `flushed` on are only in the ring.
    count: usize,
    /// At this count a vertex takes the slow path.
    limit: usize,
    flushed: usize,
    ring: VertexRing,
    /// The first vertex of the primitive between Begin and End, and its mode.
    open: usize,
    mode: u32,
    /// Primitives of one kind and size that are not in `runs` yet.
    run: PrimitiveRun,
    /// Current values were set outside of Begin and End, and the streams do not have them.
    pub(crate) behind: bool,
    /// An attribute besides positions and normals is stored for each vertex.
    more: bool,
    /// Positions, unless they equal those of `expected` so far.
    pub(crate) positions: Vec<[f32; 3]>,
    /// The batch that this one seems to repeat. While it does, no position is stored, and at the
    /// end nothing has to be hashed.
    expected: Option<Arc<TriMesh>>,
    /// Batches of earlier frames by their first position.
    earlier: HashMap<[u32; 3], EarlierBatch>,
    frame: u64,
    normals: AttributeStream<3>,
    /// The values of `normals` are those of a whole earlier batch with this version, unless one was
    /// changed.
    kept: Option<u64>,
    changed: bool,
    /// The normal of the latest vertex.
    last_normal: [f32; 3],
    colors: AttributeStream<4>,
    tex: AttributeStream<4>,
    materials: Vec<Materials>,
    material_of: Vec<u32>,
    pub(crate) runs: Vec<PrimitiveRun>,
    /// True when there are quads in the batch.
    pub(crate) quads: bool,
    versions: u64,
}

impl Default for VertexRecorder {
    fn default() -> Self {
        VertexRecorder {
            count: 0,
            limit: RING,
            flushed: 0,
            ring: VertexRing::default(),
            open: 0,
            mode: 0,
            run: NO_RUN,
            behind: false,
            more: false,
            positions: Vec::new(),
            expected: None,
            earlier: HashMap::new(),
            frame: 0,
            normals: AttributeStream::default(),
            kept: None,
            changed: false,
            last_normal: [0.0; 3],
            colors: AttributeStream::default(),
            tex: AttributeStream::default(),
            materials: Vec::new(),
            material_of: Vec::new(),
            runs: Vec::new(),
            quads: false,
            versions: 0,
        }
    }
}

impl VertexRecorder {
    /// A primitive begins.
    #[inline(always)]
    pub(crate) fn begin(&mut self, mode: u32, current: &CurrentAttributes) {
        self.open = self.count;
        self.mode = mode;
        if self.count == 0 || self.behind {
            self.take_up(current);
        }
    }

    /// The mode of the primitive that is open, or of the last one.
    pub(crate) fn mode(&self) -> u32 {
        self.mode
    }

    /// Begins a batch, or takes the values that were set between its primitives.
    #[cold]
    #[inline(never)]
    fn take_up(&mut self, current: &CurrentAttributes) {
        self.behind = false;
        self.set_normal(current.normal);
        self.set_color(current.color);
        self.set_tex(current.tex);
        if self.count == 0 {
            (self.normals.constant, self.last_normal) = (current.normal, current.normal);
            self.materials.clear();
            self.materials.push(current.materials);
            self.material_of.clear();
        }
    }

    /// The primitive ends.
    #[inline(always)]
    pub(crate) fn end(&mut self) {
        let count = (self.count - self.open) as u32;
        if self.run.count == count && self.run.mode == self.mode {
            self.run.times += 1;
        } else {
            self.next_run(count);
        }
    }

    #[cold]
    #[inline(never)]
    fn next_run(&mut self, count: u32) {
        self.put_run();
        self.run = PrimitiveRun { mode: self.mode, count, times: 1 };
        self.quads |= self.mode == QUADS;
    }

    fn put_run(&mut self) {
        let run = std::mem::replace(&mut self.run, NO_RUN);
        if run.times > 0 {
            self.runs.push(run);
        }
    }

    /// Sets the normal of the next vertex.
    #[inline(always)]
    pub(crate) fn set_normal(&mut self, v: [f32; 3]) {
        let at = self.count % RING;
        self.ring.normals[at] = v;
        self.ring.set |= 1 << at;
    }

    #[inline(always)]
    pub(crate) fn set_color(&mut self, v: [f32; 4]) {
        self.colors.set(v, self.count);
        if self.colors.varying && !self.more {
            self.write_more();
        }
    }

    #[inline(always)]
    pub(crate) fn set_tex(&mut self, v: [f32; 4]) {
        self.tex.set(v, self.count);
        if self.tex.varying && !self.more {
            self.write_more();
        }
    }

    /// From now on vertices have more than positions and normals.
    #[cold]
    #[inline(never)]
    fn write_more(&mut self) {
        self.more = true;
        self.limit = self.count + 1;
    }

    /// The next vertices have another material.
    pub(crate) fn set_materials(&mut self, m: &Materials) {
        let n = self.count;
        if n == 0 {
            self.materials.clear();
        } else if self.materials.last() == Some(m) {
            return;
        } else if self.material_of.is_empty() {
            self.material_of.resize(n, 0);
            self.write_more();
        }
        self.materials.push(*m);
    }

    /// Adds a vertex with the current attributes.
    #[inline(always)]
    pub(crate) fn vertex(&mut self, v: [f32; 3], current: &CurrentAttributes) {
        self.ring.positions[self.count % RING] = v;
        self.count += 1;
        if self.count == self.limit {
            self.vertex_more(current);
        }
    }

    #[inline(never)]
    fn vertex_more(&mut self, current: &CurrentAttributes) {
        if self.colors.varying {
            self.colors.values.push(current.color);
        }
        if self.tex.varying {
            self.tex.values.push(current.tex);
        }
        if !self.material_of.is_empty() {
            self.material_of.push(self.materials.len() as u32 - 1);
        }
        if self.count.is_multiple_of(RING) {
            self.empty_ring();
        }
        self.set_limit();
    }

    fn set_limit(&mut self) {
        self.limit = if self.more { self.count + 1 } else { (self.count / RING + 1) * RING };
    }

    /// Compares the vertices in the ring.
    fn empty_ring(&mut self) {
        let n = self.count - self.flushed;
        if n == 0 {
            return;
        }
        let first = self.flushed % RING;
        self.flush_positions(first..first + n);
        self.flush_normals(first..first + n);
        self.flushed = self.count;
        self.ring.set = 0;
    }

    fn flush_positions(&mut self, new: std::ops::Range<usize>) {
        if self.flushed == 0 {
            self.positions.clear();
            let first = self.ring.positions[new.start].map(f32::to_bits);
            self.expected = self.earlier.get(&first).map(|e| e.mesh.clone());
        }
        let new = &self.ring.positions[new];
        if let Some(mesh) = &self.expected {
            let all: &[[f32; 3]] = bytemuck::cast_slice(&mesh.positions);
            if all
                .get(self.flushed..self.flushed + new.len())
                .is_some_and(|old| same_bits(old, new))
            {
                return;
            }
            self.copy_followed_vertices();
        }
        self.positions.extend_from_slice(
            &self.ring.positions[self.flushed % RING..][..self.count - self.flushed],
        );
    }

    fn flush_normals(&mut self, new: std::ops::Range<usize>) {
        let ring = &mut self.ring;
        // Only values that were set before one of these vertices count.
        let of_these = (u64::MAX >> (RING - new.len())) << new.start;
        let set = ring.set & of_these;
        if set == 0 && !self.normals.varying {
            return;
        }
        if set != of_these {
            let mut last = self.last_normal;
            for i in new.clone() {
                if set >> i & 1 == 0 {
                    ring.normals[i] = last;
                }
                last = ring.normals[i];
            }
        }
        let new = &ring.normals[new];
        self.last_normal = new[new.len() - 1];
        if !self.normals.varying {
            if self.flushed == 0 {
                self.normals.constant = new[0];
            }
            let constant = self.normals.constant;
            if new.iter().all(|v| same_bits(&[*v], &[constant])) {
                return;
            }
            self.vary_normals();
        }
        let at = self.flushed;
        let new = &self.ring.normals[at % RING..][..self.count - at];
        let values = &mut self.normals.values;
        if self.kept.is_none() {
            values.extend_from_slice(new);
        } else if !same_bits(&values[at..at + new.len()], new) {
            values[at..at + new.len()].copy_from_slice(new);
            self.changed = true;
        }
    }

    /// Compares all vertices, and puts all primitives into `runs`.
    pub(crate) fn flush_ring(&mut self) {
        self.empty_ring();
        self.put_run();
    }

    /// True when `is` holds for any position of a range of the batch.
    pub(crate) fn any_position(&self, from: u32, to: u32, is: impl Fn([f32; 3]) -> bool) -> bool {
        let range = from as usize..to as usize;
        match &self.expected {
            Some(mesh) => mesh.positions[range].iter().any(|p| is(p.to_array())),
            None => self.positions[range].iter().any(|p| is(*p)),
        }
    }

    /// Copies the vertices that were followed so far.
    pub(crate) fn copy_followed_vertices(&mut self) {
        if let Some(mesh) = self.expected.take() {
            self.positions.clear();
            self.positions.extend(mesh.positions[..self.flushed].iter().map(|p| p.to_array()));
            if self.kept.take().is_some() {
                self.normals.values.truncate(self.flushed);
            }
        }
    }

    /// Takes out the vertices of the open primitive with their attributes, for the driver.
    pub(crate) fn take_open_primitive(&mut self) -> (u32, Vec<([f32; 3], CurrentAttributes)>) {
        self.empty_ring();
        self.copy_followed_vertices();
        let all = self.attributes_now();
        let out = (self.open..self.positions.len())
            .map(|i| {
                let current = CurrentAttributes {
                    normal: all.normals.at(i),
                    color: all.colors.at(i),
                    tex: all.tex.at(i),
                    materials: *all.materials_at(i),
                };
                (self.positions[i], current)
            })
            .collect();
        self.positions.truncate(self.open);
        if self.normals.varying {
            self.normals.values.truncate(self.open);
        }
        for s in [&mut self.colors, &mut self.tex] {
            if s.varying {
                s.values.truncate(self.open);
            }
        }
        self.material_of.truncate(self.open);
        (self.count, self.flushed) = (self.open, self.open);
        self.last_normal =
            if self.open > 0 { all.normals.at(self.open - 1) } else { self.normals.constant };
        self.ring.set = 0;
        self.set_limit();
        (self.mode, out)
    }

    fn attributes_now(&self) -> Attributes {
        fn values<const N: usize>(s: &AttributeStream<N>) -> Values<N> {
            if s.varying {
                Values::PerVertex(s.values.clone())
            } else {
                Values::Constant(s.constant)
            }
        }
        Attributes {
            normals: values(&self.normals),
            colors: values(&self.colors),
            tex: values(&self.tex),
            materials: self.materials.clone(),
            material_of: self.material_of.clone(),
            version: 0,
        }
    }

    /// All attributes of the batch, whose geometry is given. Then the recorder is empty except for
    /// positions and runs, which the caller clears. The ring must be flushed.
    pub(crate) fn take_attributes(&mut self, geometry: &Arc<Geometry>) -> Attributes {
        let version = self.version(geometry);
        self.more = false;
        (self.count, self.flushed, self.limit) = (0, 0, RING);
        self.ring.set = 0;
        (self.kept, self.changed) = (None, false);
        Attributes {
            normals: self.normals.take(),
            colors: self.colors.take(),
            tex: self.tex.take(),
            materials: std::mem::take(&mut self.materials),
            material_of: std::mem::take(&mut self.material_of),
            version,
        }
    }
}

#[cfg(test)]
mod tests;
