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

/// Isosurfaces of a field on a lattice, `spacing` apart in it: every vertex lies on an edge. With
/// many surfaces to a cell, few triangles share one.
fn nested_surfaces(cells: u32, spacing: f32) -> TriMesh {
    let field = |p: [u32; 3]| {
        let [x, y, z] = p.map(|x| x as f32);
        x + y + z + (0.5 * x).sin() * (0.4 * y).cos() + (0.3 * z).sin()
    };
    let mut mesh = TriMesh::default();
    for cell in 0..cells.pow(3) {
        let corner = [cell % cells, cell / cells % cells, cell / cells / cells];
        let ends = (0..12u32).map(|edge| (edge as usize / 4, edge % 4)).map(|(axis, at)| {
            let mut p = corner;
            p[(axis + 1) % 3] += at & 1;
            p[(axis + 2) % 3] += at >> 1;
            let low = field(p);
            let start = Vec3::from_array(p.map(|x| x as f32));
            p[axis] += 1;
            (axis, start, low, field(p))
        });
        let ends: Vec<_> = ends.collect();
        let lowest = ends.iter().map(|e| e.2.min(e.3)).fold(f32::MAX, f32::min);
        let highest = ends.iter().map(|e| e.2.max(e.3)).fold(f32::MIN, f32::max);
        let first = (lowest / spacing).ceil() as i32;
        for value in (first..).map(|k| k as f32 * spacing).take_while(|&value| value < highest) {
            let mut polygon: Vec<Vec3> = Vec::new();
            for &(axis, mut point, low, high) in &ends {
                if (low < value) != (high < value) {
                    point[axis] += (value - low) / (high - low);
                    polygon.push(point / cells as f32);
                }
            }
            let middle = polygon.iter().sum::<Vec3>() / polygon.len() as f32;
            let (u, v) = (Vec3::new(1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, -2.0));
            let angle = |p: &Vec3| (3f32.sqrt() * (*p - middle).dot(u)).atan2((*p - middle).dot(v));
            polygon.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
            let first = mesh.positions.len() as u32;
            let last = polygon.len() as u32;
            mesh.indices.extend((2..last).map(|k| [first, first + k - 1, first + k]));
            mesh.positions.extend(polygon);
        }
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
    // Isosurfaces that are closer than the cells of their lattice are large: 432 of the wavelet
    // took 18.6 bytes per triangle.
    measure(&nested_surfaces(40, 0.2));
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
    // Nothing of a sheet is on a lattice, which is the hardest case for the coding of coordinates.
    assert!(each(kept) <= 16.0, "{:.2} bytes per triangle", each(kept));
    assert!(peak <= kept * 3 / 2 + BUFFER, "{peak} bytes at the height, {kept} kept");
}
