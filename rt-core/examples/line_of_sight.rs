//! Ray queries without the renderer: how much of a valley can be seen from a tower on the ridge?
//!
//! `cargo run --release -p rt-core --no-default-features --example line_of_sight`

use rt_core::prelude::*;

/// A ridge along y with hills beside it, `n` x `n` points over 10 km x 10 km.
fn terrain(n: u32) -> TriMesh {
    let height = |x: f32, y: f32| {
        400.0 * (-x * x / 2e6).exp() + 60.0 * (x / 300.0).sin() * (y / 400.0).cos()
    };
    let at = |i: u32| 10_000.0 * (i as f32 / (n - 1) as f32 - 0.5);
    let points = (0..n * n).map(|k| (at(k % n), at(k / n)));
    let positions = points.map(|(x, y)| Vec3::new(x, y, height(x, y))).collect();
    let corners = (0..n * n).filter(|k| k % n + 1 < n && k / n + 1 < n);
    let cells = corners.flat_map(|k| [[k, k + 1, k + n], [k + 1, k + n + 1, k + n]]);
    TriMesh::new(positions, cells.collect())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mesh = terrain(513);
    // One metre above the ground, so that a point does not hide itself.
    let places: Vec<Vec3> = mesh.positions.iter().map(|p| *p + Vec3::Z).collect();
    let world = World::from_mesh(mesh, &BuildOptions::default())?;

    let tower = Vec3::new(0.0, 0.0, 480.0);
    let rays: Vec<Ray> =
        places.iter().map(|p| Ray::new(tower, *p - tower).with_t_max(1.0)).collect();
    // All rays start at the tower, and neighbours go the same way: packets.
    let blocks = RayBlock::from_rays(&rays);
    let mut hidden = vec![0u16; blocks.len()];
    world.occluded_coherent(&blocks, &mut hidden)?;

    let hidden: u32 = hidden.iter().map(|mask| mask.count_ones()).sum();
    let seen = 100.0 * (1.0 - f64::from(hidden) / places.len() as f64);
    println!("{seen:.1} % of {} points can be seen from the tower", places.len());
    Ok(())
}
