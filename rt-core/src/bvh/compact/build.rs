//! Builds compact trees: piece by piece, meshlets first, the nodes above them last.
//!
//! ```text
//! triangles ─ divide ─► pieces ─ build_wide ─► trees of numbers ─ cut ─► parts
//! parts ─ encode ─► meshlets;   their boxes ─ build_wide ─► nodes above
//! ```

use super::CompactBvh;
use super::cache::new_key;
use super::cut::{Part, parts};
use super::meshlet::{Encoder, one_to_a_leaf};
use super::nodes::PLANE_WORDS;
use super::pieces::{PIECE, Pieces, divide};
use crate::bvh::build::{PrimRef, Progress, Stopped, build_wide};
use crate::bvh::layout::id_leaf::IdWriter;
use crate::bvh::layout::local_frame::LocalFrame;
use crate::bvh::layout::triangles::TriWriter;
use crate::bvh::layout::wide::{
    CHILD_ROW, ChildRef, LEAF_SIZE, LeafWriter, MAX_DEPTH, NODE_UNITS, Unit, WideBvh,
};
use crate::bvh::options::BuildQuality;
use crate::math::Aabb;
use crate::mesh::Triangles;
use rayon::prelude::*;

/// Parts that one task encodes.
const PARTS_PER_TASK: usize = 128;

/// Of so many pieces, one is encoded first, to know how much room all of them need. An array of
/// units that grows is copied, as its alignment is more than allocators move: the tree would be in
/// memory twice, and 259 million triangles took 40.9 bytes each at the height for 18.6 in the end.
const SAMPLE_STRIDE: usize = 16;
/// With fewer pieces, a copy takes less than the builder of one.
const FEWEST_TO_SAMPLE: usize = 16;
/// Room by that of the sample: pieces differ.
const ROOM_FACTOR: f64 = 1.03;

/// Units behind a meshlet that has no node behind it.
const UNITS_BEHIND: usize = (4 * PLANE_WORDS).div_ceil(size_of::<Unit>());

/// Leaves of the nodes above: meshlets, which lie elsewhere in the array.
struct MeshletRefs<'m>(&'m [(Aabb, usize)]);

impl LeafWriter for MeshletRefs<'_> {
    const UNITS: usize = 0;
    const CAPACITY: usize = 1;
    const COUNTS: bool = false;

    fn write(&self, _: &[u32], _: &mut [Unit]) {}

    fn reference(&self, _: usize, prims: &[u32]) -> ChildRef {
        ChildRef::leaf(self.0[prims[0] as usize].1, 1)
    }
}

impl CompactBvh {
    /// Triangle `i` of the mesh gets the number `i`.
    pub(crate) fn build(
        mesh: Triangles<'_>,
        frame: &LocalFrame,
        quality: BuildQuality,
        progress: &Progress<'_>,
    ) -> Result<CompactBvh, Stopped> {
        let triangles = TriWriter::new(mesh, frame, 0);
        let usable = |i: u32| progress.goes_on_at(i) && mesh.is_renderable(i as usize);
        let count = mesh.indices.len();
        let pieces = divide(&triangles, count, usable, PIECE, progress)?;
        let skipped = count - pieces.ids.len();
        let tree = CompactBvh::of_pieces(&triangles, pieces, quality, progress)?;
        Ok(CompactBvh { skipped, ..tree })
    }

