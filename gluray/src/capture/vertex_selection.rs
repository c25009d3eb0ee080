//! The vertices that a draw call names, by number or by index, and the triangles that they make.

use crate::capture::draw::{component, component_bytes};
use crate::capture::geometry_cache::hash;
use crate::capture::primitives::{QuadSplit, triangulate};
use crate::enums::*;
use crate::interpose::client_memory::ArraySource;
use crate::state::snapshot::Snapshot;

/// The vertices of a draw.
pub(crate) enum VertexSelection {
    /// Consecutive vertices of the arrays.
    Range { first: usize, count: usize },
    /// Vertices one by one.
    Listed(VertexList),
}

/// Vertices one by one.
pub(crate) struct VertexList {
    vertices: Vec<u32>,
    /// The smallest number, and the span from it on.
    least: usize,
    count: usize,
    /// Where the vertices of each of several draws in one call end. Empty for one draw.
    ends: Vec<usize>,
    /// The program has given indices, rather than ranges of the arrays.
    indexed: bool,
}

/// Decodes indices of `width` bytes each, with the index that restarts primitives.
pub(crate) fn decode_indices(
    bytes: &[u8],
    width: usize,
    base: i32,
    restart: Option<u32>,
) -> impl Iterator<Item = u32> {
    let decode = |b: &[u8]| match *b {
        [a] => u32::from(a),
        [a, b] => u32::from(u16::from_ne_bytes([a, b])),
        [a, b, c, d] => u32::from_ne_bytes([a, b, c, d]),
        _ => 0,
    };
    let place = move |raw: u32| match restart {
        Some(r) if r == raw => VertexSelection::RESTART,
        _ => raw.wrapping_add_signed(base),
    };
    bytes.chunks_exact(width).map(move |b| place(decode(b)))
}

impl VertexSelection {
    /// The index at which a primitive ends and another one begins.
    const RESTART: u32 = u32::MAX;

