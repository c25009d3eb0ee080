//! Helpers shared by the tests of several modules.

use rayon::ThreadPoolBuilder;
use std::collections::HashMap;

/// CRC-32 of the values' little-endian bytes: what `zlib.crc32(array)` gives in Python.
pub(crate) fn crc32_f32(values: &[f32]) -> u32 {
    let mut crc = flate2::Crc::new();
    for v in values {
        crc.update(&v.to_le_bytes());
    }
    crc.sum()
}

/// Runs `f` in a thread pool with exactly `threads` threads.
pub(crate) fn with_threads<T: Send>(threads: usize, f: impl FnOnce() -> T + Send) -> T {
    ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool").install(f)
}

/// Counts edges that are not used exactly once in each direction; zero for a closed, consistently
/// oriented surface.
pub(crate) fn open_or_flipped_edges(indices: &[[u32; 3]]) -> usize {
    let mut balance: HashMap<(u32, u32), (u32, u32)> = HashMap::new();
    for t in indices {
        for e in 0..3 {
            let (a, b) = (t[e], t[(e + 1) % 3]);
            let entry = balance.entry((a.min(b), a.max(b))).or_default();
            if a < b { entry.0 += 1 } else { entry.1 += 1 }
        }
    }
    balance.values().filter(|&&uses| uses != (1, 1)).count()
}

/// Volume enclosed by a closed mesh; positive when triangles are counter-clockwise seen from
/// outside.
pub(crate) fn volume(mesh: &rt_core::mesh::TriMesh) -> f64 {
    let t = (0..mesh.num_triangles()).map(|i| mesh.triangle(i).map(|p| p.as_dvec3()));
    t.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

/// Number of connected components of a mesh.
pub(crate) fn pieces(indices: &[[u32; 3]]) -> usize {
    fn root(parent: &mut HashMap<u32, u32>, mut v: u32) -> u32 {
        while let Some(&p) = parent.get(&v) {
            v = p;
        }
        v
    }
    let (mut parent, mut vertices) = (HashMap::new(), std::collections::HashSet::<u32>::new());
    for t in indices {
        vertices.extend(t);
        for e in 0..2 {
            let (a, b) = (root(&mut parent, t[e]), root(&mut parent, t[e + 1]));
            if a != b {
                // Link to the smaller id: ids grow along the surface, so chains stay short enough
                // for tests.
                parent.insert(a.max(b), a.min(b));
            }
        }
    }
    vertices.len() - parent.len()
}
