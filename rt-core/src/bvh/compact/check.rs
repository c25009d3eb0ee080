//! Checks the units of a compact tree that come from a file, before a ray follows them: no number
//! in them leads out of the array, no path is endless, and no path is too deep.

use super::bits;
use super::boxes::EXPONENTS;
use super::cut::MAX_LEAVES;
use super::edges::EdgeVertex;
use super::meshlet::{HEADER_WORDS, Header, MAX_NODES, NODE, NONE};
use super::nodes::PLANE_WORDS;
use crate::bvh::layout::wide::{CHILD_ROW, ChildRef, MAX_DEPTH, NODE_UNITS, Unit, WIDTH};

/// Bits of a vertex number in a meshlet of at most 192 vertices.
const MAX_INDEX_BITS: u32 = 8;

/// Checks a tree, of which the root is at unit 0, and returns its depth. The error says what is
/// wrong with it.
pub(crate) fn check_units(units: &[Unit]) -> Result<usize, &'static str> {
    if units.len() < NODE_UNITS || units.len() >= ChildRef::MAX_UNITS {
        return Err("it has no root, or more units than references reach");
    }
    let (mut nodes, mut depth) = (0, 0);
    let mut open = vec![(0, 1)];
    while let Some((at, level)) = open.pop() {
        nodes += 1;
        depth = level.max(depth);
        if nodes > units.len() / NODE_UNITS {
            return Err("its nodes lead back to themselves");
        }
        if depth > MAX_DEPTH {
            return Err("it is too deep");
        }
        let Some(node) = units.get(at..at + NODE_UNITS) else {
            return Err("a node lies outside");
        };
        for slot in 0..WIDTH {
            let child = ChildRef(node[CHILD_ROW].bits()[slot]);
            if child == ChildRef::NONE {
                // Rays test all eight boxes.
                let lows = [0, 2, 4].map(|row| node[row].0[slot]);
                let highs = [1, 3, 5].map(|row| node[row].0[slot]);
                if lows != [f32::INFINITY; 3] || highs != [f32::NEG_INFINITY; 3] {
                    return Err("a child that does not exist has a box");
                }
            } else if child.is_leaf() {
                let words = units.get(child.unit()..).unwrap_or_default();
                check_meshlet(bytemuck::cast_slice(words))?;
            } else {
                open.push((child.unit(), level + 1));
            }
        }
    }
    Ok(depth)
}

/// Checks the meshlet at the start of `words`: all that [`super::expand`] reads of it.
fn check_meshlet(words: &[u32]) -> Result<(), &'static str> {
    if words.len() < HEADER_WORDS {
        return Err("a meshlet lies outside");
    }
    let header = Header::read(words);
    let in_range = header.nodes as usize <= MAX_NODES
        && header.leaves as usize <= MAX_LEAVES
        && header.numbers.range_bits <= u32::BITS
        && header.numbers.number_bits() <= u32::BITS
        && header.index_bits <= MAX_INDEX_BITS
        && header.lattice.exponents.iter().all(|e| EXPONENTS.contains(e))
        && header.axes.iter().all(|axis| axis.bits <= u32::BITS)
        && !(header.on_edges && header.axes.iter().any(|axis| axis.entries == 0));
    if !in_range {
        return Err("the header of a meshlet is out of range");
    }
    let at = check_nodes(words, &header)?;

    // ---- Triangles and vertices: 64 bits are read at a time, from where one starts.
    if at != HEADER_WORDS + header.node_words as usize {
        return Err("the nodes of a meshlet do not end where its header says");
    }
    let sections = header.sections();
    if sections.end / 32 + 3 > words.len() {
        return Err("the numbers of a meshlet end outside");
    }
    for triangle in 0..header.triangles {
        let at = sections.triangles + (triangle * sections.triangle) as usize;
        for corner in 0..3 {
            let at = at + (corner * header.index_bits) as usize;
            if bits::read(words, at, header.index_bits) >= header.vertices {
                return Err("a triangle has a vertex that does not exist");
            }
        }
        let at = at + (3 * header.index_bits) as usize;
        let number = bits::read(words, at, header.numbers.number_bits());
        if header.numbers.group(number.into()) >= header.numbers.groups {
            return Err("the number of a triangle is in a group that does not exist");
        }
    }
    for vertex in 0..header.vertices {
        let mut at = sections.vertices + (vertex * sections.vertex) as usize;
        if let Some(edge) = sections.edge {
            let EdgeVertex { axis, planes } = edge.read(bits::read_57(words, at));
            let planes_of = |a: usize| header.axes[a % 3].entries;
            if axis > 2 || planes[0] >= planes_of(axis + 1) || planes[1] >= planes_of(axis + 2) {
                return Err("a vertex lies on an edge that does not exist");
            }
            continue;
        }
        for axis in &header.axes {
            let number = bits::read(words, at, axis.number_bits());
            if axis.entries != 0 && number >= axis.entries {
                return Err("a vertex has a coordinate that does not exist");
            }
            at += axis.number_bits() as usize;
        }
    }
    Ok(())
}

