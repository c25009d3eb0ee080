//! Immediate mode, recorded: positions, attributes that cost nothing while they do not change, and how vertices make primitives.

use crate::cache::Geometry;
use crate::capture::{Attributes, Run, Values};
use crate::enums::QUADS;
use crate::primitives::Split;
use crate::state::current::{Current, Materials};
use rt_core::glam::Vec3;
use rt_core::mesh::TriMesh;
use std::collections::HashMap;
use std::sync::Arc;

/// A stream of one attribute that costs nothing while it does not change.
struct Stream<const N: usize> {
    varying: bool,
    constant: [f32; N],
    values: Vec<[f32; N]>,
    /// Memory of earlier frames: fresh pages would cost as much as filling them.
    spares: Vec<Vec<[f32; N]>>,
}

impl<const N: usize> Default for Stream<N> {
    fn default() -> Self {
        Stream { varying: false, constant: [0.0; N], values: Vec::new(), spares: Vec::new() }
    }
}

impl<const N: usize> Stream<N> {
    #[inline(always)]
    fn set(&mut self, v: [f32; N], vertices: usize) {
        if self.varying {
            return;
        }
        if vertices == 0 {
            self.constant = v;
        } else if v != self.constant {
            self.vary(vertices);
        }
    }

    #[cold]
    #[inline(never)]
    fn vary(&mut self, vertices: usize) {
        self.values = self.spares.pop().unwrap_or_default();
        self.values.clear();
        self.values.resize(vertices, self.constant);
        self.varying = true;
    }

    fn take(&mut self) -> Values<N> {
        let varying = std::mem::take(&mut self.varying);
        match varying {
            true => Values::PerVertex(std::mem::take(&mut self.values)),
            false => Values::Constant(self.constant),
        }
    }

    /// Takes back what [`Stream::take`] gave out.
    fn give_back(&mut self, values: Values<N>) {
        const MOST: usize = 16;
        if let Values::PerVertex(v) = values
            && self.spares.len() < MOST
        {
            self.spares.push(v);
        }
    }
}

/// Bit for bit: not a number is what it is.
#[inline(always)]
fn is_at(p: &Vec3, v: [f32; 3]) -> bool {
    (p.x.to_bits() ^ v[0].to_bits()) | (p.y.to_bits() ^ v[1].to_bits()) | (p.z.to_bits() ^ v[2].to_bits())
        == 0
}

/// A batch of an earlier frame, which may come again vertex by vertex.
#[derive(Clone)]
struct Expected {
    geometry: Arc<Geometry>,
    mesh: Arc<TriMesh>,
    runs: Vec<Run>,
    kind: Split,
    frame: u64,
}

/// Immediate mode: the vertices since the state changed last.
#[derive(Default)]
pub(crate) struct Recorder {
    /// Positions, unless they are those of `expected` so far.
    pub(crate) positions: Vec<[f32; 3]>,
    /// What this batch seems to be, and how many of its vertices have come. While it is right nothing is written down, and in the end nothing
    /// has to be hashed.
    expected: Option<Arc<TriMesh>>,
    followed: usize,
    /// Batches of earlier frames by their first position.
    earlier: HashMap<[u32; 3], Expected>,
    frame: u64,
    /// An attribute besides positions and normals is written down for each vertex.
    more: bool,
    /// Current values were set outside of Begin and End, and the streams do not know.
    pub(crate) behind: bool,
    normals: Stream<3>,
    colors: Stream<4>,
    tex: Stream<4>,
    materials: Vec<Materials>,
    material_of: Vec<u32>,
    pub(crate) runs: Vec<Run>,
    /// First vertex of the primitive between Begin and End, and its mode.
    open: usize,
    mode: u32,
    /// Begin/End pairs.
    pub(crate) calls: u64,
    /// There are quads in the batch.
    pub(crate) quads: bool,
}

