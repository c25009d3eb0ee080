//! What compact storage keeps and what its build needs, counted by the allocator. In a process of
//! its own, whose memory nothing else changes.
#![forbid(unsafe_code)]

use peak_alloc::PeakAlloc;
use rt_core::mesh::MeshSlices;
use rt_core::prelude::*;

#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

/// A sheet of waves, `n` by `n` cells of two triangles.
fn sheet(n: u32) -> TriMesh {
    let mut mesh = TriMesh::default();
    for i in 0..(n + 1) * (n + 1) {
        let (x, y) = ((i % (n + 1)) as f32 / n as f32, (i / (n + 1)) as f32 / n as f32);
        let z = 0.1 * (40.0 * x).sin() * (30.0 * y).cos();
        // No vertex shares a coordinate with another.
        let (x, y) = (x + 1e-3 * (50.0 * y).sin(), y + 1e-3 * (60.0 * x).cos());
        mesh.positions.push(Vec3::new(x, y, z));
    }
    for k in (0..n).flat_map(|j| (0..n).map(move |i| j * (n + 1) + i)) {
        mesh.indices.extend([[k, k + 1, k + n + 1], [k + 1, k + n + 2, k + n + 1]]);
    }
    mesh
}

/// What a build needs beside the tree that it keeps: the builder's 90 bytes per triangle for one
/// piece of 2^18 triangles, its parts before they are encoded, and the cache of one thread.
const BUFFER: usize = 64 << 20;

#[test]
fn compact_storage_keeps_sixteen_bytes_per_triangle_and_builds_in_little_more() {
    // The second has many pieces. An array of units that grew was copied: the tree was in memory
    // twice.
    for cells in [1000, 2200] {
        measure(&sheet(cells));
    }
}

fn measure(mesh: &TriMesh) {
    let triangles = mesh.indices.len();
    let placed = Instance { geometry: 0, world_from_object: DAffine3::IDENTITY };
    let options = BuildOptions { storage: Storage::Compact, ..Default::default() };
    // The threads of the pool are not part of it.
    rayon::join(|| (), || ());

    let before = HEAP.current_usage();
    HEAP.reset_peak_usage();
    let world = World::from_slices(&[MeshSlices::of_mesh(mesh)], vec![placed], &options).unwrap();
    let kept = HEAP.current_usage() - before;
    let peak = HEAP.peak_usage() - before;

    assert_eq!(world.report().primitives, triangles);
    let each = |bytes: usize| bytes as f64 / triangles as f64;
    println!(
        "kept {:.2} bytes per triangle, {:.2} of them reported; at the height {:.2}",
        each(kept),
        each(world.report().bytes),
        each(peak)
    );
    assert!(kept >= world.report().bytes, "the report names more than there is");
    // Nothing here is on a lattice: a sheet is the hardest case for the coding of coordinates.
    assert!(each(kept) <= 16.0, "{:.2} bytes per triangle", each(kept));
    assert!(peak <= kept * 3 / 2 + BUFFER, "{peak} bytes at the height, {kept} kept");
}