    /// The tree of the triangles of some pieces.
    pub(crate) fn of_pieces(
        triangles: &TriWriter<'_>,
        pieces: Pieces,
        quality: BuildQuality,
        progress: &Progress<'_>,
    ) -> Result<CompactBvh, Stopped> {
        let Pieces { ids, ends } = pieces;

        // ---- The meshlets, behind the place of the root.
        let mut notes = Vec::new();
        let mut units = vec![Unit::ZERO; NODE_UNITS];
        let mut placed: Vec<(Aabb, usize)> = Vec::new();
        let starts = std::iter::once(0).chain(ends.iter().copied());
        let pieces: Vec<&[u32]> = starts
            .zip(&ends)
            .map(|(start, &end)| &ids[start..end])
            .filter(|piece| !piece.is_empty())
            .collect();
        let mut encode = |piece: &[u32]| {
            progress.check()?;
            encode_piece(triangles, piece, quality, &mut notes, progress)
        };
        let mut sample = Vec::new();
        if pieces.len() >= FEWEST_TO_SAMPLE {
            for piece in pieces.iter().step_by(SAMPLE_STRIDE) {
                sample.push(encode(piece)?);
            }
            units.reserve_exact(room_for_all(&sample, &pieces));
        }
        let mut sample = sample.into_iter();
        for (i, piece) in pieces.iter().enumerate() {
            let sampled = if i % SAMPLE_STRIDE == 0 { sample.next() } else { None };
            let meshlets = sampled.map_or_else(|| encode(piece), Ok)?;
            append(meshlets, &mut units, &mut placed);
        }
        drop(pieces);
        drop(ids);

        // ---- The nodes above, behind the meshlets; the root goes to the start.
        let refs = placed.iter().enumerate();
        let refs = refs.map(|(i, (bounds, _))| PrimRef::new(*bounds, i as u32)).collect();
        let above = build_wide(refs, &MeshletRefs(&placed), one_to_a_leaf(), &mut notes, progress)?;
        // No tree of meshlets is deeper than one of triangles may be, and theirs end above it.
        debug_assert!(above.depth <= MAX_DEPTH, "depth {}", above.depth);
        drop(placed);
        let moved = units.len() - NODE_UNITS;
        grow(&mut units, above.units.len() - NODE_UNITS);
        for (n, node) in above.units.chunks_exact(NODE_UNITS).enumerate() {
            let at = if n == 0 { 0 } else { units.len() };
            if n > 0 {
                units.extend_from_slice(node);
            } else {
                units[..NODE_UNITS].copy_from_slice(node);
            }
            for child in units[at + CHILD_ROW].bits_mut() {
                let reference = ChildRef(*child);
                if !reference.is_leaf() {
                    *child = reference.moved(moved).0;
                }
            }
        }
        if above.units.len() == NODE_UNITS {
            // Rays read the last node of a meshlet as if it had eight children.
            grow(&mut units, UNITS_BEHIND);
            units.extend([Unit::ZERO; UNITS_BEHIND]);
        }
        // The copy of a large tree would be the height of its build: it keeps a little room.
        if ends.len() < FEWEST_TO_SAMPLE || units.capacity() - units.len() > units.len() / 16 {
            units.shrink_to_fit();
        }
        let bvh = WideBvh { units, bounds: above.bounds, depth: above.depth };
        Ok(CompactBvh { bvh, skipped: 0, notes, key: new_key() })
    }
}

/// Meshlets, each with its box and its first unit among these.
struct Meshlets {
    units: Vec<Unit>,
    placed: Vec<(Aabb, usize)>,
}

/// The meshlets of a piece, task by task; the tasks are the same for any number of threads.
fn encode_piece(
    triangles: &TriWriter<'_>,
    piece: &[u32],
    quality: BuildQuality,
    notes: &mut Vec<String>,
    progress: &Progress<'_>,
) -> Result<Vec<Meshlets>, Stopped> {
    let refs = piece.par_iter().with_min_len(1 << 12);
    let refs: Vec<PrimRef> = refs.map(|&i| PrimRef::new(triangles.bounds(i), i)).collect();
    let tree = build_wide(refs, &IdWriter::<LEAF_SIZE>, quality.config(), notes, progress)?;
    let parts = parts(&tree);
    drop(tree);
    let encode = |parts: &[Part]| {
        let (mut encoder, mut units, mut placed) = (Encoder::default(), Vec::new(), Vec::new());
        parts.iter().for_each(|p| encoder.write(p, triangles, &mut units, &mut placed));
        Meshlets { units, placed }
    };
    Ok(parts.par_chunks(PARTS_PER_TASK).map(encode).collect())
}

/// Units for all pieces and for the nodes above their meshlets, by those of a sample.
fn room_for_all(sample: &[Vec<Meshlets>], pieces: &[&[u32]]) -> usize {
    let sampled: usize = pieces.iter().step_by(SAMPLE_STRIDE).map(|piece| piece.len()).sum();
    let all: usize = pieces.iter().map(|piece| piece.len()).sum();
    let tasks = || sample.iter().flatten();
    let units: usize = tasks().map(|task| task.units.len()).sum();
    let meshlets: usize = tasks().map(|task| task.placed.len()).sum();
    // A node above has six children, more or less.
    let units = (units + NODE_UNITS * meshlets / 6) as f64;
    (ROOM_FACTOR * units * all as f64 / sampled.max(1) as f64) as usize
}

/// Appends the meshlets of all tasks.
fn append(tasks: Vec<Meshlets>, units: &mut Vec<Unit>, placed: &mut Vec<(Aabb, usize)>) {
    grow(units, tasks.iter().map(|task| task.units.len()).sum());
    for task in tasks {
        let first = units.len();
        placed.extend(task.placed.into_iter().map(|(bounds, at)| (bounds, first + at)));
        units.extend_from_slice(&task.units);
    }
}

/// Makes room for `more` units where there is none. Doubling would take twice the memory of the
/// tree.
fn grow(units: &mut Vec<Unit>, more: usize) {
    if units.capacity() - units.len() < more {
        units.reserve_exact(more.max(units.len() / 8));
    }
}