impl Recorder {
    /// A primitive begins.
    #[inline(always)]
    pub(crate) fn begin(&mut self, mode: u32, current: &Current) {
        self.open = self.count();
        self.mode = mode;
        self.quads |= mode == QUADS;
        if self.open == 0 {
            self.start(current);
        } else if self.behind {
            self.set_normal(current.normal);
            self.set_color(current.color);
            self.set_tex(current.tex);
        }
        self.behind = false;
    }

    /// The mode of the primitive that is open, or was last.
    pub(crate) fn mode(&self) -> u32 {
        self.mode
    }

    /// Vertices so far.
    #[inline(always)]
    fn count(&self) -> usize {
        self.followed + self.positions.len()
    }

    #[cold]
    #[inline(never)]
    fn start(&mut self, current: &Current) {
        (self.normals.constant, self.colors.constant, self.tex.constant) =
            (current.normal, current.color, current.tex);
        self.materials.clear();
        self.materials.push(current.materials);
        self.material_of.clear();
    }

    /// The primitive ends.
    #[inline(always)]
    pub(crate) fn end(&mut self) {
        let count = (self.count() - self.open) as u32;
        self.calls += 1;
        match self.runs.last_mut() {
            Some(r) if r.mode == self.mode && r.count == count => r.times += 1,
            _ => self.runs.push(Run { mode: self.mode, count, times: 1 }),
        }
    }

    #[inline(always)]
    pub(crate) fn set_normal(&mut self, v: [f32; 3]) {
        let n = self.count();
        self.normals.set(v, n);
    }

    #[inline(always)]
    pub(crate) fn set_color(&mut self, v: [f32; 4]) {
        let n = self.count();
        self.colors.set(v, n);
        self.more |= self.colors.varying;
    }

    #[inline(always)]
    pub(crate) fn set_tex(&mut self, v: [f32; 4]) {
        let n = self.count();
        self.tex.set(v, n);
        self.more |= self.tex.varying;
    }

    /// The material is another from the next vertex on.
    pub(crate) fn set_materials(&mut self, m: &Materials) {
        let n = self.count();
        if n == 0 {
            self.materials.clear();
        } else if self.materials.last() == Some(m) {
            return;
        } else if self.material_of.is_empty() {
            self.material_of.resize(n, 0);
            self.more = true;
        }
        self.materials.push(*m);
    }

    /// A vertex with what is current.
    #[inline(always)]
    pub(crate) fn vertex(&mut self, v: [f32; 3], current: &Current) {
        match &self.expected {
            Some(mesh) if mesh.positions.get(self.followed).is_some_and(|p| is_at(p, v)) => {
                self.followed += 1
            }
            None if !self.positions.is_empty() => self.positions.push(v),
            // In parts: what lies in memory for the rare case would be put there for every vertex.
            _ => self.unexpected(v[0], v[1], v[2]),
        }
        if self.normals.varying {
            self.normals.values.push(current.normal);
        }
        if self.more {
            self.vertex_more(current);
        }
    }

    #[inline(never)]
    fn vertex_more(&mut self, current: &Current) {
        if self.colors.varying {
            self.colors.values.push(current.color);
        }
        if self.tex.varying {
            self.tex.values.push(current.tex);
        }
        if !self.material_of.is_empty() {
            self.material_of.push(self.materials.len() as u32 - 1);
        }
    }

    /// The first vertex of a batch, or one that is not what was expected.
    #[cold]
    #[inline(never)]
    fn unexpected(&mut self, x: f32, y: f32, z: f32) {
        let v = [x, y, z];
        if self.expected.is_none()
            && self.followed == 0
            && let Some(e) = self.earlier.get(&v.map(f32::to_bits))
        {
            self.expected = Some(e.mesh.clone());
            self.followed = 1;
            return;
        }
        self.write_down();
        self.positions.push(v);
    }

    /// Whether any position of a range of the batch is what `is` looks for.
    pub(crate) fn any_position(&self, from: u32, to: u32, is: impl Fn([f32; 3]) -> bool) -> bool {
        let range = from as usize..to as usize;
        match &self.expected {
            Some(mesh) => mesh.positions[range].iter().any(|p| is(p.to_array())),
            None => self.positions[range].iter().any(|p| is(*p)),
        }
    }