/// Checks the small tree of a meshlet, and returns the word behind it.
fn check_nodes(words: &[u32], header: &Header) -> Result<usize, &'static str> {
    let (mut at, mut nodes, mut leaves, mut triangles) = (HEADER_WORDS, 1, 0, 0);
    let mut last = at;
    for node in 0..header.nodes {
        let Some(&kinds) = words.get(at) else { return Err("the nodes of a meshlet end outside") };
        last = at;
        let mut count = 0;
        for slot in 0..WIDTH {
            match kinds >> (4 * slot) & 15 {
                NONE => break,
                NODE => nodes += 1,
                kind if kind < 4 => {
                    leaves += 1;
                    triangles += kind + 1;
                }
                _ => return Err("a child in a meshlet is of no kind"),
            }
            count += 1;
        }
        // Nodes come after those that name them.
        if node + 1 < header.nodes && nodes <= node + 1 {
            return Err("a node of a meshlet has no parent");
        }
        at += 1 + (6usize * count).div_ceil(4);
    }
    if (nodes, leaves, triangles) != (header.nodes, header.leaves, header.triangles) {
        return Err("the nodes of a meshlet do not agree with its header");
    }
    // Of the last node, rays read as much as eight children have.
    let end = at.max(last + 1 + PLANE_WORDS);
    if end > words.len() { Err("the nodes of a meshlet end outside") } else { Ok(at) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::build::UNWATCHED;
    use crate::bvh::compact::CompactBvh;
    use crate::bvh::layout::local_frame::LocalFrame;
    use crate::bvh::options::BuildQuality;
    use crate::mesh::TriMesh;
    use glam::Vec3;

    /// A lattice of quadrilaterals, row by row, of which each is two triangles.
    fn sheet(cells: u32) -> TriMesh {
        let mut mesh = TriMesh::default();
        for i in 0..(cells + 1) * (cells + 1) {
            let (x, y) = ((i % (cells + 1)) as f32, (i / (cells + 1)) as f32);
            mesh.positions.push(Vec3::new(x, y, (0.3 * x).sin()));
        }
        for i in 0..cells * cells {
            let a = i / cells * (cells + 1) + i % cells;
            let c = a + cells + 1;
            mesh.indices.extend([[a, a + 1, c], [c, a + 1, c + 1]]);
        }
        mesh
    }

    /// The units of a tree, and the first unit of a meshlet whose triangles would need as many bits
    /// with one group less.
    fn tree() -> (Vec<Unit>, usize) {
        let mesh = sheet(16);
        let frame = LocalFrame::around(mesh.origin, 32.0);
        let tree = CompactBvh::build(mesh.triangles(), &frame, BuildQuality::Balanced, &UNWATCHED);
        let Ok(tree) = tree else { panic!("nobody stops it") };
        let units = tree.bvh.units;
        let children = units[CHILD_ROW].bits().map(ChildRef).into_iter();
        let mut meshlets = children.filter(|child| child.is_leaf()).map(|child| child.unit());
        let meshlet = meshlets.find(|&at| {
            let groups = Header::read(bytemuck::cast_slice(&units[at..])).numbers.groups;
            groups > 2 && bits::width(groups - 1) == bits::width(groups - 2)
        });
        (units, meshlet.expect("a meshlet with several groups"))
    }

    #[test]
    fn headers_that_contradict_what_follows_them_are_refused_by_what_is_wrong() {
        let (sound, meshlet) = tree();
        assert!(check_units(&sound).is_ok());
        let header = Header::read(bytemuck::cast_slice(&sound[meshlet..]));
        // A word of the header, the bits that are cleared, those that are set, and the reason.
        let cases = [
            (0, 63 << 23, 33 << 23, "out of range"),
            (0, 63, header.triangles - 2, "do not agree"),
            (0, 255 << 6, 0, "a vertex that does not exist"),
            (9, 63 << 25, (header.numbers.groups - 2) << 25, "a group that does not exist"),
            (9, 127 << 18, 0, "do not end where"),
            (10, 31 << 24, 31 << 24, "out of range"),
        ];
        for (word, cleared, set, reason) in cases {
            let mut units = sound.clone();
            let words: &mut [u32] = bytemuck::cast_slice_mut(&mut units[meshlet..]);
            words[word] = words[word] & !cleared | set;
            let error = check_units(&units).expect_err(reason);
            assert!(error.contains(reason), "word {word}: {error}, not {reason}");
        }
    }
}