    /// Vertices by index.
    pub(crate) fn indexed(
        indices: Vec<u32>,
        restarts: bool,
    ) -> Result<VertexSelection, &'static str> {
        VertexSelection::listed(indices, Vec::new(), true, restarts)
    }

    /// The vertices of several draws, which end at `ends`.
    pub(crate) fn several(
        vertices: Vec<u32>,
        ends: Vec<usize>,
        indexed: bool,
        restarts: bool,
    ) -> Result<VertexSelection, &'static str> {
        VertexSelection::listed(vertices, ends, indexed, restarts)
    }

    fn listed(
        vertices: Vec<u32>,
        ends: Vec<usize>,
        indexed: bool,
        restarts: bool,
    ) -> Result<VertexSelection, &'static str> {
        let real = || vertices.iter().filter(|i| !restarts || **i != VertexSelection::RESTART);
        let (least, count) = match (real().min(), real().max()) {
            (Some(&least), Some(&most)) => (least as usize, (most - least) as usize + 1),
            _ => (0, 0),
        };
        // The length of client arrays is unknown: a wrong index must not make us read gigabytes.
        if count > 1 << 28 {
            return Err("indices that are too far apart");
        }
        Ok(VertexSelection::Listed(VertexList { vertices, least, count, ends, indexed }))
    }

    /// The key of the geometry of these elements of an array of positions, whose bytes are given.
    pub(super) fn key(
        &self,
        mode: u32,
        bytes: &[u8],
        layout: (usize, u32, usize, bool),
        split: &QuadSplit,
    ) -> u128 {
        let (stride, kind, size, _) = layout;
        let rules = u64::from(split.first_provokes) << 1 | u64::from(split.all_turned);
        let (_, count) = self.span();
        let tail =
            [stride as u64, u64::from(kind), size as u64, u64::from(mode), rules, count as u64];
        let tail = bytemuck::cast_slice(&tail);
        let turned = bytemuck::cast_slice(&split.turned);
        match self {
            VertexSelection::Range { .. } => hash(&[bytes, tail, turned]),
            VertexSelection::Listed(VertexList { vertices, least, ends, .. }) => {
                let (vertices, ends) = (bytemuck::cast_slice(vertices), bytemuck::cast_slice(ends));
                hash(&[bytes, vertices, ends, &least.to_ne_bytes(), tail, turned])
            }
        }
    }

    /// The first vertex, and the number of vertices from it on.
    pub(crate) fn span(&self) -> (usize, usize) {
        match self {
            VertexSelection::Range { first, count } => (*first, *count),
            VertexSelection::Listed(VertexList { least, count, .. }) => (*least, *count),
        }
    }

    /// Up to `most` different vertices, spread over the draw.
    pub(crate) fn some(&self, most: usize) -> Vec<u32> {
        let n = match self {
            VertexSelection::Range { count, .. } => *count,
            VertexSelection::Listed(list) => list.vertices.len(),
        };
        let take = most.min(n);
        let number = |i: usize| match self {
            VertexSelection::Range { first, .. } => (first + i) as u32,
            VertexSelection::Listed(list) => list.vertices[i],
        };
        let mut out: Vec<u32> =
            (0..take).map(|i| number(i * (n - 1) / (take - 1).max(1))).collect();
        out.sort_unstable();
        out.dedup();
        out
    }

    /// How the driver splits quads when it is unknown what it clips.
    pub(crate) fn plain_split(&self, first_provokes: bool) -> QuadSplit {
        let all_turned = matches!(self, VertexSelection::Listed(VertexList { indexed: true, .. }));
        QuadSplit { first_provokes, all_turned, turned: Vec::new() }
    }

    /// How the driver splits quads: see [`QuadSplit`].
    pub(crate) fn split(
        &self,
        mode: u32,
        s: &Snapshot,
        position: &ArraySource,
        bytes: &[u8],
    ) -> QuadSplit {
        let mut split = self.plain_split(s.first_vertex_provokes);
        split.all_turned |= s.turns_quads();
        if mode != QUADS || split.all_turned {
            return split;
        }
        let clipped = s.clips();
        let (step, one, size) =
            (position.step(), component_bytes(position.kind), position.size.min(3));
        let clips = |vertex: usize| {
            let at = vertex * step;
            let mut p = [0.0; 3];
            for (k, v) in p.iter_mut().enumerate().take(size) {
                let b = bytes.get(at + k * one..at + (k + 1) * one);
                *v = b.map_or(0.0, |b| component(b, position.kind, false));
            }
            clipped(p)
        };
        let place = |i: u32| match self {
            VertexSelection::Range { .. } => i as usize,
            VertexSelection::Listed(l) => (l.vertices[i as usize] as usize).wrapping_sub(l.least),
        };
        for [first, end] in self.draws() {
            split.find_clipped_quads(first, end, |from, to| (from..to).any(|i| clips(place(i))));
        }
        split
    }

    /// The first and last number of each draw in the order of drawing; one, but for several draws
    /// in a call.
    fn draws(&self) -> Vec<[u32; 2]> {
        match self {
            VertexSelection::Range { count, .. } => vec![[0, *count as u32]],
            VertexSelection::Listed(list) if list.ends.is_empty() => {
                vec![[0, list.vertices.len() as u32]]
            }
            VertexSelection::Listed(list) => {
                let firsts = std::iter::once(&0).chain(&list.ends);
                firsts.zip(&list.ends).map(|(a, b)| [*a as u32, *b as u32]).collect()
            }
        }
    }

    /// The triangles, as vertex numbers of the span.
    pub(crate) fn triangles(&self, mode: u32, split: &QuadSplit) -> Vec<[u32; 3]> {
        let mut out = Vec::new();
        for [first, end] in self.draws() {
            triangulate(mode, first, end - first, split, &mut out);
        }
        if let VertexSelection::Listed(list) = self {
            let vertex = |i: u32| list.vertices[i as usize] - list.least as u32;
            out.iter_mut().for_each(|t| *t = t.map(vertex));
        }
        out
    }

    /// The vertex numbers of the span in drawing order. `None` separates primitives.
    pub(super) fn order(&self) -> Box<dyn Iterator<Item = Option<usize>> + '_> {
        let list = match self {
            VertexSelection::Range { count, .. } => return Box::new((0..*count).map(Some)),
            VertexSelection::Listed(list) => list,
        };
        let place = move |i: &u32| {
            (*i as usize).checked_sub(list.least).filter(|_| *i != VertexSelection::RESTART)
        };
        Box::new(self.draws().into_iter().enumerate().flat_map(move |(draw, [first, end])| {
            let between = (draw > 0).then_some(None);
            let vertices = &list.vertices[first as usize..end as usize];
            between.into_iter().chain(vertices.iter().map(place))
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_draws_of_one_call_share_no_primitive() {
        let list = VertexSelection::several(vec![5, 6, 7, 8, 10, 11, 12], vec![4, 7], true, false);
        let list = list.expect("few");
        assert_eq!(list.span(), (5, 8));
        let split = list.plain_split(false);
        assert_eq!(list.triangles(TRIANGLE_STRIP, &split), [[0, 1, 2], [2, 1, 3], [5, 6, 7]]);
        // The fourth vertex of the first draw begins no triangle.
        assert_eq!(list.triangles(TRIANGLES, &split), [[0, 1, 2], [5, 6, 7]]);
        let order: Vec<_> = list.order().collect();
        let part = [Some(0), Some(1), Some(2), Some(3), None, Some(5), Some(6), Some(7)];
        assert_eq!(order, part);
    }
}