    /// The vertices that were followed become our own.
    pub(crate) fn write_down(&mut self) {
        if let Some(mesh) = self.expected.take() {
            let n = std::mem::take(&mut self.followed);
            self.positions.clear();
            self.positions.extend(mesh.positions[..n].iter().map(|p| p.to_array()));
        }
    }

    /// The geometry of the batch, when it is all that an earlier one was.
    pub(crate) fn followed(&mut self, kind: &Split) -> Option<Arc<Geometry>> {
        let mesh = self.expected.as_ref()?;
        let first = mesh.positions[0].to_array().map(f32::to_bits);
        let e = self.earlier.get_mut(&first)?;
        let whole = self.followed == mesh.positions.len() && Arc::ptr_eq(&e.mesh, mesh);
        if !whole || e.kind != *kind || e.runs != self.runs {
            return None;
        }
        e.frame = self.frame;
        self.expected = None;
        self.followed = 0;
        Some(e.geometry.clone())
    }

    /// This is what the batch was; it may come again.
    pub(crate) fn expect(&mut self, geometry: &Arc<Geometry>, kind: &Split) {
        const WORTH_FOLLOWING: usize = 1000;
        if self.positions.len() >= WORTH_FOLLOWING {
            let (geometry, mesh) = (geometry.clone(), geometry.mesh.clone());
            let e =
                Expected { geometry, mesh, runs: self.runs.clone(), kind: kind.clone(), frame: self.frame };
            self.earlier.insert(self.positions[0].map(f32::to_bits), e);
        }
    }

    /// A frame is over: what did not come again is not expected any more.
    pub(crate) fn frame_done(&mut self) {
        const KEPT_FRAMES: u64 = 3;
        self.frame += 1;
        let now = self.frame;
        self.earlier.retain(|_, e| now - e.frame <= KEPT_FRAMES);
    }

    /// Attributes that nobody needs any more: their memory serves again.
    pub(crate) fn give_back(&mut self, a: Attributes) {
        self.normals.give_back(a.normals);
        self.colors.give_back(a.colors);
        self.tex.give_back(a.tex);
    }

    /// The vertices of the open primitive with their attributes, taken out again: for the driver.
    pub(crate) fn withdraw(&mut self) -> (u32, Vec<([f32; 3], Current)>) {
        self.write_down();
        let all = self.attributes_now();
        let out = (self.open..self.positions.len())
            .map(|i| {
                let current = Current {
                    normal: all.normals.at(i),
                    color: all.colors.at(i),
                    tex: all.tex.at(i),
                    materials: *all.materials_at(i),
                };
                (self.positions[i], current)
            })
            .collect();
        self.positions.truncate(self.open);
        for (varying, values) in [(self.normals.varying, &mut self.normals.values)] {
            if varying {
                values.truncate(self.open);
            }
        }
        for s in [&mut self.colors, &mut self.tex] {
            if s.varying {
                s.values.truncate(self.open);
            }
        }
        self.material_of.truncate(self.open);
        (self.mode, out)
    }

    fn attributes_now(&self) -> Attributes {
        fn values<const N: usize>(s: &Stream<N>) -> Values<N> {
            if s.varying { Values::PerVertex(s.values.clone()) } else { Values::Constant(s.constant) }
        }
        Attributes {
            normals: values(&self.normals),
            colors: values(&self.colors),
            tex: values(&self.tex),
            materials: self.materials.clone(),
            material_of: self.material_of.clone(),
        }
    }

    /// Everything recorded; the recorder is empty then. Positions and runs stay for the caller to look at and clear.
    pub(crate) fn take_attributes(&mut self) -> Attributes {
        self.more = false;
        Attributes {
            normals: self.normals.take(),
            colors: self.colors.take(),
            tex: self.tex.take(),
            materials: std::mem::take(&mut self.materials),
            material_of: std::mem::take(&mut self.material_of),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::Cache;
    use crate::enums::*;

    #[test]
    fn attributes_that_change_late_keep_their_first_values_and_a_primitive_can_be_withdrawn() {
        let mut r = Recorder::default();
        let mut c = Current { color: [1.0; 4], ..Current::default() };
        r.begin(TRIANGLES, &c);
        for i in 0..3 {
            r.vertex([i as f32; 3], &c);
        }
        r.end();
        r.begin(POLYGON, &c);
        r.vertex([7.0; 3], &c);
        c.color = [0.5; 4];
        r.set_color(c.color);
        c.materials[0].shininess = 9.0;
        r.set_materials(&c.materials);
        r.vertex([8.0; 3], &c);
        let (mode, open) = r.withdraw();
        assert_eq!(mode, POLYGON);
        assert_eq!(open.len(), 2);
        assert_eq!((open[0].1.color, open[1].1.color), ([1.0; 4], [0.5; 4]));
        assert_eq!((open[0].1.materials[0].shininess, open[1].1.materials[0].shininess), (0.0, 9.0));
        assert_eq!(r.positions.len(), 3);
        let all = r.take_attributes();
        assert_eq!(all.colors.at(2), [1.0; 4]);
        assert_eq!(r.runs, [Run { mode: TRIANGLES, count: 3, times: 1 }]);
    }

    fn frame(r: &mut Recorder, cache: &mut Cache, points: &[[f32; 3]]) -> Arc<Geometry> {
        let current = Current::default();
        for p in points.chunks(3) {
            r.begin(TRIANGLES, &current);
            p.iter().for_each(|p| r.vertex(*p, &current));
            r.end();
        }
        let kind = &Split::default();
        let geometry = r.followed(kind).unwrap_or_else(|| {
            r.write_down();
            let made = cache.of_runs(&r.positions, &r.runs, kind);
            r.expect(&made, kind);
            made
        });
        r.take_attributes();
        r.positions.clear();
        r.runs.clear();
        r.frame_done();
        geometry
    }

    #[test]
    fn what_is_set_between_primitives_is_seen_by_the_next() {
        let (mut r, mut c) = (Recorder::default(), Current::default());
        for (i, color) in [[1.0; 4], [1.0; 4], [0.5; 4]].into_iter().enumerate() {
            c.color = color;
            r.behind = true;
            r.begin(TRIANGLES, &c);
            (0..3).for_each(|_| r.vertex([i as f32; 3], &c));
            r.end();
            assert_eq!(r.colors.varying, i == 2);
        }
        let all = r.take_attributes();
        assert_eq!([0, 5, 6, 8].map(|v| all.colors.at(v)[0]), [1.0, 1.0, 0.5, 0.5]);
    }

    #[test]
    fn vertices_that_come_again_are_followed_and_others_are_written_down() {
        let (mut r, mut cache) = (Recorder::default(), Cache::default());
        let points: Vec<[f32; 3]> = (0..3000).map(|i| [i as f32, (i % 7) as f32, f32::NAN]).collect();
        let first = frame(&mut r, &mut cache, &points);
        assert!(Arc::ptr_eq(&first, &frame(&mut r, &mut cache, &points)));
        assert_eq!((cache.hits, cache.misses), (0, 1), "the second frame was not even looked up");
        let mut moved = points.clone();
        moved[2999][0] += 1.0;
        let second = frame(&mut r, &mut cache, &moved);
        assert!(!Arc::ptr_eq(&first, &second));
        assert_eq!(second.mesh.positions[2999].x, 3000.0);
        assert_eq!(second.mesh.positions[2998].x, 2998.0);
        let shorter = frame(&mut r, &mut cache, &moved[..1500]);
        assert_eq!(shorter.mesh.positions.len(), 1500);
        assert!(Arc::ptr_eq(&first, &frame(&mut r, &mut cache, &points)), "back to what it was");
    }
}
